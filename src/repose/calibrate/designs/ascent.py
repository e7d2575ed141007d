"""The path of steepest ascent: from the centre of a first-order design along its gradient."""

import numpy as np


def towards(slopes: np.ndarray, missing: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Find the unit vector (k,) along which several responses approach their targets fastest, in coded units.

    It is the steepest descent of the sum of the squared relative misses at the centre. `slopes` (responses, k) are of
    first-order models, `missing` is target less response at the centre, `scale` the target over the root of its weight.
    """
    along = (missing / scale**2) @ slopes
    length = np.linalg.norm(along)
    if not length > 0:
        raise ValueError(
            f"slopes {along.tolist()}; expected at least one slope other than 0"
        )
    return along / length


def path(along: np.ndarray, steps: int) -> np.ndarray:
    """Space points (steps + 1, k) at equal distances from the centre to the edge of the cube, along a direction."""
    return np.linspace(0.0, 1.0, steps + 1)[:, None] * (along / np.abs(along).max())
