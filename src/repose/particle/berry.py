"""Measured berries: sizes to sphericity and equivalent diameter, compression tests to moduli (Eq. 1-4)."""

import math
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.core.errors import InputError
from repose.core.files import read_table, write_json, write_table
from repose.particle import size_distribution

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
# A comment line with this word marks a file whose rows were not measured but made to match a published table.
RECONSTRUCTION_MARK = "reconstruction"


def read_sizes(path):
    """Measured berries as a DataFrame with long_mm, major_mm, minor_mm (full axes, mm), a row each.

    Lines that start with # are comments; `attrs["reconstruction"]` tells whether one of them says that the
    file is a reconstruction. Raises InputError naming file, row, column and value for a missing file or
    column, a value that is no positive number, and axes that are not in the order long >= major >= minor.
    """
    sizes = _read_numbers(path, SIZE_COLUMNS)
    if len(sizes) < 2:
        raise InputError(path, "rows", len(sizes), "at least 2 berries, or there is no standard deviation")
    for larger, smaller in (("long_mm", "major_mm"), ("major_mm", "minor_mm")):
        for row in sizes.index[sizes[smaller] > sizes[larger]]:
            raise InputError(
                f"{path}, row {row}",
                smaller,
                float(sizes.at[row, smaller]),
                f"at most {larger} of the same berry, {sizes.at[row, larger]:g}",
            )
    return sizes


def read_compression(path):
    """Compression tests as a DataFrame, a row each.

    Columns: test (a number), force_n (F, N), length_1_mm and length_2_mm (L before and after), width_1_mm and
    width_2_mm (W, the loaded axis, before and after), breadth_mm (the third axis, before). The berry lies on
    its broad side, so the load runs along its minor diameter W, and the section that carries it has the axes
    L and breadth. Raises InputError as `read_sizes` does, and where the load does not shorten W.
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


def equivalent_diameter(long, major, minor):
    """Diameter of the sphere with the same product of axes, in the axes' unit (Eq. 1)."""
    return np.cbrt(long * major * minor)


def sphericity(long, major, minor):
    """Equivalent diameter over the long axis, between 0 and 1 (Eq. 1, there in percent)."""
    return equivalent_diameter(long, major, minor) / long


def elastic_modulus(force_n, length_m, breadth_m, width_1_m, width_2_m):
    """E in Pa: stress over strain in the loading direction W (Eq. 2).

    The section S is the ellipse across the load, pi / 4 * length * breadth.
    """
    section = math.pi / 4 * length_m * breadth_m
    return force_n / section / ((width_1_m - width_2_m) / width_1_m)


def poisson_ratio(length_1, length_2, width_1, width_2):
    """nu: strain of the length over strain of the loaded width, taken positive (Eq. 3); one unit for all."""
    return np.abs(((length_2 - length_1) / length_1) / ((width_2 - width_1) / width_1))


def shear_modulus(elastic_modulus_pa, poisson):
    """G = E / (2 (1 + nu)) in Pa (Eq. 4)."""
    return elastic_modulus_pa / (2 * (1 + poisson))


def moduli(tests):
    """(E in Pa, nu, G in Pa) of compression tests: E and nu are means over the tests, G follows by Eq. 4.

    G is taken from the two means, not averaged over the tests, so that the three fit each other.
    """
    elastic = elastic_modulus(
        tests["force_n"],
        tests["length_1_mm"] * 1e-3,
        tests["breadth_mm"] * 1e-3,
        tests["width_1_mm"] * 1e-3,
        tests["width_2_mm"] * 1e-3,
    ).mean()
    poisson = poisson_ratio(
        tests["length_1_mm"], tests["length_2_mm"], tests["width_1_mm"], tests["width_2_mm"]
    ).mean()
    return float(elastic), float(poisson), float(shear_modulus(elastic, poisson))


def summarise(sizes, published):
    """Statistics of the sizes beside the published ones (Table 1), a row per dimension.

    sizes: as `read_sizes` gives it; published: columns dimension, unit, maximum, minimum, mean.
    Columns: dimension, unit, n, maximum, minimum, mean, sd (n - 1), then published_ and difference_ (ours
    less published) of maximum, minimum and mean; empty where nothing is published.
    """
    axes = [sizes[column] for column in SIZE_COLUMNS]
    dimensions = {column: ("mm", sizes[column]) for column in SIZE_COLUMNS}
    dimensions["equivalent_diameter_mm"] = ("mm", equivalent_diameter(*axes))
    dimensions["sphericity_percent"] = ("%", 100 * sphericity(*axes))
    table = pd.DataFrame(
        [
            (name, unit, len(values), values.max(), values.min(), values.mean(), values.std(ddof=1))
            for name, (unit, values) in dimensions.items()
        ],
        columns=["dimension", "unit", "n", "maximum", "minimum", "mean", "sd"],
    )
    theirs = published.set_index("dimension").reindex(table["dimension"]).reset_index()
    for statistic in ("maximum", "minimum", "mean"):
        table[f"published_{statistic}"] = theirs[statistic]
    for statistic in ("maximum", "minimum", "mean"):
        table[f"difference_{statistic}"] = table[statistic] - theirs[statistic]
    return table


def measured_berry(
    sizes: pd.DataFrame,
    tests: pd.DataFrame | None,
    published: pd.DataFrame,
    density_kg_m3: float,
    poisson: float | None = None,
    shear_modulus_pa: float | None = None,
    source: object = "berry",
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Statistics and material of the measured berries.

    Parameters
    ----------
    sizes : pandas.DataFrame
        As `read_sizes` gives it.
    tests : pandas.DataFrame or None
        As `read_compression` gives it; None where Poisson's ratio and shear modulus are both given.
    published : pandas.DataFrame
        Published statistics: columns dimension, maximum, minimum, mean.
    density_kg_m3 : float
    poisson, shear_modulus_pa : float, optional
        Replace those of the compression tests. The elastic modulus follows by Eq. 4.
    source : object
        Named in the error where the compression tests give an impossible material.

    Returns
    -------
    summary : pandas.DataFrame
        See `summarise`.
    berry : dict
        Mean axes [mm], density, moduli [Pa], number of berries, whether the data are a reconstruction, and the spread
        of the sizes.

    Raises
    ------
    InputError
        If the material is impossible, or compression tests are missing.
    """
    check_material(density_kg_m3, poisson, shear_modulus_pa)
    reconstruction = sizes.attrs["reconstruction"]
    if poisson is not None and shear_modulus_pa is not None:
        nu, shear = float(poisson), float(shear_modulus_pa)
    elif tests is None:
        allowed = "a file, unless poisson_ratio and shear_modulus_pa are both given"
        raise InputError("berry", "compression", None, allowed)
    else:
        reconstruction = reconstruction or tests.attrs["reconstruction"]
        elastic, measured_poisson, _ = moduli(tests)
        nu = measured_poisson if poisson is None else float(poisson)
        check_material(density_kg_m3, nu, shear_modulus_pa, source=source)
        shear = shear_modulus(elastic, nu) if shear_modulus_pa is None else float(shear_modulus_pa)
    values = {column: sizes[column].mean() for column in SIZE_COLUMNS} | {
        "density_kg_m3": density_kg_m3,
        "elastic_modulus_pa": 2 * (1 + nu) * shear,
        "poisson_ratio": nu,
        "shear_modulus_pa": shear,
    }
    # Ten digits: a mean of measurements should not read 21.139999999999997.
    berry: dict[str, Any] = {key: float(f"{value:.10g}") for key, value in values.items()}
    berry |= {"n": len(sizes), "reconstruction": bool(reconstruction)}
    spread = _spread(sizes, published)
    berry |= {key: float(f"{value:.10g}") for key, value in zip(size_distribution.KEYS, spread, strict=True)}
    return summarise(sizes, published), berry


def of_files(
    sizes_csv: str | PathLike,
    compression_csv: str | PathLike | None,
    table1_csv: str | PathLike,
    density_kg_m3: float,
    poisson_ratio: float | None = None,
    shear_modulus_pa: float | None = None,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """`measured_berry` of files; compression_csv is not read where both moduli are given.

    Raises
    ------
    InputError
        If a file is bad, or a value impossible.
    """
    check_material(density_kg_m3, poisson_ratio, shear_modulus_pa)
    given = poisson_ratio is not None and shear_modulus_pa is not None
    sizes = read_sizes(sizes_csv)
    tests = None if given or compression_csv is None else read_compression(compression_csv)
    published = read_table(table1_csv, ("dimension", "maximum", "minimum", "mean"))
    material = density_kg_m3, poisson_ratio, shear_modulus_pa
    return measured_berry(sizes, tests, published, *material, source=compression_csv)


def run(
    sizes_csv: str | PathLike,
    compression_csv: str | PathLike | None,
    table1_csv: str | PathLike,
    out_dir: str | PathLike,
    density_kg_m3: float,
    poisson_ratio: float | None = None,
    shear_modulus_pa: float | None = None,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Write summary.csv and berry.json to out_dir; the rest is `of_files`."""
    summary, berry = of_files(
        sizes_csv, compression_csv, table1_csv, density_kg_m3, poisson_ratio, shear_modulus_pa
    )
    write_table(Path(out_dir) / "summary.csv", summary, float_format="%.4f")
    write_json(Path(out_dir) / "berry.json", berry, indent=2)
    return summary, berry


def _spread(sizes, published):
    """Relative standard deviation and extremes of the equivalent diameter: of the sizes, or where they are a
    reconstruction inferred from the published range."""
    if not sizes.attrs["reconstruction"]:
        return size_distribution.of_sizes(equivalent_diameter(*(sizes[column] for column in SIZE_COLUMNS)))
    row = published.set_index("dimension").loc["equivalent_diameter_mm"]
    return size_distribution.of_range(row["maximum"], row["minimum"], row["mean"])


def check_material(density_kg_m3, poisson_ratio=None, shear_modulus_pa=None, source="berry"):
    """InputError unless density and shear modulus are positive and Poisson's ratio lies in [0, 0.5]."""
    for key, value in (("density_kg_m3", density_kg_m3), ("shear_modulus_pa", shear_modulus_pa)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(source, key, value, "a positive number")
    if poisson_ratio is not None and not 0 <= poisson_ratio <= 0.5:
        raise InputError(source, "poisson_ratio", poisson_ratio, "from 0 to 0.5")


def _read_numbers(path, columns):
    """CSV with these columns of positive numbers, indexed by row number from 1; comments start with #."""
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "file", None, "an existing CSV file")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(path, "file", "not text", "a CSV file in UTF-8") from None
    lines = text.splitlines()
    comments = [line for line in lines if line.startswith("#")]
    records = [line.split(",") for line in lines if line.strip() and not line.startswith("#")]
    header = [name.strip() for name in records[0]] if records else []
    for column in columns:
        if header.count(column) != 1:
            raise InputError(
                path, "header", ",".join(header), f"a column {column}, once; all: {','.join(columns)}"
            )
    table = pd.DataFrame(index=range(1, len(records)), columns=list(columns), dtype=float)
    for row, cells in enumerate(records[1:], start=1):
        if len(cells) != len(header):
            raise InputError(f"{path}, row {row}", "cells", len(cells), f"{len(header)}, as in the header")
        for column in columns:
            table.at[row, column] = _positive(
                cells[header.index(column)].strip(), f"{path}, row {row}", column
            )
    table.attrs["reconstruction"] = any(RECONSTRUCTION_MARK in line.lower() for line in comments)
    return table


def _positive(text, source, column):
    """The text as a positive finite number, or InputError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise InputError(source, column, text, "a positive number")
    return value
