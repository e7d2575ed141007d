"""Draw Figures 5, 6 and 8: the simulated pile, its measurement, and the test bench."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from repose.bench.funnel import FunnelSettings
from repose.common.files import read_npz
from repose.grain.berry_files import read_grain
from repose.grain.particle import Particle
from repose.measure import pile
from repose.measure.saved_piles import draw_side_view
from repose.measure.saved_pours import read_first_pour
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains, compute_outlines

from . import panels, style
from .registry import Inputs, StudyView

Point = tuple[float, float]  # x and y in the units of a panel

LEVEL_COLOUR = "#D7191C"
PLATE_COLOUR = "#C9CED3"
PILE_PIXELS = 1300  # width of the picture of a pile at the default resolution
SNAPSHOT_S = 9.0  # time of the pour in Figure 8
DIMENSION_FONT_SIZE = 6.5
# The drawing of the test bench, in mm
PLATE_THICKNESS_MM = 7  # as drawn
ROOM_BESIDE_MM = 75
ROOM_BELOW_MM = 34
ROOM_ABOVE_MM = 34
MIN_HALF_VIEW_MM = 190
# Space in inches for the labels of the axes, across and down
LABEL_WIDTH = 0.5
LABEL_HEIGHT = 0.55


# --- The pile and its measurement -----------------------------------------------------


def draw_simulated_pile(inputs: Inputs, study: StudyView) -> Figure:
    """Draw a shaded picture of a pile.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `heap` contains simulated piles, of which the first is drawn, and
        `particle` the shape of the grains.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    # These imports are slow, and the other figures here do not need them.
    from repose.report.renderer.render import render_pile
    from repose.report.renderer.scenery import look_at, make_box_corners

    pour = read_first_pour(inputs["heap"])
    particle = Particle.load(inputs["particle"])
    centres = pour["position"]
    is_in_pile = pour["in_pile"]
    scales = pour.get("scale", np.ones(len(centres))).astype(float)

    # The picture contains the whole pile. Grains that rolled away may lie outside it.
    centres_of_pile = centres[is_in_pile].astype(float)
    largest_radius_m = particle.bounding_radius_m * scales.max(initial=0.0)
    frame_m = make_box_corners(centres_of_pile, largest_radius_m)
    width = style.scale_picture_pixels(study, PILE_PIXELS)
    view: dict[str, Any] = {"width": width, "height": width // 2, "azimuth_deg": 20.0}
    picture = render_pile(
        centres,
        pour["quaternion"],
        particle,
        frame_m=frame_m,
        scales=scales,
        colour=study.settings.colour,
        **view,
    )

    figure = style.new_figure(style.PAGE, style.PAGE / 2)
    figure.get_layout_engine().set(w_pad=0, h_pad=0)
    panel = figure.subplots()
    panel.imshow(picture, aspect="auto")
    panel.axis("off")
    note = f"{len(centres)} grains poured, {is_in_pile.sum()} in the pile"
    style.write_note(panel, note, x=0.02, y=0.96, fontsize=8)
    # Because of the perspective, the scale bar is correct only at one distance.
    foot_of_axis_m = np.array([*centres_of_pile[:, :2].mean(axis=0), 0.0])
    style.draw_scale_bar(
        panel,
        look_at(frame_m, **view),
        point_m=foot_of_axis_m,
        extent_m=np.ptp(centres_of_pile[:, 0]),
        suffix=" at the pile's axis",
    )
    return figure


def draw_measurement_steps(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the steps of the measurement (section 2.3 of the paper).

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
    from repose.measure.photographs import drawing  # slow to import

    settings = study.settings.measure.for_grain(read_grain(inputs["berry"]))
    particle = Particle.load(inputs["particle"])
    image = draw_side_view(read_first_pour(inputs["heap"]), particle, settings)
    scale = settings.mm_per_pixel
    base_row = image.shape[0] - 0.5
    steps = drawing.draw_steps(image, scale, settings, base_row=base_row)
    measured = pile.measure_image(image, scale, settings, base_row=base_row)

    # Draw three steps in the upper row, and the last one below them.
    figure = style.new_figure(style.PAGE, 3.6)
    axes = figure.subplot_mosaic("abc;ddd", height_ratios=(1, 2.2))
    for (letter, panel), (title, picture) in zip(
        axes.items(), steps.items(), strict=True
    ):
        _draw_step(panel, picture, scale)
        panel.set_title(f"{letter}  {title}")
        # The first panel of each row has the label of the y axis for the whole row.
        if letter in "ad":
            panel.set_ylabel("z (mm)")
    height_mm = scale * image.shape[0]
    _name_lines(axes["d"], measured, settings=settings, height_mm=height_mm)
    return figure


def _draw_step(panel: Axes, picture: np.ndarray, mm_per_pixel: float) -> None:
    """Draw the picture of a step in mm, so that the axes show lengths.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    picture : ndarray
        The picture, grey (H, W) or BGR (H, W, 3).
    mm_per_pixel : float
        Scale of the picture.
    """
    height, width, *channels = picture.shape
    panel.imshow(
        picture[..., ::-1] if channels else picture,
        cmap="gray",
        vmin=0,
        vmax=255,
        extent=(0, mm_per_pixel * width, 0, mm_per_pixel * height),
    )
    panel.set_xlabel("x (mm)")


def _name_lines(
    panel: Axes,
    measured: pile.Measurement,
    settings: MeasureSettings,
    height_mm: float,
) -> None:
    """Write the angle of each flank beside its line, and their mean above the picture.

    Parameters
    ----------
    panel : Axes
        The panel of the picture, in mm.
    measured : pile.Measurement
        The measurement of the picture.
    settings : MeasureSettings
        Scale of the picture, and settings of the line.
    height_mm : float
        Height of the picture.
    """
    from repose.measure.photographs import drawing  # slow to import

    angle = measured.angles[settings.response]
    scale = settings.mm_per_pixel
    left_line, right_line = angle.lines
    # For each flank: its name, angle and line, and the colour, the alignment and the
    # offset of the label beside the line
    flanks = (
        ("left", angle.left_deg, left_line, drawing.RED, "right", -12),
        ("right", angle.right_deg, right_line, drawing.GREEN, "left", 12),
    )
    for name, flank_deg, line, blue_green_red, alignment, offset_pt in flanks:
        # Find the middle of the line. Rows are counted downwards, and refer to the
        # centre of a pixel.
        column, row = np.mean(line, axis=0)
        middle = (column * scale, height_mm - (row + 0.5) * scale)
        panel.annotate(
            f"{name} {flank_deg:.1f}°",
            middle,
            (offset_pt, 12),
            textcoords="offset points",
            ha=alignment,
            fontweight="bold",
            color=[value / 255 for value in reversed(blue_green_red)],
        )
    panel.set_title(f"d  boundary, Height {measured.height_mm:.1f} mm")
    line_words = style.describe_line(settings)
    panel.set_title(
        f"angle of this view {angle.aor_deg:.1f}°, {line_words}", loc="right"
    )


# --- The test bench -------------------------------------------------------------------


def draw_test_bench(inputs: Inputs, study: StudyView) -> Figure:
    """Draw a side view of the test bench in mm, with the grains of a pour if available.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `trajectory` contains the positions of the grains over time, and
        `particle` their shape. If either is missing, no grains are drawn.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    from repose.report.renderer.scenery import make_funnel_walls  # slow to import

    # All lengths are in mm. The factory is the place where the grains are created.
    settings = study.settings.funnel
    walls = make_funnel_walls(settings.funnel)
    top = 1e3 * walls[-1].z_high_m
    half_inlet = settings.inlet_diameter_mm / 2
    factory = top + settings.factory_height_mm
    # Leave room for the dimensions beside the funnel, below the plate and above the
    # factory.
    half_view = max(half_inlet + ROOM_BESIDE_MM, MIN_HALF_VIEW_MM)
    low = -ROOM_BELOW_MM
    high = factory + ROOM_ABOVE_MM

    # The panel is to scale, so its width gives its height.
    width = 1.3 * style.COLUMN
    panel_width = width - LABEL_WIDTH
    panel_height = panel_width * (high - low) / (2 * half_view)
    figure, (panel,) = panels.grid(1, panel_height + LABEL_HEIGHT, width=width)
    if {"trajectory", "particle"} <= inputs.keys():
        _draw_grains(panel, inputs, study.settings.colour)
    _draw_funnel(panel, walls, settings)
    half_plate = min(settings.plate_diameter_mm / 2, half_view)
    panel.fill_between(
        [-half_plate, half_plate],
        -PLATE_THICKNESS_MM,
        0,
        color=PLATE_COLOUR,
        lw=0,
        zorder=2,
    )
    panel.set(
        xlim=(-half_view, half_view),
        ylim=(low, high),
        aspect="equal",
        xticks=np.arange(-150, 151, 50),
    )
    _draw_levels(panel, settings, factory=factory, half_view=half_view)
    _draw_dimensions(panel, settings, top=top, half_inlet=half_inlet)
    panel.set(xlabel="x (mm)", ylabel="z (mm)")
    return figure


def _draw_grains(panel: Axes, inputs: Inputs, colour: str) -> None:
    """Draw a side view of the grains during a pour, each with its true outline.

    Parameters
    ----------
    panel : Axes
        The panel of the test bench, in mm.
    inputs : mapping
        Paths of the `trajectory` of the pour and of the `particle`.
    colour : str
        Colour of the grains.
    """
    particle = Particle.load(inputs["particle"])
    record = read_npz(
        inputs["trajectory"],
        ("time_s", "position", "quaternion"),
        "the trajectory of a pour",
    )
    times_s = record["time_s"]
    frame = int(np.argmin(np.abs(times_s - SNAPSHOT_S)))
    grains = Grains(
        record["position"][frame],
        record["quaternion"][frame],
        particle=particle,
        scales=record.get("scale", 1.0),
    )
    is_there = np.isfinite(grains.centres_m).all(axis=1)
    # The view is along y, and x points to the right. Draw the nearest grains, which
    # have the smallest y, last and over the others.
    shown_grains = np.flatnonzero(is_there)
    nearness = -grains.centres_m[shown_grains, 1]
    far_to_near = shown_grains[np.argsort(nearness)]
    outlines_m = compute_outlines(grains[far_to_near], [0.0])[0]
    panel.add_collection(
        PolyCollection(
            1e3 * outlines_m,
            facecolors=colour,
            edgecolors=style.BLACK,
            linewidths=0.25,
            zorder=2.5,
        )
    )
    title = (
        f"simulated pour at {times_s[frame]:.3g} s, {is_there.sum()} of "
        f"{len(is_there)} grains; lengths in mm"
    )
    panel.set_title(title, fontsize=7)


def _draw_funnel(panel: Axes, walls: Any, settings: FunnelSettings) -> None:
    """Draw the walls of the funnel on both sides, and its rounded rim.

    Parameters
    ----------
    panel : Axes
        The panel of the test bench, in mm.
    walls : sequence of Frustum
        The walls.
    settings : FunnelSettings
        The section `funnel`.
    """
    for wall in walls:
        heights = [1e3 * wall.z_low_m, 1e3 * wall.z_high_m]
        for side in (-1, 1):
            radii = [side * 1e3 * wall.r_low_m, side * 1e3 * wall.r_high_m]
            panel.plot(radii, heights, color=style.BLACK, lw=1.6, zorder=3)
    rim_radius = settings.rim_radius_mm
    for side in (-1, 1):
        x = side * (settings.outlet_diameter_mm / 2 + rim_radius)
        centre = (x, settings.outlet_height_mm)
        panel.add_patch(Circle(centre, rim_radius, color=style.BLACK, zorder=3))


def _draw_levels(
    panel: Axes, settings: FunnelSettings, factory: float, half_view: float
) -> None:
    """Draw lines at the heights where grains are created, of the outlet and of the plate.

    Parameters
    ----------
    panel : Axes
        The panel of the test bench, in mm.
    settings : FunnelSettings
        The section `funnel`.
    factory : float
        Height at which grains are created.
    half_view : float
        Half of the panel's width.
    """
    levels = {
        "grains are made here": factory,
        "funnel outlet": settings.outlet_height_mm,
        "": 0.0,
    }
    for name, level in levels.items():
        panel.axhline(level, color=LEVEL_COLOUR, lw=0.9, zorder=4)
        panel.text(
            half_view - 3,
            level + 2,
            name,
            color=LEVEL_COLOUR,
            ha="right",
            va="bottom",
            fontsize=style.SMALL_TEXT_PT,
        )
    half_factory = settings.factory_diameter_mm / 2
    panel.plot(
        [-half_factory, half_factory],
        [factory, factory],
        color=LEVEL_COLOUR,
        lw=2.6,
        zorder=4,
    )


def _draw_dimensions(
    panel: Axes, settings: FunnelSettings, top: float, half_inlet: float
) -> None:
    """Draw the dimensions of the test bench as arrows with numbers, or as text.

    Diameters are drawn near the heights to which they belong, and heights on the left.

    Parameters
    ----------
    panel : Axes
        The panel of the test bench, in mm.
    settings : FunnelSettings
        The section `funnel`.
    top : float
        Height of the inlet in mm.
    half_inlet : float
        Half of the inlet's diameter in mm.
    """
    outlet = settings.outlet_height_mm
    half_outlet = settings.outlet_diameter_mm / 2

    # Draw the diameter of the inlet above the factory, and the diameter of the outlet
    # below the outlet. All distances in this function were chosen by eye.
    inlet_z = top + settings.factory_height_mm + 14
    draw_dimension(
        panel,
        start=(-half_inlet, inlet_z),
        end=(half_inlet, inlet_z),
        text=f"inlet {2 * half_inlet:g}",
        position=(0, inlet_z + 4),
        va="bottom",
    )
    outlet_z = outlet - 11
    draw_dimension(
        panel,
        start=(-half_outlet, outlet_z),
        end=(half_outlet, outlet_z),
        text=f"{2 * half_outlet:g}",
        position=(half_outlet + 4, outlet_z),
        ha="left",
        va="center",
    )

    # Draw the height of the outlet above the plate, and the height of the funnel.
    heights_x = -half_inlet - 32
    for low, high, text in (
        (0, outlet, f"{outlet:g}"),
        (outlet, top, f"{top - outlet:.0f}"),
    ):
        draw_dimension(
            panel,
            start=(heights_x, low),
            end=(heights_x, high),
            text=text,
            position=(heights_x - 4, (low + high) / 2),
            ha="right",
            va="center",
        )

    # Write the angle of the cone beside the middle of its right side, and the size of
    # the plate below the plate.
    text_style = {"color": style.BLUE, "fontsize": DIMENSION_FONT_SIZE}
    panel.text(
        (half_outlet + half_inlet) / 2 + 9,
        (outlet + top) / 2 - 8,
        f"{settings.cone_angle_deg:g}° from horizontal",
        **text_style,
    )
    plate = settings.plate_diameter_mm
    remark = ""
    if plate > np.ptp(panel.get_xlim()):
        remark = ", wider than this view"
    panel.text(
        0, -11, f"plate diameter {plate:g}{remark}", ha="center", va="top", **text_style
    )


def draw_dimension(
    panel: Axes, start: Point, end: Point, text: str, position: Point, **options: Any
) -> None:
    """Draw a dimension of the test bench as an arrow with two heads and a number.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    start, end : tuple of float
        Both ends of the arrow, each as x and y.
    text : str
        The number, which may follow a name.
    position : tuple of float
        Position of the number, as x and y.
    **options
        Arguments of matplotlib's `text`. By default, the number is centred
        horizontally.
    """
    arrow = {
        "arrowstyle": "<->",
        "lw": 0.8,
        "shrinkA": 0,
        "shrinkB": 0,
        "mutation_scale": 7,
        "color": style.BLUE,
    }
    panel.annotate("", start, xytext=end, arrowprops=arrow, zorder=5)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
    x, y = position
    panel.text(
        x,
        y,
        text,
        color=style.BLUE,
        fontsize=DIMENSION_FONT_SIZE,
        zorder=5,
        bbox=box,
        **({"ha": "center"} | options),
    )
