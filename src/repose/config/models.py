"""Define the whole configuration as a model with typed sections, `StudySettings`.

Most sections are models of the rooms that read them, such as
`repose.calibrate.search.settings`. Bench tests and strategies that register themselves
add sections of their own. config/README.md explains the keys.
"""

import math
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError, create_model

from repose.bench import bench
from repose.bench import names as bench_test_names
from repose.bench.funnel import FunnelSettings
from repose.bench.parameters import ALLOWED, LABELS, LAW_PARAMETERS, PARAMETERS
from repose.bench.settings import SimulationSettings, WallSettings
from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.parameter_types import (
    Constraints,
    count_free,
    find_far_priors,
    make_parameter_type,
)
from repose.calibrate.profiles import ProfileSection
from repose.calibrate.responses import Response, find_response, list_responses
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.settings import StrategyName, SurrogateName
from repose.calibrate.strategies.refined import RefineSettings
from repose.calibrate.strategies.response_surface import ResponseSurfaceSettings
from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import MAX_SIZE
from repose.calibrate.uncertainty.settings import PosteriorSettings, SensitivitySettings
from repose.common import faults
from repose.common.errors import raise_together
from repose.common.keys import Origin
from repose.common.section import (
    ABSENT,
    FILE,
    RISING,
    Allowed,
    Contradictions,
    PathOrNull,
    Section,
)
from repose.common.target_range import (
    MIN_RELATIVE_RANGE,
    STANDARD_ERRORS,
    compute_target_range,
)
from repose.config import results_folder
from repose.config.loader import is_external
from repose.grain.settings import GrainSettings
from repose.measure.settings import MeasureSettings
from repose.stages.settings import ValidationSettings

# --- types of several keys ------------------------------------------------------------

LABEL_WORDS = "text of 1 to 60 characters: a to z, A to Z, digits, _ and -"
Label = Annotated[
    str,
    Field(max_length=60, pattern=r"^[A-Za-z0-9_][A-Za-z0-9_-]*$"),
    Allowed(LABEL_WORDS),
]
FOLDER_WORDS = (
    "a folder; letters, digits and . _ / -, without .., and no part begins with . or -"
)
PATH_PART = r"[A-Za-z0-9_][A-Za-z0-9_.-]*"
FOLDER_PATTERN = rf"^/?{PATH_PART}(/{PATH_PART})*/?$"
_Folder = Annotated[
    str, Field(max_length=1000, pattern=FOLDER_PATTERN), Allowed(FOLDER_WORDS)
]
ResultsFolder = Annotated[
    _Folder, AfterValidator(results_folder.require_separate_folder)
]
Colour = Annotated[
    str,
    Field(pattern=r"^#[0-9a-fA-F]{6}$"),
    Allowed('a colour in quotes, as "#cca86b"'),
]
Note = Annotated[
    str,
    Field(max_length=600, pattern=r"^[^\r\n]+$"),
    Allowed("text of 1 to 600 characters on one line, or null"),
]
Number = Annotated[float, Field(ge=-MAX_SIZE, le=MAX_SIZE)]


# --- the contact parameters -----------------------------------------------------------

# Stands for infinity where a parameter has no largest value. No parameter is so large.
HIGHEST_JSON_NUMBER = 1.0e9


class ParametersSettings(Section):
    """The contact parameters.

    A restitution is exact only for a hit that lasts many time steps. With the time step
    of `auto`, the real restitution is smaller (`repose.config.hits`).
    """

    @property
    def entries(self) -> dict[str, Any]:
        """The parameters of the study, without those of other contact laws."""
        return {name: entry for name, entry in self if entry is not None}

    def contradictions(self) -> Contradictions:
        """Find priors that the ranges exclude, and parameters that are all fixed."""
        yield from find_far_priors(self.entries)
        if not count_free(self.entries):
            yield "", "at least one free parameter: there is nothing to calibrate"


def _make_parameters_model() -> type[ParametersSettings]:
    """Make the model of the section `parameters`, with a field for each parameter.

    The fields are the six parameters of the article's Table 2, and the additional
    parameters of contact laws.

    Returns
    -------
    type of ParametersSettings
        A subclass, whose fields pydantic checks.
    """
    # Every study has the six parameters of Table 2, so these fields have no default.
    fields: dict[str, Any] = {}
    for name in PARAMETERS:
        field = Field(description=LABELS[name], json_schema_extra={"source": "Table 2"})
        fields[name] = (make_parameter_type(*ALLOWED[name]), field)

    # Only studies with a certain contact law have its additional parameters. Therefore
    # these fields have the default `ABSENT`, which stands for a missing key.
    for name, law_parameter in LAW_PARAMETERS.items():
        # The constant of the law has the lowest and the highest allowed value.
        limits = law_parameter.constant
        # The schema of the model is written as JSON, which has no infinite numbers.
        highest = min(limits.most, HIGHEST_JSON_NUMBER)
        laws = ", ".join(f"`{law}`" for law in law_parameter.laws)
        meaning = f"{law_parameter.label}; only with {laws}"
        field = Field(default=ABSENT, description=meaning)
        fields[name] = (make_parameter_type(limits.least, highest), field)
    return create_model("Parameters", __base__=ParametersSettings, **fields)


# --- the targets ----------------------------------------------------------------------


class TargetSettings(Section):
    """A measured response."""

    response: str = Field(
        min_length=1,
        max_length=60,
        description="the measured quantity: `aor_deg`, `height_mm`, or another "
        "response of the bench test",
        json_schema_extra={"source": "2.3"},
    )
    apparatus: str = Field(
        min_length=1,
        max_length=60,
        description="the bench test that gives it: one with a section in the "
        "configuration ([bench_tests.md](../docs/bench_tests.md)); by default that of "
        "the response",
        json_schema_extra={"source": "2.3"},
    )
    value: Number = Field(
        description="mean of the physical repetitions, in the unit of the response",
        json_schema_extra={"source": "2.3"},
    )
    aim: Number = Field(
        default=ABSENT,
        description="number in `range` at which the search aims; by default `value`",
        json_schema_extra={"source": "3.3"},
    )
    sd: float = Field(
        ge=0,
        le=MAX_SIZE,
        description="standard deviation of the repetitions",
        json_schema_extra={"source": "2.3"},
    )
    repetitions: int = Field(
        ge=1,
        le=10000,
        description="number of physical repetitions",
        json_schema_extra={"source": "2.3"},
    )
    range: Annotated[
        Annotated[tuple[Number, Number], Field(strict=False), RISING],
        Allowed("a pair [low, high] of numbers with low < high"),
    ] = Field(
        description="a solution predicted inside it is feasible; by default `value` ± "
        "two standard errors, at least 1 %",
        json_schema_extra={"source": "3.3"},
    )
    weight: float = Field(
        default=1.0,
        gt=0,
        le=1.0e6,
        description="weight of the response in the search's objective",
    )
    profile: ProfileSection = Field(
        default=ABSENT,
        description="the profile of which the response is a score; the program writes "
        "it",
    )

    def contradictions(self) -> Contradictions:
        """Find an unknown response, or a value outside the allowed range.

        Only the first problem is yielded, because it usually causes the others.

        Yields
        ------
        tuple of str
            A key of this section, and a description of its allowed values. An error
            message puts the description after the word "expected".
        """
        # The key `apparatus` names a bench test, which has certain responses.
        known_responses = [response.name for response in list_responses(self.apparatus)]
        if not known_responses:
            yield "apparatus", f"one of {', '.join(bench_test_names())}"
            return
        response = find_response(self.response)
        if response is None or response.apparatus != self.apparatus:
            yield (
                "response",
                f"one of {', '.join(known_responses)}, the responses of {self.apparatus}",
            )
            return

        # The response may be a score of a profile. The program computes such scores
        # from the measured heights of the profile, so a user cannot give them directly.
        if response.profile and self.profile is None:
            yield (
                "response",
                f"a response that is a number, or {response.profile} with the file of its "
                "measured heights",
            )
            return
        yield from self._find_values_outside_limits(response)

    def _find_values_outside_limits(self, limits: Response) -> Contradictions:
        """Find a value beyond the limits of the response or outside the target's range.

        Only the first problem is yielded, because it usually causes the others.

        Parameters
        ----------
        limits : Response
            The response, with its lowest and its highest possible value.

        Yields
        ------
        tuple of str
            A key of this section, and a description of its allowed values.
        """
        # The value must lie within the limits of the response.
        low, high = self.range
        within_limits = f"from {limits.low:g} to {limits.high:g}"
        if not limits.low <= self.value <= limits.high:
            yield "value", within_limits
            return

        # The mean plus or minus two standard errors must lie within the limits as well,
        # even if the user gave another range. `compute_target_range` never returns a
        # range narrower than a minimum. Do not reject a minimum range, because it does
        # not come from the scatter.
        scatter_low, scatter_high = compute_target_range(
            self.value, self.sd, self.repetitions
        )
        is_scatter_allowed = limits.low <= scatter_low and scatter_high <= limits.high
        if not is_scatter_allowed and self._has_scatter_above_minimum_range():
            yield (
                "sd",
                "so small that the mean with two standard errors, "
                f"{scatter_low:g} to {scatter_high:g}, lies {within_limits}",
            )
            return

        # The range of the target must also lie within these limits.
        if not (limits.low <= low and high <= limits.high):
            yield "range", f"a pair [low, high] {within_limits}"
            return

        # The search aims at the value of the target, or at `aim` if it is set. This
        # number must lie inside the range.
        inside_range = f"inside its range, {low:g} to {high:g}"
        if self.aim is None:
            if not low <= self.value <= high:
                yield "value", inside_range
        elif not low <= self.aim <= high:
            yield "aim", inside_range

    def _has_scatter_above_minimum_range(self) -> bool:
        """Tell whether the scatter is wider than the minimum range around the value."""
        scatter = STANDARD_ERRORS * self.sd / math.sqrt(self.repetitions)
        return scatter > MIN_RELATIVE_RANGE * abs(self.value)


class ExternalTarget(Section):
    """A measured response of the user's own program, in the resolved form."""

    response: str
    apparatus: str
    value: Number
    sd: float
    repetitions: int
    range: Annotated[tuple[Number, Number], Field(strict=False)]
    unit: str
    definition: str = ABSENT
    noise_sd: float = ABSENT
    profile: ProfileSection = ABSENT


# --- other sections -------------------------------------------------------------------


class FiguresSettings(Section):
    """The files of every figure."""

    format: Annotated[
        Annotated[tuple[Literal["png", "pdf", "svg"], ...], Field(strict=False)],
        Allowed("a list of png and optionally pdf, svg or both"),
    ] = Field(
        default=("png",),
        description="formats of each figure; its files differ only in their endings",
    )
    dpi: int = Field(
        default=180,
        ge=72,
        le=600,
        description="pixels per inch of a PNG, and of shaded parts in other formats",
    )

    def contradictions(self) -> Contradictions:
        """Find a list without png, which the report needs, or with a repeated format."""
        if "png" not in self.format or len(set(self.format)) < len(self.format):
            allowed = "a list with png, which the report shows, and no format twice"
            yield "format", allowed


# --- the whole configuration ----------------------------------------------------------


class StudySettings(Section):
    """The whole configuration.

    Other bench tests and strategies register themselves and add their sections
    (`make_settings_type`). Read these sections by `get_bench_section` and
    `get_strategy_section`.
    """

    label: Label = Field(
        description="name of the study, which is written into results",
    )
    # A configuration of an earlier version, such as that of a kept run, lacks this key.
    note: Note | None = Field(
        default=None,
        description="what a reader of the report has to know about the data of the "
        "study, such as who measured them",
    )
    small_run: bool = Field(
        description="whether to mark figures and tables as results of a small run",
    )
    results_dir: ResultsFolder = Field(
        description="folder for all results, outside the project's own folders; a run "
        "stops rather than replace a file of yours",
    )
    photograph: PathOrNull = Field(
        description="picture of the physical pile, PNG or JPEG, for the report",
    )
    colour: Colour = Field(
        description="colour of the grains in pictures and films",
    )
    strategy: StrategyName = Field(
        description="method of calibration, which determines what a run without a "
        "target makes",
        json_schema_extra={"source": "`published`"},
    )
    berry: GrainSettings
    funnel: FunnelSettings
    wall: WallSettings
    parameters: ParametersSettings
    constraints: Constraints = Field(
        default=ABSENT,
        description="inequalities between two parameters that every parameter set of "
        "the study obeys, such as `mur_gg <= 0.5 * mus_gg`",
    )
    design: DesignSettings
    simulation: SimulationSettings
    measure: MeasureSettings
    surrogate: SurrogateName = Field(
        description="the fast model that stands for the simulator "
        "([which](../docs/network.md))",
        json_schema_extra={"source": "3.2: `network`"},
    )
    network: NetworkSettings
    targets: Annotated[
        tuple[TargetSettings, ...],
        Field(strict=False, min_length=1),
        Allowed(
            "a list of one or more targets: response, value, sd and repetitions, or "
            "the file of a profile"
        ),
    ]
    miga: MigaSettings
    validation: ValidationSettings
    posterior: PosteriorSettings
    sensitivity: SensitivitySettings
    refine: RefineSettings
    response_surface: ResponseSurfaceSettings
    sequential: SequentialSettings
    figures: FiguresSettings = Field(default_factory=FiguresSettings)

    def get_bench_section(self, name: str) -> Section | None:
        """Return the section of a bench test; None if the configuration lacks it."""
        section: Section | None = getattr(self, name)
        return section

    def count_seeds(self, name: str) -> int:
        """Return the number of runs of a sample in a bench test."""
        seeds: int = getattr(self.get_bench_section(name), "seeds")  # noqa: B009
        return seeds

    def count_design_seeds(self, name: str) -> int:
        """Return the number of runs per sample in the design of the strategy.

        Each run of a sample has another seed. A strategy may have a key for the number
        of seeds, which then holds for all bench tests. Otherwise each bench test has
        such a key in its section.

        Parameters
        ----------
        name : str
            The bench test of the runs.

        Returns
        -------
        int
            The number of runs.
        """
        from repose.calibrate.strategies import strategy

        seeds_key = strategy(self.strategy).seeds_key
        if seeds_key is None:
            return self.count_seeds(name)
        # The key consists of a section and a name, such as refine.seeds.
        section_name, key = seeds_key.split(".")
        section = getattr(self, section_name)
        seeds: int = getattr(section, key)
        return seeds

    def get_strategy_section(self, name: str) -> Section | None:
        """Return the section with the name of a strategy; None if it has none."""
        from repose.calibrate.strategies import strategy

        if strategy(name).settings is None:
            return None
        section: Section | None = getattr(self, name)
        return section

    @property
    def free(self) -> int:
        """Number of free parameters."""
        return count_free(self.parameters.entries)


def make_settings_type() -> type[StudySettings]:
    """Make the model of a whole configuration.

    The model is a subclass of `StudySettings` with a section for each strategy and
    bench test that is registered when this function is called.
    """
    from repose.calibrate import strategies

    return _make_cached_settings_type(bench_test_names(), strategies.names())


@cache
def _make_cached_settings_type(
    bench_tests: tuple[str, ...], strategies: tuple[str, ...]
) -> type[StudySettings]:
    """Make the model of a configuration with these bench tests and strategies.

    A model with many fields takes time to make, so the result is cached by both
    arguments.

    Parameters
    ----------
    bench_tests : tuple of str
        Names of all registered bench tests.
    strategies : tuple of str
        Names of all registered strategies.

    Returns
    -------
    type of StudySettings
        A subclass of `StudySettings`. It adds the sections of those bench tests and
        strategies that `StudySettings` itself does not have.
    """
    from repose.calibrate.strategies import strategy

    # Map the name of each further section to its type and its default. A strategy's
    # section must be there, because config/method.yaml or the author of the strategy
    # gives its defaults; pydantic's sign for this is `...`. The section of a bench test
    # may be missing, because a study need not use the bench test.
    sections: dict[str, Any] = {}
    for name in strategies:
        section_model = strategy(name).settings
        if section_model is not None and name not in StudySettings.model_fields:
            sections[name] = (section_model, ...)
    for name in bench_tests:
        if name not in StudySettings.model_fields:
            sections[name] = (bench(name).settings, ABSENT)
    return create_model(
        "Configuration",
        __base__=StudySettings,
        parameters=(_make_parameters_model(), ...),
        **sections,
    )


def make_settings(
    config: Mapping[str, Any], source: str | Origin = "configuration"
) -> StudySettings:
    """Make the typed sections of a whole configuration.

    Raises
    ------
    InputError
        With all problems. The messages name `source` as the file.
    """
    model = make_settings_type()
    try:
        return model.model_validate(config)
    except ValidationError:
        raise_together(faults.find_faults(config, source, model).faults)
        raise


def select_valid_sections(config: Mapping[str, Any]) -> StudySettings:
    """Return the typed sections of a configuration, without the invalid ones.

    During a check, a rule or a computed number needs only some sections, while others
    may be invalid. Invalid sections are left out silently, because another function,
    `repose.common.faults.find_faults`, reports them.

    Parameters
    ----------
    config : mapping
        The configuration, which need not be valid.

    Returns
    -------
    StudySettings
        The valid sections. Other sections are not attributes of this object, so reading
        one raises an AttributeError.
    """
    settings_type = make_settings_type()
    sections: dict[str, Any] = {}
    for name in settings_type.model_fields:
        if name not in config:
            continue
        validator = _make_validator(settings_type, name)
        try:
            sections[name] = validator.validate_python(config[name])
        except ValidationError:
            continue
    # This constructor checks nothing, and leaves out the other sections.
    return settings_type.model_construct(**sections)


def make_targets(
    config: Mapping[str, Any],
) -> tuple[TargetSettings | ExternalTarget, ...]:
    """Make the typed targets of a configuration that was checked."""
    if is_external(config):
        return tuple(map(ExternalTarget.model_validate, config["targets"]))
    adapter = _make_validator(make_settings_type(), "targets")
    targets: tuple[TargetSettings, ...] = adapter.validate_python(config["targets"])
    return targets


@cache
def _make_validator(model: type[StudySettings], name: str) -> TypeAdapter[Any]:
    """Make the validator of a key at the top of a configuration."""
    field = model.model_fields[name]
    annotation: Any = field.annotation
    # Pydantic has removed the constraints from the annotation. Add them again.
    for constraint in field.metadata:
        annotation = Annotated[annotation, constraint]
    return TypeAdapter(annotation)


def list_file_keys() -> tuple[str, ...]:
    """List the dotted keys of the configuration that name a file."""
    return _list_file_keys_of_model(make_settings_type())


@cache
def _list_file_keys_of_model(model: type[Section]) -> tuple[str, ...]:
    """List the keys that name a file, in a section's model and in its inner sections.

    Parameters
    ----------
    model : type of Section
        The model. The type of a key that names a file is marked by `FILE`.

    Returns
    -------
    tuple of str
        Keys relative to the section, with a dot for each inner section.
    """
    keys: list[str] = []
    for name, field in model.model_fields.items():
        value_type = field.annotation
        if FILE in field.metadata:
            keys.append(name)
        elif isinstance(value_type, type) and issubclass(value_type, Section):
            # An inner section.
            keys += [f"{name}.{key}" for key in _list_file_keys_of_model(value_type)]
    return tuple(keys)
