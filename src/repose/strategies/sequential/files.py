"""The sequential strategy on files: each batch reads the results of all batches before it."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.chain.tables import read_dataset
from repose.core.files import read_json, read_table, write_json, write_table
from repose.strategies import answer
from repose.strategies.base import Studied
from repose.strategies.batches import propose, read, tables_of, write_samples
from repose.strategies.sequential import strategy

Path_ = str | os.PathLike


def run_start(study: Studied, out_csv: Path_) -> pd.DataFrame:
    """Write the samples of the start; return them (`sample` from 1, and the parameters)."""
    return write_samples(propose("sequential", study), out_csv)


def run_batch(folders: Sequence[Path_], study: Studied, out_dir: Path_) -> dict[str, Any]:
    """Write the advice after the batches in `folders`, the start first, advice.json and next.csv; return the former.

    next.csv has the samples of the next batch, or, at the end, the answer as a single sample. `in_reach` is the
    probability that any set meets the targets, `nearest` the least deviation of any set (Eq. 11).
    """
    proposal = propose("sequential", study, folders)
    content = {"batch": len(folders) - 1, **proposal.notes}
    write_samples(proposal, Path(out_dir) / "next.csv")
    write_json(Path(out_dir) / "advice.json", content)
    return content


def run_check(
    folders: Sequence[Path_],
    dataset_csv: Path_,
    runs_csv: Path_,
    study: Studied,
    out_dir: Path_,
) -> pd.DataFrame:
    """Write the course of the batches, and the answer as simulated again in `dataset_csv` and `runs_csv`.

    Returns the table of check.csv. The other files are batches.csv, dataset.csv and runs.csv of all batches, and those
    of `repose.strategies.answer.write`.
    """
    targets = study.targets
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
        read_json(Path(folder) / "advice.json", keys, "output of repose stage sequential_batch")
        for folder in folders
    ]
    batches, last = pd.DataFrame([_row(advice, targets) for advice in advices]), advices[-1]
    dataset, runs = tables_of(folders, targets)
    checked = read_table(runs_csv, ("sample", "status", *targets.names))
    check = _check(last, read_dataset(dataset_csv, targets), targets)
    out = Path(out_dir)
    for name, table in {"batches": batches, "check": check, "dataset": dataset, "runs": runs}.items():
        write_table(out / f"{name}.csv", table)
    details = {
        key: last[key]
        for key in ("answer", "probability", "stop", "why", "pours", "needed", "in_reach", "nearest")
    }
    details |= {
        "tolerance_percent": study.config["sequential"]["tolerance_percent"],
        "check_pours": _pours(checked, targets),
    }
    best = strategy.answer(
        study, read(folders, targets)
    )  # with other sets that the same model predicts inside the ranges
    best = replace(
        best,
        values=np.array([last["answer"][name] for name in study.parameters.names]),
        mean=np.array([last["responses"][name]["mean"] for name in targets.names]),
    )
    note = _out_of_reach(last, targets) if last["stop"] == "out_of_reach" else ""
    answer.write(best, checked, study, out, _steps(last, study, details), details, note)
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
                "deviation_percent": target.off_percent(mean),
            }
        )
    return pd.DataFrame(rows)


def _steps(last, study, details):
    """The way to the answer, in sentences."""
    section = study.config["sequential"]
    return (
        f"Start: {section['start_samples']} parameter sets all over the ranges, each poured {section['seeds']} times.",
        f"Batches: {last['batch']}, each about the best point so far; {details['pours']} pours in all. "
        f"They stopped: {details['why']}.",
        f"Model: kriging of the samples' means with their known errors. The answer lies within "
        f"{section['tolerance_percent']:g} % of all targets with probability {last['probability']:.2f}.",
        f"Check: the answer was poured {details['check_pours']} more times.",
    )


def _out_of_reach(last, targets):
    """How near the answer comes, a sentence."""
    off = []
    for target in targets:
        predicted = last["responses"][target.name]
        percent = [
            100 * value / target.whole for value in (predicted["mean"] - target.aim, predicted["error"])
        ]
        off.append(f"{percent[0]:+.1f} ± {abs(percent[1]):.1f} % off the target of {target.response.symbol}")
    return (
        "The targets are probably out of reach: some parameter set meets them with probability "
        f"{last['in_reach']:.2f}. "
        f"The answer is the nearest: {', '.join(off)}."
    )


def _pours(runs, targets):
    """Pours of a bench test, failed ones included; all bench tests of the targets have as many."""
    return len(runs) // len(targets.apparatus)


def _row(advice, targets):
    """A batch as a row of batches.csv."""
    keys: tuple[str, ...] = ("batch", "pours", "probability", "reachable", "in_reach", "needed", "stop")
    row = {key: advice[key] for key in keys}
    for name in targets.names:
        row |= {f"{name}_{key}": advice["responses"][name][key] for key in ("mean", "error")}
    return row | advice["answer"]
