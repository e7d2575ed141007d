"""The drum in steady turning: berries flow down the bed as fast as the drum lifts them; the angle of their surface.

Vessel, filling and the line through the surface are those of `repose.apparatus.drum`, which turns slowly until the bed
slips once. Here the drum turns faster, and the angle is the mean over a time in which the flow is steady. The same
filled drum may turn at several speeds, one after the other. The surface itself is a response, too: the profile on which
the bed covers a share of the frames, seen along the axis, as a camera before the cap averages it. The axis may be
tilted against the horizontal, as that of a kiln: the drum stays as it is, and gravity leans.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from repose.apparatus import drum
from repose.apparatus.bench_test import BenchTest, Config, Run, register
from repose.apparatus.factory import fill
from repose.apparatus.scene import Filmed
from repose.apparatus.settings import Rotating, SimulationSettings
from repose.core.profiles import Profile
from repose.core.responses import Response
from repose.core.runs import Recorded

if TYPE_CHECKING:
    from repose.particle.particle import Particle

NAME = "turning"
STATUSES = ("ok", "unstable", "lost", "no_surface")
SEEN = ("measure.mm_per_pixel", *(f"{NAME}.{key}" for key in ("angular_velocity_rad_s", "fit_share")))
RESPONSES = (Response("turning_deg", "deg", "drum, turning", "turning", NAME, -90.0, 90.0, SEEN),)
RECORDED = Recorded(means=("turning_deg",), single=("turning_deg",))
MOST_SPEEDS = 9  # a name of a response has one digit for it
NAMED = re.compile(r"turning(?:_([2-9]))?(?:_deg|_profile(?:_([1-9]))?_mm)")


PER_SPEED = ("angular_velocity_rad_s", "measure_from_s", "measure_until_s")


def _one_each(low: float, high: float) -> Any:
    """The allowed values as text: a number, or a list with a number for each speed."""
    return Field(description=f"a number from {low:g} to {high:g}, or a list of one for each speed")


Speed = Annotated[float, Field(ge=1.0e-4, le=10)]
From = Annotated[float, Field(ge=0, le=600)]
Until = Annotated[float, Field(ge=0.1, le=600)]
_list = Field(strict=False, min_length=1, max_length=MOST_SPEEDS)


class Settings(Rotating):
    """The section `turning` of the configuration; config/README.md explains its keys."""

    angular_velocity_rad_s: Speed | Annotated[tuple[Speed, ...], _list] = _one_each(1.0e-4, 10)  # type: ignore[assignment]
    measure_from_s: From | Annotated[tuple[From, ...], _list] = _one_each(0, 600)
    measure_until_s: Until | Annotated[tuple[Until, ...], _list] = _one_each(0.1, 600)
    tilt_deg: float = Field(default=0.0, ge=0, le=45)


def further_response(name: str) -> Response | None:
    """The angle at the second speed and so on, or a score of the profile at a speed, by its name; None for another."""
    found = NAMED.fullmatch(name)
    if found is None or (found[2] is None and name.endswith("_mm")):
        return None
    words, symbol = ("", "") if found[1] is None else (f", speed {found[1]}", f" {found[1]}")
    if found[2] is None:
        return Response(name, "deg", f"drum, turning{words}", f"turning{symbol}", NAME, -90.0, 90.0, SEEN)
    label = f"drum, turning{words}, profile, score {found[2]}"
    profile = name.replace(f"_profile_{found[2]}_", "_profile_")
    seen = tuple(key for key in SEEN if key != f"{NAME}.fit_share")
    return Response(
        name, "mm", label, f"profile{symbol} {found[2]}", NAME, -np.inf, np.inf, seen, profile=profile
    )


def speeds(config: Config) -> list[tuple[float, float, float]]:
    """Of each speed the angular velocity [rad/s], and the times between which its surface is measured [s]."""
    section = config[NAME]
    rows = [np.atleast_1d(section[key]).tolist() for key in PER_SPEED]
    return list(zip(*(row * len(rows[0]) if len(row) == 1 else row for row in rows), strict=True))


def speed_of(name: str) -> int:
    """The speed of a response by its name, from 0."""
    found = NAMED.fullmatch(name)
    return 0 if found is None or found[1] is None else int(found[1]) - 1


def contradictions(config: Config) -> Iterator[tuple[str, str]]:
    """Keys of a drum that cannot run, and the allowed values."""
    yield from drum.impossible_filling(config, NAME)
    section, targets = config[NAME], config.get("targets")
    count = np.size(section[PER_SPEED[0]])
    for key in PER_SPEED[1:]:
        if np.ndim(section[key]) and np.size(section[key]) != count:
            yield f"{NAME}.{key}", f"a number, or one for each of {count} speeds"
            return
    for _, begin, end in speeds(config):
        earliest = begin + section["record_s"]
        if end < earliest:
            yield f"{NAME}.measure_until_s", f"at least {earliest:g}, or there is nothing to measure"
    radius_mm = 1e3 * drum.Drum.of(section).radius_m
    for k, target in enumerate(targets if isinstance(targets, list) else ()):  # they are checked elsewhere
        if not isinstance(target, Mapping) or target.get("apparatus") != NAME:
            continue
        if speed_of(target["response"]) >= count:
            yield f"targets.{k}.response", f"a response of one of {count} speeds ({NAME}.{PER_SPEED[0]})"
        if max(map(abs, target.get("profile", {}).get("x", [0.0]))) >= radius_mm:
            yield f"targets.{k}.profile.x", f"inside the drum, between -{radius_mm:g} and {radius_mm:g}"


def run(
    config: Config,
    parameters: Mapping[str, float],
    seed: int,
    particle: "Particle",
    berry: Mapping[str, Any],
    interval_s: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> Run:
    """Fill the drum, turn it at each speed, and keep the bed while the flow is steady.

    The arrays are ``time_s`` (T,), from the beginning of the rotation at a speed, not before `turning.measure_from_s`,
    and at these times ``position`` (T, N, 3) [m] and ``quaternion`` (T, N, 4); ``scale`` (N,); and with several speeds
    ``speed`` (T,), from 0.
    """
    section, settings = config[NAME], SimulationSettings.of(config)
    empty = drum.empty_drum(config, parameters, seed, particle, berry, NAME)
    simulation = empty.simulation
    filmed = Filmed(empty.bounded, interval_s, progress)
    time_s: list[float] = []
    centres: list[np.ndarray] = []
    turns: list[np.ndarray] = []
    numbers: list[int] = []
    with empty.bounded.guard():
        begin = settings.steps(section["rotate_from_s"])
        fill(simulation, empty.factory, section, seed, begin, filmed.run_to, empty.scales)
        filmed.run_to(begin)
        every = max(1, settings.steps(section["record_s"]))
        for number, (speed, first_s, last_s) in enumerate(speeds(config)):
            drum.set_rotation(simulation, speed)
            for step in range(every, settings.steps(last_s) + 1, every):
                filmed.run_to(begin + step)
                now = step * settings.time_step_s
                if now >= first_s:
                    time_s.append(now)
                    centres.append(simulation.positions.astype(np.float32))
                    turns.append(simulation.quaternions.astype(np.float32))
                    numbers.append(number)
            begin = simulation.steps
    status, reason = status_of(empty.holds_all(), empty.bounded.broken)
    arrays = {
        "time_s": np.array(time_s),
        "position": np.array(centres),
        "quaternion": np.array(turns),
        "scale": simulation.scales.astype(np.float32),
    }
    if len(speeds(config)) > 1:
        arrays["speed"] = np.array(numbers)
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
    """The record with the mean angle of the surface at each speed, and the scores of profiles that are targets."""
    of_profiles = {target["response"]: target["profile"] for target in config["targets"] if _is_score(target)}
    angles = [further_name(k) for k in range(len(speeds(config)))]
    missing = dict.fromkeys((*angles, *of_profiles))
    if record["status"] != "ok":
        return {**record, **missing}
    position, quaternion, scale = (np.asarray(arrays[key], float) for key in BENCH.kept)
    number = arrays.get("speed", np.zeros(len(position), int))
    found: dict[str, float] = {}
    for k, name in enumerate(angles):
        frames = position[number == k], quaternion[number == k], scale
        measured = drum.surface_angles(*frames, config, particle, NAME)
        if not len(measured) or not np.isfinite(measured).all():
            reason = drum.no_surface(config)
            return {**record, "status": "no_surface", "reason": reason, **missing}
        found[name] = float(measured.mean())
        own = {score: profile for score, profile in of_profiles.items() if speed_of(score) == k}
        found |= _scores(own, *frames, config, particle)
    return {**record, **found}


def _is_score(target):
    """Whether a target is a score of a profile of this bench test."""
    return target["apparatus"] == NAME and "profile" in target


def further_name(speed: int) -> str:
    """Name of the angle at a speed, from 0."""
    return "turning_deg" if speed == 0 else f"turning_{speed + 1}_deg"


def _scores(profiles, position, quaternion, scale, config, particle):
    """Scores of the mean surface of frames by their names; `profiles` has the profile of each."""
    from repose.measure import bed

    if not profiles:
        return {}
    radius, pixel = drum.Drum.of(config[NAME]).radius_m, config["measure"]["mm_per_pixel"]
    occupied = bed.occupied_share(position, quaternion, particle, radius, pixel, scale)
    found = {}
    for name, kept in profiles.items():
        x_m = 1e-3 * np.array(kept["x"])
        heights = 1e3 * bed.surface_heights(occupied, kept["covered"], x_m, radius, pixel)
        found[name] = Profile.of(kept).columns(heights)[name]
    return found


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
        duration_s=lambda config: config[NAME]["rotate_from_s"] + sum(end for *_, end in speeds(config)),
        contradictions=contradictions,
        misfits=partial(drum.misfits, section=NAME),
        measured_by=("fit_share",),
        kept=("position", "quaternion", "scale"),
        family=further_response,
        in_words="surface at {turning_deg:.1f} deg while the drum turns",
    )
)
