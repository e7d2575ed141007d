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
from repose.common.numbers import format_significant
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
        Frames of a film: ``time_s`` (T,), ``position`` (T, N, 3) [m], ``quaternion``
        (T, N, 4), ``scale`` (N,) and further arrays of the bench test. None if no
        frames were requested.
    """

    record: dict[str, Any]
    arrays: dict[str, np.ndarray]
    frames: dict[str, np.ndarray] | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The measurements by which a run is accepted or rejected.

    Each bench test adds further ones.

    Attributes
    ----------
    unstable : str
        Message about the limit that the run exceeded (`repose.bench.bounds`); empty if
        it exceeded none.
    overlap_share : float
        Largest overlap in the measured state, over the smallest extent of the grain
        (`Trial.overlap_share`).
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
    """Check whether the grains are at rest, and return a verdict if they are not.

    Parameters
    ----------
    energy_j : float
        Mean kinetic energy of a grain. If it is NaN, the grains count as not at rest.
    settings : SceneSettings
        Sections of the configuration, with the limit of the energy.
    advice : str
        How to change the configuration so that the grains come to rest. The reason ends
        with this advice.
    when : str, optional
        Phrase in the reason that says when the energy was measured. It begins with a
        space.

    Returns
    -------
    Verdict or None
        The status ``not_at_rest`` with its reason; None if the grains are at rest.
    """
    limit_j = settings.simulation.rest_energy_j
    # This comparison is false if the energy is NaN.
    if energy_j <= limit_j:
        return None
    return Verdict(
        "not_at_rest",
        f"kinetic energy {energy_j:.2e} J a grain{when}, more than "
        f"{format_significant(limit_j, 2)}; {advice}",
    )


class BenchTest(ABC, Generic[S]):
    """A bench test with its responses: it runs a scene, and measures the run.

    Attributes
    ----------
    name : str
        Name of the bench test and of its section in the configuration; set by
        `register`.
    settings : type of Section
        Model of that section. Its key ``seeds`` is the number of runs per sample.
    responses : tuple of Response
        Responses of the bench test. `Response.of` reads them from the result of
        `measure`.
    numbers : tuple of str
        Names of further numbers of a measured run.
    example : mapping
        Parts of a configuration of a small and quick run, which replace those of
        config/config.yaml: the section of the bench test, ``targets``, and other
        sections if they must differ. The tests use it for all bench tests.
    recorded : Recorded
        Numbers of a run that the tables keep besides the targets; by default the
        responses and `numbers`.
    statuses : tuple of str
        Possible statuses of a run, with ``ok`` first.
    missing_status : mapping
        Status of a run that has no number for a target, by the response; by default
        ``no_flank``.
    measured_by : tuple of str
        Keys of the section that only `measure` reads. If one of them changes, no new
        run is needed.
    required_arrays : tuple of str
        Arrays that every saved run must have.
    summary : str
        Template of a line about a measured run. Its fields are numbers of the run.
    photographed : mapping
        For a bench test that leaves a pile: the responses that a photograph of the pile
        gives as ``aor_deg`` and as ``height_mm``.
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
        """Describe the capacity, the walls and the box of the simulation.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        largest_radius_m : float
            Radius of a ball that contains the largest grain in any orientation.

        Returns
        -------
        dict
            Arguments of `repose.dem.Simulation`, by their names.
        """

    def build(self, scene: Scene, largest_scale: float = 1.0) -> "dem.Simulation":
        """Make the empty simulation.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        largest_scale : float, optional
            Relative size of the largest grain for which the simulation has room.
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
            Settings, parameters, grain and seed of the run.
        interval_s : float, optional
            Simulated time between two frames. Without it there are no frames.
        progress : function, optional
            Called with the simulated time [s] whenever the simulation has advanced.
        """

    def judge(self, outcome: Any, settings: SceneSettings) -> Verdict:
        """Check a stable run before it is measured, and return its status.

        A subclass returns the status of the first check that fails.
        """
        return OK

    def status_of(self, outcome: Outcome, settings: SceneSettings) -> Verdict:
        """Return the status of a run before it is measured.

        A run that exceeded a limit is unstable. `judge` checks any other run.
        """
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
        """Check a run before it is measured, and write its record.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        outcome : Outcome
            The measurements by which the run is accepted or rejected.
        arrays : dict
            Arrays of the run, by name.
        frames : mapping, optional
            Frames of the film; None if no frames were requested.
        **numbers : float
            Numbers for the record. A number that is not finite becomes None.

        Returns
        -------
        Run
            The run. Its record has seed, status, reason and the numbers. An overlap
            above `NOTED_OVERLAP` is recorded as ``overlap_share``.
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
        """Measure the responses and the `numbers` of a run with the status ``ok``.

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
            The arrays of the run, by name.
        scene : Scene
            The scene of the run.

        Returns
        -------
        dict
            The record with all responses and numbers. A number that cannot be measured
            is None. All numbers are None if the status is not ``ok``.
        """
        if record["status"] != "ok":
            no_numbers = dict.fromkeys((*self.response_names, *self.numbers))
            return {**record, **no_numbers}
        measured = {**record, **self.measure_arrays(arrays, scene)}
        # Some responses are computed from others, which have been measured by now.
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
        """Find the first target for which a run has no number.

        Such a run gets another status. The caller merges the result into the record.

        Parameters
        ----------
        measured : mapping
            Responses of the run.
        settings : SceneSettings
            Sections of the configuration, with the targets.
        reasons : mapping
            Why a response could not be measured, by the name of the response.

        Returns
        -------
        dict
            The new ``status`` and ``reason`` of the run. The dict is empty if the run
            has numbers for all targets.
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
        """Measure a run, and reject it if a response is outside its limits.

        Parameters
        ----------
        record, arrays, scene
            Arguments of `measure`.

        Returns
        -------
        dict
            The result of `measure`. If a response is outside its limits, the status is
            `OUT_OF_BOUNDS`, and the reason describes the first such response.
        """
        measured = self.measure(record, arrays, scene)
        if measured["status"] != "ok":
            return measured
        # A target may be a response that is not listed, see `response_of_name`.
        targets = self.target_responses(scene.settings.config)
        checked_responses = dict.fromkeys((*self.responses, *targets))
        for response in checked_responses:
            value = response.of(measured)
            if value is None or response.low <= value <= response.high:
                continue
            limits = f"{response.low:g} to {response.high:g} {response.unit}".rstrip()
            return measured | {
                "status": OUT_OF_BOUNDS,
                "reason": f"{response.label} is {format_significant(value)}, outside {limits}",
            }
        return measured

    # --- its configuration ---

    def section(self, settings: SceneSettings) -> S:
        """Return the section of the bench test in the configuration."""
        return settings.section(self.name, self.settings)

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield settings that contradict each other.

        Each is a key of the configuration, with the values that are allowed for it.
        """
        return iter(())

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield settings that do not fit the size of the mean grain.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.
        axes_mm : sequence of float
            Full lengths of the mean grain along its three axes, the longest first.

        Yields
        ------
        tuple of str
            A key of the configuration, and the values that are allowed for it.
        """
        return iter(())

    @property
    def response_names(self) -> tuple[str, ...]:
        """Names of its responses."""
        return tuple(response.name for response in self.responses)

    def response_of_name(self, name: str) -> Response | None:
        """Make a response that is not listed in `responses`.

        This is for a bench test with any number of responses, such as the scores of a
        profile. For a name that is not such a response the result is None.
        """
        return None

    def target_responses(self, config: Config) -> tuple[Response, ...]:
        """List the responses of the bench test that are targets, in their order."""
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
        If another bench test has the name, or if another bench test has a response of
        the same name.
    """

    def register_class(bench_class: T) -> T:
        """Register a subclass of `BenchTest` with its responses, and return it.

        The class is changed: it gets its `name`, a further status, and `recorded` if it
        does not define it.
        """
        if name in _REGISTRY:
            raise ValueError(f"bench test {name!r} is already registered")
        bench_class.name = name
        bench_class.statuses = (*bench_class.statuses, OUT_OF_BOUNDS)
        bench_test = bench_class()
        if not hasattr(bench_class, "recorded"):
            bench_class.recorded = Recorded(
                means=bench_test.response_names,
                single=(*bench_test.response_names, *bench_test.numbers),
            )
        # A class that overrides `response_of_name` has further responses, which are not
        # listed but made from their names.
        family = None
        if bench_class.response_of_name is not BenchTest.response_of_name:
            family = bench_test.response_of_name
        response_registry.register(*bench_test.responses, family=family)
        _REGISTRY[name] = bench_test
        return bench_class

    return register_class


def bench_of(job: Mapping[str, Any], source: object = "apparatus") -> BenchTest[Any]:
    """Find the bench test of a job by its description.

    Parameters
    ----------
    job : mapping
        The description. Its key ``apparatus`` names the bench test. Without this key,
        the job belongs to the bench test `UNNAMED`.
    source : object, optional
        File or command that the job comes from, for error messages.
    """
    return bench(job.get("apparatus", UNNAMED), source)


def bench(name: str, source: object = "apparatus") -> BenchTest[Any]:
    """Find a bench test by its name.

    Parameters
    ----------
    name : str
        Name of the bench test.
    source : object, optional
        File or command that the name comes from, for error messages.

    Returns
    -------
    BenchTest
        The bench test.

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
        The names in the order of registration.
    """
    return tuple(_REGISTRY)


def bench_tests() -> tuple[BenchTest[Any], ...]:
    """List all bench tests.

    Returns
    -------
    tuple of BenchTest
        The bench tests in the order of registration.
    """
    return tuple(_REGISTRY.values())
