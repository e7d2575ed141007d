"""The gap between two smooth bodies, found by Newton's method on the contact normal.

With d = c_B - c_A, f(n) = n.d - h_A(n) - h_B(-n). Its maximum over unit vectors n is the
gap, or minus the overlap where it is negative; n is then the contact normal from A to B.
Every body here is centrally symmetric, so h_B(-n) = h_B(n). The tangential gradient of f
is P (d - x_A(n) - x_B(n)), with the support points x and the projection P onto the
tangent plane; the Hessian is -(Q_A + Q_B + f I), with the curvature matrices Q.

Reads rows of `Bodies.rows`; writes only the array `normal`.
"""

import math

from .geometry import add_part, radii_product
from .jit import inlined, kernel
from .rows import set_vector, vector_at
from .state import POSITION, SPHERE_RADIUS, SPHERES

# Beyond a step of this length [rad] the quadratic model of f means little.
LONGEST_STEP = 0.4
MOST_ITERATIONS = 60
# A step that makes f smaller by more than rounding went downhill.
DOWNHILL = 1e-15
# The Hessian counts as definite when its determinant exceeds this share of the squared
# trace of the curvature.
LEAST_DETERMINANT = 1e-3


@inlined
def newton_step(gx, gy, gz, xx, xy, xz, yy, yz, zz, f):
    """Return the step (x, y, z) of a normal towards the maximum of f [rad].

    f is the gap of two bodies along the normal. The step is one of Newton's method on
    the unit sphere, in the tangent plane. Where the Hessian is not definite, it is a
    scaled gradient step. A step longer than LONGEST_STEP is cut.

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
    determinant = radii_product(xx, xy, xz, yy, yz, zz) + f * (trace + f)  # of C + f I
    if trace + 2.0 * f > 0.0 and determinant > LEAST_DETERMINANT * trace * trace:
        # T = C + f I is a 2 x 2 matrix in the tangent plane. By Cayley and Hamilton
        # T^-1 g = (tr T g - T g) / det T, so no tangents are needed.
        inverse = 1.0 / determinant
        gradient_factor = trace + f
        sx = inverse * (gradient_factor * gx - xx * gx - xy * gy - xz * gz)
        sy = inverse * (gradient_factor * gy - xy * gx - yy * gy - yz * gz)
        sz = inverse * (gradient_factor * gz - xz * gx - yz * gy - zz * gz)
    else:
        # uphill, by the gradient over the sum of the curvatures
        inverse = 1.0 / trace
        sx, sy, sz = inverse * gx, inverse * gy, inverse * gz
    square = sx * sx + sy * sy + sz * sz
    if square > LONGEST_STEP * LONGEST_STEP:
        cut = LONGEST_STEP / math.sqrt(square)
        return cut * sx, cut * sy, cut * sz
    return sx, sy, sz


@inlined
def sphere_gap(rows, i, j, dx, dy, dz, normal):
    """Return the gap of two spheres [m]; write their normal unless centres coincide.

    Parameters
    ----------
    rows : array
        `Bodies.rows`.
    i, j : int
        The two spheres.
    dx, dy, dz : float
        From the centre of i to that of j [m].
    normal : array (3,)
        The unit normal from i to j is written to it.
    """
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if distance > 0.0:
        set_vector(normal, 0, dx / distance, dy / distance, dz / distance)
    return distance - rows[i, SPHERE_RADIUS] - rows[j, SPHERE_RADIUS]


@kernel
def solve_gap(rows, parts, i, j, normal, tolerance, sufficient_gap):
    """Return the gap of two smooth bodies [m]; negative for an overlap.

    Parameters
    ----------
    rows : array
        `Bodies.rows`.
    parts : int
        Ellipsoids of a body, or SPHERES.
    i, j : int
        The bodies A and B.
    normal : array (3,)
        First guess of the unit normal from A to B; the solution is written to it.
    tolerance : float
        Length of a step at which the iteration stops [rad].
    sufficient_gap : float
        The iteration also stops when a normal proves a gap above this one [m]: the
        bodies have a separating plane.
    """
    ax, ay, az = vector_at(rows[i], POSITION)
    bx, by, bz = vector_at(rows[j], POSITION)
    dx, dy, dz = bx - ax, by - ay, bz - az
    if parts == SPHERES:
        return sphere_gap(rows, i, j, dx, dy, dz, normal)
    nx, ny, nz = vector_at(normal, 0)
    # the best normal so far, its f, and the step from it
    best_x, best_y, best_z = nx, ny, nz
    best = -1e300
    sx = sy = sz = 0.0
    for _ in range(MOST_ITERATIONS):
        # Support points and curvature matrices, summed over both bodies.
        x = y = z = xx = xy = xz = yy = yz = zz = 0.0
        for part in range(parts):
            x, y, z, xx, xy, xz, yy, yz, zz = add_part(
                rows[i], part, nx, ny, nz, x, y, z, xx, xy, xz, yy, yz, zz
            )
            x, y, z, xx, xy, xz, yy, yz, zz = add_part(
                rows[j], part, nx, ny, nz, x, y, z, xx, xy, xz, yy, yz, zz
            )
        # f is the gap along n, the projection of the vector between both support
        # points.
        x, y, z = dx - x, dy - y, dz - z
        f = nx * x + ny * y + nz * z
        if f < best - DOWNHILL:
            # halve the step from the best direction so far
            sx, sy, sz = 0.5 * sx, 0.5 * sy, 0.5 * sz
        else:
            best = f
            best_x, best_y, best_z = nx, ny, nz
            if f > sufficient_gap:
                break
            gx, gy, gz = x - f * nx, y - f * ny, z - f * nz
            sx, sy, sz = newton_step(gx, gy, gz, xx, xy, xz, yy, yz, zz, f)
        if sx * sx + sy * sy + sz * sz < tolerance * tolerance:
            break
        # the next normal, of unit length
        nx, ny, nz = best_x + sx, best_y + sy, best_z + sz
        inverse = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = inverse * nx, inverse * ny, inverse * nz
    set_vector(normal, 0, best_x, best_y, best_z)
    return best
