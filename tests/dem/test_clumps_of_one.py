"""Clumps of one sphere do what spheres do."""

import numpy as np
import pytest
import trimesh
from dem.clump_scenes import CONE, FLOOR, RADIUS, ball_of_one, scene
from dem.common import DENSITY

from repose.dem import (
    Cylinder,
    Mesh,
    Motion,
    Plane,
    RingEdge,
    Shape,
)
from repose.dem.kernels import state as st


def both(**keywords):
    """The same scene of a sphere and of a clump of one."""
    return [
        scene({"body": shape}, **keywords) for shape in (Shape.sphere(RADIUS, DENSITY, "body"), ball_of_one())
    ]


def compare(pair, steps, rounds, tolerance=1e-9):
    """Run two simulations; their states have to agree relative to how far and how fast bodies moved."""
    for _ in range(rounds):
        start = pair[0].positions.copy()
        for s in pair:
            s.run_steps(steps)
        for name in ("positions", "velocities", "angular_velocities"):
            a, b = (getattr(s, name) for s in pair)
            size = np.abs(a - start if name == "positions" else a).max()
            assert np.abs(a - b).max() <= tolerance * size, name


def test_a_clump_of_one_falls_and_rests_as_a_sphere():
    pair = both(walls={"floor": FLOOR}, gravity=(0.0, 0.0, -9.81), dt=2e-5)
    for s in pair:
        s.add(
            "body", (0.0, 0.0, 0.02), velocity_m_s=(0.3, 0.0, -0.5), angular_velocity_rad_s=(5.0, 20.0, 3.0)
        )
    compare(pair, 500, 20)


def test_a_clump_of_one_hits_obliquely_as_a_sphere():
    pair = both(dt=1e-6)
    for s in pair:
        s.add(
            "body",
            (-0.0061, 0.0, 0.0),
            velocity_m_s=(0.5, 0.1, 0.0),
            angular_velocity_rad_s=(3.0, -9.0, 20.0),
        )
        s.add("body", (0.0061, 0.003, 0.001), velocity_m_s=(-0.5, 0.0, 0.2))
    compare(pair, 1000, 20)
    assert np.abs(pair[1].angular_velocities[1]).max() > 1.0


@pytest.mark.parametrize("kind", ["disc", "cone", "tilted tube", "edge", "mesh", "moving"])
def test_clumps_of_one_pile_up_among_walls_as_spheres(kind):
    wedge = trimesh.creation.box((0.08, 0.08, 0.02))
    walls = {
        "disc": {"floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", 0.03)},
        "cone": {"cone": CONE, "floor": FLOOR},
        "tilted tube": {"tube": Cylinder((0.0, 0.0, 0.02), (0.1, 0.05, 1.0), 0.1, 0.03, "wall"), "floor": FLOOR},
        "edge": {"edge": RingEdge(0.014, 0.002, "wall", ((0.0, -1.0), (0.0, -1.0)), 0.02), "floor": FLOOR},
        "mesh": {"block": Mesh(np.array(wedge.vertices), np.array(wedge.faces), "wall", 1e-3)},
        "moving": {
            "floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", motion=Motion((0.05, 0.0, 0.1))),
            "drum": Cylinder((0, 0, -0.1), (0, 0, 1), 0.4, 0.04, "wall", motion=Motion((0, 0, 0), (0, 0, 5))),
        },
    }[kind]  # fmt: skip
    pair = both(walls=walls, gravity=(0.0, 0.0, -9.81), dt=5e-6, capacity=12, floor_height_m=-0.05)
    rng = np.random.default_rng(4)
    for k in range(12):
        x, y = 0.0135 * (np.array(divmod(k % 4, 2)) - 0.5) + 1e-3 * rng.random(2)
        place, velocity = (x, y, 0.04 + 0.0135 * (k // 4)), 0.1 * rng.normal(size=3) - (0.0, 0.0, 0.5)
        for s in pair:
            s.add("body", place, velocity_m_s=velocity)
    # the smooth body's contact is an expansion, whose error falls with the square of the step; hits amplify it
    touched = 0
    for _ in range(20):
        compare(pair, 1000, 1, 1e-5)
        touched += s.counts[st.N_PLANE] + s.counts[st.N_CURVED] + s.counts[st.N_MESHED]
        assert np.array_equal(*(s.contacts() for s in pair))
    assert touched > 20
