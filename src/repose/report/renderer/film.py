"""Short endless animations: a pour seen from the side, the drum seen along its axis, any simulation."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from repose.common.errors import InputError, require
from repose.common.files import Path_, read_npz, write_bytes
from repose.dem import Simulation
from repose.report.renderer.backdrop import DrumInside
from repose.report.renderer.bodies import Drawable
from repose.report.renderer.render import render_bodies, render_pile
from repose.report.renderer.scenery import Frustum, outline, setting_of

if TYPE_CHECKING:
    from repose.bench.drum import DrumSettings

LAST_S = 1.6  # the last picture is shown this long
KEYS = ("time_s", "position", "quaternion")
FORMATS = {".gif": "GIF", ".webp": "WEBP"}
MAX_BYTES = 3_000_000


def animate_pour(
    trajectory: Path_,
    particle: Drawable,
    out_path: Path_,
    walls: Sequence[Frustum] = (),
    frames: int = 72,
    **view: Any,
) -> None:
    """Write an endless animation of a pour as .gif or .webp, in at most `MAX_BYTES`, if need be with fewer colours.

    `trajectory` is an .npz file with time_s (T,), position (T, N, 3) [m], NaN before a grain appears, quaternion (T, N,
    4) and perhaps scale (N,). The frames are spread evenly over the time. `view` goes to
    `repose.report.renderer.render.render_bodies`. Raises InputError for a bad trajectory, another ending or a file that stays
    too large.
    """
    out_path, record = (
        _checked(out_path),
        read_npz(trajectory, KEYS, "the trajectory of a pour"),
    )
    positions, scales = record["position"], _scales(record)
    resting = positions[-1][np.isfinite(positions[-1]).all(axis=1)].astype(float)
    reach = particle.bounding_radius_m * float(scales.max(initial=0.0))
    # Grains that rolled far away may leave the picture; the pile and the funnel may not.
    away = np.hypot(resting[:, 0], resting[:, 1])
    frame = outline(resting[away < 2 * np.median(away)], reach, walls)
    frame = np.concatenate([frame, [[0, 0, frame[:, 2].max() + 2 * reach]]])
    look: dict[str, Any] = {
        "width": 360,
        "height": 460,
        "elevation_deg": 10.0,
        "azimuth_deg": 20.0,
    } | view
    look |= {"walls": walls, "frame_m": frame, "scales": scales}
    pictures = [
        render_pile(positions[k], record["quaternion"][k], particle, **look)
        for k in _spread(record["time_s"], frames)
    ]
    _write_within(pictures, 0.08, out_path, MAX_BYTES)


def animate(
    simulation: Simulation,
    frames: Mapping[str, np.ndarray],
    out_path: Path_,
    pictures: int = 48,
    **view: Any,
) -> None:
    """Write an endless animation of any simulation; `frames` come from `repose.dem.Recorder.frames`.

    `view` goes to `repose.report.renderer.render.render_bodies`; the default frame_m holds the first and the last frame. Files
    and errors as of `animate_pour`.
    """
    out_path = _checked(out_path)
    require(len(frames["time_s"]), out_path, "frames", 0, "at least one recorded frame")
    shapes, times = list(simulation.shapes.values()), frames["time_s"]
    if "planes" in frames:
        walls = zip(frames["planes"], frames["wall_frames"], strict=True)
        settings = [setting_of(simulation, *places) for places in walls]
    else:  # the walls rest, or turn about their axis
        settings = len(times) * [setting_of(simulation)]
    if view.get("frame_m") is None:
        ends = frames["position"][[0, -1]].reshape(-1, 3)
        ends = ends[np.isfinite(ends).all(axis=1)].astype(float)
        reach = max(shape.bounding_radius_m for shape in shapes) * float(
            frames["scale"].max(initial=0.0)
        )
        view["frame_m"] = outline(ends, reach, settings[-1].frusta, settings[-1].panels)
    shown = frames["shape"], frames["scale"]
    drawn = [
        render_bodies(
            frames["position"][k],
            frames["quaternion"][k],
            shapes,
            *shown,
            settings[k],
            **view,
        )
        for k in _spread(times, pictures)
    ]
    _write_within(drawn, 0.08, out_path, MAX_BYTES)


def animate_drum(
    trajectory: Path_,
    particle: Drawable,
    out_path: Path_,
    section: "DrumSettings",
    frames: int = 72,
    **view: Any,
) -> None:
    """Write an endless animation of a turning drum, seen along its axis; the marks on its rim turn with it.

    `trajectory` and `view` are as for `animate_pour`, with turned_deg (T,) in addition; `section` is the
    configuration's `drum`.
    """
    out_path = _checked(out_path)
    record = read_npz(trajectory, (*KEYS, "turned_deg"), "the trajectory of a drum")
    look: dict[str, Any] = {
        "width": 380,
        "elevation_deg": 0.0,
        "azimuth_deg": -90.0,
    } | view
    angles_rad, pictures = np.radians(record["turned_deg"]), []
    for k in _spread(record["time_s"], frames):
        inside = drum_inside(section, angles_rad[k])
        look |= {
            "height": look["width"],
            "frame_m": inside.outline(),
            "backdrop": inside,
            "scales": _scales(record),
        }
        pictures.append(
            render_pile(
                record["position"][k], record["quaternion"][k], particle, **look
            )
        )
    _write_within(pictures, 0.12, out_path, 3_900_000)


def drum_inside(section: "DrumSettings", turned_rad: float) -> DrumInside:
    """Give the drum as a backdrop; `section` is the configuration's `drum`."""
    thickness_m = 1e-3 * section.wall_thickness_mm
    radius_m = 0.5e-3 * section.outer_diameter_mm - thickness_m
    return DrumInside(
        radius_m, 1e-3 * section.length_mm, thickness_m, float(turned_rad)
    )


def _scales(record: Mapping[str, np.ndarray]) -> np.ndarray:
    """Give the scales (N,) of the grains of a trajectory."""
    return record.get("scale", np.ones(record["position"].shape[1]))


def _checked(out_path: Path_) -> Path:
    """Give the path; InputError for an ending that cannot be written."""
    out_path = Path(out_path)
    require(
        out_path.suffix.lower() in FORMATS,
        out_path,
        "ending",
        out_path.suffix,
        ".gif or .webp",
    )
    return out_path


def _spread(times: np.ndarray, frames: int) -> np.ndarray:
    """Give the indices of at most this number of frames, evenly over the time."""
    return np.searchsorted(
        times, np.linspace(times[0], times[-1], min(frames, len(times)))
    )


def _write_within(
    pictures: Sequence[np.ndarray], frame_s: float, out_path: Path, max_bytes: int
) -> None:
    """Write RGB pictures with as many colours as max_bytes allows; InputError if even the fewest take more."""
    images = [Image.fromarray(picture) for picture in pictures]
    shown_ms = [round(1000 * frame_s)] * (len(images) - 1) + [round(1000 * LAST_S)]
    content = b""
    for effort in range(5):
        content = _encoded(images, shown_ms, FORMATS[out_path.suffix.lower()], effort)
        if len(content) <= max_bytes:
            return write_bytes(out_path, content)
    raise InputError(
        out_path,
        "max_bytes",
        max_bytes,
        f"at least {len(content)} at this size and length",
    )


def _encoded(
    pictures: Sequence[Image.Image], shown_ms: list[int], kind: str, effort: int
) -> bytes:
    """Give the pictures as the content of a file, with fewer colours for more `effort` (0 to 4)."""
    options: dict[str, Any] = {
        "format": kind,
        "save_all": True,
        "duration": shown_ms,
        "loop": 0,
    }
    content = io.BytesIO()
    if kind == "WEBP":
        options |= {"quality": 80 - 15 * effort, "method": 4}
    else:  # One palette for all frames, taken from the last one: parts at rest keep their colours.
        palette = pictures[-1].quantize((128, 96, 64, 48, 32)[effort])
        pictures = [
            picture.quantize(palette=palette, dither=Image.Dither.NONE)
            for picture in pictures
        ]
        options |= {"optimize": False, "disposal": 1}
    pictures[0].save(content, append_images=pictures[1:], **options)
    return content.getvalue()
