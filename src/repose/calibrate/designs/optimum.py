"""Optimum of fitted models inside the region of their design."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.designs.coding import two_level
from repose.calibrate.designs.model import Model

MET = 1e-6  # relative misses below this count as zero


class Optimum(NamedTuple):
    """Result of `optimum`."""

    coded: np.ndarray  # (k,)
    predicted: np.ndarray  # (responses,)
    met: bool  # whether the predictions meet the targets
    desirability: float


def desirability(
    predicted: ArrayLike, aims: ArrayLike, low: ArrayLike, high: ArrayLike
) -> np.ndarray:
    """Compute the desirability (n,) of predictions (n, responses), from 0 to 1 (Derringer and Suich 1980).

    It is the geometric mean over the responses, each 1 at its target and falling linearly to 0 at the ends of its
    range.
    """
    predicted = np.atleast_2d(np.asarray(predicted, dtype=float))
    aims, low, high = (
        np.asarray(numbers, dtype=float) for numbers in (aims, low, high)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(
            predicted < aims,
            (predicted - low) / (aims - low),
            (high - predicted) / (high - aims),
        )
    return np.clip(np.where(predicted == aims, 1.0, share), 0.0, 1.0).prod(axis=1) ** (
        1.0 / len(aims)
    )


def optimum(
    models: Sequence[Model],
    aims: ArrayLike,
    scale: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
) -> Optimum:
    """Find the point of the cube from -1 to 1 at which the models, one a response, are nearest to their targets.

    Few targets and many factors leave a curve or surface of such points; the point nearest to the centre is taken,
    where the models are most accurate. `scale` is the target over the root of its weight.
    """
    from scipy import optimize

    aims, scale = np.asarray(aims, dtype=float), np.asarray(scale, dtype=float)
    count = len(models[0].factors)
    bounds = [(-1.0, 1.0)] * count

    def misses(point: np.ndarray) -> np.ndarray:
        return (
            np.array([float(model.predict(point[None])[0]) for model in models]) - aims
        )

    def squared(point: np.ndarray) -> float:
        return float(((misses(point) / scale) ** 2).sum())

    def nearest(start: np.ndarray) -> np.ndarray:
        """Find the point nearest to the centre at which every target is met, from a point that nearly does so."""
        constraint = {"type": "eq", "fun": lambda point: misses(point) / scale}
        options = {
            "bounds": bounds,
            "method": "SLSQP",
            "options": {"ftol": 1e-12, "maxiter": 200},
        }
        return optimize.minimize(
            lambda point: float(point @ point),
            start,
            jac=lambda point: 2 * point,
            constraints=constraint,
            **options,
        ).x

    starts = np.vstack(
        [np.zeros(count), 0.5 * two_level(count), np.eye(count), -np.eye(count)]
    )
    ends = [
        optimize.minimize(squared, start, bounds=bounds, method="L-BFGS-B", tol=1e-14).x
        for start in starts
    ]
    best = min(ends, key=squared)
    if np.abs(misses(best) / scale).max() < 1e-3:
        meeting = [nearest(point) for point in ends if squared(point) < 1e-6]
        exact = [
            point for point in meeting if np.abs(misses(point) / scale).max() < MET
        ]
        best = min(exact, key=lambda point: float(point @ point)) if exact else best
    predicted = misses(best) + aims
    met = bool(np.abs((predicted - aims) / scale).max() < MET)
    return Optimum(
        best, predicted, met, float(desirability(predicted, aims, low, high)[0])
    )
