"""Model mean responses by Gaussian processes, given their errors (stochastic kriging).

The errors follow from replicates. The responses are turned into combinations that are
independent, both in the noise of a run and over the samples. Each combination has a
process of its own (`repose.calibrate.surrogates.process`).

Sources, named where they are used:

- (ANS10) Ankenman, Nelson & Staum 2010, Stochastic kriging for simulation metamodeling,
  Oper. Res. 58, 371
- (S04) Smyth 2004, Stat. Appl. Genet. Mol. Biol. 3, 3: a sample's own variance
  moderated by the variance of all samples
- (R06) Rasmussen & Williams 2006, Gaussian processes for machine learning, section 2.7:
  explicit basis functions
- (H24) Hvarfner, Hellsten & Nardi 2024, Vanilla Bayesian optimization performs great in
  high dimensions: a prior of the lengths that grows with the number d of inputs. They
  use the mode of its density over the lengths, exp(sqrt(2) - 3) sqrt(d): half a range
  for six inputs. Here the logarithms of the lengths are drawn, and this mode is the
  middle of their prior. The median of the same density, ten ranges, would mean an
  almost linear simulator.
"""

import copy
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.samples import CombinedOutputs

PRIOR_DEGREES_OF_FREEDOM = 20.0  # prior degrees of freedom of the pooled variance (S04)
# Prior of the logarithm of a length (H24). Half the logarithm of d is added to the
# mean.
LENGTH_LOG_MEAN = math.sqrt(2) - 3
LENGTH_LOG_SD = math.sqrt(3)
# Prior standard deviation of the logarithm of a process's variance. The prior is
# centred on the variance of the means without noise.
VARIANCE_LOG_SD = 1.0
# Smallest variance without noise, as a fraction of the variance of the means. It is
# used where the noise seems to explain the whole variance.
MIN_SIGNAL = 0.1
# Smoothness of Matern's covariance, whose functions are twice differentiable. Smoother
# functions claim too much accuracy between few samples.
SMOOTHNESS = 2.5
N_DRAWS = 8  # number of draws of variance and lengths
DRAWS_SEED = 1
# Prior of the factor on the variance of each draw: median, and standard deviation of
# the logarithm. They come from campaigns in which the draws' variances were usually too
# large. The hidden sets of these campaigns are not those of
# research/docs/sequential_tests.md.
FACTOR_MEDIAN = 0.7
FACTOR_LOG_SD = 0.4
FACTORS = np.exp(np.linspace(-2, 2, 81))  # values over which the factor is averaged
DIFFERENCE_STEP = 1e-3  # step of the logarithms in the finite differences
# Bounds of the variance, in variances of the means, and of the lengths, in ranges.
HYPERPARAMETER_BOUNDS = (1e-3, 1e3)
# Noise, or a combination of the responses' noises, is a rounding error if its relative
# size is below this.
ROUNDING_FRACTION = 1e-9
MIN_SAMPLES = 2
# The work for an exact process grows with the cube of the number of samples. With more
# than MAX_EXACT_SAMPLES, variance and lengths are therefore estimated from a random
# subset of this size, and they are not drawn. The processes are conditioned on all
# samples by way of N_CENTRES of them. For 1,200 samples of four parameters with almost
# no noise, the predictions of 512 centres are as good as those of all samples, while
# those of 256 have 1.7 times the error.
MAX_EXACT_SAMPLES = 256
N_CENTRES = 512
SUBSET_SEED = 2


class ObservedSamples(NamedTuple):
    """The runs of n good samples as arrays, and the points of the failed samples.

    All points lie in the unit cube, in which each free parameter goes from 0 to 1.
    """

    unit_points: np.ndarray  # (n, d), the good samples
    # (n, runs, k), the responses; NaN for a missing run. Every sample has at least one
    # run with all responses.
    values: np.ndarray
    failed: np.ndarray = np.empty((0, 0))  # (f, d), the failed samples

    @property
    def simulated(self) -> np.ndarray:
        """All samples, (n + f, d)."""
        return np.vstack(
            [self.unit_points, self.failed.reshape(-1, self.unit_points.shape[1])]
        )

    @property
    def good(self) -> np.ndarray:
        """Mask (n, runs) that is true for the runs with all responses."""
        return np.isfinite(self.values).all(axis=2)

    @property
    def counts(self) -> np.ndarray:
        """Number of good runs of each sample, (n,)."""
        return self.good.sum(axis=1)

    @property
    def means(self) -> np.ndarray:
        """Mean of each sample, (n, k)."""
        sums = np.where(self.good[:, :, None], self.values, 0.0).sum(axis=1)
        return sums / self.counts[:, None]

    @property
    def residuals(self) -> np.ndarray:
        """Runs minus their sample's mean, (n, runs, k); 0 where there is no run."""
        return np.where(self.good[:, :, None], self.values - self.means[:, None], 0.0)

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of the noise: good runs minus samples."""
        return int(self.counts.sum() - len(self.unit_points))

    @property
    def equal_in_replicates(self) -> np.ndarray:
        """Mask (k,) of the responses that are equal in all runs of each sample.

        A difference as small as the rounding errors of the means does not count.
        """
        residuals = self.residuals.reshape(-1, self.values.shape[2])
        variances = np.diagonal(
            residuals.T @ residuals / max(self.degrees_of_freedom, 1)
        )
        sd = np.sqrt(variances)
        return sd <= ROUNDING_FRACTION * np.abs(self.means).max(axis=0)

    def avoids_failures(self, unit_points: np.ndarray) -> np.ndarray:
        """Mark points (m, d) at least as near to a good sample as to a failed one.

        The result is a mask (m,). Other points would probably fail as well.
        """
        from scipy.spatial.distance import cdist

        if not len(self.failed):
            return np.full(len(unit_points), True)
        to_failed = cdist(unit_points, self.failed).min(axis=1)
        to_good = cdist(unit_points, self.unit_points).min(axis=1)
        return to_failed >= to_good

    def estimate_noise(self) -> np.ndarray:
        """Estimate the covariance of a single run about the mean of its sample.

        This is the pooled covariance within the samples: it is assumed to be the same
        for all of them.

        Returns
        -------
        array (k, k)

        Raises
        ------
        ValueError
            If there are too few replicates (further runs of a sample), or if all runs
            of each sample are equal.
        """
        k = self.values.shape[2]
        # The residual of a missing run is 0, which does not change the sums.
        residuals = self.residuals.reshape(-1, k)
        # With fewer than k degrees of freedom, the covariance of k responses is
        # singular, and with k it may be almost so. `find_noise` has the same limit.
        if self.degrees_of_freedom <= k:
            raise ValueError(
                f"{self.degrees_of_freedom} runs beyond the first of each sample; "
                f"expected at least {k + 1}"
            )
        covariance = residuals.T @ residuals / self.degrees_of_freedom
        sd = np.sqrt(np.diagonal(covariance))
        if self.equal_in_replicates.any() or not _has_full_rank(
            covariance / np.outer(sd, sd)
        ):
            raise ValueError(
                "all runs of a sample gave the same responses; expected different seeds"
            )
        return covariance


def _has_full_rank(correlation: np.ndarray) -> bool:
    """Return whether a matrix of correlations (k, k) is positive definite."""
    return not np.linalg.eigvalsh(correlation)[0] < ROUNDING_FRACTION


class Kriging(CombinedOutputs):
    """Model of the mean responses over all parameters.

    The error of a sample's mean is known, not fitted (ANS10). A variance from few runs
    is a poor estimate, so it is averaged with the variance of all samples (S04).

    Each process has a linear part (R06). Without it, a process returns to its mean in
    the corners, where the largest and the smallest responses are. With few samples,
    variance and lengths are uncertain. They are therefore drawn `N_DRAWS` times from
    the normal approximation of their posterior, with the prior of (H24), and
    predictions come from the mixture.

    The variance of each draw is multiplied by one factor. To estimate it, each sample
    is predicted from all the others, and the factor compares these residuals with the
    variances of the draws, given the known errors of the means. With few samples or
    much noise the residuals tell little, and the factor stays near the median of its
    prior.

    Parameters
    ----------
    observed : ObservedSamples
        The samples with their runs.
    noise : array (k, k), optional
        Covariance of a single run; by default estimated from the replicates.

    Raises
    ------
    ValueError
        If there are too few replicates for the noise, or fewer than two samples.
    """

    centred_points: np.ndarray  # (n, d), points of the samples in the unit cube - 0.5
    noise: np.ndarray  # (k, k), covariance of a single run
    # (n, k), variance of the noise in the mean of each sample, for each combination.
    # The unit is that of `values`, the combinations scaled to variance 1.
    noise_variances: np.ndarray
    # A set has a process for each combination. There is a set for each draw of the
    # hyperparameters (variance and lengths), but only one with many samples.
    process_sets: list
    factor: float  # by which the variances that the processes predict are multiplied

    def __init__(
        self, observed: ObservedSamples, noise: np.ndarray | None = None
    ) -> None:
        """Fit processes to combinations of the responses.

        Also estimate the factor by which the variances of the processes are multiplied.

        Parameters
        ----------
        observed : ObservedSamples
            The samples with their runs.
        noise : array (k, k), optional
            Covariance of a single run. None estimates it from the replicates.
        """
        n_samples = len(observed.unit_points)
        if n_samples < MIN_SAMPLES:
            raise ValueError(f"{n_samples} samples; expected at least {MIN_SAMPLES}")
        self.noise = observed.estimate_noise() if noise is None else noise
        # Model independent combinations of the responses, scaled to variance 1.
        # `_combine` sets `values`, `_mixing` and `_scale`, which are used below.
        combinations = _find_independent_combinations(observed, self.noise)
        self._combine(observed.means, combinations)
        mean_variances = _estimate_mean_variances(observed, self._mixing)
        self.noise_variances = mean_variances / self._scale**2
        # The linear part of a process is most certain at the origin, so put it at the
        # centre of the cube.
        self.centred_points = observed.unit_points - 0.5

        # Make the processes of each combination: one for each draw of hyperparameters,
        # or a single sparse one if there are many samples. Then group them by draw.
        if n_samples > MAX_EXACT_SAMPLES:
            make_processes = _make_sparse_process
        else:
            make_processes = _draw_processes
        processes_of_combinations = [
            make_processes(self.centred_points, values, noise_variances)
            for values, noise_variances in zip(
                self.values.T, self.noise_variances.T, strict=True
            )
        ]
        self.process_sets = list(zip(*processes_of_combinations, strict=True))

        # Estimate the factor: compare the errors at left-out samples with the variances
        # that the processes predict there.
        residuals, variances, other_variances = self._predict_left_out()
        self.factor = _estimate_factor(residuals, variances, other_variances)

    def refit(self, means: np.ndarray) -> "Kriging":
        """Return a copy that is conditioned on other means (n, k) of its samples.

        The combinations of the responses, the hyperparameters of the processes and the
        factor stay the same.
        """
        refitted = copy.copy(self)
        refitted.values = (means @ self._mixing - self._middle) / self._scale
        refitted.process_sets = []
        for processes in self.process_sets:
            copies = [copy.copy(process) for process in processes]
            for process, values in zip(copies, refitted.values.T, strict=True):
                process.values = values
                process.weights = process.compute_weights(values)
            refitted.process_sets.append(copies)
        return refitted

    def predict(self, unit_points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predict mean responses at points of the unit cube.

        Parameters
        ----------
        unit_points : array (m, d)
            Points of the unit cube.

        Returns
        -------
        mean : array (m, k)
            Predicted means.
        covariance : array (m, k, k)
            Covariance of the mean, without the noise of a run.
        """
        means, variances = self._collect_moments(
            lambda process: process.moments(unit_points - 0.5)
        )
        # The draws are a mixture. Its covariance is the mean covariance within the
        # draws plus the covariance of the means of the draws.
        within = self._covariance(self.factor * variances.mean(axis=0))
        deviations = (means - means.mean(axis=0)) * self._scale @ self._unmixing
        between = np.einsum("smi,smj->mij", deviations, deviations) / len(deviations)
        return self.unmix(means.mean(axis=0)), within + between

    def mean(self, unit_points: np.ndarray) -> np.ndarray:
        """Predict mean responses (m, k) like `predict`, but in far less time."""
        means = np.array(
            [
                [process.mean(unit_points - 0.5) for process in processes]
                for processes in self.process_sets
            ]
        )
        return self.unmix(means.transpose(0, 2, 1).mean(axis=0))

    def _predict_left_out(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Predict each sample from all the others.

        Returns
        -------
        residuals : array (n, k)
            Residuals of the scaled combinations.
        variances : array (n, k)
            Variances within the draws.
        others : array (n, k)
            Other variances: that between the draws, and that of the samples' errors.
        """
        means, variances = self._collect_moments(
            lambda process: process.predict_left_out()
        )
        residuals = self.values - means.mean(axis=0)
        others = means.var(axis=0) + self.noise_variances
        return residuals, variances.mean(axis=0), others

    def _collect_moments(
        self, predict: Callable[[Any], Any]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Collect means and variances (draws, m, k) that all processes predict.

        `predict` takes a process, and returns its means and variances (m,).
        """
        moments = np.array(
            [
                [predict(process) for process in processes]
                for processes in self.process_sets
            ]
        )
        means, variances = moments.transpose(2, 0, 3, 1)
        return means, variances


class SpaceKriging:
    """A kriging model for parameter sets, with the methods of a surrogate.

    See `repose.calibrate.surrogates.base.Predictor`.
    """

    name = "kriging"

    def __init__(self, model: Kriging, space: ParameterSpace) -> None:
        self.model = model
        self.space = space

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        """Predict mean responses (n, k), with standard deviations on request.

        The options are those of `repose.calibrate.surrogates.base.Surrogate.predict`.
        """
        if not return_std:
            return self.model.mean(self.space.unit(np.asarray(X, dtype=float)))
        mean, covariance = self.moments(X)
        variances = np.diagonal(covariance + noise * self.model.noise, axis1=1, axis2=2)
        return mean, np.sqrt(variances)

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (n, k, k) of the predicted means."""
        _, covariance = self.moments(X)
        return covariance

    def moments(self, X: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Predict mean responses (n, k) and their covariance (n, k, k) at once."""
        return self.model.predict(self.space.unit(np.asarray(X, dtype=float)))


def _find_independent_combinations(
    observed: ObservedSamples, noise: np.ndarray
) -> np.ndarray:
    """Find combinations of the responses that are independent.

    The noise of each combination has variance 1 and is independent of the others', and
    the means of the samples are uncorrelated.

    Returns
    -------
    array (k, k)
        Its columns are the combinations.
    """
    whitening = np.linalg.inv(np.linalg.cholesky(noise)).T
    spread = np.cov((observed.means @ whitening).T, aweights=observed.counts)
    _, axes = np.linalg.eigh(np.atleast_2d(spread))
    return whitening @ axes


def _estimate_mean_variances(
    observed: ObservedSamples, mixing: np.ndarray
) -> np.ndarray:
    """Estimate the variances (n, k) of the samples' means in each combination (S04).

    The columns of `mixing` are the combinations. In each of them, the noise of all
    samples has the variance 1. This value counts as much as `PRIOR_DEGREES_OF_FREEDOM`
    degrees of freedom, in addition to those of the sample itself.
    """
    squares = ((observed.residuals @ mixing) ** 2).sum(axis=1)
    counts = observed.counts[:, None]
    return (
        (PRIOR_DEGREES_OF_FREEDOM + squares)
        / (PRIOR_DEGREES_OF_FREEDOM + counts - 1)
        / counts
    )


def _estimate_factor(
    residuals: np.ndarray, variances: np.ndarray, others: np.ndarray
) -> float:
    """Estimate the factor on the variances of the draws from residuals.

    The residuals are normal with the variance factor * variances + others. The estimate
    is the geometric mean of the factor over its posterior.

    Parameters
    ----------
    residuals, variances, others : array (n, k)
        Results of `Kriging._predict_left_out`.
    """
    total = FACTORS[:, None, None] * variances + others
    log_likelihood = -0.5 * (np.log(total) + residuals**2 / total).sum(axis=(1, 2))
    log_prior = -0.5 * (np.log(FACTORS / FACTOR_MEDIAN) / FACTOR_LOG_SD) ** 2
    log_posterior = log_likelihood + log_prior
    weight = np.exp(log_posterior - log_posterior.max())
    return float(np.exp(weight @ np.log(FACTORS) / weight.sum()))


class _PosteriorOptimiser:
    """Optimiser for scikit-learn: the most probable hyperparameters under a prior.

    The hyperparameters theta (1 + d,) are the logarithms of variance and lengths.

    Parameters
    ----------
    mean, sd : array (1 + d,)
        Mean and standard deviation of the normal prior of theta.

    Attributes
    ----------
    curvature : array (1 + d, 1 + d)
        Second derivatives of the negative log posterior at the result.
    """

    def __init__(self, mean: np.ndarray, sd: np.ndarray) -> None:
        self.mean = mean
        self.sd = sd
        self.curvature = np.empty((len(mean), len(mean)))

    def __call__(
        self, objective: Callable, start: np.ndarray, bounds: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Find the most probable hyperparameters theta.

        scikit-learn calls this method. The attribute `curvature` is changed in place,
        because scikit-learn takes only the two results.

        Parameters
        ----------
        objective : callable
            Function of theta that returns the negative log likelihood and its gradient.
        start : array (1 + d,)
            Theta where the search starts.
        bounds : array (1 + d, 2)
            Lowest and highest value of each component of theta.

        Returns
        -------
        array (1 + d,)
            The most probable theta.
        float
            The negative log posterior at this point.
        """
        from scipy import optimize

        def loss(theta: np.ndarray) -> tuple[float, np.ndarray]:
            """Compute the negative log posterior of theta and its gradient."""
            value, gradient = objective(theta)
            # The normal prior adds a term to both.
            z = (theta - self.mean) / self.sd
            return value + 0.5 * z @ z, gradient + z / self.sd

        result = optimize.minimize(
            loss, start, jac=True, method="L-BFGS-B", bounds=bounds
        )
        # Compute the second derivatives at the minimum, as central differences of the
        # gradient. Rounding makes the matrix slightly asymmetric, which
        # `_draw_hyperparameters` corrects.
        for k, step in enumerate(DIFFERENCE_STEP * np.eye(len(start))):
            _, gradient_above = loss(result.x + step)
            _, gradient_below = loss(result.x - step)
            self.curvature[k] = (gradient_above - gradient_below) / (
                2 * DIFFERENCE_STEP
            )
        return result.x, result.fun


def _draw_processes(
    centred_points: np.ndarray, values: np.ndarray, noise_variances: np.ndarray
) -> list[Any]:
    """Draw Gaussian processes that differ in their hyperparameters.

    All of them model the same combination of the responses, a weighted sum. A process
    is the sum of a linear part with a fixed covariance and a smooth part. The variance
    and the lengths of the smooth part are drawn from their posterior.

    Parameters
    ----------
    centred_points : array (n, d)
        The samples in the unit cube, minus 0.5.
    values : array (n,)
        Mean of the combination at each sample, scaled so that the variance over the
        samples is 1.
    noise_variances : array (n,)
        Variance of the noise in each of these means.

    Returns
    -------
    list of Process
    """
    from repose.calibrate.surrogates.process import Process

    best, curvature = _find_most_probable_kernel(
        centred_points, values, noise_variances
    )
    # Condition a process on the samples for each draw of the hyperparameters.
    processes = []
    for theta in _draw_hyperparameters(best.theta, curvature):
        kernel_of_draw = best.clone_with_theta(theta)
        processes.append(
            Process(
                kernel_of_draw, centred_points, values, noise_variances, optimizer=None
            )
        )
    return processes


def _make_sparse_process(
    centred_points: np.ndarray, values: np.ndarray, noise_variances: np.ndarray
) -> list[Any]:
    """Make the process with the most probable hyperparameters, for many samples.

    Many samples determine the variance and the lengths so well that these are not
    drawn.

    Parameters
    ----------
    centred_points, values, noise_variances
        See `_draw_processes`.

    Returns
    -------
    list of SparseProcess
        A single process.
    """
    from repose.calibrate.surrogates.process import SparseProcess, choose_centres

    rows = draw_subset(len(centred_points))
    kernel, _ = _find_most_probable_kernel(
        centred_points[rows], values[rows], noise_variances[rows]
    )
    centres = centred_points[choose_centres(kernel, centred_points, N_CENTRES)]
    return [SparseProcess(kernel, centred_points, values, noise_variances, centres)]


def draw_subset(n_samples: int) -> np.ndarray:
    """Draw the row numbers of a random subset of `MAX_EXACT_SAMPLES` samples.

    The same number of samples always gives the same rows.
    """
    random = np.random.default_rng(SUBSET_SEED)
    return np.sort(random.permutation(n_samples)[:MAX_EXACT_SAMPLES])


def _find_most_probable_kernel(
    centred_points: np.ndarray, values: np.ndarray, noise_variances: np.ndarray
) -> tuple[Any, np.ndarray]:
    """Find the covariance of a process with its most probable hyperparameters.

    Parameters
    ----------
    centred_points, values, noise_variances
        See `_draw_processes`.

    Returns
    -------
    kernel of scikit-learn
        The covariance with these hyperparameters.
    array (1 + d, 1 + d)
        Second derivatives of the negative log posterior at these hyperparameters.
    """
    from repose.calibrate.surrogates.process import (
        Process,
        make_linear_kernel,
        make_smooth_kernel,
    )

    # Start at the centre of the prior. The means have the variance 1, which is the sum
    # of the variances of the signal and of the noise. The distance of two points grows
    # with sqrt(d), so the prior of the lengths does, too (H24).
    d = centred_points.shape[1]
    log_length = LENGTH_LOG_MEAN + 0.5 * math.log(d)
    signal = max(1 - noise_variances.mean(), MIN_SIGNAL)
    # A coordinate of a point is uniform over a width of 1, so its variance is 1/12.
    # With this slope, the linear part has a prior variance of 1, like the means.
    slope = math.sqrt(12 / d)
    lengths = np.full(d, math.exp(log_length))
    kernel = make_linear_kernel(slope) + make_smooth_kernel(
        signal, lengths, (HYPERPARAMETER_BOUNDS, HYPERPARAMETER_BOUNDS), SMOOTHNESS
    )

    # Find the most probable hyperparameters. Making the process runs the optimiser,
    # which stores the second derivatives in its attribute `curvature`.
    optimiser = _PosteriorOptimiser(
        mean=np.array([math.log(signal)] + [log_length] * d),
        sd=np.array([VARIANCE_LOG_SD] + [LENGTH_LOG_SD] * d),
    )
    best = Process(
        kernel, centred_points, values, noise_variances, optimizer=optimiser
    ).kernel
    return best, optimiser.curvature


def _draw_hyperparameters(
    middle: np.ndarray, curvature: np.ndarray
) -> list[np.ndarray]:
    """Draw hyperparameters from the normal approximation of their posterior.

    The draws are pairs of opposite deviations from the most probable values. They are
    clipped to `HYPERPARAMETER_BOUNDS`.

    Parameters
    ----------
    middle : array (1 + d,)
        The most probable values.
    curvature : array (1 + d, 1 + d)
        The inverse of their covariance.

    Returns
    -------
    list of array (1 + d,)
        `N_DRAWS` of them.
    """
    # In every direction, keep the posterior at least as certain as the prior of a
    # length.
    eigenvalues, axes = np.linalg.eigh((curvature + curvature.T) / 2)
    root = axes / np.sqrt(np.maximum(eigenvalues, LENGTH_LOG_SD**-2))
    random = np.random.default_rng(DRAWS_SEED)
    normal = random.standard_normal((N_DRAWS // 2, len(middle)))
    low, high = np.log(HYPERPARAMETER_BOUNDS)
    return [np.clip(middle + root @ z, low, high) for z in np.vstack([normal, -normal])]
