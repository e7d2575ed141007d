"""Training of one start: Levenberg-Marquardt on a regularised sum of squares.

Sources of the lines, named where they are used
  (FH n)    Foresee & Hagan 1997, Gauss-Newton approximation to Bayesian learning, step n of section 4
  (M92)     MacKay 1992, Bayesian interpolation, Neural Computation 4
  (HM94)    Hagan & Menhaj 1994, training feedforward networks with the Marquardt algorithm

Notation: w all N weights, n residuals (samples times outputs), E_d and E_w plain sums of squares. The objective is
F = beta E_d + alpha E_w. Weights may fall into classes c with an alpha_c each; then E_w and alpha are vectors.

Where replicates are known, n and E_d hold their scatter about the samples' means as well: no weights can change it, but
it determines beta. Likelihood and evidence then refer to the single runs.

With several alpha the re-estimation (FH 2-3) passes the largest evidence and goes on: it takes no account of how the
weights change with alpha, so small weights of the inputs and large ones of the outputs drift apart without end. Such a
start ends when its evidence has not risen for `PATIENCE` epochs. The alpha and beta of the largest evidence are kept,
and the weights go to the minimum of F with them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from repose.calibrate.surrogates.evidence import log_evidence, of_each_weight
from repose.calibrate.surrogates.samples import Scatter
from repose.calibrate.surrogates.two_layer import jacobian, unpack, weight_classes

STATISTICS = (
    "log_evidence",
    "gamma",
    "alpha",
    "beta",
    "mse",
    "epochs",
    "stop_reason",
    "decrement",
    "at_cap",
)
LARGEST_ALPHA = 1e6  # weights of 0.0007 in scaled units: an input that has faded
SMALLEST = 1e-30  # E_d of outputs that a network meets exactly
PATIENCE = 60  # epochs without a larger evidence
NEAR = 1.0  # F above its minimum, in nats, below which Laplace's approximation holds
# F above its minimum at which a start has converged: the weights are 0.14 of a standard deviation from the best ones
CONVERGED = 0.01
DESCENT = 100  # most steps to the minimum of F with alpha and beta kept
# mu is only ever multiplied, so from 0 it could not rise again. From any number above 0 it rises in time: it takes at
# most one trial for each step that lowered it.
SMALLEST_MU = float(np.finfo(float).tiny)


@dataclass(eq=False, repr=False)
class TrainingSettings:
    """Settings of the training of a start."""

    epochs: int = 1500  # most accepted steps
    goal: float = (
        1e-4  # mean squared error of the scaled outputs at which training stops
    )
    mu: float = 0.005  # Marquardt's damping
    mu_decrease: float = 0.1
    mu_increase: float = 10.0
    mu_max: float = 1e10
    min_gradient: float = 1e-7  # norm of the objective's gradient at which a start ends
    prior: str = "one"  # one of `PRIORS`


class _Data(NamedTuple):
    """Training data of a start, and the classes of its weights."""

    x: np.ndarray  # (samples, inputs), scaled
    t: np.ndarray  # (samples, outputs), scaled
    root_weight: np.ndarray  # (samples, outputs), square root of each residual's weight
    n: float  # number of residuals, including the replicates
    pure_error: float  # sum of squares of the replicates about their samples' means
    classes: list  # indices of the weights of each class
    size: np.ndarray  # (classes,), weights of each class


class _Point(NamedTuple):
    """Weights with the residuals' linear model about them."""

    w: np.ndarray
    Ed: float
    Ew: np.ndarray
    JJ: np.ndarray
    Je: np.ndarray


class _State(NamedTuple):
    """Weights with the alpha, beta and gamma re-estimated there."""

    at: _Point
    alpha: np.ndarray
    of_weight: np.ndarray
    beta: float
    gamma: np.ndarray

    def half_gradient(self) -> np.ndarray:
        return self.beta * self.at.Je + self.of_weight * self.at.w

    def half_hessian(self) -> np.ndarray:
        return self.beta * self.at.JJ + np.diag(self.of_weight)

    def decrement(self) -> float:
        """Return the height of F above the minimum of its quadratic model."""
        g = self.half_gradient()
        return float(g @ np.linalg.solve(self.half_hessian(), g))

    def evidence(self, data: _Data) -> float:
        Ed = self.at.Ed + data.pure_error
        return log_evidence(
            self.alpha, self.beta, Ed, self.at.Ew, self.at.JJ, data.n, data.classes
        )


def train_start(
    w: np.ndarray,
    x: np.ndarray,
    t: np.ndarray,
    root_weight: np.ndarray,
    n: float,
    settings: TrainingSettings,
    pure_error: Scatter = (0.0, 0.0),
) -> dict[str, Any]:
    """Train from the weights w (N,) (FH 1-4); x, t and `root_weight` have a row for each sample, x and t are scaled.

    n is the number of residuals; of weighted samples the sum of their counts. `pure_error` is the sum of squares of the
    replicates about their samples' means, scaled and weighted as the residuals, and its degrees of freedom.
    """
    hidden = (w.size - t.shape[1]) // (x.shape[1] + 1 + t.shape[1])
    classes = weight_classes(settings.prior, x.shape[1], hidden, t.shape[1])
    size = np.array([w[c].size for c in classes], dtype=float)
    data = _Data(x, t, root_weight, n + pure_error[1], pure_error[0], classes, size)
    state, epochs, reason = _train(w, data, n, settings)
    return {
        "w": state.at.w, "JJ": state.at.JJ, "alpha_of_weight": state.of_weight,
        "log_evidence": state.evidence(data), "gamma": float(state.gamma.sum()),
        "alpha": float(state.alpha[0]) if settings.prior == "one" else state.alpha, "beta": float(state.beta),
        "mse": state.at.Ed / n, "epochs": epochs, "stop_reason": reason, "decrement": state.decrement(),
        "at_cap": np.flatnonzero(state.alpha >= LARGEST_ALPHA).tolist(),
    }  # fmt: skip


def _train(
    w: np.ndarray, data: _Data, n: float, settings: TrainingSettings
) -> tuple[_State, int, str]:
    """Train to the end; return the state there, the number of epochs, and the reason of the end."""
    # FH 0 sets alpha = 0, with which gamma is N and beta negative as soon as n < N; any small prior avoids it
    alpha, mu = np.full(len(data.classes), 0.01), max(settings.mu, SMALLEST_MU)
    state = _State(
        _point(w, data),
        alpha,
        of_each_weight(alpha, data.classes, w.size),
        1.0,
        data.size,
    )
    best, largest, since = None, -np.inf, 0
    epoch, reason = 0, "epochs"
    while epoch < settings.epochs:
        if state.at.Ed / n <= settings.goal:
            reason = "goal"
            break
        if 2 * np.linalg.norm(state.half_gradient()) < settings.min_gradient:
            reason = "gradient"
            break
        candidate, mu = _step(state, mu, data, settings)
        if candidate is None:
            reason = "mu"
            break
        state = _re_estimated(_point(candidate, data), state, data)
        epoch += 1
        if len(data.classes) == 1:
            continue
        if state.decrement() < NEAR and (evidence := state.evidence(data)) > largest:
            best, largest, since = state, evidence, epoch
        if best is not None and epoch - since >= PATIENCE:
            reason = "evidence"
            break
    return (state if best is None else _descend(best, data, settings)), epoch, reason


def _descend(state: _State, data: _Data, settings: TrainingSettings) -> _State:
    """Descend to the minimum of F with alpha and beta kept; compute gamma there."""
    mu = max(settings.mu, SMALLEST_MU)
    for _ in range(DESCENT):
        if state.decrement() < CONVERGED / 100:
            break
        candidate, mu = _step(state, mu, data, settings)
        if candidate is None:
            break
        state = state._replace(at=_point(candidate, data))
    return state._replace(gamma=_gamma(state, data))


def _step(
    state: _State, mu: float, data: _Data, settings: TrainingSettings
) -> tuple[np.ndarray | None, float]:
    """Damp until F falls (HM94): the weights there, or None, and the next mu."""
    alpha, beta, at, half_gradient = (
        state.alpha,
        state.beta,
        state.at,
        state.half_gradient(),
    )
    identity = np.eye(at.w.size)
    while mu <= settings.mu_max:
        damped = beta * at.JJ + (state.of_weight + mu) * identity
        candidate = at.w - np.linalg.solve(damped, half_gradient)
        e = residuals(candidate, data.x, data.t, data.root_weight)
        if (
            beta * (e @ e) + alpha @ _square_sums(candidate, data.classes)
            < beta * at.Ed + alpha @ at.Ew
        ):
            return candidate, max(mu * settings.mu_decrease, SMALLEST_MU)
        mu *= settings.mu_increase
    return None, mu


def _gamma(state: _State, data: _Data) -> np.ndarray:
    """Count the weights of each class that the data determine."""
    # gamma = N - 2 alpha tr(H^-1), H = 2 beta J'J + 2 alpha I, class by class  (FH 2), (M92)
    inverse = np.diagonal(np.linalg.inv(state.half_hessian()))
    return data.size - state.alpha * np.array([inverse[c].sum() for c in data.classes])


def _re_estimated(at: _Point, state: _State, data: _Data) -> _State:
    """Re-estimate alpha, gamma and beta at new weights."""
    gamma = _gamma(state._replace(at=at), data)
    # (FH 3); gamma of a class that has faded may be lost in rounding
    alpha = np.where(gamma > 0, gamma / (2 * np.maximum(at.Ew, SMALLEST)), state.alpha)
    alpha = np.minimum(alpha, LARGEST_ALPHA)
    beta = (data.n - gamma.sum()) / (2 * max(at.Ed + data.pure_error, SMALLEST))
    return _State(
        at, alpha, of_each_weight(alpha, data.classes, at.w.size), beta, gamma
    )


def _point(w: np.ndarray, data: _Data) -> _Point:
    """Linearise the model about w."""
    e, J = linearise(w, data.x, data.t, data.root_weight)
    return _Point(w, e @ e, _square_sums(w, data.classes), J.T @ J, J.T @ e)


def _square_sums(w: np.ndarray, classes: Sequence[Any]) -> np.ndarray:
    """Compute E_w of each class."""
    return np.array([w[c] @ w[c] for c in classes])


def residuals(
    w: np.ndarray, x: np.ndarray, t: np.ndarray, root_weight: np.ndarray
) -> np.ndarray:
    """Compute the weighted residuals of the network (samples * outputs,); x and t are scaled."""
    hidden = (w.size - t.shape[1]) // (x.shape[1] + 1 + t.shape[1])
    W1, b1, W2, b2 = unpack(w, x.shape[1], hidden, t.shape[1])
    return ((np.tanh(x @ W1.T + b1) @ W2.T + b2 - t) * root_weight).ravel()


def linearise(
    w: np.ndarray, x: np.ndarray, t: np.ndarray, root_weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute `residuals`, and their derivatives by the weights (samples * outputs, N)."""
    y, J = jacobian(w, x, t.shape[1])
    return ((y - t) * root_weight).ravel(), (J * root_weight[:, :, None]).reshape(
        t.size, w.size
    )
