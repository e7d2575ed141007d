"""Estimate the variance of a response within samples (noise) and between them.

A response of run j of sample i is y_ij = mu + a_i + e_ij, with variance tau^2 between
samples and sigma^2 within one. Both come from the unbalanced one-way analysis of
variance, since a run that failed leaves a sample with fewer values than others.

References
----------
(SCM92) Searle, Casella & McCulloch 1992, Variance Components, section 3.6: unbalanced
data. (TH78) Thomas & Hultquist 1978, Annals of Statistics 6, 582: interval from
unweighted means.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

# Confidence of every interval.
CONFIDENCE = 0.95
# Probability on each side of an interval.
TAIL_PROBABILITY = (1 - CONFIDENCE) / 2
# Smallest number of degrees of freedom for the interval of a correlation.
MIN_DEGREES_OF_FREEDOM = 4
# A correlation is moved this far away from 1, where Fisher's transformation is
# infinite.
MIN_DISTANCE_FROM_ONE = 1e-12
# Relative error of a quotient that is accepted as rounding.
ROUNDING_ERROR = 1e-12


class Components(NamedTuple):
    """Variance components of one response.

    The variances are in the squared unit of the response. The intervals have the
    probability `CONFIDENCE`.

    Attributes
    ----------
    n_groups, n_values : int
        Number of samples, and of runs.
    mean : float
        Mean of all runs.
    within, within_low, within_high : float
        sigma^2, with its interval.
    between : float
        tau^2.
    icc, icc_low, icc_high : float
        Intraclass correlation tau^2 / (tau^2 + sigma^2), with its interval.
    harmonic_seeds : float
        Harmonic mean of the numbers of runs per sample.
    """

    n_groups: int
    n_values: int
    mean: float
    within: float
    within_low: float
    within_high: float
    between: float
    icc: float
    icc_low: float
    icc_high: float
    harmonic_seeds: float

    def reachable_r2(self, seeds: ArrayLike) -> np.ndarray:
        """Compute the R2 of a perfect predictor for means over several seeds.

        The predictor knows the true means.

        It is tau^2 / (tau^2 + sigma^2 / seeds), or 0 if both variances are 0.
        """
        total = self.between + self.within / np.asarray(seeds)
        return np.where(total > 0, self.between / np.where(total > 0, total, 1.0), 0.0)

    def standard_error(self, seeds: ArrayLike) -> np.ndarray:
        """Compute the standard error of the mean of a sample over seeds."""
        return np.sqrt(self.within / np.asarray(seeds))

    def seeds_for(self, standard_error: float) -> int:
        """Find the smallest number of seeds for a given standard error of a mean.

        The error is in the unit of the response. A ValueError is raised if it is not
        above 0.
        """
        if not standard_error > 0:
            raise ValueError(f"standard_error is {standard_error!r}; expected above 0")
        # Do not round up a quotient that only rounding errors raise above a whole
        # number.
        return max(1, math.ceil(self.within / standard_error**2 * (1 - ROUNDING_ERROR)))


def variance_components(values: ArrayLike, groups: ArrayLike) -> Components:
    """Estimate the variance components of a response from the runs of several samples.

    The runs of a sample form a group of this analysis of variance. The variance within
    groups, sigma^2, is the mean square within the groups (MSW). Its interval comes from
    a chi^2 distribution. The variance between groups, tau^2, is (MSB - MSW) / n0
    (SCM92), or 0 if this is negative. MSB is the mean square between the groups, and n0
    is their size, or a kind of mean size if the sizes differ.

    The interval of the intraclass correlation uses F = h S^2 / MSW (TH78), where S^2 is
    the variance of the means of the groups and h is the harmonic mean of their sizes.
    It is exact if all groups have the same size.

    Parameters
    ----------
    values : array_like, (n,)
        The response of each run.
    groups : array_like, (n,)
        The sample of each run.

    Returns
    -------
    Components

    Raises
    ------
    ValueError
        If there are fewer than two samples, or if no sample has two runs.
    """
    values, groups = _check_arrays(values, groups)
    group_of_value, group_size, group_mean = _group_values(values, groups)
    n_groups = len(group_size)
    n = len(values)
    if n_groups < 2 or n == n_groups:
        raise ValueError(
            f"{n} values in {n_groups} groups; expected at least two groups, one of them "
            "with two values"
        )

    # Compute the mean squares within and between the groups (MSW, MSB).
    degrees_of_freedom = n - n_groups
    residuals = values - group_mean[group_of_value]
    within = float(residuals @ residuals / degrees_of_freedom)
    mean_square_between = float(
        group_size @ (group_mean - values.mean()) ** 2 / (n_groups - 1)
    )

    # Estimate the variance of the true means of the groups (SCM92).
    n0 = (n - (group_size**2).sum() / n) / (n_groups - 1)
    between = max(0.0, (mean_square_between - within) / n0)
    total = between + within
    harmonic_size = n_groups / (1 / group_size).sum()
    within_interval = _compute_within_interval(within, degrees_of_freedom)
    icc_interval = _compute_icc_interval(
        within, degrees_of_freedom, group_mean, harmonic_size
    )
    return Components(
        n_groups=n_groups,
        n_values=n,
        mean=float(values.mean()),
        within=within,
        within_low=within_interval.low,
        within_high=within_interval.high,
        between=between,
        icc=between / total if total > 0 else 0.0,
        icc_low=icc_interval.low,
        icc_high=icc_interval.high,
        harmonic_seeds=float(harmonic_size),
    )


class _Interval(NamedTuple):
    """An interval of probability `CONFIDENCE`."""

    low: float
    high: float


def _compute_within_interval(within: float, degrees_of_freedom: int) -> _Interval:
    """Compute the interval of sigma^2, from its estimate and degrees of freedom.

    The estimate times the degrees of freedom, over sigma^2, has a chi^2 distribution.
    """
    from scipy import stats  # takes half a second, so not at the start of the program

    def compute_end(probability: float) -> float:
        return float(
            within
            * degrees_of_freedom
            / stats.chi2.ppf(probability, degrees_of_freedom)
        )

    # The larger quantile gives the lower end, because it is a divisor.
    return _Interval(
        low=compute_end(1 - TAIL_PROBABILITY), high=compute_end(TAIL_PROBABILITY)
    )


def _compute_icc_interval(
    within: float, degrees_of_freedom: int, mean: np.ndarray, harmonic_size: float
) -> _Interval:
    """Compute the interval of the intraclass correlation (ICC).

    The interval follows from that of theta = tau^2 / sigma^2 (Thomas & Hultquist 1978).
    Let h be the harmonic mean of the sizes of the groups. Then theta lies between
    (F / F_upper - 1) / h and (F / F_lower - 1) / h. F is the ratio of the mean squares
    between and within the groups, and F_lower and F_upper are quantiles of its
    distribution.

    Parameters
    ----------
    within : float
        Estimate of sigma^2, the mean square within the groups.
    degrees_of_freedom : int
        Its degrees of freedom.
    mean : numpy.ndarray, (k,)
        Mean of each group.
    harmonic_size : float
        Harmonic mean of the sizes of the groups.
    """
    from scipy import stats  # takes half a second, so not at the start of the program

    mean_square_between = harmonic_size * mean.var(ddof=1)

    def compute_end(probability: float) -> float:
        """Compute an end of the interval, from the quantile of F at a probability."""
        F_quantile = stats.f.ppf(probability, len(mean) - 1, degrees_of_freedom)
        # F / F_quantile. It is infinite if the runs of each group are equal.
        ratio = _divide(mean_square_between, within * F_quantile)
        return _convert_to_icc((ratio - 1) / harmonic_size)

    # The larger quantile gives the lower end, because it is a divisor.
    return _Interval(
        low=compute_end(1 - TAIL_PROBABILITY), high=compute_end(TAIL_PROBABILITY)
    )


def _check_arrays(
    values: ArrayLike, groups: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Return values and groups as arrays.

    Raises
    ------
    ValueError
        If the shapes differ, or if a value is not finite.
    """
    values, groups = np.asarray(values, dtype=float), np.asarray(groups)
    if values.ndim != 1 or values.shape != groups.shape:
        raise ValueError(
            f"values has shape {values.shape}, groups {groups.shape}; expected (n,) both"
        )
    if not np.isfinite(values).all():
        raise ValueError("values must be finite")
    return values, groups


def estimate_within_covariance(
    values: ArrayLike, groups: ArrayLike
) -> tuple[np.ndarray, int]:
    """Estimate the covariance of responses about the means of their samples.

    Parameters
    ----------
    values : array_like, (n, k)
        The responses of each run.
    groups : array_like, (n,)
        The sample of each run.

    Returns
    -------
    numpy.ndarray, (k, k)
        The covariance; zero if no sample has two runs.
    int
        Degrees of freedom: runs minus samples.
    """
    values = np.asarray(values, dtype=float)
    # Subtract from each run the mean of its sample, for one response after the other.
    residuals = np.empty_like(values)
    for j, column in enumerate(values.T):
        by_group = _group_values(column, groups)
        residuals[:, j] = column - by_group.mean[by_group.number]
    n_groups = len(np.unique(groups))
    degrees_of_freedom = len(values) - n_groups
    # Without degrees of freedom, the residuals are 0. Avoid 0 / 0.
    covariance = residuals.T @ residuals / max(degrees_of_freedom, 1)
    return covariance, degrees_of_freedom


class Correlation(NamedTuple):
    """Correlation of two responses, with its interval of probability `CONFIDENCE`."""

    value: float
    low: float
    high: float
    degrees_of_freedom: int


def estimate_residual_correlation(
    first: ArrayLike, second: ArrayLike, groups: ArrayLike
) -> Correlation:
    """Estimate the correlation of two responses between runs of the same sample.

    It is the correlation of the residuals, the deviations of the runs from the means of
    their samples. Its interval is computed by Fisher's transformation.

    Parameters
    ----------
    first, second : array_like, (n,)
        The responses of each run.
    groups : array_like, (n,)
        The sample of each run.

    Returns
    -------
    Correlation

    Raises
    ------
    ValueError
        If there are too few degrees of freedom, or if a response does not vary.
    """
    from scipy import stats  # takes half a second, so not at the start of the program

    covariance, degrees_of_freedom = estimate_within_covariance(
        np.column_stack([first, second]), groups
    )
    if degrees_of_freedom < MIN_DEGREES_OF_FREEDOM:
        raise ValueError(
            f"{degrees_of_freedom} degrees of freedom within samples; "
            f"expected at least {MIN_DEGREES_OF_FREEDOM}"
        )
    if not (np.diagonal(covariance) > 0).all():
        raise ValueError(
            "a response does not vary within samples; expected a response that varies"
        )
    variance_product = covariance[0, 0] * covariance[1, 1]
    correlation = float(covariance[0, 1] / math.sqrt(variance_product))
    # Fisher's transformation atanh(correlation) has the variance 1 / (n - 3) for n
    # pairs about a common mean. These have n - 1 degrees of freedom, so the variance is
    # 1 / (degrees of freedom - 2). `MIN_DEGREES_OF_FREEDOM` keeps this positive.
    half_width = stats.norm.ppf(0.5 + CONFIDENCE / 2) / math.sqrt(
        degrees_of_freedom - 2
    )
    # Stay away from 1, where the transformation is infinite.
    limit = 1 - MIN_DISTANCE_FROM_ONE
    centre = math.atanh(min(max(correlation, -limit), limit))
    return Correlation(
        value=correlation,
        low=math.tanh(centre - half_width),
        high=math.tanh(centre + half_width),
        degrees_of_freedom=degrees_of_freedom,
    )


class _Groups(NamedTuple):
    """Values by group."""

    number: np.ndarray  # (n,), the group of each value
    size: np.ndarray  # (k,), number of values of each group
    mean: np.ndarray  # (k,)


def _group_values(values: np.ndarray, groups: ArrayLike) -> _Groups:
    """Group values (n,) by their groups (n,)."""
    _, number = np.unique(groups, return_inverse=True)
    size = np.bincount(number).astype(float)
    mean = np.bincount(number, weights=values) / size
    return _Groups(number, size, mean)


def _divide(a: float, b: float) -> float:
    """Divide two variances; the result is infinite if the second one is 0."""
    return a / b if b > 0 else math.inf


def _convert_to_icc(theta: float) -> float:
    """Turn theta = tau^2 / sigma^2 into the intraclass correlation, from 0 to 1."""
    if theta == math.inf:
        return 1.0
    theta = max(0.0, theta)
    return float(theta / (1 + theta))
