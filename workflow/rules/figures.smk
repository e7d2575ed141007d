# Bench tests whose responses are targets, and the figures that show the funnel or its pile.
BENCH_TESTS = STUDY.targets.apparatus
OF_THE_FUNNEL = ("figure05", "figure06", "figure08", "definitions")

# Each figure: its name in the report, its inputs, and the sections of the configuration that it reads.
FIGURES = {
    "figure02": ("Figure 2", {"sizes": config["berry"]["sizes"]}, ()),
    "figure05": (
        "Figure 5",
        {"heap": rules.measure.input.heap, "particle": rules.shape.output.particle},
        ("funnel", "colour"),
    ),
    "figure06": (
        "Figure 6",
        {
            "heap": rules.measure.input.heap,
            "particle": rules.shape.output.particle,
            "berry": rules.berry.output.berry,
        },
        ("measure",),
    ),
    "definitions": (
        "Definitions of the angle",
        {
            "heap": rules.measure.input.heap,
            "particle": rules.shape.output.particle,
            "berry": rules.berry.output.berry,
        },
        ("measure",),
    ),
    "figure07": (
        "Figure 7",
        {"stl": rules.shape.output.stl, "particle": rules.shape.output.particle},
        (),
    ),
    "figure08": (
        "Figure 8",
        {
            "trajectory": rules.trajectory.output.trajectory,
            "particle": rules.shape.output.particle,
        },
        ("funnel", "colour"),
    ),
    "figure09": ("Figure 9", {"dot": f"{RESULTS}/figures/figure09.dot"}, ()),
    "figure10": ("Figure 10", {"network": rules.network.output.network}, ()),
    "figure13": (
        "Figure 13",
        {
            "predictions": rules.network.output.predictions,
            "dataset": rules.dataset.output.dataset,
        },
        ("targets",),
    ),
    "figure14": (
        "Figure 14",
        {
            "feasible": rules.miga.output.feasible,
            "summary": rules.miga.output.summary,
            "published": published("table3.csv"),
        },
        ("parameters", "targets"),
    ),
    "convergence": (
        "Convergence of the search",
        {"history": rules.miga.output.history, "summary": rules.miga.output.summary},
        ("miga",),
    ),
    "design": (
        "Design",
        {
            "samples": rules.design.output.samples,
            "comparison": rules.design.output.comparison,
        },
        ("parameters",),
    ),
    "dataset": (
        "Responses",
        {"dataset": rules.dataset.output.dataset},
        ("parameters", "targets"),
    ),
    "validation": (
        "Table 4, drawn",
        {
            "table4": rules.validate.output.table4,
            "published": config["validation"]["published"],
        },
        ("targets",),
    ),
    "published": (
        "Published solutions here",
        {"published": rules.validate.output.published},
        ("targets",),
    ),
}

if len(config["targets"]) > 1:
    PLANE = {
        "published": (
            rules.dataset.output.dataset,
            rules.miga.output.feasible,
            rules.validate.output.table4,
        ),
        "response_surface": (
            f"{HABIT}/surface/dataset.csv",
            rules.response_check.output.solutions,
            rules.response_check.output.table4,
        ),
        "sequential": (
            rules.sequential_check.output.dataset,
            rules.sequential_check.output.solutions,
            rules.sequential_check.output.table4,
        ),
    }
    PLANE = PLANE.get(config["strategy"], PLANE["published"])
    FIGURES["plane"] = (
        "Targets against each other",
        dict(zip(("dataset", "feasible", "table4"), PLANE)),
        ("targets",),
    )

if "drum" in config:
    FIGURES |= {
        "figure15": (
            "Figure 15",
            {
                "states": f"{RESULTS}/drum/drum_{DRUM_SEEDS[0]}.npz",
                "particle": rules.shape.output.particle,
            },
            ("drum", "measure.mm_per_pixel", "colour"),
        ),
        "drum": (
            "The drum over time",
            {
                "record": rules.drum.output.record,
                "profile": rules.drum.output.profile,
                "runs": rules.drum.output.runs,
            },
            ("drum",),
        ),
    }
if "funnel" not in BENCH_TESTS:
    for figure in OF_THE_FUNNEL:
        del FIGURES[figure]
if config["surrogate"] not in ("network", "network_ensemble"):
    del FIGURES["figure10"]
if not PUBLISHED_SOLUTIONS:
    del FIGURES["published"], FIGURES["validation"][1]["published"]
if not FIGURES["figure14"][1]["published"]:
    del FIGURES["figure14"][1]["published"]


rule rule_graph:
    output:
        dot=f"{RESULTS}/figures/figure09.dot",
    log:
        f"{RESULTS}/logs/rule_graph.log",
    threads: 1
    resources:
        mem_mb=growing(150),
        runtime=growing(10),
    params:
        config=CONFIG,
        snakefile=str(workflow.main_snakefile),
    message:
        "The workflow's own graph"
    shell:
        # the order of the rules follows the hashes of their names
        "(PYTHONHASHSEED=0 python -m snakemake calibration --snakefile {params.snakefile:q}"
        " --configfile {params.config:q} --rulegraph | python -m repose stage write --out {output.dot:q}) 2> {log:q}"


# Shown if they exist, and never made for the figure.
OPTIONAL_INPUTS = {
    "plane": {
        "pool": f"{RESULTS}/pool/dataset.csv",
        "fresh": f"{RESULTS}/pool/fresh_dataset.csv",
    }
}
# The other figures take 400.
MEMORY_MB = {"figure05": 600, "figure07": 600, "figure15": 550}

for figure, (label, shown, depends) in FIGURES.items():

    rule:
        name:
            f"draw_{figure}"
        input:
            **shown,
        output:
            report(
                f"{RESULTS}/figures/{figure}.png",
                caption=f"../report/{figure}.rst",
                category="Figures",
                labels={"figure": label},
            ),
        log:
            f"{RESULTS}/logs/figures/{figure}.log",
        benchmark:
            f"{RESULTS}/benchmarks/figures/{figure}.tsv"
        threads: 1
        resources:
            mem_mb=growing(MEMORY_MB.get(figure, 400)),
            runtime=growing(10),
        params:
            config=CONFIG,
            figure=figure,
            inputs=[f"--input={key}={path}" for key, path in shown.items()]
            + [
                f"--input={key}={path}"
                for key, path in OPTIONAL_INPUTS.get(figure, {}).items()
                if os.path.isfile(path)
            ],
            depends=sections("small_run", *depends),
        message:
            "Drawing {params.figure}"
        shell:
            "python -m repose figure {params.figure:q} --config {params.config:q} {params.inputs:q} --out {output:q}"
            " > {log:q} 2>&1"


rule figures:
    input:
        expand(f"{RESULTS}/figures/{{figure}}.png", figure=FIGURES),
