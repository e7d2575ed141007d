"""Overlaps with walls: beside points on the surfaces of bodies, of which some lie beyond the wall."""

import numpy as np
import pytest
from dem.clump_scenes import BENT, bent, scene
from dem.common import BARREL, simulation

from repose.dem import Cone, Cylinder, Mesh, Motion, Plane, RingEdge, random_quaternion
from repose.dem.rotations import rotation_matrices

TILT = np.array([0.3, -0.5, 1.0]) / np.linalg.norm([0.3, -0.5, 1.0])
SLOPE = Cone.between((0.01, 0.0, 0.02), TILT, 0.05, 0.016, 0.05, "wall")
SHELL = Cylinder((-0.05, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1, 0.05, "wall")
SHEET = Plane((0.0, 0.0, 0.02), TILT, "wall")
EDGE = RingEdge(0.03, 0.002, "wall", origin_m=(0.0, 0.0, 0.02), axis=TILT)


def beyond_plane(points):
    """How far points lie behind SHEET."""
    return (SHEET.point_m - points) @ TILT


def beyond_shell(points):
    """How far points lie outside of SHELL."""
    return np.hypot(points[:, 1], points[:, 2]) - 0.05


def beyond_slope(points):
    """How far points lie outside of SLOPE, at right angles to it."""
    from_foot = points - np.array([0.01, 0.0, 0.02])
    along = from_foot @ TILT
    across = np.linalg.norm(from_foot - along[:, None] * TILT, axis=1)
    widens = (0.05 - 0.016) / 0.05
    return (across - 0.016 - widens * along) / np.hypot(1.0, widens)


def within_edge(points):
    """How far points lie inside of EDGE."""
    from_middle = points - np.array([0.0, 0.0, 0.02])
    along = from_middle @ TILT
    across = np.linalg.norm(from_middle - along[:, None] * TILT, axis=1)
    return 0.002 - np.hypot(across - 0.03, along)


SIDE = np.cross(TILT, [0.0, 1.0, 0.0]) / np.linalg.norm(np.cross(TILT, [0.0, 1.0, 0.0]))
# the wall, how far points are beyond it, a point of it, and the direction into it there
WALLS = {
    "plane": (SHEET, beyond_plane, np.array(SHEET.point_m), -TILT),
    "shell": (SHELL, beyond_shell, np.array([0.0, 0.03, -0.04]), np.array([0.0, 0.6, -0.8])),
    "slope": (SLOPE, beyond_slope, np.array([0.01, 0.0, 0.02]) + 0.025 * TILT + 0.033 * SIDE, SIDE),
    "edge": (EDGE, within_edge, np.array([0.0, 0.0, 0.02]) + 0.03 * SIDE, SIDE),
}
DEEP_M, SCALE, BALL_M = 5e-4, 1.2, 6e-3


def farthest(kind, turn, beyond, place):
    """How far the farthest point of a body's surface is beyond a wall: ever closer about the best direction."""
    rng = np.random.default_rng(0)
    best, width = np.zeros(3), 1.0
    while width > 1e-5:
        normals = best + width * rng.normal(size=(300, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        if kind == "clump":
            points = (BENT[:, None, :3] + BENT[:, None, 3:] * normals).reshape(-1, 3)
        elif kind == "sphere":
            points = BALL_M * normals
        else:
            points = sum(axes**2 * normals / np.linalg.norm(axes * normals, axis=1)[:, None] for axes in BARREL)
        depths = beyond(place + SCALE * points @ turn.T)
        best, width = normals[depths.argmax() % len(normals)], 0.5 * width
    return depths.max()


@pytest.mark.parametrize("kind", ["smooth", "sphere", "clump"])
@pytest.mark.parametrize("name", WALLS)
def test_the_deepest_overlap_is_that_of_the_farthest_point(name, kind):
    wall, beyond, place, into = WALLS[name]
    far = Plane((0.0, 0.0, -9.0), (0.0, 0.0, 1.0), "wall")  # the numbers of curved walls begin after it
    options = {"walls": {name: wall} if name == "plane" else {"far": far, name: wall}, "dt": 1e-9}
    rng = np.random.default_rng(1)
    for _ in range(4):
        turned = random_quaternion(rng)
        turn, here = rotation_matrices(turned[None])[0], place - 0.008 * into
        while abs((depth := farthest(kind, turn, beyond, here)) - DEEP_M) > 0.2 * DEEP_M:
            here = here + (DEEP_M - depth) * into
        if kind == "clump":
            s = scene({"body": bent()}, largest_scale=SCALE, **options)
            s.add("body", here, turned, scale=SCALE)
        else:
            s = simulation([[BALL_M] * 3] if kind == "sphere" else BARREL, largest_scale=SCALE, **options)
            s.add(here, turned, scale=SCALE)
        s.run_steps(1)
        bodies, walls, overlaps = s.wall_overlaps()
        assert set(bodies) == {0}
        assert {s.wall_set.names[number] for number in walls} == {name}
        assert overlaps.max() == pytest.approx(depth, abs=1e-8)


def test_overlaps_with_a_mesh_and_with_a_moving_plane():
    """A ball lies 1 mm deep in a tetrahedron's face, and 2 mm deep in a plane that rises by 0.1 mm in a step."""
    radius = 0.006
    corners = [[-0.1, -0.1, 0.0], [0.2, -0.1, 0.0], [-0.1, 0.2, 0.0], [0.0, 0.0, -0.1]]
    walls = {
        "rising": Plane((0.0, 0.0, 0.0009), (0.0, 0.0, 1.0), "wall", motion=Motion((0.0, 0.0, 100.0))),
        "solid": Mesh(corners, [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], "wall"),
    }
    s = simulation([[radius] * 3], walls=walls, dt=1e-6)
    s.add((0.0, 0.0, radius - 1e-3))
    s.run_steps(1)
    bodies, numbers, overlaps = s.wall_overlaps()
    assert bodies.tolist() == [0, 0]
    assert [s.wall_set.names[number] for number in numbers] == ["rising", "solid"]
    assert overlaps == pytest.approx([2e-3, 1e-3], abs=1e-6)
