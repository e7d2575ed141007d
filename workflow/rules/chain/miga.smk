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
    threads: 1
    resources:
        mem_mb=growing(250),
        runtime=growing(30),
    params:
        config=CONFIG,
        folder=folder,
        depends=stands_on.settings_of(config, "miga"),
    message:
        "Searching the parameters that give the target pile"
    shell:
        "python -m repose stage miga --config {params.config:q} --network {input.network:q}"
        " --dataset {input.dataset:q} --out {params.folder:q} > {log:q} 2>&1"
