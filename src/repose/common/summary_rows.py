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
# A column of parameters is compared only if it has at least this many different values.
MIN_DIFFERENT_VALUES = 3
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
    """Find a row at the end of a table that is a statistic of the rows above it.

    Such a row has, for example, the means of all columns.

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
    A summary row equals the same statistic (`STATISTICS`) in every column that is
    compared, to all the digits that it prints. A row that repeats an earlier row is not
    a summary.

    A column with few different values is usually not compared, because it may belong to
    the design of an experiment. The point in the centre of a design equals the mean of
    all points, and its corners equal the minimum and the maximum, but these points are
    no summaries. Columns of parameters are an exception. They also have few different
    values if each parameter set was run several times. Such a column is compared if it
    has many different values once each parameter set is counted only once.
    """
    # Read the cells as an array of numbers with a row for each row of the table.
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
    """Find a statistic that a row equals in every column that is compared.

    The statistics are those of the rows above.

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

    # The difference may be half a unit of the last digit, because the row is rounded,
    # and the rounding error of a sum.
    for name, compute in STATISTICS.items():
        is_close = []
        for column in compared_columns:
            all_numbers = rows_above[:, column]
            numbers = all_numbers[np.isfinite(all_numbers)]
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

    These are columns of measured numbers, and columns of parameters that vary enough
    between the parameter sets (see `find_summary_row`).

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
        The positions of the columns: first the measured ones, then the parameters.
    """
    counts = np.isfinite(rows_above).sum(axis=0)
    different_counts = np.array(
        [len(set(column[np.isfinite(column)])) for column in rows_above.T]
    )
    # A column can only be compared if the row has a number in it, if there are enough
    # numbers above, and if these numbers scatter by more than they are rounded.
    is_comparable = np.array(
        [
            math.isfinite(row[k])
            and counts[k] >= MIN_ROWS_ABOVE
            and np.nanstd(rows_above[:, k]) >= MIN_UNITS_OF_SCATTER * last_digit
            for k, last_digit in enumerate(last_digits)
        ],
        dtype=bool,
    )

    # In a measured column, more than half of the numbers differ. In all other columns,
    # few numbers do: these are the levels of a design, or parameters.
    is_measured = 2 * different_counts > counts
    measured_columns = np.flatnonzero(is_comparable & is_measured)

    # Runs with the same parameter set have equal numbers in all columns that are not
    # measured. Count the different parameter sets by comparing the bytes of these
    # numbers. A column of parameters then has different numbers in more than half of
    # the sets.
    n_sets = len({values.tobytes() for values in rows_above[:, ~is_measured]})
    differs_between_sets = (different_counts >= MIN_DIFFERENT_VALUES) & (
        2 * different_counts > n_sets
    )
    # The point in the centre of a design equals the mean because it was chosen so. A
    # number in the middle between the extremes is therefore no sign of a summary.
    is_centre = np.array(
        [
            comparable
            and abs(_compute_middle(rows_above[:, k]) - row[k]) <= last_digits[k]
            for k, comparable in enumerate(is_comparable)
        ],
        dtype=bool,
    )
    is_parameter = is_comparable & ~is_measured & differs_between_sets & ~is_centre
    parameter_columns = np.flatnonzero(is_parameter)

    # If the row has the parameters of an earlier row, it is a further run of the same
    # set. Its parameters cannot show whether it is a summary, so leave them out.
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
