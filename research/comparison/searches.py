"""The searches that are compared: functions of a `Log` and a seed that end by `Spent`.

Every search minimises the fitness that `miga` does (Eq. 11-12 and its constraints) over the free parameters in
[-1, 1]. Its log counts the evaluations. A search that ends early starts again elsewhere until all are used.

  miga                    multi-island genetic algorithm, as configured
  miga_whole              the same with all of its configured evaluations
  one_population          the same operators, one island of as many individuals
  differential_evolution  scipy's, population 15 times the number of parameters
  dual_annealing          scipy's, with its local search
  cma_es                  covariance matrix adaptation (cmaes 0.13), population by its rule
  least_squares           scipy's trust region on the deviations, from random points, derivatives by differences
  random                  uniform points
"""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from scipy import optimize

from repose.calibrate.search.miga import MIGA
from repose.calibrate.search.objective import Objective
from repose.calibrate.search.settings import MigaSettings

STEP = 1e-6  # of the differences
Respond = Callable[[np.ndarray], np.ndarray]
Search = Callable[["Log", int], None]


class Spent(Exception):
    """All evaluations are used."""


class Log:
    """Counts and keeps the evaluations of a search, and ends it by `Spent` when they are used up.

    `respond` maps populations in [-1, 1] (n, d) to responses (n, k). Points and fitness are kept in the order of the
    calls.
    """

    def __init__(
        self, respond: Respond, objective: Objective, evaluations: int, dimensions: int
    ):
        self.respond = respond
        self.objective = objective
        self.dimensions = dimensions
        self._points = np.empty((evaluations, dimensions))
        self._fitness = np.empty(evaluations)
        self.used = 0

    @property
    def points(self) -> np.ndarray:
        """Points that were evaluated, (used, d)."""
        return self._points[: self.used]

    @property
    def fitness(self) -> np.ndarray:
        """Their fitness, (used,)."""
        return self._fitness[: self.used]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Fitness (n,) of points (n, d)."""
        return self._keep(points, self.respond(points))

    def of_one(self, x: np.ndarray) -> float:
        """Fitness of one point (d,) in [-1, 1]."""
        return float(self(np.asarray(x)[None])[0])

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Deviations (k,) of one point's responses from the targets, in widths of their ranges; x (d,) in [-1, 1]."""
        return self._residuals(np.asarray(x)[None])[0]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Take derivatives (k, d) of the deviations, by differences into the box; d evaluations, x counts already."""
        steps = STEP * np.where(np.asarray(x) > 0, -1.0, 1.0)
        moved = self._residuals(np.asarray(x) + np.diag(steps))
        return ((moved - self._residuals_at(x)) / steps[:, None]).T

    def _residuals_at(self, x):
        """Residuals of a point that was counted already."""
        return (
            self.respond(np.asarray(x)[None])[0] - self.objective.target
        ) / self.objective.width

    def _residuals(self, points):
        """Deviations of points, which are counted."""
        responses = self.respond(points)
        self._keep(points, responses)
        return (responses - self.objective.target) / self.objective.width

    def _keep(self, points, responses):
        """Fitness of points, kept as far as evaluations are left."""
        room = len(self._fitness) - self.used
        if room == 0:
            raise Spent
        rows = slice(self.used, self.used + min(room, len(points)))
        self._points[rows] = points[:room]
        self._fitness[rows] = self.objective.fitness(*self.objective(responses[:room]))
        self.used = rows.stop
        if room < len(points):
            raise Spent
        return self._fitness[rows]


def miga(log: Log, seed: int, **settings: Any) -> None:
    """Run the multi-island genetic algorithm; `settings` are keys of the section `miga`."""
    search = MIGA(log.dimensions, MigaSettings.with_defaults(**settings, seed=seed))
    while True:
        search.tell(log(search.ask()))


def differential_evolution(log: Log, seed: int) -> None:
    """Differential evolution of scipy, whole populations at once."""
    for restart in range(10**6):
        optimize.differential_evolution(
            lambda x: log(x.T),
            [(-1, 1)] * log.dimensions,
            maxiter=10**6,
            tol=0.0,
            atol=1e-9,
            polish=False,
            updating="deferred",
            vectorized=True,
            rng=np.random.default_rng([seed, restart]),
        )


def dual_annealing(log: Log, seed: int) -> None:
    """Dual annealing of scipy."""
    for restart in range(10**6):
        random = np.random.default_rng([seed, restart])
        optimize.dual_annealing(
            log.of_one,
            [(-1, 1)] * log.dimensions,
            maxiter=10**6,
            maxfun=1e12,
            rng=random,
        )


def cma_es(log: Log, seed: int) -> None:
    """Covariance matrix adaptation of the package cmaes."""
    from cmaes import CMA

    bounds = np.tile([-1.0, 1.0], (log.dimensions, 1))
    for restart in range(10**6):
        random = np.random.default_rng([seed, restart])
        start = random.uniform(-1, 1, log.dimensions)
        stream = int(random.integers(2**31))
        search = CMA(mean=start, sigma=0.5, bounds=bounds, seed=stream)
        while not search.should_stop():
            points = np.array([search.ask() for _ in range(search.population_size)])
            search.tell(list(zip(points, log(points), strict=True)))


def least_squares(log: Log, seed: int) -> None:
    """Least squares of scipy from one random point after another."""
    random = np.random.default_rng(seed)
    while True:
        start = random.uniform(-1, 1, log.dimensions)
        optimize.least_squares(log.residuals, start, log.jacobian, bounds=(-1, 1))


def uniform(log: Log, seed: int) -> None:
    """Uniform random points."""
    random = np.random.default_rng(seed)
    while True:
        log(random.uniform(-1, 1, (2000, log.dimensions)))


OPERATORS = (
    "islands",
    "population",
    "generations",
    "tournament",
    "mutation_probability",
    "mutation_amplitude",
)
SEARCHES: dict[str, Search] = {
    "differential_evolution": differential_evolution,
    "dual_annealing": dual_annealing,
    "cma_es": cma_es,
    "least_squares": least_squares,
    "random": uniform,
}


def searches(section: Mapping[str, Any]) -> dict[str, tuple[Search, int | None]]:
    """All searches by name, each with its own number of evaluations; None means the common number.

    `section` is `miga` of the configuration.
    """
    operators = {key: section[key] for key in OPERATORS}
    alone = operators | {
        "islands": 1,
        "population": section["islands"] * section["population"],
    }
    whole = section["rounds"] * section["generations"] * alone["population"]
    found: dict[str, tuple[Search, int | None]] = {
        "miga": (partial(miga, **operators), None),
        "miga_whole": (partial(miga, **operators), whole),
        "one_population": (partial(miga, **alone), None),
    }
    return found | {name: (search, None) for name, search in SEARCHES.items()}


def logged(
    search: Search,
    respond: Respond,
    objective: Objective,
    evaluations: int,
    dimensions: int,
    seed: int,
) -> tuple[Log, float]:
    """One search with all its evaluations used, and its time [s]; arguments as for `Log`."""
    log = Log(respond, objective, evaluations, dimensions)
    began = time.perf_counter()
    with suppress(Spent):
        search(log, seed)
    return log, time.perf_counter() - began
