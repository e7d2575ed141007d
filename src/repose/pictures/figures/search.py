"""Figure 14 and the convergence of the island genetic algorithm."""

import json

import numpy as np
import pandas as pd
from matplotlib.ticker import FormatStrFormatter

from repose.core.parameters import PARAMETERS, SYMBOLS
from repose.core.targets import section_of

from . import style


def feasible_solutions(inputs, config):
    """Figure 14: the solutions' parameters in their ranges, and their predicted responses beside the targets.

    Where no solution is feasible the table holds the nearest ones, and the figure says so.
    """
    solutions = pd.read_csv(inputs["feasible"])
    with open(inputs["summary"]) as file:
        summary = json.load(file)
    published = pd.read_csv(inputs["published"]).set_index("parameter") if "published" in inputs else None
    figure = style.new_figure(style.PAGE, 3.5)
    left, right, far = figure.subplots(1, 3, width_ratios=[2.6, 1, 1])
    _parameter_strips(left, solutions, config["parameters"], published)
    for panel, (column, label, unit), letter in zip((right, far), style.RESPONSES, "bc", strict=True):
        _response_strip(panel, solutions, column, label, unit, section_of(config))
        panel.set_title(letter, fontweight="bold")
    if summary["feasible"]:
        shown = int(_true(solutions["feasible"]).sum())
        text, colour = f"{shown} feasible solutions", style.BLACK
        if shown < len(solutions):
            text += f" and the {len(solutions) - shown} nearest others"
    else:
        text, colour = f"NO FEASIBLE SOLUTION: the {len(solutions)} nearest are shown", style.RED
    left.set_title(f"a   {text}", fontweight="bold", color=colour)
    if not summary["feasible"] and summary.get("message"):
        figure.supxlabel(summary["message"], fontsize=6.8, color=style.RED, wrap=True)
    return figure


def _jitter(count):
    """Fixed sideways places for points, the same in each figure."""
    return (np.arange(count) * 0.6180339887 % 1.0) - 0.5


def _true(column):
    """A column of true and false, however the table spells them, as a boolean array."""
    return column.astype(str).str.lower().eq("true").to_numpy()


def _representative(solutions):
    return _true(solutions["representative"])


def _parameter_strips(panel, solutions, ranges, published):
    marked = _representative(solutions)
    for row, name in enumerate(PARAMETERS):
        low, high = ranges[name]
        position = (solutions[name].to_numpy() - low) / (high - low)
        y = len(PARAMETERS) - 1 - row
        panel.barh(y, 1, height=0.62, color="#EEF0F2", zorder=0)
        panel.barh(
            y + 0.03,
            position.max() - position.min(),
            left=position.min(),
            height=0.40,
            color=style.SKY,
            alpha=0.35,
            zorder=1,
        )
        panel.scatter(
            position,
            y + 0.03 + 0.34 * _jitter(len(position)),
            s=5,
            color=style.BLUE,
            alpha=0.7,
            lw=0,
            zorder=2,
            label="solutions" if row == 0 else None,
        )
        if marked.any():
            panel.plot(
                position[marked],
                np.full(marked.sum(), y + 0.03),
                "D",
                ms=4.5,
                color=style.RED,
                mec="white",
                mew=0.6,
                zorder=4,
                label="representative" if row == 0 else None,
            )
        if published is not None:
            ends = (published.loc[name, ["low", "high"]].astype(float).to_numpy() - low) / (high - low)
            panel.plot(
                ends,
                [y - 0.27] * 2,
                "-|",
                color=style.ORANGE,
                lw=2.4,
                ms=5,
                label="published interval" if row == 0 else None,
            )
        panel.text(-0.01, y - 0.42, f"{low:g}", fontsize=6, ha="left", va="top", color=style.GREY)
        panel.text(1.01, y - 0.42, f"{high:g}", fontsize=6, ha="right", va="top", color=style.GREY)
        width = 100 * (position.max() - position.min())
        panel.text(1.03, y, f"{width:.0f} %", fontsize=6.8, va="center")
    panel.text(1.03, len(PARAMETERS) - 0.45, "width", fontsize=6.3, va="bottom", color=style.GREY)
    panel.set_yticks(range(len(PARAMETERS)), [SYMBOLS[name] for name in reversed(PARAMETERS)], fontsize=9)
    panel.set(xlim=(-0.02, 1.13), ylim=(-1.15, len(PARAMETERS) - 0.4))
    panel.set_xticks([0, 0.25, 0.5, 0.75, 1.0])
    panel.set_xlabel("place in the parameter's range (dimensionless)")
    panel.legend(
        loc="lower center", ncols=3, handletextpad=0.3, columnspacing=1.4, bbox_to_anchor=(0.45, -0.02)
    )
    panel.spines["left"].set_visible(False)
    panel.tick_params(axis="y", length=0)


def _response_strip(panel, solutions, column, label, unit, target):
    quantity = column.split("_")[0]
    values = solutions[f"{quantity}_predicted_{unit}"].to_numpy()
    low, high = target[f"{quantity}_range_{unit}"]
    panel.axhspan(low, high, color=style.GREEN, alpha=0.15, lw=0)
    panel.axhline(target[column], color=style.GREEN, lw=1.0, ls="--")
    panel.scatter(0.28 * _jitter(len(values)), values, s=7, color=style.BLUE, alpha=0.7, lw=0, zorder=2)
    marked = _representative(solutions)
    panel.plot(
        np.zeros(marked.sum()), values[marked], "D", ms=5, color=style.RED, mec="white", mew=0.6, zorder=3
    )
    panel.boxplot(
        values,
        positions=[0.42],
        widths=0.22,
        showfliers=False,
        medianprops={"color": style.BLACK},
        boxprops={"linewidth": 0.8},
        whiskerprops={"linewidth": 0.8},
        capprops={"linewidth": 0.8},
    )
    panel.set(xlim=(-0.35, 0.65), ylabel=f"predicted {label} ({unit})")
    bottom, top = min(low, values.min()), max(high, values.max())
    panel.set_ylim(bottom - 0.06 * (top - bottom), top + 0.22 * (top - bottom))
    panel.set_xticks([])
    style.note(panel, f"constraint {low:g}–{high:g} {unit}\ntarget {target[column]:g} {unit}", fontsize=6.2)


def convergence(inputs, config):
    """Objective of the best and the mean individual, and feasible solutions met, over the rounds."""
    history = pd.read_csv(inputs["history"])
    figure = style.new_figure(style.COLUMN * 1.1, 3.4)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    top.plot(history["generation"], history["mean_objective"], color=style.SKY, label="mean of all islands")
    top.plot(history["generation"], history["best_objective"], color=style.BLUE, label="best so far")
    top.set_ylabel("objective F (dimensionless)")
    if (history[["best_objective", "mean_objective"]] > 0).all(axis=None):
        top.set_yscale("log")
    top.legend(loc="upper right")
    bottom.plot(history["generation"], history["feasible_found"], color=style.GREEN)
    bottom.set(xlabel="generation", ylabel="feasible\nsolutions met", ylim=(0, None))
    top.yaxis.set_minor_formatter(FormatStrFormatter(""))
    if history["generation"].iloc[-1] > 200:
        for panel in (top, bottom):
            panel.set_xscale("log")
    if "summary" in inputs:
        with open(inputs["summary"]) as file:
            summary = json.load(file)
        if not summary["feasible"]:
            top.set_title("no feasible solution was met", color=style.RED)
    return figure
