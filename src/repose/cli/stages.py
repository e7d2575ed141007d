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
    """Attach the record of a subcommand to every file that is written in the context.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options of the subcommand, and its name as `subcommand`.
    runs : str, optional
        Whether the results are runs, as in `repose.common.provenance.record_stage`.

    Returns
    -------
    context manager
        Files that are written in it get the record.
    """
    strategy = getattr(args, "strategy", None)

    def settings_of(config: Mapping[str, Any], apparatus: str | None) -> Any:
        """Select the settings on which the results of this subcommand depend."""
        from repose.config import dependencies

        return dependencies.select_stage_settings(
            config, args.subcommand, apparatus=apparatus, strategy_name=strategy
        )

    def check(config: Mapping[str, Any], inputs: provenance.Inputs) -> None:
        """Refuse input files of another study."""
        from repose.config import dependencies

        source = ", ".join(list_config_files(args))
        dependencies.require_same_study(config, inputs, source)

    return provenance.record_stage(
        args.subcommand,
        find_input_files(args),
        settings_of,
        apparatus=getattr(args, "apparatus", None),
        runs=runs,
        strategy=strategy,
        check=check,
    )


def note_built_in_crop(*files: str) -> None:
    """Print a note if the built-in crop replaces a missing configuration.

    Parameters
    ----------
    *files : str
        The configuration files of the command.
    """
    from repose.config import loader

    built_in_crop = loader.find_substitute_crop(*files)
    if built_in_crop is None:
        return
    # A study of the user's own simulator has no crop.
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
