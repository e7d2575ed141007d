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
from repose.calibrate.search.settings import LEAST_LOSS
from repose.calibrate.targets import Target
from repose.common.files import read_json, read_table
from repose.report.study_view import parameter_ranges

from . import panels, style
from .registry import PUBLISHED_INTERVALS, Inputs, StudyView, figure

HEIGHTS_WORDS = "points lie at different heights for sight only"
LEAST_LOSS_WORDS = (
    "the answer may lie apart: it has the least expected loss, where its error counts"
)
GOLDEN_FRACTION = 0.6180339887
HISTORY_COLUMNS = (
    "generation",
    "mean_objective",
    "best_objective",
    "feasible_found",
)


@figure(
    "figure14",
    "Figure 14",
    {"feasible": "miga/feasible.csv", "summary": "miga/summary.json"},
    optional={"published": PUBLISHED_INTERVALS},
    reads=("parameters", "targets", "miga.answer"),
)
def feasible_solutions(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the parameters of the solutions in their ranges, and their responses.

    `feasible` has a row for each solution with its parameters and predicted responses;
    `published` has intervals of the parameters (Table 3 of the paper).

    Figure 14. Solutions that the search met, in their ranges, and their predicted
    responses. Of all feasible points met, the best {miga[solutions]} are kept that lie
    at least {miga[distance]} apart in parameters normalised to [-1, 1]. Where none was
    feasible the nearest ones are shown, and the figure says so.
    """
    targets = study.targets
    solutions = read_table(
        inputs["feasible"], ("feasible", "representative", *targets.predicted)
    )
    summary = read_json(inputs["summary"], ("feasible",))
    published = None
    if "published" in inputs:
        published = read_table(inputs["published"], ("parameter", "low", "high"))
        published = published.set_index("parameter")

    height_of_strips = 0.9 + 0.42 * study.parameters.dimensions
    height_of_responses = 0.3 + 0.95 * len(targets)
    figure = style.new_figure(style.PAGE, max(height_of_strips, height_of_responses))
    places = figure.add_gridspec(len(targets), 2, width_ratios=(1.7, 1))
    left = figure.add_subplot(places[:, 0])
    _draw_parameter_strips(left, solutions, study=study, published=published)
    for k, target in enumerate(targets):
        panel = figure.add_subplot(places[k, 1])
        _draw_response_strip(panel, solutions, target)
        panel.set_title(style.letter(k + 1), fontweight="bold")

    words = HEIGHTS_WORDS
    if study.config.get("miga", {}).get("answer") == LEAST_LOSS:
        words = f"{HEIGHTS_WORDS}; {LEAST_LOSS_WORDS}"
    style.below(figure, words)
    _write_title(figure, left, solutions=solutions, summary=summary)
    return figure


def _write_title(
    figure: Figure, left: Axes, solutions: pd.DataFrame, summary: Mapping[str, Any]
) -> None:
    """Write how many solutions are shown, and whether they are feasible."""
    if summary["feasible"]:
        n_feasible = int(_as_boolean(solutions["feasible"]).sum())
        others = ""
        if n_feasible < len(solutions):
            others = f" and the {len(solutions) - n_feasible} nearest others"
        title = f"a   {n_feasible} feasible solutions{others}"
        left.set_title(title, fontweight="bold", color=style.BLACK)
        return
    title = (
        f"a   no set is predicted inside all ranges: the {len(solutions)} nearest are "
        "shown"
    )
    left.set_title(title, fontweight="bold", color=style.RED)
    # The message has the names of parameters, the figure their symbols.
    message = summary.get("message", "")
    message = re.sub("|".join(SYMBOLS), lambda match: SYMBOLS[match[0]], message)
    figure.supxlabel(message, fontsize=style.SMALL_TEXT_PT, color=style.RED, wrap=True)


def _scattered(count: int) -> np.ndarray:
    """Give places (count,) from -0.5 to 0.5, scattered alike in each figure."""
    return (np.arange(count) * GOLDEN_FRACTION % 1.0) - 0.5


def _as_boolean(column: pd.Series) -> np.ndarray:
    """Read a column of true and false, in any spelling, as a boolean array."""
    return column.astype(str).str.lower().eq("true").to_numpy()


def _draw_parameter_strips(
    panel: Axes,
    solutions: pd.DataFrame,
    study: StudyView,
    published: pd.DataFrame | None,
) -> None:
    """Draw a strip for each free parameter, its range from left to right."""
    names = study.parameters.free
    is_answer = _as_boolean(solutions["representative"])
    for row, (name, (low, high)) in enumerate(
        parameter_ranges(study.parameters).items()
    ):
        y = len(names) - 1 - row
        place = (solutions[name].to_numpy() - low) / (high - low)
        # The first strip names the marks in the legend.
        hidden = "" if row == 0 else "_"
        _draw_strip(panel, y, place=place, is_answer=is_answer, hidden=hidden)
        if published is not None:
            ends = published.loc[name, ["low", "high"]].astype(float).to_numpy()
            panel.plot(
                (ends - low) / (high - low),
                [y - 0.27, y - 0.27],
                "-|",
                color=style.ORANGE,
                lw=2.4,
                ms=5,
                label=f"{hidden}published interval",
            )
        for x, value, alignment in ((-0.01, low, "left"), (1.01, high, "right")):
            panel.text(
                x,
                y - 0.42,
                f"{value:g}",
                fontsize=6,
                ha=alignment,
                va="top",
                color=style.GREY,
            )
        percent = 100 * (place.max() - place.min())
        panel.text(
            1.03, y, f"{percent:.0f} %", fontsize=style.SMALL_TEXT_PT, va="center"
        )
    panel.text(
        1.03,
        len(names) - 0.55,
        "share of\nits range",
        fontsize=style.SMALL_TEXT_PT,
        va="bottom",
        color=style.GREY,
    )
    panels.label_strips(panel, names)
    panel.set(xlim=(-0.02, 1.13), ylim=(-1.15, len(names) - 0.4))
    panel.legend(
        loc="lower center",
        ncols=3,
        handletextpad=0.3,
        columnspacing=1.4,
        bbox_to_anchor=(0.45, -0.02),
    )


def _draw_strip(
    panel: Axes, y: float, place: np.ndarray, is_answer: np.ndarray, hidden: str
) -> None:
    """Draw the range of one parameter with its solutions, their interval, the answer.

    `place` are the values as shares of the range. Labels that begin with `hidden`, an
    underscore, are left out of the legend.
    """
    middle = y + 0.03
    panel.barh(y, 1, height=0.62, color=style.STRIP_COLOUR, zorder=0)
    panel.barh(
        middle,
        place.max() - place.min(),
        left=place.min(),
        height=0.40,
        color=style.SKY,
        alpha=0.35,
        zorder=1,
    )
    others = place[~is_answer]
    panel.scatter(
        others,
        middle + 0.34 * _scattered(len(others)),
        s=5,
        color=style.BLUE,
        alpha=0.7,
        lw=0,
        zorder=2,
        label=f"{hidden}solutions",
    )
    if is_answer.any():
        panel.plot(
            place[is_answer],
            np.full(is_answer.sum(), middle),
            "D",
            label=f"{hidden}representative, the answer",
            **style.ANSWER,
        )


def _draw_response_strip(panel: Axes, solutions: pd.DataFrame, target: Target) -> None:
    """Draw the predictions of one response from left to right, with its range and aim."""
    unit = target.response.unit
    values = solutions[target.response.predicted].to_numpy()
    is_answer = _as_boolean(solutions["representative"])
    n_others = (~is_answer).sum()
    panel.axvspan(target.low, target.high, color=style.GREEN, alpha=0.2, lw=0)
    panel.axvline(target.aim, color=style.GREEN, lw=1.2, ls="--")
    panel.scatter(
        values[~is_answer],
        0.6 * _scattered(n_others),
        s=7,
        color=style.BLUE,
        alpha=0.7,
        lw=0,
        zorder=2,
    )
    panel.plot(values[is_answer], np.zeros(is_answer.sum()), "D", **style.ANSWER)

    low = min(target.low, values.min())
    high = max(target.high, values.max())
    room = 0.04 * (high - low)
    panel.set(xlim=(low - room, high + room), ylim=(-0.5, 0.5), yticks=[])
    panel.set_xlabel(style.response_label(target.response, "predicted"))
    panel.spines["left"].set_visible(False)
    panel.text(
        target.low,
        0.46,
        f" target range\n {target.low:g} to {target.high:g} {unit}",
        va="top",
        fontsize=style.SMALL_TEXT_PT,
        color=style.GREEN,
    )
    panel.set_title(
        f"line: aim {target.aim:g} {unit}",
        loc="right",
        fontsize=style.SMALL_TEXT_PT,
        color=style.GREEN,
    )


@figure(
    "convergence",
    "Convergence of the search",
    {"history": "miga/history.csv"},
    reads=("miga",),
)
def convergence(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the objective and the feasible solutions met over the generations.

    `history` has a row for some generations, with the objective of the best and of the
    mean individual.

    Course of the search: best and mean objective (Eq. 11) over {miga[rounds]} rounds of
    {miga[generations]} generations.
    """
    history = read_table(inputs["history"], HISTORY_COLUMNS)
    generation = history["generation"].to_numpy()
    n_found = history["feasible_found"].to_numpy()
    n_found_at_end = int(n_found.max())

    # The panel of the solutions is left out if there are none.
    height_ratios = [1.6, 1] if n_found_at_end else [1.6]
    figure = style.new_figure(style.COLUMN, 1.2 + len(height_ratios))
    axes = panels.panels_in(
        figure, len(height_ratios), 1, sharex=True, height_ratios=height_ratios
    )
    _draw_objective(axes[0], history)
    if n_found_at_end:
        axes[1].plot(generation, n_found, color=style.GREEN)
        axes[1].set(ylabel="feasible\nsolutions met", ylim=(0, 1.05 * n_found_at_end))
        axes[1].yaxis.set_major_locator(MaxNLocator(4, integer=True))
    else:
        axes[0].set_title("no feasible solution was met", color=style.RED)
    axes[-1].set_xlabel("generation")
    if generation[-1] > 200:
        axes[0].set_xscale("log")
    return figure


def _draw_objective(panel: Axes, history: pd.DataFrame) -> None:
    """Draw the objective of the best and of the mean individual."""
    generation = history["generation"].to_numpy()
    mean = history["mean_objective"].to_numpy()
    best = history["best_objective"].to_numpy()
    panel.plot(generation, mean, color=style.SKY, label="mean of all islands")
    panel.plot(generation, best, color=style.BLUE, label="best so far")
    panel.set_ylabel("objective F (dimensionless)")
    lowest = min(best.min(), mean.min())
    highest = max(best.max(), mean.max())
    # Over less than a power of ten a logarithmic axis would have no tick.
    if lowest > 0 and highest > 10 * lowest:
        panel.set_yscale("log")
    panel.figure.legend(
        *panel.get_legend_handles_labels(), loc="outside upper center", ncols=2
    )
