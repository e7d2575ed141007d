"""Rolling resistance between two bodies: beside its increments, on planes and slopes, and what it keeps.

The law is `epsd`; `constant_torque` and `epsd2` are asked for the same where they differ.
"""

import math
import warnings

import numpy as np
import pytest
from dem.clump_scenes import ball_of_one, bent
from dem.clump_scenes import scene as scene_of
from dem.common import (
    BERRY,
    DENSITY,
    FLOOR,
    GOJI,
    PVC,
    angular_momentum,
    random_direction,
)
from oracles import epsd as slow_law
from refusals import value_error
from shared import says

from repose.dem import Contact, Material, Motion, Plane, Shape, random_quaternion
from repose.dem.kernels import state as st
from repose.dem.kernels import tile as tl
from repose.dem.laws import ROLLING_LAWS
from repose.dem.materials import effective_moduli

LAW = ROLLING_LAWS["epsd"]
LANES = st.LANES
RADIUS = 0.006
GRAVITY = 9.81
STIFF = Material(1e3 * GOJI.shear_modulus_pa, GOJI.poisson_ratio)


@pytest.mark.parametrize("wall", [False, True])
def test_a_tile_of_contacts_on_random_paths_agrees_with_the_increments_of_the_torque(
    wall,
):
    rng = np.random.default_rng(12)
    dt = 1e-4
    steps = 120
    contact = Contact(0.4, 0.5, 0.1, 0.2)
    tile = np.zeros((tl.LAW_ROW, LANES))
    kept = np.zeros((3 + LAW.n_state, LANES))
    tile[tl.ROLLING // LANES :][: LAW.n_constants] = LAW.constants(GOJI, GOJI, contact)[
        :, None
    ]
    law = (
        contact.rolling_friction,
        contact.twisting_friction,
        *effective_moduli(GOJI, GOJI),
    )
    masses = rng.uniform(0.5e-3, 2e-3, (2, LANES))
    options = LAW.make_options("release")
    tile[tl.A // LANES + st.INVERSE_MASS] = 1.0 / masses[0]
    if wall:
        masses[1] = np.inf
    tile[tl.B // LANES + st.INVERSE_MASS] = 1.0 / masses[1]
    normal = np.array([random_direction(rng) for _ in range(LANES)])
    rolled = np.zeros((LANES, 3))
    twisted = np.zeros(LANES)
    count = np.zeros((2, 2), int)
    for step in range(steps):
        overlap = 3e-4 * (0.7 + np.sin(np.arange(LANES) + step / 9.0))
        push = np.where(
            overlap > 0.0, rng.uniform(0.0, 0.005, LANES) * (step % 11 > 0), 0.0
        )
        normal += 2e-3 * rng.normal(size=normal.shape)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        turning = 40.0 * rng.normal(size=(2, LANES, 3))
        arms = 5e-3 * rng.normal(size=(2, LANES, 3))
        if wall:
            arms[1] = 0.0
        circle = np.sqrt(3e-3 * np.maximum(overlap, 0.0))
        for row, value in {
            tl.CIRCLE: circle,
            tl.GAP: -overlap,
            tl.RADIUS: np.full(LANES, 3e-3),
            tl.PUSH: push,
            tl.RA: arms[0].T,
            tl.RB: arms[1].T,
            tl.A + st.ANGULAR_VELOCITY * LANES: turning[0].T,
            tl.B + st.ANGULAR_VELOCITY * LANES: turning[1].T,
        }.items():
            tile[row // LANES :][: 1 if value.ndim == 1 else 3] = value
        # what the forces turn the bodies by stays
        before = rng.normal(size=(2, 3, LANES))
        tile[tl.TO_A // LANES + 3 :][:3], tile[tl.TO_B // LANES + 3 :][:3] = before
        kept[:3] = normal.T
        LAW.kernel(options, tile.ravel(), kept.ravel(), st.NORMAL + 3 * LANES, dt)
        torque = (tile[tl.TO_A // LANES + 3 :][:3] - before[0]).T
        assert np.allclose(
            tile[tl.TO_B // LANES + 3 :][:3] - before[1],
            -torque.T,
            rtol=0.0,
            atol=1e-15,
        )
        for k in range(LANES):
            if overlap[k] <= 0.0:
                rolled[k] = 0.0
                twisted[k] = 0.0
                assert np.all(torque[k] == 0.0)
                assert np.all(kept[3:, k] == 0.0)
                continue
            lengths = np.linalg.norm(arms[:, k], axis=1)
            lengths[lengths == 0.0] = np.inf
            expected, rolled[k], twisted[k] = slow_law(
                law,
                math.sqrt(3e-3 * overlap[k]),
                normal[k],
                lengths,
                masses[:, k],
                turning[0, k] - turning[1, k],
                push[k],
                rolled[k],
                twisted[k],
                dt,
            )
            assert np.allclose(torque[k], expected, rtol=1e-9, atol=1e-15)
            lever = 1.0 / np.sum(1.0 / lengths)
            count[
                0,
                int(
                    np.linalg.norm(rolled[k])
                    > 0.999 * contact.rolling_friction * push[k] * lever
                ),
            ] += 1
            count[
                1,
                int(
                    abs(twisted[k])
                    > 0.999 * 0.2 * push[k] * math.sqrt(3e-3 * overlap[k])
                ),
            ] += 1
    assert count.min() > 200


def test_twisting_is_limited_as_a_sliding_hertz_contact_unless_a_coefficient_is_given():
    """mu_s times the mean of the radius over Hertz's pressure, which is 3 pi / 16 of the circle's."""
    r = (np.arange(100000) + 0.5) / 100000
    pressure = np.sqrt(1.0 - r**2)
    mean = np.sum(pressure * r * r) / np.sum(pressure * r)
    assert LAW.constants(GOJI, GOJI, Contact(0.4, 0.5, 0.1))[1] == pytest.approx(
        0.5 * mean, rel=1e-6
    )
    assert LAW.constants(GOJI, GOJI, Contact(0.4, 0.5, 0.1, 0.07))[1] == 0.07
    assert LAW.constants(GOJI, GOJI, Contact(0.4, 0.5, 0.1, 0.0))[1] == 0.0
    value_error("twisting_friction is -1", Contact, 0.4, 0.5, 0.1, -1)


def smooth():
    return Shape.sphere(RADIUS, DENSITY, "body")


def berry():
    return Shape.ellipsoid(BERRY[0], DENSITY, "body")


BODIES = [smooth, ball_of_one]
OTHERS = ["constant_torque", "epsd2"]  # laws that turn bodies against each other, too


def scene(
    shape,
    contact,
    walls=None,
    material=GOJI,
    dt=1e-5,
    capacity=2,
    gravity=(0.0, 0.0, -GRAVITY),
    **laws,
):
    laws = {
        "contact_law": "hertz_mindlin_rescaled",
        "tension": "release",
        "rolling_law": "epsd",
    } | laws
    return scene_of(
        {"body": shape}, contact, walls, dt, capacity, gravity, body=material, **laws
    )


def sunk(mass, material=GOJI):
    """Overlap of a sphere that rests on a floor."""
    young, _ = effective_moduli(material, PVC)
    return (mass * GRAVITY / (4.0 / 3.0 * young * math.sqrt(RADIUS))) ** (2.0 / 3.0)


def on_floor(
    shape,
    contact,
    slope=0.0,
    spin=(0.0, 0.0, 0.0),
    velocity=(0.0, 0.0, 0.0),
    material=STIFF,
    **keywords,
):
    s = scene(shape, contact, {"floor": FLOOR}, material, **keywords)
    s.add(
        "body",
        (0.0, 0.0, RADIUS - sunk(shape.mass_kg, material)),
        (1, 0, 0, 0),
        velocity,
        spin,
    )
    angle = math.atan(slope)
    s.physics.gravity[:] = GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)
    return s


def lost_in_a_meeting(shape, law, rng):
    """Share of their angular momentum that two bodies lose which spin and meet; they lose energy."""
    s = scene(
        shape, Contact(0.3, 0.5, 0.2), dt=5e-5, gravity=(0.0, 0.0, 0.0), rolling_law=law
    )
    direction = random_direction(rng)
    s.add(
        "body",
        (0, 0, 0),
        random_quaternion(rng),
        angular_velocity_rad_s=40.0 * rng.normal(size=3),
    )
    s.add(
        "body",
        0.0215 * direction,
        random_quaternion(rng),
        -direction,
        40.0 * rng.normal(size=3),
    )
    before = angular_momentum(s)
    energy = s.kinetic_energies().sum()
    s.run_steps(1500)
    assert s.kinetic_energies().sum() < 0.95 * energy
    return np.abs(angular_momentum(s) - before).max() / np.abs(before).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "law"),
    [(berry, "epsd"), (bent, "epsd"), *((berry, law) for law in OTHERS)],
)
def test_bodies_that_spin_and_meet_keep_their_angular_momentum(shape, law):
    rng = np.random.default_rng(5)
    assert max(lost_in_a_meeting(shape(), law, rng) for _ in range(8)) < 1e-9
    assert lost_in_a_meeting(shape(), "budget", rng) > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "law"),
    [*((shape, "epsd") for shape in BODIES), *((smooth, law) for law in OTHERS)],
)
def test_a_sphere_is_held_on_a_slope_below_the_rolling_friction(shape, law):
    """The slope rises to half the rolling friction of 0.1, for epsd to 98 % of it; then the sphere has 0.2 s to move."""
    s = on_floor(shape(), Contact(0.2, 2.0, 0.1), rolling_law=law)
    for slope in np.linspace(0.0, 0.098 if law == "epsd" else 0.05, 50):
        direction = np.array([slope, 0.0, -1.0]) / math.hypot(1.0, slope)
        s.physics.gravity[:] = GRAVITY * direction
        s.run_steps(400)
    s.run_steps(20000)
    before = s.positions[0, 0]
    s.run_steps(20000)
    # the spring of epsd2 swings about its place; the constant torque resists only what already rolls
    rolled_freely = 0.5 * 5.0 / 7.0 * GRAVITY * 0.05 * 0.2**2
    most = {"epsd": 1e-9, "epsd2": 1e-5, "constant_torque": 1e-3 * rolled_freely}
    assert abs(s.positions[0, 0] - before) < most[law]
    if law == "epsd":
        assert abs(s.velocities[0, 0]) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "law"),
    [*((shape, "epsd") for shape in BODIES), *((smooth, law) for law in OTHERS)],
)
def test_a_sphere_rolls_on_a_slope_above_the_rolling_friction(shape, law):
    """It is accelerated by 5 / 7 g (sin a - mu_r cos a), which is measured over 0.1 s."""
    slope = 0.15
    rolling = 0.1
    angle = math.atan(slope)
    s = on_floor(shape(), Contact(0.2, 2.0, rolling), slope, rolling_law=law)
    s.run_steps(4000)
    before = s.velocities[0, 0]
    s.run_steps(10000)
    expected = 5.0 / 7.0 * GRAVITY * (math.sin(angle) - rolling * math.cos(angle))
    rel = 5e-3 if law == "epsd" else 1e-2
    assert (s.velocities[0, 0] - before) / 0.1 == pytest.approx(expected, rel=rel)


@pytest.mark.slow
@pytest.mark.parametrize("shape", BODIES)
def test_a_rolling_sphere_is_slowed_by_the_rolling_friction_and_stops(shape):
    rolling = 0.05
    s = on_floor(
        shape(),
        Contact(0.3, 0.8, rolling),
        spin=(0.0, 0.3 / RADIUS, 0.0),
        velocity=(0.3, 0.0, 0.0),
    )
    s.run_steps(2000)
    before = s.velocities[0, 0]
    s.run_steps(20000)
    expected = 5.0 / 7.0 * rolling * GRAVITY
    assert (before - s.velocities[0, 0]) / 0.2 == pytest.approx(expected, rel=5e-3)
    s.run_steps(200000)
    assert abs(s.velocities[0, 0]) < 1e-9
    assert np.abs(s.angular_velocities).max() < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("law", OTHERS)
def test_a_spin_on_a_smooth_floor_is_slowed_by_the_rolling_friction(law):
    """omega_0 - 5 mu_r g t / (2 R): the torque mu_r m g R over the moment 0.4 m R^2."""
    rolling = 0.1
    began = 200.0
    s = on_floor(
        smooth(), Contact(0.2, 0.0, rolling), spin=(began, 0.0, 0.0), rolling_law=law
    )
    s.run_steps(5000)
    expected = began - 2.5 * rolling * GRAVITY / RADIUS * 5000 * s.time_step_s
    assert s.angular_velocities[0, 0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("shape", BODIES)
def test_a_sphere_that_spins_on_a_floor_is_stopped_by_the_friction_of_its_circle(shape):
    friction = 0.5
    spin = 20.0
    mass = shape().mass_kg
    circle = math.sqrt(RADIUS * sunk(shape().mass_kg))
    by_default = 3.0 * math.pi / 16.0 * friction
    for twisting, coefficient, law in (
        (None, by_default, "epsd"),
        (0.1, 0.1, OTHERS[0]),
        (0.1, 0.1, "epsd"),
        (0, 0, "epsd"),
    ):
        contact = Contact(0.3, friction, 0.1, twisting)
        options = {"material": GOJI, "dt": 5e-5, "rolling_law": law}
        s = on_floor(shape(), contact, spin=(0.0, 0.0, spin), **options)
        moment = 0.4 * mass * RADIUS**2
        slowed = coefficient * mass * GRAVITY * circle / moment
        s.run_steps(400)
        before = s.angular_velocities[0, 2]
        s.run_steps(200)
        assert before - s.angular_velocities[0, 2] == pytest.approx(
            0.01 * slowed, rel=5e-3, abs=1e-12
        )
        if coefficient == 0.0:
            assert s.angular_velocities[0, 2] == spin
            continue
        s.run_steps(round(1.5 * spin / slowed / 5e-5))
        s.run_steps(40000)  # the spring that is left swings out
        assert abs(s.angular_velocities[0, 2]) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("shape", BODIES)
def test_a_wall_that_turns_takes_a_sphere_along_and_bears_the_couple_of_a_spin(shape):
    turning = Motion(angular_velocity_rad_s=(0.0, 0.0, 2.0))
    plate = {"plate": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", motion=turning)}
    s = scene(shape(), Contact(0.3, 0.8, 0.1), plate, dt=5e-5)
    s.add("body", (0.0, 0.0, RADIUS - sunk(shape().mass_kg)))
    s.run_steps(40000)
    assert np.allclose(s.angular_velocities[0], (0.0, 0.0, 2.0), atol=1e-6)
    # what the floor has turned it by, it has turned the floor by
    s.run_steps(1)
    assert np.abs(s.wall_loads()["plate"].torque_n_m).max() < 1e-9
    s = on_floor(
        shape(), Contact(0.3, 0.5, 0.1), spin=(0.0, 0.0, 20.0), material=GOJI, dt=5e-5
    )
    s.run_steps(400)
    before = s.angular_momenta[0, 2]
    torque = s.wall_loads()["floor"].torque_n_m[2]
    s.run_steps(1)
    assert torque > 0.0
    assert torque == pytest.approx((before - s.angular_momenta[0, 2]) / 5e-5, rel=1e-6)


TURNING = Motion(angular_velocity_rad_s=(0.0, 0.0, 1.0))


def warned(rolling=0.1, motion=TURNING, frame=False, **laws):
    floor = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", motion=motion)
    s = scene(
        smooth(),
        Contact(0.3, 0.5, rolling),
        {"floor": floor},
        **({"rolling_law": "budget"} | laws),
    )
    if frame:
        s.rolling_frame_rad_s[:] = 0.0, 0.0, 1.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # may compile, after which Python no longer knows what it has warned of
        s.run_steps(1)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("default")
        for _ in range(2):
            s.run_steps(1)
    return [str(warning.message) for warning in found]


def test_a_wall_that_turns_where_rolling_is_resisted_in_space_is_reported_once():
    (message,) = warned()
    says(message, "rolling_frame_rad_s", "epsd")


@pytest.mark.parametrize(
    "harmless",
    [
        {"frame": True},
        {"rolling": 0.0},
        {"motion": Motion((0.01, 0.0, 0.0))},
        pytest.param({"rolling_law": "epsd"}, marks=pytest.mark.slow),
    ],
    ids=["frame", "no rolling friction", "translation", "epsd"],
)
def test_a_wall_that_does_no_harm_to_rolling_is_not_reported(harmless):
    assert warned(**harmless) == []
