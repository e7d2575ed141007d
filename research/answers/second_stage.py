"""Whether a second stage of single pours near the targets gives better answers.

    python -m research.answers.second_stage simulate --first 0 --last 30 --out second_stage.csv
    python -m research.answers.second_stage summary --table second_stage.csv
    python -m research.answers.second_stage pour --processes 2 --minutes 120 --out second_stage_pours.csv

`simulate`: paired data sets from the process of `kept_truth.py`. Three pours of each sample are among the six of the same
data set. Each design is fitted (8 starts in place of 20), and answers with the set of least expected loss.

design    pours
6         900    150 samples, 6 pours: the default
6+150     1050   the same, then 150 single pours by `repose.calibrate.strategies.refined.places`: the target `refined`
3         450    150 samples, 3 pours
3+150     600    the same, then 150 single pours: `strategy: refined`

An answer is judged by the truth: Eq. 11 in percent, the sum of the relative deviations from the targets.

`pour`: the same with real pours, for two kept data sets (`goji_berry`, `comparison`), with 20 starts. The pours of the
designs are kept; those of the second stages and 256 fresh ones of each answer are made, 2,136 in all, two hours of a
core or less. Finished pours stay in tables beside the result, and the same command goes on.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from repose.calibrate.expected_loss import minimise_expected_loss
from repose.calibrate.strategies.refined.places import draw_near_targets
from repose.common.errors import InputError
from repose.common.files import read_table, write_table
from research.answers.kept_truth import KEPT, DataSet, Truth, designed
from research.answers.seeds_per_sample import Rows, pouring, seeds_of
from research.script import Script, option

STREAM = 112  # of random numbers, of this study alone
STARTS = 8
SINGLE_POURS = 150
TOLERANCE_PERCENT = 2.0
FULL = "6"
FULL_SECOND = "6+150"
HALF = "3"
HALF_SECOND = "3+150"
PAIRS = ((HALF_SECOND, FULL), (FULL_SECOND, FULL), (HALF, FULL))
LEVEL = 0.95

script = Script("answers.second_stage", __doc__)


@script.part(
    "simulate",
    "second_stage.csv",
    option("--first", type=int, default=0, help="number of the first data set (0)"),
    option("--last", type=int, default=30, help="number after the last (30)"),
)
def simulate(args, config):
    """Simulate paired data sets, and judge the answers of all designs."""
    study = args.study
    truth = Truth.of_kept(study)
    X = designed(study)
    rows = []
    if Path(args.out).exists():
        rows = pd.read_csv(args.out).to_dict("records")
    known = {row["data_set"] for row in rows}
    for number in range(args.first, args.last):
        if number in known:
            continue
        random = np.random.default_rng([STREAM, number])
        pours = truth.pour(X, 6, random)
        settings = study.settings.network.model_copy(
            update={"starts": STARTS, "seed": 2026 + number}
        )
        for seeds, first, second in (
            (6, FULL, FULL_SECOND),
            (3, HALF, HALF_SECOND),
        ):
            data = DataSet(X, list(pours[:, :seeds]))
            model = data.fit(study, settings)
            rows.append(judged(study, truth, model, data, first, number))
            unit = draw_near_targets(
                model,
                study.parameters,
                study.targets,
                count=SINGLE_POURS,
                tolerance_percent=TOLERANCE_PERCENT,
                random=random,
            )
            places = study.parameters.values(unit)
            data = data.and_pours(places, truth.pour(places, 1, random))
            model = data.fit(study, settings)
            rows.append(judged(study, truth, model, data, second, number))
        write_table(args.out, pd.DataFrame(rows), float_format="%.6g")
    return summarised(pd.DataFrame(rows)).to_string(index=False)


def judged(study, truth, model, data, design, number):
    """The row of an answer: its predicted and its true responses, and Eq. 11 of these."""
    targets = study.targets
    answer = minimise_expected_loss(model, study.parameters, targets)
    names = study.parameters.names
    true = truth.mean(np.array([[answer[name] for name in names]]))[0]
    row = {"data_set": number, "design": design, "pours": data.pours}
    row |= {name: answer[name] for name in (*names, *targets.predicted)}
    row |= dict(zip(targets.names, true, strict=True))
    percent = 100 * np.abs(true - targets.aim) / targets.whole
    return row | {"eq11_percent": float(percent @ targets.weight)}


def summarised(table):
    """Mean of each design, and the paired differences with their bounds."""
    by_design = table.pivot(index="data_set", columns="design", values="eq11_percent")
    rows = []
    for design, values in by_design.items():
        rows.append(_row(design, "", values))
    for design, other in PAIRS:
        rows.append(_row(design, other, by_design[design] - by_design[other]))
    return pd.DataFrame(rows)


def _row(design, other, values):
    """Mean, standard error and the two-sided bounds of a mean over the data sets."""
    mean = values.mean()
    error = values.sem()
    reach = stats.t.ppf((1 + LEVEL) / 2, len(values) - 1) * error
    return {
        "design": design,
        "less": other,
        "data_sets": len(values),
        "eq11_percent": mean,
        "se": error,
        "low": mean - reach,
        "high": mean + reach,
    }


KEPT_SETS = ("goji_berry", "comparison")
FRESH = 256


def kept_data(study, name, seeds):
    """The good ones of the first pours of each sample in a kept data set."""
    targets = study.targets
    runs = read_table(KEPT / name / "runs.csv", ("sample", "status", *targets.names))
    first = runs.groupby("sample", sort=False).head(seeds)
    good = dict(list(first[first["status"] == "ok"].groupby("sample")))
    samples = read_table(
        KEPT / name / "dataset.csv", ("sample", *study.parameters.names)
    ).set_index("sample")
    names = list(targets.names)
    X = samples.loc[list(good), list(study.parameters.names)].to_numpy(float)
    return DataSet(X, [runs[names].to_numpy(float) for runs in good.values()])


@script.part(
    "pour",
    "second_stage_pours.csv",
    option("--processes", type=int, default=2, help="that pour at the same time (2)"),
    option(
        "--minutes", type=float, default=120.0, help="for each table of pours (120)"
    ),
    option("--fresh", type=int, default=FRESH, help=f"pours of each answer ({FRESH})"),
    option("--sets", nargs="+", default=KEPT_SETS, help="kept data sets"),
    simulates=True,
)
def pour(args, config):
    """Judge the answers of the three designs by fresh pours."""
    study = args.study
    settings = study.settings.network
    out = Path(args.out)
    rows = []
    for number, name in enumerate(args.sets):
        answers = {}
        for seeds, first, second in ((6, FULL, FULL_SECOND), (3, HALF, HALF_SECOND)):
            data = kept_data(study, name, seeds)
            model = data.fit(study, settings)
            answers[first] = answer_of(study, model)
            unit = draw_near_targets(
                model,
                study.parameters,
                study.targets,
                count=SINGLE_POURS,
                tolerance_percent=TOLERANCE_PERCENT,
                random=np.random.default_rng([STREAM, 1, number, seeds]),
            )
            places = study.parameters.values(unit)
            path = out.with_name(f"{out.stem}_{name}_{second}.csv")
            key = [number, seeds]
            values = poured(args, path, places, count=1, key=key)
            is_good = [len(of_place) > 0 for of_place in values]
            data = DataSet(
                np.vstack([data.X, places[is_good]]),
                [*data.values, *(of_place for of_place in values if len(of_place))],
            )
            answers[second] = answer_of(study, data.fit(study, settings))
        for k, design in enumerate((FULL, FULL_SECOND, HALF_SECOND)):
            path = out.with_name(f"{out.stem}_{name}_{design}_answer.csv")
            point = answers[design][None]
            values = poured(args, path, point, count=args.fresh, key=[number, 100 + k])
            rows.append(
                {"data_set": name, "design": design} | of_pours(study, values[0])
            )
        write_table(out, pd.DataFrame(rows), float_format="%.5g")
    return pd.DataFrame(rows).to_string(index=False)


def answer_of(study, model):
    """The parameters (d,) of least expected loss."""
    answer = minimise_expected_loss(model, study.parameters, study.targets)
    return np.array([answer[name] for name in study.parameters.names])


def poured(args, path, X, *, count, key):
    """Good pours (pours, k) of each parameter set of X, with seeds of this study alone."""
    study = args.study
    tasks = []
    for row in range(len(X)):
        seeds = seeds_of(study.settings.design.seed, STREAM, [*key, row], count)
        tasks += [
            {"place": row, "pour": pour, "seed": seed, "row": row}
            for pour, seed in enumerate(seeds)
        ]
    keys = ("place", "pour")
    work = pouring(study, keys, X)
    table = Rows(path, keys).complete(tasks, work, args.processes, args.minutes)
    if len(table) < len(tasks):
        allowed = f"{len(tasks)} pours: the same command goes on"
        raise InputError(path, "pours", len(table), allowed)
    good = table[table["status"] == "ok"]
    names = list(study.targets.names)
    return [
        good.loc[good["place"] == row, names].to_numpy(float) for row in range(len(X))
    ]


def of_pours(study, values):
    """Means of the fresh pours of an answer, and their Eq. 11 in percent: as it is, with bounds, and less noise."""
    targets = study.targets
    row = {"pours": len(values)}
    for k, target in enumerate(targets):
        row[target.name] = values[:, k].mean()
        row[target.response.standard_error] = values[:, k].std(ddof=1) / np.sqrt(
            len(values)
        )
    random = np.random.default_rng(STREAM)
    again = random.integers(len(values), size=(4000, len(values)))
    means = np.vstack([values.mean(axis=0), values[again].mean(axis=1)])
    deviations = means - targets.aim
    percent = 100 * np.abs(deviations) / targets.whole @ targets.weight
    low, high = np.quantile(percent[1:], [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    # The noise of the pours enlarges the mean square of each deviation by its variance.
    variances = values.var(axis=0, ddof=1) / len(values)
    without_noise = np.sqrt(np.maximum(deviations[0] ** 2 - variances, 0.0))
    return row | {
        "eq11_percent": percent[0],
        "low": low,
        "high": high,
        "without_noise_percent": 100 * without_noise / targets.whole @ targets.weight,
    }


@script.part(
    "summary",
    "second_stage_summary.csv",
    option("--table", default="second_stage.csv", help="table of `simulate`"),
)
def summary(args, config):
    """Summarise a table of `simulate`."""
    needed = ("data_set", "design", "eq11_percent")
    table = summarised(read_table(args.table, needed))
    write_table(args.out, table, float_format="%.4g")
    return table.to_string(index=False)


if __name__ == "__main__":
    script.run()
