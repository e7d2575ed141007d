"""One time step of the bodies: translation, rotation, then the events of bodies.

The centres move by semi-implicit Euler (`move_lanes`), the rotation is in
`body_rotation`. Bodies are handled in tiles of L lanes in the scratch tile `m` (rows of
`body_tile`): copy the columns of `Bodies.rows` and the loads into it, move the bodies,
and copy the columns back. `motion` is the body's tile of `Bodies.motion`.

Reads and clears `Bodies.load`. Writes `Bodies.rows`, `motion`, `displacement`,
`resting`, `touched`, `longest`, `wall_margin`, `event`, `events`, `exit_time` and
`presence`, and `counts`.
"""

import math

from . import state as st
from .body_rotation import rotate_lanes, rotate_spheres, shape_lanes
from .body_tile import BEFORE, LOAD, MORE, PATH, ROWS
from .jit import inlined, kernel
from .neighbours import mark_moved
from .rows import L, add_vector, lane_vector, set_vector, vector_at, write_vector
from .simd import WIDTH, gather, lanes_to_rows, prefetch
from .state import (
    ANGULAR_MOMENTUM,
    INVERSE_MOMENTS,
    PART,
    QUATERNION,
    RELIST,
    SHAPE,
    alive,
)

# Bits of `Bodies.event`: the body fell through the exit height; it moved by half a skin,
# so its neighbours are found anew; it went below the floor.
FELL, MOVED_FAR, BELOW_FLOOR = 1, 2, 4

# First rows of the scratch tile `m`.
POSITION = ROWS + st.POSITION * L
HEIGHT = POSITION + 2 * L
VELOCITY = ROWS + st.VELOCITY * L
INVERSE_MASS = ROWS + st.INVERSE_MASS * L


@kernel
def move_lanes(m, gx, gy, gz, dt):
    """Move the centres of a tile's bodies by one step under their loads and gravity.

    Writes their velocities and positions, the height before the step (row BEFORE) and
    the length of the path (row PATH). Absent bodies have no mass and do not move.
    """
    for lane in range(L):
        inverse_mass = m[INVERSE_MASS + lane]
        is_present = 1.0 if inverse_mass > 0.0 else 0.0
        kick = dt * inverse_mass  # change of velocity per force
        vx, vy, vz = lane_vector(m, VELOCITY, lane)
        fx, fy, fz = lane_vector(m, LOAD, lane)
        vx = alive(vx + kick * fx + is_present * dt * gx)
        vy = alive(vy + kick * fy + is_present * dt * gy)
        vz = alive(vz + kick * fz + is_present * dt * gz)
        write_vector(m, VELOCITY, lane, vx, vy, vz)
        m[BEFORE + lane] = m[HEIGHT + lane]
        add_vector(m, POSITION, lane, dt * vx, dt * vy, dt * vz)
        square = vx * vx + vy * vy + vz * vz
        m[PATH + lane] = dt * math.sqrt(square)


@kernel
def count_events(m, motion, displacement, base, exit_height, floor_height):
    """Add the paths of a tile's bodies to their displacements, and count events.

    `base` is the first body of the tile. Returns the number of bodies with an event (see
    `event_of`). The loop has no branches, so it is vector code; events are rare.
    """
    n = 0
    for lane in range(L):
        reading = displacement[base + lane] + m[PATH + lane]
        displacement[base + lane] = reading
        z = m[HEIGHT + lane]
        has_fallen = (m[BEFORE + lane] >= exit_height) & (z < exit_height)
        is_present = m[INVERSE_MASS + lane] > 0.0
        has_moved_far = reading >= motion[RELIST + lane]
        n += 1 if is_present & (has_moved_far | has_fallen | (z < floor_height)) else 0
    return n


@inlined
def longest_path(m):
    """Return the longest path of a tile's bodies in this step; overwrites the paths."""
    # Halving the number of lanes in each round makes vector code of a maximum.
    half = L // 2
    while half > 0:
        for lane in range(half):
            m[PATH + lane] = max(m[PATH + lane], m[PATH + half + lane])
        half //= 2
    return m[PATH]


@inlined
def event_of(bodies, physics, m, motion, lane, i):
    """Return the event of body i as bits FELL, MOVED_FAR and BELOW_FLOOR; 0 for none."""
    z = m[HEIGHT + lane]
    event = 0
    if m[BEFORE + lane] >= physics.exit_height and z < physics.exit_height:
        event |= FELL
    if bodies.displacement[i] >= motion[RELIST + lane]:
        event |= MOVED_FAR
    if z < physics.floor_height:
        event |= BELOW_FLOOR
    return event if bodies.presence[i] == st.PRESENT else 0


@kernel
def act_on_events(bodies, grid, counts, begin, n, time):
    """Handle the events of n bodies, listed in `bodies.events` from place `begin` on."""
    for e in range(begin, begin + n):
        i = bodies.events[e]
        event = bodies.event[i]
        if event & FELL:
            bodies.exit_time[i] = time
        if event & BELOW_FLOOR:
            bodies.presence[i] = st.GONE
            counts[st.N_GONE] += 1
        if event & (MOVED_FAR | BELOW_FLOOR):
            mark_moved(grid, counts, i)


@inlined
def sum_loads(bodies, tile, m):
    """Write the sum of the shares of a tile's loads to the rows LOAD, and clear them.

    A share that no contact touched is zero and is skipped. The shares are added in their
    order, whichever thread made them, so the sum has the same bits.
    """
    base = tile * L
    for number in range(st.LOAD_COLUMNS * L):
        m[LOAD + number] = 0.0
    for share in range(bodies.load.shape[0]):
        if bodies.touched[share, tile]:
            bodies.touched[share, tile] = 0
            load = bodies.load[share]
            gather(load, st.LOAD_COLUMNS, bodies.every, base, m, MORE)
            for number in range(st.LOAD_COLUMNS * L):
                m[LOAD + number] += m[MORE + number]
            load[base : base + L] = 0.0


@inlined
def move_only_load(bodies, tile, m):
    """Move the loads of a tile to the rows LOAD, where there is only one share."""
    base = tile * L
    load = bodies.load[0]
    gather(load, st.LOAD_COLUMNS, bodies.every, base, m, LOAD)
    load[base : base + L] = 0.0


@inlined
def fetch_next(bodies, tile):
    """Prefetch the loads, rows and motion of the tile after the next one.

    In a large simulation they are not in the cache.
    """
    next_tile = tile + 2
    if next_tile >= bodies.resting.shape[0]:
        return
    is_turning = bodies.resting[next_tile] == 0
    base = next_tile * L
    for k in range(base, base + L):
        prefetch(bodies.rows, k, 0)
        if is_turning:
            for column in range(WIDTH, bodies.rows.shape[1], WIDTH):
                prefetch(bodies.rows, k, column)
    for share in range(bodies.load.shape[0]):
        if bodies.touched[share, next_tile]:
            for k in range(base, base + L):
                prefetch(bodies.load[share], k, 0)
    # of a tile at rest, only the row RELIST is read
    first = QUATERNION if is_turning else RELIST
    last = st.RADIUS + L if is_turning else INVERSE_MOMENTS
    for column in range(first, last, WIDTH):
        prefetch(bodies.motion, next_tile, column)


@inlined
def scatter_rows(bodies, base, m, columns):
    """Copy the first columns of a tile's bodies from the scratch tile to `Bodies.rows`."""
    for lane in range(0, L, WIDTH):
        for column in range(0, columns, WIDTH):
            lanes_to_rows(
                bodies.rows,
                column,
                bodies.every,
                base + lane,
                m,
                ROWS + column * L + lane,
                L,
            )


@kernel
def integrate(bodies, counts, physics, m, begin, end):
    """Advance bodies `begin` to `end` by one step, and clear their loads.

    Where the loads have several shares, the longest path of each tile is written to
    `bodies.longest` and subtracted from `bodies.wall_margin`.

    Parameters
    ----------
    m : array
        Scratch tile.
    begin, end : int
        The bodies; `begin` is the first one of a tile.

    Returns
    -------
    int
        Number of bodies with events. They are listed in `bodies.events` from place
        `begin` on.
    """
    dt = physics.dt
    gx, gy, gz = vector_at(physics.gravity, 0)
    fx, fy, fz = vector_at(physics.rolling_frame, 0)
    columns = bodies.rows.shape[1]
    n = min(counts[st.N_BODIES], end)
    shares = bodies.load.shape[0]
    n_events = 0
    for base in range(begin, n, L):
        tile = base // L
        motion = bodies.motion[tile]
        is_resting = bodies.resting[tile] == 1
        # Of a tile in which nothing turned, only the first eight columns are read and
        # written: position, velocity, inverse mass.
        n_read = WIDTH if bodies.resting[tile] else columns
        gather(bodies.rows, n_read, bodies.every, base, m, ROWS)
        if shares > 1:
            fetch_next(bodies, tile)
            sum_loads(bodies, tile, m)
        else:
            move_only_load(bodies, tile, m)
        move_lanes(m, gx, gy, gz, dt)
        if physics.parts == st.SPHERES:
            is_turning = rotate_spheres(m, motion, dt, is_resting, fx, fy, fz)
        else:
            is_turning = rotate_lanes(
                m, motion, dt, physics.parts, is_resting, fx, fy, fz
            )
        n_written = columns if is_turning else n_read
        bodies.resting[tile] = 0 if is_turning else 1
        scatter_rows(bodies, base, m, n_written)
        in_tile = count_events(
            m,
            motion,
            bodies.displacement,
            base,
            physics.exit_height,
            physics.floor_height,
        )
        if in_tile > 0:
            for lane in range(min(L, n - base)):
                event = event_of(bodies, physics, m, motion, lane, base + lane)
                if event:
                    bodies.event[base + lane] = event
                    bodies.events[begin + n_events] = base + lane
                    n_events += 1
        if shares > 1:
            longest = longest_path(m)
            bodies.longest[tile] = longest
            bodies.wall_margin[tile] -= longest
    return n_events


@kernel
def place_shape(bodies, i, parts, m):
    """Write inverse inertia and shape of body i as it is oriented now.

    It does not move the body. `m` is a scratch tile.
    """
    if parts == st.SPHERES:
        bodies.rows[i, st.SPHERE_RADIUS] = bodies.motion[i // L, st.RADIUS + i % L]
        return
    lane = i % L
    shape_lanes(m, bodies.motion[i // L], parts)
    for column in range(st.INVERSE_INERTIA, SHAPE + max(PART * parts, 4)):
        bodies.rows[i, column] = m[ROWS + column * L + lane]


@kernel
def stop_body(bodies, i):
    """Stop a body that is gone: without mass no force moves it."""
    row = bodies.rows[i]
    set_vector(row, st.VELOCITY, 0.0, 0.0, 0.0)
    set_vector(row, st.ANGULAR_VELOCITY, 0.0, 0.0, 0.0)
    row[st.INVERSE_MASS] = 0.0
    write_vector(bodies.motion[i // L], ANGULAR_MOMENTUM, i % L, 0.0, 0.0, 0.0)
    bodies.wall_check[i] = math.inf
