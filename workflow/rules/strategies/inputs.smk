# Inputs of the rules of the strategies with several batches.
BATCHED = [name for name in strategies.names() if name != "published"]
BATCH = f"{RESULTS}/{{strategy}}/batch_{{batch}}"


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


def answer_of_batches(strategy):
    """Number of the folder of the answer, and its proposal; the batches before it are requested on the way."""
    number = first_batch(strategy)
    while True:
        made = checkpoints.propose.get(strategy=strategy, batch=number)
        with open(made.output.proposal) as file:
            proposal = json.load(file)
        if proposal["answer"]:
            return number, proposal
        number += 1


def batches_poured(strategy):
    """Folders of the batches poured for a strategy, the check of the answer among them."""
    number, proposal = answer_of_batches(strategy)
    ends = number if proposal["simulated"] else number + 1
    return [folder_of_batch(strategy, k) for k in range(ends)]


def folders_until_answer(wildcards, input):
    """Folders of all batches of a strategy, and of its answer."""
    return list(
        dict.fromkeys(map(os.path.dirname, [*input.tables, input.proposals[-1]]))
    )


def check_jobs(strategy):
    """Measured jobs of the answer."""
    number, proposal = answer_of_batches(strategy)
    if not proposal["simulated"]:
        return jobs_of(strategy, number)
    jobs = jobs_of(strategy, number - 1)
    names = {f"{sample:03d}.json" for sample in proposal["simulated"]}
    return [path for path in jobs if os.path.basename(path) in names]


def proposals_of(strategy):
    """Input function: all proposals of a strategy."""
    return lambda wildcards: expand(
        rules.propose.output.proposal,
        strategy=strategy,
        batch=range(first_batch(strategy), answer_of_batches(strategy)[0] + 1),
    )


def tables_of(strategy):
    """Input function: the tables of all batches of a strategy."""
    return lambda wildcards: tables_in(batches_poured(strategy))


def files_of_batches(strategy):
    """Input function: every file of the batches by name, as in the method's chain: a lost file is made again."""

    def files(wildcards):
        paths = []
        for number in range(first_batch(strategy), len(batches_poured(strategy))):
            made = [*rules.batch_dataset.output, *rules.propose.output]
            paths += expand(made, strategy=strategy, batch=number)
            measured = jobs_of(strategy, number)
            poured = [path.removesuffix("json") for path in measured]
            paths += [
                *measured,
                *expand("{job}{kind}", job=poured, kind=("pours.json", "npz")),
            ]
        return paths

    return files
