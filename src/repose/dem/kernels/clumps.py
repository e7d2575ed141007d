"""The pairs of touching spheres of clumps.

A pair of clumps has an entry when two of its spheres that do not touch are nearer than the skin; `sphere_search` checks
the entries. Contacts store the place of their entry, so entries keep their places, and holes are used again.
"""

import math
from collections import namedtuple

import numpy as np

from . import clump_tile as ct
from . import state as st
from .jit import inlined, kernel
from .lists import move_contact, put_contact
from .neighbours import chain_partner, count_pair, listed, take_place, write_pair
from .rows import L
from .state import MOST_SPHERES

WORD = 64  # bits of a word of flags
SLOTS = 16  # pairs of spheres that an entry watches, at most

# spheres (S, 4, MOST_SPHERES): centres and radii of each shape's spheres; sizes (S,): how many. shape, scale (N,): of
# each body. mesh_sphere: of each contact with a mesh, body * MOST_SPHERES + sphere.
Clumps = namedtuple("Clumps", "spheres sizes shape scale mesh_sphere")
# Contacts: bodies first and second, entry; spheres (n, 2). Entries: bodies near_first and near_second (a hole
# has those of the ghost), near_limit, number of contacts (live), their pairs of spheres (known, a bit each), the holes
# (free). Of an entry's pairs of spheres that do not touch: the watched pairs (n, SLOTS, 2), their number (n_watched)
# and limits (watched_limit), and the limit of all others (near_rest).
SpherePairs = namedtuple(
    "SpherePairs",
    "first second entry spheres data ended gap near_first near_second near_limit near_rest live known watched "
    "watched_limit n_watched free partner link",
)


def new_clumps(shapes, shape, scale, n_meshed):
    """Return the spheres of shapes, and each body's shape and scale; n_meshed: room for contacts with meshes."""
    spheres = np.zeros((len(shapes), 4, MOST_SPHERES))
    for k, clump in enumerate(shapes):
        spheres[k, :, : len(clump.spheres_m)] = clump.spheres_m.T
    sizes = np.array([len(clump.spheres_m) for clump in shapes])
    return Clumps(
        spheres, sizes, shape, scale, mesh_sphere=np.zeros(n_meshed, np.uint32)
    )


def new_sphere_pairs(n_contacts, n_entries, most, ghost, n_state):
    """Arrays for contacts of spheres and for entries of bodies of at most `most` spheres, as `state.new_pairs`."""
    n_contacts = st.whole_tiles(n_contacts)
    data = st.new_contacts(n_contacts, ct.PAIR_STATE // L + n_state)
    return SpherePairs(
        **st.each("first second", n_contacts, np.uint32, ghost),
        entry=np.zeros(n_contacts, np.uint32),
        spheres=np.zeros((n_contacts, 2), np.uint8),
        data=data,
        ended=np.zeros(n_contacts, np.int64),
        gap=np.zeros(n_contacts),
        **st.each("near_first near_second", n_entries, np.uint32, ghost),
        **st.each("near_limit near_rest", n_entries, float, np.inf),
        **st.each("live n_watched free", n_entries, np.int64),
        known=np.zeros((n_entries, -(-most * most // WORD)), np.uint64),
        watched=np.zeros((n_entries, SLOTS, 2), np.uint8),
        watched_limit=np.zeros((n_entries, SLOTS)),
        **st.each("partner link", 2 * n_entries, np.int64),
    )


@inlined
def is_set(words, bit):
    """Whether a bit of a row of words is set."""
    return (words[bit // WORD] >> np.uint64(bit % WORD)) & np.uint64(1) != np.uint64(0)


@inlined
def set_bit(words, bit):
    """Set a bit of a row of words."""
    words[bit // WORD] |= np.uint64(1) << np.uint64(bit % WORD)


@inlined
def clear_bit(words, bit):
    """Clear a bit of a row of words."""
    words[bit // WORD] &= ~(np.uint64(1) << np.uint64(bit % WORD))


@inlined
def bits_set(word):
    """Count the bits of a word that are set: pairs of bits are added up, then fours, then bytes."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@inlined
def most_spheres(clumps):
    """Count the spheres of the largest clump."""
    most = 0
    for size in clumps.sizes:
        most = max(most, size)
    return most


@inlined
def add_sphere_contact(pairs, counts, clumps, entry, i, j, a, b):
    """Append the contact of sphere a of body i with sphere b of body j, with a relaxed spring."""
    k = take_place(counts, st.N_PAIRS, pairs.first.shape[0])
    if k < 0:
        return
    write_pair(pairs.first, pairs.second, k, i, j)
    pairs.entry[k] = entry
    pairs.spheres[k, 0] = a
    pairs.spheres[k, 1] = b
    pairs.live[entry] += 1
    set_bit(pairs.known[entry], a * most_spheres(clumps) + b)
    put_contact(pairs.data, k, 0.0, 0.0, 1.0)
    tile, lane = pairs.data[k // L], k % L
    of_a, of_b = clumps.spheres[clumps.shape[i]], clumps.spheres[clumps.shape[j]]
    scale_a, scale_b = clumps.scale[i], clumps.scale[j]
    for c in range(3):
        tile[ct.CENTRE_A + c * L + lane] = scale_a * of_a[c, a]
        tile[ct.CENTRE_B + c * L + lane] = scale_b * of_b[c, b]
    radius_a, radius_b = scale_a * of_a[3, a], scale_b * of_b[3, b]
    tile[ct.RADIUS_A + lane] = radius_a
    tile[ct.REACH + lane] = radius_a + radius_b
    tile[ct.CURVATURE + lane] = radius_a * radius_b / (radius_a + radius_b)


@inlined
def drop_sphere_contact(pairs, counts, clumps, k, ghost):
    """Remove contact k from its entry and the list by a swap with the last one, whose freed place points at `ghost`."""
    entry = pairs.entry[k]
    pairs.live[entry] -= 1
    a, b = np.int64(pairs.spheres[k, 0]), np.int64(pairs.spheres[k, 1])
    clear_bit(pairs.known[entry], a * most_spheres(clumps) + b)
    last = counts[st.N_PAIRS] - 1
    counts[st.N_PAIRS] = last
    write_pair(pairs.first, pairs.second, k, pairs.first[last], pairs.second[last])
    pairs.entry[k] = pairs.entry[last]
    pairs.spheres[k, 0] = pairs.spheres[last, 0]
    pairs.spheres[k, 1] = pairs.spheres[last, 1]
    move_contact(pairs.data, last, k)
    write_pair(pairs.first, pairs.second, last, ghost, ghost)
    # two ghosts are in the same place: without radii they do not overlap, without a law's state they do not cohere
    put_contact(pairs.data, last, 0.0, 0.0, 1.0)


@inlined
def add_entry(pairs, counts, grid, i, j):
    """Add an entry of two bodies, in a hole or at the end; return its place, or -1 where there is no room."""
    if counts[st.N_FREE] > 0:
        counts[st.N_FREE] -= 1
        k = pairs.free[counts[st.N_FREE]]
    else:
        k = take_place(counts, st.N_NEAR, pairs.near_limit.shape[0])
        if k < 0:
            return k
    count_pair(grid.near, i, j, 1)
    write_pair(pairs.near_first, pairs.near_second, k, i, j)
    return k


@inlined
def drop_entry(pairs, counts, grid, k, ghost):
    """Delete an entry without contacts, which leaves a hole."""
    count_pair(grid.near, pairs.near_first[k], pairs.near_second[k], -1)
    write_pair(pairs.near_first, pairs.near_second, k, ghost, ghost)
    pairs.near_limit[k] = math.inf
    pairs.free[counts[st.N_FREE]] = k
    counts[st.N_FREE] += 1


@kernel
def chain_entries(pairs, counts, grid, ghost):
    """Chain the partners in the entries of each body whose neighbours are found anew."""
    left = listed(grid.near, grid, counts)
    used = 0
    k = counts[st.N_NEAR] - 1
    while used < left:
        i = pairs.near_first[np.uint64(k)]
        j = pairs.near_second[np.uint64(k)]
        k -= 1
        if i == ghost:
            continue
        used = chain_partner(pairs, grid, used, i, j)
        used = chain_partner(pairs, grid, used, j, i)


@kernel
def drop_entries_of_gone(bodies, pairs, counts, grid, clumps, ghost):
    """Drop the contacts and entries of the bodies that are gone."""
    presence = bodies.presence
    for k in range(counts[st.N_PAIRS] - 1, -1, -1):
        if (
            presence[pairs.first[k]] != st.PRESENT
            or presence[pairs.second[k]] != st.PRESENT
        ):
            drop_sphere_contact(pairs, counts, clumps, k, ghost)
    for k in range(counts[st.N_NEAR]):
        i, j = pairs.near_first[k], pairs.near_second[k]
        if i != ghost and (presence[i] != st.PRESENT or presence[j] != st.PRESENT):
            drop_entry(pairs, counts, grid, k, ghost)
