"""The sequential strategy on files: each batch reads the results of all batches before it."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.chain.tables import read_dataset, read_runs
from repose.core.errors import InputError
from repose.core.files import read_json, read_table, write_json, write_table
from repose.core.parameter_space import ParameterSpace
from repose.core.targets import Targets
from repose.strategies import answer
from repose.strategies.sequential.advise import Advice, advise, alternatives, ranked, start
from repose.strategies.sequential.goal import Goal
from repose.strategies.sequential.kriging import Kriging, Observed

Path_ = str | os.PathLike
WHY = {
    "probability": "the answer meets the targets with the probability that was asked for",
    "out_of_reach": "probably no parameter set meets the targets: the answer is the one that comes nearest",
    "budget": "the budget of pours is used up",
    "noise": "the pours that are left cannot make the answer more probable: the noise is too large",
}


def run_start(space: ParameterSpace, section: Mapping[str, Any], seed: int, out_csv: Path_) -> pd.DataFrame:
    """Write the samples of the start; return them (`sample` from 1, and the parameters).

    `section` is `sequential` of the configuration, `seed` its `design.seed`.
    """
    table = _samples(space, start(space, section, seed), 1)
    write_table(out_csv, table)
    return table


def run_batch(
    folders: Sequence[Path_],
    space: ParameterSpace,
    targets: Targets,
    section: Mapping[str, Any],
    seed: int,
    out_dir: Path_,
) -> dict[str, Any]:
    """Write the advice after the batches so far, advice.json and next.csv; return the content of advice.json.

    `folders` are those of all batches, the start first, each with dataset.csv and runs.csv. next.csv has the samples of
    the next batch, or, at the end, the answer as a single sample. The result has `batch` (the last), `pours`, `stop`,
    `why`, `answer`, its `probability` and predicted `responses`, `reachable` and `needed` (`Advice`), `in_reach`
    (probability that any set meets the targets) and `nearest` (least deviation of any set, Eq. 11, with its error).
    """
    dataset, runs = _batches(folders, targets)
    observed, failed = observed_of(dataset, runs, space, targets)
    goal = Goal.of(targets, section["tolerance_percent"], space)
    last, pours = len(folders) - 1, _pours(runs, targets)
    try:
        advice = advise(observed, failed, goal, section, pours, np.random.default_rng([seed, last]))
    except ValueError as error:
        raise InputError(folders[-1], "pours", str(error), "enough to tell the noise") from None
    content = {"batch": last, "pours": pours, **_in_words(advice, space, targets)}
    following = advice.answer[None] if advice.stop else advice.batch
    write_table(Path(out_dir) / "next.csv", _samples(space, following, int(dataset["sample"].max()) + 1))
    write_json(Path(out_dir) / "advice.json", content)
    return content


def run_check(
    folders: Sequence[Path_],
    dataset_csv: Path_,
    runs_csv: Path_,
    config: Mapping[str, Any],
    out_dir: Path_,
) -> pd.DataFrame:
    """Write the course of the batches and the answer, simulated again; return the table of check.csv.

    It has a row for each response: `target`, `predicted`, `predicted_error`, `simulated`, `simulated_error`,
    `deviation_percent`. The other files are batches.csv, dataset.csv and runs.csv of all batches, and those of
    `repose.strategies.answer.write`. `folders` also hold advice.json; `dataset_csv` and `runs_csv` are those of the
    answer.
    """
    targets, space = Targets.of(config["targets"]), ParameterSpace.of(config["parameters"])
    keys: tuple[str, ...] = (
        "batch",
        "pours",
        "stop",
        "why",
        "answer",
        "probability",
        "responses",
        "reachable",
        "needed",
    )
    keys += ("in_reach", "nearest")
    advices = [
        read_json(Path(folder) / "advice.json", keys, "what the verb sequential_batch wrote")
        for folder in folders
    ]
    batches, last = pd.DataFrame([_row(one, targets) for one in advices]), advices[-1]
    dataset, runs = _batches(folders, targets)
    checked = read_table(runs_csv, ("sample", "status", *targets.names))
    check = _check(last, read_dataset(dataset_csv, targets), targets)
    out = Path(out_dir)
    for name, table in {"batches": batches, "check": check, "dataset": dataset, "runs": runs}.items():
        write_table(out / f"{name}.csv", table)
    told = {
        key: last[key]
        for key in ("answer", "probability", "stop", "why", "pours", "needed", "in_reach", "nearest")
    }
    told |= {
        "tolerance_percent": config["sequential"]["tolerance_percent"],
        "check_pours": _pours(checked, targets),
    }
    answer.write(_found(dataset, runs, last, config, told), checked, space, targets, out, told)
    return check


def _check(last, dataset, targets):
    """The answer predicted and simulated, a row for each response."""
    rows = []
    for target in targets:
        predicted = last["responses"][target.name]
        mean, error = (float(dataset[name].iloc[0]) for name in (target.name, target.response.error))
        rows.append(
            {
                "response": target.name,
                "target": target.aim,
                "predicted": predicted["mean"],
                "predicted_error": predicted["error"],
                "simulated": mean,
                "simulated_error": error,
                "deviation_percent": 100 * (mean / target.aim - 1),
            }
        )
    return pd.DataFrame(rows)


def _found(dataset, runs, last, config, told):
    """The answer, with other parameter sets that the same model predicts inside the ranges."""
    targets, space = Targets.of(config["targets"]), ParameterSpace.of(config["parameters"])
    section = config["sequential"]
    observed, failed = observed_of(dataset, runs, space, targets)
    model, goal = Kriging(observed), Goal.of(targets, section["tolerance_percent"], space)
    random = np.random.default_rng([config["design"]["seed"], last["batch"]])
    points, scores = ranked(model, goal, observed.unit, failed, random)
    others, predicted = alternatives(points, scores, model, targets, config["miga"])
    steps = (
        f"Start: {section['start_samples']} parameter sets all over the ranges, each poured {section['seeds']} times.",
        f"Batches: {last['batch']}, each about the best point so far; {told['pours']} pours in all. "
        f"They stopped: {told['why']}.",
        f"Model: kriging of the samples' means with their known errors. The answer lies within "
        f"{section['tolerance_percent']:g} % of all targets with probability {last['probability']:.2f}.",
        f"Check: the answer was poured {told['check_pours']} more times.",
    )
    means = np.array([last["responses"][name]["mean"] for name in targets.names])
    values = np.array([last["answer"][name] for name in space.names])
    note = _out_of_reach(last, targets) if last["stop"] == "out_of_reach" else ""
    return answer.Found(values, means, space.values(others), predicted, steps, note)


def _out_of_reach(last, targets):
    """How near the answer comes, a sentence."""
    off = []
    for target in targets:
        found = last["responses"][target.name]
        percent = [100 * value / target.aim for value in (found["mean"] - target.aim, found["error"])]
        off.append(f"{percent[0]:+.1f} ± {abs(percent[1]):.1f} % off the {target.response.symbol} asked for")
    return (
        "The targets are probably out of reach: some parameter set meets them with probability "
        f"{last['in_reach']:.2f}. "
        f"The answer is the nearest: {', '.join(off)}."
    )


def observed_of(
    dataset: pd.DataFrame, runs: pd.DataFrame, space: ParameterSpace, targets: Targets
) -> tuple[Observed, np.ndarray]:
    """The samples with an ok run as arrays, and the failed samples (f, d) in the unit cube.

    Responses of several bench tests come from separate runs. The first run of each bench test makes the first pour of
    the sample, and so on; these runs are independent, so any pairing is valid.
    """
    unit = space.unit(dataset[list(space.names)].to_numpy(float))
    ok = runs[runs["status"] == "ok"]
    several = "apparatus" in ok
    groups = ["sample", "apparatus"] if several else ["sample"]
    row = pd.Index(dataset["sample"]).get_indexer(ok["sample"])
    place = ok.groupby(groups).cumcount().to_numpy()
    values = np.full((len(dataset), int(place.max(initial=0)) + 1, len(targets)), np.nan)
    for k, target in enumerate(targets):
        own = (ok["apparatus"] == target.response.apparatus).to_numpy() if several else np.full(len(ok), True)
        values[row[own], place[own], k] = ok[target.name].to_numpy(float)[own]
    good = np.isfinite(values).all(axis=2).any(axis=1) & (dataset["status"] == "ok").to_numpy()
    return Observed(unit[good], values[good]), unit[~good]


def _batches(folders, targets):
    """Samples and single runs of all batches."""
    found = []
    for folder in folders:
        dataset_csv, runs_csv = Path(folder) / "dataset.csv", Path(folder) / "runs.csv"
        dataset = read_dataset(dataset_csv, targets)
        found.append((dataset, read_runs(runs_csv, targets, dataset, dataset_csv)))
    dataset, runs = (pd.concat(one, ignore_index=True) for one in zip(*found, strict=True))
    return dataset, runs


def _pours(runs, targets):
    """Pours of a bench test, failed ones included; all bench tests of the targets have as many."""
    return len(runs) // len(targets.apparatus)


def _samples(space, unit, first):
    """Table of samples, numbered from `first`."""
    table = pd.DataFrame(space.values(unit), columns=list(space.names))
    table.insert(0, "sample", np.arange(first, first + len(table)))
    return table


def _in_words(advice: Advice, space, targets):
    """The advice as the JSON file has it."""
    return {
        "stop": advice.stop,
        "why": WHY[advice.stop] if advice.stop else f"{len(advice.batch)} more samples are poured",
        "answer": dict(zip(space.names, space.values(advice.answer[None])[0].tolist(), strict=True)),
        "probability": advice.probability,
        "responses": {
            target.name: {"target": target.aim, "mean": float(mean), "error": float(error)}
            for target, mean, error in zip(targets, advice.mean, advice.error, strict=True)
        },
        "reachable": advice.reachable,
        "needed": advice.needed,
        "in_reach": advice.reach.probability,
        "nearest": {"deviation": advice.reach.nearest, "error": advice.reach.error},
    }


def _row(advice, targets):
    """A batch as a row of batches.csv."""
    keys: tuple[str, ...] = ("batch", "pours", "probability", "reachable", "in_reach", "needed", "stop")
    row = {key: advice[key] for key in keys}
    for name in targets.names:
        row |= {f"{name}_{key}": advice["responses"][name][key] for key in ("mean", "error")}
    return row | advice["answer"]
