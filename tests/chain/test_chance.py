"""The probability that a pile meets its targets, by its own runs."""

import numpy as np
import pytest
from scipy import stats
from shared import targets_of

from repose.chain.chance import chance_of_meeting


def test_the_mean_given_few_runs_has_a_t_distribution_with_one_degree_of_freedom_less():
    """Three runs: with 3 in place of 2 degrees of freedom the probability would be 0.04 higher."""
    values = [58.0, 60.0, 63.0]
    runs = {"funnel": [{"status": "ok", "height_mm": value} for value in values]}
    runs["funnel"].append({"status": "jammed", "height_mm": None})
    targets = targets_of(height_mm=60.0)  # met within 5 %
    mean = stats.t(2, loc=np.mean(values), scale=np.std(values, ddof=1) / np.sqrt(3))
    chances = chance_of_meeting(runs, targets)
    expected = mean.cdf(63.0) - mean.cdf(57.0)
    assert chances == {"height_mm": pytest.approx(expected, abs=5e-3), "all": chances["height_mm"]}
    assert chance_of_meeting({"funnel": runs["funnel"][:1]}, targets)["all"] is None
