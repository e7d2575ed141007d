"""Configure a study in which the workflow calls another program for its runs.

Three forms of a configuration occur in this module:

- The short form is what docs/own_simulator.md describes. It has a mapping of targets by
  name, and the number of runs and the seed at its top.
- A study with our simulator, this package, has a list of targets and further sections.
  A user may add a section `simulator` to it. This module converts it to the short form.
- The resolved form is complete and has all defaults. This module makes it from the
  short form. It is written to RESULTS/config.json and read by the stages.
"""

from collections.abc import Iterable, Mapping
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Self

from pydantic import Field, create_model, field_validator

from repose.calibrate import strategies
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.parameter_types import count_free
from repose.calibrate.responses import Definitions, find_response
from repose.calibrate.study import Study
from repose.calibrate.study_file import (
    OwnTarget,
    StudyFile,
    complete_configuration,
    make_configuration_model,
)
from repose.calibrate.targets import OWN_BENCH, Targets
from repose.calibrate.uncertainty.settings import SensitivitySettings
from repose.common import places, provenance
from repose.common.errors import InputError, YamlError, raise_together
from repose.common.files import StrPath
from repose.common.keys import Origin, get_value
from repose.common.section import PathOrNull, Section, refuse
from repose.common.target_range import compute_target_range
from repose.config import loader, results_folder
from repose.config.models import (
    FiguresSettings,
    Label,
    Note,
    ResultsFolder,
    StudySettings,
    make_settings_type,
    make_targets,
)
from repose.config.pipeline import PipelineConfig
from repose.measure.settings import MeasureSettings
from repose.stages import simulate
from repose.stages.settings import SimulatorSettings, ValidationSettings

if TYPE_CHECKING:
    from repose.config.validation import ConfigChecks

# Sections for which the short form has other bounds than the models of `StudySettings`.
SECTIONS_WITH_OTHER_BOUNDS = ("sequential", "posterior")
# Keys at the top of the short form, and the keys with the same meaning in a study with
# our simulator.
MOVED_KEYS = {"seeds": "funnel.seeds", "seed": "design.seed"}
# Keys that have the same form in the short form and in the resolved form. Their
# defaults are those of the fields of `ExternalFile`.
COPIED_KEYS = (
    "label",
    "note",
    "small_run",
    "results_dir",
    "photograph",
    "strategy",
    "seeds",
    "simulator",
    "parameters",
    "design",
    "surrogate",
    "network",
    "miga",
    "validation",
    "sensitivity",
    "refine",
    "response_surface",
)


class ExternalFile(StudyFile):
    """The keys of a study file with a program, without sections of further strategies."""

    simulator: SimulatorSettings  # type: ignore[assignment]
    label: Label
    note: Note | None = Field(
        default=None,
        description="what a reader of the report has to know about the data",
    )
    results_dir: ResultsFolder = Field(
        default="results", description="folder for everything that is written"
    )
    small_run: bool = Field(
        default=False, description="marks figures and tables as results of a small run"
    )
    photograph: PathOrNull = Field(
        default=None, description="picture of the physical pile, for the report"
    )
    measure: MeasureSettings
    validation: ValidationSettings
    sensitivity: SensitivitySettings
    figures: FiguresSettings = Field(default_factory=FiguresSettings)

    @field_validator("validation")
    @classmethod
    def _check_published(cls, section: ValidationSettings) -> ValidationSettings:
        """Reject published sets, which belong to the parameters of our simulator."""
        for key in ("published", "published_simulated"):
            if getattr(section, key) is not None:
                allowed = (
                    "null, because another simulator does not simulate the published "
                    "parameter sets; delete this key"
                )
                refuse([(key, allowed)])
        return section


class ExternalSettings(StudySettings):
    """The typed sections of a study whose runs are made by another program.

    The sections of our simulator are missing. An access to one of them raises an
    AttributeError.
    """

    simulator: SimulatorSettings
    seeds: int

    def count_seeds(self, name: str) -> int:
        # A program has no bench tests, so the number is the same for every name.
        return self.seeds

    @property
    def free(self) -> int:
        return count_free(dict(self.parameters))


class ExternalConfig(PipelineConfig):
    """The configuration of a study whose runs are made by another program."""

    @classmethod
    def from_merged(
        cls, merged: loader.MergedConfig, check_inputs: bool = False
    ) -> Self:
        """Make the configuration from the merged values of a user's files.

        The values are checked, and missing keys get their defaults. The configuration
        is also noted for the records of provenance of this process.

        Parameters
        ----------
        merged : MergedConfig
            The merged values, in one of two forms. The short form has a mapping of
            targets (docs/own_simulator.md). A study with our simulator has a list of
            targets.
        check_inputs : bool, optional
            Whether to check the program, its template and its files as well.

        Returns
        -------
        ExternalConfig
            The configuration of the study, in its resolved form.

        Raises
        ------
        InputError
            If parameters, values or files are missing or not allowed. The error has all
            problems that were found together.
        """
        _require_whole_study(merged)

        # Check the short form, and fill in the defaults.
        short_form = convert_to_short_form(merged)
        complete_short_form = complete_configuration(
            short_form.config, short_form.origin, make_file_model()
        )

        study = cls(_convert_to_resolved_form(complete_short_form), merged.origin)
        if check_inputs:
            study.check_inputs()
        # Each result of this process gets a record with this configuration.
        provenance.note_config(study.config)
        return study

    @cached_property
    def settings(self) -> StudySettings:
        """The configuration as typed sections.

        Sections that only our simulator reads, such as the grain, are missing, because
        the resolved configuration does not have them.
        """
        models = _map_sections_to_models()
        sections: dict[str, Any] = {}
        for name, value in self.config.items():
            if name in SECTIONS_WITH_OTHER_BOUNDS:
                # The values were checked with the bounds of the short form, and may lie
                # outside the bounds of this model.
                sections[name] = models[name].model_construct(**value)
            elif name in models and value is not None:
                sections[name] = models[name].model_validate(value)
            else:
                # A single key, a section without a model, or a section that is None
                # because the study does not need it.
                sections[name] = value
        sections["targets"] = make_targets(self.config)
        # All values have been checked, so make the object without checking them again.
        # A check would also miss the sections of our simulator.
        return ExternalSettings.model_construct(**sections)

    @cached_property
    def simulator(self) -> SimulatorSettings:
        return SimulatorSettings.model_validate(self.config["simulator"])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return self.parameters.names

    @cached_property
    def parameters(self) -> ParameterSpace:
        return ParameterSpace.of(
            self.config["parameters"], constraints=self.config.get("constraints")
        )

    @cached_property
    def targets(self) -> Targets:
        return Targets.of(self.config["targets"])

    @cached_property
    def definitions(self) -> Definitions:
        """The settings that define each response, by the name of the response.

        If a target is a profile, its response is defined by the positions at which the
        profile is compared. If the program writes the positions of its grains, we
        measure the pile, so the responses of piles are defined by the section
        `measure`. A response that the program measures itself has no settings.
        """
        definitions: dict[str, dict[str, Any]] = {}
        for target in make_targets(self.config):
            if target.profile is not None:
                definitions[target.response] = {"profile": target.profile.abscissae}

        # If the program measures its piles itself, this section is None.
        if self.config["measure"] is None:
            return definitions

        # `find_response` knows the responses of piles only after this import, which
        # registers them.
        import repose.bench  # noqa: F401

        for name in self.targets.names:
            response = find_response(name)
            if response is not None:
                definitions[name] = response.settings(self.config)
        return definitions

    def study(self, file: StrPath | None = None) -> Study:
        """Make a study that asks for the runs of this configuration.

        Parameters
        ----------
        file : path, optional
            CSV file of the runs, as in `repose.Study(..., file=...)`.

        Returns
        -------
        Study
            The study. Unlike a study with our simulator, it also has the noise and the
            definitions that the user gives in the targets.
        """
        study = super().study(file)

        # Collect the keys `noise_sd` and `definition` of the targets, by the name of
        # the response. Targets of our simulator do not have these keys.
        noise_sd = {}
        definitions = {}
        for entry in self.config["targets"]:
            if "noise_sd" in entry:
                noise_sd[entry["response"]] = entry["noise_sd"]
            if "definition" in entry:
                definitions[entry["response"]] = entry["definition"]
        changes = {
            "simulator": self.simulator.name,
            "noise_sd": noise_sd,
            "definitions": definitions,
        }
        # The copy is not checked, but these values were checked as part of the targets.
        study.settings = study.settings.model_copy(update=changes)
        return study

    @property
    def _file(self) -> str:
        """The file that an error message names."""
        return (
            self.source.default_file if isinstance(self.source, Origin) else self.source
        )

    @cached_property
    def _checks(self) -> "ConfigChecks":
        raise InputError(
            self._file,
            key="simulator",
            value=self.simulator.name,
            allowed="a study without this section, whose runs repose makes itself",
        )

    def check_inputs(self) -> None:
        file = self._file
        folder = self.config["results_dir"]
        raise_together(
            YamlError(file, key=key, value=folder, allowed=allowed)
            for key, allowed in results_folder.find_folder_problems(folder)
        )
        simulate.check_simulator(
            self.simulator,
            parameters=self.parameters.centre,
            targets=self.targets.names,
            source=file,
            fixed_names=self.parameters.fixed,
        )


@cache
def make_file_model() -> type[StudyFile]:
    """Make the model of the file, with a section for each further strategy."""
    sections: dict[str, Any] = {}
    for name, field in make_configuration_model().model_fields.items():
        if name not in ExternalFile.model_fields:
            sections[name] = (field.annotation, field)
    return create_model("ExternalConfiguration", __base__=ExternalFile, **sections)


def _require_whole_study(merged: loader.MergedConfig) -> None:
    """Reject files that have a section `simulator` but no parameters.

    Other files are merged over the configuration of the working folder. A file with
    this section is not, because a study of another program does not use our grain.
    """
    if "parameters" in merged.config:
        return
    file = merged.origin.find_file_to_edit("simulator")
    raise YamlError(
        file,
        key="parameters",
        value=None,
        allowed="a section with a range for each parameter; a file with a section simulator is "
        "a complete study, or follows the file of one, as in "
        f"`--configfile config.yaml {file}`",
    )


def convert_to_short_form(merged: loader.MergedConfig) -> loader.MergedConfig:
    """Convert a configuration for our simulator to the short form.

    The user has added a section `simulator` to it, so another program makes the runs.
    The configuration has a list of targets. The short form has a mapping of targets by
    name instead. It also has the number of runs and the seed at its top; `MOVED_KEYS`
    has their keys in both forms. Sections that only our simulator reads are left out.
    Missing keys get the defaults of a study with our simulator.

    Parameters
    ----------
    merged : MergedConfig
        The values of the files, which have not been checked. They are not changed.

    Returns
    -------
    MergedConfig
        The short form, or `merged` itself if it has this form already.
    """
    # Only a study with our simulator has a list of targets.
    content = merged.config
    if not isinstance(content.get("targets"), list):
        return merged

    # Move the number of runs and the seed to the top, and map the targets by name. Add
    # the defaults last, because they must not replace any of these values.
    moved_values = _find_moved_values(content)
    targets = _map_targets_by_name(content["targets"])
    short_form = _drop_sections_of_our_simulator(content)
    short_form |= moved_values | {"targets": targets}
    short_form |= _find_missing_defaults(short_form)

    # The seed has moved to the top, so the section `design` may not have it as well.
    design = content.get("design")
    if isinstance(design, Mapping):
        short_form["design"] = {key: design[key] for key in design if key != "seed"}

    # Error messages name the file of a key. For a key that was moved, this is the file
    # that has the original key.
    files_by_key = dict(merged.origin.files_by_key)
    for key in moved_values:
        files_by_key[key] = merged.origin.find_file(MOVED_KEYS[key])
    file_of_targets = merged.origin.find_file("targets")
    for name, target in targets.items():
        for key in target:
            files_by_key[f"targets.{name}.{key}"] = file_of_targets
    origin = Origin(files_by_key, merged.origin.default_file)
    return loader.MergedConfig(short_form, origin)


def _drop_sections_of_our_simulator(content: Mapping[str, Any]) -> dict[str, Any]:
    """Copy a configuration without the sections that only our simulator reads.

    A mistyped key is kept, because a later check reports it.
    """
    names_of_both = set(make_file_model().model_fields)
    names_of_ours = set(make_settings_type().model_fields)
    dropped_names = names_of_ours - names_of_both
    return {name: value for name, value in content.items() if name not in dropped_names}


def _find_missing_defaults(short_form: Mapping[str, Any]) -> dict[str, Any]:
    """Find the defaults of keys whose defaults differ between the two forms.

    Parameters
    ----------
    short_form : mapping
        A study with our simulator, converted to the short form.

    Returns
    -------
    dict
        The defaults of a study with our simulator, for each of these keys that the
        study lacks.
    """
    method = loader.read_file(places.find_file(places.METHOD_CONFIG))
    defaults = {
        "strategy": method["strategy"],
        "surrogate": method["surrogate"],
        "seed": method["design"]["seed"],
    }
    if _has_bench_test_seeds(short_form.get("strategy", defaults["strategy"])):
        defaults["seeds"] = method["funnel"]["seeds"]
    return {key: value for key, value in defaults.items() if key not in short_form}


def _find_moved_values(content: Mapping[str, Any]) -> dict[str, Any]:
    """Find the values that move from a section to the top of the short form.

    Parameters
    ----------
    content : mapping
        The values of a study with our simulator.

    Returns
    -------
    dict
        The values by their keys in the short form. A key that is at the top already, or
        that has no value, is left out.
    """
    values = {}
    for key, old_key in MOVED_KEYS.items():
        value = get_value(content, old_key)
        if key not in content and value is not None:
            values[key] = value
    return values


def _map_targets_by_name(targets: Iterable[Any]) -> dict[Any, dict[str, Any]]:
    """Convert a list of targets to a mapping by the names of their responses.

    Parameters
    ----------
    targets : iterable
        The list as the user wrote it. A target that is not a mapping is left out,
        because a later check reports it.

    Returns
    -------
    dict
        For each target, the keys that a target of the short form may have, with their
        values. If one of our bench tests measures the response, its unit is added
        unless the user gives a unit. The name is None for a target without a response,
        which a later check reports.
    """
    # `find_response` knows the responses of our bench tests only after this import,
    # which registers them.
    import repose.bench  # noqa: F401

    targets_by_name = {}
    for target in targets:
        if not isinstance(target, Mapping):
            continue
        name = target.get("response")
        short_target = {
            key: target[key] for key in OwnTarget.model_fields if key in target
        }
        response = find_response(str(name))
        if response is not None and response.unit:
            # The user's own unit comes second, and so overrides this one.
            short_target = {"unit": response.unit} | short_target
        targets_by_name[name] = short_target
    return targets_by_name


def _has_bench_test_seeds(name: object) -> bool:
    """Tell whether a strategy takes the number of runs per sample from a bench test.

    Other strategies have a key of their own for this number.
    """
    return (
        name in strategies.names() and strategies.strategy(str(name)).seeds_key is None
    )


def list_unread_sections(content: Mapping[str, Any]) -> list[str]:
    """List sections that have no effect, because another program makes the runs.

    Parameters
    ----------
    content : mapping
        The values of the user's files. They may contain sections for our simulator.

    Returns
    -------
    list of str
        Names of sections and keys, in the order of the files. If some keys of a section
        have an effect, a note in parentheses names these keys.
    """
    known_names = make_file_model().model_fields
    unread = []
    for name, value in content.items():
        if name in known_names:
            continue
        # Some keys of the section may have an effect, because `convert_to_short_form`
        # moves them to the top.
        keys_read = _list_moved_keys(content, name)
        if not keys_read:
            unread.append(name)
        elif len(keys_read) < len(value):
            unread.append(f"{name} (except {', '.join(keys_read)})")
    return unread


def _list_moved_keys(content: Mapping[str, Any], section: str) -> list[str]:
    """List the keys of a section that move to the top of the short form."""
    return [
        dotted_key.removeprefix(f"{section}.")
        for dotted_key in MOVED_KEYS.values()
        if dotted_key.startswith(f"{section}.")
        and get_value(content, dotted_key) is not None
    ]


def _map_sections_to_models() -> dict[str, type[Section]]:
    """Map the names of sections in the resolved configuration to their models.

    A model is a pydantic class that checks the values of a section.
    """
    # Fields of other types are single keys, which have no model.
    models: dict[str, type[Section]] = {}
    for name, field in ExternalSettings.model_fields.items():
        annotation = field.annotation
        if isinstance(annotation, type) and issubclass(annotation, Section):
            models[name] = annotation

    # The model of this section knows only contact parameters. The parameters of another
    # program may have any names.
    del models["parameters"]

    # Strategies may also have sections.
    for name in strategies.names():
        model = strategies.strategy(name).settings
        if model is not None:
            models[name] = model
    return models


def _convert_to_resolved_form(short_form: Mapping[str, Any]) -> dict[str, Any]:
    """Make the configuration that the stages read from a complete short form.

    The stages read the same keys for every simulator. Therefore the result has the keys
    of a study with our simulator, as far as they apply.

    Parameters
    ----------
    short_form : mapping
        The short form of docs/own_simulator.md, checked and with all defaults.

    Returns
    -------
    dict
        The resolved form, which is written to RESULTS/config.json.
    """
    # Copy the sections that both forms have. Strategies that are registered later may
    # have sections, too.
    config: dict[str, Any] = {}
    for name in COPIED_KEYS:
        field = ExternalFile.model_fields[name]
        config[name] = short_form.get(name, field.get_default())
    for strategy_name in strategies.names():
        is_further_strategy = strategy_name not in StudyFile.model_fields
        if is_further_strategy and strategy_name in short_form:
            config[strategy_name] = short_form[strategy_name]
    if "constraints" in short_form:
        config["constraints"] = short_form["constraints"]

    config["targets"] = _list_targets(short_form["targets"])

    # Add the defaults of the keys in these two sections.
    simulator = SimulatorSettings.model_validate(short_form["simulator"])
    config["simulator"] = simulator.model_dump(mode="json", exclude_none=True)
    figures = FiguresSettings.model_validate(short_form.get("figures", {}))
    config["figures"] = figures.model_dump(mode="json")

    # We measure piles only if the program writes its particles. A program that prints
    # an angle may define it in any way.
    config["measure"] = None
    if simulator.particles is not None:
        config["measure"] = dict(short_form["measure"])

    # The remaining sections have other keys in a study with our simulator.
    config["sequential"] = _convert_sequential_section(short_form)
    # A correlation between responses can only be estimated from several runs of one
    # sample. The user's own keys come last, and so override these defaults. The study
    # of shapes varies our grain, so another program has none.
    correlation = "simulated" if short_form["seeds"] > 1 else 0.0
    config["posterior"] = {
        "shape_study": None,
        "measured_correlation": correlation,
        **short_form["posterior"],
    }
    # This section was copied above, and gets the seed of the study here.
    config["sensitivity"] = {**config["sensitivity"], "seed": short_form["seed"]}
    return config


def _convert_sequential_section(short_form: Mapping[str, Any]) -> dict[str, Any]:
    """Convert the section `sequential` of the short form to the resolved form.

    The maximum number of runs has another key there. The number of runs that check the
    answer comes from the section `validation`.
    """
    section = dict(short_form["sequential"])
    section["most_pours"] = section.pop("most_runs")
    section["checks"] = short_form["validation"]["representative_seeds"]
    return section


def _list_targets(targets_by_name: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Convert the targets of the short form to a list, with all keys of each target.

    If the user gives no range for a target, the range is computed from the mean value,
    the standard deviation and the number of repetitions.

    Parameters
    ----------
    targets_by_name : mapping of str to mapping
        The keys of each target, by the name of its response.

    Returns
    -------
    list of dict
        The targets in the resolved form.
    """
    targets = []
    for name, target in targets_by_name.items():
        target_range = target.get("range")
        if target_range is None:
            target_range = compute_target_range(
                target["value"], target["sd"], target["repetitions"]
            )
        # The keys of the target come after the defaults, and so override them. The
        # bench test of a program has the name `OWN_BENCH`.
        resolved = {"response": name, "apparatus": OWN_BENCH, "unit": "", **target}
        resolved["range"] = list(target_range)
        targets.append(resolved)
    return targets
