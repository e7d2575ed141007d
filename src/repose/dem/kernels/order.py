"""Bodies in spatial order: bodies that are near each other in the pile are near each other in memory.

Large simulations do not fit into the caches. From time to time their bodies are numbered anew along a Morton curve
through the cells, and contacts are sorted by their bodies; users keep the numbers that `add` returned.
"""

import numpy as np

from . import state as st
from .jit import kernel
from .neighbours import put_in_cell
from .rows import L


def morton(cell, shape):
    """Place on the Morton curve of cells (n,) of a grid of a shape (3,): the bits of the three indices interleaved."""
    cell = np.maximum(cell, 0)
    indices = (
        cell // (shape[1] * shape[2]),
        cell // shape[2] % shape[1],
        cell % shape[2],
    )
    code = np.zeros(len(cell), np.int64)
    for bit in range(int(max(shape)).bit_length()):
        for k, index in enumerate(indices):
            code |= (index >> bit & 1) << (3 * bit + k)
    return code


@kernel
def relink(grid, n):
    """Make the chains of the cells anew."""
    grid.head[:] = -1
    for i in range(n):
        if grid.cell[i] >= 0:
            put_in_cell(grid, i, grid.cell[i])


def permute(order, *arrays):
    """Permute the first rows of arrays."""
    for array in arrays:
        array[: len(order)] = array[: len(order)][order]


def permute_lanes(order, tiles):
    """Permute the first lanes of an array of tiles (tiles, rows * L)."""
    lanes = st.contact_rows(tiles, tiles.size)
    permute(order, lanes)
    tiles[:] = lanes.reshape(len(tiles), L, -1).transpose(0, 2, 1).reshape(tiles.shape)


def sort_by(bodies_of, arrays, *tiles):
    """Sort lists of contacts, arrays and tiles, by a body of each (n,)."""
    order = np.argsort(bodies_of, kind="stable")
    permute(order, *arrays)
    for data in tiles:
        permute_lanes(order, data)


def reorder(bodies, grid, pairs, flat, curved, meshed, counts):
    """Renumber the bodies along the Morton curve, between two steps; return the old number of each (n,)."""
    n = int(counts[st.N_BODIES])
    order = np.argsort(morton(grid.cell[:n], grid.shape), kind="stable")
    place = np.empty(n, np.int64)
    place[order] = np.arange(n)
    permute(
        order, bodies.rows, bodies.displacement, bodies.wall_check, bodies.presence, bodies.passed, bodies.exit_time,
        bodies.kind, grid.cell, grid.moved, grid.touching, grid.near,
    )  # fmt: skip
    permute(
        order,
        *(
            array.T
            for contacts in (flat, curved, meshed)
            for array in (contacts.limit, contacts.deepest)
        ),
    )
    permute_lanes(order, bodies.motion)
    bodies.resting[:] = 0
    bodies.wall_margin[:] = 0.0
    moved = int(counts[st.N_MOVED])
    grid.moved_list[:moved] = place[grid.moved_list[:moved]]
    relink(grid, n)
    of_pairs = (pairs.first, st.N_PAIRS), (pairs.second, st.N_PAIRS)
    near = (pairs.near_first, st.N_NEAR), (pairs.near_second, st.N_NEAR)
    on_walls = (
        (flat.body, st.N_PLANE),
        (curved.body, st.N_CURVED),
        (meshed.body, st.N_MESHED),
    )
    for numbers, used in (*of_pairs, *near, *on_walls):
        numbers[: counts[used]] = place[numbers[: counts[used]]]
    # contacts in the order of their bodies
    first, second = (
        pairs.first[: counts[st.N_PAIRS]],
        pairs.second[: counts[st.N_PAIRS]],
    )
    sort_by(np.minimum(first, second), (pairs.first, pairs.second), pairs.data)
    sort_by(
        flat.body[: counts[st.N_PLANE]], (flat.body, flat.wall, flat.feature), flat.data
    )
    first, second = (
        pairs.near_first[: counts[st.N_NEAR]],
        pairs.near_second[: counts[st.N_NEAR]],
    )
    sort_by(
        np.minimum(first, second),
        (pairs.near_first, pairs.near_second, pairs.near_limit, pairs.near_normal),
    )
    pairs.near_check[:] = 0.0
    return order
