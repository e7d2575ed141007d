"""The record of a study's runs, the only part of a study that grows, in memory or in a file."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.core.errors import InputError
from repose.core.files import read_rows, write_table
from repose.strategies.base import Answer, Batch, Studied, strategy
from repose.strategies.runs import OK, checked_runs, runs_of

FAILED = "failed"


class Record:
    """All runs of a study so far, in memory or in `file`, and its strategy's next proposal.

    The proposal depends on the study and the runs alone, so a study that goes on from its file asks for the same
    samples as before.
    """

    def __init__(self, study: Studied, file: str | os.PathLike | None = None) -> None:
        self.study, self.file = study, None if file is None else Path(file)
        self._rows: list[dict[str, Any]] = []
        self.data = pd.DataFrame()
        self._proposal: Batch | Answer | None = None
        if self.file is not None and self.file.exists():
            self._take(read_rows(self.file, what="a CSV file of runs"), self.file)

    @property
    def proposal(self) -> Batch | Answer:
        """The next samples, or the answer."""
        if self._proposal is None:
            self._proposal = strategy(self.study.config["strategy"]).propose(self.study, self.data)
        return self._proposal

    @property
    def asked(self) -> pd.DataFrame:
        """The runs of the proposal: `sample`, `run` and the parameters."""
        names = self.study.parameters.names
        return runs_of(self.proposal.samples[["sample", *names, "seeds"]])

    def add(self, table: pd.DataFrame) -> None:
        """Add the runs of the proposal; `Study.tell` says what `table` holds."""
        rows = self._of_the_proposal(table)
        rows = [{key: _exact(value) for key, value in row.items()} for row in rows.to_dict("records")]
        self._take([*self._rows, *rows], "the table of runs" if self.file is None else self.file)
        if self.file is not None:
            write_table(self.file, pd.DataFrame(self._rows))

    def _take(self, rows, source):
        """Check all rows together and keep them."""
        self.data = checked_runs(self.study, rows, source, enough=False)
        self._rows, self._proposal = rows, None

    def _of_the_proposal(self, table):
        """The table with parameters, numbers of the runs and statuses; its rows are the proposal's."""
        asked, names = self.asked, list(self.study.targets.names)
        source = "the table of runs"
        missing = [name for name in ("sample", *names) if name not in table]
        if missing:
            raise InputError(source, "columns", list(table), f"also {', '.join(missing)}")
        table = table.reset_index(drop=True)
        if "run" not in table:
            table = table.assign(run=table.groupby("sample").cumcount() + 1)
        wanted, given = (
            pd.MultiIndex.from_frame(one[["sample", "run"]].astype(str)) for one in (asked, table)
        )
        if sorted(wanted) != sorted(given):
            off = sorted(set(wanted) ^ set(given)) or sorted(given[given.duplicated()])
            allowed = f"the {len(asked)} runs that `ask` gave, each once; a run that failed has NaN for its responses"
            raise InputError(source, "sample and run", list(off[0]), allowed)
        row = wanted.get_indexer(given)
        found = asked.iloc[row].reset_index(drop=True)
        for name in self.study.parameters.names:
            if name in table and not np.allclose(table[name].to_numpy(float), found[name], rtol=1e-6):
                raise InputError(source, name, "changed", "the parameters that `ask` gave, or no such column")
        ok = table[names].notna().all(axis=1)
        status = table["status"] if "status" in table else np.where(ok, OK, FAILED)
        return found.assign(status=status, **{name: table[name] for name in names}).sort_values(
            ["sample", "run"], ignore_index=True
        )


def _exact(value):
    """A cell as the file has it, with all digits; empty for NaN."""
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else repr(float(value))
    return str(value)
