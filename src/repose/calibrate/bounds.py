"""Find the parameters of an answer that lie within one standard error of a bound.

Each response gives one estimate of the standard error of a parameter: the standard
error of the predicted response at the answer, divided by the slope of the response
along the parameter. The smallest estimate is used. If it exceeds a certain fraction of
the range, the parameter hardly changes any response, and its distance from a bound has
no meaning. Distances and errors are measured along the scale of the parameter.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.scales import LINEAR, LOG
from repose.calibrate.surrogates.base import Predictor
from repose.common.numbers import format_significant

# Largest standard error of a parameter, as a fraction of its range. With a larger
# error, its distance from a bound has no meaning.
MAX_RELATIVE_ERROR = 0.5
# A slope is computed from two points at this distance on each side of the answer, as a
# fraction of the range.
SLOPE_DISTANCE = 0.05


def find_near_bounds(
    surrogate: Predictor, answer: Mapping[str, Any], space: ParameterSpace
) -> list[dict[str, Any]]:
    """List the parameters that are at most one standard error from a bound.

    Parameters
    ----------
    surrogate : Predictor
        A surrogate with error estimates.
    answer : mapping
        The answer: the value of each parameter by name.
    space : ParameterSpace
        The parameters of the study.

    Returns
    -------
    list of dict
        ``parameter``, ``value``, ``bound`` and ``standard_error``, in the units of the
        parameter. On a logarithmic scale, the standard error s of the logarithm is
        estimated. Then ``standard_error`` is s times the value, and there is the
        additional key ``factor``, which is exp(s).
    """
    # The surrogate takes all parameters. The bounds and everything with the index k are
    # only for the free parameters.
    all_values = np.array([[float(answer[name]) for name in space.names]])
    response_errors = np.sqrt(np.diagonal(surrogate.covariance(all_values)[0]))
    lower_bounds, upper_bounds = space.coordinate_bounds
    near = []
    for k, name in enumerate(space.free):
        slopes = _compute_slopes(surrogate, all_values, space, name)
        # If no response depends on the parameter, its error is infinite.
        if not (slopes > 0).any():
            continue
        standard_error = _estimate_parameter_error(response_errors, slopes)

        # Compare the error with the distance from the nearer bound. On a logarithmic
        # scale, both belong to the logarithm.
        low = lower_bounds[k]
        high = upper_bounds[k]
        value = float(answer[name])
        coordinate = float(space.coordinates(name, np.array(value)))
        distance_from_low = coordinate - low
        distance_from_high = high - coordinate
        distance = min(distance_from_low, distance_from_high)
        bounds = space.low if distance_from_low <= distance_from_high else space.high
        is_determined = standard_error <= MAX_RELATIVE_ERROR * (high - low)
        if is_determined and distance <= standard_error:
            near.append(
                _describe_parameter(
                    name,
                    value=value,
                    bound=float(bounds[k]),
                    standard_error=standard_error,
                    scale=space.scale.get(name, LINEAR),
                )
            )
    return near


def _estimate_parameter_error(response_errors: np.ndarray, slopes: np.ndarray) -> float:
    """Estimate the standard error of a parameter from those of the responses.

    The error of a response divided by its slope is an error of the parameter. The
    result is the smallest of these errors. Responses of slope 0 are left out, because
    they do not depend on the parameter.

    Parameters
    ----------
    response_errors : ndarray (k,)
        Standard errors of the predicted responses.
    slopes : ndarray (k,)
        Result of `_compute_slopes`. At least one slope is above 0.
    """
    has_slope = slopes > 0
    return float(np.min(response_errors[has_slope] / slopes[has_slope]))


def _compute_slopes(
    surrogate: Predictor, point: np.ndarray, space: ParameterSpace, name: str
) -> np.ndarray:
    """Compute how steeply each response changes with a parameter around a point.

    Parameters
    ----------
    surrogate : Predictor
        The surrogate.
    point : ndarray (1, d)
        Values of all parameters, also of the fixed ones.
    space : ParameterSpace
        The parameters of the study.
    name : str
        The free parameter.

    Returns
    -------
    ndarray (k,)
        Absolute slopes. On a logarithmic scale, they are slopes along the logarithm of
        the parameter.
    """
    # The range of the parameter along its scale.
    lows, highs = space.coordinate_bounds
    free_index = space.free.index(name)
    low = lows[free_index]
    high = highs[free_index]
    width = high - low

    # Choose one coordinate below the answer and one above it, inside the range.
    column = space.names.index(name)
    coordinate = float(space.coordinates(name, np.array(point[0, column])))
    two_coordinates = np.clip(
        coordinate + SLOPE_DISTANCE * width * np.array([-1.0, 1.0]), low, high
    )

    # The surrogate takes values. On a linear scale, values and coordinates are equal.
    two_values = two_coordinates
    if name in space.scale:
        two_values = space.values_at(name, (two_coordinates - low) / width)
    change = _compute_change(surrogate, point, column=column, two_values=two_values)
    return change / (two_coordinates[1] - two_coordinates[0])


def _describe_parameter(
    name: str, *, value: float, bound: float, standard_error: float, scale: str
) -> dict[str, Any]:
    """Describe a parameter near a bound.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value, bound : float
        The parameter in the answer, and the bound.
    standard_error : float
        Standard error of the parameter, along its scale.
    scale : str
        Name of the scale. On a logarithmic one, the error is converted to units of the
        parameter.

    Returns
    -------
    dict
        An entry of the result of `find_near_bounds`.
    """
    entry: dict[str, Any] = {"parameter": name, "value": value, "bound": bound}
    if scale != LOG:
        return {**entry, "standard_error": standard_error}
    return {
        **entry,
        "standard_error": standard_error * value,
        "factor": math.exp(standard_error),
    }


def _compute_change(
    surrogate: Predictor, point: np.ndarray, column: int, two_values: np.ndarray
) -> np.ndarray:
    """Compute how much each response (k,) changes between two values of a parameter.

    Parameters
    ----------
    surrogate : Predictor
        The surrogate.
    point : numpy.ndarray, (1, p)
        The answer.
    column : int
        Column of the parameter.
    two_values : numpy.ndarray, (2,)
        Two values of the parameter, the smaller one first.
    """
    two_points = np.repeat(point, 2, axis=0)
    two_points[:, column] = two_values
    return np.abs(np.diff(surrogate.predict(two_points), axis=0)[0])


def describe_near_bound(near: Mapping[str, Any]) -> str:
    """Describe in a clause that a parameter is near a bound."""
    error = format_significant(near["standard_error"], 2)
    if "factor" in near:
        error = f"a factor of {format_significant(near['factor'], 2)}"
    return (
        f"{near['parameter']} {format_significant(near['value'])} is within one standard error of "
        f"the fit ({error}) of its bound {format_significant(near['bound'])}"
    )
