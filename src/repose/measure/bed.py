"""Measurements of a bed in a drum: its surface, its first slip, the slipping layer.

The drum turns about the y axis and carries the bed towards +x. Seen along y, x points
right and z up; the origin lies on the axis. The drum's frame turns with the drum, so a
bed that turns with it as a solid is at rest there.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from repose.dem.rotations import rotation_matrices
from repose.measure import silhouette
from repose.measure.pile import equivalent_diameter

MIN_COLUMNS = 8  # pixel columns that a line needs


@dataclass(frozen=True)
class Surface:
    """Upper edge of the bed in the side view along the axis, and a line through it.

    Attributes
    ----------
    angle_deg : float
        Angle of the line; positive if the bed is higher on the side to which the drum
        carries it.
    profile_m : ndarray
        x and z (M, 2) of the edge, a row for each pixel column.
    line_m : ndarray
        x and z (2, 2) of the line's two ends.
    """

    angle_deg: float
    profile_m: np.ndarray
    line_m: np.ndarray


@dataclass(frozen=True)
class Slip:
    """Rows of a slip in the record of a turning drum, from `find_slip`.

    Attributes
    ----------
    begins : int
        Row of the highest angle, at which the slip begins.
    detection : int
        Row at which the angle has fallen far enough to count as a slip.
    ends : int
        Row at which the grains have settled again.
    """

    begins: int
    detection: int
    ends: int


def surface_of(
    bed_mask: np.ndarray, radius_m: float, mm_per_pixel: float, fit_fraction: float
) -> Surface:
    """Find the surface of a bed and fit a line through its middle part.

    The surface is the upper edge of the bed in each column of the picture. The picture
    shows exactly the cross section of the drum: it is as wide and as high as the drum,
    and the axis of the drum is in the middle.

    Parameters
    ----------
    bed_mask : ndarray
        Mask (H, W) of the pixels that the bed covers.
    radius_m : float
        Inner radius of the drum.
    mm_per_pixel : float
        Scale of the picture.
    fit_fraction : float
        Fraction of the surface's width to which the line is fitted, in its middle. The
        ends are left out, because the wall lifts grains there.

    Returns
    -------
    Surface
        The surface, in m from the axis.

    Raises
    ------
    ValueError
        If the middle part has fewer than `MIN_COLUMNS` pixel columns.
    """
    columns = np.flatnonzero(bed_mask.any(axis=0))
    top_rows = bed_mask.argmax(axis=0)[columns]
    # Convert pixels to positions relative to the axis, which lies one radius right of
    # the left border and one radius above the lower border. Rows count downwards.
    pixel_m = 1e-3 * mm_per_pixel
    x = (columns + 0.5) * pixel_m - radius_m
    z = (len(bed_mask) - top_rows) * pixel_m - radius_m
    # Fit only the middle part. An empty picture has none.
    is_fitted = np.zeros(len(x), dtype=bool)
    if len(x) > 0:
        middle = 0.5 * (x.min() + x.max())
        is_fitted = np.abs(x - middle) <= 0.5 * fit_fraction * np.ptp(x)
    n_fitted = np.count_nonzero(is_fitted)
    if n_fitted < MIN_COLUMNS:
        raise ValueError(
            f"the bed is {len(x)} pixels wide, of which the line can be fitted to "
            f"{n_fitted}; expected at least {MIN_COLUMNS}"
        )
    slope, intercept = np.polyfit(x[is_fitted], z[is_fitted], 1)
    ends = x[is_fitted][[0, -1]]
    return Surface(
        angle_deg=math.degrees(math.atan(slope)),
        profile_m=np.column_stack([x, z]),
        line_m=np.column_stack([ends, slope * ends + intercept]),
    )


def side_view(
    grains: silhouette.Grains, radius_m: float, mm_per_pixel: float
) -> np.ndarray:
    """Draw the view of grains along the axis of a drum.

    Parameters
    ----------
    grains : silhouette.Grains
        The grains; the axis of the drum is the y axis.
    radius_m : float
        Inner radius of the drum.
    mm_per_pixel : float
        Scale of the picture.

    Returns
    -------
    ndarray
        Mask (H, W) of the pixels of the drum's section that grains cover.
    """
    # Silhouettes begin at z = 0, here the drum's lowest point.
    lift = np.array([0.0, 0.0, radius_m])
    lifted = replace(grains, centres_m=grains.centres_m + lift)
    section = silhouette.Extent(left=-radius_m, right=radius_m, top=2.0 * radius_m)
    image = silhouette.draw_silhouette(lifted, 0.0, mm_per_pixel, section)
    return image == silhouette.PILE_TONE


def occupied_share(
    frames: Iterable[silhouette.Grains], radius_m: float, mm_per_pixel: float
) -> np.ndarray:
    """Compute the fraction of frames in which the bed covers each pixel.

    Parameters
    ----------
    frames : iterable of silhouette.Grains
        The grains at several times.
    radius_m, mm_per_pixel : float
        See `side_view`.

    Returns
    -------
    ndarray
        Fractions (H, W), 0 to 1.
    """
    views = [side_view(grains, radius_m, mm_per_pixel) for grains in frames]
    return np.mean(views, axis=0)


def surface_heights(
    occupied: np.ndarray,
    threshold: float,
    x_m: np.ndarray,
    radius_m: float,
    mm_per_pixel: float,
) -> np.ndarray:
    """Compute the heights of the mean surface of a bed in many frames.

    The higher a pixel lies, the fewer frames show the bed in it. The mean surface is at
    the height where the fraction of these frames falls to a threshold.

    Parameters
    ----------
    occupied : ndarray
        Fraction (H, W) of frames in which the bed covers a pixel, from
        `occupied_share`. The picture is as wide and as high as the drum.
    threshold : float
        The fraction on the mean surface.
    x_m : ndarray
        Horizontal distances (M,) from the axis at which the heights are computed,
        positive to the right.
    radius_m : float
        Inner radius of the drum.
    mm_per_pixel : float
        Scale of the picture.

    Returns
    -------
    ndarray
        Heights (M,) in m above the drum's axis; negative below it. Where there is no
        bed, they are the heights of the lower wall of the drum.
    """
    pixel_m = 1e-3 * mm_per_pixel
    n_rows, n_columns = occupied.shape
    columns = np.arange(n_columns)
    column_x = (columns + 0.5) * pixel_m - radius_m
    is_covered = occupied >= threshold
    has_bed = is_covered.any(axis=0)
    top_rows = is_covered.argmax(axis=0)

    # Interpolate between the uppermost covered pixel and the pixel above it, to find
    # where the fraction equals the threshold. The middle of row k lies k + 1/2 pixels
    # below the upper border of the picture. Above the first row, the fraction is 0.
    inner_fraction = occupied[top_rows, columns]
    outer_fraction = np.where(top_rows > 0, occupied[top_rows - 1, columns], 0.0)
    # A column without a bed is replaced below. Until then, avoid a division by zero.
    difference = np.where(has_bed, inner_fraction - outer_fraction, 1.0)
    rows_below_top = top_rows + 0.5 - (inner_fraction - threshold) / difference
    surface_z = (n_rows - rows_below_top) * pixel_m - radius_m

    # In a column without a bed, take the lower half of the circle of the drum's wall.
    wall_z = -np.sqrt(np.maximum(radius_m**2 - column_x**2, 0.0))
    return np.interp(x_m, column_x, np.where(has_bed, surface_z, wall_z))


def to_drum_frame(centres_m: np.ndarray, turned_rad: float) -> np.ndarray:
    """Compute positions in the frame of a drum that has turned.

    Parameters
    ----------
    centres_m : ndarray
        Positions (..., 3) in the frame at rest.
    turned_rad : float
        Angle by which the drum has turned about the negative y axis.

    Returns
    -------
    ndarray
        Positions (..., 3) in m in the frame that turned with the drum.
    """
    cos = math.cos(turned_rad)
    sin = math.sin(turned_rad)
    x = centres_m[..., 0]
    y = centres_m[..., 1]
    z = centres_m[..., 2]
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


def bed_angle(centres_m: np.ndarray) -> float:
    """Compute the angle of the bed's centre of mass about the axis in degrees.

    The angle is 0 straight below the axis, and grows towards +x.
    """
    x, _, z = np.mean(centres_m, axis=0)
    return math.degrees(math.atan2(x, -z))


def relative_energy(
    grains: silhouette.Grains,
    velocities_m_s: np.ndarray,
    angular_velocities_rad_s: np.ndarray,
    frame_rad_s: np.ndarray,
) -> float:
    """Compute the mean kinetic energy of the grains, relative to a turning frame.

    It is the energy of translation and rotation. A grain that moves with the frame has
    none.

    Parameters
    ----------
    grains : silhouette.Grains
        The N grains. Their `particle`, which is the shape of a grain of scale 1, must
        have the attributes `mass_kg` and `inertia_kg_m2`, the principal moments (3,).
    velocities_m_s, angular_velocities_rad_s : ndarray
        Velocities and angular velocities (N, 3) in the frame at rest.
    frame_rad_s : ndarray
        Angular velocity (3,) of the frame, which turns about the origin.

    Returns
    -------
    float
        The mean energy of a grain in J.
    """
    particle: Any = grains.particle
    scales = grains.scales  # sizes (N,) relative to the particle
    relative_velocity = velocities_m_s - np.cross(frame_rad_s, grains.centres_m)
    # Express the angular velocities in the frames of the grains, whose axes are the
    # principal axes of inertia. The matrices rotate from these frames to the world, so
    # the sum over i multiplies by their transposes.
    rotations = rotation_matrices(grains.quaternions)
    spin = np.einsum("nij,ni->nj", rotations, angular_velocities_rad_s - frame_rad_s)
    # The mass of a grain grows with the cube of its size. Its moments of inertia grow
    # with the fifth power.
    twice_energy = scales**3 * particle.mass_kg * np.sum(relative_velocity**2, axis=1)
    twice_energy += scales**5 * (spin**2 @ particle.inertia_kg_m2)
    return 0.5 * float(twice_energy.mean())


def find_slip(
    bed_deg: np.ndarray, energy_j: np.ndarray, drop_deg: float, calm_energy_j: float
) -> Slip | None:
    """Find the first slip in the record of a turning drum.

    The drum lifts the bed's centre of mass, which falls in a slip. The slip begins at
    the highest angle of the centre of mass, and ends when the grains have settled.

    Parameters
    ----------
    bed_deg : ndarray
        Angle (T,) of the bed's centre of mass. Unlike the angle of the surface, it does
        not change by more than a degree with a few rolling grains.
    energy_j : ndarray
        Energy (T,) of a grain in the drum's frame.
    drop_deg : float
        Drop from the highest angle that counts as a slip.
    calm_energy_j : float
        The grains have settled at the first energy below this one. If there is none,
        the slip ends at the end of the record.

    Returns
    -------
    Slip or None
        The rows of the record at which the slip begins, is detected, and ends. None if
        there is no slip.
    """
    # A slip is detected at the first row in which the angle is far enough below the
    # highest angle that was reached before.
    angle = np.asarray(bed_deg, float)
    highest_so_far = np.maximum.accumulate(angle)
    dropped_rows = np.flatnonzero(highest_so_far - angle >= drop_deg)
    if len(dropped_rows) == 0:
        return None
    detection = int(dropped_rows[0])
    # The slip began at the highest angle before its detection. It ends at the first row
    # after it in which the grains have settled.
    start = int(np.argmax(angle[: detection + 1]))
    settled_rows = np.flatnonzero(np.asarray(energy_j)[detection:] < calm_energy_j)
    if len(settled_rows) > 0:
        end = detection + int(settled_rows[0])
    else:
        end = len(angle) - 1
    return Slip(begins=start, detection=detection, ends=end)


def slip_displacement(
    before_m: np.ndarray, after_m: np.ndarray, turned_rad: float, surface: Surface
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the depth of each grain, and how far it slipped down along the surface.

    Parameters
    ----------
    before_m, after_m : ndarray
        Positions (N, 3) of the grains before and after the slip.
    turned_rad : float
        Angle by which the drum turned in between.
    surface : Surface
        The surface before the slip.

    Returns
    -------
    depth : ndarray
        Depth (N,) of each grain below the surface before the slip in m. It is NaN for a
        grain beyond the ends of the surface's line.
    displacement : ndarray
        Displacement (N,) of each grain down along the surface in m; NaN for the same
        grains.
    """
    # Of a position (x, y, z), the slice [:, ::2] takes x and z.
    # Find two directions in the cross section (x, z) of the drum: up along the surface,
    # and perpendicular to it, out of the bed.
    slope = math.radians(surface.angle_deg)
    along = np.array([math.cos(slope), math.sin(slope)])
    normal = np.array([-math.sin(slope), math.cos(slope)])

    # Measure positions from the lower end of the surface's line.
    (first_x, first_z), (last_x, _) = surface.line_m
    line_length = (last_x - first_x) / math.cos(slope)
    position = before_m[:, ::2] - (first_x, first_z)
    distance = position @ along
    depth = -(position @ normal)

    # Turn the later positions back by the rotation of the drum. A grain that only
    # turned with the drum has then not moved.
    motion = to_drum_frame(after_m, turned_rad) - before_m
    displacement = -motion[:, ::2] @ along
    is_beyond = (distance < 0.0) | (distance > line_length)
    return (
        np.where(is_beyond, np.nan, depth),
        np.where(is_beyond, np.nan, displacement),
    )


def depth_profile(
    depth_m: np.ndarray, displacement_m: np.ndarray, bin_m: float
) -> np.ndarray:
    """Summarise the displacement of grains in layers parallel to the surface.

    Parameters
    ----------
    depth_m, displacement_m : ndarray
        Depth (N,) and displacement (N,) of the grains, from `slip_displacement`. Both
        are NaN for the same grains, which are left out.
    bin_m : float
        Thickness of a layer.

    Returns
    -------
    ndarray
        A row (4,) for each layer that contains grains: depth of its middle, mean and
        standard deviation of the displacement, number of grains. The lengths are in m.
    """
    is_known = np.isfinite(depth_m)
    displacement = displacement_m[is_known]
    layers = np.floor(depth_m[is_known] / bin_m).astype(int)
    rows = []
    for layer in np.unique(layers):
        in_layer = displacement[layers == layer]
        middle = (layer + 0.5) * bin_m
        rows.append((middle, in_layer.mean(), in_layer.std(), len(in_layer)))
    # The shape is (0, 4) if there is no layer.
    return np.array(rows).reshape(-1, 4)


def moved_share(displacement_m: np.ndarray, particle: silhouette.ConvexBody) -> float:
    """Compute the fraction of grains that moved by more than the equivalent diameter.

    A grain whose displacement is NaN does not count. If no grain counts, the fraction
    is 0.
    """
    known = displacement_m[np.isfinite(displacement_m)]
    if len(known) == 0:
        return 0.0
    return float(np.mean(np.abs(known) > equivalent_diameter(particle)))
