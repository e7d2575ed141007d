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


def _profile(shape: float, taper: float) -> tuple[np.ndarray, np.ndarray]:
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
    tuple
        Places t from -1 to 1 and radii r of the cross-sections, each (RINGS + 1,). The
        largest radius is 1.
    """
    m, k = profile_exponents(shape)
    # One half of the outline, dense at the end, and its mirror image
    half_t = np.cos(np.linspace(0, math.pi / 2, 4000)) ** (2 / m)
    half_r = np.clip(1 - half_t**m, 0, None) ** k
    t = np.concatenate([-half_t, half_t[-2::-1]])
    symmetric_r = np.concatenate([half_r, half_r[-2::-1]])
    r = symmetric_r * (1 + taper * t)
    r /= r.max()

    # Cut the outline into pieces of the same length.
    steps = np.hypot(np.diff(t), np.diff(r))
    length = np.concatenate([[0], np.cumsum(steps)])
    even_length = np.linspace(0, length[-1], RINGS + 1)
    return np.interp(even_length, length, t), np.interp(even_length, length, r)


def _mesh(axes_mm: Axes, shape: float, details: _Details) -> trimesh.Trimesh:
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
    places, sizes = _profile(shape, details.taper)
    angles = np.arange(SECTORS) * (2 * math.pi / SECTORS)
    half_length, half_width, half_height = np.asarray(axes_mm, float) / 2

    # The largest cross-section (SECTORS, 2): an ellipse with grooves
    depth = details.wrinkle_depth_mm / half_height
    groove = 1 - depth * (1 - np.cos(details.wrinkles * angles)) / 2
    y = half_width * np.cos(angles)
    z = half_height * np.sin(angles)
    section = np.column_stack([y, z]) * groove[:, None]

    # The first and the last cross-section are the tips.
    rings = []
    for x, size in zip(half_length * places[1:-1], sizes[1:-1], strict=True):
        rings.append(np.column_stack([np.full(SECTORS, x), size * section]))
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
    sector = np.arange(SECTORS)
    next_sector = (sector + 1) % SECTORS
    last_ring = (n_rings - 1) * SECTORS
    first_tip = np.full(SECTORS, n_points - 2)
    last_tip = np.full(SECTORS, n_points - 1)
    # A fan of triangles around the tip closes the first end.
    faces = [np.column_stack([first_tip, next_sector, sector])]
    # Between two rings there are quadrilaterals a b d c, each of two triangles.
    for ring in range(0, last_ring, SECTORS):
        next_ring = ring + SECTORS
        a = ring + sector
        b = ring + next_sector
        c = next_ring + sector
        d = next_ring + next_sector
        faces.append(np.column_stack([a, b, c]))
        faces.append(np.column_stack([b, d, c]))
    # Another fan closes the last end.
    fan = np.column_stack([last_tip, last_ring + sector, last_ring + next_sector])
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
    tuple
        The mesh in mm and its shape number (`profile_exponents`).

    Raises
    ------
    InputError
        If there is no such grain.
    """
    axes = _check_axes(axes_mm, source)
    check_positive(source, mass_g=mass_g, density_kg_m3=density_kg_m3)
    details = _Details(taper, wrinkles, wrinkle_depth_mm)
    _check_details(details, axes, source)
    volume = mass_g * 1e-3 / density_kg_m3 / MM**3

    # Only volumes between those of the leanest and the fullest body are possible.
    leanest, fullest = SHAPE_LIMITS
    smallest = _mesh(axes, leanest, details).volume
    largest = _mesh(axes, fullest, details).volume
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
        return _mesh(axes, shape, details).volume - volume

    shape = brentq(excess_volume, leanest, fullest, xtol=1e-12)
    return _mesh(axes, shape, details), shape


def _check_axes(axes_mm: Axes, source: object) -> np.ndarray:
    """Return axes (3,) that descend and are positive, or raise InputError."""
    axes = np.asarray(axes_mm, float)
    is_possible = axes.shape == (3,) and np.isfinite(axes).all()
    if not is_possible or not axes[0] >= axes[1] >= axes[2] > 0:
        allowed = "three lengths in mm, the longest first"
        raise InputError(source, "axes", list(axes_mm), allowed)
    return axes


def _check_details(details: _Details, axes: np.ndarray, source: object) -> None:
    """Raise InputError for an impossible taper or impossible grooves.

    Parameters
    ----------
    details : _Details
        Taper and grooves.
    axes : ndarray
        Full axes (3,) in mm, the longest first, which limit the depth of the grooves.
    source : object
        Where the numbers come from, for messages.
    """
    if not abs(details.taper) <= LARGEST_TAPER:
        allowed = f"from -{LARGEST_TAPER:g} to {LARGEST_TAPER:g}"
        raise InputError(source, "taper", details.taper, allowed)
    depth = details.wrinkle_depth_mm
    deepest = LARGEST_GROOVE * axes[2] / 2
    if not 0 <= depth <= deepest:
        allowed = f"from 0 to {deepest:.3g}"
        raise InputError(source, "wrinkle_depth_mm", depth, allowed)
    # Number and depth of the grooves belong together.
    if not details.wrinkles and not depth:
        return
    fewest, most = WRINKLES
    if not depth or not fewest <= details.wrinkles <= most:
        allowed = f"{fewest} to {most}, together with wrinkle_depth_mm"
        raise InputError(source, "wrinkles", details.wrinkles, allowed)
