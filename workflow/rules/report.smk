# The end of every calibration: the report of a study, one page for a browser, which is also part of `snakemake --report`,
# and the answer as one file, for people and for other programs.
BY_THE_CHAIN = find_answer() is ANSWERS["published"]
HAS_PILE = "funnel" in BENCH_TESTS
BY_BATCHES = None if BY_THE_CHAIN else getattr(rules, find_answer().rule).output
# The posterior takes the scatter of the targets from runs of one sample, by the network.
HAS_POSTERIOR = BY_THE_CHAIN and all(
    STUDY.settings.count_seeds(name) > 1 for name in BENCH_TESTS
)
CARD = f"{RESULTS}/card.json"
TRAJECTORY = not IS_EXTERNAL and (
    rules.trajectory.output.trajectory
    if BY_THE_CHAIN
    else f"{RESULTS}/{config['strategy']}/film/{REPRESENTATIVE}_trajectory_{FILM_SEED}.npz"
)
POSTERIOR = drop_missing(
    {
        "posterior": HAS_POSTERIOR and rules.posterior_tables.output.posterior,
        "draws": HAS_POSTERIOR and rules.posterior_tables.output.draws,
    }
)
POSTERIOR_SUMMARY = HAS_POSTERIOR and rules.posterior_tables.output.summary
# The card says whether piles can have angle and Height of the targets, by the study's own samples where it has a design.
OWN_PILES = drop_missing(
    {"dataset": AFTER_THE_ARTICLE and rules.dataset.output.dataset}
)
# The set that a publication recommends stands in the card, simulated here where the study has a stored table.
HAS_PUBLISHED = BY_THE_CHAIN and bool(PUBLISHED_NAMES)
PUBLISHED_OF_CARD = drop_missing(
    {
        "published": HAS_PUBLISHED and config["validation"]["published"],
        "published-simulated": HAS_PUBLISHED
        and PUBLISHED_IS_STORED
        and rules.validate.output.published,
    }
)
# Figures of the page by the strategy that gives the answer; `figures.smk` says which a study has.
PICTURES = {
    "published": (
        *(("intervals",) if HAS_POSTERIOR else ()),
        "figure13",
        "figure14",
        "validation",
        "outline",
        "definitions",
        "figure15",
        "drum",
    ),
    "response_surface": ("pareto_screening", "contours"),
    "sequential": ("sequential",),
}
STRATEGY = "published" if BY_THE_CHAIN else config["strategy"]
# Inputs of the page by name, and tables that it holds by their titles.
PAGE = drop_missing(
    {
        "dataset": find_answer().dataset,
        "feasible": find_answer().feasible,
        "summary": find_answer().summary,
        "table4": find_answer().table4,
        "card": CARD,
        "network": BY_THE_CHAIN and rules.network.output.network,
        "metrics": BY_THE_CHAIN and rules.network.output.metrics,
        "dataset_summary": BY_THE_CHAIN and rules.dataset.output.summary,
        "overlay": BY_THE_CHAIN and HAS_PILE and rules.measure.output.overlay,
        "posterior": POSTERIOR.get("posterior"),
        "posterior_summary": POSTERIOR_SUMMARY,
        "runs": STRATEGY == "sequential" and BY_BATCHES.runs,
        "particle": HAS_PILE and rules.shape.output.particle,
        "trajectory": HAS_PILE and TRAJECTORY,
        "photograph": config.get("photograph"),
        "published": PUBLISHED_OF_CARD.get("published"),
        "drum_summary": BY_THE_CHAIN and "drum" in config and rules.drum.output.summary,
    }
) | find_figure_paths("plane", "profiles", *PICTURES.get(STRATEGY, ()))
TABLES = drop_missing(
    {
        "Measured sizes": not IS_EXTERNAL and rules.berry.output.summary,
        "Designs compared": BY_THE_CHAIN and rules.design.output.comparison,
        "Simulated samples": find_answer().dataset,
        "Parameter sets found": find_answer().feasible,
        "Span of the sets found": BY_THE_CHAIN and rules.miga.output.intervals,
        "Sets simulated again": BY_THE_CHAIN and rules.validate.output.table4,
        "The drum: angles and first slip": BY_THE_CHAIN
        and "drum" in config
        and rules.drum.output.summary,
        "Starts of the network": BY_THE_CHAIN
        and find_surrogate_class(config["surrogate"]).is_network
        and rules.network.output.starts,
        "Published sets in this simulator": BY_THE_CHAIN
        and PUBLISHED_IS_STORED
        and rules.validate.output.published,
        "The answer simulated again": not BY_THE_CHAIN and find_answer().table4,
        "Batches": not BY_THE_CHAIN and BY_BATCHES.batches,
        "Analysis of variance of the surface": STRATEGY == "response_surface"
        and f"{RESULTS}/response_surface/surface_anova.csv",
    }
)
if not BY_THE_CHAIN and not IS_EXTERNAL:

    use rule trajectory as strategy_trajectory with:
        input:
            **READY,
            samples=find_answer().table4,
        output:
            trajectory=TRAJECTORY,
        log:
            f"{RESULTS}/logs/strategy_trajectory.log",
        benchmark:
            f"{RESULTS}/benchmarks/strategy_trajectory.tsv"
        message:
            "Pouring the answer before the camera"


report: "../report/workflow.rst"


rule page:
    input:
        **PAGE,
        jobs=list_answer_jobs,
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
        **resources_for_attempt(350),
    params:
        config=CONFIG,
        code=code_hash("report.page"),
        inputs=[f"--input={name}={path}" for name, path in PAGE.items()],
        tables=[f"--table={title}={path}" for title, path in TABLES.items()],
        settings=select_sections(
            "label", "note", "small_run", "parameters", "targets", "design", "miga"
        )
        | {"funnel": config["funnel"] if HAS_PILE else None},
    message:
        "The report: {output}"
    shell:
        "python -m repose stage report {input.jobs:q} --config {params.config:q} {params.inputs:q} {params.tables:q}"
        " --out {output:q} > {log:q} 2>&1"


GRAIN_OF_CARD = {} if IS_EXTERNAL else GRAIN


rule card:
    input:
        **GRAIN_OF_CARD,
        **POSTERIOR,
        **OWN_PILES,
        published=list(PUBLISHED_OF_CARD.values()),
        feasible=find_answer().feasible,
        summary=find_answer().summary,
        representative=find_answer().representative,
        table4=find_answer().table4,
    output:
        card=CARD,
    log:
        f"{RESULTS}/logs/card.log",
    benchmark:
        f"{RESULTS}/benchmarks/card.tsv"
    resources:
        **resources_for_attempt(300),
    params:
        config=CONFIG,
        code=code_hash("stages.card_study", "stages.answer"),
        tables=[
            f"--{name}={path}"
            for name, path in (
                GRAIN_OF_CARD | POSTERIOR | OWN_PILES | PUBLISHED_OF_CARD
            ).items()
        ],
        settings=select_stage_settings("material_card") | {"label": config["label"]},
    message:
        "The material card: {output}"
    shell:
        "python -m repose stage material_card --config {params.config:q} --feasible {input.feasible:q} --summary {input.summary:q}"
        " --representative {input.representative:q} --table4 {input.table4:q} {params.tables:q} --out {output.card:q}"
        " > {log:q} 2>&1"


rule calibration:
    input:
        rules.validate.output,
        rules.measure.output if HAS_PILE else [],
        rules.drum.output if "drum" in config else [],


# A minute of a core for pictures that no number needs: a target of its own.
rule films:
    input:
        rules.film.output if HAS_PILE else [],
        rules.drum_film.output if "drum" in config else [],
