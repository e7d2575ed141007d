rule dataset:
    input:
        samples=rules.design.output.samples,
        jobs=expand(rules.measure_runs.output.result, runs=FOLDERS),
    output:
        dataset=f"{RESULTS}/dataset.csv",
        runs=f"{RESULTS}/runs.csv",
        summary=f"{RESULTS}/dataset_summary.json",
    log:
        f"{RESULTS}/logs/dataset.log",
    benchmark:
        f"{RESULTS}/benchmarks/dataset.tsv"
    priority: 1
    resources:
        **resources_for_attempt(250),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("dataset"),
        code=code_hash("stages.dataset"),
        jobs=list_job_folders,
    message:
        "Table of all samples and their responses"
    shell:
        "python -m repose stage dataset {params.jobs:q} --config {params.config:q} --samples {input.samples:q}"
        " --out {params.folder:q} > {log:q} 2>&1"
