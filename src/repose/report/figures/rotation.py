"""Figure 15 and its numbers: the bed in the drum before and after its first slip."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.common.files import read_npz, read_table
from repose.grain.particle import Particle
from repose.measure import bed
from repose.measure.silhouette import Grains

from . import style
from .registry import Inputs, Shown, figure, has_drum

PIXELS = 620
SLIP = ("before_turned_deg", "before_time_s")
TITLES = {
    "start": "before the rotation",
    "report": "at the report",
    "before": "before the slip",
    "after": "after the slip",
}


STATES, RUNS = (
    {"states": "{states}", "particle": "berry/particle.json"},
    {"runs": "drum/runs.csv"},
)
READS = ("drum", "measure.mm_per_pixel", "colour")


@figure("figure15", "Figure 15", STATES, optional=RUNS, reads=READS, when=has_drum)
def states(inputs: Inputs, study: Shown) -> Figure:
    """Draw side views along the axis with the line fitted to the upper edge, a panel per state.

    Figure 15. The bed in the drum before the rotation, before its first slip and after it, simulated with the
    representative solution: side views along the axis; the green line is fitted to the middle {drum[fit_share]:.3g} of
    the upper edge. The pictures show the first of {drum[seeds]} run(s). Below them stands how far and how long the drum
    turned before the slip. The paper shows pictures and gives no number to compare with.
    """
    arrays = read_npz(
        inputs["states"], ("position_start", "quaternion_start"), "the states of a drum"
    )
    particle = Particle.load(inputs["particle"])
    slipped = "position_before" in arrays
    shown = ("start", "before", "after") if slipped else ("start", "report")
    figure = style.new_figure(style.PAGE, style.PAGE / len(shown) + 0.8)
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02)
    for panel, state, letter in zip(
        figure.subplots(1, len(shown)), shown, "abc", strict=False
    ):
        angle = _side_view(panel, arrays, state, particle, study)
        panel.set_title(f"{letter}  {TITLES[state]}: surface {angle:.1f}°")
        panel.set_xlabel(f"drum turned by {arrays[f'turned_{state}_deg']:.1f}°")
    if slipped:
        runs = (
            read_table(inputs["runs"], ("status", *SLIP))
            if "runs" in inputs
            else pd.DataFrame()
        )
        figure.supxlabel(
            _slip(float(arrays["turned_before_deg"]), runs, study.drum), fontsize=7.5
        )
    else:
        figure.supxlabel("NO SLIP in this run", fontsize=7.5, color=style.RED)
    return figure


def _slip(turned_deg: float, runs: pd.DataFrame, section: Any) -> str:
    """Say how far and how long the drum turned before the first slip: in this run, and in all that slipped."""
    seconds = turned_deg / np.degrees(section.angular_velocity_rad_s)
    words = f"The bed slipped first when the drum had turned by {turned_deg:.1f}°, after {seconds:.1f} s."
    slipped = runs[runs["status"] == "ok"] if len(runs) else runs
    if len(slipped) > 1:
        turned, waited = (
            f"{slipped[key].mean():.1f} ± {slipped[key].sem():.1f}" for key in SLIP
        )
        words += (
            f"\nIn {len(slipped)} runs, mean ± standard error: {turned}°, {waited} s."
        )
    return words


def _side_view(
    panel: Axes,
    arrays: Mapping[str, np.ndarray],
    state: str,
    particle: Particle,
    study: Shown,
) -> float:
    """Draw one state with its fitted line, and give the line's angle in degrees."""
    from repose.report.renderer.film import (
        drum_inside,  # slow to import, and `course` does without
    )
    from repose.report.renderer.render import render_pile
    from repose.report.renderer.scenery import look_at

    centres, quaternions = (
        arrays[f"{key}_{state}"].astype(float) for key in ("position", "quaternion")
    )
    scales, pixels = (
        arrays.get("scale", np.ones(len(centres))),
        style.pixels(study, PIXELS),
    )
    inside = drum_inside(study.drum, np.radians(float(arrays[f"turned_{state}_deg"])))
    view: dict[str, Any] = {
        "elevation_deg": 0.0,
        "azimuth_deg": -90.0,
        "width": pixels,
        "height": pixels,
    }
    view["field_of_view_deg"], frame = style.TELEPHOTO_DEG, inside.outline()
    look: dict[str, Any] = {
        "scales": scales,
        "colour": study.colour,
        "frame_m": frame,
        "backdrop": inside,
    }
    panel.imshow(render_pile(centres, quaternions, particle, **look, **view))
    camera, pixel = look_at(frame, **view), study.measure.mm_per_pixel
    filled = bed.side_view(
        Grains(centres, quaternions, particle, scales), inside.radius_m, pixel
    )
    surface = bed.surface_of(filled, inside.radius_m, pixel, study.drum.fit_share)
    style.scale_bar(panel, camera, np.zeros(3), 2 * inside.radius_m)
    x, y, _ = camera.project(np.insert(surface.line_m, 1, 0.0, axis=1))
    panel.plot(x, y, color="white", lw=2.6, solid_capstyle="butt")
    panel.plot(x, y, color=style.GREEN, lw=1.6, solid_capstyle="butt")
    panel.set(xticks=[], yticks=[])
    panel.spines[:].set_visible(False)
    return surface.angle_deg


OVER_TIME = {"record": "drum/record.csv", "profile": "drum/profile.csv"} | RUNS


@figure("drum", "The drum over time", OVER_TIME, reads=("drum",), when=has_drum)
def course(inputs: Inputs, study: Shown) -> Figure:
    """Draw the angles of every run over the time, and the motion of the slipping layer by depth.

    The drum over time. a: surface and centre of mass of every run. A slip is judged when the centre of mass has
    fallen by {drum[slip_drop_deg]} degrees below its highest, and began at that highest; the drum then stops. b:
    how far grains moved in the slip, against the drum, by depth.
    """
    record = read_table(inputs["record"], ("seed", "time_s", "surface_deg", "bed_deg"))
    profile = read_table(inputs["profile"], ("seed", "depth_mm", "moved_mm"))
    runs = read_table(inputs["runs"], ("seed", "status"))
    figure, (left, right) = style.grid(2, 2.9, width_ratios=(1.5, 1))
    _angles(left, record, runs, study.drum)
    _layers(right, profile)
    style.name_panels((left, right))
    return figure


def _angles(
    panel: Axes, record: pd.DataFrame, runs: pd.DataFrame, section: Any
) -> None:
    """Draw the angles of surface and bed of every run over the time, with the start of the first slip."""
    for k, (seed, run) in enumerate(record.groupby("seed")):
        summary, hidden = runs[runs["seed"] == seed].iloc[0], "_" * bool(k)
        turning = (
            run
            if summary["status"] != "ok"
            else run[run["time_s"] <= summary["after_time_s"]]
        )
        time_s = turning["time_s"]
        panel.plot(
            time_s,
            turning["surface_deg"],
            color=style.SKY,
            lw=0.6,
            alpha=0.8,
            label=f"{hidden}surface",
        )
        panel.plot(
            time_s,
            turning["bed_deg"],
            color=style.BLUE,
            lw=0.9,
            label=f"{hidden}centre of mass",
        )
    slipped = runs[runs["status"] == "ok"]
    if len(slipped):
        words = (
            f"first slip begins: highest before a fall by {section.slip_drop_deg:g}°"
        )
        look = {"ms": 4, "color": style.RED, "zorder": 4, "label": words}
        panel.plot(slipped["before_time_s"], slipped["before_bed_deg"], "v", **look)
    last = record["time_s"].max()
    turned_deg = np.degrees(section.angular_velocity_rad_s) * last
    panel.plot(
        [0, last],
        [0, turned_deg],
        color=style.GREY,
        lw=0.7,
        ls="--",
        label="carried like a solid",
    )
    if "report_time_s" in runs:
        words = f"{section.report_s:g} s after the filling began, the time reported"
        panel.axvline(
            runs["report_time_s"].median(), color=style.ORANGE, lw=0.8, label=words
        )
    top = 1.05 * max(record["surface_deg"].max(), record["bed_deg"].max())
    panel.set(xlim=(0, last), ylim=(min(-3.0, record["bed_deg"].min() - 2), top))
    panel.set(xlabel="time since the rotation began (s)", ylabel="angle (deg)")
    panel.figure.legend(
        *panel.get_legend_handles_labels(), loc="outside upper left", ncols=3
    )
    rpm = 30 / np.pi * section.angular_velocity_rad_s
    style.note(
        panel,
        f"drum: diameter {section.outer_diameter_mm:g} mm,\n{rpm:.2f} turns per minute",
    )


def _layers(panel: Axes, profile: pd.DataFrame) -> None:
    """Draw the motion of the slipping layer over the depth of every run."""
    panel.set(
        xlabel="motion against the drum (mm)", ylabel="depth below the surface (mm)"
    )
    panel.invert_yaxis()
    if not len(profile):
        style.note(panel, "no slip in any run")
        return
    for k, (_, run) in enumerate(profile.groupby("seed")):
        label = "_" * bool(k) + "single run"
        panel.plot(
            run["moved_mm"], run["depth_mm"], color=style.SKY, lw=0.7, label=label
        )
    layers = profile.groupby("depth_mm")["moved_mm"].agg(["mean", "sem"])
    look = {
        "fmt": "o-",
        "ms": 3,
        "color": style.BLUE,
        "elinewidth": 0.9,
        "capsize": 1.5,
        "label": "mean ± SE",
    }
    panel.errorbar(layers["mean"], layers.index, xerr=layers["sem"].fillna(0.0), **look)
    panel.axvline(0.0, color=style.GREY, lw=0.6)
    panel.legend(loc="lower right")
