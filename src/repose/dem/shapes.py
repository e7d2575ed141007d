"""Shapes of bodies: sums of ellipsoids with their mass and moments."""

import math
from dataclasses import dataclass

import numpy as np

from .state import MOST_PARTS


@dataclass(frozen=True, eq=False)
class Shape:
    """A convex body whose support function is the sum of those of K ellipsoids with common axes.

    semi_axes_m (K, 3): of the ellipsoids [m], K at most 3; mass_kg; inertia_kg_m2 (3,): principal moments about the
    axes; material: a name that the simulation knows. Raises ValueError naming the value that is out of range.
    """

    semi_axes_m: np.ndarray
    mass_kg: float
    inertia_kg_m2: np.ndarray
    material: str

    def __post_init__(self):
        axes = np.atleast_2d(np.asarray(self.semi_axes_m, float))
        if axes.ndim != 2 or axes.shape[1] != 3 or not 1 <= len(axes) <= MOST_PARTS or not np.all(axes > 0.0):
            raise ValueError(
                f"semi_axes_m is {self.semi_axes_m!r}; allowed: (1 to {MOST_PARTS}, 3) lengths above 0"
            )
        if not (math.isfinite(self.mass_kg) and self.mass_kg > 0.0):
            raise ValueError(f"mass_kg is {self.mass_kg!r}; allowed: above 0")
        inertia = np.asarray(self.inertia_kg_m2, float)
        if inertia.shape != (3,) or not np.all(inertia > 0.0):
            raise ValueError(f"inertia_kg_m2 is {self.inertia_kg_m2!r}; allowed: three moments above 0")
        object.__setattr__(self, "semi_axes_m", axes)
        object.__setattr__(self, "inertia_kg_m2", inertia)

    @classmethod
    def ellipsoid(cls, semi_axes_m, density_kg_m3, material):
        """A solid ellipsoid: semi-axes (3,) [m], density [kg/m3]."""
        a, b, c = (float(axis) for axis in semi_axes_m)
        if not density_kg_m3 > 0.0:
            raise ValueError(f"density_kg_m3 is {density_kg_m3!r}; allowed: above 0")
        mass = density_kg_m3 * 4.0 / 3.0 * math.pi * a * b * c
        moments = mass / 5.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
        return cls(np.array([[a, b, c]]), mass, moments, material)

    @classmethod
    def sphere(cls, radius_m, density_kg_m3, material):
        """A solid sphere: radius [m], density [kg/m3]."""
        return cls.ellipsoid((radius_m, radius_m, radius_m), density_kg_m3, material)

    @property
    def bounding_radius_m(self):
        """Largest distance of a point from the centre [m]."""
        return float(self.semi_axes_m.max(axis=1).sum())

    @property
    def smallest_radius_m(self):
        """Half the smallest extent [m]: what the time step has to resolve."""
        return float(self.semi_axes_m.sum(axis=0).min())
