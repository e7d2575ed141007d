"""Spread the points of a design by exchanges (enhanced stochastic evolution).

An exchange swaps two values of a column, so a Latin hypercube stays one. The method is
that of Jin, Chen and Sudjianto 2005, J. Stat. Plan. Inference 134:268.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

# The source gives all of these numbers.
FIRST_THRESHOLD = 0.005  # as a fraction of the phi_p of the first design
MAX_CANDIDATES = 50  # number of random exchanges of which the best is tried
MAX_TRIALS = 100  # largest number of trials in a round
# The acceptance is low below the first and high above the second of these accepted
# shares.
LOW_ACCEPTANCE = 0.1
HIGH_ACCEPTANCE = 0.8
# The threshold changes after a round. While the best design improves, it is multiplied
# or divided by the first number. Otherwise it is divided by the second to accept more
# exchanges, or multiplied by the third to accept fewer.
IMPROVEMENT_FACTOR = 0.8
RISE_DIVISOR = 0.7
FALL_FACTOR = 0.9


class Pairs:
    """Points with the repulsion of each pair of them.

    The repulsion of two points is distance^-power. It is large for points near each
    other, so in a good design the sum of all repulsions is small.

    All sums are computed term by term with `cumsum`, because `sum` may add in another
    order. The rounding of a sum can decide between equally good exchanges, and it must
    stay that of the published designs.

    Parameters
    ----------
    points : array (n, d)
        The points of the design.
    doublings : int
        Number of squarings that lead from distance^-2 to distance^-power, so the power
        is 2^(doublings + 1).

    Attributes
    ----------
    points : array (n, d)
        Changed by `exchange`.
    squared_distances : array (n, n)
        Symmetric, and infinite on the diagonal, so that no point repels itself.
    repulsions : array (n, n)
        Symmetric, and 0 on the diagonal.
    """

    def __init__(self, points: np.ndarray, doublings: int) -> None:
        """Compute all distances and repulsions.

        Parameters
        ----------
        points : array (n, d)
            The points of the design.
        doublings : int
            The power of the repulsions is 2^(doublings + 1), because it doubles with
            each squaring.
        """
        n = len(points)
        self.points = points.copy()
        self.doublings = doublings
        # The indices (i, j) of each pair of points, with i > j, so each pair is there
        # once.
        self.pair_indices = np.tril_indices(n, -1)
        self.squared_distances = np.empty((n, n))
        self.repulsions = np.empty((n, n))
        for row in range(n):
            self._update_point(row)

    def _compute_repulsions(self, squared_distances: np.ndarray) -> np.ndarray:
        """Compute the repulsions distance^-power from squared distances."""
        # Repeated squaring is faster than a power, and the published designs use it.
        repulsions = 1.0 / squared_distances
        for _ in range(self.doublings):
            repulsions *= repulsions
        return repulsions

    def _update_point(self, row: int) -> None:
        """Recompute the distances and repulsions between one point and all others."""
        # A cumulative sum adds the columns one by one. See the docstring of the class
        # for the reason.
        squares = (self.points - self.points[row]) ** 2
        squared_distances = np.cumsum(squares, axis=1)[:, -1]
        # The distance of the point from itself counts as infinite.
        squared_distances[row] = np.inf
        repulsions = self._compute_repulsions(squared_distances)
        # The matrices are symmetric, so set a row and a column.
        self.squared_distances[row] = squared_distances
        self.squared_distances[:, row] = squared_distances
        self.repulsions[row] = repulsions
        self.repulsions[:, row] = repulsions

    def sum_repulsions(self) -> float:
        """Sum the repulsions of all pairs."""
        return float(np.cumsum(self.repulsions[self.pair_indices])[-1])

    def compute_changes(self, column: int, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Compute by how much each exchange would change the sum of all repulsions.

        An exchange swaps the values of two rows in a column. Each exchange is evaluated
        by itself, and none of them is applied.

        Parameters
        ----------
        column : int
            The column in which values are swapped.
        i, j : array of int (m,)
            The two rows of each of the m exchanges.

        Returns
        -------
        array (m,)
            Negative for an exchange that improves the design.
        """
        n_exchanges = len(i)
        values = self.points[:, column]
        rows = np.array([i, j])  # (2, m)

        # Squared differences of rows i and j from all rows in this column, (2, m, n).
        column_squares = (values[rows][:, :, None] - values) ** 2

        # A squared distance is a sum over the columns. An exchange swaps the terms of
        # this column between row i and row j.
        shift = column_squares[1] - column_squares[0]
        new_squared = self.squared_distances[rows] + np.array([shift, -shift])
        changes = self._compute_repulsions(new_squared) - self.repulsions[rows]
        # The distance between rows i and j does not change, nor that of a row from
        # itself. So set the changes of both rows in columns i and j to 0.
        changes[:, np.arange(n_exchanges), rows] = 0.0

        # Sum over the other rows and over both rows of an exchange, term by term. See
        # the docstring of the class for the reason.
        terms = changes.transpose(2, 0, 1).reshape(-1, n_exchanges)
        return terms.cumsum(axis=0)[-1]

    def exchange(self, column: int, i: int, j: int) -> None:
        """Swap the values of rows i and j in a column, and update all attributes."""
        self.points[[i, j], column] = self.points[[j, i], column]
        self._update_point(i)
        self._update_point(j)


@dataclass
class _Threshold:
    """How much worse a design may become by an exchange (Jin et al., section 3.2)."""

    value: float  # largest accepted rise of phi_p
    is_rising: bool = True  # whether it rises after a round without improvement

    def adapt(self, is_better: bool, accepted: int, improved: int, trials: int) -> None:
        """Adapt the threshold, which is the attribute `value`, after a round.

        While the best design improves, the threshold is kept so low that few exchanges
        are accepted. When the best design no longer improves, the threshold rises until
        most exchanges are accepted, and then falls until few are. This cycle repeats.

        Parameters
        ----------
        is_better : bool
            Whether the best design improved in this round.
        accepted : int
            Number of exchanges that were accepted.
        improved : int
            Number of accepted exchanges that led to a new best design.
        trials : int
            Number of exchanges that were tried.
        """
        low_acceptance = LOW_ACCEPTANCE * trials
        high_acceptance = HIGH_ACCEPTANCE * trials
        # Improvement: lower the threshold if exchanges are accepted that do not improve
        # the best design, and raise it if hardly any exchange is accepted. If every
        # accepted exchange improves the best design, keep it.
        if is_better:
            if accepted > low_acceptance and improved < accepted:
                self.value *= IMPROVEMENT_FACTOR
            elif accepted <= low_acceptance:
                self.value /= IMPROVEMENT_FACTOR
            return

        # Exploration: reverse the direction at low and at high acceptance.
        if accepted < low_acceptance:
            self.is_rising = True
        elif accepted > high_acceptance:
            self.is_rising = False
        if self.is_rising:
            # The divisor is below 1, so the threshold rises.
            self.value /= RISE_DIVISOR
        else:
            self.value *= FALL_FACTOR


class _Exchange(NamedTuple):
    """An exchange to try: two rows swap their values in a column."""

    column: int
    rows: tuple[int, int]
    total: float  # sum of all repulsions after the exchange
    phi: float  # phi_p after the exchange


class _Walk:
    """A design that changes exchange by exchange.

    Parameters
    ----------
    start : array (n, d)
        The first design.
    doublings : int
        The power p of phi_p is 2^(doublings + 1).

    Attributes
    ----------
    pairs : Pairs
        The design.
    phi : float
        The criterion phi_p of the design, (sum of all repulsions)^(1 / p). The smaller,
        the better.
    """

    def __init__(self, start: np.ndarray, doublings: int) -> None:
        """Begin with a design."""
        self.pairs = Pairs(start, doublings)
        self._exponent = 1.0 / 2.0 ** (doublings + 1)  # 1 / p
        n = len(start)
        # A fifth of all n (n - 1) / 2 exchanges in a column, but not too many.
        self.n_candidates = min(MAX_CANDIDATES, max(1, n * (n - 1) // 10))
        # Exclusive upper limits of the two random numbers that `choose_exchange` draws
        # for each candidate.
        self._limits = np.tile([n, n - 1], self.n_candidates)
        self.recompute_total()

    def recompute_total(self) -> None:
        """Sum all repulsions again, because the rounding errors of many changes add up.

        Sets the sum and `phi`.
        """
        self._total = self.pairs.sum_repulsions()
        self.phi = self._total**self._exponent

    def choose_exchange(self, column: int, rng: np.random.Generator) -> _Exchange:
        """Choose the random exchange in a column that makes phi_p smallest.

        An exchange swaps the values of two rows i and j. Of `n_candidates` random
        exchanges, the one with the smallest sum of all repulsions is chosen. It may
        still be worse than no exchange.
        """
        # Draw the first row i, and an offset from 0 to n - 2. The second row j follows
        # after 1 + offset rows, cyclically. So it is any row but i, all equally likely.
        i, offset = rng.integers(0, self._limits).reshape(-1, 2).T
        j = (i + 1 + offset) % len(self.pairs.points)
        changes = self.pairs.compute_changes(column, i, j)
        best = int(changes.argmin())
        total = self._total + changes[best]
        # Rounding may make the total slightly negative.
        phi = max(total, 0.0) ** self._exponent
        return _Exchange(column, rows=(i[best], j[best]), total=total, phi=phi)

    def apply_exchange(self, exchange: _Exchange) -> None:
        """Apply an exchange to the design; changes `pairs` and `phi`."""
        self.pairs.exchange(exchange.column, *exchange.rows)
        self._total = exchange.total
        self.phi = exchange.phi


class EvolvedDesigns(NamedTuple):
    """Result of `evolve_design`: two designs (n, d)."""

    smallest_phi: np.ndarray  # the design with the smallest phi_p
    # The design with the largest minimum distance, among those at the ends of rounds.
    widest: np.ndarray


@np.errstate(divide="ignore", over="ignore", invalid="ignore")
def evolve_design(
    start: np.ndarray, doublings: int, rounds: int, rng: np.random.Generator
) -> EvolvedDesigns:
    """Improve a design by enhanced stochastic evolution.

    The criterion is `repose.calibrate.designs.latin_hypercube.phi_p`. Each trial
    chooses the best of a few random exchanges in a column, and accepts it if phi_p
    rises by at most a random fraction of the threshold. The trials of a round go
    through the columns in turn. Numpy's warnings are off, because two equal points have
    an infinite repulsion.

    Parameters
    ----------
    start : array (n, d)
        The design to improve.
    doublings : int
        The power p is 2^(doublings + 1).
    rounds : int
        Number of rounds.
    rng : numpy.random.Generator
        Source of the random numbers.

    Returns
    -------
    EvolvedDesigns
    """
    n_columns = start.shape[1]
    walk = _Walk(start, doublings)
    threshold = _Threshold(FIRST_THRESHOLD * walk.phi)
    trials = min(MAX_TRIALS, 2 * walk.n_candidates * n_columns)

    best_phi = walk.phi
    best_points = start.copy()
    # The square of the largest minimum distance so far, and the design that has it.
    widest_squared = walk.pairs.squared_distances.min()
    widest_points = start.copy()
    for _ in range(rounds):
        phi_before = best_phi
        accepted = 0
        improved = 0
        for trial in range(trials):
            exchange = walk.choose_exchange(trial % n_columns, rng)
            if exchange.phi - walk.phi > threshold.value * rng.random():
                continue
            walk.apply_exchange(exchange)
            accepted += 1
            if walk.phi < best_phi:
                best_phi = walk.phi
                best_points = walk.pairs.points.copy()
                improved += 1

        walk.recompute_total()
        smallest_squared = walk.pairs.squared_distances.min()
        if smallest_squared > widest_squared:
            widest_squared = smallest_squared
            widest_points = walk.pairs.points.copy()
        threshold.adapt(
            is_better=best_phi < phi_before,
            accepted=accepted,
            improved=improved,
            trials=trials,
        )
    return EvolvedDesigns(best_points, widest_points)
