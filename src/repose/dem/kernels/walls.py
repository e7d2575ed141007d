"""Contacts of bodies with planes, cones and ring edges, found anew and tracked from step to step (see `wall_contact`).

A contact begins where a body in front of the wall reaches it. A body that overlaps the wall's surface beyond its end,
or from behind, is past the wall: a contact that began with this overlap would throw it. So it has no contact until it
has been clear of the surface. `WallContacts.deepest` is the largest overlap with which a contact may begin: infinite,
but for a body past the wall the overlap at the other wall from which it slides onto this one.
"""

import math

import numpy as np

from . import state as st
from .frames import (
    contact_to_world,
    into_frame,
    rotate_to_world,
    row_in_frame,
    write_plane,
)
from .geometry import extent
from .jit import inlined, kernel
from .lists import move_contact, put_contact
from .neighbours import take_place
from .wall_contact import (
    climb_cone,
    cone_contact,
    ring_contact,
    ring_newton,
    solve_cone,
    solve_ring,
    sphere_on_cone,
    sphere_on_ring,
)

COSINES = np.cos(2.0 * np.pi * np.arange(st.STARTS) / st.STARTS)
SINES = np.sin(2.0 * np.pi * np.arange(st.STARTS) / st.STARTS)
# A body whose overlap with a curved wall or mesh is already deeper than this share of its bounding radius came from
# outside: no contact.
DEEPEST_NEW = 0.3
# Two contacts of one body with one wall closer than this (radians about the axis) are the same contact.
SAME_AZIMUTH = 0.12
# A body is searched again after it moved by these shares of its radius at the latest: where it overlaps a wall's
# continuation, beyond the wall's end, and where its contact is known (a second contact grows out of the first).
NEXT_LOOK_BEYOND = 0.01
NEXT_LOOK_KNOWN = 0.1


@inlined
def towards_ring(row, ring, start):
    """Return unit vector and distance from a body's centre to a point of a circle, number `start` of st.STARTS."""
    dx, dy, dz = (
        ring[0] * COSINES[start] - row[0],
        ring[0] * SINES[start] - row[1],
        ring[1] - row[2],
    )
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
    """Whether a body already touches a wall near this azimuth."""
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
    k = take_place(counts, slot, contacts.body.shape[0])
    if k >= 0:
        contacts.body[k] = body
        contacts.wall[k] = wall
        put_contact(contacts.data, k, out[0], out[1], out[2])
    return k


@inlined
def drop_wall_contact(contacts, counts, slot, k, ghost):
    """Remove contact k by a swap with the last one, whose freed place points at `ghost`."""
    last = counts[slot] - 1
    counts[slot] = last
    contacts.body[k] = contacts.body[last]
    contacts.wall[k] = contacts.wall[last]
    contacts.feature[k] = contacts.feature[last]
    move_contact(contacts.data, last, k)
    contacts.body[last] = ghost
    # neither a radius nor a law's state: no force on the ghost
    put_contact(contacts.data, last, 0.0, 0.0, 1.0)
    contacts.data[last // st.LANES, st.RADIUS2 + last % st.LANES] = math.inf


@inlined
def touches_others(contacts, n, body, but):
    """Whether a body has any of the first n contacts other than number `but`."""
    for k in range(n):  # noqa: SIM110  (kernels have no generators)
        if contacts.body[k] == body and k != but:
            return True
    return False


@inlined
def overlap_elsewhere(contacts, n, body, wall):
    """Compute the deepest overlap of a body with the other curved walls; 0.0 where it touches none."""
    depth = 0.0
    for k in range(n):
        if contacts.body[k] == body and contacts.wall[k] != wall:
            depth = max(depth, -contacts.data[k // st.LANES, st.GAP + k % st.LANES])
    return depth


@inlined
def slid_off(bodies, contacts, walls, n, k, depth):
    """Note that contact k with a curved wall slid over the wall's end with an overlap of `depth`.

    The contact with the next wall begins with this overlap at most, so that wall is searched in the next step. Where
    the body touches another wall, it is not past this wall.
    """
    wall, i = contacts.wall[k], contacts.body[k]
    now = bodies.displacement[i] + walls.approach[st.WALL_PATH]
    for w in range(contacts.deepest.shape[0]):
        contacts.deepest[w, i] = max(contacts.deepest[w, i], depth)
        if w != wall:
            contacts.limit[w, i] = min(contacts.limit[w, i], now)
    if not touches_others(contacts, n, i, k):
        contacts.deepest[wall, i] = depth
        # a second contact may have grown out of this one since the last search: the next search counts from there
        contacts.limit[wall, i] -= (
            NEXT_LOOK_KNOWN * bodies.motion[i // st.LANES, st.RADIUS + i % st.LANES]
        )


@inlined
def look_again(
    contacts, counts, walls, body, wall, theta, on_wall, radius, deepest, moved, out
):
    """Add a contact that is found and new; returns how far the body may move before the next check."""
    if out[3] > 0.0:
        return out[3]
    if deepest < math.inf:
        deepest = max(
            deepest, overlap_elsewhere(contacts, counts[st.N_CURVED], body, wall)
        )
    if not on_wall or out[3] < -min(DEEPEST_NEW * radius, deepest + moved):
        if deepest == math.inf and not touches_others(
            contacts, counts[st.N_CURVED], body, -1
        ):
            deepest = 0.0
        contacts.deepest[wall, body] = deepest
        return NEXT_LOOK_BEYOND * radius
    if not known(contacts, counts[st.N_CURVED], body, wall, theta):
        if walls.displaced[wall]:
            rotate_to_world(walls.frames[wall], out, 0)
        k = add_wall_contact(contacts, counts, st.N_CURVED, body, wall, out)
        if k >= 0:
            contacts.data[k // st.LANES, st.AZIMUTH + k % st.LANES] = theta
    return NEXT_LOOK_KNOWN * radius


@kernel
def search_cone(
    row, contacts, counts, parts, walls, wall, i, radius, deepest, moved, profile, out
):
    """Search for contacts of body i with a cone; returns how far it may move before the next search."""
    cone = walls.cones[wall]
    step = 2.0 * math.pi / st.STARTS
    for s in range(st.STARTS):
        nx, ny = cone[0] * COSINES[s], cone[0] * SINES[s]
        profile[s] = (
            nx * row[0]
            + ny * row[1]
            + cone[1] * row[2]
            + extent(row, parts, nx, ny, cone[1])
            - cone[2]
        )
    nearest = 1e300
    for s in range(st.STARTS):
        here = profile[s]
        if here < profile[s - 1] or here < profile[(s + 1) % st.STARTS]:
            continue
        # phi varies by less than (distance from the axis + reach) * step between starts
        theta = solve_cone(row, parts, cone, s * step)
        inside = cone_contact(row, parts, cone, theta, out)
        free = look_again(
            contacts, counts, walls, i, wall, theta, inside, radius, deepest, moved, out
        )
        nearest = min(nearest, free)
    return nearest if nearest < 1e300 else 0.0


@kernel
def search_ring(
    row, contacts, counts, parts, walls, wall, i, radius, deepest, moved, profile, out
):
    """Search for contacts of body i with a ring edge; returns how far it may move before the next search."""
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
        free = look_again(
            contacts,
            counts,
            walls,
            i,
            wall,
            theta,
            exposed,
            radius,
            deepest,
            moved,
            out,
        )
        nearest = min(nearest, free)
    return nearest if nearest < 1e300 else 0.0


@kernel
def search_plane(bodies, contacts, counts, parts, plane, wall, i, out):
    """Search for the contact of body i with a plane; returns how far it may move before the next search."""
    row = bodies.rows[i]
    nx, ny, nz = plane[3], plane[4], plane[5]
    dx, dy, dz = plane[0] - row[0], plane[1] - row[1], plane[2] - row[2]
    gap = nx * dx + ny * dy + nz * dz - extent(row, parts, nx, ny, nz)
    if gap > 0.0:
        contacts.deepest[wall, i] = math.inf
        return gap
    across = nx * dx + ny * dy + nz * dz
    beyond = (
        math.sqrt(max(dx * dx + dy * dy + dz * dz - across * across, 0.0)) - plane[6]
    )
    if beyond > 0.0 or across < 0.0:
        contacts.deepest[wall, i] = 0.0
    if contacts.deepest[wall, i] == 0.0:
        return -gap
    out[0], out[1], out[2] = nx, ny, nz
    k = add_wall_contact(contacts, counts, st.N_PLANE, i, wall, out)
    if k >= 0:
        write_plane(contacts.data[k // st.LANES], k % st.LANES, plane)
    return 1e300


@inlined
def seen_from(walls, wall, row, parts, local):
    """Return the row of a body in the frame of a curved wall, written to `local` unless that is the world's."""
    if walls.displaced[wall]:
        row_in_frame(row, parts, walls.frames[wall], local)
        return local
    return row


@inlined
def sphere_beyond(x, y, z, radius, walls, wall, out):
    """Contact of a sphere with a cone or ring in its frame: fills `out`; returns its distance beyond the end [m]."""
    n_cones = walls.cones.shape[0]
    if wall < n_cones:
        return sphere_on_cone(x, y, z, radius, walls.cones[wall], out)
    return sphere_on_ring(x, y, z, radius, walls.rings[wall - n_cones], out)


@inlined
def sphere_on_wall(row, walls, wall, out):
    """`sphere_beyond` of a body that is a sphere; returns whether it lies on the wall."""
    return (
        sphere_beyond(row[0], row[1], row[2], row[st.SPHERE_RADIUS], walls, wall, out)
        <= 0.0
    )


@inlined
def search_sphere(row, contacts, counts, walls, wall, i, radius, deepest, moved, out):
    """Search for the only contact of a sphere with a cone or ring; while it lasts no further search is due."""
    on_wall = sphere_on_wall(row, walls, wall, out)
    if out[3] > 0.0:
        return out[3]
    free = look_again(
        contacts, counts, walls, i, wall, 0.0, on_wall, radius, deepest, moved, out
    )
    return 1e300 if known(contacts, counts[st.N_CURVED], i, wall, 0.0) else free


@inlined
def search_curved(bodies, curved, walls, counts, parts, wall, i, reading, scratch):
    """Find new contacts of smooth body i with a cone or ring; returns how far it may move before the next search."""
    profile, out = scratch.profile, scratch.out
    radius = bodies.motion[i // st.LANES, st.RADIUS + i % st.LANES]
    # a body that is past a wall is searched whenever it moved by NEXT_LOOK_BEYOND
    deepest, moved = (
        curved.deepest[wall, i],
        reading - curved.limit[wall, i] + NEXT_LOOK_BEYOND * radius,
    )
    curved.deepest[wall, i] = math.inf
    row = seen_from(walls, wall, bodies.rows[i], parts, scratch.local)
    if parts == st.SPHERES:
        return search_sphere(
            row, curved, counts, walls, wall, i, radius, deepest, moved, out
        )
    if wall < walls.cones.shape[0]:
        return search_cone(
            row,
            curved,
            counts,
            parts,
            walls,
            wall,
            i,
            radius,
            deepest,
            moved,
            profile,
            out,
        )
    return search_ring(
        row, curved, counts, parts, walls, wall, i, radius, deepest, moved, profile, out
    )


@inlined
def follow_wall(parts, body, walls, wall, contacts, lane, out, local):
    """Follow a contact with a cone or ring by a step: fills `out` in world axes; returns whether it is on the wall."""
    n_cones = walls.cones.shape[0]
    theta = contacts[st.AZIMUTH + lane]
    row = seen_from(walls, wall, body, parts, local)
    if parts == st.SPHERES:
        on_wall = sphere_on_wall(row, walls, wall, out)
    elif wall < n_cones:
        cone = walls.cones[wall]
        for _ in range(2):
            theta = climb_cone(row, parts, cone, theta)
        on_wall = cone_contact(row, parts, cone, theta, out)
    else:
        ring = walls.rings[wall - n_cones]
        n = st.NORMAL + lane
        nx, ny, nz = contacts[n], contacts[n + st.LANES], contacts[n + 2 * st.LANES]
        if walls.displaced[wall]:
            nx, ny, nz = into_frame(walls.frames[wall], nx, ny, nz)
        for _ in range(2):
            theta, nx, ny, nz, _f, _step = ring_newton(
                row, parts, ring, theta, nx, ny, nz
            )
        on_wall = ring_contact(row, parts, ring, theta, nx, ny, nz, out)
    contacts[st.AZIMUTH + lane] = theta
    contact_to_world(walls, wall, out)
    return on_wall
