# The habit of the field: `strategy: response_surface`, or `snakemake --cores 2 response_surface`. Each step pours what the
# analysis of the one before has written, so these analyses are checkpoints.
rule response_design:
    output:
        samples=f"{HABIT}/screening/samples.csv",
    log:
        f"{RESULTS}/logs/response_surface/design.log",
    resources:
        **needs(250),
    params:
        **of_stage("response_design"),
    message:
        "Plackett-Burman design of the screening"
    shell:
        "python -m repose stage response_design --config {params.config:q} --out {params.folder:q} > {log:q} 2>&1"


checkpoint response_screening:
    input:
        samples=f"{HABIT}/screening/samples.csv",
        dataset=f"{HABIT}/screening/dataset.csv",
    output:
        samples=f"{HABIT}/ascent/samples.csv",
        anova=f"{HABIT}/screening/anova.csv",
        effects=f"{HABIT}/screening/effects.csv",
        statistics=f"{HABIT}/screening/statistics.csv",
        kept=f"{HABIT}/screening/screening.json",
    log:
        f"{RESULTS}/logs/response_surface/screening.log",
    resources:
        **needs(250),
    params:
        **of_stage("response_screening", folder=subpath(output.anova, parent=True)),
    message:
        "Which parameters matter, and the path of steepest ascent"
    shell:
        "python -m repose stage response_screening --config {params.config:q} --samples {input.samples:q}"
        " --dataset {input.dataset:q} --next {output.samples:q} --out {params.folder:q} > {log:q} 2>&1"


checkpoint response_ascent:
    input:
        samples=f"{HABIT}/ascent/samples.csv",
        dataset=f"{HABIT}/ascent/dataset.csv",
    output:
        samples=f"{HABIT}/surface/samples.csv",
        path=f"{HABIT}/ascent/path.csv",
    log:
        f"{RESULTS}/logs/response_surface/ascent.log",
    resources:
        **needs(250),
    params:
        **of_stage("response_ascent", folder=subpath(output.path, parent=True)),
    message:
        "The best point of the path, and the design around it"
    shell:
        "python -m repose stage response_ascent --config {params.config:q} --samples {input.samples:q}"
        " --dataset {input.dataset:q} --next {output.samples:q} --out {params.folder:q} > {log:q} 2>&1"


checkpoint response_surface_fit:
    input:
        samples=f"{HABIT}/surface/samples.csv",
        dataset=f"{HABIT}/surface/dataset.csv",
    output:
        samples=f"{HABIT}/check/samples.csv",
        anova=f"{HABIT}/surface/anova.csv",
        effects=f"{HABIT}/surface/effects.csv",
        statistics=f"{HABIT}/surface/statistics.csv",
        predictions=f"{HABIT}/surface/predictions.csv",
        optimum=f"{HABIT}/surface/optimum.json",
    log:
        f"{RESULTS}/logs/response_surface/surface.log",
    resources:
        **needs(250),
    params:
        **of_stage("response_surface", folder=subpath(output.anova, parent=True)),
    message:
        "The surfaces, their analysis of variance and their optimum"
    shell:
        "python -m repose stage response_surface --config {params.config:q} --samples {input.samples:q}"
        " --dataset {input.dataset:q} --next {output.samples:q} --out {params.folder:q} > {log:q} 2>&1"


rule response_check:
    input:
        runs=expand(
            f"{HABIT}/{{step}}/runs.csv",
            step=("screening", "ascent", "surface", "check"),
        ),
        dataset=f"{HABIT}/check/dataset.csv",
        samples=f"{HABIT}/surface/samples.csv",
        surface=f"{HABIT}/surface/dataset.csv",
        predictions=f"{HABIT}/surface/predictions.csv",
        optimum=f"{HABIT}/surface/optimum.json",
    output:
        check=f"{HABIT}/check/check.csv",
        solutions=f"{HABIT}/check/solutions.csv",
        table4=f"{HABIT}/check/table4.csv",
        representative=f"{HABIT}/check/representative.csv",
        summary=f"{HABIT}/check/summary.json",
    log:
        f"{RESULTS}/logs/response_surface/check.log",
    resources:
        **needs(250),
    params:
        **of_stage("response_check"),
        surface=subpath(input.samples, parent=True),
    message:
        "The optimum, simulated again, beside its prediction and the targets"
    shell:
        "python -m repose stage response_check {input.runs:q} --config {params.config:q} --dataset {input.dataset:q}"
        " --surface {params.surface:q} --predictions {input.predictions:q} --optimum {input.optimum:q} --out {params.folder:q} > {log:q} 2>&1"


ANSWERS["response_surface"] = Answer(
    "response_check",
    rules.response_check.output.solutions,
    rules.response_check.output.summary,
    rules.response_check.output.table4,
    rules.response_check.output.representative,
    f"{HABIT}/surface/dataset.csv",  # what the surfaces are fitted to
)
# Each figure: its title in the report, and its inputs.
HABIT_FIGURES = {
    "pareto_screening": (
        "Pareto chart of the screening",
        {"effects": f"{HABIT}/screening/effects.csv"},
    ),
    "pareto_surface": (
        "Pareto chart of the surface",
        {"effects": f"{HABIT}/surface/effects.csv"},
    ),
    "perturbation": (
        "Perturbation plot",
        {
            "samples": f"{HABIT}/surface/samples.csv",
            "dataset": f"{HABIT}/surface/dataset.csv",
        },
    ),
    "contours": (
        "Contours of the surface",
        {
            "samples": f"{HABIT}/surface/samples.csv",
            "dataset": f"{HABIT}/surface/dataset.csv",
            "optimum": f"{HABIT}/surface/optimum.json",
        },
    ),
}
for name, (label, shown) in HABIT_FIGURES.items():
    figure(
        name,
        label,
        "targets",
        folder="response_surface",
        category="Response surface",
        **shown,
    )


rule response_surface:
    input:
        rules.response_check.output,
        expand(
            f"{HABIT}/{{step}}/{{table}}.csv",
            step=("screening", "surface"),
            table=("anova", "effects", "statistics"),
        ),
        f"{HABIT}/ascent/path.csv",
        [FIGURES[name].path for name in HABIT_FIGURES],
