"""Read the published tables with which results are compared."""

import csv
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.bench.parameters import PARAMETERS
from repose.calibrate.responses import Response
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import Path_, read_table
from repose.common.tables import Column, is_number, read, read_text_rows
from repose.measure.definitions import CALIBRATED_ANGLE, MEAN_KEYS
from repose.stages.parameter_sets import OF_SETS

if TYPE_CHECKING:
    import pandas as pd

# Number of the first published set. The solutions of a study are numbered from 1, and
# their numbers stay below it.
FIRST_PUBLISHED = 101
# Most sets of each of the two tables: their sample numbers are 101 to 999.
MOST = 449
# Beside the published solutions: sets of other works, with their source and wall.
OTHERS = "others.csv"
# Hashes of what the runs of a set depend on.
SIMULATED_BY = ("engine", "scene")
NAME = Column("solution", str, once=True)
# A hash of digits alone is text, too.
HASHES = tuple(Column(name, str) for name in SIMULATED_BY)
STORED: tuple[str | Column, ...] = (
    "sample",
    "source",
    *PARAMETERS,
    "n_seeds",
    "status",
    NAME,
    *HASHES,
)
STALE = (
    "stale: simulated with another engine or scene than today's; `snakemake "
    "published_sets` pours the sets anew"
)


def find_sibling_table(path: Path_ | None, table: str) -> Path | None:
    """Find a table next to the published solutions; None without it.

    Such a table is table1.csv (sizes) or table3.csv (intervals).
    """
    if path is None:
        return None
    sibling = Path(path).with_name(table)
    return sibling if sibling.is_file() else None


def tables(path: Path_ | None) -> list[Path]:
    """List the table of published solutions, and `OTHERS` next to it; empty for None."""
    if path is None:
        return []
    others = find_sibling_table(path, OTHERS)
    return [Path(path)] if others is None else [Path(path), others]


def read_sets(path: Path_, names: Iterable[str] = PARAMETERS) -> "pd.DataFrame":
    """Read all published sets, with their parameters `names` and a text `solution`."""
    import pandas as pd

    columns: tuple[str | Column, ...] = (NAME, *names)
    sets = [read_table(table, columns) for table in tables(path)]
    return pd.concat(sets, ignore_index=True)


def _read_rows(path: Path_ | None) -> list[dict[str, Any]]:
    """Read and check the rows of all published tables."""
    rows = []
    for table in tables(path):
        rows += read(table, (NAME, *OF_SETS), others=is_number).rows()
    return rows


def representative(
    path: Path_ | None, names: Collection[str] = PARAMETERS
) -> dict[str, float]:
    """Read parameters of the published representative solution.

    Parameters
    ----------
    path : path or None
        The table of published solutions.
    names : collection of str
        Parameters to read.

    Returns
    -------
    dict
        The value of each parameter.

    Raises
    ------
    InputError
        If `path` is None, or the table lacks the row `representative`.
    """
    if path is None:
        allowed = "a table of published solutions"
        raise InputError("configuration", "validation.published", None, allowed)
    table = read(path, (NAME, *map(Column, names)))
    for row in table.rows():
        if row["solution"] == "representative":
            return {name: row[name] for name in names}
    raise InputError(path, "solution", None, "a row 'representative'")


def to_simulate(
    path: Path_ | None, responses: Iterable[Response], names: Iterable[str] = PARAMETERS
) -> list[str]:
    """List the names of the published parameter sets that can be simulated.

    The list is empty if the table has none of the responses, or lacks a parameter of
    the study. The numbers of the table are not checked (`check_published`).

    Parameters
    ----------
    path : path or None
        The table of published sets.
    responses : iterable of Response
        Responses of the study's targets.
    names : iterable of str
        Parameters of the study.
    """
    rows = []
    for table in tables(path):
        rows += read_text_rows(table, (NAME, *OF_SETS))
    if not rows:
        return []
    columns = rows[0].keys()
    # A set without a parameter of the study could not be simulated. Without a response
    # of its targets, the result could not be compared.
    has_parameters = set(names) <= columns
    if not has_parameters or not published_responses(columns, responses):
        return []
    return [row["solution"] for row in rows]


def check_published(path: Path_ | None) -> None:
    """Refuse a table of published solutions that cannot be simulated or compared.

    None passes.
    """
    for table in tables(path):
        n_rows = len(read(table, (NAME, *OF_SETS), others=is_number))
        if not 1 <= n_rows <= MOST:
            raise InputError(table, "rows", n_rows, f"1 to {MOST} solutions")


def read_stored(path: Path_) -> "pd.DataFrame":
    """Read the published sets as `snakemake published_sets` simulated them."""
    return read_table(path, STORED)


def columns_of_stored(path: Path_) -> list[str]:
    """Read the names of the columns of such a table; `read_stored` checks the rest."""
    with open(path, encoding="utf-8-sig", newline="") as file:
        return next(csv.reader(file), [])


def stored_columns(
    columns: Iterable[str],
    *,
    names: Sequence[str],
    targets: Targets,
    definition: str,
) -> dict[Response, str]:
    """Find the columns of a study's responses in a table of simulated published sets.

    Parameters
    ----------
    columns : iterable of str
        Columns of the table.
    names : sequence of str
        Parameters of the study.
    targets : Targets
    definition : str
        Definition of the angle of repose in the study (`measure.response`).

    Returns
    -------
    dict
        The column of each response that the table has. Without all parameters it is
        empty.
    """
    table_columns = set(columns)
    if not set(names) <= table_columns:
        return {}
    column_of_response = {}
    for response in targets.responses:
        # The angle of repose has a column for each of its definitions.
        column = response.name
        if column == CALIBRATED_ANGLE:
            column = MEAN_KEYS[definition]
        if column in table_columns:
            column_of_response[response] = column
    return column_of_response


def published_sets(path: Path_ | None) -> list[dict[str, float]]:
    """Read the parameter sets of a table that passed `check_published`.

    They are empty for None.
    """
    return [{name: row[name] for name in PARAMETERS} for row in _read_rows(path)]


def published_responses(
    columns: Iterable[str], responses: Iterable[Response]
) -> tuple[Response, ...]:
    """Find the responses of a published table.

    Predicted and simulated values of each are among its columns.
    """
    table_columns = set(columns)
    return tuple(
        response
        for response in responses
        if {response.predicted, response.simulated} <= table_columns
    )
