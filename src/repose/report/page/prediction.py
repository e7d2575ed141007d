"""The surrogate in a page without Python: data from which its sliders predict.

A network, and each network of an ensemble, is stored whole, with the root of the
covariance of its weights; `network.js` predicts from them like
`repose.calibrate.surrogates.network_ensemble`. Other surrogates are stored as curves:
one parameter varies over its range, the others stay at the answer.
"""

import base64
from typing import Any, TypeGuard

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.network_ensemble import OF_EACH, NetworkEnsemble

CURVE_POINTS = 41
# What the networks of an ensemble have in common.
SCALING_KEYS = ("input_min", "input_max", "output_min", "output_max", "scaled_range")


def packed(array: np.ndarray, dtype: str) -> str:
    """Write an array as Base64 for a typed array of JavaScript.

    `dtype` is a little-endian type of NumPy, such as ``<f4``.
    """
    return base64.b64encode(np.ascontiguousarray(array, dtype=dtype).tobytes()).decode()


def has_network(surrogate: Predictor) -> TypeGuard[BayesianBP | NetworkEnsemble]:
    """Tell whether the page holds the surrogate itself instead of curves."""
    return isinstance(surrogate, BayesianBP | NetworkEnsemble)


def for_page(
    surrogate: Predictor, parameters: ParameterSpace, answer: np.ndarray
) -> dict[str, Any]:
    """Give a surrogate as plain values.

    Their `kind` is ``network`` or ``curves``. `answer` is the reported parameter set,
    through which the curves run.
    """
    if has_network(surrogate):
        return _networks(surrogate)
    return _curves(surrogate, parameters, answer)


def _networks(surrogate: BayesianBP | NetworkEnsemble) -> dict[str, Any]:
    """Give the weights of a network, or of each network of an ensemble."""
    if isinstance(surrogate, NetworkEnsemble):
        networks: list[BayesianBP] = surrogate.members_
    else:
        networks = [surrogate]
    members = []
    for network in networks:
        content = network.to_dict()
        member = {key: content[key] for key in OF_EACH}
        member["root"] = packed(network.posterior_root_, "<f4")
        members.append(member)
    # All networks have the scaling of the first.
    first_content = networks[0].to_dict()
    scaling = {key: first_content[key] for key in SCALING_KEYS}
    return scaling | {"kind": "network", "members": members}


def _curves(
    surrogate: Predictor, parameters: ParameterSpace, answer: np.ndarray
) -> dict[str, Any]:
    """Give mean and standard deviation of each response along each free parameter."""
    curves = {}
    ranges = zip(parameters.free, parameters.low, parameters.high, strict=True)
    for name, low, high in ranges:
        points = np.tile(np.asarray(answer, dtype=float), (CURVE_POINTS, 1))
        points[:, parameters.names.index(name)] = np.linspace(low, high, CURVE_POINTS)
        mean, std = surrogate.predict(points, return_std=True, noise=False)
        curves[name] = {
            "mean": np.asarray(mean).tolist(),
            "std": np.asarray(std).tolist(),
        }
    return {"kind": "curves", "curves": curves}
