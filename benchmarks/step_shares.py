"""Where the time of a step goes: the kernels of a settled bed, each repeated by itself.

Each kernel starts from the same state of the bed, and only a few times in a row, so that the state hardly changes. The
times are those of the processor, so other programs disturb them less.
"""

import time

import numba
import numpy as np

from repose.dem.kernels import state as st
from repose.dem.kernels.engine import add_wall_loads
from repose.dem.kernels.forces import add_pair_forces
from repose.dem.kernels.neighbours import update_near_pairs
from repose.dem.kernels.rigid import integrate

ROUNDS = 15
REPEATS = 40  # of a kernel from one state
# Arithmetic of a contact of two ellipsoids: additions with a multiplication, roots and divisions.
FUSED, ROOTS, DIVISIONS = 300, 6, 7
DEGREE = 32  # of each of the four polynomials by which additions with a multiplication are timed
VALUES = 1024  # they fit the innermost cache


@numba.njit
def _repeat_pair_forces(bodies, pairs, clumps, counts, physics, tile, repeats):
    for _ in range(repeats):
        add_pair_forces(
            bodies, pairs, clumps, counts, physics, tile, 0, 0, counts[st.N_PAIRS]
        )


@numba.njit
def _repeat_near(bodies, pairs, counts, grid, parts, normal, repeats):
    for _ in range(repeats):
        update_near_pairs(bodies, pairs, counts, grid, parts, normal)


@numba.njit
def _repeat_integrate(bodies, counts, physics, tile, repeats):
    for _ in range(repeats):
        integrate(bodies, counts, physics, tile, 0, counts[st.N_BODIES])


@numba.njit
def _repeat_walls(
    bodies, flat, curved, meshed, clumps, walls, meshes, counts, physics, tile, numbers, ghost, repeats
):  # fmt: skip
    for _ in range(repeats):
        add_wall_loads(
            bodies, flat, curved, meshed, clumps, walls, meshes, counts, physics, tile, numbers, ghost
        )  # fmt: skip


def step_us(simulation, rounds=ROUNDS, repeats=REPEATS):
    """Median time of a step [us]."""
    took = []
    for _ in range(rounds):
        began = time.process_time()
        simulation.run_steps(repeats)
        took.append((time.process_time() - began) / repeats)
    return 1e6 * float(np.median(took))


def parts_us(simulation, whole_us, rounds=ROUNDS, repeats=REPEATS):
    """Median time of each part of a step [us], by its name, and of the rest of a step that takes `whole_us`."""
    one = simulation
    tile, body_tile, numbers = one._tiles[0], one._body_tiles[0], one._scratches[0]
    normal = st.split_scratch.py_func(numbers).normal
    calls = {
        "pairs: all of it": lambda n: _repeat_pair_forces(
            one.bodies, one.pairs, one.clumps, one.counts, one.physics, tile, n
        ),
        "walls: all of it": lambda n: _repeat_walls(
            one.bodies, one.flat, one.curved, one.meshed, one.clumps, one.walls, one.meshes, one.counts, one.physics,
            tile, numbers, one.grid.cell.shape[0], n,
        ),
        "bodies: time integration": lambda n: _repeat_integrate(
            one.bodies, one.counts, one.physics, body_tile, n
        ),
        "near pairs: comparison of displacements": lambda n: _repeat_near(
            one.bodies, one.pairs, one.counts, one.grid, one.physics.parts, normal, n
        ),
    }  # fmt: skip
    arrays = _arrays(one)
    kept = [array.copy() for array in arrays]
    times = {}
    for name, call in calls.items():
        call(0)  # compiles
        took = []
        for _ in range(rounds):
            began = time.process_time()
            call(0)
            empty = time.process_time() - began
            began = time.process_time()
            call(repeats)
            took.append((time.process_time() - began - empty) / repeats)
            for array, values in zip(arrays, kept, strict=True):
                array[...] = values
        times[name] = 1e6 * float(np.median(took))
    times["the rest"] = whole_us - sum(times.values())
    return times


def _arrays(simulation):
    """All arrays that a step changes."""
    groups = (
        simulation.bodies,
        simulation.pairs,
        simulation.flat,
        simulation.curved,
        simulation.meshed,
        simulation.grid,
        simulation.walls,
        (simulation.counts, simulation._tiles[0], simulation._body_tiles[0]),
    )
    return [one for group in groups for one in group if isinstance(one, np.ndarray)]


@numba.njit(fastmath={"contract"}, error_model="numpy")
def _fused(values, results):
    for k in range(len(values)):
        x = values[k]
        # Four sums that do not wait for each other.
        a = b = c = d = x
        for _ in range(DEGREE):
            a = a * x + 0.5
            b = b * x + 0.6
            c = c * x + 0.7
            d = d * x + 0.8
        results[k] = a + b + c + d


@numba.njit(error_model="numpy")
def _roots(values, results):
    for k in range(len(values)):
        results[k] = np.sqrt(values[k])


@numba.njit(error_model="numpy")
def _divisions(values, results):
    for k in range(len(values)):
        results[k] = 1.0 / values[k]


def _time_ns(operation, operations, rounds):
    """Least time of one operation of a loop over values in the innermost cache [ns]."""
    values = np.linspace(0.1, 0.9, VALUES)
    results = np.empty_like(values)
    operation(values, results)  # compiles
    took = []
    for _ in range(rounds):
        began = time.process_time()
        for _ in range(100):
            operation(values, results)
        took.append(time.process_time() - began)
    return 1e9 * min(took) / (100 * VALUES * operations)


def bound_ns(rounds=ROUNDS):
    """Time of the arithmetic of one contact on this processor, if nothing else took time [ns]."""
    return (
        FUSED * _time_ns(_fused, 4 * DEGREE, rounds)
        + ROOTS * _time_ns(_roots, 1, rounds)
        + DIVISIONS * _time_ns(_divisions, 1, rounds)
    )
