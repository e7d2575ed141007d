"""Walls: contacts, loads and overlaps with planes, cones, cylinders and edges."""

import itertools
import math

import numpy as np
import pytest
import trimesh
from dem import common
from dem.clump_scenes import BENT, BODIES, CONE, FUNNEL, bent, scene
from dem.common import (
    BARREL,
    BERRY,
    DOWN,
    FLOOR,
    angular_momentum,
    energy_shares,
    random_direction,
    simulation,
)
from oracles import circle_distance, cone_gap, rotation, support_point
from refusals import value_error

from repose.bench.funnel import Funnel
from repose.dem import (
    Cone,
    Contact,
    Cylinder,
    Mesh,
    Motion,
    Plane,
    RingEdge,
    Simulation,
    random_quaternion,
)
from repose.dem.contact_lists import grow_wall_contacts
from repose.dem.kernels import state as st
from repose.dem.kernels.order import reorder
from repose.dem.rotations import rotation_matrices

TUBED = Funnel(0.15, 0.032, 60.0, 0.02, 0.001, 0.1)
ROOM = {"lower": (-0.1, -0.1, 0.0), "upper": (0.1, 0.1, 0.3)}
LOSSY = Contact(0.4, 0.5, 0.0)


def funnel_simulation(
    contact, funnel=FUNNEL, gravity=(0.0, 0.0, 0.0), dt=2e-5, **keywords
):
    keywords |= {
        "exit_height_m": 0.1,
        "curved_walls_above_m": 0.099,
        "gravity_m_s2": gravity,
    } | ROOM
    return simulation(
        BERRY, contact, contact, funnel.walls("wall"), dt, capacity=1, **keywords
    )


def test_a_funnel_has_its_dimensions():
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
    expected = math.tan(math.radians(60.0))
    assert (top_z - low_z) / (top_r - low_r) == pytest.approx(expected)


def test_a_funnel_touches_nothing_outside_and_inside():
    for radius, height in ((0.06, 0.11), (0.03, 0.08), (0.0, 0.08)):
        s = funnel_simulation(Contact(0.3, 0.5, 0.1))
        s.add((radius, 0.0, height), (1, 0, 0, 0))
        s.run_steps(50)
        assert s.counts[st.N_CURVED] == 0
        assert np.all(s.velocities == 0.0)


def test_a_berry_off_a_disc_falls_below_the_floor():
    walls = {"disc": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", radius_m=0.05)}
    s = simulation(
        BERRY,
        Contact(0.3, 0.5, 0.3),
        walls=walls,
        gravity_m_s2=DOWN,
        dt=1e-4,
        floor_height_m=-0.05,
    )
    s.add((0.0, 0.0, 0.02), (1, 0, 0, 0))
    s.add((0.08, 0.0, 0.02), (1, 0, 0, 0))
    s.run_steps(5000)
    assert list(s.present) == [True, False]
    assert s.positions[0, 2] == pytest.approx(0.0049, abs=2e-4)


@pytest.mark.parametrize("wall", ["cone", "ring"])
def test_contacts_of_a_funnel_are_found_where_a_dense_search_finds_them(wall):
    rng = np.random.default_rng(11)
    row = FUNNEL.walls("wall")["cone" if wall == "cone" else "outlet"].row()
    checked = touched = 0
    for _ in range(400 if wall == "cone" else 150):
        q = random_quaternion(rng)
        if wall == "cone":
            z = rng.uniform(0.13, 0.18)
            angle = rng.uniform(0.0, 2.0 * math.pi)
            r = (row[2] - row[1] * z) / row[0] - rng.uniform(0.003, 0.012)
            place = np.array([r * math.cos(angle), r * math.sin(angle), z])
            slow = cone_gap(BERRY, place, q, *row[:3])
        else:
            place = np.array(
                [rng.uniform(0.004, 0.013), 0.0, rng.uniform(0.092, 0.104)]
            )
            slow = circle_distance(BERRY, place, q, row[0], row[1], count=360) - row[2]
        if not -8e-4 < slow < 8e-4 or abs(slow) < 1e-6:
            continue
        s = funnel_simulation(Contact(0.3, 0.5, 0.1))
        s.add(place, q)
        s.run_steps(1)
        _, walls, normals, azimuths = s.curved_contacts()
        of_wall = walls == (wall == "ring")
        if wall == "cone":
            assert len(walls) == of_wall.sum() == (slow < 0.0)
            assert normals[of_wall, 2] == pytest.approx(row[1])
        else:
            assert not (slow > 0.0 and of_wall.any())
            outward = normals[of_wall, 0] * np.cos(azimuths[of_wall]) + normals[
                of_wall, 1
            ] * np.sin(azimuths[of_wall])
            assert (outward * row[3] + normals[of_wall, 2] * row[4] >= 0.0).all()
        checked += slow > 0.0 or of_wall.any()
        touched += of_wall.sum()
    assert checked > 15
    assert touched > (20 if wall == "cone" else 0)


# from where bodies are thrown down, how many, and how many hit at least
THROWN = {
    "berry, rim": (FUNNEL.walls("wall"), FUNNEL.outlet_height_m + 0.032, 700, 150),
    "berry, rim of a tube": (
        TUBED.walls("wall"),
        TUBED.outlet_height_m + TUBED.tube_length_m + 0.032,
        700,
        150,
    ),
    "clump, cone": ({"cone": CONE}, 0.05, 100, 40),
    "clump, rim": (FUNNEL.walls("wall"), FUNNEL.outlet_height_m + 0.032, 100, 40),
    "clump, plane": ({"floor": FLOOR}, 0.02, 100, 40),
    "clump, mesh": (
        {"cube": common.mesh_of(trimesh.creation.box((0.03, 0.03, 0.03)), 2e-3)},
        0.05,
        100,
        40,
    ),
}
MARKS = {
    "berry, rim": pytest.mark.slow,
    "berry, rim of a tube": pytest.mark.slow,
    # the kernels of clumps and meshes
    "clump, mesh": (pytest.mark.slow, pytest.mark.essential),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=MARKS.get(name, ())) for name in THROWN]
)
def test_hits_on_walls_from_above_create_no_energy(name):
    """Bodies thrown down, spinning; rim hits are where a geometric test sees nothing."""
    rng = np.random.default_rng(13)
    kind = name.split(",")[0]
    walls, height, count, least = THROWN[name]
    hits = 0
    for _ in range(count):
        contact = Contact(rng.uniform(0.2, 0.5), rng.uniform(0.0, 0.8), 0.0)
        s = BODIES[kind](contact=contact, walls=walls, dt=5e-5, **ROOM)
        place = np.array([*rng.uniform(-0.006, 0.006, 2), height])
        velocity = np.array([*rng.uniform(-0.5, 0.5, 2), -rng.uniform(0.4, 1.5)])
        Simulation.add(
            s,
            *s.shapes,
            place,
            random_quaternion(rng),
            velocity,
            30.0 * rng.normal(size=3),
        )
        # a contact that is still loaded holds energy, so only a rise above the start tells
        most, last = energy_shares(s, 10, 120)
        assert most <= 1.0 + 1e-5
        hits += last < 0.98
    assert hits > least


@pytest.mark.slow
def test_no_berry_passes_through_the_cone():
    rng = np.random.default_rng(14)
    cone = FUNNEL.walls("wall")["cone"].row()
    for _ in range(100):
        s = funnel_simulation(
            Contact(0.3, 0.5, 0.05), gravity=(0.0, 0.0, -9.81), dt=2e-4
        )
        r = 0.06 * math.sqrt(rng.random())
        angle = rng.uniform(0, 2 * math.pi)
        s.add((r * math.cos(angle), r * math.sin(angle), 0.215), random_quaternion(rng))
        deepest = 0.0
        for _ in range(300):
            s.run_steps(10)
            x = s.positions[0]
            if x[2] > 0.115:
                deepest = min(
                    deepest,
                    cone_gap(
                        BERRY, x, s.quaternions[0], cone[0], cone[1], cone[2], count=720
                    ),
                )
        assert deepest > -2.5e-3
        assert s.positions[0, 2] < 0.12


DISC_M = 0.05
UP = (0.0, 0.0, 1.0)
DISC = {"disc": Plane((0.0, 0.0, 0.0), UP, "wall", DISC_M)}


@pytest.mark.parametrize("from_side", ["beside", "above", "below"])
@pytest.mark.parametrize("kind", BODIES)
def test_hits_about_the_edge_of_a_disc_create_no_energy(kind, from_side):
    def aim(rng, out, direction):
        if from_side == "beside":
            direction = out + np.array([0.0, 0.0, rng.uniform(-0.5, 0.5)])
        elif from_side == "above":
            direction[2] = abs(direction[2])
        else:
            direction[2] = -abs(direction[2])
        return DISC_M * out, direction

    hits = common.harmless_hits(
        lambda: BODIES[kind](contact=LOSSY, walls=DISC, dt=1e-4), 23, 150, aim
    )
    # from below it goes through, and touches where it comes down again at most
    fewest = {"above": 30, "beside": 3, "below": -1}
    assert hits > fewest[from_side]


@pytest.mark.parametrize("funnel", [FUNNEL, TUBED], ids=["no tube", "tube"])
@pytest.mark.parametrize(
    ("kind", "edges", "end"),
    [
        ("berry", "edges", "outlet"),
        ("berry", "edges", "inlet"),
        ("berry", "bare", "outlet"),
        ("berry", "bare", "inlet"),
        ("clump", "edges", "outlet"),
        ("clump", "bare", "inlet"),
    ],
)
def test_hits_on_a_funnels_ends_from_outside_create_no_energy(funnel, kind, edges, end):
    def aim(_rng, out, direction):
        if end == "inlet":
            return 0.075 * out + [0.0, 0.0, funnel.inlet_height_m], direction
        direction[2] = -abs(direction[2])
        return 0.016 * out + [0.0, 0.0, funnel.outlet_height_m], direction

    walls = {
        name: wall
        for name, wall in funnel.walls("wall").items()
        if edges == "edges" or isinstance(wall, Cone)
    }
    assert (
        common.harmless_hits(
            lambda: BODIES[kind](contact=LOSSY, walls=walls, dt=1e-4, **ROOM),
            29,
            60,
            aim,
        )
        > 2
    )


@pytest.mark.parametrize("kind", BODIES)
def test_contacts_with_a_disc_are_those_of_a_slow_rule(kind):
    """A contact begins in front of the disc where the body's lowest point is over it; it ends with a gap or beyond the edge."""
    rng = np.random.default_rng(31)
    seen = np.zeros(2, int)
    for _ in range(25):
        s = BODIES[kind](contact=LOSSY, walls=DISC, dt=1e-4, gravity_m_s2=DOWN)
        place = np.array(
            [DISC_M + rng.uniform(-0.025, 0.025), 0.0, rng.uniform(-0.004, 0.014)]
        )
        turn = random_quaternion(rng)
        velocity = [rng.uniform(-0.5, 0.5), 0.0, rng.uniform(-0.2, 0.4)]
        Simulation.add(s, *s.shapes, place, turn, velocity, 30.0 * rng.normal(size=3))
        past = np.zeros(1, bool)
        touching = np.zeros(1, bool)
        for _ in range(400):
            if kind == "clump":  # each sphere by itself
                centres = s.positions[0] + BENT[:, :3] @ rotation(s.quaternions[0]).T
                lowest = centres - np.outer(BENT[:, 3], [0.0, 0.0, 1.0])
            else:
                centres = s.positions[:1].copy()
                lowest = centres + support_point(
                    BERRY, s.quaternions[0], np.array([0.0, 0.0, -1.0])
                )
            # a contact that is there goes on behind the plane, too
            begins_past = ~touching & (centres[:, 2] < 0.0)
            past = past | (np.hypot(*lowest.T[:2]) > DISC_M) | begins_past
            past &= lowest[:, 2] <= 0.0
            touching = (lowest[:, 2] <= 0.0) & ~past
            seen += touching.sum(), past.sum()
            s.run_steps(1)
            expected = list(np.flatnonzero(touching))
            assert sorted(s.flat.feature[: s.counts[st.N_PLANE]]) == expected
    assert seen.min() > 200


def test_a_berry_past_a_disc_stays_past_it():
    s = simulation(BERRY, Contact(0.4, 0.5, 0.0), walls=DISC, dt=1e-4, capacity=1)
    s.add((DISC_M + 0.02, 0.0, 0.001), velocity_m_s=(-0.5, 0.0, 0.0))
    s.run_steps(1000)
    # through, level with the disc
    assert s.velocities[0] == pytest.approx((-0.5, 0.0, 0.0), abs=1e-9)
    s.bodies.rows[0, st.VELOCITY : st.VELOCITY + 3] = 0.0, 0.0, 0.5
    s.run_steps(400)
    s.bodies.rows[0, st.VELOCITY : st.VELOCITY + 3] = 0.0, 0.0, -0.5
    s.run_steps(1000)
    assert s.velocities[0, 2] > 0.1


def test_a_berry_rests_on_a_disc():
    s = simulation(
        BERRY,
        Contact(0.4, 0.5, 0.3),
        walls=DISC,
        dt=1e-4,
        capacity=1,
        gravity_m_s2=(0, 0, -9.81),
    )
    s.add((0.0, 0.0, 0.0045))
    s.run_steps(3000)
    assert s.positions[0, 2] == pytest.approx(0.0049, abs=2e-4)


def test_a_berry_past_a_disc_is_kept_in_a_file_and_in_a_new_order(tmp_path):
    s = simulation(BERRY, Contact(0.4, 0.5, 0.0), walls=DISC, dt=1e-4, capacity=2)
    s.add((DISC_M + 0.012, 0.0, 0.001), velocity_m_s=(-0.5, 0.0, 0.0))
    s.add((-0.09, -0.09, 0.02))
    s.run_steps(200)
    assert list(s.flat.allowed_overlap[0, :2]) == [0.0, math.inf]
    s.save(tmp_path / "kept.npz")
    again = Simulation.load(tmp_path / "kept.npz")
    again.run_steps(500)
    assert again.velocities[0] == pytest.approx((-0.5, 0.0, 0.0), abs=1e-9)
    order = reorder(s.bodies, s.grid, s.pairs, s.flat, s.curved, s.meshed, s.counts)
    assert list(s.flat.allowed_overlap[0, :2]) == [[0.0, math.inf][k] for k in order]
    assert list(
        grow_wall_contacts(s.flat, len(s.flat.body), 2).allowed_overlap[0, :2]
    ) == list(s.flat.allowed_overlap[0, :2])


@pytest.mark.parametrize("scene", ["drum", "hopper"])
def test_nothing_leaks_where_walls_meet_exactly(scene):
    rng = np.random.default_rng(37)
    radius = 0.03
    height = 0.05
    walls = {"shell": Cylinder((0.0, 0.0, 0.0), UP, height, radius, "wall")}
    if scene == "drum":
        walls["floor"] = Plane((0.0, 0.0, 0.0), UP, "wall", radius)
        walls["lid"] = Plane((0.0, 0.0, height), (0.0, 0.0, -1.0), "wall", radius)
    else:
        walls["cone"] = Cone.between((0.0, 0.0, -0.03), UP, 0.03, 0.0, radius, "wall")
        walls["lid"] = Plane((0.0, 0.0, height), (0.0, 0.0, -1.0), "wall")
    s = simulation(BERRY, Contact(0.3, 0.5, 0.0), walls=walls, dt=2e-4, capacity=8)
    for k in range(8):
        s.add(
            (0.014 * (k % 2) - 0.007, 0.0, 0.007 + 0.011 * (k // 2)),
            (1.0, 0.0, 0.0, 1.0),
        )
    s.run_steps(200)
    for _ in range(60):
        # shaken twice as hard as by their weight, in changing directions
        s.physics.gravity[:] = 20.0 * random_direction(rng)
        s.run_steps(150)
        x, y, z = s.positions.T
        assert np.hypot(x, y).max() < radius
        assert z.min() > (0.0 if scene == "drum" else -0.03)
        assert z.max() < height


def test_a_sphere_pressed_to_and_fro_over_a_rounded_edge_keeps_its_contact():
    """Where cone and edge meet, each must be found in the step after the other is lost; some of these fell through."""
    rng = np.random.default_rng(3)
    radius = 0.006
    slope = math.radians(20.0)
    funnel = Funnel(0.13, 0.07, 20.0, 0.0, 0.001, 0.05)
    core = np.array([0.036, 0.05])
    along, inwards = np.array(
        [[math.cos(slope), math.sin(slope)], [-math.sin(slope), math.cos(slope)]]
    )
    for _ in range(200):
        r, z = (
            core
            + inwards * (0.001 + radius - rng.uniform(0.0, 3e-4))
            + along * rng.uniform(-2e-5, 5e-5)
        )
        load = rng.uniform(20.0, 150.0)
        speed = rng.uniform(-0.05, 0.05)
        walls = funnel.walls("wall")
        s = simulation(
            np.full((1, 3), radius),
            Contact(0.3, 0.3, 0.0),
            walls=walls,
            dt=4e-4,
            capacity=1,
            **ROOM,
        )
        s.add((r, 0.0, z), velocity_m_s=(along[0] * speed, 0.0, along[1] * speed))
        for _ in range(40):
            s.physics.gravity[[0, 2]] = load * (
                rng.uniform(-1.0, 1.0) * along - inwards
            )
            s.run_steps(int(rng.integers(1, 4)))
            place = np.array([np.hypot(*s.positions[0, :2]), s.positions[0, 2]]) - core
            if abs(place @ along) > 0.002:
                break
            deep = place @ inwards if place @ along > 0.0 else np.hypot(*place)
            assert deep > 0.001 + 0.5 * radius


GRAVITY = 9.81
STEEP = {
    "floor": Plane((0, 0, 0), (0, 0, 1), "wall"),
    "right": Plane((0.03, 0, 0), (-1, 0, 0.2), "wall"),
    "left": Plane((-0.03, 0, 0), (1, 0, 0.2), "wall"),
    "front": Plane((0, 0.03, 0), (0, -1, 0), "wall"),
    "back": Plane((0, -0.03, 0), (0, 1, 0), "wall"),
}


def poured(walls, contact, count, lattice, **keywords):
    s = simulation(
        BERRY,
        contact,
        walls=walls,
        gravity_m_s2=(0, 0, -GRAVITY),
        dt=2e-4,
        capacity=count,
        contact_law="hertz_mindlin_rescaled",
        **keywords,
    )
    rng = np.random.default_rng(2)
    for place in itertools.islice(lattice, count):
        s.add(np.array(place) + 5e-4 * rng.random(3), random_quaternion(rng))
    return s


@pytest.mark.slow
def test_a_resting_pile_weighs_on_its_walls_what_it_weighs():
    places = itertools.product(
        (-0.012, 0.012), (-0.012, 0.012), np.arange(0.012, 0.3, 0.0225)
    )
    s = poured(STEEP, Contact(0.2, 0.5, 0.05), 24, places)
    assert all(np.all(load.force_n == 0.0) for load in s.wall_loads().values())
    s.run_steps(20000)
    assert s.kinetic_energies().max() < 1e-16
    before = {
        name: np.array(getattr(s, name))
        for name in ("positions", "velocities", "quaternions")
    }
    point = np.array([0.1, -0.2, 0.3])
    loads = s.wall_loads(point)
    assert list(loads) == list(STEEP)
    weight = s.n_bodies * s.mass_kg * GRAVITY
    force = sum(load.force_n for load in loads.values())
    assert np.allclose(force, (0.0, 0.0, -weight), rtol=0.0, atol=1e-6 * weight)
    moment = np.cross(s.positions - point, (0.0, 0.0, -s.mass_kg * GRAVITY)).sum(axis=0)
    # rolling resistance holds bodies without a load on the walls: mu_r times the force times a berry's half length
    assert np.allclose(
        sum(load.torque_n_m for load in loads.values()),
        moment,
        rtol=0.0,
        atol=0.05 * weight * 0.011,
    )
    assert loads["right"].force_n[0] > 0.01 * weight
    for name, values in before.items():
        assert np.array_equal(values, getattr(s, name))
    s.run_steps(1)
    value_error("about_m is", s.wall_loads, (0.0, 0.0))


def test_the_torque_on_a_turning_drum_balances_the_moment_of_the_bed_that_it_lifts():
    radius = 0.05
    width = 0.04
    turning = Motion(angular_velocity_rad_s=(0.5, 0.0, 0.0))
    drum = {
        "shell": Cylinder(
            (-width / 2, 0, 0), (1, 0, 0), width, radius, "wall", motion=turning
        )
    }
    for name, side in (("left", -1), ("right", 1)):
        drum[name] = Plane(
            (side * width / 2, 0, 0), (-side, 0, 0), "wall", motion=turning
        )
    places = itertools.product(
        (-0.007, 0.007), (-0.02, 0.0, 0.02), (-0.03, -0.015, 0.0, 0.015)
    )
    s = poured(drum, Contact(0.2, 0.7, 0.0), 18, places)
    s.run_steps(8000)
    weight = s.mass_kg * GRAVITY
    before = angular_momentum(s)[0]
    steps = 200
    torque = 0.0
    moment = 0.0
    for _ in range(steps):
        torque += sum(load.torque_n_m[0] for load in s.wall_loads().values()) / steps
        moment += np.cross(s.positions, (0.0, 0.0, -weight)).sum(axis=0)[0] / steps
        s.run_steps(1)
    changed = (angular_momentum(s)[0] - before) / (steps * s.physics.dt)
    assert abs(moment) > 0.02 * s.n_bodies * weight * radius
    assert torque == pytest.approx(moment - changed, rel=1e-2)


TILT = np.array([0.3, -0.5, 1.0]) / np.linalg.norm([0.3, -0.5, 1.0])
SLOPE = Cone.between((0.01, 0.0, 0.02), TILT, 0.05, 0.016, 0.05, "wall")
SHELL = Cylinder((-0.05, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1, 0.05, "wall")
SHEET = Plane((0.0, 0.0, 0.02), TILT, "wall")
EDGE = RingEdge(0.03, 0.002, "wall", origin_m=(0.0, 0.0, 0.02), axis=TILT)


def beyond_plane(points):
    return (SHEET.point_m - points) @ TILT


def beyond_shell(points):
    return np.hypot(points[:, 1], points[:, 2]) - 0.05


def about_axis(points, origin):
    """Places along an axis of direction TILT, and distances from it."""
    along = (points - origin) @ TILT
    return along, np.linalg.norm(points - origin - along[:, None] * TILT, axis=1)


def beyond_slope(points):
    """How far points lie outside of SLOPE, at right angles to it."""
    along, across = about_axis(points, (0.01, 0.0, 0.02))
    widens = (0.05 - 0.016) / 0.05
    return (across - 0.016 - widens * along) / np.hypot(1.0, widens)


def within_edge(points):
    along, across = about_axis(points, (0.0, 0.0, 0.02))
    return 0.002 - np.hypot(across - 0.03, along)


SIDE = np.cross(TILT, [0.0, 1.0, 0.0]) / np.linalg.norm(np.cross(TILT, [0.0, 1.0, 0.0]))
# the wall, how far points are beyond it, a point of it, and the direction into it there
WALLS = {
    "plane": (SHEET, beyond_plane, np.array(SHEET.point_m), -TILT),
    "shell": (
        SHELL,
        beyond_shell,
        np.array([0.0, 0.03, -0.04]),
        np.array([0.0, 0.6, -0.8]),
    ),
    "slope": (
        SLOPE,
        beyond_slope,
        np.array([0.01, 0.0, 0.02]) + 0.025 * TILT + 0.033 * SIDE,
        SIDE,
    ),
    "edge": (EDGE, within_edge, np.array([0.0, 0.0, 0.02]) + 0.03 * SIDE, SIDE),
}
DEEP_M = 5e-4
SCALE = 1.2
BALL_M = 6e-3


def farthest(kind, turn, beyond, place):
    """How far the farthest point of a body's surface is beyond a wall: ever closer about the best direction."""
    rng = np.random.default_rng(0)
    best = np.zeros(3)
    width = 1.0
    while width > 1e-5:
        normals = best + width * rng.normal(size=(300, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        if kind == "clump":
            points = (BENT[:, None, :3] + BENT[:, None, 3:] * normals).reshape(-1, 3)
        elif kind == "sphere":
            points = BALL_M * normals
        else:
            points = sum(
                axes**2 * normals / np.linalg.norm(axes * normals, axis=1)[:, None]
                for axes in BARREL
            )
        depths = beyond(place + SCALE * points @ turn.T)
        best = normals[depths.argmax() % len(normals)]
        width = 0.5 * width
    return depths.max()


@pytest.mark.parametrize("kind", ["smooth", "sphere", "clump"])
@pytest.mark.parametrize("name", WALLS)
def test_the_deepest_overlap_is_that_of_the_farthest_point(name, kind):
    wall, beyond, place, into = WALLS[name]
    # the numbers of curved walls begin after it
    far_plane = Plane((0.0, 0.0, -9.0), (0.0, 0.0, 1.0), "wall")
    options = {
        "walls": {name: wall} if name == "plane" else {"far": far_plane, name: wall},
        "dt": 1e-9,
    }
    rng = np.random.default_rng(1)
    for _ in range(4):
        turned = random_quaternion(rng)
        turn = rotation_matrices(turned[None])[0]
        centre = place - 0.008 * into
        while (
            abs((depth := farthest(kind, turn, beyond, centre)) - DEEP_M) > 0.2 * DEEP_M
        ):
            centre = centre + (DEEP_M - depth) * into
        if kind == "clump":
            s = scene({"body": bent()}, largest_scale=SCALE, **options)
            s.add("body", centre, turned, scale=SCALE)
        else:
            s = simulation(
                [[BALL_M] * 3] if kind == "sphere" else BARREL,
                largest_scale=SCALE,
                **options,
            )
            s.add(centre, turned, scale=SCALE)
        s.run_steps(1)
        bodies, walls, overlaps = s.wall_overlaps()
        assert set(bodies) == {0}
        assert {s.wall_set.names[number] for number in walls} == {name}
        assert overlaps.max() == pytest.approx(depth, abs=1e-8)


def test_a_grain_across_a_tube_touches_it_at_both_ends():
    """One body and one wall have two contacts, whose forces balance."""
    semi_axes = np.array([[0.010, 0.004, 0.004]])
    overlap_m = 1e-4
    radius_m = semi_axes[0, 0] - overlap_m
    tube = Cylinder((0.0, 0.0, 0.0), UP, 0.05, radius_m, "wall")
    s = simulation(semi_axes, walls={"tube": tube}, dt=1e-7)
    s.add(np.array([0.0, 0.0, 0.025]), np.array([1.0, 0.0, 0.0, 0.0]))
    s.run_steps(1)
    bodies, walls, normals, azimuths = s.curved_contacts()
    assert len(bodies) == len(walls) == 2
    assert np.cos(azimuths[0] - azimuths[1]) == pytest.approx(-1.0)
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-9)
    _, _, overlaps = s.wall_overlaps()
    np.testing.assert_allclose(overlaps, overlap_m, rtol=1e-3)
    np.testing.assert_allclose(s.velocities[0], 0.0, atol=1e-12)


def test_overlaps_with_a_mesh_and_with_a_moving_plane():
    radius = 0.006
    corners = [[-0.1, -0.1, 0.0], [0.2, -0.1, 0.0], [-0.1, 0.2, 0.0], [0.0, 0.0, -0.1]]
    walls = {
        "rising": Plane(
            (0.0, 0.0, 0.0009),
            (0.0, 0.0, 1.0),
            "wall",
            motion=Motion((0.0, 0.0, 100.0)),
        ),
        "solid": Mesh(corners, [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], "wall"),
    }
    s = simulation([[radius] * 3], walls=walls, dt=1e-6)
    s.add((0.0, 0.0, radius - 1e-3))
    s.run_steps(1)
    bodies, numbers, overlaps = s.wall_overlaps()
    assert bodies.tolist() == [0, 0]
    assert [s.wall_set.names[number] for number in numbers] == ["rising", "solid"]
    assert overlaps == pytest.approx([2e-3, 1e-3], abs=1e-6)
