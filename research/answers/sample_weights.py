"""Do the samples' own standard errors, as weights of the fit, buy accuracy?

    python -m research.answers.sample_weights --out results/published/studies/sample_weights.csv

Draws of 60 and of 110 points of the pool, and the main design; one network and a Gaussian process are fitted to the
means with weights from the errors, with the numbers of runs as weights, and without weights. Judged at the fresh
points: share of the explainable variance, and its difference paired by draw.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from repose.calibrate.surrogates import make
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.common import provenance
from repose.common.files import write_table
from research.comparison import points, scores

DRAWS = {60: 8, 110: 6}
WAYS = ("errors", "runs", "none")
MODELS = ("network", "gaussian_process")
NETWORK = {"hidden": 12, "epochs": 400, "goal": 0.0, "starts": 3, "prior": "inputs"}


def weights_from_errors(errors):
    """Precisions of mean one from standard errors (samples, outputs).

    A sample's variance about the surrogate is its own se^2 plus what the surrogate cannot follow, taken as large as the
    median se^2. The sum also keeps a standard error that is small by luck, out of few seeds, from ruling. A sample
    without a standard error counts as the noisiest.
    """
    known = np.where(np.isfinite(errors), errors, np.nanmax(errors, axis=0))
    variance = known**2 + np.median(known**2, axis=0)
    return (1 / variance) / np.mean(1 / variance, axis=0)


def trial(training, fresh):
    """Share of the explainable variance by model and way of weighing."""
    weights = (
        weights_from_errors(training.known_errors())[:, 0],
        training.counts().astype(float),
        None,
    )
    found = {}
    for way, weight in zip(WAYS, weights, strict=True):
        for model in (
            make(name, NetworkSettings.from_keys(NETWORK)) for name in MODELS
        ):
            mean = model.fit(training.X, training.means(), precision=weight).predict(
                fresh.X
            )
            accuracy = scores.accuracy(
                fresh.means()[:, 0], fresh.known_errors()[:, 0], mean[:, 0]
            )
            found[model.name, way] = accuracy["explainable"]
    return found


def compared(files, response):
    """Rows of the table: mean share of each way of weighing, and the first two paired."""
    main_design, pool, fresh = points.read_sets(files, [response])
    random = np.random.default_rng(5)
    sets = {
        f"pool, {count}": [
            pool.take(random.choice(len(pool.X), count, replace=False))
            for _ in range(draws)
        ]
        for count, draws in DRAWS.items()
    } | {f"main design, {len(main_design.X)}": [main_design]}
    for name, drawn in sets.items():
        trials = [trial(sample, fresh) for sample in drawn]
        for model in MODELS:
            share = {
                way: np.array([trial[model, way] for trial in trials]) for way in WAYS
            }
            gain, error = scores.mean_and_error(share["errors"] - share["runs"])
            means = {way: share[way].mean() for way in WAYS}
            row = {"trained_on": name, "draws": len(drawn), "model": model} | means
            yield row | {"errors_less_runs": gain, "errors_less_runs_se": error}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("results/published/height_alone"),
        help="folder of a study with its pool",
    )
    parser.add_argument("--response", default="height_mm")
    parser.add_argument(
        "--out",
        required=True,
        help="CSV file with a row for each training set and model",
    )
    args = parser.parse_args()
    parts = (("main", ""), ("pool", "pool/"), ("fresh", "pool/fresh_"))
    files = {
        f"{k}_{t}": args.results / f"{at}{t}.csv"
        for k, at in parts
        for t in ("dataset", "runs")
    }
    with provenance.record_stage(
        "sample_weights", list(files.values()), lambda config, _: config
    ):
        table = pd.DataFrame(compared(files, args.response))
        write_table(args.out, table, float_format="%.4f")
    print(table.to_string(index=False, float_format="%.3f"))


if __name__ == "__main__":
    main()
