"""Read the answer of a finished calibration from the files that its stages wrote."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from repose.bench.parameters import LABELS, check_value
from repose.calibrate.answer import (
    INSIDE_COLUMN,
    MORE_POURS_ADVICE,
    WITHIN_COLUMNS,
    Check,
    Result,
    is_out_of_reach,
)
from repose.calibrate.bounds import describe_near_bound
from repose.calibrate.targets import Target, Targets
from repose.common.errors import InputError
from repose.common.files import StrPath, read_json
from repose.common.tables import Column
from repose.common.tables import read as read_cells
from repose.measure.settings import MeasureSettings, describe_line_of_response
from repose.stages.parameter_sets import list_parameters

# What to change in the configuration if the prediction meets the targets but the
# simulation does not. For all other strategies, the advice is general.
ADVICE_BY_STRATEGY = {
    "refined": "a larger refine.pours",
    "response_surface": "another response_surface.reach or .most_factors",
    "sequential": "a larger sequential.most_pours",
}
# Columns of the table of the check. Tables of older versions lack some of the columns
# with `needed=False`.
CHECK_COLUMNS = (
    Column("response", str),
    Column("status", str),
    Column("simulated", may_be_empty=True),
    Column("simulated_se", may_be_empty=True),
    Column("n_seeds", may_be_empty=True),
    *(Column(name, may_be_empty=True) for name in WITHIN_COLUMNS.values()),
    Column(INSIDE_COLUMN, may_be_empty=True, needed=False),
    Column("predicted", may_be_empty=True, needed=False),
    Column("optimism", may_be_empty=True, needed=False),
    Column("optimism_se", may_be_empty=True, needed=False),
)


def read_answer(  # noqa: PLR0913  (each describes the study that was calibrated)
    summary_json: StrPath,
    check_csv: StrPath,
    solutions_csv: StrPath,
    *,
    label: str,
    targets: Targets,
    measure: MeasureSettings | None,
    strategy: str,
    results_dir: StrPath,
    card_dir: StrPath | None = None,
    small_run: bool = False,
    parameter_names: Sequence[str] | None = None,
) -> Result:
    """Read the result of a finished calibration from the files that its stages wrote.

    The result has the calibrated parameter set (the answer), and the check of it: the
    set was simulated again, with new seeds, and compared with the targets.

    Parameters
    ----------
    summary_json : path
        Summary of the search, or of the strategy.
    check_csv : path
        Table of the check, with a row for each response.
    solutions_csv : path
        All parameter sets that the calibration found.
    label : str
        Name of the study.
    targets : Targets
        The responses to meet.
    measure : MeasureSettings or None
        The section `measure` of the configuration, which defines the angles of piles.
    strategy : str
        Name of the strategy that found the answer. It decides which advice is given if
        the check fails.
    results_dir : path
        Folder of the results.
    card_dir : path, optional
        Folder of the report and the material card of this answer, by default that of
        the results. A strategy that continues a study has a folder for its own.
    small_run : bool, optional
        Whether the study has too few runs for a real calibration.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        If a file is damaged, or has no row for a target.
    """
    # The summary has the parameter set, whether it meets the targets, and a sentence
    # about this.
    needed_keys = {"representative": dict, "feasible": bool, "message": str}
    summary = read_json(
        summary_json, needed_keys, "the answer of a calibration; run it first"
    )
    rows = _read_checks(check_csv, targets)
    parameters = _read_parameters(
        summary["representative"], summary_json, parameter_names
    )

    checks = []
    for target in targets:
        # The angle of a pile is the slope of a line that is fitted to its side. The
        # description states which line.
        line = describe_line_of_response(measure, target.name)
        checks.append(_make_check(target, rows[target.name], line))

    # The table has two kinds of probability that concern all targets together. Every
    # row repeats them, so the first row is enough. `within` are the probabilities that
    # all means lie within some percent of the values to aim at. `inside` is the
    # probability that all means lie in their target ranges.
    first_row = rows[targets.names[0]]
    within = {
        percent: _get_number(first_row, name)
        for percent, name in WITHIN_COLUMNS.items()
    }
    results_folder = Path(results_dir)
    card_folder = results_folder if card_dir is None else Path(card_dir)
    return Result(
        label=label,
        parameters=parameters,
        feasible=summary["feasible"],
        message=summary["message"],
        checks=tuple(checks),
        folder=card_folder,
        first_folder=None if card_folder == results_folder else results_folder,
        tables=Path(check_csv).parent,
        solutions=Path(solutions_csv),
        advice=ADVICE_BY_STRATEGY.get(strategy, MORE_POURS_ADVICE),
        why=summary.get("why", ""),
        out_of_reach=is_out_of_reach(summary),
        small_run=small_run,
        near_bounds=tuple(map(describe_near_bound, summary.get("near_bounds", ()))),
        within=within,
        inside=_get_number(first_row, INSIDE_COLUMN),
        labels=LABELS,
    )


def _read_checks(check_csv: StrPath, targets: Targets) -> dict[str, dict[str, Any]]:
    """Read the table of a check, with a row for each response.

    Parameters
    ----------
    check_csv : path
        The table.
    targets : Targets
        The responses that must have a row.

    Returns
    -------
    dict
        The cells of each row, by the name of its response.

    Raises
    ------
    InputError
        If a target has no row.
    """
    table = read_cells(check_csv, CHECK_COLUMNS, "a table of the subcommand validate")
    rows = {row["response"]: row for row in table.rows()}
    for name in targets.names:
        if name not in rows:
            raise InputError(
                check_csv,
                key="response",
                value=sorted(rows),
                allowed=f"a row {name}, a target of the configuration",
            )
    return rows


def _read_parameters(
    values: Mapping[str, Any],
    summary_json: StrPath,
    parameter_names: Sequence[str] | None,
) -> dict[str, float]:
    """Select the parameters of the answer, and check their values.

    Parameters
    ----------
    values : mapping
        The parameters and predicted responses of the answer, by name.
    summary_json : path
        The file with these values, for messages.
    parameter_names : sequence of str or None
        Names of the parameters, if another program simulates the study. With None,
        repose simulates it. Only then the physical limits of its contact parameters are
        checked, because those of another program are unknown.

    Returns
    -------
    dict
        The value of each parameter by its name.

    Raises
    ------
    InputError
        If a parameter is not a number. Also if a contact parameter of repose lies
        outside its physical limits.
    """
    parameters = {}
    for name in list_parameters(values, parameter_names):
        value = values.get(name)
        if parameter_names is None:
            parameters[name] = check_value(name, value, summary_json)
        elif isinstance(value, int | float):
            parameters[name] = float(value)
        else:
            raise InputError(summary_json, key=name, value=value, allowed="a number")
    return parameters


def _make_check(target: Target, row: Mapping[str, Any], line: str) -> Check:
    """Compare a target with the simulated and the predicted mean of its response.

    Parameters
    ----------
    target : Target
        The target.
    row : mapping
        The row of its response in the table of the check.
    line : str
        Description of the line whose slope is the angle of a pile. It is empty for
        other responses.
    """
    return Check.from_target(
        target,
        simulated=_get_number(row, "simulated"),
        standard_error=_get_number(row, "simulated_se"),
        runs=int(_get_number(row, "n_seeds") or 0),
        status=row["status"],
        predicted=_get_number(row, "predicted"),
        optimism=_get_number(row, "optimism"),
        optimism_error=_get_number(row, "optimism_se"),
        line=line,
    )


def _get_number(row: Mapping[str, Any], key: str) -> float | None:
    """Return a number of a row; None if its cell is empty or its column missing."""
    number = row.get(key, math.nan)
    return None if math.isnan(number) else number
