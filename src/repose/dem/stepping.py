"""Time steps of a simulation up to the next growth of its lists, and what has to be done between."""

from typing import TYPE_CHECKING

import numpy as np

from . import contact_lists
from .kernels import clumps as cl
from .kernels import parallel
from .kernels import state as st
from .kernels.atomics import BARRIER_SIZE
from .kernels.engine import advance
from .kernels.order import reorder

if TYPE_CHECKING:
    from .simulation import Simulation


def advance_some(simulation: "Simulation", steps: int) -> int:
    """Advance a simulation by some steps, fewer where a list has to grow.

    Parameters
    ----------
    simulation : Simulation
        That is advanced.
    steps : int
        The most steps.

    Returns
    -------
    int
        The steps made.
    """
    lists = (simulation.bodies, simulation.pairs, simulation.flat, simulation.curved, simulation.meshed)
    world = (simulation.grid, simulation.walls, simulation.meshes, simulation.counts, simulation.physics)
    if not simulation._shared:
        scratch = (simulation._tiles[0], simulation._body_tiles[0], simulation._scratches[0])
        return advance(*lists, simulation.clumps, *world, *scratch, steps)
    if simulation.steps % parallel.REORDER_EVERY == 0:
        renumber(simulation)
    steps = min(steps, parallel.REORDER_EVERY - simulation.steps % parallel.REORDER_EVERY)
    shared = st.Shared(
        counters=np.zeros(BARRIER_SIZE, np.int64),
        orders=np.zeros(1, np.int64),
        begins=np.zeros(parallel.SHARES, np.int64),
        numbers=np.zeros(parallel.SHARES, np.int64),
        due=np.zeros(len(simulation.pairs.near_limit), np.int64),
    )
    tiles = (simulation._tiles, simulation._body_tiles, simulation._scratches)
    return parallel.run_threads((*lists, *world), tiles, shared, steps)


def renumber(simulation: "Simulation") -> None:
    """Number the bodies in the order of space; what users see keeps their numbers.

    Parameters
    ----------
    simulation : Simulation
        Of smooth bodies, with threads.
    """
    s, n = simulation, simulation.n_bodies
    order = reorder(s.bodies, s.grid, s.pairs, s.flat, s.curved, s.meshed, s.counts)
    s._outer[:n] = s._outer[:n][order]
    s._inner[s._outer[:n]] = np.arange(n)


def grow(simulation: "Simulation") -> None:
    """Double the lists that are filling up; each in one move, or an interrupt could leave half of one.

    Parameters
    ----------
    simulation : Simulation
        Whose lists they are.
    """
    s, counts, capacity = simulation, simulation.counts, simulation.capacity
    s.pairs = contact_lists.grown_pairs(s.pairs, counts, capacity, s._most_spheres, s._n_state)
    s.flat = contact_lists.grown_wall_contacts(s.flat, counts[st.N_PLANE], capacity)
    s.curved = contact_lists.grown_wall_contacts(s.curved, counts[st.N_CURVED], capacity)
    meshed = contact_lists.grown_wall_contacts(s.meshed, counts[st.N_MESHED], capacity)
    if s._of_clumps:
        s.clumps = cl.with_room(s.clumps, len(meshed.body))
    s.meshed = meshed
