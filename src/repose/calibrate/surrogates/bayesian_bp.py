"""Predict responses and their errors by a network with Bayesian regularisation.

It is the BP network of section 3.2.2 of the paper: a 6-12-2 network with the transfer
functions tansig and purelin, whose inputs and outputs are scaled to 0.1-0.9. The
Levenberg-Marquardt method trains it on a regularised sum of squares. It only needs
numpy::

    from repose.calibrate.surrogates.bayesian_bp import BayesianBP
    model = BayesianBP(hidden=6).fit(X, y)
    mean, std = model.predict(X_new, return_std=True)

Sources, named where they are used
  (Eq. n)   the paper
  (FH n)    Foresee & Hagan 1997, Gauss-Newton approximation to Bayesian learning, step
            n of section 4
  (M92)     MacKay 1992, Bayesian interpolation / A practical Bayesian framework, Neural
            Computation 4
  (M94)     MacKay 1994, Bayesian non-linear modeling for the prediction competition: a
            prior for each input
  (A35)     Aitken 1935, on least squares and linear combination of observations

Symbols: w are all N weights, and n is the number of residuals (samples times outputs).
The noise variance is 1 / (2 beta), and the prior variance of a weight is 1 / (2 alpha).
H is the Hessian of the regularised sum of squares.
"""

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.surrogates.base import Noise, Surrogate, register
from repose.calibrate.surrogates.evidence import (
    compute_posterior_root,
    spread_over_weights,
)
from repose.calibrate.surrogates.levenberg_marquardt import (
    CONVERGED,
    STATISTIC_NAMES,
    TrainingSettings,
    train_again,
    train_start,
)
from repose.calibrate.surrogates.samples import (
    check_points,
    check_samples,
    compute_decorrelating_mixing,
    compute_pure_error,
)
from repose.calibrate.surrogates.settings import AS_PUBLISHED, NetworkSettings
from repose.calibrate.surrogates.two_layer import (
    ARRAY_NAMES,
    PRIORS,
    compute_jacobian,
    compute_widths,
    draw_first_weights,
    evaluate_network,
    list_weight_classes,
    make_response_function,
    mix_outputs,
    name_weight_classes,
    scale_columns,
    unpack_weights,
)

# Number of points at which the derivatives of several networks with respect to all
# weights are in memory together.
CHUNK_SIZE = 256


@register("network")
@dataclass(eq=False, repr=False)
class BayesianBP(TrainingSettings, Surrogate):
    """Two-layer network trained by Bayesian regularisation from several starts.

    The start with the largest evidence is chosen: among those that converged, or among
    all if none did.

    Attributes
    ----------
    hidden : int
        Neurons of the hidden layer.
    starts : int
        Number of independent starts, each from weights of Nguyen and Widrow.
    scaled_range : tuple of float
        Interval of inputs and outputs in training.
    seed : int
        Start k draws from RandomState([seed, k]).
    prior : str
        Which weights share an alpha. With "one", as published, all of them do (FH).
        With "layers", there is an alpha for the input weights, one for the hidden
        biases, and one for the output weights with their biases (M92). With "inputs",
        the weights of each input also have their own alpha, so an input without effect
        fades (M94).
    """

    hidden: int = AS_PUBLISHED.hidden
    starts: int = AS_PUBLISHED.starts
    scaled_range: tuple[float, float] = (0.1, 0.9)
    seed: int = AS_PUBLISHED.seed

    is_network = True
    of_all_samples = False  # as published: fitted to the training part

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        """Make an untrained network."""
        return cls(
            hidden=settings.hidden,
            epochs=settings.epochs,
            goal=settings.goal,
            starts=settings.starts,
            seed=settings.seed,
            prior=settings.prior,
        )

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        **noise: Unpack[Noise],
    ) -> Self:
        """Train a network from each start, and set this network to the best one.

        If a `noise_covariance` is given, the noises of the outputs are correlated. The
        networks are then trained on combinations of the outputs, the mixed outputs,
        whose noises are independent (Aitken 1935).

        Parameters
        ----------
        X : array (samples, inputs)
            Parameter sets.
        y : array (samples, outputs) or (samples,)
            Responses of the samples.
        sample_weight : array (samples,), optional
            Weight of each sample, as in scikit-learn.
        **noise
            `precision`, `noise_covariance` and `noise_freedom` as in `Surrogate.fit`.

        Returns
        -------
        BayesianBP
            The same network.

        Raises
        ------
        ValueError
            If settings or samples are invalid, or if no start has a finite evidence.
        """
        self._check_settings()
        X, Y, sample_weight, precision = check_samples(X, y, sample_weight, **noise)
        self.one_output_ = np.ndim(y) == 1

        # Set the ranges first, because all methods that scale values use them.
        self.input_min_ = X.min(axis=0)
        self.input_max_ = X.max(axis=0)
        self.output_min_ = Y.min(axis=0)
        self.output_max_ = Y.max(axis=0)
        # Combine the scaled outputs so that their noises are independent.
        noise_covariance = noise.get("noise_covariance")
        self._mixing = compute_decorrelating_mixing(
            noise_covariance, self._compute_output_scale(), precision
        )
        scaled_inputs = self._scale_inputs(X)
        mixed_outputs = self._scale_outputs(Y) @ self._mixing

        # Train from each start. A residual is weighted by how often its sample counts,
        # times the precision of its value.
        n_outputs = mixed_outputs.shape[1]
        residual_weights = sample_weight[:, None] * precision
        pure_error = compute_pure_error(
            noise_covariance,
            degrees_of_freedom=noise.get("noise_freedom", 0.0),
            output_scale=self._compute_output_scale(),
            mixing=self._mixing,
        )
        self.start_results_ = [
            train_start(
                w=self._draw_first_weights(
                    k, inputs=scaled_inputs.shape[1], outputs=n_outputs
                ),
                x=scaled_inputs,
                t=mixed_outputs,
                root_weight=np.sqrt(residual_weights),
                n=float(sample_weight.sum() * n_outputs),
                settings=self,
                pure_error=pure_error,
            )
            for k in range(self.starts)
        ]
        self.n_residuals_ = mixed_outputs.size
        self.training_ = {
            "inputs": X,
            "weight": residual_weights,
            "noise_covariance": noise_covariance,
        }
        self._adopt_best_start()
        return self

    def _draw_first_weights(self, start: int, inputs: int, outputs: int) -> np.ndarray:
        """Draw the weights (N,) with which a start begins."""
        seed = (self.seed, start)
        return draw_first_weights(inputs, self.hidden, outputs, self.scaled_range, seed)

    def refit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Train a copy of this network on other responses, as in `Surrogate.refit`.

        The training starts from the present weights, and keeps the scalings, the
        regularisation alpha of the weights, and beta, which stands for the noise. The
        copy also keeps the evidence and the statistics of the first fit.

        Parameters
        ----------
        X : array (samples, inputs)
            Parameter sets.
        Y : array (samples, outputs)
            Responses of the samples.
        **noise
            `precision` and `noise_covariance` as in `Surrogate.fit`.

        Returns
        -------
        BayesianBP
            The copy.
        """
        # Weight the residuals and mix the outputs as `fit` does.
        X, Y, sample_weight, precision = check_samples(X, Y, **noise)
        residual_weights = sample_weight[:, None] * precision
        noise_covariance = noise.get("noise_covariance")
        mixing = compute_decorrelating_mixing(
            noise_covariance, self._compute_output_scale(), precision
        )
        result = train_again(
            w=mix_outputs(self._weights(), mixing, self.hidden),
            x=self._scale_inputs(X),
            t=self._scale_outputs(Y) @ mixing,
            root_weight=np.sqrt(residual_weights),
            alpha=np.atleast_1d(self.alpha_),
            beta=self.beta_,
            settings=self,
        )
        # Set the attributes of a copy. `_set_layers` uses its `_mixing`.
        network = copy.copy(self)
        network._mixing = mixing
        network.training_ = {
            "inputs": X,
            "weight": residual_weights,
            "noise_covariance": noise_covariance,
        }
        network._set_layers(result["w"])
        covariance_factor = compute_posterior_root(
            result["alpha_of_weight"], self.beta_, result["JJ"]
        )
        network._set_errors(covariance_factor, mixing)
        return network

    def _adopt_best_start(self) -> None:
        """Choose the best start, and give this network the weights that it found.

        The best start is the one with the largest evidence among those that converged.
        If none converged, it is the one with the largest evidence of all. The
        statistics of all starts are recorded in `starts_`. The results in
        `start_results_` must be set.
        """
        self.starts_ = []
        for k, result in enumerate(self.start_results_):
            statistics = {key: result[key] for key in STATISTIC_NAMES}
            self.starts_.append({"start": k} | statistics)

        # The decrement is how far a start ended above the minimum of its objective.
        converged = [
            k
            for k, result in enumerate(self.start_results_)
            if result["decrement"] < CONVERGED
        ]
        self.converged_starts_ = len(converged)
        all_starts = range(self.starts)
        candidates = converged or all_starts
        self.best_start_ = max(
            candidates, key=lambda k: self.start_results_[k]["log_evidence"]
        )
        best_result = self.start_results_[self.best_start_]
        self._set_network(best_result)

        # Record the classes of weights whose alpha has reached its upper limit. Inputs
        # without names are numbered.
        names = name_weight_classes(
            self.prior, self.inputs or range(len(self.input_min_))
        )
        self.at_cap_ = [names[number] for number in best_result["at_cap"]]

    def get_network_of_start(self, k: int) -> Self:
        """Return the network at the end of start k of `fit`."""
        network = copy.copy(self)
        network._set_network(self.start_results_[k])
        return network

    def _set_network(self, result: Mapping[str, Any]) -> None:
        """Set weights, evidence and errors of this network from the result of a start.

        The ranges of inputs and outputs, and `_mixing`, must be set before.

        Parameters
        ----------
        result : mapping
            Result of `train_start`. Its weights belong to the mixed outputs of `fit`,
            and are converted to the original outputs.

        Raises
        ------
        ValueError
            If the start has no finite evidence. `fit` adopts the start with the largest
            evidence, so then no start has a finite one.
        """
        if result["log_evidence"] == -math.inf:
            raise ValueError(
                f"none of the {self.starts} starts ended with a finite evidence"
            )
        self._set_layers(result["w"])
        self.alpha_ = result["alpha"]
        self.beta_ = result["beta"]
        self.gamma_ = result["gamma"]
        self.log_evidence_ = result["log_evidence"]
        self.epochs_ = result["epochs"]
        self.stop_reason_ = result["stop_reason"]
        covariance_factor = compute_posterior_root(
            result["alpha_of_weight"], self.beta_, result["JJ"]
        )
        self._set_errors(covariance_factor, self._mixing)

    def _set_layers(self, mixed_weights: np.ndarray) -> None:
        """Set the layers from all weights (N,), which belong to the mixed outputs.

        The attribute `_mixing` must be set.
        """
        unmixing = np.linalg.inv(self._mixing)
        w = mix_outputs(mixed_weights, unmixing, self.hidden)
        layers = unpack_weights(
            w,
            inputs=len(self.input_min_),
            hidden=self.hidden,
            outputs=len(self._mixing),
        )
        self.W1_ = layers.W1
        self.b1_ = layers.b1
        self.W2_ = layers.W2
        self.b2_ = layers.b2

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        """Predict responses, and their standard deviations if `return_std` is True.

        The standard deviation of a scaled output is sqrt(1 / (2 beta) + g' H^-1 g),
        where g is its gradient with respect to the weights (MacKay 1992). The result is
        in the units of the responses. Without `noise`, the first term is left out.

        Parameters
        ----------
        X : array (samples, inputs)
            Parameter sets.
        return_std, noise : bool
            As in `Surrogate.predict`.

        Returns
        -------
        array (samples, outputs), or a pair of them
            The means, and the standard deviations if `return_std` is True. The arrays
            have the shape (samples,) if y had this shape in `fit`.

        Raises
        ------
        ValueError
            If the network is not trained, or if `X` has another number of inputs.
        """
        if not hasattr(self, "W1_"):
            raise ValueError("predict was called before fit")
        X = check_points(X, len(self.input_min_))
        Y = evaluate_network(self._collect_arrays(), X)
        if self.one_output_:
            Y = Y[:, 0]
        if not return_std:
            return Y
        # The function takes several networks; this is the only one. Its result G
        # (samples, outputs, N) has the covariance G G' of the outputs of a sample, so a
        # variance is the sum of the squares of a row.
        factors = compute_output_factors([self], X, self._weights()[None])[0]
        variance = (factors**2).sum(axis=2) * self._compute_output_scale() ** 2
        # `noise` is True or False, which count as 1 and 0.
        std = np.sqrt(variance + noise * self.noise_std_**2)
        if self.one_output_:
            std = std[:, 0]
        return Y, std

    @property
    def can_predict_errors(self) -> bool:
        return hasattr(self, "posterior_root_")

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (samples, outputs, outputs) without the noise."""
        return compute_covariances([self], X)[0]

    def response_function(
        self, low: np.ndarray, high: np.ndarray
    ) -> Callable[[np.ndarray], np.ndarray]:
        return make_response_function(self._collect_arrays(), low, high)

    def shifted(self, offset: np.ndarray) -> Self:
        # The output biases are scaled; the offset is in the units of the responses.
        bottom, top = self.scaled_range
        scaled_offset = (
            offset * (top - bottom) / compute_widths(self.output_min_, self.output_max_)
        )
        network = copy.copy(self)
        network.b2_ = self.b2_ + scaled_offset
        return network

    def report(self) -> dict[str, Any]:
        """Collect statistics of the best start, and the number of all starts."""
        return {
            "gamma": self.gamma_,
            "beta": self.beta_,
            "log_evidence": self.log_evidence_,
            "epochs": self.epochs_,
            "stop_reason": self.stop_reason_,
            "best_start": self.best_start_,
            "n_residuals": self.n_residuals_,
            "converged_starts": self.converged_starts_,
            "at_cap": self.at_cap_,
            "n_weights": self._weights().size,
            "starts": self.starts,
            "prior": self.prior,
            "alpha": np.asarray(self.alpha_).tolist(),
        }

    def start_rows(self) -> list[dict[str, Any]]:
        """List the statistics of each start, and whether it was chosen."""
        rows = []
        for k, start in enumerate(self.starts_):
            alphas = np.atleast_1d(start["alpha"])
            rows.append(
                start
                | {
                    "alpha": " ".join(f"{alpha:.6g}" for alpha in alphas),
                    "at_cap": len(start["at_cap"]),
                    "chosen": k == self.best_start_,
                }
            )
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Collect all that `from_dict` needs in a dictionary that JSON can store.

        These are the scalings, the weights, and the training data, from which
        `from_dict` computes the covariance of the weights. It reads the same keys, so
        change both together. A network that was loaded without training data is saved
        without them.
        """
        content: dict[str, Any] = {
            "scaled_range": list(self.scaled_range),
            # Every network of this class has these transfer functions. They are written
            # for other programs, and not read again.
            "activation": ["tansig", "purelin"],
        }
        for key in ARRAY_NAMES:
            content[key] = getattr(self, f"{key}_").tolist()
        if hasattr(self, "training_"):
            content["training"] = {
                "prior": self.prior,
                "alpha": np.asarray(self.alpha_).tolist(),
                "beta": self.beta_,
            }
            for key in ("noise_covariance", "inputs", "weight"):
                content["training"][key] = np.asarray(self.training_[key]).tolist()
        return content

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Restore a trained network from the result of `to_dict`.

        The covariance of the weights is computed again from the saved weights and
        samples, without training.

        Parameters
        ----------
        content : mapping
            Result of `to_dict`. The entry ``samples``, which `Surrogate.save` adds, has
            the numbers that identify the samples in the study. If the entry
            ``training`` is missing, the network predicts without errors.

        Returns
        -------
        BayesianBP
        """
        arrays = {key: np.asarray(content[key], dtype=float) for key in ARRAY_NAMES}
        model = cls(
            hidden=len(arrays["b1"]), scaled_range=tuple(content["scaled_range"])
        )
        for key, value in arrays.items():
            setattr(model, f"{key}_", value)
        model.one_output_ = False
        training = content.get("training")
        if training is None:
            return model
        model.prior = training["prior"]
        model.alpha_ = training["alpha"]
        model.beta_ = training["beta"]
        model.training_ = {
            "inputs": np.asarray(training["inputs"], dtype=float),
            "weight": np.asarray(training["weight"], dtype=float),
            "noise_covariance": training["noise_covariance"],
        }
        # Files without numbers of the samples have an empty list, or no entry.
        n_samples = len(model.training_["inputs"])
        model._recompute_errors(content.get("samples") or range(n_samples))
        return model

    def _recompute_errors(self, samples: Sequence[int]) -> None:
        """Compute the noise and the covariance of the weights, and set them.

        The training data, the weights, alpha and beta must be set. The steps are those
        of the training (`linearise_residuals`), so that a loaded network predicts the
        same errors as the trained one.

        Parameters
        ----------
        samples : sequence of int
            Numbers that identify the training samples, in the order of the training
            data.

        Raises
        ------
        ValueError
            If there are more or fewer numbers than training samples.
        """
        # Sum over the samples in the order of their numbers. Another order would give
        # other rounding errors.
        order = np.argsort(samples)
        if len(order) != len(self.training_["inputs"]):
            raise ValueError(
                f"{len(order)} numbers of samples for "
                f"{len(self.training_['inputs'])} training samples"
            )
        # Compute the derivatives J of the weighted residuals. The training used mixed
        # outputs, so convert the weights to these.
        X = self.training_["inputs"][order]
        residual_weights = self.training_["weight"][order]
        n_outputs = len(self.b2_)
        mixing = compute_decorrelating_mixing(
            self.training_["noise_covariance"],
            self._compute_output_scale(),
            residual_weights,
        )
        w = mix_outputs(self._weights(), mixing, self.hidden)
        _, J = compute_jacobian(w, self._scale_inputs(X), n_outputs)
        J = (J * np.sqrt(residual_weights)[:, :, None]).reshape(-1, w.size)

        # Some weights share an alpha, so first list the alpha of each weight.
        classes = list_weight_classes(self.prior, X.shape[1], self.hidden, n_outputs)
        alpha_of_weight = spread_over_weights(
            np.atleast_1d(self.alpha_), classes, w.size
        )
        covariance_factor = compute_posterior_root(alpha_of_weight, self.beta_, J.T @ J)
        self._set_errors(covariance_factor, mixing)

    def _set_errors(self, covariance_factor: np.ndarray, mixing: np.ndarray) -> None:
        """Set the errors for the original outputs from the errors of the mixed outputs.

        The attribute `posterior_root_` R (N, N) has R R' equal to the covariance of the
        weights. The attribute `noise_std_` (outputs,) is the noise of a value of
        precision 1, in the units of the responses.

        Parameters
        ----------
        covariance_factor : array (N, N)
            The same matrix as `posterior_root_`, for the mixed outputs.
        mixing : array (outputs, outputs)
            Coefficients of the mixed outputs, one of them in each column.
        """
        unmixing = np.linalg.inv(mixing)
        self.posterior_root_ = mix_outputs(covariance_factor, unmixing, self.hidden)
        self.noise_std_ = (
            np.linalg.norm(unmixing, axis=0)
            * self._compute_output_scale()
            / math.sqrt(2 * self.beta_)
        )

    def _weights(self) -> np.ndarray:
        """Return all weights (N,)."""
        return np.concatenate([self.W1_.ravel(), self.b1_, self.W2_.ravel(), self.b2_])

    def _collect_arrays(self) -> dict[str, Any]:
        """Collect scalings and weights, as `two_layer.evaluate` reads them."""
        arrays = {key: getattr(self, f"{key}_") for key in ARRAY_NAMES}
        return arrays | {"scaled_range": self.scaled_range}

    def _check_settings(self) -> None:
        """Check the settings of the training.

        Raises
        ------
        ValueError
            If a setting is outside its limits. The message names the setting, its value
            and the limit.
        """
        minimum_values = {"hidden": 1, "starts": 1, "epochs": 1, "goal": 0}
        for name, minimum in minimum_values.items():
            value = getattr(self, name)
            # NaN is not at least any number, so this rejects it, too.
            if not value >= minimum:
                raise ValueError(f"{name} is {value!r}; expected at least {minimum}")
        if self.prior not in PRIORS:
            raise ValueError(f"prior is {self.prior!r}; expected {', '.join(PRIORS)}")
        low, high = self.scaled_range
        if not low < high:
            raise ValueError(
                f"scaled_range is {self.scaled_range!r}; "
                "expected a lower end below an upper end"
            )

    def _scale_inputs(self, X: np.ndarray) -> np.ndarray:
        """Scale parameter sets (samples, inputs) as in the training."""
        return scale_columns(X, self.input_min_, self.input_max_, self.scaled_range)

    def _scale_outputs(self, Y: np.ndarray) -> np.ndarray:
        """Scale responses (samples, outputs) as in the training."""
        return scale_columns(Y, self.output_min_, self.output_max_, self.scaled_range)

    def _compute_output_scale(self) -> np.ndarray:
        """Compute the size (outputs,) of a unit of each scaled output.

        It is in the units of the response: a difference of scaled outputs times this
        size is the difference of the responses.
        """
        low, high = self.scaled_range
        return compute_widths(self.output_min_, self.output_max_) / (high - low)


def compute_covariances(
    networks: Sequence[BayesianBP], X: ArrayLike, weights: np.ndarray | None = None
) -> np.ndarray:
    """Compute the covariance of the responses that each of several networks predicts.

    Parameters
    ----------
    networks : sequence of BayesianBP
        The networks. All must scale their inputs and outputs in the same way, as the
        networks of different starts do.
    X : array (samples, inputs)
        Parameter sets.
    weights : array (networks, N), optional
        Weights of the networks, if they have already been collected.

    Returns
    -------
    array (networks, samples, outputs, outputs)
        Covariances of the predicted means, without the noise of a new value, in the
        units of the responses.
    """
    if weights is None:
        weights = np.array([network._weights() for network in networks])
    X = np.asarray(X, dtype=float)
    # Convert scaled outputs to the units of the responses by this factor, which is the
    # same for all networks.
    output_scale = networks[0]._compute_output_scale()[:, None]
    # Process the samples in parts, because the derivatives need much memory.
    parts = []
    for points in np.array_split(X, 1 + len(X) // CHUNK_SIZE):
        factors = compute_output_factors(networks, points, weights) * output_scale
        parts.append(factors @ factors.swapaxes(-1, -2))
    return np.concatenate(parts, axis=1)


def compute_output_factors(
    networks: Sequence[BayesianBP], X: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Compute factors G of the covariances G G' of the scaled outputs of networks.

    An error dw of the weights changes the outputs by J dw, where J = dy/dw. If R R' is
    the covariance of the weights, G = J R therefore has G G' equal to the covariance of
    the outputs.

    Parameters
    ----------
    networks : sequence of BayesianBP
        The networks. All must scale their inputs and outputs in the same way.
    X : array (samples, inputs)
        Parameter sets.
    weights : array (networks, N)
        Weights of each network. The caller collects them, because it may keep them for
        several calls.

    Returns
    -------
    array (networks, samples, outputs, N)
        The factor G of each sample, by network.

    Raises
    ------
    ValueError
        If a network was saved without its training data.
    """
    if not all(network.can_predict_errors for network in networks):
        raise ValueError(
            "the network was saved without its training data; "
            "it predicts without errors"
        )
    first = networks[0]
    x = first._scale_inputs(X)
    _, J = compute_jacobian(weights, x, outputs=len(first.b2_))
    # Overwrite J by G, because a second array of this size would need much memory. As J
    # is contiguous, `rows` is a view of it and not a copy.
    for derivatives, network in zip(J, networks, strict=True):
        rows = derivatives.reshape(-1, derivatives.shape[-1])
        rows[:] = rows @ network.posterior_root_
    factors = J
    return factors
