"""Draw the region that the measurements do not exclude, by history matching.

The layout is that of Vernon, Goldstein & Bower 2010, Bayesian Analysis 5, 619: one side
of the diagonal shows the smallest implausibility over all other parameters, and the
other side shows the optical depth.
"""

from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import QuadMesh
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullLocator

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.scales import LINEAR
from repose.common.files import read_json, read_table
from repose.common.numbers import format_significant

from . import panels, style
from .registry import Inputs, StudyView

REGION_COLUMNS = ("x", "y", "x_quantile", "y_quantile", "least_implausibility", "share")
HIGHEST_MISFIT = 1e9  # upper end of the last band
MAX_TICK_INTERVALS = 3  # maximum number of intervals between the ticks of an axis


class Band(NamedTuple):
    """A band of the misfit below the diagonal."""

    upper_end: float
    colour: str
    words: str


EXCLUSION_MISFIT = 3.0  # misfit from which a parameter set is excluded
BANDS = (
    Band(1.0, "#1B7A5A", "under 1"),
    Band(2.0, "#74BE9E", "1 to 2"),
    Band(EXCLUSION_MISFIT, "#DCEFE4", "2 to 3"),
    Band(HIGHEST_MISFIT, style.RED, "over 3: excluded"),
)
MISFIT_TITLE = (
    "below the diagonal: misfit (standard deviations) at the best values of the other "
    "parameters"
)
FRACTION_TITLE = "fraction of a cell's parameter sets still possible"
# Left edge, lower edge, width and height of the colour bar below the diagonal, as
# fractions of the figure
COLOUR_BAR_BOX = (0.05, 0.18, 0.4, 0.018)


def draw_region(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the smallest misfit below the diagonal, and the fraction of possible sets above.

    If no cell is excluded, the panels below the diagonal are left out.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `region` has a row for each cell of each pair of parameters.
        `summary` contains the fraction of the space that is not excluded.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    table = read_table(inputs["region"], REGION_COLUMNS)
    summary = read_json(inputs["summary"], ("not_implausible_share",))
    names = study.parameters.free
    n_cells = table["x_quantile"].nunique()  # along each parameter
    edges = _compute_cell_edges(study.parameters, n_cells)
    largest_fraction = table["share"].max() or 1.0
    # If no cell is excluded, a map of the smallest misfit gives no information.
    has_excluded_cells = bool((table["least_implausibility"] >= EXCLUSION_MISFIT).any())

    height = 1.08 * style.PAGE if has_excluded_cells else 0.95 * style.PAGE
    figure = style.new_figure(style.PAGE, height)
    axes = figure.subplots(len(names), len(names), squeeze=False)
    fraction_mesh = None  # for the colour bar; a single parameter has none
    for (row, column), panel in np.ndenumerate(axes):
        if row == column:
            _name_parameter(panel, names[row], edges[row])
            continue
        if row > column and not has_excluded_cells:
            panel.set_axis_off()
            continue
        cells = _select_cells(table, names, row=row, column=column)
        x_edges = edges[column]
        y_edges = edges[row]
        if row > column:
            _draw_misfit(panel, cells["least_implausibility"], x_edges, y_edges)
        else:
            # The table contains each pair once, with the earlier parameter across.
            fraction_mesh = _draw_fraction(
                panel, cells["share"].T, x_edges, y_edges, largest_fraction
            )
        panels.set_scale(panel.set_xscale, study.parameters, names[column])
        panels.set_scale(panel.set_yscale, study.parameters, names[row])
        _place_ticks(panel, row, column, last=len(names) - 1)

    if has_excluded_cells:
        patches = [
            Patch(facecolor=band.colour, edgecolor=style.GREY, label=band.words)
            for band in BANDS
        ]
        figure.legend(
            handles=patches,
            title=MISFIT_TITLE,
            loc="outside lower center",
            ncols=len(BANDS),
        )
    if fraction_mesh is not None and has_excluded_cells:
        figure.colorbar(
            fraction_mesh,
            ax=axes,
            location="bottom",
            label=f"above the diagonal: {FRACTION_TITLE}",
            aspect=50,
            pad=0.02,
        )
    elif fraction_mesh is not None:
        # Place the colour bar in the empty half below the diagonal.
        bar_axes = figure.add_axes(COLOUR_BAR_BOX)
        figure.colorbar(
            fraction_mesh, cax=bar_axes, orientation="horizontal", label=FRACTION_TITLE
        )
    percent = 100 * summary["not_implausible_share"]
    title = f"The measurements leave {format_significant(percent, 3)} % of the searched space open"
    if not has_excluded_cells:
        title += "; no pair of values is excluded by itself"
    figure.suptitle(title, fontsize=9)
    return figure


def _compute_cell_edges(parameters: ParameterSpace, n_cells: int) -> list[np.ndarray]:
    """Compute the edges of the cells of each free parameter, in its unit.

    All cells of a parameter have the same prior probability.

    Parameters
    ----------
    parameters : ParameterSpace
        The parameters of the study.
    n_cells : int
        Number of cells of each parameter.

    Returns
    -------
    list of ndarray
        The edges (n_cells + 1,) for each parameter.
    """
    quantile = np.linspace(0, 1, n_cells + 1)[:, None]
    quantiles = np.repeat(quantile, parameters.dimensions, axis=1)
    return list(parameters.free_values(parameters.transform_to_prior(quantiles)).T)


def _select_cells(
    table: pd.DataFrame, names: tuple[str, ...], row: int, column: int
) -> pd.DataFrame:
    """Select the cells of two parameters, with the later one down the rows.

    Parameters
    ----------
    table : DataFrame
        A row for each cell of each pair of parameters.
    names : tuple of str
        Names of the free parameters.
    row, column : int
        Indices of the two parameters, in any order.

    Returns
    -------
    DataFrame
        A square for each column of the table, with the cells of the later parameter as
        rows and those of the earlier parameter as columns.
    """
    first, second = sorted((row, column))
    is_pair = (table["x"] == names[first]) & (table["y"] == names[second])
    cells = table[is_pair]
    return cells.pivot(index="y_quantile", columns="x_quantile")


def _name_parameter(panel: Axes, name: str, edges: np.ndarray) -> None:
    """Write the name and the range of a parameter in place of a panel's contents."""
    panel.set_axis_off()
    panel.text(
        0.5,
        0.5,
        f"{style.parameter_label(name)}\n{format_significant(edges[0], 3)} to {format_significant(edges[-1], 3)}",
        ha="center",
        va="center",
        fontsize=8,
        linespacing=1.6,
    )


def _draw_misfit(
    panel: Axes, misfit: pd.DataFrame, x_edges: np.ndarray, y_edges: np.ndarray
) -> None:
    """Draw the misfit of each cell in the colours of the bands."""
    colours = ListedColormap([band.colour for band in BANDS])
    bounds = [0.0, *(band.upper_end for band in BANDS)]
    panel.pcolormesh(
        x_edges,
        y_edges,
        misfit.to_numpy(float),
        rasterized=True,
        cmap=colours,
        norm=BoundaryNorm(bounds, colours.N),
    )


def _draw_fraction(
    panel: Axes,
    fraction: pd.DataFrame,
    x_edges: np.ndarray,
    y_edges: np.ndarray,
    largest_fraction: float,
) -> QuadMesh:
    """Draw the fraction of possible sets in each cell.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    fraction : DataFrame
        Fractions (cells, cells). The rows belong to the parameter along y.
    x_edges, y_edges : ndarray
        Edges (cells + 1,) of the cells.
    largest_fraction : float
        Fraction at the end of the colour scale.

    Returns
    -------
    QuadMesh
        The cells, for a colour bar.
    """
    return panel.pcolormesh(
        x_edges,
        y_edges,
        fraction.to_numpy(float),
        rasterized=True,
        cmap="Blues",
        vmin=0.0,
        vmax=largest_fraction,
    )


def _place_ticks(panel: Axes, row: int, column: int, last: int) -> None:
    """Place the ticks of a panel in a grid of panels, one for each pair of parameters.

    The ticks are on the sides that face away from the diagonal. Only panels at the
    edges of the grid have numbers.

    Parameters
    ----------
    panel : Axes
        The panel.
    row, column : int
        Row and column of the panel in the grid, counted from 0.
    last : int
        Index of the last row, which is also that of the last column.
    """
    # Panels below the diagonal have ticks at the bottom and on the left, and the others
    # at the top and on the right.
    is_below = row > column
    panel.xaxis.set_ticks_position("bottom" if is_below else "top")
    panel.yaxis.set_ticks_position("left" if is_below else "right")
    panel.tick_params(
        labelbottom=row == last,
        labelleft=column == 0,
        labeltop=row == 0,
        labelright=column == last,
        length=2,
        labelsize=6.5,
    )
    # Only a few ticks fit into a small panel.
    axes: dict[Literal["x", "y"], Axis] = {"x": panel.xaxis, "y": panel.yaxis}
    for name, axis in axes.items():
        if axis.get_scale() == LINEAR:
            panel.locator_params(name, nbins=MAX_TICK_INTERVALS)
        else:
            axis.set_major_locator(LogLocator(numticks=MAX_TICK_INTERVALS + 1))
            axis.set_minor_locator(NullLocator())
    panel.spines[:].set_visible(True)
