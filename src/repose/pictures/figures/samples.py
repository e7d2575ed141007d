"""The design's points, and the simulated responses over them."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.chain.design import METHODS
from repose.core.files import read_table
from repose.core.responses import Response

from . import style
from .registry import Inputs, Shown, figure

INPUTS = {"samples": "design/samples.csv"}
COMPARED = {"comparison": "design/comparison.csv"}


@figure("design", "Design", INPUTS, optional=COMPARED, reads=("parameters", "design.method"))
def design_matrix(inputs: Inputs, study: Shown) -> Figure:
    """Draw every pair of the open parameters, the histogram of each, and a comparison of the methods.

    The design ({design[method]}): every pair of parameters. Each parameter has one sample in each of
    {design[samples]} equal strata of its range.
    """
    free, ranges = study.space.free, study.ranges
    table = read_table(inputs["samples"], free)
    figure = style.new_figure(style.PAGE, style.PAGE)
    for panel, across, down in style.pairs_of_parameters(figure, free):
        if across == down:
            panel.hist(table[across], bins=10, range=ranges[across], color=style.SKY, ec="white")
            panel.set_yticks([])
            panel.spines["left"].set_visible(False)
        else:
            panel.scatter(table[across], table[down], s=4, color=style.BLUE, alpha=0.75, lw=0)
            panel.set_ylim(ranges[down])
        panel.set_xlim(ranges[across])
    text = f"{len(table)} samples: {METHODS[study.design.method]}\ndiagonal: samples in each tenth of a range"
    if len(free) == 1:  # no empty corner to write in
        figure.suptitle(text, fontsize=9)
        return figure
    figure.text(0.56, 0.93, text, fontsize=9, va="top", linespacing=1.5)
    if "comparison" in inputs:
        _compare_methods(figure, read_table(inputs["comparison"], ("method", "min_distance")))
    return figure


def _compare_methods(figure: Figure, comparison: pd.DataFrame) -> None:
    """Draw the bars of the minimum distance of each method, in the empty corner."""
    panel = figure.add_axes((0.70, 0.70, 0.27, 0.10))
    panel.set_in_layout(False)
    names = [METHODS[method] for method in comparison["method"]]
    colours = [style.GREY, style.ORANGE, style.BLUE]
    panel.barh(names, comparison["min_distance"], color=colours[: len(names)], height=0.6)
    for y, value in enumerate(comparison["min_distance"]):
        panel.text(value, y, f" {value:.3f}", va="center", fontsize=7)
    panel.set_xlim(0, 1.25 * comparison["min_distance"].max())
    panel.set_xlabel("minimum distance in the unit cube (–)")
    panel.invert_yaxis()


@figure("dataset", "Responses", {"dataset": "dataset.csv"}, reads=("parameters", "targets"))
def responses_over_parameters(inputs: Inputs, study: Shown) -> Figure:
    """Draw each response over each open parameter; samples that failed are marked below.

    Responses of the samples over each parameter, with their rank correlation. The goji berry's angle falls with the
    friction between berries: such piles pack more loosely, and the same berries need a wider foot (``repose docs
    uncertainty``, Sensitivity).
    """
    responses = study.targets.responses
    free, ranges = study.space.free, study.ranges
    columns = [column for response in responses for column in (response.name, response.error)]
    table = read_table(inputs["dataset"], ("status", *free, *columns))
    figure = style.new_figure(style.PAGE, 0.5 + 1.45 * len(responses))
    panels = figure.subplots(len(responses), len(free), sharex="col", sharey="row", squeeze=False)
    for row, response in zip(panels, responses, strict=True):
        for panel, name in zip(row, free, strict=True):
            _over_parameter(panel, table, name, response)
            panel.set_xlim(ranges[name])
        row[0].set_ylabel(style.response_label(response))
    for panel, name in zip(panels[-1], free, strict=True):
        panel.set_xlabel(style.parameter_label(name), fontsize=8.5)
    figure.supxlabel(_account(table), fontsize=6.8)
    return figure


def _over_parameter(panel: Axes, table: pd.DataFrame, name: str, response: Response) -> None:
    """Draw one response over one parameter; a failed sample is a cross below all values."""
    good, failed = table[table["status"] == "ok"], table[table["status"] != "ok"]
    error = good[response.error].fillna(0.0)
    floor = (good[response.name] - error).min() if len(good) else 0.0
    reach = ((good[response.name] + error).max() - floor) if len(good) else 1.0
    look = {"fmt": "o", "ms": 2, "lw": 0.5, "color": style.BLUE, "alpha": 0.65, "mew": 0}
    panel.errorbar(good[name], good[response.name], yerr=error, **look)
    if len(failed):
        panel.plot(failed[name], np.full(len(failed), floor - 0.1 * reach), "x", ms=3.5, color=style.RED)
    if len(good) > 3:
        rank = good[name].rank().corr(good[response.name].rank())
        panel.set_title(f"ρ = {rank:+.2f}", fontsize=6.8, loc="right", pad=2)


def _account(table: pd.DataFrame) -> str:
    """Say the numbers of samples and of failures, with the reasons, in words."""
    failed = table[table["status"] != "ok"]
    text = "bars: ± 1 standard error over seeds; ρ: rank correlation; "
    if failed.empty:
        return f"{text}all {len(table)} samples gave a result"
    reasons = ", ".join(f"{n} {status}" for status, n in failed["status"].value_counts().sort_index().items())
    return f"{text}{len(failed)} of {len(table)} samples gave no result (×, at the bottom): {reasons}"
