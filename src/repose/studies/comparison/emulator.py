"""A stand-in for the simulator: mean responses and their noise, fitted to all poured points.

Ten repetitions of every design cannot be poured. The emulator's mean is then the truth by definition, and its
noise is the measured one: correlated between the two responses of a pile, and of another size at other parameters.
"""

import math
import warnings
from typing import NamedTuple

import numpy as np

from repose.chain.train import r2_noise_corrected
from repose.studies.comparison import points as poured
from repose.studies.comparison.models import configured_network, gaussian_process

CANDIDATES = {"network": configured_network, "Gaussian process": gaussian_process}
FOLDS = 5


class Emulator(NamedTuple):
    """mean: function of X (n, 6) to (n, 2); log_variance (7, 2): of a run's responses, linear in x; correlation of
    the two within points; low, width (6,): of the box that x is scaled by; name and cross-validated explainable share
    (2,) of what the mean is."""

    mean: object
    log_variance: np.ndarray
    correlation: float
    low: np.ndarray
    width: np.ndarray
    name: str
    explainable: np.ndarray

    def noise_std(self, X):
        """Standard deviations (n, 2) of a single run's responses at X (n, 6)."""
        x = np.column_stack([np.ones(len(X)), (X - self.low) / self.width])
        return np.exp(0.5 * x @ self.log_variance)

    def pour(self, X, seeds, rng):
        """Points at X (n, 6) with this many emulated runs each."""
        normal = rng.standard_normal((len(X), seeds, 2))
        normal[:, :, 1] = (
            self.correlation * normal[:, :, 0] + math.sqrt(1 - self.correlation**2) * normal[:, :, 1]
        )
        return poured.Points(X, self.mean(X)[:, None] + self.noise_std(X)[:, None] * normal)


def fit(points, settings, seed):
    """The emulator of some points: the better candidate by cross-validation, and the noise.

    settings: the configuration's section `network`. Raises ValueError where no point has two runs.
    """
    covariance = points.covariance()
    if covariance is None:
        raise ValueError("no point has two runs; allowed: some, for the noise")
    shares = {name: cross_validated(points, model, settings, seed) for name, model in CANDIDATES.items()}
    name = max(shares, key=lambda key: shares[key].mean())
    predict = CANDIDATES[name](points, settings, seed)
    low = points.X.min(axis=0)
    width = points.X.max(axis=0) - low
    return Emulator(
        lambda X: predict(X)[0],
        _log_variance((points.X - low) / width, points),
        float(covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])),
        low,
        width,
        name,
        shares[name],
    )


def cross_validated(points, model, settings, seed):
    """Explainable share (2,) of a model's predictions for points left out of its fit, in FOLDS parts."""
    parts = np.array_split(np.random.default_rng(seed).permutation(len(points.X)), FOLDS)
    predicted = np.empty((len(points.X), 2))
    for part in parts:
        rest = np.setdiff1d(np.arange(len(points.X)), part)
        predicted[part] = model(points.take(rest), settings, seed)(points.X[part])[0]
    means, errors = points.means(), points.known_errors()
    return np.array([r2_noise_corrected(means[:, k], predicted[:, k], errors[:, k]) for k in range(2)], float)


def _log_variance(x, points):
    """Coefficients (7, 2) of the log of a run's variance, by gamma regression on each point's own variance.

    A variance out of n runs is gamma distributed about the true one with n - 1 degrees of freedom, so a regression
    with log link is unbiased, whereas logarithms of variances are not.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.linear_model import GammaRegressor

    several = points.counts() > 1
    freedom = points.counts()[several] - 1
    coefficients = []
    for k in range(2):
        variance = np.nanvar(points.values[several, :, k], axis=1, ddof=1)
        scale = np.average(variance, weights=freedom)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            regression = GammaRegressor(alpha=1e-4, max_iter=1000).fit(
                x[several], np.maximum(variance / scale, 1e-6), sample_weight=freedom
            )
        coefficients.append([regression.intercept_ + math.log(scale), *regression.coef_])
    return np.array(coefficients).T
