"""The design's points, and the responses that the simulations gave over them."""

import numpy as np
import pandas as pd

from repose.core.parameters import PARAMETERS, SYMBOLS

from . import style


def design_matrix(inputs, config):
    """Every pair of parameters of the design, the histogram of each, and how the methods compare."""
    table = pd.read_csv(inputs["samples"])
    count = len(PARAMETERS)
    figure = style.new_figure(style.PAGE, style.PAGE)
    panels = figure.subplots(count, count, sharex="col")
    for row, down in enumerate(PARAMETERS):
        for column, across in enumerate(PARAMETERS):
            panel = panels[row, column]
            if column > row:
                panel.axis("off")
                continue
            if column == row:
                panel.hist(
                    table[across], bins=10, range=config["parameters"][across], color=style.SKY, ec="white"
                )
                panel.set_yticks([])
                panel.spines["left"].set_visible(False)
            else:
                panel.scatter(table[across], table[down], s=4, color=style.BLUE, alpha=0.75, lw=0)
                panel.set_ylim(config["parameters"][down])
            panel.set_xlim(config["parameters"][across])
            panel.tick_params(labelsize=6, labelleft=column == 0 and row > 0)
            if row == count - 1:
                panel.set_xlabel(f"{SYMBOLS[across]} (–)", fontsize=8.5)
            if column == 0 and row > 0:
                panel.set_ylabel(f"{SYMBOLS[down]} (–)", fontsize=8.5)
    text = f"{len(table)} samples\nmethod: {config['design']['method']}"
    figure.text(0.56, 0.93, text, fontsize=9, va="top", linespacing=1.5)
    if "comparison" in inputs:
        _compare(figure, pd.read_csv(inputs["comparison"]))
    return figure


def _compare(figure, comparison):
    """Bars of the minimum distance of each method, in the empty corner."""
    panel = figure.add_axes((0.70, 0.70, 0.27, 0.10))
    panel.set_in_layout(False)
    names = comparison["method"].tolist()
    colours = [style.GREY, style.ORANGE, style.BLUE]
    panel.barh(names, comparison["min_distance"], color=colours[: len(names)], height=0.6)
    for y, value in enumerate(comparison["min_distance"]):
        panel.text(value, y, f" {value:.3f}", va="center", fontsize=7)
    panel.set_xlim(0, 1.25 * comparison["min_distance"].max())
    panel.set_xlabel("minimum distance in the unit cube (–)")
    panel.invert_yaxis()


def responses_over_parameters(inputs, config):
    """Both responses over each parameter with the rank correlation; samples that failed are marked below."""
    table = pd.read_csv(inputs["dataset"])
    good = table[table["status"] == "ok"]
    failed = table[table["status"] != "ok"]
    figure = style.new_figure(style.PAGE, 3.4)
    panels = figure.subplots(2, len(PARAMETERS), sharex="col", sharey="row")
    for row, (column, label, unit) in enumerate(style.RESPONSES):
        error = good[column.replace("deg", "se_deg").replace("mm", "se_mm")].fillna(0.0)
        floor = (good[column] - error).min() if len(good) else 0.0
        reach = ((good[column] + error).max() - floor) if len(good) else 1.0
        for panel, name in zip(panels[row], PARAMETERS, strict=True):
            panel.errorbar(
                good[name],
                good[column],
                yerr=error,
                fmt="o",
                ms=2,
                lw=0.5,
                color=style.BLUE,
                alpha=0.65,
                mew=0,
            )
            if len(failed):
                panel.plot(
                    failed[name], np.full(len(failed), floor - 0.1 * reach), "x", ms=3.5, color=style.RED
                )
            if len(good) > 3:
                rank = good[name].rank().corr(good[column].rank())
                panel.set_title(f"ρ = {rank:+.2f}", fontsize=6.8, loc="right", pad=2)
            panel.set_xlim(config["parameters"][name])
        panels[row, 0].set_ylabel(f"{label} ({unit})")
    for panel, name in zip(panels[1], PARAMETERS, strict=True):
        panel.set_xlabel(f"{SYMBOLS[name]} (–)", fontsize=8.5)
    figure.supxlabel(_account(table, failed), fontsize=6.8)
    return figure


def _account(table, failed):
    """In words: how many samples there are, and how many failed and why."""
    text = "bars: ± 1 standard error over seeds; ρ: rank correlation; "
    if failed.empty:
        return f"{text}all {len(table)} samples gave a pile"
    reasons = ", ".join(f"{n} {status}" for status, n in failed["status"].value_counts().sort_index().items())
    return f"{text}{len(failed)} of {len(table)} samples gave no pile (×, at the bottom): {reasons}"
