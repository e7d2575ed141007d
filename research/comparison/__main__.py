"""Each part of the method beside its alternatives, at equal budgets; `pool` has the pours."""

from research.comparison import (
    accuracy,
    points,
    sampling,
    search,
    summary,
    surrogates,
    whole,
)
from research.script import Script, option

OUT = "results/comparison"
POOL_FILES = {
    f"{name}_{table}": f"results/{place}{table}.csv"
    for name, place in (("main", ""), ("pool", "pool/"), ("fresh", "pool/fresh_"))
    for table in ("dataset", "runs")
}
COMPARED = {name: f"{OUT}/{name}.csv" for name in ("sampling", "surrogates", "whole")}
COMPARED["search"] = f"{OUT}/search_methods.csv"

script = Script("comparison", __doc__)


def files(paths):
    """Make an option for each file, with its default path."""
    return [
        option(f"--{name.replace('_', '-')}", default=path)
        for name, path in paths.items()
    ]


def pool_of(args):
    """Read main design, pool and fresh points, and the names of their responses."""
    names = args.study.targets.names
    return points.read_sets(
        {name: getattr(args, name) for name in POOL_FILES}, names
    ), names


def network_of(config):
    """Return the settings of the configured network, or of one where the surrogate is another."""
    kind = config["surrogate"]
    return config["network"] | {
        "surrogate": kind if kind.startswith("network") else "network"
    }


@script.part("accuracy", OUT, *files(POOL_FILES))
def compare_accuracy(args, config):
    """Test the network, trained on growing sets of points, at points that no fit has seen."""
    return accuracy.message(accuracy.run(*pool_of(args), network_of(config), args.out))


@script.part("surrogates", OUT, *files(POOL_FILES))
def compare_surrogates(args, config):
    """Compare surrogates with equal numbers of simulations, at points that no fit has seen."""
    surrogates.run(*pool_of(args), network_of(config), config["pool"]["seed"], args.out)


@script.part("sampling", OUT, *files(POOL_FILES))
def compare_sampling(args, config):
    """Compare designs, and many seeds per point with many points; with emulated and with real pours."""
    space = args.study.parameters
    seeds = config["funnel"]["seeds"]
    settings = network_of(config)
    seed = config["pool"]["seed"]
    sampling.run(*pool_of(args), space, settings, seeds, seed, args.out)


@script.part("search", OUT, option("--network", default="results/network/network.json"))
def compare_search(args, config):
    """Compare searches on the trained network: evaluations, and which solutions they find."""
    targets = args.study.targets
    space = args.study.parameters
    table = search.run(
        args.network, space, targets, config["compare_search"], config["miga"], args.out
    )
    return search.message(table)


@script.part(
    "whole",
    OUT,
    option("--dataset", nargs="+", default=["results/dataset.csv"]),
    option(
        "--runs",
        nargs="+",
        default=["results/runs.csv"],
        help="of each dataset, in the same order",
    ),
)
def compare_whole(args, config):
    """Compare the method with a response surface and a local search, for equal numbers of simulations."""
    targets = args.study.targets
    space = args.study.parameters
    settings = config["compare_whole"]
    settings |= {
        "network": network_of(config)
        | {key: settings[key] for key in ("starts", "epochs")}
    }
    settings |= {"miga": config["miga"] | {"rounds": settings["rounds"]}}
    samples = whole.read_samples(args.dataset, args.runs, space, targets.names)
    return whole.message(
        whole.run(samples, space, targets, settings, args.out), targets
    )


@script.part("all", OUT, *files(COMPARED))
def compare_all(args, config):
    """Collect all comparisons in one table."""
    return f"{len(summary.run({name: getattr(args, name) for name in COMPARED}, args.out))} rows"


if __name__ == "__main__":
    script.run()
