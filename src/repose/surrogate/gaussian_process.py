"""Gaussian process: one for each response, squared exponential with a length for each input, and noise.

The processes are scikit-learn's; this file scales, handles noise that is known to differ, and makes files.

Sources of the lines, named where they are used
  (RW06)  Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, Algorithm 2.1 and equation 5.1
  (A35)   Aitken 1935, on least squares and linear combination of observations: independent combinations of outputs
"""

import warnings
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from repose.surrogate.base import Surrogate, register
from repose.surrogate.samples import checked_points, checked_samples, independent_mixing
from repose.surrogate.two_layer import width

VARIANCE_BOUNDS = (1e-2, 1e3)  # of the process, in variances of the response
LENGTH_BOUNDS = (0.05, 100.0)  # in ranges of an input
NOISE_BOUNDS = (1e-5, 1e5)  # in variances of the response
FIRST_NOISE = 0.1  # in variances of the response


@register("gaussian_process")
class GaussianProcess(Surrogate):
    """Processes with the covariance s^2 exp(-1/2 sum ((x_i - x'_i) / l_i)^2) and noise (RW06, eq. 5.1).

    The hyperparameters s^2, l_i and the noise variance maximise the marginal likelihood. There are no settings.
    """

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        return cls()

    def fit(
        self,
        X: ArrayLike,
        Y: ArrayLike,
        *,
        precision: ArrayLike | None = None,
        noise_covariance: ArrayLike | None = None,
        noise_freedom: float = 0.0,
    ) -> Self:
        """Learn from samples.

        Without `noise_covariance` the responses are learned independently; with it, their combinations with independent
        noises (A35). `noise_freedom` is not used: the noise is estimated with the other hyperparameters.
        """
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel

        X, Y, _, weight = checked_samples(X, Y, None, precision)
        self._take(X, Y, weight, noise_covariance)
        lengths = np.ones(X.shape[1])
        kernels = [
            ConstantKernel(1.0, VARIANCE_BOUNDS) * RBF(lengths, LENGTH_BOUNDS) + self._noise(FIRST_NOISE, k)
            for k in range(Y.shape[1])
        ]
        self._fit(kernels)
        return self

    def _take(self, X, Y, precision, noise_covariance):
        """Keep the samples and the scaling that follows from them."""
        if len(Y) < 2:
            raise ValueError(f"{len(Y)} samples; allowed: at least 2")
        self.training_ = {"inputs": X, "outputs": Y, "precision": precision}
        self.noise_covariance_ = noise_covariance
        self.low_, self.width_ = X.min(axis=0), width(X.min(axis=0), X.max(axis=0))
        self.offset_ = np.zeros(Y.shape[1])
        self._mixing = independent_mixing(noise_covariance, np.ones(Y.shape[1]), precision)
        self._unmixing = np.linalg.inv(self._mixing)

    def _noise(self, level, k, bounds=NOISE_BOUNDS):
        """Kernel of the noise of combination k."""
        from sklearn.gaussian_process.kernels import WhiteKernel

        from repose.surrogate.sample_noise import SampleNoise

        precision = self.training_["precision"][:, k]
        return (
            WhiteKernel(level, bounds) if (precision == 1.0).all() else SampleNoise(level, bounds, precision)
        )

    def _fit(self, kernels):
        """A process for each combination of the outputs (RW06, Algorithm 2.1), as `processes_`."""
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor

        x = (self.training_["inputs"] - self.low_) / self.width_
        self.processes_ = []
        for kernel, t in zip(kernels, (self.training_["outputs"] @ self._mixing).T, strict=True):
            process = GaussianProcessRegressor(kernel, normalize_y=True)
            with warnings.catch_warnings():  # a length at its bound is an input without effect
                warnings.simplefilter("ignore", ConvergenceWarning)
                self.processes_.append(process.fit(x, t))
        self._noise_variances = np.array(
            [process.kernel_.k2.noise_level * process._y_train_std**2 for process in self.processes_]
        )

    def predict(self, X: ArrayLike, return_std: bool = False, noise: bool = True) -> Any:
        x = (checked_points(X, len(self.low_)) - self.low_) / self.width_
        if not return_std:
            means = np.column_stack([process.predict(x) for process in self.processes_])
            return means @ self._unmixing + self.offset_
        means, variances = self._moments(x)
        variances = variances + noise * self._noise_variances
        return means @ self._unmixing + self.offset_, np.sqrt(variances @ self._unmixing**2)

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Covariance of the predicted means; diagonal without a `noise_covariance`."""
        x = (checked_points(X, len(self.low_)) - self.low_) / self.width_
        roots = np.sqrt(self._moments(x)[1])[:, :, None] * self._unmixing
        return roots.transpose(0, 2, 1) @ roots

    def _moments(self, x):
        """Means and variances (n, k) of the combinations, without noise."""
        means, stds = zip(*(process.predict(x, return_std=True) for process in self.processes_), strict=True)
        # scikit-learn adds the noise to the variance of the mean
        variances = np.column_stack(stds) ** 2 - self._noise_variances
        return np.column_stack(means), np.maximum(variances, 0.0)

    def response_function(self, low: np.ndarray, high: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The means as one matrix product, an exponential and another product for each process."""
        middle, half = np.add(low, high) / 2, np.subtract(high, low) / 2
        parts = []
        for process in self.processes_:
            lengths = process.kernel_.k1.k2.length_scale * np.ones(len(self.low_))
            scale = half / self.width_ / lengths
            start = (middle - self.low_) / self.width_ / lengths
            weight = process.kernel_.k1.k1.constant_value * process._y_train_std * process.alpha_.ravel()
            parts.append((scale, start, process.X_train_ / lengths, weight, process._y_train_mean))

        def respond(points):
            means = np.empty((len(points), len(parts)))
            for k, (scale, start, x, weight, mean) in enumerate(parts):
                z = points * scale + start
                square = (z**2).sum(axis=1)[:, None] + (x**2).sum(axis=1) - 2 * (z @ x.T)
                means[:, k] = np.exp(-0.5 * square) @ weight + mean
            return means @ self._unmixing + self.offset_

        return respond

    def report(self) -> dict[str, Any]:
        """Log marginal likelihood and hyperparameters of each process."""
        likelihood = [float(process.log_marginal_likelihood_value_) for process in self.processes_]
        return {"log_marginal_likelihood": likelihood, "kernels": self._kernels()}

    def to_dict(self) -> dict[str, Any]:
        """The hyperparameters of the processes, and the samples."""
        covariance = self.noise_covariance_
        return {
            "kernels": self._kernels(),
            "offset": self.offset_.tolist(),
            "noise_covariance": None if covariance is None else np.asarray(covariance).tolist(),
            "training": {key: value.tolist() for key, value in self.training_.items()},
        }

    def _kernels(self):
        """Hyperparameters of each process, in variances of its values and ranges of the inputs."""
        return [
            {
                "variance": float(process.kernel_.k1.k1.constant_value),
                "lengths": np.broadcast_to(process.kernel_.k1.k2.length_scale, len(self.low_)).tolist(),
                "noise_variance": float(process.kernel_.k2.noise_level),
            }
            for process in self.processes_
        ]

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The processes of a `to_dict`; their hyperparameters are not estimated again."""
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel

        model, training = cls(), content["training"]
        X, Y, precision = (
            np.asarray(training[key], dtype=float) for key in ("inputs", "outputs", "precision")
        )
        model._take(X, Y, precision, content["noise_covariance"])
        kernels = [
            ConstantKernel(kernel["variance"], "fixed") * RBF(np.array(kernel["lengths"]), "fixed")
            + model._noise(kernel["noise_variance"], k, "fixed")
            for k, kernel in enumerate(content["kernels"])
        ]
        model._fit(kernels)
        model.offset_ = np.asarray(content["offset"], dtype=float)
        return model
