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
from .registry import Inputs, StudyView, figure

# What the table has of each response, a column each.
NUMBERS = ("predicted", "simulated", "se", "target")
HEIGHTS = [2.6, 1]  # of deviations, and of standard errors below them
OFFSET = 0.06  # of marks to the left and to the right of their round


@figure(
    "approach",
    "The loop closed",
    {"batches": "refined/batches.csv"},
    optional={"summary": "refined/summary.json"},
    reads=("targets", "refine.tolerance_percent", "refine.standard_error_percent"),
    folder="refined",
)
def approach(inputs: Inputs, study: StudyView) -> Figure:
    """Draw how far each round's proposal is off the targets, and its standard errors.

    Each response has two panels; `batches` has a row for each round, the summary tells
    why the rounds ended.

    The loop closed: how far each round's proposal is off its targets, in percent of
    them. Diamonds are predictions of the refitted surrogate, points are simulated means
    with one standard error, from fresh seeds; the number of seeds stands next to the
    mean. A mean inside the band is near enough. Below are the standard errors and their
    limit. The last round's point is the claim: it was simulated after everything that
    proposed it.
    """
    responses = study.targets.responses
    settings = study.settings.refine
    columns = [
        derived(response.name, number) for response in responses for number in NUMBERS
    ]
    rounds = read_table(inputs["batches"], ("round", "n_seeds", "outcome", *columns))

    rows = math.ceil(len(responses) / 2)
    figure = style.new_figure(style.PAGE, 3.9 * rows)
    axes = figure.subplots(
        2 * rows,
        min(2, len(responses)),
        sharex=True,
        height_ratios=HEIGHTS * rows,
        squeeze=False,
    )
    for k, response in enumerate(responses):
        row, column = divmod(k, 2)
        upper = axes[2 * row, column]
        lower = axes[2 * row + 1, column]
        values = {
            number: rounds[derived(response.name, number)].to_numpy(float)
            for number in NUMBERS
        }
        colour = style.series(k)["color"]
        target = values["target"][0]
        _draw_deviations(upper, rounds, values, settings.tolerance_percent, colour)
        upper.set_title(f"{response.symbol}, target {target:g} {response.unit}")
        _draw_standard_errors(
            lower, rounds, values, settings.standard_error_percent, colour
        )
        if column == 0:
            upper.set_ylabel("off the target (% of it)")
            lower.set_ylabel("standard error\n(% of the target)")
    if len(responses) % 2:
        for panel in axes[-2:, 1:].ravel():
            panel.axis("off")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3
    )
    axes[1, 0].legend(loc="lower right")
    if "summary" in inputs:
        reason = read_json(inputs["summary"], ("why",))["why"]
        figure.suptitle(textwrap.fill(reason, 60), fontsize=7.5, x=0.02, ha="left")
    return figure


def _draw_deviations(
    panel: Axes,
    rounds: pd.DataFrame,
    values: Mapping[str, np.ndarray],
    tolerance_percent: float,
    colour: str,
) -> None:
    """Draw how far one response is off its target, as predicted and as simulated."""
    place = rounds["round"].to_numpy(float)
    target = values["target"]
    simulated = 100 * (values["simulated"] / target - 1)
    predicted = 100 * (values["predicted"] / target - 1)
    error = 100 * values["se"] / target
    style.near_enough(panel, tolerance_percent)
    panel.plot(
        place - OFFSET,
        predicted,
        "D",
        ms=4.5,
        mfc="white",
        mec=style.BLACK,
        ls="",
        label="predicted",
        zorder=3,
    )
    panel.errorbar(
        place + OFFSET,
        simulated,
        error,
        marker="o",
        ms=4.5,
        lw=0.9,
        elinewidth=1.1,
        capsize=2.5,
        color=colour,
        label="simulated ± standard error",
    )
    for x, y, n_seeds in zip(place, simulated, rounds["n_seeds"], strict=True):
        if np.isfinite(y):
            panel.annotate(
                f"{n_seeds:g} seeds",
                (x + OFFSET, y),
                (6, -7),
                textcoords="offset points",
                fontsize=6,
                color=style.GREY,
            )
    # The words at the last point need room.
    panel.set_xlim(place[0] - 0.4, place[-1] + 0.7)


def _draw_standard_errors(
    panel: Axes,
    rounds: pd.DataFrame,
    values: Mapping[str, np.ndarray],
    limit_percent: float,
    colour: str,
) -> None:
    """Draw the standard errors of one response in percent of its target."""
    percent = 100 * values["se"] / values["target"]
    panel.plot(rounds["round"], percent, "o-", color=colour, ms=4)
    panel.axhline(
        limit_percent,
        color=style.GREY,
        ls="--",
        lw=0.9,
        label=f"limit, {limit_percent:g} %",
    )
    panel.set(xlabel="round", ylim=(0, None))
    panel.set_xticks(rounds["round"])
