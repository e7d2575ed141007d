"""The features of a triangle mesh that a body can touch, in a grid of cells.

Features are faces, convex edges and convex vertices. The mesh is *eroded* by the edge
radius: every vertex moves inwards until it lies that deep below all its faces; the
eroded mesh is called the core. The wall is the core dilated by the edge radius. So faces
return to their old places, edges become cylinders and vertices spheres, tangent to the
faces. The normals of neighbouring features fit together without gap or overlap, for any
mesh. Edges between coplanar triangles and concave edges bound no set of normals and are
no features. An open border is a rim, rounded down to the back of its face.

`split` makes a `Part`, the features of one mesh; `join` puts the parts of all meshes into
a `Meshes`, which the kernels take. This is Python but for `put_in_cells`.

Names: V, F and E are the numbers of vertices, faces and edges of the mesh. A *plane* is a
group of coplanar triangles (or stands upright on a rim), with one outward unit normal.
"""

from typing import Any, NamedTuple

import numpy as np

from .jit import kernel

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
    corners: (
        Any  # (F, 2), of a vertex: begin and end of its faces' normals in `normals`
    )
    near: Any  # neighbours of faces, as numbers of features
    rays: Any  # (n, 3): unit vectors along the edges of vertices, away from them
    normals: Any  # (n, 3): normals of faces, into the wall
    box: Any  # (M, 7): lower corner, upper corner, edge of a cell
    cells: Any  # (M, 4): number of cells along each axis, first cell in `begin`
    begin: Any  # (C,): first item of each cell
    items: Any  # features of each cell, one cell after another
    seen: Any  # (F,): stamp of the last search that met the feature
    stamp: Any  # (1,): number of the last search
    slide: (
        Any  # (1,): how far a body's deepest point may slide when the body moves by 1
    )


class Part(NamedTuple):
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


def _unit(vectors):
    """Return vectors (n, 3) with unit length."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _unit_or_zero(vectors):
    """Return vectors (n, 3) with unit length; zeros stay zeros."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY)


def _area_vectors(vertices, faces):
    """Return the area vectors of triangles (F, 3): outward normals times areas."""
    a = vertices[faces[:, 0]]
    b = vertices[faces[:, 1]]
    c = vertices[faces[:, 2]]
    return 0.5 * np.cross(b - a, c - a)


def edge_table(faces):
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
    directed = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), 3)
    edges, number = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    number = number.ravel()
    side = (directed[:, 0] > directed[:, 1]).astype(int)
    count = np.zeros((len(edges), 2), int)
    np.add.at(count, (number, side), 1)
    if count.max() > 1:
        edge = edges[int(np.argmax(count.max(axis=1)))].tolist()
        raise ValueError(
            f"faces has several triangles on one side of edge {edge}; expected at most "
            "two triangles at an edge, both with their normals outwards"
        )
    edge_faces = np.full((len(edges), 2), -1)
    edge_faces[number, side] = owner
    return edges, edge_faces


def _coplanar_pairs(vertices, faces, edges, edge_faces, normal):
    """Return the pairs of neighbouring faces that are coplanar, as two arrays."""
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    inner = np.flatnonzero((edge_faces >= 0).all(axis=1))
    first = edge_faces[inner, 0]
    second = edge_faces[inner, 1]
    start = vertices[edges[inner, 0]]
    # The height of the corners of one face over the plane of the other, whichever of the
    # two is smaller: the plane of a narrow triangle is uncertain.
    height = np.full(len(inner), np.inf)
    for face, other in ((first, second), (second, first)):
        corners = vertices[faces[other]] - start[:, None]
        distance = np.abs(np.einsum("eki,ei->ek", corners, normal[face]))
        height = np.minimum(height, distance.max(axis=1))
    same_side = np.sum(normal[first] * normal[second], axis=1) > 0.0
    is_flat = (height < FLAT * size) & same_side
    return first[is_flat], second[is_flat]


def coplanar_groups(vertices, faces, edges, edge_faces):
    """Join coplanar triangles in groups.

    Returns
    -------
    group : ndarray (F,)
        Number of the group of each triangle.
    normals : ndarray (G, 3)
        Outward unit normal of each group.
    """
    from scipy.sparse import coo_array, csgraph  # slow to import: where there is a mesh

    n = len(faces)
    area = _area_vectors(vertices, faces)
    normal = _unit(area)
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    first, second = _coplanar_pairs(vertices, faces, edges, edge_faces, normal)
    coplanar = coo_array((np.ones(len(first)), (first, second)), shape=(n, n))
    count, group = csgraph.connected_components(coplanar, directed=False)
    # The common plane of a group, and how far its corners are from it.
    common = np.zeros((count, 3))
    np.add.at(common, group, area)
    common = _unit_or_zero(common)
    heights = np.einsum("fki,fi->fk", vertices[faces], common[group])
    low = np.full(count, np.inf)
    high = np.full(count, -np.inf)
    np.minimum.at(low, group, heights.min(axis=1))
    np.maximum.at(high, group, heights.max(axis=1))
    # A group that is flat only from triangle to triangle, not as a whole, falls apart:
    # each of its triangles becomes a group with a number from `count` on.
    is_curved = (high - low > FLAT_GROUP * size)[group]
    group[is_curved] = count + np.arange(is_curved.sum())
    old_group, face, group = np.unique(group, return_index=True, return_inverse=True)
    normals = np.where(
        is_curved[face, None], normal[face], common[np.minimum(old_group, count - 1)]
    )
    return group.ravel(), normals


def _planes_of_vertices(planes_at):
    """Sort pairs (vertex, plane), drop repetitions, and number the planes of a vertex.

    Returns
    -------
    pairs : ndarray (n, 2)
        The pairs.
    rank : ndarray (n,)
        Number of each pair among those of its vertex.
    """
    pairs = np.unique(planes_at, axis=0)
    first = np.searchsorted(pairs[:, 0], pairs[:, 0])
    return pairs, np.arange(len(pairs)) - first


def inward_steps(vertices, faces, edges, edge_faces, group, normals):
    """Find how each vertex moves when the mesh is eroded.

    A vertex moves to a depth of 1 below all its planes, or as near to that as least
    squares give. The planes are those of the groups, then those upright on the rims.

    Returns
    -------
    steps : ndarray (V, 3)
        Displacement of each vertex for an edge radius of 1.
    pairs : ndarray (n, 2)
        The planes of each vertex, as pairs (vertex, plane).
    planes : ndarray (P, 3)
        Outward normals of the planes.
    """
    rim = np.flatnonzero((edge_faces < 0).any(axis=1))
    rim_face = edge_faces[rim].max(axis=1)
    along = _unit(vertices[edges[rim, 1]] - vertices[edges[rim, 0]])
    along[edge_faces[rim, 0] < 0] *= -1.0
    upright = np.cross(along, normals[group[rim_face]])
    planes = np.vstack([normals, upright])
    rim_planes = len(normals) + np.arange(len(rim))
    planes_at = [np.column_stack([faces[:, k], group]) for k in range(3)]
    planes_at += [np.column_stack([edges[rim, k], rim_planes]) for k in range(2)]
    pairs, rank = _planes_of_vertices(np.vstack(planes_at))
    # One linear system for each vertex: its normals times the step are -1.
    rows = np.zeros((len(vertices), rank.max() + 1, 3))
    rows[pairs[:, 0], rank] = planes[pairs[:, 1]]
    depth = np.any(rows != 0.0, axis=2).astype(float)
    inverse = np.linalg.pinv(rows, rcond=SAME_NORMAL)
    return -np.einsum("vij,vj->vi", inverse, depth), pairs, planes


def _areas_and_sides(corners, faces):
    """Return the area vectors and the three sides of all triangles (4 F, 3)."""
    sides = [corners[faces[:, k]] - corners[faces[:, k - 1]] for k in range(3)]
    return np.vstack([_area_vectors(corners, faces), *sides])


def _keeps_triangles(vertices, faces, displacement):
    """Return whether no triangle turns over when its vertices are displaced."""
    original = _areas_and_sides(vertices, faces)
    displaced = _areas_and_sides(vertices + displacement, faces)
    projected = np.sum(original * displaced, axis=1)
    return bool(np.all(projected > LEAST_SHARE * np.sum(original * original, axis=1)))


def eroded(vertices, faces, steps, radius):
    """Return the vertices of the mesh eroded by an edge radius [m].

    Raises
    ------
    ValueError
        Where a triangle would turn over; the message says the largest possible radius.
    """
    if not _keeps_triangles(vertices, faces, radius * steps):
        low = 0.0
        high = radius
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            if _keeps_triangles(vertices, faces, middle * steps):
                low = middle
            else:
                high = middle
        raise ValueError(
            f"edge_radius_m is {radius!r}; expected below {low:.3g}, "
            "the smallest triangles leave no room for more"
        )
    return vertices + radius * steps


def _face_rows(core, faces, edges, edge_faces, group, normals, radius):
    """Return the rows of `Meshes.data` of the faces (F, COLUMNS)."""
    n = len(faces)
    data = np.zeros((n, COLUMNS))
    outward = normals[group]
    data[:, FACE_NORMAL : FACE_NORMAL + 3] = -outward
    # all faces of a group have its offset, bit for bit
    offset = np.zeros(len(normals))
    offset[group] = -np.sum(core[faces[:, 0]] * outward, axis=1) - radius
    data[:, FACE_OFFSET] = offset[group]
    n_sides = np.zeros(n, int)  # sides of each face that are written
    along = _unit(core[edges[:, 1]] - core[edges[:, 0]])
    for side, sign in ((0, 1.0), (1, -1.0)):
        edge = np.flatnonzero(edge_faces[:, side] >= 0)
        face = edge_faces[edge, side]
        # Group the edges by face; a face has at most three of them.
        order = np.argsort(face, kind="stable")
        edge = edge[order]
        face = face[order]
        rank = np.arange(len(face)) - np.searchsorted(face, face)
        place = n_sides[face] + rank
        inward = np.cross(outward[face], along[edge])
        level = np.sum(inward * core[edges[edge, 0]], axis=1)
        first = SIDES + SIDE_COLUMNS * place
        for axis in range(3):
            data[face, first + axis] = sign * inward[:, axis]
        data[face, first + 3] = sign * level
        data[face, STRICT + place] = float(side)
        np.add.at(n_sides, face, 1)
    return data


def _edge_rows(core, edges, edge_faces, group, normals):
    """Return the rows of `Meshes.data` of the convex edges and rims."""
    along = core[edges[:, 1]] - core[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    left = edge_faces[:, 0]
    right = edge_faces[:, 1]
    # a rim has one face, which stands for both
    first = -normals[group[np.where(left >= 0, left, right)]]
    second = -normals[group[np.where(right >= 0, right, left)]]
    cross = np.cross(first, second)
    sine = np.sum(cross * along, axis=1)
    cosine = np.sum(first * second, axis=1)
    angle = np.arctan2(np.linalg.norm(cross, axis=1), cosine)
    is_rim = (left < 0) | (right < 0)
    # The normal turns inwards from the face on the left. On a rim whose face is on the
    # right it turns the other way.
    turn = _unit(np.cross(-first, along)) * np.where(left >= 0, 1.0, -1.0)[:, None]
    angle[is_rim] = np.pi
    is_convex = is_rim | ((group[left] != group[right]) & (sine > 0.0) & (angle > 1e-9))
    rows = np.zeros((is_convex.sum(), COLUMNS))
    rows[:, PLACE : PLACE + 3] = core[edges[:, 0]][is_convex]
    rows[:, EDGE_ALONG : EDGE_ALONG + 3] = along[is_convex]
    rows[:, EDGE_LENGTH] = length[is_convex]
    rows[:, EDGE_NORMAL : EDGE_NORMAL + 3] = first[is_convex]
    rows[:, EDGE_TURN : EDGE_TURN + 3] = turn[is_convex]
    rows[:, EDGE_ANGLE] = angle[is_convex]
    return rows


def _ranges(owner, n):
    """Return begin and end of each of n owners in a sorted list of owners (n, 2)."""
    numbers = np.arange(n)
    begin = np.searchsorted(owner, numbers, "left")
    end = np.searchsorted(owner, numbers, "right")
    return np.column_stack([begin, end])


def _steepest(directions, owner, rays):
    """Return how much each edge leads along its vertex's direction, and the maximum.

    The first array has a number for each edge, the second one for each vertex; -inf for
    a vertex without edges.
    """
    lead = np.sum(directions[owner] * rays, axis=1)
    largest = np.full(len(directions), -np.inf)
    np.maximum.at(largest, owner, lead)
    return lead, largest


def _convex_vertices(core, edges, pairs, planes):
    """Find the vertices that have a set of normals of their own.

    These are the vertices with a direction that all their edges recede from. It is
    sought by perceptron steps away from the worst edge, from the sum of the normals.

    Returns
    -------
    convex_vertices : ndarray
        Numbers of these vertices.
    owner : ndarray (2 E,)
        Vertices, sorted; one item for each edge at a vertex.
    rays : ndarray (2 E, 3)
        Direction of that edge, away from the vertex.
    """
    owner = edges.ravel()
    rays = _unit(core[edges[:, ::-1].ravel()] - core[owner])
    order = np.argsort(owner, kind="stable")
    owner = owner[order]
    rays = rays[order]
    directions = np.zeros((len(core), 3))
    np.add.at(directions, pairs[:, 0], planes[pairs[:, 1]])
    directions = _unit_or_zero(directions)
    for _ in range(PERCEPTRON_STEPS):
        lead, largest = _steepest(directions, owner, rays)
        worst_edges = np.flatnonzero((lead == largest[owner]) & (lead > -LEAST_CONE))
        if not len(worst_edges):
            break
        directions[owner[worst_edges]] -= (lead[worst_edges, None] + 1e-3) * rays[
            worst_edges
        ]
        directions = _unit_or_zero(directions)
    _lead, largest = _steepest(directions, owner, rays)
    convex_vertices = np.flatnonzero((largest < -LEAST_CONE) & np.isfinite(largest))
    return convex_vertices, owner, rays


def _gentle_neighbours(core, faces, group, normals):
    """Find faces that share a vertex and meet in a concave kink below GENTLE.

    Returns
    -------
    ndarray (K, 2)
        Pairs of faces, sorted; each pair in both orders.
    """
    from scipy.sparse import coo_array

    n = len(faces)
    owner = np.repeat(np.arange(n), 3)
    at_vertex = coo_array(
        (np.ones(3 * n), (owner, faces.ravel())), shape=(n, len(core))
    ).tocsr()
    first, second = (at_vertex @ at_vertex.T).nonzero()
    outward = normals[group]
    cosine = np.sum(outward[first] * outward[second], axis=1)
    is_gentle = (group[first] != group[second]) & (cosine > np.cos(GENTLE))
    first = first[is_gentle]
    second = second[is_gentle]
    # concave: the middle of the second face is above the plane of the first
    middle = core[faces].mean(axis=1)
    size = np.linalg.norm(np.ptp(core, axis=0))
    height = np.sum((middle[second] - core[faces[first, 0]]) * outward[first], axis=1)
    is_concave = height > FLAT * size
    first = first[is_concave]
    second = second[is_concave]
    order = np.lexsort((second, first))
    return np.column_stack([first, second])[order]


def _planes_of_core(core, vertices, faces, group, normals, radius):
    """Give triangles planes of their own where the erosion has bent their group.

    A group is bent when its corners are not all one edge radius below its plane. Returns
    `group` and `normals` as `coplanar_groups`.
    """
    depth = np.einsum("fki,fi->fk", (core - vertices)[faces], normals[group]) + radius
    is_bent = np.zeros(len(normals), bool)
    is_bent[group[np.abs(depth).max(axis=1) > SAME_DEPTH * radius]] = True
    is_loose = is_bent[group]
    group = np.where(is_loose, len(normals) + np.cumsum(is_loose) - 1, group)
    normals = np.vstack([normals, _unit(_area_vectors(core, faces[is_loose]))])
    return group, normals


def split(vertices, faces, radius):
    """Find the features of a mesh.

    Parameters
    ----------
    vertices : ndarray (V, 3)
        Places of the vertices [m].
    faces : ndarray (F, 3)
        Vertices of each triangle, counterclockwise as seen from outside.
    radius : float
        Edge radius [m].

    Returns
    -------
    Part
        The features: faces, then edges, then vertices.

    Raises
    ------
    ValueError
        Where the triangles are no surface, or leave no room for the edge radius.
    """
    edges, edge_faces = edge_table(faces)
    group, normals = coplanar_groups(vertices, faces, edges, edge_faces)
    steps, pairs, planes = inward_steps(
        vertices, faces, edges, edge_faces, group, normals
    )
    core = eroded(vertices, faces, steps, radius)
    group, normals = _planes_of_core(core, vertices, faces, group, normals, radius)

    # The rows of all features.
    face_rows = _face_rows(core, faces, edges, edge_faces, group, normals, radius)
    edge_rows = _edge_rows(core, edges, edge_faces, group, normals)
    convex_vertices, owner, rays = _convex_vertices(core, edges, pairs, planes)
    n_faces = len(face_rows)
    n_edges = len(edge_rows)
    first_vertex = n_faces + n_edges
    data = np.zeros((first_vertex + len(convex_vertices), COLUMNS))
    data[:n_faces] = face_rows
    data[n_faces:first_vertex] = edge_rows
    data[first_vertex:, PLACE : PLACE + 3] = core[convex_vertices]
    data[:, RADIUS_COLUMN] = radius
    kind = np.repeat([FACE, EDGE, VERTEX], [n_faces, n_edges, len(convex_vertices)])
    kind = kind.astype(np.uint8)

    # The neighbours of faces, and the edges and normals of vertices.
    span = np.zeros((len(data), 2), np.int64)
    corners = np.zeros((len(data), 2), np.int64)
    neighbours = _gentle_neighbours(core, faces, group, normals)
    span[:n_faces] = _ranges(neighbours[:, 0], n_faces)
    span[first_vertex:] = _ranges(owner, len(core))[convex_vertices]
    groups_at = np.column_stack([faces.ravel(), np.repeat(group, 3)])
    groups_at = np.unique(groups_at, axis=0)
    corners[first_vertex:] = _ranges(groups_at[:, 0], len(core))[convex_vertices]
    box, cells, begin, items = _cells(core, faces, kind, data, radius)
    return Part(
        kind=kind,
        data=data,
        span=span,
        corners=corners,
        near=neighbours[:, 1].astype(np.int64),
        rays=rays,
        normals=-normals[groups_at[:, 1]],
        box=box,
        cells=cells,
        begin=begin,
        items=items,
    )


def _boxes(core, faces, kind, data, radius):
    """Return the lower and upper corners of the boxes of all features, (n, 3) each."""
    n_faces = len(faces)
    low = np.zeros((len(kind), 3))
    high = np.zeros((len(kind), 3))
    # a face's wall lies one radius above its triangle
    inward = data[:n_faces, None, FACE_NORMAL : FACE_NORMAL + 3]
    outer_corners = core[faces] - radius * inward
    low[:n_faces] = outer_corners.min(axis=1)
    high[:n_faces] = outer_corners.max(axis=1)
    for feature_kind in (EDGE, VERTEX):
        rows = data[kind == feature_kind]
        start = rows[:, PLACE : PLACE + 3]
        end = start
        if feature_kind == EDGE:
            length = rows[:, EDGE_LENGTH : EDGE_LENGTH + 1]
            end = start + length * rows[:, EDGE_ALONG : EDGE_ALONG + 3]
        low[kind == feature_kind] = np.minimum(start, end) - radius
        high[kind == feature_kind] = np.maximum(start, end) + radius
    return low, high


def _cells(core, faces, kind, data, radius):
    """Divide the mesh's box into cells, about as many as there are features.

    Returns
    -------
    box : ndarray (7,)
        Lower corner, upper corner, edge of a cell.
    shape : ndarray (3,)
        Number of cells along each axis.
    begin : ndarray
        First item of each cell, and the end of the last one.
    items : ndarray
        The features that reach into each cell, one cell after another.
    """
    low, high = _boxes(core, faces, kind, data, radius)
    lower = low.min(axis=0)
    upper = high.max(axis=0)
    size = np.maximum(upper - lower, 1e-3 * np.max(upper - lower))
    cell = float((size.prod() / len(kind)) ** (1.0 / 3.0))
    lower = lower - 1e-6 * cell
    upper = upper + 1e-6 * cell
    shape = np.maximum(np.ceil((upper - lower) / cell), 1).astype(np.int64)
    # Count the features of each cell, then write them.
    count = np.zeros(int(shape.prod()) + 1, np.int64)
    no_items = np.zeros(0, np.int64)
    put_in_cells(low, high, kind, data, lower, cell, shape, count, no_items)
    begin = np.concatenate([[0], np.cumsum(count[:-1])])
    items = np.zeros(max(int(begin[-1]), 1), np.int64)
    next_item = begin[:-1].copy()
    put_in_cells(low, high, kind, data, lower, cell, shape, next_item, items)
    return np.concatenate([lower, upper, [cell]]), shape, begin, items


@kernel
def put_in_cells(low, high, kind, data, lower, cell, shape, place, items):
    """Count the features of each cell, or write them.

    Parameters
    ----------
    low, high : array (n, 3)
        Corners of the features' boxes.
    kind, data : array
        See `Meshes`.
    lower, cell, shape : array (3,), float, array (3,)
        Lower corner of the cells, their edge, and their number along each axis.
    place : array
        Of each cell the place of its next item; it grows by one with each item.
    items : array
        Is written, unless it is empty.
    """
    for f in range(low.shape[0]):
        i0 = int((low[f, 0] - lower[0]) / cell)
        i1 = int((high[f, 0] - lower[0]) / cell)
        j0 = int((low[f, 1] - lower[1]) / cell)
        j1 = int((high[f, 1] - lower[1]) / cell)
        k0 = int((low[f, 2] - lower[2]) / cell)
        k1 = int((high[f, 2] - lower[2]) / cell)
        # the plane of a face; of other features these numbers are not used
        nx = data[f, FACE_NORMAL]
        ny = data[f, FACE_NORMAL + 1]
        nz = data[f, FACE_NORMAL + 2]
        offset = data[f, FACE_OFFSET]
        reach = 0.500001 * cell * (abs(nx) + abs(ny) + abs(nz))
        for i in range(i0, min(i1 + 1, shape[0])):
            for j in range(j0, min(j1 + 1, shape[1])):
                for k in range(k0, min(k1 + 1, shape[2])):
                    # the middle of the cell
                    x = lower[0] + (i + 0.5) * cell
                    y = lower[1] + (j + 0.5) * cell
                    z = lower[2] + (k + 0.5) * cell
                    # a slanting face misses most cells of its box
                    distance = abs(nx * x + ny * y + nz * z - offset)
                    if kind[f] == FACE and distance > reach:
                        continue
                    number = (i * shape[1] + j) * shape[2] + k
                    if items.shape[0] > 0:
                        items[place[number]] = f
                    place[number] += 1


def _begins(parts, name):
    """Return where the array `name` of each part begins in the joined array, and its end."""
    lengths = [len(getattr(part, name)) for part in parts]
    return np.cumsum([0, *lengths])


def _joined(parts, name):
    """Return the arrays `name` of all parts, one after another."""
    return np.concatenate([getattr(part, name) for part in parts])


def _shifted(parts, name, begins):
    """Return the arrays `name` of all parts; numbers of rows count on from part to part.

    `begins` says where the array that these numbers refer to begins, for each part.
    """
    arrays = []
    for part, begin in zip(parts, begins, strict=False):
        arrays.append(getattr(part, name) + begin)
    return np.concatenate(arrays)


def join(parts, slide):
    """Put the features of several meshes together, as the kernels take them.

    Parameters
    ----------
    parts : sequence of Part
        The features of each mesh.
    slide : float
        See `Meshes.slide`.

    Returns
    -------
    Meshes
        The features of all meshes.
    """
    feature_begins = _begins(parts, "kind")
    ray_begins = _begins(parts, "rays")
    near_begins = _begins(parts, "near")
    cell_begins = _begins(parts, "begin")
    # the spans of vertices are places in `rays`, all others in `near`
    spans = []
    for number, part in enumerate(parts):
        begin = np.where(part.kind == VERTEX, ray_begins[number], near_begins[number])
        spans.append(part.span + begin[:, None])
    n_features = feature_begins[-1]
    return Meshes(
        kind=_joined(parts, "kind"),
        data=_joined(parts, "data"),
        mesh=np.repeat(np.arange(len(parts)), np.diff(feature_begins)),
        span=np.concatenate(spans),
        corners=_shifted(parts, "corners", _begins(parts, "normals")),
        near=_shifted(parts, "near", feature_begins),
        rays=_joined(parts, "rays"),
        normals=_joined(parts, "normals"),
        box=np.array([part.box for part in parts]),
        cells=np.column_stack([[part.cells for part in parts], cell_begins[:-1]]),
        begin=_shifted(parts, "begin", _begins(parts, "items")),
        items=_shifted(parts, "items", feature_begins),
        seen=np.zeros(n_features, np.int64),
        stamp=np.zeros(1, np.int64),
        slide=np.array([slide]),
    )
