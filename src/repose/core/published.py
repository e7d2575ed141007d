"""Published tables for comparison with results."""

import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from repose.core.errors import InputError
from repose.core.files import is_number, read_rows, read_table
from repose.core.parameters import PARAMETERS, check_value, named
from repose.core.responses import Response

if TYPE_CHECKING:
    import pandas as pd

MOST = 449  # in each of two tables: their sample numbers are 101 to 999
OTHERS = "others.csv"  # beside the published solutions: sets of other works, with their source and wall
SIMULATED_BY = ("engine", "scene")  # hashes of what the pours of a set depend on
STORED = ("sample", "solution", "source", *PARAMETERS, "n_seeds", "status", *SIMULATED_BY)
STALE = "stale: simulated with another engine or scene than today's; `snakemake published_sets` pours the sets anew"


def beside(path: str | os.PathLike | None, table: str) -> Path | None:
    """Find a table next to the published solutions: table1.csv (sizes) or table3.csv (intervals); None without it."""
    sibling = None if path is None else Path(path).with_name(table)
    return sibling if sibling and sibling.is_file() else None


def tables(path: str | os.PathLike | None) -> list[Path]:
    """List the table of published solutions, and `OTHERS` next to it; empty for None."""
    return [] if path is None else [Path(path), *filter(None, [beside(path, OTHERS)])]


def read_sets(path: str | os.PathLike, names: Iterable[str] = PARAMETERS) -> "pd.DataFrame":
    """Read all published sets, with their parameters `names`; a set's `solution` is text."""
    import pandas as pd

    read = [read_table(one, ("solution", *names)).astype({"solution": str}) for one in tables(path)]
    return pd.concat(read, ignore_index=True)


def representative(path: str | os.PathLike | None, names: Iterable[str] = PARAMETERS) -> dict[str, float]:
    """Read the parameters `names` of the published representative solution; InputError if the table lacks one."""
    names = tuple(names)
    if path is None:
        raise InputError("configuration", "validation.published", None, "a table of published solutions")
    for row in read_rows(path, ("solution", *names)):
        if row["solution"] == "representative":
            return {name: float(row[name]) for name in names}
    raise InputError(path, "solution", None, "a row 'representative'")


def to_simulate(
    path: str | os.PathLike | None, responses: Iterable[Response], names: Iterable[str] = PARAMETERS
) -> list[str]:
    """Name the published sets to simulate (`can_be_simulated`), in their order; none without a table."""
    rows = [row for one in tables(path) for row in read_rows(one, ("solution", *PARAMETERS))]
    able = bool(rows) and can_be_simulated(rows[0], responses, names)
    return [row["solution"] for row in rows] if able else []


def can_be_simulated(columns: Iterable[str], responses: Iterable[Response], names: Iterable[str]) -> bool:
    """Tell whether a published table has a response of the study, and all its parameters `names`."""
    columns = set(columns)
    return set(names) <= columns and bool(published_responses(columns, responses))


def check_published(path: str | os.PathLike | None) -> None:
    """Raise InputError for a table of published solutions that cannot be simulated or compared; None passes."""
    for table in tables(path):
        rows = read_rows(table, ("solution", *PARAMETERS))
        if not 1 <= len(rows) <= MOST:
            raise InputError(table, "rows", len(rows), f"1 to {MOST} solutions")
        for number, row in enumerate(rows, start=1):
            for name in named(row):
                check_value(name, row[name], f"{table}, row {number}")
            for name in filter(is_number, row):
                if row[name] and not _finite(row[name]):
                    raise InputError(f"{table}, row {number}", name, row[name], "a number, or nothing")


def read_stored(path: str | os.PathLike) -> "pd.DataFrame":
    """Read the published sets as `snakemake published_sets` simulated them."""
    table, rows = read_table(path, STORED), read_rows(path, STORED)
    # hashes of digits alone would be numbers
    return table.assign(**{name: [row[name] for row in rows] for name in ("solution", *SIMULATED_BY)})


def published_sets(path: str | os.PathLike | None) -> list[dict[str, float]]:
    """Read the parameter sets of a published table that passed `check_published`; empty for None."""
    rows = [row for table in tables(path) for row in read_rows(table, ("solution", *PARAMETERS))]
    return [{name: float(row[name]) for name in PARAMETERS} for row in rows]


def published_responses(columns: Iterable[str], responses: Iterable[Response]) -> tuple[Response, ...]:
    """Find the responses whose predicted and simulated values are among the columns of a published table."""
    columns = set(columns)
    return tuple(response for response in responses if {response.predicted, response.simulated} <= columns)


def _finite(text: str) -> bool:
    """Tell whether a text is a finite number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
