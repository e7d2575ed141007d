"""Warnings where a surrogate is used beyond its data: parameter sets at a bound, or where samples are thin.

A parameter set gets a warning when a parameter lies within 1 % of its range from an end, when the nearest sample is
farther away than most samples are from their nearest neighbour, or when its leverage in a quadratic model is larger
than every sample's.

  (C79)  Cook 1979, Influential observations in linear regression, J. Am. Stat. Assoc. 74, 169: leverage
"""

from collections.abc import Sequence
from typing import Self

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.common.errors import require
from repose.common.files import Path_, read_table

BOUND_SHARE = 0.01
DISTANCE_QUANTILE = 0.95


class Support:
    """The region that samples cover; a parameter whose low and high (d,) are equal is fixed and plays no part."""

    def __init__(
        self,
        points: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
        names: Sequence[str],
    ) -> None:
        from scipy.spatial import cKDTree

        points = np.asarray(points, dtype=float)
        self.low, self.high = (
            np.asarray(low, dtype=float),
            np.asarray(high, dtype=float),
        )
        self.names = tuple(names)
        self._free = self.high > self.low
        if points.ndim != 2 or len(points) < 2 or points.shape[1] != len(self.names):
            raise ValueError(
                f"points has shape {points.shape}; expected at least two rows of {len(self.names)}"
            )
        unit = self._unit(points)
        self.tree = cKDTree(unit)
        left_out = self.tree.query(unit, k=2)[0][:, 1]  # the nearest one besides itself
        self.farthest = float(np.quantile(left_out, DISTANCE_QUANTILE))  # in ranges
        terms = quadratic_terms(unit)
        self.root, self.largest_leverage = None, np.inf
        # with as many coefficients as samples every sample has leverage 1, which is no information
        if (
            len(terms) > terms.shape[1]
            and np.linalg.matrix_rank(terms) == terms.shape[1]
        ):
            self.root = np.linalg.inv(np.linalg.qr(terms, mode="r"))
            self.largest_leverage = float(self.leverage(points).max())

    @classmethod
    def of(cls, points: np.ndarray, space: ParameterSpace) -> Self:
        """Find the support of parameter sets (n, p)."""
        low, high = space.complete(np.array([space.low, space.high]))
        return cls(points, low, high, space.names)

    @classmethod
    def of_dataset(cls, dataset_csv: Path_, space: ParameterSpace) -> Self:
        """Make the support of the usable samples of a study; InputError for a bad file, or fewer than two of them."""
        table = read_table(dataset_csv, ("sample", *space.names, "status"))
        usable = table[table["status"] == "ok"]
        require(
            len(usable) >= 2,
            dataset_csv,
            "usable samples",
            len(usable),
            "at least 2 with status ok",
        )
        return cls.of(usable[list(space.names)].to_numpy(float), space)

    def at_bounds(self, points: np.ndarray) -> np.ndarray:
        """Tell whether each parameter of the points (m, d) is free and lies within 1 % of its range from an end."""
        unit = self._unit(points)
        reached = np.zeros((len(unit), len(self.names)), dtype=bool)
        reached[:, self._free] = (unit <= BOUND_SHARE) | (unit >= 1 - BOUND_SHARE)
        return reached

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Measure the distance of each point to the nearest sample, in ranges."""
        return self.tree.query(self._unit(points))[0]

    def leverage(self, points: np.ndarray) -> np.ndarray:
        """Compute the leverage in a quadratic model of the samples (C79); 0 with too few samples for such a model."""
        if self.root is None:
            return np.zeros(len(points))
        return ((quadratic_terms(self._unit(points)) @ self.root) ** 2).sum(axis=1)

    def is_thin(self, points: np.ndarray) -> np.ndarray:
        """Tell whether points lie where samples are thin."""
        return (self.distance(points) > self.farthest) | (
            self.leverage(points) > self.largest_leverage
        )

    def warnings(self, points: np.ndarray) -> list[str]:
        """Write a warning for each point; empty where there is none."""
        points = np.atleast_2d(np.asarray(points, dtype=float))
        ends = np.where(points < (self.low + self.high) / 2, "low", "high")
        texts = []
        columns = (
            self.at_bounds(points),
            ends,
            self.distance(points),
            self.leverage(points),
        )
        for at, end, distance, leverage in zip(*columns, strict=True):
            bounds = [f"{self.names[i]} {end[i]}" for i in np.flatnonzero(at)]
            parts = [f"at a bound: {', '.join(bounds)}"] if bounds else []
            if distance > self.farthest:
                parts.append(
                    f"nearest sample {distance:.2f} of a range away, usual up to {self.farthest:.2f}"
                )
            if leverage > self.largest_leverage:
                parts.append(
                    f"leverage {leverage:.2f}, samples' largest {self.largest_leverage:.2f}"
                )
            texts.append("; ".join(parts))
        return texts

    def _unit(self, points: np.ndarray) -> np.ndarray:
        """Scale the free parameters to their ranges."""
        return (
            ((np.asarray(points, dtype=float) - self.low)[:, self._free])
            / (self.high - self.low)[self._free]
        )


def quadratic_terms(unit: np.ndarray) -> np.ndarray:
    """Compute the terms of a quadratic model, (m, (d + 1)(d + 2) / 2): 1, x_i and x_i x_j of the centred points."""
    x = np.column_stack([np.ones(len(unit)), 2 * unit - 1])
    i, j = np.triu_indices(x.shape[1])
    return x[:, i] * x[:, j]
