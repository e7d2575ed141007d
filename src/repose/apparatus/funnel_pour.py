"""A pour: berries fall through the funnel onto the plate, and what is left of them is judged.

`repose.apparatus.funnel` makes a bench test of it.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from repose import dem
from repose.apparatus.bounds import Bounded, Unstable
from repose.apparatus.factory import Disc, fill
from repose.apparatus.funnel_geometry import Funnel
from repose.apparatus.scene import Filmed, berry_simulation, largest_cluster
from repose.apparatus.settings import SimulationSettings

if TYPE_CHECKING:
    from repose.particle.particle import Particle

NAME = "funnel"
# A pile that has lost more than this share of its berries over the edge of the plate is not the pile poured.
LARGEST_LOSS = 0.1
# Of the berries on the plate, those that touch each other; in 2810 pours of the article's study and ours at least 86 %.
SMALLEST_PILE = 0.5
FEWEST_IN_PILE = 10
# Below this height a berry has left the plate and is gone.
FLOOR_M = -0.05


@dataclass(frozen=True)
class Pour:
    """What is left of a pour, and the numbers that judge it.

    Attributes
    ----------
    centres_m, quaternions, scales : numpy.ndarray, (N, 3), (N, 4), (N,)
        Of the N berries that were poured.
    on_plate, in_pile : numpy.ndarray of bool, (N,)
        Which of them lie on the plate, and in its largest cluster.
    in_funnel, off_plate : int
        How many are still in the funnel, and have left the plate.
    unstable : str
        Which bound the pour broke, see `repose.apparatus.bounds`; empty where it broke none.
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
    unstable: str
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
    largest_scale : float, optional
        Of a berry, relative to the particle.

    Returns
    -------
    repose.dem.Simulation
        Without a berry.

    Raises
    ------
    InputError
        If the time step is too long for the particle.
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
    """Pour the berries through the funnel and let them rest.

    Berries appear one by one at `rate_per_s` above the inlet, drawn from the seed; see
    `repose.apparatus.factory.fill`.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    parameters : mapping
        The six contact parameters by name.
    seed : int
        Of the berries' places and sizes.
    particle : Particle
        The berry's body.
    berry : mapping
        What the verb ``berry`` writes.
    interval_s : float, optional
        Simulated time between two frames of a film; none without it.
    progress : callable, optional
        Called with the simulated time [s].

    Returns
    -------
    Pour
        Where the berries lie, and what judges the pour.

    Raises
    ------
    InputError
        If the time step is too long for the particle.

    References
    ----------
    Section 3.1 of the paper.
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
    bounded = Bounded(simulation, height)
    filmed = Filmed(bounded, interval_s, progress)
    before, clock, unstable = None, began, ""
    try:
        fill(simulation, factory, section, seed, rest_step, filmed.run_to, scales)
        timed_step = max(timed_step, simulation.steps)
        filmed.run_to(timed_step)
        clock = time.perf_counter()
        filmed.run_to(rest_step)
        before = simulation.positions.copy()
        filmed.run_to(last_step)
        bounded.look()
    except Unstable as broken:
        unstable = str(broken)
    us_per_step = 1e6 * (time.perf_counter() - clock) / max(1, last_step - timed_step)
    took_s = time.perf_counter() - began
    return _judge(simulation, funnel, before, unstable, filmed.frames(), took_s, us_per_step)


def _judge(simulation, funnel, before, unstable, frames, wall_s, us_per_step) -> Pour:
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
    motion = np.linalg.norm(centres - (centres if before is None else before), axis=1)[on_plate]
    return Pour(
        centres_m=centres,
        quaternions=simulation.quaternions.copy(),
        scales=simulation.scales.copy(),
        on_plate=on_plate,
        in_pile=in_pile,
        in_funnel=int(in_funnel.sum()),
        off_plate=int(len(centres) - in_funnel.sum() - on_plate.sum()),
        unstable=unstable,
        kinetic_energy_j=float(pile_energy.sum()),
        largest_motion_m=float(motion.max(initial=0.0)),
        discharge_s=float(exits.max() - exits.min()) if len(exits) else math.nan,
        wall_s=wall_s,
        us_per_step=us_per_step,
        frames=frames,
    )


def status_of(poured: Pour, config: Mapping[str, Any]) -> tuple[str, str]:
    """How a pour ended, before it is measured.

    Parameters
    ----------
    poured : Pour
        Of `pour`.
    config : mapping
        The whole configuration.

    Returns
    -------
    status : str
        ``ok``, ``unstable``, ``jammed``, ``left_plate``, ``not_at_rest`` or ``no_flank``.
    reason : str
        In words; empty for ``ok``.
    """
    section, n = config[NAME], config[NAME]["berries"]
    if poured.unstable:
        return "unstable", poured.unstable
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
    in_pile, there = int(poured.in_pile.sum()), int(poured.on_plate.sum())
    if in_pile < max(FEWEST_IN_PILE, SMALLEST_PILE * there):
        return "no_flank", (
            f"{in_pile} of {there} berries touch each other in the largest pile; "
            f"a pile has at least {FEWEST_IN_PILE} and {100 * SMALLEST_PILE:g} % of them"
        )
    return "ok", ""
