"""Run a large simulation on several threads, with the same result for any number.

The work of a step is divided into SHARES shares, whatever the number of threads. Each
share of the contacts has loads of its own, and these are added up in a fixed order.
Therefore the result is the same, bit for bit, for any number of threads.

Every thread runs `advance_shared`. A barrier (`atomics`) separates the phases of a time
step. Shares that write to different memory are distributed over the threads. Only the
first thread changes the lists of pairs, while the others wait.

Near pairs are handled in blocks of `state.BLOCK`. A block whose bodies are nearly at
rest is skipped as long as none of its pairs can be due. To decide this, bodies that are
neighbours in memory form groups, whose paths are recorded in `Grid.paths`.

Reads and writes most arrays of a simulation (see `state`), and `Shared`.
"""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from . import state
from .atomics import wait_for_all
from .engine import begin_step, has_room, process_wall_contacts
from .forces import add_pair_forces
from .jit import inlined, kernel, kernel_without_gil
from .neighbours import (
    add_contact,
    drop_near_pair,
    find_next_due,
    retire_pairs,
    solve_near_gap,
)
from .renewal import renew_pairs
from .rigid import handle_events, integrate
from .rows import LANES

SHARES = 8
# Smaller simulations have a single share, because threads would not make them faster.
FEWEST_BODIES = 4096
REORDER_EVERY = 1000  # steps after which bodies get new indices (see `order`)
# Whole blocks of pairs can be skipped if the paths in one step are below this fraction
# of the skin.
CALM_SHARE = 1e-3
# Values that `Pairs.near_check` may have instead of a path: the pairs of the block have
# changed, or the block is checked in the next step.
CHANGED, DUE = 0.0, -1.0
ALL_STEPS, LAST_STEP = 0, 1  # rows of `Grid.paths`: sum of all steps, last step
STOP = 0  # index in `Shared.flags` of the flag that ends the run


@inlined
def share_range(n_items, share, group_size):
    """Return the first item of a share of all items, and the end of the share.

    Parameters
    ----------
    n_items : int
        Number of items.
    share : int
        Index of the share, 0 to SHARES - 1.
    group_size : int
        A share consists of whole groups of this many items. The last group may be
        smaller.
    """
    n_groups = (n_items + group_size - 1) // group_size
    begin = n_groups * share // SHARES * group_size
    end = n_groups * (share + 1) // SHARES * group_size
    return begin, min(end, n_items)


@kernel
def smallest_slack(displacement, first, second, limit, begin, end):
    """Return how far the bodies of a range of pairs may move before a pair is due [m].

    The slack of a pair is its limit minus the displacements of its two bodies until
    now. The smallest slack of the range is returned.

    Parameters
    ----------
    displacement : array (bodies,)
        How far each body may have moved until now [m].
    first, second : array (pairs,)
        The two bodies of each pair.
    limit : array (pairs,)
        Sum of the displacements of both bodies at which the pair is due [m].
    begin, end : int
        First pair of the range, and its end.
    """
    smallest = math.inf
    for k in range(begin, end):
        # The index is unsigned, see `neighbours.find_next_due`.
        pair = np.uint64(k)
        path = displacement[first[pair]] + displacement[second[pair]]
        smallest = min(smallest, limit[pair] - path)
    return smallest


@inlined
def group_shift(bodies):
    """Return the bit shift that turns the index of a body into that of its group.

    A group has 2^shift bodies, which are whole tiles. There are at most
    state.MOST_GROUPS groups, so the bits of one number can represent a set of groups.
    """
    shift = 5  # one tile of 32 bodies
    while bodies.displacement.shape[0] >> shift >= state.MOST_GROUPS:
        shift += 1
    return shift


@kernel
def find_groups(first, second, begin, end, shift):
    """Return the groups of all bodies in a range of pairs, as bits of a number.

    Bit g is set if one of the bodies belongs to group g.

    Parameters
    ----------
    first, second : array of int (pairs,)
        The two bodies of each pair.
    begin, end : int
        First pair of the range, and its end.
    shift : int
        The bit shift from a body's index to that of its group, see `group_shift`.
    """
    groups = 0
    for k in range(begin, end):
        pair = np.uint64(k)
        groups |= 1 << (np.int64(first[pair]) >> shift)
        groups |= 1 << (np.int64(second[pair]) >> shift)
    return groups


@kernel
def sum_group_paths(paths, groups):
    """Return the sum of the paths of some groups of bodies [m].

    The path of a group is the longest distance that any of its bodies has moved, added
    up over some time steps.

    Parameters
    ----------
    paths : array (MOST_GROUPS,)
        Path of each group [m], a row of `Grid.paths`.
    groups : int
        Bit g is set for each of these groups g.
    """
    # Go from the lowest bit to the highest bit that is set.
    total = 0.0
    group = 0
    while groups >> group > 0:
        if groups >> group & 1:
            total += paths[group]
        group += 1
    return total


@kernel
def record_group_paths(bodies, counts, grid):
    """Record how far the bodies of each group have moved at most in this step.

    A group consists of whole tiles of LANES bodies that are neighbours in memory. Its
    path in this step is the longest path of its bodies, which `Bodies.longest_path`
    holds for each tile. It is added to one row of `Grid.paths`, the sum over all steps,
    and written to the other, that of the last step.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    """
    n_tiles = (counts[state.N_BODIES] + LANES - 1) // LANES
    # A group has 2^shift bodies, which is at least one tile.
    tiles_per_group = (1 << group_shift(bodies)) // LANES
    for begin in range(0, n_tiles, tiles_per_group):
        path = 0.0
        for tile in range(begin, min(begin + tiles_per_group, n_tiles)):
            path = max(path, bodies.longest_path[tile])
        group = begin // tiles_per_group
        # Add to the sum over all steps, and overwrite the path of the last step.
        grid.paths[ALL_STEPS, group] += path
        grid.paths[LAST_STEP, group] = path


@inlined
def find_touching_in_block(
    bodies, pairs, grid, parts, begin, end, touching, first_index, normal
):
    """Find the near pairs of one block that touch, list them, and count them.

    A pair is due when the displacements of its two bodies have reached
    `pairs.near_limit`, a sum at which they may touch. The gaps of these pairs are
    computed. Pairs that do not touch get new limits. No pair moves to another list
    here, because other threads read the lists.

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
    begin, end : int
        First pair of the block, and its end.
    touching : array of int
        Overwritten with the indices of the pairs that touch, from `first_index` on.
    first_index : int
        Index in `touching` of the first of them.
    normal : array (3,)
        Working memory for a unit normal; it is overwritten.

    Returns
    -------
    int
        Number of pairs that touch.
    """
    displacement = bodies.displacement
    first = pairs.near_first
    second = pairs.near_second
    limit = pairs.near_limit
    n_found = 0
    pair = find_next_due(displacement, first, second, limit, begin, end)
    while pair < end:
        # Compute the gap of a pair that is due.
        gap = solve_near_gap(bodies, pairs, grid, parts, pair, normal)
        if gap <= 0.0:
            touching[first_index + n_found] = pair
            n_found += 1
        else:
            # The bodies cannot touch before they have together moved by the gap.
            limit[pair] = displacement[first[pair]] + displacement[second[pair]] + gap
        pair = find_next_due(displacement, first, second, limit, pair + 1, end)
    return n_found


@inlined
def find_touching_in_share(bodies, pairs, grid, parts, begin, end, touching, normal):
    """Find the near pairs of one share that touch, list them, and count them.

    A share is a range of whole blocks of pairs, which one thread handles. A pair is due
    when the displacements of its two bodies have reached its limit. A block whose
    bodies are nearly at rest is skipped as long as none of its pairs can be due.

    To decide this, neighbouring bodies form groups, and `grid.paths` has how far the
    bodies of each group have moved at most. Two bodies of a block together move by at
    most twice the sum of the paths of the groups in this block. `pairs.near_check` has
    one number for each block: the sum of the paths at which it is checked again, or
    CHANGED or DUE. These two are not positive, so that the block is checked at once.

    Parameters
    ----------
    bodies, pairs, grid : Bodies, Pairs, Grid
        The arrays of the simulation, see `state`.
    parts : int
        Largest number of ellipsoids in a body; SPHERES (-1) if all bodies are spheres.
    begin, end : int
        The pairs of the share; `begin` is the first pair of a block.
    touching : array (near,)
        The indices of the pairs that touch are written to it from index `begin` on.
    normal : array (3,)
        Working memory for a unit normal; it is overwritten.

    Returns
    -------
    int
        Number of pairs that touch.
    """
    first = pairs.near_first
    second = pairs.near_second
    limit = pairs.near_limit
    shift = group_shift(bodies)
    # If the bodies of a block move by less than this in a step, they are nearly at
    # rest.
    calm_path = CALM_SHARE * grid.lengths[state.SKIN]
    n_found = 0
    for block_begin in range(begin, end, state.BLOCK):
        block = block_begin // state.BLOCK
        groups = pairs.near_groups[block]
        path = sum_group_paths(grid.paths[ALL_STEPS], groups)
        # The bodies of this block have moved too little for a pair to be due.
        if path < pairs.near_check[block]:
            continue
        block_end = min(block_begin + state.BLOCK, end)
        # The indices follow those that previous blocks have found.
        n_found += find_touching_in_block(
            bodies,
            pairs,
            grid,
            parts,
            block_begin,
            block_end,
            touching,
            begin + n_found,
            normal,
        )
        # If the pairs of the block have changed, its groups may have changed, too.
        if pairs.near_check[block] == CHANGED:
            groups = find_groups(first, second, block_begin, block_end, shift)
            pairs.near_groups[block] = groups
        # By default, the block is checked again in the next step. If its bodies are
        # nearly at rest, it is checked when the sum of the paths has grown by half of
        # the slack. The slack is how far two bodies must move together until the first
        # pair of the block is due, and each of them moves by at most the sum of the
        # paths. ROUNDING allows for the rounding errors of the sums.
        pairs.near_check[block] = DUE
        if 2.0 * sum_group_paths(grid.paths[LAST_STEP], groups) < calm_path:
            slack = smallest_slack(
                bodies.displacement, first, second, limit, block_begin, block_end
            )
            path = sum_group_paths(grid.paths[ALL_STEPS], groups)
            pairs.near_check[block] = path + 0.5 * slack - state.ROUNDING
    return n_found


@inlined
def add_found_contacts(pairs, counts, grid, touching, n_touching, begins):
    """Turn the near pairs that touch into contacts.

    The order does not depend on the number of threads. The loop begins with the last of
    these pairs. The last near pair of the list replaces each removed pair, so in this
    order the remaining indices stay valid.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    touching : array of int
        Indices of these pairs in the list of near pairs, in increasing order within
        each share.
    n_touching, begins : array of int (SHARES,)
        Number of pairs that each share (range of near pairs) found, and their first
        index in `touching`.
    """
    for share in range(SHARES - 1, -1, -1):
        begin = begins[share]
        for index in range(begin + n_touching[share] - 1, begin - 1, -1):
            k = touching[index]
            add_contact(
                pairs,
                counts,
                grid,
                pairs.near_first[k],
                pairs.near_second[k],
                pairs.near_normal[k],
            )
            drop_near_pair(pairs, counts, grid, k)


@kernel_without_gil
def advance_shared(
    bodies,
    pairs,
    plane_contacts,
    curved_contacts,
    mesh_contacts,
    grid,
    walls,
    meshes,
    counts,
    physics,
    tiles,
    body_tiles,
    scratches,
    shared,
    thread,
    n_steps,
):
    """Run one thread's part of several time steps, and return the number of steps made.

    The work is divided into SHARES shares, whatever the number of threads, so that the
    result does not depend on this number. All threads run this function at the same
    time, and wait for each other in `wait_for_all` between the phases of a step. Only
    the first thread changes lists of pairs.

    Parameters
    ----------
    bodies, pairs, plane_contacts, curved_contacts, mesh_contacts : arrays
        Bodies, pairs and contacts of the simulation, see `state`.
    grid, walls, meshes, counts, physics : arrays
        The rest of the simulation, see `state`.
    tiles, body_tiles, scratches : array
        Working memory; row `thread` of each array belongs to this thread.
    shared : Shared
        The arrays that the threads share.
    thread : int
        Index of this thread. It handles the shares thread, thread + n_threads, and so
        on.
    n_steps : int
        Number of steps.
    """
    n_threads = tiles.shape[0]
    ghost = grid.cell.shape[0]
    is_first_thread = thread == 0
    contact_tile = tiles[thread]
    body_tile = body_tiles[thread]
    scratch = state.split_scratch(scratches[thread])
    share_begins = shared.begins
    n_found = shared.n_found
    for step in range(n_steps):
        # Begin the step, or stop if a list might become too short during this step.
        if is_first_thread:
            lists_have_room = has_room(
                pairs, plane_contacts, curved_contacts, mesh_contacts, counts
            )
            shared.flags[STOP] = 0 if lists_have_room else 1
            if lists_have_room:
                begin_step(
                    bodies,
                    pairs,
                    plane_contacts,
                    curved_contacts,
                    mesh_contacts,
                    (),
                    grid,
                    walls,
                    counts,
                    physics,
                    ghost,
                )
        wait_for_all(shared.counters, n_threads)
        if shared.flags[STOP] != 0:
            return step

        # Find the near pairs that touch. Then change the lists and handle the walls.
        for share in range(thread, SHARES, n_threads):
            begin, end = share_range(counts[state.N_NEAR], share, state.BLOCK)
            share_begins[share] = begin
            n_found[share] = find_touching_in_share(
                bodies,
                pairs,
                grid,
                physics.parts,
                begin,
                end,
                shared.touching,
                scratch.normal,
            )
        wait_for_all(shared.counters, n_threads)
        if is_first_thread:
            add_found_contacts(
                pairs, counts, grid, shared.touching, n_found, share_begins
            )
            renew_pairs(
                bodies, pairs, (), counts, grid, physics.parts, scratch.normal, ghost
            )
            process_wall_contacts(
                bodies,
                plane_contacts,
                curved_contacts,
                mesh_contacts,
                (),
                walls,
                meshes,
                counts,
                physics,
                contact_tile,
                scratch,
                ghost,
            )
        wait_for_all(shared.counters, n_threads)

        # Compute the forces of the pairs. Then move pairs that have parted to the near
        # pairs.
        for share in range(thread, SHARES, n_threads):
            begin, end = share_range(counts[state.N_PAIRS], share, LANES)
            share_begins[share] = begin
            n_found[share] = add_pair_forces(
                bodies, pairs, (), counts, physics, contact_tile, share, begin, end
            )
        wait_for_all(shared.counters, n_threads)
        if is_first_thread:
            for share in range(SHARES - 1, -1, -1):
                retire_pairs(
                    bodies,
                    pairs,
                    counts,
                    grid,
                    share_begins[share],
                    n_found[share],
                    ghost,
                )
            counts[state.STEPS] += 1
        wait_for_all(shared.counters, n_threads)

        # Move the bodies. Then handle their events.
        for share in range(thread, SHARES, n_threads):
            begin, end = share_range(counts[state.N_BODIES], share, LANES)
            share_begins[share] = begin
            n_found[share] = integrate(bodies, counts, physics, body_tile, begin, end)
        wait_for_all(shared.counters, n_threads)
        if is_first_thread:
            time = counts[state.STEPS] * physics.dt
            for share in range(SHARES):
                handle_events(
                    bodies, grid, counts, share_begins[share], n_found[share], time
                )
            record_group_paths(bodies, counts, grid)
    return n_steps


def run_threads(arrays, tiles, shared, n_steps):
    """Run `advance_shared` on one thread for each row of the working memory.

    Parameters
    ----------
    arrays : sequence
        The first arguments of `advance_shared`, from `bodies` to `physics`.
    tiles : sequence of ndarray
        The working memory of all threads: `tiles`, `body_tiles` and `scratches`.
    shared : Shared
        The arrays that the threads share.
    n_steps : int
        Number of steps.

    Returns
    -------
    int
        Number of steps made.
    """

    # Every thread runs the same function, with its own index.
    def run(thread):
        return advance_shared(*arrays, *tiles, shared, thread, n_steps)

    n_threads = len(tiles[0])
    with ThreadPoolExecutor(n_threads) as pool:
        steps_made = list(pool.map(run, range(n_threads)))
    return steps_made[0]
