"""One workflow at a time in a folder of results.

The locks belong to the operating system (flock) and end with the process that holds them, even if it is killed. Some
file systems of clusters have none: there nothing is held, and nothing is refused.
"""

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from repose.core import usage
from repose.core.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

# Errors of a file system without locks.
NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)
WORKFLOW, JOBS = ".lock", ".jobs"  # a workflow holds the first; its jobs hold the second, together


def take_folder(folder: str | os.PathLike) -> IO[str]:
    """Lock a folder of results for a workflow, until the returned file is closed or the process ends.

    If a workflow was killed, wait until its jobs have ended; InputError if another workflow works on the folder.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    mine = (folder / WORKFLOW).open("a+", encoding="utf-8")
    if not _locked(mine, exclusively=True):
        mine.seek(0)
        raise InputError(folder, "workflow", mine.read() or "running", "one at a time; wait until it has ended")
    with (folder / JOBS).open("a", encoding="utf-8") as jobs:
        if not _locked(jobs, exclusively=True):
            message = f"repose: {folder}: waiting until the jobs of a workflow that was killed have ended"
            print(message, file=sys.stderr, flush=True)
            fcntl.flock(jobs, fcntl.LOCK_EX)
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
        _locked(jobs, exclusively=False)
        try:
            yield
        finally:
            usage.note(folder)


@contextmanager
def exclusive(path: str | os.PathLike) -> Iterator[None]:
    """Hold a file against other processes of this program while it is read, changed and written."""
    beside = Path(path).with_name(f".{Path(path).name}.lock")
    if fcntl is None:
        print(f"repose: {path}: no locks on this system; one process at a time may add to it", file=sys.stderr)
        yield
        return
    with beside.open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise
            print(f"repose: {path}: the file system has no locks; one process at a time may add to it", file=sys.stderr)
        yield


def _locked(file: IO[str], exclusively: bool) -> bool:
    """Take a lock; False if another process holds it."""
    if fcntl is None:
        return True
    kind = fcntl.LOCK_EX if exclusively else fcntl.LOCK_SH
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
    return True
