"""The simulated particle: a convex body by its support function, or a rigid clump of spheres."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from repose import dem
from repose.common.errors import InputError, require
from repose.common.files import read_json, write_json
from repose.grain import support

MM = 1e-3
KINDS = ("ellipsoid", "smooth", "multisphere")
SURFACES = ("smooth", "rough", "rough_full")  # of a multisphere


@dataclass(frozen=True, eq=False)
class Body:
    """Inertial properties of a closed mesh."""

    volume_m3: float
    mass_kg: float
    inertia_kg_m2: np.ndarray  # (3,), principal moments
    axes_m: np.ndarray  # (3,), full extents along x, y, z


def check_positive(source: object, **numbers: float | None) -> None:
    """Raise InputError unless these numbers are above 0; None is not checked, `source` is named in the message."""
    for key, value in numbers.items():
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(source, key, value, "a positive number")


@dataclass(frozen=True, eq=False)
class Particle:
    """Rigid particle in its body frame: principal axes, x the longest, centre of mass at the origin.

    The support function of a convex body is the sum over K co-axial ellipsoids. A multisphere has the mass and the
    moments of its mesh, and the volume of the union of its spheres.
    """

    kind: str  # ellipsoid, smooth or multisphere
    semi_axes_m: (
        np.ndarray
    )  # (K, 3), half axes of the ellipsoids; K = 1: ellipsoid, K = 0: multisphere
    density_kg_m3: float
    volume_m3: float
    mass_kg: float
    inertia_kg_m2: np.ndarray  # (3,), principal moments
    bounding_radius_m: float  # distance of the farthest point from the centre
    deviation_max_m: (
        float  # from the mesh, of support values; of a multisphere, of surfaces
    )
    deviation_rms_m: float  # likewise
    mesh_volume_m3: float | None = None  # of the mesh itself; None without a mesh
    stl: str = ""  # name of the mesh's file
    spheres_m: np.ndarray = field(
        default_factory=partial(np.zeros, (0, 4))
    )  # (M, 4), x, y, z, radius
    mesh_inertia_kg_m2: np.ndarray | None = (
        None  # (3,), at the same density; None without a mesh
    )
    mesh_axes_m: np.ndarray | None = None  # (3,), full extents; None without a mesh

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
        """The mesh's own body, None where the particle has none."""
        if (
            self.mesh_volume_m3 is None
            or self.mesh_inertia_kg_m2 is None
            or self.mesh_axes_m is None
        ):
            return None
        mass = self.density_kg_m3 * self.mesh_volume_m3
        return Body(
            self.mesh_volume_m3, mass, self.mesh_inertia_kg_m2, self.mesh_axes_m
        )

    def support(self, n: np.ndarray) -> np.ndarray:
        """Compute support values (...) [m]: extents from the centre in the directions n (..., 3) of the body frame."""
        n = np.asarray(n, dtype=float)
        if self.is_clump:
            return (n @ self.spheres_m[:, :3].T + self.spheres_m[:, 3]).max(axis=-1)
        return support.support(self.semi_axes_m, n)

    def support_point(self, n: np.ndarray) -> np.ndarray:
        """Compute touching points (..., 3) [m] for directions n (..., 3): the gradient of the support function."""
        n = np.asarray(n, dtype=float)
        if self.is_clump:
            farthest = self.spheres_m[
                (n @ self.spheres_m[:, :3].T + self.spheres_m[:, 3]).argmax(axis=-1)
            ]
            return farthest[..., :3] + farthest[..., 3:] * n
        return support.support_point(self.semi_axes_m, n)

    def dem_shape(self, material: str) -> "dem.Shape | dem.Clump":
        """Make the engine's shape of the particle, with the name of its material."""
        if self.is_clump:
            return dem.Clump(self.spheres_m, self.mass_kg, self.inertia_kg_m2, material)
        return dem.Shape(self.semi_axes_m, self.mass_kg, self.inertia_kg_m2, material)

    def record(self) -> dict[str, Any]:
        """Return the particle as plain values for a file: lengths in mm, mass in g."""
        record = {
            name: getattr(self, name) for name in ("kind", "density_kg_m3", "stl")
        }
        for name, (key, unit) in FIELDS.items():
            value = getattr(self, name)
            record[key] = None if value is None else _rounded(np.asarray(value) / unit)
        return record

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> "Particle":
        """Make the particle of a `record`."""
        values = {name: record[name] for name in ("kind", "density_kg_m3", "stl")}
        for name, (key, unit) in FIELDS.items():
            value = record[key]
            if isinstance(value, list):
                value = np.array(value, float) * unit
            values[name] = value * unit if isinstance(value, float | int) else value
        for name in ("semi_axes_m", "spheres_m"):
            values[name] = values[name].reshape(-1, 3 if name == "semi_axes_m" else 4)
        return cls(**values)

    def save(self, path: str | PathLike) -> None:
        """Write the particle as JSON, see `record`."""
        write_json(path, self.record(), indent=2)

    @classmethod
    def load(cls, path: str | PathLike) -> "Particle":
        """Read a file of `save`; InputError for any other file."""
        kind = "a file of `repose stage shape`"
        keys = ("kind", "density_kg_m3", "stl", *(key for key, _ in FIELDS.values()))
        record = read_json(path, keys, kind)
        require(
            record["kind"] in KINDS, path, "kind", record["kind"], " or ".join(KINDS)
        )
        shapes: dict[str, tuple[int, ...]] = {
            "semi_axes_mm": (-1, 3),
            "spheres_mm": (-1, 4),
        }
        shapes |= dict.fromkeys(
            ("inertia_g_mm2", "mesh_inertia_g_mm2", "mesh_axes_mm"), (3,)
        )
        for key in keys:
            if key not in ("kind", "stl") and not (
                key.startswith("mesh_") and record[key] is None
            ):
                _check_numbers(path, key, record[key], shapes.get(key, ()))
        if not record["spheres_mm"] and not record["semi_axes_mm"]:
            raise InputError(path, "spheres_mm", [], "spheres, or semi-axes beside it")
        return cls.of_record(record)


def _check_numbers(
    path: str | PathLike, key: str, value: object, shape: tuple[int, ...]
) -> None:
    """Raise InputError unless the values are finite numbers of this shape, positive where necessary."""
    wrong = InputError(
        path, key, value, "finite numbers in a file of `repose stage shape`"
    )
    try:
        given = np.array(value, dtype=float)
        numbers = given.reshape(shape)
    except (TypeError, ValueError):
        raise wrong from None
    fits = not given.size or given.shape == numbers.shape
    if isinstance(value, bool | str) or not fits or not np.all(np.isfinite(numbers)):
        raise wrong
    may_be_zero = key == "semi_axes_mm" or key.startswith("deviation")
    sizes = numbers[:, 3] if key == "spheres_mm" else numbers
    require(
        not np.any(sizes < 0 if may_be_zero else sizes <= 0),
        path,
        key,
        value,
        "sizes above 0",
    )


# Names of the numbers in the file, and their units there.
FIELDS = {
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


def _rounded(values: ArrayLike) -> Any:
    """Round to twelve significant digits, as float or nested lists: enough for the particle, readable in a file."""
    values = np.asarray(values, dtype=float)
    rounded = [float(f"{value:.12g}") for value in values.ravel()]
    return np.reshape(rounded, values.shape).tolist()
