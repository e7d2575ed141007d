# Numbers of parameter sets: own solutions from 1, the representative first; published ones from 101.
OWN_SOLUTIONS = [
    f"{number:03d}" for number in range(1, config["validation"]["solutions"] + 2)
]
PUBLISHED_NAMES = list_sets_to_simulate(
    config["validation"]["published"], STUDY.targets.responses, STUDY.parameters.names
)
PUBLISHED_SOLUTIONS = [f"{FIRST_PUBLISHED + k}" for k in range(len(PUBLISHED_NAMES))]
STORED = config["validation"]["published_simulated"]
# Whether the stored table of simulated published sets can be set beside this study.
PUBLISHED_IS_STORED = bool(STORED) and bool(
    find_response_columns(
        read_column_names(STORED),
        parameter_names=STUDY.parameters.names,
        targets=STUDY.targets,
        definition=STUDY.settings.measure.response,
    )
)


rule solutions:
    input:
        feasible=rules.miga.output.feasible,
    output:
        solutions=f"{RESULTS}/validation/solutions.csv",
    log:
        f"{RESULTS}/logs/solutions.log",
    benchmark:
        f"{RESULTS}/benchmarks/solutions.tsv"
    priority: 1
    resources:
        **resources_for_attempt(250),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("solutions"),
        code=code_hash("stages.validate"),
    message:
        "Choosing the solutions to simulate again"
    shell:
        "python -m repose stage solutions --config {params.config:q} --feasible {input.feasible:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


include: f"validation_{'runs' if IS_EXTERNAL else 'pours'}.smk"


rule validate:
    input:
        solutions=rules.solutions.output.solutions,
        jobs=expand(rules.measure_validation_runs.output.result, runs=FOLDERS),
        published=STORED or [],
        dataset=rules.dataset.output.dataset,
        optimism=rules.optimism.output.optimism,
    output:
        **({} if IS_EXTERNAL else {"published": f"{RESULTS}/validation/published.csv"}),
        table4=f"{RESULTS}/validation/table4.csv",
        representative=f"{RESULTS}/validation/representative.csv",
    log:
        f"{RESULTS}/logs/validate.log",
    benchmark:
        f"{RESULTS}/benchmarks/validate.tsv"
    resources:
        **resources_for_attempt(250),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("validate"),
        code=code_hash("stages.validate"),
    message:
        "Predicted beside simulated and published"
    shell:
        "python -m repose stage validate {input.jobs:q} --config {params.config:q} --solutions {input.solutions:q}"
        " --dataset {input.dataset:q} --optimism {input.optimism:q} --out {params.folder:q} > {log:q} 2>&1"


ANSWERS["published"] = Answer(
    "validate",
    rules.miga.output.feasible,
    rules.miga.output.summary,
    rules.validate.output.table4,
    rules.validate.output.representative,
    rules.dataset.output.dataset,
)
