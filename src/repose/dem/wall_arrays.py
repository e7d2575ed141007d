"""Walls from the words of a user to the arrays of the kernels."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .kernels import state as st
from .mesh_wall import Mesh
from .surfaces import Cone, Plane, RingEdge, frame_of

HOME = np.concatenate([np.zeros(3), np.eye(3).ravel()])  # the frame that is the world


def wall_arrays(
    wall_set: Any, kinds: Mapping[str, int], size_m: float, old: st.Walls | None = None, changed: int = -1
) -> st.Walls:
    """The walls as the kernels take them.

    Parameters
    ----------
    wall_set : WallSet
        The named walls.
    kinds : mapping of int
        Number of each material by its name.
    size_m : float
        Of the box the bodies stay in.
    old : state.Walls, optional
        Arrays of the same walls, whose places are taken over.
    changed : int, optional
        Number of the wall that has another motion than there; -1 for none.

    Returns
    -------
    state.Walls
        The arrays.
    """
    planes, cones, rings, meshes = (wall_set.of(kind) for kind in (Plane, Cone, RingEdge, Mesh))
    surfaces = [*planes, *cones, *rings, *meshes]
    flat = np.array([wall.row() for wall in planes]).reshape(-1, st.PLANE_COLUMNS)
    frames = np.array([frame_of(surface) for surface in (*cones, *rings, *meshes)]).reshape(-1, 12)
    if old is not None:
        flat, frames = old.planes.copy(), old.frames.copy()
    motion = np.array([surface.motion.row() for surface in surfaces]).reshape(-1, 9)
    if old is not None:
        # the pivots of the other walls stay where their motion has brought them
        others = np.arange(len(motion)) != changed
        motion[others] = old.motion[others]
    moves = np.any(motion[:, :6] != 0.0, axis=1)
    axes = [*flat[:, 3:6], *frames[:, 3:].reshape(-1, 3, 3)[:, :, 2]]
    places = [*flat[:, :3], *frames[:, :3]]
    speeds = [_approach(*wall, size_m) for wall in zip(surfaces, axes, places, motion, strict=True)]
    displaced = np.any(frames != HOME, axis=1) | moves[len(planes) :]
    path = 0.0 if old is None else old.approach[st.WALL_PATH]
    return st.Walls(
        planes=flat,
        cones=np.array([wall.row() for wall in cones]).reshape(-1, st.CONE_COLUMNS),
        rings=np.array([wall.row() for wall in rings]).reshape(-1, st.RING_COLUMNS),
        frames=frames,
        displaced=(displaced if old is None else displaced | (old.displaced > 0)).astype(np.uint8),
        motion=motion,
        moves=moves.astype(np.uint8),
        material=np.array([kinds[s.material] for s in surfaces], np.uint8),
        approach=np.array([path, max(speeds, default=0.0), float(moves.any())]),
        loads=np.zeros((0, 6)),
    )


def _approach(surface, axis, place, motion, size_m):
    """How fast any point of a wall may come nearer to a body [m/s]; nothing for one that turns about its own axis.

    axis, place: of the wall now; a plane's normal and middle, else the axis and origin of its frame.
    """
    velocity, turning, pivot = motion[:3], motion[3:6], motion[6:]
    speed = float(np.linalg.norm(velocity))
    rate = float(np.linalg.norm(turning))
    if rate == 0.0:
        return speed
    offset = place - pivot
    if isinstance(surface, Mesh):
        # vertices are told in the mesh's frame: no farther from the pivot than its origin and they from the origin
        reach = np.linalg.norm(surface.vertices_m, axis=1).max()
        return speed + rate * float(reach + np.linalg.norm(offset))
    aligned = abs(abs(axis @ turning) - rate) < 1e-12 * rate
    if aligned and np.linalg.norm(offset - (offset @ axis) * axis) < 1e-9 * size_m:
        return speed
    return speed + rate * float(size_m + np.linalg.norm(offset))
