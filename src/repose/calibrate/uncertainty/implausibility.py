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
# Values of the column `evidence`: where a discrepancy comes from.
STATED = "stated"
SHAPE_STUDY = "shape study"
# Stated discrepancies: sizes, and the correlation within a bench test.
STATED_PERCENTS = (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)
STATED_CORRELATION = 0.9
IMPLAUSIBLE_SDS = 3.0  # deviation that is implausible, in standard deviations (P94)
N_CELLS = 16  # number of cells along each parameter in a projection on two
# Columns of region.csv. The last two are the smallest implausibility in a cell, and the
# fraction of its points that are plausible.
REGION_COLUMNS = ["x", "y", "x_quantile", "y_quantile", "least_implausibility", "share"]

ObservationFunction = Callable[[float, float], Observation]
"""From size in percent and correlation of a stated discrepancy to the observation."""


class PriorPoints:
    """Points of the prior, and what the surrogate predicts there.

    Attributes
    ----------
    space : ParameterSpace
        The parameters of the study.
    quantiles : array (n, d)
        The points, as values of the cumulative distribution function (CDF) of each
        free parameter's prior, from 0 to 1.
    values : array (n, p)
        The points, as values of all parameters.
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
            The parameters of the study. Points that violate a constraint are left out.
        """
        self.space = space
        sequence = qmc.Sobol(space.dimensions, scramble=False)
        # Each coordinate of the points is a multiple of 1 / N_POINTS, and the first
        # point is the corner 0. Half a step more moves the points to the middles of
        # N_POINTS equal intervals, away from the ends of the priors.
        self.quantiles = sequence.random(N_POINTS) + 0.5 / N_POINTS
        if space.constraints:
            unit = space.transform_to_prior(self.quantiles)
            self.quantiles = self.quantiles[space.is_allowed(unit)]
        self.values = space.values(space.transform_to_prior(self.quantiles))
        self.predicted = model.predict(self.values)
        self.covariance = model.covariance(self.values)


class Region(NamedTuple):
    """The plausible region: the part of the prior that is not implausible."""

    fraction: float  # fraction of the prior
    # A row for each cell of each pair of parameters, with the columns `REGION_COLUMNS`:
    # middle of the cell, smallest implausibility in it, and fraction of its points in
    # the region
    projections: pd.DataFrame


def compute_information_curve(
    points: PriorPoints,
    targets: Targets,
    make_observation: ObservationFunction,
    shape_study: Observation | None = None,
) -> pd.DataFrame:
    """Compute how information and intervals depend on the size of the discrepancy.

    The discrepancy is the deviation between simulator and reality. It is stated with
    several sizes and correlations, or estimated from a shape study, in which grains of
    several shapes were simulated.

    Parameters
    ----------
    points : PriorPoints
        Points of the prior, with the predictions there.
    targets : Targets
        The targets of the study.
    make_observation : callable
        It makes the observation with a stated discrepancy from the size of the
        discrepancy in percent and its correlation.
    shape_study : Observation, optional
        The observation with the discrepancy from a shape study.

    Returns
    -------
    pandas.DataFrame
        A row for each size and correlation of a stated discrepancy, and a last one for
        the shape study.
    """
    # Only discrepancies of the same bench test are correlated. So there are
    # correlations if there are more targets than bench tests.
    has_correlation = len(targets.apparatus) < len(targets)
    correlations = (0.0, STATED_CORRELATION) if has_correlation else (0.0,)
    rows = []
    for correlation in correlations:
        for percent in STATED_PERCENTS:
            row = {
                "discrepancy_percent": percent,
                "discrepancy_correlation": correlation,
                "evidence": STATED,
            }
            observed = make_observation(percent, correlation)
            rows.append(row | _compute_information(points, observed))
    if shape_study is not None:
        # The observation without a discrepancy has the covariance of the measurement.
        measurement_covariance = make_observation(0.0, 0.0).covariance
        discrepancy = shape_study.covariance - measurement_covariance
        row = _describe_shape_study(discrepancy, targets)
        rows.append(row | _compute_information(points, shape_study))
    return pd.DataFrame(rows)


def _describe_shape_study(discrepancy: np.ndarray, targets: Targets) -> dict[str, Any]:
    """Describe the covariance (k, k) of a shape study in the terms of a stated one.

    The size is the root mean square over the responses. The correlation is the mean
    absolute correlation over all pairs of responses.
    """
    variances = np.diag(discrepancy)
    relative_sd = np.sqrt(variances) / targets.value
    correlation = discrepancy / np.sqrt(np.outer(variances, variances))
    pairs = np.abs(correlation[np.triu_indices(len(correlation), 1)])
    return {
        "discrepancy_percent": 100 * math.sqrt(np.mean(relative_sd**2)),
        "evidence": SHAPE_STUDY,
        "discrepancy_correlation": float(pairs.mean()) if len(pairs) else 0.0,
    }


def _compute_information(points: PriorPoints, observed: Observation) -> dict[str, Any]:
    """Compute how much information a measurement gives about the parameters.

    The information, in bits, is computed for all parameters together and for each of
    them. The credible interval of each parameter is computed, too.

    Parameters
    ----------
    points : PriorPoints
        Points of the prior, with the predictions there.
    observed : Observation
        The measurement with a discrepancy.

    Returns
    -------
    dict
        `information_bits`, `effective_points`, and for each free parameter `*_low`,
        `*_high` and `*_bits` after its name.
    """
    # Weight each point by its likelihood. The effective number of points is one over
    # the sum of the squared weights, which is n if n points have the same weight.
    log_weight = compute_log_likelihood(points.predicted, points.covariance, observed)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    effective_points = 1 / float(weight @ weight)
    row: dict[str, Any] = {
        "information_bits": compute_joint_bits(weight),
        "effective_points": effective_points,
    }
    for k in range(points.space.dimensions):
        row |= _compute_marginal_information(points, k, weight, effective_points)
    return row


def _compute_marginal_information(
    points: PriorPoints, k: int, weight: np.ndarray, effective_points: float
) -> dict[str, float]:
    """Compute the credible interval of a free parameter, and the information about it.

    Parameters
    ----------
    points : PriorPoints
        The n points of the prior.
    k : int
        Index of the parameter among the free ones.
    weight : numpy.ndarray, (n,)
        Weights of the points, whose sum is 1.
    effective_points : float
        Effective number of points.

    Returns
    -------
    dict
        `*_low`, `*_high` and `*_bits`, each after the name of the parameter. The
        interval has the probability `CREDIBLE_PROBABILITY`.
    """
    space = points.space
    quantiles = points.quantiles[:, k]

    # Find the ends of the interval, as quantiles of the prior, from the cumulative
    # weights.
    order = np.argsort(quantiles)
    ends = np.interp(
        np.array([TAIL_PROBABILITY, 1 - TAIL_PROBABILITY]),
        np.cumsum(weight[order]),
        quantiles[order],
    )

    # Convert the ends to values of the parameter. The conversion takes all parameters,
    # but treats each separately, so any number serves for the others.
    two_points = np.full((2, space.dimensions), 0.5)
    two_points[:, k] = ends
    unit = space.transform_to_prior(two_points)[:, k]
    name = space.free[k]
    low, high = space.values_at(name, unit).tolist()

    # Compute the information from a histogram in which the prior has the same
    # probability in each bin. Without constraints, the quantiles have this property.
    # Constraints exclude points, so then take the ranks among the allowed points.
    uniform = quantiles
    if space.constraints:
        uniform = (rankdata(quantiles) - 0.5) / len(quantiles)
    bin_number = np.minimum((uniform * N_BINS).astype(int), N_BINS - 1)
    bin_fractions = np.bincount(bin_number, weights=weight, minlength=N_BINS)
    return {
        f"{name}_low": low,
        f"{name}_high": high,
        f"{name}_bits": compute_bits_of_fractions(bin_fractions, effective_points),
    }


def compute_implausibility(
    points: PriorPoints, mean: np.ndarray, covariance: np.ndarray
) -> np.ndarray:
    """Compute the implausibility (n,) of points, a measure from history matching.

    It is the largest deviation of a response from its measurement, in standard
    deviations (Craig et al. 1997). `mean` (k,) and `covariance` (k, k) are the means of
    the measurements and their covariance.
    """
    surrogate_variance = np.diagonal(points.covariance, axis1=1, axis2=2)
    variance = surrogate_variance + np.diagonal(covariance)
    return np.sqrt((points.predicted - mean) ** 2 / variance).max(axis=1)


def find_region(points: PriorPoints, implausibilities: np.ndarray) -> Region:
    """Find the plausible region, and project it onto each pair of parameters.

    A point is plausible if its implausibility is below `IMPLAUSIBLE_SDS`.

    Parameters
    ----------
    points : PriorPoints
        The n points of the prior.
    implausibilities : numpy.ndarray, (n,)
        Result of `compute_implausibility`.

    Returns
    -------
    Region
        The fraction of the prior in the region, and the projections.
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
    """Project the plausible region onto the plane of two free parameters.

    The range of each of both parameters is divided into `N_CELLS` intervals of the same
    prior probability, so the plane is divided into `N_CELLS` x `N_CELLS` cells.

    Parameters
    ----------
    points : PriorPoints
        The n points of the prior.
    implausibilities : numpy.ndarray, (n,)
        Result of `compute_implausibility`.
    i, j : int
        Indices of the parameters among the free ones.

    Returns
    -------
    pandas.DataFrame
        A row for each cell, with the columns `REGION_COLUMNS`. The column `share` is
        the fraction of the points in the cell that are plausible.
    """
    # Find the cell of each point. The cells of the pair are numbered row by row.
    cells = np.minimum((points.quantiles * N_CELLS).astype(int), N_CELLS - 1)
    cell_number = cells[:, i] * N_CELLS + cells[:, j]
    x_cell, y_cell = np.divmod(np.arange(N_CELLS**2), N_CELLS)

    # Find the smallest implausibility in each cell, and count its points in the region.
    # A cell without points has the implausibility infinity.
    min_implausibility = np.full(N_CELLS**2, np.inf)
    np.minimum.at(min_implausibility, cell_number, implausibilities)
    is_inside = implausibilities < IMPLAUSIBLE_SDS
    n_points = np.bincount(cell_number, minlength=N_CELLS**2)
    n_inside = np.bincount(cell_number, weights=is_inside, minlength=N_CELLS**2)
    return pd.DataFrame(
        {
            "x": points.space.free[i],
            "y": points.space.free[j],
            "x_quantile": (x_cell + 0.5) / N_CELLS,
            "y_quantile": (y_cell + 0.5) / N_CELLS,
            "least_implausibility": min_implausibility,
            "share": n_inside / np.maximum(n_points, 1),
        }
    )


def compute_joint_bits(weight: np.ndarray) -> float:
    """Compute how far the weights (n,) of points diverge from equal weights, in bits.

    The result is the Kullback-Leibler divergence. The weights sum to 1.
    """
    heavy = weight[weight > NEGLIGIBLE_WEIGHT]
    return float(heavy @ np.log2(heavy * len(weight)))


def describe_curve(table: pd.DataFrame, plausible_fraction: float) -> str:
    """Describe the plausible region, and the information by size of the discrepancy.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of `compute_information_curve`: a row for each stated discrepancy, and
        perhaps one for the discrepancy that was estimated from a shape study.
    plausible_fraction : float
        Fraction of the prior in the plausible region.

    Returns
    -------
    str
        Several lines.
    """
    lines = []
    is_stated = table["evidence"] == STATED
    for correlation, rows in table[is_stated].groupby("discrepancy_correlation"):
        bits = ", ".join(
            f"{row.discrepancy_percent:g} %: {row.information_bits:.2f}"
            for row in rows.itertuples()
        )
        lines.append(
            f"information in bits by size of the discrepancy, "
            f"correlation {correlation:g}: {bits}"
        )
    for row in table[~is_stated].itertuples():
        lines.append(
            f"with the discrepancy of the shape study, "
            f"{row.discrepancy_percent:.0f} %: {row.information_bits:.2f} bits"
        )
    lines.append(
        f"{100 * plausible_fraction:.0f} % of the prior is plausible: each response "
        f"lies less than {IMPLAUSIBLE_SDS:g} standard deviations from its measurement"
    )
    return "\n".join(lines)
