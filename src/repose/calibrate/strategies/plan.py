"""The number of runs that a calibration needs, estimated before its first run.

The noise alone asks for a number of runs, and a budget has a probability of success.

These probabilities are in `success.csv`: shares of hidden parameter sets that whole
campaigns of the sequential strategy recovered, with six free parameters, in an emulated
simulator whose runs scatter by some percents. `research/answers/hidden_truths.py` writes
it. Between two scatters of the table the shares are interpolated over the logarithm of
the scatter; outside of them the nearest row counts.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.runs import of_bench
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.targets import Targets
from repose.calibrate.variance import within_covariance
from repose.common.errors import InputError
from repose.common.files import Path_, read_table

SUCCESS = Path(__file__).with_name("success.csv")
# Noise of the default grain, where none is measured: the scatter of a run in percent of
# the target, and the correlation of two responses of one bench test.
NOISE_PERCENT = 5.0
CORRELATION = 0.8
# Certainty of the number of runs that the noise alone asks for.
CERTAINTY = 0.9
# Tolerances of the table, in percent.
TOLERANCES = (1.0, 2.0)


class Plan(NamedTuple):
    """Expected results of budgets of runs.

    Attributes
    ----------
    noise_percent : numpy.ndarray, (k,)
        Scatter of a run, in percent of each target.
    measured : bool
        Whether the scatter comes from runs.
    needed : dict
        Runs that the noise alone asks for with `CERTAINTY`, by tolerance in percent.
    budgets : pandas.DataFrame
        A row for each budget: `pours`, the number of runs; `within_1_percent` and
        `within_2_percent`, the probabilities that the answer of the sequential strategy
        is so near to all targets; `*_se`, their standard errors.
    """

    noise_percent: np.ndarray
    measured: bool
    needed: dict[float, int]
    budgets: pd.DataFrame


def plan(
    space: ParameterSpace,
    targets: Targets,
    runs: pd.DataFrame | None = None,
    source: object = "runs",
) -> Plan:
    """Compute the expected results of budgets of runs.

    Parameters
    ----------
    space : ParameterSpace
    targets : Targets
    runs : pandas.DataFrame, optional
        Earlier runs, from which the noise is estimated. Without them it is
        `default_noise`.
    source : object, optional
        File of the runs, for an error.

    Raises
    ------
    InputError
        If the runs have too few replicates.
    """
    if runs is None:
        noise = default_noise(targets)
    else:
        noise = measured_noise(runs, targets, source)
    percent = 100 * np.sqrt(np.diagonal(noise)) / targets.whole
    needed = {}
    for tolerance in TOLERANCES:
        goal = Goal.of(targets, tolerance, space)
        needed[tolerance] = goal.needed(noise, CERTAINTY)
    return Plan(
        noise_percent=percent,
        measured=runs is not None,
        needed=needed,
        budgets=success_by_budget(len(targets), float(percent.max())),
    )


def success_by_budget(n_targets: int, percent: float) -> pd.DataFrame:
    """Estimate how probably the sequential strategy succeeds with each budget.

    The probabilities come from the table `success.csv`, by interpolation over the
    logarithm of the scatter.

    Parameters
    ----------
    n_targets : int
        Number of targets. Beyond the largest number in the table, that one is used.
    percent : float
        Scatter of a run in percent of the target.

    Returns
    -------
    pandas.DataFrame
        The `budgets` of `Plan`.
    """
    table = pd.read_csv(SUCCESS)
    nearest_number = min(n_targets, table["responses"].max())
    table = table[table["responses"] == nearest_number].sort_values("noise_percent")

    # Add a column with the standard error of each probability.
    probabilities = [f"within_{tolerance:g}_percent" for tolerance in TOLERANCES]
    errors = [f"{name}_se" for name in probabilities]
    for name, error in zip(probabilities, errors, strict=True):
        table[error] = share_error(table[name], table["truths"])

    # Interpolate each column between the scatters of the table, for each budget.
    rows = []
    for pours, rows_of_budget in table.groupby("pours"):
        log_noise = np.log(rows_of_budget["noise_percent"])
        row = {"pours": pours}
        for name in (*probabilities, *errors):
            row[name] = np.interp(np.log(percent), log_noise, rows_of_budget[name])
        rows.append(row)
    return pd.DataFrame(rows, columns=["pours", *probabilities, *errors])


def share_error(share: pd.Series, trials: pd.Series) -> pd.Series:
    """Compute the standard error of a probability from the share of successful trials.

    It is the standard deviation of the beta distribution after these trials, from a
    uniform prior. So it is positive also where all or none succeeded.
    """
    mean = (share * trials + 1) / (trials + 2)
    return np.sqrt(mean * (1 - mean) / (trials + 3))


def default_noise(targets: Targets) -> np.ndarray:
    """Return the covariance (k, k) of a run if nothing is measured."""
    sd = NOISE_PERCENT / 100 * targets.whole
    return np.outer(sd, sd) * targets.correlated(CORRELATION)


def measured_noise(
    runs: pd.DataFrame, targets: Targets, source: object = "runs"
) -> np.ndarray:
    """Estimate the covariance (k, k) of single runs about the mean of their sample.

    Responses of different bench tests are independent, so their covariance is 0.

    Parameters
    ----------
    runs : pandas.DataFrame
        `sample`, `status` and the k responses.
    targets : Targets
    source : object, optional
        File of the runs, for an error.

    Raises
    ------
    InputError
        If too few samples have two good runs.
    """
    noise = np.zeros((len(targets), len(targets)))
    for bench, columns in targets.benches.items():
        names = [targets.names[k] for k in columns]
        runs_of_test = of_bench(runs, bench)
        is_ok = runs_of_test["status"] == "ok"
        is_good = is_ok & runs_of_test[names].notna().all(axis=1)
        good = runs_of_test[is_good]
        values = good[names].to_numpy(float)
        covariance, freedom = within_covariance(values, good["sample"])
        has_full_rank = np.linalg.matrix_rank(covariance) == len(columns)
        if freedom <= len(columns) or not has_full_rank:
            allowed = (
                f"at least {len(columns) + 1} good runs beyond the first of a sample, "
                "not all alike"
            )
            raise InputError(source, "runs that determine the noise", freedom, allowed)
        # Insert the block of this bench test in the rows and columns of its responses.
        noise[np.ix_(columns, columns)] = covariance
    return noise


def read_runs(path: Path_, targets: Targets) -> pd.DataFrame:
    """Read the runs (runs.csv) of an earlier study, or of its beginning."""
    return read_table(path, ("sample", "status", *targets.names))
