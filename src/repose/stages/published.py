"""Published tables for comparison with results."""

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.bench.parameters import PARAMETERS
from repose.calibrate.responses import Response
from repose.common.errors import InputError, require
from repose.common.files import Path_, read_table
from repose.common.tables import Column, is_number, read
from repose.stages.parameter_sets import OF_SETS

if TYPE_CHECKING:
    import pandas as pd

MOST = 449  # in each of two tables: their sample numbers are 101 to 999
OTHERS = "others.csv"  # beside the published solutions: sets of other works, with their source and wall
SIMULATED_BY = ("engine", "scene")  # hashes of what the pours of a set depend on
NAME = Column("solution", str, once=True)
HASHES = tuple(
    Column(name, str) for name in SIMULATED_BY
)  # one of digits alone is no number
STORED: tuple[str | Column, ...] = (
    "sample",
    "source",
    *PARAMETERS,
    "n_seeds",
    "status",
    NAME,
    *HASHES,
)
STALE = "stale: simulated with another engine or scene than today's; `snakemake published_sets` pours the sets anew"


def beside(path: Path_ | None, table: str) -> Path | None:
    """Find a table next to the published solutions: table1.csv (sizes) or table3.csv (intervals); None without it."""
    sibling = None if path is None else Path(path).with_name(table)
    return sibling if sibling and sibling.is_file() else None


def tables(path: Path_ | None) -> list[Path]:
    """List the table of published solutions, and `OTHERS` next to it; empty for None."""
    return [] if path is None else [Path(path), *filter(None, [beside(path, OTHERS)])]


def read_sets(path: Path_, names: Iterable[str] = PARAMETERS) -> "pd.DataFrame":
    """Read all published sets, with their parameters `names`; a set's `solution` is text."""
    import pandas as pd

    return pd.concat(
        [read_table(one, (NAME, *names)) for one in tables(path)], ignore_index=True
    )


def _rows(path: Path_ | None) -> list[dict[str, Any]]:
    """Read and check the rows of all published tables."""
    return [
        row
        for table in tables(path)
        for row in read(table, (NAME, *OF_SETS), others=is_number).rows()
    ]


def representative(
    path: Path_ | None, names: Collection[str] = PARAMETERS
) -> dict[str, float]:
    """Read the parameters `names` of the published representative solution; InputError if the table lacks one."""
    if path is None:
        raise InputError(
            "configuration",
            "validation.published",
            None,
            "a table of published solutions",
        )
    table = read(path, (NAME, *map(Column, names)))
    for row in table.rows():
        if row["solution"] == "representative":
            return {name: row[name] for name in names}
    raise InputError(path, "solution", None, "a row 'representative'")


def to_simulate(
    path: Path_ | None, responses: Iterable[Response], names: Iterable[str] = PARAMETERS
) -> list[str]:
    """Name the published sets, in their order; none of a table without a response or all parameters of the study."""
    rows = _rows(path)
    able = (
        rows and set(names) <= set(rows[0]) and published_responses(rows[0], responses)
    )
    return [row["solution"] for row in rows] if able else []


def check_published(path: Path_ | None) -> None:
    """Raise InputError for a table of published solutions that cannot be simulated or compared; None passes."""
    for table in tables(path):
        rows = len(read(table, (NAME, *OF_SETS), others=is_number))
        require(1 <= rows <= MOST, table, "rows", rows, f"1 to {MOST} solutions")


def read_stored(path: Path_) -> "pd.DataFrame":
    """Read the published sets as `snakemake published_sets` simulated them."""
    return read_table(path, STORED)


def published_sets(path: Path_ | None) -> list[dict[str, float]]:
    """Read the parameter sets of a published table that passed `check_published`; empty for None."""
    return [{name: row[name] for name in PARAMETERS} for row in _rows(path)]


def published_responses(
    columns: Iterable[str], responses: Iterable[Response]
) -> tuple[Response, ...]:
    """Find the responses whose predicted and simulated values are among the columns of a published table."""
    columns = set(columns)
    return tuple(
        response
        for response in responses
        if {response.predicted, response.simulated} <= columns
    )
