"""Settled beds of particles in a box, what the benchmarks here have in common."""

import numpy as np

from repose.dem import Contact, Material, Plane, Simulation

MATERIALS = {"berry": Material(4.3e4, 0.32), "wall": Material(1.12e9, 0.4)}
CONTACTS = {
    ("berry", "berry"): Contact(0.2, 0.6, 0.04),
    ("berry", "wall"): Contact(0.25, 0.5, 0.18),
}
DENSITY_KG_M3 = 840.47
SEMI_AXES_M = np.array([0.02114, 0.01137, 0.00988]) / 2.0
LAYERS = 12
SPACING_M = 0.0215


def side_m(count):
    """Side of the square box in which so many particles, dropped from 12 layers, lie as deep as in any other [m]."""
    return float(np.sqrt(count / LAYERS * SPACING_M**2)) + 1e-3


def bed(shape, count, time_step_s, settle_steps, threads=1, seed=1, tension="keep"):
    """Simulation of `count` bodies of a `Shape` that fell from a loose lattice, randomly turned, into a box."""
    side = side_m(count)
    columns = int(np.ceil(np.sqrt(count / LAYERS)))
    walls = {"floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall")}
    for name, k, sign in (
        ("left", 0, 1),
        ("right", 0, -1),
        ("front", 1, 1),
        ("back", 1, -1),
    ):
        normal = np.zeros(3)
        point = np.zeros(3)
        normal[k] = sign
        point[k] = 0.0 if sign > 0 else side
        walls[name] = Plane(point, normal, "wall")
    simulation = Simulation(
        {"berry": shape},
        MATERIALS,
        CONTACTS,
        time_step_s,
        capacity=count,
        lower=(0.0, 0.0, 0.0),
        upper=(side, side, SPACING_M * (LAYERS + 2)),
        walls=walls,
        threads=threads,
        tension=tension,
    )
    rng = np.random.default_rng(seed)
    spacing = np.array([(side - 1e-3) / columns, (side - 1e-3) / columns, SPACING_M])
    quaternions = rng.normal(size=(count, 4))
    # what fits between neighbours of the lattice, or spheres would stay stacked in columns
    free = max(0.0, 0.5 * spacing.min() - shape.bounding_radius_m)
    offsets = rng.uniform(-free, free, size=(count, 3))
    for k in range(count):
        layer, rest = divmod(k, columns * columns)
        place = np.array([*divmod(rest, columns), layer]) + 0.5
        simulation.add("berry", place * spacing + offsets[k], quaternions[k])
    simulation.run_steps(settle_steps)
    return simulation
