"""Correlation of angle and Height from pile to pile."""

import numpy as np
import pandas as pd
import pytest

from repose.measure.angles import DEFINITIONS
from research.measurement.pour_correlation import correlations


def test_the_scatter_within_samples_counts_and_not_their_means():
    """All views see a shared noise of correlation 0.8, one view that and as much again of its own: 0.8 / sqrt 2."""
    random = np.random.default_rng(1)
    shared = random.multivariate_normal([0, 0], [[1, 0.8], [0.8, 1]], 4000)
    # the opposite sign lets the means go against each other
    means = np.repeat(random.normal(0, 20, 1000), 4)
    table = pd.DataFrame(
        {"sample": np.repeat(np.arange(1000), 4), "Height": shared[:, 1] - means}
    )
    table["Height (view)"] = table["Height"]
    for name in DEFINITIONS:
        table[name] = shared[:, 0] + means
        table[f"{name} (view)"] = table[name] + random.normal(size=4000)
    found = correlations(table, DEFINITIONS).set_index(["views", "measured"])
    assert found.loc["all views", "correlation"].to_numpy() == pytest.approx(
        0.8, abs=0.02
    )
    assert found.loc["one view", "correlation"].to_numpy() == pytest.approx(
        0.8 / np.sqrt(2), abs=0.03
    )
    assert (found["low"] < found["correlation"]).all()
    assert (found["degrees_of_freedom"] == 3000).all()
