"""The tangential dashpots of all contacts of a body stop at most its whole rotation in a step (`laws.tangential`)."""

import math

import numpy as np
import pytest

from repose.dem import Contact, Material, Plane, Shape, Simulation
from repose.dem.kernels import state as st
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

RADIUS, OVERLAP = 6e-3, 1e-4
SOFT, HARD = Material(4.3e4, 0.32), Material(1.12e9, 0.4)
CONTACT = Contact(0.1, 5.0, 0.0)
STILL = {"gravity_m_s2": (0.0, 0.0, 0.0), "tension": "release", "contact_law": "hertz_mindlin_rescaled"}


def held(planes, step_s=None, smooth=False):
    """A sphere that so many planes about the z axis press, and 0.98 of the longest step if none is given."""
    ball = Shape.sphere(RADIUS, 840.0, "soft")
    if smooth:
        ball = Shape(np.full((2, 3), 0.5 * RADIUS), ball.mass_kg, ball.inertia_kg_m2, "soft")
    angles = 2.0 * math.pi * np.arange(planes) / planes
    normals = [(math.cos(angle), math.sin(angle), 0.0) for angle in angles]
    walls = {
        str(k): Plane(tuple((RADIUS - OVERLAP) * np.array(normal)), tuple(-x for x in normal), "hard")
        for k, normal in enumerate(normals)
    }
    pairs = {("soft", "soft"): CONTACT, ("soft", "hard"): CONTACT}
    scene = {"capacity": 1, "lower": (-0.1,) * 3, "upper": (0.1,) * 3, "walls": walls, **STILL}
    materials = {"soft": SOFT, "hard": HARD}
    longest = Simulation({"ball": ball}, materials, pairs, 1e-6, **scene).longest_time_step()
    step_s = 0.98 * longest if step_s is None else step_s
    simulation = Simulation({"ball": ball}, materials, pairs, step_s, **scene)
    simulation.add("ball", (0.0, 0.0, 0.0), angular_velocity_rad_s=(0.0, 0.0, 1.0))
    return simulation


def excess(simulation, planes):
    """dt max(J) sum(c r^2), from the equations of the contact law."""
    ball = simulation.shapes["ball"]
    _, shear = effective_moduli(SOFT, HARD)
    beta = damping_ratio(CONTACT.restitution, "release")
    stiffness = 8.0 * shear * math.sqrt(RADIUS * OVERLAP)
    dashpot = 2.0 * math.sqrt(5.0 / 6.0) * beta * math.sqrt(stiffness * ball.mass_kg)
    arm = RADIUS - OVERLAP / 2.0
    return simulation.time_step_s * planes * dashpot * arm**2 / ball.inertia_kg_m2.min()


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("planes", [2, 8])
def test_the_share_is_that_of_the_equation(planes, smooth):
    for step_s in (None, 1e-6):
        simulation = held(planes, step_s, smooth)
        simulation.run_steps(1)
        share = simulation.bodies.rows[0, st.share_column(simulation.physics.parts)]
        assert share == pytest.approx(1.0 / max(1.0, excess(simulation, planes)), rel=1e-6)
        assert (share == 1.0) == (step_s is not None)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_body_among_eight_others_comes_to_rest(smooth):
    """Without the share its rotation would grow, as the dashpots would take more than twice of it in a step."""
    simulation = held(8, smooth=smooth)
    assert excess(simulation, 8) > 3.0
    spins = []
    for _ in range(400):
        simulation.run_steps(1)
        spins.append(abs(float(simulation.angular_velocities[0, 2])))
    assert max(spins[300:]) < 1e-6
