"""Verbs of the strategies: each analysis writes the parameter sets of the next step."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.cli.registry import Family, Option
from repose.core.parameter_space import ParameterSpace
from repose.core.targets import Targets

if TYPE_CHECKING:
    from repose.config.study import Study

FOLDER = "results/response_surface"
SEQUENTIAL = "results/sequential"

family = Family()


def _options(step):
    """Files of a step."""
    return [
        Option("--samples", default=f"{FOLDER}/{step}/samples.csv", help="what the step poured"),
        Option("--dataset", default=f"{FOLDER}/{step}/dataset.csv", help="what the verb dataset wrote of it"),
    ]


def _print_deviations(table):
    """The simulated answer of a strategy beside the targets, a line for each response."""
    for row in table.to_dict("records"):
        print(f"{row['response']}: {row['simulated']:.2f}, {row['deviation_percent']:+.2f} % off the target")


def _read(study: "Study") -> tuple[ParameterSpace, Targets, dict[str, Any]]:
    """Space, targets and section of a study."""
    return study.parameters, study.targets, study.config["response_surface"]


@family.verb(
    "response surface: list the parameter sets of the Plackett-Burman screening",
    example="--config config/quick.yaml",
    out=f"{FOLDER}/screening",
)
def response_design(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.response_surface import files

    space, _, section = _read(study)
    files.run_design(space, section, Path(args.out) / "samples.csv")


@family.verb(
    "response surface: analyse the screening, choose the parameters that matter, list the steepest ascent",
    example=f"--out {FOLDER}/screening",
    out=f"{FOLDER}/screening",
    options=[
        *_options("screening"),
        Option("--next", default=f"{FOLDER}/ascent/samples.csv", help="samples of the ascent, to write"),
    ],
)
def response_screening(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.response_surface import files

    found = files.run_screening(args.samples, args.dataset, *_read(study), args.out, args.next)
    print(f"kept {', '.join(found['kept'])}; dropped {', '.join(found['dropped']) or 'none'}")


@family.verb(
    "response surface: find the best point of the ascent, list the design around it",
    example=f"--out {FOLDER}/ascent",
    out=f"{FOLDER}/ascent",
    options=[
        *_options("ascent"),
        Option("--next", default=f"{FOLDER}/surface/samples.csv", help="samples of the surface, to write"),
    ],
)
def response_ascent(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.response_surface import files

    points = files.run_ascent(args.samples, args.dataset, *_read(study), args.out, args.next)
    best = points[points["best"]].iloc[0]
    print(f"sample {best['sample']:g} is nearest to the targets, {best['error_percent']:.2f} % off")


@family.verb(
    "response surface: fit the surfaces, analyse their variance, find their optimum",
    example=f"--out {FOLDER}/surface",
    out=f"{FOLDER}/surface",
    options=[
        *_options("surface"),
        Option("--next", default=f"{FOLDER}/check/samples.csv", help="samples of the check, to write"),
    ],
)
def response_surface(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.response_surface import files

    found = files.run_surface(args.samples, args.dataset, *_read(study), args.out, args.next)
    print(f"the surfaces {'meet' if found['met'] else 'do not meet'} the targets: {found['parameters']}")


@family.verb(
    "response surface: compare the simulated optimum with its prediction and the targets",
    example=f"{FOLDER}/check/runs.csv",
    out=f"{FOLDER}/check",
    options=[
        Option("runs", nargs="+", help="runs.csv of all steps, the check's last"),
        Option("--predictions", default=f"{FOLDER}/surface/predictions.csv", help="of the optimum"),
        Option("--optimum", default=f"{FOLDER}/surface/optimum.json", help="of the surface"),
        Option("--surface", default=f"{FOLDER}/surface", help="folder with samples.csv and dataset.csv"),
        Option("--dataset", default=f"{FOLDER}/check/dataset.csv", help="of the check"),
    ],
)
def response_check(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.response_surface import files

    given = (args.predictions, args.optimum, args.surface, args.dataset, args.runs)
    table = files.run_check(*given, study.config, args.out)
    _print_deviations(table)


@family.verb(
    "sequential: list the parameter sets of the space-filling start",
    example="--config config/quick.yaml",
    out=f"{SEQUENTIAL}/batch_0",
)
def sequential_start(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies.sequential import files

    files.run_start(study, Path(args.out) / "samples.csv")


@family.verb(
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


@family.verb(
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
