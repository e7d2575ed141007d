"""The validation of our solutions (Table 4), and the published solutions in our simulator."""

import numpy as np
import pandas as pd

from repose.core.targets import section_of

from . import style

QUANTITIES = (("aor", "deg", "AoR"), ("height", "mm", "Height"))


def _band(panel, target, quantity, unit):
    """The physical pile: mean line and a band of one standard deviation."""
    mean, sd = target[f"physical_{quantity}_{unit}"], target[f"physical_{quantity}_sd_{unit}"]
    panel.axhspan(mean - sd, mean + sd, color=style.GREEN, alpha=0.15, lw=0)
    panel.axhline(mean, color=style.GREEN, lw=0.9, label="physical pile, mean ± SD")


def _name_solutions(panel, table):
    names = table["solution"].astype(str).str.replace("representative", "repr.").tolist()
    if "role" in table:
        marked = table["role"] == "representative"
        names = [f"{name}\n(repr.)" if mark else name for name, mark in zip(names, marked, strict=True)]
    panel.set_xticks(range(len(names)), names)
    panel.set_xlim(-0.6, len(names) - 0.4)


def _widen(panel, share=0.34):
    """Room above the data for the legend."""
    low, high = panel.get_ylim()
    panel.set_ylim(low, high + share * (high - low))


def validation(inputs, config):
    """Table 4: predicted and simulated responses of our solutions, the published table's beside them."""
    ours = pd.read_csv(inputs["table4"])
    theirs = pd.read_csv(inputs["published"]) if "published" in inputs else None
    figure = style.new_figure(style.PAGE, 4.4)
    sides = 1 if theirs is None else 2
    panels = figure.subplots(2, sides, sharey="row", squeeze=False, width_ratios=(1.15, 1)[:sides])
    for row, (quantity, unit, label) in enumerate(QUANTITIES):
        _compare(panels[row, 0], ours, quantity, unit, section_of(config))
        panels[row, 0].set_ylabel(f"{label} ({unit})")
        if theirs is not None:
            _compare(panels[row, 1], theirs, quantity, unit, section_of(config))
    for panel, title in zip(panels[0], ("this run", "published"), strict=False):
        panel.set_title(title, fontweight="bold")
        _widen(panel) if panel is panels[0, 0] else None
    for panel in panels[1]:
        panel.set_xlabel("solution")
    panels[0, 0].legend(loc="upper left", ncols=3, columnspacing=1.0, handletextpad=0.4)
    figure.supxlabel(
        "bars on simulated values: ± 1 standard error over seeds; numbers: error of the prediction in %",
        fontsize=6.8,
    )
    return figure


def _compare(panel, table, quantity, unit, target):
    predicted = table[f"{quantity}_predicted_{unit}"].to_numpy(float)
    simulated = table[f"{quantity}_simulated_{unit}"].to_numpy(float)
    error = table.get(f"{quantity}_se_{unit}")
    x = np.arange(len(table))
    _band(panel, target, quantity, unit)
    panel.plot(x - 0.12, predicted, "o", ms=4.5, mfc="white", color=style.BLUE, label="predicted")
    panel.errorbar(
        x + 0.12,
        simulated,
        yerr=None if error is None else error.fillna(0.0),
        fmt="s",
        ms=4.5,
        color=style.RED,
        elinewidth=1,
        capsize=2,
        label="simulated",
    )
    for place, ours, theirs in zip(x, predicted, simulated, strict=True):
        if np.isfinite(theirs):
            percent = 100 * abs(ours - theirs) / theirs
            panel.annotate(
                f"{percent:.1f}",
                (place, min(ours, theirs)),
                xytext=(0, -9),
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=6.3,
                color=style.GREY,
            )
    _name_solutions(panel, table)
    panel.margins(y=0.25)


def published_solutions(inputs, config):
    """The published solutions: their simulated responses beside those of our simulator."""
    table = pd.read_csv(inputs["published"])
    figure = style.new_figure(style.PAGE, 2.9)
    panels = figure.subplots(1, 2)
    x = np.arange(len(table))
    for panel, (quantity, unit, label), letter in zip(panels, QUANTITIES, "ab", strict=True):
        _band(panel, section_of(config), quantity, unit)
        theirs = table[f"{quantity}_published_simulated_{unit}"].to_numpy(float)
        panel.plot(
            x - 0.12, theirs, "D", ms=4.5, mfc="white", color=style.ORANGE, label="published simulation"
        )
        panel.errorbar(
            x + 0.12,
            table[f"{quantity}_simulated_{unit}"],
            yerr=table[f"{quantity}_se_{unit}"].fillna(0.0),
            fmt="s",
            ms=4.5,
            color=style.BLUE,
            elinewidth=1,
            capsize=2,
            label="same parameters, this simulator (± SE)",
        )
        _name_solutions(panel, table)
        panel.set(ylabel=f"{label} ({unit})", xlabel="published solution")
        panel.set_title(letter, fontweight="bold")
        panel.margins(y=0.15)
        _widen(panel)
    panels[0].legend(loc="upper left", fontsize=6.3)
    return figure
