"""Describe the shapes of bodies: sums of ellipsoids, or clumps of spheres."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_array, check_name, check_positive
from .kernels.state import MOST_PARTS, MOST_SPHERES, SPHERES
from .rotations import sphere_directions

N_DIRECTIONS = 2000  # number of directions in which a clump's extent is computed
MOMENT_TOLERANCE = 1e-9  # relative rounding error of moments

# Descriptions of what is allowed, for messages
MOMENTS = "three moments above 0, each at most the sum of the others"
SEMI_AXES = f"(1 to {MOST_PARTS}, 3) lengths above 0"
SPHERE_ROWS = f"(1 to {MOST_SPHERES}, 4) finite lengths, the last of each row above 0"


def _are_valid_moments(inertia: np.ndarray) -> bool:
    """Return whether a body can have these principal moments of inertia (3,).

    Each moment must be above 0 and at most the sum of the others.
    """
    # The largest moment is at most the sum of the others if twice the largest moment is
    # at most the sum of all three.
    is_possible = 2.0 * inertia.max() <= (1.0 + MOMENT_TOLERANCE) * inertia.sum()
    return bool(np.all(inertia > 0.0) and is_possible)


def _are_valid_semi_axes(axes: np.ndarray) -> bool:
    """Return whether an array (K, 3) can hold the half axes of a body's ellipsoids."""
    return 1 <= len(axes) <= MOST_PARTS and bool(np.all(axes > 0.0))


def _are_valid_spheres(spheres: np.ndarray) -> bool:
    """Return whether an array (M, 4) can hold centres and radii of a body's spheres."""
    return 1 <= len(spheres) <= MOST_SPHERES and bool(np.all(spheres[:, 3] > 0.0))


class _Solid:
    """The mass, moments of inertia and material that both kinds of shape have."""

    mass_kg: float
    inertia_kg_m2: np.ndarray
    material: str

    def _check_solid(self) -> None:
        """Check mass, moments and material, and replace the moments by an array."""
        check_positive("mass_kg", self.mass_kg)
        moments = check_array(
            "inertia_kg_m2", self.inertia_kg_m2, (3,), MOMENTS, _are_valid_moments
        )
        object.__setattr__(self, "inertia_kg_m2", moments)
        check_name("material", self.material)


@dataclass(frozen=True, eq=False)
class Shape(_Solid):
    """A convex body: the Minkowski sum of up to three ellipsoids with common axes.

    Parameters
    ----------
    semi_axes_m : array_like (K, 3)
        Half axes of the ellipsoids [m], K at most 3.
    mass_kg : float
        Mass, above 0 [kg].
    inertia_kg_m2 : array_like (3,)
        Principal moments about the axes, each above 0 and at most the sum of the others
        [kg m2].
    material : str
        Name of a material of the simulation.

    Raises
    ------
    ValueError
        If a value is out of range. The message names it.
    """

    semi_axes_m: np.ndarray
    mass_kg: float
    inertia_kg_m2: np.ndarray
    material: str

    def __post_init__(self) -> None:
        axes = check_array(
            "semi_axes_m",
            self.semi_axes_m,
            (None, 3),
            SEMI_AXES,
            _are_valid_semi_axes,
            rows=True,
        )
        object.__setattr__(self, "semi_axes_m", axes)
        self._check_solid()

    @classmethod
    def ellipsoid(
        cls, semi_axes_m: ArrayLike, density_kg_m3: float, material: str
    ) -> "Shape":
        """Make a solid ellipsoid.

        Parameters
        ----------
        semi_axes_m : array_like (3,)
            Half axes, above 0 [m].
        density_kg_m3 : float
            Density, above 0 [kg/m3].
        material : str
            Name of a material of the simulation.

        Returns
        -------
        Shape
            With the mass and moments of the solid.

        Raises
        ------
        ValueError
            If a value is out of range. The message names it.
        """
        axes = check_array(
            "semi_axes_m",
            semi_axes_m,
            shape=(3,),
            allowed="three lengths above 0",
            accepts=lambda axes: np.all(axes > 0.0),
        )
        check_positive("density_kg_m3", density_kg_m3)
        # The mass is 4/3 pi a b c rho. The moment about the axis of a is
        # m (b^2 + c^2) / 5, and so on.
        a, b, c = axes.tolist()
        mass = density_kg_m3 * 4.0 / 3.0 * math.pi * a * b * c
        moments = mass / 5.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
        return cls(np.array([[a, b, c]]), mass, moments, material)

    @classmethod
    def sphere(cls, radius_m: float, density_kg_m3: float, material: str) -> "Shape":
        """Make a solid sphere.

        Parameters
        ----------
        radius_m : float
            Radius, above 0 [m].
        density_kg_m3 : float
            Density, above 0 [kg/m3].
        material : str
            Name of a material of the simulation.

        Returns
        -------
        Shape
            With the mass and moments of the solid.

        Raises
        ------
        ValueError
            If a value is out of range. The message names it.
        """
        check_positive("radius_m", radius_m)
        return cls.ellipsoid((radius_m, radius_m, radius_m), density_kg_m3, material)

    def support(self, n: np.ndarray) -> np.ndarray:
        """Compute the largest extents along unit vectors: the support function.

        Parameters
        ----------
        n : ndarray (..., 3)
            Unit vectors of the body frame.

        Returns
        -------
        ndarray (...)
            The extents [m].
        """
        # The extent of an ellipsoid along n is sqrt(a^2 n_x^2 + b^2 n_y^2 + c^2 n_z^2).
        extents = np.sqrt(np.square(n) @ np.square(self.semi_axes_m).T)
        return extents.sum(axis=-1)

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Find the points of the surface with given outward normals.

        Parameters
        ----------
        n : ndarray (..., 3)
            Unit vectors of the body frame.

        Returns
        -------
        ndarray (..., 3)
            The points [m].
        """
        squares = np.square(self.semi_axes_m)
        extents = np.sqrt(np.square(n) @ squares.T)
        return n * ((1.0 / extents) @ squares)

    @property
    def bounding_radius_m(self) -> float:
        """Largest distance of a point from the centre [m]."""
        return float(self.semi_axes_m.max(axis=1).sum())

    @property
    def is_sphere(self) -> bool:
        """Return whether this is one ellipsoid with equal axes and equal moments."""
        if len(self.semi_axes_m) != 1:
            return False
        has_equal_axes = np.ptp(self.semi_axes_m) == 0.0
        has_equal_moments = np.ptp(self.inertia_kg_m2) == 0.0
        return bool(has_equal_axes and has_equal_moments)

    @property
    def smallest_radius_m(self) -> float:
        """Half the smallest extent [m], on which the longest time step depends."""
        return float(self.semi_axes_m.sum(axis=0).min())

    @property
    def flattest_radius_m(self) -> float:
        """Radius of a sphere that is as flat as the ends of the shortest axis [m].

        A contact with a plate is stiffest at these ends.
        """
        shortest = int(np.argmin(self.half_extents_m))
        # At the end of the half axis c an ellipsoid has the radii of curvature a^2 / c
        # and b^2 / c. Those of a sum of ellipsoids are the sums over the ellipsoids.
        radii = np.square(self.semi_axes_m) / self.semi_axes_m[:, shortest, None]
        principal_radii = np.delete(radii.sum(axis=0), shortest)
        return float(np.sqrt(np.prod(principal_radii)))

    @property
    def half_extents_m(self) -> np.ndarray:
        """Largest extents along the body's axes (3,) [m]."""
        return self.semi_axes_m.sum(axis=0)

    def acting_together(self, _overlap_m: float) -> float:
        """Return the number of contacts with a plate, which is 1 for a convex body."""
        return 1.0

    @property
    def slide(self) -> float:
        """Largest path of the contact point with a plane over a body that rotates.

        It is divided by the largest displacement of a point of the body.
        """
        longest = self.semi_axes_m.max(axis=1)
        shortest = self.semi_axes_m.min(axis=1)
        largest_curvature_radius = float(np.sum(longest**2 / shortest))
        return largest_curvature_radius / self.bounding_radius_m


@dataclass(frozen=True, eq=False)
class Clump(_Solid):
    """A rigid body of M spheres, which may overlap; it need not be convex.

    Parameters
    ----------
    spheres_m : array_like (M, 4)
        Centre x, y, z and radius of each sphere [m], M at most 64. The origin of the
        body's frame is the centre of mass, its axes are the principal ones.
    mass_kg : float
        Mass of the whole body, above 0 [kg].
    inertia_kg_m2 : array_like (3,)
        Principal moments of the whole body, each above 0 and at most the sum of the
        others [kg m2].
    material : str
        Name of a material of the simulation.

    Raises
    ------
    ValueError
        If a value is out of range. The message names it.

    Notes
    -----
    Each sphere that touches something has the full elastic force of a sphere of its
    radius. A body that lies on k spheres is therefore about k times as stiff as a body
    on one sphere. The contacts of two bodies share the damping, so that the restitution
    hardly depends on their number.
    """

    spheres_m: np.ndarray
    mass_kg: float
    inertia_kg_m2: np.ndarray
    material: str

    def __post_init__(self) -> None:
        spheres = check_array(
            "spheres_m", self.spheres_m, (None, 4), SPHERE_ROWS, _are_valid_spheres
        )
        object.__setattr__(self, "spheres_m", spheres)
        self._check_solid()

    def support(self, n: np.ndarray) -> np.ndarray:
        """Compute the largest extents along unit vectors: the support function.

        Parameters
        ----------
        n : ndarray (..., 3)
            Unit vectors of the body frame.

        Returns
        -------
        ndarray (...)
            The extents [m].
        """
        return self._compute_sphere_extents(n).max(axis=-1)

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Find the points of the convex hull that lie farthest along unit vectors.

        Parameters
        ----------
        n : ndarray (..., 3)
            Unit vectors of the body frame.

        Returns
        -------
        ndarray (..., 3)
            The points [m].
        """
        farthest = np.argmax(self._compute_sphere_extents(n), axis=-1)
        return self.spheres_m[farthest, :3] + self.spheres_m[farthest, 3, None] * n

    def _compute_sphere_extents(self, n: np.ndarray) -> np.ndarray:
        """Compute the extent of each sphere (..., M) along unit vectors (..., 3)."""
        return n @ self.spheres_m[:, :3].T + self.spheres_m[:, 3]

    @property
    def bounding_radius_m(self) -> float:
        """Largest distance of a point from the centre of mass [m]."""
        distances = np.linalg.norm(self.spheres_m[:, :3], axis=1)
        return float(np.max(distances + self.spheres_m[:, 3]))

    @property
    def smallest_radius_m(self) -> float:
        """Radius of the smallest sphere [m], on which the longest time step depends."""
        return float(self.spheres_m[:, 3].min())

    @property
    def flattest_radius_m(self) -> float:
        """Radius of the largest sphere [m], whose contact with a plate is stiffest."""
        return float(self.spheres_m[:, 3].max())

    def acting_together(self, overlap_m: float) -> float:
        """Compute how many spheres act together at one place.

        The number is the stiffness of the clump against a plate, divided by that of its
        largest sphere. A plate is pressed against the clump until the foremost sphere
        overlaps by `overlap_m`. The stiffness of a Hertz contact is proportional to
        (R delta)^(1/2).

        Parameters
        ----------
        overlap_m : float
            Overlap of the foremost sphere, above 0 [m].

        Returns
        -------
        float
            The largest number over all sides of the clump. It need not be whole.
        """
        # Overlap of each sphere with a plate on each side, of the shape (directions,
        # spheres)
        extents = self._compute_sphere_extents(sphere_directions(N_DIRECTIONS))
        largest_extents = extents.max(axis=1, keepdims=True)
        overlaps = np.clip(extents - largest_extents + overlap_m, 0.0, None)
        # Stiffness of each sphere over that of the largest sphere at `overlap_m`
        radii = self.spheres_m[:, 3]
        stiffnesses = np.sqrt(overlaps / overlap_m * radii / self.flattest_radius_m)
        return float(stiffnesses.sum(axis=1).max())

    @property
    def half_extents_m(self) -> np.ndarray:
        """Largest extents along the body's axes, in either direction (3,) [m]."""
        return np.max(np.abs(self.spheres_m[:, :3]) + self.spheres_m[:, 3:], axis=0)

    @property
    def slide(self) -> float:
        """Relative path of the contact point (see `Shape.slide`), which is 0 here."""
        return 0.0


def are_clumps(shapes: Mapping[str, Shape | Clump]) -> bool:
    """Return whether shapes are clumps instead of smooth bodies.

    Parameters
    ----------
    shapes : mapping
        The shapes of a simulation by name.

    Raises
    ------
    ValueError
        If there is no shape, or if only some of them are clumps.
    """
    if not shapes:
        raise ValueError(
            "shapes is empty; expected names, each with a Shape or Clump, at least one"
        )
    is_clump = [isinstance(shape, Clump) for shape in shapes.values()]
    if any(is_clump) and not all(is_clump):
        kinds = [f"{name!r}: {type(shape).__name__}" for name, shape in shapes.items()]
        raise ValueError(
            f"shapes has {', '.join(kinds)}; expected only Shapes or "
            "only Clumps (a sphere is a clump of one sphere)"
        )
    return all(is_clump)


def count_most_spheres(shapes: Iterable[Shape | Clump]) -> int:
    """Return the number of spheres in the largest clump; 0 for smooth bodies."""
    counts = [len(shape.spheres_m) for shape in shapes if isinstance(shape, Clump)]
    return max(counts, default=0)


def count_ellipsoids(shapes: Iterable[Shape | Clump]) -> int:
    """Find the largest number of ellipsoids of a smooth body.

    Parameters
    ----------
    shapes : iterable
        The shapes of a simulation.

    Returns
    -------
    int
        The number; 0 for clumps, and `state.SPHERES` if all bodies are spheres.
    """
    smooth = [shape for shape in shapes if isinstance(shape, Shape)]
    if smooth and all(shape.is_sphere for shape in smooth):
        return SPHERES
    return max((len(shape.semi_axes_m) for shape in smooth), default=0)
