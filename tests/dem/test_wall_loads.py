"""Force and torque on walls: beside the weight of what rests on them, and the moment of a bed in a drum."""

import itertools

import numpy as np
import pytest
from dem.common import BERRY, simulation

from repose.dem import Contact, Cylinder, Motion, Plane, random_quaternion

GRAVITY = 9.81
STEEP = {"floor": Plane((0, 0, 0), (0, 0, 1), "wall"), "right": Plane((0.03, 0, 0), (-1, 0, 0.2), "wall"),
         "left": Plane((-0.03, 0, 0), (1, 0, 0.2), "wall"), "front": Plane((0, 0.03, 0), (0, -1, 0), "wall"),
         "back": Plane((0, -0.03, 0), (0, 1, 0), "wall")}  # fmt: skip


def poured(walls, contact, count, lattice, **keywords):
    """Berries that fall from places of a lattice."""
    s = simulation(
        BERRY, contact, walls=walls, gravity_m_s2=(0, 0, -GRAVITY), dt=2e-4, capacity=count,
        contact_law="hertz_mindlin_rescaled", **keywords,
    )  # fmt: skip
    rng = np.random.default_rng(2)
    for place in itertools.islice(lattice, count):
        s.add(np.array(place) + 5e-4 * rng.random(3), random_quaternion(rng))
    return s


@pytest.mark.slow
def test_a_resting_pile_weighs_on_its_walls_what_it_weighs():
    places = itertools.product((-0.012, 0.012), (-0.012, 0.012), np.arange(0.012, 0.3, 0.0225))
    s = poured(STEEP, Contact(0.2, 0.5, 0.05), 24, places)
    assert all(np.all(load.force_n == 0.0) for load in s.wall_loads().values())
    s.run_steps(20000)
    assert s.kinetic_energies().max() < 1e-16
    before = {name: np.array(getattr(s, name)) for name in ("positions", "velocities", "quaternions")}
    about = np.array([0.1, -0.2, 0.3])
    loads = s.wall_loads(about)
    assert list(loads) == list(STEEP)
    weight = s.n_bodies * s.mass_kg * GRAVITY
    force = sum(load.force_n for load in loads.values())
    assert np.allclose(force, (0.0, 0.0, -weight), rtol=0.0, atol=1e-6 * weight)
    moment = np.cross(s.positions - about, (0.0, 0.0, -s.mass_kg * GRAVITY)).sum(axis=0)
    # rolling resistance holds bodies without a load on the walls: mu_r times the force times a berry's half length
    torque = sum(load.torque_n_m for load in loads.values())
    assert np.allclose(torque, moment, rtol=0.0, atol=0.05 * weight * 0.011)
    assert loads["right"].force_n[0] > 0.01 * weight
    for name, values in before.items():
        assert np.array_equal(values, getattr(s, name))
    s.run_steps(1)
    with pytest.raises(ValueError, match="about_m is"):
        s.wall_loads((0.0, 0.0))


def test_the_torque_on_a_turning_drum_balances_the_moment_of_the_bed_that_it_lifts():
    """Angular momentum about the axis: its change is the moment of the weights less the torque on the walls."""
    radius, width = 0.05, 0.04
    turning = Motion(angular_velocity_rad_s=(0.5, 0.0, 0.0))
    drum = {
        "shell": Cylinder((-width / 2, 0, 0), (1, 0, 0), width, radius, "wall", motion=turning),
        "left": Plane((-width / 2, 0, 0), (1, 0, 0), "wall", motion=turning),
        "right": Plane((width / 2, 0, 0), (-1, 0, 0), "wall", motion=turning),
    }
    places = itertools.product((-0.007, 0.007), (-0.02, 0.0, 0.02), (-0.03, -0.015, 0.0, 0.015))
    s = poured(drum, Contact(0.2, 0.7, 0.0), 18, places)
    s.run_steps(8000)
    weight = s.mass_kg * GRAVITY

    def momentum():
        return (np.cross(s.positions, s.mass_kg * s.velocities) + s.angular_momenta).sum(axis=0)[0]

    before, steps, torque, moment = momentum(), 200, 0.0, 0.0
    for _ in range(steps):
        torque += sum(load.torque_n_m[0] for load in s.wall_loads().values()) / steps
        moment += np.cross(s.positions, (0.0, 0.0, -weight)).sum(axis=0)[0] / steps
        s.run_steps(1)
    changed = (momentum() - before) / (steps * s.physics.dt)
    assert abs(moment) > 0.02 * s.n_bodies * weight * radius
    assert torque == pytest.approx(moment - changed, rel=1e-2)
