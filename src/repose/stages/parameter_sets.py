"""Tables of parameter sets, as the verb design writes them: a number `sample` and the parameters."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from repose.bench.parameters import PARAMETERS, PHYSICAL_LIMITS, named
from repose.common import tables
from repose.common.errors import InputError
from repose.common.files import read_table
from repose.common.tables import Column

if TYPE_CHECKING:
    import pandas as pd

NUMBER = Column("sample", int, low=1, once=True)
OF_SETS = tuple(
    Column(name, float, *limits, needed=name in PARAMETERS)
    for name, limits in PHYSICAL_LIMITS.items()
)


def read_samples(path: str | os.PathLike, more: Iterable[str] = ()) -> "pd.DataFrame":
    """Read all parameter sets of a table: `sample` (each number once), the six parameters, `more` and other columns."""
    return read_table(path, (NUMBER, *OF_SETS, *more))


def job_files(
    words: Iterable[str], samples_csv: str | os.PathLike, ending: str = ".json"
) -> list[Path]:
    """List job files; a folder among the `words` stands for one file with this ending for each sample of the design."""
    paths = [Path(word) for word in words]
    samples = (
        tables.read(samples_csv, [NUMBER]).values["sample"]
        if any(path.is_dir() for path in paths)
        else []
    )
    names = [f"{number:03d}{ending}" for number in samples]
    return [
        file
        for path in paths
        for file in ([path / name for name in names] if path.is_dir() else [path])
    ]


def read_sample(path: str | os.PathLike, number: int) -> dict[str, float]:
    """Read the parameters of a sample from a table, without rounding; InputError beyond the contact law's limits."""
    table = tables.read(path, (NUMBER, *OF_SETS)).values
    numbers = table["sample"]
    if number not in numbers:
        raise InputError(
            path,
            "sample",
            number,
            f"one of {len(numbers)}: {', '.join(map(str, numbers[:3]))}, ...",
        )
    return {name: table[name][numbers.index(number)] for name in named(table)}
