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
    """Compute the log evidence of a network at its most probable weights (M92).

    The likelihood is (beta / pi)^(n / 2) exp(-beta E_d), the prior of the weights
    (alpha / pi)^(N / 2) exp(-alpha E_w). Laplace's approximation gives, with
    H = 2 beta J'J + 2 alpha I,

        log p(D | alpha, beta) = n/2 log(beta / pi) + N/2 log(2 alpha)
                                 - 1/2 log det H - beta E_d - alpha E_w

    With several classes, N/2 log(2 alpha) is summed over the classes.

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
        Number of residuals.
    classes : sequence
        Indices of the weights of each class.

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
    # This is N/2 log(2 alpha), with the number of weights of each class as N.
    indices = np.arange(N)
    log_prior = sum(
        len(indices[members]) / 2 * math.log(2 * value)
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
    """Compute a root R (N, N) of the covariance of the weights, R R' = H^-1 (M92).

    H = 2 beta J'J + 2 diag(alpha), where alpha (N,) has a value for each weight. H is
    first divided by the root of the prior's part on both sides. This makes it
    I + V diag(e) V' with eigenvalues e >= 0, so rounding cannot make a variance
    negative.
    """
    prior_root = 1 / np.sqrt(2 * alpha)
    eigenvalues, vectors = np.linalg.eigh(
        2 * beta * prior_root[:, None] * JJ * prior_root
    )
    return prior_root[:, None] * vectors / np.sqrt(1 + np.maximum(eigenvalues, 0.0))


def spread_over_weights(
    alpha: np.ndarray, classes: Sequence[Any], N: int
) -> np.ndarray:
    """Spread the alpha of each class over its weights; returns an array (N,)."""
    alpha_of_weight = np.empty(N)
    for value, members in zip(alpha, classes, strict=True):
        alpha_of_weight[members] = value
    return alpha_of_weight
