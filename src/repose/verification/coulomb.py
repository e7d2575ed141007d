"""Coulomb's law over a whole impact, and the energy of a closed path of a contact that does not slip."""

import math
from typing import Any

import numpy as np

from repose.dem import Clump, Contact, Motion, Plane, Shape

from .case import CLOSED, Effort, Rows, at_most, close, reported
from .machine import (
    BERRY_DENSITY,
    BERRY_M,
    ON_FLOOR,
    STEPS_PER_CONTACT,
    UP,
    Body,
    before_impact,
    simulation_of,
    steps_of_impact,
)
from .oblique import sliding_impulse
from .restitution import STIFFER, particles

ASKED = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9)
FRICTION, NORMAL_M_S = 0.3, 0.5
SLIDES = 10.0  # tangential velocity over the limit of sliding

# The path: overlap at the start of the slide, length of the slide, further overlap.
LOW_M, SLIDE_M, DEEPER_M = 2e-4, 2e-4, 8e-4
SPEED_M_S, STEP_S = 0.01, 5e-5
SPRING_NOTE = "the spring S_t delta_t of the present stiffness gives energy; hertz_mindlin_rescaled does not"
HEAVY = 1e9  # density of an immovable body, over a berry's


def lowest_under_centre(shape: Body) -> np.ndarray:
    """Find the quaternion (w, x, y, z) that puts the first point of contact with a floor under the centre of mass."""
    if not isinstance(shape, Clump):
        return np.array([1.0, 0.0, 0.0, 0.0])
    centres, radii = shape.spheres_m[:, :3], shape.spheres_m[:, 3]
    tip = centres[np.argmax(np.linalg.norm(centres, axis=1) + radii)]
    down = -np.array(UP)
    tip = tip / max(np.linalg.norm(tip), 1e-300)
    # half-way rotation from the tip's direction to down; about x where the tip points up
    w, xyz = 1.0 + tip @ down, np.cross(tip, down)
    return np.array([w, *xyz]) if w > 1e-9 else np.array([0.0, 1.0, 0.0, 0.0])


def sliding_loss(shape: Body, contact: Contact, **laws: Any) -> float:
    """Simulate the tangential velocity [m/s] that a body loses in a stiff impact on a floor with sliding throughout."""
    simulation, step = before_impact(
        shape, contact, NORMAL_M_S, STEPS_PER_CONTACT, STIFFER, walls=ON_FLOOR, **laws
    )
    turn = lowest_under_centre(shape)
    reach = (
        shape.bounding_radius_m
        if isinstance(shape, Clump)
        else float(shape.half_extents_m[2])
    )
    along = SLIDES * 3.5 * sliding_impulse(contact, NORMAL_M_S)
    place = (0.0, 0.0, reach + 3.5 * step * NORMAL_M_S)
    simulation.add("body", place, turn, (along, 0.0, -NORMAL_M_S))
    # a pair of equal bodies, whose contact time sets the step, is less stiff than a body on a floor
    simulation.run_steps(
        3 * steps_of_impact(contact.restitution, laws.get("tension", "keep"))
    )
    return along - float(simulation.velocities[0, 0])


def sliding_hits(effort: Effort) -> Rows:
    """Show that a body that slides through a hit loses mu (1 + e) V: every particle, e from .05 to .9."""
    for name, body in particles().items():
        for e in ASKED:
            contact = Contact(e, FRICTION, 0.0)
            share = sliding_loss(body, contact, **effort.laws) / sliding_impulse(
                contact, NORMAL_M_S
            )
            yield close(
                f"{name}, e {e:g}: tangential velocity lost over mu (1 + e) V",
                "",
                share,
                1.0,
            )


def loop_work(forward: bool, **laws: Any) -> float:
    """Simulate the work [J] of a floor on an immovable body, over a closed path without slip."""
    shape = Shape.ellipsoid(BERRY_M, HEAVY * BERRY_DENSITY, "berry")
    contact = Contact(1.0, 100.0, 0.0)
    walls = {"floor": Plane((0.0, 0.0, -BERRY_M[2] - 1e-6), UP, "wall")}
    simulation = simulation_of(shape, contact, STEP_S, walls=walls, **laws)
    simulation.add("body", (0.0, 0.0, 0.0))
    slide, press = (SLIDE_M, 0.0, 0.0), (0.0, 0.0, DEEPER_M)
    first = (slide, press) if forward else (press, slide)
    back = tuple(tuple(-x for x in leg) for leg in first)
    start = (0.0, 0.0, LOW_M + 1e-6)
    work, force = 0.0, np.zeros(3)
    for leg in (start, *first, *back, tuple(-x for x in start)):
        way = np.array(leg)
        steps = math.ceil(np.linalg.norm(way) / (SPEED_M_S * STEP_S))
        simulation.set_motion("floor", Motion(way / (steps * STEP_S)))
        for _ in range(steps):
            simulation.run_steps(1)
            now = -simulation.wall_loads()["floor"].force_n
            work += float(0.5 * (force + now) @ way) / steps
            force = now
    return work


def closed_loop(effort: Effort) -> Rows:
    """Show that a contact led over a closed path without slip gives no energy: slide, press, slide back, unload."""
    for way, forward in (
        ("slide, press, slide back, unload", True),
        ("press, slide, unload, slide back", False),
    ):
        gained = -1e6 * loop_work(forward, **effort.laws)
        if effort.laws.get("contact_law", "hertz_mindlin") == "hertz_mindlin":
            yield reported(
                f"{way}: energy gained", "uJ", gained, SPRING_NOTE, "none", CLOSED
            )
        else:
            yield at_most(
                f"{way}: energy gained",
                "uJ",
                gained,
                0.02,
                CLOSED + ": a path gives none",
            )
