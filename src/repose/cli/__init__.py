"""Run the command line with its subcommands.

A subcommand is a function that is registered together with its options. The other
modules of this package define the subcommands. A subcommand passes files and settings
to other packages of `repose`. It imports these packages inside its function, so that
printing the help and parsing options stay fast.
"""

import argparse
import difflib
import functools
import io
import os
import re
import sys
import textwrap
from collections.abc import Iterable, Sequence
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import Any

from repose import __version__

# These imports register all subcommands, which are listed in this order.
from repose.cli import new, docs, checking, run, exporting, inputs, pouring, measuring  # noqa: F401, isort: skip
from repose.cli import calibration, cards, strategies, own_simulator, uncertainty  # noqa: F401, isort: skip
from repose.cli import pictures, services, simulating  # noqa: F401, isort: skip
from repose.cli.registry import CONFIG_SUFFIXES, PROGRAM, SUBCOMMANDS, Subcommand
from repose.cli.stages import run_as_stage
from repose.common.errors import BAD_INPUT, InputError, print_fault

# The subcommands that a person types, in the groups of the help. Those of the first
# group are enough for a study. All other subcommands are stages, which the rules of the
# workflow call.
FIRST_GROUP = "a study"
SUBCOMMAND_GROUPS = {
    FIRST_GROUP: ("new", "check", "measure", "run", "card", "export", "marker"),
    "before a study": ("plan",),
    "your own simulator": ("design", "tell", "ask", "calibrate"),
    "one pile, one picture": ("heap", "figure", "film", "provenance"),
    "how sure the answer is": ("noise", "posterior", "sensitivity", "next"),
    "the simulator": ("bench",),
    "the documentation": ("docs",),
}
USER_SUBCOMMANDS = tuple(name for names in SUBCOMMAND_GROUPS.values() for name in names)
STAGES = tuple(name for name in SUBCOMMANDS if name not in USER_SUBCOMMANDS)
STAGE = "stage"
HELP = "help"
# Control characters except tab and newline.
CONTROL_CHARACTERS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
# Libraries that only some subcommands need.
OPTIONAL_LIBRARIES = (
    "cv2",
    "jinja2",
    "jupyter_threejs_sage",
    "llvmlite",
    "matplotlib",
    "numba",
    "PIL",
    "trimesh",
)


def main(words: Sequence[str] | None = None) -> int:
    """Run a subcommand.

    Parameters
    ----------
    words : sequence of str, optional
        The words after the name of the program; by default those of the command line.

    Returns
    -------
    int
        Exit status: 0 for success and 2 for faulty input. The subcommand `card check`
        returns 3 if a target is not met, and 4 if there are too few runs to decide.
    """
    _prepare_streams()
    words = list(sys.argv[1:] if words is None else words)
    if words:
        words[0] = _match_case(words[0], (*USER_SUBCOMMANDS, STAGE, HELP))

    # Print the help, or explain that a subcommand is unknown.
    if words == [HELP, "all"]:
        print(_list_subcommands(SUBCOMMAND_GROUPS))
        return 0
    if words[:1] == [HELP]:
        words = [*words[1:], "--help"]
    message = _find_unknown_subcommand(words)
    if message is not None:
        print_fault(message)
        return BAD_INPUT

    # Parse the options. Only some subcommands take further words, for another program.
    words = _attach_dashed_choices(words)
    args, further_words = make_parser().parse_known_args(words)
    subcommand = SUBCOMMANDS[args.subcommand]
    args.rest = further_words
    args.words = words
    if further_words and not subcommand.forwards_words:
        make_parser().error(f"unrecognized arguments: {' '.join(further_words)}")

    try:
        _check_threads()
        return _run_subcommand(subcommand, args)
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in OPTIONAL_LIBRARIES:
            raise
        print_fault(
            f"{error.name} is not installed: expected "
            "`pip install 'repose-dem[workflow]'`, which has all"
        )
        return BAD_INPUT
    except BrokenPipeError:
        # Python flushes stdout again when it ends. Write to the null device instead,
        # where this cannot fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (InputError, OSError) as error:
        # An OSError, for example because of a full disk, names the file and the reason.
        print_fault(error)
        return BAD_INPUT


def _prepare_streams() -> None:
    """Make printing safe even if a stream is closed or cannot write a character.

    The function replaces closed streams in `sys`, and changes the encoding errors of
    stdout.
    """
    sys.stdout = sys.stdout or io.StringIO()
    sys.stderr = sys.stderr or io.StringIO()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _run_subcommand(subcommand: Subcommand, args: argparse.Namespace) -> int:
    """Run a subcommand as a stage that records its results.

    Parameters
    ----------
    subcommand : Subcommand
        The subcommand to run.
    args : argparse.Namespace
        The parsed options of the subcommand.

    Returns
    -------
    int
        The exit status of the program.
    """
    _expand_and_check_out(args)
    # Do not record the subcommand that starts a workflow, because each job of the
    # workflow is recorded.
    context = (
        nullcontext()
        if subcommand.forwards_words
        else run_as_stage(args, subcommand.runs)
    )
    with redirect_stdout(EscapingStream(sys.stdout)), context:
        status = subcommand(args)
    sys.stdout.flush()
    return status or 0


def _check_threads() -> None:
    """Raise an InputError for a number of threads with which numba would fail."""
    name = "NUMBA_NUM_THREADS"
    number = os.environ.get(name, "1")
    is_number = number.isdecimal() and int(number) >= 1
    if not is_number:
        raise InputError(
            "environment",
            key=name,
            value=number,
            allowed="a whole number from 1, or none",
        )


class EscapingStream:
    """A stream that writes control characters as backslash escapes.

    Text from a user may contain such characters, which would control the terminal.
    """

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        """Write text with its control characters escaped."""
        self.stream.write(CONTROL_CHARACTERS.sub(_escape, text))
        return len(text)


def _escape(match: re.Match[str]) -> str:
    """Write a control character as a backslash escape."""
    return match[0].encode("unicode_escape").decode()


def _expand_and_check_out(args: argparse.Namespace) -> None:
    """Expand `~` in the value of --out, and check the path.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options. If the subcommand has the option --out, the attribute `out`
        is replaced by the expanded path.

    Raises
    ------
    InputError
        For the root of the file system, an empty path, and a path with control
        characters.
    """
    if getattr(args, "out", None) is None:
        return

    # Some shells leave `~` unchanged after `=`.
    args.out = os.path.expanduser(args.out)
    # The real path of an empty text is the working folder, so the check below tests the
    # text itself.
    path = Path(os.path.realpath(args.out))
    is_root = path == path.parent
    if not args.out or is_root or not args.out.isprintable():
        raise InputError(
            "command line",
            key="--out",
            value=args.out,
            allowed="the path of a file or folder to write",
        )


def _attach_dashed_choices(words: list[str]) -> list[str]:
    """Attach a choice that begins with a dash to its option, as in ``--up=-z``.

    The parser would take the choice for an option.
    """
    choices = {
        name: option.keywords.get("choices", ())
        for subcommand in SUBCOMMANDS.values()
        for option in subcommand.options
        for name in option.names
    }
    attached: list[str] = []
    for word in words:
        option = attached[-1] if attached else ""
        if word.startswith("-") and word in choices.get(option, ()):
            attached[-1] = f"{option}={word}"
        else:
            attached.append(word)
    return attached


@functools.cache
def make_parser() -> argparse.ArgumentParser:
    """Make the parser of all subcommands, and of the stages under the command `stage`.

    The modules of the subcommands must have been imported before, because this fills
    the table `SUBCOMMANDS`. The help of the program lists only the subcommands that a
    study needs. Its text is the epilog, so argparse's own list of options and
    subcommands is suppressed.
    """
    main_parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description="Calibrates the contact parameters of a discrete element model\n"
        "from a pile of grains.",
        usage=f"{PROGRAM} [--version] SUBCOMMAND ...",
        epilog=_list_subcommands([FIRST_GROUP]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        add_help=False,
    )
    main_parser.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)
    main_parser.add_argument(
        "--version", action=_Version, nargs=0, help=argparse.SUPPRESS
    )
    subcommands = main_parser.add_subparsers(
        prog=PROGRAM, metavar="SUBCOMMAND", required=True, help=argparse.SUPPRESS
    )
    for name in USER_SUBCOMMANDS:
        SUBCOMMANDS[name].add_to(subcommands)

    # Stages are called by two words: repose stage NAME.
    stage_parser = subcommands.add_parser(
        STAGE,
        description="One stage of the workflow, as its rules call it.",
        epilog="\n".join(["stages:", *map(_format_entry, STAGES)]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    stages = stage_parser.add_subparsers(
        metavar="NAME", required=True, help="one of those below"
    )
    for name in STAGES:
        SUBCOMMANDS[name].add_to(stages)
    return main_parser


class _Version(argparse.Action):
    """An option that prints the version and the commit, and ends the program."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from repose.common.provenance import describe_machine

        text = f"{PROGRAM} {__version__}"
        commit = describe_machine()["commit"]
        if commit:
            text += f", commit {commit}"
        print(text)
        parser.exit()


def _find_unknown_subcommand(words: list[str]) -> str | None:
    """Check that the first words of the command line name a subcommand or a stage.

    Parameters
    ----------
    words : list of str
        The words of the command line after the name of the program.

    Returns
    -------
    str or None
        A message about an unknown name. None if the name is known, or if there is none.
    """
    if words[:1] == [STAGE]:
        return _describe_unknown_name(
            "stage", words[1:], known=STAGES, listing=f"{PROGRAM} {STAGE} --help"
        )
    return _describe_unknown_name(
        "subcommand",
        words,
        known=(*USER_SUBCOMMANDS, STAGE),
        listing=f"{PROGRAM} --help",
    )


def _describe_unknown_name(
    kind: str, words: list[str], known: Sequence[str], listing: str
) -> str | None:
    """Explain that a subcommand or stage is unknown, and suggest the nearest name.

    Parameters
    ----------
    kind : str
        What the names stand for: subcommand or stage.
    words : list of str
        The words of the command line, starting with the name.
    known : sequence of str
        The valid names.
    listing : str
        The command that lists them.

    Returns
    -------
    str or None
        The message, or None if the first word is a known name or an option.
    """
    if not words or words[0].startswith("-") or words[0] in known:
        return None
    name = words[0]
    message = f"unknown {kind} {name!r}: expected one of those that `{listing}` lists"
    suggestion = _suggest_command(name, known)
    if suggestion is None:
        return message
    return f"{message}; did you mean {suggestion}?"


def _suggest_command(name: str, known: Sequence[str]) -> str | None:
    """Suggest what the user may have meant by an unknown name.

    Parameters
    ----------
    name : str
        The first word of the command line, or the word after `stage`.
    known : sequence of str
        The names that are valid in this place.

    Returns
    -------
    str or None
        The words of a command that works, or None if no known name is similar.
    """
    # The user probably gave a configuration in place of a subcommand.
    if Path(name).suffix in CONFIG_SUFFIXES:
        return f"{PROGRAM} run --configfile {name}"

    # Search the names of subcommands, stages and studies for a similar one.
    studies = _list_studies()
    candidates = (*known, *studies, *STAGES)
    matches = difflib.get_close_matches(name.lower(), candidates, n=1)
    if not matches:
        return None
    (similar,) = matches

    # Studies and stages need two words, such as `run STUDY`.
    if similar in known:
        return similar
    if similar in studies:
        return f"run {similar}"
    return f"{STAGE} {similar}"


def _match_case(word: str, known: Sequence[str]) -> str:
    """Return a word in lower case if that is a known name; else return it unchanged."""
    return word.lower() if word.lower() in known else word


def _list_studies() -> tuple[str, ...]:
    """List the names of the studies that `repose run` can make."""
    from repose.config import cost

    return tuple(name for name in cost.STUDY_SUMMARIES if name.isidentifier())


def _list_subcommands(group_titles: Iterable[str]) -> str:
    """List the subcommands of some groups for the help.

    Parameters
    ----------
    group_titles : iterable of str
        Keys of `SUBCOMMAND_GROUPS`.

    Returns
    -------
    str
        Lines of text: each group with its subcommands and their summaries, and then the
        commands that explain more.
    """
    lines: list[str] = []
    for group_title in group_titles:
        lines.append(f"{group_title}:")
        lines += [_format_entry(name) for name in SUBCOMMAND_GROUPS[group_title]]
        lines.append("")
    lines += [
        f"`{PROGRAM} SUBCOMMAND --help` explains one, `{PROGRAM} help all` lists all,",
        f"`{PROGRAM} {STAGE} --help` the stages of the workflow.",
        f"example: {PROGRAM} check --configfile config/paper.yaml",
    ]
    return "\n".join(lines)


def _format_entry(name: str) -> str:
    """Format a subcommand and the beginning of its summary, in lines of 80 columns."""
    clause = SUBCOMMANDS[name].summary.partition(";")[0].removesuffix(".")
    # The summary follows the name on the same line, so begin it with a small letter.
    summary = clause[:1].lower() + clause[1:]
    return textwrap.fill(
        summary, 80, initial_indent=f"  {name:20} ", subsequent_indent=23 * " "
    )
