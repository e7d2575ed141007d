"""Multi-island genetic algorithm, section 3.3 of the paper; needs numpy alone.

Five islands of 40 in normalised parameters [-1, 1], tournaments of three, arithmetic crossover, mutation with
probability 0.05 and amplitude 0.1. Each island keeps its best, and sends it round the ring every 10 generations, 870
times. `islands_ga` minimises any function of whole populations inside bounds::

    from repose.calibrate.search.miga import islands_ga
    result = islands_ga(lambda x: ((x - 1) ** 2).sum(axis=1), bounds=[(-5, 5)] * 6)

`MIGA` is the same by ask and tell, in [-1, 1].

Where the publication is silent, the choices are:

crossover
    always; a child is r a + (1 - r) b with one r, uniform in [0, 1], for all its genes; each
    child has two parents of its own, winners of tournaments drawn with replacement inside the
    island
mutation
    each gene by itself, by 0.1 times a standard normal number, then cut to the box
best kept
    the best of an island is copied unchanged into its next generation, in place of one child
migration
    the best of island i replaces the worst of island i + 1, all islands at once, before breeding,
    and stays at home as well
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from repose.calibrate.search.settings import MigaSettings


class MIGA:
    """The multi-island genetic algorithm by ask and tell, once each per generation.

    Each gene lies in [-1, 1]. `generations` is the number between two migrations, `mutation_amplitude` the standard
    deviation of a gene's change. `best` (dimensions,) is the best point so far, None before the first `tell`.
    ValueError if a setting is out of its limits.
    """

    def __init__(
        self,
        dimensions: int,
        islands: int = 5,
        population: int = 40,
        generations: int = 10,
        tournament: int = 3,
        mutation_probability: float = 0.05,
        mutation_amplitude: float = 0.1,
        seed: int = 2026,
    ) -> None:
        least = {
            "dimensions": 1,
            "islands": 1,
            "population": 2,
            "generations": 1,
            "tournament": 1,
        }
        for name, limit in (least | {"mutation_amplitude": 0}).items():
            if not locals()[name] >= limit:
                raise ValueError(
                    f"{name} is {locals()[name]!r}; expected at least {limit}"
                )
        if not 0 <= mutation_probability <= 1:
            raise ValueError(
                f"mutation_probability is {mutation_probability!r}; expected 0 to 1"
            )
        self.shape = (islands, population, dimensions)
        self.generations, self.tournament = generations, tournament
        self.mutation_probability, self.mutation_amplitude = (
            mutation_probability,
            mutation_amplitude,
        )
        self.random = np.random.RandomState(seed)
        self._first = (
            population * np.arange(islands)[:, None]
        )  # row of each island's first individual
        self._points = self.random.uniform(-1, 1, (islands * population, dimensions))
        self.best, self.best_fitness = None, math.inf
        self.generation = self.evaluations = 0

    @classmethod
    def of(cls, dimensions: int, settings: MigaSettings) -> Self:
        """Make the algorithm of a study."""
        names = (
            "islands",
            "population",
            "generations",
            "tournament",
            "mutation_probability",
            "mutation_amplitude",
        )
        return cls(
            dimensions, **{name: getattr(settings, name) for name in (*names, "seed")}
        )

    def ask(self) -> np.ndarray:
        """Return the current population (islands * population, dimensions), island after island.

        The caller must not change it.
        """
        return self._points

    def tell(self, fitness: np.ndarray) -> None:
        """Breed the next generation from the fitness (islands * population,) of the points of `ask`, in their order."""
        islands, population, dimensions = self.shape
        points, fitness = self._points, np.asarray(fitness, dtype=float)
        self.evaluations += len(points)
        if fitness.min() < self.best_fitness:
            self.best, self.best_fitness = (
                points[fitness.argmin()].copy(),
                float(fitness.min()),
            )
        if self.generation % self.generations == 0:
            self._draw()
        step = self.generation % self.generations
        self.generation += 1

        order = self._ranked(fitness)
        if self.generation % self.generations == 0:
            points, fitness = self._migrate(points, fitness, order)
            order = self._ranked(fitness)
        # a tournament depends on ranks alone: the winner of three is the smallest of three random ranks
        parents = points[order.take(self._winners[step] + self._first)]
        children = self._cross(parents[:, :population], parents[:, population:], step)
        children += self._mutation[step]
        np.minimum(children, 1.0, out=children)
        np.maximum(children, -1.0, out=children)
        self._keep_best(children, points[order[:, 0]])
        self._points = children.reshape(islands * population, dimensions)

    def _migrate(
        self, points: np.ndarray, fitness: np.ndarray, order: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Migrate round the ring."""
        return migrate(points, fitness, order)

    def _cross(self, a: np.ndarray, b: np.ndarray, step: int) -> np.ndarray:
        """Cross parents a and b (islands, population, dimensions) arithmetically."""
        return b + self._share[step] * (a - b)

    def _keep_best(self, children: np.ndarray, best: np.ndarray) -> None:
        """Put each island's best (islands, dimensions) in place of its first child."""
        children[:, 0] = best

    def _draw(self) -> None:
        """Draw all random numbers of one round at once: a call of the generator costs more than its numbers."""
        islands, population, dimensions = self.shape
        shape, random = (self.generations, islands, population), self.random
        ranks = random.randint(
            population,
            size=(self.tournament, self.generations, islands, 2 * population),
        )
        self._winners = ranks.min(axis=0)
        self._share = random.uniform(size=(*shape, 1))
        mutated = random.uniform(size=(*shape, dimensions)) < self.mutation_probability
        self._mutation = np.where(
            mutated, self.mutation_amplitude * random.normal(size=mutated.shape), 0.0
        )

    def _ranked(self, fitness: np.ndarray) -> np.ndarray:
        """Return row numbers (islands, population) of each island's individuals, best first."""
        islands, population, _ = self.shape
        return (
            fitness.reshape(islands, population).argsort(axis=1, kind="stable")
            + self._first
        )


def migrate(
    points: np.ndarray, fitness: np.ndarray, order: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Make copies in which the best of each island replaces the worst of the next one in the ring.

    `points` (islands * population, dimensions) have `fitness` (islands * population,); `order` (islands, population)
    holds the row numbers of each island, best first.
    """
    points, fitness = points.copy(), fitness.copy()
    best, worst_of_next = order[:, 0], np.roll(order[:, -1], -1)
    points[worst_of_next], fitness[worst_of_next] = points[best], fitness[best]
    return points, fitness


@dataclass(frozen=True)
class Minimum:
    """Result of `islands_ga`; names as in `scipy.optimize.OptimizeResult`."""

    x: np.ndarray  # (dimensions,), the best point
    fun: float  # its value
    nfev: int  # number of evaluations
    nit: int  # number of generations
    success: bool | None  # whether `fun` is at most the target; None without a target
    history: np.ndarray  # (nit,), the best value so far after each generation


def islands_ga(
    objective: Callable[[np.ndarray], np.ndarray],
    bounds: Sequence[tuple[float, float]] | np.ndarray,
    rounds: int = 50,
    target: float | None = None,
    **settings: Any,
) -> Minimum:
    """Minimise a function of whole populations with `MIGA`.

    `objective` takes points (n, dimensions) in the units of the bounds and returns values (n,); an infinite value marks
    a point to avoid. `rounds` is the number of migrations. The search ends early at the value `target`. `settings` are
    as of `MIGA`. ValueError for bad bounds or settings, another shape, or NaN.
    """
    bounds = np.asarray(bounds, dtype=float)
    if bounds.ndim != 2 or bounds.shape[1] != 2 or not np.isfinite(bounds).all():
        raise ValueError(
            f"bounds has shape {bounds.shape}; expected (dimensions, 2), all finite"
        )
    low, high = bounds.T
    if not (low < high).all():
        raise ValueError(
            f"bounds is {bounds.tolist()}; expected each lowest below its highest"
        )
    if rounds < 1:
        raise ValueError(f"rounds is {rounds!r}; expected at least 1")
    miga = MIGA(len(bounds), **settings)
    half_width, history = (high - low) / 2, []

    def in_units(points: np.ndarray) -> np.ndarray:
        return np.clip(low + (points + 1) * half_width, low, high)

    for _ in range(rounds * miga.generations):
        fitness = np.asarray(objective(in_units(miga.ask())), dtype=float)
        if fitness.shape != (len(miga.ask()),) or np.isnan(fitness).any():
            raise ValueError(
                f"objective returned shape {fitness.shape} with {np.isnan(fitness).sum()} NaN; "
                f"expected ({len(miga.ask())},) without"
            )
        miga.tell(fitness)
        history.append(miga.best_fitness)
        if target is not None and miga.best_fitness <= target:
            break
    if miga.best is None:
        raise ValueError(
            f"objective is infinite at all {miga.evaluations} points; expected finite at one"
        )
    success = None if target is None else miga.best_fitness <= target
    x, evaluations = in_units(miga.best), miga.evaluations
    return Minimum(
        x, miga.best_fitness, evaluations, miga.generation, success, np.array(history)
    )
