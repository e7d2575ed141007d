"""The drum, simulated: filled, and turned until its bed slips."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose import dem
from repose.apparatus.bounds import Bounded, Unstable
from repose.apparatus.drum_geometry import WALLS, Drum
from repose.apparatus.factory import fill
from repose.apparatus.scene import berry_simulation
from repose.apparatus.settings import SimulationSettings
from repose.measure import bed
from repose.particle.size_distribution import of_pour

if TYPE_CHECKING:
    from repose.particle.particle import Particle


class _Row(NamedTuple):
    """One row of the record, see `Rotation.record`."""

    time_s: float
    turned_deg: float
    bed_deg: float
    energy_j: float


RECORD = _Row._fields


@dataclass(frozen=True)
class Rotation:
    """One run: its record over time, the frames at the same times, the slip, and what judges the run.

    Attributes
    ----------
    record : dict
        Columns (T,) of `RECORD`: time since the rotation began [s], angle by which the drum has turned and angle of the
        bed's centre of mass [degrees], mean energy of a berry in the drum's frame [J].
    centres_m, quaternions, scales : numpy.ndarray
        Of the N berries at these times: (T, N, 3) [m], (T, N, 4); sizes (N,).
    slip : Slip or None
        The first one.
    report : int
        Row of the record at the configured time of the report.
    rotation_from_s, rest_energy_j : float
        When the rotation began [s], and the mean energy of a berry then [J].
    held : bool
        Whether all berries are inside the drum.
    unstable : str
        Which bound the run broke, see `repose.apparatus.bounds`; empty where it broke none.
    """

    record: dict
    centres_m: np.ndarray
    quaternions: np.ndarray
    scales: np.ndarray
    slip: bed.Slip | None
    report: int
    rotation_from_s: float
    rest_energy_j: float
    held: bool
    unstable: str = ""

    def rows(self) -> dict[str, int]:
        """Rows of the record of each state: start, report, and before and after the slip where there is one."""
        rows = {"start": 0, "report": self.report}
        if self.slip is not None:
            rows |= {"before": self.slip.begins, "after": self.slip.ends}
        return rows


def set_rotation(simulation: "dem.Simulation", angular_velocity_rad_s: float) -> None:
    """Let all of the drum turn about its axis, and measure rolling against that rotation.

    Parameters
    ----------
    simulation : repose.dem.Simulation
    angular_velocity_rad_s : float
    """
    turning = (0.0, -angular_velocity_rad_s, 0.0)
    for wall in WALLS:
        simulation.set_motion(wall, dem.Motion(angular_velocity_rad_s=turning))
    simulation.rolling_frame_rad_s[:] = turning


class _Watch:
    """Keeps the record of a drum that turns."""

    def __init__(self, bounded, particle):
        self.bounded, self.particle = bounded, particle
        self.simulation = bounded.simulation
        self.began_s = self.turned_rad = 0.0
        self.rows, self.centres, self.quaternions = [], [], []

    def keep(self):
        """Add the present state to the record."""
        s = self.simulation
        self.centres.append(s.positions.copy())
        self.quaternions.append(s.quaternions)
        energy = bed.relative_energy(
            s.positions,
            s.quaternions,
            s.velocities,
            s.angular_velocities,
            self.particle,
            s.rolling_frame_rad_s,
            s.scales,
        )
        time_s = s.time_s - self.began_s
        turned_deg, bed_deg = math.degrees(self.turned_rad), bed.bed_angle(s.positions)
        self.rows.append(_Row(time_s, turned_deg, bed_deg, energy))

    def advance(self, steps):
        """Run, turn and keep."""
        self.bounded.run_to(self.simulation.steps + steps)
        self.turned_rad -= steps * self.simulation.time_step_s * self.simulation.rolling_frame_rad_s[1]
        self.keep()

    def record(self):
        """The record by name."""
        return dict(zip(RECORD, np.array(self.rows).T, strict=True))


def build(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    particle: "Particle",
    berry: Mapping[str, Any],
    largest_scale: float = 1.0,
    section: str = "drum",
) -> "dem.Simulation":
    """The empty simulation of the drum.

    Parameters
    ----------
    config, parameters, particle, berry, largest_scale
        As in `repose.apparatus.bench_test.BenchTest.build`.
    section : str, optional
        Of the configuration, that describes the drum.

    Returns
    -------
    repose.dem.Simulation
    """
    drum = Drum.of(config[section])
    half = np.array([drum.radius_m, 0.5 * drum.length_m, drum.radius_m])
    return berry_simulation(
        config,
        parameters,
        particle,
        berry,
        config[section]["berries"],
        walls=drum.walls("wall"),
        lower=-half,
        upper=half,
        largest_scale=largest_scale,
    )


def rotate(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    seed: int,
    particle: "Particle",
    berry: Mapping[str, Any],
    progress: Callable[[float], object] | None = None,
) -> Rotation:
    """Fill the drum, let the bed rest, turn the drum until the bed slips, and let it rest again.

    Parameters
    ----------
    config, parameters, seed, particle, berry, progress
        As in `repose.apparatus.bench_test.BenchTest.run`.

    Returns
    -------
    Rotation

    Notes
    -----
    Berries appear at `drum.rate_per_s`, drawn from `seed`; see `repose.apparatus.factory.fill`. The rotation
    begins at `drum.rotate_from_s`, or later when the bed is at rest (`simulation.rest_energy_j` a berry), at
    most twice as late. It lasts until a slip is judged (`bed.find_slip`), at most `drum.longest_rotation_s`.
    The run ends when the bed rests, at most `drum.settle_s` after the drum, and not before `drum.report_s`.
    """
    section, settings = config["drum"], SimulationSettings.of(config)
    drum = Drum.of(section)
    scales, largest = of_pour(config["berry"]["size_distribution"], berry, seed, section["berries"])
    simulation = build(config, parameters, particle, berry, largest)
    latest = settings.steps(2.0 * section["rotate_from_s"])
    every = max(1, settings.steps(section["record_s"]))
    factory = drum.factory(1e-3 * section["factory_height_mm"], largest * particle.bounding_radius_m)
    speed = section["angular_velocity_rad_s"]
    bounded = Bounded(simulation, drum.radius_m, speed * drum.radius_m)
    calm, unstable, rest_energy, slip = settings.rest_energy_j, "", math.nan, None
    watch = _Watch(bounded, particle)
    try:
        fill(simulation, factory, section, seed, latest, bounded.run_to, scales)
        bounded.run_to(settings.steps(section["rotate_from_s"]))
        while simulation.kinetic_energies().mean() > calm and simulation.steps < latest:
            bounded.run_to(min(latest, simulation.steps + every))
        bounded.look()
        rest_energy = float(simulation.kinetic_energies().mean())
        slip = _until_slip(watch, section, calm, every, progress)
        bounded.look()
    except Unstable as broken:
        unstable = str(broken)
    record = watch.record() if watch.rows else {name: np.zeros(0) for name in RECORD}
    late = np.abs(watch.began_s + record["time_s"] - section["report_s"])
    return Rotation(
        record=record,
        centres_m=np.array(watch.centres),
        quaternions=np.array(watch.quaternions),
        scales=simulation.scales.copy(),
        slip=slip,
        report=int(np.argmin(late)) if len(late) else 0,
        rotation_from_s=watch.began_s,
        rest_energy_j=rest_energy,
        held=bool(simulation.n_bodies == section["berries"] and drum.holds(simulation.positions).all()),
        unstable=unstable,
    )


def _until_slip(watch, section, calm, every, progress):
    """Turn until the first slip and let the bed rest; returns the `bed.Slip` or None."""
    simulation = watch.simulation
    watch.began_s = simulation.time_s
    step_s = every * simulation.time_step_s
    report_s = section["report_s"] - watch.began_s
    set_rotation(simulation, section["angular_velocity_rad_s"])
    watch.keep()
    slip, stopped_s = None, math.inf
    while math.isfinite(watch.rows[-1].energy_j):
        now, energy = watch.rows[-1].time_s, watch.rows[-1].energy_j
        if progress is not None:
            progress(simulation.time_s)
        rests = now > stopped_s and energy < calm
        if (rests or now >= stopped_s + section["settle_s"]) and now >= report_s - 0.5 * step_s:
            break
        if stopped_s == math.inf:
            if now >= section["longest_rotation_s"] - 0.5 * step_s:
                break
            record = watch.record()
            slip = bed.find_slip(record["bed_deg"], record["energy_j"], section["slip_drop_deg"], calm)
            if slip is not None:
                set_rotation(simulation, 0.0)
                stopped_s = now
        watch.advance(every)
    if slip is not None:
        record = watch.record()
        slip = bed.find_slip(record["bed_deg"], record["energy_j"], section["slip_drop_deg"], calm)
    return slip
