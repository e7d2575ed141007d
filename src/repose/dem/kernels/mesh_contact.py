"""Contact of a body with one feature of a mesh: a face, a convex edge or a convex vertex (see `features`).

The overlap of a body is the largest f(n) = n.(place - centre) - h(n) - edge radius over the normals n of a feature: one
normal for a face, an arc about an edge, a patch of the sphere at a vertex. These sets fit together without gap or
overlap, and so do the conditions under which a feature is touched: the body's deepest point along n lies within the
face, beyond its side along the arc of the edge, and so on. All vectors are in the frame of the mesh.
"""

import math

from .contact import LONGEST_STEP
from .features import EDGE, FACE, RADIUS_COLUMN, SIDES, STRICT
from .geometry import extent, stepped, support_terms, tangents
from .jit import inlined, kernel
from .wall_contact import effective_radius, write_contact

# A contact that is handed over may lie so far outside its new feature [m], or rounding could lose it between two.
SLACK = 1e-8
# An edge bends to its full curvature over this angle from its faces' normals [rad], so that R* has no jump there.
BLEND = 0.2
OUTSIDE = -1e300


@inlined
def ascent_step(g1, g2, q11, q12, q22, f):
    """One Newton step on the sphere, or a scaled gradient step where the Hessian is not definite."""
    a = q11 + f
    c = q22 + f
    det = a * c - q12 * q12
    trace = q11 + q22
    definite = (a > 0.0) and (c > 0.0) and (det > 1e-3 * trace * trace)
    if definite:
        s1 = (c * g1 - q12 * g2) / det
        s2 = (a * g2 - q12 * g1) / det
    else:
        s1 = g1 / trace
        s2 = g2 / trace
    length = math.sqrt(s1 * s1 + s2 * s2)
    if length > LONGEST_STEP:
        s1 *= LONGEST_STEP / length
        s2 *= LONGEST_STEP / length
    return s1, s2


@inlined
def curvature(angle, radius):
    """Curvature of a rounded edge at an angle from the nearest face's normal: 0 there, 1 / radius from BLEND on."""
    x = min(max(angle, 0.0) / BLEND, 1.0)
    return x * x * (3.0 - 2.0 * x) / radius


@kernel
def face_contact(row, parts, face, out):
    """Contact with a face: fills `out`; returns how far inside the triangle the deepest point lies [m]."""
    nx, ny, nz = face[0], face[1], face[2]
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    h, x1, x2, q11, q12, q22 = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    gap = face[3] - (nx * row[0] + ny * row[1] + nz * row[2] + h)
    write_contact(
        out,
        nx,
        ny,
        nz,
        gap,
        math.sqrt(q11 * q22 - q12 * q12),
        h,
        x1,
        x2,
        ux,
        uy,
        uz,
        wx,
        wy,
        wz,
    )
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
    h, x1, x2, q11, q12, q22 = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
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
    gap, _slope, _bend, along, nx, ny, nz, ux, uy, uz, h, x1, x2, q11, q12, q22 = (
        edge_terms(row, parts, edge, angle)
    )
    bent = curvature(min(angle, edge[13] - angle), edge[RADIUS_COLUMN])
    radius = effective_radius(q11, q12, q22, bent, 0.0)
    write_contact(
        out, nx, ny, nz, gap, radius, h, x1, x2, ux, uy, uz, edge[3], edge[4], edge[5]
    )
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
    """Maximum of f within the arc of an edge: fills `out`; returns its angle, how far inside, and the largest f found.

    Inside means between the ends and between the normals of the two faces, as lengths [m]; OUTSIDE without a maximum in
    the arc.
    """
    low, high = 0.0, edge[13]
    first = edge_terms(row, parts, edge, low)
    last = edge_terms(row, parts, edge, high)
    best = max(first[0], last[0])
    inside = min(first[1], -last[1])
    if inside < -SLACK:
        return 0.0, OUTSIDE, best
    angle = (
        0.5 * high
        if first[1] > 0.0 and last[1] < 0.0
        else (0.0 if first[1] <= 0.0 else high)
    )
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
    """Gap f of a vertex for a normal, and the step (s1, s2) to the next normal."""
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    h, x1, x2, q11, q12, q22 = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    dx, dy, dz = vertex[0] - row[0], vertex[1] - row[1], vertex[2] - row[2]
    level = nx * dx + ny * dy + nz * dz - h
    g1 = dx * ux + dy * uy + dz * uz - x1
    g2 = dx * wx + dy * wy + dz * wz - x2
    s1, s2 = ascent_step(g1, g2, q11, q12, q22, level)
    return level - vertex[RADIUS_COLUMN], s1, s2


@kernel
def vertex_contact(row, parts, meshes, feature, nx, ny, nz, out):
    """Contact with a vertex for a normal (already a maximum of f): fills `out`; returns the least sine inside.

    Inside means between the normals of all its faces, that is, on the inner side of every edge.
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
    # along the nearest edge the curvature begins at zero, as on the edge itself
    along = nx * ux + ny * uy + nz * uz
    ux, uy, uz = ux - along * nx, uy - along * ny, uz - along * nz
    inv = 1.0 / math.sqrt(max(ux * ux + uy * uy + uz * uz, 1e-30))
    ux, uy, uz = ux * inv, uy * inv, uz * inv
    wx, wy, wz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    h, x1, x2, q11, q12, q22 = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    edge_radius = vertex[RADIUS_COLUMN]
    gap = (
        nx * (vertex[0] - row[0])
        + ny * (vertex[1] - row[1])
        + nz * (vertex[2] - row[2])
        - h
        - edge_radius
    )
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

    Returns the azimuth (edges), how far inside the feature the contact lies [m], and a lower bound of the distance to
    the feature for a body that does not touch it.
    """
    data = meshes.data[feature]
    if meshes.kind[feature] == FACE:
        inside = face_contact(row, parts, data, out)
        return 0.0, inside, max(out[3], -inside / (1.0 + meshes.slide[0]))
    x, y, z = data[0] - row[0], data[1] - row[1], data[2] - row[2]
    of_edge = meshes.kind[feature] == EDGE
    if of_edge:
        # distance of the centre from the edge
        s = min(max(-(x * data[3] + y * data[4] + z * data[5]), 0.0), data[6])
        x, y, z = x + s * data[3], y + s * data[4], z + s * data[5]
    away = math.sqrt(x * x + y * y + z * z) - radius - data[RADIUS_COLUMN]
    out[3] = away
    if away > 0.0:
        return 0.0, OUTSIDE, away
    if of_edge:
        angle, inside, best = solve_edge(row, parts, data, out)
        if inside == OUTSIDE:
            out[3] = best
        return angle, inside, best
    inside = solve_vertex(row, parts, meshes, feature, out)
    return 0.0, inside * radius, out[3]
