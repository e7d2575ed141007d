"""Draw the information in the measurements over an assumed error of the simulator."""

import math

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.common.files import read_table
from repose.report.study_view import parameter_ranges

from . import panels, style
from .registry import Inputs, StudyView

DISCREPANCY_COLUMNS = (
    "discrepancy_percent",
    "discrepancy_correlation",
    "evidence",
    "information_bits",
    "effective_points",
)
MIN_EFFECTIVE_POINTS = 400  # a row with fewer points is a rough estimate
ROUGH_OPACITY = 0.3  # of the lines through rough estimates
COLUMNS = 3  # number of panels in a row


def draw_information_over_discrepancy(inputs: Inputs, study: StudyView) -> Figure:
    """Draw information and intervals over the discrepancy, an error of the simulator.

    Parameters
    ----------
    inputs : mapping
        Path of the table `discrepancy`. In rows whose `evidence` is ``stated``, the
        discrepancy is assumed. In the other rows, it comes from the shape study.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    names = study.parameters.free
    ends = [f"{name}_{end}" for name in names for end in ("low", "high")]
    table = read_table(inputs["discrepancy"], (*DISCREPANCY_COLUMNS, *ends))
    is_stated = table["evidence"] == "stated"
    stated_rows = table[is_stated]
    shape_study_rows = table[~is_stated]

    # The upper panel shows the information. Below it, there is a panel for each
    # parameter.
    n_rows = math.ceil(len(names) / COLUMNS)
    height_above = 2.3
    height_below = 1.55 * n_rows
    figure = style.new_figure(style.PAGE, height_above + height_below)
    above, below = figure.subfigures(2, 1, height_ratios=[height_above, height_below])
    _draw_information(above.subplots(), stated_rows, shape_study_rows)

    axes = panels.add_panels(below, len(names), COLUMNS)
    ranges = parameter_ranges(study.parameters)
    for panel, name in zip(axes, names, strict=True):
        _draw_intervals(
            panel, name, stated_rows=stated_rows, shape_study_rows=shape_study_rows
        )
        panels.set_scale(panel.set_yscale, study.parameters, name)
        panel.set(ylabel=style.parameter_label(name), ylim=ranges[name])
    # Label the last panel of each column, which has no other panel below it.
    for panel in axes[-COLUMNS:]:
        panel.set_xlabel("assumed error (%)")
    title = (
        "95 % intervals of the parameters, in their ranges; bands: error assumed as "
        "above"
    )
    if len(shape_study_rows):
        title += "; bar: spread of the shape study's models"
    below.suptitle(title, fontsize=7.5)
    return figure


def _draw_information(
    panel: Axes, stated_rows: pd.DataFrame, shape_study_rows: pd.DataFrame
) -> None:
    """Draw the information in bits over the assumed error, one line per correlation.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    stated_rows : DataFrame
        Rows of discrepancy.csv whose error was assumed.
    shape_study_rows : DataFrame
        Rows whose error comes from the shape study. There may be none.
    """
    x = "discrepancy_percent"
    y = "information_bits"
    by_correlation = stated_rows.groupby("discrepancy_correlation")
    for k, (correlation, rows) in enumerate(by_correlation):
        label = "assumed, independent between targets"
        if correlation:
            label = f"assumed, correlation {correlation:g}"
        line_style = style.series_style(k)
        # Draw the whole line in a pale colour, and its reliable parts again over it.
        reliable = _mask_rough_rows(rows)
        panel.plot(rows[x], rows[y], **line_style, alpha=ROUGH_OPACITY)
        panel.plot(reliable[x], reliable[y], **line_style, label=label)
    panel.plot(
        shape_study_rows[x],
        shape_study_rows[y],
        "D",
        color=style.RED,
        label="spread of the shape study's models",
    )
    rough_rows = stated_rows[stated_rows["effective_points"] < MIN_EFFECTIVE_POINTS]
    if len(rough_rows):
        panel.plot(
            rough_rows[x],
            rough_rows[y],
            "o",
            mfc="white",
            mec=style.GREY,
            label=f"fewer than {MIN_EFFECTIVE_POINTS} effective points, with pale lines",
        )
    panel.set(
        xlabel="assumed error of the simulator (% of the target)",
        ylabel="information\n(bits; 1 bit halves the range)",
        ylim=(0, None),
    )
    panel.grid(True)
    panel.legend()


def _mask_rough_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Set rows with too few effective points to NaN, which leaves a gap in a line."""
    return rows.where(rows["effective_points"] >= MIN_EFFECTIVE_POINTS)


def _draw_intervals(
    panel: Axes, name: str, stated_rows: pd.DataFrame, shape_study_rows: pd.DataFrame
) -> None:
    """Draw the 95 % interval of one parameter over the assumed error.

    Each correlation is a band, and each row of the shape study is a bar.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    name : str
        Name of the parameter.
    stated_rows, shape_study_rows : DataFrame
        Rows of discrepancy.csv, as for `_draw_information`.
    """
    ends = [f"{name}_low", f"{name}_high"]
    by_correlation = stated_rows.groupby("discrepancy_correlation")
    for k, (_, rows) in enumerate(by_correlation):
        line_style = style.series_style(k)
        # Draw the whole band in a pale colour, and its reliable parts again over it.
        reliable = _mask_rough_rows(rows)
        for part, opacity in ((rows, ROUGH_OPACITY), (reliable, 1.0)):
            x = part["discrepancy_percent"]
            low, high = part[ends].to_numpy().T
            panel.fill_between(
                x, low, high, color=line_style["color"], alpha=0.15 * opacity, lw=0
            )
            panel.plot(x, part[ends], lw=1.1, alpha=opacity, **line_style)
    for _, row in shape_study_rows.iterrows():
        x = row["discrepancy_percent"]
        panel.plot([x, x], row[ends], "-_", color=style.RED, lw=1.4, ms=6)
