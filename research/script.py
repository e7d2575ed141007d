"""Frame of a script: its options, the study's configuration, and a record of provenance in each result."""

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
# options that name no input
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
    """Keep the arguments of `argparse.ArgumentParser.add_argument`."""
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
        """Decorate a function that gets the options with `study`, and both configurations in one, and returns a text.

        `depends_on` gives the settings that its results depend on, by default all; with `simulates` they are runs.
        """

        def add(work):
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
                work=work, depends_on=depends_on or _settings, simulates=simulates
            )
            return work

        return add

    def run(self, arguments: list[str] | None = None) -> None:
        """Run the part that the command line names; a fault of the input ends it with one message."""
        args = self.parser.parse_args(arguments)
        try:
            stage = f"{self.name}_{args.part}"
            folder = lock_folder_for_job(Path(args.config).parent)
            runs: Literal["", "made"] = "made" if args.simulates else ""
            # the cells of a study differ on purpose: each is a table of its own
            cell = getattr(args, "cell", None)
            with (
                folder,
                provenance.record_stage(
                    stage, _files(args), args.depends_on, runs=runs, apparatus=cell
                ),
            ):
                args.study = PipelineConfig.load(args.config)
                config = args.study.config
                text = args.work(args, config | settings.of(config))
        except (InputError, OSError) as error:
            print_fault(error)
            sys.exit(BAD_INPUT)
        if text:
            print(text)


def _settings(config, apparatus):
    """Both configurations, with files by their content."""
    return dependencies.select_stage_settings(config | settings.of(config), "research")


def _files(args: argparse.Namespace) -> Iterator[Path]:
    """Files that the options name; of a folder its dataset, if it has one."""
    for key, value in vars(args).items():
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, str) and key not in NOT_READ:
                path = Path(item.partition("=")[2] if key == "input" else item)
                path = path / "dataset.csv" if path.is_dir() else path
                if path.is_file():
                    yield path
