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
# Factors by which the threshold changes after a round: while the best design improves,
# while the acceptance is to rise, and while it is to fall.
IMPROVEMENT_FACTOR = 0.8
RISE_FACTOR = 0.7
FALL_FACTOR = 0.9


class Pairs:
    """Points with the repulsions distance^-power of all pairs.

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
    squared : array (n, n)
        Squared distances; infinite on the diagonal.
    repulsion : array (n, n)
        0 on the diagonal.
    """

    def __init__(self, points: np.ndarray, doublings: int) -> None:
        """Compute all distances and repulsions.

        Parameters
        ----------
        points : array (n, d)
            The points of the design.
        doublings : int
            The power of the repulsions is 2^(doublings + 1).
        """
        n = len(points)
        self.points = points.copy()
        self.doublings = doublings
        # Indices of each pair of points, once.
        self.below = np.tril_indices(n, -1)
        # Squared distances and repulsions of all pairs. No point repels itself.
        self.squared = np.full((n, n), np.inf)
        self.repulsion = np.zeros((n, n))
        for row in range(n):
            self._update(row)

    def _repulsions(self, squared: np.ndarray) -> np.ndarray:
        """Compute repulsions from squared distances."""
        value = 1.0 / squared
        for _ in range(self.doublings):
            value *= value
        return value

    def _update(self, row: int) -> None:
        """Recompute the distances and repulsions between one point and all others."""
        # A cumulative sum adds the columns one by one, in a fixed order.
        squared = np.cumsum((self.points - self.points[row]) ** 2, axis=1)[:, -1]
        squared[row] = np.inf
        repulsion = self._repulsions(squared)
        self.squared[row] = squared
        self.squared[:, row] = squared
        self.repulsion[row] = repulsion
        self.repulsion[:, row] = repulsion

    def sum_repulsions(self) -> float:
        """Sum the repulsions of all pairs."""
        return float(np.cumsum(self.repulsion[self.below])[-1])

    def compute_changes(self, column: int, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Compute by how much each exchange would change the sum of all repulsions.

        An exchange swaps the values of two rows in a column. Each exchange is evaluated
        by itself, and none of them is made.

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
        new_squared = self.squared[rows] + np.array([shift, -shift])
        changes = self._repulsions(new_squared) - self.repulsion[rows]
        # The distance between the two rows does not change.
        changes[:, np.arange(n_exchanges), rows] = 0.0

        # Sum over the other rows and over both rows of an exchange, term by term.
        terms = changes.transpose(2, 0, 1).reshape(-1, n_exchanges)
        return terms.cumsum(axis=0)[-1]

    def exchange(self, column: int, i: int, j: int) -> None:
        """Swap the values of rows i and j in a column, and update all attributes."""
        self.points[[i, j], column] = self.points[[j, i], column]
        self._update(i)
        self._update(j)


@dataclass
class _Threshold:
    """How much worse a design may become by an exchange (Jin et al., section 3.2)."""

    value: float
    is_rising: bool = True

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
        # the best design, and raise it if hardly any exchange is accepted.
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
            self.value /= RISE_FACTOR
        else:
            self.value *= FALL_FACTOR


class _Exchange(NamedTuple):
    """An exchange to try: two rows swap their values in a column."""

    column: int
    rows: tuple[int, int]
    total: float  # sum of repulsions after it
    phi: float  # phi_p after it


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
        Its phi_p.
    """

    def __init__(self, start: np.ndarray, doublings: int) -> None:
        """Begin with a design."""
        self.pairs = Pairs(start, doublings)
        self._exponent = 1.0 / 2.0 ** (doublings + 1)
        n = len(start)
        self.n_candidates = min(MAX_CANDIDATES, max(1, n * (n - 1) // 10))
        # Exclusive upper limits of two random numbers for each candidate: the first
        # row, and the number of rows from the one after it to the second row.
        self._limits = np.tile([n, n - 1], self.n_candidates)
        self.recompute_total()

    def recompute_total(self) -> None:
        """Sum all repulsions again, because the rounding errors of many changes add up.

        Sets the sum and `phi`.
        """
        self._total = self.pairs.sum_repulsions()
        self.phi = self._total**self._exponent

    def choose_exchange(self, column: int, rng: np.random.Generator) -> _Exchange:
        """Choose the best of a few random exchanges in a column."""
        i, offset = rng.integers(0, self._limits).reshape(-1, 2).T
        j = (i + 1 + offset) % len(self.pairs.points)
        gains = self.pairs.compute_changes(column, i, j)
        best = int(gains.argmin())
        total = self._total + gains[best]
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
    widest_squared = walk.pairs.squared.min()
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
        smallest_squared = walk.pairs.squared.min()
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
