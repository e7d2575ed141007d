"""Clumps of spheres: contacts are those of all pairs of spheres, nothing is created."""

import itertools
import math

import numpy as np
import pytest
import trimesh
from dem.clump_scenes import BENT, BENT_INERTIA, CONE, FUNNEL, MASS, RADIUS, ball_of_one, bent, scene
from dem.common import DENSITY, FLOOR, GOJI, PVC, angular_momentum, bits, energy_shares, mesh_of, random_direction
from oracles import rotation
from refusals import not_refused

from repose.apparatus.funnel import Funnel
from repose.dem import (
    Clump,
    Contact,
    Cylinder,
    Motion,
    Plane,
    Recorder,
    Shape,
    Simulation,
    random_quaternion,
    write_vtk,
)
from repose.dem.kernels import state as st
from repose.dem.kernels.clumps import new_sphere_pairs
from repose.dem.tessellation import tessellate, triangulated_bodies

TUBED = Funnel(0.15, 0.032, 60.0, 0.02, 0.001, 0.1)


def all_spheres(s):
    """Centres (N, 3) and radii (N,) of all spheres in the world, their bodies and numbers."""
    shapes = list(s.shapes.values())
    centres, radii, bodies, numbers = [], [], [], []
    for i in range(s.n_bodies):
        spheres = s.scales[i] * shapes[s.shape_ids[i]].spheres_m
        centres.append(s.positions[i] + spheres[:, :3] @ rotation(s.quaternions[i]).T)
        radii.append(spheres[:, 3])
        bodies.append(np.full(len(spheres), i))
        numbers.append(np.arange(len(spheres)))
    return tuple(np.concatenate(v) for v in (centres, radii, bodies, numbers))


def slow_contacts(s):
    """Gaps of all pairs of spheres of different bodies: (i, j, a, b) to gap, of those below 2 mm."""
    centres, radii, bodies, numbers = all_spheres(s)
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2) - radii[:, None] - radii[None]
    near = np.argwhere((gaps < 2e-3) & (bodies[:, None] < bodies[None]))
    return {(bodies[p], bodies[q], numbers[p], numbers[q]): gaps[p, q] for p, q in near}


def fast_contacts(s):
    bodies, spheres, _normals = s.sphere_contacts()
    found = [(*pair, *numbers) for pair, numbers in zip(bodies, spheres, strict=True)]
    assert len(set(found)) == len(found)
    return set(found)


def cloud(capacity=40, seed=2, **keywords):
    walls = {
        f"{axis}{side}": Plane(0.04 * side * np.eye(3)[axis], -side * np.eye(3)[axis], "wall")
        for axis in range(3)
        for side in (-1, 1)
    }
    s = scene(
        {"bent": bent(), "pair": Clump(BENT[1:3] - BENT[1:3, :3].mean(0) @ np.eye(3, 4), MASS, BENT_INERTIA, "body")},
        walls=walls, dt=5e-5, capacity=capacity, largest_scale=1.1, **keywords,
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    places = itertools.product((-0.03, -0.01, 0.01, 0.03), (-0.026, 0.0, 0.026), (-0.03, -0.01, 0.01, 0.03))
    for k, place in enumerate(itertools.islice(places, capacity)):
        place = np.array(place)
        s.add(
            ("bent", "pair")[k % 2], place, random_quaternion(rng), -20.0 * place + 0.3 * rng.normal(size=3),
            30.0 * rng.normal(size=3), scale=rng.uniform(0.9, 1.1),
        )  # fmt: skip
    return s


@pytest.mark.parametrize("seed", [1, 2])
def test_touching_spheres_are_those_of_all_pairs_at_every_moment(seed):
    s = cloud(seed=seed)
    seen = 0
    for _ in range(150):
        # contacts are found before a step moves the bodies
        slow = {pair for pair, gap in slow_contacts(s).items() if gap < 0.0}
        s.run_steps(1)
        fast = fast_contacts(s)
        assert fast == slow
        assert set(map(tuple, s.contacts())) == {pair[:2] for pair in fast}
        seen += len(fast)
        s.run_steps(7)
    assert seen > 1500


def test_entries_are_used_again_and_lists_grow_and_momentum_stays_and_hits_create_no_energy():
    runs = []
    for shrink in (False, True):
        s = cloud()
        if shrink:
            s.pairs = new_sphere_pairs(64, 40, 5, s.capacity, 3)
        s.run_steps(1500)
        holes, used = int(s.counts[st.N_FREE]), int(s.counts[st.N_NEAR])
        listed = s.pairs.near_first[:used] < s.capacity
        assert listed.sum() == used - holes
        pairs = np.column_stack([s.pairs.near_first[:used], s.pairs.near_second[:used]])[listed]
        assert len(np.unique(pairs, axis=0)) == len(pairs)
        assert s.pairs.live[:used].sum() == s.counts[st.N_PAIRS]
        bits = np.unpackbits(s.pairs.known[:used].view(np.uint8)).sum()
        assert bits == s.counts[st.N_PAIRS]
        runs.append(s.positions.tobytes())
    assert len(s.pairs.near_limit) > 40
    assert runs[0] == runs[1]
    rng = np.random.default_rng(7)
    hits = 0
    for _ in range(250):
        e, mu = rng.uniform(0.2, 0.6), rng.uniform(0.0, 0.8)
        s = scene({"bent": bent()}, Contact(e, mu, 0.0), dt=2e-5)
        way = random_direction(rng)
        s.add("bent", 0.5 * 0.024 * way, random_quaternion(rng), -0.5 * way, 40.0 * rng.normal(size=3))
        s.add("bent", -0.5 * 0.024 * way, random_quaternion(rng), 0.5 * way + 0.1 * rng.normal(size=3))
        momentum = s.velocities.sum(axis=0)
        spin = angular_momentum(s)
        most, last = energy_shares(s, 25, 80)
        assert most <= 1.0 + 1e-5
        hits += last < 0.98
        assert np.abs(s.velocities.sum(axis=0) - momentum).max() < 1e-14
        assert np.abs(angular_momentum(s) - spin).max() < 1e-5 * np.abs(spin).max()
    assert hits > 120


@pytest.mark.parametrize("kind", ["cone", "rim", "plane", "mesh"])
def test_hits_on_walls_create_no_energy(kind):
    walls = {
        "cone": {"cone": CONE},
        "rim": FUNNEL.walls("wall"),
        "plane": {"floor": FLOOR},
        "mesh": {"cube": mesh_of(trimesh.creation.box((0.03, 0.03, 0.03)), 2e-3)},
    }[kind]
    height = {"cone": 0.05, "rim": FUNNEL.outlet_height_m + 0.032, "plane": 0.02, "mesh": 0.05}[kind]
    rng = np.random.default_rng(8)
    hits = 0
    for _ in range(150):
        s = scene({"bent": bent()}, Contact(rng.uniform(0.2, 0.5), rng.uniform(0.0, 0.8), 0.0), walls, dt=2e-5)
        place = np.array([*rng.uniform(-0.006, 0.006, 2), height])
        velocity = np.array([*rng.uniform(-0.4, 0.4, 2), -rng.uniform(0.4, 1.2)])
        s.add("bent", place, random_quaternion(rng), velocity, 30.0 * rng.normal(size=3))
        most, last = energy_shares(s, 25, 80)
        assert most <= 1.0 + 1e-5
        hits += last < 0.98
    assert hits > 60


@pytest.mark.parametrize("end", ["disc", "outlet", "inlet", "tube"])
def test_hits_about_the_ends_of_walls_create_no_energy(end):
    """From all sides: what overlaps a wall beyond its end, or from behind, is not thrown."""
    rng = np.random.default_rng(41)
    funnel = TUBED if end == "tube" else FUNNEL
    walls, radius, height = {
        "disc": ({"disc": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", 0.05)}, 0.05, 0.0),
        "outlet": (funnel.walls("wall"), 0.016, funnel.outlet_height_m),
        "tube": (funnel.walls("wall"), 0.016, funnel.outlet_height_m),
        "inlet": ({"cone": funnel.walls("wall")["cone"]}, 0.075, funnel.inlet_height_m),
    }[end]
    hits = 0
    for _ in range(80):
        s = scene({"bent": bent()}, Contact(0.4, 0.5, 0.0), walls, dt=1e-4)
        angle, direction = rng.uniform(0.0, 2.0 * math.pi), random_direction(rng)
        place = np.array([radius * math.cos(angle), radius * math.sin(angle), height]) + 0.008 * rng.normal(size=3)
        velocity = -rng.uniform(0.2, 1.2) * direction
        s.add("bent", place + 0.03 * direction, random_quaternion(rng), velocity, 30.0 * rng.normal(size=3))
        s.run_steps(1)
        if s.counts[st.N_PLANE] + s.counts[st.N_CURVED]:
            continue  # added touching
        most, last = energy_shares(s, 10, 80)
        assert most <= 1.0 + 1e-5
        hits += last < 0.98
    assert hits > 8


def test_spheres_on_a_disc_are_those_of_a_slow_rule():
    """A sphere's contact begins in front of the disc and over it, from a gap; it ends with a gap or beyond the edge."""
    rng = np.random.default_rng(43)
    seen = np.zeros(2, int)
    for _ in range(25):
        walls = {"disc": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", 0.05)}
        s = scene({"bent": bent()}, Contact(0.4, 0.5, 0.0), walls, dt=1e-4, gravity=(0.0, 0.0, -9.81))
        place = np.array([0.05 + rng.uniform(-0.025, 0.025), 0.0, rng.uniform(-0.004, 0.014)])
        velocity = [rng.uniform(-0.5, 0.5), 0.0, rng.uniform(-0.2, 0.4)]
        s.add("bent", place, random_quaternion(rng), velocity, 30.0 * rng.normal(size=3))
        past, touching = np.zeros(5, bool), np.zeros(5, bool)
        for _ in range(300):
            x, y, z = (s.positions[0] + BENT[:, :3] @ rotation(s.quaternions[0]).T).T
            clear, beyond = z > BENT[:, 3], np.hypot(x, y) > 0.05
            # a contact that is there goes on behind the plane, too
            past = ~clear & (past | beyond | (~touching & (z < 0.0)))
            touching = ~clear & ~past
            seen += touching.sum(), past.sum()
            s.run_steps(1)
            held = s.flat.feature[: s.counts[st.N_PLANE]]
            assert sorted(held) == list(np.flatnonzero(touching))
    assert seen.min() > 300


@pytest.mark.parametrize("scale", [1.0, 1.3])
def test_a_clump_at_rest_on_a_plate_weighs_what_it_weighs(scale):
    contact = Contact(0.2, 0.5, 0.02)
    s = scene({"bent": bent()}, contact, {"floor": FLOOR}, 5e-5, gravity=(0, 0, -9.81), largest_scale=1.3)
    s.add("bent", (0.0, 0.0, 0.012), (1.0, 0.3, 0.1, 0.0), scale=scale)
    s.run_steps(30000)
    assert s.kinetic_energies()[0] < 1e-15
    centres, radii, *_ = all_spheres(s)
    overlaps = np.maximum(radii - centres[:, 2], 0.0)
    stiffness = s.physics.law_constants[0, 1, 0]
    assert 2 <= np.sum(overlaps > 0.0) == s.counts[st.N_PLANE]
    weight = MASS * scale**3 * 9.81
    assert np.sum(stiffness * np.sqrt(radii) * overlaps**1.5) == pytest.approx(weight, rel=1e-6)


def test_clumps_pass_a_funnel():
    walls = {**FUNNEL.walls("wall"), "floor": FLOOR}
    s = scene({"bent": bent()}, Contact(0.2, 0.6, 0.05), walls, 5e-5, gravity=(0, 0, -9.81), capacity=40,
              upper=(0.1, 0.1, 0.4), curved_walls_above_m=FUNNEL.outlet_height_m - 0.001)  # fmt: skip
    rng = np.random.default_rng(5)
    touched = set()
    for k in range(40):
        s.add("bent", (*rng.uniform(-0.02, 0.02, 2), 0.17 + 0.005 * k), random_quaternion(rng))
        for _ in range(15):  # a hit on the edge is over in some tens of steps
            s.run_steps(20)
            touched |= set(s.curved_contacts()[1])
        assert np.linalg.norm(s.velocities, axis=1).max() < 3.0
    assert touched == {0, 1}
    assert s.positions[:, 2].min() > 0.0
    _body, wall, normal, azimuth = s.curved_contacts()
    assert np.all(np.abs(np.linalg.norm(normal, axis=1) - 1.0) < 1e-12)
    on_cone = wall == 0
    # a cone's normal points outwards at its azimuth; the body has moved on by a step
    assert np.allclose(np.arctan2(normal[on_cone, 1], normal[on_cone, 0]), azimuth[on_cone], atol=0.01)


def pouring():
    walls = {
        "floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", motion=Motion((0.0, 0.0, 0.2))),
        "tube": Cylinder((0, 0, -0.1), (0, 0, 1), 0.5, 0.04, "wall"),
        "block": mesh_of(trimesh.creation.box((0.02, 0.02, 0.02)), 1e-3, motion=Motion((0, 0, 0.2), (0, 0, 20))),
    }
    laws = {pair: Contact(0.3, 0.5, 0.02) for pair in itertools.combinations_with_replacement(("body", "clay"), 2)}
    laws |= {("body", "wall"): Contact(0.4, 0.5, 0.02), ("clay", "wall"): Contact(0.2, 0.5, 0.02)}
    s = Simulation(
        {"bent": bent(), "ball": ball_of_one(0.005, "clay")}, {"body": GOJI, "clay": GOJI, "wall": PVC}, laws, 5e-5,
        capacity=31, lower=(-0.04, -0.04, 0.0), upper=(0.04, 0.04, 0.2), walls=walls, largest_scale=1.2,
    )  # fmt: skip
    rng = np.random.default_rng(3)
    for k in range(30):
        layer, place = divmod(k, 4)
        x, y = 0.015 * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)][place])
        turn, scale = rng.normal(size=4), rng.uniform(0.9, 1.2)
        s.add(("bent", "ball")[k % 3 == 0], (x, y, 0.03 + 0.022 * layer), turn, scale=scale)
    return s


def test_a_checkpoint_goes_on_with_the_same_bits_and_so_does_the_seed(tmp_path, monkeypatch):
    s = pouring()
    s.run_steps(2000)
    assert s.counts[st.N_MESHED] > 0
    assert s.counts[st.N_CURVED] > 0
    assert len(s.contacts()) > 10
    s.save(tmp_path / "half.npz")
    s.run_steps(2000)
    loaded = Simulation.load(tmp_path / "half.npz")
    loaded.run_steps(2000)
    assert bits(loaded) == bits(s)
    # lists that have to grow on the way change nothing, and are saved whole
    monkeypatch.setattr("repose.dem.contact_lists.SPHERE_CONTACTS_PER_BODY", 1)
    monkeypatch.setattr("repose.dem.contact_lists.MOST_NEW", 0)
    monkeypatch.setattr("repose.dem.contact_lists.NEAR_PER_BODY", -7)
    grown = pouring()
    room = len(grown.pairs.first), len(grown.pairs.near_limit)
    grown.run_steps(3000)
    assert len(grown.pairs.first) > room[0]
    assert len(grown.pairs.near_limit) > room[1]
    grown.save(tmp_path / "grown.npz")
    loaded = Simulation.load(tmp_path / "grown.npz")
    loaded.run_steps(1000)
    assert bits(loaded) == bits(s)


def test_clumps_below_the_floor_are_gone_and_wrong_ones_refused():
    s = scene({"bent": bent()}, gravity=(0, 0, -9.81), dt=5e-5, capacity=6, floor_height_m=-0.02,
              walls={"disc": Plane((0, 0, 0), (0, 0, 1), "wall", 0.015)})  # fmt: skip
    for k in range(6):
        s.add("bent", (0.004 * k, 0.0, 0.012 + 0.012 * k))
    s.run_steps(8000)
    gone = ~s.present
    assert 0 < gone.sum() < 6
    assert not np.isin(s.contacts(), np.flatnonzero(gone)).any()
    used = int(s.counts[st.N_NEAR])
    assert not np.isin(s.pairs.near_first[:used], np.flatnonzero(gone)).any()
    good = {"spheres_m": BENT, "mass_kg": MASS, "inertia_kg_m2": BENT_INERTIA, "material": "body"}
    cases = [
        ({"spheres_m": []}, r"spheres_m is \[\]; expected \(1 to 64, 4\) finite lengths"),
        ({"spheres_m": [[0, 0, 0]]}, "spheres_m is .*expected"),
        ({"spheres_m": [[0, 0, 0, 0.0]]}, "spheres_m is .*the last of each row above 0"),
        ({"spheres_m": [[0, 0, math.nan, 1.0]]}, "spheres_m is .*expected"),
        ({"spheres_m": np.ones((65, 4))}, r"expected \(1 to 64, 4\)"),
        ({"spheres_m": "round"}, "spheres_m is 'round'"),
        ({"mass_kg": 0.0}, "mass_kg is 0.0; expected above 0"),
        ({"inertia_kg_m2": (1.0, 1.0, 3.0)}, "inertia_kg_m2 is .*each at most the sum"),
        ({"material": ""}, "material is ''; expected a name"),
    ]
    assert not not_refused(lambda changes: Clump(**{**good, **changes}), cases, ValueError)
    with pytest.raises(ValueError, match=r"shapes has 'a': Clump, 'b': Shape; expected all of them a Shape or all"):
        scene({"a": bent(), "b": Shape.sphere(RADIUS, DENSITY, "body")})
    clump = bent()
    assert clump.bounding_radius_m == pytest.approx(math.hypot(8.0, 1.5) * 1e-3 + 3e-3)
    assert clump.smallest_radius_m == pytest.approx(2.5e-3)
    assert clump.half_extents_m == pytest.approx([11e-3, 5.9e-3, 4.5e-3])
    n = np.array([1.0, 0.0, 0.0])
    assert clump.support(n) == pytest.approx(10.5e-3)
    assert clump.support_point(n) == pytest.approx([10.5e-3, -1.8e-3, 0.0])


def test_pictures_files_and_frames_of_clumps(tmp_path):
    points, normals, triangles = tessellate(bent())
    clear = np.linalg.norm(points[:, None] - BENT[None, :, :3], axis=2) - BENT[:, 3]
    assert np.abs(clear.min(axis=1)).max() < 1e-12
    assert len(triangles) == len(tessellate(ball_of_one())[2])
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    s = pouring()
    recorder = Recorder()
    s.run(0.01, progress=False, record=recorder, record_every_s=0.005)
    assert recorder.frames()["position"].shape == (3, 30, 3)
    for content in ("points", "surfaces", "walls"):
        write_vtk(tmp_path / f"{content}.vtp", s, content)
    corners, faces, body = triangulated_bodies(s)
    # the triangles of a body enclose the volumes of its spheres, a little less
    a, b, c = (corners[faces[body == 1][:, k]] - s.positions[1] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    whole = 4.0 / 3.0 * math.pi * np.sum((s.scales[1] * BENT[:, 3]) ** 3)
    assert 0.85 * whole < volume < whole
