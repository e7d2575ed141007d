"""Sketches of the bench tests of this folder from the side, with their dimensions in mm."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.common.keys import section
from repose.report.figures import style
from repose.report.figures.testbench import dimension

PLATE = "#C9CED3"
BODY_MM = 12.0  # of the single berry that a sketch shows


def lifted_cylinder(config: Mapping[str, Any]) -> Figure:
    """The tube on its plate, and its motion."""
    own = section(config, "lifted_cylinder")
    radius, length, rim = own["diameter_mm"] / 2, own["length_mm"], own["rim_radius_mm"]
    half = 2.2 * radius
    panel = _panel((-half, half), (-0.12 * length, 1.3 * length))
    _solid(panel, (-half, half), (-0.05 * length, 0))
    for side in (-1, 1):
        _solid(
            panel,
            (side * radius, side * (radius + max(2 * rim, 0.03 * radius))),
            (0, length),
            style.GREY,
        )
    over = 1.06 * length
    dimension(
        panel, (-radius, over), (radius, over), f"{2 * radius:g}", (0, 1.08 * length)
    )
    beside = -1.5 * radius
    dimension(
        panel,
        (beside, 0),
        (beside, length),
        f"{length:g}",
        (1.05 * beside, length / 2),
        ha="right",
    )
    if (level := own.get("filling_height_mm")) is not None:
        at = 1.7 * radius
        panel.plot([-radius, radius], [level, level], color=style.GREY, lw=0.8, ls="--")
        dimension(
            panel, (at, 0), (at, level), f"{level:g}", (1.05 * at, level / 2), ha="left"
        )
    speed = f"{own['lifting_mm_s']:g} mm/s"
    _motion(panel, (1.3 * radius, 0.5 * length), (1.3 * radius, 0.8 * length), speed)
    _words(panel, (0, -0.06 * length), f"plate, diameter {own['plate_diameter_mm']:g}")
    return panel.figure


def inclined_plane(config: Mapping[str, Any]) -> Figure:
    """The plane at its steepest with a berry, and the rate at which it tilts; lengths are not to scale."""
    own = section(config, "inclined_plane")
    steepest = math.radians(own["steepest_deg"])
    panel = _panel((-15, 130), (-12, 115))
    along = np.array([math.cos(steepest), math.sin(steepest)])
    across = np.array([-along[1], along[0]])
    panel.plot([0, 120], [0, 0], color=style.GREY, lw=0.8, ls="--")
    panel.plot(*np.transpose([(0, 0), 100 * along]), color=style.BLACK, lw=3)
    turn = np.linspace(0, 2 * math.pi, 60)
    body = 60 * along + (0.5 * BODY_MM + 1) * across
    outline = body[:, None] + 0.5 * BODY_MM * np.array([np.cos(turn), np.sin(turn)])
    panel.fill(*outline, facecolor=config["colour"], edgecolor=style.BLACK, lw=0.4)
    arc = np.linspace(0, steepest, 40)
    panel.plot(45 * np.cos(arc), 45 * np.sin(arc), color=style.BLUE, lw=0.8)
    rate = f"0 to {own['steepest_deg']:g}°,\n{own['tilting_deg_s']:g}° per second"
    _words(
        panel,
        (50 * math.cos(steepest / 2), 50 * math.sin(steepest / 2)),
        rate,
        ha="left",
    )
    _words(panel, (60, -8), f"surface: {own['surface']}")
    panel.set(xlabel="", ylabel="", xticks=[], yticks=[])
    return panel.figure


def drop_test(config: Mapping[str, Any]) -> Figure:
    """The berry above its plate."""
    own = section(config, "drop_test")
    height = own["height_mm"]
    half = max(0.35 * height, 2 * BODY_MM)
    panel = _panel((-half, half), (-0.1 * height, 1.1 * height + 2 * BODY_MM))
    _solid(panel, (-half, half), (-0.04 * height, 0))
    turn = np.linspace(0, 2 * math.pi, 60)
    around = 0.5 * BODY_MM * np.array([np.cos(turn), np.sin(turn)])
    panel.fill(
        around[0],
        height + 0.5 * BODY_MM + around[1],
        facecolor=config["colour"],
        edgecolor=style.BLACK,
    )
    beside = -0.6 * half
    dimension(
        panel,
        (beside, 0),
        (beside, height),
        f"{height:g}",
        (1.05 * beside, height / 2),
        ha="right",
    )
    _words(panel, (0, -0.07 * height), f"plate: {own['surface']}")
    _motion(panel, (0, 0.9 * height), (0, 0.7 * height), "")
    return panel.figure


def drawdown(config: Mapping[str, Any]) -> Figure:
    """Both chambers, slot and gate."""
    own = section(config, "drawdown")
    width, slot, lower, floor = (
        own[key] / 2 for key in ("width_mm", "slot_mm", "lower_width_mm", "floor_mm")
    )
    floor *= 2
    drop, top = own["drop_mm"], own["drop_mm"] + own["height_mm"]
    panel = _panel((-1.2 * lower, 1.2 * lower), (-0.12 * top, 1.12 * top))
    _solid(panel, (-1.02 * lower, 1.02 * lower), (-0.03 * top, 0))
    for side in (-1, 1):
        _solid(panel, (side * lower, side * 1.02 * lower), (0, drop), style.GREY)
        _solid(
            panel,
            (side * slot, side * (width + floor)),
            (drop - floor, drop),
            style.BLACK,
        )
        _solid(panel, (side * width, side * (width + floor)), (drop, top), style.GREY)
    panel.plot([-slot, slot], [drop - 1.5 * floor] * 2, color=style.RED, lw=1.2, ls=":")
    _motion(panel, (0, drop - 2 * floor), (0, 0.72 * drop), "gate")
    over, under = 1.04 * top, -0.06 * top
    dimension(panel, (-width, over), (width, over), f"{2 * width:g}", (0, 1.06 * top))
    dimension(
        panel,
        (-lower, under),
        (lower, under),
        f"{2 * lower:g}",
        (0, under),
        va="center",
    )
    above = drop + 0.06 * top
    dimension(
        panel, (-slot, above), (slot, above), f"{2 * slot:g}", (0, above + 0.01 * top)
    )
    beside = -1.1 * lower
    dimension(panel, (beside, 0), (beside, drop), f"{drop:g}", (beside, drop / 2))
    height = f"{top - drop:g}"
    dimension(panel, (beside, drop), (beside, top), height, (beside, (drop + top) / 2))
    _words(panel, (0.75 * lower, 0.9 * top), f"depth {own['depth_mm']:g}")
    return panel.figure


def cylinder(config: Mapping[str, Any]) -> Figure:
    """The vessel, the collar through which it is filled over its rim, and the core that gives the bulk density."""
    own = section(config, "cylinder")
    radius, height, collar, margin = (
        own["diameter_mm"] / 2,
        own["height_mm"],
        own["collar_mm"],
        own["core_margin_mm"],
    )
    top = height + collar
    panel = _panel((-2.2 * radius, 2.2 * radius), (-0.12 * top, 1.12 * top))
    _vessel(panel, radius, height, collar)
    _solid(panel, (-1.03 * radius, 1.03 * radius), (-0.02 * top, 0))
    inside = margin - radius, radius - margin, height - margin
    panel.plot(
        [inside[0], inside[0], inside[1], inside[1]][:4],
        [margin, inside[2], inside[2], margin],
        style.GREY,
        ls="--",
        lw=0.8,
    )
    panel.plot(inside[:2], [margin] * 2, style.GREY, ls="--", lw=0.8)
    _words(panel, (0, height / 2), f"core,\n{margin:g} inside")
    dimension(
        panel,
        (-radius, -0.06 * top),
        (radius, -0.06 * top),
        f"{2 * radius:g}",
        (0, -0.06 * top),
        va="center",
    )
    _beside(panel, -1.5 * radius, (0, height))
    _beside(panel, -1.5 * radius, (height, top))
    _motion(panel, (0, 1.08 * top), (0, 0.94 * top), f"{own['speed_m_s']:g} m/s")
    return panel.figure


def discharge(config: Mapping[str, Any]) -> Figure:
    """The funnel with its collar above and the lid below, which opens."""
    own = section(config, "discharge")
    inlet, outlet = own["inlet_diameter_mm"] / 2, own["outlet_diameter_mm"] / 2
    tube, cone = (
        own["tube_length_mm"],
        (inlet - outlet) * math.tan(math.radians(own["cone_angle_deg"])),
    )
    rim, top = tube + cone, tube + cone + own["collar_mm"]
    panel = _panel((-2.2 * inlet, 2.2 * inlet), (-0.25 * top, 1.12 * top))
    for side in (-1, 1):
        panel.plot(
            [side * outlet, side * outlet, side * inlet],
            [0, tube, rim],
            color=style.GREY,
            lw=2,
        )
        panel.plot([side * inlet] * 2, [rim, top], color=style.GREY, lw=0.8, ls="--")
    panel.plot([-outlet, outlet], [0, 0], color=style.RED, lw=1.2, ls=":")
    _motion(
        panel,
        (0, -0.03 * top),
        (0, -0.2 * top),
        f"lid opens at {own['open_from_s']:g} s",
    )
    over, under = 1.04 * top, 0.04 * top
    dimension(panel, (-inlet, over), (inlet, over), f"{2 * inlet:g}", (0, 1.06 * top))
    dimension(
        panel, (-outlet, under), (outlet, under), f"{2 * outlet:g}", (0, 1.4 * under)
    )
    for ends in ((0, tube), (tube, rim), (rim, top)):
        if ends[1] > ends[0]:
            _beside(panel, -1.4 * inlet, ends)
    _words(
        panel,
        (1.15 * inlet, 0.5 * (tube + rim)),
        f"{own['cone_angle_deg']:g}°",
        ha="left",
    )
    return panel.figure


def turning(config: Mapping[str, Any]) -> Figure:
    """The drum along its axis, its speeds, and the middle part of its bed through which the line goes."""
    own = section(config, "turning")
    outer = own["outer_diameter_mm"] / 2
    inner = outer - own["wall_thickness_mm"]
    panel = _panel((-1.5 * outer, 1.5 * outer), (-1.4 * outer, 1.4 * outer))
    turn = np.linspace(0, 2 * math.pi, 200)
    circle = np.array([np.cos(turn), np.sin(turn)])
    panel.fill(*(outer * circle), facecolor=style.GREY, lw=0)
    panel.fill(*(inner * circle), facecolor="white", lw=0)
    share = own["fit_share"] * inner
    for side in (-1, 1):
        panel.plot([side * share] * 2, [-inner, inner], style.GREY, ls="--", lw=0.8)
    _words(panel, (0, 0.5 * inner), "fitted")
    panel.plot(
        [-0.12 * outer, 0.12 * outer, 0, 0, 0],
        [0, 0, 0, -0.12 * outer, 0.12 * outer],
        color=style.BLACK,
        lw=0.6,
    )
    under, speeds = -1.2 * outer, np.atleast_1d(own["angular_velocity_rad_s"])
    dimension(
        panel,
        (-inner, under),
        (inner, under),
        f"{2 * inner:g}",
        (0, under),
        va="center",
    )
    arc = np.radians(np.linspace(15, 45, 30))
    panel.plot(
        1.12 * outer * np.cos(arc), 1.12 * outer * np.sin(arc), color=style.RED, lw=1.2
    )
    last = 1.12 * outer * np.array([np.cos(arc[-2:]), np.sin(arc[-2:])]).T
    _motion(panel, tuple(last[0]), tuple(last[1]), "")
    _words(
        panel,
        (1.05 * outer, 0.15 * outer),
        "\n".join(f"{speed:g} rad/s" for speed in speeds),
        ha="left",
    )
    tilt = own.get("tilt_deg", 0)
    _words(
        panel,
        (0, -1.34 * outer),
        f"length {own['length_mm']:g}" + (f", axis tilted {tilt:g}°" if tilt else ""),
    )
    return panel.figure


def _vessel(panel: Axes, radius: float, height: float, collar: float) -> None:
    """Walls of a cylinder, and dashed the collar above it."""
    for side in (-1, 1):
        _solid(panel, (side * radius, side * 1.03 * radius), (0, height), style.GREY)
        panel.plot(
            [side * radius] * 2,
            [height, height + collar],
            color=style.GREY,
            lw=0.8,
            ls="--",
        )


def _beside(panel: Axes, x: float, ends: tuple[float, float]) -> None:
    """A height with its dimension at its left."""
    text = f"{ends[1] - ends[0]:.4g}"
    dimension(
        panel, (x, ends[0]), (x, ends[1]), text, (1.05 * x, sum(ends) / 2), ha="right"
    )


def _panel(across: Sequence[float], up: Sequence[float]) -> Axes:
    """A panel to scale, in mm."""
    wide, high = across[1] - across[0], up[1] - up[0]
    width = 1.2 * style.COLUMN if wide > high else style.COLUMN
    figure = style.new_figure(
        width, min(max((width - 0.5) * high / wide + 0.5, 2.0), 6.5)
    )
    panel = figure.subplots()
    panel.set(xlim=across, ylim=up, aspect="equal", xlabel="x (mm)", ylabel="z (mm)")
    return panel


def _solid(
    panel: Axes, across: Sequence[float], up: Sequence[float], colour: str = PLATE
) -> None:
    """A filled rectangle."""
    panel.fill_between(sorted(across), up[0], up[1], color=colour, lw=0, zorder=3)


def _motion(
    panel: Axes, start: tuple[float, float], end: tuple[float, float], text: str
) -> None:
    """An arrow in the direction of a motion, its words at the end."""
    arrow = {"arrowstyle": "->", "color": style.RED, "lw": 1.2}
    panel.annotate("", end, xytext=start, arrowprops=arrow, zorder=5)
    panel.text(
        *end,
        f" {text}",
        color=style.RED,
        fontsize=6.5,
        ha="left",
        va="center",
        zorder=5,
    )


def _words(panel: Axes, place: Sequence[float], text: str, ha: str = "center") -> None:
    """Words in the colour of dimensions."""
    panel.text(
        *place, text, color=style.BLUE, fontsize=6.5, ha=ha, va="center", zorder=5
    )


SKETCHES = {
    sketch.__name__: sketch
    for sketch in (
        lifted_cylinder,
        inclined_plane,
        drop_test,
        drawdown,
        cylinder,
        discharge,
        turning,
    )
}


def draw(name: str, out_path: str | Path, config: Mapping[str, Any]) -> None:
    """Write the sketch of a bench test."""
    with style.applied():
        style.save(SKETCHES[name](config), out_path, config["small_run"])
