import math

import numpy as np
import pytest
from dem.common import BERRY, simulation
from oracles import circle_distance, cone_gap

from repose.apparatus.funnel_geometry import Funnel
from repose.dem import Contact, Plane, random_quaternion
from repose.dem.kernels import state as st

FUNNEL = Funnel(0.15, 0.032, 60.0, 0.0, 0.001, 0.1)
TUBED = Funnel(0.15, 0.032, 60.0, 0.02, 0.001, 0.1)


def funnel_simulation(contact, funnel=FUNNEL, gravity=(0.0, 0.0, 0.0), dt=2e-5, **keywords):
    """One berry in a funnel without a plate."""
    return simulation(
        BERRY,
        contact,
        contact,
        funnel.walls("wall"),
        dt,
        capacity=1,
        gravity_m_s2=gravity,
        lower=(-0.1, -0.1, 0.0),
        upper=(0.1, 0.1, 0.3),
        exit_height_m=0.1,
        curved_walls_above_m=0.099,
        **keywords,
    )


def test_the_funnel_has_the_dimensions_asked_for():
    cone = FUNNEL.walls("wall")["cone"].row()
    normal_r, normal_z, offset, lowest, highest = cone[:5]

    def radius_at(along):
        # the point of the cone's line at distance `along` up the wall
        return normal_r * offset + cone[5] * along, normal_z * offset + cone[6] * along

    top_r, top_z = radius_at(highest)
    assert top_r == pytest.approx(0.075)
    assert top_z == pytest.approx(FUNNEL.inlet_height_m)
    low_r, low_z = radius_at(lowest)
    # the cone ends where it meets the rounded edge, whose innermost circle is the outlet
    ring = FUNNEL.walls("wall")["outlet"].row()
    assert math.hypot(ring[0] - low_r, ring[1] - low_z) == pytest.approx(0.001)
    assert ring[0] - 0.001 == pytest.approx(0.016)
    assert (top_z - low_z) / (top_r - low_r) == pytest.approx(math.tan(math.radians(60.0)))


def settle_contacts(s, place, q):
    """Put a berry at a place and let the engine find its contacts; (wall, normal, azimuth) of each."""
    s.add(place, q)
    s.run_steps(1)
    _, walls, normals, azimuths = s.curved_contacts()
    return list(zip(walls, normals, azimuths, strict=True))


def test_cone_contacts_are_found_where_a_dense_search_finds_them():
    rng = np.random.default_rng(11)
    cone = FUNNEL.walls("wall")["cone"].row()
    touched = 0
    for _ in range(400):
        q = random_quaternion(rng)
        z, angle = rng.uniform(0.13, 0.18), rng.uniform(0.0, 2.0 * math.pi)
        wall_r = (cone[2] - cone[1] * z) / cone[0]
        r = wall_r - rng.uniform(0.003, 0.012)
        place = np.array([r * math.cos(angle), r * math.sin(angle), z])
        slow = cone_gap(BERRY, place, q, cone[0], cone[1], cone[2])
        if not -8e-4 < slow < 8e-4 or abs(slow) < 1e-8:
            continue
        s = funnel_simulation(Contact(0.3, 0.5, 0.1))
        contacts = settle_contacts(s, place, q)
        touched += slow < 0.0
        assert (len(contacts) > 0) == (slow < 0.0)
        if contacts:
            normal = contacts[0][1]
            assert normal[2] == pytest.approx(cone[1])
    assert touched > 20


def test_ring_contacts_are_found_where_a_dense_search_finds_them():
    rng = np.random.default_rng(12)
    ring = FUNNEL.walls("wall")["outlet"].row()
    up = np.array(ring[3:5])
    checked = 0
    for _ in range(150):
        q = random_quaternion(rng)
        place = np.array([rng.uniform(0.004, 0.013), 0.0, rng.uniform(0.092, 0.104)])
        slow = circle_distance(BERRY, place, q, ring[0], ring[1], count=360) - ring[2]
        if not -8e-4 < slow < 8e-4 or abs(slow) < 1e-6:
            continue
        s = funnel_simulation(Contact(0.3, 0.5, 0.1))
        contacts = [c for c in settle_contacts(s, place, q) if c[0] == 1]
        if slow > 0.0:
            assert not contacts
            checked += 1
        elif contacts:
            _, normal, theta = contacts[0]
            outward = normal[0] * math.cos(theta) + normal[1] * math.sin(theta)
            assert outward * up[0] + normal[2] * up[1] >= 0.0
            checked += 1
    assert checked > 15


@pytest.mark.parametrize("funnel", [FUNNEL, TUBED], ids=["no tube", "tube"])
def test_hits_of_cone_and_edge_create_no_energy(funnel):
    """Berries thrown at the outlet from inside, spinning; rim hits are where a geometric test sees nothing."""
    rng = np.random.default_rng(13)
    hits = 0
    worst = 0.0
    for _ in range(700):
        e = rng.uniform(0.2, 0.5)
        s = funnel_simulation(Contact(e, rng.uniform(0.4, 0.8), 0.0), funnel, dt=5e-5)
        bottom = funnel.outlet_height_m
        place = np.array(
            [rng.uniform(-0.006, 0.006), rng.uniform(-0.006, 0.006), bottom + funnel.tube_length_m]
        )
        place[2] += 0.032
        velocity = np.array([*rng.uniform(-0.5, 0.5, 2), -rng.uniform(0.5, 1.5)])
        s.add(place, random_quaternion(rng), velocity, 30.0 * rng.normal(size=3))
        energy = s.kinetic_energies()[0]
        for _ in range(14):
            s.run_steps(100)
            # a contact that is still loaded holds energy, so only a rise above the start tells
            worst = max(worst, s.kinetic_energies()[0] / energy)
        hits += s.kinetic_energies()[0] < 0.98 * energy
    assert hits > 150
    assert worst < 1.0 + 1e-5


def test_a_berry_outside_the_funnel_is_not_touched_by_it():
    for radius, height in ((0.06, 0.11), (0.03, 0.08), (0.0, 0.08)):
        s = funnel_simulation(Contact(0.3, 0.5, 0.1))
        s.add((radius, 0.0, height), (1, 0, 0, 0))
        s.run_steps(50)
        assert s.counts[st.N_CURVED] == 0
        assert np.all(s.velocities == 0.0)


def test_no_berry_passes_through_the_cone():
    rng = np.random.default_rng(14)
    cone = FUNNEL.walls("wall")["cone"].row()
    for _ in range(100):
        s = funnel_simulation(Contact(0.3, 0.5, 0.05), gravity=(0.0, 0.0, -9.81), dt=2e-4)
        r, angle = 0.06 * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
        s.add((r * math.cos(angle), r * math.sin(angle), 0.215), random_quaternion(rng))
        deepest = 0.0
        for _ in range(300):
            s.run_steps(10)
            x = s.positions[0]
            if x[2] > 0.115:
                gap = cone_gap(BERRY, x, s.quaternions[0], cone[0], cone[1], cone[2], count=720)
                deepest = min(deepest, gap)
        assert deepest > -2.5e-3
        assert s.positions[0, 2] < 0.12


def test_a_disc_holds_what_is_over_it_and_nothing_else():
    walls = {"disc": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", radius_m=0.05)}
    s = simulation(
        BERRY, Contact(0.3, 0.5, 0.3), walls=walls, gravity_m_s2=(0, 0, -9.81), dt=1e-4, floor_height_m=-0.05
    )
    s.add((0.0, 0.0, 0.02), (1, 0, 0, 0))
    s.add((0.08, 0.0, 0.02), (1, 0, 0, 0))
    s.run_steps(5000)
    assert list(s.present) == [True, False]
    assert s.positions[0, 2] == pytest.approx(0.0049, abs=2e-4)
