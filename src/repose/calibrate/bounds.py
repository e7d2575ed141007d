"""Find the parameters of an answer that are at a bound of their range, within their error.

The distance of a parameter from a bound is compared with the standard error of the fit,
moved along this parameter: the standard error of a predicted response at the answer,
divided by the slope of the response along the parameter. Of all responses the least
counts. A parameter of which this error is more than half its range hardly changes any
response, so its bound says nothing and is left out.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.base import Predictor

# Largest standard error of a parameter, in ranges, with which a bound means something.
LARGEST = 0.5
# The slope is that between two points so far to each side of the answer, in ranges.
REACH = 0.05


def near_bounds(
    surrogate: Predictor, answer: Mapping[str, Any], space: ParameterSpace
) -> list[dict[str, Any]]:
    """List the parameters that are at most one standard error from a bound.

    Parameters
    ----------
    surrogate : Predictor
        One that knows its errors.
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
        # A response that does not depend on the parameter says nothing about it.
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
    """Compute the steepness (k,) of each response along one parameter, without sign.

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
    """Write that a parameter is near a bound, a clause."""
    return (
        f"{near['parameter']} {near['value']:.4g} is within one standard error of the "
        f"fit ({near['standard_error']:.2g}) of its bound {near['bound']:g}"
    )
