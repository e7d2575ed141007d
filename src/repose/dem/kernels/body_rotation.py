"""Rotate 32 bodies by one time step, under their torques and rolling resistance.

The state of a rotation is the angular momentum in world axes. The angular velocity in
the middle of the step follows from it. Therefore a free rotation conserves the angular
momentum exactly, and the energy to second order in the time step.

The functions work on two tiles of 32 bodies, one body in each lane (see `rows`):
`scratch` is the scratch tile of the time step (rows of `body_tile`), `motion` a tile of
`Bodies.motion` (rows of `state`). They read the torques and the budgets of the rolling
resistance in the rows LOAD of `scratch`. They write angular momentum and quaternion to
`motion`. They write angular velocity, inverse inertia, shape and fraction of the
dashpots to `scratch`, and add to its row PATH. Loops over the lanes have no branches
that depend on a lane, so that they become vector code.

The budget of a body is the angular momentum that rolling resistance can take from it in
a step. `omega` is an angular velocity [rad/s]. Vectors are in world axes. Components
along the axes of a body are numbered 1, 2 and 3.
"""

import math

from . import state
from .body_tile import INVERSE_INERTIA, LOAD, OMEGA, PATH, ROWS, TORQUE
from .geometry import multiply_symmetric
from .jit import inlined, kernel
from .rows import LANES, lane_matrix, lane_vector, write_matrix, write_vector
from .state import (
    ANGULAR_MOMENTUM,
    INVERSE_MOMENTS,
    PART,
    QUATERNION,
    SHAPE,
    SQUARES,
    flush_tiny,
)
from .vectors import cross, squared_length

BUDGET_SHARE = 1.0 - 1e-12  # reduces a budget, so that rounding never hides a rotation
LEAST_SPEED = 1e-150  # angular speed below which a rotation has no direction [rad/s]
# Newton steps for the direction of the resistance. The length of its unit vector is
# then wrong by 4e-8 if the moments of inertia differ sixfold, by 4e-4 for a factor of
# thirty.
NEWTON_STEPS = 3
# First rows of the scratch tile.
BUDGET = LOAD + state.ROLL * LANES  # a torque: the budget per second
DASHPOTS = LOAD + state.DASHPOTS * LANES


@inlined
def quaternion_of(motion, lane):
    """Return the quaternion (w, x, y, z) of a lane's body, from body to world axes."""
    return (
        motion[QUATERNION + lane],
        motion[QUATERNION + LANES + lane],
        motion[QUATERNION + 2 * LANES + lane],
        motion[QUATERNION + 3 * LANES + lane],
    )


@inlined
def rotated_quaternion(qw, qx, qy, qz, omega_x, omega_y, omega_z, half_dt):
    """Return a unit quaternion after a step with constant angular velocity.

    It is q + dt / 2 (0, omega) q, divided by its length, with the product of
    quaternions.

    Parameters
    ----------
    qw, qx, qy, qz : float
        The unit quaternion q before the step.
    omega_x, omega_y, omega_z : float
        Angular velocity in world axes [rad/s].
    half_dt : float
        Half of the time step [s].
    """
    w = qw - half_dt * (omega_x * qx + omega_y * qy + omega_z * qz)
    x = qx + half_dt * (omega_x * qw + omega_y * qz - omega_z * qy)
    y = qy + half_dt * (omega_y * qw + omega_z * qx - omega_x * qz)
    z = qz + half_dt * (omega_z * qw + omega_x * qy - omega_y * qx)
    inverse_length = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return (
        w * inverse_length,
        x * inverse_length,
        y * inverse_length,
        z * inverse_length,
    )


@inlined
def turn_quaternion(motion, lane, omega_x, omega_y, omega_z, half_dt, is_turning):
    """Rotate the quaternion of a lane's body by one step, in place.

    The step is that of `rotated_quaternion`. The quaternion of a body that does not
    turn stays exactly the same.

    Parameters
    ----------
    motion : array (MOTION_ROWS * LANES,)
        Tile of `Bodies.motion` with quaternions, angular momenta and other numbers of
        LANES bodies, one body in each lane: `motion[row + lane]`. The module `state`
        names the rows.
    lane : int
        Lane of the body in its tile, 0 to LANES - 1.
    omega_x, omega_y, omega_z : float
        Angular velocity in world axes [rad/s].
    half_dt : float
        Half of the time step [s].
    is_turning : bool
        Whether the body turns.
    """
    qw, qx, qy, qz = quaternion_of(motion, lane)
    w, x, y, z = rotated_quaternion(qw, qx, qy, qz, omega_x, omega_y, omega_z, half_dt)
    motion[QUATERNION + lane] = w if is_turning else qw
    write_vector(
        motion,
        QUATERNION + LANES,
        lane,
        x if is_turning else qx,
        y if is_turning else qy,
        z if is_turning else qz,
    )


@inlined
def write_rotated_diagonal(scratch, row, motion, diagonal_row):
    """Rotate a diagonal matrix from the axes of each lane's body into world axes.

    The result is R diag(d1, d2, d3) R', where R is the rotation matrix of the body's
    quaternion.

    Parameters
    ----------
    scratch : array
        Scratch tile, to which the symmetric matrices are written.
    row : int
        First of the six rows of the matrices: xx, xy, xz, yy, yz, zz.
    motion : array
        Tile of `Bodies.motion` with the quaternions and the diagonals.
    diagonal_row : int
        First of the three rows of the diagonals in `motion`: d1, d2, d3.
    """
    for lane in range(LANES):
        qw, qx, qy, qz = quaternion_of(motion, lane)
        # Read the diagonal number by number. With `lane_vector` the compiler would
        # combine other products, which changes the last bits of the result (see `jit`).
        d1 = motion[diagonal_row + lane]
        d2 = motion[diagonal_row + LANES + lane]
        d3 = motion[diagonal_row + 2 * LANES + lane]
        # The elements of R. Its columns are the body's axes in the world, so xy is the
        # x component of the body's second axis.
        xx = 1.0 - 2.0 * (qy * qy + qz * qz)
        xy = 2.0 * (qx * qy - qw * qz)
        xz = 2.0 * (qx * qz + qw * qy)
        yx = 2.0 * (qx * qy + qw * qz)
        yy = 1.0 - 2.0 * (qx * qx + qz * qz)
        yz = 2.0 * (qy * qz - qw * qx)
        zx = 2.0 * (qx * qz - qw * qy)
        zy = 2.0 * (qy * qz + qw * qx)
        zz = 1.0 - 2.0 * (qx * qx + qy * qy)
        # The upper triangle of the symmetric matrix R diag R'
        write_matrix(
            scratch,
            row,
            lane,
            d1 * xx * xx + d2 * xy * xy + d3 * xz * xz,
            d1 * xx * yx + d2 * xy * yy + d3 * xz * yz,
            d1 * xx * zx + d2 * xy * zy + d3 * xz * zz,
            d1 * yx * yx + d2 * yy * yy + d3 * yz * yz,
            d1 * yx * zx + d2 * yy * zy + d3 * yz * zz,
            d1 * zx * zx + d2 * zy * zy + d3 * zz * zz,
        )


@inlined
def inverse_inertia_times(scratch, lane, x, y, z):
    """Multiply the inverse inertia of a lane's body by a vector, both in world axes."""
    xx, xy, xz, yy, yz, zz = lane_matrix(scratch, INVERSE_INERTIA, lane)
    return multiply_symmetric(xx, xy, xz, yy, yz, zz, x, y, z)


@inlined
def rotate_into_body(motion, lane, x, y, z):
    """Rotate a vector from world axes into the axes of a lane's body, and return it.

    The rotation is the inverse of that of the body's quaternion.

    Parameters
    ----------
    motion : array (MOTION_ROWS * LANES,)
        Tile of `Bodies.motion` with quaternions, angular momenta and other numbers of
        LANES bodies, one body in each lane: `motion[row + lane]`. The module `state`
        names the rows.
    lane : int
        Lane of the body in its tile, 0 to LANES - 1.
    x, y, z : float
        The vector in world axes.
    """
    qw, qx, qy, qz = quaternion_of(motion, lane)
    # twice the vector product of (x, y, z) with the vector part of the quaternion
    twice_x = 2.0 * (y * qz - z * qy)
    twice_y = 2.0 * (z * qx - x * qz)
    twice_z = 2.0 * (x * qy - y * qx)
    return (
        x + qw * twice_x + twice_y * qz - twice_z * qy,
        y + qw * twice_y + twice_z * qx - twice_x * qz,
        z + qw * twice_z + twice_x * qy - twice_y * qx,
    )


@inlined
def rotate_into_world(motion, lane, x, y, z):
    """Rotate a vector from the axes of a lane's body into world axes, and return it.

    The rotation is that of the body's quaternion.

    Parameters
    ----------
    motion : array (MOTION_ROWS * LANES,)
        Tile of `Bodies.motion` with quaternions, angular momenta and other numbers of
        LANES bodies, one body in each lane: `motion[row + lane]`. The module `state`
        names the rows.
    lane : int
        Lane of the body in its tile, 0 to LANES - 1.
    x, y, z : float
        The vector in the axes of the body.
    """
    qw, qx, qy, qz = quaternion_of(motion, lane)
    # twice the vector product of the quaternion's vector part with (x, y, z)
    twice_x = 2.0 * (qy * z - qz * y)
    twice_y = 2.0 * (qz * x - qx * z)
    twice_z = 2.0 * (qx * y - qy * x)
    return (
        x + qw * twice_x + qy * twice_z - qz * twice_y,
        y + qw * twice_y + qz * twice_x - qx * twice_z,
        z + qw * twice_z + qx * twice_y - qy * twice_x,
    )


@inlined
def exceeds_budget(scratch, lane, lx, ly, lz, dt):
    """Return whether an angular momentum exceeds a lane's budget of rolling resistance.

    The budget is the angular momentum that rolling resistance can take from the body in
    a step. It is reduced slightly, so that rounding never hides a body that may turn.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    lane : int
        Lane of the body in its tile, 0 to LANES - 1.
    lx, ly, lz : float
        The angular momentum [kg m2/s].
    dt : float
        Time step [s].
    """
    budget = BUDGET_SHARE * dt * scratch[BUDGET + lane]
    return budget * budget < squared_length(lx, ly, lz)


@kernel
def count_disturbed_bodies(scratch, dt):
    """Count the bodies that may begin to turn in a tile that is at rest.

    A body may begin to turn if its torque times the time step exceeds its budget: the
    angular momentum that rolling resistance can take from it in a step.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES bodies. A row holds one quantity of all these bodies, and
        a lane is one body: `scratch[row + lane]`. The module `body_tile` names the
        rows.
    dt : float
        Time step [s].
    """
    n_disturbed = 0
    for lane in range(LANES):
        torque_x, torque_y, torque_z = lane_vector(scratch, TORQUE, lane)
        may_turn = exceeds_budget(
            scratch, lane, dt * torque_x, dt * torque_y, dt * torque_z, dt
        )
        n_disturbed += 1 if may_turn else 0
    return n_disturbed


@kernel
def add_torques(scratch, motion, dt):
    """Add each body's torque, times the time step, to its angular momentum.

    The function also counts the bodies that may turn. The budget of a body is the
    angular momentum that rolling resistance can take from it in a step. Only a body
    whose angular momentum exceeds its budget may turn.

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
    dt : float
        Time step [s].

    Returns
    -------
    int
        Number of bodies whose angular momentum exceeds the budget.
    """
    n_turning = 0
    for lane in range(LANES):
        torque_x, torque_y, torque_z = lane_vector(scratch, TORQUE, lane)
        lx, ly, lz = lane_vector(motion, ANGULAR_MOMENTUM, lane)
        lx = lx + dt * torque_x
        ly = ly + dt * torque_y
        lz = lz + dt * torque_z
        write_vector(motion, ANGULAR_MOMENTUM, lane, lx, ly, lz)
        # If the momentum does not exceed the budget, rolling resistance stops the body.
        may_turn = exceeds_budget(scratch, lane, lx, ly, lz, dt)
        n_turning += 1 if may_turn else 0
    return n_turning


@kernel
def stop_rotations(scratch, motion):
    """Set the angular momentum and the angular velocity of a tile's bodies to zero.

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
    """
    for offset in range(3 * LANES):
        motion[ANGULAR_MOMENTUM + offset] = 0.0
        scratch[OMEGA + offset] = 0.0


@inlined
def resistance_direction(l1, l2, l3, j1, j2, j3, momentum, budget):
    """Return the direction of the rolling resistance on a body that keeps turning.

    All components are along the principal axes of the body, numbered 1 to 3, and all
    motion is relative to the frame of the rolling resistance. The budget B is the
    angular momentum that rolling resistance can take from the body in this step.

    After the resistance has acted, the angular velocity is s n, where s is the speed
    and n the unit vector that is returned. The resistance takes the angular momentum B
    n from the angular momentum l, so I s n = l - B n, where I is the inertia. With J =
    1 / I, this gives n = J l / d along each axis, where d = s + B J. The speed s is the
    root of |n(s)| = 1.

    The function 1 / |n(s)| is concave, so Newton's method for 1 / |n(s)| = 1 converges
    to the root from below. Let q = |n|^2 be the sum of (J l)^2 / d^2 over the axes, and
    p = -q'(s) / 2 the sum of (J l)^2 / d^3. Then a step adds q (sqrt(q) - 1) / p to s.

    Parameters
    ----------
    l1, l2, l3 : float
        Angular momentum l [kg m2/s].
    j1, j2, j3 : float
        Inverse moments of inertia J [1/(kg m2)].
    momentum : float
        Length of l [kg m2/s].
    budget : float
        Budget B [kg m2/s], less than the length of l.

    Returns
    -------
    n1, n2, n3 : float
        The unit vector n.
    """
    # Compute the numerators J l and the terms B J of the denominators. Divide both by
    # the speed without resistance, so that the root s is between 0 and 1.
    numerator1, numerator2, numerator3 = j1 * l1, j2 * l2, j3 * l3
    free_speed = math.sqrt(
        numerator1 * numerator1 + numerator2 * numerator2 + numerator3 * numerator3
    )
    inverse_free_speed = 1.0 / max(free_speed, LEAST_SPEED)
    numerator1, numerator2, numerator3 = (
        inverse_free_speed * numerator1,
        inverse_free_speed * numerator2,
        inverse_free_speed * numerator3,
    )
    loss1, loss2, loss3 = (
        inverse_free_speed * budget * j1,
        inverse_free_speed * budget * j2,
        inverse_free_speed * budget * j3,
    )
    # Start at the larger of two lower bounds of the root. The first assumes that the
    # budget acts along the rotation, the second that all moments equal the largest one.
    speed = max(
        1.0
        - (
            numerator1 * numerator1 * loss1
            + numerator2 * numerator2 * loss2
            + numerator3 * numerator3 * loss3
        ),
        inverse_free_speed * (momentum - budget) * min(j1, j2, j3),
    )
    speed = max(speed, 0.0)
    for _ in range(NEWTON_STEPS):
        # The denominators d = s + B J of the three axes
        d1, d2, d3 = speed + loss1, speed + loss2, speed + loss3
        # Multiply all fractions by the product D of the three denominators, so that a
        # step needs only one division. d23 is the product of d2 and d3. `square` is q
        # D^2, and `slope` is p D^3.
        d23, d31, d12 = d2 * d3, d3 * d1, d1 * d2
        square1 = numerator1 * numerator1 * d23 * d23
        square2 = numerator2 * numerator2 * d31 * d31
        square3 = numerator3 * numerator3 * d12 * d12
        square = square1 + square2 + square3
        slope = square1 * d23 + square2 * d31 + square3 * d12
        speed = max(speed + square * (math.sqrt(square) - d1 * d23) / slope, 0.0)
    # The components of n at the root
    d1, d2, d3 = speed + loss1, speed + loss2, speed + loss3
    inverse = 1.0 / (d1 * d2 * d3)
    return (
        numerator1 * inverse * d2 * d3,
        numerator2 * inverse * d3 * d1,
        numerator3 * inverse * d1 * d2,
    )


@kernel
def resist_rolling(scratch, motion, dt):
    """Apply rolling resistance to each lane's body.

    The budget B of a body is the angular momentum that rolling resistance can take from
    it in a step: dt times the sum of mu_r F_n R over its contacts. If the angular
    momentum l is not larger than B, the body stops. Otherwise the resistance opposes
    the rotation that remains: l becomes l' = l - B o' / |o'|, where o' is the angular
    velocity that belongs to l'. This equation has one solution, which
    `resistance_direction` finds. The resistance never reverses a rotation, so a settled
    pile is at rest.

    Writes the angular momentum to `motion` and the angular velocity to `scratch`. The
    loop has no branches, so that it becomes vector code: it computes both cases for
    each lane and selects one.

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
    dt : float
        Time step [s].

    Returns
    -------
    int
        Number of bodies that turn.
    """
    n_turning = 0
    for lane in range(LANES):
        lx, ly, lz = lane_vector(motion, ANGULAR_MOMENTUM, lane)
        budget = dt * scratch[BUDGET + lane]
        momentum_squared = squared_length(lx, ly, lz)
        # The lane of an absent body may contain a torque, but its inverse moments of
        # inertia are zero.
        j1, j2, j3 = lane_vector(motion, INVERSE_MOMENTS, lane)
        is_present = j1 > 0.0
        # `&` in place of `and` avoids a branch.
        is_turning = (momentum_squared > budget * budget) & is_present
        n_turning += 1 if is_turning else 0
        # The momentum and the direction of the resistance, along the body's axes
        l1, l2, l3 = rotate_into_body(motion, lane, lx, ly, lz)
        n1, n2, n3 = resistance_direction(
            l1, l2, l3, j1, j2, j3, math.sqrt(momentum_squared), budget
        )
        # For a body that stops, the direction is meaningless and is not used.
        nx, ny, nz = rotate_into_world(motion, lane, n1, n2, n3)
        # The angular momentum that remains, and the angular velocity that belongs to it
        lx = lx - budget * nx if is_turning else 0.0
        ly = ly - budget * ny if is_turning else 0.0
        lz = lz - budget * nz if is_turning else 0.0
        write_vector(motion, ANGULAR_MOMENTUM, lane, lx, ly, lz)
        omega_x, omega_y, omega_z = inverse_inertia_times(scratch, lane, lx, ly, lz)
        write_vector(scratch, OMEGA, lane, omega_x, omega_y, omega_z)
    return n_turning


@kernel
def resist_rolling_in_frame(scratch, motion, dt, frame_x, frame_y, frame_z):
    """Apply rolling resistance to each lane's body, relative to a rotating frame.

    The resistance is that of `resist_rolling`, but with the motion relative to the
    frame. A body that it stops rotates with the frame. The budget of a body is the
    angular momentum that rolling resistance can take from it in a step. Writes the
    angular momentum to `motion` and the angular velocity to `scratch`. The loop has no
    branches, so that it becomes vector code.

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
    dt : float
        Time step [s].
    frame_x, frame_y, frame_z : float
        Angular velocity of the frame [rad/s].
    """
    for lane in range(LANES):
        lx, ly, lz = lane_vector(motion, ANGULAR_MOMENTUM, lane)
        budget = dt * scratch[BUDGET + lane]
        j1, j2, j3 = lane_vector(motion, INVERSE_MOMENTS, lane)
        is_present = j1 > 0.0
        # (rest_x, rest_y, rest_z) is the angular momentum of a body that rotates with
        # the frame. Along the body's axes, it is the angular velocity times the moments
        # of inertia 1 / j. An absent body has none: its j is 0.
        x, y, z = rotate_into_body(motion, lane, frame_x, frame_y, frame_z)
        x = x / j1 if is_present else 0.0
        y = y / j2 if is_present else 0.0
        z = z / j3 if is_present else 0.0
        rest_x, rest_y, rest_z = rotate_into_world(motion, lane, x, y, z)
        # (x, y, z) becomes the angular momentum relative to the frame, along the body's
        # axes.
        x, y, z = rotate_into_body(motion, lane, lx - rest_x, ly - rest_y, lz - rest_z)
        momentum_squared = x * x + y * y + z * z
        is_turning = (momentum_squared > budget * budget) & is_present
        # (x, y, z) becomes the direction of the resistance, first along the body's
        # axes, then in the world.
        x, y, z = resistance_direction(
            x, y, z, j1, j2, j3, math.sqrt(momentum_squared), budget
        )
        x, y, z = rotate_into_world(motion, lane, x, y, z)
        # The resistance takes the budget, or stops the body relative to the frame.
        lx = lx - budget * x if is_turning else rest_x
        ly = ly - budget * y if is_turning else rest_y
        lz = lz - budget * z if is_turning else rest_z
        write_vector(motion, ANGULAR_MOMENTUM, lane, lx, ly, lz)
        omega_x, omega_y, omega_z = inverse_inertia_times(scratch, lane, lx, ly, lz)
        # A stopped body gets the frame's angular velocity exactly, without rounding.
        is_stopped = is_present & (not is_turning)
        omega_x = frame_x if is_stopped else omega_x
        omega_y = frame_y if is_stopped else omega_y
        omega_z = frame_z if is_stopped else omega_z
        write_vector(scratch, OMEGA, lane, omega_x, omega_y, omega_z)


@kernel
def advance_orientation(scratch, motion, dt):
    """Rotate each lane's body with the angular velocity in the middle of the step.

    The angular momentum l is constant within the step. The angular velocity is o = J l,
    where J is the inverse inertia. Because J rotates with the body, o changes at the
    rate -J (o x l). The row OMEGA of `scratch` has o at the beginning of the step, and
    is overwritten with o half a step later.

    Writes the quaternion to `motion`. Adds the path of the body's farthest point in
    this step to the row PATH of `scratch`. Velocities and momenta that are almost zero
    become zero (`state.flush_tiny`).

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
    dt : float
        Time step [s].
    """
    for lane in range(LANES):
        lx, ly, lz = lane_vector(motion, ANGULAR_MOMENTUM, lane)
        omega_x, omega_y, omega_z = lane_vector(scratch, OMEGA, lane)
        cross_x, cross_y, cross_z = cross(omega_x, omega_y, omega_z, lx, ly, lz)
        rate_x, rate_y, rate_z = inverse_inertia_times(
            scratch, lane, cross_x, cross_y, cross_z
        )
        # The angular velocity half a time step later, in the middle of the step
        omega_x = flush_tiny(omega_x - 0.5 * dt * rate_x)
        omega_y = flush_tiny(omega_y - 0.5 * dt * rate_y)
        omega_z = flush_tiny(omega_z - 0.5 * dt * rate_z)
        write_vector(
            motion,
            ANGULAR_MOMENTUM,
            lane,
            flush_tiny(lx),
            flush_tiny(ly),
            flush_tiny(lz),
        )
        write_vector(scratch, OMEGA, lane, omega_x, omega_y, omega_z)
        speed_squared = squared_length(omega_x, omega_y, omega_z)
        # Add the path of the body's farthest point, at its bounding radius.
        scratch[PATH + lane] += (
            dt * motion[state.RADIUS + lane] * math.sqrt(speed_squared)
        )
        # The last argument says whether the body turns at all.
        turn_quaternion(
            motion, lane, omega_x, omega_y, omega_z, 0.5 * dt, speed_squared > 0.0
        )


@kernel
def write_inverse_inertia(scratch, motion):
    """Write the inverse inertia of each lane's body in world axes.

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
    """
    write_rotated_diagonal(scratch, INVERSE_INERTIA, motion, INVERSE_MOMENTS)


@kernel
def write_shapes(scratch, motion, parts):
    """Write inverse inertia and shape of each lane's body in its present orientation.

    The shape of a smooth body is a symmetric 3 x 3 matrix (PART rows) for each of its
    ellipsoids, at most three. The shape of a clump is its quaternion (four rows). The
    function is not called for simulations of spheres. The loop over the ellipsoids is
    written out, so that their rows are constants in the compiled code.

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
    parts : int
        Largest number of ellipsoids in a body, 1 to 3; 0 for clumps.
    """
    write_inverse_inertia(scratch, motion)
    # From ROWS on, the scratch tile has a row for each column of `Bodies.rows`. In it,
    # the shape begins at the column SHAPE.
    first = ROWS + SHAPE * LANES
    # Copy the four rows of the quaternion of clumps.
    if parts == 0:
        for offset in range(4 * LANES):
            scratch[first + offset] = motion[QUATERNION + offset]
        return
    # The squared semi-axes of each ellipsoid are three rows of `motion`.
    write_rotated_diagonal(scratch, first, motion, SQUARES)
    if parts > 1:
        second = ROWS + (SHAPE + PART) * LANES
        write_rotated_diagonal(scratch, second, motion, SQUARES + 3 * LANES)
    if parts > 2:
        third = ROWS + (SHAPE + 2 * PART) * LANES
        write_rotated_diagonal(scratch, third, motion, SQUARES + 6 * LANES)


@kernel
def write_dashpot_shares(scratch, motion, dt, parts):
    """Write which fraction of its tangential dashpots each body allows to act.

    The fraction is used in the next step. With this fraction, all dashpots of the body
    together at most stop its rotation in a step, see `laws.tangential`.

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
    dt : float
        Time step [s].
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    """
    share_row = ROWS + state.share_column(parts) * LANES
    for lane in range(LANES):
        j1, j2, j3 = lane_vector(motion, INVERSE_MOMENTS, lane)
        largest_inverse_moment = max(j1, max(j2, j3))
        # Upper bound of the fraction of the rotation that the dashpots would take in a
        # step
        lost_share = dt * largest_inverse_moment * scratch[DASHPOTS + lane]
        scratch[share_row + lane] = 1.0 / max(1.0, lost_share)


@inlined
def rotate_bodies(scratch, motion, dt, parts, is_resting, frame_x, frame_y, frame_z):
    """Rotate the smooth bodies or clumps of a tile by one step.

    The steps are: add the torques, apply the rolling resistance, rotate the bodies, and
    write their shapes. Each uses the results of the previous one. The call takes little
    time if no body turned in the previous step and no torque exceeds the rolling
    resistance.

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
    dt : float
        Time step [s].
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps.
    is_resting : bool
        Whether no body of the tile turned in the previous step. If so, the scratch tile
        has only the first columns of the bodies, without the inverse inertia.
    frame_x, frame_y, frame_z : float
        Angular velocity of the frame against which rolling is resisted [rad/s]. Zeros
        mean that the frame does not rotate.

    Returns
    -------
    bool
        Whether any body turns.
    """
    has_frame = frame_x != 0.0 or frame_y != 0.0 or frame_z != 0.0
    if is_resting and not has_frame and count_disturbed_bodies(scratch, dt) == 0:
        return False
    n_turning = add_torques(scratch, motion, dt)
    if is_resting:
        # The scratch tile of resting bodies does not have the inverse inertia yet.
        write_inverse_inertia(scratch, motion)
    # Apply the rolling resistance. Return early if it stops all bodies of the tile.
    if has_frame:
        resist_rolling_in_frame(scratch, motion, dt, frame_x, frame_y, frame_z)
    elif n_turning == 0:
        stop_rotations(scratch, motion)
        return False
    elif resist_rolling(scratch, motion, dt) == 0:
        return False
    advance_orientation(scratch, motion, dt)
    write_shapes(scratch, motion, parts)
    # Write which fraction of its tangential dashpots each body allows to act.
    write_dashpot_shares(scratch, motion, dt, parts)
    return True


@kernel
def turn_spheres(scratch, motion, dt, frame_x, frame_y, frame_z):
    """Rotate the sphere of each lane by one step, against its rolling resistance.

    The motion is that of `resist_rolling_in_frame` and `advance_orientation`. The
    angular momentum and the angular velocity of a sphere are parallel. Therefore the
    resistance only shortens them, and the velocity is constant within the step. No path
    is added, because the surface of a sphere stays in place when the sphere rotates.

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
    dt : float
        Time step [s].
    frame_x, frame_y, frame_z : float
        Angular velocity of the frame against which rolling is resisted [rad/s].

    Returns
    -------
    int
        Number of spheres that turn.
    """
    n_turning = 0
    for lane in range(LANES):
        inverse_moment = motion[INVERSE_MOMENTS + lane]
        is_present = inverse_moment > 0.0
        moment = 1.0 / (inverse_moment if is_present else 1.0)
        # The angular momentum relative to the frame, after the torque of this step
        torque_x, torque_y, torque_z = lane_vector(scratch, TORQUE, lane)
        lx, ly, lz = lane_vector(motion, ANGULAR_MOMENTUM, lane)
        lx = lx + dt * torque_x - moment * frame_x
        ly = ly + dt * torque_y - moment * frame_y
        lz = lz + dt * torque_z - moment * frame_z
        # The fraction of this momentum that remains after the resistance
        budget = dt * scratch[BUDGET + lane]
        momentum = math.sqrt(squared_length(lx, ly, lz))
        may_turn = is_present & (momentum > budget)
        kept_share = 1.0 - budget / (momentum if may_turn else 1.0)
        kept_share = kept_share if may_turn else 0.0
        # The angular momentum and the angular velocity in the world
        lx = flush_tiny(kept_share * lx + moment * frame_x if is_present else 0.0)
        ly = flush_tiny(kept_share * ly + moment * frame_y if is_present else 0.0)
        lz = flush_tiny(kept_share * lz + moment * frame_z if is_present else 0.0)
        omega_x = flush_tiny(inverse_moment * lx)
        omega_y = flush_tiny(inverse_moment * ly)
        omega_z = flush_tiny(inverse_moment * lz)
        write_vector(motion, ANGULAR_MOMENTUM, lane, lx, ly, lz)
        write_vector(scratch, OMEGA, lane, omega_x, omega_y, omega_z)
        is_turning = squared_length(omega_x, omega_y, omega_z) > 0.0
        n_turning += 1 if is_turning else 0
        turn_quaternion(motion, lane, omega_x, omega_y, omega_z, 0.5 * dt, is_turning)
        # The radius is the only column of a sphere's shape.
        scratch[ROWS + state.SPHERE_RADIUS * LANES + lane] = motion[state.RADIUS + lane]
    return n_turning


@inlined
def rotate_spheres(scratch, motion, dt, is_resting, frame_x, frame_y, frame_z):
    """Rotate the spheres of a tile by one step; return whether any of them turns.

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
    dt : float
        Time step [s].
    is_resting : bool
        Whether no sphere of the tile turned in the previous step.
    frame_x, frame_y, frame_z : float
        Angular velocity of the frame against which rolling is resisted [rad/s].
    """
    has_frame = frame_x != 0.0 or frame_y != 0.0 or frame_z != 0.0
    if is_resting and not has_frame and count_disturbed_bodies(scratch, dt) == 0:
        return False
    write_dashpot_shares(scratch, motion, dt, state.SPHERES)
    return turn_spheres(scratch, motion, dt, frame_x, frame_y, frame_z) > 0 or has_frame
