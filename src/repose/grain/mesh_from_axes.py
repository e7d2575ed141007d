"""Make a closed mesh for a grain without a scan, from three axes and a mass."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.optimize import brentq

from repose.common.errors import InputError
from repose.common.numbers import format_significant
from repose.grain.particle import MM, check_positive

# Shape numbers of the convex bodies with the smallest and the largest volume
# (`compute_profile_exponents`)
SHAPE_LIMITS = (1.0, 30.0)
# Accuracy of a shape number, near the precision of a float
SHAPE_TOLERANCE = 1e-12
LARGEST_TAPER = 0.5
LARGEST_GROOVE = 0.15  # depth of a groove over half of the shortest axis
WRINKLES = (3, 40)  # smallest and largest number of grooves
RINGS = 64  # steps along the outline of a mesh, from tip to tip
SECTORS = 96  # points around the long axis
# Number of points on one half of the outline, from which the steps are interpolated
OUTLINE_POINTS = 4000

Axes = Sequence[float] | np.ndarray


@dataclass(frozen=True)
class _Details:
    """The taper and the grooves of a grain, in addition to its axes and volume."""

    taper: float  # the width changes by this fraction towards one end
    wrinkles: int  # number of grooves along the grain
    wrinkle_depth_mm: float  # depth of the grooves where the grain is widest


def compute_profile_exponents(shape: float) -> tuple[float, float]:
    """Compute the exponents m and k of the profile r(t) = (1 - abs(t)^m)^k.

    Of two bodies with the same axes, the one with the larger shape number has the
    larger volume. The shape number 2 gives an ellipsoid. Above 2, the shape number is
    m, and k = 1 / m. Below 2, the shape number is 1 / k, and m = 2.
    """
    if shape >= 2:
        return shape, 1 / shape
    return 2.0, 1 / shape


def _compute_outline(shape: float, taper: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute points at equal distances along the outline of a grain.

    The outline gives the radius r at the position t along the grain, which goes from -1
    to 1. It is the profile r(t) = (1 - |t|^m)^k, times 1 + taper * t.

    Parameters
    ----------
    shape : float
        Shape number, which determines the exponents m and k
        (`compute_profile_exponents`).
    taper : float
        Fraction by which the width increases towards the end t = 1.

    Returns
    -------
    positions : ndarray
        Positions t (RINGS + 1,) along the grain, from -1 to 1.
    radii : ndarray
        The radii r (RINGS + 1,) at these positions, relative to the largest radius.
    """
    m, k = compute_profile_exponents(shape)
    # One half of the outline goes from the end t = -1 to the middle. With equal steps
    # of the angle, its points are densest at the end, where the radius changes fastest.
    # The exponent 2 / m gives |t|^m = cos^2. The other half is the mirror image of the
    # first one, without the middle point, which is the last one of the first half.
    half_t = np.cos(np.linspace(0, math.pi / 2, OUTLINE_POINTS)) ** (2 / m)
    # Rounding errors could make the base of the power negative at the end.
    half_r = np.clip(1 - half_t**m, 0, None) ** k
    t = np.concatenate([-half_t, half_t[-2::-1]])
    symmetric_r = np.concatenate([half_r, half_r[-2::-1]])
    r = symmetric_r * (1 + taper * t)
    r /= r.max()

    # Interpolate at equal distances along the outline.
    segment_lengths = np.hypot(np.diff(t), np.diff(r))
    distances = np.concatenate([[0], np.cumsum(segment_lengths)])  # from the first end
    even_distances = np.linspace(0, distances[-1], RINGS + 1)
    positions = np.interp(even_distances, distances, t)
    radii = np.interp(even_distances, distances, r)
    return positions, radii


def _make_mesh(axes_mm: Axes, shape: float, details: _Details) -> trimesh.Trimesh:
    """Make the closed mesh of a grain whose long axis lies along x.

    The mesh consists of rings of points around the long axis and a point at each tip.

    Parameters
    ----------
    axes_mm : sequence of float
        Full lengths along the three axes, the longest first.
    shape : float
        Shape number, see `compute_profile_exponents`.
    details : _Details
        Taper and grooves. The grooves are called wrinkles there.

    Returns
    -------
    Trimesh
        The mesh in mm.
    """
    positions, scales = _compute_outline(shape, details.taper)
    angles = np.arange(SECTORS) * (2 * math.pi / SECTORS)
    half_length, half_width, half_height = np.asarray(axes_mm, float) / 2

    # Without grooves, the largest cross-section (SECTORS, 2) is an ellipse. Grooves lie
    # inside this ellipse, and have the form of a cosine wave around it. Their depth, as
    # a fraction of half of the shortest axis, reduces both coordinates of a point.
    depth = details.wrinkle_depth_mm / half_height
    groove_factors = 1 - depth * (1 - np.cos(details.wrinkles * angles)) / 2
    y = half_width * np.cos(angles)
    z = half_height * np.sin(angles)
    largest_section = np.column_stack([y, z]) * groove_factors[:, None]

    # Each ring is a smaller copy of the largest cross-section. The first and the last
    # position are the tips, which are single points.
    rings = []
    for x, scale in zip(half_length * positions[1:-1], scales[1:-1], strict=True):
        rings.append(np.column_stack([np.full(SECTORS, x), scale * largest_section]))
    tips = [[-half_length, 0, 0], [half_length, 0, 0]]
    # `_list_faces` relies on this order of the points.
    points = np.concatenate([*rings, tips])
    return trimesh.Trimesh(points, _list_faces(len(rings)), process=False)


def _list_faces(n_rings: int) -> np.ndarray:
    """List the triangles of a mesh that consists of rings of points and two tips.

    The points must be numbered ring by ring, as in `_make_mesh`. The two tips have the
    last numbers.

    Parameters
    ----------
    n_rings : int
        Number of rings, of `SECTORS` points each.

    Returns
    -------
    ndarray of int
        Numbers (T, 3) of the corners of each triangle, in counter-clockwise order as
        seen from outside.
    """
    n_points = n_rings * SECTORS + 2
    # Number the points of the first ring, and for each of them the next point around
    # the ring. In another ring, the number of its first point is added to both.
    point = np.arange(SECTORS)
    neighbour = (point + 1) % SECTORS
    last_ring = (n_rings - 1) * SECTORS
    first_tip = np.full(SECTORS, n_points - 2)
    last_tip = np.full(SECTORS, n_points - 1)
    # A fan of triangles around the first tip closes the first end.
    faces = [np.column_stack([first_tip, neighbour, point])]
    # Between two rings there are quadrilaterals with the corners a, b, d and c, where a
    # and b lie on the first ring, and c and d on the next. Each of them is divided into
    # two triangles. Here `ring` is the number of the first point of the ring.
    for ring in range(0, last_ring, SECTORS):
        next_ring = ring + SECTORS
        a = ring + point
        b = ring + neighbour
        c = next_ring + point
        d = next_ring + neighbour
        faces.append(np.column_stack([a, b, c]))
        faces.append(np.column_stack([b, d, c]))
    # A fan around the last tip closes the last end.
    last_fan = np.column_stack([last_tip, last_ring + point, last_ring + neighbour])
    faces.append(last_fan)
    return np.concatenate(faces)


def make_grain_mesh(
    axes_mm: Axes,
    mass_g: float,
    density_kg_m3: float,
    taper: float = 0.0,
    wrinkles: int = 0,
    wrinkle_depth_mm: float = 0.0,
    source: object = "berry",
) -> tuple[trimesh.Trimesh, float]:
    """Make a closed mesh of a grain that has given axes, mass and density.

    The blunter the tips of the grain, the larger its volume. How blunt they are is
    described by the shape number (`compute_profile_exponents`), which is found by a
    search for the given mass.

    Parameters
    ----------
    axes_mm : sequence of float
        Full lengths along the three axes, the longest first. They are measured across
        the ridges between the grooves, and where a tapered grain is widest.
    mass_g, density_kg_m3 : float
        Mass and density of the grain.
    taper : float
        Fraction by which the width increases from the middle towards one end.
    wrinkles : int
        Number of grooves along the grain.
    wrinkle_depth_mm : float
        Depth of the grooves where the grain is widest.
    source : object
        Where the numbers come from, for messages.

    Returns
    -------
    mesh : Trimesh
        The mesh in mm. Its long axis lies along x.
    shape : float
        The shape number of the mesh.

    Raises
    ------
    InputError
        If an argument is out of range, or if no grain with these axes has this mass.
    """
    axes = _check_axes(axes_mm, source)
    check_positive(source, mass_g=mass_g, density_kg_m3=density_kg_m3)
    details = _Details(taper, wrinkles, wrinkle_depth_mm)
    _check_details(details, axes, source)
    volume = mass_g * 1e-3 / density_kg_m3 / MM**3  # mm3

    # The volume grows with the shape number. So the limits of the shape number give the
    # limits of the volume and of the mass.
    lowest_shape, highest_shape = SHAPE_LIMITS
    smallest_volume = _make_mesh(axes, lowest_shape, details).volume
    largest_volume = _make_mesh(axes, highest_shape, details).volume
    if not smallest_volume <= volume <= largest_volume:
        lightest_g = smallest_volume * MM**3 * density_kg_m3 * 1e3
        heaviest_g = largest_volume * MM**3 * density_kg_m3 * 1e3
        box_volume = axes.prod()
        allowed = (
            f"from {format_significant(lightest_g, 3)} to {format_significant(heaviest_g, 3)} for these axes "
            f"and {density_kg_m3:g} kg/m3: a share of "
            f"{smallest_volume / box_volume:.2f} to {largest_volume / box_volume:.2f} of "
            f"the box around them (an ellipsoid 0.52), here {volume / box_volume:.2f}"
        )
        raise InputError(source, "mass_g", mass_g, allowed)

    # Find the shape number that gives the mass. The volume lies between the limits, as
    # has just been checked. Therefore the function changes its sign between them, as
    # `brentq` requires.
    def compute_excess_volume(shape: float) -> float:
        return _make_mesh(axes, shape, details).volume - volume

    shape = brentq(
        compute_excess_volume, lowest_shape, highest_shape, xtol=SHAPE_TOLERANCE
    )
    return _make_mesh(axes, shape, details), shape


def _check_axes(axes_mm: Axes, source: object) -> np.ndarray:
    """Return the axes (3,) as an array.

    Raises InputError unless they are positive and in descending order.
    """
    axes = np.asarray(axes_mm, float)
    is_possible = axes.shape == (3,) and np.isfinite(axes).all()
    if not is_possible or not axes[0] >= axes[1] >= axes[2] > 0:
        allowed = "three lengths in mm, the longest first"
        raise InputError(source, "axes", list(axes_mm), allowed)
    return axes


def _check_details(details: _Details, axes: np.ndarray, source: object) -> None:
    """Check the taper and the grooves of a grain.

    In the names of arguments and keys, grooves are called wrinkles.

    Parameters
    ----------
    details : _Details
        Taper and grooves.
    axes : ndarray
        Full axes (3,) in mm, the longest first, which limit the depth of the grooves.
    source : object
        Where the numbers come from, for messages.

    Raises
    ------
    InputError
        If a value is out of range, or if only one of the number and the depth of the
        grooves is given.
    """
    # The conditions are negated so that NaN is rejected, too.
    if not abs(details.taper) <= LARGEST_TAPER:
        allowed = f"from -{LARGEST_TAPER:g} to {LARGEST_TAPER:g}"
        raise InputError(source, "taper", details.taper, allowed)
    depth = details.wrinkle_depth_mm
    # `LARGEST_GROOVE` is a fraction of half of the shortest axis.
    largest_depth = LARGEST_GROOVE * axes[2] / 2
    if not 0 <= depth <= largest_depth:
        allowed = f"from 0 to {format_significant(largest_depth, 3)}"
        raise InputError(source, "wrinkle_depth_mm", depth, allowed)
    # A grain has either no grooves, with number and depth 0, or a number of grooves
    # between the limits `WRINKLES`, with a depth above 0.
    if not details.wrinkles and not depth:
        return
    fewest, most = WRINKLES
    if not depth or not fewest <= details.wrinkles <= most:
        allowed = f"{fewest} to {most}, together with wrinkle_depth_mm"
        raise InputError(source, "wrinkles", details.wrinkles, allowed)
