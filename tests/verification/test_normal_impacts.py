"""Normal impacts: tests 1 to 3 of Chung & Ooi (2011), Granular Matter 13, 643-656.

The engine stores no forces: the force is the mass times the change of velocity in a
time step.
"""

from typing import NamedTuple

import numpy as np
import pytest
from verification.hertz import (
    ALUMINIUM_OXIDE,
    Hertz,
    Solid,
    hertz_of_pair,
    hertz_on_plane,
)
from verification.laws import with_all_laws
from verification.simulations import (
    STEPS_PER_CONTACT,
    frictionless,
    impact,
    sphere_over_plane,
    steps_of_impact,
    track,
    two_spheres,
)

GLASS = Solid("glass", 48e9, 0.20, 2800.0)
LIMESTONE = Solid("limestone", 20e9, 0.25, 2500.0)
ALUMINIUM_ALLOY = Solid("aluminium alloy", 70e9, 0.30, 2699.0)
MAGNESIUM_ALLOY = Solid("magnesium alloy", 40e9, 0.35, 1800.0)
CAST_IRON = Solid("cast iron", 100e9, 0.25, 7000.0)


class History(NamedTuple):
    """A contact, step by step."""

    time_s: np.ndarray  # since the overlap began
    overlap_m: np.ndarray
    force_n: np.ndarray

    @property
    def duration_s(self):
        """Contact time.

        From the last step in contact the overlap goes on to zero with its last speed.
        """
        step = self.time_s[1] - self.time_s[0]
        last_change = self.overlap_m[-2] - self.overlap_m[-1]
        return self.time_s[-1] + step * self.overlap_m[-1] / last_change


def pair_history(solid, radius_m, speed_m_s, **laws):
    """Simulate an elastic head-on impact of two equal spheres."""
    step = hertz_of_pair(solid, radius_m, speed_m_s).duration_s / STEPS_PER_CONTACT
    ball = (solid, radius_m)
    simulation = two_spheres(ball, ball, frictionless(), step, **laws)
    start = radius_m + 2.0 * step * speed_m_s
    half_speed = 0.5 * speed_m_s
    simulation.add("a", (-start, 0.0, 0.0), velocity_m_s=(half_speed, 0.0, 0.0))
    simulation.add("b", (start, 0.0, 0.0), velocity_m_s=(-half_speed, 0.0, 0.0))

    def overlap_and_velocity():
        x = simulation.positions[:, 0]
        return 2.0 * radius_m - (x[1] - x[0]), simulation.velocities[1, 0]

    overlap, velocity = track(
        simulation, steps_of_impact(1.0), 1, overlap_and_velocity
    ).T
    return history_of(overlap, velocity, solid.sphere_mass(radius_m), step)


def plane_history(solid, radius_m, speed_m_s, restitution=1.0, **laws):
    """Simulate a normal impact of a sphere on a rigid plane, without friction."""
    simulation, steps = sphere_over_plane(
        solid, radius_m, frictionless(restitution), (0.0, 0.0, -speed_m_s), **laws
    )
    step = hertz_on_plane(solid, radius_m, speed_m_s).duration_s / STEPS_PER_CONTACT

    def overlap_and_velocity():
        return radius_m - simulation.positions[0, 2], simulation.velocities[0, 2]

    overlap, velocity = track(simulation, steps, 1, overlap_and_velocity).T
    return history_of(overlap, velocity, solid.sphere_mass(radius_m), step)


def history_of(overlap, velocity, mass, step):
    """Take the steps in contact from the overlap and the velocity after every step."""
    # the force at the end of step k changes the velocity in step k + 1
    force = mass * np.diff(velocity) / step
    in_contact = np.flatnonzero(overlap[:-1] > 0.0)
    first = in_contact[0]
    steps_in_contact = overlap[first] / (overlap[first] - overlap[first - 1])
    time = step * (in_contact - first + steps_in_contact)
    return History(time, overlap[in_contact], force[in_contact])


def compare_with_hertz(case, name, history, hertz: Hertz):
    """Compare an elastic impact with Hertz's solution."""
    case.close(f"{name}: peak force [N]", history.force_n.max(), hertz.force_n)
    case.close(f"{name}: overlap [m]", history.overlap_m.max(), hertz.overlap_m)
    case.close(f"{name}: contact time [s]", history.duration_s, hertz.duration_s)


def compare_with_published(case, name, history, force_kn, overlap_um, duration_us):
    """Compare an elastic impact with numbers that were read off published figures."""
    force = 1e-3 * history.force_n.max()
    case.near_published(f"{name}: peak force [kN]", force, force_kn)
    overlap = 1e6 * history.overlap_m.max()
    case.near_published(f"{name}: overlap [um]", overlap, overlap_um)
    duration = 1e6 * history.duration_s
    case.near_published(f"{name}: contact time [us]", duration, duration_us)


def test_two_equal_spheres(case, laws):
    """Two elastic spheres (R 10 mm, 10 m/s each) collide as Hertz predicts (test 1)."""
    for solid in (GLASS, LIMESTONE):
        history = pair_history(solid, 0.01, 20.0, **laws)
        compare_with_hertz(case, solid.name, history, hertz_of_pair(solid, 0.01, 20.0))
        if solid is GLASS:
            compare_with_published(case, solid.name, history, 10.70, 274.0, 40.3)


def test_sphere_on_plane(case, laws):
    """An elastic sphere (R 0.1 m, 0.2 m/s) hits a plane as Hertz predicts (test 2)."""
    for solid in (ALUMINIUM_ALLOY, MAGNESIUM_ALLOY):
        history = plane_history(solid, 0.1, 0.2, **laws)
        compare_with_hertz(case, solid.name, history, hertz_on_plane(solid, 0.1, 0.2))
        if solid is ALUMINIUM_ALLOY:
            compare_with_published(case, solid.name, history, 11.37, 49.7, 731.0)


@with_all_laws
def test_damped_impact(case, laws):
    """A damped sphere hits a plane at 3.9 m/s (test 3): restitution, peak force."""
    radius = 0.0025
    speed = 3.9
    for solid in (ALUMINIUM_OXIDE, CAST_IRON):
        for e in np.linspace(0.2, 1.0, 9):
            velocity, _ = impact(
                solid, radius, frictionless(e), (0.0, 0.0, -speed), **laws
            )
            case.close(f"{solid.name}: restitution", velocity[2] / speed, e)

    hertz = hertz_on_plane(ALUMINIUM_OXIDE, radius, speed)
    for e in (0.2, 0.6, 1.0):
        _, _, exact = hertz.history(e, tension=laws["tension"])
        history = plane_history(ALUMINIUM_OXIDE, radius, speed, e, **laws)
        force = history.force_n.max()
        case.close(f"peak force at e {e:g} [N]", force, exact.max())


def test_the_damped_reference_returns_its_restitution_and_hertz_without_damping():
    hertz = Hertz(mass=0.01, radius=0.005, young=25e9, speed=20.0)
    for e in (0.3, 1.0):
        time, overlap, force = hertz.history(e, 20_000)
        returned = np.trapezoid(force, time) / hertz.mass - hertz.speed
        assert returned == pytest.approx(e * hertz.speed, rel=1e-4)
    assert overlap.max() == pytest.approx(hertz.overlap_m, rel=1e-6)
    assert force.max() == pytest.approx(hertz.force_n, rel=1e-6)
    assert time[-1] == pytest.approx(hertz.duration_s, rel=1e-6)
