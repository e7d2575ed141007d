"""A simulation of grains among walls of one material, frames of it on the way, and its largest cluster."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from repose import dem
from repose.bench.bounds import Bounded
from repose.bench.parameters import FURTHER
from repose.common.errors import InputError
from repose.dem.constants import TWISTING

if TYPE_CHECKING:
    from repose.bench.bench_test import Scene
    from repose.dem import time_steps


Progress = Callable[[float], object] | None
Build = Callable[["Scene", float], "dem.Simulation"]


def grain_simulation(
    scene: "Scene", capacity: int, **arguments: Any
) -> "dem.Simulation":
    """Make an empty simulation of grains among walls of the material ``wall``.

    `arguments` holds walls, lower, upper and other arguments of `repose.dem.Simulation`; InputError for too long a
    time step.
    """
    settings = scene.simulation
    limit = longest_time_step(scene)
    if settings.time_step_s > limit.time_step_s:
        raise InputError(
            "configuration",
            "simulation.time_step_s",
            settings.time_step_s,
            limit.allowed,
        )
    shapes: Any = {"berry": scene.particle.dem_shape("berry")}
    arguments |= settings.laws | {
        "capacity": capacity,
        "gravity_m_s2": (0.0, 0.0, -settings.gravity_m_s2),
    }
    return dem.Simulation(
        shapes,
        materials_of(scene),
        _contacts(scene.parameters),
        settings.time_step_s,
        **arguments,
    )


def longest_time_step(scene: "Scene") -> "time_steps.Limit":
    """Return the longest time step that the engine allows for the grains, the smallest included."""
    from repose.dem import time_steps
    from repose.dem.contact_table import pairs_of
    from repose.dem.laws import CONTACT_LAWS
    from repose.grain import size_distribution

    settings, materials = scene.simulation, materials_of(scene)
    pairs, shapes = (
        pairs_of(_contacts(scene.parameters), materials),
        {"berry": scene.particle.dem_shape("berry")},
    )
    law, walls = CONTACT_LAWS[settings.contact_law], frozenset({"wall"})
    contacts = time_steps.Scene(law, settings.tension, materials, pairs, shapes, walls)
    smallest = size_distribution.smallest(scene.settings.size_distribution, scene.grain)
    return time_steps.longest(contacts, smallest_scale=smallest)


def materials_of(scene: "Scene") -> "dict[str, dem.Material]":
    """Return the materials ``berry`` and ``wall``."""
    wall, grain = scene.settings.wall, scene.grain
    return {
        "berry": dem.Material(grain["shear_modulus_pa"], grain["poisson_ratio"]),
        "wall": dem.Material(wall.shear_modulus_pa, wall.poisson_ratio),
    }


def _contacts(parameters: Mapping[str, float]) -> "dict[tuple[str, str], dem.Contact]":
    """Their contacts by pairs of names, with the constants of the contact law that are among the parameters."""
    contacts = {}
    for pair, names in (("gg", ("berry", "berry")), ("gp", ("berry", "wall"))):
        further = {
            of.constant.name: parameters[name]
            for name, of in FURTHER.items()
            if of.pair == pair and name in parameters
        }
        restitution, static, rolling = (
            parameters[f"{kind}_{pair}"] for kind in ("e", "mus", "mur")
        )
        twisting = further.pop(TWISTING.name, None)
        contacts[names] = dem.Contact(
            restitution, static, rolling, twisting, constants=further
        )
    return contacts


class Trial:
    """A scene that is simulated within bounds: bodies with room for the largest grain of its seed, and their sizes.

    It calls `progress` with the simulated time, and records a frame each `interval_s`.
    """

    bounded: Bounded

    def __init__(
        self,
        build: Build,
        scene: "Scene",
        grains: int,
        interval_s: float | None = None,
        progress: Progress = None,
    ) -> None:
        from repose.grain.size_distribution import of_pour

        self.scene, self.progress = scene, progress
        self.scales, largest = of_pour(
            scene.settings.size_distribution, scene.grain, scene.seed, grains
        )
        self.reach_m = (
            largest * scene.particle.bounding_radius_m
        )  # of the largest grain
        self.simulation = build(scene, largest)
        self.every = (
            None
            if interval_s is None
            else max(1, round(interval_s / self.simulation.time_step_s))
        )
        self.recorder = None if interval_s is None else dem.Recorder()

    def bound(self, top_m: float, speed_m_s: float = 0.0) -> Bounded:
        """Set the bounds within which it runs, see `repose.bench.bounds.Bounded`."""
        self.bounded = Bounded(self.simulation, top_m, speed_m_s)
        return self.bounded

    @property
    def broken(self) -> str:
        """The bound that was broken; empty where none was."""
        return self.bounded.broken

    def run_to(self, step: int) -> None:
        """Advance to a time step, unless it has passed; `Unstable` if a bound is broken."""
        now = self.simulation.steps
        while now < step:
            stop = (
                step
                if self.every is None
                else min(step, (now // self.every + 1) * self.every)
            )
            self.bounded.run_to(stop)
            now = stop
            if (
                self.recorder is not None
                and self.every is not None
                and now % self.every == 0
            ):
                self.recorder(self.simulation)
        if self.progress is not None:
            self.progress(self.simulation.time_s)

    def wait(self, until: Callable[[], bool], last_step: int, every: int) -> None:
        """Advance by `every` time steps until a condition holds, at most to a last time step."""
        while not until() and self.simulation.steps < last_step:
            self.run_to(min(last_step, self.simulation.steps + every))

    def frames(self, walls: bool = False) -> dict[str, np.ndarray] | None:
        """Return the frames; None if none were requested.

        ``scale`` (N,), ``time_s`` (T,), ``position`` (T, N, 3) [m] and ``quaternion`` (T, N, 4) of all N bodies that
        there is room for; NaN where a body is not there. With `walls` also the positions of the walls, as of
        `repose.dem.Recorder.frames`, for films of moving walls.
        """
        if self.recorder is None:
            return None
        kept, room = self.recorder.frames(), self.simulation.capacity
        missing = room - len(kept["scale"])
        absent = ((0, 0), (0, missing), (0, 0))
        return {
            "scale": np.pad(kept["scale"], (0, missing), constant_values=1.0),
            "time_s": kept["time_s"],
            "position": np.pad(kept["position"], absent, constant_values=np.nan),
            "quaternion": np.pad(kept["quaternion"], absent, constant_values=np.nan),
        } | ({name: kept[name] for name in ("planes", "wall_frames")} if walls else {})

    def energy_j(self) -> float:
        """Compute the mean kinetic energy of a grain."""
        return float(self.simulation.kinetic_energies().mean())

    def rests(self) -> bool:
        """Whether the mean kinetic energy of a grain is at most that of a bed at rest, or is not a number."""
        return not self.energy_j() > self.scene.simulation.rest_energy_j

    def grains(self, **further: np.ndarray) -> dict[str, np.ndarray]:
        """Keep the grains as they are, see `kept_grains`."""
        simulation = self.simulation
        return kept_grains(
            simulation.positions, simulation.quaternions, simulation.scales, **further
        )


def kept_grains(
    position: np.ndarray,
    quaternion: np.ndarray,
    scale: np.ndarray,
    **further: np.ndarray,
) -> dict[str, np.ndarray]:
    """Name the arrays of grains, and further ones as they are; in single precision: 0.03 um at the edge of a plate."""
    bodies = {
        "position": position.astype(np.float32),
        "quaternion": quaternion.astype(np.float32),
    }
    return {**bodies, **further, "scale": scale.astype(np.float32)}


def largest_cluster(contacts: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Mask (N,) of the largest set of allowed bodies (N,) that contacts (M, 2) connect; of equal ones the first."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(allowed)
    if not n or not allowed.any():
        return np.zeros(n, bool)
    kept = (
        contacts[allowed[contacts[:, 0]] & allowed[contacts[:, 1]]]
        if len(contacts)
        else contacts
    )
    graph = coo_array((np.ones(len(kept)), (kept[:, 0], kept[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    return allowed & (label == np.bincount(label[allowed]).argmax())
