"""Verbs of the strategies: each analysis writes the parameter sets of the next step."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.registry import Option, verb

if TYPE_CHECKING:
    from repose.config.study import Study

FOLDER = "results/response_surface"
SEQUENTIAL = "results/sequential"


def _print_deviations(table):
    """The simulated answer of a strategy beside the targets, a line for each response."""
    for row in table.to_dict("records"):
        print(f"{row['response']}: {row['simulated']:.2f}, {row['deviation_percent']:+.2f} % off the target")


@verb(
    "response surface: list the parameter sets of the Plackett-Burman screening",
    example="--config config/quick.yaml",
    out=f"{FOLDER}/screening",
)
def response_design(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.response_surface import files

    files.run_step([], study, args.out, Path(args.out) / "samples.csv")


@verb(
    "response surface: analyse the last step, list the parameter sets of the next one",
    example=f"{FOLDER}/screening --out {FOLDER}/screening",
    out=f"{FOLDER}/screening",
    options=[
        Option("steps", nargs="+", help="folders of all steps so far: dataset.csv and runs.csv"),
        Option(
            "--next",
            default=f"{FOLDER}/ascent/samples.csv",
            help="samples of the next step, to write",
            recorded=False,
        ),
    ],
)
def response_step(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.response_surface import files

    print(files.run_step(args.steps, study, args.out, args.next))


@verb(
    "response surface: compare the simulated optimum with its prediction and the targets",
    example=f"{FOLDER}/screening {FOLDER}/ascent {FOLDER}/surface {FOLDER}/check",
    out=f"{FOLDER}/check",
    options=[Option("steps", nargs="+", help="folders of all steps, the check's last")],
)
def response_check(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.response_surface import files

    _print_deviations(files.run_check(args.steps, study, args.out))


@verb(
    "sequential: list the parameter sets of the space-filling start",
    example="--config config/quick.yaml",
    out=f"{SEQUENTIAL}/batch_0",
)
def sequential_start(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.sequential import files

    files.run_start(study, Path(args.out) / "samples.csv")


@verb(
    "sequential: list the next batch of parameter sets, or the answer with the probability that it meets the targets",
    example=f"{SEQUENTIAL}/batch_0",
    out=f"{SEQUENTIAL}/batch_0",
    options=[Option("batches", nargs="+", help="folders of all batches so far: dataset.csv and runs.csv")],
)
def sequential_batch(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.sequential import files

    found = files.run_batch(args.batches, study, args.out)
    print(
        f"{found['pours']} pours; the best point meets the targets with probability {found['probability']:.2f}"
    )
    print(f"some parameter set meets them with probability {found['in_reach']:.2f}")
    print(found["why"])


@verb(
    "sequential: compare the simulated answer with its prediction and the targets, collect all batches",
    example=f"{SEQUENTIAL}/batch_0",
    out=SEQUENTIAL,
    options=[
        Option("batches", nargs="+", help="folders of all batches, with what sequential_batch wrote there"),
        Option("--dataset", default=f"{SEQUENTIAL}/check/dataset.csv", help="of the answer's pours"),
        Option("--runs", default=f"{SEQUENTIAL}/check/runs.csv", help="of the answer: single runs"),
    ],
)
def sequential_check(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.sequential import files

    table = files.run_check(args.batches, args.dataset, args.runs, study, args.out)
    _print_deviations(table)
