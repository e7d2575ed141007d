"""Compute the geometry of 32 contacts of smooth bodies at a time.

`scratch` is the scratch tile, an array of rows of LANES doubles. Each row is a
quantity, and each lane is a contact (see `rows`). The tile holds copies of the two
bodies A and B, followed by the geometry and the forces. `history` is a tile of the
numbers that contacts keep from step to step (`state`). Of these, the functions here
read and write only the normal (row NORMAL), which points from A to B. In a contact with
a wall, A is the body.

Each loop runs over a constant number of lanes, and reads and writes only the two tiles.
It has no branches that depend on a lane, and choices are written as `a if condition
else b`. This allows the compiler to make vector code. Unused lanes hold an absent body,
and their results are not used.
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
# The bodies: one row for each column of `Bodies.rows`. Only pairs have a body B.
A = _rows.take(MOST_COLUMNS)
B = _rows.take(MOST_COLUMNS)
# Rows of the columns that the geometry needs: the centre (3), and the shape.
POSITION_A, POSITION_B = A + state.POSITION * LANES, B + state.POSITION * LANES
SHAPE_A, SHAPE_B = A + state.SHAPE * LANES, B + state.SHAPE * LANES
SPHERE_RADIUS_A = A + state.SPHERE_RADIUS * LANES
SPHERE_RADIUS_B = B + state.SPHERE_RADIUS * LANES
SUPPORT = _rows.take(3)  # support point of A, relative to its centre
SUPPORT_A_TO_B = _rows.take(3)  # from the support point of A to that of B
CURVATURE_A = _rows.take(6)  # curvature matrix of A: xx, xy, xz, yy, yz, zz
CURVATURE_SUM = _rows.take(6)  # sum of the curvature matrices of A and B
AREA_A, AREA_B = _rows.take_each(2)  # product of the principal radii of curvature
GAP = _rows.take()  # negative for an overlap
RADIUS = _rows.take()  # effective radius
RA = _rows.take(3)  # contact point relative to the centre of A
RB = _rows.take(3)  # contact point relative to the centre of B
# The loads on each body, in the order of the columns of `Bodies.load`: force, torque,
# budget of the rolling resistance, and dashpots.
TO_A = _rows.take(LOAD_COLUMNS)
TO_B = _rows.take(LOAD_COLUMNS)
PUSH = _rows.take()  # normal force that limits friction and rolling
# Radius of the contact circle, written by the contact law; 0 if the bodies do not
# touch.
CIRCLE = _rows.take()
# The tangential dashpot [N s/m], written by the contact law, and the fraction of it
# that acts (see `body_rotation.write_dashpot_shares`).
DASHPOT, SHARE = _rows.take_each(2)
STEP = _rows.take(3)  # change of the normal in this step [rad]
V = _rows.take(3)  # tangential velocity of A relative to B
VN = _rows.take()  # normal velocity
# Inverse of the mass in the damping, which is the effective mass of both bodies at the
# contact along the normal, divided by the number of contacts that share it (see
# `damped_mass`).
INVERSE_MASS = _rows.take()
# Rows of the rolling law, which begin with its constants, and then those of the contact
# law
MOST_ROLLING_ROWS = 16
ROLLING = _rows.take(MOST_ROLLING_ROWS)
LAW = _rows.end
LAW_ROW = _rows.count

# The gap of a body beyond the edge of a disc [m]. Its contacts are searched for again
# as soon as it has moved at all.
BEYOND = math.inf
NEAREST = 1e-30  # if centres are nearer than this, they do not define a normal [m]
LARGEST_TURN = 0.2  # largest change of a contact normal in one step [rad]
# The matrix of the Newton step counts as definite when its determinant exceeds this
# fraction of the squared trace of the curvature.
LEAST_DETERMINANT = 1e-3


@inlined
def fill_constants(scratch, first_row, constants):
    """Write the constants of a force law to all lanes of a tile.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    first_row : int
        First row of the law. Constant number c is written to the row c rows after it.
    constants : array
        The constants of the law for one pair of materials.
    """
    for c in range(constants.shape[0]):
        for lane in range(LANES):
            scratch[first_row + c * LANES + lane] = constants[c]


@inlined
def lane_ellipsoid_support(scratch, shape_row, lane, nx, ny, nz):
    """Return support point and curvature matrix of one ellipsoid at the normal n.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    shape_row : int
        First of the six rows with the ellipsoid's matrix (xx, xy, xz, yy, yz, zz).
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    nx, ny, nz : float
        Unit normal n.

    Returns
    -------
    tuple of 9 float
        Support point (3) and curvature matrix (6), see `geometry.ellipsoid_support`.
    """
    xx, xy, xz, yy, yz, zz = lane_matrix(scratch, shape_row, lane)
    return ellipsoid_support(xx, xy, xz, yy, yz, zz, nx, ny, nz)


@inlined
def body_support(scratch, shape_row, parts, lane, nx, ny, nz):
    """Return support point and curvature matrix of a lane's body at the normal n.

    The support point is the body's outermost point along n. A body is a Minkowski sum
    of ellipsoids, its parts, so both results are sums over the parts. The curvature
    matrix holds radii of curvature: in the tangent plane, its eigenvalues are the
    principal radii of curvature of the surface at the support point.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    shape_row : int
        First row of the first part's matrix. Each part has PART rows, and a row has
        LANES numbers.
    parts : int
        Number of ellipsoids, at least 1.
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
    # Begin with the first part, then add the others.
    x, y, z, xx, xy, xz, yy, yz, zz = lane_ellipsoid_support(
        scratch, shape_row, lane, nx, ny, nz
    )
    for part in range(1, parts):
        part_row = shape_row + part * PART * LANES
        dx, dy, dz, dxx, dxy, dxz, dyy, dyz, dzz = lane_ellipsoid_support(
            scratch, part_row, lane, nx, ny, nz
        )
        x, y, z = x + dx, y + dy, z + dz
        xx, xy, xz = xx + dxx, xy + dxy, xz + dxz
        yy, yz, zz = yy + dyy, yz + dyz, zz + dzz
    return x, y, z, xx, xy, xz, yy, yz, zz


@inlined
def write_support_of_a(scratch, history, parts):
    """Write support point and curvature of body A of each lane to the scratch tile.

    Writes the rows SUPPORT (the body's outermost point along the normal, from its
    centre), CURVATURE_A (the curvature matrix there, which holds radii of curvature)
    and AREA_A (the product of the two principal radii of curvature).

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    parts : int
        Number of ellipsoids of a body.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, NORMAL, lane)
        support_x, support_y, support_z, xx, xy, xz, yy, yz, zz = body_support(
            scratch, SHAPE_A, parts, lane, nx, ny, nz
        )
        write_vector(scratch, SUPPORT, lane, support_x, support_y, support_z)
        write_matrix(scratch, CURVATURE_A, lane, xx, xy, xz, yy, yz, zz)
        scratch[AREA_A + lane] = radii_product(xx, xy, xz, yy, yz, zz)


@inlined
def add_support_of_b(scratch, history, parts):
    """Combine support point and curvature of body B of each lane with those of body A.

    The support point of a body is its outermost point along the normal, and its
    curvature matrix holds radii of curvature. Call `write_support_of_a` first, which
    writes the rows SUPPORT and CURVATURE_A. Writes the rows SUPPORT_A_TO_B (vector from
    the support point of A to that of B), CURVATURE_SUM (sum of the two curvature
    matrices) and AREA_B (product of the principal radii of curvature of B).

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    parts : int
        Number of ellipsoids of a body.
    """
    for lane in range(LANES):
        # The normal n points from A to B, so the support point of B is the one along
        # -n. Because bodies are centrally symmetric, this is minus the support point
        # along n, and the curvature is the same.
        nx, ny, nz = lane_vector(history, NORMAL, lane)
        support_b_x, support_b_y, support_b_z, xx, xy, xz, yy, yz, zz = body_support(
            scratch, SHAPE_B, parts, lane, nx, ny, nz
        )
        # The vector from the support point of A to that of B
        centre_a_x, centre_a_y, centre_a_z = lane_vector(scratch, POSITION_A, lane)
        centre_b_x, centre_b_y, centre_b_z = lane_vector(scratch, POSITION_B, lane)
        support_a_x, support_a_y, support_a_z = lane_vector(scratch, SUPPORT, lane)
        between_x = centre_b_x - centre_a_x - support_a_x - support_b_x
        between_y = centre_b_y - centre_a_y - support_a_y - support_b_y
        between_z = centre_b_z - centre_a_z - support_a_z - support_b_z
        write_vector(scratch, SUPPORT_A_TO_B, lane, between_x, between_y, between_z)
        # The product of the radii of curvature of B, and the sum of both matrices
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
def write_newton_step(scratch, history):
    """Compute the Newton step of each pair's normal, and the gap at the new normal.

    The gap f along a normal n is the scalar product of n and the vector between the
    support points. The contact normal is the n with the largest f, where the gradient g
    of f is 0. The step s towards it is one step of Newton's method. Both g and s lie in
    the tangent plane, where the sum C of the curvature matrices of both bodies is a 2 x
    2 matrix. With T = C + f I,

        s = T^-1 g = (tr(T) g - T g) / det(T)

    by the theorem of Cayley and Hamilton, so no tangents are needed. With tr(T) = tr(C)
    + 2 f, the numerator becomes (tr(C) + f) g - C g. The gap at the new normal follows
    from an expansion at the old one: f + g.s / 2.

    Call `write_support_of_a` and `add_support_of_b` first, whose rows are read. Writes
    the rows STEP [rad], GAP [m] and RADIUS (the effective radius [m]). The loop has no
    branches, so that it becomes vector code.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, NORMAL, lane)
        between_x, between_y, between_z = lane_vector(scratch, SUPPORT_A_TO_B, lane)
        xx, xy, xz, yy, yz, zz = lane_matrix(scratch, CURVATURE_SUM, lane)
        # The gap f and its gradient g at the old normal
        gap = dot(nx, ny, nz, between_x, between_y, between_z)
        gx, gy, gz = between_x - gap * nx, between_y - gap * ny, between_z - gap * nz
        # The effective radius sqrt(det C_A det C_B / det(C_A + C_B)). AREA_A and AREA_B
        # are the first two determinants, and rsqrt(x) is 1 / sqrt(x).
        curvature_determinant = radii_product(xx, xy, xz, yy, yz, zz)
        area_product = scratch[AREA_A + lane] * scratch[AREA_B + lane]
        scratch[RADIUS + lane] = area_product * rsqrt(
            area_product * curvature_determinant
        )
        # Compute the step. If T is not definite, take g / tr(C) instead, a step uphill.
        trace = xx + yy + zz
        determinant = curvature_determinant + gap * (trace + gap)
        is_definite = (trace + 2.0 * gap > 0.0) & (
            determinant > LEAST_DETERMINANT * trace * trace
        )
        inverse = 1.0 / (determinant if is_definite else trace * trace)
        gradient_factor = inverse * (trace + gap if is_definite else trace)
        matrix_factor = inverse if is_definite else 0.0
        curvature_g_x, curvature_g_y, curvature_g_z = multiply_symmetric(
            xx, xy, xz, yy, yz, zz, gx, gy, gz
        )
        sx = gradient_factor * gx - matrix_factor * curvature_g_x
        sy = gradient_factor * gy - matrix_factor * curvature_g_y
        sz = gradient_factor * gz - matrix_factor * curvature_g_z
        # Shorten a long step, because the expansion is wrong far from the old normal.
        cut = LARGEST_TURN * rsqrt(squared_length(sx, sy, sz))
        cut = cut if cut < 1.0 else 1.0
        sx, sy, sz = cut * sx, cut * sy, cut * sz
        write_vector(scratch, STEP, lane, sx, sy, sz)
        scratch[GAP + lane] = gap + 0.5 * dot(gx, gy, gz, sx, sy, sz)


@inlined
def write_contact_points(scratch, history):
    """Turn each normal by its step, and compute the contact point.

    Call `write_newton_step` first. The step is small and perpendicular to the normal,
    so it is added to the normal and the sum divided by its length. The contact point
    follows from an expansion at the old normal, to second order in the step. Writes the
    normal (row NORMAL of `history`), and the vectors from the centres of both bodies to
    the contact point (rows RA and RB of `scratch`).

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    """
    for lane in range(LANES):
        # The unit normal after the step
        sx, sy, sz = lane_vector(scratch, STEP, lane)
        nx, ny, nz = lane_vector(history, NORMAL, lane)
        nx, ny, nz = nx + sx, ny + sy, nz + sz
        inverse = rsqrt(squared_length(nx, ny, nz))
        nx, ny, nz = inverse * nx, inverse * ny, inverse * nz
        write_vector(history, NORMAL, lane, nx, ny, nz)
        # The step moves the support point of A by its curvature matrix times the step.
        # The contact point lies half a gap further, midway between the two surfaces.
        support_x, support_y, support_z = lane_vector(scratch, SUPPORT, lane)
        xx, xy, xz, yy, yz, zz = lane_matrix(scratch, CURVATURE_A, lane)
        half_gap = 0.5 * scratch[GAP + lane]
        rx = support_x + xx * sx + xy * sy + xz * sz + half_gap * nx
        ry = support_y + xy * sx + yy * sy + yz * sz + half_gap * ny
        rz = support_z + xz * sx + yz * sy + zz * sz + half_gap * nz
        write_vector(scratch, RA, lane, rx, ry, rz)
        # The same point relative to the centre of B
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
def write_supports(scratch, history, parts):
    """Write the support points and curvatures of both bodies for the Newton step.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    parts : int
        Number of ellipsoids of a body. It must be a constant in the call.
    """
    write_support_of_a(scratch, history, parts)
    add_support_of_b(scratch, history, parts)


@inlined
def write_sphere_pair_geometry(scratch, history):
    """Compute the geometry of LANES pairs of spheres, in closed form.

    Writes the normal (row NORMAL of `history`), and the rows of `scratch`: the gap
    (GAP), the effective radius (RADIUS), for each body the product of its two radii of
    curvature (AREA_A, AREA_B), and the vectors from both centres to the contact point
    (RA, RB). If two centres coincide, the old normal is kept.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    """
    for lane in range(LANES):
        # The normal, from the centre of A to that of B
        centre_a_x, centre_a_y, centre_a_z = lane_vector(scratch, POSITION_A, lane)
        centre_b_x, centre_b_y, centre_b_z = lane_vector(scratch, POSITION_B, lane)
        dx, dy, dz = (
            centre_b_x - centre_a_x,
            centre_b_y - centre_a_y,
            centre_b_z - centre_a_z,
        )
        distance_squared = squared_length(dx, dy, dz)
        # Centres nearer than NEAREST do not define a normal. rsqrt(x) is 1 / sqrt(x).
        is_apart = distance_squared > NEAREST * NEAREST
        inverse_distance = rsqrt(distance_squared if is_apart else 1.0)
        nx, ny, nz = lane_vector(history, NORMAL, lane)
        nx = inverse_distance * dx if is_apart else nx
        ny = inverse_distance * dy if is_apart else ny
        nz = inverse_distance * dz if is_apart else nz
        write_vector(history, NORMAL, lane, nx, ny, nz)
        # The gap and the radii. The distance of the centres is 1 / inverse_distance.
        radius_a = scratch[SPHERE_RADIUS_A + lane]
        radius_b = scratch[SPHERE_RADIUS_B + lane]
        gap = inverse_distance * distance_squared - radius_a - radius_b
        scratch[GAP + lane] = gap
        scratch[RADIUS + lane] = radius_a * radius_b / (radius_a + radius_b)
        scratch[AREA_A + lane] = radius_a * radius_a
        scratch[AREA_B + lane] = radius_b * radius_b
        # The contact point lies midway between the two surfaces.
        arm_a = radius_a + 0.5 * gap
        write_vector(scratch, RA, lane, arm_a * nx, arm_a * ny, arm_a * nz)
        arm_b = -(radius_b + 0.5 * gap)
        write_vector(scratch, RB, lane, arm_b * nx, arm_b * ny, arm_b * nz)


@inlined
def write_pair_geometry(scratch, history, parts):
    """Compute gap, effective radius and contact point of each pair of smooth bodies.

    One Newton step from the last normal is enough, because bodies move little in a
    step. The functions called here pass their results on in rows of `scratch`, so their
    order is fixed. Several short loops are faster than a single one, because the
    processor can overlap more iterations of a short loop.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    """
    if parts == state.SPHERES:
        write_sphere_pair_geometry(scratch, history)
        return
    # Pass the number of parts as a literal, so that the compiler can unroll the loop
    # over the parts and vectorise the loop over the lanes.
    if parts == 1:
        write_supports(scratch, history, 1)
    elif parts == 2:
        write_supports(scratch, history, 2)
    else:
        write_supports(scratch, history, MOST_PARTS)
    write_newton_step(scratch, history)
    write_contact_points(scratch, history)


@inlined
def write_support_of_sphere(scratch, history):
    """Write support point and curvature of body A of each lane, which is a sphere.

    This is `write_support_of_a` in closed form. The outermost point of a sphere lies
    one radius along the normal, and both radii of curvature are the radius. Writes the
    rows SUPPORT and AREA_A.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    """
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, NORMAL, lane)
        radius = scratch[SPHERE_RADIUS_A + lane]
        write_vector(scratch, SUPPORT, lane, radius * nx, radius * ny, radius * nz)
        scratch[AREA_A + lane] = radius * radius


@inlined
def is_on_disc(history, lane, x, y, z, nx, ny, nz):
    """Return whether a point, projected onto the plane of a disc, lies on the disc.

    Parameters
    ----------
    history : array
        Tile of contacts with planes. Its rows MIDDLE and SQUARED_RADIUS are the disc's
        centre [m] and squared radius [m2]. The latter is infinite for a plane without
        an edge.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    x, y, z : float
        The point [m].
    nx, ny, nz : float
        Unit normal of the plane.
    """
    middle_x, middle_y, middle_z = lane_vector(history, state.MIDDLE, lane)
    dx, dy, dz = x - middle_x, y - middle_y, z - middle_z
    height = dot(dx, dy, dz, nx, ny, nz)
    # The squared distance from the centre in the plane, by Pythagoras' theorem
    square = squared_length(dx, dy, dz) - height * height
    return square <= history[state.SQUARED_RADIUS + lane]


@inlined
def write_plane_geometry(scratch, history, parts):
    """Compute gap, effective radius and contact point of each body on a plane.

    Writes the rows GAP, RADIUS and RA of `scratch`. RA is the vector from the centre of
    the body to the contact point. Beyond the edge of the plane's disc, the gap is
    BEYOND, which is infinite.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array
        Tile of the contacts, one contact in each lane. It has a copy of each contact's
        plane: the normal into the wall (row NORMAL), its OFFSET along the normal, and
        its disc (MIDDLE, SQUARED_RADIUS).
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    """
    # Write the rows SUPPORT (the body's outermost point along the normal) and AREA_A
    # (the product of its radii of curvature there), which the loop below reads. The
    # number of parts is a literal, so that the compiler can unroll and vectorise the
    # loops.
    if parts == state.SPHERES:
        write_support_of_sphere(scratch, history)
    elif parts == 1:
        write_support_of_a(scratch, history, 1)
    elif parts == 2:
        write_support_of_a(scratch, history, 2)
    else:
        write_support_of_a(scratch, history, MOST_PARTS)
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, NORMAL, lane)
        centre_x, centre_y, centre_z = lane_vector(scratch, POSITION_A, lane)
        # The body's deepest point in the wall, relative to the centre of the body
        rx, ry, rz = lane_vector(scratch, SUPPORT, lane)
        gap = (
            history[OFFSET + lane]
            - nx * (centre_x + rx)
            - ny * (centre_y + ry)
            - nz * (centre_z + rz)
        )
        # The contact point lies midway between body and plane.
        rx, ry, rz = rx + 0.5 * gap * nx, ry + 0.5 * gap * ny, rz + 0.5 * gap * nz
        write_vector(scratch, RA, lane, rx, ry, rz)
        # A plane has no curvature, so the effective radius is the geometric mean of the
        # body's two radii of curvature.
        scratch[RADIUS + lane] = math.sqrt(scratch[AREA_A + lane])
        on_disc = is_on_disc(
            history, lane, centre_x + rx, centre_y + ry, centre_z + rz, nx, ny, nz
        )
        scratch[GAP + lane] = gap if on_disc else BEYOND


@inlined
def write_torques(scratch):
    """Compute the torques on both bodies of each lane, and the force on B.

    Reads the force on A (row TO_A), the vectors RA and RB from the centres to the
    contact point, and the tangential dashpot (row DASHPOT). From TO_A and TO_B on, the
    tile has the loads of the two bodies, a row for each column of `Bodies.load`. Of
    these, the function writes the force on B, which is opposite to that on A, and for
    both bodies the torque about the centre and the dashpot times the squared length of
    its arm. The sum of the latter over the contacts of a body tells how strongly the
    dashpots brake its rotation. The last quantity of a load, the budget of the rolling
    resistance, is written by the rolling law.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    """
    torque_row = state.TORQUE * LANES
    dashpots_row = state.DASHPOTS * LANES
    for lane in range(LANES):
        fx, fy, fz = lane_vector(scratch, TO_A, lane)
        dashpot = scratch[DASHPOT + lane]
        # Body A: the torque is arm x force.
        arm_a_x, arm_a_y, arm_a_z = lane_vector(scratch, RA, lane)
        torque_x, torque_y, torque_z = cross(arm_a_x, arm_a_y, arm_a_z, fx, fy, fz)
        write_vector(scratch, TO_A + torque_row, lane, torque_x, torque_y, torque_z)
        scratch[TO_A + dashpots_row + lane] = dashpot * squared_length(
            arm_a_x, arm_a_y, arm_a_z
        )
        # Body B: the force is opposite, so the torque is force x arm.
        arm_b_x, arm_b_y, arm_b_z = lane_vector(scratch, RB, lane)
        write_vector(scratch, TO_B, lane, -fx, -fy, -fz)
        torque_x, torque_y, torque_z = cross(fx, fy, fz, arm_b_x, arm_b_y, arm_b_z)
        write_vector(scratch, TO_B + torque_row, lane, torque_x, torque_y, torque_z)
        scratch[TO_B + dashpots_row + lane] = dashpot * squared_length(
            arm_b_x, arm_b_y, arm_b_z
        )


@inlined
def count_open_lanes(scratch):
    """Count the lanes of a tile with a positive gap, whose bodies are apart."""
    n_open = 0
    for lane in range(LANES):
        n_open += 1 if scratch[GAP + lane] > 0.0 else 0
    return n_open
