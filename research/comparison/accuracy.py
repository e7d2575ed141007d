"""Accuracy of the network at points that no fit has seen, for growing training sets."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.training import split_samples
from repose.common.files import write_table
from research.comparison import models, scores
from research.comparison.points import Points, joined

# a network below them is no surrogate to search on
BARS = {
    "r2": 0.94,
    "explainable": 0.95,
}
SHARES = (0.25, 0.5, 1.0)  # of the pool's points


def table_of(
    sets: Sequence[Points], names: Sequence[str], settings: Mapping[str, Any]
) -> pd.DataFrame:
    """Accuracy of the network, a row for each training set and response.

    `sets` are the main design, the pool and the fresh points, as `points.read_sets` returns them; `settings` is the
    section `network`. Columns ``r2`` and ``explainable`` have bounds (``_low``, ``_high``) and a bar (``_bar``).
    """
    main, pool, fresh = sets
    rows = []
    for name, training in training_sets(main, pool, settings):
        predict = models.configured_network(training, settings, settings["seed"])
        rows.extend(_rows(name, names, training, fresh, predict(fresh.X)))
    return pd.DataFrame(rows)


def run(
    sets: Sequence[Points],
    names: Sequence[str],
    settings: Mapping[str, Any],
    out_dir: str | Path,
) -> pd.DataFrame:
    """Write accuracy.csv; return the table."""
    table = table_of(sets, names, settings)
    write_table(Path(out_dir) / "accuracy.csv", table, float_format="%.6g")
    return table


def training_sets(
    main: Points, pool: Points, settings: Mapping[str, Any]
) -> Iterator[tuple[str, Points]]:
    """Training sets of the network, each with its name for the table.

    First the main design's training samples as the chain splits it. Then all of the main design, and leading parts of
    the pool, each with fewer and with all runs. Last the main design and the pool together.
    """
    train = split_samples(len(main.X), settings["split"], settings["seed"])["train"]
    yield "main design, training samples", main.take(train)
    for seeds in _doublings(main.values.shape[1]):
        yield "main design", main.take(np.arange(len(main.X)), seeds)
    for share in SHARES:
        rows = np.arange(round(share * len(pool.X)))
        for seeds in _doublings(pool.values.shape[1]):
            yield "pool", pool.take(rows, seeds)
    both = min(main.values.shape[1], pool.values.shape[1])
    yield (
        "main design and pool",
        joined([main.take(slice(None), both), pool.take(slice(None), both)]),
    )


def message(table: pd.DataFrame) -> str:
    """Accuracy in words, a line for each training set and response."""
    lines = []
    for row in table.itertuples():
        lines.append(
            f"{row.training}, {row.points} x {row.seeds}: {row.response} R2 {row.r2:.3f} "
            f"({row.r2_low:.3f} to {row.r2_high:.3f}), explainable {row.explainable:.3f} "
            f"({row.explainable_low:.3f} to {row.explainable_high:.3f})"
        )
    return "\n".join(lines)


def _rows(name, names, training, fresh, predicted):
    """Rows of the table for one training set, a row for each response."""
    means = fresh.means()
    errors = fresh.known_errors()
    mean, std = predicted
    seeds = training.values.shape[1]
    for k, response in enumerate(names):
        y = means[:, k]
        se = errors[:, k]
        p = mean[:, k]
        row = {
            "training": name,
            "points": len(training.X),
            "seeds": seeds,
            "simulations": training.simulations(),
            "response": response,
            "test_points": len(y),
            "test_seeds": fresh.values.shape[1],
        }
        row |= scores.accuracy(y, se, p)
        for key, (low, high) in scores.bootstrap(y, se, p).items():
            row |= {f"{key}_low": low, f"{key}_high": high, f"{key}_bar": BARS[key]}
        row["r2_single_runs"] = scores.on_runs(fresh.values[:, :, k], p)
        row["r2_training_seeds"] = scores.on_few_seeds(fresh.values[:, :, k], p, seeds)
        yield row | scores.calibration(y, se, p, std[:, k])


def _doublings(seeds):
    """1, 2, 4, ... below seeds, and seeds."""
    return [2**k for k in range(8) if 2**k < seeds] + [seeds]
