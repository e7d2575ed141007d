# Tables as pages, for `snakemake --report`; the figures are marked where they are drawn.
TABLES = {
    "table1": ("Table 1: sizes of the berries", rules.berry.output.summary),
    "designs": ("Designs compared", rules.design.output.comparison),
    "dataset": ("Samples and responses", rules.dataset.output.dataset),
    "starts": ("Starts of the network", rules.network.output.starts),
    "table3": ("Table 3: intervals of the solutions", rules.miga.output.intervals),
    "solutions": ("Solutions found", rules.miga.output.feasible),
    "table4": ("Table 4: predicted and simulated", rules.validate.output.table4),
    "representative": (
        "Representative solution and the physical pile",
        rules.validate.output.representative,
    ),
    "published": (
        "Published solutions in this simulator",
        rules.validate.output.published,
    ),
    "drum": ("The drum: angles and first slip", rules.drum.output.summary),
}
if config["surrogate"] != "network":
    del TABLES["starts"]
if not THEIRS:
    del TABLES["published"]


report: "../report/workflow.rst"


for table, (title, source) in TABLES.items():

    rule:
        name:
            f"page_{table}"
        input:
            source,
        output:
            report(
                f"{RESULTS}/tables/{table}.html",
                caption=f"../report/table_{table}.rst",
                category="Tables",
                labels={"table": title},
            ),
        log:
            f"{RESULTS}/logs/tables/{table}.log",
        benchmark:
            f"{RESULTS}/benchmarks/tables/{table}.tsv"
        threads: 1
        resources:
            mem_mb=300,
        params:
            config=CONFIG,
            title=title,
            depends=sections("small_run"),
        message:
            "Page of: {params.title}"
        shell:
            "python -m repose table {input:q} --title {params.title:q} --config {params.config:q} --out {output:q}"
            " > {log:q} 2>&1"


rule tables:
    input:
        expand(f"{RESULTS}/tables/{{table}}.html", table=TABLES),


rule calibration:
    input:
        rules.validate.output,
        rules.measure.output if "funnel" in BENCH_TESTS else [],
        rules.film.output if "funnel" in BENCH_TESTS else [],
        rules.drum.output,
        rules.drum_film.output,
