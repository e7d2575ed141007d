"""One time step of clumps; see `engine`, with which it shares the force law and the integration."""

from . import clump_tile as ct
from . import state as st
from . import tile as tl
from .clump_walls import (
    OFFSET,
    drop_sphere,
    follow_sphere,
    sphere_on_curved,
    turned_centre,
    update_clump_meshes,
    update_clump_walls,
)
from .clumps import drop_entries_of_gone, renew_clumps, retire_spheres, wake_clumps
from .engine import gather, has_room, lane_law, mute_lane, scatter, still_wall, wall_tile
from .frames import move_plane_contacts, move_walls
from .jit import inlined, kernel
from .rigid import act_on_events, integrate, take_away
from .walls import drop_wall_contact

L = tl.LANES


@kernel
def sphere_forces(bodies, pairs, counts, physics, t):
    """Forces of the touching spheres of two bodies; returns how many contacts ended, listed in pairs.ended."""
    n = counts[st.N_PAIRS]
    ended = 0
    tl.fill_law(t, physics.laws[0, 0])
    for base in range(0, n, L):
        contacts = pairs.data[base // L]
        if physics.mixed_pairs:
            for lane in range(L):
                k = base + lane
                lane_law(t, lane, physics.laws[bodies.kind[pairs.first[k]], bodies.kind[pairs.second[k]]])
        gather(bodies.rows, pairs.first, base, t, tl.A)
        gather(bodies.rows, pairs.second, base, t, tl.B)
        ct.sphere_pair_geometry(t, contacts)
        tl.forces(t, contacts, physics.dt, physics.tension)
        if tl.open_lanes(t) > 0:
            for lane in range(min(L, n - base)):
                if t[tl.GAP + lane] > 0.0:
                    mute_lane(t, lane)
                    pairs.gap[base + lane] = t[tl.GAP + lane]
                    pairs.ended[ended] = base + lane
                    ended += 1
        scatter(bodies.load[0], pairs.first, base, t, tl.TO_A)
        scatter(bodies.load[0], pairs.second, base, t, tl.TO_B)
    return ended


@inlined
def look_at_wall_soon(bodies, contacts, walls, k, gap):
    """Ask for a new look at the body and the wall of a contact when the two may have closed a gap."""
    wall, i = contacts.wall[k], contacts.body[k]
    limit = bodies.odometer[i] + walls.creep[0] + max(gap, 0.0)
    contacts.limit[wall, i] = min(contacts.limit[wall, i], limit)
    bodies.alarm[i] = min(bodies.alarm[i], limit)


@kernel
def sphere_plane_forces(bodies, flat, clumps, walls, counts, physics, t, ghost):
    """Forces of all contacts of spheres with planes."""
    n = counts[st.N_PLANE]
    ended = 0
    for base in range(0, n, L):
        contacts = flat.data[base // L]
        gather(bodies.rows, flat.body, base, t, tl.A)
        ct.sphere_plane_geometry(t, contacts)
        wall_tile(bodies, flat, walls, physics, 0, base, n, t)
        tl.forces(t, contacts, physics.dt, physics.tension)
        if tl.open_lanes(t) > 0:
            for lane in range(min(L, n - base)):
                gap = t[tl.GAP + lane]
                if gap > 0.0:
                    mute_lane(t, lane)
                    look_at_wall_soon(bodies, flat, walls, base + lane, gap if gap < tl.BEYOND else 0.0)
                    flat.ended[ended] = base + lane
                    ended += 1
        scatter(bodies.load[0], flat.body, base, t, tl.TO_A)
    for e in range(ended - 1, -1, -1):
        drop_sphere(flat, counts, st.N_PLANE, clumps.flat_known, flat.ended[e], ghost)


@inlined
def give_contact(t, contacts, lane, out, x, y, z):
    """Write a contact of a sphere, whose centre lies at (x, y, z) from its body's, to a lane."""
    contacts[tl.N + lane], contacts[tl.N + L + lane], contacts[tl.N + 2 * L + lane] = out[0], out[1], out[2]
    t[tl.GAP + lane] = out[3]
    t[tl.RADIUS + lane] = out[4]
    t[tl.RA + lane], t[tl.RA + L + lane], t[tl.RA + 2 * L + lane] = x + out[5], y + out[6], z + out[7]


@kernel
def sphere_curved_forces(bodies, curved, clumps, walls, counts, physics, t, out, ghost):
    """Forces of all contacts of spheres with cones, tubes and rings."""
    n = counts[st.N_CURVED]
    ended = 0
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = curved.data[base // L]
        gather(bodies.rows, curved.body, base, t, tl.A)
        for lane in range(lanes):
            k = base + lane
            row = bodies.rows[curved.body[k]]
            x, y, z = turned_centre(row, contacts, lane)
            beyond = sphere_on_curved(
                walls, curved.wall[k], row[0] + x, row[1] + y, row[2] + z, contacts[ct.RADIUS + lane], out
            )
            give_contact(t, contacts, lane, out, x, y, z)
            if out[3] > 0.0 or beyond > 0.0:
                curved.ended[ended] = k
                ended += 1
                t[tl.GAP + lane] = 1.0
        wall_tile(bodies, curved, walls, physics, walls.planes.shape[0], base, n, t)
        tl.forces(t, contacts, physics.dt, physics.tension)
        for lane in range(lanes):
            if t[tl.GAP + lane] > 0.0:
                mute_lane(t, lane)
                look_at_wall_soon(bodies, curved, walls, base + lane, 0.0)
        scatter(bodies.load[0], curved.body, base, t, tl.TO_A)
    for e in range(ended - 1, -1, -1):
        drop_sphere(curved, counts, st.N_CURVED, clumps.curved_known, curved.ended[e], ghost)


@inlined
def drop_mesh_sphere(meshed, clumps, counts, k, ghost):
    """Remove the contact of a sphere with a mesh."""
    last = counts[st.N_MESHED] - 1
    drop_wall_contact(meshed, counts, st.N_MESHED, k, ghost)
    clumps.mesh_sphere[k] = clumps.mesh_sphere[last]


@kernel
def sphere_mesh_forces(
    bodies, meshed, touches, clumps, walls, meshes, counts, physics, t, out, other, local, ghost
):
    """Forces of all contacts of spheres with meshes."""
    n = counts[st.N_MESHED]
    first_wall = walls.planes.shape[0] + walls.cones.shape[0] + walls.rings.shape[0]
    ended = 0
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = meshed.data[base // L]
        gather(bodies.rows, meshed.body, base, t, tl.A)
        for lane in range(lanes):
            k = base + lane
            touching = follow_sphere(bodies, walls, meshes, meshed, touches, n, k, out, other, local)
            give_contact(t, contacts, lane, out, local[OFFSET], local[OFFSET + 1], local[OFFSET + 2])
            contacts[st.MESH_GAP + lane] = out[3]
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
    for e in range(ended - 1, -1, -1):
        drop_mesh_sphere(meshed, clumps, counts, meshed.ended[e], ghost)


@kernel
def drop_gone_clumps(bodies, pairs, flat, curved, meshed, clumps, counts, grid, ghost):
    """Drop all contacts of the bodies that went below the floor in the last step."""
    presence = bodies.presence
    drop_entries_of_gone(bodies, pairs, counts, grid, clumps, ghost)
    for k in range(counts[st.N_PLANE] - 1, -1, -1):
        if presence[flat.body[k]] != st.PRESENT:
            drop_sphere(flat, counts, st.N_PLANE, clumps.flat_known, k, ghost)
    for k in range(counts[st.N_CURVED] - 1, -1, -1):
        if presence[curved.body[k]] != st.PRESENT:
            drop_sphere(curved, counts, st.N_CURVED, clumps.curved_known, k, ghost)
    for k in range(counts[st.N_MESHED] - 1, -1, -1):
        if presence[meshed.body[k]] != st.PRESENT:
            drop_mesh_sphere(meshed, clumps, counts, k, ghost)
    for m in range(counts[st.N_MOVED]):
        if presence[grid.moved_list[m]] != st.PRESENT:
            take_away(bodies, grid.moved_list[m])
    counts[st.N_GONE] = 0


@inlined
def clump_wall_forces(
    bodies, flat, curved, meshed, touches, clumps, walls, meshes, counts, physics, t, s, scratch, ghost
):
    """Find the contacts of spheres with walls and add their forces."""
    out, other, local = scratch[0:8], scratch[8:16], scratch[16:48]
    update_clump_walls(bodies, flat, curved, clumps, walls, counts, physics.curved_walls_above, s, out)
    has_meshes = meshes.box.shape[0] > 0
    if has_meshes:
        update_clump_meshes(bodies, meshed, touches, clumps, walls, meshes, counts, s, out, other, local)
    still_wall(t)
    tl.fill_law(t, physics.laws[0, physics.laws.shape[0] - 1])
    sphere_plane_forces(bodies, flat, clumps, walls, counts, physics, t, ghost)
    sphere_curved_forces(bodies, curved, clumps, walls, counts, physics, t, out, ghost)
    if has_meshes:
        sphere_mesh_forces(
            bodies, meshed, touches, clumps, walls, meshes, counts, physics, t, out, other, local, ghost
        )


@kernel
def advance_clumps(
    bodies, pairs, flat, curved, meshed, touches, clumps, grid, walls, meshes, counts, physics, t, bodies_tile, s,
    scratch, steps
):  # fmt: skip
    """Advance a simulation of clumps by a number of steps, as `engine.advance` one of smooth bodies.

    touches: `meshed` with the numbers of spheres for bodies; s: scratch of clumps.SCRATCH numbers.
    """
    ghost = grid.cell.shape[0]
    for step in range(steps):
        if not has_room(pairs, flat, curved, meshed, counts):
            return step
        if counts[st.N_GONE] > 0:
            drop_gone_clumps(bodies, pairs, flat, curved, meshed, clumps, counts, grid, ghost)
        if walls.creep[2] > 0.0:
            move_walls(walls, physics.dt)
            move_plane_contacts(flat, walls, counts[st.N_PLANE])
        wake_clumps(bodies, pairs, counts, grid, clumps, s, ghost)
        renew_clumps(bodies, pairs, counts, grid, clumps, s, ghost)
        ended = sphere_forces(bodies, pairs, counts, physics, t)
        retire_spheres(bodies, pairs, counts, clumps, ended, ghost)
        clump_wall_forces(
            bodies,
            flat,
            curved,
            meshed,
            touches,
            clumps,
            walls,
            meshes,
            counts,
            physics,
            t,
            s,
            scratch,
            ghost,
        )
        counts[st.STEPS] += 1
        n = integrate(bodies, counts, physics, bodies_tile, 0, counts[st.N_BODIES])
        act_on_events(bodies, grid, counts, 0, n, counts[st.STEPS] * physics.dt)
    return steps
