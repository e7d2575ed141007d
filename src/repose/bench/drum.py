"""The rotating drum (paper, section 4.2.2): grains rest in a cylinder that then turns until its bed slips.

The axis is y, the origin lies on it half-way along. The drum turns about -y, which carries the bed towards +x. When a
slip is judged the drum stops, as in the experiment, and the bed comes to rest.
"""

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

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
from repose.bench.factory import Strip, fill_and_rest, too_early
from repose.bench.scene import Trial
from repose.bench.settings import Rotating, SceneSettings
from repose.calibrate.responses import Response

if TYPE_CHECKING:
    from repose.dem import Cone, Plane
    from repose.measure import bed

NAME = "drum"
WALLS = ("shell", "near_cap", "far_cap")
STATES = ("start", "report", "before", "after")

# --- responses ------------------------------------------------------------------------------------

# Keys that define the surface of the bed, and a slip.
SEEN = ("measure.mm_per_pixel", "drum.fit_share", "drum.slip_drop_deg")
BEFORE, AFTER = (
    methodcaller("get", f"{when}_surface_deg") for when in ("before", "after")
)

# --- the vessel ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Drum:
    """The inside of a cylinder about the y axis between two flat caps."""

    radius_m: float  # of the inside, as the length
    length_m: float

    @classmethod
    def of(cls, section: Rotating) -> "Drum":
        """Make the drum of a section of the configuration."""
        radius_mm = 0.5 * section.outer_diameter_mm - section.wall_thickness_mm
        return cls(1e-3 * radius_mm, 1e-3 * section.length_mm)

    def walls(self, material: str) -> "dict[str, Cone | Plane]":
        """Shell and caps by name, of a material."""
        half = 0.5 * self.length_m
        ends = ((0.0, -half, 0.0), (0.0, half, 0.0))
        return {
            "shell": dem.Cylinder(
                ends[0], (0.0, 1.0, 0.0), self.length_m, self.radius_m, material
            ),
            "near_cap": dem.Plane(ends[0], (0.0, 1.0, 0.0), material),
            "far_cap": dem.Plane(ends[1], (0.0, -1.0, 0.0), material),
        }

    def factory(self, height_m: float, berry_radius_m: float) -> Strip:
        """Make the widest `Strip` at a height above the axis in which a grain touches no wall; else ValueError."""
        room = self.radius_m - berry_radius_m
        half_y = 0.5 * self.length_m - berry_radius_m
        if not (abs(height_m) < room and half_y > 0.0):
            raise ValueError(
                f"height_m is {height_m!r}; expected below {room:.4g}, in a drum longer than a grain"
            )
        return Strip(math.sqrt(room**2 - height_m**2), half_y, height_m)

    def holds(self, centres_m: np.ndarray) -> np.ndarray:
        """Mask (N,) of the grains whose centres lie inside the drum."""
        inside = np.hypot(centres_m[:, 0], centres_m[:, 2]) < self.radius_m
        return inside & (np.abs(centres_m[:, 1]) < 0.5 * self.length_m)


# --- section of the configuration -----------------------------------------------------------------


class DrumSettings(Rotating):
    """The section `drum` of the configuration; config/README.md explains its keys."""

    report_s: float = Field(ge=0.1, le=600)
    longest_rotation_s: float = Field(ge=0.1, le=600)
    settle_s: float = Field(ge=0, le=100)
    slip_drop_deg: float = Field(ge=0.05, le=45)
    depth_bin_mm: float = Field(ge=0.5, le=500)


# --- build and run ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Turned(Ending):
    """A drum that has turned."""

    held: bool  # whether all grains are there, and inside the drum


R = TypeVar("R", bound=Rotating)


class RotatingDrum(BenchTest[R]):
    """What bench tests with a drum share: vessel, filling and the line through the surface of the bed."""

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe the drum."""
        section = self.section(scene.settings)
        drum = Drum.of(section)
        half = np.array([drum.radius_m, 0.5 * drum.length_m, drum.radius_m])
        return {
            "capacity": section.berries,
            "walls": drum.walls("wall"),
            "lower": -half,
            "upper": half,
        }

    def build(self, scene: Scene, largest_scale: float = 1.0) -> "dem.Simulation":
        """Make the empty drum; tilted, it is low at positive y."""
        simulation = super().build(scene, largest_scale)
        tilt = math.radians(getattr(self.section(scene.settings), "tilt_deg", 0.0))
        gravity = simulation.physics.gravity
        gravity[1:] = -gravity[2] * math.sin(tilt), gravity[2] * math.cos(tilt)
        return simulation

    def empty_drum(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> tuple[Trial, Strip]:
        """Make the drum for the grains of a seed within its bounds, and the place where they appear."""
        section = self.section(scene.settings)
        drum, trial = (
            Drum.of(section),
            Trial(self.build, scene, section.berries, interval_s, progress),
        )
        trial.bound(
            drum.radius_m, float(np.max(section.angular_velocity_rad_s)) * drum.radius_m
        )
        return trial, drum.factory(1e-3 * section.factory_height_mm, trial.reach_m)

    def holds_all(self, trial: Trial) -> bool:
        """Whether all grains are there, and inside the drum."""
        simulation, drum = trial.simulation, Drum.of(self.section(trial.scene.settings))
        return simulation.n_bodies == simulation.capacity and bool(
            drum.holds(simulation.positions).all()
        )

    def faults(self, ending: Turned, settings: SceneSettings) -> Faults:
        """Judge a run before it is measured."""
        return stated(
            (not ending.held, "lost", "a grain is missing, or outside the drum")
        )

    def surface_of(
        self,
        position: np.ndarray,
        quaternion: np.ndarray,
        scale: np.ndarray,
        scene: Scene,
    ) -> "bed.Surface":
        """Return the surface of a bed of N grains; ValueError if it has none."""
        from repose.measure import bed
        from repose.measure.silhouette import Grains

        section = self.section(scene.settings)
        radius, pixel = Drum.of(section).radius_m, scene.settings.mm_per_pixel
        filled = bed.side_view(
            Grains(position, quaternion, scene.particle, scale), radius, pixel
        )
        return bed.surface_of(filled, radius, pixel, section.fit_share)

    def surface_angles(
        self,
        position: np.ndarray,
        quaternion: np.ndarray,
        scale: np.ndarray,
        scene: Scene,
    ) -> np.ndarray:
        """Return the angle of the surface in each of T frames [degrees]; NaN where the bed has no surface."""
        angles = np.full(len(position), math.nan)
        for k, (centres, turns) in enumerate(zip(position, quaternion, strict=True)):
            with contextlib.suppress(ValueError):
                angles[k] = self.surface_of(centres, turns, scale, scene).angle_deg
        return angles

    def impossible_filling(self, settings: SceneSettings) -> Contradictions:
        """Refuse a drum that has no room, turns too early or is recorded too finely."""
        drum, step_s, key = (
            self.section(settings),
            settings.simulation.time_step_s,
            self.name,
        )
        wide, radius = (
            drum.outer_diameter_mm,
            drum.outer_diameter_mm / 2 - drum.wall_thickness_mm,
        )
        outside = abs(drum.factory_height_mm) >= radius > 0
        yield from stated(
            (
                radius <= 0,
                f"{key}.wall_thickness_mm",
                f"below half of {key}.outer_diameter_mm, {wide:g}",
            ),
            (
                outside,
                f"{key}.factory_height_mm",
                f"inside the drum, between -{radius:g} and {radius:g}",
            ),
        )
        yield from too_early(drum, key, "rotate_from_s")
        fine = drum.record_s < step_s
        yield from stated(
            (fine, f"{key}.record_s", f"at least simulation.time_step_s, {step_s:g}")
        )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Refuse a drum in which a mean grain cannot lie across the axis at the factory's height."""
        drum, long_mm, fits = (
            self.section(settings),
            max(axes_mm),
            "so that a mean grain fits",
        )
        highest = drum.outer_diameter_mm / 2 - drum.wall_thickness_mm - long_mm / 2
        room = (
            f"between -{highest:.4g} and {highest:.4g}"
            if highest > 0
            else "a wider drum"
        )
        high = abs(drum.factory_height_mm) >= highest
        return stated(
            (
                drum.length_mm <= long_mm,
                f"{self.name}.length_mm",
                f"above {long_mm:.4g}, {fits}",
            ),
            (high, f"{self.name}.factory_height_mm", f"{room}, {fits}"),
        )


def no_surface(scene: Scene) -> str:
    """Say why a bed has no surface."""
    scale = scene.settings.mm_per_pixel
    return f"the bed has no surface that {scale:g} mm a pixel (measure.mm_per_pixel) resolve"


def set_rotation(simulation: "dem.Simulation", angular_velocity_rad_s: float) -> None:
    """Let all of the drum turn about its axis, and measure rolling against that rotation."""
    turning = (0.0, -angular_velocity_rad_s, 0.0)
    for wall in WALLS:
        simulation.set_motion(wall, dem.Motion(angular_velocity_rad_s=turning))
    simulation.rolling_frame_rad_s[:] = turning


class _Row(NamedTuple):
    """One row of the record of a rotation."""

    time_s: float  # since the rotation began
    turned_deg: float  # by which the drum has turned
    bed_deg: float  # angle of the bed's centre of mass
    energy_j: float  # mean of a grain in the drum's frame


RECORD = _Row._fields


@dataclass(frozen=True)
class Rotation(Turned):
    """One run: its record over T times, the frames of N grains at these times, and numbers by which it is judged."""

    record: dict  # columns (T,) of `RECORD`
    centres_m: np.ndarray  # (T, N, 3)
    quaternions: np.ndarray  # (T, N, 4)
    scales: np.ndarray  # (N,)
    slip: "bed.Slip | None"  # the first one
    report: int  # row of the record at the configured time of the report
    rotation_from_s: float  # when the rotation began
    rest_energy_j: float  # mean energy of a grain when the rotation began

    def rows(self) -> dict[str, int]:
        """Rows of the record of each state: start, report, and before and after the slip where there is one."""
        rows = {"start": 0, "report": self.report}
        if self.slip is not None:
            rows |= {"before": self.slip.begins, "after": self.slip.ends}
        return rows


class _Watch:
    """Keeps the record of a drum that turns."""

    def __init__(self, trial: Trial) -> None:
        self.trial, self.simulation, self.particle = (
            trial,
            trial.simulation,
            trial.scene.particle,
        )
        self.began_s = self.turned_rad = 0.0
        self.rows: list[_Row] = []
        self.centres: list[np.ndarray] = []
        self.quaternions: list[np.ndarray] = []

    def keep(self) -> None:
        """Add the present state to the record."""
        from repose.measure import bed
        from repose.measure.silhouette import Grains

        s = self.simulation
        self.centres.append(s.positions.copy())
        self.quaternions.append(s.quaternions)
        grains = Grains(s.positions, s.quaternions, self.particle, s.scales)
        energy = bed.relative_energy(
            grains, s.velocities, s.angular_velocities, s.rolling_frame_rad_s
        )
        time_s = s.time_s - self.began_s
        turned_deg, bed_deg = math.degrees(self.turned_rad), bed.bed_angle(s.positions)
        self.rows.append(_Row(time_s, turned_deg, bed_deg, energy))

    def advance(self, steps: int) -> None:
        """Run, turn and keep."""
        self.trial.run_to(self.simulation.steps + steps)
        self.turned_rad -= (
            steps * self.simulation.time_step_s * self.simulation.rolling_frame_rad_s[1]
        )
        self.keep()

    def record(self) -> dict[str, np.ndarray]:
        """Return the record by name."""
        return dict(zip(RECORD, np.array(self.rows).T, strict=True))


def _until_slip(watch: _Watch, section: DrumSettings, every: int) -> "bed.Slip | None":
    """Turn until the first slip and let the bed rest."""
    from repose.measure import bed

    simulation, calm = watch.simulation, watch.trial.scene.simulation.rest_energy_j
    watch.began_s = simulation.time_s
    step_s = every * simulation.time_step_s
    report_s = section.report_s - watch.began_s

    def first_slip() -> "bed.Slip | None":
        record = watch.record()
        return bed.find_slip(
            record["bed_deg"], record["energy_j"], section.slip_drop_deg, calm
        )

    set_rotation(simulation, section.angular_velocity_rad_s)
    watch.keep()
    slip, stopped_s = None, math.inf
    while math.isfinite(watch.rows[-1].energy_j):
        now, energy = watch.rows[-1].time_s, watch.rows[-1].energy_j
        rests = now > stopped_s and energy < calm
        if (
            rests or now >= stopped_s + section.settle_s
        ) and now >= report_s - 0.5 * step_s:
            break
        if stopped_s == math.inf:
            if now >= section.longest_rotation_s - 0.5 * step_s:
                break
            slip = first_slip()
            if slip is not None:
                set_rotation(simulation, 0.0)
                stopped_s = now
        watch.advance(every)
    return None if slip is None else first_slip()


@register(NAME)
class DrumTest(RotatingDrum[DrumSettings]):
    """A drum that turns slowly until its bed slips once."""

    settings = DrumSettings
    responses = (
        Response(
            "drum_slip_deg",
            "deg",
            "drum, slip",
            "slip",
            NAME,
            -90.0,
            90.0,
            SEEN,
            BEFORE,
        ),
        Response(
            "drum_rest_deg",
            "deg",
            "drum, after the slip",
            "rest",
            NAME,
            -90.0,
            90.0,
            SEEN,
            AFTER,
        ),
    )
    statuses = ("ok", "unstable", "lost", "not_at_rest", "no_slip", "no_surface")
    measured_by = ("fit_share", "depth_bin_mm")
    summary = (
        "first slip after {before_time_s:.1f} s, {before_turned_deg:.1f} deg; "
        "surface {before_surface_deg:.1f} deg before, {after_surface_deg:.1f} deg after it"
    )

    def rotate(self, scene: Scene, progress: Progress | None = None) -> Rotation:
        """Fill the drum, let the bed rest, turn the drum until the bed slips, and let it rest again.

        The rotation lasts until a slip is judged (`bed.find_slip`), at most `drum.longest_rotation_s`. The run ends
        when the bed rests, at most `drum.settle_s` after the drum, and not before `drum.report_s`.
        """
        section, settings = self.section(scene.settings), scene.simulation
        trial, factory = self.empty_drum(scene, progress=progress)
        every = max(1, settings.steps(section.record_s))
        watch, rest_energy, slip = _Watch(trial), math.nan, None
        with trial.bounded.guard():
            fill_and_rest(trial, factory, section, section.rotate_from_s, every)
            trial.bounded.look()
            rest_energy = trial.energy_j()
            slip = _until_slip(watch, section, every)
        record = (
            watch.record() if watch.rows else {name: np.zeros(0) for name in RECORD}
        )
        late = np.abs(watch.began_s + record["time_s"] - section.report_s)
        return Rotation(
            record=record,
            centres_m=np.array(watch.centres),
            quaternions=np.array(watch.quaternions),
            scales=trial.simulation.scales.copy(),
            slip=slip,
            report=int(np.argmin(late)) if len(late) else 0,
            rotation_from_s=watch.began_s,
            rest_energy_j=rest_energy,
            held=self.holds_all(trial),
            unstable=trial.broken,
        )

    def faults(self, ending: Turned, settings: SceneSettings) -> Faults:
        """Judge a run before it is measured."""
        assert isinstance(ending, Rotation)
        yield from super().faults(ending, settings)
        if ending.rest_energy_j > settings.simulation.rest_energy_j:
            yield (
                "not_at_rest",
                f"kinetic energy {ending.rest_energy_j:.2e} J a grain when the rotation began",
            )
        if ending.slip is None:
            fall, last = (
                self.section(settings).slip_drop_deg,
                ending.record["time_s"][-1],
            )
            yield (
                "no_slip",
                f"the bed's centre of mass never fell by {fall:g} degrees in {last:g} s",
            )

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill and turn once; with `interval_s` the frames are at the times of the record.

        The arrays are the columns of the record and the states: ``position_STATE`` (N, 3) [m], ``quaternion_STATE``
        (N, 4) and ``turned_STATE_deg`` for start, report, before and after.
        """
        rotation = self.rotate(scene, progress)
        position, quaternion = rotation.centres_m, rotation.quaternions
        arrays = {"scale": rotation.scales, **rotation.record}
        for state, row in rotation.rows().items() if len(position) else ():
            arrays |= {
                f"position_{state}": position[row],
                f"quaternion_{state}": quaternion[row],
            }
            arrays[f"turned_{state}_deg"] = rotation.record["turned_deg"][row]
        frames = (
            None
            if interval_s is None
            else {"position": position, "quaternion": quaternion, **arrays}
        )
        run = self.ended(
            scene, rotation, arrays, frames, rotation_from_s=rotation.rotation_from_s
        )
        record = run.record
        if record["status"] in ("ok", "no_slip"):
            for state, row in rotation.rows().items():
                record |= {
                    f"{state}_{key}": float(rotation.record[key][row]) for key in RECORD
                }
        if record["status"] == "ok" and rotation.slip is not None:
            energy = rotation.record["energy_j"][
                rotation.slip.begins : rotation.slip.ends + 1
            ]
            record |= {
                "bed_drop_deg": record["before_bed_deg"] - record["after_bed_deg"],
                "slip_duration_s": record["after_time_s"] - record["before_time_s"],
                "largest_energy_j": float(energy.max()),
            }
        return run

    def measured_run(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> tuple[dict[str, Any], np.ndarray]:
        """Measure a run, and the motion by depth (bins, 4) in its slip, lengths in mm.

        The measured run is the record with the angles of the surface and, of a slip, the numbers of `_of_slip`. Where
        the surface before or after a slip cannot be measured, the status is ``no_surface`` and there are no numbers.
        Without a slip the motion by depth is empty.
        """
        measured, profile = dict(record), np.zeros((0, 4))
        if record["status"] not in ("ok", "no_slip"):
            return measured, profile
        states = STATES if record["status"] == "ok" else STATES[:2]
        kinds = ("position", "quaternion")
        position, quaternion = (
            np.array([arrays[f"{kind}_{state}"] for state in states]) for kind in kinds
        )
        angles = self.surface_angles(position, quaternion, arrays["scale"], scene)
        for state, angle in zip(states, angles, strict=True):
            measured[f"{state}_surface_deg"] = (
                float(angle) if math.isfinite(angle) else None
            )
        if record["status"] == "no_slip":
            return measured, profile
        if not np.isfinite(angles[2:]).all():
            judged = {
                "seed": record["seed"],
                "status": "no_surface",
                "reason": no_surface(scene),
            }
            return judged | {"rotation_from_s": record["rotation_from_s"]}, profile
        numbers, profile = self._of_slip(record, arrays, scene)
        return measured | {
            "surface_drop_deg": float(angles[2] - angles[3])
        } | numbers, profile

    def _of_slip(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> tuple[dict[str, Any], np.ndarray]:
        """Measure the motion in the slip; None where no grain lies under the part of the surface that is fitted."""
        from repose.measure import bed

        centres = arrays["position_before"], arrays["position_after"]
        before = self.surface_of(
            centres[0], arrays["quaternion_before"], arrays["scale"], scene
        )
        turned_rad = math.radians(
            record["after_turned_deg"] - record["before_turned_deg"]
        )
        depth, moved = bed.slip_displacement(*centres, turned_rad, before)
        bin_m = 1e-3 * self.section(scene.settings).depth_bin_mm
        profile = bed.depth_profile(depth, moved, bin_m) * (1e3, 1e3, 1e3, 1.0)
        numbers = {
            "moved_share": bed.moved_share(moved, scene.particle),
            "surface_moved_mm": float(profile[0, 1]) if len(profile) else None,
            "wall_moved_mm": float(profile[-1, 1]) if len(profile) else None,
        }
        return numbers, profile

    def measure(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Return the result of `measured_run`, with the responses under their public names."""
        measured, _ = self.measured_run(record, arrays, scene)
        ok = measured["status"] == "ok"
        return measured | {
            response.name: response.of(measured) if ok else None
            for response in self.responses
        }

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        return section.rotate_from_s + section.longest_rotation_s + section.settle_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Refuse a drum that cannot be filled, or a report before it turns."""
        yield from self.impossible_filling(settings)
        section = self.section(settings)
        begin, early = section.rotate_from_s, section.report_s < section.rotate_from_s
        yield from stated(
            (early, f"{NAME}.report_s", f"at least {NAME}.rotate_from_s, {begin:g}")
        )
