"""Rotation of the bodies of a tile: angular momentum, rolling resistance, orientation.

The state is the angular momentum in world axes; the angular velocity at the middle of
the step follows from it. So free rotation keeps the momentum to the bit, and the energy
to second order in the time step.

`m` is the scratch tile of the bodies (rows of `body_tile`), `c` their tile of
`Bodies.motion` (rows of `state`). Reads the torques and budgets in the rows LOAD of `m`.
Writes angular momentum and quaternion in `c`; angular velocity, inverse inertia, shape
and share of the dashpots in `m`; adds to the row PATH of `m`. Loops over the lanes have
no branches that depend on a lane, so that they become vector code.

Names: l angular momentum, o angular velocity, J inverse inertia, B budget: the angular
momentum that rolling resistance can take away in a step.
"""

import math

from . import state as st
from .body_tile import INVERSE_INERTIA, LOAD, OMEGA, PATH, ROWS, TORQUE
from .geometry import matrix_times
from .jit import inlined, kernel
from .rows import L, lane_matrix, lane_vector, write_vector
from .state import (
    ANGULAR_MOMENTUM,
    INVERSE_MOMENTS,
    PART,
    QUATERNION,
    SHAPE,
    SQUARES,
    alive,
)

CERTAIN = 1.0 - 1e-12  # share of a budget that rounding leaves
SLOWEST = 1e-150  # angular speed below which a rotation has no direction [rad/s]
# Newton steps for the direction of a resistance. Its size is then 4e-8 off where the
# moments of inertia differ sixfold, and 4e-4 for a factor of thirty.
NEWTON_STEPS = 3
# First rows of the scratch tile.
BUDGET = LOAD + st.ROLL * L  # per second: a torque
DASHPOTS = LOAD + st.DASHPOTS * L


@inlined
def quaternion_of(c, lane):
    """Return the quaternion (w, x, y, z) of a lane's body."""
    return (
        c[QUATERNION + lane],
        c[QUATERNION + L + lane],
        c[QUATERNION + 2 * L + lane],
        c[QUATERNION + 3 * L + lane],
    )


@inlined
def rotated_quaternion(qw, qx, qy, qz, ox, oy, oz, half):
    """Return a quaternion after a rotation with angular velocity o, normalised.

    `half` is half of the duration [s]; o is in world axes.
    """
    a = qw - half * (ox * qx + oy * qy + oz * qz)
    b = qx + half * (ox * qw + oy * qz - oz * qy)
    c = qy + half * (oy * qw + oz * qx - ox * qz)
    d = qz + half * (oz * qw + ox * qy - oy * qx)
    inv = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    return a * inv, b * inv, c * inv, d * inv


@inlined
def turn_quaternion(c, lane, ox, oy, oz, half, is_turning):
    """Turn a lane's body by `rotated_quaternion`.

    A body that does not turn keeps its quaternion to the bit.
    """
    qw, qx, qy, qz = quaternion_of(c, lane)
    hw, hx, hy, hz = rotated_quaternion(qw, qx, qy, qz, ox, oy, oz, half)
    c[QUATERNION + lane] = hw if is_turning else qw
    c[QUATERNION + L + lane] = hx if is_turning else qx
    c[QUATERNION + 2 * L + lane] = hy if is_turning else qy
    c[QUATERNION + 3 * L + lane] = hz if is_turning else qz


@inlined
def write_rotated_diagonal(m, first, c, diagonal):
    """Write R diag(a1, a2, a3) R' of each lane's body, with R of its quaternion.

    `diagonal` is the first row of a1, a2, a3 in `c`; the symmetric matrix is written to
    six rows of `m` from `first` on.
    """
    for lane in range(L):
        qw, qx, qy, qz = quaternion_of(c, lane)
        # (read number by number: `lane_vector` changes last bits here, see `jit`)
        a1 = c[diagonal + lane]
        a2 = c[diagonal + L + lane]
        a3 = c[diagonal + 2 * L + lane]
        # the rotation R, row by row
        xx = 1.0 - 2.0 * (qy * qy + qz * qz)
        xy = 2.0 * (qx * qy - qw * qz)
        xz = 2.0 * (qx * qz + qw * qy)
        yx = 2.0 * (qx * qy + qw * qz)
        yy = 1.0 - 2.0 * (qx * qx + qz * qz)
        yz = 2.0 * (qy * qz - qw * qx)
        zx = 2.0 * (qx * qz - qw * qy)
        zy = 2.0 * (qy * qz + qw * qx)
        zz = 1.0 - 2.0 * (qx * qx + qy * qy)
        m[first + lane] = a1 * xx * xx + a2 * xy * xy + a3 * xz * xz
        m[first + L + lane] = a1 * xx * yx + a2 * xy * yy + a3 * xz * yz
        m[first + 2 * L + lane] = a1 * xx * zx + a2 * xy * zy + a3 * xz * zz
        m[first + 3 * L + lane] = a1 * yx * yx + a2 * yy * yy + a3 * yz * yz
        m[first + 4 * L + lane] = a1 * yx * zx + a2 * yy * zy + a3 * yz * zz
        m[first + 5 * L + lane] = a1 * zx * zx + a2 * zy * zy + a3 * zz * zz


@inlined
def inverse_inertia_times(m, lane, x, y, z):
    """Multiply the inverse inertia of a lane's body by a vector; both in world axes."""
    xx, xy, xz, yy, yz, zz = lane_matrix(m, INVERSE_INERTIA, lane)
    return matrix_times(xx, xy, xz, yy, yz, zz, x, y, z)


@inlined
def into_body(c, lane, x, y, z):
    """Return a vector of the world in the axes of a lane's body."""
    qw, qx, qy, qz = quaternion_of(c, lane)
    # twice the vector product with the quaternion's vector
    tx = 2.0 * (y * qz - z * qy)
    ty = 2.0 * (z * qx - x * qz)
    tz = 2.0 * (x * qy - y * qx)
    return (
        x + qw * tx + ty * qz - tz * qy,
        y + qw * ty + tz * qx - tx * qz,
        z + qw * tz + tx * qy - ty * qx,
    )


@inlined
def into_world(c, lane, x, y, z):
    """Return a vector of a lane's body in world axes."""
    qw, qx, qy, qz = quaternion_of(c, lane)
    tx = 2.0 * (qy * z - qz * y)
    ty = 2.0 * (qz * x - qx * z)
    tz = 2.0 * (qx * y - qy * x)
    return (
        x + qw * tx + qy * tz - qz * ty,
        y + qw * ty + qz * tx - qx * tz,
        z + qw * tz + qx * ty - qy * tx,
    )


@kernel
def count_disturbed(m, dt):
    """Return how many bodies of a tile at rest may begin to turn.

    These are the bodies whose torque exceeds their budget of rolling resistance.
    """
    n = 0
    for lane in range(L):
        torque_x, torque_y, torque_z = lane_vector(m, TORQUE, lane)
        lx, ly, lz = dt * torque_x, dt * torque_y, dt * torque_z
        budget = CERTAIN * dt * m[BUDGET + lane]
        n += 1 if budget * budget < lx * lx + ly * ly + lz * lz else 0
    return n


@kernel
def twist_lanes(m, c, dt):
    """Add the torque of each lane's body to its angular momentum.

    Returns how many bodies may turn after rolling resistance.
    """
    n = 0
    for lane in range(L):
        torque_x, torque_y, torque_z = lane_vector(m, TORQUE, lane)
        lx, ly, lz = lane_vector(c, ANGULAR_MOMENTUM, lane)
        lx = lx + dt * torque_x
        ly = ly + dt * torque_y
        lz = lz + dt * torque_z
        write_vector(c, ANGULAR_MOMENTUM, lane, lx, ly, lz)
        budget = CERTAIN * dt * m[BUDGET + lane]
        n += 1 if budget * budget < lx * lx + ly * ly + lz * lz else 0
    return n


@kernel
def stop_lanes(m, c):
    """End the rotation of all lanes."""
    for number in range(3 * L):
        c[ANGULAR_MOMENTUM + number] = 0.0
        m[OMEGA + number] = 0.0


@inlined
def resistance_direction(x, y, z, i1, i2, i3, size, budget):
    """Return the direction of rolling resistance on a body that it does not stop.

    Everything is in the axes of the body, and relative to the frame against which
    rolling is resisted. The rotation that remains has the direction n, which is
    returned, and the angular velocity s n. With the angular momentum l before, the
    budget B and the inertia I, I s n = l - B n, so (s + B J) n = J l with J = 1 / I. The
    speed s is the root of |n(s)| = 1. Newton's method on 1 / |n(s)|, which is concave,
    converges to it from below. The unit of speed is the speed without resistance.

    Parameters
    ----------
    x, y, z, size : float
        l and its length.
    i1, i2, i3 : float
        The diagonal of J: inverse moments of inertia.
    budget : float
        B.
    """
    # J l and B J, both in the unit of speed.
    ox, oy, oz = i1 * x, i2 * y, i3 * z
    unit = 1.0 / max(math.sqrt(ox * ox + oy * oy + oz * oz), SLOWEST)
    ox, oy, oz = unit * ox, unit * oy, unit * oz
    b1, b2, b3 = unit * budget * i1, unit * budget * i2, unit * budget * i3
    # Two bounds of the root from below: by the budget along the rotation, and by the
    # largest moment of inertia.
    s = max(
        1.0 - (ox * ox * b1 + oy * oy * b2 + oz * oz * b3),
        unit * (size - budget) * min(i1, i2, i3),
    )
    s = max(s, 0.0)
    for _ in range(NEWTON_STEPS):
        d1, d2, d3 = s + b1, s + b2, s + b3
        # n is (ox / d1, oy / d2, oz / d3). All of it is multiplied by d1 d2 d3, so that
        # there is one division.
        c1, c2, c3 = d2 * d3, d3 * d1, d1 * d2
        g1, g2, g3 = ox * ox * c1 * c1, oy * oy * c2 * c2, oz * oz * c3 * c3
        g = g1 + g2 + g3
        s = max(s + g * (math.sqrt(g) - d1 * c1) / (g1 * c1 + g2 * c2 + g3 * c3), 0.0)
    d1, d2, d3 = s + b1, s + b2, s + b3
    product = 1.0 / (d1 * d2 * d3)
    return ox * product * d2 * d3, oy * product * d3 * d1, oz * product * d1 * d2


@kernel
def resist_lanes(m, c, dt):
    """Apply rolling resistance to each lane's body; return how many bodies turn.

    The budget B, the sum of mu_r F_n R over a body's contacts times dt, acts against the
    rotation that remains after it: l' = l - B o' / |o'|, with the angular velocity o' of
    l'. This has one solution. The body stands still where |l| <= B in any orientation,
    and its rotation is never reversed, so a settled pile is at rest.
    """
    n = 0
    for lane in range(L):
        lx, ly, lz = lane_vector(c, ANGULAR_MOMENTUM, lane)
        budget = dt * m[BUDGET + lane]
        square = lx * lx + ly * ly + lz * lz
        i1, i2, i3 = lane_vector(c, INVERSE_MOMENTS, lane)
        # the lane of an absent body may hold a torque and has no moments
        is_turning = (square > budget * budget) & (i1 > 0.0)
        n += 1 if is_turning else 0
        x, y, z = into_body(c, lane, lx, ly, lz)
        x, y, z = resistance_direction(x, y, z, i1, i2, i3, math.sqrt(square), budget)
        x, y, z = into_world(c, lane, x, y, z)
        lx = lx - budget * x if is_turning else 0.0
        ly = ly - budget * y if is_turning else 0.0
        lz = lz - budget * z if is_turning else 0.0
        write_vector(c, ANGULAR_MOMENTUM, lane, lx, ly, lz)
        ox, oy, oz = inverse_inertia_times(m, lane, lx, ly, lz)
        write_vector(m, OMEGA, lane, ox, oy, oz)
    return n


@kernel
def resist_in_frame(m, c, dt, fx, fy, fz):
    """Apply rolling resistance relative to a frame that turns with angular velocity f.

    It is that of `resist_lanes`, but a body that the resistance stops turns with the
    frame.
    """
    for lane in range(L):
        lx, ly, lz = lane_vector(c, ANGULAR_MOMENTUM, lane)
        budget = dt * m[BUDGET + lane]
        i1, i2, i3 = lane_vector(c, INVERSE_MOMENTS, lane)
        is_present = i1 > 0.0
        # w: the angular momentum of a body that turns with the frame
        x, y, z = into_body(c, lane, fx, fy, fz)
        x = x / i1 if is_present else 0.0
        y = y / i2 if is_present else 0.0
        z = z / i3 if is_present else 0.0
        wx, wy, wz = into_world(c, lane, x, y, z)
        x, y, z = into_body(c, lane, lx - wx, ly - wy, lz - wz)
        square = x * x + y * y + z * z
        is_turning = (square > budget * budget) & is_present
        x, y, z = resistance_direction(x, y, z, i1, i2, i3, math.sqrt(square), budget)
        x, y, z = into_world(c, lane, x, y, z)
        lx = lx - budget * x if is_turning else wx
        ly = ly - budget * y if is_turning else wy
        lz = lz - budget * z if is_turning else wz
        write_vector(c, ANGULAR_MOMENTUM, lane, lx, ly, lz)
        ox, oy, oz = inverse_inertia_times(m, lane, lx, ly, lz)
        # a stopped body has the frame's velocity without rounding
        is_stopped = is_present & (not is_turning)
        ox = fx if is_stopped else ox
        oy = fy if is_stopped else oy
        oz = fz if is_stopped else oz
        write_vector(m, OMEGA, lane, ox, oy, oz)


@kernel
def advance_orientation(m, c, dt):
    """Turn each lane's body with the angular velocity o at the middle of the step.

    o = J l, and l is constant within the step, so o changes at the rate -J (o x l).
    """
    for lane in range(L):
        lx, ly, lz = lane_vector(c, ANGULAR_MOMENTUM, lane)
        ox, oy, oz = lane_vector(m, OMEGA, lane)
        rx, ry, rz = inverse_inertia_times(
            m, lane, oy * lz - oz * ly, oz * lx - ox * lz, ox * ly - oy * lx
        )
        ox = alive(ox - 0.5 * dt * rx)
        oy = alive(oy - 0.5 * dt * ry)
        oz = alive(oz - 0.5 * dt * rz)
        write_vector(c, ANGULAR_MOMENTUM, lane, alive(lx), alive(ly), alive(lz))
        write_vector(m, OMEGA, lane, ox, oy, oz)
        square = ox * ox + oy * oy + oz * oz
        # the way of the farthest point of the body
        m[PATH + lane] += dt * c[st.RADIUS + lane] * math.sqrt(square)
        turn_quaternion(c, lane, ox, oy, oz, 0.5 * dt, square > 0.0)


@kernel
def inertia_lanes(m, c):
    """Write the inverse inertia of each lane's body as it is oriented now."""
    write_rotated_diagonal(m, INVERSE_INERTIA, c, INVERSE_MOMENTS)


@kernel
def shape_lanes(m, c, parts):
    """Write inverse inertia and shape of each lane's body as it is oriented now.

    The shape of a clump (parts == 0) is its quaternion. The loop over the parts is
    written out, so that their rows are constants in the compiled code.
    """
    inertia_lanes(m, c)
    if parts == 0:
        for number in range(4 * L):
            m[ROWS + SHAPE * L + number] = c[QUATERNION + number]
        return
    write_rotated_diagonal(m, ROWS + SHAPE * L, c, SQUARES)
    if parts > 1:
        write_rotated_diagonal(m, ROWS + (SHAPE + PART) * L, c, SQUARES + 3 * L)
    if parts > 2:
        write_rotated_diagonal(m, ROWS + (SHAPE + 2 * PART) * L, c, SQUARES + 6 * L)


@kernel
def share_lanes(m, c, dt, parts):
    """Write the share of its tangential dashpots that each body takes in the next step.

    All of them together stop at most the body's whole rotation, see `laws.tangential`.
    """
    share = ROWS + st.share_column(parts) * L
    for lane in range(L):
        i1, i2, i3 = lane_vector(c, INVERSE_MOMENTS, lane)
        largest = max(i1, max(i2, i3))
        m[share + lane] = 1.0 / max(1.0, dt * largest * m[DASHPOTS + lane])


@inlined
def rotate_lanes(m, c, dt, parts, is_resting, fx, fy, fz):
    """Turn the smooth bodies or clumps of a tile by one step.

    Where none turned in the last step and none may begin to turn, this costs little.

    Parameters
    ----------
    is_resting : bool
        Whether no body of the tile turned in the last step. Then only the first columns
        of the bodies are in the scratch tile.
    fx, fy, fz : float
        Angular velocity of the frame against which rolling is resisted [rad/s].

    Returns
    -------
    bool
        Whether any body turns.
    """
    has_frame = fx != 0.0 or fy != 0.0 or fz != 0.0
    if is_resting and not has_frame and count_disturbed(m, dt) == 0:
        return False
    n_twisted = twist_lanes(m, c, dt)
    if is_resting:
        inertia_lanes(m, c)
    if has_frame:
        resist_in_frame(m, c, dt, fx, fy, fz)
    elif n_twisted == 0:
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
    """Turn each lane's sphere against its rolling resistance; return how many turn.

    It is the motion of `resist_in_frame` and `advance_orientation`. Momentum and angular
    velocity of a sphere are parallel: the resistance shortens both, and the velocity is
    constant within the step. No path is added, since the surface of a turning sphere
    stays in its place.
    """
    n = 0
    for lane in range(L):
        inverse = c[INVERSE_MOMENTS + lane]
        is_present = inverse > 0.0
        moment = 1.0 / (inverse if is_present else 1.0)
        # the angular momentum relative to the frame, after the torque of this step
        torque_x, torque_y, torque_z = lane_vector(m, TORQUE, lane)
        lx, ly, lz = lane_vector(c, ANGULAR_MOMENTUM, lane)
        lx = lx + dt * torque_x - moment * fx
        ly = ly + dt * torque_y - moment * fy
        lz = lz + dt * torque_z - moment * fz
        budget = dt * m[BUDGET + lane]
        size = math.sqrt(lx * lx + ly * ly + lz * lz)
        is_turning = is_present & (size > budget)
        # the share of it that the resistance leaves
        kept_share = 1.0 - budget / (size if is_turning else 1.0)
        kept_share = kept_share if is_turning else 0.0
        lx = alive(kept_share * lx + moment * fx if is_present else 0.0)
        ly = alive(kept_share * ly + moment * fy if is_present else 0.0)
        lz = alive(kept_share * lz + moment * fz if is_present else 0.0)
        ox, oy, oz = alive(inverse * lx), alive(inverse * ly), alive(inverse * lz)
        write_vector(c, ANGULAR_MOMENTUM, lane, lx, ly, lz)
        write_vector(m, OMEGA, lane, ox, oy, oz)
        is_turning_now = ox * ox + oy * oy + oz * oz > 0.0
        n += 1 if is_turning_now else 0
        turn_quaternion(c, lane, ox, oy, oz, 0.5 * dt, is_turning_now)
        m[ROWS + st.SPHERE_RADIUS * L + lane] = c[st.RADIUS + lane]
    return n


@inlined
def rotate_spheres(m, c, dt, is_resting, fx, fy, fz):
    """Turn the spheres of a tile by one step; see `rotate_lanes`."""
    has_frame = fx != 0.0 or fy != 0.0 or fz != 0.0
    if is_resting and not has_frame and count_disturbed(m, dt) == 0:
        return False
    share_lanes(m, c, dt, st.SPHERES)
    return turn_spheres(m, c, dt, fx, fy, fz) > 0 or has_frame
