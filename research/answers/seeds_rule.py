"""How many seeds of each sample are enough: data sets drawn from a pool of pours, the judge of their answers, the rule.

Data sets of six, three and two pours of each sample are compared. In a data set the three have their pours in common,
the two among the three among the six, so a difference between them holds little of the noise.

Draws     The pool's pours of each sample are put in a random order, each sample's by itself, and cut in disjoint parts
          of six: parts of one order are independent data sets. Each data set by itself is one of independent pours,
          so means over data sets have no bias. Data sets of different orders share pours, on average 6 of 16 with a
          pool of 16. What all draws of a pool have in common cancels to first order in a difference between numbers
          of seeds, for the mean of any six, three or two tends to the pool's. The rest is a part of the variance that
          more data sets do not lessen: `in_common`.
Judge     A Gaussian process of real pours that no fit has seen, at the answers and at fresh points. A few pours of
          one answer have more scatter than the answers have error; the process joins those of neighbouring answers.
          Mean responses of all answers are drawn from it together, so its own error is in each estimate
          (E (f - t)^2 = (mean - t)^2 + variance) and in each bound.
Bound     The one-sided upper 95 % bound of what is worse than with six seeds: quantile over resamplings of data sets,
          each with a draw of the judge; its distance is multiplied by sqrt(1 + c n), with c = `in_common` and n data
          sets. The 40 fresh points are fixed. All five bounds of a number of seeds must be within their limits, so the
          probability that a number is taken which is worse by more than a limit is at most 5 %, without a correction
          for their number.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy import linalg

from repose.calibrate.search.objective import Objective
from repose.calibrate.surrogates import make
from repose.calibrate.variance import estimate_within_covariance

SEEDS = (6, 3, 2)  # of each sample; the others are compared with the first
# limits of the worsening of the answers, see `choose`
LIMITS = {
    "eq11": 0.15,
    "r2": 0.02,
    "rms_percent": 0.2,
}
LEVEL = 0.95
RESAMPLINGS = 4000
SECOND_ORDER = 0.14  # see `in_common`
MIN_SETS = 8


def choose(upper: Mapping[int, Mapping[str, float]]) -> int:
    """The fewest seeds whose upper bounds of the worsening are all within `LIMITS`; if none, the first of `SEEDS`.

    `upper` holds for each other number of seeds the largest bound over the responses of each quantity.
    """
    met = [
        seeds
        for seeds, bounds in upper.items()
        if all(bounds[name] <= limit for name, limit in LIMITS.items())
    ]
    return min(met, default=SEEDS[0])


def drawn(number: int, samples: int, pool_seeds: int, stream: int) -> np.ndarray:
    """Which pours (samples, 6) of the pool data set `number`, from 0, has; with fewer seeds it has the first ones."""
    order, part = divmod(number, pool_seeds // SEEDS[0])
    random = np.random.default_rng([stream, order])
    shuffled = random.permuted(np.tile(np.arange(pool_seeds), (samples, 1)), axis=1)
    return shuffled[:, part * SEEDS[0] : (part + 1) * SEEDS[0]]


def in_common(pool_seeds: int) -> float:
    """Correlation of two data sets' differences between numbers of seeds, by the pours that they share.

    Simulated studies with a pool of 16 have from 0 to 0.018: linear answers with several errors in common, and the
    expected loss on a Gaussian process of the published pours. This is 0.02 there, and goes with the square of the
    shared part, as what is of second order does.
    """
    return SECOND_ORDER * (SEEDS[0] / pool_seeds) ** 2


class Judge:
    """Mean responses (k,) by parameters, from real pours: a Gaussian process with the noise of single pours."""

    def __init__(self, X: np.ndarray, values: np.ndarray, group: np.ndarray) -> None:
        """`values` (n, k) are single pours, `group` (n,) the row of X (m, d) that was poured."""
        self.noise, _ = estimate_within_covariance(values, group)
        poured, row = np.unique(group, return_inverse=True)
        counts = np.bincount(row).astype(float)
        means = np.column_stack(
            [np.bincount(row, column) / counts for column in values.T]
        )
        self.process = make("gaussian_process").fit(
            X[poured], means, precision=counts, noise_covariance=self.noise
        )

    def draw(
        self, X: np.ndarray, count: int, random: np.random.Generator
    ) -> np.ndarray:
        """Draws (count, m, k) of the mean responses at all parameter sets X (m, d) together."""
        x = self.process._scale_inputs(X)
        columns = []
        for process in self.process.processes_:
            between = process.kernel(x, process.x)
            solved = linalg.solve_triangular(process.cholesky, between.T, lower=True)
            value, vector = np.linalg.eigh(process.kernel(x) - solved.T @ solved)
            normal = random.standard_normal((count, len(x))) * np.sqrt(
                np.maximum(value, 0)
            )
            columns.append(between @ process.weights + normal @ vector.T)
        return self.process.unmix(np.stack(columns, axis=-1)) + self.process.offset_


def of_answers(means, targets):
    """Eq. 11 (...) and relative errors in percent (..., k) of mean responses (..., k)."""
    F, _ = Objective(targets)(means.reshape(-1, len(targets)))
    return F.reshape(means.shape[:-1]), 100 * (means - targets.aim) / targets.whole


def verdict(
    r2: np.ndarray,
    means: np.ndarray,
    targets,
    pool_seeds: int,
    random: np.random.Generator,
) -> tuple[int, pd.DataFrame]:
    """The choice, and a row for each number of seeds, quantity and response.

    `r2` (data sets, 3, k) is at the fresh points, `means` (draws, data sets, 3, k) are the judge's draws of the mean
    responses of the answers; the numbers of seeds are in the order of `SEEDS`.
    """
    draws, sets = means.shape[:2]
    objective, error = of_answers(means, targets)
    # the data sets drawn again, for each draw of the judge
    again = random.integers(sets, size=(draws, sets))
    row = np.arange(draws)[:, None]
    # (3, quantities): the larger, the worse
    value = np.column_stack(
        [
            objective.mean(axis=(0, 1)),
            1 - r2.mean(axis=0),
            np.sqrt((error**2).mean(axis=(0, 1))),
        ]
    )
    # (draws, 3, quantities)
    resampled = np.concatenate(
        [
            objective[row, again].mean(axis=1)[:, :, None],
            1 - r2[again].mean(axis=1),
            np.sqrt((error[row, again] ** 2).mean(axis=1)),
        ],
        axis=2,
    )
    worse = value - value[0]
    factor = np.sqrt(1 + in_common(pool_seeds) * sets)
    reach = np.quantile(resampled - resampled[:, :1], LEVEL, axis=0) - worse
    upper = worse + factor * reach
    quantities = [
        ("eq11", "all"),
        *(("r2", response) for response in targets.names),
        *(("rms_percent", response) for response in targets.names),
    ]
    rows = []
    for i, seeds in enumerate(SEEDS):
        for j, (name, response) in enumerate(quantities):
            rows.append(
                {
                    "seeds": seeds,
                    "quantity": name,
                    "response": response,
                    "value": 1 - value[i, j] if name == "r2" else value[i, j],
                    "worse": worse[i, j],
                    "upper": upper[i, j],
                    "limit": LIMITS[name],
                }
            )
    table = pd.DataFrame(rows)
    fewer = table[table["seeds"] != SEEDS[0]].groupby(["seeds", "quantity"])["upper"]
    # what is unknown is not within its limit
    largest = fewer.agg(lambda bounds: bounds.max(skipna=False))
    return choose({seeds: largest[seeds].to_dict() for seeds in SEEDS[1:]}), table
