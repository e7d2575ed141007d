"""Read the tables of a study, and check that they are complete and consistent.

The columns alone do not show whether a table was truncated, or belongs to another
study. Therefore the rows are checked as well.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS, check_value, parameters_among
from repose.calibrate.dataset_files import read_summary
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table

# Largest difference between a stored mean or standard error and the value that follows
# from its runs. The difference is relative, or absolute for values below 1.
TOLERANCE = 1e-6


def read_dataset(
    dataset_csv: StrPath, targets: Targets, parameter_names: Sequence[str] | None = None
) -> pd.DataFrame:
    """Read the table of samples, and check it.

    Parameters
    ----------
    dataset_csv : path
        The table. The summary next to it states how many samples it should have.
    targets : Targets
        The targets, whose responses the table must have.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    pandas.DataFrame
        A row for each sample: its number, parameters and status, the number of its good
        runs, and the mean of each response with its standard error.

    Raises
    ------
    InputError
        If rows or columns are missing or repeated, or a value is impossible.
    """
    parameters = PARAMETERS if parameter_names is None else parameter_names
    dataset = read_table(
        dataset_csv,
        ("sample", *parameters, "status", "n_seeds", *targets.names, *targets.errors),
    )
    _check_number_of_rows(
        dataset, dataset_csv, _read_expected_rows(dataset_csv, "samples")
    )
    _reject_repeated_rows(dataset, ["sample"], dataset_csv)
    if parameter_names is None:
        _check_contact_parameters(dataset, dataset_csv)
    _check_responses(dataset, targets, dataset_csv)
    return dataset


def _check_contact_parameters(dataset: pd.DataFrame, path: StrPath) -> None:
    """Raise an InputError if a contact parameter is beyond its physical limits."""
    parameter_sets = dataset[list(parameters_among(dataset))].to_dict("records")
    for row, parameters in enumerate(parameter_sets, start=1):
        for name, value in parameters.items():
            check_value(name, value, f"{path}, row {row}")


def read_runs(
    runs_csv: StrPath, targets: Targets, dataset: pd.DataFrame, dataset_csv: StrPath
) -> pd.DataFrame:
    """Read the table of single runs, and check it against the table of samples.

    Parameters
    ----------
    runs_csv : path
        The table of runs.
    targets : Targets
        The targets, whose responses the table must have.
    dataset : pandas.DataFrame
        The table of samples.
    dataset_csv : path
        File of the table of samples. The file dataset_summary.json next to it states
        how many runs there should be.

    Returns
    -------
    pandas.DataFrame
        A row for each run: sample, seed, status, and the responses.

    Raises
    ------
    InputError
        If rows are missing or repeated, a value is impossible, or the samples or their
        means differ from those in `dataset`.
    """
    runs = read_table(runs_csv, ("sample", "seed", "status", *targets.names))
    # The column `apparatus` names the bench test of each run. It exists only if the
    # study has several bench tests.
    has_several_bench_tests = "apparatus" in runs
    key_columns = ["sample", "seed"]
    if has_several_bench_tests:
        key_columns.append("apparatus")
    _reject_repeated_rows(runs, key_columns, runs_csv)
    # With several bench tests, a run has only the responses of its own bench test. The
    # cells of the other responses are empty, which this check would report.
    if not has_several_bench_tests:
        _check_responses(runs, targets, runs_csv)
    _check_number_of_rows(runs, runs_csv, _read_expected_rows(dataset_csv, "runs"))

    unmatched_samples = set(runs["sample"]).symmetric_difference(dataset["sample"])
    if unmatched_samples:
        raise InputError(
            runs_csv,
            key="sample",
            value=min(unmatched_samples),
            allowed=f"the same samples as in {dataset_csv}",
        )
    # The table of samples has a single number of good runs, the smallest one of all
    # bench tests. With several bench tests, the checks below would compare different
    # things.
    if not has_several_bench_tests:
        _check_run_counts(runs, dataset, runs_csv=runs_csv, dataset_csv=dataset_csv)
        _check_means(
            runs, dataset, targets=targets, runs_csv=runs_csv, dataset_csv=dataset_csv
        )
    return runs


def find_answer(table: pd.DataFrame, source: object) -> pd.Series:
    """Find the answer in a table of parameter sets that were simulated again.

    Parameters
    ----------
    table : pandas.DataFrame
        A row for each set, with its `role`, such as table4.csv.
    source : object
        The file of the table, for the message.

    Returns
    -------
    pandas.Series
        The row with the role ``representative``.

    Raises
    ------
    InputError
        If there is no such row.
    """
    rows = table[table["role"] == "representative"]
    if rows.empty:
        raise InputError(
            source, key="role", value=None, allowed="a row with the role representative"
        )
    return rows.iloc[0]


def _check_run_counts(
    runs: pd.DataFrame, dataset: pd.DataFrame, runs_csv: StrPath, dataset_csv: StrPath
) -> None:
    """Raise an InputError unless each sample has `n_seeds` good runs."""
    good_runs = runs[runs["status"] == "ok"]
    counts = good_runs.groupby("sample").size()
    for sample, n_seeds in zip(dataset["sample"], dataset["n_seeds"], strict=True):
        count = int(counts.get(sample, 0))
        if count != n_seeds:
            raise InputError(
                f"{runs_csv}, sample {sample}",
                key="ok runs",
                value=count,
                allowed=f"{n_seeds:g}, the n_seeds of this sample in {dataset_csv}",
            )


def _check_means(
    runs: pd.DataFrame,
    dataset: pd.DataFrame,
    targets: Targets,
    runs_csv: StrPath,
    dataset_csv: StrPath,
) -> None:
    """Raise an InputError if the means of runs differ from those of their samples.

    The standard errors of the means are compared, too. With a single run, the standard
    error is NaN in both tables, which counts as equal.

    Parameters
    ----------
    runs, dataset : pandas.DataFrame
        Single runs of one bench test, and their samples.
    targets : Targets
        The targets of the study.
    runs_csv, dataset_csv : path
        The files of both tables, for the message.
    """
    samples = dataset[dataset["status"] == "ok"].set_index("sample")
    good_runs = runs[runs["status"] == "ok"]
    # The index of both results is the sample. `sem` is the standard error of a mean.
    runs_by_sample = good_runs.groupby("sample")[list(targets.names)]
    means = runs_by_sample.mean().reindex(samples.index)
    standard_errors = runs_by_sample.sem().reindex(samples.index)

    # Pair the quantities that follow from the runs with the columns of the samples.
    comparisons = (
        ("mean", means, targets.names),
        ("standard error", standard_errors, targets.errors),
    )
    for quantity, computed, columns in comparisons:
        for name, column in zip(targets.names, columns, strict=True):
            _require_equal(
                computed[name].astype(float),
                samples[column].astype(float),
                quantity=quantity,
                response=name,
                runs_csv=runs_csv,
                dataset_csv=dataset_csv,
            )


def _require_equal(
    computed: pd.Series,
    stored: pd.Series,
    quantity: str,
    response: str,
    runs_csv: StrPath,
    dataset_csv: StrPath,
) -> None:
    """Raise an InputError if a mean or standard error differs from the stored one.

    Parameters
    ----------
    computed, stored : pandas.Series
        The quantity of each sample, from its runs and from the table of samples. Both
        have the samples as index.
    quantity, response : str
        Names of the quantity and the response, for the message.
    runs_csv, dataset_csv : path
        The tables, for the message.
    """
    is_equal = np.isclose(
        computed, stored, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True
    )
    if is_equal.all():
        return
    sample = stored.index[~is_equal][0]
    raise InputError(
        f"{runs_csv}, sample {sample}",
        key=f"{quantity} of {response}",
        value=float(computed[sample]),
        allowed=f"{stored[sample]:.6g}, its {quantity} in {dataset_csv}",
    )


def _check_responses(table: pd.DataFrame, targets: Targets, path: StrPath) -> None:
    """Check that each row with the status ok has all responses, inside their limits.

    Parameters
    ----------
    table : pandas.DataFrame
        Samples or single runs, with their `status` and all responses.
    targets : Targets
        The targets of the study.
    path : path
        File of the table, for the message.

    Raises
    ------
    InputError
        If a response is missing or outside its limits.
    """
    is_ok = table["status"] == "ok"
    for target in targets:
        values = table[target.name]
        low = target.response.low
        high = target.response.high
        # NaN is never between the limits, so this also finds missing numbers.
        is_wrong = is_ok & ~values.between(low, high)
        if is_wrong.any():
            # `argmax` finds the first True. Messages number the rows from 1.
            first_wrong = int(is_wrong.to_numpy().argmax())
            raise InputError(
                f"{path}, row {first_wrong + 1}",
                key=target.name,
                value=float(values.iloc[first_wrong]),
                allowed=f"a number from {low:g} to {high:g}, as the status is ok",
            )


def _reject_repeated_rows(
    table: pd.DataFrame, columns: list[str], path: StrPath
) -> None:
    """Raise an InputError if two rows have the same values in these columns."""
    is_repeated = table[columns].duplicated().to_numpy()
    if is_repeated.any():
        row = int(is_repeated.argmax())
        value = table[columns].iloc[row].tolist()
        key = " and ".join(columns)
        raise InputError(
            f"{path}, row {row + 1}", key=key, value=value, allowed="each once"
        )


class _ExpectedRows(NamedTuple):
    """The number of rows that a table should have, and the source of this number."""

    number: int | None  # None if it is unknown
    source: str


def _read_expected_rows(dataset_csv: StrPath, key: str) -> _ExpectedRows:
    """Read the number of samples or of runs from the summary of a dataset.

    Parameters
    ----------
    dataset_csv : path
        The table of samples.
    key : str
        The number to read, `samples` or `runs`.
    """
    summary, summary_json = read_summary(dataset_csv)
    return _ExpectedRows(summary.get(key), f"the {key} of {summary_json}")


def _check_number_of_rows(
    table: pd.DataFrame, path: StrPath, expected: _ExpectedRows
) -> None:
    """Raise an InputError unless a table has the expected number of rows."""
    if expected.number is not None and len(table) != expected.number:
        raise InputError(
            path,
            key="rows",
            value=len(table),
            allowed=f"{expected.number}, {expected.source}",
        )
