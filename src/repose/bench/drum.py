"""Bench test of the drum that turns until its bed slips (paper, section 4.2.2)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

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
from repose.bench.factory import Factory, Strip, fill_and_rest, too_early
from repose.bench.scene import Scene
from repose.bench.settings import Rotating, SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.responses import Response
from repose.common.numbers import format_significant
from repose.common.section import Contradictions

if TYPE_CHECKING:
    from repose.dem import Cone, Plane
    from repose.measure import bed

NAME = "drum"
WALLS = ("shell", "near_cap", "far_cap")
# States of the bed that a run keeps: at the beginning of the rotation, at the time
# `drum.report_s`, just before the slip and just after it.
STATES = ("start", "report", "before", "after")
# Statuses of runs whose surface can be measured.
MEASURABLE_STATUSES = ("ok", "no_slip")

# --- responses ------------------------------------------------------------------------

# Keys that define the surface of the bed, and a slip.
SURFACE_KEYS = ("measure.mm_per_pixel", "drum.fit_share", "drum.slip_drop_deg")
SLIP = Response(
    name="drum_slip_deg",
    unit="deg",
    label="drum, slip",
    symbol="slip",
    apparatus=NAME,
    low=-90.0,
    high=90.0,
    definition=SURFACE_KEYS,
    function=methodcaller("get", "before_surface_deg"),
)
REST = Response(
    name="drum_rest_deg",
    unit="deg",
    label="drum, after the slip",
    symbol="rest",
    apparatus=NAME,
    low=-90.0,
    high=90.0,
    definition=SURFACE_KEYS,
    function=methodcaller("get", "after_surface_deg"),
)

# --- the vessel -----------------------------------------------------------------------


@dataclass(frozen=True)
class Drum:
    """The inside of a cylinder about the y axis between two flat caps."""

    radius_m: float
    length_m: float

    @classmethod
    def of(cls, section: Rotating) -> "Drum":
        """Make the drum of a section of the configuration."""
        return cls(
            radius_m=1e-3 * compute_inner_radius_mm(section),
            length_m=1e-3 * section.length_mm,
        )

    def walls(self, material: str) -> "dict[str, Cone | Plane]":
        """Make the walls of the drum by name: the shell and both caps."""
        half_length = 0.5 * self.length_m
        near = (0.0, -half_length, 0.0)
        far = (0.0, half_length, 0.0)
        axis = (0.0, 1.0, 0.0)
        return {
            "shell": dem.Cylinder(near, axis, self.length_m, self.radius_m, material),
            "near_cap": dem.Plane(near, axis, material),
            "far_cap": dem.Plane(far, (0.0, -1.0, 0.0), material),
        }

    def make_factory_area(self, height_m: float, grain_radius_m: float) -> Strip:
        """Make the largest area in which new grains can appear at a given height.

        The height is measured from the axis of the drum. The area is that of the
        centres: a grain of the given bounding radius touches no wall there. Raises
        ValueError if there is no such area.
        """
        radius = self.radius_m - grain_radius_m
        half_y = 0.5 * self.length_m - grain_radius_m
        if not (abs(height_m) < radius and half_y > 0.0):
            raise ValueError(
                f"height_m is {height_m!r}; expected a height of less than "
                f"{format_significant(radius)} above or below the axis, in a drum longer than a grain"
            )
        return Strip(math.sqrt(radius**2 - height_m**2), half_y, height_m)

    def contains(self, centres_m: np.ndarray) -> np.ndarray:
        """Mark the grains (N,) whose centres (N, 3) lie inside the drum."""
        x, y, z = centres_m.T
        is_in_shell = np.hypot(x, z) < self.radius_m
        return is_in_shell & (np.abs(y) < 0.5 * self.length_m)


def compute_inner_radius_mm(section: Rotating) -> float:
    """Compute the inner radius of a drum [mm]."""
    return 0.5 * section.outer_diameter_mm - section.wall_thickness_mm


# --- section of the configuration -----------------------------------------------------


class DrumSettings(Rotating):
    """The section `drum` of the configuration; config/README.md explains its keys."""

    report_s: float = Field(
        ge=0.1,
        le=600,
        description="the state at this time after the start of the filling is reported",
        json_schema_extra={"source": "4.2.2: 10, the article's whole time"},
    )
    longest_rotation_s: float = Field(
        ge=0.1,
        le=600,
        description="without a slip, the run ends after this time of rotation",
    )
    settle_s: float = Field(
        ge=0,
        le=100,
        description="after the drum has stopped, the bed has at most this time to come "
        "to rest",
    )
    slip_drop_deg: float = Field(
        ge=0.05,
        le=45,
        description="angle by which the bed's centre of mass falls in a slip, from its "
        "highest place about the axis",
    )
    depth_bin_mm: float = Field(
        ge=0.5,
        le=500,
        description="thickness of a layer in the depth profile of the slip",
    )


# --- what bench tests with a drum share -----------------------------------------------


@dataclass(frozen=True, kw_only=True)
class DrumOutcome(Outcome):
    """The outcome of a run in which a drum has turned."""

    all_inside: bool  # whether all grains that were added are inside the drum
    n_unplaced: int = 0  # number of grains for which the filling found no place


R = TypeVar("R", bound=Rotating)


class RotatingDrum(BenchTest[R]):
    """A bench test with a drum: its vessel, its filling and the surface of its bed."""

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe the drum as arguments of `repose.dem.Simulation`.

        The middle of the drum is the origin. The size of the drum does not depend on
        the grains, so `largest_radius_m` has no effect.
        """
        section = self.section(scene.settings)
        drum = Drum.of(section)
        half_sides = np.array([drum.radius_m, 0.5 * drum.length_m, drum.radius_m])
        return {
            "capacity": section.berries,
            "walls": drum.walls("wall"),
            "lower": -half_sides,
            "upper": half_sides,
        }

    def tilt_deg(self, section: R) -> float:
        """Return the angle by which the axis is tilted, with the end at +y lower.

        It is 0 unless a subclass overrides this method.
        """
        return 0.0

    def build(self, scene: Scene, largest_scale: float = 1.0) -> "dem.Simulation":
        """Make the empty drum.

        The drum of the simulation is always level. A configured tilt of its axis turns
        the direction of gravity instead.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        largest_scale : float, optional
            Size of the largest grain as a multiple of the particle.

        Returns
        -------
        repose.dem.Simulation
            The simulation without grains.
        """
        simulation = super().build(scene, largest_scale)
        tilt = math.radians(self.tilt_deg(self.section(scene.settings)))
        # The simulation reads this array, so changing it in place tilts gravity. At
        # first gravity points along -z, so `level_gravity_z` is negative, and the new
        # component along y is positive. It pulls the grains to the end at +y.
        gravity = simulation.physics.gravity
        level_gravity_z = gravity[2]
        gravity[1] = -level_gravity_z * math.sin(tilt)
        gravity[2] = level_gravity_z * math.cos(tilt)
        return simulation

    def make_empty_drum(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> tuple[Trial, Factory]:
        """Make the simulation of a drum without grains, and the source of its grains.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        interval_s : float, optional
            Simulated time between the frames of a film; without it none are recorded.
        progress : Progress, optional
            Called with the simulated time [s] whenever the simulation has advanced.

        Returns
        -------
        trial : Trial
            The simulation of the run, with its limits of speed, energy and overlap set.
        factory : Factory
            The source of new grains, which adds them inside the drum.
        """
        section = self.section(scene.settings)
        drum = Drum.of(section)
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        # A wall can make a grain at most as fast as the wall itself moves in the
        # fastest rotation. A section has one angular velocity, or one for each speed of
        # the drum. `bound` sets `trial.bounds`, which the caller needs.
        fastest_rad_s = float(np.max(section.angular_velocity_rad_s))
        trial.bound(top_m=drum.radius_m, speed_m_s=fastest_rad_s * drum.radius_m)
        factory_height_m = 1e-3 * section.factory_height_mm
        area = drum.make_factory_area(factory_height_m, trial.largest_radius_m)
        factory = Factory(area, section.berries, section.rate_per_s)
        return trial, factory

    def count_unplaced(self, trial: Trial) -> int:
        """Count the grains for which the filling found no place."""
        return int(trial.simulation.capacity - trial.simulation.n_bodies)

    def are_all_inside(self, trial: Trial) -> bool:
        """Return whether all grains that were added are inside the drum."""
        simulation = trial.simulation
        drum = Drum.of(self.section(trial.scene.settings))
        return bool(drum.contains(simulation.positions).all())

    def judge(self, outcome: DrumOutcome, settings: SceneSettings) -> Verdict:
        """Check a stable run before it is measured: all grains must be in the drum.

        Parameters
        ----------
        outcome : DrumOutcome
            The grains at the end of the run.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict
            `OK`, or the status ``lost`` if a grain is outside the drum or was never
            added.
        """
        if not outcome.all_inside:
            return Verdict("lost", "a grain is outside the drum")
        if outcome.n_unplaced:
            n_grains = self.section(settings).berries
            return Verdict(
                "lost",
                f"{outcome.n_unplaced} of {n_grains} grains found no place in the drum "
                "before it turned",
            )
        return OK

    def find_surface(
        self,
        position: np.ndarray,
        quaternion: np.ndarray,
        scale: np.ndarray,
        scene: Scene,
    ) -> "bed.Surface":
        """Find the surface of a bed of N grains in the view along the axis of the drum.

        Parameters
        ----------
        position, quaternion, scale : array
            Positions (N, 3) [m], orientations (N, 4) and relative sizes (N,) of the
            grains at one time.
        scene : Scene
            The scene, with the particle that represents a grain and the settings of the
            measurement.

        Returns
        -------
        bed.Surface
            A straight line fitted to the surface, with its angle.

        Raises
        ------
        ValueError
            If the bed has no surface.
        """
        from repose.measure import bed
        from repose.measure.silhouette import Grains

        section = self.section(scene.settings)
        radius_m = Drum.of(section).radius_m
        mm_per_pixel = scene.settings.mm_per_pixel
        grains = Grains(position, quaternion, scene.particle, scale)
        view = bed.side_view(grains, radius_m, mm_per_pixel)
        return bed.surface_of(view, radius_m, mm_per_pixel, section.fit_share)

    def surface_angles(
        self,
        position: np.ndarray,
        quaternion: np.ndarray,
        scale: np.ndarray,
        scene: Scene,
    ) -> np.ndarray:
        """Measure the angle of the surface of a bed at several times.

        The bed has the same N grains at all T times.

        Parameters
        ----------
        position, quaternion : array
            Positions (T, N, 3) [m] and orientations (T, N, 4) of the grains at these
            times.
        scale : array
            Their relative sizes (N,).
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        array
            Angles (T,) [degrees]; NaN in a frame whose bed has no surface.
        """
        angles_deg = []
        for centres, quaternions in zip(position, quaternion, strict=True):
            try:
                surface = self.find_surface(centres, quaternions, scale, scene)
            except ValueError:
                # `find_surface` raises this error for a bed without a surface.
                angles_deg.append(math.nan)
            else:
                angles_deg.append(surface.angle_deg)
        return np.array(angles_deg, float)

    def find_impossible_filling(self, settings: SceneSettings) -> Contradictions:
        """Yield the settings with which the drum cannot be filled or recorded.

        This is so if the drum has no inside, if new grains would appear outside of it,
        if the drum turns before the last grain has appeared, or if two rows of the
        record are less than a time step apart.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.

        Yields
        ------
        tuple of str
            A key of the configuration, and the values that are allowed for it.
        """
        section = self.section(settings)
        # The drum must have an inside. New grains appear at a height above its axis,
        # which must lie inside the drum.
        radius_mm = compute_inner_radius_mm(section)
        if radius_mm <= 0:
            yield (
                f"{self.name}.wall_thickness_mm",
                f"below half of {self.name}.outer_diameter_mm, "
                f"{section.outer_diameter_mm:g}",
            )
        elif abs(section.factory_height_mm) >= radius_mm:
            yield (
                f"{self.name}.factory_height_mm",
                f"inside the drum, between -{radius_mm:g} and {radius_mm:g}",
            )
        yield from too_early(section, self.name, "rotate_from_s")
        # `record_s` is the time between two rows of the record.
        time_step_s = settings.simulation.time_step_s
        if section.record_s < time_step_s:
            yield (
                f"{self.name}.record_s",
                f"at least simulation.time_step_s, {time_step_s:g}",
            )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield the settings of a drum in which a mean grain has no room.

        The grain must fit in every orientation: between the caps, and at the height
        where new grains appear.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.
        axes_mm : sequence of float
            Full lengths of the mean grain along its three axes.

        Yields
        ------
        tuple of str
            A key of the configuration, and the values that are allowed for it.
        """
        section = self.section(settings)
        grain_length_mm = max(axes_mm)
        if section.length_mm <= grain_length_mm:
            yield (
                f"{self.name}.length_mm",
                f"above {format_significant(grain_length_mm)}, so that a mean grain fits",
            )
        # Farther than this above or below the axis of the drum, a new grain can touch
        # the shell. In a drum that is narrower than a grain, the limit is not positive,
        # so there is no allowed height.
        highest_mm = compute_inner_radius_mm(section) - grain_length_mm / 2
        if abs(section.factory_height_mm) >= highest_mm:
            allowed = "a wider drum, so that a mean grain fits"
            if highest_mm > 0:
                limit = format_significant(highest_mm)
                allowed = f"between -{limit} and {limit}, so that a mean grain fits"
            yield f"{self.name}.factory_height_mm", allowed


def make_no_surface_verdict(scene: Scene) -> Verdict:
    """Make the status of a run whose bed has no surface, with the reason."""
    return Verdict(
        "no_surface",
        f"the bed has no surface at {scene.settings.mm_per_pixel:g} mm per pixel "
        "(measure.mm_per_pixel)",
    )


def set_rotation(simulation: "dem.Simulation", angular_velocity_rad_s: float) -> None:
    """Set the angular velocity of the shell and the caps about the axis of the drum.

    The simulation is changed in place. From then on, rolling resistance opposes the
    rotation relative to the drum. A positive velocity turns the drum about -y, and 0
    stops it.
    """
    angular_velocity = (0.0, -angular_velocity_rad_s, 0.0)
    for wall in WALLS:
        simulation.set_motion(wall, dem.Motion(angular_velocity_rad_s=angular_velocity))
    simulation.rolling_frame_rad_s[:] = angular_velocity


# --- the slow rotation ----------------------------------------------------------------


class _Row(NamedTuple):
    """One row of the record of a rotation."""

    time_s: float  # since the rotation began
    turned_deg: float  # angle by which the drum has turned
    bed_deg: float  # angle of the bed's centre of mass about the axis
    energy_j: float  # mean kinetic energy of a grain in the frame of the drum


RECORD_COLUMNS = _Row._fields


@dataclass(frozen=True)
class Rotation(DrumOutcome):
    """One run of the drum with N grains, recorded at T times.

    Attributes
    ----------
    record : dict
        Columns (T,) of `RECORD_COLUMNS`.
    centres_m, quaternions : array
        Positions (T, N, 3) and orientations (T, N, 4) of the grains at these times.
        Their first index is the row of the record.
    scales : array
        Relative sizes (N,) of the grains.
    slip : bed.Slip or None
        The first slip; None if the bed did not slip.
    report_row : int
        Row of the record at the time `drum.report_s`.
    rotation_from_s : float
        Simulated time at which the rotation began.
    rest_energy_j : float
        Mean kinetic energy of a grain when the rotation began.
    """

    record: dict[str, np.ndarray]
    centres_m: np.ndarray
    quaternions: np.ndarray
    scales: np.ndarray
    slip: "bed.Slip | None"
    report_row: int
    rotation_from_s: float
    rest_energy_j: float

    def state_rows(self) -> dict[str, int]:
        """Return the row number of the record at each state, by the name of the state.

        A run without a slip has only the states at the start and at the report.
        """
        rows = {"start": 0, "report": self.report_row}
        if self.slip is not None:
            rows["before"] = self.slip.begins
            rows["after"] = self.slip.ends
        return rows

    def collect_arrays(self) -> dict[str, np.ndarray]:
        """Collect the arrays of the run: the record, and the grains in each state.

        The names with a state, such as ``position_before``, are those of the saved
        file. If the run ended before the rotation began, the arrays contain no states.
        """
        arrays = {"scale": self.scales, **self.record}
        if not len(self.centres_m):
            return arrays
        # Row numbers of the record are also indices of `centres_m` and `quaternions`.
        for state, row in self.state_rows().items():
            arrays[f"position_{state}"] = self.centres_m[row]
            arrays[f"quaternion_{state}"] = self.quaternions[row]
            arrays[f"turned_{state}_deg"] = self.record["turned_deg"][row]
        return arrays

    def state_numbers(self) -> dict[str, float]:
        """Return the columns of the record at each state.

        The name of a number consists of state and column, such as ``before_bed_deg``.
        """
        numbers = {}
        for state, row in self.state_rows().items():
            for column in RECORD_COLUMNS:
                numbers[f"{state}_{column}"] = float(self.record[column][row])
        return numbers

    def slip_numbers(self) -> dict[str, float]:
        """Return how far the bed fell in the slip, its duration and largest energy.

        The dictionary is empty without a slip.
        """
        if self.slip is None:
            return {}
        states = self.state_numbers()
        during_slip = slice(self.slip.begins, self.slip.ends + 1)
        return {
            "bed_drop_deg": states["before_bed_deg"] - states["after_bed_deg"],
            "slip_duration_s": states["after_time_s"] - states["before_time_s"],
            "largest_energy_j": float(self.record["energy_j"][during_slip].max()),
        }


class _DrumRecorder:
    """Advances a turning drum, and records its bed at regular times.

    Parameters
    ----------
    trial : Trial
        The filled drum.
    section : DrumSettings
        The section `drum` of the configuration. It gives the interval of the record.

    Attributes
    ----------
    start_s : float
        Simulated time at which the rotation began.
    turned_rad : float
        Angle by which the drum has turned since then.
    rows : list of _Row
        The record, with one row for each time.
    centres, quaternions : list of array
        Positions (N, 3) and orientations (N, 4) of the grains at each time.
    """

    def __init__(self, trial: Trial, section: DrumSettings) -> None:
        """Create an empty record. The class documents the parameters."""
        self.trial = trial
        self.simulation = trial.simulation
        self.section = section
        # Number of time steps between two rows. `trial.scene.simulation` holds
        # settings; `trial.simulation` is the running simulation.
        self.interval = max(1, trial.scene.simulation.steps(section.record_s))
        # The method `start` sets the time at which the rotation begins.
        self.start_s = 0.0
        self.turned_rad = 0.0
        self.rows: list[_Row] = []
        self.centres: list[np.ndarray] = []
        self.quaternions: list[np.ndarray] = []

    @property
    def last_row(self) -> _Row:
        """The last row of the record."""
        return self.rows[-1]

    @property
    def half_interval_s(self) -> float:
        """Half of the time between two rows [s].

        A time counts as reached in the row that is nearest to it.
        """
        return 0.5 * (self.interval * self.simulation.time_step_s)

    def start(self) -> None:
        """Set the drum turning, and record the bed at the beginning of the rotation."""
        self.start_s = self.simulation.time_s
        set_rotation(self.simulation, self.section.angular_velocity_rad_s)
        self.record_state()

    def advance(self) -> None:
        """Advance by one interval, add up the rotation, and record the bed."""
        simulation = self.simulation
        self.trial.run_to(simulation.steps + self.interval)
        # The drum turns about -y, so its component along y is negative.
        angular_velocity = simulation.rolling_frame_rad_s[1]
        self.turned_rad -= self.interval * simulation.time_step_s * angular_velocity
        self.record_state()

    def record_state(self) -> None:
        """Add the present grains and a row of numbers to the record.

        The lists `rows`, `centres` and `quaternions` all grow by one entry, so that the
        same index belongs to the same time.
        """
        from repose.measure import bed
        from repose.measure.silhouette import Grains

        simulation = self.simulation
        particle = self.trial.scene.particle
        centres = simulation.positions
        quaternions = simulation.quaternions
        # The energy is measured in the frame that turns with the drum. A bed that is at
        # rest relative to the drum therefore has no energy.
        energy_j = bed.relative_energy(
            Grains(centres, quaternions, particle, simulation.scales),
            simulation.velocities,
            simulation.angular_velocities,
            simulation.rolling_frame_rad_s,
        )
        row = _Row(
            time_s=simulation.time_s - self.start_s,
            turned_deg=math.degrees(self.turned_rad),
            bed_deg=bed.bed_angle(centres),
            energy_j=energy_j,
        )
        # `positions` may be a view of the running simulation, so it is copied.
        # `quaternions` is always a copy.
        self.rows.append(row)
        self.centres.append(centres.copy())
        self.quaternions.append(quaternions)

    def collect_columns(self) -> dict[str, np.ndarray]:
        """Collect the columns (T,) of the record by name."""
        if not self.rows:
            return {name: np.zeros(0) for name in RECORD_COLUMNS}
        return dict(zip(RECORD_COLUMNS, np.array(self.rows).T, strict=True))

    def find_slip(self) -> "bed.Slip | None":
        """Find the first slip of the bed in the record so far; None without a slip."""
        from repose.measure import bed

        record = self.collect_columns()
        return bed.find_slip(
            record["bed_deg"],
            record["energy_j"],
            self.section.slip_drop_deg,
            self.trial.scene.simulation.rest_energy_j,
        )

    def find_nearest_row(self, time_s: float) -> int:
        """Find the row that is nearest to a simulated time.

        The time [s] counts from the beginning of the run. The result is 0 in an empty
        record.
        """
        if not self.rows:
            return 0
        times_s = self.start_s + self.collect_columns()["time_s"]
        return int(np.argmin(np.abs(times_s - time_s)))


def _turn_until_slip(recorder: _DrumRecorder) -> "bed.Slip | None":
    """Turn the drum until the bed slips, then stop it and wait until the bed rests.

    The recorder and the simulation of its trial are advanced in place. If the bed does
    not slip, the drum is still turning at the end.

    Parameters
    ----------
    recorder : _DrumRecorder
        Recorder of the filled drum.

    Returns
    -------
    bed.Slip or None
        The first slip. None if the bed does not slip within `drum.longest_rotation_s`,
        or if its energy becomes infinite or NaN.
    """
    longest_rotation_s = recorder.section.longest_rotation_s
    # Half an interval is subtracted so that the row nearest to the end is the last one.
    rotation_end_s = longest_rotation_s - recorder.half_interval_s
    recorder.start()
    while True:
        # Each pass checks the last row, and then adds another one.
        row = recorder.last_row
        if row.time_s >= rotation_end_s or not math.isfinite(row.energy_j):
            return None
        if recorder.find_slip() is not None:
            break
        recorder.advance()

    _record_settling(recorder)
    # The first search found the beginning of the slip. Search again, because the record
    # now contains the end of the slip, too.
    return recorder.find_slip()


def _record_settling(recorder: _DrumRecorder) -> None:
    """Stop the drum, and record the bed until it rests.

    Recording goes on at least until the time `drum.report_s`. The bed has at most
    `drum.settle_s` to come to rest. Recording ends at once if the energy becomes
    infinite or NaN.

    Parameters
    ----------
    recorder : _DrumRecorder
        Recorder of a drum whose bed has slipped. It is advanced in place.
    """
    section = recorder.section
    rest_energy_j = recorder.trial.scene.simulation.rest_energy_j
    settling_end_s = recorder.last_row.time_s + section.settle_s
    # `drum.report_s` counts from the beginning of the filling, but the times of rows
    # count from the beginning of the rotation. Half an interval is subtracted so that
    # the row nearest to the time is the one that counts.
    report_s = section.report_s - recorder.start_s - recorder.half_interval_s

    # An angular velocity of 0 stops the drum.
    set_rotation(recorder.simulation, 0.0)
    is_over = False
    while not is_over and math.isfinite(recorder.last_row.energy_j):
        recorder.advance()
        row = recorder.last_row
        has_settled = row.energy_j < rest_energy_j or row.time_s >= settling_end_s
        is_over = has_settled and row.time_s >= report_s


def _make_record_without_surface(
    record: Mapping[str, Any], scene: Scene
) -> dict[str, Any]:
    """Make the record of a run whose bed has no surface before or after its slip.

    The record consists of the seed, the status with its reason, and the time at which
    the rotation began. All other numbers of `record` are left out.
    """
    verdict = make_no_surface_verdict(scene)
    return {
        "seed": record["seed"],
        "status": verdict.status,
        "reason": verdict.reason,
        "rotation_from_s": record["rotation_from_s"],
    }


@register(NAME)
class DrumTest(RotatingDrum[DrumSettings]):
    """A drum that turns slowly until its bed slips once."""

    settings = DrumSettings
    responses = (SLIP, REST)
    statuses = ("ok", "unstable", "lost", "not_at_rest", "no_slip", "no_surface")
    measured_by = ("fit_share", "depth_bin_mm")
    summary = (
        "first slip after {before_time_s:.1f} s, {before_turned_deg:.1f} deg; "
        "surface {before_surface_deg:.1f} deg before, "
        "{after_surface_deg:.1f} deg after it"
    )
    example: ClassVar = {
        "drum": {
            "berries": 160,
            "rate_per_s": 300.0,
            "rotate_from_s": 0.8,
            "angular_velocity_rad_s": 0.4,
            "report_s": 1.0,
            "longest_rotation_s": 4.0,
            "settle_s": 1.0,
            "seeds": 2,
            "outer_diameter_mm": 110.0,
            "wall_thickness_mm": 5.0,
            "length_mm": 80.0,
            "factory_height_mm": 20.0,
            "record_s": 0.1,
            "slip_drop_deg": 1.0,
            "fit_share": 0.6,
            "depth_bin_mm": 5.0,
        },
        "targets": [
            {"response": "drum_slip_deg", "value": 31.0, "sd": 1.0, "repetitions": 5}
        ],
    }

    def rotate(self, scene: Scene, progress: Progress | None = None) -> Rotation:
        """Fill the drum, turn it until the bed slips, and wait for the bed to rest.

        The drum begins to turn when the filled bed is at rest. It turns until a slip is
        found (`bed.find_slip`), or for `drum.longest_rotation_s`. After a slip, the
        drum stops. The run then ends when the bed is at rest again, or after
        `drum.settle_s` if it still moves. However, it does not end before
        `drum.report_s`.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        progress : Progress, optional
            Called with the simulated time [s] whenever the simulation has advanced.

        Returns
        -------
        Rotation
            The record, the grains at each time of the record, and the slip.
        """
        section = self.section(scene.settings)
        trial, factory = self.make_empty_drum(scene, progress=progress)
        recorder = _DrumRecorder(trial, section)
        # `guard` ends the block below without an error as soon as the run exceeds a
        # limit of speed, energy or overlap. If that happens before the bed slips, these
        # values remain. `trial.broken` then holds the reason.
        rest_energy_j = math.nan
        slip = None
        with trial.bounds.guard():
            fill_and_rest(trial, factory, section.rotate_from_s, recorder.interval)
            trial.bounds.check()
            rest_energy_j = trial.energy_j()
            slip = _turn_until_slip(recorder)

        return Rotation(
            record=recorder.collect_columns(),
            centres_m=np.array(recorder.centres),
            quaternions=np.array(recorder.quaternions),
            scales=trial.simulation.scales.copy(),
            slip=slip,
            report_row=recorder.find_nearest_row(section.report_s),
            rotation_from_s=recorder.start_s,
            rest_energy_j=rest_energy_j,
            n_unplaced=self.count_unplaced(trial),
            all_inside=self.are_all_inside(trial),
            unstable=trial.broken,
            overlap_share=trial.overlap_share,
        )

    def judge(self, outcome: DrumOutcome, settings: SceneSettings) -> Verdict:
        """Check a stable run before it is measured, and return its status.

        In addition to the checks of every drum, the bed must be at rest when the
        rotation begins, and it must slip.

        Parameters
        ----------
        outcome : Rotation
            The run of the drum. It must be a `Rotation`.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict
            `OK`, or the status of the first check that fails.
        """
        # The annotation of `outcome` is the type that all bench tests with a drum
        # share.
        assert isinstance(outcome, Rotation)
        verdict = super().judge(outcome, settings)
        if verdict != OK:
            return verdict
        # The outcome holds the measured energy, and the settings hold its limit.
        if outcome.rest_energy_j > settings.simulation.rest_energy_j:
            return Verdict(
                "not_at_rest",
                f"kinetic energy {outcome.rest_energy_j:.2e} J a grain when the rotation "
                "began; begin the rotation later by drum.rotate_from_s",
            )
        if outcome.slip is None:
            drop_deg = self.section(settings).slip_drop_deg
            last_s = outcome.record["time_s"][-1]
            return Verdict(
                "no_slip",
                f"the bed's centre of mass never fell by {drop_deg:g} degrees in "
                f"{format_significant(last_s)} s",
            )
        return OK

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the drum, turn it until the bed slips, and record the bed.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        interval_s : float, optional
            Only whether it is given matters. If it is, the run has a frame at each time
            of the record, so at intervals of `drum.record_s`. Without it the run has no
            frames.
        progress : function, optional
            Called with the simulated time [s] whenever the simulation has advanced.

        Returns
        -------
        Run
            The arrays are ``scale`` (N,), the columns `RECORD_COLUMNS` (T,) of the
            record, and for each of the `STATES` that the run reached:
            ``position_STATE`` (N, 3) [m], ``quaternion_STATE`` (N, 4) and
            ``turned_STATE_deg``.
        """
        rotation = self.rotate(scene, progress)
        arrays = rotation.collect_arrays()
        frames = None
        if interval_s is not None:
            # The record already contains the bed at each time. These are the frames,
            # together with the arrays of the run.
            frames = {
                "position": rotation.centres_m,
                "quaternion": rotation.quaternions,
                **arrays,
            }
        run = self.make_run(
            scene, rotation, arrays, frames, rotation_from_s=rotation.rotation_from_s
        )
        # `make_run` has given the run its status. Only a run that slipped has the
        # measurements of a slip.
        status = run.record["status"]
        if status in MEASURABLE_STATUSES:
            run.record.update(rotation.state_numbers())
        if status == "ok":
            run.record.update(rotation.slip_numbers())
        return run

    def measure_with_profile(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> tuple[dict[str, Any], np.ndarray]:
        """Measure the surface of the bed in each state, and the motion during the slip.

        The motion is measured as a function of the depth below the surface.

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
        measured : dict
            The record with the angle ``STATE_surface_deg`` [degrees] of each of the
            `STATES`. For a run that slipped, there are also ``surface_drop_deg`` and
            the numbers of `_measure_slip_motion`. If the surface before or after the
            slip cannot be measured, the status is ``no_surface`` and there are no
            numbers.
        profile : array
            The depth profile (layers, 4) of `_measure_slip_motion`. Without a slip it
            has no rows.
        """
        # An array with the four columns of a depth profile, but without layers
        no_profile = np.zeros((0, 4))
        status = record["status"]
        if status not in MEASURABLE_STATUSES:
            return dict(record), no_profile

        measured = dict(record)
        # The first two of the `STATES` are the start and the report. A run without a
        # slip has only these two.
        states = STATES if status == "ok" else STATES[:2]
        angles_deg = self._measure_state_angles(states, arrays, scene)
        for state, angle_deg in angles_deg.items():
            measured[f"{state}_surface_deg"] = angle_deg
        if status == "no_slip":
            return measured, no_profile

        before_deg = angles_deg["before"]
        after_deg = angles_deg["after"]
        if before_deg is None or after_deg is None:
            return _make_record_without_surface(record, scene), no_profile

        measured["surface_drop_deg"] = before_deg - after_deg
        numbers, profile = self._measure_slip_motion(record, arrays, scene)
        return measured | numbers, profile

    def _measure_state_angles(
        self, states: Sequence[str], arrays: Arrays, scene: Scene
    ) -> dict[str, float | None]:
        """Measure the angle of the surface in some states of the bed.

        Parameters
        ----------
        states : sequence of str
            The states, among `STATES`.
        arrays : mapping
            The arrays of the run by name, as `run` returns them.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        dict
            Angle [degrees] by state; None for a state whose bed has no surface.
        """
        angles = self.surface_angles(
            np.array([arrays[f"position_{state}"] for state in states]),
            np.array([arrays[f"quaternion_{state}"] for state in states]),
            arrays["scale"],
            scene,
        )
        return {
            state: float(angle) if math.isfinite(angle) else None
            for state, angle in zip(states, angles, strict=True)
        }

    def _measure_slip_motion(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> tuple[dict[str, float | None], np.ndarray]:
        """Measure how far the grains moved during the slip, layer by layer.

        Parameters
        ----------
        record : mapping
            The record of a run that slipped.
        arrays : mapping
            The arrays of the run by name, as `run` returns them.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        numbers : dict
            ``moved_share``, the fraction of the grains that moved; and the mean motion
            [mm] in the uppermost layer (``surface_moved_mm``) and in the lowest layer,
            which lies at the wall (``wall_moved_mm``). Both motions are None if the
            profile has no layers.
        profile : array
            The depth profile (layers, 4), with one row for each layer and the uppermost
            layer first. The columns are depth, mean motion and standard deviation of
            the motion, all in mm, and the number of grains.
        """
        from repose.measure import bed

        before_m = arrays["position_before"]
        after_m = arrays["position_after"]
        # The depth of a grain is its distance below the surface before the slip.
        surface = self.find_surface(
            before_m, arrays["quaternion_before"], arrays["scale"], scene
        )
        # The drum turned during the slip. The motion is measured relative to the drum.
        turned_deg = record["after_turned_deg"] - record["before_turned_deg"]
        depth_m, motion_m = bed.slip_displacement(
            before_m, after_m, math.radians(turned_deg), surface
        )
        bin_m = 1e-3 * self.section(scene.settings).depth_bin_mm
        profile_m = bed.depth_profile(depth_m, motion_m, bin_m)
        # Three columns are lengths in m. The last column is a number of grains.
        profile_mm = profile_m * (1e3, 1e3, 1e3, 1.0)

        surface_moved_mm = None
        wall_moved_mm = None
        # The second column is the mean motion. The first row is the surface.
        if len(profile_mm):
            surface_moved_mm = float(profile_mm[0, 1])
            wall_moved_mm = float(profile_mm[-1, 1])
        numbers = {
            "moved_share": bed.moved_share(motion_m, scene.particle),
            "surface_moved_mm": surface_moved_mm,
            "wall_moved_mm": wall_moved_mm,
        }
        return numbers, profile_mm

    def measure(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Measure a run as `measure_with_profile` does, and add the responses.

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
            The record with all numbers and the responses. The responses are None in a
            run that is not ``ok``.
        """
        measured, _ = self.measure_with_profile(record, arrays, scene)
        is_ok = measured["status"] == "ok"
        responses = {
            response.name: response.of(measured) if is_ok else None
            for response in self.responses
        }
        return measured | responses

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        return section.rotate_from_s + section.longest_rotation_s + section.settle_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield settings with which a drum cannot be filled or reports too early."""
        yield from self.find_impossible_filling(settings)
        section = self.section(settings)
        if section.report_s < section.rotate_from_s:
            yield (
                "drum.report_s",
                f"at least drum.rotate_from_s, {section.rotate_from_s:g}",
            )
