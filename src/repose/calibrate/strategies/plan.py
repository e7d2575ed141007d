"""Estimate how many runs a calibration needs, before its first run.

A plan states two things: the smallest number of runs that the noise requires, and for
each of several budgets of runs the probability of success.

The probabilities come from the table `success.csv`, which
`research/answers/hidden_truths.py` writes. In simulated campaigns (whole
calibrations), the sequential strategy searched for hidden parameter sets of an emulated
simulator, whose runs scatter by a few percent. The table has the fraction of these sets
that were found. Its column `pours` is the budget, a number of runs, and `truths` the
number of hidden parameter sets. Logistic curves smooth the fractions over the
logarithms of budget and scatter. A study that differs from the campaigns gets no
probability.
"""

from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.runs import select_bench_runs
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.targets import Targets
from repose.calibrate.variance import estimate_within_covariance
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table
from repose.common.numbers import format_significant

SUCCESS_FILE = Path(__file__).with_name("success.csv")
# Noise that is assumed if none is measured, which is that of the default grain: the
# scatter of a run in percent of the target, and the correlation of two responses of the
# same bench test.
DEFAULT_NOISE_PERCENT = 5.0
DEFAULT_CORRELATION = 0.8
# Probability with which the needed runs determine the means within the tolerance.
CERTAINTY = 0.9
# Tolerances of the table, in percent.
TOLERANCES = (1.0, 2.0)
# Strategy and number of free parameters of the campaigns. Their numbers of targets and
# their scatters are in the table.
CAMPAIGN_STRATEGY = "sequential"
CAMPAIGN_PARAMETERS = 6


class Plan(NamedTuple):
    """Expected results of budgets of runs.

    Attributes
    ----------
    noise_percent : numpy.ndarray, (k,)
        Scatter of a run, in percent of each target.
    measured : bool
        Whether the scatter comes from runs.
    needed : dict
        For each tolerance in percent, the number of runs that the noise alone requires
        with the probability `CERTAINTY`.
    budgets : tuple of int
        Numbers of runs.
    success : pandas.DataFrame or None
        Result of `estimate_success`; None if the study differs from the campaigns.
    campaigns : str
        Description of the campaigns.
    differences : tuple of str
        A phrase for each difference between the study and the campaigns.
    """

    noise_percent: np.ndarray
    measured: bool
    needed: dict[float, int]
    budgets: tuple[int, ...]
    success: pd.DataFrame | None
    campaigns: str
    differences: tuple[str, ...]


def make_plan(
    space: ParameterSpace,
    targets: Targets,
    strategy: str,
    runs: pd.DataFrame | None = None,
    source: object = "runs",
) -> Plan:
    """Estimate how many runs a study needs, and the probability of success of budgets.

    Parameters
    ----------
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    strategy : str
        Name of the study's strategy.
    runs : pandas.DataFrame, optional
        Earlier runs, from which the noise is estimated. Without runs, the noise is that
        of `make_default_noise`.
    source : object, optional
        File of the runs, for an error.

    Returns
    -------
    Plan
        Its `success` is None if the study differs from the simulated campaigns.

    Raises
    ------
    InputError
        If the runs have too few replicates.
    """
    # Find the covariance of a run, and its scatter in percent of each target.
    if runs is None:
        noise = make_default_noise(targets)
    else:
        noise = estimate_noise(runs, targets, source)
    noise_percent = 100 * np.sqrt(np.diagonal(noise)) / targets.whole

    # Count the runs that the noise requires for each tolerance.
    needed = {}
    for tolerance in TOLERANCES:
        goal = Goal.from_targets(targets, tolerance, space)
        needed[tolerance] = goal.count_needed_runs(noise, CERTAINTY)

    # The probability of success is only known for studies like the simulated campaigns,
    # whose results are in a file. Their scatter is the same for all targets, so compare
    # it with the largest scatter of this study.
    campaigns = pd.read_csv(SUCCESS_FILE)
    largest_percent = float(noise_percent.max())
    differences = _list_differences(
        campaigns,
        strategy=strategy,
        n_free=space.dimensions,
        n_targets=len(targets),
        noise_percent=largest_percent,
    )
    success = None
    if not differences:
        success = estimate_success(len(targets), largest_percent)
    return Plan(
        noise_percent=noise_percent,
        measured=runs is not None,
        needed=needed,
        budgets=tuple(sorted(set(campaigns["pours"].tolist()))),
        success=success,
        campaigns=_describe_campaigns(campaigns),
        differences=tuple(differences),
    )


def _describe_campaigns(table: pd.DataFrame) -> str:
    """Describe the campaigns of `success.csv` in words."""
    numbers = " or ".join(map(str, sorted(set(table["responses"]))))
    scatters = table["noise_percent"]
    return (
        f"strategy {CAMPAIGN_STRATEGY}, {CAMPAIGN_PARAMETERS} free parameters, {numbers} "
        f"targets, a scatter of {format_significant(scatters.min())} to "
        f"{format_significant(scatters.max())} %"
    )


def _list_differences(
    table: pd.DataFrame,
    *,
    strategy: str,
    n_free: int,
    n_targets: int,
    noise_percent: float,
) -> list[str]:
    """List how a study differs from the simulated campaigns of `success.csv`.

    Parameters
    ----------
    table : pandas.DataFrame
        The content of `success.csv`.
    strategy : str
        Name of the strategy of the study.
    n_free : int
        Number of its free parameters.
    n_targets : int
        Number of its targets.
    noise_percent : float
        The largest scatter of a run, in percent of the target.

    Returns
    -------
    list of str
        A phrase for each difference. The list is empty if the study is within the range
        of the campaigns.
    """
    differences = []
    if strategy != CAMPAIGN_STRATEGY:
        differences.append(f"strategy {strategy}")
    if n_free != CAMPAIGN_PARAMETERS:
        differences.append(f"free parameters: {n_free}")
    # The campaigns have a target for each response.
    if n_targets not in set(table["responses"]):
        differences.append(f"targets: {n_targets}")
    scatters = table["noise_percent"]
    if not scatters.min() <= noise_percent <= scatters.max():
        differences.append(f"a scatter of {format_significant(noise_percent, 2)} %")
    return differences


def estimate_success(n_targets: int, noise_percent: float) -> pd.DataFrame:
    """Estimate the success probability of the sequential strategy for each budget.

    Parameters
    ----------
    n_targets : int
        Number of targets. `success.csv` must have it in its column `responses`.
    noise_percent : float
        Scatter of a run in percent of the target, within the range of `success.csv`.

    Returns
    -------
    pandas.DataFrame
        A row for each budget, with the number of runs in the column `pours`. The
        columns `within_1_percent` and `within_2_percent` have the probabilities that
        the answer of the strategy is this close to all targets. The columns that end in
        `_se` have the standard errors of these probabilities.
    """
    campaigns = pd.read_csv(SUCCESS_FILE)
    campaigns = campaigns[campaigns["responses"] == n_targets]
    # `pours` is the budget, a number of runs. `truths` is the number of hidden
    # parameter sets, each a trial that succeeds or fails. All campaigns have the same
    # truths, whatever their budget, so fitting a curve to more budgets does not make
    # the probabilities more certain. Therefore compute the standard errors from the
    # number of truths alone, which is the same in all rows of a budget.
    budgets = campaigns.groupby("pours", as_index=False)["truths"].first()
    table = budgets[["pours"]].copy()
    for tolerance in TOLERANCES:
        column = f"within_{tolerance:g}_percent"
        curve = SuccessCurve.fit(campaigns, column)
        table[column] = curve.probability(table["pours"], noise_percent)
        table[f"{column}_se"] = compute_fraction_error(table[column], budgets["truths"])
    return table


class SuccessCurve(NamedTuple):
    """Probability of success over the number of runs and their scatter.

    Its logit is ``level + by_pours log(pours) + by_noise log(noise)``, where a pour is
    a run, and the noise is in percent.
    """

    level: float
    by_pours: float
    by_noise: float

    @classmethod
    def fit(cls, table: pd.DataFrame, column: str) -> Self:
        """Fit a curve that does not decrease with the number of runs.

        Parameters
        ----------
        table : pandas.DataFrame
            A row for each group of simulated campaigns: `pours` (number of runs),
            `noise_percent`, `truths` (number of trials), and fractions of successful
            trials.
        column : str
            Name of the column with the fractions.

        Returns
        -------
        SuccessCurve
            The curve with the largest likelihood.
        """
        from scipy.optimize import minimize
        from scipy.special import expit

        # The columns are a constant, log(pours) and log(noise), in the order of the
        # fields of this class.
        log_pours, log_noise = np.log(table[["pours", "noise_percent"]].to_numpy().T)
        terms = np.column_stack([np.ones(len(table)), log_pours, log_noise])
        trials = table["truths"].to_numpy(float)
        successes = trials * table[column].to_numpy(float)

        def loss(coefficients: np.ndarray) -> tuple[float, np.ndarray]:
            """Compute the negative log likelihood of the curve, and its gradient.

            The number of successes in a row of the table is binomial. The logit of its
            probability is linear in the coefficients.
            """
            logit = terms @ coefficients
            value = trials @ np.logaddexp(0, logit) - successes @ logit
            gradient = (trials * expit(logit) - successes) @ terms
            return float(value), gradient

        # More runs never make a success less probable, so the coefficient of log(pours)
        # must not be negative.
        bounds = [(None, None), (0, None), (None, None)]
        minimum = minimize(loss, np.zeros(3), jac=True, bounds=bounds, method="SLSQP")
        return cls(*minimum.x.tolist())

    def probability(self, pours: pd.Series, noise_percent: float) -> pd.Series:
        """Return the probability of success for each number of runs in `pours`."""
        from scipy.special import expit

        noise = self.by_noise * np.log(noise_percent)
        return expit(self.level + self.by_pours * np.log(pours) + noise)


def compute_fraction_error(fraction: pd.Series, trials: pd.Series) -> pd.Series:
    """Compute the standard error of a probability from the fraction of successful trials.

    It is the standard deviation of the beta distribution that follows from these trials
    and a uniform prior. It is positive even if all or none of the trials succeeded.
    """
    mean = (fraction * trials + 1) / (trials + 2)
    return np.sqrt(mean * (1 - mean) / (trials + 3))


def make_default_noise(targets: Targets) -> np.ndarray:
    """Return the covariance (k, k) of a run that is assumed if none is measured."""
    sd = DEFAULT_NOISE_PERCENT / 100 * targets.whole
    return np.outer(sd, sd) * targets.correlated(DEFAULT_CORRELATION)


def estimate_noise(
    runs: pd.DataFrame, targets: Targets, source: object = "runs"
) -> np.ndarray:
    """Estimate the noise of a run: the covariance within samples, the same for all.

    Responses of different bench tests (experiments) are independent, so their
    covariance is 0.

    Parameters
    ----------
    runs : pandas.DataFrame
        `sample`, `status` and the k responses.
    targets : Targets
        The targets of the study.
    source : object, optional
        File of the runs, for an error.

    Returns
    -------
    numpy.ndarray, (k, k)
        Covariance of a single run.

    Raises
    ------
    InputError
        If too few samples have two good runs, or if the runs of a sample do not differ.
    """
    noise = np.zeros((len(targets), len(targets)))
    for bench, columns in targets.benches.items():
        names = [targets.names[k] for k in columns]
        bench_runs = select_bench_runs(runs, bench)
        is_ok = bench_runs["status"] == "ok"
        is_good = is_ok & bench_runs[names].notna().all(axis=1)
        good = bench_runs[is_good]
        responses = good[names].to_numpy(float)
        covariance, degrees_of_freedom = estimate_within_covariance(
            responses, good["sample"]
        )
        # Each good run beyond the first of its sample is a degree of freedom. Runs with
        # the same results give a covariance without full rank.
        has_full_rank = np.linalg.matrix_rank(covariance) == len(columns)
        if degrees_of_freedom <= len(columns) or not has_full_rank:
            raise InputError(
                source=source,
                key="runs that determine the noise",
                value=degrees_of_freedom,
                allowed=(
                    f"at least {len(columns) + 1} good runs beyond the first of each "
                    "sample, and results that differ within the samples"
                ),
            )
        # Insert the block of this bench test in the rows and columns of its responses.
        noise[np.ix_(columns, columns)] = covariance
    return noise


def read_runs(path: StrPath, targets: Targets) -> pd.DataFrame:
    """Read the runs (runs.csv) of an earlier study, or of its beginning."""
    return read_table(path, ("sample", "status", *targets.names))
