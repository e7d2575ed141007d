"""Define the interface of all bench tests, and register them by name."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from repose.bench.bounds import NOTED_OVERLAP
from repose.bench.scene import Scene, grain_simulation
from repose.bench.settings import S, SceneSettings
from repose.bench.trial import Progress
from repose.calibrate import responses as response_registry
from repose.calibrate.responses import Response
from repose.calibrate.runs import OVERLAP_SHARE, Recorded
from repose.calibrate.seeds import UNNAMED
from repose.common.errors import InputError
from repose.common.section import Contradictions

if TYPE_CHECKING:
    from repose import dem

Config = Mapping[str, Any]
Arrays = Mapping[str, np.ndarray]

# Status of a run with a response outside its limits; every bench test has it.
OUT_OF_BOUNDS = "out_of_bounds"


@dataclass(frozen=True)
class Run:
    """One run of a bench test, before it is measured.

    Attributes
    ----------
    record : dict
        ``seed``, ``status``, ``reason``, and numbers with their units in the keys. Only
        a run with the status ``ok`` can be measured.
    arrays : dict
        Arrays by name, for the measurement.
    frames : dict or None
        Frames of a film, if requested: ``time_s`` (T,), ``position`` (T, N, 3) [m],
        ``quaternion`` (T, N, 4), ``scale`` (N,) and further arrays of the bench test.
    """

    record: dict[str, Any]
    arrays: dict[str, np.ndarray]
    frames: dict[str, np.ndarray] | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The numbers by which a run is judged; each bench test adds its own.

    Attributes
    ----------
    unstable : str
        Message about the bound that the run broke (`repose.bench.bounds`); empty if it
        broke none.
    overlap_share : float
        Largest overlap in the state that is measured, over the smallest extent of its
        grain (`Trial.overlap_share`).
    """

    unstable: str = ""
    overlap_share: float = 0.0


class Verdict(NamedTuple):
    """The status of a run, and the reason for any status but ``ok``."""

    status: str
    reason: str = ""


OK = Verdict("ok")


def not_at_rest(
    energy_j: float, settings: SceneSettings, *, advice: str, when: str = ""
) -> Verdict | None:
    """Judge whether the grains of a run are at rest.

    Parameters
    ----------
    energy_j : float
        Mean kinetic energy of a grain. One that is not a number is no rest.
    settings : SceneSettings
        Sections of the configuration, with the limit of the energy.
    advice : str
        The change of the configuration that brings rest, for the reason.
    when : str, optional
        The moment of the energy, for the reason; it begins with a blank.

    Returns
    -------
    Verdict or None
        The fault; None if the grains are at rest.
    """
    limit_j = settings.simulation.rest_energy_j
    if energy_j <= limit_j:
        return None
    return Verdict(
        "not_at_rest",
        f"kinetic energy {energy_j:.2e} J a grain{when}, more than {limit_j:.2g}; {advice}",
    )


class BenchTest(ABC, Generic[S]):
    """A bench test: its responses, and how a scene is run and measured.

    Attributes
    ----------
    name : str
        Name of the bench test and of its section in the configuration; set by
        `register`.
    settings : type of Section
        Model of that section. Its key ``seeds`` is the number of runs per sample.
    responses : tuple of Response
        Its responses. `Response.of` takes what `measure` returns.
    numbers : tuple of str
        Numbers of a measured run besides its responses.
    example : mapping
        Parts of a configuration, over config/config.yaml, of a small and quick run: its
        section, ``targets``, and other sections where they must differ. The tests take
        it for every table of bench tests.
    recorded : Recorded
        Numbers of a run that the tables keep besides the targets; by default its
        responses and `numbers`.
    statuses : tuple of str
        How a run may end; ``ok`` first.
    missing_status : mapping
        Status, by the response, of a run that has no number for a target; by default
        ``no_flank``.
    measured_by : tuple of str
        Keys of its section that only `measure` reads. A change of them needs no new
        run.
    required_arrays : tuple of str
        Arrays that every saved run must have.
    summary : str
        Template of a line about a measured run; fields are its numbers.
    photographed : mapping
        For a bench test that leaves a pile: which response is the ``aor_deg`` and which
        the ``height_mm`` of a photograph.
    """

    name: ClassVar[str]
    settings: type[S]
    responses: ClassVar[tuple[Response, ...]]
    numbers: ClassVar[tuple[str, ...]] = ()
    example: ClassVar[Mapping[str, Any]]
    recorded: ClassVar[Recorded]
    statuses: ClassVar[tuple[str, ...]]
    missing_status: ClassVar[Mapping[str, str]] = {}
    measured_by: ClassVar[tuple[str, ...]] = ()
    required_arrays: ClassVar[tuple[str, ...]] = ()
    summary: ClassVar[str] = ""
    photographed: ClassVar[Mapping[str, str]] = {}

    # --- a run ---

    @abstractmethod
    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe capacity, walls and box of the simulation.

        Parameters
        ----------
        scene : Scene
            The scene.
        largest_radius_m : float
            Bounding radius of the largest grain.

        Returns
        -------
        dict
            Arguments of `repose.dem.Simulation`.
        """

    def build(self, scene: Scene, largest_scale: float = 1.0) -> "dem.Simulation":
        """Make the empty simulation.

        Parameters
        ----------
        scene : Scene
            The scene.
        largest_scale : float, optional
            Relative size of the largest grain for which there is room.
        """
        largest_radius_m = largest_scale * scene.particle.bounding_radius_m
        return grain_simulation(
            scene, largest_scale=largest_scale, **self.world(scene, largest_radius_m)
        )

    @abstractmethod
    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Run the bench test once.

        Parameters
        ----------
        scene : Scene
            The scene.
        interval_s : float, optional
            Simulated time between two frames; without it there are none.
        progress : function, optional
            Called with the simulated time [s].
        """

    def judge(self, outcome: Any, settings: SceneSettings) -> Verdict:
        """Judge a stable run before it is measured, the gravest fault first."""
        return OK

    def status_of(self, outcome: Outcome, settings: SceneSettings) -> Verdict:
        """Judge a run before it is measured: an unstable one here, others by `judge`."""
        if outcome.unstable:
            return Verdict("unstable", outcome.unstable)
        return self.judge(outcome, settings)

    def make_run(
        self,
        scene: Scene,
        outcome: Outcome,
        arrays: dict[str, np.ndarray],
        frames: Any = None,
        **numbers: float,
    ) -> Run:
        """Judge a run and write its record.

        Parameters
        ----------
        scene : Scene
            What the run depends on.
        outcome : Outcome
            The state of the grains at its end.
        arrays : dict
            Arrays that are kept, by name.
        frames : mapping, optional
            Frames of the film; None if none were requested.
        **numbers : float
            Numbers for the record. One that is not finite becomes None.

        Returns
        -------
        Run
            The record with seed, status and reason. Overlaps above `NOTED_OVERLAP` are
            noted as ``overlap_share``.
        """
        verdict = self.status_of(outcome, scene.settings)
        record: dict[str, Any] = {
            "seed": int(scene.seed),
            "status": verdict.status,
            "reason": verdict.reason,
        }
        for name, number in numbers.items():
            record[name] = number if math.isfinite(number) else None
        if outcome.overlap_share > NOTED_OVERLAP:
            record[OVERLAP_SHARE] = round(outcome.overlap_share, 3)
        return Run(record, arrays, frames)

    @abstractmethod
    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""

    # --- its measurement ---

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure an ``ok`` run: its responses and `numbers`.

        A number that cannot be measured is None, see `check_targets`.
        """
        raise NotImplementedError

    def measure(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Measure a run.

        Parameters
        ----------
        record : mapping
            The record of the run.
        arrays : mapping
            Its arrays by name.
        scene : Scene
            What it depends on.

        Returns
        -------
        dict
            The record with every response and number. A number that cannot be measured
            is None. All numbers of a run that is not ``ok`` are None.
        """
        if record["status"] != "ok":
            no_numbers = dict.fromkeys((*self.response_names, *self.numbers))
            return {**record, **no_numbers}
        measured = {**record, **self.measure_arrays(arrays, scene)}
        # Some responses are computed from others, which are measured by now.
        for response in self.responses:
            if response.computed_from:
                measured[response.name] = response.of(measured)
        return measured

    def check_targets(
        self,
        measured: Mapping[str, Any],
        settings: SceneSettings,
        reasons: Mapping[str, str],
    ) -> dict[str, str]:
        """Find the first target that a measured run has no number for.

        Parameters
        ----------
        measured : mapping
            Responses of the run.
        settings : SceneSettings
            Sections of the configuration, with the targets.
        reasons : mapping
            Why responses could not be measured.

        Returns
        -------
        dict
            ``status`` and ``reason``; empty if the run has all targets.
        """
        for target in self.target_responses(settings.config):
            name = target.name
            if target.of(measured) is None:
                return {
                    "status": self.missing_status.get(name, "no_flank"),
                    "reason": reasons.get(name, f"{name} cannot be measured"),
                }
        return {}

    def result(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Measure a run, and refuse a response outside its limits.

        Parameters
        ----------
        record, arrays, scene
            As of `measure`.

        Returns
        -------
        dict
            The result of `measure`. If a response is outside its limits, the status is
            `OUT_OF_BOUNDS`, and the reason describes the first such response.
        """
        measured = self.measure(record, arrays, scene)
        if measured["status"] != "ok":
            return measured
        # Targets may be responses that are not listed, see `response_of_name`.
        targets = self.target_responses(scene.settings.config)
        checked_responses = dict.fromkeys((*self.responses, *targets))
        for response in checked_responses:
            value = response.of(measured)
            is_within = value is None or response.low <= value <= response.high
            if is_within:
                continue
            limits = f"{response.low:g} to {response.high:g} {response.unit}".rstrip()
            return measured | {
                "status": OUT_OF_BOUNDS,
                "reason": f"{response.label} is {value:.4g}, outside {limits}",
            }
        return measured

    # --- its configuration ---

    def section(self, settings: SceneSettings) -> S:
        """Return the section of the bench test."""
        return settings.section(self.name, self.settings)

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield keys whose values do not go together, with the allowed values."""
        return iter(())

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield keys of lengths that do not fit the mean grain, with the allowed values.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.
        axes_mm : sequence of float
            Full axes of the mean grain, the longest first.
        """
        return iter(())

    @property
    def response_names(self) -> tuple[str, ...]:
        """Names of its responses."""
        return tuple(response.name for response in self.responses)

    def response_of_name(self, name: str) -> Response | None:
        """Make a response that is not listed in `responses`; None if it is none.

        For a bench test with any number of responses, such as the scores of a profile.
        """
        return None

    def target_responses(self, config: Config) -> tuple[Response, ...]:
        """List its responses that are targets, in the order of the targets."""
        targets = SceneSettings(config).targets_of(self.name)
        return tuple(
            response_registry.response(target["response"]) for target in targets
        )


_REGISTRY: dict[str, BenchTest[Any]] = {}
T = TypeVar("T", bound=type[BenchTest[Any]])


def register(name: str) -> Callable[[T], T]:
    """Return a class decorator that registers a bench test and its responses.

    Parameters
    ----------
    name : str
        Name of the bench test and of its section in the configuration. No other bench
        test may have it.

    Returns
    -------
    function
        A decorator of a subclass of `BenchTest`.

    Raises
    ------
    ValueError
        If another bench test has the name, or a response of it is registered already.
    """

    def register_class(bench_class: T) -> T:
        """Register a subclass of `BenchTest` with its responses, and return it.

        The class gets its `name`, one more status, and by default the columns that its
        runs record.
        """
        if name in _REGISTRY:
            raise ValueError(f"bench test {name!r} is registered already")
        bench_class.name = name
        bench_class.statuses = (*bench_class.statuses, OUT_OF_BOUNDS)
        test = bench_class()
        if not hasattr(bench_class, "recorded"):
            bench_class.recorded = Recorded(
                means=test.response_names,
                single=(*test.response_names, *test.numbers),
            )
        # A bench test with any number of responses makes those that it does not list.
        family = None
        if bench_class.response_of_name is not BenchTest.response_of_name:
            family = test.response_of_name
        response_registry.register(*test.responses, family=family)
        _REGISTRY[name] = test
        return bench_class

    return register_class


def bench_of(job: Mapping[str, Any], source: object = "apparatus") -> BenchTest[Any]:
    """Find the bench test of a job by its description.

    Parameters
    ----------
    job : mapping
        The description. Its key ``apparatus`` names the bench test; without it the job
        is of the first bench test.
    source : object, optional
        Named in the error.
    """
    return bench(job.get("apparatus", UNNAMED), source)


def bench(name: str, source: object = "apparatus") -> BenchTest[Any]:
    """Find a bench test by its name.

    Parameters
    ----------
    name : str
        Name of the bench test.
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
