"""The region that the measurements do not exclude, by history matching: its projections on pairs of parameters.

The form is that of Vernon, Goldstein & Bower 2010, Bayesian Analysis 5, 619: the least implausibility over all other
parameters on one side of the diagonal, the optical depth on the other.
"""

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from repose.calibrate.parameter_space import ParameterSpace
from repose.common.files import read_json, read_table

from . import style
from .registry import OF_POSTERIOR, Inputs, Shown, figure

COLUMNS = ("x", "y", "x_quantile", "y_quantile", "least_implausibility", "share")
# Least implausibility below the diagonal: upper end of each band, its colour, its words. From 3 on it is excluded.
BANDS = {
    1.0: ("#1B7A5A", "under 1"),
    2.0: ("#74BE9E", "1 to 2"),
    3.0: ("#DCEFE4", "2 to 3"),
    np.inf: (style.RED, "over 3: excluded"),
}
LEAST = "below the diagonal: misfit (standard deviations) at the best values of the other parameters"
DEPTH = "above the diagonal: share of a cell's parameter sets still possible"


INPUTS = {"region": "posterior/region.csv", "summary": "posterior/posterior.json"}


@figure("region", "Region that is not excluded", INPUTS, **OF_POSTERIOR)
def not_excluded(inputs: Inputs, study: Shown) -> Figure:
    """Draw the least misfit below the diagonal, the share of sets still possible above it.

    The region of parameters that the measurements do not exclude (history matching), projected on each pair of
    parameters. Below the diagonal the misfit (minimum implausibility): how many standard deviations the worst
    response lies from its measurement at the best values of all other parameters. Above it the share of parameter
    sets still possible (optical depth): those whose misfit is below three.
    """
    table = read_table(inputs["region"], COLUMNS)
    share = read_json(inputs["summary"], ("not_implausible_share",))[
        "not_implausible_share"
    ]
    names, edges = study.space.free, _edges(study.space, table["x_quantile"].nunique())
    last = len(names) - 1
    colours = ListedColormap([colour for colour, _ in BANDS.values()])
    least = {
        "cmap": colours,
        "norm": BoundaryNorm([0.0, *list(BANDS)[:-1], 1e9], colours.N),
    }
    open_share = {"cmap": "Blues", "vmin": 0.0, "vmax": table["share"].max() or 1.0}
    figure = style.new_figure(style.PAGE, 1.08 * style.PAGE)
    panels = figure.subplots(len(names), len(names), squeeze=False)
    depth = None
    for (row, column), panel in np.ndenumerate(panels):
        if row == column:
            panel.set_axis_off()
            words = f"{style.parameter_label(names[row])}\n{edges[row][0]:.3g} to {edges[row][-1]:.3g}"
            panel.text(
                0.5, 0.5, words, ha="center", va="center", fontsize=8, linespacing=1.6
            )
            continue
        first, second = sorted((row, column))
        cells = table[(table["x"] == names[first]) & (table["y"] == names[second])]
        cells = cells.pivot(index="y_quantile", columns="x_quantile")
        # rows of the picture follow the parameter of the panel's row
        below = row > column
        shown = (cells["least_implausibility"] if below else cells["share"].T).to_numpy(
            float
        )
        mesh = panel.pcolormesh(
            edges[column],
            edges[row],
            shown,
            rasterized=True,
            **(least if below else open_share),
        )
        depth = depth if below else mesh
        panel.xaxis.set_ticks_position("bottom" if below else "top")
        panel.yaxis.set_ticks_position("left" if below else "right")
        panel.tick_params(labelbottom=row == last, labelleft=column == 0)
        panel.tick_params(
            labeltop=row == 0, labelright=column == last, length=2, labelsize=6.5
        )
        panel.locator_params(nbins=3)
        panel.spines[:].set_visible(True)
    patches = [
        Patch(facecolor=colour, edgecolor=style.GREY, label=words)
        for colour, words in BANDS.values()
    ]
    figure.legend(
        handles=patches, title=LEAST, loc="outside lower center", ncols=len(BANDS)
    )
    if depth is not None:
        figure.colorbar(
            depth, ax=panels, location="bottom", label=DEPTH, aspect=50, pad=0.02
        )
    title = f"The measurements leave {100 * share:.3g} % of the searched space open, and exclude the rest"
    figure.suptitle(title, fontsize=9)
    return figure


def _edges(space: ParameterSpace, cells: int) -> list[np.ndarray]:
    """Give the edges of the cells of each free parameter, in its unit."""
    quantile = np.repeat(
        np.linspace(0, 1, cells + 1)[:, None], space.dimensions, axis=1
    )
    return list((space.low + (space.high - space.low) * space.from_prior(quantile)).T)
