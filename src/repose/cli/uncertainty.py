"""Verbs for the uncertainty of the answer: noise, posterior, sensitivity."""

import argparse
from pathlib import Path

from repose.cli.options import NETWORK, RUNS, chosen_files, file_options
from repose.cli.registry import Family
from repose.config.definitions import definitions_of
from repose.config.study import Study
from repose.core.published import beside

POSTERIOR_FILES = {
    "network": "results/network/network.json",
    "predictions": "results/network/predictions.csv",
    "dataset": "results/dataset.csv",
    "runs": "results/runs.csv",
    "feasible": "results/miga/feasible.csv",
}

family = Family()


@family.verb(
    "split the variance of the responses into within and between samples; print the gain of more seeds",
    example="--runs results/runs.csv",
    out="results/noise",
    options=[RUNS],
)
def noise(args: argparse.Namespace) -> None:
    from repose.studies import noise

    targets = Study.load(args.config).targets
    print(noise.message(noise.run(args.runs, targets, args.out), targets))


@family.verb(
    "sample the posterior of the free parameters; name those that the measurements do not determine",
    example="--network results/network/network.json",
    out="results/posterior",
    options=file_options(POSTERIOR_FILES),
)
def posterior(args: argparse.Namespace) -> None:
    from repose.studies import posterior

    study = Study.load(args.config)
    space, targets = study.parameters, study.targets
    files: dict[str, str | Path | None] = {**chosen_files(args, POSTERIOR_FILES)}
    files["table3"] = beside(study.config["validation"]["published"], "table3.csv")
    defined = (definitions_of(study.config), args.config)
    summary = posterior.run(files, space, targets, study.config["posterior"], args.out, *defined)
    print(posterior.message(summary))


@family.verb(
    "compute Sobol indices of the responses, with intervals, and main effects",
    example="--network results/network/network.json",
    out="results/sensitivity",
    options=[NETWORK],
)
def sensitivity(args: argparse.Namespace) -> None:
    from repose.studies import sensitivity

    study = Study.load(args.config)
    space, targets = study.parameters, study.targets
    defined = (definitions_of(study.config), args.config)
    table = sensitivity.run(args.network, space, targets, study.config["sensitivity"], args.out, *defined)
    print(sensitivity.message(table))
