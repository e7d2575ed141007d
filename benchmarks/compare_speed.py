"""How fast two checkouts of the project simulate, in turn, on this machine.

python benchmarks/compare_speed.py OLD NEW --rounds 8

Every round starts a process for either checkout. It pours 500 particles of each kind through a funnel and then times
the settled pile in short pieces of processor time, each beside a reference kernel. The least ratio of a process counts:
what else runs on the machine can only add to it.
"""

import argparse
import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numba
import numpy as np
from compare_checkouts import SCENES, STEP_S, Scene, environment_of, funnel

PARTICLES = (
    "pour ellipsoid",
    "pour sum of two",
    "sizes sum of two",
    "pour smooth clump",
    "pour rough clump",
)
POURED = {"bodies": 500, "seconds": 2.5, "spread": 0.036, "first_m": 0.15}
PIECES = 40
STEPS = 150


@numba.njit
def reference_kernel(n):
    """A chain of n dependent steps of arithmetic with a square root and a division each."""
    x = 1.0
    for k in range(n):
        x = math.sqrt(x * 1.0000001 + 1e-9 * k) / (1.0 + 1e-7 * x)
    return x


def seconds(function, argument):
    """Processor time of a call [s]."""
    began = time.process_time()
    function(argument)
    return time.process_time() - began


def measure(names):
    """Least time of a step and of the reference kernel for each particle, and of the whole pour [s]."""
    from repose import dem

    reference_kernel(10)
    found = {}
    for name in names:
        scene = SCENES[name]
        options = {
            k: v
            for k, v in scene.options.items()
            if k in ("sizes", "floor_height_m", "curved_walls_above_m")
        }
        simulation = Scene(scene.particles, funnel, **POURED, **options).simulation(dem)
        simulation.run_steps(1)
        pour = seconds(simulation.run_steps, round(POURED["seconds"] / STEP_S))
        steps = []
        references = []
        for _ in range(PIECES):
            references.append(seconds(reference_kernel, 200_000))
            steps.append(seconds(simulation.run_steps, STEPS) / STEPS)
        found[name] = [min(steps), min(references), pour]
    return found


def main():
    """Compare two checkouts and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "checkouts", nargs="*", type=Path, help="folders of two checkouts"
    )
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument(
        "--particles", nargs="+", default=list(PARTICLES), metavar="SCENE"
    )
    parser.add_argument("--measure", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        print(json.dumps(measure(arguments.particles)))
        return
    command = [
        sys.executable,
        __file__,
        "--measure",
        "--particles",
        *arguments.particles,
    ]
    runs = ([], [])
    for _ in range(arguments.rounds):
        for found, checkout in zip(runs, arguments.checkouts, strict=True):
            done = subprocess.run(
                command,
                env=environment_of(checkout),
                check=True,
                capture_output=True,
                text=True,
            )
            found.append(json.loads(done.stdout.splitlines()[-1]))
    print(
        f"{'particle':20} {'old, us':>8} {'new, us':>8} {'least':>6} {'median of ratios to the kernel':>32} {'pour':>6}"
    )
    for name in arguments.particles:
        old, new = (np.array([run[name] for run in found]) for found in runs)
        to_kernel = [np.median(each[:, 0] / each[:, 1]) for each in (old, new)]
        print(
            f"{name:20} {1e6 * old[:, 0].min():8.2f} {1e6 * new[:, 0].min():8.2f} "
            f"{new[:, 0].min() / old[:, 0].min():6.3f} {to_kernel[1] / to_kernel[0]:32.3f} "
            f"{new[:, 2].min() / old[:, 2].min():6.3f}"
        )


if __name__ == "__main__":
    main()
