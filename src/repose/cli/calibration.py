"""Verbs of the calibration: heaps to a dataset, a network, its inversion, and the answer simulated again."""

from pathlib import Path

from repose.cli.options import DATASET, FEASIBLE, NETWORK, RUNS, SAMPLES, TABLE3
from repose.cli.registry import Family, Option
from repose.config import loader
from repose.core.targets import section_of

SUPPORT = Option("--dataset", help="dataset.csv; with it solutions beyond its samples carry a warning")

family = Family()


@family.verb(
    "heaps to one table: responses with standard errors, failures with their reasons",
    example="results/heaps/???.json --out results",
    out="results",
    config=False,
    options=[
        Option("heaps", nargs="+", help="JSON files that the verb measure_heap or heap wrote"),
        SAMPLES.but(help="the design"),
        Option("--prefix", default="", help="put before the names of the tables"),
    ],
)
def dataset(args):
    from repose.chain import dataset

    dataset.run(args.samples, args.heaps, args.out, args.prefix)


@family.verb(
    "train the BP network with Bayesian regularisation",
    example="--dataset results/dataset.csv --runs results/runs.csv",
    out="results/network",
    options=[DATASET, RUNS],
)
def network(args):
    from repose.chain import train

    train.run(args.dataset, args.runs, loader.load(args.config)["network"], args.out)


@family.verb(
    "invert the network with the multi-island genetic algorithm (Eq. 11-12)",
    example="--network results/network/network.json",
    out="results/miga",
    options=[NETWORK, TABLE3, SUPPORT],
)
def miga(args):
    from repose.search import miga

    config = loader.load(args.config)
    support = _support(args.dataset, config)
    summary = miga.run(
        args.network, config["parameters"], section_of(config), config["miga"], args.table3, args.out, support
    )
    print(summary["message"])


@family.verb(
    "list what to simulate again: representative solution, others spread over the cloud, published ones",
    example="--feasible results/miga/feasible.csv",
    out="results/validation",
    options=[FEASIBLE],
)
def solutions(args):
    from repose.chain import validate

    config = loader.load(args.config)
    section = config["validation"]
    out = Path(args.out) / "solutions.csv"
    validate.write_solutions(
        args.feasible, section["published"], config["parameters"], section["solutions"], out
    )


@family.verb(
    "predicted beside simulated: our solutions (Table 4), and the published ones in our simulator",
    example="results/validation/heaps/???.json",
    out="results/validation",
    options=[
        Option("heaps", nargs="+", help="JSON files that measure_heap wrote, one for each solution"),
        Option("--solutions", default="results/validation/solutions.csv", help="what `solutions` wrote"),
        SUPPORT,
    ],
)
def validate(args):
    from repose.chain import validate

    config = loader.load(args.config)
    published = config["validation"]["published"]
    support = _support(args.dataset, config)
    validate.run(args.solutions, args.heaps, published, section_of(config), args.out, support)


def _support(dataset, config):
    """The samples that tell an extrapolation, or None without a dataset."""
    from repose.core.parameter_space import ParameterSpace
    from repose.surrogate.support import Support

    return Support.of_dataset(dataset, ParameterSpace.of(config["parameters"])) if dataset else None
