"""Bench test of the funnel: poured grains form a pile (paper, section 3.1)."""

import math
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from repose import dem
from repose.bench.bench_test import (
    OK,
    Arrays,
    BenchTest,
    Outcome,
    Run,
    Verdict,
    not_at_rest,
    register,
)
from repose.bench.factory import Disc, Factory, fill, last_berry_s
from repose.bench.hopper import Funnel, find_impossible_surfaces, find_narrow_openings
from repose.bench.scene import Scene
from repose.bench.settings import Hopper, SceneSettings
from repose.bench.trial import Progress, Trial, grain_arrays
from repose.calibrate.responses import Response
from repose.calibrate.runs import Recorded
from repose.common.numbers import format_significant
from repose.common.section import OF_OTHERS, Contradictions, OrAuto
from repose.measure.angles import MEAN_KEYS, VIEW_KEYS
from repose.measure.clusters import largest_cluster

NAME = "funnel"
# Largest fraction of the grains that may roll over the edge of the plate.
LARGEST_LOSS = 0.1
# A pile must contain at least this fraction of the grains on the plate. In 2810 pours
# of the article's study and ours, the fraction was 0.86 or more.
SMALLEST_PILE = 0.5
FEWEST_IN_PILE = 10
# Fraction of the volume of a poured pile that its grains fill.
PACKING = 0.6
# A grain below this height has left the plate and is gone.
FLOOR_M = -0.05
# Number of checks for rest within the time `rest_window_s`.
CHECKS_PER_WINDOW = 4
# Largest distance that a grain at rest would move in another window at its present
# speed, as a fraction of `rest_motion_mm`.
STANDSTILL_SHARE = 0.01
# Advice for a pour whose pile is still moving at the end.
MORE_TIME_ADVICE = "give the grains more time by funnel.duration_s"

# --- responses ------------------------------------------------------------------------

# Keys of the configuration that define the numbers of a pile: its silhouette, ...
SILHOUETTE_KEYS = ("measure.views", "measure.mm_per_pixel", "measure.largest_pile_only")
GRAIN_HEIGHT_KEY = "measure.berry_height_mm"
# ... the line along its flank, ...
LINE_KEYS = ("measure.flank", "measure.fit_from", "measure.fit_to", GRAIN_HEIGHT_KEY)
WINDOW_KEYS = ("measure.smallest_window",)
# ... and the angle of repose, whichever definition of it is calibrated.
ANGLE_KEYS = (*LINE_KEYS, *WINDOW_KEYS, "measure.response")
PLATE_KEYS = ("funnel.plate_diameter_mm",)


def _make_angle_response(
    definition: str, label: str, keys: tuple[str, ...]
) -> Response:
    """Make the response of the angle of the pile by one of its definitions."""
    return Response(
        name=f"aor_{definition}_deg",
        unit="deg",
        label=label,
        symbol=definition,
        apparatus=NAME,
        low=0.0,
        high=89.0,
        definition=(*SILHOUETTE_KEYS, *keys),
    )


def _make_flank_response(part: str) -> Response:
    """Make the response of the slope of the lower or upper part of the flank."""
    return Response(
        name=f"{part}_deg",
        unit="deg",
        label=f"{part} flank",
        symbol=f"{part} flank",
        apparatus=NAME,
        low=0.0,
        high=89.0,
        definition=(*SILHOUETTE_KEYS, GRAIN_HEIGHT_KEY),
    )


RESPONSES = (
    Response(
        name="aor_deg",
        unit="deg",
        label="angle of repose",
        symbol="AoR",
        apparatus=NAME,
        low=1.0,
        high=89.0,
        definition=(*SILHOUETTE_KEYS, *ANGLE_KEYS),
    ),
    Response(
        name="height_mm",
        unit="mm",
        label="Height",
        symbol="Height",
        apparatus=NAME,
        low=1.0,
        high=2000.0,
        definition=SILHOUETTE_KEYS,
    ),
    _make_angle_response("flank", "angle, flank", LINE_KEYS),
    _make_angle_response("secant", "angle, secant", (GRAIN_HEIGHT_KEY,)),
    _make_angle_response("steepest", "angle, steepest", LINE_KEYS),
    _make_angle_response("whole", "angle, whole side", ()),
    _make_angle_response("straightest", "angle, straightest window", WINDOW_KEYS),
    Response(
        name="base_radius_mm",
        unit="mm",
        label="base radius",
        symbol="base radius",
        apparatus=NAME,
        low=0.0,
        high=1e4,
        definition=(*SILHOUETTE_KEYS, GRAIN_HEIGHT_KEY),
    ),
    _make_flank_response("lower"),
    _make_flank_response("upper"),
    Response(
        name="packing_percent",
        unit="%",
        label="packing",
        symbol="packing",
        apparatus=NAME,
        low=0.0,
        high=100.0,
        definition=(*SILHOUETTE_KEYS, GRAIN_HEIGHT_KEY),
    ),
    Response(
        name="radius_90_mm",
        unit="mm",
        label="radius of 90 % of the grains",
        symbol="radius of 90 %",
        apparatus=NAME,
        low=0.0,
        high=1e4,
        definition=PLATE_KEYS,
    ),
    Response(
        name="loose_percent",
        unit="%",
        label="loose grains",
        symbol="loose",
        apparatus=NAME,
        low=0.0,
        high=100.0,
        definition=PLATE_KEYS,
    ),
    Response(
        name="discharge_s",
        unit="s",
        label="discharge time",
        symbol="discharge",
        apparatus=NAME,
        low=0.0,
        high=1e4,
    ),
)
# Numbers that are measured on every pile; other responses only where they are targets.
ANGLE_NAMES = ("height_view_mm", *MEAN_KEYS.values(), *VIEW_KEYS.values())
BASIC_NUMBERS = ("aor_deg", "height_mm", *ANGLE_NAMES)
RECORDED = Recorded(
    means=("aor_deg", "height_mm", "discharge_s", *ANGLE_NAMES),
    without_error=("discharge_s",),
    single=(
        "aor_deg",
        "height_mm",
        "discharge_s",
        "berries_on_plate",
        "berries_in_pile",
        "kinetic_energy_J",
        *ANGLE_NAMES,
    ),
)


# --- section of the configuration -----------------------------------------------------


class FunnelSettings(Hopper):
    """The section `funnel` of the configuration; config/README.md explains its keys."""

    duration_s: OrAuto[Annotated[float, Field(ge=0.1, le=600)]] = Field(
        default=OF_OTHERS,
        description="longest simulated time; a pour ends when its pile rests; `auto`: "
        "40 sqrt(d / gravity) after the funnel is empty",
        json_schema_extra={"source": "3.1: 18"},
    )
    outlet_height_mm: float = Field(
        ge=1,
        le=2000,
        description="height of the outlet above the plate",
        json_schema_extra={"source": "2.3: 100"},
    )
    plate_diameter_mm: float = Field(
        ge=10,
        le=20000,
        description="diameter of the plate; a grain beyond it is lost",
        json_schema_extra={"source": "open"},
    )
    factory_height_mm: OrAuto[Annotated[float, Field(ge=0, le=1000)]] = Field(
        default=OF_OTHERS,
        description="height above the inlet at which grains appear; `auto`: the "
        "equivalent diameter of a grain",
        json_schema_extra={"source": "open"},
    )
    factory_diameter_mm: OrAuto[Annotated[float, Field(ge=1, le=5000)]] = Field(
        default=OF_OTHERS,
        description="diameter of the disc in which grains appear; `auto`: the inlet's "
        "diameter less a grain's length",
        json_schema_extra={"source": "open"},
    )
    orientation: Literal["random", "lying", "upright"] = Field(
        description="orientation of a new grain: `random`, `lying` (long axis level) "
        "or `upright`",
        json_schema_extra={"source": "open"},
    )
    rest_motion_mm: OrAuto[Annotated[float, Field(gt=0, le=200)]] = Field(
        default=OF_OTHERS,
        description="largest motion of a grain at rest in `rest_window_s`; `auto`: 1/14 "
        "of the grain's diameter",
    )
    rest_window_s: OrAuto[Annotated[float, Field(ge=0.001, le=100)]] = Field(
        default=OF_OTHERS,
        description="time at the end of the pour in which the motion is measured; "
        "`auto`: 5.3 sqrt(d / gravity)",
    )

    @property
    def funnel(self) -> Funnel:
        """The inner surfaces of the funnel."""
        return Funnel.of(self, self.outlet_height_mm)


# --- run ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pour(Outcome):
    """The final state of a pour of N grains, by which it is accepted or rejected.

    Attributes
    ----------
    centres_m, quaternions, scales : array
        Positions (N, 3), orientations (N, 4) and relative sizes (N,) of the grains.
    on_plate : array
        Mask (N,) of the grains on the plate.
    in_pile : array
        Mask (N,) of the grains in the largest cluster on the plate.
    in_funnel, off_plate : int
        Number of grains that are still in the funnel, and that have left the plate.
    kinetic_energy_j : float
        Kinetic energy of all grains in the pile together.
    largest_motion_m : float
        Largest displacement of a grain on the plate in the last `rest_window_s`.
    discharge_s : float
        Time from the first to the last grain that left the outlet; NaN if none did.
    wall_s : float
        Wall time of the pour.
    us_per_step : float
        Wall time per time step [us] in the last second of `duration_s`, or since the
        last grain was added if that is later.
    frames : dict or None
        Frames, see `repose.bench.trial.Trial.frames`.
    """

    centres_m: np.ndarray
    quaternions: np.ndarray
    scales: np.ndarray
    on_plate: np.ndarray
    in_pile: np.ndarray
    in_funnel: int
    off_plate: int
    kinetic_energy_j: float
    largest_motion_m: float
    discharge_s: float
    wall_s: float
    us_per_step: float
    frames: dict[str, np.ndarray] | None


def _is_pour_over(
    simulation: "dem.Simulation",
    section: FunnelSettings,
    position_history: Sequence[np.ndarray],
) -> bool:
    """Return whether all grains have been poured, have left the funnel and are at rest.

    A grain is at rest if it hardly moved in the last rest window, and is so slow now
    that it would hardly move in the next one.

    Parameters
    ----------
    simulation : repose.dem.Simulation
        The simulation.
    section : FunnelSettings
        The section `funnel` of the configuration. Its `berries` is the number of
        grains.
    position_history : sequence of array
        Positions (N, 3) [m] of the grains at the checks in the last rest window. The
        last entry is the present state. A complete window has `CHECKS_PER_WINDOW` + 1
        entries.
    """
    # Mask (N,) of the grains that have not fallen from the plate. Only these count.
    present = simulation.present
    all_poured = simulation.n_bodies >= section.berries and present.any()
    is_window_complete = len(position_history) > CHECKS_PER_WINDOW
    if not (all_poured and is_window_complete):
        return False

    # No grain has moved far since the beginning of the rest window. `motion_m` is the
    # distance between its first and its last position.
    largest_motion_m = 1e-3 * section.rest_motion_mm
    motion_m = np.linalg.norm(position_history[-1] - position_history[0], axis=1)
    stayed_in_place = motion_m[present].max() <= largest_motion_m

    # At its present speed, no grain would move far in another window. The rotation of a
    # grain adds the speed of its surface.
    angular_speed = np.linalg.norm(simulation.angular_velocities, axis=1)
    surface_speed = angular_speed * simulation.radius
    speed = np.linalg.norm(simulation.velocities, axis=1) + surface_speed
    next_motion_m = speed[present].max() * section.rest_window_s
    stands_still = next_motion_m <= STANDSTILL_SHARE * largest_motion_m

    # No grain is left in the funnel. A grain that is stuck in the outlet may have its
    # centre up to its bounding radius below the outlet.
    highest_m = position_history[-1][present, 2].max()
    is_below_outlet = highest_m <= section.funnel.outlet_height_m - simulation.radius
    return bool(stayed_in_place and stands_still and is_below_outlet)


class _StepTimer:
    """Measures the wall time per time step since its last start."""

    def __init__(self) -> None:
        """Start at the time step 0."""
        self.start(0)

    def start(self, step: int) -> None:
        """Restart at a time step."""
        self.step = step
        self.clock_s = time.perf_counter()

    def us_per_step(self, step: int) -> float:
        """Compute the wall time per time step since the start [us]."""
        elapsed_s = time.perf_counter() - self.clock_s
        return 1e6 * elapsed_s / max(1, step - self.step)


class _WallTime(NamedTuple):
    """Wall times of a pour; `Pour` explains them."""

    wall_s: float
    us_per_step: float


def _describe_final_state(
    trial: Trial,
    outlet_height_m: float,
    window_start_centres: np.ndarray | None,
    wall_time: _WallTime,
) -> Pour:
    """Measure the end of a pour: where each grain is, and how the grains move.

    Each grain is in the funnel, on the plate or off the plate. The pile is the largest
    group of grains on the plate that touch each other. The plate lies at z = 0.

    Parameters
    ----------
    trial : Trial
        The simulation of the pour at its end.
    outlet_height_m : float
        Height of the funnel's outlet above the plate.
    window_start_centres : array or None
        Centres (N, 3) [m] of the grains at the beginning of the last rest window. None
        means that the pour ended before its first check for rest. The motion is then
        unknown, and the largest motion is recorded as 0.
    wall_time : _WallTime
        Wall time of the whole pour, and per time step.

    Returns
    -------
    Pour
        The final state, with all numbers by which the run is accepted or rejected.
    """
    simulation = trial.simulation
    centres = simulation.positions.copy()
    present = simulation.present

    # A grain that is stuck in the outlet may have its centre up to its bounding radius
    # below the outlet.
    is_in_funnel = present & (centres[:, 2] > outlet_height_m - simulation.radius)
    is_on_plate = present & (centres[:, 2] > 0.0) & ~is_in_funnel
    is_in_pile = largest_cluster(simulation.contacts(), is_on_plate)
    n_in_funnel = int(is_in_funnel.sum())
    n_on_plate = int(is_on_plate.sum())
    pile_energies = simulation.kinetic_energies()[is_in_pile]

    largest_motion_m = 0.0
    if window_start_centres is not None:
        motion_m = np.linalg.norm(centres - window_start_centres, axis=1)
        largest_motion_m = float(motion_m[is_on_plate].max(initial=0.0))

    # Every grain that is neither in the funnel nor on the plate has left the plate.
    # This includes grains that fell so deep that they were removed.
    return Pour(
        centres_m=centres,
        quaternions=simulation.quaternions.copy(),
        scales=simulation.scales.copy(),
        on_plate=is_on_plate,
        in_pile=is_in_pile,
        in_funnel=n_in_funnel,
        off_plate=len(centres) - n_in_funnel - n_on_plate,
        kinetic_energy_j=float(pile_energies.sum()),
        largest_motion_m=largest_motion_m,
        discharge_s=_compute_discharge_s(simulation.exit_times_s),
        wall_s=wall_time.wall_s,
        us_per_step=wall_time.us_per_step,
        frames=trial.frames(),
        unstable=trial.broken,
        overlap_share=trial.overlap_share,
    )


def _compute_discharge_s(exit_times_s: np.ndarray) -> float:
    """Compute the time from the first to the last grain that left the funnel [s].

    The exit time (N,) of a grain that has not left is not finite. The result is NaN if
    no grain has left.
    """
    known_times_s = exit_times_s[np.isfinite(exit_times_s)]
    if not len(known_times_s):
        return math.nan
    return float(known_times_s.max() - known_times_s.min())


def _make_factory(section: FunnelSettings, grain_radius_m: float) -> Factory:
    """Make the source of grains of a pour, which adds them in a disc above the inlet.

    Parameters
    ----------
    section : FunnelSettings
        The section `funnel` of the configuration.
    grain_radius_m : float
        Bounding radius of the largest grain. Centres of new grains keep this distance
        from the edge of the configured disc, so that no grain protrudes beyond it.
    """
    height_m = section.funnel.inlet_height_m + 1e-3 * section.factory_height_mm
    radius_m = 0.5e-3 * section.factory_diameter_mm - grain_radius_m
    return Factory(
        Disc(radius_m, height_m),
        section.berries,
        section.rate_per_s,
        section.orientation,
    )


@register(NAME)
class FunnelTest(BenchTest[FunnelSettings]):
    """A pile that is poured through a funnel."""

    settings = FunnelSettings
    responses = RESPONSES
    recorded = RECORDED
    statuses = ("ok", "jammed", "not_at_rest", "no_flank", "left_plate", "unstable")
    required_arrays = ("position", "quaternion", "in_pile")
    photographed: ClassVar = {"aor_deg": "aor_deg", "height_mm": "height_mm"}
    summary = (
        "angle of repose {aor_deg:.2f} deg, Height {height_mm:.1f} mm, "
        "{berries_on_plate} grains on the plate"
    )
    example: ClassVar = {
        "funnel": {
            "berries": 150,
            "rate_per_s": 300.0,
            "duration_s": 4.0,
            "seeds": 2,
            "inlet_diameter_mm": 100.0,
            "outlet_diameter_mm": 60.0,
            "cone_angle_deg": 75.0,
            "tube_length_mm": 0.0,
            "rim_radius_mm": 1.0,
            "outlet_height_mm": 70.0,
            "plate_diameter_mm": 400.0,
            "factory_height_mm": 20.0,
            "factory_diameter_mm": 70.0,
            "orientation": "random",
            "rest_motion_mm": 1.0,
            "rest_window_s": 0.2,
        },
        "targets": [
            {"response": "aor_deg", "value": 20.0, "sd": 2.0, "repetitions": 10},
            {"response": "height_mm", "value": 30.0, "sd": 2.0, "repetitions": 10},
        ],
    }

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe the funnel and the plate as arguments of `repose.dem.Simulation`.

        The keys are the names of the arguments. The plate lies at z = 0. All lengths
        are in m.

        Parameters
        ----------
        scene : Scene
            The settings of the funnel.
        largest_radius_m : float
            Radius of a ball that contains the largest grain in any orientation.

        Returns
        -------
        dict
            ``capacity``, the largest number of grains; ``walls`` by name; ``lower`` and
            ``upper`` corner of the box; ``exit_height_m``, at which a grain leaves the
            funnel; ``curved_walls_above_m``, the height above which all curved walls
            lie; and ``floor_height_m``, below which a grain is removed.
        """
        section = self.section(scene.settings)
        funnel = section.funnel
        plate_radius = 0.5e-3 * section.plate_diameter_mm
        plate = dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", plate_radius)
        inlet_radius = 0.5 * funnel.inlet_diameter_m
        # The box leaves room for a grain at its sides, and for grains that appear above
        # the inlet.
        half_side = max(plate_radius, inlet_radius) + 2.0 * largest_radius_m
        box_height = funnel.inlet_height_m + 4.0 * largest_radius_m
        return {
            "capacity": section.berries,
            "walls": {"plate": plate, **funnel.walls("wall")},
            "lower": (-half_side, -half_side, 0.0),
            "upper": (half_side, half_side, box_height),
            "exit_height_m": funnel.outlet_height_m,
            "curved_walls_above_m": funnel.outlet_height_m - funnel.rim_radius_m,
            "floor_height_m": FLOOR_M,
        }

    def pour(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
        until_rest: bool = True,
    ) -> Pour:
        """Pour the grains through the funnel until the pile rests (paper, 3.1).

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the pour.
        interval_s : float, optional
            Simulated time between the frames of a film; without it none are recorded.
        progress : function, optional
            Called with the simulated time [s] whenever the simulation has advanced.
        until_rest : bool, optional
            Whether the pour ends as soon as the grains rest. If not, or if they never
            rest, it lasts for `funnel.duration_s`.

        Returns
        -------
        Pour
            The grains at the end of the pour.
        """
        start_s = time.perf_counter()
        section = self.section(scene.settings)
        simulation_settings = scene.simulation
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        simulation = trial.simulation
        factory = _make_factory(section, trial.largest_radius_m)

        last_step = simulation_settings.steps(section.duration_s)
        window_steps = simulation_settings.steps(section.rest_window_s)
        # The wall time of a step is measured over the last second of the pour.
        timing_start_step = last_step - simulation_settings.steps(1.0)
        timer = _StepTimer()
        # Positions of the grains at the checks of the last rest window. The deque drops
        # older ones, so that its first entry is always the beginning of the window: a
        # window has `CHECKS_PER_WINDOW` intervals, and one check more.
        position_history: deque[np.ndarray] = deque(maxlen=CHECKS_PER_WINDOW + 1)
        # `guard` ends this block without an error as soon as the run exceeds a limit of
        # speed, energy or overlap. The code below then describes the state at that
        # moment, and `trial.broken` holds the reason.
        with trial.bound(factory.area.height_m).guard():
            # `fill` adds the grains. The last grain must appear a whole rest window
            # before the end.
            fill(trial, factory, last_step - window_steps)
            timer.start(simulation.steps)
            for step in _yield_check_steps(simulation.steps, last_step, window_steps):
                trial.run_to(step)
                # Until the last second begins, each check restarts the timer.
                if step <= timing_start_step:
                    timer.start(step)
                position_history.append(simulation.positions.copy())
                if until_rest and _is_pour_over(simulation, section, position_history):
                    break

        wall_time = _WallTime(
            wall_s=time.perf_counter() - start_s,
            us_per_step=timer.us_per_step(simulation.steps),
        )
        return _describe_final_state(
            trial,
            section.funnel.outlet_height_m,
            window_start_centres=position_history[0] if position_history else None,
            wall_time=wall_time,
        )

    def judge(self, outcome: Pour, settings: SceneSettings) -> Verdict:
        """Check a stable pour before its pile is measured, and return its status.

        Parameters
        ----------
        outcome : Pour
            The grains at the end of the pour.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict
            `OK`, or the status of the first check that fails: grains in the funnel or
            not poured (``jammed``), too many grains off the plate (``left_plate``),
            grains in motion (``not_at_rest``), or no pile (``no_flank``).
        """
        section = self.section(settings)
        n_grains = section.berries
        # `berries` is the configured number of grains. Grains that found no room above
        # the inlet were never added.
        n_waiting = n_grains - len(outcome.centres_m)
        if outcome.in_funnel or n_waiting > 0:
            return Verdict(
                "jammed",
                f"{outcome.in_funnel} grains are still in the funnel and {n_waiting} are "
                "not poured at the end",
            )
        # `LARGEST_LOSS` and `SMALLEST_PILE` are fractions.
        if outcome.off_plate > LARGEST_LOSS * n_grains:
            return Verdict(
                "left_plate", f"{outcome.off_plate} of {n_grains} grains left the plate"
            )

        motion_verdict = self._judge_motion(outcome, settings)
        if motion_verdict is not None:
            return motion_verdict

        # A pile whose grains lie apart has no flank.
        n_in_pile = int(outcome.in_pile.sum())
        n_on_plate = int(outcome.on_plate.sum())
        if n_in_pile < max(FEWEST_IN_PILE, SMALLEST_PILE * n_on_plate):
            return Verdict(
                "no_flank",
                f"{n_in_pile} of {n_on_plate} grains touch each other in the largest "
                f"pile; a pile needs at least {FEWEST_IN_PILE} grains and "
                f"{100 * SMALLEST_PILE:g} % of those on the plate",
            )
        return OK

    def _judge_motion(self, outcome: Pour, settings: SceneSettings) -> Verdict | None:
        """Check whether the pile rests, by the energy and the motion of its grains.

        Parameters
        ----------
        outcome : Pour
            The grains at the end of the pour.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict or None
            The status ``not_at_rest`` with its reason; None if the pile rests.
        """
        section = self.section(settings)
        n_in_pile = int(outcome.in_pile.sum())
        # The kinetic energy in the outcome is that of the grains in the pile.
        mean_energy_j = outcome.kinetic_energy_j / max(1, n_in_pile)
        energy_verdict = not_at_rest(mean_energy_j, settings, advice=MORE_TIME_ADVICE)
        if energy_verdict is not None:
            return energy_verdict
        motion_mm = 1e3 * outcome.largest_motion_m
        if motion_mm > section.rest_motion_mm:
            return Verdict(
                "not_at_rest",
                f"a grain moved by {format_significant(motion_mm, 3)} mm in the last "
                f"{format_significant(section.rest_window_s)} s, more than "
                f"{format_significant(section.rest_motion_mm)} mm; "
                f"{MORE_TIME_ADVICE}",
            )
        return None

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Pour once, and check the pour before its pile is measured.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        interval_s : float, optional
            Simulated time between the frames of a film; without it none are recorded.
        progress : function, optional
            Called with the simulated time [s] whenever the simulation has advanced.

        Returns
        -------
        Run
            The arrays are ``position`` (N, 3) [m], ``quaternion`` (N, 4), ``scale``
            (N,) and ``in_pile`` (N,), the mask of the grains in the pile.
        """
        pour = self.pour(scene, interval_s, progress)
        arrays = grain_arrays(
            pour.centres_m, pour.quaternions, pour.scales, in_pile=pour.in_pile
        )
        return self.make_run(
            scene,
            pour,
            arrays,
            pour.frames,
            discharge_s=pour.discharge_s,
            berries_on_plate=int(pour.on_plate.sum()),
            berries_in_pile=int(pour.in_pile.sum()),
            berries_off_plate=pour.off_plate,
            kinetic_energy_J=pour.kinetic_energy_j,
        )

    def measure(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Measure the pile of a run, and add the numbers to its record.

        Parameters
        ----------
        record : mapping
            The record of the run: seed, status, reason and the numbers of `run`.
        arrays : mapping
            The arrays of the pour by name, as `run` returns them.
        scene : Scene
            Settings, parameters, grain and seed of the pour.

        Returns
        -------
        dict
            The record with the `BASIC_NUMBERS` and all other responses that are
            targets. They are None in a run that is not ``ok``. If a target cannot be
            measured, the status and the reason change.
        """
        settings = scene.settings
        targets = self.target_responses(settings.config)
        computed_targets = [target for target in targets if target.computed_from]
        extra_names = _list_extra_numbers(targets, record)

        # The results become the columns of a table, in the order of these three dicts:
        # first seed, status and reason, then the responses, then the other numbers of
        # the record. A response is None until it is measured.
        verdict = {key: record[key] for key in ("seed", "status", "reason")}
        responses: dict[str, Any] = dict.fromkeys((*BASIC_NUMBERS, *extra_names))
        for target in computed_targets:
            responses[target.name] = None
        other_numbers = {
            key: number for key, number in record.items() if key not in verdict
        }
        if record["status"] != "ok":
            return verdict | responses | other_numbers

        pile_numbers, reasons = self._measure_pile(arrays, scene, extra_names)
        responses |= pile_numbers
        # Some targets are responses that are computed from other numbers
        # (`computed_from`). These numbers are in the record, or were measured just now.
        known_numbers = {**record, **responses}
        for target in computed_targets:
            responses[target.name] = target.of(known_numbers)
        # If a target has no number, this gives the run another status. Otherwise
        # nothing changes.
        verdict |= self.check_targets({**record, **responses}, settings, reasons)
        return verdict | responses | other_numbers

    def _measure_pile(
        self, arrays: Arrays, scene: Scene, extra_names: Sequence[str]
    ) -> tuple[dict[str, Any], dict[str, str]]:
        """Measure a pile from its silhouette and from the positions of its grains.

        Parameters
        ----------
        arrays : mapping
            Arrays of the pour by name.
        scene : Scene
            Settings, parameters, grain and seed of the pour.
        extra_names : sequence of str
            Names of numbers to measure in addition to the `BASIC_NUMBERS`.

        Returns
        -------
        numbers : dict
            The numbers by name. A number that cannot be measured is None.
        reasons : dict
            The reason why a number cannot be measured, by the name of the number.
        """
        from repose.measure.saved_piles import pile_responses

        plate_mm = self.section(scene.settings).plate_diameter_mm
        return pile_responses(
            arrays, scene.particle, scene.measure, plate_mm, extra_names
        )

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a pour [s]."""
        return self.section(settings).duration_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield settings with which a funnel cannot be built, or a pour cannot end.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.

        Yields
        ------
        tuple of str
            A key of the configuration, and the values that are allowed for it.
        """
        section = self.section(settings)
        window_s = section.rest_window_s
        # The checks for rest in a window must lie at different time steps.
        if settings.simulation.time_step_s > window_s / 2:
            yield (
                "simulation.time_step_s",
                f"at most half of funnel.rest_window_s, {window_s:g}",
            )

        # The grains must appear above the inlet, in a disc that the `factory_...` keys
        # describe, and fall onto the plate.
        yield from find_impossible_surfaces(section, NAME)
        if section.factory_diameter_mm > section.inlet_diameter_mm:
            yield (
                "funnel.factory_diameter_mm",
                f"at most funnel.inlet_diameter_mm, {section.inlet_diameter_mm:g}",
            )
        if section.plate_diameter_mm < section.outlet_diameter_mm:
            yield (
                "funnel.plate_diameter_mm",
                f"at least funnel.outlet_diameter_mm, {section.outlet_diameter_mm:g}",
            )

        # The pile is observed for a whole rest window after the last grain has
        # appeared.
        if window_s >= section.duration_s:
            yield (
                "funnel.rest_window_s",
                f"below funnel.duration_s, {section.duration_s:g}",
            )
        last_grain_s = last_berry_s(section)
        if last_grain_s >= section.duration_s - window_s:
            yield (
                "funnel.duration_s",
                f"above {last_grain_s + window_s:g}: the last grain appears at "
                f"{last_grain_s:g} s",
            )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield keys of openings that are too narrow for the mean grain.

        `axes_mm` are the full axes of the mean grain, the longest first. A grain can
        pass the outlet along its longest axis, but appears in any orientation.
        """
        longest_mm, _, shortest_mm = axes_mm
        sizes_mm = {
            "outlet_diameter_mm": shortest_mm,
            "factory_diameter_mm": longest_mm,
        }
        return find_narrow_openings(self.section(settings), NAME, sizes_mm)


def _list_extra_numbers(
    targets: Sequence[Response], record: Mapping[str, Any]
) -> list[str]:
    """List the numbers that targets need beyond those measured on every pile.

    Parameters
    ----------
    targets : sequence of Response
        Responses that are targets. A computed response needs the numbers from which it
        is computed.
    record : mapping
        The record of the run. The numbers in it need not be measured.

    Returns
    -------
    list of str
        The name of each number once, in the order of the targets.
    """
    extra_names: list[str] = []
    for target in targets:
        # A target that is not computed is itself a measured number.
        needed_names = target.computed_from or (target.name,)
        for name in needed_names:
            if name in BASIC_NUMBERS or name in record or name in extra_names:
                continue
            extra_names.append(name)
    return extra_names


def _yield_check_steps(
    first_step: int, last_step: int, window_steps: int
) -> Iterator[int]:
    """Yield the time steps at which rest is checked, up to the last time step.

    Parameters
    ----------
    first_step, last_step : int
        The checks lie between these time steps. The last check is at `last_step`. The
        first check comes less than one interval after `first_step`.
    window_steps : int
        Number of time steps in a rest window, which has `CHECKS_PER_WINDOW` checks.
    """
    interval = max(1, window_steps // CHECKS_PER_WINDOW)
    # The checks are counted back from the last time step, at which one must lie.
    n_intervals = (last_step - first_step) // interval
    yield from range(last_step - n_intervals * interval, last_step + 1, interval)
