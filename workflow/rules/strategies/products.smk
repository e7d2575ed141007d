# What every calibration ends with, here of a strategy that is not the published one: the material card and the report.
ANSWER = {
    "response_surface": rules.response_check.output,
    "sequential": rules.sequential_check.output,
}[config["strategy"]]
OF_THE_HABIT = config["strategy"] == "response_surface"


ruleorder: strategy_page > page
ruleorder: strategy_card > card


def answer_jobs(wildcards):
    """Measured runs of the answer."""
    return jobs_of(config["strategy"], "check")


# Samples that the model of the strategy stands on.
STRATEGY_DATASET = f"{HABIT}/surface/dataset.csv" if OF_THE_HABIT else ANSWER.dataset
STRATEGY_FILM = (
    f"{RESULTS}/{config['strategy']}/film/{REPRESENTATIVE}_trajectory_{FILM_SEED}.npz"
)
STRATEGY_PAGE = {
    "dataset": STRATEGY_DATASET,
    "feasible": ANSWER.solutions,
    "summary": ANSWER.summary,
    "table4": ANSWER.table4,
}
STRATEGY_TABLES = [
    ("Measured sizes", rules.berry.output.summary),
    ("Simulated samples", STRATEGY_DATASET),
    ("Parameter sets found", ANSWER.solutions),
    ("The answer simulated again", ANSWER.table4),
]
if OF_THE_HABIT:
    STRATEGY_PAGE |= {
        name: f"{HABIT}/{name}.png" for name in ("pareto_screening", "contours")
    }
    STRATEGY_TABLES.append(
        ("Analysis of variance of the surface", f"{HABIT}/surface/anova.csv")
    )
else:
    STRATEGY_PAGE |= {
        "runs": ANSWER.runs,
        "sequential": f"{SEQUENTIAL}/sequential.png",
    }
    STRATEGY_TABLES.append(("Batches", ANSWER.batches))
if "plane" in FIGURES:
    STRATEGY_PAGE["plane"] = f"{RESULTS}/figures/plane.png"
if config.get("photograph"):
    STRATEGY_PAGE["photograph"] = config["photograph"]
if "funnel" in BENCH_TESTS:
    STRATEGY_PAGE |= {
        "particle": rules.shape.output.particle,
        "trajectory": STRATEGY_FILM,
    }


use rule trajectory as strategy_trajectory with:
    input:
        samples=ANSWER.table4,
        berry=rules.berry.output.berry,
        particle=rules.shape.output.particle,
        ready=ancient(rules.warm_up.output.ready),
    output:
        trajectory=STRATEGY_FILM,
    log:
        f"{RESULTS}/logs/strategy_trajectory.log",
    benchmark:
        f"{RESULTS}/benchmarks/strategy_trajectory.tsv"
    message:
        "Pouring the answer before the camera"


use rule page as strategy_page with:
    input:
        **STRATEGY_PAGE,
        jobs=answer_jobs,
        tables=[path for _, path in STRATEGY_TABLES],
    output:
        report(
            f"{RESULTS}/report.html",
            caption="../../report/page.rst",
            category="Answer",
            labels={"page": "The report"},
        ),
    log:
        f"{RESULTS}/logs/strategy_page.log",
    benchmark:
        f"{RESULTS}/benchmarks/strategy_page.tsv"
    params:
        config=CONFIG,
        inputs=[f"--input={name}={path}" for name, path in STRATEGY_PAGE.items()],
        tables=[f"--table={title}={path}" for title, path in STRATEGY_TABLES],
        depends=sections("label", "small_run", "parameters", "targets")
        | {"funnel": config["funnel"] if "funnel" in BENCH_TESTS else None},


use rule card as strategy_card with:
    input:
        berry=rules.berry.output.berry,
        particle=rules.shape.output.particle,
        feasible=ANSWER.solutions,
        summary=ANSWER.summary,
        representative=ANSWER.representative,
    output:
        card=rules.card.output.card,
    log:
        f"{RESULTS}/logs/strategy_card.log",
    benchmark:
        f"{RESULTS}/benchmarks/strategy_card.tsv"
