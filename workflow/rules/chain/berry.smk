rule berry:
    input:
        sizes=config["berry"]["sizes"],
        compression=config["berry"]["compression"] or [],
        table1=find_published_table("table1.csv"),
    output:
        summary=f"{RESULTS}/berry/summary.csv",
        berry=f"{RESULTS}/berry/berry.json",
    log:
        f"{RESULTS}/logs/berry.log",
    benchmark:
        f"{RESULTS}/benchmarks/berry.tsv"
    priority: 1
    resources:
        **resources_for_attempt(250),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("berry"),
        code=code_hash("grain.berry"),
    message:
        "Sizes and moduli of the measured grains"
    shell:
        "python -m repose stage berry --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"
