# The end of every calibration: the report of a study, one page for a browser, which is also part of `snakemake --report`,
# and the answer as one file, for people and for other programs.
HAS_PILE = "funnel" in BENCH_TESTS
# The posterior takes the scatter of the targets from runs of one sample, by the network.
HAS_POSTERIOR = all(STUDY.settings.count_seeds(name) > 1 for name in BENCH_TESTS)
GRAIN_OF_CARD = {} if IS_EXTERNAL else GRAIN
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
# Figures of the answer of the study's own strategy.
PICTURES_OF_STUDY = ("plane", "profiles")


if not IS_EXTERNAL:

    use rule trajectory as strategy_trajectory with:
        input:
            **READY,
            samples=f"{RESULTS}/{{strategy}}/table4.csv",
        output:
            trajectory=f"{RESULTS}/{{strategy}}/film/{REPRESENTATIVE}_trajectory_{FILM_SEED}.npz",
        log:
            f"{RESULTS}/logs/{{strategy}}/trajectory.log",
        benchmark:
            f"{RESULTS}/benchmarks/{{strategy}}/trajectory.tsv"
        message:
            "Pouring the answer of {wildcards.strategy} before the camera"


report: "../report/workflow.rst"


# A page and a card for the answer of the study, and for that of each other strategy. The names of the other rules end with
# the strategy.
for strategy in dict.fromkeys([STRATEGY, *BATCHED]):
    answer = ANSWERS[strategy]
    by_the_chain = strategy == "published"
    has_posterior = by_the_chain and HAS_POSTERIOR
    has_design = strategies.strategy(strategy).begins_with_design
    folder = find_card_folder(strategy)
    pictures = PICTURES.get(strategy, ())
    of_strategy = ""
    logs = f"{RESULTS}/logs"
    benchmarks = f"{RESULTS}/benchmarks"
    if strategy == STRATEGY:
        pictures = (*PICTURES_OF_STUDY, *pictures)
    else:
        of_strategy = f"_{strategy}"
        logs = f"{RESULTS}/logs/{strategy}"
        benchmarks = f"{RESULTS}/benchmarks/{strategy}"
    trajectory = HAS_PILE and (
        rules.trajectory.output.trajectory
        if by_the_chain
        else rules.strategy_trajectory.output.trajectory.format(strategy=strategy)
    )
    # The set that a publication recommends stands in the card, simulated here where the study has a stored table.
    has_published = by_the_chain and bool(PUBLISHED_NAMES)
    published_of_card = drop_missing(
        {
            "published": has_published and config["validation"]["published"],
            "published-simulated": has_published
            and PUBLISHED_IS_STORED
            and rules.validate.output.published,
        }
    )
    inputs = drop_missing(
        {
            "dataset": answer.dataset,
            "feasible": answer.feasible,
            "summary": answer.summary,
            "table4": answer.table4,
            "card": f"{folder}/card.json",
            "network": by_the_chain and rules.network.output.network,
            "metrics": by_the_chain and rules.network.output.metrics,
            "dataset_summary": by_the_chain and rules.dataset.output.summary,
            "overlay": by_the_chain and HAS_PILE and rules.measure.output.overlay,
            "posterior": has_posterior and rules.posterior_tables.output.posterior,
            "posterior_summary": has_posterior
            and rules.posterior_tables.output.summary,
            "runs": strategy == "sequential" and f"{RESULTS}/{strategy}/runs.csv",
            "particle": HAS_PILE and rules.shape.output.particle,
            "trajectory": trajectory,
            "photograph": config.get("photograph"),
            "published": published_of_card.get("published"),
            "drum_summary": by_the_chain
            and "drum" in config
            and rules.drum.output.summary,
        }
    ) | find_figure_paths(*pictures)
    tables = drop_missing(
        {
            "Measured sizes": not IS_EXTERNAL and rules.berry.output.summary,
            "Designs compared": by_the_chain and rules.design.output.comparison,
            "Simulated samples": answer.dataset,
            "Parameter sets found": answer.feasible,
            "Span of the sets found": by_the_chain and rules.miga.output.intervals,
            "Sets simulated again": by_the_chain and rules.validate.output.table4,
            "The drum: angles and first slip": by_the_chain
            and "drum" in config
            and rules.drum.output.summary,
            "Starts of the network": by_the_chain
            and find_surrogate_class(config["surrogate"]).is_network
            and rules.network.output.starts,
            "Published sets in this simulator": by_the_chain
            and PUBLISHED_IS_STORED
            and rules.validate.output.published,
            "The answer simulated again": not by_the_chain and answer.table4,
            "Batches": not by_the_chain and f"{RESULTS}/{strategy}/batches.csv",
            "Analysis of variance of the surface": strategy == "response_surface"
            and f"{RESULTS}/response_surface/surface_anova.csv",
        }
    )

    rule:
        name:
            f"page{of_strategy}"
        input:
            **inputs,
            jobs=functools.partial(list_answer_jobs, strategy),
            tables=list(tables.values()),
        output:
            report(
                f"{folder}/report.html",
                caption="../report/page.rst",
                category="Answer",
                labels={
                    "page": (
                        f"The report of {strategy}" if of_strategy else "The report"
                    )
                },
            ),
        log:
            f"{logs}/page.log",
        benchmark:
            f"{benchmarks}/page.tsv"
        resources:
            **resources_for_attempt(350),
        params:
            config=CONFIG,
            code=code_hash("report.page"),
            inputs=[f"--input={name}={path}" for name, path in inputs.items()],
            tables=[f"--table={title}={path}" for title, path in tables.items()],
            settings=select_sections(
                "label", "note", "small_run", "parameters", "targets", "design", "miga"
            )
            | {"funnel": config["funnel"] if HAS_PILE else None},
        message:
            "The report: {output}"
        shell:
            "python -m repose stage report {input.jobs:q} --config {params.config:q} {params.inputs:q} {params.tables:q}"
            " --out {output:q} > {log:q} 2>&1"

    # By the samples of a design, the card says whether piles can have angle and Height of the targets.
    inputs = GRAIN_OF_CARD | drop_missing(
        {
            "posterior": has_posterior and rules.posterior_tables.output.posterior,
            "draws": has_posterior and rules.posterior_tables.output.draws,
            "dataset": has_design and rules.dataset.output.dataset,
        }
    )

    rule:
        name:
            f"card{of_strategy}"
        input:
            **inputs,
            published=list(published_of_card.values()),
            feasible=answer.feasible,
            summary=answer.summary,
            representative=answer.representative,
            table4=answer.table4,
        output:
            card=f"{folder}/card.json",
        log:
            f"{logs}/card.log",
        benchmark:
            f"{benchmarks}/card.tsv"
        localrule: True  # less work than the start of a cluster's job
        resources:
            **resources_for_attempt(300),
        params:
            config=CONFIG,
            code=code_hash("stages.card_study", "stages.answer"),
            tables=[
                f"--{name}={path}"
                for name, path in (inputs | published_of_card).items()
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
