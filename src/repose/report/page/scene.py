"""Write a pour for the page's 3-D view: the surface of a grain, and where the grains are.

To save bytes, positions are rounded to one of `POSITION_STEPS` steps across the space
of all grains, and the components of orientations to multiples of 1 /
`ORIENTATION_STEPS`. The error of a grain is below 0.02 mm and 1 degree.
"""

import os
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import trimesh

from repose.common.files import read_npz
from repose.dem.tessellation import tessellate
from repose.grain.particle import Particle
from repose.report.page.prediction import pack_array
from repose.report.renderer.film import TRAJECTORY_KEYS
from repose.report.renderer.scenery import make_funnel_walls

if TYPE_CHECKING:
    from repose.bench.funnel import FunnelSettings

MAX_FRAMES = 72
MAX_BYTES = 1_500_000  # of positions and orientations
BYTES_PER_GRAIN = 10  # in one frame
# Positions are stored as numbers of 16 bits, from 0 to 65535. The largest number marks
# a grain that is absent, which `view.js` also knows. So a position is at most 65534.
POSITION_STEPS = 65534
ABSENT_POSITION = 65535
# Components of orientations, from -1 to 1, are stored as numbers of 8 bits with a sign.
ORIENTATION_STEPS = 127
MAX_TRIANGLES = 600_000  # of all grains together, for a phone
# Smallest and largest number of rings of points on the surface of a smooth grain
MIN_RINGS = 8
MAX_RINGS = 18
# This smallest extent, in mm, avoids a division by zero if all grains have the same
# coordinate.
MIN_EXTENT = 1e-9
# Factor that reduces a radius by more than a rounding error.
RADIUS_TOLERANCE = 1 - 1e-9


class Surface(NamedTuple):
    """A surface of V points and T triangles."""

    points: np.ndarray  # (V, 3), in mm
    normals: np.ndarray  # (V, 3)
    triangles: np.ndarray  # (T, 3) of int


class QuantisedPositions(NamedTuple):
    """Positions as whole numbers: a position is low + step * numbers."""

    numbers: np.ndarray  # (T, N, 3) of uint16, `ABSENT_POSITION` for an absent grain
    low: np.ndarray  # (3,), smallest coordinates
    step: np.ndarray  # (3,), step along each axis


def export_pour(
    trajectory: str | os.PathLike[str], particle: Particle, section: "FunnelSettings"
) -> dict[str, Any]:
    """Convert a pour to plain values for the page's 3-D view, with lengths in mm.

    `view.js` reads these values by their keys and types, so change both together.

    Parameters
    ----------
    trajectory : path
        File of the trajectory, as for `repose.report.renderer.film.animate_pour`.
    particle : Particle
        The shape of the grains.
    section : FunnelSettings
        The section `funnel` of the configuration.

    Returns
    -------
    dict
        `body` is the surface of a grain, and `count` the number of grains. `times_s`
        are the times of the frames. `positions` (frames, grains, 3) are whole numbers,
        which are converted to mm by `low` and `step` (`QuantisedPositions`). `turns`
        (frames, grains, 4) are orientations: quaternions x, y, z, w, as multiples of
        1 / `ORIENTATION_STEPS`. `scales` are the relative sizes
        of the grains, or None. `walls` has a row for each wall: height and radius of
        its lower end, then of its upper end. `plate_mm` is the radius of the plate.

    Raises
    ------
    InputError
        If the trajectory cannot be read.
    """
    arrays = read_npz(trajectory, TRAJECTORY_KEYS, "the trajectory of a pour")
    times_s = arrays["time_s"]
    n_grains = arrays["position"].shape[1]
    frames = choose_frames(times_s, n_grains)
    positions = quantise(1e3 * arrays["position"][frames].astype(float))
    # The order of a quaternion is w, x, y, z in the file, but x, y, z, w in the page.
    quaternions = np.roll(arrays["quaternion"][frames].astype(float), -1, axis=2)
    # An absent grain has no orientation in the file.
    orientations = np.nan_to_num(quaternions)
    scales = arrays.get("scale")
    # Height and radius of both ends of each wall.
    walls = [
        [
            1e3 * length_m
            for length_m in (wall.z_low_m, wall.r_low_m, wall.z_high_m, wall.r_high_m)
        ]
        for wall in make_funnel_walls(section.funnel)
    ]
    surface = make_grain_surface(particle, MAX_TRIANGLES // max(n_grains, 1))
    return {
        "body": {
            "points": pack_array(surface.points, "<f4"),
            "normals": pack_array(surface.normals, "<f4"),
            "triangles": pack_array(surface.triangles, "<u4"),
        },
        "count": n_grains,
        "times_s": times_s[frames].astype(float).round(3).tolist(),
        "low": positions.low.tolist(),
        "step": positions.step.tolist(),
        "positions": pack_array(positions.numbers, "<u2"),
        "turns": pack_array(np.rint(ORIENTATION_STEPS * orientations), "<i1"),
        "scales": None if scales is None else pack_array(scales, "<f4"),
        "walls": walls,
        "plate_mm": section.plate_diameter_mm / 2,
    }


def choose_frames(times_s: np.ndarray, n_grains: int) -> np.ndarray:
    """Choose the frames of a page, spread evenly over the time of the trajectory.

    The first and the last frame are included. The number of frames is limited by
    `MAX_FRAMES` and `MAX_BYTES`.

    Parameters
    ----------
    times_s : ndarray
        Times (T,) of the frames of the trajectory.
    n_grains : int
        Number of grains.

    Returns
    -------
    ndarray of int
        Numbers of the chosen frames.
    """
    bytes_per_frame = BYTES_PER_GRAIN * max(n_grains, 1)
    max_frames = max(2, MAX_BYTES // bytes_per_frame)
    n_frames = min(MAX_FRAMES, max_frames, len(times_s))
    shown_times_s = np.linspace(times_s[0], times_s[-1], n_frames)
    return np.unique(np.searchsorted(times_s, shown_times_s))


def quantise(positions: np.ndarray) -> QuantisedPositions:
    """Convert positions to whole numbers of 2 bytes, to keep the page small.

    Parameters
    ----------
    positions : ndarray
        Positions (T, N, 3). A grain is absent while its position is NaN.

    Returns
    -------
    QuantisedPositions
        The whole numbers, and how to convert them back.
    """
    is_present = np.isfinite(positions).all(axis=2)
    numbers = np.full(positions.shape, ABSENT_POSITION, np.uint16)
    if not is_present.any():
        return QuantisedPositions(numbers, low=np.zeros(3), step=np.ones(3))
    # Divide the extent of all grains into equal steps along each axis.
    low = positions[is_present].min(axis=0)
    high = positions[is_present].max(axis=0)
    step = np.maximum(high - low, MIN_EXTENT) / POSITION_STEPS
    numbers[is_present] = np.rint((positions[is_present] - low) / step)
    return QuantisedPositions(numbers, low, step)


def make_grain_surface(particle: Particle, max_triangles: int) -> Surface:
    """Make a coarse mesh of the surface of a grain.

    For a clump of spheres, triangles that lie inside other spheres are left out.

    Parameters
    ----------
    particle : Particle
        The grain.
    max_triangles : int
        Desired maximum number of triangles. The coarsest mesh may exceed it: for a
        clump of spheres, or below `MIN_RINGS` rings, there is no coarser mesh.

    Returns
    -------
    Surface
        The surface in mm.
    """
    if not particle.is_clump:
        # n rings of 2 n points have about 4 n^2 triangles.
        n_rings = int(np.clip(np.sqrt(max_triangles / 4), MIN_RINGS, MAX_RINGS))
        points_m, normals, triangles = tessellate(particle, n_rings, 2 * n_rings)
        return Surface(1e3 * points_m, normals, triangles)
    # Use the finer of two meshes of a sphere, if it has few enough triangles.
    spheres_mm = 1e3 * np.asarray(particle.spheres_m, dtype=float)
    fine = _make_visible_surface(spheres_mm, trimesh.creation.icosphere(subdivisions=2))
    if len(fine.triangles) <= max_triangles:
        return fine
    return _make_visible_surface(spheres_mm, trimesh.creation.icosphere(subdivisions=1))


def _make_visible_surface(spheres: np.ndarray, unit_sphere: trimesh.Trimesh) -> Surface:
    """Make the surface of a clump without the triangles inside its spheres.

    Parameters
    ----------
    spheres : ndarray
        Centres and radii (M, 4) in mm.
    unit_sphere : Trimesh
        Mesh of the unit sphere, which is scaled and moved to each sphere.

    Returns
    -------
    Surface
        The surface in mm.
    """
    unit_points = np.asarray(unit_sphere.vertices)
    centres = spheres[:, :3]
    radii = spheres[:, 3]
    points = centres[:, None, :] + radii[:, None, None] * unit_points

    # A point is hidden if it lies inside any other sphere. Reducing the radii ensures
    # that rounding errors do not place it inside its own sphere. There are few spheres,
    # so the distances of all points from all centres fit into memory.
    distances = np.linalg.norm(points[:, :, None] - centres, axis=3)
    is_hidden = (distances < RADIUS_TOLERANCE * radii).any(axis=2).ravel()

    # All points form one list, sphere by sphere, so add the index of a sphere's first
    # point to the indices in its triangles. A triangle is hidden if all its points are.
    first_point = len(unit_points) * np.arange(len(spheres))
    triangles = (first_point[:, None, None] + unit_sphere.faces).reshape(-1, 3)
    visible_triangles = triangles[~is_hidden[triangles].all(axis=1)]

    # Drop the points that no visible triangle uses, and renumber the others. The normal
    # at a point of a sphere is the corresponding point of the unit sphere.
    kept_points, renumbered = np.unique(visible_triangles, return_inverse=True)
    normals = np.tile(unit_points, (len(spheres), 1))
    return Surface(
        points.reshape(-1, 3)[kept_points],
        normals[kept_points],
        renumbered.reshape(-1, 3),
    )
