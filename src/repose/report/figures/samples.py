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

N_BINS = 10  # of the histogram of a parameter
# Upper left corner of the text, in the empty half above the diagonal, as fractions of
# the figure
TEXT_POSITION = (0.56, 0.93)
# Colours of the bars that compare the design methods, from top to bottom
METHOD_COLOURS = (style.GREY, style.ORANGE, style.BLUE)
# Distance of the crosses of failed samples below all values, as a fraction of their
# range
CROSS_DISTANCE = 0.1
# Smallest number of good samples for which a rank correlation is written.
MIN_CORRELATED = 4
# Left edge, lower edge, width and height of the comparison of methods, as fractions of
# the figure.
COMPARISON_BOX = (0.70, 0.70, 0.27, 0.10)
# Largest number of characters in a line of the note below a figure.
NOTE_CHARACTERS = 120


def draw_design(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the samples of the design: each pair of free parameters, and each alone.

    If there are at least two parameters, bars compare the design with those of other
    methods.

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
                bins=compute_cell_edges(study.parameters, x_name, N_BINS),
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
        # A figure with a single panel has no empty corner for the text and for the
        # comparison, so leave out the comparison.
        figure.suptitle(text, fontsize=9)
        return figure
    figure.text(*TEXT_POSITION, text, fontsize=9, va="top", linespacing=1.5)
    if "comparison" in inputs:
        comparison = read_table(inputs["comparison"], ("method", "min_distance"))
        _compare_methods(figure, comparison)
    return figure


def _describe_design(study: StudyView, n_samples: int) -> str:
    """Describe how the samples were chosen, and what the histograms show.

    If there are constraints, the samples are the allowed part of a larger design. This
    part fills the allowed region evenly. But each parameter alone is no longer spread
    evenly over its range, as in a Latin hypercube.

    Parameters
    ----------
    study : StudyView
        The study.
    n_samples : int
        Number of samples.

    Returns
    -------
    str
        The description in two or three lines.
    """
    method = METHOD_LABELS[study.settings.design.method]
    histograms = "diagonal: samples in each tenth of a range"
    constraints = study.parameters.constraints
    if not constraints:
        return f"{n_samples} samples: {method}\n{histograms}"
    constraint_texts = "; ".join(constraint.text for constraint in constraints)
    return (
        f"{n_samples} samples: the allowed part of a larger {method}\n"
        f"{histograms}\n"
        f"spread evenly over {constraint_texts}; not a Latin hypercube"
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
    # Beyond the last colour, matplotlib would repeat the first one.
    colours = METHOD_COLOURS[: len(names)]
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
    figure.supxlabel(_explain_marks_and_failures(table), fontsize=style.SMALL_TEXT_PT)
    return figure


def _draw_response(
    panel: Axes, table: pd.DataFrame, name: str, response: Response
) -> None:
    """Draw one response over one parameter, with error bars and a rank correlation.

    Failed samples have no response. They are crosses below all values.

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
    values = good[response.name]
    errors = good[response.standard_error].fillna(0.0)  # no bar if it is unknown
    panel.errorbar(
        good[name],
        values,
        yerr=errors,
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
            bottom = (values - errors).min()
            top = (values + errors).max()
        y = bottom - CROSS_DISTANCE * (top - bottom)
        panel.plot(failed[name], np.full(len(failed), y), "x", ms=3.5, color=style.RED)
    if len(good) >= MIN_CORRELATED:
        # Spearman's correlation is that of the ranks.
        correlation = good[name].rank().corr(values.rank())
        panel.set_title(
            f"ρ = {correlation:+.2f}", fontsize=style.SMALL_TEXT_PT, loc="right", pad=2
        )


def _explain_marks_and_failures(table: pd.DataFrame) -> str:
    """Explain the bars and numbers of the figure, and describe the failed samples."""
    explanation = "bars: ± 1 standard error over seeds; ρ: rank correlation"
    failed = table[table["status"] != "ok"]
    if failed.empty:
        # This is short enough for one line.
        return f"{explanation}; all {len(table)} samples gave a result"
    reasons = describe_failures(failed["status"].value_counts().to_dict(), "failed")
    text = (
        f"{explanation}; {len(failed)} of {len(table)} samples gave no result (×, at "
        f"the bottom): {reasons}"
    )
    return textwrap.fill(text, NOTE_CHARACTERS)
