"""Run the parts of a research script, with their options and a record in each result."""

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

from repose.common import places, provenance
from repose.common.errors import BAD_INPUT, InputError, print_fault
from repose.common.lock import lock_folder_for_job
from repose.config import dependencies
from repose.config.pipeline import PipelineConfig
from research import settings

Option = tuple[tuple[str, ...], dict[str, Any]]
# Options that name no input file.
NOT_READ = (
    "config",
    "out",
    "samples",
    "part",
    "work",
    "depends_on",
    "simulates",
)


def option(*names: str, **keywords: Any) -> Option:
    """Store the arguments of a later call of `argparse.ArgumentParser.add_argument`."""
    return names, keywords


class Script:
    """A module's parts, each run by its name: `python -m research.comparison search`."""

    def __init__(self, name: str, text: str | None) -> None:
        self.name = name
        self.parser = argparse.ArgumentParser(
            prog=f"python -m research.{name}", description=text
        )
        self.parts = self.parser.add_subparsers(required=True, dest="part")

    def part(
        self,
        name: str,
        out: str,
        *options: Option,
        depends_on: Callable | None = None,
        simulates: bool = False,
    ) -> Callable[[Callable], Callable]:
        """Make a decorator that registers a function as a part of the script.

        The function gets the options, whose `study` is the study of --config. It also gets
        the configuration of the study together with the settings of `research`. It may
        return a text, which is printed.

        Parameters
        ----------
        name : str
            Name of the part on the command line.
        out : str
            Default of --out.
        *options : Option
            Further options.
        depends_on : callable, optional
            Selects the settings on which the results depend. The default is all settings.
        simulates : bool, optional
            Whether the results are simulated runs.
        """

        def register(work: Callable) -> Callable:
            """Add the parser of a part, and return its function unchanged."""
            parser = self.parts.add_parser(
                name, description=work.__doc__, help=work.__doc__
            )
            parser.add_argument(
                "--config", default=str(places.list_default_configs()[-1])
            )
            parser.add_argument(
                "--out", default=out, help=f"file or folder to write ({out})"
            )
            for flags, keywords in options:
                parser.add_argument(*flags, **keywords)
            parser.set_defaults(
                work=work,
                depends_on=depends_on or _select_all_settings,
                simulates=simulates,
            )
            return work

        return register

    def run(self, arguments: list[str] | None = None) -> None:
        """Run the part that the command line names, and print its text.

        After a fault of the input, the function prints a message and ends the program.

        Parameters
        ----------
        arguments : list of str, optional
            The words of the command line. The default is those of the process.
        """
        args = self.parser.parse_args(arguments)
        runs: Literal["", "made"] = "made" if args.simulates else ""
        try:
            lock = lock_folder_for_job(Path(args.config).parent)
            record = provenance.record_stage(
                f"{self.name}_{args.part}",
                _find_input_files(args),
                args.depends_on,
                runs=runs,
                # The cells of a study differ from each other on purpose. Each becomes a
                # table of its own, so its runs are not compared with those of others.
                apparatus=getattr(args, "cell", None),
            )
            with lock, record:
                args.study = PipelineConfig.load(args.config)
                config = args.study.config
                text = args.work(args, config | settings.read_settings(config))
        except (InputError, OSError) as error:
            print_fault(error)
            sys.exit(BAD_INPUT)
        if text:
            print(text)


def _select_all_settings(config: dict[str, Any], _apparatus: str | None) -> Any:
    """Select all settings of a study and of `research`, with a hash of each named file."""
    return dependencies.select_stage_settings(
        config | settings.read_settings(config), "research"
    )


def _find_input_files(args: argparse.Namespace) -> Iterator[Path]:
    """Yield the existing files that the options name.

    If an option names a folder, the input file is dataset.csv in this folder.
    """
    for option_name, value in vars(args).items():
        if option_name in NOT_READ:
            continue
        entries = value if isinstance(value, list) else [value]
        for text in entries:
            if not isinstance(text, str):
                continue
            # The values of --input have the form NAME=PATH.
            if option_name == "input":
                text = text.partition("=")[2]
            path = Path(text)
            if path.is_dir():
                path = path / "dataset.csv"
            if path.is_file():
                yield path
