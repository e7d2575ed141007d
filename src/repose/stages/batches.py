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
    """Let a strategy propose its next batch of runs, and write the proposal.

    The file samples.csv has the parameter sets to simulate. The file proposal.json has
    the reason for them and, once the strategy has finished, the answer.

    Parameters
    ----------
    strategy_name : str
        Name of the strategy.
    study : Study
        Parameters, targets and settings of the study.
    folders : sequence of path
        The batches so far, each with dataset.csv and runs.csv.
    out_dir : path
        Folder for samples.csv and proposal.json.
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
        # A strategy gets tables and knows no files, so its error cannot name a file.
        # Raise the error again with the folder of the last batch as the source. Before
        # the first batch there is no folder, and the name of the strategy takes its
        # place.
        error_source = folders[-1] if folders else strategy_name
        raise InputError(
            error_source, key=error.key, value=error.value, allowed=error.allowed
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

    The answer is the parameter set with which the strategy finished. Its files are
    those of `write_answer`. The file batches.csv has a row for each proposal. The files
    dataset.csv and runs.csv have the samples and runs of all batches but the last one,
    which is that of the answer. Each note that `Strategy.files` names has a file, too.

    Parameters
    ----------
    strategy_name : str
        Name of the strategy.
    folders : sequence of path
        The folders of the batches in order, at least two. The last one is that of the
        answer.
    out_dir : path
        Folder for all these files.
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
    # The first batch has no proposal, so even the shortest study has two batches.
    if len(folders) < 2:
        raise InputError(
            folders[0],
            key="batches",
            value=1,
            allowed="the folders of all batches, with that of the answer last",
        )
    proposals = _read_proposals(folders)
    answer_proposal = proposals[-1]

    # The answer may be a sample of an earlier batch. Its runs are then those of this
    # sample, whose numbers the proposal lists under `simulated`. Otherwise the last
    # batch has simulated the answer.
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
    """Write the answer of a strategy, in the files from which other stages read it.

    The file solutions.csv has all parameter sets that the strategy found. The file
    table4.csv has the predicted and the simulated responses of the answer. The answer
    is compared with the measurement in representative.csv, and with its prediction in
    check.csv. The file summary.json has the answer and how it was found.

    Parameters
    ----------
    proposal : mapping
        Content of proposal.json.
    answer_runs : pandas.DataFrame
        Single runs with the parameters of the answer, equally many in each bench test.
    out_dir : path
        Folder for the files.
    parameters : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    measure : MeasureSettings or None
        The section `measure`, which defines the angles of piles.

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
    # A strategy simulates only one solution again, so it is both sample 1 and
    # solution "1" of the table. The role marks it as the answer for `find_answer`.
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

    # The answer has the same number of runs in each bench test, so this is exact.
    n_runs_of_bench_test = len(answer_runs) // len(targets.apparatus)
    out = Path(out_dir)
    write_table(out / "solutions.csv", solutions)
    write_table(out / "table4.csv", table4)
    write_table(out / "representative.csv", representative)
    write_table(out / "check.csv", check)
    write_json(
        out / "summary.json", _make_summary(proposal, answer, n_runs_of_bench_test)
    )
    return check


def _make_summary(
    proposal: Mapping[str, Any], answer: Mapping[str, float], n_check_runs: int
) -> dict[str, Any]:
    """Make the content of summary.json.

    Parameters
    ----------
    proposal : mapping
        Content of proposal.json.
    answer : mapping
        Parameters and predicted responses of the answer, by name.
    n_check_runs : int
        Number of the answer's runs in each bench test.
    """
    notes = proposal["notes"]
    check_step = f"Check: {n_check_runs} pours of the answer that no fit has used."
    return {
        "feasible": proposal["feasible"],
        "message": proposal["message"],
        "why": proposal["why"],
        "pours": proposal["pours"],
        "representative": answer,
        "check_pours": n_check_runs,
        "near_bounds": proposal.get("near_bounds", []),
        **notes.get("summary", {}),
        "steps": [*notes.get("steps", ()), check_step],
    }


def _compare_with_prediction(
    answer_row: Mapping[str, Any], predicted_errors: Sequence[float], targets: Targets
) -> pd.DataFrame:
    """Compare the predicted responses of the answer with the simulated ones.

    Parameters
    ----------
    answer_row : mapping
        The answer's row of table4.csv, with predicted and simulated responses.
    predicted_errors : sequence of float
        Standard errors of the predictions, in the order of the targets.
    targets : Targets
        The targets of the study.

    Returns
    -------
    pandas.DataFrame
        The content of check.csv: a row for each target with the value to aim at, the
        predicted and the simulated mean with their standard errors, and the deviation
        of the simulated mean from the target.
    """
    table = pd.DataFrame({"response": targets.names, "target": targets.aim})
    # Targets and responses know the names of their columns in the row.
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
    """Make the cells of table4.csv that state the expected optimism of the answer.

    The optimism of a prediction is its bias. The search chose the answer because of its
    favourable predictions, so they are too favourable on average.

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
        Optimism and standard error by column of table4.csv. Targets without a row are
        left out.
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
    """Summarise the runs of the answer for its row of table4.csv.

    Parameters
    ----------
    runs : pandas.DataFrame
        Single runs of the answer in all bench tests.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        The cells by column: mean and standard error of each target; those of the angle
        of a pile by every definition; `n_seeds`, `status` and `reason` as in
        `_summarise_statuses`. Without a good run there is no mean. With fewer than two
        there is no standard error. A missing value of a target is NaN. A missing value
        of another angle is None.
    """
    is_good = runs["status"] == "ok"
    good_runs = runs[is_good]
    row: dict[str, Any] = {}
    n_good_runs = []
    for target in targets:
        response = target.response
        runs_of_response = select_bench_runs(good_runs, response.apparatus)
        values = runs_of_response[target.name].to_numpy(float)
        # Mean and standard error are None if they cannot be computed. An array of
        # floats turns None into NaN, as the columns of targets require.
        mean, standard_error = np.array(mean_and_error(values), dtype=float)
        row[response.simulated] = mean
        row[response.standard_error] = standard_error
        n_good_runs.append(len(values))
    # The bench tests may have different numbers of good runs. The row has one number
    # for all of them, so state the smallest one.
    min_good_runs = min(n_good_runs)
    return (
        row
        | _average_angles(good_runs)
        | _summarise_statuses(runs.loc[~is_good, "status"], min_good_runs)
    )


def _average_angles(good_runs: pd.DataFrame) -> dict[str, float | None]:
    """Average the angle of repose of the piles, separately for each definition of it.

    Parameters
    ----------
    good_runs : pandas.DataFrame
        Good runs in all bench tests. If another program made the runs, they may lack
        the angles, which are then left out.

    Returns
    -------
    dict
        The mean angles and their standard errors, by column of table4.csv.
    """
    # `UNNAMED` is the name of the funnel, the bench test that makes the piles.
    piles = select_bench_runs(good_runs, UNNAMED)
    means: dict[str, float | None] = {}
    # The values of `MEAN_KEYS` are the columns of the angle, one for each definition.
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
        The content of each file proposal.json, in order.

    Returns
    -------
    pandas.DataFrame
        A row for each proposal: `batch`, the number of the batch; `pours`, the number
        of runs before it; and `why`, the reason. Some strategies add a note named `row`
        with further columns to some of their proposals. The table then has only the
        rows of these proposals.
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
        The rows of `arrange_for_strategy`. The column `batch` has the number of the
        batch, from 0. Without batches, the table has no columns.

    Raises
    ------
    InputError
        If two batches have a sample of the same number.
    """
    batches: list[pd.DataFrame] = []
    earlier_samples: set[int] = set()
    for number, folder in enumerate(folders):
        dataset, runs = read_tables([folder], targets, parameter_names)
        # A strategy tells samples apart by their numbers alone.
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
    run from each bench test. In each bench test, the good runs of a sample are numbered
    in the order of the table. Row k of the sample combines the runs with number k.
    Another pairing would be as valid, since all runs are independent.

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
        Sample, parameters and responses. The number of rows of a sample is its largest
        number of runs in one bench test. Failed runs count, so that a sample without
        any good run stays in the table. A response is NaN where a bench test has fewer
        good runs of the sample than there are rows.
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
