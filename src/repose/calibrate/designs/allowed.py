"""Designs and sequences of points that constraints allow.

Without constraints these are the ordinary designs and sequences, bit by bit.
"""

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace

# Of the designs of which the allowed points are counted.
MOST_TRIALS = 50
# A design with too few allowed points grows by at least 2 %, and at most fourfold.
LEAST_GROWTH = 1.02
MOST_GROWTH = 4.0

Design = Callable[[int], np.ndarray]


class Sequence(Protocol):
    """A sequence of points of the unit cube, such as Sobol's."""

    def random(self, n: int) -> np.ndarray:
        """Return the next n points (n, d)."""


def points_of_sequence(
    sequence: Sequence,
    count: int,
    space: ParameterSpace,
    follows_prior: bool = True,
) -> np.ndarray:
    """Take the first points of a sequence that the constraints allow.

    Parameters
    ----------
    sequence : Sequence
        In the unit cube.
    count : int
    space : ParameterSpace
    follows_prior : bool
        Whether the points are moved to the distribution of the priors.

    Returns
    -------
    numpy.ndarray, (count, d)
        Points of the unit cube.
    """
    found = np.empty((0, space.dimensions))
    while len(found) < count:
        points = _moved(sequence.random(count), space, follows_prior)
        if not space.constraints:
            return points
        found = np.vstack([found, points[space.is_allowed(points)]])
    return found[:count]


def allowed_design(
    design: Design,
    count: int,
    space: ParameterSpace,
    follows_prior: bool = False,
) -> np.ndarray:
    """Make a design of points that the constraints allow, spread evenly over them.

    A larger design fills the whole cube evenly, and so its allowed points fill what is
    allowed. Its size grows until it has enough of them. If there are more, the points
    nearest to others are left out. The result is no Latin hypercube.

    Parameters
    ----------
    design : callable
        From a number n to a design (n, d) of the unit cube.
    count : int
    space : ParameterSpace
    follows_prior : bool
        Whether the points are moved to the distribution of the priors.

    Returns
    -------
    numpy.ndarray, (count, d)

    Raises
    ------
    ValueError
        If the designs have too few allowed points.
    """
    if not space.constraints:
        return _moved(design(count), space, follows_prior)
    size = count
    for _ in range(MOST_TRIALS):
        points = _moved(design(size), space, follows_prior)
        allowed = points[space.is_allowed(points)]
        if len(allowed) >= count:
            return _without_nearest(allowed, count)
        growth = count / max(len(allowed), 1)
        size = math.ceil(size * min(max(growth, LEAST_GROWTH), MOST_GROWTH))
    raise ValueError(f"{len(allowed)} of {size} points are allowed; expected {count}")


def _moved(
    points: np.ndarray, space: ParameterSpace, follows_prior: bool
) -> np.ndarray:
    """Move points (n, d) to the distribution of the priors, if they follow it."""
    return space.from_prior(points) if follows_prior else points


def _without_nearest(points: np.ndarray, count: int) -> np.ndarray:
    """Leave out the points that are nearest to others, until `count` are left."""
    from scipy.spatial.distance import cdist

    distances = cdist(points, points)
    np.fill_diagonal(distances, np.inf)
    kept = np.arange(len(points))
    while len(kept) > count:
        among = np.sort(distances[np.ix_(kept, kept)], axis=1)
        # Of the two nearest points, drop the one that is nearer to a third.
        order = np.lexsort((among[:, 1], among[:, 0]))
        kept = np.delete(kept, order[0])
    return points[kept]
