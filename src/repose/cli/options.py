"""Options that several subcommands share."""

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path

from repose.cli.registry import Option
from repose.common.errors import InputError

BERRY = Option(
    "--berry", default="results/berry/berry.json", help="file of the subcommand berry"
)
SAMPLES = Option(
    "--samples",
    default="results/design/samples.csv",
    help="file of the subcommand design",
    recorded=False,
)
DATASET = Option(
    "--dataset", default="results/dataset.csv", help="file of the subcommand dataset"
)
RUNS = Option(
    "--runs",
    default="results/runs.csv",
    help="file of the subcommand dataset: single runs",
)
NETWORK = Option(
    "--network",
    default="results/network/network.json",
    help="file of the subcommand network",
)
FEASIBLE = Option(
    "--feasible",
    default="results/miga/feasible.csv",
    help="file of the subcommand miga",
)
OPTIMISM = Option(
    "--optimism",
    help="file of the subcommand optimism; adds the expected optimism to the "
    "predictions",
)
JSON = Option("--json", action="store_true", help="print as JSON")


def _find_files_of_pairs(args: argparse.Namespace) -> Iterator[Path]:
    """Yield the files of --input, whose values have the form NAME=PATH."""
    for entry in args.input:
        _name, _equals_sign, path = entry.partition("=")
        yield Path(path)


INPUT = Option(
    "--input",
    find_files=_find_files_of_pairs,
    action="append",
    default=[],
    metavar="NAME=PATH",
    help="a file that is shown",
)


def split_pairs(entries: Iterable[str], option: str) -> dict[str, str]:
    """Split the NAME=VALUE entries of an option.

    Parameters
    ----------
    entries : iterable of str
        The entries.
    option : str
        Name of the option, for a message.

    Returns
    -------
    dict
        Values by name.

    Raises
    ------
    InputError
        If an entry is not of the form NAME=VALUE, or repeats a name.
    """
    values: dict[str, str] = {}
    for entry in entries:
        name, _, value = entry.partition("=")
        is_new_pair = name != "" and value != "" and name not in values
        if not is_new_pair:
            raise InputError(
                "command line",
                key=option,
                value=entry,
                allowed="NAME=VALUE, each name once",
            )
        values[name] = value
    return values
