"""Reading of the tables of a study, with checks that they are complete and consistent.

A truncated table, or one beside the runs of another study, has all its columns; only its
rows show the fault.
"""

import numpy as np
import pandas as pd

from repose.bench.parameters import PARAMETERS, check_value, parameters_among
from repose.calibrate.dataset_files import read_summary
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import Path_, read_table

# Tolerance of a mean, or a standard error, against its runs: relative, and absolute below 1.
AGREEMENT = 1e-6


def read_dataset(dataset_csv: Path_, targets: Targets) -> pd.DataFrame:
    """Read the table of samples with its parameters, status, responses and errors."""
    dataset = read_table(
        dataset_csv,
        ("sample", *PARAMETERS, "status", "n_seeds", *targets.names, *targets.errors),
    )
    _check_count(dataset, dataset_csv, dataset_csv=dataset_csv, key="samples")
    _refuse_repeated_rows(dataset, ["sample"], dataset_csv)
    sets = dataset[list(parameters_among(dataset))].to_dict("records")
    for row, values in enumerate(sets, start=1):
        for name, value in values.items():
            check_value(name, value, f"{dataset_csv}, row {row}")
    _check_responses(dataset, targets, dataset_csv)
    return dataset


def read_runs(
    runs_csv: Path_, targets: Targets, dataset: pd.DataFrame, dataset_csv: Path_
) -> pd.DataFrame:
    """Read the table of single runs of a table of samples."""
    runs = read_table(runs_csv, ("sample", "seed", "status", *targets.names))
    # With several bench tests a run has the responses of its own bench test alone.
    has_benches = "apparatus" in runs
    key = ["sample", "seed", "apparatus"] if has_benches else ["sample", "seed"]
    _refuse_repeated_rows(runs, key, runs_csv)
    if not has_benches:
        _check_responses(runs, targets, runs_csv)
    _check_count(runs, runs_csv, dataset_csv=dataset_csv, key="runs")
    in_one_table = set(runs["sample"]).symmetric_difference(dataset["sample"])
    if in_one_table:
        words = f"the samples of {dataset_csv}, all of them"
        raise InputError(runs_csv, "sample", min(in_one_table), words)
    if not has_benches:
        _check_means(
            runs, dataset, targets=targets, runs_csv=runs_csv, dataset_csv=dataset_csv
        )
    return runs


def _check_means(
    runs: pd.DataFrame,
    dataset: pd.DataFrame,
    targets: Targets,
    runs_csv: object,
    dataset_csv: object,
) -> None:
    """Refuse runs whose numbers, means and standard errors are not those of the samples."""
    good = runs[runs["status"] == "ok"].groupby("sample")
    counts = good.size().reindex(dataset["sample"], fill_value=0)
    for sample, count, n_seeds in zip(
        dataset["sample"], counts, dataset["n_seeds"], strict=True
    ):
        if count != n_seeds:
            words = f"{n_seeds:g}, the n_seeds of this sample in {dataset_csv}"
            source = f"{runs_csv}, sample {sample}"
            raise InputError(source, "ok runs", int(count), words)

    usable = dataset[dataset["status"] == "ok"].set_index("sample")
    responses = good[list(targets.names)]
    quantities = {
        "mean": (targets.names, responses.mean()),
        "standard error": (targets.errors, responses.sem()),
    }
    for quantity, (columns, table) in quantities.items():
        table_of_usable = table.reindex(usable.index)
        for name, column in zip(targets.names, columns, strict=True):
            of_runs = table_of_usable[name].astype(float)
            of_samples = usable[column].astype(float)
            is_equal = np.isclose(
                of_runs, of_samples, rtol=AGREEMENT, atol=AGREEMENT, equal_nan=True
            )
            if is_equal.all():
                continue
            sample = usable.index[~is_equal][0]
            words = f"{of_samples[sample]:.6g}, its {quantity} in {dataset_csv}"
            raise InputError(
                f"{runs_csv}, sample {sample}",
                f"{quantity} of {name}",
                float(of_runs[sample]),
                words,
            )


def _check_responses(table: pd.DataFrame, targets: Targets, path: object) -> None:
    """Refuse a good row that lacks a response, or has one beyond its limits."""
    is_ok = table["status"] == "ok"
    for target in targets:
        name = target.name
        low = target.response.low
        high = target.response.high
        is_wrong = is_ok & ~table[name].between(low, high)
        if is_wrong.any():
            row = int(is_wrong.to_numpy().argmax())
            value = float(table[name].iloc[row])
            words = f"a number from {low:g} to {high:g}, as the status is ok"
            raise InputError(f"{path}, row {row + 1}", name, value, words)


def _refuse_repeated_rows(
    table: pd.DataFrame, columns: list[str], path: object
) -> None:
    """Refuse rows with the same values in these columns."""
    is_repeated = table[columns].duplicated().to_numpy()
    if is_repeated.any():
        row = int(is_repeated.argmax())
        value = table[columns].iloc[row].tolist()
        key = " and ".join(columns)
        raise InputError(f"{path}, row {row + 1}", key, value, "each once")


def _check_count(
    table: pd.DataFrame, path: object, dataset_csv: Path_, key: str
) -> None:
    """Refuse another number of rows than the summary of the dataset has."""
    summary, summary_json = read_summary(dataset_csv)
    if key in summary and len(table) != summary[key]:
        words = f"{summary[key]}, the {key} of {summary_json}"
        raise InputError(path, "rows", len(table), words)
