"""Choose solutions that are simulated again, and compare them with the measurement.

The tables are Table 4 of the paper (section 4.2.1), the comparison with the physical
measurement, and the published solutions as this engine simulates them. As in Table 4,
errors are relative and in percent: |predicted - simulated| / simulated, and for the
representative solution |simulated - physical| / physical.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from repose.calibrate.answer import INSIDE_COLUMN, WITHIN_COLUMNS
from repose.calibrate.chance import RunsByBench, compute_target_probabilities
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import (
    Response,
    compute_deviation_percent,
    name_derived_column,
)
from repose.calibrate.runs import name_error_column
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import StrPath, read_table, write_table
from repose.measure.angles import CALIBRATED_ANGLE, MEAN_KEYS
from repose.measure.settings import MeasureSettings, describe_line_of_response, line_of
from repose.stages.dataset import Jobs, make_tables, read_jobs
from repose.stages.parameter_sets import list_parameters, read_samples
from repose.stages.published import (
    FIRST_PUBLISHED,
    HASH_NAMES,
    find_response_columns,
    read_sets,
    read_stored,
)
from repose.stages.tables import find_answer

SELECTION_COLUMNS = ("solution", "role")
# Columns of text in a table of published sets, some of which it may lack.
PUBLISHED_TEXT_COLUMNS = ("solution", "source", "wall")
# Kinds of values in a publication, which are parts of the names of its columns.
PUBLISHED_KINDS = ("predicted", "simulated", "measured")
# Tables of parameter sets, which get a column of warnings.
TABLES_WITH_WARNINGS = ("table4", "published")
STATUS_COLUMNS = ("n_seeds", "status", "reason")
# Columns of the angle of a pile by every definition, with their standard errors.
ANGLE_COLUMNS = tuple(
    column for name in MEAN_KEYS.values() for column in (name, name_error_column(name))
)


def select_for_validation(
    solutions: pd.DataFrame, count: int, space: ParameterSpace
) -> pd.DataFrame:
    """Select the solutions that are simulated again.

    The first one is the representative solution, which is the answer of the study. The
    second one has the smallest objective. Each further one lies as far as possible from
    the solutions that are already selected: the distance to the nearest of them, in
    normalised parameters, is largest (Gonzalez 1985).

    Parameters
    ----------
    solutions : pandas.DataFrame
        Parameter sets with `objective`, `feasible` and `representative`. If more than
        `count` are feasible, only these and the representative one are candidates.
    count : int
        Number of solutions to select besides the representative one.
    space : ParameterSpace
        The ranges that normalise the parameters.

    Returns
    -------
    pandas.DataFrame
        The selected rows in the order of their selection, with the column `role`.
    """
    # More than `count` feasible solutions are enough, even if the representative one is
    # among them.
    candidates = solutions
    if np.count_nonzero(solutions["feasible"]) > count:
        is_candidate = solutions["feasible"] | solutions["representative"]
        candidates = solutions[is_candidate]

    # Rows are identified by their positions in `candidates`, not by its index.
    representative = int(np.flatnonzero(candidates["representative"])[0])
    best = int(candidates["objective"].to_numpy(float).argmin())
    # The keys are in the order of selection, and the values are the roles.
    role_of_row = {representative: "representative"}
    # Keep the role of the representative if it is also the best solution.
    role_of_row.setdefault(best, "least objective")

    # Scale each parameter to [-1, 1].
    positions = 2 * space.unit(candidates[list(space.names)].to_numpy(float)) - 1
    n_selected = min(count + 1, len(candidates))
    while len(role_of_row) < n_selected:
        role_of_row[_find_farthest(positions, list(role_of_row))] = "spread"
    selected = candidates.iloc[list(role_of_row)]
    return selected.assign(role=list(role_of_row.values()))


def _find_farthest(positions: np.ndarray, selected: list[int]) -> int:
    """Find the point whose nearest selected point is farthest away.

    Parameters
    ----------
    positions : ndarray
        Positions (N, P) of all points.
    selected : list of int
        Row numbers of the selected points.

    Returns
    -------
    int
        Row number of the point, which has not been selected yet.
    """
    # Distance of each point (rows) from each selected one (columns).
    distances = np.linalg.norm(positions[:, None] - positions[selected], axis=2)
    nearest_distance = distances.min(axis=1)
    # Distances are never negative, so a distance of -1 excludes the selected points.
    nearest_distance[selected] = -1.0
    return int(nearest_distance.argmax())


def add_optimism(
    solutions: pd.DataFrame, optimism: pd.DataFrame, responses: Sequence[Response]
) -> pd.DataFrame:
    """Add the expected optimism of each prediction and its standard error as columns.

    The optimism of a prediction is its bias, which arises because the search chose the
    parameter set for its favourable predictions.

    Parameters
    ----------
    solutions : pandas.DataFrame
        Parameter sets with the column `role`.
    optimism : pandas.DataFrame
        Result of `repose.calibrate.optimism.estimate_optimism`. Roles that it lacks get
        empty cells.
    responses : sequence of Response
        The responses of the targets.

    Returns
    -------
    pandas.DataFrame
        A copy of `solutions` with these columns.
    """
    table = solutions.copy()
    for response in responses:
        is_of_response = optimism["response"] == response.name
        optimism_by_role = optimism[is_of_response].set_index("role")
        rows = optimism_by_role.reindex(solutions["role"])
        table[response.optimism] = rows["optimism"].to_numpy(float)
        table[response.optimism_error] = rows["optimism_se"].to_numpy(float)
    return table


def compare_solutions(
    solutions: pd.DataFrame,
    jobs: Jobs,
    targets: Targets,
    measure: MeasureSettings | None,
    parameter_names: Sequence[str] | None = None,
) -> dict[str, pd.DataFrame]:
    """Compare the predictions for solutions with their simulation and the measurement.

    Parameters
    ----------
    solutions : pandas.DataFrame
        The parameter sets that were simulated again: `sample`, `solution`, `role`, the
        parameters and the predicted responses. One of them has the role
        ``representative``.
    jobs : mapping
        The measured jobs of these sets by bench test, and then by `sample`.
    targets : Targets
        The targets of the study.
    measure : MeasureSettings or None
        The section `measure`, which defines the angles of piles.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    dict of pandas.DataFrame
        ``table4`` is the result of `make_table4`. ``representative`` compares the
        representative solution with the measurement, by `compare_with_measurement` and
        `add_probabilities`.

    Raises
    ------
    InputError
        If no solution has the role ``representative``.
    """
    simulated = _tabulate_simulated_responses(solutions, jobs, targets, parameter_names)
    rows = pd.concat([solutions.reset_index(drop=True), simulated], axis=1)

    # The representative solution is also compared with the physical measurement.
    answer = find_answer(rows, source="solutions")
    answer_runs = {
        bench_test: jobs_by_sample[answer["sample"]]["runs"]
        for bench_test, jobs_by_sample in jobs.items()
    }
    physical = compare_with_measurement(answer, targets, measure)
    return {
        "table4": make_table4(rows, targets.responses, measure, parameter_names),
        "representative": add_probabilities(physical, answer_runs, targets),
    }


def _tabulate_simulated_responses(
    solutions: pd.DataFrame,
    jobs: Jobs,
    targets: Targets,
    parameter_names: Sequence[str] | None,
) -> pd.DataFrame:
    """Make a table of the simulated responses of solutions.

    Parameters
    ----------
    solutions : pandas.DataFrame
        The parameter sets that were simulated again.
    jobs : mapping
        The measured jobs of these sets by bench test, and then by `sample`.
    targets : Targets
        The targets of the study.
    parameter_names : sequence of str or None
        Names of the parameters, if another program simulates the study.

    Returns
    -------
    pandas.DataFrame
        A row for each solution, in the same order: status, responses and standard
        errors, but neither number nor contact parameters. Each response of a target has
        a second column under the name of `Response.simulated`, such as
        `aor_simulated_deg`.
    """
    dataset, _ = make_tables(solutions, jobs, targets, parameter_names)
    parameters = list_parameters(solutions, parameter_names)
    simulated = dataset.drop(columns=["sample", *parameters])

    # Convert None to NaN. A failed solution has None instead of its numbers, and a
    # solution with a single run has None as its standard error.
    number_columns = [
        name
        for name in (*targets.names, *targets.errors, *ANGLE_COLUMNS)
        if name in simulated
    ]
    simulated = simulated.astype(dict.fromkeys(number_columns, float))
    for response in targets.responses:
        simulated[response.simulated] = simulated[response.name]
    return simulated


def make_table4(
    rows: pd.DataFrame,
    responses: Sequence[Response],
    measure: MeasureSettings | None = None,
    parameter_names: Sequence[str] | None = None,
) -> pd.DataFrame:
    """Make the table table4.csv: predicted and simulated responses of each solution.

    It corresponds to Table 4 of the paper.

    Parameters
    ----------
    rows : pandas.DataFrame
        A row for each solution, with predicted and simulated responses.
    responses : sequence of Response
        The responses of the targets.
    measure : MeasureSettings, optional
        The section `measure`, which defines the angles of piles. Without it, the table
        has only those angles that are responses of the targets.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    pandas.DataFrame
        For each solution the predicted responses, the simulated ones with their
        standard errors, and the relative errors in percent. If `rows` has the angles of
        the piles by every definition, the table has them, too. The column `line` then
        describes the line whose slope is the calibrated angle.
    """
    parameters = list_parameters(rows, parameter_names)
    table = rows[["sample", *SELECTION_COLUMNS, *parameters]].copy()
    for response in responses:
        table[response.predicted] = rows[response.predicted]
        # Not every study has computed the expected optimism of its predictions.
        for column in (response.optimism, response.optimism_error):
            if column in rows:
                table[column] = rows[column]
        table[response.simulated] = rows[response.simulated]
        table[response.standard_error] = rows[response.standard_error]
        table[response.deviation_percent] = compute_deviation_percent(
            rows[response.predicted], rows[response.simulated]
        )
    if measure is not None and set(ANGLE_COLUMNS) <= set(rows):
        table[list(ANGLE_COLUMNS)] = rows[list(ANGLE_COLUMNS)]
        table["line"] = describe_calibrated_lines(responses, measure)
    table[list(STATUS_COLUMNS)] = rows[list(STATUS_COLUMNS)]
    return table


def describe_calibrated_lines(
    responses: Iterable[Response], measure: MeasureSettings
) -> str:
    """Describe how the calibrated angles of a pile are measured.

    An angle of a pile is the slope of a straight line along its side. There are several
    definitions of this line, such as a fit to the middle of the flank.

    Parameters
    ----------
    responses : iterable of Response
        Responses of the targets.
    measure : MeasureSettings
        The section `measure` of the configuration, which defines the lines.

    Returns
    -------
    str
        The description of each line, once. If no response is an angle of a pile, the
        result describes the line that `measure.response` names.
    """
    lines = []
    for response in responses:
        line = describe_line_of_response(measure, response.name)
        if line and line not in lines:
            lines.append(line)
    if not lines:
        # Without a definition, `line_of` describes the line of the configuration.
        return line_of(measure)
    return "; ".join(lines)


def compare_with_measurement(
    row: pd.Series, targets: Targets, measure: MeasureSettings | None = None
) -> pd.DataFrame:
    """Compare the simulated responses of a solution with the physical measurement.

    Parameters
    ----------
    row : pandas.Series
        The solution, with predicted and simulated responses. It may also have the
        expected optimism of the predictions, which is their bias.
    targets : Targets
        The targets of the study.
    measure : MeasureSettings, optional
        The section `measure`. If given, the column `line` describes the line by which
        an angle of a pile is measured.

    Returns
    -------
    pandas.DataFrame
        A row for each target: measured mean and standard deviation, predicted mean,
        simulated mean and its standard error, the difference between the simulated and
        the measured mean in percent, number of runs and status. The row has the columns
        `optimism` and `line` if they are known.
    """
    rows = []
    for target in targets:
        simulated = row[target.response.simulated]
        # `target.value` is the measured mean. `whole_value` is the number that counts
        # as 100 %: usually its magnitude, but a profile has a number of its own.
        deviation = abs(simulated - target.value)
        comparison = {
            "response": target.name,
            "physical_mean": target.value,
            "physical_sd": target.sd,
            "predicted": row[target.response.predicted],
            "simulated": simulated,
            "simulated_se": row[target.response.standard_error],
            "error_percent": 100 * deviation / target.whole_value,
            "within_one_sd": bool(deviation <= target.sd),
            "n_seeds": row["n_seeds"],
            "status": row["status"],
        }
        if target.response.optimism in row:
            comparison["optimism"] = row[target.response.optimism]
            comparison["optimism_se"] = row[target.response.optimism_error]
        if measure is not None:
            comparison["line"] = describe_line_of_response(measure, target.name)
        rows.append(comparison)
    return pd.DataFrame(rows)


def add_probabilities(
    table: pd.DataFrame, runs: RunsByBench, targets: Targets
) -> pd.DataFrame:
    """Add the probabilities that all means meet the targets.

    The columns are for means within some percent of the aims (`WITHIN_COLUMNS`), and
    for means inside the ranges. `table` is the result of `compare_with_measurement`,
    and `runs` are the runs of its solution.
    """
    probabilities = {}
    for percent, column in WITHIN_COLUMNS.items():
        probabilities[column] = compute_target_probabilities(runs, targets, percent)[
            "all"
        ]
    probabilities[INSIDE_COLUMN] = compute_target_probabilities(runs, targets)["all"]
    return table.assign(**probabilities)


def write_solutions(
    path: StrPath, space: ParameterSpace, targets: Targets, count: int, out_csv: StrPath
) -> pd.DataFrame:
    """Choose the solutions to simulate again, and write their table.

    The column `solution` keeps the number that a solution has in the search. The column
    `sample` numbers the chosen solutions from 1.

    Parameters
    ----------
    path : path
        The file feasible.csv with all solutions of the search.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.
    count : int
        Number of solutions besides the representative one.
    out_csv : path
        The table to write.

    Returns
    -------
    pandas.DataFrame
        The chosen solutions: `sample`, the parameters, `solution`, `role` and the
        predicted responses.

    Raises
    ------
    InputError
        If there are fewer solutions than `count` and the representative one.
    """
    needed_columns = (
        "solution",
        *space.names,
        *targets.predicted,
        "objective",
        "feasible",
        "representative",
    )
    all_solutions = read_table(path, needed_columns)
    if len(all_solutions) <= count:
        raise InputError(
            path,
            key="solutions",
            value=len(all_solutions),
            allowed=f"at least {count + 1}",
        )
    selected = select_for_validation(all_solutions, count, space)
    selected = selected.reset_index(drop=True)
    selected["sample"] = selected.index + 1
    solutions = selected[
        ["sample", *space.names, *SELECTION_COLUMNS, *targets.predicted]
    ]
    # In the file, the number of a solution is text, because the tables of published
    # sets have names in this column.
    write_table(out_csv, solutions.astype({"solution": str}))
    return solutions


def write_comparison(
    solutions_csv: StrPath,
    jobs: Iterable[StrPath],
    out_dir: StrPath,
    *,
    targets: Targets,
    measure: MeasureSettings | None,
    published: pd.DataFrame | None = None,
    support: Support | None = None,
    optimism: pd.DataFrame | None = None,
    parameter_names: Sequence[str] | None = None,
) -> dict[str, pd.DataFrame]:
    """Compare predicted and simulated responses, and write the resulting tables.

    The name of each table is also the name of its file. The representative solution,
    which is the answer of the study, is also compared with the measurement.

    Parameters
    ----------
    solutions_csv : path
        Parameter sets that were simulated again, as `write_solutions` writes them.
    jobs : iterable of path
        Files of the measured jobs: one for each parameter set in each bench test.
    out_dir : path
        Folder for table4.csv (all solutions), representative.csv (the comparison with
        the measurement) and published.csv (published parameter sets).
    targets : Targets
        The targets of the study.
    measure : MeasureSettings or None
        The section `measure`.
    published : pandas.DataFrame, optional
        Result of `compare_with_published`; without it there is no published.csv.
    support : Support, optional
        Region that the samples cover. Parameter sets outside it get a warning.
    optimism : pandas.DataFrame, optional
        Expected optimism of the predictions, from the stage `optimism`. It is by how
        much they are too favourable on average, because a search chose them.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    dict of pandas.DataFrame
        The tables, by the names of their files without ending.
    """
    solutions = read_samples(
        solutions_csv, (*SELECTION_COLUMNS, *targets.predicted), parameter_names
    )
    solutions = solutions.astype({"solution": str})
    if optimism is not None:
        solutions = add_optimism(solutions, optimism, targets.responses)
    jobs_by_bench_test = read_jobs(jobs, solutions, targets, parameter_names)
    tables = compare_solutions(
        solutions,
        jobs_by_bench_test,
        targets=targets,
        measure=measure,
        parameter_names=parameter_names,
    )
    # The caller has already compared the published sets.
    if published is not None:
        tables["published"] = published

    if support is not None:
        for name in TABLES_WITH_WARNINGS:
            if name in tables:
                tables[name] = _add_warnings(tables[name], support, parameter_names)
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table)
    return tables


def _add_warnings(
    table: pd.DataFrame, support: Support, parameter_names: Sequence[str] | None
) -> pd.DataFrame:
    """Add the column `warning` to a table of parameter sets, which may be empty.

    A set that the samples in `support` do not cover gets a warning.
    """
    names = list_parameters(table, parameter_names)
    parameter_sets = table[list(names)].to_numpy(float)
    warnings = support.make_warnings(parameter_sets) if len(parameter_sets) else []
    return table.assign(warning=warnings)


# --- the published sets ---------------------------------------------------------------


def _read_numbered_sets(
    published_csv: StrPath, parameter_names: Iterable[str]
) -> pd.DataFrame:
    """Read the published sets, and number them, starting at `FIRST_PUBLISHED`."""
    sets = read_sets(published_csv, parameter_names)
    return sets.assign(sample=range(FIRST_PUBLISHED, FIRST_PUBLISHED + len(sets)))


def write_published_solutions(
    published_csv: StrPath, parameter_names: Sequence[str], out_csv: StrPath
) -> pd.DataFrame:
    """Write the published parameter sets, which are to be simulated.

    Returns
    -------
    pandas.DataFrame
        The table that was written: the number `sample` and the parameters.
    """
    sets = _read_numbered_sets(published_csv, parameter_names)
    table = sets[["sample", *parameter_names]]
    write_table(out_csv, table)
    return table


def write_published_sets(
    published_csv: StrPath,
    jobs: Iterable[StrPath],
    out_csv: StrPath,
    *,
    parameter_names: Sequence[str],
    targets: Targets,
    simulated_by: Mapping[str, str | None],
) -> pd.DataFrame:
    """Write a table of the published parameter sets, as published and as simulated.

    Parameters
    ----------
    published_csv : path
        The published sets.
    jobs : iterable of path
        Files of the measured jobs: one for each published set in each bench test.
    out_csv : path
        The table to write.
    parameter_names : sequence of str
        Parameters of the study.
    targets : Targets
        The targets of the study.
    simulated_by : mapping
        Hash of the engine and hash of the scene, by the names in
        `repose.stages.published.HASH_NAMES`.

    Returns
    -------
    pandas.DataFrame
        The table that was written.
    """
    sets = _read_numbered_sets(published_csv, parameter_names)
    # `make_tables` keeps the order of the sets and numbers its rows from 0, as `sets`
    # does. The columns of both tables can therefore be combined row by row.
    simulated, _ = make_tables(sets, read_jobs(jobs, sets, targets), targets)

    text_columns = [name for name in PUBLISHED_TEXT_COLUMNS if name in sets]
    table = sets[["sample", *text_columns, *parameter_names]].copy()
    if "source" not in sets:
        table["source"] = ""
    for column, new_name in _rename_published_responses(sets).items():
        table[new_name] = sets[column]

    # Store the angle by every definition, because the table also serves studies that
    # calibrate another definition. Leave out the column `CALIBRATED_ANGLE`: it has the
    # angle of the definition that this study calibrates, but its name does not say
    # which one this is. The keys of the dict are the names in order, each once.
    response_names = dict.fromkeys((*targets.names, "height_mm", *MEAN_KEYS.values()))
    response_names.pop(CALIBRATED_ANGLE, None)
    for name in response_names:
        if name in simulated:
            columns = [name, name_error_column(name)]
            table[columns] = simulated[columns].astype(float)
    table[list(STATUS_COLUMNS)] = simulated[list(STATUS_COLUMNS)]
    table = table.assign(**simulated_by)
    write_table(out_csv, table)
    return table


def _rename_published_responses(columns: Iterable[str]) -> dict[str, str]:
    """Choose new names for the columns of a publication that have responses.

    Without the new names, they would look like responses that were simulated here. For
    example, `aor_simulated_deg` becomes `aor_published_simulated_deg`.

    Parameters
    ----------
    columns : iterable of str
        Columns of a table of published sets.

    Returns
    -------
    dict
        The new name of each such column: the predictions first, then the simulated and
        the measured responses.
    """
    new_names = {}
    for kind in PUBLISHED_KINDS:
        for column in columns:
            if f"_{kind}_" in column:
                new_names[column] = column.replace(f"_{kind}_", f"_published_{kind}_")
    return new_names


def compare_with_published(
    stored_csv: StrPath | None,
    *,
    parameter_names: Sequence[str],
    targets: Targets,
    measure: MeasureSettings,
    simulated_by: Mapping[str, str],
) -> pd.DataFrame:
    """Compare the stored simulations of published parameter sets with the publication.

    Parameters
    ----------
    stored_csv : path or None
        Table of `write_published_sets`.
    parameter_names : sequence of str
        Parameters of the study.
    targets : Targets
        The targets of the study.
    measure : MeasureSettings
        The section `measure`.
    simulated_by : mapping
        Hash of the present engine (the code of the simulator) and hash of the present
        scene (grain, walls and settings), by the names in `HASH_NAMES`. A set that was
        simulated with another engine or scene is marked as `stale`.

    Returns
    -------
    pandas.DataFrame
        The stored table with further columns: the simulated responses under the names
        that they have in table4.csv, their differences from the published ones, and
        `stale`. It has no rows if there is no table, or if the table lacks a parameter
        or has none of the responses.
    """
    stored = pd.DataFrame() if stored_csv is None else read_stored(stored_csv)
    column_of_response = find_response_columns(
        stored,
        parameter_names=parameter_names,
        targets=targets,
        definition=measure.response,
    )
    if not column_of_response:
        # The report and the figures read these columns even from an empty table.
        empty_columns = [
            "sample",
            "solution",
            *parameter_names,
            *STATUS_COLUMNS,
            *HASH_NAMES,
            "stale",
        ]
        return pd.DataFrame(columns=empty_columns)

    table = stored.copy()
    for response, column in column_of_response.items():
        table[response.simulated] = stored[column]
        table[response.standard_error] = stored[name_error_column(column)]
        published_column = name_derived_column(response.name, "published_simulated")
        if published_column in stored:
            difference = stored[column] - stored[published_column]
            table[name_derived_column(response.name, "difference")] = difference
    if set(ANGLE_COLUMNS) <= set(stored):
        table["line"] = describe_calibrated_lines(targets.responses, measure)
    # Results of an earlier engine or scene may differ from those of a new simulation.
    hashes = stored[list(HASH_NAMES)]
    table["stale"] = (hashes != pd.Series(simulated_by)).any(axis=1)
    return table
