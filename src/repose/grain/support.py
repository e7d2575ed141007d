"""The support function of a sum of co-axial ellipsoids: its extent in a direction from its centre."""

import numpy as np


def component_supports(semi_axes: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Support values (..., K) of components with half axes (K, 3) in the directions n (..., 3); one unit of length."""
    return np.sqrt(np.square(n) @ np.square(semi_axes).T)


def support(semi_axes: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Support values (...) of the sum of components with half axes (K, 3) in the directions n (..., 3)."""
    return component_supports(semi_axes, n).sum(axis=-1)


def support_point(semi_axes: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Touching points (..., 3): the gradient of the support function, sum over components of s^2 n / h_k."""
    return n * ((1.0 / component_supports(semi_axes, n)) @ np.square(semi_axes))
