"""Tables of the report, as plain values for its templates."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from repose.calibrate.runs import name_error_column
from repose.common.statuses import replace_statuses
from repose.stages.published import STALE_WARNING

# If a standard error or a standard deviation is a smaller fraction of its mean, all
# values were the same, and it is only due to rounding.
ROUNDING_FRACTION = 1e-9
# Columns of text, which the style sheet aligns to the left.
TEXT_COLUMNS = ("reason", "warning", "status", "role", "line", "source", "wall")


@dataclass(frozen=True)
class Table:
    """A table of the page.

    Attributes
    ----------
    columns : sequence of str
        The headers.
    rows : sequence of sequence
        The cells of each row.
    style : str
        Class of the table in the style sheet. A table of the class `sorts` is sorted by
        a column when the user clicks on its header.
    screen_rows : int
        Number of rows at the end that are shown on the screen, but not printed.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    style: str = "sorts"
    screen_rows: int = 0

    def row_class(self, number: int) -> str:
        """Return the style-sheet class of a row, numbered from 0; empty if it has none."""
        is_printed = number < len(self.rows) - self.screen_rows
        return "" if is_printed else "screen"

    def column_class(self, column: str) -> str:
        """Return the style-sheet class of a column's cells; empty if they have none."""
        return "words" if column in TEXT_COLUMNS else ""


@dataclass(frozen=True)
class CollapsibleTable:
    """A table that a click on its title shows or hides. It is hidden at first."""

    title: str
    table: Table
    note: str = ""  # explains the columns


def make_collapsible_table(
    title: str, frame: pd.DataFrame, note: str = ""
) -> CollapsibleTable:
    """Convert a table to one that a click on its title shows or hides.

    Parameters
    ----------
    title : str
        Title, to which the number of rows is added. If the optional column `stale`
        contains true, the results come from other settings, and a warning is added.
    frame : DataFrame
        The table. In the optional column `reason`, words replace the short names of
        statuses, such as those of failed runs.
    note : str, optional
        Sentences that explain the columns.

    Returns
    -------
    CollapsibleTable
        The table with its title. Missing values are None.
    """
    if "stale" in frame and frame["stale"].any():
        title = f"{title}, {STALE_WARNING}"
    columns = [str(column) for column in frame.columns]
    if "reason" in frame:
        frame = frame.assign(
            reason=frame["reason"].map(replace_statuses, na_action="ignore")
        )
    frame = _replace_rounding_errors(frame)
    # A column of numbers cannot hold None, so convert it to objects first.
    rows = frame.astype(object).where(frame.notna(), None).values.tolist()
    return CollapsibleTable(
        f"{title} ({len(frame)} rows)", Table(columns, rows), note=note
    )


def _replace_rounding_errors(frame: pd.DataFrame) -> pd.DataFrame:
    """Replace each standard error or deviation that is only due to rounding by 0."""
    pairs = [("mean", "standard_error"), ("mean", "sd")]
    pairs += [(column, name_error_column(str(column))) for column in frame.columns]
    for mean, spread in pairs:
        if mean in frame and spread in frame:
            is_rounding = frame[spread] < ROUNDING_FRACTION * frame[mean].abs()
            frame = frame.assign(**{spread: frame[spread].mask(is_rounding, 0.0)})
    return frame


def format_tables(tables: Iterable[Table]) -> str:
    """Write tables of strings as lines separated by tabs, which a spreadsheet can read."""
    lines = []
    for table in tables:
        lines.append("\t".join(table.columns))
        lines += ["\t".join(row) for row in table.rows]
    return "\n".join(lines) + "\n"
