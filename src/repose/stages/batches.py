"""Batches of a strategy on files: the runs so far are read, the samples that it proposes after them are written."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.responses import require_same_definitions
from repose.calibrate.strategies import answer
from repose.calibrate.strategies.base import Answer, Studied, strategy
from repose.calibrate.targets import Targets
from repose.common.errors import InputError, require
from repose.common.files import Path_, read_json, write_json, write_table
from repose.stages.dataset import read_definitions
from repose.stages.tables import read_dataset, read_runs

PROPOSAL = "proposal.json"


def run_propose(
    name: str,
    study: Studied,
    folders: Sequence[Path_],
    out_dir: Path_,
    source: object = "configuration",
) -> dict[str, Any]:
    """Write the strategy's proposal after the batches in `folders`: samples.csv and proposal.json; return the latter.

    InputError, with `source`, for runs of other definitions.
    """
    for folder in folders:
        own, path = read_definitions(Path(folder) / "dataset.csv")
        require_same_definitions(own, path, study.definitions, source)
    data = read(folders, study.targets)
    try:
        proposal = strategy(name).propose(study, data)
    except InputError as error:
        raise InputError(
            folders[-1] if folders else name, error.key, error.value, error.allowed
        ) from None
    found = {
        "answer": False,
        "why": proposal.notes.get("why", ""),
        "pours": len(data),
        "notes": proposal.notes,
    }
    if isinstance(proposal, Answer):
        found |= {
            "answer": True,
            "why": proposal.why,
            **answer.content(proposal, study),
        }
    write_table(Path(out_dir) / "samples.csv", proposal.samples)
    write_json(Path(out_dir) / PROPOSAL, _plain(found))
    return found


def run_conclude(
    name: str, study: Studied, folders: Sequence[Path_], out_dir: Path_
) -> pd.DataFrame:
    """Write the answer, simulated again, and the tables of all batches; return the table of check.csv.

    `folders` hold all batches, the one of the answer last. Besides the files of `answer.write` these are batches.csv, a
    row for each proposal, dataset.csv and runs.csv of all batches, and the notes that `Strategy.files` names.
    """
    files, out = strategy(name).files, Path(out_dir)
    require(
        len(folders) >= 2,
        folders[0],
        "batches",
        1,
        "the folders of all batches, that of the answer last",
    )
    keys = {"answer": bool, "why": str, "pours": int, "notes": dict}
    written = "output of repose stage propose"
    proposals = [
        read_json(Path(folder) / PROPOSAL, keys, written) for folder in folders[1:]
    ]
    found = proposals[-1]
    require(
        found["answer"],
        Path(folders[-1]) / PROPOSAL,
        "answer",
        False,
        "true in the last folder",
    )
    dataset, runs = tables_of(folders[:-1], study.targets)
    simulated = runs["sample"].isin(found["simulated"])
    checked = (
        runs[simulated]
        if simulated.any()
        else tables_of(folders[-1:], study.targets)[1]
    )
    check = answer.write(found, checked, study, out)
    tables = {
        "batches.csv": _batches(proposals),
        "dataset.csv": dataset,
        "runs.csv": runs,
    }
    for file, content in {
        **tables,
        **{file: found["notes"][Path(file).stem] for file in files},
    }.items():
        if file.endswith(".csv"):
            write_table(out / file, pd.DataFrame(content))
        else:
            write_json(out / file, content)
    return check


def _batches(proposals: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Make a row for each proposal: number and pours of the batches before it, its note `row`, and why.

    Where some have that note, the others are left out.
    """
    rows = [
        {
            "batch": batch,
            "pours": found["pours"],
            **found["notes"].get("row", {}),
            "why": found["why"],
        }
        for batch, found in enumerate(proposals)
    ]
    return pd.DataFrame(
        [
            rows[batch]
            for batch, found in enumerate(proposals)
            if "row" in found["notes"]
        ]
        or rows
    )


def _plain(value: Any) -> Any:
    """Make a note plain for JSON: a table becomes its columns, NaN becomes None."""
    if isinstance(value, pd.DataFrame):
        value = value.to_dict("list")
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def read(folders: Sequence[Path_], targets: Targets) -> pd.DataFrame:
    """Read the runs of all batches as a strategy takes them (`data_of`), each with the number of its batch."""
    parts: list[pd.DataFrame] = []
    seen: set[int] = set()
    for number, folder in enumerate(folders):
        dataset, runs = tables_of([folder], targets)
        again = seen.intersection(dataset["sample"])
        if again:
            raise InputError(
                Path(folder) / "dataset.csv", "sample", min(again), "in one batch alone"
            )
        seen.update(dataset["sample"])
        parts.append(data_of(dataset, runs, targets).assign(batch=number))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def tables_of(
    folders: Sequence[Path_], targets: Targets
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read samples and single runs of batches."""
    tables = []
    for folder in folders:
        dataset_csv, runs_csv = Path(folder) / "dataset.csv", Path(folder) / "runs.csv"
        dataset = read_dataset(dataset_csv, targets)
        tables.append((dataset, read_runs(runs_csv, targets, dataset, dataset_csv)))
    dataset, runs = (
        pd.concat(parts, ignore_index=True) for parts in zip(*tables, strict=True)
    )
    return dataset, runs


def data_of(
    dataset: pd.DataFrame, runs: pd.DataFrame, targets: Targets
) -> pd.DataFrame:
    """Arrange the pours as a strategy takes them, a row each: sample, parameters, responses, NaN for a failed run.

    Bench tests have separate runs. The first ok run of each makes the first pour of the sample, and so on; these runs
    are independent, so any pairing is valid.
    """
    several = "apparatus" in runs
    groups = ["sample", "apparatus"] if several else ["sample"]
    most = (
        runs.groupby(groups)
        .size()
        .groupby("sample")
        .max()
        .reindex(dataset["sample"], fill_value=0)
    )
    row = pd.Index(dataset["sample"]).get_indexer(runs["sample"])
    ok = (runs["status"] == "ok").to_numpy()
    place = runs[ok].groupby(groups).cumcount().to_numpy()
    values = np.full((len(dataset), int(most.max()), len(targets)), np.nan)
    for k, target in enumerate(targets):
        own = (
            (runs[ok]["apparatus"] == target.response.apparatus).to_numpy()
            if several
            else slice(None)
        )
        values[row[ok][own], place[own], k] = runs[ok][target.name].to_numpy(float)[own]
    poured = np.arange(values.shape[1]) < most.to_numpy()[:, None]
    data = dataset.loc[dataset.index.repeat(most.to_numpy())].reset_index(drop=True)
    data[list(targets.names)] = values[poured]
    return data
