"""Find clusters of bodies that touch each other, such as a pile among loose grains."""

import numpy as np


def largest_cluster(contacts: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Find the largest set of bodies that contacts connect.

    Parameters
    ----------
    contacts : array
        Pairs of bodies (M, 2) that touch.
    allowed : array
        Mask (N,) of the bodies that may belong to the set.

    Returns
    -------
    array
        Mask (N,) of the set. If several sets have the largest size, it is the first. No
        body is marked if none is allowed.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n_bodies = len(allowed)
    if not allowed.any():
        return np.zeros(n_bodies, bool)
    # Keep the contacts between two allowed bodies.
    first, second = np.reshape(np.asarray(contacts, int), (-1, 2)).T
    is_kept = allowed[first] & allowed[second]
    edges = (first[is_kept], second[is_kept])
    graph = coo_array((np.ones(is_kept.sum()), edges), shape=(n_bodies, n_bodies))
    # Bodies of one connected component have the same label.
    _, labels = connected_components(graph, directed=False)
    largest_label = np.bincount(labels[allowed]).argmax()
    return allowed & (labels == largest_label)
