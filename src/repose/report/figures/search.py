"""Draw the solutions of the search (Figure 14)."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.bench.parameters import SYMBOLS
from repose.common.files import read_json, read_table
from repose.common.numbers import format_significant
from repose.report.study_view import parameter_ranges

from . import panels, style
from .registry import Inputs, StudyView

GOLDEN_FRACTION = 0.6180339887
# In a strip, the range of a parameter extends from x = 0 to x = 1, and its middle is at
# a whole number y. All sizes in y are thus multiples of the distance between two
# strips.
FRACTION_X = 1.03  # where the fraction of the range that the solutions span is written
STRIP_LIMITS = (-0.02, 1.13)  # of the x axis, with space for this fraction
LEGEND_ROOM = 1.15  # below the middle of the lowest strip
STRIP_HEIGHT = 0.62
SPAN_HEIGHT = 0.40  # of the bar from the smallest to the largest solution
SPREAD_HEIGHT = 0.34  # over which the points of the solutions are spread
# The points and the bar lie a little above the middle, because published intervals and
# numbers lie below it.
POINTS_OFFSET = 0.03
# Height of the figure in inches: without any strip, and for each strip
BASE_HEIGHT = 1.5
HEIGHT_PER_STRIP = 0.42


def draw_feasible_solutions(inputs: Inputs, study: StudyView) -> Figure:
    """Draw where the solutions lie in the range of each parameter.

    Each parameter has a horizontal strip, which stands for its range. If the search
    found no feasible solution, its message stands below the strips.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `feasible` has a row for each solution with its parameters and
        predicted responses. Its columns `feasible` and `representative` say whether a
        solution is predicted to meet all targets, and whether it is the answer.
        `summary` contains the result of the search. `published` contains intervals of
        the parameters (Table 3 of the article), and may be missing.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
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

    n_strips = study.parameters.dimensions
    figure = style.new_figure(style.PAGE, BASE_HEIGHT + HEIGHT_PER_STRIP * n_strips)
    panel = figure.subplots()
    _draw_parameter_strips(panel, solutions, study=study, published=published)
    if not summary["feasible"]:
        # The message of the search says how near it came.
        note = _replace_names_by_symbols(summary.get("message", ""))
        style.write_below(figure, note)
    overlap = ""
    if published is not None:
        overlap = _describe_overlap(solutions, study, published)
    _write_title(panel, solutions, summary, overlap)
    return figure


def _describe_overlap(
    solutions: pd.DataFrame, study: StudyView, published: pd.DataFrame
) -> str:
    """Describe how many published intervals the solutions overlap.

    Parameters
    ----------
    solutions : DataFrame
        A row for each solution.
    study : StudyView
        The study.
    published : DataFrame
        The published intervals, by parameter.

    Returns
    -------
    str
        The end of a title.
    """
    names = study.parameters.free
    overlaps = [
        name
        for name in names
        if solutions[name].min() <= published.loc[name, "high"]
        and solutions[name].max() >= published.loc[name, "low"]
    ]
    return (
        f"; they overlap the published intervals of {len(overlaps)} of {len(names)} "
        "parameters"
    )


def _write_title(
    panel: Axes, solutions: pd.DataFrame, summary: Mapping[str, Any], overlap: str
) -> None:
    """Write the title: the number of solutions, or that none of them is feasible.

    A solution is feasible if all its responses are predicted inside their ranges.

    Parameters
    ----------
    panel : Axes
        The panel of the figure.
    solutions : DataFrame
        A row for each solution.
    summary : mapping
        Contents of miga/summary.json, the result of the search.
    overlap : str
        The end of the title, on the published intervals. It may be empty.
    """
    n_shown = len(solutions)
    if summary["feasible"]:
        n_feasible = int(_read_booleans(solutions["feasible"]).sum())
        title = f"{n_feasible} feasible solutions"
        if n_feasible < n_shown:
            title += f" and the {n_shown - n_feasible} nearest others"
        panel.set_title(title + overlap, fontweight="bold", color=style.BLACK)
        return
    title = f"no set is predicted inside all ranges: the {n_shown} nearest are shown"
    panel.set_title(title, fontweight="bold", color=style.RED)


def _replace_names_by_symbols(message: str) -> str:
    """Replace the names of parameters in a message by their symbols in the figure."""
    # No name is the beginning of another one, and names contain only letters and
    # underscores, so they can be alternatives of a regular expression.
    return re.sub("|".join(SYMBOLS), lambda match: SYMBOLS[match[0]], message)


def _make_offsets(count: int) -> np.ndarray:
    """Make offsets (count,) from -0.5 to 0.5 that keep points from hiding each other.

    The offsets look random, but are the same in each figure. Steps of the golden
    fraction fill the interval evenly.
    """
    return (np.arange(count) * GOLDEN_FRACTION % 1.0) - 0.5


def _read_booleans(column: pd.Series) -> np.ndarray:
    """Convert a column of true and false, in upper or lower case, to booleans (n,)."""
    return column.astype(str).str.lower().eq("true").to_numpy()


def _draw_parameter_strips(
    panel: Axes,
    solutions: pd.DataFrame,
    study: StudyView,
    published: pd.DataFrame | None,
) -> None:
    """Draw a strip for each free parameter, with the solutions as points in it.

    A strip shows the range of its parameter from left to right.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    solutions : DataFrame
        A row for each solution.
    study : StudyView
        The study.
    published : DataFrame or None
        The published intervals by parameter. If it is None, no interval is drawn.
    """
    names = study.parameters.free
    ranges = parameter_ranges(study.parameters)
    is_answer = _read_booleans(solutions["representative"])
    for number, name in enumerate(names):
        low, high = ranges[name]
        y = len(names) - 1 - number  # the first parameter is at the top
        # `fractions_of_range` converts values of the parameter to fractions of its range.
        positions = study.parameters.fractions_of_range(
            name, solutions[name].to_numpy()
        )
        # Matplotlib leaves labels with an underscore out of the legend, so only the
        # first strip adds its labels.
        label_prefix = "" if number == 0 else "_"
        _draw_strip(
            panel,
            y,
            positions=positions,
            is_answer=is_answer,
            label_prefix=label_prefix,
        )
        if published is not None:
            ends = published.loc[name, ["low", "high"]].astype(float).to_numpy()
            start, end = study.parameters.fractions_of_range(name, ends)
            _draw_published_interval(panel, y, start, end, label_prefix)
        _write_range(panel, y, low=low, high=high)
        percent = 100 * (positions.max() - positions.min())
        panel.text(
            FRACTION_X, y, f"{percent:.0f} %", fontsize=style.SMALL_TEXT_PT, va="center"
        )
    panel.text(
        FRACTION_X,
        len(names) - 0.55,
        "fraction of\nits range",
        fontsize=style.SMALL_TEXT_PT,
        va="bottom",
        color=style.GREY,
    )
    panels.label_strips(panel, names)
    panel.set(xlim=STRIP_LIMITS, ylim=(-LEGEND_ROOM, len(names) - 0.4))
    panel.legend(
        loc="lower center",
        ncols=3,
        handletextpad=0.3,
        columnspacing=1.4,
        bbox_to_anchor=(0.45, -0.02),
    )


def _draw_published_interval(
    panel: Axes, y: float, start: float, end: float, label_prefix: str
) -> None:
    """Draw the published interval of one parameter in the lower part of its strip.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    y : float
        Height of the strip's middle.
    start, end : float
        Ends of the interval as fractions of the parameter's range.
    label_prefix : str
        A prefix of the label. An underscore keeps it out of the legend.
    """
    panel.barh(
        y - 0.22,
        end - start,
        left=start,
        height=0.18,
        color=style.ORANGE,
        zorder=3,
        label=f"{label_prefix}published interval",
    )


def _write_range(panel: Axes, y: float, low: float, high: float) -> None:
    """Write the ends of a parameter's range, `low` and `high`, below its strip at `y`."""
    text_style = {"fontsize": 6, "va": "top", "color": style.GREY}
    panel.text(-0.01, y - 0.42, format_significant(low), ha="left", **text_style)
    panel.text(1.01, y - 0.42, format_significant(high), ha="right", **text_style)


def _draw_strip(
    panel: Axes,
    y: float,
    positions: np.ndarray,
    is_answer: np.ndarray,
    label_prefix: str,
) -> None:
    """Draw the range of one parameter with the solutions, their span and the answer.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    y : float
        Height of the strip's middle.
    positions : ndarray
        Values (n,) of the solutions as fractions of the range.
    is_answer : ndarray
        Mask (n,) of the answer.
    label_prefix : str
        A prefix of the labels. An underscore keeps them out of the legend.
    """
    middle = y + POINTS_OFFSET
    panel.barh(y, 1, height=STRIP_HEIGHT, color=style.STRIP_COLOUR, zorder=0)
    panel.barh(
        middle,
        positions.max() - positions.min(),
        left=positions.min(),
        height=SPAN_HEIGHT,
        color=style.SKY,
        alpha=0.35,
        zorder=1,
    )
    others = positions[~is_answer]
    panel.scatter(
        others,
        middle + SPREAD_HEIGHT * _make_offsets(len(others)),
        s=5,
        color=style.BLUE,
        alpha=0.7,
        lw=0,
        zorder=2,
        label=f"{label_prefix}solutions",
    )
    if is_answer.any():
        panel.plot(
            positions[is_answer],
            np.full(is_answer.sum(), middle),
            "D",
            label=f"{label_prefix}the answer",
            **style.ANSWER_STYLE,
        )
