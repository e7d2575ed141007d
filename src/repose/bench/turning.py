"""The drum in steady turning: the angle of the surface of a bed that flows.

Grains flow down the bed as fast as the drum lifts them. The vessel, its filling and the
line through the surface are the same as in `repose.bench.drum`, whose drum turns slowly
until the bed slips once. Here the drum turns faster, and the angle is the mean over a
time in which the flow is steady. The same filled drum may turn at several speeds, one
after the other.

The surface itself can be a response, too. It is the profile along which the bed covers
a given fraction of the frames in a view along the axis, as in the average picture of a
camera in front of the cap. The axis may be tilted against the horizontal, as in a kiln.
The drum of the simulation then stays level, and the direction of gravity is tilted
instead.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field

from repose.bench.bench_test import Arrays, Run, register
from repose.bench.drum import (
    Drum,
    DrumOutcome,
    RotatingDrum,
    make_no_surface_verdict,
    set_rotation,
)
from repose.bench.factory import fill
from repose.bench.scene import Scene
from repose.bench.settings import Rotating, SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.profiles import Profile
from repose.calibrate.responses import Response
from repose.common.section import Allowed, Contradictions

NAME = "turning"

# --- responses ------------------------------------------------------------------------

VIEW_KEYS = ("measure.mm_per_pixel", "turning.angular_velocity_rad_s")
# The name of a response has a single digit for the number of the speed.
MOST_SPEEDS = 9
# It matches turning_deg, turning_2_deg, turning_profile_1_mm, turning_2_profile_1_mm
# and names of whole profiles such as turning_profile_mm.
RESPONSE_NAME = re.compile(
    r"turning(?:_(?P<speed>[2-9]))?(?:_deg|_profile(?:_(?P<score>[1-9]))?_mm)"
)


def _make_angle_response(name: str, speed: str | None) -> Response:
    """Make the response of the angle at a speed.

    Parameters
    ----------
    name : str
        Name of the response.
    speed : str or None
        Number of the speed, from 2 on. None stands for the first speed, which has no
        number in names and labels.
    """
    return Response(
        name=name,
        unit="deg",
        label="drum, turning" + (f", speed {speed}" if speed else ""),
        symbol="turning" + (f" {speed}" if speed else ""),
        apparatus=NAME,
        low=-90.0,
        high=90.0,
        definition=(*VIEW_KEYS, "turning.fit_share"),
    )


def _make_score_response(name: str, speed: str | None, score: str) -> Response:
    """Make the response of a score of the profile at a speed.

    Parameters
    ----------
    name : str
        Name of the response.
    speed : str or None
        Number of the speed; see `_make_angle_response`.
    score : str
        Number of the score, from 1 on.
    """
    turning = "drum, turning" + (f", speed {speed}" if speed else "")
    return Response(
        name=name,
        unit="mm",
        label=f"{turning}, profile, score {score}",
        symbol="profile" + (f" {speed}" if speed else "") + f" {score}",
        apparatus=NAME,
        low=-np.inf,
        high=np.inf,
        definition=VIEW_KEYS,
        profile=name.replace(f"_profile_{score}_", "_profile_"),
    )


def find_speed_index(response_name: str) -> int:
    """Find the index, from 0, of the speed to which the name of a response belongs.

    Names without a number belong to the first speed, and so do names of other bench
    tests.
    """
    match = RESPONSE_NAME.fullmatch(response_name)
    if match is None or match["speed"] is None:
        return 0
    return int(match["speed"]) - 1


# --- section of the configuration -----------------------------------------------------


AngularVelocity = Annotated[float, Field(ge=1.0e-4, le=10)]
StartTime = Annotated[float, Field(ge=0, le=600)]
EndTime = Annotated[float, Field(ge=0.1, le=600)]
_LIST_FIELD = Field(strict=False, min_length=1, max_length=MOST_SPEEDS)


class Speed(NamedTuple):
    """One speed of the drum. Times count from the moment when it takes this speed."""

    angular_velocity_rad_s: float
    measure_from_s: float  # when the measurement of the surface begins
    measure_until_s: float  # when the measurement ends


class TurningSettings(Rotating):
    """The section `turning` of the configuration; see config/README.md."""

    angular_velocity_rad_s: Annotated[
        AngularVelocity | Annotated[tuple[AngularVelocity, ...], _LIST_FIELD],
        Allowed("a number from 0.0001 to 10, or a list of one for each speed"),
    ] = Field(  # type: ignore[assignment]
        description="angular velocity of the drum and its caps; or a list of up to 9 "
        "for the same filling",
    )
    measure_from_s: Annotated[
        StartTime | Annotated[tuple[StartTime, ...], _LIST_FIELD],
        Allowed("a number from 0 to 600, or a list of one for each speed"),
    ] = Field(
        description="time of rotation at a speed from which the surface is measured; "
        "or a list of one for each speed",
    )
    measure_until_s: Annotated[
        EndTime | Annotated[tuple[EndTime, ...], _LIST_FIELD],
        Allowed("a number from 0.1 to 600, or a list of one for each speed"),
    ] = Field(
        description="time of rotation at a speed until which the surface is measured; "
        "or a list of one for each speed",
    )
    tilt_deg: float = Field(
        default=0.0,
        ge=0,
        le=45,
        description="angle of the axis against the horizontal, as in a kiln",
    )

    @property
    def n_speeds(self) -> int:
        """Number of speeds."""
        return int(np.size(self.angular_velocity_rad_s))

    def list_speeds(self) -> list[Speed]:
        """List the speeds. A single time in the section applies to all of them."""
        start_times_s = _repeat_for_speeds(self.measure_from_s, self.n_speeds)
        end_times_s = _repeat_for_speeds(self.measure_until_s, self.n_speeds)
        velocities = _repeat_for_speeds(self.angular_velocity_rad_s, self.n_speeds)
        rows = zip(velocities, start_times_s, end_times_s, strict=True)
        return [Speed(*row) for row in rows]


def _repeat_for_speeds(value: float | tuple[float, ...], count: int) -> list[float]:
    """Repeat a single number `count` times; return several numbers as a list."""
    numbers = np.atleast_1d(value).tolist()
    return numbers * count if len(numbers) == 1 else numbers


# --- run ------------------------------------------------------------------------------


@dataclass
class _Frames:
    """Frames of a flowing bed of N grains, collected in lists over T times."""

    time_s: list[float] = field(default_factory=list)
    position: list[np.ndarray] = field(default_factory=list)
    quaternion: list[np.ndarray] = field(default_factory=list)
    speed: list[int] = field(default_factory=list)

    def add(self, trial: Trial, time_s: float, speed: int) -> None:
        """Add the present state of the bed.

        Parameters
        ----------
        trial : Trial
            The drum with its bed.
        time_s : float
            Time since the drum began to turn at its present speed.
        speed : int
            Index of this speed.
        """
        grains = trial.grains()
        self.time_s.append(time_s)
        self.position.append(grains["position"])
        self.quaternion.append(grains["quaternion"])
        self.speed.append(speed)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the frames as arrays over all times, without the speed indices."""
        return {
            "time_s": np.array(self.time_s),
            "position": np.array(self.position),
            "quaternion": np.array(self.quaternion),
        }


class _BedFrames(NamedTuple):
    """Frames of the bed of N grains at one speed, at T times."""

    position: np.ndarray  # (T, N, 3) [m]
    quaternion: np.ndarray  # (T, N, 4)
    scale: np.ndarray  # (N,)

    @classmethod
    def select_speed(cls, arrays: Arrays, index: int) -> Self:
        """Select the frames at the speed with this index from the arrays of a run."""
        position = np.asarray(arrays["position"], float)
        quaternion = np.asarray(arrays["quaternion"], float)
        # Runs with a single speed have no array of speeds.
        speed = arrays.get("speed", np.zeros(len(position), int))
        is_at_speed = speed == index
        return cls(
            position=position[is_at_speed],
            quaternion=quaternion[is_at_speed],
            scale=np.asarray(arrays["scale"], float),
        )


@register(NAME)
class TurningTest(RotatingDrum[TurningSettings]):
    """A drum that turns at steady speeds."""

    settings = TurningSettings
    responses = (_make_angle_response("turning_deg", None),)
    statuses = ("ok", "unstable", "lost", "no_surface")
    measured_by = ("fit_share",)
    required_arrays = ("position", "quaternion", "scale")
    summary = "surface at {turning_deg:.1f} deg while the drum turns"
    example: ClassVar = {
        "turning": {
            "berries": 160,
            "rate_per_s": 300.0,
            "rotate_from_s": 0.6,
            "angular_velocity_rad_s": 2.0,
            "measure_from_s": 0.8,
            "measure_until_s": 1.6,
            "seeds": 2,
            "outer_diameter_mm": 110.0,
            "wall_thickness_mm": 5.0,
            "length_mm": 80.0,
            "factory_height_mm": 20.0,
            "record_s": 0.1,
            "fit_share": 0.6,
        },
        "targets": [
            {"response": "turning_deg", "value": 32.0, "sd": 2.0, "repetitions": 5}
        ],
    }

    def response_of_name(self, name: str) -> Response | None:
        """Make the response that has a given name.

        The name is that of an angle, such as ``turning_2_deg`` for the second speed, or
        of a score of a profile, such as ``turning_profile_1_mm``. `RESPONSE_NAME`
        defines all names.

        Parameters
        ----------
        name : str
            The name of a response.

        Returns
        -------
        Response or None
            The response. None if this bench test has no response with the name.
        """
        match = RESPONSE_NAME.fullmatch(name)
        if match is None:
            return None
        if name.endswith("_deg"):
            return _make_angle_response(name, match["speed"])
        # The name of a whole profile has no number of a score. The scores of a profile
        # are responses, but the profile itself is not.
        if match["score"] is None:
            return None
        return _make_score_response(name, match["speed"], match["score"])

    def tilt_deg(self, section: TurningSettings) -> float:
        """Return the angle by which the axis is tilted, with the end at +y lower."""
        return section.tilt_deg

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the drum, turn it at each speed, and record the bed while it flows.

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
            The arrays are ``time_s`` (T,), the time of each frame; ``position`` (T, N,
            3) [m] and ``quaternion`` (T, N, 4) at these times; and the relative sizes
            ``scale`` (N,). A time counts from the moment when the drum took its present
            speed. Frames begin at `turning.measure_from_s`. With several speeds there
            is also ``speed`` (T,), the index of the speed.
        """
        section = self.section(scene.settings)
        trial, factory = self.make_empty_drum(scene, interval_s, progress)
        simulation = trial.simulation
        frames = _Frames()
        # The drum stands still while it is filled. Then it turns at one speed after the
        # other. `guard` ends this block without an error as soon as the run exceeds a
        # limit. `trial.broken` then holds the reason, and the frames so far are kept.
        with trial.bounds.guard():
            first_step = scene.simulation.steps(section.rotate_from_s)
            fill(trial, factory, first_step)
            trial.run_to(first_step)
            for index, speed in enumerate(section.list_speeds()):
                set_rotation(simulation, speed.angular_velocity_rad_s)
                self._turn_and_record(trial, speed, index, frames)

        arrays = frames.arrays()
        arrays["scale"] = simulation.scales.astype(np.float32)
        # Without this array, all frames belong to the only speed.
        if section.n_speeds > 1:
            arrays["speed"] = np.array(frames.speed)
        outcome = DrumOutcome(
            n_unplaced=self.count_unplaced(trial),
            all_inside=self.are_all_inside(trial),
            unstable=trial.broken,
            overlap_share=trial.overlap_share,
        )
        return self.make_run(scene, outcome, arrays, trial.frames())

    def _turn_and_record(
        self, trial: Trial, speed: Speed, index: int, frames: _Frames
    ) -> None:
        """Advance the drum at one of its speeds, and record frames of the flowing bed.

        Parameters
        ----------
        trial : Trial
            The drum, which turns at this speed. It is advanced in place.
        speed : Speed
            The speed. Frames are recorded from its `measure_from_s` on, when the flow
            is steady.
        index : int
            The index of the speed, which is recorded with the frames.
        frames : _Frames
            The frames of the run, to which those of this speed are added in place.
        """
        simulation_settings = trial.scene.simulation
        section = self.section(trial.scene.settings)
        record_interval = max(1, simulation_settings.steps(section.record_s))
        first_step = trial.simulation.steps
        n_steps = simulation_settings.steps(speed.measure_until_s)
        # Here, steps are counted from the moment at which the drum begins to turn at
        # this speed.
        for step in range(record_interval, n_steps + 1, record_interval):
            trial.run_to(first_step + step)
            time_s = step * simulation_settings.time_step_s
            if time_s >= speed.measure_from_s:
                frames.add(trial, time_s, index)

    def measure(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Measure the mean angle at each speed, and the scores of target profiles.

        A score tells how far the mean surface of the bed is from the profile of a
        target.

        Parameters
        ----------
        record : mapping
            The record of the run.
        arrays : mapping
            The arrays of the run by name, as `run` returns them.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        dict
            The record with the angles and scores. All of them are None if the run is
            not ``ok``. They are also None if the bed has no surface in one of the
            frames; the status and its reason then change.
        """
        section = self.section(scene.settings)
        angle_names = _list_angle_names(section)
        profiles = _select_target_profiles(scene.settings)
        # A run that cannot be measured has None for each angle and score.
        missing_numbers = dict.fromkeys((*angle_names, *profiles))
        if record["status"] != "ok":
            return {**record, **missing_numbers}

        measured: dict[str, float] = {}
        for index, angle_name in enumerate(angle_names):
            bed_frames = _BedFrames.select_speed(arrays, index)
            angles_deg = self.surface_angles(
                bed_frames.position, bed_frames.quaternion, bed_frames.scale, scene
            )
            # An angle is NaN if the bed of that frame has no surface.
            has_surfaces = len(angles_deg) > 0 and np.isfinite(angles_deg).all()
            if not has_surfaces:
                verdict = make_no_surface_verdict(scene)
                fault = {"status": verdict.status, "reason": verdict.reason}
                return {**record, **fault, **missing_numbers}
            measured[angle_name] = float(angles_deg.mean())
            # The name of a score contains the number of its speed.
            profiles_at_speed = {
                score_name: profile
                for score_name, profile in profiles.items()
                if find_speed_index(score_name) == index
            }
            measured |= self._compute_profile_scores(
                profiles_at_speed, bed_frames, scene
            )
        return {**record, **measured}

    def _compute_profile_scores(
        self,
        profiles: Mapping[str, Mapping[str, Any]],
        bed_frames: _BedFrames,
        scene: Scene,
    ) -> dict[str, float]:
        """Compute scores that compare the mean surface of a bed with target profiles.

        Parameters
        ----------
        profiles : mapping
            The profile of each target, by the name of the score that is the response.
        bed_frames : _BedFrames
            Frames of the bed at one speed.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        dict
            The score [mm] of each profile, by the name of the score.
        """
        from repose.measure import bed
        from repose.measure.silhouette import Grains

        if not profiles:
            return {}
        radius_m = Drum.of(self.section(scene.settings)).radius_m
        mm_per_pixel = scene.settings.mm_per_pixel
        # For each pixel, compute the fraction of the frames in which the bed covers it.
        # The mean surface lies where this fraction equals that of the target profile.
        frames = zip(bed_frames.position, bed_frames.quaternion, strict=True)
        # This generator is consumed once, by `occupied_share`.
        beds = (
            Grains(position, quaternion, scene.particle, bed_frames.scale)
            for position, quaternion in frames
        )
        covered_share = bed.occupied_share(beds, radius_m, mm_per_pixel)
        scores = {}
        for name, profile in profiles.items():
            x_m = 1e-3 * np.array(profile["x"])
            heights_m = bed.surface_heights(
                covered_share, profile["covered"], x_m, radius_m, mm_per_pixel
            )
            # `columns` compares the heights with the profile, and returns all scores of
            # this profile by name. Each target needs only its own score.
            scores_mm = Profile.of(profile).columns(1e3 * heights_m)
            scores[name] = scores_mm[name]
        return scores

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        return section.rotate_from_s + sum(
            speed.measure_until_s for speed in section.list_speeds()
        )

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield settings with which the drum cannot run, and targets it cannot measure.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.

        Yields
        ------
        tuple of str
            A key of the configuration, and the values that are allowed for it.
        """
        yield from self.find_impossible_filling(settings)
        section = self.section(settings)
        # `list_speeds` below needs lists that have one number for each speed. So only
        # the first list of a wrong length is reported, and the other checks are
        # skipped.
        wrong_lists = list(_find_wrong_lists(section))
        if wrong_lists:
            yield wrong_lists[0]
            return
        for speed in section.list_speeds():
            # There must be time for at least one frame.
            earliest_end_s = speed.measure_from_s + section.record_s
            if speed.measure_until_s < earliest_end_s:
                yield (
                    "turning.measure_until_s",
                    f"at least {earliest_end_s:g}, or there is nothing to measure",
                )
        # If `targets` is not a list, the check of that section reports it.
        targets = settings.config.get("targets")
        if isinstance(targets, list):
            yield from _find_impossible_targets(section, targets)


def _list_angle_names(section: TurningSettings) -> list[str]:
    """List the name of the angle at each speed; the first name has no number."""
    names = ["turning_deg"]
    for number in range(2, section.n_speeds + 1):
        names.append(f"turning_{number}_deg")
    return names


def _select_target_profiles(settings: SceneSettings) -> dict[str, Mapping[str, Any]]:
    """Select the profiles of all targets, by the names of their scores."""
    return {
        target["response"]: target["profile"]
        for target in settings.targets_of(NAME)
        if "profile" in target
    }


def _find_wrong_lists(section: TurningSettings) -> Contradictions:
    """Yield the keys of lists that do not have one number for each speed."""
    for key in ("measure_from_s", "measure_until_s"):
        value = getattr(section, key)
        if np.ndim(value) and np.size(value) != section.n_speeds:
            yield (
                f"turning.{key}",
                f"a number, or one for each of {section.n_speeds} speeds",
            )


def _find_impossible_targets(
    section: TurningSettings, targets: Sequence[Any]
) -> Contradictions:
    """Yield targets whose speed does not exist, or whose profile leaves the drum.

    Parameters
    ----------
    section : TurningSettings
        The section `turning` of the configuration.
    targets : sequence
        The section `targets` of the configuration. Malformed entries are skipped, since
        the check of that section reports them.

    Yields
    ------
    tuple of str
        The key of such a target, and the values that are allowed for it.
    """
    radius_mm = 1e3 * Drum.of(section).radius_m
    for number, target in enumerate(targets):
        is_of_drum = isinstance(target, Mapping) and target.get("apparatus") == NAME
        if not is_of_drum:
            continue
        # The name of the response contains the number of the speed.
        if find_speed_index(target["response"]) >= section.n_speeds:
            yield (
                f"targets.{number}.response",
                f"a response of one of {section.n_speeds} speeds "
                "(turning.angular_velocity_rad_s)",
            )
        # A target without a profile has no points. The point at x = 0 stands in for
        # them, and always passes the check.
        x_mm = target.get("profile", {}).get("x", [0.0])
        farthest_mm = max(abs(x) for x in x_mm)
        if farthest_mm >= radius_mm:
            yield (
                f"targets.{number}.profile.x",
                f"inside the drum, between -{radius_mm:g} and {radius_mm:g}",
            )
