"""How the cost of a step grows with the number of berries, and with threads: settled beds of equal depth.

    python benchmarks/scale.py --berries 500 5000 50000 --threads 1 2

Prints one row a bed: contacts a berry, time a step, time a contact and step and its ratio to the first bed, memory of
the process. Beds are made anew: berries fall from a loose lattice into a box and come to rest.
"""

import argparse
import resource
import time

import numpy as np
from beds import DENSITY_KG_M3, SEMI_AXES_M, bed

from repose.dem import Shape

SETTLE_STEPS = 4000
TIMED_STEPS = 200
REPEATS = 5
TIME_STEP_S = 2e-4


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
    berry = Shape.ellipsoid(SEMI_AXES_M, DENSITY_KG_M3, "berry")
    for berries in arguments.berries:
        simulation = bed(
            berry, berries, TIME_STEP_S, SETTLE_STEPS, arguments.threads[0]
        )
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
