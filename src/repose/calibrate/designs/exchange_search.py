"""Spread the points of a design by exchanges (enhanced stochastic evolution).

An exchange swaps two values of a column, so a Latin hypercube stays one. The method is
that of Jin, Chen and Sudjianto 2005, J. Stat. Plan. Inference 134:268.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

FIRST_THRESHOLD = 0.005  # of phi_p
MOST_CANDIDATES = 50  # random exchanges of which the best is tried
MOST_TRIALS = 100  # of a round
# Shares of the trials that are accepted, below which acceptance is low, above which
# high.
LOW_ACCEPTANCE = 0.1
HIGH_ACCEPTANCE = 0.8
# Factors of the threshold in one round: while the best design improves, while the
# acceptance is to rise, and while it is to fall.
IMPROVEMENT_FACTOR = 0.8
RISE_FACTOR = 0.7
FALL_FACTOR = 0.9


class Pairs:
    """Points with the repulsions distance^-power of all pairs.

    Sums go term by term (`cumsum`), because ties decide, and their rounding must be
    that of the published designs.

    Parameters
    ----------
    points : array (n, d)
    doublings : int
        The power is 2^(doublings + 1).

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
        doublings : int
            The power of the repulsions is 2^(doublings + 1).
        """
        n = len(points)
        self.points = points.copy()
        self.doublings = doublings
        self.below = np.tril_indices(n, -1)
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

    def total(self) -> float:
        """Sum the repulsions of all pairs."""
        return float(np.cumsum(self.repulsion[self.below])[-1])

    def gains(self, column: int, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Compute the change of `total` if two rows swap their values in a column.

        Parameters
        ----------
        column : int
        i, j : array of int (m,)
            Rows of the m exchanges; each exchange is tried on its own.

        Returns
        -------
        array (m,)
        """
        x = self.points[:, column]
        rows = np.array([i, j])  # (2, m)
        exchanges = np.arange(len(i))

        # Squared differences of rows i and j from all rows in this column, (2, m, n).
        column_squares = x[rows][:, :, None] - x
        column_squares *= column_squares

        # A squared distance is a sum over the columns. An exchange swaps the terms of
        # this column between row i and row j.
        shift = column_squares[1] - column_squares[0]
        new_squared = self.squared[rows] + np.array([shift, -shift])
        change = self._repulsions(new_squared)
        change -= self.repulsion[rows]
        # The distance between the two rows does not change.
        change[:, exchanges, rows] = 0.0

        # Sum over the other rows and over both rows of an exchange, term by term.
        terms = change.transpose(2, 0, 1).reshape(-1, len(i))
        return terms.cumsum(axis=0)[-1]

    def exchange(self, column: int, i: int, j: int) -> None:
        """Swap the values of rows i and j in a column."""
        self.points[[i, j], column] = self.points[[j, i], column]
        self._update(i)
        self._update(j)


@dataclass
class _Threshold:
    """How much worse a design may become by an exchange (Jin et al., section 3.2)."""

    value: float
    is_rising: bool = True

    def adapt(self, is_better: bool, accepted: int, improved: int, trials: int) -> None:
        """Adapt the threshold after a round.

        While the best design improves, the threshold keeps acceptance low. Once it
        stalls, the threshold rises until most exchanges are accepted, then falls until
        few are, and so on.

        Parameters
        ----------
        is_better : bool
            Whether the best design improved.
        accepted, improved, trials : int
            Number of exchanges that were accepted, that improved the best design, and
            that were tried.
        """
        # Improvement: lower the threshold if bad exchanges are accepted, too.
        if is_better:
            if accepted > LOW_ACCEPTANCE * trials and improved < accepted:
                self.value *= IMPROVEMENT_FACTOR
            elif accepted <= LOW_ACCEPTANCE * trials:
                self.value /= IMPROVEMENT_FACTOR
            return

        # Exploration: reverse the direction at low and at high acceptance.
        if accepted < LOW_ACCEPTANCE * trials:
            self.is_rising = True
        elif accepted > HIGH_ACCEPTANCE * trials:
            self.is_rising = False
        if self.is_rising:
            self.value /= RISE_FACTOR
        else:
            self.value *= FALL_FACTOR


class _Exchange(NamedTuple):
    """An exchange that is tried: two rows swap their values in a column."""

    column: int
    rows: tuple[int, int]
    total: float  # sum of repulsions after it
    phi: float  # phi_p after it


class _Walk:
    """A design that changes exchange by exchange.

    Parameters
    ----------
    start : array (n, d)
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
        self.n_candidates = min(MOST_CANDIDATES, max(1, n * (n - 1) // 10))
        # Upper limits of random numbers that name the two rows of each candidate: the
        # first row, and how many rows after it the second one lies, less one.
        self._limits = np.tile([n, n - 1], self.n_candidates)
        self.sum_afresh()

    def sum_afresh(self) -> None:
        """Sum all repulsions, since the rounding of many gains would pile up."""
        self._total = self.pairs.total()
        self.phi = self._total**self._exponent

    def choose_exchange(self, column: int, rng: np.random.Generator) -> _Exchange:
        """Choose the best of a few random exchanges in a column."""
        i, offset = rng.integers(0, self._limits).reshape(-1, 2).T
        j = (i + 1 + offset) % len(self.pairs.points)
        gains = self.pairs.gains(column, i, j)
        best = int(gains.argmin())
        total = self._total + gains[best]
        phi = max(total, 0.0) ** self._exponent
        return _Exchange(column, rows=(i[best], j[best]), total=total, phi=phi)

    def accept(self, exchange: _Exchange) -> None:
        """Make an exchange."""
        self.pairs.exchange(exchange.column, *exchange.rows)
        self._total = exchange.total
        self.phi = exchange.phi


class Evolved(NamedTuple):
    """Result of `evolve`: two designs (n, d)."""

    smallest_phi: np.ndarray  # the design of smallest phi_p
    widest: np.ndarray  # of those after each round, that of largest minimum distance


@np.errstate(divide="ignore", over="ignore", invalid="ignore")
def evolve(
    start: np.ndarray, doublings: int, rounds: int, rng: np.random.Generator
) -> Evolved:
    """Improve a design by enhanced stochastic evolution.

    The criterion is `repose.calibrate.designs.latin_hypercube.phi_p`. Each round goes
    through the columns. It takes the best of a few random exchanges, and accepts it if
    phi_p rises by no more than a random share of the threshold.

    Parameters
    ----------
    start : array (n, d)
    doublings : int
        The power p is 2^(doublings + 1).
    rounds : int
    rng : numpy.random.Generator

    Returns
    -------
    Evolved
    """
    n_columns = start.shape[1]
    walk = _Walk(start, doublings)
    threshold = _Threshold(FIRST_THRESHOLD * walk.phi)
    trials = min(MOST_TRIALS, 2 * walk.n_candidates * n_columns)

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
            walk.accept(exchange)
            accepted += 1
            if walk.phi < best_phi:
                best_phi = walk.phi
                best_points = walk.pairs.points.copy()
                improved += 1

        walk.sum_afresh()
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
    return Evolved(best_points, widest_points)
