"""No grain leaves a closed vessel, however it leans where two walls meet."""

import math
from functools import partial

import numpy as np
import pytest
from dem.clump_scenes import BODIES
from dem.common import BARREL, DOWN, GOJI, simulation

from repose.bench.funnel import Funnel
from repose.dem import (
    Contact,
    Cylinder,
    Material,
    Mesh,
    Plane,
    Simulation,
    random_quaternion,
)

UP = (0.0, 0.0, 1.0)
STEP_S = 2.5e-4
RADIUS_M = 0.0109  # bounding radius of the largest body
OUTLET_M = 0.016  # radius of the closed outlet
INLET_M = 0.075
RIM_M = 0.001
PARTICLES = BODIES | {
    "smooth": partial(simulation, BARREL),
    "sphere": partial(simulation, np.full((1, 3), 0.006)),
}
LID = Plane((0.0, 0.0, 0.0), UP, "wall", OUTLET_M)


def mesh_funnel(slope_deg):
    """The cone as triangles, its open border rounded, about the lid."""
    n = 24
    angles = 2.0 * math.pi * np.arange(n) / n
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(n)])
    top = [0.0, 0.0, (INLET_M - OUTLET_M) * math.tan(math.radians(slope_deg))]
    vertices = np.vstack([OUTLET_M * circle, INLET_M * circle + top])
    after = (np.arange(n) + 1) % n
    k = np.arange(n)
    faces = np.vstack(
        [
            np.column_stack([k, n + k, n + after]),
            np.column_stack([k, n + after, after]),
        ]
    )
    return Mesh(vertices, faces, "wall", 0.5 * RIM_M)


def vessel(name, slope_deg):
    """Walls of a closed vessel, and the circle where a lid or collar meets its cone."""
    tube_m = 0.02 if name == "tube" else 0.0
    inlet_m = 0.03 if name == "collar" else INLET_M
    funnel = Funnel(2 * inlet_m, 2 * OUTLET_M, slope_deg, tube_m, RIM_M, 0.0)
    walls = {"lid": LID}
    if name == "mesh":
        return walls | {"funnel": mesh_funnel(slope_deg)}, OUTLET_M, 0.0
    walls |= funnel.walls("wall")
    if name == "collar":
        inlet = (0.0, 0.0, funnel.inlet_height_m)
        walls["collar"] = Cylinder(inlet, UP, 0.1, inlet_m, "wall")
        return walls, inlet_m, funnel.inlet_height_m
    return walls, OUTLET_M, funnel.neck_height_m


def number_lost(name, particle, slope_deg, count, seed, body=GOJI):
    """Drop single grains, spinning, about the circle; how many leave the vessel."""
    rng = np.random.default_rng([seed, round(slope_deg)])
    walls, circle_m, height_m = vessel(name, slope_deg)
    slope = math.radians(slope_deg)
    lost = 0
    for _ in range(count):
        s = PARTICLES[particle](
            contact=Contact(0.4, 0.5, 0.05),
            walls=walls,
            dt=STEP_S,
            capacity=1,
            gravity_m_s2=DOWN,
            lower=(-0.2, -0.2, -0.1),
            upper=(0.2, 0.2, 0.6),
            body=body,
        )
        widest = circle_m - RADIUS_M if name == "collar" else 1.5 * circle_m
        r = rng.uniform(0.3 * circle_m, widest)
        angle = rng.uniform(0.0, 2.0 * math.pi)
        # clear of the cone
        above = max(
            (r - circle_m) * math.tan(slope) + RADIUS_M / math.cos(slope), 0.012
        )
        z = height_m + above + rng.uniform(0.0, 0.02)
        velocity = [*rng.uniform(-0.3, 0.3, 2), -rng.uniform(0.0, 1.5)]
        Simulation.add(
            s,
            *s.shapes,
            (r * math.cos(angle), r * math.sin(angle), z),
            random_quaternion(rng),
            velocity,
            30.0 * rng.normal(size=3),
        )
        s.run_steps(1600)
        x, y, z = s.positions[0]
        inside = z > 0.0 and math.hypot(x, y) < INLET_M
        lost += not (inside and s.present[0])
    return lost


@pytest.mark.parametrize("particle", PARTICLES)
def test_a_closed_lid_lets_no_grain_through(particle):
    assert number_lost("funnel", particle, 30.0, 25, seed=1) == 0


@pytest.mark.parametrize("name", ["tube", "collar", "mesh"])
def test_no_grain_passes_where_other_walls_meet(name):
    assert number_lost(name, "berry", 30.0, 25, seed=2) == 0


def test_a_soft_grain_that_leans_on_the_rim_slides_onto_the_lid():
    """Its lowest point is beyond the lid, and below it, before it is on the lid."""
    soft = Material(1e4, GOJI.poisson_ratio)
    assert number_lost("funnel", "smooth", 30.0, 60, seed=3, body=soft) == 0


@pytest.mark.slow
@pytest.mark.parametrize("slope_deg", [30.0, 40.0, 50.0, 60.0, 75.0])
@pytest.mark.parametrize("particle", PARTICLES)
def test_no_grain_of_thousands_passes_a_lid(particle, slope_deg):
    assert number_lost("funnel", particle, slope_deg, 150, seed=4) == 0


@pytest.mark.slow
@pytest.mark.parametrize("slope_deg", [30.0, 50.0, 75.0])
@pytest.mark.parametrize("name", ["tube", "collar", "mesh"])
@pytest.mark.parametrize("particle", PARTICLES)
def test_no_grain_of_hundreds_passes_where_other_walls_meet(particle, name, slope_deg):
    assert number_lost(name, particle, slope_deg, 30, seed=5) == 0
