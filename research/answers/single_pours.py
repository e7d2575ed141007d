"""What keeps a network from learning the noise of single pours, which angle and Height share?

    python -m research.answers.single_pours --out single_pours.csv

Six data sets of one pour a sample, seen in one photograph, as `config/paper.yaml` has them: run k of each sample of a
study. Split k of 20 takes data set k modulo 6. Each way trains the article's network on the training part. Judged by
R2 at fresh points with many pours, corrected for their noise: mean over the splits with its standard error, and the
least. `--own` judges the same ways on a study of single pours of its own, by R2 at its test part, noise included.

evidence      as published: of the starts that converged the one with the largest evidence
by_error      of these the one with the least error at the validation part
early_stop    without regularisation, stopped by the validation part
validation    `validation_noise`: fitted again with the covariance of the errors at the validation part
repeats       with the covariance of six further samples of four pours each
linear        a plane, least squares: for comparison
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from repose.calibrate.surrogates import make
from repose.calibrate.surrogates.accuracy import compute_r2
from repose.calibrate.surrogates.levenberg_marquardt import CONVERGED
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.training import split_samples
from repose.common.files import write_table
from research.comparison import points, scores
from research.comparison.early_stopping import EarlyStoppingBP

SHARES = (0.70, 0.15, 0.15)
NETWORK = {"hidden": 12, "epochs": 1500, "goal": 1e-4, "prior": "one", "seed": 2026}
DATA_SETS = 6
REPEATED = 6
REPEATS = 4


def ways(X, Y, rows, starts, repeats=None):
    """Function that predicts, by way."""
    train = rows["train"]
    unseen = rows["validation"]
    settings = NETWORK | {"starts": starts}

    def fitted(**noise):
        return make("network", NetworkSettings.from_keys(settings)).fit(
            X[train], Y[train], **noise
        )

    first = fitted()
    yield "evidence", first.predict
    rated = [
        first.get_network_of_start(k)
        for k, result in enumerate(first.start_results_)
        if result["decrement"] < CONVERGED
    ]
    scale = Y[train].std(axis=0)
    yield (
        "by_error",
        min(
            rated or [first],
            key=lambda model: np.sum(
                ((Y[unseen] - model.predict(X[unseen])) / scale) ** 2
            ),
        ).predict,
    )
    both = np.concatenate([train, unseen])
    stopped = EarlyStoppingBP(
        starts=starts, held_back=SHARES[1] / (SHARES[0] + SHARES[1])
    )
    yield "early_stop", stopped.fit(X[both], Y[both]).predict
    errors = Y[unseen] - first.predict(X[unseen])
    yield "validation", fitted(noise_covariance=errors.T @ errors / len(errors)).predict
    if repeats is not None:
        noise = repeats.replicates()
        del noise["precision"]
        yield "repeats", fitted(**noise).predict
    plane = np.linalg.lstsq(
        np.column_stack([np.ones(len(train)), X[train]]), Y[train], rcond=None
    )[0]
    yield "linear", lambda fresh: np.column_stack([np.ones(len(fresh)), fresh]) @ plane


def at_fresh_points(sets, names, splits, starts):
    """Rows: split, way, and R2 of each response at the fresh points."""
    main, pool, fresh = sets
    means = fresh.means()
    errors = fresh.known_errors()
    for k in range(splits):
        values = main.values[:, k % DATA_SETS]
        good = np.isfinite(values).all(axis=1)
        X = main.X[good]
        Y = values[good]
        drawn = np.random.default_rng(k).choice(len(pool.X), REPEATED, replace=False)
        repeats = pool.take(drawn, REPEATS)
        for way, predict in ways(
            X, Y, split_samples(len(X), SHARES, k), starts, repeats
        ):
            P = predict(fresh.X)
            found = [
                scores.accuracy(means[:, j], errors[:, j], P[:, j])["explainable"]
                for j in range(len(names))
            ]
            yield {"split": k, "way": way} | dict(zip(names, found, strict=True))


def at_test_samples(single, names, splits, starts):
    """Rows as of `at_fresh_points`, by the test part; the first split is the study's own."""
    X = single.X
    Y = single.values[:, 0]
    for k in [NETWORK["seed"], *range(1, splits)]:
        rows = split_samples(len(X), SHARES, k)
        for way, predict in ways(X, Y, rows, starts):
            P = predict(X[rows["test"]])
            test = Y[rows["test"]]
            yield (
                {"split": k, "way": way}
                | {
                    name: compute_r2(test[:, j], P[:, j])
                    for j, name in enumerate(names)
                }
            )


def reachable(main, names):
    """R2 of a perfect model at single pours and at means of more, and the pours that make it 0.94, by response."""
    covariance = main.covariance()
    between = main.means().var(axis=0, ddof=1)
    noise = np.diagonal(covariance)
    signal = between - noise / main.counts().mean()
    correlation = covariance[0, 1] / np.sqrt(noise[0] * noise[1])
    print(f"correlation of the noises {correlation:.2f}")
    for name, s, n in zip(names, signal, noise, strict=True):
        limits = ", ".join(
            f"{s / (s + n / pours):.2f} at {pours}" for pours in (1, 6, 20)
        )
        needed = n / s * 0.94 / 0.06
        print(
            f"{name}: noise {n**0.5:.2f}, signal {s**0.5:.2f}; a perfect model has R2 {limits} pours a sample; "
            f"0.94 takes {needed:.0f} pours, or a noise of {np.sqrt(s * 0.06 / 0.94):.2f}"
        )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--results", type=Path, default=Path("results/published/goji_berry")
    )
    parser.add_argument(
        "--own",
        type=Path,
        help="folder of a study of single pours, as results/published/paper",
    )
    parser.add_argument(
        "--responses", nargs=2, default=["aor_secant_view_deg", "height_view_mm"]
    )
    parser.add_argument("--splits", type=int, default=20)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument(
        "--out", required=True, help="CSV file with a row for each split and way"
    )
    args = parser.parse_args()
    names = args.responses
    if args.own:
        single = points.read(args.own / "dataset.csv", args.own / "runs.csv", names)
        rows = at_test_samples(single, names, args.splits, args.starts)
    else:
        parts = (("main", ""), ("pool", "pool/"), ("fresh", "pool/fresh_"))
        files = {
            f"{k}_{t}": args.results / f"{at}{t}.csv"
            for k, at in parts
            for t in ("dataset", "runs")
        }
        sets = points.read_sets(files, names)
        reachable(sets[0], names)
        rows = at_fresh_points(sets, names, args.splits, args.starts)
    table = pd.DataFrame(rows)
    write_table(args.out, table, float_format="%.4f")
    print(
        table.groupby("way", sort=False)[names]
        .agg(["mean", "sem", "min"])
        .to_string(float_format="%.3f")
    )


if __name__ == "__main__":
    main()
