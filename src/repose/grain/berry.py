"""Compute mean size, sphericity and elastic moduli of measured grains.

The functions implement Equations 1 to 4 of the paper.
"""

import math
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.common.errors import InputError, raise_together
from repose.common.files import read_table, write_json, write_table
from repose.common.numbers import format_significant
from repose.common.tables import Column
from repose.grain import size_distribution
from repose.grain.berry_files import (
    LARGEST_SIZE_RATIO,
    SIZE_COLUMNS,
    read_compression,
    read_sizes,
)
from repose.grain.particle import check_positive
from repose.grain.settings import GrainSettings

# Columns of the compression tests, and the axis of the grain that each one measures
AXIS_BY_TEST_COLUMN = {
    "length_1_mm": "long_mm",
    "width_1_mm": "minor_mm",
    "breadth_mm": "major_mm",
}
# A force is implausible if its modulus differs from the median by a larger factor.
LARGEST_MODULUS_RATIO = 30.0
# Smallest and largest plausible elastic modulus: those of a jelly and of diamond
PLAUSIBLE_MODULI_PA = (1e3, 1e12)

# Columns of the published table of sizes
TABLE1_NAMES = ("dimension", "maximum", "minimum", "mean")
TABLE1_COLUMNS = [
    Column(name, str if name == "dimension" else float) for name in TABLE1_NAMES
]

# One number, or a column of them.
Numbers = Any


class Moduli(NamedTuple):
    """Elastic constants of a material."""

    elastic_pa: float
    poisson_ratio: float
    shear_pa: float


class _Elasticity(NamedTuple):
    """Elastic constants that a simulation needs, and their origin."""

    poisson_ratio: float
    shear_pa: float
    is_reconstructed: bool  # whether they come from rows that were not measured


def equivalent_diameter(long: Numbers, major: Numbers, minor: Numbers) -> Numbers:
    """Compute the diameter of the sphere with the volume of an ellipsoid (Eq. 1).

    The cube of this diameter is the product of the three full axes.
    """
    return np.cbrt(long * major * minor)


def sphericity(long: Numbers, major: Numbers, minor: Numbers) -> Numbers:
    """Compute the sphericity: the equivalent diameter over the long axis (Eq. 1).

    The result is a fraction; the paper gives it in percent.
    """
    return equivalent_diameter(long, major, minor) / long


def elastic_modulus(
    force_n: Numbers,
    length_m: Numbers,
    breadth_m: Numbers,
    width_1_m: Numbers,
    width_2_m: Numbers,
) -> Numbers:
    """Compute the elastic modulus [Pa]: stress over strain along the load (Eq. 2).

    The cross-section that carries the load is an ellipse.

    Parameters
    ----------
    force_n : float
        Force on the grain.
    length_m, breadth_m : float
        Full axes of this cross-section.
    width_1_m, width_2_m : float
        Width of the grain along the load, before loading and under load.
    """
    section = math.pi / 4 * length_m * breadth_m
    strain = (width_1_m - width_2_m) / width_1_m
    return force_n / section / strain


def poisson_ratio(
    length_1: Numbers, length_2: Numbers, width_1: Numbers, width_2: Numbers
) -> Numbers:
    """Compute the absolute value of Poisson's ratio (Eq. 3).

    The ratio is the strain of the length divided by the strain of the loaded width. The
    suffix 1 marks a size before loading, and 2 the same size under load.
    """
    length_strain = (length_2 - length_1) / length_1
    width_strain = (width_2 - width_1) / width_1
    return np.abs(length_strain / width_strain)


def shear_modulus(elastic_modulus_pa: float, poisson: float) -> float:
    """Compute the shear modulus G = E / (2 (1 + nu)) (Eq. 4)."""
    return elastic_modulus_pa / (2 * (1 + poisson))


def compute_moduli(tests: pd.DataFrame) -> Moduli:
    """Compute the mean moduli of compression tests (`read_compression`).

    The elastic modulus and Poisson's ratio are means over the tests. The shear modulus
    follows from these two means (Eq. 4).
    """
    elastic = _compute_elastic_moduli(tests).mean()
    poisson = poisson_ratio(
        tests["length_1_mm"],
        tests["length_2_mm"],
        tests["width_1_mm"],
        tests["width_2_mm"],
    ).mean()
    return Moduli(
        elastic_pa=float(elastic),
        poisson_ratio=float(poisson),
        shear_pa=float(shear_modulus(elastic, poisson)),
    )


def _compute_elastic_moduli(tests: pd.DataFrame) -> pd.Series:
    """Compute the elastic modulus of each compression test [Pa]."""
    return elastic_modulus(
        force_n=tests["force_n"],
        length_m=1e-3 * tests["length_1_mm"],
        breadth_m=1e-3 * tests["breadth_mm"],
        width_1_m=1e-3 * tests["width_1_mm"],
        width_2_m=1e-3 * tests["width_2_mm"],
    )


def summarise_sizes(sizes: pd.DataFrame, published: pd.DataFrame) -> pd.DataFrame:
    """Compute statistics of sizes, and compare them with the published ones.

    Parameters
    ----------
    sizes : DataFrame
        The sizes (`read_sizes`).
    published : DataFrame
        The published statistics (Table 1), a row for each dimension. The table may be
        empty.

    Returns
    -------
    DataFrame
        A row for each dimension: the three axes, equivalent diameter and sphericity.
        The columns are statistics, published statistics, and their differences.
    """
    # Collect the values of all grains for each dimension.
    axes = [sizes[column] for column in SIZE_COLUMNS]
    values_by_dimension = {column: sizes[column] for column in SIZE_COLUMNS}
    values_by_dimension["equivalent_diameter_mm"] = equivalent_diameter(*axes)
    values_by_dimension["sphericity_percent"] = 100 * sphericity(*axes)
    rows = []
    for dimension, values in values_by_dimension.items():
        row = {
            "dimension": dimension,
            "unit": "%" if dimension == "sphericity_percent" else "mm",
            "n": len(values),
            "maximum": values.max(),
            "minimum": values.min(),
            "mean": values.mean(),
            "sd": values.std(ddof=1),
        }
        rows.append(row)
    table = pd.DataFrame(rows)

    # Bring the published rows into the order of the table. A dimension without a
    # published row has empty values.
    published_by_dimension = published.set_index("dimension")
    ordered = published_by_dimension.reindex(table["dimension"]).reset_index()
    statistics = ("maximum", "minimum", "mean")
    for statistic in statistics:
        table[f"published_{statistic}"] = ordered[statistic]
    for statistic in statistics:
        table[f"difference_{statistic}"] = table[statistic] - ordered[statistic]
    return table


def compute_mean_axes(sizes: pd.DataFrame, keeps_volume: bool) -> dict[str, float]:
    """Compute the full axes of the mean grain [mm], by the names of their columns.

    Parameters
    ----------
    sizes : DataFrame
        The sizes (`read_sizes`).
    keeps_volume : bool
        Whether the ellipsoid of the axes has the mean volume of the ellipsoids of all
        grains. If so, the three mean axes are multiplied by one factor, so that their
        product is the mean of the products. Otherwise the axes are the means.

    Notes
    -----
    The ellipsoid of the mean axes is smaller than the mean of the ellipsoids, because
    the volume is proportional to the cube of the size. If the size d is normally
    distributed with the relative standard deviation s, then
    E[d^3] = E[d]^3 (1 + 3 s^2). With s = 0.19 the difference is 10 % of the volume.
    """
    axes = sizes[list(SIZE_COLUMNS)]
    means = axes.mean()
    if keeps_volume:
        # The volume of an ellipsoid is proportional to the product of its axes.
        means *= np.cbrt(axes.prod(axis="columns").mean() / means.prod())
    return _round_numbers(means.to_dict())


def compute_mean_grain(
    sizes_csv: str | PathLike,
    compression_csv: str | PathLike | None,
    table1_csv: str | PathLike | None,
    density_kg_m3: float,
    poisson_ratio: float | None = None,
    shear_modulus_pa: float | None = None,
    keeps_volume: bool = False,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Compute the mean grain and its material, and statistics of the measured grains.

    The sizes are read from a file. The elastic constants are given, or come from the
    file of the compression tests.

    Parameters
    ----------
    sizes_csv : path
        File of the sizes.
    compression_csv : path or None
        File of the compression tests. It may be None if both `poisson_ratio` and
        `shear_modulus_pa` are given, because it is not read then.
    table1_csv : path or None
        File of the published statistics of the sizes (Table 1 of the paper). If it is
        None, the columns of published values are empty.
    density_kg_m3 : float
        Density of a grain.
    poisson_ratio, shear_modulus_pa : float, optional
        Elastic constants of the grain. If one of them is None, it is computed from the
        compression tests. The elastic modulus follows from both (Eq. 4).
    keeps_volume : bool
        Whether the axes of the mean grain are scaled so that it has the mean volume of
        the grains (`compute_mean_axes`).

    Returns
    -------
    statistics : DataFrame
        A row for each dimension (`summarise_sizes`).
    grain : dict
        The values of the mean grain by key, rounded: axes, elastic constants, density,
        spread of the sizes, the number of measured grains ``n``, and
        ``reconstruction``, whether any of the measurements were reconstructed.

    Raises
    ------
    InputError
        If a file is invalid, or if a value is implausible.
    """
    # Messages about these values name the section `berry` of the configuration.
    check_positive(
        "berry", density_kg_m3=density_kg_m3, shear_modulus_pa=shear_modulus_pa
    )
    if poisson_ratio is not None:
        _check_poisson_ratio("berry", poisson_ratio)

    sizes = read_sizes(sizes_csv)
    # Compute elastic constants that are not given from the compression tests.
    if poisson_ratio is None or shear_modulus_pa is None:
        elasticity = _compute_elasticity(
            sizes_csv, sizes, compression_csv, poisson_ratio, shear_modulus_pa
        )
    else:
        elasticity = _Elasticity(
            poisson_ratio, shear_modulus_pa, is_reconstructed=False
        )
    if table1_csv is None:
        published = pd.DataFrame(columns=TABLE1_NAMES)
    else:
        published = read_table(table1_csv, TABLE1_COLUMNS)

    elastic_modulus_pa = 2 * (1 + elasticity.poisson_ratio) * elasticity.shear_pa
    quantities = compute_mean_axes(sizes, keeps_volume)
    quantities["density_kg_m3"] = density_kg_m3
    quantities["elastic_modulus_pa"] = elastic_modulus_pa
    quantities["poisson_ratio"] = elasticity.poisson_ratio
    quantities["shear_modulus_pa"] = elasticity.shear_pa
    # `read_sizes` sets this attribute if the sizes were made to match published
    # statistics, instead of being measured.
    has_reconstructed_sizes = bool(sizes.attrs["reconstruction"])
    grain: dict[str, Any] = _round_numbers(quantities)
    grain["n"] = len(sizes)
    grain["reconstruction"] = has_reconstructed_sizes or elasticity.is_reconstructed
    spread = _compute_size_spread(sizes, published)
    grain |= _round_numbers(
        dict(zip(size_distribution.SPREAD_KEYS, spread, strict=True))
    )

    # The published statistics describe only the crop whose sizes were reconstructed.
    # Measured sizes are of other grains, so they are compared with an empty table.
    reference = published if has_reconstructed_sizes else published.iloc[:0]
    return summarise_sizes(sizes, reference), grain


def _round_numbers(numbers: dict[str, float]) -> dict[str, float]:
    """Round numbers to ten significant digits.

    This removes rounding errors, so that a mean is 21.14 and not 21.139999999999997.
    """
    return {key: float(f"{value:.10g}") for key, value in numbers.items()}


def _compute_elasticity(
    sizes_csv: str | PathLike,
    sizes: pd.DataFrame,
    compression_csv: str | PathLike | None,
    poisson_ratio: float | None,
    shear_modulus_pa: float | None,
) -> _Elasticity:
    """Compute Poisson's ratio and shear modulus from compression tests.

    Parameters
    ----------
    sizes_csv : path
        File of the sizes of the grains, for messages.
    sizes : DataFrame
        The contents of this file. The tested grains should have similar sizes.
    compression_csv : path or None
        File of the tests. If it is None, an error says that the file is missing.
    poisson_ratio, shear_modulus_pa : float or None
        Known values, which replace the results of the tests; None if unknown.

    Returns
    -------
    _Elasticity
        Poisson's ratio, shear modulus, and whether the tests were reconstructed to
        match published means, instead of being measured.

    Raises
    ------
    InputError
        If the tests are missing or implausible.
    """
    if compression_csv is None:
        # The message names the section `berry` of the configuration.
        allowed = "a file, unless poisson_ratio and shear_modulus_pa are both given"
        raise InputError("berry", "compression", None, allowed)
    tests = read_compression(compression_csv)
    # The forces are checked by the elastic moduli that follow from them. The moduli
    # also depend on the sizes, so check the forces only if the sizes are plausible.
    faults = _find_size_faults(compression_csv, tests, sizes_csv, sizes)
    if not faults:
        faults = _find_force_faults(compression_csv, tests)
    raise_together(faults)

    mean_moduli = compute_moduli(tests)
    poisson = mean_moduli.poisson_ratio if poisson_ratio is None else poisson_ratio
    _check_poisson_ratio(compression_csv, poisson)
    if shear_modulus_pa is None:
        shear_modulus_pa = shear_modulus(mean_moduli.elastic_pa, poisson)
    # `read_compression` sets this attribute.
    is_reconstructed = bool(tests.attrs["reconstruction"])
    return _Elasticity(poisson, shear_modulus_pa, is_reconstructed)


def _check_poisson_ratio(source: object, value: float) -> None:
    """Raise InputError for an impossible Poisson's ratio."""
    if not 0 <= value <= 0.5:
        raise InputError(source, "poisson_ratio", value, "from 0 to 0.5")


def _find_size_faults(
    tests_csv: str | PathLike,
    tests: pd.DataFrame,
    sizes_csv: str | PathLike,
    sizes: pd.DataFrame,
) -> list[InputError]:
    """Find the first column of the tests whose sizes do not fit the measured grains.

    Such a column is probably in the wrong unit. The columns after it are not checked.

    Parameters
    ----------
    tests_csv, sizes_csv : path
        Files of the tests and of the sizes of the grains, for messages.
    tests, sizes : DataFrame
        The contents of these files (`read_compression`, `read_sizes`).

    Returns
    -------
    list of InputError
        At most one error. The list is empty if the sizes agree.
    """
    for column, axis in AXIS_BY_TEST_COLUMN.items():
        tested_mm = float(tests[column].median())
        axis_mm = float(sizes[axis].median())
        if not 1 / LARGEST_SIZE_RATIO <= tested_mm / axis_mm <= LARGEST_SIZE_RATIO:
            allowed = (
                f"a median near that of {axis} in {sizes_csv}, {axis_mm:g} mm: are "
                "both in mm?"
            )
            return [InputError(tests_csv, column, tested_mm, allowed)]
    return []


def _find_force_faults(
    tests_csv: str | PathLike, tests: pd.DataFrame
) -> list[InputError]:
    """Find forces that lead to implausible elastic moduli.

    There is an error for each test whose modulus is far from the median of all tests.
    There is another error if the mean modulus of all tests is impossible for a grain.
    Then the forces are probably not in N.

    Parameters
    ----------
    tests_csv : path
        The file of the tests, for messages.
    tests : DataFrame
        The contents of this file.

    Returns
    -------
    list of InputError
        The errors. The list is empty if all forces are plausible.
    """
    faults = []
    # Check each test against the median of all tests.
    moduli_pa = _compute_elastic_moduli(tests)
    median_pa = float(moduli_pa.median())
    is_too_stiff = moduli_pa > LARGEST_MODULUS_RATIO * median_pa
    is_too_soft = moduli_pa < median_pa / LARGEST_MODULUS_RATIO
    for row in moduli_pa.index[is_too_stiff | is_too_soft]:
        force_n = float(tests.at[row, "force_n"])
        allowed = (
            f"a modulus within a factor of {LARGEST_MODULUS_RATIO:g} of the median, "
            f"{format_significant(median_pa, 3)} Pa: is it in N?"
        )
        fault = InputError(f"{tests_csv}, row {row}", "force_n", force_n, allowed)
        faults.append(fault)

    # Check all tests together. The message gives their median force, because no single
    # force is wrong.
    mean_pa = float(moduli_pa.mean())
    low, high = PLAUSIBLE_MODULI_PA
    if not low <= mean_pa <= high:
        median_n = float(tests["force_n"].median())
        allowed = (
            f"forces that give a modulus from {low:g} to {high:g} Pa, not "
            f"{format_significant(mean_pa, 2)}: are they in N?"
        )
        faults.append(InputError(tests_csv, "force_n", median_n, allowed))
    return faults


def compute_configured_grain(
    section: GrainSettings, table1_csv: str | PathLike | None
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Compute the statistics and the mean grain of the section `berry` of a study.

    Parameters
    ----------
    section : GrainSettings
        The section, with the files of the measurements.
    table1_csv : path or None
        File of the published statistics, see `compute_mean_grain`.

    Returns
    -------
    tuple
        The statistics and the mean grain, as `compute_mean_grain` returns them.
    """
    return compute_mean_grain(
        sizes_csv=section.sizes,
        compression_csv=section.compression,
        table1_csv=table1_csv,
        density_kg_m3=section.density_kg_m3,
        poisson_ratio=section.poisson_ratio,
        shear_modulus_pa=section.shear_modulus_pa,
        keeps_volume=section.keeps_volume,
    )


def run(
    section: GrainSettings, table1_csv: str | PathLike | None, out_dir: str | PathLike
) -> None:
    """Write the result of `compute_configured_grain` to summary.csv and berry.json.

    Parameters
    ----------
    section : GrainSettings
        The section `berry`, with the files of the measurements.
    table1_csv : path or None
        File of the published statistics.
    out_dir : path
        Folder to which both files are written.
    """
    statistics, grain = compute_configured_grain(section, table1_csv)
    out = Path(out_dir)
    write_table(out / "summary.csv", statistics, float_format="%.4f")
    write_json(out / "berry.json", grain, indent=2)


def _compute_size_spread(
    sizes: pd.DataFrame, published: pd.DataFrame
) -> size_distribution.Spread:
    """Compute how much the equivalent diameters of the grains differ.

    The equivalent diameter is that of a ball with the volume of the grain.

    Parameters
    ----------
    sizes : DataFrame
        Axes of the grains, as `read_sizes` returns them.
    published : DataFrame
        The published statistics (Table 1), which may be empty.

    Returns
    -------
    Spread
        Standard deviation, smallest and largest diameter, as fractions of the mean
        diameter. Reconstructed sizes are not used if the published table has the range
        of the diameters. The spread is then estimated from this range.
    """
    dimension = "equivalent_diameter_mm"
    published_rows = published.set_index("dimension")
    # `read_sizes` sets this attribute if the sizes were not measured.
    if sizes.attrs["reconstruction"] and dimension in published_rows.index:
        published_row = published_rows.loc[dimension]
        return size_distribution.estimate_spread(
            published_row["maximum"], published_row["minimum"], published_row["mean"]
        )
    axes = [sizes[column] for column in SIZE_COLUMNS]
    return size_distribution.compute_spread(equivalent_diameter(*axes))
