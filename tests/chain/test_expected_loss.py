"""The set of least expected loss, on responses whose means and errors are formulas."""

import numpy as np
import pytest
from scipy import stats
from shared import targets_of

from repose.chain import expected_loss
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS

SPACE = ParameterSpace.of({name: [0.0, 1.0] for name in PARAMETERS})
TARGETS = targets_of(height_mm=66.0)


class Sure:
    """Height 40 + 40 x0 with an error of 1 mm where x1 is 0.7, larger elsewhere."""

    inputs = ()

    def predict(self, X):
        return 40 + 40 * X[:, :1]

    def covariance(self, X):
        return (1 + 20 * (X[:, 1] - 0.7) ** 2)[:, None, None] ** 2


def test_it_is_on_target_where_the_surrogate_is_surest():
    found = expected_loss.least(Sure(), SPACE, TARGETS)
    assert found[PARAMETERS[0]] == pytest.approx(0.65, abs=1e-3)
    assert found[PARAMETERS[1]] == pytest.approx(0.7, abs=0.01)
    assert found["height_predicted_mm"] == pytest.approx(66.0, abs=0.02)
    assert found["predicted_se"]["height_mm"] == pytest.approx(1.0, abs=1e-3)
    assert found["expected_error_percent"] == pytest.approx(100 / 66, rel=1e-3)
    one = 2 * stats.norm.cdf(0.66) - 1
    assert found["within"]["1 %"] == pytest.approx(one, abs=1e-3)
    assert found["within"]["2 %"] == pytest.approx(2 * stats.norm.cdf(1.32) - 1, abs=1e-3)


def test_it_keeps_what_is_fixed_and_inside_the_ranges():
    space = ParameterSpace.of({name: [0.0, 0.5] for name in PARAMETERS} | {PARAMETERS[1]: {"fixed": 0.2}})
    found = expected_loss.least(Sure(), space, TARGETS)
    assert found[PARAMETERS[1]] == 0.2
    assert found[PARAMETERS[0]] == pytest.approx(0.5, abs=1e-3)


def test_of_sets_that_are_equally_good_it_is_the_one_nearest_to_the_prior():
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
