"""Renew the neighbour list for bodies that have moved far or left the simulation.

`Grid.moved_list` contains the bodies that have moved by half a skin. `renew_pairs`
finds their neighbours again. `drop_contacts_of_gone` removes all contacts of bodies
that have left the simulation. `clumps` is an empty tuple if all bodies are smooth, see
`forces`.

Reads `Bodies.rows` and `Bodies.presence`. Writes all arrays of `Grid`, the lists of
pairs and of contacts with walls, `counts`, and the columns of motion of gone bodies.
"""

from . import state
from .clumps import chain_entries, drop_entries_of_gone
from .forces import release_wall_contact
from .jit import inlined, kernel
from .neighbours import (
    add_smooth_pair_if_near,
    add_to_cell,
    chain_contacts,
    drop_contact,
    drop_near_pairs_of_moved,
    remove_from_cell,
)
from .rigid import stop_body
from .sphere_search import add_clump_pair_if_near

UNMARKED = -1  # value of `Grid.mark` for a body without a mark


@inlined
def add_pair_if_near(bodies, pairs, clumps, counts, grid, parts, i, j, scratch):
    """Add the pair of bodies i and j to the lists if the bodies touch or are near.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    i, j : int
        The two bodies, which are not yet listed as a pair; i is the lower index.
    scratch : array
        Working memory: a normal (3,) for smooth bodies, `Scratch.spheres` for clumps.
    """
    if len(clumps) == 0:
        add_smooth_pair_if_near(bodies, pairs, counts, grid, parts, i, j, scratch)
    else:
        add_clump_pair_if_near(bodies, pairs, counts, grid, clumps, i, j, scratch)


@kernel
def list_pairs_of_body(bodies, pairs, clumps, counts, grid, parts, i, scratch):
    """Add the pairs of body i with near bodies in its cell and in the cells around it.

    Bodies whose `grid.mark` is i are skipped, because their pairs with i are already
    listed (see `mark_partners`). If both bodies of a pair have moved, only the search
    of the lower index adds the pair. Body i must be in a cell.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    i : int
        Index of the body.
    scratch : array
        Working memory: a normal (3,) for smooth bodies, `Scratch.spheres` for clumps.
    """
    # The number of cells along each axis, and the indices of the body's cell
    n_x, n_y, n_z = grid.shape[0], grid.shape[1], grid.shape[2]
    cell = grid.cell[i]
    cell_z = cell % n_z
    cell_y = (cell // n_z) % n_y
    cell_x = cell // (n_z * n_y)
    # Visit the body's cell and those before and after it along each axis: the offsets
    # 0, 1 and 2 minus 1. The grid repeats in space (periodic), so cell n is cell 0
    # again. With fewer than three cells along an axis, fewer offsets visit each cell
    # once.
    for offset_x in range(min(n_x, 3)):
        x = (cell_x + offset_x - 1) % n_x
        for offset_y in range(min(n_y, 3)):
            y = (cell_y + offset_y - 1) % n_y
            for offset_z in range(min(n_z, 3)):
                z = (cell_z + offset_z - 1) % n_z
                # Loop over the linked list of bodies in this cell. The value -1 ends
                # the list.
                j = grid.head[(x * n_y + y) * n_z + z]
                while j >= 0:
                    # Body j has moved, too, and its own search adds this pair.
                    is_listed_by_j = grid.moved[j] == 1 and j < i
                    if j != i and grid.mark[j] != i and not is_listed_by_j:
                        add_pair_if_near(
                            bodies,
                            pairs,
                            clumps,
                            counts,
                            grid,
                            parts,
                            min(i, j),
                            max(i, j),
                            scratch,
                        )
                    j = grid.following[j]


@inlined
def mark_partners(pairs, grid, i, mark):
    """Write a mark to all bodies that already have a pair with body i.

    These bodies are in the chain of partners of i (see `neighbours.chain_partner`).

    Parameters
    ----------
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    i : int
        Index of the body.
    mark : int
        The value that is written to `grid.mark`, which is i before the search for pairs
        of body i and UNMARKED after it.
    """
    chain_link = grid.chain[i]
    while chain_link >= 0:
        grid.mark[pairs.partner[chain_link]] = mark
        chain_link = pairs.link[chain_link]


@kernel
def renew_pairs(bodies, pairs, clumps, counts, grid, parts, scratch, ghost):
    """Find the pairs of the bodies in `Grid.moved_list` again, and empty this list.

    Near pairs of smooth bodies are removed and found again. Touching pairs are kept,
    because they have springs, and so are entries, which are the near pairs of clumps.
    The bodies of the kept pairs are linked in lists, called chains, so that the search
    does not add these pairs a second time. The order of the steps matters: remove,
    link, search, reset.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    parts : int
        Largest number of ellipsoids in a body; 0 for clumps; SPHERES (-1) if all bodies
        are spheres.
    scratch : array
        Working memory: a normal (3,) for smooth bodies, `Scratch.spheres` for clumps.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    n_moved = counts[state.N_MOVED]
    if n_moved == 0:
        return
    # Smooth bodies: `clumps` is an empty tuple, which numba knows from its type.
    if len(clumps) == 0:
        drop_near_pairs_of_moved(pairs, counts, grid)
    # Move the bodies to the cells of their present positions.
    for index in range(n_moved):
        i = grid.moved_list[index]
        remove_from_cell(grid, i)
        if bodies.presence[i] == state.PRESENT:
            add_to_cell(grid, bodies, i)
    # Make chains of the pairs that are kept.
    if len(clumps) == 0:
        chain_contacts(pairs, counts, grid)
    else:
        chain_entries(pairs, counts, grid, ghost)
    # Find the other pairs. Before the search for the pairs of body i, its partners are
    # marked with i, so that the search skips them. Afterwards the marks are removed.
    for index in range(n_moved):
        i = grid.moved_list[index]
        if bodies.presence[i] == state.PRESENT:
            mark_partners(pairs, grid, i, i)
            list_pairs_of_body(bodies, pairs, clumps, counts, grid, parts, i, scratch)
            mark_partners(pairs, grid, i, UNMARKED)
    # Empty the list and the chains for the next call.
    for index in range(n_moved):
        i = grid.moved_list[index]
        grid.moved[i] = 0
        grid.chain[i] = -1
    counts[state.N_MOVED] = 0


@inlined
def drop_pairs_of_gone(bodies, pairs, clumps, counts, grid, ghost):
    """Remove the touching pairs and the entries of clumps for bodies that are gone.

    A body is gone if it has fallen below the floor. An entry is a listed pair of clumps
    that are near each other. Near pairs of smooth bodies are removed later, by
    `renew_pairs`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    presence = bodies.presence
    if len(clumps) == 0:
        # Begin at the end, because the last contact replaces a removed one.
        for k in range(counts[state.N_PAIRS] - 1, -1, -1):
            if (
                presence[pairs.first[k]] != state.PRESENT
                or presence[pairs.second[k]] != state.PRESENT
            ):
                drop_contact(pairs, counts, grid, k, ghost)
    else:
        drop_entries_of_gone(bodies, pairs, counts, grid, clumps, ghost)


@inlined
def drop_wall_contacts_of_gone(presence, contacts, clumps, counts, length_index, ghost):
    """Remove the contacts with walls of one kind for bodies that are gone.

    Parameters
    ----------
    presence : array (bodies,)
        `Bodies.presence`, which is state.PRESENT for bodies that are not gone.
    contacts : WallContacts
        The list of contacts with walls of one kind.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    length_index : int
        Index in `counts` of the length of this list, such as state.N_PLANE.
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    # Begin at the end, because the last contact replaces a removed one.
    for k in range(counts[length_index] - 1, -1, -1):
        if presence[contacts.body[k]] != state.PRESENT:
            release_wall_contact(contacts, clumps, counts, length_index, k, ghost)


@kernel
def drop_contacts_of_gone(
    bodies,
    pairs,
    plane_contacts,
    curved_contacts,
    mesh_contacts,
    clumps,
    counts,
    grid,
    ghost,
):
    """Remove all contacts of bodies that fell below the floor in the previous step.

    These bodies are gone: they have left the simulation. They are in `Grid.moved_list`,
    together with bodies that have only moved far. The function also stops them, and
    resets their number, `counts[N_GONE]`.

    Parameters
    ----------
    bodies : Bodies
        State of all bodies, and the loads on them (`state.Bodies`).
    pairs : Pairs or SpherePairs
        The lists of pairs, of smooth bodies or of clumps.
    plane_contacts, curved_contacts, mesh_contacts : WallContacts
        Contacts with planes, with curved walls and with meshes.
    clumps : Clumps or ()
        The spheres of the clumps; an empty tuple if all bodies are smooth.
    counts : array (COUNTS,) of int
        Lengths of all lists and other counters, at indices such as `state.N_PAIRS`.
    grid : Grid
        Cells of the neighbour search, and lists of bodies in them (`state.Grid`).
    ghost : int
        Index of the ghost: a body without mass that never moves. Unused elements of the
        lists hold this index.
    """
    presence = bodies.presence
    drop_pairs_of_gone(bodies, pairs, clumps, counts, grid, ghost)
    drop_wall_contacts_of_gone(
        presence, plane_contacts, clumps, counts, state.N_PLANE, ghost
    )
    drop_wall_contacts_of_gone(
        presence, curved_contacts, clumps, counts, state.N_CURVED, ghost
    )
    drop_wall_contacts_of_gone(
        presence, mesh_contacts, clumps, counts, state.N_MESHED, ghost
    )
    for index in range(counts[state.N_MOVED]):
        i = grid.moved_list[index]
        if presence[i] != state.PRESENT:
            stop_body(bodies, i)
    counts[state.N_GONE] = 0
