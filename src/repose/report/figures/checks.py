"""Draw the check: our solutions (Table 4), and published solutions simulated here."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.responses import name_derived_column
from repose.calibrate.targets import Target
from repose.common.files import read_table
from repose.stages.published import STALE_WARNING, find_published_responses

from . import panels, style
from .registry import Inputs, StudyView

PUBLISHED_PREFIX = "P"  # of the numbers of published solutions
PANEL_HEIGHT = 2.3  # of the published solutions, in inches
# Distance of each of the two marks of a solution from its tick, to the left or right.
MARK_OFFSET = 0.12
ROOM_FOR_NOTE = 0.15  # at the lower edge, as a fraction of a panel's height
ERROR_BAR_STYLE = {"ms": 4.5, "elinewidth": 1, "capsize": 2}
SIMULATION_STYLE = ERROR_BAR_STYLE | {
    "fmt": "s",
    "color": style.BLUE,
    "label": "simulated here ± standard error over seeds",
}
PUBLISHED_SIMULATION_STYLE = ERROR_BAR_STYLE | {
    "fmt": "D",
    "color": style.ORANGE,
    "mfc": "white",
    "label": "published simulation",
}
PUBLISHED_MEASUREMENT_STYLE = PUBLISHED_SIMULATION_STYLE | {
    "mfc": style.ORANGE,
    "label": "published measurement",
}


def draw_validation(inputs: Inputs, study: StudyView) -> Figure:
    """Draw predicted and simulated responses of our solutions and of published ones.

    There is a row of panels for each target, with our solutions on the left and the
    published ones on the right.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `table4` contains our solutions. `published` contains the
        published solutions, and may be missing.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    simulated = [target.response.simulated for target in targets]
    solutions = read_table(
        inputs["table4"], ("solution", *targets.predicted, *simulated)
    )
    published = pd.DataFrame()
    if "published" in inputs:
        published = read_table(inputs["published"], ("solution",))
    published_of_targets = find_published_responses(
        published.columns, targets.responses
    )

    # The right column shows the published solutions, if there are any.
    # The left column is a little wider, because it also has the labels of the y axes.
    widths = (1.15, 1) if published_of_targets else (1,)
    figure = style.new_figure(style.PAGE, 0.6 + 1.9 * len(targets))
    axes = figure.subplots(
        len(targets), len(widths), sharey="row", squeeze=False, width_ratios=widths
    )
    named_solutions = _add_names(solutions)
    for panel, target in zip(axes[:, 0], targets, strict=True):
        _draw_predicted_and_simulated(
            panel, named_solutions, target=target, error_bar_style=SIMULATION_STYLE
        )
        panel.set_ylabel(style.response_label(target.response))
    axes[0, 0].set_title("this run", fontweight="bold")
    axes[-1, 0].set_xlabel("solution of this run")
    if published_of_targets:
        named_published = _add_names(published, PUBLISHED_PREFIX)
        for panel, target in zip(axes[:, 1], targets, strict=True):
            if target.response in published_of_targets:
                _draw_predicted_and_simulated(
                    panel,
                    named_published,
                    target=target,
                    error_bar_style=PUBLISHED_SIMULATION_STYLE,
                )
            else:
                _explain_empty_panel(panel, "not published")
        axes[0, 1].set_title("published", fontweight="bold")
        axes[-1, 1].set_xlabel("published solution (P)")
    figure.align_xlabels(axes[-1])
    style.draw_legend(axes.ravel(), loc="outside upper center", ncols=3)
    style.write_below(
        figure, "percentages: error of the prediction, of the simulated value"
    )
    return figure


def _explain_empty_panel(panel: Axes, text: str) -> None:
    """Write the reason why a panel is empty in its middle."""
    panel.axis("off")
    style.write_note(panel, text, x=0.5, y=0.5, ha="center", color=style.GREY)


def draw_published_solutions(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the responses of published solutions: published values, and our simulations.

    Parameters
    ----------
    inputs : mapping
        Path of the table `published`, which has a row for each solution.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    table = _add_names(read_table(inputs["published"], ("solution",)), PUBLISHED_PREFIX)
    targets = [target for target in study.targets if target.response.simulated in table]
    figure, axes = panels.grid(len(targets), PANEL_HEIGHT, extra_height=0.3)
    for panel, target in zip(axes, targets, strict=True):
        _draw_published_and_simulated(panel, table, target)
    style.label_panels(axes)
    # The optional column `stale` says which results come from other settings.
    if "stale" in table and table["stale"].any():
        figure.suptitle(STALE_WARNING, fontsize=style.SMALL_TEXT_PT, color=style.RED)
    style.draw_legend(axes, loc="outside lower center", ncols=2)
    return figure


def _draw_published_and_simulated(
    panel: Axes, table: pd.DataFrame, target: Target
) -> None:
    """Draw one response of each published solution, with our own simulation beside it.

    Published values are to the left of a solution's tick, and ours to the right.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        A row for each solution, with its published values and our simulated mean.
    target : Target
        The target of the response.
    """
    response = target.response
    x = np.arange(len(table))
    _draw_measurement(panel, table, target)
    unpublished_x = _draw_published_values(panel, table, target)
    our_simulation = table[response.simulated]
    error = table[response.standard_error].fillna(0.0)  # unknown: no error bar
    panel.errorbar(x + MARK_OFFSET, our_simulation, error, **SIMULATION_STYLE)
    panel.set(ylabel=style.response_label(response), xlabel="published solution (P)")
    panel.margins(y=0.15)
    # This enlarges the panel, so everything else must be drawn before.
    _write_below(panel, unpublished_x, "not\npublished")


def _draw_published_values(
    panel: Axes, table: pd.DataFrame, target: Target
) -> np.ndarray:
    """Draw the values of one response that the publications give.

    A publication may give the result of its simulation, that of its measurement, or
    both.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        A row for each solution. If the table has no column for published simulations of
        this response, nothing is drawn.
    target : Target
        The target of the response.

    Returns
    -------
    ndarray
        Ticks of the solutions without a published value. They are empty if nothing is
        drawn.
    """
    simulation_column = name_derived_column(target.name, "published_simulated")
    measurement_column = name_derived_column(target.name, "published_measured")
    if simulation_column not in table:
        return np.empty(0)
    x = np.arange(len(table))
    simulations = table[simulation_column]
    no_measurements = pd.Series(np.nan, table.index)
    measurements = table.get(measurement_column, no_measurements)
    panel.errorbar(x - MARK_OFFSET, simulations, **PUBLISHED_SIMULATION_STYLE)
    if measurements.notna().any():
        panel.errorbar(x - MARK_OFFSET, measurements, **PUBLISHED_MEASUREMENT_STYLE)
    return x[simulations.isna() & measurements.isna()]


def _draw_predicted_and_simulated(
    panel: Axes, table: pd.DataFrame, target: Target, error_bar_style: Mapping[str, Any]
) -> None:
    """Draw the predicted and the simulated value of one response for each solution.

    The error of the prediction, in percent of the simulated value, is written below
    them.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        A row for each solution, with its name and its predicted and simulated
        responses.
    target : Target
        The target of the response.
    error_bar_style : mapping
        Style of the simulated values, for matplotlib's `errorbar`.
    """
    # Draw predictions to the left of a tick, and simulated values to the right.
    response = target.response
    x = np.arange(len(table))
    _draw_measurement(panel, table, target)
    predicted = table[response.predicted].to_numpy(float)
    simulated = table[response.simulated].to_numpy(float)
    # Published tables have no standard errors. A single run has none either, and gets
    # no error bar.
    standard_error = None
    if response.standard_error in table:
        standard_error = table[response.standard_error].fillna(0.0)
    panel.plot(
        x - MARK_OFFSET,
        predicted,
        "o",
        ms=4.5,
        mfc="white",
        color=style.BLACK,
        label="predicted",
    )
    panel.errorbar(x + MARK_OFFSET, simulated, standard_error, **error_bar_style)

    # Write the error of each prediction below both marks and the error bar.
    bar_ends = simulated
    if standard_error is not None:
        bar_ends = simulated - standard_error.to_numpy(float)
    # A solution without a simulated value has NaN here, which `fmin` ignores.
    lowest = np.fmin(predicted, bar_ends)
    _write_prediction_errors(panel, predicted, simulated, lowest)
    panel.margins(y=0.25)
    _write_below(panel, x[~np.isfinite(simulated)], "not\nsimulated")


def _write_prediction_errors(
    panel: Axes, predicted: np.ndarray, simulated: np.ndarray, lowest: np.ndarray
) -> None:
    """Write the error of each prediction in percent of the simulated value.

    Parameters
    ----------
    panel : Axes
        The panel to write in.
    predicted, simulated : ndarray
        Responses (n,) of the solutions. For a solution without a simulated value, or
        with the value 0, no error is written.
    lowest : ndarray
        Heights (n,) in the panel below which the errors are written.
    """
    values = zip(predicted, simulated, lowest, strict=True)
    for tick, (prediction, simulation, low) in enumerate(values):
        if not np.isfinite(simulation) or simulation == 0:
            continue
        percent = 100 * abs((prediction - simulation) / simulation)
        panel.annotate(
            f"{percent:.1f} %",
            (tick, low),
            xytext=(0, -7),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=6.3,
            color=style.GREY,
        )


def _write_below(panel: Axes, ticks: np.ndarray, text: str) -> None:
    """Write the same short note at some ticks of a panel, below everything else.

    Parameters
    ----------
    panel : Axes
        The panel. If there are any ticks, it is enlarged at its lower edge.
    ticks : ndarray
        Positions (n,) of these ticks on the x axis.
    text : str
        The note.
    """
    if len(ticks):
        bottom, top = panel.get_ylim()
        panel.set_ylim(bottom - ROOM_FOR_NOTE * (top - bottom), top)
    for tick in ticks:
        panel.text(
            tick,
            0.02,
            text,
            transform=panel.get_xaxis_transform(),
            ha="center",
            va="bottom",
            fontsize=style.SMALL_TEXT_PT,
            color=style.GREY,
        )


def _draw_measurement(panel: Axes, table: pd.DataFrame, target: Target) -> None:
    """Draw the target range and the measured mean, and name the solutions.

    The solution of row k has its tick at x = k.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        A row for each solution, with its name.
    target : Target
        The target.
    """
    style.draw_band(panel, target.low, high=target.high, label="target range")
    error = target.standard_error
    panel.axhspan(
        target.value - error,
        target.value + error,
        color=style.GREEN,
        alpha=0.25,
        lw=0,
        label="measured mean ± standard error",
    )
    panel.axhline(target.value, color=style.GREEN, lw=0.9)
    panel.set_xticks(range(len(table)), table["name"])
    panel.set_xlim(-0.6, len(table) - 0.4)


def _add_names(table: pd.DataFrame, prefix: str = "") -> pd.DataFrame:
    """Add names of the solutions for an axis, and sort the solutions.

    The answer comes first, followed by the other solutions by number, and then by those
    without a number.

    Parameters
    ----------
    table : DataFrame
        A row for each solution.
    prefix : str
        Prefix of each name, such as P for published solutions.

    Returns
    -------
    DataFrame
        The sorted rows with the columns `name` and `number`.
    """
    is_answer = table.get("role", table["solution"]) == "representative"
    names = [
        _name_solution(str(solution), is_answer=answer, prefix=prefix)
        for solution, answer in zip(table["solution"], is_answer, strict=True)
    ]
    number = pd.to_numeric(table["solution"], errors="coerce").mask(is_answer, -1)
    named = table.assign(name=names, number=number)
    return named.sort_values("number", kind="stable", ignore_index=True)


def _name_solution(solution: str, is_answer: bool, prefix: str) -> str:
    """Name a solution on an axis.

    Parameters
    ----------
    solution : str
        Its number, or the first author and the year of a publication, as in `yu_2022`.
    is_answer : bool
        Whether the solution is the answer.
    prefix : str
        Prefix of the number.

    Returns
    -------
    str
        The name, which may have two lines.
    """
    if is_answer:
        number = solution.removeprefix("representative")
        return f"{prefix}{number}\n(answer)"
    if solution.isdigit():
        return f"{prefix}{solution}"
    return solution.replace("_", " et al.\n").capitalize()
