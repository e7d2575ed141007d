"""Compiling the engine once, before the first run of a study: jobs that start together would each compile it."""

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
    """Make a step with one berry in every bench test of the targets, to compile its kernels; return the seconds."""
    began = time.perf_counter()
    for name in Targets.of(config["targets"]).apparatus:
        simulation = bench(name).build(config, parameters, particle, berry)
        simulation.add("berry", (0.0, 0.0, 0.0))
        simulation.run_steps(1)
    return time.perf_counter() - began
