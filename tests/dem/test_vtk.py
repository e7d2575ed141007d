"""VTK files: what is parsed back is what the simulation holds, and walls lie where they are."""

import base64
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from refusals import value_error

from repose import dem
from repose.dem import (
    Cone,
    Contact,
    Material,
    Mesh,
    Plane,
    Shape,
    Simulation,
    write_vtk,
)
from repose.dem.tessellation import triangulate_walls
from repose.report.renderer.scenery import make_scenery

NUMPY_TYPES = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4"}


def among(walls, **keywords):
    shapes = {
        "berry": Shape.ellipsoid((0.01, 0.006, 0.005), 840.0, "m"),
        "ball": Shape.sphere(0.006, 840.0, "m"),
    }
    room = {"capacity": 3, "lower": (-0.05, -0.05, 0.0), "upper": (0.05, 0.05, 0.2)}
    contacts = {("m", "m"): Contact(0.3, 0.5, 0.02)}
    return Simulation(
        shapes,
        {"m": Material(4.3e4, 0.32)},
        contacts,
        1e-4,
        walls=walls,
        **room | keywords,
    )


def scene():
    walls = {
        "tube": dem.Cylinder((0, 0, 0), (0, 0, 1), 0.1, 0.04, "m"),
        "floor": Plane((0, 0, 0.02), (0, 0, 1), "m", motion=dem.Motion((0, 0, 0.5))),
        "lid": Plane((0, 0, 0.15), (0, 0, -1), "m", radius_m=0.03),
    }
    simulation = among(walls, largest_scale=1.5, floor_height_m=-0.1)
    simulation.add(
        "berry", (0.0, 0.01, 0.1), (1, 2, 3, 4), (0.1, 0.2, 0.3), (1, 2, 3), scale=1.5
    )
    simulation.add("ball", (1.0, 1.0, -0.2))
    simulation.add("ball", (0.01, -0.02, 0.09))
    simulation.run_steps(3)
    return simulation


def arrays(path):
    root = ET.parse(path).getroot()
    assert root.get("type") == "PolyData"
    found = {"piece": root.find("PolyData/Piece").attrib}
    for element in root.iter("DataArray"):
        data = base64.b64decode(element.text)
        assert int.from_bytes(data[:8], "little") == len(data) - 8
        values = np.frombuffer(data[8:], NUMPY_TYPES[element.get("type")])
        columns = int(element.get("NumberOfComponents"))
        found[element.get("Name")] = (
            values.reshape(-1, columns) if columns > 1 else values
        )
    for element in root.iter("Array"):
        found[element.get("Name")] = (
            bytes(int(code) for code in element.text.split()).decode().split("\0")[:-1]
        )
    return found


def test_vtk_points_have_the_state_of_the_bodies(tmp_path):
    simulation = scene()
    write_vtk(tmp_path / "a.vtp", simulation)
    found = arrays(tmp_path / "a.vtp")
    present = [0, 2]
    assert found["piece"]["NumberOfVerts"] == "2"
    assert found["TimeValue"] == [simulation.time_s]
    assert found["shape_names"] == ["berry", "ball"]
    np.testing.assert_array_equal(found["id"], present)
    np.testing.assert_array_equal(found["shape"], [0, 1])
    np.testing.assert_array_equal(found["scale"], [1.5, 1.0])
    for name in ("position", "quaternion", "velocity"):
        values = getattr(simulation, {"velocity": "velocities"}.get(name, name + "s"))
        np.testing.assert_array_equal(found[name], values[present])
    expected = simulation.angular_velocities[present]
    np.testing.assert_array_equal(found["angular_velocity"], expected)
    tensor = found["tensor"][0].reshape(3, 3)
    turn = dem.rotation_matrix(simulation.quaternions[0])
    expected = np.diag([0.03, 0.018, 0.015])
    np.testing.assert_allclose(turn.T @ tensor @ turn, expected, atol=1e-12)


def test_wrong_names_of_vtk_files_are_refused(tmp_path):
    value_error(
        r"path is .*expected a file that ends in \.vtp",
        write_vtk,
        tmp_path / "a.vtk",
        None,
    )
    with pytest.raises(
        ValueError, match="content is 'bodies'; expected 'points', 'surfaces', 'walls'"
    ):
        write_vtk(tmp_path / "a.vtp", None, "bodies")
    value_error(
        r"expected a file that ends in \.pvd", dem.VtkSeries, tmp_path / "a.vtp"
    )


def test_surfaces_have_the_volume_of_the_bodies(tmp_path):
    """A surface of triangles encloses a little less than its body, by the sum of a . (b x c) / 6 over triangles."""
    write_vtk(tmp_path / "a.vtp", scene(), "surfaces")
    found = arrays(tmp_path / "a.vtp")
    faces = found["connectivity"].reshape(-1, 3)
    np.testing.assert_array_equal(found["offsets"], 3 * np.arange(1, len(faces) + 1))
    volumes = {0: 1.5**3 * 4 / 3 * np.pi * 3e-7, 2: 4 / 3 * np.pi * 0.006**3}
    for body, volume in volumes.items():
        a, b, c = found["position"][faces[found["id"] == body]].transpose(1, 0, 2)
        enclosed = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
        assert enclosed == pytest.approx(volume, rel=0.12)
        assert enclosed < volume


def test_walls_are_where_they_are_now(tmp_path):
    write_vtk(tmp_path / "a.vtp", scene(), "walls")
    found = arrays(tmp_path / "a.vtp")
    assert found["wall_names"] == ["tube", "floor", "lid"]
    faces = found["connectivity"].reshape(-1, 3)
    tube = found["position"][np.unique(faces[found["wall"] == 0])]
    floor = found["position"][np.unique(faces[found["wall"] == 1])]
    lid = found["position"][np.unique(faces[found["wall"] == 2])]
    np.testing.assert_allclose(np.hypot(tube[:, 0], tube[:, 1]), 0.04)
    np.testing.assert_allclose(floor[:, 2], 0.02 + 3e-4 * 0.5)
    np.testing.assert_allclose(np.abs(floor[:, :2]), 0.05, atol=1e-12)
    np.testing.assert_allclose(np.hypot(lid[:, 0], lid[:, 1]), 0.03)


def normals_of(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def test_planes_end_at_each_other_and_walls_face_the_bodies():
    edge = dem.RingEdge(
        0.02, 0.002, "m", ((0.0, 1.0), (0.0, 0.0)), origin_m=(0, 0, 0.05)
    )
    walls = {
        "slope": Plane((0, 0, 0), (1, 0, 1), "m"),
        "floor": Plane((0, 0, 0), (0, 0, 1), "m"),
        "cone": Cone.between((0, 0, 0.05), (0, 0, 1), 0.1, 0.01, 0.03, "m"),
        "edge": edge,
    }
    found = triangulate_walls(
        among(walls, lower=(-0.1, -0.05, 0.0), upper=(0.1, 0.05, 0.2))
    )
    points, triangles = found["floor"]
    assert points[:, 0].min() == pytest.approx(0.0, abs=1e-12)
    assert found["slope"][0][:, 0].max() == pytest.approx(0.0, abs=1e-12)
    normals = normals_of(points, triangles)
    assert normals[0, 2] > 0
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(0.1 * 0.1)
    points, triangles = found["cone"]
    middle = points[triangles].mean(axis=1)
    assert (
        np.sum(normals_of(points, triangles)[:, :2] * middle[:, :2], axis=1) < 0
    ).all()
    # only the half of the edge that faces down is open to bodies
    points, triangles = found["edge"]
    np.testing.assert_allclose(
        np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.02, points[:, 2] - 0.05),
        0.002,
    )
    assert points[:, 2].min() == pytest.approx(0.048)
    assert points[:, 2].max() == pytest.approx(0.05, abs=1e-12)
    assert (normals_of(points, triangles)[:, 2] <= 1e-15).all()


def test_a_series_has_the_times_and_writes_walls_at_rest_once(tmp_path):
    simulation = scene()
    series = dem.VtkSeries(tmp_path / "run.pvd")
    frames = dem.Recorder()
    simulation.run(0.002, progress=False, record=[series, frames], record_every_s=0.001)
    simulation.set_motion("floor", dem.Motion())
    simulation.run(0.002, progress=False, record=series, record_every_s=0.001)
    root = ET.parse(tmp_path / "run.pvd").getroot()
    sets = [s.attrib for s in root.iter("DataSet")]
    times = [float(s["timestep"]) for s in sets if s["part"] == "0"]
    np.testing.assert_allclose(np.diff(times), 0.001, atol=1e-4)
    assert all((tmp_path / s["file"]).is_file() for s in sets)
    walls = [s["file"] for s in sets if s["part"] == "1"]
    assert walls[-1] == walls[-2] != walls[0]
    kept = frames.frames()
    assert kept["position"].shape == (2, 3, 3)
    assert np.isnan(kept["position"][:, 1]).all()
    series(simulation)
    value_error("expected a time after the last one", series, simulation)


def test_a_mesh_is_written_and_drawn_where_its_motion_has_brought_it(tmp_path):
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]], float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    simulation = among(
        {"wedge": Mesh(corners, faces, "m", motion=dem.Motion((1.0, 0.0, 0.0)))}
    )
    simulation.add("ball", (0.0, 0.0, 0.4))
    simulation.run_steps(100)
    shift = np.array([0.01, 0.0, 0.0])
    points, triangles = triangulate_walls(simulation)["wedge"]
    assert np.allclose(points, corners + shift)
    assert np.array_equal(triangles, faces)
    panels = make_scenery(simulation).panels
    assert np.allclose(panels[3].corners_m, corners[faces[3]] + shift)
    assert panels[3].normal @ np.ones(3) > 1.7
