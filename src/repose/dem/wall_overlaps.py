"""How deep bodies overlap walls, found when someone asks for it."""

from typing import Any

import numpy as np

from .kernels import state as st


def wall_overlaps(simulation: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Overlaps of all contacts with walls; see `Simulation.wall_overlaps`.

    Parameters
    ----------
    simulation : Simulation
        It is not changed.

    Returns
    -------
    bodies : ndarray (M,)
        Index of the body.
    walls : ndarray (M,)
        Number of the wall among the names of the simulation's walls.
    overlaps : ndarray (M,)
        The overlaps [m].

    Notes
    -----
    A wall is at a contact what its tangent plane is, n.x = c: the overlap of a body with support h and centre x is
    h(n) + n.x - c.
    """
    s = simulation
    n_planes, n_curved = len(s.walls.planes), len(s.walls.cones) + len(s.walls.rings)
    n = int(s.counts[st.N_PLANE])
    on_plane, plane = s._outer[s.flat.body[:n]], s.flat.wall[:n].astype(np.int64)
    normals = s.walls.planes[plane, 3:6]
    offsets = np.sum(normals * s.walls.planes[plane, :3], axis=1)
    flat = _beyond(s, on_plane, normals, offsets, s.flat.feature[:n])
    on_curved, curved_wall, normals, azimuths = s.curved_contacts()
    curved_wall = curved_wall.astype(np.int64)
    offsets = _tangent_planes(s.walls, curved_wall, normals, azimuths)
    curved = _beyond(s, on_curved, normals, offsets, s.curved.feature[: len(on_curved)])
    on_mesh, mesh, _, _, meshed = s.mesh_contacts()
    return (
        np.concatenate([on_plane, on_curved, on_mesh]).astype(np.int64),
        np.concatenate([plane, n_planes + curved_wall, n_planes + n_curved + mesh]).astype(np.int64),
        np.concatenate([flat, curved, meshed]),
    )


def _beyond(s, bodies, normals, offsets, spheres):
    """How far bodies, or one sphere of each clump, reach (M,) beyond planes of these normals and offsets."""
    reach = s._reach(bodies, normals, spheres if s._of_clumps else None)
    return reach + np.sum(normals * s.positions[bodies], axis=1) - offsets


def _tangent_planes(walls, wall, normals, azimuths):
    """Offsets (M,) of the tangent planes of cones, tubes and rings where bodies touch them."""
    n_cones = len(walls.cones)
    frames = walls.frames[wall]
    offsets = np.sum(normals * frames[:, :3], axis=1)
    on_cone = wall < n_cones
    offsets[on_cone] += walls.cones[wall[on_cone], 2]
    rings, turn = walls.rings[wall[~on_cone] - n_cones], azimuths[~on_cone]
    cores = np.column_stack([rings[:, 0] * np.cos(turn), rings[:, 0] * np.sin(turn), rings[:, 1]])
    cores = np.einsum("nij,nj->ni", frames[~on_cone, 3:].reshape(-1, 3, 3), cores)
    offsets[~on_cone] += np.sum(normals[~on_cone] * cores, axis=1) - rings[:, 2]
    return offsets
