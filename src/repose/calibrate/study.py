"""Calibrate any simulator: a study asks for runs, takes their results, and answers."""

import json
import threading
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.settings import CalibrationSettings
from repose.calibrate.strategies.base import Answer, Batch
from repose.calibrate.targets import Targets
from repose.common.errors import InputError, shown
from repose.common.files import StrPath, convert_to_path, format_json, write_json

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.calibration import Calibration
    from repose.calibrate.record import Record

Simulate = Callable[[dict[str, Any]], Mapping[str, Any] | None]
Run = dict[str, Any]
# Held while a study creates its record, so that all threads get the same record.
_RECORD_LOCK = threading.Lock()


class Study:
    """A calibration with your own simulator, as a loop of `ask` and `tell`.

    `ask` returns the runs to make next, and `tell` adds their results, until the study
    is `done`. The settings of a study never change. Only its runs grow.

    Parameters
    ----------
    parameters : mapping
        A range ``(low, high)``, ``{"range": (low, high), "scale": "log"}``,
        ``{"fixed": value}`` or ``{"prior": {"mean": m, "sd": s}}`` for each parameter.
    targets : mapping
        ``(value, sd)`` or ``(value, sd, repetitions)`` for each response that was
        measured, with 1 repetition by default; or the keys of
        `repose docs own_simulator`, by which a file of heights is a target, too.
    strategy : str
        One of `repose.calibrate.strategies.names()`.
    seed : int
        The same seed asks for the same samples.
    file : path, optional
        CSV file of the runs. If it exists, the study goes on from it. The settings lie
        beside it, with the ending .json.
    simulator, label : str
        Names of your simulator and of your material.
    **sections
        Further keys of `repose docs own_simulator`, such as
        ``sequential={"batch": 4}`` or ``constraints=["mur <= 0.5 * mus"]``.

    Attributes
    ----------
    config : dict
        The complete configuration as plain values.
    settings : CalibrationSettings
        The same as typed sections, such as ``study.settings.sequential.batch``.
    parameters : ParameterSpace
        Ranges of the free parameters, fixed values and priors.
    targets : Targets
        The measured responses.

    Raises
    ------
    InputError
        If settings are invalid, or differ from those that are stored next to `file`.

    Warns
    -----
    UserWarning
        For each range that spans more than two decades without a scale.
    """

    config: dict[str, Any]
    settings: CalibrationSettings
    parameters: ParameterSpace
    targets: Targets
    file: Path | None

    def __init__(
        self,
        parameters: Mapping[str, Any],
        targets: Mapping[str, Any],
        strategy: str = "sequential",
        seed: int = 0,
        file: StrPath | None = None,
        simulator: str = "own simulator",
        label: str = "study",
        **sections: Any,
    ) -> None:
        """Check the settings, add the defaults, and save the settings if there is a file.

        The docstring of the class describes the parameters, errors and warnings.
        """
        from repose.calibrate.parameter_types import describe_wide_ranges
        from repose.calibrate.study_file import complete_configuration

        _require_names("parameters", parameters)
        _require_names("targets", targets)
        # Arrange the arguments like the keys of a configuration file.
        user_config: dict[str, Any] = _convert_to_plain(
            {
                "simulator": simulator,
                "label": label,
                "seed": seed,
                "strategy": strategy,
                "parameters": parameters,
                **sections,
                "targets": targets,
            }
        )
        user_config["targets"] = _complete_targets(user_config["targets"])
        config = complete_configuration(user_config)

        # `complete_configuration` raises an error for invalid settings, so they are
        # never saved. Save only the keys of the user, without the defaults.
        if file is not None:
            _save_settings(user_config, runs_csv=file)
        self._set_up(config, file)
        for sentence in describe_wide_ranges(config["parameters"]):
            # With stacklevel=2, the warning names the user's line that calls `Study`.
            warnings.warn(sentence, stacklevel=2)

    def _set_up(self, config: dict[str, Any], file: StrPath | None) -> None:
        """Set all attributes of a new study; `of` sets them from checked objects.

        Parameters
        ----------
        config : dict
            Result of `complete_configuration`.
        file : path or None
            CSV file of the runs.
        """
        from repose.calibrate.study_file import make_settings, make_targets

        self.config = config
        self.settings = make_settings(config)
        self.parameters = ParameterSpace.of(
            config["parameters"], constraints=config.get("constraints")
        )
        self.targets = make_targets(config["targets"])
        self.file = _make_absolute(file)

    @classmethod
    def resume(cls, file: StrPath) -> Self:
        """Resume the study that keeps its runs in a file.

        Parameters
        ----------
        file : path
            As in `Study(..., file=...)`.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            If the settings beside the file are missing, or file or settings are
            damaged.
        """
        settings = _find_settings_file(file)
        if not settings.is_file():
            raise InputError(
                source=file,
                key="settings",
                value="missing",
                allowed=(
                    "a record of a Study, with its settings beside it in "
                    f"{settings.name}"
                ),
            )
        return cls.own(settings, file)

    @classmethod
    def own(
        cls, content: StrPath | Mapping[str, Any], file: StrPath | None = None
    ) -> Self:
        """Make a study from a configuration for the user's own simulator.

        Parameters
        ----------
        content : path or mapping
            The configuration that docs/own_simulator.md describes: the path of a YAML
            or JSON file, or a mapping with the same keys and values.
        file : path, optional
            CSV file of the runs. Unlike `Study(..., file=...)`, this method does not
            save the settings beside it.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            If the configuration is invalid.
        """
        from repose.calibrate.study_file import complete_configuration
        from repose.common.reading import read_yaml

        if isinstance(content, Mapping):
            config = complete_configuration(content)
        else:
            # This raises an error that names the argument if it is no path.
            convert_to_path("content", content)
            config = complete_configuration(read_yaml(content), content)
        # `__init__` cannot be used, because it takes separate arguments instead of a
        # complete configuration. `_set_up` sets all attributes in its place.
        study = cls.__new__(cls)
        study._set_up(config, file)
        return study

    @classmethod
    def of(
        cls,
        parameters: ParameterSpace,
        targets: Targets,
        settings: CalibrationSettings,
        config: dict[str, Any],
        file: StrPath | None = None,
    ) -> Self:
        """Make a study from parameters, targets and settings that are already checked.

        Parameters
        ----------
        parameters, targets, settings
            The attributes of the study with these names.
        config : dict
            The configuration from which they come.
        file : path, optional
            CSV file of the runs. Unlike `Study(..., file=...)`, this method does not
            save the settings beside it.

        Returns
        -------
        Study
        """
        # `__init__` and `_set_up` would make the parameters, targets and settings from
        # a configuration. So set every attribute that `_set_up` sets here as well.
        study = cls.__new__(cls)
        study.config = config
        study.settings = settings
        study.parameters = parameters
        study.targets = targets
        study.file = _make_absolute(file)
        return study

    def __repr__(self) -> str:
        free = ", ".join(self.parameters.free)
        targets = ", ".join(self.targets.names)
        settings = self.settings
        return (
            f"<Study {settings.label}: {free} by {targets}, "
            f"strategy {settings.strategy}>"
        )

    @cached_property
    def _created_record(self) -> "Record":
        """The record of the runs, which is created at the first access."""
        from repose.calibrate.record import Record

        return Record(self, self.file)

    @property
    def _record(self) -> "Record":
        """The record, which all threads share; use it within `Record.locked`."""
        with _RECORD_LOCK:
            return self._created_record

    @property
    def runs(self) -> "pd.DataFrame":
        """A copy of all runs so far: `sample`, `status`, parameters and responses.

        The responses of a run that failed are NaN.
        """
        with self._record.locked() as record:
            # The user may edit this table, so return a copy.
            return record.data.copy()

    @property
    def proposal(self) -> Batch | Answer:
        """The strategy's proposal after these runs: the next samples, or the answer."""
        with self._record.locked() as record, _limit_threads():
            return record.proposal

    @property
    def done(self) -> bool:
        """Whether the strategy needs no more runs."""
        return isinstance(self.proposal, Answer)

    def ask(self) -> "pd.DataFrame":
        """Return the runs to make next.

        Once the study is `done`, these are the runs of the answer, to simulate it
        again. The same runs are returned until `tell` adds them.

        Returns
        -------
        pandas.DataFrame
            A row for each run: `sample`, `run`, and the parameters. The runs of a
            sample differ only in the random numbers of the simulator.

        Raises
        ------
        InputError
            If the runs so far do not determine the model of the strategy.
        """
        with self._record.locked() as record, _limit_threads():
            return record.requested_runs

    def tell(self, runs: "pd.DataFrame") -> None:
        """Add results of runs.

        Several threads may tell one study. With a file the runs are on the disk
        afterwards, and several processes may add to it.

        Parameters
        ----------
        runs : pandas.DataFrame
            `sample` and a column for each response, for any of the runs that `ask`
            gave, in any order. A run failed if a response is missing, NaN, None or
            infinite, or if a column `status` says anything but ok. With a column `run`,
            the number of the run. Other columns are kept, with their texts in one line,
            and not read. But columns of parameters must equal those of `ask`. Without
            `sample`, these are runs made before, which also need a column for each
            parameter.

        Raises
        ------
        InputError
            If these are not runs that `ask` gave, or a response is a text. Nothing is
            added then.

        Warns
        -----
        UserWarning
            For each column that is not read, as soon as its values vary. Also for a
            response that is probably in another unit than its target.
        """
        for sentence in self._record.add(runs):
            warnings.warn(sentence, stacklevel=2)

    def calibrate(
        self, simulate: Simulate, workers: int | Executor = 1
    ) -> "Calibration":
        """Simulate all runs that the strategy asks for, and return the answer.

        If the study has a file, each run is saved as soon as it is finished. The runs
        of a batch are independent, so they can be simulated in parallel without
        changing the answer.

        Parameters
        ----------
        simulate : function
            It takes a row of `ask` as a mapping, and returns the responses by name. It
            reports a failed run by None, by a response that is NaN, None or infinite,
            or by a `status` other than ok. Parameters that it returns must be those of
            the row.
        workers : int or concurrent.futures.Executor
            Number of runs at a time, in threads of this process. Threads are enough for
            a function that starts a program and waits for it. An executor can use other
            means, such as processes.

        Returns
        -------
        Calibration

        Raises
        ------
        InputError
            If `simulate` returns neither a mapping nor None, or returns parameters that
            differ from those of the run. As long as no run was good, also in these
            cases: a response is missing or is not a number, a status is a number, or
            all runs of a batch have all responses but a status that means failure.
        Exception
            Any exception of `simulate`, once the runs that had started are recorded.

        Warns
        -----
        UserWarning
            If a run has all responses, but a status that means failure. Once a run was
            good, also if a response is missing or is not a number, or if a status is a
            number.
        """
        if not callable(simulate):
            raise InputError(
                source="study",
                key="simulate",
                value=simulate,
                allowed="a function of a row of `ask`",
            )
        with _choose_executor(workers) as executor:
            while not self.done:
                requested_runs = self.ask().to_dict("records")
                # `_record_result` appends the unknown status of each run of this batch.
                statuses: list[str] = []
                record = partial(self._record_result, unknown_statuses=statuses)
                _simulate_runs(simulate, requested_runs, executor, record)
                self._reject_unknown_statuses(statuses)
        return self.answer()

    def _record_result(
        self, run: Run, result: object, unknown_statuses: list[str]
    ) -> None:
        """Add the result of a run to the record, and warn of an unknown status.

        Parameters
        ----------
        run : dict
            A row of the table that `ask` returned.
        result : object
            The value that the user's function returned for it.
        unknown_statuses : list of str
            The result of `find_unknown_status` is appended to this list: the unknown
            status of the run, or an empty text if it has none.

        Raises
        ------
        InputError
            If the result is invalid. Then the run is not added.
        """
        # This module loads pandas, so import it only when it is needed.
        from repose.calibrate.strategies.runs import find_unknown_status

        cells = self._read_result(result)
        self.tell(self._make_table(run, cells))
        status = find_unknown_status(cells, self.targets.names)
        if status:
            # The stack is: this method, `_simulate_runs`, `calibrate`, the user's code.
            warnings.warn(
                f"a run with the status {status!r} counts as failed, although it has "
                "all responses; a good run has the status ok",
                stacklevel=4,
            )
        unknown_statuses.append(status)

    def _reject_unknown_statuses(self, statuses: Sequence[str]) -> None:
        """Raise an error if all runs of a batch failed only because of their statuses.

        The user's function then probably uses a word for a good run that is not among
        the known ones. If any run was good, the function uses a known word.

        Parameters
        ----------
        statuses : sequence of str
            Result of `find_unknown_status` for each run of the batch.

        Raises
        ------
        InputError
            If all runs have such a status, and no earlier run was good.
        """
        if not all(statuses) or self._has_good_run:
            return
        where = "" if self.file is None else f"; they are in {self.file}"
        raise InputError(
            source="study",
            key="status",
            value=statuses[0],
            allowed=(
                f"ok for a good run; all {len(statuses)} runs of this batch count as "
                f"failed, although they have all responses{where}"
            ),
        )

    @property
    def _has_good_run(self) -> bool:
        """Whether the record has a run that did not fail."""
        from repose.calibrate.strategies.runs import OK

        runs = self.runs
        return not runs.empty and bool((runs["status"] == OK).any())

    def _read_result(self, result: object) -> dict[str, Any]:
        """Read what the user's function returned for a run.

        Parameters
        ----------
        result : object
            A mapping, or None for a failed run.

        Returns
        -------
        dict
            The cells by column, as `make_cells` returns them.

        Raises
        ------
        InputError
            If the result is neither a mapping nor None. Also if it has a mistake, such
            as text in place of a response, and no run was good so far.

        Warns
        -----
        UserWarning
            If the result has a mistake, after good runs. The run then counts as failed.
        """
        # This module loads pandas, so import it only when it is needed.
        from repose.calibrate.strategies.runs import list_columns, make_cells

        responses = self.targets.names
        try:
            returned = {} if result is None else dict(result)  # type: ignore[call-overload]
        except (TypeError, ValueError):
            raise InputError(
                source="study",
                key="simulate",
                value=[result],
                allowed=f"a function that returns a mapping with {', '.join(responses)}",
            ) from None
        # `missing` is a phrase such as "a number for angle_deg", or empty.
        cells, missing = make_cells(returned, responses, names=list_columns(self))
        if not missing:
            return cells
        # A long calibration has to continue after a mistake in one result. But if no
        # result was good so far, the function itself has the mistake.
        if not self._has_good_run:
            raise InputError(
                source="study",
                key="simulate",
                value=[result],
                allowed=(
                    f"a function that returns {missing}, or None for a failed run"
                ),
            )
        # The stack is: this method, `_record_result`, `_simulate_runs`, `calibrate`,
        # the user's code.
        warnings.warn(
            f"a run without {missing} failed; simulate gave {shown(returned)}",
            stacklevel=5,
        )
        return cells

    def _make_table(
        self, run: Mapping[str, Any], cells: Mapping[str, Any]
    ) -> "pd.DataFrame":
        """Combine a run with its result in the table that `tell` expects.

        Parameters
        ----------
        run : mapping
            A row of the table that `ask` returned.
        cells : mapping
            Result of `_read_result`. `tell` compares its parameters, if there are any,
            with those of the run.

        Returns
        -------
        pandas.DataFrame
            A single row.
        """
        import pandas as pd

        from repose.common.tables import is_missing

        kept = {
            name: cell
            for name, cell in cells.items()
            if name not in run or not is_missing(cell)
        }
        numbers = {key: run[key] for key in ("sample", "run")}
        return pd.DataFrame([{**run, **kept, **numbers}])

    def answer(self) -> "Calibration":
        """Return the parameters that meet the targets, with their certainty.

        Before the study is `done`, these are the best that the runs so far give. If
        `tell` has added runs with the parameters of the answer, they check this answer,
        and the parameters stay the same.

        Returns
        -------
        Calibration
            `parameters`, `prediction`, `probability`, `posterior`, and why the runs
            ended; a notebook shows it.

        Raises
        ------
        InputError
            If the runs do not determine an answer.
        """
        from repose.calibrate.calibration import calibrate
        from repose.calibrate.strategies.runs import name_file_of_runs

        if self.runs.empty:
            raise InputError(
                source="study",
                key="runs",
                value=0,
                allowed="results of the runs that `ask` gave: `tell` adds them",
            )
        with (
            self._record.locked() as record,
            _limit_threads(),
            name_file_of_runs(self.file),
        ):
            checked = record.find_checked_answer()
            if checked is not None:
                return calibrate(self, checked.runs, checked.answer, checked.check)
            return calibrate(self, record.sorted_data, record.proposal)


def _choose_executor(
    workers: int | Executor,
) -> AbstractContextManager[Executor | None]:
    """Choose the executor that simulates runs in parallel.

    Parameters
    ----------
    workers : int or Executor
        Number of threads to start, or the executor of the user.

    Returns
    -------
    context manager
        It yields the executor, or None to simulate one run after another. On exit it
        shuts down threads that were started here, but not the executor of the user.

    Raises
    ------
    InputError
        If `workers` is neither a positive integer nor an executor.
    """
    if isinstance(workers, Executor):
        return nullcontext(workers)
    # In Python, True and False are integers.
    is_integer = isinstance(workers, int) and not isinstance(workers, bool)
    if not is_integer or workers < 1:
        raise InputError(
            source="study",
            key="workers",
            value=workers,
            allowed="an integer from 1, or an Executor of concurrent.futures",
        )
    if workers == 1:
        return nullcontext()
    return ThreadPoolExecutor(workers)


def _simulate_runs(
    simulate: Simulate,
    runs: Sequence[Run],
    executor: Executor | None,
    record: Callable[[Run, Any], None],
) -> None:
    """Simulate runs, and record the result of each as soon as it is finished.

    Parameters
    ----------
    simulate : function
        It maps a run to its result.
    runs : sequence of dict
        The runs to simulate, each a row of `ask`.
    executor : Executor or None
        It simulates several runs at a time. Without it, the runs are simulated one
        after another.
    record : function
        It takes a run and the value that `simulate` returned for it.

    Raises
    ------
    BaseException
        The first exception of `simulate` or `record`, raised after the results of the
        runs that had already started are recorded.
    """
    if executor is None:
        for run in runs:
            # Simulate a copy, because the user's function may change its argument.
            record(run, simulate(dict(run)))
    else:
        _simulate_in_parallel(simulate, runs, executor, record)


def _simulate_in_parallel(
    simulate: Simulate,
    runs: Sequence[Run],
    executor: Executor,
    record: Callable[[Run, Any], None],
) -> None:
    """Simulate runs with an executor; see `_simulate_runs`.

    All runs are submitted at once, and recorded in the order in which they end. After
    an error no further run starts, but the runs that have already started are still
    recorded.
    """
    # Each call gets a copy of its run, because the user's function may change it.
    run_of_future = {executor.submit(simulate, dict(run)): run for run in runs}
    first_error: BaseException | None = None
    try:
        # This loop also waits for the runs that had started when an error occurred.
        for future in as_completed(run_of_future):
            if future.cancelled():
                continue
            error = future.exception()
            if error is None:
                try:
                    record(run_of_future[future], future.result())
                except Exception as record_error:
                    error = record_error
            if error is not None and first_error is None:
                first_error = error
                _cancel_waiting_runs(run_of_future)
    finally:
        # If the user interrupts the loop, cancel the waiting runs as well.
        _cancel_waiting_runs(run_of_future)
    if first_error is not None:
        raise first_error


def _cancel_waiting_runs(futures: Iterable[Future[Any]]) -> None:
    """Cancel the runs that have not started; `Future.cancel` ignores the others."""
    for future in futures:
        future.cancel()


def _limit_threads() -> AbstractContextManager[Any]:
    """Limit matrix operations to one thread while the context is open.

    Operations on small matrices are slower on several threads. Their last bits would
    also differ from those of the command line.
    """
    # Only a loaded library is limited, so load scipy's own matrix library first.
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_limits

    return threadpool_limits(limits=1, user_api="blas")


def _require_names(key: str, entries: object) -> None:
    """Raise an error if parameters or targets are no mapping from their names."""
    if not isinstance(entries, Mapping):
        raise InputError(
            source="study",
            key=key,
            value=entries,
            allowed=f"a mapping from the names of {key}",
        )


def _convert_target_list(entry: Any) -> Any:
    """Convert a target [value, sd] or [value, sd, repetitions] to a mapping.

    Any other entry is returned unchanged.
    """
    if not isinstance(entry, list) or len(entry) not in (2, 3):
        return entry
    value, sd, *repetitions = entry
    return {
        "value": value,
        "sd": sd,
        "repetitions": repetitions[0] if repetitions else 1,
    }


def _complete_targets(targets: Mapping[str, Any]) -> dict[str, Any]:
    """Convert targets to the form that they have in a configuration file.

    Parameters
    ----------
    targets : mapping
        The targets of the user by name, as `_convert_to_plain` returns them.

    Returns
    -------
    dict
        Each list of two or three numbers becomes a mapping. A profile, which is a
        measured outline, becomes a target for each of the scores that describe it.

    Raises
    ------
    InputError
        If a target has another form, or a profile is invalid.
    """
    from repose.calibrate.profile_targets import expand_own_profiles

    entries = {name: _convert_target_list(entry) for name, entry in targets.items()}
    for name, entry in entries.items():
        # `_convert_target_list` has not changed an entry with a wrong form.
        if not isinstance(entry, dict):
            raise InputError(
                source="study",
                key=f"targets.{name}",
                value=entry,
                allowed="(mean, standard deviation, number of repetitions) as numbers, "
                "or a mapping with value, sd and repetitions",
            )
    completed: dict[str, Any] = expand_own_profiles(entries, "study")
    return completed


def _make_absolute(file: StrPath | None) -> Path | None:
    """Make the path of a file absolute; None stays None.

    The user's function may change the working directory, and a relative path would then
    lead to another file.
    """
    return None if file is None else Path(file).absolute()


def _find_settings_file(runs_csv: StrPath) -> Path:
    """Return the path of the settings, which lie beside the file of the runs.

    It has the same name with the ending .json. An InputError is raised if `runs_csv` is
    in a folder that does not exist, or has another ending than .csv.
    """
    path = convert_to_path("file", runs_csv)
    if not path.parent.is_dir():
        raise InputError(
            source="study",
            key="file",
            value=str(runs_csv),
            allowed="a path in a folder that is there",
        )
    if path.suffix != ".csv":
        raise InputError(
            source="study",
            key="file",
            value=str(runs_csv),
            allowed="a path that ends in .csv",
        )
    return path.with_suffix(".json")


def _save_settings(user_config: Mapping[str, Any], runs_csv: StrPath) -> None:
    """Save the settings beside the file of the runs, if none are saved there yet.

    Settings that are already saved there are not changed. They must be the same.

    Parameters
    ----------
    user_config : mapping
        The settings of the user, without defaults.
    runs_csv : path
        The file of the runs.

    Raises
    ------
    InputError
        If the saved settings differ, because runs of two studies would be mixed.
    """
    from repose.common.reading import read_yaml

    path = _find_settings_file(runs_csv)
    if not path.exists():
        write_json(path, user_config)
        return
    saved_settings = read_yaml(path)
    # Write the settings as JSON and read them again, because this may change values.
    # Otherwise a value could differ from the saved one only in its form.
    settings = json.loads(format_json(user_config))
    for key in sorted({*saved_settings, *settings}):
        if saved_settings.get(key) != settings.get(key):
            raise InputError(
                source=path,
                key=key,
                value=saved_settings.get(key),
                allowed=(
                    f"{settings.get(key)}, the value of this study; or another file "
                    "for the runs"
                ),
            )


def _convert_to_plain(value: Any) -> Any:
    """Convert tuples and NumPy values to the types that JSON and YAML know.

    Mappings and lists are converted with all that they contain.
    """
    # Arrays and numbers of NumPy have this method, as have columns of pandas.
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _convert_to_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_convert_to_plain(item) for item in value]
    return value
