"""Variance between and within samples: how far runs of one sample scatter, how far samples differ.

A response of run j of sample i is y_ij = mu + a_i + e_ij, with variance tau^2 between samples and sigma^2 within
one. Both come from the unbalanced one-way analysis of variance: a run that failed leaves a sample with fewer values
than others.

References
----------
(SCM92) Searle, Casella & McCulloch 1992, Variance Components, section 3.6: unbalanced data.
(TH78) Thomas & Hultquist 1978, Annals of Statistics 6, 582: interval from unweighted means.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

CONFIDENCE = 0.95  # of every interval


class Components(NamedTuple):
    """Variance of one response; variances in its unit squared, intervals at CONFIDENCE."""

    groups: int  # number of samples
    values: int  # number of runs
    mean: float  # of all runs
    within: float  # sigma^2
    within_low: float
    within_high: float
    between: float  # tau^2
    icc: float  # intraclass correlation tau^2 / (tau^2 + sigma^2)
    icc_low: float
    icc_high: float
    harmonic_seeds: float  # harmonic mean of the runs of a sample

    def reachable_r2(self, seeds: ArrayLike) -> np.ndarray:
        """Compute the highest possible R2 on means over seeds, by the true means: tau^2 / (tau^2 + sigma^2 / seeds)."""
        total = self.between + self.within / np.asarray(seeds)
        return np.where(total > 0, self.between / np.where(total > 0, total, 1.0), 0.0)

    def standard_error(self, seeds: ArrayLike) -> np.ndarray:
        """Compute the standard error of a sample's mean over seeds, in the response's unit."""
        return np.sqrt(self.within / np.asarray(seeds))

    def seeds_for(self, standard_error: float) -> int:
        """Find the fewest seeds for a standard error of a sample's mean, above 0, in the response's unit."""
        if not standard_error > 0:
            raise ValueError(f"standard_error is {standard_error!r}; expected above 0")
        return max(1, math.ceil(self.within / standard_error**2 * (1 - 1e-12)))


def variance_components(values: ArrayLike, groups: ArrayLike) -> Components:
    """Estimate the variance components of a response (n,) from the runs of several samples `groups` (n,).

    tau^2 is (MSB - MSW) / n0 (SCM92), or 0 if that is negative. The interval of sigma^2 comes from chi^2. The interval
    of the intraclass correlation is in (TH78): F = h S^2 / MSW, with S^2 the variance of the groups' means and h the
    harmonic mean of their sizes. It is exact when all groups have the same size.
    """
    from scipy import stats  # half a second at start-up

    values, groups = np.asarray(values, dtype=float), np.asarray(groups)
    if values.ndim != 1 or values.shape != groups.shape:
        raise ValueError(
            f"values has shape {values.shape}, groups {groups.shape}; expected (n,) both"
        )
    if not np.isfinite(values).all():
        raise ValueError("values must be finite")
    number, size, mean = _groups(values, groups)
    k, n = len(size), len(values)
    if k < 2 or n == k:
        raise ValueError(
            f"{n} values in {k} groups; expected at least two groups, one of them with two values"
        )
    residuals = values - mean[number]
    within = float(residuals @ residuals / (n - k))  # MSW
    between_square = float(size @ (mean - values.mean()) ** 2 / (k - 1))  # MSB
    n0 = (n - (size**2).sum() / n) / (k - 1)  # (SCM92)
    between = max(0.0, (between_square - within) / n0)

    tail = (1 - CONFIDENCE) / 2
    h = k / (1 / size).sum()
    spread = h * mean.var(ddof=1)
    # theta = tau^2 / sigma^2 between (F / F_upper - 1) / h and (F / F_lower - 1) / h  (TH78)
    icc_low, icc_high = (
        _share((_ratio(spread, within * stats.f.ppf(q, k - 1, n - k)) - 1) / h)
        for q in (1 - tail, tail)
    )
    low, high = (
        float(within * (n - k) / stats.chi2.ppf(q, n - k)) for q in (1 - tail, tail)
    )
    total = between + within
    icc = between / total if total > 0 else 0.0
    return Components(
        k,
        n,
        float(values.mean()),
        within,
        low,
        high,
        between,
        icc,
        icc_low,
        icc_high,
        float(h),
    )


def within_covariance(values: ArrayLike, groups: ArrayLike) -> tuple[np.ndarray, int]:
    """Estimate covariance (k, k) and degrees of freedom of responses (n, k) about the means of samples `groups` (n,).

    The degrees of freedom are runs minus samples; the covariance is zero if no sample has two runs.
    """
    values = np.asarray(values, dtype=float)
    residuals = np.empty_like(values)
    for k, column in enumerate(values.T):
        number, size, mean = _groups(column, groups)
        residuals[:, k] = column - mean[number]
    freedom = len(values) - len(size)
    return residuals.T @ residuals / max(freedom, 1), freedom


def residual_correlation(
    first: ArrayLike, second: ArrayLike, groups: ArrayLike
) -> tuple[float, float, float, int]:
    """Correlate two responses (n,) within samples, with interval (Fisher's transformation) and degrees of freedom."""
    from scipy import stats  # half a second at start-up

    covariance, freedom = within_covariance(np.column_stack([first, second]), groups)
    if freedom < 4:
        raise ValueError(
            f"{freedom} degrees of freedom within samples; expected at least 4"
        )
    if not (np.diagonal(covariance) > 0).all():
        raise ValueError(
            "a response does not vary within samples; expected a response that varies"
        )
    correlation = float(
        covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1])
    )
    # variance 1 / (n - 3) for n - 1 degrees of freedom
    half = stats.norm.ppf(0.5 + CONFIDENCE / 2) / math.sqrt(freedom - 2)
    centre = math.atanh(min(max(correlation, -1 + 1e-12), 1 - 1e-12))
    return correlation, math.tanh(centre - half), math.tanh(centre + half), freedom


def _groups(
    values: np.ndarray, groups: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the group number of each value (n,), and size and mean of each group (k,)."""
    _, number = np.unique(groups, return_inverse=True)
    size = np.bincount(number).astype(float)
    return number, size, np.bincount(number, weights=values) / size


def _ratio(a: float, b: float) -> float:
    return a / b if b > 0 else math.inf


def _share(theta: float) -> float:
    """Turn theta = tau^2 / sigma^2 into the intraclass correlation, from 0 to 1."""
    return 1.0 if theta == math.inf else float(max(0.0, theta) / (1 + max(0.0, theta)))
