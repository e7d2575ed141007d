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
# A grain of 20 mm would be below them in metres, and above them in micrometres.
PLAUSIBLE_LENGTHS_MM = (0.5, 2000.0)
# Ratio of minor and major axis. If the minor axis is in cm, the ratio is 0.1 or less.
SMALLEST_WIDTH_RATIO = 0.12
# Sizes of grains of one crop differ by a smaller factor from their median.
LARGEST_SIZE_RATIO = 5.0
# With more strain a compression test gives no elastic modulus.
LARGEST_STRAIN = 0.5

# The file of the mean grain, in words for messages
GRAIN_FILE = "the file of the verb berry"
MODULI = ("shear_modulus_pa", "poisson_ratio")  # keys that a simulation needs
# Keys of its positive quantities besides the axes
POSITIVE_KEYS = (
    "density_kg_m3",
    "elastic_modulus_pa",
    "shear_modulus_pa",
    "scale_low",
    "scale_high",
)
# Largest values of the quantities that may be 0, by key
LARGEST_VALUES = {"poisson_ratio": 0.5, "scale_sd": 10.0}

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
        allowed = "at least 2 grains: a single one has no standard deviation"
        raise InputError(path, "rows", len(sizes), allowed)

    # Medians that are impossible for grains show a wrong unit.
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

    # Check single grains: a size may be far from the median of its column, or larger
    # than the axis in the column before.
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
    """Find grains with an axis that exceeds another axis which should be the longer one.

    Parameters
    ----------
    sizes : DataFrame
        A row for each grain. The rows are numbered from 1.
    axis : str
        Column of an axis.
    longer_axis : str
        Column of the axis that should be at least as long.

    Returns
    -------
    list of tuple
        Row number (from 0), column, value and allowed values of each fault.
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

    The grain lies on its broad side. The load is along its minor diameter, the width.
    The loaded section has the axes length and breadth. The number 1 in a column stands
    for the size before the load, and 2 for the size under it.

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
    """Find sizes under the load that the sizes before the load make impossible.

    The load makes a grain narrower along its width and longer across it. Each change is
    at most the share `LARGEST_STRAIN`.

    Parameters
    ----------
    tests : DataFrame
        A row for each test, with the columns `COMPRESSION_COLUMNS`.

    Returns
    -------
    list of tuple
        Row number (from 0), column, value and allowed values of each fault.
    """
    faults: list[Fault] = []
    for row, test in enumerate(tests.itertuples(index=False)):
        # The width may only shrink.
        width_mm = test.width_1_mm
        if not (1 - LARGEST_STRAIN) * width_mm <= test.width_2_mm < width_mm:
            allowed = (
                f"less than width_1_mm of the same test, {width_mm:g}, and at least "
                "half of it"
            )
            faults.append((row, "width_2_mm", test.width_2_mm, allowed))
        # The length may only grow.
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
    """Read the file of the mean grain, which the command `berry` writes.

    Parameters
    ----------
    path : path
        The file.
    needed : iterable of str
        Keys that the file must have.

    Returns
    -------
    dict
        The content of the file.

    Raises
    ------
    InputError
        If a key is missing, or a number is impossible.
    """
    grain = read_json(path, needed, GRAIN_FILE)
    # Check the needed keys, and other known keys that the file may have. A needed key
    # may be checked twice.
    known_keys = [key for key in (*POSITIVE_KEYS, *LARGEST_VALUES) if key in grain]
    for key in (*needed, *known_keys):
        value = grain[key]
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
        Row number (from 0), column, value and allowed values of each fault.
    """
    median = column.median()
    is_too_long = column > LARGEST_SIZE_RATIO * median
    is_too_short = column < median / LARGEST_SIZE_RATIO
    outliers = column[is_too_long | is_too_short]
    allowed = f"within a factor of {LARGEST_SIZE_RATIO:g} of the median, {median:g} mm"
    name = str(column.name)
    return [(row - 1, name, float(length), allowed) for row, length in outliers.items()]


def _read_numbers(path: str | PathLike, names: Sequence[str]) -> "pd.DataFrame":
    """Read a table with columns of positive numbers.

    Parameters
    ----------
    path : path
        The file.
    names : sequence of str
        The names of the columns. The column `test` has labels instead of numbers.

    Returns
    -------
    DataFrame
        The columns, with rows numbered from 1. The attribute ``reconstruction`` tells
        whether a comment in the file says that its rows were not measured.
    """
    # pandas is slow to import, so it is imported only where a table is read.
    import pandas as pd

    # Each label of a test may occur once. All numbers must be above 0.
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
