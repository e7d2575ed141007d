"""The command line: one module for each family of verbs, the options of a verb next to its function.

The verbs hand files and settings to the modules of `repose`, which are imported inside the verbs, so that help and
parsing load none of them.
"""

import argparse
import difflib
import io
import os
import re
import sys
import textwrap
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import Any

from repose import __version__

# The lines that register all verbs, in the order in which they are listed.
from repose.cli import new, docs, checking, run, exporting, inputs, pouring, measuring  # noqa: F401, isort: skip
from repose.cli import calibration, cards, strategies, own_simulator, uncertainty  # noqa: F401, isort: skip
from repose.cli import pictures, services  # noqa: F401, isort: skip
from repose.cli.registry import PROGRAM, VERBS
from repose.cli.stages import stage
from repose.common.errors import BAD_INPUT, InputError, print_fault

# The verbs that a person types, in the groups of the help. All others are stages, called by the rules of the workflow.
GROUPS = {
    "a study": ("new", "marker", "measure", "check", "plan", "run", "card", "export"),
    "your own simulator": ("design", "tell", "ask", "calibrate"),
    "one pile, one picture": ("heap", "figure", "film", "provenance"),
    "how sure the answer is": ("noise", "posterior", "sensitivity", "next"),
    "the simulator": ("bench",),
    "the documentation": ("docs",),
}
TYPED = tuple(name for names in GROUPS.values() for name in names)
STAGES = tuple(name for name in VERBS if name not in TYPED)
STAGE = "stage"
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # but tab and new line
EXTRAS = (
    "cv2",
    "jinja2",
    "jupyter_threejs_sage",
    "llvmlite",
    "matplotlib",
    "numba",
    "PIL",
    "trimesh",
)  # libraries that only some verbs need


def main(words: Sequence[str] | None = None) -> int:
    """Run a verb, by default the one on the command line.

    Status 0, 2 for faulty input, 3 where `card check` finds targets that are not met.
    """
    sys.stdout = sys.stdout or io.StringIO()  # where it is closed
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(
            errors="backslashreplace"
        )  # a locale that has no ± is no reason to end
    words = list(sys.argv[1:] if words is None else words)
    unknown = _unknown(words)
    if unknown is not None:
        print_fault(unknown)
        return BAD_INPUT
    args, rest = parser().parse_known_args(words)
    verb = VERBS[args.verb]
    if verb.passes_on:
        args.rest, args.words = rest, words
    elif rest:
        parser().error(f"unrecognized arguments: {' '.join(rest)}")
    try:
        _check_out(args)
        with (
            redirect_stdout(Printable(sys.stdout)),
            nullcontext() if verb.passes_on else stage(args, verb.runs),
        ):
            status = verb(args) or 0
        sys.stdout.flush()
        return status
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in EXTRAS:
            raise
        print_fault(
            f"{error.name} is not installed: expected `pip install 'repose-dem[workflow]'`, which has all"
        )
        return BAD_INPUT
    except BrokenPipeError:
        # Python flushes stdout once more when it ends; with the null device that cannot fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (
        InputError,
        OSError,
    ) as error:  # the system's message names file and reason: no space, read-only, ...
        print_fault(error)
        return BAD_INPUT


class Printable:
    """A stream that writes control characters of users' texts, such as a terminal's codes, as backslash escapes."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        """Write a text."""
        self.stream.write(
            CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)
        )
        return len(text)


def _check_out(args: argparse.Namespace) -> None:
    """Refuse to write to the root of the system, or to a path without a name."""
    out = getattr(args, "out", None)
    if out is not None and (
        not out or Path(out).resolve() == Path(out).resolve().parent
    ):
        raise InputError(
            "command line", "--out", out, "the path of a file or folder to write"
        )


def parser() -> argparse.ArgumentParser:
    """Make the parser of all verbs, and of the stages below the verb `stage`."""
    top = argparse.ArgumentParser(
        prog=PROGRAM,
        description="Calibrates the contact parameters of a discrete element model from a pile of grains.",
        usage=f"{PROGRAM} [--version] VERB ...",
        epilog=_verbs_in_groups(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        add_help=False,
    )
    top.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)
    top.add_argument("--version", action=_Version, nargs=0, help=argparse.SUPPRESS)
    verbs = top.add_subparsers(
        prog=PROGRAM, metavar="VERB", required=True, help=argparse.SUPPRESS
    )
    for name in TYPED:
        VERBS[name].add_to(verbs)
    stages = verbs.add_parser(
        STAGE,
        description="One stage of the workflow, as its rules call it.",
        epilog="\n".join(["stages:", *map(_listed, STAGES)]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    ).add_subparsers(metavar="NAME", required=True, help="one of those below")
    for name in STAGES:
        VERBS[name].add_to(stages, STAGE)
    return top


class _Version(argparse.Action):
    """Prints version and commit, for which git may have to be asked."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from repose.common.provenance import machine

        commit = machine()["commit"]
        print(f"{PROGRAM} {__version__}" + (f", commit {commit}" if commit else ""))
        parser.exit()


def _unknown(words: list[str]) -> str | None:
    """Say in a sentence that a verb or stage does not exist, with the nearest name; None if it exists."""
    place, known = (
        ("stage", STAGES) if words[:1] == [STAGE] else ("verb", (*TYPED, STAGE))
    )
    name = words[1:2] if place == "stage" else words[:1]
    if not name or name[0].startswith("-") or name[0] in known:
        return None
    near = difflib.get_close_matches(name[0], (*known, *STAGES), 1)
    hint = "".join(
        f"; did you mean {guess if guess in known else f'{STAGE} {guess}'}?"
        for guess in near
    )
    listed = f"{PROGRAM} {STAGE} --help" if place == "stage" else f"{PROGRAM} --help"
    return f"unknown {place} {name[0]!r}: expected one of those that `{listed}` lists{hint}"


def _verbs_in_groups() -> str:
    """List every verb that a person types, by groups, and an example."""
    lines = []
    for title, names in GROUPS.items():
        lines += [f"{title}:", *map(_listed, names), ""]
    lines += [
        f"`{PROGRAM} VERB --help` explains a verb. `{PROGRAM} {STAGE} --help` lists the stages of the workflow.",
        f"example: {PROGRAM} check --config config/paper.yaml",
    ]
    return "\n".join(lines)


def _listed(name: str) -> str:
    """Write a verb and the beginning of its summary in one line."""
    begin = VERBS[name].words[0].partition(";")[0].removesuffix(".")
    return f"  {name:20} {textwrap.shorten(begin[:1].lower() + begin[1:], 76, placeholder=' ...')}"
