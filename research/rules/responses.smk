# The next measurement, on existing piles: `snakemake -s research/Snakefile --cores 2 second_responses`. With other bench tests, on a
# part of the design: `second_responses_benches` ranks their information, `joint_targets` looks for the best few of them.


rule measure_responses:
    input:
        pours=expand(rules.pour.output.pours, runs="heaps", sample=SAMPLES),
        berries=expand(rules.pour.output.berries, runs="heaps", sample=SAMPLES),
        runs=rules.dataset.output.runs,
        berry=rules.berry.output.berry,
        particle=rules.shape.output.particle,
    output:
        runs=f"{RESULTS}/responses/runs.csv",
    log:
        f"{RESULTS}/logs/measure_responses.log",
    benchmark:
        f"{RESULTS}/benchmarks/measure_responses.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(350),
        runtime=grow_with_attempts(60),
    params:
        config=CONFIG,
        depends=select_study_sections("measure", "funnel.plate_diameter_mm"),
    message:
        "Further responses of existing piles"
    shell:
        "python -m research.responses measure {input.pours:q} --config {params.config:q} --runs {input.runs:q}"
        " --berry {input.berry:q} --particle {input.particle:q} --out {output.runs:q} > {log:q} 2>&1"


FURTHER_RUNS = [
    RUN_FOLDERS[name] for name in names() if name != "funnel" and name in config
]
JOINT = STUDIES["joint_targets"]

if FURTHER_RUNS:
    IN_TESTS = min(JOINT["samples"], len(SAMPLES))
    JOINT_SAMPLES = [
        SAMPLES[k * (len(SAMPLES) - 1) // max(1, IN_TESTS - 1)] for k in range(IN_TESTS)
    ]

    use rule pour as joint_pour with:
        output:
            pours=f"{RESULTS}/joint_targets/{{runs}}/{{sample}}.pours.json",
            berries=f"{RESULTS}/joint_targets/{{runs}}/{{sample}}.npz",
        log:
            f"{RESULTS}/logs/joint_targets/{{runs}}/{{sample}}.log",
        benchmark:
            f"{RESULTS}/benchmarks/joint_targets/{{runs}}/{{sample}}.tsv"
        params:
            purpose=STREAMS["joint_targets"],
            seeds=JOINT["seeds"],
        message:
            "Sample {wildcards.sample} in a further bench test, {wildcards.runs}"

    use rule measure_runs as measure_joint_runs with:
        input:
            pours=rules.joint_pour.output.pours,
            berries=rules.joint_pour.output.berries,
            berry=rules.berry.output.berry,
            particle=rules.shape.output.particle,
        output:
            result=f"{RESULTS}/joint_targets/{{runs}}/{{sample}}.json",
        log:
            f"{RESULTS}/logs/joint_targets/{{runs}}/{{sample}}_measured.log",
        benchmark:
            f"{RESULTS}/benchmarks/joint_targets/{{runs}}/{{sample}}_measured.tsv"
        message:
            "Measuring sample {wildcards.sample} in a further bench test, {wildcards.runs}"

    JOINT_RUNS = expand(
        rules.measure_joint_runs.output.result,
        runs=FURTHER_RUNS,
        sample=JOINT_SAMPLES,
    )


# The same tables without and with the other bench tests: a folder, and the inputs besides the piles.
SECOND_RESPONSES = {
    "second_responses": (f"{RESULTS}/responses", {}),
}
if FURTHER_RUNS:
    SECOND_RESPONSES["second_responses_benches"] = (
        f"{RESULTS}/responses/with_benches",
        {"jobs": JOINT_RUNS},
    )
SECOND_TABLES = ("responses", "information", "narrowing", "ways", "order")


for study, (where, more) in SECOND_RESPONSES.items():

    rule:
        name:
            f"{study}_tables"
        input:
            **more,
            runs=rules.measure_responses.output.runs,
            dataset=rules.dataset.output.dataset,
        output:
            **{name: f"{where}/{name}.csv" for name in SECOND_TABLES},
            summary=f"{where}/responses.json",
        log:
            f"{RESULTS}/logs/{study}.log",
        benchmark:
            f"{RESULTS}/benchmarks/{study}.tsv"
        threads: 1
        resources:
            mem_mb=grow_with_attempts(350),
            runtime=grow_with_attempts(60),
        params:
            config=CONFIG,
            folder=find_output_folder,
            jobs=lambda wildcards, input: (
                ["--jobs", *list_job_folders(wildcards, input)]
                if hasattr(input, "jobs")
                else []
            ),
            depends=select_study_sections(
                "parameters",
                "targets",
                "network.hidden",
                "network.epochs",
                "posterior.discrepancy_percent",
                "second_responses",
            ),
        message:
            "Narrowing of the posterior by further responses"
        shell:
            "python -m research.responses second --config {params.config:q} --runs {input.runs:q}"
            " --dataset {input.dataset:q} {params.jobs:q} --out {params.folder:q} > {log:q} 2>&1"

    rule:
        name:
            f"draw_{study}"
        input:
            **{name: f"{where}/{name}.csv" for name in SECOND_TABLES},
        output:
            report(
                f"{where}/second_responses.png",
                caption=f"../report/{study}.rst",
                category="Comparisons",
                labels={"figure": study},
            ),
            list_other_formats(f"{where}/second_responses.png"),
        log:
            f"{RESULTS}/logs/figures/{study}.log",
        benchmark:
            f"{RESULTS}/benchmarks/figures/{study}.tsv"
        threads: 1
        resources:
            mem_mb=grow_with_attempts(400),
            runtime=grow_with_attempts(10),
        params:
            config=CONFIG,
            inputs=[
                f"--input={name}={where}/{name}.csv"
                for name in SECOND_TABLES
                if name != "order"
            ],
            depends=select_study_sections("small_run") | RESOLUTION,
        message:
            "Drawing the candidates for the next measurement"
        shell:
            "python -m research.figures draw second_responses --config {params.config:q} {params.inputs:q} --out {output[0]:q}"
            " > {log:q} 2>&1"


rule second_responses:
    input:
        rules.second_responses_tables.output,
        rules.draw_second_responses.output,


if FURTHER_RUNS:

    rule second_responses_benches:
        input:
            rules.second_responses_benches_tables.output,
            rules.draw_second_responses_benches.output,


if FURTHER_RUNS:

    rule joint_targets:
        input:
            jobs=JOINT_RUNS,
            runs=rules.measure_responses.output.runs,
            dataset=rules.dataset.output.dataset,
        output:
            **{
                name: f"{RESULTS}/joint_targets/{name}.csv"
                for name in ("tests", "pairs", "sets", "coverage")
            },
            summary=f"{RESULTS}/joint_targets/joint.json",
        log:
            f"{RESULTS}/logs/joint_targets.log",
        benchmark:
            f"{RESULTS}/benchmarks/joint_targets.tsv"
        threads: 1
        resources:
            mem_mb=grow_with_attempts(1150),
            runtime=grow_with_attempts(60),
        params:
            config=CONFIG,
            folder=find_output_folder,
            jobs=list_job_folders,
            depends=select_study_sections(
                "parameters", "targets", "network", "second_responses", "joint_targets"
            ),
        message:
            "Few tests that narrow the parameters"
        shell:
            "python -m research.responses joint --config {params.config:q} --runs {input.runs:q} --dataset {input.dataset:q}"
            " --jobs {params.jobs:q} --out {params.folder:q} > {log:q} 2>&1"
