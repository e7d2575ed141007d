"""Rules between sections: each reports values that contradict each other.

Rules between the keys of one section are in its model (`repose.common.section.Section.contradictions`).
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

from repose.bench import bench_tests
from repose.bench.bench_test import BenchTest
from repose.bench.parameters import FURTHER, LABELS, PARAMETERS, named, of_law
from repose.bench.settings import SceneSettings
from repose.calibrate.parameter_space import ParameterSpace
from repose.config import typed
from repose.config.models import StudySettings

Pairs = Iterator[tuple[str, str]]


class Rule(NamedTuple):
    """A rule between sections."""

    reads: tuple[
        str, ...
    ]  # sections, and keys outside sections; the rule is applied if none of them has a fault
    faults: Callable[[], Pairs]  # faults() yields (dotted key, allowed values)


def before_numbers(config: Mapping[str, Any]) -> list[Rule]:
    """List the rules that are applied before any `auto` is computed: a time step needs the contact law's constants."""
    settings = typed.sections(config)
    return [
        Rule(("targets",), partial(_of_targets, settings, config)),
        Rule(("parameters", "simulation"), partial(_of_the_contact_law, settings)),
    ]


def rules(config: Mapping[str, Any]) -> list[Rule]:
    """List the rules for a configuration whose `auto` are numbers, bench tests included."""
    from repose.calibrate.strategies import cost

    used, scene, settings = (
        used_tests(config),
        SceneSettings(config),
        typed.sections(config),
    )
    return [
        *(
            Rule((test.name, "simulation"), partial(test.contradictions, scene))
            for test in used
        ),
        Rule(
            ("surrogate", "parameters", "network", "design"),
            partial(_of_the_surrogate, settings),
        ),
        Rule(
            ("surrogate", "network", "design", "targets"),
            partial(_of_the_validation, settings),
        ),
        Rule(
            ("network", "targets", *(test.name for test in used)),
            partial(_of_seeds, settings),
        ),
        Rule(
            ("strategy", *cost.others(), "targets", "parameters"),
            partial(cost.contradictions, settings),
        ),
    ]


def used_tests(config: Mapping[str, Any]) -> list[BenchTest[Any]]:
    """Return the bench tests whose section is in the configuration."""
    return [test for test in bench_tests() if test.name in config]


def _of_the_surrogate(settings: StudySettings) -> Pairs:
    """Refuse fewer samples for training than the surrogate needs."""
    from repose.calibrate.surrogates import kind_of
    from repose.calibrate.surrogates import names as surrogates

    free = ParameterSpace.of(settings.parameters.given).dimensions
    training = int(settings.network.split[0] * settings.design.samples + 1e-9)
    least = kind_of(settings.surrogate).least_samples(free)
    if training < least:
        fitting = " or ".join(
            name
            for name in surrogates()
            if kind_of(name).least_samples(free) <= training
        )
        yield (
            "surrogate",
            f"{fitting} where design.samples times the first of network.split is below {least}",
        )


def _of_the_validation(settings: StudySettings) -> Pairs:
    """Refuse fewer validation samples than show the noise of all targets."""
    network, targets = settings.network, len(settings.targets)
    if (
        network.validation_noise
        and int(network.split[1] * settings.design.samples + 1e-9) <= targets
    ):
        more = f"a second share that leaves more than {targets} validation samples"
        yield "network.split", f"{more}, or network.validation_noise: false"


def _of_the_contact_law(settings: StudySettings) -> Pairs:
    """Refuse force laws that lack parameters, and parameters of another law."""
    simulation, given = settings.simulation, settings.parameters.given
    law, rolling = simulation.contact_law, simulation.rolling_law
    missing = [
        f"parameters.{name} ({LABELS[name]})"
        for name in of_law(law)
        if name not in given
    ]
    if missing:
        yield (
            "simulation.contact_law",
            f"{law} with {' and '.join(missing)}, each a range or a fixed value",
        )
    for name in named(given)[len(PARAMETERS) :]:
        of = FURTHER[name]
        if not {law, rolling} & set(of.laws):
            key, own = ("contact_law", law) if of.needed else ("rolling_law", rolling)
            belongs = " or ".join(of.laws)
            yield (
                f"parameters.{name}",
                f"absent: it belongs to simulation.{key} {belongs}, not {own}",
            )


def _of_seeds(settings: StudySettings) -> Pairs:
    """Refuse too few runs of a sample to compare them, in a bench test of the targets."""
    for name in (
        dict.fromkeys(target.apparatus for target in settings.targets)
        if settings.network.replicates
        else ()
    ):
        if getattr(settings, name).seeds < 2:
            yield (
                f"{name}.seeds",
                "at least 2, or network.replicates: false, since single runs show no noise",
            )


def _of_targets(settings: StudySettings, config: Mapping[str, Any]) -> Pairs:
    """Refuse targets of a bench test that the configuration lacks, and responses that are given twice."""
    seen = set()
    for k, target in enumerate(settings.targets):
        if target.apparatus not in config:
            yield (
                f"targets.{k}.apparatus",
                "a bench test that has a section of its name in the configuration",
            )
        if target.response in seen:
            yield f"targets.{k}.response", "each response once"
        seen.add(target.response)
