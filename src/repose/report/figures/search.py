"""Draw the solutions of the search (Figure 14), and how it converged."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.bench.parameters import SYMBOLS
from repose.calibrate.search.settings import MIN_LOSS
from repose.calibrate.targets import Target
from repose.common.files import read_json, read_table
from repose.common.numbers import format_significant
from repose.report.study_view import parameter_ranges

from . import panels, style
from .registry import Inputs, StudyView

MIN_LOSS_NOTE = (
    "The answer is the set of the least expected error, which counts how uncertain each "
    "prediction is; so it may lie beside the other sets."
)
GOLDEN_FRACTION = 0.6180339887
# Position of the fraction that the solutions span. The range itself extends from 0 to
# 1.
FRACTION_X = 1.03
# With more generations than this, their axis is logarithmic.
LINEAR_GENERATIONS = 200
HISTORY_COLUMNS = (
    "generation",
    "mean_objective",
    "best_objective",
    "feasible_found",
)


def draw_feasible_solutions(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the parameters of the solutions in their ranges, and their responses.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `feasible` has a row for each solution with its parameters and
        predicted responses. `summary` contains the result of the search. `published`
        contains intervals of the parameters (Table 3 of the paper), and may be missing.
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

    # Draw a strip for each parameter, and write sentences below the strips.
    figure = style.new_figure(style.PAGE, 1.5 + 0.42 * study.parameters.dimensions)
    panel = figure.subplots()
    _draw_parameter_strips(panel, solutions, study=study, published=published)
    sentences = []
    if study.config.get("miga", {}).get("answer") == MIN_LOSS:
        sentences.append(MIN_LOSS_NOTE)
    sentences += [_describe_predictions(solutions, target) for target in targets]
    if published is not None:
        sentences.append(_describe_overlap(solutions, study, published))
    style.write_below(figure, " ".join(sentences))
    _write_title(figure, panel, solutions=solutions, summary=summary)
    return figure


def _describe_predictions(solutions: pd.DataFrame, target: Target) -> str:
    """Describe the predicted response of the solutions and of the answer.

    Parameters
    ----------
    solutions : DataFrame
        A row for each solution. The answer is one of them.
    target : Target
        The target of the response.

    Returns
    -------
    str
        One sentence.
    """
    response = target.response
    predicted = solutions[response.predicted]
    is_answer = _read_booleans(solutions["representative"])
    low = predicted.min()
    high = predicted.max()
    sentence = f"Predicted {response.symbol}: {low:.2f} to {high:.2f} {response.unit}"
    if is_answer.any():
        sentence += f", the answer {predicted[is_answer].iloc[0]:.2f}"
    return f"{sentence} (target range {target.low:g} to {target.high:g})."


def _describe_overlap(
    solutions: pd.DataFrame, study: StudyView, published: pd.DataFrame
) -> str:
    """Describe for how many parameters the solutions overlap the published interval.

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
        One sentence.
    """
    names = study.parameters.free
    overlaps = [
        name
        for name in names
        if solutions[name].min() <= published.loc[name, "high"]
        and solutions[name].max() >= published.loc[name, "low"]
    ]
    return (
        f"The solutions reach into the published interval of {len(overlaps)} of the "
        f"{len(names)} parameters."
    )


def _write_title(
    figure: Figure, panel: Axes, solutions: pd.DataFrame, summary: Mapping[str, Any]
) -> None:
    """Write the title: the number of solutions, or that none of them is feasible.

    Parameters
    ----------
    figure : Figure
        The figure. If no solution is feasible, the message of the search replaces the
        note below the figure.
    panel : Axes
        The panel of the figure.
    solutions : DataFrame
        A row for each solution.
    summary : mapping
        Contents of miga/summary.json.
    """
    n_shown = len(solutions)
    if summary["feasible"]:
        n_feasible = int(_read_booleans(solutions["feasible"]).sum())
        title = f"{n_feasible} feasible solutions"
        if n_feasible < n_shown:
            title += f" and the {n_shown - n_feasible} nearest others"
        panel.set_title(title, fontweight="bold", color=style.BLACK)
        return
    title = f"no set is predicted inside all ranges: the {n_shown} nearest are shown"
    panel.set_title(title, fontweight="bold", color=style.RED)
    # Replace the names of parameters in the message by their symbols in the figure.
    message = summary.get("message", "")
    message = re.sub("|".join(SYMBOLS), lambda match: SYMBOLS[match[0]], message)
    style.write_below(figure, message)


def _scatter_places(count: int) -> np.ndarray:
    """Make offsets (count,) from -0.5 to 0.5, the same in each figure.

    The offsets look random, but steps of the golden fraction fill the interval evenly.
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
    """Draw a strip for each free parameter, which shows its range from left to right.

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
        positions = study.parameters.shares(name, solutions[name].to_numpy())
        # Only the first strip adds its labels to the legend.
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
            start, end = study.parameters.shares(name, ends)
            _draw_published_interval(panel, y, start, end, label_prefix)
        _write_range(panel, y, low=low, high=high)
        percent = 100 * (positions.max() - positions.min())
        panel.text(
            FRACTION_X, y, f"{percent:.0f} %", fontsize=style.SMALL_TEXT_PT, va="center"
        )
    panel.text(
        FRACTION_X,
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
    panel.text(-0.01, y - 0.42, f"{low:g}", ha="left", **text_style)
    panel.text(1.01, y - 0.42, f"{high:g}", ha="right", **text_style)


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
    middle = y + 0.03
    panel.barh(y, 1, height=0.62, color=style.STRIP_COLOUR, zorder=0)
    panel.barh(
        middle,
        positions.max() - positions.min(),
        left=positions.min(),
        height=0.40,
        color=style.SKY,
        alpha=0.35,
        zorder=1,
    )
    others = positions[~is_answer]
    panel.scatter(
        others,
        middle + 0.34 * _scatter_places(len(others)),
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
            label=f"{label_prefix}representative, the answer",
            **style.ANSWER_STYLE,
        )


def draw_convergence(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the objective over the generations, with the error of the surrogate.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `history` has rows for some of the generations, with the best and
        the mean objective. `summary` contains the standard errors of the answer's
        predictions, and may be missing.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    history = read_table(inputs["history"], HISTORY_COLUMNS)
    figure = style.new_figure(style.COLUMN, 2.6)
    panel = figure.subplots()
    _draw_objective(panel, history)
    # An objective below the error of the surrogate is not better if it is still
    # smaller.
    if "summary" in inputs:
        summary = read_json(inputs["summary"], ("feasible",))
        errors = summary.get("representative_judged", {}).get("predicted_se")
        if errors:
            _draw_surrogate_error(panel, study, errors)
    if not history["feasible_found"].max():
        panel.set_title("no feasible solution was met", color=style.RED)
    panel.set_xlabel("generation")
    if history["generation"].max() > LINEAR_GENERATIONS:
        panel.set_xscale("log")
    figure.legend(*panel.get_legend_handles_labels(), loc="outside upper center")
    return figure


def _draw_objective(panel: Axes, history: pd.DataFrame) -> None:
    """Draw the objective of the best individual so far, and the mean over all islands.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    history : DataFrame
        Rows for some of the generations, with the columns `HISTORY_COLUMNS`.
    """
    generation = history["generation"].to_numpy()
    mean = history["mean_objective"].to_numpy()
    best = history["best_objective"].to_numpy()
    panel.plot(generation, mean, color=style.SKY, label="mean of all islands")
    panel.plot(generation, best, color=style.BLUE, label="best set so far")
    panel.set_ylabel("objective F\n(widths of the target ranges)")
    lowest = min(best.min(), mean.min())
    highest = max(best.max(), mean.max())
    # A logarithmic axis that spans less than a power of ten might have no ticks.
    if lowest > 0 and highest > 10 * lowest:
        panel.set_yscale("log")


def _draw_surrogate_error(
    panel: Axes, study: StudyView, errors: Mapping[str, float]
) -> None:
    """Draw the objective of a set that misses each target by the surrogate's error.

    Parameters
    ----------
    panel : Axes
        The panel of the objective.
    study : StudyView
        The study, whose targets define the weights and the ranges.
    errors : mapping
        Standard errors of the predicted responses, by name.
    """
    # According to Eq. 11 and 12, the objective is the weighted sum of the deviations,
    # each divided by the width of its target range.
    objective = 0.0
    clauses = []
    for target in study.targets:
        error = errors[target.name]
        objective += target.weight * error / (target.high - target.low)
        clauses.append(
            f"{format_significant(error, 2)} {target.response.unit}".rstrip()
        )
    panel.axhline(
        objective,
        color=style.RED,
        ls="--",
        lw=1.1,
        label=f"F of the surrogate's standard errors ({', '.join(clauses)})",
    )
