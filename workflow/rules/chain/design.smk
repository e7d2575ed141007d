rule design:
    output:
        samples=f"{RESULTS}/design/samples.csv",
        comparison=f"{RESULTS}/design/comparison.csv",
    log:
        f"{RESULTS}/logs/design.log",
    benchmark:
        f"{RESULTS}/benchmarks/design.tsv"
    threads: 1
    resources:
        mem_mb=growing(400),
        runtime=growing(60),
    params:
        config=CONFIG,
        folder=folder,
        depends=stands_on.settings_of(config, "design"),
    message:
        "Design of the virtual experiments"
    shell:
        "python -m repose design --config {params.config:q} --out {params.folder:q} > {log:q} 2>&1"
