"""Slow and obvious twins of the fast kernels; they must be beyond doubt."""

import numpy as np
from scipy.optimize import brentq, minimize


def rotation(q):
    """Rotation matrix, body to world, of a unit quaternion q = (w, x, y, z), by which a vector v becomes q v q*."""
    w, x, y, z = q
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    right = np.array([[w, x, y, z], [-x, w, -z, y], [-y, z, w, -x], [-z, -y, x, w]])
    return (left @ right)[1:, 1:]


def support_point(semi_axes, q, n):
    """Touching point of a sum of ellipsoids in a world direction, relative to the centre."""
    turn = rotation(q)
    m = turn.T @ n
    return turn @ sum(
        a * a * m / np.linalg.norm(a * m) for a in np.atleast_2d(semi_axes)
    )


def sphere_points(count):
    """Directions spread evenly over the unit sphere (Fibonacci)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    phi = np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def gap(semi_axes, d, qa, qb, count=4000):
    """Gap and normal of two bodies: the largest f(n) of a dense search, polished by a general optimiser."""
    turns = rotation(qa), rotation(qb)

    def f(n):
        return n @ d - sum(
            np.linalg.norm(a * (n @ turn), axis=-1)
            for a in np.atleast_2d(semi_axes)
            for turn in turns
        )

    n = sphere_points(count)
    start = n[f(n).argmax()]
    # lengths of about a millimetre: scaled so that the optimiser's tolerances mean something
    found = minimize(
        lambda x: -1e3 * f(x / np.linalg.norm(x)),
        start,
        method="BFGS",
        options={"gtol": 1e-12},
    )
    best = found.x / np.linalg.norm(found.x)
    return f(best), best


def mass_at_contact(bodies, n):
    """Mass of bodies at a contact along n: what resists a unit impulse; bodies: (mass, inertia in the world, arm)."""
    mobility = 0.0
    for mass, inertia, arm in bodies:
        impulse = np.cross(arm, n)
        mobility += 1.0 / mass + impulse @ np.linalg.solve(inertia, impulse)
    return 1.0 / mobility


def hertz_mindlin(law, overlap, radius, n, v, spring, dt, tension, limit, share=1.0):
    """Force on body A, the new spring, the force that limits friction and rolling: the law as the literature has it.

    law: E*, G*, m, damping ratio, static friction; v: velocity of A relative to B at the contact; n from A to B;
    tension: whether the damped force may pull; limit: "elastic" or "total"; share: of the tangential dashpot.
    """
    young, shear, mass, beta, friction = law
    vn = v @ n
    vt = v - vn * n
    stiffness_n = 2.0 * young * np.sqrt(radius * overlap)
    stiffness_t = 8.0 * shear * np.sqrt(radius * overlap)
    elastic = 4.0 / 3.0 * young * np.sqrt(radius) * overlap**1.5
    normal = (
        elastic + 2.0 * np.sqrt(5.0 / 6.0) * beta * np.sqrt(stiffness_n * mass) * vn
    )
    limiting = elastic if limit == "elastic" else abs(normal)
    if normal < 0.0 and not tension:
        normal = limiting = 0.0
    cap = friction * limiting
    spring = spring - (spring @ n) * n + vt * dt
    pull = np.linalg.norm(spring) * stiffness_t
    if pull > cap:
        spring = spring * cap / pull
    dashpot = share * 2.0 * np.sqrt(5.0 / 6.0) * beta * np.sqrt(stiffness_t * mass)
    return (
        -normal * n - shortened(spring * stiffness_t + dashpot * vt, cap),
        spring,
        limiting,
    )


def hertz_mindlin_rescaled(
    law, overlap, radius, n, v, pull, before, dt, tension, limit, share=1.0
):
    """Force on body A, the spring's new share of it, the force that limits friction, the radius of the contact circle.

    As `hertz_mindlin`, but the spring is a force on A, `pull`, which grows by -S_t v_t dt; where the circle is smaller
    than `before` it has fallen in proportion first.
    """
    young, shear, mass, beta, friction = law
    circle = np.sqrt(radius * overlap)
    vn = v @ n
    vt = v - vn * n
    elastic = 4.0 / 3.0 * young * circle * overlap
    normal = (
        elastic
        + 2.0 * np.sqrt(5.0 / 6.0) * beta * np.sqrt(2.0 * young * circle * mass) * vn
    )
    limiting = elastic if limit == "elastic" else abs(normal)
    if normal < 0.0 and not tension:
        normal = limiting = 0.0
    pull = pull - (pull @ n) * n
    if circle < before:
        pull = pull * circle / before
    pull = shortened(pull - 8.0 * shear * circle * vt * dt, friction * limiting)
    damped = (
        share
        * 2.0
        * np.sqrt(5.0 / 6.0)
        * beta
        * np.sqrt(8.0 * shear * circle * mass)
        * vt
    )
    return (
        -normal * n + shortened(pull - damped, friction * limiting),
        pull,
        limiting,
        circle,
    )


def shortened(vector, most):
    length = np.linalg.norm(vector)
    return vector * most / length if length > most else vector


def epsd(law, circle, n, arms, masses, spin, push, rolled, twisted, dt):
    """Torque on body A, and the new torques of the springs against rolling (a vector) and twisting (a number).

    law: mu_r, mu_t, E*, G*; arms: distances of the contact from the centres; masses: np.inf for a wall, whose arm is
    endless; spin: angular velocity of A relative to B; rolled and twisted as they resist, before the step.
    """
    rolling, twisting, young, shear = law
    across = spin - (spin @ n) * n
    lever = 1.0 / sum(1.0 / arm for arm in arms)
    stiffness = 2.25 * 2.0 * young * circle * (rolling * lever) ** 2
    mobility = sum(
        1.0 / (m * arm**2)
        for m, arm in zip(masses, arms, strict=True)
        if np.isfinite(m)
    )
    limit = rolling * push * lever
    rolled = shortened(rolled - (rolled @ n) * n + stiffness * across * dt, limit)
    torque = shortened(
        rolled + 0.6 * np.sqrt(1.4 / mobility * stiffness) * across, limit
    )
    stiffness = 8.0 * shear * circle * circle**2 / 2.0
    limit = twisting * push * circle
    twisted = np.clip(twisted + stiffness * (spin @ n) * dt, -limit, limit)
    twist = np.clip(
        twisted + 0.6 * np.sqrt(0.4 / mobility * stiffness) * (spin @ n), -limit, limit
    )
    return -torque - twist * n, rolled, twisted


def jkr_force(young, work, radius, overlap):
    """Elastic force of Johnson, Kendall and Roberts by a search for the circle's radius; None without contact."""

    def overlap_of(a):
        return a**2 / radius - np.sqrt(2.0 * np.pi * work * a / young)

    # where d overlap / da = 0
    least = (np.pi * work * radius**2 / (8.0 * young)) ** (1.0 / 3.0)
    if overlap < overlap_of(least):
        return None
    a = brentq(
        lambda a: overlap_of(a) - overlap,
        least,
        100.0 * least + 2.0 * np.sqrt(radius * abs(overlap)),
    )
    return 4.0 * young * a**3 / (3.0 * radius) - np.sqrt(
        8.0 * np.pi * work * young * a**3
    )


def cone_gap(semi_axes, centre, q, normal_r, normal_z, offset, count=20000):
    """Gap of a body inside a cone: the least distance to any of its half-spaces, by a dense search."""
    theta = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    m = np.column_stack(
        [normal_r * np.cos(theta), normal_r * np.sin(theta), np.full(count, normal_z)]
    )
    t = m @ rotation(q)
    return float(
        (
            offset
            - m @ centre
            - sum(np.linalg.norm(a * t, axis=1) for a in np.atleast_2d(semi_axes))
        ).min()
    )


def circle_distance(semi_axes, centre, q, radius, height, count=720):
    """Least distance of a single ellipsoid to a circle (negative inside), by a search over points of the circle."""
    turn = rotation(q)
    axes = np.atleast_2d(semi_axes)[0]

    def distances(theta):
        circle = np.column_stack(
            [
                radius * np.cos(theta),
                radius * np.sin(theta),
                np.full(len(theta), height),
            ]
        )
        return _points_to_ellipsoid((circle - centre) @ turn, axes)[0]

    theta = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    nearest = theta[distances(theta).argmin()]
    return float(
        distances(nearest + np.linspace(-1.0, 1.0, 401) * 2.0 * np.pi / count).min()
    )


def mesh_distance(semi_axes, centre, q, vertices, faces, spacing):
    """Distance of an ellipsoid to a mesh that it does not touch, and the normal towards the mesh; 0.0 where it does.

    The nearest of samples of all triangles, `spacing` apart [m], then of ever finer ones about it in its triangle.
    """
    turn = rotation(q)
    axes = np.atleast_2d(semi_axes)[0]
    triangles = (vertices[faces] - centre) @ turn
    which = []
    u = []
    v = []
    for k, (a, b, c) in enumerate(triangles):
        n = int(np.ceil(max(np.linalg.norm(b - a), np.linalg.norm(c - a)) / spacing))
        i, j = (w.ravel() / n for w in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
        keep = i + j <= 1.0 + 1e-9
        which.append(np.full(keep.sum(), k))
        u.append(i[keep])
        v.append(j[keep])
    which, u, v = (np.concatenate(parts) for parts in (which, u, v))
    a = triangles[which, 0]
    b = triangles[which, 1]
    c = triangles[which, 2]
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    level = np.linalg.norm(points / axes, axis=1)
    if level.min() <= 1.0:
        return 0.0, None
    # the distance is at least (level - 1) times the shortest and at most that times the longest semi-axis
    near = (level - 1.0) * axes.min() <= (level.min() - 1.0) * axes.max() + spacing
    which = which[near]
    u = u[near]
    v = v[near]
    distances, _ = _points_to_ellipsoid(points[near], axes)
    best = np.inf
    foot = None
    for t in np.unique(which[distances < distances.min() + 0.15 * spacing]):
        k = np.flatnonzero(which == t)[distances[which == t].argmin()]
        distance, place = _finest(triangles[t], u[k], v[k], axes, spacing)
        if distance < best:
            best = distance
            foot = place
    if best == 0.0:
        return 0.0, None
    normal = foot / axes**2
    return best, turn @ normal / np.linalg.norm(normal)


def _finest(triangle, u, v, axes, width):
    """Least distance of a triangle's points to an ellipsoid and the point there, by ever smaller grids about (u, v)."""
    a, b, c = triangle
    for _ in range(14):
        n = np.linspace(-width, width, 11)
        du, dv = np.meshgrid(n / np.linalg.norm(b - a), n / np.linalg.norm(c - a))
        us = np.clip(u + du.ravel(), 0.0, 1.0)
        vs = np.clip(v + dv.ravel(), 0.0, 1.0)
        # places beyond the third side move back onto it
        over = np.maximum(us + vs - 1.0, 0.0)
        us = np.maximum(us - 0.5 * over, 0.0)
        vs = np.minimum(np.maximum(vs - 0.5 * over, 0.0), 1.0 - us)
        points = a + us[:, None] * (b - a) + vs[:, None] * (c - a)
        if np.any(np.sum((points / axes) ** 2, axis=1) <= 1.0):
            return 0.0, None
        distances, feet = _points_to_ellipsoid(points, axes)
        k = distances.argmin()
        u = us[k]
        v = vs[k]
        width *= 0.5
    return float(distances[k]), feet[k]


def _points_to_ellipsoid(points, axes):
    """Signed distances of points to an ellipsoid, and their nearest points on it.

    By bisection of the Lagrange multiplier; the points lie outside or just inside.
    """
    outside = np.sum((points / axes) ** 2, axis=1) > 1.0
    low = np.where(outside, 0.0, -(axes.min() ** 2) * (1.0 - 1e-12))
    high = np.linalg.norm(points, axis=1) * axes.max() + 1e-12
    for _ in range(45):
        middle = 0.5 * (low + high)
        is_outside = (
            np.sum((axes * points / (axes**2 + middle[:, None])) ** 2, axis=1) > 1.0
        )
        low = np.where(is_outside, middle, low)
        high = np.where(is_outside, high, middle)
    feet = axes**2 * points / (axes**2 + low[:, None])
    return np.where(outside, 1.0, -1.0) * np.linalg.norm(points - feet, axis=1), feet
