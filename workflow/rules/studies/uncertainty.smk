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
        **needs(200),
    params:
        config=CONFIG,
        folder=folder,
        depends=reads("targets"),
        code=room_hash("studies"),
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
        table3=published("table3.csv"),
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
        **needs(300, minutes=30),
    params:
        config=CONFIG,
        folder=folder,
        depends=reads("parameters", "targets", "posterior"),
        code=room_hash("studies", "surrogate"),
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
        **needs(200, minutes=30),
    params:
        config=CONFIG,
        folder=folder,
        depends=reads("parameters", "targets", "sensitivity"),
        code=room_hash("studies", "surrogate"),
    message:
        "Sobol indices and main effects on the surrogate"
    shell:
        "python -m repose sensitivity --config {params.config:q} --network {input.network:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


# Figures of each folder: title in the report, and inputs.
UNCERTAINTY_FIGURES = {
    "noise": {
        "noise": (
            "Noise floor",
            {
                "runs": rules.dataset.output.runs,
                "seeds": rules.noise_tables.output.seeds,
                "noise": rules.noise_tables.output.summary,
            },
        ),
    },
    "posterior": {
        "corner": (
            "Posterior",
            {
                "draws": rules.posterior_tables.output.draws,
                "posterior": rules.posterior_tables.output.posterior,
                "summary": rules.posterior_tables.output.summary,
                "feasible": rules.miga.output.feasible,
            },
        ),
        "intervals": (
            "Credible intervals",
            {"posterior": rules.posterior_tables.output.posterior},
        ),
        "discrepancy": (
            "Discrepancy",
            {"discrepancy": rules.posterior_tables.output.discrepancy},
        ),
        "region": (
            "Region that is not excluded",
            {
                "region": rules.posterior_tables.output.region,
                "summary": rules.posterior_tables.output.summary,
            },
        ),
    },
    "sensitivity": {
        "sobol": ("Sobol indices", {"sobol": rules.sensitivity_tables.output.sobol}),
        "main_effects": (
            "Main effects",
            {
                "effects": rules.sensitivity_tables.output.effects,
                "sobol": rules.sensitivity_tables.output.sobol,
                "dataset": rules.dataset.output.dataset,
            },
        ),
    },
}
for where, figures_there in UNCERTAINTY_FIGURES.items():
    for name, (label, shown) in figures_there.items():
        figure(
            name,
            label,
            "parameters",
            "targets",
            folder=where,
            category="Uncertainty",
            **shown,
        )


# The first lines name what the tables are made from, so that a lost file is made again.
rule noise:
    input:
        rules.dataset.output,
        rules.noise_tables.output,
        all_files(*UNCERTAINTY_FIGURES["noise"]),


rule posterior:
    input:
        rules.dataset.output,
        rules.network.output,
        rules.miga.output,
        rules.posterior_tables.output,
        all_files(*UNCERTAINTY_FIGURES["posterior"]),


rule sensitivity:
    input:
        rules.dataset.output,
        rules.network.output,
        rules.sensitivity_tables.output,
        all_files(*UNCERTAINTY_FIGURES["sensitivity"]),


rule uncertainty:
    input:
        rules.noise.input,
        rules.posterior.input,
        rules.sensitivity.input,
