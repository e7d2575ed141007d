"""Compute the probability that mean responses lie near their targets.

(G92)  Genz 1992, Numerical computation of multivariate normal probabilities, J. Comput.
Graph. Stat. 1, 141
"""

import numpy as np
from scipy.special import ndtr, ndtri

# Number of points with which the integral over all responses but one is estimated.
N_POINTS = 128
# Lower limit of a probability, so that its logarithm is finite.
MIN_PROBABILITY = 1e-300
# Probabilities of a normal distribution are kept this far away from 0 and 1, where its
# quantiles are infinite.
SMALLEST_FRACTION = 1e-16


def compute_box_probability(
    mean: np.ndarray, covariance: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Compute the probability that normal vectors lie in a box.

    With the Cholesky root L of the covariance, a vector is mean + L z, where z are
    independent standard normal numbers. This allows integrating over one response at a
    time (G92). The integral is estimated as a mean over a Sobol sequence. It is exact
    for one response. For two responses its error is below 0.001.

    Parameters
    ----------
    mean : numpy.ndarray, (m, k)
        Means of m normal vectors.
    covariance : numpy.ndarray, (m, k, k)
        Covariances of the vectors.
    low, high : numpy.ndarray, (k,)
        Ends of the box.

    Returns
    -------
    numpy.ndarray, (m,)
        The probability for each vector.
    """
    from scipy.stats import qmc

    k = mean.shape[1]
    cholesky_root = np.linalg.cholesky(covariance)
    # Draw a column of uniform numbers for each response except the last. Shift all
    # points by half a step, because the first point of the sequence is 0.
    uniform = np.zeros((1, 0))
    if k > 1:
        uniform = qmc.Sobol(k - 1, scramble=False).random(N_POINTS) + 0.5 / N_POINTS
    # Axes: vectors, points of the sequence, responses.
    z = np.zeros((len(mean), len(uniform), k))
    probability = np.ones((len(mean), len(uniform)))
    for i in range(k):
        # Given the earlier responses, the mean of response i is shifted.
        shift = np.einsum("mj,mpj->mp", cholesky_root[:, i, :i], z[:, :, :i])
        sd = cholesky_root[:, i, i, None]
        # Compute the distribution function at both ends of the box, (vectors, points).
        below_low = ndtr((low[i] - mean[:, i, None] - shift) / sd)
        below_high = ndtr((high[i] - mean[:, i, None] - shift) / sd)
        probability *= below_high - below_low
        # Draw z inside the box, because the later responses depend on it.
        if i < k - 1:
            share = below_low + uniform[:, i] * (below_high - below_low)
            z[:, :, i] = ndtri(np.clip(share, SMALLEST_FRACTION, 1 - SMALLEST_FRACTION))
    return probability.mean(axis=1)
