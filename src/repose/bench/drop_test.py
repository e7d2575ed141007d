"""The drop test: a grain falls on a plate, and its rebound gives the restitution.

A camera sees how high the grain rebounds: its centre leaves the plate with
sqrt(2 g h). A microphone hears it touch the plate twice: between the two sounds it flies
for T, so it left with g T / 2. Either speed over that of the fall is a restitution. Both
are of the centre of mass: a grain that is no sphere turns after the hit, which takes some
of the energy, and touches again in another orientation. So do real ones, and both
responses scatter with the orientation in which the grain falls.

Real hits last microseconds. Here, where grains may be softened, T is the time of flight,
without the hits themselves.
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
from repose.common.section import Contradictions, Section, Seeds

NAME = "drop_test"
# Longest time between two looks at the flying grain, in units of `GrainScale.time_s`.
STRIDE_TIMES = 0.027
# Longest duration of a hit.
LONGEST_HIT_S = 1.0
# Time steps of a hit that are all looked at; later looks are 1 / DENSE_STEPS of the hit apart.
DENSE_STEPS = 10_000
# Fewest time steps of a fall.
FEWEST_STEPS = 100

# Largest restitution that is measured. It may exceed 1: a hit without losses returns up
# to some percent too much (docs/verification.md), a grain that turned in its flight
# lands lower than it left, and the sounds are heard to a time step.
HIGHEST = 1.1

# --- responses ------------------------------------------------------------------------

FALL_KEYS = ("drop_test.surface", "drop_test.height_mm", "drop_test.orientation")
BY_HEIGHT = Response(
    name="height_restitution",
    unit="",
    label="restitution, by height",
    symbol="e, height",
    apparatus=NAME,
    low=0.0,
    high=HIGHEST,
    definition=FALL_KEYS,
)
BY_SOUND = Response(
    name="sound_restitution",
    unit="",
    label="restitution, by sound",
    symbol="e, sound",
    apparatus=NAME,
    low=0.0,
    high=HIGHEST,
    definition=FALL_KEYS,
)

# --- section of the configuration -----------------------------------------------------


class DropTestSettings(Section):
    """The section `drop_test` of the configuration; config/README.md explains its keys."""

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
    """Height of the grain's centre at a time."""

    time_s: float
    height_m: float


class _Tracker:
    """Advances a grain above a plate: in long strides while it flies, then in steps.

    Parameters
    ----------
    trial : Trial
        The plate and its grain.

    Attributes
    ----------
    overlap_share : float
        Largest overlap of the hits so far, over the smallest extent of the grain.
    """

    def __init__(self, trial: Trial) -> None:
        """Prepare to follow the grain; see the class."""
        self.trial = trial
        self.simulation = trial.simulation
        self.settings = trial.scene.simulation
        self.longest_stride_s = trial.scene.scale.interval_s(STRIDE_TIMES)
        scale = float(trial.scales[0])
        self.radius_m = scale * trial.scene.particle.bounding_radius_m
        self.overlap_share = 0.0

    def check_contact(self) -> bool:
        """Return whether the grain touches the plate.

        If it touches, `overlap_share` grows to its overlap.
        """
        grains, _walls, overlaps = self.simulation.wall_overlaps()
        scales = self.simulation.scales[grains]
        shares = self.trial.bounds.compute_overlap_shares(overlaps, scales)
        self.overlap_share = float(shares.max(initial=self.overlap_share))
        return len(grains) > 0

    def fly(self) -> list[_Height]:
        """Advance until the grain touches the plate; return its heights on the way."""
        heights = [self._read_height()]
        while not self.check_contact():
            self.trial.run_to(self.simulation.steps + self._choose_stride())
            heights.append(self._read_height())
        return heights

    def hit(self) -> bool:
        """Advance until the grain has left the plate.

        The number of time steps between two checks grows with the duration of the
        contact.

        Returns
        -------
        bool
            Whether the grain has left the plate within `LONGEST_HIT_S`.
        """
        simulation = self.simulation
        first_step = simulation.steps
        last_step = first_step + self.settings.steps(LONGEST_HIT_S)
        is_touching = self.check_contact()
        while is_touching and simulation.steps < last_step:
            contact_steps = simulation.steps - first_step
            stride = 1 + contact_steps // DENSE_STEPS
            self.trial.run_to(min(last_step, simulation.steps + stride))
            is_touching = self.check_contact()
        return not is_touching

    def _read_height(self) -> _Height:
        """Read the present height of the grain's centre."""
        return _Height(self.simulation.time_s, self.simulation.positions[0, 2])

    def _choose_stride(self) -> int:
        """Choose the number of time steps until the next check of the flying grain.

        They take half of the time until the bounding ball of the grain reaches the plate,
        but at most `longest_stride_s`. If the ball reaches the plate already, the result
        is one step.
        """
        gap_m = self.simulation.positions[0, 2] - self.radius_m
        if not gap_m > 0.0:
            return 1
        # The free flight of the ball: gap + up t - g t^2 / 2 = 0
        gravity = self.settings.gravity_m_s2
        up_speed = self.simulation.velocities[0, 2]
        root = math.sqrt(up_speed**2 + 2.0 * gravity * gap_m)
        flight_s = (up_speed + root) / gravity
        stride_s = min(self.longest_stride_s, 0.5 * flight_s)
        return max(1, self.settings.steps(stride_s))


@dataclass(frozen=True)
class Rebound(Outcome):
    """The outcome of a hit."""

    has_left: bool  # whether the grain left the plate again


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

        Parameters
        ----------
        scene : Scene
            The material of the plate, and the height of the fall.
        largest_radius_m : float
            Bounding radius of the grain.

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
            What the run depends on.
        interval_s : float, optional
            Simulated time between the frames of a film; without it none are recorded.
        progress : function, optional
            Called with the simulated time [s] after every advance.

        Returns
        -------
        Run
            The arrays are ``time_s`` (T,) and ``height_m`` (T,), of its centre, from
            when the grain leaves the plate until it touches it again; and ``drop_m``
            (1,), the height of its fall.
        """
        section = self.section(scene.settings)
        trial = Trial(self.build, scene, 1, interval_s, progress)
        drop_m = 1e-3 * section.height_mm
        add_above(trial, section.orientation, drop_m)
        tracker = _Tracker(trial)
        # Heights after the first hit; none if the grain does not leave the plate.
        rebound: list[_Height] = []
        with trial.bound(drop_m + 2.0 * trial.largest_radius_m).guard():
            tracker.fly()
            if tracker.hit():
                rebound = tracker.fly()
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
        """Judge a stable run before it is measured."""
        if not outcome.has_left:
            return Verdict(
                "no_rebound",
                f"the grain still touches the plate {LONGEST_HIT_S:g} s after it fell on it",
            )
        return OK

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the restitution by the rebound's height, and by the time of its flight.

        Both are the ratio of the speed after the contact to that before it.

        Parameters
        ----------
        arrays : mapping
            Arrays of the run by name, as from `run`.
        scene : Scene
            What the run depends on.

        Returns
        -------
        dict
            Both restitutions, the height of the rebound and the time of the flight.
        """
        time_s = np.asarray(arrays["time_s"], float)
        height_m = np.asarray(arrays["height_m"], float)
        drop_m = float(arrays["drop_m"][0])
        gravity = scene.simulation.gravity_m_s2
        # A speed goes with the root of the height that it reaches.
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

        It has the fall, the hit, and a rebound to the height of the fall.
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
                f"at least {lowest_mm:.3g}, or the fall takes fewer than "
                f"{FEWEST_STEPS} time steps",
            )
