"""Compiling the engine once, before the first run of a study: of jobs that start together one would do it alone."""

import multiprocessing
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from repose.apparatus.bench_test import bench
from repose.core.targets import Targets

if TYPE_CHECKING:
    from repose.particle.particle import Particle


def warm_up(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    particle: "Particle",
    berry: Mapping[str, Any],
    cores: int = 1,
) -> float:
    """Make a step with one berry in every bench test of the targets, to compile its kernels; return the seconds.

    On a second core another process compiles the contacts with walls, nearly half of the engine.
    """
    began = time.perf_counter()
    names = Targets.of(config["targets"]).apparatus
    simulations = [bench(name).build(config, parameters, particle, berry) for name in names]
    helper = multiprocessing.get_context("fork").Process(
        target=lambda: [simulation.wall_loads() for simulation in simulations], daemon=True
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
