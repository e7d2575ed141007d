"""The verb that runs the whole study: snakemake with the program's own workflow, in any folder."""

import argparse
import contextlib
import os
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise
from types import FrameType
from typing import Any

from repose.cli.registry import Option, verb
from repose.cli.stages import note_built_in_crop
from repose.core import places
from repose.core.errors import BAD_INPUT, InputError

PROFILE_OPTIONS = ("--profile", "--workflow-profile")
JOBS_OPTIONS = ("-j", "--jobs", *PROFILE_OPTIONS)


@verb(
    "run the whole study here, or the named targets, which stand before the options; every further option goes to "
    "snakemake (snakemake --help)",
    example="uncertainty --cores 2 --configfile mine.yaml",
    config=False,
    passes_on=True,
    options=[
        Option(
            "--configfile",
            "--configfiles",
            nargs="+",
            action="extend",
            default=[],
            metavar="FILE",
            help="configurations, each over the one before it; one of the program's own needs no copy",
            recorded=False,
        ),
        Option(
            "--config",
            "-C",
            nargs="+",
            action="extend",
            default=[],
            metavar="KEY=VALUE",
            help="over the files",
            recorded=False,
        ),
        Option("--cores", "-c", metavar="N", help="cores (all)"),
        Option("--snakefile", "-s", metavar="FILE", help="another workflow"),
        Option("--list", action="store_true", help="name the studies with their cost"),
    ],
)
def run(args: argparse.Namespace) -> int:
    try:
        from snakemake.cli import main
    except ImportError:
        needed = "snakemake, which comes with: pip install 'repose-dem[workflow]'"
        raise InputError("installation", "snakemake", None, needed) from None
    from repose.cli.run_display import FAULTS
    from repose.config.reading import read

    args.configfile = [str(places.find(path)) for path in args.configfile]
    for path in args.configfile:
        read(path)  # snakemake would answer a fault of these two options with a traceback
    for entry in args.config:
        if "=" not in entry:
            raise InputError("command line", "--config", entry, "KEY=VALUE; a target goes before the options")
    if args.list:
        print(catalogue(args.configfile))
        return 0
    if not os.access(".", os.W_OK) and not _given(args.rest, ("-d", "--directory")):
        raise InputError("command line", "folder", os.getcwd(), "a folder into which you may write")
    note_built_in_crop(*args.configfile)
    try:
        return uninterrupted(main, snakemake_arguments(args), shlex.join(["repose", *args.words]))
    except SystemExit:
        if not FAULTS:
            raise
        return BAD_INPUT


def snakemake_arguments(args: argparse.Namespace) -> list[str]:
    """Make snakemake's command line: this program's workflow and profile, all cores where no option says it."""
    own = {"--configfile": args.configfile, "--config": args.config}
    if args.cores or not _given(args.rest, JOBS_OPTIONS):
        own |= {"--cores": [args.cores or "all"]}
    own |= {"--snakefile": [args.snakefile or str(places.root() / "Snakefile")]}
    ours = [word for option, values in own.items() if values for word in (option, *values)]
    rest = [
        str(places.find(word)) if option in PROFILE_OPTIONS else word for option, word in pairwise(["", *args.rest])
    ]
    return [*ours, *rest]  # the last of ours takes one value: a target that follows is none of a list


def uninterrupted(main: Callable[[list[str]], object], words: list[str], again: str) -> int:
    """Run snakemake's `main`; where Ctrl-C or a signal ends it, print in one sentence how to go on."""
    ended_by: list[int] = []

    def stop(number: int, _frame: FrameType | None) -> None:
        # only once: the next Ctrl-C kills at once, and snakemake's cleanup after its jobs is not interrupted
        signal.signal(number, signal.SIG_DFL)
        ended_by.append(number)
        _interrupt_jobs()
        raise KeyboardInterrupt

    earlier = signal.signal(signal.SIGINT, stop)
    typed, sys.argv = sys.argv, ["snakemake", *words]  # the workflow reads it
    try:
        with _as_interrupts(ended_by):
            main(words)
    except (KeyboardInterrupt, SystemExit) as end:
        if not ended_by:
            raise
        with contextlib.suppress(OSError):  # the terminal is closed
            print(f"\nStopped. What is finished stays; the same command goes on: {again}", file=sys.stderr)
        raise SystemExit(128 + ended_by[0]) from end
    finally:
        signal.signal(signal.SIGINT, earlier)
        sys.argv = typed
    return 0


@contextlib.contextmanager
def _as_interrupts(ended_by: list[int]) -> Iterator[None]:
    """Turn the end of a job by a cluster and a closed terminal into Ctrl-C; snakemake handles the first otherwise."""
    ends = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is not signal.SIG_IGN]  # nohup
    read, write = os.pipe()
    os.set_blocking(write, False)

    def forward() -> None:
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


def _interrupt_jobs() -> None:
    """End the jobs, for which snakemake waits; unlike Ctrl-C, a signal to this program alone has not reached them."""
    import psutil

    for job in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            job.send_signal(signal.SIGINT)


def catalogue(files: list[str]) -> str:
    """List the studies, each with a sentence and its cost in the configurations, over the default."""
    from repose.config import cost, loader
    from repose.config.study import Study
    from repose.strategies import cost as strategies

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
    return "\n".join([f"repose run TARGET; without one, all of calibration. Studies of {config.get('label')}:", *lines])


def _cost_of(config: Mapping[str, Any]) -> str:
    """Say what a configuration's strategy costs, or why the configuration cannot take it."""
    from repose.config import cost
    from repose.strategies import cost as strategies

    if why := strategies.misfit(config):
        return why
    pours = strategies.pours(config)
    minutes = cost.work(config, pours=pours)["total_s"] / 60
    number = sum(sets * seeds for _, sets, seeds in pours or ())
    return f"at most {number} pours, about {minutes:.0f} min on one core, by itself"


def _given(words: Iterable[str], options: Iterable[str]) -> bool:
    """Return whether one of the options is among the words, alone, with =VALUE or, if it is short, with its value."""
    return any(
        word.partition("=")[0] in options or (word[:2] in options and not word.startswith("--")) for word in words
    )
