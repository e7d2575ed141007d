"""How many pours each of the 150 samples of the default study gets, 6, 3 or 2: steps of the study, and its verdict.

    python -m research.answers.seeds_per_sample pour_pool --processes 2
    python -m research.answers.seeds_per_sample pour_fresh --processes 2
    python -m research.answers.seeds_per_sample answers --processes 2
    python -m research.answers.seeds_per_sample pour_answers --processes 2
    python -m research.answers.seeds_per_sample judge

The rule stands in `seeds_rule.py`, the reasons in `research/docs/comparison.md`. Each step keeps its rows as they come
and goes on where it was stopped; `--minutes` ends it in time, with what is then under way.
"""

import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench import bench
from repose.bench.parameters import parameters_among
from repose.calibrate import inversion as invert
from repose.calibrate import training as train
from repose.calibrate.seeds import draw_run_seeds
from repose.common import attached, provenance
from repose.common.errors import InputError
from repose.common.files import read_table, write_json, write_table
from repose.config import dependencies
from repose.stages import dataset
from repose.stages.job import run_once
from repose.stages.parameter_sets import read_samples
from research import pool, settings
from research.answers import seeds_rule
from research.answers.seeds_rule import SEEDS, Judge
from research.script import Script, option
from research.streams import STREAMS

OUT = "results/seeds_per_sample"
SAMPLES = "results/published/goji_berry/design/samples.csv"
BENCH = "funnel"
# Streams of random numbers of this study alone, beyond all of `research.streams`.
OF_POOL = 101
OF_ANSWERS = 102
OF_DRAWS = 103
OF_JUDGE = 104
EVERY_S = 2.0  # a table is written at most so often
POOL_SEEDS = 16
DATA_SETS = 64
FRESH_SEEDS = 16
ANSWER_SEEDS = 6

script = Script("answers.seeds_per_sample", __doc__)
PROCESSES = option(
    "--processes", type=int, default=2, help="that work at the same time (2)"
)
MINUTES = option(
    "--minutes", type=float, default=np.inf, help="after which no further run begins"
)
POOL = option(
    "--pool-seeds",
    type=int,
    default=POOL_SEEDS,
    help=f"pours of each sample ({POOL_SEEDS})",
)
DESIGN = option("--design", default=SAMPLES, help=f"the design ({SAMPLES})")


def table_of(step):
    """The option for the table of an earlier step."""
    return option(f"--{step.replace('_', '-')}", default=f"{OUT}/{step}.csv")


def runs_depend_on(config, apparatus):
    """Settings of a measured pour."""
    pour_settings = dependencies.select_stage_settings(
        config, "heap"
    ) | dependencies.select_stage_settings(config, "berry")
    points = dependencies.select_sections(
        settings.read_settings(config), "pool.seed", "pool.fresh_samples"
    )
    return pour_settings | points | dependencies.select_sections(config, "parameters")


class Rows:
    """Rows by their keys, in a file that is written as they come; those of another origin are refused."""

    def __init__(self, path, keys):
        self.path = Path(path)
        self.keys = list(keys)
        self.rows = {}
        self.written = 0.0
        if self.path.exists():
            now = provenance.get_current_record()
            then = attached.read_record(self.path)
            if then is None or now is None or then["origin"] != now["origin"]:
                allowed = "the same settings, engine and tables as now, or another place for this file"
                raise InputError(
                    path, "provenance.origin", then and then["origin"], allowed
                )
            self.add(read_table(path, keys).to_dict("records"))

    def add(self, rows):
        self.rows |= {tuple(row[key] for key in self.keys): row for row in rows}

    def complete(self, tasks, work, processes, minutes):
        """Do the tasks, mappings with the keys, that have no row yet; the table."""
        missing = [
            task
            for task in tasks
            if tuple(task[key] for key in self.keys) not in self.rows
        ]
        for row in worked(work, missing, processes, minutes):
            self.add([row])
            if time.monotonic() > self.written + EVERY_S:
                self.write()
        return self.write()

    def write(self):
        table = pd.DataFrame([self.rows[key] for key in sorted(self.rows)])
        write_table(self.path, table, float_format="%.8g")
        self.written = time.monotonic()
        return table


def worked(work, tasks, processes, minutes):
    """Results of `work` as they come, by several processes; after some minutes no task begins."""
    until = time.monotonic() + 60 * minutes
    for task in tasks[:1]:  # what it compiles is there for all
        yield work(task)
    workers = ProcessPoolExecutor(processes, get_context("fork"), _take, (work,))
    try:
        futures = [workers.submit(_do, task) for task in tasks[1:]]
        for future in as_completed(futures):
            if not future.cancelled():
                yield future.result()
            if time.monotonic() > until:
                for waiting in futures:
                    waiting.cancel()
    finally:
        workers.shutdown(cancel_futures=True)


def _take(work):
    global _work
    _work = work


def _do(task):
    return _work(task)


def seeds_of(study_seed, stream, number, count):
    """Seeds of this study alone; the first ones are the same for any larger count."""
    return (
        np.random.SeedSequence([study_seed, stream, *number])
        .generate_state(count)
        .tolist()
    )


def pouring(study, keys, X):
    """Pours and measures a task: `row` of X, `seed`."""
    test = bench(BENCH)
    names = study.targets.names

    def pour(task):
        values = dict(zip(study.parameters.names, X[task["row"]].tolist(), strict=True))
        run, _ = run_once(test, study.scene(values, task["seed"]))
        kept = {key: task[key] for key in (*keys, "seed")} | {"status": run["status"]}
        return (
            kept
            | {"reason": run.get("reason") or ""}
            | {name: run.get(name, np.nan) for name in names}
        )

    return pour


def poured(args, keys, places, X, seeds):
    """Pour every place, mappings with the keys, with all its seeds: pour by pour over all places."""
    tasks = [
        place | {"pour": pour, "seed": pour_seeds[pour], "row": row}
        for pour in range(len(seeds[0]))
        for row, (place, pour_seeds) in enumerate(zip(places, seeds, strict=True))
    ]
    keys = (*keys, "pour")
    table = Rows(args.out, keys).complete(
        tasks, pouring(args.study, keys, X), args.processes, args.minutes
    )
    return f"{len(table)} of {len(tasks)} pours, {(table['status'] == 'ok').sum()} of them ok"


def design_of(args):
    samples = read_samples(args.design)
    return [{"sample": k} for k in samples["sample"]], samples[
        list(args.study.parameters.names)
    ].to_numpy(float)


def fresh_of(study, config):
    fresh = pool.points_of("fresh", study.parameters, config["pool"])
    return [{"sample": k} for k in fresh["sample"]], fresh[
        list(study.parameters.names)
    ].to_numpy(float)


@script.part(
    "pour_pool",
    f"{OUT}/pool.csv",
    DESIGN,
    POOL,
    PROCESSES,
    MINUTES,
    depends_on=runs_depend_on,
    simulates=True,
)
def pour_pool(args, config):
    """Pour the design many times."""
    places, X = design_of(args)
    seed = config["design"]["seed"]
    seeds = [
        seeds_of(seed, OF_POOL, [place["sample"]], args.pool_seeds) for place in places
    ]
    return poured(args, ["sample"], places, X, seeds)


@script.part(
    "pour_fresh",
    f"{OUT}/fresh.csv",
    option(
        "--fresh-seeds",
        type=int,
        default=FRESH_SEEDS,
        help=f"pours of each point ({FRESH_SEEDS})",
    ),
    PROCESSES,
    MINUTES,
    depends_on=runs_depend_on,
    simulates=True,
)
def pour_fresh(args, config):
    """Pour the fresh points of the pool of comparisons, which no fit sees."""
    places, X = fresh_of(args.study, config)
    seed = config["design"]["seed"]
    seeds = [
        draw_run_seeds(seed, STREAMS["fresh"], place["sample"], args.fresh_seeds)
        for place in places
    ]
    return poured(args, ["sample"], places, X, seeds)


@script.part(
    "answers",
    f"{OUT}/answers.csv",
    DESIGN,
    table_of("pool"),
    POOL,
    option(
        "--data-sets",
        type=int,
        default=DATA_SETS,
        help=f"of each number of seeds ({DATA_SETS})",
    ),
    PROCESSES,
    MINUTES,
)
def answers(args, config):
    """Fit and invert every data set as the study does it."""
    runs = pours_of(args.pool, args.study.targets, ["sample", "pour"])
    places, _ = design_of(args)
    expected = {
        (place["sample"], pour) for place in places for pour in range(args.pool_seeds)
    }
    found = {(row["sample"], row["pour"]): row for row in runs.to_dict("records")}
    if len(expected - set(found)) or args.pool_seeds <= SEEDS[0]:
        allowed = f"{args.pool_seeds} pours, more than {SEEDS[0]}, of each of {len(places)} samples"
        raise InputError(args.pool, "pours", len(expected & set(found)), allowed)
    table = Rows(args.out, ["data_set", "seeds"])
    others = {row["pool_seeds"] for row in table.rows.values()} - {args.pool_seeds}
    if others:
        raise InputError(
            args.out,
            "pool_seeds",
            others.pop(),
            f"{args.pool_seeds}, as --pool-seeds says",
        )
    tasks = [
        {"data_set": k, "seeds": seeds}
        for k in range(args.data_sets)
        for seeds in SEEDS
    ]
    table = table.complete(
        tasks, fitting(args, config, found), args.processes, args.minutes
    )
    return f"{len(table)} of {len(tasks)} answers"


def fitting(args, config, pours):
    """Fits and inverts a task: `data_set`, `seeds`."""
    study = args.study
    targets = args.study.targets
    samples = read_samples(args.design)
    _, fresh = fresh_of(study, config)

    def fit(task):
        number = task["data_set"]
        seeds = task["seeds"]
        # the first pours of each sample, in the data set's order
        order = seeds_rule.drawn(number, len(samples), args.pool_seeds, OF_DRAWS)
        jobs = {}
        for sample, drawn in zip(samples["sample"].tolist(), order, strict=True):
            runs = [pours[sample, pour] for pour in drawn[:seeds].tolist()]
            jobs[sample] = {"runs": runs}
        network = study.settings.network
        miga = study.settings.miga
        section = network.model_copy(update={"seed": network.seed + number})
        search = miga.model_copy(update={"seed": miga.seed + number})
        tables = dataset.make_tables(samples, {BENCH: jobs}, targets)
        learned = train.train_surrogate(
            *tables,
            targets,
            section,
            names=parameters_among(tables[0]),
            surrogate=study.settings.surrogate,
        )
        found = invert.invert(learned.model, study.parameters, targets, search).summary
        predicted = {
            fresh_column(name, k): value
            for k, row in enumerate(learned.model.predict(fresh).tolist(), start=1)
            for name, value in zip(targets.names, row, strict=True)
        }
        counts = {
            "pool_seeds": args.pool_seeds,
            "samples": learned.metrics["n_samples"],
        }
        return (
            task
            | counts
            | found["representative"]
            | {"feasible": found["feasible"]}
            | predicted
        )

    return fit


def fresh_column(name, sample):
    """Column of a response predicted at a fresh point."""
    return f"{name}_at_{sample:02d}"


@script.part(
    "pour_answers",
    f"{OUT}/answer_pours.csv",
    table_of("answers"),
    option(
        "--answer-seeds",
        type=int,
        default=ANSWER_SEEDS,
        help=f"pours of each answer ({ANSWER_SEEDS})",
    ),
    PROCESSES,
    MINUTES,
    depends_on=runs_depend_on,
    simulates=True,
)
def pour_answers(args, config):
    """Pour every answer with seeds that no fit has seen."""
    keys = ["data_set", "seeds"]
    names = list(args.study.parameters.names)
    found = read_table(args.answers, (*keys, *names))
    places = found[keys].to_dict("records")
    seed = config["design"]["seed"]
    seeds = [
        seeds_of(
            seed, OF_ANSWERS, [place["data_set"], place["seeds"]], args.answer_seeds
        )
        for place in places
    ]
    return poured(args, keys, places, found[names].to_numpy(float), seeds)


@script.part(
    "judge", OUT, table_of("answers"), table_of("fresh"), table_of("answer_pours")
)
def judge(args, config):
    """Judge all answers by real pours; choose by the rule."""
    targets = args.study.targets
    keys = ["data_set", "seeds"]
    study = args.study
    names = list(targets.names)
    parameters = list(study.parameters.names)
    found = (
        read_table(args.answers, (*keys, "pool_seeds", *parameters))
        .set_index(keys)
        .sort_index()
    )
    # data sets with an answer for each number of seeds
    sets = [k for k, answers in found.groupby(level=0) if len(answers) == len(SEEDS)]
    if len(sets) < seeds_rule.MIN_SETS:
        allowed = (
            f"at least {seeds_rule.MIN_SETS} with an answer of each of {SEEDS} seeds"
        )
        raise InputError(args.answers, "data sets", len(sets), allowed)
    found = found.loc[[(k, seeds) for k in sets for seeds in SEEDS]]
    fresh = ok(pours_of(args.fresh, targets, ["sample"]))
    pours = ok(pours_of(args.answer_pours, targets, keys)).set_index(keys)
    pours = pours[pours.index.isin(found.index)]
    _, points = fresh_of(study, config)

    X = found[parameters].to_numpy(float)
    # the row of X of each pour; the fresh points follow the answers
    answer_of = found.index.get_indexer(pours.index)
    values = np.vstack([pours[names].to_numpy(float), fresh[names].to_numpy(float)])
    group = np.concatenate([answer_of, len(X) + fresh["sample"].to_numpy(int) - 1])
    real = Judge(np.vstack([X, points]), values, group)
    random = np.random.default_rng(OF_JUDGE)
    means = real.draw(X, seeds_rule.RESAMPLINGS, random)
    shape = (len(sets), len(SEEDS), len(names))
    chosen, table = seeds_rule.verdict(
        r2_of(found, fresh, names).reshape(shape),
        means.reshape(-1, *shape),
        targets,
        int(found["pool_seeds"].iloc[0]),
        random,
    )
    plain = plain_errors(pours[names], answer_of, found.index, real.noise, targets)
    table = table.merge(plain, how="left", on=["seeds", "quantity", "response"])
    record = {
        "chosen": chosen,
        "data_sets": len(sets),
        "pool_seeds": int(found["pool_seeds"].iloc[0]),
        "answer_pours": len(pours),
        "fresh_pours": len(fresh),
        "noise_sd": dict(zip(names, np.sqrt(np.diagonal(real.noise)), strict=True)),
        "judge_error": dict(
            zip(names, np.sqrt(means.var(axis=0).mean(axis=0)), strict=True)
        ),
    }
    write_table(f"{args.out}/verdict.csv", table, float_format="%.4g")
    write_json(f"{args.out}/verdict.json", record)
    return f"{table.round(3).to_string(index=False)}\n{len(sets)} data sets: {chosen} seeds of each sample"


def pours_of(path, targets, keys):
    """Pours of a table, each with its responses."""
    table = read_table(path, (*keys, "seed", "status", "reason", *targets.names))
    return table.astype({"reason": object}).fillna({"reason": ""})


def ok(runs):
    return runs[runs["status"] == "ok"]


def r2_of(found, fresh, names):
    """R2 (answers, k) at the fresh points, without the noise of their means."""
    by_point = fresh.groupby("sample")[names]
    mean = by_point.mean()
    error = by_point.sem()
    return np.array(
        [
            [
                train.compute_corrected_r2(
                    mean[name].to_numpy(),
                    np.array([row[fresh_column(name, k)] for k in mean.index]),
                    error[name].to_numpy(),
                )
                for name in names
            ]
            for row in found.to_dict("records")
        ],
        dtype=float,  # NaN where the noise is as large as the spread of the points
    )


def plain_errors(values, answer_of, answers, noise, targets):
    """Rms errors by each answer's own pours alone, the mean square less the noise's, and standard errors of these."""
    counts = np.bincount(answer_of, minlength=len(answers)).astype(float)
    means = np.column_stack(
        [
            np.bincount(answer_of, column, len(answers))
            for column in values.to_numpy(float).T
        ]
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        means /= counts[:, None]
        square = (
            1e4
            * ((means - targets.aim) ** 2 - np.diagonal(noise) / counts[:, None])
            / targets.whole**2
        )
    rows = []
    for seeds in SEEDS:
        chosen = square[(answers.get_level_values("seeds") == seeds) & (counts > 0)]
        for name, column in zip(targets.names, chosen.T, strict=True):
            rms = np.sign(column.mean()) * np.sqrt(abs(column.mean()))
            error = column.std(ddof=1) / np.sqrt(len(column)) / (2 * abs(rms))
            rows.append((seeds, "rms_percent", name, rms, error))
    return pd.DataFrame(
        rows, columns=["seeds", "quantity", "response", "plain", "plain_se"]
    )


if __name__ == "__main__":
    script.run()
