rule optimism:
    input:
        network=rules.network.output.network,
        dataset=rules.dataset.output.dataset,
        runs=rules.dataset.output.runs,
    output:
        optimism=f"{RESULTS}/miga/optimism.csv",
    log:
        f"{RESULTS}/logs/optimism.log",
    benchmark:
        f"{RESULTS}/benchmarks/optimism.tsv"
    resources:
        **resources_for_attempt(250, minutes=30),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("optimism"),
        code=code_hash("stages.optimism"),
    message:
        "Fitting to pours drawn again: the expected optimism of the predictions"
    shell:
        "python -m repose stage optimism --config {params.config:q} --network {input.network:q}"
        " --dataset {input.dataset:q} --runs {input.runs:q} --out {params.folder:q} > {log:q} 2>&1"
