"""The chance of meeting the targets, and the set of least expected loss."""

import numpy as np
import pytest
import shared
from scipy import stats
from shared import targets_of

from repose.chain import expected_loss
from repose.chain.chance import chance_of_meeting
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.targets import Targets


def runs_of(values, names):
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


def test_chances_of_one_bench_test_are_those_of_the_worse_and_of_two_multiply():
    targets = Targets.of(shared.TARGETS)
    a = np.array([31.2, 33.0, 32.1, 34.3])
    chance = chance_of_meeting({"funnel": runs_of(np.column_stack([a, 2 * a]), targets.names)}, targets)
    assert chance["all"] == pytest.approx(min(chance["aor_deg"], chance["height_mm"]), abs=0.06)
    assert chance["all"] <= min(chance["aor_deg"], chance["height_mm"])
    targets = targets_of(aor_deg=33.0, drum_slip_deg=44.0)
    rng = np.random.default_rng(0)
    runs = {"funnel": runs_of(33.5 + 2 * rng.normal(size=(8, 1)), ["aor_deg"])}
    runs |= {"drum": runs_of(47 + 3 * rng.normal(size=(8, 1)), ["drum_slip_deg"])}
    chance = chance_of_meeting(runs, targets)
    product = chance["aor_deg"] * chance["drum_slip_deg"]
    assert 0.2 < product < 0.9
    assert chance["all"] == pytest.approx(product, abs=0.005)


SPACE = ParameterSpace.of({name: [0.0, 1.0] for name in PARAMETERS})
TARGETS = targets_of(height_mm=66.0)


class Sure:
    """Height 40 + 40 x0 with an error of 1 mm where x1 is 0.7, larger elsewhere."""

    inputs = ()

    def predict(self, X):
        return 40 + 40 * X[:, :1]

    def covariance(self, X):
        return (1 + 20 * (X[:, 1] - 0.7) ** 2)[:, None, None] ** 2


def test_the_set_of_least_loss_is_surest_on_target_inside_the_ranges_and_near_the_prior():
    found = expected_loss.least(Sure(), SPACE, TARGETS)
    assert found[PARAMETERS[0]] == pytest.approx(0.65, abs=1e-3)
    assert found[PARAMETERS[1]] == pytest.approx(0.7, abs=0.01)
    assert found["height_predicted_mm"] == pytest.approx(66.0, abs=0.02)
    assert found["predicted_se"]["height_mm"] == pytest.approx(1.0, abs=1e-3)
    assert found["expected_error_percent"] == pytest.approx(100 / 66, rel=1e-3)
    one = 2 * stats.norm.cdf(0.66) - 1
    assert found["within"]["1 %"] == pytest.approx(one, abs=1e-3)
    assert found["within"]["2 %"] == pytest.approx(2 * stats.norm.cdf(1.32) - 1, abs=1e-3)
    space = ParameterSpace.of({name: [0.0, 0.5] for name in PARAMETERS} | {PARAMETERS[1]: {"fixed": 0.2}})
    found = expected_loss.least(Sure(), space, TARGETS)
    assert found[PARAMETERS[1]] == 0.2
    assert found[PARAMETERS[0]] == pytest.approx(0.5, abs=1e-3)
    prior = {"prior": {"mean": 0.2, "sd": 0.1}, "range": [0.0, 1.0]}
    space = ParameterSpace.of({name: [0.0, 1.0] for name in PARAMETERS} | {PARAMETERS[2]: prior})
    found = expected_loss.least(Sure(), space, TARGETS)
    assert found[PARAMETERS[2]] == pytest.approx(0.2, abs=0.01)
    assert found["height_predicted_mm"] == pytest.approx(66.0, abs=0.02)


def test_the_loss_is_the_mean_of_eq_11_of_draws():
    X = np.full((1, 6), 0.6)
    draws = np.random.default_rng(0).normal(64.0, 1.2, 400_000)
    loss = expected_loss.expected_loss(Sure(), X, TARGETS)[0]
    width = TARGETS[0].high - TARGETS[0].low
    assert loss == pytest.approx(np.mean(np.abs(draws - 66.0)) / width, rel=0.01)
