"""Store the surrogate as data from which the page predicts responses without Python.

A network, or each network of an ensemble, is stored completely, with a square root of
the covariance of its weights. From these data `network.js` makes the same predictions
as `repose.calibrate.surrogates.network_ensemble`. Any other surrogate is stored as
curves and planes, along which one or two parameters vary over their ranges while the
others stay at the answer.
"""

import base64
import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any, TypeGuard

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.network_ensemble import MEMBER_ARRAYS, NetworkEnsemble
from repose.calibrate.surrogates.scaled_inputs import ScaledInputs

CURVE_POINTS = 41
MAX_PLANE_POINTS = 21  # along each side, at most
MIN_PLANE_POINTS = 5
MAX_PLANE_NUMBERS = 100_000  # of all planes together, 0.5 MB in the page
# Scaling of the inputs and outputs, which all networks of an ensemble share.
SCALING_KEYS = ("input_min", "input_max", "output_min", "output_max", "scaled_range")


def pack_array(array: np.ndarray, dtype: str) -> str:
    """Write an array as Base64 for a typed array of JavaScript.

    Parameters
    ----------
    array : ndarray
        The numbers.
    dtype : str
        A little-endian type of NumPy, such as ``<f4``.

    Returns
    -------
    str
        The bytes of the array in Base64.
    """
    return base64.b64encode(np.ascontiguousarray(array, dtype=dtype).tobytes()).decode()


def has_network(surrogate: Predictor) -> TypeGuard[BayesianBP | NetworkEnsemble]:
    """Return whether the page stores the surrogate itself instead of curves."""
    return isinstance(surrogate, BayesianBP | NetworkEnsemble)


def unwrap_scales(surrogate: Predictor) -> Predictor:
    """Return the surrogate inside a `ScaledInputs`; return any other one unchanged.

    The inner surrogate expects coordinates along the scales of the parameters.
    """
    return surrogate.model if isinstance(surrogate, ScaledInputs) else surrogate


def describe_surrogate(
    surrogate: Predictor, parameters: ParameterSpace, answer: np.ndarray
) -> dict[str, Any]:
    """Describe a surrogate as plain values for the page.

    Parameters
    ----------
    surrogate : Predictor
        The surrogate.
    parameters : ParameterSpace
        The parameters of the study.
    answer : ndarray
        The reported parameter set (d,), through which curves and planes run.

    Returns
    -------
    dict
        The values by name. `kind` is ``network`` or ``curves``. A network expects
        coordinates along the scales of the parameters, which the page computes.
    """
    inner_surrogate = unwrap_scales(surrogate)
    if has_network(inner_surrogate):
        return _describe_networks(inner_surrogate)
    return _predict_curves_and_planes(surrogate, parameters, answer)


def _describe_networks(surrogate: BayesianBP | NetworkEnsemble) -> dict[str, Any]:
    """Collect the weights of a network, or of each network of an ensemble.

    `network.js` reads the values by these keys. The page computes the standard errors
    of predictions from a matrix R whose product R @ R.T is the covariance of the
    weights.

    Parameters
    ----------
    surrogate : BayesianBP or NetworkEnsemble
        The network, or the ensemble.

    Returns
    -------
    dict
        `kind` is ``network``. `members` contains the weights of each network, with the
        matrix R as `root`, packed by `pack_array`. The other keys describe the scaling
        of inputs and outputs, which all networks share.
    """
    if isinstance(surrogate, NetworkEnsemble):
        networks: list[BayesianBP] = surrogate.members_
    else:
        networks = [surrogate]
    members = []
    for network in networks:
        content = network.to_dict()
        member = {key: content[key] for key in MEMBER_ARRAYS}
        # The matrix is large, and single precision is enough for a standard error.
        member["root"] = pack_array(network.posterior_root_, "<f4")
        members.append(member)
    # An ensemble trains all its networks with the same scaling, so take that of the
    # first one.
    first_content = networks[0].to_dict()
    scaling = {key: first_content[key] for key in SCALING_KEYS}
    return scaling | {"kind": "network", "members": members}


def _predict_curves_and_planes(
    surrogate: Predictor, parameters: ParameterSpace, answer: np.ndarray
) -> dict[str, Any]:
    """Predict the responses along each free parameter, and over each pair of them.

    Parameters
    ----------
    surrogate : Predictor
        The surrogate.
    parameters : ParameterSpace
        The parameters of the study.
    answer : ndarray
        The reported parameter set (d,), at which the other parameters stay.

    Returns
    -------
    dict
        `kind` is ``curves``, although there are also planes. The keys of `curves` are
        names of parameters, and those of `planes` are pairs of names, such as ``first
        second``. Each entry contains the mean and the standard deviation. The arrays of
        a plane have the shape (points, points, responses). Their first index is that of
        the first parameter. They are packed by `pack_array`. `planePoints` is the
        number of points along each side. `report.js` reads the values by these keys.
    """
    curves = {}
    n_responses = 0  # the same for all parameters
    for name in parameters.free:
        points = np.tile(np.asarray(answer, dtype=float), (CURVE_POINTS, 1))
        column = parameters.names.index(name)
        points[:, column] = _spread_over_range(parameters, name, CURVE_POINTS)
        mean, std = surrogate.predict(points, return_std=True, noise=False)
        n_responses = np.shape(mean)[1]
        curves[name] = {
            "mean": np.asarray(mean).tolist(),
            "std": np.asarray(std).tolist(),
        }

    # A study of a single parameter has no pairs, and therefore no planes.
    pairs = list(combinations(parameters.free, 2))
    n_points = choose_plane_points(len(pairs), n_responses) if pairs else 0
    planes = {}
    for first, second in pairs:
        points = _make_plane_points(parameters, answer, (first, second), n_points)
        mean, std = surrogate.predict(points, return_std=True, noise=False)
        planes[f"{first} {second}"] = {
            "mean": pack_array(mean, "<f4"),
            "std": pack_array(std, "<f4"),
        }
    return {
        "kind": "curves",
        "curves": curves,
        "planes": planes,
        "planePoints": n_points,
    }


def choose_plane_points(n_pairs: int, n_responses: int) -> int:
    """Choose the number of points along each side of a plane, to keep the page small.

    At each point, the mean and the standard deviation of each response are stored.

    Parameters
    ----------
    n_pairs : int
        Number of planes.
    n_responses : int
        Number of responses.

    Returns
    -------
    int
        The number of points.
    """
    points_of_plane = MAX_PLANE_NUMBERS / (2 * n_responses * n_pairs)
    points_of_side = math.isqrt(int(points_of_plane))
    return max(MIN_PLANE_POINTS, min(MAX_PLANE_POINTS, points_of_side))


def _make_plane_points(
    parameters: ParameterSpace,
    answer: np.ndarray,
    pair: Sequence[str],
    n_points: int,
) -> np.ndarray:
    """Make the points of a plane along which two parameters vary.

    Parameters
    ----------
    parameters : ParameterSpace
        The parameters of the study.
    answer : ndarray
        The reported parameter set (d,), at which the other parameters stay.
    pair : sequence of str
        Names of the two parameters.
    n_points : int
        Number of points along each of them.

    Returns
    -------
    ndarray
        Points (n_points^2, d). The second parameter of the pair varies fastest.
    """
    first, second = pair
    down, across = np.meshgrid(
        _spread_over_range(parameters, first, n_points),
        _spread_over_range(parameters, second, n_points),
        indexing="ij",
    )
    points = np.tile(np.asarray(answer, dtype=float), (n_points * n_points, 1))
    points[:, parameters.names.index(first)] = down.ravel()
    points[:, parameters.names.index(second)] = across.ravel()
    return points


def _spread_over_range(
    parameters: ParameterSpace, name: str, n_points: int
) -> np.ndarray:
    """Spread values evenly over the range of a free parameter, along its scale.

    Parameters
    ----------
    parameters : ParameterSpace
        The parameters of the study.
    name : str
        Name of the parameter.
    n_points : int
        Number of values.

    Returns
    -------
    ndarray
        Values (n_points,), including both ends of the range.
    """
    if name in parameters.scale:
        return parameters.values_at(name, np.linspace(0, 1, n_points))
    index = parameters.free.index(name)
    return np.linspace(parameters.low[index], parameters.high[index], n_points)
