"""Show how the posterior depends on the discrepancy, and what remains plausible.

The plausible region contains the parameters that the measurements do not exclude. All
results use the same points of a Sobol sequence over the prior. They differ only in the
weights of the points, so no sampler is needed, and the results are deterministic.

  (C97)  Craig, Goldstein, Seheult & Smith 1997, Pressure matching for hydrocarbon
         reservoirs, in Case Studies in Bayesian Statistics III, 37: implausibility and
         history matching
  (P94)  Pukelsheim 1994, The three sigma rule, Am. Stat. 48, 88: 95 % of any
         distribution with one peak lies within three standard deviations
"""

import itertools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import qmc, rankdata

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty.likelihood import Observation, compute_log_likelihood
from repose.calibrate.uncertainty.sampler import N_BINS, compute_bits_of_fractions

CREDIBLE_PROBABILITY = 0.95
# Probability on each side of a credible interval.
TAIL_PROBABILITY = (1 - CREDIBLE_PROBABILITY) / 2
# A weight below this is treated as 0: a million such points add less than 1e-12 bits.
NEGLIGIBLE_WEIGHT = 1e-20
N_POINTS = 2**14
# Stated discrepancies: sizes, and the correlation within a bench test.
STATED_PERCENTS = (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)
STATED_CORRELATION = 0.9
IMPLAUSIBLE_SDS = 3.0  # deviation that is implausible, in standard deviations (P94)
N_CELLS = 16  # number of cells along each parameter in a projection on two
REGION_COLUMNS = ["x", "y", "x_quantile", "y_quantile", "least_implausibility", "share"]

ObservationFunction = Callable[[float, float], Observation]
"""From size in percent and correlation of a stated discrepancy to the observation."""


class PriorPoints:
    """Points of the prior, and what the surrogate predicts there.

    Attributes
    ----------
    space : ParameterSpace
        The parameters of the study.
    quantile : array (n, d)
        The prior's distribution function at the points.
    values : array (n, p)
        Parameter sets.
    predicted : array (n, k)
        Predicted responses.
    covariance : array (n, k, k)
        Covariances of the predictions.
    """

    def __init__(self, model: Surrogate, space: ParameterSpace) -> None:
        """Spread points over the prior, and predict the responses there.

        Parameters
        ----------
        model : Surrogate
            The surrogate.
        space : ParameterSpace
            Its constraints exclude points.
        """
        self.space = space
        sequence = qmc.Sobol(space.dimensions, scramble=False)
        # Shift all points by half a step, because the first point of the sequence is a
        # corner.
        self.quantile = sequence.random(N_POINTS) + 0.5 / N_POINTS
        if space.constraints:
            unit = space.from_prior(self.quantile)
            self.quantile = self.quantile[space.is_allowed(unit)]
        self.values = space.values(space.from_prior(self.quantile))
        self.predicted = model.predict(self.values)
        self.covariance = model.covariance(self.values)


class Region(NamedTuple):
    """The part of the prior that is not implausible."""

    share: float  # fraction of the prior
    # A row for each cell of each pair of parameters, with the columns `REGION_COLUMNS`:
    # middle of the cell, least implausibility in it, and fraction of its points in the
    # region
    projections: pd.DataFrame


def compute_information_curve(
    points: PriorPoints,
    targets: Targets,
    observed: ObservationFunction,
    shape_study: Observation | None = None,
) -> pd.DataFrame:
    """Compute how information and intervals depend on the size of the discrepancy.

    Parameters
    ----------
    points : PriorPoints
        Points of the prior, with the predictions there.
    targets : Targets
        The targets of the study.
    observed : callable
        See `ObservationFunction`.
    shape_study : Observation, optional
        The observation with the discrepancy from a shape study.

    Returns
    -------
    pandas.DataFrame
        A row for each size and correlation of a stated discrepancy, and a last one for
        the shape study.
    """
    # A discrepancy has a correlation only if a bench test has several targets.
    has_correlation = len(targets.apparatus) < len(targets)
    correlations = (0.0, STATED_CORRELATION) if has_correlation else (0.0,)
    rows = []
    for correlation in correlations:
        for percent in STATED_PERCENTS:
            row = {
                "discrepancy_percent": percent,
                "discrepancy_correlation": correlation,
                "evidence": "stated",
            }
            rows.append(
                row | _describe_information(points, observed(percent, correlation))
            )
    if shape_study is not None:
        discrepancy = shape_study.covariance - observed(0.0, 0.0).covariance
        row = _describe_shape_study(discrepancy, targets)
        rows.append(row | _describe_information(points, shape_study))
    return pd.DataFrame(rows)


def _describe_shape_study(discrepancy: np.ndarray, targets: Targets) -> dict[str, Any]:
    """Describe the covariance (k, k) of a shape study in the terms of a stated one.

    The size is the root mean square over the responses. The correlation is the mean
    absolute correlation over all pairs of responses.
    """
    variances = np.diag(discrepancy)
    share = np.sqrt(variances) / targets.value
    correlation = discrepancy / np.sqrt(np.outer(variances, variances))
    pairs = np.abs(correlation[np.triu_indices(len(correlation), 1)])
    return {
        "discrepancy_percent": 100 * math.sqrt(np.mean(share**2)),
        "evidence": "shape study",
        "discrepancy_correlation": float(pairs.mean()) if len(pairs) else 0.0,
    }


def _describe_information(points: PriorPoints, observed: Observation) -> dict[str, Any]:
    """Compute how much information a measurement gives about the parameters.

    The information is computed for all parameters together and for each of them.

    Parameters
    ----------
    points : PriorPoints
        Points of the prior, with the predictions there.
    observed : Observation
        The measurement with a discrepancy.

    Returns
    -------
    dict
        `information_bits`, `effective_points`, and the columns of `_describe_parameter`
        for each free parameter.
    """
    # Weight each point by its likelihood. n points of equal weight have the sum of
    # squares 1 / n. With unequal weights, this is the effective number of points.
    log_weight = compute_log_likelihood(points.predicted, points.covariance, observed)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    effective_points = 1 / float(weight @ weight)
    row: dict[str, Any] = {
        "information_bits": compute_joint_bits(weight),
        "effective_points": effective_points,
    }
    for k in range(points.space.dimensions):
        row |= _describe_parameter(points, k, weight, effective_points)
    return row


def _describe_parameter(
    points: PriorPoints, k: int, weight: np.ndarray, effective: float
) -> dict[str, float]:
    """Compute the credible interval of a free parameter, and the information about it.

    Parameters
    ----------
    points : PriorPoints
        The n points of the prior.
    k : int
        Number of the parameter among the free ones.
    weight : numpy.ndarray, (n,)
        Weights of the points, whose sum is 1.
    effective : float
        Effective number of points.

    Returns
    -------
    dict
        `*_low`, `*_high` and `*_bits`, each after the name of the parameter.
    """
    space = points.space
    quantile = points.quantile[:, k]

    # Find the ends of the interval, as quantiles of the prior, from the cumulative
    # weights.
    order = np.argsort(quantile)
    ends = np.interp(
        np.array([TAIL_PROBABILITY, 1 - TAIL_PROBABILITY]),
        np.cumsum(weight[order]),
        quantile[order],
    )

    # Convert the ends to values of the parameter. The other parameters have no effect
    # on the conversion, so set them to 0.5.
    two_points = np.full((2, space.dimensions), 0.5)
    two_points[:, k] = ends
    unit = space.from_prior(two_points)[:, k]
    name = space.free[k]
    low, high = space.values_at(name, unit).tolist()

    # Compute the information from a histogram of the quantiles. Constraints change the
    # distribution of the prior, so then use the quantiles among the allowed points.
    binned = quantile
    if space.constraints:
        binned = (rankdata(quantile) - 0.5) / len(quantile)
    bin_number = np.minimum((binned * N_BINS).astype(int), N_BINS - 1)
    bin_fractions = np.bincount(bin_number, weight, N_BINS)
    return {
        f"{name}_low": low,
        f"{name}_high": high,
        f"{name}_bits": compute_bits_of_fractions(bin_fractions, effective),
    }


def compute_implausibility(
    points: PriorPoints, mean: np.ndarray, covariance: np.ndarray
) -> np.ndarray:
    """Compute the implausibility (n,) of points (C97).

    It is the largest deviation of a response from its measurement, in standard
    deviations. `mean` (k,) and `covariance` (k, k) are those of the measurements.
    """
    surrogate_variance = np.diagonal(points.covariance, axis1=1, axis2=2)
    variance = surrogate_variance + np.diagonal(covariance)
    return np.sqrt((points.predicted - mean) ** 2 / variance).max(axis=1)


def find_region(points: PriorPoints, implausibilities: np.ndarray) -> Region:
    """Find the region that is not implausible, and project it on pairs of parameters.

    Parameters
    ----------
    points : PriorPoints
        The n points of the prior.
    implausibilities : numpy.ndarray, (n,)
        Result of `compute_implausibility`.

    Returns
    -------
    Region
    """
    is_inside = implausibilities < IMPLAUSIBLE_SDS
    pairs = itertools.combinations(range(points.space.dimensions), 2)
    tables = [_project_region(points, implausibilities, i, j) for i, j in pairs]
    # A single parameter forms no pair.
    if tables:
        projections = pd.concat(tables, ignore_index=True)
    else:
        projections = pd.DataFrame(columns=REGION_COLUMNS)
    return Region(float(is_inside.mean()), projections)


def _project_region(
    points: PriorPoints, implausibilities: np.ndarray, i: int, j: int
) -> pd.DataFrame:
    """Project the region that is not implausible on two free parameters.

    The range of each parameter is divided into cells of the same prior probability.

    Parameters
    ----------
    points : PriorPoints
        The n points of the prior.
    implausibilities : numpy.ndarray, (n,)
        Result of `compute_implausibility`.
    i, j : int
        Numbers of the parameters among the free ones.

    Returns
    -------
    pandas.DataFrame
        A row for each cell, with the columns `REGION_COLUMNS`.
    """
    # Find the cell of each point. The cells of the pair are numbered row by row.
    cells = np.minimum((points.quantile * N_CELLS).astype(int), N_CELLS - 1)
    cell_number = cells[:, i] * N_CELLS + cells[:, j]
    x_cell, y_cell = np.divmod(np.arange(N_CELLS**2), N_CELLS)

    # Find the least implausibility in each cell, and count its points in the region.
    least_implausibility = np.full(N_CELLS**2, np.inf)
    np.minimum.at(least_implausibility, cell_number, implausibilities)
    is_inside = implausibilities < IMPLAUSIBLE_SDS
    n_points = np.bincount(cell_number, minlength=N_CELLS**2)
    n_inside = np.bincount(cell_number, is_inside, minlength=N_CELLS**2)
    return pd.DataFrame(
        {
            "x": points.space.free[i],
            "y": points.space.free[j],
            "x_quantile": (x_cell + 0.5) / N_CELLS,
            "y_quantile": (y_cell + 0.5) / N_CELLS,
            "least_implausibility": least_implausibility,
            "share": n_inside / np.maximum(n_points, 1),
        }
    )


def compute_joint_bits(weight: np.ndarray) -> float:
    """Compute how far the weights (n,) of points diverge from equal weights, in bits.

    The result is the Kullback-Leibler divergence. The weights sum to 1.
    """
    heavy = weight[weight > NEGLIGIBLE_WEIGHT]
    return float(heavy @ np.log2(heavy * len(weight)))


def describe_curve(table: pd.DataFrame, share: float) -> str:
    """Describe in text the plausible region, and the information by discrepancy.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of `compute_information_curve`.
    share : float
        Share of the prior that is not implausible.

    Returns
    -------
    str
    """
    lines = []
    is_stated = table["evidence"] == "stated"
    for correlation, rows in table[is_stated].groupby("discrepancy_correlation"):
        bits = ", ".join(
            f"{row.discrepancy_percent:g} %: {row.information_bits:.2f}"
            for row in rows.itertuples()
        )
        lines.append(f"bits over the discrepancy, correlation {correlation:g}: {bits}")
    for row in table[~is_stated].itertuples():
        lines.append(
            f"with the discrepancy of the shape study, "
            f"{row.discrepancy_percent:.0f} %: {row.information_bits:.2f} bits"
        )
    lines.append(
        f"{100 * share:.0f} % of the prior is not implausible: no response lies "
        f"{IMPLAUSIBLE_SDS:g} standard deviations or more from its measurement"
    )
    return "\n".join(lines)
