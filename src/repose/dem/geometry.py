"""Rotations and support functions of one body, as scalars.

A body is a sum of K ellipsoids with common axes (a Minkowski sum): its support function is
h(n) = sum_k |diag(a_k) n| in the body frame, smooth and convex for any K. `squares` holds a_k^2 as (K, 3).
Quaternions are (w, x, y, z), body to world.
"""

import math

from .jit import inlined


@inlined
def to_body(qw, qx, qy, qz, x, y, z):
    """Rotate a world vector into the body frame."""
    # v' = v + 2 q x (q x v - w v): Rodrigues with the conjugate quaternion
    ax = z * qy - y * qz - qw * x
    ay = x * qz - z * qx - qw * y
    az = y * qx - x * qy - qw * z
    return (
        x + 2.0 * (az * qy - ay * qz),
        y + 2.0 * (ax * qz - az * qx),
        z + 2.0 * (ay * qx - ax * qy),
    )


@inlined
def to_world(qw, qx, qy, qz, x, y, z):
    """Rotate a body vector into the world frame."""
    return to_body(qw, -qx, -qy, -qz, x, y, z)


@inlined
def tangents(nx, ny, nz):
    """Two unit vectors that make a right-handed frame (t1, t2, n) with a unit n (Duff et al. 2017)."""
    s = math.copysign(1.0, nz)
    a = -1.0 / (s + nz)
    b = nx * ny * a
    return 1.0 + s * nx * nx * a, s * b, -s * nx, b, s + ny * ny * a, -ny


@inlined
def support_terms(squares, n1, n2, n3, u1, u2, u3, w1, w2, w3):
    """Support value, tangential support point and curvature radii of a body, all in its own frame.

    n is the direction, u and w the two tangents (body frame). Returns h, x.u, x.w and the tangential matrix
    Q = grad grad h as (Q_uu, Q_uw, Q_ww).
    """
    h = 0.0
    g1 = 0.0
    g2 = 0.0
    q11 = 0.0
    q12 = 0.0
    q22 = 0.0
    for k in range(squares.shape[0]):
        a = squares[k, 0]
        b = squares[k, 1]
        c = squares[k, 2]
        x1 = a * n1
        x2 = b * n2
        x3 = c * n3
        hk = math.sqrt(x1 * n1 + x2 * n2 + x3 * n3)
        inv = 1.0 / hk
        xu = (x1 * u1 + x2 * u2 + x3 * u3) * inv
        xw = (x1 * w1 + x2 * w2 + x3 * w3) * inv
        h += hk
        g1 += xu
        g2 += xw
        q11 += (a * u1 * u1 + b * u2 * u2 + c * u3 * u3 - xu * xu) * inv
        q12 += (a * u1 * w1 + b * u2 * w2 + c * u3 * w3 - xu * xw) * inv
        q22 += (a * w1 * w1 + b * w2 * w2 + c * w3 * w3 - xw * xw) * inv
    return h, g1, g2, q11, q12, q22


@inlined
def world_support(squares, qw, qx, qy, qz, nx, ny, nz, ux, uy, uz, wx, wy, wz):
    """`support_terms` for a direction and tangents given in the world frame."""
    n1, n2, n3 = to_body(qw, qx, qy, qz, nx, ny, nz)
    u1, u2, u3 = to_body(qw, qx, qy, qz, ux, uy, uz)
    w1, w2, w3 = to_body(qw, qx, qy, qz, wx, wy, wz)
    return support_terms(squares, n1, n2, n3, u1, u2, u3, w1, w2, w3)
