"""Contact forces of one time step, computed for tiles of 32 contacts.

The same loops serve smooth bodies and clumps of spheres. A tile has LANES lanes, one
for each contact. The kernels first copy the rows of a tile's bodies into the tile
`scratch` (gather). They then compute the geometry, apply the force laws, and handle the
contacts that have ended. Finally, they add the forces to the loads of the bodies
(scatter). The kernels are `add_pair_forces` for pairs, and `add_plane_forces`,
`add_curved_wall_forces` and `add_mesh_forces` for walls.

`clumps` is a `clumps.Clumps`, or an empty tuple if all bodies are smooth. The length of
a tuple is part of its type, so numba compiles only the branch for the bodies of the
simulation. The modules `tile`, `walls` and `meshes` compute the geometry of contacts of
smooth bodies, and `clump_tile` and `clump_walls` that of contacts of a clump's spheres.

`history` is a tile of the numbers that contacts keep from one step to the next.
`contacts` is a list of contacts with walls: `flat` with planes, `curved` with curved
walls, `meshed` with meshes.

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
GAP_WITHOUT_FORCE = 1.0  # gap of a lane without a contact [m], beyond the reach of laws


@inlined
def add_forces_to_loads(load, body_indices, base, scratch, first_row):
    """Add the forces and torques of a tile to the loads of its bodies.

    Parameters
    ----------
    load : array (bodies, LOAD_COLUMNS)
        One of the arrays of partial sums in `Bodies.load`. The forces and torques are
        added to it.
    body_indices : array of int
        The bodies of all contacts. Lane k of the tile has body body_indices[base + k].
    base : int
        Position of the tile's first contact in `body_indices`.
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    first_row : int
        First row of the forces in the tile: tile.TO_A or tile.TO_B.
    """
    for lane in range(0, LANES, WIDTH):
        add_lanes_to_rows(
            load, 0, body_indices, base + lane, scratch, first_row + lane, LANES
        )


@inlined
def gather_bodies(rows, body_indices, base, scratch, first_row):
    """Copy the rows of a tile's bodies to the lanes of the tile.

    Parameters
    ----------
    rows : array (bodies, columns)
        `Bodies.rows`.
    body_indices : array of int
        The bodies of all contacts. Lane k of the tile has body body_indices[base + k].
    base : int
        Position of the tile's first contact in `body_indices`.
    scratch : array
        Scratch tile of LANES contacts. The rows of the bodies are overwritten.
    first_row : int
        First row of the bodies in the tile: tile.A or tile.B.
    """
    gather(rows, rows.shape[1], body_indices, base, scratch, first_row)


@inlined
def mark_loads_as_nonzero(bodies, share, body_indices, base):
    """Mark in `bodies.touched` that the loads of a tile's bodies may differ from zero.

    `bodies.load` has several arrays of partial sums, called shares, which are added up
    at the end of the step. Loads that are not marked are zero and are skipped in this
    sum.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    share : int
        Index of the array of partial sums in `bodies.load`.
    body_indices : array of int
        The bodies of all contacts. Those of the tile begin at `base`.
    base : int
        Position of the tile's first contact in `body_indices`.
    """
    for contact in range(base, base + LANES):
        bodies.touched[share, body_indices[contact] // LANES] = 1


@inlined
def prefetch_bodies(rows, load, body_indices, base):
    """Prefetch the rows and the loads of a tile's bodies into the processor's caches.

    Parameters
    ----------
    rows, load : array
        `Bodies.rows`, and one of the arrays of partial sums in `Bodies.load`.
    body_indices : array of int
        The bodies of all contacts. Those of the tile begin at `base`.
    base : int
        Position of the tile's first contact in `body_indices`.
    """
    for contact in range(base, base + LANES):
        for column in range(0, rows.shape[1], WIDTH):
            prefetch(rows, body_indices[contact], column)
        prefetch(load, body_indices[contact], 0)


@inlined
def prefetch_next_pairs(pairs, load, rows, base):
    """Prefetch the data of the next tiles of pairs into the processor's caches.

    These are the second bodies of the next tile, and the contacts of the tile after it.
    The first bodies are nearly in order in memory, so the processor fetches them
    itself.

    Parameters
    ----------
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    load, rows : array
        One of the arrays of partial sums in `Bodies.load`, and `Bodies.rows`.
    base : int
        Index of the first contact of the current tile.
    """
    if base + 2 * LANES < pairs.first.shape[0]:
        for column in range(0, pairs.data.shape[1], WIDTH):
            prefetch(pairs.data, base // LANES + 2, column)
    if base + LANES < pairs.first.shape[0]:
        prefetch_bodies(rows, load, pairs.second, base + LANES)


@inlined
def clear_lane(scratch, lane):
    """Set the forces, torques and budgets on both bodies of one lane to zero."""
    for column in range(state.LOAD_COLUMNS):
        scratch[tile.TO_A + column * LANES + lane] = 0.0
        scratch[tile.TO_B + column * LANES + lane] = 0.0


@inlined
def fill_law_constants(scratch, physics, material_a, material_b):
    """Write the constants of the force laws of two materials to all lanes of a tile.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    material_a, material_b : int
        Indices of the materials of the bodies A and B.
    """
    tile.fill_constants(
        scratch, tile.LAW, physics.law_constants[material_a, material_b]
    )
    tile.fill_constants(
        scratch, tile.ROLLING, physics.rolling_constants[material_a, material_b]
    )


@inlined
def fill_lane_law_constants(scratch, lane, physics, material_a, material_b):
    """Write the constants of the force laws of two materials to one lane of a tile.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    material_a, material_b : int
        Indices of the materials of the bodies A and B.
    """
    for constant_index in range(physics.law_constants.shape[2]):
        value = physics.law_constants[material_a, material_b, constant_index]
        scratch[tile.LAW + constant_index * LANES + lane] = value
    for constant_index in range(physics.rolling_constants.shape[2]):
        value = physics.rolling_constants[material_a, material_b, constant_index]
        scratch[tile.ROLLING + constant_index * LANES + lane] = value


@inlined
def first_law_row(clumps, on_wall):
    """Return the first row of the force laws in the tile `history`.

    The rows before it hold the geometry. Their number depends on the kind of body, and
    on whether the contact is with a wall.

    Parameters
    ----------
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    on_wall : int
        ON_WALL or OF_PAIR.
    """
    if len(clumps) == 0:
        return state.WALL_STATE if on_wall else state.PAIR_STATE
    return clump_tile.WALL_STATE if on_wall else clump_tile.PAIR_STATE


@inlined
def apply_force_laws(scratch, history, physics, clumps, on_wall):
    """Compute the forces and torques on both bodies of each lane by the force laws.

    The geometry of the lanes must have been computed. Writes the loads on both bodies
    (the rows from TO_A and TO_B on of `scratch`), and the rows of the laws in
    `history`, such as the springs.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    on_wall : int
        ON_WALL or OF_PAIR.
    """
    first_row = first_law_row(clumps, on_wall)
    of_spheres = 0 if len(clumps) == 0 else 1
    # The contact law comes first. It computes the force on A, from which the torques
    # follow.
    surfaces(physics.law, scratch, history, of_spheres, on_wall)
    contact_forces(physics.law, scratch, history, first_row, physics.dt)
    tile.write_torques(scratch)
    # The rows of the rolling law follow those of the contact law.
    rolling_resistance(
        physics.rolling,
        scratch,
        history,
        first_row + physics.n_state * LANES,
        physics.dt,
    )


@inlined
def separation_gap(history, physics, clumps, on_wall, lane):
    """Return the gap at which the contact of a lane ends [m].

    It is 0.0 unless the contact law attracts across a gap.

    Parameters
    ----------
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    on_wall : int
        ON_WALL or OF_PAIR.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    """
    return reach(physics.law, history, first_law_row(clumps, on_wall), lane)


@inlined
def write_pair_geometry(scratch, history, parts, clumps):
    """Compute normal, gap, effective radius and contact point of each lane's pair.

    Writes the normal in `history` and the other quantities in `scratch`.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    """
    if len(clumps) == 0:
        tile.write_pair_geometry(scratch, history, parts)
    else:
        clump_tile.write_sphere_pair_geometry(scratch, history)


@kernel
def add_pair_forces(bodies, pairs, clumps, counts, physics, scratch, share, begin, end):
    """Compute the forces of touching pairs and add them to the loads of the bodies.

    The pairs are divided into ranges, called shares, which different threads handle.
    Each share has an array of partial sums of its own, `bodies.load[share]`, to which
    the forces are added. Overwrites `scratch`, and updates the numbers that the pairs
    keep in `pairs.data`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    share : int
        Index of the share, the first index of `bodies.load`.
    begin, end : int
        Range of the pairs of this share. `begin` is the first pair of a tile.

    Returns
    -------
    int
        Number of pairs that have parted. Their indices are in `pairs.ended` from
        `begin` on, and their gaps in `pairs.gap`.
    """
    n_pairs = min(counts[state.N_PAIRS], end)
    load = bodies.load[share]
    n_ended = 0
    # The constants of the first material, which are right for all lanes if it is the
    # only one of the bodies
    fill_law_constants(scratch, physics, 0, 0)
    share_row = state.share_column(physics.parts) * LANES
    # Only a large simulation divides its loads into several arrays of partial sums.
    # Such a simulation does not fit into the caches, so prefetching pays.
    is_large = bodies.load.shape[0] > 1
    for base in range(begin, n_pairs, LANES):
        history = pairs.data[base // LANES]
        n_lanes = min(LANES, n_pairs - base)
        if is_large:
            prefetch_next_pairs(pairs, load, bodies.rows, base)
        # Each lane gets the constants of its own pair of materials.
        if physics.mixed_pairs:
            for lane in range(LANES):
                k = base + lane
                kind_a = bodies.material[pairs.first[k]]
                kind_b = bodies.material[pairs.second[k]]
                fill_lane_law_constants(scratch, lane, physics, kind_a, kind_b)
        # Copy both bodies into the tile, and compute the geometry and the effective
        # mass.
        gather_bodies(bodies.rows, pairs.first, base, scratch, tile.A)
        gather_bodies(bodies.rows, pairs.second, base, scratch, tile.B)
        write_pair_geometry(scratch, history, physics.parts, clumps)
        write_mass_of_pairs(
            scratch, history, pairs, physics.parts, clumps, base, n_lanes
        )
        # Each body allows only a fraction of its tangential dashpots to act. A contact
        # has the smaller fraction of its two bodies, see `laws.tangential`.
        for lane in range(LANES):
            scratch[tile.SHARE + lane] = min(
                scratch[tile.A + share_row + lane], scratch[tile.B + share_row + lane]
            )
        apply_force_laws(scratch, history, physics, clumps, OF_PAIR)
        # Few tiles have a lane with a gap. All others skip the loop over the lanes.
        if tile.count_open_lanes(scratch) > 0:
            for lane in range(n_lanes):
                gap = scratch[tile.GAP + lane]
                if gap > separation_gap(history, physics, clumps, OF_PAIR, lane):
                    # A pair that has parted exerts no force. The caller removes it.
                    clear_lane(scratch, lane)
                    pairs.gap[base + lane] = gap
                    pairs.ended[begin + n_ended] = base + lane
                    n_ended += 1
        # Add the forces to both bodies.
        add_forces_to_loads(load, pairs.first, base, scratch, tile.TO_A)
        add_forces_to_loads(load, pairs.second, base, scratch, tile.TO_B)
        if is_large:
            mark_loads_as_nonzero(bodies, share, pairs.first, base)
            mark_loads_as_nonzero(bodies, share, pairs.second, base)
    return n_ended


@kernel
def write_still_wall(scratch):
    """Make body B of each lane a wall with infinite mass that neither moves nor turns.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    """
    for lane in range(LANES):
        for column in range(state.SHAPE):
            scratch[tile.B + column * LANES + lane] = 0.0
        # With an arm of zero, the velocity at the contact is simply that in the wall's
        # columns.
        for axis in range(3):
            scratch[tile.RB + axis * LANES + lane] = 0.0


@inlined
def write_wall_laws_and_motion(
    bodies, contacts, walls, physics, first_wall, base, n_contacts, scratch
):
    """Write the law constants and the motion of a tile's walls to the scratch tile.

    The walls are the bodies B of these contacts. If all walls stand still and have a
    single material, nothing is written. The tile then keeps what `write_still_wall` and
    `fill_law_constants` have written at the beginning of the step.

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
        Index of the first wall of this kind among all walls.
    base, n_contacts : int
        Index of the tile's first contact, and number of contacts in the list.
    scratch : array
        Scratch tile of LANES contacts (rows of `tile`); the walls are its bodies B.
    """
    # `approach[WALLS_MOVE]` is 1.0 if any wall moves, otherwise 0.0.
    if not (physics.mixed_walls or walls.approach[state.WALLS_MOVE] > 0.0):
        return
    for lane in range(LANES):
        k = base + lane
        # Velocity and angular velocity of the wall, which are zero in a lane without a
        # contact
        vx = vy = vz = omega_x = omega_y = omega_z = 0.0
        if k < n_contacts:
            wall = first_wall + contacts.wall[k]
            omega_x, omega_y, omega_z = vector_at(walls.motion[wall], state.WALL_SPIN)
            if physics.mixed_walls:
                material = bodies.material[contacts.body[k]]
                fill_lane_law_constants(
                    scratch, lane, physics, material, walls.material[wall]
                )
            # The velocity of a rotating wall depends on the position of the contact
            # point: the centre of body A (the first three rows from tile.A on) plus the
            # arm RA.
            x = scratch[tile.A + lane] + scratch[tile.RA + lane]
            y = scratch[tile.A + LANES + lane] + scratch[tile.RA + LANES + lane]
            z = scratch[tile.A + 2 * LANES + lane] + scratch[tile.RA + 2 * LANES + lane]
            vx, vy, vz = surface_velocity(walls.motion[wall], x, y, z)
        write_vector(scratch, tile.B + state.VELOCITY * LANES, lane, vx, vy, vz)
        # Only rolling laws use the angular velocity, because the arm of a wall is zero.
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
    """Schedule the next search for contacts between a body and a wall that have parted.

    The path of a body is its displacement plus that of the walls until now. The search
    is due when this path has grown by the gap between the body and the wall of contact
    k. The function writes the path of the next search to `contacts.limit`, and lowers
    `bodies.wall_check`, the path at which any wall is due for the body. It also sets to
    zero how far the bodies of the tile may move without a check (`bodies.wall_margin`).

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
        Distance between body and wall [m]. If it is 0 or less, the search is due in the
        next step.
    """
    wall = contacts.wall[k]
    body = contacts.body[k]
    limit = bodies.displacement[body] + walls.approach[state.WALL_PATH] + max(gap, 0.0)
    contacts.limit[wall, body] = min(contacts.limit[wall, body], limit)
    bodies.wall_check[body] = min(bodies.wall_check[body], limit)
    bodies.wall_margin[body // LANES] = 0.0


@inlined
def compute_wall_forces(
    bodies, contacts, clumps, walls, physics, first_wall, base, n_contacts, scratch
):
    """Compute the forces of a tile of contacts with walls, from their geometry.

    The geometry must have been written to `scratch` before. Writes the forces to the
    rows TO_A of `scratch`, and updates the numbers that the contacts keep in
    `contacts.data`, such as their springs. The order of the calls matters: the laws
    read what the calls before them write to the tile.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    first_wall : int
        Index of the first wall of this kind among all walls.
    base, n_contacts : int
        Index of the tile's first contact, and number of contacts in the list.
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    """
    history = contacts.data[base // LANES]
    write_wall_laws_and_motion(
        bodies, contacts, walls, physics, first_wall, base, n_contacts, scratch
    )
    write_mass_on_wall(
        scratch,
        history,
        contacts,
        physics.parts,
        clumps,
        base,
        min(LANES, n_contacts - base),
    )
    # The tangential dashpots of a body may be so strong that together they would
    # reverse its rotation in one step. Therefore each body allows only a fraction of
    # them to act (row SHARE). In a contact with a wall, this is the fraction of the
    # body A.
    share_row = state.share_column(physics.parts) * LANES
    for lane in range(LANES):
        scratch[tile.SHARE + lane] = scratch[tile.A + share_row + lane]
    apply_force_laws(scratch, history, physics, clumps, ON_WALL)


@inlined
def add_wall_forces_to_loads(
    bodies, contacts, walls, first_wall, base, n_contacts, scratch
):
    """Add the forces of a tile of contacts to the loads of the bodies and the walls.

    The loads of the walls are added up only if the user requested them.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    contacts : WallContacts
        The list of contacts with walls of one kind.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    first_wall : int
        Index of the first wall of this kind among all walls.
    base, n_contacts : int
        Index of the tile's first contact, and number of contacts in the list.
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    """
    add_loads_of_walls(walls, first_wall, contacts, base, n_contacts, scratch)
    # Contacts with walls are added to the first array of partial sums.
    add_forces_to_loads(bodies.load[0], contacts.body, base, scratch, tile.TO_A)
    if bodies.load.shape[0] > 1:
        mark_loads_as_nonzero(bodies, 0, contacts.body, base)


@inlined
def release_wall_contact(contacts, clumps, counts, length_slot, k, ghost):
    """Remove contact k with a wall from its list.

    If the body is a clump, its sphere is marked as not touching the wall, so that the
    sphere can begin a new contact with it.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    length_slot : int
        Index in `counts` of the length of this list, such as state.N_PLANE.
    k : int
        Index of the contact in its list.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    if len(clumps) > 0:
        forget_sphere_contact(contacts, clumps, counts, length_slot, k)
    drop_wall_contact(contacts, counts, length_slot, k, ghost)


@inlined
def drop_ended_contacts(contacts, clumps, counts, length_slot, n_ended, ghost):
    """Remove the contacts with walls that ended in this step, beginning with the last.

    The last contact of the list replaces a removed one. In this order, the replacement
    is never a contact that has ended, so the remaining indices stay valid.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts. The first n_ended numbers of `ended` are the indices of
        the contacts that ended, in increasing order.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    length_slot : int
        Index in `counts` of the length of this list, such as state.N_PLANE.
    n_ended : int
        Number of contacts that ended.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    for number in range(n_ended - 1, -1, -1):
        release_wall_contact(
            contacts, clumps, counts, length_slot, contacts.ended[number], ghost
        )


@inlined
def write_plane_geometry(scratch, history, parts, clumps):
    """Compute gap, effective radius and contact point of each lane's body on its plane.

    Writes the rows GAP, RADIUS and RA of `scratch`.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    """
    if len(clumps) == 0:
        tile.write_plane_geometry(scratch, history, parts)
    else:
        clump_tile.write_sphere_plane_geometry(scratch, history)


@kernel
def add_plane_forces(bodies, flat, clumps, walls, counts, physics, scratch, ghost):
    """Compute the forces of all contacts with planes and add them to the loads.

    Adds to `bodies.load`, and to `walls.loads` if the user requested it. Overwrites
    `scratch`, and updates the numbers that the contacts keep in `flat.data`. Contacts
    that have ended are removed, and a new search for them is scheduled for the time at
    which the gap may have closed.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    flat : WallContacts
        The contacts with planes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    n_contacts = counts[state.N_PLANE]
    # Only a large simulation divides its loads into several arrays of partial sums.
    # Such a simulation does not fit into the caches, so prefetching pays.
    is_large = bodies.load.shape[0] > 1
    n_ended = 0
    for base in range(0, n_contacts, LANES):
        history = flat.data[base // LANES]
        if is_large and base + LANES < n_contacts:
            prefetch_bodies(bodies.rows, bodies.load[0], flat.body, base + LANES)
        # Copy the bodies into the tile, and compute the geometry and the forces.
        gather_bodies(bodies.rows, flat.body, base, scratch, tile.A)
        write_plane_geometry(scratch, history, physics.parts, clumps)
        # The 0 is the index of the first plane among all walls.
        compute_wall_forces(
            bodies, flat, clumps, walls, physics, 0, base, n_contacts, scratch
        )
        # Few tiles have a lane with a gap. All others skip the loop over the lanes.
        if tile.count_open_lanes(scratch) > 0:
            for lane in range(min(LANES, n_contacts - base)):
                gap = scratch[tile.GAP + lane]
                if gap > separation_gap(history, physics, clumps, ON_WALL, lane):
                    clear_lane(scratch, lane)
                    # Beyond the edge of a disc the gap is BEYOND, which is infinite.
                    # Such a body may touch the disc after any motion, so it is searched
                    # for in the next step.
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
    """Mark a body as past a disc after it slid over the edge of the disc.

    The body is that of contact k. A body that is past a wall overlaps the wall's
    surface beyond its end or from behind, and cannot begin a contact until it is clear
    of the surface, see `walls`. For a clump, only the sphere of the contact is marked.

    Parameters
    ----------
    flat : WallContacts
        The contacts with planes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    k : int
        Index of the contact in its list.
    """
    wall = flat.wall[k]
    body = flat.body[k]
    if len(clumps) == 0:
        flat.allowed_overlap[wall, body] = 0.0
    else:
        set_bit(flat.past_bits[wall, body : body + 1], flat.feature[k])


@inlined
def mark_past_end(bodies, curved, clumps, walls, n_contacts, k, depth):
    """Mark a body as past a curved wall after it slid over the end of the wall.

    The body is that of contact k. A body that is past a wall overlaps the wall's
    surface beyond its end or from behind, and cannot begin a contact until it is clear
    of the surface, see `walls`. For a clump, only the sphere of the contact is marked.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    n_contacts, k : int
        Number of contacts in the list, and index of the contact.
    depth : float
        Overlap with which the body slid over the end [m].
    """
    if len(clumps) == 0:
        record_slide_off(bodies, curved, walls, n_contacts, k, depth)
    else:
        record_sphere_slide_off(bodies, curved, walls, k)


@inlined
def is_duplicate(contacts, k):
    """Return whether an earlier contact of the same body and wall has the same azimuth.

    A long body that lies across a curved wall touches it twice. The two contacts may
    merge when the body turns.

    Parameters
    ----------
    contacts : WallContacts
        The list of contacts with walls of one kind.
    k : int
        Index of the contact. The contacts before it are compared with it.
    """
    for earlier in range(k):
        if (
            contacts.body[earlier] == contacts.body[k]
            and contacts.wall[earlier] == contacts.wall[k]
        ):
            angle = angle_between(
                contact_azimuth(contacts.data, earlier),
                contact_azimuth(contacts.data, k),
            )
            if angle < 0.5 * SAME_AZIMUTH:
                return True
    return False


@inlined
def write_contact_to_lane(scratch, history, lane, geometry):
    """Copy the geometry of one contact to its lane of both tiles.

    The normal is written to `history`, the other quantities to `scratch`.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
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
    """Write a gap to the lanes without a contact, so that they have no force.

    These lanes may still hold the geometry of the previous tile. `n_lanes` is the
    number of lanes in use.
    """
    for lane in range(n_lanes, LANES):
        scratch[tile.GAP + lane] = GAP_WITHOUT_FORCE


@inlined
def update_curved_contact(
    bodies, curved, clumps, walls, physics, scratch, lane, k, geometry, local_row
):
    """Update contact k with a cone, tube or ring; return whether it ended.

    Contact k is in the lane `lane` of its tile. The function writes the normal to the
    tile of `curved.data`, and the other geometry to `scratch`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    k : int
        Index of the contact in its list.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
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
    # Smooth bodies: the solver continues from the last step. The contact keeps its gap,
    # because `overlap_with_other_walls` reads it. The contact of a single sphere cannot
    # have a duplicate.
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
    # Clumps: compute the contact of a sphere, whose centre lies at the end of the arm,
    # in closed form. Then let the arm of the contact point begin at the clump's centre.
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
    """Compute the forces of all contacts with curved walls and add them to the loads.

    Curved walls are cones, tubes and rings. Adds to `bodies.load`, and to `walls.loads`
    if the user requested it. Overwrites `scratch`, and updates the numbers that the
    contacts keep in `curved.data`. Contacts that have ended are removed, and the walls
    are searched for new ones in the next step.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    curved : WallContacts
        The contacts with cones, tubes and rings.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    geometry : array (8,)
        Working memory for one contact (`contact_geometry`). It is overwritten.
    local_row : array
        Working memory for a body's row in the frame of a wall. It is overwritten.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
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
        # Compute the geometry contact by contact, then the forces of the whole tile.
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
                # If a contact ended with an overlap, the body slid over the end of the
                # wall. It is then past the wall: it may not begin a new contact there
                # until it is clear of the wall's surface.
                if scratch[tile.GAP + lane] <= 0.0:
                    depth = -scratch[tile.GAP + lane]
                    mark_past_end(bodies, curved, clumps, walls, n_contacts, k, depth)
                # The force laws compute all lanes. With this large gap they give no
                # force.
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
        # Clear the lanes of contacts that have ended, and let the next step search the
        # wall again: the distance left is 0.0.
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
    n_contacts,
    k,
    geometry,
    other_geometry,
    local_row,
):
    """Update contact k with a mesh; return whether it still touches.

    The geometry of the contact is written to `geometry`, in world axes.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    meshed : WallContacts
        The contacts with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    n_contacts, k : int
        Number of contacts in the list, and index of the contact.
    geometry : array (8,)
        Overwritten with the contact in world axes (`contact_geometry`).
    other_geometry : array (8,)
        Working memory for a second contact. It is overwritten.
    local_row : array
        Working memory for a body's row in the frame of a wall. It is overwritten.
    """
    largest_gap = separation_gap(
        meshed.data[k // LANES], physics, clumps, ON_WALL, k % LANES
    )
    if len(clumps) == 0:
        return follow_mesh_contact(
            bodies,
            physics.parts,
            walls,
            meshes,
            meshed,
            n_contacts,
            k,
            largest_gap,
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
        n_contacts,
        k,
        largest_gap,
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

    Adds to `bodies.load`, and to `walls.loads` if the user requested it. Overwrites
    `scratch`, and updates the numbers that the contacts keep in `meshed.data`. Contacts
    that have ended are removed, and their meshes are searched again in the next step.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    meshed : WallContacts
        The contacts with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    walls : Walls
        Shapes, positions and motion of all walls (`state.Walls`).
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    geometry, other_geometry : array (8,)
        Working memory for two contacts (`contact_geometry`). It is overwritten.
    local_row : array
        Working memory for a body's row in the frame of a wall. It is overwritten.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
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
        # Compute the geometry contact by contact, then the forces of the whole tile.
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
                # A negative limit makes the search due in the next step.
                k = base + lane
                meshed.limit[meshed.wall[k], meshed.body[k]] = -1.0
        add_wall_forces_to_loads(
            bodies, meshed, walls, first_wall, base, n_contacts, scratch
        )
    drop_ended_contacts(meshed, clumps, counts, state.N_MESHED, n_ended, ghost)
