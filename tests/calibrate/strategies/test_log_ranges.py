"""Intervals of a parameter over four decades hold hidden truths."""

import decades
import numpy as np
import pytest

TRUTHS = 20
# An interval holds its truth with probability 0.95. So 17 or more of 20 do with
# probability 0.98.
LEAST = 17
ENTRY = {"range": list(decades.DECADES), "scale": "log"}


def answered(seed):
    """A truth drawn from the prior, and the answer of 24 samples with two runs each."""
    random = np.random.default_rng(seed)
    truth = decades.hidden_truth(random)
    study = decades.study_of(
        truth,
        ENTRY,
        random,
        seed=seed,
        sequential={"start_samples": 24, "most_runs": 48},
        posterior={"walkers": 32, "steps": 200},
    )
    return truth, study.calibrate(decades.simulator(random))


@pytest.mark.slow
def test_intervals_over_four_decades_hold_17_of_20_hidden_truths():
    held = {"gamma": 0, "mu": 0}
    for seed in range(TRUTHS):
        truth, answer = answered(seed)
        for name, is_inside in decades.is_inside(answer, truth).items():
            held[name] += is_inside
    assert min(held.values()) >= LEAST, held
