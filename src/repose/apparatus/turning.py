"""The drum in steady turning: berries flow down the bed as fast as the drum lifts them; the angle of their surface.

Vessel, filling and the line through the surface are those of `repose.apparatus.drum`, which turns slowly until the bed
slips once. Here the drum turns faster, and the angle is the mean over a time in which the flow is steady.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from repose.apparatus import drum
from repose.apparatus.bench_test import BenchTest, Config, Run, register
from repose.apparatus.factory import fill
from repose.apparatus.scene import Filmed
from repose.apparatus.settings import Rotating, SimulationSettings
from repose.core.responses import Response
from repose.core.runs import Recorded

if TYPE_CHECKING:
    from repose.particle.particle import Particle

NAME = "turning"
STATUSES = ("ok", "unstable", "lost", "no_surface")
SEEN = ("measure.mm_per_pixel", *(f"{NAME}.{key}" for key in ("angular_velocity_rad_s", "fit_share")))
RESPONSES = (Response("turning_deg", "deg", "drum, turning", "turning", NAME, -90.0, 90.0, SEEN),)
RECORDED = Recorded(means=("turning_deg",), single=("turning_deg",))


class Settings(Rotating):
    """The section `turning` of the configuration; config/README.md explains its keys."""

    measure_from_s: float = Field(ge=0, le=600)
    measure_until_s: float = Field(ge=0.1, le=600)


def contradictions(config: Config) -> Iterator[tuple[str, str]]:
    """Keys of a drum that cannot run, and what is allowed."""
    yield from drum.impossible_filling(config, NAME)
    section = config[NAME]
    earliest = section["measure_from_s"] + section["record_s"]
    if section["measure_until_s"] < earliest:
        yield f"{NAME}.measure_until_s", f"at least {earliest:g}, or there is nothing to measure"


def run(
    config: Config,
    parameters: Mapping[str, float],
    seed: int,
    particle: "Particle",
    berry: Mapping[str, Any],
    interval_s: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> Run:
    """Fill the drum, turn it, and keep the bed while the flow is steady.

    The arrays are ``time_s`` (T,), from the beginning of the rotation, not before `turning.measure_from_s`, and at
    these times ``position`` (T, N, 3) [m] and ``quaternion`` (T, N, 4); and ``scale`` (N,).
    """
    section, settings = config[NAME], SimulationSettings.of(config)
    empty = drum.empty_drum(config, parameters, seed, particle, berry, NAME)
    simulation = empty.simulation
    filmed = Filmed(empty.bounded, interval_s, progress)
    time_s: list[float] = []
    centres: list[np.ndarray] = []
    turns: list[np.ndarray] = []
    with empty.bounded.guard():
        begin = settings.steps(section["rotate_from_s"])
        fill(simulation, empty.factory, section, seed, begin, filmed.run_to, empty.scales)
        filmed.run_to(begin)
        drum.set_rotation(simulation, section["angular_velocity_rad_s"])
        every = max(1, settings.steps(section["record_s"]))
        for step in range(every, settings.steps(section["measure_until_s"]) + 1, every):
            filmed.run_to(begin + step)
            now = step * settings.time_step_s
            if now >= section["measure_from_s"]:
                time_s.append(now)
                centres.append(simulation.positions.astype(np.float32))
                turns.append(simulation.quaternions.astype(np.float32))
    status, reason = status_of(empty.holds_all(), empty.bounded.broken)
    arrays = {
        "time_s": np.array(time_s),
        "position": np.array(centres),
        "quaternion": np.array(turns),
        "scale": simulation.scales.astype(np.float32),
    }
    return Run({"seed": int(seed), "status": status, "reason": reason}, arrays, filmed.frames())


def status_of(held: bool, unstable: str = "") -> tuple[str, str]:
    """Status and reason of a run before it is measured; unstable: the bound that it broke, if any."""
    if unstable:
        return "unstable", unstable
    if not held:
        return "lost", "a berry is missing, or outside the drum"
    return "ok", ""


def measure(
    record: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
    config: Config,
    particle: "Particle",
    berry: Mapping[str, Any],
) -> dict[str, Any]:
    """The record with the mean angle of the surface; None where the run is not ok, or the bed has no surface."""
    from repose.apparatus import drum_tables

    if record["status"] != "ok":
        return {**record, "turning_deg": None}
    position, quaternion, scale = (np.asarray(arrays[key], float) for key in BENCH.kept)
    angles = drum_tables.surface_angles(position, quaternion, scale, config, particle, NAME)
    if not len(angles) or not np.isfinite(angles).all():
        reason = drum_tables.no_surface(config)
        return {**record, "status": "no_surface", "reason": reason, "turning_deg": None}
    return {**record, "turning_deg": float(angles.mean())}


BENCH = register(
    BenchTest(
        name=NAME,
        responses=RESPONSES,
        recorded=RECORDED,
        statuses=STATUSES,
        settings=Settings,
        build=partial(drum.build, section=NAME),
        run=run,
        measure=measure,
        duration_s=lambda config: config[NAME]["rotate_from_s"] + config[NAME]["measure_until_s"],
        contradictions=contradictions,
        misfits=partial(drum.misfits, section=NAME),
        measured_by=("fit_share",),
        kept=("position", "quaternion", "scale"),
        in_words="surface at {turning_deg:.1f} deg while the drum turns",
    )
)
