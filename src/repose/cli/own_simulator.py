"""Verbs for a simulator of the user's own: the runs to simulate, and the answer from their results."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.registry import Family, Option
from repose.core.errors import InputError

if TYPE_CHECKING:
    from repose.studies.own_simulator import OwnStudy

FOLDER = "own"

family = Family()


def _study(args: argparse.Namespace) -> "OwnStudy":
    """The study of --config."""
    from repose.studies.own_simulator import study

    if not study.is_own(args.config):
        allowed = "the name of your simulator, in a configuration as docs/own_simulator.md shows"
        raise InputError(args.config, "simulator", None, allowed)
    return study.read_study(args.config)


def write_start(args: argparse.Namespace) -> None:
    """Write the runs to begin with, samples.csv, into the folder `args.out`."""
    from repose.core.files import write_table
    from repose.studies.own_simulator import first_runs

    table = first_runs(_study(args))
    path = Path(args.out) / "samples.csv"
    write_table(path, table)
    print(f"{path}: {len(table)} runs of {table['sample'].nunique()} samples to simulate")


def _warn(words: str | None) -> None:
    """Print a warning on stderr; nothing for None."""
    if words is not None:
        print(f"repose: WARNING: {words}", file=sys.stderr)


@family.verb(
    "own simulator: add a table of runs to the record of all runs",
    example=f"new_runs.csv --config own.yaml --out {FOLDER}/runs.csv",
    out=f"{FOLDER}/runs.csv",
    options=[Option("runs", help="CSV file, a row for each run: parameters and responses")],
)
def tell(args: argparse.Namespace) -> None:
    from repose.studies import own_simulator

    table = own_simulator.tell(_study(args), args.runs, args.out)
    print(f"{args.out}: {len(table)} runs of {table['sample'].nunique()} samples")


@family.verb(
    "own simulator: list the runs to make next, or say that the answer is good enough",
    example=f"--runs {FOLDER}/runs.csv --config own.yaml --out {FOLDER}/next.csv",
    out=f"{FOLDER}/next.csv",
    options=[
        Option("--runs", default=f"{FOLDER}/runs.csv", help="the record; where it is missing, the start")
    ],
)
def ask(args: argparse.Namespace) -> None:
    from repose.core.files import write_table
    from repose.strategies.sequential.files import WHY
    from repose.studies import own_simulator
    from repose.studies.own_simulator import calibration

    study = _study(args)
    known = own_simulator.read_runs(args.runs, study)
    advice, table = own_simulator.ask(study, known)
    write_table(args.out, table)
    _warn(own_simulator.noise_of(study, calibration.observed_of(study, known)[0]).warning)
    print(
        f"{len(known)} runs; the best point lies within {study.sequential['tolerance_percent']:g} % of all targets "
        f"with probability {advice.probability:.2f}"
    )
    if advice.stop:
        print(f"{args.out}: the answer. No more runs: {WHY[advice.stop]}")
    else:
        print(f"{args.out}: {len(table)} runs to make next")


@family.verb(
    "own simulator: the parameters that meet the targets, from a table of runs of any simulator",
    example=f"results.csv --config own.yaml --out {FOLDER}",
    out=FOLDER,
    options=[Option("runs", help="CSV file, a row for each run: parameters and responses")],
)
def calibrate(args: argparse.Namespace) -> int:
    from repose.chain.answer import NOT_FEASIBLE
    from repose.pictures.report import own
    from repose.studies import own_simulator
    from repose.studies.own_simulator import calibration

    study = _study(args)
    found = own_simulator.calibrate(study, own_simulator.read_runs(args.runs, study))
    calibration.write(found, args.out)
    own.write(found, Path(args.out) / "report.html")
    print(calibration.in_words(found))
    _warn(found.summary["warning"])
    print(f"Tables, material card and report: {args.out}")
    return 0 if found.summary["feasible"] else NOT_FEASIBLE
