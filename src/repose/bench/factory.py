"""Add new grains to a simulation: where, when and in which orientation they appear.

A `Factory` describes the source of the grains. A trial (`repose.bench.trial.Trial`) is
the simulation of one run, which is "advanced" when it runs for some time steps.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from repose.dem.rotations import random_quaternion, rotation_matrix

if TYPE_CHECKING:
    from repose.bench.settings import Poured
    from repose.bench.trial import Trial
    from repose.dem import Simulation

# Largest number of random points that are tried for a new grain in a time step.
MOST_POINTS = 200
# Fraction of the volume of a bed that grains fill, to estimate their number at first.
LIKELY_PACKING = 0.6
# `Disc.points` may differ from `Disc.point` in the last digits. A point is therefore
# taken as likely free if its squared distances exceed the squared limit times this
# factor, and is then computed again by `Disc.point`.
ROUNDING_FACTOR = 1.0 - 1e-9


@dataclass(frozen=True)
class Disc:
    """A horizontal disc about the z axis."""

    radius_m: float
    height_m: float

    def point(self, first: float, second: float) -> tuple[float, float, float]:
        """Compute the point [m] that belongs to two random numbers from 0 to 1."""
        r = self.radius_m * math.sqrt(first)
        angle = 2.0 * math.pi * second
        return r * math.cos(angle), r * math.sin(angle), self.height_m

    def points(self, numbers: np.ndarray) -> np.ndarray:
        """Compute the points (N, 3) [m] of pairs of numbers (N, 2) at once.

        Their last digits may differ from those of `point`.
        """
        r = self.radius_m * np.sqrt(numbers[:, 0])
        angle = 2.0 * math.pi * numbers[:, 1]
        z = np.full(len(r), self.height_m)
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


@dataclass(frozen=True)
class Strip:
    """A horizontal rectangle about the z axis."""

    half_x_m: float  # half of its length along x
    half_y_m: float  # half of its length along y
    height_m: float

    def point(self, first: float, second: float) -> tuple[float, float, float]:
        """Compute the point [m] that belongs to two random numbers from 0 to 1."""
        x = self.half_x_m * (2.0 * first - 1.0)
        y = self.half_y_m * (2.0 * second - 1.0)
        return x, y, self.height_m

    def points(self, numbers: np.ndarray) -> np.ndarray:
        """Compute the points (N, 3) [m] of pairs of numbers (N, 2) at once."""
        x, y = 2.0 * numbers.T - 1.0
        z = np.full(len(x), self.height_m)
        return np.column_stack([self.half_x_m * x, self.half_y_m * y, z])


Area = Disc | Strip


@dataclass(frozen=True)
class Factory:
    """The source of new grains: place, number and rate at which they are added.

    Attributes
    ----------
    area : Disc or Strip
        Area in which the centres of the grains appear.
    n_grains : int
        Number of grains.
    rate_per_s : float
        Grains per second.
    orientation : str
        Kind of the random orientation of a grain, see `draw_orientation`.
    speed_m_s : float
        Initial speed of a grain downwards.
    """

    area: Area
    n_grains: int
    rate_per_s: float
    orientation: str = "random"
    speed_m_s: float = 0.0


def find_free_point(
    rng: np.random.Generator, simulation: "Simulation", area: Area
) -> np.ndarray | None:
    """Find a random point of an area at which a new grain touches no other grain.

    Up to `MOST_POINTS` points are tried. All points after the first are computed at
    once, which is quicker. The result and the state of the random generator are the
    same as if the points were tried one by one, with two random numbers for each.

    Parameters
    ----------
    rng : Generator
        Random generator. It is advanced by two numbers for each point that is tried.
        Runs are only reproducible if this order of the numbers stays.
    simulation : repose.dem.Simulation
        The simulation with its grains.
    area : Disc or Strip
        Area in which the centre of the new grain may lie.

    Returns
    -------
    array or None
        The point (3,) [m]; None if no point is free.
    """
    # Two grains cannot touch if their centres are farther apart than this distance. So
    # a grain that lies deeper than this below the area cannot touch a new grain, and is
    # left out.
    contact_distance = 2.0 * simulation.radius
    positions = simulation.positions
    is_high = positions[:, 2] > area.height_m - contact_distance
    neighbours = positions[simulation.present & is_high]

    # The first point is usually free.
    point = np.array(area.point(*rng.random(2)))
    if _is_free(point, neighbours, contact_distance):
        return point

    # Draw the random numbers of all other points at once, and list the points that seem
    # free. Points are computed in an array, which may change their last digits.
    state_before = rng.bit_generator.state
    numbers = rng.random((MOST_POINTS - 1, 2))
    candidates = _find_likely_free(area.points(numbers), neighbours, contact_distance)
    for candidate in candidates:
        # Compute the point again by itself, so that its digits do not depend on the
        # array.
        point = np.array(area.point(*numbers[candidate].tolist()))
        if _is_free(point, neighbours, contact_distance):
            # Too many random numbers were drawn. Restore the state of the generator,
            # and draw only those up to and including this point.
            rng.bit_generator.state = state_before
            rng.random((candidate + 1, 2))
            return point
    return None


def _is_free(
    point: np.ndarray, neighbours: np.ndarray, contact_distance: float
) -> bool:
    """Return whether all grains are farther from a point than the contact distance.

    Parameters
    ----------
    point : array
        The point (3,) [m].
    neighbours : array
        Centres (N, 3) [m] of the grains. The array may be empty.
    contact_distance : float
        Distance [m] up to which two grains may touch.
    """
    if not len(neighbours):
        return True
    squared_distances = np.sum((neighbours - point) ** 2, axis=1)
    return bool(squared_distances.min() > contact_distance * contact_distance)


def _find_likely_free(
    points: np.ndarray, neighbours: np.ndarray, contact_distance: float
) -> list[int]:
    """List the points that are free, apart from rounding errors.

    Parameters
    ----------
    points : array
        Points (M, 3) [m]. Their last digits may be wrong.
    neighbours : array
        Centres (N, 3) [m] of at least one grain.
    contact_distance : float
        Distance [m] up to which two grains may touch.

    Returns
    -------
    list of int
        Indices of these points, in increasing order.
    """
    # The offsets of all points from all grains, of the shape (M, N, 3)
    offsets = points[:, np.newaxis, :] - neighbours
    smallest_squares = np.sum(offsets**2, axis=2).min(axis=1)
    is_likely_free = (
        smallest_squares > ROUNDING_FACTOR * contact_distance * contact_distance
    )
    return np.flatnonzero(is_likely_free).tolist()


def draw_orientation(orientation: str, rng: np.random.Generator) -> np.ndarray:
    """Draw a random orientation of a grain.

    Parameters
    ----------
    orientation : str
        ``random`` for any orientation, ``upright`` for a vertical long axis, or
        ``lying`` for a level long axis. Any other word counts as ``lying``.
    rng : Generator
        Random generator, which is advanced.

    Returns
    -------
    array
        Quaternion (w, x, y, z) that rotates vectors from the frame of the body to that
        of the world.
    """
    if orientation == "random":
        return random_quaternion(rng)
    # A body whose long axis is level or vertical can still be turned about the vertical
    # (azimuth) and rolled about its long axis (roll). Both angles are uniform, so no
    # orientation is preferred.
    azimuth, roll = rng.uniform(0.0, 2.0 * math.pi, 2)

    # The body is first rolled about its long axis, x. This is the quaternion (cos, sin,
    # 0, 0) of half the angle.
    cos_roll = math.cos(roll / 2)
    sin_roll = math.sin(roll / 2)
    if orientation == "upright":
        # Then it is turned by -90 degrees about y, which makes the long axis vertical.
        # This is a multiplication by the quaternion sqrt(1/2) (1, 0, -1, 0) from the
        # left.
        w, x, y, z = math.sqrt(0.5) * np.array(
            [cos_roll, sin_roll, -cos_roll, sin_roll]
        )
    else:
        # The long axis is level already.
        w, x, y, z = np.array([cos_roll, sin_roll, 0.0, 0.0])

    # Finally it is turned about the vertical. This is a multiplication by the
    # quaternion (c, 0, 0, s) from the left.
    c = math.cos(azimuth / 2)
    s = math.sin(azimuth / 2)
    return np.array([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w])


def add_above(trial: "Trial", orientation: str, height_m: float = 0.0) -> None:
    """Add a single grain on the z axis, with its lowest point at a height.

    The grain takes the first of the relative sizes of the trial.

    Parameters
    ----------
    trial : Trial
        The simulation of a run with one free grain, which is added. Its seed determines
        the orientation.
    orientation : str
        Kind of the random orientation, see `draw_orientation`.
    height_m : float, optional
        Height of the lowest point above z = 0.
    """
    rng = np.random.default_rng(trial.scene.seed)
    quaternion = draw_orientation(orientation, rng)
    scale = float(trial.scales[0])
    # Find how far the lowest point lies below the centre. The particle computes the
    # farthest extent in a direction of the body's frame, so convert the downward
    # direction to this frame.
    down_in_body = rotation_matrix(quaternion).T @ np.array([0.0, 0.0, -1.0])
    lowest_point = trial.scene.particle.support_point(down_in_body[np.newaxis])[0]
    depth_m = scale * float(lowest_point @ down_in_body)
    centre = (0.0, 0.0, height_m + depth_m)
    # "berry" is the name of the shape of all grains.
    trial.simulation.add("berry", centre, quaternion, scale=scale)


def last_berry_s(section: "Poured") -> float:
    """Compute the time [s] at which the last grain appears.

    The first grain appears at the time 0. `berries` is the number of grains.
    """
    return (section.berries - 1) / section.rate_per_s


def too_early(section: "Poured", name: str, key: str) -> Iterator[tuple[str, str]]:
    """Yield the key of a time that lies before the last grain has appeared.

    Parameters
    ----------
    section : Poured
        Section of a bench test in the configuration.
    name : str
        Name of the section.
    key : str
        Key of the time within the section.

    Yields
    ------
    tuple of str
        The key with its section, and the allowed values in words. Nothing is yielded if
        the time is late enough.
    """
    last_grain_s = last_berry_s(section)
    if last_grain_s >= getattr(section, key):
        yield f"{name}.{key}", f"above {last_grain_s:g}, when the last grain appears"


def fill(trial: "Trial", factory: Factory, last_step: int) -> None:
    """Add the grains of a factory to a trial one by one, up to a last time step.

    The first grain appears at once. Each grain appears where it touches no other grain.
    The random numbers depend on the seed of the scene.

    Parameters
    ----------
    trial : Trial
        The simulation of the run, without grains. It is advanced until the last grain
        has appeared.
    factory : Factory
        The source of the grains.
    last_step : int
        The last time step, counted from the beginning of the simulation. Grains that
        are due at this step or later are left out.
    """
    rng = np.random.default_rng(trial.scene.seed)
    _add_grains(trial, factory, factory.n_grains, last_step, rng)


def fill_and_rest(
    trial: "Trial",
    factory: Factory,
    until_s: float,
    check_interval: int,
    is_at_rest: Callable[[], bool] | None = None,
) -> None:
    """Fill a trial, advance it to a time, and wait until the grains are at rest.

    The wait ends at twice that time at the latest, even if the grains still move.

    Parameters
    ----------
    trial : Trial
        The simulation of the run, without grains. It is advanced in place.
    factory : Factory
        The source of the grains.
    until_s : float
        Shortest simulated time [s] of filling and rest.
    check_interval : int
        Time steps between two checks whether the grains are at rest.
    is_at_rest : function, optional
        ``is_at_rest()`` tells whether the grains are at rest; by default
        `Trial.is_at_rest`.
    """
    time_step_s = trial.simulation.time_step_s
    latest_step = round(2.0 * until_s / time_step_s)
    fill(trial, factory, latest_step)
    trial.run_to(round(until_s / time_step_s))
    trial.wait(is_at_rest or trial.is_at_rest, latest_step, check_interval)


def fill_to_level_and_rest(
    trial: "Trial",
    factory: Factory,
    level_mm: float,
    until_s: float,
    check_interval: int,
    is_at_rest: Callable[[], bool] | None = None,
) -> None:
    """Fill a trial up to a level of the bed, and wait until the grains are at rest.

    First, half of the likely number of grains is added. Once they are at rest, the
    level of the bed (`bed_level_m`) shows how many grains are still missing, and these
    are added. This is repeated until no grain is missing. The wait for rest ends at
    twice the time `until_s` at the latest, even if the grains still move.

    Parameters
    ----------
    trial : Trial
        The simulation of the run, without grains. It is advanced in place.
    factory : Factory
        The source of the grains. Its `n_grains` is the largest number that is added. It
        must be at least the number that would fill the bed without gaps.
    level_mm : float
        The level of the bed.
    until_s : float
        Shortest simulated time [s] of filling and rest.
    check_interval : int
        Time steps between two checks whether the grains are at rest.
    is_at_rest : function, optional
        ``is_at_rest()`` tells whether the grains are at rest; by default
        `Trial.is_at_rest`.
    """
    simulation = trial.simulation
    time_step_s = simulation.time_step_s
    latest_step = round(2.0 * until_s / time_step_s)
    fall_steps = _count_fall_steps(trial, factory.area.height_m)
    rest_check = is_at_rest or trial.is_at_rest
    rng = np.random.default_rng(trial.scene.seed)

    # `n_grains` would fill the bed without gaps, so a part of it is the likely number.
    n_missing = max(1, round(0.5 * LIKELY_PACKING * factory.n_grains))
    while n_missing > 0 and simulation.steps < latest_step:
        n_left = factory.n_grains - simulation.n_bodies
        if n_left <= 0:
            break
        _add_grains(trial, factory, min(n_missing, n_left), latest_step, rng)
        # Let the last grain fall to the bed before the grains are checked for rest.
        trial.run_to(min(latest_step, simulation.steps + fall_steps))
        trial.wait(rest_check, latest_step, check_interval)
        # The level of a bed is proportional to the number of its grains. So the number
        # is wrong by the same fraction as the level. At least one grain has been added,
        # so the level is above 0.
        missing_share = 1e-3 * level_mm / bed_level_m(simulation) - 1.0
        n_missing = round(simulation.n_bodies * missing_share)
    trial.run_to(round(until_s / time_step_s))
    trial.wait(rest_check, latest_step, check_interval)


def _count_fall_steps(trial: "Trial", height_m: float) -> int:
    """Compute the time steps of a fall from a height to z = 0, rounded up."""
    simulation = trial.simulation
    gravity = float(np.linalg.norm(simulation.physics.gravity))
    fall_s = math.sqrt(2.0 * height_m / gravity)
    return math.ceil(fall_s / simulation.time_step_s)


def _add_grains(
    trial: "Trial",
    factory: Factory,
    n_grains: int,
    last_step: int,
    rng: np.random.Generator,
) -> None:
    """Add a number of grains at the rate of a factory, up to a last time step.

    A grain is due at a fixed time after the call. It appears later if there is no room.

    Parameters
    ----------
    trial : Trial
        The simulation of the run, which is advanced in place.
    factory : Factory
        The source of the grains: their area, rate, speed and orientation.
    n_grains : int
        Number of grains. Grains that have not been added by the last time step are left
        out.
    last_step : int
        The last time step, counted from the beginning of the simulation.
    rng : Generator
        Random generator for positions and orientations, which is advanced.
    """
    simulation = trial.simulation
    n_before = simulation.n_bodies
    first_step = simulation.steps
    velocity = (0.0, 0.0, -factory.speed_m_s)
    for index in range(n_grains):
        # A wait for room does not delay the grains that follow.
        due_s = index / factory.rate_per_s
        due_step = first_step + round(due_s / simulation.time_step_s)
        if due_step >= last_step:
            return
        trial.run_to(due_step)
        point = _wait_for_point(trial, factory.area, last_step, rng)
        if point is None:
            return
        quaternion = draw_orientation(factory.orientation, rng)
        # Sizes were drawn for all grains of the run, so continue after those already
        # there.
        scale = trial.scales[n_before + index]
        simulation.add("berry", point, quaternion, velocity, scale=scale)


def _wait_for_point(
    trial: "Trial", area: Area, last_step: int, rng: np.random.Generator
) -> np.ndarray | None:
    """Wait until an area has room for a new grain, and return a point for its centre.

    The area has room again once the grains in it have fallen out of the way.

    Parameters
    ----------
    trial : Trial
        The trial, which is advanced step by step while there is no room.
    area : Disc or Strip
        Area in which the centre of the grain may lie.
    last_step : int
        The last time step of the wait, counted from the beginning of the simulation.
    rng : Generator
        Random generator for the point, which is advanced.

    Returns
    -------
    array or None
        The point (3,) [m]; None if there is no room up to the last time step.
    """
    simulation = trial.simulation
    point = find_free_point(rng, simulation, area)
    while point is None and simulation.steps < last_step:
        trial.run_to(simulation.steps + 1)
        point = find_free_point(rng, simulation, area)
    return point


def bed_level_m(simulation: "Simulation") -> float:
    """Compute the level [m] of a bed on a floor at z = 0.

    The level is twice the height of the centre of mass, as for a bed of even density.
    """
    present = simulation.present
    masses = simulation.masses_kg[present]
    heights = simulation.positions[present, 2]
    return 2.0 * float(masses @ heights / masses.sum())
