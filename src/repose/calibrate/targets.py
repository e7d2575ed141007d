"""Targets of the calibration: responses of bench tests with their measured values."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from repose.calibrate.profiles import Profile
from repose.calibrate.responses import Response, named, response
from repose.calibrate.seeds import UNNAMED
from repose.common.target_range import LEAST_RANGE as LEAST_RANGE
from repose.common.target_range import range_about

LARGEST = 1e9  # of a value or standard deviation


def completed(entry: Any) -> Any:
    """Complete an entry of `targets` with the bench test of its response and `range_about`, where they are missing."""
    if not isinstance(entry, Mapping):
        return entry
    known = named(str(entry.get("response")))
    found = {"apparatus": UNNAMED if known is None else known.apparatus} | dict(entry)
    numbers: list[Any] = [entry.get(key) for key in ("value", "sd", "repetitions")]
    good = all(type(one) in (int, float) and abs(one) <= LARGEST for one in numbers)
    if "range" not in entry and good and numbers[2] > 0:
        found["range"] = list(range_about(*numbers))
    return found


@dataclass(frozen=True)
class Target:
    """A measured response; all values in its unit."""

    response: Response
    value: float  # mean of the physical repetitions
    sd: float  # standard deviation of the physical repetitions
    repetitions: int
    low: float  # a solution is feasible if its prediction lies from low to high
    high: float
    aim: float  # goal of the search: `value`, or the centre of the range (Eq. 11-12 of the paper)
    weight: float = 1.0  # in the search's objective
    profile: Profile | None = None  # of which the response is a score

    @property
    def name(self) -> str:
        """Column of its response."""
        return self.response.name

    @property
    def standard_error(self) -> float:
        """Standard error of the mean of the repetitions."""
        return self.sd / math.sqrt(self.repetitions)

    @property
    def whole(self) -> float:
        """What 100 % means: the size of the aim, or for a score of a profile a share of the profile's height."""
        return abs(self.aim) if self.profile is None else self.profile.whole

    def off_percent(self, number: float) -> float:
        """Compute how far a number is from the aim, in percent."""
        return (
            100 * (number / self.aim - 1)
            if self.profile is None
            else 100 * (number - self.aim) / self.whole
        )

    @property
    def whole_value(self) -> float:
        """As `whole`, of the measured value."""
        return abs(self.value) if self.profile is None else self.profile.whole


class _Numbers:
    """A number of each target, by its name, as an array (k,)."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, targets: "Targets", owner: type) -> np.ndarray:
        return np.array([getattr(target, self.name) for target in targets])


class Targets(tuple[Target, ...]):
    """The targets of a study, in the order of the configuration; numbers as arrays (k,)."""

    value = _Numbers()
    sd = _Numbers()
    standard_error = _Numbers()
    low = _Numbers()
    high = _Numbers()
    aim = _Numbers()
    weight = _Numbers()
    whole = _Numbers()

    @classmethod
    def of(cls, section: Sequence[Mapping[str, Any]]) -> "Targets":
        """Read the configuration's list `targets`; InputError if a response is unknown."""
        return cls(
            Target(
                response(entry["response"], "targets"),
                float(entry["value"]),
                float(entry["sd"]),
                int(entry["repetitions"]),
                float(entry["range"][0]),
                float(entry["range"][1]),
                float(entry.get("aim", entry["value"])),
                float(entry.get("weight", 1.0)),
                Profile.of(entry["profile"]) if "profile" in entry else None,
            )
            for entry in section
        )

    @property
    def responses(self) -> tuple[Response, ...]:
        return tuple(target.response for target in self)

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of the responses."""
        return tuple(target.name for target in self)

    @property
    def predicted(self) -> tuple[str, ...]:
        """Columns of their predictions."""
        return tuple(target.response.predicted for target in self)

    @property
    def errors(self) -> tuple[str, ...]:
        """Columns of their standard errors."""
        return tuple(target.response.error for target in self)

    @property
    def apparatus(self) -> tuple[str, ...]:
        """Bench tests of the responses, each once."""
        return tuple(dict.fromkeys(target.response.apparatus for target in self))

    @property
    def benches(self) -> dict[str, list[int]]:
        """Places of the responses of each bench test."""
        return {
            name: [k for k, one in enumerate(self) if one.response.apparatus == name]
            for name in self.apparatus
        }

    @property
    def same_bench(self) -> np.ndarray:
        """Pairs of responses of the same bench test, as a mask (k, k)."""
        bench = np.array([target.response.apparatus for target in self])
        return bench[:, None] == bench

    def correlated(self, correlation: float) -> np.ndarray:
        """Make the correlation matrix (k, k) of responses that are correlated alike within a bench test only."""
        matrix = np.where(self.same_bench, float(correlation), 0.0)
        np.fill_diagonal(matrix, 1.0)
        return matrix

    @property
    def profiles(self) -> dict[str, Profile]:
        """The measured profiles by name."""
        return {
            target.profile.name: target.profile
            for target in self
            if target.profile is not None
        }

    def in_words(self, numbers: Sequence[str]) -> str:
        """Write number and unit of each target, ``32.5 deg and 66.1 mm``; with symbols if two units are equal."""
        units = [target.response.unit for target in self]
        several = len(set(units)) < len(units)
        symbols = [f"{target.response.symbol} " if several else "" for target in self]
        words = zip(symbols, numbers, units, strict=True)
        *parts, last = [
            f"{symbol}{number} {unit}".rstrip() for symbol, number, unit in words
        ]
        return " and ".join(filter(None, [", ".join(parts), last]))
