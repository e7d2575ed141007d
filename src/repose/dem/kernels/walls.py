"""Exact walls: planes (also discs), the inside of cones and tubes, and rounded ring edges.

The inside of a cone or tube is convex, an intersection of half-spaces whose normals m(theta) turn about the axis. The
overlap of a body is therefore the largest of phi(theta) = m.c + h(m) - k, a search in one variable; a long body in a
narrow tube has two maxima and then two contacts. The edge at the end of a cone is a torus of a small stated radius,
tangent to the cone. Which of the two a body touches is decided by the point projected onto the wall, so force and
overlap pass continuously from one to the other and no band is left without a contact.

Cones and rings are solved in their own frame, whose z axis is theirs (`frames`).
"""

import math

import numpy as np

from . import state as st
from .contact import LONGEST_STEP
from .frames import into_frame, row_in_frame, turn_place, write_plane
from .geometry import extent, support_terms, tangents
from .jit import inlined, kernel
from .lists import move_contact, put_contact

COSINES = np.cos(2.0 * np.pi * np.arange(st.STARTS) / st.STARTS)
SINES = np.sin(2.0 * np.pi * np.arange(st.STARTS) / st.STARTS)
# A body whose overlap is already deeper than this share of its bounding radius came from outside: no contact.
DEEPEST_NEW = 0.3
# Two contacts of one body with one wall closer than this (radians about the axis) are the same contact.
SAME_AZIMUTH = 0.12
# The next look at a body comes after it moved by these shares of its radius at the latest: where it overlaps a
# wall's continuation, beyond the wall's end, and where its contact is known (a second one grows out of the first).
NEXT_LOOK_BEYOND = 0.01
NEXT_LOOK_KNOWN = 0.1
# Concave walls flatter than the body: the relative curvature keeps at least this share of the body's own.
LEAST_RELATIVE_CURVATURE = 0.1


@inlined
def effective_radius(q11, q12, q22, k1, k2):
    """R* of a body (curvature radii Q) on a wall with principal curvatures k1, k2 along Q's axes.

    1 / R*^2 = det(Q^-1 + K); a concave wall has a negative curvature.
    """
    det = q11 * q22 - q12 * q12
    relative = 1.0 + q11 * k1 + q22 * k2 + det * k1 * k2
    return math.sqrt(det / max(relative, LEAST_RELATIVE_CURVATURE))


@inlined
def cone_overlap(row, parts, cone, theta):
    """phi(theta), its first and second derivative, and how far up the wall the body's deepest point lies."""
    cos, sin = math.cos(theta), math.sin(theta)
    mr, mz = cone[0], cone[1]
    nx, ny, nz = mr * cos, mr * sin, mz
    ux, uy, uz = -sin, cos, 0.0
    wx, wy, wz = -mz * cos, -mz * sin, mr
    h, x1, x2, q11, _q12, _q22 = support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
    # the body's point: c + h n + x1 u + x2 w
    px = row[0] + h * nx + x1 * ux + x2 * wx
    py = row[1] + h * ny + x1 * uy + x2 * wy
    pz = row[2] + h * nz + x2 * wz
    value = nx * row[0] + ny * row[1] + nz * row[2] + h - cone[2]
    slope = mr * (ux * px + uy * py)
    bend = mr * mr * q11 - mr * (cos * px + sin * py)
    along = (cos * px + sin * py) * cone[5] + pz * cone[6]
    return value, slope, bend, along


@inlined
def climb_cone(row, parts, cone, theta):
    """One step towards the nearest maximum of phi."""
    _value, slope, bend, _along = cone_overlap(row, parts, cone, theta)
    # where phi is not concave, or nearly flat, a short step uphill
    step = -slope / bend if bend < -1e-7 else math.copysign(0.05, slope)
    return theta + min(max(step, -0.2), 0.2)


@kernel
def cone_contact(row, parts, cone, theta, out):
    """Contact of a body with a cone at azimuth theta (already a maximum of phi): fills `out`.

    out: normal (3), gap, R*, contact point relative to the centre (3). Returns whether the contact lies on the wall.
    """
    cos, sin = math.cos(theta), math.sin(theta)
    mr, mz = cone[0], cone[1]
    nx, ny, nz = mr * cos, mr * sin, mz
    ux, uy, uz = -sin, cos, 0.0
    wx, wy, wz = -mz * cos, -mz * sin, mr
    h, x1, x2, q11, q12, q22 = support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
    gap = cone[2] - (nx * row[0] + ny * row[1] + nz * row[2] + h)
    reach = h + 0.5 * gap
    out[0], out[1], out[2] = nx, ny, nz
    out[3] = gap
    out[5] = reach * nx + x1 * ux + x2 * wx
    out[6] = reach * ny + x1 * uy + x2 * wy
    out[7] = reach * nz + x1 * uz + x2 * wz
    px = row[0] + out[5]
    py = row[1] + out[6]
    pz = row[2] + out[7]
    across = max(cos * px + sin * py, 1e-6)
    # a cone curves towards the body with the radius across / m_r
    out[4] = effective_radius(q11, q12, q22, -mr / across, 0.0)
    along = across * cone[5] + pz * cone[6]
    return along >= cone[3] and along <= cone[4]


@inlined
def ring_newton(row, parts, ring, theta, nx, ny, nz):
    """One Newton step for the distance of a body to a circle: maximum over n, minimum over theta.

    Returns the stepped theta and n, the distance at the old ones and the length of the step.
    """
    cos, sin = math.cos(theta), math.sin(theta)
    radius = ring[0]
    dx = radius * cos - row[0]
    dy = radius * sin - row[1]
    dz = ring[1] - row[2]
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    h, x1, x2, q11, q12, q22 = support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
    f = nx * dx + ny * dy + nz * dz - h
    g1 = dx * ux + dy * uy + dz * uz - x1
    g2 = dx * wx + dy * wy + dz * wz - x2
    # derivatives along the circle
    tx, ty = -radius * sin, radius * cos
    slope = nx * tx + ny * ty
    bend = -radius * (nx * cos + ny * sin)
    c1 = ux * tx + uy * ty
    c2 = wx * tx + wy * ty
    a = q11 + f
    c = q22 + f
    trace = q11 + q22
    det = a * c - q12 * q12
    if not (a > 0.0 and c > 0.0 and det > 1e-3 * trace * trace):
        a = c = trace
        q12 = 0.0
        det = a * c
    # eliminate n: s = A^-1 (g + c dtheta), then the reduced equation for theta
    k1 = (c * c1 - q12 * c2) / det
    k2 = (a * c2 - q12 * c1) / det
    reduced = bend + c1 * k1 + c2 * k2
    pull = slope + g1 * k1 + g2 * k2
    turn = -pull / reduced if reduced > 1e-7 else -math.copysign(0.05, pull)
    turn = min(max(turn, -0.2), 0.2)
    g1 += c1 * turn
    g2 += c2 * turn
    s1 = (c * g1 - q12 * g2) / det
    s2 = (a * g2 - q12 * g1) / det
    length = math.sqrt(s1 * s1 + s2 * s2)
    if length > LONGEST_STEP:
        s1 *= LONGEST_STEP / length
        s2 *= LONGEST_STEP / length
    mx = nx + s1 * ux + s2 * wx
    my = ny + s1 * uy + s2 * wy
    mz = nz + s1 * uz + s2 * wz
    inv = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
    return theta + turn, mx * inv, my * inv, mz * inv, f, abs(turn) + length


@kernel
def ring_contact(row, parts, ring, theta, nx, ny, nz, out):
    """Contact of a body with a ring edge at a solved (theta, n): fills `out` as `cone_contact` does.

    Returns whether the normal points at the part of the torus that is not hidden behind the adjoining walls.
    """
    cos, sin = math.cos(theta), math.sin(theta)
    # frame: u along the edge as far as it is tangent to the body, w across it
    ux, uy, uz = -sin, cos, 0.0
    un = ux * nx + uy * ny
    ux -= un * nx
    uy -= un * ny
    uz -= un * nz
    inv = 1.0 / math.sqrt(ux * ux + uy * uy + uz * uz)
    ux *= inv
    uy *= inv
    uz *= inv
    wx = ny * uz - nz * uy
    wy = nz * ux - nx * uz
    wz = nx * uy - ny * ux
    h, x1, x2, q11, q12, q22 = support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
    edge = ring[2]
    gap = nx * (ring[0] * cos - row[0]) + ny * (ring[0] * sin - row[1]) + nz * (ring[1] - row[2]) - h - edge
    reach = h + 0.5 * gap
    out[0], out[1], out[2] = nx, ny, nz
    out[3] = gap
    outward = nx * cos + ny * sin
    out[4] = effective_radius(q11, q12, q22, -outward / max(ring[0] - edge * outward, edge), 1.0 / edge)
    out[5] = reach * nx + x1 * ux + x2 * wx
    out[6] = reach * ny + x1 * uy + x2 * wy
    out[7] = reach * nz + x1 * uz + x2 * wz
    return outward * ring[3] + nz * ring[4] >= 0.0 and outward * ring[5] + nz * ring[6] >= 0.0


@inlined
def solve_cone(row, parts, cone, theta):
    """Climb to a maximum of phi from a start."""
    for _ in range(40):
        step = climb_cone(row, parts, cone, theta) - theta
        theta += step
        if abs(step) < 1e-9:
            break
    return theta


@inlined
def solve_ring(row, parts, ring, theta, nx, ny, nz):
    """Solve for the nearest point of a circle from a start; returns theta and n."""
    for _ in range(40):
        theta, nx, ny, nz, _f, step = ring_newton(row, parts, ring, theta, nx, ny, nz)
        if step < 1e-9:
            break
    return theta, nx, ny, nz


@inlined
def towards_ring(row, ring, start):
    """Unit vector and distance from a body's centre to a circle's point at one of the st.STARTS."""
    dx = ring[0] * COSINES[start] - row[0]
    dy = ring[0] * SINES[start] - row[1]
    dz = ring[1] - row[2]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    return dx / distance, dy / distance, dz / distance, distance


@inlined
def angle_between(a, b):
    """Smallest angle between two azimuths."""
    turn = 2.0 * math.pi
    d = (a - b) % turn
    return min(d, turn - d)


@inlined
def azimuth(data, k):
    """Azimuth of contact k."""
    return data[k // st.LANES, st.AZIMUTH + k % st.LANES]


@inlined
def known(contacts, last, body, wall, theta):
    """Whether a body touches a wall near this azimuth already."""
    for k in range(last):
        if (
            contacts.body[k] == body
            and contacts.wall[k] == wall
            and angle_between(azimuth(contacts.data, k), theta) < SAME_AZIMUTH
        ):
            return True
    return False


@inlined
def add_wall_contact(contacts, counts, slot, body, wall, out):
    """Append a contact with a relaxed spring; returns its number, or -1 where there is no room."""
    k = counts[slot]
    if k >= contacts.body.shape[0]:
        counts[st.FULL] = 1
        return -1
    counts[slot] = k + 1
    contacts.body[k] = body
    contacts.wall[k] = wall
    put_contact(contacts.data, k, out[0], out[1], out[2])
    return k


@inlined
def drop_wall_contact(contacts, counts, slot, k, ghost):
    """Remove contact k; the last one takes its place, body `ghost` that of the last."""
    last = counts[slot] - 1
    counts[slot] = last
    contacts.body[k] = contacts.body[last]
    contacts.wall[k] = contacts.wall[last]
    contacts.feature[k] = contacts.feature[last]
    move_contact(contacts.data, last, k)
    contacts.body[last] = ghost
    tile = contacts.data[last // st.LANES]
    for c in range(st.OFFSET, st.RADIUS2, st.LANES):
        tile[c + last % st.LANES] = 0.0
    tile[st.RADIUS2 + last % st.LANES] = math.inf


@inlined
def look_again(contacts, counts, walls, body, wall, theta, on_wall, radius, out):
    """Add a contact that is found and new; returns how far the body may move before the next look."""
    if not on_wall or out[3] < -DEEPEST_NEW * radius:
        return NEXT_LOOK_BEYOND * radius
    if not known(contacts, counts[st.N_CURVED], body, wall, theta):
        if walls.turned[wall]:
            turn_place(walls.frames[wall], out, 0)
        k = add_wall_contact(contacts, counts, st.N_CURVED, body, wall, out)
        if k >= 0:
            contacts.data[k // st.LANES, st.AZIMUTH + k % st.LANES] = theta
    return NEXT_LOOK_KNOWN * radius


@kernel
def search_cone(row, contacts, counts, parts, walls, wall, i, radius, profile, out):
    """Look for contacts of body i with a cone; returns how far it may move before the next look."""
    cone = walls.cones[wall]
    step = 2.0 * math.pi / st.STARTS
    for s in range(st.STARTS):
        nx, ny = cone[0] * COSINES[s], cone[0] * SINES[s]
        profile[s] = (
            nx * row[0] + ny * row[1] + cone[1] * row[2] + extent(row, parts, nx, ny, cone[1]) - cone[2]
        )
    nearest = 1e300
    for s in range(st.STARTS):
        here = profile[s]
        if here < profile[s - 1] or here < profile[(s + 1) % st.STARTS]:
            continue
        # phi varies by less than (distance from the axis + reach) * step between starts
        theta = solve_cone(row, parts, cone, s * step)
        inside = cone_contact(row, parts, cone, theta, out)
        if out[3] > 0.0:
            nearest = min(nearest, out[3])
        else:
            nearest = min(nearest, look_again(contacts, counts, walls, i, wall, theta, inside, radius, out))
    return nearest if nearest < 1e300 else 0.0


@kernel
def search_ring(row, contacts, counts, parts, walls, wall, i, radius, profile, out):
    """Look for contacts of body i with a ring edge; returns how far it may move before the next look."""
    ring = walls.rings[wall - walls.cones.shape[0]]
    axial = abs(row[2] - ring[1])
    radial = abs(math.sqrt(row[0] * row[0] + row[1] * row[1]) - ring[0])
    clear = math.sqrt(axial * axial + radial * radial) - ring[2] - radius
    if clear > 0.0:
        return clear
    step = 2.0 * math.pi / st.STARTS
    for s in range(st.STARTS):
        nx, ny, nz, distance = towards_ring(row, ring, s)
        profile[s] = distance - extent(row, parts, nx, ny, nz)
    nearest = 1e300
    for s in range(st.STARTS):
        here = profile[s]
        if here > profile[s - 1] or here > profile[(s + 1) % st.STARTS]:
            continue
        nx, ny, nz, _distance = towards_ring(row, ring, s)
        theta, nx, ny, nz = solve_ring(row, parts, ring, s * step, nx, ny, nz)
        exposed = ring_contact(row, parts, ring, theta, nx, ny, nz, out)
        if out[3] > 0.0:
            nearest = min(nearest, out[3])
        else:
            nearest = min(nearest, look_again(contacts, counts, walls, i, wall, theta, exposed, radius, out))
    return nearest if nearest < 1e300 else 0.0


@kernel
def search_plane(bodies, contacts, counts, parts, plane, wall, i, out):
    """Look for the contact of body i with a plane; returns how far it may move before the next look."""
    row = bodies.rows[i]
    nx, ny, nz = plane[3], plane[4], plane[5]
    dx, dy, dz = plane[0] - row[0], plane[1] - row[1], plane[2] - row[2]
    gap = nx * dx + ny * dy + nz * dz - extent(row, parts, nx, ny, nz)
    if gap > 0.0:
        return gap
    across = nx * dx + ny * dy + nz * dz
    beyond = math.sqrt(max(dx * dx + dy * dy + dz * dz - across * across, 0.0)) - plane[6]
    if beyond > 0.0:
        return beyond
    out[0], out[1], out[2] = nx, ny, nz
    k = add_wall_contact(contacts, counts, st.N_PLANE, i, wall, out)
    if k >= 0:
        write_plane(contacts.data[k // st.LANES], k % st.LANES, plane)
    return 1e300


@inlined
def seen_from(walls, wall, row, parts, local):
    """A body's row in the frame of a curved wall: itself where the frame is the world, else written to `local`."""
    if walls.turned[wall]:
        row_in_frame(row, parts, walls.frames[wall], local)
        return local
    return row


@inlined
def search_curved(bodies, curved, walls, counts, parts, wall, i, profile, out, local):
    """Look for contacts of smooth body i with a cone or ring; returns how far it may move before the next look."""
    radius = bodies.motion[i // st.LANES, st.RADIUS + i % st.LANES]
    row = seen_from(walls, wall, bodies.rows[i], parts, local)
    if wall < walls.cones.shape[0]:
        return search_cone(row, curved, counts, parts, walls, wall, i, radius, profile, out)
    return search_ring(row, curved, counts, parts, walls, wall, i, radius, profile, out)


@inlined
def follow_wall(parts, body, walls, wall, contacts, lane, out, local):
    """Track a contact with a cone or ring through one step; returns whether it lies on the wall.

    `out` and the contact's normal are in the world, the azimuth in the frame of the wall.
    """
    n_cones = walls.cones.shape[0]
    theta = contacts[st.AZIMUTH + lane]
    row = seen_from(walls, wall, body, parts, local)
    if wall < n_cones:
        cone = walls.cones[wall]
        for _ in range(2):
            theta = climb_cone(row, parts, cone, theta)
        on_wall = cone_contact(row, parts, cone, theta, out)
    else:
        ring = walls.rings[wall - n_cones]
        n = st.NORMAL + lane
        nx, ny, nz = contacts[n], contacts[n + st.LANES], contacts[n + 2 * st.LANES]
        if walls.turned[wall]:
            nx, ny, nz = into_frame(walls.frames[wall], nx, ny, nz)
        for _ in range(2):
            theta, nx, ny, nz, _f, _step = ring_newton(row, parts, ring, theta, nx, ny, nz)
        on_wall = ring_contact(row, parts, ring, theta, nx, ny, nz, out)
    contacts[st.AZIMUTH + lane] = theta
    if walls.turned[wall]:
        turn_place(walls.frames[wall], out, 0)
        turn_place(walls.frames[wall], out, 5)
    return on_wall
