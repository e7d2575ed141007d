# The answer of every strategy with several batches, its figures, and a target by the name of the strategy:
# `snakemake --cores 2 sequential`.
def answer_of_batches(strategy):
    """Number of the folder of the answer, and its proposal; the batches before it are requested on the way."""
    number = first_batch(strategy)
    while True:
        made = checkpoints.propose.get(strategy=strategy, batch=number)
        with open(made.output.proposal) as file:
            proposal = json.load(file)
        if proposal["answer"]:
            return number, proposal
        number += 1


def batches_poured(strategy):
    """Folders of the batches poured for a strategy, the check of the answer among them."""
    number, proposal = answer_of_batches(strategy)
    ends = number if proposal["simulated"] else number + 1
    return [folder_of_batch(strategy, k) for k in range(ends)]


def folders_until_answer(wildcards, input):
    """Folders of all batches of a strategy, and of its answer."""
    return list(
        dict.fromkeys(map(os.path.dirname, [*input.tables, input.proposals[-1]]))
    )


def check_jobs(strategy):
    """Measured jobs of the answer."""
    number, proposal = answer_of_batches(strategy)
    if not proposal["simulated"]:
        return jobs_of(strategy, number)
    jobs = jobs_of(strategy, number - 1)
    names = {f"{sample:03d}.json" for sample in proposal["simulated"]}
    return [path for path in jobs if os.path.basename(path) in names]


def proposals_of(strategy):
    """Input function: all proposals of a strategy."""
    return lambda wildcards: expand(
        rules.propose.output.proposal,
        strategy=strategy,
        batch=range(first_batch(strategy), answer_of_batches(strategy)[0] + 1),
    )


def tables_of(strategy):
    """Input function: the tables of all batches of a strategy."""
    return lambda wildcards: tables_in(batches_poured(strategy))


def files_of_batches(strategy):
    """Input function: every file of the batches by name, as in the method's chain: a lost file is made again."""

    def files(wildcards):
        paths = []
        for number in range(first_batch(strategy), len(batches_poured(strategy))):
            made = [*rules.batch_dataset.output, *rules.propose.output]
            paths += expand(made, strategy=strategy, batch=number)
            measured = jobs_of(strategy, number)
            poured = [path.removesuffix("json") for path in measured]
            paths += [
                *measured,
                *expand("{job}{kind}", job=poured, kind=("pours.json", "npz")),
            ]
        return paths

    return files


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


def figures_of(strategy):
    """Names of the figures of a strategy."""
    own = f"{RESULTS}/{strategy}"
    return [
        name for name, shown in FIGURES.items() if os.path.dirname(shown.path) == own
    ]


for name in BATCHED:

    rule:
        name:
            f"conclude_{name}"
        input:
            proposals=proposals_of(name),
            tables=tables_of(name),
        output:
            solutions=f"{RESULTS}/{name}/solutions.csv",
            table4=f"{RESULTS}/{name}/table4.csv",
            representative=f"{RESULTS}/{name}/representative.csv",
            check=f"{RESULTS}/{name}/check.csv",
            summary=f"{RESULTS}/{name}/summary.json",
            batches=f"{RESULTS}/{name}/batches.csv",
            dataset=f"{RESULTS}/{name}/dataset.csv",
            runs=f"{RESULTS}/{name}/runs.csv",
            own=[
                f"{RESULTS}/{name}/{file}"
                for file in strategies.strategy(name).files
                if file != "check.csv"
            ],
        log:
            f"{RESULTS}/logs/{name}/concluded.log",
        resources:
            **needs(350),
        params:
            **of_stage("conclude"),
            strategy=name,
            batches=folders_until_answer,
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
            files_of_batches(name),
            all_files(*figures_of(name)),
