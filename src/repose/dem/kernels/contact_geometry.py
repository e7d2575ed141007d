"""Read and write a contact of a body with a wall as eight numbers, `geometry`.

The solvers of `wall_contact` and `mesh_contact` fill such an array. Each thread has two
of them in its scratch memory (`state.Scratch`). `forces` copies the array to a lane of
a tile. The vectors are in the frame of the wall or in world axes, as each function
says.

    normal (3)   unit vector from the body into the wall
    gap          distance of the two surfaces [m]; negative for an overlap
    radius       effective radius R* of the two surfaces [m]
    arm (3)      contact point relative to the centre of the body [m]
"""

from .jit import inlined
from .rows import set_vector, vector_at

NORMAL, GAP, RADIUS, ARM = 0, 3, 4, 5
SIZE = 8


@inlined
def normal_of(geometry):
    """Return the unit normal of a contact, from the body into the wall."""
    return vector_at(geometry, NORMAL)


@inlined
def arm_of(geometry):
    """Return the contact point relative to the centre of the body [m]."""
    return vector_at(geometry, ARM)


@inlined
def write_contact(
    geometry, nx, ny, nz, gap, radius, extent, along_u, along_w, ux, uy, uz, wx, wy, wz
):
    """Write the contact of a body to `geometry`, from the body's support point.

    The support point is the body's outermost point along the normal n. The contact
    point lies half a gap further, midway between the two surfaces. Its vector from the
    body's centre, the lever arm, is written from the column ARM on.

    Parameters
    ----------
    geometry : array (8,)
        Overwritten.
    nx, ny, nz : float
        Unit normal n, from the body into the wall.
    gap, radius : float
        Distance of the two surfaces (negative for an overlap), and effective radius R*
        [m].
    extent, along_u, along_w : float
        The support point relative to the body's centre: its components along n, u and w
        [m].
    ux, uy, uz, wx, wy, wz : float
        Unit tangents u and w.
    """
    distance = extent + 0.5 * gap
    set_vector(geometry, NORMAL, nx, ny, nz)
    geometry[GAP] = gap
    geometry[RADIUS] = radius
    geometry[ARM] = distance * nx + along_u * ux + along_w * wx
    geometry[ARM + 1] = distance * ny + along_u * uy + along_w * wy
    geometry[ARM + 2] = distance * nz + along_u * uz + along_w * wz


@inlined
def write_sphere_contact(geometry, nx, ny, nz, gap, effective_radius, sphere_radius):
    """Write the contact of a sphere to `geometry`.

    The contact point of a sphere lies along the normal from its centre.

    Parameters
    ----------
    geometry : array (8,)
        Overwritten.
    nx, ny, nz : float
        Unit normal, from the sphere into the wall.
    gap : float
        Distance of the two surfaces [m]; negative for an overlap.
    effective_radius, sphere_radius : float
        Effective radius R* of the contact, and radius of the sphere [m].
    """
    # The contact point lies midway between the two surfaces.
    distance = sphere_radius + 0.5 * gap
    set_vector(geometry, NORMAL, nx, ny, nz)
    geometry[GAP] = gap
    geometry[RADIUS] = effective_radius
    set_vector(geometry, ARM, distance * nx, distance * ny, distance * nz)


@inlined
def copy_geometry(source, target):
    """Copy all numbers of one contact to another. Both are arrays (8,)."""
    for column in range(SIZE):
        target[column] = source[column]


@inlined
def shift_arm(geometry, x, y, z):
    """Add a vector (x, y, z) to the arm of a contact, in place.

    If the vector leads from the centre of a clump to that of one of its spheres, the
    contact of the sphere becomes a contact of the clump.
    """
    geometry[ARM] += x
    geometry[ARM + 1] += y
    geometry[ARM + 2] += z
