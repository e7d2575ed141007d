"""The validation of our solutions (Table 4), and the published solutions in our simulator."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.responses import derived
from repose.calibrate.targets import Target
from repose.common.files import read_table
from repose.stages.published import STALE, published_responses

from . import style
from .registry import Inputs, Shown, figure

BARS = {"ms": 4.5, "elinewidth": 1, "capsize": 2}
HERE = BARS | {
    "fmt": "s",
    "color": style.BLUE,
    "label": "simulated here ± standard error over seeds",
}
THERE = BARS | {
    "fmt": "D",
    "color": style.ORANGE,
    "mfc": "white",
    "label": "published simulation",
}


TABLE_4 = {"table4": "validation/table4.csv"}


@figure(
    "validation",
    "Table 4, shown",
    TABLE_4,
    optional={"published": "{published}"},
    reads=("targets",),
)
def validation(inputs: Inputs, study: Shown) -> Figure:
    """Draw predicted and simulated responses of our solutions, and the published table's.

    Table 4 as a figure: predicted and simulated responses of the answer, the representative solution, and others,
    simulated with seeds that no sample of the design had. Published solutions have a P before their number. Bars
    are one standard error; the band is the measurement, mean and standard deviation.
    """
    targets = study.targets
    simulated = [target.response.simulated for target in targets]
    solutions = read_table(
        inputs["table4"], ("solution", *targets.predicted, *simulated)
    )
    of_publication = (
        read_table(inputs["published"], ("solution",))
        if "published" in inputs
        else pd.DataFrame()
    )
    published = published_responses(of_publication.columns, targets.responses)
    widths = (1.15, 1) if published else (1,)
    figure = style.new_figure(style.PAGE, 0.6 + 1.9 * len(targets))
    panels = figure.subplots(
        len(targets), len(widths), sharey="row", squeeze=False, width_ratios=widths
    )
    for row, target in zip(panels, targets, strict=True):
        _predicted_and_simulated(row[0], _in_order(solutions), target, HERE)
        row[0].set_ylabel(style.response_label(target.response))
        if target.response in published:
            _predicted_and_simulated(
                row[1], _in_order(of_publication, "P"), target, THERE
            )
        elif published:
            row[1].axis("off")
            style.note(
                row[1], "not published", x=0.5, y=0.5, ha="center", color=style.GREY
            )
    of = ("this run", "solution of this run"), ("published", "published solution (P)")
    for top, bottom, (title, label) in zip(panels[0], panels[-1], of, strict=False):
        top.set_title(title, fontweight="bold")
        bottom.set_xlabel(label)
    figure.align_xlabels(panels[-1])
    style.one_legend(panels.ravel(), loc="outside upper center", ncols=3)
    style.below(figure, "numbers: error of the prediction in % of the simulated value")
    return figure


@figure(
    "published",
    "Published solutions here",
    {"published": "{stored}"},
    reads=("targets",),
)
def published_solutions(inputs: Inputs, study: Shown) -> Figure:
    """Draw the published responses of the published solutions, and the ones simulated here.

    The published parameter sets in this simulator, from the stored table that the configuration names, with what
    was published of their piles.
    """
    table = _in_order(read_table(inputs["published"], ("solution",)), "P")
    targets = [target for target in study.targets if target.response.simulated in table]
    figure, panels = style.grid(len(targets), 2.3, further=0.3)
    for panel, target in zip(panels, targets, strict=True):
        _published_and_simulated(panel, table, target)
    style.name_panels(panels)
    if table.get("stale", pd.Series(dtype=bool)).any():
        figure.suptitle(STALE, fontsize=6.8, color=style.RED)
    style.one_legend(panels, loc="outside lower center", ncols=2)
    return figure


def _published_and_simulated(panel: Axes, table: pd.DataFrame, target: Target) -> None:
    """Draw one response of the published solutions, as published and as simulated here."""
    x, response = _measured(panel, table, target), target.response
    if (column := derived(response.name, "published_simulated")) in table:
        measured = table.get(
            derived(response.name, "published_measured"), pd.Series(np.nan, table.index)
        )
        panel.errorbar(x - 0.12, table[column], **THERE)
        if measured.notna().any():
            panel.errorbar(
                x - 0.12,
                measured,
                **THERE | {"mfc": style.ORANGE, "label": "published measurement"},
            )
        for place in x[table[column].isna() & measured.isna()]:
            panel.text(
                place - 0.2,
                target.value,
                "not published",
                rotation=90,
                ha="center",
                va="center",
                fontsize=6.8,
            )
    panel.errorbar(
        x + 0.12, table[response.simulated], table[response.error].fillna(0.0), **HERE
    )
    panel.set(ylabel=style.response_label(response), xlabel="published solution (P)")
    panel.margins(y=0.15)


def _predicted_and_simulated(
    panel: Axes, table: pd.DataFrame, target: Target, marks: Mapping[str, Any]
) -> None:
    """Draw one response of each solution, with the prediction's error in percent of the simulated value."""
    x, response = _measured(panel, table, target), target.response
    predicted, simulated = (
        table[column].to_numpy(float)
        for column in (response.predicted, response.simulated)
    )
    error = table[response.error].fillna(0.0) if response.error in table else None
    panel.plot(
        x - 0.12,
        predicted,
        "o",
        ms=4.5,
        mfc="white",
        color=style.BLACK,
        label="predicted",
    )
    panel.errorbar(x + 0.12, simulated, error, **marks)
    look = {
        "xytext": (0, -9),
        "textcoords": "offset points",
        "ha": "center",
        "va": "top",
        "fontsize": 6.3,
    }
    for place, before, after in zip(x, predicted, simulated, strict=True):
        if np.isfinite(after) and after != 0:
            off = 100 * abs((before - after) / after)
            panel.annotate(
                f"{off:.1f}", (place, min(before, after)), color=style.GREY, **look
            )
    panel.margins(y=0.25)


def _measured(panel: Axes, table: pd.DataFrame, target: Target) -> np.ndarray:
    """Draw the measured mean and a band of one standard deviation over the solutions' names, and give their places."""
    words = "measured ± standard deviation of one repetition"
    style.band(panel, target.value - target.sd, target.value + target.sd, words)
    panel.axhline(target.value, color=style.GREEN, lw=0.9, label="measured mean")
    panel.set_xticks(range(len(table)), table["name"])
    panel.set_xlim(-0.6, len(table) - 0.4)
    return np.arange(len(table))


def _in_order(table: pd.DataFrame, mark: str = "") -> pd.DataFrame:
    """Give solutions names for an axis, a mark before their numbers: the answer first, then by number, then others."""
    answer = table.get("role", table["solution"]) == "representative"
    names = [
        _name(str(solution), first, mark)
        for solution, first in zip(table["solution"], answer, strict=True)
    ]
    number = pd.to_numeric(table["solution"], errors="coerce").mask(answer, -1)
    return table.assign(name=names, number=number).sort_values(
        "number", kind="stable", ignore_index=True
    )


def _name(solution: str, answer: bool, mark: str) -> str:
    """Name a solution; one of other authors by these and the year, as `yu_2022`."""
    if answer:
        return f"{mark}{solution.removeprefix('representative')}\n(answer)"
    return (
        f"{mark}{solution}"
        if solution.isdigit()
        else solution.replace("_", " et al.\n").capitalize()
    )
