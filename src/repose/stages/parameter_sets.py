"""Read tables of parameter sets, as the stage `design` writes them.

Each row has the number of the sample in the column `sample`, and its parameters.
"""

import csv
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from repose.bench.parameters import PARAMETERS, PHYSICAL_LIMITS, parameters_among
from repose.common import ledger, tables
from repose.common.errors import InputError
from repose.common.files import read_table
from repose.common.tables import Column

if TYPE_CHECKING:
    import pandas as pd

SAMPLE_COLUMN = Column("sample", int, low=1, once=True)
PARAMETER_COLUMNS = tuple(
    Column(name, float, *limits, needed=name in PARAMETERS)
    for name, limits in PHYSICAL_LIMITS.items()
)


def list_parameters(
    columns: Iterable[str], parameter_names: Sequence[str] | None = None
) -> tuple[str, ...]:
    """List the parameters of a table.

    Parameters
    ----------
    columns : iterable of str
        Columns of the table.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. With None,
        repose simulates it.

    Returns
    -------
    tuple of str
        `parameter_names`, or if it is None, the contact parameters among the columns.
    """
    return (
        parameters_among(columns) if parameter_names is None else tuple(parameter_names)
    )


def read_samples(
    path: str | os.PathLike,
    further_columns: Iterable[str] = (),
    parameter_names: Sequence[str] | None = None,
) -> "pd.DataFrame":
    """Read all parameter sets of a table.

    Parameters
    ----------
    path : path
        The table.
    further_columns : iterable of str, optional
        Further columns that it must have.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    pandas.DataFrame
        `sample` (each number once), the parameters, `further_columns`, and any other
        columns of the table.
    """
    return read_table(
        path, (SAMPLE_COLUMN, *_describe_columns(parameter_names), *further_columns)
    )


def _describe_columns(parameter_names: Sequence[str] | None) -> tuple[Column, ...]:
    """Describe the columns of the parameters. Contact parameters have limits."""
    return (
        PARAMETER_COLUMNS
        if parameter_names is None
        else tuple(map(Column, parameter_names))
    )


def list_job_files(
    arguments: Iterable[str], samples_csv: str | os.PathLike, suffix: str = ".json"
) -> list[Path]:
    """List the files of jobs from the paths in the arguments of a command line.

    Parameters
    ----------
    arguments : iterable of str
        Paths of files and folders. A folder stands for the files of all samples in it.
    samples_csv : path
        The table of samples. It is read only if one of the paths is a folder.
    suffix : str, optional
        End of the name of each file in a folder, after the number of the sample.

    Returns
    -------
    list of Path
        The files in the order of the arguments. They need not exist.
    """
    paths = [Path(argument) for argument in arguments]

    # The files in a folder have the numbers of the samples, such as 001.json.
    names: list[str] = []
    if any(path.is_dir() for path in paths):
        samples = tables.read(samples_csv, [SAMPLE_COLUMN]).values["sample"]
        names = [f"{sample:03d}{suffix}" for sample in samples]

    files = []
    for path in paths:
        if path.is_dir():
            files += [path / name for name in names]
        else:
            files.append(path)
    return files


def read_sample(
    path: str | os.PathLike, number: int, parameter_names: Sequence[str] | None = None
) -> dict[str, float]:
    """Read the parameters of a sample from a table.

    The numbers are those of the file, without rounding, so that equal samples give
    equal runs.

    Parameters
    ----------
    path : path
        The table.
    number : int
        Number of the sample.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    dict
        The value of each parameter.

    Raises
    ------
    InputError
        If there is no such sample, or a value is beyond the limits of the contact law.
    """
    # This program checked its own tables when it wrote them, so only check other
    # tables. The result is None for a table that another program wrote or changed.
    columns = _read_unchanged_table(path)
    if columns is None:
        table = tables.read(path, (SAMPLE_COLUMN, *_describe_columns(parameter_names)))
        columns = table.values
    numbers = columns["sample"]
    if number not in numbers:
        first_numbers = ", ".join(map(str, numbers[:3]))
        raise InputError(
            path,
            key="sample",
            value=number,
            allowed=f"one of {len(numbers)}: {first_numbers}, ...",
        )
    row = numbers.index(number)
    return {
        name: columns[name][row] for name in list_parameters(columns, parameter_names)
    }


def _read_unchanged_table(path: str | os.PathLike) -> dict[str, list] | None:
    """Read a table without checks, if this program wrote it and nothing changed it.

    `tables.read` is avoided here, because it imports large libraries. Their import
    takes a third of the time of a job that starts another program.

    Parameters
    ----------
    path : path
        The table.

    Returns
    -------
    dict or None
        The numbers of each column by its name. None if the table must be checked,
        because another program wrote or changed it, or because not all cells are
        numbers.
    """
    if not ledger.is_own_file(path):
        return None
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    try:
        columns: dict[str, list] = {
            name: [float(row[name]) for row in rows] for name in rows[0]
        }
        columns["sample"] = [int(row["sample"]) for row in rows]
    except (IndexError, KeyError, TypeError, ValueError):
        return None
    return columns
