"""Run a subcommand as a stage: record its input files and the settings that it reads."""

import argparse
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Literal

from repose.cli.registry import SUBCOMMANDS, list_config_files
from repose.common import places, provenance
from repose.common.lock import lock_folder_for_job

# The table of samples in the folder of a batch.
DATASET_FILE = "dataset.csv"


@contextmanager
def run_as_stage(
    args: argparse.Namespace, runs: Literal["", "made", "measured"] = ""
) -> Iterator[None]:
    """Make a context in which a subcommand runs as a stage.

    Each file that is written in the context gets a record of provenance. If the
    configuration is in a folder of results, the folder is locked for this job. At the
    end, a note is printed if the built-in crop was used.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options of the subcommand, and its name as `subcommand`.
    runs : str, optional
        Whether the results are runs, as in `repose.common.provenance.record_stage`.
    """
    # A workflow runs its stages with the configuration in its folder of results.
    files = list_config_files(args)
    folder = Path(files[-1]).parent if files else Path().parent
    with lock_folder_for_job(folder), record_subcommand(args, runs):
        yield
    if files:
        note_built_in_crop(*files)


def record_subcommand(
    args: argparse.Namespace, runs: Literal["", "made", "measured"] = ""
) -> AbstractContextManager[None]:
    """Make a context in which every file that is written gets a record of provenance.

    The record states the subcommand, its input files and the settings that it reads.
    `repose.common.provenance.record_stage` makes it. This function tells it how to find
    the settings and how to check the input files.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options of the subcommand, and its name as `subcommand`.
    runs : {"", "made", "measured"}
        Whether the results are runs that the subcommand simulates ("made"), runs that
        it measures ("measured"), or not runs ("").

    Returns
    -------
    context manager
        Files that are written in it get the record.
    """
    strategy = getattr(args, "strategy", None)

    # Both functions are only called once a configuration has been read. They import the
    # table of dependencies then, because other subcommands do not need it.
    def select_settings(config: Mapping[str, Any], apparatus: str | None) -> Any:
        """Select the settings on which the results of this subcommand depend."""
        from repose.config import dependencies

        return dependencies.select_stage_settings(
            config, args.subcommand, apparatus=apparatus, strategy_name=strategy
        )

    def check_inputs(config: Mapping[str, Any], inputs: provenance.Inputs) -> None:
        """Raise an InputError if an input file is a result of another study."""
        from repose.config import dependencies

        source = ", ".join(list_config_files(args))
        dependencies.require_same_study(config, inputs, source)

    return provenance.record_stage(
        args.subcommand,
        find_input_files(args),
        select_settings,
        apparatus=getattr(args, "apparatus", None),
        runs=runs,
        strategy=strategy,
        check=check_inputs,
    )


def note_built_in_crop(*files: str) -> None:
    """Print a note if settings were taken from the example that the program contains.

    This is the configuration of a goji berry. It is used if the working folder has no
    configuration and the user names none.

    Parameters
    ----------
    *files : str
        The configuration files of the command. Without any, those in the working folder
        or the built-in ones are used.
    """
    from repose.config import loader

    # The path of the example, if it was used.
    built_in_crop = loader.find_substitute_crop(*files)
    if built_in_crop is None:
        return
    # A study of the user's own simulator needs no settings of a crop.
    for path in files:
        if "simulator" in loader.read_file(places.find_file(path)):
            return
    print(
        "repose: note: this folder has no config.yaml; missing settings were taken from "
        f"the built-in goji example, {built_in_crop}",
        file=sys.stderr,
    )


def find_input_files(args: argparse.Namespace) -> Iterator[Path]:
    """Yield the existing input files on which the result of a subcommand depends.

    These are the files that the values of the recorded options name. The folder of a
    batch stands for the table of samples in it.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options of the subcommand, and its name as `subcommand`.

    Yields
    ------
    Path
        The path of a file.
    """
    for option in SUBCOMMANDS[args.subcommand].options:
        if not option.recorded:
            continue
        for path in option.list_files(args):
            file = path / DATASET_FILE if path.is_dir() else path
            if file.is_file():
                yield file
