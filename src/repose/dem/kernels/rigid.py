"""Motion of the bodies: semi-implicit Euler, world-frame angular momentum, midpoint rotation.

Angular momentum is the state; the angular velocity follows from it at the middle of the step, so free rotation keeps
the momentum to the bit and the energy to second order.
"""

import math

import numpy as np

from . import state as st
from .jit import inlined, kernel
from .neighbours import mark_moved
from .simd import WIDTH, lanes_to_rows, prefetch, rows_to_lanes
from .state import ANGULAR_MOMENTUM, INVERSE_MOMENTS, LANES, PART, QUATERNION, RELIST, SHAPE, SQUARES

L = LANES  # short, for the index arithmetic below

# Rows of the scratch tile: the columns of `rows` and of `load` (see `state`), then what the step finds.
ROWS = 0
OMEGA = ROWS + st.ANGULAR_VELOCITY * L
LOAD = 32 * L
PATH = 40 * L  # how far the farthest point of the body may have moved
BEFORE = 41 * L  # height before the step
INVERSE_INERTIA = 42 * L  # inverse inertia (world) as xx, xy, xz, yy, yz, zz
INERTIA = 48 * L  # inertia (world), likewise
MOMENTS = 54 * L  # principal moments
MORE = 57 * L  # another share of the loads
TILE_ROWS = 65

FELL, MOVED_ON, LOST = 1, 2, 4  # bits of an event

SURE = 1.0 - 1e-12  # what rounding leaves of a budget
SLOWEST = 1e-150  # angular speed below which the direction of a rotation means nothing [rad/s]


@inlined
def turned(qw, qx, qy, qz, ox, oy, oz, half):
    """Quaternion after turning with angular velocity o (world) for twice `half` seconds, normalised."""
    a = qw - half * (ox * qx + oy * qy + oz * qz)
    b = qx + half * (ox * qw + oy * qz - oz * qy)
    c = qy + half * (oy * qw + oz * qx - ox * qz)
    d = qz + half * (oz * qw + ox * qy - oy * qx)
    inv = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    return a * inv, b * inv, c * inv, d * inv


@inlined
def rotated_diagonal(m, at, c, d, diagonal):
    """R diag(a1, a2, a3) R' of each lane's body as rows xx, xy, xz, yy, yz, zz; R of its quaternion."""
    for k in range(L):
        qw, qx, qy, qz = (
            c[QUATERNION + k],
            c[QUATERNION + L + k],
            c[QUATERNION + 2 * L + k],
            c[QUATERNION + 3 * L + k],
        )
        a1, a2, a3 = d[diagonal + k], d[diagonal + L + k], d[diagonal + 2 * L + k]
        xx = 1.0 - 2.0 * (qy * qy + qz * qz)
        xy = 2.0 * (qx * qy - qw * qz)
        xz = 2.0 * (qx * qz + qw * qy)
        yx = 2.0 * (qx * qy + qw * qz)
        yy = 1.0 - 2.0 * (qx * qx + qz * qz)
        yz = 2.0 * (qy * qz - qw * qx)
        zx = 2.0 * (qx * qz - qw * qy)
        zy = 2.0 * (qy * qz + qw * qx)
        zz = 1.0 - 2.0 * (qx * qx + qy * qy)
        m[at + k] = a1 * xx * xx + a2 * xy * xy + a3 * xz * xz
        m[at + L + k] = a1 * xx * yx + a2 * xy * yy + a3 * xz * yz
        m[at + 2 * L + k] = a1 * xx * zx + a2 * xy * zy + a3 * xz * zz
        m[at + 3 * L + k] = a1 * yx * yx + a2 * yy * yy + a3 * yz * yz
        m[at + 4 * L + k] = a1 * yx * zx + a2 * yy * zy + a3 * yz * zz
        m[at + 5 * L + k] = a1 * zx * zx + a2 * zy * zy + a3 * zz * zz


@inlined
def inverse_inertia_times(m, k, x, y, z):
    """Inverse inertia of lane k's body (world) times a vector."""
    xx, xy, xz = m[INVERSE_INERTIA + k], m[INVERSE_INERTIA + L + k], m[INVERSE_INERTIA + 2 * L + k]
    yy, yz, zz = (
        m[INVERSE_INERTIA + 3 * L + k],
        m[INVERSE_INERTIA + 4 * L + k],
        m[INVERSE_INERTIA + 5 * L + k],
    )
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@kernel
def move_lanes(m, gx, gy, gz, dt):
    """Move the centres of the bodies of a tile by one time step under their loads."""
    for k in range(L):
        inverse_mass = m[ROWS + st.INVERSE_MASS * L + k]
        there = 1.0 if inverse_mass > 0.0 else 0.0
        kick = dt * inverse_mass
        vx = m[ROWS + 3 * L + k] + kick * m[LOAD + k] + there * dt * gx
        vy = m[ROWS + 4 * L + k] + kick * m[LOAD + L + k] + there * dt * gy
        vz = m[ROWS + 5 * L + k] + kick * m[LOAD + 2 * L + k] + there * dt * gz
        m[ROWS + 3 * L + k] = vx
        m[ROWS + 4 * L + k] = vy
        m[ROWS + 5 * L + k] = vz
        m[BEFORE + k] = m[ROWS + 2 * L + k]
        m[ROWS + k] += dt * vx
        m[ROWS + L + k] += dt * vy
        m[ROWS + 2 * L + k] += dt * vz
        square = vx * vx + vy * vy + vz * vz
        m[PATH + k] = dt * math.sqrt(square)


@kernel
def might_turn(m, dt):
    """How many bodies of a tile that rests might begin to turn.

    A body stands still for sure when its rolling budget B outweighs its angular momentum l: it stops where
    B o'Jo >= |o|^3 with o = J l (see `resist_lanes`), and |o|^3 <= |l| o'Jo by Hoelder's inequality.
    """
    n = 0
    for k in range(L):
        lx, ly, lz = dt * m[LOAD + 3 * L + k], dt * m[LOAD + 4 * L + k], dt * m[LOAD + 5 * L + k]
        budget = SURE * dt * m[LOAD + st.ROLL * L + k]
        n += 1 if budget * budget < lx * lx + ly * ly + lz * lz else 0
    return n


@kernel
def all_stay(m, c, dt, undecided, tile):
    """Whether no body of a tile that rests begins to turn: the condition of `resist_lanes`, in each body's frame.

    The simple condition of `might_turn` leaves some bodies undecided. Their bits are set in `undecided`, for
    `fetch_next`: the next step will most likely leave the same ones.
    """
    asked = 0
    for k in range(L):
        lx, ly, lz = dt * m[LOAD + 3 * L + k], dt * m[LOAD + 4 * L + k], dt * m[LOAD + 5 * L + k]
        budget = SURE * dt * m[LOAD + st.ROLL * L + k]
        if budget * budget >= lx * lx + ly * ly + lz * lz:
            continue
        asked |= 1 << k
        qw, qx, qy, qz = (
            c[QUATERNION + k],
            c[QUATERNION + L + k],
            c[QUATERNION + 2 * L + k],
            c[QUATERNION + 3 * L + k],
        )
        # twice the vector product with the quaternion's vector
        tx, ty, tz = 2.0 * (ly * qz - lz * qy), 2.0 * (lz * qx - lx * qz), 2.0 * (lx * qy - ly * qx)
        i1, i2, i3 = c[INVERSE_MOMENTS + k], c[INVERSE_MOMENTS + L + k], c[INVERSE_MOMENTS + 2 * L + k]
        ox = i1 * (lx + qw * tx + ty * qz - tz * qy)
        oy = i2 * (ly + qw * ty + tz * qx - tx * qz)
        oz = i3 * (lz + qw * tz + tx * qy - ty * qx)
        square = ox * ox + oy * oy + oz * oz
        share = budget / max(math.sqrt(square), SLOWEST)
        if share * (i1 * ox * ox + i2 * oy * oy + i3 * oz * oz) < square:
            return False
    undecided[tile] = asked
    return True


@kernel
def twist_lanes(m, c, dt):
    """Give each lane's body the angular momentum of its torque; returns how many might turn all the same."""
    n = 0
    for k in range(L):
        lx = c[ANGULAR_MOMENTUM + k] + dt * m[LOAD + 3 * L + k]
        ly = c[ANGULAR_MOMENTUM + L + k] + dt * m[LOAD + 4 * L + k]
        lz = c[ANGULAR_MOMENTUM + 2 * L + k] + dt * m[LOAD + 5 * L + k]
        c[ANGULAR_MOMENTUM + k] = lx
        c[ANGULAR_MOMENTUM + L + k] = ly
        c[ANGULAR_MOMENTUM + 2 * L + k] = lz
        budget = SURE * dt * m[LOAD + st.ROLL * L + k]
        n += 1 if budget * budget < lx * lx + ly * ly + lz * lz else 0
    return n


@kernel
def stop_lanes(m, c):
    """End the rotation of all lanes."""
    for k in range(3 * L):
        c[ANGULAR_MOMENTUM + k] = 0.0
        m[OMEGA + k] = 0.0


@kernel
def resist_lanes(m, c, dt):
    """Rolling resistance; returns how many lanes turn.

    It acts as a budget: the sum of mu_r F_n R over a body's contacts opposes the rotation that all other torques
    leave; it can stop it but never reverse it, so a settled pile is at rest.
    """
    n = 0
    for k in range(L):
        lx, ly, lz = c[ANGULAR_MOMENTUM + k], c[ANGULAR_MOMENTUM + L + k], c[ANGULAR_MOMENTUM + 2 * L + k]
        ox, oy, oz = inverse_inertia_times(m, k, lx, ly, lz)
        speed = math.sqrt(ox * ox + oy * oy + oz * oz)
        budget = dt * m[LOAD + st.ROLL * L + k] / max(speed, SLOWEST)
        bx, by, bz = budget * ox, budget * oy, budget * oz
        rx, ry, rz = inverse_inertia_times(m, k, bx, by, bz)
        turns = ox * rx + oy * ry + oz * rz < speed * speed
        n += 1 if turns else 0
        c[ANGULAR_MOMENTUM + k] = lx - bx if turns else 0.0
        c[ANGULAR_MOMENTUM + L + k] = ly - by if turns else 0.0
        c[ANGULAR_MOMENTUM + 2 * L + k] = lz - bz if turns else 0.0
        m[OMEGA + k] = ox - rx if turns else 0.0
        m[OMEGA + L + k] = oy - ry if turns else 0.0
        m[OMEGA + 2 * L + k] = oz - rz if turns else 0.0
    return n


@kernel
def resist_in_frame(m, c, dt, fx, fy, fz):
    """Rolling resistance against the rotation relative to a frame that turns with (fx, fy, fz); see `resist_lanes`.

    A body whose budget outweighs that rotation turns with the frame.
    """
    for k in range(L):
        lx, ly, lz = c[ANGULAR_MOMENTUM + k], c[ANGULAR_MOMENTUM + L + k], c[ANGULAR_MOMENTUM + 2 * L + k]
        ox, oy, oz = inverse_inertia_times(m, k, lx, ly, lz)
        dx, dy, dz = ox - fx, oy - fy, oz - fz
        speed = math.sqrt(dx * dx + dy * dy + dz * dz)
        budget = dt * m[LOAD + st.ROLL * L + k] / max(speed, SLOWEST)
        bx, by, bz = budget * dx, budget * dy, budget * dz
        rx, ry, rz = inverse_inertia_times(m, k, bx, by, bz)
        turns = dx * rx + dy * ry + dz * rz < speed * speed
        xx, xy, xz = m[INERTIA + k], m[INERTIA + L + k], m[INERTIA + 2 * L + k]
        yy, yz, zz = m[INERTIA + 3 * L + k], m[INERTIA + 4 * L + k], m[INERTIA + 5 * L + k]
        c[ANGULAR_MOMENTUM + k] = lx - bx if turns else xx * fx + xy * fy + xz * fz
        c[ANGULAR_MOMENTUM + L + k] = ly - by if turns else xy * fx + yy * fy + yz * fz
        c[ANGULAR_MOMENTUM + 2 * L + k] = lz - bz if turns else xz * fx + yz * fy + zz * fz
        m[OMEGA + k] = ox - rx if turns else fx
        m[OMEGA + L + k] = oy - ry if turns else fy
        m[OMEGA + 2 * L + k] = oz - rz if turns else fz


@kernel
def moments(m, c):
    """Inertia (world) of the bodies of a tile as they are turned now."""
    for k in range(3 * L):
        m[MOMENTS + k] = 1.0 / max(c[INVERSE_MOMENTS + k], SLOWEST)
    rotated_diagonal(m, INERTIA, c, m, MOMENTS)


@kernel
def turn_lanes(m, c, dt):
    """Turn each lane's body with the angular velocity at the middle of the step.

    omega = J l with J the inverse inertia; as l stays, omega changes by -J (omega x l) a second.
    """
    for k in range(L):
        lx, ly, lz = c[ANGULAR_MOMENTUM + k], c[ANGULAR_MOMENTUM + L + k], c[ANGULAR_MOMENTUM + 2 * L + k]
        ox, oy, oz = (
            m[OMEGA + k],
            m[OMEGA + L + k],
            m[OMEGA + 2 * L + k],
        )
        rx, ry, rz = inverse_inertia_times(m, k, oy * lz - oz * ly, oz * lx - ox * lz, ox * ly - oy * lx)
        ox -= 0.5 * dt * rx
        oy -= 0.5 * dt * ry
        oz -= 0.5 * dt * rz
        m[OMEGA + k] = ox
        m[OMEGA + L + k] = oy
        m[OMEGA + 2 * L + k] = oz
        square = ox * ox + oy * oy + oz * oz
        m[PATH + k] += dt * c[st.RADIUS + k] * math.sqrt(square)
        qw, qx, qy, qz = (
            c[QUATERNION + k],
            c[QUATERNION + L + k],
            c[QUATERNION + 2 * L + k],
            c[QUATERNION + 3 * L + k],
        )
        hw, hx, hy, hz = turned(qw, qx, qy, qz, ox, oy, oz, 0.5 * dt)
        # a body that does not turn keeps its quaternion to the bit
        turns = square > 0.0
        c[QUATERNION + k] = hw if turns else qw
        c[QUATERNION + L + k] = hx if turns else qx
        c[QUATERNION + 2 * L + k] = hy if turns else qy
        c[QUATERNION + 3 * L + k] = hz if turns else qz


@kernel
def inertia_lanes(m, c):
    """The inverse inertia of the bodies of a tile as they are turned now."""
    rotated_diagonal(m, INVERSE_INERTIA, c, c, INVERSE_MOMENTS)


@kernel
def shape_lanes(m, c, parts):
    """The shapes of the bodies of a tile as they are turned now; clumps (no parts) have their quaternions there."""
    if parts == 0:
        for k in range(4 * L):
            m[ROWS + SHAPE * L + k] = c[QUATERNION + k]
        return
    rotated_diagonal(m, ROWS + SHAPE * L, c, c, SQUARES)
    if parts > 1:
        rotated_diagonal(m, ROWS + (SHAPE + PART) * L, c, c, SQUARES + 3 * L)
    if parts > 2:
        rotated_diagonal(m, ROWS + (SHAPE + 2 * PART) * L, c, c, SQUARES + 6 * L)


@inlined
def rotate_lanes(m, c, dt, parts, rests, undecided, tile, fx, fy, fz):
    """Turn the bodies of a tile by one time step, what stands still at little cost; returns whether any turns.

    rests: whether none turned in the last step; undecided: see `all_stay`. (fx, fy, fz): angular velocity of the frame
    against which rolling is resisted.
    """
    framed = fx != 0.0 or fy != 0.0 or fz != 0.0
    if rests and not framed and (might_turn(m, dt) == 0 or all_stay(m, c, dt, undecided, tile)):
        return False
    twisted = twist_lanes(m, c, dt)
    if framed:
        inertia_lanes(m, c)
        moments(m, c)
        resist_in_frame(m, c, dt, fx, fy, fz)
        turn_lanes(m, c, dt)
        shape_lanes(m, c, parts)
        return True
    if twisted == 0:
        stop_lanes(m, c)
        return False
    inertia_lanes(m, c)
    if resist_lanes(m, c, dt) == 0:
        return False
    turn_lanes(m, c, dt)
    shape_lanes(m, c, parts)
    return True


@kernel
def noteworthy(m, c, displacement, base, exit_height, floor):
    """Add to the displacements of a tile's bodies.

    Returns how many of them need new neighbours, fell through the exit or went below the floor.
    """
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
    """Longest path of a tile's bodies in this step; the paths are used up."""
    half = L // 2
    while half > 0:
        for k in range(half):
            m[PATH + k] = max(m[PATH + k], m[PATH + half + k])
        half //= 2
    return m[PATH]


@inlined
def event_of(bodies, physics, m, c, lane, i):
    """What happened to a body: fell through the exit, needs new neighbours, went below the floor."""
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
    """Deal with what happened to n bodies listed in bodies.events from place `begin` on."""
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
    """Add up the shares of a tile's loads, and clear them; what no contact has touched is zero and not looked at."""
    base = tile * L
    for k in range(st.LOAD_COLUMNS * L):
        m[LOAD + k] = 0.0
    for share in range(bodies.load.shape[0]):
        if bodies.touched[share, tile]:
            bodies.touched[share, tile] = 0
            load = bodies.load[share]
            for k in range(0, L, WIDTH):
                rows_to_lanes(load, 0, bodies.every, base + k, m, MORE + k, L)
            for k in range(st.LOAD_COLUMNS * L):
                m[LOAD + k] += m[MORE + k]
            load[base : base + L] = 0.0


@inlined
def take_only_load(bodies, tile, m):
    """Take a tile's loads where there is one share of them, and clear them."""
    base = tile * L
    load = bodies.load[0]
    for k in range(0, L, WIDTH):
        rows_to_lanes(load, 0, bodies.every, base + k, m, LOAD + k, L)
    load[base : base + L] = 0.0


@inlined
def fetch_next(bodies, tile):
    """Ask for the loads, rows and motion of the next tile but one, which in a large simulation are far from hand."""
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
    undecided = 0 if turning else np.int64(bodies.undecided[following])
    lane = 0
    while undecided > 0:
        if undecided & 1:
            for row in range(4):
                prefetch(bodies.motion, following, QUATERNION + row * L + lane)
            for row in range(3):
                prefetch(bodies.motion, following, INVERSE_MOMENTS + row * L + lane)
        undecided >>= 1
        lane += 1


@kernel
def integrate(bodies, counts, physics, m, begin, end):
    """Advance bodies begin (a whole tile's first) to end by one time step and clear their loads.

    m: scratch tile of TILE_ROWS x LANES. Bodies to which something happened are listed in bodies.events from place
    `begin` on; returns how many. Where loads have several shares the longest path of each tile goes to bodies.longest
    and shortens bodies.wall_margin.
    """
    dt = physics.dt
    gx, gy, gz = physics.gravity[0], physics.gravity[1], physics.gravity[2]
    fx, fy, fz = physics.rolling_frame[0], physics.rolling_frame[1], physics.rolling_frame[2]
    columns = bodies.rows.shape[1]
    n = min(counts[st.N_BODIES], end)
    shares = bodies.load.shape[0]
    found = 0
    for base in range(begin, n, L):
        tile = base // L
        c = bodies.motion[tile]
        # of a tile in which nothing turned, only the first eight columns are read and written
        read = WIDTH if bodies.resting[tile] else columns
        for k in range(0, L, WIDTH):
            for column in range(0, read, WIDTH):
                rows_to_lanes(bodies.rows, column, bodies.every, base + k, m, ROWS + column * L + k, L)
        if shares > 1:
            fetch_next(bodies, tile)
            take_loads(bodies, tile, m)
        else:
            take_only_load(bodies, tile, m)
        move_lanes(m, gx, gy, gz, dt)
        turns = rotate_lanes(
            m, c, dt, physics.parts, bodies.resting[tile] == 1, bodies.undecided, tile, fx, fy, fz
        )
        write = columns if turns else read
        bodies.resting[tile] = 0 if turns else 1
        for k in range(0, L, WIDTH):
            for column in range(0, write, WIDTH):
                lanes_to_rows(bodies.rows, column, bodies.every, base + k, m, ROWS + column * L + k, L)
        if noteworthy(m, c, bodies.displacement, base, physics.exit_height, physics.floor_height) > 0:
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
    """Write the shape of body i as it is turned now, without moving anything."""
    base = i // L * L
    shape_lanes(m, bodies.motion[i // L], parts)
    for c in range(SHAPE, SHAPE + max(PART * parts, 4)):
        bodies.rows[i, c] = m[ROWS + c * L + i - base]


@kernel
def take_away(bodies, i):
    """Stop a body that is gone for good: without mass nothing moves it."""
    for c in range(3):
        bodies.rows[i, st.VELOCITY + c] = 0.0
        bodies.rows[i, st.ANGULAR_VELOCITY + c] = 0.0
        bodies.motion[i // L, ANGULAR_MOMENTUM + c * L + i % L] = 0.0
    bodies.rows[i, st.INVERSE_MASS] = 0.0
    bodies.wall_check[i] = math.inf
