"""The shape study: piles of every particle, tension, filling and definition beside the published ones."""

import itertools
from collections.abc import Mapping
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from repose.calibrate.responses import name_derived_column
from repose.calibrate.targets import Target
from repose.common.files import read_table
from repose.report.figures import style
from research.shape.shape_piles import COLUMNS

MARKERS = "osD^vP*X"
FILLS = ("full", "left", "none", "top")
COLOURS = (*style.SERIES, style.BLACK)


def study(inputs: Mapping[str, str], config: Mapping[str, Any]) -> Figure:
    """Two targets of each combination, a panel per definition, beside the published piles and their ranges.

    A point is the mean over the published sets, its bars two standard errors. With more than two targets the first
    two are shown; with one, the distance is on the vertical axis. Inputs: ``combinations`` and ``sets`` of the
    script shape.
    """
    columns = ("particle", "tension", "filling", "definition", "distance")
    combinations = read_table(inputs["combinations"], columns)
    sets = read_table(inputs["sets"], ("kind", "definition", "set"))
    shown = [
        target
        for target in style.read_targets(config)
        if name_derived_column(target.name, "difference") in combinations
    ][:2]
    published = _published(sets, shown)
    study = config["shape_study"]
    particles = list(study["particles"])
    tensions = list(study["tensions"])
    fillings = list(study["fillings"])
    colours = dict(zip(particles, itertools.cycle(COLOURS), strict=False))
    fills = dict(zip(tensions, itertools.cycle(FILLS), strict=False))
    markers = dict(zip(fillings, itertools.cycle(MARKERS), strict=False))
    looks = {
        (particle, tension, filling): {
            "color": colours[particle],
            "fillstyle": fills[tension],
            "marker": markers[filling],
        }
        for particle, tension, filling in itertools.product(
            particles, tensions, fillings
        )
    }
    figure = style.new_figure(style.PAGE, style.PAGE * 1.09)
    panels = figure.subplots(3, 2, sharex=True, sharey=True)
    for panel, definition in zip(panels.flat, COLUMNS, strict=True):
        rows = combinations[combinations["definition"] == definition]
        _one_definition(panel, rows, shown, published, looks)
        panel.set_title(definition.replace("_", ", by "), fontsize=9)
    labels = [f"{target.response.label} ({target.response.unit})" for target in shown]
    labels.append("distance (–)")
    for panel in panels[-1]:
        panel.set_xlabel(labels[0])
    for panel in panels[:, 0]:
        panel.set_ylabel(labels[1])
    _legend(figure, particles, tensions, fillings)
    return figure


def _one_definition(
    panel: Axes,
    rows: pd.DataFrame,
    shown: list[Target],
    published: pd.DataFrame,
    looks: Mapping,
) -> None:
    """Draw the combinations of one definition of the angle, the published piles and the ranges of the targets."""
    _ranges(panel, shown)
    if len(shown) > 1:
        across, up = (published[target.name] for target in shown)
        panel.scatter(across, up, marker="+", s=40, color="k", linewidths=1, zorder=5)
    for row in rows.to_dict("records"):
        place = [
            published[target.name].mean()
            + row[name_derived_column(target.name, "difference")]
            for target in shown
        ]
        errors = [2 * row[target.response.standard_error] for target in shown]
        if len(shown) == 1:
            place = [*place, row["distance"]]
            errors = [*errors, 0.0]
        panel.errorbar(
            *place,
            xerr=errors[0],
            yerr=errors[1],
            markersize=4.5,
            linewidth=0.8,
            linestyle="none",
            **looks[row["particle"], row["tension"], row["filling"]],
        )


def _published(sets: pd.DataFrame, shown: list[Target]) -> pd.DataFrame:
    """Return the published values of each set: the value found less the difference."""
    published = sets[sets["kind"] == "published"].drop_duplicates("set")
    return pd.DataFrame(
        {
            t.name: published[t.name]
            - published[name_derived_column(t.name, "difference")]
            for t in shown
        }
    )


def _ranges(panel: Axes, shown: list[Target]) -> None:
    """Draw the ranges of the feasible piles: a box for two targets, a band for one."""
    look = {"facecolor": "0.9", "edgecolor": "0.6", "linewidth": 0.6}
    if len(shown) == 1:
        panel.axvspan(shown[0].low, shown[0].high, **look)
        return
    across, up = shown
    size = across.high - across.low, up.high - up.low
    panel.add_patch(Rectangle((across.low, up.low), *size, **look))


def _legend(
    figure: Figure, particles: list[str], tensions: list[str], fillings: list[str]
) -> None:
    """Legend: colours of the particles, marks of the fillings, fill of a mark for each tension."""
    grey = {"color": "0.4", "marker": "o", "linestyle": "none"}
    groups = {
        "particle": [
            (name, {"color": colour})
            for name, colour in zip(particles, COLOURS, strict=False)
        ],
        "filling": [
            (name, {"marker": marker})
            for name, marker in zip(fillings, MARKERS, strict=False)
        ],
        "tension": [
            (name, {"fillstyle": fill})
            for name, fill in zip(tensions, FILLS, strict=False)
        ],
        "article": [
            ("published_piles", {"color": "k", "marker": "+"}),
            ("target_ranges", {"color": "0.85", "marker": "s"}),
        ],
    }
    rows = max(map(len, list(groups.values())[1:])) + 1
    handles = []
    for group, members in groups.items():
        looks = [(f"{group}:", {"marker": ""}), *members]
        # empty entries fill the last of the group's columns
        looks += [("", {"marker": ""})] * (-len(looks) % rows)
        handles += [
            Line2D([], [], label=name.replace("_", " "), **grey | look)
            for name, look in looks
        ]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=len(handles) // rows,
        fontsize=7,
    )
