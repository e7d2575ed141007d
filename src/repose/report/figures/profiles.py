"""Profiles among the targets: heights as measured, as predicted and as simulated, each with its band."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.profiles import Profile
from repose.common.files import read_table

from . import style
from .registry import Inputs, Shown, figure

TABLE_4 = {"table4": "{answer.table4}"}
NUMBERS = ("predicted", "simulated", "error")


@figure(
    "profiles",
    "Profiles",
    TABLE_4,
    reads=("targets",),
    when=lambda study: bool(study.targets.profiles),
)
def profiles(inputs: Inputs, study: Shown) -> Figure:
    """Draw the answer's profile with each measured one.

    Profiles among the targets: the measured heights with their standard deviation, the profile that is predicted
    for the answer, and the profile that is simulated with fresh seeds, with its standard error. Lines are the
    smooth profiles of the scores.
    """
    targets = study.targets
    columns = [
        getattr(one.response, number)
        for one in targets
        if one.profile
        for number in NUMBERS
    ]
    table = read_table(inputs["table4"], ("role", *columns))
    answer = table[table["role"] == "representative"].iloc[0]
    figure, panels = style.grid(len(targets.profiles), 2.6)
    for panel, profile in zip(panels, targets.profiles.values(), strict=True):
        own = [one for one in targets if one.profile == profile]
        predicted, simulated, error = (
            answer[[getattr(one.response, number) for one in own]].to_numpy(float)
            for number in NUMBERS
        )
        half = np.sqrt(
            profile.basis**2 @ np.square(np.nan_to_num(error))
        )  # the errors of scores are independent
        lines = {
            "predicted": (profile.heights(predicted), 0.0),
            "simulated ± SE": (profile.heights(simulated), half),
        }
        draw(panel, profile, own[0].sd * np.sqrt(profile.functions), lines)
    style.name_panels(panels)
    return figure


def draw(
    panel: Axes,
    profile: Profile,
    sd: float,
    lines: Mapping[str, tuple[np.ndarray, Any]],
) -> None:
    """Draw the measured heights with their standard deviation, and lines of heights with half the width of a band."""
    measured = {
        "fmt": "o",
        "ms": 3,
        "color": style.BLACK,
        "elinewidth": 0.8,
        "zorder": 3,
    }
    panel.errorbar(profile.x, profile.z, yerr=sd, label="measured ± SD", **measured)
    for k, (label, (heights, half)) in enumerate(lines.items()):
        look = style.series(k)
        panel.plot(profile.x, heights, label=label, **look)
        panel.fill_between(
            profile.x,
            heights - half,
            heights + half,
            color=look["color"],
            alpha=0.2,
            lw=0,
        )
    unit = profile.name.rpartition("_")[2]
    panel.set(xlabel=f"x ({unit})", ylabel=f"height ({unit})")
    panel.legend(loc="best")
