"""The island genetic algorithm beside pygmo's and scipy's differential evolution, and what its operators cost.

python -m research.answers.island_ga --seeds 20 --out tables.md
python -m research.answers.island_ga --published          only the time of the published run

Every search may evaluate 100,000 points: 500 generations of 5 islands x 40 here and in pygmo (sga with its own
crossover, mutation and tournaments, the best sent round the ring every 10 generations), scipy's
differential_evolution as it comes (15 points a dimension; ends early only when its population has collapsed)
without polishing. A search succeeds when its best value comes within 0.01 of the minimum, 0. Rastrigin,
Ackley and Griewank are moved, anew for each seed, by up to half of the box's half width, because averaging
parents favours the middle of the box. pygmo is optional: pip install pygmo.
"""

import argparse
import time
from pathlib import Path

import numba
import numpy as np
from scipy.optimize import differential_evolution

from repose.calibrate.search.miga import MIGA, islands_ga
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.surrogates import make
from repose.calibrate.surrogates.settings import NetworkSettings

try:
    import pygmo
except ImportError:
    pygmo = None

ISLANDS = 5
POPULATION = 40
GENERATIONS = 10
ROUNDS = 50
EVALUATIONS = ISLANDS * POPULATION * GENERATIONS * ROUNDS
NEAR = 0.01
DIMENSIONS = (2, 6, 10)


@numba.njit(cache=True)
def rastrigin(x):
    return 10 * len(x) + np.sum(x * x - 10 * np.cos(2 * np.pi * x))


@numba.njit(cache=True)
def rosenbrock(x):
    return np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)


@numba.njit(cache=True)
def ackley(x):
    radius = np.sqrt(np.mean(x * x))
    waves = np.mean(np.cos(2 * np.pi * x))
    return 20 + np.e - 20 * np.exp(-0.2 * radius) - np.exp(waves)


@numba.njit(cache=True)
def griewank(x):
    product = 1.0
    for i in range(len(x)):
        product *= np.cos(x[i] / np.sqrt(i + 1))
    return 1 + np.sum(x * x) / 4000 - product


@numba.njit(cache=True)
def himmelblau(x):
    """Summed over pairs of coordinates: 4 minima of value 0 for each pair."""
    a = x[::2]
    b = x[1::2]
    return np.sum((a * a + b - 11) ** 2 + (a + b * b - 7) ** 2)


# function, half width of the box, whether its minimum is moved
PROBLEMS = {
    "Rastrigin": (rastrigin, 5.12, True),
    "Rosenbrock": (rosenbrock, 2.048, False),
    "Ackley": (ackley, 32.768, True),
    "Griewank": (griewank, 600.0, True),
    "Himmelblau": (himmelblau, 5.0, False),
}


@numba.njit(cache=True)
def apply(function, points, shift):
    values = np.empty(len(points))
    for i in range(len(points)):
        values[i] = function(points[i] - shift)
    return values


class Problem:
    """One function with its minimum moved; called with points (n, dimensions), or by pygmo with one."""

    def __init__(self, name, dimensions, seed):
        self.function, self.half, moved = PROBLEMS[name]
        self.dimensions = dimensions
        random = np.random.RandomState([seed, dimensions])
        self.shift = moved * random.uniform(-0.5, 0.5, dimensions) * self.half

    def __call__(self, points):
        return apply(self.function, np.ascontiguousarray(points), self.shift)

    def fitness(self, x):
        return [self.function(x - self.shift)]

    def get_bounds(self):
        return [-self.half] * self.dimensions, [self.half] * self.dimensions


class BlendCrossover(MIGA):
    """BLX-0.5: each gene anywhere between the parents or half their distance beyond."""

    def _cross(self, a, b, step):
        return b + self.random.uniform(-0.5, 1.5, a.shape) * (a - b)


class UniformCrossover(MIGA):
    """Each gene as it is from one of the parents."""

    def _cross(self, a, b, step):
        return np.where(self.random.uniform(size=a.shape) < 0.5, a, b)


class NoElite(MIGA):
    def _keep_best(self, children, best):
        pass


class NoMigration(MIGA):
    def _migrate(self, points, fitness, order):
        return points, fitness


class ScaledMutation(MIGA):
    """Amplitudes spread evenly in their logarithm from 0.0001 to 1 instead of one amplitude."""

    def _draw_round(self):
        super()._draw_round()
        self._mutation *= 10 ** self.random.uniform(-3, 1, self._mutation.shape)


VARIANTS = {
    "as published": (MIGA, {}),
    "crossover: blend (BLX-0.5)": (BlendCrossover, {}),
    "crossover: uniform": (UniformCrossover, {}),
    "tournament of 2": (MIGA, {"tournament": 2}),
    "tournament of 7": (MIGA, {"tournament": 7}),
    "mutation probability 0.2": (MIGA, {"mutation_probability": 0.2}),
    "mutation amplitude 0.01": (MIGA, {"mutation_amplitude": 0.01}),
    "mutation amplitudes 0.0001 to 1": (ScaledMutation, {}),
    "no elite": (NoElite, {}),
    "no migration": (NoMigration, {}),
    "one island of 200": (MIGA, {"islands": 1, "population": 200}),
}


def miga(problem, seed):
    bounds = np.transpose(problem.get_bounds())
    return islands_ga(problem, bounds, rounds=ROUNDS, seed=seed).fun


def evolution(problem, seed):
    bounds = np.transpose(problem.get_bounds())
    generations = EVALUATIONS // (15 * problem.dimensions) - 1
    return differential_evolution(
        lambda x: problem(x.T),
        bounds,
        maxiter=generations,
        tol=0.0,
        atol=1e-8,
        polish=False,
        updating="deferred",
        vectorized=True,
        rng=seed,
    ).fun


def pygmo_islands(problem, seed):
    """Five populations in one thread, since pygmo's islands cannot share an objective written in Python."""
    task = pygmo.problem(problem)
    populations = [
        pygmo.population(task, POPULATION, seed=1000 * seed + i) for i in range(ISLANDS)
    ]
    for round_ in range(ROUNDS):
        evolve = pygmo.algorithm(pygmo.sga(gen=GENERATIONS, seed=1000 * seed + round_))
        populations = [evolve.evolve(population) for population in populations]
        best = [
            (population.champion_x, population.champion_f) for population in populations
        ]
        for i, population in enumerate(populations):
            population.set_xf(population.worst_idx(), *best[i - 1])
    return min(population.champion_f[0] for population in populations)


def variant(name):
    kind, settings = VARIANTS[name]

    def search(problem, seed):
        ga = kind(problem.dimensions, MigaSettings.with_defaults(**settings, seed=seed))
        for _ in range(ROUNDS * GENERATIONS):
            ga.tell(problem(ga.ask() * problem.half))
        return ga.best_fitness

    return search


def outcome(search, name, dimensions, seeds):
    """Successes and median best value, as a cell of the table."""
    best = np.array(
        [search(Problem(name, dimensions, seed), seed) for seed in range(seeds)]
    )
    return f"{np.count_nonzero(best < NEAR)} ({np.median(best):.0e})"


def table(titles, rows):
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    print(*lines, sep="\n")
    for row in rows:
        lines.append("| " + " | ".join(row) + " |")
        print(lines[-1], flush=True)
    return lines


def peers(seeds):
    searches = {"islands_ga": miga, "differential_evolution": evolution}
    if pygmo:
        searches["pygmo sga islands"] = pygmo_islands
    rows = (
        (
            name,
            str(d),
            *(outcome(search, name, d, seeds) for search in searches.values()),
        )
        for name in PROBLEMS
        for d in DIMENSIONS
    )
    return table(("function", "dimensions", *searches), rows)


def ablation(seeds, dimensions=6):
    rows = (
        (v, *(outcome(variant(v), name, dimensions, seeds) for name in PROBLEMS))
        for v in VARIANTS
    )
    return table((f"operators ({dimensions} dimensions)", *PROBLEMS), rows)


def published_run():
    """Seconds of 5 x 40 x 8700 = 1.74 million evaluations of a 6-12-2 network, and of these alone."""
    random = np.random.RandomState(0)
    X = random.uniform(-1, 1, (95, 6))
    model = make("network", NetworkSettings.from_keys({"starts": 1, "epochs": 20})).fit(
        X, np.column_stack([X.sum(axis=1), X[:, 0] * X[:, 1]])
    )
    respond = model.response_function(np.full(6, -1.0), np.full(6, 1.0))
    start = time.perf_counter()
    result = islands_ga(
        lambda x: np.abs(respond(x)).sum(axis=1), [(-1, 1)] * 6, rounds=870
    )
    seconds = time.perf_counter() - start
    points = random.uniform(-1, 1, (ISLANDS * POPULATION, 6))
    start = time.perf_counter()
    for _ in range(result.nit):
        respond(points)
    alone = time.perf_counter() - start
    print(
        f"{result.nfev} evaluations: {seconds:.2f} s, of which the network {alone:.2f} s"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--seeds", type=int, default=20, help="searches of each kind (default 20)"
    )
    parser.add_argument("--out", help="markdown file to write the tables to")
    parser.add_argument(
        "--published", action="store_true", help="only time the published run"
    )
    args = parser.parse_args()
    published_run()
    if args.published:
        return
    if pygmo is None:
        print("pygmo is not installed (pip install pygmo): its column is left out")
    lines = [*peers(args.seeds), "", *ablation(args.seeds)]
    if args.out:
        Path(args.out).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
