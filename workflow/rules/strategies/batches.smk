# One loop for every strategy with several batches. `propose` reads the tables of all batches so far, and writes the samples of the
# next one or those of the answer; as it decides whether another batch follows, it is a checkpoint. A batch is poured, measured
# and put into a table. The last folder holds the answer, which is poured again unless its last batch did so.


wildcard_constraints:
    strategy="|".join(BATCHED),
    batch=r"\d{1,4}",


checkpoint propose:
    input:
        lambda wildcards: tables_in(
            folders_of_batches(wildcards.strategy, int(wildcards.batch))
        ),
    output:
        samples=f"{BATCH}/samples.csv",
        proposal=f"{BATCH}/proposal.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_proposed.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{strategy}}/batch_{{batch}}_proposed.tsv"
    resources:
        **resources_for_attempt(400, minutes=90),
    params:
        config=CONFIG,
        code=code_hash("stages.batches", "calibrate.strategies"),
        folder=find_output_folder,
        batches=lambda wildcards: folders_of_batches(
            wildcards.strategy, int(wildcards.batch)
        ),
        settings=lambda wildcards: select_stage_settings(
            "propose", strategy_name=wildcards.strategy
        ),
    message:
        "What {wildcards.strategy} simulates after its first batches: batch {wildcards.batch}, or the answer"
    shell:
        "python -m repose stage propose {wildcards.strategy:q} {params.batches:q} --config {params.config:q}"
        " --out {params.folder:q} > {log:q} 2>&1"


include: f"batch_{'runs' if IS_EXTERNAL else 'pours'}.smk"


use rule dataset as batch_dataset with:
    input:
        samples=rules.propose.output.samples,
        jobs=lambda wildcards: jobs_of(wildcards.strategy, wildcards.batch),
    output:
        dataset=f"{BATCH}/dataset.csv",
        runs=f"{BATCH}/runs.csv",
        summary=f"{BATCH}/dataset_summary.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_dataset.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{strategy}}/batch_{{batch}}_dataset.tsv"
    message:
        "Table of {wildcards.strategy}, batch {wildcards.batch}"
