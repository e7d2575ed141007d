"""Bodies in spatial order: bodies that are near each other in the pile are near each other in memory.

Large simulations do not fit into the caches. From time to time their bodies are numbered anew along a Morton curve
through the cells, and contacts are sorted by their bodies; users keep the numbers that `add` returned.
"""

import numpy as np

from . import state as st
from .jit import kernel

L = st.LANES


def morton(cell, shape):
    """Place on the Morton curve of cells (n,) of a grid of a shape (3,): the bits of the three indices interleaved."""
    cell = np.maximum(cell, 0)
    indices = cell // (shape[1] * shape[2]), cell // shape[2] % shape[1], cell % shape[2]
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
        cell = grid.cell[i]
        grid.following[i] = -1
        grid.preceding[i] = -1
        if cell >= 0:
            after = grid.head[cell]
            grid.following[i] = after
            if after >= 0:
                grid.preceding[after] = i
            grid.head[cell] = i


def _permute_lanes(tiles, order):
    """Permute the first lanes of an array of tiles (tiles, rows * L)."""
    rows = tiles.shape[1] // L
    flat = tiles.reshape(-1, rows, L).transpose(0, 2, 1).reshape(-1, rows)
    flat[: len(order)] = flat[order]
    tiles[:] = flat.reshape(-1, L, rows).transpose(0, 2, 1).reshape(tiles.shape)


def reorder(bodies, grid, pairs, flat, curved, meshed, counts):
    """Renumber the bodies along the Morton curve, between two steps; return the old number of each (n,)."""
    n = int(counts[st.N_BODIES])
    order = np.argsort(morton(grid.cell[:n], grid.shape), kind="stable")
    place = np.empty(n, np.int64)
    place[order] = np.arange(n)
    for array in (
        bodies.rows, bodies.displacement, bodies.wall_check, bodies.presence, bodies.passed, bodies.exit_time,
        bodies.kind, grid.cell, grid.moved, grid.touching, grid.near,
    ):  # fmt: skip
        array[:n] = array[:n][order]
    for contacts in (flat, curved, meshed):
        for array in (contacts.limit, contacts.deepest):
            array[:, :n] = array[:, :n][:, order]
    _permute_lanes(bodies.motion, order)
    bodies.resting[:] = 0
    bodies.wall_margin[:] = 0.0
    moved = int(counts[st.N_MOVED])
    grid.moved_list[:moved] = place[grid.moved_list[:moved]]
    relink(grid, n)
    for numbers, used in (
        (pairs.first, st.N_PAIRS),
        (pairs.second, st.N_PAIRS),
        (pairs.near_first, st.N_NEAR),
        (pairs.near_second, st.N_NEAR),
        (flat.body, st.N_PLANE),
        (curved.body, st.N_CURVED),
        (meshed.body, st.N_MESHED),
    ):
        numbers[: counts[used]] = place[numbers[: counts[used]]]
    sort_contacts(pairs, int(counts[st.N_PAIRS]))
    sort_plane_contacts(flat, int(counts[st.N_PLANE]))
    sort_near(pairs, int(counts[st.N_NEAR]))
    return order


def sort_contacts(pairs, n):
    """Sort the first n contacts by their bodies."""
    order = np.argsort(np.minimum(pairs.first[:n], pairs.second[:n]), kind="stable")
    for numbers in (pairs.first, pairs.second):
        numbers[:n] = numbers[:n][order]
    _permute_lanes(pairs.data, order)


def sort_plane_contacts(flat, n):
    """Sort the first n contacts with planes by their bodies."""
    order = np.argsort(flat.body[:n], kind="stable")
    for numbers in (flat.body, flat.wall, flat.feature):
        numbers[:n] = numbers[:n][order]
    _permute_lanes(flat.data, order)


def sort_near(pairs, n):
    """Sort the first n near pairs by their bodies."""
    order = np.argsort(np.minimum(pairs.near_first[:n], pairs.near_second[:n]), kind="stable")
    for array in (pairs.near_first, pairs.near_second, pairs.near_limit, pairs.near_normal):
        array[:n] = array[:n][order]
    pairs.near_check[:] = 0.0
