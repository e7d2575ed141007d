"""Geometry of 32 contacts of single spheres of clumps at a time.

Two spheres, or a sphere and a plane, touch in closed form. A contact keeps the places
of its spheres in the axes of their bodies, and their radii; the rows of the bodies have
positions and, in the columns of the shape, quaternions.

`scratch` is the scratch tile (rows of `tile`), `contacts` the tile of numbers that the
contacts keep. The functions read the rows of the bodies (`tile.A`, `tile.B`) and write
NORMAL in `contacts`, GAP, RADIUS, RA and RB in `scratch`. See `rows` for the layout of
a tile.
"""

import math

from . import state, tile
from .jit import inlined
from .rows import LANES, Rows, lane_vector, write_vector
from .state import NORMAL, OFFSET, SHAPE
from .vectors import squared_length

# Rows that a pair of spheres keeps, after the normal.
_pair = Rows(state.PAIR_STATE)
CENTRE_A = _pair.take(3)  # of each sphere, in the axes of its body
CENTRE_B = _pair.take(3)
RADIUS_A = _pair.take()
REACH = _pair.take()  # sum of the radii
CURVATURE = _pair.take()  # effective radius
PAIR_STATE = _pair.end  # where the force laws' rows begin
# Rows that a sphere on a wall keeps, after those of the wall.
_wall = Rows(state.WALL_STATE)
CENTRE = _wall.take(3)
RADIUS = _wall.take()
WALL_STATE = _wall.end
# Rows of the scratch tile: from the centre of a body to that of its sphere, in world axes.
ARM_A, ARM_B = tile.SUPPORT, tile.SUPPORT_A_TO_B
NEAREST = 1e-30  # distance of two centres that still have a direction [m]


@inlined
def rotated_vector(w, x, y, z, px, py, pz):
    """Return a vector rotated by a unit quaternion.

    With the vector part q of the quaternion and u = 2 q x p, the vector p becomes
    p + w u + q x u.

    Parameters
    ----------
    w, x, y, z : float
        The quaternion.
    px, py, pz : float
        The vector p.
    """
    # u, twice the vector product of the quaternion's vector part with p
    ux = 2.0 * (y * pz - z * py)
    uy = 2.0 * (z * px - x * pz)
    uz = 2.0 * (x * py - y * px)
    return (
        px + w * ux + (y * uz - z * uy),
        py + w * uy + (z * ux - x * uz),
        pz + w * uz + (x * uy - y * ux),
    )


@inlined
def write_arms(scratch, contacts, body_row, centre_row, arm_row):
    """Write the vector from each body to the centre of its sphere, in world axes.

    Parameters
    ----------
    scratch : array
        Scratch tile of LANES contacts, with the quaternions of the bodies.
    contacts : array
        Tile of the same contacts, with the centres of the spheres in body axes.
    body_row : int
        First row of the bodies in `scratch`: tile.A or tile.B.
    centre_row : int
        First of the three rows of the spheres' centres in `contacts`.
    arm_row : int
        First of the three rows of `scratch` to which the vectors are written.
    """
    quaternion_row = body_row + SHAPE * LANES
    for lane in range(LANES):
        qw = scratch[quaternion_row + lane]
        qx, qy, qz = lane_vector(scratch, quaternion_row + LANES, lane)
        centre_x, centre_y, centre_z = lane_vector(contacts, centre_row, lane)
        arm_x, arm_y, arm_z = rotated_vector(
            qw, qx, qy, qz, centre_x, centre_y, centre_z
        )
        write_vector(scratch, arm_row, lane, arm_x, arm_y, arm_z)


@inlined
def write_sphere_pair_geometry(scratch, contacts):
    """Compute normal, gap, effective radius and contact point of each pair of spheres.

    Each sphere belongs to a clump. Writes the normal (row NORMAL of `contacts`) and the
    rows GAP, RADIUS, RA and RB of `scratch`; RA and RB are the vectors from the centres
    of the two bodies to the contact point.

    Parameters
    ----------
    scratch : array
        Scratch tile of LANES contacts with the bodies (tile.A, tile.B).
    contacts : array
        Tile of the same contacts, which keep centres and radii of their spheres.
    """
    write_arms(scratch, contacts, tile.A, CENTRE_A, ARM_A)
    write_arms(scratch, contacts, tile.B, CENTRE_B, ARM_B)
    for lane in range(LANES):
        # from the centre of body A to that of body B
        body_a_x, body_a_y, body_a_z = lane_vector(scratch, tile.POSITION_A, lane)
        body_b_x, body_b_y, body_b_z = lane_vector(scratch, tile.POSITION_B, lane)
        dx, dy, dz = body_b_x - body_a_x, body_b_y - body_a_y, body_b_z - body_a_z
        # from the centre of the sphere of A to that of the sphere of B
        arm_a_x, arm_a_y, arm_a_z = lane_vector(scratch, ARM_A, lane)
        arm_b_x, arm_b_y, arm_b_z = lane_vector(scratch, ARM_B, lane)
        spheres_x = dx + arm_b_x - arm_a_x
        spheres_y = dy + arm_b_y - arm_a_y
        spheres_z = dz + arm_b_z - arm_a_z
        # the unit vector along this line; of spheres in one place it is zero
        distance = math.sqrt(squared_length(spheres_x, spheres_y, spheres_z))
        inverse = 1.0 / (distance if distance > NEAREST else NEAREST)
        nx, ny, nz = inverse * spheres_x, inverse * spheres_y, inverse * spheres_z
        write_vector(contacts, NORMAL, lane, nx, ny, nz)
        gap = distance - contacts[REACH + lane]
        scratch[tile.GAP + lane] = gap
        scratch[tile.RADIUS + lane] = contacts[CURVATURE + lane]
        # the contact point lies midway between the two surfaces
        reach = contacts[RADIUS_A + lane] + 0.5 * gap
        rx = arm_a_x + reach * nx
        ry = arm_a_y + reach * ny
        rz = arm_a_z + reach * nz
        write_vector(scratch, tile.RA, lane, rx, ry, rz)
        write_vector(scratch, tile.RB, lane, rx - dx, ry - dy, rz - dz)


@inlined
def write_sphere_plane_geometry(scratch, contacts):
    """Compute gap, effective radius and contact point of each sphere on a plane.

    Writes the rows GAP, RADIUS and RA of `scratch`. Beyond the disc of the plane the
    gap is tile.BEYOND, which is infinite, as in `tile.write_plane_geometry`.

    Parameters
    ----------
    scratch : array
        Scratch tile of LANES contacts with their bodies (tile.A).
    contacts : array
        Tile of the same contacts, which keep the plane, and centre and radius of the
        sphere.
    """
    write_arms(scratch, contacts, tile.A, CENTRE, ARM_A)
    for lane in range(LANES):
        nx, ny, nz = lane_vector(contacts, NORMAL, lane)
        # the centre of the sphere
        body_x, body_y, body_z = lane_vector(scratch, tile.POSITION_A, lane)
        arm_x, arm_y, arm_z = lane_vector(scratch, ARM_A, lane)
        x, y, z = body_x + arm_x, body_y + arm_y, body_z + arm_z
        radius = contacts[RADIUS + lane]
        gap = contacts[OFFSET + lane] - nx * x - ny * y - nz * z - radius
        scratch[tile.RADIUS + lane] = radius
        # the contact point lies midway between sphere and plane
        reach = radius + 0.5 * gap
        rx, ry, rz = arm_x + reach * nx, arm_y + reach * ny, arm_z + reach * nz
        write_vector(scratch, tile.RA, lane, rx, ry, rz)
        on_disc = tile.is_on_disc(contacts, lane, x, y, z, nx, ny, nz)
        scratch[tile.GAP + lane] = gap if on_disc else tile.BEYOND
