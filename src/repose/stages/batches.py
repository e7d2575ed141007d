"""Batches of a strategy as files: the runs so far are read, its samples are written."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.dataset_files import read_definitions
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Definitions, require_same_definitions
from repose.calibrate.runs import error_of, mean_and_error, of_bench
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.strategies import answer
from repose.calibrate.strategies.base import Answer, strategy
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import Path_, read_json, write_json, write_table
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import MeasureSettings
from repose.stages import validate
from repose.stages.tables import read_dataset, read_runs

PROPOSAL = "proposal.json"
KEYS = {"answer": bool, "why": str, "pours": int, "notes": dict}


def run_propose(
    name: str,
    study: Study,
    folders: Sequence[Path_],
    out_dir: Path_,
    *,
    definitions: Definitions,
    source: object = "configuration",
) -> dict[str, Any]:
    """Write the proposal of a strategy: samples.csv and proposal.json.

    Parameters
    ----------
    name : str
        Of the strategy.
    study : Study
        Its parameters, targets and settings.
    folders : sequence of path
        The batches so far, each with dataset.csv and runs.csv.
    out_dir : path
        Folder to write.
    definitions : mapping
        How the configuration defines the responses.
    source : object, optional
        File of the configuration, for an error.

    Returns
    -------
    dict
        The content of proposal.json.

    Raises
    ------
    InputError
        If the runs are of other definitions, or too few for the strategy.
    """
    for folder in folders:
        of_batch, path = read_definitions(Path(folder) / "dataset.csv")
        require_same_definitions(of_batch, path, expected=definitions, source=source)
    data = read(folders, study.targets)
    try:
        proposal = strategy(name).propose(study, data)
    except InputError as error:
        last = folders[-1] if folders else name
        raise InputError(last, error.key, error.value, error.allowed) from None
    content = {
        "answer": False,
        "why": proposal.notes.get("why", ""),
        "pours": len(data),
        "notes": proposal.notes,
    }
    if isinstance(proposal, Answer):
        content |= {"answer": True, "why": proposal.why}
        content |= answer.content(proposal, study.parameters, study.targets)
    write_table(Path(out_dir) / "samples.csv", proposal.samples)
    write_json(Path(out_dir) / PROPOSAL, _as_json(content))
    return content


def run_conclude(
    name: str,
    folders: Sequence[Path_],
    out_dir: Path_,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    measure: MeasureSettings | None,
) -> pd.DataFrame:
    """Write the answer of a strategy, simulated again, and the tables of all batches.

    Besides the files of `write_answer` these are batches.csv, a row for each proposal,
    dataset.csv and runs.csv of all batches, and the notes that `Strategy.files` names.

    Parameters
    ----------
    name : str
        Of the strategy.
    folders : sequence of path
        All batches, that of the answer last.
    out_dir : path
        Folder to write.
    parameters : ParameterSpace
    targets : Targets
    measure : MeasureSettings or None
        The section `measure`, which defines the angles of piles.

    Returns
    -------
    pandas.DataFrame
        The content of check.csv.
    """
    if len(folders) < 2:
        words = "the folders of all batches, that of the answer last"
        raise InputError(folders[0], "batches", 1, words)
    proposals = []
    for folder in folders[1:]:
        path = Path(folder) / PROPOSAL
        proposals.append(read_json(path, KEYS, "output of repose stage propose"))
    last = proposals[-1]
    if not last["answer"]:
        path = Path(folders[-1]) / PROPOSAL
        raise InputError(path, "answer", False, "true in the last folder")
    dataset, runs = tables_of(folders[:-1], targets)
    # Runs of the last batch may be runs of the answer already.
    checked = runs[runs["sample"].isin(last["simulated"])]
    if checked.empty:
        _, checked = tables_of(folders[-1:], targets)
    out = Path(out_dir)
    check = write_answer(
        last, checked, out, parameters=parameters, targets=targets, measure=measure
    )
    write_table(out / "batches.csv", _batches(proposals))
    write_table(out / "dataset.csv", dataset)
    write_table(out / "runs.csv", runs)
    for file in strategy(name).files:
        note = last["notes"][Path(file).stem]
        if file.endswith(".csv"):
            write_table(out / file, pd.DataFrame(note))
        else:
            write_json(out / file, note)
    return check


def write_answer(
    proposal: Mapping[str, Any],
    checked: pd.DataFrame,
    out_dir: Path_,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    measure: MeasureSettings | None,
) -> pd.DataFrame:
    """Write an answer in the files that card, final message and report read.

    These are solutions.csv, table4.csv, representative.csv, check.csv and summary.json.

    Parameters
    ----------
    proposal : mapping
        Content of proposal.json.
    checked : pandas.DataFrame
        Single runs of the answer.
    out_dir, parameters, targets, measure
        As in `run_conclude`.

    Returns
    -------
    pandas.DataFrame
        The content of check.csv.
    """
    out = Path(out_dir)
    notes = proposal["notes"]
    pours = len(checked) // len(targets.apparatus)
    solutions = pd.DataFrame(proposal["solutions"])
    columns = [*parameters.names, *targets.predicted]
    best = solutions.loc[0, columns].astype(float).to_dict()
    row = {
        "sample": 1,
        "solution": "1",
        "role": "representative",
        **best,
        **_optimism(notes.get("optimism", ()), targets),
        **_summarise_runs(checked, targets),
    }
    if "check" in notes:
        check = pd.DataFrame(notes["check"])
    else:
        check = _check(row, proposal["predicted_error"], targets)
    summary = {name: proposal[name] for name in ("feasible", "message", "why", "pours")}
    summary |= {"representative": best, "check_pours": pours}
    summary["near_bounds"] = proposal.get("near_bounds", [])
    summary |= notes.get("summary", {})
    step = f"Check: {pours} pours of the answer that were in no fit."
    summary["steps"] = [*notes.get("steps", ()), step]
    runs = {
        bench: of_bench(checked, bench).to_dict("records")
        for bench in targets.apparatus
    }
    table4 = validate.table4(pd.DataFrame([row]), targets.responses, measure)
    physical = validate.against_physical(pd.Series(row), targets, measure)
    representative = validate.with_chances(physical, runs, targets)
    write_table(out / "solutions.csv", solutions)
    write_table(out / "table4.csv", table4)
    write_table(out / "representative.csv", representative)
    write_table(out / "check.csv", check)
    write_json(out / "summary.json", summary)
    return check


def _check(
    row: Mapping[str, Any], errors: Sequence[float], targets: Targets
) -> pd.DataFrame:
    """Compare the answer as predicted and as simulated, a row for each response."""
    table = pd.DataFrame({"response": targets.names, "target": targets.aim})
    table["predicted"] = [row[name] for name in targets.predicted]
    table["predicted_error"] = list(errors)
    table["simulated"] = [row[target.response.simulated] for target in targets]
    table["simulated_error"] = [row[name] for name in targets.errors]
    table["deviation_percent"] = [
        target.off_percent(mean)
        for target, mean in zip(targets, table["simulated"], strict=True)
    ]
    return table


def _optimism(rows: Sequence[Mapping[str, Any]], targets: Targets) -> dict[str, float]:
    """Name the expected optimism of the answer's prediction as Table 4 does."""
    columns = {}
    for target in targets:
        for row in rows:
            if row["response"] == target.name:
                columns[target.response.optimism] = row["optimism"]
                columns[target.response.optimism_error] = row["optimism_se"]
    return columns


def _summarise_runs(runs: pd.DataFrame, targets: Targets) -> dict[str, Any]:
    """Compute means, standard errors and number of the answer's runs, as in Table 4."""
    good = runs[runs["status"] == "ok"]
    row: dict[str, Any] = {}
    counts = []
    for target in targets:
        response = target.response
        values = of_bench(good, response.apparatus)[target.name].to_numpy(float)
        mean, error = np.array(mean_and_error(values), dtype=float)
        row[response.simulated] = mean
        row[response.error] = error
        counts.append(len(values))
    piles = of_bench(good, UNNAMED)
    for name in MEAN_KEYS.values():
        if name in piles:
            values = piles[name].dropna().to_numpy(float)
            row[name], row[error_of(name)] = mean_and_error(values)
    failures = runs.loc[runs["status"] != "ok", "status"].value_counts()
    reasons = [f"{number} runs {status}" for status, number in failures.items()]
    row["n_seeds"] = min(counts)
    row["status"] = "ok" if min(counts) else failures.index[0]
    row["reason"] = ", ".join(reasons)
    return row


def _batches(proposals: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Make a row for each proposal: number and runs of the batches before it, and why.

    Where some proposals have a note `row`, the others are left out.
    """
    rows = []
    rows_with_note = []
    for batch, proposal in enumerate(proposals):
        notes = proposal["notes"]
        row = {"batch": batch, "pours": proposal["pours"], **notes.get("row", {})}
        row["why"] = proposal["why"]
        rows.append(row)
        if "row" in notes:
            rows_with_note.append(row)
    return pd.DataFrame(rows_with_note or rows)


def _as_json(value: Any) -> Any:
    """Make a note plain for JSON: a table becomes its columns, NaN becomes None."""
    if isinstance(value, pd.DataFrame):
        value = value.to_dict("list")
    if isinstance(value, Mapping):
        return {key: _as_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_as_json(item) for item in value]
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


def read(folders: Sequence[Path_], targets: Targets) -> pd.DataFrame:
    """Read the runs of all batches as a strategy takes them (`data_of`).

    A column `batch` has the number of the batch of each run.
    """
    parts: list[pd.DataFrame] = []
    known: set[int] = set()
    for number, folder in enumerate(folders):
        dataset, runs = tables_of([folder], targets)
        repeated = known.intersection(dataset["sample"])
        if repeated:
            path = Path(folder) / "dataset.csv"
            raise InputError(path, "sample", min(repeated), "in one batch alone")
        known.update(dataset["sample"])
        parts.append(data_of(dataset, runs, targets).assign(batch=number))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def tables_of(
    folders: Sequence[Path_], targets: Targets
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read the samples and the single runs of batches, each as one table."""
    samples = []
    runs = []
    for folder in folders:
        dataset_csv = Path(folder) / "dataset.csv"
        dataset = read_dataset(dataset_csv, targets)
        samples.append(dataset)
        runs_csv = Path(folder) / "runs.csv"
        runs.append(
            read_runs(runs_csv, targets, dataset=dataset, dataset_csv=dataset_csv)
        )
    return pd.concat(samples, ignore_index=True), pd.concat(runs, ignore_index=True)


def data_of(
    dataset: pd.DataFrame, runs: pd.DataFrame, targets: Targets
) -> pd.DataFrame:
    """Arrange runs as a strategy takes them.

    Bench tests have separate runs. The first good run of each makes the first row of a
    sample, and so on; these runs are independent, so any pairing is valid.

    Parameters
    ----------
    dataset : pandas.DataFrame
        The samples.
    runs : pandas.DataFrame
        Their runs, of all bench tests.
    targets : Targets

    Returns
    -------
    pandas.DataFrame
        A row for each run: sample, parameters, responses, which are NaN for a run that
        failed.
    """
    has_benches = "apparatus" in runs
    groups = ["sample", "apparatus"] if has_benches else ["sample"]
    runs_of_bench = runs.groupby(groups).size()
    n_runs = runs_of_bench.groupby("sample").max()
    n_runs = n_runs.reindex(dataset["sample"], fill_value=0).to_numpy()
    good = runs[runs["status"] == "ok"]
    row = pd.Index(dataset["sample"]).get_indexer(good["sample"])
    run_index = good.groupby(groups).cumcount().to_numpy()
    values = np.full((len(dataset), int(n_runs.max()), len(targets)), np.nan)
    for k, target in enumerate(targets):
        is_of_bench = np.ones(len(good), dtype=bool)
        if has_benches:
            is_of_bench = (good["apparatus"] == target.response.apparatus).to_numpy()
        numbers = good[target.name].to_numpy(float)
        values[row[is_of_bench], run_index[is_of_bench], k] = numbers[is_of_bench]
    is_run = np.arange(values.shape[1]) < n_runs[:, None]
    data = dataset.loc[dataset.index.repeat(n_runs)].reset_index(drop=True)
    data[list(targets.names)] = values[is_run]
    return data
