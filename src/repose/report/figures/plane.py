"""Draw each pair of targets as a plane with samples, target ranges and answer."""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from repose.calibrate.targets import Target, Targets
from repose.common.files import read_table
from repose.stages.tables import find_answer

from . import panels, style
from .registry import Inputs, StudyView

# Description in the legend, and colour, of each table of samples.
SAMPLE_STYLES = {
    "dataset": ("parameter sets of the design, simulated", style.BLUE),
    "pool": ("further sets, simulated", style.SKY),
    "fresh": ("sets with many runs each", style.PURPLE),
    "own": ("parameter sets, simulated", style.BLUE),
}
ROW_HEIGHT = 3.1  # of the panels of a pair, in inches
# Margin around the data of an enlarged panel, as a fraction of the extent of these data
ENLARGED_MARGIN_FRACTION = 0.12
BARS_NOTE = (
    "a point is the mean of one parameter set's piles; bars: ± 1 standard error of a "
    "mean"
)


class PlaneData(NamedTuple):
    """The data that the planes show besides the targets."""

    samples: Mapping[str, pd.DataFrame]  # tables by the names in `SAMPLE_STYLES`
    solutions: pd.DataFrame  # a row for each solution of the search
    answer: pd.Series  # predicted responses, and simulated ones if there are any


def leave_out_profiles(targets: Targets) -> Targets:
    """Return the targets without those that are scores of a profile."""
    return Targets(target for target in targets if target.profile is None)


def draw_planes(inputs: Inputs, study: StudyView) -> Figure:
    """Draw samples, target ranges, solutions and the answer for each pair of targets.

    A plane is a diagram of one response over another.

    Parameters
    ----------
    inputs : mapping
        Paths by name. The samples are the rows with the status ok of up to three
        tables: `dataset` has the samples of the design, `pool` further ones, and
        `fresh` samples with many runs each. `feasible` has the solutions that the
        search found. `table4` has the parameter sets that were simulated again. That
        with the role `representative` is the answer.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    # Read the samples that could be measured, the solutions, and the answer.
    targets = leave_out_profiles(study.targets)
    sample_columns = ("status", *targets.names, *targets.errors)
    samples = {}
    for key in SAMPLE_STYLES:
        if key in inputs:
            table = read_table(inputs[key], sample_columns)
            samples[key] = table[table["status"] == "ok"]
    solutions = read_table(inputs["feasible"], ("feasible", *targets.predicted))
    simulated = [target.response.simulated for target in targets]
    checked = read_table(
        inputs["table4"], ("role", *targets.predicted, *simulated, *targets.errors)
    )
    answer = find_answer(checked, source=inputs["table4"])

    # Each pair has two panels: all samples, and the target ranges enlarged.
    n_panels = 2 * math.comb(len(targets), 2)
    figure, axes = panels.grid(n_panels, ROW_HEIGHT, extra_height=1.0)
    draw_pairs_of_targets(
        axes,
        targets,
        data=PlaneData(samples, solutions, answer),
        legend_title=BARS_NOTE,
    )
    return figure


def draw_pairs_of_targets(
    axes: Sequence[Axes], targets: Targets, data: PlaneData, legend_title: str
) -> None:
    """Draw two panels for each pair of targets: all samples, and the ranges enlarged.

    Parameters
    ----------
    axes : sequence of Axes
        The panels, two for each pair.
    targets : Targets
        The targets.
    data : PlaneData
        The samples, the solutions that the search found, and the answer, which is the
        solution that the study reports.
    legend_title : str
        Title of the legend, which explains the error bars.
    """
    # Two consecutive panels belong to a pair of targets. Both show the same data within
    # different limits.
    for k, (x_target, y_target) in enumerate(combinations(targets, 2)):
        whole_panel = axes[2 * k]
        enlarged_panel = axes[2 * k + 1]
        for panel in (whole_panel, enlarged_panel):
            _draw_samples(panel, data.samples, x_target=x_target, y_target=y_target)
            _draw_targets(panel, x_target=x_target, y_target=y_target)
            _draw_solutions(panel, data.solutions, x_target=x_target, y_target=y_target)
            _draw_answer(panel, data.answer, x_target=x_target, y_target=y_target)
        span_text = _describe_span(data.solutions, x_target, y_target)
        enlarged_panel.set_xlabel(f"{enlarged_panel.get_xlabel()}\n{span_text}")
        enlarged_panel.set_xlim(_compute_axis_limits(x_target, data.answer))
        enlarged_panel.set_ylim(_compute_axis_limits(y_target, data.answer))
        whole_panel.set_title(f"{style.panel_letter(2 * k)}   all samples")
        enlarged_panel.set_title(
            f"{style.panel_letter(2 * k + 1)}   the target ranges, enlarged"
        )
    style.draw_legend(
        axes,
        loc="outside lower center",
        ncols=2,
        title=legend_title,
        title_fontsize=style.SMALL_TEXT_PT,
    )


def _compute_axis_limits(target: Target, answer: pd.Series) -> tuple[float, float]:
    """Compute the limits of an axis that shows the target range and the answer.

    Parameters
    ----------
    target : Target
        The target of the axis.
    answer : Series
        The answer with its predicted response and, if it was simulated again, the
        simulated response with its standard error.

    Returns
    -------
    tuple of float
        The lower and the upper limit, with a margin.
    """
    response = target.response
    shown_values = [
        target.low,
        target.high,
        target.value - target.standard_error,
        target.value + target.standard_error,
        answer[response.predicted],
    ]
    if response.simulated in answer:
        error = answer[response.standard_error]
        shown_values += [
            answer[response.simulated] - error,
            answer[response.simulated] + error,
        ]
    # The mean of a single run has no standard error, so two of the values may be NaN.
    known_values = [value for value in shown_values if pd.notna(value)]
    low = min(known_values)
    high = max(known_values)
    margin = ENLARGED_MARGIN_FRACTION * (high - low)
    return low - margin, high + margin


def _draw_samples(
    panel: Axes, samples: Mapping[str, pd.DataFrame], x_target: Target, y_target: Target
) -> None:
    """Draw the means of the samples with their standard errors.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    samples : mapping
        Tables of samples by the names in `SAMPLE_STYLES`.
    x_target, y_target : Target
        The targets of the x axis and of the y axis.
    """
    for key, table in samples.items():
        description, colour = SAMPLE_STYLES[key]
        x = table[x_target.name]
        y = table[y_target.name]
        panel.errorbar(
            x,
            y,
            xerr=table[x_target.response.standard_error].fillna(0.0),
            yerr=table[y_target.response.standard_error].fillna(0.0),
            fmt="none",
            elinewidth=0.4,
            ecolor=colour,
            alpha=0.25,
        )
        label = f"{len(table)} {description}"
        panel.plot(x, y, "o", ms=2.6, mew=0, color=colour, label=label)


def _draw_targets(panel: Axes, x_target: Target, y_target: Target) -> None:
    """Draw the target ranges, and the mean of the measured piles with its error.

    `x_target` and `y_target` are the targets of the x axis and of the y axis.
    """
    box = Rectangle(
        (x_target.low, y_target.low),
        x_target.high - x_target.low,
        y_target.high - y_target.low,
        fc="none",
        ec=style.GREEN,
        lw=1.4,
        zorder=3,
        label="target ranges",
    )
    panel.add_patch(box)
    panel.errorbar(
        x_target.value,
        y_target.value,
        xerr=x_target.standard_error,
        yerr=y_target.standard_error,
        fmt="D",
        ms=8,
        mfc="none",
        color=style.BLACK,
        elinewidth=1.2,
        capsize=3,
        zorder=4,
        label=f"measured ± standard error of {x_target.repetitions} repetitions",
    )
    panel.set_xlabel(_format_axis_label(x_target))
    panel.set_ylabel(_format_axis_label(y_target))


def _format_axis_label(target: Target) -> str:
    """Write the label of an axis, with the name of the response if it has a symbol."""
    response = target.response
    name = "" if response.label == response.symbol else f"{response.label},"
    return style.response_label(response, name)


def _draw_solutions(
    panel: Axes, solutions: pd.DataFrame, x_target: Target, y_target: Target
) -> None:
    """Draw the predictions of the solutions of the search.

    `x_target` and `y_target` are the targets of the x axis and of the y axis.
    """
    kind = "nearest solutions, none feasible"
    if solutions["feasible"].any():
        kind = "feasible solutions"
    # Draw the solutions above the marks of the answer, which would hide most of them.
    panel.plot(
        solutions[x_target.response.predicted],
        solutions[y_target.response.predicted],
        "o",
        ms=2.6,
        mew=0,
        color=style.ORANGE,
        zorder=8,
        label=f"{len(solutions)} {kind}, predicted",
    )


def _describe_span(solutions: pd.DataFrame, x_target: Target, y_target: Target) -> str:
    """Describe the range of the predicted responses of the search's solutions.

    Parameters
    ----------
    solutions : DataFrame
        A row for each solution, with its predicted responses.
    x_target, y_target : Target
        The targets of the x axis and of the y axis.

    Returns
    -------
    str
        The range of each response.
    """
    spans = []
    for response in (x_target.response, y_target.response):
        values = solutions[response.predicted]
        spans.append(f"{values.min():.2f} to {values.max():.2f} {response.unit}")
    return f"{len(solutions)} solutions: {', '.join(spans)}"


def _draw_answer(
    panel: Axes, answer: pd.Series, x_target: Target, y_target: Target
) -> None:
    """Draw the predicted responses of the answer, and the simulated ones if known.

    The answer is the parameter set that the study reports.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    answer : Series
        The answer with its responses. If it was not simulated again, all columns of
        simulated responses and of their standard errors are missing.
    x_target, y_target : Target
        The targets of the x axis and of the y axis.
    """
    x_response = x_target.response
    y_response = y_target.response
    panel.plot(
        answer[x_response.predicted],
        answer[y_response.predicted],
        "s",
        ms=6,
        mfc="none",
        color=style.RED,
        zorder=6,
        label="the answer, predicted",
    )
    if x_response.simulated not in answer:
        return
    # A mean of a single run has no standard error.
    errors = {}
    if pd.notna(answer[x_response.standard_error]):
        errors["xerr"] = answer[x_response.standard_error]
    if pd.notna(answer[y_response.standard_error]):
        errors["yerr"] = answer[y_response.standard_error]
    panel.errorbar(
        answer[x_response.simulated],
        answer[y_response.simulated],
        **errors,
        fmt="s",
        ms=4.5,
        color=style.RED,
        mec="white",
        elinewidth=1.4,
        capsize=3,
        zorder=7,
        label="the answer, simulated",
    )
