"""The cost of a run of a configuration: numbers of pours and their time."""

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

from repose.bench import bench
from repose.bench.parameters import named
from repose.bench.settings import SceneSettings
from repose.bench.space import contact_space
from repose.calibrate.responses import response
from repose.calibrate.strategies import cost as strategies
from repose.common.keys import Config
from repose.config.contradictions import used_tests
from repose.config.models import StudySettings, valid_sections
from repose.grain.particle import Particle
from repose.stages.published import to_simulate

# Measured on one core of a common server: for the estimate that is shown before a run.
SECONDS_A_BERRY_STEP = 8e-8
SECONDS_A_VIEW = 0.01
JOB_START_S = 2.5  # of a pour's job and of its measurement's
REST_S = 120.0  # rest of a study without its runs: posterior, figures, film and report, and snakemake itself
# The pour that is timed: simulated time [s], and steps of a grain that take half a second.
TIMED_S, TIMED_STEPS = 1.5, 1.0e7
REPEATS = 3  # the shortest time counts: other programs only slow a pour down
FEWEST_TIMED = 20
BYTES_A_GRAIN = 62  # of a pour on the disk, measured
SEEDS = ("seeds", "checks")  # endings of keys for the number of runs of a parameter set
# Purpose, number of parameter sets, seeds of each.
Pours = Sequence[tuple[str, int, int]]


def run_s(
    config: Config, name: str, berry_step_s: float = SECONDS_A_BERRY_STEP
) -> float:
    """Estimate the wall time of a run of a bench test on one core.

    Its measurement is not included. `berry_step_s` is the time of a step of one grain,
    from `measured_berry_step_s`.
    """
    settings = valid_sections(config)
    duration = bench(name).duration_s(SceneSettings(config))
    grains = grains_of(settings, name)
    filling = min(duration, grains / _rate_per_s(settings, name))
    filled = duration - 0.5 * filling
    return berry_step_s * grains * filled / settings.simulation.time_step_s


def grains_of(settings: StudySettings, name: str) -> int:
    """Return the number of grains of a bench test; 1 for one of a single grain.

    A bench test that is filled to a height counts as many as the funnel, as the size of
    the grain is not known here.
    """
    grains: int | None = getattr(settings.bench(name), "berries", 1)
    return settings.funnel.berries if grains is None else grains


def _rate_per_s(settings: StudySettings, name: str) -> float:
    """Return the rate at which grains are poured; infinite where they are not poured."""
    rate: float = getattr(settings.bench(name), "rate_per_s", math.inf)
    return rate


def disk_mb(settings: StudySettings, pours: int) -> float:
    """Estimate the disk space of a number of runs in each bench test of the targets."""
    names = dict.fromkeys(target.apparatus for target in settings.targets)
    grains = sum(grains_of(settings, name) for name in names)
    return 1e-6 * BYTES_A_GRAIN * grains * pours


def strategy_pours(settings: StudySettings, name: str) -> Pours | None:
    """Count the most runs of a strategy; None for the article's method."""
    return strategies.pours(name, settings.of_strategy(name), settings.free)


def strategy_misfit(settings: StudySettings, name: str) -> str | None:
    """Say why a strategy cannot run with this configuration; None if it can."""
    return strategies.misfit(
        name, settings.of_strategy(name), settings.free, len(settings.targets)
    )


def longest_job_s(config: Config) -> float:
    """Estimate the wall time of the longest job of the funnel, the drum and the bench tests of the targets.

    A job is one parameter set with the most seeds of any section.
    """
    sections = [section for section in config.values() if isinstance(section, Mapping)]
    seeds = max(
        section[key] for section in sections for key in section if key.endswith(SEEDS)
    )
    names = {
        "funnel",
        "drum",
        *(target.apparatus for target in valid_sections(config).targets),
    }
    return JOB_START_S + seeds * max(
        run_s(config, name) for name in names if name in config
    )


def measured_berry_step_s(
    config: Config, grain: Mapping[str, Any], particle: Particle
) -> float:
    """Measure the time [s] of a step of one grain in a pile on a core of this machine, by pours of about a second.

    The time of other programs is left out. `grain` is the result of the verb `berry`. The first call on a machine
    compiles the engine.
    """
    from repose.bench import Scene
    from repose.bench.funnel import FunnelTest

    settings = valid_sections(config)
    steps = TIMED_S / settings.simulation.time_step_s
    grains = max(FEWEST_TIMED, min(settings.funnel.berries, round(TIMED_STEPS / steps)))
    pour = {
        "berries": grains,
        "rate_per_s": 4 * grains / TIMED_S,
        "duration_s": TIMED_S + 1.0,
        "rest_window_s": 0.5,
    }
    small = {**config, "funnel": {**settings.funnel.model_dump(), **pour}}
    values = contact_space(settings.parameters.given).centre
    times_s = []
    for _ in range(REPEATS):
        began, began_cpu = time.perf_counter(), time.process_time()
        # to its end, or there is no step to be timed
        poured = FunnelTest().pour(
            Scene.of(small, values, grain, particle, 1), until_rest=False
        )
        share = (time.process_time() - began_cpu) / (time.perf_counter() - began)
        times_s.append(1e-6 * min(1.0, share) * poured.us_per_step / grains)
    return min(times_s)


def work(
    config: Config,
    berry_step_s: float = SECONDS_A_BERRY_STEP,
    pours: Pours | None = None,
) -> dict[str, Any]:
    """Estimate the cost of a study: `pours` of the funnel, `pour_s` of one of them, `total_s` of the whole on one core.

    `pours` belong to another strategy than the published one; each set runs as often in every bench test of the
    targets, which `total_s` includes. `berry_step_s` as in `run_s`.
    """
    settings = valid_sections(config)
    names = dict.fromkeys(target.apparatus for target in settings.targets)
    pour_s = (
        run_s(config, "funnel", berry_step_s) + SECONDS_A_VIEW * settings.measure.views
    )

    def runs_s(name: str) -> float:
        return pour_s if name == "funnel" else run_s(config, name, berry_step_s)

    if pours is not None:
        total_s = sum(
            sets * (JOB_START_S + seeds * runs_s(name))
            for name in names
            for _, sets, seeds in pours
        )
        return {"pours": pours, "pour_s": pour_s, "total_s": total_s}
    validation = settings.validation
    pours = (
        ("design", settings.design.samples, settings.funnel.seeds),
        ("representative", 1, validation.representative_seeds),
        ("validation", validation.solutions, validation.seeds),
    )
    total_s = REST_S + sum(
        sets * (JOB_START_S + seeds * pour_s) for _, sets, seeds in pours
    )
    if settings.bench("drum") is not None:
        total_s += settings.seeds_of("drum") * (JOB_START_S + runs_s("drum"))
    sets = sum(sets for _, sets, _ in pours)
    for name in names:
        if name != "funnel":
            total_s += sets * (JOB_START_S + settings.seeds_of(name) * runs_s(name))
    return {"pours": pours, "pour_s": pour_s, "total_s": total_s}


def job_s(config: Config, name: str, runs: int) -> float:
    """Estimate the wall time of a job of the workflow on one core, to compare jobs; without `runs` it only computes."""
    return JOB_START_S + (runs * run_s(config, name) if runs else 0.0)


SENTENCES = {
    "calibration": "The method from the sizes to the check: which contact parameters give the measured pile.",
    "response_surface": "Another way to calibrate: screening, steepest ascent, a quadratic surface.",
    "sequential": "Another way to calibrate: few pours, each where it is most informative.",
    "uncertainty": "How sure the answer is: noise, posterior and sensitivity.",
    "next": "What to measure next: the information of each further response and bench test.",
    "refined": "More pours near the answer, until it meets the targets.",
    "published_sets": "The published parameter sets in this simulator: a table that changes with engine and scene.",
}


def costs(config: Config) -> dict[str, str]:
    """Say what each study besides the calibration and the strategies costs: pours, and their time on one core.

    Work with the surrogate alone, seconds to minutes, is left out.
    """
    of_all = work(config)
    pour_s = of_all["pour_s"]

    def pours(number: int) -> str:
        return f"{number} pours, about {number * pour_s / 60:.0f} min on one core, besides the calibration"

    settings = valid_sections(config)
    refine, validation = settings.refine, settings.validation
    responses = [response(target.response) for target in settings.targets]
    published = to_simulate(
        validation.published, responses, named(settings.parameters.given)
    )
    a_round = refine.seeds + refine.neighbours * refine.neighbour_seeds
    of_calibration = sum(sets * seeds for _, sets, seeds in of_all["pours"])
    others = (
        " and the other bench tests"
        if {test.name for test in used_tests(config)} != {"funnel"}
        else ""
    )
    return dict.fromkeys(SENTENCES, "no pours besides the calibration") | {
        "calibration": f"{of_calibration} pours{others}, about {of_all['total_s'] / 60:.0f} min on one core",
        "refined": f"at most {pours(refine.rounds * a_round)}",
        "published_sets": pours(len(published) * validation.seeds),
    }
