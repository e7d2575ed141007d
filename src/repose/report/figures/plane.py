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

from . import panels, style
from .registry import Inputs, StudyView

# Descriptions in the legend and colours of the tables of samples.
SAMPLES = {
    "dataset": ("parameter sets of the design, simulated", style.BLUE),
    "pool": ("further sets, simulated", style.SKY),
    "fresh": ("sets with many pours each", style.PURPLE),
    "own": ("parameter sets, simulated", style.BLUE),
}
ROW_HEIGHT = 3.1  # of the panels of a pair, in inches
MARGIN = 0.12  # about what an enlarged panel shows, as a share of it
BARS = (
    "a point is the mean of one parameter set's piles; bars: ± 1 standard error of a "
    "mean"
)


class PlaneData(NamedTuple):
    """What the planes show besides the targets.

    `samples` are tables by the names in `SAMPLES`. An answer without simulated
    responses is shown as predicted alone.
    """

    samples: Mapping[str, pd.DataFrame]
    solutions: pd.DataFrame
    answer: pd.Series


def leave_out_profiles(targets: Targets) -> Targets:
    """Leave out the targets that are scores of a profile."""
    return Targets(target for target in targets if target.profile is None)


def planes(inputs: Inputs, study: StudyView) -> Figure:
    """Draw samples, target ranges, solutions and the answer for each pair of targets.

    Parameters
    ----------
    inputs : mapping
        Paths: the samples are the rows of `dataset`, `pool` and `fresh` with the status
        ok, the solutions those of `feasible`, the answer the row of `table4` with its
        role.
    study : StudyView
        The study.
    """
    # Read the samples that could be measured, the solutions, and the answer.
    targets = leave_out_profiles(study.targets)
    sample_columns = ("status", *targets.names, *targets.errors)
    samples = {}
    for key in SAMPLES:
        if key in inputs:
            table = read_table(inputs[key], sample_columns)
            samples[key] = table[table["status"] == "ok"]
    solutions = read_table(inputs["feasible"], ("feasible", *targets.predicted))
    simulated = [target.response.simulated for target in targets]
    checked = read_table(
        inputs["table4"], ("role", *targets.predicted, *simulated, *targets.errors)
    )
    answer = checked[checked["role"] == "representative"].iloc[0]

    n_panels = 2 * math.comb(len(targets), 2)
    figure, axes = panels.grid(n_panels, ROW_HEIGHT, extra_height=1.0)
    draw(axes, targets, data=PlaneData(samples, solutions, answer), legend_title=BARS)
    return figure


def draw(
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
        Samples, solutions and answer.
    legend_title : str
        Title of the legend, which explains the bars.
    """
    pairs = combinations(targets, 2)
    for k, (across, up) in enumerate(pairs):
        # Both panels show the same, within different limits.
        whole, enlarged = axes[2 * k : 2 * k + 2]
        for panel in (whole, enlarged):
            _draw_samples(panel, data.samples, across=across, up=up)
            _draw_targets(panel, across, up)
            _draw_solutions(panel, data.solutions, across=across, up=up)
            _draw_answer(panel, data.answer, across=across, up=up)
        span = _describe_span(data.solutions, across, up)
        enlarged.set_xlabel(f"{enlarged.get_xlabel()}\n{span}")
        enlarged.set_xlim(_compute_axis_limits(across, data.answer))
        enlarged.set_ylim(_compute_axis_limits(up, data.answer))
        whole.set_title(f"{style.panel_letter(2 * k)}   all samples")
        enlarged.set_title(
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

    The limits differ, because the target range is not empty.

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
    values = [
        target.low,
        target.high,
        target.value - target.standard_error,
        target.value + target.standard_error,
        answer[response.predicted],
    ]
    if response.simulated in answer:
        error = answer[response.standard_error]
        values += [
            answer[response.simulated] - error,
            answer[response.simulated] + error,
        ]
    # A single run has no standard error, and its ends are not known.
    known_values = [value for value in values if pd.notna(value)]
    low = min(known_values)
    high = max(known_values)
    margin = MARGIN * (high - low)
    return low - margin, high + margin


def _draw_samples(
    panel: Axes, samples: Mapping[str, pd.DataFrame], across: Target, up: Target
) -> None:
    """Draw the means of the samples with their standard errors.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    samples : mapping
        Tables of samples by the names in `SAMPLES`.
    across, up : Target
        The targets of the x axis and of the y axis.
    """
    for key, table in samples.items():
        description, colour = SAMPLES[key]
        x = table[across.name]
        y = table[up.name]
        panel.errorbar(
            x,
            y,
            xerr=table[across.response.standard_error].fillna(0.0),
            yerr=table[up.response.standard_error].fillna(0.0),
            fmt="none",
            elinewidth=0.4,
            ecolor=colour,
            alpha=0.25,
        )
        label = f"{len(table)} {description}"
        panel.plot(x, y, "o", ms=2.6, mew=0, color=colour, label=label)


def _draw_targets(panel: Axes, across: Target, up: Target) -> None:
    """Draw the target ranges, and the mean of the measured piles with its error.

    `across` and `up` are the targets of the x axis and of the y axis.
    """
    box = Rectangle(
        (across.low, up.low),
        across.high - across.low,
        up.high - up.low,
        fc="none",
        ec=style.GREEN,
        lw=1.4,
        zorder=3,
        label="asked for: target ranges",
    )
    panel.add_patch(box)
    panel.errorbar(
        across.value,
        up.value,
        xerr=across.standard_error,
        yerr=up.standard_error,
        fmt="D",
        ms=8,
        mfc="none",
        color=style.BLACK,
        elinewidth=1.2,
        capsize=3,
        zorder=4,
        label=f"measured ± standard error of {across.repetitions} repetitions",
    )
    panel.set_xlabel(_format_axis_label(across))
    panel.set_ylabel(_format_axis_label(up))


def _format_axis_label(target: Target) -> str:
    """Write the label of an axis, with the name of the response if it has a symbol."""
    response = target.response
    name = "" if response.label == response.symbol else f"{response.label},"
    return style.response_label(response, name)


def _draw_solutions(
    panel: Axes, solutions: pd.DataFrame, across: Target, up: Target
) -> None:
    """Draw the predictions of the solutions of the search.

    `across` and `up` are the targets of the x axis and of the y axis.
    """
    kind = "nearest solutions, none feasible"
    if solutions["feasible"].any():
        kind = "feasible solutions"
    # Above the answer's marks, which would hide most of them
    panel.plot(
        solutions[across.response.predicted],
        solutions[up.response.predicted],
        "o",
        ms=2.6,
        mew=0,
        color=style.ORANGE,
        zorder=8,
        label=f"{len(solutions)} {kind}, predicted",
    )


def _describe_span(solutions: pd.DataFrame, across: Target, up: Target) -> str:
    """Describe between which responses the solutions of the search are predicted.

    `across` and `up` are the targets of the x axis and of the y axis.
    """
    spans = []
    for response in (across.response, up.response):
        values = solutions[response.predicted]
        spans.append(f"{values.min():.2f} to {values.max():.2f} {response.unit}")
    return f"{len(solutions)} solutions: {', '.join(spans)}"


def _draw_answer(panel: Axes, answer: pd.Series, across: Target, up: Target) -> None:
    """Draw the predicted answer, and its simulation if there is one.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    answer : Series
        The answer with its responses. Columns of simulated responses may be missing.
    across, up : Target
        The targets of the x axis and of the y axis.
    """
    x = across.response
    y = up.response
    panel.plot(
        answer[x.predicted],
        answer[y.predicted],
        "s",
        ms=6,
        mfc="none",
        color=style.RED,
        zorder=6,
        label="the answer, predicted",
    )
    if x.simulated not in answer:
        return
    # A mean of a single run has no standard error.
    errors = {}
    if pd.notna(answer[x.standard_error]):
        errors["xerr"] = answer[x.standard_error]
    if pd.notna(answer[y.standard_error]):
        errors["yerr"] = answer[y.standard_error]
    panel.errorbar(
        answer[x.simulated],
        answer[y.simulated],
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
