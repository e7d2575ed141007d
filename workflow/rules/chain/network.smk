rule network:
    input:
        dataset=rules.dataset.output.dataset,
        runs=rules.dataset.output.runs,
    output:
        network=f"{RESULTS}/network/network.json",
        metrics=f"{RESULTS}/network/metrics.json",
        predictions=f"{RESULTS}/network/predictions.csv",
        starts=f"{RESULTS}/network/starts.csv",
    log:
        f"{RESULTS}/logs/network.log",
    benchmark:
        f"{RESULTS}/benchmarks/network.tsv"
    priority: 1
    resources:
        **resources_for_attempt(200, minutes=60),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("network"),
        code=code_hash("stages.network"),
    message:
        "Training the surrogate"
    shell:
        "python -m repose stage network --config {params.config:q} --dataset {input.dataset:q} --runs {input.runs:q}"
        " --out {params.folder:q} > {log:q} 2>&1"
