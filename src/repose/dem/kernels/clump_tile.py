"""The inner loops of clumps: 32 contacts at a time, of two spheres in closed form or of a sphere with a plane.

A contact stores the places of its spheres in their bodies and their radii; the rows of the bodies have their positions
and, in the columns of the shape, their quaternions.
"""

import math

from . import state as st
from . import tile as tl
from .jit import inlined
from .rows import L, Rows, write_vector
from .state import OFFSET, SHAPE

N = st.NORMAL
# Rows that a pair of spheres keeps: centres in their bodies' frames, radius of the first, sum of the radii, effective
# radius.
_pair = Rows(st.PAIR_STATE)
CENTRE_A, CENTRE_B = _pair.take(3), _pair.take(3)
RADIUS_A, REACH, CURVATURE = _pair.take_each(3)
PAIR_STATE = _pair.end  # where the force laws' rows begin
# Rows that a sphere on a wall keeps: centre, radius.
_wall = Rows(st.WALL_STATE)
CENTRE, RADIUS = _wall.take(3), _wall.take()
WALL_STATE = _wall.end
# Rows of the scratch tile: the centres of the spheres from those of the bodies, in world axes.
ARM_A, ARM_B = tl.SUPPORT, tl.BETWEEN
# Shortest distance of two centres in the calculation of a direction [m].
NEAREST = 1e-30


@inlined
def rotated_vector(w, x, y, z, px, py, pz):
    """Return a vector (px, py, pz) rotated by a unit quaternion (w, x, y, z)."""
    ux = 2.0 * (y * pz - z * py)
    uy = 2.0 * (z * px - x * pz)
    uz = 2.0 * (x * py - y * px)
    return (
        px + w * ux + (y * uz - z * uy),
        py + w * uy + (z * ux - x * uz),
        pz + w * uz + (x * uy - y * ux),
    )


@inlined
def write_arms(t, c, body, centre, to):
    """Write the arm of each lane, in world axes: from the centre of the body to the centre of its sphere."""
    for k in range(L):
        w, x = t[body + SHAPE * L + k], t[body + (SHAPE + 1) * L + k]
        y, z = t[body + (SHAPE + 2) * L + k], t[body + (SHAPE + 3) * L + k]
        px, py, pz = rotated_vector(
            w, x, y, z, c[centre + k], c[centre + L + k], c[centre + 2 * L + k]
        )
        write_vector(t, to, k, px, py, pz)


@inlined
def sphere_pair_geometry(t, c):
    """Compute normal, gap, effective radius and contact point of each lane's pair of spheres."""
    write_arms(t, c, tl.A, CENTRE_A, ARM_A)
    write_arms(t, c, tl.B, CENTRE_B, ARM_B)
    for k in range(L):
        dx = t[tl.B + k] - t[tl.A + k]
        dy = t[tl.B + L + k] - t[tl.A + L + k]
        dz = t[tl.B + 2 * L + k] - t[tl.A + 2 * L + k]
        ax, ay, az = t[ARM_A + k], t[ARM_A + L + k], t[ARM_A + 2 * L + k]
        sx = dx + t[ARM_B + k] - ax
        sy = dy + t[ARM_B + L + k] - ay
        sz = dz + t[ARM_B + 2 * L + k] - az
        distance = math.sqrt(sx * sx + sy * sy + sz * sz)
        inv = 1.0 / (distance if distance > NEAREST else NEAREST)
        nx, ny, nz = inv * sx, inv * sy, inv * sz
        gap = distance - c[REACH + k]
        reach = c[RADIUS_A + k] + 0.5 * gap
        rx, ry, rz = ax + reach * nx, ay + reach * ny, az + reach * nz
        write_vector(c, N, k, nx, ny, nz)
        t[tl.GAP + k] = gap
        t[tl.RADIUS + k] = c[CURVATURE + k]
        write_vector(t, tl.RA, k, rx, ry, rz)
        write_vector(t, tl.RB, k, rx - dx, ry - dy, rz - dz)


@inlined
def sphere_plane_geometry(t, c):
    """Gap, effective radius and contact point of each lane's sphere against a plane; see `tile.plane_geometry`."""
    write_arms(t, c, tl.A, CENTRE, ARM_A)
    for k in range(L):
        nx, ny, nz = c[N + k], c[N + L + k], c[N + 2 * L + k]
        ax, ay, az = t[ARM_A + k], t[ARM_A + L + k], t[ARM_A + 2 * L + k]
        x, y, z = t[tl.A + k] + ax, t[tl.A + L + k] + ay, t[tl.A + 2 * L + k] + az
        radius = c[RADIUS + k]
        f = c[OFFSET + k] - nx * x - ny * y - nz * z - radius
        reach = radius + 0.5 * f
        t[tl.RADIUS + k] = radius
        write_vector(t, tl.RA, k, ax + reach * nx, ay + reach * ny, az + reach * nz)
        t[tl.GAP + k] = f if tl.is_on_disc(c, k, x, y, z, nx, ny, nz) else tl.BEYOND
