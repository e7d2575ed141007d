"""Measured grains: sizes to sphericity and equivalent diameter, compression tests to moduli (Eq. 1-4)."""

import math
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.common.errors import InputError, raise_together, require
from repose.common.files import read_table, write_json, write_table
from repose.common.tables import Column, other_unit
from repose.grain import size_distribution
from repose.grain.berry_files import ALIKE, SIZE_COLUMNS, read_compression, read_sizes
from repose.grain.particle import check_positive
from repose.grain.settings import GrainSettings

LOADED = {
    "length_1_mm": "long_mm",
    "width_1_mm": "minor_mm",
    "breadth_mm": "major_mm",
}  # axes of the loaded berry
STIFF = 30.0  # moduli of tested grains differ by a smaller factor
MODULI_PA = (
    1e3,
    1e12,
)  # elastic modulus of a jelly, and of what is stiffer than steel or diamond
TABLE1 = ("dimension", "maximum", "minimum", "mean")
STATISTICS = [Column(name, str if name == "dimension" else float) for name in TABLE1]

# One number, or a column of them.
Numbers = Any


def equivalent_diameter(long: Numbers, major: Numbers, minor: Numbers) -> Numbers:
    """Compute the diameter of the sphere with the same product of full axes (Eq. 1), in their unit."""
    return np.cbrt(long * major * minor)


def sphericity(long: Numbers, major: Numbers, minor: Numbers) -> Numbers:
    """Compute the equivalent diameter over the long axis, 0 to 1 (Eq. 1, there in percent)."""
    return equivalent_diameter(long, major, minor) / long


def elastic_modulus(
    force_n: Numbers,
    length_m: Numbers,
    breadth_m: Numbers,
    width_1_m: Numbers,
    width_2_m: Numbers,
) -> Numbers:
    """Compute the elastic modulus E [Pa]: stress over strain in the loading direction W (Eq. 2)."""
    section = math.pi / 4 * length_m * breadth_m
    return force_n / section / ((width_1_m - width_2_m) / width_1_m)


def poisson_ratio(
    length_1: Numbers, length_2: Numbers, width_1: Numbers, width_2: Numbers
) -> Numbers:
    """Compute Poisson's ratio: strain of the length over strain of the loaded width, taken positive (Eq. 3)."""
    return np.abs(((length_2 - length_1) / length_1) / ((width_2 - width_1) / width_1))


def shear_modulus(elastic_modulus_pa: float, poisson: float) -> float:
    """Compute the shear modulus G = E / (2 (1 + nu)) (Eq. 4)."""
    return elastic_modulus_pa / (2 * (1 + poisson))


def moduli(tests: pd.DataFrame) -> tuple[float, float, float]:
    """Compute E [Pa] and nu as means over compression tests (`read_compression`), and G [Pa] from both by Eq. 4."""
    elastic = _elastic_of(tests).mean()
    poisson = poisson_ratio(
        tests["length_1_mm"],
        tests["length_2_mm"],
        tests["width_1_mm"],
        tests["width_2_mm"],
    ).mean()
    return float(elastic), float(poisson), float(shear_modulus(elastic, poisson))


def _elastic_of(tests: pd.DataFrame) -> pd.Series:
    """Compute E of each compression test [Pa]."""
    lengths_m = (
        1e-3 * tests[name]
        for name in ("length_1_mm", "breadth_mm", "width_1_mm", "width_2_mm")
    )
    return elastic_modulus(tests["force_n"], *lengths_m)


def summarise(sizes: pd.DataFrame, published: pd.DataFrame) -> pd.DataFrame:
    """List statistics of the sizes (`read_sizes`) next to the published values (Table 1), a row for each dimension."""
    axes = [sizes[column] for column in SIZE_COLUMNS]
    dimensions = {column: ("mm", sizes[column]) for column in SIZE_COLUMNS}
    dimensions["equivalent_diameter_mm"] = ("mm", equivalent_diameter(*axes))
    dimensions["sphericity_percent"] = ("%", 100 * sphericity(*axes))
    table = pd.DataFrame(
        [
            (
                name,
                unit,
                len(values),
                values.max(),
                values.min(),
                values.mean(),
                values.std(ddof=1),
            )
            for name, (unit, values) in dimensions.items()
        ],
        columns=["dimension", "unit", "n", "maximum", "minimum", "mean", "sd"],
    )
    reference = (
        published.set_index("dimension").reindex(table["dimension"]).reset_index()
    )
    for statistic in ("maximum", "minimum", "mean"):
        table[f"published_{statistic}"] = reference[statistic]
    for statistic in ("maximum", "minimum", "mean"):
        table[f"difference_{statistic}"] = table[statistic] - reference[statistic]
    return table


def of_files(
    sizes_csv: str | PathLike,
    compression_csv: str | PathLike | None,
    table1_csv: str | PathLike | None,
    density_kg_m3: float,
    poisson_ratio: float | None = None,
    shear_modulus_pa: float | None = None,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Compute statistics (`summarise`) and material of the measured grains.

    `poisson_ratio` and `shear_modulus_pa` replace the results of the compression tests; E follows by Eq. 4.
    """
    check_positive(
        "berry", density_kg_m3=density_kg_m3, shear_modulus_pa=shear_modulus_pa
    )
    nu, shear = poisson_ratio, shear_modulus_pa
    if nu is not None:
        _check_poisson("berry", nu)
    sizes = read_sizes(sizes_csv)
    reconstruction = sizes.attrs["reconstruction"]
    if nu is None or shear is None:
        if compression_csv is None:
            allowed = "a file, unless poisson_ratio and shear_modulus_pa are both given"
            raise InputError("berry", "compression", None, allowed)
        tests = read_compression(compression_csv)
        raise_together(_other_units(compression_csv, tests, sizes_csv, sizes))
        reconstruction = reconstruction or tests.attrs["reconstruction"]
        elastic, measured_poisson, _ = moduli(tests)
        nu = measured_poisson if nu is None else nu
        _check_poisson(compression_csv, nu)
        shear = shear_modulus(elastic, nu) if shear is None else shear
    values = {column: sizes[column].mean() for column in SIZE_COLUMNS} | {
        "density_kg_m3": density_kg_m3,
        "elastic_modulus_pa": 2 * (1 + nu) * shear,
        "poisson_ratio": nu,
        "shear_modulus_pa": shear,
    }
    # Ten digits: a mean of measurements should not read 21.139999999999997.
    berry: dict[str, Any] = {
        key: float(f"{value:.10g}") for key, value in values.items()
    }
    berry |= {"n": len(sizes), "reconstruction": bool(reconstruction)}
    published = (
        pd.DataFrame(columns=TABLE1)
        if table1_csv is None
        else read_table(table1_csv, STATISTICS)
    )
    spread = _spread(sizes, published)
    berry |= {
        key: float(f"{value:.10g}")
        for key, value in zip(size_distribution.KEYS, spread, strict=True)
    }
    # the published statistics belong to the reconstructed crop
    reference = published if sizes.attrs["reconstruction"] else published.iloc[:0]
    return summarise(sizes, reference), berry


def _check_poisson(source: object, value: float) -> None:
    """Refuse an impossible Poisson's ratio."""
    require(0 <= value <= 0.5, source, "poisson_ratio", value, "from 0 to 0.5")


def _other_units(
    tests_csv: str | PathLike,
    tests: pd.DataFrame,
    sizes_csv: str | PathLike,
    sizes: pd.DataFrame,
) -> Iterator[InputError]:
    """Find columns of the compression tests whose numbers can hardly be in their unit."""
    for name, axis in LOADED.items():
        found, axis_mm = float(tests[name].median()), float(sizes[axis].median())
        if not 1 / ALIKE <= found / axis_mm <= ALIKE:
            of_sizes = other_unit("mm", axis_mm / found)
            unit = other_unit("mm", found / axis_mm) or (
                of_sizes and f"; is {sizes_csv}{of_sizes[1:]}"
            )
            near = f"a median near that of {axis} in {sizes_csv}, {axis_mm:g} mm"
            yield InputError(tests_csv, name, found, f"{near}{unit}")
            return
    each = _elastic_of(tests)
    middle, modulus = each.median(), float(each.mean())
    for k in each.index[(each > STIFF * middle) | (each < middle / STIFF)]:
        near = f"a modulus within a factor of {STIFF:g} of the median, {middle:.3g} Pa"
        unit = other_unit("N", each[k] / middle)
        yield InputError(
            f"{tests_csv}, row {k}",
            "force_n",
            float(tests.at[k, "force_n"]),
            f"{near}{unit}",
        )
    if not MODULI_PA[0] <= modulus <= MODULI_PA[1]:
        unit = "kN" if modulus < MODULI_PA[0] else "mN"
        low, high = MODULI_PA
        allowed = f"forces that give a modulus from {low:g} to {high:g} Pa, not {modulus:.2g}; in {unit} instead of N?"
        yield InputError(
            tests_csv, "force_n", float(tests["force_n"].median()), allowed
        )


def of_settings(
    section: GrainSettings, table1_csv: str | PathLike | None
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Compute `of_files` of a section `berry`."""
    material = section.density_kg_m3, section.poisson_ratio, section.shear_modulus_pa
    return of_files(section.sizes, section.compression, table1_csv, *material)


def run(
    section: GrainSettings, table1_csv: str | PathLike | None, out_dir: str | PathLike
) -> None:
    """Write summary.csv and berry.json (`of_settings`)."""
    summary, berry = of_settings(section, table1_csv)
    write_table(Path(out_dir) / "summary.csv", summary, float_format="%.4f")
    write_json(Path(out_dir) / "berry.json", berry, indent=2)


def _spread(sizes: pd.DataFrame, published: pd.DataFrame) -> tuple[float, float, float]:
    """Return relative sd and extremes of the equivalent diameter; for reconstructed sizes from the published range."""
    rows = published.set_index("dimension")
    if not sizes.attrs["reconstruction"] or "equivalent_diameter_mm" not in rows.index:
        return size_distribution.of_sizes(
            equivalent_diameter(*(sizes[column] for column in SIZE_COLUMNS))
        )
    row = rows.loc["equivalent_diameter_mm"]
    return size_distribution.of_range(row["maximum"], row["minimum"], row["mean"])
