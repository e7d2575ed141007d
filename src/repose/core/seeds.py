"""Seeds of every pour of a study."""

# What the random numbers of a pour are for: one stream each, so that no check reuses the pours it checks.
PURPOSES = {
    "design": 0,
    "validation": 1,
    "drum": 2,
    "shape_published": 3,
    "shape_sensitivity": 4,
    "shape_design": 5,
    "drum_design": 9,
    "refine": 8,
    "pool": 6,
    "fresh": 7,
}


def pour_seeds(study_seed, purpose, number, count):
    """Seeds of the `count` pours of one parameter set.

    study_seed: `design.seed`; purpose: one of PURPOSES; number: of the sample. The first k seeds
    are the same for any count of at least k.
    """
    import numpy as np

    state = np.random.SeedSequence([study_seed, PURPOSES[purpose], number]).generate_state(count)
    return [int(seed) for seed in state]
