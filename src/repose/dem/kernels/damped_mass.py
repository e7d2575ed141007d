"""Compute the effective mass of each contact, on which its viscous damping depends.

A unit impulse along the normal n, at a point at r from the centre of a body, changes
the velocity of this point along n by

    1 / m + (r x n) . J (r x n)

where m is the body's mass and J its inverse inertia. The sum over both bodies is the
inverse of their effective mass at the contact. There, the bodies move along n like two
spheres with this effective mass.

Two clumps may touch with several spheres at once. The stiffnesses S of N contacts at
one point add up to N S. To keep the damping ratio of a single contact, their damping
constants 2 beta sqrt(S m) must add up to 2 beta sqrt(N S m). Therefore each contact has
the mass m / N. All contacts of two clumps share the mass in this way, wherever they
touch, and so do all spheres of a clump on one wall.

The functions read the bodies and the contact points in the tile `scratch` (rows of
`tile`), and the normals in `history`, the tile of the numbers that contacts keep. They
write the row tile.INVERSE_MASS of `scratch`. A lane of a tile is one contact.

References
----------
Berry, Zhang and Haeri, Powder Technol. 416 (2023) 118209: a locally reduced mass for
bodies of spheres.
"""

import numpy as np

from . import state, tile
from .clumps import count_set_bits, set_bit
from .jit import inlined
from .rows import LANES, lane_matrix, lane_vector


@inlined
def write_mobility(scratch, history, body_row, arm_row, parts, kept_share):
    """Write or add the velocity that a unit impulse gives to each contact point.

    This mobility of one body is written to, or added to, the row INVERSE_MASS of
    `scratch`: the sum over both bodies is the inverse of the effective mass. Impulse
    and velocity are along the normal n. If m is the mass of the body, J its inverse
    inertia, and r the contact point relative to its centre, the velocity is

        1 / m + (r x n) . J (r x n)

    Parameters
    ----------
    scratch, history : array
        Scratch tile, and tile of the numbers that contacts keep. The row INVERSE_MASS
        of `scratch` is overwritten or added to.
    body_row, arm_row : int
        First row of the body and of its contact point in `scratch`: tile.A and tile.RA,
        or tile.B and tile.RB.
    parts : int
        Ellipsoids of a body, or SPHERES. An impulse along the normal does not turn a
        sphere, so its inertia does not count.
    kept_share : float
        1.0 to add to the row, 0.0 to overwrite it. With a factor instead of a branch,
        the compiler makes vector code of the loop.
    """
    inverse_mass_row = body_row + state.INVERSE_MASS * LANES
    if parts == state.SPHERES:
        for lane in range(LANES):
            scratch[tile.INVERSE_MASS + lane] = (
                kept_share * scratch[tile.INVERSE_MASS + lane]
                + scratch[inverse_mass_row + lane]
            )
        return
    inverse_inertia_row = body_row + state.INVERSE_INERTIA * LANES
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, tile.NORMAL, lane)
        rx, ry, rz = lane_vector(scratch, arm_row, lane)
        # The vector product r x n
        cross_x, cross_y, cross_z = (
            ry * nz - rz * ny,
            rz * nx - rx * nz,
            rx * ny - ry * nx,
        )
        xx, xy, xz, yy, yz, zz = lane_matrix(scratch, inverse_inertia_row, lane)
        rotational_part = (
            xx * cross_x * cross_x
            + yy * cross_y * cross_y
            + zz * cross_z * cross_z
            + 2.0
            * (xy * cross_x * cross_y + xz * cross_x * cross_z + yz * cross_y * cross_z)
        )
        scratch[tile.INVERSE_MASS + lane] = (
            kept_share * scratch[tile.INVERSE_MASS + lane]
            + scratch[inverse_mass_row + lane]
            + rotational_part
        )


@inlined
def write_mass_of_pairs(scratch, history, pairs, parts, clumps, base, n_lanes):
    """Write the inverse of the effective mass of each pair to the row INVERSE_MASS.

    All contacts of two clumps share their mass.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    base, n_lanes : int
        Index of the tile's first contact, and number of lanes in use.
    """
    write_mobility(scratch, history, tile.A, tile.RA, parts, 0.0)
    write_mobility(scratch, history, tile.B, tile.RB, parts, 1.0)
    # Divide the mass of two clumps among their contacts.
    if len(clumps) > 0:
        for lane in range(n_lanes):
            n_contacts = pairs.n_contacts[pairs.entry[base + lane]]
            scratch[tile.INVERSE_MASS + lane] *= n_contacts


@inlined
def write_mass_on_wall(scratch, history, contacts, parts, clumps, base, n_lanes):
    """Write the inverse of each body's effective mass on a wall (row INVERSE_MASS).

    All spheres of a clump on one wall share its mass.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Scratch tile of LANES contacts. A row holds one quantity of all these contacts,
        and a lane is one contact: `scratch[row + lane]`. The module `tile` names the
        rows.
    history : array (rows * LANES,)
        Tile of the numbers that these contacts keep from one step to the next, such as
        their normals, one contact in each lane: `history[row + lane]`. The module
        `state` names the rows.
    contacts : WallContacts
        The list of contacts with walls of one kind.
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    base, n_lanes : int
        Index of the tile's first contact, and number of lanes in use.
    """
    write_mobility(scratch, history, tile.A, tile.RA, parts, 0.0)
    # Divide the mass of a clump among its spheres on this wall.
    if len(clumps) > 0:
        for lane in range(n_lanes):
            k = base + lane
            n_spheres = count_set_bits(
                contacts.touching_bits[contacts.wall[k], contacts.body[k]]
            )
            scratch[tile.INVERSE_MASS + lane] *= n_spheres


@inlined
def mark_spheres_on_meshes(meshed, mesh_sphere, n_contacts):
    """Mark which spheres of each clump touch each mesh, in `meshed.touching_bits`.

    Each pair of a mesh and a body has one 64-bit word there, with a bit for each sphere
    of the body. A sphere has a single bit, even if it touches a mesh at several points.

    Parameters
    ----------
    meshed : WallContacts
        The contacts with meshes. The first `n_contacts` are read, and the words of
        their meshes and bodies are overwritten.
    mesh_sphere : array
        `Clumps.mesh_sphere`: for each contact, body * MOST_SPHERES + sphere, where both
        are indices.
    n_contacts : int
        Number of contacts.
    """
    # Clear the bits of all these bodies and meshes. Then set a bit for each contact.
    known = meshed.touching_bits
    for contact in range(n_contacts):
        known[meshed.wall[contact], meshed.body[contact]] = np.uint64(0)
    for contact in range(n_contacts):
        body = np.int64(meshed.body[contact])
        sphere = np.int64(mesh_sphere[contact]) - state.MOST_SPHERES * body
        # `set_bit` takes an array of words, here a view of one word.
        set_bit(known[meshed.wall[contact], body : body + 1], sphere)
