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


for step, found in FOUND.items():

    checkpoint:
        name:
            f"after_{step}"
        input:
            tables_until(step),
        output:
            found=expand(f"{RESPONSE_SURFACE}/{step}/{{file}}", file=found),
            samples=f"{RESPONSE_SURFACE}/{following(step)}/samples.csv",
        log:
            f"{RESULTS}/logs/response_surface/{step}.log",
        resources:
            **needs(250),
        params:
            **of_stage("response_step"),
            steps=folders_until(step),
        message:
            f"What the {step} shows, and the parameter sets of the next step"
        shell:
            "python -m repose stage response_step {params.steps:q} --config {params.config:q} --next {output.samples:q}"
            " --out {params.folder:q} > {log:q} 2>&1"


rule response_check:
    input:
        tables_until("check"),
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
        steps=folders_until("check"),
    message:
        "The optimum, simulated again, compared with its prediction and the targets"
    shell:
        "python -m repose stage response_check {params.steps:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


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
        [f"{RESPONSE_SURFACE}/{step}/{file}" for step in FOUND for file in FOUND[step]],
        all_files(*RESPONSE_SURFACE_FIGURES),
