"""Make one time step of the bodies: translation, rotation, then their events.

The centres move by the semi-implicit Euler method (`move_centres`). The rotation is in
`body_rotation`. Bodies are handled in tiles of 32. Columns of `Bodies.rows` and the
loads are copied to a scratch tile with one body in each lane (rows of `body_tile`).
There the bodies are moved, and the columns are copied back. `scratch` is this scratch
tile, `motion` the bodies' tile of `Bodies.motion`, and `first_body` the index of the
tile's first body.

Reads and clears `Bodies.load`. Writes `Bodies.rows`, `motion`, `displacement`,
`resting`, `touched`, `longest_path`, `wall_margin`, `event`, `events`, `exit_time` and
`presence`, and `counts`.
"""

import math

from . import state
from .body_rotation import rotate_bodies, rotate_spheres, write_shapes
from .body_tile import HEIGHT_BEFORE, LOAD, PATH, ROWS, SHARE_LOAD
from .jit import inlined, kernel
from .neighbours import mark_moved
from .rows import LANES, add_vector, lane_vector, set_vector, vector_at, write_vector
from .simd import WIDTH, gather, lanes_to_rows, prefetch
from .state import (
    ANGULAR_MOMENTUM,
    INVERSE_MOMENTS,
    PART,
    QUATERNION,
    RENEWAL,
    SHAPE,
    flush_tiny,
)
from .vectors import squared_length

# Bits of `Bodies.event`: the body fell through the exit height; it has moved by half a
# skin, so its neighbours are found again; it fell below the floor.
FELL, MOVED_FAR, BELOW_FLOOR = 1, 2, 4

# First rows of quantities in the scratch tile
POSITION = ROWS + state.POSITION * LANES
HEIGHT = POSITION + 2 * LANES
VELOCITY = ROWS + state.VELOCITY * LANES
INVERSE_MASS = ROWS + state.INVERSE_MASS * LANES


@kernel
def move_centres(scratch, gx, gy, gz, dt):
    """Move the centres of a tile's bodies by one step under their loads and gravity.

    The load of a body is the force of its contacts (rows LOAD). In the semi-implicit
    Euler method, the velocity changes first, and the new velocity then moves the
    centre. Writes the velocities and positions, the height before the step (row
    HEIGHT_BEFORE) and the length of the path in this step (row PATH). Absent bodies
    have no mass and do not move. Velocities that are almost zero become zero
    (`state.flush_tiny`).

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    gx, gy, gz : float
        Acceleration of gravity [m/s2].
    dt : float
        Time step [s].
    """
    for lane in range(LANES):
        inverse_mass = scratch[INVERSE_MASS + lane]
        # The loop has no branches, so that it becomes vector code. Gravity is
        # multiplied by 0.0 for an absent body.
        is_present = 1.0 if inverse_mass > 0.0 else 0.0
        velocity_per_force = dt * inverse_mass
        vx, vy, vz = lane_vector(scratch, VELOCITY, lane)
        fx, fy, fz = lane_vector(scratch, LOAD, lane)
        vx = flush_tiny(vx + velocity_per_force * fx + is_present * dt * gx)
        vy = flush_tiny(vy + velocity_per_force * fy + is_present * dt * gy)
        vz = flush_tiny(vz + velocity_per_force * fz + is_present * dt * gz)
        write_vector(scratch, VELOCITY, lane, vx, vy, vz)
        # The row HEIGHT is the z component of POSITION.
        scratch[HEIGHT_BEFORE + lane] = scratch[HEIGHT + lane]
        # The new velocity moves the centre.
        add_vector(scratch, POSITION, lane, dt * vx, dt * vy, dt * vz)
        scratch[PATH + lane] = dt * math.sqrt(squared_length(vx, vy, vz))


@kernel
def add_paths_and_count_events(
    scratch, motion, displacement, first_body, exit_height, floor_height
):
    """Add the paths of a tile's bodies to their displacements, and count events.

    The displacement of a body is the sum of its paths, the distance that any of its
    points may have moved until now. An event is one of three: a fall through the exit
    height, a motion by half a skin since the neighbours were last listed (the
    displacement reaches the row RENEWAL), or a fall below the floor. Events are rare,
    so they are only counted here, in a loop without branches that becomes vector code.
    If there are any, `find_body_events` finds them.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    motion : array (MOTION_ROWS * LANES,)
        Tile of `Bodies.motion` with quaternions, angular momenta and other numbers of
        LANES bodies, one body in each lane: `motion[row + lane]`. The module `state`
        names the rows.
    displacement : array (bodies,)
        `Bodies.displacement` [m], which is updated.
    first_body : int
        Index of the tile's first body.
    exit_height, floor_height : float
        Heights of the exit and of the floor [m].

    Returns
    -------
    int
        Number of bodies with an event.
    """
    n_events = 0
    for lane in range(LANES):
        new_displacement = displacement[first_body + lane] + scratch[PATH + lane]
        displacement[first_body + lane] = new_displacement
        z = scratch[HEIGHT + lane]
        # These conditions must be the same as in `find_body_events`. `&` and `|` in
        # place of `and` and `or` avoid branches.
        has_fallen = (scratch[HEIGHT_BEFORE + lane] >= exit_height) & (z < exit_height)
        is_present = scratch[INVERSE_MASS + lane] > 0.0
        has_moved_far = new_displacement >= motion[RENEWAL + lane]
        is_below_floor = z < floor_height
        has_event = is_present & (has_moved_far | has_fallen | is_below_floor)
        n_events += 1 if has_event else 0
    return n_events


@inlined
def longest_path(scratch):
    """Return the longest path of a tile's bodies in this step [m].

    The paths are overwritten: each pass of the loop keeps the longer path of each pair.
    The compiler turns this into vector code, unlike an ordinary maximum.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    """
    half = LANES // 2
    while half > 0:
        for lane in range(half):
            scratch[PATH + lane] = max(
                scratch[PATH + lane], scratch[PATH + half + lane]
            )
        half //= 2
    return scratch[PATH]


@inlined
def find_body_events(bodies, physics, scratch, motion, lane, i):
    """Return the events of body i as bits FELL, MOVED_FAR and BELOW_FLOOR; 0 for none.

    The event FELL occurs in the step in which the centre falls through the exit height.
    MOVED_FAR occurs when the displacement of the body reaches the row RENEWAL of
    `motion`: it has moved by half a skin since its neighbours were last listed.
    BELOW_FLOOR occurs when its centre is below the floor. The conditions must be the
    same as in `add_paths_and_count_events`, which only counts events.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    motion : array (MOTION_ROWS * LANES,)
        Tile of `Bodies.motion` with quaternions, angular momenta and other numbers of
        LANES bodies, one body in each lane: `motion[row + lane]`. The module `state`
        names the rows.
    lane : int
        Lane of the body in both tiles.
    i : int
        Index of the body.
    """
    # Height of the centre after the step
    z = scratch[HEIGHT + lane]
    event = 0
    if scratch[HEIGHT_BEFORE + lane] >= physics.exit_height and z < physics.exit_height:
        event |= FELL
    if bodies.displacement[i] >= motion[RENEWAL + lane]:
        event |= MOVED_FAR
    if z < physics.floor_height:
        event |= BELOW_FLOOR
    # An absent body, or one that is gone, has no events.
    return event if bodies.presence[i] == state.PRESENT else 0


@kernel
def handle_events(bodies, grid, counts, begin, n_events, time):
    """Handle the events of bodies in this step.

    The events of a body are bits of `bodies.event`. FELL: a body that fell through the
    exit height gets an exit time. BELOW_FLOOR: a body below the floor is gone, and no
    longer takes part in the simulation. MOVED_FAR: the body has moved far. In the last
    two cases, the body is put into `Grid.moved_list`, so that its neighbours are found
    again. Each body may be listed only once.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    begin, n_events : int
        The bodies with events are `bodies.events[begin : begin + n_events]`; their
        events are in `bodies.event`.
    time : float
        Simulated time [s].
    """
    for index in range(begin, begin + n_events):
        i = bodies.events[index]
        event = bodies.event[i]
        if event & FELL:
            bodies.exit_time[i] = time
        if event & BELOW_FLOOR:
            bodies.presence[i] = state.GONE
            counts[state.N_GONE] += 1
        # The search for neighbours also removes the pairs of a body that is gone.
        if event & (MOVED_FAR | BELOW_FLOOR):
            mark_moved(grid, counts, i)


@inlined
def sum_loads(bodies, tile_number, scratch):
    """Add up the partial loads of a tile's bodies, and clear them.

    `bodies.load` has several arrays of partial sums, called shares, because different
    threads add forces at the same time. The function writes their sum to the rows LOAD
    of `scratch`. Shares to which no contact has written are zero and are skipped:
    `bodies.touched` marks the others. The order of the sum does not depend on the
    threads, so the sum is always the same, bit for bit.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    tile_number : int
        Index of the tile.
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    """
    first_body = tile_number * LANES
    for index in range(state.LOAD_COLUMNS * LANES):
        scratch[LOAD + index] = 0.0
    for share in range(bodies.load.shape[0]):
        if bodies.touched[share, tile_number]:
            bodies.touched[share, tile_number] = 0
            load = bodies.load[share]
            # Copy the loads of the tile's bodies to the rows SHARE_LOAD, one body in
            # each lane, and add these rows to the sum. The bodies of a tile are
            # consecutive.
            gather(
                load,
                state.LOAD_COLUMNS,
                bodies.indices,
                first_body,
                scratch,
                SHARE_LOAD,
            )
            for index in range(state.LOAD_COLUMNS * LANES):
                scratch[LOAD + index] += scratch[SHARE_LOAD + index]
            load[first_body : first_body + LANES] = 0.0


@inlined
def move_single_load(bodies, tile_number, scratch):
    """Copy the loads of a tile's bodies to the rows LOAD, and clear them.

    In a small simulation, `bodies.load` has only one array of partial sums.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    tile_number : int
        Index of the tile.
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    """
    first_body = tile_number * LANES
    load = bodies.load[0]
    gather(load, state.LOAD_COLUMNS, bodies.indices, first_body, scratch, LOAD)
    load[first_body : first_body + LANES] = 0.0


@inlined
def prefetch_tile_ahead(bodies, tile_number):
    """Prefetch rows, loads and motion of the tile after the next one into the cache.

    In a large simulation they are not in the cache yet. They arrive there before the
    loop reaches that tile. A cache line holds WIDTH numbers, so one number in WIDTH is
    enough.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    tile_number : int
        Index of the present tile.
    """
    # `next_tile` is the tile after the next one.
    next_tile = tile_number + 2
    if next_tile >= bodies.resting.shape[0]:
        return
    is_turning = bodies.resting[next_tile] == 0
    first_body = next_tile * LANES
    # For a tile at rest, the step reads only the first columns of the rows.
    for i in range(first_body, first_body + LANES):
        prefetch(bodies.rows, i, 0)
        if is_turning:
            for column in range(WIDTH, bodies.rows.shape[1], WIDTH):
                prefetch(bodies.rows, i, column)
    for share in range(bodies.load.shape[0]):
        if bodies.touched[share, next_tile]:
            for i in range(first_body, first_body + LANES):
                prefetch(bodies.load[share], i, 0)
    # For a tile at rest, the step reads only the row RENEWAL of the motion, which ends
    # where INVERSE_MOMENTS begins. Otherwise it reads all rows from QUATERNION to
    # RADIUS, the first and the last.
    first = QUATERNION if is_turning else RENEWAL
    end = state.RADIUS + LANES if is_turning else INVERSE_MOMENTS
    for index in range(first, end, WIDTH):
        prefetch(bodies.motion, next_tile, index)


@inlined
def scatter_rows(bodies, first_body, scratch, n_columns):
    """Copy the first columns of a tile's bodies from the scratch tile to `Bodies.rows`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    first_body : int
        Index of the tile's first body.
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    n_columns : int
        Number of columns, a multiple of WIDTH.
    """
    for lane in range(0, LANES, WIDTH):
        for column in range(0, n_columns, WIDTH):
            lanes_to_rows(
                bodies.rows,
                column,
                bodies.indices,
                first_body + lane,
                scratch,
                ROWS + column * LANES + lane,
                LANES,
            )


@kernel
def integrate(bodies, counts, physics, scratch, begin, end):
    """Advance bodies `begin` to `end` by one step, and clear their loads.

    In a large simulation, whose loads have several arrays of partial sums, the longest
    path of each tile in this step is written to `bodies.longest_path` and subtracted
    from `bodies.wall_margin`, which is how far the bodies of the tile may still move
    until one of them is due for a search of the walls.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    physics : Physics
        Time step, gravity and constants of the laws (`state.Physics`).
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    begin, end : int
        First body of the range, and its end. `begin` is the first body of a tile; `end`
        may be larger than the number of bodies.

    Returns
    -------
    int
        Number of bodies with events. `bodies.events` lists them from index `begin` on.
    """
    dt = physics.dt
    gx, gy, gz = vector_at(physics.gravity, 0)
    frame_x, frame_y, frame_z = vector_at(physics.rolling_frame, 0)
    n_columns = bodies.rows.shape[1]
    end_body = min(counts[state.N_BODIES], end)
    n_shares = bodies.load.shape[0]
    n_events = 0
    for first_body in range(begin, end_body, LANES):
        tile = first_body // LANES
        motion = bodies.motion[tile]
        is_resting = bodies.resting[tile] == 1
        # In a tile without rotating bodies, only the first eight columns are read and
        # written. They contain position, velocity and inverse mass.
        n_read = WIDTH if is_resting else n_columns
        gather(bodies.rows, n_read, bodies.indices, first_body, scratch, ROWS)
        if n_shares > 1:
            prefetch_tile_ahead(bodies, tile)
            sum_loads(bodies, tile, scratch)
        else:
            move_single_load(bodies, tile, scratch)
        move_centres(scratch, gx, gy, gz, dt)
        if physics.parts == state.SPHERES:
            is_turning = rotate_spheres(
                scratch, motion, dt, is_resting, frame_x, frame_y, frame_z
            )
        else:
            is_turning = rotate_bodies(
                scratch,
                motion,
                dt,
                physics.parts,
                is_resting,
                frame_x,
                frame_y,
                frame_z,
            )
        # All columns are written if a body of the tile is rotating now.
        bodies.resting[tile] = 0 if is_turning else 1
        n_written = n_columns if is_turning else n_read
        scatter_rows(bodies, first_body, scratch, n_written)
        n_in_tile = add_paths_and_count_events(
            scratch,
            motion,
            bodies.displacement,
            first_body,
            physics.exit_height,
            physics.floor_height,
        )
        # Few tiles have events. All others skip the loop over the lanes.
        if n_in_tile > 0:
            for lane in range(min(LANES, end_body - first_body)):
                event = find_body_events(
                    bodies, physics, scratch, motion, lane, first_body + lane
                )
                if event:
                    bodies.event[first_body + lane] = event
                    bodies.events[begin + n_events] = first_body + lane
                    n_events += 1
        if n_shares > 1:
            longest = longest_path(scratch)
            bodies.longest_path[tile] = longest
            bodies.wall_margin[tile] -= longest
    return n_events


@kernel
def write_body_shape(bodies, i, parts, scratch):
    """Write inverse inertia and shape of body i in its present orientation to its row.

    The shape is a matrix for each ellipsoid of a smooth body, or the quaternion of a
    clump. For a sphere, only the radius is written. No body moves, and no other row
    changes: `scratch` is a tile of the bodies, of which only the lane of body i is
    used. The function is called when a body is added.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    i : int
        Index of the body.
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    """
    motion = bodies.motion[i // LANES]
    lane = i % LANES
    if parts == state.SPHERES:
        bodies.rows[i, state.SPHERE_RADIUS] = motion[state.RADIUS + lane]
        return
    write_shapes(scratch, motion, parts)
    # Copy the columns of the inverse inertia, and then those of the shape. A shape has
    # PART columns for each ellipsoid, or the 4 numbers of a quaternion if `parts` is 0.
    # From ROWS on, the tile has a row for each column of `Bodies.rows`.
    for column in range(state.INVERSE_INERTIA, SHAPE + max(PART * parts, 4)):
        bodies.rows[i, column] = scratch[ROWS + column * LANES + lane]


@kernel
def stop_body(bodies, i):
    """Stop body i, which is gone, and remove its mass so that no force moves it.

    The body is never due for a search of walls again.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    i : int
        Index of the body.
    """
    row = bodies.rows[i]
    set_vector(row, state.VELOCITY, 0.0, 0.0, 0.0)
    set_vector(row, state.ANGULAR_VELOCITY, 0.0, 0.0, 0.0)
    row[state.INVERSE_MASS] = 0.0
    write_vector(bodies.motion[i // LANES], ANGULAR_MOMENTUM, i % LANES, 0.0, 0.0, 0.0)
    # The body is never due for a search of walls.
    bodies.wall_check[i] = math.inf
