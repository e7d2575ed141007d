"""Read and write the batches of runs that a strategy asks for, as files."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.dataset_files import read_definitions
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Definitions, reject_other_definitions
from repose.calibrate.runs import mean_and_error, name_error_column, select_bench_runs
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.strategies import answer as answers
from repose.calibrate.strategies.base import Answer, Batch, strategy
from repose.calibrate.study import Study
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import StrPath, read_json, write_json, write_table
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import MeasureSettings
from repose.stages import validate
from repose.stages.tables import read_dataset, read_runs

PROPOSAL_FILE = "proposal.json"
PROPOSAL_KEYS = {"answer": bool, "why": str, "pours": int, "notes": dict}


def write_proposal(
    strategy_name: str,
    study: Study,
    folders: Sequence[StrPath],
    out_dir: StrPath,
    *,
    definitions: Definitions,
    parameter_names: Sequence[str] | None = None,
    source: object = "configuration",
) -> dict[str, Any]:
    """Let a strategy propose its next batch, and write the proposal.

    The file samples.csv has the runs to make. The file proposal.json has the reason for
    them and, once the strategy has finished, the answer.

    Parameters
    ----------
    strategy_name : str
        Name of the strategy.
    study : Study
        Parameters, targets and settings of the study.
    folders : sequence of path
        The batches so far, each with dataset.csv and runs.csv.
    out_dir : path
        Folder to write.
    definitions : mapping
        How the configuration defines the responses.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.
    source : object, optional
        File of the configuration, for error messages.

    Returns
    -------
    dict
        The content of proposal.json.

    Raises
    ------
    InputError
        If the runs were measured with other definitions, or are too few for the
        strategy.
    """
    for folder in folders:
        batch_definitions, path = read_definitions(Path(folder) / "dataset.csv")
        reject_other_definitions(
            batch_definitions, path, expected=definitions, source=source
        )
    runs = read_runs_of_batches(folders, study.targets, parameter_names)
    try:
        proposal = strategy(strategy_name).propose(study, runs)
    except InputError as error:
        # The strategy knows no files. Raise its error again with the folder of the last
        # batch as the source. Before the first batch, the strategy itself is the
        # source.
        fault_source = folders[-1] if folders else strategy_name
        raise InputError(
            fault_source, key=error.key, value=error.value, allowed=error.allowed
        ) from None

    content = _describe_proposal(proposal, len(runs), study)
    write_table(Path(out_dir) / "samples.csv", proposal.samples)
    write_json(Path(out_dir) / PROPOSAL_FILE, _convert_to_json(content))
    return content


def _describe_proposal(
    proposal: Batch | Answer, n_runs: int, study: Study
) -> dict[str, Any]:
    """Make the content of proposal.json.

    Parameters
    ----------
    proposal : Batch or Answer
        What the strategy proposed.
    n_runs : int
        Number of runs on which the proposal is based.
    study : Study
        Parameters and targets of the study.

    Returns
    -------
    dict
        Whether the proposal is the answer, the reason for it, the number of runs, and
        the notes of the strategy. An answer also has the parameter sets that it found.
    """
    content = {
        "answer": False,
        "why": proposal.notes.get("why", ""),
        "pours": n_runs,
        "notes": proposal.notes,
    }
    if isinstance(proposal, Answer):
        content |= {"answer": True, "why": proposal.why}
        content |= answers.describe_answer(proposal, study.parameters, study.targets)
    return content


def write_conclusion(
    strategy_name: str,
    folders: Sequence[StrPath],
    out_dir: StrPath,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    measure: MeasureSettings | None,
    parameter_names: Sequence[str] | None = None,
) -> pd.DataFrame:
    """Write the answer of a strategy, and the tables of all its batches.

    The files are those of `write_answer`; batches.csv, with a row for each proposal;
    dataset.csv and runs.csv, with the samples and runs of all batches; and a file for
    each note that `Strategy.files` names.

    Parameters
    ----------
    strategy_name : str
        Name of the strategy.
    folders : sequence of path
        The batches in order. The last one simulates the answer.
    out_dir : path
        Folder to write.
    parameters : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    measure : MeasureSettings or None
        The section `measure`, which defines the angles of piles.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    pandas.DataFrame
        The content of check.csv.

    Raises
    ------
    InputError
        If there is only one batch, or if the last batch is not that of the answer.
    """
    if len(folders) < 2:
        raise InputError(
            folders[0],
            key="batches",
            value=1,
            allowed="the folders of all batches, with that of the answer last",
        )
    proposals = _read_proposals(folders)
    answer_proposal = proposals[-1]

    # An earlier batch may already have simulated the answer. Otherwise the last batch
    # has done so.
    dataset, runs = read_tables(folders[:-1], targets, parameter_names)
    answer_runs = runs[runs["sample"].isin(answer_proposal["simulated"])]
    if answer_runs.empty:
        _, answer_runs = read_tables(folders[-1:], targets, parameter_names)

    out = Path(out_dir)
    check = write_answer(
        answer_proposal,
        answer_runs,
        out,
        parameters=parameters,
        targets=targets,
        measure=measure,
    )
    write_table(out / "batches.csv", _tabulate_batches(proposals))
    write_table(out / "dataset.csv", dataset)
    write_table(out / "runs.csv", runs)
    answers.write_notes(answer_proposal["notes"], strategy(strategy_name).files, out)
    return check


def _read_proposals(folders: Sequence[StrPath]) -> list[dict[str, Any]]:
    """Read the proposal of each batch except the first, in order.

    Raises
    ------
    InputError
        If the last proposal is not the answer.
    """
    paths = [Path(folder) / PROPOSAL_FILE for folder in folders[1:]]
    proposals = [
        read_json(path, PROPOSAL_KEYS, "output of repose stage propose")
        for path in paths
    ]
    if not proposals[-1]["answer"]:
        raise InputError(
            paths[-1], key="answer", value=False, allowed="true in the last folder"
        )
    return proposals


def write_answer(
    proposal: Mapping[str, Any],
    answer_runs: pd.DataFrame,
    out_dir: StrPath,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    measure: MeasureSettings | None,
) -> pd.DataFrame:
    """Write the answer of a strategy for the card, the final message and the report.

    The files are solutions.csv, table4.csv, representative.csv, check.csv and
    summary.json.

    Parameters
    ----------
    proposal : mapping
        Content of proposal.json.
    answer_runs : pandas.DataFrame
        Single runs with the parameters of the answer.
    out_dir, parameters, targets, measure
        As in `write_conclusion`.

    Returns
    -------
    pandas.DataFrame
        The content of check.csv.
    """
    notes = proposal["notes"]
    # The first solution is the answer.
    solutions = pd.DataFrame(proposal["solutions"])
    columns = [*parameters.names, *targets.predicted]
    answer = solutions.loc[0, columns].astype(float).to_dict()
    answer_row = {
        "sample": 1,
        "solution": "1",
        "role": "representative",
        **answer,
        **_make_optimism_cells(notes.get("optimism", ()), targets),
        **_summarise_runs(answer_runs, targets),
    }
    table4 = validate.make_table4(
        pd.DataFrame([answer_row]), targets.responses, measure, parameters.names
    )

    # Compare the simulation with the prediction, if the strategy has not done so.
    if "check" in notes:
        check = pd.DataFrame(notes["check"])
    else:
        predicted_errors = proposal["predicted_error"]
        check = _compare_with_prediction(answer_row, predicted_errors, targets)

    # Compare the simulation with the measurement.
    physical = validate.compare_with_measurement(
        pd.Series(answer_row), targets, measure
    )
    runs_by_bench_test = {
        bench_test: select_bench_runs(answer_runs, bench_test).to_dict("records")
        for bench_test in targets.apparatus
    }
    representative = validate.add_probabilities(physical, runs_by_bench_test, targets)

    # The answer has the same number of runs in each bench test.
    n_pours = len(answer_runs) // len(targets.apparatus)
    out = Path(out_dir)
    write_table(out / "solutions.csv", solutions)
    write_table(out / "table4.csv", table4)
    write_table(out / "representative.csv", representative)
    write_table(out / "check.csv", check)
    write_json(out / "summary.json", _make_summary(proposal, answer, n_pours))
    return check


def _make_summary(
    proposal: Mapping[str, Any], answer: Mapping[str, float], n_pours: int
) -> dict[str, Any]:
    """Make the content of summary.json.

    Parameters
    ----------
    proposal : mapping
        Content of proposal.json.
    answer : mapping
        Parameters and predicted responses of the answer, by name.
    n_pours : int
        Number of the answer's runs in each bench test.
    """
    notes = proposal["notes"]
    check_step = f"Check: {n_pours} pours of the answer that no fit has used."
    return {
        "feasible": proposal["feasible"],
        "message": proposal["message"],
        "why": proposal["why"],
        "pours": proposal["pours"],
        "representative": answer,
        "check_pours": n_pours,
        "near_bounds": proposal.get("near_bounds", []),
        **notes.get("summary", {}),
        "steps": [*notes.get("steps", ()), check_step],
    }


def _compare_with_prediction(
    answer_row: Mapping[str, Any], predicted_errors: Sequence[float], targets: Targets
) -> pd.DataFrame:
    """Compare the prediction of the answer with its simulation.

    Parameters
    ----------
    answer_row : mapping
        The answer's row of Table 4.
    predicted_errors : sequence of float
        Standard errors of the predictions, in the order of the targets.
    targets : Targets
        The targets of the study.

    Returns
    -------
    pandas.DataFrame
        A row for each response, which is the content of check.csv.
    """
    table = pd.DataFrame({"response": targets.names, "target": targets.aim})
    table["predicted"] = [answer_row[name] for name in targets.predicted]
    table["predicted_error"] = list(predicted_errors)
    table["simulated"] = [answer_row[target.response.simulated] for target in targets]
    table["simulated_error"] = [answer_row[name] for name in targets.errors]
    table["deviation_percent"] = [
        target.off_percent(mean)
        for target, mean in zip(targets, table["simulated"], strict=True)
    ]
    return table


def _make_optimism_cells(
    rows: Sequence[Mapping[str, Any]], targets: Targets
) -> dict[str, float]:
    """Make the cells of Table 4 with the expected optimism of the answer.

    Parameters
    ----------
    rows : sequence of mapping
        The strategy's note `optimism`, with a row for each response. A row has the name
        of the `response`, the `optimism` of its prediction, and `optimism_se`, the
        standard error of the optimism.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        Optimism and standard error by column of Table 4. Targets without a row are left
        out.
    """
    rows_by_response = {row["response"]: row for row in rows}
    cells = {}
    for target in targets:
        row = rows_by_response.get(target.name)
        if row is not None:
            cells[target.response.optimism] = row["optimism"]
            cells[target.response.optimism_error] = row["optimism_se"]
    return cells


def _summarise_runs(runs: pd.DataFrame, targets: Targets) -> dict[str, Any]:
    """Summarise the runs of the answer for its row of Table 4.

    Parameters
    ----------
    runs : pandas.DataFrame
        Single runs of the answer in all bench tests.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        Mean and standard error of each target, and of every other angle of a pile; the
        number of good runs; status and reason. Without a good run there is no mean, and
        with fewer than two there is no error. Such a value is NaN for a target and None
        for another angle.
    """
    is_good = runs["status"] == "ok"
    good_runs = runs[is_good]
    row: dict[str, Any] = {}
    n_good_runs = []
    for target in targets:
        response = target.response
        runs_of_response = select_bench_runs(good_runs, response.apparatus)
        values = runs_of_response[target.name].to_numpy(float)
        # The array turns None into NaN.
        mean, error = np.array(mean_and_error(values), dtype=float)
        row[response.simulated] = mean
        row[response.standard_error] = error
        n_good_runs.append(len(values))
    # The bench tests of the responses may have different numbers of good runs.
    n_fewest = min(n_good_runs)
    return (
        row
        | _average_angles(good_runs)
        | _summarise_statuses(runs.loc[~is_good, "status"], n_fewest)
    )


def _average_angles(good_runs: pd.DataFrame) -> dict[str, float | None]:
    """Average the angle of the piles by every definition.

    Parameters
    ----------
    good_runs : pandas.DataFrame
        Good runs in all bench tests. Those of another simulator may lack the angles.

    Returns
    -------
    dict
        The mean angles and their standard errors, by column of Table 4.
    """
    piles = select_bench_runs(good_runs, UNNAMED)
    means: dict[str, float | None] = {}
    for name in MEAN_KEYS.values():
        if name in piles:
            values = piles[name].dropna().to_numpy(float)
            means[name], means[name_error_column(name)] = mean_and_error(values)
    return means


def _summarise_statuses(failed_statuses: pd.Series, n_good: int) -> dict[str, Any]:
    """Summarise how the runs of the answer ended.

    Parameters
    ----------
    failed_statuses : pandas.Series
        The status of each run that failed.
    n_good : int
        Number of good runs.

    Returns
    -------
    dict
        `n_seeds`, the number of good runs; `status`, which is the most frequent failure
        if there is no good run; and `reason`, which counts the failures.
    """
    # The most frequent status comes first.
    failures = failed_statuses.value_counts()
    reasons = [f"{count} runs {status}" for status, count in failures.items()]
    return {
        "n_seeds": n_good,
        "status": "ok" if n_good else failures.index[0],
        "reason": ", ".join(reasons),
    }


def _tabulate_batches(proposals: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Make a table of the proposals of a strategy.

    Parameters
    ----------
    proposals : sequence of mapping
        Content of the files proposal.json, in order.

    Returns
    -------
    pandas.DataFrame
        A row for each proposal: the number of the batch, the number of runs before it,
        and the reason. Some strategies add a note `row` with further columns to some of
        their proposals. The table then has only the rows of these proposals.
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


def _convert_to_json(value: Any) -> Any:
    """Convert a note of a strategy to values that JSON can hold.

    A table becomes a mapping of its columns, and NaN becomes None. Mappings and lists
    are converted with all that they contain.
    """
    if isinstance(value, pd.DataFrame):
        return _convert_to_json(value.to_dict("list"))
    if isinstance(value, Mapping):
        return {key: _convert_to_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_convert_to_json(item) for item in value]
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


def read_runs_of_batches(
    folders: Sequence[StrPath],
    targets: Targets,
    parameter_names: Sequence[str] | None = None,
) -> pd.DataFrame:
    """Read the runs of all batches, and arrange them as a strategy expects.

    Parameters
    ----------
    folders : sequence of path
        The batches in order, each with dataset.csv and runs.csv.
    targets : Targets
        The targets of the study.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    pandas.DataFrame
        The rows of `arrange_for_strategy`, with the number of their batch in the column
        `batch`. It has no columns if there are no batches.

    Raises
    ------
    InputError
        If two batches have a sample of the same number.
    """
    batches: list[pd.DataFrame] = []
    earlier_samples: set[int] = set()
    for number, folder in enumerate(folders):
        dataset, runs = read_tables([folder], targets, parameter_names)
        repeated = earlier_samples.intersection(dataset["sample"])
        if repeated:
            path = Path(folder) / "dataset.csv"
            raise InputError(
                path, key="sample", value=min(repeated), allowed="in one batch only"
            )
        earlier_samples.update(dataset["sample"])
        batches.append(
            arrange_for_strategy(dataset, runs, targets).assign(batch=number)
        )
    if not batches:
        return pd.DataFrame()
    return pd.concat(batches, ignore_index=True)


def read_tables(
    folders: Sequence[StrPath],
    targets: Targets,
    parameter_names: Sequence[str] | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read the samples and the single runs of batches, each as one table.

    Parameters
    ----------
    folders : sequence of path
        The batches, each with dataset.csv and runs.csv.
    targets : Targets
        The targets of the study.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    pandas.DataFrame
        A row for each sample.
    pandas.DataFrame
        A row for each run.
    """
    datasets = []
    run_tables = []
    for folder in folders:
        dataset_csv = Path(folder) / "dataset.csv"
        runs_csv = Path(folder) / "runs.csv"
        dataset = read_dataset(dataset_csv, targets, parameter_names)
        runs = read_runs(runs_csv, targets, dataset=dataset, dataset_csv=dataset_csv)
        datasets.append(dataset)
        run_tables.append(runs)
    return (
        pd.concat(datasets, ignore_index=True),
        pd.concat(run_tables, ignore_index=True),
    )


def arrange_for_strategy(
    dataset: pd.DataFrame, runs: pd.DataFrame, targets: Targets
) -> pd.DataFrame:
    """Arrange single runs in the form that a strategy expects: all responses in a row.

    A run in one bench test gives only some of the responses. Therefore a row combines a
    run from each bench test. Row number k of a sample has its good run number k in each
    bench test, in the order of the table. Another pairing would be as valid, since all
    runs are independent.

    Parameters
    ----------
    dataset : pandas.DataFrame
        A row for each sample, with its parameters.
    runs : pandas.DataFrame
        A row for each run of these samples. With several bench tests, the column
        `apparatus` names that of the run.
    targets : Targets
        The targets of the study.

    Returns
    -------
    pandas.DataFrame
        Sample, parameters and responses. A sample has as many rows as it has runs in
        the bench test that ran it most often. A response is NaN where a bench test has
        fewer good runs of the sample than there are rows.
    """
    sample_and_bench_test = ["sample"]
    if "apparatus" in runs:
        sample_and_bench_test.append("apparatus")

    # Repeat each sample, and number its rows from 0.
    n_runs = runs.groupby(sample_and_bench_test).size()
    n_rows = n_runs.groupby("sample").max()
    # A sample without any run has no row.
    repeats = n_rows.reindex(dataset["sample"], fill_value=0).to_numpy()
    arranged = dataset.loc[dataset.index.repeat(repeats)].reset_index(drop=True)
    row_numbers = arranged.groupby("sample").cumcount()
    row_keys = pd.MultiIndex.from_arrays([arranged["sample"], row_numbers])

    # Number the good runs of each sample in each bench test from 0, and put each run
    # into the row of the same number.
    good_runs = runs[runs["status"] == "ok"]
    run_numbers = good_runs.groupby(sample_and_bench_test).cumcount()
    good_runs = good_runs.assign(run_number=run_numbers)
    for target in targets:
        runs_of_response = select_bench_runs(good_runs, target.response.apparatus)
        values = runs_of_response.set_index(["sample", "run_number"])[target.name]
        arranged[target.name] = values.reindex(row_keys).to_numpy(float)
    return arranged
