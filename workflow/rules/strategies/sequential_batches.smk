# Batches of the strategy sequential: what each of its rules takes.
SEQUENTIAL = f"{RESULTS}/sequential"


def last_advice():
    """What the pours so far say, where they tell that they suffice; batches on the way there are asked for."""
    batch = 0
    while True:
        advice = checkpoints.sequential_batch.get(batch=batch).output.advice
        with open(advice) as file:
            if json.load(file)["stop"]:
                return batch
        batch += 1


def sequential_samples(wildcards):
    """Table of what is poured: the start, or what the batch before has asked for."""
    return samples_of_batch(wildcards.poured)


def samples_of_batch(poured):
    """Table of what a batch pours, or the check."""
    if poured == "batch_0":
        return rules.sequential_start.output.samples
    if poured == "check":
        batch = last_advice()
    else:
        batch = int(poured.removeprefix("batch_")) - 1
    return checkpoints.sequential_batch.get(batch=batch).output.following


def sequential_jobs(wildcards):
    """Measured jobs of a batch or of the check."""
    return jobs_of_batch(wildcards.poured)


def jobs_of_batch(poured):
    """The same by the name of what is poured."""
    if poured == "batch_0":
        samples = range(1, config["sequential"]["start_samples"] + 1)
    else:
        samples = pandas.read_csv(samples_of_batch(poured))["sample"]
    return [
        f"{SEQUENTIAL}/{poured}/{runs}/{sample:03d}.json"
        for runs in folders_of_targets()
        for sample in samples
    ]


def batches_until(wildcards):
    """Folders of the batches up to one."""
    return [f"{SEQUENTIAL}/batch_{k}" for k in range(int(wildcards.batch) + 1)]


def sequential_advices(wildcards):
    """What each batch said."""
    return [f"{SEQUENTIAL}/batch_{k}/advice.json" for k in range(last_advice() + 1)]
