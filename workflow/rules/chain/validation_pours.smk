# The published sets are poured on request alone, `snakemake --cores 2 published_sets`: their piles change with engine
# and scene, not with the study. A study shows those of a stored table, `validation.published_simulated`.
rule published_solutions:
    input:
        published=list(map(str, list_tables(config["validation"]["published"]))),
    output:
        solutions=f"{RESULTS}/validation/published_solutions.csv",
    log:
        f"{RESULTS}/logs/published_solutions.log",
    benchmark:
        f"{RESULTS}/benchmarks/published_solutions.tsv"
    resources:
        **resources_for_attempt(250),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("published_solutions"),
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
        pours=list_sample_paths(OWN_SOLUTIONS, rules.validation_pour.output.pours),
        berries=list_sample_paths(OWN_SOLUTIONS, rules.validation_pour.output.berries),
        samples=rules.solutions.output.solutions,
    output:
        result=list_sample_paths(
            OWN_SOLUTIONS, f"{RESULTS}/validation/{{runs}}/{{sample}}.json"
        ),
    log:
        f"{RESULTS}/logs/validation/{{runs}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/validation/{{runs}}_measured.tsv"


if PUBLISHED_SOLUTIONS:

    use rule measure_runs as measure_published_runs with:
        input:
            **GRAIN,
            pours=list_sample_paths(
                PUBLISHED_SOLUTIONS, rules.validation_pour.output.pours
            ),
            berries=list_sample_paths(
                PUBLISHED_SOLUTIONS, rules.validation_pour.output.berries
            ),
            samples=rules.published_solutions.output.solutions,
        output:
            result=list_sample_paths(
                PUBLISHED_SOLUTIONS, f"{RESULTS}/validation/{{runs}}/{{sample}}.json"
            ),
        log:
            f"{RESULTS}/logs/validation/{{runs}}_published_measured.log",
        benchmark:
            f"{RESULTS}/benchmarks/validation/{{runs}}_published_measured.tsv"


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
        **resources_for_attempt(250),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("published_sets"),
        code=code_hash("stages.validate"),
    message:
        "The published parameter sets in this simulator: {output.table}"
    shell:
        "python -m repose stage published_sets {input.jobs:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


SOLUTION_RUNS = expand(rules.validation_pour.output, runs=FOLDERS, sample=OWN_SOLUTIONS)
