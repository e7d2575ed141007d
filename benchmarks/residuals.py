"""Where a surrogate errs: residuals of real pours at points that it has not seen, over the distance from the middle.

python benchmarks/residuals.py

Trained are the network of the recommended run's design and those of its fifths, the data of the campaigns of
`real_campaigns.py refine`. The test points are the pool and its fresh points. Their residuals, pours less prediction,
are averaged over the five networks first, so that a standard error is that of independent points. The distance is that
of the parameters from the middle of their ranges, in half ranges. Last comes a quadratic surface of all pours: what the
square of each parameter adds from the middle of its range to either end; and a Gaussian process of all these pours
beside the fresh pours of the published answers: what it tells of their deviation is the error of the surrogates that
chose them, and what it does not tell would be a difference between the pours of designs and those of checks.
"""

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from repose.chain import train
from repose.config import loader
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.targets import Targets
from repose.studies.comparison import points
from repose.surrogate import make
from repose.surrogate.support import quadratic_terms

RECOMMENDED, CAMPAIGNS = Path("results/published/recommended"), Path("results/published/campaigns")
FIFTHS = 5
EDGES = (0.0, 1.0, 1.3, 1.6, np.inf)


def networks(table, runs, targets, settings):
    """The network of the whole design, and those of its fifths."""
    whole = train.train(table, runs, targets, settings).model
    parts = [
        train.train(
            *(one[(one["sample"] - 1) % FIFTHS == k] for one in (table, runs)), targets, settings
        ).model
        for k in range(FIFTHS)
    ]
    return {"the whole design": [whole], "its fifths": parts}


def by_distance(residual, distance):
    """Mean residual with its standard error in each bin, and the slope of a straight line through all points."""
    cells = []
    for low, high in pairwise(EDGES):
        own = residual[(distance >= low) & (distance < high)]
        cells.append(f"{own.mean():+.2f} ± {own.std(ddof=1) / np.sqrt(len(own)):.2f} ({len(own)})")
    terms = np.column_stack([np.ones_like(distance), distance])
    slope, error = fitted(terms, residual, np.ones_like(residual))
    return [*cells, f"{slope[1]:+.2f} ± {np.sqrt(error[1, 1]):.2f}"]


def fitted(terms, y, weight):
    """Coefficients of weighted least squares and their covariance."""
    root = np.sqrt(weight)
    coefficients = np.linalg.lstsq(terms * root[:, None], y * root, rcond=None)[0]
    variance = (weight * (y - terms @ coefficients) ** 2).sum() / (len(y) - terms.shape[1])
    return coefficients, variance * np.linalg.inv((terms * weight[:, None]).T @ terms)


def squares(sets):
    """What the square of each parameter adds from the middle to an end, with standard errors, and their sum."""
    every = points.joined(sets)
    found, covariance = fitted(quadratic_terms(every.X), every.means()[:, 0], every.counts())
    i, j = np.triu_indices(len(PARAMETERS) + 1)
    own = (i == j) & (i > 0)
    values, errors = found[own], np.sqrt(np.diagonal(covariance)[own])
    rows = [f"{name} {v:+.2f} ± {e:.2f}" for name, v, e in zip(PARAMETERS, values, errors, strict=True)]
    return ", ".join([*rows, f"all {values.sum():+.2f} ± {np.sqrt(covariance[np.ix_(own, own)].sum()):.2f}"])


def beside_answers(process, space, aim):
    """Deviation of the published answers: by their own fresh pours, and by a process of all other pours."""
    columns = {"height_simulated_mm": "simulated_mm", "height_se_mm": "simulated_se_mm"}
    refined = [pd.read_csv(path) for path in (RECOMMENDED / "refined/rounds.csv", CAMPAIGNS / "refine.csv")]
    refined = pd.concat(refined).rename(columns=columns).assign(target_mm=aim)
    tables = {
        "first answers": refined[refined["round"] == 0],
        "after refits": refined[refined["round"] > 0],
        "sequential strategy": pd.read_csv(CAMPAIGNS / "sequential.csv"),
    }
    for name, table in tables.items():
        X = table[list(PARAMETERS)].to_numpy(float)
        by_process = process.predict(X)[:, 0] - table["target_mm"]
        left = table["simulated_mm"] - table["target_mm"] - by_process
        weight = table["simulated_se_mm"] ** -2
        distance = np.linalg.norm(2 * space.unit(X) - 1, axis=1)
        yield (
            f"{name}: distance {distance.min():.2f} to {distance.max():.2f}; off by the process "
            f"{', '.join(f'{one:+.1f}' for one in by_process)} mm, mean {by_process.mean():+.2f}; pours less process "
            f"{np.average(left, weights=weight):+.2f} ± {weight.sum() ** -0.5:.2f} mm"
        )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--surrogate", default="network", help="key `surrogate`; network was the campaigns'")
    args = parser.parse_args()
    config = loader.load("config/config.yaml")
    targets, space = Targets.of(config["targets"]), ParameterSpace.of(config["parameters"])
    design = [pd.read_csv(RECOMMENDED / f"{name}.csv") for name in ("dataset", "runs")]
    sets = [
        points.read(RECOMMENDED / f"{part}dataset.csv", RECOMMENDED / f"{part}runs.csv", targets.names)
        for part in ("", "pool/", "pool/fresh_")
    ]
    test = points.joined(sets[1:])
    distance = np.linalg.norm(2 * space.unit(test.X) - 1, axis=1)
    middle = space.values(np.full((1, space.dimensions), 0.5))
    bins = [f"{low:g} - {high:g}" for low, high in pairwise(EDGES)]
    print("| trained on | " + " | ".join(bins) + " | slope | predicted in the middle |")
    print("|---" * (len(bins) + 3) + "|")
    settings = config["network"] | {"surrogate": args.surrogate}
    for name, models in networks(*design, targets, settings).items():
        residual = test.means()[:, 0] - np.mean([one.predict(test.X)[:, 0] for one in models], axis=0)
        there = ", ".join(f"{one.predict(middle)[0, 0]:.2f}" for one in models)
        print(f"| {name} | " + " | ".join(by_distance(residual, distance)) + f" | {there} |")
    print("squares:", squares([one._replace(X=space.unit(one.X)) for one in sets]))
    every = points.joined(sets)
    process = make("gaussian_process", {}).fit(every.X, every.means(), **every.replicates())
    print(*beside_answers(process, space, targets[0].value), sep="\n")


if __name__ == "__main__":
    main()
