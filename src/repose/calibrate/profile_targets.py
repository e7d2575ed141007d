"""Targets that are measured profiles.

A profile is a line of measured heights in a file. It becomes one target for each of its
scores (`repose.calibrate.profiles`).
"""

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, Generic, NamedTuple, TypeVar

from pydantic import Field

from repose.calibrate.profiles import Profile
from repose.calibrate.responses import find_response, name_derived_column
from repose.calibrate.targets import compute_target_range
from repose.common import faults, places, tables
from repose.common.errors import InputError, raise_together
from repose.common.section import ABSENT, Allowed, Section

MAX_FUNCTIONS = 9
Column = Annotated[str, Field(min_length=1, max_length=60)]
Length = Annotated[float, Field(gt=0, le=1e9)]


class MeasuredProfile(Section):
    """A measured profile and its errors; lengths in the unit of the heights."""

    file: str = Field(
        min_length=1,
        max_length=1000,
        description="CSV of the profile, in order of rising abscissa; heights may be "
        "empty at both ends",
    )
    x: Column = Field(
        default="x_mm",
        description="column of the abscissa",
    )
    z: Column = Field(
        default="z_mm",
        description="column of the height",
    )
    sd: Annotated[
        Annotated[float, Field(ge=0, le=1e9)] | Column,
        Allowed(
            "the standard deviation of a height, 0 or more, or the name of its column"
        ),
    ] = Field(
        description="standard deviation of a height, or the name of a column, whose "
        "root mean square is used",
    )
    repetitions: int = Field(
        ge=1,
        le=10_000,
        description="how often the profile was measured",
    )
    functions: int = Field(
        default=5,
        ge=2,
        le=MAX_FUNCTIONS,
        description="number of scores, smaller than the number of rows",
    )
    within: Length = Field(
        default=ABSENT,
        description="largest root mean square of a feasible solution; by default two "
        "standard errors, at least 1 %",
    )


class BenchProfile(MeasuredProfile):
    """An entry of the list `targets`."""

    response: str = Field(
        min_length=1,
        max_length=60,
        description="the measured profile, a response of a bench test",
    )
    apparatus: str = Field(
        default=ABSENT,
        min_length=1,
        max_length=60,
        description="the bench test that gives it; by default that of the response",
    )
    weight: float = Field(
        default=1.0,
        gt=0,
        le=1e6,
        description="weight of the whole profile in the search's objective",
    )
    covered: float = Field(
        default=0.5,
        ge=0.01,
        le=0.99,
        description="the measured line is that on which the bed covers this share of "
        "the frames",
    )


class OwnProfile(MeasuredProfile):
    """A target of a study with the user's own simulator."""

    unit: str = ""
    definition: str = ABSENT
    noise_sd: Length = ABSENT


ProfileType = TypeVar("ProfileType", bound=MeasuredProfile)


class _ProfileTargets(Section, Generic[ProfileType]):
    """A section of targets that are profiles, with which pydantic checks entries."""

    targets: dict[str, ProfileType]


class _ProfileWithError(NamedTuple):
    """A measured profile with the standard deviation of its heights."""

    profile: Profile
    sd: float  # root of the mean square over the heights


def expand_profiles(targets: Any, source: Any) -> Any:
    """Replace each profile in the list `targets` by an entry for each of its scores.

    A score is the coefficient of one of the functions that describe the profile. The
    targets belong to bench tests; see `expand_own_profiles` for other simulators.

    Parameters
    ----------
    targets : iterable
        The entries as the user wrote them.
    source : object
        File of the list, for an error.

    Returns
    -------
    list
        The entries in the same order. Entries that are not profiles are unchanged.

    Raises
    ------
    InputError
        If a profile is invalid; the message lists all errors.
    """
    entries = []
    for k, entry in enumerate(targets):
        if _is_profile(entry):
            # An error in the entry then has a key such as `targets.2.functions`.
            measured = _validate_entry(
                {str(k): entry}, _ProfileTargets[BenchProfile], source
            )
            entries += _make_bench_targets(measured, f"targets.{k}", source)
        else:
            entries.append(entry)
    return entries


def expand_own_profiles(targets: Any, source: Any) -> Any:
    """Replace each profile in the section `targets` by a target for each of its scores.

    A score is the coefficient of one of the functions that describe the profile. The
    section belongs to a study with the user's own simulator. There, targets have names
    that the user chose, instead of the registered responses of bench tests.

    Parameters
    ----------
    targets : mapping
        The entries by name. A value that is not a mapping is returned unchanged,
        because a later check rejects it.
    source : object
        File of the section, for an error.

    Returns
    -------
    dict
        The entries in the same order. Entries that are not profiles are unchanged.

    Raises
    ------
    InputError
        If a profile is invalid, or if a score has the name of another target. The
        message lists all errors of the profile.
    """
    if not isinstance(targets, Mapping):
        return targets
    entries: dict[str, Any] = {}
    for name, entry in targets.items():
        if not _is_profile(entry):
            entries[name] = entry
            continue
        score_targets = _make_own_targets(name, entry, source)
        # The scores become targets like the others, so each name must be new.
        other_names = {*targets, *entries}
        repeated_names = [score for score in score_targets if score in other_names]
        if repeated_names:
            raise InputError(
                source=source,
                key=f"targets.{name}",
                value=repeated_names,
                allowed="a profile none of whose scores has the name of another target",
            )
        entries.update(score_targets)
    return entries


def _make_own_targets(
    name: str, entry: Mapping[str, Any], source: Any
) -> dict[str, dict[str, Any]]:
    """Make a target for each score of a profile in a study with the user's own simulator.

    Parameters
    ----------
    name : str
        Name of the profile in the section `targets`.
    entry : mapping
        Its entry, which has not been checked yet.
    source : object
        File of the configuration, for an error.

    Returns
    -------
    dict
        An entry of the section `targets` for each score, by its name.
    """
    measured = _validate_entry({name: entry}, _ProfileTargets[OwnProfile], source)
    profile_with_error = _read_profile(measured, name)
    profile = profile_with_error.profile
    # All scores share the unit, the definition and the noise of the profile. Only keys
    # that the user gave are passed on, but their checked values are used.
    common_keys: dict[str, Any] = {}
    for key in ("unit", "definition"):
        if key in entry:
            common_keys[key] = getattr(measured, key)
    if measured.noise_sd is not None:
        # The functions are orthonormal, so the variances of all scores add up to the
        # variance of a height. Each score gets the same part of it.
        common_keys["noise_sd"] = measured.noise_sd / math.sqrt(profile.n_functions)
    targets_of_scores = _make_score_targets(
        measured, profile_with_error, further_keys={}
    )
    return {
        score: target | common_keys
        for score, target in zip(profile.names, targets_of_scores, strict=True)
    }


def _is_profile(entry: Any) -> bool:
    """Return whether an entry names the file of a profile."""
    return isinstance(entry, Mapping) and "file" in entry


def _validate_entry(
    targets: Mapping[str, Any], model: type[_ProfileTargets[ProfileType]], source: Any
) -> ProfileType:
    """Check a section with a single target, and return it as an instance of its model.

    Parameters
    ----------
    targets : mapping
        A single entry by its name.
    model : type
        Model of the section.
    source : object
        File of the section, for an error.

    Raises
    ------
    InputError
        If the entry is invalid, or its file does not exist.
    """
    raise_together(faults.find_faults({"targets": targets}, source, model).faults)
    ((name, entry),) = model.model_validate({"targets": targets}).targets.items()
    if not places.find_file(entry.file).is_file():
        key = f"targets.{name}.file"
        raise InputError(
            source=source,
            key=key,
            value=entry.file,
            allowed="an existing CSV file",
        )
    return entry


def _make_bench_targets(
    measured: BenchProfile, key: str, source: Any
) -> list[dict[str, Any]]:
    """Make a target for each score of a profile that a bench test measures.

    A score is the coefficient of one of the functions that describe the profile.

    Parameters
    ----------
    measured : BenchProfile
        The entry of the configuration.
    key : str
        Key of the profile in the configuration, which an error names.
    source : object
        File of the configuration, for an error.

    Returns
    -------
    list of dict
        An entry of the list `targets` for each score.

    Raises
    ------
    InputError
        If no bench test has this profile, or if the entry names another bench test.
    """
    # The scores are registered responses, with names such as turning_profile_1_mm, but
    # the profile is not. So find the bench test through the first score.
    first_score = name_derived_column(measured.response, "1")
    first_response = find_response(first_score)
    if first_response is None or first_response.profile != measured.response:
        raise InputError(
            source=source,
            key=f"{key}.response",
            value=measured.response,
            allowed="the profile of a bench test, such as turning_profile_mm",
        )
    if measured.apparatus not in (None, first_response.apparatus):
        raise InputError(
            source=source,
            key=f"{key}.apparatus",
            value=measured.apparatus,
            allowed=first_response.apparatus,
        )
    # All scores together have the weight of the profile.
    profile_with_error = _read_profile(measured, measured.response)
    profile = profile_with_error.profile
    weight = measured.weight / profile.n_functions
    score_targets = _make_score_targets(
        measured, profile_with_error, further_keys={"covered": measured.covered}
    )
    entries = []
    for name, score_keys in zip(profile.names, score_targets, strict=True):
        entries.append(
            {
                "response": name,
                "apparatus": first_response.apparatus,
                "weight": weight,
                **score_keys,
            }
        )
    return entries


def _make_score_targets(
    measured: MeasuredProfile,
    profile_with_error: _ProfileWithError,
    further_keys: Mapping[str, Any],
) -> Iterator[dict[str, Any]]:
    """Make a target for each score of a measured profile.

    A score is the coefficient of one of the functions that describe the profile. All
    scores get the same standard deviation. The functions are orthonormal, so the
    variances of the scores add up to the variance of a height. The standard deviation
    of a score is therefore that of a height, divided by the square root of the number
    of functions.

    Parameters
    ----------
    measured : MeasuredProfile
        The entry of the configuration.
    profile_with_error : _ProfileWithError
        The profile in its file.
    further_keys : mapping
        Further keys for the section `profile` of each target.

    Yields
    ------
    dict
        The target of a score, as a configuration file has it.
    """
    profile, height_sd = profile_with_error
    sd_reduction = math.sqrt(profile.n_functions)
    low, high = compute_target_range(profile.height, height_sd, measured.repetitions)
    # `within` is above 0, or None if the user did not give it.
    half_range = (measured.within or 0.5 * (high - low)) / sd_reduction
    section = {
        "name": profile.name,
        "x": list(profile.x),
        "z": list(profile.z),
        "functions": profile.n_functions,
        **further_keys,
    }
    for value in profile.scores(profile.z).tolist():
        yield {
            "value": value,
            "sd": height_sd / sd_reduction,
            "repetitions": measured.repetitions,
            "range": [value - half_range, value + half_range],
            # The targets share the lists x and z, which nothing changes in place.
            "profile": section.copy(),
        }


def _read_profile(measured: MeasuredProfile, name: str) -> _ProfileWithError:
    """Read the profile of a file.

    Raises
    ------
    InputError
        If it has gaps, too few rows, or abscissae that do not rise.
    """
    path = places.find_file(measured.file)
    columns = [
        tables.Column(measured.x, may_be_empty=True),
        tables.Column(measured.z, may_be_empty=True),
    ]
    if isinstance(measured.sd, str):
        columns.append(tables.Column(measured.sd, low=0.0, may_be_empty=True))
    cells = tables.read(path, columns, "a CSV file of a profile")

    # A profile may be shorter than the table: cut the empty rows at both ends.
    heights = cells.values[measured.z]
    rows = [k for k, height in enumerate(heights) if not math.isnan(height)]
    first, end = (rows[0], rows[-1] + 1) if rows else (0, 0)
    numbers = {column.name: cells.values[column.name][first:end] for column in columns}
    gaps = []
    for column_name, values in numbers.items():
        for k, value in enumerate(values, start=first):
            if math.isnan(value):
                cell = cells.text[column_name][k]
                allowed = "a finite number; empty heights only at the ends of a profile"
                gaps.append((k, column_name, cell, allowed))
    tables.refuse(path, gaps)

    x = numbers[measured.x]
    z = numbers[measured.z]
    if len(x) <= measured.functions:
        raise InputError(
            source=path,
            key="rows",
            value=len(x),
            allowed=f"more than functions, {measured.functions}",
        )
    for row, (before, after) in enumerate(pairwise(x), start=first + 2):
        if not after > before:
            raise InputError(
                source=f"{path}, row {row}",
                key=measured.x,
                value=after,
                allowed=f"above the previous row's {before:g}",
            )
    profile = Profile(name, tuple(x), tuple(z), measured.functions)
    if profile.height == 0:
        raise InputError(
            source=path,
            key=measured.z,
            value=0,
            allowed="a height that is not 0: tolerances are in percent of it",
        )

    if not isinstance(measured.sd, str):
        return _ProfileWithError(profile, float(measured.sd))
    deviations = numbers[measured.sd]
    mean_square = sum(sd**2 for sd in deviations) / len(deviations)
    return _ProfileWithError(profile, math.sqrt(mean_square))
