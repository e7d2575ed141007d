"""One workflow at a time in a folder of results.

The locks belong to the operating system (flock) and end with the process that holds them, even if it is killed. Some
file systems of clusters have none: there nothing is held, and nothing is refused.
"""

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import IO

from repose.common import usage
from repose.common.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]
LOCK_EX, LOCK_SH, LOCK_NB = (
    (fcntl.LOCK_EX, fcntl.LOCK_SH, fcntl.LOCK_NB) if fcntl else (0, 0, 0)
)

# Errors of a file system without locks.
NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)
WORKFLOW, JOBS = (
    ".lock",
    ".jobs",
)  # a workflow holds the first; its jobs hold the second, together


def take_folder(folder: str | os.PathLike) -> IO[str]:
    """Lock a folder of results for a workflow, until the returned file is closed or the process ends.

    If a workflow was killed, wait until its jobs have ended; InputError if another workflow works on the folder.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    mine = (folder / WORKFLOW).open("a+", encoding="utf-8")
    if not _locked(mine, LOCK_EX):
        mine.seek(0)
        raise InputError(
            folder,
            "workflow",
            mine.read() or "running",
            "one at a time; wait until it has ended",
        )
    with (folder / JOBS).open("a", encoding="utf-8") as jobs:
        if not _locked(jobs, LOCK_EX):
            message = f"repose: {folder}: waiting until the jobs of a workflow that was killed have ended"
            print(message, file=sys.stderr, flush=True)
            _flock(jobs, LOCK_EX)
    mine.truncate(0)
    mine.write(f"process {os.getpid()} on {os.uname().nodename}")
    mine.flush()
    return mine


@contextmanager
def joined_folder(folder: str | os.PathLike) -> Iterator[None]:
    """Hold a folder of results for a job, which notes its processor time; a new workflow starts after it has ended."""
    path = Path(folder) / JOBS
    if not os.access(path, os.W_OK):
        yield
        return
    with path.open("a+", encoding="utf-8") as jobs:
        _locked(jobs, LOCK_SH)
        try:
            yield
        finally:
            usage.note(folder)


SAY_ONCE = cache(partial(print, file=sys.stderr))


@contextmanager
def exclusive(path: str | os.PathLike) -> Iterator[None]:
    """Hold a file against other processes of this program while it is read, changed and written."""
    with (
        Path(path)
        .with_name(f".{Path(path).name}.lock")
        .open("a+", encoding="utf-8") as file
    ):
        if not _flock(file, LOCK_EX):
            SAY_ONCE(
                f"repose: {path}: no locks on this system; one process at a time may add to it"
            )
        yield


def _locked(file: IO[str], kind: int) -> bool:
    """Take a lock, or none where there are none; False if another process holds it."""
    try:
        _flock(file, kind | LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _flock(file: IO[str], kind: int) -> bool:
    """Wait for a lock and take it; False where the system or the disk has none."""
    try:
        if fcntl is not None:
            fcntl.flock(file, kind)
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        return False
    return fcntl is not None
