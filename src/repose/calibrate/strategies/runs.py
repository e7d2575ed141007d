"""The table of all runs of a study: the runs of a batch, the check of returned runs, and means by sample."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.runs import mean_and_error
from repose.calibrate.strategies.base import strategy
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.common.errors import require
from repose.common.files import TURN, Path_
from repose.common.tables import (
    Column,
    Fault,
    check,
    check_columns,
    is_plain,
    read,
    refuse,
)

OK = "ok"
# Words for a run that is good; a number such as 0 or 1 may mean either.
GOOD = (
    OK,
    "success",
    "successful",
    "done",
    "finished",
    "completed",
    "converged",
    "passed",
    "valid",
    "true",
    "yes",
)
Rows = Sequence[Mapping[str, Any]]
Table: TypeAlias = pd.DataFrame | Rows
WHOLE = re.compile(r"\d+\.0")
NUMBERS = ("sample", "run")
TURNS = Column(TURN, int, low=0, high=1e9, empty=True)
OPTIONAL = ("status", TURN)
RESPONSE = (
    "a finite number within 1e100 of 0; a run that failed has another `status` than ok"
)
ALIKE = 1e-12  # least eigenvalue of the correlations of responses that follow from each other
ROUNDED = 1e-6  # of a range: a table may have been rounded by a spreadsheet


def runs_of(samples: pd.DataFrame) -> pd.DataFrame:
    """Make a row for each run of a batch's samples: `sample`, `run` from 1, and the parameters.

    The runs of a sample differ in the random numbers of the simulator alone.
    """
    table = (
        samples.loc[samples.index.repeat(samples["seeds"])]
        .drop(columns="seeds")
        .reset_index(drop=True)
    )
    table.insert(1, "run", table.groupby("sample").cumcount() + 1)
    return table


def next_number(data: pd.DataFrame) -> int:
    """Return the number of the next sample."""
    numbers = pd.to_numeric(data["sample"], errors="coerce")
    return (
        int(numbers.max()) + 1
        if numbers.notna().all()
        else data["sample"].nunique() + 1
    )


def check_responses(data: pd.DataFrame, targets: Targets) -> None:
    """Refuse a response that is the same in all good runs, and responses of which one follows from the others."""
    names = list(targets.names)
    for name in names:
        count = data[name].count()
        allowed = f"results that differ; all {count} good runs have this one: is the right column read?"
        require(
            count < 2 or data[name].nunique() > 1,
            "runs",
            name,
            float(data[name].max()),
            allowed,
        )
    values = data[names].dropna()
    if len(values) > len(names) + 1:
        shares, axes = np.linalg.eigh(values.corr())
        tied = [
            name
            for name, part in zip(names, axes[:, 0], strict=True)
            if abs(part) > ROUNDED
        ]
        allowed = (
            "responses none of which follows from the others: leave one of them out"
        )
        require(shares[0] > ALIKE, "runs", "targets", ", ".join(tied), allowed)


def samples_of_runs(
    data: pd.DataFrame, space: ParameterSpace, targets: Targets
) -> pd.DataFrame:
    """Summarise the runs by sample, as the stage `dataset` does: parameters, status, means and standard errors.

    A response counts as many runs as have it: bench tests fail separately.
    """
    rows = []
    for sample, own in data.groupby("sample", sort=False):
        count = int(own[list(targets.names)].count().min())
        ok = count > 0 and 2 * count >= len(own)
        row = {
            "sample": sample,
            **own.iloc[0][list(space.names)],
            "status": OK if ok else "failed",
        }
        rows.append(row | {"reason": "", "n_seeds": count})
        for name, error in zip(targets.names, targets.errors, strict=True):
            rows[-1][name], rows[-1][error] = mean_and_error(
                own[name].dropna() if ok else ()
            )
    return pd.DataFrame(rows).astype(
        dict.fromkeys((*targets.names, *targets.errors), float)
    )


def runs_by_bench(data: pd.DataFrame, targets: Targets) -> pd.DataFrame:
    """List the runs of each bench test as rows of their own, as the stage `dataset` writes them."""
    tables = []
    for bench, own in targets.benches.items():
        names = [targets.names[k] for k in own]
        status = np.where(data[names].notna().all(axis=1), OK, "failed")
        tables.append(
            data[["sample", *names]].assign(apparatus=bench, status=status, reason="")
        )
    return pd.concat(tables, ignore_index=True)


def read_runs(path: Path_, study: Study) -> pd.DataFrame:
    """Read a CSV file of runs and check it by `checked_runs`."""
    return checked_runs(study, rows_of(path), path)


def rows_of(path: Path_) -> Rows:
    """Read the rows of a CSV file of runs as text."""
    table = read(
        path, [Column("status", str, needed=False, empty=True)], "a CSV file of runs"
    )
    table.values |= {
        key: without_point(table.values[key]) for key in NUMBERS if key in table.values
    }
    return table.rows()


def without_point(cells: Iterable[Any]) -> list[str]:
    """Write numbers of samples or runs as text, without the .0 that pandas and spreadsheets add to a whole column."""
    texts = [str(cell).strip() for cell in cells]
    return [text[:-2] for text in texts] if all(map(WHOLE.fullmatch, texts)) else texts


def checked_runs(
    study: Study, rows: Table, source: object = "runs", enough: bool = True
) -> pd.DataFrame:
    """Check a table of runs; return ``sample``, ``status``, parameters and responses, with the turns as attribute.

    Columns of fixed parameters, ``sample``, ``run`` and ``status`` are optional. Rows with the same parameters are
    replicates. A run with another status than ``ok`` failed; its responses are not read. Samples are numbered in the
    order of their first run, unless the table numbers them. `enough` also refuses too few good samples. InputError
    names `source` and the rows.
    """
    if isinstance(rows, pd.DataFrame):
        rows = rows.to_dict("records")
    require(rows, source, "rows", 0, "a header and a row for each run")
    space, names = study.parameters, study.targets.names
    check_columns(
        source,
        rows[0],
        (*space.free, *names),
        optional=(*OPTIONAL, *NUMBERS, *space.names),
    )
    rows = with_fixed(rows, space)
    cells = {
        name: [row.get(name) for row in rows]
        for name in (*space.names, *names, *OPTIONAL)
    }
    status = [str(cell or OK).strip() for cell in cells["status"]]
    status = [OK if one.casefold() in GOOD else one for one in status]
    unclear = [
        (k, "status", one, "ok, or a word such as failed")
        for k, one in enumerate(status)
        if is_plain([one])
    ]
    failed = {k for k, one in enumerate(status) if one != OK}
    ends = space.complete(np.array([space.low, space.high]))
    sets, faults = check(cells, map(_parameter, space.names, *ends.tolist()))
    responses, more = check(
        cells,
        [Column(name, float, -1e100, 1e100, words=RESPONSE) for name in names],
        failed,
    )
    turns, others = check(cells, [TURNS])
    refuse(source, [*faults, *more, *others, *unclear])
    table = pd.DataFrame({"status": status, **sets, **responses})
    parameters = list(space.names)
    table[parameters] = np.clip(
        table[parameters].to_numpy(float), *ends
    )  # undo the rounding of a spreadsheet
    table.insert(
        0, "sample", _numbers_of_samples(table[parameters], rows, study, source)
    )
    table.attrs[TURN] = np.nan_to_num(turns[TURN]).astype(int).tolist()
    _refuse_twice(table, rows, source)
    samples, fewest = (
        table[table["status"] == OK]["sample"].nunique(),
        space.dimensions + 2,
    )
    allowed = f"at least {fewest}, two more than the free parameters"
    allowed += (
        f"; runs with the status {', '.join(sorted({*status} - {OK})):.60} failed"
        if failed
        else ""
    )
    require(
        not enough or samples >= fewest,
        source,
        "samples with a good run",
        samples,
        allowed,
    )
    return table


def _parameter(name: str, low: float, high: float) -> Column:
    """Declare the column of a parameter: a table may have been rounded by a spreadsheet."""
    slack = ROUNDED * ((high - low) or abs(high) or 1.0)
    words = (
        f"{low:g}, as it is fixed"
        if low == high
        else f"a number from {low:g} to {high:g}, its range"
    )
    return Column(name, low=low - slack, high=high + slack, words=words)


def _numbers_of_samples(
    sets: pd.DataFrame, rows: Rows, study: Study, source: object
) -> Sequence[int]:
    """Return the numbers of the samples; without any, rows with the same parameters are one sample."""
    numbers: Sequence[int] = pd.factorize(sets.apply(tuple, axis=1))[0] + 1
    if "sample" not in rows[0]:
        return numbers
    reported, repeats = (
        without_point(row["sample"] for row in rows),
        strategy(study.settings.strategy).repeats_points,
    )
    first_of_name: dict[str, int] = {}
    first_of_set: dict[int, int] = {}
    faults: list[Fault] = []
    for k, (name, number) in enumerate(zip(reported, numbers, strict=True)):
        first, other = (
            first_of_name.setdefault(name, k),
            first_of_set.setdefault(number, k),
        )
        if numbers[first] != number:
            allowed = f"one set of parameters for each sample; row {first + 1} has another one"
            faults.append((k, "sample", name, allowed))
        elif reported[other] != name and not repeats:
            allowed = f"{reported[other]}, the sample of row {other + 1} with the same parameters"
            faults.append((k, "sample", name, allowed))
    refuse(source, faults)
    digits = all(name.isdecimal() and len(name) < 10 for name in reported)
    distinct = len({int(name) if digits else name for name in reported}) == len(
        {*reported}
    )  # 3 and 003 are two
    return (
        [int(name) for name in reported]
        if digits and distinct
        else pd.factorize(pd.Series(reported))[0] + 1
    )


def with_fixed(rows: Rows, space: ParameterSpace) -> list[dict[str, Any]]:
    """Add columns for all fixed parameters to the rows."""
    missing = {
        name: value
        for name, value in space.fixed.items()
        if rows and name not in rows[0]
    }
    return [missing | dict(row) for row in rows]


def _refuse_twice(table: pd.DataFrame, rows: Rows, source: object) -> None:
    """Refuse a duplicate run, and a row that repeats all numbers of an earlier row."""
    seen: dict[tuple[Any, ...], int] = {}
    faults: list[Fault] = []
    numbered = (
        "run" in rows[0]
    )  # it tells runs apart whose results are equal, as of a simulator without random numbers
    for k, (row, values) in enumerate(
        zip(rows, table.itertuples(index=False, name=None), strict=True)
    ):
        key = (values[0], str(row["run"]).strip()) if numbered else values
        first = seen.setdefault(key, k) if numbered or values[1] == OK else k
        if first != k and numbered:
            faults.append(
                (
                    k,
                    "sample and run",
                    list(key),
                    f"each once; row {first + 1} has them, too",
                )
            )
        elif first != k:
            allowed = f"a run of its own, or a column `run`: all numbers of this row stand in row {first + 1}"
            faults.append((k, "row", "there twice", allowed))
    refuse(source, faults)
