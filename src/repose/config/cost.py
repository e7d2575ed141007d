"""The cost of a run of a configuration: numbers of pours and their time."""

from collections.abc import Mapping
from typing import Any

from repose.apparatus import bench
from repose.apparatus.settings import SimulationSettings
from repose.core.published import published_count
from repose.core.targets import Targets

# Measured on one core of a common server: for the estimate that is shown before a run.
SECONDS_A_BERRY_STEP = 4.5e-8
SECONDS_A_VIEW = 0.01
JOB_START_S = 2.5  # of a pour's job and of its measurement's


def run_s(config: Mapping[str, Any], name: str) -> float:
    """Wall time of a run of a bench test on one core, without its measurement.

    Parameters
    ----------
    config : mapping
    name : str
        Of the bench test.

    Returns
    -------
    float
        Seconds.
    """
    steps = bench(name).duration_s(config) / SimulationSettings.of(config).time_step_s
    return SECONDS_A_BERRY_STEP * config[name].get("berries", 1) * steps


def work(config: Mapping[str, Any]) -> dict[str, Any]:
    """What a study takes.

    Parameters
    ----------
    config : mapping

    Returns
    -------
    dict
        ``pours``: of the funnel, as (purpose, parameter sets, seeds). ``pour_s``: wall time of one [s].
        ``total_s``: of the whole study on one core [s], the other bench tests of its targets included.
    """
    funnel, validation = config["funnel"], config["validation"]
    targets = Targets.of(config["targets"])
    theirs = published_count(validation["published"], targets.responses)
    pours = (
        ("design", config["design"]["samples"], funnel["seeds"]),
        ("representative", 1, validation["representative_seeds"]),
        ("validation", validation["solutions"], validation["seeds"]),
        ("published", theirs, validation["seeds"]),
    )
    pour_s = run_s(config, "funnel") + SECONDS_A_VIEW * config["measure"]["views"]
    total_s = sum(sets * (JOB_START_S + seeds * pour_s) for _, sets, seeds in pours)
    total_s += config["drum"]["seeds"] * (JOB_START_S + run_s(config, "drum"))
    sets = sum(sets for _, sets, _ in pours)
    for name in targets.apparatus:
        if name != "funnel":
            total_s += sets * (JOB_START_S + config[name]["seeds"] * run_s(config, name))
    return {"pours": pours, "pour_s": pour_s, "total_s": total_s}
