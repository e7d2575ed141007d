"""Arrange panels in grids: one for each parameter, or for each pair of parameters."""

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from repose.bench.parameters import SYMBOLS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.scales import LINEAR, SCALES
from repose.calibrate.targets import Target, Targets
from repose.report.study_view import parameter_ranges

from .style import PAGE, new_figure, parameter_label, response_label

# Font sizes in points: labels of axes in small panels, and numbers at the ticks of pair
# panels
AXIS_LABEL_PT = 8.5
PAIR_TICK_PT = 6


def grid(
    count: int,
    row_height: float,
    columns: int = 2,
    extra_height: float = 0.0,
    width: float = PAGE,
    **options: Any,
) -> tuple[Figure, list[Axes]]:
    """Make a figure with panels in rows of the same height.

    Parameters
    ----------
    count : int
        Number of panels.
    row_height : float
        Height of a row in inches.
    columns : int
        Largest number of panels in a row.
    extra_height : float
        Height in inches that is added to that of the rows.
    width : float
        Width of the figure in inches.
    **options
        Arguments of matplotlib's `subplots`.

    Returns
    -------
    figure : Figure
        The figure.
    panels : list of Axes
        The panels, row by row.
    """
    rows = math.ceil(count / min(columns, count))
    figure = new_figure(width, extra_height + row_height * rows)
    return figure, add_panels(figure, count, columns, **options)


def add_panels(
    figure: FigureBase, count: int, columns: int = 2, **options: Any
) -> list[Axes]:
    """Add panels to an empty figure, row by row; the last row may not be full.

    Parameters
    ----------
    figure : FigureBase
        The figure.
    count : int
        Number of panels.
    columns : int
        Largest number of panels in a row.
    **options
        Arguments of matplotlib's `subplots`.

    Returns
    -------
    list of Axes
        The panels.
    """
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    panels = figure.subplots(rows, columns, squeeze=False, **options).ravel()
    for panel in panels[count:]:
        panel.axis("off")
    return list(panels[:count])


class ParameterPanel(NamedTuple):
    """A panel of one response over one parameter."""

    axes: Axes
    target: Target
    parameter: str


def make_parameter_panels(
    targets: Targets, parameters: ParameterSpace, row_height: float
) -> tuple[Figure, list[ParameterPanel]]:
    """Make a figure with a row for each target and a column for each free parameter.

    Parameters
    ----------
    targets : Targets
        The targets.
    parameters : ParameterSpace
        The parameters. Their ranges and scales become those of the x axes.
    row_height : float
        Height of a row in inches.

    Returns
    -------
    figure : Figure
        The figure.
    panels : list of ParameterPanel
        The panels, row by row.
    """
    free = parameters.free
    ranges = parameter_ranges(parameters)
    figure = new_figure(PAGE, 0.5 + row_height * len(targets))
    panels = figure.subplots(
        len(targets), len(free), sharex="col", sharey="row", squeeze=False
    )
    # Only the panels on the left and at the bottom have labels.
    for panel, target in zip(panels[:, 0], targets, strict=True):
        panel.set_ylabel(response_label(target.response))
    for panel, name in zip(panels[-1], free, strict=True):
        panel.set_xlabel(parameter_label(name), fontsize=AXIS_LABEL_PT)
        set_scale(panel.set_xscale, parameters, name)
        panel.set_xlim(ranges[name])
    return figure, [
        ParameterPanel(panel, target, name)
        for panel, (target, name) in zip(
            panels.flat, product(targets, free), strict=True
        )
    ]


def set_scale(
    set_axis: Callable[[str], None], parameters: ParameterSpace, name: str
) -> None:
    """Give an axis the scale of a parameter, unless this scale is linear.

    Parameters
    ----------
    set_axis : callable
        A method of matplotlib's axes that sets a scale, `set_xscale` or `set_yscale`.
    parameters : ParameterSpace
        The parameters of the study.
    name : str
        Name of the parameter.
    """
    if name in parameters.scale:
        set_axis(parameters.scale[name])


class PairPanel(NamedTuple):
    """A panel of two parameters; on the diagonal they are the same."""

    axes: Axes
    x_name: str
    y_name: str


def add_pair_panels(figure: FigureBase, parameters: ParameterSpace) -> list[PairPanel]:
    """Add a grid of panels to an empty figure, one for each pair of free parameters.

    The panels lie on the diagonal, where both parameters are the same, and below it.

    Parameters
    ----------
    figure : FigureBase
        The figure.
    parameters : ParameterSpace
        The parameters of the study.

    Returns
    -------
    list of PairPanel
        The panels, row by row.
    """
    names = parameters.free
    square = figure.subplots(len(names), len(names), sharex="col", squeeze=False)
    panels = []
    for (row, column), axes in np.ndenumerate(square):
        if column > row:
            axes.axis("off")
        else:
            panels.append(PairPanel(axes, x_name=names[column], y_name=names[row]))
    return panels


def finish_pair_panels(
    panels: Sequence[PairPanel], parameters: ParameterSpace, margin: float = 0.0
) -> None:
    """Set the limits, ticks and labels of pair panels that have been drawn.

    Parameters
    ----------
    panels : sequence of PairPanel
        The panels of `add_pair_panels`.
    parameters : ParameterSpace
        The parameters of the study.
    margin : float
        Margin beyond both ends of each axis, as a fraction of the parameter's range
        along its scale.
    """
    names = parameters.free
    limits = _compute_axis_limits(parameters, margin)
    for axes, x_name, y_name in panels:
        is_diagonal = x_name == y_name
        is_first_column = x_name == names[0]
        # A panel on the diagonal shows one parameter as a histogram. Its heights need
        # no numbers, so its y axis is hidden as a whole.
        has_y_axis = is_first_column and not is_diagonal
        set_scale(axes.set_xscale, parameters, x_name)
        axes.set_xlim(limits[x_name])
        axes.tick_params(labelsize=PAIR_TICK_PT, labelleft=has_y_axis)
        if is_diagonal:
            axes.set_yticks([])
            axes.spines["left"].set_visible(False)
        else:
            set_scale(axes.set_yscale, parameters, y_name)
            axes.set_ylim(limits[y_name])
        if y_name == names[-1]:
            axes.set_xlabel(parameter_label(x_name), fontsize=AXIS_LABEL_PT)
        if has_y_axis:
            axes.set_ylabel(parameter_label(y_name), fontsize=AXIS_LABEL_PT)


def _compute_axis_limits(
    parameters: ParameterSpace, margin: float
) -> dict[str, list[float]]:
    """Compute the limits of an axis for each free parameter, with a margin.

    The margin is computed in coordinates: the values of a parameter along its scale,
    such as their logarithms.

    Parameters
    ----------
    parameters : ParameterSpace
        The parameters of the study.
    margin : float
        Margin beyond both ends of the range, as a fraction of the range. On a
        logarithmic scale, it is a fraction of the range of the logarithm.

    Returns
    -------
    dict
        The lower and the upper limit of each axis, by the name of the parameter and in
        its unit.
    """
    limits = {}
    lows, highs = parameters.coordinate_bounds
    for name, low, high in zip(
        parameters.free, lows.tolist(), highs.tolist(), strict=True
    ):
        margin_width = margin * (high - low)
        coordinates = np.array([low - margin_width, high + margin_width])
        # Convert the coordinates back to values of the parameter.
        scale = SCALES[parameters.scale.get(name, LINEAR)]
        limits[name] = scale.backward(coordinates).tolist()
    return limits


def label_strips(panel: Axes, names: Sequence[str]) -> None:
    """Label a panel with a horizontal strip for each parameter.

    Parameters
    ----------
    panel : Axes
        The panel. Its x axis is the position in the parameter's range, from 0 to 1.
    names : sequence of str
        Names of the parameters, from top to bottom.
    """
    symbols = [SYMBOLS.get(name, name) for name in reversed(names)]
    panel.set_yticks(range(len(names)), symbols, fontsize=9)
    panel.set_xticks([0, 0.25, 0.5, 0.75, 1.0])
    panel.set_xlabel("position in the parameter's range (dimensionless)")
    panel.spines["left"].set_visible(False)
    panel.tick_params(axis="y", length=0)
