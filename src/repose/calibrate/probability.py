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
MIN_TAIL = 1e-16


def compute_box_probability(
    mean: np.ndarray, covariance: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Compute the probability that normal vectors lie in a box.

    With the Cholesky factor L of the covariance, a vector is mean + L z, where z are
    independent standard normal numbers. This allows treating one response at a time
    (Genz 1992): the probability that it lies inside the box, given the responses before
    it. The product of these probabilities is averaged over draws of the responses,
    which come from a Sobol sequence. The result is exact for one response. For two
    responses its error is below 0.001 with the present `N_POINTS`.

    Parameters
    ----------
    mean : numpy.ndarray, (m, k)
        Means of m normal vectors.
    covariance : numpy.ndarray, (m, k, k)
        Covariances of the vectors.
    low, high : numpy.ndarray, (k,)
        Lower and upper bounds of the box.

    Returns
    -------
    numpy.ndarray, (m,)
        The probability for each vector.
    """
    from scipy.stats import qmc

    k = mean.shape[1]
    L = np.linalg.cholesky(covariance)
    # Draw a column of uniform numbers for each response except the last, which is not
    # drawn. Shift all points by half a step, because the first point of the sequence is
    # 0, which has no normal quantile.
    uniform = np.zeros((1, 0))
    if k > 1:
        uniform = qmc.Sobol(k - 1, scramble=False).random(N_POINTS) + 0.5 / N_POINTS
    # The axes are the vectors, the points of the sequence, and for z the responses.
    z = np.zeros((len(mean), len(uniform), k))
    probability = np.ones((len(mean), len(uniform)))
    for i in range(k):
        # Given the earlier responses, the mean of response i is shifted, and its
        # standard deviation is the diagonal element of L.
        shift = np.einsum("mj,mpj->mp", L[:, i, :i], z[:, :, :i])
        sd = L[:, i, i, None]
        # Compute the probabilities that response i lies below each bound.
        below_low = ndtr((low[i] - mean[:, i, None] - shift) / sd)
        below_high = ndtr((high[i] - mean[:, i, None] - shift) / sd)
        probability *= below_high - below_low
        # The later responses depend on z_i. Draw it from the part of the normal
        # distribution inside the box: choose a probability between both, and take its
        # quantile.
        if i < k - 1:
            quantile_level = below_low + uniform[:, i] * (below_high - below_low)
            z[:, :, i] = ndtri(np.clip(quantile_level, MIN_TAIL, 1 - MIN_TAIL))
    return probability.mean(axis=1)
