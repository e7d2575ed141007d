"""Fit a Gaussian process, one value as a function of the inputs, to noisy samples.

The noise is known or estimated. scikit-learn computes the covariance and the
likelihood, and maximises the latter. The surrogate `gaussian_process`, the kriging of
`repose.calibrate.strategies.sequential` and its estimate of the noise all use this
module. They differ only in covariance, noise and prior.

  (RW06)  Rasmussen & Williams 2006, Gaussian Processes for Machine Learning: Algorithm
          2.1; section 5.4.2 for the prediction of a value from all the others
  (SG06)  Snelson & Ghahramani 2006, Sparse Gaussian processes using pseudo-inputs,
          NeurIPS 18: values that depend on each other only through a few centres
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

JITTER = 1e-10  # added to the diagonal if the noise is a part of the kernel
MIN_VARIANCE = 1e-12
FIXED_BOUNDS = ("fixed", "fixed")


def make_smooth_kernel(
    variance: float,
    lengths: ArrayLike,
    bounds: Any = FIXED_BOUNDS,
    smoothness: float | None = None,
) -> ConstantKernel:
    """Make the covariance of a smooth function.

    Parameters
    ----------
    variance : float
        Variance of the process.
    lengths : array (d,)
        Correlation lengths along the inputs.
    bounds : pair
        Bounds of the variance and of the lengths, as scikit-learn takes them.
    smoothness : float, optional
        Smoothness of Matern's covariance. By default (None), the covariance is the
        squared exponential.
    """
    variance_bounds, length_bounds = bounds
    if smoothness is None:
        shape = RBF(lengths, length_bounds)
    else:
        shape = Matern(lengths, length_bounds, nu=smoothness)
    return ConstantKernel(variance, variance_bounds) * shape


def make_linear_kernel(slope: float) -> ConstantKernel:
    """Make the covariance of a straight line, 1 + slope^2 x x'."""
    return ConstantKernel(slope**2, "fixed") * DotProduct(1.0 / slope, "fixed")


class Process:
    """A process of mean 0, conditioned on values at points (RW06).

    Parameters
    ----------
    kernel : kernel of scikit-learn
        Covariance of the process.
    x : array (n, d)
        The points.
    values : array (n,)
        The values at the points.
    noise_variances : float or array (n,)
        Known variances of the noise of the values. If there is also `noise`, both are
        added.
    noise : kernel, optional
        Noise whose variance is a hyperparameter.
    optimizer : str, callable or None
        The optimiser, as scikit-learn takes it. By default, the free hyperparameters
        maximise the likelihood. None leaves them as they are.

    Attributes
    ----------
    kernel : kernel
        The kernel with the estimated hyperparameters, without the noise.
    noise_level : float
        Estimated variance of `noise`; 0 if `noise` is None.
    cholesky : array (n, n)
        Cholesky factor L of the covariance K of the values, noise included.
    weights : array (n,)
        K^-1 values.
    noise_variances : float or array (n,)
        Variances of the noise of the values, the known and the fitted part together.
    log_likelihood : float
        Log marginal likelihood of the values.
    """

    def __init__(
        self,
        kernel: Any,
        x: np.ndarray,
        values: np.ndarray,
        noise_variances: ArrayLike = JITTER,
        noise: Any = None,
        optimizer: str | Callable | None = "fmin_l_bfgs_b",
    ) -> None:
        """Condition the process on the values, after fitting any hyperparameters.

        The docstring of the class describes the parameters.
        """
        self.x = x
        self.values = values
        self.noise_level = 0.0  # `_fit` replaces it if there is `noise`
        self.noise_variances = noise_variances
        if noise is None and optimizer is None:
            # There is nothing to fit, so use a faster way to the same results.
            self._condition(kernel)
        else:
            self._fit(kernel, noise, optimizer)

    def _fit(self, kernel: Any, noise: Any, optimizer: str | Callable | None) -> None:
        """Fit the free hyperparameters with scikit-learn, and set all attributes.

        The variance of `noise` is fitted together with the kernel. Afterwards the noise
        is separated from the kernel, and added to the known `noise_variances`. As a
        second call would add it again, this is called only once.
        """
        kernel_with_noise = kernel if noise is None else kernel + noise
        model = GaussianProcessRegressor(
            kernel_with_noise, alpha=self.noise_variances, optimizer=optimizer
        )
        with warnings.catch_warnings():
            # scikit-learn warns if a length is at its bound. Here this is expected for
            # an input without effect.
            warnings.simplefilter("ignore")
            model.fit(self.x, self.values)

        if noise is None:
            self.kernel = model.kernel_
        else:
            # The fitted sum `kernel + noise` has its two terms as k1 and k2.
            self.kernel = model.kernel_.k1
            fitted_noise = model.kernel_.k2
            self.noise_level = float(fitted_noise.noise_level)
            fitted_variances = np.diagonal(fitted_noise(self.x))
            self.noise_variances = self.noise_variances + fitted_variances
        self.cholesky = model.L_
        self.weights = model.alpha_
        self.log_likelihood = float(model.log_marginal_likelihood_value_)

    def _condition(self, kernel: Any) -> None:
        """Condition a process whose hyperparameters are known, and set all attributes.

        This is Algorithm 2.1 of Rasmussen & Williams (2006). The steps are those of
        `GaussianProcessRegressor` of scikit-learn, and the results have the same bits.
        Its checks and copies are left out, because they take most of the time for tens
        of values.
        """
        covariance = kernel(self.x)
        covariance[np.diag_indices_from(covariance)] += self.noise_variances
        self.kernel = kernel
        self.cholesky = linalg.cholesky(covariance, lower=True, check_finite=False)
        self.weights = linalg.cho_solve(
            (self.cholesky, True), self.values, check_finite=False
        )
        # scikit-learn computes the product of values and weights in this way. Another
        # way, such as `@`, would round differently.
        (data_fit,) = np.einsum("ik,ik->k", self.values[:, None], self.weights[:, None])
        self.log_likelihood = float(
            -0.5 * data_fit
            - np.log(np.diag(self.cholesky)).sum()
            - len(self.values) / 2 * np.log(2 * np.pi)
        )

    def mean(self, x: np.ndarray) -> np.ndarray:
        """Predict means (m,) at points (m, d)."""
        return self.kernel(x, self.x) @ self.weights

    def compute_weights(self, values: np.ndarray) -> np.ndarray:
        """Compute the weights (n, f) of other values (n, f) at the same points."""
        return linalg.cho_solve((self.cholesky, True), values)

    def moments(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predict means and variances (m,) at points (m, d), without noise."""
        between = self.kernel(x, self.x)
        solved = linalg.solve_triangular(
            self.cholesky, between.T, lower=True, check_finite=False
        )
        variance = self.kernel.diag(x) - (solved**2).sum(axis=0)
        return between @ self.weights, np.maximum(variance, MIN_VARIANCE)

    def predict_left_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Predict each value from all the others (leave-one-out prediction).

        The results are means and variances (n,), without noise. Let K be the covariance
        of the values, noise included. The mean is
        value_i - (K^-1 values)_i / (K^-1)_ii, and the variance of value_i is
        1 / (K^-1)_ii (Rasmussen & Williams 2006, section 5.4.2). The noise of value_i
        is subtracted from it.
        """
        inverse = linalg.cho_solve((self.cholesky, True), np.eye(len(self.x)))
        precision = inverse.diagonal()
        means = self.values - self.weights / precision
        variances = np.maximum(1 / precision - self.noise_variances, MIN_VARIANCE)
        return means, variances


class SparseProcess:
    """A process of mean 0, conditioned on many values through a few centres (SG06).

    The values depend on each other only through the process at the M centres. The part
    of the variance at a point that the centres do not explain counts as noise of its
    value. The work therefore grows with n M^2 instead of n^3. If all points are
    centres, the process is exact.

    Parameters
    ----------
    kernel : kernel of scikit-learn
        Covariance of the process; its hyperparameters stay as they are.
    x : array (n, d)
        The points.
    values : array (n,)
        The values at the points.
    noise_variances : array (n,)
        Known variances of the noise of the values.
    centres : array (M, d)
        Some of the points.

    Attributes
    ----------
    kernel : kernel
        Covariance of the process.
    x : array (M, d)
        The centres. A prediction uses the covariances of its point with them.
    weights : array (M,)
        Weights of these covariances in a predicted mean.
    """

    def __init__(
        self,
        kernel: Any,
        x: np.ndarray,
        values: np.ndarray,
        noise_variances: np.ndarray,
        centres: np.ndarray,
    ) -> None:
        """Condition the process on the values.

        The docstring of the class describes the parameters.
        """
        self.kernel = kernel
        self.x = centres  # a prediction needs the centres, but no other points
        self.values = values
        self.noise_variances = noise_variances

        # Let K_cc be the covariance of the process at the centres, and K_cx that
        # between centres and points. Of the covariance of the points, the centres
        # explain K_xc K_cc^-1 K_cx = F' F, where the features F are L^-1 K_cx with the
        # Cholesky factor L of K_cc.
        covariance_of_centres = kernel(centres)
        jitter = JITTER * covariance_of_centres.diagonal().mean()
        self._centres_cholesky = linalg.cholesky(
            covariance_of_centres + jitter * np.eye(len(centres)), lower=True
        )
        features = self._solve(self._centres_cholesky, kernel(centres, x))
        # The variance that the centres leave unexplained counts as noise.
        unexplained = kernel.diag(x) - (features**2).sum(axis=0)
        self._total_noise = noise_variances + np.maximum(unexplained, 0.0)

        # Before the values are known, the coefficients of the features have the unit
        # matrix as covariance. Afterwards, the inverse of their covariance is the
        # precision matrix I + A A', where A are the features divided by the standard
        # deviation of the noise (Snelson & Ghahramani 2006).
        self._scaled_features = features / np.sqrt(self._total_noise)
        precision = (
            np.eye(len(centres)) + self._scaled_features @ self._scaled_features.T
        )
        self._precision_cholesky = linalg.cholesky(precision, lower=True)
        self.weights = self.compute_weights(values)

        # So the values lower the covariance of the coefficients by I - precision^-1.
        # Write this as R R', and keep L'^-1 R: `moments` multiplies it by covariances
        # with the centres, and sums the squares.
        eigenvalues, axes = linalg.eigh(precision)
        reduction_factor = axes * np.sqrt(np.maximum(1 - 1 / eigenvalues, 0.0))
        self._reduction = linalg.solve_triangular(
            self._centres_cholesky, reduction_factor, lower=True, trans="T"
        )

    def mean(self, x: np.ndarray) -> np.ndarray:
        """Predict means (m,) at points (m, d)."""
        return self.kernel(x, self.x) @ self.weights

    def compute_weights(self, values: np.ndarray) -> np.ndarray:
        """Compute the weights (M, f) of other values (n, f) at the same points."""
        scaled = (values.T / np.sqrt(self._total_noise)).T
        coefficients = linalg.cho_solve(
            (self._precision_cholesky, True), self._scaled_features @ scaled
        )
        return linalg.solve_triangular(
            self._centres_cholesky, coefficients, lower=True, trans="T"
        )

    def moments(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predict means and variances (m,) at points (m, d), without noise."""
        between = self.kernel(x, self.x)
        reduction = ((between @ self._reduction) ** 2).sum(axis=1)
        variance = self.kernel.diag(x) - reduction
        return between @ self.weights, np.maximum(variance, MIN_VARIANCE)

    def predict_left_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Predict each value from all the others (leave-one-out prediction).

        The formulas are those of `Process.predict_left_out`. They need the inverse of
        the covariance K of the values. Here K = F' F + D, with the features F and the
        diagonal matrix D of the noise, so the matrix inversion lemma gives
        K^-1 = D^(-1/2) (I - B' B) D^(-1/2).
        """
        B = self._solve(self._precision_cholesky, self._scaled_features)
        noise_std = np.sqrt(self._total_noise)
        inverse_diagonal = (1 - (B**2).sum(axis=0)) / self._total_noise
        scaled_values = self.values / noise_std
        inverse_times_values = (scaled_values - B.T @ (B @ scaled_values)) / noise_std
        means = self.values - inverse_times_values / inverse_diagonal
        # The variance that the centres leave unexplained is part of the process, so
        # subtract only the noise of the values.
        variances = np.maximum(
            1 / inverse_diagonal - self.noise_variances, MIN_VARIANCE
        )
        return means, variances

    @staticmethod
    def _solve(lower: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Solve the equations lower X = right with a lower triangular matrix."""
        return linalg.solve_triangular(lower, right, lower=True, check_finite=False)


def choose_centres(kernel: Any, x: np.ndarray, count: int) -> np.ndarray:
    """Choose the centres of a `SparseProcess` among its points.

    Each step chooses the point whose variance is least explained by the centres chosen
    before. These points are the pivots of a Cholesky decomposition of the covariance,
    and the features are the rows of its factor.

    Parameters
    ----------
    kernel : kernel of scikit-learn
        Covariance of the process.
    x : array (n, d)
        The points.
    count : int
        Largest number of centres to choose.

    Returns
    -------
    array of int
        Row numbers of the centres. There are fewer than `count` if they already explain
        the whole variance.
    """
    remaining_variance = kernel.diag(x).copy()
    # A smaller variance is a rounding error.
    negligible_variance = JITTER * remaining_variance.max()
    features = np.zeros((count, len(x)))
    rows: list[int] = []
    while len(rows) < count and remaining_variance.max() > negligible_variance:
        row = int(remaining_variance.argmax())
        covariances = kernel(x[row : row + 1], x)[0]
        earlier_features = features[: len(rows)]
        # The new feature is the part of the covariances that earlier features do not
        # explain.
        feature = (covariances - earlier_features[:, row] @ earlier_features) / np.sqrt(
            remaining_variance[row]
        )
        features[len(rows)] = feature
        remaining_variance -= feature**2
        # Rounding errors must not let the same row be chosen again.
        remaining_variance[row] = 0.0
        rows.append(row)
    return np.array(rows)


class SampleNoise(WhiteKernel):
    """Noise whose variance differs between the samples of the training data.

    It is noise_level / precision_i for sample i, and noise_level for a new sample.
    """

    def __init__(
        self, noise_level: float, noise_level_bounds: Any, precision: ArrayLike
    ) -> None:
        super().__init__(noise_level, noise_level_bounds)
        self.precision = precision

    def __call__(
        self, X: np.ndarray, Y: np.ndarray | None = None, eval_gradient: bool = False
    ) -> Any:
        """Compute the covariance of the noise, and its gradient on request.

        It is diagonal between the training samples X, and 0 between X and other points
        Y.
        """
        if Y is not None:
            return np.zeros((len(X), len(Y)))
        K = np.diag(self.noise_level / np.asarray(self.precision))
        if not eval_gradient:
            return K
        return K, K[:, :, np.newaxis]
