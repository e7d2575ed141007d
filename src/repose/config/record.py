"""The record of a study's runs, the only part of a study that grows, in memory or in a file."""

import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.core.errors import InputError
from repose.core.files import write_table
from repose.core.lock import exclusive
from repose.core.tables import Column, check, refuse
from repose.strategies.base import Answer, Batch, Studied, strategy
from repose.strategies.runs import OK, TURN, TURNS, checked_runs, rows_of, runs_of

FAILED = "failed"
SOURCE = "the table of runs"


class Record:
    """All runs of a study so far, in memory or in `file`, and its strategy's next proposal.

    A proposal depends on the study and on the runs of the turns before alone, so a study that goes on from its file
    asks for the same samples as before. A turn ends when all of its runs are told; several processes may tell parts.
    """

    def __init__(self, study: Studied, file: str | os.PathLike | None = None) -> None:
        self.study, self.file = study, None if file is None else Path(file)
        self._rows: list[dict[str, Any]] = []
        self.data = pd.DataFrame()
        self._read()

    def _read(self) -> None:
        """Take the rows of the file."""
        if self.file is not None and self.file.exists():
            self._take(rows_of(self.file), self.file)

    @property
    def proposal(self) -> Batch | Answer:
        """The samples of the turn, or the answer."""
        return self._turn[0]

    @cached_property
    def _turn(self) -> tuple[Batch | Answer, int]:
        """The proposal and its number: the last one while a run of it is missing."""
        told = check({TURN: [row.get(TURN) for row in self._rows]}, [TURNS])[0]
        turns = np.nan_to_num(told[TURN])
        number = int(turns.max(initial=0))
        if number:
            before = self._proposed(self.data[turns < number])
            if len(self._missing(before)):
                return before, number
        return self._proposed(self.data), number + 1

    def _proposed(self, data: pd.DataFrame) -> Batch | Answer:
        """Ask the strategy what it proposes after runs."""
        return strategy(self.study.config["strategy"]).propose(self.study, data.reset_index(drop=True))

    def _asked_by(self, proposal: Batch | Answer) -> pd.DataFrame:
        """List all runs of a proposal: `sample`, `run` and the parameters."""
        return runs_of(proposal.samples[["sample", *self.study.parameters.names, "seeds"]])

    def _missing(self, proposal: Batch | Answer) -> pd.DataFrame:
        """List the runs of a proposal that are not told."""
        asked = self._asked_by(proposal)
        told = {(str(row.get("sample")), str(row.get("run"))) for row in self._rows}
        open_ = [(str(one.sample), str(one.run)) not in told for one in asked.itertuples()]
        return asked[open_].reset_index(drop=True)

    @property
    def asked(self) -> pd.DataFrame:
        """The runs to make: `sample`, `run` and the parameters."""
        return self._missing(self.proposal)

    def add(self, table: pd.DataFrame) -> None:
        """Add runs; `Study.tell` says what `table` holds."""
        table = _checked_table(table)
        with nullcontext() if self.file is None else exclusive(self.file):
            self._read()
            rows = self._made_before(table) if "sample" not in table else self._of_the_proposal(table)
            numbered = [{key: _exact(value) for key, value in row.items()} for row in rows.to_dict("records")]
            self._take([*self._rows, *numbered], SOURCE if self.file is None else self.file)
            if self.file is not None:
                write_table(self.file, pd.DataFrame(self._rows))

    def _take(self, rows: Sequence[Mapping[str, Any]], source: object) -> None:
        """Check all rows together and keep them."""
        self.data = checked_runs(self.study, rows, source, enough=False)
        self._rows = [dict(row) for row in rows]
        self.__dict__.pop("_turn", None)

    def _of_the_proposal(self, table: pd.DataFrame) -> pd.DataFrame:
        """Add parameters, numbers of the runs, statuses and turn to a table of all or some of the proposal's runs."""
        asked, names = self.asked, list(self.study.targets.names)
        missing = [name for name in names if name not in table]
        if missing:
            raise InputError(SOURCE, "columns", list(table), f"also {', '.join(missing)}")
        if "run" not in table:
            first = asked.groupby("sample")["run"].min()
            number = table.groupby("sample").cumcount()
            table = table.assign(run=number + table["sample"].map(first).fillna(1).astype(int))
        wanted, given = (pd.MultiIndex.from_frame(one[["sample", "run"]].astype(str)) for one in (asked, table))
        off = sorted(set(given) - set(wanted)) or sorted(given[given.duplicated()])
        if off:
            allowed = f"one of the {len(asked)} runs that `ask` gave, each once; a failed run has NaN as responses"
            raise InputError(SOURCE, "sample and run", list(off[0]), allowed)
        row = wanted.get_indexer(given)
        found = asked.iloc[row].reset_index(drop=True)
        for name in self.study.parameters.names:
            if name in table and not np.allclose(_numbers(table, name), found[name], rtol=1e-6):
                raise InputError(SOURCE, name, "changed", "the parameters that `ask` gave, or no such column")
        return self._with_responses(found, table).sort_values(["sample", "run"], ignore_index=True)

    def _made_before(self, table: pd.DataFrame) -> pd.DataFrame:
        """Give numbers to runs that `ask` did not give: rows with the same parameters are runs of one sample."""
        names = list(self.study.parameters.free)
        missing = [name for name in (*names, *self.study.targets.names) if name not in table]
        if missing:
            raise InputError(SOURCE, "columns", list(table), f"sample; or also {', '.join(missing)}")
        used = self.data["sample"].max() if len(self.data) else 0
        first = max(used, self.asked["sample"].max()) + 1
        sets = pd.factorize(pd.Series(list(zip(*(_numbers(table, name) for name in names), strict=True))))[0]
        found = pd.DataFrame({"sample": sets + first})
        found["run"] = found.groupby("sample").cumcount() + 1
        for name in self.study.parameters.names:
            found[name] = _numbers(table, name) if name in table else self.study.parameters.fixed[name]
        return self._with_responses(found, table)

    def _with_responses(self, found: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
        """Add status, responses and turn to runs."""
        names = list(self.study.targets.names)
        ok = table[names].notna().all(axis=1)
        status = table["status"] if "status" in table else np.where(ok, OK, FAILED)
        responses = {name: table[name] for name in names}
        return found.assign(status=status, **responses, **{TURN: self._turn[1]})


def _checked_table(table: Any) -> pd.DataFrame:
    """Return a table with a plain index; InputError for anything else, or a column that is there twice."""
    if not isinstance(table, pd.DataFrame):
        raise InputError(SOURCE, "type", type(table).__name__, "a pandas.DataFrame")
    twice = table.columns[table.columns.duplicated()]
    if len(twice):
        raise InputError(SOURCE, "column", str(twice[0]), "each column once")
    if table.empty:
        raise InputError(SOURCE, "rows", 0, "a row for each run")
    return table.reset_index(drop=True)


def _numbers(table: pd.DataFrame, name: str) -> np.ndarray:
    """Return a column of numbers (n,)."""
    values, faults = check({name: table[name].tolist()}, [Column(name)])
    refuse(SOURCE, faults)
    return np.array(values[name])


def _exact(value: Any) -> str:
    """Write a cell as the file has it, with all digits; empty for NaN."""
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else repr(float(value))
    return str(value)
