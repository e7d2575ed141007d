"""Compute the evidence of a trained network, and the covariance of its weights.

  (M92)  MacKay 1992, Bayesian interpolation / A practical Bayesian framework, Neural
         Computation 4

Symbols: E_d is the sum of the n squared residuals, and E_w is the sum of the N squared
weights. The noise variance is 1 / (2 beta), and the prior variance of a weight is
1 / (2 alpha). If the weights form several classes, each with its own alpha
(`two_layer.list_weight_classes`), alpha and E_w are vectors, and alpha E_w is their
scalar product.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

NumberPerClass = float | np.ndarray  # one number for all weights, or one for each class


def compute_log_evidence(
    alpha: NumberPerClass,
    beta: float,
    Ed: float,
    Ew: NumberPerClass,
    JJ: np.ndarray,
    n: float,
    classes: Sequence[Any] = (slice(None),),
) -> float:
    """Compute the log evidence of a network at its most probable weights.

    The evidence is the probability of the data, integrated over all weights (MacKay
    1992). The likelihood is (beta / pi)^(n / 2) exp(-beta E_d), and the prior of the
    weights is (alpha / pi)^(N / 2) exp(-alpha E_w). Laplace's approximation of the
    integral contributes (2 pi)^(N / 2) / sqrt(det H) with H = 2 beta J'J + 2 alpha I.
    The powers of pi in this factor and in the prior cancel, so

        log p(D | alpha, beta) = n/2 log(beta / pi) + N/2 log(2 alpha)
                                 - 1/2 log det H - beta E_d - alpha E_w

    If the weights form several classes, each class has its own alpha, and
    N/2 log(2 alpha) is summed over the classes.

    Parameters
    ----------
    alpha, Ew : float or array (classes,)
        Regularisation of the weights of each class, and the sum of their squares.
    beta, Ed : float
        Inverse of twice the noise variance, and the sum of the squared residuals.
    JJ : array (N, N)
        J'J, where J has the derivatives of the weighted residuals with respect to the
        weights.
    n : float
        Number of residuals. It need not be an integer, because samples have weights.
    classes : sequence
        Indices of the weights of each class, as arrays or slices; by default, all
        weights are in a single class.

    Returns
    -------
    float
        It is -inf if the evidence cannot be computed, or is not finite.
    """
    alpha = np.atleast_1d(alpha)
    Ew = np.atleast_1d(Ew)
    if not (np.all(alpha > 0) and beta > 0):
        return -math.inf
    N = len(JJ)
    # This is N/2 log(2 alpha), with the number of weights of each class as N. A class
    # may be a slice, so apply it to an array to count its weights.
    weight_numbers = np.arange(N)
    log_prior = sum(
        len(weight_numbers[members]) / 2 * math.log(2 * value)
        for value, members in zip(alpha, classes, strict=True)
    )
    hessian = 2 * beta * JJ + np.diag(2 * spread_over_weights(alpha, classes, N))
    _, log_det = np.linalg.slogdet(hessian)
    evidence = (
        n / 2 * math.log(beta / math.pi)
        + log_prior
        - log_det / 2
        - beta * Ed
        - alpha @ Ew
    )
    return float(evidence) if math.isfinite(evidence) else -math.inf


def compute_posterior_root(
    alpha: np.ndarray, beta: float, JJ: np.ndarray
) -> np.ndarray:
    """Compute a matrix R (N, N) with R R' = H^-1, the covariance of the weights.

    H = 2 beta J'J + 2 diag(alpha), where alpha (N,) has a value for each weight (MacKay
    1992). H is first multiplied by the prior standard deviations of the weights on both
    sides. This makes it I + V diag(e) V' with eigenvalues e >= 0, so rounding cannot
    make a variance negative.
    """
    prior_std = 1 / np.sqrt(2 * alpha)
    eigenvalues, vectors = np.linalg.eigh(
        2 * beta * prior_std[:, None] * JJ * prior_std
    )
    return prior_std[:, None] * vectors / np.sqrt(1 + np.maximum(eigenvalues, 0.0))


def spread_over_weights(
    alpha: np.ndarray, classes: Sequence[Any], N: int
) -> np.ndarray:
    """Return the alpha (N,) of each weight, which is the alpha of its class."""
    alpha_of_weight = np.empty(N)
    for value, members in zip(alpha, classes, strict=True):
        alpha_of_weight[members] = value
    return alpha_of_weight
