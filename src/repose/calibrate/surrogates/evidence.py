"""Evidence of a trained network, and the covariance of its weights (MacKay).

  (M92)  MacKay 1992, Bayesian interpolation / A practical Bayesian framework, Neural Computation 4

E_d and E_w are plain sums of squares, so the noise variance is 1 / (2 beta) and the prior variance of a weight
1 / (2 alpha). Weights may fall into classes c with an alpha_c each; then E_w and alpha are vectors, and alpha E_w is
their scalar product.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

Each = float | np.ndarray  # of each class of weights, or of all


def log_evidence(
    alpha: Each,
    beta: float,
    Ed: float,
    Ew: Each,
    JJ: np.ndarray,
    n: float,
    classes: Sequence[Any] = (slice(None),),
) -> float:
    """Log p(D | alpha, beta) by Laplace's approximation at the most probable weights (M92); -inf if it is not a number.

    Likelihood (beta/pi)^(n/2) exp(-beta E_d), prior (alpha/pi)^(N/2) exp(-alpha E_w), H = 2 beta J'J + 2 alpha I:
    log p = n/2 log(beta/pi) + N/2 log(2 alpha) - 1/2 log det H - beta E_d - alpha E_w, with N/2 log(2 alpha) summed
    over the classes of weights (`two_layer.weight_classes`) where there are several. JJ is J'J (N, N) of the weighted
    residuals, n their number.
    """
    alpha, Ew = np.atleast_1d(alpha), np.atleast_1d(Ew)
    if not (np.all(alpha > 0) and beta > 0):
        return -math.inf
    each = np.arange(len(JJ))
    prior = sum(
        len(each[c]) / 2 * math.log(2 * a) for a, c in zip(alpha, classes, strict=True)
    )
    _, log_det = np.linalg.slogdet(
        2 * beta * JJ + np.diag(2 * of_each_weight(alpha, classes, len(JJ)))
    )
    value = (
        n / 2 * math.log(beta / math.pi) + prior - log_det / 2 - beta * Ed - alpha @ Ew
    )
    return float(value) if math.isfinite(value) else -math.inf


def posterior_root(alpha: np.ndarray, beta: float, JJ: np.ndarray) -> np.ndarray:
    """Compute a root R (N, N) of the covariance of the weights about their most probable values, R R' = H^-1 (M92).

    H = 2 beta J'J + 2 diag(alpha), alpha (N,) of each weight. It is made symmetric about its prior first, so that
    rounding can make no variance negative.
    """
    prior_root = 1 / np.sqrt(2 * alpha)
    eigenvalues, vectors = np.linalg.eigh(
        2 * beta * prior_root[:, None] * JJ * prior_root
    )
    return prior_root[:, None] * vectors / np.sqrt(1 + np.maximum(eigenvalues, 0.0))


def of_each_weight(alpha: np.ndarray, classes: Sequence[Any], N: int) -> np.ndarray:
    """Spread the alpha of each weight (N,) from the alpha of each class; `classes` as of `two_layer.weight_classes`."""
    of_weight = np.empty(N)
    for value, c in zip(alpha, classes, strict=True):
        of_weight[c] = value
    return of_weight
