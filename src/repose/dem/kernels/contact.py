"""Find the gap between two smooth bodies by Newton's method on the contact normal.

Let d = c_B - c_A be the vector between the centres, h the support functions of the
bodies, and f(n) = n.d - h_A(n) - h_B(-n). The maximum of f over all unit vectors n is
the gap; a negative maximum is an overlap. The n of the maximum is the contact normal
from A to B. All bodies here are centrally symmetric, so h_B(-n) = h_B(n). The
tangential gradient of f is P (d - x_A(n) - x_B(n)), where x are the support points and
P is the projection onto the tangent plane. The Hessian is -(Q_A + Q_B + f I), where Q
are the curvature matrices.

The functions read rows of `Bodies.rows` and write only the array `normal`.
"""

import math

from .geometry import add_part, radii_product
from .jit import inlined, kernel
from .rows import set_vector, vector_at
from .state import POSITION, SPHERE_RADIUS, SPHERES

# Longer steps [rad] are cut, because the quadratic model of f is wrong there.
LONGEST_STEP = 0.4
MOST_ITERATIONS = 60
# A step went downhill if it reduced f [m] by more than this, which allows for rounding.
DOWNHILL = 1e-15
# The Hessian counts as definite when its determinant exceeds this fraction of the
# squared trace of the curvature.
LEAST_DETERMINANT = 1e-3


@inlined
def newton_step(gx, gy, gz, xx, xy, xz, yy, yz, zz, f):
    """Return the step (x, y, z) of a normal towards the maximum of f [rad].

    f is the gap of two bodies along the normal. This is a step of Newton's method on
    the unit sphere, in the tangent plane. If the Hessian is not definite, it is a
    scaled gradient step instead. A step longer than LONGEST_STEP is shortened to this
    length.

    Parameters
    ----------
    gx, gy, gz : float
        Gradient of f in the tangent plane [m].
    xx, xy, xz, yy, yz, zz : float
        Sum C of the curvature matrices of both bodies [m], a symmetric matrix.
    f : float
        Value of f [m].

    Returns
    -------
    sx, sy, sz : float
        The step in the tangent plane [rad].
    """
    trace = xx + yy + zz
    # The determinant of C + f I in the tangent plane. `radii_product` is that of C.
    determinant = radii_product(xx, xy, xz, yy, yz, zz) + f * (trace + f)
    if trace + 2.0 * f > 0.0 and determinant > LEAST_DETERMINANT * trace * trace:
        # The step is T^-1 g. T = C + f I is a 2 x 2 matrix in the tangent plane, so by
        # the theorem of Cayley and Hamilton T^-1 g = (tr(T) g - T g) / det(T). With
        # tr(T) = tr(C) + 2 f, the numerator is (tr(C) + f) g - C g. No tangents are
        # needed.
        inverse = 1.0 / determinant
        gradient_factor = trace + f
        sx = inverse * (gradient_factor * gx - xx * gx - xy * gy - xz * gz)
        sy = inverse * (gradient_factor * gy - xy * gx - yy * gy - yz * gz)
        sz = inverse * (gradient_factor * gz - xz * gx - yz * gy - zz * gz)
    else:
        # A step uphill: the gradient divided by the trace of the curvatures
        inverse = 1.0 / trace
        sx, sy, sz = inverse * gx, inverse * gy, inverse * gz
    square = sx * sx + sy * sy + sz * sz
    if square > LONGEST_STEP * LONGEST_STEP:
        cut = LONGEST_STEP / math.sqrt(square)
        return cut * sx, cut * sy, cut * sz
    return sx, sy, sz


@inlined
def sphere_gap(rows, i, j, dx, dy, dz, normal):
    """Return the gap of two spheres [m], and write their normal to `normal`.

    If the centres coincide, `normal` is not changed.

    Parameters
    ----------
    rows : array
        `Bodies.rows`.
    i, j : int
        The two spheres.
    dx, dy, dz : float
        Vector from the centre of i to that of j [m].
    normal : array (3,)
        Overwritten with the unit normal from i to j.
    """
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if distance > 0.0:
        set_vector(normal, 0, dx / distance, dy / distance, dz / distance)
    return distance - rows[i, SPHERE_RADIUS] - rows[j, SPHERE_RADIUS]


@kernel
def solve_gap(rows, parts, i, j, normal, tolerance, sufficient_gap):
    """Find the gap of two smooth bodies and its normal; return the gap [m].

    The gap is negative for an overlap. A step that went downhill is halved until it
    goes uphill.

    Parameters
    ----------
    rows : array
        `Bodies.rows`.
    parts : int
        Number of ellipsoids in a body, or SPHERES.
    i, j : int
        The bodies A and B.
    normal : array (3,)
        Initial guess of the unit normal from A to B. It is overwritten with the best
        normal.
    tolerance : float
        The iteration stops when a step is shorter than this [rad].
    sufficient_gap : float
        The iteration also stops if the gap along a normal is larger than this [m]. A
        plane with this normal then separates the bodies.
    """
    ax, ay, az = vector_at(rows[i], POSITION)
    bx, by, bz = vector_at(rows[j], POSITION)
    dx, dy, dz = bx - ax, by - ay, bz - az
    if parts == SPHERES:
        return sphere_gap(rows, i, j, dx, dy, dz, normal)
    nx, ny, nz = vector_at(normal, 0)
    # The best normal so far, its f, and the next step from it
    best_x, best_y, best_z = nx, ny, nz
    best_f = -1e300
    sx = sy = sz = 0.0
    for _ in range(MOST_ITERATIONS):
        # The sums of the support points and of the curvature matrices of both bodies
        x = y = z = xx = xy = xz = yy = yz = zz = 0.0
        for part in range(parts):
            x, y, z, xx, xy, xz, yy, yz, zz = add_part(
                rows[i], part, nx, ny, nz, x, y, z, xx, xy, xz, yy, yz, zz
            )
            x, y, z, xx, xy, xz, yy, yz, zz = add_part(
                rows[j], part, nx, ny, nz, x, y, z, xx, xy, xz, yy, yz, zz
            )
        # The vector between the two support points, whose component along n is the gap
        # f
        x, y, z = dx - x, dy - y, dz - z
        f = nx * x + ny * y + nz * z
        if f < best_f - DOWNHILL:
            # The step went downhill. Halve the step from the best normal.
            sx, sy, sz = 0.5 * sx, 0.5 * sy, 0.5 * sz
        else:
            best_f = f
            best_x, best_y, best_z = nx, ny, nz
            if f > sufficient_gap:
                break
            gx, gy, gz = x - f * nx, y - f * ny, z - f * nz
            sx, sy, sz = newton_step(gx, gy, gz, xx, xy, xz, yy, yz, zz, f)
        if sx * sx + sy * sy + sz * sz < tolerance * tolerance:
            break
        # The next unit normal
        nx, ny, nz = best_x + sx, best_y + sy, best_z + sz
        inverse = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = inverse * nx, inverse * ny, inverse * nz
    set_vector(normal, 0, best_x, best_y, best_z)
    return best_f
