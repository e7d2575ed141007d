"""Find a row at the end of a measured table that sums up the rows above it.

Spreadsheets often have means and the like below the measurements, with labels in any
language. Such a row is therefore recognised by its numbers.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from typing import NamedTuple

import numpy as np

# A row is compared with the statistics of the rows above it only if there are at least
# this many of these rows, and at least this many columns to compare.
MIN_ROWS_ABOVE = 3
MIN_SUMMARY_COLUMNS = 3
# The standard deviation of a compared column must be at least this many units of the
# last digit. In a coarser column, an ordinary row may equal the rounded mean by chance.
MIN_UNITS_OF_SCATTER = 5.0
# Largest difference between a statistic and its printed value. It is slightly more than
# half a unit of the last digit, plus the error of the sum of the numbers, as a fraction
# of their size.
ROUNDING_UNITS = 0.501
SUM_ERROR_FRACTION = 1e-12
STATISTICS: dict[str, Callable[[np.ndarray], float]] = {
    "mean": np.mean,
    "minimum": np.min,
    "maximum": np.max,
    "standard deviation": lambda numbers: np.std(numbers, ddof=1),
}


class SummaryRow(NamedTuple):
    """A row that sums up the rows above it."""

    row: int
    statistic: str


def find_summary_row(columns: Mapping[str, Sequence[str]]) -> SummaryRow | None:
    """Find a row at the end of a table that has a statistic of the rows above it.

    Parameters
    ----------
    columns : mapping of str to sequence of str
        The cells of each column of numbers, as text.

    Returns
    -------
    SummaryRow or None
        The first such row, or None.

    Notes
    -----
    A summary row equals the same statistic in every column that is compared, to all the
    digits that it prints. A row that repeats an earlier row is not a summary. Columns
    with few different values are not compared, because they belong to the design of an
    experiment, whose centre equals the mean and whose corners equal the extremes. The
    parameters of repeated runs also have few different values, but many if each
    parameter set is counted once.
    """
    # Read the cells as an array (rows, columns) of numbers.
    cells_of_columns = list(columns.values())
    n_rows = len(cells_of_columns[0]) if cells_of_columns else 0
    numbers = np.full((n_rows, len(cells_of_columns)), math.nan)
    for column, cells in enumerate(cells_of_columns):
        numbers[:, column] = [_read_finite_number(cell) for cell in cells]

    # The last rows may be summaries, at most one for each statistic.
    first_row = max(0, n_rows - len(STATISTICS))
    for row in range(first_row, n_rows):
        last_digits = [_find_last_digit(cells[row]) for cells in cells_of_columns]
        statistic = _find_equal_statistic(numbers[row], numbers[:row], last_digits)
        if statistic:
            return SummaryRow(row, statistic)
    return None


def _find_equal_statistic(
    row: np.ndarray, rows_above: np.ndarray, last_digits: Sequence[float]
) -> str:
    """Find the statistic of the rows above that a row equals in every column.

    Parameters
    ----------
    row : ndarray, (columns,)
        The numbers of the row. Cells without a number are NaN.
    rows_above : ndarray, (rows, columns)
        The numbers of the rows above.
    last_digits : sequence of float
        Unit of the last digit that the row prints in each column.

    Returns
    -------
    str
        A name of `STATISTICS`; empty if there is no such statistic.
    """
    compared_columns = _find_compared_columns(row, rows_above, last_digits)
    if len(compared_columns) < MIN_SUMMARY_COLUMNS:
        return ""

    # A row that repeats an earlier one is a repeated measurement, not a summary.
    is_equal = rows_above[:, compared_columns] == row[compared_columns]
    if is_equal.all(axis=1).any():
        return ""

    for name, compute in STATISTICS.items():
        is_close = []
        for column in compared_columns:
            numbers = rows_above[:, column]
            numbers = numbers[np.isfinite(numbers)]
            difference = abs(compute(numbers) - row[column])
            sum_error = SUM_ERROR_FRACTION * np.abs(numbers).max()
            is_close.append(
                difference <= ROUNDING_UNITS * last_digits[column] + sum_error
            )
        if all(is_close):
            return name
    return ""


def _find_compared_columns(
    row: np.ndarray, rows_above: np.ndarray, last_digits: Sequence[float]
) -> list[int]:
    """Find the columns in which a row is compared with the statistics of the rows above.

    Parameters
    ----------
    row : ndarray, (columns,)
        The numbers of the row. Cells without a number are NaN.
    rows_above : ndarray, (rows, columns)
        The numbers of the rows above.
    last_digits : sequence of float
        Unit of the last digit that the row prints in each column.

    Returns
    -------
    list of int
        The columns whose numbers vary enough.
    """
    counts = np.isfinite(rows_above).sum(axis=0)
    different_counts = np.array(
        [len(set(column[np.isfinite(column)])) for column in rows_above.T]
    )
    scatters = np.array(
        [
            math.isfinite(row[k])
            and counts[k] >= MIN_ROWS_ABOVE
            and np.nanstd(rows_above[:, k]) >= MIN_UNITS_OF_SCATTER * last_digit
            for k, last_digit in enumerate(last_digits)
        ],
        dtype=bool,
    )

    # In a measured column most numbers differ. A column of a design has few levels.
    is_measured = 2 * different_counts > counts
    measured_columns = np.flatnonzero(scatters & is_measured)

    # Repeated runs of a set repeat its parameters, so count each set only once.
    n_sets = len({values.tobytes() for values in rows_above[:, ~is_measured]})
    differs_between_sets = (different_counts >= MIN_ROWS_ABOVE) & (
        2 * different_counts > n_sets
    )
    # The centre of a design equals its mean on purpose.
    is_centre = np.array(
        [
            scatter
            and abs(_compute_middle(rows_above[:, k]) - row[k]) <= last_digits[k]
            for k, scatter in enumerate(scatters)
        ],
        dtype=bool,
    )
    is_parameter = scatters & ~is_measured & differs_between_sets & ~is_centre
    parameter_columns = np.flatnonzero(is_parameter)

    # A further run of an earlier set repeats its parameters, which therefore say
    # nothing.
    is_same = rows_above[:, parameter_columns] == row[parameter_columns]
    if is_same.all(axis=1).any():
        return measured_columns.tolist()
    return [*measured_columns.tolist(), *parameter_columns.tolist()]


def _compute_middle(column: np.ndarray) -> float:
    """Return the midpoint between the smallest and the largest number of a column."""
    return float(np.nanmin(column) + np.nanmax(column)) / 2


def _read_finite_number(cell: str) -> float:
    """Read the number of a cell; return NaN if it has no finite number."""
    try:
        number = float(cell)
    except ValueError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def _find_last_digit(cell: str) -> float:
    """Return the unit of the last digit of a written number, such as 0.01 for 3.14.

    For a cell without a finite number the result is NaN.
    """
    if math.isnan(_read_finite_number(cell)):
        return math.nan
    return 10.0 ** int(Decimal(cell.strip()).as_tuple().exponent)
