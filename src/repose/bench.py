"""How fast the engine is on this machine, and how fast the machine is.

The reference kernel is a plain loop of dependent divisions and multiplications, the same work everywhere: the ratio
of a time step to it compares engines across machines and moments.
"""

import math
import time

import numba
import numpy as np

from . import scenes

# The published representative solution (paper, section 4.2.1).
REPRESENTATIVE = {
    "e_gg": 0.203,
    "mus_gg": 0.642,
    "mur_gg": 0.037,
    "e_gp": 0.244,
    "mus_gp": 0.483,
    "mur_gp": 0.185,
}
REFERENCE_LOOPS = 20_000
REPEATS = 7


@numba.njit
def reference_kernel(n):
    """A chain of n dependent steps of arithmetic with a square root and a division each."""
    x = 1.0
    for k in range(n):
        x = math.sqrt(x * 1.0000001 + 1e-9 * k) / (1.0 + 1e-7 * x)
    return x


def _median_s(function, repeats=REPEATS):
    """Median wall time of a call [s]."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def run(config, particle, berry, seed=1):
    """Time a whole pour and the settled pile, both on one core.

    config: whole configuration; particle: `shape.Particle`; berry: mapping with the moduli. Returns a dict:
    us_per_step (microseconds a step, the last second of the pour), job_s (wall seconds of the pour),
    reference_us (microseconds of the reference kernel) and ratio (us_per_step / reference_us); medians.
    """
    warm = {**config, "heap": {**config["heap"], "berries": 2, "duration_s": 1.0}}
    scenes.pour(warm, REPRESENTATIVE, seed, particle, berry)
    reference_kernel(10)
    references, jobs, steps = [], [], []
    for _ in range(3):
        references.append(1e6 * _median_s(lambda: reference_kernel(REFERENCE_LOOPS)))
        poured = scenes.pour(config, REPRESENTATIVE, seed, particle, berry)
        jobs.append(poured.wall_s)
        steps.append(poured.us_per_step)
    us_per_step, reference_us = float(np.median(steps)), float(np.median(references))
    return {
        "us_per_step": round(us_per_step, 2),
        "job_s": round(float(np.median(jobs)), 3),
        "reference_us": round(reference_us, 2),
        "ratio": round(us_per_step / reference_us, 4),
        "berries": config["heap"]["berries"],
        "time_step_s": config["heap"]["time_step_s"],
    }
