"""Batches of a strategy on files: the runs so far are read, the samples that it proposes after them are written."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from repose.chain.tables import read_dataset, read_runs
from repose.core.errors import InputError
from repose.core.files import write_table
from repose.core.targets import Targets
from repose.strategies.base import Answer, Batch, Studied, strategy

Path_ = str | os.PathLike


def propose(name: str, study: Studied, folders: Sequence[Path_] = ()) -> Batch | Answer:
    """The strategy's proposal after the batches in `folders`; an InputError names the last of them."""
    data = read(folders, study.targets) if folders else pd.DataFrame()
    try:
        return strategy(name).propose(study, data)
    except InputError as error:
        raise InputError(folders[-1] if folders else name, error.key, error.value, error.allowed) from None


def write_samples(proposal: Batch | Answer, path: Path_) -> pd.DataFrame:
    """Write and return the samples of a proposal, without their seeds, which the section has."""
    table = proposal.samples.drop(columns="seeds")
    write_table(path, table)
    return table


def read(folders: Sequence[Path_], targets: Targets) -> pd.DataFrame:
    """The runs of all batches as a strategy takes them (`data_of`), each with the number of its batch."""
    data = pd.DataFrame()
    for number, folder in enumerate(folders):
        dataset, runs = tables_of([folder], targets)
        again = {*dataset["sample"]} & {*data.get("sample", ())}
        if again:
            raise InputError(Path(folder) / "dataset.csv", "sample", min(again), "in one batch alone")
        own = data_of(dataset, runs, targets).assign(batch=number)
        data = pd.concat([data, own], ignore_index=True) if number else own
    return data


def tables_of(folders: Sequence[Path_], targets: Targets) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Samples and single runs of batches."""
    tables = []
    for folder in folders:
        dataset_csv, runs_csv = Path(folder) / "dataset.csv", Path(folder) / "runs.csv"
        dataset = read_dataset(dataset_csv, targets)
        tables.append((dataset, read_runs(runs_csv, targets, dataset, dataset_csv)))
    dataset, runs = (pd.concat(parts, ignore_index=True) for parts in zip(*tables, strict=True))
    return dataset, runs


def data_of(dataset: pd.DataFrame, runs: pd.DataFrame, targets: Targets) -> pd.DataFrame:
    """The pours as a strategy takes them, a row for each: sample, parameters, responses, NaN for a failed run.

    Bench tests have separate runs. The first ok run of each makes the first pour of the sample, and so on; these runs
    are independent, so any pairing is valid.
    """
    several = "apparatus" in runs
    groups = ["sample", "apparatus"] if several else ["sample"]
    most = runs.groupby(groups).size().groupby("sample").max().reindex(dataset["sample"], fill_value=0)
    row = pd.Index(dataset["sample"]).get_indexer(runs["sample"])
    ok = (runs["status"] == "ok").to_numpy()
    place = runs[ok].groupby(groups).cumcount().to_numpy()
    values = np.full((len(dataset), int(most.max()), len(targets)), np.nan)
    for k, target in enumerate(targets):
        own = (runs[ok]["apparatus"] == target.response.apparatus).to_numpy() if several else slice(None)
        values[row[ok][own], place[own], k] = runs[ok][target.name].to_numpy(float)[own]
    poured = np.arange(values.shape[1]) < most.to_numpy()[:, None]
    data = dataset.loc[dataset.index.repeat(most.to_numpy())].reset_index(drop=True)
    data[list(targets.names)] = values[poured]
    return data
