"""Enhanced stochastic evolution: exchanges within the columns of a Latin hypercube that move its points apart.

An exchange swaps two values of a column, so the design stays a Latin hypercube. The method: Jin, Chen and
Sudjianto 2005, J. Stat. Plan. Inference 134:268.
"""

import numpy as np

from repose.dem.kernels.jit import compiled


@compiled
def _repulsion(squared_distance, doublings):
    """distance^-power for power = 2^(doublings + 1), by repeated squaring."""
    value = 1.0 / squared_distance
    for _ in range(doublings):
        value *= value
    return value


@compiled
def _exchange_gain(points, squared, repulsion, doublings, column, i, j):
    """Change of sum(distance^-power) when rows i and j swap their values in column: O(n)."""
    xi, xj = points[i, column], points[j, column]
    gain = 0.0
    for k in range(points.shape[0]):
        if k in (i, j):
            continue
        xk = points[k, column]
        shift = (xj - xk) ** 2 - (xi - xk) ** 2
        gain += _repulsion(squared[i, k] + shift, doublings) - repulsion[i, k]
        gain += _repulsion(squared[j, k] - shift, doublings) - repulsion[j, k]
    return gain


@compiled
def _exchange(points, squared, repulsion, doublings, column, i, j):
    """Swap rows i and j in column and bring their pairs up to date."""
    points[i, column], points[j, column] = points[j, column], points[i, column]
    for row in (i, j):
        _update_pairs(points, squared, repulsion, doublings, row)


@compiled
def _update_pairs(points, squared, repulsion, doublings, row):
    """Squared distances and repulsions between row and every other row."""
    for k in range(points.shape[0]):
        if k == row:
            continue
        total = 0.0
        for c in range(points.shape[1]):
            total += (points[row, c] - points[k, c]) ** 2
        squared[row, k] = squared[k, row] = total
        repulsion[row, k] = repulsion[k, row] = _repulsion(total, doublings)


@compiled
def _totals(squared, repulsion):
    """(sum of the repulsions over pairs, smallest squared distance)."""
    total, smallest = 0.0, np.inf
    for i in range(squared.shape[0]):
        for j in range(i):
            total += repulsion[i, j]
            smallest = min(smallest, squared[i, j])
    return total, smallest


@compiled
def _best_of_candidates(points, squared, repulsion, doublings, column, candidates, rng):
    """(i, j, gain) of the best among a few random exchanges in column."""
    n = points.shape[0]
    chosen_i, chosen_j, chosen_gain = 0, 1, np.inf
    for _ in range(candidates):
        i = rng.integers(0, n)
        j = (i + 1 + rng.integers(0, n - 1)) % n
        gain = _exchange_gain(points, squared, repulsion, doublings, column, i, j)
        if gain < chosen_gain:
            chosen_i, chosen_j, chosen_gain = i, j, gain
    return chosen_i, chosen_j, chosen_gain


@compiled
def _next_threshold(threshold, better, accepted, improved, inner, warming):
    """(threshold, warming) of the next round: Jin et al. 2005, section 3.2.

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


@compiled
def evolve(
    start: np.ndarray, doublings: int, rounds: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Enhanced stochastic evolution on `repose.chain.design.phi_p` with p = 2^(doublings + 1).

    Each round goes through the columns, takes the best of a few random exchanges and accepts it against a random share
    of a threshold. The results are the design of smallest phi_p, and the design of the largest minimum distance.
    """
    n, d = start.shape
    points = start.copy()
    squared = np.zeros((n, n))
    repulsion = np.zeros((n, n))
    for i in range(n):
        _update_pairs(points, squared, repulsion, doublings, i)
    exponent = 1.0 / 2.0 ** (doublings + 1)
    total, widest = _totals(squared, repulsion)
    phi = total**exponent
    widest_points = points.copy()
    best_phi, best_points = phi, points.copy()
    threshold = 0.005 * phi
    candidates = min(50, max(1, n * (n - 1) // 10))
    inner = min(100, 2 * candidates * d)
    warming = True
    for _ in range(rounds):
        phi_before = best_phi
        accepted = 0
        improved = 0
        for step in range(inner):
            column = step % d
            i, j, gain = _best_of_candidates(points, squared, repulsion, doublings, column, candidates, rng)
            trial = max(total + gain, 0.0) ** exponent
            if trial - phi > threshold * rng.random():
                continue
            _exchange(points, squared, repulsion, doublings, column, i, j)
            total += gain
            phi = trial
            accepted += 1
            if phi < best_phi:
                best_phi = phi
                best_points[:] = points
                improved += 1
        # Summed afresh, or the rounding of thousands of gains would pile up.
        total, smallest = _totals(squared, repulsion)
        phi = total**exponent
        if smallest > widest:
            widest = smallest
            widest_points[:] = points
        threshold, warming = _next_threshold(
            threshold, best_phi < phi_before, accepted, improved, inner, warming
        )
    return best_points, widest_points
