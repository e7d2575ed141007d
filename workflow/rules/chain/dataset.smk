rule dataset:
    input:
        samples=rules.design.output.samples,
        jobs=expand(
            rules.measure_runs.output.result, runs=folders_of_targets(), sample=SAMPLES
        ),
    output:
        dataset=f"{RESULTS}/dataset.csv",
        runs=f"{RESULTS}/runs.csv",
        summary=f"{RESULTS}/dataset_summary.json",
    log:
        f"{RESULTS}/logs/dataset.log",
    benchmark:
        f"{RESULTS}/benchmarks/dataset.tsv"
    threads: 1
    resources:
        mem_mb=growing(150),
        runtime=growing(10),
    params:
        config=CONFIG,
        folder=folder,
        jobs=folders_of_jobs,
        depends=STUDY.targets.names,
    message:
        "Table of all samples and their responses"
    shell:
        "python -m repose stage dataset {params.jobs:q} --config {params.config:q} --samples {input.samples:q}"
        " --out {params.folder:q} > {log:q} 2>&1"
