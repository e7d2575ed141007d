"""The cost of a run of a configuration: numbers of pours and their time."""

import math
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from repose.apparatus import bench, names
from repose.apparatus.settings import SimulationSettings
from repose.core.parameter_space import ParameterSpace
from repose.core.published import published_count
from repose.core.targets import Targets

if TYPE_CHECKING:
    from repose.particle.particle import Particle

# Measured on one core of a common server: for the estimate that is shown before a run.
SECONDS_A_BERRY_STEP = 8e-8
SECONDS_A_VIEW = 0.01
JOB_START_S = 2.5  # of a pour's job and of its measurement's
REST_S = 120.0  # of a study besides its runs: posterior, figures, film and report, and snakemake itself
# The pour that is timed: simulated time [s], and steps of a berry that take about a second.
TIMED_S, TIMED_STEPS = 1.5, 2.0e7
FEWEST_TIMED = 20
SEEDS = ("seeds", "checks")  # the ends of keys that tell how often a parameter set runs
# Purpose, number of parameter sets, seeds of each.
Pours = Sequence[tuple[str, int, int]]


def run_s(config: Mapping[str, Any], name: str, berry_step_s: float = SECONDS_A_BERRY_STEP) -> float:
    """Wall time of a run of a bench test on one core, without its measurement.

    Parameters
    ----------
    config : mapping
    name : str
        Of the bench test.
    berry_step_s : float, optional
        Wall time of a step of one berry; `measured_berry_step_s` measures it.

    Returns
    -------
    float
        Seconds.
    """
    section, duration = config[name], bench(name).duration_s(config)
    berries = section.get("berries", 1)
    filled = duration - 0.5 * min(duration, berries / section.get("rate_per_s", math.inf))
    return berry_step_s * berries * filled / SimulationSettings.of(config).time_step_s


def longest_job_s(config: Mapping[str, Any]) -> float:
    """Wall time of the longest job that runs a bench test: one parameter set with the most seeds of any section.

    Parameters
    ----------
    config : mapping

    Returns
    -------
    float
        Seconds, for the funnel, the drum and the bench tests of the targets.
    """
    sections = [section for section in config.values() if isinstance(section, Mapping)]
    seeds = max(section[key] for section in sections for key in section if key.endswith(SEEDS))
    names = {"funnel", "drum", *Targets.of(config["targets"]).apparatus}
    return JOB_START_S + seeds * max(run_s(config, name) for name in names if name in config)


def measured_berry_step_s(config: Mapping[str, Any], berry: Mapping[str, Any], particle: "Particle") -> float:
    """Time of a step of one grain in a pile on a core of this machine, measured with a small pour of about a second.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    berry : mapping
        What the verb ``berry`` writes.
    particle : Particle

    Returns
    -------
    float
        Seconds of a core of its own: what other programs take meanwhile is left out. The first call on a machine
        compiles the engine.
    """
    from repose.apparatus import funnel

    steps = TIMED_S / SimulationSettings.of(config).time_step_s
    grains = max(FEWEST_TIMED, min(config["funnel"]["berries"], round(TIMED_STEPS / steps)))
    pour = {
        "berries": grains,
        "rate_per_s": 4 * grains / TIMED_S,
        "duration_s": TIMED_S + 1.0,
        "rest_window_s": 0.5,
    }
    small = {**config, "funnel": {**config["funnel"], **pour}}
    values = ParameterSpace.of(config["parameters"]).centre
    began, began_cpu = time.perf_counter(), time.process_time()
    poured = funnel.pour(small, values, 1, particle, berry)
    share = (time.process_time() - began_cpu) / (time.perf_counter() - began)
    return 1e-6 * min(1.0, share) * poured.us_per_step / grains


def work(
    config: Mapping[str, Any],
    berry_step_s: float = SECONDS_A_BERRY_STEP,
    pours: Pours | None = None,
) -> dict[str, Any]:
    """What a study takes.

    Parameters
    ----------
    config : mapping
    berry_step_s : float, optional
        As for `run_s`.
    pours : sequence of (purpose, parameter sets, seeds), optional
        Of another strategy than the published one; each set runs as often in every bench test of the targets.

    Returns
    -------
    dict
        ``pours``: of the funnel, as (purpose, parameter sets, seeds). ``pour_s``: wall time of one [s].
        ``total_s``: of the whole study on one core [s], the other bench tests of its targets included.
    """
    targets = Targets.of(config["targets"])
    pour_s = run_s(config, "funnel", berry_step_s) + SECONDS_A_VIEW * config["measure"]["views"]

    def runs_s(name: str) -> float:
        return pour_s if name == "funnel" else run_s(config, name, berry_step_s)

    if pours is not None:
        total_s = sum(
            sets * (JOB_START_S + seeds * runs_s(name))
            for name in targets.apparatus
            for _, sets, seeds in pours
        )
        return {"pours": pours, "pour_s": pour_s, "total_s": total_s}
    funnel, validation = config["funnel"], config["validation"]
    theirs = published_count(validation["published"], targets.responses)
    pours = (
        ("design", config["design"]["samples"], funnel["seeds"]),
        ("representative", 1, validation["representative_seeds"]),
        ("validation", validation["solutions"], validation["seeds"]),
        ("published", theirs, validation["seeds"]),
    )
    total_s = REST_S + sum(sets * (JOB_START_S + seeds * pour_s) for _, sets, seeds in pours)
    if "drum" in config:
        total_s += config["drum"]["seeds"] * (JOB_START_S + runs_s("drum"))
    sets = sum(sets for _, sets, _ in pours)
    for name in targets.apparatus:
        if name != "funnel":
            total_s += sets * (JOB_START_S + config[name]["seeds"] * runs_s(name))
    return {"pours": pours, "pour_s": pour_s, "total_s": total_s}


def job_s(config: Mapping[str, Any], name: str, runs: int) -> float:
    """Wall time of a job of the workflow on one core, to compare jobs with one another.

    Parameters
    ----------
    config : mapping
    name : str
        Of the bench test that it runs.
    runs : int
        How often; none for a job that only computes.

    Returns
    -------
    float
        Seconds.
    """
    return JOB_START_S + (runs * run_s(config, name) if runs else 0.0)


class Study(NamedTuple):
    """What can be asked of `repose run`.

    Attributes
    ----------
    target : str
    sentence : str
        What it finds.
    cost : str
        In words: pours, and their time on one core.
    """

    target: str
    sentence: str
    cost: str


def studies(config: Mapping[str, Any]) -> list[Study]:
    """The studies of a workflow.

    Parameters
    ----------
    config : mapping

    Returns
    -------
    list of Study
        The calibration first. Times are of pours; they leave out what uses the surrogate alone, seconds to minutes.
    """
    pour_s = work(config)["pour_s"]

    def pours(number: int, besides: str = "the calibration") -> str:
        return f"{number} pours, about {number * pour_s / 60:.0f} min on one core, besides {besides}"

    refine, pool = config["refine"], config["pool"]
    a_round = refine["seeds"] + refine["neighbours"] * refine["neighbour_seeds"]
    of_pool = pool["samples"] * pool["seeds"] + pool["fresh_samples"] * pool["fresh_seeds"]
    of_calibration = sum(sets * seeds for _, sets, seeds in work(config)["pours"])
    no_pours = "no pours besides the calibration"
    all_min = work(config)["total_s"] / 60
    targets = Targets.of(config["targets"])
    rows = [
        Study(
            "calibration",
            "The method from the sizes to the check: which contact parameters give the measured pile.",
            f"{of_calibration} pours and the other bench tests, about {all_min:.0f} min on one core",
        ),
        Study("uncertainty", "How sure the answer is: noise, posterior and sensitivity.", no_pours),
        Study(
            "refined",
            "More pours near the answer, until it meets the targets.",
            f"at most {pours(refine['rounds'] * a_round)}",
        ),
        Study(
            "second_responses",
            "Which further response of the pile tells most about the parameters.",
            no_pours,
        ),
        *_with_sections_of_their_own(config, pours),
        Study("pool", "More samples, for the comparisons.", pours(of_pool)),
        Study("compare_all", "Which part of the method pays: designs, surrogates, searches.", pours(of_pool)),
    ]
    if published_count(config["validation"]["published"], targets.responses):
        sentence = "How much the definition of the angle of repose moves it, on the piles of the calibration."
        rows.append(Study("measurement_study", sentence, no_pours))
    return rows


def _with_sections_of_their_own(config, pours):
    """Studies whose section of the configuration may be absent."""
    if "joint_targets" in config:
        joint = config["joint_targets"]["samples"] * config["joint_targets"]["seeds"]
        minutes = (
            joint * sum(run_s(config, name) for name in names() if name in config and name != "funnel") / 60
        )
        cost = f"{joint} runs of each further bench test besides the calibration, about {minutes:.0f} min"
        yield Study("joint_targets", "Which few tests together narrow the parameters enough.", cost)
        sentence = "Which further response, of the pile or another bench test, tells most a minute of work."
        yield Study("second_responses_benches", sentence, f"the runs of joint_targets: {cost}")
    if "shape_study" in config:
        shape = config["shape_study"]
        cells = len(shape["particles"]) * len(shape["main_fillings"]) * len(shape["tensions"])
        sentence = "Which particle, tension and filling come nearest to the measured pile."
        yield Study("shape_study", sentence, f"at least {pours(cells * shape['seeds'])}")
