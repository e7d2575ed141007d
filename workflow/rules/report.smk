# The end of every calibration: the report of a study, one page for a browser, which is also part of `snakemake --report`,
# and the answer as one file, for people and for other programs.
# The posterior takes the scatter of the targets from runs of one sample, by the network.
SCATTER_IS_KNOWN = all(config[name]["seeds"] > 1 for name in BENCH_TESTS)
POSTERIOR = (
    {
        "posterior": rules.posterior_tables.output.posterior,
        "draws": rules.posterior_tables.output.draws,
    }
    if AFTER_THE_ARTICLE and SCATTER_IS_KNOWN
    else {}
)
# Inputs of the page by name, and tables that it holds by their titles.
PAGE = {
    "dataset": answer().dataset,
    "feasible": answer().feasible,
    "summary": answer().summary,
    "table4": answer().table4,
} | drawn("plane", "profiles")
# The card says whether piles can have angle and Height of the targets, by the study's own samples where it has a design.
CARD = f"{RESULTS}/card.json"
PAGE["card"] = CARD
OWN_PILES = {"dataset": rules.dataset.output.dataset} if AFTER_THE_ARTICLE else {}
TRAJECTORY = rules.trajectory.output.trajectory
if AFTER_THE_ARTICLE:
    PAGE |= drawn("figure13", "figure14", "validation", "definitions") | {
        "network": rules.network.output.network,
        "metrics": rules.network.output.metrics,
        "dataset_summary": rules.dataset.output.summary,
    }
    TABLES = {
        "Measured sizes": rules.berry.output.summary,
        "Designs compared": rules.design.output.comparison,
        "Simulated samples": answer().dataset,
        "Parameter sets found": answer().feasible,
        "Intervals of the sets found": rules.miga.output.intervals,
        "Sets simulated again": rules.validate.output.table4,
    }
    if "funnel" in BENCH_TESTS:
        PAGE["overlay"] = rules.measure.output.overlay
    if POSTERIOR:
        PAGE["posterior"] = POSTERIOR["posterior"]
    if "drum" in config:
        TABLES["The drum: angles and first slip"] = rules.drum.output.summary
    if kind_of(config["surrogate"]).is_network:
        TABLES["Starts of the network"] = rules.network.output.starts
    if PUBLISHED_IS_STORED:
        TABLES["Published sets in this simulator"] = rules.validate.output.published
else:
    TRAJECTORY = f"{RESULTS}/{config['strategy']}/film/{REPRESENTATIVE}_trajectory_{FILM_SEED}.npz"
    TABLES = {
        "Measured sizes": rules.berry.output.summary,
        "Simulated samples": answer().dataset,
        "Parameter sets found": answer().feasible,
        "The answer simulated again": answer().table4,
    }
    OF_BATCHES = getattr(rules, answer().rule).output
    TABLES["Batches"] = OF_BATCHES.batches
    if config["strategy"] == "response_surface":
        PAGE |= drawn("pareto_screening", "contours")
        TABLES["Analysis of variance of the surface"] = f"{SURFACE}/surface_anova.csv"
    if config["strategy"] == "sequential":
        PAGE |= drawn("sequential") | {"runs": OF_BATCHES.runs}

    use rule trajectory as strategy_trajectory with:
        input:
            **READY,
            samples=answer().table4,
        output:
            trajectory=TRAJECTORY,
        log:
            f"{RESULTS}/logs/strategy_trajectory.log",
        benchmark:
            f"{RESULTS}/benchmarks/strategy_trajectory.tsv"
        message:
            "Pouring the answer before the camera"


if "funnel" in BENCH_TESTS:
    PAGE |= {"particle": rules.shape.output.particle, "trajectory": TRAJECTORY}
if config.get("photograph"):
    PAGE["photograph"] = config["photograph"]


report: "../report/workflow.rst"


rule page:
    input:
        **PAGE,
        jobs=answer_jobs,
        tables=list(TABLES.values()),
    output:
        report(
            f"{RESULTS}/report.html",
            caption="../report/page.rst",
            category="Answer",
            labels={"page": "The report"},
        ),
    log:
        f"{RESULTS}/logs/page.log",
    benchmark:
        f"{RESULTS}/benchmarks/page.tsv"
    resources:
        **needs(350),
    params:
        config=CONFIG,
        code=room_hash("pictures"),
        inputs=[f"--input={name}={path}" for name, path in PAGE.items()],
        tables=[f"--table={title}={path}" for title, path in TABLES.items()],
        depends=sections("label", "small_run", "parameters", "targets", "design")
        | {"funnel": config["funnel"] if "funnel" in BENCH_TESTS else None},
    message:
        "The report: {output}"
    shell:
        "python -m repose stage report {input.jobs:q} --config {params.config:q} {params.inputs:q} {params.tables:q}"
        " --out {output:q} > {log:q} 2>&1"


rule card:
    input:
        **GRAIN,
        **POSTERIOR,
        **OWN_PILES,
        feasible=answer().feasible,
        summary=answer().summary,
        representative=answer().representative,
        table4=answer().table4,
    output:
        card=CARD,
    log:
        f"{RESULTS}/logs/card.log",
    benchmark:
        f"{RESULTS}/benchmarks/card.tsv"
    resources:
        **needs(300),
    params:
        config=CONFIG,
        code=room_hash("chain.card", "chain.answer"),
        tables=[f"--{name}={path}" for name, path in (POSTERIOR | OWN_PILES).items()],
        depends=stands_on.settings_of(config, "material_card")
        | {"label": config["label"]},
    message:
        "The material card: {output}"
    shell:
        "python -m repose stage material_card --config {params.config:q} --berry {input.berry:q}"
        " --particle {input.particle:q} --feasible {input.feasible:q} --summary {input.summary:q}"
        " --representative {input.representative:q} --table4 {input.table4:q} {params.tables:q} --out {output.card:q}"
        " > {log:q} 2>&1"


rule calibration:
    input:
        rules.validate.output,
        rules.measure.output if "funnel" in BENCH_TESTS else [],
        rules.drum.output if "drum" in config else [],


# A minute of a core for pictures that no number needs: a target of its own.
rule films:
    input:
        rules.film.output if "funnel" in BENCH_TESTS else [],
        rules.drum_film.output if "drum" in config else [],
