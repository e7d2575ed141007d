"""Samples of a fit in one form, and their noise.

(A35)  Aitken 1935, on least squares and linear combination of observations: residuals whose noises are correlated
       are made independent by a root of their covariance
"""

import numpy as np
from numpy.typing import ArrayLike

Scatter = tuple[
    float, float
]  # of replicates about their samples' means: sum of squares, degrees of freedom


def independent_mixing(
    noise_covariance: ArrayLike | None, stretch: np.ndarray, precision: np.ndarray
) -> np.ndarray:
    """Matrix (outputs, outputs) from scaled outputs to combinations with independent noises of one variance (A35).

    Outputs of one experiment share its noise; taken as independent, the shared part looks like a signal. `stretch`
    (outputs,) is the unit of the scaled outputs in units of y. The determinant is one, so the combinations stay about
    as wide as the outputs.
    """
    if noise_covariance is None:
        return np.eye(len(stretch))
    covariance = np.asarray(noise_covariance, dtype=float)
    if covariance.shape != 2 * stretch.shape or not np.allclose(
        covariance, covariance.T
    ):
        raise ValueError(
            f"noise_covariance is {noise_covariance!r}; expected symmetric, {2 * stretch.shape}"
        )
    if np.ptp(precision, axis=1).any():
        raise ValueError(
            "precision differs between outputs; allowed with noise_covariance: one per sample"
        )
    try:
        root = np.linalg.cholesky(covariance / np.outer(stretch, stretch))
    except np.linalg.LinAlgError as error:
        raise ValueError(
            f"noise_covariance is {noise_covariance!r}; expected positive definite"
        ) from error
    return np.linalg.inv(root).T * np.prod(np.diagonal(root)) ** (1 / len(root))


class Combined:
    """A model of k responses whose combinations, each scaled, have a process of their own."""

    values: (
        np.ndarray
    )  # (n, k), the combinations at the samples, of mean 0 and variance 1

    def _combine(self, Y: np.ndarray, mixing: np.ndarray) -> None:
        """Keep the combinations of the responses Y (n, k), the columns of `mixing`, and their scaling."""
        mixed, self._mixing, self._unmixing = Y @ mixing, mixing, np.linalg.inv(mixing)
        self._middle, self._scale = (
            mixed.mean(axis=0),
            np.maximum(mixed.std(axis=0), 1e-12),
        )
        self.values = (mixed - self._middle) / self._scale

    def unmixed(self, scaled: np.ndarray) -> np.ndarray:
        """Compute responses (..., k) from the scaled combinations (..., k) that the processes model."""
        return (scaled * self._scale + self._middle) @ self._unmixing

    def _covariance(self, variances: np.ndarray) -> np.ndarray:
        """Compute the covariance (m, k, k) of the responses from variances (m, k) of the scaled combinations."""
        roots = (np.sqrt(variances) * self._scale)[:, :, None] * self._unmixing
        return roots.transpose(0, 2, 1) @ roots


def pure_error(
    noise_covariance: ArrayLike | None,
    freedom: float,
    stretch: np.ndarray,
    mixing: np.ndarray,
) -> Scatter:
    """Compute the sum of squares and number of residuals of replicates about their samples' means, in mixed outputs.

    `noise_covariance`, of one value of precision 1, is in units of y; with `freedom` 0 it is known up to a factor
    alone, and both results are 0.
    """
    if freedom == 0:
        return 0.0, 0.0
    if noise_covariance is None or not freedom > 0:
        raise ValueError(
            f"noise_freedom is {freedom!r}; expected from 0, and 0 without noise_covariance"
        )
    scaled = np.asarray(noise_covariance, dtype=float) / np.outer(stretch, stretch)
    return float(freedom * np.trace(mixing.T @ scaled @ mixing)), float(
        freedom * len(mixing)
    )


def checked_samples(
    X: ArrayLike,
    y: ArrayLike,
    sample_weight: ArrayLike | None = None,
    *,
    precision: ArrayLike | None = None,
    noise_covariance: ArrayLike | None = None,
    noise_freedom: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Check samples; `noise_covariance` and `noise_freedom` are for others.

    X (samples, inputs), Y (samples, outputs), counts (samples,) and precision (samples, outputs), all finite.
    """
    X, Y = np.asarray(X, dtype=float), np.asarray(y, dtype=float)
    Y = Y[:, None] if Y.ndim == 1 else Y
    if X.ndim != 2 or Y.ndim != 2 or len(X) != len(Y) or X.size == 0 or Y.size == 0:
        raise ValueError(
            f"X has shape {X.shape}, y {np.shape(y)}; expected two tables of equal length"
        )
    count = (
        np.ones(len(X))
        if sample_weight is None
        else np.asarray(sample_weight, dtype=float)
    )
    precision = (
        np.ones(len(X)) if precision is None else np.asarray(precision, dtype=float)
    )
    if count.shape != (len(X),):
        raise ValueError(f"sample_weight has shape {count.shape}; expected {(len(X),)}")
    if precision.shape not in ((len(X),), Y.shape):
        raise ValueError(
            f"precision has shape {precision.shape}; expected {(len(X),)} or {Y.shape}"
        )
    if not all(np.isfinite(values).all() for values in (X, Y, count, precision)):
        raise ValueError("X, y, sample_weight and precision must be finite")
    if (count < 0).any() or (precision <= 0).any():
        raise ValueError(
            "sample_weight must not be negative, precision must be above zero"
        )
    precision = np.broadcast_to(precision.reshape(len(X), -1), Y.shape)
    counts = count > 0
    if np.count_nonzero(counts) < 2:
        raise ValueError(
            f"{np.count_nonzero(counts)} samples have a weight above zero; expected at least 2 (n_samples = {len(X)})"
        )
    return X[counts], Y[counts], count[counts], precision[counts]


def checked_points(X: ArrayLike, inputs: int) -> np.ndarray:
    """Check parameter sets as an array (samples, inputs); ValueError for another shape."""
    X = np.asarray(X, dtype=float)
    if X.ndim != 2 or X.shape[1] != inputs:
        raise ValueError(f"X has shape {X.shape}; expected (samples, {inputs})")
    return X
