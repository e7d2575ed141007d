"""The record of a study's runs, the only part of a study that grows, in memory or in a file."""

import itertools
import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.strategies.base import Answer, Batch, Studied, strategy
from repose.calibrate.strategies.runs import (
    NUMBERS,
    OK,
    TURN,
    TURNS,
    checked_runs,
    next_number,
    rows_of,
    runs_of,
    with_fixed,
    without_point,
)
from repose.common import ledger
from repose.common.errors import InputError, require
from repose.common.files import write_table
from repose.common.lock import exclusive
from repose.common.tables import Column, check, check_columns, refuse

FAILED = "failed"
SAME = 1e-6  # relative: a table may have been rounded by a spreadsheet
SOURCE = "the table of runs"


class Record:
    """All runs of a study so far, in memory or in `file`, and its strategy's next proposal.

    A proposal depends on the study and on the runs of the turns before alone, so a study that goes on from its file
    asks for the same samples as before. A turn ends when all of its runs are told; several processes may tell parts.
    """

    def __init__(self, study: Studied, file: str | os.PathLike | None = None) -> None:
        self.study, self.file = study, None if file is None else Path(file)
        self._rows: list[dict[str, Any]] = []
        self._is_record = False  # the file that was read, and no table of somebody else
        self._proposals: dict[
            str, Batch | Answer
        ] = {}  # after which runs; the last one alone
        self.data = pd.DataFrame()
        self.read()

    def read(self) -> None:
        """Take the rows of the file, to which other processes may have added."""
        if self.file is not None and self.file.exists():
            rows = rows_of(self.file)
            self._is_record = bool(rows) and TURN in rows[0]
            self._take(rows, self.file)

    @property
    def proposal(self) -> Batch | Answer:
        """The samples of the turn, or the answer."""
        return self._turn[0]

    @property
    def _turns(self) -> np.ndarray:
        """The number of each run's turn; 0 for a run without one."""
        return np.nan_to_num(
            check({TURN: [row.get(TURN) for row in self._rows]}, [TURNS])[0][TURN]
        ).astype(int)

    @property
    def _last_turn(self) -> int:
        """The number of the last turn with a run; 0 without any."""
        return int(self._turns.max(initial=0))

    @cached_property
    def _turn(self) -> tuple[Batch | Answer, int]:
        """The proposal and its number: the last one while a run of it is missing."""
        number = self._last_turn
        if number:
            before = self._proposed(self.data[self._turns < number])
            if len(self._missing(before)):
                return before, number
        return self._proposed(self.data), number + 1

    def _proposed(self, data: pd.DataFrame) -> Batch | Answer:
        """Ask the strategy what it proposes after runs."""
        key = data.to_csv()
        try:
            if key not in self._proposals:
                propose = strategy(self.study.settings.strategy).propose
                self._proposals = {
                    key: propose(self.study, data.reset_index(drop=True))
                }
            return self._proposals[key]
        except InputError as error:
            if self.file is None or error.source != "runs":
                raise
            raise InputError(self.file, error.key, error.value, error.allowed) from None

    def _missing(self, proposal: Batch | Answer) -> pd.DataFrame:
        """List the runs of a proposal that are not told: `sample`, `run` and the parameters."""
        asked = runs_of(
            proposal.samples[["sample", *self.study.parameters.names, "seeds"]]
        )
        told = {(str(row.get("sample")), str(row.get("run"))) for row in self._rows}
        open_ = [
            (str(one.sample), str(one.run)) not in told for one in asked.itertuples()
        ]
        return asked[open_].reset_index(drop=True)

    @property
    def asked(self) -> pd.DataFrame:
        """The runs to make: `sample`, `run` and the parameters."""
        return self._missing(self.proposal)

    def add(self, table: pd.DataFrame) -> None:
        """Add runs; `Study.tell` says what `table` holds."""
        table = _checked_table(table)
        with nullcontext() if self.file is None else exclusive(self.file):
            self.read()
            rows = (
                self._made_before(table)
                if "sample" not in table
                else self._of_the_proposal(table)
            )
            if "run" not in table and len(self.data):
                _refuse_again(
                    rows.drop(columns=["sample", "run", TURN], errors="ignore"),
                    self.data,
                    SOURCE,
                )
            numbered = [
                {key: _exact(value) for key, value in row.items()}
                for row in rows.to_dict("records")
            ]
            self._take(
                [*self._rows, *numbered],
                SOURCE if self.file is None else self.file,
                write=True,
            )

    def add_file(self, path: str | os.PathLike) -> None:
        """Add the runs of any CSV file; on an InputError the record stays as it was.

        Runs that were not asked for count from the next turn on; those before the first run of a turn count at once.
        """
        assert self.file is not None
        checked = checked_runs(self.study, rows := rows_of(path), path, enough=False)
        rows = with_fixed(rows, self.study.parameters)
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with exclusive(self.file):
            self.read()
            if "run" not in rows[0] and len(self.data):
                _refuse_again(checked, self.data, path)
            numbered = self._numbered(rows, checked[list(self.study.parameters.names)])
            self._take([*self._rows, *numbered], f"{self.file} with {path}", write=True)

    def _numbered(
        self, rows: Sequence[Mapping[str, Any]], sets: pd.DataFrame
    ) -> list[dict[str, Any]]:
        """Give rows of any table the sample, run and turn that were asked for; number the others on."""
        names = list(sets)
        try:
            asked, turn = self.asked, self._turn[1]
        except InputError:  # the runs so far are too few for a proposal
            asked, turn = (
                pd.DataFrame(columns=["sample", "run", *names], dtype=float),
                self._last_turn + 1,
            )
        fresh = itertools.count(
            next_number(pd.concat([self.data, asked]))
            if len(asked) + len(self.data)
            else 1
        )
        samples = dict(zip(_points(asked, names), asked["sample"], strict=True))
        samples |= dict(
            zip(
                _points(self.data, names),
                (row["sample"] for row in self._rows),
                strict=True,
            )
        )
        told, own, numbers = {(row["sample"], row["run"]) for row in self._rows}, [], []
        for row, point in zip(rows, _points(sets, names), strict=True):
            given = [
                asked[key].astype(str) == str(row[key]).strip()
                for key in ("sample", "run")
                if key in row
            ]
            same = np.isclose(asked[names], point, rtol=SAME, atol=0).all(axis=1)
            found = asked[np.logical_and.reduce([same, *given])]
            own.append(len(found) > 0)
            if own[-1]:
                asked = asked.drop(index=found.index[0])
                numbers.append(
                    (str(found["sample"].iloc[0]), str(found["run"].iloc[0]))
                )
            else:
                if point not in samples:
                    samples[point] = next(fresh)
                sample = row.get("sample", str(samples[point]))
                run = next(
                    str(k) for k in itertools.count(1) if (sample, str(k)) not in told
                )
                numbers.append((sample, row.get("run", run)))
            told.add(numbers[-1])
        others = turn if turn == self._last_turn or any(own) else turn - 1
        return [
            {
                "sample": sample,
                "run": run,
                **row,
                TURN: str(turn if is_asked else others),
            }
            for (sample, run), row, is_asked in zip(numbers, rows, own, strict=True)
        ]

    def _take(
        self, new: Sequence[Mapping[str, Any]], source: object, write: bool = False
    ) -> None:
        """Check all rows together, `write` them to the file, and keep them, with a sample and a run each."""
        data = checked_runs(self.study, new, source, enough=False)
        numbers = (
            data[["sample"]]
            .assign(run=data.groupby("sample").cumcount() + 1)
            .astype(str)
        )
        rows = [
            number | dict(row)
            for number, row in zip(numbers.to_dict("records"), new, strict=True)
        ]
        if write and self.file is not None:
            if (
                self._is_record and self.file.exists()
            ):  # a copy, or edited by a spreadsheet: its rows are among these
                ledger.adopt(self.file)
            write_table(self.file, pd.DataFrame(rows))
        self.data, self._rows = data, rows
        self.__dict__.pop("_turn", None)

    def _of_the_proposal(self, table: pd.DataFrame) -> pd.DataFrame:
        """Add parameters, numbers of the runs, statuses and turn to a table of all or some of the proposal's runs."""
        asked, names = self.asked, list(self.study.targets.names)
        missing = [name for name in names if name not in table]
        require(
            not missing, SOURCE, "columns", list(table), f"also {', '.join(missing)}"
        )
        if "run" not in table:
            first = asked.astype({"sample": str}).groupby("sample")["run"].min()
            number = table.groupby("sample").cumcount()
            table = table.assign(
                run=number + table["sample"].map(first).fillna(1).astype(int)
            )
        wanted, given = (
            pd.MultiIndex.from_frame(one[["sample", "run"]].astype(str))
            for one in (asked, table)
        )
        off = sorted(set(given) - set(wanted)) or sorted(given[given.duplicated()])
        if off:
            allowed = f"one of the {len(asked)} runs that `ask` gave, each once; a failed run has NaN as responses"
            raise InputError(SOURCE, "sample and run", list(off[0]), allowed)
        found = asked.iloc[wanted.get_indexer(given)].reset_index(drop=True)
        for name in self.study.parameters.names:
            if name in table and not np.allclose(
                _numbers(table, name), found[name], rtol=SAME, atol=0
            ):
                raise InputError(
                    SOURCE,
                    name,
                    "changed",
                    "the parameters that `ask` gave, or no such column",
                )
        return self._with_responses(found, table).sort_values(
            ["sample", "run"], ignore_index=True
        )

    def _made_before(self, table: pd.DataFrame) -> pd.DataFrame:
        """Give numbers to runs of a table without any: rows with the same parameters are runs of one sample."""
        space = self.study.parameters
        missing = [
            name
            for name in (*space.free, *self.study.targets.names)
            if name not in table
        ]
        require(
            not missing,
            SOURCE,
            "columns",
            list(table),
            f"sample; or also {', '.join(missing)}",
        )
        sets = {
            name: _numbers(table, name) if name in table else space.fixed[name]
            for name in space.names
        }
        found = pd.DataFrame(sets)
        rows = self._with_responses(found, table)
        return pd.DataFrame(self._numbered(rows.to_dict("records"), found)).assign(
            **{TURN: self._turn[1]}
        )

    def _with_responses(self, found: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
        """Add status, responses and turn to runs."""
        names = list(self.study.targets.names)
        status = pd.Series(np.where(table[names].notna().all(axis=1), OK, FAILED))
        status = (
            table["status"].astype(object).fillna(status)
            if "status" in table
            else status
        )
        return found.assign(
            status=status,
            **{name: table[name] for name in names},
            **{TURN: self._turn[1]},
        )


def _points(table: pd.DataFrame, names: Sequence[str]) -> list[tuple[float, ...]]:
    """Return the parameter sets of a table."""
    return (
        []
        if table.empty
        else list(table[list(names)].itertuples(index=False, name=None))
    )


def _refuse_again(new: pd.DataFrame, data: pd.DataFrame, source: object) -> None:
    """Refuse a good run without a number all of whose numbers are in the record."""
    names = [name for name in new if name != "sample"]
    known = set(_points(data, names))
    allowed = "a run of its own: the record has all numbers of this row"
    for k, run in enumerate(_points(new, names), start=1):
        # a run that failed is never among them: its responses are NaN
        require(run not in known, f"{source}, row {k}", "row", "there twice", allowed)


def _checked_table(table: Any) -> pd.DataFrame:
    """Return a table with a plain index; InputError for anything else, or a column that is there twice."""
    require(
        isinstance(table, pd.DataFrame),
        SOURCE,
        "type",
        type(table).__name__,
        "a pandas.DataFrame",
    )
    twice = list(map(str, table.columns[table.columns.duplicated()]))
    require(not twice, SOURCE, "column", ", ".join(twice[:1]), "each column once")
    require(not table.empty, SOURCE, "rows", 0, "a row for each run")
    check_columns(SOURCE, table, (), optional=("status", *NUMBERS))
    numbers = {key: table[key] for key in NUMBERS if key in table}
    for key, column in numbers.items():
        require(
            column.notna().all(),
            SOURCE,
            key,
            "missing",
            "a number in each row, as `ask` gave it",
        )
    return table.assign(
        **{key: without_point(column) for key, column in numbers.items()}
    ).reset_index(drop=True)


def _numbers(table: pd.DataFrame, name: str) -> np.ndarray:
    """Return a column of numbers (n,)."""
    values, faults = check({name: table[name].tolist()}, [Column(name)])
    refuse(SOURCE, faults)
    return np.array(values[name])


def _exact(value: Any) -> str:
    """Write a cell as the file has it, with all digits; empty for NaN."""
    text = repr(float(value)) if isinstance(value, float | np.floating) else str(value)
    return "" if text == "nan" else text
