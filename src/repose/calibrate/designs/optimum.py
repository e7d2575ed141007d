"""Optimum of fitted models inside the region of their design."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.designs.coding import two_level
from repose.calibrate.designs.model import Model
from repose.calibrate.designs.region import Region

# Deviations from the targets, in their scales.
MET = 1e-6  # below this a target counts as met
NEARLY_MET = 1e-3  # below this the search looks for points that meet all targets
# Sum of squared deviations, below which such a search starts from a point.
GOOD_START = 1e-6


class Optimum(NamedTuple):
    """Result of `optimum`."""

    coded: np.ndarray  # (k,)
    predicted: np.ndarray  # (responses,)
    met: bool  # whether the predictions meet the targets
    desirability: float


def desirability(
    predicted: ArrayLike, aims: ArrayLike, low: ArrayLike, high: ArrayLike
) -> np.ndarray:
    """Compute the desirability of predictions (Derringer and Suich 1980).

    The desirability of a response is 1 at its aim and falls linearly to 0 at the ends
    of its range. That of a prediction is the geometric mean over its responses.

    Parameters
    ----------
    predicted : array (n, responses)
    aims, low, high : array (responses,)

    Returns
    -------
    array (n,)
        From 0 to 1.
    """
    predicted = np.atleast_2d(np.asarray(predicted, dtype=float))
    aims = np.asarray(aims, dtype=float)
    low = np.asarray(low, dtype=float)
    high = np.asarray(high, dtype=float)
    # Divisions by 0 occur where an aim is at an end of its range.
    with np.errstate(divide="ignore", invalid="ignore"):
        below = (predicted - low) / (aims - low)
        above = (high - predicted) / (high - aims)
    share = np.where(predicted < aims, below, above)
    share = np.where(predicted == aims, 1.0, share)
    return np.clip(share, 0.0, 1.0).prod(axis=1) ** (1.0 / len(aims))


class _Deviations:
    """Deviations of the models' predictions from the aims, at points (k,).

    `scale` (responses,) is the unit of each deviation.
    """

    def __init__(
        self, models: Sequence[Model], aims: np.ndarray, scale: np.ndarray
    ) -> None:
        self.models = models
        self.aims = aims
        self.scale = scale

    def __call__(self, point: np.ndarray) -> np.ndarray:
        """Compute the deviations (responses,), in the units of the responses."""
        predicted = [float(model.predict(point[None])[0]) for model in self.models]
        return np.array(predicted) - self.aims

    def scaled(self, point: np.ndarray) -> np.ndarray:
        """Compute the deviations in their scales."""
        return self(point) / self.scale

    def squared(self, point: np.ndarray) -> float:
        """Sum the squares of the scaled deviations."""
        return float((self.scaled(point) ** 2).sum())

    def largest(self, point: np.ndarray) -> float:
        """Return the size of the largest scaled deviation."""
        return np.abs(self.scaled(point)).max()


def optimum(
    models: Sequence[Model],
    aims: ArrayLike,
    scale: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    region: Region | None = None,
) -> Optimum:
    """Find the point of the cube from -1 to 1 that is nearest to the targets.

    With more factors than targets, a whole curve or surface of points may meet all
    targets. The result is the one nearest to the centre, where the models are most
    accurate.

    Parameters
    ----------
    models : sequence of Model
        One for each response.
    aims : array (responses,)
    scale : array (responses,)
        The aim over the root of its weight.
    low, high : array (responses,)
        Ranges of the responses, for the desirability.
    region : Region or None
        The part of the cube that is allowed; None for all of it.
    """
    aims = np.asarray(aims, dtype=float)
    deviations = _Deviations(models, aims, np.asarray(scale, dtype=float))
    n_factors = len(models[0].factors)
    bounds = [(-1.0, 1.0)] * n_factors
    minima = _minima(deviations, bounds, region)
    best = min(minima, key=deviations.squared)

    # If the targets can be met, move towards the centre along the points that meet them.
    if deviations.largest(best) < NEARLY_MET:
        central = [
            _most_central(deviations, point, bounds=bounds, region=region)
            for point in minima
            if deviations.squared(point) < GOOD_START
        ]
        exact = [point for point in central if deviations.largest(point) < MET]
        if exact:
            best = min(exact, key=_squared_length)

    predicted = deviations(best) + aims
    is_met = bool(np.abs((predicted - aims) / deviations.scale).max() < MET)
    return Optimum(
        coded=best,
        predicted=predicted,
        met=is_met,
        desirability=float(desirability(predicted, aims, low, high)[0]),
    )


def _minima(
    deviations: _Deviations, bounds: list[tuple[float, float]], region: Region | None
) -> list[np.ndarray]:
    """Minimise the squared deviations from several starts; a point (k,) for each.

    The starts are the centre, points half way to each corner, and the middles of the
    faces of the cube. Forbidden ones are moved to the edge of what is allowed.
    """
    from scipy import optimize

    n_factors = len(bounds)
    starts = np.vstack(
        [
            np.zeros(n_factors),
            0.5 * two_level(n_factors),
            np.eye(n_factors),
            -np.eye(n_factors),
        ]
    )
    # SLSQP takes constraints; without any, L-BFGS-B is as in published results.
    options: dict[str, Any] = {"method": "L-BFGS-B"}
    if region is not None:
        starts = np.array([region.pull_inside(start) for start in starts])
        options = {"method": "SLSQP", "constraints": _constraints(region)}
    minima = [
        optimize.minimize(
            deviations.squared, start, bounds=bounds, tol=1e-14, **options
        ).x
        for start in starts
    ]
    return _inside(minima, region)


def _most_central(
    deviations: _Deviations,
    start: np.ndarray,
    *,
    bounds: list[tuple[float, float]],
    region: Region | None,
) -> np.ndarray:
    """Find the point nearest to the centre at which every target is met.

    The start is a point that nearly does so.
    """
    from scipy import optimize

    found = optimize.minimize(
        _squared_length,
        start,
        jac=lambda point: 2 * point,
        constraints=[
            {"type": "eq", "fun": deviations.scaled},
            *_constraints(region),
        ],
        bounds=bounds,
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 200},
    ).x
    return _inside([found], region)[0]


def _constraints(region: Region | None) -> list[dict[str, Any]]:
    """Write a region as constraints of SciPy."""
    return [] if region is None else [{"type": "ineq", "fun": region.room}]


def _inside(points: list[np.ndarray], region: Region | None) -> list[np.ndarray]:
    """Move points that a search left beyond a constraint to the edge of the region."""
    if region is None:
        return points
    return [region.pull_inside(point) for point in points]


def _squared_length(point: np.ndarray) -> float:
    """Compute the squared distance of a point (k,) from the centre."""
    return float(point @ point)
