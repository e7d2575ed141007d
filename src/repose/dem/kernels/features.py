"""Faces, edges and vertices of a mesh that bodies can touch, in a grid of cells.

Features are faces, convex edges and convex vertices. The mesh is *eroded* by the edge
radius: every vertex moves inwards until it lies this deep below all its faces. The
eroded mesh is called the core. The wall is the core dilated by the edge radius.
Dilation returns the faces to their old positions, and turns edges into cylinders and
vertices into spheres that are tangent to the faces. For any mesh, the normals of
neighbouring features fit together without gaps or overlaps. Edges between coplanar
triangles and concave edges have no set of normals of their own, so they are not
features. An open border is called a rim. It is rounded down to the back of its face.

`find_features` returns the features of one mesh as a `MeshFeatures`. `join_features`
joins those of all meshes into a `Meshes`, which is passed to the kernels. Only
`put_in_cells` is compiled.

V, F and E are the numbers of vertices, faces and edges of a mesh. A *plane* is a group
of coplanar triangles with a common outward unit normal. Each rim has an additional
plane, which stands upright on its face.
"""

from typing import Any, NamedTuple

import numpy as np

from .jit import inlined, kernel

FACE, EDGE, VERTEX = range(3)  # values of `Meshes.kind`

# Columns of `Meshes.data`. Normals point into the wall.
COLUMNS = 20
# A face has its normal (3), the offset along the normal, and three sides of four
# columns each: the inward normal in the plane of the face (3), and the offset along
# that. Then follows a flag for each side, whether a point on this side belongs to the
# neighbour.
FACE_NORMAL, FACE_OFFSET = 0, 3
SIDES, SIDE_COLUMNS = 4, 4
STRICT = 16
# An edge has its start (3), the unit vector along it (3), its length, the normal of the
# first face (3), the unit vector towards which this normal turns (3), and the angle
# that all normals span [rad].
EDGE_ALONG, EDGE_LENGTH, EDGE_NORMAL, EDGE_TURN, EDGE_ANGLE = 3, 6, 7, 10, 13
PLACE = 0  # (3), start of an edge or position of a vertex
RADIUS_COLUMN = 19  # edge radius, of every feature

# Two triangles may be coplanar if their corners are this near to each other's plane, as
# a fraction of the mesh's size. A whole group of them is one plane if it is no thicker
# than the second fraction.
FLAT, FLAT_GROUP = 1e-6, 1e-5
# If the normals of a vertex differ by less than this (in terms of singular values),
# they do not determine where the vertex moves.
SAME_NORMAL = 0.01
# A group of coplanar triangles keeps its plane if its corners lie one edge radius below
# it, to within this fraction of the radius.
SAME_DEPTH = 1e-5
# If faces meet in a concave kink of less than this angle [rad], a body touches only the
# face with the largest overlap.
GENTLE = 0.35
# An edge between planes is not a feature below this angle [rad].
LEAST_ANGLE = 1e-9
# Margin (a sine) by which a direction must lie within a vertex's set of normals.
LEAST_CONE = 1e-7
# A triangle has turned over if its area vector or a side, projected on the old one, is
# below this fraction of the old one.
LEAST_SHARE = 1e-6
BISECTIONS = 30  # find the largest edge radius to a billionth of the requested one
PERCEPTRON_STEPS = 40  # attempts to find a direction from which all edges recede
PERCEPTRON_MARGIN = 1e-3  # how far a step goes beyond the perpendicular to a ray
LEAST_THICKNESS = 1e-3  # of the grid of cells, as a fraction of its longest side
GRID_MARGIN = 1e-6  # room for rounding around the grid, as a fraction of a cell's edge
HALF_CELL = 0.500001  # half the edge of a cell, with a margin for rounding
TINY = 1e-300  # divisor in place of a zero


class Meshes(NamedTuple):
    """The features of all meshes in the form that the kernels use; F is their number.

    Each mesh is in its own frame. M is the number of meshes, C that of cells.
    """

    kind: Any  # (F,): FACE, EDGE or VERTEX
    data: Any  # (F, COLUMNS)
    mesh: Any  # (F,): number of the mesh
    # (F, 2): begin and end of a range. For a face, the range is that of its neighbours
    # over gentle kinks in `near`. For a vertex, it is that of its edges in `rays`.
    span: Any
    # (F, 2): for a vertex, begin and end of the range of its faces' normals in
    # `normals`.
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
    """The features of one mesh. `Meshes` describes the fields."""

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
    """Return unit vectors along `vectors` (n, 3), none of which may be zero."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _normalise_or_zero(vectors):
    """Return unit vectors along `vectors` (n, 3). Vectors of zeros stay zeros."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY)


def _compute_area_vectors(vertices, faces):
    """Compute the area vectors of triangles: outward unit normals times areas.

    Parameters
    ----------
    vertices : ndarray (V, 3)
        Positions of the vertices [m].
    faces : ndarray (F, 3)
        Vertices of each triangle, counterclockwise when viewed from outside.

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
    """Find the edges of a mesh and the faces on either side of them.

    Each face lists its vertices in order. Two neighbouring faces with their normals to
    the same side traverse their common edge in opposite directions.

    Parameters
    ----------
    faces : ndarray (F, 3)
        Vertices of each triangle.

    Returns
    -------
    edges : ndarray (E, 2)
        Vertices of each edge, the lower number first.
    edge_faces : ndarray (E, 2)
        The face that traverses the edge from the lower to the higher vertex, and the
        face that traverses it the other way; -1 if there is no such face.

    Raises
    ------
    ValueError
        If more than two faces, or two faces of opposite winding, share an edge.
    """
    # Each face has three sides. Two sides of different faces may be the same edge.
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    side_face = np.repeat(np.arange(len(faces)), 3)
    edges, side_edge = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    # The shape of this result depends on the version of NumPy.
    side_edge = side_edge.ravel()
    # 0 if the side runs from the lower to the higher vertex, otherwise 1
    direction = (sides[:, 0] > sides[:, 1]).astype(int)

    # At most one face may traverse an edge in each direction. n_faces[edge, direction]
    # is their number; `np.add.at` also counts repeated indices.
    n_faces = np.zeros((len(edges), 2), int)
    np.add.at(n_faces, (side_edge, direction), 1)
    if n_faces.max() > 1:
        edge = edges[int(np.argmax(n_faces.max(axis=1)))].tolist()
        raise ValueError(
            f"faces has several triangles on one side of edge {edge}; expected at most "
            "two triangles at an edge, both with their normals outwards"
        )
    # Enter the face of each side in the row of its edge.
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
    # Select the edges between two faces, with one vertex of each edge.
    is_shared = (edge_faces >= 0).all(axis=1)
    first = edge_faces[is_shared, 0]
    second = edge_faces[is_shared, 1]
    edge_vertex = vertices[edges[is_shared, 0]]

    # Compute how far the corners of one face lie from the plane of the other. Of the
    # two values, the smaller one counts: if one triangle is narrow, its normal is
    # inaccurate, and only the plane of the wider one is reliable. In `einsum`, e is a
    # pair of faces, k a corner and i an axis.
    distance = np.full(len(first), np.inf)
    for face, other_face in ((first, second), (second, first)):
        corners = vertices[faces[other_face]] - edge_vertex[:, None]
        corner_distances = np.abs(np.einsum("eki,ei->ek", corners, face_normals[face]))
        distance = np.minimum(distance, corner_distances.max(axis=1))

    mesh_size = np.linalg.norm(np.ptp(vertices, axis=0))
    # The cosine is positive if both faces are oriented to the same side.
    cosine = np.sum(face_normals[first] * face_normals[second], axis=1)
    # FLAT is the largest distance, as a fraction of the mesh's size.
    is_coplanar = (distance < FLAT * mesh_size) & (cosine > 0.0)
    return first[is_coplanar], second[is_coplanar]


def _measure_thicknesses(vertices, faces, group, group_normals):
    """Measure how thick each group of triangles is along its normal.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    group : ndarray (F,)
        Index of the group of each triangle.
    group_normals : ndarray (G, 3)
        Unit normal of each group.

    Returns
    -------
    ndarray (G,)
        Distance between the lowest and the highest corner [m]; 0 for a flat group.
    """
    heights = np.einsum("fki,fi->fk", vertices[faces], group_normals[group])
    lowest = np.full(len(group_normals), np.inf)
    highest = np.full(len(group_normals), -np.inf)
    np.minimum.at(lowest, group, heights.min(axis=1))
    np.maximum.at(highest, group, heights.max(axis=1))
    return highest - lowest


def find_planes(vertices, faces, edges, edge_faces):
    """Find the planes of a mesh: groups of connected coplanar triangles.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`.

    Returns
    -------
    face_plane : ndarray (F,)
        Index of the plane of each triangle.
    plane_normals : ndarray (P, 3)
        Outward unit normal of each plane.
    """
    from scipy.sparse import coo_array, csgraph  # slow to import, so only for a mesh

    n_faces = len(faces)
    area_vectors = _compute_area_vectors(vertices, faces)
    face_normals = _normalise(area_vectors)

    # Triangles that are connected by coplanar pairs form a group.
    first, second = _find_coplanar_pairs(
        vertices, faces, edges, edge_faces, face_normals
    )
    connections = coo_array(
        (np.ones(len(first)), (first, second)), shape=(n_faces, n_faces)
    )
    n_groups, group = csgraph.connected_components(connections, directed=False)
    # The normal of a group is the direction of the sum of its area vectors. `np.add.at`
    # also adds for repeated indices.
    group_normals = np.zeros((n_groups, 3))
    np.add.at(group_normals, group, area_vectors)
    group_normals = _normalise_or_zero(group_normals)

    # A group may be curved as a whole although each triangle is coplanar with its
    # neighbours: it is thicker than FLAT_GROUP times the mesh's size. Such a group is
    # split up, and each triangle becomes a group of its own. The new groups are
    # numbered from `n_groups` on.
    mesh_size = np.linalg.norm(np.ptp(vertices, axis=0))
    thicknesses = _measure_thicknesses(vertices, faces, group, group_normals)
    is_curved = (thicknesses > FLAT_GROUP * mesh_size)[group]
    group[is_curved] = n_groups + np.arange(is_curved.sum())
    normals = np.vstack([group_normals, face_normals[is_curved]])

    # The planes are the groups that still have triangles, numbered from 0 again.
    groups_in_use, face_plane = np.unique(group, return_inverse=True)
    return face_plane.ravel(), normals[groups_in_use]


def _sort_planes_of_vertices(vertex_planes):
    """Sort pairs (vertex, plane), drop duplicates, and number each vertex's planes.

    Parameters
    ----------
    vertex_planes : ndarray (m, 2)
        Pairs of a vertex and one of its planes, in any order.

    Returns
    -------
    unique_pairs : ndarray (n, 2)
        The pairs, sorted, without duplicates.
    rank : ndarray (n,)
        Position of each pair among the pairs of its vertex, counted from 0.
    """
    unique_pairs = np.unique(vertex_planes, axis=0)
    # Index of the first pair of the same vertex
    first = np.searchsorted(unique_pairs[:, 0], unique_pairs[:, 0])
    return unique_pairs, np.arange(len(unique_pairs)) - first


def compute_inward_displacements(
    vertices, faces, edges, edge_faces, face_plane, plane_normals
):
    """Compute the displacement of each vertex when the mesh is eroded by a radius of 1.

    Erosion moves the surface inwards by the radius. Each vertex moves to a depth of 1
    below all its planes. If its planes do not meet in a point of this depth, the
    displacement is the least-squares solution. A rim is an open edge, which has only
    one face. It gets a plane of its own, which stands upright on the face. The planes
    are those of the faces, followed by those of the rims.

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
    displacements : ndarray (V, 3)
        Displacement of each vertex for an edge radius of 1.
    pairs : ndarray (n, 2)
        The planes of each vertex, as pairs (vertex, plane).
    normals : ndarray (P, 3)
        Outward normals of the planes.
    """
    # Make an upright plane on each rim. `edge_faces` is -1 for the missing face, so the
    # larger number is the face. The normal points out of the face, across the rim. The
    # direction of the rim is reversed if its face traverses it the other way.
    rim_edges = np.flatnonzero((edge_faces < 0).any(axis=1))
    rim_faces = edge_faces[rim_edges].max(axis=1)
    rim_directions = _normalise(
        vertices[edges[rim_edges, 1]] - vertices[edges[rim_edges, 0]]
    )
    rim_directions[edge_faces[rim_edges, 0] < 0] *= -1.0
    rim_normals = np.cross(rim_directions, plane_normals[face_plane[rim_faces]])
    normals = np.vstack([plane_normals, rim_normals])

    # Each vertex has the planes of its faces and those of its rims.
    rim_planes = len(plane_normals) + np.arange(len(rim_edges))
    planes_at_corners = [np.column_stack([faces[:, k], face_plane]) for k in range(3)]
    planes_at_rims = [
        np.column_stack([edges[rim_edges, k], rim_planes]) for k in range(2)
    ]
    pairs, rank = _sort_planes_of_vertices(
        np.vstack(planes_at_corners + planes_at_rims)
    )

    # Solve a linear system for each vertex, so that its displacement along each of its
    # normals is -1. Row `rank` of a matrix is the normal of the plane with this
    # position among the planes of the vertex. Vertices with fewer planes than others
    # have rows of zeros. The pseudo-inverse leaves out directions in which the normals
    # differ by less than SAME_NORMAL, so nearly equal planes count as one.
    matrices = np.zeros((len(vertices), rank.max() + 1, 3))
    matrices[pairs[:, 0], rank] = normals[pairs[:, 1]]
    depths = np.any(matrices != 0.0, axis=2).astype(float)
    inverses = np.linalg.pinv(matrices, rcond=SAME_NORMAL)
    return -np.einsum("vij,vj->vi", inverses, depths), pairs, normals


def _compute_areas_and_sides(vertices, faces):
    """Return the area vectors and the side vectors of all triangles, (4 F, 3).

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    """
    sides = [vertices[faces[:, k]] - vertices[faces[:, k - 1]] for k in range(3)]
    return np.vstack([_compute_area_vectors(vertices, faces), *sides])


def _keeps_triangles(vertices, faces, displacement):
    """Return whether all triangles keep their orientation when vertices are displaced.

    A triangle has lost its orientation if its area vector or one of its sides has been
    reversed, or has become too short in the old direction.

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


def _find_largest_radius(vertices, faces, displacements, radius):
    """Find the largest edge radius that turns no triangle over, by bisection.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    displacements : ndarray (V, 3)
        Displacement of each vertex for a radius of 1, see
        `compute_inward_displacements`.
    radius : float
        An edge radius that is too large [m].

    Returns
    -------
    float
        The largest radius [m].
    """
    # The radius `low` turns no triangle over, while the radius `high` does.
    low = 0.0
    high = radius
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _keeps_triangles(vertices, faces, middle * displacements):
            low = middle
        else:
            high = middle
    return low


def erode_mesh(vertices, faces, displacements, radius):
    """Erode a mesh to its core, by moving its vertices inwards by an edge radius.

    Parameters
    ----------
    vertices, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    displacements : ndarray (V, 3)
        Displacement of each vertex for a radius of 1, see
        `compute_inward_displacements`.
    radius : float
        The edge radius [m].

    Returns
    -------
    ndarray (V, 3)
        Positions of the eroded vertices [m].

    Raises
    ------
    ValueError
        If a triangle would turn over. The message states the largest possible radius.
    """
    if not _keeps_triangles(vertices, faces, radius * displacements):
        largest = _find_largest_radius(vertices, faces, displacements, radius)
        raise ValueError(
            f"edge_radius_m is {radius!r}; expected below {largest:.3g}, "
            "the smallest triangles leave no room for more"
        )
    return vertices + radius * displacements


def _make_face_rows(core, faces, edges, edge_faces, face_plane, plane_normals, radius):
    """Make the rows of `Meshes.data` for the faces.

    The mesh was eroded: its vertices have moved inwards by the edge radius. The eroded
    mesh is called the core. The wall's surface lies one edge radius above the faces of
    the core. Normals in the engine point from the body into the wall, so they are
    opposite to the outward normals.

    Parameters
    ----------
    core, faces : ndarray (V, 3), (F, 3)
        Positions of the eroded vertices [m], and vertices of each triangle.
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`.
    face_plane, plane_normals : ndarray (F,), (P, 3)
        Plane of each face, and outward normal of each plane.
    radius : float
        Edge radius [m], by which the wall lies above the eroded faces.

    Returns
    -------
    ndarray (F, COLUMNS)
        A row for each face.
    """
    rows = np.zeros((len(faces), COLUMNS))
    outward = plane_normals[face_plane]
    # The normal into the wall
    rows[:, FACE_NORMAL : FACE_NORMAL + 3] = -outward
    # All faces of a plane get the offset of one of them, so that their offsets are
    # equal despite rounding. In this assignment, the last face of each plane wins.
    plane_offsets = np.zeros(len(plane_normals))
    plane_offsets[face_plane] = -np.sum(core[faces[:, 0]] * outward, axis=1) - radius
    rows[:, FACE_OFFSET] = plane_offsets[face_plane]
    _write_sides(rows, core, edges, edge_faces, outward)
    return rows


def _sort_edges_by_face(edge_face):
    """Sort edges by their face. Edges without a face are left out.

    Parameters
    ----------
    edge_face : ndarray (E,)
        Face of each edge, or -1.

    Returns
    -------
    edge, face : ndarray (n,)
        Index of each edge, and index of its face.
    rank : ndarray (n,)
        Position of each edge among the edges of its face, counted from 0.
    """
    edge = np.flatnonzero(edge_face >= 0)
    edge = edge[np.argsort(edge_face[edge], kind="stable")]
    face = edge_face[edge]
    first_of_face = np.searchsorted(face, face)
    return edge, face, np.arange(len(face)) - first_of_face


def _write_sides(rows, core, edges, edge_faces, outward):
    """Write the three sides of each face to its row of `Meshes.data`.

    For each side, a row has four columns from SIDES + SIDE_COLUMNS * side on: the
    normal of the side, in the plane of the face and into it, and the offset of the side
    along this normal. The column STRICT + side has a flag: 1 if a point exactly on this
    side belongs to the neighbour. `core` are the vertices of the eroded mesh.

    Parameters
    ----------
    rows : ndarray (F, COLUMNS)
        Rows of the faces. Their columns SIDES to STRICT + 2 are overwritten.
    core : ndarray (V, 3)
        Positions of the eroded vertices [m].
    edges, edge_faces : ndarray (E, 2)
        Vertices and faces of each edge, see `find_edges`.
    outward : ndarray (F, 3)
        Outward unit normals of the faces.
    """
    edge_directions = _normalise(core[edges[:, 1]] - core[edges[:, 0]])
    n_sides = np.zeros(len(rows), int)  # number of sides of each face written so far
    # A face traverses each of its edges from the lower to the higher vertex (direction
    # 0) or the other way (direction 1). In the first case it lies to the left of the
    # edge, in the second to the right.
    for direction, sign in ((0, 1.0), (1, -1.0)):
        edge, face, rank = _sort_edges_by_face(edge_faces[:, direction])
        # Number the sides of a face in the order in which they are written.
        side = n_sides[face] + rank
        # A vector in the plane of the face that points to the left of the edge
        left_normal = np.cross(outward[face], edge_directions[edge])
        offset = np.sum(left_normal * core[edges[edge, 0]], axis=1)

        # The side's inward normal, and the offset of the side along this normal
        column = SIDES + SIDE_COLUMNS * side
        for axis in range(3):
            rows[face, column + axis] = sign * left_normal[:, axis]
        rows[face, column + 3] = sign * offset
        # A point on an edge belongs to the face that traverses it in direction 0.
        # Therefore the flag of the other face is 1, the number of its direction.
        rows[face, STRICT + side] = float(direction)
        np.add.at(n_sides, face, 1)


def _make_edge_rows(core, edges, edge_faces, face_plane, plane_normals):
    """Make the rows of `Meshes.data` for the convex edges and the rims.

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
        A row for each convex edge or rim.
    """
    start = core[edges[:, 0]]
    edge_vector = core[edges[:, 1]] - start
    length = np.linalg.norm(edge_vector, axis=1)
    direction = edge_vector / length[:, None]

    # The normals of the faces on both sides, into the wall. On a rim, which has only
    # one face, both normals are those of this face.
    left = edge_faces[:, 0]
    right = edge_faces[:, 1]
    is_rim = (left < 0) | (right < 0)
    first_face = np.where(left >= 0, left, right)
    second_face = np.where(right >= 0, right, left)
    first_normal = -plane_normals[face_plane[first_face]]
    second_normal = -plane_normals[face_plane[second_face]]

    # Compute the angle between these normals. Its sine about the edge is positive if
    # the edge is convex.
    normals_cross = np.cross(first_normal, second_normal)
    sine = np.sum(normals_cross * direction, axis=1)
    cosine = np.sum(first_normal * second_normal, axis=1)
    angle = np.arctan2(np.linalg.norm(normals_cross, axis=1), cosine)
    is_kink = (face_plane[left] != face_plane[right]) & (angle > LEAST_ANGLE)
    is_convex = is_rim | (is_kink & (sine > 0.0))
    angle[is_rim] = np.pi  # rounded down to the back of the face

    # The direction towards which the first normal turns. It is reversed on a rim whose
    # face is on the right.
    sign = np.where(left >= 0, 1.0, -1.0)
    turn_direction = _normalise(np.cross(-first_normal, direction)) * sign[:, None]

    # Edges between coplanar faces and concave edges are not features, so they get no
    # row.
    rows = np.zeros((is_convex.sum(), COLUMNS))
    rows[:, PLACE : PLACE + 3] = start[is_convex]
    rows[:, EDGE_ALONG : EDGE_ALONG + 3] = direction[is_convex]
    rows[:, EDGE_LENGTH] = length[is_convex]
    rows[:, EDGE_NORMAL : EDGE_NORMAL + 3] = first_normal[is_convex]
    rows[:, EDGE_TURN : EDGE_TURN + 3] = turn_direction[is_convex]
    rows[:, EDGE_ANGLE] = angle[is_convex]
    return rows


def _find_ranges(owners, n_owners):
    """Find the range of each owner's items in a list that is sorted by owner.

    Parameters
    ----------
    owners : ndarray (items,)
        Index of the owner of each item, in increasing order.
    n_owners : int
        Number of owners. Some may have no item.

    Returns
    -------
    ndarray (n_owners, 2)
        Begin and end of each range, as in a slice.
    """
    owner_indices = np.arange(n_owners)
    begin = np.searchsorted(owners, owner_indices, "left")
    end = np.searchsorted(owners, owner_indices, "right")
    return np.column_stack([begin, end])


def _project_rays(directions, ray_vertex, rays):
    """Project each ray on the direction of its vertex.

    Parameters
    ----------
    directions : ndarray (V, 3)
        A direction for each vertex.
    ray_vertex, rays : ndarray (R,), (R, 3)
        Vertex and unit vector of each ray; a vertex may have several.

    Returns
    -------
    component : ndarray (R,)
        Component of each ray along the direction of its vertex.
    largest : ndarray (V,)
        The largest of these components for each vertex; -inf for a vertex without rays.
    """
    component = np.sum(directions[ray_vertex] * rays, axis=1)
    largest = np.full(len(directions), -np.inf)
    np.maximum.at(largest, ray_vertex, component)
    return component, largest


def _turn_away_from_rays(directions, ray_vertex, rays):
    """Turn the direction of each vertex until all its rays recede from it, if possible.

    The rays of a vertex are unit vectors along its edges, away from it. A ray recedes
    from a direction if its component along this direction is negative, below
    -LEAST_CONE. As in the perceptron algorithm, each step turns a direction away from
    the ray with the largest component, so that this ray recedes by PERCEPTRON_MARGIN.
    The steps are repeated at most PERCEPTRON_STEPS times.

    Parameters
    ----------
    directions : ndarray (V, 3)
        A unit vector for each vertex. It may be overwritten.
    ray_vertex, rays : ndarray (R,), (R, 3)
        Vertex and unit vector of each ray; a vertex may have several.

    Returns
    -------
    ndarray (V, 3)
        The unit vectors after the last step.
    """
    for _ in range(PERCEPTRON_STEPS):
        component, largest = _project_rays(directions, ray_vertex, rays)
        # The ray with the largest component at each vertex, if it does not recede
        is_worst = (component == largest[ray_vertex]) & (component > -LEAST_CONE)
        if not is_worst.any():
            break
        step = (component[is_worst, None] + PERCEPTRON_MARGIN) * rays[is_worst]
        # If two rays of a vertex have exactly the same component, only one of them
        # takes effect. The next round handles the other.
        directions[ray_vertex[is_worst]] -= step
        directions = _normalise_or_zero(directions)
    return directions


def _find_convex_vertices(core, edges, pairs, normals):
    """Find the convex vertices of a mesh.

    A vertex is convex if there is a direction from which all its edges recede, that is,
    have negative components. Only a convex vertex has normals that do not belong to one
    of its edges or faces, so only there a body can touch the vertex itself.

    Parameters
    ----------
    core : ndarray (V, 3)
        Positions of the vertices [m].
    edges : ndarray (E, 2)
        Vertices of each edge.
    pairs, normals : ndarray
        The planes of each vertex and their normals, see `compute_inward_displacements`.

    Returns
    -------
    convex_vertices : ndarray
        Indices of these vertices.
    ray_vertex : ndarray (2 E,)
        Vertex of each ray, in increasing order. Each edge is two rays, one from each
        end.
    rays : ndarray (2 E, 3)
        Unit vector along each ray, away from the vertex.
    """
    # Each edge is a ray from each of its ends to the other.
    near_end = edges.ravel()
    far_end = edges[:, ::-1].ravel()
    order = np.argsort(near_end, kind="stable")
    ray_vertex = near_end[order]
    rays = _normalise(core[far_end] - core[near_end])[order]

    # Begin the search for a direction with the sum of the normals of each vertex.
    sums = np.zeros((len(core), 3))
    np.add.at(sums, pairs[:, 0], normals[pairs[:, 1]])
    directions = _turn_away_from_rays(_normalise_or_zero(sums), ray_vertex, rays)

    # A vertex is convex if even the ray with the largest component recedes from the
    # direction that was found. Without edges, the largest component is -inf.
    _component, largest = _project_rays(directions, ray_vertex, rays)
    has_edges = np.isfinite(largest)
    convex_vertices = np.flatnonzero((largest < -LEAST_CONE) & has_edges)
    return convex_vertices, ray_vertex, rays


def _find_gentle_neighbours(core, faces, face_plane, plane_normals):
    """Find pairs of faces that share a vertex and meet in a gentle concave kink.

    A kink is gentle if the normals of the two faces differ by less than GENTLE. Of two
    such faces, a body touches only the one that it overlaps more. `core` are the
    vertices of the eroded mesh.

    Parameters
    ----------
    core, faces : ndarray (V, 3), (F, 3)
        Positions of the vertices [m], and vertices of each triangle.
    face_plane, plane_normals : ndarray (F,), (P, 3)
        Plane of each face, and outward normal of each plane.

    Returns
    -------
    ndarray (K, 2)
        Indices of the faces of each pair, sorted. Each pair is listed in both orders.
    """
    from scipy.sparse import coo_array

    # Mark the vertices of each face in a sparse matrix. Its product with its transpose
    # has an entry for each pair of faces that share a vertex.
    n_faces = len(faces)
    rows = np.repeat(np.arange(n_faces), 3)
    columns = faces.ravel()
    has_vertex = coo_array(
        (np.ones(3 * n_faces), (rows, columns)), shape=(n_faces, len(core))
    ).tocsr()
    pairs = np.column_stack((has_vertex @ has_vertex.T).nonzero())

    # Keep gentle kinks: the planes differ, and their normals differ by a small angle.
    # This also leaves out pairs of a face with itself.
    outward = plane_normals[face_plane]
    first, second = pairs.T
    cosine = np.sum(outward[first] * outward[second], axis=1)
    is_kink = face_plane[first] != face_plane[second]
    pairs = pairs[is_kink & (cosine > np.cos(GENTLE))]

    # Keep concave kinks: the surface rises at the kink, so the middle of the second
    # face is above the plane of the first.
    first, second = pairs.T
    middle = core[faces].mean(axis=1)
    corner = core[faces[:, 0]]
    height = np.sum((middle[second] - corner[first]) * outward[first], axis=1)
    core_size = np.linalg.norm(np.ptp(core, axis=0))
    pairs = pairs[height > FLAT * core_size]
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def _split_bent_planes(core, vertices, faces, face_plane, plane_normals, radius):
    """Give each triangle of a bent plane a plane of its own.

    A plane is a group of triangles that were coplanar before the erosion, which moves
    the vertices inwards by the edge radius. It is bent if its corners are not all one
    edge radius below it afterwards. The old planes remain in the list, although a bent
    one has no triangles any more.

    Parameters
    ----------
    core, vertices : ndarray (V, 3)
        Positions of the vertices after (core) and before the erosion [m].
    faces : ndarray (F, 3)
        Vertices of each triangle.
    face_plane, plane_normals : ndarray (F,), (P, 3)
        Plane of each face, and outward normal of each plane, before the erosion.
    radius : float
        Edge radius [m].

    Returns
    -------
    face_plane, plane_normals : ndarray (F,), (Q, 3)
        Plane of each face, and outward normal of each plane, after the erosion. The new
        planes come last.
    """
    displacement = core - vertices
    # Each corner should have moved by minus the radius along the normal of its plane.
    heights = np.einsum("fki,fi->fk", displacement[faces], plane_normals[face_plane])
    depth_errors = np.abs(heights + radius).max(axis=1)
    # A single corner at another depth bends the whole plane.
    is_bent = np.zeros(len(plane_normals), bool)
    is_bent[face_plane[depth_errors > SAME_DEPTH * radius]] = True

    # Triangles of bent planes get new planes, numbered after the old ones.
    has_bent_plane = is_bent[face_plane]
    new_planes = len(plane_normals) + np.cumsum(has_bent_plane) - 1
    new_normals = _normalise(_compute_area_vectors(core, faces[has_bent_plane]))
    face_plane = np.where(has_bent_plane, new_planes, face_plane)
    return face_plane, np.vstack([plane_normals, new_normals])


def find_features(vertices, faces, radius):
    """Find the faces, edges and vertices of a mesh that bodies can touch.

    Parameters
    ----------
    vertices : ndarray (V, 3)
        Positions of the vertices [m].
    faces : ndarray (F, 3)
        Vertices of each triangle, counterclockwise when viewed from outside.
    radius : float
        Edge radius [m].

    Returns
    -------
    MeshFeatures
        The features: all faces, then convex edges and rims, then convex vertices.

    Raises
    ------
    ValueError
        If the triangles do not form a surface, or leave no room for the edge radius.
    """
    edges, edge_faces = find_edges(faces)
    face_plane, plane_normals = find_planes(vertices, faces, edges, edge_faces)
    displacements, vertex_plane_pairs, normals = compute_inward_displacements(
        vertices, faces, edges, edge_faces, face_plane, plane_normals
    )
    core = erode_mesh(vertices, faces, displacements, radius)
    face_plane, plane_normals = _split_bent_planes(
        core, vertices, faces, face_plane, plane_normals, radius
    )

    # Make the rows of all features.
    face_rows = _make_face_rows(
        core, faces, edges, edge_faces, face_plane, plane_normals, radius
    )
    edge_rows = _make_edge_rows(core, edges, edge_faces, face_plane, plane_normals)
    convex_vertices, ray_vertex, rays = _find_convex_vertices(
        core, edges, vertex_plane_pairs, normals
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

    # Find the neighbours of faces, and the edges and normals of vertices.
    span = np.zeros((len(data), 2), np.int64)
    corners = np.zeros((len(data), 2), np.int64)
    neighbours = _find_gentle_neighbours(core, faces, face_plane, plane_normals)
    first_vertex = n_faces + n_edges
    span[:n_faces] = _find_ranges(neighbours[:, 0], n_faces)
    span[first_vertex:] = _find_ranges(ray_vertex, len(core))[convex_vertices]
    vertex_planes = np.column_stack([faces.ravel(), np.repeat(face_plane, 3)])
    vertex_planes = np.unique(vertex_planes, axis=0)
    corners[first_vertex:] = _find_ranges(vertex_planes[:, 0], len(core))[
        convex_vertices
    ]
    box, cells, begin, items = _sort_into_cells(core, faces, kind, data, radius)
    return MeshFeatures(
        kind=kind,
        data=data,
        span=span,
        corners=corners,
        near=neighbours[:, 1].astype(np.int64),
        rays=rays,
        normals=-plane_normals[vertex_planes[:, 1]],
        box=box,
        cells=cells,
        begin=begin,
        items=items,
    )


def _compute_boxes(core, faces, data, radius):
    """Compute the bounding box of each feature of a mesh.

    The box contains the feature with its rounding. The core is the eroded mesh, whose
    vertices lie inwards of the surface by the edge radius. Edges and vertices of the
    core are rounded by this radius in all directions. A face of the wall is flat: it
    lies one radius outwards from its triangle of the core.

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
        Corners of the boxes [m].
    """
    face_rows = data[: len(faces)]
    other_rows = data[len(faces) :]
    # FACE_NORMAL points into the wall, so minus the normal is outwards.
    inward = face_rows[:, None, FACE_NORMAL : FACE_NORMAL + 3]
    corners = core[faces] - radius * inward
    # An edge is a cylinder from its start to its end. A vertex has its position in the
    # column PLACE, like the start of an edge, and zeros for the length.
    start = other_rows[:, PLACE : PLACE + 3]
    along = other_rows[:, EDGE_ALONG : EDGE_ALONG + 3]
    end = start + other_rows[:, EDGE_LENGTH, None] * along
    # The boxes of faces come first, then those of edges and vertices.
    lower = [corners.min(axis=1), np.minimum(start, end) - radius]
    upper = [corners.max(axis=1), np.maximum(start, end) + radius]
    return np.concatenate(lower), np.concatenate(upper)


def _sort_into_cells(core, faces, kind, data, radius):
    """Divide the mesh's box into a grid of cells, and list the features of each cell.

    There are about as many cells as features. `core` are the vertices of the eroded
    mesh.

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
        Lower corner and upper corner of the grid, and edge of a cell [m].
    n_cells : ndarray (3,)
        Number of cells along each axis.
    begin : ndarray
        Index in `items` of the first feature of each cell, and the end of the last
        cell.
    items : ndarray
        Indices of the features that reach into each cell, one cell after another.
    """
    box_lower, box_upper = _compute_boxes(core, faces, data, radius)
    lower = box_lower.min(axis=0)
    upper = box_upper.max(axis=0)
    # A flat mesh gets a grid with some thickness.
    size = np.maximum(upper - lower, LEAST_THICKNESS * np.max(upper - lower))
    cell_size = float((size.prod() / len(kind)) ** (1.0 / 3.0))
    # Rounding must not put a corner outside the grid.
    lower = lower - GRID_MARGIN * cell_size
    upper = upper + GRID_MARGIN * cell_size
    n_cells = np.maximum(np.ceil((upper - lower) / cell_size), 1).astype(np.int64)

    # Count the features of each cell: with an empty array of items, `put_in_cells` only
    # counts. The list of a cell begins where the list of the cell before it ends. The
    # additional last element of `count` stays 0 and is not used.
    count = np.zeros(int(n_cells.prod()) + 1, np.int64)
    no_items = np.zeros(0, np.int64)
    put_in_cells(
        box_lower, box_upper, kind, data, lower, cell_size, n_cells, count, no_items
    )
    begin = np.concatenate([[0], np.cumsum(count[:-1])])
    # The array has at least one element, since an empty one would make `put_in_cells`
    # count. The copy of `begin` is increased while the lists are filled.
    items = np.zeros(max(int(begin[-1]), 1), np.int64)
    next_item = begin[:-1].copy()
    put_in_cells(
        box_lower, box_upper, kind, data, lower, cell_size, n_cells, next_item, items
    )
    return np.concatenate([lower, upper, [cell_size]]), n_cells, begin, items


@inlined
def find_cell(point, lower, cell_size):
    """Return the indices along each axis of the cell that contains a point.

    Parameters
    ----------
    point, lower : array (3,)
        The point, and the lower corner of the grid [m].
    cell_size : float
        Edge of a cell [m].
    """
    i = int((point[0] - lower[0]) / cell_size)
    j = int((point[1] - lower[1]) / cell_size)
    k = int((point[2] - lower[2]) / cell_size)
    return i, j, k


@inlined
def plane_misses_cell(face, lower, cell_size, i, j, k):
    """Return whether the plane of a face misses a cell.

    Parameters
    ----------
    face : array
        The row of the face in `Meshes.data`.
    lower : array (3,)
        Lower corner of the grid [m].
    cell_size : float
        Edge of a cell [m].
    i, j, k : int
        Indices of the cell along the three axes.
    """
    nx = face[FACE_NORMAL]
    ny = face[FACE_NORMAL + 1]
    nz = face[FACE_NORMAL + 2]
    # The centre of the cell, and its distance from the plane
    x = lower[0] + (i + 0.5) * cell_size
    y = lower[1] + (j + 0.5) * cell_size
    z = lower[2] + (k + 0.5) * cell_size
    distance = abs(nx * x + ny * y + nz * z - face[FACE_OFFSET])
    # The farthest corner of the cell lies this far from the centre along the normal.
    corner_distance = HALF_CELL * cell_size * (abs(nx) + abs(ny) + abs(nz))
    return distance > corner_distance


@kernel
def put_in_cells(
    box_lower, box_upper, kind, data, lower, cell_size, n_cells, next_item, items
):
    """Count the features of each cell, or write them to the lists of the cells.

    If `items` is empty, the features are only counted in `next_item`, which must be
    zero before. This has to be done first, because the counts determine where the list
    of each cell begins. In the second call, `next_item` is the position of the next
    feature of each cell in `items`.

    Parameters
    ----------
    box_lower, box_upper : array (n, 3)
        Lower and upper corners of the features' boxes [m].
    kind, data : array
        The features, see `Meshes`.
    lower, cell_size, n_cells : array (3,), float, array (3,)
        Lower corner of the grid [m], edge of a cell [m], and number of cells along each
        axis.
    next_item : array
        Index in `items` of the next feature of each cell. It is increased by one for
        each feature.
    items : array
        Overwritten with the indices of the features, unless it is empty.
    """
    for feature in range(box_lower.shape[0]):
        # The box of the feature reaches into this block of cells.
        i0, j0, k0 = find_cell(box_lower[feature], lower, cell_size)
        i1, j1, k1 = find_cell(box_upper[feature], lower, cell_size)
        is_face = kind[feature] == FACE
        for i in range(i0, min(i1 + 1, n_cells[0])):
            for j in range(j0, min(j1 + 1, n_cells[1])):
                for k in range(k0, min(k1 + 1, n_cells[2])):
                    # A slanted face misses most cells of its box.
                    if is_face and plane_misses_cell(
                        data[feature], lower, cell_size, i, j, k
                    ):
                        continue
                    # Write the feature unless this call only counts.
                    cell = (i * n_cells[1] + j) * n_cells[2] + k
                    if items.shape[0] > 0:
                        items[next_item[cell]] = feature
                    next_item[cell] += 1


def _find_first_rows(meshes, name):
    """Return the row at which the array of each mesh begins in the joined array.

    The last number is the length of the joined array. `name` is the field of
    `MeshFeatures` with the arrays.
    """
    lengths = [len(getattr(mesh, name)) for mesh in meshes]
    return np.cumsum([0, *lengths])


def _join_arrays(meshes, name):
    """Join the arrays in the field `name` of all meshes into one array."""
    return np.concatenate([getattr(mesh, name) for mesh in meshes])


def _join_shifted(meshes, name, first_rows):
    """Join arrays of row indices, shifted so that they refer to the joined array.

    Parameters
    ----------
    meshes : sequence of MeshFeatures
        The features of each mesh.
    name : str
        The field of `MeshFeatures` with these arrays.
    first_rows : ndarray
        Row at which each mesh begins in the joined array to which the indices refer,
        followed by the number of all rows.

    Returns
    -------
    ndarray
        The shifted arrays of all meshes, one after another.
    """
    arrays = []
    for mesh, first_row in zip(meshes, first_rows, strict=False):
        arrays.append(getattr(mesh, name) + first_row)
    return np.concatenate(arrays)


def join_features(meshes, slide):
    """Join the features of several meshes into the arrays that the kernels need.

    The arrays of the meshes are put one after another. Some of them hold indices of
    rows in other arrays. Such an index is increased by the number of rows of the
    previous meshes in that array. `Meshes` says which array each index refers to.

    Parameters
    ----------
    meshes : sequence of MeshFeatures
        The features of each mesh.
    slide : float
        How far a body's deepest point may slide over the body when this moves by 1, see
        `Meshes.slide`.

    Returns
    -------
    Meshes
        The features of all meshes.
    """
    first_features = _find_first_rows(meshes, "kind")
    first_rays = _find_first_rows(meshes, "rays")
    first_neighbours = _find_first_rows(meshes, "near")
    first_cells = _find_first_rows(meshes, "begin")
    # The spans of vertices are ranges of `rays`, and those of other features are ranges
    # of `near`.
    spans = []
    for mesh_index, mesh in enumerate(meshes):
        first = np.where(
            mesh.kind == VERTEX, first_rays[mesh_index], first_neighbours[mesh_index]
        )
        spans.append(mesh.span + first[:, None])
    n_features = first_features[-1]
    # `seen` and `stamp` are working memory of the searches.
    return Meshes(
        kind=_join_arrays(meshes, "kind"),
        data=_join_arrays(meshes, "data"),
        mesh=np.repeat(np.arange(len(meshes)), np.diff(first_features)),
        span=np.concatenate(spans),
        corners=_join_shifted(meshes, "corners", _find_first_rows(meshes, "normals")),
        near=_join_shifted(meshes, "near", first_features),
        rays=_join_arrays(meshes, "rays"),
        normals=_join_arrays(meshes, "normals"),
        box=np.array([mesh.box for mesh in meshes]),
        cells=np.column_stack([[mesh.cells for mesh in meshes], first_cells[:-1]]),
        begin=_join_shifted(meshes, "begin", _find_first_rows(meshes, "items")),
        items=_join_shifted(meshes, "items", first_features),
        seen=np.zeros(n_features, np.int64),
        stamp=np.zeros(1, np.int64),
        slide=np.array([slide]),
    )
