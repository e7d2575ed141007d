"""Next measurement on the same pile: bits gained, and the parameters that each response narrows."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from repose.bench.parameters import PARAMETERS, SYMBOLS
from repose.calibrate.responses import response
from repose.common.files import read_table
from repose.report.figures import style
from research.responses.response_sets import EVERYTHING, WAYS, WHOLE_PILE, base_label

TOGETHER = {WHOLE_PILE: "all of the pile", EVERYTHING: EVERYTHING}
COLOURS = (style.BLUE, style.SKY)


def what_to_measure_next(
    inputs: Mapping[str, str], config: Mapping[str, Any]
) -> Figure:
    """Bits that each response adds to the targets, the width of each parameter's interval, and bits a minute of work.

    Every panel shows an exact simulator and one with a discrepancy. Inputs: ``responses``, ``information``,
    ``narrowing`` and ``ways`` of the script responses.
    """
    base_name = base_label(style.read_targets(config).responses)
    information = read_table(
        inputs["information"], ("discrepancy_percent", "set", "gain_bits")
    )
    narrowing = read_table(
        inputs["narrowing"], ("discrepancy_percent", "set", "parameter", "over_base")
    )
    known = read_table(
        inputs["responses"], ("response", "signal_to_noise", "r2")
    ).set_index("response")
    percents = sorted(information["discrepancy_percent"].unique())
    first = information[information["discrepancy_percent"] == percents[0]].set_index(
        "set"
    )
    single = [name for name in first.index if name in known.index]
    order = sorted(single, key=lambda name: first.loc[name, "gain_bits"])
    order = [*[name for name in TOGETHER if name in first.index][::-1], *order]
    ways = read_table(
        inputs["ways"], ("discrepancy_percent", "way", "minutes", "bits_a_minute")
    )
    figure = style.new_figure(style.PAGE, 1.6 + 0.45 * (len(order) + 1))
    places = figure.add_gridspec(2, 2, height_ratios=(1.2, 1))
    bars = figure.add_subplot(places[0, 0])
    work = figure.add_subplot(places[0, 1])
    widths = figure.add_subplot(places[1, :])
    _bars(bars, information, order, percents, known)
    bars.set_xlabel(f"bits gained beside {base_name}")
    _work(work, ways, percents)
    _map(widths, narrowing, order, base_name, percents)
    base = first.loc[base_name]
    text = f"{base_name} alone:\n{base['bits']:.2f} ± {base['bits_se']:.2f} bits"
    style.write_note(bars, text, x=0.98, y=0.98, ha="right")
    return figure


def _case(percent):
    """Put a discrepancy in words."""
    return "the simulator exact" if percent == 0 else f"{percent:g} % discrepancy"


def _short(percent):
    """Name a discrepancy in a word."""
    return "exact" if percent == 0 else f"{percent:g} %"


def _work(panel, ways, percents):
    """Bits a minute of each way to get further responses, a bar for each discrepancy."""
    last = ways[ways["discrepancy_percent"] == percents[-1]].set_index("way")
    order = list(last["bits_a_minute"].sort_values().index)
    place = np.arange(len(order))
    height = 0.8 / len(percents)
    for k, percent in enumerate(percents):
        rows = ways[ways["discrepancy_percent"] == percent].set_index("way").loc[order]
        y = place + height * ((len(percents) - 1) / 2 - k)
        panel.barh(y, rows["bits_a_minute"], height, color=COLOURS[k])
    labels = [
        f"{WAYS.get(way, way)}\n{last.loc[way, 'minutes']:g} min" for way in order
    ]
    panel.set_yticks(place, labels, fontsize=6.3, linespacing=1.05)
    panel.set_xlabel("bits a minute of work")
    panel.set_title("b", fontweight="bold")


def _bars(panel, information, order, percents, known):
    """Bits gained by each set, a bar for each discrepancy."""
    place = np.arange(len(order))
    height = 0.8 / len(percents)
    for k, percent in enumerate(percents):
        rows = (
            information[information["discrepancy_percent"] == percent]
            .set_index("set")
            .loc[order]
        )
        y = place + height * ((len(percents) - 1) / 2 - k)
        panel.barh(y, rows["gain_bits"], height, color=COLOURS[k], label=_case(percent))
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
        text = TOGETHER.get(name) or response(name).label
        if name in known.index:
            text += f"\nS/N {known.loc[name, 'signal_to_noise']:.1f}, R² {known.loc[name, 'r2']:.2f}"
        names.append(text)
    panel.set_yticks(place, names, fontsize=6.3, linespacing=1.05)
    panel.figure.legend(
        *panel.get_legend_handles_labels(), loc="outside lower center", ncols=2
    )
    panel.set_title("a", fontweight="bold")


def _map(panel, narrowing, order, base, percents):
    """Widths of the intervals over those with the base alone, a column per parameter and discrepancy.

    The last row shows the widths with the base over those of the prior.
    """
    parameters = [name for name in PARAMETERS if name in set(narrowing["parameter"])]
    rows = [*order, base]
    n_percents = len(percents)
    columns = [(name, percent) for name in parameters for percent in percents]
    tables = narrowing.pivot(
        index="set",
        columns=["parameter", "discrepancy_percent"],
        values=["over_base", "width_ratio"],
    )
    ratio = tables["over_base"].loc[rows, columns].to_numpy(float)
    shown = ratio.copy()
    shown[-1] = tables["width_ratio"].loc[base, columns]
    panel.imshow(
        ratio, cmap="YlGnBu_r", vmin=0.3, vmax=1.0, aspect="auto", origin="lower"
    )
    for i, j in np.ndindex(shown.shape):
        panel.text(
            j,
            i,
            f"{shown[i, j]:.2f}",
            ha="center",
            va="center",
            fontsize=6,
            color="white" if ratio[i, j] < 0.6 else style.BLACK,
            fontstyle="italic" if i == len(order) else "normal",
        )
    for k in range(1, len(parameters)):
        panel.axvline(n_percents * k - 0.5, color="white", lw=3)
    symbols = [f"\n{SYMBOLS[name]}" for name in parameters]
    panel.set_xticks(
        n_percents * np.arange(len(parameters)) + (n_percents - 1) / 2,
        symbols,
        fontsize=7.5,
    )
    cases = [_short(percent) for _, percent in columns]
    panel.set_xticks(range(len(columns)), cases, fontsize=6, minor=True)
    labels = [TOGETHER.get(name) or response(name).label for name in order]
    panel.set_yticks(
        range(len(rows)), [*labels, f"{base} alone,\nover the prior"], fontsize=6
    )
    panel.tick_params(which="both", length=0)
    panel.set_title(f"c   95 % interval over that of {base} alone", fontweight="bold")
