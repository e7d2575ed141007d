"""Motion of the bodies: semi-implicit Euler, world-frame angular momentum, midpoint rotation.

Angular momentum is the state; the angular velocity follows from it at the middle of the step, so free rotation keeps
the momentum to the bit and the energy to second order.
"""

import math

from . import state as st
from .geometry import to_body, to_world
from .jit import inlined, kernel
from .neighbours import mark_moved
from .simd import WIDTH, lanes_to_rows, rows_to_lanes, rsqrt
from .state import LANES, MOBILITY, PART, QUATERNION, REFERENCE, SHAPE, SPIN, SQUARES

L = LANES  # short, for the index arithmetic below

# Rows of the scratch tile: the columns of `rows` and of `load` (see `state`), then what the step finds.
ROWS = 0
LOAD = 32 * L
PATH = 40 * L  # how far the farthest point of the body may have moved
AWAY2 = 41 * L  # squared distance from the place where the body was put into its cell
BEFORE = 42 * L  # height before the step
TILE_ROWS = 43


@inlined
def angular_velocity(qw, qx, qy, qz, i1, i2, i3, lx, ly, lz):
    """Angular velocity (world) of a body with angular momentum l (world); i1, i2, i3: 1 / principal moments."""
    b1, b2, b3 = to_body(qw, qx, qy, qz, lx, ly, lz)
    return to_world(qw, qx, qy, qz, b1 * i1, b2 * i2, b3 * i3)


@inlined
def turned(qw, qx, qy, qz, ox, oy, oz, half):
    """Quaternion after turning with angular velocity o (world) for twice `half` seconds, normalised."""
    a = qw - half * (ox * qx + oy * qy + oz * qz)
    b = qx + half * (ox * qw + oy * qz - oz * qy)
    c = qy + half * (oy * qw + oz * qx - ox * qz)
    d = qz + half * (oz * qw + ox * qy - oy * qx)
    inv = rsqrt(a * a + b * b + c * c + d * d)
    return a * inv, b * inv, c * inv, d * inv


@kernel
def move_lanes(m, c, gx, gy, gz, dt):
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
        x = m[ROWS + k] + dt * vx
        y = m[ROWS + L + k] + dt * vy
        z = m[ROWS + 2 * L + k]
        m[BEFORE + k] = z
        z += dt * vz
        m[ROWS + k] = x
        m[ROWS + L + k] = y
        m[ROWS + 2 * L + k] = z
        x -= c[REFERENCE + k]
        y -= c[REFERENCE + L + k]
        z -= c[REFERENCE + 2 * L + k]
        m[AWAY2 + k] = x * x + y * y + z * z
        square = vx * vx + vy * vy + vz * vz
        m[PATH + k] = dt * square * rsqrt(square)


@kernel
def turn_lanes(m, c, dt):
    """Turn the bodies of a tile by one time step under their torques.

    Rolling resistance acts as a budget: the sum of mu_r F_n R over a body's contacts opposes the rotation that all
    other torques leave; it can stop it but never reverse it, so a settled pile is at rest.
    """
    for k in range(L):
        lx = c[SPIN + k] + dt * m[LOAD + 3 * L + k]
        ly = c[SPIN + L + k] + dt * m[LOAD + 4 * L + k]
        lz = c[SPIN + 2 * L + k] + dt * m[LOAD + 5 * L + k]
        i1, i2, i3 = c[MOBILITY + k], c[MOBILITY + L + k], c[MOBILITY + 2 * L + k]
        qw, qx, qy, qz = c[QUATERNION + k], c[QUATERNION + L + k], c[QUATERNION + 2 * L + k], c[QUATERNION + 3 * L + k]
        ox, oy, oz = angular_velocity(qw, qx, qy, qz, i1, i2, i3, lx, ly, lz)
        square = ox * ox + oy * oy + oz * oz
        inv = rsqrt(square)
        speed = square * inv
        ex, ey, ez = ox * inv, oy * inv, oz * inv
        budget = dt * m[LOAD + st.ROLL * L + k]
        bx, by, bz = budget * ex, budget * ey, budget * ez
        rx, ry, rz = angular_velocity(qw, qx, qy, qz, i1, i2, i3, bx, by, bz)
        turns = ex * rx + ey * ry + ez * rz < speed
        lx = lx - bx if turns else 0.0
        ly = ly - by if turns else 0.0
        lz = lz - bz if turns else 0.0
        c[SPIN + k] = lx
        c[SPIN + L + k] = ly
        c[SPIN + 2 * L + k] = lz
        hw, hx, hy, hz = turned(qw, qx, qy, qz, ox - rx, oy - ry, oz - rz, 0.25 * dt)
        ox, oy, oz = angular_velocity(hw, hx, hy, hz, i1, i2, i3, lx, ly, lz)
        hw, hx, hy, hz = turned(qw, qx, qy, qz, ox, oy, oz, 0.5 * dt)
        # a body that does not turn keeps its quaternion to the bit
        c[QUATERNION + k] = hw if turns else qw
        c[QUATERNION + L + k] = hx if turns else qx
        c[QUATERNION + 2 * L + k] = hy if turns else qy
        c[QUATERNION + 3 * L + k] = hz if turns else qz
        ox = ox if turns else 0.0
        oy = oy if turns else 0.0
        oz = oz if turns else 0.0
        m[ROWS + 6 * L + k] = ox
        m[ROWS + 7 * L + k] = oy
        m[ROWS + 8 * L + k] = oz
        square = ox * ox + oy * oy + oz * oz
        m[PATH + k] += dt * c[st.RADIUS + k] * square * rsqrt(square)


@inlined
def shape_part(m, c, squares, shape):
    """R diag(a2, b2, c2) R' of one part of each lane's body."""
    for k in range(L):
        qw, qx, qy, qz = c[QUATERNION + k], c[QUATERNION + L + k], c[QUATERNION + 2 * L + k], c[QUATERNION + 3 * L + k]
        a, b, d = c[squares + k], c[squares + L + k], c[squares + 2 * L + k]
        xx = 1.0 - 2.0 * (qy * qy + qz * qz)
        xy = 2.0 * (qx * qy - qw * qz)
        xz = 2.0 * (qx * qz + qw * qy)
        yx = 2.0 * (qx * qy + qw * qz)
        yy = 1.0 - 2.0 * (qx * qx + qz * qz)
        yz = 2.0 * (qy * qz - qw * qx)
        zx = 2.0 * (qx * qz - qw * qy)
        zy = 2.0 * (qy * qz + qw * qx)
        zz = 1.0 - 2.0 * (qx * qx + qy * qy)
        m[shape + k] = a * xx * xx + b * xy * xy + d * xz * xz
        m[shape + L + k] = a * xx * yx + b * xy * yy + d * xz * yz
        m[shape + 2 * L + k] = a * xx * zx + b * xy * zy + d * xz * zz
        m[shape + 3 * L + k] = a * yx * yx + b * yy * yy + d * yz * yz
        m[shape + 4 * L + k] = a * yx * zx + b * yy * zy + d * yz * zz
        m[shape + 5 * L + k] = a * zx * zx + b * zy * zy + d * zz * zz


@kernel
def shape_lanes(m, c, parts):
    """The shapes of the bodies of a tile as they are turned now."""
    shape_part(m, c, SQUARES, ROWS + SHAPE * L)
    if parts > 1:
        shape_part(m, c, SQUARES + 3 * L, ROWS + (SHAPE + PART) * L)
    if parts > 2:
        shape_part(m, c, SQUARES + 6 * L, ROWS + (SHAPE + 2 * PART) * L)


@kernel
def noteworthy(m, limit2, exit_height, floor):
    """How many lanes left their cell, fell through the exit or below the floor."""
    n = 0
    for k in range(L):
        z = m[ROWS + 2 * L + k]
        fell = (m[BEFORE + k] >= exit_height) & (z < exit_height)
        there = m[ROWS + st.INVERSE_MASS * L + k] > 0.0
        n += 1 if there & ((m[AWAY2 + k] > limit2) | fell | (z < floor)) else 0
    return n


@inlined
def note(bodies, grid, counts, physics, m, lane, i, limit2, time):
    """Deal with a body that left its cell, fell through the exit or below the floor."""
    z = m[ROWS + 2 * L + lane]
    if bodies.presence[i] != st.PRESENT:
        return
    if m[BEFORE + lane] >= physics.exit_height and z < physics.exit_height:
        bodies.exit_time[i] = time
    if m[AWAY2 + lane] > limit2:
        mark_moved(grid, counts, i)
    if z < physics.floor_height:
        bodies.presence[i] = st.GONE
        counts[st.N_GONE] += 1
        mark_moved(grid, counts, i)


@kernel
def integrate(bodies, grid, counts, physics, time, m):
    """Advance every body by one time step and clear its load; m: scratch tile of TILE_ROWS x LANES."""
    dt = physics.dt
    gx, gy, gz = physics.gravity[0], physics.gravity[1], physics.gravity[2]
    limit2 = (0.5 * grid.lengths[2]) ** 2
    columns = bodies.rows.shape[1]
    n = counts[st.N_BODIES]
    for base in range(0, n, L):
        c = bodies.motion[base // L]
        for k in range(0, L, WIDTH):
            for column in range(0, columns, WIDTH):
                rows_to_lanes(bodies.rows, column, bodies.every, base + k, m, ROWS + column * L + k, L)
            rows_to_lanes(bodies.load, 0, bodies.every, base + k, m, LOAD + k, L)
        bodies.load[base : base + L] = 0.0
        move_lanes(m, c, gx, gy, gz, dt)
        turn_lanes(m, c, dt)
        shape_lanes(m, c, physics.parts)
        for k in range(0, L, WIDTH):
            for column in range(0, columns, WIDTH):
                lanes_to_rows(bodies.rows, column, bodies.every, base + k, m, ROWS + column * L + k, L)
        for k in range(L):
            bodies.odometer[base + k] += m[PATH + k]
        if noteworthy(m, limit2, physics.exit_height, physics.floor_height) > 0:
            for lane in range(min(L, n - base)):
                note(bodies, grid, counts, physics, m, lane, base + lane, limit2, time)


@kernel
def place_shape(bodies, i, parts, m):
    """Write the shape of body i as it is turned now, without moving anything."""
    base = i // L * L
    shape_lanes(m, bodies.motion[i // L], parts)
    for c in range(SHAPE, SHAPE + PART * parts):
        bodies.rows[i, c] = m[ROWS + c * L + i - base]


@kernel
def take_away(bodies, i):
    """Stop a body that is gone for good: without mass nothing moves it."""
    for c in range(3):
        bodies.rows[i, st.VELOCITY + c] = 0.0
        bodies.rows[i, st.TURNING + c] = 0.0
        bodies.load[i, c] = 0.0
        bodies.load[i, 3 + c] = 0.0
        bodies.motion[i // L, SPIN + c * L + i % L] = 0.0
    bodies.rows[i, st.INVERSE_MASS] = 0.0
    bodies.load[i, st.ROLL] = 0.0
    bodies.alarm[i] = math.inf
