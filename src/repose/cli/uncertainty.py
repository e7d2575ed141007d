"""Verbs for the uncertainty of the answer: noise, posterior, sensitivity, next."""

import argparse

from repose.cli.berries import BERRY_AND_PARTICLE, berry_and_particle
from repose.cli.options import NETWORK, RUNS
from repose.cli.registry import Option, verb
from repose.config.study import Study

POSTERIOR_FILES = {
    "network": "results/network/network.json",
    "predictions": "results/network/predictions.csv",
    "dataset": "results/dataset.csv",
    "runs": "results/runs.csv",
    "feasible": "results/miga/feasible.csv",
}


@verb(
    "split the variance of the responses into within and between samples; print the gain of more seeds",
    example="--runs results/runs.csv",
    out="results/noise",
    options=[RUNS],
)
def noise(args: argparse.Namespace, study: Study) -> None:
    from repose.studies import noise

    print(noise.message(noise.run(args.runs, study.targets, args.out), study.targets))


@verb(
    "sample the posterior of the free parameters; name the parameters that the measurements do not determine",
    example="--network results/network/network.json",
    out="results/posterior",
    options=[Option(f"--{name}", default=path, help=f"({path})") for name, path in POSTERIOR_FILES.items()],
)
def posterior(args: argparse.Namespace, study: Study) -> None:
    from repose.studies import posterior

    files = {name: getattr(args, name) for name in POSTERIOR_FILES} | {"table3": study.published("table3.csv")}
    print(posterior.message(posterior.run(files, study, args.out, args.config)))


@verb(
    "compute Sobol indices of the responses, with intervals, and main effects",
    example="--network results/network/network.json",
    out="results/sensitivity",
    options=[NETWORK],
)
def sensitivity(args: argparse.Namespace, study: Study) -> None:
    from repose.studies import sensitivity

    print(sensitivity.message(sensitivity.run(args.network, study, args.out, args.config)))


@verb(
    "choose parameter sets of the posterior, to be run in all bench tests for the verb next",
    example="--draws results/posterior/draws.csv",
    out="results/next/samples.csv",
    options=[Option("--draws", default="results/posterior/draws.csv", help="file of the verb posterior")],
)
def plausible(args: argparse.Namespace, study: Study) -> None:
    from repose.studies import next_measurement

    next_measurement.plausible_sets(args.draws, study.settings.posterior.seed, args.out)


@verb(
    "rank further responses of saved runs by the information that each is expected to add",
    example="results/next/heaps/001.pours.json results/next/heaps/002.pours.json",
    out="results/next",
    options=[
        Option("pours", nargs="+", help="NAME.pours.json files of the sets of the stage plausible"),
        *BERRY_AND_PARTICLE,
    ],
)
def next(args: argparse.Namespace, study: Study) -> None:
    from repose.studies import next_measurement

    grain, particle = berry_and_particle(study, args.berry, args.particle)
    print(next_measurement.message(next_measurement.run(args.pours, study, particle, grain, args.out)))
