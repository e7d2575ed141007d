# Figures of the method; studies and strategies have theirs beside their rules. All are shown here.
figure("figure02", "Figure 2", sizes=config["berry"]["sizes"])
if "funnel" in BENCH_TESTS:
    PILE = {"heap": rules.measure.input.heap, "particle": rules.shape.output.particle}
    figure("figure05", "Figure 5", "funnel", "colour", **PILE)
    figure("figure06", "Figure 6", "measure", **PILE, berry=rules.berry.output.berry)
    figure(
        "definitions",
        "Definitions of the angle",
        "measure",
        **PILE,
        berry=rules.berry.output.berry,
    )
    figure(
        "figure08",
        "Figure 8",
        "funnel",
        "colour",
        trajectory=rules.trajectory.output.trajectory,
        particle=rules.shape.output.particle,
    )
figure(
    "figure07",
    "Figure 7",
    "berry",
    "colour",
    stl=rules.shape.output.stl,
    particle=rules.shape.output.particle,
)
figure("figure09", "Figure 9", dot=f"{RESULTS}/figures/figure09.dot")
if kind_of(config["surrogate"]).is_network:
    figure(
        "figure10",
        "Figure 10",
        "parameters",
        "design.seed",
        network=rules.network.output.network,
    )
figure(
    "figure13",
    "Figure 13",
    "targets",
    predictions=rules.network.output.predictions,
    dataset=rules.dataset.output.dataset,
)
figure(
    "figure14",
    "Figure 14",
    "parameters",
    "targets",
    feasible=rules.miga.output.feasible,
    summary=rules.miga.output.summary,
    **({"published": published("table3.csv")} if published("table3.csv") else {}),
)
figure(
    "convergence",
    "Convergence of the search",
    "miga",
    history=rules.miga.output.history,
)
figure(
    "design",
    "Design",
    "parameters",
    samples=rules.design.output.samples,
    comparison=rules.design.output.comparison,
)
figure(
    "dataset",
    "Responses",
    "parameters",
    "targets",
    dataset=rules.dataset.output.dataset,
)
figure(
    "validation",
    "Table 4, shown",
    "targets",
    table4=rules.validate.output.table4,
    **({"published": config["validation"]["published"]} if PUBLISHED_SOLUTIONS else {}),
)
if PUBLISHED_IS_STORED:
    figure(
        "published",
        "Published solutions here",
        "targets",
        published=rules.validate.output.published,
    )
if any("profile" in target for target in config["targets"]):
    figure(
        "profiles",
        "Profiles",
        "targets",
        table4=answer().table4,
    )
if sum("profile" not in target for target in config["targets"]) > 1:
    figure(
        "plane",
        "Targets against each other",
        "targets",
        dataset=answer().dataset,
        feasible=answer().feasible,
        table4=answer().table4,
    )
if "drum" in config:
    figure(
        "figure15",
        "Figure 15",
        "drum",
        "measure.mm_per_pixel",
        "colour",
        states=f"{RESULTS}/drum/drum_{DRUM_SEEDS[0]}.npz",
        particle=rules.shape.output.particle,
        runs=rules.drum.output.runs,
    )
    figure(
        "drum",
        "The drum over time",
        "drum",
        record=rules.drum.output.record,
        profile=rules.drum.output.profile,
        runs=rules.drum.output.runs,
    )


rule rule_graph:
    output:
        dot=f"{RESULTS}/figures/figure09.dot",
    log:
        f"{RESULTS}/logs/rule_graph.log",
    benchmark:
        f"{RESULTS}/benchmarks/rule_graph.tsv"
    resources:
        **needs(650),
    params:
        config=CONFIG,
        snakefile=str(places.root() / "Snakefile"),
    message:
        "The workflow's own graph"
    shell:
        # the order of the rules follows the hashes of their names
        "(PYTHONHASHSEED=0 python -m snakemake calibration --snakefile {params.snakefile:q}"
        " --configfile {params.config:q} --rulegraph | python -m repose stage write --out {output.dot:q}) 2> {log:q}"


# Shown if they exist, and never made for the figure.
FRESH = f"{RESULTS}/pool/fresh_dataset.csv"
OPTIONAL_INPUTS = {
    "figure13": {"fresh": FRESH, "network": rules.network.output.network},
    "plane": {"pool": f"{RESULTS}/pool/dataset.csv", "fresh": FRESH},
}
# The other figures take 400.
MEMORY_MB = {"figure05": 600, "figure07": 650, "figure15": 550}

for name, shown in FIGURES.items():

    rule:
        name:
            f"draw_{name}"
        input:
            **shown.inputs,
        output:
            figure=report(
                shown.path,
                caption=f"../report/{name}.rst",
                category=shown.category,
                labels={"figure": shown.label},
            ),
            further=further(shown.path),
        log:
            f"{RESULTS}/logs/figures/{name}.log",
        benchmark:
            f"{RESULTS}/benchmarks/figures/{name}.tsv"
        resources:
            **needs(MEMORY_MB.get(name, 400)),
        params:
            config=CONFIG,
            code=room_hash("pictures"),
            figure=name,
            inputs=[f"--input={key}={path}" for key, path in shown.inputs.items()]
            + [
                f"--input={key}={path}"
                for key, path in OPTIONAL_INPUTS.get(name, {}).items()
                if os.path.isfile(path)
            ],
            depends=sections("small_run", *shown.depends) | RESOLUTION,
        message:
            "Drawing {params.figure}"
        shell:
            "python -m repose figure {params.figure:q} --config {params.config:q} {params.inputs:q} --out {output.figure:q}"
            " > {log:q} 2>&1"


# The others belong to a study or strategy.
FIGURES_OF_ALL = all_files(
    *(
        name
        for name, shown in FIGURES.items()
        if os.path.dirname(shown.path) == f"{RESULTS}/figures"
    )
)


rule figures:
    input:
        FIGURES_OF_ALL,
