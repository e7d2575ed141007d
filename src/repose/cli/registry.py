"""Turn functions into subcommands of the command line, with options and help."""

import argparse
import textwrap
from collections.abc import Callable, Iterable
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from repose.common import places
from repose.config.pipeline import PipelineConfig

if TYPE_CHECKING:
    from repose.calibrate.study import Study

PROGRAM = "repose"
# Endings of the names of configuration files.
CONFIG_SUFFIXES = (".yaml", ".yml", ".json")
# The type of a function that makes the study of a subcommand from its options. It is
# None for a subcommand without a study.
Loader: TypeAlias = (
    "Callable[[argparse.Namespace], PipelineConfig | Study | None] | None"
)
# Heading of the example in the docstring of a subcommand, as in other docstrings.
EXAMPLE_HEADING = "\n\nExamples\n--------\n$ "
HELP_COLUMNS = 78


class Option:
    """One option or positional argument of a subcommand.

    Parameters
    ----------
    *names : str
        The names of the option, such as ``--out``. A positional argument has one name
        without dashes.
    hidden_name : str, optional
        A further name, which works but is not printed in the help.
    recorded : bool, optional
        Whether the record of a result lists the files that the option names.
    find_files : callable, optional
        Function that finds the files that the option names, given all parsed options.
        It is only needed if the values of the option are not simply the paths of these
        files.
    **keywords
        Arguments of `argparse.ArgumentParser.add_argument`.
    """

    def __init__(
        self,
        *names: str,
        hidden_name: str | None = None,
        recorded: bool = True,
        find_files: Callable[[argparse.Namespace], Iterable[Path]] | None = None,
        **keywords: Any,
    ) -> None:
        self.names = names
        self.hidden_name = hidden_name
        self.recorded = recorded
        self.find_files = find_files
        self.keywords = keywords

    @property
    def attribute(self) -> str:
        """The attribute of the parsed options that holds its value."""
        if self.keywords.get("dest"):
            return str(self.keywords["dest"])
        return self.names[0].lstrip("-").replace("-", "_")

    @property
    def is_positional(self) -> bool:
        """Whether it is a positional argument."""
        return not self.names[0].startswith("-")

    def with_changes(self, **changes: Any) -> "Option":
        """Copy the option with some keywords changed."""
        return Option(
            *self.names,
            hidden_name=self.hidden_name,
            recorded=self.recorded,
            find_files=self.find_files,
            **(self.keywords | changes),
        )

    def list_files(self, args: argparse.Namespace) -> list[Path]:
        """List the files and folders that the option names. They need not exist.

        Parameters
        ----------
        args : argparse.Namespace
            All parsed options of the subcommand.

        Returns
        -------
        list of Path
            The paths. Any string counts as a path, even a default. The list is empty if
            the option has no value, or if its value is a number or a switch.
        """
        if self.find_files is not None:
            return list(self.find_files(args))
        value = getattr(args, self.attribute)
        values = value if isinstance(value, list) else [value]
        return [Path(text) for text in values if isinstance(text, str)]


# The configuration that is used if the user names none.
DEFAULT_CONFIG_FILE = str(places.list_default_configs()[-1])
CONFIG = Option(
    "--configfile",
    hidden_name="--config",
    dest="config",
    metavar="FILE",
    default=DEFAULT_CONFIG_FILE,
    help="YAML or JSON configuration (config/config.yaml)",
    recorded=False,
)


class NoteGivenOption(argparse.Action):
    """The action of argparse for an option that notes that the user gave it.

    It stores the value, and adds the name of the option to the set ``namespace.given``.
    A subcommand can then distinguish a value that the user gave from a default
    (`was_given`). If an option is repeated, the last value is used.
    """

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Store the value and the name of the option; called by argparse."""
        vars(namespace).setdefault("given", set()).add(self.dest)
        setattr(namespace, self.dest, values)


def was_given(args: argparse.Namespace, option: str) -> bool:
    """Tell whether the user gave an option, so that its value is not the default.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options of a subcommand.
    option : str
        The attribute of the option, such as ``config`` for --configfile.
    """
    return option in vars(args).get("given", ())


class Subcommand(NamedTuple):
    """A subcommand of the program: a function with its options.

    Attributes
    ----------
    run : callable
        Function of the parsed options, and of the study if there is one. It may return
        an exit status.
    options : tuple of Option
        The options, including --configfile and --out.
    study : callable or None
        Function that makes the study from the parsed options. None if the subcommand
        needs no study.
    forwards_words : bool
        Whether unknown options and further words are accepted. They are put into
        ``args.rest``.
    runs : str
        Whether the results are runs, as in `repose.common.provenance.record_stage`.
    """

    run: Callable
    options: tuple[Option, ...]
    study: Loader
    forwards_words: bool = False
    runs: Literal["", "made", "measured"] = ""

    @property
    def name(self) -> str:
        """The name of the function."""
        return self.run.__name__

    @property
    def summary(self) -> str:
        """The first line of the function's docstring."""
        return self.description.partition("\n\n")[0]

    @property
    def description(self) -> str:
        """The docstring of the function before its example."""
        return cleandoc(self.run.__doc__ or "").partition(EXAMPLE_HEADING)[0]

    @property
    def example(self) -> str:
        """The command in the example of the function's docstring."""
        text_after_heading = cleandoc(self.run.__doc__ or "").partition(
            EXAMPLE_HEADING
        )[2]
        return text_after_heading.partition("\n")[0]

    def __call__(self, args: argparse.Namespace) -> int | None:
        """Run the subcommand and return its exit status, where None means success."""
        arguments = [args] if self.study is None else [args, self.study(args)]
        status: int | None = self.run(*arguments)
        return status

    def add_to(self, subparsers: Any) -> None:
        """Add the parser of this subcommand to a group of parsers.

        Parameters
        ----------
        subparsers
            Result of `argparse.ArgumentParser.add_subparsers`, to which the parser is
            added.
        """
        description = " ".join(self.description.split())
        parser = subparsers.add_parser(
            self.name,
            description=textwrap.fill(description, HELP_COLUMNS),
            epilog=f"example: {self.example}",
            # The default formatter would break the command of the example into lines.
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.set_defaults(subcommand=self.name)
        # Note which options the user gives, unless the option has an action of its own:
        # on the right of |, the keywords of the option replace the default action.
        for option in self.options:
            keywords = option.keywords
            if not option.is_positional:
                keywords = {"action": NoteGivenOption} | keywords
            parser.add_argument(*option.names, **keywords)
            if option.hidden_name:
                keywords |= {"default": argparse.SUPPRESS, "help": argparse.SUPPRESS}
                parser.add_argument(option.hidden_name, **keywords)


def list_config_files(args: argparse.Namespace) -> list[str]:
    """List the files of --configfile; each overrides the ones before it."""
    files = getattr(args, "config", None)
    if isinstance(files, list):
        return files
    return [files] if files else []


def load_study(args: argparse.Namespace, check_inputs: bool = False) -> PipelineConfig:
    """Load the study of --configfile.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.
    check_inputs : bool, optional
        Whether to check the files that the configuration names as well.
    """
    return PipelineConfig.load(*list_config_files(args), check_inputs=check_inputs)


SUBCOMMANDS: dict[
    str, Subcommand
] = {}  # in the order in which their modules are imported


def subcommand(
    *options: Option,
    out: str | None = None,
    config: bool | Option = True,
    study: Loader = load_study,
    **fields: Any,
) -> Callable[[Callable], Callable]:
    """Register the decorated function as a subcommand of the same name.

    The function is called with the parsed options and, unless `config` is False, with
    the study. Its docstring becomes the help. It must end with a section "Examples"
    that has one call of the subcommand. The function is put into the table
    `SUBCOMMANDS` of this module, when the module that defines it is imported.

    Parameters
    ----------
    *options : Option
        The options of the subcommand besides --configfile and --out.
    out : str, optional
        Default of --out. If it is None, the subcommand has no such option.
    config : bool or Option, optional
        True for the usual option --configfile, an option that replaces it, or False for a
        subcommand without a study.
    study : callable, optional
        Function that makes the study from the parsed options. It is not used if
        `config` is False.
    **fields
        Further fields of `Subcommand`: `forwards_words` (whether unknown options are
        accepted) and `runs` (whether the results are runs).

    Returns
    -------
    callable
        The decorator.

    Raises
    ------
    ValueError
        If the name is taken by another subcommand.
    """
    # Add the options --configfile and --out, which most subcommands have.
    common_options = []
    if config:
        common_options.append(config if isinstance(config, Option) else CONFIG)
    if out:
        common_options.append(_make_out_option(out))
    load = study if config else None

    def register(run: Callable) -> Callable:
        """Register the decorated function, and return it unchanged."""
        new = Subcommand(run, (*common_options, *options), load, **fields)
        if new.name in SUBCOMMANDS:
            raise ValueError(f"subcommand {new.name!r} is registered already")
        SUBCOMMANDS[new.name] = new
        return run

    return register


def _make_out_option(default: str) -> Option:
    """Make the option --out, whose default is a file or a folder."""
    kind = "file" if Path(default).suffix else "folder"
    help_text = f"{kind} to write ({default})"
    return Option("--out", default=default, help=help_text, recorded=False)
