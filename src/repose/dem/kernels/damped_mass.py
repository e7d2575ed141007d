"""The mass in the damping of a contact, with which an impact has its nominal restitution.

A unit impulse along the normal n gives the place of a contact at r from a body's centre the velocity

    1 / m + (r x n) . J (r x n)

along n, J the inverse inertia. The sum over both bodies is the inverse of their mass at the contact: there and in this
direction they move as two spheres of that mass would. Two clumps may touch with several spheres at once. Stiffnesses S
in one place add up to N S, so for the damping ratio of one contact the dampings 2 beta sqrt(S m) must add up to
2 beta sqrt(N S m): each of the N contacts has the mass m / N. All contacts of two clumps share the mass in this way,
and all spheres of a clump on one wall, wherever they touch.

References
----------
Berry, Zhang and Haeri, Powder Technol. 416 (2023) 118209: a mass reduced locally, for bodies of spheres.
"""

import numpy as np

from . import state as st
from . import tile as tl
from .clumps import bits_set, set_bit
from .jit import inlined
from .rows import L


@inlined
def mobility(t, c, body, arm, parts, add):
    """Write (add 0.0) or add (add 1.0) the velocity that a unit impulse along the normal gives each lane's body.

    A sphere's contact does not turn it.
    """
    if parts == st.SPHERES:
        for k in range(L):
            t[tl.INVERSE_MASS + k] = (
                add * t[tl.INVERSE_MASS + k] + t[body + st.INVERSE_MASS * L + k]
            )
        return
    j = body + st.INVERSE_INERTIA * L
    for k in range(L):
        nx, ny, nz = c[tl.N + k], c[tl.N + L + k], c[tl.N + 2 * L + k]
        rx, ry, rz = t[arm + k], t[arm + L + k], t[arm + 2 * L + k]
        x, y, z = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
        xx, xy, xz = t[j + k], t[j + L + k], t[j + 2 * L + k]
        yy, yz, zz = t[j + 3 * L + k], t[j + 4 * L + k], t[j + 5 * L + k]
        turning = (
            xx * x * x
            + yy * y * y
            + zz * z * z
            + 2.0 * (xy * x * y + xz * x * z + yz * y * z)
        )
        t[tl.INVERSE_MASS + k] = (
            add * t[tl.INVERSE_MASS + k] + t[body + st.INVERSE_MASS * L + k] + turning
        )


@inlined
def mass_of_pairs(t, c, pairs, parts, clumps, base, lanes):
    """Row INVERSE_MASS of a tile of pairs, which begins with contact `base` and uses its first `lanes` lanes."""
    mobility(t, c, tl.A, tl.RA, parts, 0.0)
    mobility(t, c, tl.B, tl.RB, parts, 1.0)
    if len(clumps) > 0:
        for lane in range(lanes):
            t[tl.INVERSE_MASS + lane] *= pairs.live[pairs.entry[base + lane]]


@inlined
def mass_on_wall(t, c, contacts, parts, clumps, base, lanes):
    """Row INVERSE_MASS of a tile of contacts with walls; the spheres of a clump on one wall share its mass."""
    mobility(t, c, tl.A, tl.RA, parts, 0.0)
    if len(clumps) > 0:
        for lane in range(lanes):
            k = base + lane
            t[tl.INVERSE_MASS + lane] *= bits_set(
                contacts.known[contacts.wall[k], contacts.body[k]]
            )


@inlined
def spheres_on_meshes(meshed, sphere, n):
    """Note which spheres of each body touch each mesh; a sphere may touch it in several places."""
    known = meshed.known
    for k in range(n):
        known[meshed.wall[k], meshed.body[k]] = np.uint64(0)
    for k in range(n):
        i = np.int64(meshed.body[k])
        set_bit(
            known[meshed.wall[k], i : i + 1], np.int64(sphere[k]) - st.MOST_SPHERES * i
        )
