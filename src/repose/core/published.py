"""Published tables for comparison with results."""

import math
import os
from collections.abc import Iterable
from pathlib import Path

from repose.core.errors import InputError
from repose.core.files import read_rows
from repose.core.parameters import PARAMETERS, check_value, named
from repose.core.responses import Response

MOST = 899  # their sample numbers are 101 to 999


def beside(path: str | os.PathLike | None, table: str) -> Path | None:
    """Another table beside the published solutions: table1.csv (sizes) or table3.csv (intervals); None without it."""
    sibling = None if path is None else Path(path).with_name(table)
    return sibling if sibling and sibling.is_file() else None


def representative(path: str | os.PathLike | None, names: Iterable[str] = PARAMETERS) -> dict[str, float]:
    """The contact parameters `names` of the published representative solution; InputError if the table lacks one."""
    names = tuple(names)
    if path is None:
        raise InputError("configuration", "validation.published", None, "a table of published solutions")
    for row in read_rows(path, ("solution", *names)):
        if row["solution"] == "representative":
            return {name: float(row[name]) for name in names}
    raise InputError(path, "solution", None, "a row 'representative'")


def published_count(
    path: str | os.PathLike | None, responses: Iterable[Response], names: Iterable[str] = PARAMETERS
) -> int:
    """Number of published solutions to simulate (`can_be_simulated`); 0 without a table."""
    if path is None:
        return 0
    rows = read_rows(path, ("solution", *PARAMETERS))
    return len(rows) if rows and can_be_simulated(rows[0], responses, names) else 0


def can_be_simulated(columns: Iterable[str], responses: Iterable[Response], names: Iterable[str]) -> bool:
    """Whether a published table has a response of the study, and all its parameters `names`."""
    columns = set(columns)
    return set(names) <= columns and bool(published_responses(columns, responses))


def check_published(path: str | os.PathLike | None, responses: Iterable[Response]) -> None:
    """Raise InputError for a table of published solutions that cannot be simulated or compared; None passes."""
    if path is None:
        return
    rows = read_rows(path, ("solution", *PARAMETERS))
    if not 1 <= len(rows) <= MOST:
        raise InputError(path, "rows", len(rows), f"1 to {MOST} solutions")
    values = [
        name
        for response in published_responses(rows[0], responses)
        for name in (response.predicted, response.simulated)
    ]
    for number, row in enumerate(rows, start=1):
        for name in named(row):
            check_value(name, row[name], f"{path}, row {number}")
        for name in values:
            if row[name] and not _finite(row[name]):
                raise InputError(f"{path}, row {number}", name, row[name], "a number, or nothing")


def published_sets(path: str | os.PathLike | None) -> list[dict[str, float]]:
    """Parameter sets of a published table that passed `check_published`; empty for None."""
    rows = [] if path is None else read_rows(path, ("solution", *PARAMETERS))
    return [{name: float(row[name]) for name in PARAMETERS} for row in rows]


def published_responses(columns: Iterable[str], responses: Iterable[Response]) -> tuple[Response, ...]:
    """Responses whose predicted and simulated values are among the columns of a published table."""
    columns = set(columns)
    return tuple(response for response in responses if {response.predicted, response.simulated} <= columns)


def _finite(text):
    """Whether a text is a finite number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
