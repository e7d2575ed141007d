"""The part of a design's cube that constraints allow, in coded units."""

from collections.abc import Callable
from functools import cached_property

import numpy as np

# Number of points that show which part of the cube is allowed, and the seed of their
# sequence. A Sobol sequence is evenly spread for a power of two.
N_POINTS = 2**13
SEED = 1
# A search must stay this far inside a constraint, as a fraction of the largest excess,
# so that its rounding cannot violate the constraint.
CONSTRAINT_MARGIN = 1e-9
# Number of times that the way from a forbidden point to an allowed one is halved.
N_HALVINGS = 60
# Options of SciPy for a search for the point nearest to another one. The tolerance is a
# squared distance, of points that agree to six decimals.
SLSQP_OPTIONS = {"ftol": 1e-12, "maxiter": 200}


class Region:
    """The points of the cube from -1 to 1 that obey all constraints.

    Parameters
    ----------
    excesses : callable
        Function of points (n, factors) in coded units that returns numbers (n,
        constraints). A number is positive where the constraint is violated.
    factors : int
        Number of factors.
    """

    def __init__(
        self, excesses: Callable[[np.ndarray], np.ndarray], factors: int
    ) -> None:
        self.excesses = excesses
        self.factors = factors

    def is_allowed(self, coded: np.ndarray) -> np.ndarray:
        """Mark the points (n, factors) that obey all constraints."""
        largest: np.ndarray = self.excesses(coded).max(axis=1)
        return largest <= 0

    @cached_property
    def points(self) -> np.ndarray:
        """Allowed points (n, factors) in coded units, evenly spread over the region.

        Raises
        ------
        ValueError
            If there are none.
        """
        from scipy.stats import qmc

        # Scramble the sequence, because its regular points lie exactly on the edge of
        # constraints such as a <= b.
        sequence = qmc.Sobol(self.factors, rng=SEED)
        # Convert the coordinates from 0 to 1 to coded units, from -1 to 1.
        points_of_cube = 2 * sequence.random(N_POINTS) - 1
        allowed = points_of_cube[self.is_allowed(points_of_cube)]
        if len(allowed) == 0:
            raise ValueError(f"none of {N_POINTS} points of the cube is allowed")
        return allowed

    @cached_property
    def centre(self) -> np.ndarray:
        """An allowed point (factors,) in the middle.

        It is the centre of the cube if that is allowed. Otherwise it is the centroid of
        the allowed region, or the allowed point nearest to the centroid.
        """
        centre = np.zeros(self.factors)
        # `is_allowed` takes an array of points, here with a single one.
        if self.is_allowed(centre[None])[0]:
            return centre
        # `self.points` are spread evenly over the region, so their mean is its centroid.
        centroid = self.points.mean(axis=0)
        if self.is_allowed(centroid[None])[0]:
            return centroid
        # On a logarithmic scale the region may not be convex, so even its centroid may
        # be forbidden. Then use the allowed point that is nearest to it.
        squared_distances = ((self.points - centroid) ** 2).sum(axis=1)
        return self.points[np.argmin(squared_distances)]

    def compute_slack(self, point: np.ndarray) -> np.ndarray:
        """Compute how far a point (factors,) is inside each constraint.

        The result (constraints,) is negative where the point violates a constraint, as
        scipy.optimize requires.
        """
        return -self.excesses(point[None])[0] - CONSTRAINT_MARGIN

    def pull_inside(self, point: np.ndarray) -> np.ndarray:
        """Move a forbidden point (factors,) towards the centre, up to the edge.

        An allowed point is returned unchanged. The edge of the allowed region is found
        by bisection, and the result is always allowed.
        """
        if self.is_allowed(point[None])[0]:
            return point
        # The centre is allowed, so the edge lies between it and the point.
        allowed = self.centre
        forbidden = point
        for _ in range(N_HALVINGS):
            middle = (allowed + forbidden) / 2
            if self.is_allowed(middle[None])[0]:
                allowed = middle
            else:
                forbidden = middle
        return allowed

    def find_nearest(self, point: np.ndarray) -> np.ndarray:
        """Find the allowed point of the cube that is nearest to a point (factors,)."""
        from scipy import optimize

        if self.is_allowed(point[None])[0]:
            return point
        found = optimize.minimize(
            lambda other: ((other - point) ** 2).sum(),
            self.pull_inside(point),
            jac=lambda other: 2 * (other - point),
            constraints={"type": "ineq", "fun": self.compute_slack},
            bounds=[(-1.0, 1.0)] * self.factors,
            method="SLSQP",
            options=SLSQP_OPTIONS,
        )
        return self.pull_inside(found.x)
