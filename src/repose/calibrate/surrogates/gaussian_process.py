"""Predict responses and their errors by Gaussian processes, one for each response.

The processes themselves are in `repose.calibrate.surrogates.process`; this module
scales the samples and makes files.

Sources, named where they are used
  (RW06)  Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, equation
          5.1
  (A35)   Aitken 1935, on least squares and linear combination of observations:
          independent combinations of outputs
"""

from collections.abc import Mapping, Sequence
from typing import Any, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.surrogates.base import Noise, Surrogate, register
from repose.calibrate.surrogates.samples import (
    CombinedOutputs,
    check_points,
    check_samples,
    compute_decorrelating_mixing,
)
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.two_layer import compute_widths

# Bounds and first values of the hyperparameters. The variances of the process and of
# the noise are relative to the variance of the response. Lengths are in ranges of an
# input.
VARIANCE_BOUNDS = (1e-2, 1e3)
LENGTH_BOUNDS = (0.05, 100.0)
NOISE_BOUNDS = (1e-5, 1e5)
FIRST_VARIANCE = 1.0
FIRST_LENGTH = 1.0
FIRST_NOISE = 0.1
MIN_SAMPLES = 2


@register("gaussian_process")
class GaussianProcess(CombinedOutputs, Surrogate):
    """Processes with a squared exponential covariance and noise.

    The covariance is s^2 exp(-1/2 sum ((x_i - x'_i) / l_i)^2) (RW06, eq. 5.1). The
    hyperparameters s^2, l_i and the noise variance maximise the marginal likelihood.
    """

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        return cls()

    def fit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Learn from samples, as in `Surrogate.fit`; `noise_freedom` is not used.

        Without `noise_covariance`, the responses are learned independently. With it,
        combinations of the responses that have independent noises are learned (A35).
        """
        X, Y, _, precision = check_samples(X, Y, **noise)
        self._set_samples(X, Y, precision, noise.get("noise_covariance"))
        first = {
            "variance": FIRST_VARIANCE,
            "lengths": np.full(X.shape[1], FIRST_LENGTH),
            "noise_variance": FIRST_NOISE,
        }
        self._fit_processes(
            [first] * Y.shape[1],
            variance_bounds=VARIANCE_BOUNDS,
            length_bounds=LENGTH_BOUNDS,
            noise_bounds=NOISE_BOUNDS,
        )
        return self

    def refit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Learn other responses, as in `Surrogate.refit`; the hyperparameters stay."""
        X, Y, _, precision = check_samples(X, Y, **noise)
        process = type(self)()
        process.describe(self.inputs, self.outputs, self.definitions, self.samples)
        process._set_samples(X, Y, precision, noise.get("noise_covariance"))
        process._fit_processes(self._list_kernels())
        return process

    def _set_samples(
        self,
        X: np.ndarray,
        Y: np.ndarray,
        precision: np.ndarray,
        noise_covariance: ArrayLike | None,
    ) -> None:
        """Store the samples, and scale inputs and outputs by them.

        If the noises of the responses are correlated, the outputs are combined so that
        the noises of the combinations are independent. The shift `offset_` of the
        predictions begins at 0, and `shifted` changes it.

        Parameters
        ----------
        X : array (n, d)
            Parameter sets.
        Y : array (n, k)
            Their responses.
        precision : array (n, k)
            Weights of the values. The noise variance of a value is inversely
            proportional to its precision.
        noise_covariance : array (k, k) or None
            Covariance of the noise of the responses, up to a factor. None treats the
            noises of the responses as independent.

        Raises
        ------
        ValueError
            If there are fewer than two samples.
        """
        n_samples, n_outputs = Y.shape
        if n_samples < MIN_SAMPLES:
            raise ValueError(f"{n_samples} samples; expected at least {MIN_SAMPLES}")
        self.training_ = {"inputs": X, "outputs": Y, "precision": precision}
        self.noise_covariance_ = noise_covariance
        low = X.min(axis=0)
        self.low_ = low
        self.width_ = compute_widths(low, X.max(axis=0))
        self.offset_ = np.zeros(n_outputs)
        # The outputs keep their units here; `_combine` scales the combinations.
        output_scale = np.ones(n_outputs)
        mixing = compute_decorrelating_mixing(noise_covariance, output_scale, precision)
        self._combine(Y, mixing)

    def _fit_processes(
        self,
        kernels: Sequence[Mapping[str, Any]],
        *,
        variance_bounds: Any = "fixed",
        length_bounds: Any = "fixed",
        noise_bounds: Any = "fixed",
    ) -> None:
        """Fit a process to each combination of the outputs, and set `processes_`.

        `_set_samples` must have set the samples and the combinations (`self.values`).

        Parameters
        ----------
        kernels : sequence of mapping
            Initial hyperparameters of each process, as `_list_kernels` returns them.
        variance_bounds, length_bounds, noise_bounds : pair of float or "fixed"
            Bounds of the variance, of the correlation lengths and of the noise
            variance, in the form that scikit-learn requires. By default, the initial
            hyperparameters stay as they are.
        """
        # Importing scikit-learn is slow, so do it only for a fit.
        from repose.calibrate.surrogates.process import (
            Process,
            SampleNoise,
            make_smooth_kernel,
        )

        x = self._scale_inputs(self.training_["inputs"])
        self.processes_ = []
        for initial, values, precision in zip(
            kernels, self.values.T, self.training_["precision"].T, strict=True
        ):
            kernel = make_smooth_kernel(
                initial["variance"],
                initial["lengths"],
                (variance_bounds, length_bounds),
            )
            # The noise variance of a sample is inversely proportional to its precision.
            noise = SampleNoise(initial["noise_variance"], noise_bounds, precision)
            self.processes_.append(Process(kernel, x, values, noise=noise))

    def _scale_inputs(self, X: ArrayLike) -> np.ndarray:
        """Scale parameter sets to ranges of the inputs."""
        return (check_points(X, len(self.low_)) - self.low_) / self.width_

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        """Predict responses, and their standard deviations if `return_std` is True.

        Parameters
        ----------
        X : array (n, d)
            Parameter sets.
        return_std : bool, optional
            Whether the standard deviations are returned as well.
        noise : bool, optional
            Whether they include the noise of a new value of precision 1, such as a
            single run if the precisions are numbers of runs.

        Returns
        -------
        array (n, k), or a pair of them
            The means, and the standard deviations if `return_std` is True.
        """
        x = self._scale_inputs(X)
        scaled_means = np.column_stack([process.mean(x) for process in self.processes_])
        means = self.unmix(scaled_means) + self.offset_
        if not return_std:
            return means
        # The noise of a value of precision 1 is the noise level of its process. `noise`
        # is True or False, which count as 1 and 0.
        noise_levels = np.array([process.noise_level for process in self.processes_])
        scaled_variances = self._predict_variances(x) + noise * noise_levels
        # A response is a sum of the independent combinations, each times its scale and
        # a coefficient of `_unmixing`. So its variance is the sum of their variances,
        # each times the squares of both.
        mixed_variances = scaled_variances * self._scale**2
        variances = mixed_variances @ self._unmixing**2
        return means, np.sqrt(variances)

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (n, k, k) of the predicted means.

        It is diagonal without a `noise_covariance`.
        """
        return self._covariance(self._predict_variances(self._scale_inputs(X)))

    def _predict_variances(self, x: np.ndarray) -> np.ndarray:
        """Predict variances (n, k) of the scaled combinations, without noise."""
        columns = []
        for process in self.processes_:
            _, variance = process.moments(x)
            columns.append(variance)
        return np.column_stack(columns)

    def report(self) -> dict[str, Any]:
        """Report the log marginal likelihood and hyperparameters of each process."""
        return {
            "log_marginal_likelihood": [
                process.log_likelihood for process in self.processes_
            ],
            "kernels": self._list_kernels(),
        }

    def to_dict(self) -> dict[str, Any]:
        """Collect the hyperparameters of the processes, and the samples."""
        return {
            "kernels": self._list_kernels(),
            "offset": self.offset_.tolist(),
            # Without a covariance this is None.
            "noise_covariance": np.asarray(self.noise_covariance_).tolist(),
            "training": {key: value.tolist() for key, value in self.training_.items()},
        }

    def _list_kernels(self) -> list[dict[str, Any]]:
        """List the hyperparameters of each process.

        Variances are relative to the variance of the process's values, and lengths are
        in ranges of the inputs.
        """
        kernels = []
        for process in self.processes_:
            variance, shape = process.kernel.k1, process.kernel.k2
            lengths = np.broadcast_to(shape.length_scale, len(self.low_))
            kernels.append(
                {
                    "variance": float(variance.constant_value),
                    "lengths": lengths.tolist(),
                    "noise_variance": process.noise_level,
                }
            )
        return kernels

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Restore the processes from the result of `to_dict`.

        Their hyperparameters are not estimated again.
        """
        training = content["training"]
        model = cls()
        model._set_samples(
            X=np.asarray(training["inputs"], dtype=float),
            Y=np.asarray(training["outputs"], dtype=float),
            precision=np.asarray(training["precision"], dtype=float),
            noise_covariance=content["noise_covariance"],
        )
        model._fit_processes(content["kernels"])
        model.offset_ = np.asarray(content["offset"], dtype=float)
        return model
