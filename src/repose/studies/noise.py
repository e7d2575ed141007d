"""Noise floor: how far the pours of one sample scatter, how far samples differ, what seeds buy.

A response of pour j of sample i is y_ij = mu + a_i + e_ij, with variance tau^2 between samples and sigma^2 within
one. Both come from the unbalanced one-way analysis of variance, since a pour that failed leaves a sample with
fewer values than others.

Sources
  (SCM92)  Searle, Casella & McCulloch 1992, Variance Components, section 3.6: unbalanced data
  (TH78)   Thomas & Hultquist 1978, Annals of Statistics 6, 582: interval from unweighted means
"""

import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import stats

from repose.core.errors import InputError
from repose.core.readers import read_table
from repose.surrogate.bayesian_bp import RESPONSES

MOST_SEEDS = 64
CONFIDENCE = 0.95
WANTED_PERCENT = (0.5, 1.0, 2.0)  # standard errors, in percent of the target


class Components(NamedTuple):
    """Variance of one response; variances in its unit squared, intervals at CONFIDENCE."""

    groups: int
    values: int
    mean: float
    within: float
    within_low: float
    within_high: float
    between: float
    icc: float
    icc_low: float
    icc_high: float
    harmonic_seeds: float

    def reachable_r2(self, seeds):
        """R2 that the true means reach on means of this many seeds, tau^2 / (tau^2 + sigma^2 / seeds)."""
        total = self.between + self.within / np.asarray(seeds)
        return np.where(total > 0, self.between / np.where(total > 0, total, 1.0), 0.0)

    def standard_error(self, seeds):
        """Of a sample's mean over this many seeds, in the response's unit."""
        return np.sqrt(self.within / np.asarray(seeds))

    def seeds_for(self, standard_error):
        """Fewest seeds with which the standard error of a sample's mean is at most this one."""
        if not standard_error > 0:
            raise ValueError(f"standard_error is {standard_error!r}; allowed: above 0")
        return max(1, math.ceil(self.within / standard_error**2 * (1 - 1e-12)))


def variance_components(values, groups):
    """Components of values (n,) whose samples are named by groups (n,).

    between is (MSB - MSW) / n0 (SCM92), 0 where that is negative. The interval of sigma^2 is that of
    chi^2, the intraclass correlation's that of (TH78): F = h S^2 / MSW with S^2 the variance of the groups' means and h
    the harmonic mean of their sizes, exact when all have the same size. Raises ValueError for other shapes, values
    that are not finite, fewer than two groups, or no group with two values.
    """
    values, groups = np.asarray(values, dtype=float), np.asarray(groups)
    if values.ndim != 1 or values.shape != groups.shape:
        raise ValueError(f"values has shape {values.shape}, groups {groups.shape}; allowed: (n,) both")
    if not np.isfinite(values).all():
        raise ValueError("values must be finite")
    number, size, mean = _groups(values, groups)
    k, n = len(size), len(values)
    if k < 2 or n == k:
        raise ValueError(
            f"{n} values in {k} groups; allowed: at least two groups, one of them with two values"
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
    ends = [_share((_ratio(spread, within * stats.f.ppf(q, k - 1, n - k)) - 1) / h) for q in (1 - tail, tail)]
    sigma = [within * (n - k) / stats.chi2.ppf(q, n - k) for q in (1 - tail, tail)]
    total = between + within
    icc = between / total if total > 0 else 0.0
    return Components(k, n, float(values.mean()), within, *map(float, sigma), between, icc, *ends, float(h))


def within_covariance(values, groups):
    """Covariance (k, k) of responses (n, k) about the means of their groups (n,), and its degrees of freedom.

    Zeros where no group has two values.
    """
    values = np.asarray(values, dtype=float)
    residuals = np.empty_like(values)
    for k, column in enumerate(values.T):
        number, size, mean = _groups(column, groups)
        residuals[:, k] = column - mean[number]
    freedom = len(values) - len(size)
    return residuals.T @ residuals / max(freedom, 1), freedom


def residual_correlation(first, second, groups):
    """Correlation of two responses (n,) within samples, its interval, and its degrees of freedom n - k.

    Products of the deviations from the samples' means; the interval by Fisher's transformation. Raises ValueError
    with fewer than four degrees of freedom or a response that does not vary within samples.
    """
    covariance, freedom = within_covariance(np.column_stack([first, second]), groups)
    if freedom < 4:
        raise ValueError(f"{freedom} degrees of freedom within samples; allowed: at least 4")
    if not (np.diagonal(covariance) > 0).all():
        raise ValueError("a response does not vary within samples; allowed: one that does")
    correlation = float(covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1]))
    # variance 1 / (n - 3) for n - 1 degrees of freedom
    half = stats.norm.ppf(0.5 + CONFIDENCE / 2) / math.sqrt(freedom - 2)
    centre = math.atanh(min(max(correlation, -1 + 1e-12), 1 - 1e-12))
    return correlation, math.tanh(centre - half), math.tanh(centre + half), freedom


def read_runs(runs_csv):
    """All runs of a study and those that gave a pile, or InputError where no sample has two of these."""
    runs = read_table(runs_csv, ("sample", "seed", "status", *RESPONSES))
    ok = runs[runs["status"] == "ok"]
    sizes = ok.groupby("sample").size()
    if len(sizes) < 2 or sizes.max() < 2:
        raise InputError(
            runs_csv,
            "runs a sample",
            int(sizes.max()) if len(sizes) else 0,
            "2 or more, of 2 samples or more",
        )
    return runs, ok


def run(runs_csv, target, out_dir):
    """Write noise.csv (one row a response), seeds.csv (1 to 64 seeds) and noise.json; return the summary.

    runs_csv: as `repose.chain.dataset` writes it; target: that section of the configuration. Raises InputError for a
    missing column, or where no sample has two runs that gave a pile.
    """
    import pandas as pd

    runs, ok = read_runs(runs_csv)
    failed = runs[runs["status"] != "ok"]
    found = {name: variance_components(ok[name], ok["sample"]) for name in RESPONSES}
    seeds = np.arange(1, MOST_SEEDS + 1)
    table = pd.DataFrame({"seeds": seeds})
    rows = []
    for name, one in found.items():
        response, unit = name.rsplit("_", 1)
        table[f"{response}_se_{unit}"] = one.standard_error(seeds)
        table[f"{response}_se_percent"] = 100 * one.standard_error(seeds) / target[name]
        for label, icc in (("", one.icc), ("_low", one.icc_low), ("_high", one.icc_high)):
            table[f"{response}_reachable_r2{label}"] = icc / (icc + (1 - icc) / seeds)
        rows.append(_row(name, one, ok, failed, target[name]))
    correlation = residual_correlation(ok[RESPONSES[0]], ok[RESPONSES[1]], ok["sample"])
    summary = {
        "responses": {row["response"]: row for row in rows},
        "correlation": dict(zip(("value", "low", "high", "degrees_of_freedom"), correlation, strict=True)),
        "confidence": CONFIDENCE,
    }
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows).to_csv(out / "noise.csv", index=False)
    table.to_csv(out / "seeds.csv", index=False)
    (out / "noise.json").write_text(json.dumps(summary, indent=1) + "\n")
    return summary


def message(summary):
    """The noise floor in words, one line a response."""
    lines = []
    for name, row in summary["responses"].items():
        unit = name.rsplit("_", 1)[1]
        lines.append(
            f"{name}: sd {row['sd_within']:.2f} {unit} within a sample, {row['sd_between']:.2f} between; intraclass "
            f"correlation {row['icc']:.3f} ({row['icc_low']:.3f} to {row['icc_high']:.3f}); a perfect predictor "
            f"reaches R2 {row['r2_single_runs']:.3f} on single runs, {row['r2_sample_means']:.3f} on the means here"
        )
    return "\n".join(lines)


def _row(name, one, ok, failed, target):
    """The row of noise.csv of one response."""
    row = {
        "response": name,
        "samples": one.groups,
        "runs": one.values,
        "failed_runs": len(failed),
        "samples_with_failures": int(failed["sample"].nunique()),
        "samples_without_runs": int((~failed["sample"].drop_duplicates().isin(ok["sample"])).sum()),
        "mean": one.mean,
        "sd_within": math.sqrt(one.within),
        "sd_within_low": math.sqrt(one.within_low),
        "sd_within_high": math.sqrt(one.within_high),
        "sd_between": math.sqrt(one.between),
        "icc": one.icc,
        "icc_low": one.icc_low,
        "icc_high": one.icc_high,
        "mean_seeds": one.harmonic_seeds,
        "r2_single_runs": float(one.reachable_r2(1)),
        "r2_sample_means": float(one.reachable_r2(one.harmonic_seeds)),
    }
    return row | {f"seeds_for_{p:g}_percent": one.seeds_for(p / 100 * target) for p in WANTED_PERCENT}


def _groups(values, groups):
    """Group number of each value (n,), and size and mean of each group (k,)."""
    _, number = np.unique(groups, return_inverse=True)
    size = np.bincount(number).astype(float)
    return number, size, np.bincount(number, weights=values) / size


def _ratio(a, b):
    return a / b if b > 0 else math.inf


def _share(theta):
    """Intraclass correlation of theta = tau^2 / sigma^2, from 0 to 1."""
    return 1.0 if theta == math.inf else float(max(0.0, theta) / (1 + max(0.0, theta)))
