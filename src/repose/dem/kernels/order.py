"""Bodies in spatial order: those that are near in the pile are near in memory.

Large simulations do not fit into the caches. From time to time their bodies are numbered
anew along a Morton curve through the cells, and contacts are sorted by their bodies.
Users keep the numbers that `Simulation.add` returned. `reorder` permutes the arrays of
`Bodies`, `Grid`, `Pairs` and `WallContacts` in place; this is Python, not compiled code.
"""

import numpy as np

from . import state as st
from .jit import kernel
from .neighbours import put_in_cell
from .rows import L


def morton(cell, shape):
    """Return the places of cells on a Morton curve.

    The bits of the three indices of a cell are interleaved.

    Parameters
    ----------
    cell : ndarray (n,)
        Numbers of cells; a negative number counts as cell 0.
    shape : ndarray (3,)
        Number of cells along each axis.

    Returns
    -------
    ndarray (n,)
        The places.
    """
    cell = np.maximum(cell, 0)
    indices = (
        cell // (shape[1] * shape[2]),
        cell // shape[2] % shape[1],
        cell % shape[2],
    )
    code = np.zeros(len(cell), np.int64)
    for bit in range(int(max(shape)).bit_length()):
        for axis, index in enumerate(indices):
            code |= (index >> bit & 1) << (3 * bit + axis)
    return code


@kernel
def relink(grid, n):
    """Make the lists of the cells anew for the first n bodies."""
    grid.head[:] = -1
    for i in range(n):
        if grid.cell[i] >= 0:
            put_in_cell(grid, i, grid.cell[i])


def permute(order, *arrays):
    """Permute the first rows of arrays in place; row k becomes row order[k]."""
    for array in arrays:
        array[: len(order)] = array[: len(order)][order]


def permute_lanes(order, tiles):
    """Permute the first lanes of an array of tiles (tiles, rows * L) in place."""
    lanes = st.contact_rows(tiles, tiles.size)
    permute(order, lanes)
    tiles[:] = lanes.reshape(len(tiles), L, -1).transpose(0, 2, 1).reshape(tiles.shape)


def sort_by(bodies_of, arrays, *tiles):
    """Sort lists of contacts by a body of each.

    Parameters
    ----------
    bodies_of : ndarray (n,)
        The body of each contact.
    arrays : sequence of ndarray
        Arrays of the list.
    *tiles : ndarray
        Tiles of the list.
    """
    order = np.argsort(bodies_of, kind="stable")
    permute(order, *arrays)
    for data in tiles:
        permute_lanes(order, data)


def _permute_bodies(order, bodies, grid, flat, curved, meshed):
    """Permute all arrays that have a place for each body."""
    permute(
        order,
        bodies.rows,
        bodies.displacement,
        bodies.wall_check,
        bodies.presence,
        bodies.passed,
        bodies.exit_time,
        bodies.kind,
        grid.cell,
        grid.moved,
        grid.touching,
        grid.near,
    )
    for contacts in (flat, curved, meshed):
        permute(order, contacts.limit.T, contacts.deepest.T)
    permute_lanes(order, bodies.motion)
    # what is known of whole tiles is not valid for the new tiles
    bodies.resting[:] = 0
    bodies.wall_margin[:] = 0.0


def _rename_bodies(new_number, pairs, flat, curved, meshed, counts):
    """Write the new number of each body to the lists of contacts and near pairs."""
    lists = (
        (pairs.first, st.N_PAIRS),
        (pairs.second, st.N_PAIRS),
        (pairs.near_first, st.N_NEAR),
        (pairs.near_second, st.N_NEAR),
        (flat.body, st.N_PLANE),
        (curved.body, st.N_CURVED),
        (meshed.body, st.N_MESHED),
    )
    for bodies_of, slot in lists:
        n = counts[slot]
        bodies_of[:n] = new_number[bodies_of[:n]]


def _sort_contacts(pairs, flat, counts):
    """Sort pairs, contacts with planes and near pairs by their (lower) bodies."""
    n_pairs = counts[st.N_PAIRS]
    lower = np.minimum(pairs.first[:n_pairs], pairs.second[:n_pairs])
    sort_by(lower, (pairs.first, pairs.second), pairs.data)
    on_planes = flat.body[: counts[st.N_PLANE]]
    sort_by(on_planes, (flat.body, flat.wall, flat.feature), flat.data)
    n_near = counts[st.N_NEAR]
    lower = np.minimum(pairs.near_first[:n_near], pairs.near_second[:n_near])
    near_arrays = (
        pairs.near_first,
        pairs.near_second,
        pairs.near_limit,
        pairs.near_normal,
    )
    sort_by(lower, near_arrays)
    pairs.near_check[:] = 0.0


def reorder(bodies, grid, pairs, flat, curved, meshed, counts):
    """Renumber the bodies along the Morton curve, between two steps.

    Returns
    -------
    ndarray (n,)
        The old number of each body.
    """
    n = int(counts[st.N_BODIES])
    order = np.argsort(morton(grid.cell[:n], grid.shape), kind="stable")
    new_number = np.empty(n, np.int64)
    new_number[order] = np.arange(n)
    _permute_bodies(order, bodies, grid, flat, curved, meshed)
    n_moved = int(counts[st.N_MOVED])
    grid.moved_list[:n_moved] = new_number[grid.moved_list[:n_moved]]
    relink(grid, n)
    _rename_bodies(new_number, pairs, flat, curved, meshed, counts)
    _sort_contacts(pairs, flat, counts)
    return order
