"""Rotation of the bodies of a tile: world-frame angular momentum, rolling resistance, midpoint rotation.

Angular momentum is the state; the angular velocity follows from it at the middle of the step, so free rotation keeps
the momentum to the bit and the energy to second order.
"""

import math

from . import state as st
from .body_tile import INERTIA, INVERSE_INERTIA, LOAD, MOMENTS, OMEGA, PATH, ROWS, L
from .jit import inlined, kernel
from .state import ANGULAR_MOMENTUM, INVERSE_MOMENTS, PART, QUATERNION, SHAPE, SQUARES

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
    """Give each lane's body the angular momentum of its torque; returns how many may still turn."""
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
