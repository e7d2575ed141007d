"""Tables of parameter sets, as the verb design writes them: a number `sample` and the parameters."""

import os
from typing import TYPE_CHECKING

from repose.core.errors import InputError
from repose.core.files import read_rows, read_table
from repose.core.parameters import PARAMETERS, check_value, named

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("sample", *PARAMETERS)


def read_samples(path: str | os.PathLike) -> "pd.DataFrame":
    """All parameter sets of a table: `sample` (each number once), the six parameters, perhaps more columns."""
    samples = read_table(path, COLUMNS)
    twice = samples["sample"][samples["sample"].duplicated()]
    if len(twice):
        raise InputError(path, "sample", int(twice.iloc[0]), "each sample once")
    return samples


def read_sample(path: str | os.PathLike, number: int) -> dict[str, float]:
    """The parameters of a sample of a table, without rounding; InputError beyond the contact law's limits."""
    rows = {row["sample"]: row for row in read_rows(path, COLUMNS)}
    if str(number) not in rows:
        raise InputError(path, "sample", number, f"one of {len(rows)}: {', '.join(list(rows)[:3])}, ...")
    source = f"{path}, sample {number}"
    row = rows[str(number)]
    return {name: check_value(name, row[name], source) for name in named(row)}
