"""Searches beside each other on the trained network: how soon they meet the target, and what they find.

Every search minimises the fitness that `miga` does (Eq. 11-12 and its constraints) over the six parameters in
[-1, 1], by the same log that counts its evaluations; one that ends early starts again elsewhere until all evaluations
are used. `repose.search.miga` says where the constraints come from.

  miga                    multi-island genetic algorithm, as configured
  miga_whole              the same with all of its configured evaluations
  one_population          the same operators, one island of as many individuals
  differential_evolution  scipy's, population 15 a parameter
  dual_annealing          scipy's, with its local search
  cma_es                  covariance matrix adaptation (cmaes 0.13), population by its rule
  least_squares           scipy's trust region on the two deviations, from random points, derivatives by differences
  random                  uniform points

What a search finds is judged twice: by the list that the study keeps of it (the best `solutions` that lie `distance`
apart), and by all feasible points it met. Both are held against a dense uniform sample of the feasible region.
"""

import math
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
from scipy import optimize, stats
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist

from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.search.miga import INFEASIBLE, MIGA, OPERATORS, Objective, distinct
from repose.studies.comparison import scores
from repose.surrogate.bayesian_bp import load, response_function

FEWEST_FEASIBLE = 200  # of the reference sample, or nothing can be said about the region
CHECKPOINTS_A_DECADE = 8
CLOUD = 5000  # reference points that coverage is taken over
DIMENSIONS = len(PARAMETERS)
STEP = 1e-6  # of the differences
EXACT = 1e-12  # a smaller objective is rounding, and has no logarithm to speak of
REFERENCE = "feasible region"


class Spent(Exception):
    """All evaluations are used."""


class Log:
    """Counts and keeps what a search evaluates, and ends it by `Spent` when the evaluations are used up.

    respond: populations in [-1, 1] (points, d) to (points, 2); objective: `miga.Objective`; evaluations: allowed.
    points (used, d) and fitness (used,) are in the order in which they were asked for.
    """

    def __init__(self, respond, objective, evaluations, dimensions=DIMENSIONS):
        self.respond, self.objective = respond, objective
        self._points = np.empty((evaluations, dimensions))
        self._fitness = np.empty(evaluations)
        self.used = 0

    @property
    def points(self):
        return self._points[: self.used]

    @property
    def fitness(self):
        return self._fitness[: self.used]

    def __call__(self, points):
        """Fitness (n,) of points (n, d)."""
        return self._keep(points, self.respond(points))

    def of_one(self, x):
        """Fitness of one point (d,)."""
        return float(self(np.asarray(x)[None])[0])

    def residuals(self, x):
        """Deviations (2,) of one point (d,) from the target, in widths of its box."""
        return self._residuals(np.asarray(x)[None])[0]

    def jacobian(self, x):
        """Their derivatives (2, d) by differences, into the box, for as many evaluations."""
        steps = STEP * np.where(np.asarray(x) > 0, -1.0, 1.0)
        moved = self._residuals(np.asarray(x) + np.diag(steps))
        return ((moved - self._residuals_at(x)) / steps[:, None]).T

    def _residuals_at(self, x):
        """Residuals of a point that was counted already."""
        return (self.respond(np.asarray(x)[None])[0] - self.objective.target) / self.objective.width

    def _residuals(self, points):
        responses = self.respond(points)
        self._keep(points, responses)
        return (responses - self.objective.target) / self.objective.width

    def _keep(self, points, responses):
        room = len(self._fitness) - self.used
        if room == 0:
            raise Spent
        rows = slice(self.used, self.used + min(room, len(points)))
        self._points[rows] = points[:room]
        self._fitness[rows] = self.objective.fitness(*self.objective(responses[:room]))
        self.used = rows.stop
        if room < len(points):
            raise Spent
        return self._fitness[rows]


# --- the searches: functions of a Log and a seed that end by Spent --------------------------------


def miga(log, seed, **settings):
    search = MIGA(len(PARAMETERS), **settings, seed=seed)
    while True:
        search.tell(log(search.ask()))


def differential_evolution(log, seed):
    for restart in range(10**6):
        optimize.differential_evolution(
            lambda x: log(x.T),
            [(-1, 1)] * len(PARAMETERS),
            maxiter=10**6,
            tol=0.0,
            atol=1e-9,
            polish=False,
            updating="deferred",
            vectorized=True,
            rng=np.random.default_rng([seed, restart]),
        )


def dual_annealing(log, seed):
    for restart in range(10**6):
        random = np.random.default_rng([seed, restart])
        optimize.dual_annealing(
            log.of_one, [(-1, 1)] * len(PARAMETERS), maxiter=10**6, maxfun=1e12, rng=random
        )


def cma_es(log, seed):
    from cmaes import CMA

    bounds = np.tile([-1.0, 1.0], (len(PARAMETERS), 1))
    for restart in range(10**6):
        random = np.random.default_rng([seed, restart])
        start, stream = random.uniform(-1, 1, len(PARAMETERS)), int(random.integers(2**31))
        search = CMA(mean=start, sigma=0.5, bounds=bounds, seed=stream)
        while not search.should_stop():
            asked = np.array([search.ask() for _ in range(search.population_size)])
            search.tell(list(zip(asked, log(asked), strict=True)))


def least_squares(log, seed):
    random = np.random.default_rng(seed)
    while True:
        start = random.uniform(-1, 1, len(PARAMETERS))
        optimize.least_squares(log.residuals, start, log.jacobian, bounds=(-1, 1))


def uniform(log, seed):
    random = np.random.default_rng(seed)
    while True:
        log(random.uniform(-1, 1, (2000, len(PARAMETERS))))


SEARCHES = {
    "differential_evolution": differential_evolution,
    "dual_annealing": dual_annealing,
    "cma_es": cma_es,
    "least_squares": least_squares,
    "random": uniform,
}


def searches(section):
    """All searches by name, with the evaluations of each that has its own number.

    section: `miga` of the configuration.
    """
    own = {key: section[key] for key in OPERATORS}
    alone = own | {"islands": 1, "population": section["islands"] * section["population"]}
    whole = section["rounds"] * section["generations"] * alone["population"]
    found = {"miga": (partial(miga, **own), None), "miga_whole": (partial(miga, **own), whole)}
    found |= {"one_population": (partial(miga, **alone), None)}
    return found | {name: (search, None) for name, search in SEARCHES.items()}


def logged(search, respond, objective, evaluations, seed):
    """The `Log` of one search with all its evaluations used, and the seconds it took."""
    log, began = Log(respond, objective, evaluations), time.perf_counter()
    with suppress(Spent):
        search(log, seed)
    return log, time.perf_counter() - began


# --- what was found -------------------------------------------------------------------------------


class Region:
    """A uniform sample of the feasible region, and what a list of `listed` solutions can cover of it.

    respond, objective: as for `Log`; points: of the Sobol sequence over the whole box, a power of two. share: of the
    box that is feasible. reach: the median distance from a feasible point to the nearest of `listed` random ones.
    Raises ValueError where fewer than 200 points are feasible.
    """

    def __init__(self, respond, objective, points, listed, seed, dimensions=DIMENSIONS):
        unit = 2 * stats.qmc.Sobol(dimensions, rng=seed).random(points) - 1
        _, V = objective(respond(unit))
        self.points = unit[V == 0]
        self.share = len(self.points) / points
        if len(self.points) < FEWEST_FEASIBLE:
            raise ValueError(
                f"{len(self.points)} of {points} points are feasible; allowed: at least {FEWEST_FEASIBLE}"
            )
        self.cloud = self.points[:CLOUD]
        self.volume = _volume(self.points)
        random = np.random.default_rng(seed)
        self.lists = [
            random.choice(self.points, min(listed, len(self.points)), replace=False) for _ in range(10)
        ]
        self.reach = float(np.median([cKDTree(one).query(self.cloud)[0] for one in self.lists]))

    def spread(self, points):
        """How widely feasible points (n, d) lie, by name; NaN of fewer than two.

        pairwise_distance: mean. coverage: share of the feasible region within `reach` of one of them, a half for as
        many random points. width: mean over the parameters of their interval over the region's (Table 3's
        dispersion). volume: root of the determinant of their covariance over the region's.
        """
        if len(points) < 2:
            return dict.fromkeys(("pairwise_distance", "coverage", "width", "volume"), math.nan)
        covered = cKDTree(points).query(self.cloud)[0] <= self.reach
        return {
            "pairwise_distance": float(pdist(points).mean()),
            "coverage": float(covered.mean()),
            "width": float((np.ptp(points, axis=0) / np.ptp(self.points, axis=0)).mean()),
            "volume": _volume(points) / self.volume,
        }


def _volume(points):
    """Root of the determinant of the covariance of points (n, d)."""
    return float(np.sqrt(max(0.0, np.linalg.det(np.atleast_2d(np.cov(points.T))))))


def judged(log, region, tolerance, solutions, distance, seed):
    """One search in numbers, by name, and the best point it found."""
    fitness, feasible = log.fitness, log.fitness <= INFEASIBLE
    found, values = log.points[feasible], fitness[feasible]
    kept = distinct(found, values, distance, solutions) if len(found) else np.zeros(0, int)
    chosen = np.random.default_rng(seed).permutation(len(found))[:solutions]
    row = {
        "best": float(fitness.min()),
        "evaluations_to_feasible": _first(feasible),
        "evaluations_to_tolerance": _first(fitness <= tolerance),
        "feasible_share": float(feasible.mean()),
        "listed": len(kept),
        "listed_objective": float(values[kept].mean()) if len(kept) else math.nan,
    }
    row |= {f"listed_{key}": value for key, value in region.spread(found[kept]).items()}
    row |= {f"met_{key}": value for key, value in region.spread(found[chosen]).items()}
    return row, log.points[fitness.argmin()]


def _first(met):
    """Evaluations until the first True, NaN without one."""
    return float(met.argmax() + 1) if met.any() else math.nan


def checkpoints(evaluations):
    """Numbers of evaluations, evenly in their logarithm from 10 on."""
    count = max(2, round(CHECKPOINTS_A_DECADE * math.log10(evaluations / 10)) + 1)
    return np.unique(np.geomspace(10, evaluations, count).round().astype(int))


def curve(fitness, at):
    """Best fitness so far (k,) after these numbers of evaluations (k,)."""
    return np.minimum.accumulate(fitness)[at - 1]


def run(network_json, ranges, target, settings, section, out_dir):
    """Compare; write search.csv, search_methods.csv and search_runs.csv; return the table of the methods.

    ranges: parameter to (low, high); target: that section of the configuration. settings: evaluations, repetitions,
    tolerance, region_points, seed. section: `miga` of the configuration. Raises InputError for a bad
    file and where the target's box is out of the network's reach.
    """
    import pandas as pd

    low, high = np.array([ranges[name] for name in PARAMETERS], dtype=float).T
    respond = response_function(load(network_json), low, high)
    box = np.array([target["aor_range_deg"], target["height_range_mm"]], dtype=float)
    objective = Objective(box[:, 0], box[:, 1], (target["aor_deg"], target["height_mm"]))
    solutions, distance, seed = section["solutions"], section["distance"], settings["seed"]
    try:
        region = Region(respond, objective, settings["region_points"], solutions, seed)
    except ValueError as error:
        raise InputError(network_json, "feasible region", str(error), "a target within its reach") from None
    rows, curves, bests = [], [], {}
    for name, (search, own) in searches(section).items():
        evaluations = own or settings["evaluations"]
        at, courses, bests[name] = checkpoints(evaluations), [], []
        for k in range(settings["repetitions"]):
            log, seconds = logged(search, respond, objective, evaluations, seed + k)
            row, best = judged(log, region, settings["tolerance"], solutions, distance, seed)
            rows.append(
                {"method": name, "repetition": k, "evaluations": evaluations, **row, "seconds": seconds}
            )
            courses.append(curve(log.fitness, at))
            bests[name].append(best)
        curves.append(_curve_table(pd, name, at, np.array(courses)))
    runs = pd.DataFrame(rows)
    methods = _methods(pd, runs, bests, region)
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    runs.to_csv(out / "search_runs.csv", index=False)
    methods.to_csv(out / "search_methods.csv", index=False)
    pd.concat(curves).to_csv(out / "search.csv", index=False)
    return methods


def _curve_table(pd, name, at, best):
    """Rows of search.csv of one method, best (repetitions, k) so far."""
    exponent = np.log10(np.maximum(best, EXACT))
    return pd.DataFrame(
        {
            "method": name,
            "evaluations": at,
            "best_median": np.median(best, axis=0),
            "best_mean": best.mean(axis=0),
            "best_se": best.std(axis=0, ddof=1) / math.sqrt(len(best)),
            "log10_mean": exponent.mean(axis=0),
            "log10_se": exponent.std(axis=0, ddof=1) / math.sqrt(len(best)),
            "feasible_runs": (best <= INFEASIBLE).mean(axis=0),
        }
    )


def _methods(pd, runs, bests, region):
    """One row a method, means with standard errors, and one for the feasible region itself."""
    rows = []
    for name, group in runs.groupby("method", sort=False):
        row = {"method": name, "repetitions": len(group)}
        row["reached"] = int(group["evaluations_to_tolerance"].notna().sum())
        row["evaluations"] = int(group["evaluations"].iloc[0])
        for key in group.columns[3:]:
            values = group[key].dropna().to_numpy(float)
            found = scores.mean_and_error(values) if len(values) else (math.nan, math.nan)
            row[key], row[f"{key}_se"] = found
        # whether other seeds give the same answer
        row["between_seeds_distance"] = float(pdist(np.array(bests[name])).mean())
        rows.append(row)
    spreads = pd.DataFrame([region.spread(one) for one in region.lists])
    row = {"method": REFERENCE, "repetitions": len(spreads), "feasible_share": region.share}
    for key in spreads:
        mean, error = scores.mean_and_error(spreads[key])
        row[f"listed_{key}"] = row[f"met_{key}"] = mean
        row[f"listed_{key}_se"] = row[f"met_{key}_se"] = error
    row["between_seeds_distance"] = float(pdist(region.cloud[:1000]).mean())
    return pd.DataFrame([*rows, row])


def message(methods):
    """The comparison in words, one line a method."""
    lines = []
    for row in methods.itertuples():
        if row.method == REFERENCE:
            lines.append(f"{row.method}: {100 * row.feasible_share:.1f} % of the ranges")
            continue
        lines.append(
            f"{row.method}: {row.reached:.0f} of {row.repetitions} reach the tolerance, after "
            f"{row.evaluations_to_tolerance:.0f} ± {row.evaluations_to_tolerance_se:.0f} evaluations; its list covers "
            f"{100 * row.listed_coverage:.0f} % of the feasible region"
        )
    return "\n".join(lines)
