# Uncertainty of the answer. Targets of their own: `snakemake --cores 2 uncertainty`, or noise, posterior, sensitivity.
rule noise_tables:
    input:
        runs=rules.dataset.output.runs,
    output:
        noise=f"{RESULTS}/noise/noise.csv",
        seeds=f"{RESULTS}/noise/seeds.csv",
        summary=f"{RESULTS}/noise/noise.json",
    log:
        f"{RESULTS}/logs/noise.log",
    benchmark:
        f"{RESULTS}/benchmarks/noise.tsv"
    resources:
        **resources_for_attempt(200),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("noise"),
        code=code_hash("calibrate.uncertainty.noise"),
    message:
        "Noise of the runs within and between samples"
    shell:
        "python -m repose noise --config {params.config:q} --runs {input.runs:q} --out {params.folder:q} > {log:q} 2>&1"


rule posterior_tables:
    input:
        network=rules.network.output.network,
        predictions=rules.network.output.predictions,
        dataset=rules.dataset.output.dataset,
        runs=rules.dataset.output.runs,
        feasible=rules.miga.output.feasible,
        table3=find_published_table("table3.csv"),
    output:
        posterior=f"{RESULTS}/posterior/posterior.csv",
        draws=f"{RESULTS}/posterior/draws.csv",
        discrepancy=f"{RESULTS}/posterior/discrepancy.csv",
        region=f"{RESULTS}/posterior/region.csv",
        summary=f"{RESULTS}/posterior/posterior.json",
    log:
        f"{RESULTS}/logs/posterior.log",
    benchmark:
        f"{RESULTS}/benchmarks/posterior.tsv"
    priority: 1
    resources:
        **resources_for_attempt(300, minutes=30),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("posterior"),
        code=code_hash("calibrate.uncertainty.posterior"),
    message:
        "Posterior of the parameters given the physical measurements"
    shell:
        "python -m repose posterior --config {params.config:q} --network {input.network:q}"
        " --predictions {input.predictions:q} --dataset {input.dataset:q} --runs {input.runs:q}"
        " --feasible {input.feasible:q} --out {params.folder:q} > {log:q} 2>&1"


rule sensitivity_tables:
    input:
        network=rules.network.output.network,
    output:
        sobol=f"{RESULTS}/sensitivity/sobol.csv",
        effects=f"{RESULTS}/sensitivity/main_effects.csv",
    log:
        f"{RESULTS}/logs/sensitivity.log",
    benchmark:
        f"{RESULTS}/benchmarks/sensitivity.tsv"
    resources:
        **resources_for_attempt(200, minutes=30),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("sensitivity"),
        code=code_hash("calibrate.uncertainty.sensitivity"),
    message:
        "Sobol indices and main effects on the surrogate"
    shell:
        "python -m repose sensitivity --config {params.config:q} --network {input.network:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


# The first lines name what the tables are made from, so that a lost file is made again.
rule noise:
    input:
        rules.dataset.output,
        rules.noise_tables.output,
        list_figure_files(*list_figure_names("noise")),


rule posterior:
    input:
        rules.dataset.output,
        rules.network.output,
        rules.miga.output,
        rules.posterior_tables.output,
        list_figure_files(*list_figure_names("posterior")),


rule sensitivity:
    input:
        rules.dataset.output,
        rules.network.output,
        rules.sensitivity_tables.output,
        list_figure_files(*list_figure_names("sensitivity")),


rule uncertainty:
    input:
        rules.noise.input,
        rules.posterior.input,
        rules.sensitivity.input,
