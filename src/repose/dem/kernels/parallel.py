"""One simulation on several threads.

The work of a step is cut into SHARES, a number that does not depend on the threads: each share of the contacts has
loads of its own, and these are added up in a fixed order. So the result is the same, bit for bit, for any number of
threads. One thread changes the lists (pairs that meet, part or move on) while the others wait at a barrier. Every
thread runs `advance_shared`.
"""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from . import state as st
from .atomics import wait_for_all
from .engine import begin_step, has_room, wall_contacts_and_forces
from .forces import pair_forces
from .jit import inlined, kernel, kernel_without_gil
from .neighbours import add_contact, drop_near, near_gap, next_due, retire_pairs
from .renewal import renew
from .rigid import act_on_events, integrate
from .rows import L

SHARES = 8
FEWEST_BODIES = (
    4096  # smaller simulations have one share: they gain nothing from threads
)
REORDER_EVERY = 1000  # steps after which bodies are numbered anew (see `order`)
CALM = 1e-3  # of the skin: paths of one step below which whole blocks of pairs can be skipped
CHANGED, DUE = (
    0.0,
    -1.0,
)  # of a block of near pairs, in place of the path at which it is checked
UP_TO_NOW, LAST_STEP = 0, 1  # rows of `Grid.paths`
STOP = 0  # place in `orders` that ends the run


@inlined
def share_of(n, share, grain):
    """Begin and end of a share of n things, in whole grains."""
    grains = (n + grain - 1) // grain
    return grains * share // SHARES * grain, min(
        grains * (share + 1) // SHARES * grain, n
    )


@kernel
def slack(displacement, first, second, limit, begin, end):
    """Lower bound of the distance by which the pairs begin to end may come nearer before one is due [m]."""
    least = math.inf
    for k in range(begin, end):
        u = np.uint64(k)
        least = min(
            least, limit[u] - (displacement[first[u]] + displacement[second[u]])
        )
    return least


@inlined
def group_bits(bodies):
    """Shift of bits that gives the group of a body's number: whole tiles, at most st.MOST_GROUPS groups."""
    bits = 5
    while bodies.displacement.shape[0] >> bits >= st.MOST_GROUPS:
        bits += 1
    return bits


@kernel
def groups_of(first, second, begin, end, bits):
    """Return the groups of all bodies of the pairs begin to end, as bits of a whole number."""
    groups = 0
    for k in range(begin, end):
        u = np.uint64(k)
        groups |= (1 << (np.int64(first[u]) >> bits)) | (
            1 << (np.int64(second[u]) >> bits)
        )
    return groups


@kernel
def paths_of(paths, groups):
    """Compute the sum of the paths of some groups [m]."""
    total = 0.0
    group = 0
    while groups > 0:
        if groups & 1:
            total += paths[group]
        groups >>= 1
        group += 1
    return total


@kernel
def note_paths(bodies, counts, grid):
    """Store the longest path of each group's bodies in this step."""
    tiles = (counts[st.N_BODIES] + L - 1) // L
    size = (1 << group_bits(bodies)) // L
    for begin in range(0, tiles, size):
        path = 0.0
        for tile in range(begin, min(begin + size, tiles)):
            path = max(path, bodies.longest[tile])
        grid.paths[UP_TO_NOW, begin // size] += path
        grid.paths[LAST_STEP, begin // size] = path


@inlined
def look_at_block(bodies, pairs, grid, parts, begin, end, due, place, normal):
    """Find the near pairs begin to end that are due and touch, list them from `place` on and return their number."""
    first, second, limit = pairs.near_first, pairs.near_second, pairs.near_limit
    found = 0
    k = next_due(bodies.displacement, first, second, limit, begin, end)
    while k < end:
        gap = near_gap(bodies, pairs, grid, parts, k, normal)
        if gap <= 0.0:
            due[place + found] = k
            found += 1
        else:
            limit[k] = (
                bodies.displacement[first[k]] + bodies.displacement[second[k]] + gap
            )
        k = next_due(bodies.displacement, first, second, limit, k + 1, end)
    return found


@inlined
def look_at_share(bodies, pairs, grid, parts, begin, end, due, normal):
    """Solve for the gaps of the near pairs begin to end that are due; lists those that touch and returns their number.

    A block whose bodies are nearly at rest is skipped until its slack may be used up: two bodies come nearer by at most
    twice the sum of the longest paths of all groups with bodies in the block.
    """
    first, second, limit = pairs.near_first, pairs.near_second, pairs.near_limit
    bits = group_bits(bodies)
    calm = CALM * grid.lengths[st.SKIN]
    found = 0
    for at in range(begin, end, st.BLOCK):
        block = at // st.BLOCK
        groups = pairs.near_groups[block]
        if paths_of(grid.paths[UP_TO_NOW], groups) < pairs.near_check[block]:
            continue
        last = min(at + st.BLOCK, end)
        found += look_at_block(
            bodies, pairs, grid, parts, at, last, due, begin + found, normal
        )
        if pairs.near_check[block] == CHANGED:
            groups = groups_of(first, second, at, last, bits)
            pairs.near_groups[block] = groups
        pairs.near_check[block] = DUE
        if 2.0 * paths_of(grid.paths[LAST_STEP], groups) < calm:
            free = slack(bodies.displacement, first, second, limit, at, last)
            pairs.near_check[block] = (
                paths_of(grid.paths[UP_TO_NOW], groups) + 0.5 * free - st.ROUNDING
            )
    return found


@inlined
def update_near_shares(pairs, counts, grid, due, n_due, begins):
    """Turn the near pairs that touch into contacts, the last first."""
    for share in range(SHARES - 1, -1, -1):
        for e in range(begins[share] + n_due[share] - 1, begins[share] - 1, -1):
            k = due[e]
            add_contact(
                pairs,
                counts,
                grid,
                pairs.near_first[k],
                pairs.near_second[k],
                pairs.near_normal[k],
            )
            drop_near(pairs, counts, grid, k)


@kernel_without_gil
def advance_shared(
    bodies, pairs, flat, curved, meshed, grid, walls, meshes, counts, physics, tiles, body_tiles, scratches, shared,
    thread, steps
):  # fmt: skip
    """Run the part of one thread in a number of steps, with a row of each scratch array; return the steps made."""
    threads = tiles.shape[0]
    ghost = grid.cell.shape[0]
    lead = thread == 0
    t, m, scratch = tiles[thread], body_tiles[thread], st.scratch_of(scratches[thread])
    begins, numbers = shared.begins, shared.numbers
    for step in range(steps):
        if lead:
            shared.orders[STOP] = (
                0 if has_room(pairs, flat, curved, meshed, counts) else 1
            )
            if shared.orders[STOP] == 0:
                begin_step(
                    bodies,
                    pairs,
                    flat,
                    curved,
                    meshed,
                    (),
                    grid,
                    walls,
                    counts,
                    physics,
                    ghost,
                )
        wait_for_all(shared.counters, threads)
        if shared.orders[STOP] != 0:
            return step

        for share in range(thread, SHARES, threads):
            begin, end = share_of(counts[st.N_NEAR], share, st.BLOCK)
            begins[share] = begin
            numbers[share] = look_at_share(
                bodies,
                pairs,
                grid,
                physics.parts,
                begin,
                end,
                shared.due,
                scratch.normal,
            )
        wait_for_all(shared.counters, threads)
        if lead:
            update_near_shares(pairs, counts, grid, shared.due, numbers, begins)
            renew(bodies, pairs, (), counts, grid, physics.parts, scratch.normal, ghost)
            wall_contacts_and_forces(
                bodies,
                flat,
                curved,
                meshed,
                (),
                walls,
                meshes,
                counts,
                physics,
                t,
                scratch,
                ghost,
            )
        wait_for_all(shared.counters, threads)

        for share in range(thread, SHARES, threads):
            begin, end = share_of(counts[st.N_PAIRS], share, L)
            begins[share] = begin
            numbers[share] = pair_forces(
                bodies, pairs, (), counts, physics, t, share, begin, end
            )
        wait_for_all(shared.counters, threads)
        if lead:
            for share in range(SHARES - 1, -1, -1):
                retire_pairs(
                    bodies, pairs, counts, grid, begins[share], numbers[share], ghost
                )
            counts[st.STEPS] += 1
        wait_for_all(shared.counters, threads)

        for share in range(thread, SHARES, threads):
            begin, end = share_of(counts[st.N_BODIES], share, L)
            begins[share] = begin
            numbers[share] = integrate(bodies, counts, physics, m, begin, end)
        wait_for_all(shared.counters, threads)
        if lead:
            for share in range(SHARES):
                act_on_events(
                    bodies,
                    grid,
                    counts,
                    begins[share],
                    numbers[share],
                    counts[st.STEPS] * physics.dt,
                )
            note_paths(bodies, counts, grid)
    return steps


def run_threads(arrays, tiles, shared, steps):
    """Run `advance_shared` on as many threads as there are scratch tiles; returns the steps made."""
    threads = len(tiles[0])
    with ThreadPoolExecutor(threads) as pool:
        made = pool.map(
            lambda thread: advance_shared(*arrays, *tiles, shared, thread, steps),
            range(threads),
        )
    return next(made)
