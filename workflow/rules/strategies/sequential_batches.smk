# Batches of the strategy sequential: inputs of its rules.
SEQUENTIAL = f"{RESULTS}/sequential"


def last_advice():
    """Number of the batch whose advice ends the strategy; the batches before it are requested on the way."""
    batch = 0
    while True:
        advice = checkpoints.sequential_batch.get(batch=f"batch_{batch}").output.advice
        with open(advice) as file:
            if json.load(file)["stop"]:
                return batch
        batch += 1


def sequential_samples(batch):
    """Samples of a batch: the start, the proposal of the batch before, or the answer for the check."""
    if batch == "batch_0":
        return f"{SEQUENTIAL}/batch_0/samples.csv"
    before = (
        last_advice() if batch == "check" else int(batch.removeprefix("batch_")) - 1
    )
    return checkpoints.sequential_batch.get(batch=f"batch_{before}").output.following


def sequential_numbers(batch):
    """Samples of a batch or of the check."""
    if batch == "batch_0":
        return range(1, config["sequential"]["start_samples"] + 1)
    return pandas.read_csv(sequential_samples(batch))["sample"]


def sequential_seeds(wildcards):
    """Seeds of a sample of a batch or of the check."""
    return config["sequential"]["checks" if wildcards.batch == "check" else "seeds"]


def batches_until(wildcards):
    """Folders of the batches up to one."""
    return [
        f"{SEQUENTIAL}/batch_{k}"
        for k in range(int(wildcards.batch.removeprefix("batch_")) + 1)
    ]


def sequential_advices(wildcards):
    """Advice after each batch."""
    return [f"{SEQUENTIAL}/batch_{k}/advice.json" for k in range(last_advice() + 1)]
