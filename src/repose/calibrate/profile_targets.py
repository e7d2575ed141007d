"""Targets that are profiles: a file of measured heights becomes one target for each score (`repose.calibrate.profiles`)."""

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, Generic, TypeVar

from pydantic import Field

from repose.calibrate.profiles import Profile
from repose.calibrate.responses import derived, named
from repose.calibrate.targets import range_about
from repose.common import faults, places, tables
from repose.common.errors import InputError, raise_together, require
from repose.common.section import ABSENT, Section

MOST_FUNCTIONS = 9
Column = Annotated[str, Field(min_length=1, max_length=60)]
Length = Annotated[float, Field(gt=0, le=1e9)]


class MeasuredProfile(Section):
    """A measured profile and its errors; lengths in the unit of the heights."""

    file: str = Field(min_length=1, max_length=1000)
    x: Column = "x_mm"
    z: Column = "z_mm"
    sd: Annotated[float, Field(ge=0, le=1e9)] | Column = Field(
        description="the standard deviation of a height, 0 or more, or the name of its column"
    )
    repetitions: int = Field(ge=1, le=10_000)
    functions: int = Field(default=5, ge=2, le=MOST_FUNCTIONS)
    within: Length = ABSENT


class BenchProfile(MeasuredProfile):
    """An entry of the list `targets`."""

    response: str = Field(min_length=1, max_length=60)
    apparatus: str = Field(default=ABSENT, min_length=1, max_length=60)
    weight: float = Field(default=1.0, gt=0, le=1e6)
    covered: float = Field(default=0.5, ge=0.01, le=0.99)


class OwnProfile(MeasuredProfile):
    """A target of a study with the user's own simulator."""

    unit: str = ""
    definition: str = ABSENT
    noise_sd: Length = ABSENT


Measured = TypeVar("Measured", bound=MeasuredProfile)


class _Targets(Section, Generic[Measured]):
    targets: dict[str, Measured]


def expanded(targets: Any, source: Any) -> Any:
    """Put an entry for each score in place of each profile of the list `targets`; InputError with all faults."""
    entries = []
    for k, entry in enumerate(targets):
        if _is_profile(entry):
            entries += _of_bench(
                _checked({str(k): entry}, _Targets[BenchProfile], source),
                f"targets.{k}",
                source,
            )
        else:
            entries.append(entry)
    return entries


def expanded_own(targets: Any, source: Any) -> Any:
    """Expand the section `targets` of the user's own simulator in the same way."""
    if not isinstance(targets, Mapping):
        return targets
    entries: dict[str, Any] = {}
    for name, entry in targets.items():
        if not _is_profile(entry):
            entries[name] = entry
            continue
        measured = _checked({name: entry}, _Targets[OwnProfile], source)
        profile, sd = _read(measured, name)
        both = [
            score for score in profile.names if score in targets or score in entries
        ]
        require(
            not both,
            source,
            f"targets.{name}",
            both,
            "a profile whose scores have names of no other target",
        )
        more = {
            key: getattr(measured, key)
            for key in ("unit", "definition")
            if key in entry
        }
        if measured.noise_sd is not None:
            more["noise_sd"] = measured.noise_sd / math.sqrt(profile.functions)
        scores = zip(profile.names, _scores(measured, profile, sd, {}), strict=True)
        entries |= {score: common | more for score, common in scores}
    return entries


def _is_profile(entry: Any) -> bool:
    """Return whether an entry names the file of a profile."""
    return isinstance(entry, Mapping) and "file" in entry


def _checked(
    targets: Mapping[str, Any], model: type[_Targets[Measured]], source: Any
) -> Measured:
    """Make an entry an instance of its model; InputError with all its faults."""
    raise_together(faults.check({"targets": targets}, source, model).faults)
    ((name, entry),) = model.model_validate({"targets": targets}).targets.items()
    require(
        places.find(entry.file).is_file(),
        source,
        f"targets.{name}.file",
        entry.file,
        "an existing CSV file",
    )
    return entry


def _of_bench(measured: BenchProfile, key: str, source: Any) -> list[dict[str, Any]]:
    """Make the entries of a bench test's profile."""
    first = named(derived(measured.response, "1"))
    if first is None or first.profile != measured.response:
        allowed = "the profile of a bench test, such as turning_profile_mm"
        raise InputError(source, f"{key}.response", measured.response, allowed)
    if measured.apparatus not in (None, first.apparatus):
        raise InputError(
            source, f"{key}.apparatus", measured.apparatus, first.apparatus
        )
    profile, sd = _read(measured, measured.response)
    common = {
        "apparatus": first.apparatus,
        "weight": measured.weight / profile.functions,
    }
    scores = _scores(measured, profile, sd, {"covered": measured.covered})
    return [
        {"response": name, **common, **score}
        for name, score in zip(profile.names, scores, strict=True)
    ]


def _scores(
    measured: MeasuredProfile, profile: Profile, sd: float, more: dict[str, Any]
) -> Iterator[dict[str, Any]]:
    """Yield the keys that the scores' targets share with any target, and their profile.

    All scores have the same error, and their variances add up to the mean square error of a height.
    """
    root = math.sqrt(profile.functions)
    low, high = range_about(profile.height, sd, measured.repetitions)
    half = (measured.within or 0.5 * (high - low)) / root
    kept = {
        "name": profile.name,
        "x": list(profile.x),
        "z": list(profile.z),
        "functions": profile.functions,
    }
    for value in profile.scores(profile.z).tolist():
        numbers = {"value": value, "sd": sd / root, "repetitions": measured.repetitions}
        yield numbers | {"range": [value - half, value + half], "profile": kept | more}


def _read(measured: MeasuredProfile, name: str) -> tuple[Profile, float]:
    """Read the profile of a file, and the standard deviation of a height: the root of its mean square."""
    path = places.find(measured.file)
    columns = [
        tables.Column(measured.x, empty=True),
        tables.Column(measured.z, empty=True),
    ]
    if isinstance(measured.sd, str):
        columns.append(tables.Column(measured.sd, low=0.0, empty=True))
    cells = tables.read(path, columns, "a CSV file of a profile")
    # a profile may be shorter than the table
    rows = [
        k for k, height in enumerate(cells.values[measured.z]) if not math.isnan(height)
    ]
    first, last = (rows[0], rows[-1] + 1) if rows else (0, 0)
    numbers = {column.name: cells.values[column.name][first:last] for column in columns}
    gaps = [
        (k, name)
        for name, own in numbers.items()
        for k, one in enumerate(own, start=first)
        if math.isnan(one)
    ]
    words = "a finite number; empty heights only at the ends of a profile"
    tables.refuse(path, ((k, name, cells.text[name][k], words) for k, name in gaps))
    x, z, *sd = (numbers[column.name] for column in columns)
    require(
        len(x) > measured.functions,
        path,
        "rows",
        len(x),
        f"more than functions, {measured.functions}",
    )
    for k, (before, after) in enumerate(pairwise(x), start=first + 2):
        require(
            after > before,
            f"{path}, row {k}",
            measured.x,
            after,
            f"above the previous row's {before:g}",
        )
    profile = Profile(name, tuple(x), tuple(z), measured.functions)
    require(
        profile.height != 0,
        path,
        measured.z,
        0,
        "a height that is not 0: tolerances are in percent of it",
    )
    if not sd:
        return profile, float(measured.sd)
    return profile, math.sqrt(sum(one**2 for one in sd[0]) / len(sd[0]))
