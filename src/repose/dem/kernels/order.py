"""Bodies in spatial order: those that are near in the pile are near in memory.

Large simulations do not fit into the caches. From time to time their bodies are numbered
anew along a Morton curve through the cells, and contacts are sorted by their bodies.
Users keep the numbers that `Simulation.add` returned. `reorder` permutes the arrays of
`Bodies`, `Grid`, `Pairs` and `WallContacts` in place; this is Python, not compiled code.
"""

import numpy as np

from . import state
from .jit import kernel
from .neighbours import insert_into_cell
from .rows import LANES


def compute_morton_codes(cell, shape):
    """Return the places of cells on a Morton curve.

    On this curve, cells that are near in space are mostly near. The place of a cell is a
    number whose bits are those of the cell's three indices, in turn: bit 0 of the index
    along x, of that along y and of that along z, then bit 1 of each, and so on.

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
    cell_number = np.maximum(cell, 0)
    indices = (
        cell_number // (shape[1] * shape[2]),
        cell_number // shape[2] % shape[1],
        cell_number % shape[2],
    )
    place = np.zeros(len(cell_number), np.int64)
    for bit in range(int(max(shape)).bit_length()):
        for axis, axis_index in enumerate(indices):
            bit_of_index = axis_index >> bit & 1
            place |= bit_of_index << (3 * bit + axis)
    return place


@kernel
def rebuild_cell_lists(grid, n):
    """Put the first n bodies into the lists of their cells, after a renumbering.

    The lists are emptied first; `grid.cell` has the cell of each body, or -1.
    """
    grid.head[:] = -1
    for i in range(n):
        if grid.cell[i] >= 0:
            insert_into_cell(grid, i, grid.cell[i])


def permute(order, *arrays):
    """Permute the first rows of arrays in place; row k becomes the old row order[k].

    Parameters
    ----------
    order : ndarray (n,)
        Old number of each of the first n rows.
    *arrays : ndarray
        Arrays with n rows or more; further rows stay.
    """
    for array in arrays:
        array[: len(order)] = array[: len(order)][order]


def permute_lanes(order, tiles):
    """Permute the first lanes of an array of tiles in place.

    Lane k, counted through all tiles, becomes the old lane order[k].

    Parameters
    ----------
    order : ndarray (n,)
        Old number of each of the first n lanes.
    tiles : ndarray (tiles, rows * LANES)
        Numbers of bodies or contacts, one in each lane.
    """
    n_tiles = len(tiles)
    # a table with a row for each lane, then back to tiles
    table = state.contact_rows(tiles, tiles.size)
    permute(order, table)
    # from rows of lanes back to lanes of rows
    by_tile = table.reshape(n_tiles, LANES, -1)
    tiles[:] = by_tile.transpose(0, 2, 1).reshape(tiles.shape)


def sort_by_body(bodies, arrays, *tiles):
    """Sort a list of contacts by a body of each, in place.

    Contacts of one body keep their order, so the result does not depend on the sort.

    Parameters
    ----------
    bodies : ndarray (n,)
        The body of each contact.
    arrays : sequence of ndarray
        Arrays of the list.
    *tiles : ndarray
        Tiles of the list.
    """
    order = np.argsort(bodies, kind="stable")
    permute(order, *arrays)
    for data in tiles:
        permute_lanes(order, data)


def _permute_bodies(order, bodies, grid, flat, curved, meshed):
    """Permute all arrays that have a place for each body, in place.

    Parameters
    ----------
    order : ndarray (n,)
        Old number of each body.
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
    # what is known of whole tiles is not valid for the new tiles
    bodies.resting[:] = 0
    bodies.wall_margin[:] = 0.0


def _renumber_bodies(new_number, pairs, flat, curved, meshed, counts):
    """Write the new number of each body to the lists of contacts and near pairs.

    Parameters
    ----------
    new_number : ndarray (n,)
        New number of each old one.
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    flat, curved, meshed : WallContacts
        Contacts with planes, with curved walls and with meshes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    """
    # arrays of body numbers, and where `counts` has their length
    lists = (
        (pairs.first, state.N_PAIRS),
        (pairs.second, state.N_PAIRS),
        (pairs.near_first, state.N_NEAR),
        (pairs.near_second, state.N_NEAR),
        (flat.body, state.N_PLANE),
        (curved.body, state.N_CURVED),
        (meshed.body, state.N_MESHED),
    )
    for numbers, slot in lists:
        n = counts[slot]
        numbers[:n] = new_number[numbers[:n]]


def _sort_contacts(pairs, flat, counts):
    """Sort pairs, contacts with planes and near pairs by their bodies, in place.

    A pair is sorted by its lower body. So the contacts of bodies that are near in
    memory are near in memory, too. Contacts with curved walls and meshes are few and
    stay.

    Parameters
    ----------
    pairs : Pairs
        The lists of touching pairs and of near pairs (`state.Pairs`).
    flat : WallContacts
        The contacts with planes.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.
    """
    # pairs that touch
    n_pairs = counts[state.N_PAIRS]
    lower = np.minimum(pairs.first[:n_pairs], pairs.second[:n_pairs])
    sort_by_body(lower, (pairs.first, pairs.second), pairs.data)
    # contacts with planes
    bodies = flat.body[: counts[state.N_PLANE]]
    sort_by_body(bodies, (flat.body, flat.wall, flat.feature), flat.data)
    # near pairs
    n_near = counts[state.N_NEAR]
    lower_near = np.minimum(pairs.near_first[:n_near], pairs.near_second[:n_near])
    near_arrays = (
        pairs.near_first,
        pairs.near_second,
        pairs.near_limit,
        pairs.near_normal,
    )
    sort_by_body(lower_near, near_arrays)
    # the blocks of near pairs have changed, see `parallel.CHANGED`
    pairs.near_check[:] = 0.0


def reorder(bodies, grid, pairs, flat, curved, meshed, counts):
    """Renumber the bodies along the Morton curve, between two steps.

    All arguments are changed in place.

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
        Lengths of all lists and other counters. `state.N_PAIRS` and so on are the
        indices.

    Returns
    -------
    ndarray (n,)
        The old number of each body.
    """
    n = int(counts[state.N_BODIES])
    old_number = np.argsort(
        compute_morton_codes(grid.cell[:n], grid.shape), kind="stable"
    )
    new_number = np.empty(n, np.int64)
    new_number[old_number] = np.arange(n)
    # the arrays with a place for each body
    _permute_bodies(old_number, bodies, grid, flat, curved, meshed)
    # the lists that hold numbers of bodies
    n_moved = int(counts[state.N_MOVED])
    grid.moved_list[:n_moved] = new_number[grid.moved_list[:n_moved]]
    rebuild_cell_lists(grid, n)
    _renumber_bodies(new_number, pairs, flat, curved, meshed, counts)
    _sort_contacts(pairs, flat, counts)
    return old_number
