"""`StudySettings`, the whole configuration as typed sections, and the sections that belong to no room below.

Every room brings its sections, such as `repose.calibrate.search.settings`, and so do bench tests (`BenchTest.settings`) and
strategies; config/README.md explains the keys.
"""

import math
import sys
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, create_model

from repose.bench import bench, names
from repose.bench.funnel import FunnelSettings
from repose.bench.parameters import ALLOWED, FURTHER, PARAMETERS
from repose.bench.settings import SimulationSettings, WallSettings
from repose.calibrate.designs.settings import DesignSettings, ValidationSettings
from repose.calibrate.parameter_space import PRIOR_WIDTHS
from repose.calibrate.profiles import OfProfile
from repose.calibrate.responses import Response, named, responses_of
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.strategies.refined import RefineSettings
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import LARGEST, LEAST_RANGE, range_about
from repose.calibrate.uncertainty.settings import PosteriorSettings, SensitivitySettings
from repose.common.errors import did_you_mean
from repose.common.section import (
    ABSENT,
    AUTO,
    FILE,
    RISING,
    Auto,
    Contradictions,
    OneOf,
    PathOrNull,
    Section,
    refuse,
)
from repose.config import results_folder
from repose.grain.settings import GrainSettings
from repose.measure.angles import DEFINITIONS
from repose.measure.profile_points import FLANK_RULES

# --- types of several keys -------------------------------------------------------------------------------------

LABEL = "text of 1 to 60 characters, letters, digits, _ and -"
Label = Annotated[
    str,
    Field(max_length=60, pattern=r"^[A-Za-z0-9_][A-Za-z0-9_-]*$", description=LABEL),
]
FOLDER = (
    "a folder; letters, digits and . _ / -, without .., and no part begins with . or -"
)
PART = r"[A-Za-z0-9_][A-Za-z0-9_.-]*"
_Folder = Annotated[
    str, Field(max_length=1000, pattern=rf"^/?{PART}(/{PART})*/?$", description=FOLDER)
]
ResultsFolder = Annotated[_Folder, AfterValidator(results_folder.apart)]
Colour = Annotated[
    str,
    Field(pattern=r"^#[0-9a-fA-F]{6}$", description='a colour in quotes, as "#cca86b"'),
]
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]


# --- the parameters --------------------------------------------------------------------------------------------


def _is_number(value: object) -> bool:
    """Return whether a value is a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def parameter(low: float, high: float) -> Any:
    """Make the type of a contact parameter within bounds: a range, a fixed value, or prior knowledge."""
    bounded = high < sys.float_info.max
    number = f"a number from {low:g} to {high:g}" if bounded else "a number"
    pair = f"a pair [low, high] of numbers{number[len('a number') :]} with low < high"
    allowed = f"{pair}; or fixed; or prior with mean and sd"

    def is_within(value: Any) -> bool:
        return _is_number(value) and low <= value <= high

    def is_pair(value: Any) -> bool:
        if (
            not isinstance(value, list | tuple)
            or len(value) != 2
            or not all(map(is_within, value))
        ):
            return False
        return bool(value[1] - value[0] > max(1e-30, 1e-9 * max(map(abs, value))))

    def faults(given: Mapping[str, Any]) -> Contradictions:
        keys, prior = ("fixed", "prior", "range"), given.get("prior")
        unknown = [str(key) for key in given if key not in keys]
        for key in unknown:
            yield (
                key,
                f"a known key{did_you_mean(key, keys) or '; keys here: fixed, prior, range'}",
            )
        if "fixed" in given and len(given) > 1:
            yield "", "fixed alone, or prior with or without range"
        elif "fixed" in given and not is_within(given["fixed"]):
            yield "fixed", number
        elif "range" in given and "prior" not in given:
            yield "", "a pair [low, high]; a range stands beside a prior only"
        elif (
            not unknown
            and "fixed" not in given
            and (prior is None or not is_pair(given.get("range", [low, high])))
        ):
            yield "", allowed
        elif prior is not None:
            if not isinstance(prior, Mapping) or set(prior) != {"mean", "sd"}:
                yield "prior", "a section with the keys mean and sd"
            elif not is_within(prior["mean"]):
                yield "prior", f"a mean that is {number}"
            elif not (_is_number(prior["sd"]) and 0 < prior["sd"] <= high):
                yield (
                    "prior",
                    "an sd above 0" + (f" and up to {high:g}" if bounded else ""),
                )

    def checked(given: Any) -> Any:
        refuse(
            faults(given)
            if isinstance(given, Mapping)
            else ()
            if is_pair(given)
            else [("", allowed)]
        )
        return given

    kinds: Any = {"anyOf": [{"type": "array"}, {"type": "object"}]}
    return Annotated[
        Any,
        AfterValidator(checked),
        Field(description=allowed, json_schema_extra=kinds),
    ]


def far_priors(parameters: Mapping[str, Any]) -> Contradictions:
    """Refuse parameters whose range lies beyond their prior."""
    for name, given in parameters.items():
        if isinstance(given, Mapping) and "range" in given:
            mean, reach = given["prior"]["mean"], PRIOR_WIDTHS * given["prior"]["sd"]
            low, high = mean - reach, mean + reach
            if high < given["range"][0] or low > given["range"][1]:
                yield (
                    name,
                    f"a range that meets {low:g} to {high:g}, {PRIOR_WIDTHS:g} sd about the mean of its prior",
                )


def all_fixed(parameters: Mapping[str, Any]) -> bool:
    """Return whether no parameter is free."""
    return all("fixed" in given for given in parameters.values())


class ParametersSettings(Section):
    """The contact parameters."""

    @property
    def given(self) -> dict[str, Any]:
        """The parameters of the study, without those of other contact laws."""
        return {name: value for name, value in self if value is not None}

    def contradictions(self) -> Contradictions:
        """Refuse parameters that are all fixed, and a prior that its range excludes."""
        yield from far_priors(self.given)
        if all_fixed(self.given):
            yield "", "at least one free parameter: there is nothing to calibrate"


def _parameters() -> type[ParametersSettings]:
    """Make the model with the six parameters, and those of the contact laws."""
    six: dict[str, Any] = {
        name: (parameter(*ALLOWED[name]), ...) for name in PARAMETERS
    }
    ends = {
        name: (of.constant.least, min(of.constant.most, 1.0e9))
        for name, of in FURTHER.items()
    }
    further: dict[str, Any] = {
        name: (parameter(*pair), ABSENT) for name, pair in ends.items()
    }
    return create_model("Parameters", __base__=ParametersSettings, **six, **further)


StrategyName = Annotated[
    str, OneOf(lambda: import_module("repose.calibrate.strategies").names())
]
SurrogateName = Annotated[
    str, OneOf(lambda: import_module("repose.calibrate.surrogates").names())
]


class MeasureSection(Section):
    """Measurement of a pile."""

    views: int = Field(ge=1, le=360)
    mm_per_pixel: Annotated[float, Field(ge=0.02, le=5)] | Auto = AUTO
    response: Annotated[str, OneOf(lambda: DEFINITIONS)]
    fit_from: Literal["berry"] | Annotated[float, Field(ge=0, le=0.9)]
    fit_to: Literal["berry"] | Annotated[float, Field(ge=0.1, le=1)]
    berry_height_mm: Annotated[float, Field(gt=0, le=1000)] | None
    largest_pile_only: bool
    flank: Annotated[str, OneOf(lambda: FLANK_RULES)]
    smallest_window: float = Field(ge=0.1, le=1)

    def contradictions(self) -> Contradictions:
        """Refuse an upper end of the fitted part that leaves the part too short for a line."""
        start, end = self.fit_from, self.fit_to
        if start == end == "berry":
            yield "fit_to", "a number from 0.1 to 1, as measure.fit_from is berry"
        if isinstance(start, float) and isinstance(end, float) and end < start + 0.1:
            yield "fit_to", f"at least 0.1 above measure.fit_from, {start:g}"


class TargetSettings(Section):
    """A measured response."""

    response: str = Field(min_length=1, max_length=60)
    apparatus: str = Field(min_length=1, max_length=60)
    value: Number
    aim: Number = ABSENT  # a target without this key aims at its value
    sd: float = Field(ge=0, le=LARGEST)
    repetitions: int = Field(ge=1, le=10000)
    range: Annotated[tuple[Number, Number], Field(strict=False), RISING] = Field(
        description="a pair [low, high] of numbers with low < high"
    )
    weight: float = Field(default=1.0, gt=0, le=1.0e6)
    profile: OfProfile = (
        ABSENT  # it is a score of this; `repose.config.profiles` writes it
    )

    def contradictions(self) -> Contradictions:
        """Refuse a response of no bench test, and values outside the allowed range."""
        known = [response.name for response in responses_of(self.apparatus)]
        found = named(self.response)
        if not known:
            yield "apparatus", f"one of {', '.join(names())}"
        elif found is None or found.apparatus != self.apparatus:
            yield (
                "response",
                f"one of {', '.join(known)}, the responses of {self.apparatus}",
            )
        elif found.profile and self.profile is None:
            yield (
                "response",
                f"a number, or {found.profile} with the file of its measured heights",
            )
        else:
            yield from self._outside(found)

    def _outside(self, limits: Response) -> Contradictions:
        """Refuse values outside the limits of the response, or outside the target's own range."""
        low, high = self.range
        within = f"from {limits.low:g} to {limits.high:g}"
        if not limits.low <= self.value <= limits.high:
            yield "value", within
            return
        if low < limits.low or high > limits.high:
            written = (low, high) != range_about(self.value, self.sd, self.repetitions)
            if not written and self.sd / math.sqrt(
                self.repetitions
            ) > LEAST_RANGE * abs(self.value):
                yield (
                    "sd",
                    f"so small that the mean with its standard error, {low:g} to {high:g}, lies {within}",
                )
            else:
                yield "range", f"a pair [low, high] {within}"
            return
        aimed = "value" if self.aim is None else "aim"
        if not low <= getattr(self, aimed) <= high:
            yield aimed, f"inside its range, {low:g} to {high:g}"


# --- the chain -------------------------------------------------------------------------------------------------


class FiguresSettings(Section):
    """The files of every figure."""

    format: Annotated[tuple[Literal["png", "pdf", "svg"], ...], Field(strict=False)] = (
        Field(
            default=("png",),
            description="a list of png and, beside it, pdf or svg or both",
        )
    )
    dpi: int = Field(default=180, ge=72, le=600)

    def contradictions(self) -> Contradictions:
        """Refuse formats that lack the report's, or hold one of them twice."""
        if "png" not in self.format or len(set(self.format)) < len(self.format):
            yield (
                "format",
                "a list with png, which the report shows, and no format twice",
            )


# --- the whole --------------------------------------------------------------------------------------------------


class StudySettings(Section):
    """The whole configuration, without the sections of strategies and bench tests (`settings_type`)."""

    label: Label
    small_run: bool
    results_dir: ResultsFolder
    photograph: PathOrNull
    colour: Colour
    strategy: StrategyName
    berry: GrainSettings
    funnel: FunnelSettings
    wall: WallSettings
    parameters: ParametersSettings
    design: DesignSettings
    simulation: SimulationSettings
    measure: MeasureSection
    surrogate: SurrogateName
    network: NetworkSettings
    targets: Annotated[tuple[TargetSettings, ...], Field(strict=False)] = Field(
        min_length=1,
        description="a list of one or more targets: response, value, sd and repetitions, or the file of a profile",
    )
    miga: MigaSettings
    validation: ValidationSettings
    posterior: PosteriorSettings
    sensitivity: SensitivitySettings
    refine: RefineSettings
    figures: FiguresSettings = Field(default_factory=FiguresSettings)


def settings_type() -> type[StudySettings]:
    """Make the model of a whole configuration: `StudySettings`, and a section for each strategy and bench test."""
    from repose.calibrate import strategies

    return _settings_type(names(), strategies.names())


@cache
def _settings_type(
    apparatus: tuple[str, ...], strategies: tuple[str, ...]
) -> type[StudySettings]:
    """Make the model for these bench tests and strategies."""
    from repose.calibrate.strategies import strategy

    sections: dict[str, Any] = {
        name: (strategy(name).settings, ...)
        for name in strategies
        if strategy(name).settings is not None
    }
    sections |= {
        name: (bench(name).settings, ABSENT)
        for name in apparatus
        if name not in StudySettings.model_fields
    }
    return create_model(
        "Configuration",
        __base__=StudySettings,
        parameters=(_parameters(), ...),
        **sections,
    )


def named_files() -> tuple[str, ...]:
    """Return the dotted keys of the configuration that name a file: those of the types that `FILE` marks."""
    return _files_of(settings_type())


@cache
def _files_of(model: type[Section]) -> tuple[str, ...]:
    """Return the keys of a section's model, and of the sections in it, that name a file."""
    keys: list[str] = []
    for name, field in model.model_fields.items():
        if FILE in field.metadata:
            keys.append(name)
        elif isinstance(field.annotation, type) and issubclass(
            field.annotation, Section
        ):
            keys += [f"{name}.{key}" for key in _files_of(field.annotation)]
    return tuple(keys)
