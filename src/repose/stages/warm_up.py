"""Compiling the engine once, before the first run of a study: of jobs that start together one would do it alone."""

import multiprocessing
import time

from repose.bench.bench_test import Scene, bench
from repose.calibrate.targets import Targets


def warm_up(scene: Scene, cores: int = 1) -> float:
    """Make a step with one grain in every bench test of the targets, to compile its kernels; return the seconds.

    On a second core another process compiles the contacts with walls, nearly half of the engine.
    """
    began = time.perf_counter()
    names = Targets.of(scene.settings.config["targets"]).apparatus
    simulations = [bench(name).build(scene) for name in names]
    helper = multiprocessing.get_context("fork").Process(
        target=lambda: [simulation.wall_loads() for simulation in simulations],
        daemon=True,
    )
    if cores > 1:
        helper.start()
    for simulation in simulations:
        simulation.add("berry", (0.0, 0.0, 0.0))
        simulation.run_steps(1)
    if cores > 1:
        helper.terminate()  # what it may still compile no step needs
        helper.join()
    return time.perf_counter() - began
