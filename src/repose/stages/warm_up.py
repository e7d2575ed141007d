"""Compile the engine before the first run of a study.

If several jobs started together, only one would compile, and the others would wait.
"""

import multiprocessing
import time

from repose.bench.bench_test import Scene, bench
from repose.calibrate.targets import Targets


def warm_up(scene: Scene, cores: int = 1) -> float:
    """Compile the kernels that the bench tests of a study need.

    A kernel is a function of the engine that Numba compiles. It is compiled when it is
    first called, and then stored in a cache on disk. A single time step with one grain
    calls all of them. The kernels of the contacts with walls take nearly half of the
    time. If there is a second core, another process compiles them at the same time.

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
    bench_tests = Targets.of(scene.settings.config["targets"]).apparatus
    simulations = [bench(name).build(scene) for name in bench_tests]

    # The other process leaves its kernels in the cache on disk, from which this process
    # loads them.
    def compile_walls() -> None:
        for simulation in simulations:
            # The loads are not needed. This call compiles the kernels.
            simulation.wall_loads()

    wall_process = None
    if cores > 1:
        # A forked process has the simulations that were built above.
        context = multiprocessing.get_context("fork")
        wall_process = context.Process(target=compile_walls, daemon=True)
        wall_process.start()
    for simulation in simulations:
        # Every bench test calls the shape of its grains "berry".
        simulation.add("berry", (0.0, 0.0, 0.0))
        simulation.run_steps(1)
    if wall_process is not None:
        # The time step above needed all kernels, so they are compiled now. The other
        # process may be slower, but its result is no longer needed. Numba replaces a
        # file of its cache in one step, so ending the process leaves no damaged file.
        wall_process.terminate()
        wall_process.join()
    return time.perf_counter() - start_s
