"""Check a configuration and the files that it names, and report all faults at once.

A check is made only where the settings that it reads are free of faults.
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
GRAIN_SECTIONS = ("berry", "validation")
TIME_STEP_SECTIONS = ("simulation", "wall", "parameters", "validation")

Result = TypeVar("Result")


def find_time_step_faults(
    config: Mapping[str, Any], particle: Particle, mean_grain: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    """Find out whether the engine would refuse the time step of a configuration.

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
        The key of the time step and its allowed values, if the time step is too long.
    """
    settings = select_valid_sections(config)
    limit = computed.find_longest_step(config, particle, mean_grain)
    if settings.simulation.time_step_s <= limit.time_step_s:
        return

    # Without a modulus in the configuration, it was computed from measured forces.
    # Forces in a wrong unit give a wrong modulus and thus a wrong limit, so show the
    # modulus.
    allowed = limit.allowed
    if settings.berry.shear_modulus_pa is None:
        modulus = f"{mean_grain['elastic_modulus_pa']:.2g} Pa"
        allowed += f"; the modulus of {settings.berry.compression} is {modulus}"
    yield "simulation.time_step_s", allowed


class ConfigChecks:
    """A configuration, its grain and its particle, and the faults found so far.

    A check is made only if the sections that it reads are free of faults.

    Attributes
    ----------
    config : dict
        The configuration; each `auto` is replaced as its number is computed.
    source : str or Origin
        The file that a fault names.
    faults : list of InputError
        The faults found so far.
    faulty_keys : set of str
        Dotted keys with a fault. The name of a section stands for the whole section.
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
        self.faults: list[InputError] = []
        self.faulty_keys: set[str] = set()
        self.mean_grain: Any = None
        self.particle: Any = None
        self.inputs_are_checked = False

    def check_and_compute(self, check_inputs: bool) -> None:
        """Check the configuration, and replace each `auto` in it by a number.

        Each step leaves out what depends on a fault of an earlier step, so the order of
        the steps matters. All faults are raised at the end.

        Parameters
        ----------
        check_inputs : bool
            Whether to check the named files as well, and whether grain, bench tests and
            time step fit together.

        Raises
        ------
        InputError
            With all faults.
        """
        self._complete_targets()
        self._check_single_keys()
        settings_to_compute = self._find_settings_to_compute()

        # Read the files before the grain, which is made from some of them.
        if check_inputs:
            self._check_named_files()
        if check_inputs or any(setting.needs_grain for setting in settings_to_compute):
            self._make_grain()

        # Computing a number relies on some of the rules. The others need the numbers.
        self._apply_rules(list_rules_before_computing(self.config))
        for setting in settings_to_compute:
            self._compute_setting(setting)
        self._apply_rules(list_rules_after_computing(self.config))

        if check_inputs:
            self._check_grain_fits()
        raise_together(self.faults)
        self.inputs_are_checked = check_inputs

    def check_inputs(self) -> None:
        """Check the named files, make the grain, and check that it fits the study.

        Afterwards `mean_grain` and `particle` are set. A second call does nothing.

        Raises
        ------
        InputError
            With all faults of the files, and of grain, bench tests and time step.
        """
        if self.inputs_are_checked:
            return
        self._check_named_files()
        self._make_grain()
        self._check_grain_fits()
        raise_together(self.faults)
        self.inputs_are_checked = True

    @property
    def settings(self) -> StudySettings:
        """The typed sections of the configuration that have no fault."""
        return select_valid_sections(self.config)

    def _complete_targets(self) -> None:
        """Replace measured profiles by their scores, and complete all ranges."""
        from repose.calibrate import profile_targets

        targets = self.config.get("targets")
        if not isinstance(targets, list):
            # A later check reports the fault.
            return
        file = find_file_to_edit(self.source, "targets")
        scores = profile_targets.expand_profiles(targets, file)
        completed = [complete_target(target) for target in scores]
        self.config = self.config | {"targets": completed}

    def _check_single_keys(self) -> None:
        """Check the value of each key, and forget the faults of an earlier check.

        A whole number that is written as 3.0 is replaced by 3.
        """
        model = make_settings_type()
        self.config = faults.convert_whole_numbers(self.config, model)
        checked = faults.find_faults(self.config, self.source, model)
        self.faults = checked.faults
        self.faulty_keys = checked.keys

    def _find_settings_to_compute(self) -> list[computed.ComputedSetting]:
        """Find the settings to compute, and set those that are missing to `auto`.

        Settings of sections with a fault are left out.
        """
        settings_to_compute = []
        for setting in computed.find_settings_to_compute(self.config):
            if self._are_faultless(setting.section):
                settings_to_compute.append(setting)
                self.config = computed.replace_setting(
                    self.config, setting, computed.AUTO
                )
        return settings_to_compute

    def _are_faultless(self, *sections: str) -> bool:
        """Tell whether no key of these sections has a fault.

        A key that belongs to no section, such as `targets`, may take the place of a
        section.
        """
        sections_with_faults = {key.partition(".")[0] for key in self.faulty_keys}
        return sections_with_faults.isdisjoint(sections)

    def _is_key_faultless(self, key: str) -> bool:
        """Tell whether a key has no fault.

        Faults of other keys in the same section do not count.
        """
        section = key.partition(".")[0]
        return self.faulty_keys.isdisjoint((key, section))

    def _add_faults(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Add a fault for each pair of a dotted key and its allowed values."""
        for key, allowed in pairs:
            self.faults.append(
                self._make_fault(key, get_value(self.config, key), allowed)
            )
            self.faulty_keys.add(key)

    def _make_fault(self, key: str, value: Any, allowed: str) -> InputError:
        """Make the error for a dotted key; the message names the file of the user."""
        return YamlError(
            find_file_to_edit(self.source, key), key=key, value=value, allowed=allowed
        )

    def _apply_rules(self, rules: Iterable[Rule]) -> None:
        """Apply the rules whose sections have no fault so far, and add their faults."""
        for rule in rules:
            if self._are_faultless(*rule.reads):
                self._add_faults(rule.find_faults())

    def _call_and_collect_faults(
        self, key: str, function: Callable[..., Result], *arguments: Any
    ) -> Result | None:
        """Call a function that reads the value of a key.

        Parameters
        ----------
        key : str
            The dotted key, or a section, which is marked as faulty if the call fails.
        function : callable
            Function that raises an InputError for a value that it does not allow.
        *arguments
            The arguments of the function.

        Returns
        -------
        object
            The result of the function. None if it fails; its faults are then added to
            the others.
        """
        try:
            return function(*arguments)
        except InputError as error:
            for fault in getattr(error, "faults", [error]):
                self.faults.append(self._name_users_file(fault, key))
            self.faulty_keys.add(key)
            return None

    def _name_users_file(self, fault: InputError, section: str) -> InputError:
        """Add the user's file to a fault that names only a section.

        The functions that read a section do not know its file. A fault that names a
        file is returned unchanged.
        """
        if fault.source != section:
            return fault
        return self._make_fault(f"{section}.{fault.key}", fault.value, fault.allowed)

    def _check_named_files(self) -> None:
        """Check that the named files exist, and read those that no other check reads.

        The faults of missing and invalid files are added to the others. The contents of
        the files are not kept.
        """
        # No file may have the path of the folder of results.
        if self._are_faultless("results_dir"):
            self._add_faults(
                results_folder.find_folder_faults(self.settings.results_dir)
            )

        # Report all files that are missing.
        paths = self._find_named_paths()
        missing_keys = [key for key, path in paths.items() if not Path(path).is_file()]
        allowed = "an existing file, relative to the folder of the project"
        self._add_faults((key, allowed) for key in missing_keys)

        # The contents of the existing files may also have faults.
        for key, read in self._map_keys_to_readers().items():
            if key in paths and key not in missing_keys:
                self._call_and_collect_faults(key, read, paths[key])

    def _find_named_paths(self) -> dict[str, str]:
        """Map the dotted key of each named file to the path of the file.

        Keys with a fault, and keys without a value, are left out.
        """
        paths = {}
        for key in list_file_keys():
            path = get_value(self.config, key)
            if path is not None and self._is_key_faultless(key):
                paths[key] = path
        return paths

    def _map_keys_to_readers(self) -> dict[str, Callable[[str], Any]]:
        """Map the dotted keys of named files to the functions that read these files.

        Files that need not be read, or that another check reads, are left out.
        """
        from repose.calibrate.uncertainty.discrepancy import estimate_from_shape_study
        from repose.grain.berry_files import read_sizes
        from repose.measure.pile import read_image

        readers: dict[str, Callable[[str], Any]] = {
            "berry.sizes": read_sizes,
            "photograph": read_image,
            "validation.published": check_published_sets,
            "validation.published_simulated": read_stored,
        }
        if self._are_faultless("targets"):
            targets = Targets.of(self.config["targets"])
            readers["posterior.shape_study"] = partial(
                estimate_from_shape_study, targets=targets
            )
        return readers

    def _make_grain(self) -> None:
        """Make the mean grain and its particle, unless they already exist.

        They remain None if their settings have a fault. Faults in their files are added
        to the others.
        """
        from repose.grain import build

        if self.mean_grain is None and self._are_faultless(*GRAIN_SECTIONS):
            self.mean_grain = self._compute_mean_grain()
        if self.particle is None and self.mean_grain is not None:
            self.particle = self._call_and_collect_faults(
                "berry",
                build.make_configured_particle,
                self.mean_grain,
                self.settings.berry,
            )

    def _compute_mean_grain(self) -> dict[str, Any] | None:
        """Compute the mean grain from the files of the section `berry`.

        Returns
        -------
        dict or None
            The mean grain, as in berry.json. None if a file has a fault, which is added
            to the others.
        """
        from repose.grain import berry

        settings = self.settings
        table1_csv = find_sibling_table(settings.validation.published, "table1.csv")
        result = self._call_and_collect_faults(
            "berry", berry.compute_configured_grain, settings.berry, table1_csv
        )
        if result is None:
            return None
        # The statistics of the sizes are not needed here.
        _statistics, mean_grain = result
        return mean_grain

    def _compute_setting(self, setting: computed.ComputedSetting) -> None:
        """Replace the `auto` of a setting by a number.

        If the number cannot be computed, the key is marked as faulty.

        Parameters
        ----------
        setting : ComputedSetting
            The key, the sections on which the number depends, and the function that
            computes it.
        """
        # The number cannot be computed if a section on which it depends has a fault.
        lacks_grain = setting.needs_grain and self.particle is None
        if lacks_grain or not self._are_faultless(*setting.reads):
            self.faulty_keys.add(setting.key)
            return
        number = self._call_and_collect_faults(
            setting.key, setting.compute, self.config, self.mean_grain, self.particle
        )
        if number is None:
            return
        self.config = computed.replace_setting(self.config, setting, number)

        # Even a computed number may lie outside the allowed range.
        checked = faults.find_faults(self.config, self.source, make_settings_type())
        for fault in checked.faults:
            if fault.key == setting.key:
                read = ", ".join(setting.reads)
                allowed = (
                    f"{fault.allowed}; `auto` gave this number, which follows from "
                    f"the other keys of {read}"
                )
                self._add_faults([(fault.key, allowed)])

    def _check_grain_fits(self) -> None:
        """Check that the grain fits the bench tests and the time step.

        Without a grain, which is missing if its settings have a fault, nothing is
        checked.
        """
        if self.mean_grain is None:
            return

        # A bench test must be large enough for the grain.
        axes_mm = computed.list_axes_mm(self.mean_grain)
        for test in find_tests_in_use(self.config):
            if self._are_faultless(test.name):
                self._add_faults(test.misfits(SceneSettings(self.config), axes_mm))

        # Angles are measured with the height of a grain, which must be that of this
        # grain.
        if self._are_faultless("measure"):
            measure = SceneSettings(self.config).section("measure", MeasureSettings)
            self._add_faults(measure.misfits(axes_mm))

        # The time step must be short enough for it.
        if self.particle is not None and self._are_faultless(*TIME_STEP_SECTIONS):
            self._add_faults(
                find_time_step_faults(self.config, self.particle, self.mean_grain)
            )
