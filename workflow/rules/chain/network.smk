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
    threads: 1
    resources:
        mem_mb=growing(200),
        runtime=growing(60),
    params:
        config=CONFIG,
        folder=folder,
        depends=stands_on.settings_of(config, "network"),
    message:
        "Training the surrogate"
    shell:
        "python -m repose stage network --config {params.config:q} --dataset {input.dataset:q} --runs {input.runs:q}"
        " --out {params.folder:q} > {log:q} 2>&1"
