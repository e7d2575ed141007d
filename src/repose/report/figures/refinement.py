"""The closed loop: the simulated proposal approaches the targets, round by round."""

import math
import textwrap
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.responses import derived
from repose.common.files import read_json, read_table

from . import style
from .registry import Inputs, Shown, figure

COLUMNS = ("predicted", "simulated", "se", "target")
HEIGHTS = [2.6, 1]  # of deviations and standard errors


BATCHES, WHY = {"batches": "refined/batches.csv"}, {"summary": "refined/summary.json"}
READS = ("targets", "refine.tolerance_percent", "refine.standard_error_percent")


@figure(
    "approach", "The loop closed", BATCHES, optional=WHY, reads=READS, folder="refined"
)
def approach(inputs: Inputs, study: Shown) -> Figure:
    """Draw each round's proposal, predicted and simulated, off the target in percent of it; its standard errors.

    The loop closed: how far each round's proposal is off its targets, in percent of them. Diamonds are predictions
    of the refitted surrogate, points are simulated means with one standard error, from fresh seeds; the number of
    seeds stands next to the mean. A mean inside the band is near enough. Below are the standard errors and their
    limit. The last round's point is the claim: it was simulated after everything that proposed it.
    """
    responses = study.targets.responses
    columns = [
        derived(response.name, what) for response in responses for what in COLUMNS
    ]
    rounds = read_table(inputs["batches"], ("round", "n_seeds", "outcome", *columns))
    section, rows = study.refine, math.ceil(len(responses) / 2)
    figure = style.new_figure(style.PAGE, 3.9 * rows)
    panels = figure.subplots(
        2 * rows,
        min(2, len(responses)),
        sharex=True,
        height_ratios=HEIGHTS * rows,
        squeeze=False,
    )
    for k, response in enumerate(responses):
        upper, lower = panels[k // 2 * 2 : k // 2 * 2 + 2, k % 2]
        values = {
            what: rounds[derived(response.name, what)].to_numpy(float)
            for what in COLUMNS
        }
        colour = style.series(k)["color"]
        _deviations(upper, rounds, values, section.tolerance_percent, colour)
        upper.set_title(
            f"{response.symbol}, target {values['target'][0]:g} {response.unit}"
        )
        lower.plot(
            rounds["round"],
            100 * values["se"] / values["target"],
            "o-",
            color=colour,
            ms=4,
        )
        limit = section.standard_error_percent
        lower.axhline(
            limit, color=style.GREY, ls="--", lw=0.9, label=f"limit, {limit:g} %"
        )
        lower.set(xlabel="round", ylim=(0, None))
        lower.set_xticks(rounds["round"])
        if k % 2 == 0:
            upper.set_ylabel("off the target (% of it)")
            lower.set_ylabel("standard error\n(% of the target)")
    for panel in panels[-2:, 1:].ravel() if len(responses) % 2 else ():
        panel.axis("off")
    figure.legend(
        *panels[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3
    )
    panels[1, 0].legend(loc="lower right")
    if "summary" in inputs:
        why = read_json(inputs["summary"], ("why",))["why"]
        figure.suptitle(textwrap.fill(why, 60), fontsize=7.5, x=0.02, ha="left")
    return figure


def _deviations(
    panel: Axes,
    rounds: pd.DataFrame,
    values: Mapping[str, np.ndarray],
    tolerance: float,
    colour: str,
) -> None:
    """Draw one response: its tolerance as a band, hollow diamonds as predicted, means as simulated with errors."""
    place = rounds["round"].to_numpy(float)
    simulated, predicted = (
        100 * (values[what] / values["target"] - 1)
        for what in ("simulated", "predicted")
    )
    style.near_enough(panel, tolerance)
    panel.plot(
        place - 0.06,
        predicted,
        "D",
        ms=4.5,
        mfc="white",
        mec=style.BLACK,
        ls="",
        label="predicted",
        zorder=3,
    )
    look = {
        "marker": "o",
        "ms": 4.5,
        "lw": 0.9,
        "elinewidth": 1.1,
        "capsize": 2.5,
        "color": colour,
    }
    error = 100 * values["se"] / values["target"]
    panel.errorbar(
        place + 0.06, simulated, error, label="simulated ± standard error", **look
    )
    look = {"textcoords": "offset points", "fontsize": 6, "color": style.GREY}
    for x, y, seeds in zip(place, simulated, rounds["n_seeds"], strict=True):
        if np.isfinite(y):
            panel.annotate(f"{seeds:g} seeds", (x + 0.06, y), (6, -7), **look)
    panel.set_xlim(place[0] - 0.4, place[-1] + 0.7)  # with the words at the last point
