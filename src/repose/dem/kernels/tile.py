"""The hot loops: geometry of 32 contacts at a time.

A tile is one array of ROWS x LANES doubles; a row is one quantity, a lane one contact. Every loop runs over the lanes
with a constant count and touches nothing but the tile and the tile of what persists (`c` below), so
the compiler turns it into vector code: rows lie at constant distances in two arrays, and whether those overlap is one
check a loop. Unused lanes hold a body that is not there and are thrown away.
"""

import math

from . import state as st
from .geometry import tangents
from .jit import inlined
from .rows import Rows
from .state import LANES, LOAD_COLUMNS, NORMAL, OFFSET, PART, SHAPE

L = LANES  # short, for the index arithmetic below

N = NORMAL  # row of what persists (see `state`)

_rows = Rows()
MOST_COLUMNS = 40
A, B = (
    _rows.take(MOST_COLUMNS),
    _rows.take(MOST_COLUMNS),
)  # columns of the bodies (see `state`), B only of pairs
U, W = _rows.take(3), _rows.take(3)  # two tangents
HA, HB = _rows.take(6), _rows.take(6)  # support sums h, x.u, x.w, Q_uu, Q_uw, Q_ww
GAP = _rows.take()
RADIUS = _rows.take()  # effective radius
RA, RB = _rows.take(3), _rows.take(3)  # contact point relative to each centre
# As the columns of `load`: force and torque on each body and the budget of the rolling torque.
TO_A, TO_B = _rows.take(LOAD_COLUMNS), _rows.take(LOAD_COLUMNS)
PUSH = _rows.take()  # normal force that limits friction and rolling
STEP = _rows.take(2)  # how far the normal turns along each tangent
V = _rows.take(3)  # tangential velocity of A against B
VN = _rows.take()  # normal velocity
# Inverse of the mass that the damping is for: that of both bodies at the contact, along the normal, divided by the
# number of contacts that share it.
INVERSE_MASS = _rows.take()
# Rows of the force laws, each beginning with its constants.
MOST_ROLLING_ROWS = 16
ROLLING = _rows.take(MOST_ROLLING_ROWS)
LAW = _rows.end
LAW_ROW = _rows.count

# The gap of a body beyond the edge of a plane [m]: the next look comes when it has moved at all.
BEYOND = math.inf
# Squared extent below which a part of a shape is none [m2].
NO_PART = 1e-300
# A contact normal turns by at most this much in a step [rad].
LARGEST_TURN = 0.2


@inlined
def fill_constants(t, at, constants):
    """Give every lane the same constants of a force law."""
    for c in range(constants.shape[0]):
        for k in range(L):
            t[at + c * L + k] = constants[c]


@inlined
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
        inv = 1.0 / math.sqrt(max(square, NO_PART))
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


@inlined
def body_a(t, c, parts):
    """Support sums of body A (the offsets must be constants for the loops to become vector code)."""
    support_part(t, c, A + SHAPE * L, HA, 0.0)
    if parts > 1:
        support_part(t, c, A + (SHAPE + PART) * L, HA, 1.0)
    if parts > 2:
        support_part(t, c, A + (SHAPE + 2 * PART) * L, HA, 1.0)


@inlined
def body_b(t, c, parts):
    """Support sums of body B."""
    support_part(t, c, B + SHAPE * L, HB, 0.0)
    if parts > 1:
        support_part(t, c, B + (SHAPE + PART) * L, HB, 1.0)
    if parts > 2:
        support_part(t, c, B + (SHAPE + 2 * PART) * L, HB, 1.0)


@inlined
def newton_step(t, c):
    """One Newton step on the gap of each lane's pair: the step along both tangents, and the gap after it.

    The gap at the new normal comes from the expansion at the old one, to third order in the step.
    """
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        dx = t[B + k] - t[A + k]
        dy = t[B + L + k] - t[A + L + k]
        dz = t[B + 2 * L + k] - t[A + 2 * L + k]
        f = nx * dx + ny * dy + nz * dz - t[HA + k] - t[HB + k]
        g1 = t[U + k] * dx + t[U + L + k] * dy + t[U + 2 * L + k] * dz - t[HA + L + k] - t[HB + L + k]
        g2 = t[W + k] * dx + t[W + L + k] * dy + t[W + 2 * L + k] * dz - t[HA + 2 * L + k] - t[HB + 2 * L + k]
        c11 = t[HA + 3 * L + k] + t[HB + 3 * L + k]
        q = t[HA + 4 * L + k] + t[HB + 4 * L + k]
        c22 = t[HA + 5 * L + k] + t[HB + 5 * L + k]
        p = c11 + f
        r = c22 + f
        det = p * r - q * q
        trace = c11 + c22
        definite = (p + r > 0.0) & (det > 1e-3 * trace * trace)
        inv = 1.0 / (det if definite else trace * trace)
        s1 = ((r * g1 - q * g2) if definite else trace * g1) * inv
        s2 = ((p * g2 - q * g1) if definite else trace * g2) * inv
        cut = LARGEST_TURN / math.sqrt(s1 * s1 + s2 * s2)
        cut = cut if cut < 1.0 else 1.0
        s1 *= cut
        s2 *= cut
        t[STEP + k] = s1
        t[STEP + L + k] = s2
        t[GAP + k] = f + 0.5 * (g1 * s1 + g2 * s2)


@inlined
def contact_points(t, c):
    """Turn each lane's normal by its step; the contact point there, from the expansion to second order."""
    for k in range(L):
        ux, uy, uz = t[U + k], t[U + L + k], t[U + 2 * L + k]
        wx, wy, wz = t[W + k], t[W + L + k], t[W + 2 * L + k]
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        s1 = t[STEP + k]
        s2 = t[STEP + L + k]
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
        # the contact lies midway between the two support points
        ha = t[HA + k]
        x1 = t[HA + L + k] + t[HA + 3 * L + k] * s1 + t[HA + 4 * L + k] * s2
        x2 = t[HA + 2 * L + k] + t[HA + 4 * L + k] * s1 + t[HA + 5 * L + k] * s2
        half = 0.5 * t[GAP + k]
        rx = ha * nx + x1 * ux + x2 * wx + half * mx
        ry = ha * ny + x1 * uy + x2 * wy + half * my
        rz = ha * nz + x1 * uz + x2 * wz + half * mz
        t[RA + k] = rx
        t[RA + L + k] = ry
        t[RA + 2 * L + k] = rz
        t[RB + k] = rx + t[A + k] - t[B + k]
        t[RB + L + k] = ry + t[A + L + k] - t[B + L + k]
        t[RB + 2 * L + k] = rz + t[A + 2 * L + k] - t[B + 2 * L + k]


@inlined
def pair_radius(t):
    """R* = sqrt(det Q_A det Q_B / det(Q_A + Q_B)) of each lane's pair."""
    for k in range(L):
        a11, a12, a22 = t[HA + 3 * L + k], t[HA + 4 * L + k], t[HA + 5 * L + k]
        b11, b12, b22 = t[HB + 3 * L + k], t[HB + 4 * L + k], t[HB + 5 * L + k]
        both = (a11 + b11) * (a22 + b22) - (a12 + b12) * (a12 + b12)
        t[RADIUS + k] = math.sqrt((a11 * a22 - a12 * a12) * (b11 * b22 - b12 * b12) / both)


@inlined
def pair_geometry(t, c):
    """Gap, effective radius and contact point of each lane's pair, one Newton step on from the last normal.

    Several short loops, not one: a processor runs as many lanes at once as its window holds.
    """
    newton_step(t, c)
    contact_points(t, c)
    pair_radius(t)


@inlined
def plane_geometry(t, c):
    """Gap, effective radius and contact point of each lane's body against a plane.

    Row N holds the plane's normal, pointing from the body into the wall; row OFFSET its distance from the origin along
    it, MIDDLE and RADIUS2 the disc it ends with: beyond that the gap is endless.
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
        square = a11 * a22 - a12 * a12
        t[RADIUS + k] = math.sqrt(square)
        reach = h + 0.5 * f
        rx = reach * nx + x1 * t[U + k] + x2 * t[W + k]
        ry = reach * ny + x1 * t[U + L + k] + x2 * t[W + L + k]
        rz = reach * nz + x1 * t[U + 2 * L + k] + x2 * t[W + 2 * L + k]
        t[RA + k] = rx
        t[RA + L + k] = ry
        t[RA + 2 * L + k] = rz
        dx = t[A + k] + rx - c[st.MIDDLE + k]
        dy = t[A + L + k] + ry - c[st.MIDDLE + L + k]
        dz = t[A + 2 * L + k] + rz - c[st.MIDDLE + 2 * L + k]
        across = dx * nx + dy * ny + dz * nz
        t[GAP + k] = f if dx * dx + dy * dy + dz * dz - across * across <= c[st.RADIUS2 + k] else BEYOND


@inlined
def torques(t):
    """Torques of each lane's force on both bodies, and the force on B."""
    for k in range(L):
        fx, fy, fz = t[TO_A + k], t[TO_A + L + k], t[TO_A + 2 * L + k]
        rx, ry, rz = t[RA + k], t[RA + L + k], t[RA + 2 * L + k]
        sx, sy, sz = t[RB + k], t[RB + L + k], t[RB + 2 * L + k]
        t[TO_A + 3 * L + k] = ry * fz - rz * fy
        t[TO_A + 4 * L + k] = rz * fx - rx * fz
        t[TO_A + 5 * L + k] = rx * fy - ry * fx
        t[TO_B + k] = -fx
        t[TO_B + L + k] = -fy
        t[TO_B + 2 * L + k] = -fz
        t[TO_B + 3 * L + k] = sz * fy - sy * fz
        t[TO_B + 4 * L + k] = sx * fz - sz * fx
        t[TO_B + 5 * L + k] = sy * fx - sx * fy


@inlined
def open_lanes(t):
    """How many lanes have a gap."""
    n = 0
    for k in range(L):
        n += 1 if t[GAP + k] > 0.0 else 0
    return n
