rule miga:
    input:
        network=rules.network.output.network,
        dataset=rules.dataset.output.dataset,
        table3=published("table3.csv"),
    output:
        feasible=f"{RESULTS}/miga/feasible.csv",
        intervals=f"{RESULTS}/miga/intervals.csv",
        history=f"{RESULTS}/miga/history.csv",
        summary=f"{RESULTS}/miga/summary.json",
    log:
        f"{RESULTS}/logs/miga.log",
    benchmark:
        f"{RESULTS}/benchmarks/miga.tsv"
    priority: 1
    resources:
        **needs(250, minutes=30),
    params:
        config=CONFIG,
        folder=folder,
        settings=settings_of("miga"),
        code=code_hash("stages.miga"),
    message:
        "Searching the parameters that give the target pile"
    shell:
        "python -m repose stage miga --config {params.config:q} --network {input.network:q}"
        " --dataset {input.dataset:q} --out {params.folder:q} > {log:q} 2>&1"
