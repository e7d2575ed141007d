"""The neighbour (Verlet) list with a skin, kept pair by pair and body by body.

Every body has a displacement: the sum over all steps of how far any of its points may have moved. A near pair has a
limit, the gap at the last check plus both displacements at that time; as long as the sum of the displacements is below
the limit, the bodies cannot touch and are not checked. A pair with a gap of a skin or more is not listed. The pairs of
a body are listed anew when it has moved by half a skin since the last listing. So two bodies of an unlisted pair
together move by less than the skin before the pairs of one of them are listed anew.
"""

import math

import numpy as np

from . import state as st
from .contact import solve_gap
from .jit import inlined, kernel
from .lists import move_contact, put_contact
from .rows import L, lane_vector

# A proven gap above this share of the skin is good enough; below it the true gap is found.
EARLY = 0.25
TOLERANCE = 1e-4


@inlined
def cell_of(grid, x, y, z):
    """Index of the cell of a point; the cells repeat in space (see `state.new_grid`)."""
    edge = grid.lengths[st.CELL]
    i = math.floor((x - grid.origin[0]) / edge)
    j = math.floor((y - grid.origin[1]) / edge)
    k = math.floor((z - grid.origin[2]) / edge)
    i, j, k = i % grid.shape[0], j % grid.shape[1], k % grid.shape[2]
    return (i * grid.shape[1] + j) * grid.shape[2] + k


@kernel
def unlink(grid, i):
    """Take body i out of its cell."""
    cell = grid.cell[i]
    if cell < 0:
        return
    before, after = grid.preceding[i], grid.following[i]
    if before >= 0:
        grid.following[before] = after
    else:
        grid.head[cell] = after
    if after >= 0:
        grid.preceding[after] = before
    grid.cell[i] = -1


@inlined
def put_in_cell(grid, i, cell):
    """Put body i, which is in none, into a cell."""
    grid.cell[i] = cell
    grid.preceding[i] = -1
    grid.following[i] = grid.head[cell]
    if grid.head[cell] >= 0:
        grid.preceding[grid.head[cell]] = i
    grid.head[cell] = i


@kernel
def link(grid, bodies, i):
    """Put body i into the cell of its position, and set the displacement at which its neighbours are found anew."""
    x, y, z = bodies.rows[i, 0], bodies.rows[i, 1], bodies.rows[i, 2]
    cell = cell_of(grid, x, y, z)
    bodies.motion[i // L, st.RELIST + i % L] = (
        bodies.displacement[i] + 0.5 * grid.lengths[st.SKIN]
    )
    put_in_cell(grid, i, cell)


@inlined
def mark_moved(grid, counts, i):
    """Mark body i: its neighbours are found anew at the next step."""
    if grid.moved[i] == 0:
        grid.moved[i] = 1
        grid.moved_list[counts[st.N_MOVED]] = i
        counts[st.N_MOVED] += 1


@inlined
def count_pair(counter, i, j, by):
    """Count a pair of bodies, or no longer."""
    counter[i] += by
    counter[j] += by


@inlined
def write_pair(first, second, k, i, j):
    """Write two bodies to place k of a list."""
    first[k] = i
    second[k] = j


@inlined
def take_place(counts, slot, room):
    """Take the next place of a list and return it, or -1 where there is no room."""
    k = counts[slot]
    if k >= room:
        counts[st.FULL] = 1
        return -1
    counts[slot] = k + 1
    return k


@inlined
def drop_near(pairs, counts, grid, k):
    """Remove near pair k by a swap with the last one."""
    last = counts[st.N_NEAR] - 1
    counts[st.N_NEAR] = last
    count_pair(grid.near, pairs.near_first[k], pairs.near_second[k], -1)
    write_pair(
        pairs.near_first,
        pairs.near_second,
        k,
        pairs.near_first[last],
        pairs.near_second[last],
    )
    pairs.near_limit[k] = pairs.near_limit[last]
    pairs.near_check[k // st.BLOCK] = 0.0
    for c in range(3):
        pairs.near_normal[k, c] = pairs.near_normal[last, c]


@inlined
def add_near(pairs, counts, grid, i, j, limit, nx, ny, nz):
    """Append a near pair."""
    k = take_place(counts, st.N_NEAR, pairs.near_limit.shape[0])
    if k < 0:
        return
    count_pair(grid.near, i, j, 1)
    write_pair(pairs.near_first, pairs.near_second, k, i, j)
    pairs.near_limit[k] = limit
    pairs.near_check[k // st.BLOCK] = 0.0
    pairs.near_normal[k, 0], pairs.near_normal[k, 1], pairs.near_normal[k, 2] = (
        nx,
        ny,
        nz,
    )


@inlined
def add_contact(pairs, counts, grid, i, j, normal):
    """Append a touching pair with a relaxed spring."""
    k = take_place(counts, st.N_PAIRS, pairs.first.shape[0])
    if k < 0:
        return
    count_pair(grid.touching, i, j, 1)
    write_pair(pairs.first, pairs.second, k, i, j)
    put_contact(pairs.data, k, normal[0], normal[1], normal[2])


@inlined
def drop_contact(pairs, counts, grid, k, ghost):
    """Remove touching pair k by a swap with the last one, whose freed place points at `ghost`."""
    last = counts[st.N_PAIRS] - 1
    counts[st.N_PAIRS] = last
    count_pair(grid.touching, pairs.first[k], pairs.second[k], -1)
    write_pair(pairs.first, pairs.second, k, pairs.first[last], pairs.second[last])
    move_contact(pairs.data, last, k)
    write_pair(pairs.first, pairs.second, last, ghost, ghost)


@inlined
def near_gap(bodies, pairs, grid, parts, k, normal):
    """Solve for the gap of near pair k from its last normal, which is updated; the new one is in `normal`, too."""
    for c in range(3):
        normal[c] = pairs.near_normal[k, c]
    early = EARLY * grid.lengths[st.SKIN]
    gap = solve_gap(
        bodies.rows,
        parts,
        pairs.near_first[k],
        pairs.near_second[k],
        normal,
        TOLERANCE,
        early,
    )
    for c in range(3):
        pairs.near_normal[k, c] = normal[c]
    return gap


@inlined
def check_near(bodies, pairs, counts, grid, parts, k, normal):
    """Solve for the gap of near pair k, make it a contact or set a new limit; returns whether it stays in the list."""
    i, j = pairs.near_first[k], pairs.near_second[k]
    gap = near_gap(bodies, pairs, grid, parts, k, normal)
    if gap <= 0.0:
        drop_near(pairs, counts, grid, k)
        add_contact(pairs, counts, grid, i, j, normal)
        return False
    pairs.near_limit[k] = bodies.displacement[i] + bodies.displacement[j] + gap
    return True


@kernel
def next_due(displacement, first, second, limit, begin, end):
    """First pair of begin to end whose displacements have used up its gap, or `end`.

    The indices are unsigned: for signed indices numba checks for negative numbers, which would double the time.
    """
    for k in range(begin, end):
        u = np.uint64(k)
        if displacement[first[u]] + displacement[second[u]] >= limit[u]:
            return k
    return end


@kernel
def update_near(bodies, pairs, counts, grid, parts, normal):
    """Check the near pairs whose displacements have used up their gap."""
    first, second, limit = pairs.near_first, pairs.near_second, pairs.near_limit
    k = next_due(bodies.displacement, first, second, limit, 0, counts[st.N_NEAR])
    while k < counts[st.N_NEAR]:
        if check_near(bodies, pairs, counts, grid, parts, k, normal):
            k += 1
        k = next_due(bodies.displacement, first, second, limit, k, counts[st.N_NEAR])


@inlined
def listed(counter, grid, counts):
    """Count the entries of the bodies whose neighbours are found anew; a pair of two such bodies counts twice."""
    n = 0
    for m in range(counts[st.N_MOVED]):
        n += counter[grid.moved_list[m]]
    return n


@kernel
def drop_near_of_moved(pairs, counts, grid):
    """Drop the near pairs of bodies whose neighbours are found anew; the youngest pairs first."""
    moved = grid.moved
    left = listed(grid.near, grid, counts)
    k = counts[st.N_NEAR] - 1
    while left > 0:
        u = np.uint64(k)
        both = moved[pairs.near_first[u]] + moved[pairs.near_second[u]]
        if both > 0:
            left -= both
            drop_near(pairs, counts, grid, k)
        k -= 1


@inlined
def chain_partner(pairs, grid, used, i, j):
    """Chain j to the partners of i where the neighbours of i are found anew; returns the number of links used."""
    if grid.moved[i]:
        pairs.partner[used] = j
        pairs.link[used] = grid.chain[i]
        grid.chain[i] = used
        used += 1
    return used


@kernel
def chain_contacts(pairs, counts, grid):
    """Chain the touching partners of each body whose neighbours are found anew."""
    left = listed(grid.touching, grid, counts)
    used = 0
    k = counts[st.N_PAIRS] - 1
    while used < left:
        i, j = pairs.first[np.uint64(k)], pairs.second[np.uint64(k)]
        used = chain_partner(pairs, grid, used, i, j)
        used = chain_partner(pairs, grid, used, j, i)
        k -= 1


@inlined
def bounding_radius(bodies, i):
    """Largest distance of a point of body i from its centre."""
    return bodies.motion[i // L, st.RADIUS + i % L]


@inlined
def list_pair(bodies, pairs, counts, grid, parts, a, b, normal):
    """List a pair anew: as touching, as near with its gap, or not at all where the gap is a skin or more."""
    rows = bodies.rows
    skin = grid.lengths[st.SKIN]
    dx, dy, dz = (
        rows[b, 0] - rows[a, 0],
        rows[b, 1] - rows[a, 1],
        rows[b, 2] - rows[a, 2],
    )
    square = dx * dx + dy * dy + dz * dz
    reach = bounding_radius(bodies, a) + bounding_radius(bodies, b) + skin
    if square >= reach * reach:
        return
    distance = math.sqrt(square)
    normal[0], normal[1], normal[2] = dx / distance, dy / distance, dz / distance
    gap = solve_gap(rows, parts, a, b, normal, TOLERANCE, EARLY * skin)
    if gap <= 0.0:
        add_contact(pairs, counts, grid, a, b, normal)
    elif gap < skin:
        total = bodies.displacement[a] + bodies.displacement[b]
        add_near(
            pairs, counts, grid, a, b, total + gap, normal[0], normal[1], normal[2]
        )


@kernel
def retire_pairs(bodies, pairs, counts, grid, begin, ended, ghost):
    """Move the pairs that parted to the list of near pairs, the last first."""
    for e in range(begin + ended - 1, begin - 1, -1):
        k = pairs.ended[e]
        i, j = pairs.first[k], pairs.second[k]
        limit = bodies.displacement[i] + bodies.displacement[j] + pairs.gap[k]
        nx, ny, nz = lane_vector(pairs.data[k // L], st.NORMAL, k % L)
        add_near(pairs, counts, grid, i, j, limit, nx, ny, nz)
        drop_contact(pairs, counts, grid, k, ghost)
