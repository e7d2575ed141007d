"""Make a closed mesh for a grain without a scan, from three axes and a mass."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.optimize import brentq

from repose.common.errors import InputError
from repose.grain.particle import MM, check_positive

# Shape numbers of the leanest and the fullest convex body (`profile_exponents`)
SHAPE_LIMITS = (1.0, 30.0)
LARGEST_TAPER = 0.5
LARGEST_GROOVE = 0.15  # depth over the smallest radius
WRINKLES = (3, 40)
RINGS = 64
SECTORS = 96

Axes = Sequence[float] | np.ndarray


@dataclass(frozen=True)
class _Details:
    """What a grain has besides axes and fullness."""

    taper: float  # excess width at an end over the mean width
    wrinkles: int  # number of grooves along the grain
    wrinkle_depth_mm: float  # at the belly


def profile_exponents(shape: float) -> tuple[float, float]:
    """Compute the exponents m and k of the profile (1 - abs(t)^m)^k.

    The shape number is 2 for an ellipsoid, m for a fuller body, and 1 / k for a leaner
    one.
    """
    if shape >= 2:
        return shape, 1 / shape
    return 2.0, 1 / shape


def _place_sections(shape: float, taper: float) -> tuple[np.ndarray, np.ndarray]:
    """Place the cross-sections of a grain evenly along its outline.

    The outline is the profile r(t) = (1 - |t|^m)^k, tilted by the taper.

    Parameters
    ----------
    shape : float
        Shape number, see `profile_exponents`.
    taper : float
        Excess width at the end t = 1 over the mean width.

    Returns
    -------
    places : ndarray
        Places t of the cross-sections along the grain, from -1 to 1 (RINGS + 1,).
    radii : ndarray
        Their radii r (RINGS + 1,), of which the largest is 1.
    """
    m, k = profile_exponents(shape)
    # One half of the outline goes from the end to the middle, with most points near the
    # end. The other half is its mirror image, without the middle.
    half_t = np.cos(np.linspace(0, math.pi / 2, 4000)) ** (2 / m)
    half_r = np.clip(1 - half_t**m, 0, None) ** k
    t = np.concatenate([-half_t, half_t[-2::-1]])
    symmetric_r = np.concatenate([half_r, half_r[-2::-1]])
    r = symmetric_r * (1 + taper * t)
    r /= r.max()

    # Cut the outline into pieces of the same length.
    steps = np.hypot(np.diff(t), np.diff(r))
    lengths = np.concatenate([[0], np.cumsum(steps)])  # from the first end
    section_lengths = np.linspace(0, lengths[-1], RINGS + 1)
    places = np.interp(section_lengths, lengths, t)
    radii = np.interp(section_lengths, lengths, r)
    return places, radii


def _make_mesh(axes_mm: Axes, shape: float, details: _Details) -> trimesh.Trimesh:
    """Make the closed mesh of a grain, its long axis along x.

    It has rings of points around the long axis, and a point at each tip.

    Parameters
    ----------
    axes_mm : sequence of float
        Full axes, the longest first.
    shape : float
        Shape number, see `profile_exponents`: the larger, the fuller is the grain.
    details : _Details
        Taper and grooves.

    Returns
    -------
    Trimesh
        The mesh in mm.
    """
    places, scales = _place_sections(shape, details.taper)
    angles = np.arange(SECTORS) * (2 * math.pi / SECTORS)
    half_length, half_width, half_height = np.asarray(axes_mm, float) / 2

    # The largest cross-section (SECTORS, 2) is an ellipse with grooves. A groove makes
    # it smaller by a cosine wave.
    depth = details.wrinkle_depth_mm / half_height
    groove_factors = 1 - depth * (1 - np.cos(details.wrinkles * angles)) / 2
    y = half_width * np.cos(angles)
    z = half_height * np.sin(angles)
    largest_section = np.column_stack([y, z]) * groove_factors[:, None]

    # All other cross-sections are smaller copies. The first and the last are the tips.
    rings = []
    for x, scale in zip(half_length * places[1:-1], scales[1:-1], strict=True):
        rings.append(np.column_stack([np.full(SECTORS, x), scale * largest_section]))
    tips = [[-half_length, 0, 0], [half_length, 0, 0]]
    points = np.concatenate([*rings, tips])
    return trimesh.Trimesh(points, _list_faces(len(rings)), process=False)


def _list_faces(n_rings: int) -> np.ndarray:
    """List the triangles of a mesh of rings of points and two tips.

    The points are numbered ring by ring, and the tips come last.

    Parameters
    ----------
    n_rings : int
        Number of rings, of `SECTORS` points each.

    Returns
    -------
    ndarray of int
        Numbers (T, 3) of the three corners of each triangle, which go around it
        counter-clockwise seen from outside.
    """
    n_points = n_rings * SECTORS + 2
    # Numbers of the points of the first ring, and of their neighbours in the ring
    point = np.arange(SECTORS)
    neighbour = (point + 1) % SECTORS
    last_ring = (n_rings - 1) * SECTORS  # its first number
    first_tip = np.full(SECTORS, n_points - 2)
    last_tip = np.full(SECTORS, n_points - 1)
    # A fan of triangles around the tip closes the first end.
    faces = [np.column_stack([first_tip, neighbour, point])]
    # Between two rings there are quadrilaterals a b d c, each of two triangles.
    for ring in range(0, last_ring, SECTORS):
        next_ring = ring + SECTORS
        a = ring + point
        b = ring + neighbour
        c = next_ring + point
        d = next_ring + neighbour
        faces.append(np.column_stack([a, b, c]))
        faces.append(np.column_stack([b, d, c]))
    # Another fan closes the last end.
    fan = np.column_stack([last_tip, last_ring + point, last_ring + neighbour])
    faces.append(fan)
    return np.concatenate(faces)


def grain_mesh(
    axes_mm: Axes,
    mass_g: float,
    density_kg_m3: float,
    taper: float = 0.0,
    wrinkles: int = 0,
    wrinkle_depth_mm: float = 0.0,
    source: object = "berry",
) -> tuple[trimesh.Trimesh, float]:
    """Make a closed mesh of a grain with given axes, mass and density.

    Parameters
    ----------
    axes_mm : sequence of float
        Full axes, the longest first: over the ridges between grooves, and the largest
        widths of a taper.
    mass_g, density_kg_m3 : float
        Mass and density.
    taper : float
        Excess width at an end over the mean width.
    wrinkles : int
        Number of grooves along the grain.
    wrinkle_depth_mm : float
        Depth of the grooves at the belly.
    source : object
        Where the numbers come from, for messages.

    Returns
    -------
    mesh : Trimesh
        The mesh in mm, its long axis along x.
    shape : float
        Its shape number (`profile_exponents`).

    Raises
    ------
    InputError
        If there is no such grain.
    """
    axes = _check_axes(axes_mm, source)
    check_positive(source, mass_g=mass_g, density_kg_m3=density_kg_m3)
    details = _Details(taper, wrinkles, wrinkle_depth_mm)
    _check_details(details, axes, source)
    volume = mass_g * 1e-3 / density_kg_m3 / MM**3  # mm3

    # Only volumes between those of the leanest and the fullest body are possible.
    leanest, fullest = SHAPE_LIMITS
    smallest = _make_mesh(axes, leanest, details).volume
    largest = _make_mesh(axes, fullest, details).volume
    if not smallest <= volume <= largest:
        lightest_g = smallest * MM**3 * density_kg_m3 * 1e3
        heaviest_g = largest * MM**3 * density_kg_m3 * 1e3
        box = axes.prod()
        allowed = (
            f"from {lightest_g:.3g} to {heaviest_g:.3g} for these axes and "
            f"{density_kg_m3:g} kg/m3: a share of {smallest / box:.2f} to "
            f"{largest / box:.2f} of the box around them (an ellipsoid 0.52), here "
            f"{volume / box:.2f}"
        )
        raise InputError(source, "mass_g", mass_g, allowed)

    # The volume grows with the shape number; find the one that gives the mass.
    def excess_volume(shape: float) -> float:
        return _make_mesh(axes, shape, details).volume - volume

    shape = brentq(excess_volume, leanest, fullest, xtol=1e-12)
    return _make_mesh(axes, shape, details), shape


def _check_axes(axes_mm: Axes, source: object) -> np.ndarray:
    """Return axes (3,) that descend and are positive, or raise InputError."""
    axes = np.asarray(axes_mm, float)
    is_possible = axes.shape == (3,) and np.isfinite(axes).all()
    if not is_possible or not axes[0] >= axes[1] >= axes[2] > 0:
        allowed = "three lengths in mm, the longest first"
        raise InputError(source, "axes", list(axes_mm), allowed)
    return axes


def _check_details(details: _Details, axes: np.ndarray, source: object) -> None:
    """Check taper and grooves of a grain.

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
        If one of them is impossible, or only one of number and depth of the grooves is
        given.
    """
    if not abs(details.taper) <= LARGEST_TAPER:
        allowed = f"from -{LARGEST_TAPER:g} to {LARGEST_TAPER:g}"
        raise InputError(source, "taper", details.taper, allowed)
    depth = details.wrinkle_depth_mm
    largest_depth = LARGEST_GROOVE * axes[2] / 2
    if not 0 <= depth <= largest_depth:
        allowed = f"from 0 to {largest_depth:.3g}"
        raise InputError(source, "wrinkle_depth_mm", depth, allowed)
    # A grain without grooves has neither number nor depth of them; otherwise both must
    # be given.
    if not details.wrinkles and not depth:
        return
    fewest, most = WRINKLES
    if not depth or not fewest <= details.wrinkles <= most:
        allowed = f"{fewest} to {most}, together with wrinkle_depth_mm"
        raise InputError(source, "wrinkles", details.wrinkles, allowed)
