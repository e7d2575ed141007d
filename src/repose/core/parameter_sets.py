"""Tables of parameter sets, as the verb design writes them: a number `sample` and the parameters."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from repose.core.errors import InputError
from repose.core.files import read_rows, read_table
from repose.core.parameters import PARAMETERS, check_value, named

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("sample", *PARAMETERS)


def read_samples(path: str | os.PathLike) -> "pd.DataFrame":
    """Read all parameter sets of a table: `sample` (each number once), the six parameters, perhaps more columns."""
    samples = read_table(path, COLUMNS)
    twice = samples["sample"][samples["sample"].duplicated()]
    if len(twice):
        raise InputError(path, "sample", int(twice.iloc[0]), "each sample once")
    return samples


def job_files(words: Iterable[str], samples_csv: str | os.PathLike, ending: str = ".json") -> list[Path]:
    """List job files; a folder among the `words` stands for one file with this ending for each sample of the design."""
    paths = [Path(word) for word in words]
    samples = read_rows(samples_csv, ("sample",)) if any(path.is_dir() for path in paths) else []
    names = [f"{row['sample'].zfill(3)}{ending}" for row in samples]
    return [file for path in paths for file in ([path / name for name in names] if path.is_dir() else [path])]


def read_sample(path: str | os.PathLike, number: int) -> dict[str, float]:
    """Read the parameters of a sample from a table, without rounding; InputError beyond the contact law's limits."""
    rows: dict[str, dict[str, str]] = {}
    for row in read_rows(path, COLUMNS):
        if rows.setdefault(row["sample"], row) is not row:
            raise InputError(path, "sample", row["sample"], "each sample once")
    if str(number) not in rows:
        raise InputError(path, "sample", number, f"one of {len(rows)}: {', '.join(list(rows)[:3])}, ...")
    source = f"{path}, sample {number}"
    row = rows[str(number)]
    return {name: check_value(name, row[name], source) for name in named(row)}
