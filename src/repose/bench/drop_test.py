"""The drop test: one grain falls on a plate; height and duration of its rebound give the coefficient of restitution.

A camera sees how high the grain rebounds: its centre leaves the plate with sqrt(2 g h). A microphone hears it touch the
plate twice: between the two sounds it flies for T, so it left with g T / 2. Either speed over that of the fall is a
restitution. Both are of the centre of mass: a grain that is no sphere turns after the hit, which takes some of the
energy, and touches again in another orientation. So do real ones, and both responses scatter with the orientation in
which the grain falls.

Real hits last microseconds. Here, where grains may be softened, T is the time of flight, without the hits themselves.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

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
from repose.bench.factory import add_above
from repose.bench.scene import Trial
from repose.bench.settings import SceneSettings
from repose.calibrate.responses import Response
from repose.common.section import Section, Seeds

NAME = "drop_test"
LOOK_S = 1e-3  # longest simulated time between two looks at the grain
HIT_S = 1.0  # longest duration of a hit
EACH = 10_000  # first time steps of a hit that are all looked at; then looks are 1 / EACH of the hit so far apart

# --- responses ------------------------------------------------------------------------------------

FALL = tuple(f"{NAME}.{key}" for key in ("surface", "height_mm", "orientation"))

# --- section of the configuration -----------------------------------------------------------------


class DropTestSettings(Section):
    """The section `drop_test` of the configuration; config/README.md explains its keys."""

    surface: Literal["wall", "berry"]
    height_mm: float = Field(ge=1, le=10000)
    orientation: Literal["random", "lying", "upright"]
    seeds: Seeds


# --- build and run --------------------------------------------------------------------------------


class _Follow:
    """Follows a grain above a plate: step by step where it may touch, in longer strides while it flies."""

    def __init__(self, trial: Trial) -> None:
        self.trial, self.simulation, self.settings = (
            trial,
            trial.simulation,
            trial.scene.simulation,
        )
        self.reach_m = float(trial.scales[0]) * trial.scene.particle.bounding_radius_m

    def touches(self) -> bool:
        """Return whether the grain touches the plate."""
        return len(self.simulation.wall_overlaps()[0]) > 0

    def fly(self) -> list[tuple[float, float]]:
        """Fly until the grain touches the plate; time and height of its centre on the way."""
        rows = [self._row()]
        while not self.touches():
            self.trial.run_to(self.simulation.steps + self._stride())
            rows.append(self._row())
        return rows

    def hit(self) -> bool:
        """Go on until the grain has left the plate; False where it does not."""
        began = now = self.simulation.steps
        last = began + self.settings.steps(HIT_S)
        while (touches := self.touches()) and now < last:
            self.trial.run_to(min(last, now + 1 + (now - began) // EACH))
            now = self.simulation.steps
        return not touches

    def _row(self) -> tuple[float, float]:
        return self.simulation.time_s, self.simulation.positions[0, 2]

    def _stride(self) -> int:
        """Time steps in half of the time until the ball around the grain reaches the plate."""
        gravity, up = self.settings.gravity_m_s2, self.simulation.velocities[0, 2]
        above = max(self.simulation.positions[0, 2] - self.reach_m, 0.0)
        until_s = (
            (up + math.sqrt(up**2 + 2.0 * gravity * above)) / gravity
            if above > 0.0
            else 0.0
        )
        return max(1, self.settings.steps(min(LOOK_S, 0.5 * until_s)))


@dataclass(frozen=True)
class Rebound(Ending):
    """A hit."""

    left: bool  # whether the grain left the plate again


@register(NAME)
class DropTest(BenchTest[DropTestSettings]):
    """A grain that falls on a plate and rebounds."""

    settings = DropTestSettings
    responses = (
        Response(
            "height_restitution",
            "",
            "restitution, by height",
            "e, height",
            NAME,
            0.0,
            1.0,
            FALL,
        ),
        Response(
            "sound_restitution",
            "",
            "restitution, by sound",
            "e, sound",
            NAME,
            0.0,
            1.0,
            FALL,
        ),
    )
    numbers = ("rebound_height_mm", "flight_s")
    statuses = ("ok", "unstable", "no_rebound")
    required_arrays = ("time_s", "height_m", "drop_m")
    summary = "restitution {height_restitution:.3f} by height, {sound_restitution:.3f} by sound"

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe the plate, and room for one grain above it."""
        section, half = self.section(scene.settings), 4.0 * reach_m
        return {
            "capacity": 1,
            "walls": {
                "plate": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), section.surface)
            },
            "lower": (-half, -half, 0.0),
            "upper": (half, half, 1e-3 * section.height_mm + 2.0 * reach_m),
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Drop one grain and follow it until it touches the plate for the second time.

        The arrays are ``time_s`` (T,) and ``height_m`` (T,), of its centre, from when the grain leaves the plate until
        it touches it again, and ``drop_m``, the height of its fall.
        """
        section, trial = (
            self.section(scene.settings),
            Trial(self.build, scene, 1, interval_s, progress),
        )
        height, follow = 1e-3 * section.height_mm, _Follow(trial)
        add_above(trial, section.orientation, height)
        rows: list[tuple[float, float]] = []
        with trial.bound(height + 2.0 * trial.reach_m).guard():
            follow.fly()
            if follow.hit():
                rows = follow.fly()
        times, heights = np.array(rows).reshape(-1, 2).T
        arrays = {"time_s": times, "height_m": heights, "drop_m": np.array([height])}
        return self.ended(
            scene,
            Rebound(bool(rows), unstable=trial.broken),
            arrays,
            trial.frames(walls=True),
        )

    def faults(self, ending: Rebound, settings: SceneSettings) -> Faults:
        """Judge a run before it is measured."""
        stays = f"the grain still touches the plate {HIT_S:g} s after it fell on it"
        return stated((not ending.left, "no_rebound", stays))

    def values(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure both restitutions."""
        time_s, height_m = (
            np.asarray(arrays["time_s"], float),
            np.asarray(arrays["height_m"], float),
        )
        drop, gravity = float(arrays["drop_m"][0]), scene.simulation.gravity_m_s2
        rebound, flight = (
            float(height_m.max() - height_m[0]),
            float(time_s[-1] - time_s[0]),
        )
        return {
            "height_restitution": math.sqrt(rebound / drop),
            "sound_restitution": 0.5
            * gravity
            * flight
            / math.sqrt(2.0 * gravity * drop),
            "rebound_height_mm": 1e3 * rebound,
            "flight_s": flight,
        }

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time: the fall, the hit, and a rebound to the height of the fall."""
        return (
            3.0
            * math.sqrt(
                2e-3
                * self.section(settings).height_mm
                / settings.simulation.gravity_m_s2
            )
            + HIT_S
        )

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Refuse a fall so short that it takes fewer than 100 time steps."""
        simulation = settings.simulation
        least = 0.5e3 * simulation.gravity_m_s2 * (100 * simulation.time_step_s) ** 2
        if self.section(settings).height_mm < least:
            yield (
                f"{NAME}.height_mm",
                f"at least {least:.3g}, or the fall takes fewer than 100 time steps",
            )
