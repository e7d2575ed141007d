"""Cost of training a study's targets as if their noises were independent.

python -m research.answers.correlated_noise --dataset results/dataset.csv --runs results/runs.csv --splits 8

Each split trains on 70 % of the samples, as the workflow does, and tests on the means of the others. R2 is the mean
over the splits with its standard error; gamma is the number of weights that the data determine.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS
from repose.calibrate.surrogates import make
from repose.calibrate.surrogates.accuracy import compute_r2
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.variance import estimate_within_covariance
from repose.config.pipeline import PipelineConfig
from research.answers.sample_weights import weights_from_errors

TRAINING_SHARE = 0.7
STARTS = 4
EPOCHS = 400


def trial(prior, used, X, Y, errors, covariance, order):
    """R2 of each response on the test samples, and gamma."""
    train, test = np.split(order, [int(TRAINING_SHARE * len(X))])
    precision = weights_from_errors(errors[train])
    settings = {
        "hidden": 12,
        "starts": STARTS,
        "epochs": EPOCHS,
        "goal": 0.0,
        "prior": prior,
    }
    model = make("network", NetworkSettings.from_keys(settings))
    if used:
        model.fit(
            X[train],
            Y[train],
            precision=precision.mean(axis=1),
            noise_covariance=covariance,
        )
    else:
        model.fit(X[train], Y[train], precision=precision)
    P = model.predict(X[test])
    return [compute_r2(Y[test, k], P[:, k]) for k in range(Y.shape[1])] + [model.gamma_]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dataset", required=True, help="dataset.csv of a study")
    parser.add_argument(
        "--runs",
        required=True,
        help="runs.csv of the same study, two seeds a sample or more",
    )
    parser.add_argument(
        "--config",
        default="config/config.yaml",
        help="its targets are taken (%(default)s)",
    )
    parser.add_argument("--splits", type=int, default=8)
    parser.add_argument("--out", help="markdown file to write the table to")
    args = parser.parse_args()
    targets = PipelineConfig.load(args.config).targets
    table = pd.read_csv(args.dataset).query("status == 'ok'")
    runs = pd.read_csv(args.runs).query("status == 'ok'")
    X = table[list(PARAMETERS)].to_numpy()
    Y = table[list(targets.names)].to_numpy()
    errors = table[list(targets.errors)].to_numpy()
    covariance, _ = estimate_within_covariance(
        runs[list(targets.names)], runs["sample"]
    )
    sd = np.sqrt(np.diag(covariance))
    print(f"correlations of the noises\n{np.round(covariance / np.outer(sd, sd), 2)}\n")
    titles = (
        "prior",
        "covariance",
        *(f"R2 {target.response.symbol}" for target in targets),
        "gamma",
    )
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for prior in ("one", "inputs"):
        for used in (False, True):
            rows = []
            for k in range(args.splits):
                order = np.random.RandomState(k).permutation(len(X))
                rows.append(trial(prior, used, X, Y, errors, covariance, order))
            mean = np.mean(rows, axis=0)
            error = np.std(rows, axis=0, ddof=1) / np.sqrt(args.splits)
            cells = [prior, "used" if used else "not used"]
            for m, e in zip(mean[:-1], error[:-1], strict=True):
                cells.append(f"{m:.3f} ± {e:.3f}")
            cells.append(f"{mean[-1]:.0f}")
            lines.append("| " + " | ".join(cells) + " |")
    print("\n".join(lines))
    if args.out:
        Path(args.out).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
