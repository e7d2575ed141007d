"""Estimate the cost of a study: the number of its runs, their time and disk space."""

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from repose.bench import bench
from repose.bench.parameters import parameters_among
from repose.bench.settings import SceneSettings
from repose.bench.space import contact_space
from repose.calibrate.responses import response
from repose.calibrate.strategies import cost as strategies
from repose.calibrate.strategies.base import CheckRuns
from repose.common.keys import Config
from repose.config.contradictions import find_tests_in_use
from repose.config.models import StudySettings, select_valid_sections
from repose.grain.particle import Particle
from repose.stages.published import list_sets_to_simulate

if TYPE_CHECKING:
    from repose.bench import Scene

# Times on one core of a common server, for one step of one grain and for the
# measurement of one view of a pile.
SECONDS_PER_GRAIN_STEP = 8e-8
SECONDS_PER_VIEW = 0.01
# Time to start the two processes of a job, which simulate and measure.
JOB_START_S = 2.5
# Time for everything in a study besides its runs: posterior, figures, film, report and
# Snakemake.
OTHER_WORK_S = 120.0

# Simulated time of the timed pour. The number of its grains is chosen so that the
# product of grains and steps has the second value, which takes about half a second on
# one core.
TIMED_POUR_S = 1.5
TIMED_GRAIN_STEPS = 1.0e7
MIN_TIMED_GRAINS = 20
# All grains are poured within this fraction of the time, so that all are present in
# most steps.
TIMED_POURING_FRACTION = 0.25
# The pour lasts longer by the second over which the funnel measures the time of a step.
MEASURED_END_S = 1.0
# The last grain must appear this long before the end.
TIMED_REST_WINDOW_S = 0.5
# The pour is repeated and the shortest time is used, because other programs only make a
# pour slower.
N_TIMED_POURS = 3

# Disk space of a saved run for each grain, as measured.
BYTES_PER_GRAIN = 62
# Keys that set the number of runs of a parameter set end with one of these strings.
SEED_KEY_ENDINGS = ("seeds", "checks")
# The runs of a study in each bench test. Each entry has a purpose, the number of
# parameter sets, and the number of seeds of each set. A run has one seed. Entries for
# the check of an answer are `CheckRuns`, a named tuple of the same three items.
PlannedRuns = Sequence[tuple[str, int, int]]


class StudyCost(NamedTuple):
    """The runs of a study and their time on one core.

    Attributes
    ----------
    runs : sequence of (str, int, int)
        The runs that each bench test of the targets makes.
    funnel_run_s : float
        Time of one run of the funnel, with its measurement [s].
    total_s : float
        Time of the whole study [s].
    """

    runs: PlannedRuns
    funnel_run_s: float
    total_s: float


def estimate_run_s(
    config: Config, name: str, grain_step_s: float = SECONDS_PER_GRAIN_STEP
) -> float:
    """Estimate the wall time of a run of a bench test on one core.

    The measurement of the run is not included.

    Parameters
    ----------
    config : mapping
        The configuration.
    name : str
        Name of the bench test.
    grain_step_s : float
        Time for one step of one grain [s], as from `measure_grain_step_s`.

    Returns
    -------
    float
        Time [s].
    """
    settings = select_valid_sections(config)
    duration_s = bench(name).duration_s(SceneSettings(config))
    n_grains = count_grains(settings, name)

    # While grains are poured, only half of them are present on average. Therefore count
    # half of this time.
    pouring_s = min(duration_s, n_grains / _find_pouring_rate_per_s(settings, name))
    filled_s = duration_s - 0.5 * pouring_s
    return grain_step_s * n_grains * filled_s / settings.simulation.time_step_s


def count_grains(settings: StudySettings, name: str) -> int:
    """Return the number of grains in a bench test.

    It is 1 for a bench test of a single grain. For a bench test that is filled to a
    height it is the number of grains in the funnel, because the size of a grain is not
    known here.
    """
    grains: int | None = getattr(settings.get_bench_section(name), "berries", 1)
    if grains is None:
        return settings.funnel.berries
    return grains


def _find_pouring_rate_per_s(settings: StudySettings, name: str) -> float:
    """Find the number of grains poured per second; infinite if all appear at once."""
    rate: float = getattr(settings.get_bench_section(name), "rate_per_s", math.inf)
    return rate


def estimate_disk_mb(settings: StudySettings, n_runs: int) -> float:
    """Estimate the disk space of `n_runs` runs in each bench test of the targets [MB]."""
    grains = sum(
        count_grains(settings, name) for name in _list_tests_of_targets(settings)
    )
    return 1e-6 * BYTES_PER_GRAIN * grains * n_runs


def _list_tests_of_targets(settings: StudySettings) -> list[str]:
    """List the names of the bench tests of the targets, in the order of the targets."""
    return list(dict.fromkeys(target.apparatus for target in settings.targets))


def list_strategy_runs(settings: StudySettings, name: str) -> PlannedRuns | None:
    """List the runs that a strategy makes at most; None if it does not state them.

    The article's method, the strategy `published`, is such a strategy;
    `list_article_runs` lists its runs.
    """
    return strategies.count_max_runs(
        name, settings.get_strategy_section(name), settings.free
    )


def explain_why_unusable(settings: StudySettings, name: str) -> str | None:
    """Explain why a strategy cannot run with this configuration; None if it can."""
    section = settings.get_strategy_section(name)
    return strategies.describe_obstacle(
        name, section, free=settings.free, responses=len(settings.targets)
    )


def estimate_longest_job_s(config: Config) -> float:
    """Estimate the wall time of the longest job of a study [s].

    A job runs one parameter set with the largest number of seeds in any section. The
    funnel, the drum and the bench tests of the targets are compared.
    """
    names = {"funnel", "drum", *_list_tests_of_targets(select_valid_sections(config))}
    longest_run_s = max(
        estimate_run_s(config, name) for name in names if name in config
    )
    return JOB_START_S + _find_largest_number_of_seeds(config) * longest_run_s


def _find_largest_number_of_seeds(config: Config) -> int:
    """Find the largest number of runs per parameter set that any section requests.

    A key with such a number is recognised by its ending, one of `SEED_KEY_ENDINGS`.
    """
    sections = [value for value in config.values() if isinstance(value, Mapping)]
    return max(
        value
        for section in sections
        for key, value in section.items()
        if key.endswith(SEED_KEY_ENDINGS)
    )


def measure_grain_step_s(
    config: Config, grain: Mapping[str, Any], particle: Particle
) -> float:
    """Measure how long one time step of one grain takes on a core of this machine.

    A small pile is poured a few times, which takes about half a second each. The first
    call on a machine also compiles the engine.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain : mapping
        The mean grain, as in berry.json.
    particle : Particle
        The body of the mean grain.

    Returns
    -------
    float
        Time [s].
    """
    from repose.bench import Scene

    # Choose the number of grains so that a pour takes about the same time for every
    # study. Its work is the number of grains times the number of steps.
    settings = select_valid_sections(config)
    n_steps = TIMED_POUR_S / settings.simulation.time_step_s
    n_grains = max(
        MIN_TIMED_GRAINS,
        min(settings.funnel.berries, round(TIMED_GRAIN_STEPS / n_steps)),
    )

    small_funnel = settings.funnel.model_dump() | {
        "berries": n_grains,
        "rate_per_s": n_grains / (TIMED_POURING_FRACTION * TIMED_POUR_S),
        "duration_s": TIMED_POUR_S + MEASURED_END_S,
        "rest_window_s": TIMED_REST_WINDOW_S,
    }
    small_config = {**config, "funnel": small_funnel}
    # Use the middle of the range of each parameter.
    parameters = contact_space(settings.parameters.entries).centre

    # Each measurement already excludes the time in which this process had to wait for
    # the processor. Other programs also slow the memory, so take the fastest pour.
    grain_step_times_s = []
    for _ in range(N_TIMED_POURS):
        scene = Scene.of(
            small_config, parameters, grain=grain, particle=particle, seed=1
        )
        grain_step_times_s.append(_measure_cpu_time_per_grain_step_s(scene, n_grains))
    return min(grain_step_times_s)


def _measure_cpu_time_per_grain_step_s(scene: "Scene", n_grains: int) -> float:
    """Pour grains once, and measure the processor time of one step of one grain [s].

    Parameters
    ----------
    scene : Scene
        The scene of the pour.
    n_grains : int
        The number of grains in it.

    Returns
    -------
    float
        Time [s].
    """
    # Import the engine only here, because most estimates do not need it.
    from repose.bench.funnel import FunnelTest

    start_s = time.perf_counter()
    cpu_start_s = time.process_time()
    # Do not stop at rest, because an early stop would leave too few steps.
    run = FunnelTest().pour(scene, until_rest=False)
    cpu_s = time.process_time() - cpu_start_s

    # The run gives its wall time per step in microseconds. Count only the fraction of
    # this time in which the process was running on a processor. With several threads
    # the processor time may exceed the wall time, so limit the fraction to 1.
    cpu_fraction = cpu_s / (time.perf_counter() - start_s)
    return 1e-6 * min(1.0, cpu_fraction) * run.us_per_step / n_grains


def estimate_work(
    config: Config,
    grain_step_s: float = SECONDS_PER_GRAIN_STEP,
    runs: PlannedRuns | None = None,
) -> StudyCost:
    """Estimate the number of runs of a study, and their time on one core.

    The article's method is the strategy `published`: a design, a surrogate that learns
    from it, and a search. Other strategies only make runs.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain_step_s : float
        Time for one step of one grain [s].
    runs : sequence of (str, int, int), optional
        The runs of a strategy, from `list_strategy_runs`. The default is the runs of
        the article's method.

    Returns
    -------
    StudyCost
        The runs and their time. The configuration must have a section `funnel`.
    """
    settings = select_valid_sections(config)
    target_tests = _list_tests_of_targets(settings)

    # Estimate the time of one run in each bench test. Include the drum, because it
    # checks the answer of every study that has a section `drum`. `dict.fromkeys`
    # removes duplicate names and keeps their order.
    run_times_s = {}
    for test in dict.fromkeys(("funnel", *target_tests, "drum")):
        if settings.get_bench_section(test) is not None:
            run_times_s[test] = estimate_run_s(config, test, grain_step_s)
    # In the funnel the pile is also measured in several views.
    run_times_s["funnel"] += SECONDS_PER_VIEW * settings.measure.views

    # Add up the runs. The article's method has further work besides the runs.
    if runs is None:
        runs = list_article_runs(settings)
        total_s = _compute_article_time_s(settings, runs, run_times_s)
    else:
        target_times_s = [run_times_s[test] for test in target_tests]
        total_s = _compute_time_of_runs_s(runs, target_times_s)
    return StudyCost(runs, funnel_run_s=run_times_s["funnel"], total_s=total_s)


def _compute_time_of_runs_s(runs: PlannedRuns, run_times_s: Iterable[float]) -> float:
    """Compute the time of runs that are repeated in several bench tests, on one core.

    Parameters
    ----------
    runs : sequence of (str, int, int)
        The runs in each bench test: purpose, number of parameter sets, and seeds of
        each set. All seeds of a parameter set are one job.
    run_times_s : iterable of float
        Time of one run in each of the bench tests [s].

    Returns
    -------
    float
        Time [s].
    """
    total_s = 0.0
    for run_s in run_times_s:
        for _purpose, n_sets, n_seeds in runs:
            total_s += n_sets * (JOB_START_S + n_seeds * run_s)
    return total_s


def list_article_runs(settings: StudySettings, test: str = "funnel") -> PlannedRuns:
    """List the runs of the article's method in a bench test.

    The runs of another program belong to no bench test, whose name is then empty.
    """
    validation = settings.validation
    return (
        ("design", settings.design.samples, settings.count_design_seeds(test)),
        CheckRuns("answer", 1, validation.representative_seeds),
        CheckRuns("other solutions", validation.solutions, validation.seeds),
    )


def count_runs(runs: PlannedRuns) -> int:
    """Count the runs of all purposes in one bench test."""
    return sum(n_sets * n_seeds for _, n_sets, n_seeds in runs)


def _compute_article_time_s(
    settings: StudySettings, funnel_runs: PlannedRuns, run_times_s: Mapping[str, float]
) -> float:
    """Compute how long a study by the article's method takes on one core.

    The article's method is the strategy `published`. It begins with runs in the funnel,
    repeats their parameter sets in the other bench tests of the targets, and checks its
    answer in the drum.

    Parameters
    ----------
    settings : StudySettings
        The study.
    funnel_runs : sequence of (str, int, int)
        The runs in the funnel: purpose, number of parameter sets, seeds of each set.
    run_times_s : mapping of str to float
        Time of one run in each bench test [s].

    Returns
    -------
    float
        Time [s].
    """
    # Other work is everything besides the runs.
    total_s = OTHER_WORK_S
    total_s += _compute_time_of_runs_s(funnel_runs, [run_times_s["funnel"]])

    # The answer is simulated in the drum, even if no target is a response of the drum.
    # Each of these runs is a job.
    if settings.get_bench_section("drum") is not None:
        total_s += settings.count_seeds("drum") * (JOB_START_S + run_times_s["drum"])

    # All parameter sets are simulated in every bench test of the targets. The funnel
    # was counted above. If the drum is a bench test of a target, these runs come in
    # addition to those that check the answer.
    n_sets = sum(n_sets for _purpose, n_sets, _n_seeds in funnel_runs)
    for test in _list_tests_of_targets(settings):
        if test != "funnel":
            n_seeds = settings.count_design_seeds(test)
            total_s += n_sets * (JOB_START_S + n_seeds * run_times_s[test])
    return total_s


STUDY_SUMMARIES = {
    "calibration": (
        "The method of the article: the contact parameters that give the measured pile."
    ),
    "response_surface": (
        "Another way to calibrate: screening, steepest ascent, a quadratic surface."
    ),
    "sequential": (
        "Another way to calibrate: few pours, each where it is most informative."
    ),
    "uncertainty": "How sure the answer is: noise, posterior and sensitivity.",
    "next": (
        "What to measure next: the information of each further response and bench test."
    ),
    "refined": "A second stage: single pours where the fit may meet the targets.",
    "published_sets": (
        "The published parameter sets in this simulator: a table that changes with "
        "engine and scene."
    ),
}


def describe_costs(config: Config) -> dict[str, str]:
    """Describe the runs and the time of each study in `STUDY_SUMMARIES`.

    A study is one of the targets of `repose run`, such as the calibration. Work with
    the surrogate alone takes seconds to minutes and is not counted. The runs of the
    funnel are called pours in the text.

    Parameters
    ----------
    config : mapping
        The configuration.

    Returns
    -------
    dict of str to str
        For each study by its name, a description of how many runs it makes in the
        funnel, and how long they take on one core.
    """
    settings = select_valid_sections(config)
    calibration = estimate_work(config)
    n_calibration_runs = count_runs(calibration.runs)
    minutes = calibration.total_s / 60
    test_names = {test.name for test in find_tests_in_use(config)}
    other_tests = "" if test_names == {"funnel"} else " and the other bench tests"

    # The refined study makes single runs, and then repeats its answer with several
    # seeds.
    n_refined_runs = settings.refine.pours + settings.refine.seeds
    n_published_runs = _count_published_sets(settings) * settings.validation.seeds

    # Three studies make runs. All others reuse the runs of the calibration.
    run_s = calibration.funnel_run_s
    return dict.fromkeys(STUDY_SUMMARIES, "no pours besides the calibration") | {
        "calibration": (
            f"{n_calibration_runs} pours{other_tests}, about {minutes:.0f} min on one core"
        ),
        "refined": _describe_further_runs(n_refined_runs, run_s),
        "published_sets": _describe_further_runs(n_published_runs, run_s),
    }


def _describe_further_runs(n_runs: int, run_s: float) -> str:
    """Describe runs in the funnel that are made besides those of the calibration."""
    minutes = n_runs * run_s / 60
    return (
        f"{n_runs} pours, about {minutes:.0f} min on one core, besides the calibration"
    )


def _count_published_sets(settings: StudySettings) -> int:
    """Count the published parameter sets that this study can simulate."""
    targets = [response(target.response) for target in settings.targets]
    names = parameters_among(settings.parameters.entries)
    return len(list_sets_to_simulate(settings.validation.published, targets, names))
