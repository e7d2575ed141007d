"""The path of steepest ascent: from the centre of a first-order design along its gradient."""

import numpy as np
from numpy.typing import ArrayLike


def direction(slopes: ArrayLike) -> np.ndarray:
    """Find the unit vector (k,) of steepest ascent, from the slopes (k,) of a first-order model in coded units."""
    slopes = np.asarray(slopes, dtype=float)
    length = np.linalg.norm(slopes)
    if not length > 0:
        raise ValueError(f"slopes {slopes.tolist()}; expected at least one slope other than 0")
    return slopes / length


def towards(slopes: ArrayLike, missing: ArrayLike, scale: ArrayLike) -> np.ndarray:
    """Find the unit vector (k,) along which several responses approach their targets fastest, in coded units.

    It is the steepest descent of the sum of the squared relative misses at the centre. `slopes` are (responses, k),
    `missing` is target minus response at the centre, `scale` the target over the root of its weight.
    """
    slopes, scale = np.atleast_2d(np.asarray(slopes, dtype=float)), np.asarray(scale, dtype=float)
    return direction((np.asarray(missing, dtype=float) / scale**2) @ slopes)


def path(along: ArrayLike, steps: int, largest: float = 1.0) -> np.ndarray:
    """Space points (steps + 1, k) at equal distances along a direction in coded units, the centre first."""
    if steps < 1:
        raise ValueError(f"{steps} steps; expected at least 1")
    along = np.asarray(along, dtype=float)
    return np.linspace(0.0, largest, steps + 1)[:, None] * (along / np.abs(along).max())
