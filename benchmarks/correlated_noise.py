"""What it costs to train angle and Height as if their noises were independent, on a study's own piles.

python benchmarks/correlated_noise.py --dataset results/dataset.csv --runs results/runs.csv --splits 8

Each split trains on 70 % of the samples, as the workflow does, and tests on the others' means; R2 is the mean over
the splits with its standard error, gamma the number of weights that the data determine.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from repose.core.parameters import PARAMETERS
from repose.studies.noise import within_covariance
from repose.surrogate.bayesian_bp import RESPONSES, PlainBayesianBP, r2, weights_from_errors

TRAINING_SHARE = 0.7
STARTS, EPOCHS = 4, 400


def trial(prior, told, X, Y, errors, covariance, order):
    """R2 of both responses on the test samples, and gamma."""
    train, test = np.split(order, [int(TRAINING_SHARE * len(X))])
    precision = weights_from_errors(errors[train])
    model = PlainBayesianBP(hidden=12, starts=STARTS, epochs=EPOCHS, goal=0.0, prior=prior)
    if told:
        model.fit(X[train], Y[train], precision=precision.mean(axis=1), noise_covariance=covariance)
    else:
        model.fit(X[train], Y[train], precision=precision)
    P = model.predict(X[test])
    return [r2(Y[test, k], P[:, k]) for k in range(Y.shape[1])] + [model.gamma_]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dataset", required=True, help="dataset.csv of a study")
    parser.add_argument(
        "--runs", required=True, help="runs.csv of the same study, two seeds a sample or more"
    )
    parser.add_argument("--splits", type=int, default=8)
    parser.add_argument("--out", help="markdown file to write the table to")
    args = parser.parse_args()
    table, runs = (pd.read_csv(path).query("status == 'ok'") for path in (args.dataset, args.runs))
    X, Y = table[list(PARAMETERS)].to_numpy(), table[list(RESPONSES)].to_numpy()
    errors = table[["aor_se_deg", "height_se_mm"]].to_numpy()
    covariance, _ = within_covariance(runs[list(RESPONSES)], runs["sample"])
    correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    print(f"correlation of the noises {correlation:.2f}\n")
    titles = ("prior", "covariance", "R2 angle", "R2 Height", "gamma")
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for prior in ("one", "inputs"):
        for told in (False, True):
            rows = [
                trial(prior, told, X, Y, errors, covariance, np.random.RandomState(k).permutation(len(X)))
                for k in range(args.splits)
            ]
            mean, error = np.mean(rows, axis=0), np.std(rows, axis=0, ddof=1) / np.sqrt(args.splits)
            cells = [f"{m:.3f} ± {e:.3f}" for m, e in zip(mean[:2], error[:2], strict=True)]
            lines.append(
                "| " + " | ".join([prior, "told" if told else "not told", *cells, f"{mean[2]:.0f}"]) + " |"
            )
    print("\n".join(lines))
    if args.out:
        Path(args.out).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
