"""Verbs that compare parts of the method, and the whole method, with alternatives."""

import argparse

from repose.cli.options import DATASET, NETWORK, RUNS, chosen_files, file_options
from repose.cli.registry import Family
from repose.config.study import Study

POOL_FILES = {
    f"{points}_{table}": f"results/{place}{table}.csv"
    for points, place in (("main", ""), ("pool", "pool/"), ("fresh", "pool/fresh_"))
    for table in ("dataset", "runs")
}
COMPARED = {
    "sampling": "results/comparison/sampling.csv",
    "surrogates": "results/comparison/surrogates.csv",
    "search": "results/comparison/search_methods.csv",
    "whole": "results/comparison/whole.csv",
}

family = Family()


@family.verb(
    "compare searches on the trained network: evaluations, and which solutions they find",
    example="--network results/network/network.json",
    out="results/comparison",
    options=[NETWORK],
)
def compare_search(args: argparse.Namespace) -> None:
    from repose.studies.comparison import search

    study = Study.load(args.config)
    targets, space = study.targets, study.parameters
    settings, section = study.config["compare_search"], study.config["miga"]
    table = search.run(args.network, space, targets, settings, section, args.out)
    print(search.message(table))


@family.verb(
    "compare the method with a response surface and a local search, for equal numbers of simulations",
    example="--dataset results/dataset.csv --runs results/runs.csv",
    out="results/comparison",
    options=[
        DATASET.but(nargs="+", default=["results/dataset.csv"]),
        RUNS.but(nargs="+", default=["results/runs.csv"], help="runs.csv of each dataset, in the same order"),
    ],
)
def compare_whole(args: argparse.Namespace) -> None:
    from repose.studies.comparison import whole

    study = Study.load(args.config)
    targets, space = study.targets, study.parameters
    section = study.config["compare_whole"]
    network = _network(study.config) | {key: section[key] for key in ("starts", "epochs")}
    settings = section | {"network": network, "miga": study.config["miga"] | {"rounds": section["rounds"]}}
    samples = whole.read_samples(args.dataset, args.runs, space, targets.names)
    table = whole.run(samples, space, targets, settings, args.out)
    print(whole.message(table, targets))


@family.verb(
    "test the network, trained on growing sets of points, at points that no fit has seen",
    out="results/comparison",
    options=file_options(POOL_FILES),
)
def compare_accuracy(args: argparse.Namespace) -> None:
    from repose.studies.comparison import accuracy, points

    study = Study.load(args.config)
    names = study.targets.names
    sets = points.read_sets(chosen_files(args, POOL_FILES), names)
    print(accuracy.message(accuracy.run(sets, names, _network(study.config), args.out)))


@family.verb(
    "compare surrogates with equal numbers of simulations, at points that no fit has seen",
    out="results/comparison",
    options=file_options(POOL_FILES),
)
def compare_surrogates(args: argparse.Namespace) -> None:
    from repose.studies.comparison import points, surrogates

    study = Study.load(args.config)
    names = study.targets.names
    sets = points.read_sets(chosen_files(args, POOL_FILES), names)
    surrogates.run(sets, names, _network(study.config), study.config["pool"]["seed"], args.out)


@family.verb(
    "compare designs, and many seeds per point with many points; with emulated and with real pours",
    out="results/comparison",
    options=file_options(POOL_FILES),
)
def compare_sampling(args: argparse.Namespace) -> None:
    from repose.studies.comparison import points, sampling

    study = Study.load(args.config)
    names, space = study.targets.names, study.parameters
    sets = points.read_sets(chosen_files(args, POOL_FILES), names)
    seeds, seed = study.config["funnel"]["seeds"], study.config["pool"]["seed"]
    sampling.run(sets, names, space, _network(study.config), seeds, seed, args.out)


@family.verb(
    "collect all comparisons in one table",
    out="results/comparison",
    config=False,
    options=file_options(COMPARED),
)
def compare_all(args: argparse.Namespace) -> None:
    from repose.studies.comparison import summary

    print(f"{len(summary.run(chosen_files(args, COMPARED), args.out))} rows")


def _network(config):
    """Settings of the configured network, or of one where the surrogate is another."""
    kind = config["surrogate"]
    return config["network"] | {"surrogate": kind if kind.startswith("network") else "network"}
