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

# The default bench test. Its seeds do not depend on its name, and the names of its files
# do not contain it.
UNNAMED = "funnel"
# Only the rotating drum uses the stream of this purpose, so its seeds need no name of a
# bench test.
DRUM_PURPOSE = "drum"


def draw_run_seeds(
    study_seed: int,
    purpose: str | int,
    number: int,
    count: int,
    apparatus: str = UNNAMED,
) -> list[int]:
    """Draw the seeds of the runs of a sample.

    Each bench test has its own random stream, so the noise of the tests is independent.
    The seeds depend on nothing but the arguments. Any change to this function changes
    the seeds of all studies, and so all published results.

    Parameters
    ----------
    study_seed : int
        Seed of the study.
    purpose : str or int
        What the runs are for: a key of `PURPOSE_STREAMS`, or directly the number of
        another stream of random numbers.
    number : int
        Number of the sample, the parameter set in the design.
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
    # A bench test gets its own stream from a checksum of its name. `UNNAMED` and
    # `DRUM_PURPOSE` say why there are two exceptions.
    if apparatus != UNNAMED and purpose != DRUM_PURPOSE:
        entropy.append(zlib.crc32(apparatus.encode()))
    seeds = np.random.SeedSequence(entropy).generate_state(count)
    return [int(seed) for seed in seeds]
