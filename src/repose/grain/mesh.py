"""Meshes of grains: reading, checks, principal pose; volume, moments and extents of their bodies."""

import re
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from repose.common.errors import InputError, require
from repose.grain.berry_files import LENGTHS_MM
from repose.grain.particle import MM, Body

CONVEX_SHARE = 0.95
FLATTEST = 0.01  # shortest side over the longest
STL_HEADER, STL_FACET = 84, 50  # bytes of a binary file


def ellipsoid_mesh(axes_mm: ArrayLike, subdivisions: int = 4) -> trimesh.Trimesh:
    """Make a watertight mesh of an ellipsoid with full axes (3,); its vertices lie on the ellipsoid."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.5)
    mesh.apply_scale(np.asarray(axes_mm, dtype=float))
    return mesh


def load_mesh(path: str | PathLike) -> trimesh.Trimesh:
    """Read a mesh [mm] that trimesh reads, such as STL; it comes in its principal pose and checked (`check_mesh`)."""
    path = Path(path)
    require(
        path.is_file(),
        path,
        "file",
        None,
        "an existing mesh file, such as an STL in millimetres",
    )
    if path.suffix.lower() == ".stl":
        return mesh_of(_whole_stl(path.read_bytes(), path), path)
    return _read(path, None, path)


def _whole_stl(content: bytes, source: object) -> bytes:
    """Return an STL without what follows its end, with a last `endsolid`; InputError if cut off, or of two bodies."""
    text = content.removeprefix(b"\xef\xbb\xbf").lower().replace(b"\r", b"\n")
    commas, allowed = (
        re.search(rb"vertex\s+[-+\d]+,\d\S*", text[:1000]),
        "numbers with a decimal point",
    )
    require(not commas, source, "numbers", commas and commas[0].decode(), allowed)
    if b"facet" in text and not re.search(rb"[\0-\x08\x0e-\x1f]", text[:1000]):
        begun, ended = (
            len(re.findall(rb"(?m)^\s*" + word + rb"\b", text))
            for word in (b"facet", b"endfacet")
        )
        require(
            begun == ended,
            source,
            "facets",
            ended,
            f"{begun}, as many as begin: the file is cut off",
        )
        end = text.rfind(
            b"endsolid"
        )  # of what stands behind it nothing belongs to the body
        return text[: end if end > text.rfind(b"endfacet") else None] + b"\nendsolid\n"
    count = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    facets = max(len(content) - STL_HEADER, 0) // STL_FACET
    allowed = f"{count or 'some'}, as its header says: the file is cut off, or no STL"
    require(facets >= max(count, 1), source, "facets", facets, allowed)
    behind = content[STL_HEADER + STL_FACET * count :].strip(b"\0\t\r\n ")
    require(
        len(behind) < STL_HEADER + STL_FACET,
        source,
        "facets",
        facets,
        f"{count}, as its header says: one body",
    )
    return content[: STL_HEADER + STL_FACET * count]


def _read(file: Any, file_type: str | None, source: object) -> trimesh.Trimesh:
    """Read, check and turn a mesh."""
    try:
        mesh: Any = trimesh.load(file, file_type=file_type, force="mesh")
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        found = (
            "in a format that is not read here"
            if isinstance(error, ImportError)
            else str(error)
        )
        raise InputError(
            source, "file", found, "a mesh that trimesh can read: save it as STL, in mm"
        ) from None
    return principal_pose(check_mesh(mesh, source))


def stl_of(mesh: trimesh.Trimesh) -> bytes:
    """Write a mesh [mm] as the content of a binary STL file, in single precision."""
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def mesh_of(stl: bytes, source: object) -> trimesh.Trimesh:
    """Read the mesh of the content of an STL file, as by `load_mesh`; messages name `source`."""
    return _read(BytesIO(stl), "stl", source)


def check_mesh(mesh: trimesh.Trimesh, source: object) -> trimesh.Trimesh:
    """Return a mesh [mm] that is one closed body, faces outwards, has a plausible size and is nearly convex.

    Any other is an InputError. Facets without an area, and some that are there twice, are taken out of it.
    """
    require(
        len(mesh.faces) >= 4,
        source,
        "faces",
        len(mesh.faces),
        "a closed surface of at least 4 faces",
    )
    require(
        np.isfinite(mesh.vertices).all(),
        source,
        "vertices",
        "not finite",
        "finite coordinates in millimetres",
    )
    longest = float(mesh.extents.max())
    low, high = LENGTHS_MM
    allowed = f"from {low:g} to {high:g}: is the mesh in millimetres?"
    require(low <= longest <= high, source, "longest side in mm", longest, allowed)
    flat, allowed = (
        float(mesh.extents.min()),
        f"at least {FLATTEST:g} of the longest, {longest:.4g} mm: a body, no sheet",
    )
    require(flat >= FLATTEST * longest, source, "shortest side in mm", flat, allowed)
    mesh.merge_vertices(
        merge_norm=True, merge_tex=True
    )  # several groups, or solids, may be one body
    for find in (mesh.nondegenerate_faces, mesh.unique_faces):
        good = find()  # among the facets that the one before has left
        several, allowed = (
            2 * good.sum() > len(good),
            f"{len(good)}: is the body there twice?",
        )
        require(
            several, source, "facets with an area, each once", int(good.sum()), allowed
        )
        if not good.all() and not mesh.is_watertight:  # a needle may close a joint
            mesh.update_faces(good)
    if not mesh.is_watertight or not mesh.is_winding_consistent:
        _, edge, facets = np.unique(
            mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True
        )
        upwards = np.bincount(edge.ravel(), mesh.edges[:, 0] < mesh.edges[:, 1])
        turned = (
            (facets == 2) & (upwards != 1)
        ).sum()  # both facets go along it the same way
        found = f"{(facets == 1).sum()} edges of one facet, {(facets > 2).sum()} of more than two"
        found += f", {turned} between facets of which one is turned over"
        allowed = "a watertight surface: each edge belongs to two facets that look outwards; is the file whole, without NaN?"
        raise InputError(source, "surface", found, allowed)
    require(
        mesh.body_count <= 1,
        source,
        "bodies",
        mesh.body_count,
        "1: the outer surface of one grain",
    )
    volume = float(mesh.volume)
    require(
        volume > 0,
        source,
        "volume in mm3",
        volume,
        "positive; the faces must look outwards",
    )
    share = volume / float(mesh.convex_hull.volume)
    dents = f"at least {CONVEX_SHARE:g}; the particle is convex and cannot stand for dents this deep"
    allowed = dents if share < 1 else "at most 1; the surface crosses itself"
    key = "share of its convex hull that the mesh fills"
    require(CONVEX_SHARE <= share <= 1 + 1e-6, source, key, round(share, 4), allowed)
    return mesh


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
    return Body(
        volume, density_kg_m3 * volume, inertia, np.ptp(mesh.vertices, axis=0) * MM
    )


def mesh_support(mesh: trimesh.Trimesh, n: np.ndarray) -> np.ndarray:
    """Compute support values (N,) of a mesh in its unit: extents from the origin in the directions n (N, 3)."""
    vertices = np.asarray(mesh.convex_hull.vertices)
    # In chunks: a scan's hull times all directions would fill gigabytes.
    return np.concatenate(
        [
            (part @ vertices.T).max(axis=1)
            for part in np.array_split(n, 1 + len(n) // 500)
        ]
    )
