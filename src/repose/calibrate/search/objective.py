"""The objective of the search, and the archive of the points that it keeps.

The publication does not define the constraints. Here the fitness of a point whose responses all lie in the targets'
ranges is F (Eq. 11), and that of any other point F + F_max + 10 V, with the distance V of the responses from the ranges
in the units of F, and F_max the largest F inside. So every feasible point is better than every other point, and without
a feasible point the search moves towards the ranges. Where they cannot be met, `constrained=False` minimises F alone.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.miga import MIGA
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.targets import Targets

Function = Callable[[np.ndarray], np.ndarray]
PENALTY = 10.0
PRIOR_WEIGHT = 0.01
HISTORY = (
    "round",
    "generation",
    "evaluations",
    "best_objective",
    "mean_objective",
    "feasible_found",
)


class Objective:
    """Eq. 11-12: deviation of k responses from their targets, each in widths of its range.

    `margin` is added to the fitness of points outside the ranges: the largest cost inside (`Preference.largest`).
    Unless `constrained`, the fitness is F everywhere.
    """

    def __init__(
        self, targets: Targets, margin: float = 0.0, constrained: bool = True
    ) -> None:
        self.low, self.high, self.target, self.weight = (
            targets.low,
            targets.high,
            targets.aim,
            targets.weight,
        )
        self.width = self.high - self.low
        # F inside is at most the sum of the weights
        self.infeasible = float(self.weight.sum()) + margin if constrained else 0.0
        self.penalty = PENALTY if constrained else 0.0

    def __call__(self, responses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute F (Eq. 11) and the violation V of the ranges, both (points,), of responses (points, k)."""
        scaled = responses / self.width
        F = (self.weight * np.abs(scaled - self.target / self.width)).sum(axis=1)
        outside = np.maximum(
            np.maximum(self.low / self.width - scaled, scaled - self.high / self.width),
            0.0,
        )
        return F, outside.sum(axis=1)

    def fitness(self, F: np.ndarray, V: np.ndarray) -> np.ndarray:
        """Compute the minimised fitness (n,): F inside the ranges (V = 0); outside, more than of any point inside."""
        return F + (V > 0) * self.infeasible + self.penalty * V


@dataclass(frozen=True)
class Preference:
    """Prior knowledge of parameters, as a term that is small beside F.

    Measured parameters z standard deviations off cost 0.01 z^2 / 2: for z = 1 as much as half a percent of a target's
    range. So the targets have priority, and among the many parameter sets that meet them equally well the search
    prefers those near the measured values.
    """

    mean: np.ndarray  # (d,), in the search's coordinates [-1, 1]
    sd: np.ndarray  # (d,), likewise; infinite for a parameter without a prior

    @classmethod
    def of(cls, space: ParameterSpace) -> "Preference | None":
        """Make the preference of a study's parameters; None without priors."""
        if not space.prior:
            return None
        mean, sd = np.zeros(space.dimensions), np.full(space.dimensions, np.inf)
        for name, (value, spread) in space.prior.items():
            k = space.free.index(name)
            half = (space.high[k] - space.low[k]) / 2
            mean[k], sd[k] = (value - space.low[k]) / half - 1, spread / half
        return cls(mean, sd)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Compute the cost (n,) of points (n, d) in [-1, 1]."""
        return PRIOR_WEIGHT / 2 * (((points - self.mean) / self.sd) ** 2).sum(axis=1)

    @property
    def largest(self) -> float:
        """The highest cost of a point."""
        return float(self(np.where(self.mean > 0, -1.0, 1.0)[None])[0])

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Compute the distance (n,) of points (n, d) from the measured values, in standard deviations."""
        return np.sqrt(2 / PRIOR_WEIGHT * self(points))


class Archive:
    """The best distinct points out of any number, in bounded memory.

    Two points are distinct when they lie at least `distance` apart, Euclidean in normalised parameters. A point is
    kept, best fitness first, when it is distinct from every better kept point. `points` (kept, dimensions) and
    `fitness` (kept,) are up to date after `thin`; `buffer` is the number of points that wait for it.
    """

    def __init__(
        self, dimensions: int, distance: float, capacity: int, buffer: int = 20_000
    ) -> None:
        self.distance, self.capacity, self.buffer = distance, capacity, buffer
        self.points, self.fitness = np.empty((0, dimensions)), np.empty(0)
        self._waiting: list[tuple[np.ndarray, np.ndarray]] = []
        self._n_waiting, self._worst = 0, math.inf

    def add(self, points: np.ndarray, fitness: np.ndarray) -> None:
        """Offer points (n, dimensions) with their fitness (n,)."""
        better = fitness < self._worst
        if not better.any():
            return
        points, fitness = points[better], fitness[better]
        for start in range(0, len(points), self.buffer):
            rows = slice(start, start + self.buffer)
            if self._n_waiting + len(points[rows]) > self.buffer:
                self.thin()
            self._waiting.append((points[rows], fitness[rows]))
            self._n_waiting += len(points[rows])

    def thin(self) -> None:
        """Merge the waiting points into `points` and `fitness`, best first."""
        points = np.concatenate([self.points, *(p for p, _ in self._waiting)])
        fitness = np.concatenate([self.fitness, *(f for _, f in self._waiting)])
        kept = distinct(points, fitness, self.distance, self.capacity)
        self.points, self.fitness = points[kept], fitness[kept]
        self._waiting, self._n_waiting = [], 0
        # a new point between old points may replace several of them: then any point may fill the gap
        self._worst = self.fitness[-1] if len(kept) == self.capacity else math.inf


def distinct(
    points: np.ndarray, fitness: np.ndarray, distance: float, most: int
) -> np.ndarray:
    """Find the row numbers of the best distinct points (n, d), best first, at most `most`; a small fitness is good."""
    rows = np.argsort(fitness, kind="stable")
    columns = np.ascontiguousarray(points[rows].T)
    kept: list[int] = []
    while len(rows) and len(kept) < most:
        kept.append(int(rows[0]))
        far = ((columns - columns[:, :1]) ** 2).sum(axis=0) >= distance**2
        far[0] = False
        left = np.flatnonzero(far)  # twice as fast as the mask itself
        rows, columns = rows[left], columns.take(left, axis=1)
    return np.array(kept, dtype=int)


def search(
    respond: Function,
    objective: Objective,
    inputs: int,
    settings: MigaSettings,
    preference: Preference | None = None,
) -> tuple[Archive, list[tuple], int]:
    """Search with `MIGA`; return the archive, thinned; a row (`HISTORY`) per round; the number of feasible points met.

    `respond` maps points (n, inputs) in [-1, 1] to responses (n, k). The archive holds five times
    `solutions` points, since a point that is thinned away may lose its better neighbour later.
    """
    miga = MIGA.of(inputs, settings)
    archive = Archive(inputs, settings.distance, 5 * settings.solutions)
    history, feasible_met = [], 0
    for round_ in range(1, settings.rounds + 1):
        seen = []
        for _ in range(settings.generations):
            points = miga.ask()
            F, V = objective(respond(points))
            fitness = objective.fitness(F, V)
            if preference is not None:
                fitness += preference(points)
            seen.append((points, fitness))
            feasible_met += int(np.count_nonzero(V == 0))
            miga.tell(fitness)
        archive.add(
            np.concatenate([p for p, _ in seen]), np.concatenate([f for _, f in seen])
        )
        mean = float(fitness.mean())
        history.append(
            (
                round_,
                miga.generation,
                miga.evaluations,
                miga.best_fitness,
                mean,
                int(feasible_met),
            )
        )
    archive.thin()
    return archive, history, int(feasible_met)
