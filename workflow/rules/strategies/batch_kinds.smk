# All that differs between the strategies for the rules that pour, measure and collect a batch.
import collections

Batches = collections.namedtuple("Batches", "purpose samples numbers seeds")

# Purpose of the seeds of pours; then functions: table of samples and numbers of the samples by the name of a batch, seeds
# of a sample by its wildcards.
BATCHES = {
    "response_surface": Batches(
        "response_surface",
        lambda step: f"{RESPONSE_SURFACE}/{step}/samples.csv",
        response_surface_numbers,
        lambda wildcards: config["response_surface"]["seeds"],
    ),
    "sequential": Batches(
        "sequential", sequential_samples, sequential_numbers, sequential_seeds
    ),
    "refined": Batches(
        "refine",
        lambda batch: f"{REFINED}/{batch}/proposal.csv",
        round_numbers,
        round_seeds,
    ),
}


def samples_of_batch(wildcards):
    """Table of the samples of a batch."""
    return BATCHES[wildcards.strategy].samples(wildcards.batch)


def jobs_of_batch(wildcards):
    """Measured jobs of a batch."""
    return jobs_of(wildcards.strategy, wildcards.batch)


def jobs_of(strategy, batch):
    """Measured jobs of a batch of a strategy, by their names."""
    return [
        f"{RESULTS}/{strategy}/{batch}/{runs}/{sample:03d}.json"
        for runs in folders_of_targets()
        for sample in BATCHES[strategy].numbers(batch)
    ]
