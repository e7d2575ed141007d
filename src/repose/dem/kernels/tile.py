"""The inner loops of smooth bodies: geometry of 32 contacts at a time.

`t` is the scratch tile: an array of rows of L doubles, a row one quantity, a lane one
contact (see `rows`). It holds copies of the two bodies, then the geometry, then the
forces. `c` is a tile of the numbers that contacts keep from step to step (`state`); the
functions here read and write its normal N only.

Each loop has a constant number of lanes and reads and writes only the two tiles, without
branches that depend on a lane: a choice is written as `a if condition else b`. So the
compiler makes vector code of it. Unused lanes hold an absent body; their results are not
used.
"""

import math

from . import state as st
from .geometry import area, part_terms
from .jit import inlined
from .rows import L, Rows, lane_matrix, lane_vector, write_matrix, write_vector
from .simd import rsqrt
from .state import LOAD_COLUMNS, MOST_PARTS, NORMAL, OFFSET, PART, SHAPE

N = NORMAL  # first row of the contact's normal in `c`

# Rows of the scratch tile `t`.
_rows = Rows()
MOST_COLUMNS = 40
# The bodies: one row for each column of `Bodies.rows`. B is used by pairs only.
A = _rows.take(MOST_COLUMNS)
B = _rows.take(MOST_COLUMNS)
SUPPORT = _rows.take(3)  # support point of A, from its centre
BETWEEN = _rows.take(3)  # from the support point of A to that of B
CURVED = _rows.take(6)  # curvature matrix of A: xx, xy, xz, yy, yz, zz
BOTH = _rows.take(6)  # sum of the curvature matrices of A and B
AREA_A, AREA_B = _rows.take_each(2)  # product of the principal radii of curvature
GAP = _rows.take()  # negative for an overlap
RADIUS = _rows.take()  # effective radius
RA = _rows.take(3)  # contact point relative to the centre of A
RB = _rows.take(3)  # and relative to that of B
# As the columns of `Bodies.load`: force, torque, budget of the rolling resistance, and
# dashpots, on either body.
TO_A = _rows.take(LOAD_COLUMNS)
TO_B = _rows.take(LOAD_COLUMNS)
PUSH = _rows.take()  # normal force that limits friction and rolling
# Radius of the contact circle, written by the contact law; 0 where nothing touches.
CIRCLE = _rows.take()
# The tangential dashpot [N s/m], written by the contact law, and the share of it that
# acts (see `body_rotation.share_lanes`).
DASHPOT, SHARE = _rows.take_each(2)
STEP = _rows.take(3)  # how far the normal turns in this step [rad]
V = _rows.take(3)  # tangential velocity of A against B
VN = _rows.take()  # normal velocity
# Inverse of the mass in the damping: the mass of both bodies at the contact, along the
# normal, divided by the number of contacts that share it (see `damped_mass`).
INVERSE_MASS = _rows.take()
# Rows of the rolling law, beginning with its constants, then those of the contact law.
MOST_ROLLING_ROWS = 16
ROLLING = _rows.take(MOST_ROLLING_ROWS)
LAW = _rows.end
LAW_ROW = _rows.count

# The gap of a body beyond the edge of a disc [m]. It is searched again as soon as it has
# moved at all.
BEYOND = math.inf
NEAREST = 1e-30  # distance of two centres that still have a direction [m]
LARGEST_TURN = 0.2  # of a contact normal in one step [rad]


@inlined
def fill_constants(t, first, constants):
    """Write the constants of a force law to all lanes, one row each from `first` on."""
    for number in range(constants.shape[0]):
        for lane in range(L):
            t[first + number * L + lane] = constants[number]


@inlined
def lane_part(t, shape, lane, nx, ny, nz):
    """Return `part_terms` of one ellipsoid; `shape` is the first row of its matrix."""
    xx, xy, xz, yy, yz, zz = lane_matrix(t, shape, lane)
    return part_terms(xx, xy, xz, yy, yz, zz, nx, ny, nz)


@inlined
def body_terms(t, shape, parts, lane, nx, ny, nz):
    """Return support point (3) and curvature matrix (6) of a lane's body.

    They are summed over its parts; `shape` is the first row of the first part's matrix.
    """
    x, y, z, xx, xy, xz, yy, yz, zz = lane_part(t, shape, lane, nx, ny, nz)
    for part in range(1, parts):
        dx, dy, dz, dxx, dxy, dxz, dyy, dyz, dzz = lane_part(
            t, shape + part * PART * L, lane, nx, ny, nz
        )
        x, y, z = x + dx, y + dy, z + dz
        xx, xy, xz = xx + dxx, xy + dxy, xz + dxz
        yy, yz, zz = yy + dyy, yz + dyz, zz + dzz
    return x, y, z, xx, xy, xz, yy, yz, zz


@inlined
def body_a(t, c, parts):
    """Write the rows SUPPORT, CURVED and AREA_A: the terms of body A along the normal."""
    for lane in range(L):
        nx, ny, nz = lane_vector(c, N, lane)
        x, y, z, xx, xy, xz, yy, yz, zz = body_terms(
            t, A + SHAPE * L, parts, lane, nx, ny, nz
        )
        write_vector(t, SUPPORT, lane, x, y, z)
        write_matrix(t, CURVED, lane, xx, xy, xz, yy, yz, zz)
        t[AREA_A + lane] = area(xx, xy, xz, yy, yz, zz)


@inlined
def body_b(t, c, parts):
    """Write the rows BETWEEN, BOTH and AREA_B, which need those of `body_a`.

    Bodies are centrally symmetric: for the opposite normal, the support point of B has
    the opposite sign, and its curvature is the same.
    """
    for lane in range(L):
        nx, ny, nz = lane_vector(c, N, lane)
        x, y, z, xx, xy, xz, yy, yz, zz = body_terms(
            t, B + SHAPE * L, parts, lane, nx, ny, nz
        )
        t[BETWEEN + lane] = t[B + lane] - t[A + lane] - t[SUPPORT + lane] - x
        t[BETWEEN + L + lane] = (
            t[B + L + lane] - t[A + L + lane] - t[SUPPORT + L + lane] - y
        )
        t[BETWEEN + 2 * L + lane] = (
            t[B + 2 * L + lane] - t[A + 2 * L + lane] - t[SUPPORT + 2 * L + lane] - z
        )
        t[AREA_B + lane] = area(xx, xy, xz, yy, yz, zz)
        axx, axy, axz, ayy, ayz, azz = lane_matrix(t, CURVED, lane)
        write_matrix(
            t,
            BOTH,
            lane,
            axx + xx,
            axy + xy,
            axz + xz,
            ayy + yy,
            ayz + yz,
            azz + zz,
        )


@inlined
def newton_step(t, c):
    """Make one Newton step on the gap of each pair: rows STEP, GAP and RADIUS.

    The step s and the gradient g lie in the tangent plane; there the curvature C of both
    bodies is a 2 x 2 matrix. With T = C + f I, s = T^-1 g = (tr T g - T g) / det T by
    Cayley and Hamilton, so no tangents are needed. The gap at the new normal follows
    from an expansion at the old one, to third order in the step. The effective radius
    is R* = sqrt(det Q_A det Q_B / det(Q_A + Q_B)).
    """
    for lane in range(L):
        nx, ny, nz = lane_vector(c, N, lane)
        x, y, z = lane_vector(t, BETWEEN, lane)
        xx, xy, xz, yy, yz, zz = lane_matrix(t, BOTH, lane)
        f = nx * x + ny * y + nz * z
        gx, gy, gz = x - f * nx, y - f * ny, z - f * nz
        trace = xx + yy + zz
        area_both = area(xx, xy, xz, yy, yz, zz)
        product = t[AREA_A + lane] * t[AREA_B + lane]
        t[RADIUS + lane] = product * rsqrt(product * area_both)
        # Where T is not definite, the step is g / tr C instead.
        det = area_both + f * (trace + f)
        is_definite = (trace + 2.0 * f > 0.0) & (det > 1e-3 * trace * trace)
        inv = 1.0 / (det if is_definite else trace * trace)
        gradient_factor = inv * (trace + f if is_definite else trace)
        matrix_factor = inv if is_definite else 0.0
        sx = gradient_factor * gx - matrix_factor * (xx * gx + xy * gy + xz * gz)
        sy = gradient_factor * gy - matrix_factor * (xy * gx + yy * gy + yz * gz)
        sz = gradient_factor * gz - matrix_factor * (xz * gx + yz * gy + zz * gz)
        # Cut a long step.
        cut = LARGEST_TURN * rsqrt(sx * sx + sy * sy + sz * sz)
        cut = cut if cut < 1.0 else 1.0
        sx, sy, sz = cut * sx, cut * sy, cut * sz
        write_vector(t, STEP, lane, sx, sy, sz)
        t[GAP + lane] = f + 0.5 * (gx * sx + gy * sy + gz * sz)


@inlined
def contact_points(t, c):
    """Turn each normal by its step, and compute the contact point: rows N, RA and RB.

    The contact point is an expansion at the old normal, to second order in the step.
    """
    for lane in range(L):
        sx, sy, sz = lane_vector(t, STEP, lane)
        mx = c[N + lane] + sx
        my = c[N + L + lane] + sy
        mz = c[N + 2 * L + lane] + sz
        inv = rsqrt(mx * mx + my * my + mz * mz)
        mx, my, mz = inv * mx, inv * my, inv * mz
        write_vector(c, N, lane, mx, my, mz)
        xx, xy, xz, yy, yz, zz = lane_matrix(t, CURVED, lane)
        # the contact lies midway between the two support points
        half = 0.5 * t[GAP + lane]
        rx = t[SUPPORT + lane] + xx * sx + xy * sy + xz * sz + half * mx
        ry = t[SUPPORT + L + lane] + xy * sx + yy * sy + yz * sz + half * my
        rz = t[SUPPORT + 2 * L + lane] + xz * sx + yz * sy + zz * sz + half * mz
        write_vector(t, RA, lane, rx, ry, rz)
        t[RB + lane] = rx + t[A + lane] - t[B + lane]
        t[RB + L + lane] = ry + t[A + L + lane] - t[B + L + lane]
        t[RB + 2 * L + lane] = rz + t[A + 2 * L + lane] - t[B + 2 * L + lane]


@inlined
def both_bodies(t, c, parts):
    """Compute the terms of both bodies that the Newton step needs."""
    body_a(t, c, parts)
    body_b(t, c, parts)


@inlined
def sphere_pair_geometry(t, c):
    """Compute the geometry of pairs of spheres, in closed form.

    Writes the same rows as `pair_geometry`. Where two centres coincide, the last normal
    stays.
    """
    for lane in range(L):
        dx = t[B + lane] - t[A + lane]
        dy = t[B + L + lane] - t[A + L + lane]
        dz = t[B + 2 * L + lane] - t[A + 2 * L + lane]
        radius_a = t[A + st.SPHERE_RADIUS * L + lane]
        radius_b = t[B + st.SPHERE_RADIUS * L + lane]
        square = dx * dx + dy * dy + dz * dz
        is_apart = square > NEAREST * NEAREST
        inv = rsqrt(square if is_apart else 1.0)
        nx = inv * dx if is_apart else c[N + lane]
        ny = inv * dy if is_apart else c[N + L + lane]
        nz = inv * dz if is_apart else c[N + 2 * L + lane]
        gap = inv * square - radius_a - radius_b
        write_vector(c, N, lane, nx, ny, nz)
        t[GAP + lane] = gap
        t[RADIUS + lane] = radius_a * radius_b / (radius_a + radius_b)
        t[AREA_A + lane] = radius_a * radius_a
        t[AREA_B + lane] = radius_b * radius_b
        reach = radius_a + 0.5 * gap
        write_vector(t, RA, lane, reach * nx, reach * ny, reach * nz)
        reach = -(radius_b + 0.5 * gap)
        write_vector(t, RB, lane, reach * nx, reach * ny, reach * nz)


@inlined
def pair_geometry(t, c, parts):
    """Compute gap, effective radius and contact point of each pair of smooth bodies.

    One Newton step from the last normal is enough, since bodies move little in a step.
    There are several short loops instead of one, because a processor runs as many lanes
    at once as its window holds. The number of parts is a constant in each call, so that
    the loops become vector code.
    """
    if parts == st.SPHERES:
        sphere_pair_geometry(t, c)
        return
    if parts == 1:
        both_bodies(t, c, 1)
    elif parts == 2:
        both_bodies(t, c, 2)
    else:
        both_bodies(t, c, MOST_PARTS)
    newton_step(t, c)
    contact_points(t, c)


@inlined
def sphere_a(t, c):
    """Write the rows SUPPORT and AREA_A where body A is a sphere."""
    for lane in range(L):
        nx, ny, nz = lane_vector(c, N, lane)
        radius = t[A + st.SPHERE_RADIUS * L + lane]
        write_vector(t, SUPPORT, lane, radius * nx, radius * ny, radius * nz)
        t[AREA_A + lane] = radius * radius


@inlined
def is_on_disc(c, lane, x, y, z, nx, ny, nz):
    """Return whether a place is within the disc of a plane, seen along its normal n."""
    dx = x - c[st.MIDDLE + lane]
    dy = y - c[st.MIDDLE + L + lane]
    dz = z - c[st.MIDDLE + 2 * L + lane]
    height = dx * nx + dy * ny + dz * nz
    return dx * dx + dy * dy + dz * dz - height * height <= c[st.RADIUS2 + lane]


@inlined
def plane_geometry(t, c, parts):
    """Compute gap, effective radius and contact point of each body on a plane.

    Reads the plane in `c`: its normal N, pointing into the wall, its OFFSET along the
    normal, and its disc (MIDDLE, RADIUS2), beyond which the gap is BEYOND.
    """
    if parts == st.SPHERES:
        sphere_a(t, c)
    elif parts == 1:
        body_a(t, c, 1)
    elif parts == 2:
        body_a(t, c, 2)
    else:
        body_a(t, c, MOST_PARTS)
    for lane in range(L):
        nx, ny, nz = lane_vector(c, N, lane)
        rx, ry, rz = lane_vector(t, SUPPORT, lane)
        gap = (
            c[OFFSET + lane]
            - nx * (t[A + lane] + rx)
            - ny * (t[A + L + lane] + ry)
            - nz * (t[A + 2 * L + lane] + rz)
        )
        # the contact point lies midway between body and plane
        rx, ry, rz = rx + 0.5 * gap * nx, ry + 0.5 * gap * ny, rz + 0.5 * gap * nz
        t[RADIUS + lane] = math.sqrt(t[AREA_A + lane])
        write_vector(t, RA, lane, rx, ry, rz)
        x = t[A + lane] + rx
        y = t[A + L + lane] + ry
        z = t[A + 2 * L + lane] + rz
        on_disc = is_on_disc(c, lane, x, y, z, nx, ny, nz)
        t[GAP + lane] = gap if on_disc else BEYOND


@inlined
def torques(t):
    """Compute the force on B, and torques and dashpot terms on both bodies.

    Reads the force on A in TO_A, RA, RB and DASHPOT; writes the other rows of TO_A and
    TO_B but the budget of the rolling resistance.
    """
    for lane in range(L):
        fx, fy, fz = lane_vector(t, TO_A, lane)
        rx, ry, rz = lane_vector(t, RA, lane)
        sx, sy, sz = lane_vector(t, RB, lane)
        dashpot = t[DASHPOT + lane]
        torque_x, torque_y, torque_z = (
            ry * fz - rz * fy,
            rz * fx - rx * fz,
            rx * fy - ry * fx,
        )
        write_vector(t, TO_A + st.TORQUE * L, lane, torque_x, torque_y, torque_z)
        t[TO_A + st.DASHPOTS * L + lane] = dashpot * (rx * rx + ry * ry + rz * rz)
        write_vector(t, TO_B, lane, -fx, -fy, -fz)
        torque_x, torque_y, torque_z = (
            sz * fy - sy * fz,
            sx * fz - sz * fx,
            sy * fx - sx * fy,
        )
        write_vector(t, TO_B + st.TORQUE * L, lane, torque_x, torque_y, torque_z)
        t[TO_B + st.DASHPOTS * L + lane] = dashpot * (sx * sx + sy * sy + sz * sz)


@inlined
def open_lanes(t):
    """Return the number of lanes with a gap, not an overlap."""
    n = 0
    for lane in range(L):
        n += 1 if t[GAP + lane] > 0.0 else 0
    return n
