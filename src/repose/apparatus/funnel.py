"""The funnel: berries are poured onto a plate and come to rest as a pile (paper, section 3.1).

A pour that gives no pile to measure is a result, too: it has a status and a reason instead of a number.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repose import dem
from repose.apparatus.bench_test import BenchTest, Run, register
from repose.apparatus.factory import Disc, fill
from repose.apparatus.funnel_geometry import Funnel
from repose.apparatus.scene import Filmed, berry_simulation, largest_cluster
from repose.apparatus.settings import SimulationSettings
from repose.core.responses import Response
from repose.core.runs import Recorded
from repose.measure.angles import MEAN_KEYS, VIEW_KEYS

if TYPE_CHECKING:
    from repose.particle.particle import Particle

NAME = "funnel"
# A pile that has lost more than this share of its berries over the edge of the plate is not the pile poured.
LARGEST_LOSS = 0.1
# Below this height a berry has left the plate and is gone.
FLOOR_M = -0.05
STATUSES = ("ok", "jammed", "not_at_rest", "no_flank", "left_plate", "unstable")

# --- what it gives --------------------------------------------------------------------------------

# The keys of `measure` that define what is seen of a pile, and the line along its flank.
SEEN = ("measure.views", "measure.mm_per_pixel", "measure.largest_pile_only")
BERRY = "measure.berry_height_mm"
LINE = ("measure.flank", "measure.fit_from", "measure.fit_to", BERRY)
PLATE = ("funnel.plate_diameter_mm",)


def _angle(definition: str, label: str, keys: tuple[str, ...]) -> Response:
    """The angle by one definition, whichever of them is the angle of repose."""
    return Response(f"aor_{definition}_deg", "deg", label, definition, NAME, 0.0, 89.0, (*SEEN, *keys))


RESPONSES = (
    Response("aor_deg", "deg", "angle of repose", "AoR", NAME, 1.0, 89.0, (*SEEN, *LINE, "measure.response")),
    Response("height_mm", "mm", "Height", "Height", NAME, 1.0, 2000.0, SEEN),
    _angle("flank", "angle, flank", LINE),
    _angle("secant", "angle, secant", (BERRY,)),
    _angle("steepest", "angle, steepest", LINE),
    _angle("whole", "angle, whole side", ("measure.flank",)),
    Response("base_radius_mm", "mm", "base radius", "base radius", NAME, 0.0, 1e4, (*SEEN, BERRY)),
    Response("lower_deg", "deg", "lower flank", "lower flank", NAME, 0.0, 89.0, (*SEEN, BERRY)),
    Response("upper_deg", "deg", "upper flank", "upper flank", NAME, 0.0, 89.0, (*SEEN, BERRY)),
    Response("packing_percent", "%", "packing", "packing", NAME, 0.0, 100.0, (*SEEN, BERRY)),
    Response("radius_90_mm", "mm", "radius of 90 % of the berries", "radius of 90 %", NAME, 0.0, 1e4, PLATE),
    Response("loose_percent", "%", "loose berries", "loose", NAME, 0.0, 100.0, PLATE),
    Response("discharge_s", "s", "discharge time", "discharge", NAME, 0.0, 1e4),
)
# Measured on every pile beside the angle of repose and the Height; the other responses where they are targets.
BESIDE = ("height_view_mm", *MEAN_KEYS.values(), *VIEW_KEYS.values())
ALWAYS = ("aor_deg", "height_mm", *BESIDE)
COUNTED = ("berries_on_plate", "berries_in_pile", "kinetic_energy_J")
RECORDED = Recorded(
    means=("aor_deg", "height_mm", "discharge_s", *BESIDE),
    without_error=("discharge_s",),
    single=("aor_deg", "height_mm", "discharge_s", *COUNTED, *BESIDE),
)

# --- what its configuration asks ------------------------------------------------------------------


def contradictions(config: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys of a funnel that cannot be built or of a pour that cannot end, and what is allowed."""
    funnel = config[NAME]
    inlet, outlet = funnel["inlet_diameter_mm"], funnel["outlet_diameter_mm"]
    duration, window = funnel["duration_s"], funnel["rest_window_s"]
    if SimulationSettings.of(config).time_step_s > window / 2:
        yield "simulation.time_step_s", f"at most half of funnel.rest_window_s, {window:g}"
    if outlet >= inlet:
        yield "funnel.outlet_diameter_mm", f"below funnel.inlet_diameter_mm, {inlet:g}"
    if funnel["factory_diameter_mm"] > inlet:
        yield "funnel.factory_diameter_mm", f"at most funnel.inlet_diameter_mm, {inlet:g}"
    if funnel["plate_diameter_mm"] < outlet:
        yield "funnel.plate_diameter_mm", f"at least funnel.outlet_diameter_mm, {outlet:g}"
    wall = (inlet - outlet) / 4
    if funnel["rim_radius_mm"] > wall:
        yield "funnel.rim_radius_mm", f"at most {wall:g}, or no cone is left between inlet and outlet"
    if window >= duration:
        yield "funnel.rest_window_s", f"below funnel.duration_s, {duration:g}"
    last = (funnel["berries"] - 1) / funnel["rate_per_s"]
    if last >= duration - window:
        yield "funnel.duration_s", f"above {last + window:g}: the last berry appears at {last:g} s"


def misfits(config: Mapping[str, Any], axes_mm: Sequence[float]) -> Iterator[tuple[str, str]]:
    """Keys of openings that are too narrow for the mean berry, and what is allowed."""
    for key, smallest in (("outlet_diameter_mm", axes_mm[2]), ("factory_diameter_mm", axes_mm[0])):
        if config[NAME][key] <= smallest:
            yield f"funnel.{key}", f"above {smallest:.4g}, the size of a mean berry"


# --- build and run --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pour:
    """What is left of a pour, and the numbers that judge it.

    Attributes
    ----------
    centres_m, quaternions, scales : numpy.ndarray
        Of the N berries that were poured: (N, 3) [m], (N, 4), (N,).
    on_plate, in_pile : numpy.ndarray
        Which of them lie on the plate, and in its largest cluster (N,).
    in_funnel, off_plate : int
        How many are still in the funnel, and have left the plate.
    kinetic_energy_j, largest_motion_m : float
        Energy of the pile [J]; farthest way of a berry on the plate in the last `rest_window_s` [m].
    discharge_s : float
        From the first to the last berry that left the outlet [s]; NaN where none did.
    wall_s, us_per_step : float
        Wall time of the pour [s], and of a time step at its end [us].
    frames : dict or None
        See `repose.apparatus.scene.Filmed.frames`.
    """

    centres_m: np.ndarray
    quaternions: np.ndarray
    scales: np.ndarray
    on_plate: np.ndarray
    in_pile: np.ndarray
    in_funnel: int
    off_plate: int
    kinetic_energy_j: float
    largest_motion_m: float
    discharge_s: float
    wall_s: float
    us_per_step: float
    frames: dict[str, np.ndarray] | None


def build(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    particle: "Particle",
    berry: Mapping[str, Any],
    largest_scale: float = 1.0,
) -> "dem.Simulation":
    """The empty simulation of funnel and plate.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    parameters : mapping
        The six contact parameters by name.
    particle : Particle
        The berry's body.
    berry : mapping
        What the verb ``berry`` writes.
    largest_scale : float
        Of a berry, relative to the particle.
    """
    section, funnel = config[NAME], Funnel.of(config[NAME])
    plate_radius = 0.5e-3 * section["plate_diameter_mm"]
    reach = largest_scale * particle.bounding_radius_m
    half = max(plate_radius, 0.5 * funnel.inlet_diameter_m) + 2.0 * reach
    return berry_simulation(
        config,
        parameters,
        particle,
        berry,
        section["berries"],
        walls={
            "plate": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", plate_radius),
            **funnel.walls("wall"),
        },
        lower=(-half, -half, 0.0),
        upper=(half, half, funnel.inlet_height_m + 4.0 * reach),
        largest_scale=largest_scale,
        exit_height_m=funnel.outlet_height_m,
        curved_walls_above_m=funnel.outlet_height_m - funnel.rim_radius_m,
        floor_height_m=FLOOR_M,
    )


def pour(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    seed: int,
    particle: "Particle",
    berry: Mapping[str, Any],
    interval_s: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> Pour:
    """Pour the berries through the funnel and let them rest (paper, section 3.1).

    Berries appear one by one at `rate_per_s` above the inlet, drawn from `seed`; see `repose.apparatus.factory.fill`.
    Parameters are those of `BenchTest.run`.
    """
    from repose.particle.size_distribution import of_pour

    section, settings = config[NAME], SimulationSettings.of(config)
    began = time.perf_counter()
    scales, largest = of_pour(config["berry"]["size_distribution"], berry, seed, section["berries"])
    simulation = build(config, parameters, particle, berry, largest)
    funnel = Funnel.of(section)
    height = funnel.inlet_height_m + 1e-3 * section["factory_height_mm"]
    factory = Disc(0.5e-3 * section["factory_diameter_mm"] - largest * particle.bounding_radius_m, height)
    last_step = settings.steps(section["duration_s"])
    rest_step = last_step - settings.steps(section["rest_window_s"])
    timed_step = max(0, min(rest_step, last_step - settings.steps(1.0)))
    filmed = Filmed(simulation, interval_s, progress)
    fill(simulation, factory, section, seed, rest_step, filmed.run_to, scales)
    timed_step = max(timed_step, simulation.steps)
    filmed.run_to(timed_step)
    clock = time.perf_counter()
    filmed.run_to(rest_step)
    before = simulation.positions.copy()
    filmed.run_to(last_step)
    us_per_step = 1e6 * (time.perf_counter() - clock) / max(1, last_step - timed_step)
    return _judge(simulation, funnel, before, filmed.frames(), time.perf_counter() - began, us_per_step)


def _judge(simulation, funnel, before, frames, wall_s, us_per_step) -> Pour:
    """Sort the berries into pile, plate, funnel and lost, and measure their motion."""
    centres = simulation.positions.copy()
    present = simulation.present
    # a berry hanging in the outlet has its centre a little below the rim
    in_funnel = present & (centres[:, 2] > funnel.outlet_height_m - simulation.radius)
    on_plate = present & (centres[:, 2] > 0.0) & ~in_funnel
    in_pile = largest_cluster(simulation.contacts(), on_plate)
    exits = simulation.exit_times_s
    exits = exits[np.isfinite(exits)]
    pile_energy = simulation.kinetic_energies()[in_pile]
    motion = np.linalg.norm(centres - before, axis=1)[on_plate]
    return Pour(
        centres_m=centres,
        quaternions=simulation.quaternions.copy(),
        scales=simulation.scales.copy(),
        on_plate=on_plate,
        in_pile=in_pile,
        in_funnel=int(in_funnel.sum()),
        off_plate=int(len(centres) - in_funnel.sum() - on_plate.sum()),
        kinetic_energy_j=float(pile_energy.sum()),
        largest_motion_m=float(motion.max(initial=0.0)),
        discharge_s=float(exits.max() - exits.min()) if len(exits) else math.nan,
        wall_s=wall_s,
        us_per_step=us_per_step,
        frames=frames,
    )


def status_of(poured: Pour, config: Mapping[str, Any]) -> tuple[str, str]:
    """Status and reason of a pour before it is measured: ok, unstable, jammed, left_plate or not_at_rest."""
    section, n = config[NAME], config[NAME]["berries"]
    if not np.all(np.isfinite(poured.centres_m)) or not np.isfinite(poured.kinetic_energy_j):
        return "unstable", "a position is not finite; the time step is too long for these contacts"
    if poured.in_funnel or len(poured.centres_m) < n:
        waiting = n - len(poured.centres_m)
        return "jammed", f"{poured.in_funnel} berries in the funnel and {waiting} not yet poured at the end"
    if poured.off_plate > LARGEST_LOSS * n:
        return "left_plate", f"{poured.off_plate} of {n} berries left the plate"
    energy = poured.kinetic_energy_j / max(1, int(poured.in_pile.sum()))
    rest = SimulationSettings.of(config).rest_energy_j
    if energy > rest:
        return "not_at_rest", f"kinetic energy {energy:.2e} J a berry, more than {rest:.0e}"
    if 1e3 * poured.largest_motion_m > section["rest_motion_mm"]:
        return "not_at_rest", (
            f"a berry moved {1e3 * poured.largest_motion_m:.2f} mm in the last {section['rest_window_s']:g} s, "
            f"more than {section['rest_motion_mm']:g}"
        )
    return "ok", ""


def run(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    seed: int,
    particle: "Particle",
    berry: Mapping[str, Any],
    interval_s: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> Run:
    """Pour once and judge the pour; see `BenchTest.run`."""
    poured = pour(config, parameters, seed, particle, berry, interval_s, progress)
    status, reason = status_of(poured, config)
    record = {
        "seed": int(seed),
        "status": status,
        "reason": reason,
        "discharge_s": poured.discharge_s if np.isfinite(poured.discharge_s) else None,
        "berries_on_plate": int(poured.on_plate.sum()),
        "berries_in_pile": int(poured.in_pile.sum()),
        "berries_off_plate": poured.off_plate,
        "kinetic_energy_J": poured.kinetic_energy_j if np.isfinite(poured.kinetic_energy_j) else None,
        "wall_s": round(poured.wall_s, 3),
        "us_per_step": round(poured.us_per_step, 2),
    }
    # in single precision: 0.03 um at the edge of the plate
    arrays = {
        "position": poured.centres_m.astype(np.float32),
        "quaternion": poured.quaternions.astype(np.float32),
        "in_pile": poured.in_pile,
        "scale": np.asarray(poured.scales, np.float32),
    }
    return Run(record, arrays, poured.frames)


# --- measure --------------------------------------------------------------------------------------


def measure(
    record: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
    config: Mapping[str, Any],
    particle: "Particle",
    berry: Mapping[str, Any],
) -> dict[str, Any]:
    """The measured run: the record of a pour with every response of its pile.

    Parameters
    ----------
    record : mapping
        That of the `Run`.
    arrays : mapping
        ``position``, ``quaternion``, ``in_pile`` and, where berries differ in size, ``scale``.
    config : mapping
        The whole configuration.
    particle : Particle
    berry : mapping
        With the mean axes ``long_mm``, ``major_mm``, ``minor_mm``.

    Returns
    -------
    dict
        `ALWAYS`, and the other responses that are targets. Numbers are None where there is no pile to measure. A pile
        that lacks a target gets the status ``no_flank`` and keeps what could be measured.
    """
    from repose.measure.pile import MeasureSettings
    from repose.measure.saved_piles import pile_responses

    settings = MeasureSettings.of(config["measure"], berry)
    wanted = [one.name for one in BENCH.wanted(config)]
    more = [name for name in wanted if name not in ALWAYS and name not in record]
    judged = {key: record[key] for key in ("seed", "status", "reason")}
    measured = dict.fromkeys((*ALWAYS, *more))
    if record["status"] == "ok":
        plate_mm = config[NAME]["plate_diameter_mm"]
        found, reasons = pile_responses(arrays, particle, settings, plate_mm, more)
        measured |= found
        for name in wanted:
            if measured.get(name, record.get(name)) is None:
                judged |= {"status": "no_flank", "reason": reasons.get(name, f"{name} cannot be measured")}
                break
    return judged | measured | {key: value for key, value in record.items() if key not in judged}


BENCH = register(
    BenchTest(
        name=NAME,
        responses=RESPONSES,
        recorded=RECORDED,
        statuses=STATUSES,
        schema=Path(__file__).with_name("funnel.yaml"),
        build=build,
        run=run,
        measure=measure,
        duration_s=lambda config: config[NAME]["duration_s"],
        contradictions=contradictions,
        misfits=misfits,
        kept=("position", "quaternion", "in_pile"),
        in_words="angle of repose {aor_deg:.2f} deg, Height {height_mm:.1f} mm, "
        "{berries_on_plate} berries on the plate, {wall_s:.1f} s",
    )
)
