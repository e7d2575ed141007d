"""Contact of one body with one feature of a mesh: a face, a convex edge or vertex.

The gap of a body, or minus its overlap, is the largest value of

    f(n) = n.(point - centre) - h(n) - edge radius

over the normals n of a feature (see `features`). A face has one normal, an edge an arc
of normals, and a vertex a patch of the unit sphere. These sets fit together without
gaps or overlaps, and so do the conditions under which a feature is touched. For
example, a face is touched if the body's outermost point along n lies within the face.

All vectors are in the frame of the mesh. Reads a row of a body and of `Meshes.data`;
writes only `geometry` (see `contact_geometry`).
"""

import math
from collections import namedtuple

from . import contact_geometry
from .contact import DOWNHILL, LEAST_DETERMINANT, LONGEST_STEP
from .contact_geometry import arm_of, write_contact
from .features import (
    EDGE,
    EDGE_ALONG,
    EDGE_ANGLE,
    EDGE_LENGTH,
    EDGE_NORMAL,
    EDGE_TURN,
    FACE,
    FACE_NORMAL,
    FACE_OFFSET,
    PLACE,
    RADIUS_COLUMN,
    SIDE_COLUMNS,
    SIDES,
    STRICT,
)
from .geometry import extent, step_normal, support_terms, tangents
from .jit import inlined, kernel
from .rows import vector_at
from .state import POSITION
from .wall_contact import UPHILL_TURN, effective_radius, limit_turn

# A contact that moves to another feature may lie this far outside the feature [m].
# Otherwise, rounding could end a contact between two features.
SLACK = 1e-8
# The curvature of an edge grows from zero at its faces' normals to its full value over
# this angle [rad], so that R* does not jump when a body rolls from a face to an edge.
BLEND_ANGLE = 0.2
OUTSIDE = -1e300  # distance inside a feature if the body does not touch it
EDGE_ITERATIONS = 40
EDGE_TOLERANCE = 1e-10  # step at which the search about an edge ends [rad]
VERTEX_ITERATIONS = 60
VERTEX_TOLERANCE = 1e-20  # squared step at which the search at a vertex ends

# The value of f at an angle about an edge, its first and second derivatives, and how
# far along the edge the body's outermost point lies [m]
EdgeValues = namedtuple("EdgeValues", "gap slope second_derivative distance_along")


@inlined
def ascent_step(gradient_u, gradient_w, q_uu, q_uw, q_ww, f):
    """Return the step of a normal towards the largest gap from a vertex [rad].

    f is the gap between the body and the vertex along the normal. The step is one of
    Newton's method on the unit sphere. There, the Hessian of f is -(Q + f I): the
    curvature of the body's surface, and that of the sphere of normals. If it is not
    definite, the step is the gradient divided by the trace of Q, a step uphill. A step
    longer than LONGEST_STEP is shortened.

    Parameters
    ----------
    gradient_u, gradient_w : float
        Gradient of f along the tangents u and w [m].
    q_uu, q_uw, q_ww : float
        Curvature matrix Q of the body in these tangents [m].
    f : float
        Value of f [m].

    Returns
    -------
    step_u, step_w : float
        The step along u and w [rad].
    """
    # The matrix A = Q + f I and its determinant. The trace is that of Q, which is
    # always positive, and gives the scale with which the determinant is compared.
    a_uu = q_uu + f
    a_ww = q_ww + f
    determinant = a_uu * a_ww - q_uw * q_uw
    trace = q_uu + q_ww
    is_definite = (
        (a_uu > 0.0)
        and (a_ww > 0.0)
        and (determinant > LEAST_DETERMINANT * trace * trace)
    )
    if is_definite:
        step_u = (a_ww * gradient_u - q_uw * gradient_w) / determinant
        step_w = (a_uu * gradient_w - q_uw * gradient_u) / determinant
    else:
        step_u = gradient_u / trace
        step_w = gradient_w / trace
    length = math.sqrt(step_u * step_u + step_w * step_w)
    if length > LONGEST_STEP:
        step_u *= LONGEST_STEP / length
        step_w *= LONGEST_STEP / length
    return step_u, step_w


@inlined
def blended_curvature(angle, radius):
    """Return the curvature of a rounded edge at an angle from the face's normal.

    It is 0 at the normal and 1 / radius from the angle BLEND_ANGLE on. In between it
    rises smoothly, so that the stiffness of a contact does not jump.

    Parameters
    ----------
    angle : float
        The angle from the normal of the nearest face [rad].
    radius : float
        Radius of the edge [m].
    """
    fraction = min(max(angle, 0.0) / BLEND_ANGLE, 1.0)
    return fraction * fraction * (3.0 - 2.0 * fraction) / radius


@kernel
def write_face_contact(row, parts, face, geometry):
    """Compute the contact of a body with a face of a mesh, and write it to `geometry`.

    A face is a plane with three sides. The contact point is the body's outermost point
    along the normal, moved to the middle of the gap. A point exactly on a side belongs
    to only one of the two faces there: the flag STRICT of a side says that it belongs
    to the neighbour.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    face : array
        The face: a row of `Meshes.data`, whose columns `features` names.
    geometry : array (8,)
        Overwritten with the contact (`contact_geometry`).

    Returns
    -------
    float
        How far inside the triangle the contact point lies [m]; negative outside.
    """
    nx, ny, nz = vector_at(face, FACE_NORMAL)
    x, y, z = vector_at(row, POSITION)
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    # The body's extent h along n, outermost point along u and w, and curvature matrix Q
    h, along_u, along_w, q_uu, q_uw, q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    gap = face[FACE_OFFSET] - (nx * x + ny * y + nz * z + h)
    # A face is flat, so the effective radius is the geometric mean of the body's two
    # principal radii of curvature.
    radius = math.sqrt(q_uu * q_ww - q_uw * q_uw)
    write_contact(
        geometry, nx, ny, nz, gap, radius, h, along_u, along_w, ux, uy, uz, wx, wy, wz
    )
    # Find the distance of the contact point from the nearest side of the triangle. It
    # starts with a number larger than any distance.
    arm_x, arm_y, arm_z = arm_of(geometry)
    point_x, point_y, point_z = x + arm_x, y + arm_y, z + arm_z
    inside_distance = 1e300
    for side in range(3):
        first = SIDES + SIDE_COLUMNS * side
        # The normal of the side, in the plane of the face and into the triangle. The
        # column after it has the offset of the side along this normal.
        side_x, side_y, side_z = vector_at(face, first)
        depth = side_x * point_x + side_y * point_y + side_z * point_z - face[first + 3]
        # A point on a strict side belongs to the neighbour. Any negative number says
        # that it lies outside.
        if depth == 0.0 and face[STRICT + side] > 0.0:
            depth = -1e-300
        inside_distance = min(inside_distance, depth)
    return inside_distance


@inlined
def edge_axes(edge, angle):
    """Return the normal n at an angle about an edge, and its derivative u.

    Parameters
    ----------
    edge : array
        The row of the edge in `Meshes.data`. It contains the normal a of the first face
        and the unit vector b towards which this normal turns.
    angle : float
        Angle of n from the normal of the first face [rad].

    Returns
    -------
    nx, ny, nz, ux, uy, uz : float
        The normal n = a cos(angle) + b sin(angle), and the tangent
        u = b cos(angle) - a sin(angle) towards which it turns.
    """
    cos = math.cos(angle)
    sin = math.sin(angle)
    ax, ay, az = vector_at(edge, EDGE_NORMAL)
    bx, by, bz = vector_at(edge, EDGE_TURN)
    nx, ny, nz = ax * cos + bx * sin, ay * cos + by * sin, az * cos + bz * sin
    ux, uy, uz = bx * cos - ax * sin, by * cos - ay * sin, bz * cos - az * sin
    return nx, ny, nz, ux, uy, uz


@inlined
def edge_support(row, parts, edge, nx, ny, nz, ux, uy, uz):
    """Return the gap to an edge along a normal n, and the support terms of the body.

    The normals of an edge form an arc, and the angle of n in this arc is the variable
    of the derivatives. A turn of n by a small angle moves it towards u: n' = u, and u'
    = -n.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    edge : array (COLUMNS,)
        The edge: a row of `Meshes.data`, whose columns `features` names.
    nx, ny, nz, ux, uy, uz : float
        The normal n, and the tangent u across the edge, towards which n turns
        (`edge_axes`).

    Returns
    -------
    values : EdgeValues
        The gap along n, its first and second derivatives with respect to the angle, and
        the distance along the edge.
    h, along_u, along_w, q_uu, q_uw, q_ww : float
        Support terms of the body, see `geometry.support_terms`; w is along the edge
        [m].
    """
    wx, wy, wz = vector_at(edge, EDGE_ALONG)
    # The body's extent h along n, outermost point along u and w, and curvature matrix Q
    h, along_u, along_w, q_uu, q_uw, q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    start_x, start_y, start_z = vector_at(edge, PLACE)
    x, y, z = vector_at(row, POSITION)
    # (dx, dy, dz) is the vector from the body's centre to the start of the edge.
    dx, dy, dz = start_x - x, start_y - y, start_z - z
    # The gap f = n.d - h to the edge without its rounding (sharp), and its derivative
    # u.(d - x) with respect to the angle, where x is the body's outermost point. The
    # second derivative is -n.(d - x) - u.Q u, which is -(f + q_uu). Along the edge,
    # distances are measured from its start.
    sharp_gap = nx * dx + ny * dy + nz * dz - h
    slope = ux * dx + uy * dy + uz * dz - along_u
    distance_along = along_w - (wx * dx + wy * dy + wz * dz)
    values = EdgeValues(
        sharp_gap - edge[RADIUS_COLUMN], slope, -(sharp_gap + q_uu), distance_along
    )
    return values, h, along_u, along_w, q_uu, q_uw, q_ww


@inlined
def edge_values(row, parts, edge, angle):
    """Return the gap between a body and an edge at an angle, with its derivatives.

    The result is an `EdgeValues`.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    edge : array (COLUMNS,)
        The edge: a row of `Meshes.data`, whose columns `features` names.
    angle : float
        Angle of the normal from that of the first face [rad].
    """
    nx, ny, nz, ux, uy, uz = edge_axes(edge, angle)
    values, _h, _along_u, _along_w, _q_uu, _q_uw, _q_ww = edge_support(
        row, parts, edge, nx, ny, nz, ux, uy, uz
    )
    return values


@kernel
def write_edge_contact(row, parts, edge, angle, geometry):
    """Compute the contact of a body with an edge, and write it to `geometry`.

    The edge has an arc of normals between those of its two faces. The solver has found
    the angle in this arc at which the gap is largest.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    edge : array (COLUMNS,)
        The edge: a row of `Meshes.data`, whose columns `features` names.
    angle : float
        The angle of the largest gap, measured from the normal of the first face [rad].
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far along the edge the contact lies, from the start of the edge [m].
    """
    nx, ny, nz, ux, uy, uz = edge_axes(edge, angle)
    wx, wy, wz = vector_at(edge, EDGE_ALONG)
    values, h, along_u, along_w, q_uu, q_uw, q_ww = edge_support(
        row, parts, edge, nx, ny, nz, ux, uy, uz
    )
    # The curvature grows with the angle from the normal of the nearer face.
    to_face = min(angle, edge[EDGE_ANGLE] - angle)
    edge_curvature = blended_curvature(to_face, edge[RADIUS_COLUMN])
    radius = effective_radius(q_uu, q_uw, q_ww, edge_curvature, 0.0)
    write_contact(
        geometry,
        nx,
        ny,
        nz,
        values.gap,
        radius,
        h,
        along_u,
        along_w,
        ux,
        uy,
        uz,
        wx,
        wy,
        wz,
    )
    return values.distance_along


@inlined
def edge_angle_step(slope, second_derivative):
    """Return the next step of an angle about an edge towards the maximum of f [rad].

    The step is one of Newton's method, or a short step uphill if f is not concave.
    `slope` and `second_derivative` are the derivatives of f with respect to the angle
    [m].
    """
    return (
        -slope / second_derivative
        if second_derivative < 0.0
        else math.copysign(UPHILL_TURN, slope)
    )


@inlined
def climb_edge(row, parts, edge, angle):
    """Return an angle about an edge after one Newton step towards the maximum of f.

    The arguments are those of `edge_values`.
    """
    values = edge_values(row, parts, edge, angle)
    turn = edge_angle_step(values.slope, values.second_derivative)
    return angle + limit_turn(turn)


@kernel
def solve_edge(row, parts, edge, geometry):
    """Find the normal of an edge with the largest gap, and fill `geometry` for it.

    The normals of an edge form an arc between those of its two faces. f is the gap
    between the body and the edge along the normal at an angle in this arc.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    edge : array (COLUMNS,)
        The edge: a row of `Meshes.data`, whose columns `features` names.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    angle : float
        Angle at which the maximum lies [rad].
    inside_distance : float
        How far inside the feature the maximum lies [m]: between the ends of the edge
        and between the normals of its two faces. OUTSIDE if the arc has no maximum.
    largest_gap : float
        The largest f found [m].
    """
    low = 0.0
    high = edge[EDGE_ANGLE]
    # f and its slope at the normals of both faces
    first = edge_values(row, parts, edge, low)
    last = edge_values(row, parts, edge, high)
    largest_gap = max(first.gap, last.gap)
    inside_distance = min(first.slope, -last.slope)
    if inside_distance < -SLACK:
        return 0.0, OUTSIDE, largest_gap
    # If f rises at the first normal and falls at the last one, a maximum lies in
    # between. Otherwise it is at one of the ends.
    if first.slope > 0.0 and last.slope < 0.0:
        angle = 0.5 * high
    elif first.slope <= 0.0:
        angle = 0.0
    else:
        angle = high
    for _ in range(EDGE_ITERATIONS):
        if not (first.slope > 0.0 and last.slope < 0.0):
            break
        values = edge_values(row, parts, edge, angle)
        if values.slope > 0.0:
            low = angle
        else:
            high = angle
        # Newton's method, or bisection if the step would leave the interval
        turn = edge_angle_step(values.slope, values.second_derivative)
        if not low <= angle + turn <= high:
            turn = 0.5 * (low + high) - angle
        angle += turn
        if abs(turn) < EDGE_TOLERANCE:
            break
    # The contact at this angle has to lie between the ends of the edge.
    distance_along = write_edge_contact(row, parts, edge, angle, geometry)
    inside_distance = min(
        inside_distance, min(distance_along, edge[EDGE_LENGTH] - distance_along)
    )
    return angle, inside_distance, max(largest_gap, geometry[contact_geometry.GAP])


@inlined
def vertex_gap_and_step(row, parts, vertex, nx, ny, nz):
    """Return the gap of a body and a rounded vertex along n, and the next step of n.

    The step leads towards the normal of the largest gap. A vertex is rounded: it is a
    sphere with the edge radius. The gap to the sphere's centre, which is called sharp,
    has its maximum at the same normal, so the step is computed from that.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    vertex : array
        The row of the vertex in `Meshes.data`.
    nx, ny, nz : float
        Unit normal n.

    Returns
    -------
    gap : float
        The gap [m].
    step_u, step_w : float
        The step along the two vectors of `geometry.tangents` [rad].
    """
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    # The body's extent h along n, outermost point along u and w, and curvature matrix Q
    h, along_u, along_w, q_uu, q_uw, q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    vertex_x, vertex_y, vertex_z = vector_at(vertex, PLACE)
    x, y, z = vector_at(row, POSITION)
    # (dx, dy, dz) is the vector from the body's centre to the vertex.
    dx, dy, dz = vertex_x - x, vertex_y - y, vertex_z - z
    # The gap without the rounding, and its gradient along the tangents u and w
    sharp_gap = nx * dx + ny * dy + nz * dz - h
    gradient_u = dx * ux + dy * uy + dz * uz - along_u
    gradient_w = dx * wx + dy * wy + dz * wz - along_w
    step_u, step_w = ascent_step(gradient_u, gradient_w, q_uu, q_uw, q_ww, sharp_gap)
    return sharp_gap - vertex[RADIUS_COLUMN], step_u, step_w


@kernel
def write_vertex_contact(row, parts, meshes, feature, nx, ny, nz, geometry):
    """Compute the contact of a body with a vertex, and write it to `geometry`.

    The solver has found the normal of the vertex at which the gap is largest.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    feature : int
        Index of the vertex among all features.
    nx, ny, nz : float
        Unit normal n.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far the normal lies inside the vertex's set of normals, as a sine. This is
        the smallest sine over all edges. It is negative outside the set.
    """
    vertex = meshes.data[feature]
    # Find the edge that is nearest to the normal: the one with the smallest sine. The
    # search starts with a number larger than any sine.
    smallest_sine = 1e300
    ux, uy, uz = 1.0, 0.0, 0.0
    for k in range(meshes.span[feature, 0], meshes.span[feature, 1]):
        ray_x, ray_y, ray_z = vector_at(meshes.rays[k], 0)
        sine = nx * ray_x + ny * ray_y + nz * ray_z
        if sine < smallest_sine:
            smallest_sine = sine
            ux, uy, uz = ray_x, ray_y, ray_z
    # Find the face whose normal is nearest.
    nearest_cosine = -1.0
    for k in range(meshes.corners[feature, 0], meshes.corners[feature, 1]):
        face_x, face_y, face_z = vector_at(meshes.normals[k], 0)
        nearest_cosine = max(nearest_cosine, nx * face_x + ny * face_y + nz * face_z)
    # The tangent u lies along the nearest edge. The curvature along u begins at zero,
    # as on the edge itself. A lower bound avoids a division by zero if the edge is
    # parallel to n.
    along_n = nx * ux + ny * uy + nz * uz
    ux, uy, uz = ux - along_n * nx, uy - along_n * ny, uz - along_n * nz
    inverse_length = 1.0 / math.sqrt(max(ux * ux + uy * uy + uz * uz, 1e-30))
    ux, uy, uz = ux * inverse_length, uy * inverse_length, uz * inverse_length
    wx, wy, wz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    # The body's extent h along n, outermost point along u and w, and curvature matrix Q
    h, along_u, along_w, q_uu, q_uw, q_ww = support_terms(
        row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz
    )
    edge_radius = vertex[RADIUS_COLUMN]
    vertex_x, vertex_y, vertex_z = vector_at(vertex, PLACE)
    x, y, z = vector_at(row, POSITION)
    gap = (
        nx * (vertex_x - x)
        + ny * (vertex_y - y)
        + nz * (vertex_z - z)
        - h
        - edge_radius
    )
    # The curvatures along u and w, from the angles to the nearest face and edge
    to_face = math.acos(min(max(nearest_cosine, -1.0), 1.0))
    to_edge = math.asin(min(max(smallest_sine, 0.0), 1.0))
    wall_curvature_w = blended_curvature(to_face, edge_radius)
    wall_curvature_u = min(wall_curvature_w, blended_curvature(to_edge, edge_radius))
    radius = effective_radius(q_uu, q_uw, q_ww, wall_curvature_u, wall_curvature_w)
    write_contact(
        geometry, nx, ny, nz, gap, radius, h, along_u, along_w, ux, uy, uz, wx, wy, wz
    )
    return smallest_sine


@kernel
def solve_vertex(row, parts, meshes, feature, geometry):
    """Find the normal of a vertex with the largest gap, and fill `geometry` for it.

    f(n) is the gap between the body and the vertex along the normal n. The search
    starts from the direction of the vertex or from the normal of one of its faces,
    whichever has the larger gap. Then Newton's method climbs to the maximum. If it
    needs too many steps, the best normal so far is used.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    feature : int
        Index of the vertex among all features.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    float
        How far inside the vertex's set of normals the maximum lies, as a sine; negative
        outside. See `write_vertex_contact`.
    """
    vertex = meshes.data[feature]
    # (x, y, z) is the vector from the body's centre to the vertex.
    vertex_x, vertex_y, vertex_z = vector_at(vertex, PLACE)
    centre_x, centre_y, centre_z = vector_at(row, POSITION)
    x, y, z = vertex_x - centre_x, vertex_y - centre_y, vertex_z - centre_z
    # Start from the direction of the vertex. The lower bound avoids a division by zero
    # if the body's centre is at the vertex. These gaps leave out the rounding of the
    # vertex, which is the same for all normals.
    inverse_length = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-300)
    best_x, best_y, best_z = x * inverse_length, y * inverse_length, z * inverse_length
    best_gap = (
        x * best_x
        + y * best_y
        + z * best_z
        - extent(row, parts, best_x, best_y, best_z)
    )
    # Compare it with the normals of the faces at the vertex.
    for k in range(meshes.corners[feature, 0], meshes.corners[feature, 1]):
        nx, ny, nz = vector_at(meshes.normals[k], 0)
        gap = x * nx + y * ny + z * nz - extent(row, parts, nx, ny, nz)
        if gap > best_gap:
            best_gap = gap
            best_x, best_y, best_z = nx, ny, nz
    # Make Newton steps from there. `best_gap` becomes the gap with the rounding. A step
    # that makes the gap smaller, by more than rounding errors (DOWNHILL), is halved and
    # tried again.
    best_gap, step_u, step_w = vertex_gap_and_step(
        row, parts, vertex, best_x, best_y, best_z
    )
    for _ in range(VERTEX_ITERATIONS):
        if step_u * step_u + step_w * step_w < VERTEX_TOLERANCE:
            break
        nx, ny, nz = step_normal(best_x, best_y, best_z, step_u, step_w)
        gap, next_u, next_w = vertex_gap_and_step(row, parts, vertex, nx, ny, nz)
        if gap < best_gap - DOWNHILL:
            step_u *= 0.5
            step_w *= 0.5
        else:
            best_gap = gap
            step_u, step_w = next_u, next_w
            best_x, best_y, best_z = nx, ny, nz
    return write_vertex_contact(
        row, parts, meshes, feature, best_x, best_y, best_z, geometry
    )


@inlined
def solve_feature(row, parts, meshes, feature, radius, geometry):
    """Compute the contact of a body with a feature of a mesh.

    A feature is a face, a convex edge or a convex vertex. The contact is written to
    `geometry`. If the bounding sphere of the body does not reach an edge or vertex,
    only the gap is written there, which is then a lower bound.

    Parameters
    ----------
    row : array
        The body in the frame of the mesh, with the columns of `Bodies.rows`.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    meshes : Meshes
        The features (faces, edges and vertices) of all meshes (`features.Meshes`).
    feature : int
        Index of the feature.
    radius : float
        Bounding radius of the body [m]: the distance of its farthest point from its
        centre.
    geometry : array (8,)
        Overwritten with the contact: normal, gap [m], effective radius [m] and arm [m]
        (`contact_geometry`).

    Returns
    -------
    angle : float
        Angle about an edge [rad]; 0.0 for other features.
    inside_distance : float
        How far inside the feature the contact lies [m], for a vertex as a sine times
        `radius`. It is negative outside the feature, and OUTSIDE, a large negative
        number, if there is no contact.
    free_distance : float
        If positive, a lower bound of the distance from the body to the feature [m].
    """
    data = meshes.data[feature]
    if meshes.kind[feature] == FACE:
        inside_distance = write_face_contact(row, parts, data, geometry)
        # If the contact point lies outside the triangle, the inside distance is
        # negative. When the body moves by 1, its deepest point moves by at most 1 +
        # slide, since this point also slides over the body. So the body must move by
        # this quotient before it touches the face.
        free_distance = max(
            geometry[contact_geometry.GAP], -inside_distance / (1.0 + meshes.slide[0])
        )
        return 0.0, inside_distance, free_distance
    is_edge = meshes.kind[feature] == EDGE
    # Return early if the body's bounding sphere does not reach the feature. (x, y, z)
    # is the vector from the body's centre to the nearest point of the feature. The
    # column PLACE is the start of an edge or the position of a vertex.
    nearest_x, nearest_y, nearest_z = vector_at(data, PLACE)
    centre_x, centre_y, centre_z = vector_at(row, POSITION)
    x, y, z = nearest_x - centre_x, nearest_y - centre_y, nearest_z - centre_z
    if is_edge:
        wx, wy, wz = vector_at(data, EDGE_ALONG)
        distance_along = min(max(-(x * wx + y * wy + z * wz), 0.0), data[EDGE_LENGTH])
        x, y, z = (
            x + distance_along * wx,
            y + distance_along * wy,
            z + distance_along * wz,
        )
    distance = math.sqrt(x * x + y * y + z * z) - radius - data[RADIUS_COLUMN]
    geometry[contact_geometry.GAP] = distance
    if distance > 0.0:
        return 0.0, OUTSIDE, distance
    if is_edge:
        angle, inside_distance, largest_gap = solve_edge(row, parts, data, geometry)
        if inside_distance == OUTSIDE:
            geometry[contact_geometry.GAP] = largest_gap
        return angle, inside_distance, largest_gap
    # The sine times the radius is a length, like the distances inside other features.
    # Only its sign and rough size matter.
    sine = solve_vertex(row, parts, meshes, feature, geometry)
    return 0.0, sine * radius, geometry[contact_geometry.GAP]
