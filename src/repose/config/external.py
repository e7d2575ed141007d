"""A study whose runs a program of the user's own makes, called by the workflow.

Its file has the short form of docs/own_simulator.md, with a section `simulator`. It is
resolved to the form that the stages read, which RESULTS/config.json holds.
"""

from collections.abc import Mapping
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Self

from pydantic import Field, create_model, field_validator

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.parameter_types import count_free
from repose.calibrate.responses import Definitions, named
from repose.calibrate.strategies import names, strategy
from repose.calibrate.study import Study
from repose.calibrate.study_file import (
    OwnTarget,
    StudyFile,
    complete_configuration,
    file_model,
)
from repose.calibrate.targets import OWN, Targets
from repose.calibrate.uncertainty.settings import SensitivitySettings
from repose.common import provenance
from repose.common.errors import InputError, YamlError, raise_together
from repose.common.files import Path_
from repose.common.keys import Origin, get
from repose.common.section import PathOrNull, Section, refuse
from repose.common.target_range import range_about
from repose.config import loader, results_folder
from repose.config.models import (
    FiguresSettings,
    Label,
    ResultsFolder,
    StudySettings,
    targets_of,
)
from repose.config.pipeline import PipelineConfig
from repose.measure.settings import MeasureSettings
from repose.stages import simulate
from repose.stages.settings import SimulatorSettings, ValidationSettings

if TYPE_CHECKING:
    from repose.config.making import ConfigChecks

# Sections that were checked with bounds of their own.
WITH_OTHER_BOUNDS = ("sequential", "posterior")
# Keys of the file that are read as they are.
AS_GIVEN = (
    "label",
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
    """The keys of such a study, without the sections of further strategies."""

    simulator: SimulatorSettings  # type: ignore[assignment]
    label: Label
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
        """Refuse published sets: they are of the parameters of our simulator."""
        for key in ("published", "published_simulated"):
            if getattr(section, key) is not None:
                words = "null: published sets are of the contact parameters of repose"
                refuse([(key, words)])
        return section


class ExternalSettings(StudySettings):
    """The typed sections of such a study.

    It lacks the sections of our simulator: to read one is an AttributeError.
    """

    simulator: SimulatorSettings
    seeds: int

    def seeds_of(self, name: str) -> int:
        return self.seeds

    @property
    def free(self) -> int:
        return count_free(dict(self.parameters))


class ExternalConfig(PipelineConfig):
    """The configuration of a study whose runs another program makes."""

    @classmethod
    def of_layers(cls, layered: loader.Layered, inputs: bool = False) -> Self:
        """Check the values of files, and make the resolved configuration.

        Parameters
        ----------
        layered : Layered
            The values, in the short form or in that of a study with our simulator, and
            the file of each.
        inputs : bool, optional
            Check also the program, its template and its files.

        Raises
        ------
        InputError
            With all faults.
        """
        source = layered.origin.default
        given = _without_our_simulator(layered.config)
        complete = complete_configuration(given, source, file_model_here())
        made = cls(_resolved(complete), layered.origin)
        if inputs:
            made.check_inputs()
        provenance.note_config(made.config)
        return made

    @cached_property
    def settings(self) -> StudySettings:
        models = _section_models()
        sections: dict[str, Any] = {}
        for name, value in self.config.items():
            if name in WITH_OTHER_BOUNDS:
                value = models[name].model_construct(**value)
            elif name in models and value is not None:
                value = models[name].model_validate(value)
            sections[name] = value
        sections["targets"] = targets_of(self.config)
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
        definitions: dict[str, dict[str, Any]] = {}
        for target in targets_of(self.config):
            if target.profile is not None:
                definitions[target.response] = {"profile": target.profile.abscissae}
        if self.config["measure"] is None:
            return definitions
        import repose.bench  # noqa: F401  registers the responses of piles

        for name in self.targets.names:
            response = named(name)
            if response is not None:
                definitions[name] = response.settings(self.config)
        return definitions

    def study(self, file: Path_ | None = None) -> Study:
        study = super().study(file)
        noise = {}
        words = {}
        for entry in self.config["targets"]:
            if "noise_sd" in entry:
                noise[entry["response"]] = entry["noise_sd"]
            if "definition" in entry:
                words[entry["response"]] = entry["definition"]
        changes = {
            "simulator": self.simulator.name,
            "noise_sd": noise,
            "definitions": words,
        }
        study.settings = study.settings.model_copy(update=changes)
        return study

    @property
    def _file(self) -> str:
        """The file that a fault names."""
        return self.source.default if isinstance(self.source, Origin) else self.source

    @cached_property
    def _making(self) -> "ConfigChecks":
        words = "a study without this section, whose runs repose makes itself"
        raise InputError(self._file, "simulator", self.simulator.name, words)

    def check_inputs(self) -> None:
        file = self._file
        folder = self.config["results_dir"]
        raise_together(
            YamlError(file, key, folder, words)
            for key, words in results_folder.existing_results(folder)
        )
        simulate.check(
            self.simulator,
            parameters=self.parameters.centre,
            targets=self.targets.names,
            source=file,
            fixed=self.parameters.fixed,
        )


@cache
def file_model_here() -> type[StudyFile]:
    """Make the model of a file, with a section for each further strategy."""
    sections: dict[str, Any] = {}
    for name, field in file_model().model_fields.items():
        if name not in ExternalFile.model_fields:
            sections[name] = (field.annotation, field)
    return create_model("ExternalConfiguration", __base__=ExternalFile, **sections)


def _without_our_simulator(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Turn a study with our simulator, to which a program was added, into the short form.

    Its targets are a list. The short form has them by name, and the number of runs and
    the seed of the study at its top. Sections that only our simulator reads are left
    out.
    """
    targets = content.get("targets")
    if not isinstance(targets, list):
        return content
    model = file_model_here()
    kept = model.model_fields
    short = {name: value for name, value in content.items() if name in kept}

    # A response of our bench tests has a unit; a faulty entry is refused later.
    import repose.bench  # noqa: F401  registers the responses of piles

    short["targets"] = {}
    for entry in targets:
        if not isinstance(entry, Mapping):
            continue
        name = entry.get("response")
        response = named(str(name))
        keys = {key: entry[key] for key in OwnTarget.model_fields if key in entry}
        unit = {} if response is None or not response.unit else {"unit": response.unit}
        short["targets"][name] = unit | keys

    for key, place in {"seeds": "funnel.seeds", "seed": "design.seed"}.items():
        value = get(content, place)
        if key not in content and value is not None:
            short[key] = value
    return short


def _section_models() -> dict[str, type[Section]]:
    """Return the models of the resolved sections by name."""
    models: dict[str, type[Section]] = {}
    for name, field in ExternalSettings.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, Section):
            models[name] = kind
    del models["parameters"]
    for name in names():
        section = strategy(name).settings
        if section is not None:
            models[name] = section
    return models


def _resolved(complete: Mapping[str, Any]) -> dict[str, Any]:
    """Turn a complete configuration of the short form into that of the stages."""
    config: dict[str, Any] = {}
    for name in AS_GIVEN:
        field = ExternalFile.model_fields[name]
        config[name] = complete.get(name, field.get_default())
    for name in names():
        if name not in StudyFile.model_fields and name in complete:
            config[name] = complete[name]
    if "constraints" in complete:
        config["constraints"] = complete["constraints"]

    targets = []
    for name, entry in complete["targets"].items():
        numbers = (entry["value"], entry["sd"], entry["repetitions"])
        target = {"response": name, "apparatus": OWN, "unit": "", **entry}
        target["range"] = list(entry.get("range", range_about(*numbers)))
        targets.append(target)
    config["targets"] = targets

    simulator = SimulatorSettings.model_validate(complete["simulator"])
    config["simulator"] = simulator.model_dump(mode="json", exclude_none=True)
    figures = FiguresSettings.model_validate(complete.get("figures", {}))
    config["figures"] = figures.model_dump(mode="json")
    # Another program may take an angle in any way.
    config["measure"] = None
    if simulator.particles is not None:
        config["measure"] = dict(complete["measure"])

    sequential = dict(complete["sequential"])
    sequential["most_pours"] = sequential.pop("most_runs")
    sequential["checks"] = complete["validation"]["representative_seeds"]
    config["sequential"] = sequential
    # A correlation of responses needs runs of one sample.
    correlation = "simulated" if complete["seeds"] > 1 else 0.0
    config["posterior"] = {
        "shape_study": None,
        "measured_correlation": correlation,
        **complete["posterior"],
    }
    config["sensitivity"] = {**config["sensitivity"], "seed": complete["seed"]}
    return config
