"""Find the parameters of an answer that are at a bound of their range, within their error.

A parameter is at a bound if it is at most one standard error away from it. The standard
error of a parameter follows from each response: it is the standard error of the predicted
response at the answer, divided by the slope of the response along the parameter. The
smallest of these errors counts. If it exceeds half the range, the parameter hardly
changes any response, and its distance from a bound has no meaning.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.base import Predictor

# Largest standard error of a parameter, as a share of its range, for which its distance
# from a bound is meaningful.
LARGEST = 0.5
# A slope is computed from two points at this distance on each side of the answer, as a
# share of the range.
REACH = 0.05


def near_bounds(
    surrogate: Predictor, answer: Mapping[str, Any], space: ParameterSpace
) -> list[dict[str, Any]]:
    """List the parameters that are at most one standard error from a bound.

    Parameters
    ----------
    surrogate : Predictor
        A surrogate with error estimates.
    answer : mapping
        A parameter set by name.
    space : ParameterSpace

    Returns
    -------
    list of dict
        ``parameter``, ``value``, ``bound``, and its ``standard_error``, in the units of
        the parameter.
    """
    point = np.array([[float(answer[name]) for name in space.names]])
    response_errors = np.sqrt(np.diagonal(surrogate.covariance(point)[0]))
    near = []
    for name, low, high in zip(space.free, space.low, space.high, strict=True):
        value = float(answer[name])
        width = high - low
        ends = np.clip(value + REACH * width * np.array([-1.0, 1.0]), low, high)
        slopes = _slopes(surrogate, point, space.names.index(name), ends)
        # Skip responses that do not depend on the parameter.
        has_slope = slopes > 0
        if not has_slope.any():
            continue
        errors = response_errors[has_slope] / slopes[has_slope]
        standard_error = float(np.min(errors))

        bound = float(low if value - low <= high - value else high)
        is_determined = standard_error <= LARGEST * width
        if is_determined and abs(value - bound) <= standard_error:
            near.append(
                {
                    "parameter": name,
                    "value": value,
                    "bound": bound,
                    "standard_error": standard_error,
                }
            )
    return near


def _slopes(
    surrogate: Predictor, point: np.ndarray, column: int, ends: np.ndarray
) -> np.ndarray:
    """Compute the absolute slopes (k,) of all responses along one parameter.

    Parameters
    ----------
    surrogate : Predictor
    point : numpy.ndarray, (1, p)
        The answer.
    column : int
        Of the parameter.
    ends : numpy.ndarray, (2,)
        Two values of the parameter, the smaller one first.
    """
    two_points = np.repeat(point, 2, axis=0)
    two_points[:, column] = ends
    difference = np.diff(surrogate.predict(two_points), axis=0)[0]
    return np.abs(difference) / (ends[1] - ends[0])


def in_words(near: Mapping[str, Any]) -> str:
    """Describe in a clause that a parameter is near a bound."""
    return (
        f"{near['parameter']} {near['value']:.4g} is within one standard error of the "
        f"fit ({near['standard_error']:.2g}) of its bound {near['bound']:g}"
    )
