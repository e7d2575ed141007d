"""The table of all runs of a study: the runs of a batch, the check of returned runs, and means by sample."""

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from repose.core.errors import InputError
from repose.core.files import check_columns, read_rows
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import plain_number
from repose.core.runs import mean_and_error
from repose.core.targets import Targets
from repose.strategies.base import Studied, strategy

OK = "ok"
Rows = Sequence[Mapping[str, Any]]
ROUNDED = 1e-6  # of a range: a table may have been rounded by a spreadsheet


def runs_of(samples: pd.DataFrame) -> pd.DataFrame:
    """Make a row for each run of a batch's samples: `sample`, `run` from 1, and the parameters.

    The runs of a sample differ in the random numbers of the simulator alone.
    """
    table = samples.loc[samples.index.repeat(samples["seeds"])].drop(columns="seeds").reset_index(drop=True)
    table.insert(1, "run", table.groupby("sample").cumcount() + 1)
    return table


def next_number(data: pd.DataFrame) -> int:
    """Return the number of the next sample."""
    numbers = pd.to_numeric(data["sample"], errors="coerce")
    return int(numbers.max()) + 1 if numbers.notna().all() else data["sample"].nunique() + 1


def samples_of_runs(data: pd.DataFrame, space: ParameterSpace, targets: Targets) -> pd.DataFrame:
    """Summarise the runs by sample, as the stage `dataset` does: parameters, status, means and standard errors.

    A response counts as many runs as have it: bench tests fail separately.
    """
    known, rows = data[list(targets.names)].notna(), []
    for sample, own in data.groupby("sample", sort=False):
        count = int(known.loc[own.index].sum().min())
        ok = count > 0 and 2 * count >= len(own)
        row = {"sample": sample, **own.iloc[0][list(space.names)], "status": OK if ok else "failed"}
        rows.append(row | {"reason": "", "n_seeds": count})
        for name, error in zip(targets.names, targets.errors, strict=True):
            rows[-1][name], rows[-1][error] = mean_and_error(own[name].dropna() if ok else ())
    table = pd.DataFrame(rows)
    numbers = [*targets.names, *targets.errors]
    return table.assign(**{name: table[name].astype(float) for name in numbers})


def runs_by_bench(data: pd.DataFrame, targets: Targets) -> pd.DataFrame:
    """List the runs of each bench test as rows of their own, as the stage `dataset` writes them."""
    tables = []
    for bench, own in targets.benches.items():
        names = [targets.names[k] for k in own]
        status = np.where(data[names].notna().all(axis=1), OK, "failed")
        tables.append(data[["sample", *names]].assign(apparatus=bench, status=status, reason=""))
    return pd.concat(tables, ignore_index=True)


def read_runs(path: str | os.PathLike, study: Studied) -> pd.DataFrame:
    """Read a CSV file of runs and check it by `checked_runs`."""
    return checked_runs(study, read_rows(path, what="a CSV file of runs"), path)


def checked_runs(
    study: Studied, rows: pd.DataFrame | Rows, source: object = "runs", enough: bool = True
) -> pd.DataFrame:
    """Check a table of runs; return ``sample``, ``status``, parameters and responses.

    Columns of fixed parameters, ``sample``, ``run`` and ``status`` are optional. Rows with the same parameters are
    replicates. A run with another status than ``ok`` failed; its responses are not read. Samples are numbered in the
    order of their first run, unless the table numbers them. `enough` also refuses too few good samples. InputError
    names `source` and the row.
    """
    if isinstance(rows, pd.DataFrame):
        rows = rows.to_dict("records")
    if not rows:
        raise InputError(source, "rows", 0, "a header and a row for each run")
    space, names = study.parameters, study.targets.names
    rows = with_fixed(rows, space)
    check_columns(source, rows[0], (*space.names, *names))
    checked = [_checked_row(row, study, f"{source}, row {k}") for k, row in enumerate(rows, start=1)]
    table = pd.DataFrame(checked)
    _number_samples(table, rows, space, source, strategy(study.settings.strategy).repeats_points)
    table = table[["sample", "status", *space.names, *names]]
    _refuse_twice(table, rows, source)
    if enough:
        _require_enough(table, study, source)
    return table


def _checked_row(row: Mapping[str, Any], study: Studied, source: object) -> dict[str, Any]:
    """Check parameters, status and responses of a run, and return them as numbers."""
    space = study.parameters
    status = str(row.get("status") or OK).strip()
    run: dict[str, Any] = {"status": OK if status.lower() == OK else status}
    ends = space.complete(np.array([space.low, space.high])).tolist()
    for name, low, high in zip(space.names, *ends, strict=True):
        run[name] = _inside(_number(row[name], source, name), name, low, high, source)
    for name in study.targets.names:
        run[name] = math.nan
        if run["status"] == OK:
            run[name] = _number(row[name], source, name, "; a run that failed has another `status` than ok")
    return run


def _number(cell: Any, source: object, name: str, more: str = "") -> float:
    """Read a finite number; InputError for anything else."""
    try:
        value = plain_number(cell)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise InputError(source, name, cell, f"a finite number{more}")
    return value


def _inside(value: float, name: str, low: float, high: float, source: object) -> float:
    """Check that a parameter is within its range, and undo the rounding of a spreadsheet."""
    slack = ROUNDED * ((high - low) or abs(high) or 1.0)
    if not low - slack <= value <= high + slack:
        allowed = f"{low:g}, as it is fixed" if low == high else f"from {low:g} to {high:g}, its range"
        raise InputError(source, name, value, allowed)
    return min(max(value, low), high)


def _number_samples(table: pd.DataFrame, rows: Rows, space: ParameterSpace, source: object, repeats: bool) -> None:
    """Put the samples' numbers into the table: rows with the same parameters are one sample."""
    sets = table[list(space.names)].apply(tuple, axis=1)
    numbers = pd.factorize(sets)[0] + 1
    if "sample" in rows[0]:
        reported = [str(row["sample"]).strip() for row in rows]
        for k, (name, number) in enumerate(zip(reported, numbers, strict=True)):
            first = reported.index(name)
            if numbers[first] != number:
                allowed = f"one set of parameters for each sample; row {first + 1} has another one"
                raise InputError(f"{source}, row {k + 1}", "sample", name, allowed)
            other = int(np.argmax(numbers == number))
            if reported[other] != name and not repeats:
                allowed = f"{reported[other]}, the sample of row {other + 1} with the same parameters"
                raise InputError(f"{source}, row {k + 1}", "sample", name, allowed)
        digits = all(name.isdigit() for name in reported)
        numbers = [int(name) for name in reported] if digits else pd.factorize(pd.Series(reported))[0] + 1
    table["sample"] = numbers


def _require_enough(table: pd.DataFrame, study: Studied, source: object) -> None:
    """Refuse too few good samples."""
    samples, fewest = table[table["status"] == OK]["sample"].nunique(), study.parameters.dimensions + 2
    if samples < fewest:
        allowed = f"at least {fewest}, two more than the free parameters"
        raise InputError(source, "samples with a good run", samples, allowed)


def with_fixed(rows: Rows, space: ParameterSpace) -> list[dict[str, Any]]:
    """Add columns for all fixed parameters to the rows."""
    missing = {name: value for name, value in space.fixed.items() if rows and name not in rows[0]}
    return [missing | dict(row) for row in rows]


def _refuse_twice(table: pd.DataFrame, rows: Rows, source: object) -> None:
    """Refuse a duplicate run, and a row that repeats all numbers of an earlier row."""
    if "run" in rows[0]:
        named = pd.Series(list(zip(table["sample"], (str(row["run"]).strip() for row in rows), strict=True)))
        if named.duplicated().any():
            k = int(named.duplicated().to_numpy().argmax())
            raise InputError(f"{source}, row {k + 1}", "sample and run", list(named[k]), "each once")
        return  # the numbers tell runs apart whose results are equal, as of a simulator without random numbers
    ok = table[table["status"] == OK]
    if ok.duplicated().any():
        k = int(ok.index[ok.duplicated()][0])
        allowed = "a run of its own: all numbers of this row stand in an earlier one"
        raise InputError(f"{source}, row {k + 1}", "row", "there twice", allowed)
