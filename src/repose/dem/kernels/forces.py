"""Contact forces of one time step, computed for tiles of 32 contacts.

The same loops serve smooth bodies and clumps of spheres. A tile has LANES lanes, one
for each contact. For each tile: copy the rows of its bodies into the tile `scratch`
(gather), compute the geometry, apply the force laws, handle the contacts that ended,
and add the forces to the loads of the bodies (scatter). The kernels are `add_pair_forces`,
and `add_plane_forces`, `add_curved_wall_forces` and `add_mesh_forces` for walls.

`clumps` is an empty tuple in a simulation of smooth bodies, else a `clumps.Clumps`. The
length of a tuple is part of its type, so numba compiles only the branch for the bodies
of the simulation. The geometry of a contact is in `tile`, `walls` and `meshes` for
smooth bodies, in `clump_tile` and `clump_walls` for spheres.

Names: `history` is a tile of the numbers that contacts keep, `contacts` a list of
contacts with walls; `flat`, `curved` and `meshed` are these lists for planes, curved
walls and meshes.

Reads `Bodies.rows`, the walls and `Physics`. Writes `Bodies.load` and `Bodies.touched`,
the tiles `data` of the contacts, their `ended` and `gap`, the limits of contacts with
walls that ended, and `Walls.loads`. Contacts with walls that ended are removed here,
pairs that parted by `neighbours.retire_pairs` and `sphere_search.retire_spheres`.
"""

from ..laws.law import contact_forces, reach, rolling_resistance, surfaces
from . import clump_tile, contact_geometry, state, tile
from .clump_walls import (
    follow_sphere_contact,
    forget_sphere_contact,
    record_sphere_slide_off,
    sphere_arm,
    write_sphere_contact_in_world,
)
from .clumps import set_bit
from .contact_geometry import arm_of, normal_of, shift_arm
from .damped_mass import mark_spheres_on_meshes, write_mass_of_pairs, write_mass_on_wall
from .frames import add_loads_of_walls, surface_velocity
from .jit import inlined, kernel
from .meshes import follow_mesh_contact
from .rows import LANES, vector_at, write_vector
from .simd import WIDTH, add_lanes_to_rows, gather, prefetch
from .walls import (
    SAME_AZIMUTH,
    angle_between,
    contact_azimuth,
    drop_wall_contact,
    follow_wall_contact,
    record_slide_off,
)

ON_WALL, OF_PAIR = 1, 0  # values of `on_wall`
GAP_WITHOUT_FORCE = 1.0  # gap of a lane whose contact has no forces [m]


@inlined
def add_forces_to_loads(load, index, base, scratch, first):
    """Add the forces and torques of a tile to the loads of its bodies.

    Parameters
    ----------
    load : array (bodies, LOAD_COLUMNS)
        One share of `Bodies.load`; is added to.
    index : array of int
        Lane k of the tile belongs to body index[base + k].
    base : int
        Place of lane 0 in `index`.
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    first : int
        First row of the loads in the tile: tile.TO_A or tile.TO_B.
    """
    for lane in range(0, LANES, WIDTH):
        add_lanes_to_rows(load, 0, index, base + lane, scratch, first + lane, LANES)


@inlined
def gather_bodies(rows, index, base, scratch, first):
    """Copy the rows of the bodies of a tile to its lanes.

    Parameters
    ----------
    rows : array (bodies, columns)
        `Bodies.rows`.
    index : array of int
        Lane k of the tile belongs to body index[base + k].
    base : int
        Place of lane 0 in `index`.
    scratch : array
        Scratch tile of LANES contacts; it is overwritten.
    first : int
        First row of the bodies in the tile: tile.A or tile.B.
    """
    gather(rows, rows.shape[1], index, base, scratch, first)


@inlined
def mark_loads_as_nonzero(bodies, share, index, base):
    """Note that a share of the loads of a tile's bodies is no longer zero.

    Shares that are zero are skipped when the loads are summed. `share` is the number of
    the share; the bodies are index[base] and the LANES - 1 after it.
    """
    for k in range(base, base + LANES):
        bodies.touched[share, index[k] // LANES] = 1


@inlined
def prefetch_bodies(rows, load, index, base):
    """Prefetch the rows and loads of the bodies of a tile of contacts.

    The bodies are index[base] and the LANES - 1 after it.
    """
    for k in range(base, base + LANES):
        for column in range(0, rows.shape[1], WIDTH):
            prefetch(rows, index[k], column)
        prefetch(load, index[k], 0)


@inlined
def prefetch_next_pairs(pairs, load, rows, base):
    """Prefetch what the next tiles of pairs need.

    That is the tile of contacts after the next one, and the second bodies of the next
    tile; the first bodies come nearly in order, so the processor fetches them itself.

    Parameters
    ----------
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    load, rows : array
        A share of `Bodies.load`, and `Bodies.rows`.
    base : int
        First contact of the present tile.
    """
    if base + 2 * LANES < pairs.first.shape[0]:
        for column in range(0, pairs.data.shape[1], WIDTH):
            prefetch(pairs.data, base // LANES + 2, column)
    if base + LANES < pairs.first.shape[0]:
        prefetch_bodies(rows, load, pairs.second, base + LANES)


@inlined
def clear_lane(scratch, lane):
    """Zero the forces, torques and budgets of both bodies of one lane."""
    for column in range(state.LOAD_COLUMNS):
        scratch[tile.TO_A + column * LANES + lane] = 0.0
        scratch[tile.TO_B + column * LANES + lane] = 0.0


@inlined
def fill_law_constants(scratch, physics, a, b):
    """Write the constants of the force laws for two materials to all lanes of a tile.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    a, b : int
        Numbers of the materials of the bodies A and B.
    """
    tile.fill_constants(scratch, tile.LAW, physics.law_constants[a, b])
    tile.fill_constants(scratch, tile.ROLLING, physics.rolling_constants[a, b])


@inlined
def fill_lane_law_constants(scratch, lane, physics, a, b):
    """Write the constants of the force laws for two materials to one lane of a tile.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    a, b : int
        Numbers of the materials of the bodies A and B.
    """
    for number in range(physics.law_constants.shape[2]):
        constant = physics.law_constants[a, b, number]
        scratch[tile.LAW + number * LANES + lane] = constant
    for number in range(physics.rolling_constants.shape[2]):
        constant = physics.rolling_constants[a, b, number]
        scratch[tile.ROLLING + number * LANES + lane] = constant


@inlined
def first_law_row(clumps, on_wall):
    """Return the first row of the force laws in the tile that contacts keep.

    The rows before it hold the geometry, which depends on the kind of body and on
    whether the contact is with a wall.

    Parameters
    ----------
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    on_wall : int
        ON_WALL or OF_PAIR.
    """
    if len(clumps) == 0:
        return state.WALL_STATE if on_wall else state.PAIR_STATE
    return clump_tile.WALL_STATE if on_wall else clump_tile.PAIR_STATE


@inlined
def apply_force_laws(scratch, history, physics, clumps, on_wall):
    """Compute forces and torques on both bodies of each lane by the force laws.

    The geometry of the lanes has to be in the tiles. Writes the rows TO_A and TO_B of
    `scratch` and the rows of the laws in `history`.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    history : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    on_wall : int
        ON_WALL or OF_PAIR.
    """
    first = first_law_row(clumps, on_wall)
    of_spheres = 0 if len(clumps) == 0 else 1
    # the contact law first: force on A, and the torques that follow from it
    surfaces(physics.law, scratch, history, of_spheres, on_wall)
    contact_forces(physics.law, scratch, history, first, physics.dt)
    tile.write_torques(scratch)
    # the rows of the rolling law follow those of the contact law
    rolling_resistance(
        physics.rolling, scratch, history, first + physics.n_state * LANES, physics.dt
    )


@inlined
def separation_gap(history, physics, clumps, on_wall, lane):
    """Return the gap at which the contact of a lane ends [m].

    It is 0.0 unless the law attracts across a gap.

    Parameters
    ----------
    history : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    on_wall : int
        ON_WALL or OF_PAIR.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    """
    return reach(physics.law, history, first_law_row(clumps, on_wall), lane)


@inlined
def write_pair_geometry(scratch, history, parts, clumps):
    """Compute normal, gap, effective radius and contact point of each lane's pair.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    history : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    parts : int
        Largest number of ellipsoids of a body; 0 for clumps; SPHERES, -1, if all bodies
        are spheres.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    """
    if len(clumps) == 0:
        tile.write_pair_geometry(scratch, history, parts)
    else:
        clump_tile.write_sphere_pair_geometry(scratch, history)


@kernel
def add_pair_forces(bodies, pairs, clumps, counts, physics, scratch, share, begin, end):
    """Compute the forces of touching pairs and add them to one share of the loads.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    share : int
        Number of the share, the first index of `bodies.load`.
    begin, end : int
        The pairs of this share, in whole tiles.

    Returns
    -------
    int
        Number of the pairs that parted. They are written to `pairs.ended` from place
        `begin` on, and their gaps to `pairs.gap`.
    """
    n_pairs = min(counts[state.N_PAIRS], end)
    load = bodies.load[share]
    n_ended = 0
    fill_law_constants(scratch, physics, 0, 0)
    share_row = state.share_column(physics.parts) * LANES
    # A large simulation has several shares and does not fit into the caches.
    is_large = bodies.load.shape[0] > 1
    for base in range(begin, n_pairs, LANES):
        history = pairs.data[base // LANES]
        n_lanes = min(LANES, n_pairs - base)
        if is_large:
            prefetch_next_pairs(pairs, load, bodies.rows, base)
        # each lane has the constants of its own two materials
        if physics.mixed_pairs:
            for lane in range(LANES):
                k = base + lane
                kind_a = bodies.material[pairs.first[k]]
                kind_b = bodies.material[pairs.second[k]]
                fill_lane_law_constants(scratch, lane, physics, kind_a, kind_b)
        # copies of both bodies, the geometry, and the effective mass
        gather_bodies(bodies.rows, pairs.first, base, scratch, tile.A)
        gather_bodies(bodies.rows, pairs.second, base, scratch, tile.B)
        write_pair_geometry(scratch, history, physics.parts, clumps)
        write_mass_of_pairs(
            scratch, history, pairs, physics.parts, clumps, base, n_lanes
        )
        # A contact takes the smaller share of its bodies, see `laws.tangential`.
        for lane in range(LANES):
            scratch[tile.SHARE + lane] = min(
                scratch[tile.A + share_row + lane], scratch[tile.B + share_row + lane]
            )
        apply_force_laws(scratch, history, physics, clumps, OF_PAIR)
        # Few tiles have a lane with a gap, so the others skip the loop over the lanes.
        if tile.count_open_lanes(scratch) > 0:
            for lane in range(n_lanes):
                gap = scratch[tile.GAP + lane]
                if gap > separation_gap(history, physics, clumps, OF_PAIR, lane):
                    clear_lane(scratch, lane)
                    pairs.gap[base + lane] = gap
                    pairs.ended[begin + n_ended] = base + lane
                    n_ended += 1
        # add the forces to both bodies
        add_forces_to_loads(load, pairs.first, base, scratch, tile.TO_A)
        add_forces_to_loads(load, pairs.second, base, scratch, tile.TO_B)
        if is_large:
            mark_loads_as_nonzero(bodies, share, pairs.first, base)
            mark_loads_as_nonzero(bodies, share, pairs.second, base)
    return n_ended


@kernel
def write_still_wall(scratch):
    """Make body B of each lane a wall: of infinite mass, neither moving nor turning.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    """
    for lane in range(LANES):
        for column in range(state.SHAPE):
            scratch[tile.B + column * LANES + lane] = 0.0
        # a wall has no arm, so its velocity at a contact is that of its columns
        for axis in range(3):
            scratch[tile.RB + axis * LANES + lane] = 0.0


@inlined
def write_wall_laws_and_motion(
    bodies, contacts, walls, physics, first_wall, base, n, scratch
):
    """Write law constants and motion of the walls of a tile of contacts.

    Nothing is written where all walls stand still and are of one material; then the
    tile holds what `write_still_wall` and `fill_law_constants` wrote.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    first_wall : int
        Number of the first wall of this kind among all walls.
    base, n : int
        The first contact of the tile, and the number of contacts in the list.
    scratch : array
        Scratch tile of LANES contacts (rows of `tile`); the walls are its bodies B.
    """
    if not (physics.mixed_walls or walls.approach[state.WALLS_MOVE] > 0.0):
        return
    for lane in range(LANES):
        k = base + lane
        # velocity and angular velocity of the wall; zero in a lane without a contact
        vx = vy = vz = omega_x = omega_y = omega_z = 0.0
        if k < n:
            wall = first_wall + contacts.wall[k]
            omega_x, omega_y, omega_z = vector_at(walls.motion[wall], state.WALL_SPIN)
            if physics.mixed_walls:
                material = bodies.material[contacts.body[k]]
                fill_lane_law_constants(
                    scratch, lane, physics, material, walls.material[wall]
                )
            # a wall's velocity depends on the place of the contact point
            x = scratch[tile.A + lane] + scratch[tile.RA + lane]
            y = scratch[tile.A + LANES + lane] + scratch[tile.RA + LANES + lane]
            z = scratch[tile.A + 2 * LANES + lane] + scratch[tile.RA + 2 * LANES + lane]
            vx, vy, vz = surface_velocity(walls.motion[wall], x, y, z)
        write_vector(scratch, tile.B + state.VELOCITY * LANES, lane, vx, vy, vz)
        # only laws of rolling use the angular velocity, since a wall has no arm
        write_vector(
            scratch,
            tile.B + state.ANGULAR_VELOCITY * LANES,
            lane,
            omega_x,
            omega_y,
            omega_z,
        )


@inlined
def schedule_wall_search(bodies, contacts, walls, k, gap):
    """Let body and wall of contact k be searched when they may have closed a gap.

    The contact ended. Writes their limit, and when the body is due for walls.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    k : int
        Index of the contact in its list.
    gap : float
        How far they are apart [m]; negative counts as 0, so the search is in the next
        step.
    """
    wall = contacts.wall[k]
    i = contacts.body[k]
    limit = bodies.displacement[i] + walls.approach[state.WALL_PATH] + max(gap, 0.0)
    contacts.limit[wall, i] = min(contacts.limit[wall, i], limit)
    bodies.wall_check[i] = min(bodies.wall_check[i], limit)
    bodies.wall_margin[i // LANES] = 0.0


@inlined
def compute_wall_forces(
    bodies, contacts, clumps, walls, physics, first_wall, base, n, scratch
):
    """Compute the forces of a tile of contacts with walls whose geometry is known.

    The forces are written to the rows `TO_A` of `scratch`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    first_wall : int
        Number of the first wall of this kind among all walls.
    base, n : int
        The first contact of the tile, and the number of contacts in the list.
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    """
    history = contacts.data[base // LANES]
    write_wall_laws_and_motion(
        bodies, contacts, walls, physics, first_wall, base, n, scratch
    )
    write_mass_on_wall(
        scratch, history, contacts, physics.parts, clumps, base, min(LANES, n - base)
    )
    # the share of the dashpot that acts is that of the body
    share_row = state.share_column(physics.parts) * LANES
    for lane in range(LANES):
        scratch[tile.SHARE + lane] = scratch[tile.A + share_row + lane]
    apply_force_laws(scratch, history, physics, clumps, ON_WALL)


@inlined
def add_wall_forces_to_loads(bodies, contacts, walls, first_wall, base, n, scratch):
    """Add the forces of a tile of contacts to the loads of the bodies and the walls.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    first_wall : int
        Number of the first wall of this kind among all walls.
    base, n : int
        The first contact of the tile, and the number of contacts in the list.
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    """
    add_loads_of_walls(walls, first_wall, contacts, base, n, scratch)
    # contacts with walls use the first share of the loads
    add_forces_to_loads(bodies.load[0], contacts.body, base, scratch, tile.TO_A)
    if bodies.load.shape[0] > 1:
        mark_loads_as_nonzero(bodies, 0, contacts.body, base)


@inlined
def release_wall_contact(contacts, clumps, counts, length_slot, k, ghost):
    """Remove contact k with a wall from its list; of clumps, its sphere is free again.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    length_slot : int
        Index in `counts` of the length of this list, such as state.N_PLANE.
    k : int
        Index of the contact in its list.
    ghost : int
        Index of the ghost, a body without mass that never moves. Unused places of the
        lists hold this index.
    """
    if len(clumps) > 0:
        forget_sphere_contact(contacts, clumps, counts, length_slot, k)
    drop_wall_contact(contacts, counts, length_slot, k, ghost)


@inlined
def drop_ended_contacts(contacts, clumps, counts, length_slot, n_ended, ghost):
    """Remove the contacts with walls that ended in this step, the last first.

    A removed contact is replaced by the last one, so the places of the others stay
    valid.

    Parameters
    ----------
    contacts : WallContacts
        The list; its first n_ended numbers `ended` are places of these contacts, in
        increasing order.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    length_slot : int
        Index in `counts` of the length of this list, such as state.N_PLANE.
    n_ended : int
        Number of the contacts that ended.
    ghost : int
        Index of the ghost, a body without mass that never moves. Unused places of the
        lists hold this index.
    """
    for place in range(n_ended - 1, -1, -1):
        release_wall_contact(
            contacts, clumps, counts, length_slot, contacts.ended[place], ghost
        )


@inlined
def write_plane_geometry(scratch, history, parts, clumps):
    """Compute gap, effective radius and contact point of each lane's body on its plane.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    history : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    parts : int
        Largest number of ellipsoids of a body; 0 for clumps; SPHERES, -1, if all bodies
        are spheres.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    """
    if len(clumps) == 0:
        tile.write_plane_geometry(scratch, history, parts)
    else:
        clump_tile.write_sphere_plane_geometry(scratch, history)


@kernel
def add_plane_forces(bodies, flat, clumps, walls, counts, physics, scratch, ghost):
    """Compute the forces of all contacts with planes and add them to the loads.

    A contact that ended is removed, and its body is searched when the gap may close.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    flat : WallContacts
        The contacts with planes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    ghost : int
        Index of the ghost, a body without mass that never moves. Unused places of the
        lists hold this index.
    """
    n_contacts = counts[state.N_PLANE]
    # A large simulation has several shares of the loads, and does not fit into the
    # caches.
    is_large = bodies.load.shape[0] > 1
    n_ended = 0
    # One tile after another; `base` is the number of its first contact.
    for base in range(0, n_contacts, LANES):
        history = flat.data[base // LANES]
        if is_large and base + LANES < n_contacts:
            prefetch_bodies(bodies.rows, bodies.load[0], flat.body, base + LANES)
        # copies of the bodies, the geometry, and the forces
        gather_bodies(bodies.rows, flat.body, base, scratch, tile.A)
        write_plane_geometry(scratch, history, physics.parts, clumps)
        compute_wall_forces(
            bodies, flat, clumps, walls, physics, 0, base, n_contacts, scratch
        )
        # Few tiles have a lane with a gap, so the others skip the loop over the lanes.
        if tile.count_open_lanes(scratch) > 0:
            for lane in range(min(LANES, n_contacts - base)):
                gap = scratch[tile.GAP + lane]
                if gap > separation_gap(history, physics, clumps, ON_WALL, lane):
                    clear_lane(scratch, lane)
                    # beyond the edge of a disc there is no gap to close
                    distance_left = gap if gap < tile.BEYOND else 0.0
                    schedule_wall_search(
                        bodies, flat, walls, base + lane, distance_left
                    )
                    if gap == tile.BEYOND:
                        mark_past_edge(flat, clumps, base + lane)
                    flat.ended[n_ended] = base + lane
                    n_ended += 1
        add_wall_forces_to_loads(bodies, flat, walls, 0, base, n_contacts, scratch)
    drop_ended_contacts(flat, clumps, counts, state.N_PLANE, n_ended, ghost)


@inlined
def mark_past_edge(flat, clumps, k):
    """Note that the body of contact k slid over the edge of a disc.

    It is past the wall now: no contact of it (of a clump, of this sphere) begins until
    it is clear of the plane, see `walls`.

    Parameters
    ----------
    flat : WallContacts
        The contacts with planes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    k : int
        Index of the contact in its list.
    """
    wall = flat.wall[k]
    i = flat.body[k]
    if len(clumps) == 0:
        flat.allowed_overlap[wall, i] = 0.0
    else:
        set_bit(flat.past_bits[wall, i : i + 1], flat.feature[k])


@inlined
def mark_past_end(bodies, curved, clumps, walls, n, k, depth):
    """Note that the body of contact k slid over the end of a curved wall.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    n, k : int
        Number of contacts in the list, and index of this contact.
    depth : float
        Overlap with which it slid off [m].
    """
    if len(clumps) == 0:
        record_slide_off(bodies, curved, walls, n, k, depth)
    else:
        record_sphere_slide_off(bodies, curved, walls, k)


@inlined
def is_duplicate(contacts, k):
    """Return whether an earlier contact of the same body and wall is at the same place.

    Two contacts of a long body with a curved wall merge when the body turns across it.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    k : int
        Number of the contact; those before it are compared.
    """
    for other in range(k):
        if (
            contacts.body[other] == contacts.body[k]
            and contacts.wall[other] == contacts.wall[k]
        ):
            angle = angle_between(
                contact_azimuth(contacts.data, other), contact_azimuth(contacts.data, k)
            )
            if angle < 0.5 * SAME_AZIMUTH:
                return True
    return False


@inlined
def write_contact_to_lane(scratch, history, lane, geometry):
    """Copy the geometry of one contact to its lane of both tiles.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    history : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    geometry : array (8,)
        The contact in world axes (`contact_geometry`).
    """
    nx, ny, nz = normal_of(geometry)
    rx, ry, rz = arm_of(geometry)
    write_vector(history, tile.NORMAL, lane, nx, ny, nz)
    write_vector(scratch, tile.RA, lane, rx, ry, rz)
    scratch[tile.GAP + lane] = geometry[contact_geometry.GAP]
    scratch[tile.RADIUS + lane] = geometry[contact_geometry.RADIUS]


@inlined
def open_unused_lanes(scratch, n_lanes):
    """Give the lanes without a contact a gap, so that they have no force.

    They may hold the geometry of another tile. `n_lanes` is the number of lanes in use.
    """
    for lane in range(n_lanes, LANES):
        scratch[tile.GAP + lane] = GAP_WITHOUT_FORCE


@inlined
def update_curved_contact(
    bodies, curved, clumps, walls, physics, scratch, lane, k, geometry, local_row
):
    """Write the geometry of contact k with a cone, tube or ring to its lane.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    k : int
        Index of the contact in its list.
    geometry : array (8,)
        Overwritten by the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).
    local_row : array
        Working memory for a body's row in the frame of a wall. It is overwritten.

    Returns
    -------
    bool
        Whether the contact ended: the gap is too large, the contact lies beyond the
        wall's end, or two contacts of a body have merged.
    """
    history = curved.data[k // LANES]
    row = bodies.rows[curved.body[k]]
    if len(clumps) == 0:
        is_on_wall = follow_wall_contact(
            physics.parts,
            row,
            walls,
            curved.wall[k],
            history,
            lane,
            geometry,
            local_row,
        )
        write_contact_to_lane(scratch, history, lane, geometry)
        history[state.GAP + lane] = geometry[contact_geometry.GAP]
        return (
            geometry[contact_geometry.GAP]
            > separation_gap(history, physics, clumps, ON_WALL, lane)
            or not is_on_wall
            or (physics.parts != state.SPHERES and is_duplicate(curved, k))
        )
    # The same for the sphere of a clump, at the end of its arm.
    arm_x, arm_y, arm_z = sphere_arm(row, history, lane)
    x, y, z = vector_at(row, state.POSITION)
    distance_beyond = write_sphere_contact_in_world(
        walls,
        curved.wall[k],
        x + arm_x,
        y + arm_y,
        z + arm_z,
        history[clump_tile.RADIUS + lane],
        geometry,
    )
    shift_arm(geometry, arm_x, arm_y, arm_z)
    write_contact_to_lane(scratch, history, lane, geometry)
    return (
        geometry[contact_geometry.GAP]
        > separation_gap(history, physics, clumps, ON_WALL, lane)
        or distance_beyond > 0.0
    )


@kernel
def add_curved_wall_forces(
    bodies, curved, clumps, walls, counts, physics, scratch, geometry, local_row, ghost
):
    """Compute the forces of all contacts with cones, tubes and rings, and add them.

    A contact that ended is removed, and its body is searched in the next step.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`); it is overwritten.
    local_row : array
        Working memory for a body's row in the frame of a wall. It is overwritten.
    ghost : int
        Index of the ghost, a body without mass that never moves. Unused places of the
        lists hold this index.
    """
    n_contacts = counts[state.N_CURVED]
    first_wall = walls.planes.shape[0]
    n_ended = 0
    for base in range(0, n_contacts, LANES):
        n_lanes = min(LANES, n_contacts - base)
        history = curved.data[base // LANES]
        gather_bodies(bodies.rows, curved.body, base, scratch, tile.A)
        open_unused_lanes(scratch, n_lanes)
        # The geometry is found contact by contact, the forces for the whole tile.
        for lane in range(n_lanes):
            k = base + lane
            if update_curved_contact(
                bodies,
                curved,
                clumps,
                walls,
                physics,
                scratch,
                lane,
                k,
                geometry,
                local_row,
            ):
                curved.ended[n_ended] = k
                n_ended += 1
                # it ended with an overlap, so it slid over the wall's end
                if scratch[tile.GAP + lane] <= 0.0:
                    depth = -scratch[tile.GAP + lane]
                    mark_past_end(bodies, curved, clumps, walls, n_contacts, k, depth)
                scratch[tile.GAP + lane] = GAP_WITHOUT_FORCE
        compute_wall_forces(
            bodies,
            curved,
            clumps,
            walls,
            physics,
            first_wall,
            base,
            n_contacts,
            scratch,
        )
        # Contacts that ended have no force, and their bodies are searched again.
        for lane in range(n_lanes):
            if scratch[tile.GAP + lane] > separation_gap(
                history, physics, clumps, ON_WALL, lane
            ):
                clear_lane(scratch, lane)
                schedule_wall_search(bodies, curved, walls, base + lane, 0.0)
        add_wall_forces_to_loads(
            bodies, curved, walls, first_wall, base, n_contacts, scratch
        )
    drop_ended_contacts(curved, clumps, counts, state.N_CURVED, n_ended, ghost)


@inlined
def update_mesh_contact(
    bodies,
    meshed,
    clumps,
    walls,
    meshes,
    physics,
    n,
    k,
    geometry,
    other_geometry,
    local_row,
):
    """Fill `geometry` for contact k with a mesh; return whether the contact lasts.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    meshed : WallContacts
        The contacts with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    n, k : int
        Number of contacts in the list, and index of this contact.
    geometry : array (8,)
        Overwritten by the contact (`contact_geometry`), in world axes.
    other_geometry : array (8,)
        Working memory for a second contact; it is overwritten.
    local_row : array
        Working memory for a body's row in the frame of a wall. It is overwritten.
    """
    end = separation_gap(meshed.data[k // LANES], physics, clumps, ON_WALL, k % LANES)
    if len(clumps) == 0:
        return follow_mesh_contact(
            bodies,
            physics.parts,
            walls,
            meshes,
            meshed,
            n,
            k,
            end,
            geometry,
            other_geometry,
            local_row,
        )
    return follow_sphere_contact(
        bodies,
        walls,
        meshes,
        meshed,
        clumps,
        n,
        k,
        end,
        geometry,
        other_geometry,
        local_row,
    )


@kernel
def add_mesh_forces(
    bodies,
    meshed,
    clumps,
    walls,
    meshes,
    counts,
    physics,
    scratch,
    geometry,
    other_geometry,
    local_row,
    ghost,
):
    """Compute the forces of all contacts with meshes and add them to the loads.

    A contact that ended is removed, and its mesh is searched in the next step.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    meshed : WallContacts
        The contacts with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    geometry, other_geometry : array (8,)
        Scratch for two contacts (`contact_geometry`); it is overwritten.
    local_row : array
        Working memory for a body's row in the frame of a wall. It is overwritten.
    ghost : int
        Index of the ghost, a body without mass that never moves. Unused places of the
        lists hold this index.
    """
    n_contacts = counts[state.N_MESHED]
    n_curved = walls.cones.shape[0] + walls.rings.shape[0]
    first_wall = walls.planes.shape[0] + n_curved
    n_ended = 0
    if len(clumps) > 0:
        mark_spheres_on_meshes(meshed, clumps.mesh_sphere, n_contacts)
    for base in range(0, n_contacts, LANES):
        n_lanes = min(LANES, n_contacts - base)
        history = meshed.data[base // LANES]
        gather_bodies(bodies.rows, meshed.body, base, scratch, tile.A)
        open_unused_lanes(scratch, n_lanes)
        # The geometry is found contact by contact, the forces for the whole tile.
        for lane in range(n_lanes):
            k = base + lane
            is_touching = update_mesh_contact(
                bodies,
                meshed,
                clumps,
                walls,
                meshes,
                physics,
                n_contacts,
                k,
                geometry,
                other_geometry,
                local_row,
            )
            write_contact_to_lane(scratch, history, lane, geometry)
            history[state.GAP + lane] = geometry[contact_geometry.GAP]
            if not is_touching:
                meshed.ended[n_ended] = k
                n_ended += 1
                scratch[tile.GAP + lane] = GAP_WITHOUT_FORCE
        compute_wall_forces(
            bodies,
            meshed,
            clumps,
            walls,
            physics,
            first_wall,
            base,
            n_contacts,
            scratch,
        )
        for lane in range(n_lanes):
            if scratch[tile.GAP + lane] > separation_gap(
                history, physics, clumps, ON_WALL, lane
            ):
                clear_lane(scratch, lane)
                # search the mesh in the next step
                k = base + lane
                meshed.limit[meshed.wall[k], meshed.body[k]] = -1.0
        add_wall_forces_to_loads(
            bodies, meshed, walls, first_wall, base, n_contacts, scratch
        )
    drop_ended_contacts(meshed, clumps, counts, state.N_MESHED, n_ended, ghost)
