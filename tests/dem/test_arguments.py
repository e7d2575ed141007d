"""Every wrong argument is named, with its value and what is allowed."""

import math

import numpy as np
from refusals import not_refused, value_error

from repose.dem import (
    Cone,
    Contact,
    Cylinder,
    Material,
    Motion,
    Plane,
    RingEdge,
    Shape,
    Simulation,
)

FLESH = Material(4.3e4, 0.32)
LAW = Contact(0.3, 0.5, 0.02)
BALL = Shape.sphere(0.006, 840.0, "flesh")
FLOOR = Plane((0, 0, 0), (0, 0, 1), "flesh")
GOOD = {
    "shapes": {"ball": BALL},
    "materials": {"flesh": FLESH},
    "contacts": {("flesh", "flesh"): LAW},
    "time_step_s": 1e-4,
    "capacity": 2,
    "lower": (-0.1, -0.1, 0.0),
    "upper": (0.1, 0.1, 0.1),
    "walls": {"floor": FLOOR},
}


def test_a_simulation_says_what_it_is_and_the_smallest_scale_is_that_of_the_time_step():
    simulation = Simulation(**GOOD)
    assert (
        repr(simulation)
        == "<Simulation: 0 bodies, 1 walls, hertz_mindlin, budget, 0 s>"
    )
    smallest = 1e-4 / simulation.longest_time_step()
    simulation.add("ball", (0, 0, 0.01), scale=1.0001 * smallest)
    value_error(
        "scale is ", simulation.add, "ball", (0, 0, 0.05), scale=0.999 * smallest
    )


def test_simulation():
    cases = [
        ({"shapes": {}}, "shapes is empty; expected names, each with a Shape"),
        ({"shapes": [BALL]}, r"shapes is \[.*expected names, each with a Shape"),
        (
            {"shapes": {"ball": 3}},
            "shapes is {'ball': 3}; expected names, each with a Shape",
        ),
        (
            {"materials": {"flesh": 1.0}},
            "materials is .*expected names, each with a Material",
        ),
        (
            {"materials": {"skin": FLESH}, "contacts": {}},
            "material is 'flesh'; expected skin",
        ),
        ({"contacts": {}}, r"contacts has no pair \('flesh', 'flesh'\); every pair"),
        (
            {"contacts": {"flesh": LAW}},
            r"contacts has 'flesh'.*expected \(material, material\): Contact",
        ),
        (
            {"contacts": {("flesh", "stone"): LAW}},
            r"contacts has \('flesh', 'stone'\); expected pairs of flesh",
        ),
        (
            {"contacts": None},
            r"contacts is None; expected \(material, material\): Contact",
        ),
        (
            {"time_step_s": 1.0},
            r"time_step_s is 1\.0; expected above 0, at most 0\.000",
        ),
        ({"time_step_s": "short"}, "time_step_s is 'short'; expected above 0"),
        ({"time_step_s": math.nan}, "time_step_s is nan; expected above 0"),
        ({"capacity": 0}, "capacity is 0; expected a whole number, 1 or more"),
        ({"capacity": 2.5}, r"capacity is 2\.5; expected a whole number"),
        ({"capacity": True}, "capacity is True; expected a whole number"),
        ({"lower": (0, 0)}, r"lower is \(0, 0\); expected three finite numbers"),
        ({"upper": (0.1, 0.1, math.inf)}, "upper is .*expected three finite numbers"),
        ({"upper": (0.1, -0.2, 0.1)}, "lower below upper in every direction"),
        (
            {"gravity_m_s2": 9.81},
            r"gravity_m_s2 is 9\.81; expected three finite numbers",
        ),
        ({"tension": "maybe"}, "tension is 'maybe'; expected 'keep', 'release', 'cut'"),
        (
            {"friction_limit": "both"},
            "friction_limit is 'both'; expected 'elastic', 'total'",
        ),
        ({"largest_scale": 0}, "largest_scale is 0; expected above 0"),
        ({"largest_scale": math.inf}, "largest_scale is inf; expected above 0"),
        (
            {"exit_height_m": math.nan},
            "exit_height_m is nan; expected a number, or -inf",
        ),
        ({"floor_height_m": "low"}, "floor_height_m is 'low'; expected a number"),
        (
            {"curved_walls_above_m": None},
            "curved_walls_above_m is None; expected a number",
        ),
        (
            {"walls": {"floor": "wood"}},
            "walls is .*expected names, each with a Plane, Cone",
        ),
        (
            {"walls": {"floor": Plane((0, 0, 0), (0, 0, 1), "wood")}},
            "material is 'wood'; expected flesh",
        ),
    ]
    assert not not_refused(
        lambda changes: Simulation(**{**GOOD, **changes}), cases, ValueError
    )


def test_shapes_materials_and_walls():
    cases = [
        (
            lambda: Shape([[1, 2]], 1.0, (1, 1, 1), "a"),
            r"semi_axes_m is \[\[1, 2\]\]; expected \(1 to 3, 3\)",
        ),
        (
            lambda: Shape([[1, 2, 3], [1]], 1.0, (1, 1, 1), "a"),
            r"semi_axes_m is .*expected \(1 to 3, 3\)",
        ),
        (
            lambda: Shape(np.ones((4, 3)), 1.0, (1, 1, 1), "a"),
            r"expected \(1 to 3, 3\) lengths above 0",
        ),
        (
            lambda: Shape((1, 2, math.inf), 1.0, (1, 1, 1), "a"),
            "semi_axes_m is .*lengths above 0",
        ),
        (
            lambda: Shape((1, 1, 1), 0.0, (1, 1, 1), "a"),
            r"mass_kg is 0\.0; expected above 0",
        ),
        (
            lambda: Shape((1, 1, 1), 1.0, (1, 1), "a"),
            r"inertia_kg_m2 is \(1, 1\); expected three moments",
        ),
        (
            lambda: Shape((1, 1, 1), 1.0, (1, 1, 3), "a"),
            "inertia_kg_m2 is .*each at most the sum of the others",
        ),
        (
            lambda: Shape((1, 1, 1), 1.0, (1, 1, 1), None),
            "material is None; expected a name",
        ),
        (
            lambda: Shape.ellipsoid((1, -1, 1), 1.0, "a"),
            r"semi_axes_m is \(1, -1, 1\); expected three lengths",
        ),
        (
            lambda: Shape.ellipsoid((1, 1, 1), "heavy", "a"),
            "density_kg_m3 is 'heavy'; expected above 0",
        ),
        (lambda: Shape.sphere(0, 1.0, "a"), "radius_m is 0; expected above 0"),
        (lambda: Material(0.0, 0.3), r"shear_modulus_pa is 0\.0; expected above 0"),
        (
            lambda: Material(1.0, 0.6),
            r"poisson_ratio is 0\.6; expected above -1, at most 0\.5",
        ),
        (
            lambda: Contact(1.5, 0.1, 0.1),
            r"restitution is 1\.5; expected above 0, at most 1",
        ),
        (
            lambda: Contact(0.0, 0.1, 0.1),
            r"restitution is 0\.0; expected above 0, at most 1",
        ),
        (lambda: Contact(0.5, 0.1, -1), "rolling_friction is -1"),
        (
            lambda: Contact(0.5, math.inf, 0.1),
            "static_friction is inf; expected 0 or more",
        ),
        (
            lambda: Contact(0.5, 0.1, "much"),
            "rolling_friction is 'much'; expected 0 or more",
        ),
        (
            lambda: Plane((0, 0), (0, 0, 1), "a"),
            r"point_m is \(0, 0\); expected three finite numbers",
        ),
        (
            lambda: Plane((0, 0, 0), (0, 0, 0), "a"),
            r"normal is \(0, 0, 0\); expected a vector that is not zero",
        ),
        (
            lambda: Plane((0, 0, 0), (0, 0, 1), "a", -1.0),
            r"radius_m is -1\.0; expected above 0",
        ),
        (
            lambda: Plane((0, 0, 0), (0, 0, 1), "a", motion=(0, 0, 1)),
            "motion is .*expected a Motion",
        ),
        (lambda: Plane((0, 0, 0), (0, 0, 1), 7), "material is 7; expected a name"),
        (
            lambda: Motion(velocity_m_s=(0, "up", 0)),
            "velocity_m_s is .*expected three finite numbers",
        ),
        (
            lambda: Motion(angular_velocity_rad_s=3.0),
            r"angular_velocity_rad_s is 3\.0; expected three",
        ),
        (
            lambda: Cylinder((0, 0, 0), (0, 0, 1), 0.1, 0.0, "a"),
            r"radius_m is 0\.0; expected above 0",
        ),
        (
            lambda: Cylinder((0, 0, 0), (0, 0, 1), -1, 0.1, "a"),
            "height_m is -1; expected above 0",
        ),
        (
            lambda: Cylinder((0, 0, 0), (0, 0), 1, 0.1, "a"),
            r"axis is \(0, 0\); expected three finite",
        ),
        (
            lambda: Cone.between((0, 0, 0), (0, 0, 1), 1, -0.1, 1, "a"),
            r"base_radius_m is -0\.1; expected 0 or",
        ),
        (
            lambda: Cone.between((0, 0, 0), (0, 0, 1), 1, 0, 0, "a"),
            "expected at most one of them",
        ),
        (
            lambda: Cone((1, 0, 0.1, 1, 0, 0, 1), "a"),
            "line is .*first below last place",
        ),
        (
            lambda: RingEdge(0.1, 0.2, "a"),
            r"radius_m is 0\.1; expected above edge_radius_m, 0\.2",
        ),
        (lambda: RingEdge(0.1, 0.0, "a"), r"edge_radius_m is 0\.0; expected above 0"),
        (
            lambda: RingEdge(0.1, 0.01, "a", gates=(1, 2)),
            "gates is .*expected two directions",
        ),
    ]
    assert not not_refused(lambda make: make(), cases, ValueError)


def test_add_leaves_nothing_behind():
    simulation = Simulation(**GOOD)

    def add(arguments):
        simulation.add(**{"shape": "ball", "position_m": (0, 0, 0.01), **arguments})

    cases = [
        ({"shape": "cube"}, "shape is 'cube'; expected 'ball'"),
        (
            {"position_m": (0, 0)},
            r"position_m is \(0, 0\); expected three finite numbers",
        ),
        (
            {"position_m": (0, 0, math.nan)},
            "position_m is .*expected three finite numbers",
        ),
        (
            {"quaternion": (0, 0, 0, 0)},
            r"quaternion is \(0, 0, 0, 0\); expected a vector that is not zero",
        ),
        (
            {"quaternion": (1, 0, 0)},
            r"quaternion is \(1, 0, 0\); expected four finite numbers",
        ),
        ({"velocity_m_s": 1.0}, r"velocity_m_s is 1\.0; expected three finite numbers"),
        (
            {"angular_velocity_rad_s": (1, 2, math.inf)},
            "angular_velocity_rad_s is .*three finite numbers",
        ),
        ({"scale": 1.5}, r"scale is 1\.5; expected .*at most largest_scale, 1$"),
        (
            {"scale": 0.01},
            r"scale is 0\.01; expected at least 0\.\d+, or time_step_s is too long",
        ),
        ({"scale": "big"}, "scale is 'big'; expected at least"),
    ]
    assert not not_refused(add, cases, ValueError)
    assert simulation.n_bodies == 0
    full = Simulation(**GOOD)
    for x in (-0.05, 0.05):
        full.add("ball", (x, 0.0, 0.01))
    value_error(
        "capacity is 2; body 3 does not fit", full.add, "ball", (0.0, 0.0, 0.01)
    )
    assert not simulation.bodies.rows[0, :10].any()


def test_set_motion_and_runs():
    simulation = Simulation(**GOOD)
    cases = [
        (
            lambda: simulation.set_motion("lid", Motion()),
            "wall is 'lid'; expected floor",
        ),
        (
            lambda: simulation.set_motion("floor", (0, 0, 1)),
            r"motion is \(0, 0, 1\); expected a Motion",
        ),
        (
            lambda: simulation.run_steps(1.5),
            r"steps is 1\.5; expected a whole number, 0 or more",
        ),
        (
            lambda: simulation.run_steps(-1),
            "steps is -1; expected a whole number, 0 or more",
        ),
        (lambda: simulation.run(-1.0), r"seconds is -1\.0; expected 0 or more"),
        (lambda: simulation.run(math.inf), "seconds is inf; expected 0 or more"),
        (
            lambda: simulation.run(1.0, "bar"),
            "progress is 'bar'; expected None, False, or a function",
        ),
        (
            lambda: simulation.run(1.0, record=3, record_every_s=0.1),
            "record is 3; expected a function",
        ),
        (
            lambda: simulation.run(1.0, record=print),
            "record_every_s is None; expected above 0",
        ),
        (
            lambda: simulation.run(1.0, record=print, record_every_s=0),
            "record_every_s is 0; expected above 0",
        ),
        (
            lambda: simulation.run(1.0, checkpoint="a", every_s=0),
            "every_s is 0; expected above 0",
        ),
        (
            lambda: simulation.longest_time_step(0.0),
            r"speed_m_s is 0\.0; expected above 0",
        ),
    ]
    assert not not_refused(lambda call: call(), cases, ValueError)
    assert simulation.steps == 0
