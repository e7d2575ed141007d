"""One time step: which contacts, what forces, where to."""

from . import state as st
from . import tile as tl
from .frames import move_plane_contacts, move_walls, surface_velocity
from .jit import inlined, kernel
from .meshes import follow_mesh, update_meshes
from .neighbours import add_dormant, drop_contact, renew_pairs, wake
from .rigid import act_on_events, integrate, take_away
from .simd import WIDTH, add_lanes_to_rows, prefetch, rows_to_lanes
from .walls import (
    SAME_AZIMUTH,
    angle_between,
    azimuth,
    drop_wall_contact,
    follow_wall,
    update_walls,
)

L = tl.LANES


@inlined
def gather(rows, index, base, t, at):
    """Copy the rows of a tile's bodies into lanes."""
    for k in range(0, L, WIDTH):
        for column in range(0, rows.shape[1], WIDTH):
            rows_to_lanes(rows, column, index, base + k, t, at + column * L + k, L)


@inlined
def scatter(load, index, base, t, at):
    """Add the forces and torques of a tile to the loads of its bodies."""
    for k in range(0, L, WIDTH):
        add_lanes_to_rows(load, 0, index, base + k, t, at + k, L)


@inlined
def mark_touched(bodies, share, index, base):
    """Note that a share of the loads of a tile's bodies is no longer zero."""
    for k in range(base, base + L):
        bodies.touched[share, index[k] // L] = 1


@inlined
def fetch_bodies(rows, load, index, base):
    """Ask for what a tile of contacts will gather and scatter."""
    for k in range(base, base + L):
        for column in range(0, rows.shape[1], WIDTH):
            prefetch(rows, index[k], column)
        prefetch(load, index[k], 0)


@inlined
def fetch_contacts(pairs, load, rows, base):
    """Ask for the next tile but one of contacts and the next one's second bodies, which in a large simulation are far.

    The first bodies come nearly in order, which a processor foresees by itself.
    """
    if base + 2 * L < pairs.first.shape[0]:
        for column in range(0, st.PAIR_ROWS * L, WIDTH):
            prefetch(pairs.data, base // L + 2, column)
    if base + L < pairs.first.shape[0]:
        fetch_bodies(rows, load, pairs.second, base + L)


@inlined
def mute_lane(t, lane):
    """Take back the forces of a lane."""
    for c in range(st.LOAD_COLUMNS):
        t[tl.TO_A + c * L + lane] = 0.0
        t[tl.TO_B + c * L + lane] = 0.0


@inlined
def lane_law(t, lane, law):
    """Give one lane its force law."""
    for c in range(tl.LAW_ROWS):
        t[tl.LAW + c * L + lane] = law[c]


@kernel
def pair_forces(bodies, pairs, counts, physics, t, share, begin, end):
    """Forces of the touching pairs begin to end (whole tiles), added to a share of the loads.

    Pairs that parted are written to pairs.ended from place `begin` on, their gaps to pairs.gap; returns how many.
    """
    n = min(counts[st.N_PAIRS], end)
    load = bodies.load[share]
    ended = 0
    tl.fill_law(t, physics.laws[0, 0])
    large = bodies.load.shape[0] > 1
    for base in range(begin, n, L):
        contacts = pairs.data[base // L]
        if large:
            fetch_contacts(pairs, load, bodies.rows, base)
        if physics.mixed_pairs:
            for lane in range(L):
                k = base + lane
                lane_law(t, lane, physics.laws[bodies.kind[pairs.first[k]], bodies.kind[pairs.second[k]]])
        gather(bodies.rows, pairs.first, base, t, tl.A)
        gather(bodies.rows, pairs.second, base, t, tl.B)
        tl.tangent_rows(t, contacts)
        tl.body_a(t, contacts, physics.parts)
        tl.body_b(t, contacts, physics.parts)
        tl.pair_geometry(t, contacts)
        tl.forces(t, contacts, physics.dt, physics.tension)
        if tl.open_lanes(t) > 0:
            for lane in range(min(L, n - base)):
                if t[tl.GAP + lane] > 0.0:
                    mute_lane(t, lane)
                    pairs.gap[base + lane] = t[tl.GAP + lane]
                    pairs.ended[begin + ended] = base + lane
                    ended += 1
        scatter(load, pairs.first, base, t, tl.TO_A)
        scatter(load, pairs.second, base, t, tl.TO_B)
        if large:
            mark_touched(bodies, share, pairs.first, base)
            mark_touched(bodies, share, pairs.second, base)
    return ended


@kernel
def retire_pairs(bodies, pairs, counts, grid, begin, ended, ghost):
    """List the pairs that parted as dormant, the last first."""
    for e in range(begin + ended - 1, begin - 1, -1):
        k = pairs.ended[e]
        i = pairs.first[k]
        j = pairs.second[k]
        limit = bodies.odometer[i] + bodies.odometer[j] + pairs.gap[k]
        tile = pairs.data[k // L]
        n = tl.N + k % L
        add_dormant(pairs, counts, grid, i, j, limit, tile[n], tile[n + L], tile[n + 2 * L])
        drop_contact(pairs, counts, grid, k, ghost)


@kernel
def still_wall(t):
    """Zero what the force law reads of body B: a wall that neither moves nor turns, of infinite mass."""
    for k in range(L):
        for c in range(st.SHAPE):
            t[tl.B + c * L + k] = 0.0
        for c in range(3):
            t[tl.RB + c * L + k] = 0.0


@inlined
def wall_tile(bodies, contacts, walls, physics, first_wall, base, n, t):
    """Law and motion of the walls of a tile of contacts; `first_wall`: number of wall 0 of this kind of contacts."""
    if not (physics.mixed_walls or walls.creep[2] > 0.0):
        return
    for lane in range(L):
        k = base + lane
        vx = vy = vz = 0.0
        if k < n:
            wall = first_wall + contacts.wall[k]
            if physics.mixed_walls:
                lane_law(t, lane, physics.laws[bodies.kind[contacts.body[k]], walls.material[wall]])
            x = t[tl.A + lane] + t[tl.RA + lane]
            y = t[tl.A + L + lane] + t[tl.RA + L + lane]
            z = t[tl.A + 2 * L + lane] + t[tl.RA + 2 * L + lane]
            vx, vy, vz = surface_velocity(walls.motion[wall], x, y, z)
        t[tl.B + st.VELOCITY * L + lane] = vx
        t[tl.B + (st.VELOCITY + 1) * L + lane] = vy
        t[tl.B + (st.VELOCITY + 2) * L + lane] = vz


@inlined
def look_soon(bodies, contacts, walls, wall, i, gap):
    """Ask for a new look at a body and a wall when the two may have closed a gap."""
    limit = bodies.odometer[i] + walls.creep[0] + max(gap, 0.0)
    contacts.limit[wall, i] = limit
    bodies.alarm[i] = min(bodies.alarm[i], limit)
    bodies.leeway[i // L] = 0.0


@kernel
def plane_forces(bodies, flat, walls, counts, physics, t, ghost):
    """Forces of all contacts with planes."""
    n = counts[st.N_PLANE]
    large = bodies.load.shape[0] > 1
    ended = 0
    for base in range(0, n, L):
        contacts = flat.data[base // L]
        if large and base + L < n:
            fetch_bodies(bodies.rows, bodies.load[0], flat.body, base + L)
        gather(bodies.rows, flat.body, base, t, tl.A)
        tl.tangent_rows(t, contacts)
        tl.body_a(t, contacts, physics.parts)
        tl.plane_geometry(t, contacts)
        wall_tile(bodies, flat, walls, physics, 0, base, n, t)
        tl.forces(t, contacts, physics.dt, physics.tension)
        if tl.open_lanes(t) > 0:
            for lane in range(min(L, n - base)):
                gap = t[tl.GAP + lane]
                if gap > 0.0:
                    k = base + lane
                    mute_lane(t, lane)
                    look_soon(
                        bodies, flat, walls, flat.wall[k], flat.body[k], gap if gap < tl.BEYOND else 0.0
                    )
                    flat.ended[ended] = k
                    ended += 1
        scatter(bodies.load[0], flat.body, base, t, tl.TO_A)
        mark_touched(bodies, 0, flat.body, base)
    for e in range(ended - 1, -1, -1):
        drop_wall_contact(flat, counts, st.N_PLANE, flat.ended[e], ghost)


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
def curved_forces(bodies, curved, walls, counts, physics, t, out, local, ghost):
    """Forces of all contacts with cones, tubes and rings."""
    n = counts[st.N_CURVED]
    ended = 0
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = curved.data[base // L]
        gather(bodies.rows, curved.body, base, t, tl.A)
        for lane in range(lanes):
            k = base + lane
            row = bodies.rows[curved.body[k]]
            on_wall = follow_wall(physics.parts, row, walls, curved.wall[k], contacts, lane, out, local)
            for c in range(3):
                contacts[tl.N + c * L + lane] = out[c]
                t[tl.RA + c * L + lane] = out[5 + c]
            t[tl.GAP + lane] = out[3]
            t[tl.RADIUS + lane] = out[4]
            if out[3] > 0.0 or not on_wall or is_double(curved, k):
                curved.ended[ended] = k
                ended += 1
                t[tl.GAP + lane] = 1.0
        wall_tile(bodies, curved, walls, physics, walls.planes.shape[0], base, n, t)
        tl.forces(t, contacts, physics.dt, physics.tension)
        for lane in range(lanes):
            if t[tl.GAP + lane] > 0.0:
                mute_lane(t, lane)
                look_soon(bodies, curved, walls, curved.wall[base + lane], curved.body[base + lane], 0.0)
        scatter(bodies.load[0], curved.body, base, t, tl.TO_A)
        mark_touched(bodies, 0, curved.body, base)
    for e in range(ended - 1, -1, -1):
        drop_wall_contact(curved, counts, st.N_CURVED, curved.ended[e], ghost)


@kernel
def mesh_forces(bodies, meshed, walls, meshes, counts, physics, t, out, other, local, ghost):
    """Forces of all contacts with meshes."""
    n = counts[st.N_MESHED]
    first_wall = walls.planes.shape[0] + walls.cones.shape[0] + walls.rings.shape[0]
    ended = 0
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = meshed.data[base // L]
        gather(bodies.rows, meshed.body, base, t, tl.A)
        for lane in range(lanes):
            k = base + lane
            touching = follow_mesh(bodies, physics.parts, walls, meshes, meshed, n, k, out, other, local)
            for c in range(3):
                contacts[tl.N + c * L + lane] = out[c]
                t[tl.RA + c * L + lane] = out[5 + c]
            contacts[st.MESH_GAP + lane] = out[3]
            t[tl.GAP + lane] = out[3]
            t[tl.RADIUS + lane] = out[4]
            if not touching:
                meshed.ended[ended] = k
                ended += 1
                t[tl.GAP + lane] = 1.0
        wall_tile(bodies, meshed, walls, physics, first_wall, base, n, t)
        tl.forces(t, contacts, physics.dt, physics.tension)
        for lane in range(lanes):
            if t[tl.GAP + lane] > 0.0:
                mute_lane(t, lane)
                meshed.limit[meshed.wall[base + lane], meshed.body[base + lane]] = -1.0
        scatter(bodies.load[0], meshed.body, base, t, tl.TO_A)
        mark_touched(bodies, 0, meshed.body, base)
    for e in range(ended - 1, -1, -1):
        drop_wall_contact(meshed, counts, st.N_MESHED, meshed.ended[e], ghost)


@kernel
def drop_gone(bodies, pairs, flat, curved, meshed, counts, grid, ghost):
    """Drop all contacts of the bodies that went below the floor in the last step."""
    presence = bodies.presence
    for k in range(counts[st.N_PAIRS] - 1, -1, -1):
        if presence[pairs.first[k]] != st.PRESENT or presence[pairs.second[k]] != st.PRESENT:
            drop_contact(pairs, counts, grid, k, ghost)
    for k in range(counts[st.N_PLANE] - 1, -1, -1):
        if presence[flat.body[k]] != st.PRESENT:
            drop_wall_contact(flat, counts, st.N_PLANE, k, ghost)
    for k in range(counts[st.N_CURVED] - 1, -1, -1):
        if presence[curved.body[k]] != st.PRESENT:
            drop_wall_contact(curved, counts, st.N_CURVED, k, ghost)
    for k in range(counts[st.N_MESHED] - 1, -1, -1):
        if presence[meshed.body[k]] != st.PRESENT:
            drop_wall_contact(meshed, counts, st.N_MESHED, k, ghost)
    for m in range(counts[st.N_MOVED]):
        if presence[grid.moved_list[m]] != st.PRESENT:
            take_away(bodies, grid.moved_list[m])
    counts[st.N_GONE] = 0


@inlined
def has_room(pairs, flat, curved, meshed, counts):
    """Whether every list is less than three quarters full."""
    return (
        counts[st.N_PAIRS] * 4 <= pairs.first.shape[0] * 3
        and counts[st.N_DORMANT] * 4 <= pairs.dormant_limit.shape[0] * 3
        and counts[st.N_PLANE] * 4 <= flat.body.shape[0] * 3
        and counts[st.N_CURVED] * 4 <= curved.body.shape[0] * 3
        and counts[st.N_MESHED] * 4 <= meshed.body.shape[0] * 3
    )


@inlined
def begin_step(bodies, pairs, flat, curved, meshed, grid, walls, counts, physics, ghost):
    """What comes before the search for contacts: bodies that went and walls that move."""
    if counts[st.N_GONE] > 0:
        drop_gone(bodies, pairs, flat, curved, meshed, counts, grid, ghost)
    if walls.creep[2] > 0.0:
        move_walls(walls, physics.dt)
        move_plane_contacts(flat, walls, counts[st.N_PLANE])


@inlined
def wall_contacts_and_forces(bodies, flat, curved, meshed, walls, meshes, counts, physics, t, scratch, ghost):
    """Find the contacts with walls and add their forces."""
    out, local, other, profile = scratch[8:16], scratch[16:48], scratch[48:56], scratch[64:]
    parts = physics.parts
    has_meshes = meshes.box.shape[0] > 0
    update_walls(bodies, flat, curved, walls, counts, parts, physics.curved_walls_above, profile, out, local)
    if has_meshes:
        update_meshes(bodies, meshed, walls, meshes, counts, parts, out, other, local)
    still_wall(t)
    tl.fill_law(t, physics.laws[0, physics.laws.shape[0] - 1])
    plane_forces(bodies, flat, walls, counts, physics, t, ghost)
    curved_forces(bodies, curved, walls, counts, physics, t, out, local, ghost)
    if has_meshes:
        mesh_forces(bodies, meshed, walls, meshes, counts, physics, t, out, other, local, ghost)


@kernel
def advance(
    bodies, pairs, flat, curved, meshed, grid, walls, meshes, counts, physics, t, bodies_tile, scratch, steps
):  # fmt: skip
    """Advance the simulation by a number of steps; stops before a step for which a list may be too short.

    Returns the steps made.
    """
    ghost = grid.cell.shape[0]
    for step in range(steps):
        if not has_room(pairs, flat, curved, meshed, counts):
            return step
        begin_step(bodies, pairs, flat, curved, meshed, grid, walls, counts, physics, ghost)
        wake(bodies, pairs, counts, grid, physics.parts, scratch[0:3])
        renew_pairs(bodies, pairs, counts, grid, physics.parts, scratch[0:3])
        ended = pair_forces(bodies, pairs, counts, physics, t, 0, 0, counts[st.N_PAIRS])
        retire_pairs(bodies, pairs, counts, grid, 0, ended, ghost)
        wall_contacts_and_forces(
            bodies, flat, curved, meshed, walls, meshes, counts, physics, t, scratch, ghost
        )
        counts[st.STEPS] += 1
        n = integrate(bodies, counts, physics, bodies_tile, 0, counts[st.N_BODIES])
        act_on_events(bodies, grid, counts, 0, n, counts[st.STEPS] * physics.dt)
    return steps
