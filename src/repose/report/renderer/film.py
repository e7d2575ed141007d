"""Make short looping animations of a pour, of a drum or of any simulation."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from repose.common.errors import InputError
from repose.common.files import StrPath, read_npz, write_bytes
from repose.dem import Simulation
from repose.report.renderer.backdrop import DrumInside
from repose.report.renderer.bodies import Drawable
from repose.report.renderer.render import render_bodies, render_pile
from repose.report.renderer.scenery import (
    Frustum,
    Scenery,
    find_frame_points,
    make_scenery,
)

if TYPE_CHECKING:
    from repose.bench.drum import DrumSettings

TRAJECTORY_KEYS = ("time_s", "position", "quaternion")  # of the file of a trajectory
FORMATS = {".gif": "GIF", ".webp": "WEBP"}
# Time for which each picture is shown, for the last one and for the others
LAST_FRAME_S = 1.6
FRAME_S = 0.08
DRUM_FRAME_S = 0.12
MAX_BYTES = 3_000_000
# A grain has left the pile if its distance from the axis is more than this many times
# the median distance of all grains.
MAX_MEDIAN_DISTANCES = 2
DRUM_MAX_BYTES = 3_900_000
# Numbers of colours of a GIF, and qualities of a WebP, that are tried until the file is
# small enough. Both go from the largest file to the smallest, and have the same length.
GIF_COLOURS = (128, 96, 64, 48, 32)
WEBP_QUALITY = (80, 65, 50, 35, 20)


def animate_pour(
    trajectory: StrPath,
    particle: Drawable,
    out_path: StrPath,
    walls: Sequence[Frustum] = (),
    frames: int = 72,
    **view: Any,
) -> None:
    """Write a looping animation of a pour, as a file of at most `MAX_BYTES`.

    If the file would be larger, the number of colours, or the quality, is reduced.

    Parameters
    ----------
    trajectory : path
        An .npz file with time_s (T,), position (T, N, 3) in m, quaternion (T, N, 4) and
        optionally scale (N,). Before a grain appears, its position is NaN.
    particle : Drawable
        The shape of the grains.
    out_path : path
        File that ends in .gif or .webp.
    walls : sequence of Frustum
        Walls that are drawn translucent.
    frames : int
        Maximum number of pictures, which are spread evenly over the time.
    **view
        Further arguments of `repose.report.renderer.render.render_bodies`.

    Raises
    ------
    InputError
        If the trajectory cannot be read, if `out_path` has another ending, or if the
        file remains too large.
    """
    out_path = _check_ending(out_path)
    arrays = read_npz(trajectory, TRAJECTORY_KEYS, "the trajectory of a pour")
    positions = arrays["position"]
    scales = _read_scales(arrays)
    default_view: dict[str, Any] = {
        "width": 360,
        "height": 460,
        "elevation_deg": 10.0,
        "azimuth_deg": 20.0,
    }
    # All pictures show the same region, which contains the pile at the end.
    options = {
        **default_view,
        **view,
        "walls": walls,
        "frame_m": _find_points_of_pour(
            positions[-1], particle, scales=scales, walls=walls
        ),
        "scales": scales,
    }
    pictures = [
        render_pile(positions[k], arrays["quaternion"][k], particle, **options)
        for k in _choose_frames(arrays["time_s"], frames)
    ]
    _write_within_limit(pictures, FRAME_S, out_path=out_path, max_bytes=MAX_BYTES)


def _find_points_of_pour(
    last_positions: np.ndarray,
    particle: Drawable,
    scales: np.ndarray,
    walls: Sequence[Frustum],
) -> np.ndarray:
    """Find the points that each picture of a pour must contain.

    They enclose the pile and the funnel. Grains that rolled far away may lie outside
    the picture.

    Parameters
    ----------
    last_positions : array (N, 3)
        Final positions of the grains in m; NaN for a grain that is absent. At least one
        grain is present.
    particle : Drawable
        The shape of the grains.
    scales : array (N,)
        Sizes of the grains as multiples of this shape.
    walls : sequence of Frustum
        The walls of the funnel.

    Returns
    -------
    array (M, 3)
        The points in m.
    """
    is_present = np.isfinite(last_positions).all(axis=1)
    resting = last_positions[is_present].astype(float)
    largest_radius_m = particle.bounding_radius_m * float(scales.max(initial=0.0))
    distance_from_axis = np.hypot(resting[:, 0], resting[:, 1])
    is_in_pile = distance_from_axis < MAX_MEDIAN_DISTANCES * np.median(
        distance_from_axis
    )
    points = find_frame_points(resting[is_in_pile], largest_radius_m, walls)
    # Leave room for a grain that falls in from above.
    point_above = [[0, 0, points[:, 2].max() + 2 * largest_radius_m]]
    return np.concatenate([points, point_above])


def animate(
    simulation: Simulation,
    frames: Mapping[str, np.ndarray],
    out_path: StrPath,
    pictures: int = 48,
    **view: Any,
) -> None:
    """Write a looping animation of any simulation, as a file of at most `MAX_BYTES`.

    Parameters
    ----------
    simulation : Simulation
        The simulation, which provides the shapes and the walls.
    frames : mapping
        The recorded frames, from `repose.dem.Recorder.frames`.
    out_path : path
        File that ends in .gif or .webp.
    pictures : int
        Maximum number of pictures, which are spread evenly over the time.
    **view
        Further arguments of `repose.report.renderer.render.render_bodies`. By default,
        `frame_m` encloses the bodies in the first and in the last frame.

    Raises
    ------
    InputError
        If there is no frame, if `out_path` has another ending, or if the file remains
        too large.
    """
    out_path = _check_ending(out_path)
    times = frames["time_s"]
    if not len(times):
        raise InputError(
            out_path, key="frames", value=0, allowed="at least one recorded frame"
        )
    shapes = list(simulation.shapes.values())
    sceneries = _list_sceneries(simulation, frames)
    if view.get("frame_m") is None:
        view["frame_m"] = _find_shown_points(shapes, frames, sceneries[-1])
    drawn_pictures = [
        render_bodies(
            frames["position"][k],
            frames["quaternion"][k],
            shapes=shapes,
            shape_ids=frames["shape"],
            scales=frames["scale"],
            scenery=sceneries[k],
            **view,
        )
        for k in _choose_frames(times, pictures)
    ]
    _write_within_limit(drawn_pictures, FRAME_S, out_path=out_path, max_bytes=MAX_BYTES)


def _list_sceneries(
    simulation: Simulation, frames: Mapping[str, np.ndarray]
) -> list[Scenery]:
    """List the walls at each recorded time.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    frames : mapping
        The recorded frames, from `repose.dem.Recorder.frames`. If they do not contain
        ``planes``, all walls rest, or turn about their axis.

    Returns
    -------
    list of Scenery
        The walls at each time.
    """
    if "planes" not in frames:
        # The walls look the same at all times.
        return len(frames["time_s"]) * [make_scenery(simulation)]
    walls = zip(frames["planes"], frames["wall_frames"], strict=True)
    return [
        make_scenery(simulation, planes, wall_frames) for planes, wall_frames in walls
    ]


def _find_shown_points(
    shapes: Sequence[Drawable], frames: Mapping[str, np.ndarray], last_scenery: Scenery
) -> np.ndarray:
    """Find the points that each picture of a simulation must contain.

    They enclose the walls, and the bodies in the first and in the last frame.

    Parameters
    ----------
    shapes : sequence of Drawable
        The shapes of the bodies.
    frames : mapping
        The recorded frames, from `repose.dem.Recorder.frames`.
    last_scenery : Scenery
        The walls in the last frame.

    Returns
    -------
    array (M, 3)
        The points in m.
    """
    centres = frames["position"][[0, -1]].reshape(-1, 3)
    centres = centres[np.isfinite(centres).all(axis=1)].astype(float)
    largest_scale = float(frames["scale"].max(initial=0.0))
    radius = max(shape.bounding_radius_m for shape in shapes) * largest_scale
    return find_frame_points(
        centres, radius, walls=last_scenery.frusta, panels=last_scenery.panels
    )


def animate_drum(
    trajectory: StrPath,
    particle: Drawable,
    out_path: StrPath,
    section: "DrumSettings",
    frames: int = 72,
    **view: Any,
) -> None:
    """Write a looping animation of a turning drum, seen along its axis.

    The marks on its rim turn with it. The pictures are squares, so a height in `view`
    has no effect.

    Parameters
    ----------
    trajectory : path
        An .npz file as for `animate_pour`, which also contains turned_deg (T,).
    particle : Drawable
        The shape of the grains.
    out_path : path
        File that ends in .gif or .webp.
    section : DrumSettings
        The section `drum` of the configuration.
    frames : int
        Maximum number of pictures, which are spread evenly over the time.
    **view
        Further arguments of `repose.report.renderer.render.render_bodies`.

    Raises
    ------
    InputError
        For the same reasons as in `animate_pour`.
    """
    out_path = _check_ending(out_path)
    arrays = read_npz(
        trajectory, (*TRAJECTORY_KEYS, "turned_deg"), "the trajectory of a drum"
    )
    turned_rad = np.radians(arrays["turned_deg"])
    # The camera looks along the axis of the drum, which is the centre of the picture.
    default_view: dict[str, Any] = {
        "width": 380,
        "elevation_deg": 0.0,
        "azimuth_deg": -90.0,
    }
    options = {**default_view, **view, "scales": _read_scales(arrays)}
    options["height"] = options["width"]  # a square, like the outline of the drum
    pictures = []
    for k in _choose_frames(arrays["time_s"], frames):
        inside = make_drum_inside(section, turned_rad[k])
        picture = render_pile(
            arrays["position"][k],
            arrays["quaternion"][k],
            particle,
            frame_m=inside.compute_outline_points(),
            backdrop=inside,
            **options,
        )
        pictures.append(picture)
    _write_within_limit(
        pictures, DRUM_FRAME_S, out_path=out_path, max_bytes=DRUM_MAX_BYTES
    )


def make_drum_inside(section: "DrumSettings", turned_rad: float) -> DrumInside:
    """Make the drum of a configuration as a backdrop.

    Parameters
    ----------
    section : DrumSettings
        The section `drum`.
    turned_rad : float
        Angle by which the drum has turned.

    Returns
    -------
    DrumInside
        The backdrop.
    """
    thickness_m = 1e-3 * section.wall_thickness_mm
    radius_m = 0.5e-3 * section.outer_diameter_mm - thickness_m
    return DrumInside(
        radius_m,
        1e-3 * section.length_mm,
        thickness_m=thickness_m,
        turned_rad=float(turned_rad),
    )


def _read_scales(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the relative sizes (N,) of the grains; 1 if the trajectory has none."""
    return arrays.get("scale", np.ones(arrays["position"].shape[1]))


def _check_ending(out_path: StrPath) -> Path:
    """Convert to a path; raise InputError unless its ending is one of `FORMATS`."""
    out_path = Path(out_path)
    if out_path.suffix.lower() not in FORMATS:
        raise InputError(
            out_path, key="ending", value=out_path.suffix, allowed=".gif or .webp"
        )
    return out_path


def _choose_frames(times: np.ndarray, frames: int) -> np.ndarray:
    """Choose frames that are spread evenly over the time.

    Parameters
    ----------
    times : array (T,)
        Times of all frames.
    frames : int
        Maximum number of frames to choose.

    Returns
    -------
    array of int
        Indices of the chosen frames.
    """
    shown_times = np.linspace(times[0], times[-1], min(frames, len(times)))
    return np.searchsorted(times, shown_times)


def _write_within_limit(
    pictures: Sequence[np.ndarray], frame_s: float, out_path: Path, max_bytes: int
) -> None:
    """Write an animation in the best quality that the limit of the file size allows.

    A lower quality means fewer colours in a GIF, and a lower quality factor in a WebP.

    Parameters
    ----------
    pictures : sequence of array
        Pictures (H, W, 3) of uint8.
    frame_s : float
        Time for which each picture is shown, except the last one, which is shown for
        `LAST_FRAME_S`.
    out_path : Path
        File that ends in .gif or .webp.
    max_bytes : int
        Maximum size of the file.

    Raises
    ------
    InputError
        If the file is too large even in the lowest quality.
    """
    images = [Image.fromarray(picture) for picture in pictures]
    durations_ms = [round(1000 * frame_s)] * len(images)
    durations_ms[-1] = round(1000 * LAST_FRAME_S)
    is_webp = FORMATS[out_path.suffix.lower()] == "WEBP"
    content = b""  # after the loop, the smallest file, whose size the message states
    # Try all qualities from the largest file to the smallest, until one is small
    # enough.
    for colours, quality in zip(GIF_COLOURS, WEBP_QUALITY, strict=True):
        if is_webp:
            content = _encode_webp(images, durations_ms, quality)
        else:
            content = _encode_gif(images, durations_ms, colours)
        if len(content) <= max_bytes:
            write_bytes(out_path, content)
            return
    raise InputError(
        out_path,
        key="max_bytes",
        value=max_bytes,
        allowed=f"at least {len(content)} at this size and length",
    )


def _encode_gif(
    images: Sequence[Image.Image], durations_ms: list[int], colours: int
) -> bytes:
    """Encode pictures as a GIF.

    Parameters
    ----------
    images : sequence of Image
        The pictures.
    durations_ms : list of int
        Time for which each picture is shown.
    colours : int
        Number of colours.

    Returns
    -------
    bytes
        The contents of the file.
    """
    # Give all frames the palette of the last one, so that parts at rest do not change
    # colour.
    palette = images[-1].quantize(colours)
    first, *others = (
        image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images
    )
    content = io.BytesIO()
    first.save(
        content,
        format="GIF",
        append_images=others,
        save_all=True,
        duration=durations_ms,
        loop=0,
        optimize=False,
        disposal=1,
    )
    return content.getvalue()


def _encode_webp(
    images: Sequence[Image.Image], durations_ms: list[int], quality: int
) -> bytes:
    """Encode pictures as a WebP file.

    Parameters
    ----------
    images : sequence of Image
        The pictures.
    durations_ms : list of int
        Time for which each picture is shown.
    quality : int
        Quality from 0 to 100.

    Returns
    -------
    bytes
        The contents of the file.
    """
    first, *others = images
    content = io.BytesIO()
    first.save(
        content,
        format="WEBP",
        append_images=others,
        save_all=True,
        duration=durations_ms,
        loop=0,
        quality=quality,
        method=4,
    )
    return content.getvalue()
