"""Where a surrogate is asked beyond its data: parameter sets at a bound, or where samples are thin.

A solution is told of when a parameter lies within 1 % of its range from an end, when the nearest sample is
farther away than most samples are from theirs, or when it lies outside the cloud of samples as a quadratic model
sees it (Cook 1979, Influential observations in linear regression, J. Am. Stat. Assoc. 74, 169: leverage).
"""

import numpy as np
from scipy.spatial import cKDTree

from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS

BOUND_SHARE = 0.01
DISTANCE_QUANTILE = 0.95


class Support:
    """What a set of samples covers.

    points (n, d): parameters of the samples; low, high (d,): the ranges; names (d,). Raises ValueError for other
    shapes or fewer than two samples.
    """

    def __init__(self, points, low, high, names=PARAMETERS):
        points = np.asarray(points, dtype=float)
        self.low, self.high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        self.names = tuple(names)
        if points.ndim != 2 or len(points) < 2 or points.shape[1] != len(self.names):
            allowed = f"at least two rows of {len(self.names)}"
            raise ValueError(f"points has shape {points.shape}; allowed: {allowed}")
        unit = self._unit(points)
        self.tree = cKDTree(unit)
        left_out = self.tree.query(unit, k=2)[0][:, 1]  # the nearest one besides itself
        self.farthest = float(np.quantile(left_out, DISTANCE_QUANTILE))
        terms = quadratic_terms(unit)
        self.root, self.largest_leverage = None, np.inf
        # with as many coefficients as samples every sample has leverage 1, which tells nothing
        if len(terms) > terms.shape[1] and np.linalg.matrix_rank(terms) == terms.shape[1]:
            self.root = np.linalg.inv(np.linalg.qr(terms, mode="r"))
            self.largest_leverage = float(self._leverage(unit).max())

    @classmethod
    def of_dataset(cls, dataset_csv, ranges):
        """The support of a study's usable samples; ranges: parameter to (low, high). Raises InputError."""
        table = read_table(dataset_csv, ("sample", *PARAMETERS, "status"))
        usable = table[table["status"] == "ok"]
        if len(usable) < 2:
            raise InputError(dataset_csv, "usable samples", len(usable), "at least 2 with status ok")
        low, high = np.array([ranges[name] for name in PARAMETERS], dtype=float).T
        return cls(usable[list(PARAMETERS)].to_numpy(float), low, high)

    def at_bounds(self, points):
        """Which parameters of points (m, d) lie within 1 % of their range from an end, (m, d)."""
        unit = self._unit(points)
        return (unit <= BOUND_SHARE) | (unit >= 1 - BOUND_SHARE)

    def distance(self, points):
        """Distance (m,) of points (m, d) to the nearest sample, in ranges."""
        return self.tree.query(self._unit(points))[0]

    def leverage(self, points):
        """Leverage (m,) of points (m, d) in a quadratic model of the samples; zeros where they bear none."""
        return self._leverage(self._unit(points))

    def is_thin(self, points):
        """Whether points (m, d) lie where samples are thin, (m,)."""
        return (self.distance(points) > self.farthest) | (self.leverage(points) > self.largest_leverage)

    def warnings(self, points):
        """What there is to say of each of points (m, d): a list of texts, empty where nothing is."""
        points = np.atleast_2d(np.asarray(points, dtype=float))
        bounds, unit = self.at_bounds(points), self._unit(points)
        distance, leverage = self.distance(points), self.leverage(points)
        texts = []
        for k in range(len(points)):
            parts = []
            if bounds[k].any():
                ends = [
                    f"{name} {'low' if unit[k, i] < 0.5 else 'high'}"
                    for i, name in enumerate(self.names)
                    if bounds[k, i]
                ]
                parts.append(f"at a bound: {', '.join(ends)}")
            if distance[k] > self.farthest:
                parts.append(
                    f"nearest sample {distance[k]:.2f} of a range away, usual up to {self.farthest:.2f}"
                )
            if leverage[k] > self.largest_leverage:
                parts.append(f"leverage {leverage[k]:.2f}, samples' largest {self.largest_leverage:.2f}")
            texts.append("; ".join(parts))
        return texts

    def _unit(self, points):
        return (np.asarray(points, dtype=float) - self.low) / (self.high - self.low)

    def _leverage(self, unit):
        if self.root is None:
            return np.zeros(len(unit))
        return ((quadratic_terms(unit) @ self.root) ** 2).sum(axis=1)


def quadratic_terms(unit):
    """1, x_i and x_i x_j of points (m, d) in the unit cube, centred: (m, (d + 1)(d + 2) / 2)."""
    x = np.column_stack([np.ones(len(unit)), 2 * unit - 1])
    i, j = np.triu_indices(x.shape[1])
    return x[:, i] * x[:, j]
