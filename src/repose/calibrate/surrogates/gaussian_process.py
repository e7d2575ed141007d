"""Gaussian process: one for each response, squared exponential with a length for each input, and noise.

The processes are in `repose.calibrate.surrogates.process`; this file scales, and makes files.

Sources of the lines, named where they are used
  (RW06)  Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, equation 5.1
  (A35)   Aitken 1935, on least squares and linear combination of observations: independent combinations of outputs
"""

from collections.abc import Mapping, Sequence
from typing import Any, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.surrogates.base import Noise, Surrogate, register
from repose.calibrate.surrogates.samples import (
    Combined,
    checked_points,
    checked_samples,
    independent_mixing,
)
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.two_layer import width

VARIANCE_BOUNDS = (1e-2, 1e3)  # of the process, in variances of the response
LENGTH_BOUNDS = (0.05, 100.0)  # in ranges of an input
NOISE_BOUNDS = (1e-5, 1e5)  # in variances of the response
FIRST_NOISE = 0.1  # in variances of the response


@register("gaussian_process")
class GaussianProcess(Combined, Surrogate):
    """Processes with the covariance s^2 exp(-1/2 sum ((x_i - x'_i) / l_i)^2) and noise (RW06, eq. 5.1).

    The hyperparameters s^2, l_i and the noise variance maximise the marginal likelihood.
    """

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        return cls()

    def fit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Learn from samples; `noise_freedom` is not used.

        Without `noise_covariance` the responses are learned independently; with it, their combinations with independent
        noises (A35).
        """
        X, Y, _, weight = checked_samples(X, Y, **noise)
        self._take(X, Y, weight, noise.get("noise_covariance"))
        self._fit(
            [
                {
                    "variance": 1.0,
                    "lengths": np.ones(X.shape[1]),
                    "noise_variance": FIRST_NOISE,
                }
            ]
            * Y.shape[1]
        )
        return self

    def _take(
        self,
        X: np.ndarray,
        Y: np.ndarray,
        precision: np.ndarray,
        noise_covariance: ArrayLike | None,
    ) -> None:
        """Keep the samples and the scaling that follows from them."""
        if len(Y) < 2:
            raise ValueError(f"{len(Y)} samples; expected at least 2")
        self.training_ = {"inputs": X, "outputs": Y, "precision": precision}
        self.noise_covariance_ = noise_covariance
        self.low_, self.width_ = X.min(axis=0), width(X.min(axis=0), X.max(axis=0))
        self.offset_ = np.zeros(Y.shape[1])
        self._combine(
            Y, independent_mixing(noise_covariance, np.ones(Y.shape[1]), precision)
        )

    def _fit(self, kernels: Sequence[Mapping[str, Any]], fixed: bool = False) -> None:
        """Fit a process to each combination of the outputs, from hyperparameters as in `report`, as `processes_`."""
        from repose.calibrate.surrogates.process import Process, SampleNoise, smooth

        bounds = (
            3 * ["fixed"] if fixed else [VARIANCE_BOUNDS, LENGTH_BOUNDS, NOISE_BOUNDS]
        )
        x, self.processes_ = self._scaled(self.training_["inputs"]), []
        for one, values, precision in zip(
            kernels, self.values.T, self.training_["precision"].T, strict=True
        ):
            kernel = smooth(one["variance"], one["lengths"], bounds)
            noise = SampleNoise(one["noise_variance"], bounds[2], precision)
            self.processes_.append(Process(kernel, x, values, noise=noise))

    def _scaled(self, X: ArrayLike) -> np.ndarray:
        """Scale parameter sets to ranges of the inputs."""
        return (checked_points(X, len(self.low_)) - self.low_) / self.width_

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        x = self._scaled(X)
        means = (
            self.unmixed(np.column_stack([one.mean(x) for one in self.processes_]))
            + self.offset_
        )
        if not return_std:
            return means
        levels = noise * np.array([one.noise_level for one in self.processes_])
        return means, np.sqrt(
            (self._variances(x) + levels) * self._scale**2 @ self._unmixing**2
        )

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance of the predicted means; diagonal without a `noise_covariance`."""
        return self._covariance(self._variances(self._scaled(X)))

    def _variances(self, x: np.ndarray) -> np.ndarray:
        """Predict variances (n, k) of the scaled combinations, without noise."""
        return np.column_stack([one.moments(x)[1] for one in self.processes_])

    def report(self) -> dict[str, Any]:
        """Report log marginal likelihood and hyperparameters of each process."""
        likelihood = [process.log_likelihood for process in self.processes_]
        return {"log_marginal_likelihood": likelihood, "kernels": self._kernels()}

    def to_dict(self) -> dict[str, Any]:
        """Collect the hyperparameters of the processes, and the samples."""
        return {
            "kernels": self._kernels(),
            "offset": self.offset_.tolist(),
            "noise_covariance": np.asarray(
                self.noise_covariance_
            ).tolist(),  # None of None
            "training": {key: value.tolist() for key, value in self.training_.items()},
        }

    def _kernels(self) -> list[dict[str, Any]]:
        """List the hyperparameters of each process, in variances of its values and ranges of the inputs."""
        return [
            {
                "variance": float(process.kernel.k1.constant_value),
                "lengths": np.broadcast_to(
                    process.kernel.k2.length_scale, len(self.low_)
                ).tolist(),
                "noise_variance": process.noise_level,
            }
            for process in self.processes_
        ]

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Make the processes of a `to_dict`; their hyperparameters are not estimated again."""
        model, training = cls(), content["training"]
        X, Y, precision = (
            np.asarray(training[key], dtype=float)
            for key in ("inputs", "outputs", "precision")
        )
        model._take(X, Y, precision, content["noise_covariance"])
        model._fit(content["kernels"], fixed=True)
        model.offset_ = np.asarray(content["offset"], dtype=float)
        return model
