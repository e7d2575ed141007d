"""The parameters of a study: ranges of the free parameters, fixed values, prior knowledge."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from repose.bench.parameters import ALLOWED, PARAMETERS, named

PRIOR_WIDTHS = 3.0  # standard deviations of a prior to each side, if no range is given


@dataclass(frozen=True)
class ParameterSpace:
    """The parameters of a study, of which d, the `free` ones, are searched; a prior is normal, cut to the range."""

    free: tuple[str, ...]  # in the order of `names`
    low: np.ndarray  # (d,)
    high: np.ndarray  # (d,)
    fixed: dict[str, float] = field(default_factory=dict)  # values of the others
    prior: dict[str, tuple[float, float]] = field(default_factory=dict)
    names: tuple[str, ...] = PARAMETERS

    @classmethod
    def of(
        cls, section: Mapping[str, Any], names: tuple[str, ...] | None = None
    ) -> "ParameterSpace":
        """Read the checked section `parameters`; without `names` it has the six and the law's own, in their limits."""
        limits = ALLOWED if names is None else {}
        names = named(section) if names is None else names
        ranges, fixed, prior = {}, {}, {}
        for name in names:
            entry = section[name]
            if isinstance(entry, Mapping) and "fixed" in entry:
                fixed[name] = float(entry["fixed"])
                continue
            ranges[name] = range_of(name, entry, limits)
            if isinstance(entry, Mapping) and "prior" in entry:
                prior[name] = (
                    float(entry["prior"]["mean"]),
                    float(entry["prior"]["sd"]),
                )
        low, high = (np.array([ends[k] for ends in ranges.values()]) for k in (0, 1))
        return cls(tuple(ranges), low, high, fixed, prior, names)

    @property
    def dimensions(self) -> int:
        """Number d of parameters that are searched."""
        return len(self.free)

    @property
    def centre(self) -> dict[str, float]:
        """Centre of each parameter's range, or its fixed value."""
        ends = zip(self.free, self.low.tolist(), self.high.tolist(), strict=True)
        known = {
            name: round((low + high) / 2, 12) for name, low, high in ends
        } | self.fixed
        return {name: known[name] for name in self.names}

    def values(self, unit: np.ndarray) -> np.ndarray:
        """Turn points (n, d) in the unit cube into parameter sets (n, number of names)."""
        return self.complete(
            self.low
            + np.atleast_2d(np.asarray(unit, dtype=float)) * (self.high - self.low)
        )

    def complete(self, values: np.ndarray) -> np.ndarray:
        """Turn values (n, d) of the free parameters into parameter sets (n, number of names)."""
        values = np.atleast_2d(np.asarray(values, dtype=float))
        columns = iter(values.T)
        return np.column_stack(
            [
                np.full(len(values), self.fixed[name])
                if name in self.fixed
                else next(columns)
                for name in self.names
            ]
        )

    def unit(self, values: np.ndarray) -> np.ndarray:
        """Turn parameter sets (n, number of names) into points (n, d) in the unit cube."""
        values = np.atleast_2d(np.asarray(values, dtype=float))[
            :, [self.names.index(name) for name in self.free]
        ]
        return (values - self.low) / (self.high - self.low)

    def log_prior(self, unit: np.ndarray) -> np.ndarray:
        """Compute the log prior density (n,), up to a constant, at points (n, d) in the unit cube; 0 without priors."""
        total = np.zeros(len(unit))
        for k, low, high, mean, sd in self._priors():
            total -= 0.5 * ((low + unit[:, k] * (high - low) - mean) / sd) ** 2
        return total

    def _priors(self) -> Iterator[tuple[Any, ...]]:
        """Yield place, ends of the range, mean and standard deviation of each parameter with a prior."""
        for name, (mean, sd) in self.prior.items():
            k = self.free.index(name)
            yield k, self.low[k], self.high[k], mean, sd

    def prior_cdf(self, unit: np.ndarray) -> np.ndarray:
        """Compute each prior's distribution function (n, d), 0 to 1, at points (n, d) in the unit cube."""
        from scipy import stats

        share = np.array(unit, dtype=float)
        for k, low, high, mean, sd in self._priors():
            value = low + share[:, k] * (high - low)
            share[:, k] = stats.truncnorm.cdf(
                (value - mean) / sd, (low - mean) / sd, (high - mean) / sd
            )
        return share

    def from_prior(self, share: np.ndarray) -> np.ndarray:
        """Move uniform points (n, d) in the unit cube to the prior's distribution."""
        from scipy import stats

        unit = np.array(share, dtype=float)
        for k, low, high, mean, sd in self._priors():
            value = mean + sd * stats.truncnorm.ppf(
                unit[:, k], (low - mean) / sd, (high - mean) / sd
            )
            unit[:, k] = (value - low) / (high - low)
        return unit


def range_of(
    name: str, entry: Any, limits: Mapping[str, Any] = ALLOWED
) -> tuple[float, float]:
    """Find the lowest and highest value of a parameter, given as in the configuration; equal if it is fixed."""
    if not isinstance(entry, Mapping):
        return float(entry[0]), float(entry[1])
    if "fixed" in entry:
        return float(entry["fixed"]), float(entry["fixed"])
    if "range" in entry:
        return float(entry["range"][0]), float(entry["range"][1])
    mean, sd = entry["prior"]["mean"], entry["prior"]["sd"]
    lowest, highest = limits.get(name, (-math.inf, math.inf))
    low, high = (
        max(lowest, mean - PRIOR_WIDTHS * sd),
        min(highest, mean + PRIOR_WIDTHS * sd),
    )
    return (
        (float(low), float(high))
        if math.isfinite(high)
        else (float(low), float(mean + PRIOR_WIDTHS * sd))
    )
