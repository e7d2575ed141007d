"""The targets of a calibration: measured values of the responses of bench tests."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from repose.calibrate.profiles import Profile
from repose.calibrate.responses import Response, find_response, response
from repose.calibrate.seeds import UNNAMED
from repose.common.target_range import compute_target_range

# Largest value or standard deviation.
MAX_SIZE = 1e9
# The one bench test of all responses of a simulator of the user's own.
OWN_BENCH = "own"


def complete_target(entry: Any) -> Any:
    """Add the missing bench test and range to an entry of the list `targets`.

    The bench test has the key `apparatus`. By default, it is the bench test that
    measures the response. The default range lies around the measured value, see
    `compute_target_range`.

    Parameters
    ----------
    entry : any
        The entry as the user wrote it. It has not been checked yet, so it may be of any
        type.

    Returns
    -------
    any
        A completed copy of the entry. A later check finds its errors: an entry that is
        not a mapping is returned unchanged, and if a number is missing or has the wrong
        type or size, no range is added.
    """
    if not isinstance(entry, Mapping):
        return entry
    known_response = find_response(str(entry.get("response")))
    # The later check rejects an unknown response, so any bench test serves for it.
    apparatus = UNNAMED if known_response is None else known_response.apparatus
    # The user's keys take precedence.
    completed = {"apparatus": apparatus} | dict(entry)
    if "range" in entry:
        return completed

    value: Any = entry.get("value")
    sd: Any = entry.get("sd")
    repetitions: Any = entry.get("repetitions")
    if all(map(_is_usable, (value, sd, repetitions))) and repetitions > 0:
        completed["range"] = list(compute_target_range(value, sd, repetitions))
    return completed


def _is_usable(number: Any) -> bool:
    """Return whether an entry is a number, not a bool, whose size is at most `MAX_SIZE`."""
    return type(number) in (int, float) and abs(number) <= MAX_SIZE


@dataclass(frozen=True)
class Target:
    """A measured response; all values are in its unit.

    Attributes
    ----------
    response : Response
        The measured response.
    value, sd : float
        Mean and standard deviation of the physical repetitions.
    repetitions : int
        Number of physical repetitions.
    low, high : float
        Ends of the range in which the prediction of a feasible solution must lie.
    aim : float
        Goal of the search: `value`, or the centre of the range (Eq. 11-12 of the
        paper).
    weight : float
        Weight of the target in the objective of the search.
    profile : Profile or None
        The profile of which the response is a score.
    """

    response: Response
    value: float
    sd: float
    repetitions: int
    low: float
    high: float
    aim: float
    weight: float = 1.0
    profile: Profile | None = None

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
        """The number that counts as 100 % of the aim.

        It is the absolute value of the aim. For a score of a profile it is
        `Profile.whole`.
        """
        if self.profile is None:
            return abs(self.aim)
        return self.profile.whole

    def off_percent(self, number: float) -> float:
        """Compute how far a number is from the aim, in percent."""
        if self.profile is None:
            return 100 * (number / self.aim - 1)
        return 100 * (number - self.aim) / self.whole

    @property
    def whole_value(self) -> float:
        """The number that counts as 100 % of the measured value; see `whole`."""
        if self.profile is None:
            return abs(self.value)
        return self.profile.whole


class _Numbers:
    """Descriptor that collects an attribute of all k targets in an array (k,).

    The attribute of each target has the same name as the class attribute.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, targets: "Targets", owner: type) -> np.ndarray:
        return np.array([getattr(target, self.name) for target in targets])


class Targets(tuple[Target, ...]):
    """The targets of a study, in the order of the configuration.

    The numbers of all targets are arrays (k,).
    """

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
        """Read the list `targets` of a configuration.

        Raises
        ------
        InputError
            If a response is unknown.
        """
        return cls(_read_target(entry) for entry in section)

    @property
    def responses(self) -> tuple[Response, ...]:
        """The measured responses."""
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
        return tuple(target.response.standard_error for target in self)

    @property
    def apparatus(self) -> tuple[str, ...]:
        """Bench tests of the responses, each once."""
        return tuple(dict.fromkeys(target.response.apparatus for target in self))

    @property
    def benches(self) -> dict[str, list[int]]:
        """Indices of the responses of each bench test."""
        indices: dict[str, list[int]] = {name: [] for name in self.apparatus}
        for k, target in enumerate(self):
            indices[target.response.apparatus].append(k)
        return indices

    @property
    def same_bench(self) -> np.ndarray:
        """Pairs of responses of the same bench test, as a mask (k, k)."""
        benches = np.array([target.response.apparatus for target in self])
        return benches[:, None] == benches

    def correlated(self, correlation: float) -> np.ndarray:
        """Make the correlation matrix (k, k) of the responses.

        Two responses of the same bench test have the given correlation. Responses of
        different bench tests are independent.
        """
        matrix = np.where(self.same_bench, float(correlation), 0.0)
        np.fill_diagonal(matrix, 1.0)
        return matrix

    @property
    def profiles(self) -> dict[str, Profile]:
        """The measured profiles by name."""
        profiles = {}
        for target in self:
            if target.profile is not None:
                profiles[target.profile.name] = target.profile
        return profiles

    def format_with_units(self, numbers: Sequence[str]) -> str:
        """List numbers in a text, each with the unit of its target.

        Parameters
        ----------
        numbers : sequence of str
            A formatted number for each target, in the order of the targets.

        Returns
        -------
        str
            Text such as ``32.5 deg and 66.1 mm``. If two responses have the same unit,
            each number is preceded by the symbol of its response.
        """
        units = [target.response.unit for target in self]
        needs_symbols = len(set(units)) < len(units)
        parts = []
        for target, number in zip(self, numbers, strict=True):
            part = f"{number} {target.response.unit}".rstrip()
            if needs_symbols:
                part = f"{target.response.symbol} {part}"
            parts.append(part)
        if len(parts) == 1:
            return parts[0]
        return f"{', '.join(parts[:-1])} and {parts[-1]}"


def make_own_response(name: str, unit: str = "") -> Response:
    """Make a response of a simulator of the user's own, which has no limits."""
    return Response(
        name=name,
        unit=unit,
        label=name,
        symbol=name,
        apparatus=OWN_BENCH,
        low=-math.inf,
    )


def _read_target(entry: Mapping[str, Any]) -> Target:
    """Make a target from its entry in the configuration."""
    low, high = entry["range"]
    if entry.get("apparatus") == OWN_BENCH:
        of_target = make_own_response(entry["response"], entry["unit"])
    else:
        of_target = response(entry["response"], "targets")
    return Target(
        response=of_target,
        value=float(entry["value"]),
        sd=float(entry["sd"]),
        repetitions=int(entry["repetitions"]),
        low=float(low),
        high=float(high),
        aim=float(entry.get("aim", entry["value"])),
        weight=float(entry.get("weight", 1.0)),
        profile=Profile.of(entry["profile"]) if "profile" in entry else None,
    )
