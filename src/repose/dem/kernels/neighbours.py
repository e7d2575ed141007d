"""The neighbour (Verlet) list: the pairs of bodies that touch or are near each other.

Every body has a displacement, which is the sum over all steps of how far any of its
points may have moved. A near pair has a limit, which is the gap at its last check plus
both displacements at that time. As long as the sum of the displacements is below the
limit, the bodies cannot touch, and the pair is not checked.

A pair is listed only if its gap is below the skin. The pairs of a body are listed again
when it has moved by half a skin since the last listing, and is therefore in
`Grid.moved_list`. Thus, the two bodies of an unlisted pair together move by less than
the skin before the pairs of one of them are listed again.

Reads `Bodies.rows` and `Bodies.displacement`. Writes all arrays of `Grid`, the lists of
`Pairs`, `counts`, and the row RENEWAL of `Bodies.motion`. `renewal` calls most of this.
"""

import math

import numpy as np

from . import state
from .contact import solve_gap
from .jit import inlined, kernel
from .lists import move_contact, put_contact
from .rows import LANES, lane_vector, set_vector, vector_at
from .state import POSITION, bounding_radius

# The solver for a gap stops early if the gap is certainly above this fraction of the
# skin.
SUFFICIENT_GAP_SHARE = 0.25
NORMAL_TOLERANCE = 1e-4  # step below which the solver for a gap stops [rad]


@inlined
def find_cell(grid, x, y, z):
    """Return the index of the cell that contains a point of the world.

    The cells repeat in space like the tiles of a floor (see `state.new_grid`).

    Parameters
    ----------
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    x, y, z : float
        The point [m].
    """
    edge = grid.lengths[state.CELL]
    cell_x = math.floor((x - grid.origin[0]) / edge)
    cell_y = math.floor((y - grid.origin[1]) / edge)
    cell_z = math.floor((z - grid.origin[2]) / edge)
    # A point outside the grid belongs to a cell of the repeated grid.
    cell_x, cell_y, cell_z = (
        cell_x % grid.shape[0],
        cell_y % grid.shape[1],
        cell_z % grid.shape[2],
    )
    return (cell_x * grid.shape[1] + cell_y) * grid.shape[2] + cell_z


@kernel
def remove_from_cell(grid, i):
    """Remove body i from the list of its cell, if it is in one.

    The bodies of a cell form a doubly linked list. `grid.head` has the first body of
    each cell, and `grid.preceding` and `grid.following` have the neighbours of each
    body in the list. A value of -1 means that there is none.

    Parameters
    ----------
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    i : int
        Index of the body.
    """
    cell = grid.cell[i]
    if cell < 0:
        return
    previous = grid.preceding[i]
    following = grid.following[i]
    # The body before it, or the head of the list, now points to the body after it. The
    # links of body i itself stay as they are; `add_to_cell` overwrites them.
    if previous >= 0:
        grid.following[previous] = following
    else:
        grid.head[cell] = following
    if following >= 0:
        grid.preceding[following] = previous
    grid.cell[i] = -1


@inlined
def insert_into_cell(grid, i, cell):
    """Insert body i at the head of the linked list of a cell, see `remove_from_cell`.

    Parameters
    ----------
    grid : Grid
        Cells of the neighbour search. `grid.cell` of the body and the linked list are
        changed.
    i : int
        Index of the body, which is in no cell.
    cell : int
        Index of the cell.
    """
    grid.cell[i] = cell
    grid.preceding[i] = -1
    grid.following[i] = grid.head[cell]
    if grid.head[cell] >= 0:
        grid.preceding[grid.head[cell]] = i
    grid.head[cell] = i


@kernel
def add_to_cell(grid, bodies, i):
    """Insert body i, which is in no cell, into the cell of its position.

    Also write to the row RENEWAL of `Bodies.motion` the displacement at which its
    neighbours must be found again, which is half a skin more than now.

    Parameters
    ----------
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    i : int
        Index of the body.
    """
    x, y, z = vector_at(bodies.rows[i], POSITION)
    cell = find_cell(grid, x, y, z)
    bodies.motion[i // LANES, state.RENEWAL + i % LANES] = (
        bodies.displacement[i] + 0.5 * grid.lengths[state.SKIN]
    )
    insert_into_cell(grid, i, cell)


@inlined
def mark_moved(grid, counts, i):
    """Add body i to the bodies whose neighbours are found again in the next step.

    `grid.moved` is 1 for the bodies in this list, so that each of them is listed only
    once.

    Parameters
    ----------
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    i : int
        Index of the body.
    """
    if grid.moved[i] == 0:
        grid.moved[i] = 1
        grid.moved_list[counts[state.N_MOVED]] = i
        counts[state.N_MOVED] += 1


@inlined
def change_pair_counts(pair_counts, i, j, change):
    """Change the number of pairs of each of two bodies by 1 or -1.

    Parameters
    ----------
    pair_counts : array of int (bodies,)
        Number of pairs of each body: `Grid.touching` or `Grid.near`.
    i, j : int
        The two bodies of a pair.
    change : int
        1 for a new pair, -1 for a removed one.
    """
    pair_counts[i] += change
    pair_counts[j] += change


@inlined
def write_pair(first, second, k, i, j):
    """Write bodies i and j as pair k of a list with the arrays `first` and `second`."""
    first[k] = i
    second[k] = j


@inlined
def reserve_place(counts, length_index, capacity):
    """Reserve the next element of a list; return its index, or -1 if the list is full.

    If the list is full, `counts[FULL]` is set, and Python lengthens the list.

    Parameters
    ----------
    counts : array of int
        Length of each list; that of this list grows by 1.
    length_index : int
        Index in `counts` of this list's length, such as state.N_PAIRS.
    capacity : int
        Length of the list's arrays.
    """
    k = counts[length_index]
    if k >= capacity:
        counts[state.FULL] = 1
        return -1
    counts[length_index] = k + 1
    return k


@inlined
def drop_near_pair(pairs, counts, grid, k):
    """Remove near pair k from the list and move the last pair to its index.

    A near pair is a pair of bodies that do not touch and whose gap was below the skin
    at the last search. All arrays of the near pairs must be moved together.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    k : int
        Index of the pair in the list of near pairs.
    """
    last = counts[state.N_NEAR] - 1
    counts[state.N_NEAR] = last
    # Both bodies have one near pair fewer. This reads the pair, so it comes before the
    # pair is overwritten.
    change_pair_counts(grid.near, pairs.near_first[k], pairs.near_second[k], -1)
    # The last pair of the list moves to index k.
    write_pair(
        pairs.near_first,
        pairs.near_second,
        k,
        pairs.near_first[last],
        pairs.near_second[last],
    )
    pairs.near_limit[k] = pairs.near_limit[last]
    # Zero is `parallel.CHANGED`: the pairs of this block of the list have changed, so
    # that the next step must check it.
    pairs.near_check[k // state.BLOCK] = 0.0
    for axis in range(3):
        pairs.near_normal[k, axis] = pairs.near_normal[last, axis]


@inlined
def add_near_pair(pairs, counts, grid, i, j, limit, nx, ny, nz):
    """Append the pair (i, j) to the list of near pairs.

    The displacement of a body is an upper bound of the path of any of its points until
    now. The pair is due for a check when the displacements of i and j add up to
    `limit`. If the list is full, the function adds nothing and sets `counts[FULL]`.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    i, j : int
        Indices of the two bodies.
    limit : float
        Sum of both displacements at which the pair is checked [m].
    nx, ny, nz : float
        Unit normal of the last check, from which the next one starts.
    """
    k = reserve_place(counts, state.N_NEAR, pairs.near_limit.shape[0])
    if k < 0:
        return
    # Both bodies have one near pair more.
    change_pair_counts(grid.near, i, j, 1)
    write_pair(pairs.near_first, pairs.near_second, k, i, j)
    pairs.near_limit[k] = limit
    # Zero is `parallel.CHANGED`: the pairs of this block of the list have changed.
    pairs.near_check[k // state.BLOCK] = 0.0
    set_vector(pairs.near_normal[k], 0, nx, ny, nz)


@inlined
def add_contact(pairs, counts, grid, i, j, normal):
    """Append a touching pair (i, j) with a relaxed spring.

    If the list is full, the function adds nothing and sets `counts[FULL]`.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    i, j : int
        Indices of the two bodies.
    normal : array (3,)
        Unit normal from i to j.
    """
    k = reserve_place(counts, state.N_PAIRS, pairs.first.shape[0])
    if k < 0:
        return
    change_pair_counts(grid.touching, i, j, 1)
    write_pair(pairs.first, pairs.second, k, i, j)
    put_contact(pairs.data, k, normal[0], normal[1], normal[2])


@inlined
def drop_contact(pairs, counts, grid, k, ghost):
    """Remove touching pair k from the list and move the last pair to its index.

    The element that becomes free gets the ghost as both of its bodies, so that whole
    tiles can be computed: no force moves this body without mass.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    k : int
        Index of the pair in the list of touching pairs.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    last = counts[state.N_PAIRS] - 1
    counts[state.N_PAIRS] = last
    change_pair_counts(grid.touching, pairs.first[k], pairs.second[k], -1)
    # The last contact of the list moves to index k, and ghosts take its place.
    write_pair(pairs.first, pairs.second, k, pairs.first[last], pairs.second[last])
    move_contact(pairs.data, last, k)
    write_pair(pairs.first, pairs.second, last, ghost, ghost)


@inlined
def solve_near_gap(bodies, pairs, grid, parts, k, normal):
    """Compute the gap of near pair k [m], starting from its last normal.

    The new normal is written to `normal`, and stored with the pair for the next check.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    k : int
        Index of the pair in the list of near pairs.
    normal : array (3,)
        Working memory for a unit normal; it is overwritten.
    """
    for axis in range(3):
        normal[axis] = pairs.near_normal[k, axis]
    # The solver may stop early when the gap exceeds this fraction of the skin, the
    # largest gap of a near pair: the bodies are far enough apart.
    sufficient_gap = SUFFICIENT_GAP_SHARE * grid.lengths[state.SKIN]
    # The solver reads the last normal in `normal`, and overwrites it with the new one.
    gap = solve_gap(
        bodies.rows,
        parts,
        pairs.near_first[k],
        pairs.near_second[k],
        normal,
        NORMAL_TOLERANCE,
        sufficient_gap,
    )
    for axis in range(3):
        pairs.near_normal[k, axis] = normal[axis]
    return gap


@inlined
def check_near_pair(bodies, pairs, counts, grid, parts, k, normal):
    """Compute the gap of near pair k, and make it a contact or give it a new limit.

    The limit of a pair is the sum of the displacements of its two bodies at which it is
    checked again. If the bodies touch, the function changes both lists of pairs and
    `counts`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    k : int
        Index of the pair in the list of near pairs.
    normal : array (3,)
        Working memory for a unit normal; it is overwritten.

    Returns
    -------
    bool
        Whether the pair stays in the list of near pairs. If not, another pair now has
        the index k.
    """
    i = pairs.near_first[k]
    j = pairs.near_second[k]
    gap = solve_near_gap(bodies, pairs, grid, parts, k, normal)
    # The bodies touch, so the pair moves to the list of contacts. The last near pair
    # takes its place.
    if gap <= 0.0:
        drop_near_pair(pairs, counts, grid, k)
        add_contact(pairs, counts, grid, i, j, normal)
        return False
    # The bodies cannot touch before they have together moved by the gap.
    pairs.near_limit[k] = bodies.displacement[i] + bodies.displacement[j] + gap
    return True


@kernel
def find_next_due(displacement, first, second, limit, begin, end):
    """Find the first near pair of a range that is due for a check.

    A pair is due when the displacements of its two bodies have reached its limit, a sum
    at which the bodies may touch.

    Parameters
    ----------
    displacement : array (bodies,)
        How far any point of each body may have moved until now [m].
    first, second : array of int (pairs,)
        The two bodies of each pair.
    limit : array (pairs,)
        Sum of the displacements of both bodies at which the pair is due [m].
    begin, end : int
        First pair of the range, and its end.

    Returns
    -------
    int
        Index of the pair, or `end` if none is due.
    """
    for k in range(begin, end):
        # The index is unsigned. Numba would check a signed one for negative values,
        # which takes twice as long.
        pair = np.uint64(k)
        if displacement[first[pair]] + displacement[second[pair]] >= limit[pair]:
            return k
    return end


@kernel
def update_near_pairs(bodies, pairs, counts, grid, parts, normal):
    """Check all near pairs of smooth bodies that are due.

    A pair is due when the displacements of its two bodies have reached its limit, a sum
    at which they may touch. Pairs that touch become contacts, and the others get new
    limits. The list changes during the loop, so its length is read again in each round.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    normal : array (3,)
        Working memory for a unit normal; it is overwritten.
    """
    first = pairs.near_first
    second = pairs.near_second
    limit = pairs.near_limit
    k = find_next_due(
        bodies.displacement, first, second, limit, 0, counts[state.N_NEAR]
    )
    while k < counts[state.N_NEAR]:
        # Go to the next pair, unless the pair has left the list. In this case the last
        # pair now has the index k, and must be checked, too.
        if check_near_pair(bodies, pairs, counts, grid, parts, k, normal):
            k += 1
        k = find_next_due(
            bodies.displacement, first, second, limit, k, counts[state.N_NEAR]
        )


@inlined
def count_pairs_of_moved(pair_counts, grid, counts):
    """Return the number of pairs of the bodies in `Grid.moved_list`.

    A pair of two such bodies counts twice.

    Parameters
    ----------
    pair_counts : array of int (bodies,)
        Number of pairs of each body: `Grid.touching` or `Grid.near`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    """
    n_pairs = 0
    for index in range(counts[state.N_MOVED]):
        n_pairs += pair_counts[grid.moved_list[index]]
    return n_pairs


@kernel
def drop_near_pairs_of_moved(pairs, counts, grid):
    """Remove the near pairs of the bodies in `Grid.moved_list`.

    The loop runs backwards from the end of the list, where the newest pairs are, and
    ends when all pairs of these bodies have been removed. A removed pair is replaced by
    the last one, which the loop has already visited, so no pair is missed.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    """
    is_moved = grid.moved  # 1 for each body in `Grid.moved_list`, otherwise 0
    n_remaining = count_pairs_of_moved(grid.near, grid, counts)
    k = counts[state.N_NEAR] - 1
    while n_remaining > 0:
        pair = np.uint64(k)  # unsigned, see `find_next_due`
        # A pair of two such bodies counts twice, as in `count_pairs_of_moved`.
        n_moved = is_moved[pairs.near_first[pair]] + is_moved[pairs.near_second[pair]]
        if n_moved > 0:
            n_remaining -= n_moved
            drop_near_pair(pairs, counts, grid, k)
        k -= 1


@inlined
def chain_partner(pairs, grid, n_used, i, j):
    """Add body j to the chain of partners of body i, if i is in `Grid.moved_list`.

    A chain is a linked list. Link m consists of a partner, `pairs.partner[m]`, and the
    next link of the same body, `pairs.link[m]`. `grid.chain[i]` is the first link of
    body i.

    Parameters
    ----------
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    n_used : int
        Number of links in use, which is the index of the next link.
    i, j : int
        The two bodies of a pair.

    Returns
    -------
    int
        Number of links in use afterwards.
    """
    if grid.moved[i]:
        pairs.partner[n_used] = j
        pairs.link[n_used] = grid.chain[i]
        grid.chain[i] = n_used
        n_used += 1
    return n_used


@kernel
def chain_contacts(pairs, counts, grid):
    """List the bodies that each body in `Grid.moved_list` touches.

    The list of a body is a linked list, called a chain, see `chain_partner`. With it,
    the search for near pairs of a body can skip the bodies that it touches. The chains
    must be empty before the call.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    """
    # `n_used` is the number of links made so far, and the index of the next one.
    n_links = count_pairs_of_moved(grid.touching, grid, counts)
    n_used = 0
    # Go back from the last pair until all links have been made. `chain_partner` makes
    # as many links as `count_pairs_of_moved` has counted, so k never becomes negative.
    # The index is unsigned, see `find_next_due`.
    k = counts[state.N_PAIRS] - 1
    while n_used < n_links:
        # Add a link for each of i and j that is in the list of moved bodies.
        i = pairs.first[np.uint64(k)]
        j = pairs.second[np.uint64(k)]
        n_used = chain_partner(pairs, grid, n_used, i, j)
        n_used = chain_partner(pairs, grid, n_used, j, i)
        k -= 1


@inlined
def add_smooth_pair_if_near(bodies, pairs, counts, grid, parts, i, j, normal):
    """Add a pair of smooth bodies to the list of touching or near pairs.

    A pair is added only if its gap is below the skin, the largest gap of a near pair. A
    smooth body is a sphere or a sum of ellipsoids, not a clump. `normal` is overwritten
    with the contact normal.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    i, j : int
        The two bodies; the pair must not be listed yet.
    normal : array (3,)
        Working memory for a unit normal; it is overwritten.
    """
    rows = bodies.rows
    skin = grid.lengths[state.SKIN]
    # Compare the bounding spheres first.
    x_i, y_i, z_i = vector_at(rows[i], POSITION)
    x_j, y_j, z_j = vector_at(rows[j], POSITION)
    dx, dy, dz = x_j - x_i, y_j - y_i, z_j - z_i
    squared_distance = dx * dx + dy * dy + dz * dz
    reach = bounding_radius(bodies, i) + bounding_radius(bodies, j) + skin
    if squared_distance >= reach * reach:
        return
    # The solver starts from the direction between the centres, in `normal`, and
    # overwrites it with the contact normal. The centres must not coincide.
    distance = math.sqrt(squared_distance)
    set_vector(normal, 0, dx / distance, dy / distance, dz / distance)
    gap = solve_gap(
        rows, parts, i, j, normal, NORMAL_TOLERANCE, SUFFICIENT_GAP_SHARE * skin
    )
    # The pair may touch, be near, or be too far apart to be listed.
    if gap <= 0.0:
        add_contact(pairs, counts, grid, i, j, normal)
    elif gap < skin:
        # The bodies cannot touch before they have together moved by the gap from now
        # on.
        limit = bodies.displacement[i] + bodies.displacement[j] + gap
        nx, ny, nz = vector_at(normal, 0)
        add_near_pair(pairs, counts, grid, i, j, limit, nx, ny, nz)


@kernel
def retire_pairs(bodies, pairs, counts, grid, begin, n_ended, ghost):
    """Move the pairs that have parted from the touching to the near pairs.

    Touching pair k is lane k % LANES of the tile k // LANES. The loop begins with the
    last of the pairs that have parted. The last touching pair of the list replaces each
    removed one, so in this order the remaining indices stay valid.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    begin, n_ended : int
        The indices of these pairs in the list of touching pairs are
        `pairs.ended[begin : begin + n_ended]`, in increasing order. `pairs.gap` has
        their gaps.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    for index in range(begin + n_ended - 1, begin - 1, -1):
        k = pairs.ended[index]
        i = pairs.first[k]
        j = pairs.second[k]
        # The bodies cannot touch again before they have together moved by the gap.
        limit = bodies.displacement[i] + bodies.displacement[j] + pairs.gap[k]
        nx, ny, nz = lane_vector(pairs.data[k // LANES], state.NORMAL, k % LANES)
        add_near_pair(pairs, counts, grid, i, j, limit, nx, ny, nz)
        drop_contact(pairs, counts, grid, k, ghost)
