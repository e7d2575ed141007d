"""Train a network from one start: Levenberg-Marquardt with regularisation.

The training minimises F = beta E_d + alpha E_w and re-estimates alpha and beta after
each step.

Symbols
  w      all N weights of the network
  n      number of residuals, samples times outputs
  E_d    sum of the squared residuals e, weighted
  E_w    sum of the squared weights
  J      derivatives of the residuals with respect to the weights
  H      Hessian of F in the Gauss-Newton approximation, 2 beta J'J + 2 alpha I
  gamma  number of weights that the data determine

If the weights form several classes, each has its own alpha. E_w, alpha and gamma are
then vectors.

Sources, named where they are used
  (FH n)    Foresee & Hagan 1997, Gauss-Newton approximation to Bayesian learning, step
            n of section 4
  (M92)     MacKay 1992, Bayesian interpolation, Neural Computation 4
  (HM94)    Hagan & Menhaj 1994, training feedforward networks with the Marquardt
            algorithm

Replicates: if they are known, n and E_d include their scatter about the means of their
samples. The weights cannot change this scatter, but it helps to determine beta.
Likelihood and evidence are then those of the single runs.

Largest evidence: with several alphas, the re-estimation (FH 2-3) passes the largest
evidence and goes on, because it ignores how the weights change with alpha. Small input
weights and large output weights then drift apart without end. Therefore a start with
several classes ends when its evidence has not risen for `PATIENCE` epochs. It returns
to the alpha and beta of the largest evidence, and minimises F with them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from repose.calibrate.surrogates.evidence import (
    compute_log_evidence,
    spread_over_weights,
)
from repose.calibrate.surrogates.samples import NO_SCATTER, Scatter
from repose.calibrate.surrogates.settings import AS_PUBLISHED
from repose.calibrate.surrogates.two_layer import (
    compute_jacobian,
    count_hidden_neurons,
    list_weight_classes,
    unpack_weights,
)

STATISTIC_NAMES = (
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
FIRST_ALPHA = 0.01
FIRST_BETA = 1.0
# Largest alpha. It gives the weights a prior standard deviation of 0.0007 in scaled
# units, so an input with such weights has practically no effect.
MAX_ALPHA = 1e6
MIN_SQUARES = 1e-30  # smallest E_d, for outputs that a network reproduces exactly
PATIENCE = 60  # number of epochs without a larger evidence after which a start ends
# F above its minimum, in nats, below which Laplace's approximation of the evidence
# holds.
NEAR_MINIMUM = 1.0
# F above its minimum at which a start has converged: the weights are 0.14 of a standard
# deviation from the best ones.
CONVERGED = 0.01
# F above its minimum at which a descent with fixed alpha and beta ends.
DESCENT_DECREMENT = CONVERGED / 100
# Largest number of steps to the minimum of F at fixed alpha and beta.
MAX_DESCENT_STEPS = 100
MIN_DECREASE = 0.003  # decrease of F in a step, in nats, below which `train_again` ends
# The damping mu is only ever multiplied, so it could not rise again from 0. From this
# smallest number it can, with at most one trial for each step that lowered it.
MIN_MU = float(np.finfo(float).tiny)


@dataclass(eq=False, repr=False)
class TrainingSettings:
    """Settings of the training of a start."""

    epochs: int = AS_PUBLISHED.epochs  # largest number of accepted steps
    # Mean squared error of the scaled outputs at which training stops.
    goal: float = AS_PUBLISHED.goal
    mu: float = 0.005  # Marquardt's damping
    mu_decrease: float = 0.1
    mu_increase: float = 10.0
    mu_max: float = 1e10
    min_gradient: float = 1e-7  # norm of the gradient of F at which a start ends
    prior: str = AS_PUBLISHED.prior  # one of `two_layer.PRIORS`


class _Data(NamedTuple):
    """Training data of a start, and the classes of its weights."""

    x: np.ndarray  # (samples, inputs), scaled
    t: np.ndarray  # (samples, outputs), scaled
    root_weight: np.ndarray  # (samples, outputs), square root of each residual's weight
    n_means: float  # number of residuals of the samples
    n: float  # number of residuals including the replicates
    pure_error: float  # sum of squares of the replicates about their samples' means
    classes: list  # indices of the weights of each class
    size: np.ndarray  # (classes,), number of weights of each class


class _Point(NamedTuple):
    """Weights, and the linear model of the residuals around them."""

    w: np.ndarray  # (N,)
    Ed: float
    Ew: np.ndarray  # (classes,)
    JJ: np.ndarray  # J'J (N, N)
    Je: np.ndarray  # J'e (N,)


class _State(NamedTuple):
    """Weights with the alpha, beta and gamma that are re-estimated there."""

    point: _Point
    alpha: np.ndarray  # (classes,)
    alpha_of_weight: np.ndarray  # (N,)
    beta: float
    gamma: np.ndarray  # (classes,)

    def objective(self) -> float:
        """Compute the objective F."""
        return float(self.beta * self.point.Ed + self.alpha @ self.point.Ew)

    def half_gradient(self) -> np.ndarray:
        """Compute half the gradient (N,) of F with respect to the weights."""
        return self.beta * self.point.Je + self.alpha_of_weight * self.point.w

    def half_hessian(self) -> np.ndarray:
        """Compute H / 2 (N, N)."""
        return self.beta * self.point.JJ + np.diag(self.alpha_of_weight)

    def newton_decrement(self) -> float:
        """Compute the height of F above the minimum of its quadratic model."""
        g = self.half_gradient()
        return float(g @ np.linalg.solve(self.half_hessian(), g))

    def log_evidence(self, data: _Data) -> float:
        """Compute the log evidence, replicates included."""
        return compute_log_evidence(
            alpha=self.alpha,
            beta=self.beta,
            Ed=self.point.Ed + data.pure_error,
            Ew=self.point.Ew,
            JJ=self.point.JJ,
            n=data.n,
            classes=data.classes,
        )


class _End(NamedTuple):
    """The end of a training."""

    state: _State
    epochs: int
    reason: str  # "goal", "gradient", "mu", "evidence" or "epochs"


class _Best(NamedTuple):
    """The state of the largest evidence so far."""

    state: _State
    evidence: float
    epoch: int


def train_start(
    w: np.ndarray,
    x: np.ndarray,
    t: np.ndarray,
    root_weight: np.ndarray,
    n: float,
    settings: TrainingSettings,
    pure_error: Scatter | tuple[float, float] = NO_SCATTER,
) -> dict[str, Any]:
    """Train a network from first weights (FH 1-4).

    Parameters
    ----------
    w : array (N,)
        First weights.
    x : array (samples, inputs)
        Scaled inputs.
    t : array (samples, outputs)
        Scaled outputs.
    root_weight : array (samples, outputs)
        Square root of each residual's weight.
    n : float
        Number of residuals. For weighted samples it is the sum of their counts times
        the number of outputs.
    settings : TrainingSettings
        Settings of the training.
    pure_error : Scatter, optional
        Scatter of the replicates about their samples' means, scaled and weighted as the
        residuals.

    Returns
    -------
    dict
        The statistics of the end, named as in `STATISTIC_NAMES`; the weights `w` (N,);
        their J'J as `JJ` (N, N); and `alpha_of_weight` (N,), the alpha of each weight.
    """
    sum_of_squares, degrees_of_freedom = pure_error
    classes = _list_weight_classes(w, x, t, settings)
    data = _Data(
        x=x,
        t=t,
        root_weight=root_weight,
        n_means=n,
        n=n + degrees_of_freedom,
        pure_error=sum_of_squares,
        classes=classes,
        size=_count_class_sizes(w, classes),
    )
    state, epochs, reason = _train_to_end(w, data, settings)
    # A single class of weights has one alpha, a number.
    alpha = float(state.alpha[0]) if settings.prior == "one" else state.alpha
    return {
        "w": state.point.w,
        "JJ": state.point.JJ,
        "alpha_of_weight": state.alpha_of_weight,
        "log_evidence": state.log_evidence(data),
        "gamma": float(state.gamma.sum()),
        "alpha": alpha,
        "beta": float(state.beta),
        "mse": state.point.Ed / n,
        "epochs": epochs,
        "stop_reason": reason,
        "decrement": state.newton_decrement(),
        "at_cap": np.flatnonzero(state.alpha >= MAX_ALPHA).tolist(),
    }


def train_again(
    w: np.ndarray,
    x: np.ndarray,
    t: np.ndarray,
    root_weight: np.ndarray,
    alpha: np.ndarray,
    beta: float,
    settings: TrainingSettings,
) -> dict[str, np.ndarray]:
    """Train a trained network on other outputs, and keep its regularisation.

    The weights are changed until the objective F = beta E_d + alpha E_w hardly falls.

    Parameters
    ----------
    w : array (N,)
        Weights of the trained network.
    x : array (samples, inputs)
        Scaled inputs.
    t : array (samples, outputs)
        Scaled outputs.
    root_weight : array (samples, outputs)
        Square root of each residual's weight.
    settings : TrainingSettings
        Settings of the training.
    alpha : array (classes,)
        Regularisation of each class of weights.
    beta : float
        Inverse of twice the noise variance.

    Returns
    -------
    dict
        `w` (N,), the new weights; `JJ` (N, N), J'J at these weights; `alpha_of_weight`
        (N,), the alpha of each weight.
    """
    classes = _list_weight_classes(w, x, t, settings)
    size = _count_class_sizes(w, classes)
    # The numbers of residuals, the scatter of replicates and gamma only serve to
    # re-estimate alpha and beta, which are fixed here. So their values have no effect.
    data = _Data(
        x=x,
        t=t,
        root_weight=root_weight,
        n_means=t.size,
        n=t.size,
        pure_error=0.0,
        classes=classes,
        size=size,
    )
    state = _State(
        point=_make_linear_model(w, data),
        alpha=alpha,
        alpha_of_weight=spread_over_weights(alpha, classes, w.size),
        beta=beta,
        gamma=size,
    )

    # Take steps until F hardly decreases.
    F = state.objective()
    mu = max(settings.mu, MIN_MU)
    for _ in range(MAX_DESCENT_STEPS):
        weights, next_mu = _find_step(state, mu, data, settings)
        if weights is None:
            # No step lowers F, even with the largest damping.
            break
        state = state._replace(point=_make_linear_model(weights, data))
        # `_find_step` returns the damping of the step times `mu_decrease`. This is at
        # least `mu` only if it had to raise the damping to find the step. Then begin
        # the next step with the damping that succeeded, without lowering it.
        mu = next_mu / settings.mu_decrease if next_mu >= mu else next_mu
        # F is the negative log of a probability, so a decrease below MIN_DECREASE
        # hardly changes this probability.
        decrease = F - state.objective()
        F -= decrease
        if decrease < MIN_DECREASE:
            break
    return {
        "w": state.point.w,
        "JJ": state.point.JJ,
        "alpha_of_weight": state.alpha_of_weight,
    }


def _list_weight_classes(
    w: np.ndarray, x: np.ndarray, t: np.ndarray, settings: TrainingSettings
) -> list[Any]:
    """List the classes of the weights w (N,) of a network from x to t."""
    inputs = x.shape[1]
    outputs = t.shape[1]
    hidden = count_hidden_neurons(w.size, inputs, outputs)
    return list_weight_classes(settings.prior, inputs, hidden, outputs)


def _count_class_sizes(w: np.ndarray, classes: Sequence[Any]) -> np.ndarray:
    """Count the weights of each class."""
    return np.array([w[members].size for members in classes], dtype=float)


def _train_to_end(w: np.ndarray, data: _Data, settings: TrainingSettings) -> _End:
    """Train a network until one of the stopping criteria is met.

    With several classes of weights, the result is the minimum of F for the alpha and
    beta with the largest evidence.

    Parameters
    ----------
    w : array (N,)
        First weights.
    data : _Data
        The training data.
    settings : TrainingSettings
        Settings of the training.

    Returns
    -------
    _End
        The last state, the number of epochs, and the reason why the training stopped.
    """
    state = _make_first_state(w, data)
    mu = max(settings.mu, MIN_MU)
    best: _Best | None = None
    epoch = 0
    # This is the reason if no other criterion ends the loop.
    reason = "epochs"
    while epoch < settings.epochs:
        if state.point.Ed / data.n_means <= settings.goal:
            reason = "goal"
            break
        if 2 * np.linalg.norm(state.half_gradient()) < settings.min_gradient:
            reason = "gradient"
            break
        weights, mu = _find_step(state, mu, data, settings)
        if weights is None:
            # No step lowers F, even with the largest damping.
            reason = "mu"
            break
        state = _re_estimate(_make_linear_model(weights, data), state, data)
        epoch += 1

        # With a single alpha the evidence stays at its maximum once it is reached. With
        # several it may fall again, so remember the best state.
        if len(data.classes) > 1:
            best = _choose_better(best, state, epoch, data)
            if best is not None and epoch - best.epoch >= PATIENCE:
                reason = "evidence"
                break
    if best is not None:
        state = _descend(best.state, data, settings)
    return _End(state, epoch, reason)


def _make_first_state(w: np.ndarray, data: _Data) -> _State:
    """Make the state before the first step.

    (FH 0) sets alpha to 0. Then gamma is N, and beta is negative if n < N. Any small
    prior avoids this.
    """
    alpha = np.full(len(data.classes), FIRST_ALPHA)
    return _State(
        point=_make_linear_model(w, data),
        alpha=alpha,
        alpha_of_weight=spread_over_weights(alpha, data.classes, w.size),
        beta=FIRST_BETA,
        gamma=data.size,
    )


def _choose_better(
    best: _Best | None, state: _State, epoch: int, data: _Data
) -> _Best | None:
    """Return the better of the best state so far and a new state.

    The better one has the larger evidence. The formula of the evidence holds only near
    the minimum of the objective F, so a new state farther away is ignored.

    Parameters
    ----------
    best : _Best or None
        The best state so far; None if no state was near a minimum yet.
    state : _State
        The new state.
    epoch : int
        The epoch of the new state.
    data : _Data
        The training data.

    Returns
    -------
    _Best or None
        None if there is still no state near a minimum.
    """
    is_near_minimum = state.newton_decrement() < NEAR_MINIMUM  # False also for NaN
    if not is_near_minimum:
        return best
    evidence = state.log_evidence(data)
    largest = -np.inf if best is None else best.evidence
    if evidence > largest:
        return _Best(state, evidence, epoch)
    return best


def _descend(state: _State, data: _Data, settings: TrainingSettings) -> _State:
    """Minimise the objective F with fixed alpha and beta, and compute gamma there.

    F is beta E_d + alpha E_w, as in the docstring of the module. The descent ends when
    F is at most `DESCENT_DECREMENT` above its minimum.

    Parameters
    ----------
    state : _State
        Start of the descent, with alpha and beta.
    data : _Data
        The training data.
    settings : TrainingSettings
        Settings of the training.

    Returns
    -------
    _State
        The minimum, or the last point if no step lowers F any more.
    """
    mu = max(settings.mu, MIN_MU)
    for _ in range(MAX_DESCENT_STEPS):
        if state.newton_decrement() < DESCENT_DECREMENT:
            break
        weights, mu = _find_step(state, mu, data, settings)
        if weights is None:
            # No step lowers F, even with the largest damping.
            break
        state = state._replace(point=_make_linear_model(weights, data))
    return state._replace(gamma=_compute_gamma(state, data))


def _find_step(
    state: _State, mu: float, data: _Data, settings: TrainingSettings
) -> tuple[np.ndarray | None, float]:
    """Find a step of the Levenberg-Marquardt method that lowers the objective F.

    The new weights are w - (H / 2 + mu I)^-1 (gradient / 2), where H is the Hessian of
    F = beta E_d + alpha E_w. The damping mu is raised until such a step lowers F (Hagan
    & Menhaj 1994). A larger damping makes the step shorter.

    Parameters
    ----------
    state : _State
        Weights with their alpha and beta.
    mu : float
        The first damping.
    data : _Data
        The training data.
    settings : TrainingSettings
        Settings of the training.

    Returns
    -------
    weights : array (N,) or None
        None if no step up to the largest mu lowers F.
    mu : float
        The damping with which the search for the next step begins. It is above
        `mu_max` if there is no step.
    """
    point = state.point
    half_gradient = state.half_gradient()
    identity = np.eye(point.w.size)
    F = state.beta * point.Ed + state.alpha @ point.Ew
    while mu <= settings.mu_max:
        damped = state.beta * point.JJ + (state.alpha_of_weight + mu) * identity
        weights = point.w - np.linalg.solve(damped, half_gradient)
        new_residuals = compute_residuals(weights, data.x, data.t, data.root_weight)
        new_Ew = _sum_squares(weights, data.classes)
        new_F = state.beta * (new_residuals @ new_residuals) + state.alpha @ new_Ew
        if new_F < F:
            return weights, max(mu * settings.mu_decrease, MIN_MU)
        mu *= settings.mu_increase
    return None, mu


def _compute_gamma(state: _State, data: _Data) -> np.ndarray:
    """Count the weights (classes,) that the data determine (FH 2), (M92).

    gamma = N - 2 alpha tr(H^-1), class by class.
    """
    diagonal = np.diagonal(np.linalg.inv(state.half_hessian()))
    # H / 2 was inverted, so the traces already have the factor 2.
    traces = np.array([diagonal[members].sum() for members in data.classes])
    return data.size - state.alpha * traces


def _re_estimate(point: _Point, state: _State, data: _Data) -> _State:
    """Re-estimate gamma, alpha and beta at new weights (FH 2-3).

    alpha = gamma / (2 E_w) and beta = (n - gamma) / (2 E_d).
    """
    gamma = _compute_gamma(state._replace(point=point), data)
    # If a class has faded, its gamma may be lost in rounding. Then keep its alpha.
    alpha = np.where(
        gamma > 0, gamma / (2 * np.maximum(point.Ew, MIN_SQUARES)), state.alpha
    )
    alpha = np.minimum(alpha, MAX_ALPHA)
    beta = (data.n - gamma.sum()) / (2 * max(point.Ed + data.pure_error, MIN_SQUARES))
    return _State(
        point=point,
        alpha=alpha,
        alpha_of_weight=spread_over_weights(alpha, data.classes, point.w.size),
        beta=beta,
        gamma=gamma,
    )


def _make_linear_model(w: np.ndarray, data: _Data) -> _Point:
    """Linearise the residuals about weights."""
    e, J = linearise_residuals(w, data.x, data.t, data.root_weight)
    return _Point(
        w=w, Ed=e @ e, Ew=_sum_squares(w, data.classes), JJ=J.T @ J, Je=J.T @ e
    )


def _sum_squares(w: np.ndarray, classes: Sequence[Any]) -> np.ndarray:
    """Compute E_w of each class."""
    return np.array([w[members] @ w[members] for members in classes])


def compute_residuals(
    w: np.ndarray, x: np.ndarray, t: np.ndarray, root_weight: np.ndarray
) -> np.ndarray:
    """Compute the weighted residuals (samples * outputs,); x and t are scaled."""
    inputs = x.shape[1]
    outputs = t.shape[1]
    hidden = count_hidden_neurons(w.size, inputs, outputs)
    W1, b1, W2, b2 = unpack_weights(w, inputs, hidden, outputs)
    y = np.tanh(x @ W1.T + b1) @ W2.T + b2
    return ((y - t) * root_weight).ravel()


def linearise_residuals(
    w: np.ndarray, x: np.ndarray, t: np.ndarray, root_weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the weighted residuals and their derivatives with respect to the weights.

    The residuals (samples * outputs,) are those of `compute_residuals`. The derivatives
    have the shape (samples * outputs, N).
    """
    y, J = compute_jacobian(w, x, t.shape[1])
    e = ((y - t) * root_weight).ravel()
    J = (J * root_weight[:, :, None]).reshape(t.size, w.size)
    return e, J
