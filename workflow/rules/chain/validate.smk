# Numbers in solutions.csv: own solutions from 1, the representative first; published solutions from 101.
OWN_SOLUTIONS = [
    f"{number:03d}" for number in range(1, config["validation"]["solutions"] + 2)
]
PUBLISHED_SOLUTIONS = [
    f"{101 + k}"
    for k in range(
        published_count(
            config["validation"]["published"],
            STUDY.targets.responses,
            STUDY.parameters.names,
        )
    )
]


rule solutions:
    input:
        feasible=rules.miga.output.feasible,
        published=config["validation"]["published"] or [],
    output:
        solutions=f"{RESULTS}/validation/solutions.csv",
    log:
        f"{RESULTS}/logs/solutions.log",
    priority: 1
    resources:
        **needs(250),
    params:
        **of_stage("solutions"),
    message:
        "Choosing the solutions to simulate again"
    shell:
        "python -m repose stage solutions --config {params.config:q} --feasible {input.feasible:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


# In a table of their own, so that another answer of the search is no reason to pour the published solutions again.
rule published_solutions:
    input:
        published=config["validation"]["published"] or [],
    output:
        solutions=f"{RESULTS}/validation/published_solutions.csv",
    log:
        f"{RESULTS}/logs/published_solutions.log",
    resources:
        **needs(250),
    params:
        **of_stage("published_solutions"),
    message:
        "Listing the published solutions"
    shell:
        "python -m repose stage published_solutions --config {params.config:q} --out {params.folder:q} > {log:q} 2>&1"


use rule pour as validation_pour with:
    input:
        **READY,
        samples=solution_to_pour,
    output:
        pours=f"{RESULTS}/validation/{{runs}}/{{sample}}.pours.json",
        berries=f"{RESULTS}/validation/{{runs}}/{{sample}}.npz",
    log:
        f"{RESULTS}/logs/validation/{{runs}}/{{sample}}.log",
    params:
        purpose="validation",
        seeds=validation_seeds,
    message:
        "Pouring solution {wildcards.sample} with fresh seeds"


use rule measure_runs as measure_validation_runs with:
    input:
        **GRAIN,
        pours=rules.validation_pour.output.pours,
        berries=rules.validation_pour.output.berries,
    output:
        result=f"{RESULTS}/validation/{{runs}}/{{sample}}.json",
    log:
        f"{RESULTS}/logs/validation/{{runs}}/{{sample}}_measured.log",
    message:
        "Measuring the runs of solution {wildcards.sample}"


rule validate:
    input:
        solutions=rules.solutions.output.solutions,
        jobs=expand(
            rules.measure_validation_runs.output.result,
            runs=folders_of_targets(),
            sample=OWN_SOLUTIONS + PUBLISHED_SOLUTIONS,
        ),
        dataset=rules.dataset.output.dataset,
    output:
        table4=f"{RESULTS}/validation/table4.csv",
        representative=f"{RESULTS}/validation/representative.csv",
        published=f"{RESULTS}/validation/published.csv",
    log:
        f"{RESULTS}/logs/validate.log",
    resources:
        **needs(250),
    params:
        **of_stage("validate"),
    message:
        "Predicted beside simulated and published"
    shell:
        "python -m repose stage validate {input.jobs:q} --config {params.config:q} --solutions {input.solutions:q}"
        " --dataset {input.dataset:q} --out {params.folder:q} > {log:q} 2>&1"


ANSWERS["published"] = Answer(
    "validate",
    rules.miga.output.feasible,
    rules.miga.output.summary,
    rules.validate.output.table4,
    rules.validate.output.representative,
    rules.dataset.output.dataset,
)
