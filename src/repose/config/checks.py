"""Checks of a configuration and of the files that it names; all faults are reported at once."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from repose.apparatus.settings import SimulationSettings
from repose.config import computed, results_folder
from repose.config.contradictions import rules, used_tests
from repose.config.reading import Origin, get, owner_of
from repose.config.schema import input_errors, missing_keys, validator
from repose.core.errors import InputError, YamlError, raise_together
from repose.core.published import beside, check_published
from repose.core.targets import Targets

if TYPE_CHECKING:
    from repose.particle.particle import Particle

NAMED_FILES = (
    *("berry.sizes", "berry.compression", "berry.stl"),
    *("validation.published", "posterior.shape_study"),
)
# Keys of the mean grain, and further keys that limit the time step.
GRAIN = ("berry", "validation.published")
STEP = ("simulation", "wall", "parameters", "validation.published")

Result = TypeVar("Result")


def check(config: dict[str, Any], source: str | Origin = "configuration") -> dict[str, Any]:
    """Check a configuration without `auto` by its schema and by the rules between keys, and return it.

    The files that it names are left to `check_inputs`. A rule is applied if each key that it reads is valid by itself.
    One InputError holds all faults; `source` names the file in it.
    """
    checks = _Checks(config, source)
    checks.add((one.key, "a number; `auto` is for the file of a study") for one in computed.asked(config))
    checks.ask_rules()
    raise_together(checks.faults)
    return config


def check_inputs(config: dict[str, Any], source: str | Origin = "configuration") -> None:
    """Check the files that a checked configuration names, and that berry, bench test and time step fit together.

    The berry's particle is made for it, and the engine gives the longest time step. One InputError holds all faults.
    """
    checks = _Checks(config, source)
    checks.read_files()
    checks.make_grain()
    checks.fit_together()
    raise_together(checks.faults)


def complete(config: dict[str, Any], source: str | Origin, inputs: bool = True) -> dict[str, Any]:
    """Compute each `auto` of a configuration, and check it as `check` and `check_inputs` do.

    Without `inputs` the files that it names are only read where an `auto` needs them. One InputError holds all faults.
    """
    checks = _Checks(config, source)
    asked = computed.asked(config)
    checks.unknown |= {one.key for one in asked}
    checks.ask_rules()
    if inputs:
        checks.read_files()
    if inputs or any(one.needs_grain for one in asked):
        checks.make_grain()
    checks.compute(asked)
    checks.ask_rules()
    if inputs:
        checks.fit_together()
    raise_together(checks.faults)
    return checks.config


def unstable(
    config: Mapping[str, Any], particle: "Particle", mean: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    """A time step that the engine would refuse, as (key, what is allowed); `mean` is the result of the verb `berry`."""
    limit = computed.longest_step(config, particle, mean)
    if SimulationSettings.of(config).time_step_s > limit.time_step_s:
        yield "simulation.time_step_s", limit.allowed


class _Checks:
    """The faults of a configuration. A check is made once all that it reads is known and valid."""

    def __init__(self, config: dict[str, Any], source: str | Origin) -> None:
        self.config, self.source = config, source
        errors = list(validator().iter_errors(config))
        self.faults: list[InputError] = list(input_errors(errors, config, source))
        # keys whose values cannot be used; a mistyped key is missing as well
        self.unknown = {fault.key for fault in self.faults} | missing_keys(errors)
        self.asked: set[tuple[str, ...]] = set()  # rules already applied, by the keys that they read
        self.mean: dict[str, Any] | None = None
        self.particle: Particle | None = None

    def may_read(self, *keys: str) -> bool:
        """Whether keys and sections are known and valid."""
        return not any(_overlap(key, unknown) for key in keys for unknown in self.unknown)

    def add(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Add pairs (dotted key, what is allowed)."""
        for key, allowed in pairs:
            self.faults.append(YamlError(owner_of(self.source, key), key, get(self.config, key), allowed))
            self.unknown.add(key)

    def found(self, key: str, function: Callable[..., Result], *arguments: Any) -> Result | None:
        """Result of a function; if it refuses its arguments, None, with a further fault and the key unusable."""
        try:
            return function(*arguments)
        except InputError as fault:
            self.faults.append(fault)
            self.unknown.add(key)
            return None

    def ask_rules(self) -> None:
        """Apply each rule that can be applied by now, once."""
        if not isinstance(self.config, dict):
            return
        ready = [
            rule for rule in rules(self.config) if rule.reads not in self.asked and self.may_read(*rule.reads)
        ]
        for rule in ready:
            self.asked.add(rule.reads)
            self.add(rule.faults(self.config))

    def read_files(self) -> None:
        """Look for the files, and read those that no other check reads."""
        from repose.particle.berry_files import read_sizes

        if self.may_read("results_dir"):
            self.add(results_folder.taken(self.config["results_dir"]))
        for key in filter(self.may_read, NAMED_FILES):
            path = get(self.config, key)
            if path is not None and not Path(path).is_file():
                self.add([(key, "an existing file, seen from the project's folder")])
        if self.may_read("berry.sizes"):
            self.found("berry.sizes", read_sizes, self.config["berry"]["sizes"])
        if self.may_read("validation.published", "targets"):
            published = self.config["validation"]["published"]
            responses = Targets.of(self.config["targets"]).responses
            self.found("validation.published", check_published, published, responses)

    def make_grain(self) -> None:
        """Make the mean berry and its particle."""
        from repose.particle import build

        if self.may_read(*GRAIN):
            self.mean = self.found("berry", _mean_berry, self.config)
        if self.mean is not None:
            self.particle = self.found("berry", build.of_settings, self.mean, self.config["berry"])

    def compute(self, asked: Iterable[computed.Computed]) -> None:
        """Replace each `auto` by its number if that follows from what is known by now."""
        for one in asked:
            if self.may_read(*one.reads) and not (one.needs_grain and self.particle is None):
                value = one.of(self.config, self.mean, self.particle)
                self.config = computed.filled(self.config, one.key, value)
                self.unknown.discard(one.key)

    def fit_together(self) -> None:
        """Check the grain against the bench tests and the time step."""
        if self.mean is not None:
            for test in used_tests(self.config):
                if self.may_read(test.name):
                    self.add(test.misfits(self.config, computed.axes_mm(self.mean)))
        if self.mean is not None and self.particle is not None and self.may_read(*STEP):
            self.add(unstable(self.config, self.particle, self.mean))


def _overlap(key, other):
    """Whether one dotted key is the other one or lies in it."""
    return f"{key}.".startswith(f"{other}.") or f"{other}.".startswith(f"{key}.")


def _mean_berry(config):
    """The mean berry of the configuration's files."""
    from repose.particle import berry

    section = config["berry"]
    material = section["density_kg_m3"], section["poisson_ratio"], section["shear_modulus_pa"]
    table1 = beside(config["validation"]["published"], "table1.csv")
    return berry.of_files(section["sizes"], section["compression"], table1, *material)[1]
