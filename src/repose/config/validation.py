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
    list_rules_after_numbers,
    list_rules_before_numbers,
)
from repose.config.models import (
    StudySettings,
    make_settings_type,
    select_valid_sections,
)
from repose.grain.particle import Particle
from repose.stages.published import (
    check_published_sets,
    find_sibling_table,
    read_stored,
)

# Sections that the mean grain follows from, and those that limit the time step.
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
        Otherwise nothing.
    """
    settings = select_valid_sections(config)
    limit = computed.find_longest_step(config, particle, mean_grain)
    if settings.simulation.time_step_s <= limit.time_step_s:
        return

    # Without a modulus in the configuration, it was computed from measured forces. Forces
    # in a wrong unit give a wrong modulus and so a wrong time step, so show the modulus.
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
        Dotted keys with a fault.
    mean_grain : dict or None
        The mean grain, as in berry.json; None until it is made.
    particle : Particle or None
        Its body; None until it is made.
    inputs_are_checked : bool
        Whether the named files, and the fit of grain, bench tests and time step, were
        checked.
    """

    def __init__(self, config: dict[str, Any], source: str | Origin) -> None:
        self.config = config
        self.source = source
        self.faults: list[InputError] = []
        self.faulty_keys: set[str] = set()
        self.mean_grain: Any = None
        self.particle: Any = None
        self.inputs_are_checked = False

    def check_and_compute(self, inputs: bool) -> None:
        """Check the configuration, and replace each `auto` in it by a number.

        Parameters
        ----------
        inputs : bool
            Whether to check also the named files, and whether grain, bench tests and
            time step fit together.

        Raises
        ------
        InputError
            With all faults.
        """
        # Check each key separately. This replaces the faults of an earlier check.
        self._complete_targets()
        self.config = faults.convert_whole_numbers(self.config, make_settings_type())
        checked = faults.find_faults(self.config, self.source, make_settings_type())
        self.faults = checked.faults
        self.faulty_keys = checked.keys

        # List the numbers to compute. Until they are computed each of them is `auto`.
        settings_to_compute = []
        for setting in computed.find_settings_to_compute(self.config):
            if self._may_read(setting.section):
                settings_to_compute.append(setting)
                self.config = computed.replace_setting(
                    self.config, setting, computed.AUTO
                )

        # Compute these numbers. Some of them depend on the grain.
        if inputs:
            self._read_files()
        if inputs or any(setting.needs_grain for setting in settings_to_compute):
            self._make_grain()
        self._apply_rules(list_rules_before_numbers(self.config))
        for setting in settings_to_compute:
            self._compute_setting(setting)

        # Check whether keys contradict each other, and report all faults.
        self._apply_rules(list_rules_after_numbers(self.config))
        if inputs:
            self._check_fit()
        raise_together(self.faults)
        self.inputs_are_checked = inputs

    def make_checked_grain(self) -> tuple[dict[str, Any], Particle]:
        """Make the mean grain and its particle, and check all inputs.

        If the grain was made and checked before, it is returned as it is.

        Returns
        -------
        mean_grain : dict
            As in berry.json.
        particle : Particle
            Its body.

        Raises
        ------
        InputError
            With all faults of the files, and of grain, bench tests and time step.
        """
        if not self.inputs_are_checked:
            self._read_files()
            self._make_grain()
            self._check_fit()
            raise_together(self.faults)
            self.inputs_are_checked = True
        return self.mean_grain, self.particle

    @property
    def settings(self) -> StudySettings:
        """The typed sections of the configuration that have no fault."""
        return select_valid_sections(self.config)

    def _complete_targets(self) -> None:
        """Replace measured profiles by their scores, and complete all ranges."""
        from repose.calibrate import profile_targets

        entries = self.config.get("targets")
        if not isinstance(entries, list):
            # A later check reports the fault.
            return
        file = find_file_to_edit(self.source, "targets")
        expanded = profile_targets.expand_profiles(entries, file)
        targets = [complete_target(entry) for entry in expanded]
        self.config = self.config | {"targets": targets}

    def _may_read(self, *sections: str) -> bool:
        """Tell whether these sections, or keys outside sections, have no fault."""
        sections_with_faults = {key.partition(".")[0] for key in self.faulty_keys}
        return sections_with_faults.isdisjoint(sections)

    def _may_use(self, key: str) -> bool:
        """Tell whether a key has no fault.

        Faults of other keys in its section do not count.
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
        """Make the fault of a dotted key, which names the user's file."""
        return YamlError(
            find_file_to_edit(self.source, key), key=key, value=value, allowed=allowed
        )

    def _apply_rules(self, applicable: Iterable[Rule]) -> None:
        """Add the faults of the rules whose sections have none so far."""
        for rule in applicable:
            if self._may_read(*rule.reads):
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
            Raises an InputError for a value that it does not allow.
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
        """Name the user's file in a fault that names only a section.

        The functions that read a section do not know its file. A fault that names a file
        is returned unchanged.
        """
        if fault.source != section:
            return fault
        return self._make_fault(f"{section}.{fault.key}", fault.value, fault.allowed)

    def _read_files(self) -> None:
        """Check that the named files exist, and read those that no other check reads.

        The faults are added to the others. The contents of the files are not kept.
        """
        # No file may have the path of the folder of results.
        if self._may_read("results_dir"):
            self._add_faults(
                results_folder.find_folder_faults(self.settings.results_dir)
            )

        # Report all files that are missing.
        paths = self._find_named_paths()
        missing_keys = [key for key, path in paths.items() if not Path(path).is_file()]
        allowed = "an existing file, relative to the folder of the project"
        self._add_faults((key, allowed) for key in missing_keys)

        # Read the others, so that faults in them are reported, too.
        for key, read in self._choose_readers().items():
            if key in paths and key not in missing_keys:
                self._call_and_collect_faults(key, read, paths[key])

    def _find_named_paths(self) -> dict[str, str]:
        """Map the dotted key of each named file to its path.

        Keys with a fault, and keys without a value, are left out.
        """
        from repose.config.models import list_file_keys

        paths = {}
        for key in list_file_keys():
            if not self._may_use(key):
                continue
            path = get_value(self.config, key)
            if path is not None:
                paths[key] = path
        return paths

    def _choose_readers(self) -> dict[str, Callable[[str], Any]]:
        """Map the dotted keys of named files to the functions that read them."""
        from repose.calibrate.uncertainty.discrepancy import estimate_from_shape_study
        from repose.grain.berry_files import read_sizes
        from repose.measure.pile import read_image

        readers: dict[str, Callable[[str], Any]] = {
            "berry.sizes": read_sizes,
            "photograph": read_image,
            "validation.published": check_published_sets,
            "validation.published_simulated": read_stored,
        }
        if self._may_read("targets"):
            targets = Targets.of(self.config["targets"])
            readers["posterior.shape_study"] = partial(
                estimate_from_shape_study, targets=targets
            )
        return readers

    def _make_grain(self) -> None:
        """Make the mean grain and its particle, unless they were made before.

        They remain None if their settings have a fault. Faults in their files are added
        to the others.
        """
        from repose.grain import berry, build

        if self.mean_grain is None and self._may_read(*GRAIN_SECTIONS):
            settings = self.settings
            table1 = find_sibling_table(settings.validation.published, "table1.csv")
            result = self._call_and_collect_faults(
                "berry", berry.compute_configured_grain, settings.berry, table1
            )
            # The result also has the statistics of the sizes, which no check needs.
            if result is not None:
                _, self.mean_grain = result
        if self.mean_grain is not None and self.particle is None:
            self.particle = self._call_and_collect_faults(
                "berry",
                build.make_configured_particle,
                self.mean_grain,
                self.settings.berry,
            )

    def _compute_setting(self, setting: computed.ComputedSetting) -> None:
        """Replace an `auto` by its number, or mark its key as faulty if that fails.

        Parameters
        ----------
        setting : ComputedSetting
            The key, the sections that its number follows from, and the function that
            computes it.
        """
        # The number cannot be computed if a section that it depends on has a fault.
        lacks_grain = setting.needs_grain and self.particle is None
        if lacks_grain or not self._may_read(*setting.reads):
            self.faulty_keys.add(setting.key)
            return
        number = self._call_and_collect_faults(
            setting.key, setting.compute, self.config, self.mean_grain, self.particle
        )
        if number is None:
            return
        self.config = computed.replace_setting(self.config, setting, number)

        # Even a computed number may lie outside the allowed range.
        for fault in faults.find_faults(
            self.config, self.source, make_settings_type()
        ).faults:
            if fault.key == setting.key:
                allowed = f"{fault.allowed}; `auto` gives this number"
                self._add_faults([(fault.key, allowed)])

    def _check_fit(self) -> None:
        """Check that the grain fits the bench tests and the time step."""
        if self.mean_grain is None:
            return
        axes_mm = computed.list_axes_mm(self.mean_grain)
        for test in find_tests_in_use(self.config):
            if self._may_read(test.name):
                self._add_faults(test.misfits(SceneSettings(self.config), axes_mm))
        if self.particle is not None and self._may_read(*TIME_STEP_SECTIONS):
            self._add_faults(
                find_time_step_faults(self.config, self.particle, self.mean_grain)
            )
