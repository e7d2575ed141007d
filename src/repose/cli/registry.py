"""A verb of the command line: a function with options, whose docstring is its help."""

import argparse
import textwrap
from collections.abc import Callable
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from repose.common import places
from repose.config.pipeline import PipelineConfig

if TYPE_CHECKING:
    from repose.calibrate.study import Study

PROGRAM = "repose"
# Makes what a verb takes besides its options; None for a verb that takes nothing.
Loader: TypeAlias = "Callable[[argparse.Namespace], PipelineConfig | Study] | None"


class Option:
    """One option or positional argument, with the arguments of `argparse.ArgumentParser.add_argument`.

    `recorded` says whether the files that it names belong to the record of a result.
    """

    def __init__(self, *names: str, recorded: bool = True, **keywords: Any) -> None:
        self.names, self.recorded, self.keywords = names, recorded, keywords

    @property
    def attribute(self) -> str:
        """Its name among the parsed options."""
        return self.keywords.get("dest") or self.names[0].lstrip("-").replace("-", "_")

    def but(self, **changes: Any) -> "Option":
        """Copy the option with some keywords changed."""
        return Option(*self.names, recorded=self.recorded, **(self.keywords | changes))


CONFIG = Option(
    "--configfile",
    "--config",
    dest="config",
    default=str(places.configs()[-1]),
    help="YAML or JSON configuration (config/config.yaml)",
    recorded=False,
)


class Once(argparse.Action):
    """An option whose second value would replace the first one in silence."""

    def __call__(
        self, parser: Any, namespace: Any, values: Any, option_string: str | None = None
    ) -> None:
        """Take the value; called by argparse."""
        given = vars(namespace).setdefault("given", set())
        if self.dest in given:
            raise argparse.ArgumentError(self, "given again; expected once")
        given.add(self.dest)
        setattr(namespace, self.dest, values)


class Verb(NamedTuple):
    """A step that runs by name."""

    run: Callable  # takes the parsed options, and its study if it has one; may return an exit status
    options: tuple  # of `Option`
    study: Loader  # makes the study that the step takes
    passes_on: bool = False  # unknown words go into the list `args.rest`
    runs: Literal["", "made", "measured"] = ""  # as in `repose.common.provenance.stage`

    @property
    def name(self) -> str:
        return self.run.__name__

    @property
    def words(self) -> tuple[str, str]:
        """Summary and example, as the function's docstring has them."""
        summary, _, example = cleandoc(self.run.__doc__ or "").partition(
            "\n\nexample: "
        )
        return " ".join(summary.split()), example

    def __call__(self, args: argparse.Namespace) -> int | None:
        """Do the step; return its exit status, None for 0."""
        status: int | None = (
            self.run(args) if self.study is None else self.run(args, self.study(args))
        )
        return status

    def add_to(self, subparsers: Any, before: str = "") -> None:
        """Add the verb's own parser; `before` are the words of a call between the program and the verb."""
        summary, example = self.words
        parser = subparsers.add_parser(
            self.name,
            description=textwrap.fill(summary, 78),
            epilog=" ".join(
                f"example: {PROGRAM} {before} {self.name} {example}".split()
            ),
            formatter_class=argparse.RawDescriptionHelpFormatter,  # a wrapped example is no command
        )
        parser.set_defaults(verb=self.name)
        for option in self.options:
            once = {"action": Once} if option.names[0].startswith("-") else {}
            parser.add_argument(*option.names, **(once | option.keywords))


def configs_of(args: argparse.Namespace) -> list[str]:
    """List the files of --config; some verbs take several, each over the one before."""
    given = getattr(args, "config", None)
    return given if isinstance(given, list) else [given] if given else []


def load(args: argparse.Namespace, inputs: bool = False) -> PipelineConfig:
    """Load the study of --config; with `inputs` check the files that it names."""
    return PipelineConfig.load(*configs_of(args), inputs=inputs)


VERBS: dict[str, Verb] = {}  # in the order in which their modules are imported


def verb(
    *options: Option,
    out: str | None = None,
    config: bool | Option = True,
    study: Loader = load,
    **more: Any,
) -> Callable[[Callable], Callable]:
    """Make a function the verb of the same name, as a decorator.

    Its docstring is the help: a summary, and after ``example:`` the words that follow the name in a call. `out` is the
    default of --out (None: no such option); `config` is another option in place of `CONFIG`, or False. `study` makes
    from the options the study that the function gets; `more` are further fields of `Verb`. ValueError if another verb
    has the name.
    """
    shared = [config if isinstance(config, Option) else CONFIG] if config else []
    if out:
        kind = "file" if Path(out).suffix else "folder"
        shared.append(
            Option(
                "--out", default=out, help=f"{kind} to write ({out})", recorded=False
            )
        )

    def add(run: Callable) -> Callable:
        made = Verb(run, (*shared, *options), study if config else None, **more)
        if VERBS.setdefault(made.name, made) is not made:
            raise ValueError(f"verb {made.name!r} is registered already")
        return run

    return add
