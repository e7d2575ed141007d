"""The longest time step: what the closed forms say, and what a body between two plates does."""

import math

import numpy as np
import pytest
from dem.clump_scenes import scene

from repose.dem import Clump, Contact, Material, Plane, Shape, time_steps
from repose.dem.contact_table import pairs_of
from repose.dem.laws import CONTACT_LAWS, hertz_mindlin, linear_spring

SOFT, HARD = Material(4.3e4, 0.32), Material(1.12e9, 0.4)
RADIUS_M, MASS_KG = 5e-3, 5e-4
BALL = Clump([[0.0, 0.0, 0.0, RADIUS_M]], MASS_KG, [0.4 * MASS_KG * RADIUS_M**2] * 3, "body")
CONVEX = Shape([[RADIUS_M] * 3], MASS_KG, [0.4 * MASS_KG * RADIUS_M**2] * 3, "body")


def row(number):
    """A clump of equal spheres in a row, nearly at one place."""
    x = np.linspace(-6e-3, 6e-3, number)
    spheres = np.column_stack([x, 0 * x, 0 * x, np.full(number, RADIUS_M)])
    return Clump(spheres, MASS_KG, [0.4 * MASS_KG * RADIUS_M**2] * 3, "body")


def study(restitution=0.3, tension="keep", law="hertz_mindlin", shape=BALL):
    """What the longest time step is computed of."""
    materials = {"body": SOFT, "wall": HARD}
    contact = Contact(restitution, 0.0, 0.0)
    contacts = pairs_of({("body", "body"): contact, ("body", "wall"): contact}, materials)
    return time_steps.Scene(CONTACT_LAWS[law], tension, materials, contacts, {"ball": shape}, frozenset({"wall"}))


def swing(shape, overlap_m, step_s, restitution, tension, monkeypatch):
    """Largest distance from the middle, in the last of many steps, of a body that began 1 um off it, over 1 um."""
    monkeypatch.setattr(time_steps, "longest", lambda *_: time_steps.Limit(1.0, ""))
    reach, contact = RADIUS_M - overlap_m, Contact(restitution, 0.0, 0.0)
    walls = {
        "low": Plane((0.0, 0.0, -reach), (0.0, 0.0, 1.0), "wall"),
        "high": Plane((0.0, 0.0, reach), (0.0, 0.0, -1.0), "wall"),
    }
    simulation = scene({"ball": shape}, contact, walls, step_s, 1, body=SOFT, wall=HARD, tension=tension)
    simulation.add("ball", (0.0, 0.0, 1e-6))
    simulation.run_steps(390)
    away = 0.0
    for _ in range(10):
        simulation.run_steps(1)
        away = max(away, abs(float(simulation.positions[0, 2])))
    return away / 1e-6


@pytest.mark.parametrize("shape", [BALL, CONVEX], ids=["clump", "smooth"])
@pytest.mark.parametrize(("restitution", "tension"), [(0.05, "release"), (0.3, "keep"), (0.9, "keep")])
def test_a_pressed_body_is_stable_up_to_the_limit_and_not_beyond(shape, restitution, tension, monkeypatch):
    overlap = 0.1 * RADIUS_M
    limit = time_steps.pressed(study(restitution, tension, shape=shape), shape, "wall", overlap_m=overlap)
    below = swing(shape, overlap, 0.97 * limit.time_step_s, restitution, tension, monkeypatch)
    beyond = swing(shape, overlap, 1.03 * limit.time_step_s, restitution, tension, monkeypatch)
    assert below < 0.01
    assert beyond > 10.0


@pytest.mark.parametrize(("law", "module"), [("hertz_mindlin", hertz_mindlin), ("linear_spring", linear_spring)])
def test_the_stiffness_is_the_slope_of_the_force(law, module):
    contact, radius, overlap, h = Contact(0.4, 0.0, 0.0), 3e-3, 2e-4, 1e-9
    stiffness, _ = module.oscillator(SOFT, HARD, contact, "keep", radius, overlap)
    first = module.constants(SOFT, HARD, contact)[0]

    def force(delta):
        return first * (math.sqrt(radius * delta) * delta if law == "hertz_mindlin" else radius * delta)

    assert stiffness == pytest.approx((force(overlap + h) - force(overlap - h)) / (2 * h), rel=1e-6)


def test_an_oscillator_of_the_damping_ratio_returns_the_restitution():
    """A linear contact that may pull: exp(-pi z / sqrt(1 - z^2)) is the speed after half a period over that before."""
    _, z = linear_spring.oscillator(SOFT, HARD, Contact(0.4, 0.0, 0.0), "keep", 3e-3, 1e-4)
    assert math.exp(-math.pi * z / math.sqrt(1.0 - z * z)) == pytest.approx(0.4, rel=1e-9)


def test_spheres_at_one_place_add_up():
    overlap = 1e-4 * RADIUS_M
    assert BALL.acting_together(overlap) == pytest.approx(1.0)
    assert row(15).acting_together(0.1 * RADIUS_M) == pytest.approx(15.0, rel=0.01)
    apart = Clump([[-1.0, 0, 0, 0.1], [1.0, 0, 0, 0.1]], 1.0, [1.0, 1.0, 1.0], "body")
    assert apart.acting_together(0.05) == pytest.approx(2.0, rel=0.02)  # seen from the side both touch
    one, many = (time_steps.pressed(study(0.9, shape=s), s, "wall", overlap_m=5e-4) for s in (row(1), row(15)))
    assert many.time_step_s == pytest.approx(one.time_step_s / math.sqrt(15.0), rel=0.02)
    assert "15.0 spheres" in many.reason


def test_the_flattest_place_of_an_ellipsoid():
    a, b, c = 10e-3, 6e-3, 4e-3
    ellipsoid = Shape.ellipsoid((a, b, c), 800.0, "body")
    assert ellipsoid.flattest_radius_m == pytest.approx(a * b / c)
    assert CONVEX.flattest_radius_m == pytest.approx(RADIUS_M)


def test_both_limits_go_with_the_scale():
    for number in (1, 40):
        shape = row(number)
        grown = Clump(3.0 * shape.spheres_m, 27.0 * shape.mass_kg, 243.0 * shape.inertia_kg_m2, "body")
        small, large = (time_steps.longest(study(0.05, "release", shape=s)) for s in (shape, grown))
        assert large.time_step_s == pytest.approx(3.0 * small.time_step_s, rel=1e-9)
        scaled = time_steps.longest(study(0.05, "release", shape=grown), smallest_scale=1.0 / 3.0)
        assert scaled.time_step_s == pytest.approx(small.time_step_s, rel=1e-9)
        assert "smallest scale, 0.333" in scaled.reason


def test_the_number_that_is_reported_is_allowed():
    for number in (1.23456e-4, 9.99999e-5, 2.5e-4, 3.0e-6):
        result = float(time_steps.Limit(number, "why").allowed.split(",")[0].removeprefix("at most "))
        assert 0.99 * number < result <= number * (1 + 1e-12)


def test_a_low_restitution_and_a_hard_wall_shorten_the_step():
    many = row(40)
    free, damped = (time_steps.longest(study(e, "release", shape=many)).time_step_s for e in (0.9, 0.05))
    assert damped < 0.5 * free
    between = time_steps.pressed(study(0.3), BALL, "body", of_body=True).time_step_s
    assert time_steps.pressed(study(0.3), BALL, "wall").time_step_s < between
