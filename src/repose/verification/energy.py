"""Momentum of a free cloud, and energy of many random impacts: damped contacts must not create energy.

The Hertz potential of a turning ellipsoid is not exactly conservative: R* depends on the place of the contact, so the
potential's depth changes during a contact. `elastic_impacts` measures that without damping and friction.
"""

import math
from itertools import product
from typing import Any

import numpy as np

from repose.bench.funnel import Funnel
from repose.dem import Contact, Cylinder, Simulation, random_quaternion

from .case import Effort, Rows, at_most, close, reported
from .machine import BERRY_M, berry_simulation, frictionless, random_direction, track

FUNNEL = Funnel(0.15, 0.032, 60.0, 0.0, 0.001, 0.1)
TUBED = Funnel(0.15, 0.032, 60.0, 0.02, 0.001, 0.1)
STEP = 5e-5
CREATED = 1e-5  # the free rotation between two hits keeps its energy to some 1e-6
HIT = 0.999  # a throw whose energy ratio falls below this is an impact
SPHERE_M = (0.007, 0.007, 0.007)
ELASTIC_NOTE = "R* turns with the ellipsoids: the potential is not exactly conservative"
WALL_NOTE = "R* jumps where the cone passes into its edge and follows the body on the cone; also of spheres"
MUCH = 1.05  # throws with a larger energy ratio are counted
SPACING, LANE = (
    0.2,
    12,
)  # distance of isolated impacts [m] and how many of them lie in a row


def cloud_momentum(effort: Effort) -> Rows:
    """Let 64 grains fly together, collide and fly apart: the cloud keeps its momentum and angular momentum."""
    rng = np.random.default_rng(5)
    room: dict[str, Any] = {
        "capacity": 64,
        "lower": (-0.3, -0.3, -0.3),
        "upper": (0.3, 0.3, 0.3),
    }
    simulation = berry_simulation(Contact(0.4, 0.5, 0.0), 1e-4, **room, **effort.laws)
    for cell in product(0.03 * (np.arange(4) - 1.5), repeat=3):
        place = np.array(cell)
        velocity = -12.0 * place + 0.4 * rng.normal(size=3)
        simulation.add(
            "body", place, random_quaternion(rng), velocity, 20.0 * rng.normal(size=3)
        )
    mass = simulation.shapes["body"].mass_kg

    def totals() -> tuple[np.ndarray, np.ndarray, float]:
        linear = mass * simulation.velocities
        angular = simulation.angular_momenta + np.cross(simulation.positions, linear)
        return (
            linear.sum(axis=0),
            angular.sum(axis=0),
            simulation.kinetic_energies().sum(),
        )

    linear, angular, energy = totals()
    speeds = np.linalg.norm(simulation.velocities, axis=1)
    lever = mass * np.linalg.norm(simulation.positions, axis=1) * speeds
    sizes = (
        mass * speeds.sum(),
        (lever + np.linalg.norm(simulation.angular_momenta, axis=1)).sum(),
    )

    def changes() -> tuple[float, float, float]:
        p, spin, left = totals()
        return (
            np.linalg.norm(p - linear) / sizes[0],
            np.linalg.norm(spin - angular) / sizes[1],
            left / energy,
        )

    *drifts, left = track(simulation, 100, 20, changes).T
    for name, worst in zip(
        ("momentum", "angular momentum"), np.max(drifts, axis=1), strict=True
    ):
        yield close(
            f"{name}, largest drift over the sum of sizes",
            "",
            worst,
            0.0,
            tolerance=1e-13,
            scale=1.0,
        )
    yield at_most("kinetic energy left", "", left[-1], 0.9, "the grains have collided")


Ratios = tuple[
    np.ndarray, np.ndarray
]  # of each throw: the largest of ten energies, and the last, over that before


def _ratios(simulation: Simulation, steps: int, bodies: int = 1) -> Ratios:
    """Run ten times so many steps; a throw has so many `bodies`, one added after the other."""

    def energies() -> np.ndarray:
        return simulation.kinetic_energies().reshape(-1, bodies).sum(axis=1)

    start = energies()
    ratios = track(simulation, 10, steps, energies) / start
    return ratios.max(axis=0), ratios[-1]


def pair_hits(
    rng: np.random.Generator, contact: Contact, step: float = STEP, **keywords: Any
) -> Ratios:
    """Simulate isolated pairs of ellipsoids that collide; `keywords` go to `berry_simulation`."""
    n, edge = LANE * LANE, LANE * SPACING
    room: dict[str, Any] = {
        "capacity": 2 * n,
        "lower": 3 * (-SPACING,),
        "upper": (edge, edge, SPACING),
    }
    simulation = berry_simulation(contact, step, **room, **keywords)
    for k in range(n):
        middle = SPACING * np.array([k // LANE, k % LANE, 0.0])
        direction = random_direction(rng)
        aim = -direction + 0.3 * rng.normal(size=3)
        turn, spin = random_quaternion(rng), 40.0 * rng.normal(size=3)
        simulation.add("body", middle, turn, angular_velocity_rad_s=spin)
        simulation.add("body", middle + 0.0215 * direction, random_quaternion(rng), aim)
    most, last = _ratios(simulation, round(140 * STEP / step), bodies=2)
    # a pair that still touches holds elastic energy: its impact is not finished
    separated = np.ones(n, bool)
    separated[simulation.contacts()[:, 0] // 2] = False
    return most[separated], last[separated]


def funnel_hits(
    rng: np.random.Generator, contact: Contact, kind: str, **laws: Any
) -> Ratios:
    """Simulate a grain thrown at a funnel from inside; `kind` is "cone", "rim" or "tube"."""
    funnel = TUBED if kind == "tube" else FUNNEL
    room: dict[str, Any] = {
        "walls": funnel.walls("wall"),
        "lower": (-0.1, -0.1, 0.0),
        "upper": (0.1, 0.1, 0.3),
    }
    room |= {"exit_height_m": 0.1, "curved_walls_above_m": 0.099}
    simulation = berry_simulation(contact, STEP, **room, **laws)
    bottom = funnel.outlet_height_m + funnel.tube_length_m
    if kind == "cone":
        place, sideways, down = np.array([0.0, 0.0, bottom + 0.06]), 1.2, 0.6
    else:
        place, sideways, down = (
            np.array([*rng.uniform(-0.006, 0.006, 2), bottom + 0.028]),
            0.5,
            1.5,
        )
    velocity = np.array(
        [*rng.uniform(-sideways, sideways, 2), -rng.uniform(0.4 * down, down)]
    )
    simulation.add(
        "body", place, random_quaternion(rng), velocity, 30.0 * rng.normal(size=3)
    )
    return _ratios(simulation, 100)


def shell_hits(
    rng: np.random.Generator, contact: Contact, _kind: str, **laws: Any
) -> Ratios:
    """Simulate 40 grains along a drum, each thrown at the shell."""
    n, radius, spacing = 40, 0.06, 0.06
    length, low = n * spacing, (-spacing, -radius, -radius)
    shell = Cylinder(
        (-spacing, 0.0, 0.0), (1.0, 0.0, 0.0), length + spacing, radius, "wall"
    )
    room: dict[str, Any] = {
        "capacity": n,
        "walls": {"shell": shell},
        "lower": low,
        "upper": (length, radius, radius),
    }
    simulation = berry_simulation(contact, STEP, **room, **laws)
    for k in range(n):
        place = np.array([k * spacing, *rng.uniform(-0.01, 0.01, 2)])
        angle = rng.uniform(0.0, 2.0 * math.pi)
        speed = rng.uniform(0.5, 1.5)
        velocity = (
            0.1 * rng.normal(),
            speed * math.cos(angle),
            speed * math.sin(angle),
        )
        simulation.add(
            "body", place, random_quaternion(rng), velocity, 30.0 * rng.normal(size=3)
        )
    return _ratios(simulation, 160)


KINDS: dict[str, Any] = {
    "pairs": lambda rng, contact, _kind, **laws: pair_hits(rng, contact, **laws),
    **dict.fromkeys(("cone", "rim", "tube"), funnel_hits),
    "drum shell": shell_hits,
}


def energy_of_hits(effort: Effort) -> Rows:
    """Show that no impact with e below 1 and without rolling friction leaves with more energy than it came with."""
    for kind, throw in KINDS.items():
        rng, most, hit = np.random.default_rng([13, len(kind)]), 0.0, 0
        while hit < effort.hits:
            contact = Contact(rng.uniform(0.1, 0.6), rng.uniform(0.2, 0.8), 0.0)
            highest, last = throw(rng, contact, kind, **effort.laws)
            most, hit = (
                max(most, highest.max(initial=0.0)),
                hit + int(np.count_nonzero(last < HIT)),
            )
        note = f"largest ratio on the way, {hit} hits"
        yield at_most(
            f"{kind}: energy over that before, {note}",
            "",
            most,
            1.0 + CREATED,
            "no energy",
        )


def elastic_impacts(effort: Effort) -> Rows:
    """Measure the deviation from a conservative force: e = 1, no friction; pairs, spheres as a control, a funnel."""
    bodies = {
        "berries": (BERRY_M, STEP),
        "berries, a fifth of the time step": (BERRY_M, STEP / 5),
    }
    bodies["spheres"] = SPHERE_M, STEP
    for name, (axes, step) in bodies.items():
        rng, final = np.random.default_rng(17), np.empty(0)
        while len(final) < effort.hits:
            final = np.append(
                final, pair_hits(rng, frictionless(), step, axes=axes, **effort.laws)[1]
            )
        change = 100.0 * (final - 1.0)
        if name == "spheres":
            worst = 0.01 * np.abs(change).max()
            yield close(
                "spheres: largest change of energy",
                "",
                worst,
                0.0,
                tolerance=1e-3,
                scale=1.0,
            )
            continue
        values = {"mean change": change.mean(), "standard deviation": change.std()}
        for what, value in (
            values | {"largest gain": change.max(), "largest loss": -change.min()}
        ).items():
            yield reported(f"{name}: {what} of energy", "%", value, ELASTIC_NOTE)
    for kind in ("cone", "rim"):
        rng = np.random.default_rng([17, len(kind)])
        ends = np.concatenate(
            [
                funnel_hits(rng, frictionless(), kind, **effort.laws)[1]
                for _ in range(effort.hits)
            ]
        )
        gain, share = 100.0 * (ends.max() - 1.0), 100.0 * float(np.mean(ends > MUCH))
        yield reported(
            f"grains at the {kind}: largest gain of energy", "%", gain, WALL_NOTE
        )
        yield reported(
            f"grains at the {kind}: throws that gain more than 5 %",
            "%",
            share,
            WALL_NOTE,
        )
