"""Compute the support function of a body that is a sum of co-axial ellipsoids.

The value of this function is the extent of the body from its centre in a direction.
"""

import numpy as np


def component_supports(semi_axes: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Compute the support value of each ellipsoid alone: (..., K) values.

    Parameters
    ----------
    semi_axes : ndarray
        Half axes (K, 3) of the ellipsoids.
    n : ndarray
        Directions (..., 3).

    Returns
    -------
    ndarray
        The values, in the unit of the half axes.
    """
    return np.sqrt(np.square(n) @ np.square(semi_axes).T)


def support(semi_axes: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Compute the support values (...) of the body, the sum over its ellipsoids.

    Parameters
    ----------
    semi_axes : ndarray
        Half axes (K, 3) of the ellipsoids.
    n : ndarray
        Directions (..., 3).

    Returns
    -------
    ndarray
        The values, in the unit of the half axes.
    """
    return component_supports(semi_axes, n).sum(axis=-1)


def support_point(semi_axes: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Compute the points (..., 3) at which planes with the normals n touch the body.

    Such a point is the gradient of the support function. It is the sum of s_k^2 n / h_k
    over the ellipsoids k, with their half axes s_k and support values h_k.

    Parameters
    ----------
    semi_axes : ndarray
        Half axes s_k (K, 3) of the ellipsoids.
    n : ndarray
        Outward normals (..., 3) of the planes.
    """
    inverse_supports = 1.0 / component_supports(semi_axes, n)
    return n * (inverse_supports @ np.square(semi_axes))
