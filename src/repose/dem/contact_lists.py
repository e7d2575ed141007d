"""Make the lists of contacts of a simulation, and lengthen them when they fill up."""

from typing import Any

import numpy as np

from .kernels import clump_tile as ct
from .kernels import clumps as cl
from .kernels import state as st

# Entries per body that the first lists have; the lists grow when needed.
CONTACTS_PER_BODY = 6
NEAR_PER_BODY = 13  # of a lattice: all 26 neighbours, each pair once
SPHERE_CONTACTS_PER_BODY = 20
MOST_NEW = 4096  # contacts of spheres that may begin in one step


def new_pairs(capacity: int, most_spheres: int, n_state: int) -> Any:
    """Make empty lists of contacts between bodies.

    Parameters
    ----------
    capacity : int
        Most bodies.
    most_spheres : int
        Spheres of the largest clump; 0 for smooth bodies.
    n_state : int
        Rows that the force laws keep for each contact.
    """
    if most_spheres:
        contacts = SPHERE_CONTACTS_PER_BODY * capacity + MOST_NEW
    else:
        contacts = CONTACTS_PER_BODY * capacity + 64
    near = NEAR_PER_BODY * capacity + 256
    return _pair_lists(contacts, near, capacity, most_spheres, n_state)


def _pair_lists(
    contacts: int, near: int, capacity: int, most_spheres: int, n_state: int
) -> Any:
    """Make empty lists for numbers of touching and of near pairs."""
    if most_spheres == 0:
        return st.new_pairs(contacts, near, capacity, n_state)
    return cl.new_sphere_pairs(contacts, near, most_spheres, capacity, n_state)


def new_wall_contacts(
    capacity: int, n_walls: tuple[int, int, int], has_clumps: bool, n_state: int
) -> list[Any]:
    """Make empty lists of contacts with planes, with cones and rings, and with meshes.

    Parameters
    ----------
    capacity : int
        Most bodies.
    n_walls : tuple of int
        Numbers of planes, of cones and rings, and of meshes.
    has_clumps : bool
        Whether the bodies are clumps of spheres.
    n_state : int
        Rows that the force laws keep for each contact.
    """
    n_planes, _n_curved, n_meshes = n_walls
    spare = 64 * st.MOST_SPHERES if has_clumps else 64
    entries_of_lists = [
        n_planes * capacity + spare,
        capacity + spare,
        capacity + spare if n_meshes else 1,
    ]
    # A contact keeps its geometry in the first rows, then the rows of the laws.
    first_law_row = ct.WALL_STATE if has_clumps else st.WALL_STATE
    rows = first_law_row // st.LANES + n_state
    ghost = capacity  # the absent body of unused entries
    lists = []
    for entries, walls in zip(entries_of_lists, n_walls, strict=True):
        lists.append(
            st.new_wall_contacts(entries, walls, capacity, ghost, rows, has_clumps)
        )
    return lists


def grown_pairs(
    old: Any, counts: Any, capacity: int, most_spheres: int, n_state: int
) -> Any:
    """Copy the lists of pairs, with twice the room where three quarters are used."""
    contacts = _next_length(old.first, counts[st.N_PAIRS])
    near = _next_length(old.near_limit, counts[st.N_NEAR])
    new = _pair_lists(contacts, near, capacity, most_spheres, n_state)
    return _copy_lists(new, old)


def grown_wall_contacts(contacts: Any, used: int, ghost: int) -> Any:
    """Copy a list of wall contacts, with twice the room where three quarters are used.

    `ghost` is the number of the absent body that unused entries have.
    """
    entries = _next_length(contacts.body, used)
    n_walls, n_bodies = contacts.limit.shape
    rows = contacts.data.shape[1] // st.LANES
    has_clumps = isinstance(contacts.known, np.ndarray)
    new = st.new_wall_contacts(entries, n_walls, n_bodies, ghost, rows, has_clumps)
    return _copy_lists(new, contacts)


def _next_length(array: Any, used: int) -> int:
    """Choose the length of a list, twice the present one if three quarters are used."""
    if used * 4 > len(array) * 3:
        return 2 * len(array)
    return len(array)


def _copy_lists(new: Any, old: Any) -> Any:
    """Copy the arrays of lists into those of others, which are as long or longer.

    A list of smooth bodies has an empty tuple in place of each array for clumps.
    """
    for new_array, old_array in zip(new, old, strict=True):
        if len(old_array):
            new_array[: len(old_array)] = old_array
    return new
