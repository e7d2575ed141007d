# Runs of a program of the user's own: a job for each run of each sample, then one that reads the responses of all samples.
# A run that fails is a result with a status; only a fault of the set-up, as a missing program, ends with an error.
PROGRAM = STUDY.simulator
RUNS_OF_SAMPLE = STUDY.settings.count_design_seeds(OWN_BENCH)
# The time limit, and the start of the job.
MINUTES_OF_PROGRAM = 5 + math.ceil(PROGRAM.time_limit_s / 60)
DESIGN_RUNS = results_folder.list_run_records(
    f"{RESULTS}/{FOLDERS[0]}", dict.fromkeys(SAMPLES, RUNS_OF_SAMPLE)
)


rule simulate:
    input:
        samples=rules.design.output.samples,
    output:
        record=f"{RESULTS}/{{runs}}/{{sample}}/{{run}}.json",
    log:
        f"{RESULTS}/logs/{{runs}}/{{sample}}_{{run}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{runs}}/{{sample}}_{{run}}.tsv"
    wildcard_constraints:
        run=r"\d+",
    priority: 1
    retries: 1
    threads: PROGRAM.cores
    resources:
        **resources_for_attempt(200 + PROGRAM.memory_mb, minutes=MINUTES_OF_PROGRAM),
    params:
        config=CONFIG,
        folder=find_output_folder,
        purpose="design",
        sample=lambda wildcards: int(wildcards.sample),
        settings=select_stage_settings("simulate"),
        code=code_hash("stages.simulate"),
        # braces of a template are no wildcards
        command=lambda wildcards: shlex.join(PROGRAM.command),
    message:
        "{PROGRAM.name}, sample {params.sample}, run {wildcards.run}: {params.command}"
    shell:
        "python -m repose stage simulate --config {params.config:q} --samples {input.samples:q}"
        " --sample {params.sample:q} --run {wildcards.run:q} --purpose {params.purpose:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


rule measure_runs:
    input:
        samples=rules.design.output.samples,
        records=DESIGN_RUNS,
    output:
        result=list_sample_paths(SAMPLES, f"{RESULTS}/{{runs}}/{{sample}}.json"),
    log:
        f"{RESULTS}/logs/{{runs}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/{{runs}}_measured.tsv"
    priority: 1
    resources:
        **resources_for_attempt(350, minutes=60),
    params:
        config=CONFIG,
        code=code_hash("stages.simulated"),
        folder=find_output_folder,
        jobs=lambda wildcards, input: results_folder.count_records_by_folder(
            input.records
        ),
        settings=select_stage_settings("measure_simulated"),
    message:
        "Reading the responses of the runs in {params.folder}"
    shell:
        "python -m repose stage measure_simulated {params.jobs:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"
