"""Shapes of bodies, sums of ellipsoids or clumps of spheres, with their mass and moments."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .checks import array, name_of, positive
from .kernels.state import MOST_PARTS, MOST_SPHERES, SPHERES
from .rotations import sphere_directions

DIRECTIONS = 2000  # in which a clump's extent is calculated


MOMENTS = "three moments above 0, each at most the sum of the others"
SEMI_AXES = f"(1 to {MOST_PARTS}, 3) lengths above 0"
SPHERE_ROWS = f"(1 to {MOST_SPHERES}, 4) finite lengths, the last of each row above 0"


def _are_moments(inertia: np.ndarray) -> bool:
    """Whether a body can have these principal moments (3,)."""
    return bool(
        np.all(inertia > 0.0) and 2.0 * inertia.max() <= (1.0 + 1e-9) * inertia.sum()
    )


def _are_axes(axes: np.ndarray) -> bool:
    """Whether these are half axes (K, 3) of as many ellipsoids as a body may have."""
    return 1 <= len(axes) <= MOST_PARTS and bool(np.all(axes > 0.0))


def _are_spheres(spheres: np.ndarray) -> bool:
    """Whether these are centres and radii (M, 4) of as many spheres as a body may have."""
    return 1 <= len(spheres) <= MOST_SPHERES and bool(np.all(spheres[:, 3] > 0.0))


class _Solid:
    """The mass and material of a shape, checked."""

    mass_kg: float
    inertia_kg_m2: np.ndarray
    material: str

    def _check(self, **arrays: np.ndarray) -> None:
        """Check mass, moments and material; keep moments and further arrays as they were checked."""
        positive("mass_kg", self.mass_kg)
        arrays["inertia_kg_m2"] = array(
            "inertia_kg_m2", self.inertia_kg_m2, (3,), MOMENTS, _are_moments
        )
        name_of("material", self.material)
        for name, values in arrays.items():
            object.__setattr__(self, name, values)


@dataclass(frozen=True, eq=False)
class Shape(_Solid):
    """A convex body whose support function is the sum of those of K ellipsoids with common axes.

    Parameters
    ----------
    semi_axes_m : array_like (K, 3)
        Half axes of the ellipsoids [m], K at most 3.
    mass_kg : float
        Mass, above 0 [kg].
    inertia_kg_m2 : array_like (3,)
        Principal moments about the axes, each above 0 and at most the sum of the others [kg m2].
    material : str
        A name that the simulation knows.

    Raises
    ------
    ValueError
        Naming the value that is out of range.
    """

    semi_axes_m: np.ndarray
    mass_kg: float
    inertia_kg_m2: np.ndarray
    material: str

    def __post_init__(self) -> None:
        self._check(
            semi_axes_m=array(
                "semi_axes_m",
                self.semi_axes_m,
                (None, 3),
                SEMI_AXES,
                _are_axes,
                rows=True,
            )
        )

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
            A name that the simulation knows.

        Returns
        -------
        Shape
            With the mass and moments of the solid.

        Raises
        ------
        ValueError
            Naming the value that is out of range.
        """
        axes = array(
            "semi_axes_m",
            semi_axes_m,
            (3,),
            "three lengths above 0",
            lambda axes: np.all(axes > 0.0),
        )
        positive("density_kg_m3", density_kg_m3)
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
            A name that the simulation knows.

        Returns
        -------
        Shape
            With the mass and moments of the solid.

        Raises
        ------
        ValueError
            Naming the value that is out of range.
        """
        positive("radius_m", radius_m)
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
        return np.sqrt(np.square(n) @ np.square(self.semi_axes_m).T).sum(axis=-1)

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
        return n * (
            (1.0 / np.sqrt(np.square(n) @ np.square(self.semi_axes_m).T))
            @ np.square(self.semi_axes_m)
        )

    @property
    def bounding_radius_m(self) -> float:
        """Largest distance of a point from the centre [m]."""
        return float(self.semi_axes_m.max(axis=1).sum())

    @property
    def is_sphere(self) -> bool:
        """Whether it is one ellipsoid with equal axes and equal moments."""
        axes, moments = self.semi_axes_m, self.inertia_kg_m2
        return bool(len(axes) == 1 and np.ptp(axes) == 0.0 and np.ptp(moments) == 0.0)

    @property
    def smallest_radius_m(self) -> float:
        """Half the smallest extent [m]: what the time step has to resolve."""
        return float(self.semi_axes_m.sum(axis=0).min())

    @property
    def flattest_radius_m(self) -> float:
        """Radius of a sphere as flat as the ends of the shortest axis: there a plate meets the stiffest contact [m]."""
        shortest = int(np.argmin(self.half_extents_m))
        curvatures = np.square(self.semi_axes_m) / self.semi_axes_m[:, shortest, None]
        return float(np.sqrt(np.prod(np.delete(curvatures.sum(axis=0), shortest))))

    @property
    def half_extents_m(self) -> np.ndarray:
        """Largest extents along the body's axes (3,) [m]."""
        return self.semi_axes_m.sum(axis=0)

    def acting_together(self, _overlap_m: float) -> float:
        """Count the contacts with a plate: a convex body has one.

        Returns
        -------
        float
        """
        return 1.0

    @property
    def slide(self) -> float:
        """How far the point that touches a plane may slide over the body as it turns, over its displacement."""
        axes = self.semi_axes_m
        return (
            float(np.sum(axes.max(axis=1) ** 2 / axes.min(axis=1)))
            / self.bounding_radius_m
        )


@dataclass(frozen=True, eq=False)
class Clump(_Solid):
    """A rigid body of M spheres, which may overlap; it need not be convex.

    Parameters
    ----------
    spheres_m : array_like (M, 4)
        Centre x, y, z and radius of each sphere [m], M at most 64. The origin of the body's frame is the centre of
        mass, its axes are the principal ones.
    mass_kg : float
        Mass of the whole body, above 0 [kg].
    inertia_kg_m2 : array_like (3,)
        Principal moments of the whole body, each above 0 and at most the sum of the others [kg m2].
    material : str
        A name that the simulation knows.

    Raises
    ------
    ValueError
        Naming the value that is out of range.

    Notes
    -----
    Each sphere that touches something has the whole elastic force of a sphere of its radius: a body that lies on k
    spheres is about k times as stiff as on one. The contacts of two bodies share the damping, so that the restitution
    of a hit stays about what it is.
    """

    spheres_m: np.ndarray
    mass_kg: float
    inertia_kg_m2: np.ndarray
    material: str

    def __post_init__(self) -> None:
        self._check(
            spheres_m=array(
                "spheres_m", self.spheres_m, (None, 4), SPHERE_ROWS, _are_spheres
            )
        )

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
        return (n @ self.spheres_m[:, :3].T + self.spheres_m[:, 3]).max(axis=-1)

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Find the points of the convex hull's surface that lie farthest along unit vectors.

        Parameters
        ----------
        n : ndarray (..., 3)
            Unit vectors of the body frame.

        Returns
        -------
        ndarray (..., 3)
            The points [m].
        """
        farthest = np.argmax(
            n @ self.spheres_m[:, :3].T + self.spheres_m[:, 3], axis=-1
        )
        return self.spheres_m[farthest, :3] + self.spheres_m[farthest, 3, None] * n

    @property
    def bounding_radius_m(self) -> float:
        """Largest distance of a point from the centre of mass [m]."""
        return float(
            np.max(np.linalg.norm(self.spheres_m[:, :3], axis=1) + self.spheres_m[:, 3])
        )

    @property
    def smallest_radius_m(self) -> float:
        """Radius of the smallest sphere [m]: what the time step has to resolve."""
        return float(self.spheres_m[:, 3].min())

    @property
    def flattest_radius_m(self) -> float:
        """Radius of the largest sphere: with it a plate has the stiffest contact [m]."""
        return float(self.spheres_m[:, 3].max())

    def acting_together(self, overlap_m: float) -> float:
        """Count the spheres that act at one place: the stiffness with a plate, over that of the largest sphere.

        The plate is pressed against the clump from every side until the foremost sphere overlaps by `overlap_m`. A
        Hertz contact's stiffness goes with (R delta)^(1/2).

        Parameters
        ----------
        overlap_m : float
            Above 0 [m].

        Returns
        -------
        float
            The largest over all sides.
        """
        extents = (
            sphere_directions(DIRECTIONS) @ self.spheres_m[:, :3].T
            + self.spheres_m[:, 3]
        )
        deep = np.clip(
            extents - extents.max(axis=1, keepdims=True) + overlap_m, 0.0, None
        )
        return float(
            np.sqrt(deep / overlap_m * self.spheres_m[:, 3] / self.flattest_radius_m)
            .sum(axis=1)
            .max()
        )

    @property
    def half_extents_m(self) -> np.ndarray:
        """Largest extents along the body's axes, to either side (3,) [m]."""
        return np.max(np.abs(self.spheres_m[:, :3]) + self.spheres_m[:, 3:], axis=0)

    @property
    def slide(self) -> float:
        """How far a sphere's point that touches a plane may slide over it as the sphere's centre moves: nothing."""
        return 0.0


def are_clumps(shapes: Mapping[str, Shape | Clump]) -> bool:
    """Whether shapes are all clumps; ValueError if they are a mixture, or there is none."""
    if not shapes:
        raise ValueError(
            "shapes is empty; expected names, each with a Shape or Clump, at least one"
        )
    of_clumps = isinstance(next(iter(shapes.values())), Clump)
    if any(isinstance(shape, Clump) != of_clumps for shape in shapes.values()):
        raise ValueError(
            f"shapes has {', '.join(f'{k!r}: {type(v).__name__}' for k, v in shapes.items())}; "
            "expected all of them a Shape or all of them a Clump (a sphere is a clump of one)"
        )
    return of_clumps


def most_spheres(shapes: Iterable[Shape | Clump]) -> int:
    """Count the spheres of the largest clump; 0 for smooth bodies."""
    return max(
        len(shape.spheres_m) if isinstance(shape, Clump) else 0 for shape in shapes
    )


def parts_of(shapes: Iterable[Shape | Clump]) -> int:
    """Count the ellipsoids of a smooth body at most; 0 for clumps, `state.SPHERES` where all bodies are spheres."""
    smooth = [shape for shape in shapes if isinstance(shape, Shape)]
    if smooth and all(shape.is_sphere for shape in smooth):
        return SPHERES
    return max((len(shape.semi_axes_m) for shape in smooth), default=0)
