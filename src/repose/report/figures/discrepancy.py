"""Draw the information in the measurements against an assumed error of the simulator.

This error is also called the discrepancy.
"""

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
# The posterior is computed from random points, which count the more, the better they
# agree with the measurements. A row with fewer effective points is unreliable.
MIN_EFFECTIVE_POINTS = 400
UNRELIABLE_OPACITY = 0.3  # of the lines through unreliable estimates
BAND_OPACITY = 0.15
COLUMNS = 3  # number of panels in a row
# Heights in inches of the upper panel, and of each row of panels below it
UPPER_HEIGHT = 2.3
ROW_HEIGHT = 1.55


def draw_information_over_discrepancy(inputs: Inputs, study: StudyView) -> Figure:
    """Draw information and intervals against the error of the simulator.

    Parameters
    ----------
    inputs : mapping
        Path of the table `discrepancy`, which has a row for each value of the error. In
        rows whose `evidence` is ``stated``, the error is assumed. In the other rows, it
        is the spread between the grain models of the shape study.
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
    is_assumed = table["evidence"] == "stated"
    assumed_rows = table[is_assumed]
    shape_study_rows = table[~is_assumed]

    # The upper panel shows the information. Below it, there is a panel for each
    # parameter.
    n_rows = math.ceil(len(names) / COLUMNS)
    heights = [UPPER_HEIGHT, ROW_HEIGHT * n_rows]
    figure = style.new_figure(style.PAGE, sum(heights))
    above, below = figure.subfigures(2, 1, height_ratios=heights)
    _draw_information(above.subplots(), assumed_rows, shape_study_rows)

    axes = panels.add_panels(below, len(names), COLUMNS)
    ranges = parameter_ranges(study.parameters)
    for panel, name in zip(axes, names, strict=True):
        _draw_intervals(
            panel, name, assumed_rows=assumed_rows, shape_study_rows=shape_study_rows
        )
        panels.set_scale(panel.set_yscale, study.parameters, name)
        panel.set(ylabel=style.parameter_label(name), ylim=ranges[name])
    # The last `COLUMNS` panels, which may lie in two rows, have no panel below them.
    for panel in axes[-COLUMNS:]:
        panel.set_xlabel("assumed error (%)")
    title = "95 % intervals of the parameters, in their ranges; bands: assumed errors"
    if len(shape_study_rows):
        title += "; bar: spread of the shape study's models"
    below.suptitle(title, fontsize=7.5)
    return figure


def _draw_information(
    panel: Axes, assumed_rows: pd.DataFrame, shape_study_rows: pd.DataFrame
) -> None:
    """Draw the information in bits against the assumed error, one line per correlation.

    The correlation is that between the errors of different targets.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    assumed_rows : DataFrame
        Rows of discrepancy.csv whose error was assumed.
    shape_study_rows : DataFrame
        Rows whose error comes from the shape study. There may be none.
    """
    x_column = "discrepancy_percent"
    y_column = "information_bits"
    by_correlation = assumed_rows.groupby("discrepancy_correlation")
    for k, (correlation, rows) in enumerate(by_correlation):
        label = "assumed, independent between targets"
        if correlation:
            label = f"assumed, correlation {correlation:g}"
        line_style = style.series_style(k)
        # Draw the whole line in a pale colour, and its reliable parts again over it.
        reliable = _mask_unreliable_rows(rows)
        panel.plot(
            rows[x_column], rows[y_column], **line_style, alpha=UNRELIABLE_OPACITY
        )
        panel.plot(reliable[x_column], reliable[y_column], **line_style, label=label)
    panel.plot(
        shape_study_rows[x_column],
        shape_study_rows[y_column],
        "D",
        color=style.RED,
        label="spread of the shape study's models",
    )
    unreliable_rows = assumed_rows[~_is_reliable(assumed_rows)]
    if len(unreliable_rows):
        panel.plot(
            unreliable_rows[x_column],
            unreliable_rows[y_column],
            "o",
            mfc="white",
            mec=style.GREY,
            label=f"unreliable (pale): fewer than {MIN_EFFECTIVE_POINTS} effective points",
        )
    panel.set(
        xlabel="assumed error of the simulator (% of the target)",
        ylabel="information\n(bits; 1 bit halves the range)",
        ylim=(0, None),
    )
    panel.grid(True)
    panel.legend()


def _mask_unreliable_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Set unreliable rows to NaN, which leaves a gap in a line."""
    return rows.where(_is_reliable(rows))


def _is_reliable(rows: pd.DataFrame) -> pd.Series:
    """Return which rows are based on enough effective points."""
    return rows["effective_points"] >= MIN_EFFECTIVE_POINTS


def _draw_intervals(
    panel: Axes, name: str, assumed_rows: pd.DataFrame, shape_study_rows: pd.DataFrame
) -> None:
    """Draw the 95 % interval of one parameter against the assumed error.

    Each correlation between the errors of targets is a band, and each row of the shape
    study is a bar.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    name : str
        Name of the parameter.
    assumed_rows, shape_study_rows : DataFrame
        Rows of discrepancy.csv, as for `_draw_information`.
    """
    ends = [f"{name}_low", f"{name}_high"]
    by_correlation = assumed_rows.groupby("discrepancy_correlation")
    for k, (_, rows) in enumerate(by_correlation):
        line_style = style.series_style(k)
        # Draw the whole band in a pale colour, and its reliable parts again over it.
        reliable = _mask_unreliable_rows(rows)
        for part, opacity in ((rows, UNRELIABLE_OPACITY), (reliable, 1.0)):
            x = part["discrepancy_percent"]
            low, high = part[ends].to_numpy().T
            panel.fill_between(
                x,
                low,
                high,
                color=line_style["color"],
                alpha=BAND_OPACITY * opacity,
                lw=0,
            )
            panel.plot(x, part[ends], lw=1.1, alpha=opacity, **line_style)
    for _, row in shape_study_rows.iterrows():
        x = row["discrepancy_percent"]
        # The style "-_" is a line with a short bar across each end.
        panel.plot([x, x], row[ends], "-_", color=style.RED, lw=1.4, ms=6)
