"""On which side of the target the answers lie, in campaigns of known truth, by the rule that chose them.

python benchmarks/first_answers.py --samples 30 --out table.csv

A Gaussian process of the pool's samples is the truth, and its runs scatter as the pool's do. Each campaign pours a
Sobol sequence with the configured number of seeds from this truth, trains the surrogate, and searches for a single
target at several levels, quantiles of the pool's responses. It is judged by the true mean at the answer:

  least objective       the answer of the main chain: the search's best point
  least expected loss   predicted deviation and error of the surrogate together are smallest
  anywhere on target    of uniform points in the ranges the `ANYWHERE` that are predicted nearest to the target: the
                        surrogate is the same, the search's choice is left out
  one refit             the answer after one round of the refinement loop about the least objective

What a mend of the answers' bias has to show, written before the run: over 16 campaigns or more, with numbers from 100
on, that nobody looked at, the mean deviation is zero within two of its standard errors, and the median of the absolute
deviation is no larger than that of the least objective.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from repose.chain import expected_loss, invert, train
from repose.chain.design import sobol
from repose.config import loader
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.targets import Targets
from repose.studies import refine
from repose.studies.comparison import points, proposals
from repose.surrogate import make

ROUNDS = 60  # of the search; the configured 870 end at the same answers
ANYWHERE, UNIFORM = 4, 4000
EDGES = (0.0, 1.0, 1.3, 1.6, np.inf)  # half ranges


class Truth:
    """The emulated simulator."""

    def __init__(self, pool, space):
        self.process = make("gaussian_process", {}).fit(pool.X, pool.means(), **pool.replicates())
        self.covariance, self.space = pool.covariance(), space

    def mean(self, unit):
        return self.process.predict(self.space.values(unit))

    def pour(self, unit, seeds, random):
        """Points with their runs; the number of seeds is one for all points, or one for each."""
        seeds = np.broadcast_to(seeds, len(unit))
        zeros = np.zeros(len(self.covariance))
        noise = random.multivariate_normal(zeros, self.covariance, (len(unit), seeds.max()))
        noise[np.arange(seeds.max()) >= seeds[:, None]] = np.nan
        return points.Points(unit, self.mean(unit)[:, None] + noise)


def one_refit(truth, samples, model, found, targets, config, settings, seed):
    """The answer after a round of the refinement loop: pours about the first answer, refit, search near it."""
    space, random = truth.space, np.random.default_rng([seed, 1])
    proposal = refine.propose(found.solutions, model, space, targets, config["refine"], 0, seed)
    place = space.unit(proposal[list(PARAMETERS)].to_numpy())
    added = truth.pour(place, proposal["seeds"].to_numpy(), random)
    tables = []
    for one, numbers in ((samples, np.arange(len(samples.X))), (added, proposal["sample"].to_numpy())):
        table, runs = proposals.tables_of(one, space, targets)
        runs["sample"] = numbers[runs["sample"]]
        tables.append((table.assign(sample=numbers, n_seeds=one.counts()), runs))
    dataset, runs = (refine.extended(design, [near]) for design, near in zip(*tables, strict=True))
    refitted = train.train(dataset, runs, targets, settings).model
    centre = found.summary["representative"]
    return refine.search(refitted, dataset, centre, space, targets, config)[1].summary["representative"]


def answers(truth, samples, model, targets, config, settings, seed):
    """Places in the ranges (n, d) by the rule that chose them."""
    space = truth.space
    found = invert.invert(model, space, targets, config["miga"] | {"seed": seed})
    sets = {
        "least objective": found.summary["representative"],
        "least expected loss": expected_loss.least(model, space, targets),
        "one refit": one_refit(truth, samples, model, found, targets, config, settings, seed),
    }
    places = {rule: space.unit(np.array([[one[name] for name in PARAMETERS]])) for rule, one in sets.items()}
    unit = np.random.default_rng([seed, 2]).random((UNIFORM, space.dimensions))
    off = np.abs(model.predict(space.values(unit))[:, 0] - targets.aim[0])
    return places | {"anywhere on target": unit[off.argsort()[:ANYWHERE]]}


def campaign(truth, levels, config, seed):
    """Rows of one campaign: a design, a surrogate, and the answers for each level of the target."""
    unit = sobol(config["design"]["samples"], truth.space.dimensions, seed)
    samples = truth.pour(unit, config["funnel"]["seeds"], np.random.default_rng(seed))
    settings = config["network"] | {"surrogate": config["surrogate"], "seed": seed}
    model = proposals.study_surrogate(samples, truth.space, next(iter(levels.values())), settings)
    for level, targets in levels.items():
        chosen = answers(truth, samples, model, targets, config, settings, seed)
        for rule, places in chosen.items():
            off = 100 * (truth.mean(places)[:, 0] / targets.aim[0] - 1)
            distance = np.linalg.norm(2 * places - 1, axis=1)
            for one, far in zip(off, distance, strict=True):
                yield (seed, level, rule, one, far)


def mean_with_error(rows):
    """Mean deviation over campaigns, with the standard error that their scatter gives."""
    means = rows.groupby("campaign")["deviation_percent"].mean()
    return f"{means.mean():+.2f} ± {means.std() / np.sqrt(len(means)):.2f} %"


def summary(table):
    """A row for each rule: deviation in all and by level, how near the answers are, distance from the middle."""
    levels = list(dict.fromkeys(table["level"]))
    columns = ["rule", "mean deviation", *levels, "median, without sign", "within 1 %", "2 %", "distance"]
    lines = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    for rule, own in table.groupby("rule", sort=False):
        off = own["deviation_percent"].abs()
        cells = [rule, mean_with_error(own), *(mean_with_error(own[own["level"] == one]) for one in levels)]
        cells += [f"{off.median():.2f} %", f"{np.mean(off <= 1):.2f}", f"{np.mean(off <= 2):.2f}"]
        lines.append("| " + " | ".join([*cells, f"{own['distance'].mean():.2f}"]) + " |")
    return "\n".join(lines)


def over_distance(table):
    """Deviation over the distance from the middle, of all places that one surrogate predicts on the target."""
    table = table[table["rule"] != "one refit"]
    places = pd.cut(table["distance"], EDGES, right=False)
    return ", ".join(f"{bin_}: {mean_with_error(own)}" for bin_, own in table.groupby(places, observed=True))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pool", type=Path, default=Path("results/published/recommended/pool"))
    parser.add_argument("--config", default="config/config.yaml")
    parser.add_argument("--samples", type=int, default=30, help="of a campaign")
    parser.add_argument("--quantiles", type=float, nargs="+", default=[0.1, 0.3, 0.5, 0.7, 0.9])
    parser.add_argument("--first", type=int, default=100, help="number of the first campaign, its seed")
    parser.add_argument("--campaigns", type=int, default=16)
    parser.add_argument("--out", required=True, help="CSV file with a row for each answer")
    args = parser.parse_args()
    config = loader.load(args.config)
    config["miga"]["rounds"], config["design"]["samples"] = ROUNDS, args.samples
    target, space = Targets.of(config["targets"])[0], ParameterSpace.of(config["parameters"])
    pool = points.read(args.pool / "dataset.csv", args.pool / "runs.csv", [target.name])
    values = np.quantile(pool.means()[:, 0], args.quantiles).tolist()
    levels = {
        f"{value:.1f}": Targets(
            [replace(target, value=value, aim=value, low=0.98 * value, high=1.02 * value)]
        )
        for value in values
    }
    truth, rows = Truth(pool, space), []
    for seed in range(args.first, args.first + args.campaigns):
        rows += campaign(truth, levels, config, seed)
        table = pd.DataFrame(rows, columns=["campaign", "level", "rule", "deviation_percent", "distance"])
        table.to_csv(args.out, index=False, float_format="%.5g")
    print(summary(table), f"over the distance: {over_distance(table)}", sep="\n")


if __name__ == "__main__":
    main()
