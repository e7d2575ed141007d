"""Verbs that set parts of the method, and the whole of it, beside their alternatives."""

from repose.cli.options import DATASET, NETWORK, RUNS, chosen_files, file_options
from repose.cli.registry import Family
from repose.config import loader
from repose.core.targets import section_of

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
    "searches beside each other on the trained network: evaluations, and which solutions they find",
    example="--network results/network/network.json",
    out="results/comparison",
    options=[NETWORK],
)
def compare_search(args):
    from repose.studies.comparison import search

    config = loader.load(args.config)
    parameters, target, section = config["parameters"], section_of(config), config["compare_search"]
    table = search.run(args.network, parameters, target, section, config["miga"], args.out)
    print(search.message(table))


@family.verb(
    "the method beside a response surface with a local search, for equal numbers of simulations",
    example="--dataset results/dataset.csv --runs results/runs.csv",
    out="results/comparison",
    options=[
        DATASET.but(nargs="+", default=["results/dataset.csv"]),
        RUNS.but(nargs="+", default=["results/runs.csv"], help="as many: single runs of the same"),
    ],
)
def compare_whole(args):
    from repose.studies.comparison import whole

    config = loader.load(args.config)
    section = config["compare_whole"]
    section |= {"network": config["network"] | {key: section[key] for key in ("starts", "epochs")}}
    section |= {"miga": config["miga"] | {"rounds": section["rounds"]}}
    table = whole.run(args.dataset, args.runs, config["parameters"], section_of(config), section, args.out)
    print(whole.message(table))


@family.verb(
    "accuracy of the network at points that no fit has seen, over what it is trained on",
    out="results/comparison",
    options=file_options(POOL_FILES),
)
def compare_accuracy(args):
    from repose.studies.comparison import accuracy

    files = chosen_files(args, POOL_FILES)
    print(accuracy.message(accuracy.run(files, loader.load(args.config)["network"], args.out)))


@family.verb(
    "surrogates at equal budgets of simulations, judged at points that no fit has seen",
    out="results/comparison",
    options=file_options(POOL_FILES),
)
def compare_surrogates(args):
    from repose.studies.comparison import surrogates

    config, files = loader.load(args.config), chosen_files(args, POOL_FILES)
    surrogates.run(files, config["network"], config["pool"]["seed"], args.out)


@family.verb(
    "designs, and points against seeds: repetitions emulated from the pool, real ones beside",
    out="results/comparison",
    options=file_options(POOL_FILES),
)
def compare_sampling(args):
    from repose.studies.comparison import sampling

    config, files = loader.load(args.config), chosen_files(args, POOL_FILES)
    seeds, seed = config["funnel"]["seeds"], config["pool"]["seed"]
    sampling.run(files, config["parameters"], config["network"], seeds, seed, args.out)


@family.verb(
    "all comparisons in one table",
    out="results/comparison",
    config=False,
    options=file_options(COMPARED),
)
def compare_all(args):
    from repose.studies.comparison import summary

    print(f"{len(summary.run(chosen_files(args, COMPARED), args.out))} rows")
