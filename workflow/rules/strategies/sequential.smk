# Few pours, each where it informs most: `strategy: sequential`, or `snakemake --cores 2 sequential`. The pours of a batch run
# in parallel. Their analysis is a checkpoint: it decides whether another batch follows, and where.
rule sequential_start:
    output:
        samples=f"{SEQUENTIAL}/batch_0/samples.csv",
    log:
        f"{RESULTS}/logs/sequential/start.log",
    resources:
        **needs(400),
    params:
        **of_stage("sequential_start"),
    message:
        "Parameter sets of the start"
    shell:
        "python -m repose stage sequential_start --config {params.config:q} --out {params.folder:q} > {log:q} 2>&1"


checkpoint sequential_batch:
    input:
        lambda wildcards: expand(
            "{folder}/{table}.csv",
            folder=batches_until(wildcards),
            table=("dataset", "runs"),
        ),
    output:
        advice=f"{SEQUENTIAL}/{{batch}}/advice.json",
        following=f"{SEQUENTIAL}/{{batch}}/next.csv",
    log:
        f"{RESULTS}/logs/sequential/{{batch}}_advice.log",
    wildcard_constraints:
        batch=r"batch_\d{1,4}",
    resources:
        **needs(350, minutes=60),
    params:
        **of_stage("sequential_batch"),
        batches=batches_until,
    message:
        "Advice after the pours up to {wildcards.batch}, and where to pour next"
    shell:
        "python -m repose stage sequential_batch {params.batches:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


rule sequential_check:
    input:
        advices=sequential_advices,
        dataset=f"{SEQUENTIAL}/check/dataset.csv",
        runs=f"{SEQUENTIAL}/check/runs.csv",
    output:
        check=f"{SEQUENTIAL}/check.csv",
        batches=f"{SEQUENTIAL}/batches.csv",
        dataset=f"{SEQUENTIAL}/dataset.csv",
        runs=f"{SEQUENTIAL}/runs.csv",
        solutions=f"{SEQUENTIAL}/solutions.csv",
        table4=f"{SEQUENTIAL}/table4.csv",
        representative=f"{SEQUENTIAL}/representative.csv",
        summary=f"{SEQUENTIAL}/summary.json",
    log:
        f"{RESULTS}/logs/sequential/check.log",
    resources:
        **needs(350),
    params:
        **of_stage("sequential_check"),
        batches=lambda wildcards, input: list(map(os.path.dirname, input.advices)),
    message:
        "The answer, simulated again, compared with its prediction and the targets"
    shell:
        "python -m repose stage sequential_check {params.batches:q} --config {params.config:q} --dataset {input.dataset:q}"
        " --runs {input.runs:q} --out {params.folder:q} > {log:q} 2>&1"


ANSWERS["sequential"] = Answer(
    "sequential_check",
    rules.sequential_check.output.solutions,
    rules.sequential_check.output.summary,
    rules.sequential_check.output.table4,
    rules.sequential_check.output.representative,
    rules.sequential_check.output.dataset,
)
figure(
    "sequential",
    "Probability and prediction by pours",
    "targets",
    "sequential.tolerance_percent",
    "sequential.probability",
    folder="sequential",
    category="Sequential",
    batches=rules.sequential_check.output.batches,
    check=rules.sequential_check.output.check,
)


rule sequential:
    input:
        rules.sequential_check.output,
        all_files("sequential"),
