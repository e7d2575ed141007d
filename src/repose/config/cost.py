"""What a run of a configuration takes."""

from repose.core.published import published_count
from repose.core.targets import Targets

# Measured on one core of a common server: for the estimate that is shown before a run.
SECONDS_A_BERRY_STEP = 4.5e-8
SECONDS_A_VIEW = 0.01
JOB_START_S = 2.5  # of a pour's job and of its measurement's


def work(config):
    """What a run takes: pours as (purpose, parameter sets, seeds), pour_s and total_s on one core."""
    funnel, validation = config["funnel"], config["validation"]
    step_s = config["simulation"]["time_step_s"]
    theirs = published_count(validation["published"], Targets.of(config["targets"]).responses)
    pours = (
        ("design", config["design"]["samples"], funnel["seeds"]),
        ("representative", 1, validation["representative_seeds"]),
        ("validation", validation["solutions"], validation["seeds"]),
        ("published", theirs, validation["seeds"]),
    )
    pour_s = SECONDS_A_BERRY_STEP * funnel["berries"] * funnel["duration_s"] / step_s
    pour_s += SECONDS_A_VIEW * config["measure"]["views"]
    total_s = sum(sets * (JOB_START_S + seeds * pour_s) for _, sets, seeds in pours)
    drum = config["drum"]
    drum_s = drum["rotate_from_s"] + drum["longest_rotation_s"] + drum["settle_s"]
    drum_s *= SECONDS_A_BERRY_STEP * drum["berries"] / step_s
    total_s += drum["seeds"] * (JOB_START_S + drum_s)
    return {"pours": pours, "pour_s": pour_s, "total_s": total_s}
