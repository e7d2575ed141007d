"""Figures 10 and 13: the network and how well it predicts."""

import json

import numpy as np
import pandas as pd

from repose.core.parameters import SYMBOLS

from . import style

SPLITS = (("train", style.BLUE, "o"), ("validation", style.ORANGE, "s"), ("test", style.RED, "^"))
OUTPUT_LABELS = {"aor_deg": "AoR", "height_mm": "Height"}


def network_structure(inputs, config):
    """Figure 10: nodes and connections; line width is the weight's size, colour its sign."""
    with open(inputs["network"]) as file:
        network = json.load(file)
    weights = [np.atleast_2d(network["W1"]), np.atleast_2d(network["W2"])]
    places = [_column(x, n) for x, n in zip((0, 1, 2), (*weights[0].T.shape, len(weights[1])), strict=True)]
    figure = style.new_figure(style.COLUMN * 1.2, 3.6)
    panel = figure.subplots()
    for layer, weight in enumerate(weights):
        largest = np.abs(weight).max() or 1.0
        for (j, i), value in np.ndenumerate(weight):
            (x0, y0), (x1, y1) = places[layer][i], places[layer + 1][j]
            size = abs(value) / largest
            colour = style.BLUE if value > 0 else style.RED
            panel.plot(
                [x0, x1], [y0, y1], color=colour, lw=0.1 + 2.4 * size, alpha=0.15 + 0.6 * size, zorder=1
            )
    for nodes, colour in zip(places, (style.BLUE, style.RED, style.GREEN), strict=True):
        panel.scatter(*nodes.T, s=95, color="white", edgecolor=colour, linewidth=1.6, zorder=2)
    for (x, y), name in zip(places[0], network["inputs"], strict=True):
        panel.text(x - 0.11, y, SYMBOLS.get(name, name), ha="right", va="center", fontsize=8.5)
    for (x, y), name in zip(places[2], network["outputs"], strict=True):
        panel.text(x + 0.11, y, OUTPUT_LABELS.get(name, name), ha="left", va="center", fontsize=8)
    activation = network.get("activation", ("tansig", "purelin"))
    titles = ("input", f"hidden ({activation[0]})", f"output ({activation[1]})")
    for x, (title, nodes) in enumerate(zip(titles, places, strict=True)):
        panel.text(x, 1.13, f"{title}\n{len(nodes)}", ha="center", va="bottom", fontsize=7.5)
    for sign, colour, x in (("positive weight", style.BLUE, 0.35), ("negative weight", style.RED, 1.3)):
        panel.plot([x, x + 0.12], [-1.16, -1.16], color=colour, lw=1.8)
        panel.text(x + 0.16, -1.16, sign, va="center", fontsize=6.8)
    panel.set(xlim=(-0.45, 2.45), ylim=(-1.25, 1.38))
    panel.axis("off")
    return figure


def _column(x, count):
    """Places (count, 2) of a layer's nodes, top to bottom, closer together where there are few."""
    reach = min(1.0, 0.11 * (count + 1)) if count > 1 else 0.0
    return np.column_stack([np.full(count, float(x)), np.linspace(reach, -reach, count)])


def predicted_against_simulated(inputs, config):
    """Figure 13: predicted over simulated responses by split, with y = x, R2 (Eq. 13) and RMSE."""
    table = pd.read_csv(inputs["predictions"])
    errors = pd.read_csv(inputs["dataset"])[["sample", "aor_se_deg", "height_se_mm"]]
    table = table.merge(errors, on="sample", how="left")
    figure = style.new_figure(style.PAGE * 0.9, 3.2)
    panels = figure.subplots(1, 2)
    for panel, (column, label, unit), letter in zip(panels, style.RESPONSES, "ab", strict=True):
        quantity = column.split("_")[0]
        predicted, error = f"{quantity}_predicted_{unit}", f"{quantity}_se_{unit}"
        _scatter_by_split(panel, table, column, predicted, error, unit)
        panel.set(xlabel=f"simulated {label} ({unit})", ylabel=f"predicted {label} ({unit})")
        panel.set_title(letter, fontweight="bold")
    panels[1].legend(loc="lower right", handletextpad=0.2)
    figure.supxlabel("horizontal bars: ± 1 standard error of the simulations' mean over seeds", fontsize=6.8)
    return figure


def _scatter_by_split(panel, table, column, predicted, error, unit):
    lines = []
    both = table[[column, predicted]].to_numpy()
    margin = 0.06 * (both.max() - both.min())
    ends = np.array([both.min() - margin, both.max() + margin])
    panel.plot(ends, ends, color=style.GREY, lw=0.9, zorder=1)
    for split, colour, marker in SPLITS:
        rows = table[table["split"] == split]
        if rows.empty:
            continue
        panel.errorbar(
            rows[column],
            rows[predicted],
            xerr=rows[error].fillna(0.0),
            fmt=marker,
            ms=3.2,
            color=colour,
            mec="white",
            mew=0.3,
            elinewidth=0.5,
            ecolor=(*matplotlib_rgb(colour), 0.45),
            label=split,
            zorder=3 if split == "test" else 2,
        )
        residual = rows[column] - rows[predicted]
        spread = ((rows[column] - rows[column].mean()) ** 2).sum()
        r2 = f"{1 - (residual**2).sum() / spread:.3f}" if spread > 0 else "undefined"
        rmse = float(np.sqrt((residual**2).mean()))
        lines.append(f"{split}: R² {r2}, RMSE {rmse:.2f} {unit}, n {len(rows)}")
    panel.set(xlim=ends, ylim=(ends[0], ends[1] + 0.22 * (ends[1] - ends[0])))
    style.note(panel, "\n".join(lines))


def matplotlib_rgb(colour):
    """Red, green and blue of a hex colour, 0 to 1."""
    return tuple(int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
