"""Subcommands for a user's own simulator: the runs to make, and the answer."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.registry import Option, load_study, subcommand, was_given
from repose.common import places
from repose.common.errors import InputError

if TYPE_CHECKING:
    from repose.calibrate.study import Study
    from repose.config.pipeline import PipelineConfig

DEFAULT_FOLDER = "own"


def _load_own_study(args: argparse.Namespace) -> "Study":
    """Load a study of the user's own simulator, and print warnings about it.

    Parameters
    ----------
    args : argparse.Namespace
        The options. `config` is the file of the study. For the subcommand `ask`, `runs` is the
        file of the runs so far, which the study also reads.

    Raises
    ------
    InputError
        If the file is of a study with our simulator, or has other faults.
    """
    from repose.calibrate.parameter_types import describe_wide_ranges
    from repose.calibrate.study import Study
    from repose.calibrate.study_file import has_own_simulator, list_unread_keys
    from repose.common.reading import read_yaml

    # The message names the file of the user, or the option if the user gave no file.
    if not has_own_simulator(places.find_file(args.config)):
        has_file = was_given(args, "config")
        raise InputError(
            args.config if has_file else "command line",
            key="simulator" if has_file else "--config",
            value=None,
            allowed="the name of your simulator, in a configuration as "
            "`repose docs own_simulator` shows; `repose run` calls the program of a "
            "section simulator",
        )

    # Only the subcommand `ask` needs the runs so far, to choose the next ones.
    runs_csv = args.runs if args.subcommand == "ask" else None
    study = Study.own(args.config, runs_csv)

    # Warn of keys that the strategy does not use, and of ranges that are too wide.
    unread_keys = list_unread_keys(read_yaml(args.config))
    if unread_keys:
        _warn(
            f"{args.config}: the strategy {study.settings.strategy} does not read "
            f"{', '.join(unread_keys)}"
        )
    for sentence in describe_wide_ranges(study.config["parameters"]):
        _warn(f"{args.config}: {sentence}")
    return study


def load_any_study(args: argparse.Namespace) -> "Study | PipelineConfig":
    """Load the study of --config, for our simulator or for one of the user's own."""
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

    Examples
    --------
    $ repose tell new_runs.csv --config own.yaml --out own/runs.csv
    """
    from repose.calibrate.record import Record
    from repose.common.tables import print_columns

    # Add the new runs, and show what was read of them.
    record = Record(study, args.out)
    record.add_file(args.runs)
    print_columns(args.runs)
    for sentence in record.new_unread_columns():
        _warn(f"{args.runs}: {sentence}")

    # Print the number of all runs in the record, and of those that failed.
    runs = record.data
    n_samples = runs["sample"].nunique()
    line = f"{args.out}: {len(runs)} runs of {n_samples} samples"
    n_failed = int((runs["status"] != "ok").sum())
    if n_failed:
        line += f", {n_failed} failed"
    print(line)


@subcommand(
    Option(
        "--runs",
        default=f"{DEFAULT_FOLDER}/runs.csv",
        help="the record; where it is missing, the start",
    ),
    out=f"{DEFAULT_FOLDER}/next.csv",
    study=_load_own_study,
)
def ask(args: argparse.Namespace, study: "Study") -> None:
    """Own simulator: list the runs to make next, or say that the answer is good enough.

    Examples
    --------
    $ repose ask --runs own/runs.csv --config own.yaml --out own/next.csv
    """
    from repose.calibrate.strategies.base import Answer
    from repose.calibrate.strategies.sequential.strategy import (
        arrange_runs,
        estimate_noise,
    )
    from repose.common.files import write_table

    # If the record does not exist, this is the first call, or the name is misspelt.
    if was_given(args, "runs") and not Path(args.runs).exists():
        print(
            f"repose: note: there is no record {args.runs}: these are the runs of the "
            "start",
            file=sys.stderr,
        )

    # Write the runs to make next. `ask` also stores the proposal behind them in the study.
    next_runs = study.ask()
    proposal = study.proposal
    write_table(args.out, next_runs)

    # Print what the strategy has learned from the runs so far. Only the first proposal,
    # made before any runs, has no notes.
    if proposal.notes:
        observed = arrange_runs(study.runs, study.parameters, study.targets)
        warning = estimate_noise(study, observed).warning
        if warning is not None:
            _warn(warning)
    if "probability" in proposal.notes:
        tolerance = study.settings.sequential.tolerance_percent
        print(
            f"{len(study.runs)} runs; the best point lies within {tolerance:g} % of all "
            f"targets with probability {proposal.notes['probability']:.2f}"
        )
    if isinstance(proposal, Answer):
        print(f"{args.out}: the answer. No more runs: {proposal.why}")
    else:
        print(f"{args.out}: {len(next_runs)} runs to make next")


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
    $ repose calibrate results.csv --config own.yaml --out own
    """
    from repose.calibrate import calibration
    from repose.calibrate.strategies import strategy
    from repose.calibrate.strategies.runs import (
        checked_runs,
        describe_unread_columns,
        read_rows,
    )
    from repose.common.ledger import check_replaceable
    from repose.common.tables import print_columns

    # Before minutes of work, check that no file of somebody else would be replaced.
    out = Path(args.out)
    report_html = out / "report.html"
    file_names = (
        *calibration.TABLE_FILES,
        *calibration.RECORD_FILES,
        *strategy(study.settings.strategy).files,
        report_html.name,
    )
    for file_name in file_names:
        check_replaceable(out / file_name)

    # Read the runs, and show what was read.
    rows = read_rows(args.runs, study)
    runs = checked_runs(study, rows, args.runs)
    print_columns(args.runs)
    for sentence in describe_unread_columns(study, rows).values():
        _warn(f"{args.runs}: {sentence}")

    # Calibrate, and print the answer with its warnings.
    result = calibration.calibrate(study, runs)
    result.save(args.out)
    print(result)
    n_failed = result.summary["failed_runs"]
    if n_failed:
        _warn(f"{n_failed} of {result.summary['runs']} runs failed")
    if result.summary["warning"] is not None:
        _warn(result.summary["warning"])
    print(f"Tables and material card: {args.out}", flush=True)

    # Write the report last. An installation without graphics then has all other files.
    from repose.report.page import own

    own.write(result, report_html)
    print(f"Report: {report_html}")
