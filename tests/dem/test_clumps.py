"""Clumps of spheres: contacts are those of all pairs of spheres, nothing is created."""

import itertools
import math

import numpy as np
import pytest
from dem.clump_scenes import (
    BENT,
    BENT_INERTIA,
    FUNNEL,
    MASS,
    RADIUS,
    ball_of_one,
    bent,
    scene,
)
from dem.common import DENSITY, FLOOR
from dem.test_checkpoint import falling
from oracles import rotation
from refusals import not_refused

from repose.bench.funnel import Funnel
from repose.dem import (
    Clump,
    Contact,
    Plane,
    Recorder,
    Shape,
    random_quaternion,
    write_vtk,
)
from repose.dem.kernels import state as st
from repose.dem.tessellation import tessellate, triangulate_bodies

TUBED = Funnel(0.15, 0.032, 60.0, 0.02, 0.001, 0.1)


def all_spheres(s):
    """Centres (N, 3) and radii (N,) of all spheres in the world, their bodies and numbers."""
    shapes = list(s.shapes.values())
    centres = []
    radii = []
    bodies = []
    numbers = []
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
    gaps = (
        np.linalg.norm(centres[:, None] - centres[None], axis=2)
        - radii[:, None]
        - radii[None]
    )
    near = np.argwhere((gaps < 2e-3) & (bodies[:, None] < bodies[None]))
    return {(bodies[p], bodies[q], numbers[p], numbers[q]): gaps[p, q] for p, q in near}


def fast_contacts(s):
    bodies, spheres, _normals = s.sphere_contacts()
    found = [(*pair, *numbers) for pair, numbers in zip(bodies, spheres, strict=True)]
    assert len(set(found)) == len(found)
    return set(found)


def cloud(capacity=40, seed=2, **keywords):
    """Clumps of two kinds in a box of 80 mm, which fly towards its centre and turn."""
    outward = [side * axis for axis in np.eye(3) for side in (-1, 1)]
    walls = {str(k): Plane(0.04 * n, -n, "wall") for k, n in enumerate(outward)}
    two_spheres = BENT[1:3].copy()
    two_spheres[:, :3] -= two_spheres[:, :3].mean(axis=0)
    pair = Clump(two_spheres, MASS, BENT_INERTIA, "body")
    s = scene(
        {"bent": bent(), "pair": pair},
        walls=walls,
        dt=5e-5,
        capacity=capacity,
        largest_scale=1.1,
        **keywords,
    )
    rng = np.random.default_rng(seed)
    places = itertools.product(
        (-0.03, -0.01, 0.01, 0.03), (-0.026, 0.0, 0.026), (-0.03, -0.01, 0.01, 0.03)
    )
    for k, place in enumerate(itertools.islice(places, capacity)):
        place = np.array(place)
        s.add(
            ("bent", "pair")[k % 2],
            place,
            random_quaternion(rng),
            -20.0 * place + 0.3 * rng.normal(size=3),
            30.0 * rng.normal(size=3),
            scale=rng.uniform(0.9, 1.1),
        )
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


def test_entries_are_used_again():
    s = cloud()
    s.run_steps(1500)
    holes = int(s.counts[st.N_FREE])
    used = int(s.counts[st.N_NEAR])
    listed = s.pairs.near_first[:used] < s.capacity
    assert listed.sum() == used - holes
    pairs = np.column_stack([s.pairs.near_first[:used], s.pairs.near_second[:used]])[
        listed
    ]
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    assert s.pairs.n_contacts[:used].sum() == s.counts[st.N_PAIRS]
    expected = s.counts[st.N_PAIRS]
    assert np.unpackbits(s.pairs.touching_bits[:used].view(np.uint8)).sum() == expected


@pytest.mark.parametrize("scale", [1.0, 1.3])
def test_a_clump_at_rest_on_a_plate_weighs_what_it_weighs(scale):
    contact = Contact(0.2, 0.5, 0.02)
    s = scene(
        {"bent": bent()},
        contact,
        {"floor": FLOOR},
        5e-5,
        gravity=(0, 0, -9.81),
        largest_scale=1.3,
    )
    s.add("bent", (0.0, 0.0, 0.012), (1.0, 0.3, 0.1, 0.0), scale=scale)
    s.run_steps(30000)
    assert s.kinetic_energies()[0] < 1e-15
    centres, radii, *_ = all_spheres(s)
    overlaps = np.maximum(radii - centres[:, 2], 0.0)
    stiffness = s.physics.law_constants[0, 1, 0]
    assert 2 <= np.sum(overlaps > 0.0) == s.counts[st.N_PLANE]
    assert np.sum(stiffness * np.sqrt(radii) * overlaps**1.5) == pytest.approx(
        MASS * scale**3 * 9.81, rel=1e-6
    )


def test_clumps_pass_a_funnel():
    walls = {**FUNNEL.walls("wall"), "floor": FLOOR}
    s = scene(
        {"bent": bent()},
        Contact(0.2, 0.6, 0.05),
        walls,
        5e-5,
        gravity=(0, 0, -9.81),
        capacity=40,
        upper=(0.1, 0.1, 0.4),
        curved_walls_above_m=FUNNEL.outlet_height_m - 0.001,
    )
    rng = np.random.default_rng(5)
    touched = set()
    for k in range(40):
        s.add(
            "bent",
            (*rng.uniform(-0.02, 0.02, 2), 0.17 + 0.005 * k),
            random_quaternion(rng),
        )
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
    assert np.allclose(
        np.arctan2(normal[on_cone, 1], normal[on_cone, 0]), azimuth[on_cone], atol=0.01
    )


def test_clumps_below_the_floor_are_gone():
    s = scene(
        {"bent": bent()},
        gravity=(0, 0, -9.81),
        dt=5e-5,
        capacity=6,
        floor_height_m=-0.02,
        walls={"disc": Plane((0, 0, 0), (0, 0, 1), "wall", 0.015)},
    )
    for k in range(6):
        s.add("bent", (0.004 * k, 0.0, 0.012 + 0.012 * k))
    s.run_steps(8000)
    gone = np.flatnonzero(~s.present)
    assert 0 < len(gone) < 6
    assert not np.isin(s.contacts(), gone).any()
    near = s.pairs.near_first[: int(s.counts[st.N_NEAR])]
    assert not np.isin(near, gone).any()


def test_wrong_clumps_are_refused():
    good = {
        "spheres_m": BENT,
        "mass_kg": MASS,
        "inertia_kg_m2": BENT_INERTIA,
        "material": "body",
    }
    cases = [
        (
            {"spheres_m": []},
            r"spheres_m is \[\]; expected \(1 to 64, 4\) finite lengths",
        ),
        ({"spheres_m": [[0, 0, 0]]}, "spheres_m is .*expected"),
        (
            {"spheres_m": [[0, 0, 0, 0.0]]},
            "spheres_m is .*the last of each row above 0",
        ),
        ({"spheres_m": [[0, 0, math.nan, 1.0]]}, "spheres_m is .*expected"),
        ({"spheres_m": np.ones((65, 4))}, r"expected \(1 to 64, 4\)"),
        ({"spheres_m": "round"}, "spheres_m is 'round'"),
        ({"mass_kg": 0.0}, "mass_kg is 0.0; expected above 0"),
        ({"inertia_kg_m2": (1.0, 1.0, 3.0)}, "inertia_kg_m2 is .*each at most the sum"),
        ({"material": ""}, "material is ''; expected a name"),
    ]
    assert not not_refused(
        lambda changes: Clump(**{**good, **changes}), cases, ValueError
    )
    with pytest.raises(
        ValueError,
        match=r"shapes has 'a': Clump, 'b': Shape; expected only Shapes or only Clumps",
    ):
        scene({"a": bent(), "b": Shape.sphere(RADIUS, DENSITY, "body")})


def test_a_clump_has_the_extents_of_its_spheres():
    clump = bent()
    assert clump.bounding_radius_m == pytest.approx(math.hypot(8.0, 1.5) * 1e-3 + 3e-3)
    assert clump.smallest_radius_m == pytest.approx(2.5e-3)
    assert clump.half_extents_m == pytest.approx([11e-3, 5.9e-3, 4.5e-3])
    n = np.array([1.0, 0.0, 0.0])
    assert clump.support(n) == pytest.approx(10.5e-3)
    assert clump.support_point(n) == pytest.approx([10.5e-3, -1.8e-3, 0.0])


def test_the_surface_of_a_clump_is_that_of_its_spheres():
    points, normals, triangles = tessellate(bent())
    clear = np.linalg.norm(points[:, None] - BENT[None, :, :3], axis=2) - BENT[:, 3]
    assert np.abs(clear.min(axis=1)).max() < 1e-12
    assert len(triangles) == len(tessellate(ball_of_one())[2])
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)


def test_files_and_frames_of_clumps(tmp_path):
    s = falling("clumps")
    recorder = Recorder()
    s.run(0.01, progress=False, record=recorder, record_every_s=0.005)
    assert recorder.frames()["position"].shape == (3, 30, 3)
    for content in ("points", "surfaces", "walls"):
        write_vtk(tmp_path / f"{content}.vtp", s, content)
    corners, faces, body = triangulate_bodies(s)
    # the triangles of a body enclose the volumes of its spheres, a little less
    a = corners[faces[body == 1][:, 0]] - s.positions[1]
    b = corners[faces[body == 1][:, 1]] - s.positions[1]
    c = corners[faces[body == 1][:, 2]] - s.positions[1]
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    whole = 4.0 / 3.0 * math.pi * np.sum((s.scales[1] * BENT[:, 3]) ** 3)
    assert 0.85 * whole < volume < whole
