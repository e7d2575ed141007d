"""The lists of contacts of a simulation: new ones, and longer ones when they fill up."""

from typing import Any

from .kernels import clump_tile as ct
from .kernels import clumps as cl
from .kernels import state as st

# Room for the lists of a simulation, per body; they grow when needed.
CONTACTS_PER_BODY, NEAR_PER_BODY = 6, 13  # of a lattice: all 26 neighbours, each pair once
SPHERE_CONTACTS_PER_BODY, MOST_NEW = 20, 4096


def new_pairs(capacity: int, most_spheres: int, n_state: int) -> Any:
    """Make empty lists for contacts between bodies; most_spheres: of the largest clump, 0 for smooth bodies."""
    entries = NEAR_PER_BODY * capacity + 256
    if most_spheres == 0:
        return st.new_pairs(CONTACTS_PER_BODY * capacity + 64, entries, capacity, n_state)
    contacts = SPHERE_CONTACTS_PER_BODY * capacity + MOST_NEW
    return cl.new_sphere_pairs(contacts, entries, most_spheres, capacity, n_state)


def new_wall_contacts(
    capacity: int, n_walls: tuple[int, int, int], of_clumps: bool, n_state: int
) -> tuple[Any, Any, Any]:
    """Make empty lists for contacts with planes, with cones and rings, and with meshes: `n_walls` has their numbers."""
    n_planes, _n_curved, n_meshes = n_walls
    spare = 64 * st.MOST_SPHERES if of_clumps else 64
    rows = (ct.WALL_STATE if of_clumps else st.WALL_STATE) // st.LANES + n_state
    most = n_planes * capacity + spare, capacity + spare, capacity + spare if n_meshes else 1
    flat, curved, meshed = (
        st.new_wall_contacts(room, walls, capacity, capacity, rows) for room, walls in zip(most, n_walls, strict=True)
    )
    return flat, curved, meshed


def grown_pairs(old: Any, counts: Any, capacity: int, most_spheres: int, n_state: int) -> Any:
    """Return the lists of pairs with the same content, and twice the room where three quarters are used."""
    if most_spheres:
        return cl.grown_sphere_pairs(old, counts, most_spheres, capacity, n_state)
    n_pairs, n_near = counts[st.N_PAIRS], counts[st.N_NEAR]
    contacts = len(old.first) * (2 if n_pairs * 4 > len(old.first) * 3 else 1)
    near = len(old.near_limit) * (2 if n_near * 4 > len(old.near_limit) * 3 else 1)
    bigger = st.new_pairs(contacts, near, capacity, n_state)
    bigger.data[: len(old.data)] = old.data
    for name in ("first", "second"):
        getattr(bigger, name)[:n_pairs] = getattr(old, name)[:n_pairs]
    for name in ("near_first", "near_second", "near_limit", "near_normal"):
        getattr(bigger, name)[:n_near] = getattr(old, name)[:n_near]
    return bigger


def grown_wall_contacts(contacts: Any, used: int, ghost: int) -> Any:
    """Return the list with twice the room where three quarters are used; ghost: the body number of unused contacts."""
    if used * 4 <= len(contacts.body) * 3:
        return contacts
    rows = contacts.data.shape[1] // st.LANES
    n_walls, n_bodies = contacts.limit.shape
    bigger = st.new_wall_contacts(2 * len(contacts.body), n_walls, n_bodies, ghost, rows)
    bigger.limit[:] = contacts.limit
    bigger.deepest[:] = contacts.deepest
    for name in ("body", "wall", "feature"):
        getattr(bigger, name)[:used] = getattr(contacts, name)[:used]
    bigger.data[: len(contacts.data)] = contacts.data
    return bigger
