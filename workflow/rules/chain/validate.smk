# Numbers of parameter sets: own solutions from 1, the representative first; published ones from 101.
OWN_SOLUTIONS = [
    f"{number:03d}" for number in range(1, config["validation"]["solutions"] + 2)
]
PUBLISHED_NAMES = to_simulate(
    config["validation"]["published"], STUDY.targets.responses, STUDY.parameters.names
)
PUBLISHED_SOLUTIONS = [f"{FIRST_PUBLISHED + k}" for k in range(len(PUBLISHED_NAMES))]
STORED = config["validation"]["published_simulated"]
# Whether the stored table of simulated published sets can be set beside this study.
PUBLISHED_IS_STORED = bool(STORED) and bool(
    stored_columns(
        columns_of_stored(STORED),
        names=STUDY.parameters.names,
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
        **needs(250),
    params:
        config=CONFIG,
        folder=folder,
        settings=settings_of("solutions"),
        code=code_hash("stages.validate"),
    message:
        "Choosing the solutions to simulate again"
    shell:
        "python -m repose stage solutions --config {params.config:q} --feasible {input.feasible:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


# The published sets are poured on request alone, `snakemake --cores 2 published_sets`: their piles change with engine
# and scene, not with the study. A study shows those of a stored table, `validation.published_simulated`.
rule published_solutions:
    input:
        published=list(map(str, tables(config["validation"]["published"]))),
    output:
        solutions=f"{RESULTS}/validation/published_solutions.csv",
    log:
        f"{RESULTS}/logs/published_solutions.log",
    benchmark:
        f"{RESULTS}/benchmarks/published_solutions.tsv"
    resources:
        **needs(250),
    params:
        config=CONFIG,
        folder=folder,
        settings=settings_of("published_solutions"),
        code=code_hash("stages.validate"),
    message:
        "Listing the published solutions"
    shell:
        "python -m repose stage published_solutions --config {params.config:q} --out {params.folder:q} > {log:q} 2>&1"


use rule pour as validation_pour with:
    input:
        **READY,
        samples=lambda wildcards: (
            rules.solutions
            if wildcards.sample in OWN_SOLUTIONS
            else rules.published_solutions
        ).output.solutions,
    output:
        pours=f"{RESULTS}/validation/{{runs}}/{{sample}}.pours.json",
        berries=f"{RESULTS}/validation/{{runs}}/{{sample}}.npz",
    log:
        f"{RESULTS}/logs/validation/{{runs}}/{{sample}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/validation/{{runs}}/{{sample}}.tsv"
    params:
        purpose="validation",
        # the representative solution gets more
        seeds=lambda wildcards: config["validation"][
            "representative_seeds" if wildcards.sample == OWN_SOLUTIONS[0] else "seeds"
        ],
    message:
        "Pouring solution {wildcards.sample} with fresh seeds"


use rule measure_runs as measure_validation_runs with:
    input:
        **GRAIN,
        pours=for_each(OWN_SOLUTIONS, rules.validation_pour.output.pours),
        berries=for_each(OWN_SOLUTIONS, rules.validation_pour.output.berries),
        samples=rules.solutions.output.solutions,
    output:
        result=for_each(OWN_SOLUTIONS, f"{RESULTS}/validation/{{runs}}/{{sample}}.json"),
    log:
        f"{RESULTS}/logs/validation/{{runs}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/validation/{{runs}}_measured.tsv"


if PUBLISHED_SOLUTIONS:

    use rule measure_runs as measure_published_runs with:
        input:
            **GRAIN,
            pours=for_each(PUBLISHED_SOLUTIONS, rules.validation_pour.output.pours),
            berries=for_each(PUBLISHED_SOLUTIONS, rules.validation_pour.output.berries),
            samples=rules.published_solutions.output.solutions,
        output:
            result=for_each(
                PUBLISHED_SOLUTIONS, f"{RESULTS}/validation/{{runs}}/{{sample}}.json"
            ),
        log:
            f"{RESULTS}/logs/validation/{{runs}}_published_measured.log",
        benchmark:
            f"{RESULTS}/benchmarks/validation/{{runs}}_published_measured.tsv"


rule validate:
    input:
        solutions=rules.solutions.output.solutions,
        jobs=expand(rules.measure_validation_runs.output.result, runs=FOLDERS),
        published=STORED or [],
        dataset=rules.dataset.output.dataset,
        optimism=rules.optimism.output.optimism,
    output:
        table4=f"{RESULTS}/validation/table4.csv",
        representative=f"{RESULTS}/validation/representative.csv",
        published=f"{RESULTS}/validation/published.csv",
    log:
        f"{RESULTS}/logs/validate.log",
    benchmark:
        f"{RESULTS}/benchmarks/validate.tsv"
    resources:
        **needs(250),
    params:
        config=CONFIG,
        folder=folder,
        settings=settings_of("validate"),
        code=code_hash("stages.validate"),
    message:
        "Predicted beside simulated and published"
    shell:
        "python -m repose stage validate {input.jobs:q} --config {params.config:q} --solutions {input.solutions:q}"
        " --dataset {input.dataset:q} --optimism {input.optimism:q} --out {params.folder:q} > {log:q} 2>&1"


rule published_sets:
    input:
        published=rules.published_solutions.input.published,
        jobs=(
            expand(rules.measure_published_runs.output.result, runs=FOLDERS)
            if PUBLISHED_SOLUTIONS
            else []
        ),
    output:
        table=f"{RESULTS}/published_sets.csv",
    log:
        f"{RESULTS}/logs/published_sets.log",
    benchmark:
        f"{RESULTS}/benchmarks/published_sets.tsv"
    resources:
        **needs(250),
    params:
        config=CONFIG,
        folder=folder,
        settings=settings_of("published_sets"),
        code=code_hash("stages.validate"),
    message:
        "The published parameter sets in this simulator: {output.table}"
    shell:
        "python -m repose stage published_sets {input.jobs:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


ANSWERS["published"] = Answer(
    "validate",
    rules.miga.output.feasible,
    rules.miga.output.summary,
    rules.validate.output.table4,
    rules.validate.output.representative,
    rules.dataset.output.dataset,
)
