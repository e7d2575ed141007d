"""Options that several verbs take, and files that a verb reads by name."""

import argparse
from collections.abc import Iterable, Mapping

from repose.cli.registry import Option
from repose.core.errors import InputError

BERRY = Option("--berry", default="results/berry/berry.json", help="file of the verb berry")
SAMPLES = Option("--samples", default="results/design/samples.csv", help="file of the verb design", recorded=False)
DATASET = Option("--dataset", default="results/dataset.csv", help="file of the verb dataset")
RUNS = Option("--runs", default="results/runs.csv", help="file of the verb dataset: single runs")
NETWORK = Option("--network", default="results/network/network.json", help="file of the verb network")
FEASIBLE = Option("--feasible", default="results/miga/feasible.csv", help="file of the verb miga")
JSON = Option("--json", action="store_true", help="print as JSON")


def file_options(files: Mapping[str, str], prefix: str = "") -> list[Option]:
    """Make an option for each file: names with underscores, their default paths; `prefix` begins the help."""
    return [
        Option(f"--{name.replace('_', '-')}", default=path, help=f"{prefix}({path})") for name, path in files.items()
    ]


def chosen_files(args: argparse.Namespace, files: Iterable[str]) -> dict[str, str]:
    """Return the paths of the options of `file_options`, by the same names."""
    return {name: getattr(args, name) for name in files}


def pairs(entries: Iterable[str], option: str) -> dict[str, str]:
    """Split the NAME=VALUE entries of an option; InputError for a bad entry or a name given twice."""
    values: dict[str, str] = {}
    for entry in entries:
        name, equals, value = entry.partition("=")
        if not equals or not name or not value or name in values:
            raise InputError("command line", option, entry, "NAME=VALUE, each name once")
        values[name] = value
    return values
