"""Compute rotation matrices of quaternions (w, x, y, z), and directions in space."""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

Number = TypeVar("Number", float, np.ndarray)


def rotation_matrices(quaternions: ArrayLike) -> np.ndarray:
    """Compute rotation matrices of quaternions.

    Parameters
    ----------
    quaternions : array_like (N, 4)
        Quaternions (w, x, y, z) of any length but 0, which are normalised here.

    Returns
    -------
    ndarray (N, 3, 3)
        Rotations from the body's frame to the world's.
    """
    q = np.asarray(quaternions, dtype=float)
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return np.moveaxis(np.array(_compute_matrix_rows(w, x, y, z)), 2, 0)


def _compute_matrix_rows(
    w: Number, x: Number, y: Number, z: Number
) -> list[list[Number]]:
    """Compute the rows of the rotation matrix of a unit quaternion (w, x, y, z).

    If the components are arrays, each entry of the matrix is an array.
    """
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def rotation_matrix(quaternion: ArrayLike) -> np.ndarray:
    """Compute the rotation matrix of one quaternion.

    Parameters
    ----------
    quaternion : array_like (4,)
        Quaternion (w, x, y, z) of any length but 0, which is normalised here.

    Returns
    -------
    ndarray (3, 3)
        Rotation from the body's frame to the world's.
    """
    q = np.asarray(quaternion, dtype=float)
    w, x, y, z = (q / np.linalg.norm(q)).tolist()
    return np.array(_compute_matrix_rows(w, x, y, z))


def random_quaternion(rng: np.random.Generator) -> np.ndarray:
    """Draw a uniformly random orientation.

    Parameters
    ----------
    rng : numpy.random.Generator
        Generator from which four normally distributed numbers are drawn.

    Returns
    -------
    ndarray (4,)
        A unit quaternion (w, x, y, z).
    """
    # The direction of a vector of four independent normally distributed numbers is
    # uniform on the unit sphere.
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def sphere_directions(count: int) -> np.ndarray:
    """Return unit vectors (count, 3) that are evenly spread: a Fibonacci lattice."""
    index = np.arange(count)
    # Equal steps of z give equal areas, and the azimuth grows by the golden angle.
    z = 1 - (2 * index + 1) / count
    azimuth = index * math.pi * (3 - math.sqrt(5))
    radius = np.sqrt(1 - z**2)  # distance from the z axis
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)
