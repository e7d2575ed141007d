"""Reading of a study's tables, with checks that they are whole, of one study, and consistent.

A truncated table, or a table beside the runs of another study, has all its columns; only its rows show the
fault.
"""

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS, check_value, named
from repose.calibrate.dataset_files import read_summary
from repose.calibrate.targets import Targets
from repose.common.errors import InputError, require
from repose.common.files import Path_, read_table

# Tolerance of a mean, or a standard error, against its runs: relative, and absolute below 1.
AGREEMENT = 1e-6


def read_dataset(dataset_csv: Path_, targets: Targets) -> pd.DataFrame:
    """Read the table of samples with its parameters, status, responses and errors."""
    dataset = read_table(
        dataset_csv,
        ("sample", *PARAMETERS, "status", "n_seeds", *targets.names, *targets.errors),
    )
    _check_count(dataset, dataset_csv, dataset_csv, "samples")
    _refuse_twice(dataset, ["sample"], dataset_csv)
    for row, values in enumerate(
        dataset[list(named(dataset))].to_dict("records"), start=1
    ):
        for name, value in values.items():
            check_value(name, value, f"{dataset_csv}, row {row}")
    _check_responses(dataset, targets, dataset_csv)
    return dataset


def read_runs(
    runs_csv: Path_, targets: Targets, dataset: pd.DataFrame, dataset_csv: Path_
) -> pd.DataFrame:
    """Read the table of single runs of a table of samples."""
    runs = read_table(runs_csv, ("sample", "seed", "status", *targets.names))
    several = ["apparatus"] if "apparatus" in runs else []
    _refuse_twice(runs, ["sample", "seed", *several], runs_csv)
    if not several:
        _check_responses(runs, targets, runs_csv)
    _check_count(runs, runs_csv, dataset_csv, "runs")
    unshared = sorted(set(runs["sample"]) ^ set(dataset["sample"]))
    if unshared:
        raise InputError(
            runs_csv,
            "sample",
            unshared[0],
            f"the samples of {dataset_csv}, all of them",
        )
    if not several:
        _check_means(runs, dataset, targets, runs_csv, dataset_csv)
    return runs


def _check_means(
    runs: pd.DataFrame,
    dataset: pd.DataFrame,
    targets: Targets,
    runs_csv: object,
    dataset_csv: object,
) -> None:
    """Raise unless numbers, means and standard errors of the runs agree with the samples."""
    ok = runs[runs["status"] == "ok"].groupby("sample")
    count = ok.size().reindex(dataset["sample"], fill_value=0)
    for sample, n, n_seeds in zip(
        dataset["sample"], count, dataset["n_seeds"], strict=True
    ):
        allowed = f"{n_seeds:g}, the n_seeds of this sample in {dataset_csv}"
        require(
            n == n_seeds, f"{runs_csv}, sample {sample}", "ok runs", int(n), allowed
        )
    usable = dataset[dataset["status"] == "ok"].set_index("sample")
    responses = ok[list(targets.names)]
    quantities = {
        "mean": (targets.names, responses.mean()),
        "standard error": (targets.errors, responses.sem()),
    }
    for quantity, (columns, of_runs) in quantities.items():
        computed = of_runs.reindex(usable.index)
        for name, column in zip(targets.names, columns, strict=True):
            found, stated = computed[name].astype(float), usable[column].astype(float)
            unlike = ~np.isclose(
                found, stated, rtol=AGREEMENT, atol=AGREEMENT, equal_nan=True
            )
            for sample in usable.index[unlike][:1]:
                allowed = f"{stated[sample]:.6g}, its {quantity} in {dataset_csv}"
                raise InputError(
                    f"{runs_csv}, sample {sample}",
                    f"{quantity} of {name}",
                    float(found[sample]),
                    allowed,
                )


def _check_responses(table: pd.DataFrame, targets: Targets, path: object) -> None:
    """Raise if an ok row lacks a response, or has one beyond the response's limits."""
    ok = table["status"] == "ok"
    for target in targets:
        name, low, high = target.name, target.response.low, target.response.high
        wrong = ok & ~table[name].between(low, high)
        if wrong.any():
            row = int(wrong.to_numpy().argmax())
            allowed = f"a number from {low:g} to {high:g}, as the status is ok"
            raise InputError(
                f"{path}, row {row + 1}", name, float(table[name].iloc[row]), allowed
            )


def _refuse_twice(table: pd.DataFrame, columns: list[str], path: object) -> None:
    """Raise if rows are there twice, by these columns."""
    twice = table[columns].duplicated().to_numpy()
    if twice.any():
        row = int(twice.argmax())
        value = table[columns].iloc[row].tolist()
        raise InputError(
            f"{path}, row {row + 1}", " and ".join(columns), value, "each once"
        )


def _check_count(
    table: pd.DataFrame, path: object, dataset_csv: Path_, key: str
) -> None:
    """Raise if the number of rows differs from the dataset's summary."""
    summary, summary_json = read_summary(dataset_csv)
    if key in summary and len(table) != summary[key]:
        raise InputError(
            path, "rows", len(table), f"{summary[key]}, the {key} of {summary_json}"
        )
