"""Speed of the engine on this machine, and of the machine itself.

    python benchmarks/speed.py [--config config/config.yaml] [--json]

Times whole pours, and a settled pile, of a study's particle on one core. The reference kernel is a plain loop of
dependent divisions and multiplications, the same work everywhere: the ratio of a time step to it compares engines
across machines and moments.
"""

import argparse
import json
import math
import time

import numba
import numpy as np

from repose.apparatus import funnel
from repose.apparatus.settings import SimulationSettings
from repose.config.study import Study
from repose.core import published

REFERENCE_LOOPS = 20_000
REPEATS = 7
ROUNDS = 3
SETTLED_S = 1.0  # after the pour; only then is the pile settled, for a wide factory empties late


@numba.njit
def reference_kernel(n):
    """A chain of n dependent steps of arithmetic with a square root and a division each.

    The returned value keeps the compiler from removing the loop.
    """
    x = 1.0
    for k in range(n):
        x = math.sqrt(x * 1.0000001 + 1e-9 * k) / (1.0 + 1e-7 * x)
    return x


def run(config, particles, berry, parameters, seed=1):
    """Time pours and settled piles of particles by name, in turn so that all see the same machine.

    The first of the particles is the reference of the others; `berry` holds the moduli. Returns the `summary`, with
    `berries` and `time_step_s` of the pours.
    """
    warm = {**config, "funnel": {**config["funnel"], "berries": 2, "duration_s": 1.0}}
    for particle in particles.values():  # compiles what is timed afterwards
        timed_pour(warm, parameters, seed, particle, berry)
    reference_kernel(10)
    references, pours = [], {name: [] for name in particles}
    for _ in range(ROUNDS):
        references.append(1e6 * _median_s(lambda: reference_kernel(REFERENCE_LOOPS)))
        for name, particle in particles.items():
            pours[name].append(timed_pour(config, parameters, seed, particle, berry))
    step_s = SimulationSettings.of(config).time_step_s
    return {"berries": config["funnel"]["berries"], "time_step_s": step_s} | summary(references, pours)


def timed_pour(config, parameters, seed, particle, berry):
    """Time of a step of the settled pile [us], and wall time of the whole pour before it [s]."""
    duration_s = config["funnel"]["duration_s"] + SETTLED_S
    longer = {**config, "funnel": {**config["funnel"], "duration_s": duration_s}}
    poured = funnel.pour(longer, parameters, seed, particle, berry)
    settled_s = 1e-6 * poured.us_per_step * SETTLED_S / SimulationSettings.of(config).time_step_s
    return poured.us_per_step, poured.wall_s - settled_s


def summary(references, pours):
    """Medians of all rounds, and their ratios; `references` are in us, `pours` are results of `timed_pour` by particle.

    The keys are `reference_us` and `particles`, a list of `name`, `us_per_step`, `job_s` (wall time of a pour), `ratio`
    (of a step to the reference kernel) and `to_first` (of a step to the first particle's).
    """
    reference_us = float(np.median(references))
    medians = {name: np.median(timed, axis=0).tolist() for name, timed in pours.items()}
    first, _ = next(iter(medians.values()))
    particles = [
        {
            "name": name,
            "us_per_step": round(us, 2),
            "job_s": round(job_s, 3),
            "ratio": round(us / reference_us, 4),
            "to_first": round(us / first, 3),
        }
        for name, (us, job_s) in medians.items()
    ]
    return {"reference_us": round(reference_us, 2), "particles": particles}


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


def _median_s(function):
    """Median wall time of a call [s]."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--config", nargs="+", default=["config/config.yaml"])
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    study = Study.load(arguments.config)
    parameters = published.representative(study.config["validation"]["published"])
    particles = {study.config["berry"]["particle"]: study.particle}
    result = run(study.config, particles, study.grain, parameters)
    print(json.dumps(result, indent=1) if arguments.json else message(result))


if __name__ == "__main__":
    main()
