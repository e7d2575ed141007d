"""Files of measured berries: sizes and compression tests, checked value by value."""

import math
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from repose.common.errors import require
from repose.common.files import read_json
from repose.common.tables import Column, Fault, other_unit, read, refuse

if TYPE_CHECKING:
    import pandas as pd

SIZE_COLUMNS = ("long_mm", "major_mm", "minor_mm")
COMPRESSION_COLUMNS = (
    "test",
    "force_n",
    "length_1_mm",
    "length_2_mm",
    "width_1_mm",
    "width_2_mm",
    "breadth_mm",
)
LENGTHS_MM = (
    0.5,
    2000.0,
)  # of a grain; one of 20 mm in metres or micrometres lies outside
THINNEST = 0.12  # minor over major axis of a grain; a column in cm gives 0.1 or less
ALIKE = 5.0  # grains of one crop, and tested grains, differ by a smaller factor
MOST_STRAIN = 0.5  # of the width in a compression test: more gives no elastic modulus
WRITTEN = "the file of the verb berry"
MODULI = ("shear_modulus_pa", "poisson_ratio")  # a simulation needs them
# Quantities in it besides the axes.
POSITIVE = (
    "density_kg_m3",
    "elastic_modulus_pa",
    "shear_modulus_pa",
    "scale_low",
    "scale_high",
)
FROM_ZERO = {
    "poisson_ratio": 0.5,
    "scale_sd": 10.0,
}  # quantities that may be 0, and their largest values
# A comment line with this word marks a file whose rows were not measured but made to match a published table.
RECONSTRUCTION_MARK = "reconstruction"


def read_sizes(path: str | PathLike) -> "pd.DataFrame":
    """Read the full axes of measured berries [mm]: `long_mm`, `major_mm`, `minor_mm`, a row for each berry."""
    sizes = _read_numbers(
        path, SIZE_COLUMNS, 2, "berries, or there is no standard deviation"
    )
    (low, high), (longest, major, minor) = LENGTHS_MM, sizes.median().tolist()
    allowed = f"a median from {low:g} to {high:g}: are the sizes in millimetres?"
    require(low <= longest <= high, path, "long_mm", longest, allowed)
    allowed = f"a median of at least {THINNEST:g} of that of major_mm, {major:g}{other_unit('mm', minor / major)}"
    require(minor >= THINNEST * major, path, "minor_mm", minor, allowed)
    larger = dict(zip(SIZE_COLUMNS[1:], SIZE_COLUMNS, strict=False))
    faults: list[Fault] = []
    for name, column in sizes.items():
        faults += _unlike(column)
        other = larger.get(name, name)
        faults += [
            (
                row - 1,
                name,
                float(column[row]),
                f"at most {other} of the same grain, {sizes.at[row, other]:g}",
            )
            for row in sizes.index[column > sizes[other]]
        ]
    refuse(path, faults)
    return sizes


def read_compression(path: str | PathLike) -> "pd.DataFrame":
    """Read compression tests: `test`, `force_n`, lengths and widths 1 and 2, and `breadth_mm`.

    The berry lies on its broad side, the load is along its minor diameter W (width), and the loaded section has the
    axes L (length) and breadth; 1 is before, 2 after.
    """
    tests = _read_numbers(path, COMPRESSION_COLUMNS, 1, "compression test")
    faults: list[Fault] = []
    for k, (_, _, length_1, length_2, width_1, width_2, _) in enumerate(
        tests.itertuples(index=False)
    ):
        if not (1 - MOST_STRAIN) * width_1 <= width_2 < width_1:
            least = f"less than width_1_mm of the same test, {width_1:g}, and at least half of it"
            faults.append((k, "width_2_mm", width_2, least))
        if not length_1 <= length_2 <= (1 + MOST_STRAIN) * length_1:
            longer = f"at least length_1_mm of the same test, {length_1:g}, and at most half as much again"
            faults.append((k, "length_2_mm", length_2, longer))
    refuse(path, faults)
    refuse(
        path,
        [
            fault
            for name in ("length_1_mm", "width_1_mm", "breadth_mm")
            for fault in _unlike(tests[name])
        ],
    )
    return tests


def read_berry(
    path: str | PathLike, needed: Iterable[str] = SIZE_COLUMNS
) -> dict[str, Any]:
    """Read the file of the command `berry`; `needed` are keys that it must have."""
    berry = read_json(path, needed, WRITTEN)
    for key in (*needed, *(key for key in (*POSITIVE, *FROM_ZERO) if key in berry)):
        value, most = berry[key], FROM_ZERO.get(key)
        good = type(value) in (int, float) and math.isfinite(value) and value >= 0
        allowed = (
            "a positive number" if most is None else f"a number from 0 to {most:g}"
        )
        good = good and (value > 0 if most is None else value <= most)
        require(good, path, key, value, f"{allowed} in {WRITTEN}")
    return berry


def _unlike(column: "pd.Series") -> list[Fault]:
    """Find lengths that are far from the median of their column."""
    middle = column.median()
    odd = column.index[(column > ALIKE * middle) | (column < middle / ALIKE)]
    near = f"within a factor of {ALIKE:g} of the median, {middle:g} mm"
    return [
        (
            k - 1,
            str(column.name),
            float(column[k]),
            f"{near}{other_unit('mm', column[k] / middle)}",
        )
        for k in odd
    ]


def _read_numbers(
    path: str | PathLike, columns: Sequence[str], fewest: int, of: str
) -> "pd.DataFrame":
    """Read a table with these columns of positive numbers, indexed by row number from 1."""
    import pandas as pd  # slow to import: where there is a table

    label = Column("test", str, once=True)
    table = read(
        path,
        [
            label if name == label.name else Column(name, low=0.0, above=True)
            for name in columns
        ],
    )
    require(len(table) >= fewest, path, "rows", len(table), f"at least {fewest} {of}")
    numbers = pd.DataFrame(
        {name: table.values[name] for name in columns}, index=range(1, len(table) + 1)
    )
    numbers.attrs["reconstruction"] = any(
        RECONSTRUCTION_MARK in line.lower() for line in table.comments
    )
    return numbers
