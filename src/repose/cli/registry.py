"""A verb of the command line: a function with a summary, an example and options."""

import argparse
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

from repose.core import places

PROGRAM = "python -m repose"


class Option:
    """One option or positional argument, with the arguments of `argparse.ArgumentParser.add_argument`."""

    def __init__(self, *names: str, **keywords: Any) -> None:
        self.names, self.keywords = names, keywords

    def but(self, **changes: Any) -> "Option":
        """The same option with some keywords changed."""
        return Option(*self.names, **(self.keywords | changes))


CONFIG = Option(
    "--config", default=str(places.configs()[-1]), help="YAML or JSON configuration (config/config.yaml)"
)


class Verb(NamedTuple):
    """A step that runs by name."""

    run: Callable  # takes the parsed options, does the step, and may return an exit status
    summary: str  # as in `Family.verb`
    example: str  # as in `Family.verb`
    options: tuple  # of `Option`
    passes_on: bool = False  # unknown words go into the list `args.rest`
    runs: Literal["", "made", "measured"] = ""  # as in `repose.core.provenance.stage`

    @property
    def name(self) -> str:
        return self.run.__name__

    def add_to(self, subparsers: Any, before: str = "") -> None:
        """Add the verb's own parser to those of `add_subparsers`; its result has the verb's name as `verb`.

        `before` are the words of a call between the program and the verb.
        """
        parser = subparsers.add_parser(
            self.name,
            description=textwrap.fill(f"{self.summary[0].upper()}{self.summary[1:]}.", 78),
            epilog=" ".join(f"example: {PROGRAM} {before} {self.name} {self.example}".split()),
            formatter_class=argparse.RawDescriptionHelpFormatter,  # a wrapped example is no command
        )
        parser.set_defaults(verb=self.name)
        for option in self.options:
            parser.add_argument(*option.names, **option.keywords)


class Family:
    """The verbs of one module, in the order of the module."""

    def __init__(self) -> None:
        self.verbs: list[Verb] = []

    def verb(
        self,
        summary: str,
        *,
        example: str = "",
        out: str | None = None,
        config: bool = True,
        options: Sequence[Option] = (),
        passes_on: bool = False,
        runs: Literal["", "made", "measured"] = "",
    ) -> Callable[[Callable], Callable]:
        """Decorator that makes a function the verb of the same name.

        `summary` is one line of the help, without capital and full stop; `example` are the words after the name in a
        call that parses. `out` is the default of --out, None for no --out. With `config` the verb takes --config; with
        `passes_on` it passes unknown words on to another program. `runs` says whether it makes or measures runs.
        """
        shared = [CONFIG] if config else []
        if out:
            kind = "file" if Path(out).suffix else "folder"
            shared.append(Option("--out", default=out, help=f"{kind} to write ({out})"))

        def add(run):
            self.verbs.append(Verb(run, summary, example, (*shared, *options), passes_on, runs))
            return run

        return add
