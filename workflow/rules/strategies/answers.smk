# The answer of every strategy with several batches, its figures, and a target by the name of the strategy:
# `snakemake --cores 2 sequential`.
figure(
    "sequential",
    "Probability and prediction by pours",
    "targets",
    "sequential.tolerance_percent",
    "sequential.probability",
    folder="sequential",
    category="Sequential",
    batches=f"{RESULTS}/sequential/batches.csv",
    check=f"{RESULTS}/sequential/check.csv",
)
figure(
    "approach",
    "The loop closed",
    "targets",
    "refine.tolerance_percent",
    "refine.standard_error_percent",
    folder="refined",
    batches=f"{RESULTS}/refined/batches.csv",
    summary=f"{RESULTS}/refined/summary.json",
)
SURFACE = f"{RESULTS}/response_surface"
FITTED = {"samples": f"{SURFACE}/surface.csv", "dataset": f"{SURFACE}/dataset.csv"}
# Each figure: its title in the report, and its inputs.
RESPONSE_SURFACE_FIGURES = {
    "pareto_screening": (
        "Pareto chart of the screening",
        {"effects": f"{SURFACE}/screening_effects.csv"},
    ),
    "pareto_surface": (
        "Pareto chart of the surface",
        {"effects": f"{SURFACE}/surface_effects.csv"},
    ),
    "perturbation": ("Perturbation plot", FITTED),
    "contours": (
        "Contours of the surface",
        FITTED | {"optimum": f"{SURFACE}/optimum.json"},
    ),
}
for name, (label, shown) in RESPONSE_SURFACE_FIGURES.items():
    figure(
        name,
        label,
        "targets",
        folder="response_surface",
        category="Response surface",
        **shown,
    )


for name in BATCHED:

    rule:
        name:
            f"conclude_{name}"
        input:
            proposals=lambda wildcards, name=name: expand(
                rules.propose.output.proposal,
                strategy=name,
                batch=range(FIRST_BATCH[name], answer_of_batches(name)[0] + 1),
            ),
            tables=lambda wildcards, name=name: tables_in(
                folders_of_batches(name, answer_of_batches(name)[1])
            ),
        output:
            solutions=f"{RESULTS}/{name}/solutions.csv",
            table4=f"{RESULTS}/{name}/table4.csv",
            representative=f"{RESULTS}/{name}/representative.csv",
            check=f"{RESULTS}/{name}/check.csv",
            summary=f"{RESULTS}/{name}/summary.json",
            batches=f"{RESULTS}/{name}/batches.csv",
            dataset=f"{RESULTS}/{name}/dataset.csv",
            runs=f"{RESULTS}/{name}/runs.csv",
            own=[f"{RESULTS}/{name}/{file}" for file in strategies.strategy(name).files],
        log:
            f"{RESULTS}/logs/{name}/concluded.log",
        benchmark:
            f"{RESULTS}/benchmarks/{name}/concluded.tsv"
        resources:
            **needs(350),
        params:
            config=CONFIG,
            folder=folder,
            depends=reads("parameters", "targets", "measure"),
            code=room_hash("strategies", "chain.answer"),
            strategy=name,
            batches=lambda wildcards, input: list(
                dict.fromkeys(
                    map(os.path.dirname, [*input.tables, input.proposals[-1]])
                )
            ),
        message:
            "The answer of {params.strategy}, simulated again, compared with its prediction and the targets"
        shell:
            "python -m repose stage conclude {params.strategy:q} {params.batches:q} --config {params.config:q}"
            " --out {params.folder:q} > {log:q} 2>&1"

    concluded = getattr(rules, f"conclude_{name}").output
    ANSWERS[name] = Answer(
        f"conclude_{name}",
        concluded.solutions,
        concluded.summary,
        concluded.table4,
        concluded.representative,
        concluded.dataset,
    )

    rule:
        name:
            name
        input:
            concluded,
            lambda wildcards, name=name: files_of_batches(name),
            all_files(
                *(
                    shown
                    for shown in FIGURES
                    if os.path.dirname(FIGURES[shown].path) == f"{RESULTS}/{name}"
                )
            ),
