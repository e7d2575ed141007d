"""The path of steepest ascent from the centre of a first-order design."""

import numpy as np


def compute_ascent_direction(
    slopes: np.ndarray, shortfall: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """Compute the direction in which several responses approach their targets fastest.

    It is the direction of steepest descent of the sum of the squared scaled deviations,
    at the centre.

    Parameters
    ----------
    slopes : array (responses, k)
        Slopes of the first-order models of the responses, in coded units.
    shortfall : array (responses,)
        Target minus response at the centre.
    scale : array (responses,)
        The target divided by the root of its weight.

    Returns
    -------
    array (k,)
        A unit vector in coded units.

    Raises
    ------
    ValueError
        If no slope leads towards the targets.
    """
    gradient = (shortfall / scale**2) @ slopes
    length = np.linalg.norm(gradient)
    if not length > 0:
        raise ValueError(
            f"slopes {gradient.tolist()}; expected at least one slope other than 0"
        )
    return gradient / length


def make_ascent_path(
    direction: np.ndarray, steps: int, start: np.ndarray | None = None
) -> np.ndarray:
    """Space points (steps + 1, k) evenly from a start to the edge of the cube.

    Parameters
    ----------
    direction : array (k,)
        Direction of the path in coded units.
    steps : int
        Number of steps from the start to the edge.
    start : array (k,), optional
        A point inside the cube; by default its centre.
    """
    if start is None:
        start = np.zeros(len(direction))
    # The distance of the start from the edge at 1 or -1, along each factor, is
    # 1 - sign * start. The path ends where the first factor reaches its edge.
    parts = np.abs(direction) / (1 - np.sign(direction) * start)
    return start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (direction / parts.max())
