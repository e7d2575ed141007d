"""Compute the geometry of 32 contacts of spheres of clumps at a time.

The geometry of two spheres, or of a sphere and a plane, has a closed form. A contact
keeps the radii of its spheres, and their centres in the axes of their bodies. The rows
of the bodies contain positions and, in the columns of the shape, quaternions.

`scratch` is the scratch tile (rows of `tile`), `history` the tile of numbers that the
contacts keep. The functions read the rows of the bodies (`tile.A`, `tile.B`). They
write NORMAL in `history`, and GAP, RADIUS, RA and RB in `scratch`. See `rows` for the
layout of a tile.
"""

import math

from . import state, tile
from .jit import inlined
from .rows import LANES, Rows, lane_vector, write_vector
from .state import NORMAL, OFFSET, SHAPE
from .vectors import squared_length

# Rows that a contact of two spheres keeps, after the normal.
_pair = Rows(state.PAIR_STATE)
CENTRE_A = _pair.take(3)  # centre of each sphere in the axes of its body
CENTRE_B = _pair.take(3)
RADIUS_A = _pair.take()
REACH = _pair.take()  # sum of the radii
CURVATURE = _pair.take()  # effective radius
PAIR_STATE = _pair.end  # the rows of the force laws begin here
# Rows that a contact of a sphere with a wall keeps, after those of the wall.
_wall = Rows(state.WALL_STATE)
CENTRE = _wall.take(3)
RADIUS = _wall.take()
WALL_STATE = _wall.end
# Rows of the scratch tile: vector from a body's centre to its sphere's, in world axes.
ARM_A, ARM_B = tile.SUPPORT, tile.SUPPORT_A_TO_B
NEAREST = 1e-30  # if centres are nearer than this, they do not define a normal [m]


@inlined
def rotated_vector(w, x, y, z, px, py, pz):
    """Return a vector rotated by a unit quaternion.

    The result is p + w u + q x u, where q is the vector part of the quaternion and
    u = 2 q x p.

    Parameters
    ----------
    w, x, y, z : float
        The quaternion.
    px, py, pz : float
        The vector p.
    """
    # u is twice the vector product of the quaternion's vector part with p.
    ux = 2.0 * (y * pz - z * py)
    uy = 2.0 * (z * px - x * pz)
    uz = 2.0 * (x * py - y * px)
    return (
        px + w * ux + (y * uz - z * uy),
        py + w * uy + (z * ux - x * uz),
        pz + w * uz + (x * uy - y * ux),
    )


@inlined
def write_arms(scratch, history, body_row, centre_row, arm_row):
    """Write the vector from each body's centre to its sphere's centre, in world axes.

    It is the sphere's centre in the axes of the body, rotated by the quaternion of the
    body.

    Parameters
    ----------
    scratch : array
        Scratch tile of LANES contacts, one in each lane, with the quaternions of the
        bodies.
    history : array
        Tile of the numbers that these contacts keep, one contact in each lane, with the
        centres of their spheres in body axes.
    body_row : int
        First row of the bodies in `scratch`: tile.A or tile.B.
    centre_row : int
        First of the three rows of the spheres' centres in `history`.
    arm_row : int
        First of the three rows of `scratch` to which the vectors are written.
    """
    # In the tile, a column of `Bodies.rows` is a row of LANES numbers. For a clump, the
    # columns of the shape are its quaternion (w, x, y, z).
    quaternion_row = body_row + SHAPE * LANES
    for lane in range(LANES):
        qw = scratch[quaternion_row + lane]
        qx, qy, qz = lane_vector(scratch, quaternion_row + LANES, lane)
        centre_x, centre_y, centre_z = lane_vector(history, centre_row, lane)
        arm_x, arm_y, arm_z = rotated_vector(
            qw, qx, qy, qz, centre_x, centre_y, centre_z
        )
        write_vector(scratch, arm_row, lane, arm_x, arm_y, arm_z)


@inlined
def write_sphere_pair_geometry(scratch, history):
    """Compute normal, gap, effective radius and contact point of each pair of spheres.

    Each sphere belongs to a clump. Writes the normal (row NORMAL of `history`), and the
    rows GAP, RADIUS (the effective radius), RA and RB of `scratch`. RA and RB are the
    vectors from the centres of the two clumps to the contact point. A contact keeps
    what depends only on its two spheres: their radii, the sum of these (row REACH) and
    the effective radius (row CURVATURE).

    Parameters
    ----------
    scratch : array
        Scratch tile of LANES contacts, one in each lane, with copies of the two bodies
        in the rows from tile.A and tile.B on.
    history : array
        Tile of the numbers that these contacts keep, one contact in each lane, with the
        centres and radii of their spheres.
    """
    # Write the vectors from the centres of the clumps to those of the spheres. The loop
    # below reads them.
    write_arms(scratch, history, tile.A, CENTRE_A, ARM_A)
    write_arms(scratch, history, tile.B, CENTRE_B, ARM_B)
    for lane in range(LANES):
        # The vector from the centre of body A to that of body B
        body_a_x, body_a_y, body_a_z = lane_vector(scratch, tile.POSITION_A, lane)
        body_b_x, body_b_y, body_b_z = lane_vector(scratch, tile.POSITION_B, lane)
        bodies_x, bodies_y, bodies_z = (
            body_b_x - body_a_x,
            body_b_y - body_a_y,
            body_b_z - body_a_z,
        )
        # The vector from the centre of A's sphere to that of B's sphere
        arm_a_x, arm_a_y, arm_a_z = lane_vector(scratch, ARM_A, lane)
        arm_b_x, arm_b_y, arm_b_z = lane_vector(scratch, ARM_B, lane)
        spheres_x = bodies_x + arm_b_x - arm_a_x
        spheres_y = bodies_y + arm_b_y - arm_a_y
        spheres_z = bodies_z + arm_b_z - arm_a_z
        # The unit normal along this vector. If the centres coincide, it is zero: the
        # lower bound NEAREST avoids a division by zero.
        distance = math.sqrt(squared_length(spheres_x, spheres_y, spheres_z))
        inverse = 1.0 / (distance if distance > NEAREST else NEAREST)
        nx, ny, nz = inverse * spheres_x, inverse * spheres_y, inverse * spheres_z
        write_vector(history, NORMAL, lane, nx, ny, nz)
        gap = distance - history[REACH + lane]
        scratch[tile.GAP + lane] = gap
        scratch[tile.RADIUS + lane] = history[CURVATURE + lane]
        # The contact point lies midway between the two surfaces.
        arm_length = history[RADIUS_A + lane] + 0.5 * gap
        rx = arm_a_x + arm_length * nx
        ry = arm_a_y + arm_length * ny
        rz = arm_a_z + arm_length * nz
        write_vector(scratch, tile.RA, lane, rx, ry, rz)
        write_vector(
            scratch, tile.RB, lane, rx - bodies_x, ry - bodies_y, rz - bodies_z
        )


@inlined
def write_sphere_plane_geometry(scratch, history):
    """Compute gap, effective radius and contact point of each sphere on a plane.

    Each sphere belongs to a clump. Writes the rows GAP, RADIUS (the effective radius)
    and RA (vector from the clump's centre to the contact point) of `scratch`. The gap
    is negative for an overlap. Beyond the edge of the plane's disc it is tile.BEYOND,
    which is infinite.

    Parameters
    ----------
    scratch : array
        Scratch tile of LANES contacts, one in each lane, with copies of their bodies in
        the rows from tile.A on.
    history : array
        Tile of the numbers that these contacts keep, one contact in each lane: the
        plane, and the centre and radius of the sphere.
    """
    write_arms(scratch, history, tile.A, CENTRE, ARM_A)
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, NORMAL, lane)
        # The centre of the sphere
        body_x, body_y, body_z = lane_vector(scratch, tile.POSITION_A, lane)
        arm_x, arm_y, arm_z = lane_vector(scratch, ARM_A, lane)
        x, y, z = body_x + arm_x, body_y + arm_y, body_z + arm_z
        radius = history[RADIUS + lane]
        # The normal points into the wall, and OFFSET is the distance of the plane from
        # the origin along it.
        gap = history[OFFSET + lane] - nx * x - ny * y - nz * z - radius
        scratch[tile.RADIUS + lane] = radius
        # The contact point lies midway between sphere and plane.
        arm_length = radius + 0.5 * gap
        rx, ry, rz = (
            arm_x + arm_length * nx,
            arm_y + arm_length * ny,
            arm_z + arm_length * nz,
        )
        write_vector(scratch, tile.RA, lane, rx, ry, rz)
        on_disc = tile.is_on_disc(history, lane, x, y, z, nx, ny, nz)
        scratch[tile.GAP + lane] = gap if on_disc else tile.BEYOND
