"""Compiling the engine before the first run of a study, once: jobs that start together would each compile it."""

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
) -> float:
    """Make one step with one berry in every bench test of the targets, which compiles the kernels of their runs.

    numba keeps the compiled code in a folder of its own, where every later process finds it. Returns the wall time
    that it took [s]: a minute or two, or a second or two where the compiled code was found. Any parameters do.
    """
    began = time.perf_counter()
    for name in Targets.of(config["targets"]).apparatus:
        simulation = bench(name).build(config, parameters, particle, berry)
        simulation.add("berry", (0.0, 0.0, 0.0))
        simulation.run_steps(1)
    return time.perf_counter() - began
