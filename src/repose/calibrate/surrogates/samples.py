"""Check the samples of a fit, and describe their noise.

(A35)  Aitken 1935, on least squares and linear combination of observations: residuals
       whose noises are correlated are made independent by a root of their covariance
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

MIN_SCALE = 1e-12  # smallest scale, for a combination that does not vary


class Samples(NamedTuple):
    """Samples that count in a fit, as arrays of finite numbers."""

    X: np.ndarray  # (samples, inputs), parameter sets
    Y: np.ndarray  # (samples, outputs), responses
    sample_weight: np.ndarray  # (samples,), how often each sample counts, above 0
    precision: np.ndarray  # (samples, outputs), above 0


class Scatter(NamedTuple):
    """Scatter of replicates about the means of their samples."""

    sum_of_squares: float
    degrees_of_freedom: float


NO_SCATTER = Scatter(0.0, 0.0)


def compute_decorrelating_mixing(
    noise_covariance: ArrayLike | None, output_scale: np.ndarray, precision: np.ndarray
) -> np.ndarray:
    """Compute the matrix M for which the combinations y M have independent noise.

    The outputs y of one experiment share part of their noise. If this were ignored, the
    shared part would look like a signal. Let C be the noise covariance of the scaled
    outputs, and L its Cholesky factor, so L L' = C. Then the noise of y inv(L)' has the
    unit matrix as covariance (Aitken 1935). M is inv(L)' scaled to a determinant of 1,
    so that the combinations have a similar range as the outputs.

    Parameters
    ----------
    noise_covariance : array (outputs, outputs) or None
        In the units of the responses, up to a factor.
    output_scale : array (outputs,)
        Size of one unit of each scaled output, in units of the response.
    precision : array (samples, outputs)
        Weight of each value, as in `Surrogate.fit`. It must be the same for all outputs
        of a sample.

    Returns
    -------
    array (outputs, outputs)
        The matrix M, which has the coefficients of a combination in each column.
        Without a noise covariance, it is the unit matrix.

    Raises
    ------
    ValueError
        If the matrix is not a covariance, or if the precision of a sample differs
        between outputs.
    """
    if noise_covariance is None:
        return np.eye(len(output_scale))
    covariance = np.asarray(noise_covariance, dtype=float)
    shape = (len(output_scale), len(output_scale))
    if covariance.shape != shape or not np.allclose(covariance, covariance.T):
        raise ValueError(
            f"noise_covariance is {noise_covariance!r}; "
            f"expected a symmetric matrix of shape {shape}"
        )
    if np.ptp(precision, axis=1).any():
        raise ValueError(
            "precision differs between the outputs of a sample; "
            "with noise_covariance, it must be the same for all of them"
        )
    try:
        factor = np.linalg.cholesky(covariance / np.outer(output_scale, output_scale))
    except np.linalg.LinAlgError as error:
        raise ValueError(
            f"noise_covariance is {noise_covariance!r}; expected positive definite"
        ) from error
    # The determinant of the triangular factor is the product of its diagonal. So the
    # inverse has the determinant 1 if it is multiplied by the geometric mean.
    geometric_mean = np.prod(np.diagonal(factor)) ** (1 / len(factor))
    return np.linalg.inv(factor).T * geometric_mean


class CombinedOutputs:
    """Base of models with a process for each combination of k responses.

    The combinations are scaled to mean 0 and variance 1.
    """

    values: np.ndarray  # (n, k), the scaled combinations at the samples

    def _combine(self, Y: np.ndarray, mixing: np.ndarray) -> None:
        """Set the scaled combinations of the responses Y (n, k), and their scaling.

        The coefficients of the combinations are the columns of `mixing` (k, k).
        """
        mixed = Y @ mixing
        self._mixing = mixing
        self._unmixing = np.linalg.inv(mixing)
        self._middle = mixed.mean(axis=0)
        self._scale = np.maximum(mixed.std(axis=0), MIN_SCALE)
        self.values = (mixed - self._middle) / self._scale

    def unmix(self, scaled: np.ndarray) -> np.ndarray:
        """Compute responses (..., k) from scaled combinations (..., k)."""
        return (scaled * self._scale + self._middle) @ self._unmixing

    def _covariance(self, variances: np.ndarray) -> np.ndarray:
        """Compute the covariance (m, k, k) of the responses.

        `variances` (m, k) are the variances of the scaled combinations, which are
        independent.
        """
        factors = (np.sqrt(variances) * self._scale)[:, :, None] * self._unmixing
        return factors.transpose(0, 2, 1) @ factors


def compute_pure_error(
    noise_covariance: ArrayLike | None,
    degrees_of_freedom: float,
    output_scale: np.ndarray,
    mixing: np.ndarray,
) -> Scatter:
    """Compute the scatter of replicates about their means, in the mixed outputs.

    The mixed outputs are the combinations of `compute_decorrelating_mixing`.

    Parameters
    ----------
    noise_covariance : array (outputs, outputs) or None
        Covariance of one value of precision 1, in the units of the responses.
    degrees_of_freedom : float
        Degrees of freedom from which replicates estimated the covariance. With 0 the
        covariance is known only up to a factor, and there is no scatter.
    output_scale, mixing : array
        As in `compute_decorrelating_mixing`.

    Raises
    ------
    ValueError
        If there are degrees of freedom without a covariance, or fewer than 0.
    """
    if degrees_of_freedom == 0:
        return NO_SCATTER
    if noise_covariance is None or not degrees_of_freedom > 0:
        raise ValueError(
            f"noise_freedom is {degrees_of_freedom!r}; "
            "expected 0 or more, and 0 without noise_covariance"
        )
    scaled = np.asarray(noise_covariance, dtype=float) / np.outer(
        output_scale, output_scale
    )
    return Scatter(
        sum_of_squares=float(degrees_of_freedom * np.trace(mixing.T @ scaled @ mixing)),
        degrees_of_freedom=float(degrees_of_freedom * len(mixing)),
    )


def check_samples(
    X: ArrayLike,
    y: ArrayLike,
    sample_weight: ArrayLike | None = None,
    *,
    precision: ArrayLike | None = None,
    noise_covariance: ArrayLike | None = None,
    noise_freedom: float = 0.0,
) -> Samples:
    """Check the samples of a fit, and convert them to arrays of standard shape.

    Samples of weight 0 are dropped. So that `fit` can pass on all its arguments,
    `noise_covariance` and `noise_freedom` are accepted here too, but ignored.
    `compute_decorrelating_mixing` and `compute_pure_error` check these two.

    Parameters
    ----------
    X : array (samples, inputs)
        Parameter sets.
    y : array (samples, outputs) or (samples,)
        Responses of the samples.
    sample_weight : array (samples,), optional
        Weight of each sample; by default 1.
    precision : array (samples,) or (samples, outputs), optional
        Precision of each sample, or of each of its values; by default 1. The noise
        variance of a value is inversely proportional to its precision.
    noise_covariance, noise_freedom
        Ignored.

    Returns
    -------
    Samples
        The samples of positive weight.

    Raises
    ------
    ValueError
        If shapes do not match, numbers are not finite, weights are negative, precisions
        are not positive, or fewer than two samples have a positive weight.
    """
    # Convert all arguments to arrays with a row for each sample.
    X = np.asarray(X, dtype=float)
    Y = np.asarray(y, dtype=float)
    if Y.ndim == 1:
        Y = Y[:, None]
    if X.ndim != 2 or Y.ndim != 2 or len(X) != len(Y) or X.size == 0 or Y.size == 0:
        raise ValueError(
            f"X has shape {X.shape}, y {np.shape(y)}; "
            "expected two tables of equal length"
        )
    n_samples = len(X)
    sample_weight = _convert_or_ones(sample_weight, n_samples)
    precision = _convert_or_ones(precision, n_samples)
    _check_arrays(X=X, Y=Y, sample_weight=sample_weight, precision=precision)
    # Give each value its own precision, also if there was one for each sample.
    precision = np.broadcast_to(precision.reshape(n_samples, -1), Y.shape)

    # Drop the samples of weight 0.
    is_used = sample_weight > 0
    n_used = np.count_nonzero(is_used)
    if n_used < 2:
        raise ValueError(
            f"{n_used} samples have a weight above zero; "
            f"expected at least 2 (n_samples = {n_samples})"
        )
    return Samples(
        X=X[is_used],
        Y=Y[is_used],
        sample_weight=sample_weight[is_used],
        precision=precision[is_used],
    )


def _convert_or_ones(values: ArrayLike | None, size: int) -> np.ndarray:
    """Convert values to an array of floats; None gives an array of ones."""
    if values is None:
        return np.ones(size)
    return np.asarray(values, dtype=float)


def _check_arrays(
    *, X: np.ndarray, Y: np.ndarray, sample_weight: np.ndarray, precision: np.ndarray
) -> None:
    """Check the shapes of the weights and precisions, and the values of all arrays.

    `check_samples` has checked the shapes of X and Y before.

    Parameters
    ----------
    X : array (samples, inputs)
        Parameter sets.
    Y : array (samples, outputs)
        Responses of the samples.
    sample_weight : array (samples,)
        Weight of each sample.
    precision : array (samples,) or (samples, outputs)
        Precision of each sample, or of each response of each sample.

    Raises
    ------
    ValueError
        If a shape is wrong, a number is not finite, a weight is negative, or a
        precision is not positive.
    """
    n_samples = len(X)
    if sample_weight.shape != (n_samples,):
        raise ValueError(
            f"sample_weight has shape {sample_weight.shape}; expected {(n_samples,)}"
        )
    if precision.shape not in ((n_samples,), Y.shape):
        raise ValueError(
            f"precision has shape {precision.shape}; "
            f"expected {(n_samples,)} or {Y.shape}"
        )
    arrays = (X, Y, sample_weight, precision)
    if not all(np.isfinite(values).all() for values in arrays):
        raise ValueError("X, y, sample_weight and precision must be finite")
    if (sample_weight < 0).any() or (precision <= 0).any():
        raise ValueError(
            "sample_weight must not be negative, and precision must be above zero"
        )


def check_points(X: ArrayLike, inputs: int) -> np.ndarray:
    """Convert parameter sets to an array of the shape (samples, inputs).

    Raises
    ------
    ValueError
        If they do not have this shape.
    """
    X = np.asarray(X, dtype=float)
    if X.ndim != 2 or X.shape[1] != inputs:
        raise ValueError(f"X has shape {X.shape}; expected (samples, {inputs})")
    return X
