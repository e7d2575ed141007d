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


def path(along: np.ndarray, steps: int, start: np.ndarray | None = None) -> np.ndarray:
    """Space points (steps + 1, k) evenly from a start to the edge of the cube.

    Parameters
    ----------
    along : array (k,)
        The direction.
    steps : int
    start : array (k,), optional
        A point inside the cube; by default its centre.
    """
    if start is None:
        start = np.zeros(len(along))
    # The first factor at an end of its range ends the path.
    parts = np.abs(along) / (1 - np.sign(along) * start)
    return start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (along / parts.max())
