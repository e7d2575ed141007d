"""The interface of all bench tests, their registry, and the scene that each of them simulates.

A bench test is one module: its responses, the model of its section in the configuration, and a class that builds its
scene, runs it and measures a run. The job that pours, the tables and the workflow take it from the registry by its
name.

To add a bench test, write a subclass of `BenchTest` in a module of its own, put `@register("its_name")` above it, and
import the module in `repose.bench`; then the configuration knows the name.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

import numpy as np

from repose.bench.scene import grain_simulation
from repose.bench.settings import S, SceneSettings, SimulationSettings
from repose.calibrate import responses as core
from repose.calibrate.responses import Response
from repose.calibrate.runs import Recorded
from repose.calibrate.seeds import UNNAMED
from repose.common.errors import require
from repose.common.section import Contradictions

if TYPE_CHECKING:
    from repose import dem
    from repose.grain.particle import Particle
    from repose.measure.settings import MeasureSettings

Config = Mapping[str, Any]
Grain = Mapping[str, Any]
Progress = Callable[[float], object]
Arrays = Mapping[str, np.ndarray]
Faults = Iterator[tuple[str, str]]


@dataclass(frozen=True)
class Scene:
    """All that a run of a bench test depends on.

    Attributes
    ----------
    settings : SceneSettings
        Sections of the configuration.
    parameters : mapping
        Contact parameters by name.
    grain : mapping
        The mean grain, as in berry.json.
    particle : Particle
        Its body.
    seed : int
        Of the random numbers of the run.
    """

    settings: SceneSettings
    parameters: Mapping[str, float]
    grain: Grain
    particle: "Particle"
    seed: int = 0

    @classmethod
    def of(
        cls,
        config: Config,
        parameters: Mapping[str, float],
        grain: Grain,
        particle: "Particle",
        seed: int = 0,
    ) -> Self:
        """Make the scene of a configuration."""
        return cls(SceneSettings(config), parameters, grain, particle, seed)

    def with_seed(self, seed: int) -> Self:
        """Return the same scene with other random numbers."""
        return replace(self, seed=seed)

    @property
    def simulation(self) -> SimulationSettings:
        """Settings of every simulation."""
        return self.settings.simulation

    @property
    def measure(self) -> "MeasureSettings":
        """Settings of the measurement of a pile."""
        return self.settings.measure_of(self.grain)


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


@dataclass(frozen=True, kw_only=True)
class Ending:
    """How a run ended: the numbers by which it is judged; each bench test adds its own."""

    unstable: str = ""  # the bound that the run broke (`repose.bench.bounds`); empty where it broke none


def stated(*cases: tuple[object, str, str]) -> Iterator[tuple[str, str]]:
    """Yield the cases that hold: a key and what is allowed, or a status and its reason."""
    return ((name, words) for holds, name, words in cases if holds)


class BenchTest(ABC, Generic[S]):
    """A bench test: its responses, and how a scene is run and measured.

    Attributes
    ----------
    name : str
        Of the bench test, and of its section in the configuration; set by `register`.
    settings : type of Section
        Model of that section. ``seeds`` among its keys is the number of runs of each sample of a design.
    responses : tuple of Response
        Its responses. Each function of a measured run (`Response.of`) takes what `measure` returns.
    numbers : tuple of str
        Numbers of a measured run besides its responses.
    recorded : Recorded
        Numbers of a run that the tables keep besides the targets: by default its responses and `numbers`.
    statuses : tuple of str
        How a run may end; ``ok`` first.
    lacking : mapping
        Status of a run without a number for a target, by the response; ``no_flank`` by default.
    measured_by : tuple of str
        Keys of its section that only `measure` reads; a change of them makes no new run.
    required_arrays : tuple of str
        Arrays that every saved run must have.
    summary : str
        A measured run in words, as a template of its values.
    photographed : mapping
        Of a bench test that leaves a pile, its responses by the numbers of a photograph, ``aor_deg`` and ``height_mm``.
    """

    name: ClassVar[str]
    settings: type[S]
    responses: ClassVar[tuple[Response, ...]]
    numbers: ClassVar[tuple[str, ...]] = ()
    recorded: ClassVar[Recorded]
    statuses: ClassVar[tuple[str, ...]]
    lacking: ClassVar[Mapping[str, str]] = {}
    measured_by: ClassVar[tuple[str, ...]] = ()
    required_arrays: ClassVar[tuple[str, ...]] = ()
    summary: ClassVar[str] = ""
    photographed: ClassVar[Mapping[str, str]] = {}

    @abstractmethod
    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe capacity, walls and box, as arguments of `repose.dem.Simulation`; reach_m: of the largest grain."""

    def build(self, scene: Scene, largest_scale: float = 1.0) -> "dem.Simulation":
        """Make the empty simulation, with room for grains of a largest relative size."""
        reach_m = largest_scale * scene.particle.bounding_radius_m
        return grain_simulation(
            scene, largest_scale=largest_scale, **self.world(scene, reach_m)
        )

    @abstractmethod
    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Run once; `interval_s` asks for frames, `progress` is called with the simulated time [s]."""

    def faults(self, ending: Any, settings: SceneSettings) -> Faults:
        """Yield status and reason of each fault that spoils a run before it is measured, the gravest first."""
        return iter(())

    def status_of(self, ending: Ending, settings: SceneSettings) -> tuple[str, str]:
        """Judge a run before it is measured; the reason of ``ok`` is empty."""
        fault = (
            ("unstable", ending.unstable)
            if ending.unstable
            else next(self.faults(ending, settings), None)
        )
        return fault or ("ok", "")

    def ended(
        self,
        scene: Scene,
        ending: Ending,
        arrays: dict[str, np.ndarray],
        frames: Any = None,
        **numbers: float,
    ) -> Run:
        """Judge a run and make its record; a number that is not finite becomes None."""
        status, reason = self.status_of(ending, scene.settings)
        known = {
            key: value if math.isfinite(value) else None
            for key, value in numbers.items()
        }
        return Run(
            {"seed": int(scene.seed), "status": status, "reason": reason, **known},
            arrays,
            frames,
        )

    def values(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure an ``ok`` run: its responses and `numbers`, None where one cannot be measured; see `assess`."""
        raise NotImplementedError

    def measure(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Measure a run: its record with every response that is a target; None where it cannot be measured."""
        if record["status"] == "ok":
            return {**record, **self.values(arrays, scene)}
        return {**record, **dict.fromkeys((*self.response_names, *self.numbers))}

    @abstractmethod
    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield (dotted key, what is allowed) where values do not go together."""
        return iter(())

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield the same where the test does not fit the mean grain, whose axes [mm] are given, the longest first."""
        return iter(())

    def further_response(self, name: str) -> Response | None:
        """Return a response that is not listed: the score of a profile, or a number at one of many speeds."""
        return None

    def section(self, settings: SceneSettings) -> S:
        """Return the section of the bench test."""
        return settings.section(self.name, self.settings)

    @property
    def response_names(self) -> tuple[str, ...]:
        """Names of its responses."""
        return tuple(response.name for response in self.responses)

    def target_responses(self, config: Config) -> tuple[Response, ...]:
        """Return its responses that are targets of a configuration, in the order of the targets."""
        targets = SceneSettings(config).targets_of(self.name)
        return tuple(core.response(target["response"]) for target in targets)

    def assess(
        self,
        measured: Mapping[str, Any],
        settings: SceneSettings,
        reasons: Mapping[str, str],
    ) -> dict[str, str]:
        """Return ``status`` and ``reason`` by the first target that a measured run lacks; empty if it lacks none.

        `reasons` says why responses could not be measured.
        """
        for target in self.target_responses(settings.config):
            name = target.name
            if measured[name] is None:
                reason = reasons.get(name, f"{name} cannot be measured")
                return {"status": self.lacking.get(name, "no_flank"), "reason": reason}
        return {}

    def result(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Measure a run; a response outside its bounds is no result, and its run is not ``ok``."""
        measured = self.measure(record, arrays, scene)
        if measured["status"] != "ok":
            return measured
        for response in dict.fromkeys(
            (*self.responses, *self.target_responses(scene.settings.config))
        ):
            value = response.of(measured)
            if value is not None and not response.low <= value <= response.high:
                bounds = (
                    f"{response.low:g} to {response.high:g} {response.unit}".rstrip()
                )
                reason = f"{response.label} is {value:.4g}, outside {bounds}"
                return measured | {"status": OUT_OF_BOUNDS, "reason": reason}
        return measured


OUT_OF_BOUNDS = "out_of_bounds"  # status of a run, of every bench test, with a response outside its bounds
_REGISTRY: dict[str, BenchTest[Any]] = {}
T = TypeVar("T", bound=type[BenchTest[Any]])


def register(name: str) -> Callable[[T], T]:
    """Make a bench test and its responses known by name.

    Parameters
    ----------
    name : str
        A name that is free; also of its section in the configuration.

    Returns
    -------
    function
        A decorator of a subclass of `BenchTest`.

    Raises
    ------
    ValueError
        If another bench test has the name, or a response of it is registered already.
    """

    def known(kind: T) -> T:
        if name in _REGISTRY:
            raise ValueError(f"bench test {name!r} is registered already")
        kind.name, kind.statuses = name, (*kind.statuses, OUT_OF_BOUNDS)
        test = kind()
        if not hasattr(kind, "recorded"):
            kind.recorded = Recorded(
                test.response_names, single=(*test.response_names, *test.numbers)
            )
        family = (
            None
            if kind.further_response is BenchTest.further_response
            else test.further_response
        )
        core.register(*test.responses, family=family)
        _REGISTRY[name] = test
        return kind

    return known


def bench_of(job: Mapping[str, Any], source: object = "apparatus") -> BenchTest[Any]:
    """Find the bench test of a job by its description; that of the first bench test carries no name."""
    return bench(job.get("apparatus", UNNAMED), source)


def bench(name: str, source: object = "apparatus") -> BenchTest[Any]:
    """Find the bench test of a name.

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
    require(
        name in _REGISTRY, source, "apparatus", name, f"one of {', '.join(_REGISTRY)}"
    )
    return _REGISTRY[name]


def names() -> tuple[str, ...]:
    """List the names of all bench tests.

    Returns
    -------
    tuple of str
        In the order of their registration.
    """
    return tuple(_REGISTRY)


def bench_tests() -> tuple[BenchTest[Any], ...]:
    """List all bench tests.

    Returns
    -------
    tuple of BenchTest
        In the order of their registration.
    """
    return tuple(_REGISTRY.values())
