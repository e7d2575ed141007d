"""Speed of the engine on this machine, and of the machine itself.

The reference kernel is a loop of dependent divisions and multiplications, so it measures the present speed of one
processor. The ratio of a time step to it compares engines on machines of one type, but not types of machines: a step
also depends on vectors and caches.
"""

import math
import timeit
from collections.abc import Mapping, Sequence
from typing import Any

import numba
import numpy as np
from llvmlite import binding

from repose.bench import Scene
from repose.bench.funnel import FunnelSettings, FunnelTest
from repose.bench.settings import SceneSettings
from repose.dem.kernels import jit  # noqa: F401  (the first kernel of a process fixes the compiler for all)
from repose.grain.particle import Particle

VECTOR_BITS = {"avx512f": 512, "avx": 256}  # by the feature of a processor
REFERENCE_LOOPS = 20_000
REPEATS = 7
ROUNDS = 3
SETTLED_S = 1.0  # after the pour; only then is the pile settled, for a wide factory empties late
Config = Mapping[str, Any]
Numbers = Mapping[str, float]
Times = tuple[
    float, float
]  # of a step of the settled pile [us], and of the whole pour [s]


@numba.njit
def reference_kernel(n: int) -> float:
    """Compute n dependent steps, each a root and a division; the value is returned, so that the compiler keeps them."""
    x = 1.0
    for k in range(n):
        x = math.sqrt(x * 1.0000001 + 1e-9 * k) / (1.0 + 1e-7 * x)
    return x


def run(
    config: Config,
    particles: Mapping[str, Particle],
    berry: Numbers,
    parameters: Numbers,
    seed: int = 1,
) -> dict[str, Any]:
    """Time whole pours and settled piles on one core, the particles in turn so that all have the same conditions.

    The first of the particles is the reference of the others; `berry` holds the moduli. Returns the `summary`, with
    `berries` and `time_step_s` of the pours and the `machine`.
    """
    warm = _with(config, berries=2, duration_s=1.0)
    for particle in particles.values():  # compiles the code that is timed afterwards
        timed_pour(warm, parameters, seed, particle, berry)
    reference_kernel(10)
    references: list[float] = []
    pours: dict[str, list] = {name: [] for name in particles}
    for _ in range(ROUNDS):
        loops_s = timeit.repeat(
            lambda: reference_kernel(REFERENCE_LOOPS), number=1, repeat=REPEATS
        )
        references.append(1e6 * float(np.median(loops_s)))
        for name, particle in particles.items():
            pours[name].append(timed_pour(config, parameters, seed, particle, berry))
    settings = SceneSettings(config)
    grains = settings.section("funnel", FunnelSettings).berries
    return (
        {"berries": grains, "time_step_s": settings.simulation.time_step_s}
        | machine()
        | summary(references, pours)
    )


def machine() -> dict[str, Any]:
    """Name the type of processor by LLVM's name, and the width of the vectors of the compiled loops."""
    features = binding.get_host_cpu_features()
    bits = next((bits for name, bits in VECTOR_BITS.items() if features.get(name)), 128)
    return {"processor": binding.get_host_cpu_name(), "vector_bits": bits}


def timed_pour(
    config: Config, parameters: Numbers, seed: int, particle: Particle, berry: Numbers
) -> Times:
    """Time a step of the settled pile [us] and the whole pour [s] by the clock: two pours, both whole."""
    longer = _with(
        config,
        duration_s=SceneSettings(config).section("funnel", FunnelSettings).duration_s
        + SETTLED_S,
    )
    poured = FunnelTest().pour(Scene.of(config, parameters, berry, particle, seed))
    longest = FunnelTest().pour(
        Scene.of(longer, parameters, berry, particle, seed), until_rest=False
    )
    return longest.us_per_step, poured.wall_s


def _with(config: Config, **changes: float) -> dict[str, Any]:
    """Change keys of the funnel."""
    return {**config, "funnel": {**config["funnel"], **changes}}


def summary(
    references: Sequence[float], pours: Mapping[str, Sequence[Times]]
) -> dict[str, Any]:
    """Take medians and their ratios; `references` are in us, `pours` are results of `timed_pour` by particle.

    The keys are `reference_us` and `particles`, a list of `name`, `us_per_step`, `job_s` (wall time of a pour), `ratio`
    (of a step to the reference kernel) and `to_first` (of a step to the first particle's).
    """
    reference_us = float(np.median(references))
    medians = {name: np.median(found, axis=0).tolist() for name, found in pours.items()}
    first, _ = next(iter(medians.values()))
    particles = []
    for name, (us, job_s) in medians.items():
        row = {"name": name, "us_per_step": round(us, 2), "job_s": round(job_s, 3)}
        particles.append(
            row
            | {"ratio": round(us / reference_us, 4), "to_first": round(us / first, 3)}
        )
    return {"reference_us": round(reference_us, 2), "particles": particles}


def message(result: Mapping[str, Any]) -> str:
    """Write the table of `run` for a terminal."""
    machine = f"{result['processor']}, vectors of {result['vector_bits']} bits"
    pours = (
        f"{result['berries']} grains, time step {result['time_step_s']:g} s, one core"
    )
    lines = [
        f"{pours}; reference kernel {result['reference_us']:.1f} us; {machine}",
        "to kernel: compares machines of one type of processor only",
        f"{'particle':16} {'us a step':>10} {'to first':>9} {'to kernel':>10} {'pour, s':>8}",
    ]
    for row in result["particles"]:
        steps = (
            f"{row['us_per_step']:10.1f} {row['to_first']:9.2f} {row['ratio']:10.3f}"
        )
        lines.append(f"{row['name']:16} {steps} {row['job_s']:8.2f}")
    return "\n".join(lines)
