"""The path of steepest ascent from the centre of a first-order design."""

import numpy as np


def ascent_direction(
    slopes: np.ndarray, missing: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """Compute the direction in which several responses approach their targets fastest.

    It is the steepest descent of the sum of the squared scaled deviations at the
    centre.

    Parameters
    ----------
    slopes : array (responses, k)
        Of first-order models, in coded units.
    missing : array (responses,)
        Target minus response at the centre.
    scale : array (responses,)
        The target over the root of its weight.

    Returns
    -------
    array (k,)
        A unit vector in coded units.

    Raises
    ------
    ValueError
        If no slope leads towards the targets.
    """
    gradient = (missing / scale**2) @ slopes
    length = np.linalg.norm(gradient)
    if not length > 0:
        raise ValueError(
            f"slopes {gradient.tolist()}; expected at least one slope other than 0"
        )
    return gradient / length


def path(along: np.ndarray, steps: int) -> np.ndarray:
    """Space points (steps + 1, k) evenly from the centre to the edge of the cube.

    `along` (k,) is the direction.
    """
    edge = along / np.abs(along).max()
    return np.linspace(0.0, 1.0, steps + 1)[:, None] * edge
