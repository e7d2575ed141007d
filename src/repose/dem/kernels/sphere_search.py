"""Search for spheres of two clumps (rigid bodies of spheres) that begin to touch.

As in `neighbours`, an entry of `clumps.SpherePairs` is checked when the displacements
of its two bodies have reached its limit. The displacement of a body is an upper bound
of the motion of each of its spheres. There are two kinds of check.

* A full search computes the gaps of all pairs of spheres. Afterwards, the entry watches
  the nearest pairs that do not touch: each gets a slot in the entry, and a limit of its
  own. All other pairs share the limit `unwatched_limit`, which is the sum of the
  displacements at this search plus their smallest gap.
* Until `unwatched_limit` is reached, a check computes the gaps of only those watched
  pairs that have reached their own limits.

A pair of spheres whose contact ends is watched, too. If no slot is free for the pair,
it lowers `unwatched_limit` instead.

Reads `Bodies.rows`, `Bodies.displacement` and `Clumps`. Writes the contacts and entries
of `SpherePairs`, `counts`, and `scratch` (`Scratch.spheres`).

`scratch` is a flat array. The spheres of a body are four rows of MOST_SPHERES
numbers (x, y, z, radius); sphere k of body A has
scratch[SPHERES_A + row * MOST_SPHERES + k].
"""

import math

import numpy as np

from . import clump_tile, state
from .clumps import (
    MOST_WATCHED,
    SPHERE_RADIUS_ROW,
    add_entry,
    add_sphere_contact,
    drop_entry,
    drop_sphere_contact,
    is_set,
    largest_sphere_count,
)
from .jit import inlined, kernel
from .neighbours import find_next_due
from .rows import vector_at
from .state import MOST_SPHERES, POSITION, SHAPE, bounding_radius

# Number of pairs that are watched after a full search. The other slots are left for
# contacts that end.
WATCHED_AFTER_SEARCH = MOST_WATCHED - 4
# Indices in the scratch array of the spheres of A and those of B, four rows each
SPHERES_A = 0
SPHERES_B = 4 * MOST_SPHERES
# For one sphere of A and each sphere of B: the squared distance of their centres, and
# by how much it exceeds the squared distance below which the gap is computed
SQUARED_DISTANCES = 8 * MOST_SPHERES
EXCESS = 9 * MOST_SPHERES
# The smallest gaps, in increasing order, and the spheres of A and B that have them.
GAPS = 10 * MOST_SPHERES
GAPS_SPHERE_A = GAPS + state.SMALLEST_GAPS
GAPS_SPHERE_B = GAPS + 2 * state.SMALLEST_GAPS
LARGEST_GAP = GAPS + WATCHED_AFTER_SEARCH  # index of the largest of the smallest gaps


@inlined
def write_sphere_positions(
    row, spheres, n_spheres, scale, origin_x, origin_y, origin_z, scratch, first
):
    """Write centres and radii of all spheres of a clump, in world axes, to an array.

    Parameters
    ----------
    row : array
        The clump, a row of `Bodies.rows`, with its position and quaternion.
    spheres : array (4, MOST_SPHERES)
        Centres (rows 0 to 2) and radii (row 3) of the spheres of its shape, in the axes
        of the body.
    n_spheres : int
        Number of spheres.
    scale : float
        Scale of the body: its lengths divided by those of its shape.
    origin_x, origin_y, origin_z : float
        Origin relative to which the centres are written, in the world [m].
    scratch : array
        Four rows of MOST_SPHERES numbers (x, y, z, radius) are overwritten [m].
    first : int
        Index in `scratch` at which the first of these rows begins: SPHERES_A or
        SPHERES_B.
    """
    # In the columns of the shape, a clump has its quaternion (qw, qx, qy, qz). It
    # rotates the spheres' centres into world axes.
    qw = row[SHAPE]
    qx, qy, qz = vector_at(row, SHAPE + 1)
    body_x, body_y, body_z = vector_at(row, POSITION)
    dx, dy, dz = body_x - origin_x, body_y - origin_y, body_z - origin_z
    for sphere in range(n_spheres):
        rotated_x, rotated_y, rotated_z = clump_tile.rotated_vector(
            qw, qx, qy, qz, spheres[0, sphere], spheres[1, sphere], spheres[2, sphere]
        )
        scratch[first + sphere] = dx + scale * rotated_x
        scratch[first + MOST_SPHERES + sphere] = dy + scale * rotated_y
        scratch[first + 2 * MOST_SPHERES + sphere] = dz + scale * rotated_z
        scratch[first + 3 * MOST_SPHERES + sphere] = (
            scale * spheres[SPHERE_RADIUS_ROW, sphere]
        )


@inlined
def read_sphere_centre(scratch, first, sphere):
    """Return the centre of a sphere that `write_sphere_positions` wrote [m].

    `first` is SPHERES_A or SPHERES_B, and `sphere` is the index of the sphere in its
    body.
    """
    return (
        scratch[first + sphere],
        scratch[first + MOST_SPHERES + sphere],
        scratch[first + 2 * MOST_SPHERES + sphere],
    )


@inlined
def read_sphere_radius(scratch, first, sphere):
    """Return the radius of a sphere that `write_sphere_positions` wrote [m].

    `first` is SPHERES_A or SPHERES_B, and `sphere` is the index of the sphere in its
    body.
    """
    return scratch[first + 3 * MOST_SPHERES + sphere]


@inlined
def count_near_spheres(scratch, a, n_spheres, limit):
    """Count the spheres of clump B whose gap to one sphere of clump A is below a limit.

    Squared distances are compared, because square roots are slow. Two rows of `scratch`
    are overwritten for the caller, with a number for each sphere of B: the squared
    distance of the centres (row SQUARED_DISTANCES), and this minus the squared distance
    of two spheres with the gap `limit` (row EXCESS), which is negative for the spheres
    that are counted.

    Parameters
    ----------
    scratch : array
        `Scratch.spheres`, with the spheres of both clumps, see
        `write_sphere_positions`.
    a : int
        Index of the sphere of A.
    n_spheres : int
        Number of spheres of B.
    limit : float
        The gap [m].

    Returns
    -------
    int
        Number of these spheres of B.
    """
    x, y, z = read_sphere_centre(scratch, SPHERES_A, a)
    reach = read_sphere_radius(scratch, SPHERES_A, a) + limit
    n_near = 0
    for b in range(n_spheres):
        bx, by, bz = read_sphere_centre(scratch, SPHERES_B, b)
        dx = bx - x
        dy = by - y
        dz = bz - z
        # The distance of two centres whose spheres have the gap `limit`
        distance = reach + read_sphere_radius(scratch, SPHERES_B, b)
        squared_distance = dx * dx + dy * dy + dz * dz
        excess = squared_distance - distance * distance
        scratch[SQUARED_DISTANCES + b] = squared_distance
        scratch[EXCESS + b] = excess
        # Without a branch, the loop becomes vector code.
        n_near += 1 if excess < 0.0 else 0
    return n_near


@inlined
def insert_gap(scratch, gap, a, b):
    """Insert a gap into the sorted list of smallest gaps, and drop the largest one.

    The new gap must be below the largest of them.

    Parameters
    ----------
    scratch : array
        The row GAPS holds the WATCHED_AFTER_SEARCH + 1 smallest gaps so far, in
        increasing order [m]. The rows GAPS_SPHERE_A and GAPS_SPHERE_B hold the spheres
        of A and B with these gaps. All three rows are updated.
    gap : float
        The new gap, below the largest of these gaps [m].
    a, b : int
        Indices of the spheres of A and B with this gap.
    """
    index = WATCHED_AFTER_SEARCH
    # Start at the end of the list, whose gap is dropped, and move larger gaps up by
    # one.
    while index > 0 and scratch[GAPS + index - 1] > gap:
        scratch[GAPS + index] = scratch[GAPS + index - 1]
        scratch[GAPS_SPHERE_A + index] = scratch[GAPS_SPHERE_A + index - 1]
        scratch[GAPS_SPHERE_B + index] = scratch[GAPS_SPHERE_B + index - 1]
        index -= 1
    scratch[GAPS + index] = gap
    scratch[GAPS_SPHERE_A + index] = a
    scratch[GAPS_SPHERE_B + index] = b


@inlined
def watch_nearest_spheres(bodies, pairs, entry, i, j, skin, scratch):
    """Let an entry watch the pairs of spheres with the smallest gaps.

    An entry is a listed pair of clumps that are near each other. It has MOST_WATCHED
    slots, each for one pair of spheres that is watched: its gap is checked separately.
    The function is called after a full search of all pairs of spheres, which writes the
    smallest gaps to `scratch` in increasing order. Each watched pair gets a limit, the
    sum of both bodies' displacements at which the spheres may touch. The entry gets the
    smallest of these limits (`near_limit`), and a common limit for all other pairs of
    spheres (`unwatched_limit`).

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    entry, i, j : int
        Index of the entry, and its two bodies.
    skin : float
        Gaps of this size or more are not watched [m].
    scratch : array
        Working memory with the smallest gaps, see `insert_gap`.
    """
    displacement_sum = bodies.displacement[i] + bodies.displacement[j]
    slot = 0
    while slot < WATCHED_AFTER_SEARCH and scratch[GAPS + slot] < skin:
        # A clump has at most 64 spheres, so their indices are stored in 8 bits.
        pairs.watched[entry, slot, 0] = np.uint8(scratch[GAPS_SPHERE_A + slot])
        pairs.watched[entry, slot, 1] = np.uint8(scratch[GAPS_SPHERE_B + slot])
        pairs.watched_limit[entry, slot] = displacement_sum + scratch[GAPS + slot]
        slot += 1
    pairs.n_watched[entry] = slot
    # If no gap is below the skin, all gaps in the list equal the skin.
    pairs.near_limit[entry] = displacement_sum + scratch[GAPS]
    pairs.unwatched_limit[entry] = displacement_sum + scratch[LARGEST_GAP]


@kernel
def search_all_spheres(bodies, pairs, counts, grid, clumps, entry, i, j, scratch):
    """Find all touching spheres of clumps i and j, and watch the nearest of the others.

    An entry is a listed pair of clumps that are near each other. New contacts are added
    to the entry of i and j. It watches the pairs of spheres with the smallest gaps:
    each of them gets a limit, at which its gap is checked again.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    entry : int
        Index of the entry of the two bodies; -1 if there is none. In this case, an
        entry is added if two spheres touch or have a gap below the skin.
    i, j : int
        The two bodies A and B.
    scratch : array
        `Scratch.spheres`; it is overwritten.

    Returns
    -------
    float
        The smallest gap of two spheres that do not touch, or the skin if no gap is
        smaller [m].
    """
    rows = bodies.rows
    skin = grid.lengths[state.SKIN]
    shape_a = clumps.shape[i]
    shape_b = clumps.shape[j]
    n_a = clumps.sizes[shape_a]
    n_b = clumps.sizes[shape_b]
    # Positions relative to the centre of A have smaller rounding errors than positions
    # in the world.
    x, y, z = vector_at(rows[i], POSITION)
    write_sphere_positions(
        rows[i],
        clumps.spheres[shape_a],
        n_a,
        clumps.scale[i],
        x,
        y,
        z,
        scratch,
        SPHERES_A,
    )
    write_sphere_positions(
        rows[j],
        clumps.spheres[shape_b],
        n_b,
        clumps.scale[j],
        x,
        y,
        z,
        scratch,
        SPHERES_B,
    )
    bx, by, bz = vector_at(rows[j], POSITION)
    bx, by, bz = bx - x, by - y, bz - z  # the centre of B
    radius_b = bounding_radius(bodies, j)
    largest_count = largest_sphere_count(clumps)
    for k in range(WATCHED_AFTER_SEARCH + 1):
        scratch[GAPS + k] = skin
    for a in range(n_a):
        # Only gaps below the largest of the smallest gaps so far matter.
        limit = scratch[LARGEST_GAP]
        ax, ay, az = read_sphere_centre(scratch, SPHERES_A, a)
        # Skip a sphere of A that is far from the bounding sphere of B.
        dx, dy, dz = ax - bx, ay - by, az - bz
        radius_a = read_sphere_radius(scratch, SPHERES_A, a)
        reach = radius_a + radius_b + limit
        if (
            dx * dx + dy * dy + dz * dz >= reach * reach
            or count_near_spheres(scratch, a, n_b, limit) == 0
        ):
            continue
        for b in range(n_b):
            # Skip spheres with larger gaps, and those that already have a contact.
            if scratch[EXCESS + b] >= 0.0 or (
                entry >= 0 and is_set(pairs.touching_bits[entry], a * largest_count + b)
            ):
                continue
            gap = math.sqrt(scratch[SQUARED_DISTANCES + b]) - (
                radius_a + read_sphere_radius(scratch, SPHERES_B, b)
            )
            # If the spheres do not touch, keep the gap if it is among the smallest.
            if gap > 0.0:
                if gap < scratch[LARGEST_GAP]:
                    insert_gap(scratch, gap, a, b)
                continue
            if entry < 0:
                entry = add_entry(pairs, counts, grid, i, j)
            if entry >= 0:
                add_sphere_contact(pairs, counts, clumps, entry, i, j, a, b)
    if entry < 0 and scratch[GAPS] < skin:
        entry = add_entry(pairs, counts, grid, i, j)
    if entry >= 0:
        watch_nearest_spheres(bodies, pairs, entry, i, j, skin, scratch)
    return scratch[GAPS]


@inlined
def sphere_in_world(bodies, clumps, i, sphere):
    """Return centre (x, y, z) and radius of a sphere of body i, in the world [m].

    `Clumps` has the spheres of each shape at scale 1, in rows: x, y, z and radius.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    i : int
        Index of the body.
    sphere : int
        Index of the sphere in its body.
    """
    row = bodies.rows[i]
    spheres = clumps.spheres[clumps.shape[i]]
    scale = clumps.scale[i]
    # In the columns of the shape, a clump has its quaternion (qw, qx, qy, qz). It
    # rotates the sphere's centre into world axes.
    qw = row[SHAPE]
    qx, qy, qz = vector_at(row, SHAPE + 1)
    body_x, body_y, body_z = vector_at(row, POSITION)
    rotated_x, rotated_y, rotated_z = clump_tile.rotated_vector(
        qw, qx, qy, qz, spheres[0, sphere], spheres[1, sphere], spheres[2, sphere]
    )
    return (
        body_x + scale * rotated_x,
        body_y + scale * rotated_y,
        body_z + scale * rotated_z,
        scale * spheres[SPHERE_RADIUS_ROW, sphere],
    )


@inlined
def sphere_gap(bodies, clumps, i, j, a, b):
    """Return the gap between sphere a of body i and sphere b of body j [m].

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    i, j : int
        Indices of the two bodies.
    a, b : int
        Indices of the spheres in their bodies.
    """
    ax, ay, az, radius_a = sphere_in_world(bodies, clumps, i, a)
    bx, by, bz, radius_b = sphere_in_world(bodies, clumps, j, b)
    dx, dy, dz = ax - bx, ay - by, az - bz
    return math.sqrt(dx * dx + dy * dy + dz * dz) - (radius_a + radius_b)


@inlined
def drop_watched_pair(pairs, entry, slot):
    """Remove a pair of spheres from those that an entry watches.

    An entry, a listed pair of clumps, has slots for pairs of spheres whose gaps are
    checked separately. The last watched pair moves to the slot that becomes free.

    Parameters
    ----------
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    entry : int
        Index of the entry.
    slot : int
        Slot of the pair among those that the entry watches.
    """
    last = pairs.n_watched[entry] - 1
    pairs.n_watched[entry] = last
    pairs.watched[entry, slot, 0] = pairs.watched[entry, last, 0]
    pairs.watched[entry, slot, 1] = pairs.watched[entry, last, 1]
    pairs.watched_limit[entry, slot] = pairs.watched_limit[entry, last]


@inlined
def check_watched_pairs(bodies, pairs, counts, clumps, entry, i, j):
    """Check the watched pairs of spheres of an entry that are due.

    An entry is a listed pair of clumps, here i and j, that are near each other. It
    watches some pairs of their spheres, one in each of its slots. All limits are sums
    of the displacements of i and j. A watched pair is due when this sum has reached its
    limit (`watched_limit`). If the spheres touch, the pair becomes a contact, otherwise
    it gets a new limit. The entry is checked again (`near_limit`) at the smallest limit
    of all pairs, including that of the pairs that are not watched (`unwatched_limit`).

    The function is inlined, because a call with all these arrays would take longer than
    the check.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    entry, i, j : int
        Index of the entry, and its two bodies.
    """
    displacement_sum = bodies.displacement[i] + bodies.displacement[j]
    next_check = pairs.unwatched_limit[entry]
    slot = 0
    while slot < pairs.n_watched[entry]:
        limit = pairs.watched_limit[entry, slot]
        if displacement_sum >= limit:
            a = np.int64(pairs.watched[entry, slot, 0])
            b = np.int64(pairs.watched[entry, slot, 1])
            gap = sphere_gap(bodies, clumps, i, j, a, b)
            if gap <= 0.0:
                add_sphere_contact(pairs, counts, clumps, entry, i, j, a, b)
                # Another pair now has this slot, so check the slot again.
                drop_watched_pair(pairs, entry, slot)
                continue
            limit = displacement_sum + gap
            pairs.watched_limit[entry, slot] = limit
        next_check = min(next_check, limit)
        slot += 1
    pairs.near_limit[entry] = next_check


@inlined
def update_near_clumps(bodies, pairs, counts, grid, clumps, scratch, ghost):
    """Check all entries of two clumps that are due.

    An entry is a listed pair of clumps that are near each other. It is due when the
    displacements of the two bodies have reached its limit, a sum at which spheres may
    touch. Spheres that touch become contacts. An entry is removed if it has no contacts
    and none of its gaps is below the skin, the largest gap of an entry.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    scratch : array
        `Scratch.spheres`; it is overwritten.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    first = pairs.near_first
    second = pairs.near_second
    limit = pairs.near_limit
    n_entries = counts[state.N_NEAR]
    entry = find_next_due(bodies.displacement, first, second, limit, 0, n_entries)
    while entry < n_entries:
        i = np.int64(first[entry])
        j = np.int64(second[entry])
        displacement_sum = bodies.displacement[i] + bodies.displacement[j]
        # Some pairs of spheres are watched, each with a limit of its own. All others
        # have one common limit. Before it is reached, check only the watched pairs;
        # then search all.
        if displacement_sum < pairs.unwatched_limit[entry]:
            check_watched_pairs(bodies, pairs, counts, clumps, entry, i, j)
        else:
            gap = search_all_spheres(
                bodies, pairs, counts, grid, clumps, entry, i, j, scratch
            )
            if gap >= grid.lengths[state.SKIN] and pairs.n_contacts[entry] == 0:
                # The entry becomes a hole, so the other entries keep their indices.
                drop_entry(pairs, counts, grid, entry, ghost)
        entry = find_next_due(
            bodies.displacement, first, second, limit, entry + 1, n_entries
        )


@inlined
def add_clump_pair_if_near(bodies, pairs, counts, grid, clumps, i, j, scratch):
    """Add an entry of two clumps if a gap of their spheres is below the skin.

    An entry is a listed pair of clumps; this pair must not have one yet. The skin is
    the largest gap of an entry. The bounding spheres are compared first.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    i, j : int
        Indices of the two bodies.
    scratch : array
        `Scratch.spheres`; it is overwritten.
    """
    ax, ay, az = vector_at(bodies.rows[i], POSITION)
    bx, by, bz = vector_at(bodies.rows[j], POSITION)
    dx, dy, dz = bx - ax, by - ay, bz - az
    radii = bounding_radius(bodies, i) + bounding_radius(bodies, j)
    reach = radii + grid.lengths[state.SKIN]
    if dx * dx + dy * dy + dz * dz < reach * reach:
        # The -1 says that there is no entry yet. The search adds one if spheres are
        # near.
        search_all_spheres(bodies, pairs, counts, grid, clumps, -1, i, j, scratch)


@kernel
def retire_spheres(bodies, pairs, counts, clumps, n_ended, ghost):
    """Remove the contacts of spheres that have ended, and watch these spheres.

    The entry of a contact, a listed pair of clumps that are near each other, has slots
    for pairs of spheres whose gaps are checked separately. The spheres of an ended
    contact get a free slot. All limits are sums of the displacements of the two bodies
    at the next check.

    The loop begins with the last of these contacts. The last contact of the list
    replaces each removed one, so in this order the remaining indices stay valid.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    n_ended : int
        Number of these contacts. Their indices are `pairs.ended[:n_ended]`, in
        increasing order.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    for index in range(n_ended - 1, -1, -1):
        contact = pairs.ended[index]
        entry = pairs.entry[contact]
        # The spheres cannot touch before the bodies have together moved by this gap.
        limit = (
            bodies.displacement[pairs.first[contact]]
            + bodies.displacement[pairs.second[contact]]
            + pairs.gap[contact]
        )
        # The entry must be checked by then.
        pairs.near_limit[entry] = min(pairs.near_limit[entry], limit)
        # Watch the spheres. If no slot is free, lower the limit of the unwatched pairs,
        # so that the next search of all spheres comes earlier.
        slot = pairs.n_watched[entry]
        if slot < MOST_WATCHED:
            pairs.watched[entry, slot, 0] = pairs.spheres[contact, 0]
            pairs.watched[entry, slot, 1] = pairs.spheres[contact, 1]
            pairs.watched_limit[entry, slot] = limit
            pairs.n_watched[entry] = slot + 1
        else:
            pairs.unwatched_limit[entry] = min(pairs.unwatched_limit[entry], limit)
        drop_sphere_contact(pairs, counts, clumps, contact, ghost)
