"""Clumps, walls and simulations that the tests of clumps share."""

from functools import partial

import numpy as np
from dem.common import BERRY, DENSITY, GOJI, PVC, simulation

from repose.bench.funnel import Funnel
from repose.dem import Clump, Cone, Contact, Shape, Simulation

LAW = "hertz_mindlin_rescaled"
RADIUS = 0.006
FUNNEL = Funnel(0.15, 0.032, 60.0, 0.0, 0.001, 0.1)
# a bent body of five spheres of three sizes, none of them in its centre
BENT = np.array(
    [
        [-8.0, -1.5, 0.0, 3.0],
        [-4.0, 0.8, 0.5, 4.0],
        [0.5, 1.9, -0.5, 4.0],
        [4.5, 0.6, 0.6, 3.5],
        [8.0, -1.8, 0.0, 2.5],
    ]
) * 1e-3  # fmt: skip
BENT_INERTIA = np.array([1.0e-8, 3.5e-8, 3.6e-8])
MASS = 1.0e-3
CONE = Cone.between((0.0, 0.0, 0.03), (0.0, 0.0, 1.0), 0.09, 0.016, 0.07, "wall")


def bent(material="body"):
    return Clump(BENT, MASS, BENT_INERTIA, material)


def ball_of_one(radius=RADIUS, material="body", density=DENSITY):
    solid = Shape.sphere(radius, density, material)
    return Clump(
        [[0.0, 0.0, 0.0, radius]], solid.mass_kg, solid.inertia_kg_m2, material
    )


def scene(
    shapes,
    contact=None,
    walls=None,
    dt=1e-5,
    capacity=2,
    gravity=(0.0, 0.0, 0.0),
    **keywords,
):
    """Bodies of the material `body` and walls of the material `wall`; `on_wall` is their contact with these.

    Their law is that of the cases of tests/verification, which share the kernels of clumps.
    """
    contact = contact or Contact(0.3, 0.5, 0.02)
    contacts = {
        ("body", "body"): contact,
        ("body", "wall"): keywords.pop("on_wall", None) or contact,
    }
    materials = {"body": keywords.pop("body", GOJI), "wall": keywords.pop("wall", PVC)}
    keywords = {
        "lower": (-0.1, -0.1, -0.1),
        "upper": (0.1, 0.1, 0.2),
        "gravity_m_s2": gravity,
        "contact_law": LAW,
    } | keywords
    return Simulation(
        shapes, materials, contacts, dt, capacity=capacity, walls=walls, **keywords
    )


BODIES = {
    "berry": partial(simulation, BERRY),
    "clump": partial(scene, {"bent": bent()}),
}
