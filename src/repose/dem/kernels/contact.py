"""Gap between two convex bodies by their support functions, solved to convergence.

With d = c_B - c_A, f(n) = n.d - h_A(n) - h_B(-n); its maximum over unit n is the gap (positive) or minus the overlap
(negative), n the contact normal from A to B. Every body here is centrally symmetric, so h_B(-n) = h_B(n) and the
tangential gradient is P (d - x_A(n) - x_B(n)), the Hessian -(Q_A + Q_B + f I).
"""

import math

from .geometry import support_terms, tangents
from .jit import inlined, kernel

# An ascent step is at most this long (radians); beyond it the quadratic model means little.
LONGEST_STEP = 0.4


@inlined
def ascent_step(g1, g2, q11, q12, q22, f):
    """One Newton step on the sphere, or a scaled gradient step where the Hessian is not definite."""
    a = q11 + f
    c = q22 + f
    det = a * c - q12 * q12
    trace = q11 + q22
    definite = (a > 0.0) and (c > 0.0) and (det > 1e-3 * trace * trace)
    if definite:
        s1 = (c * g1 - q12 * g2) / det
        s2 = (a * g2 - q12 * g1) / det
    else:
        s1 = g1 / trace
        s2 = g2 / trace
    length = math.sqrt(s1 * s1 + s2 * s2)
    if length > LONGEST_STEP:
        s1 *= LONGEST_STEP / length
        s2 *= LONGEST_STEP / length
    return s1, s2


@kernel
def solve_gap(rows, parts, i, j, normal, tolerance, early):
    """Maximise f for bodies i and j from a starting normal.

    rows: the bodies' rows (see `state`), parts: of a shape; normal (3,) start, overwritten by the solution;
    tolerance: the step (radians) at which it stops; early: return as soon as some n proves a gap above this [m]
    (a separating axis needs no iteration). Returns the gap f [m].
    """
    dx = rows[j, 0] - rows[i, 0]
    dy = rows[j, 1] - rows[i, 1]
    dz = rows[j, 2] - rows[i, 2]
    nx, ny, nz = normal[0], normal[1], normal[2]
    best = -1e300
    s1 = 0.0
    s2 = 0.0
    bx, by, bz = nx, ny, nz
    b1x, b1y, b1z, b2x, b2y, b2z = tangents(nx, ny, nz)
    for _ in range(60):
        ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
        ha, a1, a2, a11, a12, a22 = support_terms(rows[i], parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
        hb, b1, b2, b11, b12, b22 = support_terms(rows[j], parts, nx, ny, nz, ux, uy, uz, wx, wy, wz)
        f = nx * dx + ny * dy + nz * dz - ha - hb
        if f < best - 1e-15:
            # the step went downhill: halve it from the best direction so far
            s1 *= 0.5
            s2 *= 0.5
            if s1 * s1 + s2 * s2 < tolerance * tolerance:
                break
        else:
            best = f
            bx, by, bz = nx, ny, nz
            b1x, b1y, b1z, b2x, b2y, b2z = ux, uy, uz, wx, wy, wz
            if f > early:
                break
            g1 = dx * ux + dy * uy + dz * uz - a1 - b1
            g2 = dx * wx + dy * wy + dz * wz - a2 - b2
            s1, s2 = ascent_step(g1, g2, a11 + b11, a12 + b12, a22 + b22, f)
            if s1 * s1 + s2 * s2 < tolerance * tolerance:
                break
        nx = bx + s1 * b1x + s2 * b2x
        ny = by + s1 * b1y + s2 * b2y
        nz = bz + s1 * b1z + s2 * b2z
        inv = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx *= inv
        ny *= inv
        nz *= inv
    normal[0] = bx
    normal[1] = by
    normal[2] = bz
    return best
