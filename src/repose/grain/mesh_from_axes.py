"""A grain without a scan: a closed mesh from three axes and a mass.

The cross-section is an ellipse whose size follows a profile r(t) = (1 - |t|^m)^k along the axis, t from -1 to 1. With
m = 2, k = 1/2 that is an ellipsoid. A fuller body has m > 2, k = 1/m (a superellipse: m = 3 is a plump grain, large m a
cylinder), a leaner body m = 2, k > 1/2 (pointed ends). The fullness V / (L W T) = pi/4 B(1/m, 2k + 1) / m then follows
from the mass and the density.
"""

import math
from collections.abc import Sequence

import numpy as np
import trimesh
from scipy.optimize import brentq

from repose.common.errors import InputError, require
from repose.grain.particle import MM, check_positive

# Shape numbers from the leanest to the fullest convex body: see `profile_exponents`.
SHAPE_LIMITS = (1.0, 30.0)
LARGEST_TAPER, LARGEST_GROOVE = 0.5, 0.15
WRINKLES = (3, 40)
RINGS, SECTORS = 64, 96


def profile_exponents(shape: float) -> tuple[float, float]:
    """Return (m, k) of the profile (1 - abs(t)^m)^k; the shape is 2 for the ellipsoid, m above it, 1/k below it."""
    return (shape, 1 / shape) if shape >= 2 else (2.0, 1 / shape)


def _profile(shape: float, taper: float) -> tuple[np.ndarray, np.ndarray]:
    """Place cross-sections evenly along the outline: places t and radii r (RINGS + 1,), the largest radius 1."""
    m, k = profile_exponents(shape)
    t = np.cos(np.linspace(0, math.pi / 2, 4000)) ** (2 / m)
    r = np.clip(1 - t**m, 0, None) ** k
    t, r = np.concatenate([-t, t[-2::-1]]), np.concatenate([r, r[-2::-1]])
    r = r * (1 + taper * t)
    r /= r.max()
    length = np.concatenate([[0], np.cumsum(np.hypot(np.diff(t), np.diff(r)))])
    even = np.linspace(0, length[-1], RINGS + 1)
    return np.interp(even, length, t), np.interp(even, length, r)


def _mesh(
    axes_mm: Sequence[float] | np.ndarray,
    shape: float,
    taper: float,
    wrinkles: int,
    depth_mm: float,
) -> trimesh.Trimesh:
    """Make the closed mesh (mm), x along the long axis."""
    t, r = _profile(shape, taper)
    turn = np.arange(SECTORS) * (2 * math.pi / SECTORS)
    half = np.asarray(axes_mm, float) / 2
    groove = 1 - depth_mm / half[2] * (1 - np.cos(wrinkles * turn)) / 2
    section = (
        np.column_stack([half[1] * np.cos(turn), half[2] * np.sin(turn)])
        * groove[:, None]
    )
    inner = zip(half[0] * t[1:-1], r[1:-1], strict=True)
    rings = [
        np.column_stack([np.full(SECTORS, place), size * section])
        for place, size in inner
    ]
    points = np.concatenate([*rings, [[-half[0], 0, 0], [half[0], 0, 0]]])
    here, after = np.arange(SECTORS), (np.arange(SECTORS) + 1) % SECTORS
    last = (len(rings) - 1) * SECTORS
    faces = [np.column_stack([np.full(SECTORS, len(points) - 2), after, here])]
    for first in range(0, last, SECTORS):
        a, b, c, d = (
            first + here,
            first + after,
            first + SECTORS + here,
            first + SECTORS + after,
        )
        faces += [np.column_stack([a, b, c]), np.column_stack([b, d, c])]
    faces.append(
        np.column_stack([np.full(SECTORS, len(points) - 1), last + here, last + after])
    )
    return trimesh.Trimesh(points, np.concatenate(faces), process=False)


def berry_mesh(
    axes_mm: Sequence[float] | np.ndarray,
    mass_g: float,
    density_kg_m3: float,
    taper: float = 0.0,
    wrinkles: int = 0,
    wrinkle_depth_mm: float = 0.0,
    source: object = "berry",
) -> tuple[trimesh.Trimesh, float]:
    """Make a closed mesh [mm] with given axes, mass and density, and its shape number (`profile_exponents`).

    `axes_mm` are full axes, the longest first: over the ridges of grooves, and the largest widths of a taper. `taper`
    is the excess width at an end over the mean width, `wrinkle_depth_mm` the depth of the grooves at the belly.
    """
    axes = np.asarray(axes_mm, float)
    if not (
        axes.shape == (3,)
        and np.isfinite(axes).all()
        and axes[0] >= axes[1] >= axes[2] > 0
    ):
        raise InputError(
            source, "axes", list(axes_mm), "three lengths in mm, the longest first"
        )
    check_positive(source, mass_g=mass_g, density_kg_m3=density_kg_m3)
    require(
        abs(taper) <= LARGEST_TAPER,
        source,
        "taper",
        taper,
        f"from -{LARGEST_TAPER:g} to {LARGEST_TAPER:g}",
    )
    deepest = LARGEST_GROOVE * axes[2] / 2
    require(
        0 <= wrinkle_depth_mm <= deepest,
        source,
        "wrinkle_depth_mm",
        wrinkle_depth_mm,
        f"from 0 to {deepest:.3g}",
    )
    allowed = "{} to {}, together with wrinkle_depth_mm".format(*WRINKLES)
    good = not (wrinkles or wrinkle_depth_mm) or (
        WRINKLES[0] <= wrinkles <= WRINKLES[1] and wrinkle_depth_mm
    )
    require(good, source, "wrinkles", wrinkles, allowed)
    details = (taper, wrinkles, wrinkle_depth_mm)
    volume = mass_g * 1e-3 / density_kg_m3 / MM**3
    low, high = (_mesh(axes, shape, *details).volume for shape in SHAPE_LIMITS)
    if not low <= volume <= high:
        masses = [
            volume_mm3 * MM**3 * density_kg_m3 * 1e3 for volume_mm3 in (low, high)
        ]
        full = [value / axes.prod() for value in (low, high, volume)]
        allowed = (
            f"from {masses[0]:.3g} to {masses[1]:.3g} for these axes and {density_kg_m3:g} kg/m3: a share of "
            f"{full[0]:.2f} to {full[1]:.2f} of the box around them (an ellipsoid 0.52), here {full[2]:.2f}"
        )
        raise InputError(source, "mass_g", mass_g, allowed)
    shape = brentq(
        lambda s: _mesh(axes, s, *details).volume - volume, *SHAPE_LIMITS, xtol=1e-12
    )
    return _mesh(axes, shape, *details), shape
