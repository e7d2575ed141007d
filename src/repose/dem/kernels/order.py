"""Keep bodies in spatial order, so that bodies near in space are near in memory.

Large simulations do not fit into the caches. From time to time, their bodies are
renumbered along a Morton curve through the cells, and contacts are sorted by their
bodies. Users still see the numbers that `Simulation.add` returned. `reorder` permutes
the arrays of `Bodies`, `Grid`, `Pairs` and `WallContacts` in place. Only
`rebuild_cell_lists` is compiled.
"""

import numpy as np

from . import state
from .jit import kernel
from .neighbours import insert_into_cell
from .rows import LANES


def compute_morton_codes(cells, shape):
    """Compute the positions of cells on a Morton curve.

    Cells that are near each other on this curve are near each other in space. The
    position of a cell is an integer that interleaves the bits of the cell's three
    indices: bit 0 of the indices along x, y and z, then bit 1 of each, and so on.

    Parameters
    ----------
    cells : ndarray (n,)
        Number of each cell. A negative number counts as cell 0.
    shape : ndarray (3,)
        Number of cells along each axis.

    Returns
    -------
    ndarray (n,)
        Position of each cell on the curve: its Morton code.
    """
    cell_numbers = np.maximum(cells, 0)
    indices = (
        cell_numbers // (shape[1] * shape[2]),
        cell_numbers // shape[2] % shape[1],
        cell_numbers % shape[2],
    )
    code = np.zeros(len(cell_numbers), np.int64)
    for bit in range(int(max(shape)).bit_length()):
        for axis, index in enumerate(indices):
            index_bit = index >> bit & 1
            code |= index_bit << (3 * bit + axis)
    return code


@kernel
def rebuild_cell_lists(grid, n):
    """Rebuild the lists of bodies of all cells, after the bodies were renumbered.

    `grid.cell` contains the cell of each of the first n bodies, or -1. The arrays
    `head`, `following` and `preceding` of `grid` are overwritten.
    """
    # Empty all lists, then insert each body.
    grid.head[:] = -1
    for i in range(n):
        if grid.cell[i] >= 0:
            insert_into_cell(grid, i, grid.cell[i])


def permute(order, *arrays):
    """Permute the first rows of arrays in place.

    Row k becomes the old row order[k].

    Parameters
    ----------
    order : ndarray (n,)
        Old index of each of the first n rows.
    *arrays : ndarray
        Arrays with at least n rows. The rows after the first n stay in place.
    """
    for array in arrays:
        array[: len(order)] = array[: len(order)][order]


def permute_lanes(order, tiles):
    """Permute the first lanes of an array of tiles in place.

    Lane k, counted through all tiles, becomes the old lane order[k].

    Parameters
    ----------
    order : ndarray (n,)
        Old index of each of the first n lanes.
    tiles : ndarray (tiles, rows * LANES)
        Data of bodies or contacts, one body or contact in each lane.
    """
    n_tiles = len(tiles)
    # Make a table with a row for each lane, and permute its rows.
    table = state.contact_rows(tiles, tiles.size)
    permute(order, table)
    # Write the table back in the layout of the tiles.
    table_of_tiles = table.reshape(n_tiles, LANES, -1)
    tiles[:] = table_of_tiles.transpose(0, 2, 1).reshape(tiles.shape)


def sort_by_body(bodies, arrays, *tiles):
    """Sort a list of contacts by their bodies, in place.

    The sort is stable: contacts of the same body keep their order. Therefore the result
    does not depend on the sorting algorithm.

    Parameters
    ----------
    bodies : ndarray (n,)
        The body of each contact.
    arrays : sequence of ndarray
        Arrays of the list with a row for each contact. They are permuted.
    *tiles : ndarray
        Arrays of the list with a lane for each contact. They are permuted.
    """
    order = np.argsort(bodies, kind="stable")
    permute(order, *arrays)
    for tile_array in tiles:
        permute_lanes(order, tile_array)


def _permute_bodies(order, bodies, grid, flat, curved, meshed):
    """Permute all arrays that have a row or lane for each body, in place.

    Parameters
    ----------
    order : ndarray (n,)
        Old index of each body.
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    """
    permute(
        order,
        bodies.rows,
        bodies.displacement,
        bodies.wall_check,
        bodies.presence,
        bodies.below_curved_walls,
        bodies.exit_time,
        bodies.material,
        grid.cell,
        grid.moved,
        grid.touching,
        grid.near,
    )
    for contacts in (flat, curved, meshed):
        permute(order, contacts.limit.T, contacts.allowed_overlap.T)
    permute_lanes(order, bodies.motion)
    # The tiles now have other bodies, so reset what was known about whole tiles.
    bodies.resting[:] = 0
    bodies.wall_margin[:] = 0.0


def _renumber_bodies(new_index, pairs, flat, curved, meshed, counts):
    """Replace the indices of bodies in the lists of contacts and near pairs, in place.

    Parameters
    ----------
    new_index : ndarray (n,)
        New index of each body, by its old index.
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    """
    # Arrays of indices of bodies, and the indices in `counts` of their lengths
    index_arrays = (
        (pairs.first, state.N_PAIRS),
        (pairs.second, state.N_PAIRS),
        (pairs.near_first, state.N_NEAR),
        (pairs.near_second, state.N_NEAR),
        (flat.body, state.N_PLANE),
        (curved.body, state.N_CURVED),
        (meshed.body, state.N_MESHED),
    )
    for body_indices, length_slot in index_arrays:
        length = counts[length_slot]
        body_indices[:length] = new_index[body_indices[:length]]


def _sort_contacts(pairs, flat, counts):
    """Sort pairs, contacts with planes and near pairs by their bodies, in place.

    The sort key of a pair is the lower of its two body indices. As a result, contacts
    of bodies that are near in memory are also near in memory. Contacts with curved
    walls and meshes are few, so they are not sorted. Every array of a list must be
    passed to `sort_by_body`, or else its items no longer belong to the right pairs.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    flat : WallContacts
        The contacts with planes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    """
    # Touching pairs
    n_pairs = counts[state.N_PAIRS]
    lower = np.minimum(pairs.first[:n_pairs], pairs.second[:n_pairs])
    sort_by_body(lower, (pairs.first, pairs.second), pairs.data)
    # Contacts with planes
    bodies = flat.body[: counts[state.N_PLANE]]
    sort_by_body(bodies, (flat.body, flat.wall, flat.feature), flat.data)
    # Near pairs
    n_near = counts[state.N_NEAR]
    lower_near = np.minimum(pairs.near_first[:n_near], pairs.near_second[:n_near])
    near_arrays = (
        pairs.near_first,
        pairs.near_second,
        pairs.near_limit,
        pairs.near_normal,
    )
    sort_by_body(lower_near, near_arrays)
    # A zero marks a block of near pairs that has changed, see `parallel.CHANGED`.
    pairs.near_check[:] = 0.0


def reorder(bodies, grid, pairs, flat, curved, meshed, counts):
    """Renumber the bodies along the Morton curve, between two steps.

    Along this space-filling curve, bodies that are near in space get indices that are
    near, too. The arrays of bodies, cells and contacts are changed in place, `counts`
    is only read. The order of the steps matters: the lists of the cells are built from
    the arrays of bodies in their new order.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.

    Returns
    -------
    ndarray (n,)
        The old index of each body.
    """
    n = int(counts[state.N_BODIES])
    old_index = np.argsort(
        compute_morton_codes(grid.cell[:n], grid.shape), kind="stable"
    )
    # `new_index` is the inverse permutation: new_index[old_index[k]] is k.
    new_index = np.empty(n, np.int64)
    new_index[old_index] = np.arange(n)
    # Permute the arrays that have a row or lane for each body.
    _permute_bodies(old_index, bodies, grid, flat, curved, meshed)
    # Replace old indices by new ones in the lists that hold indices of bodies.
    n_moved = int(counts[state.N_MOVED])
    grid.moved_list[:n_moved] = new_index[grid.moved_list[:n_moved]]
    rebuild_cell_lists(grid, n)
    _renumber_bodies(new_index, pairs, flat, curved, meshed, counts)
    _sort_contacts(pairs, flat, counts)
    return old_index
