"""Contacts of bodies with meshes (`mesh_contact`): found anew, and tracked on their feature.

A contact that leaves its feature is handed over, with its spring, to the feature that the body touches now.
"""

import math

from . import state as st
from .features import EDGE, FACE
from .frames import contact_to_world, into_frame, rotate_to_world
from .geometry import extent, stepped
from .jit import inlined, kernel
from .mesh_contact import (
    SLACK,
    climb_edge,
    edge_contact,
    face_contact,
    solve_feature,
    vertex_contact,
    vertex_terms,
)
from .neighbours import bounding_radius
from .rows import lane_vector, write_vector
from .walls import (
    DEEPEST_NEW,
    NEXT_LOOK_BEYOND,
    NEXT_LOOK_KNOWN,
    add_wall_contact,
    seen_from,
)

# A search reaches this far beyond the body's box (share of its radius).
MARGIN = 0.5
# The next feature of a contact is sought this far about its place (share of the body's radius), among features whose
# normal differs by at most the angle of this cosine.
NEARBY = 0.05
SAME_NORMAL = 0.9


@inlined
def are_near(meshes, a, b):
    """Whether two faces meet in a gentle concave kink."""
    if meshes.kind[a] != FACE:
        return False
    near = False
    for k in range(meshes.span[a, 0], meshes.span[a, 1]):
        near = near or meshes.near[k] == b
    return near


@inlined
def is_touched(contacts, meshes, n, body, feature, but):
    """Whether a contact of a body, other than `but`, is with a feature or with a gentle neighbour of it."""
    for k in range(n):
        if contacts.body[k] == body and k != but:
            other = contacts.feature[k]
            if other == feature or are_near(meshes, other, feature):
                return True
    return False


@inlined
def cell_range(meshes, mesh, axis, low, high):
    """First and last cell of a mesh along an axis that an interval meets."""
    edge = meshes.box[mesh, 6]
    first = math.floor((low - meshes.box[mesh, axis]) / edge)
    last = math.floor((high - meshes.box[mesh, axis]) / edge)
    return max(first, 0), min(last, meshes.cells[mesh, axis] - 1)


@inlined
def away_from_box(row, parts, meshes, mesh):
    """Lower bound of the distance of a body from the box of a mesh."""
    away = 0.0
    for axis in range(3):
        reach = extent(
            row,
            parts,
            1.0 if axis == 0 else 0.0,
            1.0 if axis == 1 else 0.0,
            1.0 if axis == 2 else 0.0,
        )
        away = max(away, meshes.box[mesh, axis] - row[axis] - reach)
        away = max(away, row[axis] - reach - meshes.box[mesh, 3 + axis])
    return away


@inlined
def look_at_feature(
    row, contacts, counts, parts, walls, meshes, mesh, feature, i, radius, out
):
    """Add the contact of body i with a feature if there is one; returns how far it may move before the next check."""
    angle, inside, free = solve_feature(row, parts, meshes, feature, radius, out)
    if free > 0.0 and out[3] > 0.0:
        return free
    if inside < 0.0:
        return max(free, NEXT_LOOK_BEYOND * radius)
    if out[3] < -DEEPEST_NEW * radius:
        return max(-out[3] - DEEPEST_NEW * radius, NEXT_LOOK_BEYOND * radius)
    if not is_touched(contacts, meshes, counts[st.N_MESHED], i, feature, -1):
        frame = walls.cones.shape[0] + walls.rings.shape[0] + mesh
        if walls.displaced[frame]:
            rotate_to_world(walls.frames[frame], out, 0)
        k = add_wall_contact(contacts, counts, st.N_MESHED, i, mesh, out)
        if k >= 0:
            contacts.feature[k] = feature
            contacts.data[k // st.LANES, st.AZIMUTH + k % st.LANES] = angle
    return NEXT_LOOK_KNOWN * radius


@kernel
def search_mesh(row, contacts, counts, parts, walls, meshes, mesh, i, radius, out):
    """Search for contacts of body i with a mesh; returns how far it may move before the next search."""
    away = away_from_box(row, parts, meshes, mesh)
    if away > 0.0:
        return away
    free = MARGIN * radius
    reach_x = extent(row, parts, 1.0, 0.0, 0.0) + free
    reach_y = extent(row, parts, 0.0, 1.0, 0.0) + free
    reach_z = extent(row, parts, 0.0, 0.0, 1.0) + free
    i0, i1 = cell_range(meshes, mesh, 0, row[0] - reach_x, row[0] + reach_x)
    j0, j1 = cell_range(meshes, mesh, 1, row[1] - reach_y, row[1] + reach_y)
    k0, k1 = cell_range(meshes, mesh, 2, row[2] - reach_z, row[2] + reach_z)
    meshes.stamp[0] += 1
    stamp = meshes.stamp[0]
    for ci in range(i0, i1 + 1):
        for cj in range(j0, j1 + 1):
            for ck in range(k0, k1 + 1):
                c = (
                    meshes.cells[mesh, 3]
                    + (ci * meshes.cells[mesh, 1] + cj) * meshes.cells[mesh, 2]
                    + ck
                )
                for m in range(meshes.begin[c], meshes.begin[c + 1]):
                    feature = meshes.items[m]
                    if meshes.seen[feature] != stamp:
                        meshes.seen[feature] = stamp
                        free = min(
                            free,
                            look_at_feature(
                                row,
                                contacts,
                                counts,
                                parts,
                                walls,
                                meshes,
                                mesh,
                                feature,
                                i,
                                radius,
                                out,
                            ),
                        )
    return free


@inlined
def track(row, parts, meshes, contacts, lane, feature, nx, ny, nz, out):
    """Contact with the feature of the last step: fills `out`; returns how far inside the feature it lies."""
    data = meshes.data[feature]
    if meshes.kind[feature] == FACE:
        return face_contact(row, parts, data, out)
    if meshes.kind[feature] == EDGE:
        angle = contacts[st.AZIMUTH + lane]
        for _ in range(2):
            angle = climb_edge(row, parts, data, angle)
        contacts[st.AZIMUTH + lane] = angle
        along = edge_contact(row, parts, data, angle, out)
        return min(min(angle, data[13] - angle), min(along, data[6] - along))
    for _ in range(2):
        _f, s1, s2 = vertex_terms(row, parts, data, nx, ny, nz)
        nx, ny, nz = stepped(nx, ny, nz, s1, s2)
    return vertex_contact(row, parts, meshes, feature, nx, ny, nz, out)


@kernel
def hand_over(row, parts, meshes, contacts, n, k, radius, end, out, other):
    """Find the feature that a contact has moved to, with a gap up to `end`: fills `out`; returns whether one exists."""
    mesh, old = contacts.wall[k], contacts.feature[k]
    reach = NEARBY * radius
    px, py, pz = row[0] + out[5], row[1] + out[6], row[2] + out[7]
    i0, i1 = cell_range(meshes, mesh, 0, px - reach, px + reach)
    j0, j1 = cell_range(meshes, mesh, 1, py - reach, py + reach)
    k0, k1 = cell_range(meshes, mesh, 2, pz - reach, pz + reach)
    nx, ny, nz = out[0], out[1], out[2]
    best = SAME_NORMAL
    found = False
    for ci in range(i0, i1 + 1):
        for cj in range(j0, j1 + 1):
            for ck in range(k0, k1 + 1):
                c = (
                    meshes.cells[mesh, 3]
                    + (ci * meshes.cells[mesh, 1] + cj) * meshes.cells[mesh, 2]
                    + ck
                )
                for m in range(meshes.begin[c], meshes.begin[c + 1]):
                    feature = meshes.items[m]
                    if feature == old:
                        continue
                    angle, inside, _free = solve_feature(
                        row, parts, meshes, feature, radius, other
                    )
                    if (
                        inside < -SLACK
                        or other[3] > end
                        or other[3] < -DEEPEST_NEW * radius
                    ):
                        continue
                    same = nx * other[0] + ny * other[1] + nz * other[2]
                    if same > best and not is_touched(
                        contacts, meshes, n, contacts.body[k], feature, k
                    ):
                        best = same
                        found = True
                        contacts.feature[k] = feature
                        contacts.data[k // st.LANES, st.AZIMUTH + k % st.LANES] = angle
                        for v in range(8):
                            out[v] = other[v]
    return found


@inlined
def deepest_near(row, parts, meshes, contacts, k, out, other):
    """Where faces meet in a gentle concave kink, keep the contact with the face of the largest overlap."""
    face = contacts.feature[k]
    for m in range(meshes.span[face, 0], meshes.span[face, 1]):
        feature = meshes.near[m]
        inside = face_contact(row, parts, meshes.data[feature], other)
        if inside >= 0.0 and other[3] < out[3]:
            contacts.feature[k] = feature
            for v in range(8):
                out[v] = other[v]


@inlined
def follow_feature(
    row, radius, parts, walls, frame, meshes, contacts, n, k, end, out, other
):
    """Track contact k with a mesh through one step; returns whether it lasts, with `out` in world axes.

    The row of the body, or of the sphere of one, is as seen from the frame of the mesh.
    """
    tile, lane = contacts.data[k // st.LANES], k % st.LANES
    nx, ny, nz = lane_vector(tile, st.NORMAL, lane)
    if walls.displaced[frame]:
        nx, ny, nz = into_frame(walls.frames[frame], nx, ny, nz)
    touching = (
        track(row, parts, meshes, tile, lane, contacts.feature[k], nx, ny, nz, out)
        >= 0.0
    )
    if not touching:
        touching = hand_over(
            row, parts, meshes, contacts, n, k, radius, end, out, other
        )
    if touching and out[3] < 0.0 and meshes.kind[contacts.feature[k]] == FACE:
        deepest_near(row, parts, meshes, contacts, k, out, other)
    contact_to_world(walls, frame, out)
    return touching and out[3] <= end


@inlined
def follow_mesh(bodies, parts, walls, meshes, contacts, n, k, end, out, other, local):
    """Track contact k of a smooth body with a mesh through one step, as `follow_feature`."""
    i = contacts.body[k]
    frame = walls.cones.shape[0] + walls.rings.shape[0] + contacts.wall[k]
    row = seen_from(walls, frame, bodies.rows[i], parts, local)
    radius = bounding_radius(bodies, i)
    return follow_feature(
        row, radius, parts, walls, frame, meshes, contacts, n, k, end, out, other
    )


@inlined
def bring_along(
    bodies, parts, walls, meshes, contacts, counts, mesh, i, out, other, local
):
    """Hand the contacts of body i over to their present features, so that the search does not find these as new."""
    n = counts[st.N_MESHED]
    for k in range(n):
        if contacts.body[k] == i and contacts.wall[k] == mesh:
            follow_mesh(
                bodies, parts, walls, meshes, contacts, n, k, 0.0, out, other, local
            )
            write_vector(
                contacts.data[k // st.LANES],
                st.NORMAL,
                k % st.LANES,
                out[0],
                out[1],
                out[2],
            )


@inlined
def body_at_mesh(
    bodies, meshed, walls, meshes, counts, parts, mesh, i, out, other, local
):
    """Find new contacts of smooth body i with a mesh; returns how far it may move before the next search."""
    frame = walls.cones.shape[0] + walls.rings.shape[0] + mesh
    bring_along(
        bodies, parts, walls, meshes, meshed, counts, mesh, i, out, other, local
    )
    row = seen_from(walls, frame, bodies.rows[i], parts, local)
    return search_mesh(
        row,
        meshed,
        counts,
        parts,
        walls,
        meshes,
        mesh,
        i,
        bounding_radius(bodies, i),
        out,
    )
