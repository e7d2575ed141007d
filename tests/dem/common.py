"""Bodies and simulations the engine's tests share."""

import numpy as np

from repose.dem import Contact, Material, Simulation, walls_of

GOJI = Material(4.3e4, 0.32)
PVC = Material(1.12e9, 0.4)
BERRY = np.array([[0.02114, 0.01137, 0.00988]]) / 2.0
BARREL = np.array([[7.399, 0.940, 0.940], [3.171, 4.745, 4.000]]) * 1e-3
DENSITY = 840.47


def ellipsoid_inertia(mass, semi_axes):
    """Principal moments of a solid ellipsoid."""
    a, b, c = semi_axes
    return mass / 5.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])


def simulation(semi_axes=BERRY, contact=None, wall_contact=None, walls=None, dt=1e-5, capacity=2, **keywords):
    """A small simulation without gravity unless asked for."""
    axes = np.atleast_2d(semi_axes)
    whole = axes.sum(axis=0)
    mass = DENSITY * 4.0 / 3.0 * np.pi * whole.prod()
    keywords.setdefault("gravity_m_s2", (0.0, 0.0, 0.0))
    contact = contact or Contact(0.3, 0.5, 0.0)
    return Simulation(
        capacity,
        axes,
        mass,
        ellipsoid_inertia(mass, whole),
        GOJI,
        PVC,
        contact,
        wall_contact or contact,
        walls or walls_of(),
        dt,
        keywords.pop("lower", (-0.1, -0.1, -0.1)),
        keywords.pop("upper", (0.1, 0.1, 0.1)),
        **keywords,
    )


def random_quaternion(rng):
    """A uniformly random orientation."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def random_direction(rng):
    """A uniformly random unit vector."""
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)
