"""The lists of contacts of a simulation: new ones, and longer ones when they fill up."""

from typing import Any

import numpy as np

from .kernels import clump_tile as ct
from .kernels import clumps as cl
from .kernels import state as st

# Room for the lists of a simulation, per body; they grow when needed.
CONTACTS_PER_BODY, NEAR_PER_BODY = (
    6,
    13,
)  # of a lattice: all 26 neighbours, each pair once
SPHERE_CONTACTS_PER_BODY, MOST_NEW = 20, 4096


def new_pairs(capacity: int, most_spheres: int, n_state: int) -> Any:
    """Make empty lists for contacts between bodies; most_spheres: of the largest clump, 0 for smooth bodies."""
    contacts = (
        SPHERE_CONTACTS_PER_BODY * capacity + MOST_NEW
        if most_spheres
        else CONTACTS_PER_BODY * capacity + 64
    )
    return _pairs_with_room(
        contacts, NEAR_PER_BODY * capacity + 256, capacity, most_spheres, n_state
    )


def _pairs_with_room(
    contacts: int, near: int, capacity: int, most_spheres: int, n_state: int
) -> Any:
    """Make empty lists for numbers of touching and of near pairs."""
    if most_spheres == 0:
        return st.new_pairs(contacts, near, capacity, n_state)
    return cl.new_sphere_pairs(contacts, near, most_spheres, capacity, n_state)


def new_wall_contacts(
    capacity: int, n_walls: tuple[int, int, int], of_clumps: bool, n_state: int
) -> list[Any]:
    """Make empty lists for contacts with planes, with cones and rings, and with meshes: `n_walls` has their numbers."""
    n_planes, _n_curved, n_meshes = n_walls
    spare = 64 * st.MOST_SPHERES if of_clumps else 64
    rows = (ct.WALL_STATE if of_clumps else st.WALL_STATE) // st.LANES + n_state
    most = (
        n_planes * capacity + spare,
        capacity + spare,
        capacity + spare if n_meshes else 1,
    )
    kinds = zip(most, n_walls, strict=True)
    return [
        st.new_wall_contacts(room, walls, capacity, capacity, rows, of_clumps)
        for room, walls in kinds
    ]


def grown_pairs(
    old: Any, counts: Any, capacity: int, most_spheres: int, n_state: int
) -> Any:
    """Return the lists of pairs with the same content, and twice the room where three quarters are used."""
    contacts, near = (
        _room(old.first, counts[st.N_PAIRS]),
        _room(old.near_limit, counts[st.N_NEAR]),
    )
    return _filled(
        _pairs_with_room(contacts, near, capacity, most_spheres, n_state), old
    )


def grown_wall_contacts(contacts: Any, used: int, ghost: int) -> Any:
    """Return the list with twice the room where three quarters are used; ghost: the body number of unused contacts."""
    rows, of_clumps = (
        contacts.data.shape[1] // st.LANES,
        isinstance(contacts.known, np.ndarray),
    )
    room, (n_walls, n_bodies) = _room(contacts.body, used), contacts.limit.shape
    return _filled(
        st.new_wall_contacts(room, n_walls, n_bodies, ghost, rows, of_clumps), contacts
    )


def _room(array: Any, used: int) -> int:
    """Choose the length of a list: twice the present one where three quarters are used."""
    return len(array) * (2 if used * 4 > len(array) * 3 else 1)


def _filled(bigger: Any, old: Any) -> Any:
    """Copy lists into others that are as long or longer."""
    for target, source in zip(bigger, old, strict=True):
        if len(source):
            target[: len(source)] = source
    return bigger
