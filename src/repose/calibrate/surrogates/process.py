"""The Gaussian process of the package: one value over the inputs, with noise that is known or estimated.

Covariance, likelihood and its maximum are scikit-learn's. The surrogate `gaussian_process`, the kriging of
`repose.calibrate.strategies.sequential` and its estimate of the noise differ in covariance, noise and prior alone.

  (RW06)  Rasmussen & Williams 2006, Gaussian Processes for Machine Learning: Algorithm 2.1; section 5.4.2, a value
          from all the others
"""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import (
    RBF,
    ConstantKernel,
    DotProduct,
    Matern,
    WhiteKernel,
)

JITTER = 1e-10  # of the diagonal, where the noise is a part of the kernel
LEAST_VARIANCE = 1e-12
FIXED = ("fixed", "fixed")


def smooth(
    variance: float,
    lengths: ArrayLike,
    bounds: Any = FIXED,
    smoothness: float | None = None,
) -> ConstantKernel:
    """Multiply a variance by Matern's covariance in lengths; without `smoothness` by the squared exponential.

    `bounds` are those of the variance and of the lengths, as scikit-learn takes them.
    """
    shape = (
        RBF(lengths, bounds[1])
        if smoothness is None
        else Matern(lengths, bounds[1], nu=smoothness)
    )
    return ConstantKernel(variance, bounds[0]) * shape


def straight(slope: float) -> ConstantKernel:
    """Make the covariance of a straight line, 1 + slope^2 x x'."""
    return ConstantKernel(slope**2, "fixed") * DotProduct(1.0 / slope, "fixed")


class Process:
    """A process of mean 0, conditioned on values (n,) at points x (n, d) (RW06).

    The noise of the values has known variances `errors` (n,), or is the kernel `noise`. Free hyperparameters maximise
    the likelihood, or are found by an `optimizer` of scikit-learn's form; None leaves them as they are.
    """

    def __init__(
        self,
        kernel: Any,
        x: np.ndarray,
        values: np.ndarray,
        errors: ArrayLike = JITTER,
        noise: Any = None,
        optimizer: str | Callable | None = "fmin_l_bfgs_b",
    ) -> None:
        whole = kernel if noise is None else kernel + noise
        model = GaussianProcessRegressor(whole, alpha=errors, optimizer=optimizer)
        with (
            warnings.catch_warnings()
        ):  # a length at its bound is an input without effect
            warnings.simplefilter("ignore")
            model.fit(x, values)
        self.kernel = model.kernel_ if noise is None else model.kernel_.k1
        self.noise_level = 0.0 if noise is None else float(model.kernel_.k2.noise_level)
        self.x, self.root, self.weights = (
            x,
            model.L_,
            model.alpha_,
        )  # of the matrix (n, n), and of the values
        self.values = values
        self.errors = (
            errors if noise is None else errors + np.diagonal(model.kernel_.k2(x))
        )
        self.log_likelihood = float(model.log_marginal_likelihood_value_)

    def mean(self, x: np.ndarray) -> np.ndarray:
        """Predict means (m,) at points (m, d)."""
        return self.kernel(x, self.x) @ self.weights

    def moments(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predict means and variances (m,) at points (m, d), without noise."""
        between = self.kernel(x, self.x)
        solved = linalg.solve_triangular(
            self.root, between.T, lower=True, check_finite=False
        )
        variance = self.kernel.diag(x) - (solved**2).sum(axis=0)
        return between @ self.weights, np.maximum(variance, LEAST_VARIANCE)

    def left_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Predict means and variances (n,), without noise, of each value from all the others."""
        precision = linalg.cho_solve((self.root, True), np.eye(len(self.x))).diagonal()
        return self.values - self.weights / precision, np.maximum(
            1 / precision - self.errors, LEAST_VARIANCE
        )


class SampleNoise(WhiteKernel):
    """Noise of variance noise_level / precision_i for sample i of the training data, noise_level for a new sample."""

    def __init__(
        self, noise_level: float, noise_level_bounds: Any, precision: ArrayLike
    ) -> None:
        super().__init__(noise_level, noise_level_bounds)
        self.precision = precision

    def __call__(
        self, X: np.ndarray, Y: np.ndarray | None = None, eval_gradient: bool = False
    ) -> Any:
        """Compute the noise's covariance between the training samples X, or zeros between X and other points Y."""
        if Y is not None:
            return np.zeros((len(X), len(Y)))
        K = np.diag(self.noise_level / np.asarray(self.precision))
        return (K, K[:, :, np.newaxis]) if eval_gradient else K
