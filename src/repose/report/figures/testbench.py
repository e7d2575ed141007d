"""Figures 5, 6 and 8: the simulated pile, its measurement, and the test bench."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from repose.common.files import read_npz
from repose.grain.berry_files import read_berry
from repose.grain.particle import Particle
from repose.measure import pile
from repose.measure.photographs import drawing
from repose.measure.saved_piles import side_view
from repose.measure.saved_pours import first_pour
from repose.measure.silhouette import Grains, outlines

from . import style
from .registry import MEASURED_PILE, PILE, Inputs, Shown, figure, has_pile

Place = tuple[float, float]

LINE = "#D7191C"
PILE_PIXELS = 1300
SNAPSHOT_S = 9.0


@figure("figure05", "Figure 5", PILE, reads=("funnel", "colour"), when=has_pile)
def simulated_pile(inputs: Inputs, study: Shown) -> Figure:
    """Draw a shaded picture of the first pour of the file, the counterpart of the paper's photograph.

    Figure 5. Pile of the representative solution, simulated: the counterpart of the photographed pile.
    """
    from repose.report.renderer.render import (
        render_pile,  # slow to import, and the other figures here do without
    )
    from repose.report.renderer.scenery import boxes, look_at

    poured, particle = first_pour(inputs["heap"]), Particle.load(inputs["particle"])
    centres, quaternions, in_pile = (
        poured[name] for name in ("position", "quaternion", "in_pile")
    )
    scales = poured.get("scale", np.ones(len(centres))).astype(float)
    near = centres[in_pile].astype(float)
    frame = boxes(near, particle.bounding_radius_m * scales.max(initial=0.0))
    width = style.pixels(study, PILE_PIXELS)
    size: dict[str, Any] = {"width": width, "height": width // 2, "azimuth_deg": 20.0}
    look: dict[str, Any] = {"frame_m": frame, "scales": scales, "colour": study.colour}
    figure = style.new_figure(style.PAGE, style.PAGE / 2)
    figure.get_layout_engine().set(w_pad=0, h_pad=0)
    panel = figure.subplots()
    panel.imshow(
        render_pile(centres, quaternions, particle, **size, **look), aspect="auto"
    )
    panel.axis("off")
    style.note(
        panel,
        f"{len(centres)} grains poured, {in_pile.sum()} in the pile",
        x=0.02,
        y=0.96,
        fontsize=8,
    )
    axis = np.array([*near[:, :2].mean(axis=0), 0.0])
    style.scale_bar(
        panel, look_at(frame, **size), axis, np.ptp(near[:, 0]), " at the pile's axis"
    )
    return figure


@figure("figure06", "Figure 6", MEASURED_PILE, reads=("measure",), when=has_pile)
def measurement(inputs: Inputs, study: Shown) -> Figure:
    """Draw the steps of the measurement (section 2.3 of the paper).

    Figure 6. Measurement of that pile in one side view: grey picture, threshold, edge, and boundary (yellow) with
    the Height (blue), the line of the left flank (red) and of the right one (green), each with its angle. The title
    names the line. The tables take the mean over {measure[views]} view(s).
    """
    settings = pile.MeasureSettings.of(vars(study.measure), read_berry(inputs["berry"]))
    image = side_view(
        first_pour(inputs["heap"]), Particle.load(inputs["particle"]), settings
    )
    steps = drawing.process_panels(
        image, settings.mm_per_pixel, settings, base_row=image.shape[0] - 0.5
    )
    measured = pile.measure_image(
        image, settings.mm_per_pixel, settings, base_row=image.shape[0] - 0.5
    )
    figure = style.new_figure(style.PAGE, 3.6)
    panels = figure.subplot_mosaic("abc;ddd", height_ratios=(1, 2.2))
    ends_mm = [settings.mm_per_pixel * end for end in image.shape[::-1]]
    look = {
        "cmap": "gray",
        "vmin": 0,
        "vmax": 255,
        "extent": (0, ends_mm[0], 0, ends_mm[1]),
    }
    for (letter, panel), (title, picture) in zip(
        panels.items(), steps.items(), strict=True
    ):
        panel.imshow(
            picture[..., ::-1] if picture.ndim == 3 else picture, **look
        )  # OpenCV uses BGR
        panel.set(
            title=f"{letter}  {title}",
            xlabel="x (mm)",
            ylabel="z (mm)" if letter in "ad" else "",
        )
    _name_lines(panels["d"], measured, settings, ends_mm[1])
    return figure


def _name_lines(
    panel: Axes,
    measured: pile.Measurement,
    settings: pile.MeasureSettings,
    top_mm: float,
) -> None:
    """Draw the angle of each side beside its line, and above them their mean with the line in words."""
    angle = measured.angles[settings.response]
    sides = (
        ("left", angle.left_deg, drawing.RED, "right", -12),
        ("right", angle.right_deg, drawing.GREEN, "left", 12),
    )
    for (name, side_deg, colour, ha, away), line in zip(
        sides, angle.lines, strict=True
    ):
        u, row = np.mean(line, axis=0)
        place = (
            u * settings.mm_per_pixel,
            top_mm - (row + 0.5) * settings.mm_per_pixel,
        )
        look = {"textcoords": "offset points", "ha": ha, "fontweight": "bold"}
        rgb = [value / 255 for value in reversed(colour)]
        panel.annotate(f"{name} {side_deg:.1f}°", place, (away, 12), color=rgb, **look)
    panel.set_title(f"d  boundary, Height {measured.height_mm:.1f} mm")
    panel.set_title(
        f"angle of this view {angle.aor_deg:.1f}°, {style.line_in_words(vars(settings))}",
        loc="right",
    )


POUR = {"trajectory": "{trajectory}", "particle": "berry/particle.json"}


@figure(
    "figure08", "Figure 8", {}, optional=POUR, reads=("funnel", "colour"), when=has_pile
)
def apparatus(inputs: Inputs, study: Shown) -> Figure:
    """Draw the test bench from the side, in mm, with the grains of a pour if given.

    Figure 8. Virtual test bench to scale, halfway through the pour: the place where grains are made, funnel and plate.
    """
    from repose.report.renderer.scenery import funnel_walls

    funnel = study.funnel
    walls = funnel_walls(funnel.funnel)
    top, half_inlet = 1e3 * walls[-1].z_high_m, funnel.inlet_diameter_mm / 2
    factory = top + funnel.factory_height_mm
    half_view, low, high = max(half_inlet + 75, 190), -34, factory + 34
    width = 1.3 * style.COLUMN
    figure, (panel,) = style.grid(
        1, (width - 0.5) * (high - low) / (2 * half_view) + 0.55, width=width
    )
    if {"trajectory", "particle"} <= inputs.keys():
        _grains(panel, inputs, study.colour)
    for wall in walls:
        for side in (-1, 1):
            radii = [side * 1e3 * wall.r_low_m, side * 1e3 * wall.r_high_m]
            panel.plot(
                radii,
                [1e3 * wall.z_low_m, 1e3 * wall.z_high_m],
                color=style.BLACK,
                lw=1.6,
                zorder=3,
            )
    for side in (-1, 1):
        centre = (
            side * (funnel.outlet_diameter_mm / 2 + funnel.rim_radius_mm),
            funnel.outlet_height_mm,
        )
        panel.add_patch(
            Circle(centre, funnel.rim_radius_mm, color=style.BLACK, zorder=3)
        )
    half_plate = min(funnel.plate_diameter_mm / 2, half_view)
    panel.fill_between(
        [-half_plate, half_plate], -7, 0, color="#C9CED3", lw=0, zorder=2
    )
    panel.set(
        xlim=(-half_view, half_view),
        ylim=(low, high),
        aspect="equal",
        xticks=np.arange(-150, 151, 50),
    )
    _levels(panel, funnel, factory, half_view)
    _dimensions(panel, funnel, top, half_inlet)
    panel.set(xlabel="x (mm)", ylabel="z (mm)")
    return figure


def _levels(panel: Axes, funnel: Any, factory: float, half_view: float) -> None:
    """Draw the three red lines: factory, outlet and plate."""
    levels = {
        "grains are made here": factory,
        "funnel outlet": funnel.outlet_height_mm,
        "": 0.0,
    }
    for name, z in levels.items():
        panel.axhline(z, color=LINE, lw=0.9, zorder=4)
        panel.text(
            half_view - 3,
            z + 2,
            name,
            color=LINE,
            ha="right",
            va="bottom",
            fontsize=6.8,
        )
    half_factory = funnel.factory_diameter_mm / 2
    panel.plot(
        [-half_factory, half_factory], [factory, factory], color=LINE, lw=2.6, zorder=4
    )


def dimension(
    panel: Axes, start: Place, end: Place, text: str, place: Place, **options: Any
) -> None:
    """Draw a measured arrow from start to end with its number at a place; `options` go to its text."""
    look = {
        "arrowstyle": "<->",
        "lw": 0.8,
        "shrinkA": 0,
        "shrinkB": 0,
        "mutation_scale": 7,
    }
    panel.annotate(
        "", start, xytext=end, arrowprops=look | {"color": style.BLUE}, zorder=5
    )
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
    panel.text(
        *place,
        text,
        color=style.BLUE,
        fontsize=6.5,
        zorder=5,
        bbox=box,
        **{"ha": "center"} | options,
    )


def _dimensions(panel: Axes, funnel: Any, top: float, half_inlet: float) -> None:
    """Draw measured arrows with their numbers: diameters across, heights at the left."""
    half_outlet, outlet = funnel.outlet_diameter_mm / 2, funnel.outlet_height_mm
    over, below, side = (
        top + funnel.factory_height_mm + 14,
        outlet - 11,
        -half_inlet - 32,
    )
    at = (0, over + 4), (half_outlet + 4, below)
    dimension(
        panel,
        (-half_inlet, over),
        (half_inlet, over),
        f"inlet {2 * half_inlet:g}",
        at[0],
        va="bottom",
    )
    ends = (-half_outlet, below), (half_outlet, below)
    dimension(panel, *ends, f"{2 * half_outlet:g}", at[1], ha="left", va="center")
    for low, high, text in (
        (0, outlet, f"{outlet:g}"),
        (outlet, top, f"{top - outlet:.0f}"),
    ):
        middle = (side - 4, (low + high) / 2)
        dimension(
            panel, (side, low), (side, high), text, middle, ha="right", va="center"
        )
    look = {"color": style.BLUE, "fontsize": 6.5}
    words = f"{funnel.cone_angle_deg:g}° from horizontal"
    panel.text(
        (half_outlet + half_inlet) / 2 + 9, (outlet + top) / 2 - 8, words, **look
    )
    wider = (
        ", wider than this view"
        if funnel.plate_diameter_mm > np.ptp(panel.get_xlim())
        else ""
    )
    panel.text(
        0,
        -11,
        f"plate diameter {funnel.plate_diameter_mm:g}{wider}",
        ha="center",
        va="top",
        **look,
    )


def _grains(panel: Axes, inputs: Inputs, colour: str) -> None:
    """Draw the side view of the grains during a pour, each with its true outline, the nearest drawn last."""
    particle = Particle.load(inputs["particle"])
    record = read_npz(
        inputs["trajectory"],
        ("time_s", "position", "quaternion"),
        "the trajectory of a pour",
    )
    frame = int(np.argmin(np.abs(record["time_s"] - SNAPSHOT_S)))
    grains = Grains(
        record["position"][frame],
        record["quaternion"][frame],
        particle,
        record.get("scale", 1.0),
    )
    here = np.isfinite(grains.centres_m).all(axis=1)
    order = np.flatnonzero(here)[np.argsort(-grains.centres_m[here, 1])]
    outline = outlines(grains[order], [0.0])[0]  # seen along y, x points right
    look = {
        "facecolors": colour,
        "edgecolors": style.BLACK,
        "linewidths": 0.25,
        "zorder": 2.5,
    }
    panel.add_collection(PolyCollection(1e3 * outline, **look))
    words = f"simulated pour at {record['time_s'][frame]:.3g} s, {here.sum()} of {len(here)} grains; lengths in mm"
    panel.set_title(words, fontsize=7)
