"""The probability that a pile meets its targets, by its own runs."""

import numpy as np
import pytest
from scipy import stats
from shared import TARGETS, targets_of

from repose.chain.chance import chance_of_meeting
from repose.core.targets import Targets


def runs_of(values, names):
    """Good runs with these responses, of the names' bench test."""
    return [dict(zip(names, row, strict=True)) | {"status": "ok"} for row in np.asarray(values, float).tolist()]


def test_the_mean_given_few_runs_has_a_t_distribution_with_one_degree_of_freedom_less():
    """Three runs: with 3 in place of 2 degrees of freedom the probability would be 0.04 higher."""
    values = [58.0, 60.0, 63.0]
    jammed = {"status": "jammed", "height_mm": None}
    runs = {"funnel": [*runs_of(np.array(values)[:, None], ["height_mm"]), jammed]}
    targets = targets_of(height_mm=60.0)  # met within 5 %
    mean = stats.t(2, loc=np.mean(values), scale=np.std(values, ddof=1) / np.sqrt(3))
    chances = chance_of_meeting(runs, targets)
    expected = mean.cdf(63.0) - mean.cdf(57.0)
    assert chances == {"height_mm": pytest.approx(expected, abs=5e-3), "all": chances["height_mm"]}
    near = mean.cdf(60.6) - mean.cdf(59.4)
    assert chance_of_meeting(runs, targets, 1.0)["all"] == pytest.approx(near, abs=5e-3)
    one = {"funnel": [runs["funnel"][0], jammed]}
    assert chance_of_meeting(one, targets) == {"height_mm": None, "all": None}


def test_chance_of_two_responses_that_move_as_one_is_that_of_the_worse():
    targets = Targets.of(TARGETS)
    a = np.array([31.2, 33.0, 32.1, 34.3])
    chance = chance_of_meeting({"funnel": runs_of(np.column_stack([a, 2 * a]), targets.names)}, targets)
    assert chance["all"] == pytest.approx(min(chance["aor_deg"], chance["height_mm"]), abs=0.06)
    assert chance["all"] <= min(chance["aor_deg"], chance["height_mm"])


def test_chances_of_two_bench_tests_multiply():
    targets = targets_of(aor_deg=33.0, drum_slip_deg=44.0)
    rng = np.random.default_rng(0)
    runs = {"funnel": runs_of(33.5 + 2 * rng.normal(size=(8, 1)), ["aor_deg"])}
    runs |= {"drum": runs_of(47 + 3 * rng.normal(size=(8, 1)), ["drum_slip_deg"])}
    chance = chance_of_meeting(runs, targets)
    product = chance["aor_deg"] * chance["drum_slip_deg"]
    assert 0.2 < product < 0.9
    assert chance["all"] == pytest.approx(product, abs=0.005)
