"""Seeds of all runs of a study."""

import zlib

# Streams of random numbers by purpose, so that no check uses the runs that it checks.
# The missing numbers are of `research.streams`; a caller may give a number of its own.
PURPOSES = {
    "design": 0,
    "validation": 1,
    "drum": 2,
    "refined": 8,
    "response_surface": 12,
    "sequential": 13,
    "next": 15,
    "batches": 16,  # of a strategy without a stream of its own
}

# The first bench test: its seeds and its files have no name of a bench test.
UNNAMED = "funnel"
# The stream of the drum alone: its name implies the bench test.
OF_THE_DRUM = "drum"


def pour_seeds(
    study_seed: int,
    purpose: str | int,
    number: int,
    count: int,
    apparatus: str = UNNAMED,
) -> list[int]:
    """Draw the seeds of the runs of a parameter set.

    Each bench test has its own random stream, so the noise of the tests is independent.

    Parameters
    ----------
    study_seed : int
    purpose : str or int
        One of `PURPOSES`, or the number of another stream.
    number : int
        Of the sample.
    count : int
        Number of seeds. A larger number only adds seeds at the end.
    apparatus : str, optional
        Name of the bench test.

    Returns
    -------
    list of int
        From 0 to 2^32 - 1.
    """
    import numpy as np

    stream = purpose if isinstance(purpose, int) else PURPOSES[purpose]
    entropy = [study_seed, stream, number]
    # A named bench test gets its own stream from a checksum of its name.
    if apparatus != UNNAMED and purpose != OF_THE_DRUM:
        entropy.append(zlib.crc32(apparatus.encode()))
    seeds = np.random.SeedSequence(entropy).generate_state(count)
    return [int(seed) for seed in seeds]
