"""Draw the points of the design, and the simulated responses at these points."""

import textwrap

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.designs.latin_hypercube import METHOD_LABELS
from repose.calibrate.responses import Response
from repose.common.files import read_table
from repose.common.statuses import describe_failures
from repose.report.study_view import compute_cell_edges

from . import panels, style
from .registry import Inputs, StudyView

# Smallest number of good samples for which a rank correlation is written.
MIN_CORRELATED = 4
# Left edge, lower edge, width and height of the comparison of methods, as fractions of
# the figure.
COMPARISON_BOX = (0.70, 0.70, 0.27, 0.10)
# Largest number of characters in a line of the note below a figure.
NOTE_CHARACTERS = 120


def draw_design_matrix(inputs: Inputs, study: StudyView) -> Figure:
    """Draw every pair of free parameters, the histogram of each, and a comparison.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `samples` has a column for each parameter. `comparison` contains
        the smallest distance between two samples for each design method, and may be
        missing.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    names = study.parameters.free
    samples = read_table(inputs["samples"], names)
    figure = style.new_figure(style.PAGE, style.PAGE)
    pair_panels = panels.add_pair_panels(figure, study.parameters)
    for panel, x_name, y_name in pair_panels:
        if x_name == y_name:
            panel.hist(
                samples[x_name],
                bins=compute_cell_edges(study.parameters, x_name, 10),
                color=style.SKY,
                ec="white",
            )
        else:
            panel.scatter(
                samples[x_name],
                samples[y_name],
                s=4,
                color=style.BLUE,
                alpha=0.75,
                lw=0,
            )
    panels.finish_pair_panels(pair_panels, study.parameters)

    text = _describe_design(study, len(samples))
    if len(names) == 1:
        # A figure with a single panel has no empty corner for the text.
        figure.suptitle(text, fontsize=9)
        return figure
    figure.text(0.56, 0.93, text, fontsize=9, va="top", linespacing=1.5)
    if "comparison" in inputs:
        comparison = read_table(inputs["comparison"], ("method", "min_distance"))
        _compare_methods(figure, comparison)
    return figure


def _describe_design(study: StudyView, n_samples: int) -> str:
    """Describe the method of the design and the histograms in several lines.

    If there are constraints, the design is the allowed part of a larger design.
    """
    method = METHOD_LABELS[study.settings.design.method]
    histograms = "diagonal: samples in each tenth of a range"
    constraints = study.parameters.constraints
    if not constraints:
        return f"{n_samples} samples: {method}\n{histograms}"
    rules = "; ".join(constraint.text for constraint in constraints)
    return (
        f"{n_samples} samples: the allowed part of a larger {method}\n"
        f"{histograms}\n"
        f"spread evenly over {rules}; not a Latin hypercube"
    )


def _compare_methods(figure: Figure, comparison: pd.DataFrame) -> None:
    """Draw the smallest distance between two samples for each method as bars.

    Parameters
    ----------
    figure : Figure
        The figure. The bars are drawn in its upper right corner, which is empty.
    comparison : DataFrame
        A row for each method, with its smallest distance.
    """
    panel = figure.add_axes(COMPARISON_BOX)
    # Keep the layout from moving the panels of the parameters to make room for it.
    panel.set_in_layout(False)
    names = [METHOD_LABELS[method] for method in comparison["method"]]
    distances = comparison["min_distance"]
    colours = [style.GREY, style.ORANGE, style.BLUE][: len(names)]
    panel.barh(names, distances, color=colours, height=0.6)
    for y, distance in enumerate(distances):
        panel.text(distance, y, f" {distance:.3f}", va="center", fontsize=7)
    panel.set(
        xlim=(0, 1.25 * distances.max()), xlabel="minimum distance in the unit cube (–)"
    )
    panel.invert_yaxis()


def draw_responses_over_parameters(inputs: Inputs, study: StudyView) -> Figure:
    """Draw each response over each free parameter; samples that failed are marked.

    Parameters
    ----------
    inputs : mapping
        Path of the `dataset`, which has a row for each sample with its status, its
        parameters, its responses and their standard errors.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    parameters = study.parameters
    table = read_table(
        inputs["dataset"],
        ("status", *parameters.free, *targets.names, *targets.errors),
    )
    figure, parameter_panels = panels.make_parameter_panels(targets, parameters, 1.45)
    for panel, target, name in parameter_panels:
        _draw_response(panel, table, name=name, response=target.response)
    figure.supxlabel(_describe_failed_samples(table), fontsize=style.SMALL_TEXT_PT)
    return figure


def _draw_response(
    panel: Axes, table: pd.DataFrame, name: str, response: Response
) -> None:
    """Draw one response over one parameter, and failed samples as crosses below it.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    table : DataFrame
        A row for each sample.
    name : str
        Name of the parameter.
    response : Response
        The response.
    """
    is_good = table["status"] == "ok"
    good = table[is_good]
    failed = table[~is_good]
    value = good[response.name]
    error = good[response.standard_error].fillna(0.0)
    panel.errorbar(
        good[name],
        value,
        yerr=error,
        fmt="o",
        ms=2,
        lw=0.5,
        color=style.BLUE,
        alpha=0.65,
        mew=0,
    )
    if len(failed):
        # If no sample is good, there are no values, so use an arbitrary range.
        bottom = 0.0
        top = 1.0
        if len(good):
            bottom = (value - error).min()
            top = (value + error).max()
        # Place the crosses below all values, by a tenth of their range.
        y = bottom - 0.1 * (top - bottom)
        panel.plot(failed[name], np.full(len(failed), y), "x", ms=3.5, color=style.RED)
    if len(good) >= MIN_CORRELATED:
        correlation = good[name].rank().corr(value.rank())
        panel.set_title(
            f"ρ = {correlation:+.2f}", fontsize=style.SMALL_TEXT_PT, loc="right", pad=2
        )


def _describe_failed_samples(table: pd.DataFrame) -> str:
    """Describe how many samples failed, and why."""
    explanation = "bars: ± 1 standard error over seeds; ρ: rank correlation"
    failed = table[table["status"] != "ok"]
    if failed.empty:
        return f"{explanation}; all {len(table)} samples gave a result"
    reasons = describe_failures(failed["status"].value_counts().to_dict(), "failed")
    note = (
        f"{explanation}; {len(failed)} of {len(table)} samples gave no result (×, at "
        f"the bottom): {reasons}"
    )
    return textwrap.fill(note, NOTE_CHARACTERS)
