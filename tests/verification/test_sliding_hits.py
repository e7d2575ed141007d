"""Coulomb's law over a whole impact, and a closed path of a contact without slip."""

import math

import numpy as np
import pytest
from verification.random_hits import STIFF_LIMIT, particles
from verification.simulations import (
    GRAIN_DENSITY,
    GRAIN_M,
    ON_FLOOR,
    STEPS_PER_CONTACT,
    UP,
    simulation_of,
    steps_of_impact,
    stiffened_simulation,
)
from verification.sliding import LIMIT_OF_SLIDING, sliding_loss

from repose.dem import Clump, Contact, Motion, Plane, Shape

pytestmark = pytest.mark.slow

RESTITUTIONS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9)
FRICTION = 0.3
NORMAL_M_S = 0.5
SPEED_OVER_LIMIT = 10.0  # tangential velocity over the limit of sliding

# The closed path: overlap at the start of the slide, length of the slide, further
# overlap.
SHALLOW_M = 2e-4
SLIDE_M = 2e-4
DEEPER_M = 8e-4
SPEED_M_S = 0.01
STEP_S = 5e-5
IMMOVABLE = 1e9  # density of a body that no force moves, over a grain's


def lowest_under_centre(shape):
    """Turn the first point of contact with a floor under the centre of mass.

    Returns the quaternion (w, x, y, z).
    """
    if not isinstance(shape, Clump):
        return np.array([1.0, 0.0, 0.0, 0.0])
    centres = shape.spheres_m[:, :3]
    radii = shape.spheres_m[:, 3]
    tip = centres[np.argmax(np.linalg.norm(centres, axis=1) + radii)]
    tip = tip / max(np.linalg.norm(tip), 1e-300)
    down = -np.array(UP)
    # half-way rotation from the tip's direction to down; about x where the tip points
    # up
    w = 1.0 + tip @ down
    if w <= 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0])
    return np.array([w, *np.cross(tip, down)])


def lost_velocity(shape, contact, laws):
    """Simulate the tangential velocity [m/s] lost in a stiff sliding impact."""
    simulation, step = stiffened_simulation(
        shape,
        contact,
        STIFF_LIMIT,
        NORMAL_M_S,
        STEPS_PER_CONTACT,
        walls=ON_FLOOR,
        **laws,
    )
    if isinstance(shape, Clump):
        reach = shape.bounding_radius_m
    else:
        reach = float(shape.half_extents_m[2])
    limit = LIMIT_OF_SLIDING * sliding_loss(contact, NORMAL_M_S)
    along = SPEED_OVER_LIMIT * limit
    place = (0.0, 0.0, reach + 3.5 * step * NORMAL_M_S)
    velocity = (along, 0.0, -NORMAL_M_S)
    simulation.add("body", place, lowest_under_centre(shape), velocity)
    # a pair of equal bodies, whose contact time sets the step, is less stiff than a
    # body on a floor
    simulation.run_steps(3 * steps_of_impact(contact.restitution, laws["tension"]))
    return along - float(simulation.velocities[0, 0])


@pytest.mark.essential  # the one case of clumps that .ci/run has
def test_coulomb(case, laws):
    """A sliding impact loses mu (1 + e) V: smooth bodies and clumps, e 0.05 to 0.9."""
    for name, body in particles().items():
        for e in RESTITUTIONS:
            contact = Contact(e, FRICTION, 0.0)
            share = lost_velocity(body, contact, laws) / sliding_loss(
                contact, NORMAL_M_S
            )
            case.close(f"{name}, e {e:g}: lost over mu (1 + e) V", share, 1.0)


def work_of_closed_path(slides_first, laws):
    """Simulate the work [J] of a floor over a closed path of a body without slip."""
    shape = Shape.ellipsoid(GRAIN_M, IMMOVABLE * GRAIN_DENSITY, "grain")
    contact = Contact(1.0, 100.0, 0.0)
    gap = 1e-6
    walls = {"floor": Plane((0.0, 0.0, -GRAIN_M[2] - gap), UP, "wall")}
    simulation = simulation_of(shape, contact, STEP_S, walls=walls, **laws)
    simulation.add("body", (0.0, 0.0, 0.0))

    approach = np.array([0.0, 0.0, SHALLOW_M + gap])
    slide = np.array([SLIDE_M, 0.0, 0.0])
    press = np.array([0.0, 0.0, DEEPER_M])
    if slides_first:
        loop = [slide, press, -slide, -press]
    else:
        loop = [press, slide, -press, -slide]

    work = 0.0
    force = np.zeros(3)
    for leg in [approach, *loop, -approach]:
        steps = math.ceil(np.linalg.norm(leg) / (SPEED_M_S * STEP_S))
        simulation.set_motion("floor", Motion(leg / (steps * STEP_S)))
        for _ in range(steps):
            simulation.run_steps(1)
            previous_force = force
            force = -simulation.wall_loads()["floor"].force_n
            work += float(0.5 * (previous_force + force) @ leg) / steps
    return work


def test_closed_path(case, laws):
    """A contact that moves along a closed path without slip gains no energy."""
    for slides_first in (True, False):
        gained = -1e6 * work_of_closed_path(slides_first, laws)
        case.at_most(f"energy gained, slides first: {slides_first} [uJ]", gained, 0.02)
        assert gained == pytest.approx(-7.9, abs=0.05)


def test_a_spring_of_the_present_stiffness_gives_energy_on_one_closed_path():
    """Compute it by hand: half of (k2 - k1) s^2, as the pressed spring grows."""
    laws = {"contact_law": "hertz_mindlin"}
    spring = 8 / (1.68 / 4.3e4 + 1.6 / 1.12e9) * np.sqrt(0.01057 * 0.005685 / 0.00494)
    growth = spring * (1e-3**0.5 - 2e-4**0.5)
    work = work_of_closed_path(slides_first=True, laws=laws)
    assert work == pytest.approx(-0.5 * growth * 2e-4**2, rel=2e-3)
