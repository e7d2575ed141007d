# The report of a study, one page for a browser; it is also part of `snakemake --report`, as figures are.
PAGE = {
    "network": rules.network.output.network,
    "metrics": rules.network.output.metrics,
    "dataset": rules.dataset.output.dataset,
    "dataset_summary": rules.dataset.output.summary,
    "feasible": rules.miga.output.feasible,
    "summary": rules.miga.output.summary,
    "table4": rules.validate.output.table4,
    "figure13": f"{RESULTS}/figures/figure13.png",
    "figure14": f"{RESULTS}/figures/figure14.png",
    "validation": f"{RESULTS}/figures/validation.png",
}
if "plane" in FIGURES:
    PAGE["plane"] = f"{RESULTS}/figures/plane.png"
if "funnel" in BENCH_TESTS:
    PAGE |= {
        "particle": rules.shape.output.particle,
        "trajectory": rules.trajectory.output.trajectory,
        "overlay": rules.measure.output.overlay,
        "definitions": f"{RESULTS}/figures/definitions.png",
    }
# The posterior takes the scatter of the targets from runs of one sample.
SCATTER_IS_KNOWN = all(config[name]["seeds"] > 1 for name in BENCH_TESTS)
if SCATTER_IS_KNOWN:
    PAGE["posterior"] = rules.posterior_tables.output.posterior
if config.get("photograph"):
    PAGE["photograph"] = config["photograph"]

# Tables that the page holds, by their titles.
TABLES = [
    ("Measured sizes", rules.berry.output.summary),
    ("Designs compared", rules.design.output.comparison),
    ("Simulated samples", rules.dataset.output.dataset),
    ("Parameter sets found", rules.miga.output.feasible),
    ("Intervals of the sets found", rules.miga.output.intervals),
    ("Sets simulated again", rules.validate.output.table4),
]
if "drum" in config:
    TABLES.append(("The drum: angles and first slip", rules.drum.output.summary))
if config["surrogate"].startswith("network"):
    TABLES.append(("Starts of the network", rules.network.output.starts))
if PUBLISHED_SOLUTIONS:
    TABLES.append(("Published sets in this simulator", rules.validate.output.published))


report: "../report/workflow.rst"


rule page:
    input:
        **PAGE,
        jobs=expand(
            rules.measure_validation_runs.output.result,
            runs=folders_of_targets(),
            sample=OWN_SOLUTIONS[0],
        ),
        tables=[path for _, path in TABLES],
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
    threads: 1
    resources:
        mem_mb=growing(350),
        runtime=growing(10),
    params:
        config=CONFIG,
        inputs=[f"--input={name}={path}" for name, path in PAGE.items()],
        tables=[f"--table={title}={path}" for title, path in TABLES],
        depends=sections("label", "small_run", "parameters", "targets", "design")
        | {"funnel": config["funnel"] if "funnel" in BENCH_TESTS else None},
    message:
        "The report: {output}"
    shell:
        "python -m repose stage report {input.jobs:q} --config {params.config:q} {params.inputs:q} {params.tables:q}"
        " --out {output:q} > {log:q} 2>&1"


rule calibration:
    input:
        rules.validate.output,
        rules.measure.output if "funnel" in BENCH_TESTS else [],
        rules.film.output if "funnel" in BENCH_TESTS else [],
        [*rules.drum.output, *rules.drum_film.output] if "drum" in config else [],
