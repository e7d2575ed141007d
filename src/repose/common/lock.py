"""Lock folders and files: one workflow in a folder of results, one writer of a file.

The locks belong to the operating system and end with the process that holds them, even
if it is killed. Some file systems of clusters have none: there nothing is held, and
nothing is refused.
"""

import errno
import itertools
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache
from pathlib import Path

from repose.common import usage
from repose.common.errors import InputError
from repose.common.ledger import open_descriptor

# A workflow holds the first of these files in its folder of results. Each of its jobs
# holds one of its own, whose name begins with the second.
WORKFLOW = ".lock"
JOB = ".job-"
# Errors of a file system without locks.
NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)

Held = AbstractContextManager[object]
_job_numbers = itertools.count()  # a process may run one job within another


def take_folder(folder: str | os.PathLike) -> Held:
    """Lock a folder of results for a workflow.

    If an earlier workflow was killed, wait until its jobs have ended.

    Parameters
    ----------
    folder : path
        The folder, which is created if necessary.

    Returns
    -------
    context manager
        The lock, already held. It is released at the end of the context, when nothing
        refers to it any more, or when the process ends.

    Raises
    ------
    InputError
        If another workflow is using the folder.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / WORKFLOW
    lock = _try_lock(path)
    if lock is None:
        holder = path.read_text(encoding="utf-8") or "running"
        allowed = "one at a time; wait until it has ended"
        raise InputError(folder, "workflow", holder, allowed)
    _wait_for_jobs(folder)
    with open_descriptor(path, os.O_TRUNC) as handle:
        os.write(handle, f"process {os.getpid()} on {platform.node()}".encode())
    return lock


def _wait_for_jobs(folder: Path) -> None:
    """Wait until the jobs of an earlier workflow have ended, and say so once.

    Each job holds the lock of its own file in the folder. The files are removed.
    """
    has_printed = False
    for path in sorted(folder.glob(f"{JOB}*")):
        lock = _try_lock(path)
        if lock is None:
            if not has_printed:
                text = "waiting until the jobs of a workflow that was killed have ended"
                print(f"repose: {folder}: {text}", file=sys.stderr, flush=True)
                has_printed = True
            # This call returns when the job has released its lock.
            lock = _acquire_lock(path)
        with lock:
            path.unlink(missing_ok=True)


@contextmanager
def join_folder(folder: str | os.PathLike) -> Iterator[None]:
    """Lock a folder of results for a job of its workflow.

    The next workflow waits for this job. At its end the job notes its processor time.
    In a folder without a workflow, as when a verb runs by hand, nothing is locked or
    noted.

    Parameters
    ----------
    folder : path
        The folder of results. It need not exist.
    """
    folder = Path(folder)
    # A workflow has written its file into the folder before it starts the first job.
    if not (folder / WORKFLOW).is_file() or not os.access(folder, os.W_OK):
        yield
        return
    # The name is unlike that of any other job, on this machine or another.
    path = folder / f"{JOB}{platform.node()}-{os.getpid()}-{next(_job_numbers)}"
    with _acquire_lock(path):
        try:
            yield
        finally:
            usage.note(folder)
            path.unlink(missing_ok=True)


@contextmanager
def exclusive(path: str | os.PathLike) -> Iterator[None]:
    """Hold a file against other processes while it is read, changed and written."""
    path = Path(path)
    with _acquire_lock(path.with_name(f".{path.name}.lock")):
        yield


def _try_lock(path: Path) -> Held | None:
    """Take the lock of a file; None if another process holds it."""
    from filelock import Timeout

    try:
        return _acquire_lock(path, wait=False)
    except Timeout:
        return None


def _acquire_lock(path: Path, wait: bool = True) -> Held:
    """Take the lock of a file, which is no link.

    Parameters
    ----------
    path : Path
        The file, which is created if necessary.
    wait : bool, optional
        Whether to wait while another process holds the lock. Otherwise this is a
        `filelock.Timeout`.

    Returns
    -------
    context manager
        The lock, already held. On a file system without locks it holds nothing.

    Raises
    ------
    InputError
        If the user may not write there.
    """
    # Imported late because it is slow, and the help of a verb does not need it.
    from filelock import FileLock

    # A soft lock is a plain file, which would stay behind if the process is killed.
    lock = FileLock(path, blocking=wait, fallback_to_soft=False)
    try:
        return lock.acquire()
    except PermissionError as error:
        blocked = path if path.exists() else path.parent
        raise InputError(
            blocked,
            "access",
            "for others",
            "write access for you; where a group works in one folder, each of its users "
            f"sets `umask 002`, and its owner calls `chmod -R g+rwX {path.parent}` once",
        ) from error
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        _warn_of_no_locks(path.parent)
        return nullcontext()


@cache
def _warn_of_no_locks(folder: Path) -> None:
    """Tell once that nothing is held in a folder."""
    text = "no locks on this system; one process at a time may write here"
    print(f"repose: {folder}: {text}", file=sys.stderr)
