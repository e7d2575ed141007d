rule miga:
    input:
        network=rules.network.output.network,
        dataset=rules.dataset.output.dataset,
        table3=find_published_table("table3.csv"),
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
        **resources_for_attempt(250, minutes=30),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("miga"),
        code=code_hash("stages.miga"),
    message:
        "Searching the parameters that give the target pile"
    shell:
        "python -m repose stage miga --config {params.config:q} --network {input.network:q}"
        " --dataset {input.dataset:q} --out {params.folder:q} > {log:q} 2>&1"
