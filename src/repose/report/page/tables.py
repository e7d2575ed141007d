"""Tables of the report."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from repose.stages.published import STALE

# Columns of words, which the style sheet aligns to the left.
TEXT_COLUMNS = ("reason", "warning", "status", "role", "line", "source", "wall")


@dataclass(frozen=True)
class Table:
    """A table of the page.

    `style` is its class in the style sheet; a table of the class `sorts` sorts by the
    column whose head is clicked.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    style: str = "sorts"

    def column_class(self, column: str) -> str:
        """Give the class of a column's cells in the style sheet, or an empty text."""
        return "words" if column in TEXT_COLUMNS else ""


@dataclass(frozen=True)
class FoldedTable:
    """A table that opens by a click on its title."""

    title: str
    table: Table


def folded_table(title: str, frame: pd.DataFrame) -> FoldedTable:
    """Put a table of a study behind its title, which says how many rows it has."""
    if "stale" in frame and frame["stale"].any():
        title = f"{title}, {STALE}"
    columns = [str(column) for column in frame.columns]
    rows = frame.astype(object).where(frame.notna(), None).values.tolist()
    return FoldedTable(f"{title} ({len(frame)} rows)", Table(columns, rows))
