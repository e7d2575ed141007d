"""Verbs of the loop that simulates the answer, adds it to the data and searches again."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.options import DATASET, FEASIBLE, NETWORK, RUNS, file_options
from repose.cli.registry import Family, Option

if TYPE_CHECKING:
    from repose.config.study import Study

ROUND = "results/refined/round_0"
NEXT_ROUND = "results/refined/round_1"
ROUND_FILES = {name: f"{ROUND}/{name}.csv" for name in ("proposal", "dataset", "runs")}

family = Family()


@family.verb(
    "add the samples of the rounds so far to those of the design, for the next fit",
    example=f"{ROUND} --out {NEXT_ROUND}",
    out=NEXT_ROUND,
    config=False,
    options=[
        Option("rounds", nargs="+", help="folders of the rounds: dataset.csv and runs.csv of their own"),
        DATASET.but(help="dataset.csv of the design"),
        RUNS.but(help="runs.csv of the design: single runs"),
    ],
)
def refine_data(args: argparse.Namespace) -> None:
    from repose.strategies.refined import refine

    refine.run_extended(args.dataset, args.runs, args.rounds, args.out)


@family.verb(
    "correct the refitted surrogate near the last proposal and search there",
    example=f"--near {ROUND}/proposal.csv",
    out=f"{NEXT_ROUND}/miga",
    options=[
        NETWORK.but(default=f"{NEXT_ROUND}/network/network.json", help="the refitted surrogate"),
        DATASET.but(default=f"{NEXT_ROUND}/data/dataset.csv", help="what it was fitted to"),
        Option("--near", default=f"{ROUND}/proposal.csv", help="the last proposal"),
    ],
)
def refine_search(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.refined import refine

    space, targets = study.parameters, study.targets
    files = (args.network, args.dataset, args.near)
    table3 = study.published("table3.csv")
    defined = (study.definitions, args.config)
    summary = refine.run_search(*files, space, targets, study.config, table3, args.out, *defined)
    print(summary["message"])


@family.verb(
    "list the parameter sets of a round: the representative solution in blocks of seeds, and its neighbours",
    example="--round 0",
    out=ROUND,
    options=[
        Option("--round", type=int, required=True, help="number of the round, from 0"),
        FEASIBLE.but(help="what the search wrote"),
        NETWORK.but(help="the surrogate that it searched"),
    ],
)
def refine_propose(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.refined import refine

    space, targets = study.parameters, study.targets
    seed, out = study.config["design"]["seed"], Path(args.out) / "proposal.csv"
    files, defined = (args.feasible, args.network), (study.definitions, args.config)
    refine.run_propose(*files, space, targets, study.config["refine"], args.round, seed, out, *defined)


@family.verb(
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


@family.verb(
    "collect all rounds in one table; tell why the loop stopped and what may be claimed",
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
