"""The hot loops: geometry and force law of 32 contacts at a time.

A tile is one array of ROWS x LANES doubles; a row is one quantity, a lane one contact. Every loop runs over the lanes
with a constant count and touches nothing but the tile and the tile of what persists (normal and spring, `c` below), so
the compiler turns it into vector code: rows lie at constant distances in two arrays, and whether those overlap is one
check a loop. Unused lanes hold a body that is not there and are thrown away.
"""


from . import state as st
from .geometry import tangents
from .jit import inlined, kernel
from .simd import rsqrt
from .state import LANES, NORMAL, OFFSET, PART, SHAPE, SPRING

L = LANES  # short, for the index arithmetic below

# rows of what persists (see `state`)
N = NORMAL
S = SPRING

# rows: the columns of the two bodies (see `state`), those of B all zero but for pairs
MOST_COLUMNS = 32
A = 0
B = MOST_COLUMNS * L
# rows: two tangents
U = 64 * L
W = 67 * L
# rows: support sums h, x.u, x.w, Q_uu, Q_uw, Q_ww
HA = 70 * L
HB = 76 * L
# rows: gap, effective radius, contact point relative to each centre
GAP = 82 * L
RADIUS = 83 * L
RA = 84 * L
RB = 87 * L
# rows as the columns of `load`: force and torque on each body and the budget of the rolling torque
TO_A = 90 * L
TO_B = 98 * L
# rows: constants of the force law (see `materials.contact_law`)
LAW = 106 * L
LAW_ROWS = 6
ROWS = 112

# A contact normal turns by at most this much in a step [rad].
LARGEST_TURN = 0.2


@kernel
def fill_law(t, law):
    """Give every lane the same force law."""
    for c in range(LAW_ROWS):
        for k in range(L):
            t[LAW + c * L + k] = law[c]


@kernel
def tangent_rows(t, c):
    """Two tangents of each lane's normal."""
    for k in range(L):
        ux, uy, uz, wx, wy, wz = tangents(c[N + k], c[N + L + k], c[N + 2 * L + k])
        t[U + k] = ux
        t[U + L + k] = uy
        t[U + 2 * L + k] = uz
        t[W + k] = wx
        t[W + L + k] = wy
        t[W + 2 * L + k] = wz


@inlined
def support_part(t, c, shape, sums, keep):
    """Write (keep 0.0) or add (keep 1.0) the support terms of one part of a body (see geometry.support_terms)."""
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        ux, uy, uz = t[U + k], t[U + L + k], t[U + 2 * L + k]
        wx, wy, wz = t[W + k], t[W + L + k], t[W + 2 * L + k]
        xx, xy, xz = t[shape + k], t[shape + L + k], t[shape + 2 * L + k]
        yy, yz, zz = t[shape + 3 * L + k], t[shape + 4 * L + k], t[shape + 5 * L + k]
        px = xx * nx + xy * ny + xz * nz
        py = xy * nx + yy * ny + yz * nz
        pz = xz * nx + yz * ny + zz * nz
        square = nx * px + ny * py + nz * pz
        inv = rsqrt(square)
        xu = (ux * px + uy * py + uz * pz) * inv
        xw = (wx * px + wy * py + wz * pz) * inv
        px = xx * ux + xy * uy + xz * uz
        py = xy * ux + yy * uy + yz * uz
        pz = xz * ux + yz * uy + zz * uz
        quu = (ux * px + uy * py + uz * pz - xu * xu) * inv
        quw = (wx * px + wy * py + wz * pz - xu * xw) * inv
        px = xx * wx + xy * wy + xz * wz
        py = xy * wx + yy * wy + yz * wz
        pz = xz * wx + yz * wy + zz * wz
        qww = (wx * px + wy * py + wz * pz - xw * xw) * inv
        t[sums + k] = keep * t[sums + k] + square * inv
        t[sums + L + k] = keep * t[sums + L + k] + xu
        t[sums + 2 * L + k] = keep * t[sums + 2 * L + k] + xw
        t[sums + 3 * L + k] = keep * t[sums + 3 * L + k] + quu
        t[sums + 4 * L + k] = keep * t[sums + 4 * L + k] + quw
        t[sums + 5 * L + k] = keep * t[sums + 5 * L + k] + qww


@kernel
def body_a(t, c, parts):
    """Support sums of body A (the offsets must be constants for the loops to become vector code)."""
    support_part(t, c, A + SHAPE * L, HA, 0.0)
    if parts > 1:
        support_part(t, c, A + (SHAPE + PART) * L, HA, 1.0)
    if parts > 2:
        support_part(t, c, A + (SHAPE + 2 * PART) * L, HA, 1.0)


@kernel
def body_b(t, c, parts):
    """Support sums of body B."""
    support_part(t, c, B + SHAPE * L, HB, 0.0)
    if parts > 1:
        support_part(t, c, B + (SHAPE + PART) * L, HB, 1.0)
    if parts > 2:
        support_part(t, c, B + (SHAPE + 2 * PART) * L, HB, 1.0)


@kernel
def pair_geometry(t, c):
    """One Newton step on the gap of each lane's pair; gap, effective radius and contact point at the new normal.

    The values at the new normal come from the expansion at the old one (gap to third order in the step, points to
    second), so each contact costs one evaluation a time step.
    """
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        ux, uy, uz = t[U + k], t[U + L + k], t[U + 2 * L + k]
        wx, wy, wz = t[W + k], t[W + L + k], t[W + 2 * L + k]
        dx = t[B + k] - t[A + k]
        dy = t[B + L + k] - t[A + L + k]
        dz = t[B + 2 * L + k] - t[A + 2 * L + k]
        ha = t[HA + k]
        a1 = t[HA + L + k]
        a2 = t[HA + 2 * L + k]
        a11 = t[HA + 3 * L + k]
        a12 = t[HA + 4 * L + k]
        a22 = t[HA + 5 * L + k]
        b11 = t[HB + 3 * L + k]
        b12 = t[HB + 4 * L + k]
        b22 = t[HB + 5 * L + k]
        f = nx * dx + ny * dy + nz * dz - ha - t[HB + k]
        g1 = ux * dx + uy * dy + uz * dz - a1 - t[HB + L + k]
        g2 = wx * dx + wy * dy + wz * dz - a2 - t[HB + 2 * L + k]
        p = a11 + b11 + f
        q = a12 + b12
        r = a22 + b22 + f
        det = p * r - q * q
        trace = a11 + b11 + a22 + b22
        definite = (p + r > 0.0) & (det > 1e-3 * trace * trace)
        inv = 1.0 / (det if definite else trace * trace)
        s1 = ((r * g1 - q * g2) if definite else trace * g1) * inv
        s2 = ((p * g2 - q * g1) if definite else trace * g2) * inv
        cut = LARGEST_TURN * rsqrt(s1 * s1 + s2 * s2)
        cut = cut if cut < 1.0 else 1.0
        s1 *= cut
        s2 *= cut
        x1 = a1 + a11 * s1 + a12 * s2
        x2 = a2 + a12 * s1 + a22 * s2
        f += 0.5 * (g1 * s1 + g2 * s2)
        mx = nx + s1 * ux + s2 * wx
        my = ny + s1 * uy + s2 * wy
        mz = nz + s1 * uz + s2 * wz
        inv = rsqrt(mx * mx + my * my + mz * mz)
        mx *= inv
        my *= inv
        mz *= inv
        c[N + k] = mx
        c[N + L + k] = my
        c[N + 2 * L + k] = mz
        t[GAP + k] = f
        # the contact lies midway between the two support points
        rx = ha * nx + x1 * ux + x2 * wx + 0.5 * f * mx
        ry = ha * ny + x1 * uy + x2 * wy + 0.5 * f * my
        rz = ha * nz + x1 * uz + x2 * wz + 0.5 * f * mz
        t[RA + k] = rx
        t[RA + L + k] = ry
        t[RA + 2 * L + k] = rz
        t[RB + k] = rx - dx
        t[RB + L + k] = ry - dy
        t[RB + 2 * L + k] = rz - dz
        # R* = sqrt(det Q_A det Q_B / det(Q_A + Q_B))
        det_a = a11 * a22 - a12 * a12
        det_b = b11 * b22 - b12 * b12
        c11 = a11 + b11
        c22 = a22 + b22
        square = det_a * det_b / (c11 * c22 - q * q)
        t[RADIUS + k] = square * rsqrt(square)


@kernel
def plane_geometry(t, c):
    """Gap, effective radius and contact point of each lane's body against a plane.

    Row N holds the plane's normal, pointing from the body into the wall; row OFFSET its distance from the origin along
    it.
    """
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        h = t[HA + k]
        x1 = t[HA + L + k]
        x2 = t[HA + 2 * L + k]
        a11 = t[HA + 3 * L + k]
        a12 = t[HA + 4 * L + k]
        a22 = t[HA + 5 * L + k]
        f = c[OFFSET + k] - nx * t[A + k] - ny * t[A + L + k] - nz * t[A + 2 * L + k] - h
        t[GAP + k] = f
        square = a11 * a22 - a12 * a12
        t[RADIUS + k] = square * rsqrt(square)
        reach = h + 0.5 * f
        t[RA + k] = reach * nx + x1 * t[U + k] + x2 * t[W + k]
        t[RA + L + k] = reach * ny + x1 * t[U + L + k] + x2 * t[W + L + k]
        t[RA + 2 * L + k] = reach * nz + x1 * t[U + 2 * L + k] + x2 * t[W + 2 * L + k]


@kernel
def forces(t, c, dt, tension):
    """Hertz-Mindlin (no slip) with viscous damping and Coulomb's limit, for each lane.

    tension: 1.0 lets the damped normal force pull at the end of an impact (e_out = e_in), 0.0 cuts it at zero.
    F_n = 4/3 E* sqrt(R*) delta^1.5 + 2 sqrt(5/6) beta sqrt(S_n m*) v_n,   S_n = 2 E* sqrt(R* delta)
    F_t = -S_t delta_t - 2 sqrt(5/6) beta sqrt(S_t m*) v_t, |F_t| <= mu_s |F_n|,   S_t = 8 G* sqrt(R* delta)
    The budget of the rolling torque is mu_r |F_n| times the distance of the contact from the centre.
    """
    floor = -1e300 if tension > 0.5 else 0.0
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        rx, ry, rz = t[RA + k], t[RA + L + k], t[RA + 2 * L + k]
        sx, sy, sz = t[RB + k], t[RB + L + k], t[RB + 2 * L + k]
        ox, oy, oz = t[A + 6 * L + k], t[A + 7 * L + k], t[A + 8 * L + k]
        px, py, pz = t[B + 6 * L + k], t[B + 7 * L + k], t[B + 8 * L + k]
        vx = t[A + 3 * L + k] - t[B + 3 * L + k] + oy * rz - oz * ry - (py * sz - pz * sy)
        vy = t[A + 4 * L + k] - t[B + 4 * L + k] + oz * rx - ox * rz - (pz * sx - px * sz)
        vz = t[A + 5 * L + k] - t[B + 5 * L + k] + ox * ry - oy * rx - (px * sy - py * sx)
        vn = vx * nx + vy * ny + vz * nz
        vx -= vn * nx
        vy -= vn * ny
        vz -= vn * nz
        gap = t[GAP + k]
        overlap = -gap if gap < 0.0 else 0.0
        touching = 1.0 if gap < 0.0 else 0.0
        square = t[RADIUS + k] * overlap
        root = square * rsqrt(square)  # contact radius a
        root4 = root * rsqrt(root)
        # sqrt(a m*), m* = 1 / (1 / m_a + 1 / m_b)
        viscous = root4 * rsqrt(t[A + 9 * L + k] + t[B + 9 * L + k])
        fn = t[LAW + k] * root * overlap + t[LAW + 2 * L + k] * viscous * vn
        fn = fn if fn > floor else floor
        # the spring lives in the tangent plane of today's normal
        ex, ey, ez = c[S + k], c[S + L + k], c[S + 2 * L + k]
        en = ex * nx + ey * ny + ez * nz
        ex = touching * (ex - en * nx + vx * dt)
        ey = touching * (ey - en * ny + vy * dt)
        ez = touching * (ez - en * nz + vz * dt)
        stiffness = t[LAW + L + k] * root
        size = abs(fn)
        cap = t[LAW + 4 * L + k] * size
        gx, gy, gz = stiffness * ex, stiffness * ey, stiffness * ez
        cut = cap * rsqrt(gx * gx + gy * gy + gz * gz)
        cut = cut if cut < 1.0 else 1.0
        c[S + k] = cut * ex
        c[S + L + k] = cut * ey
        c[S + 2 * L + k] = cut * ez
        dashpot = t[LAW + 3 * L + k] * viscous
        fx = cut * gx + dashpot * vx
        fy = cut * gy + dashpot * vy
        fz = cut * gz + dashpot * vz
        cut = cap * rsqrt(fx * fx + fy * fy + fz * fz)
        cut = cut if cut < 1.0 else 1.0
        fx = -fn * nx - cut * fx
        fy = -fn * ny - cut * fy
        fz = -fn * nz - cut * fz
        t[TO_A + k] = fx
        t[TO_A + L + k] = fy
        t[TO_A + 2 * L + k] = fz
        t[TO_A + 3 * L + k] = ry * fz - rz * fy
        t[TO_A + 4 * L + k] = rz * fx - rx * fz
        t[TO_A + 5 * L + k] = rx * fy - ry * fx
        t[TO_B + k] = -fx
        t[TO_B + L + k] = -fy
        t[TO_B + 2 * L + k] = -fz
        t[TO_B + 3 * L + k] = -(sy * fz - sz * fy)
        t[TO_B + 4 * L + k] = -(sz * fx - sx * fz)
        t[TO_B + 5 * L + k] = -(sx * fy - sy * fx)
        rolling = t[LAW + 5 * L + k] * size
        square = rx * rx + ry * ry + rz * rz
        t[TO_A + st.ROLL * L + k] = rolling * square * rsqrt(square)
        square = sx * sx + sy * sy + sz * sz
        t[TO_B + st.ROLL * L + k] = rolling * square * rsqrt(square)


@kernel
def open_lanes(t):
    """How many lanes have a gap."""
    n = 0
    for k in range(L):
        n += 1 if t[GAP + k] > 0.0 else 0
    return n
