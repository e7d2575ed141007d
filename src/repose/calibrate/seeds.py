"""Seeds of all runs of a study."""

import zlib

# Number of the stream of random numbers for each purpose. Different streams ensure that
# a check never repeats the runs that it checks. The numbers missing here belong to
# `research.streams`, which passes them directly.
PURPOSE_STREAMS = {
    "design": 0,
    "validation": 1,
    "drum": 2,
    "refined": 8,
    "response_surface": 12,
    "sequential": 13,
    "next": 15,
    "batches": 16,  # batches of a strategy without its own stream
}

# The first bench test of the project. It has no name in its seeds and its files, which
# are older than the other bench tests.
UNNAMED = "funnel"
# Only the drum uses this stream, so its seeds need no name of a bench test.
DRUM_PURPOSE = "drum"


def draw_run_seeds(
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
        Seed of the study.
    purpose : str or int
        One of `PURPOSE_STREAMS`, or the number of another stream.
    number : int
        Number of the sample.
    count : int
        Number of seeds. A larger number only adds seeds at the end.
    apparatus : str, optional
        Name of the bench test.

    Returns
    -------
    list of int
        Seeds from 0 to 2^32 - 1.
    """
    import numpy as np

    stream = purpose if isinstance(purpose, int) else PURPOSE_STREAMS[purpose]
    entropy = [study_seed, stream, number]
    # A named bench test gets its own stream from a checksum of its name.
    if apparatus != UNNAMED and purpose != DRUM_PURPOSE:
        entropy.append(zlib.crc32(apparatus.encode()))
    seeds = np.random.SeedSequence(entropy).generate_state(count)
    return [int(seed) for seed in seeds]
