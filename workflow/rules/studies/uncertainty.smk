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
    threads: 1
    resources:
        mem_mb=growing(200),
        runtime=growing(10),
    params:
        config=CONFIG,
        folder=folder,
        depends=sections("targets"),
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
    threads: 1
    resources:
        mem_mb=growing(300),
        runtime=growing(30),
    params:
        config=CONFIG,
        folder=folder,
        depends=sections("parameters", "targets", "posterior"),
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
    threads: 1
    resources:
        mem_mb=growing(200),
        runtime=growing(30),
    params:
        config=CONFIG,
        folder=folder,
        depends=sections("parameters", "targets", "sensitivity"),
    message:
        "Sobol indices and main effects on the surrogate"
    shell:
        "python -m repose sensitivity --config {params.config:q} --network {input.network:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


# Each figure: its folder, its name in the report, and its inputs.
UNCERTAINTY_FIGURES = {
    "noise": (
        "noise",
        "Noise floor",
        {
            "runs": rules.dataset.output.runs,
            "seeds": rules.noise_tables.output.seeds,
            "noise": rules.noise_tables.output.summary,
        },
    ),
    "corner": (
        "posterior",
        "Posterior",
        {
            "draws": rules.posterior_tables.output.draws,
            "posterior": rules.posterior_tables.output.posterior,
            "summary": rules.posterior_tables.output.summary,
            "feasible": rules.miga.output.feasible,
        },
    ),
    "intervals": (
        "posterior",
        "Credible intervals",
        {"posterior": rules.posterior_tables.output.posterior},
    ),
    "discrepancy": (
        "posterior",
        "Discrepancy",
        {"discrepancy": rules.posterior_tables.output.discrepancy},
    ),
    "region": (
        "posterior",
        "Region that is not excluded",
        {
            "region": rules.posterior_tables.output.region,
            "summary": rules.posterior_tables.output.summary,
        },
    ),
    "sobol": (
        "sensitivity",
        "Sobol indices",
        {"sobol": rules.sensitivity_tables.output.sobol},
    ),
    "main_effects": (
        "sensitivity",
        "Main effects",
        {
            "effects": rules.sensitivity_tables.output.effects,
            "sobol": rules.sensitivity_tables.output.sobol,
            "dataset": rules.dataset.output.dataset,
        },
    ),
}


for figure, (where, label, shown) in UNCERTAINTY_FIGURES.items():

    rule:
        name:
            f"draw_{figure}"
        input:
            **shown,
        output:
            report(
                f"{RESULTS}/{where}/{figure}.png",
                caption=f"../../report/{figure}.rst",
                category="Uncertainty",
                labels={"figure": label},
            ),
        log:
            f"{RESULTS}/logs/figures/{figure}.log",
        benchmark:
            f"{RESULTS}/benchmarks/figures/{figure}.tsv"
        threads: 1
        resources:
            mem_mb=growing(400),
            runtime=growing(10),
        params:
            config=CONFIG,
            figure=figure,
            inputs=[f"--input={key}={path}" for key, path in shown.items()],
            depends=sections("small_run", "parameters", "targets"),
        message:
            "Drawing {params.figure}"
        shell:
            "python -m repose figure {params.figure:q} --config {params.config:q} {params.inputs:q} --out {output:q}"
            " > {log:q} 2>&1"


# The first lines name what the tables are made from, so that a lost file is made again.
rule noise:
    input:
        rules.dataset.output,
        rules.noise_tables.output,
        rules.draw_noise.output,


rule posterior:
    input:
        rules.dataset.output,
        rules.network.output,
        rules.miga.output,
        rules.posterior_tables.output,
        rules.draw_corner.output,
        rules.draw_intervals.output,
        rules.draw_discrepancy.output,
        rules.draw_region.output,


rule sensitivity:
    input:
        rules.dataset.output,
        rules.network.output,
        rules.sensitivity_tables.output,
        rules.draw_sobol.output,
        rules.draw_main_effects.output,


rule uncertainty:
    input:
        rules.noise.input,
        rules.posterior.input,
        rules.sensitivity.input,
