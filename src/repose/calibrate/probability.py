"""Probability that mean responses lie within a tolerance of the targets.

(G92)  Genz 1992, Numerical computation of multivariate normal probabilities, J. Comput. Graph. Stat. 1, 141
"""

import numpy as np
from scipy.special import ndtr, ndtri

# Points of the integral over all responses but one.
POINTS = 128
# Lower limit of a probability whose logarithm is taken.
LEAST = 1e-300


def within(
    mean: np.ndarray, covariance: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Compute the probability that normal vectors lie in a box.

    It is exact for one response; for two its error is below 0.001 (G92).

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
    root = np.linalg.cholesky(covariance)
    # A column of uniform numbers for each response but the last. The first point of the
    # sequence is 0, so all are shifted by half a step.
    u = np.zeros((1, 0))
    if k > 1:
        u = qmc.Sobol(k - 1, scramble=False).random(POINTS) + 0.5 / POINTS
    drawn = np.zeros((len(mean), len(u), k))
    total = np.ones((len(mean), len(u)))
    for i in range(k):
        # The response i is normal, given the drawn responses before it.
        shift = np.einsum("mj,mpj->mp", root[:, i, :i], drawn[:, :, :i])
        below_low = ndtr((low[i] - mean[:, i, None] - shift) / root[:, i, i, None])
        below_high = ndtr((high[i] - mean[:, i, None] - shift) / root[:, i, i, None])
        total *= below_high - below_low
        if i < k - 1:
            share = below_low + u[:, i] * (below_high - below_low)
            drawn[:, :, i] = ndtri(np.clip(share, 1e-16, 1 - 1e-16))
    return total.mean(axis=1)
