"""What a verb of the command line is: a function with a summary, an example and options."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from repose.core import places

PROGRAM = "python -m repose"


class Option:
    """One option or positional argument, in the words of `argparse.ArgumentParser.add_argument`."""

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

    run: Callable
    summary: str
    example: str
    options: tuple
    passes_on: bool = False

    @property
    def name(self) -> str:
        return self.run.__name__

    def add_to(self, subparsers: Any) -> None:
        """Add the verb's own parser to those of the program; what it parses has the verb's name as `verb`."""
        parser = subparsers.add_parser(
            self.name,
            description=f"{self.summary[0].upper()}{self.summary[1:]}.",
            epilog=f"example: {PROGRAM} {self.name} {self.example}".rstrip(),
        )
        parser.set_defaults(verb=self.name)
        for option in self.options:
            parser.add_argument(*option.names, **option.keywords)


class Family:
    """The verbs of one module, in the order in which they stand there."""

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
    ) -> Callable[[Callable], Callable]:
        """Decorator that makes a function the verb of the same name."""
        shared = [CONFIG] if config else []
        if out:
            kind = "file" if Path(out).suffix else "folder"
            shared.append(Option("--out", default=out, help=f"{kind} to write ({out})"))

        def add(run):
            self.verbs.append(Verb(run, summary, example, (*shared, *options), passes_on))
            return run

        return add
