"""The funnel with a lid: it is filled, the grains rest, the lid is taken away, and they flow out.

A stopwatch gives the time until the funnel is empty, a balance below it the rate. The rate is taken over the middle of
the discharge, where the flow has begun and the funnel still holds grains: it hardly depends on how high the grains
stand (Beverloo et al. 1961, Chem. Eng. Sci. 15, 260). An outlet of fewer than about five grains across jams.

The funnel is that of `repose.bench.funnel`, its outlet at z = 0, with a cylinder above its inlet. The lid
is a disc in the outlet. It is taken away downwards, faster than the grains fall, so that it drags none of them along.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from repose import dem
from repose.bench.bench_test import (
    Arrays,
    BenchTest,
    Contradictions,
    Ending,
    Faults,
    Progress,
    Run,
    Scene,
    register,
    stated,
)
from repose.bench.factory import Disc, fill_and_rest, too_early
from repose.bench.funnel import Funnel, impossible_surfaces, narrow_openings
from repose.bench.scene import Trial
from repose.bench.settings import Hopper, SceneSettings
from repose.calibrate.responses import Response

NAME = "discharge"
LID_M_S = 3.0  # of the lid when it is taken away
FLOOR_M = -0.1  # a grain below this height is gone
LOOK_S = 0.05  # simulated time between two looks whether the funnel is empty
# The rate is that between these shares of the mass.
FROM_SHARE, TO_SHARE = 0.2, 0.8

# --- responses ------------------------------------------------------------------------------------

VESSEL = tuple(
    f"{NAME}.{key}"
    for key in (
        "berries",
        "inlet_diameter_mm",
        "outlet_diameter_mm",
        "cone_angle_deg",
        "tube_length_mm",
    )
)

# --- section of the configuration -----------------------------------------------------------------


class DischargeSettings(Hopper):
    """The section `discharge` of the configuration; config/README.md explains its keys."""

    open_from_s: float = Field(ge=0.1, le=600)
    longest_s: float = Field(ge=0.1, le=600)
    collar_mm: float = Field(ge=1, le=5000)
    speed_m_s: float = Field(ge=0, le=10)


# --- build and run --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Discharge(Ending):
    """A funnel that was opened."""

    filled: int  # grains that found room in the funnel
    rest_energy_j: float  # mean of a grain when the lid was taken away
    early: int  # grains that were below the outlet before that
    late: int  # grains that have left after that


# --- measure --------------------------------------------------------------------------------------


def rate_kg_s(exit_s: np.ndarray, mass_kg: np.ndarray) -> float:
    """Mass flow from `FROM_SHARE` to `TO_SHARE` of all mass, of N bodies in any order; NaN if it took no time."""
    order = np.argsort(exit_s, kind="stable")
    when, mass = exit_s[order], np.cumsum(mass_kg[order])
    first, last = np.searchsorted(mass, [FROM_SHARE * mass[-1], TO_SHARE * mass[-1]])
    took = when[last] - when[first]
    return float((mass[last] - mass[first]) / took) if took > 0.0 else math.nan


@register(NAME)
class DischargeTest(BenchTest[DischargeSettings]):
    """A funnel that is filled, opened and runs empty."""

    settings = DischargeSettings
    responses = (
        Response("emptying_s", "s", "time to empty", "time", NAME, 0.0, 1e4, VESSEL),
        Response(
            "flow_g_s", "g/s", "rate of discharge", "rate", NAME, 0.0, 1e6, VESSEL
        ),
    )
    statuses = ("ok", "unstable", "lost", "not_filled", "not_at_rest", "jammed")
    required_arrays = ("exit_s", "scale")
    summary = "empty {emptying_s:.2f} s after the opening; rate {flow_g_s:.0f} g/s"

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe the closed funnel."""
        section = self.section(scene.settings)
        funnel, top = _funnel(section)
        radius, inlet, up = (
            0.5 * funnel.inlet_diameter_m,
            (0.0, 0.0, funnel.inlet_height_m),
            (0.0, 0.0, 1.0),
        )
        lid = dem.Plane((0.0, 0.0, 0.0), up, "wall", 0.5 * funnel.outlet_diameter_m)
        collar = dem.Cylinder(inlet, up, top - inlet[2] + 2.0 * reach_m, radius, "wall")
        return {
            "capacity": section.berries,
            "walls": {"lid": lid, **funnel.walls("wall"), "collar": collar},
            "lower": (-radius, -radius, FLOOR_M),
            "upper": (radius, radius, top + 2.0 * reach_m),
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
        """Fill the closed funnel, let the grains rest, open it, and wait until it is empty.

        The arrays are ``exit_s`` (N,), when each grain left after the opening [s], NaN where it did not; ``scale``
        (N,); and ``position`` (N, 3) [m] and ``quaternion`` (N, 4) when the lid was taken away.
        """
        section, settings = self.section(scene.settings), scene.simulation
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        simulation, every = trial.simulation, max(1, settings.steps(LOOK_S))
        funnel, top = _funnel(section)
        factory = Disc(0.5 * funnel.inlet_diameter_m - trial.reach_m, top)
        opened_s, energy, early, closed = math.nan, math.nan, 0, None
        with trial.bound(top, max(LID_M_S, section.speed_m_s)).guard():
            fill_and_rest(trial, factory, section, section.open_from_s, every)
            opened_s, energy, closed = (
                simulation.time_s,
                trial.energy_j(),
                trial.grains(),
            )
            early = int(np.isfinite(simulation.exit_times_s).sum())
            simulation.set_motion("lid", dem.Motion(velocity_m_s=(0.0, 0.0, -LID_M_S)))
            last = simulation.steps + settings.steps(section.longest_s)
            trial.wait(
                lambda: bool(np.isfinite(simulation.exit_times_s).all()), last, every
            )
        grains = closed or trial.grains()
        exits = simulation.exit_times_s - opened_s
        late = int(np.isfinite(exits).sum()) - early
        discharge = Discharge(
            simulation.n_bodies, energy, early, late, unstable=trial.broken
        )
        arrays = {
            "exit_s": np.where(np.isfinite(exits), exits, np.nan),
            "scale": grains["scale"],
            **grains,
        }
        return self.ended(
            scene,
            discharge,
            arrays,
            trial.frames(),
            opened_s=opened_s,
            berries_out=late,
        )

    def faults(self, ending: Discharge, settings: SceneSettings) -> Faults:
        """Judge a run before it is measured."""
        section = self.section(settings)
        few = (
            f"only {ending.filled} of {section.berries} grains find room in the funnel"
        )
        left = section.berries - ending.late
        return stated(
            (ending.filled < section.berries, "not_filled", few),
            (ending.early, "lost", f"{ending.early} grains left the closed funnel"),
            settings.simulation.not_at_rest(
                ending.rest_energy_j, " when the lid was taken away"
            ),
            (
                left > 0,
                "jammed",
                f"{left} grains are still in the funnel {section.longest_s:g} s after the opening",
            ),
        )

    def values(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure time and rate."""
        exits = np.asarray(arrays["exit_s"], float)
        rate = rate_kg_s(
            exits, scene.particle.mass_kg * np.asarray(arrays["scale"], float) ** 3
        )
        return {
            "emptying_s": float(exits.max()),
            "flow_g_s": None if math.isnan(rate) else 1e3 * rate,
        }

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        return section.open_from_s + section.longest_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield keys of a funnel that cannot be built or filled, with what is allowed."""
        section = self.section(settings)
        yield from impossible_surfaces(section, NAME)
        yield from too_early(section, NAME, "open_from_s")

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield keys of openings that are too narrow for the mean grain, with what is allowed."""
        sizes = {"outlet_diameter_mm": axes_mm[2], "inlet_diameter_mm": axes_mm[0]}
        return narrow_openings(self.section(settings), NAME, sizes)


def _funnel(section: DischargeSettings) -> tuple[Funnel, float]:
    """Return the funnel, its outlet at z = 0, and the height [m] at which grains appear."""
    funnel = Funnel.of(section, 0.0)
    return funnel, funnel.inlet_height_m + 1e-3 * section.collar_mm
