"""Bench test of a funnel with a lid: it is filled, opened, and the grains flow out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self

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
from repose.bench.factory import Disc, Factory, fill_and_rest, too_early
from repose.bench.hopper import Funnel, find_impossible_surfaces, find_narrow_openings
from repose.bench.scene import Scene
from repose.bench.settings import Hopper, SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.responses import Response
from repose.common.section import Contradictions

NAME = "discharge"
# Speed at which the lid moves down when it is removed.
LID_SPEED_M_S = 3.0
# A grain below this height is removed from the simulation.
FLOOR_M = -0.1
# The rate is measured between the times at which these fractions of the mass have left
# the funnel.
FIRST_MASS_SHARE = 0.2
LAST_MASS_SHARE = 0.8

# --- responses ------------------------------------------------------------------------

VESSEL_KEYS = (
    "discharge.berries",
    "discharge.inlet_diameter_mm",
    "discharge.outlet_diameter_mm",
    "discharge.cone_angle_deg",
    "discharge.tube_length_mm",
)
EMPTYING = Response(
    name="emptying_s",
    unit="s",
    label="time to empty",
    symbol="time",
    apparatus=NAME,
    low=0.0,
    high=1e4,
    definition=VESSEL_KEYS,
)
FLOW = Response(
    name="flow_g_s",
    unit="g/s",
    label="rate of discharge",
    symbol="rate",
    apparatus=NAME,
    low=0.0,
    high=1e6,
    definition=VESSEL_KEYS,
)

# --- section of the configuration -----------------------------------------------------


class DischargeSettings(Hopper):
    """The section `discharge` of the configuration; see config/README.md."""

    open_from_s: float = Field(
        ge=0.1,
        le=600,
        description="the lid is taken away at this time, or later if the grains move",
    )
    longest_s: float = Field(
        ge=0.1,
        le=600,
        description="a funnel that is not empty after this time is jammed",
    )
    collar_mm: float = Field(
        ge=1,
        le=5000,
        description="a cylinder as wide as the inlet goes on above it by this length; "
        "grains appear at its upper end",
    )
    speed_m_s: float = Field(
        ge=0,
        le=10,
        description="speed of a grain where it appears, down",
    )

    @property
    def funnel(self) -> Funnel:
        """The inner surfaces of the funnel, its outlet at z = 0."""
        return Funnel.of(self, outlet_height_mm=0.0)

    @property
    def top_m(self) -> float:
        """Upper end of the collar, where grains appear [m]."""
        return self.funnel.inlet_height_m + 1e-3 * self.collar_mm


# --- run ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Discharge(Outcome):
    """The outcome of a run in which a funnel was filled and opened."""

    n_filled: int  # grains that found room in the funnel
    rest_energy_j: float  # mean energy of a grain when the lid was removed
    n_early: int  # grains that left the funnel before the lid was removed
    n_late: int  # grains that left the funnel after that


class _Opening(NamedTuple):
    """The closed funnel at the moment at which its lid is removed."""

    time_s: float  # since the beginning of the run
    energy_j: float  # mean kinetic energy of a grain
    n_early: int  # grains that have left the funnel already
    grains: dict[str, np.ndarray]  # arrays of `Trial.grains`

    @classmethod
    def from_trial(cls, trial: Trial) -> Self:
        """Describe the present state of the funnel."""
        simulation = trial.simulation
        return cls(
            time_s=simulation.time_s,
            energy_j=trial.energy_j(),
            n_early=int(np.isfinite(simulation.exit_times_s).sum()),
            grains=trial.grains(),
        )

    @classmethod
    def never_opened(cls, trial: Trial) -> Self:
        """Describe a funnel that was never opened: time and energy are NaN."""
        return cls(time_s=math.nan, energy_j=math.nan, n_early=0, grains=trial.grains())


def _make_factory(section: DischargeSettings, grain_radius_m: float) -> Factory:
    """Make the source of grains at the upper end of the collar.

    A new grain with the bounding radius `grain_radius_m` does not touch the wall.
    """
    radius_m = 0.5 * section.funnel.inlet_diameter_m - grain_radius_m
    return Factory(
        Disc(radius_m, section.top_m),
        section.berries,
        section.rate_per_s,
        speed_m_s=section.speed_m_s,
    )


def compute_mass_flow_kg_s(exit_s: np.ndarray, mass_kg: np.ndarray) -> float:
    """Compute the mass flow in the middle of a discharge.

    The beginning and the end are left out because the flow is not steady there.

    Parameters
    ----------
    exit_s, mass_kg : array
        Exit times (N,) and masses (N,) of the grains, in any order.

    Returns
    -------
    float
        The mean flow [kg/s] between the times at which the fractions `FIRST_MASS_SHARE`
        and `LAST_MASS_SHARE` of the mass have left. It is NaN if both times are the
        same.
    """
    order = np.argsort(exit_s, kind="stable")
    sorted_exit_s = exit_s[order]
    # For each grain, the mass of all grains that left up to this one
    mass_out_kg = np.cumsum(mass_kg[order])
    total_kg = mass_out_kg[-1]
    # Find the grains whose exit brings the sum to these fractions of the mass.
    limits_kg = [FIRST_MASS_SHARE * total_kg, LAST_MASS_SHARE * total_kg]
    first, last = np.searchsorted(mass_out_kg, limits_kg)
    duration_s = sorted_exit_s[last] - sorted_exit_s[first]
    # This condition also rejects a duration that is NaN.
    if not duration_s > 0.0:
        return math.nan
    return float((mass_out_kg[last] - mass_out_kg[first]) / duration_s)


@register(NAME)
class DischargeTest(BenchTest[DischargeSettings]):
    """A funnel that is filled, opened and runs empty."""

    settings = DischargeSettings
    responses = (EMPTYING, FLOW)
    statuses = ("ok", "unstable", "lost", "not_filled", "not_at_rest", "jammed")
    required_arrays = ("exit_s", "scale")
    summary = "empty {emptying_s:.2f} s after the opening; rate {flow_g_s:.0f} g/s"
    example: ClassVar = {
        "discharge": {
            "berries": 120,
            "rate_per_s": 300.0,
            "open_from_s": 1.0,
            "longest_s": 3.0,
            "seeds": 2,
            "inlet_diameter_mm": 100.0,
            "outlet_diameter_mm": 60.0,
            "cone_angle_deg": 60.0,
            "tube_length_mm": 0.0,
            "rim_radius_mm": 1.0,
            "collar_mm": 60.0,
            "speed_m_s": 1.0,
        },
        "targets": [
            {"response": "emptying_s", "value": 1.0, "sd": 0.05, "repetitions": 10}
        ],
    }

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe the closed funnel as arguments of `repose.dem.Simulation`.

        The keys are the names of the arguments. The outlet lies at z = 0. The collar is
        a vertical wall above the inlet. All lengths are in m.

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
        up = (0.0, 0.0, 1.0)
        outlet = (0.0, 0.0, 0.0)
        lid = dem.Plane(outlet, up, "wall", 0.5 * funnel.outlet_diameter_m)

        # The wall of the collar is longer than configured, so that it also surrounds
        # the grains that appear at the top of the collar.
        inlet = (0.0, 0.0, funnel.inlet_height_m)
        inlet_radius = 0.5 * funnel.inlet_diameter_m
        grain_room = 2.0 * largest_radius_m
        collar_height = section.top_m - funnel.inlet_height_m + grain_room
        collar = dem.Cylinder(inlet, up, collar_height, inlet_radius, "wall")
        # The centre line of the rounded edge of the outlet lies at z = 0, so the edge
        # reaches down to minus its radius. It is the lowest of the curved walls.
        return {
            "capacity": section.berries,
            "walls": {"lid": lid, **funnel.walls("wall"), "collar": collar},
            "lower": (-inlet_radius, -inlet_radius, FLOOR_M),
            "upper": (inlet_radius, inlet_radius, section.top_m + grain_room),
            "exit_height_m": 0.0,
            "curved_walls_above_m": -funnel.rim_radius_m,
            "floor_height_m": FLOOR_M,
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the closed funnel, let the grains rest, open it, and let them flow out.

        The run ends when the funnel is empty, or `discharge.longest_s` after the
        opening.

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
            The arrays are ``exit_s`` (N,), the time [s] from the opening until each
            grain left, which is NaN for a grain that did not leave; the relative sizes
            ``scale`` (N,); and ``position`` (N, 3) [m] and ``quaternion`` (N, 4) at the
            opening.
        """
        section = self.section(scene.settings)
        simulation_settings = scene.simulation
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        simulation = trial.simulation
        factory = _make_factory(section, trial.largest_radius_m)

        def is_empty() -> bool:
            # A grain in the funnel has no finite exit time.
            return bool(np.isfinite(simulation.exit_times_s).all())

        # Number of time steps between two checks of the grains
        check_interval = max(1, simulation_settings.steps(scene.scale.interval_s()))
        fastest_m_s = max(LID_SPEED_M_S, section.speed_m_s)
        # `guard` ends the block below without an error as soon as the run exceeds a
        # limit. If that happens before the opening, `opening` remains None.
        opening = None
        with trial.bound(section.top_m, fastest_m_s).guard():
            fill_and_rest(trial, factory, section.open_from_s, check_interval)
            opening = _Opening.from_trial(trial)
            # To open the funnel, the lid moves down and away from the outlet.
            simulation.set_motion(
                "lid", dem.Motion(velocity_m_s=(0.0, 0.0, -LID_SPEED_M_S))
            )
            last_step = simulation.steps + simulation_settings.steps(section.longest_s)
            trial.wait(is_empty, last_step, check_interval)
        if opening is None:
            # The run ended before the opening, so it is rejected as unstable and not
            # measured.
            opening = _Opening.never_opened(trial)
        return self._collect_run(trial, opening)

    def _collect_run(self, trial: Trial, opening: _Opening) -> Run:
        """Collect the outcome and the arrays of a trial that has ended.

        Parameters
        ----------
        trial : Trial
            The trial.
        opening : _Opening
            The funnel when its lid was removed.
        """
        simulation = trial.simulation
        # Exit times count from the opening. Grains that left before it have a negative
        # time. The time of grains that did not leave is not finite.
        exit_s = simulation.exit_times_s - opening.time_s
        has_left = np.isfinite(exit_s)
        outcome = Discharge(
            n_filled=simulation.n_bodies,
            rest_energy_j=opening.energy_j,
            n_early=opening.n_early,
            n_late=int(has_left.sum()) - opening.n_early,
            unstable=trial.broken,
            overlap_share=trial.overlap_share,
        )
        arrays = {
            "exit_s": np.where(has_left, exit_s, np.nan),
            "scale": opening.grains["scale"],
        }
        return self.make_run(
            trial.scene,
            outcome,
            arrays | opening.grains,
            trial.frames(),
            opened_s=opening.time_s,
            berries_out=outcome.n_late,
        )

    def judge(self, outcome: Discharge, settings: SceneSettings) -> Verdict:
        """Check a stable run before it is measured, and return its status.

        Parameters
        ----------
        outcome : Discharge
            The grains that were filled in and that left.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict
            `OK`, or the status of the first check that fails: fewer grains than
            configured (``not_filled``), grains that left the closed funnel (``lost``),
            motion before the opening (``not_at_rest``), or grains that stay in the
            funnel (``jammed``).
        """
        section = self.section(settings)
        # `berries` is the configured number of grains. Grains without room were never
        # added.
        if outcome.n_filled < section.berries:
            return Verdict(
                "not_filled",
                f"only {outcome.n_filled} of {section.berries} grains found room in the "
                "funnel",
            )
        if outcome.n_early:
            return Verdict("lost", f"{outcome.n_early} grains left the closed funnel")
        motion_verdict = not_at_rest(
            outcome.rest_energy_j,
            settings,
            advice="remove the lid later by discharge.open_from_s",
            when=" when the lid was removed",
        )
        if motion_verdict is not None:
            return motion_verdict
        # `n_late` grains left the funnel after the opening.
        n_remaining = section.berries - outcome.n_late
        if n_remaining > 0:
            return Verdict(
                "jammed",
                f"{n_remaining} grains are still in the funnel {section.longest_s:g} s "
                "after the opening",
            )
        return OK

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the time in which the funnel empties, and the mass flow in g/s.

        The mass flow is None if it is unknown.
        """
        exit_s = np.asarray(arrays["exit_s"], float)
        # Mass is proportional to the cube of the relative size.
        masses = scene.particle.mass_kg * np.asarray(arrays["scale"], float) ** 3
        rate = compute_mass_flow_kg_s(exit_s, masses)
        return {
            EMPTYING.name: float(exit_s.max()),
            FLOW.name: None if math.isnan(rate) else 1e3 * rate,
        }

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        return section.open_from_s + section.longest_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield settings with which the funnel cannot be built or filled."""
        section = self.section(settings)
        yield from find_impossible_surfaces(section, NAME)
        yield from too_early(section, NAME, "open_from_s")

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
            "inlet_diameter_mm": longest_mm,
        }
        return find_narrow_openings(self.section(settings), NAME, sizes_mm)
