"""Compute the probability that mean responses lie near their targets.

(G92)  Genz 1992, Numerical computation of multivariate normal probabilities, J. Comput.
Graph. Stat. 1, 141
"""

import numpy as np
from scipy.special import ndtr, ndtri

# Points of the integral over all responses but one.
POINTS = 128
# Lower limit of a probability whose logarithm is taken.
LEAST = 1e-300


def probability_in_box(
    mean: np.ndarray, covariance: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Compute the probability that normal vectors lie in a box.

    The result is exact for one response; for two its error is below 0.001. With the
    Cholesky root L of the covariance, a vector is mean + L z, where the normal numbers z
    are independent. The probability can thus be integrated one response at a time (G92).
    The integral is estimated as a mean over a Sobol sequence.

    Parameters
    ----------
    mean : numpy.ndarray, (m, k)
    covariance : numpy.ndarray, (m, k, k)
    low, high : numpy.ndarray, (k,)
        Ends of the box.

    Returns
    -------
    numpy.ndarray, (m,)
    """
    from scipy.stats import qmc

    k = mean.shape[1]
    cholesky_root = np.linalg.cholesky(covariance)
    # Draw a column of uniform numbers for each response except the last. Shift all points
    # by half a step, because the first point of the sequence is 0.
    uniform = np.zeros((1, 0))
    if k > 1:
        uniform = qmc.Sobol(k - 1, scramble=False).random(POINTS) + 0.5 / POINTS
    # Axes: vectors, points of the sequence, responses.
    z = np.zeros((len(mean), len(uniform), k))
    probability = np.ones((len(mean), len(uniform)))
    for i in range(k):
        # Given the earlier responses, the mean of response i is shifted.
        shift = np.einsum("mj,mpj->mp", cholesky_root[:, i, :i], z[:, :, :i])
        sd = cholesky_root[:, i, i, None]
        # Distribution function at both ends, for each vector (rows) and point
        # (columns).
        below_low = ndtr((low[i] - mean[:, i, None] - shift) / sd)
        below_high = ndtr((high[i] - mean[:, i, None] - shift) / sd)
        probability *= below_high - below_low
        # Draw z inside the box, as the later responses depend on it.
        if i < k - 1:
            share = below_low + uniform[:, i] * (below_high - below_low)
            z[:, :, i] = ndtri(np.clip(share, 1e-16, 1 - 1e-16))
    return probability.mean(axis=1)
