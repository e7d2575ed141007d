"""Places and orientations of new grains, and the filling of a scene."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from repose.dem.rotations import random_quaternion, rotation_matrix

if TYPE_CHECKING:
    from repose.bench.scene import Trial
    from repose.bench.settings import Poured
    from repose.dem import Simulation

# Random places that are tried for a new grain before the factory waits a time step.
PLACES_TRIED = 200
Random = np.random.Generator | None
Rests = Callable[[], bool] | None
LIKELY_PACKING = 0.6  # share of a bed that is solid
ALMOST = (
    1.0 - 1e-9
)  # of a square of a distance: the last digits of `Disc.places` are not sure


@dataclass(frozen=True)
class Disc:
    """A horizontal disc about the z axis."""

    radius_m: float
    height_m: float

    def place(self, first: float, second: float) -> tuple[float, float, float]:
        """Compute the point [m] of two uniformly random numbers between 0 and 1, by the standard library."""
        r, angle = self.radius_m * math.sqrt(first), 2.0 * math.pi * second
        return r * math.cos(angle), r * math.sin(angle), self.height_m

    def places(self, numbers: np.ndarray) -> np.ndarray:
        """Compute all points (N, 3) of numbers (N, 2) at once [m]; their last digits may be others."""
        r, angle = self.radius_m * np.sqrt(numbers[:, 0]), 2.0 * math.pi * numbers[:, 1]
        return np.column_stack(
            [r * np.cos(angle), r * np.sin(angle), np.full(len(r), self.height_m)]
        )


@dataclass(frozen=True)
class Strip:
    """A horizontal rectangle about the z axis; half its lengths along x and y, and its height."""

    half_x_m: float
    half_y_m: float
    height_m: float

    def place(self, first: float, second: float) -> tuple[float, float, float]:
        """Compute the point [m] of two numbers, as `Disc.place`."""
        return (
            self.half_x_m * (2.0 * first - 1.0),
            self.half_y_m * (2.0 * second - 1.0),
            self.height_m,
        )

    def places(self, numbers: np.ndarray) -> np.ndarray:
        """Compute points (N, 3) as `Disc.places`."""
        x, y = 2.0 * numbers.T - 1.0
        return np.column_stack(
            [self.half_x_m * x, self.half_y_m * y, np.full(len(x), self.height_m)]
        )


Factory = Disc | Strip  # horizontal areas in which grains appear


def free_place(
    rng: np.random.Generator, simulation: "Simulation", factory: Factory
) -> np.ndarray | None:
    """Find a random point (3,) of a factory [m] where a new grain cannot touch another; None if there is none."""
    place = np.array(factory.place(*rng.random(2)))
    others, reach = simulation.positions, 2.0 * simulation.radius
    others = others[simulation.present & (others[:, 2] > factory.height_m - reach)]

    def is_free(place: np.ndarray) -> bool:
        return not len(others) or bool(
            np.sum((others - place) ** 2, axis=1).min() > reach * reach
        )

    if is_free(place):
        return place
    before = rng.bit_generator.state
    numbers = rng.random((PLACES_TRIED - 1, 2))
    away = np.sum((factory.places(numbers)[:, None, :] - others) ** 2, axis=2).min(
        axis=1
    )
    for k in np.flatnonzero(away > ALMOST * reach * reach).tolist():
        place = np.array(factory.place(*numbers[k].tolist()))
        if is_free(place):
            # as if the numbers behind its own had never been drawn
            rng.bit_generator.state = before
            rng.random((k + 1, 2))
            return place
    return None


def random_orientation(orientation: str, rng: np.random.Generator) -> np.ndarray:
    """Draw a quaternion (w, x, y, z), body to world: ``random``, or the long axis ``lying`` or ``upright``."""
    if orientation == "random":
        return random_quaternion(rng)
    axis, about = rng.uniform(0.0, 2.0 * math.pi, 2)
    # about the long axis x, then for "upright" up, then about the vertical
    q = np.array([math.cos(about / 2), math.sin(about / 2), 0.0, 0.0])
    if orientation == "upright":
        q = math.sqrt(0.5) * np.array([q[0], q[1], -q[0], q[1]])
    c, s = math.cos(axis / 2), math.sin(axis / 2)
    w, x, y, z = q
    return np.array([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w])


def add_above(trial: "Trial", orientation: str, height_m: float = 0.0) -> None:
    """Add the grain of a trial on the z axis in a random orientation of a kind, its lowest point at a height."""
    turn, scale = (
        random_orientation(orientation, np.random.default_rng(trial.scene.seed)),
        float(trial.scales[0]),
    )
    down = rotation_matrix(turn).T @ np.array([0.0, 0.0, -1.0])
    depth = scale * float(trial.scene.particle.support_point(down[None])[0] @ down)
    trial.simulation.add("berry", (0.0, 0.0, height_m + depth), turn, scale=scale)


def last_berry_s(section: "Poured") -> float:
    """Compute when the last grain of a bench test appears [s]."""
    return (section.berries - 1) / section.rate_per_s


def too_early(section: "Poured", name: str, key: str) -> Iterator[tuple[str, str]]:
    """Yield a key of a section if its time is not after the last grain's, with the allowed values."""
    last = last_berry_s(section)
    if last >= getattr(section, key):
        yield f"{name}.{key}", f"above {last:g}, when the last grain appears"


def fill(
    trial: "Trial",
    factory: Factory,
    section: "Poured",
    last_step: int,
    grains: int | None = None,
    rng: Random = None,
) -> None:
    """Add grains one by one, the first at once, each where it touches none, up to a time step.

    `grains` is their number, by default the section's; `rng` is by default made of the scene's seed. A section may say
    their `orientation` (`random_orientation`) and their speed downwards, `speed_m_s`.
    """
    simulation = trial.simulation
    rng = np.random.default_rng(trial.scene.seed) if rng is None else rng
    orientation, down = (
        getattr(section, "orientation", "random"),
        (0.0, 0.0, -getattr(section, "speed_m_s", 0.0)),
    )
    first, began = simulation.n_bodies, simulation.steps
    for k in range(section.berries if grains is None else grains):
        due = began + round(k / section.rate_per_s / simulation.time_step_s)
        if due >= last_step:
            return
        trial.run_to(due)
        place = free_place(rng, simulation, factory)
        while place is None and simulation.steps < last_step:
            trial.run_to(simulation.steps + 1)
            place = free_place(rng, simulation, factory)
        if place is None:
            return
        turn, scale = random_orientation(orientation, rng), trial.scales[first + k]
        simulation.add("berry", place, turn, down, scale=scale)


def fill_and_rest(
    trial: "Trial",
    factory: Factory,
    section: "Poured",
    from_s: float,
    every: int,
    rests: Rests = None,
) -> None:
    """Fill a scene and advance to a time; then look every few steps whether it `rests`, at most twice as long.

    A section without a number of grains has ``filling_height_mm``, the level of the bed (`level_m`); the trial has as
    many scales as grains without gaps between them would take up to there. Half of the likely number are poured, then
    by the packing of those that rest the others.
    """
    simulation, most, rests = trial.simulation, len(trial.scales), rests or trial.rests
    first, latest = (
        round(seconds / simulation.time_step_s) for seconds in (from_s, 2.0 * from_s)
    )
    level_mm = getattr(section, "filling_height_mm", None)
    if level_mm is None:
        fill(trial, factory, section, latest)
    else:
        rng, gravity = (
            np.random.default_rng(trial.scene.seed),
            float(np.linalg.norm(simulation.physics.gravity)),
        )
        fall = math.ceil(
            math.sqrt(2.0 * factory.height_m / gravity) / simulation.time_step_s
        )
        missing = max(1, round(0.5 * LIKELY_PACKING * most))
        while missing > 0 and simulation.steps < latest and simulation.n_bodies < most:
            fill(
                trial,
                factory,
                section,
                latest,
                min(missing, most - simulation.n_bodies),
                rng,
            )
            trial.run_to(min(latest, simulation.steps + fall))
            trial.wait(rests, latest, every)
            missing = round(
                simulation.n_bodies * (1e-3 * level_mm / level_m(simulation) - 1.0)
            )
    trial.run_to(first)
    trial.wait(rests, latest, every)


def level_m(simulation: "Simulation") -> float:
    """Compute the level of a bed on a floor at z = 0: twice the height of its centre of mass [m]."""
    there = simulation.present
    masses = simulation.masses_kg[there]
    return 2.0 * float(masses @ simulation.positions[there, 2] / masses.sum())
