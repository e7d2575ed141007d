"""Describe the region that samples cover, and warn of parameter sets beyond it.

A parameter set gets a warning in three cases: if one of its parameters lies at an end
of its range, if the nearest sample is farther away than most samples are from their
nearest neighbour, or if its leverage in a quadratic model is larger than that of any
sample.

  (C79)  Cook 1979, Influential observations in linear regression, J. Am. Stat. Assoc.
         74, 169: leverage
"""

from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.scales import to_coordinates
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table

# A parameter is at a bound if its distance is at most this fraction of its range.
BOUND_FRACTION = 0.01
DISTANCE_QUANTILE = 0.95
MIN_SAMPLES = 2


class Support:
    """The region of the parameters that samples cover.

    Parameters
    ----------
    points : array (n, d)
        Parameter sets of at least two samples.
    low, high : array (d,)
        Ranges of the parameters. A parameter whose low and high are equal is fixed and
        has no effect.
    names : sequence of str
        Names of the d parameters.
    scale : mapping, optional
        Name of the scale of each parameter that is not linear, by name. Distances are
        fractions of the range along the scale.

    Attributes
    ----------
    usual_distance : float
        Distance from the nearest neighbour that most samples do not exceed, in ranges.
        It is the quantile `DISTANCE_QUANTILE` of these distances.
    largest_leverage : float
        Largest leverage of a sample; infinite if there are too few samples for a
        quadratic model.
    """

    def __init__(
        self,
        points: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
        names: Sequence[str],
        scale: Mapping[str, str] | None = None,
    ) -> None:
        """Compute the usual distance between neighbours, and the largest leverage.

        The docstring of the class describes the parameters.

        Raises
        ------
        ValueError
            If `points` is not a table of at least `MIN_SAMPLES` rows.
        """
        from scipy.spatial import cKDTree

        points = np.asarray(points, dtype=float)
        d = len(names)
        if points.ndim != 2 or len(points) < MIN_SAMPLES or points.shape[1] != d:
            raise ValueError(
                f"points has shape {points.shape}; "
                f"expected at least {MIN_SAMPLES} rows of {d} numbers"
            )
        # Set the ranges first: `_scale_to_ranges` and `leverage` use them.
        self.names = tuple(names)
        self.scale = dict(scale or {})
        ends = np.array([low, high], dtype=float)
        self.low, self.high = to_coordinates(ends, self.names, self.scale)
        self._is_free = self.high > self.low
        unit = self._scale_to_ranges(points)
        self.tree = cKDTree(unit)
        # The nearest sample of each sample is itself, so use the second nearest.
        two_distances, _ = self.tree.query(unit, k=2)
        neighbour_distances = two_distances[:, 1]
        self.usual_distance = float(np.quantile(neighbour_distances, DISTANCE_QUANTILE))
        # If there are too few samples for a quadratic model, no leverage is too large.
        # `leverage` uses `_inverse_R`, so set it first.
        self._inverse_R = _compute_inverse_R(compute_quadratic_terms(unit))
        self.largest_leverage = np.inf
        if self._inverse_R is not None:
            self.largest_leverage = float(self.leverage(points).max())

    @classmethod
    def from_space(cls, points: np.ndarray, space: ParameterSpace) -> Self:
        """Make the support of parameter sets (n, p) of a study."""
        low, high = space.add_fixed_values(np.array([space.low, space.high]))
        return cls(points, low, high, space.names, space.scale)

    @classmethod
    def from_dataset(cls, dataset_csv: StrPath, space: ParameterSpace) -> Self:
        """Make the support of the usable samples in a study's dataset.csv.

        Raises
        ------
        InputError
            If the file is invalid, or has fewer than two usable samples.
        """
        table = read_table(dataset_csv, ("sample", *space.names, "status"))
        usable = table[table["status"] == "ok"]
        if len(usable) < MIN_SAMPLES:
            raise InputError(
                source=dataset_csv,
                key="usable samples",
                value=len(usable),
                allowed=f"at least {MIN_SAMPLES} with status ok",
            )
        return cls.from_space(usable[list(space.names)].to_numpy(float), space)

    def at_bounds(self, points: np.ndarray) -> np.ndarray:
        """Mark the parameters (m, d) of points that lie at an end of their range.

        A fixed parameter is never marked.
        """
        unit = self._scale_to_ranges(points)
        is_at_bound = np.zeros((len(unit), len(self.names)), dtype=bool)
        is_at_bound[:, self._is_free] = (unit <= BOUND_FRACTION) | (
            unit >= 1 - BOUND_FRACTION
        )
        return is_at_bound

    def is_at_end_without_samples(self, points: np.ndarray) -> np.ndarray:
        """Mark the points that have a parameter at an end without samples.

        An end is the lower or the upper limit of a parameter's range. It has no samples
        if no sample has a value of the parameter near this limit.

        Parameters
        ----------
        points : array (m, d)
            Parameter sets.

        Returns
        -------
        array of bool (m,)
            Whether a parameter of the point is at such an end.
        """
        # The points and the samples of the tree are scaled to their ranges, whose ends
        # are 0 and 1.
        unit = self._scale_to_ranges(points)
        samples = self.tree.data
        is_marked = np.zeros(len(unit), dtype=bool)
        for end in (0.0, 1.0):
            has_samples = (np.abs(samples - end) <= BOUND_FRACTION).any(axis=0)
            is_at_end = np.abs(unit - end) <= BOUND_FRACTION
            is_marked |= (is_at_end & ~has_samples).any(axis=1)
        return is_marked

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Compute the distance (m,) of points to their nearest sample, in ranges."""
        distances, _ = self.tree.query(self._scale_to_ranges(points))
        return distances

    def leverage(self, points: np.ndarray) -> np.ndarray:
        """Compute the leverage (m,) of points in a quadratic model (C79).

        The model is fitted to the samples. The leverage is 0 with too few samples for
        such a model.
        """
        if self._inverse_R is None:
            return np.zeros(len(points))
        terms = compute_quadratic_terms(self._scale_to_ranges(points))
        return ((terms @ self._inverse_R) ** 2).sum(axis=1)

    def is_sparse(self, points: np.ndarray) -> np.ndarray:
        """Mark the points (m,) that lie where samples are sparse (`excess`)."""
        return self.excess(points) > 0

    def excess(self, points: np.ndarray) -> np.ndarray:
        """Measure how far points (m, d) lie outside the region of the samples, (m,).

        The excess is the distance above `usual_distance` plus the leverage above
        `largest_leverage`. It is 0 inside the region.
        """
        distance = np.maximum(self.distance(points) - self.usual_distance, 0.0)
        leverage = np.maximum(self.leverage(points) - self.largest_leverage, 0.0)
        return distance + leverage

    def make_warnings(self, points: np.ndarray) -> list[str]:
        """Make a warning for each point that is at a bound or far from the samples.

        Parameters
        ----------
        points : array (m, d)
            Parameter sets.

        Returns
        -------
        list of str
            A text for each point, with all reasons for the warning. The text is empty
            for a point without a warning.
        """
        points = np.atleast_2d(np.asarray(points, dtype=float))
        coordinates = to_coordinates(points, self.names, self.scale)
        is_at_bound = self.at_bounds(points)  # (m, d)
        distances = self.distance(points)
        leverages = self.leverage(points)
        descriptions = []
        for k in range(len(points)):
            reasons = []
            if is_at_bound[k].any():
                reasons.append(self._describe_bounds(coordinates[k], is_at_bound[k]))
            if distances[k] > self.usual_distance:
                reasons.append(
                    f"nearest sample {distances[k]:.2f} of a range away, "
                    f"usually at most {self.usual_distance:.2f}"
                )
            if leverages[k] > self.largest_leverage:
                reasons.append(
                    f"leverage {leverages[k]:.2f}, "
                    f"samples' largest {self.largest_leverage:.2f}"
                )
            descriptions.append("; ".join(reasons))
        return descriptions

    def _describe_bounds(self, point: np.ndarray, is_at_bound: np.ndarray) -> str:
        """Name the parameters of a point (d,) that are at a bound, and the bounds.

        The point is in the coordinates of the scales.
        """
        bounds = []
        for i in np.flatnonzero(is_at_bound):
            is_low = point[i] < (self.low[i] + self.high[i]) / 2
            bounds.append(f"{self.names[i]} {'low' if is_low else 'high'}")
        return f"at a bound: {', '.join(bounds)}"

    def _scale_to_ranges(self, points: np.ndarray) -> np.ndarray:
        """Scale the free parameters of points (m, d) to their ranges."""
        values = np.asarray(points, dtype=float)
        coordinates = to_coordinates(values, self.names, self.scale)
        offsets = (coordinates - self.low)[:, self._is_free]
        return offsets / (self.high - self.low)[self._is_free]


def _compute_inverse_R(terms: np.ndarray) -> np.ndarray | None:
    """Compute R^-1, with which the leverage of a row a of terms is |a R^-1|^2.

    R comes from the QR decomposition of the terms of the samples. The result is None if
    the samples do not determine the quadratic model. It is also None if there are as
    many coefficients as samples, because every sample then has leverage 1, which says
    nothing.
    """
    n_samples, n_terms = terms.shape
    if n_samples <= n_terms or np.linalg.matrix_rank(terms) < n_terms:
        return None
    return np.linalg.inv(np.linalg.qr(terms, mode="r"))


def compute_quadratic_terms(unit: np.ndarray) -> np.ndarray:
    """Compute the terms of a quadratic model at points (m, d) of the unit cube.

    The terms (m, (d + 1)(d + 2) / 2) are 1, x_i and x_i x_j with the centred points
    x = 2 unit - 1.
    """
    x = np.column_stack([np.ones(len(unit)), 2 * unit - 1])
    i, j = np.triu_indices(x.shape[1])
    return x[:, i] * x[:, j]
