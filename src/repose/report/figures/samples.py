"""The design's points, and the simulated responses over them."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.designs.latin_hypercube import METHODS
from repose.calibrate.responses import Response
from repose.common.files import read_table

from . import style
from .registry import Inputs, Shown, figure

INPUTS = {"samples": "design/samples.csv"}
COMPARED = {"comparison": "design/comparison.csv"}


@figure(
    "design", "Design", INPUTS, optional=COMPARED, reads=("parameters", "design.method")
)
def design_matrix(inputs: Inputs, study: Shown) -> Figure:
    """Draw every pair of the open parameters, the histogram of each, and a comparison of the methods.

    The design ({design[method]}): every pair of parameters. Each parameter has one sample in each of
    {design[samples]} equal strata of its range.
    """
    free = study.space.free
    table = read_table(inputs["samples"], free)
    figure = style.new_figure(style.PAGE, style.PAGE)
    for panel, across, down in style.pairs_of_parameters(figure, study):
        if across == down:
            panel.hist(
                table[across],
                bins=10,
                range=study.ranges[across],
                color=style.SKY,
                ec="white",
            )
        else:
            panel.scatter(
                table[across], table[down], s=4, color=style.BLUE, alpha=0.75, lw=0
            )
    text = f"{len(table)} samples: {METHODS[study.design.method]}\ndiagonal: samples in each tenth of a range"
    if len(free) == 1:  # no empty corner to write in
        figure.suptitle(text, fontsize=9)
        return figure
    figure.text(0.56, 0.93, text, fontsize=9, va="top", linespacing=1.5)
    if "comparison" in inputs:
        _compare_methods(
            figure, read_table(inputs["comparison"], ("method", "min_distance"))
        )
    return figure


def _compare_methods(figure: Figure, comparison: pd.DataFrame) -> None:
    """Draw the bars of the minimum distance of each method, in the empty corner."""
    panel = figure.add_axes((0.70, 0.70, 0.27, 0.10))
    panel.set_in_layout(False)
    names, distances = (
        [METHODS[method] for method in comparison["method"]],
        comparison["min_distance"],
    )
    panel.barh(
        names,
        distances,
        color=[style.GREY, style.ORANGE, style.BLUE][: len(names)],
        height=0.6,
    )
    for y, value in enumerate(distances):
        panel.text(value, y, f" {value:.3f}", va="center", fontsize=7)
    panel.set(
        xlim=(0, 1.25 * distances.max()), xlabel="minimum distance in the unit cube (–)"
    )
    panel.invert_yaxis()


@figure(
    "dataset", "Responses", {"dataset": "dataset.csv"}, reads=("parameters", "targets")
)
def responses_over_parameters(inputs: Inputs, study: Shown) -> Figure:
    """Draw each response over each open parameter; samples that failed are marked below.

    Responses of the samples over each parameter, with their rank correlation. The goji berry's angle falls with the
    friction between berries: such piles pack more loosely, and the same berries need a wider foot (``repose docs
    uncertainty``, Sensitivity).
    """
    targets = study.targets
    table = read_table(
        inputs["dataset"],
        ("status", *study.space.free, *targets.names, *targets.errors),
    )
    figure, panels = style.over_parameters(study, 1.45)
    for panel, target, name in panels:
        _over_parameter(panel, table, name, target.response)
    figure.supxlabel(_account(table), fontsize=6.8)
    return figure


def _over_parameter(
    panel: Axes, table: pd.DataFrame, name: str, response: Response
) -> None:
    """Draw one response over one parameter; a failed sample is a cross below all values."""
    good, failed = table[table["status"] == "ok"], table[table["status"] != "ok"]
    value, error = good[response.name], good[response.error].fillna(0.0)
    floor, top = (
        ((value - error).min(), (value + error).max()) if len(good) else (0.0, 1.0)
    )
    look = {
        "fmt": "o",
        "ms": 2,
        "lw": 0.5,
        "color": style.BLUE,
        "alpha": 0.65,
        "mew": 0,
    }
    panel.errorbar(good[name], value, yerr=error, **look)
    if len(failed):
        panel.plot(
            failed[name],
            np.full(len(failed), floor - 0.1 * (top - floor)),
            "x",
            ms=3.5,
            color=style.RED,
        )
    if len(good) > 3:
        rank = good[name].rank().corr(value.rank())
        panel.set_title(f"ρ = {rank:+.2f}", fontsize=6.8, loc="right", pad=2)


def _account(table: pd.DataFrame) -> str:
    """Say the numbers of samples and of failures, with the reasons, in words."""
    failed = table[table["status"] != "ok"]
    text = "bars: ± 1 standard error over seeds; ρ: rank correlation; "
    if failed.empty:
        return f"{text}all {len(table)} samples gave a result"
    reasons = ", ".join(
        f"{n} {status}"
        for status, n in failed["status"].value_counts().sort_index().items()
    )
    return f"{text}{len(failed)} of {len(table)} samples gave no result (×, at the bottom): {reasons}"
