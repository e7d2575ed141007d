"""The inner loops: geometry of 32 contacts at a time.

A tile is one array of ROWS x LANES doubles: a row is one quantity, a lane one contact. Each loop has a constant number
of lanes and uses only the tile and the tile `c` of the quantities that contacts keep from step to step, so the compiler
makes vector code of it. Unused lanes hold an absent body; their results are not used.
"""

import math

from . import state as st
from .geometry import area, part_terms
from .jit import inlined
from .rows import L, Rows, write_vector
from .simd import rsqrt
from .state import LOAD_COLUMNS, MOST_PARTS, NORMAL, OFFSET, PART, SHAPE

N = NORMAL  # row of the contact's own tile (see `state`)

_rows = Rows()
MOST_COLUMNS = 40
A, B = (
    _rows.take(MOST_COLUMNS),
    _rows.take(MOST_COLUMNS),
)  # columns of the bodies (see `state`), B only of pairs
# The support point of A; the vector between the centres less the support points; curvature matrices of A and of both.
SUPPORT, BETWEEN = _rows.take(3), _rows.take(3)
CURVED, BOTH = _rows.take(6), _rows.take(6)
AREA_A, AREA_B = _rows.take_each(2)  # product of the principal radii of curvature
GAP = _rows.take()
RADIUS = _rows.take()  # effective radius
RA, RB = _rows.take(3), _rows.take(3)  # contact point relative to each centre
# As the columns of `load`: force and torque on each body and the budget of the rolling torque.
TO_A, TO_B = _rows.take(LOAD_COLUMNS), _rows.take(LOAD_COLUMNS)
PUSH = _rows.take()  # normal force that limits friction and rolling
CIRCLE = (
    _rows.take()
)  # radius of the contact circle, written by the contact law; 0 where nothing touches
# The tangential dashpot [N s/m], written by the contact law, and the share of it that acts.
DASHPOT, SHARE = _rows.take_each(2)
STEP = _rows.take(3)  # how far the normal turns
V = _rows.take(3)  # tangential velocity of A against B
VN = _rows.take()  # normal velocity
# Inverse of the mass in the damping: the mass of both bodies at the contact, along the normal, divided by the number
# of contacts that share it.
INVERSE_MASS = _rows.take()
# Rows of the force laws, each beginning with its constants.
MOST_ROLLING_ROWS = 16
ROLLING = _rows.take(MOST_ROLLING_ROWS)
LAW = _rows.end
LAW_ROW = _rows.count

# The gap of a body beyond the edge of a plane [m]: the next search comes when it has moved at all.
BEYOND = math.inf
# Shortest distance of two centres in the calculation of a direction [m].
NEAREST = 1e-30
# A contact normal turns by at most this much in a step [rad].
LARGEST_TURN = 0.2


@inlined
def fill_constants(t, at, constants):
    """Give every lane the same constants of a force law."""
    for c in range(constants.shape[0]):
        for k in range(L):
            t[at + c * L + k] = constants[c]


@inlined
def lane_part(t, shape, k, nx, ny, nz):
    """`part_terms` of one part of a lane's body."""
    xx, xy, xz = t[shape + k], t[shape + L + k], t[shape + 2 * L + k]
    yy, yz, zz = t[shape + 3 * L + k], t[shape + 4 * L + k], t[shape + 5 * L + k]
    return part_terms(xx, xy, xz, yy, yz, zz, nx, ny, nz)


@inlined
def body_terms(t, shape, parts, k, nx, ny, nz):
    """`part_terms` of a lane's body, summed over its parts."""
    x, y, z, xx, xy, xz, yy, yz, zz = lane_part(t, shape, k, nx, ny, nz)
    for part in range(1, parts):
        dx, dy, dz, dxx, dxy, dxz, dyy, dyz, dzz = lane_part(
            t, shape + part * PART * L, k, nx, ny, nz
        )
        x, y, z = x + dx, y + dy, z + dz
        xx, xy, xz, yy, yz, zz = (
            xx + dxx,
            xy + dxy,
            xz + dxz,
            yy + dyy,
            yz + dyz,
            zz + dzz,
        )
    return x, y, z, xx, xy, xz, yy, yz, zz


@inlined
def write_matrix(t, at, k, xx, xy, xz, yy, yz, zz):
    """Write a symmetric matrix to six rows of a lane."""
    write_vector(t, at, k, xx, xy, xz)
    write_vector(t, at + 3 * L, k, yy, yz, zz)


@inlined
def body_a(t, c, parts):
    """Rows SUPPORT, CURVED and AREA_A."""
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        x, y, z, xx, xy, xz, yy, yz, zz = body_terms(
            t, A + SHAPE * L, parts, k, nx, ny, nz
        )
        write_vector(t, SUPPORT, k, x, y, z)
        write_matrix(t, CURVED, k, xx, xy, xz, yy, yz, zz)
        t[AREA_A + k] = area(xx, xy, xz, yy, yz, zz)


@inlined
def body_b(t, c, parts):
    """Rows BETWEEN, BOTH and AREA_B; for the opposite normal the support point of a body has the opposite sign."""
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        x, y, z, xx, xy, xz, yy, yz, zz = body_terms(
            t, B + SHAPE * L, parts, k, nx, ny, nz
        )
        t[BETWEEN + k] = t[B + k] - t[A + k] - t[SUPPORT + k] - x
        t[BETWEEN + L + k] = t[B + L + k] - t[A + L + k] - t[SUPPORT + L + k] - y
        t[BETWEEN + 2 * L + k] = (
            t[B + 2 * L + k] - t[A + 2 * L + k] - t[SUPPORT + 2 * L + k] - z
        )
        t[AREA_B + k] = area(xx, xy, xz, yy, yz, zz)
        xx, xy, xz = (
            t[CURVED + k] + xx,
            t[CURVED + L + k] + xy,
            t[CURVED + 2 * L + k] + xz,
        )
        yy, yz, zz = (
            t[CURVED + 3 * L + k] + yy,
            t[CURVED + 4 * L + k] + yz,
            t[CURVED + 5 * L + k] + zz,
        )
        write_matrix(t, BOTH, k, xx, xy, xz, yy, yz, zz)


@inlined
def newton_step(t, c):
    """One Newton step on the gap of each lane's pair, the gap after it, and the effective radius.

    The step s lies in the tangent plane, as does the gradient g; there the curvature C of both bodies is a 2 x 2
    matrix. With T = C + f I, s = T^-1 g = (tr T g - T g) / det T by Cayley and Hamilton: no tangents are needed. The
    gap at the new normal comes from the expansion at the old one, to third order in the step. The effective radius is
    R* = sqrt(det Q_A det Q_B / det(Q_A + Q_B)).
    """
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        x, y, z = t[BETWEEN + k], t[BETWEEN + L + k], t[BETWEEN + 2 * L + k]
        xx, xy, xz = t[BOTH + k], t[BOTH + L + k], t[BOTH + 2 * L + k]
        yy, yz, zz = t[BOTH + 3 * L + k], t[BOTH + 4 * L + k], t[BOTH + 5 * L + k]
        f = nx * x + ny * y + nz * z
        x, y, z = x - f * nx, y - f * ny, z - f * nz
        trace = xx + yy + zz
        both = area(xx, xy, xz, yy, yz, zz)
        product = t[AREA_A + k] * t[AREA_B + k]
        t[RADIUS + k] = product * rsqrt(product * both)
        det = both + f * (trace + f)
        definite = (trace + 2.0 * f > 0.0) & (det > 1e-3 * trace * trace)
        inv = 1.0 / (det if definite else trace * trace)
        along = inv * (trace + f if definite else trace)
        turned = inv if definite else 0.0
        sx = along * x - turned * (xx * x + xy * y + xz * z)
        sy = along * y - turned * (xy * x + yy * y + yz * z)
        sz = along * z - turned * (xz * x + yz * y + zz * z)
        cut = LARGEST_TURN * rsqrt(sx * sx + sy * sy + sz * sz)
        cut = cut if cut < 1.0 else 1.0
        sx, sy, sz = cut * sx, cut * sy, cut * sz
        write_vector(t, STEP, k, sx, sy, sz)
        t[GAP + k] = f + 0.5 * (x * sx + y * sy + z * sz)


@inlined
def contact_points(t, c):
    """Turn each lane's normal by its step, and find the contact point by an expansion to second order."""
    for k in range(L):
        sx, sy, sz = t[STEP + k], t[STEP + L + k], t[STEP + 2 * L + k]
        mx, my, mz = c[N + k] + sx, c[N + L + k] + sy, c[N + 2 * L + k] + sz
        inv = rsqrt(mx * mx + my * my + mz * mz)
        mx, my, mz = inv * mx, inv * my, inv * mz
        write_vector(c, N, k, mx, my, mz)
        xx, xy, xz = t[CURVED + k], t[CURVED + L + k], t[CURVED + 2 * L + k]
        yy, yz, zz = t[CURVED + 3 * L + k], t[CURVED + 4 * L + k], t[CURVED + 5 * L + k]
        # the contact lies midway between the two support points
        half = 0.5 * t[GAP + k]
        rx = t[SUPPORT + k] + xx * sx + xy * sy + xz * sz + half * mx
        ry = t[SUPPORT + L + k] + xy * sx + yy * sy + yz * sz + half * my
        rz = t[SUPPORT + 2 * L + k] + xz * sx + yz * sy + zz * sz + half * mz
        write_vector(t, RA, k, rx, ry, rz)
        t[RB + k] = rx + t[A + k] - t[B + k]
        t[RB + L + k] = ry + t[A + L + k] - t[B + L + k]
        t[RB + 2 * L + k] = rz + t[A + 2 * L + k] - t[B + 2 * L + k]


@inlined
def both_bodies(t, c, parts):
    """Compute the terms of both bodies that the Newton step needs."""
    body_a(t, c, parts)
    body_b(t, c, parts)


@inlined
def sphere_pair_geometry(t, c):
    """Compute the same for pairs of spheres, in closed form; where both centres coincide the last normal stays."""
    for k in range(L):
        dx, dy, dz = (
            t[B + k] - t[A + k],
            t[B + L + k] - t[A + L + k],
            t[B + 2 * L + k] - t[A + 2 * L + k],
        )
        ra, rb = t[A + st.SPHERE_RADIUS * L + k], t[B + st.SPHERE_RADIUS * L + k]
        square = dx * dx + dy * dy + dz * dz
        apart = square > NEAREST * NEAREST
        inv = rsqrt(square if apart else 1.0)
        nx = inv * dx if apart else c[N + k]
        ny = inv * dy if apart else c[N + L + k]
        nz = inv * dz if apart else c[N + 2 * L + k]
        gap = inv * square - ra - rb
        write_vector(c, N, k, nx, ny, nz)
        t[GAP + k] = gap
        t[RADIUS + k] = ra * rb / (ra + rb)
        t[AREA_A + k], t[AREA_B + k] = ra * ra, rb * rb
        reach = ra + 0.5 * gap
        write_vector(t, RA, k, reach * nx, reach * ny, reach * nz)
        reach = -(rb + 0.5 * gap)
        write_vector(t, RB, k, reach * nx, reach * ny, reach * nz)


@inlined
def pair_geometry(t, c, parts):
    """Gap, effective radius and contact point of each lane's pair, one Newton step on from the last normal.

    Several short loops instead of one: a processor runs as many lanes at once as its window holds. The number of parts
    is a constant in each, so that they become vector code.
    """
    if parts == st.SPHERES:
        sphere_pair_geometry(t, c)
        return
    if parts == 1:
        both_bodies(t, c, 1)
    elif parts == 2:
        both_bodies(t, c, 2)
    else:
        both_bodies(t, c, MOST_PARTS)
    newton_step(t, c)
    contact_points(t, c)


@inlined
def sphere_a(t, c):
    """Rows SUPPORT and AREA_A of spheres."""
    for k in range(L):
        radius = t[A + st.SPHERE_RADIUS * L + k]
        write_vector(
            t,
            SUPPORT,
            k,
            radius * c[N + k],
            radius * c[N + L + k],
            radius * c[N + 2 * L + k],
        )
        t[AREA_A + k] = radius * radius


@inlined
def is_on_disc(c, k, x, y, z, nx, ny, nz):
    """Whether a place lies within the disc of a lane's plane, seen along its normal."""
    dx, dy, dz = (
        x - c[st.MIDDLE + k],
        y - c[st.MIDDLE + L + k],
        z - c[st.MIDDLE + 2 * L + k],
    )
    across = dx * nx + dy * ny + dz * nz
    return dx * dx + dy * dy + dz * dz - across * across <= c[st.RADIUS2 + k]


@inlined
def plane_geometry(t, c, parts):
    """Gap, effective radius and contact point of each lane's body against a plane.

    Rows of the tile: N is the plane's normal, pointing from the body into the wall, OFFSET its distance from the origin
    along the normal, MIDDLE and RADIUS2 its disc, beyond which the gap is infinite.
    """
    if parts == st.SPHERES:
        sphere_a(t, c)
    elif parts == 1:
        body_a(t, c, 1)
    elif parts == 2:
        body_a(t, c, 2)
    else:
        body_a(t, c, MOST_PARTS)
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        rx, ry, rz = t[SUPPORT + k], t[SUPPORT + L + k], t[SUPPORT + 2 * L + k]
        f = (
            c[OFFSET + k]
            - nx * (t[A + k] + rx)
            - ny * (t[A + L + k] + ry)
            - nz * (t[A + 2 * L + k] + rz)
        )
        rx, ry, rz = rx + 0.5 * f * nx, ry + 0.5 * f * ny, rz + 0.5 * f * nz
        t[RADIUS + k] = math.sqrt(t[AREA_A + k])
        write_vector(t, RA, k, rx, ry, rz)
        x, y, z = t[A + k] + rx, t[A + L + k] + ry, t[A + 2 * L + k] + rz
        t[GAP + k] = f if is_on_disc(c, k, x, y, z, nx, ny, nz) else BEYOND


@inlined
def torques(t):
    """Torques of each lane's force and its dashpot on both bodies, and the force on B."""
    for k in range(L):
        fx, fy, fz = t[TO_A + k], t[TO_A + L + k], t[TO_A + 2 * L + k]
        rx, ry, rz = t[RA + k], t[RA + L + k], t[RA + 2 * L + k]
        sx, sy, sz = t[RB + k], t[RB + L + k], t[RB + 2 * L + k]
        write_vector(
            t, TO_A + 3 * L, k, ry * fz - rz * fy, rz * fx - rx * fz, rx * fy - ry * fx
        )
        t[TO_A + st.DASHPOTS * L + k] = t[DASHPOT + k] * (rx * rx + ry * ry + rz * rz)
        write_vector(t, TO_B, k, -fx, -fy, -fz)
        write_vector(
            t, TO_B + 3 * L, k, sz * fy - sy * fz, sx * fz - sz * fx, sy * fx - sx * fy
        )
        t[TO_B + st.DASHPOTS * L + k] = t[DASHPOT + k] * (sx * sx + sy * sy + sz * sz)


@inlined
def open_lanes(t):
    """Count the lanes with a gap."""
    n = 0
    for k in range(L):
        n += 1 if t[GAP + k] > 0.0 else 0
    return n
