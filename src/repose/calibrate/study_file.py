"""The short configuration of a study with a simulator of the user's own.

A file, or the arguments of `repose.Study`, give a few keys; all others have the values
of config/method.yaml or the defaults below. docs/own_simulator.md explains the keys.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, create_model, field_validator

from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.parameter_types import (
    Constraints,
    count_free,
    find_constraint_errors,
    find_far_priors,
    make_parameter_type,
)
from repose.calibrate.profile_targets import expand_own_profiles
from repose.calibrate.profiles import Profile, ProfileSection
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.settings import (
    CalibrationSettings,
    StrategyName,
    SurrogateName,
)
from repose.calibrate.strategies import names, obeying_strategies, strategy
from repose.calibrate.strategies.refined import RefineSettings
from repose.calibrate.strategies.response_surface import ResponseSurfaceSettings
from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Target, Targets, make_own_response
from repose.calibrate.uncertainty.settings import PosteriorSettings
from repose.common import faults, places
from repose.common.errors import YamlError, raise_together
from repose.common.keys import Origin, find_file_to_edit, get_value
from repose.common.reading import read_yaml
from repose.common.section import ABSENT, AUTO, Allowed, Contradictions, Section, refuse
from repose.common.target_range import compute_target_range

# Names that no parameter and no response may have, because they are columns of tables.
RESERVED_NAMES = (
    "sample",
    "run",
    "status",
    "turn",
    "runs",
    "seeds",
    "batch",
    "reason",
    "n_seeds",
)
# Sections whose seed is replaced by the seed of the study.
SEEDED_SECTIONS = ("design", "network", "miga", "posterior")
# Keys that are read with every surrogate.
TRAINING_KEYS = ("network.split", "network.replicates", "network.validation_noise")
# Keys that are read with the strategies that begin with the article's design.
DESIGN_KEYS = ("seeds", "design", "surrogate", "network", "miga", *TRAINING_KEYS)
# Keys that are read with every strategy.
COMMON_KEYS = (
    "parameters",
    "targets",
    "posterior",
    "sequential.tolerance_percent",
    "sequential.probability",
)
# Defaults of the sampler of the posterior. It has more walkers and fewer steps than in
# config/method.yaml.
N_WALKERS = 128
N_STEPS = 400
MAX_SIZE = 1e12
# Smallest noise of a response, as a fraction of its value. Rounding errors would hide a
# smaller one.
MIN_NOISE_FRACTION = 1e-9
# Keys outside of sections that some strategies do not read.
OPTIONAL_KEYS = ("seeds", "surrogate")

Line = Annotated[str, Field(pattern=r"^[^\n]*\S[^\n]*$"), Allowed("text of one line")]
Size = Annotated[float, Field(ge=0, le=MAX_SIZE)]
Value = Annotated[float, Field(ge=-MAX_SIZE, le=MAX_SIZE)]
Parameter = make_parameter_type(-1e30, 1e30)


class OwnTarget(Section):
    """A measured response."""

    value: Value
    sd: Size
    repetitions: int = Field(ge=1, le=10_000)
    range: Annotated[
        tuple[Value, Value],
        Field(strict=False),
        Allowed("a pair [low, high] of numbers"),
    ] = ABSENT
    unit: Line = ""
    definition: Line = ABSENT
    aim: Value = ABSENT
    noise_sd: Annotated[float, Field(gt=0, le=MAX_SIZE)] = ABSENT
    # The profile of which this target is a score; `profile_targets` writes it.
    profile: ProfileSection = ABSENT

    def contradictions(self) -> Contradictions:
        """Yield the keys whose numbers are impossible or contradict each other.

        Neither `value`, the measured mean, nor `aim`, the number that the calibration
        should reach instead, may be 0 or outside the range. The noise must not be tiny.

        Yields
        ------
        pair of str
            The key of the number, and what is allowed.
        """
        # A score of a profile may be 0, because `Profile.whole` is its 100 %.
        if self.value == 0 and self.profile is None:
            yield "value", "not 0: tolerances are in percent of it"
        if self.range is not None:
            low, high = self.range
            if not low <= self.value <= high or low == high:
                yield "range", f"a pair [low, high] that contains {self.value:g}"
        if self.aim is not None:
            # The default range follows from the scatter of the repetitions.
            default_range = compute_target_range(self.value, self.sd, self.repetitions)
            low, high = self.range or default_range
            if self.aim == 0 or not low <= self.aim <= high:
                yield "aim", f"a number in the range, {low:g} to {high:g}, but not 0"
        smallest_noise = MIN_NOISE_FRACTION * abs(self.value)
        if self.noise_sd is not None and self.noise_sd < smallest_noise:
            yield "noise_sd", f"at least {smallest_noise:g}"


class OwnSequential(Section):
    """The strategy `sequential`, whose budget is in runs."""

    start_samples: int = Field(ge=2, le=10_000)
    seeds: int = Field(ge=1, le=1000)
    batch: int = Field(ge=1, le=1000)
    tolerance_percent: float = Field(ge=0.01, le=50)
    probability: float = Field(ge=0.05, le=0.99)
    most_runs: int = Field(ge=4, le=1_000_000)


class OwnPosterior(Section):
    """The posterior of the parameters."""

    discrepancy_percent: float = Field(ge=0, le=50)
    discrepancy_correlation: float = Field(ge=0, le=0.99)
    walkers: int = Field(ge=32, le=10_000)
    steps: int = Field(ge=100, le=1_000_000)


class StudyFile(Section):
    """Model of the configuration, without the sections of further strategies.

    `make_configuration_model` adds these sections.
    """

    simulator: Line
    label: Line
    seed: int = Field(ge=0, le=2**31 - 1)
    parameters: Annotated[
        dict[str, Parameter],  # type: ignore[valid-type]
        Allowed("a section with a range for each parameter"),
    ]
    constraints: Constraints = ABSENT
    targets: Annotated[
        dict[str, OwnTarget],
        Allowed("a section with value, sd and repetitions for each response"),
    ]
    strategy: StrategyName
    seeds: int = Field(ge=1, le=1000)
    surrogate: SurrogateName
    sequential: OwnSequential
    posterior: OwnPosterior
    design: DesignSettings
    network: NetworkSettings
    miga: MigaSettings
    refine: RefineSettings
    response_surface: ResponseSurfaceSettings = ABSENT

    @field_validator("sequential")
    @classmethod
    def _check_budget(
        cls, section: OwnSequential, info: ValidationInfo
    ) -> OwnSequential:
        """Raise an error if the start has more runs than the budget."""
        runs_of_start = section.start_samples * section.seeds
        is_used = info.data.get("strategy") == "sequential"
        if is_used and runs_of_start > section.most_runs:
            allowed = "at least sequential.start_samples times sequential.seeds"
            refuse([("most_runs", allowed)])
        return section

    @field_validator("parameters")
    @classmethod
    def _check_parameters(cls, parameters: dict[str, Any]) -> dict[str, Any]:
        """Check the names, that ranges are near priors, and that a parameter is free."""
        refuse([*_find_bad_columns(parameters), *find_far_priors(parameters)])
        if not count_free(parameters):
            refuse([("", "at least one range or prior")])
        return parameters

    @field_validator("constraints")
    @classmethod
    def _check_constraints(
        cls, constraints: tuple[str, ...], info: ValidationInfo
    ) -> tuple[str, ...]:
        """Check that constraints name known parameters, and allow enough of the ranges."""
        # If the parameters are invalid, `info.data` does not have them, and pydantic
        # reports them separately.
        if "parameters" in info.data:
            refuse(find_constraint_errors(constraints, info.data["parameters"]))
        return constraints

    @field_validator("targets")
    @classmethod
    def _check_targets(
        cls, targets: dict[str, OwnTarget], info: ValidationInfo
    ) -> dict[str, OwnTarget]:
        """Check the names of the targets, and require at least one target.

        Parameters, responses and standard errors are columns of one table, so their
        names must differ. The suffix _se marks the standard error of a response.
        """
        # pydantic has already validated the parameters, which come first in the model.
        # If they are invalid, `info.data` does not have them.
        parameters = info.data.get("parameters", {})
        # A response must not have the name of a parameter or of a standard error, and
        # its own standard error must not have the name of a parameter.
        standard_errors = {f"{name}_se" for name in targets}
        invalid_names = list(_find_bad_columns(targets))
        for name in targets:
            is_taken = name in parameters or name in standard_errors
            if is_taken or f"{name}_se" in parameters:
                allowed = (
                    "a name that differs from all parameters, and from all other names "
                    "with _se appended"
                )
                invalid_names.append((name, allowed))
        # `refuse` raises an error, unless its list is empty.
        refuse(invalid_names)
        if not targets:
            refuse([("", "at least one response")])
        return targets


def _find_bad_columns(names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Find names that no column of the table of runs may have.

    Yields
    ------
    pair of str
        The name, and what is allowed.
    """
    for name in names:
        is_plain = bool(name) and name.isprintable() and name == name.strip()
        if name in RESERVED_NAMES or not is_plain:
            yield (
                name,
                "another name: one line of text without spaces around it, and none of "
                f"{', '.join(RESERVED_NAMES)}",
            )


@cache
def make_configuration_model() -> type[StudyFile]:
    """Make the model of the configuration with the sections of all strategies.

    The model is cached, so strategies must be registered before the first call.
    """
    sections: dict[str, Any] = {}
    for name in names():
        model = strategy(name).settings
        if model is not None and name not in StudyFile.model_fields:
            sections[name] = (model, ABSENT)
    return create_model("OwnConfiguration", __base__=StudyFile, **sections)


def has_own_simulator(path: str | os.PathLike) -> bool:
    """Return whether a configuration is for a simulator that the user runs.

    Its key `simulator` is then a name. If `simulator` is a section, it has the command
    of a program that the workflow runs.
    """
    content = read_yaml(path)
    return "simulator" in content and not isinstance(content["simulator"], Mapping)


def complete_configuration(
    content: Mapping[str, Any],
    source: object = "study",
    model: type[StudyFile] | None = None,
) -> dict[str, Any]:
    """Add the missing keys to a configuration, and check it.

    Parameters
    ----------
    content : mapping
        The keys that the user set, with their values.
    source : object, optional
        File that an error names. An Origin names the file of each key, because a
        configuration may consist of several files.
    model : type of StudyFile, optional
        The model that checks the configuration; by default the result of
        `make_configuration_model`.

    Returns
    -------
    dict
        The configuration with all sections, including those of other strategies. The
        defaults are those of `_choose_section_defaults`.

    Raises
    ------
    InputError
        If the configuration is invalid; the error lists all invalid keys.
    """
    model = model or make_configuration_model()
    origin = source if isinstance(source, Origin) else str(source)
    # Add the defaults first, because the model has no defaults for most keys.
    config = _add_defaults(content, origin, model)
    config = faults.convert_whole_numbers(config, model)
    # This raises an error if there are any invalid keys.
    raise_together(faults.find_faults(config, origin, model).faults)

    # Each section with random numbers has the seed of the study.
    for name in SEEDED_SECTIONS:
        config[name] = config[name] | {"seed": config["seed"]}
    # The best split of the samples depends on the surrogate.
    network = config["network"]
    if network.get("split", AUTO) == AUTO:
        config["network"] = network | {"split": choose_split(config["surrogate"])}
    # This check needs the complete configuration.
    _check_strategy(config, origin)
    return config


def _check_strategy(config: Mapping[str, Any], source: str | Origin) -> None:
    """Raise an error if the strategy cannot run with the rest of the configuration.

    Parameters
    ----------
    config : mapping
        The complete configuration. Each section is valid on its own.
    source : str or Origin
        File of the configuration, for an error.

    Raises
    ------
    InputError
        If there are constraints between parameters, which the strategy does not obey.
        Or if its section does not fit the number of parameters or targets.
    """
    from repose.calibrate.strategies import cost

    name = config["strategy"]
    if "constraints" in config and not strategy(name).obeys_constraints:
        raise YamlError(
            source=find_file_to_edit(source, "strategy"),
            key="strategy",
            value=name,
            # The names of the strategies that obey constraints.
            allowed=obeying_strategies(),
        )
    # `Sequential.contradictions` requires repeated runs, and a start within the budget.
    # With the user's own simulator, the key `noise_sd` may replace repeated runs.
    # `StudyFile._check_budget` has already checked the start.
    if name == "sequential":
        return
    section = make_settings(config).of_strategy(name)
    contradictions = cost.find_contradictions(
        name,
        section,
        free=count_free(config["parameters"]),
        responses=len(config["targets"]),
    )
    raise_together(
        YamlError(
            source=find_file_to_edit(source, key),
            key=key,
            value=get_value(config, key),
            allowed=allowed,
        )
        for key, allowed in contradictions
    )


def _add_defaults(
    content: Mapping[str, Any], source: str | Origin, model: type[StudyFile]
) -> dict[str, Any]:
    """Add the defaults to the keys of the user.

    `complete_configuration` checks the result. This function checks only the names of
    parameters and targets, and profiles, because the later check needs valid ones.

    Parameters
    ----------
    content : mapping
        The keys that the user set, with their values.
    source : str or Origin
        File of these keys, for an error.
    model : type of StudyFile
        It has a field for each section of the result.

    Returns
    -------
    dict
        The configuration with a copy of each section; `content` is not changed.

    Raises
    ------
    InputError
        If a name of a parameter or target is not text, or a profile is invalid.
    """
    method: dict[str, Any] = read_yaml(places.find_file(places.METHOD_CONFIG))
    runs_per_sample = _find_runs_per_sample(
        content, otherwise=method["sequential"]["seeds"]
    )
    # The keys of the user replace these defaults of keys outside of sections.
    config: dict[str, Any] = {
        "strategy": "sequential",
        "seeds": runs_per_sample,
        "surrogate": "gaussian_process",
        **content,
    }
    _reject_unusable_names(config, source)
    # Replace each profile, which is a measured outline, by targets for its scores.
    config["targets"] = expand_own_profiles(
        config.get("targets"), find_file_to_edit(source, "targets")
    )

    # Add the defaults of each section. The keys of the user replace them.
    section_defaults = _choose_section_defaults(method, runs_per_sample)
    for name in model.model_fields:
        if not isinstance(section_defaults.get(name), Mapping):
            continue
        section = config.get(name, {})
        # A value that is not a section remains unchanged, so that
        # `complete_configuration` can name it in an error.
        if isinstance(section, Mapping):
            section = {**section_defaults[name], **section}
        config[name] = section
    return config


def _choose_section_defaults(
    method: Mapping[str, Any], runs_per_sample: int
) -> dict[str, Any]:
    """Return the defaults of all sections of a study with the user's own simulator.

    Parameters
    ----------
    method : mapping
        The content of config/method.yaml. Its sections are the defaults, except for
        `sequential` and `posterior`, which have fewer keys here.
    runs_per_sample : int
        Number of runs of a sample.

    Returns
    -------
    dict
        The defaults by name of the section.
    """
    sequential = method["sequential"]
    posterior = method["posterior"]
    own_sequential = {
        "start_samples": sequential["start_samples"],
        "seeds": runs_per_sample,
        "batch": sequential["batch"],
        "tolerance_percent": sequential["tolerance_percent"],
        "probability": sequential["probability"],
        # The pipeline pours grains, but any other simulator makes runs.
        "most_runs": sequential["most_pours"],
    }
    own_posterior = {
        "discrepancy_percent": posterior["discrepancy_percent"],
        "discrepancy_correlation": posterior["discrepancy_correlation"],
        "walkers": N_WALKERS,
        "steps": N_STEPS,
    }
    return {**method, "sequential": own_sequential, "posterior": own_posterior}


def _find_runs_per_sample(content: Mapping[str, Any], otherwise: int) -> int:
    """Return the number of runs per sample that the user set.

    It is the value of the key `seeds`, or else of `sequential.seeds`. If neither is a
    whole number, it is `otherwise`.
    """
    for key in ("seeds", "sequential.seeds"):
        seeds = get_value(content, key)
        if isinstance(seeds, int):
            return seeds
    return otherwise


def _reject_unusable_names(config: Mapping[str, Any], source: str | Origin) -> None:
    """Raise an error for parameters and targets whose names cannot be column names.

    Parameters
    ----------
    config : mapping
        The configuration, which has not been checked yet.
    source : str or Origin
        File of the configuration, for the errors.

    Raises
    ------
    YamlError
        If there are such names; the message lists all of them.
    """
    errors = []
    for section in ("parameters", "targets"):
        entries = config.get(section)
        if not isinstance(entries, Mapping):
            continue
        file = find_file_to_edit(source, section)
        for name in entries:
            # Without quotes, YAML reads a number or a date as such, and not as text.
            if not isinstance(name, str):
                allowed = "text as each name; put it in quotes"
            elif name.startswith("#"):
                allowed = (
                    "names that do not begin with #, which begins a comment in tables"
                )
            else:
                continue
            errors.append(
                YamlError(source=file, key=section, value=name, allowed=allowed)
            )
    raise_together(errors)


def choose_split(surrogate: str) -> list[float]:
    """Return the fractions (training, validation, test) of the samples for a surrogate.

    Only a network needs validation samples.
    """
    from repose.calibrate.surrogates import find_surrogate_class

    return (
        [0.70, 0.15, 0.15]
        if find_surrogate_class(surrogate).is_network
        else [0.85, 0.0, 0.15]
    )


def make_settings(config: Mapping[str, Any]) -> CalibrationSettings:
    """Convert the sections of a complete configuration to typed settings.

    A new key of `OwnSequential` or `OwnPosterior` must be added here, too.

    Parameters
    ----------
    config : mapping
        Result of `complete_configuration`, which has checked all keys.

    Returns
    -------
    CalibrationSettings
    """
    sequential = config["sequential"]
    posterior = config["posterior"]
    targets = config["targets"]
    # Read the sections of strategies registered outside this package.
    others = {}
    for name in names():
        model = strategy(name).settings
        if model is not None and name not in StudyFile.model_fields:
            others[name] = model.model_validate(config[name])
    # The settings of the two sections below belong to the pipeline, so their bounds are
    # tighter than those of `OwnSequential` and `OwnPosterior`. `model_construct` does
    # not check any bounds. It does not check the names of the fields either.
    own_sequential = SequentialSettings.model_construct(
        start_samples=sequential["start_samples"],
        seeds=sequential["seeds"],
        batch=sequential["batch"],
        tolerance_percent=sequential["tolerance_percent"],
        probability=sequential["probability"],
        # In the pipeline a run is a pour.
        most_pours=sequential["most_runs"],
        # The answer is simulated as often as any other sample.
        checks=sequential["seeds"],
    )
    own_posterior = PosteriorSettings.model_construct(
        # The keys that are only in the pipeline have their neutral values.
        shape_study=None,
        discrepancy_percent=posterior["discrepancy_percent"],
        discrepancy_correlation=posterior["discrepancy_correlation"],
        measured_correlation="simulated",
        walkers=posterior["walkers"],
        steps=posterior["steps"],
        seed=posterior["seed"],
    )
    return CalibrationSettings(
        label=config["label"],
        simulator=get_simulator_name(config),
        strategy=config["strategy"],
        surrogate=config["surrogate"],
        seeds=config["seeds"],
        design=DesignSettings.model_validate(config["design"]),
        network=NetworkSettings.model_validate(config["network"]),
        miga=MigaSettings.model_validate(config["miga"]),
        posterior=own_posterior,
        sequential=own_sequential,
        response_surface=ResponseSurfaceSettings.model_validate(
            config["response_surface"]
        ),
        refine=RefineSettings.model_validate(config["refine"]),
        others=others,
        noise_sd=_collect_from_targets("noise_sd", targets),
        definitions=_collect_from_targets("definition", targets),
    )


def get_simulator_name(config: Mapping[str, Any]) -> str:
    """Return the name of the simulator, also of one that the workflow calls."""
    simulator = config["simulator"]
    name: str = simulator["name"] if isinstance(simulator, Mapping) else simulator
    return name


def _collect_from_targets(
    key: str, targets: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Collect a key of the targets that have it, by the name of the target."""
    return {name: target[key] for name, target in targets.items() if key in target}


def make_targets(section: Mapping[str, Mapping[str, Any]]) -> Targets:
    """Make the targets of a checked configuration.

    A target without a range has that of `compute_target_range`.
    """
    return Targets([_read_target(name, entry) for name, entry in section.items()])


def _read_target(name: str, entry: Mapping[str, Any]) -> Target:
    """Make a target of the user's own simulator.

    All such responses belong to one bench test, and have no limits.
    """
    value = entry["value"]
    scatter = compute_target_range(value, entry["sd"], entry["repetitions"])
    low, high = entry.get("range", scatter)
    return Target(
        response=make_own_response(name, entry.get("unit", "")),
        value=value,
        sd=entry["sd"],
        repetitions=entry["repetitions"],
        low=low,
        high=high,
        aim=entry.get("aim", value),
        profile=Profile.of(entry["profile"]) if "profile" in entry else None,
    )


def list_unread_keys(content: Mapping[str, Any]) -> list[str]:
    """List the keys of a configuration that its strategy does not read.

    A user who sets such a key can be told that it has no effect.

    Parameters
    ----------
    content : mapping
        The keys that the user set, with their values. They have been checked.

    Returns
    -------
    list of str
        Keys such as `seeds` or `sequential.batch`, sorted.
    """
    # `_add_defaults` has the same default.
    strategy_name = content.get("strategy", "sequential")
    read_keys = _find_read_keys(strategy_name, content)

    # Collect the keys that a strategy may ignore.
    optional_keys = [key for key in OPTIONAL_KEYS if key in content]
    for section in make_configuration_model().model_fields:
        if isinstance(content.get(section), Mapping):
            optional_keys += [f"{section}.{key}" for key in content[section]]

    unread = []
    for key in optional_keys:
        # `read_keys` may have the key itself, or the section with all of its keys.
        section = key.partition(".")[0]
        is_read = key in read_keys or section in read_keys
        # `complete_configuration` replaces the seed of each section.
        is_replaced = key.endswith(".seed")
        if is_replaced or not is_read:
            unread.append(key)
    return sorted(unread)


def _find_read_keys(name: str, content: Mapping[str, Any]) -> set[str]:
    """Find the keys of a configuration that have an effect with a strategy.

    These are the keys that the strategy reads, and the keys for the analysis of its
    answer.

    Parameters
    ----------
    name : str
        Name of the strategy.
    content : mapping
        The keys that the user set, with their values.

    Returns
    -------
    set of str
        Keys such as `seeds` and `sequential.seeds`. If the name of a section is among
        them, all keys of this section are read.
    """
    strategy_of_study = strategy(name)
    has_design = strategy_of_study.begins_with_design
    keys = set(COMMON_KEYS)
    if has_design:
        keys.update(DESIGN_KEYS)
    if strategy_of_study.seeds_key is not None:
        # This strategy has its own key for the number of runs of a sample, so remove
        # the one of `DESIGN_KEYS`.
        keys.discard("seeds")
    if strategy_of_study.reads:
        keys.update(strategy_of_study.reads)
    elif not has_design:
        # For this strategy it is unknown which keys it reads, so regard all as read.
        keys.update(content)

    # Only surrogates whose names begin with "network" read the whole section `network`.
    # For the others, the `TRAINING_KEYS` of this section remain.
    is_network = content.get("surrogate", "").startswith("network")
    if has_design and not is_network:
        keys.discard("network")

    # Two keys set the number of runs of a sample, but only one of them is read.
    if "sequential" in keys or "seeds" in keys:
        keys.discard("seeds")
        keys.add(_choose_key_of_seeds(name, content))
    return keys


def _choose_key_of_seeds(name: str, content: Mapping[str, Any]) -> str:
    """Choose the key with the number of runs of a sample.

    If the user set both keys, only the strategy `sequential` reads that of its section.

    Parameters
    ----------
    name : str
        Name of the strategy.
    content : mapping
        The keys that the user set, with their values.

    Returns
    -------
    str
        "seeds" or "sequential.seeds".
    """
    has_section_key = get_value(content, "sequential.seeds") is not None
    prefers_section_key = name == "sequential" or "seeds" not in content
    return "sequential.seeds" if has_section_key and prefers_section_key else "seeds"
