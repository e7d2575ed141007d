"""All comparisons in one table: which part of the method, which choice, at which budget, and how good it is."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from repose.calibrate.responses import name_derived_column
from repose.common.files import read_table, write_table

COLUMNS = (
    "part",
    "choice",
    "data",
    "points",
    "seeds",
    "simulations",
    "response",
    "measure",
    "value",
    "standard_error",
    "repetitions",
)
SHARES = ("explainable", "rmse")
# Measures of a search on the network, which costs evaluations and no simulations.
SEARCH = ("evaluations_to_tolerance", "best", "listed_coverage", "met_coverage")


def table_of(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Make a row for each choice, budget, response and measure; `tables` as `read` returns them.

    ``data`` is ``real`` for simulated samples, ``emulated`` for an emulator fitted to them, and ``network`` for the
    trained network. ``explainable`` is the share of the explainable variance, ``rmse`` and ``off`` are in the
    response's unit.
    """
    responses = tuple(dict.fromkeys(tables["sampling"]["response"]))
    rows = [
        *_sampling(tables["sampling"]),
        *_surrogates(tables["surrogates"]),
        *_search(tables["search"]),
        *_whole(tables["whole"], responses),
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def read(files: Mapping[str, str | Path]) -> dict[str, pd.DataFrame]:
    """Read the tables ``sampling``, ``surrogates``, ``search`` and ``whole``, from files of the same names."""
    sizes = (
        "points",
        "seeds",
        "simulations",
        "response",
        "repetitions",
        *_with_errors(SHARES),
    )
    sampling = read_table(
        files["sampling"], ("comparison", "design", "data", "fit", *sizes)
    )
    error_columns = _with_errors(
        [
            name_derived_column(name, "off")
            for name in dict.fromkeys(sampling["response"])
        ]
    )
    whole = ("data", "samples", "method", "simulations", "repetitions", *error_columns)
    return {
        "sampling": sampling,
        "surrogates": read_table(files["surrogates"], ("model", "training", *sizes)),
        "search": read_table(
            files["search"],
            ("method", "evaluations", "repetitions", *_with_errors(SEARCH)),
        ),
        "whole": read_table(files["whole"], whole),
    }


def run(files: Mapping[str, str | Path], out_dir: str | Path) -> pd.DataFrame:
    """Write comparison.csv; return the table."""
    table = table_of(read(files))
    write_table(Path(out_dir) / "comparison.csv", table, float_format="%.6g")
    return table


def _sampling(table: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Rows of the comparison of designs, and of points against seeds."""
    for row in table.to_dict("records"):
        choice = f"{row['design']}, {row['fit']}"
        yield from _measured(row, SHARES, part=row["comparison"], choice=choice)


def _surrogates(table: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Rows of the comparison of surrogates."""
    for row in table.to_dict("records"):
        choice = f"{row['model']}, {row['training']}"
        yield from _measured(row, SHARES, part="surrogate", choice=choice, data="real")


def _search(table: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Rows of the comparison of searches; the feasible region itself has none."""
    for row in table.dropna(subset="evaluations").to_dict("records"):
        yield from _measured(
            row, SEARCH, part="search", choice=row["method"], data="network"
        )


def _whole(table: pd.DataFrame, responses: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    """Rows of the whole method beside its alternatives, a row for each response."""
    for row in table.to_dict("records"):
        labels = {"part": "whole", "choice": row["method"], "points": row["samples"]}
        for response in responses:
            for found in _measured(
                row,
                (name_derived_column(response, "off"),),
                **labels,
                response=response,
            ):
                yield found | {"measure": "off"}


def _with_errors(measures):
    """Columns of measures and of their standard errors."""
    return [f"{measure}{end}" for measure in measures for end in ("", "_se")]


def _measured(row, measures, **labels):
    """Rows of the joint table from a row of another table: their common columns, then each measure."""
    for measure in measures:
        value = {
            "measure": measure,
            "value": row[measure],
            "standard_error": row[f"{measure}_se"],
        }
        yield {key: row[key] for key in COLUMNS if key in row} | labels | value
