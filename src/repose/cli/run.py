"""The subcommand that runs a whole study by calling snakemake with our own workflow."""

import argparse
import contextlib
import itertools
import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from repose.cli.interruption import Interruption
from repose.cli.registry import CONFIG_SUFFIXES, PROGRAM, Option, subcommand
from repose.cli.stages import note_built_in_crop
from repose.common import places
from repose.common.errors import InputError, did_you_mean

# Arguments of options that have several values and may be repeated.
LIST_KEYWORDS: dict[str, Any] = {
    "nargs": "+",
    "action": "extend",
    "default": [],
    "recorded": False,
}
FILES_HELP = (
    "each overrides the one before it; a configuration of the program itself can be "
    "named without copying it"
)
# If a signal ends a program, its exit status is this number plus that of the signal.
SIGNAL_STATUS = 128
DRY_RUN_WORDS = {"-n", "--dry-run", "--dryrun"}
# The options of `run` that snakemake also has. The last one takes exactly one value,
# see `build_snakemake_arguments`.
FORWARDED_OPTIONS = (
    "configfile",
    "config",
    "cores",
    "jobs",
    "profile",
    "workflow_profile",
    "directory",
    "snakefile",
)


@subcommand(
    Option(
        "--configfile",
        "--configfiles",
        metavar="FILE",
        help=f"configurations, {FILES_HELP}",
        **LIST_KEYWORDS,
    ),
    Option(
        "--config",
        "-C",
        metavar="KEY=VALUE",
        help="values that override those in the files",
        **LIST_KEYWORDS,
    ),
    Option("--cores", "-c", metavar="N", help="number of cores to use (all)"),
    Option(
        "--jobs",
        "-j",
        metavar="N",
        help="number of jobs at the same time, on a cluster",
    ),
    Option(
        "--profile",
        metavar="FOLDER",
        help="profile of snakemake, such as profiles/slurm",
    ),
    Option(
        "--workflow-profile",
        metavar="FOLDER",
        help="profile to use instead of profiles/default",
    ),
    Option("--directory", "-d", metavar="FOLDER", help="folder in which to run"),
    Option("--snakefile", "-s", metavar="FILE", help="workflow to run instead of ours"),
    Option(
        "--list",
        action="store_true",
        help="list the names of the studies with their cost, and run nothing",
    ),
    config=False,
    forwards_words=True,
)
def run(args: argparse.Namespace) -> int:
    """Run the whole study here, or the named targets, which stand before the options.

    Every other option is passed on to snakemake (snakemake --help).

    Examples
    --------
    $ repose run uncertainty --cores 2 --configfile mine.yaml
    """
    try:
        from snakemake.cli import main as snakemake_main
    except ImportError:
        raise InputError(
            "installation",
            key="snakemake",
            value=None,
            allowed="snakemake, which comes with: pip install 'repose-dem[workflow]'",
        ) from None

    # Check all options before snakemake starts. A configuration of the program itself
    # may be named without its folder.
    args.configfile = [str(places.find_file(path)) for path in args.configfile]
    _check_number("--cores", args.cores, "all")
    _check_number("--jobs", args.jobs, "unlimited")
    _check_configuration_options(args)
    if args.list:
        from repose.config.check import list_studies

        print(list_studies(args.configfile))
        return 0
    _check_folder(args)
    note_built_in_crop(*args.configfile)
    _choose_cache_folder(args.directory or ".")

    arguments = build_snakemake_arguments(args)
    status = call_snakemake(snakemake_main, arguments)
    # `args.words` is the whole command line, and `args.rest` the part of it that is not
    # an option of `run`.
    if status > SIGNAL_STATUS:
        # A signal, such as that of Ctrl-C, has ended the run.
        _print_how_to_continue(args.words)
    elif status != 0:
        # The reason may be a mistyped target. Look for one only now, because listing
        # the rules takes as long as starting snakemake.
        _check_targets(args.rest, arguments)
    return status


def _check_number(option: str, text: str | None, word: str) -> None:
    """Raise an InputError unless a number of cores or jobs is a whole number from 1.

    With 0 snakemake would wait for ever.

    Parameters
    ----------
    option : str
        Name of the option.
    text : str or None
        The value of the option; None if the user did not give it.
    word : str
        A word that snakemake accepts in place of a number.
    """
    if text is None:
        return
    is_number = text.isdecimal() and int(text) >= 1
    if not is_number and text != word:
        raise InputError(
            "command line",
            key=option,
            value=text,
            allowed=f"a whole number from 1, or {word}",
        )


def _check_folder(args: argparse.Namespace) -> None:
    """Check the folder in which snakemake will run.

    Raises
    ------
    InputError
        If the folder of --directory does not exist. Without this option, if the user
        may not write in the working folder and snakemake would have to.
    """
    # Snakemake itself reports a folder of --directory in which it cannot write.
    if args.directory is not None:
        if not os.path.isdir(args.directory):
            raise InputError(
                "command line",
                key="--directory",
                value=args.directory,
                allowed="an existing folder",
            )
        return
    is_dry = not DRY_RUN_WORDS.isdisjoint(args.rest)
    if not is_dry and not os.access(".", os.W_OK):
        raise InputError(
            "command line",
            key="folder",
            value=os.getcwd(),
            allowed="a folder into which you may write",
        )


def _print_how_to_continue(words: list[str]) -> None:
    """Print the command that continues a run that a signal ended."""
    command = shlex.join([PROGRAM, *words])
    # Ignore the error if the terminal is closed.
    with contextlib.suppress(OSError):
        print(
            f"\nStopped. Finished results are kept; the same command continues: {command}",
            file=sys.stderr,
        )


def _check_configuration_options(args: argparse.Namespace) -> None:
    """Check --configfile and --config, because snakemake would end with a traceback."""
    from repose.common.reading import read_yaml

    for path in args.configfile:
        read_yaml(path)
    keys = []
    for entry in args.config:
        key, equals_sign, value = entry.partition("=")
        keys.append(key)
        mistake = None
        if not equals_sign and Path(entry).suffix in CONFIG_SUFFIXES:
            mistake = f"KEY=VALUE; a file is given by --configfile {entry}"
        elif not equals_sign:
            # The option takes all words up to the next option, also a target.
            mistake = "KEY=VALUE; a target goes before the options"
        elif not key.isidentifier():
            # Snakemake does not accept dotted keys.
            mistake = f"a section with its keys, as in '{_nest_in_section(key, value)}'"
        if mistake is not None:
            raise InputError(
                "command line", key="--config", value=entry, allowed=mistake
            )

    # If a key were given twice, Snakemake would silently take the last value.
    for key in keys:
        if keys.count(key) > 1:
            raise InputError(
                "command line",
                key="--config",
                value=f"{key} {keys.count(key)} times",
                allowed="each key once",
            )


def _nest_in_section(key: str, value: str) -> str:
    """Write a dotted key and its value in the form that snakemake accepts.

    This form is the section with nested braces, such as ``miga={stop: {rounds: 5}}``.
    """
    section, *inner = key.split(".")
    for name in reversed(inner):
        value = f"{{{name}: {value}}}"
    return f"{section}={value}"


def _choose_cache_folder(folder: str) -> None:
    """Make snakemake and numba use another cache folder if the usual one is read-only.

    In this case the function sets the environment variable XDG_CACHE_HOME to a folder
    below `folder`.
    """
    cache_folder = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    # If the folder does not exist yet, check the folder in which it would be made.
    while not cache_folder.exists() and cache_folder != cache_folder.parent:
        cache_folder = cache_folder.parent
    if not os.access(cache_folder, os.W_OK):
        os.environ["XDG_CACHE_HOME"] = os.path.abspath(f"{folder}/.snakemake/cache")


def _check_targets(words: list[str], arguments: list[str]) -> None:
    """Raise an InputError for a target that is probably mistyped.

    This is called after snakemake has failed, and has printed its own message, which
    may not name the mistake. A target that is a name must be that of a rule of the
    workflow. A target that is a path is wrong if it only resembles the path of a
    result.

    Parameters
    ----------
    words : list of str
        The words after `repose run`, without the options of `run` itself: targets, and
        options of snakemake.
    arguments : list of str
        Snakemake's command line.

    Raises
    ------
    InputError
        For the first such target.
    """
    # Targets come before the options. A word after an option may be its value. The
    # options of `run` are those arguments of snakemake that are not in `words`. The
    # name of a rule is an identifier of Python.
    targets = list(itertools.takewhile(lambda word: not word.startswith("-"), words))
    options = [argument for argument in arguments if argument not in words]
    rule_names = [target for target in targets if target.isidentifier()]
    paths = [target for target in targets if os.sep in target]
    if rule_names:
        _check_rule_names(rule_names, options)
    if paths:
        _check_paths(paths, options)


def _check_rule_names(names: list[str], options: list[str]) -> None:
    """Raise InputError for the first name that no rule of the workflow has.

    Parameters
    ----------
    names : list of str
        Targets that may be names of rules.
    options : list of str
        Options of snakemake that choose the workflow and its configuration.
    """
    # Snakemake may print other lines around the names.
    rules = [
        line
        for line in _list_with_snakemake("--list-rules", options)
        if line.isidentifier()
    ]
    for name in names:
        if rules and name not in rules:
            guess = did_you_mean(name, rules)
            raise InputError(
                "command line",
                key="target",
                value=name,
                allowed=f"a rule of the workflow, or a file{guess}",
            )


def _check_paths(paths: list[str], options: list[str]) -> None:
    """Raise InputError for the first path that is similar to the path of a result.

    Parameters
    ----------
    paths : list of str
        Targets that are paths.
    options : list of str
        Options of snakemake that choose the workflow and its configuration.
    """
    # Below a header, the first column of snakemake's summary names the files.
    lines = _list_with_snakemake("--summary", options)[1:]
    results = [line.partition("\t")[0] for line in lines]
    for path in paths:
        guess = did_you_mean(path, results)
        if guess and path not in results:
            raise InputError(
                "command line",
                key="target",
                value=path,
                allowed=f"a file that a rule of the workflow makes{guess}",
            )


def _list_with_snakemake(option: str, options: list[str]) -> list[str]:
    """Call snakemake with an option that runs no job, and return the lines it prints."""
    listing = subprocess.run(
        [sys.executable, "-m", "snakemake", *options, option],
        capture_output=True,
        text=True,
        check=False,
    )
    return listing.stdout.splitlines()


def build_snakemake_arguments(args: argparse.Namespace) -> list[str]:
    """Build snakemake's command line from the options of `run`.

    By default snakemake runs the workflow and the profile of this program on all cores.

    Parameters
    ----------
    args : argparse.Namespace
        The options. `rest` has the words that are not options of `run`: the targets,
        and further options of snakemake.

    Returns
    -------
    list of str
        The words of the command line after ``snakemake``.
    """
    values = dict(vars(args))  # a copy, by the name of the option
    values["snakefile"] = args.snakefile or str(
        places.find_program_folder() / "Snakefile"
    )
    for name in ("profile", "workflow_profile"):
        if values[name] is not None:
            values[name] = str(places.find_file(values[name]))
    # A profile may set the number of jobs.
    has_profile = args.profile is not None or args.workflow_profile is not None
    if not (args.cores or args.jobs or has_profile):
        values["cores"] = "all"

    # Each value is a text or a list of texts. The order of `FORWARDED_OPTIONS` matters:
    # the last option takes exactly one value. An option that takes several values would
    # read the targets in `args.rest`, which follow, as further values.
    words = []
    for name in FORWARDED_OPTIONS:
        value = values[name]
        if not value:
            continue
        words.append(f"--{name.replace('_', '-')}")
        if isinstance(value, str):
            words.append(value)
        else:
            words.extend(value)
    return words + args.rest


def call_snakemake(main: Callable[[list[str]], object], arguments: list[str]) -> int:
    """Call snakemake in this process.

    Parameters
    ----------
    main : callable
        `snakemake.cli.main`, which raises SystemExit when it ends.
    arguments : list of str
        The words of the command line after ``snakemake``.

    Returns
    -------
    int
        Snakemake's exit status. If a signal ended the run, it is the exit status that a
        shell uses for this signal.
    """
    status = 0
    with Interruption() as interruption:
        try:
            main(arguments)
        except KeyboardInterrupt:
            # A signal has ended the run; `interruption` has its number.
            pass
        except SystemExit as end:
            # Snakemake always ends with a number. Anything else counts as a failure.
            status = end.code if isinstance(end.code, int) else 1
    # A signal explains any other status.
    if interruption.signal_number is not None:
        return SIGNAL_STATUS + interruption.signal_number
    return status
