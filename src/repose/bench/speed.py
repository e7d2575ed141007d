"""Measure the speed of the engine on this machine, and of the machine itself."""

import math
import timeit
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import binding

from repose.bench import Scene
from repose.bench.funnel import FunnelSettings, FunnelTest
from repose.bench.settings import SceneSettings
from repose.dem.kernels import jit  # noqa: F401
from repose.grain.particle import Particle

REFERENCE_LOOPS = 20_000  # steps of the reference kernel
REPEATS = 7  # runs of the reference kernel in a round
ROUNDS = 3  # rounds in which each particle is poured once
# Extra simulated time after a pour, in which late grains arrive and the pile settles.
SETTLED_S = 1.0
Config = Mapping[str, Any]
Numbers = Mapping[str, float]


class Times(NamedTuple):
    """Wall-clock times of a pour."""

    us_per_step: float  # time of a time step of the settled pile
    job_s: float  # time of the whole pour


# `repose.dem.kernels.jit` is imported because it sets the options of the compiler. The
# first kernel of a process fixes these options for all others.
@numba.njit
def reference_kernel(n: int) -> float:
    """Compute n steps, each of a square root and a division, that depend on each other.

    The result is returned so that the compiler does not remove the steps.
    """
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
    """Measure how long pours and time steps take on one core, for several particles.

    A pour is a whole run of the funnel. In each of `ROUNDS` rounds, all particles are
    poured one after the other under the same conditions, together with a reference
    kernel that measures the machine. The first particle is the one with which the
    others are compared.

    Parameters
    ----------
    config : mapping
        The configuration of a study.
    particles : mapping
        The bodies that represent the grain, by name.
    berry : mapping
        Shear modulus and Poisson's ratio of the grain, as in berry.json.
    parameters : mapping
        The contact parameters.
    seed : int, optional
        The seed of the pours.

    Returns
    -------
    dict
        The results of `summarise_times` and `describe_machine`, with the number of
        grains (`berries`) and the time step (`time_step_s`) of the pours.
    """
    # Run everything once, so that the code is compiled before it is timed. A short pour
    # of two grains and a few steps of the kernel are enough.
    short_pour = _change_funnel(config, berries=2, duration_s=1.0)
    for particle in particles.values():
        time_pour(short_pour, parameters, seed, particle, berry)
    reference_kernel(10)

    reference_times_us = []
    pour_times: dict[str, list[Times]] = {name: [] for name in particles}
    for _ in range(ROUNDS):
        reference_times_us.append(_time_reference_kernel())
        for name, particle in particles.items():
            times = time_pour(config, parameters, seed, particle, berry)
            pour_times[name].append(times)

    settings = SceneSettings(config)
    return {
        "berries": settings.section("funnel", FunnelSettings).berries,
        "time_step_s": settings.simulation.time_step_s,
        **describe_machine(),
        **summarise_times(reference_times_us, pour_times),
    }


def _time_reference_kernel() -> float:
    """Measure the median time of the reference kernel in microseconds."""
    times_s = timeit.repeat(
        lambda: reference_kernel(REFERENCE_LOOPS), number=1, repeat=REPEATS
    )
    return 1e6 * float(np.median(times_s))


def describe_machine() -> dict[str, Any]:
    """Describe the processor of this machine.

    Returns
    -------
    dict
        ``processor``, the type of the processor, and ``vector_bits``, the width of its
        widest vector instructions.
    """
    # LLVM, which compiles the engine, knows the instructions of the processor.
    features = binding.get_host_cpu_features()
    if features.get("avx512f"):
        vector_bits = 512
    elif features.get("avx"):
        vector_bits = 256
    else:
        # Every x86-64 processor has vectors of 128 bits, and so have most others.
        vector_bits = 128
    return {"processor": binding.get_host_cpu_name(), "vector_bits": vector_bits}


def time_pour(
    config: Config, parameters: Numbers, seed: int, particle: Particle, berry: Numbers
) -> Times:
    """Measure the time of a whole pour, and of a time step of the settled pile.

    The pour ends as soon as its pile rests. The time of a time step is therefore
    measured in a second, longer pour: at its end, when the pile has been at rest for a
    while.

    Parameters
    ----------
    config : mapping
        The configuration of a study.
    parameters : mapping
        The contact parameters.
    seed : int
        The seed of both pours.
    particle : Particle
        The body that represents a grain.
    berry : mapping
        Shear modulus and Poisson's ratio of the grain.

    Returns
    -------
    Times
        The time of the first pour, and the time of a time step at the end of the
        second.
    """
    scene = Scene.of(config, parameters, berry, particle, seed)
    pour = FunnelTest().pour(scene)

    funnel = SceneSettings(config).section("funnel", FunnelSettings)
    longer_config = _change_funnel(config, duration_s=funnel.duration_s + SETTLED_S)
    longer_scene = Scene.of(longer_config, parameters, berry, particle, seed)
    longer_pour = FunnelTest().pour(longer_scene, until_rest=False)
    return Times(us_per_step=longer_pour.us_per_step, job_s=pour.wall_s)


def _change_funnel(config: Config, **changes: float) -> dict[str, Any]:
    """Copy a configuration, and change keys of the copy's section `funnel`."""
    # The given configuration is not changed.
    return {**config, "funnel": {**config["funnel"], **changes}}


def summarise_times(
    reference_times_us: Sequence[float], pours: Mapping[str, Sequence[Times]]
) -> dict[str, Any]:
    """Compute the medians of measured times, and compare the particles.

    Parameters
    ----------
    reference_times_us : sequence of float
        Times of the reference kernel.
    pours : mapping
        Results of `time_pour`, one for each round, by the name of the particle. The
        first particle is the one with which the others are compared.

    Returns
    -------
    dict
        ``reference_us``, the time of the reference kernel, and ``particles``, a list of
        dicts. Each dict has these keys: ``name`` of the particle; ``us_per_step``, the
        time of a time step; ``job_s``, the time of a whole pour; ``ratio``, the time of
        a time step divided by that of the reference kernel; ``to_first``, the time of a
        time step divided by that of the first particle.
    """
    reference_us = float(np.median(reference_times_us))
    # Take the median over the rounds (axis 0) for each of the two times.
    median_times = {
        name: Times(*np.median(times, axis=0).tolist()) for name, times in pours.items()
    }
    first_particle = next(iter(median_times))
    first_us = median_times[first_particle].us_per_step
    rows = []
    for name, times in median_times.items():
        row = {
            "name": name,
            "us_per_step": round(times.us_per_step, 2),
            "job_s": round(times.job_s, 3),
            "ratio": round(times.us_per_step / reference_us, 4),
            "to_first": round(times.us_per_step / first_us, 3),
        }
        rows.append(row)
    return {"reference_us": round(reference_us, 2), "particles": rows}


def format_result(result: Mapping[str, Any]) -> str:
    """Format the result of `run` as a table with a row for each particle."""
    lines = [
        f"{result['berries']} grains, time step {result['time_step_s']:g} s, one core; "
        f"reference kernel {result['reference_us']:.1f} us; "
        f"{result['processor']}, vectors of {result['vector_bits']} bits",
        "to kernel: compares machines of one type of processor only",
        f"{'particle':16} {'us a step':>10} {'to first':>9} {'to kernel':>10} "
        f"{'pour, s':>8}",
    ]
    for row in result["particles"]:
        lines.append(
            f"{row['name']:16} {row['us_per_step']:10.1f} {row['to_first']:9.2f} "
            f"{row['ratio']:10.3f} {row['job_s']:8.2f}"
        )
    return "\n".join(lines)
