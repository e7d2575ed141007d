"""How the cost of a step grows with the number of berries, and with threads: settled beds of equal depth.

    python benchmarks/scale.py --berries 500 5000 50000 --threads 1 2

Prints one row a bed: contacts a berry, time a step, time a contact and step and its ratio to the first bed, memory of
the process. Beds are made anew: berries fall from a loose lattice into a box and come to rest.
"""

import argparse
import math
import resource
import time
from dataclasses import dataclass

import numpy as np
from beds import DENSITY_KG_M3, SEMI_AXES_M, bed

from repose.dem import Shape

SETTLE_STEPS = 4000
TIMED_STEPS = 200
REPEATS = 5
TIME_STEP_S = 2e-4


@dataclass(frozen=True)
class Row:
    """A bed with a number of threads."""

    berries: int
    threads: int
    contacts: int
    step_us: float
    memory_mb: float  # the peak of this process so far

    @property
    def contact_ns(self):
        """Time of a contact and step [ns]."""
        return 1e3 * self.step_us / self.contacts if self.contacts else math.nan


def time_step_us(simulation, timed_steps=TIMED_STEPS):
    """Median time of a step [us]."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        simulation.run_steps(timed_steps)
        times.append((time.perf_counter() - began) / timed_steps)
    return 1e6 * float(np.median(times))


def settled_bed(berries, threads=1, settle_steps=SETTLE_STEPS):
    """A bed of so many berries after so many steps of fall."""
    berry = Shape.ellipsoid(SEMI_AXES_M, DENSITY_KG_M3, "berry")
    return bed(berry, berries, TIME_STEP_S, settle_steps, threads)


def row_of(simulation, berries, threads, timed_steps=TIMED_STEPS):
    """Time a bed with a number of threads."""
    simulation.threads = threads
    step_us = time_step_us(simulation, timed_steps)
    peak_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return Row(
        berries=berries,
        threads=threads,
        contacts=len(simulation.contacts()),
        step_us=step_us,
        memory_mb=peak_kb / 1024,
    )


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
        simulation = settled_bed(berries, arguments.threads[0])
        for threads in arguments.threads:
            row = row_of(simulation, berries, threads)
            first = first or row.contact_ns
            print(
                f"{berries:7d}  {threads:7d}  {2 * row.contacts / berries:14.2f}  {row.step_us:7.1f}"
                f"  {row.contact_ns:10.2f}  {row.contact_ns / first:5.2f}  {row.memory_mb:7.0f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
