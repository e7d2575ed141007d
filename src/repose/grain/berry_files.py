"""Read and check the files of measured grains: sizes and compression tests."""

import math
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from repose.common.errors import InputError
from repose.common.files import read_json
from repose.common.tables import Column, Fault, read, refuse

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

# Limits of plausible measurements
LENGTHS_MM = (0.5, 2000.0)  # a grain of 20 mm in metres or micrometres lies outside
THINNEST = 0.12  # minor over major axis; a column in cm gives 0.1 or less
SIZE_FACTOR = 5.0  # sizes of one crop, and of the tested grains, differ by less
MOST_STRAIN = 0.5  # of a compression test: with more there is no elastic modulus

# The file of the mean grain
WRITTEN = "the file of the verb berry"
MODULI = ("shear_modulus_pa", "poisson_ratio")  # a simulation needs them
# Its quantities besides the axes
POSITIVE = (
    "density_kg_m3",
    "elastic_modulus_pa",
    "shear_modulus_pa",
    "scale_low",
    "scale_high",
)
# Quantities that may be 0, and their largest values
FROM_ZERO = {"poisson_ratio": 0.5, "scale_sd": 10.0}

# A comment line with this word marks a file whose rows were not measured but made to
# match a published table.
RECONSTRUCTION_MARK = "reconstruction"


def read_sizes(path: str | PathLike) -> "pd.DataFrame":
    """Read the full axes of measured grains.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    DataFrame
        A row for each grain, with `long_mm`, `major_mm` and `minor_mm`. Its attribute
        ``reconstruction`` tells whether the rows were not measured.

    Raises
    ------
    InputError
        If the file is no such table, or its sizes are not plausible.
    """
    sizes = _read_numbers(path, SIZE_COLUMNS)
    if len(sizes) < 2:
        allowed = "at least 2 berries, or there is no standard deviation"
        raise InputError(path, "rows", len(sizes), allowed)

    # Medians that are impossible for grains show a wrong unit.
    long_mm, major_mm, minor_mm = sizes.median().tolist()
    low, high = LENGTHS_MM
    if not low <= long_mm <= high:
        allowed = f"a median from {low:g} to {high:g}: are the sizes in millimetres?"
        raise InputError(path, "long_mm", long_mm, allowed)
    if minor_mm < THINNEST * major_mm:
        allowed = (
            f"a median of at least {THINNEST:g} of that of major_mm, {major_mm:g}: are "
            "all columns in millimetres?"
        )
        raise InputError(path, "minor_mm", minor_mm, allowed)

    # Single sizes may be far from the others, or longer than the axis before them.
    faults: list[Fault] = []
    axis_before = None
    for axis in SIZE_COLUMNS:
        faults += _find_outliers(sizes[axis])
        if axis_before is not None:
            faults += _find_longer_axes(sizes, axis, axis_before)
        axis_before = axis
    refuse(path, faults)
    return sizes


def _find_longer_axes(
    sizes: "pd.DataFrame", axis: str, longer_axis: str
) -> list[Fault]:
    """Find grains of which an axis is longer than another that should be longer.

    Parameters
    ----------
    sizes : DataFrame
        A row for each grain, numbered from 1.
    axis, longer_axis : str
        Columns of the two axes.

    Returns
    -------
    list of tuple
        Row (from 0), column, value and allowed values of each fault.
    """
    faults: list[Fault] = []
    for row in sizes.index[sizes[axis] > sizes[longer_axis]]:
        allowed = (
            f"at most {longer_axis} of the same grain, {sizes.at[row, longer_axis]:g}"
        )
        faults.append((row - 1, axis, float(sizes.at[row, axis]), allowed))
    return faults


def read_compression(path: str | PathLike) -> "pd.DataFrame":
    """Read compression tests of single grains.

    The grain lies on its broad side. The load is along its minor diameter W (width),
    and the loaded section has the axes L (length) and breadth; 1 is before, 2 after.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    DataFrame
        A row for each test, with the columns `COMPRESSION_COLUMNS` and the attribute
        ``reconstruction`` of `read_sizes`.

    Raises
    ------
    InputError
        If the file is no such table, or its numbers are not plausible.
    """
    tests = _read_numbers(path, COMPRESSION_COLUMNS)
    if len(tests) < 1:
        allowed = "at least 1 compression test"
        raise InputError(path, "rows", len(tests), allowed)
    refuse(path, _find_strain_faults(tests))
    outliers: list[Fault] = []
    for column in ("length_1_mm", "width_1_mm", "breadth_mm"):
        outliers += _find_outliers(tests[column])
    refuse(path, outliers)
    return tests


def _find_strain_faults(tests: "pd.DataFrame") -> list[Fault]:
    """Find sizes after a test that are impossible by those before it.

    The load makes a grain narrower along its width and longer across it, but by at most
    the share `MOST_STRAIN`.

    Parameters
    ----------
    tests : DataFrame
        A row for each test, with the columns `COMPRESSION_COLUMNS`.

    Returns
    -------
    list of tuple
        Row (from 0), column, value and allowed values of each fault.
    """
    faults: list[Fault] = []
    for row, test in enumerate(tests.itertuples(index=False)):
        # The width may only shrink.
        width_mm = test.width_1_mm
        if not (1 - MOST_STRAIN) * width_mm <= test.width_2_mm < width_mm:
            allowed = (
                f"less than width_1_mm of the same test, {width_mm:g}, and at least "
                "half of it"
            )
            faults.append((row, "width_2_mm", test.width_2_mm, allowed))
        # The length may only grow.
        length_mm = test.length_1_mm
        if not length_mm <= test.length_2_mm <= (1 + MOST_STRAIN) * length_mm:
            allowed = (
                f"at least length_1_mm of the same test, {length_mm:g}, and at most "
                "half as much again"
            )
            faults.append((row, "length_2_mm", test.length_2_mm, allowed))
    return faults


def read_grain(
    path: str | PathLike, needed: Iterable[str] = SIZE_COLUMNS
) -> dict[str, Any]:
    """Read the file of the mean grain, which the command `berry` writes.

    Parameters
    ----------
    path : path
        The file.
    needed : iterable of str
        Keys that it must have.

    Returns
    -------
    dict
        The content of the file.

    Raises
    ------
    InputError
        If a key is missing, or a number is impossible.
    """
    grain = read_json(path, needed, WRITTEN)
    # Check the needed keys, and the other known numbers that the file has.
    known_keys = [key for key in (*POSITIVE, *FROM_ZERO) if key in grain]
    for key in (*needed, *known_keys):
        value = grain[key]
        is_number = type(value) in (int, float) and math.isfinite(value)
        if key in FROM_ZERO:
            largest = FROM_ZERO[key]
            allowed = f"a number from 0 to {largest:g} in {WRITTEN}"
            is_possible = is_number and 0 <= value <= largest
        else:
            allowed = f"a positive number in {WRITTEN}"
            is_possible = is_number and value > 0
        if not is_possible:
            raise InputError(path, key, value, allowed)
    return grain


def _find_outliers(column: "pd.Series") -> list[Fault]:
    """Find lengths that are far from the median of their column.

    Parameters
    ----------
    column : Series
        Lengths in mm, with rows numbered from 1.

    Returns
    -------
    list of tuple
        Row (from 0), column, value and allowed values of each fault.
    """
    median = column.median()
    is_far = (column > SIZE_FACTOR * median) | (column < median / SIZE_FACTOR)
    allowed = f"within a factor of {SIZE_FACTOR:g} of the median, {median:g} mm"
    name = str(column.name)
    return [
        (row - 1, name, float(column[row]), allowed) for row in column.index[is_far]
    ]


def _read_numbers(path: str | PathLike, names: Sequence[str]) -> "pd.DataFrame":
    """Read a table with columns of positive numbers.

    Parameters
    ----------
    path : path
        The file.
    names : sequence of str
        The columns. A column `test` has labels instead of numbers.

    Returns
    -------
    DataFrame
        The columns, with rows numbered from 1. The attribute ``reconstruction`` tells
        whether a comment in the file says that its rows were not measured.
    """
    import pandas as pd  # slow to import: where there is a table

    # Each label of a test occurs once; all numbers are above 0.
    columns = []
    for name in names:
        if name == "test":
            columns.append(Column(name, str, once=True))
        else:
            columns.append(Column(name, low=0.0, above=True))
    table = read(path, columns)
    values = {name: table.values[name] for name in names}
    frame = pd.DataFrame(values, index=range(1, len(table) + 1))
    frame.attrs["reconstruction"] = any(
        RECONSTRUCTION_MARK in comment.lower() for comment in table.comments
    )
    return frame
