"""How well predictions meet noisy means: R2, the part of it that can be explained, error bars that hold.

A test point's mean has a noise of its own, which no prediction can meet. R2 of the means counts it as the
prediction's fault; the explainable share (`training.r2_noise_corrected`) takes it off both sums.
"""

import math

import numpy as np
from scipy import stats

from repose.chain.train import r2_noise_corrected
from repose.surrogate.accuracy import r2

LEVELS = (0.5, 0.9)


def accuracy(means, errors, predicted):
    """R2, explainable share and root mean squared error of one response at m points, arrays (m,) each.

    errors: standard errors of the means. rmse is that of the noise-free means, 0 where chance makes it
    negative; reachable_r2 what the noise-free means themselves would reach.
    """
    total = np.sum((means - means.mean()) ** 2)
    noise = np.sum(errors**2)
    return {
        "r2": r2(means, predicted),
        "explainable": r2_noise_corrected(means, predicted, errors),
        "reachable_r2": float(1 - noise / total) if total > 0 else None,
        "rmse": math.sqrt(max(0.0, (np.sum((means - predicted) ** 2) - noise) / len(means))),
    }


def bootstrap(means, errors, predicted, resamples=2000, seed=0, confidence=0.95):
    """Percentile intervals of `accuracy`'s r2 and explainable, the m test points drawn anew with replacement.

    Returns {"r2": (low, high), "explainable": (low, high)}; draws in which all points are alike are left out.
    Raises ValueError with fewer than three points.
    """
    m = len(means)
    if m < 3:
        raise ValueError(f"{m} points; allowed: at least 3")
    rows = np.random.default_rng(seed).integers(m, size=(resamples, m))
    y, p, noise = means[rows], predicted[rows], (errors**2)[rows].sum(axis=1)
    square = ((y - p) ** 2).sum(axis=1)
    total = ((y - y.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    between = total - (1 - 1 / m) * noise
    good = (total > 0) & (between > 0)
    tails = [(1 - confidence) / 2, (1 + confidence) / 2]
    found = {
        "r2": 1 - square[good] / total[good],
        "explainable": 1 - (square - noise)[good] / between[good],
    }
    return {name: tuple(map(float, np.quantile(values, tails))) for name, values in found.items()}


def on_runs(values, predicted):
    """R2 of predictions (m,) on the single runs (m, seeds), NaN where there is none."""
    ok = np.isfinite(values)
    return r2(values[ok], np.broadcast_to(predicted[:, None], values.shape)[ok])


def on_few_seeds(values, predicted, seeds):
    """Mean R2 of predictions (m,) on means over disjoint groups of `seeds` runs of (m, runs).

    None where there are not so many runs.
    """
    groups = values.shape[1] // seeds
    if groups == 0:
        return None
    grouped = values[:, : groups * seeds].reshape(len(values), groups, seeds)
    counts = np.isfinite(grouped).sum(axis=2)
    means = np.where(counts > 0, np.nansum(grouped, axis=2) / np.maximum(counts, 1), np.nan)
    found = [r2(y[np.isfinite(y)], predicted[np.isfinite(y)]) for y in means.T]
    return float(np.mean(found))


def calibration(means, errors, predicted, std):
    """Share of the means inside the intervals of LEVELS, and mean standardised square, of one response (m,).

    std: of the predicted noise-free mean; the noise of the test point is added. A calibrated model has the
    levels themselves and 1.
    """
    z = (means - predicted) / np.sqrt(std**2 + errors**2)
    covered = {
        f"coverage_{100 * level:.0f}": float(np.mean(np.abs(z) <= stats.norm.ppf((1 + level) / 2)))
        for level in LEVELS
    }
    return covered | {"standardised_square": float(np.mean(z**2))}


def mean_and_error(values):
    """Mean and standard error of repetitions (n,), the error NaN for one; both NaN where a value is missing."""
    values = np.array(values, dtype=float)
    error = values.std(ddof=1) / math.sqrt(len(values)) if len(values) > 1 else math.nan
    return float(values.mean()), float(error)
