"""Make designs and sequences of points that obey the constraints of a study.

Without constraints the results are exactly the ordinary designs and sequences.
"""

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace

# Largest number of designs, each larger than the one before, that `make_allowed_design`
# tries.
MAX_TRIALS = 50
# A design with too few allowed points grows by at least 2 %, and at most fourfold.
MIN_GROWTH = 1.02
MAX_GROWTH = 4.0

Design = Callable[[int], np.ndarray]


class PointSequence(Protocol):
    """A sequence of points of the unit cube, such as Sobol's."""

    def random(self, n: int) -> np.ndarray:
        """Return the next n points (n, d)."""


def take_allowed_points(
    sequence: PointSequence,
    count: int,
    space: ParameterSpace,
    follows_prior: bool = True,
) -> np.ndarray:
    """Take the first points of a sequence that the constraints allow.

    The constraints must allow some points, or the function never ends. The check of the
    configuration makes sure of this.

    Parameters
    ----------
    sequence : PointSequence
        Sequence of points in the unit cube. The call advances it by a multiple of
        `count`, so it skips the allowed points beyond the first `count`.
    count : int
        Number of points to return.
    space : ParameterSpace
        The parameters of the study.
    follows_prior : bool
        Whether the points are transformed from a uniform distribution to that of the
        priors.

    Returns
    -------
    numpy.ndarray, (count, d)
        Points of the unit cube.
    """
    found = np.empty((0, space.dimensions))
    while len(found) < count:
        points = _apply_prior(sequence.random(count), space, follows_prior)
        if not space.constraints:
            return points
        found = np.vstack([found, points[space.is_allowed(points)]])
    return found[:count]


def make_allowed_design(
    design: Design,
    count: int,
    space: ParameterSpace,
    follows_prior: bool = False,
) -> np.ndarray:
    """Make a design whose points all obey the constraints and are evenly spread.

    With constraints, larger designs are made until one has enough allowed points. If it
    has more than necessary, points with near neighbours are dropped. A design fills the
    whole cube evenly, so its allowed points fill the allowed part evenly. They do not
    form a Latin hypercube.

    Parameters
    ----------
    design : callable
        Function of a number n that returns a design (n, d) of the unit cube.
    count : int
        Number of points to return.
    space : ParameterSpace
        The parameters of the study.
    follows_prior : bool
        Whether the points are transformed from a uniform distribution to that of the
        priors.

    Returns
    -------
    numpy.ndarray, (count, d)

    Raises
    ------
    ValueError
        If the designs have too few allowed points.
    """
    if not space.constraints:
        return _apply_prior(design(count), space, follows_prior)
    size = count
    for _ in range(MAX_TRIALS):
        points = _apply_prior(design(size), space, follows_prior)
        allowed = points[space.is_allowed(points)]
        if len(allowed) >= count:
            return _drop_nearest(allowed, count)
        # Grow the design by the factor that the last one lacked.
        growth = count / max(len(allowed), 1)
        size = math.ceil(size * min(max(growth, MIN_GROWTH), MAX_GROWTH))
    raise ValueError(
        f"{len(allowed)} of {len(points)} points are allowed; expected {count}"
    )


def _apply_prior(
    points: np.ndarray, space: ParameterSpace, follows_prior: bool
) -> np.ndarray:
    """Transform uniform points (n, d) to the priors if `follows_prior` is True."""
    return space.transform_to_prior(points) if follows_prior else points


def _drop_nearest(points: np.ndarray, count: int) -> np.ndarray:
    """Drop the points (n, d) nearest to other points, until `count` are left."""
    from scipy.spatial.distance import cdist

    distances = cdist(points, points)
    np.fill_diagonal(distances, np.inf)
    remaining = np.arange(len(points))  # row numbers
    while len(remaining) > count:
        # Distances of each remaining point from the others, the smallest first.
        sorted_distances = np.sort(distances[np.ix_(remaining, remaining)], axis=1)
        nearest = sorted_distances[:, 0]
        second_nearest = sorted_distances[:, 1]
        # Drop the point that is nearest to its neighbour. Two points share this
        # distance, so of these drop the one whose second neighbour is nearer.
        order = np.lexsort((second_nearest, nearest))
        remaining = np.delete(remaining, order[0])
    return points[remaining]
