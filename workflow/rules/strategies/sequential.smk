# Few pours, each where it says most: `strategy: sequential`, or `snakemake --cores 2 sequential`. The pours of a batch run
# in parallel. What they say is a checkpoint: it knows whether another batch follows, and where.
rule sequential_start:
    output:
        samples=f"{SEQUENTIAL}/batch_0/samples.csv",
    log:
        f"{RESULTS}/logs/sequential/start.log",
    benchmark:
        f"{RESULTS}/benchmarks/sequential/start.tsv"
    threads: 1
    resources:
        mem_mb=growing(400),
        runtime=growing(10),
    params:
        config=CONFIG,
        folder=folder,
        depends=sections("parameters", "design.seed", "sequential.start_samples"),
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
    benchmark:
        f"{RESULTS}/benchmarks/sequential/{{batch}}_advice.tsv"
    wildcard_constraints:
        batch=r"batch_\d{1,4}",
    threads: 1
    resources:
        mem_mb=growing(350),
        runtime=growing(60),
    params:
        config=CONFIG,
        folder=folder,
        batches=batches_until,
        depends=sections(
            "targets",
            "parameters",
            "design.seed",
            *(
                f"sequential.{key}"
                for key in (
                    "seeds",
                    "batch",
                    "tolerance_percent",
                    "probability",
                    "most_pours",
                )
            ),
        ),
    message:
        "What the pours up to {wildcards.batch} say, and where to pour next"
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
    benchmark:
        f"{RESULTS}/benchmarks/sequential/check.tsv"
    threads: 1
    resources:
        mem_mb=growing(350),
        runtime=growing(10),
    params:
        config=CONFIG,
        folder=folder,
        batches=lambda wildcards, input: list(map(os.path.dirname, input.advices)),
        depends=sections(
            "targets",
            "parameters",
            "design.seed",
            "sequential.start_samples",
            "sequential.seeds",
            "sequential.tolerance_percent",
            "miga.solutions",
            "miga.distance",
        ),
    message:
        "The answer, simulated again, beside its prediction and the targets"
    shell:
        "python -m repose stage sequential_check {params.batches:q} --config {params.config:q} --dataset {input.dataset:q}"
        " --runs {input.runs:q} --out {params.folder:q} > {log:q} 2>&1"


rule draw_sequential:
    input:
        batches=rules.sequential_check.output.batches,
        check=rules.sequential_check.output.check,
    output:
        report(
            f"{SEQUENTIAL}/sequential.png",
            caption="../../report/sequential.rst",
            category="Sequential",
            labels={"figure": "Probability and prediction by pours"},
        ),
    log:
        f"{RESULTS}/logs/figures/sequential.log",
    benchmark:
        f"{RESULTS}/benchmarks/figures/sequential.tsv"
    threads: 1
    resources:
        mem_mb=growing(400),
        runtime=growing(10),
    params:
        config=CONFIG,
        depends=sections(
            "small_run",
            "targets",
            "sequential.tolerance_percent",
            "sequential.probability",
        ),
    message:
        "Drawing how the answer became certain"
    shell:
        "python -m repose figure sequential --config {params.config:q} --out {output:q}"
        " --input batches={input.batches:q} --input check={input.check:q} > {log:q} 2>&1"


rule sequential:
    input:
        rules.sequential_check.output,
        rules.draw_sequential.output,
