"""Describe the simulated particle, and write and read its file.

The particle is a convex body with a support function, or a rigid clump of spheres.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from repose import dem
from repose.common.errors import InputError
from repose.common.files import read_json, write_json
from repose.grain import support

MM = 1e-3
KINDS = ("ellipsoid", "smooth", "multisphere")
SURFACES = ("smooth", "rough", "rough_full")  # of a multisphere

# The file of a particle
FILE_DESCRIPTION = "a file of `repose stage shape`"
# Fields of `Particle` that have the same name and unit in the file
UNCHANGED_FIELDS = ("kind", "density_kg_m3", "stl")
# The other fields, with their keys and units in the file
CONVERTED_FIELDS = {
    "semi_axes_m": ("semi_axes_mm", MM),
    "spheres_m": ("spheres_mm", MM),
    "volume_m3": ("volume_mm3", MM**3),
    "mass_kg": ("mass_g", 1e-3),
    "inertia_kg_m2": ("inertia_g_mm2", 1e-9),
    "bounding_radius_m": ("bounding_radius_mm", MM),
    "deviation_max_m": ("deviation_max_mm", MM),
    "deviation_rms_m": ("deviation_rms_mm", MM),
    "mesh_volume_m3": ("mesh_volume_mm3", MM**3),
    "mesh_inertia_kg_m2": ("mesh_inertia_g_mm2", 1e-9),
    "mesh_axes_m": ("mesh_axes_mm", MM),
}
# Shapes of the arrays in the file, by key; each other key holds a single number
ARRAY_SHAPES: dict[str, tuple[int, ...]] = {
    "semi_axes_mm": (-1, 3),
    "spheres_mm": (-1, 4),
    "inertia_g_mm2": (3,),
    "mesh_inertia_g_mm2": (3,),
    "mesh_axes_mm": (3,),
}


@dataclass(frozen=True, eq=False)
class Body:
    """Inertial properties of a closed mesh."""

    volume_m3: float
    mass_kg: float
    inertia_kg_m2: np.ndarray  # (3,), principal moments
    axes_m: np.ndarray  # (3,), full extents along x, y, z


def check_positive(source: object, **numbers: float | None) -> None:
    """Check that numbers are finite and above 0.

    Parameters
    ----------
    source : object
        Where the numbers come from, for messages.
    **numbers : float or None
        The numbers by key. A value of None is accepted.

    Raises
    ------
    InputError
        For the first number that is not finite and positive.
    """
    for key, value in numbers.items():
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(source, key, value, "a positive number")


@dataclass(frozen=True, eq=False)
class Particle:
    """Rigid particle that represents a grain, in the frame of its body.

    The axes of the frame are the principal axes of the particle, of which x has the
    smallest moment of inertia. The origin is the centre of mass. A convex particle is
    the sum of K ellipsoids with common axes: its support function, the extent from the
    centre in a direction, is the sum of theirs. A multisphere is a rigid clump of M
    overlapping spheres. It has the mass and the moments of its mesh, and the volume of
    the union of its spheres.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    semi_axes_m : ndarray
        Half axes (K, 3) of the ellipsoids; K = 1 for an ellipsoid, 0 for a multisphere.
    density_kg_m3, volume_m3, mass_kg : float
        Density, volume and mass of the particle.
    inertia_kg_m2 : ndarray
        Principal moments of inertia (3,).
    bounding_radius_m : float
        Distance of the farthest point from the centre.
    deviation_max_m, deviation_rms_m : float
        Largest and root mean square deviation from the mesh. For a convex particle,
        these are deviations of the support values, and for a multisphere distances
        between the surfaces.
    mesh_volume_m3 : float, optional
        Volume of the mesh; None without a mesh.
    stl : str
        Name of the mesh's file.
    spheres_m : ndarray
        Centre and radius (M, 4) of the spheres of a multisphere.
    mesh_inertia_kg_m2 : ndarray, optional
        Principal moments (3,) of the mesh at the same density; None without a mesh.
    mesh_axes_m : ndarray, optional
        Full extents (3,) of the mesh; None without a mesh.
    """

    kind: str
    semi_axes_m: np.ndarray
    density_kg_m3: float
    volume_m3: float
    mass_kg: float
    inertia_kg_m2: np.ndarray
    bounding_radius_m: float
    deviation_max_m: float
    deviation_rms_m: float
    mesh_volume_m3: float | None = None
    stl: str = ""
    spheres_m: np.ndarray = field(default_factory=partial(np.zeros, (0, 4)))
    mesh_inertia_kg_m2: np.ndarray | None = None
    mesh_axes_m: np.ndarray | None = None

    @property
    def is_clump(self) -> bool:
        """Whether the particle consists of spheres."""
        return len(self.spheres_m) > 0

    @property
    def axes_m(self) -> np.ndarray:
        """Full extents (3,) along the principal axes."""
        return self.support(np.eye(3)) + self.support(-np.eye(3))

    @property
    def mesh(self) -> Body | None:
        """Inertial properties of the mesh; None for a particle without a mesh."""
        if (
            self.mesh_volume_m3 is None
            or self.mesh_inertia_kg_m2 is None
            or self.mesh_axes_m is None
        ):
            return None
        return Body(
            volume_m3=self.mesh_volume_m3,
            mass_kg=self.density_kg_m3 * self.mesh_volume_m3,
            inertia_kg_m2=self.mesh_inertia_kg_m2,
            axes_m=self.mesh_axes_m,
        )

    def support(self, n: np.ndarray) -> np.ndarray:
        """Compute how far the particle extends in each direction [m].

        These extents are called support values. They are measured from the centre of
        mass.

        Parameters
        ----------
        n : ndarray
            Unit vectors (..., 3) along the directions, in the body's frame.

        Returns
        -------
        ndarray
            The values (...).
        """
        n = np.asarray(n, dtype=float)
        if self.is_clump:
            return self._compute_sphere_supports(n).max(axis=-1)
        return support.support(self.semi_axes_m, n)

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Compute the points [m] at which planes touch the particle.

        Parameters
        ----------
        n : ndarray
            Outward unit normals (..., 3) of the planes in the body's frame.

        Returns
        -------
        ndarray
            The points (..., 3).
        """
        n = np.asarray(n, dtype=float)
        if self.is_clump:
            # A plane touches the sphere that reaches farthest along its normal.
            farthest = self._compute_sphere_supports(n).argmax(axis=-1)
            touched_spheres = self.spheres_m[farthest]
            return touched_spheres[..., :3] + touched_spheres[..., 3:] * n
        return support.support_point(self.semi_axes_m, n)

    def _compute_sphere_supports(self, n: np.ndarray) -> np.ndarray:
        """Compute the support values (..., M) of all spheres in directions (..., 3)."""
        return n @ self.spheres_m[:, :3].T + self.spheres_m[:, 3]

    def dem_shape(self, material: str) -> "dem.Shape | dem.Clump":
        """Convert the particle to a shape of the simulation engine.

        Parameters
        ----------
        material : str
            Name of the material of the shape.

        Returns
        -------
        Shape or Clump
            A clump for a multisphere, otherwise a convex shape.
        """
        if self.is_clump:
            return dem.Clump(self.spheres_m, self.mass_kg, self.inertia_kg_m2, material)
        return dem.Shape(self.semi_axes_m, self.mass_kg, self.inertia_kg_m2, material)

    def record(self) -> dict[str, Any]:
        """Convert the particle to the values of its file: lengths in mm, mass in g."""
        record = {name: getattr(self, name) for name in UNCHANGED_FIELDS}
        for name, (key, unit) in CONVERTED_FIELDS.items():
            value = getattr(self, name)
            record[key] = (
                None if value is None else _round_numbers(np.asarray(value) / unit)
            )
        return record

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> "Particle":
        """Make a particle from the values of its file.

        The values must have been checked, as `load` does.

        Parameters
        ----------
        record : mapping
            The values by key, in the units of the file, as `record` returns them.

        Returns
        -------
        Particle
            The particle in SI units.
        """
        fields = {name: record[name] for name in UNCHANGED_FIELDS}
        # `unit` is the factor that converts the unit of the file to the SI unit.
        for name, (key, unit) in CONVERTED_FIELDS.items():
            value = record[key]
            if isinstance(value, list):
                fields[name] = np.array(value, float) * unit
            elif isinstance(value, float | int):
                fields[name] = value * unit
            else:
                fields[name] = value  # None: the particle has no mesh
        # These two fields are never None. An empty list becomes an array without rows.
        fields["semi_axes_m"] = fields["semi_axes_m"].reshape(-1, 3)
        fields["spheres_m"] = fields["spheres_m"].reshape(-1, 4)
        return cls(**fields)

    def save(self, path: str | PathLike) -> None:
        """Write the particle to a JSON file, see `record`."""
        write_json(path, self.record(), indent=2)

    @classmethod
    def load(cls, path: str | PathLike) -> "Particle":
        """Read a particle from a file that `save` wrote.

        Parameters
        ----------
        path : path
            The file.

        Returns
        -------
        Particle
            The particle.

        Raises
        ------
        InputError
            If the file does not describe a particle, or if a number is not finite or
            out of range.
        """
        number_keys = [key for key, _ in CONVERTED_FIELDS.values()]
        record = read_json(path, (*UNCHANGED_FIELDS, *number_keys), FILE_DESCRIPTION)
        if record["kind"] not in KINDS:
            raise InputError(path, "kind", record["kind"], " or ".join(KINDS))
        # The density has the same unit in the file, so it is not among the other keys.
        for key in ("density_kg_m3", *number_keys):
            value = record[key]
            # A particle may have no mesh.
            if key.startswith("mesh_") and value is None:
                continue
            _check_numbers(path, key, value)
        # A particle consists of ellipsoids or of spheres.
        if not record["spheres_mm"] and not record["semi_axes_mm"]:
            raise InputError(
                path, "spheres_mm", [], "spheres, if semi_axes_mm is empty"
            )
        return cls.from_record(record)


def _check_numbers(path: str | PathLike, key: str, value: object) -> None:
    """Check that the value of a key in the file of a particle has valid numbers.

    Parameters
    ----------
    path : path
        The file, for messages.
    key : str
        The key. It determines the required shape of the value (`ARRAY_SHAPES`), and
        which numbers may be 0.
    value : object
        The value of the key.

    Raises
    ------
    InputError
        If the shape is wrong, if a number is not finite, or if a size is not positive.
        Half axes and deviations may be 0.
    """
    # The error for a value of the wrong type or shape, which is raised below
    error = InputError(path, key, value, f"finite numbers in {FILE_DESCRIPTION}")
    # NumPy would convert text and booleans to numbers.
    if isinstance(value, bool | str):
        raise error
    # The shape () is that of a single number. In other shapes, -1 stands for any number
    # of rows.
    try:
        array = np.array(value, dtype=float)
        numbers = array.reshape(ARRAY_SHAPES.get(key, ()))
    except (TypeError, ValueError):
        raise error from None
    # `reshape` accepts any array with the right number of values, so compare the
    # shapes, too. An empty list stands for an array without rows.
    has_right_shape = array.size == 0 or array.shape == numbers.shape
    if not has_right_shape or not np.all(np.isfinite(numbers)):
        raise error

    # The coordinates of a sphere may be negative, but its radius must be positive.
    sizes = numbers[:, 3] if key == "spheres_mm" else numbers
    may_be_zero = key == "semi_axes_mm" or key.startswith("deviation")
    is_impossible = sizes < 0 if may_be_zero else sizes <= 0
    if np.any(is_impossible):
        raise InputError(path, key, value, "sizes above 0")


def _round_numbers(values: ArrayLike) -> Any:
    """Round numbers to twelve significant digits, which hides rounding errors.

    Parameters
    ----------
    values : array_like
        A number, or an array of any shape.

    Returns
    -------
    float or list
        The rounded number, or nested lists of rounded numbers.
    """
    numbers = np.asarray(values, dtype=float)
    rounded_numbers = [float(f"{number:.12g}") for number in numbers.ravel()]
    return np.reshape(rounded_numbers, numbers.shape).tolist()
