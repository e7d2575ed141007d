"""Seeds of every pour of a study."""

import zlib

# Purposes of a pour's random numbers: a stream each, so that no check reuses the pours that it checks. Numbers that are
# missing here are of `research.streams`; a caller may give the number of a stream of its own.
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


# The first bench test: its seeds and its files carry no name of a bench test.
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
    """Draw the seeds, 0 to 2^32 - 1, of a parameter set's pours; the first k are the same for any larger count.

    `purpose` is one of PURPOSES, or the number of another stream. `number` is the sample's. Each bench test has its own
    streams, so that its noise is independent of the others'.
    """
    import numpy as np

    named = apparatus == UNNAMED or purpose == OF_THE_DRUM
    own = [] if named else [zlib.crc32(apparatus.encode())]
    stream = purpose if isinstance(purpose, int) else PURPOSES[purpose]
    return [
        int(seed)
        for seed in np.random.SeedSequence(
            [study_seed, stream, number, *own]
        ).generate_state(count)
    ]
