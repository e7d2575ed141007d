"""Parameters near a bound, on a plane with known slopes and errors."""

import numpy as np
import pytest

from repose.calibrate.bounds import describe_near_bound, find_near_bounds
from repose.calibrate.parameter_space import ParameterSpace

SPACE = ParameterSpace(
    ("a", "b", "c"),
    np.array([0.0, 10.0, 0.0]),
    np.array([1.0, 20.0, 1.0]),
    fixed={"d": 3.0},
    names=("a", "d", "b", "c"),
)
SLOPES = np.array([[4.0, 100.0, 0.5, 0.01], [1.0, 100.0, 0.1, 0.0]])
ERRORS = np.array([0.4, 0.3])


class Plane:
    """Responses SLOPES x with errors that are the same everywhere."""

    name = "plane"

    def predict(self, X, return_std=False, noise=True):
        return np.asarray(X) @ SLOPES.T

    def covariance(self, X):
        return np.tile(np.diag(ERRORS**2), (len(X), 1, 1))


def found(a=0.5, b=15.0, c=0.5):
    near = find_near_bounds(Plane(), {"a": a, "b": b, "c": c, "d": 3.0}, SPACE)
    return {entry["parameter"]: entry for entry in near}


def test_the_error_of_a_parameter_is_the_least_error_over_slope_of_all_responses():
    # a: 0.4 / 4 = 0.1 by the first response, 0.3 by the second; b: 0.8 by the first
    near = found(a=0.05, b=19.5)
    assert near["a"]["standard_error"] == pytest.approx(0.1)
    assert near["a"]["bound"] == 0.0
    assert near["b"]["standard_error"] == pytest.approx(0.8)
    assert near["b"]["bound"] == 20.0


@pytest.mark.parametrize(
    ("a", "is_near"),
    [(0.0, True), (0.099, True), (0.101, False), (0.899, False), (0.901, True)],
)
def test_a_parameter_is_near_a_bound_within_one_standard_error(a, is_near):
    assert ("a" in found(a=a)) is is_near


def test_a_parameter_without_effect_is_never_near_a_bound():
    # c: 0.4 / 0.01 is forty ranges
    assert "c" not in found(c=0.0)


def test_a_fixed_parameter_has_no_bound():
    assert "d" not in found()


def test_the_words_name_parameter_value_error_and_bound():
    text = describe_near_bound(found(a=0.05)["a"])
    assert text == "a 0.05 is within one standard error of the fit (0.1) of its bound 0"
