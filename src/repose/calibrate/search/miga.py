"""Multi-island genetic algorithm (MIGA), section 3.3 of the paper.

The published search has five islands of 40 individuals each, in normalised parameters
[-1, 1]. It uses tournaments of three, arithmetic crossover, and mutation with
probability 0.05 and amplitude 0.1. Each island keeps its best individual, and every 10
generations sends a copy of it to the next island in a ring. This happens 870 times.
`islands_ga` minimises any function of whole populations inside bounds::

    from repose.calibrate.search.miga import islands_ga
    result = islands_ga(lambda x: ((x - 1) ** 2).sum(axis=1), bounds=[(-5, 5)] * 6)

`MIGA` is the same algorithm with the methods `ask` and `tell`, for points in [-1, 1].

The publication leaves some details open. The choices here are:

crossover
    Every child comes from a crossover. It is r a + (1 - r) b with one number r for all
    genes, uniform in [0, 1]. The parents a and b are winners of two tournaments, whose
    individuals are drawn with replacement from the island.
mutation
    Each gene mutates independently, by 0.1 times a standard normal number. It is then
    clipped to the box.
best kept
    The best individual of an island replaces one child of the next generation.
migration
    The best individual of island i replaces the worst of island i + 1, before breeding
    and on all islands at once. It also stays on its own island.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from repose.calibrate.search.settings import MigaSettings


class MIGA:
    """The multi-island genetic algorithm, with one `ask` and one `tell` per generation.

    Each gene lies in [-1, 1].

    Parameters
    ----------
    dimensions : int
        Number of genes.
    settings : MigaSettings, optional
        By default those of config/method.yaml.

    Attributes
    ----------
    best : array (dimensions,) or None
        The best point so far; None before the first `tell`.
    best_fitness : float
        Its fitness; infinite before the first `tell`.
    generation, evaluations : int
        Number of generations and of points so far.

    Raises
    ------
    ValueError
        If the number of genes is 0.
    """

    def __init__(self, dimensions: int, settings: MigaSettings | None = None) -> None:
        """Draw the first population at random, with the seed of the settings.

        Parameters
        ----------
        dimensions : int
            Number of coordinates of a point.
        settings : MigaSettings, optional
            None stands for the settings of config/method.yaml.
        """
        if not dimensions >= 1:
            raise ValueError(f"dimensions is {dimensions!r}; expected at least 1")
        self.settings = settings or MigaSettings.with_defaults()
        islands = self.settings.islands
        population = self.settings.population
        self.shape = (islands, population, dimensions)
        self.generations = self.settings.generations
        self.mutation_probability = self.settings.mutation_probability
        self.mutation_amplitude = self.settings.mutation_amplitude
        # `RandomState` never changes its random numbers, so the search stays
        # reproducible with later versions of NumPy.
        self.random = np.random.RandomState(self.settings.seed)
        # Row of the first individual of each island in `_points`, (islands, 1).
        self._first_rows = population * np.arange(islands)[:, None]
        # The paper scales parameters to [-1, 1], unlike the unit cube of other modules.
        self._points = self.random.uniform(-1, 1, (islands * population, dimensions))
        self.best: np.ndarray | None = None
        self.best_fitness = math.inf
        self.generation = 0
        self.evaluations = 0

    def ask(self) -> np.ndarray:
        """Return the current population (islands * population, dimensions).

        The individuals are in the order of their islands. The caller must not change
        the array.
        """
        return self._points

    def tell(self, fitness: np.ndarray) -> None:
        """Take the fitness of the current generation, and breed the next one.

        Afterwards `ask` returns the next generation. The attributes `best`,
        `best_fitness`, `generation` and `evaluations` are updated.

        Parameters
        ----------
        fitness : array (islands * population,)
            Fitness of the points that `ask` returned, in the same order. Smaller is
            better.
        """
        points = self._points
        fitness = np.asarray(fitness, dtype=float)
        self.evaluations += len(points)

        # Remember the best point of all generations.
        if fitness.min() < self.best_fitness:
            self.best = points[fitness.argmin()].copy()
            self.best_fitness = float(fitness.min())

        # A round has `generations` generations, and ends with a migration. `step` is
        # the number of this generation within its round, from 0. At the first one, draw
        # the random numbers of the whole round.
        step = self.generation % self.generations
        if step == 0:
            self._draw_round()
        self.generation += 1

        # `generation` now also counts this generation, so it is a multiple of
        # `generations` at the end of a round.
        order = self._rank(fitness)
        if self.generation % self.generations == 0:
            points, fitness = self._migrate(points, fitness, order)
            order = self._rank(fitness)
        self._points = self._breed(points, order, step)

    def _breed(self, points: np.ndarray, order: np.ndarray, step: int) -> np.ndarray:
        """Breed the next generation by selection, crossover and mutation.

        The random numbers are those of the last call of `_draw_round`.

        Parameters
        ----------
        points : array (islands * population, dimensions)
            The current generation.
        order : array (islands, population)
            Rows of each island's individuals, best first.
        step : int
            Number of the current generation within its round, from 0.

        Returns
        -------
        array (islands * population, dimensions)
            The next generation.
        """
        islands, population, dimensions = self.shape
        # Choose the parents. An island has 2 * population tournaments, and each of them
        # has drawn the rank of its winner. `take` treats `order` as flat, so
        # `_first_rows` leads to the island. The first half of the winners are the first
        # parents of the children, and the second half the second parents.
        parents = points[order.take(self._winning_ranks[step] + self._first_rows)]
        children = self._cross(parents[:, :population], parents[:, population:], step)
        # Mutate the children. Then move them back into the cube, in place.
        children += self._mutation[step]
        np.minimum(children, 1.0, out=children)
        np.maximum(children, -1.0, out=children)
        self._keep_best(children, points[order[:, 0]])
        return children.reshape(islands * population, dimensions)

    def _migrate(
        self, points: np.ndarray, fitness: np.ndarray, order: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Let the best individuals migrate round the ring of islands."""
        return migrate(points, fitness, order)

    def _cross(self, a: np.ndarray, b: np.ndarray, step: int) -> np.ndarray:
        """Cross parents a and b (islands, population, dimensions) arithmetically."""
        return b + self._first_weights[step] * (a - b)

    def _keep_best(self, children: np.ndarray, best: np.ndarray) -> None:
        """Replace the first child of each island by its best individual, in place.

        `best` (islands, dimensions) has the best individual of each island.
        """
        children[:, 0] = best

    def _draw_round(self) -> None:
        """Draw all random numbers of one round, the generations between two migrations.

        They are stored in `_winning_ranks`, `_first_weights` and `_mutation`. One call
        of the generator for many numbers takes much less time than a call for each
        generation. The order of the calls decides which numbers a seed gives, so it
        must not change.
        """
        islands, population, dimensions = self.shape
        generations = self.generations
        # Each child has two parents, and each parent is the winner of a tournament. An
        # individual takes part in a tournament by its rank in the order of fitness that
        # `_rank` finds: rank 0 is the best of the island, so the smallest rank wins.
        ranks = self.random.randint(
            population,
            size=(self.settings.tournament, generations, islands, 2 * population),
        )
        # The shape is (generations, islands, 2 * population).
        self._winning_ranks = ranks.min(axis=0)
        # A child is a weighted mean of its parents. This is the weight of the first
        # parent.
        self._first_weights = self.random.uniform(
            size=(generations, islands, population, 1)
        )
        genes = (generations, islands, population, dimensions)
        is_mutated = self.random.uniform(size=genes) < self.mutation_probability
        change = self.mutation_amplitude * self.random.normal(size=genes)
        self._mutation = np.where(is_mutated, change, 0.0)

    def _rank(self, fitness: np.ndarray) -> np.ndarray:
        """Sort each island; return rows (islands, population), best first."""
        islands, population, _ = self.shape
        by_island = fitness.reshape(islands, population)
        return by_island.argsort(axis=1, kind="stable") + self._first_rows


def migrate(
    points: np.ndarray, fitness: np.ndarray, order: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Replace the worst individual of each island by the best of its neighbour.

    The islands form a ring, and the neighbour is the previous island.

    Parameters
    ----------
    points : array (islands * population, dimensions)
        The individuals, in the order of their islands.
    fitness : array (islands * population,)
        Their fitness; smaller is better.
    order : array (islands, population)
        Rows of each island's individuals, best first.

    Returns
    -------
    points, fitness : arrays
        Copies with the migrated individuals. The arguments are not changed.
    """
    points = points.copy()
    fitness = fitness.copy()
    # Rows of the best individual of each island, and of the worst on the next island.
    best = order[:, 0]
    worst_of_next = np.roll(order[:, -1], -1)
    points[worst_of_next] = points[best]
    fitness[worst_of_next] = fitness[best]
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
    """Minimise a function with the multi-island genetic algorithm (`MIGA`).

    Parameters
    ----------
    objective : callable
        Takes points (n, dimensions) in the units of the bounds and returns values (n,).
        An infinite value marks a point to avoid.
    bounds : array (dimensions, 2)
        Lowest and highest value of each coordinate.
    rounds : int
        Number of rounds. Each has `generations` generations and ends with a migration.
    target : float, optional
        The search ends early as soon as a value is at most this one.
    **settings
        Fields of `repose.calibrate.search.settings.MigaSettings`; those left out have
        the values of config/method.yaml.

    Returns
    -------
    Minimum

    Raises
    ------
    ValueError
        For bad bounds or settings, or if the objective returns another shape, NaN, or
        no finite value.
    """
    low, high = _check_bounds(bounds).T
    if rounds < 1:
        raise ValueError(f"rounds is {rounds!r}; expected at least 1")
    miga = MIGA(len(low), MigaSettings.with_defaults(**settings))
    half_width = (high - low) / 2
    history = []

    def scale_to_bounds(points: np.ndarray) -> np.ndarray:
        """Convert points from [-1, 1] to the bounds."""
        # Rounding could lead slightly beyond the bounds, so clip the points.
        return np.clip(low + (points + 1) * half_width, low, high)

    # Each pass evaluates one generation, and breeds the next one.
    for _ in range(rounds * miga.generations):
        points = miga.ask()
        n_points = len(points)
        fitness = np.asarray(objective(scale_to_bounds(points)), dtype=float)
        if fitness.shape != (n_points,) or np.isnan(fitness).any():
            raise ValueError(
                f"objective returned shape {fitness.shape} "
                f"with {np.isnan(fitness).sum()} NaN; expected ({n_points},) without NaN"
            )
        miga.tell(fitness)
        history.append(miga.best_fitness)
        if target is not None and miga.best_fitness <= target:
            break
    # There is no best point if every value was infinite.
    if miga.best is None:
        raise ValueError(
            f"objective is infinite at all {miga.evaluations} points; "
            "expected finite at one"
        )
    return Minimum(
        x=scale_to_bounds(miga.best),
        fun=miga.best_fitness,
        nfev=miga.evaluations,
        nit=miga.generation,
        success=None if target is None else miga.best_fitness <= target,
        history=np.array(history),
    )


def _check_bounds(bounds: Any) -> np.ndarray:
    """Convert bounds to an array (dimensions, 2); ValueError if they are invalid."""
    bounds = np.asarray(bounds, dtype=float)
    if bounds.ndim != 2 or bounds.shape[1] != 2 or not np.isfinite(bounds).all():
        raise ValueError(
            f"bounds has shape {bounds.shape}; expected (dimensions, 2), all finite"
        )
    low, high = bounds.T
    if not (low < high).all():
        raise ValueError(
            f"bounds is {bounds.tolist()}; expected low < high in each row"
        )
    return bounds
