"""Probability that mean responses lie within a tolerance of the targets.

(G92)  Genz 1992, Numerical computation of multivariate normal probabilities, J. Comput. Graph. Stat. 1, 141
"""

import numpy as np
from scipy.special import ndtr, ndtri

POINTS = 128  # of the integral over all but one response
LEAST = 1e-300


def within(
    mean: np.ndarray, covariance: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Compute the probability (m,) that normal vectors (m, k) of covariance (m, k, k) lie in the box low to high (k,).

    Exact for one response; for two its error is below 0.001 (G92).
    """
    from scipy.stats import qmc

    k = mean.shape[1]
    root = np.linalg.cholesky(covariance)
    # one column of numbers for each response but the last; the first word of the sequence is 0
    u = (
        qmc.Sobol(k - 1, scramble=False).random(POINTS) + 0.5 / POINTS
        if k > 1
        else np.zeros((1, 0))
    )
    drawn = np.zeros((len(mean), len(u), k))
    total = np.ones((len(mean), len(u)))
    for i in range(k):
        shift = np.einsum("mj,mpj->mp", root[:, i, :i], drawn[:, :, :i])
        a = ndtr((low[i] - mean[:, i, None] - shift) / root[:, i, i, None])
        b = ndtr((high[i] - mean[:, i, None] - shift) / root[:, i, i, None])
        total *= b - a
        if i < k - 1:
            drawn[:, :, i] = ndtri(np.clip(a + u[:, i] * (b - a), 1e-16, 1 - 1e-16))
    return total.mean(axis=1)
