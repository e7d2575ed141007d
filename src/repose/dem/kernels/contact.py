"""Gap between two convex bodies by their support functions, solved to convergence.

With d = c_B - c_A, f(n) = n.d - h_A(n) - h_B(-n); its maximum over unit n is the gap (positive) or minus the overlap
(negative), n the contact normal from A to B. Every body here is centrally symmetric, so h_B(-n) = h_B(n) and the
tangential gradient is P (d - x_A(n) - x_B(n)), the Hessian -(Q_A + Q_B + f I).
"""

import math

from .geometry import add_part, area
from .jit import inlined, kernel
from .state import SPHERE_RADIUS, SPHERES

# An ascent step is at most this long (radians); beyond it the quadratic model means little.
LONGEST_STEP = 0.4


@inlined
def newton_step(x, y, z, xx, xy, xz, yy, yz, zz, f):
    """One Newton step on the sphere from gradient and curvature, or a scaled gradient step at an indefinite Hessian."""
    trace = xx + yy + zz
    det = area(xx, xy, xz, yy, yz, zz) + f * (trace + f)
    if trace + 2.0 * f > 0.0 and det > 1e-3 * trace * trace:
        inv = 1.0 / det
        along = trace + f
        sx = inv * (along * x - xx * x - xy * y - xz * z)
        sy = inv * (along * y - xy * x - yy * y - yz * z)
        sz = inv * (along * z - xz * x - yz * y - zz * z)
    else:
        inv = 1.0 / trace
        sx, sy, sz = inv * x, inv * y, inv * z
    square = sx * sx + sy * sy + sz * sz
    if square > LONGEST_STEP * LONGEST_STEP:
        cut = LONGEST_STEP / math.sqrt(square)
        return cut * sx, cut * sy, cut * sz
    return sx, sy, sz


@kernel
def solve_gap(rows, parts, i, j, normal, tolerance, early):
    """Maximise f for bodies i and j; returns the gap f [m], and the solution in `normal`, which holds the first guess.

    `tolerance` is the step [rad] at which the iteration stops; it also stops when a normal proves a gap above `early`
    [m] (a separating axis).
    """
    dx, dy, dz = (
        rows[j, 0] - rows[i, 0],
        rows[j, 1] - rows[i, 1],
        rows[j, 2] - rows[i, 2],
    )
    if parts == SPHERES:
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        if distance > 0.0:
            normal[0], normal[1], normal[2] = (
                dx / distance,
                dy / distance,
                dz / distance,
            )
        return distance - rows[i, SPHERE_RADIUS] - rows[j, SPHERE_RADIUS]
    nx, ny, nz = normal[0], normal[1], normal[2]
    bx, by, bz = nx, ny, nz
    best = -1e300
    sx = sy = sz = 0.0
    for _ in range(60):
        x = y = z = xx = xy = xz = yy = yz = zz = 0.0
        for part in range(parts):
            x, y, z, xx, xy, xz, yy, yz, zz = add_part(
                rows[i], part, nx, ny, nz, x, y, z, xx, xy, xz, yy, yz, zz
            )
            x, y, z, xx, xy, xz, yy, yz, zz = add_part(
                rows[j], part, nx, ny, nz, x, y, z, xx, xy, xz, yy, yz, zz
            )
        x, y, z = dx - x, dy - y, dz - z
        f = nx * x + ny * y + nz * z
        if f < best - 1e-15:
            # the step went downhill: halve it from the best direction so far
            sx, sy, sz = 0.5 * sx, 0.5 * sy, 0.5 * sz
        else:
            best = f
            bx, by, bz = nx, ny, nz
            if f > early:
                break
            sx, sy, sz = newton_step(
                x - f * nx, y - f * ny, z - f * nz, xx, xy, xz, yy, yz, zz, f
            )
        if sx * sx + sy * sy + sz * sz < tolerance * tolerance:
            break
        nx, ny, nz = bx + sx, by + sy, bz + sz
        inv = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = inv * nx, inv * ny, inv * nz
    normal[0], normal[1], normal[2] = bx, by, bz
    return best
