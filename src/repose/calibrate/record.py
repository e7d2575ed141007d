"""Keep the table of a study's runs, to which `Study.tell` adds rows."""

import itertools
import math
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from decimal import Decimal
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.progress import announce
from repose.calibrate.scales import LOG
from repose.calibrate.strategies.base import Answer, Batch, strategy
from repose.calibrate.strategies.runs import (
    NUMBER_COLUMNS,
    OK,
    TURN_NUMBERS,
    MergedRows,
    Rows,
    add_missing_columns,
    checked_runs,
    describe_unread_columns,
    find_next_sample,
    has_no_results,
    judge_runs,
    list_columns,
    list_needed_responses,
    list_runs,
    name_file_of_runs,
    read_rows,
    strip_decimal_points,
)
from repose.calibrate.units import describe_other_units
from repose.common import ledger
from repose.common.errors import InputError
from repose.common.files import TURN_COLUMN, write_table
from repose.common.lock import lock_file
from repose.common.tables import (
    CellFault,
    Column,
    convert_columns,
    match_column_names,
    parse_number,
    refuse,
    require_columns,
)

if TYPE_CHECKING:
    from repose.calibrate.study import Study

# Relative difference up to which two values of a parameter count as the same, because a
# spreadsheet may have rounded the table.
SAME_TOLERANCE = 1e-6
# Rounding changes a number by at most half a unit of its last digit. The additional
# 0.001 allows for the error of floating-point numbers.
ROUNDING_DIGITS = 0.501
# Largest accepted rounding of a parameter, as a fraction of its range.
MAX_ROUNDING_FRACTION = 0.05
TABLE_NAME = "the table of runs"

Row = dict[str, Any]
Point = tuple[float, ...]


class _Turn(NamedTuple):
    """A proposal of the strategy, with the number of its turn, counted from 1."""

    proposal: Batch | Answer
    number: int


class CheckedAnswer(NamedTuple):
    """An answer of the strategy that was simulated again.

    Attributes
    ----------
    answer : Answer
        The answer.
    runs : pandas.DataFrame
        The runs from which it follows.
    check : pandas.DataFrame
        The runs with its parameters.
    """

    answer: Answer
    runs: pd.DataFrame
    check: pd.DataFrame


class _RunLabel(NamedTuple):
    """The cells that identify a run in the table, and whether the run was requested."""

    sample: str
    run: str  # number of the run within its sample
    was_requested: bool  # whether the strategy asked for the run


class _ParsedFile(NamedTuple):
    """The content of a file of runs, and what was read from it."""

    content: bytes
    rows: list[Row]  # as text, with the numbers of sample and run
    data: pd.DataFrame  # the same rows after the check


class Record:
    """All runs of a study so far, and the proposal of its strategy after them.

    A turn is a proposal with its runs. It ends when all of them are in the record. A
    proposal depends only on the study and on the runs of earlier turns. So a study that
    is resumed from its file asks for the same samples again. Several threads and
    several processes may add parts of a turn, in any order.

    Parameters
    ----------
    study : Study
        Its parameters, targets and settings are read.
    file : path, optional
        CSV file of the runs. Without a file, the runs are only kept in memory.
    """

    def __init__(self, study: "Study", file: str | os.PathLike | None = None) -> None:
        """Create the record, and read the runs in the file if it exists.

        The docstring of the class describes the parameters.
        """
        self.study = study
        self.file = None if file is None else Path(file)
        self.data = pd.DataFrame()  # a checked row for each run
        # The same runs in the same order, as text, with all columns of the file.
        # `_replace_rows` sets both together.
        self._rows: list[Row] = []
        # Whether this program wrote the file, so that it has the column of the turns.
        # Otherwise the user made the file.
        self._is_record = False
        # What was read from the file the last time. The same content is not read again.
        self._parsed: _ParsedFile | None = None
        # The turn whose runs are to be made next. None means that `_find_turn` must
        # find it again, because the rows have changed.
        self._cached_turn: _Turn | None = None
        # The last proposal, with the runs that it is based on; None before the first.
        self._cached_proposal: tuple[str, Batch | Answer] | None = None
        # Unread columns that `new_unread_columns` has already described to the user.
        self._described_columns: set[str] = set()
        # Responses that were already described as being in another unit.
        self._described_units: set[str] = set()
        # Only the thread that holds this lock reads or adds runs.
        self._lock = threading.RLock()
        self.read()

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for pickle, without the lock, which cannot be pickled."""
        return {key: value for key, value in vars(self).items() if key != "_lock"}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Restore a state from pickle, with a new lock."""
        vars(self).update(state, _lock=threading.RLock())

    @contextmanager
    def locked(self) -> Iterator["Record"]:
        """Read the file and yield the record, with the lock held in the context.

        Other threads wait until the context ends.
        """
        with self._lock:
            self.read()
            yield self

    def read(self) -> None:
        """Replace the runs by those of the file, if it exists.

        Other processes may have added runs to the file.
        """
        if self.file is None or not self.file.exists():
            return
        content = _read_content(self.file)
        if self._parsed is not None and content == self._parsed.content:
            self._set_rows(self._parsed.rows, self._parsed.data)
        else:
            rows = read_rows(self.file, self.study)
            self._replace_rows(rows, self.file)
            self._parsed = None
            # Another process may have written the file in the meantime.
            if content is not None and content == _read_content(self.file):
                self._parsed = _ParsedFile(content, self._rows, self.data)
        self._is_record = bool(self._rows) and TURN_COLUMN in self._rows[0]

    @property
    def proposal(self) -> Batch | Answer:
        """The proposal of the present turn: samples to simulate, or the answer."""
        return self._turn.proposal

    @property
    def requested_runs(self) -> pd.DataFrame:
        """The runs to make: `sample`, `run` and the parameters."""
        return self._missing_runs(self.proposal)

    @property
    def _turn_numbers(self) -> np.ndarray:
        """Number of the turn of each run; 0 for a run without a turn."""
        cells = [row.get(TURN_COLUMN) for row in self._rows]
        numbers, _ = convert_columns({TURN_COLUMN: cells}, [TURN_NUMBERS])
        return np.nan_to_num(numbers[TURN_COLUMN]).astype(int)

    @property
    def _last_turn(self) -> int:
        """Number of the last turn that has a run; 0 if no turn has one."""
        return int(self._turn_numbers.max(initial=0))

    @property
    def _turn(self) -> _Turn:
        """The present turn, which is kept until the rows change."""
        if self._cached_turn is None:
            self._cached_turn = self._find_turn()
        return self._cached_turn

    def _find_turn(self) -> _Turn:
        """Find the turn (a proposal with its runs) whose runs are to be made next.

        If some runs of the last turn in the record are missing, that turn goes on.
        Otherwise a new turn begins.

        Returns
        -------
        _Turn
            The proposal of the turn, and its number.
        """
        last_turn = self._last_turn
        data = self.sorted_data
        has_turns = last_turn > 0
        if has_turns:
            # Propose the last turn again. Its proposal depends only on the runs of
            # earlier turns. The rows of `data` are sorted by turn, so sort the numbers
            # of the turns as well.
            is_earlier = np.sort(self._turn_numbers) < last_turn
            proposal = self._propose(data[is_earlier])
            if len(self._missing_runs(proposal)):
                return _Turn(proposal, last_turn)
        return _Turn(self._propose(data), last_turn + 1)

    @property
    def sorted_data(self) -> pd.DataFrame:
        """The runs, sorted by turn, sample and run.

        This is the order in which the strategy asked for them. So a proposal does not
        depend on the order in which the runs ended.
        """
        if self.data.empty:
            return self.data
        numbers = pd.Series([row["run"] for row in self._rows])
        runs = pd.to_numeric(numbers, errors="coerce")
        order = np.lexsort((runs, self.data["sample"], self._turn_numbers))
        return self.data.iloc[order].reset_index(drop=True)

    def find_checked_answer(self) -> CheckedAnswer | None:
        """Find the answer whose runs are the last turn of the record.

        These runs check the answer, so the runs of earlier turns alone give it again.

        Returns
        -------
        CheckedAnswer or None
            None if the last turn belongs to a batch, or if the runs have no turns.
        """
        last_turn = self._last_turn
        if last_turn == 0:
            return None
        data = self.sorted_data
        # The rows of `data` are sorted by turn, so sort the numbers of the turns.
        turns = np.sort(self._turn_numbers)
        check = data[turns == last_turn].reset_index(drop=True)
        is_earlier = turns < last_turn
        runs = data[is_earlier].reset_index(drop=True)
        runs.attrs[TURN_COLUMN] = turns[is_earlier].tolist()
        # A batch has several samples, so the strategy need not propose it again.
        if runs.empty or check["sample"].nunique() > 1:
            return None
        proposal = self._propose(runs)
        if not isinstance(proposal, Answer):
            return None
        space = self.study.parameters
        simulated = check[list(space.names)].to_numpy(float)[0]
        if not np.allclose(
            space.unit(simulated), space.unit(proposal.values), atol=1e-3
        ):
            return None
        return CheckedAnswer(proposal, runs, check)

    def _propose(self, data: pd.DataFrame) -> Batch | Answer:
        """Ask the strategy what to simulate after some runs, or for its answer.

        The last proposal is cached, because computing it may take minutes.

        Parameters
        ----------
        data : pandas.DataFrame
            The runs, in the order of `sorted_data`.

        Returns
        -------
        Batch or Answer
            The samples to simulate next, or the answer if no more runs are needed.

        Raises
        ------
        InputError
            If the runs do not determine the model of the strategy.
        """
        # The proposal depends only on the runs, and their text identifies them.
        text_of_runs = data.to_csv()
        if self._cached_proposal is not None:
            text_of_cached_runs, cached_proposal = self._cached_proposal
            if text_of_cached_runs == text_of_runs:
                return cached_proposal
        strategy_of_study = strategy(self.study.settings.strategy)
        # Tell the user what the program does, because it may take long.
        announce("choose the next runs or the answer", data)
        # An error about the runs names the file of the record.
        with name_file_of_runs(self.file):
            proposal = strategy_of_study.propose(
                self.study, data.reset_index(drop=True)
            )
        self._cached_proposal = (text_of_runs, proposal)
        return proposal

    def _missing_runs(self, proposal: Batch | Answer) -> pd.DataFrame:
        """List the runs of a proposal that are not in the record yet."""
        columns = ["sample", *self.study.parameters.names, "seeds"]
        requested = list_runs(proposal.samples[columns])
        known = {(str(row.get("sample")), str(row.get("run"))) for row in self._rows}
        is_missing = [
            (str(run.sample), str(run.run)) not in known
            for run in requested.itertuples()
        ]
        return requested[is_missing].reset_index(drop=True)

    def add(self, table: pd.DataFrame) -> list[str]:
        """Add the runs of a table.

        Parameters
        ----------
        table : pandas.DataFrame
            The argument of `Study.tell`. If it has a column `sample`, its rows must be
            runs that the strategy asked for. Otherwise they are earlier runs, which
            were made without a request.

        Returns
        -------
        list of str
            Warnings for the user: a sentence for each column that is not read (see
            `new_unread_columns`), or that is probably in another unit.

        Raises
        ------
        InputError
            If the table is invalid. Then no run is added.
        """
        results = _check_table(table, list_columns(self.study))
        # Let other threads and other processes wait until the runs are added. They may
        # already have added runs themselves, so read the file first.
        file_lock = nullcontext() if self.file is None else lock_file(self.file)
        with self._lock, file_lock:
            self.read()
            if "sample" in results:
                runs = self._complete_requested_runs(results)
            else:
                runs = self._complete_earlier_runs(results)
            # Without the column `run`, equal values are the only sign that a run is
            # already in the record. With it, `_add_rows` compares the run numbers.
            if "run" not in results and len(self.data):
                _reject_repeated_runs(runs, self.data, TABLE_NAME)
            self._add_rows(_format_rows(runs), TABLE_NAME)
            return [*self.new_unread_columns(), *self._find_new_units()]

    def add_file(self, path: str | os.PathLike) -> Rows:
        """Add the runs of another CSV file to the record and to the file of the record.

        The record must have a file. `_assign_numbers` decides to which turn (a proposal
        with its runs) each new run belongs. If the record has the same run without
        results, the new run replaces it, provided that no later turn has begun.

        Parameters
        ----------
        path : path
            The table of runs.

        Returns
        -------
        sequence of mapping
            The rows of the file as text, before the numbers of the samples, runs and
            turns are added.

        Raises
        ------
        InputError
            If the table is invalid, for example empty. Then no run is added.
        """
        assert self.file is not None
        rows = read_rows(path, self.study)
        # `enough=False` accepts a table with few samples, because the record may have
        # more of them. A table without rows is refused.
        runs = checked_runs(self.study, rows, path, enough=False)
        # Add the columns that the file leaves out, such as fixed parameters.
        rows = add_missing_columns(rows, self.study)
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self._lock, lock_file(self.file):
            # Other processes may have added runs to the file of the record.
            self.read()
            if "run" not in rows[0] and len(self.data):
                _reject_repeated_runs(runs, self.data, path)
            parameter_sets = runs[list(self.study.parameters.names)]
            numbered_rows = self._assign_numbers(rows, parameter_sets)
            self._add_rows(numbered_rows, path)
        return rows

    def new_unread_columns(self) -> list[str]:
        """Describe the unread columns whose values vary.

        Each column is described only once, so a further call leaves it out.
        """
        sentences = describe_unread_columns(self.study, self._rows)
        new = [
            sentences[name] for name in sentences if name not in self._described_columns
        ]
        self._described_columns.update(sentences)
        return new

    def _find_new_units(self) -> list[str]:
        """Describe the responses that are probably in another unit, each only once."""
        responses = {
            name: self.data[name].tolist() for name in self.study.targets.names
        }
        sentences = describe_other_units(self.study.targets, responses)
        new = [
            sentences[name] for name in sentences if name not in self._described_units
        ]
        self._described_units.update(sentences)
        return new

    def _assign_numbers(
        self, rows: Sequence[Mapping[str, Any]], parameter_sets: pd.DataFrame
    ) -> list[Row]:
        """Add the columns `sample`, `run` and `turn` to the rows that lack them.

        A turn is a proposal of the strategy with its runs. A requested run belongs to
        the turn that asks for runs now. Any other run also belongs to this turn if the
        turn has a run in the record or among these rows. Otherwise that turn has not
        begun, so the other runs belong to the one before.

        Parameters
        ----------
        rows : sequence of mapping
            Runs of any table, with or without `sample` and `run`.
        parameter_sets : pandas.DataFrame
            The parameters of these rows.

        Returns
        -------
        list of dict
            Copies of the rows with the three columns. A row keeps a `sample` and a
            `run` that it already has, but its turn is replaced.
        """
        requested, turn = self._find_requested_runs(list(parameter_sets))
        labels = self._find_labels(rows, parameter_sets, requested)

        has_begun = turn == self._last_turn
        begins_now = any(label.was_requested for label in labels)
        turn_of_others = turn if has_begun or begins_now else turn - 1

        numbered_rows = []
        for label, row in zip(labels, rows, strict=True):
            turn_of_row = turn if label.was_requested else turn_of_others
            numbered_row = {
                "sample": label.sample,
                "run": label.run,
                # The cells of the row replace the two above, but not the turn below.
                **row,
                TURN_COLUMN: str(turn_of_row),
            }
            numbered_rows.append(numbered_row)
        return numbered_rows

    def _find_labels(
        self,
        rows: Sequence[Mapping[str, Any]],
        parameter_sets: pd.DataFrame,
        requested: pd.DataFrame,
    ) -> list[_RunLabel]:
        """Find the sample of each row, and the number of its run within the sample.

        A row that matches a requested run has the sample and number of the request. Any
        other row keeps the ones that it has. Without a sample, it belongs to the sample
        with the same parameters, or else to a new one. Without a run number, it gets
        the next free number of its sample.

        Parameters
        ----------
        rows : sequence of mapping
            Runs of any table, with or without `sample` and `run`.
        parameter_sets : pandas.DataFrame
            The parameters of these rows.
        requested : pandas.DataFrame
            The runs that the strategy asks for, with `sample`, `run` and parameters.

        Returns
        -------
        list of _RunLabel
            One for each row.
        """
        names = list(parameter_sets)
        # These four variables change from row to row.
        sample_of_point = self._find_samples(requested, names)
        new_samples = itertools.count(self._find_new_sample(requested))
        used_numbers = {(row["sample"], row["run"]) for row in self._rows}
        unmatched_runs = requested.copy()

        labels = []
        points = _list_points(parameter_sets, names)
        for row, point in zip(rows, points, strict=True):
            index = _find_match(unmatched_runs, row, point, names)
            was_requested = index is not None
            if was_requested:
                sample = str(unmatched_runs.at[index, "sample"])
                run = str(unmatched_runs.at[index, "run"])
                # No later row can be the same run, so remove it from the runs to match.
                unmatched_runs = unmatched_runs.drop(index=index)
            else:
                if point not in sample_of_point:
                    sample_of_point[point] = next(new_samples)
                sample = row.get("sample", str(sample_of_point[point]))
                run = row.get("run", _find_free_run(sample, used_numbers))
            labels.append(_RunLabel(sample, run, was_requested))
            used_numbers.add((sample, run))
        return labels

    def _find_requested_runs(self, names: Sequence[str]) -> tuple[pd.DataFrame, int]:
        """Return the runs to make and the number of their turn.

        The table is empty if the runs so far are too few for a proposal.
        """
        try:
            return self.requested_runs, self._turn.number
        except InputError:
            columns = ["sample", "run", *names]
            return pd.DataFrame(columns=columns, dtype=float), self._last_turn + 1

    def _find_samples(
        self, requested: pd.DataFrame, names: Sequence[str]
    ) -> dict[Point, Any]:
        """Find the sample of each parameter set that was asked for or simulated.

        Parameters
        ----------
        requested : pandas.DataFrame
            The runs that the strategy asks for.
        names : sequence of str
            Columns of the parameters.

        Returns
        -------
        dict
            The number of the sample, by the values of its parameters.
        """
        samples = dict(
            zip(_list_points(requested, names), requested["sample"], strict=True)
        )
        for point, row in zip(_list_points(self.data, names), self._rows, strict=True):
            samples[point] = row["sample"]
        return samples

    def _find_new_sample(self, requested: pd.DataFrame) -> int:
        """Return the number of a sample that was neither asked for nor simulated."""
        if len(requested) + len(self.data) == 0:
            return 1
        return find_next_sample(pd.concat([self.data, requested]))

    def _add_rows(self, rows: Sequence[Row], source: object) -> None:
        """Add rows to those of the record, and write all of them to the file.

        If a check raises an InputError, the record and its file are not changed.

        Parameters
        ----------
        rows : sequence of dict
            New runs as text.
        source : object
            Their file, for an error.
        """
        # The new results of a run replace a row without results. The turn must be the
        # same, because the proposals of later turns depend on the runs of this turn.
        keys = ("sample", "run", TURN_COLUMN)
        new_runs = {tuple(row.get(key) for key in keys) for row in rows}
        kept = {
            number: row
            for number, row in enumerate(self._rows, start=1)
            if not has_no_results(row, self.study)
            or tuple(row.get(key) for key in keys) not in new_runs
        }
        record = "the record" if self.file is None else self.file
        merged = MergedRows(record, added=source, recorded_rows=list(kept))
        self._replace_rows([*kept.values(), *rows], merged, write=True)

    def _replace_rows(
        self, rows: Sequence[Mapping[str, Any]], source: object, write: bool = False
    ) -> None:
        """Check rows, and make them the whole content of the record.

        If the check raises an InputError, the record and its file are not changed.

        Parameters
        ----------
        rows : sequence of mapping
            All runs of the study, as text. A row without `sample` or `run` gets the
            missing number.
        source : object
            The file that an error names. If the rows come from two files, `MergedRows`
            tells which row comes from which file.
        write : bool, optional
            Whether the rows are written to the file.
        """
        # `enough=False` accepts few samples, because a study begins with none.
        data = checked_runs(self.study, rows, source, enough=False)
        numbered_rows = _fill_in_numbers(rows, data)
        # Write first: if writing fails, the attributes still agree with the file.
        if write and self.file is not None:
            self._write(self.file, numbered_rows, data, source)
        self._set_rows(numbered_rows, data)

    def _set_rows(self, rows: list[Row], data: pd.DataFrame) -> None:
        """Make rows the content of the record; `data` has them after the check."""
        self.data = data
        self._rows = rows
        # The turn (a proposal with its runs) depends on the rows, so find it again when
        # it is next needed.
        self._cached_turn = None

    def _write(
        self, file: Path, rows: Sequence[Row], data: pd.DataFrame, source: object
    ) -> None:
        """Write all rows to the file of the record.

        `write_table` refuses to overwrite a file that was copied or edited outside this
        program. Here that is safe, because all runs of the old file are among the rows.

        Parameters
        ----------
        file : Path
            The file of the record.
        rows : sequence of dict
            All rows as text.
        data : pandas.DataFrame
            The same rows after the check.
        source : object
            File of the rows, for an error.
        """
        table = pd.DataFrame(rows)
        parsed = self._require_readable(table, data, source)
        if self._is_record and file.exists():
            ledger.list_file(file)
        write_table(file, table)
        # The next `read` finds these bytes, which were read already.
        self._parsed = parsed

    def _require_readable(
        self, table: pd.DataFrame, data: pd.DataFrame, source: object
    ) -> _ParsedFile:
        """Write rows to CSV and read them again; raise an error if they change.

        Parameters
        ----------
        table : pandas.DataFrame
            All rows of the record as text.
        data : pandas.DataFrame
            The same rows after the check.
        source : object
            File of the rows, for an error.

        Returns
        -------
        _ParsedFile
            The content of the file, and what was read from it.

        Raises
        ------
        InputError
            If the written rows cannot be read, or if other runs are read from them.
        """
        with TemporaryDirectory() as folder:
            path = Path(folder) / "runs.csv"
            table.to_csv(path, index=False)
            content = path.read_bytes()
            try:
                rows = read_rows(path, self.study)
                data_of_file = checked_runs(self.study, rows, path, enough=False)
            except InputError as error:
                # Name the user's files instead of the temporary one.
                raise InputError(
                    source, error.key, error.value, error.allowed
                ) from None
        if not data_of_file.equals(data):
            raise InputError(
                source,
                key="runs that a file keeps",
                value=len(data_of_file),
                allowed=(
                    f"{len(data)}, and the same ones; a name or sample may begin with "
                    "#, or a column name may have many semicolons"
                ),
            )
        return _ParsedFile(content, _fill_in_numbers(rows, data_of_file), data_of_file)

    def _complete_requested_runs(self, table: pd.DataFrame) -> pd.DataFrame:
        """Add the missing columns to results of runs that the strategy asked for.

        Parameters
        ----------
        table : pandas.DataFrame
            The columns `sample` and all responses. The columns `run`, `status` and the
            parameters are optional.

        Returns
        -------
        pandas.DataFrame
            The same runs with all of these columns and the column `turn`, sorted by
            sample and run.

        Raises
        ------
        InputError
            If a run was not requested or is in the table twice, or if its parameters
            differ from the requested ones.
        """
        requested = self.requested_runs
        if "run" not in table:
            table = table.assign(run=_number_next_runs(requested, table))

        # Look up each row among the requested runs. A key is a pair of the sample and
        # the run number, which are compared as text.
        requested_keys = pd.MultiIndex.from_frame(
            requested[["sample", "run"]].astype(str)
        )
        keys = pd.MultiIndex.from_frame(table[["sample", "run"]].astype(str))
        unknown = sorted(set(keys) - set(requested_keys))
        repeated = sorted(keys[keys.duplicated()])
        invalid = [*unknown, *repeated]
        if invalid:
            raise InputError(
                source=TABLE_NAME,
                key="sample and run",
                value=list(invalid[0]),
                allowed=(
                    f"one of the {len(requested)} runs that `ask` gave, each once; "
                    "a failed run has NaN as responses; a table of other runs has no "
                    "columns sample and run"
                ),
            )
        rows = requested_keys.get_indexer(keys)
        runs = requested.iloc[rows].reset_index(drop=True)

        self._reject_other_parameters(table, runs)
        completed = self._add_responses(runs, table)
        return completed.sort_values(["sample", "run"], ignore_index=True)

    def _reject_other_parameters(self, table: pd.DataFrame, runs: pd.DataFrame) -> None:
        """Raise an error if parameters of a table differ from the requested ones.

        Differences that a spreadsheet may cause by rounding are accepted. A table need
        not have the columns of parameters.

        Parameters
        ----------
        table : pandas.DataFrame
            Results of the user. Columns of parameters may be missing.
        runs : pandas.DataFrame
            The requested runs, in the same order.

        Raises
        ------
        InputError
            If a parameter differs.
        """
        space = self.study.parameters
        for name in space.names:
            if name not in table:
                continue
            requested = runs[name].to_numpy(float)
            values = _read_numbers(table, name)
            sizes = _compute_reference_sizes(space, name, requested)
            faults = [
                CellFault(
                    row,
                    column=name,
                    value=value,
                    allowed=f"{requested_value}, as `ask` gave it, or a table without "
                    "this column",
                )
                for row, (value, requested_value, size) in enumerate(
                    zip(values.tolist(), requested.tolist(), sizes, strict=True)
                )
                if not _is_rounded(value, requested_value, size)
            ]
            # This raises an error if there are any faults.
            refuse(TABLE_NAME, faults)

    def _complete_earlier_runs(self, table: pd.DataFrame) -> pd.DataFrame:
        """Add the missing columns to earlier runs, which the strategy did not ask for.

        The table has no columns `sample` and `run` yet. Rows with the same parameters
        become runs of one sample.

        Parameters
        ----------
        table : pandas.DataFrame
            A column for each free parameter and each response. The column `status` and
            those of fixed parameters are optional.

        Returns
        -------
        pandas.DataFrame
            The runs with all parameters, the responses, and the columns `sample`, `run`
            and `turn`.

        Raises
        ------
        InputError
            If a column is missing.
        """
        space = self.study.parameters
        responses = list_needed_responses(self.study, table.get("status"))
        missing = [name for name in (*space.free, *responses) if name not in table]
        if missing:
            # The user may have forgotten the column `sample` of requested runs, or some
            # columns of earlier runs.
            raise InputError(
                source=TABLE_NAME,
                key="columns",
                value=list(table),
                allowed=(
                    "sample, for runs that `ask` gave; or for earlier runs also "
                    f"{', '.join(missing)}"
                ),
            )

        # A fixed parameter may be left out of the table.
        columns: dict[str, Any] = {}
        for name in space.names:
            if name in table:
                columns[name] = _read_numbers(table, name)
            else:
                columns[name] = space.fixed[name]
        parameter_sets = pd.DataFrame(columns)

        rows = self._add_responses(parameter_sets, table).to_dict("records")
        numbered = pd.DataFrame(self._assign_numbers(rows, parameter_sets))
        # All runs of this table belong to the present turn, even those that
        # `_assign_numbers` counts to the turn before.
        return numbered.assign(**{TURN_COLUMN: self._turn.number})

    def _add_responses(self, runs: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
        """Add the statuses and responses of a table, and the column `turn`, to runs.

        The turn is the number of the present proposal of the strategy.

        Parameters
        ----------
        runs : pandas.DataFrame
            Parameters and numbers of the runs. This table is not changed.
        table : pandas.DataFrame
            Results of the same runs, in the same order.

        Returns
        -------
        pandas.DataFrame
            The runs with the further columns. It also has those columns of the table
            that the study does not read, if their cells are single values.

        Raises
        ------
        InputError
            If a response is missing or is text.
        """
        cells = {str(name): column.tolist() for name, column in table.items()}
        needed_responses = list_needed_responses(self.study, cells.get("status"))
        require_columns(TABLE_NAME, cells, needed_responses)
        # Decide which runs failed, and raise an error if a cell is invalid.
        outcomes = judge_runs(cells, self.study.targets.names)
        refuse(TABLE_NAME, outcomes.faults)

        # In `outcomes`, the responses of a failed run are NaN, because the calibration
        # must not use them. The record still keeps the numbers that the table has.
        empty_column = [None] * len(table)
        responses = {}
        for name, values in outcomes.values.items():
            table_cells = cells.get(name, empty_column)
            responses[name] = [
                value if status == OK else _keep_number(cell)
                for status, value, cell in zip(
                    outcomes.statuses, values, table_cells, strict=True
                )
            ]
        # A file cannot store lists and the like, so leave out columns that have them.
        known_names = list_columns(self.study)
        unread = {
            name: column
            for name, column in cells.items()
            if name not in known_names and all(map(pd.api.types.is_scalar, column))
        }
        # The columns of the runs come first. `unread` has none of the other names.
        completed = {
            **runs,
            "status": outcomes.statuses,
            **responses,
            **unread,
            TURN_COLUMN: self._turn.number,
        }
        return pd.DataFrame(completed)


def _read_content(file: Path) -> bytes | None:
    """Read the bytes of a file; None if it cannot be read, as `read_rows` then says."""
    try:
        return file.read_bytes()
    except OSError:
        return None


def _fill_in_numbers(
    rows: Sequence[Mapping[str, Any]], data: pd.DataFrame
) -> list[Row]:
    """Fill in `sample` and `run` of the rows that lack them.

    Parameters
    ----------
    rows : sequence of mapping
        All runs of the study, as text.
    data : pandas.DataFrame
        The same rows after the check, each with its sample. The runs of a sample are
        numbered from 1.
    """
    runs = data.groupby("sample").cumcount() + 1
    numbers = data[["sample"]].assign(run=runs).astype(str).to_dict("records")
    return [number | dict(row) for number, row in zip(numbers, rows, strict=True)]


def _list_points(table: pd.DataFrame, names: Sequence[str]) -> list[Point]:
    """Return the parameter sets of a table."""
    if table.empty:
        return []
    return list(table[list(names)].itertuples(index=False, name=None))


def _find_match(
    requested: pd.DataFrame, row: Mapping[str, Any], point: Point, names: Sequence[str]
) -> Any:
    """Find the index of the first requested run that matches a row; None if none does.

    A match has the parameters `point` of the row. It also has the sample and the run of
    the row, if the row names them.
    """
    is_same = np.isclose(
        requested[list(names)], point, rtol=SAME_TOLERANCE, atol=0
    ).all(axis=1)
    for key in ("sample", "run"):
        if key in row:
            is_same &= (requested[key].astype(str) == str(row[key]).strip()).to_numpy()
    same = requested[is_same]
    return same.index[0] if len(same) else None


def _is_rounded(value: float, requested: float, size: float) -> bool:
    """Return whether `value` is the number `requested`, or a rounding of it.

    The difference may be half a unit of the last digit of `value`, but at most
    `MAX_ROUNDING_FRACTION` of `size`.
    """
    if math.isclose(value, requested, rel_tol=SAME_TOLERANCE):
        return True
    last_digit = 10.0 ** int(
        Decimal(repr(float(value))).normalize().as_tuple().exponent
    )
    return abs(value - requested) <= min(
        ROUNDING_DIGITS * last_digit, MAX_ROUNDING_FRACTION * size
    )


def _compute_reference_sizes(
    space: ParameterSpace, name: str, values: np.ndarray
) -> np.ndarray:
    """Compute the size that limits the accepted rounding error of each value.

    `_is_rounded` accepts an error up to a small fraction of this size. The size is the
    width of the range of a free parameter, or the value itself of a fixed one. On a
    logarithmic scale, a small step of the logarithm changes the value by step * value.
    So the size is then the width of the range of the logarithm, times the value.

    Parameters
    ----------
    space : ParameterSpace
    name : str
        Name of the parameter.
    values : numpy.ndarray, (n,)
        Values of the parameter.

    Returns
    -------
    numpy.ndarray, (n,)
    """
    if name in space.fixed:
        return np.full(len(values), abs(space.fixed[name]))
    k = space.free.index(name)
    low, high = space.coordinate_bounds
    width = high[k] - low[k]
    if space.scale.get(name) == LOG:
        return width * values
    return np.full(len(values), width)


def _find_free_run(sample: str, used_numbers: set[tuple[str, str]]) -> str:
    """Return the lowest run number that is still free in a sample."""
    for number in itertools.count(1):
        if (sample, str(number)) not in used_numbers:
            return str(number)
    raise AssertionError("the numbers do not end")


def _number_next_runs(requested: pd.DataFrame, table: pd.DataFrame) -> pd.Series:
    """Return a run number for each row of a table without run numbers.

    The numbers of a sample are consecutive, beginning with its first requested run.
    They begin with 1 for a sample that was not requested.
    """
    first = requested.astype({"sample": str}).groupby("sample")["run"].min()
    before = table.groupby("sample").cumcount()
    return before + table["sample"].map(first).fillna(1).astype(int)


def _reject_repeated_runs(
    new: pd.DataFrame, data: pd.DataFrame, source: object
) -> None:
    """Raise an error if a new run equals a run of the record in all values.

    The new runs have no run numbers. So a row with equal values is taken for the same
    run, which was added before.
    """
    names = [name for name in data if name != "sample"]
    known = set(_list_points(data, names))
    for k, run in enumerate(_list_points(new, names), start=1):
        # A failed run never matches, because its responses are NaN.
        if run in known:
            raise InputError(
                source=f"{source}, row {k}",
                key="row",
                value="repeated",
                allowed="a new run: the record has all numbers of this row",
            )


def _check_table(table: Any, names: Sequence[str]) -> pd.DataFrame:
    """Check the form of a table of runs, and bring it into a standard form.

    Parameters
    ----------
    table : object
        The argument of `Study.tell`, which must be a pandas.DataFrame.
    names : sequence of str
        Column names of the study. Columns with a slightly different spelling are
        renamed to these.

    Returns
    -------
    pandas.DataFrame
        A copy with the column names of the study, whose rows are numbered from 0. The
        numbers of its samples and runs are written as whole numbers, such as 3 instead
        of 3.0.

    Raises
    ------
    InputError
        If the argument is not a table of runs.
    """
    if not isinstance(table, pd.DataFrame):
        raise InputError(
            source=TABLE_NAME,
            key="type",
            value=type(table).__name__,
            allowed="a pandas.DataFrame",
        )
    _require_different_columns(table, allowed="each column once")
    if table.empty:
        raise InputError(
            source=TABLE_NAME, key="rows", value=0, allowed="a row for each run"
        )

    # Rename the columns that the study reads, and clean the names of the others. Two
    # names may then be the same.
    renamed = table.rename(columns=match_column_names(table, names))
    checked = renamed.rename(
        columns=lambda name: name if name in names else _clean_text(name)
    )
    _require_different_columns(
        checked,
        allowed=(
            "each column once; names that differ only in blanks and control characters "
            "count as the same"
        ),
    )
    for key in NUMBER_COLUMNS:
        if key not in checked:
            continue
        if checked[key].isna().any():
            raise InputError(
                source=TABLE_NAME,
                key=key,
                value="missing",
                allowed="a number in each row, as `ask` gave it",
            )
        # Numbers are compared as text, so write 3.0 as 3.
        checked = checked.assign(**{key: strip_decimal_points(checked[key])})
    return checked.reset_index(drop=True)


def _require_different_columns(table: pd.DataFrame, allowed: str) -> None:
    """Raise an error with the text `allowed` if two columns have the same name."""
    repeated_columns = list(map(str, table.columns[table.columns.duplicated()]))
    if repeated_columns:
        raise InputError(
            source=TABLE_NAME,
            key="column",
            value=repeated_columns[0],
            allowed=allowed,
        )


def _read_numbers(table: pd.DataFrame, name: str) -> np.ndarray:
    """Return a column of numbers (n,)."""
    values, faults = convert_columns({name: table[name].tolist()}, [Column(name)])
    refuse(TABLE_NAME, faults)
    return np.array(values[name])


def _keep_number(cell: Any) -> float:
    """Return a cell as a number; NaN if it is none."""
    try:
        return parse_number(cell)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _format_rows(runs: pd.DataFrame) -> list[Row]:
    """Convert runs to rows of text, because a file contains only text."""
    return [
        {key: _format_cell(value) for key, value in row.items()}
        for row in runs.to_dict("records")
    ]


def _format_cell(value: Any) -> str:
    """Format a cell for the file, with all its digits; NaN becomes an empty text."""
    is_real = isinstance(value, float | np.floating)
    text = repr(float(value)) if is_real else _clean_text(value)
    return "" if text == "nan" else text


def _clean_text(value: object) -> str:
    """Convert a value to a text in one line, as a file can keep it.

    Line breaks, control characters and characters without a code in UTF-8 become
    blanks.
    """
    characters = [
        character if character.isprintable() else " " for character in str(value)
    ]
    return " ".join("".join(characters).split())
