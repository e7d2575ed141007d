"""Latin hypercube designs: the paper's best of 20 and an optimal one (section 3.2.1, Eq. 5).

A design is an (n, d) array in the unit cube with exactly one point in each of the n equal strata of every
column. Distances are Euclidean and taken in the unit cube, so that no parameter's unit weighs more.
"""

import math
import os
from collections.abc import Mapping
from pathlib import Path

import numba
import numpy as np
import pandas as pd
from scipy.spatial.distance import pdist
from scipy.stats import qmc

from repose.core.errors import InputError
from repose.core.files import write_table
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS

PHI_POWER = 16
# The first power shapes the whole design; the higher ones press on its closest pairs alone, which is what
# the minimum distance is about.
# Powers 16, 32 and 64, as the number of squarings that lead from distance^2 to distance^power.
PHI_STAGE_DOUBLINGS = (3, 4, 5)
# Positions keep this share of a stratum away from its edges, so that rounding in a file cannot move a point
# into the neighbouring stratum.
EDGE_MARGIN = 1e-4
ROUNDS_PER_STAGE = 100


def random_lhs(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """Random Latin hypercube, (n, d) in the unit cube: random pairing, random position in each stratum."""
    position = rng.uniform(EDGE_MARGIN, 1.0 - EDGE_MARGIN, (n, d))
    stratum = np.stack([rng.permutation(n) for _ in range(d)], axis=1)
    return (stratum + position) / n


def minimum_distance(points: np.ndarray) -> float:
    """Smallest Euclidean distance between two rows of points (n, d): the maximin criterion, Eq. 5."""
    return float(pdist(points).min())


def phi_p(points: np.ndarray, power: float = PHI_POWER) -> float:
    """Morris and Mitchell's criterion (sum of distance^-power)^(1/power); small is good, -> 1 / minimum."""
    return float(np.sum(pdist(points) ** -float(power)) ** (1.0 / power))


def lhsdesign(n: int, d: int, iterations: int = 20, rng: np.random.Generator | None = None) -> np.ndarray:
    """The paper's design: of `iterations` random Latin hypercubes the one with the largest minimum distance.

    Parameters
    ----------
    n, d : int
        At least 2 points and 1 column.
    iterations : int
        Number of hypercubes.
    rng : numpy.random.Generator, optional
        Where they are drawn from.

    Returns
    -------
    numpy.ndarray, (n, d)
        In the unit cube.

    Raises
    ------
    ValueError
        If n, d or iterations is too small.
    """
    _check_size(n, d)
    if iterations < 1:
        raise ValueError(f"iterations is {iterations}; at least 1")
    rng = np.random.default_rng() if rng is None else rng
    return max((random_lhs(n, d, rng) for _ in range(iterations)), key=minimum_distance)


def optimal_lhs(n: int, d: int, seed: int | list[int]) -> np.ndarray:
    """Latin hypercube with points as far apart as exchanges within its columns can put them.

    Parameters
    ----------
    n, d : int
        At least 2 points and 1 column.
    seed : int or list of int
        The same seed gives the same design.

    Returns
    -------
    numpy.ndarray, (n, d)
        In the unit cube.

    Raises
    ------
    ValueError
        If n or d is too small.

    References
    ----------
    Enhanced stochastic evolution (Jin, Chen and Sudjianto 2005, J. Stat. Plan. Inference 134:268) on phi_p, in stages
    of growing power; the best design by minimum distance is kept. It starts from `lhsdesign` with the same seed, so it
    is never worse than that.
    """
    _check_size(n, d)
    rng = np.random.default_rng(seed)
    best = lhsdesign(n, d, rng=rng)
    if n < 3 or d < 2:
        return best
    current = best.copy()
    for doublings in PHI_STAGE_DOUBLINGS:
        current, widest = _evolve(current, doublings, ROUNDS_PER_STAGE, rng)
        best = max((best, current, widest), key=minimum_distance)
    return best


def sobol(n: int, d: int, seed: int | list[int]) -> np.ndarray:
    """First points of a scrambled Sobol sequence. A longer sequence of the same seed begins with a shorter one.

    Parameters
    ----------
    n, d : int
        Numbers of points and of dimensions.
    seed : int or list of int
        Picks the scrambling.

    Returns
    -------
    numpy.ndarray, (n, d)
        In the unit cube.

    Raises
    ------
    ValueError
        If n or d is too small.
    """
    _check_size(n, d)
    sequence = qmc.Sobol(d, scramble=True, rng=np.random.default_rng(seed))
    return sequence.random_base2(math.ceil(math.log2(n)))[:n]


def compare(designs: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """How well designs fill the cube.

    Parameters
    ----------
    designs : mapping
        Points (n, d) by the name of their method.

    Returns
    -------
    pandas.DataFrame
        `method`, `samples`, `min_distance`, `phi_p` (power 16), `centred_discrepancy` (Hickernell 1998, squared as
        scipy gives it).
    """
    rows = [
        {
            "method": method,
            "samples": len(points),
            "min_distance": minimum_distance(points),
            "phi_p": phi_p(points),
            "centred_discrepancy": qmc.discrepancy(points, method="CD"),
        }
        for method, points in designs.items()
    ]
    return pd.DataFrame(rows)


def design(space: ParameterSpace, samples: int, method: str, seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The parameter sets of a study, and how well each method fills the ranges.

    Parameters
    ----------
    space : ParameterSpace
        The free parameters fill their ranges evenly, also where there is a prior: the surrogate then holds for every
        value that the prior allows, and the prior itself is applied in the search and the posterior. A fixed
        parameter is a column with one value.
    samples : int
        Number of parameter sets, at least 2.
    method : str
        "lhsdesign" or "optimal".
    seed : int
        At least 0.

    Returns
    -------
    table : pandas.DataFrame
        `sample` from 1, and the six parameters.
    comparison : pandas.DataFrame
        See `compare`; for the methods random, lhsdesign and optimal in the free parameters.

    Raises
    ------
    InputError
        For a bad number, method or seed, and where the contact law cannot take a value of the space.
    """
    if not _is_integer(samples) or samples < 2:
        raise InputError("design", "samples", samples, "an integer of at least 2")
    if not _is_integer(seed) or seed < 0:
        raise InputError("design", "seed", seed, "an integer of at least 0")
    if method not in ("lhsdesign", "optimal"):
        raise InputError("design", "method", method, "lhsdesign or optimal")
    space.check_searchable()
    d = space.dimensions
    designs = {
        "random": random_lhs(samples, d, np.random.default_rng(seed)),
        "lhsdesign": lhsdesign(samples, d, rng=np.random.default_rng(seed)),
        "optimal": optimal_lhs(samples, d, seed),
    }
    return parameter_sets(designs[method], space), compare(designs)


def parameter_sets(points: np.ndarray, space: ParameterSpace) -> pd.DataFrame:
    """Points of the unit cube as a table.

    Parameters
    ----------
    points : numpy.ndarray, (n, d)
    space : ParameterSpace

    Returns
    -------
    pandas.DataFrame
        `sample` from 1, and the six parameters.
    """
    table = pd.DataFrame(space.values(points), columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(1, len(table) + 1))
    return table


def run(
    space: ParameterSpace, samples: int, method: str, seed: int, out_dir: str | os.PathLike
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Write samples.csv and comparison.csv to out_dir (`design`); return both tables."""
    table, comparison = design(space, samples, method, seed)
    write_table(Path(out_dir) / "samples.csv", table, float_format="%.10g")
    write_table(Path(out_dir) / "comparison.csv", comparison, float_format="%.6g")
    return table, comparison


def _is_integer(value):
    """True for an int that is no bool."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _check_size(n, d):
    """ValueError unless there are two points and a column."""
    if n < 2:
        raise ValueError(f"n is {n}; a design has at least 2 points")
    if d < 1:
        raise ValueError(f"d is {d}; a design has at least 1 column")


@numba.njit(cache=True)
def _repulsion(squared_distance, doublings):
    """distance^-power for power = 2^(doublings + 1), by repeated squaring."""
    value = 1.0 / squared_distance
    for _ in range(doublings):
        value *= value
    return value


@numba.njit(cache=True)
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


@numba.njit(cache=True)
def _exchange(points, squared, repulsion, doublings, column, i, j):
    """Swap rows i and j in column and bring their pairs up to date."""
    points[i, column], points[j, column] = points[j, column], points[i, column]
    for row in (i, j):
        _update_pairs(points, squared, repulsion, doublings, row)


@numba.njit(cache=True)
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


@numba.njit(cache=True)
def _totals(squared, repulsion):
    """(sum of the repulsions over pairs, smallest squared distance)."""
    total, smallest = 0.0, np.inf
    for i in range(squared.shape[0]):
        for j in range(i):
            total += repulsion[i, j]
            smallest = min(smallest, squared[i, j])
    return total, smallest


@numba.njit(cache=True)
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


@numba.njit(cache=True)
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


@numba.njit(cache=True)
def _evolve(start, doublings, rounds, rng):
    """Enhanced stochastic evolution on phi_p with p = 2^(doublings + 1).

    Returns (design of smallest phi_p, design of largest minimum distance seen at the end of a round). Each
    round goes through the columns, takes the best of a few random exchanges and accepts it against a random
    share of the threshold.
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
