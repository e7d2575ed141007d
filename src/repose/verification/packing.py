"""Packings at rest: equal spheres in a hexagonal lattice, and grains poured into a box."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from repose.dem import (
    Contact,
    Material,
    Shape,
    Simulation,
    random_quaternion,
    rotation_matrix,
)
from repose.dem.materials import effective_moduli

from .case import Effort, Rows, at_most, close, within
from .machine import (
    BERRY_DENSITY,
    BERRY_M,
    GRAVITY,
    PVC,
    STILL,
    berry_simulation,
    box,
    frictionless,
    simulation_of,
    under_gravity,
)

STIFF = Material(
    1.3e6, 0.32
)  # thirty times a berry, so that overlaps under the weight stay below a per cent
STEP = 5e-5
FALL_S = 2.0  # time to fall and come to rest
MARGIN = 0.012  # distance of the core from floor, top and side walls [m]
RADIUS = 0.006
BOXES = (
    4  # poured boxes: the solid fraction of one box of 100 berries scatters by 0.015
)

# Random packings of ellipsoids. Solid fraction: with friction 0.54 to 0.70 (shaken experiments: Schaller 2012);
# without, 0.64 of spheres to 0.735 of the best ellipsoids (Donev et al. 2004, Science 303, 990), less 0.02 for walls.
# Coordination number: 4 is the isostatic limit of bodies with endless friction, 12 that of ellipsoids without.
FRICTIONAL = ((0.54, 0.70), (4.0, 10.0))
SMOOTH = ((0.62, 0.74), (6.0, 12.0))
SOURCES = (
    "Schaller 2012 (frictional, 0.54-0.70); Delaney, Hilton & Cleary 2011",
    "Donev et al. 2004 (frictionless, 0.64-0.735)",
    "isostatic limits: 4 with endless friction, 12 without; Donev et al. 2004: about 10",
)


def hexagonal_packing(effort: Effort) -> Rows:
    """Let rows of spheres without friction between a floor and walls settle into their lattice and stay."""
    rows_of, columns = 6, 8
    shape, width = Shape.sphere(RADIUS, BERRY_DENSITY, "berry"), columns * 2.0 * RADIUS
    room: dict[str, Any] = {
        "capacity": rows_of * columns,
        "lower": (0.0, -0.02, 0.0),
        "upper": (width, 0.02, 0.12),
    }
    room |= {"material": STIFF, **under_gravity(box(0.0, width, -RADIUS, RADIUS))}
    simulation = simulation_of(shape, frictionless(0.3), STEP, **room, **effort.laws)
    for row in range(rows_of):
        for k in range(columns - row % 2):
            simulation.add(
                "body",
                (
                    (2 * k + 1 + row % 2) * RADIUS,
                    0.0,
                    RADIUS * (1.0 + math.sqrt(3.0) * row),
                ),
            )
    lattice = simulation.positions.copy()
    simulation.run_steps(10000)
    settled = simulation.positions.copy()
    simulation.run_steps(10000)
    young, _ = effective_moduli(STIFF, PVC)
    overlap = RADIUS - simulation.positions[:columns, 2]
    carried = 4.0 / 3.0 * young * math.sqrt(RADIUS) * np.sum(overlap**1.5)
    weight = len(lattice) * shape.mass_kg * GRAVITY
    moved, crept = (
        np.abs(simulation.positions - before).max() / RADIUS
        for before in (lattice, settled)
    )
    yield close(
        "force on the floor, by the overlaps",
        "mN",
        1e3 * carried,
        1e3 * weight,
        "closed form: the weight",
    )
    yield at_most(
        "farthest from the lattice, over the radius",
        "",
        moved,
        0.05,
        "lattice of touching spheres",
    )
    yield at_most(
        "motion in the last 0.5 s, over the radius", "", crept, 1e-6, "at rest"
    )
    yield at_most(
        "kinetic energy", "J", simulation.kinetic_energies().sum(), 1e-20, "at rest"
    )


def poured_packing(effort: Effort) -> Rows:
    """Pour grains into boxes, with friction and without: solid fraction and coordination number of the cores."""
    rough = "mu 0.6", Contact(0.1, 0.6, 0.05), FRICTIONAL, SOURCES[0]
    smooth = "frictionless", frictionless(0.1), SMOOTH, SOURCES[1]
    for name, contact, (fractions, numbers), source in (rough, smooth):
        cores = [
            _core(*_pour(effort.berries, contact, 29 + box, effort.laws))
            for box in range(BOXES)
        ]
        fraction, number, energy = np.array(cores).T
        yield within(
            f"{name}: solid fraction of the core",
            "",
            fraction.mean(),
            *fractions,
            source,
        )
        yield within(
            f"{name}: coordination number of the core",
            "",
            number.mean(),
            *numbers,
            SOURCES[2],
        )
        words = f"{name}: kinetic energy over m g times the thickness"
        yield at_most(words, "", energy.max(), 0.01, "nearly at rest")


def _core(simulation: Simulation, side: float) -> tuple[float, float, float]:
    """Measure solid fraction and coordination number of a box's core, and the mean energy over m g thickness."""
    heights, profile = solid_fraction_profile(simulation, side)
    top = float(
        np.sort(simulation.positions[:, 2])[-10:].mean()
    )  # the mean centre of the ten highest grains
    fraction = profile[(heights > MARGIN) & (heights < top - MARGIN)].mean()
    lift = simulation.shapes["body"].mass_kg * GRAVITY * 2.0 * BERRY_M[2]
    return (
        fraction,
        coordination(simulation, side, top),
        simulation.kinetic_energies().mean() / lift,
    )


def _pour(
    n: int, contact: Contact, seed: int, laws: Mapping[str, Any]
) -> tuple[Simulation, float]:
    """Fill a box with grains, released together from a loose lattice in random orientations, until they rest."""
    rng = np.random.default_rng(seed)
    columns, pitch = max(2, round((n / 3.5) ** (1.0 / 3.0))), 0.0216
    side, levels = columns * pitch, -(-n // columns**2)
    room: dict[str, Any] = {
        "capacity": n,
        "lower": STILL,
        "upper": (side, side, pitch * (levels + 1)),
    }
    room |= {"material": STIFF, **under_gravity(box(0.0, side, 0.0, side))}
    simulation = berry_simulation(contact, STEP, **room, **laws)
    for k in range(n):
        level, cell = divmod(k, columns**2)
        place = pitch * (np.array([cell % columns, cell // columns, level]) + 0.5)
        simulation.add("body", place, random_quaternion(rng), (0.0, 0.0, -0.3))
    simulation.run_steps(round(FALL_S / STEP))
    return simulation, side


def solid_fraction_profile(
    simulation: Simulation, side: float, points: int = 900
) -> tuple[np.ndarray, np.ndarray]:
    """Give the middles [m] of slices 4 mm thick, and the share of random points in each that lie inside a grain."""
    rng = np.random.default_rng(31)
    heights = np.arange(0.002, simulation.positions[:, 2].max(), 0.004)
    inverse = [
        rotation_matrix(q).T / np.array(BERRY_M)[:, None]
        for q in simulation.quaternions
    ]
    profile = []
    for height in heights:
        low, high = (
            (MARGIN, MARGIN, height - 0.002),
            (side - MARGIN, side - MARGIN, height + 0.002),
        )
        places = rng.uniform(low, high, (points, 3))
        inside = np.zeros(points, bool)
        for centre, matrix in zip(simulation.positions, inverse, strict=True):
            if abs(centre[2] - height) < BERRY_M[0] + 0.002:
                inside |= np.sum(((places - centre) @ matrix.T) ** 2, axis=1) < 1.0
        profile.append(inside.mean())
    return heights, np.array(profile)


def coordination(simulation: Simulation, side: float, top: float) -> float:
    """Average the touching neighbours of the grains in the core, `MARGIN` away from the walls and the top."""
    places = simulation.positions
    core = np.all(
        (places > MARGIN) & (places < np.array([side, side, top]) - MARGIN), axis=1
    )
    return float(
        np.bincount(simulation.contacts().ravel(), minlength=simulation.n_bodies)[
            core
        ].mean()
    )
