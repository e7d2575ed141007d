"""The features of a triangle mesh that a body can touch: faces, convex edges and convex vertices, in a grid of cells.

The mesh is eroded by the edge radius (every vertex moves inwards until it lies that deep below all its faces), and the
wall is the eroded mesh dilated by the edge radius. Faces return to their old places; edges become cylinders and
vertices spheres, tangent to the faces. The normals of neighbouring features fit together without gap or overlap, for
any mesh. Edges between coplanar triangles and concave edges bound no set of normals and are no features. An open border
is a rim, rounded down to the back of its face.
"""

from collections import namedtuple

import numpy as np

from .jit import kernel

FACE, EDGE, VERTEX = range(3)
# Columns of `data`. Face: normal into the wall (3), offset, three sides (inward normal in the plane (3), offset), three
# flags: a point on that side belongs to the neighbour. Edge: start (3), along (3), length, first normal into the wall
# (3), direction to which it turns (3), angle of all normals. Vertex: place (3). All: edge radius in the last column.
SIDES, STRICT, RADIUS_COLUMN = 4, 16, 19
COLUMNS = 20
# Triangles with corners this near to each other's plane, as a share of the mesh's size, may be coplanar; whole groups
# of them are when no corner is farther from the common plane.
FLAT, FLAT_GROUP = 1e-6, 1e-5
# Normals of one vertex that differ by less (singular values) do not say where it moves.
SAME_NORMAL = 0.01
# A group of coplanar triangles keeps its plane when its corners lie one edge radius below it, to this share of the
# radius.
SAME_DEPTH = 1e-5
# Of faces that meet in a concave kink of less than this angle [rad] only the face of the largest overlap is touched.
GENTLE = 0.35
# Margin by which a direction must lie within a vertex's normals (sine).
LEAST_CONE = 1e-7

# kind, data, mesh (F,): the features of all meshes, each in its own frame; span (F, 2): of a face its neighbours over
# gentle kinks in `near`, of a vertex its edges in `rays`; corners (F, 2): of a vertex its faces' normals in `normals`.
# Cells: box (M, 7) lower corner, upper corner, edge of a cell; cells (M, 4): how many each way and the first in
# `begin`; items: features of each cell. seen (F,), stamp (1,): which this search has met. slide (1,): how far a body's
# deepest point may slide when the body moves by 1.
Meshes = namedtuple(
    "Meshes",
    "kind data mesh span corners near rays normals box cells begin items seen stamp slide",
)
Part = namedtuple(
    "Part", "kind data span corners near rays normals box cells begin items"
)


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _normals(vertices, faces):
    """Area vectors of triangles (F, 3)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def edge_table(faces):
    """Edges of a mesh: vertices (E, 2), the lower first, and faces (E, 2): of the winding low to high, of the other.

    -1 stands for no face. Raises ValueError where more than two faces, or two of opposite winding, share an edge.
    """
    n = len(faces)
    directed = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    owner = np.repeat(np.arange(n), 3)
    edges, number = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    number = number.ravel()
    beside = np.full((len(edges), 2), -1)
    column = (directed[:, 0] > directed[:, 1]).astype(int)
    count = np.zeros_like(beside)
    np.add.at(count, (number, column), 1)
    if count.max() > 1:
        k = int(np.argmax(count.max(axis=1)))
        raise ValueError(
            f"faces has several triangles on one side of edge {edges[k].tolist()}; expected "
            "at most two triangles at an edge, both with their normals outwards"
        )
    beside[number, column] = owner
    return edges, beside


def coplanar_groups(vertices, faces, edges, beside):
    """Return the number of the flat group of each triangle (F,) and the groups' unit normals (G, 3)."""
    area = _normals(vertices, faces)
    normal = _unit(area)
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    inner = np.flatnonzero((beside >= 0).all(axis=1))
    one, two = beside[inner, 0], beside[inner, 1]
    start = vertices[edges[inner, 0]]
    height = np.full(len(inner), np.inf)
    for a, b in ((one, two), (two, one)):
        away = np.abs(
            np.einsum("eki,ei->ek", vertices[faces[b]] - start[:, None], normal[a])
        ).max(axis=1)
        height = np.minimum(height, away)
    flat = (height < FLAT * size) & (np.sum(normal[one] * normal[two], axis=1) > 0.0)
    n = len(faces)
    from scipy.sparse import coo_array, csgraph  # slow to import: where there is a mesh

    joined = coo_array((np.ones(flat.sum()), (one[flat], two[flat])), shape=(n, n))
    count, group = csgraph.connected_components(joined, directed=False)
    common = np.zeros((count, 3))
    np.add.at(common, group, area)
    common /= np.maximum(np.linalg.norm(common, axis=1, keepdims=True), 1e-300)
    heights = np.einsum("fki,fi->fk", vertices[faces], common[group])
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, group, heights.min(axis=1))
    np.maximum.at(high, group, heights.max(axis=1))
    curved = (high - low > FLAT_GROUP * size)[group]
    # a group that is flat only from triangle to triangle, not as a whole, is not made one plane
    group[curved] = count + np.arange(curved.sum())
    old, first, group = np.unique(group, return_index=True, return_inverse=True)
    chosen = np.where(
        curved[first, None], normal[first], common[np.minimum(old, count - 1)]
    )
    return group.ravel(), chosen


def _distinct(pairs):
    """Rows (vertex, plane) without repetition, sorted, and the place of each among those of its vertex."""
    pairs = np.unique(pairs, axis=0)
    first = np.searchsorted(pairs[:, 0], pairs[:, 0])
    return pairs, np.arange(len(pairs)) - first


def inward_steps(vertices, faces, edges, beside, group, normals):
    """Displacement of each vertex for an edge radius of 1 (V, 3), and its planes as pairs (vertex, plane).

    A vertex moves 1 deep below all its planes, or as near to that as least squares give. The planes are those of the
    groups, then those upright on the rims (returned as an array with the groups').
    """
    rim = np.flatnonzero((beside < 0).any(axis=1))
    face = beside[rim].max(axis=1)
    along = _unit(vertices[edges[rim, 1]] - vertices[edges[rim, 0]])
    along[beside[rim, 0] < 0] *= -1.0
    planes = np.vstack([normals, np.cross(along, normals[group[face]])])
    touching = [np.column_stack([faces[:, k], group]) for k in range(3)]
    touching += [
        np.column_stack([edges[rim, k], len(normals) + np.arange(len(rim))])
        for k in range(2)
    ]
    pairs, place = _distinct(np.vstack(touching))
    rows = np.zeros((len(vertices), place.max() + 1, 3))
    rows[pairs[:, 0], place] = planes[pairs[:, 1]]
    there = np.any(rows != 0.0, axis=2)
    inverse = np.linalg.pinv(rows, rcond=SAME_NORMAL)
    return -np.einsum("vij,vj->vi", inverse, there.astype(float)), pairs, planes


def eroded(vertices, faces, steps, radius):
    """Return the vertices of the eroded mesh; ValueError where a triangle would turn over."""

    def shape(corners):
        """Area vectors and sides of all triangles."""
        sides = (corners[faces[:, k]] - corners[faces[:, k - 1]] for k in range(3))
        return np.vstack([_normals(corners, faces), *sides])

    before = shape(vertices)

    def keeps(share):
        after = shape(vertices + share * steps)
        return bool(
            np.all(
                np.sum(before * after, axis=1) > 1e-6 * np.sum(before * before, axis=1)
            )
        )

    if not keeps(radius):
        low, high = 0.0, radius
        for _ in range(30):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if keeps(middle) else (low, middle)
        raise ValueError(
            f"edge_radius_m is {radius!r}; expected below {low:.3g}, the smallest triangles leave no room for more"
        )
    return vertices + radius * steps


def _face_rows(core, faces, edges, beside, group, normals, radius):
    """Return data of the faces."""
    n = len(faces)
    data = np.zeros((n, COLUMNS))
    outward = normals[group]
    data[:, 0:3] = -outward
    # all of a group have its offset, bit for bit
    offset = np.zeros(len(normals))
    offset[group] = -np.sum(core[faces[:, 0]] * outward, axis=1) - radius
    data[:, 3] = offset[group]
    filled = np.zeros(n, int)
    along = _unit(core[edges[:, 1]] - core[edges[:, 0]])
    for side, sign in ((0, 1.0), (1, -1.0)):
        edge = np.flatnonzero(beside[:, side] >= 0)
        face = beside[edge, side]
        # at most three edges a face: take them one after another
        order = np.argsort(face, kind="stable")
        edge, face = edge[order], face[order]
        rank = np.arange(len(face)) - np.searchsorted(face, face)
        place = filled[face] + rank
        inward = np.cross(outward[face], along[edge])
        level = np.sum(inward * core[edges[edge, 0]], axis=1)
        for c in range(3):
            data[face, SIDES + 4 * place + c] = sign * inward[:, c]
        data[face, SIDES + 4 * place + 3] = sign * level
        data[face, STRICT + place] = float(side)
        np.add.at(filled, face, 1)
    return data


def _edge_rows(core, edges, beside, group, normals):
    """Return data of the convex edges and rims."""
    along = core[edges[:, 1]] - core[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    one, two = beside[:, 0], beside[:, 1]
    first = -normals[group[np.where(one >= 0, one, two)]]
    second = -normals[group[np.where(two >= 0, two, one)]]
    cross = np.cross(first, second)
    sine = np.sum(cross * along, axis=1)
    angle = np.arctan2(np.linalg.norm(cross, axis=1), np.sum(first * second, axis=1))
    rim = (one < 0) | (two < 0)
    # of the face on the side of the winding low to high, the inward direction; the rim of the other winding mirrored
    turn = _unit(np.cross(-first, along)) * np.where(one >= 0, 1.0, -1.0)[:, None]
    angle[rim] = np.pi
    convex = rim | ((group[one] != group[two]) & (sine > 0.0) & (angle > 1e-9))
    rows = np.zeros((convex.sum(), COLUMNS))
    for at, values in ((0, core[edges[:, 0]]), (3, along), (7, first), (10, turn)):
        rows[:, at : at + 3] = values[convex]
    rows[:, 6], rows[:, 13] = length[convex], angle[convex]
    return rows


def _ranges(owner, n):
    """Begin and end of each of n owners in a sorted list of owners (n, 2)."""
    return np.column_stack(
        [np.searchsorted(owner, np.arange(n), side) for side in ("left", "right")]
    )


def _convex_vertices(core, edges, pairs, planes):
    """Vertices with a set of normals of their own, and the edges' directions from every vertex: owner, direction."""
    owner = edges.ravel()
    rays = _unit(core[edges[:, ::-1].ravel()] - core[owner])
    order = np.argsort(owner, kind="stable")
    owner, rays = owner[order], rays[order]
    n = len(core)
    inside = np.zeros((n, 3))
    np.add.at(inside, pairs[:, 0], planes[pairs[:, 1]])
    inside /= np.maximum(np.linalg.norm(inside, axis=1, keepdims=True), 1e-300)
    # a direction that all edges recede from: perceptron steps away from the worst edge
    for _ in range(40):
        lead = np.sum(inside[owner] * rays, axis=1)
        worst = np.full(n, -np.inf)
        np.maximum.at(worst, owner, lead)
        bad = np.flatnonzero((lead == worst[owner]) & (lead > -LEAST_CONE))
        if not len(bad):
            break
        inside[owner[bad]] -= (lead[bad, None] + 1e-3) * rays[bad]
        inside /= np.maximum(np.linalg.norm(inside, axis=1, keepdims=True), 1e-300)
    lead = np.sum(inside[owner] * rays, axis=1)
    worst = np.full(n, -np.inf)
    np.maximum.at(worst, owner, lead)
    return np.flatnonzero((worst < -LEAST_CONE) & np.isfinite(worst)), owner, rays


def _gentle_neighbours(core, faces, group, normals):
    """Pairs of faces (K, 2) that share a vertex and meet in a concave kink below GENTLE."""
    from scipy.sparse import coo_array

    n = len(faces)
    at = coo_array(
        (np.ones(3 * n), (np.repeat(np.arange(n), 3), faces.ravel())),
        shape=(n, len(core)),
    ).tocsr()
    one, two = (at @ at.T).nonzero()
    outward = normals[group]
    apart = (group[one] != group[two]) & (
        np.sum(outward[one] * outward[two], axis=1) > np.cos(GENTLE)
    )
    one, two = one[apart], two[apart]
    middle = core[faces].mean(axis=1)
    size = np.linalg.norm(np.ptp(core, axis=0))
    above = (
        np.sum((middle[two] - core[faces[one, 0]]) * outward[one], axis=1) > FLAT * size
    )
    order = np.lexsort((two[above], one[above]))
    return np.column_stack([one[above], two[above]])[order]


def split(vertices, faces, radius):
    """Find the features (a `Part`) of a mesh (V, 3) [m], (F, 3); ValueError for no surface or no room."""
    edges, beside = edge_table(faces)
    group, normals = coplanar_groups(vertices, faces, edges, beside)
    steps, pairs, planes = inward_steps(vertices, faces, edges, beside, group, normals)
    core = eroded(vertices, faces, steps, radius)
    # groups whose corners are not equally deep fall apart into triangles with their own planes
    depth = np.einsum("fki,fi->fk", (core - vertices)[faces], normals[group]) + radius
    bent = np.zeros(len(normals), bool)
    bent[group[np.abs(depth).max(axis=1) > SAME_DEPTH * radius]] = True
    loose = bent[group]
    group = np.where(loose, len(normals) + np.cumsum(loose) - 1, group)
    normals = np.vstack([normals, _unit(_normals(core, faces[loose]))])

    face_rows = _face_rows(core, faces, edges, beside, group, normals, radius)
    edge_rows = _edge_rows(core, edges, beside, group, normals)
    chosen, owner, rays = _convex_vertices(core, edges, pairs, planes)
    n_faces, n_edges, n_vertices = len(face_rows), len(edge_rows), len(chosen)
    data = np.zeros((n_faces + n_edges + n_vertices, COLUMNS))
    data[:n_faces], data[n_faces : n_faces + n_edges] = face_rows, edge_rows
    data[n_faces + n_edges :, 0:3] = core[chosen]
    data[:, RADIUS_COLUMN] = radius
    kind = np.repeat([FACE, EDGE, VERTEX], [n_faces, n_edges, n_vertices]).astype(
        np.uint8
    )
    span, corners = (
        np.zeros((len(data), 2), np.int64),
        np.zeros((len(data), 2), np.int64),
    )
    near = _gentle_neighbours(core, faces, group, normals)
    span[:n_faces] = _ranges(near[:, 0], n_faces)
    span[n_faces + n_edges :] = _ranges(owner, len(core))[chosen]
    at = np.unique(np.column_stack([faces.ravel(), np.repeat(group, 3)]), axis=0)
    corners[n_faces + n_edges :] = _ranges(at[:, 0], len(core))[chosen]
    box, cells, begin, items = _cells(core, faces, kind, data, radius)
    return Part(
        kind, data, span, corners, near[:, 1].astype(np.int64), rays, -normals[at[:, 1]], box, cells, begin, items
    )  # fmt: skip


def _cells(core, faces, kind, data, radius):
    """Cells of the mesh's box, about as many as features, and the features that reach into each."""
    n = len(kind)
    low, high = np.zeros((n, 3)), np.zeros((n, 3))
    n_faces = len(faces)
    # a face's wall lies one radius above its triangle
    lifted = core[faces] - radius * data[:n_faces, None, 0:3]
    low[:n_faces], high[:n_faces] = lifted.min(axis=1), lifted.max(axis=1)
    for which in (EDGE, VERTEX):
        rows = data[kind == which]
        ends = np.stack([rows[:, 0:3]] * 2)
        if which == EDGE:
            ends[1] += rows[:, 6:7] * rows[:, 3:6]
        low[kind == which], high[kind == which] = (
            ends.min(axis=0) - radius,
            ends.max(axis=0) + radius,
        )
    lower, upper = low.min(axis=0), high.max(axis=0)
    size = np.maximum(upper - lower, 1e-3 * np.max(upper - lower))
    cell = float((size.prod() / n) ** (1.0 / 3.0))
    lower, upper = lower - 1e-6 * cell, upper + 1e-6 * cell
    shape = np.maximum(np.ceil((upper - lower) / cell), 1).astype(np.int64)
    count = np.zeros(int(shape.prod()) + 1, np.int64)
    put_in_cells(
        low, high, kind, data, lower, cell, shape, count, np.zeros(0, np.int64)
    )
    begin = np.concatenate([[0], np.cumsum(count[:-1])])
    items = np.zeros(max(int(begin[-1]), 1), np.int64)
    put_in_cells(low, high, kind, data, lower, cell, shape, begin[:-1].copy(), items)
    return np.concatenate([lower, upper, [cell]]), shape, begin, items


@kernel
def put_in_cells(low, high, kind, data, lower, cell, shape, place, items):
    """Count the features of each cell in `place`, or, given an array for the items, write them from `place` on."""
    for f in range(low.shape[0]):
        i0, i1 = int((low[f, 0] - lower[0]) / cell), int((high[f, 0] - lower[0]) / cell)
        j0, j1 = int((low[f, 1] - lower[1]) / cell), int((high[f, 1] - lower[1]) / cell)
        k0, k1 = int((low[f, 2] - lower[2]) / cell), int((high[f, 2] - lower[2]) / cell)
        n = data[f]
        reach = 0.500001 * cell * (abs(n[0]) + abs(n[1]) + abs(n[2]))
        for i in range(i0, min(i1 + 1, shape[0])):
            for j in range(j0, min(j1 + 1, shape[1])):
                for k in range(k0, min(k1 + 1, shape[2])):
                    x = lower[0] + (i + 0.5) * cell
                    y = lower[1] + (j + 0.5) * cell
                    z = lower[2] + (k + 0.5) * cell
                    # a slanting face misses most cells of its box
                    if (
                        kind[f] == FACE
                        and abs(n[0] * x + n[1] * y + n[2] * z - n[3]) > reach
                    ):
                        continue
                    c = (i * shape[1] + j) * shape[2] + k
                    if items.shape[0] > 0:
                        items[place[c]] = f
                    place[c] += 1


def join(parts, slide):
    """Return the features of several meshes as the kernels take them; slide: see `Meshes`."""
    begins = {
        name: np.cumsum([0, *(len(getattr(p, name)) for p in parts)])
        for name in Part._fields
    }

    def counted(name, of):
        """Join numbers of the rows of another array, which count on from part to part."""
        return np.concatenate(
            [
                getattr(p, name) + begin
                for p, begin in zip(parts, begins[of], strict=False)
            ]
        )

    spans = [
        p.span
        + np.where(p.kind == VERTEX, begins["rays"][m], begins["near"][m])[:, None]
        for m, p in enumerate(parts)
    ]
    return Meshes(
        **{
            name: np.concatenate([getattr(p, name) for p in parts])
            for name in ("kind", "data", "rays", "normals")
        },
        mesh=np.repeat(np.arange(len(parts)), np.diff(begins["kind"])),
        span=np.concatenate(spans),
        corners=counted("corners", "normals"),
        near=counted("near", "kind"),
        box=np.array([p.box for p in parts]),
        cells=np.column_stack([[p.cells for p in parts], begins["begin"][:-1]]),
        begin=counted("begin", "items"),
        items=counted("items", "kind"),
        seen=np.zeros(begins["kind"][-1], np.int64),
        stamp=np.zeros(1, np.int64),
        slide=np.array([slide]),
    )
