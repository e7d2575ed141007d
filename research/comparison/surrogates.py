"""Surrogates compared: the same simulations to each, judged at the fresh points."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.common.files import write_table
from research.comparison import scores
from research.comparison.models import MODELS
from research.comparison.points import Points

# points drawn from the pool, which must have at least twice as many
BUDGETS = (
    30,
    60,
    110,
    220,
)
REPETITIONS = 12
REPETITION_STARTS = 8  # of the networks, at most: there are hundreds of fits
MEASURES = (
    "r2",
    "explainable",
    "rmse",
    "coverage_50",
    "coverage_90",
    "standardised_square",
)


def table_of(
    sets: Sequence[Points], names: Sequence[str], settings: Mapping[str, Any], seed: int
) -> pd.DataFrame:
    """Each model at each budget, mean and standard error over the training sets.

    Rows of one training set (the main design, the whole pool) have no standard error. `sets` are as `points.read_sets`
    returns them; `settings` is the section `network`; `seed` is for the training sets.
    """
    main, pool, fresh = sets
    settings = {**settings, "starts": min(settings["starts"], REPETITION_STARTS)}
    rows = []
    for source, drawn in training_sets(main, pool, seed):
        for name, fit in MODELS.items():
            found = [
                judged(fit(points, settings, seed + k), fresh)
                for k, points in enumerate(drawn)
            ]
            if None not in found:
                rows.extend(_rows(source, name, names, drawn, found))
    return pd.DataFrame(rows)


def run(
    sets: Sequence[Points],
    names: Sequence[str],
    settings: Mapping[str, Any],
    seed: int,
    out_dir: str | Path,
) -> pd.DataFrame:
    """Write surrogates.csv; return the table."""
    table = table_of(sets, names, settings, seed)
    write_table(Path(out_dir) / "surrogates.csv", table, float_format="%.6g")
    return table


def training_sets(
    main: Points, pool: Points, seed: int
) -> Iterator[tuple[str, list[Points]]]:
    """Random parts of the pool at each budget, then the whole pool and the main design.

    Each comes as its source, for the table, and a list of sets.
    """
    rng = np.random.default_rng([seed, 1])
    for count in BUDGETS:
        if 2 * count <= len(pool.X):
            draws = [
                rng.choice(len(pool.X), count, replace=False)
                for _ in range(REPETITIONS)
            ]
            yield "pool", [pool.take(rows) for rows in draws]
    yield "pool", [pool]
    yield "main design", [main]


def judged(predict: Callable | None, fresh: Points) -> list[dict[str, Any]] | None:
    """Measures of a fitted model at the fresh points, for each response; None without a model.

    They are the numbers of `scores.accuracy`, and those of `scores.calibration` where the model has errors.
    """
    if predict is None:
        return None
    means = fresh.means()
    errors = fresh.known_errors()
    mean, std = predict(fresh.X)
    found = []
    for k in range(fresh.responses):
        score = scores.accuracy(means[:, k], errors[:, k], mean[:, k])
        if std is not None:
            score |= scores.calibration(
                means[:, k], errors[:, k], mean[:, k], std[:, k]
            )
        found.append(score)
    return found


def _rows(source, name, names, sets, found):
    """Rows of the table, a row for each response."""
    for k, response in enumerate(names):
        row = {
            "model": name,
            "training": source,
            "points": int(np.median([len(points.X) for points in sets])),
            "seeds": sets[0].values.shape[1],
            "simulations": sets[0].simulations(),
            "response": response,
            "repetitions": len(sets),
        }
        for key in MEASURES:
            row[key], row[f"{key}_se"] = scores.mean_and_error(
                [score[k].get(key, np.nan) for score in found]
            )
        yield row
