"""Training of one start: Levenberg-Marquardt on a regularised sum of squares.

Sources of the lines, named where they are used
  (FH n)    Foresee & Hagan 1997, Gauss-Newton approximation to Bayesian learning, step n of section 4
  (M92)     MacKay 1992, Bayesian interpolation, Neural Computation 4
  (HM94)    Hagan & Menhaj 1994, training feedforward networks with the Marquardt algorithm

Notation: w all N weights, n residuals (samples times outputs), E_d and E_w plain sums of squares. The objective is
F = beta E_d + alpha E_w. Weights may fall into classes c with an alpha_c each; then E_w and alpha are vectors.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from repose.surrogate.evidence import log_evidence, of_each_weight
from repose.surrogate.two_layer import jacobian, unpack, weight_classes

STATISTICS = ("log_evidence", "gamma", "alpha", "beta", "mse", "epochs", "stop_reason")
LARGEST_ALPHA = 1e6  # weights of 0.0007 in scaled units: an input that has faded
SMALLEST = 1e-30  # E_d of outputs that a network meets exactly
# mu is only ever multiplied, so from 0 it could not rise again. From any number above 0 it rises in time: it takes at
# most one trial for each step that lowered it.
SMALLEST_MU = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Settings:
    """How a start is trained.

    Parameters
    ----------
    epochs, goal, mu, mu_decrease, mu_increase, mu_max, min_gradient, prior
        As for `repose.surrogate.bayesian_bp.BayesianBP`.
    """

    epochs: int
    goal: float
    mu: float
    mu_decrease: float
    mu_increase: float
    mu_max: float
    min_gradient: float
    prior: str


@dataclass
class _Point:
    """Weights with the residuals' linear model about them."""

    w: np.ndarray
    Ed: float
    Ew: np.ndarray
    JJ: np.ndarray
    Je: np.ndarray


def train_start(
    w: np.ndarray,
    x: np.ndarray,
    t: np.ndarray,
    root_weight: np.ndarray,
    n: float,
    hidden: int,
    settings: Settings,
) -> dict[str, Any]:
    """Train from the weights w (FH 1-4).

    Parameters
    ----------
    w : array (N,)
        Where the training starts.
    x, t : array (samples, inputs), (samples, outputs)
        Scaled inputs and scaled targets.
    root_weight : array (samples, outputs)
        Square root of each residual's weight.
    n : float
        Number of residuals; of weighted samples the sum of their counts.
    hidden : int
        Neurons of the hidden layer.
    settings : Settings

    Returns
    -------
    dict
        `w`, `JJ` and `alpha_of_weight` (N,) at the end, and `STATISTICS`.
    """
    classes = weight_classes(settings.prior, x.shape[1], hidden, t.shape[1])
    size = np.array([w[c].size for c in classes], dtype=float)
    data = (x, t, root_weight)
    # FH 0 sets alpha = 0, with which gamma is N and beta negative as soon as n < N; any small prior avoids it
    alpha, beta, gamma, mu = np.full(len(classes), 0.01), 1.0, size, max(settings.mu, SMALLEST_MU)
    alpha_of_weight = of_each_weight(alpha, classes, w.size)
    at = _point(w, data, classes)
    epoch, reason = 0, "epochs"
    while epoch < settings.epochs:
        half_gradient = beta * at.Je + alpha_of_weight * at.w
        if at.Ed / n <= settings.goal:
            reason = "goal"
            break
        if 2 * np.linalg.norm(half_gradient) < settings.min_gradient:
            reason = "gradient"
            break
        candidate, mu = _step(at, half_gradient, alpha, alpha_of_weight, beta, mu, data, classes, settings)
        if candidate is None:
            reason = "mu"
            break
        mu = max(mu * settings.mu_decrease, SMALLEST_MU)
        at = _point(candidate, data, classes)
        alpha, gamma, beta = _re_estimate(at, alpha, alpha_of_weight, beta, n, size, classes)
        alpha_of_weight = of_each_weight(alpha, classes, w.size)
        epoch += 1
    return {
        "w": at.w,
        "JJ": at.JJ,
        "alpha_of_weight": alpha_of_weight,
        "log_evidence": log_evidence(alpha, beta, at.Ed, at.Ew, at.JJ, n, classes),
        "gamma": float(gamma.sum()),
        "alpha": float(alpha[0]) if settings.prior == "one" else alpha,
        "beta": float(beta),
        "mse": at.Ed / n,
        "epochs": epoch,
        "stop_reason": reason,
    }


def _step(at, half_gradient, alpha, alpha_of_weight, beta, mu, data, classes, settings):
    """Damp until F falls (HM94): the weights there, or None, and the mu that did it."""
    identity = np.eye(at.w.size)
    while mu <= settings.mu_max:
        damped = beta * at.JJ + (alpha_of_weight + mu) * identity
        candidate = at.w - np.linalg.solve(damped, half_gradient)
        e = residuals(candidate, *data)
        if beta * (e @ e) + alpha @ _square_sums(candidate, classes) < beta * at.Ed + alpha @ at.Ew:
            return candidate, mu
        mu *= settings.mu_increase
    return None, mu


def _re_estimate(at, alpha, alpha_of_weight, beta, n, size, classes):
    """alpha, gamma and beta that the data ask for at these weights."""
    # gamma = N - 2 alpha tr(H^-1), H = 2 beta J'J + 2 alpha I, class by class  (FH 2), (M92)
    inverse = np.diagonal(np.linalg.inv(beta * at.JJ + alpha_of_weight * np.eye(at.w.size)))
    gamma = size - alpha * np.array([inverse[c].sum() for c in classes])
    # (FH 3); gamma of a class that has faded may be lost in rounding
    alpha = np.where(gamma > 0, gamma / (2 * np.maximum(at.Ew, SMALLEST)), alpha)
    alpha = np.minimum(alpha, LARGEST_ALPHA)
    return alpha, gamma, (n - gamma.sum()) / (2 * max(at.Ed, SMALLEST))


def _point(w, data, classes):
    """The linear model about w."""
    e, J = linearise(w, *data)
    return _Point(w, e @ e, _square_sums(w, classes), J.T @ J, J.T @ e)


def _square_sums(w, classes):
    """E_w of each class."""
    return np.array([w[c] @ w[c] for c in classes])


def residuals(w: np.ndarray, x: np.ndarray, t: np.ndarray, root_weight: np.ndarray) -> np.ndarray:
    """Weighted residuals of the network.

    Parameters
    ----------
    w : numpy.ndarray, (N,)
    x : numpy.ndarray, (samples, inputs)
        Scaled.
    t : numpy.ndarray, (samples, outputs)
        Scaled.
    root_weight : numpy.ndarray, (samples, outputs)
        Root of each residual's weight.

    Returns
    -------
    numpy.ndarray, (samples * outputs,)
    """
    hidden = (w.size - t.shape[1]) // (x.shape[1] + 1 + t.shape[1])
    W1, b1, W2, b2 = unpack(w, x.shape[1], hidden, t.shape[1])
    return ((np.tanh(x @ W1.T + b1) @ W2.T + b2 - t) * root_weight).ravel()


def linearise(
    w: np.ndarray, x: np.ndarray, t: np.ndarray, root_weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Weighted residuals of the network, and their derivative by the weights.

    Parameters
    ----------
    w, x, t, root_weight
        As in `residuals`.

    Returns
    -------
    residuals : numpy.ndarray, (samples * outputs,)
    derivative : numpy.ndarray, (samples * outputs, N)
    """
    y, J = jacobian(w, x, t.shape[1])
    return ((y - t) * root_weight).ravel(), (J * root_weight[:, :, None]).reshape(t.size, w.size)
