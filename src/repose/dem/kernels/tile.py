"""The inner loops of smooth bodies: geometry of 32 contacts at a time.

`scratch` is the scratch tile: an array of rows of LANES doubles, a row one quantity, a
lane one contact (see `rows`). It holds copies of the two bodies A and B, then the
geometry, then the forces. `contacts` is a tile of the numbers that contacts keep from
step to step (`state`); the functions here read and write its normal N only. It points
from A to B. Body A is the body of a contact with a wall, too.

Each loop has a constant number of lanes and reads and writes only the two tiles, without
branches that depend on a lane: a choice is written as `a if condition else b`. So the
compiler makes vector code of it. Unused lanes hold an absent body; their results are not
used.
"""

import math

from . import state as st
from .geometry import area, matrix_times, part_terms
from .jit import inlined
from .rows import LANES, Rows, lane_matrix, lane_vector, write_matrix, write_vector
from .simd import rsqrt
from .state import LOAD_COLUMNS, MOST_PARTS, NORMAL, OFFSET, PART, SHAPE
from .vectors import cross, dot, squared_length

N = NORMAL  # first row of the contact's normal in `contacts`

# Rows of the scratch tile.
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
# acts (see `body_rotation.write_dashpot_shares`).
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
def fill_constants(scratch, first, constants):
    """Write the constants of a force law to all lanes, one row each from `first` on."""
    for number in range(constants.shape[0]):
        for lane in range(LANES):
            scratch[first + number * LANES + lane] = constants[number]


@inlined
def lane_part(scratch, shape_row, lane, nx, ny, nz):
    """Return `part_terms` of an ellipsoid; `shape_row` is the first row of its matrix."""
    xx, xy, xz, yy, yz, zz = lane_matrix(scratch, shape_row, lane)
    return part_terms(xx, xy, xz, yy, yz, zz, nx, ny, nz)


@inlined
def body_terms(scratch, shape_row, parts, lane, nx, ny, nz):
    """Return support point and curvature matrix of a lane's body along the normal n.

    They are the sums of the terms of its parts. `shape_row` is the first row of the first
    part's matrix.

    Returns
    -------
    x, y, z : float
        Support point, from the centre of the body [m].
    xx, xy, xz, yy, yz, zz : float
        Curvature matrix [m].
    """
    x, y, z, xx, xy, xz, yy, yz, zz = lane_part(scratch, shape_row, lane, nx, ny, nz)
    for part in range(1, parts):
        part_row = shape_row + part * PART * LANES
        dx, dy, dz, dxx, dxy, dxz, dyy, dyz, dzz = lane_part(
            scratch, part_row, lane, nx, ny, nz
        )
        x, y, z = x + dx, y + dy, z + dz
        xx, xy, xz = xx + dxx, xy + dxy, xz + dxz
        yy, yz, zz = yy + dyy, yz + dyz, zz + dzz
    return x, y, z, xx, xy, xz, yy, yz, zz


@inlined
def write_terms_of_a(scratch, contacts, parts):
    """Write the support point and the curvature of each pair's body A along its normal.

    These are the rows SUPPORT, CURVED and AREA_A.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, N, lane)
        x, y, z, xx, xy, xz, yy, yz, zz = body_terms(
            scratch, A + SHAPE * LANES, parts, lane, nx, ny, nz
        )
        write_vector(scratch, SUPPORT, lane, x, y, z)
        write_matrix(scratch, CURVED, lane, xx, xy, xz, yy, yz, zz)
        scratch[AREA_A + lane] = area(xx, xy, xz, yy, yz, zz)


@inlined
def add_terms_of_b(scratch, contacts, parts):
    """Write the vector between the support points, and the sum of both curvatures.

    These are the rows BETWEEN, BOTH and AREA_B, which need those of `write_terms_of_a`.
    Bodies are centrally symmetric: for the opposite normal, the support point of B has
    the opposite sign, and its curvature is the same.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, N, lane)
        x, y, z, xx, xy, xz, yy, yz, zz = body_terms(
            scratch, B + SHAPE * LANES, parts, lane, nx, ny, nz
        )
        # from the support point of A to that of B, which is at (-x, -y, -z)
        ax, ay, az = lane_vector(scratch, A, lane)
        bx, by, bz = lane_vector(scratch, B, lane)
        sx, sy, sz = lane_vector(scratch, SUPPORT, lane)
        between_x = bx - ax - sx - x
        between_y = by - ay - sy - y
        between_z = bz - az - sz - z
        write_vector(scratch, BETWEEN, lane, between_x, between_y, between_z)
        scratch[AREA_B + lane] = area(xx, xy, xz, yy, yz, zz)
        axx, axy, axz, ayy, ayz, azz = lane_matrix(scratch, CURVED, lane)
        write_matrix(
            scratch,
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
def newton_step(scratch, contacts):
    """Write how far each pair's normal turns in this step: rows STEP, GAP and RADIUS.

    The gap f along a normal n is n times the vector between the support points. The
    normal of a contact is that of the largest f, where the gradient g of f is 0. This is
    one step s of Newton's method. Both g and s lie in the tangent plane; there the
    curvature C of both bodies is a 2 x 2 matrix. With T = C + f I, s = T^-1 g = (tr T g - T g) / det T by Cayley and Hamilton,
    so no tangents are needed. The gap at the new normal follows from an expansion at the
    old one, to third order in the step.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, N, lane)
        x, y, z = lane_vector(scratch, BETWEEN, lane)
        xx, xy, xz, yy, yz, zz = lane_matrix(scratch, BOTH, lane)
        # the gap f and its gradient g along the normal so far
        f = dot(nx, ny, nz, x, y, z)
        gx, gy, gz = x - f * nx, y - f * ny, z - f * nz
        # the effective radius sqrt(det C_A det C_B / det(C_A + C_B))
        area_both = area(xx, xy, xz, yy, yz, zz)
        product = scratch[AREA_A + lane] * scratch[AREA_B + lane]
        scratch[RADIUS + lane] = product * rsqrt(product * area_both)
        # the step; where T is not definite, it is g / tr C instead
        trace = xx + yy + zz
        det = area_both + f * (trace + f)
        is_definite = (trace + 2.0 * f > 0.0) & (det > 1e-3 * trace * trace)
        inverse = 1.0 / (det if is_definite else trace * trace)
        gradient_factor = inverse * (trace + f if is_definite else trace)
        matrix_factor = inverse if is_definite else 0.0
        cg_x, cg_y, cg_z = matrix_times(xx, xy, xz, yy, yz, zz, gx, gy, gz)
        sx = gradient_factor * gx - matrix_factor * cg_x
        sy = gradient_factor * gy - matrix_factor * cg_y
        sz = gradient_factor * gz - matrix_factor * cg_z
        # a long step is cut
        cut = LARGEST_TURN * rsqrt(squared_length(sx, sy, sz))
        cut = cut if cut < 1.0 else 1.0
        sx, sy, sz = cut * sx, cut * sy, cut * sz
        write_vector(scratch, STEP, lane, sx, sy, sz)
        scratch[GAP + lane] = f + 0.5 * dot(gx, gy, gz, sx, sy, sz)


@inlined
def contact_points(scratch, contacts):
    """Turn each normal by its step, and compute the contact point: rows N, RA and RB.

    The contact point is an expansion at the old normal, to second order in the step. RA
    and RB are the vectors to it from the centres of the two bodies.
    """
    for lane in range(LANES):
        # the normal after the step, of unit length
        sx, sy, sz = lane_vector(scratch, STEP, lane)
        nx, ny, nz = lane_vector(contacts, N, lane)
        nx, ny, nz = nx + sx, ny + sy, nz + sz
        inverse = rsqrt(squared_length(nx, ny, nz))
        nx, ny, nz = inverse * nx, inverse * ny, inverse * nz
        write_vector(contacts, N, lane, nx, ny, nz)
        # The step moves the support point of A by its curvature times the step. The
        # contact lies midway between the two support points.
        x, y, z = lane_vector(scratch, SUPPORT, lane)
        xx, xy, xz, yy, yz, zz = lane_matrix(scratch, CURVED, lane)
        half_gap = 0.5 * scratch[GAP + lane]
        rx = x + xx * sx + xy * sy + xz * sz + half_gap * nx
        ry = y + xy * sx + yy * sy + yz * sz + half_gap * ny
        rz = z + xz * sx + yz * sy + zz * sz + half_gap * nz
        write_vector(scratch, RA, lane, rx, ry, rz)
        ax, ay, az = lane_vector(scratch, A, lane)
        bx, by, bz = lane_vector(scratch, B, lane)
        write_vector(scratch, RB, lane, rx + ax - bx, ry + ay - by, rz + az - bz)


@inlined
def write_terms(scratch, contacts, parts):
    """Write the terms of both bodies that the Newton step needs."""
    write_terms_of_a(scratch, contacts, parts)
    add_terms_of_b(scratch, contacts, parts)


@inlined
def sphere_pair_geometry(scratch, contacts):
    """Compute the geometry of pairs of spheres, in closed form.

    Writes the same rows as `pair_geometry`. Where two centres coincide, the last normal
    stays.
    """
    radius_row = st.SPHERE_RADIUS * LANES
    for lane in range(LANES):
        # the normal, from the centre of A to that of B
        ax, ay, az = lane_vector(scratch, A, lane)
        bx, by, bz = lane_vector(scratch, B, lane)
        dx, dy, dz = bx - ax, by - ay, bz - az
        square = squared_length(dx, dy, dz)
        is_apart = square > NEAREST * NEAREST
        inverse = rsqrt(square if is_apart else 1.0)
        nx, ny, nz = lane_vector(contacts, N, lane)
        nx = inverse * dx if is_apart else nx
        ny = inverse * dy if is_apart else ny
        nz = inverse * dz if is_apart else nz
        write_vector(contacts, N, lane, nx, ny, nz)
        # gap and radii; the distance of the centres is inverse * square
        radius_a = scratch[A + radius_row + lane]
        radius_b = scratch[B + radius_row + lane]
        gap = inverse * square - radius_a - radius_b
        scratch[GAP + lane] = gap
        scratch[RADIUS + lane] = radius_a * radius_b / (radius_a + radius_b)
        scratch[AREA_A + lane] = radius_a * radius_a
        scratch[AREA_B + lane] = radius_b * radius_b
        # the contact point lies midway between the two surfaces
        arm_a = radius_a + 0.5 * gap
        write_vector(scratch, RA, lane, arm_a * nx, arm_a * ny, arm_a * nz)
        arm_b = -(radius_b + 0.5 * gap)
        write_vector(scratch, RB, lane, arm_b * nx, arm_b * ny, arm_b * nz)


@inlined
def pair_geometry(scratch, contacts, parts):
    """Compute gap, effective radius and contact point of each pair of smooth bodies.

    One Newton step from the last normal is enough, since bodies move little in a step.
    There are several short loops instead of one, because a processor runs as many lanes
    at once as its window holds. The number of parts is a constant in each call, so that
    the loops become vector code.
    """
    if parts == st.SPHERES:
        sphere_pair_geometry(scratch, contacts)
        return
    if parts == 1:
        write_terms(scratch, contacts, 1)
    elif parts == 2:
        write_terms(scratch, contacts, 2)
    else:
        write_terms(scratch, contacts, MOST_PARTS)
    newton_step(scratch, contacts)
    contact_points(scratch, contacts)


@inlined
def write_terms_of_sphere(scratch, contacts):
    """Write the rows SUPPORT and AREA_A of `write_terms_of_a` where A is a sphere."""
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, N, lane)
        radius = scratch[A + st.SPHERE_RADIUS * LANES + lane]
        write_vector(scratch, SUPPORT, lane, radius * nx, radius * ny, radius * nz)
        scratch[AREA_A + lane] = radius * radius


@inlined
def is_on_disc(contacts, lane, x, y, z, nx, ny, nz):
    """Return whether a place is within the disc of a plane, seen along its normal n.

    (x, y, z) is the place, and the disc is that of a lane of `contacts`.
    """
    middle_x, middle_y, middle_z = lane_vector(contacts, st.MIDDLE, lane)
    dx, dy, dz = x - middle_x, y - middle_y, z - middle_z
    height = dot(dx, dy, dz, nx, ny, nz)
    # the squared distance from the middle in the plane, by Pythagoras
    square = squared_length(dx, dy, dz) - height * height
    return square <= contacts[st.RADIUS2 + lane]


@inlined
def plane_geometry(scratch, contacts, parts):
    """Compute gap, effective radius and contact point of each body on a plane.

    Reads the plane in `contacts`: its normal N, pointing into the wall, its OFFSET along
    the normal, and its disc (MIDDLE, RADIUS2), beyond which the gap is BEYOND. Writes the
    rows GAP, RADIUS and RA.
    """
    # The number of parts is a constant in each call, so that the loop is vector code.
    if parts == st.SPHERES:
        write_terms_of_sphere(scratch, contacts)
    elif parts == 1:
        write_terms_of_a(scratch, contacts, 1)
    elif parts == 2:
        write_terms_of_a(scratch, contacts, 2)
    else:
        write_terms_of_a(scratch, contacts, MOST_PARTS)
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, N, lane)
        ax, ay, az = lane_vector(scratch, A, lane)
        # the point of the body that is deepest in the wall, from the body's centre
        rx, ry, rz = lane_vector(scratch, SUPPORT, lane)
        gap = contacts[OFFSET + lane] - nx * (ax + rx) - ny * (ay + ry) - nz * (az + rz)
        # the contact point lies midway between body and plane
        rx, ry, rz = rx + 0.5 * gap * nx, ry + 0.5 * gap * ny, rz + 0.5 * gap * nz
        write_vector(scratch, RA, lane, rx, ry, rz)
        scratch[RADIUS + lane] = math.sqrt(scratch[AREA_A + lane])
        on_disc = is_on_disc(contacts, lane, ax + rx, ay + ry, az + rz, nx, ny, nz)
        scratch[GAP + lane] = gap if on_disc else BEYOND


@inlined
def torques(scratch):
    """Compute the force on B, and torques and dashpot terms on both bodies.

    Reads the force on A in TO_A, the arms RA and RB of the contact point, and DASHPOT.
    Writes the other rows of TO_A and TO_B but the budget of the rolling resistance.
    """
    torque_row = st.TORQUE * LANES
    dashpots_row = st.DASHPOTS * LANES
    for lane in range(LANES):
        fx, fy, fz = lane_vector(scratch, TO_A, lane)
        dashpot = scratch[DASHPOT + lane]
        # body A: the torque is arm x force
        ax, ay, az = lane_vector(scratch, RA, lane)
        x, y, z = cross(ax, ay, az, fx, fy, fz)
        write_vector(scratch, TO_A + torque_row, lane, x, y, z)
        scratch[TO_A + dashpots_row + lane] = dashpot * squared_length(ax, ay, az)
        # body B: the opposite force, so the torque is force x arm
        bx, by, bz = lane_vector(scratch, RB, lane)
        write_vector(scratch, TO_B, lane, -fx, -fy, -fz)
        x, y, z = cross(fx, fy, fz, bx, by, bz)
        write_vector(scratch, TO_B + torque_row, lane, x, y, z)
        scratch[TO_B + dashpots_row + lane] = dashpot * squared_length(bx, by, bz)


@inlined
def open_lanes(scratch):
    """Return the number of lanes with a gap, not an overlap."""
    n_open = 0
    for lane in range(LANES):
        n_open += 1 if scratch[GAP + lane] > 0.0 else 0
    return n_open
