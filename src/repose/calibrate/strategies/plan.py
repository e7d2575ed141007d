"""Before any pour: how many pours the noise asks for, and how probable success is with a budget.

The probabilities are in `success.csv`: shares of hidden parameter sets that whole campaigns of the sequential
strategy recovered, with six free parameters, in an emulated simulator whose pours scatter by some percents.
`research/answers/hidden_truths.py` writes it. Between two scatters of the table the shares are interpolated over the
logarithm of the scatter; outside of them the nearest row counts.
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
from repose.common.errors import require
from repose.common.files import Path_, read_table

SUCCESS = Path(__file__).with_name("success.csv")
# Scatter of a pour in percent of the target, and correlation of two responses of one bench test, of the default grain:
# taken where nothing is measured.
NOISE_PERCENT, CORRELATION = 5.0, 0.8
CERTAINTY = 0.9  # of the number of pours that the noise alone asks for
TOLERANCES = (1.0, 2.0)  # percent, as in the table


class Plan(NamedTuple):
    """Expected results of budgets of pours.

    `budgets` has `pours`, the probabilities `within_1_percent` and `within_2_percent` that the answer of the sequential
    strategy is so near to all targets, and `*_se`, their standard errors.
    """

    noise_percent: np.ndarray  # (k,), scatter of a pour, in percent of each target
    measured: bool  # whether the scatter comes from runs
    needed: dict[
        float, int
    ]  # pours by tolerance in percent, for the noise alone with `CERTAINTY`
    budgets: pd.DataFrame


def plan(
    space: ParameterSpace,
    targets: Targets,
    runs: pd.DataFrame | None = None,
    source: object = "runs",
) -> Plan:
    """Compute the expected results of budgets of pours.

    Parameters
    ----------
    space : ParameterSpace
    targets : Targets
    runs : pandas.DataFrame, optional
        Earlier runs, which show the noise; `default_noise` by default.
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
    needed = {
        tolerance: Goal.of(targets, tolerance, space).needed(noise, CERTAINTY)
        for tolerance in TOLERANCES
    }
    return Plan(
        percent, runs is not None, needed, chances(len(targets), float(percent.max()))
    )


def chances(responses: int, percent: float) -> pd.DataFrame:
    """Interpolate `Plan.budgets` for a number of targets, at most the table's, and the scatter of a pour in percent."""
    table = pd.read_csv(SUCCESS)
    table = table[
        table["responses"] == min(responses, table["responses"].max())
    ].sort_values("noise_percent")
    shares = [f"within_{tolerance:g}_percent" for tolerance in TOLERANCES]
    errors = {
        f"{name}_se": share_error(table[name], table["truths"]) for name in shares
    }
    columns, rows = ["pours", *shares, *errors], []
    for pours, own in table.assign(**errors).groupby("pours"):
        place = np.log(own["noise_percent"])
        rows.append(
            (
                pours,
                *(np.interp(np.log(percent), place, own[name]) for name in columns[1:]),
            )
        )
    return pd.DataFrame(rows, columns=columns)


def share_error(share: pd.Series, trials: pd.Series) -> pd.Series:
    """Compute the standard error of a probability known as a share of trials, also if all or none succeeded.

    It is the standard deviation of the beta distribution after these trials, from a uniform prior.
    """
    middle = (share * trials + 1) / (trials + 2)
    return np.sqrt(middle * (1 - middle) / (trials + 3))


def default_noise(targets: Targets) -> np.ndarray:
    """Return the covariance (k, k) of a pour if nothing is measured."""
    sd = NOISE_PERCENT / 100 * targets.whole
    return np.outer(sd, sd) * targets.correlated(CORRELATION)


def measured_noise(
    runs: pd.DataFrame, targets: Targets, source: object = "runs"
) -> np.ndarray:
    """Estimate a pour's covariance (k, k) about its sample's mean; InputError if too few samples have two ok runs."""
    noise = np.zeros((len(targets), len(targets)))
    for bench, own in targets.benches.items():
        names = [targets.names[k] for k in own]
        rows = of_bench(runs, bench)
        ok = rows[(rows["status"] == "ok") & rows[names].notna().all(axis=1)]
        covariance, freedom = within_covariance(ok[names].to_numpy(float), ok["sample"])
        allowed = f"at least {len(own) + 1} good runs beyond the first of a sample, not all alike"
        good = freedom > len(own) and np.linalg.matrix_rank(covariance) == len(own)
        require(good, source, "runs that determine the noise", freedom, allowed)
        noise[np.ix_(own, own)] = covariance
    return noise


def read_runs(path: Path_, targets: Targets) -> pd.DataFrame:
    """Read the runs (runs.csv) of an earlier study, or of its beginning."""
    return read_table(path, ("sample", "status", *targets.names))
