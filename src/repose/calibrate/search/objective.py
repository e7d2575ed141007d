"""The objective that the search minimises, and the archive of the points that it keeps.

The publication does not say how it treats points outside the ranges of the targets.
Here the fitness of a point is F (Eq. 11) if all its responses lie in the ranges.
Otherwise it is F + F_max + 10 V, where V is the distance of the responses from the
ranges in the units of F, and F_max is the largest F inside the ranges. So every
feasible point is better than every other point. As long as no point is feasible, the
search moves towards the ranges. If the ranges cannot be reached, `constrained=False`
minimises F alone.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.miga import MIGA
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.targets import Targets

ArrayFunction = Callable[[np.ndarray], np.ndarray]
Deviation = Callable[[np.ndarray], np.ndarray]
# Penalty of a point outside the ranges, for each unit of V.
VIOLATION_PENALTY = 10.0
# Weight of the priors relative to F, see `Preference`.
PRIOR_WEIGHT = 0.01
# Fitness of a point that violates a constraint between parameters. It is larger than
# the fitness of any allowed point. It is multiplied by 1 plus the violation, so of two
# such points the less violating one is better (Deb 2000, Comput. Methods Appl. Mech.
# Eng. 186, 311).
FORBIDDEN_FITNESS = 1e12
# A point is dropped if a better point is near it. The better point may later be dropped
# in favour of a third one, which may be far from the first. The archive therefore holds
# more points than there are solutions.
ARCHIVED_PER_SOLUTION = 5
HISTORY_COLUMNS = (
    "round",
    "generation",
    "evaluations",
    "best_objective",
    "mean_objective",
    "feasible_found",
)


class Objective:
    """The function of k responses that the search minimises.

    It has two parts. F is the weighted sum of the deviations from the targets, in
    widths of the ranges, and V the sum of the distances from the ranges. With the
    weight w_k, the target t_k and the range l_k to h_k of each response y_k:

        F = sum_k w_k |y_k - t_k| / (h_k - l_k)                     (Eq. 11-12)
        V = sum_k max(l_k - y_k, y_k - h_k, 0) / (h_k - l_k)

    Parameters
    ----------
    targets : Targets
        The targets of the study.
    largest_preference : float
        The largest cost that a preference adds to any point (`Preference.largest`). It
        is added to the fitness of points outside the ranges, so that they stay worse
        than all points inside.
    constrained : bool
        Whether points outside the ranges have a penalty. Without it the fitness is F
        everywhere.
    """

    def __init__(
        self,
        targets: Targets,
        largest_preference: float = 0.0,
        constrained: bool = True,
    ) -> None:
        """Set the arrays (k,) of the targets, and choose the penalty.

        Parameters
        ----------
        targets : Targets
            The targets of the study.
        largest_preference : float, optional
            The largest cost that a preference adds to any point.
        constrained : bool, optional
            Whether points outside the ranges have a penalty.
        """
        self.low = targets.low
        self.high = targets.high
        self.target = targets.aim
        self.weight = targets.weight
        self.width = self.high - self.low
        # The fitness of a point outside the ranges is F + `infeasible_offset` +
        # `penalty` * V.
        if constrained:
            # Inside the ranges F is at most the sum of the weights. With this offset,
            # every point outside costs more than any point inside.
            self.infeasible_offset = float(self.weight.sum()) + largest_preference
            self.penalty = VIOLATION_PENALTY
        else:
            self.infeasible_offset = 0.0
            self.penalty = 0.0

    def __call__(self, responses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute the deviation F from the targets, and the violation V of the ranges.

        The docstring of the class has the formulas.

        Parameters
        ----------
        responses : array (points, k)
            Predicted responses.

        Returns
        -------
        F, V : array (points,)
            V is 0 inside the ranges.
        """
        # Divide all numbers by the widths before the subtractions. The other order
        # would change the rounding, and with it the course of a search.
        scaled = responses / self.width
        deviations = np.abs(scaled - self.target / self.width)
        F = (self.weight * deviations).sum(axis=1)
        below = self.low / self.width - scaled
        above = scaled - self.high / self.width
        outside = np.maximum(np.maximum(below, above), 0.0)
        return F, outside.sum(axis=1)

    def fitness(self, F: np.ndarray, V: np.ndarray) -> np.ndarray:
        """Compute the fitness (n,) that the search minimises."""
        return F + (V > 0) * self.infeasible_offset + self.penalty * V


@dataclass(frozen=True)
class Preference:
    """Small penalty for parameters that deviate from their priors, far below F.

    A parameter that deviates by z standard deviations costs `PRIOR_WEIGHT` z^2 / 2. For
    z = 1 this equals a deviation of half a percent of a target's range. So the targets
    have priority. Among the many parameter sets that meet them equally well, the search
    prefers those near the means of the priors.
    """

    mean: np.ndarray  # (d,), in the search's coordinates [-1, 1]
    sd: np.ndarray  # (d,), likewise; infinite for a parameter without a prior
    # For each parameter with a prior on a scale that is not linear: its column, and the
    # function that computes its deviation in standard deviations. Its `mean` above is 0
    # and its `sd` infinite.
    not_linear: tuple[tuple[int, Deviation], ...] = ()

    @classmethod
    def from_priors(cls, space: ParameterSpace) -> "Preference | None":
        """Make the preference of a study from the priors of its parameters.

        Parameters
        ----------
        space : ParameterSpace
            The parameters of the study.

        Returns
        -------
        Preference or None
            None if no parameter has a prior.
        """
        if not space.prior:
            return None
        # With an infinite standard deviation, a parameter without a prior costs nothing.
        mean = np.zeros(space.dimensions)
        sd = np.full(space.dimensions, np.inf)
        not_linear = []
        for name, (prior_mean, prior_sd) in space.prior.items():
            k = space.free.index(name)
            if name in space.scale:
                # On a scale that is not linear, the deviation is no linear function of
                # the coordinate, so a function computes it.
                not_linear.append((k, _make_deviation(space, name)))
            else:
                # Convert the prior to the coordinate of the search, in which the range
                # of a parameter goes from -1 to 1.
                half_width = (space.high[k] - space.low[k]) / 2
                mean[k] = (prior_mean - space.low[k]) / half_width - 1
                sd[k] = prior_sd / half_width
        return cls(mean, sd, tuple(not_linear))

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Compute the cost (n,) of points (n, d) in [-1, 1]."""
        deviations = (points - self.mean) / self.sd
        for k, deviation in self.not_linear:
            deviations[:, k] = deviation(points[:, k])
        return PRIOR_WEIGHT / 2 * (deviations**2).sum(axis=1)

    @property
    def largest(self) -> float:
        """The largest cost of a point in [-1, 1], which is reached in a corner."""
        corner = np.where(self.mean > 0, -1.0, 1.0)
        for k, deviation in self.not_linear:
            at_ends = np.abs(deviation(np.array([-1.0, 1.0])))
            corner[k] = -1.0 if at_ends[0] > at_ends[1] else 1.0
        return float(self(corner[None])[0])

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Compute the distance (n,) of points (n, d) from the means of the priors.

        The unit is the standard deviation.
        """
        return np.sqrt(2 / PRIOR_WEIGHT * self(points))


def _make_deviation(space: ParameterSpace, name: str) -> Deviation:
    """Make a function that computes the deviation of a parameter from its prior.

    The function takes coordinates (n,) in [-1, 1], and returns deviations (n,) in
    standard deviations of the prior.
    """
    mean, sd = space.prior[name]
    return lambda points: (space.values_at(name, (points + 1) / 2) - mean) / sd


class Archive:
    """The best distinct points out of any number, in bounded memory.

    Two points are distinct when they lie at least `distance` apart, Euclidean in
    normalised parameters. The archive goes through the points from the best to the
    worst, and keeps a point when it is distinct from all that are kept already. Added
    points wait in a buffer until `thin` does this.

    Parameters
    ----------
    dimensions : int
        Number of coordinates of a point.
    distance : float
        Minimum distance between two points.
    capacity : int
        Largest number of points that are kept.
    buffer : int
        Largest number of added points that may wait for `thin`.

    Attributes
    ----------
    points : array (kept, dimensions)
        Best first; up to date after `thin`.
    fitness : array (kept,)
        Their fitness; smaller is better.
    """

    def __init__(
        self, dimensions: int, distance: float, capacity: int, buffer: int = 20_000
    ) -> None:
        """Create an empty archive.

        New points wait in a buffer, because it is faster to drop those that are too
        near to better ones (`thin`) for many points at once.

        Parameters
        ----------
        dimensions : int
            Number of coordinates of a point.
        distance : float
            Minimum distance between two points.
        capacity : int
            Largest number of points that are kept.
        buffer : int, optional
            Largest number of points in the buffer.
        """
        self.distance = distance
        self.capacity = capacity
        self.buffer_size = buffer
        self.points = np.empty((0, dimensions))
        self.fitness = np.empty(0)
        # The buffer: points with their fitness, and the number of these points.
        self._waiting: list[tuple[np.ndarray, np.ndarray]] = []
        self._n_waiting = 0
        # Points with this fitness or a larger one cannot enter; `thin` sets it.
        self._entry_limit = math.inf

    def add(self, points: np.ndarray, fitness: np.ndarray) -> None:
        """Add points to the buffer of the archive.

        They wait there until it is full, or until the next call of `thin`. Only then do
        the best of them appear in `points` and `fitness`.

        Parameters
        ----------
        points : array (n, dimensions)
            The points to add.
        fitness : array (n,)
            Their fitness; smaller is better.
        """
        # Drop points that are no better than the worst of a full archive.
        may_enter = fitness < self._entry_limit
        if not may_enter.any():
            return
        new_points = points[may_enter]
        new_fitness = fitness[may_enter]
        # Add the points in parts that fit into the buffer. If the buffer has too little
        # room for a part, empty it first.
        for start in range(0, len(new_points), self.buffer_size):
            part = slice(start, start + self.buffer_size)
            n_added = len(new_points[part])
            if self._n_waiting + n_added > self.buffer_size:
                self.thin()
            self._waiting.append((new_points[part], new_fitness[part]))
            self._n_waiting += n_added

    def thin(self) -> None:
        """Merge the waiting points into the archive, and drop points near better ones.

        Sets `points` and `fitness`, the best first, and empties the buffer.
        """
        waiting_points = [points for points, _ in self._waiting]
        waiting_fitness = [fitness for _, fitness in self._waiting]
        points = np.concatenate([self.points, *waiting_points])
        fitness = np.concatenate([self.fitness, *waiting_fitness])
        rows = select_distinct(points, fitness, self.distance, self.capacity)
        self.points = points[rows]
        self.fitness = fitness[rows]
        self._waiting = []
        self._n_waiting = 0
        # A full archive takes only points that are better than its worst one, the last.
        # But a new point may replace several old points near it. Then the archive is no
        # longer full, and a point of any fitness may enter.
        is_full = len(rows) == self.capacity
        self._entry_limit = self.fitness[-1] if is_full else math.inf


def select_distinct(
    points: np.ndarray, fitness: np.ndarray, distance: float, limit: int
) -> np.ndarray:
    """Find the best points that are distinct from each other.

    Parameters
    ----------
    points : array (n, d)
        The points.
    fitness : array (n,)
        Smaller is better.
    distance : float
        Minimum distance between two distinct points.
    limit : int
        Largest number of points to find.

    Returns
    -------
    array of int
        Rows of these points, best first.
    """
    # Rows and coordinates (d, remaining) of the remaining points, the best first.
    rows = np.argsort(fitness, kind="stable")
    coordinates = np.ascontiguousarray(points[rows].T)
    distinct_rows: list[int] = []
    while len(rows) and len(distinct_rows) < limit:
        # Keep the best remaining point. Then drop it, and all points too near to it.
        distinct_rows.append(int(rows[0]))
        best = coordinates[:, :1]
        squared_distances = ((coordinates - best) ** 2).sum(axis=0)
        is_distinct = squared_distances >= distance**2
        is_distinct[0] = False
        remaining = np.flatnonzero(is_distinct)  # twice as fast as the mask itself
        rows = rows[remaining]
        coordinates = coordinates.take(remaining, axis=1)
    return np.array(distinct_rows, dtype=int)


class SearchResult(NamedTuple):
    """Result of `search_points`."""

    archive: Archive  # the best distinct points, thinned
    history: list[tuple]  # a row with the columns `HISTORY_COLUMNS` for each round
    n_feasible: int  # number of feasible points, repeated ones included


def search_points(
    predict: ArrayFunction,
    objective: Objective,
    n_inputs: int,
    settings: MigaSettings,
    preference: Preference | None = None,
    compute_violation: ArrayFunction | None = None,
) -> SearchResult:
    """Search for the points with the smallest objective by the genetic algorithm `MIGA`.

    Parameters
    ----------
    predict : callable
        Maps points (n, n_inputs) in [-1, 1] to responses (n, k).
    objective : Objective
        The function to minimise.
    n_inputs : int
        Number of coordinates of a point.
    settings : MigaSettings
        The section `miga`.
    preference : Preference, optional
        Its cost is added to the fitness.
    compute_violation : callable, optional
        Maps points (n, n_inputs) to their violations (n,) of the constraints between
        parameters. Only points with the violation 0 enter the archive.

    Returns
    -------
    SearchResult
        The best distinct points, and the course of the search.
    """
    miga = MIGA(n_inputs, settings)
    archive = Archive(
        n_inputs, settings.distance, ARCHIVED_PER_SOLUTION * settings.solutions
    )
    history = []
    n_feasible = 0
    for round_number in range(1, settings.rounds + 1):
        populations = []
        for _ in range(settings.generations):
            # `ask` returns a generation, and `tell` breeds the next one.
            population = _evaluate_population(
                miga.ask(), predict, objective, preference
            )
            is_allowed = _tell_fitness(miga, population, compute_violation)
            allowed = population.select(is_allowed)
            populations.append(allowed)
            n_feasible += allowed.count_feasible()

        # Offer the points of the whole round at once, which is faster.
        archive.add(
            np.concatenate([population.points for population in populations]),
            np.concatenate([population.fitness for population in populations]),
        )
        # The order of the numbers must be that of `HISTORY_COLUMNS`.
        row = (
            round_number,
            miga.generation,
            miga.evaluations,
            miga.best_fitness,
            populations[-1].mean_fitness(),
            n_feasible,
        )
        history.append(row)
    archive.thin()
    return SearchResult(archive, history, n_feasible)


class _Population(NamedTuple):
    """Points of one generation with their fitness."""

    points: np.ndarray  # (n, n_inputs)
    fitness: np.ndarray  # (n,), the smaller the better
    violation: np.ndarray  # (n,), V of the ranges of the targets; 0 inside all of them

    def select(self, is_chosen: np.ndarray) -> "_Population":
        """Return the points at which a mask (n,) is true."""
        return _Population(*(array[is_chosen] for array in self))

    def count_feasible(self) -> int:
        """Count the points inside the ranges of all targets."""
        return int(np.count_nonzero(self.violation == 0))

    def mean_fitness(self) -> float:
        """Average the fitness; NaN if the constraints allow none of the points."""
        return float(self.fitness.mean()) if len(self.fitness) else math.nan


def _evaluate_population(
    points: np.ndarray,
    predict: ArrayFunction,
    objective: Objective,
    preference: Preference | None,
) -> _Population:
    """Compute the fitness of points (n, n_inputs).

    The other arguments are those of `search_points`.
    """
    F, V = objective(predict(points))
    fitness = objective.fitness(F, V)
    if preference is not None:
        fitness += preference(points)
    return _Population(points, fitness, V)


def _tell_fitness(
    miga: MIGA, population: _Population, compute_violation: ArrayFunction | None
) -> np.ndarray:
    """Tell the search the fitness of a generation, and return which points are allowed.

    A point that violates a constraint between parameters gets a penalty in place of its
    fitness, which guides the search back to allowed points.

    Parameters
    ----------
    miga : MIGA
        The search. Afterwards it is at the next generation.
    population : _Population
        The current generation.
    compute_violation : callable or None
        As in `search_points`.

    Returns
    -------
    array (n,)
        Mask of the points that obey the constraints. Only they count as results of the
        search.
    """
    if compute_violation is None:
        miga.tell(population.fitness)
        return np.full(len(population.points), True)
    # This is the violation of constraints between parameters, not of the ranges of the
    # targets, which is part of the fitness.
    violation = compute_violation(population.points)
    is_allowed = violation <= 0
    penalty = FORBIDDEN_FITNESS * (1 + violation)
    miga.tell(np.where(is_allowed, population.fitness, penalty))
    return is_allowed
