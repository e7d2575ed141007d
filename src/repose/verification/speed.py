"""How fast the engine is on this machine, and how fast the machine is.

The reference kernel is a plain loop of dependent divisions and multiplications, the same work everywhere: the ratio
of a time step to it compares engines across machines and moments.
"""

import math
import time

import numba
import numpy as np

from repose.apparatus import scenes

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
ROUNDS = 3


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


def run(config, particles, berry, seed=1):
    """Time whole pours and settled piles on one core, the particles in turn so that all see the same machine.

    config: whole configuration. particles: name to `shape.Particle`; the first is what the others are set beside.
    berry: mapping with the moduli. Returns a dict: reference_us (microseconds of the reference kernel), berries,
    time_step_s, and particles, a list of dicts of name, us_per_step (microseconds a step over the last second of
    the pour), job_s (wall seconds of the pour), ratio (us_per_step / reference_us) and to_first; medians of three.
    """
    warm = {**config, "funnel": {**config["funnel"], "berries": 2, "duration_s": 1.0}}
    for particle in particles.values():
        scenes.pour(warm, REPRESENTATIVE, seed, particle, berry)
    reference_kernel(10)
    references, jobs, steps = [], {name: [] for name in particles}, {name: [] for name in particles}
    for _ in range(ROUNDS):
        references.append(1e6 * _median_s(lambda: reference_kernel(REFERENCE_LOOPS)))
        for name, particle in particles.items():
            poured = scenes.pour(config, REPRESENTATIVE, seed, particle, berry)
            jobs[name].append(poured.wall_s)
            steps[name].append(poured.us_per_step)
    reference_us = float(np.median(references))
    us = {name: float(np.median(found)) for name, found in steps.items()}
    first = next(iter(us.values()))
    return {
        "reference_us": round(reference_us, 2),
        "berries": config["funnel"]["berries"],
        "time_step_s": config["simulation"]["time_step_s"],
        "particles": [
            {
                "name": name,
                "us_per_step": round(us[name], 2),
                "job_s": round(float(np.median(jobs[name])), 3),
                "ratio": round(us[name] / reference_us, 4),
                "to_first": round(us[name] / first, 3),
            }
            for name in particles
        ],
    }


def message(result):
    """The table of `run` for a terminal."""
    lines = [
        f"{result['berries']} berries, time step {result['time_step_s']:g} s, one core; "
        f"reference kernel {result['reference_us']:.1f} us",
        f"{'particle':16} {'us a step':>10} {'to first':>9} {'to kernel':>10} {'pour, s':>8}",
    ]
    for row in result["particles"]:
        lines.append(
            f"{row['name']:16} {row['us_per_step']:10.1f} {row['to_first']:9.2f} "
            f"{row['ratio']:10.3f} {row['job_s']:8.2f}"
        )
    return "\n".join(lines)
