# Inputs of the rules of the strategies with several batches.
BATCHED = [name for name in strategies.names() if name != "published"]
BATCH = f"{RESULTS}/{{strategy}}/batch_{{batch}}"
# Number of the first batch that is poured here; the article's design is poured by the chain.
FIRST_BATCH = {
    name: int(strategies.strategy(name).begins_with_design) for name in BATCHED
}


def folders_of_batches(strategy, end):
    """Folders of the batches before a number."""
    own = [
        BATCH.format(strategy=strategy, batch=k)
        for k in range(FIRST_BATCH[strategy], end)
    ]
    return [RESULTS] * min(FIRST_BATCH[strategy], end) + own


def tables_in(folders):
    """Tables of batches."""
    return expand("{folder}/{table}.csv", folder=folders, table=("dataset", "runs"))


def samples_of_batch(strategy, number):
    """Numbers of seeds by sample of a batch, once it is proposed."""
    import pandas  # slow to import

    made = checkpoints.propose.get(strategy=strategy, batch=number).output.samples
    return pandas.read_csv(made).set_index("sample")["seeds"].to_dict()


def jobs_of(strategy, number):
    """Measured jobs of a batch."""
    return expand(
        rules.measure_batch_runs.output.result,
        strategy=strategy,
        batch=number,
        runs=FOLDERS,
        job=[f"{sample:03d}" for sample in samples_of_batch(strategy, number)],
    )


def answer_of_batches(strategy):
    """Numbers of the folder of the answer, and of the first without runs; samples of the answer that have runs already.

    The batches before are requested on the way.
    """
    number = FIRST_BATCH[strategy]
    while True:
        made = checkpoints.propose.get(strategy=strategy, batch=number)
        with open(made.output.proposal) as file:
            proposal = json.load(file)
        if proposal["answer"]:
            simulated = proposal["simulated"]
            return number, number if simulated else number + 1, simulated
        number += 1


def check_jobs(strategy):
    """Measured jobs of the answer."""
    number, end, simulated = answer_of_batches(strategy)
    jobs = jobs_of(strategy, end - 1)
    names = {f"{sample:03d}.json" for sample in simulated}
    return [path for path in jobs if not names or os.path.basename(path) in names]


def files_of_batches(strategy):
    """Every file of the batches by name, as in the method's chain: a lost file is made again."""
    paths = []
    for number in range(FIRST_BATCH[strategy], answer_of_batches(strategy)[1]):
        made = [*rules.batch_dataset.output, *rules.propose.output]
        paths += expand(made, strategy=strategy, batch=number)
        for path in jobs_of(strategy, number):
            job = path.removesuffix("json")
            paths += [f"{job}{end}" for end in ENDS_OF_JOB]
    return paths
