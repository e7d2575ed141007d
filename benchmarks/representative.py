"""How near the targets an answer really is: least objective beside least expected loss, in campaigns of known truth.

    python benchmarks/representative.py --campaigns 40 --out results/published/campaigns/representative.csv

A Gaussian process of the pool's samples is the truth, and its runs scatter as the pool's do. Each campaign pours as
many samples and seeds as the configuration has (a Sobol sequence) from this truth, trains the surrogate and searches.
It is judged by the true means: the share of campaigns with all targets within 1 % and 2 %, and the worst deviation.
`predicted_percent` is the root of the loss that the surrogate expects, in percent.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from repose.chain import expected_loss, invert
from repose.chain.design import sobol
from repose.config import loader
from repose.core import provenance
from repose.core.files import write_table
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.targets import Targets
from repose.studies.comparison import points, proposals
from repose.surrogate import make


def campaign(truth, covariance, unit, space, targets, config, seed):
    """Parameter sets of one campaign, by the rule that chose them."""
    random = np.random.default_rng(seed)
    mean = truth.predict(space.values(unit))
    noise = random.multivariate_normal(
        np.zeros(len(targets)), covariance, (len(unit), config["funnel"]["seeds"])
    )
    settings = config["network"] | {"surrogate": config["surrogate"], "seed": seed}
    samples = points.Points(unit, mean[:, None] + noise)
    model = proposals.study_surrogate(samples, space, targets, settings)
    found = invert.invert(model, space, targets, config["miga"] | {"seed": seed})
    best = found.summary["representative"]
    best = best | expected_loss.judged(model, best, targets)
    return {"least objective": best, "least expected loss": expected_loss.least(model, space, targets)}


def campaigns(config, tables, numbers):
    """A row for each campaign and rule; the table so far is printed after each."""
    targets, space = Targets.of(config["targets"]), ParameterSpace.of(config["parameters"])
    pool = points.read(*tables, targets.names)
    truth = make("gaussian_process", {}).fit(pool.X, pool.means(), **pool.replicates())
    rows = []
    for seed in numbers:
        unit = sobol(config["design"]["samples"], space.dimensions, seed)
        sets = campaign(truth, pool.covariance(), unit, space, targets, config, seed)
        for rule, one in sets.items():
            there = truth.predict(np.array([[one[name] for name in PARAMETERS]]))[0]
            off = np.abs(100 * (there - targets.aim) / targets.aim).max()
            rows.append((seed, rule, off, one["expected_error_percent"], *(one[name] for name in PARAMETERS)))
        yield pd.DataFrame(
            rows, columns=["campaign", "rule", "worst_percent", "predicted_percent", *PARAMETERS]
        )


def summary(table):
    """Median, and how many campaigns are near, by rule."""
    for rule, own in table.groupby("rule")["worst_percent"]:
        near = ", ".join(f"{(own <= percent).sum()} of {len(own)} within {percent} %" for percent in (1, 2))
        yield f"{rule}: median {own.median():.2f} %, {near}"


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pool", type=Path, default=Path("results/published/recommended/pool"))
    parser.add_argument("--config", default="config/config.yaml")
    parser.add_argument("--surrogate", default="network_ensemble")
    parser.add_argument("--starts", type=int, help="of the network; as configured unless given")
    parser.add_argument("--first", type=int, default=0, help="number of the first campaign, its seed")
    parser.add_argument("--campaigns", type=int, default=15)
    parser.add_argument("--out", required=True, help="CSV file with a row for each campaign and rule")
    args = parser.parse_args()
    config = loader.load(args.config) | {"surrogate": args.surrogate}
    if args.starts:
        config["network"]["starts"] = args.starts
    tables = [args.pool / f"{name}.csv" for name in ("dataset", "runs")]
    with provenance.stage("representative", tables, lambda whole, _: whole):
        provenance.note_config(config)
        for table in campaigns(config, tables, range(args.first, args.first + args.campaigns)):
            write_table(args.out, table)
    print(*summary(table), sep="\n")


if __name__ == "__main__":
    main()
