"""The verb that runs the whole study: snakemake with the program's own workflow, in any folder."""

import argparse
import contextlib
import os
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from repose.cli.registry import verb
from repose.cli.stages import note_built_in_crop
from repose.core import places
from repose.core.errors import InputError

CONFIG_OPTIONS = ("--configfile", "--configfiles")
CORES_OPTIONS = ("-c", "--cores", "-j", "--jobs", "--profile", "--workflow-profile")
PROFILE_OPTIONS = ("--profile", "--workflow-profile")
SNAKEFILE_OPTIONS = ("-s", "--snakefile")
CONFIG_VALUES = ("--config", "-C")
LIST = "--list"
DEFAULT_PROFILE = "profiles/default"
CONFIG_SUFFIXES = (".yaml", ".yml", ".json")


@verb(
    "run the whole study here, or the named targets; --list names them with their cost; every further option goes to "
    "snakemake (snakemake --help)",
    example="uncertainty --cores 2 --configfile mine.yaml",
    config=False,
    passes_on=True,
)
def run(args: argparse.Namespace) -> int:
    try:
        from snakemake.cli import main
    except ImportError:
        needed = "snakemake, which comes with: pip install 'repose-dem[workflow]'"
        raise InputError("installation", "snakemake", None, needed) from None
    if LIST in args.rest:
        print(catalogue(args.rest))
        return 0
    check_arguments(args.rest)
    if not os.access(".", os.W_OK) and not _given(args.rest, ("-d", "--directory")):
        raise InputError("command line", "folder", os.getcwd(), "a folder into which you may write")
    note_built_in_crop(*configurations(args.rest))
    with missing_targets_reported():
        return uninterrupted(main, args.rest)


def uninterrupted(main: Callable[[list[str]], object], words: list[str]) -> int:
    """Run snakemake's `main`; where Ctrl-C or a signal ends it, print in one sentence how to go on."""
    ended_by: list[int] = []

    def stop(number, _frame):
        # only once: the next Ctrl-C kills at once, and snakemake's cleanup after its jobs is not interrupted
        signal.signal(number, signal.SIG_DFL)
        ended_by.append(number)
        _interrupt_jobs()
        raise KeyboardInterrupt

    earlier = signal.signal(signal.SIGINT, stop)
    try:
        with _as_interrupts(ended_by):
            main(snakemake_arguments(words))
    except (KeyboardInterrupt, SystemExit) as end:
        if not ended_by:
            raise
        again = shlex.join(["repose", "run", *words])
        with contextlib.suppress(OSError):  # the terminal is closed
            print(f"\nStopped. What is finished stays; the same command goes on: {again}", file=sys.stderr)
        raise SystemExit(128 + ended_by[0]) from end
    finally:
        signal.signal(signal.SIGINT, earlier)
    return 0


@contextlib.contextmanager
def _as_interrupts(ended_by: list[int]) -> Iterator[None]:
    """Turn the end of a job by a cluster and a closed terminal into Ctrl-C; snakemake handles the first otherwise."""
    ends = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is not signal.SIG_IGN]  # nohup
    read, write = os.pipe()
    os.set_blocking(write, False)

    def forward():
        while number := int.from_bytes(os.read(read, 1), "big"):
            if number in ends and not ended_by:
                ended_by.append(number)
                os.kill(os.getpid(), signal.SIGINT)

    earlier = {number: signal.signal(number, lambda *_: None) for number in ends}
    written_to = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    forwarder = threading.Thread(target=forward, daemon=True)
    forwarder.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(written_to)
        for number, handler in earlier.items():
            signal.signal(number, handler)
        os.write(write, b"\0")
        forwarder.join()
        os.close(read)
        os.close(write)


def check_arguments(words: Sequence[str]) -> None:
    """InputError for words that snakemake would answer with a traceback."""
    from repose.config.reading import read

    for path in configurations(words):
        read(places.find(path))
    option = ""
    for word in words:
        value = word
        if word.startswith("-"):
            option, equals, value = word.partition("=")
            if not equals:
                continue
        if option in CONFIG_VALUES and "=" not in value:
            raise InputError("command line", option, value, "KEY=VALUE; a target goes before the options")
        elif option in CORES_OPTIONS[:2]:
            if value != "all" and not value.isdigit():
                raise InputError("command line", option, value, "a number of cores, or all")
            option = ""  # it takes one value: what follows is a target


@contextlib.contextmanager
def missing_targets_reported() -> Iterator[None]:
    """Turn snakemake's end at a target without a rule into an InputError."""
    from snakemake.logging import logger

    missing_targets: list[str] = []

    def seen(record):
        missing = getattr(record, "exception", None) == "MissingRuleException"
        if missing:
            missing_targets.append(record.getMessage().split("No rule to produce ")[-1].split(" (if you")[0])
        return not missing

    logger.addFilter(seen)
    try:
        yield
    except SystemExit:
        if not missing_targets:
            raise
        allowed = "a target that `repose run --list` names, a rule, or a file of the study"
        raise InputError("command line", "target", missing_targets[0], allowed) from None
    finally:
        logger.removeFilter(seen)


def _interrupt_jobs() -> None:
    """End the jobs, for which snakemake waits; unlike Ctrl-C, a signal to this program alone has not reached them."""
    import psutil

    for job in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            job.send_signal(signal.SIGINT)


def configurations(words: Sequence[str]) -> list[str]:
    """Files of configurations among the words of `repose run`."""
    paths, option = [], ""
    for word in words:
        value = word
        if word.startswith("-"):
            option, _, value = word.partition("=")
        if option in CONFIG_OPTIONS and Path(value).suffix in CONFIG_SUFFIXES:
            paths.append(value)
    return paths


def catalogue(words: list[str]) -> str:
    """The studies, each with a sentence and its cost in the configurations of the words, over the default."""
    from repose.config import cost, loader
    from repose.config.study import Study
    from repose.strategies import cost as strategies

    files = configurations(words)
    config, _ = loader.read_layers(files)  # an unreadable file is reported
    try:
        config = Study.load(*files).config
        costs = cost.costs(config)
        costs |= {target: _cost_of({**config, "strategy": target}) for target in strategies.others()}
    except InputError:
        incomplete = ", ".join(files) or "config.yaml"
        costs = dict.fromkeys(
            cost.SENTENCES, f"cost: once {incomplete} is complete; `repose check` lists the missing keys"
        )
    lines = [f"  {target:24} {cost.SENTENCES[target]}\n{'':27}{costs[target]}" for target in cost.SENTENCES]
    return "\n".join(
        [f"repose run TARGET; without one, all of calibration. Studies of {config.get('label')}:", *lines]
    )


def _cost_of(config):
    """The cost of a configuration's strategy as text, or the reason why the configuration cannot take it."""
    from repose.config import cost
    from repose.strategies import cost as strategies

    if why := strategies.misfit(config):
        return why
    pours = strategies.pours(config)
    minutes = cost.work(config, pours=pours)["total_s"] / 60
    number = sum(sets * seeds for _, sets, seeds in pours or ())
    return f"at most {number} pours, about {minutes:.0f} min on one core, by itself"


def snakemake_arguments(words: list[str]) -> list[str]:
    """The command line of snakemake for the words of `repose run`, with the built-in files that the folder lacks.

    Targets come first, since `--configfile` would take later ones for files.
    """
    targets: list[str] = []
    options: list[str] = []
    expected = ""  # the option that the next words belong to
    for word in words:
        if word.startswith("-"):
            option, equals, path = word.partition("=")
            expected = "" if equals else option
            options.append(f"{option}={_resolved(option, path)}" if equals else word)
        elif expected in CONFIG_OPTIONS and Path(word).suffix not in CONFIG_SUFFIXES:
            targets.append(word)
        else:
            options.append(_resolved(expected, word))
    if not _given(options, CORES_OPTIONS):
        options = ["--cores", "all", *options]
    if not _given(options, SNAKEFILE_OPTIONS):
        theirs = (
            _given(options, PROFILE_OPTIONS) or places.find(DEFAULT_PROFILE).resolve() != _default_profile()
        )
        own = [] if theirs else _as_words(_default_profile())
        options = ["--snakefile", str(places.root() / "Snakefile"), *own, *options]
    return [*targets, *options]


def _default_profile():
    """The program's own default profile."""
    return (places.root() / DEFAULT_PROFILE).resolve()


def _as_words(profile):
    """The options of a profile, which snakemake would announce by a line of its own."""
    from repose.config.reading import read

    chosen = read(profile / "config.yaml")
    valued = {key: [value] if isinstance(value, str) else value for key, value in chosen.items()}
    lists = [word for key, value in valued.items() if value is not True for word in (f"--{key}", *value)]
    flags = [f"--{key}" for key, value in chosen.items() if value is True]
    return [
        "--workflow-profile",
        "none",
        *lists,
        *flags,
    ]  # flags last: no target is taken for an entry of a list


def _resolved(option, path):
    """A value of an option; a configuration or profile missing in the working folder is the built-in one."""
    return str(places.find(path)) if option in (*CONFIG_OPTIONS, *PROFILE_OPTIONS) else path


def _given(words, options):
    """Whether one of the options is among the words, alone, with =VALUE or, where it is short, with its value."""
    return any(
        word.partition("=")[0] in options or (word[:2] in options and not word.startswith("--"))
        for word in words
    )
