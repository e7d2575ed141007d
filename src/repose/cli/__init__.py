"""The command line: one module per family of verbs. The options of a verb stand beside the function that runs it.

The work is done in the modules of `repose`; here they get their files and settings. They are imported inside the
verbs, so that help and parsing load none of them.
"""

import argparse
import io
import os
import sys
import textwrap
from collections.abc import Sequence
from contextlib import nullcontext

from repose.cli import (
    calibration,
    cards,
    checking,
    exporting,
    inputs,
    measuring,
    new,
    own_simulator,
    pictures,
    pouring,
    refinement,
    run,
    services,
    strategies,
    uncertainty,
)
from repose.cli.registry import PROGRAM
from repose.cli.stages import stage
from repose.core.errors import BAD_INPUT, InputError, tell

# Groups of the help, each with its families in the order in which the data flows; EVERYDAY verbs stand before them.
GROUPS = {
    "steps of the method, which `repose run` takes by itself": (
        inputs,
        pouring,
        measuring,
        calibration,
        cards,
    ),
    "other strategies, and your own simulator": (strategies, own_simulator),
    "studies, each a target of `repose run`": (uncertainty, refinement),
    "pictures, tests, records": (pictures, services),
}
FAMILIES = (new, checking, run, exporting, *(module for group in GROUPS.values() for module in group))
VERBS = {verb.name: verb for module in FAMILIES for verb in module.family.verbs}
EVERYDAY = ("new", "marker", "measure", "check", "plan", "run", "card", "export")


def main(words: Sequence[str] | None = None) -> int:
    """Run a verb; the exit status is 0, 1 where a verification misses, 2 where the input is at fault.

    Each fault of the input is reported in one line on stderr. It is no fault if the reader of stdout stops, such as
    `head`. `words` are the command line after the program's name, by default that of the process.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a locale that has no ± is no reason to end
    args, rest = parser().parse_known_args(words)
    verb = VERBS[args.verb]
    if verb.passes_on:
        args.rest = rest
    elif rest:
        parser().error(f"unrecognized arguments: {' '.join(rest)}")
    try:
        with nullcontext() if verb.passes_on else stage(args):
            status = verb.run(args) or 0
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # Python flushes stdout once more when it ends; with the null device that cannot fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (
        InputError,
        OSError,
    ) as error:  # the system's message names file and reason: no space, read-only, ...
        tell(error)
        return BAD_INPUT


def parser() -> argparse.ArgumentParser:
    """The parser of all verbs."""
    top = argparse.ArgumentParser(
        prog=PROGRAM,
        description="Calibrates the contact parameters of a discrete element model from a pile of grains. "
        "`repose run` runs a whole study; VERB --help explains a verb.",
        epilog=_verbs_in_groups(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    subparsers = top.add_subparsers(title="verbs", metavar="VERB", required=True, help="one of those below")
    for verb in VERBS.values():
        verb.add_to(subparsers)
    return top


def _verbs_in_groups():
    """Every verb with its summary, the everyday ones first, and an example."""
    groups = {"every day": EVERYDAY}
    for title, modules in GROUPS.items():
        names = [verb.name for module in modules for verb in module.family.verbs]
        groups[title] = [name for name in names if name not in EVERYDAY]
    lines = []
    for title, names in groups.items():
        lines += [f"{title}:", *(_listed(VERBS[name]) for name in names), ""]
    return "\n".join([*lines, f"example: {PROGRAM} check --config config/paper.yaml"])


def _listed(verb):
    """A verb and its summary, side by side."""
    return textwrap.fill(verb.summary, 100, initial_indent=f"    {verb.name:20} ", subsequent_indent=25 * " ")
