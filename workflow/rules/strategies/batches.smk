# Common to all strategies with several batches: a batch of samples is poured, measured and put into a table. Its analysis is
# a checkpoint of its own, which decides on the next batch: `sequential_batch`, `after_screening` and on, `refine_round`.
wildcard_constraints:
    strategy="|".join(BATCHES),
    batch=r"(batch|round)_\d{1,4}|screening|ascent|surface|check",


use rule pour as batch_pour with:
    input:
        **READY,
        samples=samples_of_batch,
    output:
        pours=f"{RESULTS}/{{strategy}}/{{batch}}/{{runs}}/{{job}}.pours.json",
        berries=f"{RESULTS}/{{strategy}}/{{batch}}/{{runs}}/{{job}}.npz",
    log:
        f"{RESULTS}/logs/{{strategy}}/{{batch}}_{{runs}}_{{job}}.log",
    wildcard_constraints:
        job=r"\d{3,5}",
    params:
        purpose=lambda wildcards: BATCHES[wildcards.strategy].purpose,
        sample=lambda wildcards: int(wildcards.job),
        seeds=lambda wildcards: BATCHES[wildcards.strategy].seeds(wildcards),
    message:
        "Pouring sample {wildcards.job} of {wildcards.strategy}, {wildcards.batch}"


use rule measure_runs as measure_batch_runs with:
    input:
        **GRAIN,
        pours=rules.batch_pour.output.pours,
        berries=rules.batch_pour.output.berries,
    output:
        result=f"{RESULTS}/{{strategy}}/{{batch}}/{{runs}}/{{job}}.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/{{batch}}_{{runs}}_{{job}}_measured.log",
    wildcard_constraints:
        job=r"\d{3,5}",
    message:
        "Measuring the runs of sample {wildcards.job} of {wildcards.strategy}, {wildcards.batch}"


use rule dataset as batch_dataset with:
    input:
        samples=samples_of_batch,
        jobs=jobs_of_batch,
    output:
        dataset=f"{RESULTS}/{{strategy}}/{{batch}}/dataset.csv",
        runs=f"{RESULTS}/{{strategy}}/{{batch}}/runs.csv",
        summary=f"{RESULTS}/{{strategy}}/{{batch}}/dataset_summary.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/{{batch}}_dataset.log",
    message:
        "Table of {wildcards.strategy}, {wildcards.batch}"
