"""One time step of the bodies: semi-implicit Euler for the centres, then `body_rotation`, then the events."""

import math

from . import state as st
from .body_rotation import rotate_lanes, rotate_spheres, shape_lanes
from .body_tile import BEFORE, LOAD, MORE, PATH, ROWS, L
from .jit import inlined, kernel
from .neighbours import mark_moved
from .rows import add_vector, write_vector
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

FELL, MOVED_ON, LOST = 1, 2, 4  # bits of an event


@kernel
def move_lanes(m, gx, gy, gz, dt):
    """Move the centres of the bodies of a tile by one time step under their loads."""
    for k in range(L):
        inverse_mass = m[ROWS + st.INVERSE_MASS * L + k]
        there = 1.0 if inverse_mass > 0.0 else 0.0
        kick = dt * inverse_mass
        vx = alive(m[ROWS + 3 * L + k] + kick * m[LOAD + k] + there * dt * gx)
        vy = alive(m[ROWS + 4 * L + k] + kick * m[LOAD + L + k] + there * dt * gy)
        vz = alive(m[ROWS + 5 * L + k] + kick * m[LOAD + 2 * L + k] + there * dt * gz)
        write_vector(m, ROWS + 3 * L, k, vx, vy, vz)
        m[BEFORE + k] = m[ROWS + 2 * L + k]
        add_vector(m, ROWS, k, dt * vx, dt * vy, dt * vz)
        square = vx * vx + vy * vy + vz * vz
        m[PATH + k] = dt * math.sqrt(square)


@kernel
def noteworthy(m, c, displacement, base, exit_height, floor):
    """Add to the displacements of a tile's bodies; returns how many have an event (see `event_of`)."""
    n = 0
    for k in range(L):
        reading = displacement[base + k] + m[PATH + k]
        displacement[base + k] = reading
        z = m[ROWS + 2 * L + k]
        fell = (m[BEFORE + k] >= exit_height) & (z < exit_height)
        there = m[ROWS + st.INVERSE_MASS * L + k] > 0.0
        n += 1 if there & ((reading >= c[st.RELIST + k]) | fell | (z < floor)) else 0
    return n


@inlined
def longest_path(m):
    """Longest path of a tile's bodies in this step; overwrites the paths."""
    half = L // 2
    while half > 0:
        for k in range(half):
            m[PATH + k] = max(m[PATH + k], m[PATH + half + k])
        half //= 2
    return m[PATH]


@inlined
def event_of(bodies, physics, m, c, lane, i):
    """Compute the event of a body: it fell through the exit, needs new neighbours, or went below the floor."""
    z = m[ROWS + 2 * L + lane]
    event = 0
    if m[BEFORE + lane] >= physics.exit_height and z < physics.exit_height:
        event |= FELL
    if bodies.displacement[i] >= c[st.RELIST + lane]:
        event |= MOVED_ON
    if z < physics.floor_height:
        event |= LOST
    return event if bodies.presence[i] == st.PRESENT else 0


@kernel
def act_on_events(bodies, grid, counts, begin, n, time):
    """Handle the events of n bodies, listed in bodies.events from place `begin` on."""
    for e in range(begin, begin + n):
        i = bodies.events[e]
        event = bodies.event[i]
        if event & FELL:
            bodies.exit_time[i] = time
        if event & LOST:
            bodies.presence[i] = st.GONE
            counts[st.N_GONE] += 1
        if event & (MOVED_ON | LOST):
            mark_moved(grid, counts, i)


@inlined
def take_loads(bodies, tile, m):
    """Add up the shares of a tile's loads and clear them; a share that no contact touched is zero and is skipped."""
    base = tile * L
    for k in range(st.LOAD_COLUMNS * L):
        m[LOAD + k] = 0.0
    for share in range(bodies.load.shape[0]):
        if bodies.touched[share, tile]:
            bodies.touched[share, tile] = 0
            load = bodies.load[share]
            gather(load, st.LOAD_COLUMNS, bodies.every, base, m, MORE)
            for k in range(st.LOAD_COLUMNS * L):
                m[LOAD + k] += m[MORE + k]
            load[base : base + L] = 0.0


@inlined
def take_only_load(bodies, tile, m):
    """Take a tile's loads, of which there is one share, and clear them."""
    base = tile * L
    load = bodies.load[0]
    gather(load, st.LOAD_COLUMNS, bodies.every, base, m, LOAD)
    load[base : base + L] = 0.0


@inlined
def fetch_next(bodies, tile):
    """Prefetch the loads, rows and motion of the next tile but one: in a large simulation they are not in the cache."""
    following = tile + 2
    if following >= bodies.resting.shape[0]:
        return
    turning = bodies.resting[following] == 0
    base = following * L
    for k in range(base, base + L):
        prefetch(bodies.rows, k, 0)
        if turning:
            for column in range(WIDTH, bodies.rows.shape[1], WIDTH):
                prefetch(bodies.rows, k, column)
    for share in range(bodies.load.shape[0]):
        if bodies.touched[share, following]:
            for k in range(base, base + L):
                prefetch(bodies.load[share], k, 0)
    first = QUATERNION if turning else RELIST
    last = st.RADIUS + L if turning else INVERSE_MOMENTS
    for column in range(first, last, WIDTH):
        prefetch(bodies.motion, following, column)


@kernel
def integrate(bodies, counts, physics, m, begin, end):
    """Advance bodies begin (the first of a tile) to end by one step and clear their loads; returns how many had events.

    Bodies with events are listed in bodies.events from place `begin` on. Where the loads have several shares, the
    longest path of each tile is written to bodies.longest and subtracted from bodies.wall_margin.
    """
    dt = physics.dt
    gx, gy, gz = physics.gravity[0], physics.gravity[1], physics.gravity[2]
    fx, fy, fz = (
        physics.rolling_frame[0],
        physics.rolling_frame[1],
        physics.rolling_frame[2],
    )
    columns = bodies.rows.shape[1]
    n = min(counts[st.N_BODIES], end)
    shares = bodies.load.shape[0]
    found = 0
    for base in range(begin, n, L):
        tile = base // L
        c = bodies.motion[tile]
        # of a tile in which nothing rotated, only the first eight columns are read and written
        read = WIDTH if bodies.resting[tile] else columns
        gather(bodies.rows, read, bodies.every, base, m, ROWS)
        if shares > 1:
            fetch_next(bodies, tile)
            take_loads(bodies, tile, m)
        else:
            take_only_load(bodies, tile, m)
        move_lanes(m, gx, gy, gz, dt)
        if physics.parts == st.SPHERES:
            turns = rotate_spheres(m, c, dt, bodies.resting[tile] == 1, fx, fy, fz)
        else:
            turns = rotate_lanes(
                m, c, dt, physics.parts, bodies.resting[tile] == 1, fx, fy, fz
            )
        write = columns if turns else read
        bodies.resting[tile] = 0 if turns else 1
        for k in range(0, L, WIDTH):
            for column in range(0, write, WIDTH):
                lanes_to_rows(
                    bodies.rows,
                    column,
                    bodies.every,
                    base + k,
                    m,
                    ROWS + column * L + k,
                    L,
                )
        if (
            noteworthy(
                m,
                c,
                bodies.displacement,
                base,
                physics.exit_height,
                physics.floor_height,
            )
            > 0
        ):
            for lane in range(min(L, n - base)):
                event = event_of(bodies, physics, m, c, lane, base + lane)
                if event:
                    bodies.event[base + lane] = event
                    bodies.events[begin + found] = base + lane
                    found += 1
        if shares > 1:
            longest = longest_path(m)
            bodies.longest[tile] = longest
            bodies.wall_margin[tile] -= longest
    return found


@kernel
def place_shape(bodies, i, parts, m):
    """Write inverse inertia and shape of body i in its present orientation, without moving it."""
    if parts == st.SPHERES:
        bodies.rows[i, st.SPHERE_RADIUS] = bodies.motion[i // L, st.RADIUS + i % L]
        return
    base = i // L * L
    shape_lanes(m, bodies.motion[i // L], parts)
    for c in range(st.INVERSE_INERTIA, SHAPE + max(PART * parts, 4)):
        bodies.rows[i, c] = m[ROWS + c * L + i - base]


@kernel
def take_away(bodies, i):
    """Stop a body that is gone: without mass no force moves it."""
    for c in range(3):
        bodies.rows[i, st.VELOCITY + c] = bodies.rows[i, st.ANGULAR_VELOCITY + c] = 0.0
        bodies.motion[i // L, ANGULAR_MOMENTUM + c * L + i % L] = 0.0
    bodies.rows[i, st.INVERSE_MASS] = 0.0
    bodies.wall_check[i] = math.inf
