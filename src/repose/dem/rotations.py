"""Rotation matrices of quaternions (w, x, y, z)."""

import numpy as np
from numpy.typing import ArrayLike


def rotation_matrices(quaternions: ArrayLike) -> np.ndarray:
    """Rotations body to world (N, 3, 3) of quaternions (N, 4); normalised here."""
    q = np.asarray(quaternions, dtype=float)
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def rotation_matrix(quaternion: ArrayLike) -> np.ndarray:
    """Rotation body to world (3, 3) of one quaternion (4,)."""
    return rotation_matrices(np.asarray(quaternion, dtype=float)[None])[0]


def random_quaternion(rng: np.random.Generator) -> np.ndarray:
    """A uniformly random orientation (w, x, y, z) of a generator of numpy."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)
