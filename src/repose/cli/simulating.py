"""Stages of a study with the user's own program: its runs, and their responses."""

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.cli.options import SAMPLES
from repose.cli.parameter_sets import STUDY_SEEDS
from repose.cli.registry import Option, load_study, subcommand
from repose.common.errors import InputError
from repose.common.statuses import describe_failure
from repose.config.pipeline import PipelineConfig

if TYPE_CHECKING:
    from repose.stages.settings import SimulatorSettings

SAMPLE = Option("--sample", type=int, default=1, help="number of the sample (1)")
PURPOSE = STUDY_SEEDS[1]


def _load_external_study(args: argparse.Namespace) -> PipelineConfig:
    """Load a study with the user's own program; raise InputError for any other study."""
    study = load_study(args)
    _require_program(args, study)
    return study


def _require_program(
    args: argparse.Namespace, study: PipelineConfig
) -> "SimulatorSettings":
    """Return the section `simulator` of a study.

    Raises
    ------
    InputError
        If the study has no such section.
    """
    if study.simulator is None:
        raise InputError(
            args.config,
            key="simulator",
            value=None,
            allowed="a section with the command of a program (`repose docs simulators`)",
        )
    return study.simulator


@subcommand(
    SAMPLES,
    SAMPLE,
    Option("--run", type=int, default=1, help="number of the run of the sample (1)"),
    PURPOSE,
    out="results/runs/001",
    study=_load_external_study,
    runs="measured",
)
def simulate(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Run the study's own program for one sample.

    A run that fails is recorded with its reason.

    Examples
    --------
    $ repose stage simulate --samples results/design/samples.csv --sample 1 --run 1
    """
    from repose.stages import simulate
    from repose.stages.parameter_sets import read_sample

    parameters = read_sample(args.samples, args.sample, study.parameter_names)
    study_seed = study.settings.design.seed
    record = simulate.run_once(
        _require_program(args, study),
        parameters,
        sample=args.sample,
        run=args.run,
        seed=simulate.draw_seed(study_seed, args.purpose, args.sample, args.run),
        out_dir=args.out,
    )
    print(_describe_ending(record))


def _find_run_records(args: argparse.Namespace) -> Iterator[Path]:
    """Yield the records of all runs in the folders that the option `runs` names."""
    from repose.stages import simulated

    for records in simulated.list_record_files(args.runs).values():
        yield from records


@subcommand(
    Option(
        "runs",
        nargs="+",
        find_files=_find_run_records,
        metavar="FOLDER=COUNT",
        help="folder of a sample, with the number of its runs",
    ),
    Option("--out", required=True, help="folder for SAMPLE.json", recorded=False),
    study=_load_external_study,
    runs="measured",
)
def measure_simulated(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Read the responses of a program's runs, or measure their piles of particles.

    Examples
    --------
    $ repose stage measure_simulated results/runs/001=2 results/runs/002=2 --out results/runs
    """
    from repose.stages import simulated

    for folder, records in simulated.list_record_files(args.runs).items():
        job = simulated.measure_sample(
            records,
            Path(args.out) / f"{folder.name}.json",
            settings=_require_program(args, study),
            responses=study.targets.names,
            measure=study.settings.measure,
        )
        for run in job["runs"]:
            print(f"{folder}, seed {run['seed']}: {_describe_ending(run)}")


def _describe_ending(run: Mapping[str, Any]) -> str:
    """Describe how a run ended: ``ok``, or why it failed."""
    from repose.stages.simulate import OK

    if run["status"] == OK:
        return OK
    return describe_failure(run["status"], run["reason"])
