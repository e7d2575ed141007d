"""Figures 10 and 13: the network, and the quality of its predictions."""

import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from repose.core.files import read_json, read_table
from repose.core.parameters import SYMBOLS
from repose.core.responses import Response, response

from . import style

ACTIVATIONS = {"tansig": "tanh", "purelin": "linear"}  # by the names that MATLAB has for them
SPLITS = (("train", style.BLUE, "o"), ("validation", style.ORANGE, "s"), ("test", style.RED, "^"))


def network_structure(inputs: Mapping[str, Any], config: Mapping[str, Any]) -> Figure:
    """Figure 10 of the paper, for the best network: line width is the weight's size, colour and dashes its sign."""
    network = read_json(inputs["network"], ("inputs", "outputs", "W1", "W2"), "the file of a network")
    weights = [np.atleast_2d(network["W1"]), np.atleast_2d(network["W2"])]
    places = [_column(x, n) for x, n in zip((0, 1, 2), (*weights[0].T.shape, len(weights[1])), strict=True)]
    figure = style.new_figure(style.COLUMN * 1.2, 3.6)
    panel = figure.subplots()
    _connections(panel, weights, places)
    for nodes in places:
        panel.scatter(*nodes.T, s=95, color="white", edgecolor=style.BLACK, linewidth=1.2, zorder=2)
    for (x, y), name in zip(places[0], network["inputs"], strict=True):
        panel.text(x - 0.11, y, SYMBOLS[name], ha="right", va="center", fontsize=8.5)
    symbols = [response(name, inputs["network"]).symbol for name in network["outputs"]]
    for (x, y), symbol in zip(places[2], symbols, strict=True):
        panel.text(x + 0.11, y, symbol, ha="left", va="center", fontsize=8)
    hidden, output = (ACTIVATIONS.get(name, name) for name in network.get("activation", ACTIVATIONS))
    titles = ("input", f"hidden ({hidden})", f"output ({output})")
    for x, (title, nodes) in enumerate(zip(titles, places, strict=True)):
        panel.text(x, 1.13, f"{title}\n{len(nodes)}", ha="center", va="bottom", fontsize=7.5)
    for sign, x in ((1, 0.35), (-1, 1.3)):
        panel.plot([x, x + 0.16], [-1.16, -1.16], **_look(sign), lw=1.8)
        panel.text(
            x + 0.2, -1.16, f"{'positive' if sign > 0 else 'negative'} weight", va="center", fontsize=6.8
        )
    longest = max(len(symbol) for symbol in symbols)
    panel.set(xlim=(-0.45, 2.45 + 0.055 * max(0, longest - 6)), ylim=(-1.25, 1.38))
    panel.axis("off")
    return figure


def _look(weight: float) -> dict[str, Any]:
    """Colour and line of a weight by its sign."""
    return {"color": style.BLUE} if weight > 0 else {"color": style.RED, "ls": (0, (3, 1))}


def _connections(panel: Axes, weights: list[np.ndarray], places: list[np.ndarray]) -> None:
    """A line for each weight between the nodes of one layer and the next."""
    for layer, weight in enumerate(weights):
        largest = np.abs(weight).max() or 1.0
        for (j, i), value in np.ndenumerate(weight):
            (x0, y0), (x1, y1) = places[layer][i], places[layer + 1][j]
            size = abs(value) / largest
            width, alpha = 0.1 + 2.4 * size, 0.15 + 0.6 * size
            panel.plot([x0, x1], [y0, y1], **_look(value), lw=width, alpha=alpha, zorder=1)


def _column(x: float, count: int) -> np.ndarray:
    """Places (count, 2) of a layer's nodes, top to bottom; few nodes stand closer together."""
    reach = min(1.0, 0.11 * (count + 1)) if count > 1 else 0.0
    return np.column_stack([np.full(count, float(x)), np.linspace(reach, -reach, count)])


def predicted_against_simulated(inputs: Mapping[str, Any], config: Mapping[str, Any]) -> Figure:
    """Figure 13 of the paper: predicted over simulated responses by split, with y = x, R2 (Eq. 13) and RMSE."""
    targets = style.targets_of(config)
    table = read_table(inputs["predictions"], ("sample", "split", *targets.names, *targets.predicted))
    errors = read_table(inputs["dataset"], ("sample", *targets.errors))
    table = table.merge(errors[["sample", *targets.errors]], on="sample", how="left")
    count = len(targets)
    figure = style.new_figure(0.45 * style.PAGE * min(count, 2), 3.2 * style.grid_rows(count))
    panels = style.grid(figure, count)
    for panel, shown in zip(panels, targets.responses, strict=True):
        _scatter_by_split(panel, table, shown)
        panel.set(
            xlabel=style.response_label(shown, "simulated"), ylabel=style.response_label(shown, "predicted")
        )
    style.name_panels(panels)
    panels[-1].legend(loc="lower right", handletextpad=0.2)
    caption = "horizontal bars: ± 1 standard error of the simulations' mean over seeds"
    figure.supxlabel(caption if count > 1 else "\n".join(textwrap.wrap(caption, 45)), fontsize=6.8)
    return figure


def _scatter_by_split(panel: Axes, table: pd.DataFrame, shown: Response) -> None:
    """Points of one response with the line y = x; R2, RMSE and number of samples of each split as a note."""
    lines = []
    both = table[[shown.name, shown.predicted]].to_numpy()
    margin = 0.06 * (both.max() - both.min())
    ends = np.array([both.min() - margin, both.max() + margin])
    panel.plot(ends, ends, color=style.GREY, lw=0.9, zorder=1)
    for split, colour, marker in SPLITS:
        rows = table[table["split"] == split]
        if rows.empty:
            continue
        panel.errorbar(
            rows[shown.name],
            rows[shown.predicted],
            xerr=rows[shown.error].fillna(0.0),
            fmt=marker,
            ms=3.2,
            color=colour,
            mec="white",
            mew=0.3,
            elinewidth=0.5,
            ecolor=(*to_rgb(colour), 0.45),
            label=split,
            zorder=3 if split == "test" else 2,
        )
        residual = rows[shown.name] - rows[shown.predicted]
        spread = ((rows[shown.name] - rows[shown.name].mean()) ** 2).sum()
        r2 = f"{1 - (residual**2).sum() / spread:.3f}" if spread > 0 else "undefined"
        rmse = float(np.sqrt((residual**2).mean()))
        lines.append(f"{split}: R² {r2}, RMSE {rmse:.2f} {shown.unit}, n {len(rows)}")
    panel.set(xlim=ends, ylim=(ends[0], ends[1] + 0.22 * (ends[1] - ends[0])))
    style.note(panel, "\n".join(lines))
