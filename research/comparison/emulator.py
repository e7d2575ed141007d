"""A stand-in for the simulator: mean responses and the noise of a run, fitted to points that were simulated.

Ten repetitions of every design cannot be poured. The emulator's mean is the truth by definition, and its noise is
measured. Mean and noise are chosen by the user of the emulator:

mean
    the better surrogate of two by cross-validation (`chosen_by_cross_validation`); or a Gaussian process with any
    kernel, on means with known errors (`with_process`)
noise
    of one covariance everywhere (`EvenNoise`), or of another size at other parameters (`ScalingNoise`)
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from repose.calibrate.training import compute_corrected_r2
from research.comparison.models import configured_network, gaussian_process
from research.comparison.points import Points

CANDIDATES = {"network": configured_network, "Gaussian process": gaussian_process}
FOLDS = 5
MOST_FOR_SCALES = 600  # points for the fit of a kernel's lengths

Predict = Callable[[np.ndarray], np.ndarray]


class Noise(Protocol):
    """The deviations of single runs from the mean."""

    def draw(self, X: np.ndarray, seeds: int, rng: np.random.Generator) -> np.ndarray:
        """Deviations (n, seeds, k) of new runs at points X (n, d), in the responses' units."""


class EvenNoise(NamedTuple):
    """Normal noise with the same covariance everywhere."""

    covariance: np.ndarray  # (k, k), of a single run

    def draw(self, X: np.ndarray, seeds: int, rng: np.random.Generator) -> np.ndarray:
        """Deviations (n, seeds, k) of new runs; only the number of the points X counts."""
        zeros = np.zeros(len(self.covariance))
        return rng.multivariate_normal(zeros, self.covariance, size=(len(X), seeds))


class ScalingNoise(NamedTuple):
    """Normal noise with the same correlation everywhere and a size that varies with the parameters."""

    # (1 + d, k), log of a run's variance, linear in x: constant and slopes
    log_variance: np.ndarray
    correlation: np.ndarray  # (k, k), of the responses of a run
    low: np.ndarray  # (d,), lower end of the box that scales x
    width: np.ndarray  # (d,), of this box

    def std(self, X: np.ndarray) -> np.ndarray:
        """Give standard deviations (n, k) of a single run's responses at points X (n, d), in their units."""
        x = np.column_stack([np.ones(len(X)), (X - self.low) / self.width])
        return np.exp(0.5 * x @ self.log_variance)

    def draw(self, X: np.ndarray, seeds: int, rng: np.random.Generator) -> np.ndarray:
        """Deviations (n, seeds, k) of new runs at points X (n, d), in the responses' units."""
        root = np.linalg.cholesky(self.correlation)
        normal = rng.standard_normal((len(X), seeds, len(root)))
        mixed = np.empty_like(normal)
        for j, row in enumerate(root):
            mixed[:, :, j] = sum(row[i] * normal[:, :, i] for i in range(j + 1))
        return self.std(X)[:, None] * mixed


class Emulator(NamedTuple):
    """The stand-in for the simulator."""

    mean: Predict  # points (n, d) to responses (n, k)
    noise: Noise
    name: str  # of the surrogate for the mean
    explainable: np.ndarray  # (k,), cross-validated share of the explainable variance

    def pour(self, X: np.ndarray, seeds: int, rng: np.random.Generator) -> Points:
        """Points X (n, d) with emulated runs."""
        return Points(X, self.mean(X)[:, None] + self.noise.draw(X, seeds, rng))


def chosen_by_cross_validation(
    points: Points, settings: Mapping[str, Any], seed: int
) -> Emulator:
    """Fit an emulator to some points: the better of `CANDIDATES`, with noise that scales.

    `settings` is the section `network`; `seed` is for the folds and the network. ValueError if the runs do not
    determine the covariance of the noise.
    """
    covariance = points.covariance()
    if covariance is None:
        raise ValueError(
            "too few points have two runs or more; expected some, for the noise"
        )
    parts = np.array_split(
        np.random.default_rng(seed).permutation(len(points.X)), FOLDS
    )
    shares = {}
    for name, model in CANDIDATES.items():

        def fitted(rest, model=model):
            return _mean_of(model(rest, settings, seed))

        predicted = left_out(points, fitted, parts)
        shares[name] = explainable(points.means(), predicted, points.known_errors())
    name = max(shares, key=lambda key: shares[key].mean())
    mean = _mean_of(CANDIDATES[name](points, settings, seed))
    return Emulator(mean, scaling_noise(points, covariance), name, shares[name])


def with_process(
    points: Points,
    errors: np.ndarray,
    covariance: np.ndarray,
    kernel: Callable[[int], Any],
    seed: int,
) -> Emulator:
    """Fit an emulator: a Gaussian process for each response on means with known errors, even noise.

    X (n, d) is in the unit cube; `errors` (n, k) are standard errors of the means; `covariance` (k, k) is of a single
    run. `kernel` makes a scikit-learn kernel with start values from the number of inputs. The kernel of each response
    is fitted to at most `MOST_FOR_SCALES` points, and held in the cross-validation.
    """
    rows = np.random.default_rng(seed).permutation(len(points.X))
    means = points.means()
    scaled = rows[:MOST_FOR_SCALES]
    parts = [rows[fold::FOLDS] for fold in range(FOLDS)]
    processes = []
    shares = []
    for k in range(points.responses):
        x = points.X
        y = means[:, k]
        error = errors[:, k]
        first = kernel(x.shape[1])
        fitted = _process(x[scaled], y[scaled], error[scaled], first, fit=True).kernel_
        processes.append(_process(x, y, error, fitted, fit=False))
        predicted = np.empty(len(y))
        for part in parts:
            rest = np.setdiff1d(rows, part)
            predicted[part] = _process(
                x[rest], y[rest], error[rest], fitted, fit=False
            ).predict(x[part])
        shares.append(compute_corrected_r2(y, predicted, error))

    def mean(X):
        return np.column_stack(
            [process.predict(np.atleast_2d(X)) for process in processes]
        )

    return Emulator(
        mean, EvenNoise(covariance), "Gaussian process", np.array(shares, float)
    )


def left_out(
    points: Points, fit: Callable[[Points], Predict], parts: Sequence[np.ndarray]
) -> np.ndarray:
    """Predictions (n, k) for the points of each part by a fit to all the others.

    `fit` returns a function from X (n, d) to responses (n, k). `parts` hold numbers of points; each point is in one
    part.
    """
    predicted = np.empty((len(points.X), points.responses))
    for part in parts:
        rest = np.setdiff1d(np.arange(len(points.X)), part)
        predicted[part] = fit(points.take(rest))(points.X[part])
    return predicted


def explainable(
    means: np.ndarray, predicted: np.ndarray, errors: np.ndarray
) -> np.ndarray:
    """Share (k,) of the explainable variance in predictions; see `repose.calibrate.training.compute_corrected_r2`.

    All arrays are (n, k); `errors` are standard errors of the means. NaN where the noise explains all of the variance,
    or an error is unknown.
    """
    columns = zip(means.T, predicted.T, errors.T, strict=True)
    return np.array([compute_corrected_r2(*column) for column in columns], float)


def scaling_noise(points: Points, covariance: np.ndarray) -> ScalingNoise:
    """Noise of points, some with several runs; `covariance` (k, k) is of a single run, over all points."""
    low = points.X.min(axis=0)
    width = points.X.max(axis=0) - low
    width = np.where(width > 0, width, 1.0)  # a parameter that is fixed
    std = np.sqrt(np.outer(np.diagonal(covariance), np.diagonal(covariance)))
    return ScalingNoise(
        _log_variance((points.X - low) / width, points), covariance / std, low, width
    )


def _mean_of(predict):
    """Keep the mean alone of a prediction of mean and standard deviation."""
    return lambda X: predict(X)[0]


def _process(x, y, error, kernel, fit):
    """Make a process on inputs in the unit cube; its kernel is fitted or held."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor

    model = GaussianProcessRegressor(
        kernel,
        alpha=(error / y.std()) ** 2,
        normalize_y=True,
        optimizer="fmin_l_bfgs_b" if fit else None,
    )
    with warnings.catch_warnings():
        # a length at its upper bound is a parameter without effect, which is no fault
        warnings.simplefilter("ignore", ConvergenceWarning)
        return model.fit(x, y)


def _log_variance(x, points):
    """Coefficients (1 + d, k) of the log of a run's variance, by gamma regression on each point's own variance.

    A variance out of n runs is gamma distributed about the true one with n - 1 degrees of freedom, so a regression
    with log link is unbiased, whereas logarithms of variances are not.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.linear_model import GammaRegressor

    several = points.counts() > 1
    freedom = points.counts()[several] - 1
    coefficients = []
    for k in range(points.responses):
        variance = np.nanvar(points.values[several, :, k], axis=1, ddof=1)
        scale = np.average(variance, weights=freedom)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            regression = GammaRegressor(alpha=1e-4, max_iter=1000).fit(
                x[several], np.maximum(variance / scale, 1e-6), sample_weight=freedom
            )
        coefficients.append(
            [regression.intercept_ + math.log(scale), *regression.coef_]
        )
    return np.array(coefficients).T
