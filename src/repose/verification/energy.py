"""Momentum of a free cloud, and energy of many random impacts: damped contacts must not create energy.

The Hertz potential of a turning ellipsoid is not exactly conservative: R* depends on the place of the contact, so the
potential's depth changes during a contact. `elastic_impacts` measures that without damping and friction.
"""

import math
from typing import Any

import numpy as np

from repose.apparatus.funnel import Funnel
from repose.dem import Contact, Cylinder, Simulation, random_quaternion

from .case import Effort, Row, at_most, close, reported
from .machine import BERRY_M, berry_simulation, frictionless, random_direction

FUNNEL = Funnel(0.15, 0.032, 60.0, 0.0, 0.001, 0.1)
TUBED = Funnel(0.15, 0.032, 60.0, 0.02, 0.001, 0.1)
STEP = 5e-5
CREATED = 1e-5  # the free rotation between two hits keeps its energy to some 1e-6
HIT = 0.999  # a throw whose energy ratio falls below this is an impact
SPHERE_M = (0.007, 0.007, 0.007)
ELASTIC_NOTE = "R* turns with the ellipsoids: the potential is not exactly conservative"
WALL_NOTE = "R* jumps where the cone passes into its edge and follows the body on the cone; also of spheres"
MUCH = 1.05  # throws with a larger energy ratio are counted
SPACING, LANE = 0.2, 12  # distance of isolated impacts [m] and how many of them lie in a row


def cloud_momentum(effort: Effort) -> list[Row]:
    """A cloud of 64 berries that fly together, collide and fly apart keeps its momentum and angular momentum."""
    rng = np.random.default_rng(5)
    simulation = berry_simulation(
        Contact(0.4, 0.5, 0.0), 1e-4, capacity=64, lower=(-0.3, -0.3, -0.3), upper=(0.3, 0.3, 0.3), **effort.laws
    )
    axis = 0.03 * (np.arange(4) - 1.5)
    for x in axis:
        for y in axis:
            for z in axis:
                place = np.array([x, y, z])
                velocity = -12.0 * place + 0.4 * rng.normal(size=3)
                simulation.add("body", place, random_quaternion(rng), velocity, 20.0 * rng.normal(size=3))
    mass = simulation.shapes["body"].mass_kg

    def totals() -> tuple[np.ndarray, np.ndarray, float]:
        linear = mass * simulation.velocities
        angular = simulation.angular_momenta + np.cross(simulation.positions, linear)
        return linear.sum(axis=0), angular.sum(axis=0), simulation.kinetic_energies().sum()

    linear, angular, energy = totals()
    lever = mass * np.linalg.norm(simulation.positions, axis=1) * np.linalg.norm(simulation.velocities, axis=1)
    sizes = (
        mass * np.linalg.norm(simulation.velocities, axis=1).sum(),
        (lever + np.linalg.norm(simulation.angular_momenta, axis=1)).sum(),
    )
    drifts = []
    for _ in range(100):
        simulation.run_steps(20)
        p, spin, left = totals()
        drifts.append((np.linalg.norm(p - linear) / sizes[0], np.linalg.norm(spin - angular) / sizes[1]))
    names = ("momentum", "angular momentum")
    rows = [
        close(f"{name}, largest drift over the sum of sizes", "", worst, 0.0, tolerance=1e-13, scale=1.0)
        for name, worst in zip(names, np.max(drifts, axis=0), strict=True)
    ]
    rows.append(at_most("kinetic energy left", "", left / energy, 0.9, "the berries have collided"))
    return rows


def _ratios(simulation: Simulation, checks: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Largest kinetic energy at any check, and the last one, both over the first (N,)."""
    start = simulation.kinetic_energies()
    most = np.zeros(len(start))
    for _ in range(checks):
        simulation.run_steps(steps)
        most = np.maximum(most, simulation.kinetic_energies() / start)
    return most, simulation.kinetic_energies() / start


def pair_hits(
    rng: np.random.Generator,
    contact: Contact,
    axes: tuple[float, float, float] = BERRY_M,
    step: float = STEP,
    **laws: Any,
) -> tuple[np.ndarray, np.ndarray]:
    """Largest of ten energies, and the last, of isolated pairs of ellipsoids that collide, over the energy before."""
    n = LANE * LANE
    edge = LANE * SPACING
    simulation = berry_simulation(
        contact,
        step,
        capacity=2 * n,
        axes=axes,
        lower=(-SPACING, -SPACING, -SPACING),
        upper=(edge, edge, SPACING),
        **laws,
    )
    for k in range(n):
        middle = SPACING * np.array([k // LANE, k % LANE, 0.0])
        direction = random_direction(rng)
        aim = -direction + 0.3 * rng.normal(size=3)
        turn, spin = random_quaternion(rng), 40.0 * rng.normal(size=3)
        simulation.add("body", middle, turn, angular_velocity_rad_s=spin)
        simulation.add("body", middle + 0.0215 * direction, random_quaternion(rng), aim)
    energies = simulation.kinetic_energies()
    start = energies[0::2] + energies[1::2]
    most = np.zeros(n)
    for _ in range(10):
        simulation.run_steps(round(140 * STEP / step))
        energies = simulation.kinetic_energies()
        most = np.maximum(most, (energies[0::2] + energies[1::2]) / start)
    # a pair that still touches holds elastic energy: its impact is not finished
    separated = np.ones(n, bool)
    separated[simulation.contacts()[:, 0] // 2] = False
    return most[separated], ((energies[0::2] + energies[1::2]) / start)[separated]


def funnel_hits(rng: np.random.Generator, contact: Contact, kind: str, **laws: Any) -> tuple[np.ndarray, np.ndarray]:
    """As `pair_hits` for a berry thrown at a funnel from inside; `kind` is "cone", "rim" or "tube"."""
    funnel = TUBED if kind == "tube" else FUNNEL
    simulation = berry_simulation(
        contact,
        STEP,
        walls=funnel.walls("wall"),
        lower=(-0.1, -0.1, 0.0),
        upper=(0.1, 0.1, 0.3),
        exit_height_m=0.1,
        curved_walls_above_m=0.099,
        **laws,
    )
    bottom = funnel.outlet_height_m + funnel.tube_length_m
    if kind == "cone":
        place, sideways, down = np.array([0.0, 0.0, bottom + 0.06]), 1.2, 0.6
    else:
        place, sideways, down = np.array([*rng.uniform(-0.006, 0.006, 2), bottom + 0.028]), 0.5, 1.5
    velocity = np.array([*rng.uniform(-sideways, sideways, 2), -rng.uniform(0.4 * down, down)])
    simulation.add("body", place, random_quaternion(rng), velocity, 30.0 * rng.normal(size=3))
    return _ratios(simulation, 10, 100)


def shell_hits(rng: np.random.Generator, contact: Contact, _kind: str, **laws: Any) -> tuple[np.ndarray, np.ndarray]:
    """As `funnel_hits` for 40 berries along a drum, each thrown at the shell, (40,)."""
    n, radius, spacing = 40, 0.06, 0.06
    length = n * spacing
    simulation = berry_simulation(
        contact,
        STEP,
        capacity=n,
        walls={"shell": Cylinder((-spacing, 0.0, 0.0), (1.0, 0.0, 0.0), length + spacing, radius, "wall")},
        lower=(-spacing, -radius, -radius),
        upper=(length, radius, radius),
        **laws,
    )
    for k in range(n):
        place = np.array([k * spacing, *rng.uniform(-0.01, 0.01, 2)])
        angle = rng.uniform(0.0, 2.0 * math.pi)
        speed = rng.uniform(0.5, 1.5)
        velocity = (0.1 * rng.normal(), speed * math.cos(angle), speed * math.sin(angle))
        simulation.add("body", place, random_quaternion(rng), velocity, 30.0 * rng.normal(size=3))
    return _ratios(simulation, 10, 160)


KINDS: dict[str, Any] = {
    "pairs": lambda rng, contact, _kind, **laws: pair_hits(rng, contact, **laws),
    "cone": funnel_hits,
    "rim": funnel_hits,
    "tube": funnel_hits,
    "drum shell": shell_hits,
}


def energy_of_hits(effort: Effort) -> list[Row]:
    """No impact with e below 1 and without rolling friction leaves with more energy than it came with."""
    rows = []
    for kind, throw in KINDS.items():
        rng = np.random.default_rng([13, len(kind)])
        peaks: list[np.ndarray] = []
        ends: list[np.ndarray] = []
        while sum(int(np.count_nonzero(end < HIT)) for end in ends) < effort.hits:
            contact = Contact(rng.uniform(0.1, 0.6), rng.uniform(0.2, 0.8), 0.0)
            highest, last = throw(rng, contact, kind, **effort.laws)
            peaks.append(highest)
            ends.append(last)
        most, final = np.concatenate(peaks), np.concatenate(ends)
        note = f"largest ratio on the way, {np.count_nonzero(final < HIT)} hits"
        rows.append(at_most(f"{kind}: energy over that before, {note}", "", most.max(), 1.0 + CREATED, "no energy"))
    return rows


def elastic_impacts(effort: Effort) -> list[Row]:
    """Deviation from a conservative force: e = 1 and no friction; pairs, spheres as a control, and a funnel."""
    bodies = (
        ("berries", BERRY_M, STEP),
        ("berries, a fifth of the time step", BERRY_M, STEP / 5),
        ("spheres", SPHERE_M, STEP),
    )
    rows = []
    for name, axes, step in bodies:
        rng = np.random.default_rng(17)
        final: list[np.ndarray] = []
        while sum(len(ratios) for ratios in final) < effort.hits:
            final.append(pair_hits(rng, frictionless(), axes, step, **effort.laws)[1])
        change = 100.0 * (np.concatenate(final) - 1.0)
        if name == "spheres":
            worst = 0.01 * np.abs(change).max()
            rows.append(close("spheres: largest change of energy", "", worst, 0.0, tolerance=1e-3, scale=1.0))
        else:
            values = (change.mean(), change.std(), change.max(), -change.min())
            for what, value in zip(
                ("mean change", "standard deviation", "largest gain", "largest loss"), values, strict=True
            ):
                rows.append(reported(f"{name}: {what} of energy", "%", value, ELASTIC_NOTE))
    for kind in ("cone", "rim"):
        rng = np.random.default_rng([17, len(kind)])
        ends = np.concatenate([funnel_hits(rng, frictionless(), kind, **effort.laws)[1] for _ in range(effort.hits)])
        gain, share = 100.0 * (ends.max() - 1.0), 100.0 * float(np.mean(ends > MUCH))
        rows.append(reported(f"berries at the {kind}: largest gain of energy", "%", gain, WALL_NOTE))
        rows.append(reported(f"berries at the {kind}: throws that gain more than 5 %", "%", share, WALL_NOTE))
    return rows
