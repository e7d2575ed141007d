"""Searches compared on the trained surrogate: how soon they meet the targets, and which solutions they find.

`searches` lists them. The solutions of a search are judged twice: by the list that the study keeps of them (the best
`solutions` that lie `distance` apart), and by all feasible points of the search. Both are held against a dense uniform
sample of the feasible region.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.distance import pdist

from repose.calibrate.inversion import restrict_to_free_parameters
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.objective import Objective, select_distinct
from repose.calibrate.surrogates import load
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import write_table
from research.comparison import scores
from research.comparison.region import Region
from research.comparison.searches import Log, Respond, logged, searches

CHECKPOINTS_A_DECADE = 8
EXACT = 1e-12  # a smaller objective is rounding error, and its logarithm means nothing
REFERENCE = "feasible region"


def judged(
    log: Log,
    region: Region,
    tolerance: float,
    solutions: int,
    distance: float,
    seed: int,
) -> tuple[dict[str, float], np.ndarray]:
    """Numbers of one search by name, and its best point (d,) in [-1, 1].

    A list holds at most `solutions` points, at least `distance` apart; `tolerance` is of the objective; `seed` is for
    the choice among all feasible points of the search.
    """
    fitness = log.fitness
    feasible = log.fitness <= log.objective.infeasible_offset
    found = log.points[feasible]
    values = fitness[feasible]
    kept = (
        select_distinct(found, values, distance, solutions)
        if len(found)
        else np.zeros(0, int)
    )
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
    """Count the evaluations until the first True, NaN without one."""
    return float(met.argmax() + 1) if met.any() else math.nan


def checkpoints(evaluations: int) -> np.ndarray:
    """Numbers of evaluations from 10 to the given last number, evenly spaced in their logarithm."""
    count = max(2, round(CHECKPOINTS_A_DECADE * math.log10(evaluations / 10)) + 1)
    return np.unique(np.geomspace(10, evaluations, count).round().astype(int))


def curve(fitness: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Best fitness so far, (m,), after the numbers of evaluations `at` (m,), from 1."""
    return np.minimum.accumulate(fitness)[at - 1]


def compared(
    respond: Respond,
    dimensions: int,
    objective: Objective,
    settings: Mapping[str, Any],
    section: Mapping[str, Any],
) -> dict[str, pd.DataFrame]:
    """All searches, several times each.

    `respond` maps populations in [-1, 1] (n, d) to responses (n, k). `settings` holds ``evaluations``, ``repetitions``,
    ``tolerance``, ``region_points`` and ``seed``; `section` is `miga`. The tables are ``search`` (best so far over the
    evaluations), ``search_methods``, ``search_runs``, and ``timings``, the only table that another run changes.
    ValueError if hardly a point of the ranges is feasible.
    """
    solutions = section["solutions"]
    distance = section["distance"]
    seed = settings["seed"]
    region = Region(
        respond, objective, settings["region_points"], solutions, dimensions, seed
    )
    rows = []
    curves = []
    took = []
    bests: dict[str, list] = {}
    for name, (search, budget) in searches(section).items():
        evaluations = budget or settings["evaluations"]
        at = checkpoints(evaluations)
        courses = []
        bests[name] = []
        for k in range(settings["repetitions"]):
            log, seconds = logged(
                search, respond, objective, evaluations, dimensions, seed + k
            )
            row, best = judged(
                log, region, settings["tolerance"], solutions, distance, seed
            )
            labels = {"method": name, "repetition": k, "evaluations": evaluations}
            rows.append({**labels, **row})
            took.append({**labels, "seconds": seconds})
            courses.append(curve(log.fitness, at))
            bests[name].append(best)
        curves.append(
            _curve_table(name, at, np.array(courses), objective.infeasible_offset)
        )
    runs = pd.DataFrame(rows)
    return {
        "search": pd.concat(curves),
        "search_methods": _methods(runs, bests, region),
        "search_runs": runs,
        "timings": pd.DataFrame(took),
    }


def run(
    network_json: str | Path,
    space: ParameterSpace,
    targets: Targets,
    settings: Mapping[str, Any],
    section: Mapping[str, Any],
    out_dir: str | Path,
) -> pd.DataFrame:
    """Write search.csv, search_methods.csv, search_runs.csv and timings/search.csv; return the table of the methods.

    Targets out of the surrogate's reach raise InputError. `settings` and `section` are as for `compared`.
    """
    respond = restrict_to_free_parameters(load(network_json, targets.names), space)
    objective = Objective(targets)
    try:
        tables = compared(respond, space.dimensions, objective, settings, section)
    except ValueError as error:
        raise InputError(
            network_json, "feasible region", str(error), "a target within its reach"
        ) from None
    write_table(Path(out_dir) / "timings" / "search.csv", tables.pop("timings"))
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table)
    return tables["search_methods"]


def _curve_table(name, at, best, infeasible):
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
            "feasible_runs": (best <= infeasible).mean(axis=0),
        }
    )


def _methods(runs, bests, region):
    """Make a row for each method, means with standard errors, and a row for the feasible region itself."""
    rows = []
    for name, group in runs.groupby("method", sort=False):
        row = {"method": name, "repetitions": len(group)}
        row["reached"] = int(group["evaluations_to_tolerance"].notna().sum())
        row["evaluations"] = int(group["evaluations"].iloc[0])
        for key in group.columns[3:]:
            values = group[key].dropna().to_numpy(float)
            found = (
                scores.mean_and_error(values) if len(values) else (math.nan, math.nan)
            )
            row[key], row[f"{key}_se"] = found
        # whether other seeds give the same answer
        row["between_seeds_distance"] = float(pdist(np.array(bests[name])).mean())
        rows.append(row)
    spreads = pd.DataFrame([region.spread(points) for points in region.lists])
    row = {
        "method": REFERENCE,
        "repetitions": len(spreads),
        "feasible_share": region.share,
    }
    for key in spreads:
        mean, error = scores.mean_and_error(spreads[key])
        row[f"listed_{key}"] = row[f"met_{key}"] = mean
        row[f"listed_{key}_se"] = row[f"met_{key}_se"] = error
    row["between_seeds_distance"] = float(pdist(region.cloud[:1000]).mean())
    return pd.DataFrame([*rows, row])


def message(methods: pd.DataFrame) -> str:
    """Put the comparison in words, a line for each method of search_methods.csv."""
    lines = []
    for row in methods.itertuples():
        if row.method == REFERENCE:
            lines.append(
                f"{row.method}: {100 * row.feasible_share:.1f} % of the ranges"
            )
            continue
        lines.append(
            f"{row.method}: {row.reached:.0f} of {row.repetitions} reach the tolerance, after "
            f"{row.evaluations_to_tolerance:.0f} ± {row.evaluations_to_tolerance_se:.0f} evaluations; its list covers "
            f"{100 * row.listed_coverage:.0f} % of the feasible region"
        )
    return "\n".join(lines)
