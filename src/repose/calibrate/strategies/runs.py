"""Read and check the table of all runs of a study, and summarise it by sample."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.runs import mean_and_error
from repose.calibrate.strategies.base import strategy
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.calibrate.units import describe_other_units
from repose.common.errors import InputError
from repose.common.files import TURN_COLUMN, StrPath
from repose.common.tables import (
    CellFault,
    Column,
    Fault,
    convert_columns,
    describe_unread,
    holds_numbers,
    is_missing,
    match_column_names,
    parse_number,
    read,
    read_sheet,
    refuse,
    require_columns,
)

OK = "ok"
# Status of a run that reported no failure, but has a response that is no finite number.
FAILED = "failed"
# Statuses of a good run. Numbers such as 0 and 1 are excluded, as they are ambiguous.
GOOD_STATUSES = (
    OK,
    "success",
    "successful",
    "done",
    "finished",
    "completed",
    "converged",
    "passed",
    "valid",
    "true",
    "yes",
)
Rows = Sequence[Mapping[str, Any]]
Table: TypeAlias = pd.DataFrame | Rows
# A number as pandas and spreadsheets write it in a column of whole numbers with gaps.
WHOLE_NUMBER = re.compile(r"\d+\.0")
# Columns that identify a run by the number of its sample, and its own number within it.
NUMBER_COLUMNS = ("sample", "run")
# Checks of these columns if most of their cells are numbers.
NUMBERS_OF = {
    key: Column(key, words="a finite number, as most cells of this column")
    for key in NUMBER_COLUMNS
}
TURN_NUMBERS = Column(TURN_COLUMN, int, low=0, high=1e9, may_be_empty=True)
OPTIONAL_COLUMNS = ("status", TURN_COLUMN)
# The largest size of a response; a larger one counts as infinite.
MAX_RESPONSE = 1e100
RESPONSE_WORDS = "a finite number, or for a failed run NaN"
# Statuses in a message are cut after this number of characters: the list of all
# statuses, and a single one.
MAX_STATUSES_LENGTH = 60
MAX_STATUS_LENGTH = 30
# Responses are linearly dependent if an eigenvalue of their correlation matrix is at
# most this large. It would be 0 without rounding errors.
DEPENDENT_EIGENVALUE = 1e-12
# Smallest component of a response in the eigenvector of a linear dependence. Smaller
# components are rounding errors of responses that are not involved.
MIN_COMPONENT = 1e-6
# Largest error of a parameter, as a fraction of its range, from rounding by a
# spreadsheet.
MAX_ROUNDING_FRACTION = 1e-6
# Names of samples with at most this many digits are kept as numbers.
MAX_DIGITS = 9
# Largest number of statuses of failed runs that a message lists.
MAX_STATUSES = 5


class MergedRows(NamedTuple):
    """The source of a table with the rows of a record and the rows to add to it.

    Attributes
    ----------
    record : object
        The file of the record.
    added : object
        The file of the rows to add.
    recorded_rows : sequence of int
        Numbers of the record's rows that are in the table, counted from 1. They are the
        first rows of the table.
    """

    record: object
    added: object
    recorded_rows: Sequence[int]

    def __str__(self) -> str:
        return f"{self.record} with {self.added}"


def list_runs(samples: pd.DataFrame) -> pd.DataFrame:
    """Make a table with a row for each run of the samples of a batch.

    The runs of a sample differ only in the random numbers of the simulator.

    Returns
    -------
    pandas.DataFrame
        `sample`, `run` from 1, and the parameters.
    """
    repeated = samples.loc[samples.index.repeat(samples["seeds"])]
    table = repeated.drop(columns="seeds").reset_index(drop=True)
    table.insert(1, "run", table.groupby("sample").cumcount() + 1)
    return table


def find_next_sample(data: pd.DataFrame) -> int:
    """Return the number of a new sample.

    It follows the largest number, or the number of samples if some are no numbers.
    """
    numbers = pd.to_numeric(data["sample"], errors="coerce")
    if numbers.notna().all():
        return int(numbers.max()) + 1
    return data["sample"].nunique() + 1


def check_responses(data: pd.DataFrame, targets: Targets) -> None:
    """Raise an error if the responses are constant or depend linearly on each other.

    No model can be fitted to such responses.

    Parameters
    ----------
    data : pandas.DataFrame
        A row for each run, with a column for each response; NaN for a run that failed.
    targets : Targets

    Raises
    ------
    InputError
        If a response is the same in all good runs, or depends linearly on the others.
    """
    names = list(targets.names)
    for name in names:
        n_runs = data[name].count()
        if n_runs >= 2 and data[name].nunique() <= 1:
            raise InputError(
                source="runs",
                key=name,
                value=float(data[name].max()),
                allowed=(
                    f"results that differ; all {n_runs} good runs have this one: "
                    "is the right column read?"
                ),
            )

    # With at most k runs, the correlation matrix of k responses is always singular, and
    # with k + 1 runs it may be almost singular by chance. So skip the check then.
    complete = data[names].dropna()
    if len(complete) <= len(names) + 1:
        return

    # If responses are linearly dependent, the smallest eigenvalue of their correlation
    # matrix is 0, and the components of its eigenvector show which responses these are.
    # The eigenvalues are sorted, the smallest first.
    eigenvalues, eigenvectors = np.linalg.eigh(complete.corr())
    # With `not ... >` rather than `<=`, NaN also counts as a dependence.
    if not eigenvalues[0] > DEPENDENT_EIGENVALUE:
        dependent = [
            name
            for name, component in zip(names, eigenvectors[:, 0], strict=True)
            if abs(component) > MIN_COMPONENT
        ]
        raise InputError(
            source="runs",
            key="targets",
            value=", ".join(dependent),
            allowed=(
                "responses that cannot be computed from each other: leave one of them "
                "out"
            ),
        )


def summarise_samples(
    data: pd.DataFrame, space: ParameterSpace, targets: Targets
) -> pd.DataFrame:
    """Compute the mean responses of each sample and their standard errors.

    A sample is ok if at least half of its runs are good, and at least one. Otherwise it
    is failed, and its means and standard errors are NaN. The stage `dataset` of the
    workflow makes a table with the same columns (`repose.calibrate.runs`).

    Parameters
    ----------
    data : pandas.DataFrame
        A row for each run: `sample`, parameters and responses. The responses of a
        failed run are NaN.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study, which name the responses.

    Returns
    -------
    pandas.DataFrame
        `sample`, parameters, `status`, `reason` (always empty here), `n_seeds` (number
        of good runs), means and standard errors.
    """
    responses = list(targets.names)
    rows = []
    for sample, runs in data.groupby("sample", sort=False):
        # The bench tests of a run fail separately, so the responses may have different
        # numbers of values. The smallest of these numbers counts.
        n_good = int(runs[responses].count().min())
        is_ok = n_good > 0 and 2 * n_good >= len(runs)
        row = {
            "sample": sample,
            **runs.iloc[0][list(space.names)],
            "status": OK if is_ok else FAILED,
            "reason": "",
            "n_seeds": n_good,
        }
        for name, error_name in zip(targets.names, targets.errors, strict=True):
            good_values = runs[name].dropna() if is_ok else ()
            mean, error = mean_and_error(good_values)
            row[name] = mean
            row[error_name] = error
        rows.append(row)
    number_columns = (*targets.names, *targets.errors)
    return pd.DataFrame(rows).astype(dict.fromkeys(number_columns, float))


def split_by_bench(data: pd.DataFrame, targets: Targets) -> pd.DataFrame:
    """Split each run into a row for each bench test, as in the table of the workflow.

    Parameters
    ----------
    data : pandas.DataFrame
        A row for each run, with the responses of all bench tests.
    targets : Targets

    Returns
    -------
    pandas.DataFrame
        A row for each run and bench test: `sample`, its responses, `apparatus` (the
        name of the bench test), `status` and `reason` (always empty here).
    """
    tables = []
    for bench, columns in targets.benches.items():
        names = [targets.names[k] for k in columns]
        is_complete = data[names].notna().all(axis=1)
        table = data[["sample", *names]].assign(
            apparatus=bench,
            status=np.where(is_complete, OK, FAILED),
            reason="",
        )
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def read_runs(path: StrPath, study: Study) -> pd.DataFrame:
    """Read a CSV file of runs and check it by `checked_runs`."""
    return checked_runs(study, read_rows(path, study), path)


def list_columns(study: Study) -> tuple[str, ...]:
    """Return the names of the columns that are read from a table of runs."""
    return (
        *NUMBER_COLUMNS,
        *OPTIONAL_COLUMNS,
        *study.parameters.names,
        *study.targets.names,
    )


def describe_unread_columns(study: Study, rows: Rows) -> dict[str, str]:
    """Describe the columns of a table of runs that are not read and whose values vary.

    Such a column may mark failed runs under another name than `status`.

    Returns
    -------
    dict of str to str
        A sentence by the name of the column.
    """
    names = dict.fromkeys(name for row in rows for name in row)
    read_names = list_columns(study)
    cells = {
        name: [row.get(name) for row in rows]
        for name in names
        if name not in read_names
    }
    name_it = (
        "; where it says whether a run is good, name it status, with ok for a good run"
    )
    return describe_unread(cells, hint_if_few=name_it)


def describe_probable_units(study: Study, rows: Rows) -> dict[str, str]:
    """Describe the responses of a table of runs that are probably in another unit.

    Returns
    -------
    dict of str to str
        A sentence by the name of the response (`describe_other_units`).
    """
    names = study.targets.names
    columns = ("status", *names)
    cells = {name: [row.get(name) for row in rows] for name in columns}
    return describe_other_units(study.targets, judge_runs(cells, names).values)


def read_rows(path: StrPath, study: Study) -> Rows:
    """Read the rows of a CSV file of runs as text.

    Parameters
    ----------
    path : path
        The file.
    study : Study
        Its column names replace those with a slightly different spelling.

    Returns
    -------
    sequence of mapping
        The cells of each row by column. They are checked later, with all other runs.

    Raises
    ------
    InputError
        If the file is not a table, or if only some of the rows have a sample or a run.
    """
    # Accept any cell of a parameter or a response here. `checked_runs` checks them.
    names = (TURN_COLUMN, *study.parameters.names, *study.targets.names)
    columns = [Column(name, object, needed=False) for name in names]
    status = Column("status", str, needed=False, may_be_empty=True)
    needed_names = ", ".join([*study.parameters.free, *study.targets.names])
    expected = f"a CSV file of runs with the columns {needed_names}"

    # Only a file that a study wrote has the column of the turns. Such a file also has
    # the unread columns of all tables that were added to it, which may mix numbers and
    # text, so these columns are not checked. `read` also rejects a row that looks like
    # a summary of the rows above it, such as their mean. The failed runs of a record
    # are left out of this check, because their numbers may be all the same.
    is_record = TURN_COLUMN in read_sheet(path, expected, names).text
    table = read(
        path,
        [*columns, status],
        expected,
        is_number_column=_holds_no_numbers if is_record else holds_numbers,
        optional=NUMBER_COLUMNS,
        find_unused_rows=_find_failed_rows if is_record else None,
    )
    for key in NUMBER_COLUMNS:
        if key in table.values:
            cells = strip_decimal_points(table.values[key])
            _check_numbers(key, cells, path)
            table.values[key] = cells
    return table.rows()


def _check_numbers(key: str, cells: Sequence[str], path: StrPath) -> None:
    """Raise an error for each empty or invalid cell of `sample` or `run`.

    The column is optional, but if a table has it, no cell may be empty. Names of
    samples may also be text. But if most cells are numbers, all of them must be.

    Parameters
    ----------
    key : str
        Name of the column, one of `NUMBER_COLUMNS`.
    cells : sequence of str
        The cells of the column.
    path : path
        The file, for the error.
    """
    allowed = (
        "a number, as in the other rows; merged cells need it in each row, and a "
        "row of units or means is no run"
    )
    faults: list[Fault] = [
        CellFault(row, column=key, value="", allowed=allowed)
        for row, cell in enumerate(cells)
        if not cell
    ]
    if holds_numbers(cells):
        _, invalid_numbers = convert_columns({key: cells}, [NUMBERS_OF[key]])
        # The list above already has the empty cells.
        faults += [fault for fault in invalid_numbers if cells[fault[0]]]
    refuse(path, faults)


def _holds_no_numbers(cells: Iterable[str]) -> bool:
    """Return False for any cells, so that no column is taken for a column of numbers."""
    return False


def _find_failed_rows(cells: pd.DataFrame) -> set[int]:
    """Find the rows whose status says that the run failed."""
    if "status" not in cells:
        return set()
    statuses = cells["status"].tolist()
    return {row for row, cell in enumerate(statuses) if _read_status(cell) != OK}


def strip_decimal_points(cells: Iterable[Any]) -> list[str]:
    """Convert numbers of samples or runs to text, without an added ".0".

    Pandas and spreadsheets write whole numbers as 3.0 if some cells are empty. The
    ending is removed only if all cells have it.
    """
    texts = [str(cell).strip() for cell in cells]
    if all(map(WHOLE_NUMBER.fullmatch, texts)):
        return [text[:-2] for text in texts]
    return texts


def checked_runs(
    study: Study, rows: Table, source: object = "runs", enough: bool = True
) -> pd.DataFrame:
    """Check a table of runs, and convert its cells to numbers.

    The columns ``sample``, ``run``, ``status`` and those of fixed parameters are
    optional. So are the responses if every run failed, as decided by `judge_runs`. Rows
    with the same parameters are replicates. Unless the table numbers the samples, they
    are numbered in the order of their first run.

    Parameters
    ----------
    study : Study
        Its parameters and targets name the columns.
    rows : pandas.DataFrame or sequence of mapping
        The table, such as the result of `read_rows`.
    source : object, optional
        The file that an error names. If the rows come from two files, `MergedRows`
        tells which row comes from which file.
    enough : bool, optional
        Whether the table must have enough good samples for a model.

    Returns
    -------
    pandas.DataFrame
        ``sample``, ``status``, parameters and responses. The turn of each run, which is
        the number of the proposal that asked for it, is in ``attrs[TURN_COLUMN]``.

    Raises
    ------
    InputError
        If a column is missing or cells are invalid. The error lists all invalid cells.
    """
    if isinstance(rows, pd.DataFrame):
        rows = rows.to_dict("records")
    if not rows:
        raise InputError(
            source=source,
            key="rows",
            value=0,
            allowed="a header and a row for each run",
        )
    space = study.parameters
    parameters = list(space.names)
    responses = study.targets.names
    new_names = match_column_names(rows[0], list_columns(study))
    rows = [{new_names.get(key, key): row[key] for key in row} for row in rows]
    needed = list_needed_responses(study, [row.get("status") for row in rows])
    require_columns(source, rows[0], (*space.free, *needed))
    rows = add_missing_columns(rows, study)
    columns = (*parameters, *responses, *OPTIONAL_COLUMNS)
    cells = {name: [row.get(name) for row in rows] for name in columns}

    # Check all columns before raising an error, so that it lists all invalid cells.
    low, high = space.add_fixed_values(np.array([space.low, space.high]))
    parameter_columns = map(
        _describe_parameter_column, parameters, low.tolist(), high.tolist()
    )
    sets, faults_of_sets = convert_columns(cells, parameter_columns)
    outcomes = judge_runs(cells, responses)
    turns, faults_of_turns = convert_columns(cells, [TURN_NUMBERS])
    _reject_rows(source, [*faults_of_sets, *outcomes.faults, *faults_of_turns])

    table = pd.DataFrame({"status": outcomes.statuses, **sets, **outcomes.values})
    # A rounded parameter may lie slightly outside its range, so clip it.
    table[parameters] = np.clip(table[parameters].to_numpy(float), low, high)
    numbers = _number_samples(table[parameters], rows, study, source)
    table.insert(0, "sample", numbers)
    table.attrs[TURN_COLUMN] = np.nan_to_num(turns[TURN_COLUMN]).astype(int).tolist()
    _reject_repeated_rows(table, rows, source)
    if enough:
        _require_enough_samples(table, space, source)
    return table


@contextmanager
def name_file_of_runs(file: object) -> Iterator[None]:
    """Name the file of the runs in an error about the runs.

    A strategy and a model do not know the file, so their errors have the source `runs`.

    Parameters
    ----------
    file : object
        The file; None for runs that have no file.

    Raises
    ------
    InputError
        The error that the block raises, with the file as its source.
    """
    try:
        yield
    except InputError as error:
        if file is None or error.source != "runs":
            raise
        raise InputError(file, error.key, error.value, error.allowed) from None


class Outcomes(NamedTuple):
    """Which runs failed, and the responses of the others."""

    statuses: list[str]  # of each run; `OK` for a good one
    # Responses by name; NaN in all of them for a run that failed.
    values: dict[str, list[float]]
    faults: list[Fault]  # invalid cells


def judge_runs(
    cells: Mapping[str, Sequence[Any]], responses: Sequence[str]
) -> Outcomes:
    """Decide which runs failed, and remove their responses.

    A run is good if each response is a finite number and its status is good or missing.
    Any other run failed: it stays in the table, but no model is fitted to it. This
    holds for runs from a file, from `Study.tell` and from `Study.calibrate`.

    Parameters
    ----------
    cells : mapping of str to sequence
        Cells of `status` and of the responses by column. Columns may be missing.
    responses : sequence of str
        Names of the responses.

    Returns
    -------
    Outcomes
        Statuses, responses and invalid cells. Text as a response is invalid, and so is
        a number as a status. No error is raised for them here.
    """
    n_runs = len(next(iter(cells.values())))
    empty_column = [None] * n_runs

    # Read the statuses; a missing one counts as `OK`. A number is invalid, because it
    # may mean success or failure.
    statuses = [_read_status(cell) for cell in cells.get("status", empty_column)]
    invalid_statuses = [
        CellFault(
            row,
            column="status",
            value=status,
            allowed="ok, or a word such as failed",
        )
        for row, status in enumerate(statuses)
        if holds_numbers([status])
    ]

    # Read the responses. In a run whose status reports a failure, any cell is valid.
    failed_rows = {row for row, status in enumerate(statuses) if status != OK}
    numbers = {
        name: [_replace_infinite(cell) for cell in cells.get(name, empty_column)]
        for name in responses
    }
    columns = [
        Column(name, may_be_empty=True, words=RESPONSE_WORDS) for name in responses
    ]
    # The responses in `failed_rows` become NaN.
    values, invalid_responses = convert_columns(numbers, columns, failed_rows)

    # If one response of a run is missing, the run failed. Remove its other responses.
    is_complete = np.isfinite(list(values.values())).all(axis=0)
    for row in np.flatnonzero(~is_complete):
        if statuses[row] == OK:
            statuses[row] = FAILED
        for column in values.values():
            column[row] = math.nan
    return Outcomes(statuses, values, [*invalid_statuses, *invalid_responses])


def make_cells(
    result: Mapping[Any, Any], responses: Sequence[str], names: Iterable[str] = ()
) -> tuple[dict[str, Any], str]:
    """Convert what the user's function returned for a run to the cells of a table row.

    `judge_runs` finds no invalid cell in this row. A mistake in the result makes the
    run a failed one, but raises no error, because a long calibration has to continue.

    Parameters
    ----------
    result : mapping
        The responses by name. It may also have a `status` and other values.
    responses : sequence of str
        Names of the responses.
    names : iterable of str, optional
        Names of the columns of a table of runs. A key of the result that differs from
        a name only in its spelling (`match_column_names`) is renamed.

    Returns
    -------
    cells : dict
        The row by column; a response without a valid number is NaN.
    missing : str
        What the result lacks by mistake, as a phrase for a message, such as ``a number
        for angle_deg``. It is empty if there is no mistake, or if the function reported
        the failure itself.
    """
    named = {str(key): value for key, value in result.items()}
    new_names = match_column_names(named, names)
    cells = {new_names.get(key, key): value for key, value in named.items()}
    invalid_responses = []
    for name in responses:
        # A value such as NaN or None is not a mistake: it reports that the run failed.
        is_marked_as_missing = name in cells and is_missing(cells[name])
        try:
            # This raises a KeyError if the response is missing.
            cells[name] = parse_number(cells[name])
        except (KeyError, TypeError, ValueError, OverflowError):
            cells[name] = math.nan
            if not is_marked_as_missing:
                invalid_responses.append(name)

    # `judge_runs` reports a number as an invalid status, because it may mean success or
    # failure. Put a word before it: any unknown text means failure.
    status = cells.get("status")
    if not is_missing(status) and holds_numbers([str(status)]):
        cells["status"] = f"status {status}"
        # This mistake explains the failure, whether or not responses are missing.
        return cells, "a word such as ok as status"

    # An empty result or a status of failure reports that the run failed.
    reports_failure = not result or _read_status(status) != OK
    if reports_failure or not invalid_responses:
        return cells, ""
    return cells, f"a number for {', '.join(invalid_responses)}"


def find_unknown_status(cells: Mapping[str, Any], responses: Sequence[str]) -> str:
    """Return the status of a run that failed although it has all responses.

    It may be a word for a good run that is not among `GOOD_STATUSES`. The result is
    empty for any other run.

    Parameters
    ----------
    cells : mapping
        The row of the run, as `make_cells` returns it.
    responses : sequence of str
        Names of the responses.
    """
    status = _read_status(cells.get("status"))
    has_numbers = all(math.isfinite(cells[name]) for name in responses)
    return status if status != OK and has_numbers else ""


def describe_failures(statuses: Iterable[str]) -> str:
    """List the statuses of the runs that failed, such as ``status jammed: 2, failed: 1``.

    Parameters
    ----------
    statuses : iterable of str
        The status of each run.

    Returns
    -------
    str
        It begins with the most common status, and is empty if no run failed.
    """
    counts = Counter(status for status in statuses if status != OK)
    texts = [
        f"{status[:MAX_STATUS_LENGTH]}: {n}"
        for status, n in counts.most_common(MAX_STATUSES)
    ]
    others = len(counts) - len(texts)
    more = f" and {others} others" if others else ""
    return f"status {', '.join(texts)}{more}" if texts else ""


def count_runs_without_results(rows: Rows, study: Study) -> int:
    """Count the rows without any response and without a status.

    Parameters
    ----------
    rows : sequence of mapping
        The rows of a table of runs, as `read_rows` returns them.
    study : Study
    """
    return sum(
        is_missing(row.get("status")) and has_no_results(row, study) for row in rows
    )


def has_no_results(row: Mapping[str, Any], study: Study) -> bool:
    """Tell whether a row of a table of runs has no response at all."""
    return all(is_missing(row.get(name)) for name in study.targets.names)


def list_needed_responses(
    study: Study, statuses: Iterable[Any] | None
) -> tuple[str, ...]:
    """Return the names of the responses that a table of runs must have.

    A table needs no response if the status of every run reports a failure.
    """
    is_needed = statuses is None or OK in map(_read_status, statuses)
    return tuple(study.targets.names) if is_needed else ()


def _read_status(cell: Any) -> str:
    """Read the status of a run; `OK` if it is missing or one of `GOOD_STATUSES`."""
    status = OK if cell is None or is_missing(cell) else str(cell).strip()
    return OK if status.casefold() in GOOD_STATUSES else status


def _replace_infinite(cell: Any) -> Any:
    """Return NaN for an infinite number, and any other cell as it is."""
    try:
        is_infinite = abs(parse_number(cell)) > MAX_RESPONSE
    except (TypeError, ValueError, OverflowError):
        return cell
    return math.nan if is_infinite else cell


def _require_enough_samples(
    table: pd.DataFrame, space: ParameterSpace, source: object
) -> None:
    """Raise an error if a table has too few good samples for a model.

    A sample is good here if at least one of its runs is.

    Parameters
    ----------
    table : pandas.DataFrame
        The checked table, with `sample` and `status`.
    space : ParameterSpace
        The parameters of the study.
    source : object
        File of the table, for the error.

    Raises
    ------
    InputError
        If there are fewer than two more samples than free parameters.
    """
    n_good = table[table["status"] == OK]["sample"].nunique()
    minimum = space.dimensions + 2
    if n_good >= minimum:
        return
    allowed = f"at least {minimum}, two more than the free parameters"
    # Failed runs may be the reason, so name their statuses.
    failures = sorted(set(table["status"]) - {OK})
    if failures:
        statuses = ", ".join(failures)[:MAX_STATUSES_LENGTH]
        allowed += f"; runs with the status {statuses} failed"
    raise InputError(
        source=source,
        key="samples with a good run",
        value=n_good,
        allowed=allowed,
    )


def _describe_parameter_column(name: str, low: float, high: float) -> Column:
    """Declare the column of a parameter, with a tolerance for rounded numbers."""
    size = (high - low) or abs(high) or 1.0
    slack = MAX_ROUNDING_FRACTION * size
    if low == high:
        allowed = f"{low:g}, as it is fixed"
    else:
        allowed = f"a number from {low:g} to {high:g}, its range"
    return Column(name, low=low - slack, high=high + slack, words=allowed)


def _number_samples(
    parameter_sets: pd.DataFrame, rows: Rows, study: Study, source: object
) -> Sequence[int]:
    """Return a sample number for each row.

    The column `sample` names the sample of each row. If there is no such column, rows
    with the same parameters form one sample.

    Parameters
    ----------
    parameter_sets : pandas.DataFrame
        The parameters of the rows.
    rows : sequence of mapping
        The rows of the table, as text.
    study : Study
        Its strategy decides whether several samples may have the same parameters.
    source : object
        The file of the table, or `MergedRows`, for an error.

    Returns
    -------
    sequence of int
        One number for each row.

    Raises
    ------
    InputError
        If a sample has two parameter sets, or a parameter set has two samples although
        the strategy does not allow it.
    """
    # Number the different parameter sets from 1, in the order of their first row.
    points = parameter_sets.apply(tuple, axis=1)
    set_numbers: Sequence[int] = pd.factorize(points)[0] + 1
    if "sample" not in rows[0]:
        return set_numbers

    sample_names = strip_decimal_points(row["sample"] for row in rows)
    repeats_points = strategy(study.settings.strategy).repeats_points
    _reject_mixed_samples(sample_names, set_numbers, repeats_points, source)

    # If all names are whole numbers, they become the numbers of the samples. Names such
    # as 3 and 003 are different names of the same number, so they cannot.
    if all(name.isdecimal() and len(name) <= MAX_DIGITS for name in sample_names):
        numbers = [int(name) for name in sample_names]
        if len(set(numbers)) == len(set(sample_names)):
            return numbers
    # Otherwise number the different names from 1, in the order of their first row.
    return pd.factorize(pd.Series(sample_names))[0] + 1


def _reject_mixed_samples(
    names: Sequence[str],
    set_numbers: Sequence[int],
    repeats_points: bool,
    source: object,
) -> None:
    """Raise an error if the rows of a sample differ in their parameters.

    Rows with the same parameters must also belong to the same sample, unless the
    strategy simulates the same point in several samples.

    Parameters
    ----------
    names : sequence of str
        The sample of each row, as the table names it.
    set_numbers : sequence of int
        The number of the parameter set of each row.
    repeats_points : bool
        Whether the strategy allows several samples with the same parameter set.
    source : object
        The file of the table, or `MergedRows`, for the error.

    Raises
    ------
    InputError
        If there are such rows; the message lists all of them.
    """
    # Index of the first row of each sample and of each parameter set.
    first_row_of_sample: dict[str, int] = {}
    first_row_of_set: dict[int, int] = {}
    faults: list[Fault] = []
    for row, (name, set_number) in enumerate(zip(names, set_numbers, strict=True)):
        # Compare this row with the first row of the same sample, and with the first row
        # of the same parameter set.
        sample_row = first_row_of_sample.setdefault(name, row)
        set_row = first_row_of_set.setdefault(set_number, row)
        if set_numbers[sample_row] != set_number:
            allowed = (
                "one set of parameters for each sample; "
                f"{_name_row(source, sample_row)} has a different one"
            )
        elif names[set_row] != name and not repeats_points:
            allowed = (
                f"{names[set_row]}, the sample of {_name_row(source, set_row)} with "
                "the same parameters"
            )
        else:
            continue
        faults.append(CellFault(row, column="sample", value=name, allowed=allowed))
    _reject_rows(source, faults)


def _name_row(source: object, row: int) -> str:
    """Name a row of a table, counted from 0, and its file if the table has two."""
    if not isinstance(source, MergedRows):
        return f"row {row + 1}"
    n_recorded = len(source.recorded_rows)
    if row < n_recorded:
        return f"row {source.recorded_rows[row]} of {source.record}"
    return f"row {row - n_recorded + 1}"


def _reject_rows(source: object, faults: Iterable[Fault]) -> None:
    """Raise an InputError for invalid cells of a table, if there are any.

    For a table with the rows of two files, an error names the file of the cell, and the
    number of its row in this file. If the record has invalid cells, only these are
    reported, because they have to be corrected first.

    Parameters
    ----------
    source : object
        The file of the table, or `MergedRows`.
    faults : iterable of Fault
        The invalid cells. Their rows are counted from 0 over the whole table.
    """
    if not isinstance(source, MergedRows):
        refuse(source, faults)
        return
    n_recorded = len(source.recorded_rows)
    recorded_faults = []
    added_faults = []
    for row, column, value, allowed in faults:
        if row < n_recorded:
            # `recorded_rows` counts from 1, but a fault counts from 0.
            row_of_record = source.recorded_rows[row] - 1
            recorded_faults.append(CellFault(row_of_record, column, value, allowed))
        else:
            row_of_added = row - n_recorded
            added_faults.append(CellFault(row_of_added, column, value, allowed))
    # `refuse` raises an error, unless its list is empty.
    refuse(source.record, recorded_faults)
    refuse(source.added, added_faults)


def add_missing_columns(rows: Rows, study: Study) -> list[dict[str, Any]]:
    """Return rows with the missing columns of fixed parameters and of responses.

    Missing responses are empty texts.
    """
    missing = {**study.parameters.fixed, **dict.fromkeys(study.targets.names, "")}
    return [missing | dict(row) for row in rows]


def _reject_repeated_rows(table: pd.DataFrame, rows: Rows, source: object) -> None:
    """Raise an error if a table contains the same run twice.

    If the table has a column `run`, the sample and the run number identify a run. Two
    runs may then have equal results, for example if the simulator has no random
    numbers. Without this column, two good rows with the same values count as the same
    run.

    Parameters
    ----------
    table : pandas.DataFrame
        The checked table: `sample`, `status`, parameters and responses.
    rows : sequence of mapping
        The same rows as text, which may have `run`.
    source : object
        The file of the table, or `MergedRows`, for the error.

    Raises
    ------
    InputError
        If there are such rows; the message lists all of them.
    """
    faults: list[Fault] = []
    if "run" in rows[0]:
        run_numbers = [str(row["run"]).strip() for row in rows]
        pairs = zip(table["sample"], run_numbers, strict=True)
        for row, first_row, pair in _find_repetitions(enumerate(pairs)):
            allowed = f"each pair once; {_name_row(source, first_row)} has the same"
            if isinstance(source, MergedRows):
                allowed += (
                    ": leave out a row that was already added, or give a further run "
                    "another number"
                )
            faults.append(
                CellFault(
                    row, column="sample and run", value=list(pair), allowed=allowed
                )
            )
    else:
        # Compare only good runs. A failed run has no responses that identify it.
        good_rows = np.flatnonzero(table["status"] == OK).tolist()
        values = table.iloc[good_rows].itertuples(index=False, name=None)
        numbered_values = zip(good_rows, values, strict=True)
        for row, first_row, _ in _find_repetitions(numbered_values):
            allowed = (
                "a different run, or a column `run`: "
                f"{_name_row(source, first_row)} has all numbers of this row"
            )
            faults.append(
                CellFault(row, column="row", value="repeated", allowed=allowed)
            )
    _reject_rows(source, faults)


def _find_repetitions(
    numbered: Iterable[tuple[int, tuple[Any, ...]]],
) -> Iterator[tuple[int, int, tuple[Any, ...]]]:
    """Find the rows whose values an earlier row has, too.

    `numbered` has the index of each row, and the values to compare.

    Yields
    ------
    row, first_row : int
        Index of such a row, and of the first row with the same values.
    values : tuple
        The values of both rows.
    """
    first_rows: dict[tuple[Any, ...], int] = {}
    for row, values in numbered:
        first_row = first_rows.setdefault(values, row)
        if first_row != row:
            yield row, first_row, values
