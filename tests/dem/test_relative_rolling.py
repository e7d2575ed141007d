"""The rolling laws `constant_torque` and `epsd2`: what they keep, how they slow a sphere, and where they hold it."""

import math

import numpy as np
import pytest
from dem.common import BERRY, DENSITY, GOJI
from dem.test_epsd import GRAVITY, RADIUS, STIFF, assert_it_rolls, lost_in_a_meeting, on_floor, smooth

from repose.dem import Contact, Shape
from repose.dem.laws.epsd import HERTZ_TWIST

pytestmark = pytest.mark.slow

LAWS = ["constant_torque", "epsd2"]


@pytest.mark.parametrize("law", LAWS)
def test_bodies_that_spin_and_meet_keep_their_angular_momentum(law):
    rng, berry = np.random.default_rng(7), Shape.ellipsoid(BERRY[0], DENSITY, "body")
    assert max(lost_in_a_meeting(berry, law, rng) for _ in range(4)) < 1e-9


@pytest.mark.parametrize("law", LAWS)
def test_a_spin_on_a_smooth_floor_is_slowed_by_rolling_and_twisting_friction(law):
    """omega_0 - 5 mu_r g t / (2 R): the torque mu_r m g R over the moment 0.4 m R^2."""
    rolling, began = 0.1, 200.0
    s = on_floor(smooth(), Contact(0.2, 0.0, rolling), spin=(began, 0.0, 0.0), rolling_law=law)
    s.run_steps(5000)
    expected = began - 2.5 * rolling * GRAVITY / RADIUS * 5000 * s.time_step_s
    assert s.angular_velocities[0, 0] == pytest.approx(expected, rel=1e-3)
    twisting, began = 0.5, 50.0
    spins = {"spin": (0.0, 0.0, began), "material": GOJI, "rolling_law": law, "dt": 2e-5}
    s = on_floor(smooth(), Contact(0.2, 0.4, 0.1, twisting), **spins)
    s.run_steps(2000)
    circle = math.sqrt(RADIUS * s.wall_overlaps()[2][0])
    before = s.angular_velocities[0, 2]
    s.run_steps(5000)
    slowed = twisting * GRAVITY * circle / (0.4 * RADIUS**2) * 5000 * s.time_step_s
    assert before - s.angular_velocities[0, 2] == pytest.approx(slowed, rel=5e-3)
    assert twisting != HERTZ_TWIST * 0.4


@pytest.mark.parametrize("law", LAWS)
def test_a_sphere_rolls_down_a_slope_above_the_rolling_friction_and_below_it_is_held(law):
    rolling = 0.1
    s = on_floor(smooth(), Contact(0.2, 2.0, rolling), 0.15, rolling_law=law)
    assert_it_rolls(s, 0.15, rolling, 4000, 1e-2)
    s = on_floor(smooth(), Contact(0.2, 2.0, rolling), 0.05, material=STIFF, rolling_law=law)
    s.run_steps(20000)
    place = s.positions[0, 0]
    s.run_steps(20000)
    # the spring swings about its place; the constant torque resists only what already rolls
    allowed = 1e-5 if law == "epsd2" else 1e-3 * 0.5 * 5.0 / 7.0 * GRAVITY * 0.05 * 0.2**2
    assert abs(s.positions[0, 0] - place) < allowed
