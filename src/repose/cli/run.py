"""The verb that runs the whole study: snakemake with the program's own workflow, in any folder."""

import argparse
import contextlib
import os
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

from repose.cli.options import require_option
from repose.cli.registry import Option, verb
from repose.cli.stages import note_built_in_crop
from repose.common import places
from repose.common.errors import BAD_INPUT, InputError

SEVERAL: dict[str, Any] = {
    "nargs": "+",
    "action": "extend",
    "default": [],
    "recorded": False,
}
ORDER = "each over the one before it; one of the program's own needs no copy"
HANDED_ON = (
    "configfile",
    "config",
    "cores",
    "jobs",
    "profile",
    "workflow_profile",
    "directory",
    "snakefile",
)


@verb(
    Option(
        "--configfile",
        "--configfiles",
        metavar="FILE",
        help=f"configurations, {ORDER}",
        **SEVERAL,
    ),
    Option("--config", "-C", metavar="KEY=VALUE", help="over the files", **SEVERAL),
    Option("--cores", "-c", metavar="N", help="cores (all)"),
    Option("--jobs", "-j", metavar="N", help="jobs at a time, on a cluster"),
    Option(
        "--profile",
        metavar="FOLDER",
        help="profile of snakemake, such as profiles/slurm",
    ),
    Option("--workflow-profile", metavar="FOLDER", help="in place of profiles/default"),
    Option("--directory", "-d", metavar="FOLDER", help="folder to run in"),
    Option("--snakefile", "-s", metavar="FILE", help="another workflow"),
    Option("--list", action="store_true", help="name the studies with their cost"),
    config=False,
    passes_on=True,
)
def run(args: argparse.Namespace) -> int:
    """Run the whole study here, or the named targets, which stand before the options.

    Every further option goes to snakemake (snakemake --help).

    example: uncertainty --cores 2 --configfile mine.yaml
    """
    try:
        from snakemake.cli import main
    except ImportError:
        needed = "snakemake, which comes with: pip install 'repose-dem[workflow]'"
        raise InputError("installation", "snakemake", None, needed) from None
    from repose.cli.run_display import FAULTS
    from repose.config.reading import read

    args.configfile = [str(places.find(path)) for path in args.configfile]
    for path in args.configfile:
        read(
            path
        )  # snakemake would answer a fault of these two options with a traceback
    for entry in args.config:
        require_option(
            "=" in entry,
            "--config",
            entry,
            "KEY=VALUE; a target goes before the options",
        )
    if args.list:
        from repose.config.check import catalogue

        print(catalogue(args.configfile))
        return 0
    if not os.access(".", os.W_OK) and args.directory is None:
        raise InputError(
            "command line", "folder", os.getcwd(), "a folder into which you may write"
        )
    note_built_in_crop(*args.configfile)
    try:
        return uninterrupted(
            main, snakemake_arguments(args), shlex.join(["repose", *args.words])
        )
    except SystemExit:
        if not FAULTS:
            raise
        return BAD_INPUT


def snakemake_arguments(args: argparse.Namespace) -> list[str]:
    """Make snakemake's command line: this program's workflow and profile, all cores where no option says it."""
    profiles = {name: getattr(args, name) for name in ("profile", "workflow_profile")}
    found = {
        name: str(places.find(path))
        for name, path in profiles.items()
        if path is not None
    }
    given = {
        **vars(args),
        **found,
        "snakefile": args.snakefile or str(places.root() / "Snakefile"),
    }
    if not (args.cores or args.jobs or found):
        given["cores"] = "all"
    words = []
    for (
        name
    ) in HANDED_ON:  # the last takes one value: a target that follows is none of a list
        if value := given[name]:
            words += [
                f"--{name.replace('_', '-')}",
                *([value] if isinstance(value, str) else value),
            ]
    return words + args.rest


def uninterrupted(
    main: Callable[[list[str]], object], words: list[str], again: str
) -> int:
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
            print(
                f"\nStopped. What is finished stays; the same command goes on: {again}",
                file=sys.stderr,
            )
        raise SystemExit(128 + ended_by[0]) from end
    finally:
        signal.signal(signal.SIGINT, earlier)
        sys.argv = typed
    return 0


@contextlib.contextmanager
def _as_interrupts(ended_by: list[int]) -> Iterator[None]:
    """Turn the end of a job by a cluster and a closed terminal into Ctrl-C; snakemake handles the first otherwise."""
    ends = [
        n
        for n in (signal.SIGTERM, signal.SIGHUP)
        if signal.getsignal(n) is not signal.SIG_IGN
    ]  # nohup
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
