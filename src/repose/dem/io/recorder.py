"""Record frames of a simulation: the positions of bodies and walls at some times."""

import os
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .whole import write_whole

if TYPE_CHECKING:
    from ..observables import Observables


class Frame(NamedTuple):
    """The bodies and walls at one time."""

    time_s: float
    positions: np.ndarray  # (N, 3) [m], NaN for a body that is not present
    quaternions: np.ndarray  # (N, 4), also NaN for such a body
    planes: np.ndarray  # (P, 7), the walls in the form that the kernels use
    wall_frames: np.ndarray  # (C, 12)


class Recorder:
    """Records the state of a simulation each time it is called with the simulation.

    It can be passed to `Simulation.run` as the argument `record`.
    """

    def __init__(self) -> None:
        self._frames: list[Frame] = []
        # Shapes and scales of all bodies of the last frame
        self._shapes = np.zeros(0, np.int32)
        self._scales = np.zeros(0)

    def __call__(self, simulation: "Observables") -> None:
        """Record the present state as a frame.

        Parameters
        ----------
        simulation : Simulation
            The simulation.
        """
        # Shapes and scales do not change, and bodies are never taken out of the list.
        # So the last frame has those of all bodies, and earlier ones are overwritten.
        self._shapes = simulation.shape_ids.copy()
        self._scales = simulation.scales.copy()
        # A body that has fallen below the floor is no longer present, and its position
        # is not defined.
        present = simulation.present[:, None]
        positions = np.where(present, simulation.positions, np.nan)
        quaternions = np.where(present, simulation.quaternions, np.nan)
        frame = Frame(
            time_s=simulation.time_s,
            positions=positions.astype(np.float32),
            quaternions=quaternions.astype(np.float32),
            planes=simulation.walls.planes.copy(),
            wall_frames=simulation.walls.frames.copy(),
        )
        self._frames.append(frame)

    def __len__(self) -> int:
        """Return the number of recorded frames."""
        return len(self._frames)

    def frames(self) -> dict[str, np.ndarray]:
        """Return the recorded frames as arrays, for T frames of N bodies.

        Returns
        -------
        dict of str to ndarray
            The arrays by name. ``time_s`` (T,) has the simulated times [s].
            ``position`` (T, N, 3) [m] and ``quaternion`` (T, N, 4) are in single
            precision, and NaN for a body that is not present. ``shape`` (N,) is the
            index among the names of the shapes, and ``scale`` (N,) the scale of each
            body. ``planes`` (T, P, 7) and ``wall_frames`` (T, C, 12) are the P planes
            and the C other walls in the form that the kernels use, with the columns
            that `repose.dem.kernels.state` names.
        """
        n_frames = len(self._frames)
        # Bodies are only added, so the last frame has the most.
        n_bodies = len(self._scales)
        positions = np.full((n_frames, n_bodies, 3), np.nan, np.float32)
        quaternions = np.full((n_frames, n_bodies, 4), np.nan, np.float32)
        for k, frame in enumerate(self._frames):
            # An early frame may have fewer bodies. The others are appended later, so
            # their rows stay NaN here.
            n_added = len(frame.positions)
            positions[k, :n_added] = frame.positions
            quaternions[k, :n_added] = frame.quaternions
        return {
            "time_s": np.array([frame.time_s for frame in self._frames]),
            "position": positions,
            "quaternion": quaternions,
            "shape": self._shapes,
            "scale": self._scales,
            "planes": np.array([frame.planes for frame in self._frames]),
            "wall_frames": np.array([frame.wall_frames for frame in self._frames]),
        }

    def save(self, path: str | os.PathLike) -> None:
        """Write the frames to a .npz file, which is either complete or absent.

        Parameters
        ----------
        path : path
            The file.
        """
        frames: Any = self.frames()
        write_whole(path, lambda handle: np.savez_compressed(handle, **frames))
