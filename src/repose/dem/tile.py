"""The hot loops: geometry and force law of 32 contacts at a time.

A tile is one array of ROWS x LANES doubles; a row is one quantity, a lane one contact. Every loop runs over the lanes
with a constant count and touches nothing but the tile and the tile of what persists (normal and spring, `c` below), so
the compiler turns it into vector code: rows lie at constant distances in two arrays, and whether those overlap is one
check a loop. Unused lanes hold copies of a real contact and are thrown away.
"""

import math

from .geometry import tangents, to_body
from .jit import inlined, kernel
from .state import LANES, NORMAL, OFFSET, SPRING

# rows of what persists (see `state`)
N = NORMAL
S = SPRING

# rows: position of B from A (for a wall, the position of A), velocity of A less that of B
D = 0
DV = 3 * LANES
# rows: the two bodies (quaternion, angular velocity)
A = 6 * LANES
B = 13 * LANES
# rows: normal and tangents in each body's frame
FA = 20 * LANES
FB = 29 * LANES
# rows: support sums h, x.u, x.w, Q_uu, Q_uw, Q_ww
HA = 38 * LANES
HB = 44 * LANES
# rows: gap, effective radius, contact point relative to each centre
GAP = 50 * LANES
RADIUS = 51 * LANES
RA = 52 * LANES
RB = 55 * LANES
# rows: force on A, torques, normal force times arm (what rolling friction scales with)
F = 58 * LANES
TA = 61 * LANES
TB = 64 * LANES
ROLL_A = 67 * LANES
ROLL_B = 68 * LANES
ROWS = 69

L = LANES  # short, for the index arithmetic below

# A contact normal turns by at most this much in a step [rad].
LARGEST_TURN2 = 0.04


@inlined
def frames(t, c, body, frame):
    """Normal and tangents of each lane in the frame of one of its bodies."""
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        ux, uy, uz, _wx, _wy, _wz = tangents(nx, ny, nz)
        qw = t[body + k]
        qx = t[body + L + k]
        qy = t[body + 2 * L + k]
        qz = t[body + 3 * L + k]
        n1, n2, n3 = to_body(qw, qx, qy, qz, nx, ny, nz)
        u1, u2, u3 = to_body(qw, qx, qy, qz, ux, uy, uz)
        t[frame + k] = n1
        t[frame + L + k] = n2
        t[frame + 2 * L + k] = n3
        t[frame + 3 * L + k] = u1
        t[frame + 4 * L + k] = u2
        t[frame + 5 * L + k] = u3
        t[frame + 6 * L + k] = n2 * u3 - n3 * u2
        t[frame + 7 * L + k] = n3 * u1 - n1 * u3
        t[frame + 8 * L + k] = n1 * u2 - n2 * u1


@inlined
def supports(t, squares, frame, sums):
    """Sum the support terms of the K ellipsoids of a body (see geometry.support_terms)."""
    for part in range(squares.shape[0]):
        a = squares[part, 0]
        b = squares[part, 1]
        c = squares[part, 2]
        keep = 0.0 if part == 0 else 1.0
        for k in range(L):
            n1, n2, n3 = t[frame + k], t[frame + L + k], t[frame + 2 * L + k]
            u1, u2, u3 = t[frame + 3 * L + k], t[frame + 4 * L + k], t[frame + 5 * L + k]
            w1, w2, w3 = t[frame + 6 * L + k], t[frame + 7 * L + k], t[frame + 8 * L + k]
            x1 = a * n1
            x2 = b * n2
            x3 = c * n3
            h = math.sqrt(x1 * n1 + x2 * n2 + x3 * n3)
            inv = 1.0 / h
            xu = (x1 * u1 + x2 * u2 + x3 * u3) * inv
            xw = (x1 * w1 + x2 * w2 + x3 * w3) * inv
            t[sums + k] = keep * t[sums + k] + h
            t[sums + L + k] = keep * t[sums + L + k] + xu
            t[sums + 2 * L + k] = keep * t[sums + 2 * L + k] + xw
            t[sums + 3 * L + k] = (
                keep * t[sums + 3 * L + k] + (a * u1 * u1 + b * u2 * u2 + c * u3 * u3 - xu * xu) * inv
            )
            t[sums + 4 * L + k] = (
                keep * t[sums + 4 * L + k] + (a * u1 * w1 + b * u2 * w2 + c * u3 * w3 - xu * xw) * inv
            )
            t[sums + 5 * L + k] = (
                keep * t[sums + 5 * L + k] + (a * w1 * w1 + b * w2 * w2 + c * w3 * w3 - xw * xw) * inv
            )


@kernel
def body_a(t, c, squares):
    """Support sums of body A (the offsets must be constants for the loops to become vector code)."""
    frames(t, c, A, FA)
    supports(t, squares, FA, HA)


@kernel
def body_b(t, c, squares):
    """Support sums of body B."""
    frames(t, c, B, FB)
    supports(t, squares, FB, HB)


@kernel
def pair_geometry(t, c):
    """One Newton step on the gap of each lane's pair; gap, effective radius and contact point at the new normal.

    The values at the new normal come from the expansion at the old one (gap to third order in the step, points to
    second), so each contact costs one evaluation a time step.
    """
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
        dx = t[D + k]
        dy = t[D + L + k]
        dz = t[D + 2 * L + k]
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
        step2 = s1 * s1 + s2 * s2
        cut = math.sqrt(LARGEST_TURN2 / step2) if step2 > LARGEST_TURN2 else 1.0
        s1 *= cut
        s2 *= cut
        x1 = a1 + a11 * s1 + a12 * s2
        x2 = a2 + a12 * s1 + a22 * s2
        f += 0.5 * (g1 * s1 + g2 * s2)
        mx = nx + s1 * ux + s2 * wx
        my = ny + s1 * uy + s2 * wy
        mz = nz + s1 * uz + s2 * wz
        inv = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
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
        t[RADIUS + k] = math.sqrt(det_a * det_b / (c11 * c22 - q * q))


@kernel
def plane_geometry(t, c):
    """Gap, effective radius and contact point of each lane's body against a plane.

    Row N holds the plane's normal, pointing from the body into the wall; row OFFSET its distance from the origin along
    it; row D the body's position.
    """
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        ux, uy, uz, wx, wy, wz = tangents(nx, ny, nz)
        h = t[HA + k]
        x1 = t[HA + L + k]
        x2 = t[HA + 2 * L + k]
        a11 = t[HA + 3 * L + k]
        a12 = t[HA + 4 * L + k]
        a22 = t[HA + 5 * L + k]
        f = c[OFFSET + k] - nx * t[D + k] - ny * t[D + L + k] - nz * t[D + 2 * L + k] - h
        t[GAP + k] = f
        t[RADIUS + k] = math.sqrt(a11 * a22 - a12 * a12)
        reach = h + 0.5 * f
        t[RA + k] = reach * nx + x1 * ux + x2 * wx
        t[RA + L + k] = reach * ny + x1 * uy + x2 * wy
        t[RA + 2 * L + k] = reach * nz + x1 * uz + x2 * wz
        # a wall's velocity rows are those of the contact point already
        t[RB + k] = 0.0
        t[RB + L + k] = 0.0
        t[RB + 2 * L + k] = 0.0


@kernel
def forces(t, c, law, dt, tension):
    """Hertz-Mindlin (no slip) with viscous damping and Coulomb's limit, for each lane.

    law: E* [Pa], G* [Pa], m* [kg], damping ratio beta (negative of ln e / sqrt(ln2 e + pi2)), static friction;
    tension: 1.0 lets the damped normal force pull at the end of an impact (e_out = e_in), 0.0 cuts it at zero.
    F_n = 4/3 E* sqrt(R*) delta^1.5 + 2 sqrt(5/6) beta sqrt(S_n m*) v_n,   S_n = 2 E* sqrt(R* delta)
    F_t = -S_t delta_t - 2 sqrt(5/6) beta sqrt(S_t m*) v_t, |F_t| <= mu_s |F_n|,   S_t = 8 G* sqrt(R* delta)
    """
    young = law[0]
    shear = law[1]
    damping = 2.0 * math.sqrt(5.0 / 6.0) * law[3]
    damp_n = damping * math.sqrt(2.0 * young * law[2])
    damp_t = damping * math.sqrt(8.0 * shear * law[2])
    friction = law[4]
    floor = -1e300 if tension > 0.5 else 0.0
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        rx, ry, rz = t[RA + k], t[RA + L + k], t[RA + 2 * L + k]
        sx, sy, sz = t[RB + k], t[RB + L + k], t[RB + 2 * L + k]
        ox, oy, oz = t[A + 4 * L + k], t[A + 5 * L + k], t[A + 6 * L + k]
        px, py, pz = t[B + 4 * L + k], t[B + 5 * L + k], t[B + 6 * L + k]
        vx = t[DV + k] + oy * rz - oz * ry - (py * sz - pz * sy)
        vy = t[DV + L + k] + oz * rx - ox * rz - (pz * sx - px * sz)
        vz = t[DV + 2 * L + k] + ox * ry - oy * rx - (px * sy - py * sx)
        vn = vx * nx + vy * ny + vz * nz
        vx -= vn * nx
        vy -= vn * ny
        vz -= vn * nz
        gap = t[GAP + k]
        overlap = -gap if gap < 0.0 else 0.0
        touching = 1.0 if gap < 0.0 else 0.0
        root = math.sqrt(t[RADIUS + k] * overlap)  # contact radius a
        root4 = math.sqrt(root)
        fn = (4.0 / 3.0) * young * root * overlap + damp_n * root4 * vn
        fn = fn if fn > floor else floor
        # the spring lives in the tangent plane of today's normal
        ex, ey, ez = c[S + k], c[S + L + k], c[S + 2 * L + k]
        en = ex * nx + ey * ny + ez * nz
        ex = touching * (ex - en * nx + vx * dt)
        ey = touching * (ey - en * ny + vy * dt)
        ez = touching * (ez - en * nz + vz * dt)
        stiffness = 8.0 * shear * root
        cap = friction * abs(fn)
        spring = stiffness * math.sqrt(ex * ex + ey * ey + ez * ez)
        cut = cap / spring if spring > cap else 1.0
        ex *= cut
        ey *= cut
        ez *= cut
        c[S + k] = ex
        c[S + L + k] = ey
        c[S + 2 * L + k] = ez
        dashpot = damp_t * root4
        fx = stiffness * ex + dashpot * vx
        fy = stiffness * ey + dashpot * vy
        fz = stiffness * ez + dashpot * vz
        pull = math.sqrt(fx * fx + fy * fy + fz * fz)
        cut = cap / pull if pull > cap else 1.0
        fx = -fn * nx - cut * fx
        fy = -fn * ny - cut * fy
        fz = -fn * nz - cut * fz
        t[F + k] = fx
        t[F + L + k] = fy
        t[F + 2 * L + k] = fz
        t[TA + k] = ry * fz - rz * fy
        t[TA + L + k] = rz * fx - rx * fz
        t[TA + 2 * L + k] = rx * fy - ry * fx
        t[TB + k] = -(sy * fz - sz * fy)
        t[TB + L + k] = -(sz * fx - sx * fz)
        t[TB + 2 * L + k] = -(sx * fy - sy * fx)
        fn = abs(fn)
        t[ROLL_A + k] = fn * math.sqrt(rx * rx + ry * ry + rz * rz)
        t[ROLL_B + k] = fn * math.sqrt(sx * sx + sy * sy + sz * sz)
