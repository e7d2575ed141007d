"""The loop closed: how the simulated proposal comes near the target, round by round."""

import json
import textwrap

import numpy as np

from repose.core.files import read_table

from . import style

COLOURS = (style.BLUE, style.ORANGE)
COLUMNS = ("predicted", "simulated", "se", "target")


def approach(inputs, config):
    """Each round's proposal, predicted and simulated, off the target in percent of it; its standard errors."""
    names = [key.rsplit("_", 1) for key, _, _ in style.RESPONSES]
    columns = [f"{name}_{what}_{unit}" for name, unit in names for what in COLUMNS]
    rounds = read_table(inputs["rounds"], ("round", "n_seeds", "outcome", *columns))
    section = config["refine"]
    figure = style.new_figure(style.PAGE, 3.9)
    panels = figure.subplots(2, 2, sharex=True, height_ratios=[2.6, 1])
    for k, ((name, unit), (_, label, _)) in enumerate(zip(names, style.RESPONSES, strict=True)):
        values = {what: rounds[f"{name}_{what}_{unit}"].to_numpy(float) for what in COLUMNS}
        _deviations(panels[0, k], rounds, values, section["tolerance_percent"], COLOURS[k])
        panels[0, k].set_title(f"{label}, target {values['target'][0]:g} {unit}")
        error = 100 * values["se"] / values["target"]
        panels[1, k].plot(rounds["round"], error, "o-", color=COLOURS[k], ms=4)
        panels[1, k].axhline(section["standard_error_percent"], color=style.GREY, ls="--", lw=0.9)
        panels[1, k].set(xlabel="round", ylim=(0, None))
        panels[1, k].set_xticks(rounds["round"])
    panels[0, 0].set_ylabel("off the target (% of it)")
    panels[1, 0].set_ylabel("standard error\n(% of the target)")
    panels[0, 0].legend(loc="best")
    if "summary" in inputs:
        with open(inputs["summary"]) as file:
            summary = json.load(file)
        figure.suptitle(_wrapped(summary["why"]), fontsize=7.5, x=0.02, ha="left")
    return figure


def _deviations(panel, rounds, values, tolerance, colour):
    """One response: its bar as a band, predictions as hollow diamonds, simulated means with standard errors."""
    place = rounds["round"].to_numpy(float)
    simulated, predicted = (
        100 * (values[what] / values["target"] - 1) for what in ("simulated", "predicted")
    )
    panel.axhspan(-tolerance, tolerance, color=style.GREEN, alpha=0.15, lw=0, label=f"bar, ±{tolerance:g} %")
    panel.axhline(0, color=style.GREY, lw=0.7)
    panel.plot(
        place - 0.06, predicted, "D", ms=4.5, mfc="white", mec=style.BLACK, ls="", label="predicted", zorder=3
    )
    panel.errorbar(
        place + 0.06,
        simulated,
        yerr=100 * values["se"] / values["target"],
        color=colour,
        marker="o",
        ms=4.5,
        lw=0.9,
        elinewidth=1.1,
        capsize=2.5,
        label="simulated ± standard error",
    )
    for x, y, seeds in zip(place, simulated, rounds["n_seeds"], strict=True):
        if np.isfinite(y):
            panel.annotate(
                f"{seeds:g}", (x + 0.06, y), (6, -7), textcoords="offset points", fontsize=6, color=style.GREY
            )
    panel.set_xlim(place[0] - 0.4, place[-1] + 0.4)


def _wrapped(text, width=130):
    """Text in lines."""

    return "\n".join(textwrap.wrap(text, width))
