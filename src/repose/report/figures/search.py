"""Figure 14 and the convergence of the island genetic algorithm."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from repose.bench.parameters import SYMBOLS
from repose.calibrate.inversion import LEAST_LOSS
from repose.calibrate.targets import Target
from repose.common.files import read_json, read_table

from . import style
from .registry import Inputs, Shown, figure

SIGHT = "points lie at different heights for sight only"
LOSS = (
    "the answer may lie apart: it has the least expected loss, where its error counts"
)
FOUND = {"feasible": "miga/feasible.csv", "summary": "miga/summary.json"}
READS = ("parameters", "targets", "miga.answer")


@figure("figure14", "Figure 14", FOUND, optional={"published": "{table3}"}, reads=READS)
def feasible_solutions(inputs: Inputs, study: Shown) -> Figure:
    """Draw the solutions' parameters in their ranges (Table 3 of the paper), and their predicted responses.

    Figure 14. Solutions that the search met, in their ranges, and their predicted responses. Of all feasible points
    met, the best {miga[solutions]} are kept that lie at least {miga[distance]} apart in parameters normalised to
    [-1, 1]. Where none was feasible the nearest ones are shown, and the figure says so.
    """
    targets, published = study.targets, None
    solutions = read_table(
        inputs["feasible"], ("feasible", "representative", *targets.predicted)
    )
    summary = read_json(inputs["summary"], ("feasible",))
    if "published" in inputs:
        published = read_table(
            inputs["published"], ("parameter", "low", "high")
        ).set_index("parameter")
    figure = style.new_figure(
        style.PAGE, max(0.9 + 0.42 * study.space.dimensions, 0.3 + 0.95 * len(targets))
    )
    places = figure.add_gridspec(len(targets), 2, width_ratios=(1.7, 1))
    left = figure.add_subplot(places[:, 0])
    _parameter_strips(left, solutions, study, published)
    for k, target in enumerate(targets):
        panel = figure.add_subplot(places[k, 1])
        _response_strip(panel, solutions, target)
        panel.set_title(style.letter(k + 1), fontweight="bold")
    by_loss = study.config.get("miga", {}).get("answer") == LEAST_LOSS
    style.below(figure, f"{SIGHT}; {LOSS}" if by_loss else SIGHT)
    _title(figure, left, solutions, summary)
    return figure


def _title(
    figure: Figure, left: Axes, solutions: pd.DataFrame, summary: Mapping[str, Any]
) -> None:
    """Draw the number of solutions shown, and whether they are feasible."""
    if summary["feasible"]:
        shown = int(_true(solutions["feasible"]).sum())
        others = (
            f" and the {len(solutions) - shown} nearest others"
            if shown < len(solutions)
            else ""
        )
        left.set_title(
            f"a   {shown} feasible solutions{others}",
            fontweight="bold",
            color=style.BLACK,
        )
        return
    text = f"a   no set is predicted inside all ranges: the {len(solutions)} nearest are shown"
    left.set_title(text, fontweight="bold", color=style.RED)
    words = re.sub(
        "|".join(SYMBOLS), lambda name: SYMBOLS[name[0]], summary.get("message", "")
    )
    figure.supxlabel(words, fontsize=6.8, color=style.RED, wrap=True)


def _jitter(count: int) -> np.ndarray:
    """Give fixed sideways places for points, the same in each figure."""
    return (np.arange(count) * 0.6180339887 % 1.0) - 0.5


def _true(column: pd.Series) -> np.ndarray:
    """Give a column of true and false, in any spelling, as a boolean array."""
    return column.astype(str).str.lower().eq("true").to_numpy()


def _parameter_strips(
    panel: Axes, solutions: pd.DataFrame, study: Shown, published: pd.DataFrame | None
) -> None:
    """Draw a strip for each parameter that is searched, its range from left to right."""
    names = study.space.free
    for row, name in enumerate(names):
        low, high = study.ranges[name]
        position = (solutions[name].to_numpy() - low) / (high - low)
        y = len(names) - 1 - row
        hidden = "" if row == 0 else "_"  # a label of the legend stands there once
        _strip(panel, y, position, _true(solutions["representative"]), hidden)
        if published is not None:
            ends = (
                published.loc[name, ["low", "high"]].astype(float).to_numpy() - low
            ) / (high - low)
            label = f"{hidden}published interval"
            panel.plot(
                ends,
                [y - 0.27] * 2,
                "-|",
                color=style.ORANGE,
                lw=2.4,
                ms=5,
                label=label,
            )
        for end, value, side in ((-0.01, low, "left"), (1.01, high, "right")):
            panel.text(
                end,
                y - 0.42,
                f"{value:g}",
                fontsize=6,
                ha=side,
                va="top",
                color=style.GREY,
            )
        width = 100 * (position.max() - position.min())
        panel.text(1.03, y, f"{width:.0f} %", fontsize=6.8, va="center")
    panel.text(
        1.03,
        len(names) - 0.55,
        "share of\nits range",
        fontsize=6.8,
        va="bottom",
        color=style.GREY,
    )
    style.strips(panel, names)
    panel.set(xlim=(-0.02, 1.13), ylim=(-1.15, len(names) - 0.4))
    panel.legend(
        loc="lower center",
        ncols=3,
        handletextpad=0.3,
        columnspacing=1.4,
        bbox_to_anchor=(0.45, -0.02),
    )


def _strip(
    panel: Axes, y: float, position: np.ndarray, marked: np.ndarray, hidden: str
) -> None:
    """Draw the range of one parameter with all solutions, their interval, and the representative one."""
    panel.barh(y, 1, height=0.62, color="#EEF0F2", zorder=0)
    width = position.max() - position.min()
    panel.barh(
        y + 0.03,
        width,
        left=position.min(),
        height=0.40,
        color=style.SKY,
        alpha=0.35,
        zorder=1,
    )
    look = {"s": 5, "color": style.BLUE, "alpha": 0.7, "lw": 0, "zorder": 2}
    others = position[~marked]
    panel.scatter(
        others,
        y + 0.03 + 0.34 * _jitter(len(others)),
        label=f"{hidden}solutions",
        **look,
    )
    if marked.any():
        label = f"{hidden}representative, the answer"
        panel.plot(
            position[marked],
            np.full(marked.sum(), y + 0.03),
            "D",
            label=label,
            **style.ANSWER,
        )


def _response_strip(panel: Axes, solutions: pd.DataFrame, target: Target) -> None:
    """Draw the predictions of one response from left to right, with its range and its aim."""
    values, marked = (
        solutions[target.response.predicted].to_numpy(),
        _true(solutions["representative"]),
    )
    panel.axvspan(target.low, target.high, color=style.GREEN, alpha=0.2, lw=0)
    panel.axvline(target.aim, color=style.GREEN, lw=1.2, ls="--")
    panel.scatter(
        values[~marked],
        0.6 * _jitter((~marked).sum()),
        s=7,
        color=style.BLUE,
        alpha=0.7,
        lw=0,
        zorder=2,
    )
    panel.plot(values[marked], np.zeros(marked.sum()), "D", **style.ANSWER)
    low, high = min(target.low, values.min()), max(target.high, values.max())
    room = 0.04 * (high - low)
    panel.set(xlim=(low - room, high + room), ylim=(-0.5, 0.5), yticks=[])
    panel.set_xlabel(style.response_label(target.response, "predicted"))
    panel.spines["left"].set_visible(False)
    unit, look = target.response.unit, {"fontsize": 6.8, "color": style.GREEN}
    panel.text(
        target.low,
        0.46,
        f" target range\n {target.low:g} to {target.high:g} {unit}",
        va="top",
        **look,
    )
    panel.set_title(f"line: aim {target.aim:g} {unit}", loc="right", **look)


@figure(
    "convergence",
    "Convergence of the search",
    {"history": "miga/history.csv"},
    reads=("miga",),
)
def convergence(inputs: Inputs, study: Shown) -> Figure:
    """Draw the objective of the best and the mean individual, and feasible solutions met, over the generations.

    Course of the search: best and mean objective (Eq. 11) over {miga[rounds]} rounds of {miga[generations]}
    generations.
    """
    columns = ("generation", "mean_objective", "best_objective", "feasible_found")
    generation, mean, best, found = (
        read_table(inputs["history"], columns)[list(columns)].to_numpy().T
    )
    met = int(found.max())
    heights = [1.6, 1] if met else [1.6]
    figure = style.new_figure(style.COLUMN, 1.2 + len(heights))
    top, *below = style.panels_in(
        figure, len(heights), 1, sharex=True, height_ratios=heights
    )
    top.plot(generation, mean, color=style.SKY, label="mean of all islands")
    top.plot(generation, best, color=style.BLUE, label="best so far")
    top.set_ylabel("objective F (dimensionless)")
    least, most = min(best.min(), mean.min()), max(best.max(), mean.max())
    if least > 0 and most > 10 * least:  # else no power of ten has a tick
        top.set_yscale("log")
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    for panel in below:
        panel.plot(generation, found, color=style.GREEN)
        panel.set(ylabel="feasible\nsolutions met", ylim=(0, 1.05 * met))
        panel.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    if not met:
        top.set_title("no feasible solution was met", color=style.RED)
    (below or [top])[-1].set_xlabel("generation")
    if generation[-1] > 200:
        top.set_xscale("log")
    return figure
