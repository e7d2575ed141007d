"""How the cost of a step grows with the number of berries, and with threads: settled beds of equal depth.

    python benchmarks/scale.py --berries 500 5000 50000 --threads 1 2

Prints one row a bed: contacts a berry, time a step, time a contact and step and its ratio to the first bed, memory of
the process. Beds are made anew: berries fall from a loose lattice into a box and come to rest.
"""

import argparse
import resource
import time

import numpy as np

from repose.dem import Contact, Material, Plane, Shape, Simulation

SEMI_AXES_M = np.array([0.02114, 0.01137, 0.00988]) / 2.0
DENSITY_KG_M3 = 840.47
LAYERS = 12
SPACING_M = 0.0215
SETTLE_STEPS, TIMED_STEPS, REPEATS = 4000, 200, 5
TIME_STEP_S = 2e-4


def bed(berries, threads, seed=1):
    """A box of berries at rest."""
    side = np.sqrt(berries / LAYERS * SPACING_M**2)
    columns = int(np.ceil(np.sqrt(berries / LAYERS)))
    top = SPACING_M * (LAYERS + 2)
    walls = {"floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall")}
    for name, k, sign in (("left", 0, 1), ("right", 0, -1), ("front", 1, 1), ("back", 1, -1)):
        normal, point = np.zeros(3), np.zeros(3)
        normal[k], point[k] = sign, 0.0 if sign > 0 else side + 1e-3
        walls[name] = Plane(point, normal, "wall")
    simulation = Simulation(
        {"berry": Shape.ellipsoid(SEMI_AXES_M, DENSITY_KG_M3, "berry")},
        {"berry": Material(4.3e4, 0.32), "wall": Material(1.12e9, 0.4)},
        {("berry", "berry"): Contact(0.2, 0.6, 0.04), ("berry", "wall"): Contact(0.25, 0.5, 0.18)},
        TIME_STEP_S,
        capacity=berries,
        lower=(0.0, 0.0, 0.0),
        upper=(side, side, top),
        walls=walls,
        threads=threads,
    )
    rng = np.random.default_rng(seed)
    for k in range(berries):
        layer, rest = divmod(k, columns * columns)
        place = (np.array([*divmod(rest, columns), layer]) + 0.5) * [
            side / columns,
            side / columns,
            SPACING_M,
        ]
        simulation.add("berry", place, rng.normal(size=4))
    simulation.run_steps(SETTLE_STEPS)
    return simulation


def time_step_us(simulation):
    """Median time of a step [us]."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        simulation.run_steps(TIMED_STEPS)
        times.append((time.perf_counter() - began) / TIMED_STEPS)
    return 1e6 * float(np.median(times))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--berries", type=int, nargs="+", default=[500, 5000, 50000])
    parser.add_argument("--threads", type=int, nargs="+", default=[1])
    arguments = parser.parse_args()
    print("berries  threads  contacts/berry  us/step  ns/contact  ratio  peak MB")
    first = None
    for berries in arguments.berries:
        simulation = bed(berries, arguments.threads[0])
        for threads in arguments.threads:
            simulation.threads = threads
            us = time_step_us(simulation)
            contacts = len(simulation.contacts())
            cost = 1e3 * us / contacts
            first = first or cost
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(
                f"{berries:7d}  {threads:7d}  {2 * contacts / berries:14.2f}  {us:7.1f}  {cost:10.2f}"
                f"  {cost / first:5.2f}  {memory:7.0f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
