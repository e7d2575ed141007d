# Runs of the bench tests; runs of the funnel are heaps. A run that fails is a result with a status; only a crash ends
# with an error and is tried once more. They and what waits for them have priority over figures, for which nothing waits.
# The process that pours a sample measures it, too, and keeps that beside the runs. One job then writes the measurements
# of all samples: it takes a kept one that is the same, and measures the pile itself where the settings have changed.
rule pour:
    input:
        **READY,
        samples=rules.design.output.samples,
    output:
        pours=f"{RESULTS}/{{runs}}/{{sample}}.pours.json",
        berries=f"{RESULTS}/{{runs}}/{{sample}}.npz",
    log:
        f"{RESULTS}/logs/{{runs}}/{{sample}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{runs}}/{{sample}}.tsv"
    priority: 1
    retries: 1
    resources:
        **resources_for_attempt(350, minutes=MINUTES_OF_RUNS),
    params:
        config=CONFIG,
        folder=find_output_folder,
        apparatus=find_bench_test,
        purpose="design",
        sample=lambda wildcards: wildcards.sample,
        seeds=lambda wildcards: STUDY.settings.count_design_seeds(
            find_bench_test(wildcards)
        ),
        more=["--keep-runs", "--measure"],
        settings=lambda wildcards: select_stage_settings(
            "pour", find_bench_test(wildcards)
        ),
        code=engine_hash(),
    message:
        "Pouring sample {wildcards.sample}"
    shell:
        "python -m repose stage pour --apparatus {params.apparatus:q} --config {params.config:q}"
        " --samples {input.samples:q} --sample {params.sample:q} --seeds {params.seeds:q} --purpose {params.purpose:q}"
        " --berry {input.berry:q} --particle {input.particle:q} {params.more:q} --out {params.folder:q} > {log:q} 2>&1"


DESIGN_RUNS = expand(rules.pour.output, runs=FOLDERS, sample=SAMPLES)


rule measure_runs:
    input:
        **GRAIN,
        pours=list_sample_paths(SAMPLES, rules.pour.output.pours),
        berries=list_sample_paths(SAMPLES, rules.pour.output.berries),
        samples=rules.design.output.samples,
    output:
        result=list_sample_paths(SAMPLES, f"{RESULTS}/{{runs}}/{{sample}}.json"),
    log:
        f"{RESULTS}/logs/{{runs}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{runs}}_measured.tsv"
    priority: 1
    resources:
        **resources_for_attempt(350, minutes=MINUTES_OF_RUNS),
    params:
        config=CONFIG,
        code=code_hash("stages.job"),
        folder=find_output_folder,
        jobs=find_runs_to_measure,
        settings=lambda wildcards: select_stage_settings(
            "measure_runs", find_bench_test(wildcards)
        ),
    message:
        "Measuring the runs in {params.folder}"
    shell:
        "python -m repose stage measure_runs {params.jobs:q} --config {params.config:q} --berry {input.berry:q}"
        " --particle {input.particle:q} --keep-runs --out {params.folder:q} > {log:q} 2>&1"
