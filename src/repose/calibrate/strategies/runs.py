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
from repose.common.errors import InputError
from repose.common.files import TURN_COLUMN, StrPath
from repose.common.tables import (
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
NUMBER_COLUMNS = ("sample", "run")
NUMBERS_OF = {
    key: Column(key, words="a finite number, as most cells of this column")
    for key in NUMBER_COLUMNS
}
TURN_NUMBERS = Column(TURN_COLUMN, int, low=0, high=1e9, may_be_empty=True)
OPTIONAL_COLUMNS = ("status", TURN_COLUMN)
# The largest size of a response; a larger one counts as infinite.
MAX_RESPONSE = 1e100
RESPONSE_WORDS = "a finite number, or for a failed run NaN"
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
    """Refuse responses to which no model can be fitted.

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

    # In very few runs, any responses look dependent.
    complete = data[names].dropna()
    if len(complete) <= len(names) + 1:
        return

    # If responses are linearly dependent, the smallest eigenvalue of their correlation
    # matrix is 0, and the components of its eigenvector show which responses these are.
    # The eigenvalues are sorted, the smallest first.
    eigenvalues, eigenvectors = np.linalg.eigh(complete.corr())
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
                "responses none of which follows from the others: leave one of them out"
            ),
        )


def summarise_samples(
    data: pd.DataFrame, space: ParameterSpace, targets: Targets
) -> pd.DataFrame:
    """Summarise the runs of each sample, as the stage `dataset` does.

    A sample is ok if at least half of its runs are good, and at least one of them is.
    Otherwise its means and standard errors are NaN.

    Parameters
    ----------
    data : pandas.DataFrame
        A row for each run: `sample`, parameters and responses. The responses of a
        failed run are NaN.
    space : ParameterSpace
    targets : Targets

    Returns
    -------
    pandas.DataFrame
        `sample`, parameters, `status`, `reason`, `n_seeds` (number of good runs), means
        and standard errors.
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
            "status": OK if is_ok else "failed",
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
    """List the runs of each bench test as rows, as the stage `dataset` writes them.

    Parameters
    ----------
    data : pandas.DataFrame
        A row for each run, with the responses of all bench tests.
    targets : Targets

    Returns
    -------
    pandas.DataFrame
        A row for each run and bench test: `sample`, its responses, `apparatus`,
        `status` and `reason`.
    """
    tables = []
    for bench, columns in targets.benches.items():
        names = [targets.names[k] for k in columns]
        is_complete = data[names].notna().all(axis=1)
        table = data[["sample", *names]].assign(
            apparatus=bench,
            status=np.where(is_complete, OK, "failed"),
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
    # Accept any cell of a parameter or a response here. A later check refuses bad ones.
    names = (TURN_COLUMN, *study.parameters.names, *study.targets.names)
    columns = [Column(name, object, needed=False) for name in names]
    status = Column("status", str, needed=False, may_be_empty=True)
    needed_names = ", ".join([*study.parameters.free, *study.targets.names])
    expected = f"a CSV file of runs with the columns {needed_names}"
    # A record also has other columns of all tables that were added to it. These may mix
    # numbers and text, and are not read. The numbers of failed runs may be all alike.
    is_record = TURN_COLUMN in read_sheet(path, expected, names).text
    table = read(
        path,
        [*columns, status],
        expected,
        is_number_column=_holds_no_numbers if is_record else holds_numbers,
        optional=NUMBER_COLUMNS,
        find_unused_rows=_find_failed_rows if is_record else None,
    )
    # A column of sample or run numbers is optional, but none of its cells may be empty.
    for key in NUMBER_COLUMNS:
        if key not in table.values:
            continue
        cells = strip_decimal_points(table.values[key])
        allowed = (
            "a number, as in the other rows; merged cells need it in each row, and a "
            "row of units or means is no run"
        )
        faults = [(k, key, "", allowed) for k, cell in enumerate(cells) if not cell]
        if holds_numbers(cells):
            _, no_numbers = convert_columns({key: cells}, [NUMBERS_OF[key]])
            faults += [fault for fault in no_numbers if cells[fault[0]]]
        refuse(path, faults)
        table.values[key] = cells
    return table.rows()


def _holds_no_numbers(cells: Iterable[str]) -> bool:
    """Tell that a column need not hold numbers, whatever its cells are."""
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
    """Check a table of runs.

    The columns ``sample``, ``run``, ``status`` and those of fixed parameters are
    optional. So are the responses if every run failed, as decided by `judge_runs`. Rows
    with the same parameters are replicates. Unless the table numbers the samples, they
    are numbered in the order of their first run.

    Parameters
    ----------
    study : Study
    rows : pandas.DataFrame or sequence of mapping
    source : object, optional
        File of the table, for an error; or `MergedRows`.
    enough : bool, optional
        Whether a table with too few good samples is refused.

    Returns
    -------
    pandas.DataFrame
        ``sample``, ``status``, parameters and responses. The turns are in
        ``attrs[TURN_COLUMN]``.

    Raises
    ------
    InputError
        If the table has faults; the error lists all of them.
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

    # Check all columns before refusing the table, so that one error lists all faults.
    low, high = space.complete(np.array([space.low, space.high]))
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

    statuses: list[str]
    # Responses by name; NaN in all of them for a run that failed.
    values: dict[str, list[float]]
    faults: list[Fault]


def judge_runs(
    cells: Mapping[str, Sequence[Any]], responses: Sequence[str]
) -> Outcomes:
    """Decide which runs failed.

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
        Statuses, responses and faults. A text as a response is a fault, and so is a
        number as a status.
    """
    n_runs = len(next(iter(cells.values())))
    empty_column = [None] * n_runs

    # Read the statuses. A number is a fault, because it may mean success or failure.
    statuses = [_read_status(cell) for cell in cells.get("status", empty_column)]
    faults = [
        (k, "status", status, "ok, or a word such as failed")
        for k, status in enumerate(statuses)
        if holds_numbers([status])
    ]

    # Read the responses, but ignore faults in runs whose status reports a failure.
    failed_rows = {k for k, status in enumerate(statuses) if status != OK}
    numbers = {
        name: [_replace_infinite(cell) for cell in cells.get(name, empty_column)]
        for name in responses
    }
    columns = [
        Column(name, may_be_empty=True, words=RESPONSE_WORDS) for name in responses
    ]
    values, faults_of_responses = convert_columns(numbers, columns, failed_rows)

    # If one response of a run is missing, the run failed. Remove its other responses.
    for k, responses_of_run in enumerate(zip(*values.values(), strict=True)):
        if np.isfinite(responses_of_run).all():
            continue
        if statuses[k] == OK:
            statuses[k] = FAILED
        for column in values.values():
            column[k] = math.nan
    return Outcomes(statuses, values, [*faults, *faults_of_responses])


def make_cells(
    result: Mapping[Any, Any], responses: Sequence[str], names: Iterable[str] = ()
) -> tuple[dict[str, Any], str]:
    """Convert the result of the user's function for one run to a row of a table.

    The row has no faults that `judge_runs` would report. A mistake makes the run a
    failed one, but raises no error, because a long calibration has to continue.

    Parameters
    ----------
    result : mapping
        The responses by name. It may also have a `status` and other values.
    responses : sequence of str
        Names of the responses.
    names : iterable of str, optional
        Names of the columns of a table of runs. A key of the result that differs from
        them only in form is renamed, as a column of a table is.

    Returns
    -------
    cells : dict
        The row by column; a response without a valid number is NaN.
    lacking : str
        What the result lacks by mistake, such as ``a number for angle_deg``. It is
        empty if there is no mistake, or if the function reported the failure itself.
    """
    cells = {str(key): value for key, value in result.items()}
    new_names = match_column_names(cells, names)
    cells = {new_names.get(key, key): value for key, value in cells.items()}
    invalid = []
    for name in responses:
        # A value such as NaN or None is not a mistake: it reports that the run failed.
        is_marked_as_missing = name in cells and is_missing(cells[name])
        try:
            cells[name] = parse_number(cells[name])
        except (KeyError, TypeError, ValueError, OverflowError):
            cells[name] = math.nan
            if not is_marked_as_missing:
                invalid.append(name)

    # `judge_runs` refuses a number as a status, because it may mean success or failure.
    # Turn it into text, which means failure.
    status = cells.get("status")
    if not is_missing(status) and holds_numbers([str(status)]):
        cells["status"] = f"status {status}"
        return cells, "a word such as ok as status"

    # An empty result or a status of failure reports that the run failed.
    reports_failure = not result or _read_status(status) != OK
    if reports_failure or not invalid:
        return cells, ""
    return cells, f"a number for {', '.join(invalid)}"


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
    texts = [f"{status:.30}: {n}" for status, n in counts.most_common(MAX_STATUSES)]
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
    """Refuse a table with too few good samples for a model.

    Parameters
    ----------
    table : pandas.DataFrame
        The checked table, with `sample` and `status`.
    space : ParameterSpace
    source : object
        File of the table, for the error.

    Raises
    ------
    InputError
        If there are fewer than two more samples than free parameters.
    """
    count = table[table["status"] == OK]["sample"].nunique()
    fewest = space.dimensions + 2
    if count >= fewest:
        return
    allowed = f"at least {fewest}, two more than the free parameters"
    # Failed runs may be the reason, so name their statuses.
    failures = sorted(set(table["status"]) - {OK})
    if failures:
        statuses = ", ".join(failures)
        allowed += f"; runs with the status {statuses:.60} failed"
    raise InputError(
        source=source,
        key="samples with a good run",
        value=count,
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
    sets: pd.DataFrame, rows: Rows, study: Study, source: object
) -> Sequence[int]:
    """Find the number of the sample of each row.

    The column `sample` names the sample of each row. If there is no such column, rows
    with the same parameters form one sample.

    Parameters
    ----------
    sets : pandas.DataFrame
        The parameters of the rows.
    rows : sequence of mapping
        The rows of the table, as text.
    study : Study
    source : object
        File of the table, for an error.

    Returns
    -------
    sequence of int
        One number for each row.

    Raises
    ------
    InputError
        If samples and parameter sets contradict each other.
    """
    # Number the different parameter sets from 1, in the order of their first row.
    points = sets.apply(tuple, axis=1)
    set_numbers: Sequence[int] = pd.factorize(points)[0] + 1
    if "sample" not in rows[0]:
        return set_numbers

    sample_names = strip_decimal_points(row["sample"] for row in rows)
    repeats_points = strategy(study.settings.strategy).repeats_points
    _reject_mixed_samples(sample_names, set_numbers, repeats_points, source)

    # Use the names themselves if they are numbers, and different names are different
    # numbers. Names such as 3 and 003 are not. Otherwise number the samples from 1.
    if all(name.isdecimal() and len(name) <= MAX_DIGITS for name in sample_names):
        numbers = [int(name) for name in sample_names]
        if len(set(numbers)) == len(set(sample_names)):
            return numbers
    return pd.factorize(pd.Series(sample_names))[0] + 1


def _reject_mixed_samples(
    names: Sequence[str],
    set_numbers: Sequence[int],
    repeats_points: bool,
    source: object,
) -> None:
    """Refuse samples and parameter sets that contradict each other.

    All rows of a sample must have the same parameter set. All rows with the same
    parameter set must belong to the same sample, unless the strategy repeats points.

    Parameters
    ----------
    names : sequence of str
        The sample of each row, as the table names it.
    set_numbers : sequence of int
        The number of the parameter set of each row.
    repeats_points : bool
        Whether the strategy allows several samples with the same set.
    source : object
        File of the table, for the error.

    Raises
    ------
    InputError
        If there are such rows; the message lists all of them.
    """
    # Index of the first row of each sample and of each parameter set.
    first_of_sample: dict[str, int] = {}
    first_of_set: dict[int, int] = {}
    faults: list[Fault] = []
    for k, (name, set_number) in enumerate(zip(names, set_numbers, strict=True)):
        sample_row = first_of_sample.setdefault(name, k)
        set_row = first_of_set.setdefault(set_number, k)
        # Compare this row with the first row of its sample and the first row of its
        # set.
        if set_numbers[sample_row] != set_number:
            expected = (
                "one set of parameters for each sample; "
                f"{_name_row(source, sample_row)} has another one"
            )
            faults.append((k, "sample", name, expected))
        elif names[set_row] != name and not repeats_points:
            expected = (
                f"{names[set_row]}, the sample of {_name_row(source, set_row)} with "
                "the same parameters"
            )
            faults.append((k, "sample", name, expected))
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
    """Raise faults as `refuse` does, each with the row of its own file."""
    if not isinstance(source, MergedRows):
        refuse(source, faults)
        return
    n = len(source.recorded_rows)
    of_record = []
    of_added = []
    for row, column, value, allowed in faults:
        if row < n:
            number = source.recorded_rows[row]
            of_record.append((number - 1, column, value, allowed))
        else:
            of_added.append((row - n, column, value, allowed))
    refuse(source.record, of_record)
    refuse(source.added, of_added)


def add_missing_columns(rows: Rows, study: Study) -> list[dict[str, Any]]:
    """Return rows with the missing columns of fixed parameters and of responses.

    Missing responses are empty texts.
    """
    missing = {**study.parameters.fixed, **dict.fromkeys(study.targets.names, "")}
    return [missing | dict(row) for row in rows]


def _reject_repeated_rows(table: pd.DataFrame, rows: Rows, source: object) -> None:
    """Refuse a table that contains the same run twice.

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
        File of the table, for the error.

    Raises
    ------
    InputError
        If there are such rows; the message lists all of them.
    """
    has_run_numbers = "run" in rows[0]
    keys: dict[int, tuple[Any, ...]]  # by index of the row
    # Collect what identifies the run of each row. A failed run without a number cannot
    # be identified, because it has no responses.
    if has_run_numbers:
        run_numbers = [str(row["run"]).strip() for row in rows]
        keys = dict(enumerate(zip(table["sample"], run_numbers, strict=True)))
    else:
        all_values = enumerate(table.itertuples(index=False, name=None))
        is_good = (table["status"] == OK).tolist()
        keys = {k: values for k, values in all_values if is_good[k]}

    first_row: dict[tuple[Any, ...], int] = {}
    faults: list[Fault] = []
    for k, key in keys.items():
        first = first_row.setdefault(key, k)
        if first == k:
            continue
        if has_run_numbers:
            allowed = f"each once; {_name_row(source, first)} has them, too"
            if isinstance(source, MergedRows):
                allowed += (
                    ": leave out a row that was told before, or give a further run "
                    "another number"
                )
            faults.append((k, "sample and run", list(key), allowed))
        else:
            allowed = (
                "a run of its own, or a column `run`: all numbers of this row stand "
                f"in {_name_row(source, first)}"
            )
            faults.append((k, "row", "there twice", allowed))
    _reject_rows(source, faults)
