"""Check a configuration and the files that it names, and report all errors at once.

A check is made only where the settings that it reads are valid.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from repose.bench.settings import SceneSettings
from repose.calibrate.targets import Targets, complete_target
from repose.common import faults
from repose.common.errors import InputError, YamlError, raise_together
from repose.common.keys import Origin, find_file_to_edit, get_value
from repose.config import computed, results_folder
from repose.config.contradictions import (
    Rule,
    find_tests_in_use,
    list_rules_after_computing,
    list_rules_before_computing,
)
from repose.config.models import (
    StudySettings,
    list_file_keys,
    make_settings_type,
    select_valid_sections,
)
from repose.grain.particle import Particle
from repose.measure.settings import MeasureSettings
from repose.stages.published import (
    check_published_sets,
    find_sibling_table,
    read_stored,
)

# Sections from which the mean grain is computed, and sections that limit the time step.
# `berry` is the section of the grain.
GRAIN_SECTIONS = ("berry", "validation")
TIME_STEP_SECTIONS = ("simulation", "wall", "parameters", "validation")

Result = TypeVar("Result")


def find_time_step_problems(
    config: Mapping[str, Any], particle: Particle, mean_grain: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    """Find out whether the time step of a configuration is too long for the engine.

    Parameters
    ----------
    config : mapping
        The configuration.
    particle : Particle
        The body of the mean grain.
    mean_grain : mapping
        The mean grain, as in berry.json.

    Yields
    ------
    tuple of str
        The key of the time step, and a description of its allowed values. Nothing is
        yielded if the time step is allowed.
    """
    settings = select_valid_sections(config)
    limit = computed.find_longest_step(config, particle, mean_grain)
    if settings.simulation.time_step_s <= limit.time_step_s:
        return

    # If the configuration gives no modulus, the elastic modulus was computed from the
    # forces in a file. Forces in a wrong unit give a wrong modulus and thus a wrong
    # limit, so show the modulus. The section of the grain has the name `berry`.
    allowed = limit.allowed
    grain_section = settings.berry
    if grain_section.shear_modulus_pa is None:
        modulus = f"{mean_grain['elastic_modulus_pa']:.2g} Pa"
        allowed += f"; the modulus from {grain_section.compression} is {modulus}"
    yield "simulation.time_step_s", allowed


class ConfigChecks:
    """A configuration, its grain and its particle, and the errors found so far.

    A check is made only if the sections that it reads are valid. The methods add errors
    to `errors` and `invalid_keys`, and the public methods raise all of them at their
    end. After a method has raised them, do not call it again, because it would find the
    same errors twice.

    Attributes
    ----------
    config : dict
        The configuration; each `auto` is replaced as its number is computed.
    source : str or Origin
        The file that an error names.
    errors : list of InputError
        The errors found so far.
    invalid_keys : set of str
        Dotted keys with an error. The name of a section stands for the whole section.
    mean_grain : dict or None
        The mean grain, as in berry.json; None until it is made.
    particle : Particle or None
        The body of the mean grain; None until it is made.
    inputs_are_checked : bool
        Whether the named files were checked, and whether the grain fits the study.
    """

    def __init__(self, config: dict[str, Any], source: str | Origin) -> None:
        self.config = config
        self.source = source
        self.errors: list[InputError] = []
        self.invalid_keys: set[str] = set()
        self.mean_grain: Any = None
        self.particle: Any = None
        self.inputs_are_checked = False

    def check_and_compute(self, check_inputs: bool) -> None:
        """Check the configuration, and replace each `auto` in it by a number.

        The steps change the attributes of this object. Each step leaves out what
        depends on a setting that an earlier step found invalid, so the order of the
        steps matters. All errors are raised at the end.

        Parameters
        ----------
        check_inputs : bool
            Whether to check the named files as well, and whether grain, bench tests and
            time step fit together.

        Raises
        ------
        InputError
            With all errors.
        """
        self._complete_targets()
        self._check_single_keys()
        settings_to_compute = self._find_settings_to_compute()

        # Read the files before the grain, which is made from some of them.
        if check_inputs:
            self._check_named_files()
        if check_inputs or any(setting.needs_grain for setting in settings_to_compute):
            self._make_grain()

        # The first rules make sure that the numbers can be computed. The other rules
        # need these numbers.
        self._apply_rules(list_rules_before_computing(self.config))
        for setting in settings_to_compute:
            self._compute_setting(setting)
        self._apply_rules(list_rules_after_computing(self.config))

        if check_inputs:
            self._check_grain_fits()
        raise_together(self.errors)
        self.inputs_are_checked = check_inputs

    def check_inputs(self) -> None:
        """Check the named files, make the grain, and check that it fits the study.

        Afterwards `mean_grain` and `particle` are set. A second call does nothing if
        the first one has raised no error.

        Raises
        ------
        InputError
            With all errors of the files, and of grain, bench tests and time step.
        """
        if self.inputs_are_checked:
            return
        # The grain is made from some of the files, and the last step needs the grain.
        self._check_named_files()
        self._make_grain()
        self._check_grain_fits()
        raise_together(self.errors)
        self.inputs_are_checked = True

    @property
    def settings(self) -> StudySettings:
        """The typed sections of the configuration that are valid."""
        return select_valid_sections(self.config)

    def _complete_targets(self) -> None:
        """Add the missing keys of the targets, such as their ranges.

        A target that is a whole measured profile is replaced by one or more targets
        with a number each, called the scores of the profile.
        """
        from repose.calibrate import profile_targets

        targets = self.config.get("targets")
        if not isinstance(targets, list):
            # A later check reports the error.
            return
        file = find_file_to_edit(self.source, "targets")
        targets_with_numbers = profile_targets.expand_profiles(targets, file)
        completed_targets = [complete_target(target) for target in targets_with_numbers]
        # Make a new mapping, because the old one belongs to the caller.
        self.config = self.config | {"targets": completed_targets}

    def _check_single_keys(self) -> None:
        """Check the value of each key on its own, and replace all earlier errors.

        A whole number that is written as 3.0 is replaced by 3. Rules between keys of
        one section are checked as well.
        """
        model = make_settings_type()
        self.config = faults.convert_whole_numbers(self.config, model)
        checked = faults.find_faults(self.config, self.source, model)
        self.errors = checked.faults
        self.invalid_keys = checked.keys

    def _find_settings_to_compute(self) -> list[computed.ComputedSetting]:
        """Find the settings to compute, and set those that are missing to `auto`.

        Settings of sections that are not valid are left out.
        """
        settings_to_compute = []
        for setting in computed.find_settings_to_compute(self.config):
            if self._are_valid(setting.section):
                settings_to_compute.append(setting)
                self.config = computed.replace_setting(
                    self.config, setting, computed.AUTO
                )
        return settings_to_compute

    def _are_valid(self, *sections: str) -> bool:
        """Tell whether no key of these sections has an error.

        A key that belongs to no section, such as `targets`, may take the place of a
        section.
        """
        invalid_sections = {key.partition(".")[0] for key in self.invalid_keys}
        return invalid_sections.isdisjoint(sections)

    def _is_key_valid(self, key: str) -> bool:
        """Tell whether a key has no error.

        Errors of other keys in the same section do not count.
        """
        section = key.partition(".")[0]
        return self.invalid_keys.isdisjoint((key, section))

    def _add_errors(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Add an error for each pair of a dotted key and its allowed values."""
        for key, allowed in pairs:
            self.errors.append(
                self._make_error(key, get_value(self.config, key), allowed)
            )
            self.invalid_keys.add(key)

    def _make_error(self, key: str, value: Any, allowed: str) -> InputError:
        """Make the error for a dotted key; the message names the file of the user."""
        return YamlError(
            find_file_to_edit(self.source, key), key=key, value=value, allowed=allowed
        )

    def _apply_rules(self, rules: Iterable[Rule]) -> None:
        """Apply the rules whose sections are valid so far, and add their errors."""
        for rule in rules:
            if self._are_valid(*rule.reads):
                self._add_errors(rule.find_problems())

    def _call_and_collect_errors(
        self, key: str, function: Callable[..., Result], *arguments: Any
    ) -> Result | None:
        """Call a function that reads the value of a key.

        Parameters
        ----------
        key : str
            The dotted key, or a section, which is marked as invalid if the call fails.
        function : callable
            Function that raises an InputError for a value that it does not allow.
        *arguments
            The arguments of the function.

        Returns
        -------
        object
            The result of the function. None if it fails; its errors are then added to
            the others, and the key is marked as invalid.
        """
        try:
            return function(*arguments)
        except InputError as error:
            # An error may combine several errors, which are then in `faults`.
            for single_error in getattr(error, "faults", [error]):
                self.errors.append(self._name_users_file(single_error, key))
            self.invalid_keys.add(key)
            return None

    def _name_users_file(self, error: InputError, section: str) -> InputError:
        """Add the user's file to an error that names only a section.

        The functions that read a section do not know its file. An error that names a
        file is returned unchanged.
        """
        if error.source != section:
            return error
        return self._make_error(f"{section}.{error.key}", error.value, error.allowed)

    def _check_named_files(self) -> None:
        """Check that the files which the configuration names exist and are valid.

        Some files are not read here, because they are read when the grain is made
        (`_map_keys_to_readers`). The errors of missing and invalid files are added to
        the others. The contents of the files are not kept.
        """
        # The folder of results cannot be made if a file has the same path.
        if self._are_valid("results_dir"):
            self._add_errors(
                results_folder.find_folder_problems(self.settings.results_dir)
            )

        # Report all files that are missing.
        paths = self._find_named_paths()
        missing_keys = [key for key, path in paths.items() if not Path(path).is_file()]
        allowed = "an existing file, relative to the folder of the project"
        self._add_errors((key, allowed) for key in missing_keys)

        # The contents of the existing files may also be invalid.
        for key, read in self._map_keys_to_readers().items():
            if key in paths and key not in missing_keys:
                self._call_and_collect_errors(key, read, paths[key])

    def _find_named_paths(self) -> dict[str, str]:
        """Map the dotted key of each named file to the path of the file.

        Keys that are invalid, and keys without a value, are left out.
        """
        paths = {}
        for key in list_file_keys():
            path = get_value(self.config, key)
            if path is not None and self._is_key_valid(key):
                paths[key] = path
        return paths

    def _map_keys_to_readers(self) -> dict[str, Callable[[str], Any]]:
        """Map the dotted key of a file to the function that reads and checks this file.

        Only some of the files are included. The others are read when the grain is made,
        or may have any content.

        Returns
        -------
        dict of str to callable
            Functions that take the path of the file and raise an InputError if its
            content is invalid.
        """
        # Import the readers only here, because the jobs of the workflow need none.
        from repose.calibrate.uncertainty.discrepancy import estimate_from_shape_study
        from repose.grain.berry_files import read_sizes
        from repose.measure.pile import read_image

        readers: dict[str, Callable[[str], Any]] = {
            "berry.sizes": read_sizes,
            "photograph": read_image,
            "validation.published": check_published_sets,
            "validation.published_simulated": read_stored,
        }
        # The file of the study of shapes is checked against the targets.
        if self._are_valid("targets"):
            targets = Targets.of(self.config["targets"])
            readers["posterior.shape_study"] = partial(
                estimate_from_shape_study, targets=targets
            )
        return readers

    def _make_grain(self) -> None:
        """Make the mean grain and its particle, unless they already exist.

        They remain None if their settings are invalid. Errors in their files are added
        to the others.
        """
        from repose.grain import build

        if self.mean_grain is None and self._are_valid(*GRAIN_SECTIONS):
            self.mean_grain = self._compute_mean_grain()
        if self.particle is None and self.mean_grain is not None:
            self.particle = self._call_and_collect_errors(
                "berry",
                build.make_configured_particle,
                self.mean_grain,
                self.settings.berry,
            )

    def _compute_mean_grain(self) -> dict[str, Any] | None:
        """Compute the mean grain, which has the mean sizes of the measured grains.

        The section `berry` names the files with the measurements.

        Returns
        -------
        dict or None
            The mean grain, as in berry.json. None if a file is invalid; its errors are
            then added to the others.
        """
        from repose.grain import berry

        # The folder of the published solutions may have a table1.csv, with published
        # sizes to compare with the measured ones.
        settings = self.settings
        table1_csv = find_sibling_table(settings.validation.published, "table1.csv")
        result = self._call_and_collect_errors(
            "berry", berry.compute_configured_grain, settings.berry, table1_csv
        )
        if result is None:
            return None
        # The statistics of the sizes are not needed here.
        _statistics, mean_grain = result
        return mean_grain

    def _compute_setting(self, setting: computed.ComputedSetting) -> None:
        """Compute a setting whose value is `auto`, and put the number in its place.

        If the number cannot be computed, the key is marked as invalid, so that checks
        that read it are left out.

        Parameters
        ----------
        setting : ComputedSetting
            The key, the sections on which the number depends, and the function that
            computes it.
        """
        # The number cannot be computed if a section on which it depends is invalid. The
        # error of this section is reported already.
        lacks_grain = setting.needs_grain and self.particle is None
        if lacks_grain or not self._are_valid(*setting.reads):
            self.invalid_keys.add(setting.key)
            return
        number = self._call_and_collect_errors(
            setting.key, setting.compute, self.config, self.mean_grain, self.particle
        )
        # If the computation failed, the call above has marked the key as invalid.
        if number is None:
            return
        self.config = computed.replace_setting(self.config, setting, number)

        # Even a computed number may lie outside the allowed range.
        checked = faults.find_faults(self.config, self.source, make_settings_type())
        for error in checked.faults:
            if error.key == setting.key:
                sections = ", ".join(setting.reads)
                allowed = (
                    f"{error.allowed}; `auto` gave this number, which follows from "
                    f"the other keys of {sections}"
                )
                self._add_errors([(error.key, allowed)])

    def _check_grain_fits(self) -> None:
        """Check that the grain fits the bench tests, its measurement and the time step.

        The methods `misfits` yield pairs of a key and its allowed values.
        """
        # If the settings of the grain are invalid, there is no grain to check.
        if self.mean_grain is None:
            return

        # A bench test must be large enough for the grain.
        axes_mm = computed.list_axes_mm(self.mean_grain)
        scene_settings = SceneSettings(self.config)
        for test in find_tests_in_use(self.config):
            if self._are_valid(test.name):
                self._add_errors(test.misfits(scene_settings, axes_mm))

        # Angles are measured with the height of a grain, which must be that of this
        # grain.
        if self._are_valid("measure"):
            measure = scene_settings.section("measure", MeasureSettings)
            self._add_errors(measure.misfits(axes_mm))

        # The time step must be short enough for the grain.
        if self.particle is not None and self._are_valid(*TIME_STEP_SECTIONS):
            self._add_errors(
                find_time_step_problems(self.config, self.particle, self.mean_grain)
            )
