"""Contact of a body with a curved wall: the inside of a cone or tube, or a ring edge.

Cones. The inside of a cone or tube is convex, since it is an intersection of
half-spaces whose normals m(theta) are rotated about the axis. Therefore the overlap of
a body is the maximum of

    phi(theta) = m.c + h(m) - k

over the angle theta, where c is the centre of the body, h its support value, and k the
offset of the cone's line. A long body in a narrow tube has two maxima and two contacts.

Rings. The edge at the end of a cone is a torus with a small radius that is tangent to
the cone. The overlap follows from the point on the torus's central circle that is
nearest to the body. It is found by a search over the angle theta of this point and the
normal n.

The projection of the contact point onto the wall decides whether a body touches the
cone or the ring. Therefore force and overlap are continuous, and no gap is left between
the two.

Everything here is in the frame of the wall, whose z axis is the wall's axis (`frames`).
Reads a row of a body and a row of `Walls.cones` or `Walls.rings`; writes only
`geometry` (see `contact_geometry`).
"""

import math

from .contact import LEAST_DETERMINANT, LONGEST_STEP
from .contact_geometry import ARM, RADIUS, write_contact, write_sphere_contact
from .geometry import support_terms, tangents
from .jit import inlined, kernel
from .rows import vector_at
from .state import (
    CONE_END,
    CONE_NORMAL_R,
    CONE_NORMAL_Z,
    CONE_OFFSET,
    CONE_START,
    CONE_UP_R,
    CONE_UP_Z,
    POSITION,
    RING_EDGE_RADIUS,
    RING_GATE_A_R,
    RING_GATE_A_Z,
    RING_GATE_B_R,
    RING_GATE_B_Z,
    RING_HEIGHT,
    RING_RADIUS,
)

# If a concave wall is nearly as curved as the body, the relative curvature is set to at
# least this fraction of the body's curvature, so that R* stays finite.
LEAST_RELATIVE_CURVATURE = 0.1
LEAST_DISTANCE = 1e-30  # points nearer than this do not define a direction [m]
# Smallest radius of a cone's circle at a contact [m]. It avoids the infinite curvature
# at the tip.
SMALLEST_CIRCLE = 1e-6
# Steps of theta [rad]: the longest one, and the step uphill that is made if the
# function is not concave, so that Newton's method would go to a minimum.
LONGEST_TURN = 0.2
UPHILL_TURN = 0.05
# Second derivatives below this value are too uncertain for Newton's method [m].
LEAST_SECOND_DERIVATIVE = 1e-7
MOST_ITERATIONS = 40
STEP_TOLERANCE = 1e-9  # step below which a search ends [rad]


@inlined
def effective_radius(q_uu, q_uw, q_ww, wall_curvature_u, wall_curvature_w):
    """Return the effective radius R* of a body on a wall [m]: 1 / R*^2 = det(Q^-1 + K).

    Parameters
    ----------
    q_uu, q_uw, q_ww : float
        Curvature matrix Q of the body in the tangents u and w [m].
    wall_curvature_u, wall_curvature_w : float
        Principal curvatures of the wall along u and w, the diagonal of K [1/m]. They
        are negative if the wall is concave.
    """
    determinant = q_uu * q_ww - q_uw * q_uw
    relative = (
        1.0
        + q_uu * wall_curvature_u
        + q_ww * wall_curvature_w
        + determinant * wall_curvature_u * wall_curvature_w
    )
    return math.sqrt(determinant / max(relative, LEAST_RELATIVE_CURVATURE))


@inlined
def limit_turn(turn):
    """Return a step of an angle [rad], limited to LONGEST_TURN in both directions."""
    return min(max(turn, -LONGEST_TURN), LONGEST_TURN)


@inlined
def cone_axes(cone, theta):
    """Return cos(theta), sin(theta) and the unit vectors n, u and w of a cone at theta.

    theta is the angle about the cone's axis. The normal n points into the wall, the
    tangent u along the circle about the axis, and the tangent w along the line of the
    cone, its generatrix. The z component of u is zero. The eleven results are cos, sin,
    then the components of n, u and w.

    Parameters
    ----------
    cone : array (CONE_COLUMNS,)
        The cone: a row of `Walls.cones`.
    theta : float
        The angle about the axis of the cone [rad].
    """
    cos = math.cos(theta)
    sin = math.sin(theta)
    normal_r = cone[CONE_NORMAL_R]
    normal_z = cone[CONE_NORMAL_Z]
    # In the half plane (r, z) at this angle, n is (normal_r, normal_z) and w is
    # (-normal_z, normal_r); u is perpendicular to this half plane.
    nx, ny, nz = normal_r * cos, normal_r * sin, normal_z
    ux, uy, uz = -sin, cos, 0.0
    wx, wy, wz = -normal_z * cos, -normal_z * sin, normal_r
    return cos, sin, nx, ny, nz, ux, uy, uz, wx, wy, wz


@inlined
def cone_derivatives(row, parts, cone, theta):
    """Return the first and second derivatives of a body's overlap with a cone.

    The overlap phi is a function of the angle theta about the cone's axis. At theta, n
    is the normal into the wall, u the tangent along the circle about the axis, and w
    the tangent along the line of the cone. With the body's outermost point p along n
    and the component m_r of n away from the axis, phi = n.p - k. Since dn/dtheta = m_r
    u,

        phi'  = m_r u.p
        phi'' = m_r^2 u.Q u - m_r (cos, sin).p

    where Q is the curvature matrix of the body.

    Parameters
    ----------
    row : array
        The body in the frame of the cone, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    cone : array (CONE_COLUMNS,)
        The cone: a row of `Walls.cones`.
    theta : float
        The angle [rad].

    Returns
    -------
    slope, second_derivative : float
        First and second derivatives of phi with respect to the angle [m].
    """
    cos, sin, nx, ny, nz, ux, uy, uz, wx, wy, wz = cone_axes(cone, theta)
    normal_r = cone[CONE_NORMAL_R]
    x, y, _z = vector_at(row, POSITION)
    # The body's extent h along n, outermost point along u and w, and curvature matrix Q
    h, along_u, along_w, q_uu, _q_uw, _q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    # The x and y coordinates of the body's outermost point along n
    px = x + h * nx + along_u * ux + along_w * wx
    py = y + h * ny + along_u * uy + along_w * wy
    # The derivatives of the docstring; m_r is `normal_r`.
    slope = normal_r * (ux * px + uy * py)
    second_derivative = normal_r * normal_r * q_uu - normal_r * (cos * px + sin * py)
    return slope, second_derivative


@inlined
def climb_cone(row, parts, cone, theta):
    """Return an angle after one Newton step towards the nearest maximum of the overlap.

    Parameters
    ----------
    row : array
        The body in the frame of the cone, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    cone : array (CONE_COLUMNS,)
        The cone: a row of `Walls.cones`.
    theta : float
        The angle about the cone's axis before the step [rad].
    """
    slope, second_derivative = cone_derivatives(row, parts, cone, theta)
    # Make a Newton step, or a short step uphill if phi is nearly flat or not concave.
    turn = (
        -slope / second_derivative
        if second_derivative < -LEAST_SECOND_DERIVATIVE
        else math.copysign(UPHILL_TURN, slope)
    )
    return theta + limit_turn(turn)


@kernel
def write_cone_contact(row, parts, cone, theta, geometry):
    """Compute the contact of a body with a cone, and write it to `geometry`.

    The solver has found the angle about the axis at which the overlap is largest.
    Columns CONE_NORMAL and CONE_UP of the cone are the normal and the unit vector up
    along the cone's line, in the half plane (r, z) at this angle.

    Parameters
    ----------
    row : array
        The body in the frame of the cone, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    cone : array (CONE_COLUMNS,)
        The cone: a row of `Walls.cones`.
    theta : float
        Angle about the cone's axis at which the overlap is largest [rad].
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    bool
        Whether the contact point lies on the wall, between its two ends.
    """
    cos, sin, nx, ny, nz, ux, uy, uz, wx, wy, wz = cone_axes(cone, theta)
    x, y, z = vector_at(row, POSITION)
    # The body's extent h along n, outermost point along u and w, and curvature matrix Q
    h, along_u, along_w, q_uu, q_uw, q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    gap = cone[CONE_OFFSET] - (nx * x + ny * y + nz * z + h)
    # The effective radius depends on the contact point, so it is 0.0 here and is
    # written below.
    write_contact(
        geometry, nx, ny, nz, gap, 0.0, h, along_u, along_w, ux, uy, uz, wx, wy, wz
    )

    # (px, py, pz) is the contact point: the centre plus the arm. `distance` is its
    # distance from the axis.
    px, py, pz = x + geometry[ARM], y + geometry[ARM + 1], z + geometry[ARM + 2]
    distance = max(cos * px + sin * py, SMALLEST_CIRCLE)
    # A cone is concave, so its curvature along the circle is negative.
    wall_curvature_u = -cone[CONE_NORMAL_R] / distance
    geometry[RADIUS] = effective_radius(q_uu, q_uw, q_ww, wall_curvature_u, 0.0)

    # The distance of the contact point along the line of the cone
    distance_along = distance * cone[CONE_UP_R] + pz * cone[CONE_UP_Z]
    return distance_along >= cone[CONE_START] and distance_along <= cone[CONE_END]


@inlined
def make_ring_step(row, parts, ring, theta, nx, ny, nz):
    """Make one Newton step towards the point of a ring's circle nearest to a body.

    The unknowns are the angle theta of the nearest point on the circle and the normal
    n, which changes by a step (step_u, step_w) in its tangent plane. The equations for
    n are eliminated, so that one equation for theta remains.

    Parameters
    ----------
    row : array
        The body in the frame of the ring, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    ring : array (RING_COLUMNS,)
        The ring: a row of `Walls.rings`.
    theta : float
        Angle of the point on the circle before the step [rad].
    nx, ny, nz : float
        Unit normal before the step, from the body to the circle.

    Returns
    -------
    theta, nx, ny, nz : float
        The unknowns after the step.
    step : float
        Length of the step [rad].
    """
    cos = math.cos(theta)
    sin = math.sin(theta)
    radius = ring[RING_RADIUS]
    x, y, z = vector_at(row, POSITION)
    dx, dy, dz = radius * cos - x, radius * sin - y, ring[RING_HEIGHT] - z
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    # The body's extent h along n, outermost point along u and w, and curvature matrix Q
    h, along_u, along_w, q_uu, q_uw, q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    # The distance f between body and circle, and its gradient along u and w
    f = nx * dx + ny * dy + nz * dz - h
    gradient_u = dx * ux + dy * uy + dz * uz - along_u
    gradient_w = dx * wx + dy * wy + dz * wz - along_w
    # Derivatives of f with respect to theta. (tx, ty) is that of the point on the
    # circle.
    tx, ty = -radius * sin, radius * cos
    slope = nx * tx + ny * ty
    second_derivative = -radius * (nx * cos + ny * sin)
    # Mixed derivatives, which say how the gradient along u and w changes with theta
    mixed_u = ux * tx + uy * ty
    mixed_w = wx * tx + wy * ty
    # The equations for n have the matrix A = Q + f I. If it is not positive definite,
    # use a multiple of the unit matrix.
    a_uu = q_uu + f
    a_ww = q_ww + f
    trace = q_uu + q_ww
    determinant = a_uu * a_ww - q_uw * q_uw
    if not (
        a_uu > 0.0 and a_ww > 0.0 and determinant > LEAST_DETERMINANT * trace * trace
    ):
        a_uu = trace
        a_ww = trace
        q_uw = 0.0
        determinant = a_uu * a_ww
    # Eliminate n: its step is A^-1 (gradient + mixed * turn), where `turn` is the step
    # of theta. The response of n to theta is A^-1 mixed. Then solve for `turn`.
    response_u = (a_ww * mixed_u - q_uw * mixed_w) / determinant
    response_w = (a_uu * mixed_w - q_uw * mixed_u) / determinant
    reduced_second_derivative = (
        second_derivative + mixed_u * response_u + mixed_w * response_w
    )
    reduced_slope = slope + gradient_u * response_u + gradient_w * response_w
    if reduced_second_derivative > LEAST_SECOND_DERIVATIVE:
        turn = -reduced_slope / reduced_second_derivative
    else:
        turn = -math.copysign(UPHILL_TURN, reduced_slope)
    turn = limit_turn(turn)
    # The step (step_u, step_w) of n that follows from this step of theta
    gradient_u = gradient_u + mixed_u * turn
    gradient_w = gradient_w + mixed_w * turn
    step_u = (a_ww * gradient_u - q_uw * gradient_w) / determinant
    step_w = (a_uu * gradient_w - q_uw * gradient_u) / determinant
    step_length = math.sqrt(step_u * step_u + step_w * step_w)
    if step_length > LONGEST_STEP:
        step_u *= LONGEST_STEP / step_length
        step_w *= LONGEST_STEP / step_length
    new_x = nx + step_u * ux + step_w * wx
    new_y = ny + step_u * uy + step_w * wy
    new_z = nz + step_u * uz + step_w * wz
    inverse_length = 1.0 / math.sqrt(new_x * new_x + new_y * new_y + new_z * new_z)
    return (
        theta + turn,
        new_x * inverse_length,
        new_y * inverse_length,
        new_z * inverse_length,
        abs(turn) + step_length,
    )


@inlined
def ring_curvatures(ring, outward):
    """Return the curvatures of a ring edge along its circle and across it [1/m].

    Parameters
    ----------
    ring : array (RING_COLUMNS,)
        The ring: a row of `Walls.rings`.
    outward : float
        Component of the contact's unit normal away from the axis.
    """
    edge_radius = ring[RING_EDGE_RADIUS]
    circle_radius = max(ring[RING_RADIUS] - edge_radius * outward, edge_radius)
    return -outward / circle_radius, 1.0 / edge_radius


@kernel
def write_ring_contact(row, parts, ring, theta, nx, ny, nz, geometry):
    """Compute the contact of a body with a ring edge, and write it to `geometry`.

    A ring edge is a torus. Bodies can only touch the open part of it, between the two
    adjoining walls. The ring has two vectors (r, z) called gates. On the open part, the
    normal has no negative component along either gate.

    Parameters
    ----------
    row : array
        The body in the frame of the ring, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    ring : array (RING_COLUMNS,)
        The ring: a row of `Walls.rings`.
    theta : float
        Angle about the axis at which the central circle of the torus is nearest to the
        body, as found by the solver [rad].
    nx, ny, nz : float
        Unit normal n, from the body into the wall.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    bool
        Whether the contact lies on the open part of the edge. The rest of the torus is
        behind the adjoining walls.
    """
    cos = math.cos(theta)
    sin = math.sin(theta)
    x, y, z = vector_at(row, POSITION)
    # Tangents of the body: u is the direction of the circle, made perpendicular to the
    # normal, and w is perpendicular to both.
    ux, uy, uz = -sin, cos, 0.0
    along_n = ux * nx + uy * ny
    ux, uy, uz = ux - along_n * nx, uy - along_n * ny, uz - along_n * nz
    inverse_length = 1.0 / math.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux * inverse_length, uy * inverse_length, uz * inverse_length
    wx, wy, wz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    # The body's extent h along n, outermost point along u and w, and curvature matrix Q
    h, along_u, along_w, q_uu, q_uw, q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    # The distance from the body's surface to the central circle of the torus, minus the
    # radius of the edge
    gap = (
        nx * (ring[RING_RADIUS] * cos - x)
        + ny * (ring[RING_RADIUS] * sin - y)
        + nz * (ring[RING_HEIGHT] - z)
        - h
        - ring[RING_EDGE_RADIUS]
    )
    outward = nx * cos + ny * sin  # component of n away from the axis
    wall_curvature_u, wall_curvature_w = ring_curvatures(ring, outward)
    radius = effective_radius(q_uu, q_uw, q_ww, wall_curvature_u, wall_curvature_w)
    write_contact(
        geometry, nx, ny, nz, gap, radius, h, along_u, along_w, ux, uy, uz, wx, wy, wz
    )
    # The scalar products of the normal with both gates, in the half plane (r, z)
    return (
        outward * ring[RING_GATE_A_R] + nz * ring[RING_GATE_A_Z] >= 0.0
        and outward * ring[RING_GATE_B_R] + nz * ring[RING_GATE_B_Z] >= 0.0
    )


@inlined
def solve_cone(row, parts, cone, theta):
    """Find the maximum of the overlap with a cone near a starting angle.

    Parameters
    ----------
    row : array
        The body in the frame of the cone, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    cone : array (CONE_COLUMNS,)
        The cone: a row of `Walls.cones`.
    theta : float
        Angle about the cone's axis at the start [rad].

    Returns
    -------
    float
        The angle of the maximum [rad].
    """
    for _ in range(MOST_ITERATIONS):
        turn = climb_cone(row, parts, cone, theta) - theta
        theta += turn
        if abs(turn) < STEP_TOLERANCE:
            break
    return theta


@inlined
def solve_ring(row, parts, ring, theta, nx, ny, nz):
    """Return angle and normal (theta, nx, ny, nz) of a ring's point nearest to a body.

    The search starts from the arguments, which are those of `make_ring_step`.
    """
    for _ in range(MOST_ITERATIONS):
        theta, nx, ny, nz, step = make_ring_step(row, parts, ring, theta, nx, ny, nz)
        if step < STEP_TOLERANCE:
            break
    return theta, nx, ny, nz


@inlined
def polar_coordinates(x, y):
    """Return the distance of a point from the axis [m], and cos and sin of its azimuth.

    (x, y) is the projection of the point along the axis. The azimuth of a point on the
    axis is 0.
    """
    distance = math.sqrt(x * x + y * y)
    inverse = 1.0 / max(distance, LEAST_DISTANCE)
    cos, sin = (x * inverse, y * inverse) if distance > LEAST_DISTANCE else (1.0, 0.0)
    return distance, cos, sin


@inlined
def write_sphere_cone_contact(x, y, z, radius, cone, geometry):
    """Compute the contact of a sphere with a cone, and write it to `geometry`.

    The solution is in closed form. In the half plane (r, z) from the axis through the
    centre of the sphere, the cone is a line, whose normal points into the wall, away
    from the axis.

    Parameters
    ----------
    x, y, z, radius : float
        Centre of the sphere in the frame of the cone, and its radius [m].
    cone : array (CONE_COLUMNS,)
        The cone: a row of `Walls.cones`.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far the sphere's centre is beyond the wall's ends, measured along the line
        of the cone [m]; negative between them.
    """
    # Work in the half plane from the axis through the centre of the sphere.
    distance, cos, sin = polar_coordinates(x, y)
    normal_r = cone[CONE_NORMAL_R]
    normal_z = cone[CONE_NORMAL_Z]
    gap = cone[CONE_OFFSET] - normal_r * distance - normal_z * z - radius
    # A cone is concave, so its curvature along the circle about the axis is negative.
    # `circle_radius` is the distance of the contact point from the axis; the point lies
    # half a gap beyond the sphere's surface. Along its line, a cone has no curvature.
    circle_radius = max(distance + (radius + 0.5 * gap) * normal_r, SMALLEST_CIRCLE)
    # A sphere has the curvature matrix radius * I.
    contact_radius = effective_radius(
        radius, 0.0, radius, -normal_r / circle_radius, 0.0
    )
    write_sphere_contact(
        geometry, normal_r * cos, normal_r * sin, normal_z, gap, contact_radius, radius
    )
    # The distance of the sphere's centre along the line of the cone
    distance_along = distance * cone[CONE_UP_R] + z * cone[CONE_UP_Z]
    return max(cone[CONE_START] - distance_along, distance_along - cone[CONE_END])


@inlined
def write_sphere_ring_contact(x, y, z, radius, ring, geometry):
    """Compute the contact of a sphere with a ring edge, and write it to `geometry`.

    The solution is in closed form. A ring edge is a torus. Bodies can only touch the
    open part of it, between the two adjoining walls. The ring has two vectors (r, z)
    called gates. On the open part, the normal has no negative component along either
    gate.

    Parameters
    ----------
    x, y, z, radius : float
        Centre of the sphere in the frame of the ring, and its radius [m].
    ring : array (RING_COLUMNS,)
        The ring: a row of `Walls.rings`.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        A lower bound of the distance to the open part of the edge [m]. It is not
        positive on this part.
    """
    # The vector from the sphere's centre to the circle, in the half plane of the sphere
    distance, cos, sin = polar_coordinates(x, y)
    dr = ring[RING_RADIUS] - distance
    dz = ring[RING_HEIGHT] - z
    to_circle = math.sqrt(dr * dr + dz * dz)
    inverse_length = 1.0 / max(to_circle, LEAST_DISTANCE)
    nr, nz = dr * inverse_length, dz * inverse_length  # the normal
    # The curvatures of the edge at this normal, then R* and the gap
    wall_curvature_u, wall_curvature_w = ring_curvatures(ring, nr)
    # A sphere has the curvature matrix radius * I.
    contact_radius = effective_radius(
        radius, 0.0, radius, wall_curvature_u, wall_curvature_w
    )
    gap = to_circle - radius - ring[RING_EDGE_RADIUS]
    write_sphere_contact(geometry, nr * cos, nr * sin, nz, gap, contact_radius, radius)
    # On the open part of the edge, the vector to the circle has no negative component
    # along either gate, so the result is not positive. Elsewhere it is the largest part
    # that points away from a gate: the sphere must move by at least this distance.
    return -min(
        dr * ring[RING_GATE_A_R] + dz * ring[RING_GATE_A_Z],
        dr * ring[RING_GATE_B_R] + dz * ring[RING_GATE_B_Z],
    )
