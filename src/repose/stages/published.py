"""Read the published tables with which results are compared."""

import csv
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.bench.parameters import PARAMETERS
from repose.calibrate.responses import Response
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table
from repose.common.tables import Column, holds_numbers, read, read_text_rows
from repose.measure.definitions import CALIBRATED_ANGLE, MEAN_KEYS
from repose.stages.parameter_sets import PARAMETER_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

# Name of the set that a publication recommends
REPRESENTATIVE = "representative"
# Number of the first published set. The solutions of a study are numbered from 1, and
# their numbers stay below it.
FIRST_PUBLISHED = 101
# Largest number of sets in each of the two tables. Their sample numbers are 101 to 999.
MAX_SETS = 449
# Table next to the published solutions, with sets from other works, their source and
# wall.
OTHER_SETS_FILE = "others.csv"
# Names of the hashes of everything on which the runs of a set depend.
HASH_NAMES = ("engine", "scene")
SOLUTION_COLUMN = Column("solution", str, once=True)
# A hash may consist of digits only, but is still text.
HASH_COLUMNS = tuple(Column(name, str) for name in HASH_NAMES)
STORED_COLUMNS: tuple[str | Column, ...] = (
    "sample",
    "source",
    *PARAMETERS,
    "n_seeds",
    "status",
    SOLUTION_COLUMN,
    *HASH_COLUMNS,
)
STALE_WARNING = (
    "stale: simulated with another engine or scene than today's; `snakemake "
    "published_sets` pours the sets again"
)


def find_sibling_table(path: StrPath | None, table: str) -> Path | None:
    """Find a table next to the published solutions; None if there is none.

    Such a table is table1.csv (sizes) or table3.csv (intervals).
    """
    if path is None:
        return None
    sibling = Path(path).with_name(table)
    return sibling if sibling.is_file() else None


def list_tables(path: StrPath | None) -> list[Path]:
    """List the table of published solutions, and `OTHER_SETS_FILE` next to it.

    The list is empty if `path` is None.
    """
    if path is None:
        return []
    others = find_sibling_table(path, OTHER_SETS_FILE)
    return [Path(path)] if others is None else [Path(path), others]


def read_sets(
    path: StrPath, parameter_names: Iterable[str] = PARAMETERS
) -> "pd.DataFrame":
    """Read all published sets, each with its parameters and its name `solution`."""
    import pandas as pd

    columns: tuple[str | Column, ...] = (SOLUTION_COLUMN, *parameter_names)
    sets = [read_table(table, columns) for table in list_tables(path)]
    return pd.concat(sets, ignore_index=True)


def _read_rows(path: StrPath | None) -> list[dict[str, Any]]:
    """Read and check the rows of all published tables."""
    rows = []
    for table in list_tables(path):
        rows += read(
            table, (SOLUTION_COLUMN, *PARAMETER_COLUMNS), is_number_column=holds_numbers
        ).rows()
    return rows


def read_representative(
    path: StrPath | None, parameter_names: Collection[str] = PARAMETERS
) -> dict[str, float]:
    """Read parameters of the published representative solution.

    Parameters
    ----------
    path : path or None
        The table of published solutions.
    parameter_names : collection of str
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
        raise InputError(
            "configuration",
            key="validation.published",
            value=None,
            allowed="a table of published solutions",
        )
    table = read(path, (SOLUTION_COLUMN, *map(Column, parameter_names)))
    for row in table.rows():
        if row["solution"] == REPRESENTATIVE:
            return {name: row[name] for name in parameter_names}
    raise InputError(path, key="solution", value=None, allowed="a row 'representative'")


def list_sets_to_simulate(
    path: StrPath | None,
    responses: Iterable[Response],
    parameter_names: Iterable[str] = PARAMETERS,
) -> list[str]:
    """List the names of the published parameter sets that can be simulated.

    The numbers of the table are not checked; `check_published_sets` does that.

    Parameters
    ----------
    path : path or None
        The table of published sets.
    responses : iterable of Response
        Responses of the study's targets.
    parameter_names : iterable of str
        Parameters of the study.

    Returns
    -------
    list of str
        The names. The list is empty in three cases: there is no table, the table lacks
        a parameter of the study, or it has none of the responses.
    """
    rows = []
    for table in list_tables(path):
        rows += read_text_rows(table, (SOLUTION_COLUMN, *PARAMETER_COLUMNS))
    if not rows:
        return []
    # The first row belongs to the table of published solutions. Its columns decide, not
    # those of the table with sets from other works.
    columns = rows[0].keys()
    # A set that lacks a parameter of the study cannot be simulated. If the table has no
    # response of the targets, the simulation cannot be compared with anything.
    has_parameters = set(parameter_names) <= columns
    if not has_parameters or not find_published_responses(columns, responses):
        return []
    return [row[SOLUTION_COLUMN.name] for row in rows]


def check_published_sets(path: StrPath | None) -> None:
    """Raise an InputError if published sets cannot be simulated or compared.

    Nothing is checked if `path` is None.
    """
    for table in list_tables(path):
        n_rows = len(
            read(
                table,
                (SOLUTION_COLUMN, *PARAMETER_COLUMNS),
                is_number_column=holds_numbers,
            )
        )
        if not 1 <= n_rows <= MAX_SETS:
            raise InputError(
                table, key="rows", value=n_rows, allowed=f"1 to {MAX_SETS} solutions"
            )


def read_stored(path: StrPath) -> "pd.DataFrame":
    """Read the published sets as `snakemake published_sets` simulated them."""
    return read_table(path, STORED_COLUMNS)


def read_column_names(path: StrPath) -> list[str]:
    """Read the names of a table's columns, without the checks of `read_stored`."""
    with open(path, encoding="utf-8-sig", newline="") as file:
        return next(csv.reader(file), [])


def find_response_columns(
    columns: Iterable[str],
    *,
    parameter_names: Sequence[str],
    targets: Targets,
    definition: str,
) -> dict[Response, str]:
    """Find the column of each response of a study in the table of published sets.

    The table is that of `read_stored`: published parameter sets as repose simulated
    them.

    Parameters
    ----------
    columns : iterable of str
        Columns of the table.
    parameter_names : sequence of str
        Parameters of the study.
    targets : Targets
        The targets of the study.
    definition : str
        Definition of the angle of repose that the study calibrates, the value of
        `measure.response`.

    Returns
    -------
    dict
        The column of each response that the table has. The dict is empty if the table
        lacks a parameter of the study, because its sets are then no sets of the study.
    """
    table_columns = set(columns)
    if not set(parameter_names) <= table_columns:
        return {}
    column_of_response = {}
    for response in targets.responses:
        # The table has a column for each definition of the angle of repose, and none
        # for its general name. `MEAN_KEYS` has the columns by definition.
        column = response.name
        if column == CALIBRATED_ANGLE:
            column = MEAN_KEYS[definition]
        if column in table_columns:
            column_of_response[response] = column
    return column_of_response


def read_parameter_sets(path: StrPath | None) -> list[dict[str, float]]:
    """Read the parameter sets of a table that passed `check_published_sets`.

    The list is empty if `path` is None.
    """
    return [{name: row[name] for name in PARAMETERS} for row in _read_rows(path)]


def find_published_responses(
    columns: Iterable[str], responses: Iterable[Response]
) -> tuple[Response, ...]:
    """Find the responses with predicted and simulated values in a published table."""
    table_columns = set(columns)
    return tuple(
        response
        for response in responses
        if {response.predicted, response.simulated} <= table_columns
    )
