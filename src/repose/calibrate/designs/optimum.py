"""Optimum of fitted models inside the region of their design."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.designs.coding import make_full_factorial
from repose.calibrate.designs.model import Model
from repose.calibrate.designs.region import SLSQP_OPTIONS, Region

# A target counts as met if its scaled deviation is below the first of these numbers. If
# all deviations of the best minimum are below the second, the targets can probably be
# met, and the search for the most central point that meets them begins.
MET_DEVIATION = 1e-6
NEARLY_MET_DEVIATION = 1e-3
# This search starts from each minimum whose sum of squared deviations is below this. It
# is the square of `NEARLY_MET_DEVIATION`.
GOOD_START_SQUARE = 1e-6
# Tolerance of SciPy for a sum of squared deviations. It is below the square of
# `MET_DEVIATION`, so that a search does not end before the targets are met.
SQUARE_TOLERANCE = 1e-14


class Optimum(NamedTuple):
    """Result of `find_optimum`."""

    coded: np.ndarray  # (k,)
    predicted: np.ndarray  # (responses,)
    met: bool  # whether the predictions meet the targets
    desirability: float


def compute_desirability(
    predicted: ArrayLike, aims: ArrayLike, low: ArrayLike, high: ArrayLike
) -> np.ndarray:
    """Compute the desirability of predictions (Derringer and Suich 1980).

    The desirability of a response is 1 at its aim and falls linearly to 0 at the ends
    of its range. The desirability of a point is the geometric mean over its responses.

    Parameters
    ----------
    predicted : array (n, responses)
        Predicted responses at n points.
    aims, low, high : array (responses,)
        Aim of each response, and the ends of its range, with low <= aim <= high.

    Returns
    -------
    array (n,)
        Desirabilities from 0 to 1.
    """
    predicted = np.atleast_2d(np.asarray(predicted, dtype=float))
    aims = np.asarray(aims, dtype=float)
    low = np.asarray(low, dtype=float)
    high = np.asarray(high, dtype=float)
    # If an aim is at an end of its range, a denominator is 0. A prediction beyond this
    # end then gets -inf, which is clipped to 0 below. A prediction at the aim gets NaN,
    # which is replaced by 1.
    with np.errstate(divide="ignore", invalid="ignore"):
        below = (predicted - low) / (aims - low)
        above = (high - predicted) / (high - aims)
    desirability = np.where(predicted < aims, below, above)
    desirability = np.where(predicted == aims, 1.0, desirability)
    # Outside the range the desirability is 0. Take the geometric mean of the responses.
    return np.clip(desirability, 0.0, 1.0).prod(axis=1) ** (1.0 / len(aims))


class _Deviations:
    """Functions of a point (k,): how far the predictions there deviate from the aims.

    `scale` (responses,) is the unit of the scaled deviations.
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
        """Compute the deviations (responses,), divided by the scale."""
        return self(point) / self.scale

    def sum_of_squares(self, point: np.ndarray) -> float:
        """Compute the sum of the squared scaled deviations."""
        return float((self.scaled(point) ** 2).sum())

    def largest(self, point: np.ndarray) -> float:
        """Return the size of the largest scaled deviation."""
        return np.abs(self.scaled(point)).max()


def find_optimum(
    models: Sequence[Model],
    aims: ArrayLike,
    scale: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    region: Region | None = None,
) -> Optimum:
    """Find the point at which the predicted responses are nearest to their aims.

    The point lies in the cube of the coded factors, from -1 to 1. With more factors
    than responses, a whole curve or surface of points may meet all aims. The result is
    then the point nearest to the centre, where the models are most accurate.

    Parameters
    ----------
    models : sequence of Model
        One for each response.
    aims : array (responses,)
        The aim of each response, its target.
    scale : array (responses,)
        The unit of each deviation, such as the aim divided by the square root of its
        weight.
    low, high : array (responses,)
        Ranges of the responses, for the desirability.
    region : Region or None
        The part of the cube that is allowed; None for all of it.

    Returns
    -------
    Optimum
    """
    aims = np.asarray(aims, dtype=float)
    deviations = _Deviations(models, aims, np.asarray(scale, dtype=float))
    n_factors = len(models[0].factors)
    bounds = [(-1.0, 1.0)] * n_factors
    minima = _find_minima(deviations, bounds, region)
    best = min(minima, key=deviations.sum_of_squares)

    # If the best minimum nearly meets the aims, search for the point nearest to the
    # centre that meets them. A search that ends without meeting them does not count.
    if deviations.largest(best) < NEARLY_MET_DEVIATION:
        central_points = [
            _find_most_central(deviations, point, bounds=bounds, region=region)
            for point in minima
            if deviations.sum_of_squares(point) < GOOD_START_SQUARE
        ]
        points_at_aims = [
            point
            for point in central_points
            if deviations.largest(point) < MET_DEVIATION
        ]
        if points_at_aims:
            best = min(points_at_aims, key=_compute_squared_length)

    predicted = deviations(best) + aims
    is_met = bool(np.abs((predicted - aims) / deviations.scale).max() < MET_DEVIATION)
    return Optimum(
        coded=best,
        predicted=predicted,
        met=is_met,
        desirability=float(compute_desirability(predicted, aims, low, high)[0]),
    )


def _find_minima(
    deviations: _Deviations, bounds: list[tuple[float, float]], region: Region | None
) -> list[np.ndarray]:
    """Find local minima of the sum of the squared deviations.

    A search begins at the centre of the cube, at the points half way to each corner,
    and at the middle of each face. Forbidden starts are moved to the edge of the
    region.

    Parameters
    ----------
    deviations : _Deviations
        The deviations to minimise.
    bounds : list of pair of float
        Lowest and highest value of each of the k factors.
    region : Region or None
        The part of the cube that is allowed; None for all of it.

    Returns
    -------
    list of numpy.ndarray, (k,)
        The minimum that each search found, moved into the region if necessary.
    """
    from scipy import optimize

    n_factors = len(bounds)
    corners = make_full_factorial(n_factors)
    upper_faces = np.eye(n_factors)
    starts = np.vstack(
        [np.zeros(n_factors), 0.5 * corners, upper_faces, -upper_faces],
    )
    # L-BFGS-B is the method of the published results, but it allows no constraints.
    # With constraints, use SLSQP instead.
    options: dict[str, Any] = {"method": "L-BFGS-B"}
    if region is not None:
        starts = np.array([region.pull_inside(start) for start in starts])
        options = {"method": "SLSQP", "constraints": _make_scipy_constraints(region)}
    minima = [
        optimize.minimize(
            deviations.sum_of_squares,
            start,
            bounds=bounds,
            tol=SQUARE_TOLERANCE,
            **options,
        ).x
        for start in starts
    ]
    # SLSQP may end slightly beyond a constraint.
    return _pull_all_inside(minima, region)


def _find_most_central(
    deviations: _Deviations,
    start: np.ndarray,
    *,
    bounds: list[tuple[float, float]],
    region: Region | None,
) -> np.ndarray:
    """Find the point nearest to the centre of the cube at which all targets are met.

    The search begins at `start`, where the targets are nearly met.
    """
    from scipy import optimize

    found = optimize.minimize(
        _compute_squared_length,
        start,
        jac=lambda point: 2 * point,
        constraints=[
            {"type": "eq", "fun": deviations.scaled},
            *_make_scipy_constraints(region),
        ],
        bounds=bounds,
        method="SLSQP",
        options=SLSQP_OPTIONS,
    ).x
    return _pull_all_inside([found], region)[0]


def _make_scipy_constraints(region: Region | None) -> list[dict[str, Any]]:
    """Make SciPy's constraints for a region; the list is empty if there is none."""
    return [] if region is None else [{"type": "ineq", "fun": region.compute_slack}]


def _pull_all_inside(
    points: list[np.ndarray], region: Region | None
) -> list[np.ndarray]:
    """Move each forbidden point (k,) to the edge of the region; see `Region.pull_inside`."""
    if region is None:
        return points
    return [region.pull_inside(point) for point in points]


def _compute_squared_length(point: np.ndarray) -> float:
    """Compute the squared distance of a point (k,) from the centre."""
    return float(point @ point)
