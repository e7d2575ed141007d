"""The lists of pairs of clumps: entries of near bodies, and contacts of their spheres.

A clump is a rigid body of spheres. A pair of clumps has an *entry* if two of their
spheres that do not touch are nearer than the skin. A *contact* is a pair of touching
spheres. It stores the index of its entry, so entries must keep their indices. An
element that becomes free is a hole, which is used again. `sphere_search` decides what
is in the lists, and the functions here keep the lists consistent.

Reads the shapes in `Clumps`. Writes all arrays of `SpherePairs`, `counts`, and
`Grid.near` (the number of entries of each body).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from . import clump_tile, state
from .jit import inlined, kernel
from .lists import move_contact, put_contact
from .neighbours import (
    chain_partner,
    change_pair_counts,
    count_pairs_of_moved,
    reserve_place,
    write_pair,
)
from .rows import LANES
from .state import MOST_SPHERES

BITS = 64  # bits of a word of flags
MOST_WATCHED = 16  # pairs of spheres that an entry watches, at most
SPHERE_RADIUS_ROW = 3  # of `Clumps.spheres`, after the centre


class Clumps(NamedTuple):
    """The shapes of clumps; S is the number of shapes, N that of bodies."""

    spheres: Any  # (S, 4, MOST_SPHERES): centre (3) and radius of each sphere
    sizes: Any  # (S,): number of spheres
    shape: Any  # (N,): index of a body's shape
    scale: Any  # (N,): lengths of a body over those of its shape
    mesh_sphere: Any  # of each contact with a mesh: body * MOST_SPHERES + sphere


class SpherePairs(NamedTuple):
    """Contacts of two spheres, and entries of two bodies that are near."""

    # contacts
    first: Any  # (contacts,): body A
    second: Any  # (contacts,): body B
    entry: Any  # (contacts,): the entry of the two bodies
    spheres: Any  # (contacts, 2): sphere of A, sphere of B
    data: Any  # (tiles, rows * LANES)
    ended: Any  # (contacts,): contacts that ended in this step
    gap: Any  # (contacts,): their gaps
    # entries
    near_first: Any  # (entries,): body A; the ghost in a hole
    near_second: Any  # (entries,): body B; the ghost in a hole
    near_limit: Any  # (entries,): sum of displacements at the next check
    unwatched_limit: (
        Any  # (entries,): limit of all pairs of spheres that are not watched
    )
    n_contacts: Any  # (entries,): number of contacts
    touching_bits: (
        Any  # (entries, words): which pairs of spheres touch, one bit for each
    )
    watched: Any  # (entries, MOST_WATCHED, 2): pairs of spheres that do not touch
    watched_limit: Any  # (entries, MOST_WATCHED): sum of displacements at their checks
    n_watched: Any  # (entries,): number of watched pairs
    free: Any  # (entries,): indices of the holes
    # chains of partners, see `state.Grid.chain`
    partner: Any  # (2 * entries,)
    link: Any  # (2 * entries,)


def new_clumps(shapes, shape, scale, n_meshed):
    """Return the arrays of the shapes of clumps.

    Parameters
    ----------
    shapes : sequence of Clump
        The shapes.
    shape, scale : ndarray (N,)
        Index of the shape and scale of each body.
    n_meshed : int
        Capacity of the list of contacts with meshes.

    Returns
    -------
    Clumps
        The arrays.
    """
    spheres = np.zeros((len(shapes), 4, MOST_SPHERES))
    for shape_number, clump in enumerate(shapes):
        spheres[shape_number, :, : len(clump.spheres_m)] = clump.spheres_m.T
    return Clumps(
        spheres=spheres,
        sizes=np.array([len(clump.spheres_m) for clump in shapes]),
        shape=shape,
        scale=scale,
        mesh_sphere=np.zeros(n_meshed, np.uint32),
    )


def new_sphere_pairs(n_contacts, n_entries, most_spheres, ghost, n_state):
    """Return empty lists for contacts of spheres and for entries of bodies.

    Parameters
    ----------
    n_contacts, n_entries : int
        Capacities of the lists.
    most_spheres : int
        Number of spheres of the largest clump.
    ghost : int
        Index of the ghost, the absent body that fills unused elements.
    n_state : int
        Number of rows of a contact that the force laws keep.

    Returns
    -------
    SpherePairs
        The lists.
    """
    n_contacts = state.round_up_to_tiles(n_contacts)
    # Number of words with one bit for each pair of spheres, rounded up
    n_words = -(-most_spheres * most_spheres // BITS)
    return SpherePairs(
        **state.equal_arrays("first second", n_contacts, np.uint32, ghost),
        entry=np.zeros(n_contacts, np.uint32),
        spheres=np.zeros((n_contacts, 2), np.uint8),
        data=state.new_contacts(n_contacts, clump_tile.PAIR_STATE // LANES + n_state),
        ended=np.zeros(n_contacts, np.int64),
        gap=np.zeros(n_contacts),
        **state.equal_arrays("near_first near_second", n_entries, np.uint32, ghost),
        **state.equal_arrays("near_limit unwatched_limit", n_entries, float, np.inf),
        **state.equal_arrays("n_contacts n_watched free", n_entries, np.int64),
        touching_bits=np.zeros((n_entries, n_words), np.uint64),
        watched=np.zeros((n_entries, MOST_WATCHED, 2), np.uint8),
        watched_limit=np.zeros((n_entries, MOST_WATCHED)),
        **state.equal_arrays("partner link", 2 * n_entries, np.int64),
    )


@inlined
def is_set(words, bit):
    """Return whether a bit is set in a row of 64-bit words.

    `bit` is the index of the bit, which counts through all words.
    """
    return (words[bit // BITS] >> np.uint64(bit % BITS)) & np.uint64(1) != np.uint64(0)


@inlined
def set_bit(words, bit):
    """Set a bit in a row of 64-bit words, in place; for `bit` see `is_set`."""
    words[bit // BITS] |= np.uint64(1) << np.uint64(bit % BITS)


@inlined
def clear_bit(words, bit):
    """Clear a bit in a row of 64-bit words, in place; for `bit` see `is_set`."""
    words[bit // BITS] &= ~(np.uint64(1) << np.uint64(bit % BITS))


@inlined
def count_set_bits(word):
    """Return the number of set bits of a 64-bit word."""
    # Count the set bits in each group of two bits, then of four and of eight bits.
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    # The highest byte of the product is the sum of all bytes.
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@inlined
def largest_sphere_count(clumps):
    """Return the number of spheres of the largest clump."""
    largest = 0
    for size in clumps.sizes:
        largest = max(largest, size)
    return largest


@inlined
def pair_bit(clumps, a, b):
    """Return the index of the bit of spheres a and b in `SpherePairs.touching_bits`."""
    return a * largest_sphere_count(clumps) + b


@inlined
def add_sphere_contact(pairs, counts, clumps, entry, i, j, a, b):
    """Append the contact of sphere a of body i with sphere b of body j.

    The contact begins with a relaxed tangential spring. Contact k is lane k % LANES of
    tile k // LANES of `pairs.data`; a row of a tile holds one quantity of LANES
    contacts. The list of contacts, the entry and its bits must agree, so they are
    changed together. If the list is full, the function only sets `counts[FULL]`.

    Parameters
    ----------
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    entry : int
        Index of the entry of the two bodies.
    i, j : int
        Indices of the two bodies.
    a, b : int
        Indices of the spheres in their bodies.
    """
    k = reserve_place(counts, state.N_PAIRS, pairs.first.shape[0])
    if k < 0:
        return
    write_pair(pairs.first, pairs.second, k, i, j)
    pairs.entry[k] = entry
    pairs.spheres[k, 0] = a
    pairs.spheres[k, 1] = b
    # The entry has one contact more, and a bit for these two spheres says that they
    # touch.
    pairs.n_contacts[entry] += 1
    set_bit(pairs.touching_bits[entry], pair_bit(clumps, a, b))
    # Set the spring and all other rows to zero. The normal is (0, 0, 1) until the
    # geometry is computed.
    put_contact(pairs.data, k, 0.0, 0.0, 1.0)
    # The contact stores the centres and radii of its spheres, in the axes of their
    # bodies. The row REACH is the sum of the radii, and the row CURVATURE the effective
    # radius.
    tile = pairs.data[k // LANES]
    lane = k % LANES
    spheres_a = clumps.spheres[clumps.shape[i]]
    spheres_b = clumps.spheres[clumps.shape[j]]
    scale_a = clumps.scale[i]
    scale_b = clumps.scale[j]
    for axis in range(3):
        tile[clump_tile.CENTRE_A + axis * LANES + lane] = scale_a * spheres_a[axis, a]
        tile[clump_tile.CENTRE_B + axis * LANES + lane] = scale_b * spheres_b[axis, b]
    radius_a = scale_a * spheres_a[SPHERE_RADIUS_ROW, a]
    radius_b = scale_b * spheres_b[SPHERE_RADIUS_ROW, b]
    tile[clump_tile.RADIUS_A + lane] = radius_a
    tile[clump_tile.REACH + lane] = radius_a + radius_b
    tile[clump_tile.CURVATURE + lane] = radius_a * radius_b / (radius_a + radius_b)


@inlined
def drop_sphere_contact(pairs, counts, clumps, k, ghost):
    """Remove contact k of two spheres from its entry and from the list.

    The last contact moves to index k, in all arrays of the list. The element that
    becomes free gets the ghost, a body without mass that never moves, as both of its
    bodies. No force acts between the two ghosts: they have the same centre, and all
    rows of the element except the normal are set to zero, also the radii.

    Parameters
    ----------
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    clumps : Clumps
        The spheres of the clumps (`clumps.Clumps`).
    k : int
        Index of the contact in the list.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    # The entry has one contact fewer, and the bit of these two spheres is cleared.
    entry = pairs.entry[k]
    pairs.n_contacts[entry] -= 1
    a = np.int64(pairs.spheres[k, 0])
    b = np.int64(pairs.spheres[k, 1])
    clear_bit(pairs.touching_bits[entry], pair_bit(clumps, a, b))
    # The last contact moves to index k.
    last = counts[state.N_PAIRS] - 1
    counts[state.N_PAIRS] = last
    write_pair(pairs.first, pairs.second, k, pairs.first[last], pairs.second[last])
    pairs.entry[k] = pairs.entry[last]
    pairs.spheres[k, 0] = pairs.spheres[last, 0]
    pairs.spheres[k, 1] = pairs.spheres[last, 1]
    move_contact(pairs.data, last, k)
    # The old element of the last contact gets two ghosts, and any unit normal.
    write_pair(pairs.first, pairs.second, last, ghost, ghost)
    put_contact(pairs.data, last, 0.0, 0.0, 1.0)


@inlined
def add_entry(pairs, counts, grid, i, j):
    """Add an entry of bodies i and j, in a hole or at the end of the list.

    Entries keep their indices, because contacts refer to them. An entry that is removed
    leaves a hole, an unused element of the list, whose index is in `pairs.free`. If the
    list is full, the function sets `counts[FULL]`.

    Parameters
    ----------
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    i, j : int
        Indices of the two bodies.

    Returns
    -------
    int
        Index of the entry, or -1 if there is no room. The caller must check for -1.
    """
    # Use a hole if there is one. `counts[N_NEAR]` includes the holes, so it does not
    # change.
    if counts[state.N_FREE] > 0:
        counts[state.N_FREE] -= 1
        entry = pairs.free[counts[state.N_FREE]]
    else:
        entry = reserve_place(counts, state.N_NEAR, pairs.near_limit.shape[0])
        if entry < 0:
            return entry
    change_pair_counts(grid.near, i, j, 1)
    write_pair(pairs.near_first, pairs.near_second, entry, i, j)
    return entry


@inlined
def drop_entry(pairs, counts, grid, entry, ghost):
    """Delete an entry without contacts. It becomes a hole, which is never due.

    An entry is a listed pair of clumps that are near each other. A hole is an unused
    element of the list, which holds the ghost in place of both bodies and an infinite
    limit. Its index is added to `pairs.free`, so that `add_entry` can use it again.

    Parameters
    ----------
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    entry : int
        Index of the entry.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    change_pair_counts(grid.near, pairs.near_first[entry], pairs.near_second[entry], -1)
    write_pair(pairs.near_first, pairs.near_second, entry, ghost, ghost)
    pairs.near_limit[entry] = math.inf
    pairs.free[counts[state.N_FREE]] = entry
    counts[state.N_FREE] += 1


@kernel
def chain_entries(pairs, counts, grid, ghost):
    """List the bodies with which each body in `Grid.moved_list` has an entry.

    The list of a body is a linked list, called a chain, see `neighbours.chain_partner`.
    The loop runs backwards from the end of the list, and ends when all links have been
    made. `chain_partner` makes as many links as `count_pairs_of_moved` has counted, so
    `entry` never becomes less than -1. The chains must be empty before the call.

    Parameters
    ----------
    pairs : SpherePairs
        Contacts of two spheres, and entries (`clumps.SpherePairs`). An entry is a
        listed pair of clumps that are near each other.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    n_links = count_pairs_of_moved(grid.near, grid, counts)
    # Number of links made so far, which is the index of the next one
    n_used = 0
    entry = counts[state.N_NEAR] - 1
    while n_used < n_links:
        # The index is unsigned, see `neighbours.find_next_due`.
        i = pairs.near_first[np.uint64(entry)]
        j = pairs.near_second[np.uint64(entry)]
        entry -= 1
        # Skip a hole, an unused element of the list, which holds the ghost.
        if i == ghost:
            continue
        # Add a link for each of i and j that is in the list of moved bodies.
        n_used = chain_partner(pairs, grid, n_used, i, j)
        n_used = chain_partner(pairs, grid, n_used, j, i)


@kernel
def drop_entries_of_gone(bodies, pairs, counts, grid, clumps, ghost):
    """Remove the contacts and entries of the bodies that are gone.

    A body is gone if it has fallen below the floor. An entry is a listed pair of clumps
    that are near each other, and a contact is a pair of touching spheres. Contacts are
    removed first, because an entry may only be removed when it has no contacts.

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
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    presence = bodies.presence
    # Begin at the end, because the last contact replaces a removed one.
    for k in range(counts[state.N_PAIRS] - 1, -1, -1):
        # Remove the contact if one of the two bodies is gone.
        if (
            presence[pairs.first[k]] != state.PRESENT
            or presence[pairs.second[k]] != state.PRESENT
        ):
            drop_sphere_contact(pairs, counts, clumps, k, ghost)
    # A removed entry remains in the list as a hole, which holds the ghost.
    for entry in range(counts[state.N_NEAR]):
        i = pairs.near_first[entry]
        j = pairs.near_second[entry]
        if i != ghost and (
            presence[i] != state.PRESENT or presence[j] != state.PRESENT
        ):
            drop_entry(pairs, counts, grid, entry, ghost)
