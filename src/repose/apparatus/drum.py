"""The rotating drum (paper, section 4.2.2): berries rest in a cylinder that then turns until its bed slips.

The axis is y, the origin lies on it half-way along. The drum turns about -y, which carries the bed towards +x. When a
slip is judged the drum stops, as in the experiment, and the bed comes to rest.
"""

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repose.apparatus.scenes import Strip, berry_simulation, fill
from repose.core.files import write_json
from repose.core.parameters import PARAMETERS
from repose.dem import Cylinder, Motion, Plane
from repose.measure import bed
from repose.particle.size_distribution import of_pour

WALLS = ("shell", "near_cap", "far_cap")
RECORD = ("time_s", "turned_deg", "surface_deg", "bed_deg", "energy_j")
STATES = ("start", "report", "before", "after")


@dataclass(frozen=True)
class Drum:
    """The inside of a cylinder about the y axis between two flat caps; lengths in m."""

    radius_m: float
    length_m: float

    @classmethod
    def of(cls, section):
        """The drum of the configuration's section `drum`."""
        radius_mm = 0.5 * section["outer_diameter_mm"] - section["wall_thickness_mm"]
        return cls(1e-3 * radius_mm, 1e-3 * section["length_mm"])

    def walls(self, material):
        """The drum's walls by name, of a material."""
        half = 0.5 * self.length_m
        ends = ((0.0, -half, 0.0), (0.0, half, 0.0))
        return {
            "shell": Cylinder(ends[0], (0.0, 1.0, 0.0), self.length_m, self.radius_m, material),
            "near_cap": Plane(ends[0], (0.0, 1.0, 0.0), material),
            "far_cap": Plane(ends[1], (0.0, -1.0, 0.0), material),
        }

    def factory(self, height_m, berry_radius_m):
        """The widest `Strip` at a height above the axis in which a berry of that radius touches no wall.

        Raises ValueError where there is none.
        """
        room = self.radius_m - berry_radius_m
        half_y = 0.5 * self.length_m - berry_radius_m
        if not (abs(height_m) < room and half_y > 0.0):
            raise ValueError(
                f"height_m is {height_m!r}; allowed: below {room:.4g}, in a drum longer than a berry"
            )
        return Strip(math.sqrt(room**2 - height_m**2), half_y, height_m)

    def holds(self, centres_m):
        """Which centres (N, 3) lie inside (N,)."""
        inside = np.hypot(centres_m[:, 0], centres_m[:, 2]) < self.radius_m
        return inside & (np.abs(centres_m[:, 1]) < 0.5 * self.length_m)


@dataclass(frozen=True)
class Turn:
    """One run: the record (T,) by name, the frames at its times, the slip, and what judges the run.

    record: time_s since the rotation began, turned_deg of the drum, surface_deg, bed_deg of the centre of mass,
    energy_j of a berry in the drum's frame. centres_m (T, N, 3), quaternions (T, N, 4), scales (N,). report: row of
    the record at the configured time of the report. rest_energy_j: of a berry when the rotation began;
    rotation_from_s: when.
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
    wall_s: float

    def rows(self):
        """Rows of the record of each state: start, report, and before and after the slip where there is one."""
        rows = {"start": 0, "report": self.report}
        if self.slip is not None:
            rows |= {"before": self.slip.begins, "after": self.slip.ends}
        return rows


def set_rotation(simulation, angular_velocity_rad_s):
    """Let all of the drum turn about its axis, and measure rolling against that rotation."""
    turning = (0.0, -angular_velocity_rad_s, 0.0)
    for wall in WALLS:
        simulation.set_motion(wall, Motion(angular_velocity_rad_s=turning))
    simulation.rolling_frame_rad_s[:] = turning


class _Watch:
    """Keeps the record of a drum that turns."""

    def __init__(self, simulation, drum, particle, config):
        self.simulation, self.drum, self.particle = simulation, drum, particle
        self.fit_share = config["drum"]["fit_share"]
        self.mm_per_pixel = config["measure"]["mm_per_pixel"]
        self.began_s, self.turned_rad = simulation.time_s, 0.0
        self.rows, self.centres, self.quaternions = [], [], []

    def surface(self, row):
        """`bed.Surface` at a row of the record."""
        centres, quaternions = self.centres[row], self.quaternions[row]
        radius_m = self.drum.radius_m
        return bed.measure_surface(
            centres,
            quaternions,
            self.particle,
            radius_m,
            self.mm_per_pixel,
            self.fit_share,
            self.simulation.scales,
        )

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
        try:
            angle = self.surface(-1).angle_deg
        except ValueError:
            angle = math.nan
        time_s = s.time_s - self.began_s
        self.rows.append((time_s, math.degrees(self.turned_rad), angle, bed.bed_angle(s.positions), energy))

    def advance(self, steps):
        """Run, turn and keep."""
        self.simulation.run_steps(steps)
        self.turned_rad -= steps * self.simulation.physics.dt * self.simulation.rolling_frame_rad_s[1]
        self.keep()

    def record(self):
        """The record by name."""
        return dict(zip(RECORD, np.array(self.rows).T, strict=True))


def turn(config, parameters, seed, particle, berry, progress=None):
    """Fill the drum, let the bed rest, turn the drum until the bed slips, and let it rest again.

    Berries appear at `drum.rate_per_s` (see `scenes.fill`), drawn from `seed`. The rotation begins at
    `drum.rotate_from_s`, or later when the bed is at rest (`simulation.rest_energy_j` a berry), at most twice as late;
    it lasts until a slip is judged (`bed.find_slip`), at most `drum.longest_rotation_s`. The run ends when the bed
    rests, at most `drum.settle_s` after the drum, and not before `drum.report_s`. progress: called with the simulated
    time.
    Returns a `Turn`.
    """
    section, dt = config["drum"], config["simulation"]["time_step_s"]
    began = time.perf_counter()
    drum = Drum.of(section)
    scales, largest = of_pour(config["berry"]["size_distribution"], berry, seed, section["berries"])
    half = np.array([drum.radius_m, 0.5 * drum.length_m, drum.radius_m])
    simulation = berry_simulation(
        config,
        parameters,
        particle,
        berry,
        section["berries"],
        walls=drum.walls("wall"),
        lower=-half,
        upper=half,
        largest_scale=largest,
    )
    latest = round(2.0 * section["rotate_from_s"] / dt)
    every = max(1, round(section["record_s"] / dt))
    factory = drum.factory(1e-3 * section["factory_height_mm"], largest * particle.bounding_radius_m)

    def run_to(step):
        simulation.run_steps(max(0, step - simulation.steps))

    fill(
        simulation,
        np.random.default_rng(seed),
        factory,
        section["berries"],
        section["rate_per_s"],
        latest,
        run_to,
        scales,
    )
    run_to(max(simulation.steps, round(section["rotate_from_s"] / dt)))
    calm = config["simulation"]["rest_energy_j"]
    while simulation.kinetic_energies().mean() > calm and simulation.steps < latest:
        run_to(min(latest, simulation.steps + every))
    rest_energy = float(simulation.kinetic_energies().mean())
    watch = _Watch(simulation, drum, particle, config)
    slip = _rotate(watch, section, calm, every, progress) if np.isfinite(rest_energy) else None
    record = watch.record() if watch.rows else {name: np.zeros(0) for name in RECORD}
    late = np.abs(watch.began_s + record["time_s"] - section["report_s"])
    return Turn(
        record=record,
        centres_m=np.array(watch.centres),
        quaternions=np.array(watch.quaternions),
        scales=simulation.scales.copy(),
        slip=slip,
        report=int(np.argmin(late)) if len(late) else 0,
        rotation_from_s=watch.began_s,
        rest_energy_j=rest_energy,
        held=bool(simulation.n_bodies == section["berries"] and drum.holds(simulation.positions).all()),
        wall_s=time.perf_counter() - began,
    )


def _rotate(watch, section, calm, every, progress):
    """Turn until the first slip and let the bed rest; returns the `bed.Slip` or None."""
    simulation = watch.simulation
    step_s = every * simulation.physics.dt
    report_s = section["report_s"] - watch.began_s
    set_rotation(simulation, section["angular_velocity_rad_s"])
    watch.keep()
    slip, stopped_s = None, math.inf
    while math.isfinite(watch.rows[-1][4]):
        now, energy = watch.rows[-1][0], watch.rows[-1][4]
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


def status_of(turned, section, calm_energy_j):
    """Status and reason of a `Turn`: ok, unstable, lost, not_at_rest or no_slip."""
    if not (np.isfinite(turned.rest_energy_j) and np.all(np.isfinite(turned.record["energy_j"]))):
        return "unstable", "a position is not finite; the time step is too long for these contacts"
    if not turned.held:
        return "lost", "a berry is missing, or outside the drum"
    if turned.rest_energy_j > calm_energy_j:
        return "not_at_rest", f"kinetic energy {turned.rest_energy_j:.2e} J a berry when the rotation began"
    if turned.slip is None:
        fall, last = section["slip_drop_deg"], turned.record["time_s"][-1]
        return "no_slip", f"the bed's centre of mass never fell by {fall:g} degrees in {last:g} s"
    return "ok", ""


def run_once(config, parameters, seed, particle, berry, progress=None):
    """Fill, turn and measure once. Returns the record of the run (units in its keys), its profile and the `Turn`.

    The profile has the rows of `bed.depth_profile`, in mm, and is empty without a slip.
    """
    section = config["drum"]
    turned = turn(config, parameters, seed, particle, berry, progress)
    status, reason = status_of(turned, section, config["simulation"]["rest_energy_j"])
    run = {"seed": int(seed), "status": status, "reason": reason, "rotation_from_s": turned.rotation_from_s}
    profile = np.zeros((0, 4))
    if status in ("ok", "no_slip"):
        for state, row in turned.rows().items():
            run |= {f"{state}_{key}": float(turned.record[key][row]) for key in RECORD}
    if status == "ok":
        slipped, profile = _slip(turned, section, particle, config["measure"]["mm_per_pixel"])
        run |= slipped
    return run | {"wall_s": round(turned.wall_s, 2)}, profile, turned


def _slip(turned, section, particle, mm_per_pixel):
    """Numbers of the slip and its depth profile [mm]."""
    record, slip = turned.record, turned.slip
    drum = Drum.of(section)
    before = bed.measure_surface(
        turned.centres_m[slip.begins],
        turned.quaternions[slip.begins],
        particle,
        drum.radius_m,
        mm_per_pixel,
        section["fit_share"],
        turned.scales,
    )
    turned_rad = math.radians(record["turned_deg"][slip.ends] - record["turned_deg"][slip.begins])
    depth, moved = bed.slip_displacement(
        turned.centres_m[slip.begins], turned.centres_m[slip.ends], turned_rad, before
    )
    profile = bed.depth_profile(depth, moved, 1e-3 * section["depth_bin_mm"]) * (1e3, 1e3, 1e3, 1.0)
    numbers = {
        "surface_drop_deg": float(record["surface_deg"][slip.begins] - record["surface_deg"][slip.ends]),
        "bed_drop_deg": float(record["bed_deg"][slip.begins] - record["bed_deg"][slip.ends]),
        "slip_duration_s": float(record["time_s"][slip.ends] - record["time_s"][slip.begins]),
        "largest_energy_j": float(record["energy_j"][slip.begins : slip.ends + 1].max()),
        "moved_share": bed.moved_share(moved, particle),
        "surface_moved_mm": float(profile[0, 1]),
        "wall_moved_mm": float(profile[-1, 1]),
    }
    return numbers, profile


def design_job(config, sample, parameters, seeds, particle, berry, out_dir):
    """Run one sample of the design with given seeds and write OUT/SAMPLE.json in one move; returns its content."""
    result = {
        "sample": int(sample),
        "config": config["label"],
        "parameters": {p: float(parameters[p]) for p in PARAMETERS},
        "runs": [run_once(config, parameters, seed, particle, berry)[0] for seed in seeds],
    }
    write_json(Path(out_dir) / f"{sample:03d}.json", result)
    return result


def run_job(config, parameters, seeds, particle, berry, out_dir, trajectory=False, progress=None):
    """Run one parameter set with given seeds; write OUT/turn_SEED.json and OUT/turn_SEED.npz of each.

    The .npz has the record, the profile and the states: position_STATE (N, 3) m, quaternion_STATE (N, 4) and
    turned_STATE_deg for start, report, before and after. trajectory: also write OUT/turn_SEED_trajectory.npz with
    every frame of the record.
    Each JSON is written last and in one move. Returns their contents.
    """
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    results = []
    for seed in seeds:
        run, profile, turned = run_once(config, parameters, seed, particle, berry, progress)
        frames = turned.centres_m.astype(np.float32), turned.quaternions.astype(np.float32)
        states = {}
        for state, row in turned.rows().items() if len(turned.centres_m) else ():
            states |= {f"position_{state}": frames[0][row], f"quaternion_{state}": frames[1][row]}
            states[f"turned_{state}_deg"] = turned.record["turned_deg"][row]
        np.savez_compressed(
            out / f"turn_{seed}.npz", profile=profile, scale=turned.scales, **turned.record, **states
        )
        if trajectory:
            path = out / f"turn_{seed}_trajectory.npz"
            shown = {key: turned.record[key] for key in ("time_s", "turned_deg")}
            np.savez_compressed(path, position=frames[0], quaternion=frames[1], scale=turned.scales, **shown)
        result = {
            "config": config["label"],
            "parameters": {p: float(parameters[p]) for p in PARAMETERS},
            "time_step_s": config["simulation"]["time_step_s"],
            "run": run,
        }
        write_json(out / f"turn_{seed}.json", result)
        results.append(result)
    return results
