"""The inner loops of clumps: 32 contacts of single spheres at a time.

Two spheres, or a sphere and a plane, touch in closed form. A contact keeps the places of
its spheres in the axes of their bodies, and their radii; the rows of the bodies have
positions and, in the columns of the shape, quaternions.

`t` is the scratch tile (rows of `tile`), `c` the tile of numbers that the contacts keep.
The functions read the rows of the bodies (`tl.A`, `tl.B`) and write N in `c`, GAP,
RADIUS, RA and RB in `t`. See `rows` for the layout of a tile.
"""

import math

from . import state as st
from . import tile as tl
from .jit import inlined
from .rows import L, Rows, lane_vector, write_vector
from .state import OFFSET, SHAPE

N = st.NORMAL
# Rows that a pair of spheres keeps, after the normal.
_pair = Rows(st.PAIR_STATE)
CENTRE_A = _pair.take(3)  # of each sphere, in the axes of its body
CENTRE_B = _pair.take(3)
RADIUS_A = _pair.take()
REACH = _pair.take()  # sum of the radii
CURVATURE = _pair.take()  # effective radius
PAIR_STATE = _pair.end  # where the force laws' rows begin
# Rows that a sphere on a wall keeps, after those of the wall.
_wall = Rows(st.WALL_STATE)
CENTRE = _wall.take(3)
RADIUS = _wall.take()
WALL_STATE = _wall.end
# Rows of the scratch tile: from the centre of a body to that of its sphere, in world axes.
ARM_A, ARM_B = tl.SUPPORT, tl.BETWEEN
NEAREST = 1e-30  # distance of two centres that still have a direction [m]


@inlined
def rotated_vector(w, x, y, z, px, py, pz):
    """Return a vector p rotated by a unit quaternion (w, x, y, z)."""
    # twice the vector product of the quaternion's vector with p
    ux = 2.0 * (y * pz - z * py)
    uy = 2.0 * (z * px - x * pz)
    uz = 2.0 * (x * py - y * px)
    return (
        px + w * ux + (y * uz - z * uy),
        py + w * uy + (z * ux - x * uz),
        pz + w * uz + (x * uy - y * ux),
    )


@inlined
def write_arms(t, c, body, centre, arm):
    """Write the vector from the body's centre to the sphere's, in world axes.

    `body` is the first row of the body in `t`, `centre` that of the sphere's place in
    `c`, and `arm` the first of three rows of `t` to which the vector is written.
    """
    quaternion = body + SHAPE * L
    for lane in range(L):
        w = t[quaternion + lane]
        x, y, z = lane_vector(t, quaternion + L, lane)
        px, py, pz = lane_vector(c, centre, lane)
        px, py, pz = rotated_vector(w, x, y, z, px, py, pz)
        write_vector(t, arm, lane, px, py, pz)


@inlined
def sphere_pair_geometry(t, c):
    """Compute normal, gap, effective radius and contact point of each pair of spheres."""
    write_arms(t, c, tl.A, CENTRE_A, ARM_A)
    write_arms(t, c, tl.B, CENTRE_B, ARM_B)
    for lane in range(L):
        # between the centres of the bodies
        dx = t[tl.B + lane] - t[tl.A + lane]
        dy = t[tl.B + L + lane] - t[tl.A + L + lane]
        dz = t[tl.B + 2 * L + lane] - t[tl.A + 2 * L + lane]
        # between the centres of the spheres
        ax, ay, az = lane_vector(t, ARM_A, lane)
        bx, by, bz = lane_vector(t, ARM_B, lane)
        sx = dx + bx - ax
        sy = dy + by - ay
        sz = dz + bz - az
        distance = math.sqrt(sx * sx + sy * sy + sz * sz)
        inv = 1.0 / (distance if distance > NEAREST else NEAREST)
        nx, ny, nz = inv * sx, inv * sy, inv * sz
        gap = distance - c[REACH + lane]
        # the contact point lies midway between the two surfaces
        reach = c[RADIUS_A + lane] + 0.5 * gap
        rx, ry, rz = ax + reach * nx, ay + reach * ny, az + reach * nz
        write_vector(c, N, lane, nx, ny, nz)
        t[tl.GAP + lane] = gap
        t[tl.RADIUS + lane] = c[CURVATURE + lane]
        write_vector(t, tl.RA, lane, rx, ry, rz)
        write_vector(t, tl.RB, lane, rx - dx, ry - dy, rz - dz)


@inlined
def sphere_plane_geometry(t, c):
    """Compute gap, effective radius and contact point of each sphere on a plane.

    Beyond the disc of the plane the gap is tl.BEYOND, as in `tile.plane_geometry`.
    """
    write_arms(t, c, tl.A, CENTRE, ARM_A)
    for lane in range(L):
        nx, ny, nz = lane_vector(c, N, lane)
        ax, ay, az = lane_vector(t, ARM_A, lane)
        # the centre of the sphere
        x = t[tl.A + lane] + ax
        y = t[tl.A + L + lane] + ay
        z = t[tl.A + 2 * L + lane] + az
        radius = c[RADIUS + lane]
        gap = c[OFFSET + lane] - nx * x - ny * y - nz * z - radius
        reach = radius + 0.5 * gap
        t[tl.RADIUS + lane] = radius
        write_vector(t, tl.RA, lane, ax + reach * nx, ay + reach * ny, az + reach * nz)
        on_disc = tl.is_on_disc(c, lane, x, y, z, nx, ny, nz)
        t[tl.GAP + lane] = gap if on_disc else tl.BEYOND
