"""The surrogate for a page without Python: data from which the page's sliders predict.

A network, and each network of an ensemble, is stored whole with the root of its weights' covariance; `network.js`
predicts from them like `repose.calibrate.surrogates.network_ensemble`. Other surrogates are stored as curves: one parameter varies
over its range, the others stay at the answer.
"""

import base64
from typing import Any, TypeGuard

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.network_ensemble import OF_EACH, NetworkEnsemble

CURVE_POINTS = 41
SHARED = ("input_min", "input_max", "output_min", "output_max", "scaled_range")


def packed(array: np.ndarray, kind: str) -> str:
    """Write an array as Base64 for a typed array of JavaScript; `kind` is a little-endian type of NumPy, as ``<f4``."""
    return base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode()


def is_whole(surrogate: Predictor) -> TypeGuard[BayesianBP | NetworkEnsemble]:
    """Tell whether the page has the surrogate itself, and not curves."""
    return isinstance(surrogate, BayesianBP | NetworkEnsemble)


def for_page(
    surrogate: Predictor, space: ParameterSpace, answer: np.ndarray
) -> dict[str, Any]:
    """Give a surrogate as plain values, `kind` ``network`` or ``curves``; `answer` is the reported parameter set."""
    if is_whole(surrogate):
        members = (
            surrogate.members_
            if isinstance(surrogate, NetworkEnsemble)
            else [surrogate]
        )
        contents = [member.to_dict() for member in members]
        found = [{key: content[key] for key in OF_EACH} for content in contents]
        for own, member in zip(found, members, strict=True):
            own["root"] = packed(member.posterior_root_, "<f4")
        return {key: contents[0][key] for key in SHARED} | {
            "kind": "network",
            "members": found,
        }
    curves = {}
    for name, low, high in zip(space.free, space.low, space.high, strict=True):
        points = np.tile(np.asarray(answer, dtype=float), (CURVE_POINTS, 1))
        points[:, space.names.index(name)] = np.linspace(low, high, CURVE_POINTS)
        mean, std = surrogate.predict(points, return_std=True, noise=False)
        curves[name] = {
            "mean": np.asarray(mean).tolist(),
            "std": np.asarray(std).tolist(),
        }
    return {"kind": "curves", "curves": curves}
