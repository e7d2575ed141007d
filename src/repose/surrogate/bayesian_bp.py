"""BP network with Bayesian regularisation: a few inputs in, a few responses out, error bars with them.

Section 3.2.2 of the paper: 6-12-2, tansig and purelin, inputs and outputs scaled to 0.1-0.9, trained by
Levenberg-Marquardt on a regularised sum of squares. This file needs numpy alone and knows nothing of berries:

    from repose.network import BayesianBP
    model = BayesianBP(hidden=6).fit(X, y)
    mean, std = model.predict(X_new, return_std=True)

`BayesianBP` is `PlainBayesianBP` below as an estimator of scikit-learn, where that is installed
(`sklearn_estimator`; imported when the name is first asked for). `training.py` is the workflow's stage.

Sources of the lines, named where they are used
  (Eq. n)   the paper
  (FH n)    Foresee & Hagan 1997, Gauss-Newton approximation to Bayesian learning, step n of section 4
  (M92)     MacKay 1992, Bayesian interpolation / A practical Bayesian framework, Neural Computation 4
  (M94)     MacKay 1994, Bayesian non-linear modeling for the prediction competition: a prior for each input
  (HM94)    Hagan & Menhaj 1994, training feedforward networks with the Marquardt algorithm
  (NW90)    Nguyen & Widrow 1990, improving the learning speed of two-layer networks
  (A35)     Aitken 1935, on least squares and linear combination of observations: residuals whose noises are
            correlated are made independent by a root of their covariance

Notation: D the data, w all N weights, n residuals (samples times outputs), E_d and E_w plain sums of squares,
so the noise variance is 1 / (2 beta) and the prior variance of a weight 1 / (2 alpha). Weights may fall into
classes c with an alpha_c each; then E_w and alpha are vectors and alpha E_w their scalar product.
"""

import json
import math
from pathlib import Path

import numpy as np

from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS

RESPONSES = ("aor_deg", "height_mm")


class PlainBayesianBP:
    """Two-layer network trained by Bayesian regularisation from several starts; the best by evidence is kept.

    hidden: neurons of the hidden layer. epochs: most accepted steps of a start. goal: mean squared error of
    the scaled outputs at which training stops. starts: independent Nguyen-Widrow starts. mu, mu_decrease,
    mu_increase, mu_max: Marquardt's damping; min_gradient: norm of the gradient of the objective at which a
    start has converged. scaled_range: interval onto which each input and output is mapped by its minimum and
    maximum in the training data. seed: of numpy's RandomState; start k draws from RandomState([seed, k]), so
    it is the same start however many others there are. prior: "one" alpha for all weights, as published
    (FH); "layers", one each for input weights, hidden biases, and output weights with their biases (M92); or
    "inputs", as "layers" but with one for each input's weights, so that an input without effect fades (M94).

    After fit: W1_ (hidden, inputs), b1_ (hidden,), W2_ (outputs, hidden), b2_ (outputs,), input_min_,
    input_max_, output_min_, output_max_, alpha_ (a vector unless prior is "one"), beta_, gamma_,
    log_evidence_, epochs_, stop_reason_, best_start_, noise_std_ (outputs,) in units of y,
    posterior_root_ (N, N) whose product with its transpose is the weights' covariance, and starts_, a list
    with one dict per start.
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
        prior="one",
    ):
        self.hidden, self.epochs, self.goal, self.starts = hidden, epochs, goal, starts
        self.mu, self.mu_decrease, self.mu_increase, self.mu_max = mu, mu_decrease, mu_increase, mu_max
        self.min_gradient, self.scaled_range, self.seed = min_gradient, scaled_range, seed
        self.prior = prior

    def fit(self, X, y, sample_weight=None, precision=None, noise_covariance=None):
        """Train on X (samples, inputs) and y (samples,) or (samples, outputs); return self.

        sample_weight (samples,): how often a sample counts, as in scikit-learn: 2 is the sample twice, 0 not
        at all. precision (samples,) or (samples, outputs): how exact a target is beside the others; the noise
        variance of its residual is 1 / (2 beta precision), and only ratios matter (`weights_from_errors`
        makes them from standard errors; log_evidence_ leaves out their constant, sum log precision / 2).
        noise_covariance (outputs, outputs): of the noise of a sample's targets, up to a factor. Targets of one
        experiment share its noise; taken as independent, what they share looks like a signal to be learned.
        With it the network is trained on combinations of the outputs whose noises are independent (A35) and
        given back in units of y; precision then is one number a sample.
        Raises ValueError for a setting out of its limits, other shapes, values that are not finite, negative
        weights, precisions not above zero, a covariance that is none, and when no start ends with a finite
        evidence.
        """
        self._check_settings()
        X, Y, count, precision = _checked(X, y, sample_weight, precision)
        self.one_output_ = np.ndim(y) == 1
        self.input_min_, self.input_max_ = X.min(axis=0), X.max(axis=0)
        self.output_min_, self.output_max_ = Y.min(axis=0), Y.max(axis=0)
        x = _scale(X, self.input_min_, self.input_max_, self.scaled_range)
        mixing = self._mixing(noise_covariance, precision)
        t = _scale(Y, self.output_min_, self.output_max_, self.scaled_range) @ mixing

        root_weight, n = np.sqrt(count[:, None] * precision), float(count.sum() * t.shape[1])
        ends = []
        for k in range(self.starts):
            w = nguyen_widrow(x.shape[1], self.hidden, t.shape[1], self.scaled_range, (self.seed, k))
            ends.append(self._train(w, x, t, root_weight, n))
        self.starts_ = [{"start": k} | {key: end[key] for key in STATISTICS} for k, end in enumerate(ends)]
        self.best_start_ = max(range(self.starts), key=lambda k: ends[k]["log_evidence"])
        best = ends[self.best_start_]
        if best["log_evidence"] == -math.inf:
            raise ValueError(f"none of {self.starts} starts ended with a finite evidence")
        w = mix_outputs(best["w"], np.linalg.inv(mixing), self.hidden)
        self.W1_, self.b1_, self.W2_, self.b2_ = unpack(w, x.shape[1], self.hidden, t.shape[1])
        self.alpha_, self.beta_, self.gamma_ = best["alpha"], best["beta"], best["gamma"]
        self.log_evidence_, self.epochs_ = best["log_evidence"], best["epochs"]
        self.stop_reason_, self.n_residuals_ = best["stop_reason"], t.size
        self._set_errors(posterior_root(best["alpha_of_weight"], self.beta_, best["JJ"]), mixing)
        return self

    def predict(self, X, return_std=False, noise=True):
        """Responses (samples, outputs), or (samples,) when fitted on such, for X (samples, inputs).

        With return_std also their standard deviations, of the same shape: sqrt(1 / (2 beta) + g' H^-1 g)
        with g the output's gradient by the weights (M92), in units of y. The first term is the noise of a
        single target of precision 1 (noise_std_); noise=False leaves it out, and the uncertainty of the mean
        remains.
        """
        if not hasattr(self, "W1_"):
            raise ValueError("predict was called before fit")
        X = np.asarray(X, dtype=float)
        if X.ndim != 2 or X.shape[1] != len(self.input_min_):
            raise ValueError(f"X has shape {X.shape}; allowed: (samples, {len(self.input_min_)})")
        Y = evaluate(self.to_dict(), X)
        Y = Y[:, 0] if self.one_output_ else Y
        if not return_std:
            return Y
        variance = (self._weight_roots(X) ** 2).sum(axis=2) * self._stretch() ** 2
        std = np.sqrt(variance + noise * self.noise_std_**2)
        return Y, std[:, 0] if self.one_output_ else std

    def covariance(self, X):
        """Covariance (samples, outputs, outputs) of the responses by the uncertainty of the weights alone.

        In units of y squared, for X (samples, inputs); its diagonal is the square of what `predict` gives with
        return_std=True, noise=False. The outputs share the hidden layer, so their errors are correlated.
        """
        roots = self._weight_roots(np.asarray(X, dtype=float)) * self._stretch()[:, None]
        return roots @ roots.transpose(0, 2, 1)

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

    @classmethod
    def restored(cls, network, X, alpha, beta, precision=None, prior="one", noise_covariance=None):
        """A fitted network with its error bars, from what was saved of it.

        network: of `load`. X (samples, inputs): the inputs it was trained on; precision and noise_covariance as
        `fit` was given them. alpha, beta: of the end of training. The Hessian is that of the saved weights, so
        nothing is trained.
        """
        arrays = {key: np.asarray(network[key], dtype=float) for key in ARRAYS}
        model = cls(hidden=len(arrays["b1"]), scaled_range=tuple(network["scaled_range"]), prior=prior)
        for key, value in arrays.items():
            setattr(model, f"{key}_", value)
        model.alpha_, model.beta_, model.one_output_ = alpha, float(beta), False
        X, _, _, precision = _checked(X, np.zeros((len(X), len(arrays["b2"]))), None, precision)
        w = np.concatenate([arrays[key].ravel() for key in ("W1", "b1", "W2", "b2")])
        mixing = model._mixing(noise_covariance, precision)
        w = mix_outputs(w, mixing, model.hidden)
        x = _scale(X, model.input_min_, model.input_max_, model.scaled_range)
        J = (jacobian(w, x, len(model.b2_))[1] * np.sqrt(precision)[:, :, None]).reshape(-1, w.size)
        classes = weight_classes(prior, X.shape[1], model.hidden, len(model.b2_))
        alpha_of_weight = _spread(np.atleast_1d(alpha), classes, w.size)
        model._set_errors(posterior_root(alpha_of_weight, beta, J.T @ J), mixing)
        return model

    def _mixing(self, noise_covariance, precision):
        """Scaled outputs times this (outputs, outputs) have independent noises of one variance; its
        determinant is one, so that they stay about as wide."""
        stretch = self._stretch()
        if noise_covariance is None:
            return np.eye(len(stretch))
        covariance = np.asarray(noise_covariance, dtype=float)
        if covariance.shape != 2 * stretch.shape or not np.allclose(covariance, covariance.T):
            raise ValueError(
                f"noise_covariance is {noise_covariance!r}; allowed: symmetric, {2 * stretch.shape}"
            )
        if np.ptp(precision, axis=1).any():
            raise ValueError("precision differs between outputs; allowed with noise_covariance: one a sample")
        try:
            root = np.linalg.cholesky(covariance / np.outer(stretch, stretch))
        except np.linalg.LinAlgError as error:
            raise ValueError(
                f"noise_covariance is {noise_covariance!r}; allowed: positive definite"
            ) from error
        return np.linalg.inv(root).T * np.prod(np.diagonal(root)) ** (1 / len(root))

    def _set_errors(self, root, mixing):
        """The weights' posterior and the noise, both of the outputs as they were before mixing."""
        unmix = np.linalg.inv(mixing)
        self.posterior_root_ = mix_outputs(root, unmix, self.hidden)
        self.noise_std_ = np.linalg.norm(unmix, axis=0) * self._stretch() / math.sqrt(2 * self.beta_)

    def _weight_roots(self, X):
        """dy/dw times the root of the weights' covariance, (samples, outputs, N), outputs scaled."""
        w = np.concatenate([self.W1_.ravel(), self.b1_, self.W2_.ravel(), self.b2_])
        x = _scale(X, self.input_min_, self.input_max_, self.scaled_range)
        _, J = jacobian(w, x, len(self.b2_))
        return (J.reshape(-1, w.size) @ self.posterior_root_).reshape(J.shape)  # one large product

    def _check_settings(self):
        for name, least in (("hidden", 1), ("epochs", 1), ("starts", 1), ("goal", 0)):
            if not getattr(self, name) >= least:
                raise ValueError(f"{name} is {getattr(self, name)!r}; allowed: at least {least}")
        if self.prior not in PRIORS:
            raise ValueError(f"prior is {self.prior!r}; allowed: {', '.join(PRIORS)}")
        low, high = self.scaled_range
        if not low < high:
            raise ValueError(f"scaled_range is {self.scaled_range!r}; allowed: its first below its second")

    def _stretch(self):
        """Units of y in one unit of a scaled output, (outputs,)."""
        low, high = self.scaled_range
        return _width(self.output_min_, self.output_max_) / (high - low)

    def _train(self, w, x, t, root_weight, n):
        """One start from the weights w: Levenberg-Marquardt on F = beta E_d + alpha E_w (FH 1-4)."""
        N, identity = w.size, np.eye(w.size)
        classes = weight_classes(self.prior, x.shape[1], self.hidden, t.shape[1])
        size = np.array([w[c].size for c in classes], dtype=float)

        def square_sums(w):
            return np.array([w[c] @ w[c] for c in classes])

        # FH 0 sets alpha = 0, with which gamma is N and beta negative as soon as n < N; any small prior
        # avoids it
        alpha, beta, gamma, mu = np.full(len(classes), 0.01), 1.0, size, self.mu
        alpha_of_weight = _spread(alpha, classes, N)
        e, J = _linearise(w, x, t, root_weight)
        Ed, Ew, JJ, Je = e @ e, square_sums(w), J.T @ J, J.T @ e
        epoch, reason = 0, "epochs"
        while epoch < self.epochs:
            half_gradient = beta * Je + alpha_of_weight * w
            if Ed / n <= self.goal:
                reason = "goal"
                break
            if 2 * np.linalg.norm(half_gradient) < self.min_gradient:
                reason = "gradient"
                break
            # (HM94): damp until F falls
            while mu <= self.mu_max:
                damped = beta * JJ + (alpha_of_weight + mu) * identity
                candidate = w - np.linalg.solve(damped, half_gradient)
                e = _residuals(candidate, x, t, root_weight)
                if beta * (e @ e) + alpha @ square_sums(candidate) < beta * Ed + alpha @ Ew:
                    break
                mu *= self.mu_increase
            else:
                reason = "mu"
                break
            mu *= self.mu_decrease
            w = candidate
            e, J = _linearise(w, x, t, root_weight)
            Ed, Ew, JJ, Je = e @ e, square_sums(w), J.T @ J, J.T @ e
            # gamma = N - 2 alpha tr(H^-1), H = 2 beta J'J + 2 alpha I, class by class  (FH 2), (M92)
            inverse = np.diagonal(np.linalg.inv(beta * JJ + alpha_of_weight * identity))
            gamma = size - alpha * np.array([inverse[c].sum() for c in classes])
            # (FH 3); gamma of a class that has faded may be lost in rounding
            alpha = np.where(gamma > 0, gamma / (2 * np.maximum(Ew, SMALLEST)), alpha)
            alpha = np.minimum(alpha, LARGEST_ALPHA)
            alpha_of_weight = _spread(alpha, classes, N)
            beta = (n - gamma.sum()) / (2 * max(Ed, SMALLEST))
            epoch += 1
        return {
            "w": w,
            "JJ": JJ,
            "alpha_of_weight": alpha_of_weight,
            "log_evidence": log_evidence(alpha, beta, Ed, Ew, JJ, n, classes),
            "gamma": float(gamma.sum()),
            "alpha": float(alpha[0]) if self.prior == "one" else alpha,
            "beta": float(beta),
            "mse": Ed / n,
            "epochs": epoch,
            "stop_reason": reason,
        }


PRIORS = ("one", "layers", "inputs")
ARRAYS = ("input_min", "input_max", "output_min", "output_max", "W1", "b1", "W2", "b2")
STATISTICS = ("log_evidence", "gamma", "alpha", "beta", "mse", "epochs", "stop_reason")
LARGEST_ALPHA = 1e6  # weights of 0.0007 in scaled units: an input that has faded
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


def mix_outputs(w, mixing, hidden):
    """Weights (N,), or (N, columns), of the network whose outputs are the given one's times mixing."""
    outputs = len(mixing)
    first = len(w) - outputs * (hidden + 1)
    W2 = w[first : len(w) - outputs].reshape(outputs, -1)
    b2 = w[len(w) - outputs :].reshape(outputs, -1)
    tail = [(mixing.T @ part).reshape(-1, *w.shape[1:]) for part in (W2, b2)]
    return np.concatenate([w[:first], *tail])


def weight_classes(prior, inputs, hidden, outputs):
    """Which of the N weights share an alpha: a list of index arrays into w, or of the slice of all of it."""
    if prior == "one":
        return [slice(None)]
    w = np.arange(hidden * (inputs + 1) + outputs * (hidden + 1))
    first, second = hidden * inputs, hidden * (inputs + 1)
    W1 = w[:first].reshape(hidden, inputs)
    input_weights = list(W1.T) if prior == "inputs" else [W1.ravel()]
    return [*input_weights, w[first:second], w[second:]]


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
    _, log_det = np.linalg.slogdet(2 * beta * JJ + np.diag(2 * _spread(alpha, classes, len(JJ))))
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


def weights_from_errors(errors):
    """Precisions (samples, outputs) of mean one from standard errors of the same shape, for `fit`.

    A sample's variance about the network is its own se^2 plus what the network cannot follow, taken as large
    as the median se^2; the sum also keeps a standard error that is small by luck, out of few seeds, from
    ruling. A sample without one (a single seed) counts as the noisiest.
    """
    known = np.where(np.isfinite(errors), errors, np.nanmax(errors, axis=0))
    variance = known**2 + np.median(known**2, axis=0)
    return (1 / variance) / np.mean(1 / variance, axis=0)


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


def _spread(alpha, classes, N):
    """alpha of each class (classes,) to alpha of each weight (N,)."""
    of_weight = np.empty(N)
    for value, c in zip(alpha, classes, strict=True):
        of_weight[c] = value
    return of_weight


def _checked(X, y, sample_weight, precision):
    """X (samples, inputs), Y and precision (samples, outputs), count (samples,): finite, of samples that
    count, or ValueError."""
    X, Y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
    Y = Y[:, None] if Y.ndim == 1 else Y
    if X.ndim != 2 or Y.ndim != 2 or len(X) != len(Y) or X.size == 0 or Y.size == 0:
        raise ValueError(f"X has shape {X.shape}, y {np.shape(y)}; allowed: two tables of as many samples")
    count = np.ones(len(X)) if sample_weight is None else np.asarray(sample_weight, dtype=float)
    precision = np.ones(len(X)) if precision is None else np.asarray(precision, dtype=float)
    if count.shape != (len(X),):
        raise ValueError(f"sample_weight has shape {count.shape}; allowed: {(len(X),)}")
    if precision.shape not in ((len(X),), Y.shape):
        raise ValueError(f"precision has shape {precision.shape}; allowed: {(len(X),)} or {Y.shape}")
    if not all(np.isfinite(values).all() for values in (X, Y, count, precision)):
        raise ValueError("X, y, sample_weight and precision must be finite")
    if (count < 0).any() or (precision <= 0).any():
        raise ValueError("sample_weight must not be negative, precision must be above zero")
    precision = np.broadcast_to(precision.reshape(len(X), -1), Y.shape)
    counts = count > 0
    if np.count_nonzero(counts) < 2:
        raise ValueError(
            f"{np.count_nonzero(counts)} samples have a weight above zero; allowed: at least 2 (n_samples = {len(X)})"
        )
    return X[counts], Y[counts], count[counts], precision[counts]


def r2(y, predicted):
    """Eq. 13, or None where y (samples,) does not vary."""
    total = np.sum((y - np.mean(y)) ** 2)
    return float(1 - np.sum((y - predicted) ** 2) / total) if total > 0 else None


def __getattr__(name):
    """`BayesianBP`, made when first asked for: importing scikit-learn takes a second that a simulation's job
    need not spend."""
    if name != "BayesianBP":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from repose.surrogate.sklearn_estimator import BayesianBP
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "sklearn":
            raise
        BayesianBP = PlainBayesianBP
    globals()[name] = BayesianBP
    return BayesianBP
