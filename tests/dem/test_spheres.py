"""A sphere, the same as a smooth body and as a clump of one: three ways through the engine, one result."""

import numpy as np
import pytest
import trimesh
from dem.clump_scenes import CONE, RADIUS, ball_of_one, scene
from dem.common import DENSITY, DOWN, FLOOR, mesh_of
from verification.simulations import smooth

from repose.dem import Contact, Cylinder, Motion, Plane, RingEdge, Shape
from repose.dem.kernels import state as st
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
from repose.dem.shapes import count_ellipsoids


def three(**keywords):
    """The same scene of a sphere, of a smooth body that is the sum of two half as large, and of a clump of one."""
    shapes = (
        Shape.sphere(RADIUS, DENSITY, "body"),
        smooth(RADIUS, DENSITY, "body"),
        ball_of_one(),
    )
    scenes = [scene({"body": shape}, **keywords) for shape in shapes]
    assert [s.physics.parts for s in scenes] == [st.SPHERES, 2, 0]
    return scenes


def compare(scenes, steps, rounds, tolerance=1e-9):
    for _ in range(rounds):
        start = scenes[0].positions.copy()
        for s in scenes:
            s.run_steps(steps)
        for name in ("positions", "velocities", "angular_velocities"):
            a, *others = (getattr(s, name) for s in scenes)
            size = np.abs(a - start if name == "positions" else a).max()
            for b in others:
                assert np.abs(a - b).max() <= tolerance * size, name


def test_a_sphere_falls_and_rests():
    scenes = three(walls={"floor": FLOOR}, gravity=DOWN, dt=2e-5)
    for s in scenes:
        s.add(
            "body",
            (0.0, 0.0, 0.02),
            velocity_m_s=(0.3, 0.0, -0.5),
            angular_velocity_rad_s=(5.0, 20.0, 3.0),
        )
    compare(scenes, 500, 20)


def test_spheres_hit_each_other():
    scenes = three(dt=1e-6)
    for s in scenes:
        s.add(
            "body",
            (-0.0061, 0.0, 0.0),
            velocity_m_s=(0.5, 0.1, 0.0),
            angular_velocity_rad_s=(3.0, -9.0, 20.0),
        )
        s.add("body", (0.0061, 0.003, 0.001), velocity_m_s=(-0.5, 0.0, 0.2))
    compare(scenes, 1000, 20)
    assert np.abs(scenes[0].angular_velocities[1]).max() > 1.0


def test_a_resting_sphere_turns_again_when_pushed():
    scenes = three(
        walls={"floor": FLOOR}, gravity=DOWN, dt=2e-5, contact=Contact(0.1, 0.5, 0.2)
    )
    for s in scenes:
        s.add("body", (0.0, 0.0, RADIUS))
        s.run_steps(30_000)
        assert s.bodies.resting[0] == 1
        s.add("body", (-0.02, 0.001, RADIUS), velocity_m_s=(1.0, 0.0, 0.0))
    compare(scenes, 200, 20, 1e-5)
    assert (
        np.abs(scenes[0].angular_velocities[0]).max() > 0.0
        or scenes[0].positions[0, 0] > 1e-3
    )


WALLS = {
    "disc": {"floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", 0.03)},
    "cone": {"cone": CONE, "floor": FLOOR},
    "tilted tube": {
        "tube": Cylinder((0.0, 0.0, 0.02), (0.1, 0.05, 1.0), 0.1, 0.03, "wall"),
        "floor": FLOOR,
    },
    "edge": {
        "edge": RingEdge(0.014, 0.002, "wall", ((0.0, -1.0), (0.0, -1.0)), 0.02),
        "floor": FLOOR,
    },
    "mesh": {"block": mesh_of(trimesh.creation.box((0.08, 0.08, 0.02)), 1e-3)},
    "moving": {
        "floor": Plane(
            (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", motion=Motion((0.05, 0.0, 0.1))
        ),
        "drum": Cylinder(
            (0, 0, -0.1),
            (0, 0, 1),
            0.4,
            0.04,
            "wall",
            motion=Motion((0, 0, 0), (0, 0, 5)),
        ),
    },
}


# a mesh has kernels of its own, for smooth bodies and for clumps
KINDS = [
    pytest.param(kind, marks=pytest.mark.slow if kind == "mesh" else ())
    for kind in WALLS
]


@pytest.mark.parametrize("kind", KINDS)
def test_they_pile_up_among_walls(kind):
    """Spheres, ellipsoids and clumps of one sphere move alike, from three layers of four in free fall to a pile."""
    scenes = three(
        walls=WALLS[kind], gravity=DOWN, dt=5e-6, capacity=12, floor_height_m=-0.05
    )
    rng = np.random.default_rng(4)
    for k in range(12):
        x, y = 0.0135 * (np.array(divmod(k % 4, 2)) - 0.5) + 1e-3 * rng.random(2)
        place = (x, y, 0.04 + 0.0135 * (k // 4))
        velocity = 0.1 * rng.normal(size=3) - (0.0, 0.0, 0.5)
        for s in scenes:
            s.add("body", place, velocity_m_s=velocity)
    # the smooth body's contact is an expansion, whose error falls with the square of the step; hits amplify it
    touched = 0
    for _ in range(20):
        compare(scenes, 1000, 1, 1e-5)
        touched += s.counts[st.N_PLANE] + s.counts[st.N_CURVED] + s.counts[st.N_MESHED]
        contacts = [s.contacts() for s in scenes]
        assert all(np.array_equal(contacts[0], other) for other in contacts[1:])
    assert touched > 20


def test_spheres_turn_with_a_frame_and_others_take_the_way_of_smooth_bodies():
    wall = Cylinder(
        (0.0, -0.05, 0.0),
        (0.0, 1.0, 0.0),
        0.1,
        0.03,
        "wall",
        motion=Motion((0, 0, 0), (0.0, 8.0, 0.0)),
    )
    scenes = three(
        walls={"drum": wall}, gravity=DOWN, dt=5e-6, contact=Contact(0.3, 0.5, 0.3)
    )
    for s in scenes:
        s.rolling_frame_rad_s[:] = (0.0, 8.0, 0.0)
        s.add("body", (0.0, 0.0, -0.0235), angular_velocity_rad_s=(3.0, -9.0, 20.0))
        s.add("body", (0.004, 0.013, -0.0225))
    compare(scenes, 500, 20, 1e-5)
    assert scenes[0].angular_velocities[:, 1].max() > 7.0
    sphere = Shape.sphere(RADIUS, DENSITY, "body")
    berry = Shape.ellipsoid((0.006, 0.006, 0.007), DENSITY, "body")
    uneven = Shape(
        [[RADIUS] * 3], sphere.mass_kg, sphere.inertia_kg_m2 * [1.0, 1.0, 0.9], "body"
    )
    assert (
        count_ellipsoids([sphere, Shape.sphere(0.5 * RADIUS, DENSITY, "body")])
        == st.SPHERES
    )
    assert count_ellipsoids([sphere, berry]) == count_ellipsoids([uneven]) == 1


@pytest.mark.slow
@pytest.mark.parametrize("rolling", list(ROLLING_LAWS))
@pytest.mark.parametrize("contact", list(CONTACT_LAWS))
def test_they_obey_each_law(contact, rolling):
    further = {
        "jkr": {"surface_energy_j_m2": 0.5},
        "sjkr": {"cohesion_energy_density_j_m3": 5e3},
    }
    further["eepa"] = {"plasticity_ratio": 0.5, "surface_energy_j_m2": 0.5}
    laws = {
        "contact_law": contact,
        "rolling_law": rolling,
        "contact": Contact(0.3, 0.5, 0.05, constants=further.get(contact, {})),
    }
    scenes = three(walls={"floor": FLOOR}, gravity=DOWN, dt=2e-6, **laws)
    for s in scenes:
        s.add(
            "body",
            (0, 0, 0.0065),
            velocity_m_s=(0.3, 0, -0.5),
            angular_velocity_rad_s=(5.0, 20.0, 3.0),
        )
        s.add("body", (0.002, 0.001, 0.019), velocity_m_s=(0.0, 0.1, -0.5))
    compare(scenes, 500, 20, 1e-4)
