# Runs of a batch by our simulator.
use rule pour as batch_pour with:
    input:
        **READY,
        samples=rules.propose.output.samples,
    output:
        pours=f"{BATCH}/{{runs}}/{{job}}.pours.json",
        berries=f"{BATCH}/{{runs}}/{{job}}.npz",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}.tsv"
    wildcard_constraints:
        job=r"\d{3,5}",
    params:
        purpose=lambda wildcards: (
            wildcards.strategy if wildcards.strategy in PURPOSE_STREAMS else "batches"
        ),
        sample=lambda wildcards: int(wildcards.job),
        seeds=lambda wildcards: samples_of_batch(wildcards.strategy, wildcards.batch)[
            int(wildcards.job)
        ],
    message:
        "Pouring sample {wildcards.job} of {wildcards.strategy}, batch {wildcards.batch}"


use rule measure_runs as measure_batch_runs with:
    input:
        **GRAIN,
        pours=rules.batch_pour.output.pours,
        berries=rules.batch_pour.output.berries,
    output:
        result=f"{BATCH}/{{runs}}/{{job}}.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}_measured.tsv"
    wildcard_constraints:
        job=r"\d{3,5}",
    message:
        "Measuring the runs of sample {wildcards.job} of {wildcards.strategy}, batch {wildcards.batch}"


# What a measured job of a batch leaves, by the ends of the names.
ENDS_OF_JOB = ("json", "pours.json", "npz")
