"""Estimate from a few runs how probably their true means meet the targets.

Given a few runs, the true mean has Student's t distribution.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from repose.calibrate.targets import Target, Targets

# Tolerances in percent of the aims, for which every answer reports a probability.
REPORTED_PERCENTS = (1.0, 2.0)
# The standard error of an estimated probability is at most 0.5 / sqrt(N_DRAWS) =
# 0.0011.
N_DRAWS = 200_000
SEED = 2026  # fixed, so that the same runs always give the same probabilities
# Runs of a parameter set by bench test.
RunsByBench = Mapping[str, Sequence[Mapping[str, Any]]]


def compute_target_probabilities(
    runs: RunsByBench, targets: Targets, percent: float | None = None
) -> dict[str, float | None]:
    """Compute how probably the true means of the simulator meet the targets.

    Given n runs and no prior knowledge, the true mean has a multivariate t distribution
    about the mean of the runs, with n - 1 degrees of freedom. Because the responses of
    a bench test are correlated, the probabilities are estimated from random draws.

    Parameters
    ----------
    runs : mapping
        Runs of a parameter set by bench test.
    targets : Targets
        The targets of the study.
    percent : float, optional
        Tolerance in percent of the aims, the values that the search tries to reach. By
        default, a mean must lie inside the range of its target.

    Returns
    -------
    dict
        A probability for each target, and one for the key `all`, that they are all met.
        If a bench test has fewer than two good runs, the probabilities of its targets
        and of `all` are None. So are the probabilities of the targets of all later
        bench tests, because the calculation stops there.
    """
    rng = np.random.default_rng(SEED)
    probabilities: dict[str, float | None] = dict.fromkeys((*targets.names, "all"))
    # Bench tests are independent, so their means are drawn separately. A draw meets all
    # targets if it meets the targets of every bench test.
    meets_all = np.ones(N_DRAWS, dtype=bool)
    for bench_test in targets.apparatus:
        bench_targets = [
            target for target in targets if target.response.apparatus == bench_test
        ]
        # Collect the responses of the good runs in this bench test.
        rows = [
            [run[target.name] for target in bench_targets]
            for run in runs.get(bench_test, ())
            if run["status"] == "ok"
        ]
        # A single run does not show the scatter. The remaining probabilities, `all`
        # among them, stay None.
        if len(rows) < 2:
            return probabilities

        # Each draw is a possible true mean. The probability of a target is the fraction
        # of the draws that meet it.
        means = _draw_means(np.array(rows, dtype=float), rng)
        for mean, target in zip(means.T, bench_targets, strict=True):
            low, high = _find_accepted_range(target, percent)
            meets_target = (mean >= low) & (mean <= high)
            probabilities[target.name] = float(meets_target.mean())
            meets_all &= meets_target
    probabilities["all"] = float(meets_all.mean())
    return probabilities


def _find_accepted_range(target: Target, percent: float | None) -> tuple[float, float]:
    """Return the lowest and the highest mean that meets a target.

    Without `percent`, these are the ends of the range of the target. Otherwise, they
    lie `percent` of the aim below and above the aim. For the score of a profile, the
    percentage refers to `Profile.whole` instead.
    """
    if percent is None:
        return target.low, target.high
    tolerance = percent / 100 * target.whole
    return target.aim - tolerance, target.aim + tolerance


def compute_range_probability(
    mean: float, standard_error: float, runs: int, low: float, high: float
) -> float:
    """Compute how probably the true mean of one response lies in a range.

    The true mean has Student's t distribution about the mean of the runs.
    `compute_target_probabilities` uses the same distribution for several responses.

    Parameters
    ----------
    mean : float
        Mean of the runs.
    standard_error : float
        Standard error of this mean.
    runs : int
        Number of the runs, at least two.
    low, high : float
        Ends of the range.
    """
    from scipy.special import stdtr  # the distribution function of Student's t

    if standard_error == 0:
        return float(low <= mean <= high)
    below_high = stdtr(runs - 1, (high - mean) / standard_error)
    below_low = stdtr(runs - 1, (low - mean) / standard_error)
    return float(below_high - below_low)


def _draw_means(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw possible true means of the responses, given their values in a few runs.

    The draws have a multivariate t distribution with n - 1 degrees of freedom. Such a
    vector is a normal vector, divided by sqrt(c / (n - 1)), where c is a chi-square
    number with n - 1 degrees of freedom.

    Parameters
    ----------
    values : numpy.ndarray, (n, k)
        The k responses in each of at least two runs.
    rng : numpy.random.Generator
        Source of the random numbers. First the normal and then the chi-square numbers
        are drawn; another order would change the published probabilities.

    Returns
    -------
    numpy.ndarray, (N_DRAWS, k)
    """
    n, k = values.shape
    covariance_of_mean = np.cov(values, rowvar=False).reshape(k, k) / n
    # Factorise the covariance by its eigenvalues, because it has no Cholesky factor if
    # it is singular. Rounding may make an eigenvalue slightly negative.
    eigenvalues, eigenvectors = np.linalg.eigh(covariance_of_mean)
    factor = eigenvectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    normal = rng.normal(size=(N_DRAWS, k)) @ factor.T
    chi_square = rng.chisquare(n - 1, size=(N_DRAWS, 1))
    return values.mean(axis=0) + normal / np.sqrt(chi_square / (n - 1))
