"""The particle a simulation pours: a convex body by its support function, or a rigid clump of spheres."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from repose.core.files import read_json, write_json
from repose.dem import Shape
from repose.particle import support_fit
from repose.particle.mesh import MM, Body

KINDS = ("ellipsoid", "smooth", "multisphere")


def _no_spheres():
    return np.zeros((0, 4))


@dataclass(frozen=True, eq=False)
class Particle:
    """Rigid particle in its body frame: principal axes, x the longest, centre of mass at the origin.

    kind: ellipsoid, smooth or multisphere. semi_axes_m (K, 3): half axes of the K co-axial ellipsoids whose support
    functions add up to the body's; K = 1 is an ellipsoid, K = 0 a multisphere. spheres_m (M, 4): centre x, y, z and
    radius of a multisphere's spheres, M = 0 for the others. inertia_kg_m2 (3,): principal moments.
    bounding_radius_m: distance of the farthest point from the centre. volume_m3: of the body, of a multisphere the
    union of its spheres; mass and inertia of a multisphere are those of the mesh.
    deviation_*_m: largest and rms difference from the mesh, of the support values; of a multisphere, of the surfaces.
    mesh_volume_m3, mesh_inertia_kg_m2 (3,), mesh_axes_m (3,): of the mesh itself at the same density, None without
    one; stl: name of its file. stacking: how many spheres act at one place (see `sphere_packing.stacking`).
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
    spheres_m: np.ndarray = field(default_factory=_no_spheres)
    mesh_inertia_kg_m2: np.ndarray | None = None
    mesh_axes_m: np.ndarray | None = None
    stacking: float = 1.0

    @property
    def is_clump(self):
        """Whether the particle consists of spheres."""
        return len(self.spheres_m) > 0

    @property
    def axes_m(self):
        """Full extents (3,) along the principal axes."""
        return self.support(np.eye(3)) + self.support(-np.eye(3))

    @property
    def mesh(self):
        """The `repose.particle.mesh.Body` of the mesh, None where the particle has none."""
        if self.mesh_inertia_kg_m2 is None:
            return None
        mass = self.density_kg_m3 * self.mesh_volume_m3
        return Body(self.mesh_volume_m3, mass, self.mesh_inertia_kg_m2, self.mesh_axes_m)

    def support(self, n):
        """Support values (...) in m for directions n (..., 3), unit vectors in the body frame."""
        n = np.asarray(n, dtype=float)
        if self.is_clump:
            return (n @ self.spheres_m[:, :3].T + self.spheres_m[:, 3]).max(axis=-1)
        return support_fit.support(self.semi_axes_m, n)

    def support_point(self, n):
        """Touching points grad h (..., 3) in m for directions n (..., 3), unit vectors in the body frame."""
        n = np.asarray(n, dtype=float)
        if self.is_clump:
            farthest = self.spheres_m[(n @ self.spheres_m[:, :3].T + self.spheres_m[:, 3]).argmax(axis=-1)]
            return farthest[..., :3] + farthest[..., 3:] * n
        return support_fit.support_point(self.semi_axes_m, n)

    def dem_shape(self, material):
        """The engine's shape of the particle, a `Shape` or a `Clump`, of a material's name."""
        if self.is_clump:
            from repose.dem import Clump

            return Clump(self.spheres_m, self.mass_kg, self.inertia_kg_m2, material)
        return Shape(self.semi_axes_m, self.mass_kg, self.inertia_kg_m2, material)

    def record(self) -> dict[str, Any]:
        """The particle as plain values for a file: lengths in mm, mass in g."""
        record = {name: getattr(self, name) for name in ("kind", "density_kg_m3", "stl", "stacking")}
        for name, (key, unit) in FIELDS.items():
            value = getattr(self, name)
            record[key] = None if value is None else _rounded(np.asarray(value) / unit)
        return record

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> "Particle":
        """The particle of `record`."""
        values = {name: record[name] for name in ("kind", "density_kg_m3", "stl", "stacking")}
        for name, (key, unit) in FIELDS.items():
            value = record[key]
            if isinstance(value, list):
                value = np.array(value, float) * unit
            values[name] = value * unit if isinstance(value, float | int) else value
        for name in ("semi_axes_m", "spheres_m"):
            values[name] = values[name].reshape(-1, 3 if name == "semi_axes_m" else 4)
        return cls(**values)

    def save(self, path: str | PathLike) -> None:
        """Write the particle as JSON; see `record`."""
        write_json(path, self.record(), indent=2)

    @classmethod
    def load(cls, path: str | PathLike) -> "Particle":
        """Read what `save` wrote.

        Raises
        ------
        InputError
            If the file is missing, or holds something else.
        """
        keys = ("kind", "density_kg_m3", "stl", "stacking", *(key for key, _ in FIELDS.values()))
        return cls.of_record(read_json(path, keys, "a file of `repose shape`"))


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


def _rounded(values):
    """Twelve significant digits, as float or nested lists: enough for the particle, readable in a file."""
    values = np.asarray(values, dtype=float)
    rounded = [float(f"{value:.12g}") for value in values.ravel()]
    return np.reshape(rounded, values.shape).tolist()
