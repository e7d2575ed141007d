"""The study: one object that is made once from its files, checked, with every number in place."""

import json
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from repose.calibrate.responses import Definitions
from repose.common import provenance
from repose.common.errors import InputError, require
from repose.common.files import Path_, json_text, path_of, read_json, write_json
from repose.config import loader
from repose.stages.published import beside

if TYPE_CHECKING:
    import pandas as pd

    from repose.bench import Scene
    from repose.calibrate.calibration import Calibration
    from repose.calibrate.parameter_space import ParameterSpace
    from repose.calibrate.strategies.base import Answer, Batch
    from repose.calibrate.targets import Targets
    from repose.config.making import Making
    from repose.config.models import StudySettings
    from repose.config.record import Record
    from repose.grain.particle import Particle


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Study:
    """A study: its settings, what follows from them, and the runs so far.

    Its settings do not change. The runs are the one thing that grows: `ask` says which to make next, `tell` adds them,
    until `done`. `Study(...)` is a study with a simulator of your own; one with the simulator of this package is made
    by `Study.load`, by `Study.of` from Python, or by `Study.of_results` in a job.

    Parameters
    ----------
    parameters : mapping
        A range ``(low, high)``, ``{"fixed": value}`` or ``{"prior": {"mean": m, "sd": s}}`` for each parameter.
    targets : mapping
        ``(value, sd)`` or ``(value, sd, repetitions)`` for each response that was measured, 1 repetition if it is not
        said, or the keys of `repose docs own_simulator`, by which a file of heights is a target, too.
    strategy : str
        One of `repose.calibrate.strategies.names()`.
    seed : int
        The same seed asks for the same samples.
    file : path, optional
        CSV file of the runs. If it is there, the study goes on from it. Its settings lie beside it, as .json.
    simulator, label : str
        Names of your simulator and of your material.
    **sections
        Further keys of `repose docs own_simulator`, such as ``sequential={"batch": 4}``.

    Attributes
    ----------
    config : dict
        The resolved configuration as plain values; `RESULTS/config.json` holds the same for our simulator.

    Raises
    ------
    InputError
        For settings that are not allowed, or others than those beside `file`.
    """

    config: dict[str, Any]
    _source: (
        Any  # names the file of a key in messages; None: a simulator of the user's own
    )
    _file: Path | None

    def __init__(
        self,
        parameters: Mapping[str, Any],
        targets: Mapping[str, Any],
        strategy: str = "sequential",
        seed: int = 0,
        file: Path_ | None = None,
        simulator: str = "own simulator",
        label: str = "study",
        **sections: Any,
    ) -> None:
        from repose.config.own import completed
        from repose.config.profiles import expanded_own

        for name, given in (("parameters", parameters), ("targets", targets)):
            require(
                isinstance(given, Mapping),
                "study",
                name,
                given,
                f"a mapping from the names of {name}",
            )
        given = {
            "simulator": simulator,
            "label": label,
            "seed": seed,
            "strategy": strategy,
            "parameters": parameters,
            **sections,
        }
        given = _plain(given)
        given["targets"] = expanded_own(
            {name: _target(one) for name, one in _plain(targets).items()}, "study"
        )
        config = completed(given)
        if file is not None:
            _keep_settings(given, file)
        vars(self).update(config=config, _source=None, _file=file)

    def __repr__(self) -> str:
        free, targets = (
            ", ".join(names) for names in (self.parameters.free, self.targets.names)
        )
        return f"<Study {self.settings.label}: {free} by {targets}, strategy {self.settings.strategy}>"

    @classmethod
    def _of(
        cls, config: dict[str, Any], source: Any, file: Path_ | None = None
    ) -> Self:
        """Make a study without the arguments of `Study(...)`."""
        study = cls.__new__(cls)
        vars(study).update(config=config, _source=source, _file=file)
        return study

    @classmethod
    def resume(cls, file: Path_) -> "Study":
        """Resume the study with a simulator of your own that keeps its runs in a file.

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
            If the settings beside the file are missing, or file or settings are damaged.
        """
        return cls.own(_settings_of(file), file)

    @classmethod
    def own(
        cls, content: Path_ | Mapping[str, Any], file: Path_ | None = None
    ) -> "Study":
        """Make the study of a configuration with the key `simulator` (docs/own_simulator.md).

        Parameters
        ----------
        content : path or mapping
            YAML or JSON file, or its keys.
        file : path, optional
            As in `Study(..., file=...)`; nothing is written beside it.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            As `Study(...)`.
        """
        from repose.config.own import completed
        from repose.config.reading import read

        if isinstance(content, Mapping):
            return cls._of(completed(content), None, file)
        path_of("content", content)
        return cls._of(completed(read(content), content), None, file)

    @classmethod
    def load(
        cls,
        *files: Path_,
        overrides: Mapping[str, Any] | None = None,
        inputs: bool = False,
    ) -> "Study":
        """Load and check the study of configuration files, with each `auto` computed.

        Parameters
        ----------
        *files : path
            YAML or JSON files. Each may hold only the keys that differ; it overrides the files before it, and all
            override the defaults. A complete file needs no default. A file of `write_resolved` was checked before,
            and is read unchanged.
        overrides : mapping, optional
            Nested values, over all files; their texts are read as YAML.
        inputs : bool, optional
            Check also the files that the configuration names, and that grain, bench test and time step fit together;
            this takes seconds. Otherwise these checks are made with the grain.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            With all faults at once: for each the file, the key, the value and what is allowed.
        """
        for file in files:
            path_of("file", file)
        if not overrides and not inputs and loader.is_resolved(*files):
            return cls.of_results(files[0])
        try:
            study = cls.of(*loader.read_layers(files, overrides), inputs=inputs)
        except InputError:
            for file in (
                file
                for file in files
                if Path(file).is_file() and "simulator" in loader.read(file)
            ):
                allowed = "a study of our own simulator; for one of yours see `repose docs own_simulator`"
                raise InputError(
                    file, "simulator", loader.read(file)["simulator"], allowed
                ) from None
            raise
        provenance.note_config(study.config)
        return study

    @classmethod
    def of(
        cls,
        config: Mapping[str, Any],
        source: Any = "configuration",
        inputs: bool = False,
    ) -> "Study":
        """Make the study of a complete configuration.

        Parameters
        ----------
        config : mapping
            Every key; each may be `auto` that can be computed.
        source : str or Origin, optional
            File that an error names.
        inputs : bool, optional
            As in `load`.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            As in `load`.
        """
        from repose.config.making import Making

        require(
            isinstance(config, Mapping),
            source,
            "configuration",
            config,
            "a mapping of sections",
        )
        making = Making(dict(config), source)
        making.complete(inputs)
        study = cls._of(making.config, source)
        study.__dict__["_making"] = making
        return study

    @classmethod
    def of_results(cls, path: Path_) -> "Study":
        """Load the study of a folder of results, for a job.

        Parameters
        ----------
        path : path
            `RESULTS/config.json`, which was checked before. Nothing is checked again.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            If the file cannot be read.
        """
        config = read_json(path, what="the configuration of a folder of results")
        provenance.note_config(config)
        return cls._of(config, str(path))

    @cached_property
    def _making(self) -> "Making":
        """The making of the study; of one that was checked before it is loaded where a check is asked for."""
        from repose.config.making import Making

        return Making(self.config, self._source)

    @cached_property
    def settings(self) -> "StudySettings":
        """The configuration as typed sections, such as `study.settings.funnel.seeds`."""
        from repose.config import own, typed

        return (
            own.sections_of(self.config)
            if self._source is None
            else typed.sections(self.config, self._source)
        )

    @cached_property
    def parameters(self) -> "ParameterSpace":
        """Ranges of the free parameters, fixed values, prior knowledge."""
        from repose.calibrate.parameter_space import ParameterSpace

        section: Any = self.settings.parameters
        if self._source is None:
            return ParameterSpace.of(section, names=tuple(section))
        return ParameterSpace.of(section.given)

    @cached_property
    def targets(self) -> "Targets":
        """The measured responses."""
        given = self.config["targets"]
        if self._source is None:
            from repose.config.own import targets_of

            return targets_of(given)
        import repose.bench  # noqa: F401  registers the responses
        from repose.calibrate.targets import Targets

        return Targets.of(given)

    @cached_property
    def definitions(self) -> Definitions:
        """For each response of the bench tests of the targets the keys that define it, with their values.

        Other bench tests are left out: the study's files do not change with them.
        """
        if self._source is None:
            return {}
        from repose.bench import bench_tests

        tests = (test for test in bench_tests() if test.name in self.targets.apparatus)
        responses = (
            one
            for test in tests
            for one in (*test.responses, *test.target_responses(self.config))
        )
        found = {
            response.name: response.settings(self.config) for response in responses
        }
        for target in self.settings.targets:
            if target.profile is not None:
                found[target.response] |= {"profile": target.profile.abscissae}
        return found

    def published(self, table: str) -> Path | None:
        """Return the path of a table of the published solutions, such as ``table3.csv``; None if it is not there."""
        return beside(self.settings.validation.published, table)

    @cached_property
    def folder(self) -> Path:
        """Folder of the results."""
        return Path(self.settings.results_dir)

    @property
    def grain(self) -> dict[str, Any]:
        """The mean grain, as in berry.json; with it the files that the configuration names are checked."""
        return self._checked()[0]

    @property
    def particle(self) -> "Particle":
        """The body of the mean grain; with it the files that the configuration names are checked."""
        return self._checked()[1]

    def scene(self, parameters: Mapping[str, float], seed: int = 0) -> "Scene":
        """Make the scene of a run of any bench test.

        Parameters
        ----------
        parameters : mapping
            Contact parameters by name.
        seed : int, optional
            Of the random numbers of the run.

        Returns
        -------
        Scene
        """
        from repose.bench import Scene

        return Scene.of(self.config, parameters, self.grain, self.particle, seed)

    def check_inputs(self) -> None:
        """Check the files that the configuration names, and that grain, bench test and time step fit together.

        Raises
        ------
        InputError
            With all faults at once.
        """
        self._checked()

    def _checked(self) -> "tuple[dict[str, Any], Particle]":
        """Return grain and particle of a study with our simulator, its files checked."""
        if self._source is None:
            raise InputError(
                "study",
                "grain",
                None,
                "a study of our own simulator; this one has the user's",
            )
        return self._making.checked_grain()

    @cached_property
    def _own_record(self) -> "Record":
        """The runs as this process knows them."""
        from repose.config.record import Record

        return Record(self, self._file)

    @property
    def _record(self) -> "Record":
        """The runs so far, those of other processes among them."""
        self._own_record.read()
        return self._own_record

    @property
    def runs(self) -> "pd.DataFrame":
        """All runs so far: `sample`, `status`, parameters and responses, which are NaN for a run that failed."""
        return self._record.data

    @property
    def proposal(self) -> "Batch | Answer":
        """The strategy's proposal after these runs: the next samples, or the answer."""
        with _one_thread():
            return self._record.proposal

    @property
    def done(self) -> bool:
        """Whether the strategy needs no more runs."""
        from repose.calibrate.strategies.base import Answer

        return isinstance(self.proposal, Answer)

    def ask(self) -> "pd.DataFrame":
        """Return the runs to make next; once `done`, the runs of the answer, to simulate it again.

        It returns the same until `tell` adds them.

        Returns
        -------
        pandas.DataFrame
            A row for each run: `sample`, `run` (the runs of a sample differ in the random numbers of the simulator
            alone), and the parameters.

        Raises
        ------
        InputError
            If the runs so far do not determine the model of the strategy.
        """
        with _one_thread():
            return self._record.asked

    def tell(self, runs: "pd.DataFrame") -> None:
        """Add results; with a file they are on the disk afterwards, and several processes may add to it.

        Parameters
        ----------
        runs : pandas.DataFrame
            `sample` and a column for each response, for any of the runs that `ask` gave, in any order; NaN for a run
            that failed. With a column `run` by the number of the run. Other columns are not read, but parameters must
            equal the rows of `ask`. Without `sample` they are runs made before: a column for each parameter, too.

        Raises
        ------
        InputError
            If these are not runs that `ask` gave, or a number is not finite. Nothing is added then.
        """
        self._own_record.add(runs)  # which reads the file under its lock

    def calibrate(
        self, simulate: Callable[[dict[str, Any]], Mapping[str, float]]
    ) -> "Calibration":
        """Simulate all that the strategy asks for, and return the answer; with a file each run is on the disk at once.

        Parameters
        ----------
        simulate : function
            It takes a row of `ask` as a mapping, and returns the responses by name; NaN for a run that failed.

        Returns
        -------
        Calibration

        Raises
        ------
        InputError
            If a response is missing or not a number.
        """
        names = list(self.targets.names)
        require(
            callable(simulate),
            "study",
            "simulate",
            simulate,
            "a function of a row of `ask`",
        )
        while not self.done:
            for _, asked in self.ask().groupby(["sample", "run"], sort=False):
                found = simulate(asked.to_dict("records")[0])
                good = isinstance(found, Mapping) and set(names) <= set(found)
                require(
                    good,
                    "study",
                    "simulate",
                    [found],
                    f"a function that returns a mapping with {', '.join(names)}",
                )
                self.tell(asked.assign(**{name: found[name] for name in names}))
        return self.answer()

    def answer(self) -> "Calibration":
        """Return the parameters that meet the targets, with their certainty.

        Before the study is `done`, the best that the runs so far give.

        Returns
        -------
        Calibration
            `parameters`, `prediction`, `probability`, `posterior`, and why the runs ended; a notebook shows it.

        Raises
        ------
        InputError
            If the runs do not determine an answer.
        """
        from repose.calibrate.calibration import calibrate

        require(
            not self.runs.empty,
            "study",
            "runs",
            0,
            "results of the runs that `ask` gave: `tell` adds them",
        )
        with _one_thread():
            return calibrate(self, self.runs, self.proposal)


def _one_thread() -> AbstractContextManager[Any]:
    """Limit matrices to one thread: small ones are slower on several, and end in other bits than by `repose`."""
    import scipy.linalg  # noqa: F401  brings matrices of its own, which only a library that is loaded limits
    from threadpoolctl import threadpool_limits

    return threadpool_limits(limits=1, user_api="blas")


def _target(given: Any) -> Any:
    """Write a target with the keys of a file."""
    if not isinstance(given, list) or len(given) not in (2, 3):
        return given
    return dict(zip(("value", "sd", "repetitions"), (*given, 1)[:3], strict=True))


def _settings_of(file: Path_) -> Path:
    """Return the file of the settings beside a file of runs."""
    path = path_of("file", file)
    require(
        path.parent.is_dir(),
        "study",
        "file",
        str(file),
        "a path in a folder that is there",
    )
    require(
        path.suffix == ".csv", "study", "file", str(file), "a path that ends in .csv"
    )
    return path.with_suffix(".json")


def _keep_settings(given: Mapping[str, Any], file: Path_) -> None:
    """Write the settings beside the file of runs; InputError if there are others."""
    from repose.config.reading import read

    path = _settings_of(file)
    if not path.exists():
        write_json(path, given)
        return
    known = read(path)
    plain = json.loads(json_text(given))
    off = sorted(key for key in {*known, *plain} if known.get(key) != plain.get(key))
    if off:
        raise InputError(
            path,
            off[0],
            known.get(off[0]),
            f"{plain.get(off[0])}, as asked for; or another file",
        )


def _plain(given: Any) -> Any:
    """Write tuples, and numbers and arrays of numpy, as a file has them."""
    given = given.tolist() if hasattr(given, "tolist") else given
    if isinstance(given, Mapping):
        return {key: _plain(one) for key, one in given.items()}
    return [_plain(one) for one in given] if isinstance(given, list | tuple) else given
