rule design:
    output:
        samples=f"{RESULTS}/design/samples.csv",
        comparison=f"{RESULTS}/design/comparison.csv",
    log:
        f"{RESULTS}/logs/design.log",
    benchmark:
        f"{RESULTS}/benchmarks/design.tsv"
    priority: 1
    resources:
        **resources_for_attempt(600, minutes=60),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("design"),
        code=code_hash("stages.design"),
    message:
        "Design of the virtual experiments"
    shell:
        "python -m repose design --config {params.config:q} --out {params.folder:q} > {log:q} 2>&1"
