"""Force and torque on the walls of a simulation, found when someone asks for them."""

from typing import Any, NamedTuple

import numpy as np

from .kernels.engine import add_wall_loads


class WallLoad(NamedTuple):
    """What the bodies do to a wall.

    Attributes
    ----------
    force_n : ndarray (3,)
        Sum of their forces [N].
    torque_n_m : ndarray (3,)
        Torque of these forces about a point, and of the rolling couples of a law that acts between two bodies [N m].
    """

    force_n: np.ndarray
    torque_n_m: np.ndarray


def wall_loads(simulation: Any, about_m: np.ndarray) -> dict[str, WallLoad]:
    """Loads of all walls; see `Simulation.wall_loads`.

    Parameters
    ----------
    simulation : Simulation
        It is not changed: the forces of its present state are found on copies of its arrays, with springs that stay.
    about_m : ndarray (3,)
        Point of the torques [m].

    Returns
    -------
    dict of str to WallLoad
        By the names of the walls.
    """
    s = simulation
    names = s.wall_set.names
    walls = s.walls._replace(loads=np.zeros((len(names), 6)))
    copies = [_copy(arrays) for arrays in (s.bodies, s.flat, s.curved, s.meshed, s.clumps)]
    scratch = s._tiles[0].copy(), s._scratches[0].copy()
    physics = s.physics._replace(dt=0.0)
    add_wall_loads(*copies, walls, s.meshes, s.counts.copy(), physics, *scratch, len(s.grid.cell))
    loads = {}
    for name, load in zip(names, walls.loads, strict=True):
        loads[name] = WallLoad(load[:3].copy(), load[3:] - np.cross(about_m, load[:3]))
    return loads


def _copy(arrays: Any) -> Any:
    """A named tuple with copies of its arrays; an empty tuple as it is."""
    return type(arrays)(*(np.copy(array) for array in arrays)) if arrays else arrays
