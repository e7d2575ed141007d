"""Meshes of grains: reading, checks, principal pose; volume, moments and extents of their bodies."""

from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from repose.core.errors import InputError
from repose.particle.berry_files import LENGTHS_MM
from repose.particle.particle import MM, Body

CONVEX_SHARE = 0.95


def ellipsoid_mesh(axes_mm: ArrayLike, subdivisions: int = 4) -> trimesh.Trimesh:
    """Make a watertight mesh of an ellipsoid with full axes (3,); its vertices lie on the ellipsoid."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.5)
    mesh.apply_scale(np.asarray(axes_mm, dtype=float))
    return mesh


def load_mesh(path: str | PathLike) -> trimesh.Trimesh:
    """Read a mesh [mm] that trimesh reads, such as STL; it comes in its principal pose and checked (`check_mesh`)."""
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "file", None, "an existing mesh file, such as an STL in millimetres")
    try:
        mesh: Any = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        raise InputError(path, "file", str(error), "a mesh that trimesh can read, such as an STL") from None
    check_mesh(mesh, path)
    return principal_pose(mesh)


def stl_of(mesh: trimesh.Trimesh) -> bytes:
    """Write a mesh [mm] as the content of a binary STL file, in single precision."""
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def mesh_of(stl: bytes, source: object) -> trimesh.Trimesh:
    """Read the mesh of the content of an STL file, as by `load_mesh`; messages name `source`."""
    mesh: Any = trimesh.load(BytesIO(stl), file_type="stl", force="mesh")
    check_mesh(mesh, source)
    return principal_pose(mesh)


def check_mesh(mesh: trimesh.Trimesh, source: object) -> None:
    """Raise InputError unless a mesh [mm] is closed, faces outwards, has a plausible size, and is nearly convex."""
    if len(mesh.faces) < 4:
        raise InputError(source, "faces", len(mesh.faces), "a closed surface of at least 4 faces")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(source, "vertices", "not finite", "finite coordinates in millimetres")
    longest = float(mesh.extents.max())
    low, high = LENGTHS_MM
    if not low <= longest <= high:
        allowed = f"from {low:g} to {high:g}: is the mesh in millimetres?"
        raise InputError(source, "longest side in mm", longest, allowed)
    if not mesh.is_watertight or not mesh.is_winding_consistent:
        allowed = "a watertight surface with consistent faces; close the holes first"
        raise InputError(source, "surface", "open or inconsistent", allowed)
    if mesh.volume <= 0:
        raise InputError(source, "volume in mm3", float(mesh.volume), "positive; the faces must look outwards")
    share = float(mesh.volume / mesh.convex_hull.volume)
    if share < CONVEX_SHARE:
        allowed = f"at least {CONVEX_SHARE:g}; the particle is convex and cannot stand for dents this deep"
        raise InputError(source, "share of its convex hull that the mesh fills", round(share, 4), allowed)


def principal_pose(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Copy a mesh, with its centre of mass at the origin and its principal axes along x (the longest), y and z."""
    # Ascending moments: the smallest belongs to the longest axis.
    axes = np.linalg.eigh(mesh.moment_inertia).eigenvectors.T
    for k in range(2):
        # A fixed sign, so that the pose does not depend on the eigenvector routine.
        axes[k] *= np.sign(axes[k, np.argmax(np.abs(axes[k]))])
    axes[2] = np.cross(axes[0], axes[1])
    posed = mesh.copy()
    posed.vertices = (mesh.vertices - mesh.center_mass) @ axes.T
    return posed


def body_of(mesh: trimesh.Trimesh, density_kg_m3: float) -> Body:
    """Compute volume, mass, moments and extents of a mesh (mm, principal pose): exact integrals over the polyhedron."""
    inertia = np.diag(mesh.moment_inertia) / mesh.density * density_kg_m3 * MM**5
    volume = float(mesh.volume) * MM**3
    return Body(volume, density_kg_m3 * volume, inertia, np.ptp(mesh.vertices, axis=0) * MM)


def mesh_support(mesh: trimesh.Trimesh, n: np.ndarray) -> np.ndarray:
    """Compute support values (N,) of a mesh in its unit: extents from the origin in the directions n (N, 3)."""
    vertices = np.asarray(mesh.convex_hull.vertices)
    # In chunks: a scan's hull times all directions would fill gigabytes.
    return np.concatenate([(part @ vertices.T).max(axis=1) for part in np.array_split(n, 1 + len(n) // 500)])
