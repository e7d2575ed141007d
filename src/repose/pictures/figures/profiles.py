"""Profiles among the targets: heights as measured, as predicted and as simulated, each with its band."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.core.files import read_table
from repose.core.profiles import Profile

from . import style
from .registry import Inputs, Shown, figure

TABLE_4 = {"table4": "{answer.table4}"}


class Line(NamedTuple):
    """Heights (n,) at the abscissae of a profile, with half the width (n,) of a band about them."""

    label: str
    heights: np.ndarray
    half: np.ndarray | float


@figure("profiles", "Profiles", TABLE_4, reads=("targets",), when=lambda study: bool(study.targets.profiles))
def profiles(inputs: Inputs, study: Shown) -> Figure:
    """Draw the answer's profile with each measured one.

    Profiles among the targets: the measured heights with their standard deviation, the profile that is predicted
    for the answer, and the profile that is simulated with fresh seeds, with its standard error. Lines are the
    smooth profiles of the scores.
    """
    targets = study.targets
    names = {name: [one for one in targets if one.profile == profile] for name, profile in targets.profiles.items()}
    columns = [column for own in names.values() for one in own for column in columns_of(one.response)]
    table = read_table(inputs["table4"], ("role", *columns))
    answer = table[table["role"] == "representative"].iloc[0]
    figure = style.new_figure(style.PAGE, 2.6 * style.grid_rows(len(names)))
    panels = style.grid(figure, len(names))
    for panel, (name, profile) in zip(panels, targets.profiles.items(), strict=True):
        predicted, simulated, error = (
            answer[[columns_of(one.response)[k] for one in names[name]]].to_numpy(float) for k in range(3)
        )
        lines = (
            Line("predicted", profile.heights(predicted), 0.0),
            Line("simulated ± SE", profile.heights(simulated), band(profile, np.nan_to_num(error))),
        )
        draw(panel, profile, names[name][0].sd * np.sqrt(profile.functions), lines)
    style.name_panels(panels)
    return figure


def columns_of(response: Any) -> tuple[str, str, str]:
    """Give the columns of a score's prediction, simulation and standard error."""
    return response.predicted, response.simulated, response.error


def band(profile: Profile, sd: np.ndarray) -> np.ndarray:
    """Give the standard deviations (n,) of the heights of scores with independent errors (functions,)."""
    return np.sqrt(profile.basis**2 @ np.square(sd))


def draw(panel: Axes, profile: Profile, sd: float, lines: tuple[Line, ...]) -> None:
    """Draw the measured heights with their standard deviation, and lines with their bands."""
    measured = {"fmt": "o", "ms": 3, "color": style.BLACK, "elinewidth": 0.8, "zorder": 3}
    panel.errorbar(profile.x, profile.z, yerr=sd, label="measured ± SD", **measured)
    for k, line in enumerate(lines):
        look = style.series(k)
        panel.plot(profile.x, line.heights, label=line.label, **look)
        ends = line.heights - line.half, line.heights + line.half
        panel.fill_between(profile.x, *ends, color=look["color"], alpha=0.2, lw=0)
    unit = profile.name.rpartition("_")[2]
    panel.set(xlabel=f"x ({unit})", ylabel=f"height ({unit})")
    panel.legend(loc="best")
