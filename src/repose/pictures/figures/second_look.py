"""What to measure next on the same pile: bits gained, and which parameter each response narrows."""

import numpy as np
import pandas as pd

from repose.core.parameters import PARAMETERS, SYMBOLS
from repose.measure.further_responses import LABELS

from . import style

BASE = "AoR and Height"
TOGETHER = {"whole pile": "all of the pile", "pile and drum": "pile and drum"}


def what_to_measure_next(inputs, config):
    """Bits that each response adds to AoR and Height, and the width of each parameter's interval with it."""
    information, narrowing = pd.read_csv(inputs["information"]), pd.read_csv(inputs["narrowing"])
    known = pd.read_csv(inputs["responses"]).set_index("response")
    percents = sorted(information["discrepancy_percent"].unique())
    first = information[information["discrepancy_percent"] == percents[0]].set_index("set")
    single = [name for name in first.index if name in LABELS]
    order = sorted(single, key=lambda name: first.loc[name, "gain_bits"])
    order = [*[name for name in TOGETHER if name in first.index][::-1], *order]
    figure = style.new_figure(style.PAGE, 1.1 + 0.26 * (len(order) + 1))
    bars, map_ = figure.subplots(1, 2)
    _bars(bars, information, order, percents, known)
    _map(map_, narrowing[narrowing["discrepancy_percent"] == percents[0]], [*order, BASE])
    base = first.loc[BASE]
    text = f"AoR and Height alone:\n{base['bits']:.1f} ± {base['bits_se']:.1f} bits"
    style.note(bars, text, x=0.98, y=0.98, ha="right")
    return figure


def _bars(panel, information, order, percents, known):
    place = np.arange(len(order))
    height = 0.8 / len(percents)
    for k, percent in enumerate(percents):
        rows = information[information["discrepancy_percent"] == percent].set_index("set").loc[order]
        y = place + height * ((len(percents) - 1) / 2 - k)
        label = "the simulator exact" if percent == 0 else f"{percent:g} % of each response beyond it"
        panel.barh(y, rows["gain_bits"], height, color=(style.BLUE, style.SKY)[k], label=label)
        panel.errorbar(
            rows["gain_bits"],
            y,
            xerr=rows["gain_se_bits"],
            fmt="none",
            ecolor=style.BLACK,
            lw=0.7,
            capsize=1.5,
        )
    panel.axvline(0, color=style.BLACK, lw=0.6)
    names = []
    for name in order:
        text = TOGETHER.get(name) or LABELS[name]
        if name in known.index:
            text += f"\nS/N {known.loc[name, 'signal_to_noise']:.1f}, R² {known.loc[name, 'r2']:.2f}"
        names.append(text)
    panel.set_yticks(place, names, fontsize=6.3, linespacing=1.05)
    panel.set_xlabel("bits gained beside AoR and Height")
    panel.figure.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    panel.set_title("a", fontweight="bold")


def _map(panel, narrowing, order):
    ratio = narrowing.pivot(index="set", columns="parameter", values="over_base").loc[order, list(PARAMETERS)]
    width = narrowing.pivot(index="set", columns="parameter", values="width_ratio").loc[
        order, list(PARAMETERS)
    ]
    panel.imshow(ratio, cmap="YlGnBu_r", vmin=0.3, vmax=1.0, aspect="auto", origin="lower")
    for i, name in enumerate(order):
        for j, parameter in enumerate(PARAMETERS):
            shown = width if name == BASE else ratio
            value = ratio.loc[name, parameter]
            panel.text(
                j,
                i,
                f"{shown.loc[name, parameter]:.2f}",
                ha="center",
                va="center",
                fontsize=6,
                color="white" if value < 0.6 else style.BLACK,
                fontstyle="italic" if name == BASE else "normal",
            )
    panel.set_xticks(range(len(PARAMETERS)), [SYMBOLS[name] for name in PARAMETERS], fontsize=7.5)
    labels = [TOGETHER.get(name) or LABELS.get(name) or f"{name},\nover the prior" for name in order]
    panel.set_yticks(range(len(order)), labels, fontsize=6)
    panel.tick_params(length=0)
    panel.set_title("b   95 % interval: width over that\n     with AoR and Height alone", fontweight="bold")
