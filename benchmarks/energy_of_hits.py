"""How often, and by how much, single hits on walls gain energy, by restitution: the table of docs/verification.md.

python benchmarks/energy_of_hits.py [--hits 2000] [--step 2.5e-4] [--friction 0] [--body ellipsoid]

A spinning body is thrown at a plate, the inside of a funnel's cone, the funnel's outlet, and the edges of a cube
(a mesh). Its kinetic energy when it has left again is compared with that before; a body that still touches is left out.
"""

import argparse
import itertools

import numpy as np

from repose import dem
from repose.bench.funnel import Funnel

FUNNEL = Funnel(0.15, 0.032, 60.0, 0.0, 0.001, 0.1)
BERRY_M = np.array([0.01057, 0.005685, 0.00494])
SPHERE_M = np.full(3, 0.006)
HALF = 0.02  # of the cube's edge [m]
UP = (0.0, 0.0, 1.0)
RESTITUTIONS = (0.4, 0.6, 0.8, 0.9, 1.0)
ROUNDING = 1e-5


def cube():
    """The cube as a mesh wall."""
    corners = np.array(list(itertools.product((-HALF, HALF), repeat=3)))
    faces = [
        (0, 1, 3),
        (0, 3, 2),
        (4, 6, 7),
        (4, 7, 5),
        (0, 4, 5),
        (0, 5, 1),
        (2, 3, 7),
        (2, 7, 6),
        (0, 2, 6),
        (0, 6, 4),
        (1, 5, 7),
        (1, 7, 3),
    ]
    return dem.Mesh(corners, np.array(faces), "wall", 0.001)


def throw(rng, wall):
    """Walls, place, velocity and duration of one throw."""
    bottom = FUNNEL.outlet_height_m
    if wall == "plate":
        velocity = [*rng.uniform(-0.5, 0.5, 2), -rng.uniform(0.2, 1.2)]
        plate = dem.Plane((0.0, 0.0, 0.0), UP, "wall")
        return {"plate": plate}, (0.0, 0.0, 0.013), velocity, 0.06
    if wall == "cone":
        velocity = [*rng.uniform(-1.2, 1.2, 2), -rng.uniform(0.24, 0.6)]
        return FUNNEL.walls("wall"), (0.0, 0.0, bottom + 0.06), velocity, 0.05
    if wall == "outlet":
        place = (*rng.uniform(-0.006, 0.006, 2), bottom + 0.028)
        velocity = [*rng.uniform(-0.5, 0.5, 2), -rng.uniform(0.6, 1.5)]
        return FUNNEL.walls("wall"), place, velocity, 0.05
    # an upright edge of the cube
    edge = np.array([HALF, HALF, rng.uniform(-0.8, 0.8) * HALF])
    aim = edge + 0.004 * rng.normal(size=3)
    away = np.array([1.0, 1.0, 0.0]) + 0.5 * rng.normal(size=3)
    away /= np.linalg.norm(away)
    return {"cube": cube()}, aim + 0.035 * away, -rng.uniform(0.3, 1.2) * away, 0.09


def ratio(rng, wall, axes, contact, step):
    """Energy after a throw over that before; None where the body touched nothing, or touches still."""
    walls, place, velocity, seconds = throw(rng, wall)
    simulation = dem.Simulation(
        {"body": dem.Shape.ellipsoid(axes, 840.47, "body")},
        {"body": dem.Material(4.3e4, 0.32), "wall": dem.Material(1.12e9, 0.4)},
        {("body", "body"): contact, ("body", "wall"): contact},
        step,
        capacity=1,
        lower=(-0.1, -0.1, -0.1),
        upper=(0.1, 0.1, 0.3),
        walls=walls,
        gravity_m_s2=(0.0, 0.0, 0.0),
        tension="release",
        friction_limit="total",
    )
    simulation.add(
        "body", place, dem.random_quaternion(rng), velocity, 30.0 * rng.normal(size=3)
    )
    before = simulation.kinetic_energies()[0]
    momentum = simulation.velocities[0].copy()
    simulation.run_steps(round(seconds / step))
    if len(simulation.wall_overlaps()[0]) or np.allclose(
        simulation.velocities[0], momentum, atol=1e-12
    ):
        return None
    return simulation.kinetic_energies()[0] / before


def main():
    """Print one line for each wall and restitution."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--hits", type=int, default=2000)
    options.add_argument("--step", type=float, default=2.5e-4, help="[s]")
    options.add_argument("--friction", type=float, default=0.0)
    options.add_argument("--body", choices=("ellipsoid", "sphere"), default="ellipsoid")
    arguments = options.parse_args()
    axes = BERRY_M if arguments.body == "ellipsoid" else SPHERE_M
    print("wall     e    hits  gain %  above 5 %  most %")
    for wall in ("plate", "cone", "outlet", "mesh"):
        for e in RESTITUTIONS:
            rng = np.random.default_rng(9)
            found = []
            contact = dem.Contact(e, arguments.friction, 0.0)
            while len(found) < arguments.hits:
                hit_ratio = ratio(rng, wall, axes, contact, arguments.step)
                if hit_ratio is not None:
                    found.append(hit_ratio)
            gain = 100.0 * (np.array(found) - 1.0)
            shares = [
                100.0 * np.mean(gain > limit) for limit in (100.0 * ROUNDING, 5.0)
            ]
            print(
                f"{wall:7s} {e:.1f} {len(found):6d} {shares[0]:7.2f} {shares[1]:9.2f} {gain.max():+8.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
