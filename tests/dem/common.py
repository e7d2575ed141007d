"""Bodies and simulations the engine's tests share."""

import numpy as np

from repose.dem import Contact, Material, Shape, Simulation

GOJI = Material(4.3e4, 0.32)
PVC = Material(1.12e9, 0.4)
BERRY = np.array([[0.02114, 0.01137, 0.00988]]) / 2.0
BARREL = np.array([[7.399, 0.940, 0.940], [3.171, 4.745, 4.000]]) * 1e-3
DENSITY = 840.47


class OneShape(Simulation):
    @property
    def mass_kg(self):
        return self.shapes["body"].mass_kg

    def add(self, *arguments, **keywords):
        return super().add("body", *arguments, **keywords)


def simulation(semi_axes=BERRY, contact=None, wall_contact=None, walls=None, dt=1e-5, capacity=2, **keywords):
    axes = np.atleast_2d(semi_axes)
    solid = Shape.ellipsoid(axes.sum(axis=0), DENSITY, "body")
    corners = {"lower": (-0.1, -0.1, -0.1), "upper": (0.1, 0.1, 0.1)}
    keywords = {"gravity_m_s2": (0.0, 0.0, 0.0)} | corners | keywords
    contact = contact or Contact(0.3, 0.5, 0.0)
    shapes = {"body": Shape(axes, solid.mass_kg, solid.inertia_kg_m2, "body")}
    contacts = {("body", "body"): contact, ("body", "wall"): wall_contact or contact}
    return OneShape(shapes, {"body": GOJI, "wall": PVC}, contacts, dt, capacity=capacity, walls=walls, **keywords)


def random_direction(rng):
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)
