"""Load, check and use the configuration of a study with the simulator of this package."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from repose.calibrate.responses import Definitions
from repose.common import provenance
from repose.common.errors import InputError
from repose.common.files import StrPath, convert_to_path, read_json
from repose.common.keys import Origin, find_source_file
from repose.config import loader
from repose.stages.published import find_sibling_table

if TYPE_CHECKING:
    from repose.bench import Scene
    from repose.calibrate.parameter_space import ParameterSpace
    from repose.calibrate.study import Study
    from repose.calibrate.targets import Targets
    from repose.config.models import StudySettings
    from repose.config.validation import ConfigChecks
    from repose.grain.particle import Particle
    from repose.stages.settings import SimulatorSettings


@dataclass(frozen=True, eq=False, repr=False)
class PipelineConfig:
    """The configuration of a study with the simulator of this package.

    The configuration is checked, has a number in place of each `auto`, and does not
    change. Make it from files by `load`, from a mapping by `of`, or from a folder of
    results by `of_results`.

    Attributes
    ----------
    config : dict
        The resolved configuration as plain values; `RESULTS/config.json` holds the
        same.
    source : str or Origin
        The file that an error names.
    """

    config: dict[str, Any]
    source: str | Origin

    @classmethod
    def load(
        cls,
        *files: StrPath,
        overrides: Mapping[str, Any] | None = None,
        check_inputs: bool = False,
    ) -> "PipelineConfig":
        """Load configuration files, check them, and compute each value that is `auto`.

        The configuration is also noted for the records of provenance of this process.

        Parameters
        ----------
        *files : path
            YAML or JSON files. Each overrides the files before it, and all override the
            defaults, so a file needs only the keys that differ. The file
            `RESULTS/config.json` of a study is complete and was checked before, so it
            is read without these steps.
        overrides : mapping, optional
            Nested values that override all files. Strings among them are parsed as
            YAML.
        check_inputs : bool, optional
            Whether to check the files that the configuration names as well, and whether
            grain, bench test and time step fit together. This takes seconds. By
            default, these checks are made when the grain is needed.

        Returns
        -------
        PipelineConfig
            The configuration of the study; an `ExternalConfig` if the files name
            another program in a section `simulator`.

        Raises
        ------
        InputError
            With all problems. For each of them the message names the file, the key, the
            value and the allowed values.
        """
        # Raise an error here if an argument is not a path.
        for file in files:
            convert_to_path("file", file)

        # A resolved file, which a study has written, was checked before.
        if not overrides and not check_inputs and loader.is_resolved(*files):
            return cls.of_results(files[0])

        # A study with another program has other sections and defaults.
        users_values = loader.merge_without_defaults(files, overrides)
        if loader.is_external(users_values.config):
            from repose.config.external import ExternalConfig

            return ExternalConfig.from_merged(users_values, check_inputs=check_inputs)

        # Merge the files over the defaults, and check all values together.
        values, origin = loader.merge_with_defaults(files, overrides)
        study = cls.of(values, origin, check_inputs=check_inputs)
        # The record of each result of the current stage will have this configuration.
        provenance.note_config(study.config)
        return study

    @classmethod
    def of(
        cls,
        config: Mapping[str, Any],
        source: str | Origin = "configuration",
        check_inputs: bool = False,
    ) -> Self:
        """Make a study from a mapping: check it, and compute each value that is `auto`.

        Parameters
        ----------
        config : mapping
            The values of all keys. A key that the program can compute may be `auto`.
        source : str or Origin, optional
            The file that an error names.
        check_inputs : bool, optional
            As in `load`.

        Returns
        -------
        PipelineConfig
            The checked configuration, with a number in place of each `auto`.

        Raises
        ------
        InputError
            As in `load`.
        """
        from repose.config.validation import ConfigChecks

        if not isinstance(config, Mapping):
            raise InputError(
                source,
                key="configuration",
                value=config,
                allowed="a mapping of sections",
            )
        if "simulator" in config:
            raise InputError(
                find_source_file(source, "simulator"),
                key="simulator",
                value=config["simulator"],
                allowed="a study without this section, whose runs repose makes itself; to use "
                "your own simulator, see `repose docs own_simulator` and "
                "`repose docs simulators`",
            )
        checks = ConfigChecks(dict(config), source)
        checks.check_and_compute(check_inputs)
        study = cls(checks.config, source)
        # Keep these checks, because they may have made the grain already, which takes
        # seconds. `_checks` is a cached property, which stores its value in `__dict__`.
        # The class is frozen, so an assignment to the attribute would fail.
        study.__dict__["_checks"] = checks
        return study

    @classmethod
    def of_results(cls, path: StrPath) -> "PipelineConfig":
        """Load the configuration of a folder of results, for a job.

        Parameters
        ----------
        path : path
            `RESULTS/config.json`, which was checked before. Nothing is checked again.

        Returns
        -------
        PipelineConfig

        Raises
        ------
        InputError
            If the file cannot be read.
        """
        config = read_json(path, what="the configuration of a folder of results")
        provenance.note_config(config)
        if loader.is_external(config):
            from repose.config.external import ExternalConfig

            return ExternalConfig(config, str(path))
        return cls(config, str(path))

    def __repr__(self) -> str:
        free = ", ".join(self.parameters.free)
        targets = ", ".join(self.targets.names)
        settings = self.settings
        return (
            f"<PipelineConfig {settings.label}: {free} by {targets}, "
            f"strategy {settings.strategy}>"
        )

    def __reduce__(self) -> Any:
        # Pickle only the values. Each process makes the types of the sections itself.
        return type(self), (self.config, self.source)

    @cached_property
    def settings(self) -> "StudySettings":
        """The configuration as typed sections, such as `config.settings.funnel.seeds`."""
        from repose.config.models import make_settings

        return make_settings(self.config, self.source)

    @property
    def simulator(self) -> "SimulatorSettings | None":
        """The program that makes the runs; None for the simulator of this package."""
        return None

    @property
    def parameter_names(self) -> tuple[str, ...] | None:
        """Names of the parameters of another program; None for contact parameters."""
        return None

    @cached_property
    def parameters(self) -> "ParameterSpace":
        """Ranges of the free parameters, fixed values and priors."""
        from repose.bench.space import contact_space

        settings = self.settings
        space = contact_space(settings.parameters.entries)
        return space.with_constraints(settings.constraints)

    @cached_property
    def targets(self) -> "Targets":
        """The measured responses."""
        import repose.bench  # noqa: F401  registers the responses
        from repose.calibrate.targets import Targets

        return Targets.of(self.config["targets"])

    @cached_property
    def definitions(self) -> Definitions:
        """The settings that define each response, by the name of the response.

        Only bench tests that a target uses are included. Results are compared by these
        settings, so a bench test without a target must not change them.
        """
        from repose.bench import bench_tests

        # The attribute `apparatus` lists the bench tests of the targets. Besides its
        # own responses, a bench test has those that targets add, such as the scores of
        # a profile.
        definitions: dict[str, dict[str, Any]] = {}
        for test in bench_tests():
            if test.name not in self.targets.apparatus:
                continue
            responses = (*test.responses, *test.target_responses(self.config))
            for response in responses:
                definitions[response.name] = response.settings(self.config)

        # Add the positions at which measured profiles are compared. The loop above has
        # made an entry for the response of each target.
        for target in self.settings.targets:
            if target.profile is not None:
                positions = target.profile.abscissae
                definitions[target.response] |= {"profile": positions}
        return definitions

    def study(self, file: StrPath | None = None) -> "Study":
        """Make the object that says which runs to make next, and finds the answer.

        The study knows nothing of this simulator. It receives only what a study of any
        simulator needs: parameters, targets and the settings of the calibration.

        Parameters
        ----------
        file : path, optional
            CSV file of the runs, as in `repose.Study(..., file=...)`.

        Returns
        -------
        Study
            The study, with the strategy and the settings of this configuration.
        """
        # Import these modules only here, because many commands need no study.
        from repose.calibrate import strategies
        from repose.calibrate.settings import CalibrationSettings
        from repose.calibrate.study import Study

        # Collect the sections of strategies that `CalibrationSettings` does not have.
        settings = self.settings
        other_sections = {}
        for name in strategies.names():
            section = settings.get_strategy_section(name)
            if section is not None and name not in CalibrationSettings.model_fields:
                other_sections[name] = section

        # Copy the sections that a calibration with any simulator has. A new field of
        # `CalibrationSettings` must be added here. A study has only one number of
        # seeds, so take that of the first bench test.
        calibration = CalibrationSettings(
            label=settings.label,
            simulator="repose",
            strategy=settings.strategy,
            surrogate=settings.surrogate,
            seeds=settings.count_design_seeds(self.targets.apparatus[0]),
            design=settings.design,
            network=settings.network,
            miga=settings.miga,
            posterior=settings.posterior,
            sequential=settings.sequential,
            response_surface=settings.response_surface,
            refine=settings.refine,
            others=other_sections,
        )
        return Study.of(
            self.parameters,
            self.targets,
            settings=calibration,
            config=self.config,
            file=file,
        )

    def published(self, table: str) -> Path | None:
        """Find a table in the folder of the published solutions.

        Parameters
        ----------
        table : str
            Name of the file, such as ``table3.csv``.

        Returns
        -------
        Path or None
            The path of the table; None if there is no such table.
        """
        return find_sibling_table(self.settings.validation.published, table)

    @cached_property
    def folder(self) -> Path:
        """Folder of the results."""
        return Path(self.settings.results_dir)

    @property
    def grain(self) -> dict[str, Any]:
        """The mean grain, as in berry.json; the files of the configuration are checked."""
        self._checks.check_inputs()
        grain: dict[str, Any] = self._checks.mean_grain
        return grain

    @property
    def particle(self) -> "Particle":
        """The body of the mean grain; the files of the configuration are checked."""
        self._checks.check_inputs()
        particle: Particle = self._checks.particle
        return particle

    def scene(self, parameters: Mapping[str, float], seed: int = 0) -> "Scene":
        """Make the scene of a run of any bench test.

        Parameters
        ----------
        parameters : mapping
            Contact parameters by name.
        seed : int, optional
            Random seed of the run.

        Returns
        -------
        Scene
            The scene, with the grain and the settings of the study.
        """
        from repose.bench import Scene

        return Scene.of(
            self.config, parameters, grain=self.grain, particle=self.particle, seed=seed
        )

    def check_inputs(self) -> None:
        """Check the named files, and that grain, bench test and time step fit together.

        Raises
        ------
        InputError
            With all errors at once.
        """
        self._checks.check_inputs()

    @cached_property
    def _checks(self) -> "ConfigChecks":
        """The checks of the configuration, which also make its grain.

        A configuration that was loaded from a folder of results makes them here, when
        they are needed for the first time.
        """
        from repose.config.validation import ConfigChecks

        return ConfigChecks(self.config, self.source)
