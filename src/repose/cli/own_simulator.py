"""Verbs for a simulator of the user's own: the runs to simulate, and the answer from their results."""

import argparse
import sys
from pathlib import Path
from typing import Any

from repose.cli.registry import Option, load, verb
from repose.common import places
from repose.common.errors import require
from repose.config.study import Study

FOLDER = "own"


def _study(args: argparse.Namespace) -> Study:
    """Load the study of --config, for a simulator of the user's own; for the verb `ask` with the runs so far."""
    from repose.config.own import is_own, unread
    from repose.config.reading import read

    allowed = "the name of your simulator, in a configuration as `repose docs own_simulator` shows"
    own, is_given = (
        is_own(places.find(args.config)),
        "config" in vars(args).get("given", ()),
    )
    require(own or is_given, "command line", "--config", None, allowed)
    require(own, args.config, "simulator", None, allowed)
    study, other = (
        Study.own(args.config, args.runs if args.verb == "ask" else None),
        unread(read(args.config)),
    )
    _warn(
        f"{args.config}: the strategy {study.settings.strategy} does not read {', '.join(other)}"
        if other
        else None
    )
    return study


def load_any_study(args: argparse.Namespace) -> Study:
    """Load the study of --config, for our simulator or for one of the user's own."""
    from repose.config.own import is_own

    return _study(args) if is_own(places.find(args.config)) else load(args)


def _warn(words: str | None) -> None:
    """Print a warning on stderr; nothing for None."""
    if words is not None:
        print(f"repose: WARNING: {words}", file=sys.stderr)


@verb(
    Option("runs", help="CSV file, a row for each run: parameters and responses"),
    out=f"{FOLDER}/runs.csv",
    study=_study,
)
def tell(args: argparse.Namespace, study: Study) -> None:
    """Own simulator: add a table of runs to the record of all runs.

    example: new_runs.csv --config own.yaml --out own/runs.csv
    """
    from repose.config.record import Record

    record = Record(study, args.out)
    record.add_file(args.runs)
    failed = f", {n} failed" if (n := (record.data["status"] != "ok").sum()) else ""
    print(
        f"{args.out}: {len(record.data)} runs of {record.data['sample'].nunique()} samples{failed}"
    )


@verb(
    Option(
        "--runs",
        default=f"{FOLDER}/runs.csv",
        help="the record; where it is missing, the start",
    ),
    out=f"{FOLDER}/next.csv",
    study=_study,
)
def ask(args: argparse.Namespace, study: Study) -> None:
    """Own simulator: list the runs to make next, or say that the answer is good enough.

    example: --runs own/runs.csv --config own.yaml --out own/next.csv
    """
    from repose.calibrate.strategies.base import Answer
    from repose.calibrate.strategies.sequential.strategy import noise_from, observed_of
    from repose.common.files import write_table

    table, found, known = study.ask(), study.proposal, study.runs
    write_table(args.out, table)
    if found.notes:  # it follows from runs
        _warn(
            noise_from(
                study, observed_of(known, study.parameters, study.targets)
            ).warning
        )
    if "probability" in found.notes:
        settings: Any = study.settings  # with the section of the strategy
        near = f"within {settings.sequential.tolerance_percent:g} % of all targets"
        print(
            f"{len(known)} runs; the best point lies {near} with probability {found.notes['probability']:.2f}"
        )
    if isinstance(found, Answer):
        print(f"{args.out}: the answer. No more runs: {found.why}")
    else:
        print(f"{args.out}: {len(table)} runs to make next")


@verb(
    Option("runs", help="CSV file, a row for each run: parameters and responses"),
    out=FOLDER,
    study=_study,
)
def calibrate(args: argparse.Namespace, study: Study) -> None:
    """Own simulator: the parameters that meet the targets, from a table of runs of any simulator.

    example: results.csv --config own.yaml --out own
    """
    from repose.calibrate import calibration
    from repose.calibrate.strategies.runs import read_runs
    from repose.common.ledger import check_replaceable

    for name in (*calibration.TABLES, *calibration.RECORDS, "report.html"):
        check_replaceable(Path(args.out) / name)
    found = calibration.calibrate(study, read_runs(args.runs, study))
    found.save(args.out)
    print(found)
    _warn(
        f"{failed} of {found.summary['runs']} runs failed"
        if (failed := found.summary["failed_runs"])
        else None
    )
    _warn(found.summary["warning"])
    print(f"Tables and material card: {args.out}", flush=True)
    from repose.report.page import (
        own,  # last: an installation without pictures has all but the report
    )

    own.write(found, Path(args.out) / "report.html")
    print(f"Report: {Path(args.out) / 'report.html'}")
