"""Benefit of search and network: searches compared, and the whole method compared with a response surface."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.calibrate.responses import Response, name_derived_column
from repose.common.files import read_table
from repose.report.figures import style

REGION = "feasible region"  # row of the table of methods: as many random points of the region as a search lists

SEARCHES = {
    "miga": ("island GA", style.BLUE),
    "miga_whole": ("island GA, all evaluations", style.BLUE),
    "one_population": ("one population", style.SKY),
    "differential_evolution": ("differential evolution", style.GREEN),
    "dual_annealing": ("dual annealing", style.PURPLE),
    "cma_es": ("CMA-ES", style.ORANGE),
    "least_squares": ("least squares, restarted", style.RED),
    "random": ("random points", style.GREY),
}
WHOLE = {
    "best_sample": ("best sample, no model", style.GREY, "s", ":"),
    "linear": ("plane + local search", style.SKY, "v", "--"),
    "quadratic": ("quadratic + local search", style.RED, "o", "-"),
    "network_all": ("network on all + local search", style.GREEN, "^", "-"),
    "network": ("network + local search", style.ORANGE, "D", "--"),
    "network_miga": ("network + island GA, the method", style.BLUE, "o", "-"),
}
KINDS = {"real": "subsets of the samples", "emulated": "new samples, emulated"}


def searches(inputs: Mapping[str, Any], config: Mapping[str, Any]) -> Figure:
    """Best objective over evaluations, evaluations to the tolerance, and the share of the feasible region found.

    Inputs: ``curves`` and ``methods`` of the script comparison.
    """
    curves = read_table(
        inputs["curves"], ("method", "evaluations", "log10_mean", "log10_se")
    )
    methods = read_table(
        inputs["methods"], ("method", "reached", "repetitions")
    ).set_index("method")
    figure = style.new_figure(style.PAGE, 3.5)
    course, soon, spread = figure.subplots(1, 3, width_ratios=[1.9, 1, 1])
    _course(course, curves, config["compare_search"]["tolerance"])
    course.set_title("a", fontweight="bold")
    _to_tolerance(soon, methods)
    _coverage(spread, methods)
    named = [
        entry
        for panel in (course, spread)
        for entry in zip(*panel.get_legend_handles_labels(), strict=True)
    ]
    figure.legend(*zip(*named, strict=True), loc="outside lower center", ncols=4)
    return figure


def _course(panel: Axes, curves: pd.DataFrame, tolerance: float) -> None:
    """Best objective of each search over its evaluations, geometric mean with one standard error."""
    for name, (label, colour) in SEARCHES.items():
        rows = curves[curves["method"] == name]
        if name == "miga_whole":  # continues after the end of the others
            rows = rows[
                rows["evaluations"]
                >= curves.loc[curves["method"] == "miga", "evaluations"].max()
            ]
        line = "--" if name == "miga_whole" else "-"
        middle = rows["log10_mean"]
        error = rows["log10_se"]
        panel.plot(rows["evaluations"], 10**middle, line, color=colour, label=label)
        ends = 10 ** (middle - error), 10 ** (middle + error)
        panel.fill_between(rows["evaluations"], *ends, color=colour, alpha=0.2, lw=0)
    panel.axhline(tolerance, color=style.BLACK, lw=0.7, ls=":")
    panel.set(
        xscale="log",
        yscale="log",
        xlabel="evaluations of the network",
        ylabel="best objective F (–)",
    )
    text_style = {
        "fontsize": 6.3,
        "ha": "right",
        "va": "bottom",
        "transform": panel.get_yaxis_transform(),
    }
    panel.text(0.99, tolerance * 1.2, f"tolerance {tolerance:g}", **text_style)


def _to_tolerance(panel: Axes, methods: pd.DataFrame) -> None:
    """Draw the evaluations until each search meets the tolerance; pale if some of its runs did not."""
    names = [
        name for name in SEARCHES if name in methods.index and name != "miga_whole"
    ]
    place = np.arange(len(names))[::-1]
    for y, name in zip(place, names, strict=True):
        row = methods.loc[name]
        _, colour = SEARCHES[name]
        reached = int(row["reached"])
        repetitions = int(row["repetitions"])
        if reached:
            # if some runs failed, the mean over the others is too low
            alpha = 1.0 if reached == repetitions else 0.4
            panel.barh(
                y,
                row["evaluations_to_tolerance"],
                color=colour,
                height=0.7,
                alpha=alpha,
            )
            panel.errorbar(
                row["evaluations_to_tolerance"],
                y,
                xerr=row["evaluations_to_tolerance_se"] if reached > 1 else None,
                color=style.BLACK,
                lw=0.8,
                capsize=2,
            )
        if reached < repetitions:
            text = f"{reached} of {repetitions} runs"
            panel.text(12, y, text, fontsize=6, va="center", ha="left")
    panel.set_yticks(place, [SEARCHES[name][0] for name in names], fontsize=6.3)
    panel.set(xscale="log", xlim=(10, None), xlabel="evaluations to tolerance")
    # without a bar the axes have no limits
    if not (methods.loc[names, "reached"] > 0).any():
        panel.set(xlim=(10, 1e5), ylim=(-0.6, len(names) - 0.4))
    panel.set_title("b", fontweight="bold")


def _coverage(panel: Axes, methods: pd.DataFrame) -> None:
    """Share of the feasible region near the points that each search lists, and near all feasible points that it met."""
    names = [name for name in SEARCHES if name in methods.index]
    place = np.arange(len(names))[::-1]
    for offset, key, alpha, label in (
        (0.2, "listed", 1.0, "c: its list"),
        (-0.2, "met", 0.45, "c: all points that it met"),
    ):
        values = 100 * methods.loc[names, f"{key}_coverage"].to_numpy()
        errors = 100 * methods.loc[names, f"{key}_coverage_se"].to_numpy()
        colours = [SEARCHES[name][1] for name in names]
        panel.barh(place + offset, values, 0.38, color=colours, alpha=alpha)
        panel.errorbar(
            values, place + offset, xerr=errors, fmt="none", ecolor=style.BLACK, lw=0.7
        )
        panel.barh([np.nan], [np.nan], color=style.BLACK, alpha=alpha, label=label)
    full = 100 * methods.loc[REGION, "listed_coverage"]
    panel.axvline(
        full,
        color=style.BLACK,
        lw=0.8,
        ls=":",
        label="c: as many random feasible points",
    )
    panel.set_yticks(
        place, [SEARCHES[name][0].replace(", ", ",\n") for name in names], fontsize=6
    )
    panel.set(
        xlabel="region covered (%)", xlim=(0, None), ylim=(-0.6, len(names) - 0.4)
    )
    panel.set_title("c", fontweight="bold")


def whole(inputs: Mapping[str, Any], config: Mapping[str, Any]) -> Figure:
    """Draw the true error of each method's proposal over its simulations; rows are responses, columns kinds of samples.

    Input: ``whole`` of the script comparison.
    """
    responses = style.read_targets(config).responses
    error_columns = [
        name_derived_column(response.name, "off") for response in responses
    ]
    columns = [column for key in error_columns for column in (key, f"{key}_se")]
    table = read_table(inputs["whole"], ("data", "method", "simulations", *columns))
    kinds = [kind for kind in KINDS if kind in set(table["data"])]
    figure = style.new_figure(style.PAGE, 0.8 + 1.8 * len(responses))
    panels = figure.subplots(
        len(responses), len(kinds), sharex=True, sharey="row", squeeze=False
    )
    for row, response, key in zip(panels, responses, error_columns, strict=True):
        for panel, kind in zip(row, kinds, strict=True):
            _off_the_target(panel, table[table["data"] == kind], key)
        row[0].set_ylabel(_off_label(response))
    for k, kind in enumerate(kinds):
        panels[0, k].set_title(
            f"{style.panel_letter(k)}   {KINDS[kind]}", fontweight="bold"
        )
        panels[-1, k].set_xlabel("simulations spent")
    figure.legend(
        *panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3
    )
    return figure


def _off_the_target(panel: Axes, table: pd.DataFrame, key: str) -> None:
    """Draw a line for each method with one standard error over its repetitions."""
    for name, (text, colour, mark, line) in WHOLE.items():
        rows = table[table["method"] == name]
        look = {
            "color": colour,
            "marker": mark,
            "ms": 3.5,
            "ls": line,
            "capsize": 2,
            "lw": 1,
        }
        panel.errorbar(
            rows["simulations"], rows[key], yerr=rows[f"{key}_se"], label=text, **look
        )
    panel.grid(True, axis="y")
    panel.set_ylim(0, None)


def _off_label(response: Response) -> str:
    """Label of the distance from the target, as in ``AoR off the target (deg)``."""
    return f"{response.symbol} off the target ({response.unit or '–'})"
