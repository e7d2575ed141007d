"""Latin hypercube designs: the paper's best of 20 and an optimal one (section 3.2.1, Eq. 5).

A design is an (n, d) array in the unit cube with exactly one point in each of the n equal strata of every
column. Distances are Euclidean and taken in the unit cube, so that no parameter's unit weighs more.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.parameter_space import ParameterSpace

CANDIDATES = 20  # of `lhsdesign`
PHI_POWER = 16.0
# The first power shapes the whole design; the higher ones press on its closest pairs alone, which
# set the minimum distance.
# Powers 16, 32 and 64, as the number of squarings that lead from distance^2 to distance^power.
PHI_DOUBLINGS = (3, 4, 5)
# Positions keep this share of a stratum away from its edges, so that rounding in a file cannot move a point
# into the neighbouring stratum.
EDGE_MARGIN = 1e-4
ROUNDS_PER_POWER = 100
METHODS = {
    "random": "random Latin hypercube",
    "lhsdesign": "best of 20 Latin hypercubes",
    "optimal": "optimal Latin hypercube",
}


def random_lhs(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """Draw a random Latin hypercube (n, d) in the unit cube: random pairing, random position in each stratum."""
    position = rng.uniform(EDGE_MARGIN, 1.0 - EDGE_MARGIN, (n, d))
    return (np.stack([rng.permutation(n) for _ in range(d)], axis=1) + position) / n


def minimum_distance(points: np.ndarray) -> float:
    """Find the smallest Euclidean distance between two points (n, d): the maximin criterion, Eq. 5 of the paper."""
    from scipy.spatial.distance import pdist

    return float(pdist(points).min())


def phi_p(points: np.ndarray) -> float:
    """Compute Morris and Mitchell's criterion (sum of distance^-p)^(1/p), p = PHI_POWER; a small value is good.

    It goes to 1 / minimum distance as p grows (Morris and Mitchell 1995, J. Stat. Plan. Inference 43:381).
    """
    from scipy.spatial.distance import pdist

    return float(np.sum(pdist(points) ** -PHI_POWER) ** (1.0 / PHI_POWER))


def lhsdesign(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """Draw random Latin hypercubes (n, d), and return the one with the largest minimum distance, as the paper does."""
    return max((random_lhs(n, d, rng) for _ in range(CANDIDATES)), key=minimum_distance)


def optimal_lhs(n: int, d: int, seed: int | list[int]) -> np.ndarray:
    """Make a Latin hypercube (n, d) whose points are as far apart as exchanges within its columns can put them.

    Enhanced stochastic evolution (Jin, Chen and Sudjianto 2005, J. Stat. Plan. Inference 134:268) on phi_p, for powers
    that grow, from the `lhsdesign` of the same seed; the best design by minimum distance is kept.
    """
    from repose.calibrate.designs.exchange_search import evolve

    rng = np.random.default_rng(seed)
    best = lhsdesign(n, d, rng=rng)
    if n < 3 or d < 2:
        return best
    current = best.copy()
    for doublings in PHI_DOUBLINGS:
        current, widest = evolve(current, doublings, ROUNDS_PER_POWER, rng)
        best = max((best, current, widest), key=minimum_distance)
    return best


def compare(designs: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """Judge designs by method: `method`, `samples`, `min_distance`, `phi_p`, `centred_discrepancy`."""
    from scipy.stats import qmc

    columns = ("method", "samples", "min_distance", "phi_p", "centred_discrepancy")
    rows = [
        (
            method,
            len(points),
            minimum_distance(points),
            phi_p(points),
            qmc.discrepancy(points, method="CD"),
        )
        for method, points in designs.items()
    ]
    return pd.DataFrame(rows, columns=columns)


def design(
    space: ParameterSpace, section: DesignSettings
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Choose the parameter sets of a study; return them with the table of `compare`.

    The free parameters fill their ranges evenly, also with a prior: the surrogate then holds for every value of the
    prior, which is applied in the search and in the posterior.
    """
    designs = {
        name: points(section.samples, space.dimensions, name, section.seed)
        for name in METHODS
    }
    return parameter_sets(designs[section.method], space), compare(designs)


def points(n: int, d: int, method: str, seed: int) -> np.ndarray:
    """Make the design (n, d) of a method: "random", "lhsdesign" or "optimal"."""
    if method == "optimal":
        return optimal_lhs(n, d, seed)
    return (random_lhs if method == "random" else lhsdesign)(
        n, d, rng=np.random.default_rng(seed)
    )


def parameter_sets(
    points: np.ndarray, space: ParameterSpace, first: int = 1
) -> pd.DataFrame:
    """Turn points (n, d) of the unit cube into a table: `sample` from `first`, and the parameters."""
    table = pd.DataFrame(space.values(points), columns=list(space.names))
    table.insert(0, "sample", np.arange(first, first + len(table)))
    return table
