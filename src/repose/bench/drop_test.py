"""The drop test: a grain falls on a plate, and its rebound gives the restitution.

There are two ways to measure it. A camera sees the height h to which the grain
rebounds, so the centre of the grain left the plate at the speed sqrt(2 g h). A
microphone hears the grain hit the plate twice. The grain flies for the time T between
the two sounds, so it left the plate at the speed g T / 2. The restitution is the ratio
of this speed to the speed at the end of the fall.

Both speeds are those of the centre of mass. A grain that is not a sphere, real or
simulated, rotates after the hit. The rotation takes up some of the energy, and the
grain hits the plate again in another orientation. Therefore both responses scatter with
the orientation in which the grain falls.

Real hits last microseconds. Hits in the simulation may last longer, because its grains
may be softer. T is therefore the time of the flight alone, without the hits.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple

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
    register,
)
from repose.bench.factory import add_above
from repose.bench.scene import Scene
from repose.bench.settings import SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.responses import Response
from repose.common.numbers import format_significant
from repose.common.section import Contradictions, Section, Seeds

NAME = "drop_test"
# Longest time between two checks of the flying grain, in units of `GrainScale.time_s`.
STRIDE_TIMES = 0.027
# Longest duration of a hit.
LONGEST_HIT_S = 1.0
# Number of time steps at the beginning of a hit that are all checked. Later, the
# interval between two checks is 1 / DENSE_STEPS of the time since the hit began.
DENSE_STEPS = 10_000
# Fewest time steps of a fall.
FEWEST_STEPS = 100

# Largest restitution that is accepted. It may exceed 1 for three reasons: a hit without
# losses returns up to a few percent too much energy (docs/verification.md), a grain
# that rotates in flight may land with its centre lower than it left, and the times of
# the sounds are known only to within a time step.
LARGEST_RESTITUTION = 1.1

# --- responses ------------------------------------------------------------------------

FALL_KEYS = ("drop_test.surface", "drop_test.height_mm", "drop_test.orientation")
BY_HEIGHT = Response(
    name="height_restitution",
    unit="",
    label="restitution, by height",
    symbol="e, height",
    apparatus=NAME,
    low=0.0,
    high=LARGEST_RESTITUTION,
    definition=FALL_KEYS,
)
BY_SOUND = Response(
    name="sound_restitution",
    unit="",
    label="restitution, by sound",
    symbol="e, sound",
    apparatus=NAME,
    low=0.0,
    high=LARGEST_RESTITUTION,
    definition=FALL_KEYS,
)

# --- section of the configuration -----------------------------------------------------


class DropTestSettings(Section):
    """The section `drop_test` of the configuration; see config/README.md."""

    surface: Literal["wall", "berry"] = Field(
        description="material of the plate: `wall`, or `berry`, a flat plate of the "
        "grains' own",
    )
    height_mm: float = Field(
        ge=1,
        le=10000,
        description="from the plate to the lowest point of the grain",
    )
    orientation: Literal["random", "lying", "upright"] = Field(
        description="of the falling grain: any, long axis level, long axis vertical",
    )
    seeds: Seeds = Field(
        description="runs of each sample",
    )


# --- run ------------------------------------------------------------------------------


class _Height(NamedTuple):
    """Height of the grain's centre above the plate at a time."""

    time_s: float
    height_m: float


class _GrainTracker:
    """Advances a grain above a plate, and finds the time of each hit.

    It checks the grain rarely while it flies, and often while it touches the plate.

    Parameters
    ----------
    trial : Trial
        The simulation of the plate and its only grain.

    Attributes
    ----------
    overlap_share : float
        Largest overlap of grain and plate so far, over the smallest extent of the
        grain.
    """

    def __init__(self, trial: Trial) -> None:
        """Prepare to follow the grain. The class documents the parameter."""
        self.trial = trial
        self.simulation = trial.simulation
        self.simulation_settings = trial.scene.simulation
        # Longest time between two checks of a flying grain
        self.longest_stride_s = trial.scene.scale.interval_s(STRIDE_TIMES)
        # The radius is that of the bounding sphere of this grain.
        scale = float(trial.scales[0])
        self.bounding_radius_m = scale * trial.scene.particle.bounding_radius_m
        self.overlap_share = 0.0

    def check_contact(self) -> bool:
        """Return whether the grain touches the plate.

        If the overlap is the largest so far, it is stored in `overlap_share`.
        """
        grains, _walls, overlaps = self.simulation.wall_overlaps()
        scales = self.simulation.scales[grains]
        shares = self.trial.bounds.compute_overlap_shares(overlaps, scales)
        self.overlap_share = float(shares.max(initial=self.overlap_share))
        return len(grains) > 0

    def follow_flight(self) -> list[_Height]:
        """Advance until the grain touches the plate, and return its heights."""
        heights = [self._read_height()]
        while not self.check_contact():
            self.trial.run_to(self.simulation.steps + self._choose_stride())
            heights.append(self._read_height())
        return heights

    def follow_hit(self) -> bool:
        """Advance until the grain has left the plate, for at most `LONGEST_HIT_S`.

        The number of time steps between two checks grows with the time since the hit
        began.

        Returns
        -------
        bool
            Whether the grain has left the plate in this time.
        """
        simulation = self.simulation
        first_step = simulation.steps
        last_step = first_step + self.simulation_settings.steps(LONGEST_HIT_S)
        is_touching = self.check_contact()
        while is_touching and simulation.steps < last_step:
            contact_steps = simulation.steps - first_step
            # A hit may be short, so its first checks come after single time steps.
            stride = 1 + contact_steps // DENSE_STEPS
            self.trial.run_to(min(last_step, simulation.steps + stride))
            is_touching = self.check_contact()
        return not is_touching

    def _read_height(self) -> _Height:
        """Read the present height of the grain's centre."""
        return _Height(self.simulation.time_s, self.simulation.positions[0, 2])

    def _choose_stride(self) -> int:
        """Choose the number of time steps until the next check of the flying grain.

        The stride lasts for half of the time until the bounding sphere of the grain
        reaches the plate, but at most for `longest_stride_s`. It is one time step if
        the sphere already reaches the plate.
        """
        gap_m = self.simulation.positions[0, 2] - self.bounding_radius_m
        if not gap_m > 0.0:
            return 1
        # The sphere reaches the plate at the time t with gap + up_speed t - g t^2 / 2 =
        # 0.
        gravity = self.simulation_settings.gravity_m_s2
        up_speed = self.simulation.velocities[0, 2]
        impact_speed = math.sqrt(up_speed**2 + 2.0 * gravity * gap_m)
        flight_s = (up_speed + impact_speed) / gravity
        stride_s = min(self.longest_stride_s, 0.5 * flight_s)
        return max(1, self.simulation_settings.steps(stride_s))


@dataclass(frozen=True)
class Rebound(Outcome):
    """The outcome of a run in which a grain hit the plate."""

    has_left: bool  # whether the grain left the plate after the hit


@register(NAME)
class DropTest(BenchTest[DropTestSettings]):
    """A grain that falls on a plate and rebounds."""

    settings = DropTestSettings
    responses = (BY_HEIGHT, BY_SOUND)
    numbers = ("rebound_height_mm", "flight_s")
    statuses = ("ok", "unstable", "no_rebound")
    required_arrays = ("time_s", "height_m", "drop_m")
    summary = (
        "restitution {height_restitution:.3f} by height, "
        "{sound_restitution:.3f} by sound"
    )
    example: ClassVar = {
        "drop_test": {
            "surface": "wall",
            "height_mm": 100.0,
            "orientation": "upright",
            "seeds": 2,
        },
        "targets": [
            {
                "response": "height_restitution",
                "value": 0.35,
                "sd": 0.05,
                "repetitions": 10,
            }
        ],
    }

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe the plate, and room for one grain above it.

        The keys are the names of arguments of `repose.dem.Simulation`. All lengths are
        in m.

        Parameters
        ----------
        scene : Scene
            The material of the plate, and the height of the fall.
        largest_radius_m : float
            Radius of a ball that contains the grain in any orientation.

        Returns
        -------
        dict
            Arguments of `repose.dem.Simulation`.
        """
        section = self.section(scene.settings)
        plate = dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), section.surface)
        half_side = 4.0 * largest_radius_m
        top = 1e-3 * section.height_mm + 2.0 * largest_radius_m
        return {
            "capacity": 1,
            "walls": {"plate": plate},
            "lower": (-half_side, -half_side, 0.0),
            "upper": (half_side, half_side, top),
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Drop one grain and follow it until it touches the plate for the second time.

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
            The arrays are ``time_s`` (T,) and ``height_m`` (T,), the heights of the
            grain's centre from the moment at which it leaves the plate until it touches
            the plate again; and ``drop_m`` (1,), the height of its fall.
        """
        section = self.section(scene.settings)
        trial = Trial(self.build, scene, 1, interval_s, progress)
        drop_m = 1e-3 * section.height_mm
        add_above(trial, section.orientation, drop_m)
        tracker = _GrainTracker(trial)
        # `guard` ends the block below without an error as soon as the run exceeds a
        # limit. `rebound` has the heights after the first hit. It remains empty in that
        # case, or if the grain does not leave the plate.
        rebound: list[_Height] = []
        with trial.bound(drop_m + 2.0 * trial.largest_radius_m).guard():
            tracker.follow_flight()
            if tracker.follow_hit():
                rebound = tracker.follow_flight()
        arrays = {
            "time_s": np.array([height.time_s for height in rebound]),
            "height_m": np.array([height.height_m for height in rebound]),
            "drop_m": np.array([drop_m]),
        }
        outcome = Rebound(
            has_left=bool(rebound),
            unstable=trial.broken,
            overlap_share=tracker.overlap_share,
        )
        return self.make_run(scene, outcome, arrays, trial.frames(walls=True))

    def judge(self, outcome: Rebound, settings: SceneSettings) -> Verdict:
        """Check that the grain left the plate after its first hit."""
        if not outcome.has_left:
            return Verdict(
                "no_rebound",
                f"the grain still touches the plate {LONGEST_HIT_S:g} s after its fall",
            )
        return OK

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the restitution by the height of the rebound and by its duration.

        Both are the ratio of the speed after the hit to that before it.

        Parameters
        ----------
        arrays : mapping
            Arrays of the run by name, as `run` returns them.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        dict
            Both restitutions, the height of the rebound and the time of the flight.
        """
        time_s = np.asarray(arrays["time_s"], float)
        height_m = np.asarray(arrays["height_m"], float)
        drop_m = float(arrays["drop_m"][0])
        gravity = scene.simulation.gravity_m_s2
        # A grain reaches a height h with the speed sqrt(2 g h).
        rebound_m = float(height_m.max() - height_m[0])
        # A grain that flies for a time T leaves with the speed g T / 2.
        flight_s = float(time_s[-1] - time_s[0])
        fall_speed = math.sqrt(2.0 * gravity * drop_m)
        return {
            BY_HEIGHT.name: math.sqrt(rebound_m / drop_m),
            BY_SOUND.name: 0.5 * gravity * flight_s / fall_speed,
            "rebound_height_mm": 1e3 * rebound_m,
            "flight_s": flight_s,
        }

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s].

        It consists of the fall, the hit, and a rebound up to the height of the fall.
        """
        height_mm = self.section(settings).height_mm
        fall_s = math.sqrt(2e-3 * height_mm / settings.simulation.gravity_m_s2)
        return 3.0 * fall_s + LONGEST_HIT_S

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield the height if the fall takes fewer than `FEWEST_STEPS` time steps."""
        simulation = settings.simulation
        shortest_s = FEWEST_STEPS * simulation.time_step_s
        lowest_mm = 0.5e3 * simulation.gravity_m_s2 * shortest_s**2
        if self.section(settings).height_mm < lowest_mm:
            yield (
                "drop_test.height_mm",
                f"at least {format_significant(lowest_mm, 3)}, or the fall takes fewer than "
                f"{FEWEST_STEPS} time steps",
            )
