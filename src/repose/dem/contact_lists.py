"""Make the lists of contacts of a simulation, and lengthen them when they fill up."""

from typing import Any

import numpy as np

from .kernels import clump_tile, clumps, state

# Entries per body in the first lists. The lists grow when needed.
CONTACTS_PER_BODY = 6
NEAR_PER_BODY = 13  # a body of a lattice has 26 neighbours; each pair is listed once
SPHERE_CONTACTS_PER_BODY = 20
MOST_NEW = 4096  # contacts of spheres that may begin in one step

# Further entries, so that the lists of a few bodies do not fill up at once
SPARE_CONTACTS = 64
SPARE_NEAR = 256


def new_pairs(capacity: int, most_spheres: int, n_state: int) -> Any:
    """Make empty lists of contacts between bodies.

    Parameters
    ----------
    capacity : int
        Largest number of bodies.
    most_spheres : int
        Number of spheres in the largest clump; 0 for smooth bodies.
    n_state : int
        Rows that the force laws keep for each contact.

    Returns
    -------
    Pairs
        The lists of touching and of near pairs (`kernels.state.Pairs`).
    """
    if most_spheres:
        n_contacts = SPHERE_CONTACTS_PER_BODY * capacity + MOST_NEW
    else:
        n_contacts = CONTACTS_PER_BODY * capacity + SPARE_CONTACTS
    n_near = NEAR_PER_BODY * capacity + SPARE_NEAR
    return _make_pair_lists(n_contacts, n_near, capacity, most_spheres, n_state)


def _make_pair_lists(
    n_contacts: int, n_near: int, capacity: int, most_spheres: int, n_state: int
) -> Any:
    """Make empty lists with room for given numbers of touching and of near pairs.

    Parameters
    ----------
    n_contacts, n_near : int
        Lengths of the list of touching and of the list of near pairs.
    capacity, most_spheres, n_state : int
        See `new_pairs`.
    """
    if most_spheres == 0:
        return state.new_pairs(n_contacts, n_near, capacity, n_state)
    return clumps.new_sphere_pairs(n_contacts, n_near, most_spheres, capacity, n_state)


def new_wall_contacts(
    capacity: int, n_walls: tuple[int, int, int], has_clumps: bool, n_state: int
) -> list[Any]:
    """Make empty lists of contacts with planes, with curved walls and with meshes.

    Curved walls are cones, tubes and ring edges. The lists grow later. They begin with
    some spare elements, so that the lists of a few bodies do not fill up at once: for
    clumps, MOST_SPHERES times as many, since each sphere has a contact of its own.

    Parameters
    ----------
    capacity : int
        Largest number of bodies.
    n_walls : tuple of int
        Numbers of planes, of curved walls, and of meshes. The lists are returned in the
        same order.
    has_clumps : bool
        Whether the bodies are clumps of spheres.
    n_state : int
        Number of rows that the force laws keep for each contact.

    Returns
    -------
    list of WallContacts
        The three lists (`kernels.state.WallContacts`).
    """
    n_planes, _n_curved, n_meshes = n_walls
    spare = SPARE_CONTACTS * state.MOST_SPHERES if has_clumps else SPARE_CONTACTS
    # The first list has room for contacts of every body with every plane. The other
    # lists have room for one contact of each body.
    lengths = [
        n_planes * capacity + spare,
        capacity + spare,
        capacity + spare if n_meshes else 1,
    ]
    # The first rows of a contact are its geometry, which needs more rows for clumps.
    # Those of the laws follow. A row has LANES numbers, and `first_law_row` is the
    # index of the first number of a row.
    first_law_row = clump_tile.WALL_STATE if has_clumps else state.WALL_STATE
    n_rows = first_law_row // state.LANES + n_state
    # Unused elements of a list have the index of the ghost, which no body has.
    absent_body = capacity
    lists = []
    for length, count in zip(lengths, n_walls, strict=True):
        lists.append(
            state.new_wall_contacts(
                length, count, capacity, absent_body, n_rows, has_clumps
            )
        )
    return lists


def grow_pairs(
    old: Any, counts: Any, capacity: int, most_spheres: int, n_state: int
) -> Any:
    """Copy the lists of pairs, and double those that are three quarters full.

    Parameters
    ----------
    old : Pairs
        The present lists.
    counts : ndarray
        Counts of the simulation, with the numbers of touching and of near pairs.
    capacity, most_spheres, n_state : int
        See `new_pairs`.
    """
    n_contacts = _choose_length(old.first, counts[state.N_PAIRS])
    n_near = _choose_length(old.near_limit, counts[state.N_NEAR])
    new = _make_pair_lists(n_contacts, n_near, capacity, most_spheres, n_state)
    return _copy_lists(new, old)


def grow_wall_contacts(old: Any, n_contacts: int, absent_body: int) -> Any:
    """Copy a list of wall contacts, and double it if it is three quarters full.

    Parameters
    ----------
    old : WallContacts
        The present list.
    n_contacts : int
        Number of contacts in it.
    absent_body : int
        Number that no body has. It marks unused entries.
    """
    length = _choose_length(old.body, n_contacts)
    n_walls, n_bodies = old.limit.shape
    n_rows = old.data.shape[1] // state.LANES
    has_clumps = isinstance(old.touching_bits, np.ndarray)
    new = state.new_wall_contacts(
        length, n_walls, n_bodies, absent_body, n_rows, has_clumps
    )
    return _copy_lists(new, old)


def _choose_length(array: Any, n_used: int) -> int:
    """Choose the length of a list: doubled if the list is three quarters full."""
    if n_used * 4 > len(array) * 3:
        return 2 * len(array)
    return len(array)


def _copy_lists(new: Any, old: Any) -> Any:
    """Copy the arrays of lists into those of other lists, which are at least as long.

    A list of smooth bodies has an empty tuple in place of each array for clumps.
    """
    for new_array, old_array in zip(new, old, strict=True):
        if len(old_array):
            new_array[: len(old_array)] = old_array
    return new
