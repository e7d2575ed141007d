"""Accuracy of predictions of noisy means: R2, its explainable part, coverage of error bars.

The mean of a test point has a noise of its own, which no prediction can meet. R2 of the means counts this noise as a
fault of the prediction; the explainable share (`repose.calibrate.training.compute_corrected_r2`) subtracts it from both sums.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from repose.calibrate.surrogates.accuracy import compute_r2
from repose.calibrate.training import compute_corrected_r2

LEVELS = (0.5, 0.9)


def accuracy(
    means: np.ndarray, errors: np.ndarray, predicted: np.ndarray
) -> dict[str, Any]:
    """R2, explainable share and root mean squared error of one response at m points.

    `errors` are standard errors of the means. ``reachable_r2`` is the R2 of the noise-free means themselves, None where
    all means are alike. ``rmse`` is that of the noise-free means, 0 where chance makes its square negative.
    """
    total = np.sum((means - means.mean()) ** 2)
    noise = np.sum(errors**2)
    return {
        "r2": compute_r2(means, predicted),
        "explainable": compute_corrected_r2(means, predicted, errors),
        "reachable_r2": float(1 - noise / total) if total > 0 else None,
        "rmse": math.sqrt(
            max(0.0, (np.sum((means - predicted) ** 2) - noise) / len(means))
        ),
    }


def bootstrap(
    means: np.ndarray,
    errors: np.ndarray,
    predicted: np.ndarray,
    resamples: int = 2000,
    seed: int = 0,
    confidence: float = 0.95,
) -> dict[str, tuple[float, ...]]:
    """Percentile intervals of ``r2`` and ``explainable`` of `accuracy`; test points are drawn with replacement.

    Each interval is (low, high). Draws in which all points are alike are left out. Fewer than three points raise
    ValueError.
    """
    m = len(means)
    if m < 3:
        raise ValueError(f"{m} points; expected at least 3")
    rows = np.random.default_rng(seed).integers(m, size=(resamples, m))
    y = means[rows]
    p = predicted[rows]
    noise = (errors**2)[rows].sum(axis=1)
    square = ((y - p) ** 2).sum(axis=1)
    total = ((y - y.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    between = total - (1 - 1 / m) * noise
    good = (total > 0) & (between > 0)
    tails = [(1 - confidence) / 2, (1 + confidence) / 2]
    found = {
        "r2": 1 - square[good] / total[good],
        "explainable": 1 - (square - noise)[good] / between[good],
    }
    return {
        name: tuple(map(float, np.quantile(values, tails)))
        for name, values in found.items()
    }


def on_runs(values: np.ndarray, predicted: np.ndarray) -> float | None:
    """R2 of predictions (m,) on single runs (m, seeds), NaN where a run failed; None where all are alike."""
    ok = np.isfinite(values)
    return compute_r2(values[ok], np.broadcast_to(predicted[:, None], values.shape)[ok])


def on_few_seeds(values: np.ndarray, predicted: np.ndarray, seeds: int) -> float | None:
    """R2 of predictions on means over few runs: the mean over disjoint groups of the runs.

    `values` (m, runs) are NaN where a run failed. None where a point has fewer than `seeds` runs.
    """
    groups = values.shape[1] // seeds
    if groups == 0:
        return None
    grouped = values[:, : groups * seeds].reshape(len(values), groups, seeds)
    counts = np.isfinite(grouped).sum(axis=2)
    means = np.where(
        counts > 0, np.nansum(grouped, axis=2) / np.maximum(counts, 1), np.nan
    )
    found = [compute_r2(y[np.isfinite(y)], predicted[np.isfinite(y)]) for y in means.T]
    return float(np.mean(np.array(found, dtype=float)))


def calibration(
    means: np.ndarray, errors: np.ndarray, predicted: np.ndarray, std: np.ndarray
) -> dict[str, float]:
    """Coverage of the error bars of one response.

    ``coverage_50`` and ``coverage_90`` are shares of the means inside the intervals of `LEVELS`;
    ``standardised_square`` is the mean square of the deviations in standard deviations. A calibrated model has the
    levels themselves, and 1. `std` is of the predicted noise-free mean; the noise of the test point is added.
    """
    z = (means - predicted) / np.sqrt(std**2 + errors**2)
    covered = {
        f"coverage_{100 * level:.0f}": float(
            np.mean(np.abs(z) <= stats.norm.ppf((1 + level) / 2))
        )
        for level in LEVELS
    }
    return covered | {"standardised_square": float(np.mean(z**2))}


def mean_and_error(values: ArrayLike) -> tuple[float, float]:
    """Mean and standard error of repetitions (n,).

    The error is NaN for a single value; both are NaN where a value is missing.
    """
    values = np.array(values, dtype=float)
    error = values.std(ddof=1) / math.sqrt(len(values)) if len(values) > 1 else math.nan
    return float(values.mean()), float(error)
