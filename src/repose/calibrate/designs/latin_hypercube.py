"""Latin hypercube designs: the best of 20, as in the paper, and an optimal one.

The source is section 3.2.1 of the paper, with Eq. 5. A design is an (n, d) array in the
unit cube with exactly one point in each of the n equal strata of every column.
Distances are Euclidean distances in the unit cube, so they do not depend on the units
of the parameters.
"""

import functools
from collections.abc import Mapping

import numpy as np
import pandas as pd

from repose.calibrate.designs.allowed import make_allowed_design
from repose.calibrate.designs.exchange_search import evolve_design
from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.parameter_space import ParameterSpace

N_CANDIDATES = 20  # designs that `lhsdesign` compares, as in the paper
PHI_POWER = 16.0  # power p of the criterion in comparison.csv
# The optimal design is improved for the powers 16, 32 and 64 of `phi_p`, one after the
# other. The first power shapes the whole design. The higher powers act on the closest
# pairs, which determine the minimum distance. Each number here is the number of
# squarings that lead from distance^2 to distance^power.
PHI_DOUBLINGS = (3, 4, 5)
ROUNDS_PER_POWER = 100
# Positions keep this fraction of a stratum away from its edges, so that rounding in a
# file cannot move a point into the neighbouring stratum.
EDGE_MARGIN = 1e-4
METHOD_LABELS = {
    "random": "random Latin hypercube",
    "lhsdesign": "best of 20 Latin hypercubes",
    "optimal": "optimal Latin hypercube",
}


def random_lhs(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """Draw a random Latin hypercube (n, d) in the unit cube.

    The strata of the columns are paired at random, and each position within a stratum
    is random.
    """
    position = rng.uniform(EDGE_MARGIN, 1.0 - EDGE_MARGIN, (n, d))
    stratum = np.stack([rng.permutation(n) for _ in range(d)], axis=1)
    return (stratum + position) / n


def minimum_distance(points: np.ndarray) -> float:
    """Compute the smallest Euclidean distance between two points (n, d).

    A large distance is good. This is the maximin criterion, Eq. 5 of the paper.
    """
    from scipy.spatial.distance import pdist

    return float(pdist(points).min())


def phi_p(points: np.ndarray) -> float:
    """Compute Morris and Mitchell's criterion of points (n, d); a small value is good.

    The criterion is (sum of distance^-p over all pairs)^(1 / p) with p = `PHI_POWER`.
    It approaches 1 / minimum distance as p grows (Morris and Mitchell 1995, J. Stat.
    Plan. Inference 43:381).
    """
    from scipy.spatial.distance import pdist

    return float(np.sum(pdist(points) ** -PHI_POWER) ** (1.0 / PHI_POWER))


def lhsdesign(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """Draw `N_CANDIDATES` random Latin hypercubes (n, d), and return the best one.

    The best one has the largest minimum distance. The name is that of MATLAB's
    function, which the paper uses.
    """
    candidates = (random_lhs(n, d, rng) for _ in range(N_CANDIDATES))
    return max(candidates, key=minimum_distance)


def optimal_lhs(n: int, d: int, seed: int | list[int]) -> np.ndarray:
    """Make a Latin hypercube whose points are far apart.

    Enhanced stochastic evolution on phi_p improves the `lhsdesign` of the same seed,
    for rising powers (Jin, Chen and Sudjianto 2005, J. Stat. Plan. Inference 134:268).
    This takes up to a minute, and a study needs its design for every proposal, so the
    most recent designs are cached.

    Parameters
    ----------
    n, d : int
        Numbers of points and of columns.
    seed : int or list of int
        Seed of the random numbers.

    Returns
    -------
    array (n, d)
        The points in the unit cube. Of all designs on the way, this one has the largest
        minimum distance.
    """
    entropy = tuple(seed) if isinstance(seed, list) else seed
    return _optimal_lhs(n, d, entropy).copy()


@functools.lru_cache(maxsize=16)
def _optimal_lhs(n: int, d: int, seed: int | tuple[int, ...]) -> np.ndarray:
    """Make the design (n, d) of `optimal_lhs`.

    The cache returns the same array again, so the caller must not change it.
    """
    rng = np.random.default_rng(seed)
    best = lhsdesign(n, d, rng=rng)
    # With two points or one column, no exchange changes the distances.
    if n < 3 or d < 2:
        return best
    # Morris and Mitchell's criterion phi_p has a power p. Minimise it for rising
    # powers, each time from the design of smallest phi_p of the previous power.
    current = best.copy()
    for doublings in PHI_DOUBLINGS:
        current, widest = evolve_design(current, doublings, ROUNDS_PER_POWER, rng)
        # `best` is the design of largest minimum distance. If several are equal, `max`
        # keeps the first of them, the one found earliest.
        best = max((best, current, widest), key=minimum_distance)
    return best


def compare_designs(designs: Mapping[str, np.ndarray]) -> pd.DataFrame:
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


def make_designs(
    space: ParameterSpace, section: DesignSettings
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make the design of a study, and compare it with the designs of the other methods.

    The free parameters fill their ranges evenly, even those with a prior. The surrogate
    is then valid over the whole ranges, and the search and the posterior apply the
    priors. With constraints, the samples fill only the allowed part of the ranges
    (`make_allowed_design`).

    Returns
    -------
    table : pandas.DataFrame
        The samples of the study, from `tabulate_parameter_sets`.
    comparison : pandas.DataFrame
        The criteria of all methods in `METHOD_LABELS`, from `compare_designs`.
    """
    designs = {
        method: make_points_in_space(space, section.samples, method, section.seed)
        for method in METHOD_LABELS
    }
    return tabulate_parameter_sets(designs[section.method], space), compare_designs(
        designs
    )


def make_points_in_space(
    space: ParameterSpace, n: int, method: str, seed: int
) -> np.ndarray:
    """Make a design (n, d) of allowed points by one of the methods in `METHOD_LABELS`."""

    def design_of(size: int) -> np.ndarray:
        return make_points(size, space.dimensions, method, seed)

    return make_allowed_design(design_of, n, space)


def make_points(n: int, d: int, method: str, seed: int) -> np.ndarray:
    """Make a design (n, d) by one of the methods in `METHOD_LABELS`."""
    if method == "optimal":
        return optimal_lhs(n, d, seed)
    rng = np.random.default_rng(seed)
    if method == "random":
        return random_lhs(n, d, rng)
    return lhsdesign(n, d, rng)


def tabulate_parameter_sets(
    points: np.ndarray, space: ParameterSpace, first: int = 1
) -> pd.DataFrame:
    """Turn points (n, d) of the unit cube into a table of parameter sets.

    Its columns are `sample`, numbered from `first`, and the parameters.
    """
    table = pd.DataFrame(space.values(points), columns=list(space.names))
    table.insert(0, "sample", np.arange(first, first + len(table)))
    return table
