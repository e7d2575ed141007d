"""Dependence of the posterior on the discrepancy, and the region of parameters that the measurements do not exclude.

Both weigh the same points of a Sobol sequence over the prior, so nothing is sampled anew and the results are
deterministic.

  (C97)  Craig, Goldstein, Seheult & Smith 1997, Pressure matching for hydrocarbon reservoirs, in Case Studies in
         Bayesian Statistics III, 37: implausibility and history matching
  (P94)  Pukelsheim 1994, The three sigma rule, Am. Stat. 48, 88: 95 % of any distribution with one peak lies within
         three standard deviations
"""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import qmc

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty.likelihood import Observed, log_likelihood
from repose.calibrate.uncertainty.sampler import BINS, bits_of_shares

CREDIBLE = 0.95
NEGLIGIBLE = 1e-20  # weight of a point that adds nothing: a million of them add less than 1e-12 bits
POINTS = 2**14
PERCENT = (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)
CORRELATED = 0.9
IMPLAUSIBLE = 3.0  # standard deviations (P94)
CELLS = 16  # of each parameter in a projection on two
REGION = ["x", "y", "x_quantile", "y_quantile", "least_implausibility", "share"]

Observation = Callable[[float, float], Observed]
"""From size (percent) and correlation of a stated discrepancy to `repose.calibrate.uncertainty.likelihood.observation`."""


class Points:
    """Points of the prior, with the surrogate's predictions and their covariances there."""

    def __init__(self, model: Surrogate, space: ParameterSpace) -> None:
        self.space = space
        self.quantile = (
            qmc.Sobol(space.dimensions, scramble=False).random(POINTS) + 0.5 / POINTS
        )
        self.values = space.values(space.from_prior(self.quantile))
        self.predicted, self.covariance = (
            model.predict(self.values),
            model.covariance(self.values),
        )


def curve(
    points: Points,
    targets: Targets,
    observed: Observation,
    shapes: Observed | None = None,
) -> pd.DataFrame:
    """Compute information and intervals over the size of the discrepancy, a row for each size and correlation.

    A last row has the discrepancy by a shape study, where there is one.
    """
    several = len(targets.apparatus) < len(targets)
    rows = [
        {
            "discrepancy_percent": percent,
            "discrepancy_correlation": correlation,
            "evidence": "stated",
        }
        | _bits(points, observed(percent, correlation))
        for correlation, percent in itertools.product(
            (0.0, CORRELATED) if several else (0.0,), PERCENT
        )
    ]
    if shapes is not None:
        added = shapes[1] - observed(0.0, 0.0)[1]
        share = np.sqrt(np.diag(added)) / targets.value
        between = added / np.sqrt(np.outer(np.diag(added), np.diag(added)))
        pairs = np.abs(between[np.triu_indices(len(between), 1)])
        row = {
            "discrepancy_percent": 100 * math.sqrt(np.mean(share**2)),
            "evidence": "shape study",
        }
        row |= {"discrepancy_correlation": float(pairs.mean()) if len(pairs) else 0.0}
        rows.append(row | _bits(points, shapes))
    return pd.DataFrame(rows)


def _bits(points: Points, observation: Observed) -> dict[str, Any]:
    """Compute joint bits, effective points, and interval and bits of each parameter."""
    log_weight = log_likelihood(points.predicted, points.covariance, observation)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    row: dict[str, Any] = {
        "information_bits": joint_bits(weight),
        "effective_points": 1 / float(weight @ weight),
    }
    for k in range(points.space.dimensions):
        row |= _marginal(points, k, weight, row["effective_points"])
    return row


def _marginal(
    points: Points, k: int, weight: np.ndarray, effective: float
) -> dict[str, float]:
    """Compute interval and bits of one parameter."""
    space, quantile = points.space, points.quantile[:, k]
    name = space.free[k]
    order = np.argsort(quantile)
    ends = np.interp(
        np.array([(1 - CREDIBLE) / 2, (1 + CREDIBLE) / 2]),
        np.cumsum(weight[order]),
        quantile[order],
    )
    edge = np.full((2, space.dimensions), 0.5)
    edge[:, k] = ends
    low, high = (
        space.low[k] + (space.high[k] - space.low[k]) * space.from_prior(edge)[:, k]
    ).tolist()
    share = np.bincount(
        np.minimum((quantile * BINS).astype(int), BINS - 1), weight, BINS
    )
    return {
        f"{name}_low": low,
        f"{name}_high": high,
        f"{name}_bits": bits_of_shares(share, effective),
    }


def implausibility(
    points: Points, mean: np.ndarray, covariance: np.ndarray
) -> np.ndarray:
    """Compute how far (n,) the worst response is from its measurement, in standard deviations (C97)."""
    variance = np.diagonal(points.covariance, axis1=1, axis2=2) + np.diagonal(
        covariance
    )
    return np.sqrt((points.predicted - mean) ** 2 / variance).max(axis=1)


def region(points: Points, implausible: np.ndarray) -> tuple[float, pd.DataFrame]:
    """Find the share of the prior that is not implausible, and project this region on pairs of parameters."""
    kept, space = implausible < IMPLAUSIBLE, points.space
    cell = np.minimum((points.quantile * CELLS).astype(int), CELLS - 1)
    x, y = ((place + 0.5) / CELLS for place in np.divmod(np.arange(CELLS**2), CELLS))
    tables = []
    for i, j in itertools.combinations(range(space.dimensions), 2):
        number = cell[:, i] * CELLS + cell[:, j]
        least = np.full(CELLS**2, np.inf)
        np.minimum.at(least, number, implausible)
        count, inside = (
            np.bincount(number, part, minlength=CELLS**2) for part in (None, kept)
        )
        columns = (
            space.free[i],
            space.free[j],
            x,
            y,
            least,
            inside / np.maximum(count, 1),
        )
        tables.append(pd.DataFrame(dict(zip(REGION, columns, strict=True))))
    return float(kept.mean()), pd.concat(
        tables, ignore_index=True
    ) if tables else pd.DataFrame(columns=REGION)


def joint_bits(weight: np.ndarray) -> float:
    """Compute the Kullback-Leibler divergence of weighted points from equal weights, in bits."""
    heavy = weight[weight > NEGLIGIBLE]
    return float(heavy @ np.log2(heavy * len(weight)))


def message(table: pd.DataFrame, share: float) -> str:
    """Write the curve and the region as text."""
    lines, stated = [], table["evidence"] == "stated"
    for correlation, own in table[stated].groupby("discrepancy_correlation"):
        shares = [
            f"{row.discrepancy_percent:g} %: {row.information_bits:.2f}"
            for row in own.itertuples()
        ]
        lines.append(
            f"bits over the discrepancy, correlation {correlation:g}: {', '.join(shares)}"
        )
    for row in table[~stated].itertuples():
        size = (
            f"with the discrepancy of the shape study, {row.discrepancy_percent:.0f} %"
        )
        lines.append(f"{size}: {row.information_bits:.2f} bits")
    kept = f"{100 * share:.0f} % of the prior is not implausible"
    lines.append(
        f"{kept}: no response lies {IMPLAUSIBLE:g} standard deviations or more from its measurement"
    )
    return "\n".join(lines)
