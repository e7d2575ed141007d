"""Contacts of bodies with meshes: faces, convex edges, convex vertices (see `features`), in the frame of the mesh.

The overlap of a body is the largest f(n) = n.(place - centre) - h(n) - edge radius over the normals n of a feature: one
normal for a face, an arc about an edge, a patch of the sphere at a vertex. These sets fit together without gap or
overlap, and so do the conditions under which a feature is touched: the body's deepest point along n lies within the
face, beyond its side along the arc of the edge, and so on. A contact whose feature is no longer the one touched is
handed over to the feature that is, with its spring.
"""

import math

from . import state as st
from .contact import ascent_step
from .features import EDGE, FACE, RADIUS_COLUMN, SIDES, STRICT
from .frames import into_frame, row_in_frame, turn_place
from .geometry import extent, support_terms, tangents
from .jit import inlined, kernel
from .walls import (
    DEEPEST_NEW,
    NEXT_LOOK_BEYOND,
    NEXT_LOOK_KNOWN,
    add_wall_contact,
    effective_radius,
)

# A look searches this far beyond the body's box (share of its radius).
MARGIN = 0.5
# A handed over contact may lie so far outside its new feature [m]: rounding must not lose it between two.
SLACK = 1e-8
# It is looked for this far about its place (share of the body's radius), among features whose normal turned by at most
# the angle of this cosine.
NEARBY = 0.05
SAME_NORMAL = 0.9
# An edge bends to its full curvature over this angle from its faces' normals [rad], so that R* has no jump there.
BLEND = 0.2
OUTSIDE = -1e300


@inlined
def curvature(angle, radius):
    """Curvature of a rounded edge at an angle from the nearest face's normal: 0 there, 1 / radius from BLEND on."""
    x = min(max(angle, 0.0) / BLEND, 1.0)
    return x * x * (3.0 - 2.0 * x) / radius


@inlined
def write_contact(out, nx, ny, nz, gap, radius, h, x1, x2, ux, uy, uz, wx, wy, wz):
    """Fill `out`: normal (3), gap, R*, contact point relative to the centre (3)."""
    reach = h + 0.5 * gap
    out[0], out[1], out[2] = nx, ny, nz
    out[3], out[4] = gap, radius
    out[5] = reach * nx + x1 * ux + x2 * wx
    out[6] = reach * ny + x1 * uy + x2 * wy
    out[7] = reach * nz + x1 * uz + x2 * wz


@kernel
def face_contact(row, parts, face, out):
    """Contact with a face: fills `out`; returns how far inside the triangle the deepest point lies [m].

    A point on a side belongs to one of the two triangles that share it; for the other it lies just outside.
    """
    nx, ny, nz = face[0], face[1], face[2]
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    h, x1, x2, q11, q12, q22 = support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
    gap = face[3] - (nx * row[0] + ny * row[1] + nz * row[2] + h)
    write_contact(out, nx, ny, nz, gap, math.sqrt(q11 * q22 - q12 * q12), h, x1, x2, ux, uy, uz, wx, wy, wz)
    px, py, pz = row[0] + out[5], row[1] + out[6], row[2] + out[7]
    inside = 1e300
    for side in range(3):
        s = SIDES + 4 * side
        depth = face[s] * px + face[s + 1] * py + face[s + 2] * pz - face[s + 3]
        if depth == 0.0 and face[STRICT + side] > 0.0:
            depth = -1e-300
        inside = min(inside, depth)
    return inside


@inlined
def edge_terms(row, parts, edge, angle):
    """f, its slope and bend at an angle about an edge, how far along the edge the deepest point lies, and the rest."""
    cos, sin = math.cos(angle), math.sin(angle)
    nx, ny, nz = (
        edge[7] * cos + edge[10] * sin,
        edge[8] * cos + edge[11] * sin,
        edge[9] * cos + edge[12] * sin,
    )
    ux, uy, uz = (
        edge[10] * cos - edge[7] * sin,
        edge[11] * cos - edge[8] * sin,
        edge[12] * cos - edge[9] * sin,
    )
    wx, wy, wz = edge[3], edge[4], edge[5]
    h, x1, x2, q11, q12, q22 = support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
    dx, dy, dz = edge[0] - row[0], edge[1] - row[1], edge[2] - row[2]
    level = nx * dx + ny * dy + nz * dz - h
    slope = ux * dx + uy * dy + uz * dz - x1
    along = x2 - (wx * dx + wy * dy + wz * dz)
    return (
        level - edge[RADIUS_COLUMN],
        slope,
        -(level + q11),
        along,
        nx,
        ny,
        nz,
        ux,
        uy,
        uz,
        h,
        x1,
        x2,
        q11,
        q12,
        q22,
    )


@kernel
def edge_contact(row, parts, edge, angle, out):
    """Contact with an edge at an angle (already a maximum of f): fills `out`; returns how far along it lies [m]."""
    gap, _slope, _bend, along, nx, ny, nz, ux, uy, uz, h, x1, x2, q11, q12, q22 = edge_terms(
        row, parts, edge, angle
    )
    bent = curvature(min(angle, edge[13] - angle), edge[RADIUS_COLUMN])
    radius = effective_radius(q11, q12, q22, bent, 0.0)
    write_contact(out, nx, ny, nz, gap, radius, h, x1, x2, ux, uy, uz, edge[3], edge[4], edge[5])
    return along


@inlined
def climb_edge(row, parts, edge, angle):
    """One Newton step towards the maximum of f about an edge."""
    terms = edge_terms(row, parts, edge, angle)
    slope, bend = terms[1], terms[2]
    step = -slope / bend if bend < 0.0 else math.copysign(0.05, slope)
    return angle + min(max(step, -0.2), 0.2)


@kernel
def solve_edge(row, parts, edge, out):
    """Maximum of f within the arc of an edge: fills `out`; returns its angle, how far inside, and the largest f met.

    Inside means: between the ends and between the normals of the two faces, all as lengths [m]; OUTSIDE without a
    maximum in the arc.
    """
    low, high = 0.0, edge[13]
    first = edge_terms(row, parts, edge, low)
    last = edge_terms(row, parts, edge, high)
    best = max(first[0], last[0])
    inside = min(first[1], -last[1])
    if inside < -SLACK:
        return 0.0, OUTSIDE, best
    angle = 0.5 * high if first[1] > 0.0 and last[1] < 0.0 else (0.0 if first[1] <= 0.0 else high)
    for _ in range(40):
        if not (first[1] > 0.0 and last[1] < 0.0):
            break
        terms = edge_terms(row, parts, edge, angle)
        slope, bend = terms[1], terms[2]
        if slope > 0.0:
            low = angle
        else:
            high = angle
        step = -slope / bend if bend < 0.0 else math.copysign(0.05, slope)
        if not low <= angle + step <= high:
            step = 0.5 * (low + high) - angle
        angle += step
        if abs(step) < 1e-10:
            break
    along = edge_contact(row, parts, edge, angle, out)
    return angle, min(inside, min(along, edge[6] - along)), max(best, out[3])


@inlined
def vertex_terms(row, parts, vertex, nx, ny, nz):
    """f of a vertex for a normal, the step to the next normal and what `write_contact` needs."""
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    h, x1, x2, q11, q12, q22 = support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
    dx, dy, dz = vertex[0] - row[0], vertex[1] - row[1], vertex[2] - row[2]
    level = nx * dx + ny * dy + nz * dz - h
    g1 = dx * ux + dy * uy + dz * uz - x1
    g2 = dx * wx + dy * wy + dz * wz - x2
    s1, s2 = ascent_step(g1, g2, q11, q12, q22, level)
    return level - vertex[RADIUS_COLUMN], s1, s2


@inlined
def stepped(nx, ny, nz, s1, s2):
    """A unit vector after a step in its tangent plane."""
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    x, y, z = nx + s1 * ux + s2 * wx, ny + s1 * uy + s2 * wy, nz + s1 * uz + s2 * wz
    inv = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * inv, y * inv, z * inv


@kernel
def vertex_contact(row, parts, meshes, feature, nx, ny, nz, out):
    """Contact with a vertex for a normal (already a maximum of f): fills `out`; returns the least sine inside.

    Inside is what lies between the normals of all its faces, that is across from every edge.
    """
    vertex = meshes.data[feature]
    inside = 1e300
    ux, uy, uz = 1.0, 0.0, 0.0
    for k in range(meshes.span[feature, 0], meshes.span[feature, 1]):
        ray = meshes.rays[k]
        sine = nx * ray[0] + ny * ray[1] + nz * ray[2]
        if sine < inside:
            inside = sine
            ux, uy, uz = ray[0], ray[1], ray[2]
    nearest = -1.0
    for k in range(meshes.corners[feature, 0], meshes.corners[feature, 1]):
        normal = meshes.normals[k]
        nearest = max(nearest, nx * normal[0] + ny * normal[1] + nz * normal[2])
    # along the nearest edge the curvature begins with nothing, as on the edge itself
    along = nx * ux + ny * uy + nz * uz
    ux, uy, uz = ux - along * nx, uy - along * ny, uz - along * nz
    inv = 1.0 / math.sqrt(max(ux * ux + uy * uy + uz * uz, 1e-30))
    ux, uy, uz = ux * inv, uy * inv, uz * inv
    wx, wy, wz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    h, x1, x2, q11, q12, q22 = support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
    edge_radius = vertex[RADIUS_COLUMN]
    gap = nx * (vertex[0] - row[0]) + ny * (vertex[1] - row[1]) + nz * (vertex[2] - row[2]) - h - edge_radius
    across = curvature(math.acos(min(max(nearest, -1.0), 1.0)), edge_radius)
    bent = min(across, curvature(math.asin(min(max(inside, 0.0), 1.0)), edge_radius))
    radius = effective_radius(q11, q12, q22, bent, across)
    write_contact(out, nx, ny, nz, gap, radius, h, x1, x2, ux, uy, uz, wx, wy, wz)
    return inside


@kernel
def solve_vertex(row, parts, meshes, feature, out):
    """Maximum of f of a vertex from the best of its faces' normals: fills `out`; returns the least sine inside."""
    vertex = meshes.data[feature]
    x, y, z = vertex[0] - row[0], vertex[1] - row[1], vertex[2] - row[2]
    inv = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-300)
    bx, by, bz = x * inv, y * inv, z * inv
    best = x * bx + y * by + z * bz - extent(row, parts, bx, by, bz)
    for k in range(meshes.corners[feature, 0], meshes.corners[feature, 1]):
        normal = meshes.normals[k]
        value = (
            x * normal[0]
            + y * normal[1]
            + z * normal[2]
            - extent(row, parts, normal[0], normal[1], normal[2])
        )
        if value > best:
            best = value
            bx, by, bz = normal[0], normal[1], normal[2]
    best, s1, s2 = vertex_terms(row, parts, vertex, bx, by, bz)
    for _ in range(60):
        if s1 * s1 + s2 * s2 < 1e-20:
            break
        nx, ny, nz = stepped(bx, by, bz, s1, s2)
        value, r1, r2 = vertex_terms(row, parts, vertex, nx, ny, nz)
        if value < best - 1e-15:
            # the step went downhill: halve it
            s1 *= 0.5
            s2 *= 0.5
        else:
            best, s1, s2 = value, r1, r2
            bx, by, bz = nx, ny, nz
    return vertex_contact(row, parts, meshes, feature, bx, by, bz, out)


@inlined
def solve_feature(row, parts, meshes, feature, radius, out):
    """Contact of a body (in the frame of the mesh) with a feature: fills `out`.

    Returns the azimuth (edges), how far inside the feature it lies [m], a distance that the body must go at least
    before it can touch the feature where it does not.
    """
    data = meshes.data[feature]
    if meshes.kind[feature] == FACE:
        inside = face_contact(row, parts, data, out)
        return 0.0, inside, max(out[3], -inside / (1.0 + meshes.slide[0]))
    x, y, z = data[0] - row[0], data[1] - row[1], data[2] - row[2]
    if meshes.kind[feature] == EDGE:
        # distance of the centre from the edge
        s = min(max(-(x * data[3] + y * data[4] + z * data[5]), 0.0), data[6])
        x, y, z = x + s * data[3], y + s * data[4], z + s * data[5]
        away = math.sqrt(x * x + y * y + z * z) - radius - data[RADIUS_COLUMN]
        out[3] = away
        if away > 0.0:
            return 0.0, OUTSIDE, away
        angle, inside, best = solve_edge(row, parts, data, out)
        if inside == OUTSIDE:
            out[3] = best
        return angle, inside, best
    away = math.sqrt(x * x + y * y + z * z) - radius - data[RADIUS_COLUMN]
    out[3] = away
    if away > 0.0:
        return 0.0, OUTSIDE, away
    inside = solve_vertex(row, parts, meshes, feature, out)
    return 0.0, inside * radius, out[3]


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
    """Whether a contact of a body, other than `but`, is the one with a feature or with its gentle neighbour."""
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
    """How far a body is from the box of a mesh, at least."""
    away = 0.0
    for axis in range(3):
        reach = extent(
            row, parts, 1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0
        )
        away = max(away, meshes.box[mesh, axis] - row[axis] - reach)
        away = max(away, row[axis] - reach - meshes.box[mesh, 3 + axis])
    return away


@inlined
def look_at_feature(row, contacts, counts, parts, walls, meshes, mesh, feature, i, radius, out):
    """Add the contact of body i with a feature if there is one; returns how far it may move before the next look."""
    angle, inside, free = solve_feature(row, parts, meshes, feature, radius, out)
    if free > 0.0 and out[3] > 0.0:
        return free
    if inside < 0.0:
        return max(free, NEXT_LOOK_BEYOND * radius)
    if out[3] < -DEEPEST_NEW * radius:
        return max(-out[3] - DEEPEST_NEW * radius, NEXT_LOOK_BEYOND * radius)
    if not is_touched(contacts, meshes, counts[st.N_MESHED], i, feature, -1):
        frame = walls.cones.shape[0] + walls.rings.shape[0] + mesh
        if walls.turned[frame]:
            turn_place(walls.frames[frame], out, 0)
        k = add_wall_contact(contacts, counts, st.N_MESHED, i, mesh, out)
        if k >= 0:
            contacts.feature[k] = feature
            contacts.data[k // st.LANES, st.AZIMUTH + k % st.LANES] = angle
    return NEXT_LOOK_KNOWN * radius


@kernel
def search_mesh(row, contacts, counts, parts, walls, meshes, mesh, i, radius, out):
    """Look for contacts of body i with a mesh; returns how far it may move before the next look."""
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
                c = meshes.cells[mesh, 3] + (ci * meshes.cells[mesh, 1] + cj) * meshes.cells[mesh, 2] + ck
                for m in range(meshes.begin[c], meshes.begin[c + 1]):
                    feature = meshes.items[m]
                    if meshes.seen[feature] != stamp:
                        meshes.seen[feature] = stamp
                        free = min(
                            free,
                            look_at_feature(
                                row, contacts, counts, parts, walls, meshes, mesh, feature, i, radius, out
                            ),
                        )
    return free


@inlined
def track(row, parts, meshes, contacts, lane, feature, nx, ny, nz, out):
    """Contact with the feature it had in the last step: fills `out`; returns how far inside it lies."""
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
def hand_over(row, parts, meshes, contacts, n, k, radius, out, other):
    """Find the feature that a contact has come to; returns whether there is one, `out` then holds the contact."""
    mesh = contacts.wall[k]
    old = contacts.feature[k]
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
                c = meshes.cells[mesh, 3] + (ci * meshes.cells[mesh, 1] + cj) * meshes.cells[mesh, 2] + ck
                for m in range(meshes.begin[c], meshes.begin[c + 1]):
                    feature = meshes.items[m]
                    if feature == old:
                        continue
                    angle, inside, _free = solve_feature(row, parts, meshes, feature, radius, other)
                    if inside < -SLACK or other[3] > 0.0 or other[3] < -DEEPEST_NEW * radius:
                        continue
                    same = nx * other[0] + ny * other[1] + nz * other[2]
                    if same > best and not is_touched(contacts, meshes, n, contacts.body[k], feature, k):
                        best = same
                        found = True
                        contacts.feature[k] = feature
                        contacts.data[k // st.LANES, st.AZIMUTH + k % st.LANES] = angle
                        for v in range(8):
                            out[v] = other[v]
    return found


@inlined
def deepest_near(row, parts, meshes, contacts, k, out, other):
    """Where faces meet in a gentle concave kink, leave a contact with the one that is overlapped most."""
    face = contacts.feature[k]
    for m in range(meshes.span[face, 0], meshes.span[face, 1]):
        feature = meshes.near[m]
        inside = face_contact(row, parts, meshes.data[feature], other)
        if inside >= 0.0 and other[3] < out[3]:
            contacts.feature[k] = feature
            for v in range(8):
                out[v] = other[v]


@inlined
def follow_mesh(bodies, parts, walls, meshes, contacts, n, k, out, other, local):
    """Track contact k with a mesh through one step; returns whether there is one, `out` in the world."""
    mesh, i = contacts.wall[k], contacts.body[k]
    frame = walls.cones.shape[0] + walls.rings.shape[0] + mesh
    tile, lane = contacts.data[k // st.LANES], k % st.LANES
    row = bodies.rows[i]
    at = st.NORMAL + lane
    nx, ny, nz = tile[at], tile[at + st.LANES], tile[at + 2 * st.LANES]
    if walls.turned[frame]:
        row_in_frame(row, parts, walls.frames[frame], local)
        row = local
        nx, ny, nz = into_frame(walls.frames[frame], nx, ny, nz)
    inside = track(row, parts, meshes, tile, lane, contacts.feature[k], nx, ny, nz, out)
    touching = inside >= 0.0
    if not touching:
        radius = bodies.motion[i // st.LANES, st.RADIUS + i % st.LANES]
        touching = hand_over(row, parts, meshes, contacts, n, k, radius, out, other)
    if touching and out[3] < 0.0 and meshes.kind[contacts.feature[k]] == FACE:
        deepest_near(row, parts, meshes, contacts, k, out, other)
    if walls.turned[frame]:
        turn_place(walls.frames[frame], out, 0)
        turn_place(walls.frames[frame], out, 5)
    return touching and out[3] <= 0.0


@inlined
def bring_along(bodies, parts, walls, meshes, contacts, counts, mesh, i, out, other, local):
    """Hand the contacts of body i over to the features they have come to, which are not new ones then."""
    n = counts[st.N_MESHED]
    for k in range(n):
        if contacts.body[k] == i and contacts.wall[k] == mesh:
            follow_mesh(bodies, parts, walls, meshes, contacts, n, k, out, other, local)
            for c in range(3):
                contacts.data[k // st.LANES, st.NORMAL + c * st.LANES + k % st.LANES] = out[c]


@inlined
def body_at_mesh(bodies, meshed, walls, meshes, counts, parts, mesh, i, out, other, local):
    """Find new contacts of smooth body i with a mesh; returns how far it may move before the next look."""
    frame = walls.cones.shape[0] + walls.rings.shape[0] + mesh
    radius = bodies.motion[i // st.LANES, st.RADIUS + i % st.LANES]
    bring_along(bodies, parts, walls, meshes, meshed, counts, mesh, i, out, other, local)
    row = bodies.rows[i]
    if walls.turned[frame]:
        row_in_frame(row, parts, walls.frames[frame], local)
        row = local
    return search_mesh(row, meshed, counts, parts, walls, meshes, mesh, i, radius, out)
