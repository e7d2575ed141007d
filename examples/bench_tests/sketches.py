"""Sketches of the bench tests of this folder from the side, with dimensions in mm."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from repose.common.keys import require_section
from repose.report.figures import style
from repose.report.figures.testbench import draw_dimension

Config = Mapping[str, Any]
Point = tuple[float, float]
Ends = tuple[float, float]

PLATE = "#C9CED3"
# Diameter of the single grain that a sketch shows.
GRAIN_MM = 12.0
FONT_SIZE = 6.5
# Sizes of a figure in inches: its margin beside the panel, its least and largest height.
MARGIN = 0.5
LEAST_HEIGHT = 2.0
LARGEST_HEIGHT = 6.5


class Sketch:
    """A panel in which x is the horizontal and z the vertical direction.

    `x` and `z` are the ends of both axes.
    """

    def __init__(self, x: Ends, z: Ends) -> None:
        shape = (z[1] - z[0]) / (x[1] - x[0])
        width = style.COLUMN if shape >= 1.0 else 1.2 * style.COLUMN
        height = (width - MARGIN) * shape + MARGIN
        height = min(max(height, LEAST_HEIGHT), LARGEST_HEIGHT)
        self.figure: Figure = style.new_figure(width, height)
        self.axes = self.figure.subplots()
        self.axes.set(xlim=x, ylim=z, aspect="equal", xlabel="x (mm)", ylabel="z (mm)")

    def wall(self, x: Ends, z: Ends, colour: str = PLATE) -> None:
        """Draw a filled rectangle."""
        self.axes.fill_between(sorted(x), z[0], z[1], color=colour, lw=0, zorder=3)

    def grain(self, centre: Point, colour: str, lw: float | None = None) -> None:
        """Draw a single grain."""
        angle = np.linspace(0, 2 * math.pi, 60)
        radius = 0.5 * GRAIN_MM
        self.axes.fill(
            centre[0] + radius * np.cos(angle),
            centre[1] + radius * np.sin(angle),
            facecolor=colour,
            edgecolor=style.BLACK,
            **({} if lw is None else {"lw": lw}),
        )

    def motion(self, start: Point, end: Point, text: str = "") -> None:
        """Draw an arrow in the direction of a motion, with its text at the end."""
        arrow = {"arrowstyle": "->", "color": style.RED, "lw": 1.2}
        self.axes.annotate("", end, xytext=start, arrowprops=arrow, zorder=5)
        self.axes.text(
            *end,
            f" {text}",
            color=style.RED,
            fontsize=FONT_SIZE,
            ha="left",
            va="center",
            zorder=5,
        )

    def text(self, point: Point, text: str, ha: str = "center") -> None:
        """Write a text in the colour of dimensions."""
        self.axes.text(
            *point,
            text,
            color=style.BLUE,
            fontsize=FONT_SIZE,
            ha=ha,
            va="center",
            zorder=5,
        )

    def width(self, half: float, z: float, text_z: float, **options: Any) -> None:
        """Draw the dimension of a width about x = 0, at a height; its number may differ.

        `options` go to the number.
        """
        draw_dimension(
            self.axes, (-half, z), (half, z), f"{2 * half:g}", (0, text_z), **options
        )

    def height(
        self, x: float, z: Ends, text: str, text_x: float, **options: Any
    ) -> None:
        """Draw the dimension of a height at a place along x, its number beside it."""
        middle = (z[0] + z[1]) / 2
        draw_dimension(
            self.axes, (x, z[0]), (x, z[1]), text, (text_x, middle), **options
        )

    def height_on_the_left(self, x: float, z: Ends) -> None:
        """Draw the dimension of a height with its number at its left."""
        self.height(x, z, f"{z[1] - z[0]:.4g}", 1.05 * x, ha="right")


def lifted_cylinder(config: Config) -> Figure:
    """Draw the tube on its plate, and its motion."""
    keys = require_section(config, "lifted_cylinder")
    radius = keys["diameter_mm"] / 2
    length = keys["length_mm"]
    half = 2.2 * radius
    sketch = Sketch(x=(-half, half), z=(-0.12 * length, 1.3 * length))
    sketch.wall((-half, half), (-0.05 * length, 0))
    outer = radius + max(2 * keys["rim_radius_mm"], 0.03 * radius)
    for side in (-1, 1):
        sketch.wall((side * radius, side * outer), (0, length), style.GREY)
    sketch.width(radius, z=1.06 * length, text_z=1.08 * length)
    left = -1.5 * radius
    sketch.height(left, (0, length), f"{length:g}", 1.05 * left, ha="right")
    level = keys.get("filling_height_mm")
    if level is not None:
        sketch.axes.plot(
            [-radius, radius], [level, level], color=style.GREY, lw=0.8, ls="--"
        )
        right = 1.7 * radius
        sketch.height(right, (0, level), f"{level:g}", 1.05 * right, ha="left")
    sketch.motion(
        (1.3 * radius, 0.5 * length),
        (1.3 * radius, 0.8 * length),
        f"{keys['lifting_mm_s']:g} mm/s",
    )
    sketch.text((0, -0.06 * length), f"plate, diameter {keys['plate_diameter_mm']:g}")
    return sketch.figure


def inclined_plane(config: Config) -> Figure:
    """Draw the steepest plane with a grain, and its rate; lengths are not to scale."""
    keys = require_section(config, "inclined_plane")
    steepest = math.radians(keys["steepest_deg"])
    sketch = Sketch(x=(-15, 130), z=(-12, 115))
    along = np.array([math.cos(steepest), math.sin(steepest)])
    across = np.array([-along[1], along[0]])
    sketch.axes.plot([0, 120], [0, 0], color=style.GREY, lw=0.8, ls="--")
    plane = np.transpose([(0, 0), 100 * along])
    sketch.axes.plot(*plane, color=style.BLACK, lw=3)
    centre = 60 * along + (0.5 * GRAIN_MM + 1) * across
    sketch.grain((centre[0], centre[1]), config["colour"], lw=0.4)
    angle = np.linspace(0, steepest, 40)
    sketch.axes.plot(45 * np.cos(angle), 45 * np.sin(angle), color=style.BLUE, lw=0.8)
    rate = f"{keys['tilting_deg_s']:g}° per second"
    sketch.text(
        (50 * math.cos(steepest / 2), 50 * math.sin(steepest / 2)),
        f"0 to {keys['steepest_deg']:g}°,\n{rate}",
        ha="left",
    )
    sketch.text((60, -8), f"surface: {keys['surface']}")
    sketch.axes.set(xlabel="", ylabel="", xticks=[], yticks=[])
    return sketch.figure


def drop_test(config: Config) -> Figure:
    """Draw the grain above its plate."""
    keys = require_section(config, "drop_test")
    height = keys["height_mm"]
    half = max(0.35 * height, 2 * GRAIN_MM)
    sketch = Sketch(x=(-half, half), z=(-0.1 * height, 1.1 * height + 2 * GRAIN_MM))
    sketch.wall((-half, half), (-0.04 * height, 0))
    sketch.grain((0.0, height + 0.5 * GRAIN_MM), config["colour"])
    left = -0.6 * half
    sketch.height(left, (0, height), f"{height:g}", 1.05 * left, ha="right")
    sketch.text((0, -0.07 * height), f"plate: {keys['surface']}")
    sketch.motion((0, 0.9 * height), (0, 0.7 * height))
    return sketch.figure


def drawdown(config: Config) -> Figure:
    """Draw both chambers, slot and gate."""
    keys = require_section(config, "drawdown")
    width = keys["width_mm"] / 2
    slot = keys["slot_mm"] / 2
    lower = keys["lower_width_mm"] / 2
    floor = keys["floor_mm"]
    drop = keys["drop_mm"]
    top = drop + keys["height_mm"]
    outer = width + floor
    sketch = Sketch(x=(-1.2 * lower, 1.2 * lower), z=(-0.12 * top, 1.12 * top))
    sketch.wall((-1.02 * lower, 1.02 * lower), (-0.03 * top, 0))
    for side in (-1, 1):
        sketch.wall((side * lower, side * 1.02 * lower), (0, drop), style.GREY)
        sketch.wall((side * slot, side * outer), (drop - floor, drop), style.BLACK)
        sketch.wall((side * width, side * outer), (drop, top), style.GREY)
    gate = drop - 1.5 * floor
    sketch.axes.plot([-slot, slot], [gate] * 2, color=style.RED, lw=1.2, ls=":")
    sketch.motion((0, drop - 2 * floor), (0, 0.72 * drop), "gate")
    sketch.width(width, z=1.04 * top, text_z=1.06 * top)
    sketch.width(lower, z=-0.06 * top, text_z=-0.06 * top, va="center")
    above = drop + 0.06 * top
    sketch.width(slot, z=above, text_z=above + 0.01 * top)
    left = -1.1 * lower
    sketch.height(left, (0, drop), f"{drop:g}", left)
    sketch.height(left, (drop, top), f"{top - drop:g}", left)
    sketch.text((0.75 * lower, 0.9 * top), f"depth {keys['depth_mm']:g}")
    return sketch.figure


def cylinder(config: Config) -> Figure:
    """Draw the vessel, its collar, and the core that gives the bulk density."""
    keys = require_section(config, "cylinder")
    radius = keys["diameter_mm"] / 2
    height = keys["height_mm"]
    top = height + keys["collar_mm"]
    sketch = Sketch(x=(-2.2 * radius, 2.2 * radius), z=(-0.12 * top, 1.12 * top))
    for side in (-1, 1):
        sketch.wall((side * radius, side * 1.03 * radius), (0, height), style.GREY)
        sketch.axes.plot(
            [side * radius] * 2, [height, top], color=style.GREY, lw=0.8, ls="--"
        )
    sketch.wall((-1.03 * radius, 1.03 * radius), (-0.02 * top, 0))
    margin = keys["core_margin_mm"]
    core = radius - margin
    sketch.axes.plot(
        [-core, -core, core, core],
        [margin, height - margin, height - margin, margin],
        style.GREY,
        ls="--",
        lw=0.8,
    )
    sketch.axes.plot((-core, core), [margin] * 2, style.GREY, ls="--", lw=0.8)
    sketch.text((0, height / 2), f"core,\n{margin:g} inside")
    sketch.width(radius, z=-0.06 * top, text_z=-0.06 * top, va="center")
    sketch.height_on_the_left(-1.5 * radius, (0, height))
    sketch.height_on_the_left(-1.5 * radius, (height, top))
    sketch.motion((0, 1.08 * top), (0, 0.94 * top), f"{keys['speed_m_s']:g} m/s")
    return sketch.figure


def discharge(config: Config) -> Figure:
    """Draw the funnel with its collar above, and the lid below, which opens."""
    keys = require_section(config, "discharge")
    inlet = keys["inlet_diameter_mm"] / 2
    outlet = keys["outlet_diameter_mm"] / 2
    tube = keys["tube_length_mm"]
    slope = math.tan(math.radians(keys["cone_angle_deg"]))
    rim = tube + (inlet - outlet) * slope
    top = rim + keys["collar_mm"]
    sketch = Sketch(x=(-2.2 * inlet, 2.2 * inlet), z=(-0.25 * top, 1.12 * top))
    for side in (-1, 1):
        sketch.axes.plot(
            [side * outlet, side * outlet, side * inlet],
            [0, tube, rim],
            color=style.GREY,
            lw=2,
        )
        sketch.axes.plot(
            [side * inlet] * 2, [rim, top], color=style.GREY, lw=0.8, ls="--"
        )
    sketch.axes.plot([-outlet, outlet], [0, 0], color=style.RED, lw=1.2, ls=":")
    sketch.motion(
        (0, -0.03 * top), (0, -0.2 * top), f"lid opens at {keys['open_from_s']:g} s"
    )
    sketch.width(inlet, z=1.04 * top, text_z=1.06 * top)
    sketch.width(outlet, z=0.04 * top, text_z=1.4 * (0.04 * top))
    for ends in ((0, tube), (tube, rim), (rim, top)):
        if ends[1] > ends[0]:
            sketch.height_on_the_left(-1.4 * inlet, ends)
    sketch.text(
        (1.15 * inlet, 0.5 * (tube + rim)), f"{keys['cone_angle_deg']:g}°", ha="left"
    )
    return sketch.figure


def turning(config: Config) -> Figure:
    """Draw the drum along its axis, its speeds, and the part of its bed that is fitted."""
    keys = require_section(config, "turning")
    outer = keys["outer_diameter_mm"] / 2
    inner = outer - keys["wall_thickness_mm"]
    sketch = Sketch(x=(-1.5 * outer, 1.5 * outer), z=(-1.4 * outer, 1.4 * outer))
    angle = np.linspace(0, 2 * math.pi, 200)
    circle = np.array([np.cos(angle), np.sin(angle)])
    sketch.axes.fill(*(outer * circle), facecolor=style.GREY, lw=0)
    sketch.axes.fill(*(inner * circle), facecolor="white", lw=0)
    fitted = keys["fit_share"] * inner
    for side in (-1, 1):
        sketch.axes.plot(
            [side * fitted] * 2, [-inner, inner], style.GREY, ls="--", lw=0.8
        )
    sketch.text((0, 0.5 * inner), "fitted")
    # A cross marks the axis.
    arm = 0.12 * outer
    sketch.axes.plot(
        [-arm, arm, 0, 0, 0], [0, 0, 0, -arm, arm], color=style.BLACK, lw=0.6
    )
    sketch.width(inner, z=-1.2 * outer, text_z=-1.2 * outer, va="center")
    arc = np.radians(np.linspace(15, 45, 30))
    x = 1.12 * outer * np.cos(arc)
    z = 1.12 * outer * np.sin(arc)
    sketch.axes.plot(x, z, color=style.RED, lw=1.2)
    sketch.motion((x[-2], z[-2]), (x[-1], z[-1]))
    speeds = np.atleast_1d(keys["angular_velocity_rad_s"])
    sketch.text(
        (1.05 * outer, 0.15 * outer),
        "\n".join(f"{speed:g} rad/s" for speed in speeds),
        ha="left",
    )
    text = f"length {keys['length_mm']:g}"
    tilt = keys.get("tilt_deg", 0)
    if tilt:
        text += f", axis tilted {tilt:g}°"
    sketch.text((0, -1.34 * outer), text)
    return sketch.figure


SKETCHES: dict[str, Callable[[Config], Figure]] = {
    "lifted_cylinder": lifted_cylinder,
    "inclined_plane": inclined_plane,
    "drop_test": drop_test,
    "drawdown": drawdown,
    "cylinder": cylinder,
    "discharge": discharge,
    "turning": turning,
}


def draw(name: str, out_path: str | Path, config: Config) -> None:
    """Write the sketch of a bench test."""
    with style.applied():
        style.save(SKETCHES[name](config), out_path, config["small_run"])
