"""Central composite designs: a two-level factorial, two axial runs for each factor, and centre runs."""

import numpy as np

from repose.calibrate.designs.coding import two_level

HALF_FROM = 5  # factors, from which on the factorial is the half fraction


def central_composite(
    factors: int, axial: str, centres: int
) -> tuple[np.ndarray, float]:
    """Make a central composite design (n, factors) in coded units, in standard order, and give its axial distance.

    `factors` is 2 to 7. For `axial` "rotatable" the distance is the fourth root of the number of factorial runs, so
    that the variance of a prediction depends on its distance from the centre alone; for "face_centred" it is 1, with
    only three levels. Box and Hunter, Multi-factor experimental designs for exploring response surfaces, Ann. Math.
    Statist. 28 (1957) 195-241.
    """
    corners = two_level(factors if factors < HALF_FROM else factors - 1)
    if factors >= HALF_FROM:
        corners = np.column_stack([corners, corners.prod(axis=1)])
    alpha = len(corners) ** 0.25 if axial == "rotatable" else 1.0
    star = alpha * np.kron(np.eye(factors), np.array([[-1.0], [1.0]]))
    return np.vstack([corners, star, np.zeros((centres, factors))]), alpha
