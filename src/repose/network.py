"""BP network with Bayesian regularisation: six contact parameters in, AoR and Height out.

Section 3.2.2 of the paper: 6-12-2, tansig and purelin, inputs and outputs scaled to 0.1-0.9, trained by
Levenberg-Marquardt on a regularised sum of squares. `BayesianBP` needs numpy alone and knows nothing of
berries: fit / predict / score as scikit-learn has them. `training.py` is the workflow's stage around it.

Sources of the lines, named where they are used
  (Eq. n)   the paper
  (FH n)    Foresee & Hagan 1997, Gauss-Newton approximation to Bayesian learning, step n of section 4
  (M92)     MacKay 1992, Bayesian interpolation / A practical Bayesian framework, Neural Computation 4
  (HM94)    Hagan & Menhaj 1994, training feedforward networks with the Marquardt algorithm
  (NW90)    Nguyen & Widrow 1990, improving the learning speed of two-layer networks

Notation: D the data, w all N weights, n residuals (samples times outputs), E_d and E_w plain sums of squares,
so the noise variance is 1 / (2 beta) and the prior variance of a weight 1 / (2 alpha).
"""

import json
import math
from pathlib import Path

import numpy as np

from repose.errors import InputError
from repose.parameters import PARAMETERS

RESPONSES = ("aor_deg", "height_mm")


class BayesianBP:
    """Two-layer network trained by Bayesian regularisation from several starts; the best by evidence is kept.

    hidden: neurons of the hidden layer. epochs: most accepted steps of a start. goal: mean squared error of
    the scaled outputs at which training stops. starts: independent Nguyen-Widrow starts. mu, mu_decrease,
    mu_increase, mu_max: Marquardt's damping; min_gradient: norm of the gradient of the objective at which a
    start has converged. scaled_range: interval onto which each input and output is mapped by its minimum and
    maximum in the training data. seed: of numpy's RandomState; start k draws from RandomState([seed, k]), so
    it is the same start however many others there are.

    After fit: W1_ (hidden, inputs), b1_ (hidden,), W2_ (outputs, hidden), b2_ (outputs,), input_min_,
    input_max_, output_min_, output_max_, alpha_, beta_, gamma_, log_evidence_, epochs_, stop_reason_,
    best_start_, and starts_, a list with one dict per start.
    """

    def __init__(
        self,
        hidden=12,
        epochs=1500,
        goal=1e-4,
        starts=20,
        mu=0.005,
        mu_decrease=0.1,
        mu_increase=10.0,
        mu_max=1e10,
        min_gradient=1e-7,
        scaled_range=(0.1, 0.9),
        seed=2026,
    ):
        self.hidden, self.epochs, self.goal, self.starts = hidden, epochs, goal, starts
        self.mu, self.mu_decrease, self.mu_increase, self.mu_max = mu, mu_decrease, mu_increase, mu_max
        self.min_gradient, self.scaled_range, self.seed = min_gradient, scaled_range, seed

    def fit(self, X, y, sample_weight=None):
        """Train on X (samples, inputs) and y (samples,) or (samples, outputs); return self.

        sample_weight (samples,) or (samples, outputs): residuals count by it, as if their noise variance were
        1 / (2 beta weight). Raises ValueError for other shapes, values that are not finite, weights not above
        zero, and when no start ends with a finite evidence.
        """
        X, Y, weight = _checked(X, y, sample_weight)
        self.one_output_ = np.ndim(y) == 1
        self.input_min_, self.input_max_ = X.min(axis=0), X.max(axis=0)
        self.output_min_, self.output_max_ = Y.min(axis=0), Y.max(axis=0)
        x = _scale(X, self.input_min_, self.input_max_, self.scaled_range)
        t = _scale(Y, self.output_min_, self.output_max_, self.scaled_range)

        ends = []
        for k in range(self.starts):
            w = nguyen_widrow(x.shape[1], self.hidden, t.shape[1], self.scaled_range, (self.seed, k))
            ends.append(self._train(w, x, t, np.sqrt(weight)))
        self.starts_ = [{"start": k} | {key: end[key] for key in STATISTICS} for k, end in enumerate(ends)]
        self.best_start_ = max(range(self.starts), key=lambda k: ends[k]["log_evidence"])
        best = ends[self.best_start_]
        if best["log_evidence"] == -math.inf:
            raise ValueError(f"none of {self.starts} starts ended with a finite evidence")
        self.W1_, self.b1_, self.W2_, self.b2_ = unpack(best["w"], x.shape[1], self.hidden, t.shape[1])
        self.alpha_, self.beta_, self.gamma_ = best["alpha"], best["beta"], best["gamma"]
        self.log_evidence_, self.epochs_ = best["log_evidence"], best["epochs"]
        self.stop_reason_, self.n_residuals_ = best["stop_reason"], t.size
        return self

    def predict(self, X):
        """Responses (samples, outputs), or (samples,) when fitted on such, for X (samples, inputs)."""
        X = np.asarray(X, dtype=float)
        if X.ndim != 2 or X.shape[1] != len(self.input_min_):
            raise ValueError(f"X has shape {X.shape}; allowed: (samples, {len(self.input_min_)})")
        Y = evaluate(self.to_dict(), X)
        return Y[:, 0] if self.one_output_ else Y

    def score(self, X, y, sample_weight=None):
        """R2 (Eq. 13), the mean over the outputs; sample_weight (samples,) as scikit-learn takes it."""
        Y = np.asarray(y, dtype=float).reshape(len(X), -1)
        P = np.asarray(self.predict(X)).reshape(len(X), -1)
        weight = np.ones(len(Y)) if sample_weight is None else np.asarray(sample_weight, dtype=float)
        mean = np.average(Y, axis=0, weights=weight)
        return float(np.mean(1 - (weight @ (Y - P) ** 2) / (weight @ (Y - mean) ** 2)))

    def to_dict(self, inputs=None, outputs=None):
        """The network as plain lists, to be read by `evaluate`; inputs, outputs: the columns' names."""
        lists = {key: getattr(self, key + "_").tolist() for key in ARRAYS}
        return {
            "inputs": list(inputs or []),
            "outputs": list(outputs or []),
            "scaled_range": list(self.scaled_range),
            "activation": ["tansig", "purelin"],
            **lists,
        }

    def save(self, path, inputs=PARAMETERS, outputs=RESPONSES):
        """Write the network as JSON to path."""
        Path(path).write_text(json.dumps(self.to_dict(inputs, outputs), indent=1) + "\n")

    def _train(self, w, x, t, root_weight):
        """One start from the weights w: Levenberg-Marquardt on F = beta E_d + alpha E_w (FH 1-4)."""
        N, n = w.size, t.size
        identity = np.eye(N)
        # FH 0 sets alpha = 0, with which gamma is N and beta negative as soon as n < N; any small prior
        # avoids it
        alpha, beta, gamma, mu = 0.01, 1.0, float(N), self.mu
        e, J = _linearise(w, x, t, root_weight)
        Ed, Ew, JJ, Je = e @ e, w @ w, J.T @ J, J.T @ e
        epoch, reason = 0, "epochs"
        while epoch < self.epochs:
            half_gradient = beta * Je + alpha * w
            if Ed / n <= self.goal:
                reason = "goal"
                break
            if 2 * np.linalg.norm(half_gradient) < self.min_gradient:
                reason = "gradient"
                break
            # (HM94): damp until F falls
            while mu <= self.mu_max:
                candidate = w - np.linalg.solve(beta * JJ + (alpha + mu) * identity, half_gradient)
                e = _residuals(candidate, x, t, root_weight)
                if beta * (e @ e) + alpha * (candidate @ candidate) < beta * Ed + alpha * Ew:
                    break
                mu *= self.mu_increase
            else:
                reason = "mu"
                break
            mu *= self.mu_decrease
            w = candidate
            e, J = _linearise(w, x, t, root_weight)
            Ed, Ew, JJ, Je = e @ e, w @ w, J.T @ J, J.T @ e
            # gamma = N - 2 alpha tr(H^-1), H = 2 beta J'J + 2 alpha I  (FH 2)
            gamma = N - alpha * np.trace(np.linalg.inv(beta * JJ + alpha * identity))
            alpha, beta = gamma / (2 * Ew), (n - gamma) / (2 * max(Ed, SMALLEST))  # (FH 3)
            epoch += 1
        return {
            "w": w,
            "log_evidence": log_evidence(alpha, beta, Ed, Ew, JJ, n),
            "gamma": gamma,
            "alpha": alpha,
            "beta": beta,
            "mse": Ed / n,
            "epochs": epoch,
            "stop_reason": reason,
        }


ARRAYS = ("input_min", "input_max", "output_min", "output_max", "W1", "b1", "W2", "b2")
STATISTICS = ("log_evidence", "gamma", "alpha", "beta", "mse", "epochs", "stop_reason")
SMALLEST = 1e-30  # E_d of outputs that a network meets exactly


def evaluate(network, X):
    """Responses (samples, outputs) of a network read from JSON for X (samples, inputs); Eq. 6-8."""
    a = {key: np.asarray(network[key], dtype=float) for key in (*ARRAYS, "scaled_range")}
    low, high = a["scaled_range"]
    x = _scale(np.asarray(X, dtype=float), a["input_min"], a["input_max"], (low, high))
    y = np.tanh(x @ a["W1"].T + a["b1"]) @ a["W2"].T + a["b2"]
    return a["output_min"] + (y - low) / (high - low) * _width(a["output_min"], a["output_max"])


def response_function(network, low, high):
    """The same network as a function of populations in [-1, 1]: (points, inputs) to (points, outputs).

    low, high: what -1 and 1 stand for in each input. Every scaling is folded into the weights, which leaves
    two small matrix products and a tanh for a search that calls it millions of times.
    """
    a = {key: np.asarray(network[key], dtype=float) for key in (*ARRAYS, "scaled_range")}
    bottom, top = a["scaled_range"]
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    per_unit = (top - bottom) / _width(a["input_min"], a["input_max"])
    W1 = np.ascontiguousarray((a["W1"] * per_unit * (high - low) / 2).T)
    b1 = a["b1"] + a["W1"] @ (bottom + ((low + high) / 2 - a["input_min"]) * per_unit)
    stretch = _width(a["output_min"], a["output_max"]) / (top - bottom)
    W2 = np.ascontiguousarray((a["W2"] * stretch[:, None]).T)
    b2 = a["output_min"] + (a["b2"] - bottom) * stretch
    return lambda points: np.tanh(points @ W1 + b1) @ W2 + b2


def load(path):
    """A network written by `BayesianBP.save` as a dict for `evaluate`; InputError when it is none."""
    try:
        network = json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise InputError(path, "network", str(error), "a network's JSON file") from error
    for key in (*ARRAYS, "scaled_range", "inputs", "outputs"):
        if not isinstance(network, dict) or key not in network:
            raise InputError(path, key, None, "present in a network's JSON file")
    return network


def nguyen_widrow(inputs, hidden, outputs, scaled_range, seed):
    """Random weights (N,) whose neurons' slopes are spread over the inputs' interval (NW90)."""
    random = np.random.RandomState(seed)
    length = 0.7 * hidden ** (1 / inputs)  # (NW90)
    W1 = random.uniform(-1, 1, (hidden, inputs))
    W1 *= length / np.linalg.norm(W1, axis=1, keepdims=True)
    b1 = random.uniform(-length, length, hidden)
    # (NW90) has inputs in [-1, 1]; the same neurons for inputs in scaled_range
    middle, half = (scaled_range[0] + scaled_range[1]) / 2, (scaled_range[1] - scaled_range[0]) / 2
    W1 /= half
    b1 -= W1.sum(axis=1) * middle
    return np.concatenate([W1.ravel(), b1, random.uniform(-0.5, 0.5, outputs * (hidden + 1))])


def unpack(w, inputs, hidden, outputs):
    """Views W1 (hidden, inputs), b1 (hidden,), W2 (outputs, hidden), b2 (outputs,) of the weights w (N,)."""
    ends = np.cumsum([hidden * inputs, hidden, outputs * hidden])
    W1, b1, W2, b2 = np.split(w, ends)
    return W1.reshape(hidden, inputs), b1, W2.reshape(outputs, hidden), b2


def jacobian(w, x, outputs):
    """Scaled outputs y (samples, outputs) and dy/dw (samples, outputs, N) at inputs x (samples, inputs).

    The chain rule of the paper's step (3), for each output by itself as Levenberg-Marquardt needs it (HM94).
    """
    samples, inputs = x.shape
    hidden = (w.size - outputs) // (inputs + 1 + outputs)
    W1, b1, W2, b2 = unpack(w, inputs, hidden, outputs)
    a = np.tanh(x @ W1.T + b1)  # (Eq. 6-7)
    y = a @ W2.T + b2  # (Eq. 8)
    J = np.zeros((samples, outputs, w.size))
    through = W2 * (1 - a * a)[:, None, :]  # dy_k / dz_j
    first = hidden * inputs
    J[:, :, :first] = (through[:, :, :, None] * x[:, None, None, :]).reshape(samples, outputs, first)
    J[:, :, first : first + hidden] = through
    for k in range(outputs):
        start = first + hidden + k * hidden
        J[:, k, start : start + hidden] = a
        J[:, k, w.size - outputs + k] = 1.0
    return y, J


def log_evidence(alpha, beta, Ed, Ew, JJ, n):
    """log p(D | alpha, beta) by Laplace's approximation at the most probable weights (M92).

    Likelihood (beta/pi)^(n/2) exp(-beta E_d), prior (alpha/pi)^(N/2) exp(-alpha E_w),
    H = 2 beta J'J + 2 alpha I:
    log p = n/2 log(beta/pi) + N/2 log(2 alpha) - 1/2 log det H - beta E_d - alpha E_w.
    -inf where that is no number, so such a start is never the best.
    """
    if not (alpha > 0 and beta > 0):
        return -math.inf
    N = len(JJ)
    _, log_det = np.linalg.slogdet(2 * beta * JJ + 2 * alpha * np.eye(N))
    value = (
        n / 2 * math.log(beta / math.pi) + N / 2 * math.log(2 * alpha) - log_det / 2 - beta * Ed - alpha * Ew
    )
    return float(value) if math.isfinite(value) else -math.inf


def _residuals(w, x, t, root_weight):
    hidden = (w.size - t.shape[1]) // (x.shape[1] + 1 + t.shape[1])
    W1, b1, W2, b2 = unpack(w, x.shape[1], hidden, t.shape[1])
    return ((np.tanh(x @ W1.T + b1) @ W2.T + b2 - t) * root_weight).ravel()


def _linearise(w, x, t, root_weight):
    """Weighted residuals (n,) and their derivative (n, N)."""
    y, J = jacobian(w, x, t.shape[1])
    return ((y - t) * root_weight).ravel(), (J * root_weight[:, :, None]).reshape(t.size, w.size)


def _scale(X, minimum, maximum, interval):
    """mapminmax: minimum to the interval's lower end, maximum to its upper."""
    return interval[0] + (X - minimum) / _width(minimum, maximum) * (interval[1] - interval[0])


def _width(minimum, maximum):
    """maximum - minimum, 1 for a column that does not vary and has nothing to be scaled by."""
    return np.where(maximum > minimum, maximum - minimum, 1.0)


def _checked(X, y, sample_weight):
    """X (samples, inputs), Y and weight (samples, outputs) as finite float arrays, or ValueError."""
    X, Y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
    Y = Y[:, None] if Y.ndim == 1 else Y
    if X.ndim != 2 or Y.ndim != 2 or len(X) != len(Y) or len(X) < 2:
        raise ValueError(
            f"X has shape {X.shape}, y {np.shape(y)}; allowed: at least 2 samples, as many in both"
        )
    weight = np.ones(len(X)) if sample_weight is None else np.asarray(sample_weight, dtype=float)
    if weight.shape not in ((len(X),), Y.shape):
        raise ValueError(f"sample_weight has shape {weight.shape}; allowed: {(len(X),)} or {Y.shape}")
    weight = np.broadcast_to(weight.reshape(len(X), -1), Y.shape)
    if not (
        np.isfinite(X).all() and np.isfinite(Y).all() and np.isfinite(weight).all() and (weight > 0).all()
    ):
        raise ValueError("X, y and sample_weight must be finite, sample_weight above zero")
    return X, Y, weight


def r2(y, predicted):
    """Eq. 13, or None where y (samples,) does not vary."""
    total = np.sum((y - np.mean(y)) ** 2)
    return float(1 - np.sum((y - predicted) ** 2) / total) if total > 0 else None
