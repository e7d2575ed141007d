# One loop for every strategy with several batches. `propose` reads the tables of all batches so far, and writes the samples of the
# next one or those of the answer; as it decides whether another batch follows, it is a checkpoint. A batch is poured, measured
# and put into a table. The last folder holds the answer, which is poured again unless its last batch did so.
BATCHED = [name for name in strategies.names() if name != "published"]
BATCH = f"{RESULTS}/{{strategy}}/batch_{{batch}}"


wildcard_constraints:
    strategy="|".join(BATCHED),
    batch=r"\d{1,4}",


def first_batch(strategy):
    """Number of the first batch that is poured here; the article's design is poured by the chain."""
    return int(strategies.strategy(strategy).begins_with_design)


def folder_of_batch(strategy, number):
    """Folder of a batch."""
    own = BATCH.format(strategy=strategy, batch=number)
    return RESULTS if number < first_batch(strategy) else own


def folders_before(wildcards):
    """Folders of all batches before one."""
    return [folder_of_batch(wildcards.strategy, k) for k in range(int(wildcards.batch))]


def tables_in(folders):
    """Tables of batches."""
    return expand("{folder}/{table}.csv", folder=folders, table=("dataset", "runs"))


checkpoint propose:
    input:
        lambda wildcards: tables_in(folders_before(wildcards)),
    output:
        samples=f"{BATCH}/samples.csv",
        proposal=f"{BATCH}/proposal.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_proposed.log",
    resources:
        **needs(400, minutes=90),
    params:
        config=CONFIG,
        folder=folder,
        batches=folders_before,
        depends=lambda wildcards: stands_on.settings_of(
            config, "propose", name=wildcards.strategy
        ),
    message:
        "What {wildcards.strategy} simulates after its first batches: batch {wildcards.batch}, or the answer"
    shell:
        "python -m repose stage propose {wildcards.strategy:q} {params.batches:q} --config {params.config:q}"
        " --out {params.folder:q} > {log:q} 2>&1"


def samples_of_batch(strategy, number):
    """Numbers of seeds by sample of a batch, once it is proposed."""
    made = checkpoints.propose.get(strategy=strategy, batch=number).output.samples
    return pandas.read_csv(made).set_index("sample")["seeds"].to_dict()


def jobs_of(strategy, number):
    """Measured jobs of a batch."""
    return expand(
        rules.measure_batch_runs.output.result,
        strategy=strategy,
        batch=number,
        runs=folders_of_targets(),
        job=[f"{sample:03d}" for sample in samples_of_batch(strategy, number)],
    )


use rule pour as batch_pour with:
    input:
        **READY,
        samples=rules.propose.output.samples,
    output:
        pours=f"{BATCH}/{{runs}}/{{job}}.pours.json",
        berries=f"{BATCH}/{{runs}}/{{job}}.npz",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}.log",
    wildcard_constraints:
        job=r"\d{3,5}",
    params:
        purpose=lambda wildcards: (
            wildcards.strategy if wildcards.strategy in PURPOSES else "batches"
        ),
        sample=lambda wildcards: int(wildcards.job),
        seeds=lambda wildcards: samples_of_batch(wildcards.strategy, wildcards.batch)[
            int(wildcards.job)
        ],
    message:
        "Pouring sample {wildcards.job} of {wildcards.strategy}, batch {wildcards.batch}"


use rule measure_runs as measure_batch_runs with:
    input:
        **GRAIN,
        pours=rules.batch_pour.output.pours,
        berries=rules.batch_pour.output.berries,
    output:
        result=f"{BATCH}/{{runs}}/{{job}}.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_{{runs}}_{{job}}_measured.log",
    wildcard_constraints:
        job=r"\d{3,5}",
    message:
        "Measuring the runs of sample {wildcards.job} of {wildcards.strategy}, batch {wildcards.batch}"


use rule dataset as batch_dataset with:
    input:
        samples=rules.propose.output.samples,
        jobs=lambda wildcards: jobs_of(wildcards.strategy, wildcards.batch),
    output:
        dataset=f"{BATCH}/dataset.csv",
        runs=f"{BATCH}/runs.csv",
        summary=f"{BATCH}/dataset_summary.json",
    log:
        f"{RESULTS}/logs/{{strategy}}/batch_{{batch}}_dataset.log",
    message:
        "Table of {wildcards.strategy}, batch {wildcards.batch}"
