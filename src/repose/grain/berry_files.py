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
# The size of a 20 mm grain lies outside them if it is given in metres or micrometres.
PLAUSIBLE_LENGTHS_MM = (0.5, 2000.0)
# Minor axis over major axis. If only the minor axis is in cm, the ratio is at most 0.1.
SMALLEST_WIDTH_RATIO = 0.12
# Grains of one crop differ from their median size by less than this factor.
LARGEST_SIZE_RATIO = 5.0
# Beyond this strain a compression test does not measure the elastic modulus.
LARGEST_STRAIN = 0.5

# How messages refer to the file of the mean grain
GRAIN_FILE = "the file of the verb berry"
MODULI = ("shear_modulus_pa", "poisson_ratio")  # keys that a simulation needs
# Keys of the mean grain, besides the axes, whose values must be positive
POSITIVE_KEYS = (
    "density_kg_m3",
    "elastic_modulus_pa",
    "shear_modulus_pa",
    "scale_low",
    "scale_high",
)
# Keys of the mean grain whose values may be 0, and the largest value of each
LARGEST_VALUES = {"poisson_ratio": 0.5, "scale_sd": 10.0}

# A comment line with this word marks a file whose rows were not measured but made to
# match a published table.
RECONSTRUCTION_MARK = "reconstruction"


def read_sizes(path: str | PathLike) -> "pd.DataFrame":
    """Read and check the lengths of measured grains along their three axes.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    DataFrame
        A row for each grain, with `long_mm`, `major_mm` and `minor_mm`.
        ``attrs["reconstruction"]`` is True if the rows were not measured, but made to
        match published statistics.

    Raises
    ------
    InputError
        If the file does not contain such a table, has fewer than two grains, or if a
        size is implausible.
    """
    sizes = _read_numbers(path, SIZE_COLUMNS)
    if len(sizes) < 2:
        allowed = "at least 2 grains: a single one has no standard deviation"
        raise InputError(path, "rows", len(sizes), allowed)

    # First check the columns. A median that is impossible for grains indicates a wrong
    # unit.
    long_mm, major_mm, minor_mm = sizes.median().tolist()
    low, high = PLAUSIBLE_LENGTHS_MM
    if not low <= long_mm <= high:
        allowed = f"a median from {low:g} to {high:g}: are the sizes in millimetres?"
        raise InputError(path, "long_mm", long_mm, allowed)
    if minor_mm < SMALLEST_WIDTH_RATIO * major_mm:
        allowed = (
            f"a median of at least {SMALLEST_WIDTH_RATIO:g} of that of major_mm, "
            f"{major_mm:g}: are all columns in millimetres?"
        )
        raise InputError(path, "minor_mm", minor_mm, allowed)

    # Then check each grain. A size must not be far from the median of its column, and
    # an axis must not be longer than the one in the previous column. `refuse` raises an
    # error if there are any problems.
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
    """Find grains in which one axis exceeds another that should be at least as long.

    Parameters
    ----------
    sizes : DataFrame
        A row for each grain. The rows are numbered from 1.
    axis : str
        Column of the axis to check.
    longer_axis : str
        Column of the axis that should be at least as long.

    Returns
    -------
    list of tuple
        For each such grain: row number (from 0), name of the column, value, and the
        values that are allowed.
    """
    faults: list[Fault] = []
    for row in sizes.index[sizes[axis] > sizes[longer_axis]]:
        allowed = (
            f"at most {longer_axis} of the same grain, {sizes.at[row, longer_axis]:g}"
        )
        # The rows of a `Fault` are numbered from 0.
        faults.append((row - 1, axis, float(sizes.at[row, axis]), allowed))
    return faults


def read_compression(path: str | PathLike) -> "pd.DataFrame":
    """Read compression tests of single grains.

    The grain lies on its broad side. The load acts along its shortest axis, which is
    called the width. The cross-section that carries the load has the other two axes,
    the length and the breadth. In the name of a column, 1 marks a size before loading,
    and 2 the same size under load.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    DataFrame
        A row for each test, with the columns `COMPRESSION_COLUMNS`.
        ``attrs["reconstruction"]`` is True if the rows were not measured, but made to
        match published means.

    Raises
    ------
    InputError
        If the file does not contain such a table, or if a size is implausible.
    """
    tests = _read_numbers(path, COMPRESSION_COLUMNS)
    if len(tests) < 1:
        allowed = "at least 1 compression test"
        raise InputError(path, "rows", len(tests), allowed)
    refuse(path, _find_strain_faults(tests))
    # Sizes that are far from the median of their column are reported only if all
    # strains are possible. `refuse` raises an error if there are any problems.
    outliers: list[Fault] = []
    for column in ("length_1_mm", "width_1_mm", "breadth_mm"):
        outliers += _find_outliers(tests[column])
    refuse(path, outliers)
    return tests


def _find_strain_faults(tests: "pd.DataFrame") -> list[Fault]:
    """Find sizes under load that are impossible, given the sizes before loading.

    The load compresses the width of a grain and may lengthen the grain. Neither size
    changes by more than the fraction `LARGEST_STRAIN`. The messages call this fraction
    a half.

    Parameters
    ----------
    tests : DataFrame
        A row for each test, with the columns `COMPRESSION_COLUMNS`. In the name of a
        column, 1 marks a size before loading, and 2 the same size under load.

    Returns
    -------
    list of tuple
        For each such size: row number (from 0), name of the column, value, and the
        values that are allowed.
    """
    faults: list[Fault] = []
    for row, test in enumerate(tests.itertuples(index=False)):
        # The width must shrink.
        width_mm = test.width_1_mm
        if not (1 - LARGEST_STRAIN) * width_mm <= test.width_2_mm < width_mm:
            allowed = (
                f"less than width_1_mm of the same test, {width_mm:g}, and at least "
                "half of it"
            )
            faults.append((row, "width_2_mm", test.width_2_mm, allowed))
        # The length must not shrink.
        length_mm = test.length_1_mm
        if not length_mm <= test.length_2_mm <= (1 + LARGEST_STRAIN) * length_mm:
            allowed = (
                f"at least length_1_mm of the same test, {length_mm:g}, and at most "
                "half as much again"
            )
            faults.append((row, "length_2_mm", test.length_2_mm, allowed))
    return faults


def read_grain(
    path: str | PathLike, needed: Iterable[str] = SIZE_COLUMNS
) -> dict[str, Any]:
    """Read and check the file of the mean grain, which the command `berry` writes.

    Parameters
    ----------
    path : path
        The file.
    needed : iterable of str
        Keys that the file must have. Their values are positive numbers, except those in
        `LARGEST_VALUES`.

    Returns
    -------
    dict
        The contents of the file.

    Raises
    ------
    InputError
        If a key is missing, or if a number is out of range.
    """
    grain = read_json(path, needed, GRAIN_FILE)
    # Check the needed keys, and all other keys that are known. The needed keys may be
    # among the known ones. A second check of a value does no harm.
    known_keys = [key for key in (*POSITIVE_KEYS, *LARGEST_VALUES) if key in grain]
    for key in (*needed, *known_keys):
        value = grain[key]
        # Types are compared because `isinstance` would accept True and False as
        # integers.
        is_number = type(value) in (int, float) and math.isfinite(value)
        if key in LARGEST_VALUES:
            largest = LARGEST_VALUES[key]
            allowed = f"a number from 0 to {largest:g} in {GRAIN_FILE}"
            is_possible = is_number and 0 <= value <= largest
        else:
            allowed = f"a positive number in {GRAIN_FILE}"
            is_possible = is_number and value > 0
        if not is_possible:
            raise InputError(path, key, value, allowed)
    return grain


def _find_outliers(column: "pd.Series") -> list[Fault]:
    """Find lengths that are far from the median of their column.

    Parameters
    ----------
    column : Series
        Lengths in mm. The rows are numbered from 1.

    Returns
    -------
    list of tuple
        For each such length: row number (from 0), name of the column, value, and the
        values that are allowed.
    """
    median = column.median()
    is_too_long = column > LARGEST_SIZE_RATIO * median
    is_too_short = column < median / LARGEST_SIZE_RATIO
    outliers = column[is_too_long | is_too_short]
    allowed = f"within a factor of {LARGEST_SIZE_RATIO:g} of the median, {median:g} mm"
    name = str(column.name)
    # The rows of a `Fault` are numbered from 0.
    return [(row - 1, name, float(length), allowed) for row, length in outliers.items()]


def _read_numbers(path: str | PathLike, names: Sequence[str]) -> "pd.DataFrame":
    """Read a table of measurements, whose columns contain positive numbers.

    Parameters
    ----------
    path : path
        The file.
    names : sequence of str
        The names of the columns. The column `test` contains the labels of tests instead
        of numbers.

    Returns
    -------
    DataFrame
        The columns, with rows numbered from 1. ``attrs["reconstruction"]`` is True if a
        comment in the file says that its rows were not measured
        (`RECONSTRUCTION_MARK`).
    """
    # pandas is slow to import, so it is imported only where a table is read.
    import pandas as pd

    # The labels of the tests must be unique (`once`). All numbers must be above the
    # limit `low`, and not equal to it (`above`).
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
