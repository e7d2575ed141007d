"""The effective mass of each contact, on which its viscous damping depends.

A unit impulse along the normal n gives the place of a contact at r from a body's centre
the velocity

    1 / m + (r x n) . J (r x n)

along n, with the inverse inertia J. The sum over both bodies is the inverse of their
mass at the contact: there and in this direction they move as two spheres of that mass
would. Two clumps may touch with several spheres at once. Stiffnesses S in one place add
up to N S, so for the damping ratio of one contact the dampings 2 beta sqrt(S m) must
add up to 2 beta sqrt(N S m): each of the N contacts has the mass m / N. All contacts of
two clumps share the mass in this way, and so do all spheres of a clump on one wall,
wherever they touch.

Reads the bodies and the contact points in the tile `scratch` (rows of `tile`), and the
normals in `history`, the tile of the numbers that contacts keep. Writes the row
tile.INVERSE_MASS of `scratch`. A lane of a tile is one contact.

References
----------
Berry, Zhang and Haeri, Powder Technol. 416 (2023) 118209: a mass reduced locally, for
bodies of spheres.
"""

import numpy as np

from . import state, tile
from .clumps import count_set_bits, set_bit
from .jit import inlined
from .rows import LANES, lane_matrix, lane_vector


@inlined
def write_mobility(scratch, history, body_row, arm_row, parts, keep):
    """Write or add the velocity that a unit impulse along the normal gives each body.

    This is 1 / m + (r x n) . J (r x n), with the mass m of the body, its inverse
    inertia J, the contact point r from its centre, and the normal n.

    Parameters
    ----------
    scratch, history : array
        Scratch tile and tile of the contacts; the row INVERSE_MASS of `scratch` is
        written.
    body_row, arm_row : int
        First row of the body and of its contact point in `scratch`: tile.A and tile.RA, or
        tile.B and tile.RB.
    parts : int
        Ellipsoids of a body. A contact of SPHERES does not turn them.
    keep : float
        1.0 to keep what the row holds and add to it, 0.0 to overwrite it. A number
        instead of a branch keeps the loop vector code.
    """
    inverse_mass_row = body_row + state.INVERSE_MASS * LANES
    if parts == state.SPHERES:
        for lane in range(LANES):
            scratch[tile.INVERSE_MASS + lane] = (
                keep * scratch[tile.INVERSE_MASS + lane]
                + scratch[inverse_mass_row + lane]
            )
        return
    inverse_inertia_row = body_row + state.INVERSE_INERTIA * LANES
    for lane in range(LANES):
        nx, ny, nz = lane_vector(history, tile.NORMAL, lane)
        rx, ry, rz = lane_vector(scratch, arm_row, lane)
        # the vector product r x n
        cross_x, cross_y, cross_z = (
            ry * nz - rz * ny,
            rz * nx - rx * nz,
            rx * ny - ry * nx,
        )
        xx, xy, xz, yy, yz, zz = lane_matrix(scratch, inverse_inertia_row, lane)
        turning = (
            xx * cross_x * cross_x
            + yy * cross_y * cross_y
            + zz * cross_z * cross_z
            + 2.0
            * (xy * cross_x * cross_y + xz * cross_x * cross_z + yz * cross_y * cross_z)
        )
        scratch[tile.INVERSE_MASS + lane] = (
            keep * scratch[tile.INVERSE_MASS + lane]
            + scratch[inverse_mass_row + lane]
            + turning
        )


@inlined
def write_mass_of_pairs(scratch, history, pairs, parts, clumps, base, lanes):
    """Write the inverse of the mass of each pair at its contact: the row INVERSE_MASS.

    All contacts of two clumps share their mass.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    history : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    parts : int
        Largest number of ellipsoids of a body; 0 for clumps; SPHERES, -1, if all bodies
        are spheres.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    base, lanes : int
        First contact of the tile, and number of lanes in use.
    """
    write_mobility(scratch, history, tile.A, tile.RA, parts, 0.0)
    write_mobility(scratch, history, tile.B, tile.RB, parts, 1.0)
    # the number of contacts of the two clumps is that of their entry
    if len(clumps) > 0:
        for lane in range(lanes):
            n_contacts = pairs.n_contacts[pairs.entry[base + lane]]
            scratch[tile.INVERSE_MASS + lane] *= n_contacts


@inlined
def write_mass_on_wall(scratch, history, contacts, parts, clumps, base, lanes):
    """Write the inverse of the mass of each body at its contact with a wall.

    This is the row INVERSE_MASS. All spheres of a clump on one wall share its mass.

    Parameters
    ----------
    scratch : array (rows * LANES,)
        Working memory of a tile of LANES contacts. A quantity of one contact is
        `scratch[row + lane]`; the module `tile` names the rows.
    history : array (rows * LANES,)
        What these contacts keep from step to step, in a tile. The module `state` names
        the rows.
    contacts : WallContacts
        The list of contacts with walls of one kind.
    parts : int
        Largest number of ellipsoids of a body; 0 for clumps; SPHERES, -1, if all bodies
        are spheres.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple where all bodies are smooth.
    base, lanes : int
        First contact of the tile, and number of lanes in use.
    """
    write_mobility(scratch, history, tile.A, tile.RA, parts, 0.0)
    # the number of spheres of the clump on this wall
    if len(clumps) > 0:
        for lane in range(lanes):
            k = base + lane
            n_spheres = count_set_bits(
                contacts.touching_bits[contacts.wall[k], contacts.body[k]]
            )
            scratch[tile.INVERSE_MASS + lane] *= n_spheres


@inlined
def mark_spheres_on_meshes(meshed, mesh_sphere, n):
    """Write `meshed.touching_bits`: which spheres of each clump touch each mesh, as bits.

    A sphere may touch a mesh in several places and still has one bit.

    Parameters
    ----------
    meshed : WallContacts
        The contacts with meshes, of which the first n are read.
    mesh_sphere : array
        Of each contact body * MOST_SPHERES + sphere.
    n : int
        Number of contacts.
    """
    # clear the bits of all these bodies and meshes, then set those that touch
    known = meshed.touching_bits
    for k in range(n):
        known[meshed.wall[k], meshed.body[k]] = np.uint64(0)
    for k in range(n):
        i = np.int64(meshed.body[k])
        sphere = np.int64(mesh_sphere[k]) - state.MOST_SPHERES * i
        # a view of one word, since bits are set in a row of words
        set_bit(known[meshed.wall[k], i : i + 1], sphere)
