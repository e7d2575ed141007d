"""The longest time step, and bodies at rest."""

import math

import numpy as np
import pytest
from dem.clump_scenes import scene
from dem.common import DOWN, FLOOR
from dem.test_epsd import berry
from verification.simulations import smooth as smooth_body

from repose.dem import (
    Clump,
    Contact,
    Material,
    Plane,
    Shape,
    random_quaternion,
    time_steps,
)
from repose.dem.contact_table import index_contacts
from repose.dem.kernels import state as st
from repose.dem.laws import CONTACT_LAWS, hertz_mindlin, linear_spring
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

SOFT = Material(4.3e4, 0.32)
HARD = Material(1.12e9, 0.4)
RADIUS_M = 5e-3
MASS_KG = 5e-4
BALL = Clump(
    [[0.0, 0.0, 0.0, RADIUS_M]], MASS_KG, [0.4 * MASS_KG * RADIUS_M**2] * 3, "body"
)
CONVEX = Shape([[RADIUS_M] * 3], MASS_KG, [0.4 * MASS_KG * RADIUS_M**2] * 3, "body")


def row(number):
    x = np.linspace(-6e-3, 6e-3, number)
    spheres = np.column_stack([x, 0 * x, 0 * x, np.full(number, RADIUS_M)])
    return Clump(spheres, MASS_KG, [0.4 * MASS_KG * RADIUS_M**2] * 3, "body")


def study(restitution=0.3, tension="keep", law="hertz_mindlin", shape=BALL):
    materials = {"body": SOFT, "wall": HARD}
    contact = Contact(restitution, 0.0, 0.0)
    contacts = index_contacts(
        {("body", "body"): contact, ("body", "wall"): contact}, materials
    )
    return time_steps.Scene(
        CONTACT_LAWS[law],
        tension,
        materials,
        contacts,
        {"ball": shape},
        frozenset({"wall"}),
    )


def swing(shape, overlap_m, step_s, restitution, tension, monkeypatch):
    """Largest distance from the middle, in the last of many steps, of a body that began 1 um off it, over 1 um."""
    monkeypatch.setattr(
        time_steps, "compute_longest", lambda *_: time_steps.Limit(1.0, "")
    )
    reach = RADIUS_M - overlap_m
    contact = Contact(restitution, 0.0, 0.0)
    walls = {
        str(side): Plane((0.0, 0.0, side * reach), (0.0, 0.0, -side), "wall")
        for side in (-1.0, 1.0)
    }
    simulation = scene(
        {"ball": shape},
        contact,
        walls,
        step_s,
        1,
        body=SOFT,
        wall=HARD,
        tension=tension,
    )
    simulation.add("ball", (0.0, 0.0, 1e-6))
    simulation.run_steps(390)
    away = 0.0
    for _ in range(10):
        simulation.run_steps(1)
        away = max(away, abs(float(simulation.positions[0, 2])))
    return away / 1e-6


@pytest.mark.parametrize("shape", [BALL, CONVEX], ids=["clump", "smooth"])
@pytest.mark.parametrize(
    ("restitution", "tension"), [(0.05, "release"), (0.3, "keep"), (0.9, "keep")]
)
def test_a_pressed_body_is_stable_up_to_the_limit_and_not_beyond(
    shape, restitution, tension, monkeypatch
):
    overlap = 0.1 * RADIUS_M
    limit = time_steps.compute_pressed_limit(
        study(restitution, tension, shape=shape), shape, "wall", overlap_m=overlap
    )
    below = swing(
        shape, overlap, 0.97 * limit.time_step_s, restitution, tension, monkeypatch
    )
    beyond = swing(
        shape, overlap, 1.03 * limit.time_step_s, restitution, tension, monkeypatch
    )
    assert below < 0.01
    assert beyond > 10.0


@pytest.mark.parametrize(
    ("law", "module"),
    [("hertz_mindlin", hertz_mindlin), ("linear_spring", linear_spring)],
)
def test_the_stiffness_is_the_slope_of_the_force(law, module):
    contact = Contact(0.4, 0.0, 0.0)
    radius = 3e-3
    overlap = 2e-4
    h = 1e-9
    stiffness, _ = module.oscillator(SOFT, HARD, contact, "keep", radius, overlap)
    first = module.constants(SOFT, HARD, contact)[0]

    def force(delta):
        return first * (
            math.sqrt(radius * delta) * delta
            if law == "hertz_mindlin"
            else radius * delta
        )

    expected = (force(overlap + h) - force(overlap - h)) / (2 * h)
    assert stiffness == pytest.approx(expected, rel=1e-6)


def test_an_oscillator_of_the_damping_ratio_returns_the_restitution():
    """A linear contact that may pull: exp(-pi z / sqrt(1 - z^2)) is the speed after half a period over that before."""
    _, z = linear_spring.oscillator(
        SOFT, HARD, Contact(0.4, 0.0, 0.0), "keep", 3e-3, 1e-4
    )
    assert math.exp(-math.pi * z / math.sqrt(1.0 - z * z)) == pytest.approx(
        0.4, rel=1e-9
    )


def test_spheres_touch_a_wall_together():
    assert BALL.acting_together(1e-4 * RADIUS_M) == pytest.approx(1.0)
    assert row(15).acting_together(0.1 * RADIUS_M) == pytest.approx(15.0, rel=0.01)
    apart = Clump([[-1.0, 0, 0, 0.1], [1.0, 0, 0, 0.1]], 1.0, [1.0, 1.0, 1.0], "body")
    # seen from the side both touch
    assert apart.acting_together(0.05) == pytest.approx(2.0, rel=0.02)
    sphere = row(1)
    spheres = row(15)
    single = time_steps.compute_pressed_limit(
        study(0.9, shape=sphere), sphere, "wall", overlap_m=5e-4
    )
    many = time_steps.compute_pressed_limit(
        study(0.9, shape=spheres), spheres, "wall", overlap_m=5e-4
    )
    expected = single.time_step_s / math.sqrt(15.0)
    assert many.time_step_s == pytest.approx(expected, rel=0.02)
    assert "15.0 spheres" in many.reason


def test_a_low_restitution_shortens_the_step():
    many = row(40)
    free = time_steps.compute_longest(study(0.9, "release", shape=many)).time_step_s
    damped = time_steps.compute_longest(study(0.05, "release", shape=many)).time_step_s
    assert damped < 0.5 * free


def test_a_hard_wall_shortens_the_step():
    between = time_steps.compute_pressed_limit(
        study(0.3), BALL, "body", between_bodies=True
    ).time_step_s
    assert (
        time_steps.compute_pressed_limit(study(0.3), BALL, "wall").time_step_s < between
    )


def test_the_step_scales_with_the_grain():
    for number in (1, 40):
        shape = row(number)
        grown = Clump(
            3.0 * shape.spheres_m,
            27.0 * shape.mass_kg,
            243.0 * shape.inertia_kg_m2,
            "body",
        )
        small = time_steps.compute_longest(study(0.05, "release", shape=shape))
        large = time_steps.compute_longest(study(0.05, "release", shape=grown))
        assert large.time_step_s == pytest.approx(3.0 * small.time_step_s, rel=1e-9)
        scaled = time_steps.compute_longest(
            study(0.05, "release", shape=grown), smallest_scale=1.0 / 3.0
        )
        assert scaled.time_step_s == pytest.approx(small.time_step_s, rel=1e-9)
        assert "smallest scale, 0.333" in scaled.reason


def test_the_flattest_radius_of_an_ellipsoid():
    a = 10e-3
    b = 6e-3
    c = 4e-3
    assert Shape.ellipsoid((a, b, c), 800.0, "body").flattest_radius_m == pytest.approx(
        a * b / c
    )
    assert CONVEX.flattest_radius_m == pytest.approx(RADIUS_M)


def test_the_allowed_step_is_rounded_down():
    for number in (1.23456e-4, 9.99999e-5, 2.5e-4, 3.0e-6):
        result = float(
            time_steps.Limit(number, "why")
            .allowed.split(",")[0]
            .removeprefix("at most ")
        )
        assert 0.99 * number < result <= number * (1 + 1e-12)


SMALLEST = np.finfo(float).tiny  # smaller numbers are denormal


def clump():
    x = np.linspace(-6e-3, 6e-3, 5)
    solid = berry()
    return Clump(
        np.column_stack([x, 0 * x, 0 * x, np.full(5, 4.5e-3)]),
        solid.mass_kg,
        solid.inertia_kg_m2,
        "body",
    )


EPSD = {
    "contact_law": "hertz_mindlin_rescaled",
    "tension": "release",
    "rolling_law": "epsd",
}


def left_alone(shape, seconds, **laws):
    room = {"capacity": 24, "gravity": DOWN, "lower": (-0.1, -0.1, 0.0)}
    s = scene(
        {"body": shape}, Contact(0.3, 0.5, 0.05), {"floor": FLOOR}, 2e-4, **room, **laws
    )
    rng = np.random.default_rng(1)
    for k in range(16):
        x, y = 0.012 * (np.array([k % 2, k // 2 % 2]) - 0.5)
        s.add("body", (x, y, 0.012 + 0.012 * (k // 4)), random_quaternion(rng))
    for k in range(8):
        turn = 0.25 * np.pi * k
        s.add(
            "body",
            (0.09 * np.cos(turn), 0.09 * np.sin(turn), 0.012),
            random_quaternion(rng),
        )
    s.run_steps(round(seconds / 2e-4))
    return s


def denormal(array):
    size = np.abs(array)
    return int(((size > 0.0) & (size < SMALLEST)).sum())


@pytest.mark.parametrize(
    "laws",
    [
        pytest.param({}, id="budget"),
        pytest.param(EPSD, id="epsd", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("shape", [berry, clump])
def test_a_pile_left_alone_has_no_denormal_number(shape, laws):
    """After ten seconds; with `epsd` after a minute more, in which it stays where it is."""
    s = left_alone(shape(), 10.0, **laws)
    place = s.positions.copy()
    turn = s.quaternions.copy()
    s.run_steps(round(60.0 / 2e-4) if laws else 0)
    assert np.abs(s.positions - place).max() < 1e-9
    assert np.abs(s.quaternions - turn).max() < 1e-7
    assert np.abs(s.velocities).max() < 1e-9
    assert np.abs(s.angular_velocities).max() < 1e-6
    for group in (s.bodies, s.pairs, s.flat, s.curved):
        for name, array in zip(group._fields, group, strict=True):
            if isinstance(array, np.ndarray) and array.dtype.kind == "f":
                assert denormal(array) == 0, name
    assert s.counts[st.N_PAIRS] + s.counts[st.N_PLANE] > 24


RADIUS = 6e-3
OVERLAP = 1e-4
CONTACT = Contact(0.1, 5.0, 0.0)
LAWS = {
    "tension": "release",
    "contact_law": "hertz_mindlin_rescaled",
    "body": SOFT,
    "wall": HARD,
}


def held(planes, step_s=None, smooth=False):
    """A sphere that so many planes about the z axis press, and 0.98 of the longest step if none is given."""
    ball = (smooth_body if smooth else Shape.sphere)(RADIUS, 840.0, "body")
    angles = 2.0 * math.pi * np.arange(planes) / planes
    normals = np.array([(math.cos(angle), math.sin(angle), 0.0) for angle in angles])
    walls = {
        str(k): Plane(tuple((RADIUS - OVERLAP) * n), tuple(-n), "wall")
        for k, n in enumerate(normals)
    }
    if step_s is None:
        step_s = (
            0.98
            * scene({"ball": ball}, CONTACT, walls, 1e-6, **LAWS).longest_time_step()
        )
    simulation = scene({"ball": ball}, CONTACT, walls, step_s, **LAWS)
    simulation.add("ball", (0.0, 0.0, 0.0), angular_velocity_rad_s=(0.0, 0.0, 1.0))
    return simulation


def excess(simulation, planes):
    """dt max(J) sum(c r^2), from the equations of the contact law."""
    ball = simulation.shapes["ball"]
    _, shear = effective_moduli(SOFT, HARD)
    beta = damping_ratio(CONTACT.restitution, "release")
    stiffness = 8.0 * shear * math.sqrt(RADIUS * OVERLAP)
    dashpot = 2.0 * math.sqrt(5.0 / 6.0) * beta * math.sqrt(stiffness * ball.mass_kg)
    arm = RADIUS - OVERLAP / 2.0
    return simulation.time_step_s * planes * dashpot * arm**2 / ball.inertia_kg_m2.min()


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("planes", [2, 8])
def test_the_share_is_that_of_the_equation(planes, smooth):
    for step_s in (None, 1e-6):
        simulation = held(planes, step_s, smooth)
        simulation.run_steps(1)
        share = simulation.bodies.rows[0, st.share_column(simulation.physics.parts)]
        expected = 1.0 / max(1.0, excess(simulation, planes))
        assert share == pytest.approx(expected, rel=1e-6)
        assert (share == 1.0) == (step_s is not None)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_body_among_eight_others_comes_to_rest(smooth):
    """Without the share its rotation would grow, as the dashpots would take more than twice of it in a step."""
    simulation = held(8, smooth=smooth)
    assert excess(simulation, 8) > 3.0
    spins = []
    for _ in range(400):
        simulation.run_steps(1)
        spins.append(abs(float(simulation.angular_velocities[0, 2])))
    assert max(spins[300:]) < 1e-6
