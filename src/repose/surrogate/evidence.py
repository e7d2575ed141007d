"""Evidence of a trained network, and the covariance of its weights (MacKay).

  (M92)  MacKay 1992, Bayesian interpolation / A practical Bayesian framework, Neural Computation 4

E_d and E_w are plain sums of squares, so the noise variance is 1 / (2 beta) and the prior variance of a weight
1 / (2 alpha). Weights may fall into classes c with an alpha_c each; then E_w and alpha are vectors, and alpha E_w is
their scalar product.
"""

import math

import numpy as np


def log_evidence(alpha, beta, Ed, Ew, JJ, n, classes=(slice(None),)):
    """log p(D | alpha, beta) by Laplace's approximation at the most probable weights (M92).

    Likelihood (beta/pi)^(n/2) exp(-beta E_d), prior (alpha/pi)^(N/2) exp(-alpha E_w),
    H = 2 beta J'J + 2 alpha I:
    log p = n/2 log(beta/pi) + N/2 log(2 alpha) - 1/2 log det H - beta E_d - alpha E_w,
    with N/2 log(2 alpha) summed over the classes of weights where there are several.
    -inf where that is no number, so such a start is never the best.
    """
    alpha, Ew = np.atleast_1d(alpha), np.atleast_1d(Ew)
    if not (np.all(alpha > 0) and beta > 0):
        return -math.inf
    each = np.arange(len(JJ))
    prior = sum(len(each[c]) / 2 * math.log(2 * a) for a, c in zip(alpha, classes, strict=True))
    _, log_det = np.linalg.slogdet(2 * beta * JJ + np.diag(2 * of_each_weight(alpha, classes, len(JJ))))
    value = n / 2 * math.log(beta / math.pi) + prior - log_det / 2 - beta * Ed - alpha @ Ew
    return float(value) if math.isfinite(value) else -math.inf


def posterior_root(alpha, beta, JJ):
    """A root R (N, N), R R' = H^-1, of the weights' covariance about the most probable ones (M92).

    alpha (N,): each weight's own. H = 2 beta J'J + 2 diag(alpha), made symmetric about its prior first, so
    that rounding can make no variance negative.
    """
    prior_root = 1 / np.sqrt(2 * alpha)
    eigenvalues, vectors = np.linalg.eigh(2 * beta * prior_root[:, None] * JJ * prior_root)
    return prior_root[:, None] * vectors / np.sqrt(1 + np.maximum(eigenvalues, 0.0))


def of_each_weight(alpha, classes, N):
    """alpha of each class (classes,) to alpha of each weight (N,)."""
    of_weight = np.empty(N)
    for value, c in zip(alpha, classes, strict=True):
        of_weight[c] = value
    return of_weight
