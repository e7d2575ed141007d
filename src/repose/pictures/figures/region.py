"""The region that the measurements do not exclude, by history matching: its projections on pairs of parameters.

Vernon, Goldstein & Bower 2010, Bayesian Analysis 5, 619, show a region of many dimensions so: the least implausibility
over all other parameters on one side of the diagonal, the optical depth on the other.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from repose.core.files import read_json, read_table
from repose.core.parameter_space import ParameterSpace

from . import style

COLUMNS = ("x", "y", "x_quantile", "y_quantile", "least_implausibility", "share")
LIMIT = 3.0  # implausible from here on
# Below and above the diagonal: column, label, colours, and the value of the last colour.
LEAST = ("least_implausibility", "below the diagonal: minimum implausibility", "viridis_r", LIMIT)
DEPTH = ("share", "above: optical depth, the share of a cell that is not implausible", "cividis", 1.0)


def not_excluded(inputs: Mapping[str, str], config: Mapping[str, Any]) -> Figure:
    """Each pair of free parameters: minimum implausibility below the diagonal, optical depth above it."""
    table = read_table(inputs["region"], COLUMNS)
    share = read_json(inputs["summary"], ("not_implausible_share",))["not_implausible_share"]
    space = ParameterSpace.of(config["parameters"])
    names, edges = space.free, _edges(space, table["x_quantile"].nunique())
    figure = style.new_figure(style.PAGE, 1.05 * style.PAGE)
    panels = figure.subplots(len(names), len(names), squeeze=False)
    drawn: dict[str, Any] = {}
    for (row, column), panel in np.ndenumerate(panels):
        if row == column:
            panel.set_axis_off()
            panel.text(0.5, 0.5, style.parameter_label(names[row]), ha="center", va="center", fontsize=8)
            continue
        first, second = sorted((row, column))
        cells = table[(table["x"] == names[first]) & (table["y"] == names[second])]
        quantity, label, colours, most = LEAST if row > column else DEPTH
        # rows of the picture follow the parameter of the panel's row
        grid = cells.pivot(
            index=f"{'y' if row > column else 'x'}_quantile",
            columns=f"{'x' if row > column else 'y'}_quantile",
            values=quantity,
        )
        shown = np.ma.masked_invalid(grid.to_numpy(float))
        drawn[label] = panel.pcolormesh(edges[column], edges[row], shown, cmap=colours, vmin=0, vmax=most)
        panel.tick_params(labelbottom=row == len(names) - 1, labelleft=column == 0)
    for label, mesh in drawn.items():
        extend = "max" if label == LEAST[1] else "neither"
        figure.colorbar(mesh, ax=panels, location="bottom", label=label, extend=extend, aspect=50, pad=0.01)
    figure.suptitle(f"{100 * share:.3g} % of the prior is not implausible (I < {LIMIT:g})", fontsize=8)
    return figure


def _edges(space: ParameterSpace, cells: int) -> list[np.ndarray]:
    """Edges of the cells of each free parameter, in its unit."""
    edges = []
    for k in range(space.dimensions):
        quantile = np.full((cells + 1, space.dimensions), 0.5)
        quantile[:, k] = np.linspace(0, 1, cells + 1)
        edges.append(space.low[k] + (space.high[k] - space.low[k]) * space.from_prior(quantile)[:, k])
    return edges
