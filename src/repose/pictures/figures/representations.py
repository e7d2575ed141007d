"""The shape study: piles of every particle, filling and definition of the angle beside the published ones."""

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from repose.core.files import read_table
from repose.core.targets import section_of
from repose.measure.angles import DEFINITIONS

from . import style

MARKERS = "osD^vP*X"
COLOURS = ("#1B6CA8", "#D7191C", "#F08A24", "#5BA300", "#2E7D4F", "#7B4FA3", "#8C564B", "#555555")


def study(inputs, config):
    """Angle and Height of each combination, one panel a definition, beside the published pairs and the box of
    Eq. 11-12; a point is the mean over the published sets, its bars two standard errors."""
    combinations = read_table(inputs["combinations"], ("particle", "filling", "definition", "distance"))
    sets = read_table(
        inputs["sets"], ("kind", "definition", "set", "aor_deg", "aor_difference_deg", "height_mm")
    )
    published = _published(sets)
    centre = published.mean()
    particles = list(config["shape_study"]["particles"])
    fillings = list(config["shape_study"]["fillings"])
    colours = dict(zip(particles, COLOURS, strict=False))
    figure = style.new_figure(style.PAGE, style.PAGE * 0.92)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    target = section_of(config)
    for panel, definition in zip(panels.flat, DEFINITIONS, strict=True):
        _box(panel, target["aor_range_deg"], target["height_range_mm"])
        panel.scatter(
            published["aor_deg"], published["height_mm"], marker="+", s=40, color="k", linewidths=1, zorder=5
        )
        for row in combinations[combinations["definition"] == definition].to_dict("records"):
            panel.errorbar(
                centre["aor_deg"] + row["aor_difference_deg"],
                centre["height_mm"] + row["height_difference_mm"],
                xerr=2 * row["aor_se_deg"],
                yerr=2 * row["height_se_mm"],
                marker=MARKERS[fillings.index(row["filling"]) % len(MARKERS)],
                color=colours[row["particle"]],
                markersize=4.5,
                linewidth=0.8,
                linestyle="none",
            )
        panel.set_title(definition, fontsize=9)
    for panel in panels[1]:
        panel.set_xlabel("angle of repose (deg)")
    for panel in panels[:, 0]:
        panel.set_ylabel("Height (mm)")
    names = [
        Line2D([], [], color=colours[name], marker="o", linestyle="none", label=_words(name))
        for name in particles
    ]
    ways = [
        Line2D([], [], color="0.4", marker=MARKERS[k % len(MARKERS)], linestyle="none", label=_words(name))
        for k, name in enumerate(fillings)
    ]
    ways.append(Line2D([], [], color="k", marker="+", linestyle="none", label="published piles"))
    figure.legend(handles=names + ways, loc="outside lower center", ncols=3, fontsize=7, frameon=False)
    return figure


def _published(sets):
    """What was published of each set: what was found less the difference."""
    one = sets[(sets["kind"] == "published")].drop_duplicates("set")
    return pd.DataFrame(
        {
            "aor_deg": one["aor_deg"] - one["aor_difference_deg"],
            "height_mm": one["height_mm"] - one["height_difference_mm"],
        }
    )


def _box(panel, aor, height):
    """The box of the feasible piles."""
    width, tall = np.diff(aor)[0], np.diff(height)[0]
    panel.add_patch(
        Rectangle((aor[0], height[0]), width, tall, facecolor="0.9", edgecolor="0.6", linewidth=0.6)
    )


def _words(name):
    return name.replace("_", " ")
