"""Find settings of different sections that contradict each other.

A problem is a pair of a dotted key and a description of its allowed values. An error
message puts the description after the word "expected".

Rules between the keys of one section are in its model
(`repose.common.section.Section.contradictions`).
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

from repose.bench import bench_tests
from repose.bench.bench_test import BenchTest
from repose.bench.parameters import (
    ALLOWED,
    LABELS,
    LAW_PARAMETERS,
    parameters_of_law,
)
from repose.bench.settings import SceneSettings
from repose.calibrate.parameter_types import find_constraint_errors
from repose.calibrate.strategies import obeying_strategies, strategy
from repose.config.models import StudySettings, select_valid_sections

# Rounding errors may put a product just below an integer: 0.7 * 90 is 62.99999. This
# number is added before the decimals are cut off. It is larger than any such error.
ROUNDING_MARGIN = 1e-9
# Positions of these parts of the design in the list `network.split`.
TRAINING_PART = 0
VALIDATION_PART = 1
# The noise is estimated from the scatter of the runs of a sample, which needs two runs.
MIN_RUNS_FOR_NOISE = 2
# Problems: pairs of a dotted key and its allowed values.
KeyProblems = Iterator[tuple[str, str]]


class Rule(NamedTuple):
    """A rule between sections.

    Attributes
    ----------
    reads : tuple of str
        Sections, and keys outside sections, on which the rule depends. The rule is
        applied only if all of them are valid. It must list what the function reads.
    find_problems : callable
        Function that yields the dotted key and the allowed values of each problem.
    """

    reads: tuple[str, ...]
    find_problems: Callable[[], KeyProblems]


def list_rules_before_computing(config: Mapping[str, Any]) -> list[Rule]:
    """List the rules that are applied before any `auto` is replaced by a number.

    The computation of the number relies on these rules. For example, the computation of
    a time step needs the constants of the contact law.

    Parameters
    ----------
    config : mapping
        The configuration, in which sections may be missing or invalid.

    Returns
    -------
    list of Rule
        The rules, in the order in which they are applied.
    """
    settings = select_valid_sections(config)
    return [
        Rule(("targets",), partial(_find_target_problems, settings, config)),
        Rule(
            ("parameters", "simulation"), partial(_find_contact_law_problems, settings)
        ),
    ]


def list_rules_after_computing(config: Mapping[str, Any]) -> list[Rule]:
    """List the rules that are applied when every `auto` has been replaced by a number.

    The tuple `reads` of each rule must name every section that its function uses,
    because a rule is applied only if these sections are valid.

    Parameters
    ----------
    config : mapping
        The configuration, in which sections may be missing or invalid.

    Returns
    -------
    list of Rule
        The rules of the bench tests in use, and the rules of the calibration.
    """
    from repose.calibrate.strategies import cost

    scene = SceneSettings(config)
    settings = select_valid_sections(config)
    bench_tests_in_use = find_tests_in_use(config)
    test_names = [test.name for test in bench_tests_in_use]

    # Each bench test has rules of its own. They read the section of the bench test.
    test_rules = []
    for test in bench_tests_in_use:
        rule = Rule(
            reads=(test.name, "simulation"),
            find_problems=partial(test.contradictions, scene),
        )
        test_rules.append(rule)

    # The other rules are about the method of the calibration. A strategy's section has
    # the name of the strategy.
    strategy_names = cost.list_strategies_with_section()
    return [
        *test_rules,
        Rule(
            reads=("surrogate", "parameters", "network", "design"),
            find_problems=partial(_find_surrogate_problems, settings),
        ),
        Rule(
            reads=("surrogate", "network", "design", "targets"),
            find_problems=partial(_find_validation_problems, settings),
        ),
        Rule(
            reads=("network", "targets", "strategy", "refine", *test_names),
            find_problems=partial(_find_replicate_problems, settings),
        ),
        Rule(
            reads=("strategy", *strategy_names, "targets", "parameters"),
            find_problems=partial(_find_strategy_problems, settings),
        ),
        Rule(
            reads=("strategy", "parameters", "constraints"),
            find_problems=partial(_find_constraint_problems, settings),
        ),
    ]


def find_tests_in_use(config: Mapping[str, Any]) -> list[BenchTest[Any]]:
    """Find the bench tests that have a section in the configuration."""
    return [test for test in bench_tests() if test.name in config]


def _find_strategy_problems(settings: StudySettings) -> KeyProblems:
    """Yield a problem for each value with which the strategy cannot run."""
    from repose.calibrate.strategies import cost

    name = settings.strategy
    yield from cost.find_contradictions(
        name,
        settings.get_strategy_section(name),
        free=settings.free,
        responses=len(settings.targets),
    )


def _find_constraint_problems(settings: StudySettings) -> KeyProblems:
    """Yield a problem for each constraint that the study cannot obey.

    A constraint is an inequality between two parameters. The constraints may allow too
    small a part of the parameter ranges, or the strategy may not support constraints.
    """
    if settings.constraints is None:
        return
    entries = settings.parameters.entries
    for key, allowed in find_constraint_errors(settings.constraints, entries, ALLOWED):
        # The key is a position in the list, or empty for the list as a whole. An empty
        # key would leave a dot at the end.
        yield f"constraints.{key}".rstrip("."), allowed
    if not strategy(settings.strategy).obeys_constraints:
        # The allowed values are the strategies that support constraints.
        yield "strategy", obeying_strategies()


def _find_surrogate_problems(settings: StudySettings) -> KeyProblems:
    """Yield a problem if the design has too few training samples for the surrogate.

    A surrogate is a fast model that stands for the simulator.
    """
    # Import the surrogates only here, because their libraries take time to load.
    from repose.calibrate import surrogates

    n_training = _count_design_samples(settings, part=TRAINING_PART)
    n_needed = surrogates.find_surrogate_class(settings.surrogate).least_samples(
        settings.free
    )
    if n_training >= n_needed:
        return

    # Name the surrogates that need no more samples than there are. Some surrogates can
    # be fitted to any number of samples, so there is at least one.
    suitable = [
        name
        for name in surrogates.names()
        if surrogates.find_surrogate_class(name).least_samples(settings.free)
        <= n_training
    ]
    yield (
        "surrogate",
        f"{' or '.join(suitable)}, because the number of training samples, design.samples "
        f"times the first number of network.split, is below {n_needed}",
    )


def _find_validation_problems(settings: StudySettings) -> KeyProblems:
    """Yield a problem if there are too few validation samples to estimate the noise."""
    if not settings.network.validation_noise:
        return
    n_targets = len(settings.targets)
    if _count_design_samples(settings, part=VALIDATION_PART) <= n_targets:
        yield (
            "network.split",
            f"a second fraction that leaves more than {n_targets} validation samples, or "
            "network.validation_noise: false",
        )


def _count_design_samples(settings: StudySettings, part: int) -> int:
    """Count the samples of the design in a part of the split.

    Parameters
    ----------
    settings : StudySettings
        The study; its sections `network` and `design` are read.
    part : int
        The part: `TRAINING_PART` or `VALIDATION_PART`.
    """
    n_samples = settings.network.split[part] * settings.design.samples
    return int(n_samples + ROUNDING_MARGIN)


def _find_contact_law_problems(settings: StudySettings) -> KeyProblems:
    """Find laws that lack their parameters, and parameters that lack their law.

    An error message has the form "KEY is VALUE; expected ALLOWED". The first part of
    each pair takes the place of KEY, the second that of ALLOWED.
    """
    contact_law = settings.simulation.contact_law
    rolling_law = settings.simulation.rolling_law
    entries = settings.parameters.entries

    # Some contact laws have additional parameters, which the study must give.
    missing_parameters = [
        f"parameters.{name} ({LABELS[name]})"
        for name in parameters_of_law(contact_law)
        if name not in entries
    ]
    if missing_parameters:
        yield (
            "simulation.contact_law",
            f"{contact_law} with {' and '.join(missing_parameters)}, each a range or a "
            "fixed value",
        )

    # A parameter of another law would have no effect, so it must be absent.
    for name, parameter in LAW_PARAMETERS.items():
        has_law = contact_law in parameter.laws or rolling_law in parameter.laws
        if name not in entries or has_law:
            continue
        laws = " or ".join(parameter.laws)
        # All additional parameters of contact laws are needed. Those of rolling laws
        # are optional (`repose.bench.parameters`).
        is_contact_law_parameter = parameter.needed
        if is_contact_law_parameter:
            law_setting = f"simulation.contact_law {laws}, not {contact_law}"
        else:
            law_setting = f"simulation.rolling_law {laws}, not {rolling_law}"
        yield f"parameters.{name}", f"absent: it belongs to {law_setting}"


def _find_replicate_problems(settings: StudySettings) -> KeyProblems:
    """Yield a problem for each bench test with fewer than two runs of a sample.

    If `network.replicates` is true, the noise is estimated from several runs of the
    same sample, which differ only in their seeds.
    """
    if not settings.network.replicates:
        return
    test_names = dict.fromkeys(target.apparatus for target in settings.targets)
    for name in test_names:
        if settings.count_design_seeds(name) < MIN_RUNS_FOR_NOISE:
            # Some strategies have a key of their own for the number of runs. Otherwise
            # it is a key of the bench test.
            strategy_key = strategy(settings.strategy).seeds_key
            yield (
                strategy_key or f"{name}.seeds",
                f"at least {MIN_RUNS_FOR_NOISE}, or network.replicates: false, since single "
                "runs show no noise",
            )


def _find_target_problems(
    settings: StudySettings, config: Mapping[str, Any]
) -> KeyProblems:
    """Yield a problem for each target that is repeated or lacks its bench test.

    The key `apparatus` of a target names its bench test.

    Parameters
    ----------
    settings : StudySettings
        The study; its section `targets` is read.
    config : mapping
        The whole configuration, which has a section for each bench test in use.

    Yields
    ------
    tuple of str
        The dotted key and its allowed values.
    """
    earlier_responses = set()
    for position, target in enumerate(settings.targets):
        key = f"targets.{position}"
        if target.apparatus not in config:
            yield (
                f"{key}.apparatus",
                "a bench test whose settings are in the configuration, in a section with "
                "the name of the bench test",
            )
        if target.response in earlier_responses:
            yield f"{key}.response", "each response once"
        earlier_responses.add(target.response)
