"""The parameters of a study: ranges of the free parameters, fixed values, priors.

A point of the unit cube has a number from 0 to 1 for each free parameter: 0 stands for
the lower end of its range, 1 for the upper end, evenly along its scale. Everything that
searches or models the parameters works there.

The coordinate of a parameter is its value or, on a logarithmic scale, the logarithm of
its value.
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
            Lowest and highest possible value by name. They cut the range of a parameter
            that has a prior but no range. A parameter that is not named has no limits.
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
            scale_name = get_scale(entry)
            if scale_name != LINEAR:
                scale[name] = scale_name
            if isinstance(entry, Mapping) and "prior" in entry:
                mean = float(entry["prior"]["mean"])
                sd = float(entry["prior"]["sd"])
                prior[name] = (mean, sd)
        # The free parameters keep the order of `names`, in which they were added.
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
        """Value of each parameter in the middle of its range, or its fixed value.

        On a logarithmic scale, the middle is the geometric mean of both ends. The
        values are rounded, so that rounding errors such as 0.30000000000000004 do not
        appear in files: to 12 digits on a logarithmic scale, whose values may be very
        small, and else to 12 decimal places.
        """
        centre = dict(self.fixed)
        for name, low, high in zip(
            self.free, self.low.tolist(), self.high.tolist(), strict=True
        ):
            # `scale` only has the parameters whose scale is not linear.
            if name in self.scale:
                middle = float(self.values_at(name, np.array(0.5)))
                centre[name] = float(f"{middle:.12g}")
            else:
                centre[name] = round((low + high) / 2, 12)
        return {name: centre[name] for name in self.names}

    @property
    def coordinate_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends (d,) of the ranges of the free parameters, as coordinates."""
        low, high = to_coordinates(
            np.array([self.low, self.high]), self.free, self.scale
        )
        return low, high

    def coordinates(self, name: str, values: np.ndarray) -> np.ndarray:
        """Convert values of a free parameter to coordinates, such as logarithms."""
        return SCALES[self.scale.get(name, LINEAR)].forward(np.asarray(values))

    def fractions_of_range(self, name: str, values: np.ndarray) -> np.ndarray:
        """Compute where values of a free parameter lie within its range.

        A fraction is 0 at the lower end and 1 at the upper end, and linear in between
        along the scale.
        """
        low, high = self._get_coordinate_bounds(name)
        return (self.coordinates(name, values) - low) / (high - low)

    def values_at(self, name: str, fractions: np.ndarray) -> np.ndarray:
        """Compute the values of a free parameter at fractions of its range, from 0 to 1.

        This is the inverse of `fractions_of_range`.
        """
        low, high = self._get_coordinate_bounds(name)
        coordinates = low + fractions * (high - low)
        if name not in self.scale:
            # On a linear scale, coordinates are values.
            return coordinates
        values = SCALES[self.scale[name]].backward(coordinates)
        # Converting the ends to coordinates and back may change their last digit. This
        # must not move a value out of its range.
        k = self.free.index(name)
        return np.clip(values, self.low[k], self.high[k])

    def _get_coordinate_bounds(self, name: str) -> tuple[float, float]:
        """Return both ends of the range of a free parameter, as coordinates."""
        k = self.free.index(name)
        low, high = self.coordinate_bounds
        return low[k], high[k]

    def values(self, unit: np.ndarray) -> np.ndarray:
        """Turn points (n, d) of the unit cube into parameter sets (n, names)."""
        return self.add_fixed_values(self.free_values(unit))

    def free_values(self, unit: np.ndarray) -> np.ndarray:
        """Turn points (n, d) of the unit cube into values (n, d) of the free parameters."""
        points = np.atleast_2d(np.asarray(unit, dtype=float))
        low, high = self.coordinate_bounds
        return self.from_coordinates(low + points * (high - low))

    def from_coordinates(self, coordinates: np.ndarray) -> np.ndarray:
        """Turn coordinates (n, d) of the free parameters into values (n, d)."""
        if not self.scale:
            return coordinates
        values = to_values(coordinates, self.free, self.scale)
        # Converting the ends to coordinates and back may change their last digit. This
        # must not move a value out of its range.
        return np.clip(values, self.low, self.high)

    def add_fixed_values(self, values: np.ndarray) -> np.ndarray:
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
        low, high = self.coordinate_bounds
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
        for excess in self.compute_excesses(unit).T:
            total += np.maximum(excess, 0.0)
        return total

    def compute_excesses(self, unit: np.ndarray) -> np.ndarray:
        """Compute by how much points of the unit cube violate each constraint.

        Parameters
        ----------
        unit : numpy.ndarray, (n, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (n, constraints)
            Difference between both sides of a constraint, above 0 where it is violated.
            It is divided by an upper limit of its size within the ranges.
        """
        if not self.constraints:
            return np.zeros((len(unit), 0))
        values = self.values(unit)
        # Divide each excess by an upper limit of its size, so that the excesses of
        # constraints with different units can be compared. The limit follows from the
        # largest absolute value of each parameter, fixed ones included. It has the
        # shape (1, names), because constraints take a table of parameter sets.
        low, high = self.add_fixed_values(np.array([self.low, self.high]))
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
        """Draws (n, d) from the prior that the constraints allow.

        They are points of the unit cube, spread evenly in the probability of the prior,
        and the same in each call.
        """
        points = self.transform_to_prior(self._spread)
        return points[self.is_allowed(points)]

    @cached_property
    def allowed_fraction(self) -> float:
        """Fraction of the ranges or of the prior that the constraints allow.

        It is the smaller of the two fractions.
        """
        if not self.constraints:
            return 1.0
        fraction_of_ranges = float(self.is_allowed(self._spread).mean())
        return min(fraction_of_ranges, len(self._allowed_prior) / N_SPREAD_POINTS)

    def log_prior(self, unit: np.ndarray) -> np.ndarray:
        """Compute the logarithm of the prior density at points of the unit cube.

        A prior is a normal density of the value of the parameter. The normalising
        constant is left out, so a parameter without a prior adds 0.

        Parameters
        ----------
        unit : numpy.ndarray, (n, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (n,)
            The log density; -inf where a constraint is violated.
        """
        total = np.zeros(len(unit))
        if self.constraints:
            total[~self.is_allowed(unit)] = -np.inf
        for name, (mean, sd) in self.prior.items():
            value = self.values_at(name, unit[:, self.free.index(name)])
            total -= 0.5 * ((value - mean) / sd) ** 2
            # On a logarithmic scale, points are uniform in log(value). The density of
            # log(value) is the density of the value, times the derivative of the value
            # with respect to log(value), which is the value itself.
            if self.scale.get(name) == LOG:
                total += np.log(value)
        return total

    def prior_cdf(self, unit: np.ndarray) -> np.ndarray:
        """Compute the cumulative distribution function of each parameter's prior.

        A prior is a normal distribution, truncated to the range of the parameter. A
        parameter without a prior is uniform along its scale. Constraints are ignored;
        `marginal_cdf` takes them into account.

        Parameters
        ----------
        unit : numpy.ndarray, (n, d)
            Points of the unit cube.

        Returns
        -------
        numpy.ndarray, (n, d)
            Numbers from 0 to 1.
        """
        from scipy import stats

        # Without a prior, a number from 0 to 1 along the scale is its own CDF.
        cdf = np.array(unit, dtype=float)
        for name, (mean, sd) in self.prior.items():
            k = self.free.index(name)
            value = self.values_at(name, cdf[:, k])
            cdf[:, k] = stats.truncnorm.cdf(
                (value - mean) / sd,
                (self.low[k] - mean) / sd,
                (self.high[k] - mean) / sd,
            )
        return cdf

    def marginal_cdf(self, unit: np.ndarray) -> np.ndarray:
        """Compute the cumulative distribution function (CDF) of each parameter.

        The distribution is the prior, restricted to the parameter sets that obey the
        constraints. So the CDF is the probability that the parameter of an allowed set
        is smaller than that of the point. It is estimated from many draws, which are
        computed once (`_allowed_prior`). Without constraints, it is the result of
        `prior_cdf`.

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

    def marginal_quantiles(self, probabilities: np.ndarray) -> np.ndarray:
        """Compute the quantiles (n, d) of the allowed prior at probabilities (n,).

        This is the inverse of `marginal_cdf`, but its result has the units of the
        parameters.
        """
        values = self.free_values(self._allowed_prior)
        return np.quantile(values, probabilities, axis=0)

    def transform_to_prior(self, probabilities: np.ndarray) -> np.ndarray:
        """Transform uniform points so that they are distributed as the prior.

        This is the inverse of `prior_cdf`: the result has the given values of the
        cumulative distribution functions. Constraints are ignored.

        Parameters
        ----------
        probabilities : numpy.ndarray, (n, d)
            Numbers from 0 to 1.

        Returns
        -------
        numpy.ndarray, (n, d)
            Points of the unit cube. The column of a parameter without a prior is
            unchanged.
        """
        from scipy import stats

        unit = np.array(probabilities, dtype=float)
        for name, (mean, sd) in self.prior.items():
            k = self.free.index(name)
            value = mean + sd * stats.truncnorm.ppf(
                unit[:, k], (self.low[k] - mean) / sd, (self.high[k] - mean) / sd
            )
            unit[:, k] = self.fractions_of_range(name, value)
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
