"""Short endless animations: a pour seen from the side, the drum seen along its axis, any simulation."""

from pathlib import Path

import numpy as np
from PIL import Image

from repose.core.errors import InputError
from repose.pictures.backdrop import DrumInside
from repose.pictures.render import render_bodies, render_pile
from repose.pictures.scenery import outline, setting_of

LAST_S = 1.6  # the last picture is shown this long


def animate_pour(
    trajectory,
    particle,
    out_path,
    walls=(),
    frames=72,
    frame_s=0.08,
    width=360,
    height=460,
    elevation_deg=10.0,
    azimuth_deg=20.0,
    max_bytes=3_000_000,
):
    """A short endless animation (GIF or WebP by the file's ending) of a pour.

    trajectory: path of a .npz with time_s (T,), position (T, N, 3) m, NaN for berries not yet there, quaternion (T,
    N, 4) and scale (N,), 1 where it is missing. frames: pictures, evenly spread over the time, shown frame_s seconds
    each, the last one longer. Colours are reduced until the file has at most max_bytes; raises InputError for another
    ending or where that is not enough.
    """
    out_path = _checked(out_path)
    with np.load(trajectory) as record:
        times, positions, quaternions = record["time_s"], record["position"], record["quaternion"]
        scales = record["scale"] if "scale" in record else np.ones(positions.shape[1])
    resting = positions[-1][np.isfinite(positions[-1]).all(axis=1)].astype(float)
    reach = particle.bounding_radius_m * float(scales.max(initial=0.0))
    # Berries that rolled far away may leave the picture; the pile and the funnel may not.
    near = resting[
        np.hypot(resting[:, 0], resting[:, 1]) < 2 * np.median(np.hypot(resting[:, 0], resting[:, 1]))
    ]
    frame = outline(near, reach, walls)
    frame = np.concatenate([frame, [[0, 0, frame[:, 2].max() + 2 * reach]]])
    pictures = [
        render_pile(
            positions[k],
            quaternions[k],
            particle,
            elevation_deg,
            azimuth_deg,
            width,
            height,
            walls,
            frame_m=frame,
            scales=scales,
        )
        for k in _spread(times, frames)
    ]
    _save_within(pictures, frame_s, out_path, max_bytes)


def animate(simulation, frames, out_path, pictures=48, frame_s=0.08, max_bytes=3_000_000, **view):
    """A short endless animation (GIF or WebP by the file's ending) of any simulation.

    simulation: `repose.dem.Simulation`, for its shapes and walls; frames: what `repose.dem.Recorder.frames` returns;
    pictures: how many of them, evenly spread over the time, are shown, frame_s seconds each, the last one longer;
    view: see `render_bodies`; the picture holds what is there at the first and the last, unless frame_m is given.
    Colours are reduced until the file has at most max_bytes; raises InputError for another ending, for no frames, or
    where that is not enough.
    """
    out_path = _checked(out_path)
    if not len(frames["time_s"]):
        raise InputError(out_path, "frames", 0, "at least one recorded frame")
    shapes, times = list(simulation.shapes.values()), frames["time_s"]
    settings = [
        setting_of(simulation, *walls) for walls in zip(frames["planes"], frames["wall_frames"], strict=True)
    ]
    chosen = _spread(times, pictures)
    if view.get("frame_m") is None:
        ends = frames["position"][[0, -1]].reshape(-1, 3)
        ends = ends[np.isfinite(ends).all(axis=1)].astype(float)
        reach = max(shape.bounding_radius_m for shape in shapes) * float(frames["scale"].max(initial=0.0))
        view["frame_m"] = outline(ends, reach, settings[-1].frusta, settings[-1].panels)
    drawn = [
        render_bodies(
            frames["position"][k],
            frames["quaternion"][k],
            shapes,
            frames["shape"],
            frames["scale"],
            settings[k],
            **view,
        )
        for k in chosen
    ]
    _save_within(drawn, frame_s, out_path, max_bytes)


def animate_drum(
    trajectory, particle, out_path, section, frames=72, frame_s=0.12, width=380, max_bytes=3_900_000
):
    """The same of a drum that turns, seen along its axis with its rim, whose marks turn with it.

    trajectory: path of a .npz as above with turned_deg (T,) besides; section: the configuration's `drum`.
    """
    out_path = _checked(out_path)
    with np.load(trajectory) as record:
        times, positions, quaternions = record["time_s"], record["position"], record["quaternion"]
        scales = record["scale"] if "scale" in record else np.ones(positions.shape[1])
        turned = np.radians(record["turned_deg"])
    pictures = []
    for k in _spread(times, frames):
        inside = drum_inside(section, turned[k])
        picture = render_pile(
            positions[k],
            quaternions[k],
            particle,
            0.0,
            -90.0,
            width,
            width,
            frame_m=inside.outline(),
            backdrop=inside,
            scales=scales,
        )
        pictures.append(picture)
    _save_within(pictures, frame_s, out_path, max_bytes)


def drum_inside(section, turned_rad):
    """The drum of the configuration's section `drum` as a backdrop, turned by an angle."""
    thickness_m = 1e-3 * section["wall_thickness_mm"]
    radius_m = 0.5e-3 * section["outer_diameter_mm"] - thickness_m
    return DrumInside(radius_m, 1e-3 * section["length_mm"], thickness_m, float(turned_rad))


def _checked(out_path):
    """The path, if its ending is one that can be written."""
    out_path = Path(out_path)
    if out_path.suffix.lower() not in (".gif", ".webp"):
        raise InputError(out_path, "ending", out_path.suffix, ".gif or .webp")
    return out_path


def _spread(times, frames):
    """Indices of so many frames, evenly over the time."""
    return np.searchsorted(times, np.linspace(times[0], times[-1], min(frames, len(times))))


def _save_within(pictures, frame_s, out_path, max_bytes):
    """Write RGB pictures, with as many colours as max_bytes allow; InputError where none do."""
    images = [Image.fromarray(picture) for picture in pictures]
    shown_ms = [round(1000 * frame_s)] * (len(images) - 1) + [round(1000 * LAST_S)]
    for effort in range(5):
        _save(images, shown_ms, out_path, effort)
        if out_path.stat().st_size <= max_bytes:
            return
    raise InputError(
        out_path, "max_bytes", max_bytes, f"at least {out_path.stat().st_size} at this size and length"
    )


def _save(pictures, shown_ms, out_path, effort):
    """Write the pictures, coarser in colour with growing effort (0 to 4)."""
    options = {"save_all": True, "duration": shown_ms, "loop": 0}
    if out_path.suffix.lower() == ".webp":
        pictures[0].save(out_path, append_images=pictures[1:], quality=80 - 15 * effort, method=4, **options)
        return
    # One palette for all frames, taken from the last one: still parts stay still.
    palette = pictures[-1].quantize((128, 96, 64, 48, 32)[effort])
    reduced = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    reduced[0].save(out_path, append_images=reduced[1:], optimize=False, disposal=1, **options)
