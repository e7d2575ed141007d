"""BP network with Bayesian regularisation: a few inputs in, a few responses out, error bars with them.

Section 3.2.2 of the paper: 6-12-2, tansig and purelin, inputs and outputs scaled to 0.1-0.9, trained by
Levenberg-Marquardt on a regularised sum of squares. It needs numpy alone::

    from repose.calibrate.surrogates.bayesian_bp import BayesianBP
    model = BayesianBP(hidden=6).fit(X, y)
    mean, std = model.predict(X_new, return_std=True)

Sources of the lines, named where they are used
  (Eq. n)   the paper
  (FH n)    Foresee & Hagan 1997, Gauss-Newton approximation to Bayesian learning, step n of section 4
  (M92)     MacKay 1992, Bayesian interpolation / A practical Bayesian framework, Neural Computation 4
  (M94)     MacKay 1994, Bayesian non-linear modeling for the prediction competition: a prior for each input
  (A35)     Aitken 1935, on least squares and linear combination of observations

Notation: w all N weights, n residuals (samples times outputs); the noise variance is 1 / (2 beta) and the prior
variance of a weight 1 / (2 alpha).
"""

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.surrogates.base import Noise, Surrogate, register
from repose.calibrate.surrogates.evidence import of_each_weight, posterior_root
from repose.calibrate.surrogates.levenberg_marquardt import (
    CONVERGED,
    STATISTICS,
    TrainingSettings,
    train_start,
)
from repose.calibrate.surrogates.samples import (
    checked_points,
    checked_samples,
    independent_mixing,
    pure_error,
)
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.two_layer import (
    ARRAYS,
    PRIORS,
    class_names,
    evaluate,
    jacobian,
    mix_outputs,
    nguyen_widrow,
    response_function,
    scale,
    unpack,
    weight_classes,
    width,
)

AT_ONCE = 256  # points whose derivatives by all weights of several networks are in memory together


@register("network")
@dataclass(eq=False, repr=False)
class BayesianBP(TrainingSettings, Surrogate):
    """Two-layer network trained by Bayesian regularisation from several starts; of the converged the best is kept.

    If no start has converged, the best of all is kept. `prior` is "one" alpha for all weights, as published (FH);
    "layers", an alpha each for input weights, hidden biases, and output weights with their biases (M92); or "inputs",
    as "layers" but with an alpha for each input's weights, so that an input without effect fades (M94).
    """

    hidden: int = 12  # neurons of the hidden layer
    starts: int = 20  # independent, each from Nguyen-Widrow weights
    scaled_range: tuple[float, float] = (0.1, 0.9)  # of inputs and outputs in training
    seed: int = 2026  # start k draws from RandomState([seed, k])

    is_network = True
    of_all_samples = False  # as published: fitted to the training part

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        """Make an untrained network."""
        names = ("hidden", "epochs", "goal", "starts", "seed", "prior")
        return cls(**{name: getattr(settings, name) for name in names})

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        **noise: Unpack[Noise],
    ) -> Self:
        """Train; `precision`, `noise_covariance` and `noise_freedom` as in `Surrogate.fit`.

        `sample_weight` (samples,) is how often a sample counts, as in scikit-learn. With a covariance the network is
        trained on combinations of the outputs whose noises are independent (A35).
        """
        self._check_settings()
        X, Y, count, precision = checked_samples(X, y, sample_weight, **noise)
        self.one_output_ = np.ndim(y) == 1
        self.input_min_, self.input_max_ = X.min(axis=0), X.max(axis=0)
        self.output_min_, self.output_max_ = Y.min(axis=0), Y.max(axis=0)
        x = scale(X, self.input_min_, self.input_max_, self.scaled_range)
        noise_covariance = noise.get("noise_covariance")
        mixing = independent_mixing(noise_covariance, self._stretch(), precision)
        t = scale(Y, self.output_min_, self.output_max_, self.scaled_range) @ mixing

        weight, n = count[:, None] * precision, float(count.sum() * t.shape[1])
        replicates = pure_error(
            noise_covariance, noise.get("noise_freedom", 0.0), self._stretch(), mixing
        )
        self.training_ = {
            "inputs": X,
            "weight": weight,
            "noise_covariance": noise_covariance,
        }
        ends = []
        for k in range(self.starts):
            w = nguyen_widrow(
                x.shape[1], self.hidden, t.shape[1], self.scaled_range, (self.seed, k)
            )
            ends.append(train_start(w, x, t, np.sqrt(weight), n, self, replicates))
        self.ends_, self._mixing = ends, mixing
        self.starts_ = [
            {"start": k} | {key: end[key] for key in STATISTICS}
            for k, end in enumerate(ends)
        ]
        converged = [k for k, end in enumerate(ends) if end["decrement"] < CONVERGED]
        self.converged_starts_ = len(converged)
        self.best_start_ = max(
            converged or range(self.starts), key=lambda k: ends[k]["log_evidence"]
        )
        names = class_names(self.prior, self.inputs or range(X.shape[1]))
        # classes of weights whose alpha is the largest allowed
        self.at_cap_ = [names[c] for c in ends[self.best_start_]["at_cap"]]
        self._keep(ends[self.best_start_])
        self.n_residuals_ = t.size
        return self

    def of_start(self, k: int) -> Self:
        """Return the network at the end of start k of `fit`."""
        other = copy.copy(self)
        other._keep(self.ends_[k])
        return other

    def _keep(self, end: Mapping[str, Any]) -> None:
        """Take over the end of a start, with its outputs as they were before mixing."""
        if end["log_evidence"] == -math.inf:
            raise ValueError(
                f"none of {self.starts} starts ended with a finite evidence"
            )
        w = mix_outputs(end["w"], np.linalg.inv(self._mixing), self.hidden)
        sizes = len(self.input_min_), self.hidden, len(self._mixing)
        self.W1_, self.b1_, self.W2_, self.b2_ = unpack(w, *sizes)
        self.alpha_, self.beta_, self.gamma_ = end["alpha"], end["beta"], end["gamma"]
        self.log_evidence_, self.epochs_ = end["log_evidence"], end["epochs"]
        self.stop_reason_ = end["stop_reason"]  # goal, gradient, mu, evidence or epochs
        self._set_errors(
            posterior_root(end["alpha_of_weight"], self.beta_, end["JJ"]), self._mixing
        )

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        """Predict responses, (samples, outputs) or (samples,) as in `fit`; with `return_std` also standard deviations.

        These are sqrt(1 / (2 beta) + g' H^-1 g) with g the output's gradient by the weights (M92), in units of y;
        without `noise` the first term is left out.
        """
        if not hasattr(self, "W1_"):
            raise ValueError("predict was called before fit")
        X = checked_points(X, len(self.input_min_))
        Y = evaluate(self._arrays(), X)
        Y = Y[:, 0] if self.one_output_ else Y
        if not return_std:
            return Y
        variance = (weight_roots([self], X, self._weights()[None])[0] ** 2).sum(
            axis=2
        ) * self._stretch() ** 2
        std = np.sqrt(variance + noise * self.noise_std_**2)
        return Y, std[:, 0] if self.one_output_ else std

    @property
    def knows_its_errors(self) -> bool:
        return hasattr(self, "posterior_root_")

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (samples, outputs, outputs) of the responses by the weights alone."""
        return covariances([self], X)[0]

    def response_function(
        self, low: np.ndarray, high: np.ndarray
    ) -> Callable[[np.ndarray], np.ndarray]:
        # Every scaling is folded into the weights.
        return response_function(self._arrays(), low, high)

    def shifted(self, offset: np.ndarray) -> Self:
        # The output biases are scaled; `offset` is in the responses' units.
        bottom, top = self.scaled_range
        moved = copy.copy(self)
        moved.b2_ = self.b2_ + offset * (top - bottom) / width(
            self.output_min_, self.output_max_
        )
        return moved

    def report(self) -> dict[str, Any]:
        """Report evidence and end of the kept start, classes of its weights at the cap, numbers of starts, prior."""
        keys = [
            "gamma",
            "beta",
            "log_evidence",
            "epochs",
            "stop_reason",
            "best_start",
            "n_residuals",
        ]
        content = {
            key: getattr(self, key + "_")
            for key in [*keys, "converged_starts", "at_cap"]
        }
        content |= {
            "n_weights": self._weights().size,
            "starts": self.starts,
            "prior": self.prior,
        }
        return content | {"alpha": np.asarray(self.alpha_).tolist()}

    def start_rows(self) -> list[dict[str, Any]]:
        """List evidence and end of each start, and which was kept."""
        alphas = [
            " ".join(f"{a:.6g}" for a in np.atleast_1d(start["alpha"]))
            for start in self.starts_
        ]
        return [
            start
            | {
                "alpha": alpha,
                "at_cap": len(start["at_cap"]),
                "chosen": k == self.best_start_,
            }
            for k, (start, alpha) in enumerate(zip(self.starts_, alphas, strict=True))
        ]

    def to_dict(self) -> dict[str, Any]:
        """Collect scalings, weights, and the data for the errors of the weights."""
        lists = {key: getattr(self, key + "_").tolist() for key in ARRAYS}
        content = {
            "scaled_range": list(self.scaled_range),
            "activation": ["tansig", "purelin"],
            **lists,
        }
        if not hasattr(self, "training_"):
            return content
        training = {
            "prior": self.prior,
            "alpha": np.asarray(self.alpha_).tolist(),
            "beta": self.beta_,
        }
        data = {
            key: np.asarray(self.training_[key]).tolist()
            for key in ("noise_covariance", "inputs", "weight")
        }
        return content | {"training": training | data}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        # Nothing is trained: the Hessian follows from the saved weights. Without `training` it predicts without errors.
        arrays = {key: np.asarray(content[key], dtype=float) for key in ARRAYS}
        training = content.get("training")
        model = cls(
            hidden=len(arrays["b1"]), scaled_range=tuple(content["scaled_range"])
        )
        for key, value in arrays.items():
            setattr(model, f"{key}_", value)
        model.one_output_ = False
        if training is not None:
            model.prior, model.alpha_, model.beta_ = (
                training["prior"],
                training["alpha"],
                training["beta"],
            )
            model.training_ = {
                key: np.asarray(training[key], dtype=float)
                for key in ("inputs", "weight")
            }
            model.training_["noise_covariance"] = training["noise_covariance"]
            model._restore_errors(
                content.get("samples") or range(len(model.training_["inputs"]))
            )
        return model

    def _restore_errors(self, samples: Sequence[int]) -> None:
        """Compute noise and covariance of the weights, from the training samples in the order of their numbers.

        The Hessian is a sum over the samples; its last bits depend on their order.
        """
        order = np.argsort(samples)
        if len(order) != len(self.training_["inputs"]):
            raise ValueError(
                f"{len(order)} samples of {len(self.training_['inputs'])} inputs"
            )
        X, weight = self.training_["inputs"][order], self.training_["weight"][order]
        mixing = independent_mixing(
            self.training_["noise_covariance"], self._stretch(), weight
        )
        w = mix_outputs(self._weights(), mixing, self.hidden)
        x = scale(X, self.input_min_, self.input_max_, self.scaled_range)
        J = (jacobian(w, x, len(self.b2_))[1] * np.sqrt(weight)[:, :, None]).reshape(
            -1, w.size
        )
        classes = weight_classes(self.prior, X.shape[1], self.hidden, len(self.b2_))
        alpha_of_weight = of_each_weight(np.atleast_1d(self.alpha_), classes, w.size)
        self._set_errors(posterior_root(alpha_of_weight, self.beta_, J.T @ J), mixing)

    def _set_errors(self, root: np.ndarray, mixing: np.ndarray) -> None:
        """Set the weights' posterior and the noise, both for the outputs as they were before mixing."""
        unmix = np.linalg.inv(mixing)
        # a root (N, N) of the covariance of the weights; noise of a single value of precision 1, in units of y
        self.posterior_root_ = mix_outputs(root, unmix, self.hidden)
        self.noise_std_ = (
            np.linalg.norm(unmix, axis=0) * self._stretch() / math.sqrt(2 * self.beta_)
        )

    def _weights(self) -> np.ndarray:
        """Return all weights (N,)."""
        return np.concatenate([self.W1_.ravel(), self.b1_, self.W2_.ravel(), self.b2_])

    def _arrays(self) -> dict[str, Any]:
        """Collect scalings and weights, as `two_layer.evaluate` reads them."""
        return {key: getattr(self, key + "_") for key in ARRAYS} | {
            "scaled_range": self.scaled_range
        }

    def _check_settings(self) -> None:
        for name, least in (("hidden", 1), ("starts", 1), ("epochs", 1), ("goal", 0)):
            if not getattr(self, name) >= least:
                raise ValueError(
                    f"{name} is {getattr(self, name)!r}; expected at least {least}"
                )
        if self.prior not in PRIORS:
            raise ValueError(f"prior is {self.prior!r}; expected {', '.join(PRIORS)}")
        low, high = self.scaled_range
        if not low < high:
            raise ValueError(
                f"scaled_range is {self.scaled_range!r}; expected its first below its second"
            )

    def _stretch(self) -> np.ndarray:
        """Return the size (outputs,) of one unit of a scaled output, in units of y."""
        low, high = self.scaled_range
        return width(self.output_min_, self.output_max_) / (high - low)


def covariances(
    networks: Sequence[BayesianBP], X: ArrayLike, weights: np.ndarray | None = None
) -> np.ndarray:
    """`BayesianBP.covariance` of networks that share their scalings, (networks, samples, outputs, outputs).

    `weights` (networks, N) are theirs, if they are at hand.
    """
    if weights is None:
        weights = np.array([network._weights() for network in networks])
    X, parts = np.asarray(X, dtype=float), []
    for part in np.array_split(X, 1 + len(X) // AT_ONCE):
        roots = weight_roots(networks, part, weights) * networks[0]._stretch()[:, None]
        parts.append(roots @ roots.swapaxes(-1, -2))
    return np.concatenate(parts, axis=1)


def weight_roots(
    networks: Sequence[BayesianBP], X: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """dy/dw times the root of the weights' covariance, (networks, samples, outputs, N), outputs scaled."""
    if not all(network.knows_its_errors for network in networks):
        raise ValueError(
            "the network was saved without its training data; it predicts without errors"
        )
    first = networks[0]
    J = jacobian(
        weights,
        scale(X, first.input_min_, first.input_max_, first.scaled_range),
        len(first.b2_),
    )[1]
    for own, network in zip(J, networks, strict=True):
        rows = own.reshape(-1, own.shape[-1])
        rows[:] = rows @ network.posterior_root_  # one large product
    return J
