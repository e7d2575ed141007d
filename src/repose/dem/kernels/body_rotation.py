"""Rotation of the bodies of a tile: world-frame angular momentum, rolling resistance, midpoint rotation.

Angular momentum is the state, and the angular velocity at the middle of the step follows from it; so free rotation
keeps the momentum to the bit and the energy to second order.
"""

import math

from . import state as st
from .body_tile import INVERSE_INERTIA, LOAD, OMEGA, PATH, ROWS, L
from .geometry import matrix_times
from .jit import inlined, kernel
from .rows import write_vector
from .state import (
    ANGULAR_MOMENTUM,
    INVERSE_MOMENTS,
    PART,
    QUATERNION,
    SHAPE,
    SQUARES,
    alive,
)

SURE = 1.0 - 1e-12  # share of a budget that rounding leaves
SLOWEST = 1e-150  # angular speed below which the direction of a rotation means nothing [rad/s]
# With these steps the size of a resistance is 4e-8 off where the moments differ sixfold, 4e-4 for a factor of thirty.
NEWTON_STEPS = 3


@inlined
def quaternion_of(c, k):
    """Return the quaternion of lane k's body."""
    return (
        c[QUATERNION + k],
        c[QUATERNION + L + k],
        c[QUATERNION + 2 * L + k],
        c[QUATERNION + 3 * L + k],
    )


@inlined
def rotated_quaternion(qw, qx, qy, qz, ox, oy, oz, half):
    """Quaternion after a rotation with angular velocity o (world) for twice `half` seconds, normalised."""
    a = qw - half * (ox * qx + oy * qy + oz * qz)
    b = qx + half * (ox * qw + oy * qz - oz * qy)
    c = qy + half * (oy * qw + oz * qx - ox * qz)
    d = qz + half * (oz * qw + ox * qy - oy * qx)
    inv = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    return a * inv, b * inv, c * inv, d * inv


@inlined
def turn_quaternion(c, k, ox, oy, oz, half, turns):
    """Turn lane k's body by `rotated_quaternion`; one that does not turn keeps its quaternion to the bit."""
    qw, qx, qy, qz = quaternion_of(c, k)
    hw, hx, hy, hz = rotated_quaternion(qw, qx, qy, qz, ox, oy, oz, half)
    c[QUATERNION + k] = hw if turns else qw
    c[QUATERNION + L + k] = hx if turns else qx
    c[QUATERNION + 2 * L + k] = hy if turns else qy
    c[QUATERNION + 3 * L + k] = hz if turns else qz


@inlined
def rotated_diagonal(m, at, c, d, diagonal):
    """R diag(a1, a2, a3) R' of each lane's body as rows xx, xy, xz, yy, yz, zz; R of its quaternion."""
    for k in range(L):
        qw, qx, qy, qz = quaternion_of(c, k)
        a1, a2, a3 = d[diagonal + k], d[diagonal + L + k], d[diagonal + 2 * L + k]
        xx, xy, xz = (
            1.0 - 2.0 * (qy * qy + qz * qz),
            2.0 * (qx * qy - qw * qz),
            2.0 * (qx * qz + qw * qy),
        )
        yx, yy, yz = (
            2.0 * (qx * qy + qw * qz),
            1.0 - 2.0 * (qx * qx + qz * qz),
            2.0 * (qy * qz - qw * qx),
        )
        zx, zy, zz = (
            2.0 * (qx * qz - qw * qy),
            2.0 * (qy * qz + qw * qx),
            1.0 - 2.0 * (qx * qx + qy * qy),
        )
        m[at + k] = a1 * xx * xx + a2 * xy * xy + a3 * xz * xz
        m[at + L + k] = a1 * xx * yx + a2 * xy * yy + a3 * xz * yz
        m[at + 2 * L + k] = a1 * xx * zx + a2 * xy * zy + a3 * xz * zz
        m[at + 3 * L + k] = a1 * yx * yx + a2 * yy * yy + a3 * yz * yz
        m[at + 4 * L + k] = a1 * yx * zx + a2 * yy * zy + a3 * yz * zz
        m[at + 5 * L + k] = a1 * zx * zx + a2 * zy * zy + a3 * zz * zz


@inlined
def inverse_inertia_times(m, k, x, y, z):
    """Inverse inertia of lane k's body (world) times a vector."""
    xx, xy, xz = (
        m[INVERSE_INERTIA + k],
        m[INVERSE_INERTIA + L + k],
        m[INVERSE_INERTIA + 2 * L + k],
    )
    yy, yz, zz = (
        m[INVERSE_INERTIA + 3 * L + k],
        m[INVERSE_INERTIA + 4 * L + k],
        m[INVERSE_INERTIA + 5 * L + k],
    )
    return matrix_times(xx, xy, xz, yy, yz, zz, x, y, z)


@inlined
def into_body(c, k, x, y, z):
    """Return a vector of the world in the axes of lane k's body."""
    qw, qx, qy, qz = quaternion_of(c, k)
    # twice the vector product with the quaternion's vector
    tx, ty, tz = (
        2.0 * (y * qz - z * qy),
        2.0 * (z * qx - x * qz),
        2.0 * (x * qy - y * qx),
    )
    return (
        x + qw * tx + ty * qz - tz * qy,
        y + qw * ty + tz * qx - tx * qz,
        z + qw * tz + tx * qy - ty * qx,
    )


@inlined
def into_world(c, k, x, y, z):
    """Return a vector of lane k's body in the axes of the world."""
    qw, qx, qy, qz = quaternion_of(c, k)
    tx, ty, tz = (
        2.0 * (qy * z - qz * y),
        2.0 * (qz * x - qx * z),
        2.0 * (qx * y - qy * x),
    )
    return (
        x + qw * tx + qy * tz - qz * ty,
        y + qw * ty + qz * tx - qx * tz,
        z + qw * tz + qx * ty - qy * tx,
    )


@kernel
def might_turn(m, dt):
    """Count the bodies of a tile at rest that may begin to turn: the torque exceeds the rolling budget."""
    n = 0
    for k in range(L):
        lx, ly, lz = (
            dt * m[LOAD + 3 * L + k],
            dt * m[LOAD + 4 * L + k],
            dt * m[LOAD + 5 * L + k],
        )
        budget = SURE * dt * m[LOAD + st.ROLL * L + k]
        n += 1 if budget * budget < lx * lx + ly * ly + lz * lz else 0
    return n


@kernel
def twist_lanes(m, c, dt):
    """Add the torque of each lane's body to its angular momentum; returns how many may still turn."""
    n = 0
    for k in range(L):
        lx = c[ANGULAR_MOMENTUM + k] + dt * m[LOAD + 3 * L + k]
        ly = c[ANGULAR_MOMENTUM + L + k] + dt * m[LOAD + 4 * L + k]
        lz = c[ANGULAR_MOMENTUM + 2 * L + k] + dt * m[LOAD + 5 * L + k]
        write_vector(c, ANGULAR_MOMENTUM, k, lx, ly, lz)
        budget = SURE * dt * m[LOAD + st.ROLL * L + k]
        n += 1 if budget * budget < lx * lx + ly * ly + lz * lz else 0
    return n


@kernel
def stop_lanes(m, c):
    """End the rotation of all lanes."""
    for k in range(3 * L):
        c[ANGULAR_MOMENTUM + k] = 0.0
        m[OMEGA + k] = 0.0


@inlined
def resistance(x, y, z, i1, i2, i3, size, budget):
    """Direction of the rolling resistance of a body that it does not stop, in the body's frame.

    (x, y, z), size: angular momentum without resistance, relative to the frame, and its size; i1, i2, i3: inverse
    moments. The remaining rotation has the returned direction n and the angular velocity s n with I s n = l - B n, so
    (s + B J) n = J l, J the inverse inertia. The speed s is the root of |n(s)| = 1. Newton's method on 1 / |n(s)|,
    which is concave, converges to it from below; the unit is the speed without resistance.
    """
    ox, oy, oz = i1 * x, i2 * y, i3 * z
    unit = 1.0 / max(math.sqrt(ox * ox + oy * oy + oz * oz), SLOWEST)
    ox, oy, oz = unit * ox, unit * oy, unit * oz
    b1, b2, b3 = unit * budget * i1, unit * budget * i2, unit * budget * i3
    # two bounds of the root from below: by the budget along the rotation and by the largest moment
    s = max(
        1.0 - (ox * ox * b1 + oy * oy * b2 + oz * oz * b3),
        unit * (size - budget) * min(i1, i2, i3),
    )
    s = max(s, 0.0)
    for _ in range(NEWTON_STEPS):
        d1, d2, d3 = s + b1, s + b2, s + b3
        # n is (ox / d1, oy / d2, oz / d3); all of it times the product of the three, to divide once
        c1, c2, c3 = d2 * d3, d3 * d1, d1 * d2
        g1, g2, g3 = ox * ox * c1 * c1, oy * oy * c2 * c2, oz * oz * c3 * c3
        g = g1 + g2 + g3
        s = max(s + g * (math.sqrt(g) - d1 * c1) / (g1 * c1 + g2 * c2 + g3 * c3), 0.0)
    d1, d2, d3 = s + b1, s + b2, s + b3
    product = 1.0 / (d1 * d2 * d3)
    return ox * product * d2 * d3, oy * product * d3 * d1, oz * product * d1 * d2


@kernel
def resist_lanes(m, c, dt):
    """Apply rolling resistance; return how many lanes turn.

    The budget B, the sum of mu_r F_n R over a body's contacts, acts against the rotation that remains after it:
    l' = l - B o' / |o'|, o' the angular velocity of l'. This has one solution. The body stands still where |l| <= B in
    any orientation, and its rotation is never reversed, so a settled pile is at rest.
    """
    n = 0
    for k in range(L):
        lx, ly, lz = (
            c[ANGULAR_MOMENTUM + k],
            c[ANGULAR_MOMENTUM + L + k],
            c[ANGULAR_MOMENTUM + 2 * L + k],
        )
        budget = dt * m[LOAD + st.ROLL * L + k]
        square = lx * lx + ly * ly + lz * lz
        i1, i2, i3 = (
            c[INVERSE_MOMENTS + k],
            c[INVERSE_MOMENTS + L + k],
            c[INVERSE_MOMENTS + 2 * L + k],
        )
        # the lane of an absent body may hold a torque and has no moments
        turns = (square > budget * budget) & (i1 > 0.0)
        n += 1 if turns else 0
        x, y, z = into_body(c, k, lx, ly, lz)
        x, y, z = resistance(x, y, z, i1, i2, i3, math.sqrt(square), budget)
        x, y, z = into_world(c, k, x, y, z)
        lx = lx - budget * x if turns else 0.0
        ly = ly - budget * y if turns else 0.0
        lz = lz - budget * z if turns else 0.0
        write_vector(c, ANGULAR_MOMENTUM, k, lx, ly, lz)
        ox, oy, oz = inverse_inertia_times(m, k, lx, ly, lz)
        write_vector(m, OMEGA, k, ox, oy, oz)
    return n


@kernel
def resist_in_frame(m, c, dt, fx, fy, fz):
    """Apply rolling resistance as in `resist_lanes`, but relative to a frame, with which a stopped body turns."""
    for k in range(L):
        lx, ly, lz = (
            c[ANGULAR_MOMENTUM + k],
            c[ANGULAR_MOMENTUM + L + k],
            c[ANGULAR_MOMENTUM + 2 * L + k],
        )
        budget = dt * m[LOAD + st.ROLL * L + k]
        i1, i2, i3 = (
            c[INVERSE_MOMENTS + k],
            c[INVERSE_MOMENTS + L + k],
            c[INVERSE_MOMENTS + 2 * L + k],
        )
        there = i1 > 0.0
        # angular momentum of a body that turns with the frame
        x, y, z = into_body(c, k, fx, fy, fz)
        x, y, z = (
            x / i1 if there else 0.0,
            y / i2 if there else 0.0,
            z / i3 if there else 0.0,
        )
        wx, wy, wz = into_world(c, k, x, y, z)
        x, y, z = into_body(c, k, lx - wx, ly - wy, lz - wz)
        square = x * x + y * y + z * z
        turns = (square > budget * budget) & there
        x, y, z = resistance(x, y, z, i1, i2, i3, math.sqrt(square), budget)
        x, y, z = into_world(c, k, x, y, z)
        lx = lx - budget * x if turns else wx
        ly = ly - budget * y if turns else wy
        lz = lz - budget * z if turns else wz
        write_vector(c, ANGULAR_MOMENTUM, k, lx, ly, lz)
        ox, oy, oz = inverse_inertia_times(m, k, lx, ly, lz)
        stays = there & (not turns)
        write_vector(
            m, OMEGA, k, fx if stays else ox, fy if stays else oy, fz if stays else oz
        )


@kernel
def advance_orientation(m, c, dt):
    """Turn each lane's body with the angular velocity at the middle of the step.

    omega = J l with J the inverse inertia; l is constant, so omega changes at the rate -J (omega x l).
    """
    for k in range(L):
        lx, ly, lz = (
            c[ANGULAR_MOMENTUM + k],
            c[ANGULAR_MOMENTUM + L + k],
            c[ANGULAR_MOMENTUM + 2 * L + k],
        )
        ox, oy, oz = (m[OMEGA + k], m[OMEGA + L + k], m[OMEGA + 2 * L + k])
        rx, ry, rz = inverse_inertia_times(
            m, k, oy * lz - oz * ly, oz * lx - ox * lz, ox * ly - oy * lx
        )
        ox, oy, oz = (
            alive(ox - 0.5 * dt * rx),
            alive(oy - 0.5 * dt * ry),
            alive(oz - 0.5 * dt * rz),
        )
        write_vector(c, ANGULAR_MOMENTUM, k, alive(lx), alive(ly), alive(lz))
        write_vector(m, OMEGA, k, ox, oy, oz)
        square = ox * ox + oy * oy + oz * oz
        m[PATH + k] += dt * c[st.RADIUS + k] * math.sqrt(square)
        turn_quaternion(c, k, ox, oy, oz, 0.5 * dt, square > 0.0)


@kernel
def inertia_lanes(m, c):
    """Compute the inverse inertia of the bodies of a tile in their present orientation."""
    rotated_diagonal(m, INVERSE_INERTIA, c, c, INVERSE_MOMENTS)


@kernel
def shape_lanes(m, c, parts):
    """Inverse inertia and shape of each body of a tile as it is oriented; the shape of a clump is its quaternion."""
    inertia_lanes(m, c)
    if parts == 0:
        for k in range(4 * L):
            m[ROWS + SHAPE * L + k] = c[QUATERNION + k]
        return
    rotated_diagonal(m, ROWS + SHAPE * L, c, c, SQUARES)
    if parts > 1:
        rotated_diagonal(m, ROWS + (SHAPE + PART) * L, c, c, SQUARES + 3 * L)
    if parts > 2:
        rotated_diagonal(m, ROWS + (SHAPE + 2 * PART) * L, c, c, SQUARES + 6 * L)


@kernel
def share_lanes(m, c, dt, parts):
    """Compute the share of its tangential dashpots that each body takes in the next step, see `laws.tangential`."""
    column = ROWS + st.share_column(parts) * L
    for k in range(L):
        fastest = max(
            c[INVERSE_MOMENTS + k],
            max(c[INVERSE_MOMENTS + L + k], c[INVERSE_MOMENTS + 2 * L + k]),
        )
        m[column + k] = 1.0 / max(1.0, dt * fastest * m[LOAD + st.DASHPOTS * L + k])


@inlined
def rotate_lanes(m, c, dt, parts, rests, fx, fy, fz):
    """Turn the bodies of a tile by one step, at little cost if none turned in the last; returns whether any turns."""
    framed = fx != 0.0 or fy != 0.0 or fz != 0.0
    if rests and not framed and might_turn(m, dt) == 0:
        return False
    twisted = twist_lanes(m, c, dt)
    if rests:  # the columns of bodies at rest were not read
        inertia_lanes(m, c)
    if framed:
        resist_in_frame(m, c, dt, fx, fy, fz)
    elif twisted == 0:
        stop_lanes(m, c)
        return False
    elif resist_lanes(m, c, dt) == 0:
        return False
    advance_orientation(m, c, dt)
    shape_lanes(m, c, parts)
    share_lanes(m, c, dt, parts)
    return True


@kernel
def turn_spheres(m, c, dt, fx, fy, fz):
    """Turn each lane's sphere against its rolling resistance, as `resist_in_frame`; returns how many turn.

    Momentum and angular velocity are parallel: the resistance shortens both, and the velocity is constant within the
    step. No path is added, since the surface of a turning sphere stays in its place.
    """
    n = 0
    for k in range(L):
        inverse = c[INVERSE_MOMENTS + k]
        there = inverse > 0.0
        moment = 1.0 / (inverse if there else 1.0)
        lx = c[ANGULAR_MOMENTUM + k] + dt * m[LOAD + 3 * L + k] - moment * fx
        ly = c[ANGULAR_MOMENTUM + L + k] + dt * m[LOAD + 4 * L + k] - moment * fy
        lz = c[ANGULAR_MOMENTUM + 2 * L + k] + dt * m[LOAD + 5 * L + k] - moment * fz
        budget = dt * m[LOAD + st.ROLL * L + k]
        size = math.sqrt(lx * lx + ly * ly + lz * lz)
        turns = there & (size > budget)
        left = 1.0 - budget / (size if turns else 1.0)
        left = left if turns else 0.0
        lx = alive(left * lx + moment * fx if there else 0.0)
        ly = alive(left * ly + moment * fy if there else 0.0)
        lz = alive(left * lz + moment * fz if there else 0.0)
        ox, oy, oz = alive(inverse * lx), alive(inverse * ly), alive(inverse * lz)
        write_vector(c, ANGULAR_MOMENTUM, k, lx, ly, lz)
        write_vector(m, OMEGA, k, ox, oy, oz)
        rotates = ox * ox + oy * oy + oz * oz > 0.0
        n += 1 if rotates else 0
        turn_quaternion(c, k, ox, oy, oz, 0.5 * dt, rotates)
        m[ROWS + st.SPHERE_RADIUS * L + k] = c[st.RADIUS + k]
    return n


@inlined
def rotate_spheres(m, c, dt, rests, fx, fy, fz):
    """`rotate_lanes` for a tile of spheres."""
    framed = fx != 0.0 or fy != 0.0 or fz != 0.0
    if rests and not framed and might_turn(m, dt) == 0:
        return False
    share_lanes(m, c, dt, st.SPHERES)
    return turn_spheres(m, c, dt, fx, fy, fz) > 0 or framed
