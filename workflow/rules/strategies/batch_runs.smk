# Runs of a batch by a program of the user's own.
use rule simulate as batch_simulate with:
    input:
        samples=rules.propose.output.samples,
    output:
        record=f"{BATCH}/{{runs}}/{{job}}/{{run}}.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}_{{run}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}_{{run}}.tsv"
    wildcard_constraints:
        job=r"\d{3,5}",
        run=r"\d+",
    params:
        purpose=lambda wildcards: (
            wildcards.strategy if wildcards.strategy in PURPOSE_STREAMS else "batches"
        ),
        sample=lambda wildcards: int(wildcards.job),
    message:
        "{PROGRAM.name}, {wildcards.strategy}, batch {wildcards.batch}, sample {params.sample}, run {wildcards.run}:"
        " {params.command}"


use rule measure_runs as measure_batch_runs with:
    input:
        records=lambda wildcards: results_folder.list_run_records(
            f"{BATCH}/{{runs}}".format(**wildcards),
            {
                wildcards.job: samples_of_batch(wildcards.strategy, wildcards.batch)[
                    int(wildcards.job)
                ]
            },
        ),
    output:
        result=f"{BATCH}/{{runs}}/{{job}}.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}_measured.tsv"
    wildcard_constraints:
        job=r"\d{3,5}",
    message:
        "Reading the responses of sample {wildcards.job} of {wildcards.strategy}, batch {wildcards.batch}"


# What a measured job of a batch leaves, by the ends of the names.
ENDS_OF_JOB = ("json",)
