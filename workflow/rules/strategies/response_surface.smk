# The usual way in the field: `strategy: response_surface`, or `snakemake --cores 2 response_surface`. Each step pours the
# samples that the analysis of the step before has written, so these analyses are checkpoints.
rule response_design:
    output:
        samples=f"{RESPONSE_SURFACE}/screening/samples.csv",
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
        samples=f"{RESPONSE_SURFACE}/screening/samples.csv",
        dataset=f"{RESPONSE_SURFACE}/screening/dataset.csv",
    output:
        samples=f"{RESPONSE_SURFACE}/ascent/samples.csv",
        anova=f"{RESPONSE_SURFACE}/screening/anova.csv",
        effects=f"{RESPONSE_SURFACE}/screening/effects.csv",
        statistics=f"{RESPONSE_SURFACE}/screening/statistics.csv",
        kept=f"{RESPONSE_SURFACE}/screening/screening.json",
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
        samples=f"{RESPONSE_SURFACE}/ascent/samples.csv",
        dataset=f"{RESPONSE_SURFACE}/ascent/dataset.csv",
    output:
        samples=f"{RESPONSE_SURFACE}/surface/samples.csv",
        path=f"{RESPONSE_SURFACE}/ascent/path.csv",
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
        samples=f"{RESPONSE_SURFACE}/surface/samples.csv",
        dataset=f"{RESPONSE_SURFACE}/surface/dataset.csv",
    output:
        samples=f"{RESPONSE_SURFACE}/check/samples.csv",
        anova=f"{RESPONSE_SURFACE}/surface/anova.csv",
        effects=f"{RESPONSE_SURFACE}/surface/effects.csv",
        statistics=f"{RESPONSE_SURFACE}/surface/statistics.csv",
        predictions=f"{RESPONSE_SURFACE}/surface/predictions.csv",
        optimum=f"{RESPONSE_SURFACE}/surface/optimum.json",
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
            f"{RESPONSE_SURFACE}/{{step}}/runs.csv",
            step=("screening", "ascent", "surface", "check"),
        ),
        dataset=f"{RESPONSE_SURFACE}/check/dataset.csv",
        samples=f"{RESPONSE_SURFACE}/surface/samples.csv",
        surface=f"{RESPONSE_SURFACE}/surface/dataset.csv",
        predictions=f"{RESPONSE_SURFACE}/surface/predictions.csv",
        optimum=f"{RESPONSE_SURFACE}/surface/optimum.json",
    output:
        check=f"{RESPONSE_SURFACE}/check/check.csv",
        solutions=f"{RESPONSE_SURFACE}/check/solutions.csv",
        table4=f"{RESPONSE_SURFACE}/check/table4.csv",
        representative=f"{RESPONSE_SURFACE}/check/representative.csv",
        summary=f"{RESPONSE_SURFACE}/check/summary.json",
    log:
        f"{RESULTS}/logs/response_surface/check.log",
    resources:
        **needs(250),
    params:
        **of_stage("response_check"),
        surface=subpath(input.samples, parent=True),
    message:
        "The optimum, simulated again, compared with its prediction and the targets"
    shell:
        "python -m repose stage response_check {input.runs:q} --config {params.config:q} --dataset {input.dataset:q}"
        " --surface {params.surface:q} --predictions {input.predictions:q} --optimum {input.optimum:q} --out {params.folder:q} > {log:q} 2>&1"


ANSWERS["response_surface"] = Answer(
    "response_check",
    rules.response_check.output.solutions,
    rules.response_check.output.summary,
    rules.response_check.output.table4,
    rules.response_check.output.representative,
    f"{RESPONSE_SURFACE}/surface/dataset.csv",  # data of the surfaces
)
# Each figure: its title in the report, and its inputs.
RESPONSE_SURFACE_FIGURES = {
    "pareto_screening": (
        "Pareto chart of the screening",
        {"effects": f"{RESPONSE_SURFACE}/screening/effects.csv"},
    ),
    "pareto_surface": (
        "Pareto chart of the surface",
        {"effects": f"{RESPONSE_SURFACE}/surface/effects.csv"},
    ),
    "perturbation": (
        "Perturbation plot",
        {
            "samples": f"{RESPONSE_SURFACE}/surface/samples.csv",
            "dataset": f"{RESPONSE_SURFACE}/surface/dataset.csv",
        },
    ),
    "contours": (
        "Contours of the surface",
        {
            "samples": f"{RESPONSE_SURFACE}/surface/samples.csv",
            "dataset": f"{RESPONSE_SURFACE}/surface/dataset.csv",
            "optimum": f"{RESPONSE_SURFACE}/surface/optimum.json",
        },
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


rule response_surface:
    input:
        rules.response_check.output,
        expand(
            f"{RESPONSE_SURFACE}/{{step}}/{{table}}.csv",
            step=("screening", "surface"),
            table=("anova", "effects", "statistics"),
        ),
        f"{RESPONSE_SURFACE}/ascent/path.csv",
        all_files(*RESPONSE_SURFACE_FIGURES),
