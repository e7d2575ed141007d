"""Shapes of bodies: sums of ellipsoids with their mass and moments."""

import math
from dataclasses import dataclass

import numpy as np

from .checks import name_of, positive, vector
from .state import MOST_PARTS


def _semi_axes(value):
    """Half axes (K, 3) of K ellipsoids, or ValueError."""
    try:
        axes = np.atleast_2d(np.array(value, float))
    except (TypeError, ValueError):
        axes = np.zeros((1, 3))
    good = axes.ndim == 2 and axes.shape[1] == 3 and 1 <= len(axes) <= MOST_PARTS
    if not (good and np.all(np.isfinite(axes)) and np.all(axes > 0.0)):
        raise ValueError(f"semi_axes_m is {value!r}; allowed: (1 to {MOST_PARTS}, 3) lengths above 0")
    return axes


@dataclass(frozen=True, eq=False)
class Shape:
    """A convex body whose support function is the sum of those of K ellipsoids with common axes.

    semi_axes_m (K, 3): of the ellipsoids [m], K at most 3; mass_kg; inertia_kg_m2 (3,): principal moments about the
    axes, each at most the sum of the others; material: a name that the simulation knows.
    Raises ValueError naming the value that is out of range.
    """

    semi_axes_m: np.ndarray
    mass_kg: float
    inertia_kg_m2: np.ndarray
    material: str

    def __post_init__(self):
        axes = _semi_axes(self.semi_axes_m)
        positive("mass_kg", self.mass_kg)
        inertia = vector("inertia_kg_m2", self.inertia_kg_m2)
        if not (np.all(inertia > 0.0) and 2.0 * inertia.max() <= (1.0 + 1e-9) * inertia.sum()):
            raise ValueError(
                f"inertia_kg_m2 is {self.inertia_kg_m2!r}; "
                "allowed: three moments above 0, each at most the sum of the others"
            )
        name_of("material", self.material)
        object.__setattr__(self, "semi_axes_m", axes)
        object.__setattr__(self, "inertia_kg_m2", inertia)

    @classmethod
    def ellipsoid(cls, semi_axes_m, density_kg_m3, material):
        """A solid ellipsoid: semi-axes (3,) [m], density [kg/m3]."""
        axes = vector("semi_axes_m", semi_axes_m)
        if not np.all(axes > 0.0):
            raise ValueError(f"semi_axes_m is {semi_axes_m!r}; allowed: three lengths above 0")
        positive("density_kg_m3", density_kg_m3)
        a, b, c = axes.tolist()
        mass = density_kg_m3 * 4.0 / 3.0 * math.pi * a * b * c
        moments = mass / 5.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
        return cls(np.array([[a, b, c]]), mass, moments, material)

    @classmethod
    def sphere(cls, radius_m, density_kg_m3, material):
        """A solid sphere: radius [m], density [kg/m3]."""
        positive("radius_m", radius_m)
        return cls.ellipsoid((radius_m, radius_m, radius_m), density_kg_m3, material)

    def support(self, n):
        """Largest extents (...) [m] along unit vectors n (..., 3) of the body frame."""
        return np.sqrt(np.square(n) @ np.square(self.semi_axes_m).T).sum(axis=-1)

    def support_point(self, n):
        """Points (..., 3) [m] of the surface whose outward normals are the unit vectors n (..., 3)."""
        extents = np.sqrt(np.square(n) @ np.square(self.semi_axes_m).T)
        return n * ((1.0 / extents) @ np.square(self.semi_axes_m))

    @property
    def bounding_radius_m(self):
        """Largest distance of a point from the centre [m]."""
        return float(self.semi_axes_m.max(axis=1).sum())

    @property
    def smallest_radius_m(self):
        """Half the smallest extent [m]: what the time step has to resolve."""
        return float(self.semi_axes_m.sum(axis=0).min())
