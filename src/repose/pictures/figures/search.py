"""Figure 14 and the convergence of the island genetic algorithm."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from repose.core.files import read_json, read_table
from repose.core.parameters import SYMBOLS
from repose.core.targets import Target

from . import style
from .registry import Inputs, Shown, figure

ANSWER = {"ms": 5.0, "color": style.RED, "mec": "white", "mew": 0.6, "zorder": 4}


FOUND = {"feasible": "miga/feasible.csv", "summary": "miga/summary.json"}


@figure("figure14", "Figure 14", FOUND, optional={"published": "{table3}"}, reads=("parameters", "targets"))
def feasible_solutions(inputs: Inputs, study: Shown) -> Figure:
    """Draw the solutions' parameters in their ranges (Table 3 of the paper), and their predicted responses.

    Figure 14. Solutions that the search met, in their ranges, and their predicted responses. Of all feasible points
    met, the best {miga[solutions]} are kept that lie at least {miga[distance]} apart in parameters normalised to
    [-1, 1]. Where none was feasible the nearest ones are shown, and the figure says so.
    """
    targets = study.targets
    solutions = read_table(inputs["feasible"], ("feasible", "representative", *targets.predicted))
    summary = read_json(inputs["summary"], ("feasible",))
    published = None
    if "published" in inputs:
        published = read_table(inputs["published"], ("parameter", "low", "high")).set_index("parameter")
    free = study.space.free
    figure = style.new_figure(style.PAGE, max(0.9 + 0.42 * len(free), 0.3 + 0.95 * len(targets)))
    places = figure.add_gridspec(len(targets), 2, width_ratios=(1.7, 1))
    left = figure.add_subplot(places[:, 0])
    _parameter_strips(left, solutions, study.ranges, free, published)
    for k, target in enumerate(targets):
        panel = figure.add_subplot(places[k, 1])
        _response_strip(panel, solutions, target)
        panel.set_title(style.letter(k + 1), fontweight="bold")
    _title(figure, left, solutions, summary)
    return figure


def _title(figure: Figure, left: Axes, solutions: pd.DataFrame, summary: Mapping[str, Any]) -> None:
    """Draw the number of solutions shown, and whether they are feasible."""
    if summary["feasible"]:
        shown = int(_true(solutions["feasible"]).sum())
        text, colour = f"{shown} feasible solutions", style.BLACK
        if shown < len(solutions):
            text += f" and the {len(solutions) - shown} nearest others"
    else:
        text, colour = (f"no set is predicted inside all ranges: the {len(solutions)} nearest are shown", style.RED)
    left.set_title(f"a   {text}", fontweight="bold", color=colour)
    if not summary["feasible"] and summary.get("message"):
        words = re.sub("|".join(SYMBOLS), lambda name: SYMBOLS[name[0]], summary["message"])
        figure.supxlabel(words, fontsize=6.8, color=style.RED, wrap=True)


def _jitter(count: int) -> np.ndarray:
    """Give fixed sideways places for points, the same in each figure."""
    return (np.arange(count) * 0.6180339887 % 1.0) - 0.5


def _true(column: pd.Series) -> np.ndarray:
    """Give a column of true and false, in any spelling, as a boolean array."""
    return column.astype(str).str.lower().eq("true").to_numpy()


def _representative(solutions: pd.DataFrame) -> np.ndarray:
    """Give the mask of the representative solution."""
    return _true(solutions["representative"])


def _parameter_strips(
    panel: Axes,
    solutions: pd.DataFrame,
    ranges: Mapping[str, tuple[float, float]],
    names: Sequence[str],
    published: pd.DataFrame | None,
) -> None:
    """Draw a strip for each parameter that is searched, its range from left to right."""
    for row, name in enumerate(names):
        low, high = ranges[name]
        position = (solutions[name].to_numpy() - low) / (high - low)
        y = len(names) - 1 - row
        _strip(panel, y, position, _representative(solutions), labelled=row == 0)
        if published is not None:
            ends = (published.loc[name, ["low", "high"]].astype(float).to_numpy() - low) / (high - low)
            label = "published interval" if row == 0 else None
            panel.plot(ends, [y - 0.27] * 2, "-|", color=style.ORANGE, lw=2.4, ms=5, label=label)
        panel.text(-0.01, y - 0.42, f"{low:g}", fontsize=6, ha="left", va="top", color=style.GREY)
        panel.text(1.01, y - 0.42, f"{high:g}", fontsize=6, ha="right", va="top", color=style.GREY)
        width = 100 * (position.max() - position.min())
        panel.text(1.03, y, f"{width:.0f} %", fontsize=6.8, va="center")
    panel.text(1.03, len(names) - 0.55, "share of\nits range", fontsize=6.8, va="bottom", color=style.GREY)
    panel.set_yticks(range(len(names)), [SYMBOLS[name] for name in reversed(names)], fontsize=9)
    panel.set(xlim=(-0.02, 1.13), ylim=(-1.15, len(names) - 0.4))
    panel.set_xticks([0, 0.25, 0.5, 0.75, 1.0])
    panel.set_xlabel("place in the parameter's range (dimensionless)")
    panel.legend(loc="lower center", ncols=3, handletextpad=0.3, columnspacing=1.4, bbox_to_anchor=(0.45, -0.02))
    panel.spines["left"].set_visible(False)
    panel.tick_params(axis="y", length=0)


def _strip(panel: Axes, y: float, position: np.ndarray, marked: np.ndarray, labelled: bool) -> None:
    """Draw the range of one parameter with all solutions, their interval, and the representative one."""
    panel.barh(y, 1, height=0.62, color="#EEF0F2", zorder=0)
    width = position.max() - position.min()
    panel.barh(y + 0.03, width, left=position.min(), height=0.40, color=style.SKY, alpha=0.35, zorder=1)
    look = {"s": 5, "color": style.BLUE, "alpha": 0.7, "lw": 0, "zorder": 2}
    label, others = "solutions" if labelled else None, position[~marked]
    panel.scatter(others, y + 0.03 + 0.34 * _jitter(len(others)), label=label, **look)
    if marked.any():
        label = "representative, the answer" if labelled else None
        panel.plot(position[marked], np.full(marked.sum(), y + 0.03), "D", label=label, **ANSWER)


def _response_strip(panel: Axes, solutions: pd.DataFrame, target: Target) -> None:
    """Draw the predictions of one response from left to right, with its range and its aim."""
    values, marked = solutions[target.response.predicted].to_numpy(), _representative(solutions)
    panel.axvspan(target.low, target.high, color=style.GREEN, alpha=0.2, lw=0)
    panel.axvline(target.aim, color=style.GREEN, lw=1.2, ls="--")
    others = values[~marked]
    panel.scatter(others, 0.6 * _jitter(len(others)), s=7, color=style.BLUE, alpha=0.7, lw=0, zorder=2)
    panel.plot(values[marked], np.zeros(marked.sum()), "D", **ANSWER)
    ends = min(target.low, values.min()), max(target.high, values.max())
    room = 0.04 * (ends[1] - ends[0])
    panel.set(xlim=(ends[0] - room, ends[1] + room), ylim=(-0.5, 0.5), yticks=[])
    panel.set_xlabel(style.response_label(target.response, "predicted"))
    panel.spines["left"].set_visible(False)
    words = f"band: target range {target.low:g} to {target.high:g}, line: aim {target.aim:g}"
    panel.set_title(words, loc="right", fontsize=6.8, color=style.GREEN)


@figure("convergence", "Convergence of the search", {"history": "miga/history.csv"}, reads=("miga",))
def convergence(inputs: Inputs, study: Shown) -> Figure:
    """Draw the objective of the best and the mean individual, and feasible solutions met, over the generations.

    Course of the search: best and mean objective (Eq. 11) over {miga[rounds]} rounds of {miga[generations]}
    generations.
    """
    columns = ("generation", "mean_objective", "best_objective", "feasible_found")
    history = read_table(inputs["history"], columns)
    met = int(history["feasible_found"].max())
    rows = 2 if met else 1
    figure = style.new_figure(style.COLUMN, 1.2 + rows)
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=[1.6, 1][:rows])[:, 0]
    top = panels[0]
    top.plot(history["generation"], history["mean_objective"], color=style.SKY, label="mean of all islands")
    top.plot(history["generation"], history["best_objective"], color=style.BLUE, label="best so far")
    top.set_ylabel("objective F (dimensionless)")
    objectives = history[["best_objective", "mean_objective"]].to_numpy()
    if objectives.min() > 0 and objectives.max() > 10 * objectives.min():  # else no power of ten has a tick
        top.set_yscale("log")
    top.legend(loc="upper right")
    if met:
        panels[1].plot(history["generation"], history["feasible_found"], color=style.GREEN)
        panels[1].set(ylabel="feasible\nsolutions met", ylim=(0, 1.05 * met))
        panels[1].yaxis.set_major_locator(MaxNLocator(4, integer=True))
    else:
        top.set_title("no feasible solution was met", color=style.RED)
    panels[-1].set_xlabel("generation")
    if history["generation"].iloc[-1] > 200:
        top.set_xscale("log")
    return figure
