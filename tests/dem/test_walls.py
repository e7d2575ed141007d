import math

import numpy as np
import pytest
from dem.common import BERRY, random_direction, simulation
from oracles import circle_distance, cone_gap, support_point

from repose.apparatus.funnel import Funnel
from repose.dem import Cone, Contact, Cylinder, Plane, Simulation, random_quaternion
from repose.dem.contact_lists import grown_wall_contacts
from repose.dem.kernels import state as st
from repose.dem.kernels.order import reorder

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


@pytest.mark.slow
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
        place = np.array([rng.uniform(-0.006, 0.006), rng.uniform(-0.006, 0.006), bottom + funnel.tube_length_m])
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


@pytest.mark.slow
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


# --- ends of walls, and what lies behind them -----------------------------------------------------

DISC_M = 0.05
UP = (0.0, 0.0, 1.0)


def disc():
    return {"disc": Plane((0.0, 0.0, 0.0), UP, "wall", DISC_M)}


def thrown_at(s, target, rng, direction, spin=30.0):
    """Throw a body from 30 mm away at a place; its energy over that before, or None where it was added touching."""
    direction = direction / np.linalg.norm(direction)
    s.add(
        target + 0.03 * direction, random_quaternion(rng), -rng.uniform(0.2, 1.2) * direction, spin * rng.normal(size=3)
    )
    s.run_steps(1)
    if s.counts[st.N_PLANE] + s.counts[st.N_CURVED]:
        return None
    energy, most = s.kinetic_energies()[0], 0.0
    for _ in range(10):
        s.run_steps(round(0.008 / s.physics.dt))
        most = max(most, s.kinetic_energies()[0] / energy)
    return most, s.kinetic_energies()[0] / energy


@pytest.mark.parametrize("from_side", ["beside", "above", "below"])
def test_hits_about_the_edge_of_a_disc_create_no_energy(from_side):
    rng = np.random.default_rng(23)
    worst, hits = 0.0, 0
    for _ in range(150):
        s = simulation(BERRY, Contact(0.4, 0.5, 0.0), walls=disc(), dt=1e-4, capacity=1)
        angle = rng.uniform(0.0, 2.0 * math.pi)
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        direction = random_direction(rng)
        if from_side == "beside":
            direction = out + np.array([0.0, 0.0, rng.uniform(-0.5, 0.5)])
        else:
            direction[2] = abs(direction[2]) if from_side == "above" else -abs(direction[2])
        found = thrown_at(s, DISC_M * out + 0.008 * rng.normal(size=3), rng, direction)
        if found is not None:
            worst, hits = max(worst, found[0]), hits + (found[1] < 0.999)
    assert worst < 1.0 + 1e-5
    # from below it goes through, and touches where it comes down again at most
    assert hits > (30 if from_side == "above" else 3 if from_side == "beside" else -1)


@pytest.mark.parametrize("funnel", [FUNNEL, TUBED], ids=["no tube", "tube"])
@pytest.mark.parametrize("edges", [True, False], ids=["edges", "bare"])
@pytest.mark.parametrize("end", ["outlet", "inlet"])
def test_hits_on_a_funnels_ends_from_outside_create_no_energy(funnel, edges, end):
    rng = np.random.default_rng(29)
    walls = {name: wall for name, wall in funnel.walls("wall").items() if edges or isinstance(wall, Cone)}
    worst, hits = 0.0, 0
    for _ in range(60):
        s = simulation(
            BERRY,
            Contact(0.4, 0.5, 0.0),
            walls=walls,
            dt=1e-4,
            capacity=1,
            lower=(-0.1, -0.1, 0),
            upper=(0.1, 0.1, 0.3),
        )
        angle = rng.uniform(0.0, 2.0 * math.pi)
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        direction = random_direction(rng)
        place = 0.075 * out + [0.0, 0.0, funnel.inlet_height_m]
        if end == "outlet":
            direction[2] = -abs(direction[2])
            place = 0.016 * out + [0.0, 0.0, funnel.outlet_height_m]
        found = thrown_at(s, place + 0.008 * rng.normal(size=3), rng, direction)
        if found is not None:
            worst, hits = max(worst, found[0]), hits + (found[1] < 0.999)
    assert worst < 1.0 + 1e-5
    assert hits > 2


def test_contacts_with_a_disc_are_those_of_a_slow_rule():
    """A contact begins in front of the disc and over it, from a gap; it ends with a gap or beyond the edge."""
    rng = np.random.default_rng(31)
    seen = {"held": 0, "past": 0}
    for _ in range(25):
        s = simulation(BERRY, Contact(0.4, 0.5, 0.0), walls=disc(), dt=1e-4, capacity=1, gravity_m_s2=(0, 0, -9.81))
        place = np.array([DISC_M + rng.uniform(-0.025, 0.025), 0.0, rng.uniform(-0.004, 0.014)])
        s.add(
            place,
            random_quaternion(rng),
            [rng.uniform(-0.5, 0.5), 0.0, rng.uniform(-0.2, 0.4)],
            30.0 * rng.normal(size=3),
        )
        past = touching = False
        for _ in range(400):
            centre = s.positions[0].copy()
            lowest = support_point(BERRY, s.quaternions[0], np.array([0.0, 0.0, -1.0]))
            gap = centre[2] + lowest[2]
            if gap > 0.0:
                past = touching = False
            elif not touching and not past:
                past = math.hypot(*centre[:2]) > DISC_M or centre[2] < 0.0
                touching = not past
            if touching and math.hypot(*(centre + lowest)[:2]) > DISC_M:
                past, touching = True, False
            seen["held"] += touching
            seen["past"] += past
            s.run_steps(1)
            assert s.counts[st.N_PLANE] == touching
    assert min(seen.values()) > 200


def test_a_berry_that_went_over_the_edge_falls_and_is_held_again_once_it_was_above():
    s = simulation(BERRY, Contact(0.4, 0.5, 0.0), walls=disc(), dt=1e-4, capacity=1)
    s.add((DISC_M + 0.02, 0.0, 0.001), velocity_m_s=(-0.5, 0.0, 0.0))
    s.run_steps(1000)
    assert s.velocities[0] == pytest.approx((-0.5, 0.0, 0.0), abs=1e-9)  # through, level with the disc
    s.bodies.rows[0, st.VELOCITY : st.VELOCITY + 3] = 0.0, 0.0, 0.5
    s.run_steps(400)
    s.bodies.rows[0, st.VELOCITY : st.VELOCITY + 3] = 0.0, 0.0, -0.5
    s.run_steps(1000)
    assert s.velocities[0, 2] > 0.1


def test_a_berry_added_touching_is_held():
    s = simulation(BERRY, Contact(0.4, 0.5, 0.3), walls=disc(), dt=1e-4, capacity=1, gravity_m_s2=(0, 0, -9.81))
    s.add((0.0, 0.0, 0.0045))
    s.run_steps(3000)
    assert s.positions[0, 2] == pytest.approx(0.0049, abs=2e-4)


def test_a_checkpoint_and_a_new_order_keep_what_is_past_a_wall(tmp_path):
    s = simulation(BERRY, Contact(0.4, 0.5, 0.0), walls=disc(), dt=1e-4, capacity=2)
    s.add((DISC_M + 0.012, 0.0, 0.001), velocity_m_s=(-0.5, 0.0, 0.0))
    s.add((-0.09, -0.09, 0.02))
    s.run_steps(200)
    assert list(s.flat.deepest[0, :2]) == [0.0, math.inf]
    s.save(tmp_path / "kept.npz")
    again = Simulation.load(tmp_path / "kept.npz")
    again.run_steps(500)
    assert again.velocities[0] == pytest.approx((-0.5, 0.0, 0.0), abs=1e-9)
    order = reorder(s.bodies, s.grid, s.pairs, s.flat, s.curved, s.meshed, s.counts)
    assert list(s.flat.deepest[0, :2]) == [[0.0, math.inf][k] for k in order]
    assert list(grown_wall_contacts(s.flat, len(s.flat.body), 2).deepest[0, :2]) == list(s.flat.deepest[0, :2])


@pytest.mark.parametrize("scene", ["drum", "hopper"])
def test_nothing_leaks_where_walls_meet_exactly(scene):
    """A drum whose caps end at its shell and at whose ends the shell ends; a cylinder on a cone, without an edge."""
    rng = np.random.default_rng(37)
    radius, height = 0.03, 0.05
    walls = {"shell": Cylinder((0.0, 0.0, 0.0), UP, height, radius, "wall")}
    if scene == "drum":
        walls["floor"] = Plane((0.0, 0.0, 0.0), UP, "wall", radius)
        walls["lid"] = Plane((0.0, 0.0, height), (0.0, 0.0, -1.0), "wall", radius)
    else:
        walls["cone"] = Cone.between((0.0, 0.0, -0.03), UP, 0.03, 0.0, radius, "wall")
        walls["lid"] = Plane((0.0, 0.0, height), (0.0, 0.0, -1.0), "wall")
    s = simulation(BERRY, Contact(0.3, 0.5, 0.0), walls=walls, dt=2e-4, capacity=8)
    for k in range(8):
        s.add((0.014 * (k % 2) - 0.007, 0.0, 0.007 + 0.011 * (k // 2)), (1.0, 0.0, 0.0, 1.0))
    s.run_steps(200)
    for _ in range(60):
        # shaken twice as hard as by their weight, in changing directions
        s.physics.gravity[:] = 20.0 * random_direction(rng)
        s.run_steps(150)
        x, y, z = s.positions.T
        assert np.hypot(x, y).max() < radius
        assert z.min() > (0.0 if scene == "drum" else -0.03)
        assert z.max() < height
