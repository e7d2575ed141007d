"""Frames of a simulation: where everything was, for animations and analyses."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from .whole import write_whole

if TYPE_CHECKING:
    from ..simulation import Simulation


class Recorder:
    """Keeps the state of a simulation each time it is called with it; see `Simulation.run(record=...)`."""

    def __init__(self) -> None:
        self._frames: list[tuple] = []
        self._shapes, self._scales = np.zeros(0, np.int32), np.zeros(0)

    def __call__(self, simulation: "Simulation") -> None:
        """Keep a frame.

        Parameters
        ----------
        simulation : Simulation
            The simulation.
        """
        there = simulation.present[:, None]
        self._shapes, self._scales = (
            simulation.shape_ids.copy(),
            simulation.scales.copy(),
        )
        position = np.where(there, simulation.positions, np.nan).astype(np.float32)
        quaternion = np.where(there, simulation.quaternions, np.nan).astype(np.float32)
        walls = simulation.walls.planes.copy(), simulation.walls.frames.copy()
        self._frames.append((simulation.time_s, position, quaternion, *walls))

    def __len__(self) -> int:
        """Count the frames that were kept."""
        return len(self._frames)

    def frames(self) -> dict[str, np.ndarray]:
        """Return what was kept, as arrays of T frames of N bodies.

        Returns
        -------
        dict of str to ndarray
            time_s (T,) [s]; position (T, N, 3) [m] and quaternion (T, N, 4), in single precision, NaN where a body is
            not there; shape (N,), the place among the names of the shapes; scale (N,); planes (T, P, 7) and
            wall_frames (T, C, 12), the walls as the kernels have them (`repose.dem.kernels.state`).
        """
        n = len(self._scales)
        positions = np.full((len(self._frames), n, 3), np.nan, np.float32)
        quaternions = np.full((len(self._frames), n, 4), np.nan, np.float32)
        for k, (_time, position, quaternion, _planes, _wall_frames) in enumerate(
            self._frames
        ):
            positions[k, : len(position)] = position
            quaternions[k, : len(quaternion)] = quaternion
        return {
            "time_s": np.array([frame[0] for frame in self._frames]),
            "position": positions,
            "quaternion": quaternions,
            "shape": self._shapes,
            "scale": self._scales,
            "planes": np.array([frame[3] for frame in self._frames]),
            "wall_frames": np.array([frame[4] for frame in self._frames]),
        }

    def save(self, path: str | os.PathLike) -> None:
        """Write the frames to a .npz file, in one move.

        Parameters
        ----------
        path : path
            The file.
        """
        frames: Any = self.frames()
        write_whole(path, lambda handle: np.savez_compressed(handle, **frames))
