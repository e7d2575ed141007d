"""One time step: which contacts, what forces, where to."""

from . import state as st
from . import tile as tl
from .jit import inlined, kernel
from .lists import move_contact
from .neighbours import add_dormant, update_pairs
from .rigid import integrate
from .walls import (
    SAME_AZIMUTH,
    angle_between,
    azimuth,
    climb_cone,
    cone_contact,
    drop_wall_contact,
    ring_contact,
    ring_newton,
    update_walls,
)

L = tl.LANES


@inlined
def gather_pair(t, lane, a, b):
    """Copy what the geometry and the force law need of two bodies into a lane."""
    for c in range(3):
        t[tl.D + c * L + lane] = b[c] - a[c]
        t[tl.DV + c * L + lane] = a[7 + c] - b[7 + c]
    for c in range(4):
        t[tl.A + c * L + lane] = a[3 + c]
        t[tl.B + c * L + lane] = b[3 + c]
    for c in range(3):
        t[tl.A + (4 + c) * L + lane] = a[10 + c]
        t[tl.B + (4 + c) * L + lane] = b[10 + c]


@inlined
def gather_single(t, lane, a):
    """Copy what is needed of a body at a wall at rest into a lane."""
    for c in range(3):
        t[tl.D + c * L + lane] = a[c]
        t[tl.DV + c * L + lane] = a[7 + c]
        t[tl.A + (4 + c) * L + lane] = a[10 + c]
    for c in range(4):
        t[tl.A + c * L + lane] = a[3 + c]


@inlined
def load_first(t, lane, load, rolling):
    """Add a lane's force and torque to its body A."""
    for c in range(3):
        load[c] += t[tl.F + c * L + lane]
        load[3 + c] += t[tl.TA + c * L + lane]
    load[st.ROLL] += rolling * t[tl.ROLL_A + lane]


@inlined
def load_second(t, lane, load, rolling):
    """Subtract a lane's force from its body B and add B's torque."""
    for c in range(3):
        load[c] -= t[tl.F + c * L + lane]
        load[3 + c] += t[tl.TB + c * L + lane]
    load[st.ROLL] += rolling * t[tl.ROLL_B + lane]


@kernel
def pair_forces(bodies, pairs, counts, physics, t):
    """Forces of all touching pairs; pairs that parted go dormant."""
    n = counts[st.N_PAIRS]
    rows = bodies.rows
    rolling = physics.mur_pair
    ended = 0
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = pairs.data[base // L]
        for lane in range(L):
            k = base + min(lane, lanes - 1)
            gather_pair(t, lane, rows[pairs.first[k]], rows[pairs.second[k]])
        tl.body_a(t, contacts, physics.squares)
        tl.body_b(t, contacts, physics.squares)
        tl.pair_geometry(t, contacts)
        tl.forces(t, contacts, physics.law_pair, physics.dt, physics.tension)
        for lane in range(lanes):
            k = base + lane
            i = pairs.first[k]
            j = pairs.second[k]
            gap = t[tl.GAP + lane]
            absent = bodies.presence[i] != st.PRESENT or bodies.presence[j] != st.PRESENT
            if gap > 0.0 or absent:
                pairs.ended[ended] = k
                ended += 1
                if not absent:
                    limit = bodies.odometer[i] + bodies.odometer[j] + gap
                    nx = contacts[tl.N + lane]
                    ny = contacts[tl.N + L + lane]
                    nz = contacts[tl.N + 2 * L + lane]
                    add_dormant(pairs, counts, i, j, limit, nx, ny, nz)
            else:
                load_first(t, lane, bodies.load[i], rolling)
                load_second(t, lane, bodies.load[j], rolling)
    for e in range(ended - 1, -1, -1):
        k = pairs.ended[e]
        last = counts[st.N_PAIRS] - 1
        counts[st.N_PAIRS] = last
        pairs.first[k] = pairs.first[last]
        pairs.second[k] = pairs.second[last]
        move_contact(pairs.data, last, k)


@inlined
def still_wall(t):
    """Zero the rows of body B that the force law reads: the wall does not turn."""
    for k in range(L):
        for c in range(3):
            t[tl.B + (4 + c) * L + k] = 0.0
            t[tl.RB + c * L + k] = 0.0


@inlined
def off_disc(plane, t, lane):
    """Whether a lane's contact point lies beyond the edge of its plane."""
    x = t[tl.D + lane] + t[tl.RA + lane] - plane[0]
    y = t[tl.D + L + lane] + t[tl.RA + L + lane] - plane[1]
    z = t[tl.D + 2 * L + lane] + t[tl.RA + 2 * L + lane] - plane[2]
    across = x * plane[3] + y * plane[4] + z * plane[5]
    return x * x + y * y + z * z - across * across > plane[6] * plane[6]


@kernel
def plane_forces(bodies, flat, walls, counts, physics, t):
    """Forces of all contacts with planes."""
    n = counts[st.N_PLANE]
    rolling = physics.mur_wall
    ended = 0
    still_wall(t)
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = flat.data[base // L]
        for lane in range(L):
            k = base + min(lane, lanes - 1)
            gather_single(t, lane, bodies.rows[flat.body[k]])
        tl.body_a(t, contacts, physics.squares)
        tl.plane_geometry(t, contacts)
        tl.forces(t, contacts, physics.law_wall, physics.dt, physics.tension)
        for lane in range(lanes):
            k = base + lane
            i = flat.body[k]
            gap = t[tl.GAP + lane]
            if gap > 0.0 or off_disc(walls.planes[flat.wall[k]], t, lane) or bodies.presence[i] != st.PRESENT:
                flat.ended[ended] = k
                ended += 1
                flat.limit[flat.wall[k], i] = bodies.odometer[i] + max(gap, 0.0)
            else:
                load_first(t, lane, bodies.load[i], rolling)
    for e in range(ended - 1, -1, -1):
        drop_wall_contact(flat, counts, st.N_PLANE, flat.ended[e])


@inlined
def follow_wall(squares, row, walls, wall, contacts, lane, out):
    """Track a contact with a cone or ring through one step; returns whether it lies on the wall."""
    n_cones = walls.cones.shape[0]
    theta = contacts[st.AZIMUTH + lane]
    if wall < n_cones:
        cone = walls.cones[wall]
        for _ in range(2):
            theta = climb_cone(squares, row, cone, theta)
        contacts[st.AZIMUTH + lane] = theta
        return cone_contact(squares, row, cone, theta, out)
    ring = walls.rings[wall - n_cones]
    nx, ny, nz = contacts[tl.N + lane], contacts[tl.N + L + lane], contacts[tl.N + 2 * L + lane]
    for _ in range(2):
        theta, nx, ny, nz, _f, _step = ring_newton(squares, row, ring, theta, nx, ny, nz)
    contacts[st.AZIMUTH + lane] = theta
    return ring_contact(squares, row, ring, theta, nx, ny, nz, out)


@inlined
def is_double(contacts, k):
    """Whether an earlier contact of the same body and wall has come to the same place."""
    for m in range(k):
        if contacts.body[m] == contacts.body[k] and contacts.wall[m] == contacts.wall[k]:
            apart = angle_between(azimuth(contacts.data, m), azimuth(contacts.data, k))
            if apart < 0.5 * SAME_AZIMUTH:
                return True
    return False


@kernel
def curved_forces(bodies, curved, walls, counts, physics, t, out):
    """Forces of all contacts with cones, tubes and rings."""
    n = counts[st.N_CURVED]
    ended = 0
    still_wall(t)
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = curved.data[base // L]
        for lane in range(lanes):
            k = base + lane
            row = bodies.rows[curved.body[k]]
            on_wall = follow_wall(physics.squares, row, walls, curved.wall[k], contacts, lane, out)
            for c in range(3):
                contacts[tl.N + c * L + lane] = out[c]
                t[tl.RA + c * L + lane] = out[5 + c]
            gather_single(t, lane, row)
            t[tl.GAP + lane] = out[3]
            t[tl.RADIUS + lane] = out[4]
            if out[3] > 0.0 or not on_wall or is_double(curved, k):
                curved.ended[ended] = k
                ended += 1
                t[tl.GAP + lane] = 1.0
        tl.forces(t, contacts, physics.law_wall, physics.dt, physics.tension)
        for lane in range(lanes):
            k = base + lane
            i = curved.body[k]
            if t[tl.GAP + lane] < 0.0 and bodies.presence[i] == st.PRESENT:
                load_first(t, lane, bodies.load[i], physics.mur_wall)
            else:
                curved.limit[curved.wall[k], i] = bodies.odometer[i]
    for e in range(ended - 1, -1, -1):
        drop_wall_contact(curved, counts, st.N_CURVED, curved.ended[e])


@kernel
def advance(bodies, pairs, flat, curved, grid, walls, counts, physics, t, scratch, steps):
    """Advance the simulation by a number of steps; stops before a step for which a list may be too short.

    Returns the steps made.
    """
    squares = physics.squares
    radius = 0.5 * grid.lengths[1]
    normal = scratch[0:3]
    out = scratch[8:16]
    profile = scratch[16:]
    for step in range(steps):
        if (
            counts[st.N_PAIRS] * 4 > pairs.first.shape[0] * 3
            or counts[st.N_DORMANT] * 4 > pairs.dormant_limit.shape[0] * 3
            or counts[st.N_PLANE] * 4 > flat.body.shape[0] * 3
            or counts[st.N_CURVED] * 4 > curved.body.shape[0] * 3
        ):
            return step
        update_pairs(bodies, pairs, counts, grid, squares, normal)
        update_walls(bodies, flat, curved, walls, counts, squares, radius, physics.funnel_floor, profile, out)
        bodies.load[: counts[st.N_BODIES]] = 0.0
        pair_forces(bodies, pairs, counts, physics, t)
        plane_forces(bodies, flat, walls, counts, physics, t)
        curved_forces(bodies, curved, walls, counts, physics, t, out)
        counts[st.STEPS] += 1
        integrate(bodies, grid, counts, physics, radius, counts[st.STEPS] * physics.dt)
    return steps
