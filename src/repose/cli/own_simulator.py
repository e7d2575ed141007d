"""Subcommands for a user's own simulator: the runs to make, and the answer."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.registry import Option, load_study, subcommand, was_given
from repose.common import places
from repose.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.study import Study
    from repose.config.pipeline import PipelineConfig

DEFAULT_FOLDER = "own"
REPORT_FILE = "report.html"


def _load_own_study(args: argparse.Namespace, runs_csv: str | None = None) -> "Study":
    """Load a study of the user's own simulator, and print warnings about it.

    Parameters
    ----------
    args : argparse.Namespace
        The options; `config` is the file of the study.
    runs_csv : str, optional
        The table of the runs so far, from which the study chooses the next ones.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        If the file is of a study with our simulator, or has other faults.
    """
    from repose.calibrate.study import Study

    _require_own_simulator(args)
    study = Study.own(args.config, runs_csv)
    _print_configuration_warnings(args.config, study)
    return study


def _load_own_study_with_runs(args: argparse.Namespace) -> "Study":
    """Load a study as `_load_own_study` does, with the runs in the table of --runs."""
    return _load_own_study(args, args.runs)


def _require_own_simulator(args: argparse.Namespace) -> None:
    """Raise an InputError if the file of --configfile is of a study with our simulator.

    The message names this file, or the option if the user gave no file.
    """
    from repose.calibrate.study_file import has_own_simulator

    if has_own_simulator(places.find_file(args.config)):
        return
    has_file = was_given(args, "config")
    raise InputError(
        args.config if has_file else "command line",
        key="simulator" if has_file else "--configfile",
        value=None if has_file else "not given",
        allowed="the name of your simulator, in a configuration as "
        "`repose docs own_simulator` shows; `repose run` calls the program of a "
        "section simulator",
    )


def _print_configuration_warnings(config_path: str, study: "Study") -> None:
    """Print a warning about unused keys, and one about each range that is too wide.

    Parameters
    ----------
    config_path : str
        The file of the study.
    study : Study
        The study that was made from this file.
    """
    from repose.calibrate.parameter_types import describe_wide_ranges
    from repose.calibrate.study_file import list_unread_keys
    from repose.common.reading import read_yaml

    # The study has defaults for all keys, so read which keys the user's file has.
    unread_keys = list_unread_keys(read_yaml(config_path))
    if unread_keys:
        _warn(
            f"{config_path}: the strategy {study.settings.strategy} does not read "
            f"{', '.join(unread_keys)}"
        )
    for sentence in describe_wide_ranges(study.config["parameters"]):
        _warn(f"{config_path}: {sentence}")


def load_any_study(args: argparse.Namespace) -> "Study | PipelineConfig":
    """Load the study of --configfile, for our simulator or for one of the user's own."""
    from repose.calibrate.study_file import has_own_simulator

    return (
        _load_own_study(args)
        if has_own_simulator(places.find_file(args.config))
        else load_study(args)
    )


def _warn(text: str) -> None:
    """Print a warning on stderr."""
    print(f"repose: WARNING: {text}", file=sys.stderr)


@subcommand(
    Option("runs", help="CSV file, a row for each run: parameters and responses"),
    out=f"{DEFAULT_FOLDER}/runs.csv",
    study=_load_own_study,
)
def tell(args: argparse.Namespace, study: "Study") -> None:
    """Own simulator: add a table of runs to the record of all runs.

    The record is the file of --out. The subcommands ask and tell are used in turn.

    Examples
    --------
    $ repose tell new_runs.csv --configfile own.yaml --out own/runs.csv
    """
    from repose.calibrate.record import Record
    from repose.calibrate.strategies.runs import (
        count_runs_without_results,
        describe_probable_units,
    )
    from repose.common.tables import print_columns

    # Add the new runs, and show what was read: a line for each column of numbers, and a
    # warning about each column that is not used or is probably in another unit. The
    # record may have runs in the right unit, so judge the new runs alone.
    record = Record(study, args.out)
    rows = record.add_file(args.runs)
    print_columns(args.runs)
    units = describe_probable_units(study, rows)
    for sentence in (*record.new_unread_columns(), *units.values()):
        _warn(f"{args.runs}: {sentence}")
    n_empty = count_runs_without_results(rows, study)
    if n_empty:
        _warn(
            f"{args.runs}: rows without results: {n_empty}. These runs count as failed. "
            "To add their results later, call `repose tell` with these rows again, before "
            "you tell the next runs"
        )

    # Print the number of all runs in the record, and of those that failed.
    runs = record.data
    n_samples = runs["sample"].nunique()
    n_failed, statuses = _describe_failed_runs(runs)
    failed_text = f", {n_failed} failed{statuses}" if n_failed else ""
    print(f"{args.out}: {len(runs)} runs of {n_samples} samples{failed_text}")


def _describe_failed_runs(runs: "pd.DataFrame") -> tuple[int, str]:
    """Count the runs that failed, and list their statuses.

    Parameters
    ----------
    runs : pandas.DataFrame
        The checked runs with their `status`.

    Returns
    -------
    count : int
    statuses : str
        Such as `` (status jammed: 2, failed: 1)``. It is empty if all of them have the
        status `FAILED`, which a run without results gets.
    """
    from repose.calibrate.strategies.runs import FAILED, OK, describe_failures

    failed = runs[runs["status"] != OK]["status"]
    if set(failed) <= {FAILED}:
        return len(failed), ""
    return len(failed), f" ({describe_failures(failed)})"


@subcommand(
    Option(
        "--runs",
        default=f"{DEFAULT_FOLDER}/runs.csv",
        help="the record of all runs; if it does not exist, the first runs are listed",
    ),
    out=f"{DEFAULT_FOLDER}/next.csv",
    study=_load_own_study_with_runs,
)
def ask(args: argparse.Namespace, study: "Study") -> None:
    """Own simulator: list the runs to make next, or say that the answer is good enough.

    Examples
    --------
    $ repose ask --runs own/runs.csv --configfile own.yaml --out own/next.csv
    """
    from repose.calibrate.strategies.base import Answer
    from repose.common.files import write_table

    # If the record does not exist, this is the first call, or the name is misspelt.
    if was_given(args, "runs") and not Path(args.runs).exists():
        print(
            f"repose: note: there is no record {args.runs}, so these are the first runs "
            "of the study",
            file=sys.stderr,
        )

    # `ask` returns the runs, and stores in `study.proposal` why the strategy proposes
    # them. The proposal of the answer has no runs.
    next_runs = study.ask()
    write_table(args.out, next_runs)

    _print_findings(study)
    if isinstance(study.proposal, Answer):
        print(f"{args.out}: the answer; no further runs: {study.proposal.why}")
    else:
        print(f"{args.out}: {len(next_runs)} runs to make next")


def _print_findings(study: "Study") -> None:
    """Print what the strategy has found out from the runs so far.

    This is a warning on stderr if the noise is uncertain, and on stdout how probable it
    is that the best point meets the targets. Before the first runs nothing is printed.

    Parameters
    ----------
    study : Study
        The study, after a call of `Study.ask`.
    """
    notes = study.proposal.notes
    runs = study.runs
    if not notes or runs.empty:
        return
    warning = _make_noise_warning(study, runs)
    if warning is not None:
        _warn(warning)
    # Only the sequential strategy notes this probability.
    if "probability" in notes:
        tolerance = study.settings.sequential.tolerance_percent
        print(
            f"{len(runs)} runs; the best point lies within {tolerance:g} % of all "
            f"targets with probability {notes['probability']:.2f}"
        )


def _make_noise_warning(study: "Study", runs: "pd.DataFrame") -> str | None:
    """Make a warning if the noise cannot be estimated well from the runs so far.

    The noise is the scatter of the responses of runs with the same parameters.

    Parameters
    ----------
    study : Study
        The study.
    runs : pandas.DataFrame
        All runs so far, at least one.

    Returns
    -------
    str or None
        The text of the warning; None if there is nothing to warn about.
    """
    from repose.calibrate.strategies.sequential.strategy import (
        arrange_runs,
        estimate_noise,
    )

    n_failed, statuses = _describe_failed_runs(runs)
    if n_failed == len(runs):
        return f"all {n_failed} runs so far failed{statuses}"
    observed = arrange_runs(runs, study.parameters, study.targets)
    try:
        return estimate_noise(study, observed).warning
    except InputError:
        # There are too few good runs for an estimate. This is no error here, because
        # the strategy asks for further runs.
        failed_text = f"; {n_failed} of them failed{statuses}" if n_failed else ""
        return f"the runs so far do not show the noise of a run{failed_text}"


@subcommand(
    Option("runs", help="CSV file, a row for each run: parameters and responses"),
    out=DEFAULT_FOLDER,
    study=_load_own_study,
)
def calibrate(args: argparse.Namespace, study: "Study") -> None:
    """Own simulator: find the parameters that meet the targets.

    They follow from a table of runs of any simulator.

    Examples
    --------
    $ repose calibrate results.csv --configfile own.yaml --out own
    """
    from repose.calibrate import calibration
    from repose.calibrate.record import Record
    from repose.calibrate.strategies import strategy
    from repose.calibrate.strategies.runs import (
        checked_runs,
        describe_probable_units,
        describe_unread_columns,
        name_file_of_runs,
        read_rows,
    )
    from repose.common.ledger import check_replaceable
    from repose.common.tables import print_columns

    # The calibration takes minutes. So check first that it will replace no file that
    # the user has made.
    out = Path(args.out)
    file_names = (
        *calibration.TABLE_FILES,
        *calibration.RECORD_FILES,
        *strategy(study.settings.strategy).files,
        REPORT_FILE,
    )
    for file_name in file_names:
        check_replaceable(out / file_name)

    # Read the runs, and show what was read.
    rows = read_rows(args.runs, study)
    runs = checked_runs(study, rows, args.runs)
    print_columns(args.runs)
    unread = describe_unread_columns(study, rows)
    units = describe_probable_units(study, rows)
    for sentence in (*unread.values(), *units.values()):
        _warn(f"{args.runs}: {sentence}")

    # Calibrate, and print the answer with its warnings.
    with name_file_of_runs(args.runs):
        # A record of `tell` says whether its last runs check an answer of the strategy.
        checked = Record(study, args.runs).find_checked_answer()
        if checked is None:
            result = calibration.calibrate(study, runs)
        else:
            result = calibration.calibrate(
                study, checked.runs, checked.answer, checked.check
            )
    result.save(args.out)
    print(result)
    n_failed, statuses = _describe_failed_runs(runs)
    if n_failed:
        _warn(f"{n_failed} of {len(runs)} runs failed{statuses}")
    if result.summary["warning"] is not None:
        _warn(result.summary["warning"])
    print(f"Tables and material card: {args.out}", flush=True)

    # Write the report last. An installation without graphics then has all other files.
    from repose.report.page import own

    own.write(result, out / REPORT_FILE)
    print(f"Report: {out / REPORT_FILE}")
