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
from repose.stages.parameter_sets import list_job_files

# Options that accept a folder in place of files. The folder stands for the files of all
# samples with this ending. The keys are subcommand and option.
FOLDER_OPTIONS = {
    ("dataset", "jobs"): ".json",
    ("measure_runs", "pours"): ".pours.json",
}


@contextmanager
def run_as_stage(
    args: argparse.Namespace, runs: Literal["", "made", "measured"] = ""
) -> Iterator[None]:
    """Make a context in which a subcommand runs as a stage.

    Each file that is written in the context gets a record of provenance. If the
    configuration is in a folder of results, the folder is locked for this job. At the end
    a note is printed if the built-in crop was used.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.
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
    """Yield the existing input files that the recorded options of a subcommand name.

    If an option names a folder, the input file is dataset.csv in this folder.
    """
    for option in SUBCOMMANDS[args.subcommand].options:
        if not option.recorded:
            continue
        for name in _list_paths(args, option.attribute):
            file = Path(name)
            if file.is_dir():
                file = file / "dataset.csv"
            if file.is_file():
                yield file


def _list_paths(args: argparse.Namespace, option: str) -> list[str]:
    """List the values of an option that may be paths of files.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options, and the name of the subcommand as `subcommand`.
    option : str
        The attribute of the option.

    Returns
    -------
    list of str
        Paths, and perhaps other texts. Empty if the user does not give the option, or if
        its value is no text.
    """
    value = getattr(args, option)

    # The value of a few options may be a folder, which stands for the files in it.
    if (args.subcommand, option) in FOLDER_OPTIONS:
        ending = FOLDER_OPTIONS[args.subcommand, option]
        return [str(path) for path in list_job_files(value, args.samples, ending)]
    if (args.subcommand, option) == ("measure_simulated", "runs"):
        from repose.stages import simulated

        records = simulated.list_record_files(value)
        return [str(path) for paths in records.values() for path in paths]

    # Any other option has one value or several. Those of --input have the form NAME=PATH.
    values = value if isinstance(value, list) else [value]
    texts = [text for text in values if isinstance(text, str)]
    if option == "input":
        return [text.partition("=")[2] for text in texts]
    return texts
