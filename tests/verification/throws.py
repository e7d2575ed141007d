"""Grains thrown at each other and at walls, and the energy that they keep.

The Hertz potential of a turning ellipsoid is not exactly conservative: R* depends on
the place of the contact, so the potential's depth changes during a contact.
"""

import math
from typing import NamedTuple

import numpy as np
from verification.simulations import grain_simulation, random_direction, track

from repose.bench.funnel import Funnel
from repose.dem import Cylinder, random_quaternion

FUNNEL = Funnel(0.15, 0.032, 60.0, 0.0, 0.001, 0.1)
FUNNEL_WITH_TUBE = Funnel(0.15, 0.032, 60.0, 0.02, 0.001, 0.1)
STEP = 5e-5
SPACING_M = 0.2  # of isolated pairs
LANES = 12  # pairs in a row


class Energies(NamedTuple):
    """Energy of throws over that before."""

    largest: np.ndarray  # of ten energies on the way
    last: np.ndarray


def energies_of(simulation, steps, bodies=1):
    """Run ten times so many steps.

    Each throw has so many `bodies`, one added after the other.
    """

    def energy():
        return simulation.kinetic_energies().reshape(-1, bodies).sum(axis=1)

    before = energy()
    ratios = track(simulation, 10, steps, energy) / before
    return Energies(ratios.max(axis=0), ratios[-1])


def throw_pairs(rng, contact, step=STEP, **keywords):
    """Throw isolated pairs of ellipsoids at each other.

    `keywords` go to `grain_simulation`.

    A pair that still touches in the end is left out: it holds elastic energy.
    """
    count = LANES * LANES
    edge = LANES * SPACING_M
    simulation = grain_simulation(
        contact,
        step,
        capacity=2 * count,
        lower=3 * (-SPACING_M,),
        upper=(edge, edge, SPACING_M),
        **keywords,
    )
    for k in range(count):
        middle = SPACING_M * np.array([k // LANES, k % LANES, 0.0])
        direction = random_direction(rng)
        velocity = -direction + 0.3 * rng.normal(size=3)
        turn = random_quaternion(rng)
        spin = 40.0 * rng.normal(size=3)
        simulation.add("body", middle, turn, angular_velocity_rad_s=spin)
        place = middle + 0.0215 * direction
        simulation.add("body", place, random_quaternion(rng), velocity)
    energies = energies_of(simulation, round(140 * STEP / step), bodies=2)
    separated = np.ones(count, bool)
    separated[simulation.contacts()[:, 0] // 2] = False
    return Energies(energies.largest[separated], energies.last[separated])


def throw_at_cone(rng, contact, **laws):
    """Throw a grain at a funnel's cone, from inside."""
    place = np.array([0.0, 0.0, FUNNEL.outlet_height_m + 0.06])
    return _throw_into(FUNNEL, rng, contact, place, 1.2, 0.6, laws)


def throw_at_rim(rng, contact, **laws):
    """Throw a grain at a funnel's outlet, from inside."""
    return _throw_at_outlet(FUNNEL, rng, contact, laws)


def throw_at_tube(rng, contact, **laws):
    """Throw a grain at the outlet of a funnel with a tube, from inside."""
    return _throw_at_outlet(FUNNEL_WITH_TUBE, rng, contact, laws)


def _throw_at_outlet(funnel, rng, contact, laws):
    bottom = funnel.outlet_height_m + funnel.tube_length_m
    place = np.array([*rng.uniform(-0.006, 0.006, 2), bottom + 0.028])
    return _throw_into(funnel, rng, contact, place, 0.5, 1.5, laws)


def _throw_into(funnel, rng, contact, place, sideways_m_s, down_m_s, laws):
    """Throw a grain with at most these speeds."""
    simulation = grain_simulation(
        contact,
        STEP,
        walls=funnel.walls("wall"),
        lower=(-0.1, -0.1, 0.0),
        upper=(0.1, 0.1, 0.3),
        exit_height_m=0.1,
        curved_walls_above_m=0.099,
        **laws,
    )
    sideways = rng.uniform(-sideways_m_s, sideways_m_s, 2)
    velocity = np.array([*sideways, -rng.uniform(0.4 * down_m_s, down_m_s)])
    turn = random_quaternion(rng)
    simulation.add("body", place, turn, velocity, 30.0 * rng.normal(size=3))
    return energies_of(simulation, 100)


def throw_at_shell(rng, contact, **laws):
    """Throw 40 grains along a drum, each at the shell."""
    count = 40
    radius = 0.06
    spacing = 0.06
    length = count * spacing
    shell = Cylinder(
        (-spacing, 0.0, 0.0), (1.0, 0.0, 0.0), length + spacing, radius, "wall"
    )
    simulation = grain_simulation(
        contact,
        STEP,
        capacity=count,
        walls={"shell": shell},
        lower=(-spacing, -radius, -radius),
        upper=(length, radius, radius),
        **laws,
    )
    for k in range(count):
        place = np.array([k * spacing, *rng.uniform(-0.01, 0.01, 2)])
        angle = rng.uniform(0.0, 2.0 * math.pi)
        speed = rng.uniform(0.5, 1.5)
        along = 0.1 * rng.normal()
        velocity = (along, speed * math.cos(angle), speed * math.sin(angle))
        turn = random_quaternion(rng)
        simulation.add("body", place, turn, velocity, 30.0 * rng.normal(size=3))
    return energies_of(simulation, 160)
