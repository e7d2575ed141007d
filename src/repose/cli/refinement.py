"""Verbs of the loop that simulates the answer, adds it to the data and searches again."""

import argparse
from typing import TYPE_CHECKING

from repose.cli.options import file_options
from repose.cli.registry import Option, verb

if TYPE_CHECKING:
    from repose.config.study import Study

ROUND = "results/refined/round_0"
ROUND_FILES = {name: f"{ROUND}/{name}.csv" for name in ("proposal", "dataset", "runs")}


@verb(
    "list the parameter sets of the next round: the search's answer in blocks of seeds, and its neighbours",
    example=f"results --out {ROUND}",
    out=ROUND,
    options=[
        Option(
            "folders", nargs="+", help="of the design, then of all rounds so far: dataset.csv and runs.csv"
        ),
    ],
)
def refine_propose(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.refined import files

    files.run_propose(args.folders, study, args.out, study.definitions, args.config)


@verb(
    "compare a round's simulated proposal with the targets: outcome, reason, and all points of the round",
    example=f"--out {ROUND}",
    out=ROUND,
    options=file_options(ROUND_FILES, "of the round "),
)
def refine_judge(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.refined import rounds

    files = (args.proposal, args.dataset, args.runs)
    found = rounds.run_judge(*files, study.targets, study.config["refine"], args.out)
    print(f"round {found['round']} {found['outcome']}", found["reason"], sep=": ")


@verb(
    "collect all rounds in one table; report why the loop stopped and what may be claimed",
    example=f"{ROUND}/verdict.json",
    out="results/refined",
    options=[Option("verdicts", nargs="+", help="JSON files that refine_judge wrote")],
)
def refine_tables(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.refined import rounds

    targets, limit = study.targets, study.config["refine"]["rounds"]
    summary = rounds.run_tables(args.verdicts, limit, targets, args.out)
    print(summary["why"])
    print(summary["claim"])
