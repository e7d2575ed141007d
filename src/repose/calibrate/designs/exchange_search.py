"""Enhanced stochastic evolution: exchanges within the columns of a Latin hypercube that move its points apart.

An exchange swaps two values of a column, so the design stays a Latin hypercube. The method: Jin, Chen and
Sudjianto 2005, J. Stat. Plan. Inference 134:268.
"""

import numpy as np


class Pairs:
    """Points (n, d) with the repulsions distance^-power of all pairs, for power = 2^(doublings + 1).

    Sums go one by one (`cumsum`), since ties decide: their rounding is that of the published designs.
    """

    def __init__(self, points: np.ndarray, doublings: int) -> None:
        n = len(points)
        self.points, self.doublings = points.copy(), doublings
        self.below = np.tril_indices(n, -1)
        self.squared = np.full((n, n), np.inf)  # no point repels itself
        self.repulsion = np.zeros((n, n))
        for row in range(n):
            self._update(row)

    def _repulsions(self, squared: np.ndarray) -> np.ndarray:
        value = 1.0 / squared
        for _ in range(self.doublings):
            value *= value
        return value

    def _update(self, row: int) -> None:
        squared = np.cumsum((self.points - self.points[row]) ** 2, axis=1)[:, -1]
        squared[row] = np.inf
        self.squared[row] = self.squared[:, row] = squared
        self.repulsion[row] = self.repulsion[:, row] = self._repulsions(squared)

    def total(self) -> float:
        """Sum up the repulsions of all pairs."""
        return float(np.cumsum(self.repulsion[self.below])[-1])

    def gains(self, column: int, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Compute the change of `total` for each pair of rows i and j that swap their values in a column."""
        x, rows, k = self.points[:, column], np.array([i, j]), np.arange(len(i))
        ends = x[rows][:, :, None] - x
        ends *= ends
        shift = ends[1] - ends[0]
        value = self._repulsions(self.squared[rows] + np.array([shift, -shift]))
        value -= self.repulsion[rows]
        value[:, k, rows] = 0.0  # where the two rows meet themselves
        return value.transpose(2, 0, 1).reshape(-1, len(i)).cumsum(axis=0)[-1]

    def exchange(self, column: int, i: int, j: int) -> None:
        """Swap the values of rows i and j in a column."""
        self.points[[i, j], column] = self.points[[j, i], column]
        self._update(i)
        self._update(j)


def _next_threshold(
    threshold: float,
    better: bool,
    accepted: int,
    improved: int,
    inner: int,
    warming: bool,
) -> tuple[float, bool]:
    """Choose the threshold of the next round, and whether it is being raised: Jin et al. 2005, section 3.2.

    While the best design improves, the threshold keeps acceptance low; once it stalls, it is raised until
    most exchanges pass, then lowered until few do, and so on.
    """
    if better:
        if accepted > 0.1 * inner and improved < accepted:
            threshold *= 0.8
        elif accepted <= 0.1 * inner:
            threshold /= 0.8
        return threshold, warming
    if accepted < 0.1 * inner:
        warming = True
    elif accepted > 0.8 * inner:
        warming = False
    return (threshold / 0.7 if warming else threshold * 0.9), warming


@np.errstate(divide="ignore", over="ignore", invalid="ignore")
def evolve(
    start: np.ndarray, doublings: int, rounds: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Improve a design by enhanced stochastic evolution on `repose.calibrate.designs.latin_hypercube.phi_p`, p = 2^(doublings + 1).

    Each round goes through the columns, takes the best of a few random exchanges and accepts it against a random share
    of a threshold. The results are the design of smallest phi_p, and the design of the largest minimum distance.
    """
    n, d = start.shape
    pairs, exponent = Pairs(start, doublings), 1.0 / 2.0 ** (doublings + 1)
    total = pairs.total()
    phi = best_phi = total**exponent
    widest, best_points, widest_points = pairs.squared.min(), start.copy(), start.copy()
    threshold, warming = 0.005 * phi, True
    candidates = min(50, max(1, n * (n - 1) // 10))
    inner = min(100, 2 * candidates * d)
    highs = np.tile([n, n - 1], candidates)
    for _ in range(rounds):
        phi_before, accepted, improved = best_phi, 0, 0
        for step in range(inner):
            column = step % d
            i, offset = rng.integers(0, highs).reshape(-1, 2).T
            j = (i + 1 + offset) % n
            gains = pairs.gains(column, i, j)
            k = int(gains.argmin())
            trial = max(total + gains[k], 0.0) ** exponent
            if trial - phi > threshold * rng.random():
                continue
            pairs.exchange(column, i[k], j[k])
            total, phi = total + gains[k], trial
            accepted += 1
            if phi < best_phi:
                best_phi, best_points = phi, pairs.points.copy()
                improved += 1
        # Summed afresh, or the rounding of thousands of gains would pile up.
        total, smallest = pairs.total(), pairs.squared.min()
        phi = total**exponent
        if smallest > widest:
            widest, widest_points = smallest, pairs.points.copy()
        threshold, warming = _next_threshold(
            threshold, best_phi < phi_before, accepted, improved, inner, warming
        )
    return best_points, widest_points
