"""Geometry of 32 contacts of smooth bodies at a time, from copies of their bodies.

`scratch` is the scratch tile: an array of rows of LANES doubles, a row one quantity, a
lane one contact (see `rows`). It holds copies of the two bodies A and B, then the
geometry, then the forces. `contacts` is a tile of the numbers that contacts keep from
step to step (`state`); the functions here read and write its normal only (row NORMAL).
It points from A to B. Body A is the body of a contact with a wall, too.

Each loop has a constant number of lanes and reads and writes only the two tiles,
without branches that depend on a lane: a choice is written as `a if condition else b`.
So the compiler makes vector code of it. Unused lanes hold an absent body; their results
are not used.
"""

import math

from . import state
from .geometry import ellipsoid_support, multiply_symmetric, radii_product
from .jit import inlined
from .rows import LANES, Rows, lane_matrix, lane_vector, write_matrix, write_vector
from .simd import rsqrt
from .state import LOAD_COLUMNS, MOST_PARTS, NORMAL, OFFSET, PART
from .vectors import cross, dot, squared_length

# Rows of the scratch tile.
_rows = Rows()
MOST_COLUMNS = 40
# The bodies: one row for each column of `Bodies.rows`. B is used by pairs only.
A = _rows.take(MOST_COLUMNS)
B = _rows.take(MOST_COLUMNS)
# Rows of the columns that the geometry needs: the centre (3), and the shape.
POSITION_A, POSITION_B = A + state.POSITION * LANES, B + state.POSITION * LANES
SHAPE_A, SHAPE_B = A + state.SHAPE * LANES, B + state.SHAPE * LANES
SPHERE_RADIUS_A = A + state.SPHERE_RADIUS * LANES
SPHERE_RADIUS_B = B + state.SPHERE_RADIUS * LANES
SUPPORT = _rows.take(3)  # support point of A, from its centre
SUPPORT_A_TO_B = _rows.take(3)  # from the support point of A to that of B
CURVATURE_A = _rows.take(6)  # curvature matrix of A: xx, xy, xz, yy, yz, zz
CURVATURE_SUM = _rows.take(6)  # sum of the curvature matrices of A and B
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
    """Write the constants of a force law to all lanes of a tile.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    first : int
        First row of the law; constant number c goes to the row c rows after it.
    constants : array
        The constants of the law for one pair of materials.
    """
    for number in range(constants.shape[0]):
        for lane in range(LANES):
            scratch[first + number * LANES + lane] = constants[number]


@inlined
def ellipsoid_terms(scratch, shape_row, lane, nx, ny, nz):
    """Return support point and curvature matrix of one ellipsoid along the normal n.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    shape_row : int
        First of the six rows with the ellipsoid's matrix (xx, xy, xz, yy, yz, zz).
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    nx, ny, nz : float
        Unit normal n.

    Returns
    -------
    tuple of 9 float
        See `geometry.ellipsoid_support`.
    """
    xx, xy, xz, yy, yz, zz = lane_matrix(scratch, shape_row, lane)
    return ellipsoid_support(xx, xy, xz, yy, yz, zz, nx, ny, nz)


@inlined
def body_terms(scratch, shape_row, parts, lane, nx, ny, nz):
    """Return support point and curvature matrix of a lane's body along the normal n.

    A body is a Minkowski sum of ellipsoids, its parts, so both are sums over the parts.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    shape_row : int
        First row of the first part's matrix; each part has PART rows.
    parts : int
        Number of ellipsoids.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    nx, ny, nz : float
        Unit normal n.

    Returns
    -------
    x, y, z : float
        Support point: the outermost point along n, from the centre of the body [m].
    xx, xy, xz, yy, yz, zz : float
        Curvature matrix [m].
    """
    # the first part, then the sum with the others
    x, y, z, xx, xy, xz, yy, yz, zz = ellipsoid_terms(
        scratch, shape_row, lane, nx, ny, nz
    )
    for part in range(1, parts):
        part_row = shape_row + part * PART * LANES
        dx, dy, dz, dxx, dxy, dxz, dyy, dyz, dzz = ellipsoid_terms(
            scratch, part_row, lane, nx, ny, nz
        )
        x, y, z = x + dx, y + dy, z + dz
        xx, xy, xz = xx + dxx, xy + dxy, xz + dxz
        yy, yz, zz = yy + dyy, yz + dyz, zz + dzz
    return x, y, z, xx, xy, xz, yy, yz, zz


@inlined
def write_terms_of_a(scratch, contacts, parts):
    """Write what the geometry of a contact needs of body A, for each lane.

    Writes the rows SUPPORT (outermost point along the normal), CURVATURE_A (curvature matrix
    there) and AREA_A (product of the principal radii of curvature).

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    parts : int
        Number of ellipsoids of a body.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, NORMAL, lane)
        support_x, support_y, support_z, xx, xy, xz, yy, yz, zz = body_terms(
            scratch, SHAPE_A, parts, lane, nx, ny, nz
        )
        write_vector(scratch, SUPPORT, lane, support_x, support_y, support_z)
        write_matrix(scratch, CURVATURE_A, lane, xx, xy, xz, yy, yz, zz)
        scratch[AREA_A + lane] = radii_product(xx, xy, xz, yy, yz, zz)


@inlined
def add_terms_of_b(scratch, contacts, parts):
    """Combine body B of each lane with body A, whose terms are known.

    Call `write_terms_of_a` first. Writes the rows SUPPORT_A_TO_B (from the support point of A
    to that of B), CURVATURE_SUM (sum of the two curvature matrices) and AREA_B (product of the
    principal radii of curvature of B).

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    parts : int
        Number of ellipsoids of a body.
    """
    for lane in range(LANES):
        # The normal points from A to B, so B touches along -n. Bodies are centrally
        # symmetric: the support point for -n is minus that for n, and the curvature is
        # the same.
        nx, ny, nz = lane_vector(contacts, NORMAL, lane)
        support_b_x, support_b_y, support_b_z, xx, xy, xz, yy, yz, zz = body_terms(
            scratch, SHAPE_B, parts, lane, nx, ny, nz
        )
        # The vector from the support point of A to that of B, which lies at minus the
        # support vector of B from its centre.
        centre_a_x, centre_a_y, centre_a_z = lane_vector(scratch, POSITION_A, lane)
        centre_b_x, centre_b_y, centre_b_z = lane_vector(scratch, POSITION_B, lane)
        support_a_x, support_a_y, support_a_z = lane_vector(scratch, SUPPORT, lane)
        between_x = centre_b_x - centre_a_x - support_a_x - support_b_x
        between_y = centre_b_y - centre_a_y - support_a_y - support_b_y
        between_z = centre_b_z - centre_a_z - support_a_z - support_b_z
        write_vector(scratch, SUPPORT_A_TO_B, lane, between_x, between_y, between_z)
        # Curvatures: the product of the radii of B, and the sum of both matrices.
        scratch[AREA_B + lane] = radii_product(xx, xy, xz, yy, yz, zz)
        axx, axy, axz, ayy, ayz, azz = lane_matrix(scratch, CURVATURE_A, lane)
        write_matrix(
            scratch,
            CURVATURE_SUM,
            lane,
            axx + xx,
            axy + xy,
            axz + xz,
            ayy + yy,
            ayz + yz,
            azz + zz,
        )


@inlined
def write_newton_step(scratch, contacts):
    """Compute how far each pair's normal turns in this step, and its gap after that.

    The gap f along a normal n is n times the vector between the support points. The
    normal of a contact is that of the largest f, where the gradient g of f is 0. This
    is one step s of Newton's method. Both g and s lie in the tangent plane; there the
    curvature C of both bodies is a 2 x 2 matrix. With T = C + f I,

        s = T^-1 g = (tr T g - T g) / det T

    by Cayley and Hamilton, so no tangents are needed. The gap at the new normal follows
    from an expansion at the old one, to third order in the step.

    Reads the rows of `write_terms_of_a` and `add_terms_of_b`; writes the rows STEP
    [rad], GAP [m] and RADIUS (the effective radius [m]).

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, NORMAL, lane)
        between_x, between_y, between_z = lane_vector(scratch, SUPPORT_A_TO_B, lane)
        xx, xy, xz, yy, yz, zz = lane_matrix(scratch, CURVATURE_SUM, lane)
        # the gap f and its gradient g along the normal so far
        gap = dot(nx, ny, nz, between_x, between_y, between_z)
        gx, gy, gz = between_x - gap * nx, between_y - gap * ny, between_z - gap * nz
        # the effective radius sqrt(det C_A det C_B / det(C_A + C_B))
        area_both = radii_product(xx, xy, xz, yy, yz, zz)
        product = scratch[AREA_A + lane] * scratch[AREA_B + lane]
        scratch[RADIUS + lane] = product * rsqrt(product * area_both)
        # the step; where T is not definite, it is g / tr C instead
        trace = xx + yy + zz
        det = area_both + gap * (trace + gap)
        is_definite = (trace + 2.0 * gap > 0.0) & (det > 1e-3 * trace * trace)
        inverse = 1.0 / (det if is_definite else trace * trace)
        gradient_factor = inverse * (trace + gap if is_definite else trace)
        matrix_factor = inverse if is_definite else 0.0
        cg_x, cg_y, cg_z = multiply_symmetric(xx, xy, xz, yy, yz, zz, gx, gy, gz)
        sx = gradient_factor * gx - matrix_factor * cg_x
        sy = gradient_factor * gy - matrix_factor * cg_y
        sz = gradient_factor * gz - matrix_factor * cg_z
        # a long step is cut
        cut = LARGEST_TURN * rsqrt(squared_length(sx, sy, sz))
        cut = cut if cut < 1.0 else 1.0
        sx, sy, sz = cut * sx, cut * sy, cut * sz
        write_vector(scratch, STEP, lane, sx, sy, sz)
        scratch[GAP + lane] = gap + 0.5 * dot(gx, gy, gz, sx, sy, sz)


@inlined
def write_contact_points(scratch, contacts):
    """Turn each normal by its step, and compute the contact point.

    The contact point is an expansion at the old normal, to second order in the step.
    Call `write_newton_step` first. Writes the normal (row NORMAL of `contacts`), and the
    vectors from the centres of both bodies to the contact point (rows RA and RB of
    `scratch`).

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    """
    for lane in range(LANES):
        # the normal after the step, of unit length
        sx, sy, sz = lane_vector(scratch, STEP, lane)
        nx, ny, nz = lane_vector(contacts, NORMAL, lane)
        nx, ny, nz = nx + sx, ny + sy, nz + sz
        inverse = rsqrt(squared_length(nx, ny, nz))
        nx, ny, nz = inverse * nx, inverse * ny, inverse * nz
        write_vector(contacts, NORMAL, lane, nx, ny, nz)
        # The step moves the support point of A by its curvature times the step. The
        # contact lies midway between the two support points.
        support_x, support_y, support_z = lane_vector(scratch, SUPPORT, lane)
        xx, xy, xz, yy, yz, zz = lane_matrix(scratch, CURVATURE_A, lane)
        half_gap = 0.5 * scratch[GAP + lane]
        rx = support_x + xx * sx + xy * sy + xz * sz + half_gap * nx
        ry = support_y + xy * sx + yy * sy + yz * sz + half_gap * ny
        rz = support_z + xz * sx + yz * sy + zz * sz + half_gap * nz
        write_vector(scratch, RA, lane, rx, ry, rz)
        # the same point as seen from the centre of B
        centre_a_x, centre_a_y, centre_a_z = lane_vector(scratch, POSITION_A, lane)
        centre_b_x, centre_b_y, centre_b_z = lane_vector(scratch, POSITION_B, lane)
        write_vector(
            scratch,
            RB,
            lane,
            rx + centre_a_x - centre_b_x,
            ry + centre_a_y - centre_b_y,
            rz + centre_a_z - centre_b_z,
        )


@inlined
def write_terms_of_both(scratch, contacts, parts):
    """Write the terms of both bodies that the Newton step needs.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    parts : int
        Number of ellipsoids of a body; a constant in each call.
    """
    write_terms_of_a(scratch, contacts, parts)
    add_terms_of_b(scratch, contacts, parts)


@inlined
def write_sphere_pair_geometry(scratch, contacts):
    """Compute the geometry of 32 pairs of spheres, in closed form.

    Writes the normal (row NORMAL of `contacts`) and the rows of `scratch` that
    `write_pair_geometry` writes, too: GAP, RADIUS, AREA_A, AREA_B, RA and RB. Where two
    centres coincide, the last normal stays.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    """
    for lane in range(LANES):
        # the normal, from the centre of A to that of B
        centre_a_x, centre_a_y, centre_a_z = lane_vector(scratch, POSITION_A, lane)
        centre_b_x, centre_b_y, centre_b_z = lane_vector(scratch, POSITION_B, lane)
        dx, dy, dz = (
            centre_b_x - centre_a_x,
            centre_b_y - centre_a_y,
            centre_b_z - centre_a_z,
        )
        square = squared_length(dx, dy, dz)
        is_apart = square > NEAREST * NEAREST
        inverse = rsqrt(square if is_apart else 1.0)
        nx, ny, nz = lane_vector(contacts, NORMAL, lane)
        nx = inverse * dx if is_apart else nx
        ny = inverse * dy if is_apart else ny
        nz = inverse * dz if is_apart else nz
        write_vector(contacts, NORMAL, lane, nx, ny, nz)
        # gap and radii; the distance of the centres is inverse * square
        radius_a = scratch[SPHERE_RADIUS_A + lane]
        radius_b = scratch[SPHERE_RADIUS_B + lane]
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
def write_pair_geometry(scratch, contacts, parts):
    """Compute gap, effective radius and contact point of each pair of smooth bodies.

    One Newton step from the last normal is enough, since bodies move little in a step.
    There are several short loops instead of one, because a processor runs as many lanes
    at once as its window holds.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    """
    if parts == state.SPHERES:
        write_sphere_pair_geometry(scratch, contacts)
        return
    # The number of parts is a constant in each call, so that the loops are vector code.
    if parts == 1:
        write_terms_of_both(scratch, contacts, 1)
    elif parts == 2:
        write_terms_of_both(scratch, contacts, 2)
    else:
        write_terms_of_both(scratch, contacts, MOST_PARTS)
    write_newton_step(scratch, contacts)
    write_contact_points(scratch, contacts)


@inlined
def write_terms_of_sphere(scratch, contacts):
    """Write the rows SUPPORT and AREA_A where body A of each lane is a sphere.

    It is `write_terms_of_a` in closed form: the outermost point of a sphere lies one
    radius along the normal, and both of its radii of curvature are the radius.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, NORMAL, lane)
        radius = scratch[SPHERE_RADIUS_A + lane]
        write_vector(scratch, SUPPORT, lane, radius * nx, radius * ny, radius * nz)
        scratch[AREA_A + lane] = radius * radius


@inlined
def is_on_disc(contacts, lane, x, y, z, nx, ny, nz):
    """Return whether a place is within a disc, seen along the normal of its plane.

    Parameters
    ----------
    contacts : array
        Tile of contacts with planes; its rows MIDDLE and SQUARED_RADIUS are the disc's
        middle [m] and squared radius [m2], infinite for a plane without an edge.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    x, y, z : float
        The place [m].
    nx, ny, nz : float
        Unit normal of the plane.
    """
    middle_x, middle_y, middle_z = lane_vector(contacts, state.MIDDLE, lane)
    dx, dy, dz = x - middle_x, y - middle_y, z - middle_z
    height = dot(dx, dy, dz, nx, ny, nz)
    # the squared distance from the middle in the plane, by Pythagoras
    square = squared_length(dx, dy, dz) - height * height
    return square <= contacts[state.SQUARED_RADIUS + lane]


@inlined
def write_plane_geometry(scratch, contacts, parts):
    """Compute gap, effective radius and contact point of each body on a plane.

    Writes the rows GAP, RADIUS and RA of `scratch`. Beyond the edge of the plane's disc
    the gap is BEYOND, which is infinite.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    contacts : array
        Tile of the contacts: the plane's normal (row NORMAL, into the wall), its OFFSET
        along the normal, and its disc (MIDDLE, SQUARED_RADIUS).
    parts : int
        Largest number of ellipsoids of a body; SPHERES, -1, if all bodies are spheres.
    """
    # The number of parts is a constant in each call, so that the loop is vector code.
    if parts == state.SPHERES:
        write_terms_of_sphere(scratch, contacts)
    elif parts == 1:
        write_terms_of_a(scratch, contacts, 1)
    elif parts == 2:
        write_terms_of_a(scratch, contacts, 2)
    else:
        write_terms_of_a(scratch, contacts, MOST_PARTS)
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, NORMAL, lane)
        centre_x, centre_y, centre_z = lane_vector(scratch, POSITION_A, lane)
        # the point of the body that is deepest in the wall, from the body's centre
        rx, ry, rz = lane_vector(scratch, SUPPORT, lane)
        gap = (
            contacts[OFFSET + lane]
            - nx * (centre_x + rx)
            - ny * (centre_y + ry)
            - nz * (centre_z + rz)
        )
        # the contact point lies midway between body and plane
        rx, ry, rz = rx + 0.5 * gap * nx, ry + 0.5 * gap * ny, rz + 0.5 * gap * nz
        write_vector(scratch, RA, lane, rx, ry, rz)
        scratch[RADIUS + lane] = math.sqrt(scratch[AREA_A + lane])
        on_disc = is_on_disc(
            contacts, lane, centre_x + rx, centre_y + ry, centre_z + rz, nx, ny, nz
        )
        scratch[GAP + lane] = gap if on_disc else BEYOND


@inlined
def write_torques(scratch):
    """Complete the loads of both bodies of each lane, from the force on A.

    Reads the force on A (row TO_A), the vectors RA and RB from the centres to the
    contact point, and the tangential dashpot (row DASHPOT). Writes the force on B,
    which is the opposite, and of both bodies the torque about the centre and the
    dashpot times its squared arm. The budget of the rolling resistance, the other row
    of a load, belongs to the rolling law.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    """
    torque_row = state.TORQUE * LANES
    dashpots_row = state.DASHPOTS * LANES
    for lane in range(LANES):
        fx, fy, fz = lane_vector(scratch, TO_A, lane)
        dashpot = scratch[DASHPOT + lane]
        # body A: the torque is arm x force
        arm_a_x, arm_a_y, arm_a_z = lane_vector(scratch, RA, lane)
        torque_x, torque_y, torque_z = cross(arm_a_x, arm_a_y, arm_a_z, fx, fy, fz)
        write_vector(scratch, TO_A + torque_row, lane, torque_x, torque_y, torque_z)
        scratch[TO_A + dashpots_row + lane] = dashpot * squared_length(
            arm_a_x, arm_a_y, arm_a_z
        )
        # body B: the opposite force, so the torque is force x arm
        arm_b_x, arm_b_y, arm_b_z = lane_vector(scratch, RB, lane)
        write_vector(scratch, TO_B, lane, -fx, -fy, -fz)
        torque_x, torque_y, torque_z = cross(fx, fy, fz, arm_b_x, arm_b_y, arm_b_z)
        write_vector(scratch, TO_B + torque_row, lane, torque_x, torque_y, torque_z)
        scratch[TO_B + dashpots_row + lane] = dashpot * squared_length(
            arm_b_x, arm_b_y, arm_b_z
        )


@inlined
def count_open_lanes(scratch):
    """Count the lanes of a tile whose bodies are apart: their gap is positive."""
    n_open = 0
    for lane in range(LANES):
        n_open += 1 if scratch[GAP + lane] > 0.0 else 0
    return n_open
