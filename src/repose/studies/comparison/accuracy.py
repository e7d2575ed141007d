"""Accuracy of the network at points that no fit has seen, over what it was trained on."""

from pathlib import Path

import numpy as np

from repose.chain.train import split
from repose.studies.comparison import models, points, scores
from repose.surrogate.bayesian_bp import RESPONSES

BARS = {"r2": 0.94, "explainable": 0.95}  # a network below them is no surrogate to search on
SHARES = (0.25, 0.5, 1.0)  # of the pool's points


def run(files, settings, out_dir):
    """Write accuracy.csv, one row for each training set and response; return the table.

    files: mapping with main_dataset, main_runs, pool_dataset, pool_runs, fresh_dataset, fresh_runs; settings:
    the configuration's section `network`. Raises InputError for a file without its columns.
    """
    import pandas as pd

    main, pool, fresh = points.read_sets(files)
    rows = []
    for name, training in training_sets(main, pool, settings):
        predict = models.configured_network(training, settings, settings["seed"])
        rows.extend(_rows(name, training, fresh, predict(fresh.X)))
    table = pd.DataFrame(rows)
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "accuracy.csv", index=False, float_format="%.6g")
    return table


def training_sets(main, pool, settings):
    """Pairs (source, points): the main design as the chain splits it, all of it with fewer and with all runs, the
    pool's leading points with fewer and with all runs."""
    train = split(len(main.X), settings["split"], settings["seed"])["train"]
    yield "main design, training samples", main.take(train)
    for seeds in _doublings(main.values.shape[1]):
        yield "main design", main.take(np.arange(len(main.X)), seeds)
    for share in SHARES:
        rows = np.arange(round(share * len(pool.X)))
        for seeds in _doublings(pool.values.shape[1]):
            yield "pool", pool.take(rows, seeds)
    both = min(main.values.shape[1], pool.values.shape[1])
    together = [
        np.concatenate([one, other])
        for one, other in zip(main.take(slice(None), both), pool.take(slice(None), both), strict=True)
    ]
    yield "main design and pool", points.Points(*together)


def message(table):
    """How the largest and the main training set fare, in words."""
    lines = []
    for row in table.itertuples():
        lines.append(
            f"{row.training}, {row.points} x {row.seeds}: {row.response} R2 {row.r2:.3f} "
            f"({row.r2_low:.3f} to {row.r2_high:.3f}), explainable {row.explainable:.3f} "
            f"({row.explainable_low:.3f} to {row.explainable_high:.3f})"
        )
    return "\n".join(lines)


def _rows(name, training, fresh, predicted):
    """Rows of the table for one training set, one a response."""
    means, errors, (mean, std) = fresh.means(), fresh.known_errors(), predicted
    seeds = training.values.shape[1]
    for k, response in enumerate(RESPONSES):
        y, se, p = means[:, k], errors[:, k], mean[:, k]
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
