"""Ellipsoids in peclet-dem, by its Hertz-Mindlin engine; run by a Python that has the package `peclet-dem`.

`ellipsoids.py` gives the scene as JSON on stdin and reads the answer from stdout. A body is a shell of points, tested
against the signed distance of another; each point that is inside has a Hertz spring of its own.
"""

import json
import sys
import time

import numpy as np
from peclet import dem

CELLS = 48  # of the grid of distances, along each axis


def distance(points, axes):
    """Signed distance of points from an ellipsoid (n,): the nearest point by bisection of Eberly's equation."""
    p = np.abs(points) + 1e-12
    square = axes**2
    low = np.full(len(p), -square.min()) + (axes[axes.argmin()] * p[:, axes.argmin()])
    high = np.sqrt(((axes * p) ** 2).sum(axis=1))
    for _ in range(80):
        middle = 0.5 * (low + high)
        inside = ((axes * p / (middle[:, None] + square)) ** 2).sum(axis=1) < 1.0
        high = np.where(inside, middle, high)
        low = np.where(inside, low, middle)
    nearest = square * p / (0.5 * (low + high)[:, None] + square)
    sign = np.where(((p / axes) ** 2).sum(axis=1) < 1.0, -1.0, 1.0)
    return sign * np.linalg.norm(nearest - p, axis=1)


def shell(axes, count):
    """Points on the surface, as even as a spiral on the sphere."""
    k = np.arange(count) + 0.5
    up = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - up**2)
    return axes * np.column_stack([flat * np.cos(turn), flat * np.sin(turn), up])


def lattice(low, high, cells):
    """Nodes of a grid, its origin and its spacing."""
    ends = [np.linspace(a, b, n) for a, b, n in zip(low, high, cells, strict=True)]
    nodes = np.stack(np.meshgrid(*ends, indexing="ij"), -1)
    return (
        nodes,
        tuple(map(float, low)),
        tuple(float(line[1] - line[0]) for line in ends),
    )


def simulation(scene):
    """The bodies of a scene in their box, at rest or as they move."""
    axes = np.array(scene["semi_axes_m"])
    places = np.array(scene["positions_m"])
    largest = axes.max()
    sim = dem.Simulation(capacity=max(2, len(places)))
    nodes, origin, spacing = lattice(
        -1.3 * axes - 0.2 * largest, 1.3 * axes + 0.2 * largest, (CELLS,) * 3
    )
    field = distance(nodes.reshape(-1, 3), axes).reshape(nodes.shape[:3])
    moments = scene["mass_kg"] / 5.0 * (np.sum(axes**2) - axes**2)
    inverse = tuple(float(value) for value in scene["mass_kg"] / moments)
    sim.set_sdf_shape(
        np.asfortranarray(field, np.float32),
        origin,
        spacing,
        shell(axes, scene["points"]).astype(np.float32),
        inverse,
        float(1.01 * largest),
    )
    half = scene["half_width_m"]
    top = scene["top_m"]
    low = np.array([-half, -half, 0.0]) - 2.0 * largest
    high = np.array([half, half, top]) + 2.0 * largest
    sim.set_domain(tuple(map(float, low)), tuple(map(float, high)))
    sim.set_periodic(False, False, False)
    nodes, origin, spacing = lattice(low, high, (80, 80, 80))
    gaps = [nodes[..., 2], half - np.abs(nodes[..., 0]), half - np.abs(nodes[..., 1])]
    wall = np.min(gaps, axis=0)
    sim.add_sdf_wall(
        np.asfortranarray(wall, np.float32),
        origin,
        spacing,
        scene["restitution"],
        scene["friction"],
    )
    sim.set_positions(places.astype(np.float32))
    sim.set_quaternions(np.array(scene["quaternions"], np.float32)[:, [1, 2, 3, 0]])
    sim.set_scales_uniform(1.0)
    sim.set_inv_mass(np.full(len(places), 1.0 / scene["mass_kg"], np.float32))
    sim.set_inv_inertia(np.tile(1.0 / moments, (len(places), 1)).astype(np.float32))
    sim.set_velocities(np.zeros((len(places), 3), np.float32))
    sim.set_angular_velocities(np.array(scene["angular_velocities_rad_s"], np.float32))
    sim.set_gravity((0.0, 0.0, -scene["gravity_m_s2"]))
    sim.set_material_params(
        restitution_normal=scene["restitution"], friction=scene["friction"]
    )
    sim.set_hertz_material(0, scene["young_pa"], scene["poisson"])
    sim.set_dt(scene["time_step_s"])
    return sim


def main():
    """Run the scene that stdin has, and print its states."""
    scene = json.load(sys.stdin)
    states = []
    sim = simulation(scene)
    for steps in scene["steps"]:
        began = time.process_time()
        sim.step_hertz(steps)
        states.append(
            {
                "processor_s": time.process_time() - began,
                "positions_m": sim.get_positions().tolist(),
                "quaternions": sim.get_quaternions()[:, [3, 0, 1, 2]].tolist(),
                "velocities_m_s": sim.get_velocities().tolist(),
                "angular_velocities_rad_s": sim.get_angular_velocities().tolist(),
            }
        )
    print(json.dumps(states))


if __name__ == "__main__":
    main()
