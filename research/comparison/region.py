"""The feasible region of a surrogate, and its coverage by a list of solutions."""

import math

import numpy as np
from scipy import stats
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist

from repose.calibrate.search.objective import Objective
from research.comparison.searches import Respond

FEWEST_FEASIBLE = 200  # of the reference sample; with fewer the region is not known
CLOUD = 5000  # reference points for the coverage
LISTS = 10  # of random feasible points


class Region:
    """A uniform sample of the feasible region, as a reference for lists of solutions.

    `respond` maps populations in [-1, 1] (n, d) to responses (n, k); `points`, a power of two, is the length of the
    Sobol sequence over the box; `listed` is the length of a list. `share` of the box is feasible; `lists` hold random
    feasible points (listed, d); `reach` is the median distance from a feasible point to the nearest point of such a
    list. Fewer than `FEWEST_FEASIBLE` feasible points raise ValueError.
    """

    def __init__(
        self,
        respond: Respond,
        objective: Objective,
        points: int,
        listed: int,
        dimensions: int,
        seed: int,
    ):
        unit = 2 * stats.qmc.Sobol(dimensions, rng=seed).random(points) - 1
        _, V = objective(respond(unit))
        self.points = unit[V == 0]
        self.share = len(self.points) / points
        if len(self.points) < FEWEST_FEASIBLE:
            raise ValueError(
                f"{len(self.points)} of {points} points are feasible; expected at least {FEWEST_FEASIBLE}"
            )
        self.cloud = self.points[:CLOUD]
        self.volume = _volume(self.points)
        random = np.random.default_rng(seed)
        self.lists = [
            random.choice(self.points, min(listed, len(self.points)), replace=False)
            for _ in range(LISTS)
        ]
        self.reach = float(
            np.median([cKDTree(points).query(self.cloud)[0] for points in self.lists])
        )

    def spread(self, points: np.ndarray) -> dict[str, float]:
        """Spread of feasible points (n, d) in [-1, 1]; all NaN with fewer than two points.

        ``pairwise_distance`` is a mean. ``coverage`` is the share of the feasible region within `reach` of a point; a
        half for as many random points. ``width`` is the mean over the parameters of their interval over the region's
        (dispersion of Table 3). ``volume`` is the root of the determinant of their covariance over the region's.
        """
        if len(points) < 2:
            return dict.fromkeys(
                ("pairwise_distance", "coverage", "width", "volume"), math.nan
            )
        covered = cKDTree(points).query(self.cloud)[0] <= self.reach
        return {
            "pairwise_distance": float(pdist(points).mean()),
            "coverage": float(covered.mean()),
            "width": float(
                (np.ptp(points, axis=0) / np.ptp(self.points, axis=0)).mean()
            ),
            "volume": _volume(points) / self.volume,
        }


def _volume(points):
    """Root of the determinant of the covariance of points (n, d)."""
    return float(np.sqrt(max(0.0, np.linalg.det(np.atleast_2d(np.cov(points.T))))))
