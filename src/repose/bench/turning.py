"""The drum in steady turning: grains flow down the bed as fast as the drum lifts them; the angle of their surface.

Vessel, filling and the line through the surface are those of `repose.bench.drum`, which turns slowly until the bed
slips once. Here the drum turns faster, and the angle is the mean over a time in which the flow is steady. The same
filled drum may turn at several speeds, one after the other. The surface itself is a response, too: the profile on which
the bed covers a share of the frames, seen along the axis, as a camera before the cap averages it. The axis may be
tilted against the horizontal, as that of a kiln: the drum stays as it is, and gravity leans.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from repose.bench import drum
from repose.bench.bench_test import (
    Arrays,
    Contradictions,
    Progress,
    Run,
    Scene,
    register,
)
from repose.bench.factory import fill
from repose.bench.settings import Rotating, SceneSettings
from repose.calibrate.profiles import Profile
from repose.calibrate.responses import Response

NAME = "turning"
SEEN = (
    "measure.mm_per_pixel",
    *(f"{NAME}.{key}" for key in ("angular_velocity_rad_s", "fit_share")),
)
MOST_SPEEDS = 9  # a name of a response has one digit for it
NAMED = re.compile(r"turning(?:_([2-9]))?(?:_deg|_profile(?:_([1-9]))?_mm)")


PER_SPEED = ("angular_velocity_rad_s", "measure_from_s", "measure_until_s")


def _one_each(low: float, high: float) -> Any:
    """Describe the allowed values: a number, or a list with a number for each speed."""
    return Field(
        description=f"a number from {low:g} to {high:g}, or a list of one for each speed"
    )


Speed = Annotated[float, Field(ge=1.0e-4, le=10)]
From = Annotated[float, Field(ge=0, le=600)]
Until = Annotated[float, Field(ge=0.1, le=600)]
_list = Field(strict=False, min_length=1, max_length=MOST_SPEEDS)


class TurningSettings(Rotating):
    """The section `turning` of the configuration; config/README.md explains its keys."""

    angular_velocity_rad_s: Speed | Annotated[tuple[Speed, ...], _list] = _one_each(
        1.0e-4, 10
    )  # type: ignore[assignment]
    measure_from_s: From | Annotated[tuple[From, ...], _list] = _one_each(0, 600)
    measure_until_s: Until | Annotated[tuple[Until, ...], _list] = _one_each(0.1, 600)
    tilt_deg: float = Field(default=0.0, ge=0, le=45)


def speeds(section: TurningSettings) -> list[tuple[float, float, float]]:
    """Return for each speed the angular velocity [rad/s], and the times between which the surface is measured [s]."""
    rows = [np.atleast_1d(getattr(section, key)).tolist() for key in PER_SPEED]
    return list(
        zip(
            *(row * len(rows[0]) if len(row) == 1 else row for row in rows), strict=True
        )
    )


def speed_of(name: str) -> int:
    """Find the speed of a response by its name, from 0."""
    found = NAMED.fullmatch(name)
    return 0 if found is None or found[1] is None else int(found[1]) - 1


@register(NAME)
class TurningTest(drum.RotatingDrum[TurningSettings]):
    """A drum in steady turning."""

    settings = TurningSettings
    responses = (
        Response(
            "turning_deg", "deg", "drum, turning", "turning", NAME, -90.0, 90.0, SEEN
        ),
    )
    statuses = ("ok", "unstable", "lost", "no_surface")
    measured_by = ("fit_share",)
    required_arrays = ("position", "quaternion", "scale")
    summary = "surface at {turning_deg:.1f} deg while the drum turns"

    def further_response(self, name: str) -> Response | None:
        """Return the angle at the second speed and so on, or a score of the profile at a speed."""
        found = NAMED.fullmatch(name)
        if found is None or (found[2] is None and name.endswith("_mm")):
            return None
        words, symbol = (
            ("", "") if found[1] is None else (f", speed {found[1]}", f" {found[1]}")
        )
        if found[2] is None:
            return Response(
                name,
                "deg",
                f"drum, turning{words}",
                f"turning{symbol}",
                NAME,
                -90.0,
                90.0,
                SEEN,
            )
        label = f"drum, turning{words}, profile, score {found[2]}"
        profile = name.replace(f"_profile_{found[2]}_", "_profile_")
        seen = tuple(key for key in SEEN if key != f"{NAME}.fit_share")
        return Response(
            name,
            "mm",
            label,
            f"profile{symbol} {found[2]}",
            NAME,
            -np.inf,
            np.inf,
            seen,
            profile=profile,
        )

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the drum, turn it at each speed, and keep the bed while the flow is steady.

        The arrays are ``time_s`` (T,), from the beginning of the rotation at a speed, not before
        `turning.measure_from_s`, and at these times ``position`` (T, N, 3) [m] and ``quaternion`` (T, N, 4); ``scale``
        (N,); and with several speeds ``speed`` (T,), from 0.
        """
        section, settings = self.section(scene.settings), scene.simulation
        trial, factory = self.empty_drum(scene, interval_s, progress)
        simulation = trial.simulation
        kept: dict[str, list[Any]] = {
            "time_s": [],
            "position": [],
            "quaternion": [],
            "speed": [],
        }
        with trial.bounded.guard():
            begin = settings.steps(section.rotate_from_s)
            fill(trial, factory, section, begin)
            trial.run_to(begin)
            every = max(1, settings.steps(section.record_s))
            for number, (speed, first_s, last_s) in enumerate(speeds(section)):
                drum.set_rotation(simulation, speed)
                for step in range(every, settings.steps(last_s) + 1, every):
                    trial.run_to(begin + step)
                    now = step * settings.time_step_s
                    if now >= first_s:
                        row = trial.grains() | {"time_s": now, "speed": number}
                        for key, values in kept.items():
                            values.append(row[key])
                begin = simulation.steps
        arrays = {
            key: np.array(kept[key]) for key in ("time_s", "position", "quaternion")
        }
        arrays["scale"] = simulation.scales.astype(np.float32)
        if len(speeds(section)) > 1:
            arrays["speed"] = np.array(kept["speed"])
        return self.ended(
            scene,
            drum.Turned(self.holds_all(trial), unstable=trial.broken),
            arrays,
            trial.frames(),
        )

    def measure(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Return the record with the mean angle at each speed, and the scores of profiles that are targets."""
        targets = scene.settings.targets_of(NAME)
        of_profiles = {
            one["response"]: one["profile"] for one in targets if "profile" in one
        }
        further = range(2, len(speeds(self.section(scene.settings))) + 1)
        angles = ["turning_deg", *(f"turning_{number}_deg" for number in further)]
        missing = dict.fromkeys((*angles, *of_profiles))
        if record["status"] != "ok":
            return {**record, **missing}
        position, quaternion, scale = (
            np.asarray(arrays[key], float) for key in self.required_arrays
        )
        number = arrays.get("speed", np.zeros(len(position), int))
        found: dict[str, float] = {}
        for k, name in enumerate(angles):
            frames = position[number == k], quaternion[number == k], scale
            measured = self.surface_angles(*frames, scene)
            if not len(measured) or not np.isfinite(measured).all():
                return {
                    **record,
                    "status": "no_surface",
                    "reason": drum.no_surface(scene),
                    **missing,
                }
            found[name] = float(measured.mean())
            own = {
                score: profile
                for score, profile in of_profiles.items()
                if speed_of(score) == k
            }
            found |= self._scores(own, frames, scene)
        return {**record, **found}

    def _scores(
        self,
        profiles: Mapping[str, Mapping[str, Any]],
        frames: tuple[np.ndarray, ...],
        scene: Scene,
    ) -> dict[str, float]:
        """Return scores of the mean surface of frames by their names; `profiles` has the profile of each."""
        from repose.measure import bed
        from repose.measure.silhouette import Grains

        if not profiles:
            return {}
        position, quaternion, scale = frames
        radius, pixel = (
            drum.Drum.of(self.section(scene.settings)).radius_m,
            scene.settings.mm_per_pixel,
        )
        grains = (
            Grains(*frame, scene.particle, scale)
            for frame in zip(position, quaternion, strict=True)
        )
        occupied = bed.occupied_share(grains, radius, pixel)
        found = {}
        for name, kept in profiles.items():
            x_m = 1e-3 * np.array(kept["x"])
            heights = 1e3 * bed.surface_heights(
                occupied, kept["covered"], x_m, radius, pixel
            )
            found[name] = Profile.of(kept).columns(heights)[name]
        return found

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        return section.rotate_from_s + sum(end for *_, end in speeds(section))

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield keys of a drum that cannot run, with the allowed values."""
        yield from self.impossible_filling(settings)
        section = self.section(settings)
        count = np.size(getattr(section, PER_SPEED[0]))
        for key in PER_SPEED[1:]:
            given = getattr(section, key)
            if np.ndim(given) and np.size(given) != count:
                yield f"{NAME}.{key}", f"a number, or one for each of {count} speeds"
                return
        for _, begin, end in speeds(section):
            earliest = begin + section.record_s
            if end < earliest:
                yield (
                    f"{NAME}.measure_until_s",
                    f"at least {earliest:g}, or there is nothing to measure",
                )
        radius_mm = 1e3 * drum.Drum.of(section).radius_m
        targets = settings.config.get("targets")
        for k, target in enumerate(
            targets if isinstance(targets, list) else ()
        ):  # they are checked elsewhere
            if not isinstance(target, Mapping) or target.get("apparatus") != NAME:
                continue
            if speed_of(target["response"]) >= count:
                yield (
                    f"targets.{k}.response",
                    f"a response of one of {count} speeds ({NAME}.{PER_SPEED[0]})",
                )
            if max(map(abs, target.get("profile", {}).get("x", [0.0]))) >= radius_mm:
                yield (
                    f"targets.{k}.profile.x",
                    f"inside the drum, between -{radius_mm:g} and {radius_mm:g}",
                )
