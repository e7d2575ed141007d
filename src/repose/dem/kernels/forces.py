"""Forces of all contacts: the same loops for smooth bodies and for clumps of spheres.

`clumps` is an empty tuple in a simulation of smooth bodies, else a `clumps.Clumps`. The length of a tuple is part of
its type, so numba compiles only the branch for the bodies of the simulation. The geometry of a contact is in `tile`,
`walls` and `meshes` for smooth bodies, in `clump_tile` and `clump_walls` for spheres.
"""

from ..laws.law import contact_forces, reach, rolling_resistance, surfaces
from . import clump_tile as ct
from . import state as st
from . import tile as tl
from .clump_walls import (
    follow_sphere,
    forget_sphere,
    sphere_arm,
    sphere_on_curved,
    sphere_slid_off,
)
from .clumps import set_bit
from .damped_mass import mass_of_pairs, mass_on_wall, spheres_on_meshes
from .frames import load_walls, surface_velocity
from .jit import inlined, kernel
from .meshes import follow_mesh
from .rows import L, write_vector
from .simd import WIDTH, add_lanes_to_rows, gather, prefetch
from .walls import (
    SAME_AZIMUTH,
    angle_between,
    azimuth,
    drop_wall_contact,
    follow_wall,
    slid_off,
)


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
    """Prefetch the rows and loads of the bodies of a tile of contacts."""
    for k in range(base, base + L):
        for column in range(0, rows.shape[1], WIDTH):
            prefetch(rows, index[k], column)
        prefetch(load, index[k], 0)


@inlined
def fetch_contacts(pairs, load, rows, base):
    """Prefetch the next tile but one, and the second bodies of the next tile; first bodies come nearly in order."""
    if base + 2 * L < pairs.first.shape[0]:
        for column in range(0, pairs.data.shape[1], WIDTH):
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
def fill_laws(t, physics, a, b):
    """Give all lanes the constants of the force laws for two materials."""
    tl.fill_constants(t, tl.LAW, physics.law_constants[a, b])
    tl.fill_constants(t, tl.ROLLING, physics.rolling_constants[a, b])


@inlined
def lane_laws(t, lane, physics, a, b):
    """Give one lane the constants of the force laws for two materials."""
    for c in range(physics.law_constants.shape[2]):
        t[tl.LAW + c * L + lane] = physics.law_constants[a, b, c]
    for c in range(physics.rolling_constants.shape[2]):
        t[tl.ROLLING + c * L + lane] = physics.rolling_constants[a, b, c]


@inlined
def state_place(clumps, on_wall):
    """Place of the force laws' first row in the tile of a contact."""
    if len(clumps) == 0:
        return st.WALL_STATE if on_wall else st.PAIR_STATE
    return ct.WALL_STATE if on_wall else ct.PAIR_STATE


@inlined
def apply_laws(t, c, physics, clumps, on_wall):
    """Compute forces and torques of each lane by the force laws."""
    at = state_place(clumps, on_wall)
    surfaces(physics.law, t, c, 0 if len(clumps) == 0 else 1, on_wall)
    contact_forces(physics.law, t, c, at, physics.dt)
    tl.torques(t)
    rolling_resistance(physics.rolling, t, c, at + physics.n_state * L, physics.dt)


@inlined
def reach_of(c, physics, clumps, on_wall, lane):
    """Gap at which the contact of a lane ends."""
    return reach(physics.law, c, state_place(clumps, on_wall), lane)


@inlined
def pair_geometry(t, contacts, parts, clumps):
    """Compute normal, gap, effective radius and contact point of each lane's pair."""
    if len(clumps) == 0:
        tl.pair_geometry(t, contacts, parts)
    else:
        ct.sphere_pair_geometry(t, contacts)


@kernel
def pair_forces(bodies, pairs, clumps, counts, physics, t, share, begin, end):
    """Add the forces of the touching pairs begin to end (whole tiles) to a share of the loads; returns how many parted.

    The pairs that parted are written to pairs.ended from place `begin` on, their gaps to pairs.gap.
    """
    n = min(counts[st.N_PAIRS], end)
    load = bodies.load[share]
    ended = 0
    fill_laws(t, physics, 0, 0)
    share_column = st.share_column(physics.parts) * L
    large = bodies.load.shape[0] > 1
    for base in range(begin, n, L):
        contacts = pairs.data[base // L]
        if large:
            fetch_contacts(pairs, load, bodies.rows, base)
        if physics.mixed_pairs:
            for lane in range(L):
                k = base + lane
                lane_laws(
                    t,
                    lane,
                    physics,
                    bodies.kind[pairs.first[k]],
                    bodies.kind[pairs.second[k]],
                )
        gather(bodies.rows, bodies.rows.shape[1], pairs.first, base, t, tl.A)
        gather(bodies.rows, bodies.rows.shape[1], pairs.second, base, t, tl.B)
        pair_geometry(t, contacts, physics.parts, clumps)
        mass_of_pairs(t, contacts, pairs, physics.parts, clumps, base, min(L, n - base))
        for k in range(L):
            t[tl.SHARE + k] = min(
                t[tl.A + share_column + k], t[tl.B + share_column + k]
            )
        apply_laws(t, contacts, physics, clumps, 0)
        if tl.open_lanes(t) > 0:
            for lane in range(min(L, n - base)):
                if t[tl.GAP + lane] > reach_of(contacts, physics, clumps, 0, lane):
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
def still_wall(t):
    """Set body B of each lane to a wall of infinite mass that neither moves nor turns."""
    for k in range(L):
        for c in range(st.SHAPE):
            t[tl.B + c * L + k] = 0.0
        for c in range(3):
            t[tl.RB + c * L + k] = 0.0


@inlined
def wall_tile(bodies, contacts, walls, physics, first_wall, base, n, t):
    """Constants of the laws and motion of the walls of a tile of contacts; `first_wall`: number of the first wall."""
    if not (physics.mixed_walls or walls.approach[st.WALLS_MOVE] > 0.0):
        return
    for lane in range(L):
        k = base + lane
        vx = vy = vz = ox = oy = oz = 0.0
        if k < n:
            wall = first_wall + contacts.wall[k]
            ox, oy, oz = (
                walls.motion[wall, 3],
                walls.motion[wall, 4],
                walls.motion[wall, 5],
            )
            if physics.mixed_walls:
                lane_laws(
                    t,
                    lane,
                    physics,
                    bodies.kind[contacts.body[k]],
                    walls.material[wall],
                )
            x = t[tl.A + lane] + t[tl.RA + lane]
            y = t[tl.A + L + lane] + t[tl.RA + L + lane]
            z = t[tl.A + 2 * L + lane] + t[tl.RA + 2 * L + lane]
            vx, vy, vz = surface_velocity(walls.motion[wall], x, y, z)
        write_vector(t, tl.B + st.VELOCITY * L, lane, vx, vy, vz)
        # for laws of rolling; the arm of a wall is zero, so its contact's velocity is that above
        write_vector(t, tl.B + st.ANGULAR_VELOCITY * L, lane, ox, oy, oz)


@inlined
def look_soon(bodies, contacts, walls, k, gap):
    """Let the body and the wall of a contact be checked again when they may have closed a gap."""
    wall, i = contacts.wall[k], contacts.body[k]
    limit = bodies.displacement[i] + walls.approach[st.WALL_PATH] + max(gap, 0.0)
    contacts.limit[wall, i] = min(contacts.limit[wall, i], limit)
    bodies.wall_check[i] = min(bodies.wall_check[i], limit)
    bodies.wall_margin[i // L] = 0.0


@inlined
def wall_forces(bodies, contacts, clumps, walls, physics, first_wall, base, n, t):
    """Compute the forces of a tile of contacts with walls whose geometry is known."""
    c = contacts.data[base // L]
    wall_tile(bodies, contacts, walls, physics, first_wall, base, n, t)
    mass_on_wall(t, c, contacts, physics.parts, clumps, base, min(L, n - base))
    column = st.share_column(physics.parts) * L
    for k in range(L):
        t[tl.SHARE + k] = t[tl.A + column + k]
    apply_laws(t, c, physics, clumps, 1)


@inlined
def add_wall_forces(bodies, contacts, walls, first_wall, base, n, t):
    """Add the forces of a tile of contacts with walls to the loads of bodies and walls."""
    load_walls(walls, first_wall, contacts, base, n, t)
    scatter(bodies.load[0], contacts.body, base, t, tl.TO_A)
    if bodies.load.shape[0] > 1:
        mark_touched(bodies, 0, contacts.body, base)


@inlined
def drop_touch(contacts, clumps, counts, slot, k, ghost):
    """Remove contact k with a wall."""
    if len(clumps) > 0:
        forget_sphere(contacts, clumps, counts, slot, k)
    drop_wall_contact(contacts, counts, slot, k, ghost)


@inlined
def drop_ended(contacts, clumps, counts, slot, ended, ghost):
    """Remove the contacts with walls that ended, the last first."""
    for e in range(ended - 1, -1, -1):
        drop_touch(contacts, clumps, counts, slot, contacts.ended[e], ghost)


@inlined
def plane_geometry(t, contacts, parts, clumps):
    """Gap, effective radius and contact point of each lane's body or sphere against a plane."""
    if len(clumps) == 0:
        tl.plane_geometry(t, contacts, parts)
    else:
        ct.sphere_plane_geometry(t, contacts)


@kernel
def plane_forces(bodies, flat, clumps, walls, counts, physics, t, ghost):
    """Compute forces of all contacts with planes."""
    n = counts[st.N_PLANE]
    large = bodies.load.shape[0] > 1
    ended = 0
    for base in range(0, n, L):
        contacts = flat.data[base // L]
        if large and base + L < n:
            fetch_bodies(bodies.rows, bodies.load[0], flat.body, base + L)
        gather(bodies.rows, bodies.rows.shape[1], flat.body, base, t, tl.A)
        plane_geometry(t, contacts, physics.parts, clumps)
        wall_forces(bodies, flat, clumps, walls, physics, 0, base, n, t)
        if tl.open_lanes(t) > 0:
            for lane in range(min(L, n - base)):
                gap = t[tl.GAP + lane]
                if gap > reach_of(contacts, physics, clumps, 1, lane):
                    mute_lane(t, lane)
                    look_soon(
                        bodies,
                        flat,
                        walls,
                        base + lane,
                        gap if gap < tl.BEYOND else 0.0,
                    )
                    if gap == tl.BEYOND:
                        past_edge(flat, clumps, base + lane)
                    flat.ended[ended] = base + lane
                    ended += 1
        add_wall_forces(bodies, flat, walls, 0, base, n, t)
    drop_ended(flat, clumps, counts, st.N_PLANE, ended, ghost)


@inlined
def past_edge(flat, clumps, k):
    """Note that contact k slid over the edge of a disc."""
    wall, i = flat.wall[k], flat.body[k]
    if len(clumps) == 0:
        flat.deepest[wall, i] = 0.0
    else:
        set_bit(flat.past[wall, i : i + 1], flat.feature[k])


@inlined
def over_end(bodies, curved, clumps, walls, n, k, depth):
    """Note that contact k with a cone, tube or ring slid over the end of the wall with an overlap of `depth`."""
    if len(clumps) == 0:
        slid_off(bodies, curved, walls, n, k, depth)
    else:
        sphere_slid_off(bodies, curved, walls, k)


@inlined
def is_double(contacts, k):
    """Whether an earlier contact of the same body and wall has come to the same place."""
    for m in range(k):
        if (
            contacts.body[m] == contacts.body[k]
            and contacts.wall[m] == contacts.wall[k]
        ):
            apart = angle_between(azimuth(contacts.data, m), azimuth(contacts.data, k))
            if apart < 0.5 * SAME_AZIMUTH:
                return True
    return False


@inlined
def write_lane(t, contacts, lane, out):
    """Write the geometry of one contact to its lane."""
    write_vector(contacts, tl.N, lane, out[0], out[1], out[2])
    write_vector(t, tl.RA, lane, out[5], out[6], out[7])
    t[tl.GAP + lane] = out[3]
    t[tl.RADIUS + lane] = out[4]


@inlined
def close_lanes(t, lanes):
    """Open the unused lanes after the first `lanes`; they still hold another tile's geometry."""
    for lane in range(lanes, L):
        t[tl.GAP + lane] = 1.0


@inlined
def curved_geometry(bodies, curved, clumps, walls, physics, t, lane, k, out, local):
    """Write the geometry of contact k with a cone, tube or ring to its lane; returns whether the contact ended."""
    contacts = curved.data[k // L]
    row = bodies.rows[curved.body[k]]
    if len(clumps) == 0:
        on_wall = follow_wall(
            physics.parts, row, walls, curved.wall[k], contacts, lane, out, local
        )
        write_lane(t, contacts, lane, out)
        contacts[st.GAP + lane] = out[3]
        return (
            out[3] > reach_of(contacts, physics, clumps, 1, lane)
            or not on_wall
            or (physics.parts != st.SPHERES and is_double(curved, k))
        )
    x, y, z = sphere_arm(row, contacts, lane)
    beyond = sphere_on_curved(
        walls,
        curved.wall[k],
        row[0] + x,
        row[1] + y,
        row[2] + z,
        contacts[ct.RADIUS + lane],
        out,
    )
    out[5] += x
    out[6] += y
    out[7] += z
    write_lane(t, contacts, lane, out)
    return out[3] > reach_of(contacts, physics, clumps, 1, lane) or beyond > 0.0


@kernel
def curved_forces(bodies, curved, clumps, walls, counts, physics, t, out, local, ghost):
    """Compute forces of all contacts with cones, tubes and rings."""
    n = counts[st.N_CURVED]
    ended = 0
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = curved.data[base // L]
        gather(bodies.rows, bodies.rows.shape[1], curved.body, base, t, tl.A)
        close_lanes(t, lanes)
        for lane in range(lanes):
            k = base + lane
            if curved_geometry(
                bodies, curved, clumps, walls, physics, t, lane, k, out, local
            ):
                curved.ended[ended] = k
                ended += 1
                if t[tl.GAP + lane] <= 0.0:
                    over_end(bodies, curved, clumps, walls, n, k, -t[tl.GAP + lane])
                t[tl.GAP + lane] = 1.0
        wall_forces(
            bodies, curved, clumps, walls, physics, walls.planes.shape[0], base, n, t
        )
        for lane in range(lanes):
            if t[tl.GAP + lane] > reach_of(contacts, physics, clumps, 1, lane):
                mute_lane(t, lane)
                look_soon(bodies, curved, walls, base + lane, 0.0)
        add_wall_forces(bodies, curved, walls, walls.planes.shape[0], base, n, t)
    drop_ended(curved, clumps, counts, st.N_CURVED, ended, ghost)


@inlined
def mesh_geometry(
    bodies, meshed, clumps, walls, meshes, physics, n, k, out, other, local
):
    """Write the geometry of contact k with a mesh to `out`; returns whether there is a contact."""
    end = reach_of(meshed.data[k // L], physics, clumps, 1, k % L)
    if len(clumps) == 0:
        return follow_mesh(
            bodies, physics.parts, walls, meshes, meshed, n, k, end, out, other, local
        )
    return follow_sphere(
        bodies, walls, meshes, meshed, clumps, n, k, end, out, other, local
    )


@kernel
def mesh_forces(
    bodies, meshed, clumps, walls, meshes, counts, physics, t, out, other, local, ghost
):
    """Compute forces of all contacts with meshes."""
    n = counts[st.N_MESHED]
    first_wall = walls.planes.shape[0] + walls.cones.shape[0] + walls.rings.shape[0]
    ended = 0
    if len(clumps) > 0:
        spheres_on_meshes(meshed, clumps.mesh_sphere, n)
    for base in range(0, n, L):
        lanes = min(L, n - base)
        contacts = meshed.data[base // L]
        gather(bodies.rows, bodies.rows.shape[1], meshed.body, base, t, tl.A)
        close_lanes(t, lanes)
        for lane in range(lanes):
            k = base + lane
            touching = mesh_geometry(
                bodies, meshed, clumps, walls, meshes, physics, n, k, out, other, local
            )
            write_lane(t, contacts, lane, out)
            contacts[st.GAP + lane] = out[3]
            if not touching:
                meshed.ended[ended] = k
                ended += 1
                t[tl.GAP + lane] = 1.0
        wall_forces(bodies, meshed, clumps, walls, physics, first_wall, base, n, t)
        for lane in range(lanes):
            if t[tl.GAP + lane] > reach_of(contacts, physics, clumps, 1, lane):
                mute_lane(t, lane)
                meshed.limit[meshed.wall[base + lane], meshed.body[base + lane]] = -1.0
        add_wall_forces(bodies, meshed, walls, first_wall, base, n, t)
    drop_ended(meshed, clumps, counts, st.N_MESHED, ended, ghost)
