"""Subcommands for the uncertainty of the answer: noise, posterior, sensitivity, next."""

import argparse

from repose.cli.berries import BERRY_AND_PARTICLE, load_grain_and_particle
from repose.cli.options import DATASET, FEASIBLE, NETWORK, RUNS
from repose.cli.registry import Option, subcommand
from repose.config.pipeline import PipelineConfig

PREDICTIONS = Option(
    "--predictions",
    default="results/network/predictions.csv",
    help="file of the subcommand network",
)


@subcommand(RUNS, out="results/noise")
def noise(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Split the variance of the responses into within and between samples.

    The subcommand also prints what more seeds would gain.

    Examples
    --------
    $ repose noise --runs results/runs.csv
    """
    from repose.calibrate.uncertainty import noise

    summary = noise.write_noise_floor(args.runs, study.targets, args.out)
    print(noise.describe_noise_floor(summary, study.targets))


@subcommand(NETWORK, PREDICTIONS, DATASET, RUNS, FEASIBLE, out="results/posterior")
def posterior(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Sample the posterior of the free parameters.

    The subcommand names the parameters that the measurements do not determine.

    Examples
    --------
    $ repose posterior --network results/network/network.json
    """
    from repose.calibrate.uncertainty import posterior

    files = posterior.InputFiles(
        network=args.network,
        predictions=args.predictions,
        dataset=args.dataset,
        runs=args.runs,
        feasible=args.feasible,
        table3=study.published("table3.csv"),
    )
    summary = posterior.infer_from_files(
        files,
        parameters=study.parameters,
        targets=study.targets,
        definitions=study.definitions,
        settings=study.settings.posterior,
        out_dir=args.out,
        source=args.config,
    )
    print(posterior.describe_posterior(summary))


@subcommand(NETWORK, out="results/sensitivity")
def sensitivity(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Compute Sobol indices of the responses, with intervals, and main effects.

    Examples
    --------
    $ repose sensitivity --network results/network/network.json
    """
    from repose.calibrate.uncertainty import sensitivity

    table = sensitivity.analyse_from_file(
        args.network,
        parameters=study.parameters,
        targets=study.targets,
        definitions=study.definitions,
        settings=study.settings.sensitivity,
        out_dir=args.out,
        source=args.config,
    )
    print(sensitivity.describe_indices(table))


@subcommand(
    Option(
        "--draws",
        default="results/posterior/draws.csv",
        help="file of the subcommand posterior",
    ),
    out="results/next/samples.csv",
)
def plausible(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Choose parameter sets from the posterior for the subcommand next.

    The sets are then simulated in all bench tests.

    Examples
    --------
    $ repose stage plausible --draws results/posterior/draws.csv
    """
    from repose.stages import next_measurement

    next_measurement.draw_plausible_sets(
        args.draws, study.settings.posterior.seed, args.out
    )


@subcommand(
    Option(
        "pours",
        nargs="+",
        help="files NAME.pours.json, the saved runs of the parameter sets that "
        "`repose stage plausible` chose",
    ),
    *BERRY_AND_PARTICLE,
    out="results/next",
)
def next(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Rank further responses of saved runs by their expected information.

    Examples
    --------
    $ repose next results/next/heaps/001.pours.json results/next/heaps/002.pours.json
    """
    from repose.bench import Scene
    from repose.stages import next_measurement

    # A measurement finds the responses of the targets. To measure all responses of the
    # runs, replace the targets by all responses. It needs no contact parameters.
    grain, particle = load_grain_and_particle(study, args.berry, args.particle)
    config = study.config | {"targets": next_measurement.list_all_responses()}
    scene = Scene.of(config, parameters={}, grain=grain, particle=particle)
    table = next_measurement.write_ranking(
        args.pours,
        scene,
        args.out,
        targets=study.targets,
        discrepancy_percent=study.settings.posterior.discrepancy_percent,
    )
    print(next_measurement.format_ranking(table))
