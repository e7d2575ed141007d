"""Latin hypercube designs: the paper's best of 20 and an optimal one.

Section 3.2.1 of the paper, Eq. 5. A design is an (n, d) array in the unit cube with
exactly one point in each of the n equal strata of every column. Distances are Euclidean
and taken in the unit cube, so that no parameter's unit weighs more.
"""

import functools
from collections.abc import Mapping

import numpy as np
import pandas as pd

from repose.calibrate.designs.allowed import allowed_design
from repose.calibrate.designs.exchange_search import evolve
from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.parameter_space import ParameterSpace

CANDIDATES = 20  # of `lhsdesign`
PHI_POWER = 16.0  # of the criterion in comparison.csv
# The optimal design is improved for the powers 16, 32 and 64 of `phi_p` in turn. The
# first shapes the whole design; the higher ones act on its closest pairs, which set the
# minimum distance. A power is given by the number of squarings that lead from
# distance^2 to distance^power.
PHI_DOUBLINGS = (3, 4, 5)
ROUNDS_PER_POWER = 100
# Positions keep this share of a stratum away from its edges, so that rounding in a file
# cannot move a point into the neighbouring stratum.
EDGE_MARGIN = 1e-4
METHODS = {
    "random": "random Latin hypercube",
    "lhsdesign": "best of 20 Latin hypercubes",
    "optimal": "optimal Latin hypercube",
}


def random_lhs(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """Draw a random Latin hypercube (n, d) in the unit cube.

    The strata of the columns are paired at random, and so are the positions in them.
    """
    position = rng.uniform(EDGE_MARGIN, 1.0 - EDGE_MARGIN, (n, d))
    stratum = np.stack([rng.permutation(n) for _ in range(d)], axis=1)
    return (stratum + position) / n


def minimum_distance(points: np.ndarray) -> float:
    """Compute the smallest Euclidean distance between two points (n, d).

    A design for which it is large is good: the maximin criterion, Eq. 5 of the paper.
    """
    from scipy.spatial.distance import pdist

    return float(pdist(points).min())


def phi_p(points: np.ndarray) -> float:
    """Compute Morris and Mitchell's criterion of points (n, d); a small value is good.

    It is (sum of distance^-p over all pairs)^(1 / p) with p = `PHI_POWER`. As p grows
    it goes to 1 / minimum distance (Morris and Mitchell 1995, J. Stat. Plan. Inference
    43:381).
    """
    from scipy.spatial.distance import pdist

    return float(np.sum(pdist(points) ** -PHI_POWER) ** (1.0 / PHI_POWER))


def lhsdesign(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """Draw random Latin hypercubes (n, d), and return the best, as the paper does.

    It is the one with the largest minimum distance.
    """
    candidates = (random_lhs(n, d, rng) for _ in range(CANDIDATES))
    return max(candidates, key=minimum_distance)


def optimal_lhs(n: int, d: int, seed: int | list[int]) -> np.ndarray:
    """Make a Latin hypercube whose points are far apart.

    Enhanced stochastic evolution on phi_p improves the `lhsdesign` of the same seed,
    for powers that grow (Jin, Chen and Sudjianto 2005, J. Stat. Plan. Inference
    134:268). This takes up to a minute, and a study asks for its design at each of its
    turns. So the last designs are kept.

    Parameters
    ----------
    n, d : int
        Numbers of points and of columns.
    seed : int or list of int

    Returns
    -------
    array (n, d)
        In the unit cube. Of all designs on the way, it has the largest minimum
        distance.
    """
    entropy = tuple(seed) if isinstance(seed, list) else seed
    return _optimal_lhs(n, d, entropy).copy()


@functools.lru_cache(maxsize=16)
def _optimal_lhs(n: int, d: int, seed: int | tuple[int, ...]) -> np.ndarray:
    """Make the design of `optimal_lhs`, which the caller must not change."""
    rng = np.random.default_rng(seed)
    best = lhsdesign(n, d, rng=rng)
    # With two points or one column there is nothing to exchange.
    if n < 3 or d < 2:
        return best
    # Each power goes on from the design of smallest phi_p of the power before it.
    current = best.copy()
    for doublings in PHI_DOUBLINGS:
        current, widest = evolve(current, doublings, ROUNDS_PER_POWER, rng)
        best = max((best, current, widest), key=minimum_distance)
    return best


def compare(designs: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """Compute the criteria of designs by method.

    Returns
    -------
    pandas.DataFrame
        `method`, `samples`, `min_distance`, `phi_p`, `centred_discrepancy`.
    """
    from scipy.stats import qmc

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


def design(
    space: ParameterSpace, section: DesignSettings
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Choose the parameter sets of a study, and compare the methods of doing so.

    The free parameters fill their ranges evenly, also with a prior: the surrogate then
    holds for every value of the prior, which is applied in the search and in the
    posterior. With constraints they fill what these allow (`allowed_design`).

    Returns
    -------
    table : pandas.DataFrame
        The samples of the study, as of `parameter_sets`.
    comparison : pandas.DataFrame
        As of `compare`, for all `METHODS`.
    """
    designs = {
        method: points_in(space, section.samples, method, section.seed)
        for method in METHODS
    }
    return parameter_sets(designs[section.method], space), compare(designs)


def points_in(space: ParameterSpace, n: int, method: str, seed: int) -> np.ndarray:
    """Make the design (n, d) of one of the `METHODS`, as the constraints allow."""

    def design_of(size: int) -> np.ndarray:
        return points(size, space.dimensions, method, seed)

    return allowed_design(design_of, n, space)


def points(n: int, d: int, method: str, seed: int) -> np.ndarray:
    """Make the design (n, d) of one of the `METHODS`."""
    if method == "optimal":
        return optimal_lhs(n, d, seed)
    rng = np.random.default_rng(seed)
    if method == "random":
        return random_lhs(n, d, rng)
    return lhsdesign(n, d, rng)


def parameter_sets(
    points: np.ndarray, space: ParameterSpace, first: int = 1
) -> pd.DataFrame:
    """Turn points (n, d) of the unit cube into a table of parameter sets.

    Its columns are `sample`, numbered from `first`, and the parameters.
    """
    table = pd.DataFrame(space.values(points), columns=list(space.names))
    table.insert(0, "sample", np.arange(first, first + len(table)))
    return table
