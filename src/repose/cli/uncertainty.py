"""Verbs that tell how sure the answer is."""

from repose.cli.options import NETWORK, PUBLISHED, RUNS, chosen_files, file_options
from repose.cli.registry import Family
from repose.config import loader
from repose.core.targets import section_of

POSTERIOR_FILES = {
    "network": "results/network/network.json",
    "metrics": "results/network/metrics.json",
    "predictions": "results/network/predictions.csv",
    "dataset": "results/dataset.csv",
    "runs": "results/runs.csv",
    "feasible": "results/miga/feasible.csv",
    "table3": str(PUBLISHED / "table3.csv"),
}

family = Family()


@family.verb(
    "variance of both responses within and between samples, what seeds buy, what a predictor can reach",
    example="--runs results/runs.csv",
    out="results/noise",
    options=[RUNS],
)
def noise(args):
    from repose.studies import noise

    print(noise.message(noise.run(args.runs, section_of(loader.load(args.config)), args.out)))


@family.verb(
    "posterior of the six parameters given the physical piles, with what they do not determine",
    example="--network results/network/network.json",
    out="results/posterior",
    options=file_options(POSTERIOR_FILES),
)
def posterior(args):
    from repose.studies import posterior

    config = loader.load(args.config)
    files = chosen_files(args, POSTERIOR_FILES)
    summary = posterior.run(files, config["parameters"], section_of(config), config["posterior"], args.out)
    print(posterior.message(summary))


@family.verb(
    "Sobol indices of both responses on the network, with intervals, and main effects",
    example="--network results/network/network.json",
    out="results/sensitivity",
    options=[NETWORK],
)
def sensitivity(args):
    from repose.studies import sensitivity

    config = loader.load(args.config)
    table = sensitivity.run(args.network, config["parameters"], config["sensitivity"], args.out)
    print(sensitivity.message(table))
