"""The making of a study: checks of its configuration and of its files, which report all faults at once."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from repose.bench.settings import SceneSettings
from repose.calibrate.targets import Targets, completed
from repose.common import faults
from repose.common.errors import InputError, YamlError, raise_together
from repose.common.keys import Origin, get, owner_of
from repose.config import computed, results_folder
from repose.config.contradictions import Rule, before_numbers, rules, used_tests
from repose.config.models import StudySettings, settings_type, valid_sections
from repose.grain.particle import Particle
from repose.stages.published import beside, check_published, read_stored

# Sections of the mean grain, and further sections that limit the time step.
GRAIN = ("berry", "validation")
STEP = ("simulation", "wall", "parameters", "validation")

Result = TypeVar("Result")


def unstable(
    config: Mapping[str, Any], particle: Particle, mean: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    """Yield (key, allowed values) of a time step that the engine would refuse; `mean` is the result of `berry`."""
    limit = computed.longest_step(config, particle, mean)
    settings = valid_sections(config)
    if settings.simulation.time_step_s > limit.time_step_s:
        allowed = limit.allowed
        # A modulus in another unit shortens the step: a reader sees it here.
        if settings.berry.shear_modulus_pa is None:
            modulus = f"{mean['elastic_modulus_pa']:.2g} Pa"
            allowed += f"; the modulus of {settings.berry.compression} is {modulus}"
        yield "simulation.time_step_s", allowed


class Making:
    """A study's configuration, grain and particle, and the faults found so far.

    A check is made only where no section that it reads has a fault.
    """

    def __init__(self, config: dict[str, Any], source: str | Origin) -> None:
        self.config, self.source = config, source
        self.faults: list[InputError] = []
        self.bad: set[str] = set()  # dotted keys with a fault
        self.mean: Any = None
        self.particle: Any = None
        self.inputs_are_checked = False

    def complete(self, inputs: bool) -> None:
        """Check the configuration and compute each `auto`; with `inputs` check all files that it names, too."""
        from repose.calibrate import profile_targets

        if isinstance(given := self.config.get("targets"), list):
            targets = profile_targets.expanded(given, owner_of(self.source, "targets"))
            self.config = self.config | {
                "targets": [completed(entry) for entry in targets]
            }
        self.faults, self.bad = faults.check(self.config, self.source, settings_type())
        pending = [
            setting
            for setting in computed.to_compute(self.config)
            if self._may_read(setting.section)
        ]
        for setting in pending:
            self.config = computed.filled(self.config, setting, computed.AUTO)
        if inputs:
            self._read_files()
        if inputs or any(setting.needs_grain for setting in pending):
            self._make_grain()
        self._apply(before_numbers(self.config))
        self._compute(pending)
        self._apply(rules(self.config))
        if inputs:
            self._fit_together()
        raise_together(self.faults)
        self.inputs_are_checked = inputs

    def checked_grain(self) -> tuple[dict[str, Any], Particle]:
        """Return the mean grain and its particle; before, check the files and that everything fits together."""
        if not self.inputs_are_checked:
            self._read_files()
            self._make_grain()
            self._fit_together()
            raise_together(self.faults)
            self.inputs_are_checked = True
        return self.mean, self.particle

    @property
    def settings(self) -> StudySettings:
        """The typed sections of the configuration so far that have no fault."""
        return valid_sections(self.config)

    def _may_read(self, *sections: str) -> bool:
        """Return whether none of these sections, and keys outside sections, has a fault."""
        return {key.partition(".")[0] for key in self.bad}.isdisjoint(sections)

    def _may_use(self, key: str) -> bool:
        """Return whether a key has no fault; faults of other keys in its section do not count."""
        return self.bad.isdisjoint((key, key.partition(".")[0]))

    def _add(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Add pairs (dotted key, allowed values)."""
        for key, allowed in pairs:
            self.faults.append(
                YamlError(
                    owner_of(self.source, key), key, get(self.config, key), allowed
                )
            )
            self.bad.add(key)

    def _apply(self, some: Iterable[Rule]) -> None:
        """Add the faults of rules whose sections have none."""
        for rule in some:
            if self._may_read(*rule.reads):
                self._add(rule.faults())

    def _result_of(
        self, key: str, function: Callable[..., Result], *arguments: Any
    ) -> Result | None:
        """Call a function; if it refuses its arguments, return None and add a fault of the key."""
        try:
            return function(*arguments)
        except InputError as fault:
            for one in getattr(fault, "faults", [fault]):
                if one.source == key:  # a key of this section, not a file
                    dotted = f"{key}.{one.key}"
                    one = YamlError(
                        owner_of(self.source, dotted), dotted, one.value, one.allowed
                    )
                self.faults.append(one)
            self.bad.add(key)
            return None

    def _read_files(self) -> None:
        """Check that the files exist; read the files that no other check reads."""
        from repose.calibrate.uncertainty.discrepancy import of_shape_study
        from repose.config.models import named_files
        from repose.grain.berry_files import read_sizes
        from repose.measure.pile import read_image

        if self._may_read("results_dir"):
            self._add(results_folder.existing_results(self.settings.results_dir))
        named = {
            key: get(self.config, key) for key in named_files() if self._may_use(key)
        }
        named = {key: path for key, path in named.items() if path is not None}
        missing = [key for key, path in named.items() if not Path(path).is_file()]
        self._add(
            (key, "an existing file, relative to the folder of the project")
            for key in missing
        )
        readers: dict[str, Callable[[str], Any]] = {
            "berry.sizes": read_sizes,
            "photograph": read_image,
        }
        readers |= {
            "validation.published": check_published,
            "validation.published_simulated": read_stored,
        }
        if self._may_read("targets"):
            readers["posterior.shape_study"] = partial(
                of_shape_study, targets=Targets.of(self.config["targets"])
            )
        for key in [key for key in readers if key in named and key not in missing]:
            self._result_of(key, readers[key], named[key])

    def _make_grain(self) -> None:
        """Make the mean grain and its particle."""
        from repose.grain import berry, build

        if self.mean is None and self._may_read(*GRAIN):
            table1 = beside(self.settings.validation.published, "table1.csv")
            made = self._result_of(
                "berry", berry.of_settings, self.settings.berry, table1
            )
            self.mean = None if made is None else made[1]
        if self.mean is not None and self.particle is None:
            self.particle = self._result_of(
                "berry", build.of_settings, self.mean, self.settings.berry
            )

    def _compute(self, pending: Iterable[computed.Computed]) -> None:
        """Replace each `auto` by its number; a key whose number cannot be computed has a fault."""
        for setting in pending:
            value = None
            if self._may_read(*setting.reads) and not (
                setting.needs_grain and self.particle is None
            ):
                value = self._result_of(
                    setting.key, setting.of, self.config, self.mean, self.particle
                )
            if value is None:
                self.bad.add(setting.key)
            else:
                self.config = computed.filled(self.config, setting, value)
                wrong = (
                    one
                    for one in faults.check(
                        self.config, self.source, settings_type()
                    ).faults
                    if one.key == setting.key
                )
                self._add(
                    (one.key, f"{one.allowed}; `auto` gives this number")
                    for one in wrong
                )

    def _fit_together(self) -> None:
        """Check the grain against the bench tests and the time step."""
        if self.mean is None:
            return
        for test in used_tests(self.config):
            if self._may_read(test.name):
                self._add(
                    test.misfits(
                        SceneSettings(self.config), computed.axes_mm(self.mean)
                    )
                )
        if self.particle is not None and self._may_read(*STEP):
            self._add(unstable(self.config, self.particle, self.mean))
