"""What has come to rest is at rest: nothing decays on and on into numbers with which a processor is slow."""

import numpy as np
import pytest
from dem.clump_scenes import FLOOR, scene
from dem.common import BERRY, DENSITY

from repose.dem import Clump, Contact, Shape, random_quaternion
from repose.dem.kernels import state as st

SMALLEST = np.finfo(float).tiny  # smaller numbers are denormal


def ellipsoid():
    return Shape.ellipsoid(BERRY[0], DENSITY, "body")


def clump():
    """Five spheres in a row, with the mass and moments of the ellipsoid."""
    x = np.linspace(-6e-3, 6e-3, 5)
    solid = ellipsoid()
    return Clump(np.column_stack([x, 0 * x, 0 * x, np.full(5, 4.5e-3)]), solid.mass_kg, solid.inertia_kg_m2, "body")


def left_alone(shape, seconds):
    """A small pile on a plate with lone bodies beside it, after some time."""
    walls, gravity = {"floor": FLOOR}, (0.0, 0.0, -9.81)
    s = scene({"body": shape}, Contact(0.3, 0.5, 0.05), walls, 2e-4, 24, gravity, lower=(-0.1, -0.1, 0.0))
    rng = np.random.default_rng(1)
    for k in range(16):
        x, y = 0.012 * (np.array([k % 2, k // 2 % 2]) - 0.5)
        s.add("body", (x, y, 0.012 + 0.012 * (k // 4)), random_quaternion(rng))
    for k in range(8):
        turn = 0.25 * np.pi * k
        s.add("body", (0.09 * np.cos(turn), 0.09 * np.sin(turn), 0.012), random_quaternion(rng))
    s.run_steps(round(seconds / 2e-4))
    return s


def denormal(array):
    """How many of the numbers are denormal."""
    size = np.abs(array)
    return int(((size > 0.0) & (size < SMALLEST)).sum())


@pytest.mark.parametrize("shape", [ellipsoid, clump])
def test_a_pile_left_for_ten_seconds_has_no_denormal_number(shape):
    s = left_alone(shape(), 10.0)
    assert np.abs(s.velocities).max() < 1e-9
    assert np.abs(s.angular_velocities).max() < 1e-6
    for group in (s.bodies, s.pairs, s.flat, s.curved):
        for name, array in zip(group._fields, group, strict=True):
            if array.dtype.kind == "f":
                assert denormal(array) == 0, name
    assert s.counts[st.N_PAIRS] + s.counts[st.N_PLANE] > 24
