"""Compute support points and curvatures of a body, a sum of coaxial ellipsoids.

A body is a Minkowski sum of ellipsoids ("parts") with common axes. Its support function
is h(n) = sum_k sqrt(n' S_k n) with S_k = R diag(a_k^2) R'. It is smooth and convex for
any number of parts. The functions read a row of `Bodies.rows`, which contains the
matrices S_k in world axes, or in the axes of a wall (see `frames.write_row_in_frame`).
They do not write anything.

Symbols used here and in the solvers:

    h               support value h(n): extent of the body along the unit vector n [m]
    (x, y, z)       support point: the body's outermost point along n, from its centre
    u, w            unit tangents; n, u and w are perpendicular
    Q = grad grad h curvature matrix: its eigenvalues are the principal radii [m]
"""

import math

from .jit import inlined
from .rows import vector_at
from .simd import rsqrt
from .state import PART, SHAPE, SPHERE_RADIUS, SPHERES


@inlined
def tangents(nx, ny, nz):
    """Return two unit tangents u and w that make (u, w, n) a right-handed frame.

    The method of Duff et al. (2017) needs no special cases for certain directions.

    Parameters
    ----------
    nx, ny, nz : float
        Unit vector n.

    Returns
    -------
    ux, uy, uz, wx, wy, wz : float
        The tangents u and w.
    """
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@inlined
def step_normal(nx, ny, nz, step_u, step_w):
    """Return a unit vector n after a step in its tangent plane.

    Parameters
    ----------
    nx, ny, nz : float
        Unit normal n.
    step_u, step_w : float
        Components of the step along the tangents u and w of n, see `tangents`.

    Returns
    -------
    nx, ny, nz : float
        The vector n + step, divided by its length.
    """
    ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
    x = nx + step_u * ux + step_w * wx
    y = ny + step_u * uy + step_w * wy
    z = nz + step_u * uz + step_w * wz
    inverse = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * inverse, y * inverse, z * inverse


@inlined
def multiply_symmetric(xx, xy, xz, yy, yz, zz, x, y, z):
    """Multiply a symmetric matrix (xx, xy, xz, yy, yz, zz) by a vector (x, y, z)."""
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@inlined
def shape_matrix(row, part):
    """Return the matrix S (xx, xy, xz, yy, yz, zz) of one ellipsoid of a body [m^2].

    `row` is a row of `Bodies.rows`, `part` the index of the ellipsoid. In the axes of
    the ellipsoid, S is the diagonal matrix of the squared semi-axes.
    """
    first = SHAPE + PART * part
    xx, xy, xz = vector_at(row, first)
    yy, yz, zz = vector_at(row, first + 3)
    return xx, xy, xz, yy, yz, zz


@inlined
def multiply_by_shape(row, part, x, y, z):
    """Multiply the matrix S of one ellipsoid of a body (`shape_matrix`) by a vector."""
    xx, xy, xz, yy, yz, zz = shape_matrix(row, part)
    return multiply_symmetric(xx, xy, xz, yy, yz, zz, x, y, z)


@inlined
def extent(row, parts, nx, ny, nz):
    """Return how far a body extends from its centre along a unit vector n [m].

    This is the support value h(n). A body is a Minkowski sum of ellipsoids, so its
    support value is the sum of theirs. Each ellipsoid has a symmetric matrix S, whose
    eigenvalues are the squared semi-axes.

    Parameters
    ----------
    row : array
        The body: a row of `Bodies.rows`. The module `state` names its columns.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    nx, ny, nz : float
        Unit vector n.
    """
    if parts == SPHERES:
        return row[SPHERE_RADIUS]
    h = 0.0
    for part in range(parts):
        # The support value of an ellipsoid is sqrt(n' S n).
        x, y, z = multiply_by_shape(row, part, nx, ny, nz)
        h += math.sqrt(nx * x + ny * y + nz * z)
    return h


@inlined
def ellipsoid_support(xx, xy, xz, yy, yz, zz, nx, ny, nz):
    """Return support point and curvature matrix of an ellipsoid at the normal n.

    The support point x is the outermost point along n, relative to the centre. It is
    x = S n / h, with the support value h = sqrt(n' S n). The curvature matrix is
    (S - x x') / h. Its eigenvalues are the principal radii of the surface at x.

    Parameters
    ----------
    xx, xy, xz, yy, yz, zz : float
        Matrix S of the ellipsoid [m^2], see `shape_matrix`.
    nx, ny, nz : float
        Unit normal n.

    Returns
    -------
    x, y, z : float
        Support point [m].
    xx, xy, xz, yy, yz, zz : float
        Curvature matrix [m].
    """
    x, y, z = multiply_symmetric(xx, xy, xz, yy, yz, zz, nx, ny, nz)
    inverse_h = rsqrt(nx * x + ny * y + nz * z)
    # The support point
    x, y, z = inverse_h * x, inverse_h * y, inverse_h * z
    # The curvature matrix, which overwrites S
    xx, xy, xz = (
        inverse_h * (xx - x * x),
        inverse_h * (xy - x * y),
        inverse_h * (xz - x * z),
    )
    yy, yz, zz = (
        inverse_h * (yy - y * y),
        inverse_h * (yz - y * z),
        inverse_h * (zz - z * z),
    )
    return x, y, z, xx, xy, xz, yy, yz, zz


@inlined
def add_part(row, part, nx, ny, nz, x, y, z, xx, xy, xz, yy, yz, zz):
    """Add one ellipsoid to the support point and curvature matrix of a body.

    Parameters
    ----------
    row : array
        The body: a row of `Bodies.rows`. The module `state` names its columns.
    part : int
        Index of the ellipsoid.
    nx, ny, nz : float
        Unit normal n.
    x, y, z : float
        Support point of the ellipsoids so far [m].
    xx, xy, xz, yy, yz, zz : float
        Curvature matrix of the ellipsoids so far [m].

    Returns
    -------
    tuple of 9 float
        The sums: support point (3) and curvature matrix (6).
    """
    sxx, sxy, sxz, syy, syz, szz = shape_matrix(row, part)
    px, py, pz, pxx, pxy, pxz, pyy, pyz, pzz = ellipsoid_support(
        sxx, sxy, sxz, syy, syz, szz, nx, ny, nz
    )
    # The sums of the support points, then those of the matrices
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
def radii_product(xx, xy, xz, yy, yz, zz):
    """Return the product of the two principal radii of a curvature matrix [m^2].

    The third eigenvalue, along the normal, is zero. Therefore the product is the second
    invariant of the matrix (xx, xy, xz, yy, yz, zz), the sum of its three principal
    minors.
    """
    return xx * yy - xy * xy + (xx * zz - xz * xz) + (yy * zz - yz * yz)


@inlined
def support_terms(row, parts, nx, ny, nz, ux, uy, uz, wx, wy, wz):
    """Return support value, support point and curvature of a body along n.

    The support point is the body's outermost point along n. A body is a Minkowski sum
    of ellipsoids, its parts, so all results are sums over the parts. The curvature
    matrix Q holds radii of curvature: its eigenvalues are the principal radii of the
    surface at the support point.

    Parameters
    ----------
    row : array
        The body: a row of `Bodies.rows`. The module `state` names its columns.
    parts : int
        Number of ellipsoids in the body; SPHERES (-1) for a sphere.
    nx, ny, nz : float
        Unit normal n.
    ux, uy, uz, wx, wy, wz : float
        Unit tangents u and w; n, u and w are perpendicular.

    Returns
    -------
    h : float
        Support value, the extent of the body along n [m].
    along_u, along_w : float
        Components of the outermost point along u and w [m].
    q_uu, q_uw, q_ww : float
        Curvature matrix Q in the tangents u and w [m].
    """
    # The outermost point of a sphere lies along n. Both radii of curvature are its
    # radius.
    if parts == SPHERES:
        return row[SPHERE_RADIUS], 0.0, 0.0, row[SPHERE_RADIUS], 0.0, row[SPHERE_RADIUS]
    h = 0.0
    along_u = 0.0
    along_w = 0.0
    q_uu = 0.0
    q_uw = 0.0
    q_ww = 0.0
    for part in range(parts):
        # (sx, sy, sz) is the matrix S of this ellipsoid times a vector: here n, below u
        # and w.
        sx, sy, sz = multiply_by_shape(row, part, nx, ny, nz)
        h_squared = nx * sx + ny * sy + nz * sz
        # A body with fewer parts has matrices of zeros for the missing parts.
        if h_squared <= 0.0:
            continue
        # The outermost point x of this part is S n / h, with h = sqrt(n' S n).
        h_part = math.sqrt(h_squared)
        inverse_h = 1.0 / h_part
        x_u = (sx * ux + sy * uy + sz * uz) * inverse_h
        x_w = (sx * wx + sy * wy + sz * wz) * inverse_h
        h += h_part
        along_u += x_u
        along_w += x_w
        # Add the components uu, uw and ww of this part's Q, which is (S - x x') / h.
        sx, sy, sz = multiply_by_shape(row, part, ux, uy, uz)
        q_uu += (sx * ux + sy * uy + sz * uz - x_u * x_u) * inverse_h
        q_uw += (sx * wx + sy * wy + sz * wz - x_u * x_w) * inverse_h
        sx, sy, sz = multiply_by_shape(row, part, wx, wy, wz)
        q_ww += (sx * wx + sy * wy + sz * wz - x_w * x_w) * inverse_h
    return h, along_u, along_w, q_uu, q_uw, q_ww
