"""Directions and support functions of one body, as scalars.

A body is a sum of K ellipsoids with common axes (a Minkowski sum): its support function is h(n) = sum_k sqrt(n' S_k n)
with S_k = R diag(a_k^2) R', smooth and convex for any K. The row of a body (see `state`) holds the S_k in the world
frame, so no kernel turns a vector into the body's frame.
"""

import math

from .jit import inlined
from .simd import rsqrt
from .state import PART, SHAPE, SPHERE_RADIUS, SPHERES


@inlined
def tangents(nx, ny, nz):
    """Two unit vectors that make a right-handed frame (t1, t2, n) with a unit n (Duff et al. 2017)."""
    s = math.copysign(1.0, nz)
    a = -1.0 / (s + nz)
    b = nx * ny * a
    return 1.0 + s * nx * nx * a, s * b, -s * nx, b, s + ny * ny * a, -ny


@inlined
def stepped(nx, ny, nz, s1, s2):
    """Return a unit vector after a step in its tangent plane."""
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    x, y, z = nx + s1 * ux + s2 * wx, ny + s1 * uy + s2 * wy, nz + s1 * uz + s2 * wz
    inv = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * inv, y * inv, z * inv


@inlined
def matrix_times(xx, xy, xz, yy, yz, zz, x, y, z):
    """Multiply a symmetric matrix by a vector."""
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@inlined
def times_shape(row, part, x, y, z):
    """S_k times a vector."""
    s = SHAPE + PART * part
    return matrix_times(
        row[s], row[s + 1], row[s + 2], row[s + 3], row[s + 4], row[s + 5], x, y, z
    )


@inlined
def extent(row, parts, nx, ny, nz):
    """Support value h(n) of a body."""
    if parts == SPHERES:
        return row[SPHERE_RADIUS]
    h = 0.0
    for k in range(parts):
        x, y, z = times_shape(row, k, nx, ny, nz)
        h += math.sqrt(nx * x + ny * y + nz * z)
    return h


@inlined
def part_terms(xx, xy, xz, yy, yz, zz, nx, ny, nz):
    """Support point S n / h of a part with the matrix S, and its curvature (S - x x') / h; h is the root of n.S n."""
    x, y, z = matrix_times(xx, xy, xz, yy, yz, zz, nx, ny, nz)
    inv = rsqrt(nx * x + ny * y + nz * z)
    x, y, z = inv * x, inv * y, inv * z
    xx, xy, xz = inv * (xx - x * x), inv * (xy - x * y), inv * (xz - x * z)
    yy, yz, zz = inv * (yy - y * y), inv * (yz - y * z), inv * (zz - z * z)
    return x, y, z, xx, xy, xz, yy, yz, zz


@inlined
def add_part(row, part, nx, ny, nz, x, y, z, xx, xy, xz, yy, yz, zz):
    """Add the `part_terms` of one part of a body to a support point and a curvature matrix."""
    s = SHAPE + PART * part
    px, py, pz, pxx, pxy, pxz, pyy, pyz, pzz = part_terms(
        row[s], row[s + 1], row[s + 2], row[s + 3], row[s + 4], row[s + 5], nx, ny, nz
    )
    return (
        x + px,
        y + py,
        z + pz,
        xx + pxx,
        xy + pxy,
        xz + pxz,
        yy + pyy,
        yz + pyz,
        zz + pzz,
    )


@inlined
def area(xx, xy, xz, yy, yz, zz):
    """Product of the two principal radii of curvature; the third eigenvalue of the curvature matrix is 0."""
    return xx * yy - xy * xy + (xx * zz - xz * xz) + (yy * zz - yz * yz)


@inlined
def support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz):
    """h, x.u, x.w, Q_uu, Q_uw, Q_ww in direction n with tangents u, w: support value and point, Q = grad grad h."""
    if parts == SPHERES:
        return row[SPHERE_RADIUS], 0.0, 0.0, row[SPHERE_RADIUS], 0.0, row[SPHERE_RADIUS]
    h = 0.0
    g1 = 0.0
    g2 = 0.0
    q11 = 0.0
    q12 = 0.0
    q22 = 0.0
    for k in range(parts):
        x, y, z = times_shape(row, k, nx, ny, nz)
        square = nx * x + ny * y + nz * z
        if square <= 0.0:
            continue
        hk = math.sqrt(square)
        inv = 1.0 / hk
        xu = (x * ux + y * uy + z * uz) * inv
        xw = (x * wx + y * wy + z * wz) * inv
        h += hk
        g1 += xu
        g2 += xw
        x, y, z = times_shape(row, k, ux, uy, uz)
        q11 += (x * ux + y * uy + z * uz - xu * xu) * inv
        q12 += (x * wx + y * wy + z * wz - xu * xw) * inv
        x, y, z = times_shape(row, k, wx, wy, wz)
        q22 += (x * wx + y * wy + z * wz - xw * xw) * inv
    return h, g1, g2, q11, q12, q22
