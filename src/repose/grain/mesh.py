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
from repose.common.numbers import format_significant
from repose.grain.berry_files import PLAUSIBLE_LENGTHS_MM
from repose.grain.particle import MM, Body

# Volume of a mesh over that of its convex hull
SMALLEST_HULL_SHARE = 0.95
ROUNDING = 1e-6  # rounding errors may increase this ratio to 1 + ROUNDING
# Shortest side of a mesh over its longest
SMALLEST_SIDE_RATIO = 0.01
FEWEST_FACES = 4  # of a closed surface: a tetrahedron
# Number of directions whose support values are computed at once, to save memory
DIRECTIONS_PER_CHUNK = 500

# A binary STL file is a header, which ends with the number of facets, and the facets.
STL_HEADER_BYTES = 84
STL_FACET_BYTES = 50
# A text STL file has no control characters near its beginning. A decimal comma there is
# an error.
CONTROL_CHARACTER = re.compile(rb"[\0-\x08\x0e-\x1f]")
DECIMAL_COMMA = re.compile(rb"vertex\s+[-+\d]+,\d\S*")
BEGINNING_BYTES = 1000
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def ellipsoid_mesh(axes_mm: ArrayLike, subdivisions: int = 4) -> trimesh.Trimesh:
    """Make a watertight mesh whose vertices lie on an ellipsoid.

    Parameters
    ----------
    axes_mm : array_like
        Full axes (3,) of the ellipsoid along x, y and z.
    subdivisions : int
        Number of times that each triangle of an icosahedron is divided into four.

    Returns
    -------
    Trimesh
        The mesh in mm.
    """
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.5)
    mesh.apply_scale(np.asarray(axes_mm, dtype=float))
    return mesh


def load_mesh(path: str | PathLike) -> trimesh.Trimesh:
    """Read a mesh from a file, check it, and move it to its principal pose.

    The file may have any format that trimesh can read, such as STL. The mesh is checked
    by `check_mesh`. In the principal pose, the centre of mass is at the origin, and the
    principal axes of inertia lie along x, y and z.

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
        If the file is missing, or if its mesh cannot be the surface of a grain.
    """
    path = Path(path)
    if not path.is_file():
        allowed = "an existing mesh file, such as an STL in millimetres"
        raise InputError(path, "file", None, allowed)
    if path.suffix.lower() == ".stl":
        return read_stl(_trim_stl(path.read_bytes(), path), path)
    # The suffix of the path gives the format. The path also names the file in messages.
    return _read_mesh(path, None, path)


def _trim_stl(content: bytes, source: object) -> bytes:
    """Remove anything that follows the mesh in the contents of an STL file.

    Parameters
    ----------
    content : bytes
        Contents of the file, text or binary.
    source : object
        The file, for messages.

    Returns
    -------
    bytes
        The contents up to the end of the body. A text file is returned in lower case
        and with line feeds, which `trimesh` reads just as well.

    Raises
    ------
    InputError
        If the file is incomplete, if its numbers have decimal commas, or if a second
        body follows in a binary file.
    """
    # Letters and line ends of a text file may have several forms. Make them the same.
    text = content.removeprefix(BYTE_ORDER_MARK).lower().replace(b"\r", b"\n")
    beginning = text[:BEGINNING_BYTES]
    # A binary file hardly ever contains text that matches this pattern.
    decimal_comma = DECIMAL_COMMA.search(beginning)
    if decimal_comma:
        allowed = "numbers with a decimal point"
        raise InputError(source, "numbers", decimal_comma[0].decode(), allowed)
    # A binary file may begin with the word "solid", as a text file does, but it also
    # contains control characters.
    is_text = b"facet" in text and not CONTROL_CHARACTER.search(beginning)
    if is_text:
        return _trim_text_stl(text, source)
    return _trim_binary_stl(content, source)


def _trim_text_stl(text: bytes, source: object) -> bytes:
    """Check that a text STL file is complete, and make it end with one `endsolid`.

    Parameters
    ----------
    text : bytes
        Contents of the file in lower case and with line feeds.
    source : object
        The file, for messages.

    Returns
    -------
    bytes
        The text up to its last facet, followed by `endsolid`.

    Raises
    ------
    InputError
        If the file ends in the middle of a facet.
    """
    n_begun = len(re.findall(rb"(?m)^\s*facet\b", text))
    n_ended = len(re.findall(rb"(?m)^\s*endfacet\b", text))
    if n_begun != n_ended:
        allowed = f"{n_begun}, as many as begin: the file is cut off"
        raise InputError(source, "facets", n_ended, allowed)
    # Remove the last `endsolid` and everything after it, and add an `endsolid`. If
    # there is none after the last facet, only add it.
    end = text.rfind(b"endsolid")
    if end > text.rfind(b"endfacet"):
        text = text[:end]
    return text + b"\nendsolid\n"


def _trim_binary_stl(content: bytes, source: object) -> bytes:
    """Remove anything that follows the last facet of a binary STL file.

    Parameters
    ----------
    content : bytes
        Contents of the file.
    source : object
        The file, for messages.

    Returns
    -------
    bytes
        The header, followed by as many facets as the header states.

    Raises
    ------
    InputError
        If the file is incomplete or not an STL file, or if a second body follows.
    """
    # The header ends with the number of facets, in four bytes.
    header = content[:STL_HEADER_BYTES]
    n_in_header = int.from_bytes(header[STL_HEADER_BYTES - 4 :], "little")
    # Number of facets for which the file is long enough
    n_facets = max(len(content) - STL_HEADER_BYTES, 0) // STL_FACET_BYTES
    if n_facets < max(n_in_header, 1):
        # A header that states no facets does not say how many are expected.
        expected = n_in_header or "some"
        allowed = f"{expected}, as its header says: the file is cut off, or no STL"
        raise InputError(source, "facets", n_facets, allowed)
    end = STL_HEADER_BYTES + STL_FACET_BYTES * n_in_header
    rest = content[end:].strip(b"\0\t\r\n ")
    # If the rest is long enough for a header and a facet, it is taken for a second
    # body. This includes facets after a header that states none. A shorter rest, such
    # as a comment that a program has added, is removed.
    if len(rest) >= STL_HEADER_BYTES + STL_FACET_BYTES:
        allowed = f"{n_in_header}, as its header says: one body"
        raise InputError(source, "facets", n_facets, allowed)
    return content[:end]


def _read_mesh(file: Any, file_type: str | None, source: object) -> trimesh.Trimesh:
    """Read a mesh with trimesh, check it, and move it to its principal pose.

    Parameters
    ----------
    file : path or file object
        The file to read.
    file_type : str or None
        The name that trimesh gives to the format. If it is None, the suffix of the path
        determines the format.
    source : object
        The file, for messages.

    Returns
    -------
    Trimesh
        The mesh in mm.

    Raises
    ------
    InputError
        If trimesh cannot read the file, or if the mesh cannot be the surface of a
        grain.
    """
    try:
        mesh: Any = trimesh.load(file, file_type=file_type, force="mesh")
    except Exception as error:  # the parsers of the formats raise many kinds of errors
        # Some formats need a package that is not installed.
        if isinstance(error, ImportError):
            problem = "in a format that is not read here"
        else:
            problem = str(error)
        allowed = "a mesh that trimesh can read: save it as STL, in mm"
        raise InputError(source, "file", problem, allowed) from None
    return move_to_principal_pose(check_mesh(mesh, source))


def write_stl(mesh: trimesh.Trimesh) -> bytes:
    """Convert a mesh [mm] to the contents of a binary STL file, in single precision."""
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def read_stl(stl: bytes, source: object) -> trimesh.Trimesh:
    """Read a mesh from the contents of an STL file, and check it as `load_mesh` does.

    Parameters
    ----------
    stl : bytes
        Contents of the file, with lengths in mm.
    source : object
        The file, for messages.

    Returns
    -------
    Trimesh
        The mesh in mm, in its principal pose.
    """
    return _read_mesh(BytesIO(stl), "stl", source)


def check_mesh(mesh: trimesh.Trimesh, source: object) -> trimesh.Trimesh:
    """Check that a mesh can be the surface of a grain, and repair small faults.

    The order of the steps matters: equal vertices must be merged before bad facets are
    found, and both come before the check whether the mesh is closed.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm. It is changed in place: equal vertices are merged, and bad
        facets may be removed (`_remove_bad_facets`).
    source : object
        The mesh's file, for messages.

    Returns
    -------
    Trimesh
        The same mesh, after the changes.

    Raises
    ------
    InputError
        If the mesh is not a single closed body of a plausible size, if it is far from
        convex, or if the normals of its faces do not point outwards.
    """
    if len(mesh.faces) < FEWEST_FACES:
        allowed = f"a closed surface of at least {FEWEST_FACES} faces"
        raise InputError(source, "faces", len(mesh.faces), allowed)
    if not np.isfinite(mesh.vertices).all():
        allowed = "finite coordinates in millimetres"
        raise InputError(source, "vertices", "not finite", allowed)
    _check_extents(mesh, source)
    # A file may divide one body into several groups of faces. Merge the vertices that
    # these groups share.
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    _remove_bad_facets(mesh, source)
    if not mesh.is_watertight or not mesh.is_winding_consistent:
        raise _make_open_surface_error(mesh, source)
    if mesh.body_count > 1:
        allowed = "1: the outer surface of one grain"
        raise InputError(source, "bodies", mesh.body_count, allowed)
    # This also checks that the normals point outwards.
    _check_volume(mesh, source)
    return mesh


def _check_extents(mesh: trimesh.Trimesh, source: object) -> None:
    """Check that a mesh has a plausible size in mm, and that it is not a flat sheet.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm.
    source : object
        The mesh's file, for messages.

    Raises
    ------
    InputError
        If the longest side of the box around the mesh is implausible, or its shortest
        side is too short.
    """
    # Sides of the box around the mesh, along x, y and z
    longest = float(mesh.extents.max())
    shortest = float(mesh.extents.min())
    low, high = PLAUSIBLE_LENGTHS_MM
    if not low <= longest <= high:
        allowed = f"from {low:g} to {high:g}: is the mesh in millimetres?"
        raise InputError(source, "longest side in mm", longest, allowed)
    if shortest < SMALLEST_SIDE_RATIO * longest:
        allowed = (
            f"at least {SMALLEST_SIDE_RATIO:g} of the longest, {format_significant(longest)} mm: a "
            "body, no sheet"
        )
        raise InputError(source, "shortest side in mm", shortest, allowed)


def _remove_bad_facets(mesh: trimesh.Trimesh, source: object) -> None:
    """Remove facets of zero area, and then duplicate facets, from an open mesh.

    A closed mesh keeps them, because a facet of zero area may close a gap. Both kinds
    together are called bad facets.

    Parameters
    ----------
    mesh : Trimesh
        The mesh, which is changed in place.
    source : object
        The mesh's file, for messages.

    Raises
    ------
    InputError
        If at least half of the facets are bad, even if the mesh is closed.
    """
    # Each function marks the facets that are good. The duplicates are counted after the
    # first removal, because both functions read the present mesh.
    for find_good_facets in (mesh.nondegenerate_faces, mesh.unique_faces):
        is_good = find_good_facets()
        n_good = int(is_good.sum())
        n_bad = len(is_good) - n_good
        # If the file contains its body twice, half of the facets are duplicates.
        if n_bad >= n_good:
            key = "facets with an area, each once"
            allowed = f"{len(is_good)}: is the body there twice?"
            raise InputError(source, key, n_good, allowed)
        if n_bad > 0 and not mesh.is_watertight:
            mesh.update_faces(is_good)


def _make_open_surface_error(mesh: trimesh.Trimesh, source: object) -> InputError:
    """Make the error for a mesh that is not closed, with the number of its bad edges.

    Each edge of a closed surface belongs to two facets, and the normals of both point
    outwards. An edge is bad if it belongs to one facet, to more than two, or to two
    facets of which one is turned over.

    Parameters
    ----------
    mesh : Trimesh
        The mesh.
    source : object
        The mesh's file, for messages.

    Returns
    -------
    InputError
        The error, which counts the bad edges of each kind.
    """
    # `mesh.edges` lists an edge once for each of its facets, as a pair of vertices.
    # Give equal edges the same number, and count the facets of each edge.
    _, edge_numbers, n_facets = np.unique(
        mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True
    )
    # Each facet lists its corners counter-clockwise as seen from outside. So two
    # neighbouring facets that are both turned the right way run along their common edge
    # in opposite directions. Then the vertex numbers ascend along the edge in exactly
    # one of the two facets.
    is_ascending = mesh.edges[:, 0] < mesh.edges[:, 1]
    n_ascending = np.bincount(edge_numbers.ravel(), is_ascending)
    n_single = (n_facets == 1).sum()
    n_crowded = (n_facets > 2).sum()
    n_turned = ((n_facets == 2) & (n_ascending != 1)).sum()
    problem = (
        f"{n_single} edges of one facet, {n_crowded} of more than two, {n_turned} "
        "between facets of which one is turned over"
    )
    allowed = (
        "a watertight surface: each edge belongs to two facets that look outwards; is "
        "the file whole, without NaN?"
    )
    return InputError(source, "surface", problem, allowed)


def _check_volume(mesh: trimesh.Trimesh, source: object) -> None:
    """Check that the faces of a mesh point outwards, and that it is nearly convex.

    Parameters
    ----------
    mesh : Trimesh
        The closed mesh in mm.
    source : object
        The mesh's file, for messages.

    Raises
    ------
    InputError
        If the normals point inwards, if the mesh has deep dents, or if its surface
        crosses itself.
    """
    # If the normals point inwards, the volume is negative.
    volume = float(mesh.volume)
    if volume <= 0:
        allowed = "positive; the faces must look outwards"
        raise InputError(source, "volume in mm3", volume, allowed)
    # The hull share is the volume as a fraction of that of the convex hull. It is about
    # 1 for a convex body, and smaller the deeper its dents are.
    hull_share = volume / float(mesh.convex_hull.volume)
    if SMALLEST_HULL_SHARE <= hull_share <= 1 + ROUNDING:
        return
    # The mesh fails the check. The message depends on which limit it exceeds.
    if hull_share < 1:
        allowed = (
            f"at least {SMALLEST_HULL_SHARE:g}; the particle is convex and cannot stand "
            "for dents this deep"
        )
    else:
        allowed = "at most 1; the surface crosses itself"
    key = "share of its convex hull that the mesh fills"
    raise InputError(source, key, round(hull_share, 4), allowed)


def move_to_principal_pose(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Copy a mesh and move the copy to the principal pose.

    In this pose the centre of mass is at the origin, and the principal axes lie along
    x, y and z. The axis with the smallest moment of inertia, usually the longest, is x.

    Parameters
    ----------
    mesh : Trimesh
        The mesh, which is not changed.

    Returns
    -------
    Trimesh
        The copy.
    """
    # The rows of this matrix are the principal axes, in ascending order of their
    # moments of inertia.
    axes = np.linalg.eigh(mesh.moment_inertia).eigenvectors.T
    # The sign of an eigenvector is arbitrary. Make the largest component of each axis
    # positive, so that the pose does not depend on the routine that computes them.
    for axis in axes[:2]:
        largest = np.argmax(np.abs(axis))
        axis *= np.sign(axis[largest])
    # The frame is right-handed, so the third axis follows from the other two.
    axes[2] = np.cross(axes[0], axes[1])
    moved_mesh = mesh.copy()
    moved_mesh.vertices = (mesh.vertices - mesh.center_mass) @ axes.T
    return moved_mesh


def compute_body(mesh: trimesh.Trimesh, density_kg_m3: float) -> Body:
    """Compute volume, mass, principal moments and extents of a mesh.

    The volume and the moments are exact integrals over the polyhedron.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm, in its principal pose.
    density_kg_m3 : float
        Density of the body.

    Returns
    -------
    Body
        The properties in SI units.
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
    """Compute the support values of a mesh: how far it extends in each direction.

    The extents are measured from the origin.

    Parameters
    ----------
    mesh : Trimesh
        The mesh.
    n : ndarray
        Unit vectors (N, 3) along the directions.

    Returns
    -------
    ndarray
        The values (N,), in the unit of the mesh.
    """
    vertices = np.asarray(mesh.convex_hull.vertices)
    # Process the directions in chunks. An array of all directions times all vertices of
    # a scan would take gigabytes.
    chunks = np.array_split(n, 1 + len(n) // DIRECTIONS_PER_CHUNK)
    return np.concatenate([(chunk @ vertices.T).max(axis=1) for chunk in chunks])
