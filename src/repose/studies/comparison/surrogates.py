"""Surrogates compared: the same simulations to each, judged at the fresh points."""

from pathlib import Path

import numpy as np

from repose.studies.comparison import points, scores
from repose.studies.comparison.models import MODELS
from repose.surrogate.bayesian_bp import RESPONSES

BUDGETS = (30, 60, 110, 220)  # points drawn from the pool, those that it has twice as many of
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


def run(files, settings, seed, out_dir):
    """Write surrogates.csv: each model at each budget, mean and standard error over the training sets.

    files: as `accuracy.run`; settings: the configuration's section `network`; seed: of the training sets. Rows of
    one training set (the main design, the whole pool) have no standard error. Raises InputError for a file without
    its columns.
    """
    import pandas as pd

    main, pool, fresh = points.read_sets(files)
    settings = settings | {"starts": min(settings["starts"], REPETITION_STARTS)}
    rows = []
    for source, sets in training_sets(main, pool, seed):
        for name, fit in MODELS.items():
            found = [judged(fit(one, settings, seed + k), fresh) for k, one in enumerate(sets)]
            if None not in found:
                rows.extend(_rows(source, name, sets, found))
    table = pd.DataFrame(rows)
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "surrogates.csv", index=False, float_format="%.6g")
    return table


def training_sets(main, pool, seed):
    """Pairs (source, list of points): random parts of the pool, then the main design and the whole pool."""
    rng = np.random.default_rng([seed, 1])
    for count in BUDGETS:
        if 2 * count <= len(pool.X):
            draws = [rng.choice(len(pool.X), count, replace=False) for _ in range(REPETITIONS)]
            yield "pool", [pool.take(rows) for rows in draws]
    yield "pool", [pool]
    yield "main design", [main]


def judged(predict, fresh):
    """Measures by response of a fitted model at the fresh points, None of a model that could not be fitted."""
    if predict is None:
        return None
    means, errors, (mean, std) = fresh.means(), fresh.known_errors(), predict(fresh.X)
    found = []
    for k in range(len(RESPONSES)):
        one = scores.accuracy(means[:, k], errors[:, k], mean[:, k])
        if std is not None:
            one |= scores.calibration(means[:, k], errors[:, k], mean[:, k], std[:, k])
        found.append(one)
    return found


def _rows(source, name, sets, found):
    """Rows of the table, one a response."""
    for k, response in enumerate(RESPONSES):
        row = {
            "model": name,
            "training": source,
            "points": int(np.median([len(one.X) for one in sets])),
            "seeds": sets[0].values.shape[1],
            "simulations": sets[0].simulations(),
            "response": response,
            "repetitions": len(sets),
        }
        for key in MEASURES:
            row[key], row[f"{key}_se"] = scores.mean_and_error([one[k].get(key, np.nan) for one in found])
        yield row
