"""Read and check meshes of grains, and compute the properties of their bodies."""

import re
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from repose.common.errors import InputError
from repose.grain.berry_files import LENGTHS_MM
from repose.grain.particle import MM, Body

CONVEX_SHARE = 0.95  # smallest share of its convex hull that a mesh fills
FLATTEST = 0.01  # shortest side over the longest
CHUNK = 500  # directions whose support values are computed at once

# A binary STL file: a header whose last four bytes are the number of facets, and facets
STL_HEADER = 84
STL_FACET = 50
# An STL file in text: what its beginning does not and may not contain
CONTROL_CHARACTER = re.compile(rb"[\0-\x08\x0e-\x1f]")
DECIMAL_COMMA = re.compile(rb"vertex\s+[-+\d]+,\d\S*")
BEGINNING = 1000  # bytes
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def ellipsoid_mesh(axes_mm: ArrayLike, subdivisions: int = 4) -> trimesh.Trimesh:
    """Make a watertight mesh of an ellipsoid with full axes (3,).

    Its vertices lie on the ellipsoid.
    """
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.5)
    mesh.apply_scale(np.asarray(axes_mm, dtype=float))
    return mesh


def load_mesh(path: str | PathLike) -> trimesh.Trimesh:
    """Read a mesh in a format of trimesh, such as STL.

    It is checked (`check_mesh`) and turned into its principal pose.

    Parameters
    ----------
    path : path
        The file, with lengths in mm.

    Returns
    -------
    Trimesh
        The mesh in mm.

    Raises
    ------
    InputError
        If the file is missing or has no mesh of a grain.
    """
    path = Path(path)
    if not path.is_file():
        allowed = "an existing mesh file, such as an STL in millimetres"
        raise InputError(path, "file", None, allowed)
    if path.suffix.lower() == ".stl":
        return read_stl(_complete_stl(path.read_bytes(), path), path)
    return _read_mesh(path, None, path)


def _complete_stl(content: bytes, source: object) -> bytes:
    """Return the content of an STL file up to the end of its only body.

    Parameters
    ----------
    content : bytes
        Content of the file, as text or binary.
    source : object
        The file, for messages.

    Returns
    -------
    bytes
        An STL file of one body.

    Raises
    ------
    InputError
        If the file is cut off, or has two bodies.
    """
    text = content.removeprefix(BYTE_ORDER_MARK).lower().replace(b"\r", b"\n")
    beginning = text[:BEGINNING]
    decimal_comma = DECIMAL_COMMA.search(beginning)
    if decimal_comma:
        allowed = "numbers with a decimal point"
        raise InputError(source, "numbers", decimal_comma[0].decode(), allowed)
    # A binary file may also begin with the word "solid", but has control characters.
    is_text = b"facet" in text and not CONTROL_CHARACTER.search(beginning)
    if is_text:
        return _complete_text_stl(text, source)
    return _complete_binary_stl(content, source)


def _complete_text_stl(text: bytes, source: object) -> bytes:
    """Check an STL in lower-case text, and end it with a single `endsolid`.

    Parameters
    ----------
    text : bytes
        Content of the file in lower case.
    source : object
        The file, for messages.

    Raises
    ------
    InputError
        If the file is cut off within a facet.
    """
    n_beginnings = len(re.findall(rb"(?m)^\s*facet\b", text))
    n_ends = len(re.findall(rb"(?m)^\s*endfacet\b", text))
    if n_beginnings != n_ends:
        allowed = f"{n_beginnings}, as many as begin: the file is cut off"
        raise InputError(source, "facets", n_ends, allowed)
    # Remove the last `endsolid` and everything after it, and append a new one. The file
    # may have no `endsolid`.
    end = text.rfind(b"endsolid")
    if end > text.rfind(b"endfacet"):
        text = text[:end]
    return text + b"\nendsolid\n"


def _complete_binary_stl(content: bytes, source: object) -> bytes:
    """Return the content of a binary STL up to its last facet, by the count in its header.

    Parameters
    ----------
    content : bytes
        Content of the file.
    source : object
        The file, for messages.

    Raises
    ------
    InputError
        If the file is cut off, or if another body follows.
    """
    # The header ends with the number of facets, in four bytes.
    n_in_header = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    n_facets = max(len(content) - STL_HEADER, 0) // STL_FACET
    if n_facets < max(n_in_header, 1):
        expected = n_in_header or "some"
        allowed = f"{expected}, as its header says: the file is cut off, or no STL"
        raise InputError(source, "facets", n_facets, allowed)
    end = STL_HEADER + STL_FACET * n_in_header
    rest = content[end:].strip(b"\0\t\r\n ")
    # The rest may be long enough for another file with a facet.
    if len(rest) >= STL_HEADER + STL_FACET:
        allowed = f"{n_in_header}, as its header says: one body"
        raise InputError(source, "facets", n_facets, allowed)
    return content[:end]


def _read_mesh(file: Any, file_type: str | None, source: object) -> trimesh.Trimesh:
    """Read a mesh by trimesh, check it and turn it into its principal pose.

    Parameters
    ----------
    file : path or file
        What trimesh reads.
    file_type : str or None
        Format of trimesh; None leaves it to the ending of the path.
    source : object
        The file, for messages.

    Returns
    -------
    Trimesh
        The mesh in mm.

    Raises
    ------
    InputError
        If trimesh cannot read it, or if it is no mesh of a grain.
    """
    try:
        mesh: Any = trimesh.load(file, file_type=file_type, force="mesh")
    except Exception as error:  # whatever the parser of the format raises
        if isinstance(error, ImportError):
            problem = "in a format that is not read here"
        else:
            problem = str(error)
        allowed = "a mesh that trimesh can read: save it as STL, in mm"
        raise InputError(source, "file", problem, allowed) from None
    return principal_pose(check_mesh(mesh, source))


def write_stl(mesh: trimesh.Trimesh) -> bytes:
    """Write a mesh [mm] as the content of a binary STL file, in single precision."""
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def read_stl(stl: bytes, source: object) -> trimesh.Trimesh:
    """Read the mesh of the content of an STL file, as by `load_mesh`.

    Messages name `source`.
    """
    return _read_mesh(BytesIO(stl), "stl", source)


def check_mesh(mesh: trimesh.Trimesh, source: object) -> trimesh.Trimesh:
    """Check that a mesh can be the surface of a grain.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm. It is changed: equal vertices are merged, and facets without an
        area, and some that are there twice, are removed.
    source : object
        The mesh's file, for messages.

    Returns
    -------
    Trimesh
        The same mesh.

    Raises
    ------
    InputError
        Unless it is one closed body whose faces look outwards, has a plausible size and
        is nearly convex.
    """
    if len(mesh.faces) < 4:
        allowed = "a closed surface of at least 4 faces"
        raise InputError(source, "faces", len(mesh.faces), allowed)
    if not np.isfinite(mesh.vertices).all():
        allowed = "finite coordinates in millimetres"
        raise InputError(source, "vertices", "not finite", allowed)
    _check_sides(mesh, source)
    # Several groups, or solids, may be one body.
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    _remove_bad_facets(mesh, source)
    if not mesh.is_watertight or not mesh.is_winding_consistent:
        raise _make_open_surface_error(mesh, source)
    if mesh.body_count > 1:
        allowed = "1: the outer surface of one grain"
        raise InputError(source, "bodies", mesh.body_count, allowed)
    _check_volume(mesh, source)
    return mesh


def _check_sides(mesh: trimesh.Trimesh, source: object) -> None:
    """Raise InputError for a mesh that is hardly in mm, or is flat.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm.
    source : object
        The mesh's file, for messages.
    """
    longest = float(mesh.extents.max())
    shortest = float(mesh.extents.min())
    low, high = LENGTHS_MM
    if not low <= longest <= high:
        allowed = f"from {low:g} to {high:g}: is the mesh in millimetres?"
        raise InputError(source, "longest side in mm", longest, allowed)
    if shortest < FLATTEST * longest:
        allowed = (
            f"at least {FLATTEST:g} of the longest, {longest:.4g} mm: a body, no sheet"
        )
        raise InputError(source, "shortest side in mm", shortest, allowed)


def _remove_bad_facets(mesh: trimesh.Trimesh, source: object) -> None:
    """Remove facets without an area, and then repeated facets.

    A closed mesh is not changed, because a facet without an area may close a gap.

    Parameters
    ----------
    mesh : Trimesh
        The mesh, which is changed.
    source : object
        The mesh's file, for messages.

    Raises
    ------
    InputError
        If half of the facets are bad.
    """
    for find_good_facets in (mesh.nondegenerate_faces, mesh.unique_faces):
        is_good = find_good_facets()
        n_good = int(is_good.sum())
        if 2 * n_good <= len(is_good):
            key = "facets with an area, each once"
            allowed = f"{len(is_good)}: is the body there twice?"
            raise InputError(source, key, n_good, allowed)
        if n_good < len(is_good) and not mesh.is_watertight:
            mesh.update_faces(is_good)


def _make_open_surface_error(mesh: trimesh.Trimesh, source: object) -> InputError:
    """Make the error of a mesh that is not closed, with the kinds of its bad edges.

    An edge of a closed surface belongs to two facets that look outwards.

    Parameters
    ----------
    mesh : Trimesh
        The mesh.
    source : object
        The mesh's file, for messages.

    Returns
    -------
    InputError
        The error, which counts the edges of each kind.
    """
    # `mesh.edges` has the two vertices of each edge once for each facet. Give equal
    # edges one number, and count their facets.
    _, edge_numbers, n_facets = np.unique(
        mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True
    )
    # Two facets that look to the same side go along their edge in opposite directions:
    # one of them from the vertex with the lower number to the higher.
    is_ascending = mesh.edges[:, 0] < mesh.edges[:, 1]
    n_ascending = np.bincount(edge_numbers.ravel(), is_ascending)
    n_turned = ((n_facets == 2) & (n_ascending != 1)).sum()
    problem = (
        f"{(n_facets == 1).sum()} edges of one facet, {(n_facets > 2).sum()} of more "
        f"than two, {n_turned} between facets of which one is turned over"
    )
    allowed = (
        "a watertight surface: each edge belongs to two facets that look outwards; is "
        "the file whole, without NaN?"
    )
    return InputError(source, "surface", problem, allowed)


def _check_volume(mesh: trimesh.Trimesh, source: object) -> None:
    """Raise InputError unless the faces look outwards and the mesh is nearly convex.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm, which is closed.
    source : object
        The mesh's file, for messages.
    """
    volume = float(mesh.volume)
    if volume <= 0:
        allowed = "positive; the faces must look outwards"
        raise InputError(source, "volume in mm3", volume, allowed)
    hull_share = volume / float(mesh.convex_hull.volume)
    if CONVEX_SHARE <= hull_share <= 1 + 1e-6:
        return
    if hull_share < 1:
        allowed = (
            f"at least {CONVEX_SHARE:g}; the particle is convex and cannot stand for "
            "dents this deep"
        )
    else:
        allowed = "at most 1; the surface crosses itself"
    key = "share of its convex hull that the mesh fills"
    raise InputError(source, key, round(hull_share, 4), allowed)


def principal_pose(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Copy a mesh and move it into its principal pose.

    The centre of mass is the origin, and the principal axes are x (the longest), y and
    z.

    Parameters
    ----------
    mesh : Trimesh
        The mesh, which is not changed.

    Returns
    -------
    Trimesh
        The copy.
    """
    # The rows are the principal axes. Their moments ascend, and the smallest moment
    # belongs to the longest axis.
    axes = np.linalg.eigh(mesh.moment_inertia).eigenvectors.T
    # An axis may point to either side. Its largest component is made positive, so that
    # the pose does not depend on the eigenvector routine. The third axis follows from
    # the others: the frame is right-handed.
    for axis in axes[:2]:
        largest = np.argmax(np.abs(axis))
        axis *= np.sign(axis[largest])
    axes[2] = np.cross(axes[0], axes[1])
    posed = mesh.copy()
    posed.vertices = (mesh.vertices - mesh.center_mass) @ axes.T
    return posed


def compute_body(mesh: trimesh.Trimesh, density_kg_m3: float) -> Body:
    """Compute volume, mass, moments and extents of a mesh (mm, principal pose).

    They are exact integrals over the polyhedron.
    """
    volume_m3 = float(mesh.volume) * MM**3
    moments = np.diag(mesh.moment_inertia)
    return Body(
        volume_m3=volume_m3,
        mass_kg=density_kg_m3 * volume_m3,
        inertia_kg_m2=moments / mesh.density * density_kg_m3 * MM**5,
        axes_m=np.ptp(mesh.vertices, axis=0) * MM,
    )


def compute_support(mesh: trimesh.Trimesh, n: np.ndarray) -> np.ndarray:
    """Compute support values (N,) of a mesh in its unit.

    They are the extents from the origin in the directions n (N, 3).
    """
    vertices = np.asarray(mesh.convex_hull.vertices)
    # In chunks: a scan's hull times all directions would fill gigabytes.
    chunks = np.array_split(n, 1 + len(n) // CHUNK)
    return np.concatenate([(chunk @ vertices.T).max(axis=1) for chunk in chunks])
