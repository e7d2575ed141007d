"""Draw the angle of repose of one pile by all of its definitions.

The angle is the slope of a line through a side of the pile. Each definition draws this
line through other points of the side.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.grain.berry_files import read_grain
from repose.grain.particle import Particle
from repose.measure import pile
from repose.measure.angles import DEFINITIONS
from repose.measure.saved_piles import draw_side_view
from repose.measure.saved_pours import read_first_pour, read_first_seed
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains

from . import style
from .registry import Inputs, StudyView

COLOURS = dict(
    zip(
        DEFINITIONS,
        (style.BLUE, style.RED, style.GREEN, style.PURPLE, style.ORANGE),
        strict=True,
    )
)
LINE_STYLES = dict(
    zip(DEFINITIONS, ("-", "-", "-", (0, (4, 2)), (0, (2, 1))), strict=True)
)
# Greys in which the silhouette and the background are drawn. In the image, the
# silhouette is darker than the middle grey.
PILE_GREY = 205
BACKGROUND_GREY = 255
MIDDLE_GREY = 128
# Smallest distance between two labels of levels, as a fraction of the pile's height.
LABEL_DISTANCE_FRACTION = 0.11
FIGURE_HEIGHT = 4.9  # inches
HEIGHT_RATIOS = (1.5, 1)  # of the view, and of the angles in all views
ROOM_ABOVE_FACTOR = 1.08  # upper end of the view, as a multiple of the pile's height
USED_LINE_WIDTH = 3.0  # of the definition that is used for the response
LINE_WIDTH = 1.5
HALF_BAR = 0.32  # half the length of the bar at a mean, in distances between rows


def draw_definitions(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the lines of every definition on one view, and the angles in all views.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `heap` contains simulated piles, of which the first is drawn.
        `particle` contains the shape of the grains, and `berry` the sizes of the mean
        grain.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    settings = study.settings.measure.for_grain(read_grain(inputs["berry"]))
    pour = read_first_pour(inputs["heap"])
    particle = Particle.load(inputs["particle"])
    image = draw_side_view(pour, particle, settings)
    first_view = _measure_view(image, settings)
    figure = style.new_figure(style.PAGE, FIGURE_HEIGHT)
    above, below = figure.subplots(2, 1, height_ratios=HEIGHT_RATIOS)
    _draw_first_view(above, image, measured=first_view, settings=settings)
    figure.legend(
        *above.get_legend_handles_labels(),
        loc="outside lower left",
        title="lines in view a: mean of both sides (left, right)",
        title_fontsize=style.SMALL_TEXT_PT,
        alignment="left",
    )
    above.set_title(f"a  one view of one pile, seed {read_first_seed(inputs['heap'])}")
    all_views = pile.measure_pile(Grains.of(pour, particle), settings, pour["in_pile"])
    _draw_all_views(below, all_views, first_view)
    return figure


def _measure_view(image: np.ndarray, settings: MeasureSettings) -> pile.Measurement:
    """Measure a silhouette (H, W) in grey, whose last row stands on the plate."""
    from repose.measure.photographs.segmentation import segment  # slow to import

    plate_row = image.shape[0] - 0.5
    silhouette = segment(image, settings.largest_pile_only, plate_row)
    return pile.measure_segmented(silhouette, settings)


def _draw_first_view(
    panel: Axes,
    image: np.ndarray,
    measured: pile.Measurement,
    settings: MeasureSettings,
) -> None:
    """Draw the silhouette of a pile, with the lines of each definition on both sides.

    Lengths in the panel are in mm, and distances are measured from the crest. The panel
    also gets the labels for a legend.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    image : ndarray
        The silhouette (H, W) in grey.
    measured : pile.Measurement
        The measurement of the silhouette.
    settings : MeasureSettings
        Scale of the picture, and settings of the lines.
    """
    # Draw the picture in mm, with the crest at x = 0. A whole column number is the
    # centre of a pixel, so the picture begins half a pixel to the left of column 0.
    scale = settings.mm_per_pixel
    height, width = image.shape
    crest_column, _ = measured.top
    greys = np.where(image < MIDDLE_GREY, PILE_GREY, BACKGROUND_GREY).astype(np.uint8)
    left = (-0.5 - crest_column) * scale
    right = (width - 0.5 - crest_column) * scale
    panel.imshow(
        greys,
        cmap="gray",
        vmin=0,
        vmax=255,
        extent=(left, right, 0, height * scale),
    )
    for name in measured.angles:
        _draw_definition(panel, measured, name=name, settings=settings)
    _draw_levels(panel, measured.height_mm, settings)
    panel.set(
        xlabel="distance from the crest (mm)",
        ylabel="height (mm)",
        ylim=(0, ROOM_ABOVE_FACTOR * measured.height_mm),
        aspect="equal",
    )


def _draw_definition(
    panel: Axes, measured: pile.Measurement, name: str, settings: MeasureSettings
) -> None:
    """Draw both lines of one definition of the angle, with one label for the legend.

    Parameters
    ----------
    panel : Axes
        The panel of the silhouette.
    measured : pile.Measurement
        The measurement of the silhouette.
    name : str
        Name of the definition. The one that `settings.response` chooses for the
        calibrated response gets thicker lines.
    settings : MeasureSettings
        Scale of the picture, and settings of the lines.
    """
    scale = settings.mm_per_pixel
    crest_column, _ = measured.top
    angle = measured.angles[name]
    is_used = name == settings.response
    width = USED_LINE_WIDTH if is_used else LINE_WIDTH
    line_style = {"color": COLOURS[name], "ls": LINE_STYLES[name], "lw": width}
    # Each line is given by points (column, row) of the picture. Convert them to mm.
    for line in angle.lines:
        column, row = np.array(line).T
        x = (column - crest_column) * scale
        z = (measured.base_row - row) * scale
        panel.plot(x, z, **line_style)
    # Add an empty line, so that both lines have a single entry in the legend.
    sides = f"{angle.left_deg:.1f}°, {angle.right_deg:.1f}°"
    label = (
        f"{angle.aor_deg:.1f}° ({sides})  {name}: {style.describe_line(settings, name)}"
    )
    if is_used:
        label += ", used"
    panel.plot([], [], label=label, **line_style)


def _draw_levels(panel: Axes, height_mm: float, settings: MeasureSettings) -> None:
    """Draw the heights between which lines are fitted, and the height of one grain.

    Parameters
    ----------
    panel : Axes
        The panel of the silhouette, in mm.
    height_mm : float
        Height of the pile.
    settings : MeasureSettings
        Settings of the lines.
    """
    # `for_grain` has set the height of a grain, so the fallback 0 only satisfies the
    # type.
    levels = [(settings.berry_height_mm or 0.0, "one grain")]
    for fraction in (settings.fit_from, settings.fit_to):
        # The text "berry" stands for the height of one grain, which is already listed.
        if not isinstance(fraction, str):
            label = f"{100 * fraction:.0f} % of the height"
            levels.append((fraction * height_mm, label))
    left, right = panel.get_xlim()
    text_height = 0.0
    for level, name in sorted(levels):
        panel.axhline(level, color=style.GREY, lw=0.6, ls=":", zorder=0.5)
        # Stack the labels of levels that are close together.
        text_height = max(level, text_height + LABEL_DISTANCE_FRACTION * height_mm)
        panel.text(
            right, text_height, f" {name}", va="center", fontsize=style.SMALL_TEXT_PT
        )
    # The lines must not widen the panel, because the labels begin at its right edge.
    panel.set_xlim(left, right)


def _draw_all_views(
    panel: Axes, all_views: pile.PileResult, first_view: pile.Measurement
) -> None:
    """Draw the angle by each definition in every view, with the mean of the views.

    A ring marks the angle in the first view, which the other panel shows as view a.

    Parameters
    ----------
    panel : Axes
        The panel to draw in, with a row for each definition.
    all_views : pile.PileResult
        Angles of the pile in all views.
    first_view : pile.Measurement
        The measurement in the view that is drawn above.
    """
    # The first definition is at the top.
    rows = [-k for k in range(len(DEFINITIONS))]
    for row, name in zip(rows, DEFINITIONS, strict=True):
        colour = COLOURS[name]
        values = all_views.aor[name]
        panel.plot(
            values,
            np.full(values.size, row),
            "o",
            ms=3.5,
            color=colour,
            alpha=0.55,
            mew=0,
        )
        mean = all_views.mean_deg(name)
        if mean is not None:
            bar = [row - HALF_BAR, row + HALF_BAR]
            panel.plot([mean, mean], bar, color=colour, lw=1.6)
            panel.text(
                1.0,  # the right edge of the panel
                row,
                f"mean {mean:.1f}°",
                transform=panel.get_yaxis_transform(),
                va="center",
            )
        if name in first_view.angles:
            panel.plot(
                first_view.angles[name].aor_deg,
                row,
                "o",
                ms=7,
                mfc="none",
                mec=style.BLACK,
                mew=0.7,
            )
    panel.set_yticks(rows, DEFINITIONS)
    panel.set(ylim=(0.5 - len(rows), 0.9), xlabel="angle of repose (deg)")
    n_views = all_views.view_height_mm.size
    panel.set_title(
        f"b  all {n_views} views of this pile, their mean (bar), and view a (ring)"
    )
