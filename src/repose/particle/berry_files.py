"""Files of measured berries: sizes and compression tests, checked value by value."""

import csv
import math
from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.core.errors import InputError
from repose.core.files import read_json

if TYPE_CHECKING:
    import pandas as pd

SIZE_COLUMNS = ("long_mm", "major_mm", "minor_mm")
COMPRESSION_COLUMNS = ("test", "force_n", "length_1_mm", "length_2_mm", "width_1_mm", "width_2_mm", "breadth_mm")
LENGTHS_MM = (0.5, 2000.0)  # of a grain; one of 20 mm in metres or micrometres lies outside
ALIKE = 5.0  # grains of one crop, and tested grains, differ by a smaller factor
WRITTEN = "the file of the verb berry"
MODULI = ("shear_modulus_pa", "poisson_ratio")  # a simulation needs them
# Quantities in it besides the axes.
POSITIVE = ("density_kg_m3", "elastic_modulus_pa", "shear_modulus_pa", "scale_low", "scale_high")
FROM_ZERO = {"poisson_ratio": 0.5, "scale_sd": 10.0}  # quantities that may be 0, and their largest values
# A comment line with this word marks a file whose rows were not measured but made to match a published table.
RECONSTRUCTION_MARK = "reconstruction"


def read_sizes(path: str | PathLike) -> "pd.DataFrame":
    """Full axes of measured berries [mm]: `long_mm`, `major_mm`, `minor_mm`, a row for each berry."""
    sizes = _read_numbers(path, SIZE_COLUMNS)
    if len(sizes) < 2:
        raise InputError(path, "rows", len(sizes), "at least 2 berries, or there is no standard deviation")
    middle = sizes.median()
    low, high = LENGTHS_MM
    if not low <= middle["long_mm"] <= high:
        allowed = f"a median from {low:g} to {high:g}: are the sizes in millimetres?"
        raise InputError(path, "long_mm", float(middle["long_mm"]), allowed)
    for column in SIZE_COLUMNS:
        ratio = sizes[column] / middle[column]
        for row in sizes.index[(ratio > ALIKE) | (ratio < 1 / ALIKE)]:
            allowed = f"within a factor of {ALIKE:g} of the median, {middle[column]:g}: is the row in millimetres?"
            raise InputError(f"{path}, row {row}", column, float(sizes.at[row, column]), allowed)
    for larger, smaller in (("long_mm", "major_mm"), ("major_mm", "minor_mm")):
        for row in sizes.index[sizes[smaller] > sizes[larger]]:
            raise InputError(
                f"{path}, row {row}",
                smaller,
                float(sizes.at[row, smaller]),
                f"at most {larger} of the same berry, {sizes.at[row, larger]:g}",
            )
    return sizes


def read_compression(path: str | PathLike) -> "pd.DataFrame":
    """Compression tests: `test`, `force_n`, `length_1_mm`, `length_2_mm`, `width_1_mm`, `width_2_mm`, `breadth_mm`.

    The berry lies on its broad side, the load is along its minor diameter W (width), and the loaded section has the
    axes L (length) and breadth; 1 is before, 2 after.
    """
    tests = _read_numbers(path, COMPRESSION_COLUMNS)
    if tests.empty:
        raise InputError(path, "rows", 0, "at least 1 compression test")
    for row in tests.index[tests["width_2_mm"] >= tests["width_1_mm"]]:
        raise InputError(
            f"{path}, row {row}",
            "width_2_mm",
            float(tests.at[row, "width_2_mm"]),
            f"less than width_1_mm of the same test, {tests.at[row, 'width_1_mm']:g}",
        )
    return tests


def read_berry(path: str | PathLike, needed: Iterable[str] = SIZE_COLUMNS) -> dict[str, Any]:
    """The file of the command `berry`; `needed` are keys that it must have."""
    berry = read_json(path, needed, WRITTEN)
    for key in (*needed, *(key for key in (*POSITIVE, *FROM_ZERO) if key in berry)):
        value, most = berry[key], FROM_ZERO.get(key)
        good = type(value) in (int, float) and math.isfinite(value)
        if not good or (value <= 0 if most is None else not 0 <= value <= most):
            allowed = "a positive number" if most is None else f"a number from 0 to {most:g}"
            raise InputError(path, key, value, f"{allowed} in {WRITTEN}")
    return berry


def _read_numbers(path: str | PathLike, columns: Sequence[str]) -> "pd.DataFrame":
    """Read a CSV with these columns of positive numbers, indexed by row number from 1; comments start with #."""
    import pandas as pd  # slow to import: where there is a table

    path = Path(path)
    if not path.is_file():
        raise InputError(path, "file", None, "an existing CSV file")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(path, "file", "not text", "a CSV file in UTF-8") from None
    lines = text.splitlines()
    comments = [line for line in lines if line.lstrip('"').startswith("#")]
    records: list[list[str]] = []
    for number, line in enumerate(lines, start=1):
        if line.strip() and line not in comments:
            try:
                records += csv.reader([line], strict=True, skipinitialspace=True)
            except csv.Error as error:
                raise InputError(f"{path}, line {number}", "cells", line, f"CSV: {error}") from None
    header = [name.strip() for name in records[0]] if records else []
    if len(header) == 1 and set(header[0]) & {";", "\t"}:
        raise InputError(path, "header", header[0], "columns separated by commas")
    for column in columns:
        if header.count(column) != 1:
            raise InputError(path, "header", ",".join(header), f"a column {column}, once; all: {','.join(columns)}")
    table = pd.DataFrame(index=range(1, len(records)), columns=list(columns), dtype=float)
    for row, cells in enumerate(records[1:], start=1):
        if len(cells) != len(header):
            raise InputError(f"{path}, row {row}", "cells", len(cells), f"{len(header)}, as in the header")
        for column in columns:
            table.at[row, column] = _positive(cells[header.index(column)].strip(), f"{path}, row {row}", column)
    table.attrs["reconstruction"] = any(RECONSTRUCTION_MARK in line.lower() for line in comments)
    return table


def _positive(text: str, source: str, column: str) -> float:
    """Return the text as a positive finite number, or raise InputError."""
    try:
        value = math.nan if "_" in text else float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise InputError(source, column, text, "a positive number")
    return value
