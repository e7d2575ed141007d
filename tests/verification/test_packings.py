"""Packings at rest: a lattice of equal spheres, and grains poured into a box."""

import math

import numpy as np
import pytest
from verification.simulations import (
    GRAIN_DENSITY,
    GRAIN_M,
    GRAVITY,
    PVC,
    STILL,
    box,
    frictionless,
    grain_simulation,
    simulation_of,
    under_gravity,
)

from repose.dem import Contact, Material, Shape, random_quaternion, rotation_matrix
from repose.dem.materials import effective_moduli

# Thirty times as stiff as a grain, so that overlaps under the weight stay below a per
# cent.
STIFFENED = Material(1.3e6, 0.32)
STEP = 5e-5
FALL_S = 2.0  # time to fall and come to rest
MARGIN = 0.012  # distance of the core from floor, top and side walls [m]
RADIUS = 0.006
GRAINS = 200  # in a box
BOXES = 4  # the solid fraction of one box of 100 grains scatters by 0.015


def test_hexagonal_packing(case, laws):
    """Rows of spheres without friction settle into a hexagonal lattice and stay."""
    n_rows = 6
    columns = 8
    shape = Shape.sphere(RADIUS, GRAIN_DENSITY, "grain")
    width = columns * 2.0 * RADIUS
    simulation = simulation_of(
        shape,
        frictionless(0.3),
        STEP,
        capacity=n_rows * columns,
        lower=(0.0, -0.02, 0.0),
        upper=(width, 0.02, 0.12),
        material=STIFFENED,
        **under_gravity(box(0.0, width, -RADIUS, RADIUS)),
        **laws,
    )
    for row in range(n_rows):
        shift = row % 2
        height = RADIUS * (1.0 + math.sqrt(3.0) * row)
        for k in range(columns - shift):
            simulation.add("body", ((2 * k + 1 + shift) * RADIUS, 0.0, height))
    lattice = simulation.positions.copy()
    simulation.run_steps(10000)
    settled = simulation.positions.copy()
    simulation.run_steps(10000)

    young, _ = effective_moduli(STIFFENED, PVC)
    overlap = RADIUS - simulation.positions[:columns, 2]
    carried = 4.0 / 3.0 * young * math.sqrt(RADIUS) * np.sum(overlap**1.5)
    weight = len(lattice) * shape.mass_kg * GRAVITY
    case.close("force on the floor, by the overlaps [N]", carried, weight)
    moved = np.abs(simulation.positions - lattice).max() / RADIUS
    case.at_most("largest distance from the lattice, in radii", moved, 0.05)
    crept = np.abs(simulation.positions - settled).max() / RADIUS
    case.at_most("motion in the last 0.5 s, in radii", crept, 1e-6)
    energy = simulation.kinetic_energies().sum()
    case.at_most("kinetic energy [J]", energy, 1e-20)


@pytest.mark.slow
def test_poured_packing(case, laws):
    """Grains poured into a box have the solid fraction and contacts of random packings.

    Solid fraction of random packings of ellipsoids: with friction 0.54 to 0.70 (shaken
    experiments: Schaller 2012; Delaney, Hilton & Cleary 2011); without, 0.64 of spheres
    to 0.735 of the best ellipsoids (Donev et al. 2004, Science 303, 990), less 0.02 for
    walls. Coordination number: 4 is the isostatic limit of bodies with endless
    friction, 12 that of ellipsoids without; Donev et al. have about 10.
    """
    fraction, number, energy = pour_boxes(Contact(0.1, 0.6, 0.05), laws)
    case.within("mu 0.6: solid fraction", fraction, 0.54, 0.70)
    case.within("mu 0.6: coordination number", number, 4.0, 10.0)
    case.at_most("mu 0.6: kinetic energy over m g thickness", energy, 0.01)

    fraction, number, energy = pour_boxes(frictionless(0.1), laws)
    case.within("frictionless: solid fraction", fraction, 0.62, 0.74)
    case.within("frictionless: coordination number", number, 6.0, 12.0)
    case.at_most("frictionless: kinetic energy over m g thickness", energy, 0.01)


def pour_boxes(contact, laws):
    """Pour boxes and measure their cores.

    Returns the mean solid fraction and coordination number, and the largest energy over
    m g thickness.
    """
    cores = []
    for k in range(BOXES):
        simulation, side = pour(GRAINS, contact, 29 + k, laws)
        cores.append(measure_core(simulation, side))
    fractions, numbers, energies = np.array(cores).T
    return fractions.mean(), numbers.mean(), energies.max()


def pour(n, contact, seed, laws):
    """Fill a box with grains in random orientations, until they rest.

    They are released together from a loose lattice.
    """
    rng = np.random.default_rng(seed)
    pitch = 0.0216
    columns = max(2, round((n / 3.5) ** (1.0 / 3.0)))
    levels = math.ceil(n / columns**2)
    side = columns * pitch
    simulation = grain_simulation(
        contact,
        STEP,
        capacity=n,
        lower=STILL,
        upper=(side, side, pitch * (levels + 1)),
        material=STIFFENED,
        **under_gravity(box(0.0, side, 0.0, side)),
        **laws,
    )
    for k in range(n):
        level, cell = divmod(k, columns**2)
        place = pitch * (np.array([cell % columns, cell // columns, level]) + 0.5)
        simulation.add("body", place, random_quaternion(rng), (0.0, 0.0, -0.3))
    simulation.run_steps(round(FALL_S / STEP))
    return simulation, side


def measure_core(simulation, side):
    """Measure the core of a box.

    Returns solid fraction, coordination number, and mean energy over m g thickness.
    """
    heights, profile = solid_fraction_profile(simulation, side)
    ten_highest = np.sort(simulation.positions[:, 2])[-10:]
    top = float(ten_highest.mean())
    fraction = profile[(heights > MARGIN) & (heights < top - MARGIN)].mean()
    lift = simulation.shapes["body"].mass_kg * GRAVITY * 2.0 * GRAIN_M[2]
    energy = simulation.kinetic_energies().mean() / lift
    return fraction, coordination_number(simulation, side, top), energy


def solid_fraction_profile(simulation, side, points=900):
    """Measure the solid fraction of slices 4 mm thick by random points.

    Returns the middles [m] of the slices, and the shares of points inside a grain.
    """
    rng = np.random.default_rng(31)
    heights = np.arange(0.002, simulation.positions[:, 2].max(), 0.004)
    # each turns a vector into the body's frame, in which a grain is a unit sphere
    to_sphere = [
        rotation_matrix(turn).T / np.array(GRAIN_M)[:, None]
        for turn in simulation.quaternions
    ]
    profile = []
    for height in heights:
        low = (MARGIN, MARGIN, height - 0.002)
        high = (side - MARGIN, side - MARGIN, height + 0.002)
        places = rng.uniform(low, high, (points, 3))
        inside = np.zeros(points, bool)
        for centre, matrix in zip(simulation.positions, to_sphere, strict=True):
            if abs(centre[2] - height) < GRAIN_M[0] + 0.002:
                inside |= np.sum(((places - centre) @ matrix.T) ** 2, axis=1) < 1.0
        profile.append(inside.mean())
    return heights, np.array(profile)


def coordination_number(simulation, side, top):
    """Average the touching neighbours of the grains in the core.

    The core is `MARGIN` away from the walls and the top.
    """
    places = simulation.positions
    upper = np.array([side, side, top]) - MARGIN
    in_core = np.all((places > MARGIN) & (places < upper), axis=1)
    bodies = simulation.contacts().ravel()
    neighbours = np.bincount(bodies, minlength=simulation.n_bodies)
    return float(neighbours[in_core].mean())
