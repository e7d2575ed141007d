"""The parameters of a study: ranges of the free parameters, fixed values, priors."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

# Without a range, a parameter reaches so many standard deviations of its prior to each
# side of the mean.
PRIOR_WIDTHS = 3.0

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
    """

    free: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    fixed: dict[str, float] = field(default_factory=dict)
    prior: dict[str, tuple[float, float]] = field(default_factory=dict)
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.names:
            object.__setattr__(self, "names", (*self.free, *self.fixed))

    @classmethod
    def of(
        cls,
        section: Mapping[str, Any],
        names: Sequence[str] | None = None,
        limits: Limits | None = None,
    ) -> "ParameterSpace":
        """Read the section `parameters` of a configuration that was checked.

        Parameters
        ----------
        section : mapping
            For each parameter a range, a fixed value, or a prior with or without a range.
        names : sequence of str, optional
            The parameters to read, in this order; by default all of the section.
        limits : mapping, optional
            Lowest and highest value by name, to which a prior without a range is cut.
        """
        if names is None:
            names = tuple(section)
        ranges: dict[str, tuple[float, float]] = {}  # of the free parameters
        fixed: dict[str, float] = {}
        prior: dict[str, tuple[float, float]] = {}  # mean and standard deviation
        for name in names:
            entry = section[name]
            if isinstance(entry, Mapping) and "fixed" in entry:
                fixed[name] = float(entry["fixed"])
                continue
            ranges[name] = range_of(name, entry, limits)
            if isinstance(entry, Mapping) and "prior" in entry:
                mean = float(entry["prior"]["mean"])
                sd = float(entry["prior"]["sd"])
                prior[name] = (mean, sd)
        low = np.array([ends[0] for ends in ranges.values()])
        high = np.array([ends[1] for ends in ranges.values()])
        return cls(tuple(ranges), low, high, fixed, prior, tuple(names))

    @property
    def dimensions(self) -> int:
        """Number d of free parameters."""
        return len(self.free)

    @property
    def centre(self) -> dict[str, float]:
        """Centre of each parameter's range, or its fixed value."""
        known = dict(self.fixed)
        for name, low, high in zip(
            self.free, self.low.tolist(), self.high.tolist(), strict=True
        ):
            known[name] = round((low + high) / 2, 12)
        return {name: known[name] for name in self.names}

    def values(self, unit: np.ndarray) -> np.ndarray:
        """Turn points (n, d) of the unit cube into parameter sets (n, names)."""
        points = np.atleast_2d(np.asarray(unit, dtype=float))
        return self.complete(self.low + points * (self.high - self.low))

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
        return (values[:, columns] - self.low) / (self.high - self.low)

    def log_prior(self, unit: np.ndarray) -> np.ndarray:
        """Compute the log prior density (n,) at points (n, d) of the unit cube.

        It is known up to a constant, and 0 without priors.
        """
        total = np.zeros(len(unit))
        for k, low, high, mean, sd in self._priors():
            total -= 0.5 * ((low + unit[:, k] * (high - low) - mean) / sd) ** 2
        return total

    def _priors(self) -> Iterator[tuple[int, float, float, float, float]]:
        """Yield column, ends of the range, mean and sd of each parameter with a prior."""
        for name, (mean, sd) in self.prior.items():
            k = self.free.index(name)
            yield k, self.low[k], self.high[k], mean, sd

    def prior_cdf(self, unit: np.ndarray) -> np.ndarray:
        """Compute the distribution function (n, d) of each parameter's prior.

        `unit` are points (n, d) of the unit cube; without a prior the distribution is
        uniform.
        """
        from scipy import stats

        share = np.array(unit, dtype=float)
        for k, low, high, mean, sd in self._priors():
            value = low + share[:, k] * (high - low)
            share[:, k] = stats.truncnorm.cdf(
                (value - mean) / sd, (low - mean) / sd, (high - mean) / sd
            )
        return share

    def from_prior(self, share: np.ndarray) -> np.ndarray:
        """Move uniform points (n, d) of the unit cube to the distribution of the priors."""
        from scipy import stats

        unit = np.array(share, dtype=float)
        for k, low, high, mean, sd in self._priors():
            value = mean + sd * stats.truncnorm.ppf(
                unit[:, k], (low - mean) / sd, (high - mean) / sd
            )
            unit[:, k] = (value - low) / (high - low)
        return unit


def range_of(
    name: str, entry: Any, limits: Limits | None = None
) -> tuple[float, float]:
    """Return the lowest and the highest value of a parameter; equal if it is fixed.

    Parameters
    ----------
    name : str
        Of the parameter.
    entry : pair or mapping
        Its entry in the section `parameters`.
    limits : mapping, optional
        As in `ParameterSpace.of`.
    """
    if not isinstance(entry, Mapping):
        return float(entry[0]), float(entry[1])
    if "fixed" in entry:
        return float(entry["fixed"]), float(entry["fixed"])
    if "range" in entry:
        return float(entry["range"][0]), float(entry["range"][1])

    # Without a range, use some standard deviations of the prior on each side of its mean.
    mean = entry["prior"]["mean"]
    half = PRIOR_WIDTHS * entry["prior"]["sd"]
    lowest, highest = (limits or {}).get(name, (-math.inf, math.inf))
    return float(max(lowest, mean - half)), float(min(highest, mean + half))
