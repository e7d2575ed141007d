"""The parameters of a study: ranges of the free parameters, fixed values, priors.

A point of the unit cube has a coordinate from 0 to 1 for each free parameter, evenly
along its scale. Everything that searches or models the parameters works there.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from repose.calibrate.constraints import Constraint
from repose.calibrate.scales import LINEAR, LOG, SCALES, to_coordinates, to_values

# If a parameter has a prior without a range, its range reaches this many standard
# deviations of the prior to each side of the mean.
PRIOR_HALF_WIDTH_SDS = 3.0
# Number of points with which the allowed fraction of the ranges or the prior is
# estimated.
N_SPREAD_POINTS = 2**13

Limits = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class ParameterSpace:
    """The parameters of a study, of which the d free ones are searched.

    A prior is a normal distribution that is cut to the range.

    Attributes
    ----------
    free : tuple of str
        Names of the free parameters, in the order of `names`.
    low, high : numpy.ndarray, (d,)
        Ends of their ranges.
    fixed : dict
        Values of the other parameters by name.
    prior : dict
        Mean and standard deviation of each parameter with a prior, by name.
    names : tuple of str
        All parameters, in the order of all tables; by default the free ones.
    scale : dict
        Name of the scale of each free parameter that is not linear, by name.
    constraints : tuple of Constraint
        Inequalities that every proposed parameter set obeys.
    """

    free: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    fixed: dict[str, float] = field(default_factory=dict)
    prior: dict[str, tuple[float, float]] = field(default_factory=dict)
    names: tuple[str, ...] = ()
    scale: dict[str, str] = field(default_factory=dict)
    constraints: tuple[Constraint, ...] = ()

    def __post_init__(self) -> None:
        if not self.names:
            object.__setattr__(self, "names", (*self.free, *self.fixed))

    @classmethod
    def of(
        cls,
        section: Mapping[str, Any],
        names: Sequence[str] | None = None,
        limits: Limits | None = None,
        constraints: Sequence[str] | None = None,
    ) -> "ParameterSpace":
        """Make the space from the section `parameters` of a checked configuration.

        Parameters
        ----------
        section : mapping
            For each parameter a range, a fixed value, a range with a scale, or a prior
            with or without a range.
        names : sequence of str, optional
            The parameters to read, in this order. By default (None) these are all of
            the section.
        limits : mapping, optional
            Lowest and highest possible value by name. A range that follows from a prior
            is cut to them. A parameter that is not named has no limits.
        constraints : sequence of str, optional
            The key `constraints` of the configuration. An item is a string such as
            "mur <= 0.5 * mus".

        Returns
        -------
        ParameterSpace
        """
        if names is None:
            names = tuple(section)
        ranges: dict[str, tuple[float, float]] = {}  # only of the free parameters
        fixed: dict[str, float] = {}
        prior: dict[str, tuple[float, float]] = {}  # mean and standard deviation
        scale: dict[str, str] = {}
        for name in names:
            entry = section[name]
            # A fixed parameter has no range, no scale and no prior.
            if isinstance(entry, Mapping) and "fixed" in entry:
                fixed[name] = float(entry["fixed"])
                continue
            ranges[name] = find_range(name, entry, limits)
            if get_scale(entry) != LINEAR:
                scale[name] = get_scale(entry)
            if isinstance(entry, Mapping) and "prior" in entry:
                mean = float(entry["prior"]["mean"])
                sd = float(entry["prior"]["sd"])
                prior[name] = (mean, sd)
        space = cls(
            free=tuple(ranges),
            low=np.array([low for low, _ in ranges.values()]),
            high=np.array([high for _, high in ranges.values()]),
            fixed=fixed,
            prior=prior,
            names=tuple(names),
            scale=scale,
        )
        return space.with_constraints(constraints)

    def with_constraints(self, texts: Sequence[str] | None) -> "ParameterSpace":
        """Return a copy with the constraints of the key `constraints`.

        `texts` are the constraints as the user wrote them, or None if there are none.
        """
        constraints = tuple(Constraint.parse(text, self.names) for text in texts or ())
        return replace(self, constraints=constraints)

    @property
    def dimensions(self) -> int:
        """Number d of free parameters."""
        return len(self.free)

    @property
    def centre(self) -> dict[str, float]:
        """Centre of each parameter's range on its scale, or its fixed value."""
        known = dict(self.fixed)
        for name, low, high in zip(
            self.free, self.low.tolist(), self.high.tolist(), strict=True
        ):
            if name in self.scale:
                middle = float(self.values_at(name, np.array(0.5)))
                known[name] = float(f"{middle:.12g}")
            else:
                known[name] = round((low + high) / 2, 12)
        return {name: known[name] for name in self.names}

    @property
    def coordinate_ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Ends (d,) of the ranges in the coordinates of their scales."""
        low, high = to_coordinates(
            np.array([self.low, self.high]), self.free, self.scale
        )
        return low, high

    def coordinates(self, name: str, values: np.ndarray) -> np.ndarray:
        """Convert values of a free parameter to coordinates along its scale."""
        return SCALES[self.scale.get(name, LINEAR)].forward(np.asarray(values))

    def shares(self, name: str, values: np.ndarray) -> np.ndarray:
        """Compute the positions of values of a free parameter within its range.

        A fraction is 0 at the lower end and 1 at the upper end, and linear in between
        along the scale.
        """
        low, high = self._coordinate_ends_of(name)
        return (self.coordinates(name, values) - low) / (high - low)

    def values_at(self, name: str, shares: np.ndarray) -> np.ndarray:
        """Compute the values of a free parameter at fractions of its range, from 0 to 1.

        This is the inverse of `shares`.
        """
        low, high = self._coordinate_ends_of(name)
        coordinates = low + shares * (high - low)
        if name not in self.scale:
            return coordinates
        # Rounding must not move a value out of its range.
        k = self.free.index(name)
        values = SCALES[self.scale[name]].backward(coordinates)
        return np.clip(values, self.low[k], self.high[k])

    def _coordinate_ends_of(self, name: str) -> tuple[float, float]:
        """Return the ends of the range of a free parameter, in its coordinates."""
        k = self.free.index(name)
        low, high = self.coordinate_ends
        return low[k], high[k]

    def values(self, unit: np.ndarray) -> np.ndarray:
        """Turn points (n, d) of the unit cube into parameter sets (n, names)."""
        return self.complete(self.free_values(unit))

    def free_values(self, unit: np.ndarray) -> np.ndarray:
        """Turn points (n, d) of the unit cube into values (n, d) of the free parameters."""
        points = np.atleast_2d(np.asarray(unit, dtype=float))
        low, high = self.coordinate_ends
        return self.from_coordinates(low + points * (high - low))

    def from_coordinates(self, coordinates: np.ndarray) -> np.ndarray:
        """Turn coordinates (n, d) of the free parameters' scales into values (n, d)."""
        if not self.scale:
            return coordinates
        # Rounding must not move a value out of its range.
        values = to_values(coordinates, self.free, self.scale)
        return np.clip(values, self.low, self.high)

    def complete(self, values: np.ndarray) -> np.ndarray:
        """Add the fixed values to values (n, d) of the free parameters.

        The result (n, names) has a column for each parameter.
        """
        values = np.atleast_2d(np.asarray(values, dtype=float))
        columns = []
        for name in self.names:
            if name in self.fixed:
                columns.append(np.full(len(values), self.fixed[name]))
            else:
                columns.append(values[:, self.free.index(name)])
        return np.column_stack(columns)

    def unit(self, values: np.ndarray) -> np.ndarray:
        """Turn parameter sets (n, names) into points (n, d) of the unit cube."""
        values = np.atleast_2d(np.asarray(values, dtype=float))
        columns = [self.names.index(name) for name in self.free]
        low, high = self.coordinate_ends
        coordinates = to_coordinates(values[:, columns], self.free, self.scale)
        return (coordinates - low) / (high - low)

    def is_allowed(self, unit: np.ndarray) -> np.ndarray:
        """Mark the points (n, d) of the unit cube that obey all constraints."""
        return self.violation(unit) <= 0

    def violation(self, unit: np.ndarray) -> np.ndarray:
        """Compute by how much points of the unit cube violate the constraints.

        Parameters
        ----------
        unit : numpy.ndarray, (n, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (n,)
            The sum of the excesses, each as a fraction of the largest that the ranges
            allow. It is 0 where all constraints are obeyed.
        """
        total = np.zeros(len(unit))
        for excess in self.excesses(unit).T:
            total += np.maximum(excess, 0.0)
        return total

    def excesses(self, unit: np.ndarray) -> np.ndarray:
        """Compute by how much points of the unit cube exceed each constraint.

        Parameters
        ----------
        unit : numpy.ndarray, (n, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (n, constraints)
            An excess is above 0 where the constraint is violated. It is a fraction of
            the largest excess that the ranges allow.
        """
        if not self.constraints:
            return np.zeros((len(unit), 0))
        values = self.values(unit)
        # Divide each excess by its upper limit, so that the excesses of constraints
        # with different units can be compared.
        low, high = self.complete(np.array([self.low, self.high]))
        largest_values = np.maximum(np.abs(low), np.abs(high))[None]
        columns = []
        for constraint in self.constraints:
            excess = constraint.compute_excess(values, self.names)
            largest_excess = constraint.compute_largest_excess(
                largest_values, self.names
            )
            columns.append(excess / largest_excess)
        return np.column_stack(columns)

    @cached_property
    def _spread(self) -> np.ndarray:
        """Points (n, d) that are evenly spread over the unit cube."""
        from scipy.stats import qmc

        sequence = qmc.Sobol(self.dimensions, scramble=False)
        return sequence.random(N_SPREAD_POINTS) + 0.5 / N_SPREAD_POINTS

    @cached_property
    def _allowed_prior(self) -> np.ndarray:
        """Points (n, d) of the prior that the constraints allow."""
        points = self.from_prior(self._spread)
        return points[self.is_allowed(points)]

    @cached_property
    def allowed_fraction(self) -> float:
        """Share of the ranges or of the prior that the constraints allow.

        It is the smaller of the two fractions.
        """
        if not self.constraints:
            return 1.0
        fraction_of_ranges = float(self.is_allowed(self._spread).mean())
        return min(fraction_of_ranges, len(self._allowed_prior) / N_SPREAD_POINTS)

    def log_prior(self, unit: np.ndarray) -> np.ndarray:
        """Compute the logarithm of the prior density at points of the unit cube.

        The constant of normalisation is left out, so a parameter without a prior adds
        0. A prior is a normal density of the value of the parameter.

        Parameters
        ----------
        unit : numpy.ndarray, (n, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (n,)
            -inf where a constraint is violated.
        """
        total = np.zeros(len(unit))
        if self.constraints:
            total[~self.is_allowed(unit)] = -np.inf
        for name, (mean, sd) in self.prior.items():
            value = self.values_at(name, unit[:, self.free.index(name)])
            total -= 0.5 * ((value - mean) / sd) ** 2
            # The coordinate is then log(value). As d value = value d log(value), its
            # density is the density of the value times the value.
            if self.scale.get(name) == LOG:
                total += np.log(value)
        return total

    def prior_cdf(self, unit: np.ndarray) -> np.ndarray:
        """Compute the distribution function (n, d) of each parameter's prior.

        `unit` are points (n, d) of the unit cube; without a prior the distribution is
        uniform along the scale. Constraints do not enter (`marginal_cdf`).
        """
        from scipy import stats

        share = np.array(unit, dtype=float)
        for name, (mean, sd) in self.prior.items():
            k = self.free.index(name)
            value = self.values_at(name, share[:, k])
            share[:, k] = stats.truncnorm.cdf(
                (value - mean) / sd,
                (self.low[k] - mean) / sd,
                (self.high[k] - mean) / sd,
            )
        return share

    def marginal_cdf(self, unit: np.ndarray) -> np.ndarray:
        """Compute the prior distribution function of each parameter, with constraints.

        At a point, it is the probability that a parameter is smaller, among the
        parameter sets that obey the constraints. It is estimated as the fraction of
        many draws from the prior. Without constraints, it is the result of `prior_cdf`.

        Parameters
        ----------
        unit : numpy.ndarray, (n, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (n, d)
            Numbers from 0 to 1.
        """
        unconstrained = self.prior_cdf(unit)
        if not self.constraints:
            return unconstrained
        draws = np.sort(self.prior_cdf(self._allowed_prior), axis=0)
        fraction_of_smaller_draws = (np.arange(len(draws)) + 0.5) / len(draws)
        # Interpolate between the draws. At the ends of the range the result is 0 and 1.
        columns = [
            np.interp(
                unconstrained[:, k],
                [0.0, *draws[:, k], 1.0],
                [0.0, *fraction_of_smaller_draws, 1.0],
            )
            for k in range(self.dimensions)
        ]
        return np.column_stack(columns)

    def marginal_quantiles(self, shares: np.ndarray) -> np.ndarray:
        """Compute the quantiles (n, d) of the allowed prior at probabilities (n,)."""
        values = self.free_values(self._allowed_prior)
        return np.quantile(values, shares, axis=0)

    def from_prior(self, share: np.ndarray) -> np.ndarray:
        """Move uniform points (n, d) of the unit cube to the distribution of the priors."""
        from scipy import stats

        unit = np.array(share, dtype=float)
        for name, (mean, sd) in self.prior.items():
            k = self.free.index(name)
            value = mean + sd * stats.truncnorm.ppf(
                unit[:, k], (self.low[k] - mean) / sd, (self.high[k] - mean) / sd
            )
            unit[:, k] = self.shares(name, value)
        return unit


def get_scale(entry: Any) -> str:
    """Return the name of the scale of an entry in the section `parameters`."""
    if not isinstance(entry, Mapping):
        return LINEAR
    name: str = entry.get("scale", LINEAR)
    return name


def find_range(
    name: str, entry: Any, limits: Limits | None = None
) -> tuple[float, float]:
    """Find the range of a parameter from its entry in the section `parameters`.

    Parameters
    ----------
    name : str
        Name of the parameter.
    entry : pair or mapping
        The entry.
    limits : mapping, optional
        Lowest and highest possible value by name. A range that follows from a prior is
        cut to them.

    Returns
    -------
    pair of float
        Lowest and highest value. For a fixed parameter, both are its value.
    """
    if not isinstance(entry, Mapping):
        return float(entry[0]), float(entry[1])
    if "fixed" in entry:
        return float(entry["fixed"]), float(entry["fixed"])
    if "range" in entry:
        return float(entry["range"][0]), float(entry["range"][1])

    # The entry is a prior without a range, so choose the range from the prior.
    mean = entry["prior"]["mean"]
    half_width = PRIOR_HALF_WIDTH_SDS * entry["prior"]["sd"]
    lowest, highest = (limits or {}).get(name, (-math.inf, math.inf))
    low = max(lowest, mean - half_width)
    high = min(highest, mean + half_width)
    return float(low), float(high)
