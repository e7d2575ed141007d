"""Compile the engine before the first run of a study.

If several jobs started together, only one would compile, and the others would wait.
"""

import multiprocessing
import time

from repose.bench.bench_test import Scene, bench
from repose.calibrate.targets import Targets


def warm_up(scene: Scene, cores: int = 1) -> float:
    """Compile the kernels of every bench test of the targets.

    A kernel is compiled when it is first called, so a single time step with one grain
    is enough. The kernels of the contacts with walls take nearly half of the time. If
    there is a second core, another process compiles them at the same time.

    Parameters
    ----------
    scene : Scene
        The scene of the study. Its targets determine the bench tests.
    cores : int, optional
        Number of cores that may be used.

    Returns
    -------
    float
        Time that the compilation took [s].
    """
    start_s = time.perf_counter()
    names = Targets.of(scene.settings.config["targets"]).apparatus
    simulations = [bench(name).build(scene) for name in names]

    # The other process leaves its kernels in the cache on disk, from which this process
    # loads them.
    def compile_walls() -> None:
        for simulation in simulations:
            simulation.wall_loads()

    context = multiprocessing.get_context("fork")
    wall_process = context.Process(target=compile_walls, daemon=True)
    has_second_core = cores > 1
    if has_second_core:
        wall_process.start()
    for simulation in simulations:
        simulation.add("berry", (0.0, 0.0, 0.0))
        simulation.run_steps(1)
    if has_second_core:
        # The time step above needed all kernels, so they are compiled now. The other
        # process may be slower, but its result is no longer needed.
        wall_process.terminate()
        wall_process.join()
    return time.perf_counter() - start_s
