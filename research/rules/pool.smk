# Pours that the comparisons share, on request: `snakemake -s research/Snakefile --cores 2 pool`. See docs/comparison.md.
POOL = f"{RESULTS}/pool"
# Each set of points: prefix of its tables' names, and its keys in the configuration.
POOL_SETS = {
    "pool": ["", "samples", "seeds"],
    "fresh": ["fresh_", "fresh_samples", "fresh_seeds"],
}


wildcard_constraints:
    points="pool|fresh",


rule pool_design:
    output:
        pool=f"{POOL}/samples.csv",
        fresh=f"{POOL}/fresh_samples.csv",
    log:
        f"{RESULTS}/logs/pool/design.log",
    benchmark:
        f"{RESULTS}/benchmarks/pool/design.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(250),
        runtime=grow_with_attempts(60),
    params:
        config=CONFIG,
        folder=find_output_folder,
        depends=select_study_sections(
            "parameters", "pool.samples", "pool.fresh_samples", "pool.seed"
        ),
    message:
        "Points of the pool"
    shell:
        "python -m research.pool points --config {params.config:q} --out {params.folder:q} > {log:q} 2>&1"


# A larger pool begins with the points of the smaller one, so its table being new is no reason to pour them again.
use rule pour as pool_pour with:
    input:
        samples=lambda wildcards: ancient(
            str(rules.pool_design.output[list(POOL_SETS).index(wildcards.points)])
        ),
        berry=rules.berry.output.berry,
        particle=rules.shape.output.particle,
        ready=ancient(rules.warm_up.output.ready),
    output:
        pours=f"{POOL}/{{runs}}/{{points}}/{{sample}}.pours.json",
        berries=f"{POOL}/{{runs}}/{{points}}/{{sample}}.npz",
    log:
        f"{RESULTS}/logs/pool/{{runs}}/{{points}}/{{sample}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/pool/{{runs}}/{{points}}/{{sample}}.tsv"
    params:
        purpose=lambda wildcards: STREAMS[wildcards.points],
        seeds=lambda wildcards: STUDIES["pool"][POOL_SETS[wildcards.points][2]],
        settings=lambda wildcards: dependencies.select_simulation_settings(
            config, find_bench_test(wildcards)
        )
        | select_study_sections("parameters", "pool.seed"),
    message:
        "Pouring point {wildcards.sample} of the set {wildcards.points}"


use rule measure_runs as measure_pool_runs with:
    input:
        pours=rules.pool_pour.output.pours,
        berries=rules.pool_pour.output.berries,
        berry=rules.berry.output.berry,
        particle=rules.shape.output.particle,
    output:
        result=f"{POOL}/{{runs}}/{{points}}/{{sample}}.json",
    log:
        f"{RESULTS}/logs/pool/{{runs}}/{{points}}/{{sample}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/pool/{{runs}}/{{points}}/{{sample}}_measured.tsv"
    message:
        "Measuring point {wildcards.sample} of the set {wildcards.points}"


for points, (prefix, count, _) in POOL_SETS.items():

    rule:
        name:
            f"{points}_dataset"
        input:
            samples=f"{POOL}/{prefix}samples.csv",
            jobs=expand(
                rules.measure_pool_runs.output.result,
                runs=FOLDERS,
                points=points,
                sample=[f"{k:03d}" for k in range(1, STUDIES["pool"][count] + 1)],
            ),
        output:
            dataset=f"{POOL}/{prefix}dataset.csv",
            runs=f"{POOL}/{prefix}runs.csv",
            summary=f"{POOL}/{prefix}dataset_summary.json",
        log:
            f"{RESULTS}/logs/pool/{points}_dataset.log",
        benchmark:
            f"{RESULTS}/benchmarks/pool/{points}_dataset.tsv"
        threads: 1
        resources:
            mem_mb=grow_with_attempts(150),
            runtime=grow_with_attempts(10),
        params:
            config=CONFIG,
            folder=find_output_folder,
            jobs=list_job_folders,
            prefix=prefix,
            depends=STUDY.targets.names,
        message:
            "Table of the set {rule}"
        shell:
            "python -m repose stage dataset {params.jobs:q} --config {params.config:q} --samples {input.samples:q}"
            " --prefix={params.prefix:q} --out {params.folder:q} > {log:q} 2>&1"


# Every file by name, as in the method's chain: a lost file is made again.
rule pool:
    input:
        rules.pool_design.output,
        [
            expand(
                [*rules.pool_pour.output, *rules.measure_pool_runs.output],
                runs=FOLDERS,
                points=points,
                sample=[f"{k:03d}" for k in range(1, STUDIES["pool"][count] + 1)],
            )
            for points, (_, count, _) in POOL_SETS.items()
        ],
        rules.pool_dataset.output,
        rules.fresh_dataset.output,
