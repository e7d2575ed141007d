"""Slow and obvious twins of the fast kernels; nobody should have to doubt these."""

import numpy as np
from scipy.optimize import minimize


def rotation(q):
    """Rotation matrix, body to world, of a unit quaternion (w, x, y, z), from its action on a vector."""
    w, v = q[0], np.asarray(q[1:])
    columns = [e + 2.0 * np.cross(v, np.cross(v, e) + w * e) for e in np.eye(3)]
    return np.array(columns).T


def support(semi_axes, q, n):
    """Support value of a sum of ellipsoids in a world direction."""
    m = rotation(q).T @ n
    return sum(np.linalg.norm(a * m) for a in np.atleast_2d(semi_axes))


def support_point(semi_axes, q, n):
    """Touching point of a sum of ellipsoids in a world direction, relative to the centre."""
    turn = rotation(q)
    m = turn.T @ n
    return turn @ sum(a * a * m / np.linalg.norm(a * m) for a in np.atleast_2d(semi_axes))


def sphere_points(count):
    """Directions spread evenly over the unit sphere (Fibonacci)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    phi = np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def gap(semi_axes, d, qa, qb, count=4000):
    """Gap and normal of two bodies: the largest f(n) of a dense search, polished by a general optimiser."""

    def f(n):
        n = n / np.linalg.norm(n)
        return n @ d - support(semi_axes, qa, n) - support(semi_axes, qb, -n)

    n = sphere_points(count)
    ta, tb = n @ rotation(qa), n @ rotation(qb)
    values = n @ d
    for a in np.atleast_2d(semi_axes):
        values = values - np.linalg.norm(a * ta, axis=1) - np.linalg.norm(a * tb, axis=1)
    start = n[values.argmax()]
    # lengths of about a millimetre: scaled so that the optimiser's tolerances mean something
    found = minimize(lambda x: -1e3 * f(x), start, method="BFGS", options={"gtol": 1e-12})
    best = found.x / np.linalg.norm(found.x)
    return f(best), best


def hertz_mindlin(law, overlap, radius, n, v, spring, dt, tension):
    """Force on body A, the new spring; the contact law in the words of design and literature, one contact.

    law: E*, G*, m*, damping ratio, static friction; v: velocity of A relative to B at the contact; n from A to B.
    """
    young, shear, mass, beta, friction = law
    vn = v @ n
    vt = v - vn * n
    stiffness_n = 2.0 * young * np.sqrt(radius * overlap)
    stiffness_t = 8.0 * shear * np.sqrt(radius * overlap)
    normal = 4.0 / 3.0 * young * np.sqrt(radius) * overlap**1.5
    normal += 2.0 * np.sqrt(5.0 / 6.0) * beta * np.sqrt(stiffness_n * mass) * vn
    if not tension:
        normal = max(normal, 0.0)
    cap = friction * abs(normal)
    spring = spring - (spring @ n) * n + vt * dt
    pull = np.linalg.norm(spring) * stiffness_t
    if pull > cap:
        spring = spring * cap / pull
    tangential = spring * stiffness_t + 2.0 * np.sqrt(5.0 / 6.0) * beta * np.sqrt(stiffness_t * mass) * vt
    pull = np.linalg.norm(tangential)
    if pull > cap:
        tangential = tangential * cap / pull
    return -normal * n - tangential, spring


def cone_gap(semi_axes, centre, q, normal_r, normal_z, offset, count=20000):
    """Gap of a body inside a cone: the least distance to any of its half-spaces, by a dense search."""
    theta = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    m = np.column_stack([normal_r * np.cos(theta), normal_r * np.sin(theta), np.full(count, normal_z)])
    t = m @ rotation(q)
    h = sum(np.linalg.norm(a * t, axis=1) for a in np.atleast_2d(semi_axes))
    return float((offset - m @ centre - h).min())


def circle_distance(semi_axes, centre, q, radius, height, count=720):
    """Least distance of a single ellipsoid to a circle (negative inside), by a search over points of the circle."""
    turn = rotation(q)
    axes = np.atleast_2d(semi_axes)[0]

    def distance(theta):
        p = turn.T @ (np.array([radius * np.cos(theta), radius * np.sin(theta), height]) - centre)
        return _point_to_ellipsoid(p, axes)

    theta = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    values = np.array([distance(t) for t in theta])
    k = values.argmin()
    fine = theta[k] + np.linspace(-1.0, 1.0, 401) * 2.0 * np.pi / count
    return float(min(distance(t) for t in fine))


def _point_to_ellipsoid(p, axes):
    """Signed distance of a point to an ellipsoid by bisection of the Lagrange multiplier (outside or just inside)."""

    def residual(t):
        return np.sum((axes * p / (axes**2 + t)) ** 2) - 1.0

    low, high = -(axes.min() ** 2) * (1.0 - 1e-12), np.linalg.norm(p) * axes.max() + 1e-12
    for _ in range(200):
        middle = 0.5 * (low + high)
        if residual(middle) > 0.0:
            low = middle
        else:
            high = middle
    foot = axes**2 * p / (axes**2 + low)
    side = 1.0 if np.sum((p / axes) ** 2) > 1.0 else -1.0
    return side * float(np.linalg.norm(p - foot))
