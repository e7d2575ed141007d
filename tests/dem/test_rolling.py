"""Rolling resistance of bodies whose moments of inertia differ: where it sticks, and what it leaves."""

import math

import numpy as np
import pytest
from dem.clump_scenes import scene
from dem.common import DOWN, FLOOR, GOJI
from scipy.optimize import brentq

from repose.dem import Contact, Material, Shape, random_quaternion
from repose.dem.kernels import body_rotation, body_tile
from repose.dem.kernels import state as st
from repose.dem.rotations import rotation_matrix

LANES = st.LANES
RADIUS = 0.006
# kg m2, principal, of the default berry of 1.25 g
MOMENTS = (
    1.545e-8,
    4.088e-8,
    4.304e-8,
)
STIFF = Material(1e3 * GOJI.shear_modulus_pa, GOJI.poisson_ratio)


def left_by_resistance(momentum, inertia, budget, frame):
    """Angular momentum that is left: l' = l - B d / |d|, d = J l' - frame, or that of the frame, by bisection."""
    relative = momentum - inertia @ frame
    if np.linalg.norm(relative) <= budget:
        return inertia @ frame
    if budget == 0.0:
        return momentum

    def along(speed):
        return np.linalg.solve(speed * inertia + budget * np.eye(3), relative)

    fastest = np.linalg.norm(np.linalg.solve(inertia, relative))
    speed = brentq(
        lambda s: np.linalg.norm(along(s)) - 1.0,
        0.0,
        fastest * (1.0 + 1e-9),
        xtol=1e-15 * fastest,
    )
    return inertia @ (frame + speed * along(speed))


@pytest.mark.parametrize("framed", [False, True])
def test_rolling_resistance_of_a_tile_agrees_with_the_slow_law(framed):
    rng = np.random.default_rng(4)
    frame = np.array([0.0, 3.0, 1.0]) if framed else np.zeros(3)
    m = st.aligned_zeros(body_tile.TILE_ROWS * LANES)
    c = st.aligned_zeros(st.MOTION_ROWS * LANES)
    dt = 1e-4
    expected = []
    stuck = 0
    for lane in range(LANES):
        q = random_quaternion(rng)
        inertia = rotation_matrix(q) @ np.diag(MOMENTS) @ rotation_matrix(q).T
        momentum = 1e-6 * rng.normal(size=3)
        # shares of what would stop the body: none, some, nearly all, just more
        budget = (
            np.linalg.norm(momentum - inertia @ frame)
            * (0.0, rng.uniform(), 0.9999, 1.0001)[lane % 4]
        )
        c[st.QUATERNION + lane :: LANES][:4] = q
        c[st.INVERSE_MOMENTS + lane :: LANES][:3] = 1.0 / np.array(MOMENTS)
        c[st.ANGULAR_MOMENTUM + lane :: LANES][:3] = momentum
        m[body_tile.LOAD + st.ROLL * LANES + lane] = budget / dt
        expected.append((left_by_resistance(momentum, inertia, budget, frame), inertia))
        stuck += lane % 4 == 3
    # the last lane is that of a body that is not there, with a torque all the same
    c[st.INVERSE_MOMENTS + LANES - 1 :: LANES][:3] = 0.0
    m[body_tile.LOAD + st.ROLL * LANES + LANES - 1] = 0.0
    body_rotation.write_inverse_inertia(m, c)
    if framed:
        body_rotation.resist_rolling_in_frame(m, c, dt, *frame)
    else:
        assert body_rotation.resist_rolling(m, c, dt) == LANES - stuck
    assert np.all(np.isfinite([*c, *m[body_tile.OMEGA :][: 3 * LANES]]))
    for lane, (momentum, inertia) in enumerate(expected[:-1]):
        assert np.allclose(
            c[st.ANGULAR_MOMENTUM + lane :: LANES][:3],
            momentum,
            rtol=0.0,
            atol=1e-12 * 1e-6,
        )
        turning = m[body_tile.OMEGA + lane :: LANES][:3]
        assert np.allclose(
            turning, np.linalg.solve(inertia, momentum), rtol=0.0, atol=1e-10
        )
        if lane % 4 == 3:
            assert np.array_equal(turning, frame)
    for column in (
        3,
        4,
        5,
    ):  # torques about each axis, of the last lanes alone; the very last two resist them
        m[body_tile.LOAD :][: 8 * LANES] = np.outer(
            np.arange(8) == st.ROLL, [1.0] * (LANES - 2) + [3.0] * 2
        ).ravel()
        m[body_tile.LOAD + column * LANES :][20:LANES] = 2.0
        assert body_rotation.count_disturbed_bodies(m, dt) == LANES - 22


def on_a_slope(mur, orientation, downhill):
    """A sphere with the moments of a berry, stiff, at rest on a plane; returns a function that tilts gravity."""
    shape = Shape(np.full((1, 3), RADIUS), 1.25e-3, MOMENTS, "body")
    contact = Contact(0.2, 2.0, mur)
    simulation = scene(
        {"body": shape}, contact, {"floor": FLOOR}, capacity=1, gravity=DOWN, body=STIFF
    )
    simulation.add("body", (0.0, 0.0, RADIUS), orientation)
    simulation.run_steps(2000)

    def tilt(tangent, steps):
        """Tilt gravity in 40 small steps to a slope of this tangent; the angle by which the sphere has turned."""
        before = simulation.quaternions[0]
        start = math.asin(math.hypot(*simulation.physics.gravity[:2]) / 9.81)
        end = math.atan(tangent)
        for k in range(40):
            angle = start + (end - start) * (k + 1) / 40
            direction = np.append(math.sin(angle) * downhill, -math.cos(angle))
            simulation.physics.gravity[:] = 9.81 * direction
            simulation.run_steps(steps // 40)
        return 2.0 * math.acos(min(1.0, abs(before @ simulation.quaternions[0])))

    return tilt


def test_a_body_with_a_berrys_moments_lets_go_at_the_rolling_friction_in_any_orientation():
    rng = np.random.default_rng(6)
    mur = 0.1
    for _ in range(8):
        azimuth = rng.uniform(0.0, 2.0 * math.pi)
        tilt = on_a_slope(
            mur,
            random_quaternion(rng),
            np.array([math.cos(azimuth), math.sin(azimuth)]),
        )
        tilt(0.99 * mur, 8000)
        # torque m g R sin(angle) against mu_r m g R cos(angle)
        assert tilt(0.991 * mur, 4000) == 0.0
        assert tilt(1.01 * mur, 8000) > 1e-4
