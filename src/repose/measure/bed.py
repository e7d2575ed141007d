"""What is measured of a bed in a drum that turns about the y axis: its surface, its first slip, the slipping layer.

The drum turns so that it carries the bed towards +x; seen along y, x points right and z up. The origin lies on the
axis. The drum's frame turns with it: a bed that is carried along like a solid is at rest there.
"""

import math
from dataclasses import dataclass

import numpy as np

from repose.dem.rotations import rotation_matrices
from repose.measure import silhouette
from repose.measure.pile import equivalent_diameter

SMALLEST_FIT = 8  # pixel columns that a line needs


@dataclass(frozen=True)
class Surface:
    """Upper edge of the bed in the side view along the axis, and the line through its middle.

    profile_m (M, 2): x and z of the edge, one row per pixel column; line_m (2, 2): the line's ends (x, z).
    angle_deg: of the line, above 0 where the bed is higher on the side to which the drum carries it.
    """

    angle_deg: float
    profile_m: np.ndarray
    line_m: np.ndarray


@dataclass(frozen=True)
class Slip:
    """A slip by `find_slip`: rows of the record at which it begins, is judged to be one, and ends."""

    begins: int
    judged: int
    ends: int


def measure_surface(centres_m, quaternions, particle, radius_m, mm_per_pixel, fit_share, scales=None):
    """`Surface` of berries in a drum of inner radius `radius_m`.

    centres_m (N, 3), quaternions (N, 4) w, x, y, z, scales (N,), by default 1. The edge is that of the silhouette: in
    each pixel column the
    highest point of any berry. The line is the least-squares one through the middle `fit_share` of the edge's width, so
    that berries lifted along the wall do not count. Raises ValueError where there are too few columns.
    """
    lifted = np.asarray(centres_m, float) + np.array([0.0, 0.0, radius_m])
    image = silhouette.silhouette(
        lifted, quaternions, particle, 0.0, mm_per_pixel, (-radius_m, radius_m, 2.0 * radius_m), scales
    )
    filled = image == silhouette.PILE_TONE
    columns = np.flatnonzero(filled.any(axis=0))
    pixel_m = 1e-3 * mm_per_pixel
    x = (columns + 0.5) * pixel_m - radius_m
    z = (len(image) - filled.argmax(axis=0)[columns]) * pixel_m - radius_m
    middle = np.abs(x - 0.5 * (x.min() + x.max())) <= 0.5 * fit_share * np.ptp(x) if len(x) else []
    if np.count_nonzero(middle) < SMALLEST_FIT:
        raise ValueError(
            f"the bed is {len(x)} pixels wide; allowed: {SMALLEST_FIT} in the part that is fitted"
        )
    slope, height = np.polyfit(x[middle], z[middle], 1)
    ends = x[middle][[0, -1]]
    line = np.column_stack([ends, slope * ends + height])
    return Surface(math.degrees(math.atan(slope)), np.column_stack([x, z]), line)


def to_drum_frame(centres_m, turned_rad):
    """Positions (..., 3) as seen from a drum that has turned by an angle (radians)."""
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    x, z = centres_m[..., 0], centres_m[..., 2]
    return np.stack([cos * x + sin * z, centres_m[..., 1], cos * z - sin * x], axis=-1)


def bed_angle(centres_m):
    """Angle (degrees) of the bed's centre of mass about the axis, from straight down towards +x."""
    x, _, z = np.mean(centres_m, axis=0)
    return math.degrees(math.atan2(x, -z))


def relative_energy(centres_m, quaternions, velocities_m_s, turning_rad_s, particle, frame_rad_s, scales=1.0):
    """Mean kinetic energy of a berry (J), translation and rotation, in a frame that turns about the origin.

    All arrays are in the world frame: centres (N, 3), quaternions (N, 4), velocities (N, 3), angular velocities (N, 3)
    of the berries, angular velocity (3,) of the frame; scales (N,): of the berries.
    """
    drift = velocities_m_s - np.cross(frame_rad_s, centres_m)
    turn = rotation_matrices(quaternions)
    spin = np.einsum("nij,ni->nj", turn, turning_rad_s - frame_rad_s)
    energy = scales**3 * particle.mass_kg * np.sum(drift**2, axis=1)
    energy += scales**5 * (spin**2 @ particle.inertia_kg_m2)
    return 0.5 * float(energy.mean())


def find_slip(bed_deg, energy_j, drop_deg, calm_energy_j):
    """First `Slip` in a record, or None where there is none.

    bed_deg (T,): angle of the centre of mass; energy_j (T,): kinetic energy of a berry in the drum's frame. A slip is
    judged when the angle has fallen by `drop_deg` below the highest so far; it began at that highest, and ends when
    the energy is below `calm_energy_j` again, or with the record. The angle of the centre of mass is taken, not
    that of the surface: a few berries that roll change the second by more than a degree, the first by nothing.
    """
    bed = np.asarray(bed_deg, float)
    fallen = np.flatnonzero(np.maximum.accumulate(bed) - bed >= drop_deg) if len(bed) else []
    if not len(fallen):
        return None
    judged = int(fallen[0])
    calm = np.flatnonzero(np.asarray(energy_j)[judged:] < calm_energy_j)
    ends = judged + int(calm[0]) if len(calm) else len(bed) - 1
    return Slip(int(np.argmax(bed[: judged + 1])), judged, ends)


def slip_displacement(before_m, after_m, turned_rad, surface):
    """Depth (N,) below the surface before the slip and motion (N,) down along it, both m, of each berry.

    before_m, after_m (N, 3): positions; turned_rad: by how much the drum turned in between; surface: `Surface` before.
    The motion is that against the drum. Berries outside the part of the surface that was fitted are NaN.
    """
    (x0, z0), (x1, _) = surface.line_m
    slope = math.radians(surface.angle_deg)
    along, up = np.array([math.cos(slope), math.sin(slope)]), np.array([-math.sin(slope), math.cos(slope)])
    place = before_m[:, ::2] - (x0, z0)
    reach, depth = place @ along, -(place @ up)
    moved = -(to_drum_frame(after_m, turned_rad) - before_m)[:, ::2] @ along
    beside = (reach < 0.0) | (reach > (x1 - x0) / math.cos(slope))
    return np.where(beside, np.nan, depth), np.where(beside, np.nan, moved)


def depth_profile(depth_m, moved_m, bin_m):
    """Rows (middle of the bin m, mean motion m, standard deviation m, berries) of `slip_displacement`, by depth."""
    known = np.isfinite(depth_m)
    bins = np.floor(depth_m[known] / bin_m).astype(int)
    rows = []
    for k in np.unique(bins):
        here = moved_m[known][bins == k]
        rows.append(((k + 0.5) * bin_m, here.mean(), here.std(), len(here)))
    return np.array(rows)


def moved_share(moved_m, particle):
    """Share of berries that moved by more than the berry's equivalent diameter; those that are NaN do not count."""
    known = moved_m[np.isfinite(moved_m)]
    return float(np.mean(np.abs(known) > equivalent_diameter(particle))) if len(known) else 0.0
