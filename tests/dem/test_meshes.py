import math

import numpy as np
import pytest
import trimesh
from dem.common import DOWN, FLOOR, mesh_of, random_direction, simulation
from oracles import mesh_distance, rotation
from refusals import not_refused

from repose.dem import Contact, Mesh, Motion, random_quaternion
from repose.dem.kernels.features import EDGE, FACE, VERTEX

LONG = np.array([[10.57e-3, 5.685e-3, 4.94e-3]])
RADIUS = 5e-4


def box(*sides, radius=RADIUS, **keywords):
    return mesh_of(trimesh.creation.box(sides), radius, **keywords)


def sheet(cells, size, slope=0.0, seed=None):
    """Vertices and faces of a square sheet, its normal up; with a seed its inner vertices are strewn in the plane."""
    places = np.linspace(-0.5 * size, 0.5 * size, cells + 1)
    x, y = np.meshgrid(places, places, indexing="ij")
    x = x.ravel()
    y = y.ravel()
    if seed is not None:
        inner = (np.abs(x) < 0.49 * size) & (np.abs(y) < 0.49 * size)
        shift_x = np.random.default_rng(seed).uniform(-0.3, 0.3, len(x))
        shift_y = np.random.default_rng(seed + 1).uniform(-0.3, 0.3, len(y))
        x = x + inner * shift_x * size / cells
        y = y + inner * shift_y * size / cells
    # each cell has the corners a, a + 1 in one row of vertices and b, b + 1 in the next
    row, column = np.divmod(np.arange(cells**2), cells)
    a = row * (cells + 1) + column
    b = a + cells + 1
    lower = np.column_stack([a, b, b + 1])
    upper = np.column_stack([a, b + 1, a + 1])
    faces = np.vstack([lower, upper])
    return np.column_stack([x, y, slope * x]), faces


def counts(mesh):
    return np.bincount(mesh.part.kind, minlength=3).tolist()


def l_shape(inset=0.0):
    """An L of 40 mm and 30 mm height; inset: how deep its faces lie below those of the whole [m]."""
    x0 = inset
    x1 = 0.02 - inset
    x2 = 0.04 - inset
    outline = np.array(
        [[x0, x0], [x2, x0], [x2, x1], [x1, x1], [x1, x2], [x0, x2], [x0, x1]]
    )
    triangles = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 6], [6, 3, 4], [6, 4, 5]])
    solid = trimesh.creation.extrude_triangulation(
        outline, triangles, height=0.03 - 2.0 * inset
    )
    return solid.apply_translation((0.0, 0.0, inset))


def cube(inset=0.0):
    return trimesh.creation.box((0.03 - 2.0 * inset,) * 3)


def test_features_are_faces_convex_edges_and_corners_tangent_to_the_faces():
    assert counts(box(0.02, 0.02, 0.02)) == [12, 12, 8]
    # the same however finely it is cut, but for the pieces of its edges
    assert counts(
        mesh_of(
            trimesh.creation.box((0.02, 0.02, 0.02)).subdivide().subdivide(), RADIUS
        )
    ) == [192, 48, 8]
    # 6 upright edges less the concave one, less that in the middle of a side; 2 x 7 around top and bottom
    assert counts(mesh_of(l_shape(), RADIUS)) == [len(l_shape().faces), 5 + 14, 10]
    cells = 7
    vertices, faces = sheet(cells, 0.2, slope=0.3, seed=5)
    mesh = Mesh(vertices, faces, "wall", RADIUS)
    # edges of the border and its four corners
    expected = [
        2 * cells * cells,
        4 * cells,
        4,
    ]
    assert counts(mesh) == expected
    normals = mesh.part.data[mesh.part.kind == FACE, :4]
    assert np.all(normals == normals[0])
    part = box(0.02, 0.02, 0.02).part
    edges = part.data[part.kind == EDGE]
    corners = part.data[part.kind == VERTEX]
    assert np.allclose(np.abs(corners[:, :3]), 0.01 - RADIUS, atol=1e-12)
    assert np.allclose(edges[:, 6], 0.02 - 2.0 * RADIUS, atol=1e-12)
    assert np.allclose(edges[:, 13], 0.5 * math.pi)
    # a face stays where it was: n.x = offset with the normal into the wall
    assert np.allclose(part.data[part.kind == FACE, 3], -0.01, atol=1e-12)


def place_near(rng, solid, q):
    """A random place about a solid where a body of this orientation nearly touches it."""
    samples = trimesh.sample.sample_surface(solid, 1500, seed=rng.integers(1 << 31))[0]
    middle = solid.bounds.mean(axis=0)
    half = 0.5 * np.ptp(solid.bounds, axis=0)
    target = middle + half * rng.choice([-1.0, -1.0, -1.0, 0.3, 1.0, 1.0, 1.0], 3)
    direction = random_direction(rng)
    for out in np.linspace(0.06, 0.0, 150):
        place = target + out * direction
        if np.any(
            np.linalg.norm((samples - place) @ rotation(q) / LONG[0], axis=1) < 1.0
        ):
            return place + rng.uniform(-5e-4, 5e-4) * direction
    return target + 0.08 * direction


@pytest.mark.slow
@pytest.mark.parametrize("solid", [cube, l_shape])
def test_gaps_and_normals_are_those_of_a_dense_search(solid):
    """The wall is what lies within the edge radius of the solid with its faces that much deeper."""
    rng = np.random.default_rng(21)
    mesh = mesh_of(solid(), RADIUS)
    inner = solid(RADIUS)
    met = np.zeros(3, int)
    missed = 0
    for _ in range(150):
        q = random_quaternion(rng)
        place = place_near(rng, solid(), q)
        distance, n = mesh_distance(
            LONG, place, q, np.array(inner.vertices), inner.faces, 1e-3
        )
        if distance == 0.0 or abs(distance - RADIUS) < 1e-7:
            continue
        s = simulation(LONG, walls={"mesh": mesh}, dt=1e-5)
        s.add(place, q)
        s.run_steps(1)
        _, _, feature, normal, overlap = s.mesh_contacts()
        assert (len(feature) > 0) == (distance < RADIUS)
        missed += not len(feature)
        if len(feature):
            k = overlap.argmax()
            met[mesh.part.kind[feature[k]]] += 1
            assert overlap[k] == pytest.approx(RADIUS - distance, abs=2e-9)
            assert np.linalg.norm(normal[k] - n) < 2e-4
    assert min(missed, met[FACE], met[EDGE]) > 15
    assert met[VERTEX] > 2


def test_a_plane_of_faces_moves_a_berry_as_a_smooth_one():
    vertices, faces = sheet(40, 0.3, seed=3)
    tracks = []
    for floor in (FLOOR, Mesh(vertices, faces, "wall", RADIUS)):
        s = simulation(
            LONG,
            Contact(0.3, 0.4, 0.05),
            walls={"floor": floor},
            gravity_m_s2=DOWN,
            dt=1e-4,
        )
        s.add(
            (-0.05, 0.02, 0.008),
            (0.9, 0.3, 0.2, 0.1),
            (0.5, -0.1, 0.0),
            (3.0, 20.0, 10.0),
        )
        track = []
        for _ in range(50):
            s.run_steps(100)
            track.append(
                np.concatenate([s.positions[0], s.quaternions[0], s.velocities[0]])
            )
        tracks.append(np.array(track))
    # it crosses many triangles, with its tangential spring
    assert np.ptp(tracks[0][:, 0]) > 0.03
    assert np.abs(tracks[1] - tracks[0]).max() < 1e-9


def test_a_bowl_of_faces_holds_a_berry():
    solid = trimesh.creation.icosphere(subdivisions=3, radius=0.06)
    solid.invert()
    bowl = mesh_of(solid, RADIUS)
    rng = np.random.default_rng(51)
    for _ in range(10):
        s = simulation(
            LONG,
            Contact(0.3, 0.4, 0.0),
            walls={"bowl": bowl},
            dt=5e-5,
            capacity=1,
            gravity_m_s2=DOWN,
        )
        s.add((0.0, 0.0, 0.0), random_quaternion(rng), 0.5 * rng.normal(size=3))
        weight = s.mass_kg * 9.81
        first = s.kinetic_energies()[0] + 0.06 * weight
        for _ in range(100):
            s.run_steps(100)
            assert len(s.mesh_contacts()[0]) <= 1
            assert s.kinetic_energies()[0] + weight * (s.positions[0, 2] + 0.06) < first
        assert np.linalg.norm(s.positions[0]) < 0.06


@pytest.mark.slow
def test_random_hits_of_a_cube_create_no_energy():
    rng = np.random.default_rng(31)
    mesh = box(0.03, 0.03, 0.03)
    hits = 0
    worst = 0.0
    met = np.zeros(3, int)
    for n in range(1500):
        contact = Contact(rng.uniform(0.2, 0.5), rng.uniform(0.1, 0.8), 0.0)
        s = simulation(LONG, contact, walls={"cube": mesh}, dt=5e-5, capacity=1)
        target = rng.uniform(-0.015, 0.015, 3)
        target[: n % 4] = rng.choice([-0.015, 0.015], n % 4)
        rng.shuffle(target)
        direction = random_direction(rng)
        speed = rng.uniform(0.2, 1.5)
        place = target + 0.04 * direction
        if np.abs(place).max() < 0.015 + 0.0125:
            continue
        s.add(
            place, random_quaternion(rng), -speed * direction, 30.0 * rng.normal(size=3)
        )
        energy = s.kinetic_energies()[0]
        for _ in range(20):
            s.run_steps(int(0.08 / speed / 5e-5 / 20))
            worst = max(worst, s.kinetic_energies()[0] / energy)
            met += np.bincount(mesh.part.kind[s.mesh_contacts()[2]], minlength=3)
        hits += s.kinetic_energies()[0] < 0.98 * energy
    assert hits > 700
    assert met.min() > 50
    assert worst < 1.0 + 1e-5


@pytest.mark.parametrize("end", [(0.04, 0.0), (0.03, 0.03)], ids=["edge", "corner"])
def test_overlap_and_force_pass_continuously_from_face_to_edge_and_corner(end):
    s = simulation(
        LONG, Contact(1.0, 0.0, 0.0), walls={"cube": box(0.06, 0.06, 0.06)}, dt=1e-6
    )
    s.add((0.0, 0.0, 0.0), (0.9, 0.3, 0.2, 0.1))
    forces = []
    overlaps = []
    for share in np.linspace(0.0, 1.0, 8001):
        s.positions[0] = (share * end[0], share * end[1], 0.0360)
        s.velocities[:] = 0.0
        s.meshed.limit[:] = -1.0
        s.run_steps(1)
        overlap = s.mesh_contacts()[4]
        assert len(overlap) <= 1
        overlaps.append(overlap.sum())
        forces.append(np.linalg.norm(s.velocities[0]))
    forces = np.array(forces)
    overlaps = np.array(overlaps)
    assert forces[0] > 0.0
    assert forces[-1] == 0.0
    assert np.abs(np.diff(overlaps)).max() < 1e-5
    assert np.abs(np.diff(forces)).max() < 0.025 * forces.max()


def test_a_box_of_inward_faces_holds_its_berries():
    solid = trimesh.creation.box((0.08, 0.08, 0.2)).subdivide().subdivide()
    solid.invert()
    rng = np.random.default_rng(41)
    s = simulation(
        LONG,
        Contact(0.3, 0.5, 0.1),
        walls={"box": mesh_of(solid, RADIUS)},
        gravity_m_s2=DOWN,
        dt=2e-4,
        capacity=50,
        floor_height_m=-0.12,
    )
    places = np.array([-0.026, 0.0, 0.026])
    for k in range(50):
        s.add(
            (places[k % 3], places[k // 3 % 3], -0.085 + 0.028 * (k // 9)),
            random_quaternion(rng),
        )
    s.run_steps(8000)
    assert s.present.all()
    assert np.abs(s.positions[:, :2]).max() < 0.04
    assert s.positions[:, 2].min() > -0.1
    assert s.kinetic_energies().max() < 1e-7
    weight = 50 * s.mass_kg * 9.81
    assert s.kinetic_energies().sum() < 1e-6 * weight


def test_a_moving_plate_pushes_a_berry():
    plate = box(0.01, 0.05, 0.05, motion=Motion(velocity_m_s=(0.2, 0.0, 0.0)))
    s = simulation(
        LONG, Contact(0.3, 0.5, 0.0), walls={"plate": plate}, dt=2e-5, capacity=1
    )
    s.add((0.02, 0.0, 0.0), (1, 0, 0, 0))
    s.run_steps(1000)
    assert s.velocities[0, 0] == 0.0
    s.run_steps(3000)
    # hit once, head-on: it leaves the plate with the restitution asked for
    assert s.velocities[0, 0] == pytest.approx(0.2 * 1.3, rel=0.01)
    s.physics.gravity[0] = -1.0  # against a headwind it stays on the plate
    s.run_steps(60000)
    assert s.velocities[0, 0] == pytest.approx(0.2, rel=1e-6)
    expected = 0.005 + 0.2 * s.time_s + LONG[0, 0]
    assert s.positions[0, 0] == pytest.approx(expected, abs=1e-4)


def test_a_turntable_carries_a_berry():
    vertices, faces = sheet(16, 0.16, seed=8)
    rate = 1.5
    table = Mesh(
        vertices, faces, "wall", RADIUS, Motion(angular_velocity_rad_s=(0.0, 0.0, rate))
    )
    s = simulation(
        LONG,
        Contact(0.3, 0.8, 0.0),
        walls={"table": table},
        dt=1e-4,
        capacity=1,
        gravity_m_s2=DOWN,
    )
    q = (math.cos(0.25 * math.pi), 0.0, 0.0, math.sin(0.25 * math.pi))
    s.add((0.0, 0.03, 0.00487), q, (-0.03 * rate, 0.0, 0.0), (0.0, 0.0, rate))
    s.run_steps(10000)
    x, y, _ = s.positions[0]
    angle = rate * s.time_s
    assert math.hypot(x, y) == pytest.approx(0.03, rel=0.1)
    expected = angle % (2.0 * math.pi)
    assert math.atan2(-x, y) % (2.0 * math.pi) == pytest.approx(expected, abs=0.1)


def test_a_mesh_from_a_file_is_the_mesh(tmp_path):
    path = tmp_path / "cube.stl"
    trimesh.creation.box((20.0, 20.0, 20.0)).export(path)
    mesh = Mesh.from_stl(path, "wall", scale=1e-3, edge_radius_m=RADIUS)
    assert counts(mesh) == [12, 12, 8]
    assert np.ptp(mesh.vertices_m, axis=0) == pytest.approx([0.02, 0.02, 0.02])


def test_a_mesh_that_makes_no_sense_is_refused(tmp_path):
    vertices, faces = sheet(2, 0.1)
    no = tmp_path / "no.stl"
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "cube.stl")
    cases = [
        (
            lambda: Mesh(vertices[:, :2], faces, "wall"),
            r"vertices_m is (?s:.*)expected \(V, 3\) finite",
        ),
        (
            lambda: Mesh(vertices, np.vstack([faces, [[0, 1, 9]]]), "wall"),
            "faces has 0 to 9; expected 0 to 8",
        ),
        (
            lambda: Mesh(vertices, faces.astype(float), "wall"),
            r"faces is (?s:.*)\(F, 3\) whole numbers",
        ),
        (
            lambda: Mesh(vertices, faces, "wall", 0.0),
            r"edge_radius_m is 0\.0; expected above 0",
        ),
        (
            lambda: box(0.02, 0.02, 0.02, radius=0.02),
            r"edge_radius_m is 0\.02; expected below 0\.00999",
        ),
        (lambda: Mesh(vertices, [[0, 1, 2]], "wall"), "a triangle without area"),
        (
            lambda: Mesh(vertices, np.vstack([faces, [[0, 4, 2]]]), "wall"),
            r"one side of edge \[0, 4\]",
        ),
        (lambda: Mesh.from_stl(no, "wall", scale=0), "scale is 0; expected above 0"),
        (
            lambda: Mesh.from_stl(no, "wall"),
            r"no\.stl: file is .*expected a mesh that trimesh can read",
        ),
        (
            lambda: Mesh.from_stl(tmp_path / "cube.stl", "wall", edge_radius_m=2.0),
            r"cube\.stl: edge_radius_m is",
        ),
    ]
    assert not not_refused(lambda make: make(), cases, ValueError)
