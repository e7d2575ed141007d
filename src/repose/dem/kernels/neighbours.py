"""The neighbour (Verlet) list: the pairs of bodies that touch or are near each other.

Every body has a displacement: the sum over all steps of how far any of its points may
have moved. A near pair has a limit: the gap at its last check plus both displacements at
that time. As long as the sum of the displacements is below the limit, the bodies cannot
touch and are not checked.

A pair with a gap of a skin or more is not listed. The pairs of a body are listed anew
when it has moved by half a skin since the last listing (it is then in `Grid.moved_list`).
So two bodies of an unlisted pair together move by less than the skin before the pairs of
one of them are listed anew.

Reads `Bodies.rows` and `Bodies.displacement`. Writes all arrays of `Grid`, the lists of
`Pairs`, `counts`, and the row RELIST of `Bodies.motion`. `renewal` calls most of this.
"""

import math

import numpy as np

from . import state as st
from .contact import solve_gap
from .jit import inlined, kernel
from .lists import move_contact, put_contact
from .rows import LANES, lane_vector, set_vector, vector_at
from .state import POSITION, bounding_radius

# A proven gap above this share of the skin is good enough; below it the true gap is
# found.
EARLY = 0.25
TOLERANCE = 1e-4  # step at which the solver of a gap stops [rad]


@inlined
def cell_of(grid, x, y, z):
    """Return the cell of a point; the cells repeat in space (see `state.new_grid`)."""
    edge = grid.lengths[st.CELL]
    i = math.floor((x - grid.origin[0]) / edge)
    j = math.floor((y - grid.origin[1]) / edge)
    k = math.floor((z - grid.origin[2]) / edge)
    i, j, k = i % grid.shape[0], j % grid.shape[1], k % grid.shape[2]
    return (i * grid.shape[1] + j) * grid.shape[2] + k


@kernel
def unlink(grid, i):
    """Take body i out of the list of its cell.

    The bodies of a cell are a list that is linked in both directions: `grid.head` has the
    first body of a cell, `grid.preceding` and `grid.following` have the neighbours of a
    body in the list. -1 stands for none.
    """
    cell = grid.cell[i]
    if cell < 0:
        return
    previous = grid.preceding[i]
    following = grid.following[i]
    if previous >= 0:
        grid.following[previous] = following
    else:
        grid.head[cell] = following
    if following >= 0:
        grid.preceding[following] = previous
    grid.cell[i] = -1


@inlined
def put_in_cell(grid, i, cell):
    """Put body i, which is in no cell, at the head of a cell's list."""
    grid.cell[i] = cell
    grid.preceding[i] = -1
    grid.following[i] = grid.head[cell]
    if grid.head[cell] >= 0:
        grid.preceding[grid.head[cell]] = i
    grid.head[cell] = i


@kernel
def link(grid, bodies, i):
    """Put body i into the cell of its position.

    Also writes the displacement at which its neighbours are found anew.
    """
    x, y, z = vector_at(bodies.rows[i], POSITION)
    cell = cell_of(grid, x, y, z)
    bodies.motion[i // LANES, st.RELIST + i % LANES] = (
        bodies.displacement[i] + 0.5 * grid.lengths[st.SKIN]
    )
    put_in_cell(grid, i, cell)


@inlined
def mark_moved(grid, counts, i):
    """Add body i to the bodies whose neighbours are found anew at the next step."""
    if grid.moved[i] == 0:
        grid.moved[i] = 1
        grid.moved_list[counts[st.N_MOVED]] = i
        counts[st.N_MOVED] += 1


@inlined
def count_pair(counter, i, j, change):
    """Add `change` (1 or -1) to the numbers of pairs of two bodies."""
    counter[i] += change
    counter[j] += change


@inlined
def write_pair(first, second, k, i, j):
    """Write two bodies to place k of a list."""
    first[k] = i
    second[k] = j


@inlined
def take_place(counts, slot, room):
    """Take the next place of a list and return it, or -1 where there is no room.

    `slot` is the place of the list's length in `counts`, `room` the length of its arrays.
    """
    k = counts[slot]
    if k >= room:
        counts[st.FULL] = 1
        return -1
    counts[slot] = k + 1
    return k


@inlined
def drop_near(pairs, counts, grid, k):
    """Remove near pair k from the list: the last pair moves to its place.

    `counts[N_NEAR]` is the length of the list, `grid.near` the number of near pairs of
    each body.
    """
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
    pairs.near_check[k // st.BLOCK] = 0.0  # check this block of the list next time
    for axis in range(3):
        pairs.near_normal[k, axis] = pairs.near_normal[last, axis]


@inlined
def add_near(pairs, counts, grid, i, j, limit, nx, ny, nz):
    """Append a near pair (i, j) with its limit [m] and the normal n of its last check.

    The pair is due when the displacements of i and j add up to the limit. Where the list
    is full, nothing is added, and `counts[FULL]` is set.
    """
    k = take_place(counts, st.N_NEAR, pairs.near_limit.shape[0])
    if k < 0:
        return
    count_pair(grid.near, i, j, 1)
    write_pair(pairs.near_first, pairs.near_second, k, i, j)
    pairs.near_limit[k] = limit
    pairs.near_check[k // st.BLOCK] = 0.0
    set_vector(pairs.near_normal[k], 0, nx, ny, nz)


@inlined
def add_contact(pairs, counts, grid, i, j, normal):
    """Append a touching pair with a relaxed spring; `normal` points from i to j."""
    k = take_place(counts, st.N_PAIRS, pairs.first.shape[0])
    if k < 0:
        return
    count_pair(grid.touching, i, j, 1)
    write_pair(pairs.first, pairs.second, k, i, j)
    put_contact(pairs.data, k, normal[0], normal[1], normal[2])


@inlined
def drop_contact(pairs, counts, grid, k, ghost):
    """Remove touching pair k: the last pair moves to its place.

    The place that becomes free holds two ghosts.
    """
    last = counts[st.N_PAIRS] - 1
    counts[st.N_PAIRS] = last
    count_pair(grid.touching, pairs.first[k], pairs.second[k], -1)
    write_pair(pairs.first, pairs.second, k, pairs.first[last], pairs.second[last])
    move_contact(pairs.data, last, k)
    write_pair(pairs.first, pairs.second, last, ghost, ghost)


@inlined
def near_gap(bodies, pairs, grid, parts, k, normal):
    """Return the gap of near pair k [m], solved from its last normal.

    The new normal is written to the pair and to `normal` (3,). `parts` is the number of
    ellipsoids of a body, or SPHERES.
    """
    for axis in range(3):
        normal[axis] = pairs.near_normal[k, axis]
    # above this gap the solver may stop early: the bodies are far enough apart
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
    for axis in range(3):
        pairs.near_normal[k, axis] = normal[axis]
    return gap


@inlined
def check_near(bodies, pairs, counts, grid, parts, k, normal):
    """Solve for the gap of near pair k: make it a contact, or give it a new limit.

    `normal` (3,) is scratch. Returns whether the pair stays in the list of near pairs.
    """
    i = pairs.near_first[k]
    j = pairs.near_second[k]
    gap = near_gap(bodies, pairs, grid, parts, k, normal)
    if gap <= 0.0:
        drop_near(pairs, counts, grid, k)
        add_contact(pairs, counts, grid, i, j, normal)
        return False
    pairs.near_limit[k] = bodies.displacement[i] + bodies.displacement[j] + gap
    return True


@kernel
def next_due(displacement, first, second, limit, begin, end):
    """Return the first pair of begin to end that is due, or `end`.

    A pair is due when the displacements of its bodies have reached its limit. The
    indices are unsigned: for signed ones numba checks for negative numbers, which would
    double the time.
    """
    for k in range(begin, end):
        u = np.uint64(k)
        if displacement[first[u]] + displacement[second[u]] >= limit[u]:
            return k
    return end


@kernel
def update_near(bodies, pairs, counts, grid, parts, normal):
    """Check the near pairs that are due.

    Parameters
    ----------
    bodies, pairs, grid : namedtuple
        The bodies, the lists of pairs, and the grid of the neighbour search.
    counts : array
        Lengths of all lists.
    parts : int
        Ellipsoids of a body, or SPHERES.
    normal : array (3,)
        Is overwritten.
    """
    first = pairs.near_first
    second = pairs.near_second
    limit = pairs.near_limit
    k = next_due(bodies.displacement, first, second, limit, 0, counts[st.N_NEAR])
    while k < counts[st.N_NEAR]:
        # where the pair leaves the list, another one is at its place now
        if check_near(bodies, pairs, counts, grid, parts, k, normal):
            k += 1
        k = next_due(bodies.displacement, first, second, limit, k, counts[st.N_NEAR])


@inlined
def pairs_of_moved(counter, grid, counts):
    """Return the number of pairs of the bodies of `Grid.moved_list`.

    `counter` has the number of pairs of each body. A pair of two such bodies counts
    twice.
    """
    n = 0
    for m in range(counts[st.N_MOVED]):
        n += counter[grid.moved_list[m]]
    return n


@kernel
def drop_near_of_moved(pairs, counts, grid):
    """Drop the near pairs of the bodies of `Grid.moved_list`.

    The youngest pairs come first; the loop ends when all pairs of these bodies are found.
    """
    moved = grid.moved  # of each body whether it is in `Grid.moved_list`
    n_left = pairs_of_moved(grid.near, grid, counts)
    k = counts[st.N_NEAR] - 1
    while n_left > 0:
        u = np.uint64(k)  # unsigned, see `next_due`
        # a pair of two such bodies counts twice
        n_moved = moved[pairs.near_first[u]] + moved[pairs.near_second[u]]
        if n_moved > 0:
            n_left -= n_moved
            drop_near(pairs, counts, grid, k)
        k -= 1


@inlined
def chain_partner(pairs, grid, n_used, i, j):
    """Add body j to the chain of partners of body i, if i is in `Grid.moved_list`.

    Returns the number of links that are used then; `n_used` is that number before.
    """
    if grid.moved[i]:
        pairs.partner[n_used] = j
        pairs.link[n_used] = grid.chain[i]
        grid.chain[i] = n_used
        n_used += 1
    return n_used


@kernel
def chain_contacts(pairs, counts, grid):
    """Chain the touching partners of each body of `Grid.moved_list`.

    Link number m holds a partner, `pairs.partner[m]`, and the next link of the same
    body, `pairs.link[m]`; `grid.chain` has the first link of each body.
    """
    n_links = pairs_of_moved(grid.touching, grid, counts)
    n_used = 0
    # from the last pair back until all links are made
    k = counts[st.N_PAIRS] - 1
    while n_used < n_links:
        i = pairs.first[np.uint64(k)]
        j = pairs.second[np.uint64(k)]
        n_used = chain_partner(pairs, grid, n_used, i, j)
        n_used = chain_partner(pairs, grid, n_used, j, i)
        k -= 1


@inlined
def list_pair(bodies, pairs, counts, grid, parts, a, b, normal):
    """List a pair of bodies a and b anew: as touching, as near, or not at all.

    It is not listed where the gap is a skin or more. `parts` is the number of ellipsoids
    of a body, or SPHERES; `normal` (3,) is scratch.
    """
    rows = bodies.rows
    skin = grid.lengths[st.SKIN]
    # Compare the bounding spheres first.
    ax, ay, az = vector_at(rows[a], POSITION)
    bx, by, bz = vector_at(rows[b], POSITION)
    dx, dy, dz = bx - ax, by - ay, bz - az
    square = dx * dx + dy * dy + dz * dz
    reach = bounding_radius(bodies, a) + bounding_radius(bodies, b) + skin
    if square >= reach * reach:
        return
    # The search for the normal begins with the direction of the centres.
    distance = math.sqrt(square)
    set_vector(normal, 0, dx / distance, dy / distance, dz / distance)
    gap = solve_gap(rows, parts, a, b, normal, TOLERANCE, EARLY * skin)
    if gap <= 0.0:
        add_contact(pairs, counts, grid, a, b, normal)
    elif gap < skin:
        limit = bodies.displacement[a] + bodies.displacement[b] + gap
        nx, ny, nz = vector_at(normal, 0)
        add_near(pairs, counts, grid, a, b, limit, nx, ny, nz)


@kernel
def retire_pairs(bodies, pairs, counts, grid, begin, n_ended, ghost):
    """Move the pairs that parted to the list of near pairs.

    `pairs.ended` holds n_ended places of contacts, from place `begin` on, in increasing
    order. The last one is dropped first: it is replaced by the last contact of the list,
    so the places that are still to come stay valid.
    """
    for e in range(begin + n_ended - 1, begin - 1, -1):
        k = pairs.ended[e]
        i = pairs.first[k]
        j = pairs.second[k]
        # they may touch again once both displacements have used up the gap
        limit = bodies.displacement[i] + bodies.displacement[j] + pairs.gap[k]
        nx, ny, nz = lane_vector(pairs.data[k // LANES], st.NORMAL, k % LANES)
        add_near(pairs, counts, grid, i, j, limit, nx, ny, nz)
        drop_contact(pairs, counts, grid, k, ghost)
