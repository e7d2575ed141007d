"""Errors and stated probabilities of the answers over independent data sets: real pours alone, no emulator.

    python -m research.answers.answers_by_data_set --out answers.csv
    python -m research.answers.answers_by_data_set --sets whole --runs second_run third_run --out answers_whole.csv

A data set is fitted as the chain does it (`repose.calibrate.training`, its split included), and each fit answers the same
targets by the parameter set of least expected loss. The judge of a data set is a Gaussian process of all pours that are
not in it. No pour is in two sets:

  parts   design and pool in four quarters of their samples, two pours of each sample a set: eight sets of about 92
          samples and 180 pours
  whole   the design (150 samples, 6 pours), the pool (220 samples, 4 pours), and each folder of --runs, a further run
          of the design with other seeds

Targets: one response, quantiles of what all pours together predict over the ranges; two, predicted pairs of points in
the ranges. A stated probability is that of the judge's value: the judge's own error is added to the stated one. Errors
of one fit go together, so standard errors are counted by data sets; in the table of classes they are no less than those
of independent answers with the stated probability.

The rule for the default, written before its first run. Of the surrogates whose stated probability agrees with the
achieved share within two standard errors in every class, the least rms over all data sets and both numbers of
responses. A difference in rms below its standard error is a tie; a tie goes to the one nearer to the article's network:
network, networks with other errors, network and process, process alone. Where no surrogate agrees in every class, the
one with fewest classes that do not. Classes with answers of fewer than three data sets do not count.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import qmc

from repose.bench.parameters import PARAMETERS
from repose.calibrate import expected_loss
from repose.calibrate.probability import compute_box_probability
from repose.calibrate.surrogates import make
from repose.calibrate.targets import Targets
from repose.config import computed
from repose.config.pipeline import PipelineConfig
from research.answers import surrogate_candidates
from research.comparison import points
from research.comparison.points import Points
from research.comparison.proposals import study_surrogate

CLASSES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 1.0)  # of the stated probability
PERCENT = (1.0, 2.0)
MIN_SETS = 3


def read(folder, names, prefix=""):
    """Pours of a folder by sample."""
    return points.read(
        folder / f"{prefix}dataset.csv", folder / f"{prefix}runs.csv", names
    )


def merged(sets):
    """All pours of several sets, those of one parameter set together."""
    every = points.joined(sets)
    X, place = np.unique(every.X, axis=0, return_inverse=True)
    rows = [
        every.values[place.ravel() == k].reshape(-1, every.responses)
        for k in range(len(X))
    ]
    most = max(map(len, rows))
    return Points(
        X,
        np.array(
            [
                np.pad(runs, ((0, most - len(runs)), (0, 0)), constant_values=np.nan)
                for runs in rows
            ]
        ),
    )


def cut(design, pool):
    """Eight data sets of disjoint pours, and for each all other pours of design and pool."""
    every = points.joined([design, pool])
    quarter = np.concatenate(
        [
            np.random.default_rng(k).permutation(len(part.X)) % 4
            for k, part in enumerate((design, pool))
        ]
    )
    for k in range(4):
        for pair in (slice(0, 2), slice(2, 4)):
            chosen = np.zeros(every.values.shape[:2], dtype=bool)
            chosen[quarter == k, pair] = True
            yield tuple(
                Points(
                    every.X, np.where(kept[:, :, None], every.values, np.nan)
                )._with_runs()
                for kept in (chosen, ~chosen)
            )


def data_sets(args, names):
    """Name, data set and the pours of its judge."""
    design = read(args.folder, names)
    pool = read(args.folder / "pool", names)
    fresh = read(args.folder / "pool", names, "fresh_")
    if args.sets == "parts":
        for k, (data, others) in enumerate(cut(design, pool)):
            yield f"part {k + 1}", data, [others, fresh], fresh
        return
    wholes = {"design": design, "pool": pool} | {
        run.name: read(run, names) for run in args.runs
    }
    for name, data in wholes.items():
        yield (
            name,
            data,
            [other for key, other in wholes.items() if key != name] + [fresh],
            fresh,
        )


def process(samples):
    """A Gaussian process of pours."""
    return make("gaussian_process").fit(
        samples.X, samples.means(), **samples.replicates()
    )


def aims(judge, space, count):
    """Values (count, k) that can be reached."""
    unit = qmc.Sobol(space.dimensions, seed=1).random(4096)
    predicted = judge.predict(space.values(unit))
    if predicted.shape[1] == 1:
        return np.quantile(predicted[:, 0], np.linspace(0.05, 0.95, count))[:, None]
    return predicted[:count]


def targets_at(names, aim):
    """Targets with these aims."""
    return Targets.of(
        [
            {
                "response": name,
                "value": value,
                "sd": 0.05 * value,
                "repetitions": 10,
                "range": [0.95 * value, 1.05 * value],
            }
            for name, value in zip(names, aim.tolist(), strict=True)
        ]
    )


def fit(name, samples, space, targets, config):
    """The surrogate as the chain trains it."""
    split = computed.choose_split(name)
    unit = Points(space.unit(samples.X), samples.values)
    settings = config["network"] | {"surrogate": name, "split": split}
    return study_surrogate(unit, space, targets, settings)


def answers(model, judge, names, values, space):
    """A row for each target and tolerance."""
    for number, aim in enumerate(values):
        targets = targets_at(names, aim)
        found = expected_loss.minimise_expected_loss(model, space, targets)
        X = np.array([[found[parameter] for parameter in PARAMETERS]])
        truth = judge.predict(X)
        unsure = judge.covariance(X)
        errors = 100 * (truth[0] / aim - 1)
        row = {
            "target": number,
            "off": errors[0],
            "off_2": errors[-1],
            "judge_se": 100 * np.sqrt(unsure[0, 0, 0]) / aim[0],
        }
        row["judge_se_2"] = 100 * np.sqrt(unsure[0, -1, -1]) / aim[-1]
        for percent in PERCENT:
            reach = percent / 100 * aim
            chance = compute_box_probability(
                model.predict(X), model.covariance(X) + unsure, aim - reach, aim + reach
            )[0]
            row |= {
                f"told_{percent:g}": found["within"][f"{percent:g} %"],
                f"stated_{percent:g}": chance,
            }
            row[f"met_{percent:g}"] = bool((np.abs(errors) <= percent).all())
        yield row


def at_fresh_points(model, fresh):
    """Root mean square of what is predicted less what was poured there, in their standard errors together."""
    errors = model.predict(fresh.X) - fresh.means()
    variances = np.diagonal(model.covariance(fresh.X), axis1=1, axis2=2)
    return float(np.sqrt(np.mean(errors**2 / (variances + fresh.errors() ** 2))))


def run(args, study):
    """A row for each answer of each fit."""
    config = study.config
    space = study.parameters
    rows = []
    for responses in args.responses:
        columns = ["height_mm", args.angle][:responses]
        names = ["height_mm", "aor_deg"][:responses]
        sets = list(data_sets(args, columns))
        values = aims(process(merged([sets[0][1], *sets[0][2]])), space, args.targets)
        for set_name, data, others, fresh in sets:
            judge = process(merged(others))
            for name in args.surrogates:
                began = time.process_time()
                model = fit(name, data, space, targets_at(names, values[0]), config)
                cost = time.process_time() - began
                labels = {
                    "surrogate": name,
                    "responses": responses,
                    "set": set_name,
                    "samples": len(data.X),
                    "pours": int(data.counts().sum()),
                    "fit_s": cost,
                    "z_fresh": at_fresh_points(model, fresh),
                }
                rows += [
                    labels | answer
                    for answer in answers(model, judge, names, values, space)
                ]
                pd.DataFrame(rows).to_csv(args.out, index=False, float_format="%.5g")
    return pd.DataFrame(rows)


def by_sets(table, values):
    """Mean of values, and its standard error by the scatter of data sets."""
    mean = np.mean(values)
    count = len(values)
    sums = (
        pd.Series(np.asarray(values, dtype=float) - mean)
        .groupby(table["set"].to_numpy())
        .sum()
    )
    sets = len(sums)
    return mean, np.sqrt(sets / max(sets - 1, 1) * (sums**2).sum()) / count


def summary(table):
    """The table of errors."""
    shares = (f"within {percent:g} % | stated, reported" for percent in PERCENT)
    heads = [
        "responses",
        "surrogate",
        "sets of samples, pours",
        "mean error %",
        "rms %",
        "judge's own error %",
    ]
    yield "| " + " | ".join([*heads, *shares, "fresh z", "fit s"]) + " |"
    yield "|---" * 12 + "|"
    for (responses, name), group in table.groupby(
        ["responses", "surrogate"], sort=False
    ):
        errors = ["off", "off_2"][:responses]
        mean = "; ".join(
            "{:+.2f} ± {:.2f}".format(*by_sets(group, group[key])) for key in errors
        )
        rms = []
        for key in errors:
            square, error = by_sets(group, group[key] ** 2)
            rms.append(f"{square**0.5:.2f} ± {error / 2 / square**0.5:.2f}")
        judge = "; ".join(
            f"{np.sqrt(np.mean(group[key.replace('off', 'judge_se')] ** 2)):.2f}"
            for key in errors
        )
        shares = []
        for percent in PERCENT:
            met, error = by_sets(group, group[f"met_{percent:g}"])
            shares += [
                f"{met:.2f} ± {error:.2f}",
                f"{group[f'stated_{percent:g}'].mean():.2f} ({group[f'told_{percent:g}'].mean():.2f})",
            ]
        size = f"{group['set'].nunique()} of {group['samples'].mean():.0f}, {group['pours'].mean():.0f}"
        cells = [
            responses,
            name,
            size,
            mean,
            "; ".join(rms),
            judge,
            *shares,
            f"{group['z_fresh'].mean():.2f}",
            f"{group['fit_s'].mean():.1f}",
        ]
        yield "| " + " | ".join(map(str, cells)) + " |"


def reliability(table):
    """Stated probability and achieved share by class, for 1 % and 2 % and both numbers of responses together."""
    yield "| surrogate | class | answers | sets | stated | achieved | difference | agrees |"
    yield "|---" * 8 + "|"
    for name, group in table.groupby("surrogate", sort=False):
        parts = [
            pd.DataFrame(
                {
                    "set": group["set"],
                    "stated": group[f"stated_{percent:g}"],
                    "met": group[f"met_{percent:g}"],
                }
            )
            for percent in PERCENT
        ]
        every = pd.concat(parts, ignore_index=True)
        for place, part in every.groupby(
            pd.cut(every["stated"], CLASSES, include_lowest=True), observed=True
        ):
            difference, error = by_sets(
                part, part["met"].astype(float) - part["stated"]
            )
            # where all sets achieve 1.00 their scatter has no information
            variances = part["stated"] * (1 - part["stated"])
            error = max(error, np.sqrt(variances.sum()) / len(part))
            n_sets = part["set"].nunique()
            if n_sets < MIN_SETS:
                agrees = "few"
            elif abs(difference) <= 2 * error:
                agrees = "yes"
            else:
                agrees = "no"
            yield (
                f"| {name} | {place} | {len(part)} | {n_sets} | {part['stated'].mean():.2f} | "
                f"{part['met'].mean():.2f} | {difference:+.2f} ± {error:.2f} | {agrees} |"
            )


def differences(table):
    """Root mean square error of all answers, each response by itself, and how much more it is than the default's."""
    keys = ["surrogate", "responses", "set"]
    square = (
        table.assign(square=(table["off"] ** 2 + table["off_2"] ** 2) / 2)
        .groupby(keys)["square"]
        .mean()
    )
    default = square[square.index.get_level_values("surrogate") == "network_ensemble"]
    for name, group in square.groupby(level="surrogate", sort=False):
        both = pd.concat(
            [group.droplevel("surrogate"), default.droplevel("surrogate")],
            axis=1,
            join="inner",
        )
        first, second = both.groupby("set").mean().to_numpy().T
        more = (first - second) / (np.sqrt(first.mean()) + np.sqrt(second.mean()))
        beside = f"{more.mean():+.3f} ± {more.std(ddof=1) / np.sqrt(len(more)):.3f} over {len(more)} sets"
        yield f"{name}: rms {np.sqrt(group.mean()):.3f} %, more than network_ensemble by {beside}"


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--folder", type=Path, default=Path("results/published/height_alone")
    )
    parser.add_argument("--config", default="config/config.yaml")
    parser.add_argument("--sets", choices=["parts", "whole"], default="parts")
    parser.add_argument(
        "--runs",
        type=Path,
        nargs="*",
        default=[],
        help="folders with dataset.csv and runs.csv of further runs",
    )
    parser.add_argument(
        "--angle", default="aor_secant_deg", help="column of the second response"
    )
    parser.add_argument(
        "--responses", type=int, nargs="+", choices=[1, 2], default=[1, 2]
    )
    parser.add_argument(
        "--surrogates",
        nargs="+",
        default=["network_ensemble", "gaussian_process", *surrogate_candidates.NAMES],
    )
    parser.add_argument("--targets", type=int, default=15)
    parser.add_argument(
        "--read",
        type=Path,
        nargs="*",
        help="tables of earlier runs, instead of fitting",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("answers.csv"),
        help="CSV file with a row for each answer",
    )
    args = parser.parse_args()
    if args.read:
        tables = [pd.read_csv(path) for path in args.read]
        for path, answers_table in zip(args.read, tables, strict=True):
            # equal names in two files are two data sets
            answers_table["set"] = f"{path.stem}, " + answers_table["set"]
        table = pd.concat(tables, ignore_index=True)
    else:
        table = run(args, PipelineConfig.load(args.config))
    print(*summary(table), "", *reliability(table), "", *differences(table), sep="\n")


if __name__ == "__main__":
    main()
