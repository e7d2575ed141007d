"""Bench tests and their registry.

A bench test is one module. It defines its responses (`Response`), the model of its section in the configuration,
how its scene is built and run, and how a run is measured. The job that pours, the tables and the workflow take it
from this registry by its name.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from repose.core import responses as core
from repose.core.errors import InputError
from repose.core.responses import Response
from repose.core.runs import Recorded
from repose.core.section import Section

Config = Mapping[str, Any]


@dataclass(frozen=True)
class Run:
    """One run of a bench test, before it is measured.

    Attributes
    ----------
    record : dict
        ``seed``, ``status``, ``reason`` and numbers with their units in the keys. Status ``ok`` means that the run can
        be measured.
    arrays : dict
        Arrays by name, for the measurement.
    frames : dict or None
        Frames of a film, if requested: ``time_s`` (T,), ``position`` (T, N, 3) [m], ``quaternion``
        (T, N, 4), ``scale`` (N,) and further arrays of the bench test.
    """

    record: dict[str, Any]
    arrays: dict[str, np.ndarray]
    frames: dict[str, np.ndarray] | None = None


def _nothing(*_: Any) -> Iterator[Any]:
    """Default hook: yields nothing."""
    return iter(())


@dataclass(frozen=True)
class BenchTest:
    """A bench test: its responses, and the functions that run it.

    Attributes
    ----------
    name : str
        Of the bench test, and of its section in the configuration.
    responses : tuple of Response
        Its responses. Each function of a measured run (`Response.of`) takes what `measure` returns.
    recorded : Recorded
        Numbers of a run that the tables keep besides the targets.
    statuses : tuple of str
        How a run may end; ``ok`` first.
    settings : type of Section
        Model of its section in the configuration. ``seeds`` among its keys is the number of runs of each sample of a
        design.
    build : function
        ``build(config, parameters, particle, berry, largest_scale=1.0)`` makes the empty simulation.
    run : function
        ``run(config, parameters, seed, particle, berry, interval_s=None, progress=None)`` makes a `Run`. interval_s
        asks for frames; progress is called with the simulated time.
    measure : function
        ``measure(record, arrays, config, particle, berry)`` returns the measured run: the record with every response
        that is a target of the configuration; None where it cannot be measured.
    duration_s : function
        ``duration_s(config)`` is the longest simulated time of a run [s].
    contradictions : function
        ``contradictions(config)`` yields (dotted key, what is allowed) where values do not go together.
    misfits : function
        ``misfits(config, axes_mm)`` yields the same where the bench test does not fit the mean berry, whose three axes
        are given in mm, the longest first.
    advice : function
        ``advice(config, berry, particle, longest_step_s)`` yields planning hints. berry is what the
        verb ``berry`` writes; longest_step_s(berry) is the longest time step [s] for such berries.
    measured_by : tuple of str
        Keys of its section that only `measure` reads; a change of them makes no new run.
    kept : tuple of str
        Arrays that every saved run must have.
    in_words : str
        A measured run in words, as a template of its values.
    family : function or None
        ``family(name)`` is a further response by its name, or None: for scores of a profile, or for each of any number
        of speeds.
    photographed : mapping
        Of a bench test that leaves a pile, its responses by the numbers of a photograph, ``aor_deg`` and ``height_mm``.
    """

    name: str
    responses: tuple[Response, ...]
    recorded: Recorded
    statuses: tuple[str, ...]
    settings: type[Section]
    build: Callable[..., Any]
    run: Callable[..., Run]
    measure: Callable[..., dict[str, Any]]
    duration_s: Callable[[Config], float]
    contradictions: Callable[[Config], Iterator[tuple[str, str]]] = _nothing
    misfits: Callable[[Config, Sequence[float]], Iterator[tuple[str, str]]] = _nothing
    advice: Callable[..., Iterator[str]] = _nothing
    measured_by: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    in_words: str = ""
    family: core.Family | None = None
    photographed: Mapping[str, str] = field(default_factory=dict)

    def target_responses(self, config: Config) -> tuple[Response, ...]:
        """Responses of the bench test that are targets of a configuration.

        Parameters
        ----------
        config : mapping
            The whole configuration.

        Returns
        -------
        tuple of Response
            In the order of the targets.
        """
        return tuple(
            core.response(target["response"])
            for target in config["targets"]
            if target["apparatus"] == self.name
        )

    def judged(
        self,
        measured: Mapping[str, Any],
        config: Config,
        reasons: Mapping[str, str],
        statuses: Mapping[str, str] = {},
    ) -> dict[str, str]:
        """Status and reason of a measured run that lacks a target.

        Parameters
        ----------
        measured : mapping
            Every target of the bench test by name; None where it could not be measured.
        config : mapping
            The whole configuration.
        reasons : mapping of str to str
            Why responses could not be measured.
        statuses : mapping of str to str, optional
            Statuses of a run that lacks a response, where they are not ``no_flank``.

        Returns
        -------
        dict
            ``status`` and ``reason`` by the first target that is lacking; empty if none is.
        """
        for target in self.target_responses(config):
            name = target.name
            if measured[name] is None:
                reason = reasons.get(name, f"{name} cannot be measured")
                return {"status": statuses.get(name, "no_flank"), "reason": reason}
        return {}

    def recorded_for(self, config: Config) -> Recorded:
        """Columns of the bench test's runs in the tables of a study, the targets first.

        Parameters
        ----------
        config : mapping
            The whole configuration.

        Returns
        -------
        Recorded
        """
        return self.recorded.beginning_with(
            tuple(response.name for response in self.target_responses(config))
        )


_REGISTRY: dict[str, BenchTest] = {}


def register(test: BenchTest) -> BenchTest:
    """Make a bench test and its responses known by name.

    Parameters
    ----------
    test : BenchTest
        Of a name that is free.

    Returns
    -------
    BenchTest
        The same bench test.

    Raises
    ------
    ValueError
        If another bench test has the name, or a response of it is registered already.
    """
    if _REGISTRY.setdefault(test.name, test) is not test:
        raise ValueError(f"bench test {test.name!r} is registered already")
    core.register(*test.responses, family=test.family)
    return test


def bench(name: str, source: object = "apparatus") -> BenchTest:
    """The bench test of a name.

    Parameters
    ----------
    name : str
        Of the bench test.
    source : object, optional
        Named in the error.

    Returns
    -------
    BenchTest

    Raises
    ------
    InputError
        If no bench test has this name.
    """
    if name not in _REGISTRY:
        raise InputError(source, "apparatus", name, f"one of {', '.join(_REGISTRY)}")
    return _REGISTRY[name]


def names() -> tuple[str, ...]:
    """Names of all bench tests.

    Returns
    -------
    tuple of str
        In the order of their registration.
    """
    return tuple(_REGISTRY)


def bench_tests() -> tuple[BenchTest, ...]:
    """All bench tests.

    Returns
    -------
    tuple of BenchTest
        In the order of their registration.
    """
    return tuple(_REGISTRY.values())
