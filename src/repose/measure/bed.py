"""Measurements of a bed in a drum that turns about the y axis: its surface, its first slip, the slipping layer.

The drum carries the bed towards +x; seen along y, x points right and z up, and the origin lies on the axis. The drum's
frame turns with it, so a bed that turns as a solid with the drum is at rest there.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from repose.dem.rotations import rotation_matrices
from repose.measure import silhouette
from repose.measure.pile import equivalent_diameter

SMALLEST_FIT = 8  # pixel columns that a line needs


@dataclass(frozen=True)
class Surface:
    """Upper edge of the bed in the side view along the axis, and the line through its middle."""

    angle_deg: float  # of the line; positive if the bed is higher on the side to which the drum carries it
    profile_m: np.ndarray  # (M, 2), x and z of the edge, one row per pixel column
    line_m: np.ndarray  # (2, 2), x and z of the line's two ends


@dataclass(frozen=True)
class Slip:
    """Row numbers of a slip in the record, from `find_slip`."""

    begins: int  # row of the highest angle
    judged: int  # row at which the angle has fallen far enough
    ends: int  # row at which the bed is calm again


def surface_of(
    filled: np.ndarray, radius_m: float, mm_per_pixel: float, fit_share: float
) -> Surface:
    """Surface of a bed that covers pixels (H, W) of the drum's section; the line goes through the middle of its width.

    The ends of the width are left out, since the wall lifts grains there.
    """
    columns = np.flatnonzero(filled.any(axis=0))
    pixel_m = 1e-3 * mm_per_pixel
    x = (columns + 0.5) * pixel_m - radius_m
    z = (len(filled) - filled.argmax(axis=0)[columns]) * pixel_m - radius_m
    middle = (
        np.abs(x - 0.5 * (x.min() + x.max())) <= 0.5 * fit_share * np.ptp(x)
        if len(x)
        else []
    )
    if np.count_nonzero(middle) < SMALLEST_FIT:
        raise ValueError(
            f"the bed is {len(x)} pixels wide; expected {SMALLEST_FIT} in the part that is fitted"
        )
    slope, height = np.polyfit(x[middle], z[middle], 1)
    ends = x[middle][[0, -1]]
    line = np.column_stack([ends, slope * ends + height])
    return Surface(math.degrees(math.atan(slope)), np.column_stack([x, z]), line)


def side_view(
    grains: silhouette.Grains, radius_m: float, mm_per_pixel: float
) -> np.ndarray:
    """Mark the pixels (H, W) of the section of a drum of inner radius `radius_m` that grains cover along the axis."""
    lifted = replace(
        grains, centres_m=grains.centres_m + np.array([0.0, 0.0, radius_m])
    )
    image = silhouette.silhouette(
        lifted, 0.0, mm_per_pixel, (-radius_m, radius_m, 2.0 * radius_m)
    )
    return image == silhouette.PILE_TONE


def occupied_share(
    frames: Iterable[silhouette.Grains], radius_m: float, mm_per_pixel: float
) -> np.ndarray:
    """Share (H, W) of frames in which the bed covers a pixel, seen along the axis."""
    return np.mean(
        [side_view(grains, radius_m, mm_per_pixel) for grains in frames], axis=0
    )


def surface_heights(
    occupied: np.ndarray,
    covered: float,
    x_m: np.ndarray,
    radius_m: float,
    mm_per_pixel: float,
) -> np.ndarray:
    """Heights (M,) [m] over the axis at which `occupied` (H, W) falls to a share `covered`, or of the drum's wall."""
    pixel_m = 1e-3 * mm_per_pixel
    rows, columns = occupied.shape
    places = (np.arange(columns) + 0.5) * pixel_m - radius_m
    first, there = (
        (occupied >= covered).argmax(axis=0),
        (occupied >= covered).any(axis=0),
    )
    inside = occupied[first, np.arange(columns)]
    above = np.where(first > 0, occupied[first - 1, np.arange(columns)], 0.0)
    # the middle of row k lies k + 1/2 pixels below the upper border
    depth = first + 0.5 - (inside - covered) / np.where(there, inside - above, 1.0)
    wall = -np.sqrt(np.maximum(radius_m**2 - places**2, 0.0))
    return np.interp(
        x_m, places, np.where(there, (rows - depth) * pixel_m - radius_m, wall)
    )


def to_drum_frame(centres_m: np.ndarray, turned_rad: float) -> np.ndarray:
    """Positions (..., 3) in the frame of a drum that has turned by an angle."""
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    x, z = centres_m[..., 0], centres_m[..., 2]
    return np.stack([cos * x + sin * z, centres_m[..., 1], cos * z - sin * x], axis=-1)


def bed_angle(centres_m: np.ndarray) -> float:
    """Angle of the bed's centre of mass about the axis in degrees, from straight down towards +x."""
    x, _, z = np.mean(centres_m, axis=0)
    return math.degrees(math.atan2(x, -z))


def relative_energy(
    grains: silhouette.Grains,
    velocities_m_s: np.ndarray,
    turning_rad_s: np.ndarray,
    frame_rad_s: np.ndarray,
) -> float:
    """Mean kinetic energy of a grain [J], translation and rotation, in a frame that turns about the origin."""
    particle: Any = grains.particle  # with mass and moments
    drift = velocities_m_s - np.cross(frame_rad_s, grains.centres_m)
    spin = np.einsum(
        "nij,ni->nj", rotation_matrices(grains.quaternions), turning_rad_s - frame_rad_s
    )
    energy = grains.scales**3 * particle.mass_kg * np.sum(drift**2, axis=1)
    energy += grains.scales**5 * (spin**2 @ particle.inertia_kg_m2)
    return 0.5 * float(energy.mean())


def find_slip(
    bed_deg: np.ndarray, energy_j: np.ndarray, drop_deg: float, calm_energy_j: float
) -> Slip | None:
    """First slip in a record (T,) of the bed's angle and its energy in the drum's frame; None without a slip.

    The angle is that of the centre of mass: a few rolling grains change the angle of the surface by more than a
    degree, but not this one.
    """
    bed = np.asarray(bed_deg, float)
    fallen = np.flatnonzero(np.maximum.accumulate(bed) - bed >= drop_deg)
    if not len(fallen):
        return None
    judged = int(fallen[0])
    calm = np.flatnonzero(np.asarray(energy_j)[judged:] < calm_energy_j)
    ends = judged + int(calm[0]) if len(calm) else len(bed) - 1
    return Slip(int(np.argmax(bed[: judged + 1])), judged, ends)


def slip_displacement(
    before_m: np.ndarray, after_m: np.ndarray, turned_rad: float, surface: Surface
) -> tuple[np.ndarray, np.ndarray]:
    """Depth of each grain below the surface before the slip, and its motion down along the surface, both in m."""
    (x0, z0), (x1, _) = surface.line_m
    slope = math.radians(surface.angle_deg)
    along, up = (
        np.array([math.cos(slope), math.sin(slope)]),
        np.array([-math.sin(slope), math.cos(slope)]),
    )
    place = before_m[:, ::2] - (x0, z0)
    reach, depth = place @ along, -(place @ up)
    moved = -(to_drum_frame(after_m, turned_rad) - before_m)[:, ::2] @ along
    outside = (reach < 0.0) | (reach > (x1 - x0) / math.cos(slope))
    return np.where(outside, np.nan, depth), np.where(outside, np.nan, moved)


def depth_profile(depth_m: np.ndarray, moved_m: np.ndarray, bin_m: float) -> np.ndarray:
    """Motion of the grains by depth, from `slip_displacement`, one row per bin."""
    known = np.isfinite(depth_m)
    bins = np.floor(depth_m[known] / bin_m).astype(int)
    rows = []
    for k in np.unique(bins):
        here = moved_m[known][bins == k]
        rows.append(((k + 0.5) * bin_m, here.mean(), here.std(), len(here)))
    return np.array(rows).reshape(-1, 4)


def moved_share(moved_m: np.ndarray, particle: silhouette.ConvexBody) -> float:
    """Share of grains, 0 to 1, that moved by more than the equivalent diameter; NaN does not count."""
    known = moved_m[np.isfinite(moved_m)]
    return (
        float(np.mean(np.abs(known) > equivalent_diameter(particle)))
        if len(known)
        else 0.0
    )
