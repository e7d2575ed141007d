"""A step of clumps of spheres beside a step of smooth ellipsoids of the same size, in settled beds.

    python benchmarks/clumps.py --berries 500 --spheres 14

The two simulations have their turns in one process, one after the other. Prints for each the time of a step while
bodies fall and meet and in the settled bed (median over the turns), the touching pairs and the contacts of spheres,
and the ratios.
"""

import argparse
import time

import numpy as np
from beds import DENSITY_KG_M3, SEMI_AXES_M, bed

from repose.dem import Clump, Shape

TIME_STEP_S = 1e-4
SETTLE_STEPS = 8000
TIMED_STEPS = 500
ROUNDS = 11


def filled_ellipsoid(semi_axes_m, spheres, density_kg_m3, material):
    """An ellipsoid, the longest axis first, filled with two rows of spheres side by side; its own mass and moments."""
    a, b, c = semi_axes_m
    x = 0.8 * a * np.linspace(-1.0, 1.0, spheres // 2)
    width = np.sqrt(1.0 - (x / a) ** 2)
    radius = 0.9 * c * width
    y = np.maximum(b * width - radius, 0.0)
    rows = [
        np.column_stack([x, side * y, np.zeros_like(x), radius]) for side in (-1.0, 1.0)
    ]
    solid = Shape.ellipsoid(semi_axes_m, density_kg_m3, material)
    return Clump(np.concatenate(rows), solid.mass_kg, solid.inertia_kg_m2, material)


def timed_us(simulation, steps):
    """Time of a step, the mean over so many [us]."""
    began = time.perf_counter()
    simulation.run_steps(steps)
    return 1e6 * (time.perf_counter() - began) / steps


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--berries", type=int, default=500)
    parser.add_argument("--spheres", type=int, default=14)
    arguments = parser.parse_args()
    shapes = {
        "ellipsoids": Shape.ellipsoid(SEMI_AXES_M, DENSITY_KG_M3, "berry"),
        "clumps": filled_ellipsoid(
            SEMI_AXES_M, arguments.spheres, DENSITY_KG_M3, "berry"
        ),
    }
    beds = {
        name: bed(shape, arguments.berries, TIME_STEP_S, 10)
        for name, shape in shapes.items()
    }
    falling = {
        name: timed_us(simulation, SETTLE_STEPS) for name, simulation in beds.items()
    }
    times = {name: [] for name in beds}
    for _ in range(ROUNDS):
        for name, simulation in beds.items():
            times[name].append(timed_us(simulation, TIMED_STEPS))
    print(
        "bodies      falling us/step  settled us/step  pairs  sphere contacts  energy J"
    )
    for name, simulation in beds.items():
        spheres = len(simulation.sphere_contacts()[0])
        print(
            f"{name:10s}  {falling[name]:15.1f}  {np.median(times[name]):15.1f}  {len(simulation.contacts()):5d}"
            f"  {spheres:15d}  {simulation.kinetic_energies().sum():.0e}"
        )
    turns = np.array(times["clumps"]) / np.array(times["ellipsoids"])
    print(
        f"clumps over ellipsoids: falling {falling['clumps'] / falling['ellipsoids']:.2f}, settled "
        f"{np.median(turns):.2f} (median of {ROUNDS} turns, {turns.min():.2f} to {turns.max():.2f})"
    )


if __name__ == "__main__":
    main()
