"""Faces, edges and vertices of a mesh that bodies can touch, in a grid of cells.

Features are faces, convex edges and convex vertices. The mesh is *eroded* by the edge
radius: every vertex moves inwards until it lies that deep below all its faces; the
eroded mesh is called the core. The wall is the core dilated by the edge radius. So
faces return to their old places, edges become cylinders and vertices spheres, tangent
to the faces. The normals of neighbouring features fit together without gap or overlap,
for any mesh. Edges between coplanar triangles and concave edges bound no set of normals
and are no features. An open border is a rim, rounded down to the back of its face.

`split` makes a `MeshFeatures`, the features of one mesh; `join` puts the parts of all meshes
into a `Meshes`, which the kernels take. This is Python but for `put_in_cells`.

Names: V, F and E are the numbers of vertices, faces and edges of the mesh. A *plane* is
a group of coplanar triangles (or stands upright on a rim), with one outward unit
normal.
"""

from typing import Any, NamedTuple

import numpy as np

from .jit import inlined, kernel

FACE, EDGE, VERTEX = range(3)  # values of `Meshes.kind`

# Columns of `Meshes.data`. Normals point into the wall.
COLUMNS = 20
# Of a face: normal (3), offset along it, and three sides of four columns each: the inward
# normal in the plane of the face (3), offset along that. Then a flag for each side:
# whether a point on that side belongs to the neighbour.
FACE_NORMAL, FACE_OFFSET = 0, 3
SIDES, SIDE_COLUMNS = 4, 4
STRICT = 16
# Of an edge: start (3), unit vector along it (3), length, normal of the first face (3),
# unit vector to which that normal turns (3), and the angle of all normals [rad].
EDGE_ALONG, EDGE_LENGTH, EDGE_NORMAL, EDGE_TURN, EDGE_ANGLE = 3, 6, 7, 10, 13
PLACE = 0  # (3), start of an edge or place of a vertex
RADIUS_COLUMN = 19  # edge radius, of every feature

# Two triangles may be coplanar when their corners are this near to each other's plane, as
# a share of the mesh's size. A whole group of them is one plane when no corner is farther
# from the common plane than the second share.
FLAT, FLAT_GROUP = 1e-6, 1e-5
# Normals of one vertex that differ by less than this (singular values) do not say where
# the vertex moves.
SAME_NORMAL = 0.01
# A group of coplanar triangles keeps its plane when its corners lie one edge radius below
# it, to this share of the radius.
SAME_DEPTH = 1e-5
# Of faces that meet in a concave kink of less than this angle [rad], only the face of the
# largest overlap is touched.
GENTLE = 0.35
# An edge between planes is no feature below this angle [rad].
LEAST_ANGLE = 1e-9
# A direction lies within a vertex's normals when it does by this margin (a sine).
LEAST_CONE = 1e-7
# A triangle has turned over when its area or a side, projected on the old one, is below
# this share of it.
LEAST_SHARE = 1e-6
BISECTIONS = 30
PERCEPTRON_STEPS = 40
TINY = 1e-300  # in place of a zero that is divided by


class Meshes(NamedTuple):
    """The features of all meshes, as the kernels take them; F is their number.

    Each mesh is in its own frame. M is the number of meshes, C that of cells.
    """

    kind: Any  # (F,): FACE, EDGE or VERTEX
    data: Any  # (F, COLUMNS)
    mesh: Any  # (F,): number of the mesh
    # (F, 2), begin and end. Of a face: its neighbours over gentle kinks, in `near`. Of a
    # vertex: its edges, in `rays`.
    span: Any
    # (F, 2), of a vertex: begin and end of its faces' normals, in `normals`.
    corners: Any
    near: Any  # neighbours of faces, as numbers of features
    rays: Any  # (n, 3): unit vectors along the edges of vertices, away from them
    normals: Any  # (n, 3): normals of faces, into the wall
    box: Any  # (M, 7): lower corner, upper corner, edge of a cell
    cells: Any  # (M, 4): number of cells along each axis, first cell in `begin`
    begin: Any  # (C,): first item of each cell
    items: Any  # features of each cell, one cell after another
    seen: Any  # (F,): stamp of the last search that met the feature
    stamp: Any  # (1,): number of the last search
    # (1,): how far a body's deepest point may slide over it when the body moves by 1.
    slide: Any


class MeshFeatures(NamedTuple):
    """The features of one mesh; the fields are those of `Meshes`."""

    kind: Any
    data: Any
    span: Any
    corners: Any
    near: Any
    rays: Any
    normals: Any
    box: Any
    cells: Any
    begin: Any
    items: Any


def _normalise(vectors):
    """Divide vectors (n, 3) by their lengths; none of them may be zero."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _normalise_or_zero(vectors):
    """Divide vectors (n, 3) by their lengths; zeros stay zeros."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY)


def _compute_area_vectors(vertices, faces):
    """Compute the area vectors of triangles: their outward normals times their areas.

    Parameters
    ----------
    vertices : ndarray (V, 3)
        Positions of the vertices [m].
    faces : ndarray (F, 3)
        Vertices of each triangle, counterclockwise as seen from outside.

    Returns
    -------
    ndarray (F, 3)
        The area vectors [m2].
    """
    a = vertices[faces[:, 0]]
    b = vertices[faces[:, 1]]
    c = vertices[faces[:, 2]]
    return 0.5 * np.cross(b - a, c - a)


def find_edges(faces):
    """Find the edges of a mesh and their faces.

    Parameters
    ----------
    faces : ndarray (F, 3)
        Vertices of each triangle.

    Returns
    -------
    edges : ndarray (E, 2)
        Vertices of each edge, the lower number first.
    edge_faces : ndarray (E, 2)
        The face that runs along the edge from the lower to the higher vertex, and the
        face that runs the other way; -1 stands for no face.

    Raises
    ------
    ValueError
        Where more than two faces, or two faces of opposite winding, share an edge.
    """
    # Every face runs around its three sides; two faces may share one edge.
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    side_face = np.repeat(np.arange(len(faces)), 3)
    edges, side_edge = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    side_edge = side_edge.ravel()
    # 0 where the face runs from the lower to the higher vertex, else 1
    direction = (sides[:, 0] > sides[:, 1]).astype(int)

    # each edge has at most one face in either direction
    n_faces = np.zeros((len(edges), 2), int)
    np.add.at(n_faces, (side_edge, direction), 1)
    if n_faces.max() > 1:
        edge = edges[int(np.argmax(n_faces.max(axis=1)))].tolist()
        raise ValueError(
            f"faces has several triangles on one side of edge {edge}; expected at most "
            "two triangles at an edge, both with their normals outwards"
        )
    # each side enters its face at its edge
    edge_faces = np.full((len(edges), 2), -1)
    edge_faces[side_edge, direction] = side_face
    return edges, edge_faces


def _find_coplanar_pairs(vertices, faces, edges, edge_faces, face_normals):
    """Find the pairs of faces that share an edge and lie in one plane.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`.
    face_normals : ndarray (F, 3)
        Outward unit normals.

    Returns
    -------
    first, second : ndarray (n,)
        The first and the second face of each pair.
    """
    # The edges between two faces, and a vertex of each of them.
    is_shared = (edge_faces >= 0).all(axis=1)
    first = edge_faces[is_shared, 0]
    second = edge_faces[is_shared, 1]
    edge_vertex = vertices[edges[is_shared, 0]]

    # The height of the corners of one face over the plane of the other, whichever of the
    # two is smaller: the plane of a narrow triangle is uncertain.
    height = np.full(len(first), np.inf)
    for face, other_face in ((first, second), (second, first)):
        corners = vertices[faces[other_face]] - edge_vertex[:, None]
        heights = np.abs(np.einsum("eki,ei->ek", corners, face_normals[face]))
        height = np.minimum(height, heights.max(axis=1))

    size = np.linalg.norm(np.ptp(vertices, axis=0))
    # positive where the two faces look to the same side
    cosine = np.sum(face_normals[first] * face_normals[second], axis=1)
    is_coplanar = (height < FLAT * size) & (cosine > 0.0)
    return first[is_coplanar], second[is_coplanar]


def _measure_thicknesses(vertices, faces, group, group_normals):
    """Compute how far the corners of each group of triangles spread along its normal.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    group : ndarray (F,)
        Number of the group of each triangle.
    group_normals : ndarray (G, 3)
        Unit normal of each group.

    Returns
    -------
    ndarray (G,)
        The thicknesses [m]; 0 for a flat group.
    """
    heights = np.einsum("fki,fi->fk", vertices[faces], group_normals[group])
    lowest = np.full(len(group_normals), np.inf)
    highest = np.full(len(group_normals), -np.inf)
    np.minimum.at(lowest, group, heights.min(axis=1))
    np.maximum.at(highest, group, heights.max(axis=1))
    return highest - lowest


def find_planes(vertices, faces, edges, edge_faces):
    """Find the planes of a mesh: groups of coplanar triangles.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`.

    Returns
    -------
    face_plane : ndarray (F,)
        Number of the plane of each triangle.
    plane_normals : ndarray (P, 3)
        Outward unit normal of each plane.
    """
    from scipy.sparse import coo_array, csgraph  # slow to import: where there is a mesh

    n_faces = len(faces)
    area_vectors = _compute_area_vectors(vertices, faces)
    face_normals = _normalise(area_vectors)

    # Triangles that coplanar pairs connect are a group.
    first, second = _find_coplanar_pairs(
        vertices, faces, edges, edge_faces, face_normals
    )
    connections = coo_array(
        (np.ones(len(first)), (first, second)), shape=(n_faces, n_faces)
    )
    n_groups, group = csgraph.connected_components(connections, directed=False)
    # the normal of a group is that of the sum of its area vectors
    group_normals = np.zeros((n_groups, 3))
    np.add.at(group_normals, group, area_vectors)
    group_normals = _normalise_or_zero(group_normals)

    # A group that is flat only from triangle to triangle, not as a whole, falls apart:
    # each of its triangles becomes a group with a number from `n_groups` on.
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    thicknesses = _measure_thicknesses(vertices, faces, group, group_normals)
    is_curved = (thicknesses > FLAT_GROUP * size)[group]
    group[is_curved] = n_groups + np.arange(is_curved.sum())
    normals = np.vstack([group_normals, face_normals[is_curved]])

    # The groups that still have triangles are the planes.
    groups_in_use, face_plane = np.unique(group, return_inverse=True)
    return face_plane.ravel(), normals[groups_in_use]


def _sort_planes_of_vertices(planes_at):
    """Sort pairs (vertex, plane), drop repetitions, and number those of each vertex.

    Parameters
    ----------
    planes_at : ndarray (m, 2)
        Pairs of a vertex and one of its planes, in any order.

    Returns
    -------
    pairs : ndarray (n, 2)
        The pairs, sorted, each once.
    rank : ndarray (n,)
        Number of each pair among those of its vertex.
    """
    pairs = np.unique(planes_at, axis=0)
    first = np.searchsorted(pairs[:, 0], pairs[:, 0])
    return pairs, np.arange(len(pairs)) - first


def find_inward_steps(vertices, faces, edges, edge_faces, face_plane, plane_normals):
    """Find how each vertex moves when the mesh is eroded.

    A vertex moves to a depth of 1 below all its planes, or as near to that as least
    squares give. The planes are those of the faces, then those upright on the rims.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`. A rim has one face.
    face_plane, plane_normals : ndarray (F,), (P, 3)
        Plane of each face, and normal of each plane, see `find_planes`.

    Returns
    -------
    steps : ndarray (V, 3)
        Displacement of each vertex for an edge radius of 1.
    pairs : ndarray (n, 2)
        The planes of each vertex, as pairs (vertex, plane).
    normals : ndarray (P, 3)
        Outward normals of the planes.
    """
    # A plane upright on each rim. Its normal is across the rim, out of the face; the
    # face runs along the rim or against it.
    rims = np.flatnonzero((edge_faces < 0).any(axis=1))
    rim_faces = edge_faces[rims].max(axis=1)
    along = _normalise(vertices[edges[rims, 1]] - vertices[edges[rims, 0]])
    along[edge_faces[rims, 0] < 0] *= -1.0
    rim_normals = np.cross(along, plane_normals[face_plane[rim_faces]])
    normals = np.vstack([plane_normals, rim_normals])

    # A vertex has the planes of its faces and those of its rims.
    rim_planes = len(plane_normals) + np.arange(len(rims))
    at_corners = [np.column_stack([faces[:, k], face_plane]) for k in range(3)]
    at_rim_ends = [np.column_stack([edges[rims, k], rim_planes]) for k in range(2)]
    pairs, rank = _sort_planes_of_vertices(np.vstack(at_corners + at_rim_ends))

    # One linear system for each vertex: each of its normals times the step is -1. Rows
    # of zeros fill up the systems of vertices with fewer planes than others.
    systems = np.zeros((len(vertices), rank.max() + 1, 3))
    systems[pairs[:, 0], rank] = normals[pairs[:, 1]]
    depths = np.any(systems != 0.0, axis=2).astype(float)
    inverses = np.linalg.pinv(systems, rcond=SAME_NORMAL)
    return -np.einsum("vij,vj->vi", inverses, depths), pairs, normals


def _compute_areas_and_sides(vertices, faces):
    """Compute the area vectors and the three sides of all triangles (4 F, 3).

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    """
    sides = [vertices[faces[:, k]] - vertices[faces[:, k - 1]] for k in range(3)]
    return np.vstack([_compute_area_vectors(vertices, faces), *sides])


def _keeps_triangles(vertices, faces, displacement):
    """Return whether no triangle turns over when the vertices of a mesh are displaced.

    A triangle has turned over when its area vector or a side, projected on the old one,
    is too short or points the other way.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    displacement : ndarray (V, 3)
        Displacement of each vertex [m].
    """
    original = _compute_areas_and_sides(vertices, faces)
    displaced = _compute_areas_and_sides(vertices + displacement, faces)
    projected = np.sum(original * displaced, axis=1)
    return bool(np.all(projected > LEAST_SHARE * np.sum(original * original, axis=1)))


def _find_largest_radius(vertices, faces, steps, radius):
    """Find the largest edge radius with which no triangle turns over, by bisection.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    steps : ndarray (V, 3)
        Displacement of each vertex for an edge radius of 1.
    radius : float
        An edge radius that is too large [m].

    Returns
    -------
    float
        The radius [m].
    """
    # no triangle turns over with `low`, one does with `high`
    low = 0.0
    high = radius
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _keeps_triangles(vertices, faces, middle * steps):
            low = middle
        else:
            high = middle
    return low


def erode_mesh(vertices, faces, steps, radius):
    """Return the vertices of the mesh eroded by an edge radius: those of the core.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    steps : ndarray (V, 3)
        Displacement of each vertex for a radius of 1, see `find_inward_steps`.
    radius : float
        The edge radius [m].

    Returns
    -------
    ndarray (V, 3)
        The positions of the vertices [m].

    Raises
    ------
    ValueError
        Where a triangle would turn over; the message says the largest possible radius.
    """
    if not _keeps_triangles(vertices, faces, radius * steps):
        largest = _find_largest_radius(vertices, faces, steps, radius)
        raise ValueError(
            f"edge_radius_m is {radius!r}; expected below {largest:.3g}, "
            "the smallest triangles leave no room for more"
        )
    return vertices + radius * steps


def _make_face_rows(core, faces, edges, edge_faces, face_plane, plane_normals, radius):
    """Make the rows of `Meshes.data` of the faces.

    Parameters
    ----------
    core, faces : ndarray (V, 3), (F, 3)
        Positions of the eroded vertices [m], and vertices of each triangle.
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`.
    face_plane, plane_normals : ndarray (F,), (P, 3)
        Plane of each face, and outward normal of each plane.
    radius : float
        Edge radius [m]: the wall lies this far above the eroded faces.

    Returns
    -------
    ndarray (F, COLUMNS)
    """
    rows = np.zeros((len(faces), COLUMNS))
    outward = plane_normals[face_plane]
    # normals in the engine point from the body into the wall
    rows[:, FACE_NORMAL : FACE_NORMAL + 3] = -outward
    # All faces of a plane have the offset of one of them, bit for bit.
    plane_offsets = np.zeros(len(plane_normals))
    plane_offsets[face_plane] = -np.sum(core[faces[:, 0]] * outward, axis=1) - radius
    rows[:, FACE_OFFSET] = plane_offsets[face_plane]
    _write_sides(rows, core, edges, edge_faces, outward)
    return rows


def _sort_edges_by_face(edge_face):
    """Sort edges by their face; edges without a face are left out.

    Parameters
    ----------
    edge_face : ndarray (E,)
        Face of each edge, or -1.

    Returns
    -------
    edge, face : ndarray (n,)
        Number of each edge, and its face.
    number : ndarray (n,)
        Number of each edge among those of its face.
    """
    edge = np.flatnonzero(edge_face >= 0)
    edge = edge[np.argsort(edge_face[edge], kind="stable")]
    face = edge_face[edge]
    first_of_face = np.searchsorted(face, face)
    return edge, face, np.arange(len(face)) - first_of_face


def _write_sides(rows, core, edges, edge_faces, outward):
    """Write the three sides of each face to its row of `Meshes.data`.

    Parameters
    ----------
    rows : ndarray (F, COLUMNS)
        Overwritten.
    core : ndarray (V, 3)
        Positions of the eroded vertices [m].
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`.
    outward : ndarray (F, 3)
        Outward unit normals of the faces.
    """
    along = _normalise(core[edges[:, 1]] - core[edges[:, 0]])
    n_sides = np.zeros(len(rows), int)  # sides of each face that are written
    # First the edges along which a face runs, then those against which it runs. The
    # inside of the face is to the left of the former and to the right of the latter.
    for direction, sign in ((0, 1.0), (1, -1.0)):
        edge, face, number = _sort_edges_by_face(edge_faces[:, direction])
        side = n_sides[face] + number
        # the normal of the edge in the plane of the face, to the left of the edge
        left = np.cross(outward[face], along[edge])
        offset = np.sum(left * core[edges[edge, 0]], axis=1)

        # the side's inward normal, and its offset along it
        column = SIDES + SIDE_COLUMNS * side
        for axis in range(3):
            rows[face, column + axis] = sign * left[:, axis]
        rows[face, column + 3] = sign * offset
        # points on an edge belong to the face that runs along it
        rows[face, STRICT + side] = float(direction)
        np.add.at(n_sides, face, 1)


def _make_edge_rows(core, edges, edge_faces, face_plane, plane_normals):
    """Make the rows of `Meshes.data` of the convex edges and rims.

    Parameters
    ----------
    core : ndarray (V, 3)
        Positions of the eroded vertices [m].
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`. A rim has one face, and -1 in
        place of the other.
    face_plane, plane_normals : ndarray (F,), (P, 3)
        Plane of each face, and outward normal of each plane.

    Returns
    -------
    ndarray (n, COLUMNS)
    """
    start = core[edges[:, 0]]
    difference = core[edges[:, 1]] - start
    length = np.linalg.norm(difference, axis=1)
    along = difference / length[:, None]

    # The normals of the faces on both sides, into the wall. A rim has one face, which
    # stands for both.
    left = edge_faces[:, 0]
    right = edge_faces[:, 1]
    is_rim = (left < 0) | (right < 0)
    first_face = np.where(left >= 0, left, right)
    second_face = np.where(right >= 0, right, left)
    first_normal = -plane_normals[face_plane[first_face]]
    second_normal = -plane_normals[face_plane[second_face]]

    # The angle between these normals; its sine is positive where the edge is convex.
    cross = np.cross(first_normal, second_normal)
    sine = np.sum(cross * along, axis=1)
    cosine = np.sum(first_normal * second_normal, axis=1)
    angle = np.arctan2(np.linalg.norm(cross, axis=1), cosine)
    is_kink = (face_plane[left] != face_plane[right]) & (angle > LEAST_ANGLE)
    is_convex = is_rim | (is_kink & (sine > 0.0))
    angle[is_rim] = np.pi  # rounded down to the back of the face

    # The normal turns inwards from the face on the left. On a rim whose face is on the
    # right it turns the other way.
    sign = np.where(left >= 0, 1.0, -1.0)
    turn = _normalise(np.cross(-first_normal, along)) * sign[:, None]

    # edges between coplanar faces and concave edges are no features
    rows = np.zeros((is_convex.sum(), COLUMNS))
    rows[:, PLACE : PLACE + 3] = start[is_convex]
    rows[:, EDGE_ALONG : EDGE_ALONG + 3] = along[is_convex]
    rows[:, EDGE_LENGTH] = length[is_convex]
    rows[:, EDGE_NORMAL : EDGE_NORMAL + 3] = first_normal[is_convex]
    rows[:, EDGE_TURN : EDGE_TURN + 3] = turn[is_convex]
    rows[:, EDGE_ANGLE] = angle[is_convex]
    return rows


def _find_ranges(owner, n):
    """Find where the items of each owner lie in a list sorted by owners.

    Parameters
    ----------
    owner : ndarray (items,)
        Number of the owner of each item, in increasing order.
    n : int
        Number of owners; some may have no item.

    Returns
    -------
    ndarray (n, 2)
        Begin and end of each owner's items.
    """
    numbers = np.arange(n)
    begin = np.searchsorted(owner, numbers, "left")
    end = np.searchsorted(owner, numbers, "right")
    return np.column_stack([begin, end])


def _compute_leads(directions, ray_vertex, rays):
    """Compute how much each ray leads along the direction of its vertex.

    Parameters
    ----------
    directions : ndarray (V, 3)
        A direction for each vertex.
    ray_vertex, rays : ndarray (R,), (R, 3)
        Vertex and unit vector of each ray; a vertex may have several.

    Returns
    -------
    lead : ndarray (R,)
        Component of each ray along the direction of its vertex.
    largest : ndarray (V,)
        The largest lead of each vertex; -inf for a vertex without rays.
    """
    lead = np.sum(directions[ray_vertex] * rays, axis=1)
    # the largest lead of each vertex
    largest = np.full(len(directions), -np.inf)
    np.maximum.at(largest, ray_vertex, lead)
    return lead, largest


def _turn_from_rays(directions, ray_vertex, rays):
    """Turn the direction of each vertex until all its rays recede from it, if possible.

    Perceptron steps: each one turns a direction away from the ray that leads most.

    Parameters
    ----------
    directions : ndarray (V, 3)
        A unit vector for each vertex; it is overwritten.
    ray_vertex, rays : ndarray (R,), (R, 3)
        Vertex and unit vector of each ray; a vertex may have several.

    Returns
    -------
    ndarray (V, 3)
        The unit vectors after the last step.
    """
    for _ in range(PERCEPTRON_STEPS):
        lead, largest = _compute_leads(directions, ray_vertex, rays)
        # of each vertex the ray that leads most, if it does not recede
        is_worst = (lead == largest[ray_vertex]) & (lead > -LEAST_CONE)
        if not is_worst.any():
            break
        step = (lead[is_worst, None] + 1e-3) * rays[is_worst]
        directions[ray_vertex[is_worst]] -= step
        directions = _normalise_or_zero(directions)
    return directions


def _find_convex_vertices(core, edges, pairs, normals):
    """Find the vertices that have a set of normals of their own.

    These are the vertices with a direction that all their edges recede from.

    Parameters
    ----------
    core : ndarray (V, 3)
        Positions of the vertices [m].
    edges : ndarray (E, 2)
        Vertices of each edge.
    pairs, normals : ndarray
        The planes of each vertex and their normals, see `find_inward_steps`.

    Returns
    -------
    convex_vertices : ndarray
        Numbers of these vertices.
    ray_vertex : ndarray (2 E,)
        Vertices, sorted; one item for each edge at a vertex.
    rays : ndarray (2 E, 3)
        Direction of that edge, away from the vertex.
    """
    # each edge is a ray from either of its ends to the other
    near_end = edges.ravel()
    far_end = edges[:, ::-1].ravel()
    order = np.argsort(near_end, kind="stable")
    ray_vertex = near_end[order]
    rays = _normalise(core[far_end] - core[near_end])[order]

    # The search begins with the sum of the normals of a vertex.
    sums = np.zeros((len(core), 3))
    np.add.at(sums, pairs[:, 0], normals[pairs[:, 1]])
    directions = _turn_from_rays(_normalise_or_zero(sums), ray_vertex, rays)

    # convex: every ray recedes from the direction that was found
    _lead, largest = _compute_leads(directions, ray_vertex, rays)
    has_edges = np.isfinite(largest)
    convex_vertices = np.flatnonzero((largest < -LEAST_CONE) & has_edges)
    return convex_vertices, ray_vertex, rays


def _find_gentle_neighbours(core, faces, face_plane, plane_normals):
    """Find faces that share a vertex and meet in a concave kink below GENTLE.

    Parameters
    ----------
    core, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    face_plane, plane_normals : ndarray (F,), (P, 3)
        Plane of each face, and outward normal of each plane.

    Returns
    -------
    ndarray (K, 2)
        Pairs of faces, sorted; each pair in both orders.
    """
    from scipy.sparse import coo_array

    # A matrix of faces and vertices. Its product with its transpose is not zero for two
    # faces that share a vertex.
    n_faces = len(faces)
    rows = np.repeat(np.arange(n_faces), 3)
    columns = faces.ravel()
    has_vertex = coo_array(
        (np.ones(3 * n_faces), (rows, columns)), shape=(n_faces, len(core))
    ).tocsr()
    pairs = np.column_stack((has_vertex @ has_vertex.T).nonzero())

    # Gentle: the planes differ, and their normals differ by a small angle.
    outward = plane_normals[face_plane]
    first, second = pairs.T
    cosine = np.sum(outward[first] * outward[second], axis=1)
    is_kink = face_plane[first] != face_plane[second]
    pairs = pairs[is_kink & (cosine > np.cos(GENTLE))]

    # Concave: the middle of the second face is above the plane of the first.
    first, second = pairs.T
    middle = core[faces].mean(axis=1)
    corner = core[faces[:, 0]]
    height = np.sum((middle[second] - corner[first]) * outward[first], axis=1)
    size = np.linalg.norm(np.ptp(core, axis=0))
    pairs = pairs[height > FLAT * size]
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def _split_bent_planes(core, vertices, faces, face_plane, plane_normals, radius):
    """Give triangles planes of their own where the erosion has bent their plane.

    A plane is bent when its corners are not all one edge radius below it.

    Parameters
    ----------
    core, vertices : ndarray (V, 3)
        Positions of the vertices after and before the erosion [m].
    faces : ndarray (F, 3)
        Vertices of each triangle.
    face_plane, plane_normals : ndarray (F,), (P, 3)
        Plane of each face, and outward normal of each plane, before the erosion.
    radius : float
        Edge radius [m].

    Returns
    -------
    face_plane, plane_normals : ndarray (F,), (Q, 3)
        The same with the new planes at the end.
    """
    displacement = core - vertices
    # how far each corner has moved along the normal of its plane
    heights = np.einsum("fki,fi->fk", displacement[faces], plane_normals[face_plane])
    errors = np.abs(heights + radius).max(axis=1)
    # one corner with another depth bends the whole plane
    is_bent = np.zeros(len(plane_normals), bool)
    is_bent[face_plane[errors > SAME_DEPTH * radius]] = True

    # The triangles of bent planes get new planes, numbered on from the old ones.
    is_loose = is_bent[face_plane]
    new_planes = len(plane_normals) + np.cumsum(is_loose) - 1
    new_normals = _normalise(_compute_area_vectors(core, faces[is_loose]))
    face_plane = np.where(is_loose, new_planes, face_plane)
    return face_plane, np.vstack([plane_normals, new_normals])


def split(vertices, faces, radius):
    """Find the features of a mesh.

    Parameters
    ----------
    vertices : ndarray (V, 3)
        Positions of the vertices [m].
    faces : ndarray (F, 3)
        Vertices of each triangle, counterclockwise as seen from outside.
    radius : float
        Edge radius [m].

    Returns
    -------
    MeshFeatures
        The features: faces, then edges, then vertices.

    Raises
    ------
    ValueError
        Where the triangles are no surface, or leave no room for the edge radius.
    """
    edges, edge_faces = find_edges(faces)
    face_plane, plane_normals = find_planes(vertices, faces, edges, edge_faces)
    steps, pairs, normals = find_inward_steps(
        vertices, faces, edges, edge_faces, face_plane, plane_normals
    )
    core = erode_mesh(vertices, faces, steps, radius)
    face_plane, plane_normals = _split_bent_planes(
        core, vertices, faces, face_plane, plane_normals, radius
    )

    # The rows of all features.
    face_rows = _make_face_rows(
        core, faces, edges, edge_faces, face_plane, plane_normals, radius
    )
    edge_rows = _make_edge_rows(core, edges, edge_faces, face_plane, plane_normals)
    convex_vertices, ray_vertex, rays = _find_convex_vertices(
        core, edges, pairs, normals
    )
    vertex_rows = np.zeros((len(convex_vertices), COLUMNS))
    vertex_rows[:, PLACE : PLACE + 3] = core[convex_vertices]
    data = np.concatenate([face_rows, edge_rows, vertex_rows])
    data[:, RADIUS_COLUMN] = radius
    n_faces = len(face_rows)
    n_edges = len(edge_rows)
    n_vertices = len(vertex_rows)
    kind = np.repeat([FACE, EDGE, VERTEX], [n_faces, n_edges, n_vertices])
    kind = kind.astype(np.uint8)

    # The neighbours of faces, and the edges and normals of vertices.
    span = np.zeros((len(data), 2), np.int64)
    corners = np.zeros((len(data), 2), np.int64)
    neighbours = _find_gentle_neighbours(core, faces, face_plane, plane_normals)
    first_vertex = n_faces + n_edges
    span[:n_faces] = _find_ranges(neighbours[:, 0], n_faces)
    span[first_vertex:] = _find_ranges(ray_vertex, len(core))[convex_vertices]
    planes_at = np.column_stack([faces.ravel(), np.repeat(face_plane, 3)])
    planes_at = np.unique(planes_at, axis=0)
    corners[first_vertex:] = _find_ranges(planes_at[:, 0], len(core))[convex_vertices]
    box, cells, begin, items = _sort_into_cells(core, faces, kind, data, radius)
    return MeshFeatures(
        kind=kind,
        data=data,
        span=span,
        corners=corners,
        near=neighbours[:, 1].astype(np.int64),
        rays=rays,
        normals=-plane_normals[planes_at[:, 1]],
        box=box,
        cells=cells,
        begin=begin,
        items=items,
    )


def _make_boxes(core, faces, data, radius):
    """Compute the lower and upper corners of the boxes of all features.

    Parameters
    ----------
    core, faces : ndarray (V, 3), (F, 3)
        Positions of the eroded vertices [m], and vertices of each triangle.
    data : ndarray (n, COLUMNS)
        The features: faces first, then edges and vertices, see `Meshes`.
    radius : float
        Edge radius [m].

    Returns
    -------
    lower, upper : ndarray (n, 3)
        The corners [m].
    """
    face_rows = data[: len(faces)]
    other_rows = data[len(faces) :]
    # a face's wall lies one radius above its triangle
    inward = face_rows[:, None, FACE_NORMAL : FACE_NORMAL + 3]
    corners = core[faces] - radius * inward
    # an edge is a cylinder from its start to its end; a vertex has the length 0
    start = other_rows[:, PLACE : PLACE + 3]
    along = other_rows[:, EDGE_ALONG : EDGE_ALONG + 3]
    end = start + other_rows[:, EDGE_LENGTH, None] * along
    # the corners of faces, then those of edges and vertices
    lower = [corners.min(axis=1), np.minimum(start, end) - radius]
    upper = [corners.max(axis=1), np.maximum(start, end) + radius]
    return np.concatenate(lower), np.concatenate(upper)


def _sort_into_cells(core, faces, kind, data, radius):
    """Divide the mesh's box into cells, about as many as there are features.

    Parameters
    ----------
    core, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    kind, data : ndarray (n,), (n, COLUMNS)
        The features, see `Meshes`.
    radius : float
        Edge radius [m].

    Returns
    -------
    box : ndarray (7,)
        Lower corner, upper corner, edge of a cell.
    n_cells : ndarray (3,)
        Number of cells along each axis.
    begin : ndarray
        First item of each cell, and the end of the last one.
    items : ndarray
        The features that reach into each cell, one cell after another.
    """
    low, high = _make_boxes(core, faces, data, radius)
    lower = low.min(axis=0)
    upper = high.max(axis=0)
    # a flat mesh gets a box with some thickness
    size = np.maximum(upper - lower, 1e-3 * np.max(upper - lower))
    cell = float((size.prod() / len(kind)) ** (1.0 / 3.0))
    # a little room for rounding
    lower = lower - 1e-6 * cell
    upper = upper + 1e-6 * cell
    n_cells = np.maximum(np.ceil((upper - lower) / cell), 1).astype(np.int64)

    # Count the features of each cell, then write them. The list of a cell begins where
    # that of the cell before ends.
    count = np.zeros(int(n_cells.prod()) + 1, np.int64)
    no_items = np.zeros(0, np.int64)
    put_in_cells(low, high, kind, data, lower, cell, n_cells, count, no_items)
    begin = np.concatenate([[0], np.cumsum(count[:-1])])
    items = np.zeros(max(int(begin[-1]), 1), np.int64)
    next_item = begin[:-1].copy()
    put_in_cells(low, high, kind, data, lower, cell, n_cells, next_item, items)
    return np.concatenate([lower, upper, [cell]]), n_cells, begin, items


@inlined
def find_cell(place, lower, cell):
    """Return the indices along each axis of the cell in which a place lies.

    Parameters
    ----------
    place, lower : array (3,)
        The place, and the lower corner of the cells [m].
    cell : float
        Edge of a cell [m].
    """
    i = int((place[0] - lower[0]) / cell)
    j = int((place[1] - lower[1]) / cell)
    k = int((place[2] - lower[2]) / cell)
    return i, j, k


@inlined
def plane_misses_cell(face, lower, cell, i, j, k):
    """Return whether the plane of a face misses a cell.

    Parameters
    ----------
    face : array
        The row of the face in `Meshes.data`.
    lower : array (3,)
        Lower corner of the cells [m].
    cell : float
        Edge of a cell [m].
    i, j, k : int
        Indices of the cell along the three axes.
    """
    nx = face[FACE_NORMAL]
    ny = face[FACE_NORMAL + 1]
    nz = face[FACE_NORMAL + 2]
    # the distance of the cell's middle from the plane, and of its farthest corner
    x = lower[0] + (i + 0.5) * cell
    y = lower[1] + (j + 0.5) * cell
    z = lower[2] + (k + 0.5) * cell
    distance = abs(nx * x + ny * y + nz * z - face[FACE_OFFSET])
    # how far the farthest corner is from the middle along the normal, and a little more
    # for rounding
    reach = 0.500001 * cell * (abs(nx) + abs(ny) + abs(nz))
    return distance > reach


@kernel
def put_in_cells(low, high, kind, data, lower, cell, n_cells, place, items):
    """Count the features of each cell, or write them to the lists of the cells.

    It is called twice: first with an empty `items`, to count.

    Parameters
    ----------
    low, high : array (n, 3)
        Corners of the features' boxes [m].
    kind, data : array
        The features, see `Meshes`.
    lower, cell, n_cells : array (3,), float, array (3,)
        Lower corner of the cells [m], their edge [m], and their number along each axis.
    place : array
        Of each cell the place of its next item; it grows by one with each item.
    items : array
        Is written, unless it is empty.
    """
    for feature in range(low.shape[0]):
        # the block of cells that the box of the feature meets
        i0, j0, k0 = find_cell(low[feature], lower, cell)
        i1, j1, k1 = find_cell(high[feature], lower, cell)
        is_face = kind[feature] == FACE
        for i in range(i0, min(i1 + 1, n_cells[0])):
            for j in range(j0, min(j1 + 1, n_cells[1])):
                for k in range(k0, min(k1 + 1, n_cells[2])):
                    # a slanting face misses most cells of its box
                    if is_face and plane_misses_cell(
                        data[feature], lower, cell, i, j, k
                    ):
                        continue
                    # the first call only counts, the second one writes
                    number = (i * n_cells[1] + j) * n_cells[2] + k
                    if items.shape[0] > 0:
                        items[place[number]] = feature
                    place[number] += 1


def _find_first_rows(parts, name):
    """Return where an array of each part begins in the joined array, and its end.

    `name` is the field of `MeshFeatures`.
    """
    lengths = [len(getattr(part, name)) for part in parts]
    return np.cumsum([0, *lengths])


def _join_arrays(parts, name):
    """Return the arrays of one field (`name`) of all parts, one after another."""
    return np.concatenate([getattr(part, name) for part in parts])


def _join_shifted(parts, name, begins):
    """Join arrays of numbers of rows; the numbers count on from part to part.

    Parameters
    ----------
    parts : sequence of MeshFeatures
        The features of each mesh.
    name : str
        The field of `MeshFeatures` with these arrays.
    begins : ndarray
        Where the rows of each part begin in the joined array that the numbers refer to.

    Returns
    -------
    ndarray
        The arrays of all parts, one after another.
    """
    arrays = []
    for part, begin in zip(parts, begins, strict=False):
        arrays.append(getattr(part, name) + begin)
    return np.concatenate(arrays)


def join(parts, slide):
    """Put the features of several meshes together, as the kernels need them.

    Numbers that refer to rows of an array of one mesh are raised by the number of rows
    that the meshes before it have.

    Parameters
    ----------
    parts : sequence of MeshFeatures
        The features of each mesh.
    slide : float
        See `Meshes.slide`.

    Returns
    -------
    Meshes
        The features of all meshes.
    """
    feature_begins = _find_first_rows(parts, "kind")
    ray_begins = _find_first_rows(parts, "rays")
    near_begins = _find_first_rows(parts, "near")
    cell_begins = _find_first_rows(parts, "begin")
    # the spans of vertices are places in `rays`, all others in `near`
    spans = []
    for number, part in enumerate(parts):
        begin = np.where(part.kind == VERTEX, ray_begins[number], near_begins[number])
        spans.append(part.span + begin[:, None])
    n_features = feature_begins[-1]
    return Meshes(
        kind=_join_arrays(parts, "kind"),
        data=_join_arrays(parts, "data"),
        mesh=np.repeat(np.arange(len(parts)), np.diff(feature_begins)),
        span=np.concatenate(spans),
        corners=_join_shifted(parts, "corners", _find_first_rows(parts, "normals")),
        near=_join_shifted(parts, "near", feature_begins),
        rays=_join_arrays(parts, "rays"),
        normals=_join_arrays(parts, "normals"),
        box=np.array([part.box for part in parts]),
        cells=np.column_stack([[part.cells for part in parts], cell_begins[:-1]]),
        begin=_join_shifted(parts, "begin", _find_first_rows(parts, "items")),
        items=_join_shifted(parts, "items", feature_begins),
        seen=np.zeros(n_features, np.int64),
        stamp=np.zeros(1, np.int64),
        slide=np.array([slide]),
    )
