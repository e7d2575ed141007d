"""The search for spheres of two clumps that begin to touch.

An entry of `clumps` is checked when the displacements of its bodies have reached its limit, as in `neighbours`: the
displacement of a body bounds the motion of each of its spheres. A full search finds the gaps of all pairs of spheres.
Then the entry watches the nearest pairs that do not touch, each with a limit of its own. All other pairs share the
limit `near_rest`: displacements at the full search plus their smallest gap. Until it is reached, a check finds the gaps
of only those watched pairs that have reached their limits. A pair whose contact ends is watched; where no slot is free,
it lowers `near_rest` instead.
"""

import math

import numpy as np

from . import clump_tile as ct
from . import state as st
from .clumps import (
    SLOTS,
    add_entry,
    add_sphere_contact,
    drop_entry,
    drop_sphere_contact,
    is_set,
    most_spheres,
)
from .jit import inlined, kernel
from .neighbours import bounding_radius, next_due
from .state import MOST_SPHERES

WATCHED = (
    SLOTS - 4
)  # pairs that are watched after a full search; the other slots are for contacts that end
# Places in `Scratch.spheres`: the spheres of either body as rows of x, y, z and radius. Of one sphere of A and each of
# B: squared distance, and by how much it exceeds that of a pair whose gap is calculated.
PLACES_A, PLACES_B = 0, 4 * MOST_SPHERES
SQUARES, EXCESS = 8 * MOST_SPHERES, 9 * MOST_SPHERES
# The smallest gaps found, in order, and their spheres.
GAPS = 10 * MOST_SPHERES
OF_A, OF_B = GAPS + st.SMALLEST_GAPS, GAPS + 2 * st.SMALLEST_GAPS


@inlined
def place_spheres(row, spheres, n, scale, x0, y0, z0, s, at):
    """Write the n spheres of a body, relative to a place in the world, to rows of the scratch; see PLACES_A."""
    w, x, y, z = row[st.SHAPE], row[st.SHAPE + 1], row[st.SHAPE + 2], row[st.SHAPE + 3]
    dx, dy, dz = row[0] - x0, row[1] - y0, row[2] - z0
    for k in range(n):
        px, py, pz = ct.rotated_vector(
            w, x, y, z, spheres[0, k], spheres[1, k], spheres[2, k]
        )
        s[at + k] = dx + scale * px
        s[at + MOST_SPHERES + k] = dy + scale * py
        s[at + 2 * MOST_SPHERES + k] = dz + scale * pz
        s[at + 3 * MOST_SPHERES + k] = scale * spheres[3, k]


@inlined
def measure_sphere(s, p, n, near):
    """Squared distances of placed sphere p of A to the n spheres of B; returns how many gaps are below `near`."""
    x, y, z = (
        s[PLACES_A + p],
        s[PLACES_A + MOST_SPHERES + p],
        s[PLACES_A + 2 * MOST_SPHERES + p],
    )
    reach = s[PLACES_A + 3 * MOST_SPHERES + p] + near
    found = 0
    for q in range(n):
        dx = s[PLACES_B + q] - x
        dy = s[PLACES_B + MOST_SPHERES + q] - y
        dz = s[PLACES_B + 2 * MOST_SPHERES + q] - z
        far = reach + s[PLACES_B + 3 * MOST_SPHERES + q]
        square = dx * dx + dy * dy + dz * dz
        excess = square - far * far
        s[SQUARES + q] = square
        s[EXCESS + q] = excess
        found += 1 if excess < 0.0 else 0
    return found


@inlined
def keep_gap(s, gap, a, b):
    """Sort a gap, smaller than the largest of them, into the smallest gaps."""
    k = WATCHED
    while k > 0 and s[GAPS + k - 1] > gap:
        s[GAPS + k] = s[GAPS + k - 1]
        s[OF_A + k] = s[OF_A + k - 1]
        s[OF_B + k] = s[OF_B + k - 1]
        k -= 1
    s[GAPS + k] = gap
    s[OF_A + k] = a
    s[OF_B + k] = b


@inlined
def watch_nearest(bodies, pairs, entry, i, j, skin, s):
    """Let an entry watch the pairs with the smallest gaps, and set its limits."""
    total = bodies.displacement[i] + bodies.displacement[j]
    n = 0
    while n < WATCHED and s[GAPS + n] < skin:
        pairs.watched[entry, n, 0] = np.uint8(s[OF_A + n])
        pairs.watched[entry, n, 1] = np.uint8(s[OF_B + n])
        pairs.watched_limit[entry, n] = total + s[GAPS + n]
        n += 1
    pairs.n_watched[entry] = n
    pairs.near_limit[entry] = total + s[GAPS]
    pairs.near_rest[entry] = total + s[GAPS + WATCHED]


@kernel
def look_at_spheres(bodies, pairs, counts, grid, clumps, entry, i, j, s):
    """Full search of two bodies: adds the new contacts to an entry; -1 makes one for a contact or a gap below the skin.

    Returns the smallest gap of two spheres that do not touch, or the skin where none is smaller.
    """
    rows = bodies.rows
    skin = grid.lengths[st.SKIN]
    shape_a, shape_b = clumps.shape[i], clumps.shape[j]
    x, y, z = rows[i, 0], rows[i, 1], rows[i, 2]
    n_a, n_b = clumps.sizes[shape_a], clumps.sizes[shape_b]
    place_spheres(
        rows[i], clumps.spheres[shape_a], n_a, clumps.scale[i], x, y, z, s, PLACES_A
    )
    place_spheres(
        rows[j], clumps.spheres[shape_b], n_b, clumps.scale[j], x, y, z, s, PLACES_B
    )
    x, y, z = rows[j, 0] - x, rows[j, 1] - y, rows[j, 2] - z
    radius_b = bounding_radius(bodies, j)
    most = most_spheres(clumps)
    for k in range(WATCHED + 1):
        s[GAPS + k] = skin
    for p in range(n_a):
        rest = s[GAPS + WATCHED]
        dx, dy, dz = (
            s[PLACES_A + p] - x,
            s[PLACES_A + MOST_SPHERES + p] - y,
            s[PLACES_A + 2 * MOST_SPHERES + p] - z,
        )
        radius = s[PLACES_A + 3 * MOST_SPHERES + p]
        far = radius + radius_b + rest
        if (
            dx * dx + dy * dy + dz * dz >= far * far
            or measure_sphere(s, p, n_b, rest) == 0
        ):
            continue
        for q in range(n_b):
            if s[EXCESS + q] >= 0.0 or (
                entry >= 0 and is_set(pairs.known[entry], p * most + q)
            ):
                continue
            gap = math.sqrt(s[SQUARES + q]) - (
                radius + s[PLACES_B + 3 * MOST_SPHERES + q]
            )
            if gap > 0.0:
                if gap < s[GAPS + WATCHED]:
                    keep_gap(s, gap, p, q)
                continue
            if entry < 0:
                entry = add_entry(pairs, counts, grid, i, j)
            if entry >= 0:
                add_sphere_contact(pairs, counts, clumps, entry, i, j, p, q)
    if entry < 0 and s[GAPS] < skin:
        entry = add_entry(pairs, counts, grid, i, j)
    if entry >= 0:
        watch_nearest(bodies, pairs, entry, i, j, skin, s)
    return s[GAPS]


@inlined
def sphere_place(bodies, clumps, i, k):
    """Centre and radius of sphere k of body i, in the world."""
    row, of, scale = bodies.rows[i], clumps.spheres[clumps.shape[i]], clumps.scale[i]
    w, x, y, z = row[st.SHAPE], row[st.SHAPE + 1], row[st.SHAPE + 2], row[st.SHAPE + 3]
    px, py, pz = ct.rotated_vector(w, x, y, z, of[0, k], of[1, k], of[2, k])
    return (
        row[0] + scale * px,
        row[1] + scale * py,
        row[2] + scale * pz,
        scale * of[3, k],
    )


@inlined
def sphere_gap(bodies, clumps, i, j, a, b):
    """Gap between sphere a of body i and sphere b of body j."""
    ax, ay, az, radius_a = sphere_place(bodies, clumps, i, a)
    bx, by, bz, radius_b = sphere_place(bodies, clumps, j, b)
    dx, dy, dz = ax - bx, ay - by, az - bz
    return math.sqrt(dx * dx + dy * dy + dz * dz) - (radius_a + radius_b)


@inlined
def look_at_watched(bodies, pairs, counts, clumps, entry, i, j):
    """Check the watched pairs of spheres that are due: add their contacts, and set the limits of pairs and entry.

    Inlined: a call would take longer than the check, since the arrays are some 300 arguments.
    """
    total = bodies.displacement[i] + bodies.displacement[j]
    next_look = pairs.near_rest[entry]
    k = 0
    while k < pairs.n_watched[entry]:
        limit = pairs.watched_limit[entry, k]
        if total >= limit:
            a, b = (
                np.int64(pairs.watched[entry, k, 0]),
                np.int64(pairs.watched[entry, k, 1]),
            )
            gap = sphere_gap(bodies, clumps, i, j, a, b)
            if gap <= 0.0:
                add_sphere_contact(pairs, counts, clumps, entry, i, j, a, b)
                last = pairs.n_watched[entry] - 1
                pairs.n_watched[entry] = last
                pairs.watched[entry, k, 0] = pairs.watched[entry, last, 0]
                pairs.watched[entry, k, 1] = pairs.watched[entry, last, 1]
                pairs.watched_limit[entry, k] = pairs.watched_limit[entry, last]
                continue
            limit = total + gap
            pairs.watched_limit[entry, k] = limit
        next_look = min(next_look, limit)
        k += 1
    pairs.near_limit[entry] = next_look


@inlined
def update_near_clumps(bodies, pairs, counts, grid, clumps, s, ghost):
    """Check the entries that are due, and drop those without contacts and with a gap of a skin or more."""
    first, second, limit = pairs.near_first, pairs.near_second, pairs.near_limit
    n = counts[st.N_NEAR]
    k = next_due(bodies.displacement, first, second, limit, 0, n)
    while k < n:
        i, j = np.int64(first[k]), np.int64(second[k])
        if bodies.displacement[i] + bodies.displacement[j] < pairs.near_rest[k]:
            look_at_watched(bodies, pairs, counts, clumps, k, i, j)
        else:
            gap = look_at_spheres(bodies, pairs, counts, grid, clumps, k, i, j, s)
            if gap >= grid.lengths[st.SKIN] and pairs.live[k] == 0:
                drop_entry(pairs, counts, grid, k, ghost)
        k = next_due(bodies.displacement, first, second, limit, k + 1, n)


@inlined
def list_clumps(bodies, pairs, counts, grid, clumps, i, j, s):
    """Make an entry of two bodies whose surfaces are nearer than the skin."""
    rows = bodies.rows
    dx, dy, dz = (
        rows[j, 0] - rows[i, 0],
        rows[j, 1] - rows[i, 1],
        rows[j, 2] - rows[i, 2],
    )
    reach = (
        bounding_radius(bodies, i) + bounding_radius(bodies, j) + grid.lengths[st.SKIN]
    )
    if dx * dx + dy * dy + dz * dz < reach * reach:
        look_at_spheres(bodies, pairs, counts, grid, clumps, -1, i, j, s)


@kernel
def retire_spheres(bodies, pairs, counts, clumps, ended, ghost):
    """Drop the contacts that ended, the last first; their entries watch them and are checked when a gap may close."""
    for e in range(ended - 1, -1, -1):
        k = pairs.ended[e]
        entry = pairs.entry[k]
        limit = (
            bodies.displacement[pairs.first[k]]
            + bodies.displacement[pairs.second[k]]
            + pairs.gap[k]
        )
        pairs.near_limit[entry] = min(pairs.near_limit[entry], limit)
        n = pairs.n_watched[entry]
        if n < SLOTS:
            pairs.watched[entry, n, 0] = pairs.spheres[k, 0]
            pairs.watched[entry, n, 1] = pairs.spheres[k, 1]
            pairs.watched_limit[entry, n] = limit
            pairs.n_watched[entry] = n + 1
        else:
            pairs.near_rest[entry] = min(pairs.near_rest[entry], limit)
        drop_sphere_contact(pairs, counts, clumps, k, ghost)
