"""How near the targets an answer really is: least objective beside least expected loss, in campaigns of known truth.

python benchmarks/representative.py --pool results/pool --campaigns 16 --out table.csv

A Gaussian process of the pool's samples is the truth, and its runs scatter as the pool's do. Each campaign pours as
many samples and seeds as the configuration has (a Sobol sequence) from this truth, trains the surrogate and searches.
It is judged by the true means: the share of campaigns with all targets within 1 % and 2 %, and the worst deviation.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from repose.chain import expected_loss, invert
from repose.chain.design import sobol
from repose.config import loader
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.targets import Targets
from repose.studies.comparison import points, proposals
from repose.surrogate import make


def campaign(truth, covariance, unit, space, targets, config, surrogate, seed):
    """Parameter sets of one campaign, by the rule that chose them."""
    random = np.random.default_rng(seed)
    mean = truth.predict(space.values(unit))
    noise = random.multivariate_normal(
        np.zeros(len(targets)), covariance, (len(unit), config["funnel"]["seeds"])
    )
    settings = config["network"] | {"surrogate": surrogate, "seed": seed}
    samples = points.Points(unit, mean[:, None] + noise)
    model = proposals.study_surrogate(samples, space, targets, settings)
    found = invert.invert(model, space, targets, config["miga"] | {"seed": seed})
    best = found.summary["representative"]
    return {"least objective": best, "least expected loss": expected_loss.least(model, space, targets)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pool", required=True, help="folder with dataset.csv and runs.csv of the pool")
    parser.add_argument("--config", default="config/config.yaml")
    parser.add_argument("--surrogate", default="network")
    parser.add_argument("--starts", type=int, help="of the network; as configured unless given")
    parser.add_argument("--first", type=int, default=0, help="number of the first campaign, its seed")
    parser.add_argument("--campaigns", type=int, default=16)
    parser.add_argument("--out", required=True, help="CSV file with a row for each campaign and rule")
    args = parser.parse_args()
    config = loader.load(args.config)
    if args.starts:
        config["network"]["starts"] = args.starts
    targets, space = Targets.of(config["targets"]), ParameterSpace.of(config["parameters"])
    pool = points.read(Path(args.pool) / "dataset.csv", Path(args.pool) / "runs.csv", targets.names)
    truth = make("gaussian_process", {}).fit(pool.X, pool.means(), **pool.replicates())
    rows = []
    for seed in range(args.first, args.first + args.campaigns):
        unit = sobol(config["design"]["samples"], space.dimensions, seed)
        sets = campaign(truth, pool.covariance(), unit, space, targets, config, args.surrogate, seed)
        for rule, one in sets.items():
            there = truth.predict(np.array([[one[name] for name in PARAMETERS]]))[0]
            off = 100 * (there - targets.aim) / targets.aim
            rows.append({"campaign": seed, "rule": rule, "worst_percent": np.abs(off).max()})
        pd.DataFrame(rows).to_csv(args.out, index=False)
    for rule, own in pd.DataFrame(rows).groupby("rule")["worst_percent"]:
        print(
            f"{rule}: median {own.median():.2f} %, within 1 % {np.mean(own <= 1):.2f}, 2 % {np.mean(own <= 2):.2f}"
        )


if __name__ == "__main__":
    main()
