"""A pour for the page's 3-D view: a body's triangles, and the place of each body at each time, in few bytes.

Positions are whole multiples of 1/65534 of the space of the bodies, orientations whole multiples of 1/127: a grain is
within 0.02 mm and 1 degree of its true place.
"""

import os
from dataclasses import astuple
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from repose.common.files import read_npz
from repose.dem.tessellation import tessellate
from repose.grain.particle import Particle
from repose.report.page.prediction import packed
from repose.report.renderer.film import KEYS
from repose.report.renderer.scenery import funnel_walls

if TYPE_CHECKING:
    from repose.bench.funnel import FunnelSettings

FRAMES = 72
MAX_BYTES = 1_500_000  # of positions and orientations
BYTES = 10  # of one body in one frame
ABSENT, STEPS = 65535, 65534
MAX_TRIANGLES = 600_000  # of all bodies together, for a phone


def for_page(
    trajectory: str | os.PathLike[str], particle: Particle, section: "FunnelSettings"
) -> dict[str, Any]:
    """Give a pour as plain values by name, lengths in mm; InputError if the trajectory cannot be read.

    Names: `body`, `times_s`, `positions` (frames, bodies, 3), 65535 for an absent body, with `low` and `step`, `turns`,
    quaternions x, y, z, w, `scales` or None, `walls`, rows of z, r below and z, r above, and `plate_mm`, a radius.
    `trajectory` is as for `repose.report.renderer.film.animate_pour`, `section` the configuration's `funnel`.
    """
    record = read_npz(trajectory, KEYS, "the trajectory of a pour")
    count = record["position"].shape[1]
    shown = frames_shown(record["time_s"], count)
    positions, low, step = quantised(1e3 * record["position"][shown].astype(float))
    turns = np.nan_to_num(
        np.roll(record["quaternion"][shown].astype(float), -1, axis=2)
    )
    scales = record.get("scale")
    walls = [
        [1e3 * length for length in astuple(wall)[:4]]
        for wall in funnel_walls(section.funnel)
    ]
    points, normals, triangles = body(particle, MAX_TRIANGLES // max(count, 1))
    shape = {
        "points": packed(points, "<f4"),
        "normals": packed(normals, "<f4"),
        "triangles": packed(triangles, "<u4"),
    }
    return {
        "body": shape,
        "count": count,
        "times_s": record["time_s"][shown].astype(float).round(3).tolist(),
        "low": low.tolist(),
        "step": step.tolist(),
        "positions": packed(positions, "<u2"),
        "turns": packed(np.rint(127 * turns), "<i1"),
        "scales": None if scales is None else packed(scales, "<f4"),
        "walls": walls,
        "plate_mm": section.plate_diameter_mm / 2,
    }


def frames_shown(times_s: np.ndarray, count: int) -> np.ndarray:
    """Give the numbers of the frames in a page: evenly over the time, with the last one."""
    most = min(FRAMES, max(2, MAX_BYTES // (BYTES * max(count, 1))), len(times_s))
    return np.unique(
        np.searchsorted(times_s, np.linspace(times_s[0], times_s[-1], most))
    )


def quantised(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give positions (T, N, 3) as uint16 `whole`, with `low` and `step` (3,): position = low + step * whole."""
    there = np.isfinite(positions).all(axis=2)
    whole = np.full(positions.shape, ABSENT, np.uint16)
    if not there.any():
        return whole, np.zeros(3), np.ones(3)
    low, high = positions[there].min(axis=0), positions[there].max(axis=0)
    step = np.maximum(high - low, 1e-9) / STEPS
    whole[there] = np.rint((positions[there] - low) / step)
    return whole, low, step


def body(
    particle: Particle, most_triangles: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give one body as points in mm, normals and triangles; of spheres only the visible triangles."""
    if not particle.is_clump:
        rings = int(np.clip(np.sqrt(most_triangles / 4), 8, 18))
        points, normals, triangles = tessellate(particle, rings, 2 * rings)
        return 1e3 * points, normals, triangles
    spheres = 1e3 * np.asarray(particle.spheres_m, dtype=float)
    for fineness in (2, 1):
        parts = _spheres(spheres, trimesh.creation.icosphere(subdivisions=fineness))
        if len(parts[2]) <= most_triangles:
            break
    return parts


def _spheres(
    spheres: np.ndarray, ball: trimesh.Trimesh
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give points, normals and triangles of the spheres (M, 4) that no other sphere contains."""
    corners = np.asarray(ball.vertices)
    points = spheres[:, None, :3] + spheres[:, None, 3:] * corners
    hidden = (
        np.linalg.norm(points[:, :, None] - spheres[:, :3], axis=3)
        < spheres[:, 3] * (1 - 1e-9)
    ).any(axis=2)
    faces = (
        len(corners) * np.arange(len(spheres))[:, None, None] + ball.faces
    ).reshape(-1, 3)
    used, triangles = np.unique(
        faces[~hidden.ravel()[faces].all(axis=1)], return_inverse=True
    )
    return (
        points.reshape(-1, 3)[used],
        np.tile(corners, (len(spheres), 1))[used],
        triangles.reshape(-1, 3),
    )
