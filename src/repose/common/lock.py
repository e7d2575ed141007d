"""Lock folders and files: one workflow in a folder of results, one writer of a file.

The operating system releases a lock when the process that holds it ends, even if the
process is killed. Some file systems of clusters have no locks. There nothing is locked,
and no workflow is refused.
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

# The file in a folder of results that a workflow locks, and the beginning of the names
# of the files that its jobs lock.
WORKFLOW_LOCK = ".lock"
JOB_LOCK_PREFIX = ".job-"
# Numbers of the errors that a file system without locks reports.
NO_LOCK_ERRORS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)

HeldLock = AbstractContextManager[object]
# A process may run one job within another, so each job has a number.
_job_numbers = itertools.count()


def lock_folder(folder: str | os.PathLike) -> HeldLock:
    """Lock a folder of results for a workflow.

    If an earlier workflow was killed, wait until its jobs have ended.

    Parameters
    ----------
    folder : path
        The folder, which is created if necessary.

    Returns
    -------
    context manager
        The lock, already acquired. It is released at the end of the context, or when
        the object is deleted or the process ends.

    Raises
    ------
    InputError
        If another workflow is using the folder.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / WORKFLOW_LOCK
    lock = _try_lock(path)
    if lock is None:
        # `_try_lock` has created the file. The process that holds the lock writes its
        # number into the file, but it may not have done so yet.
        holder = path.read_text(encoding="utf-8") or "running"
        raise InputError(
            folder,
            key="workflow",
            value=holder,
            allowed="one at a time; wait until the other workflow has ended",
        )
    _wait_for_jobs(folder)

    # Write into the file which process holds the lock, for the message of another
    # workflow.
    with open_descriptor(path, os.O_TRUNC) as handle:
        os.write(handle, f"process {os.getpid()} on {platform.node()}".encode())
    return lock


def _wait_for_jobs(folder: Path) -> None:
    """Wait until the jobs of an earlier workflow have ended, and remove their lock files.

    A job that was killed leaves its lock file, but no lock. The caller holds the lock
    of the workflow, so no new job begins meanwhile.

    Parameters
    ----------
    folder : Path
        The folder of results. If one of its jobs is still running, a line on stderr
        says so.
    """
    # Remove the files of jobs that have ended, and collect those of running jobs.
    locked_paths = []
    for path in sorted(folder.glob(f"{JOB_LOCK_PREFIX}*")):
        lock = _try_lock(path)
        if lock is None:
            locked_paths.append(path)
        else:
            _remove_lock_file(path, lock)

    if locked_paths:
        print(
            f"repose: {folder}: waiting until the jobs of a workflow that was killed "
            "have ended",
            file=sys.stderr,
            flush=True,
        )
    for path in locked_paths:
        # This call returns when the job has released its lock.
        lock = _acquire_lock(path)
        _remove_lock_file(path, lock)


def _remove_lock_file(path: Path, lock: HeldLock) -> None:
    """Remove a lock file while this process holds its lock, and then release the lock."""
    with lock:
        path.unlink(missing_ok=True)


@contextmanager
def lock_folder_for_job(folder: str | os.PathLike) -> Iterator[None]:
    """Lock a folder of results for a job of its workflow.

    The next workflow in this folder waits for the job. When the job ends, its processor
    time is added to the table of the folder (`repose.common.usage`). If no workflow
    uses the folder, for example when a user calls a subcommand, nothing is locked or
    written.

    Parameters
    ----------
    folder : path
        The folder of results. It need not exist.
    """
    folder = Path(folder)
    # A workflow creates its lock file in the folder before it starts the first job. The
    # file remains after the workflow. A subcommand in such a folder is then treated as a
    # job, which does no harm.
    has_workflow = (folder / WORKFLOW_LOCK).is_file()
    if not has_workflow or not os.access(folder, os.W_OK):
        yield
        return
    # Use a name that no other job has, on this machine or on another one.
    job = f"{platform.node()}-{os.getpid()}-{next(_job_numbers)}"
    path = folder / f"{JOB_LOCK_PREFIX}{job}"
    with _acquire_lock(path):
        try:
            yield
        finally:
            # Record the process while the lock is held, because the next workflow may
            # read the table as soon as it is released.
            usage.record_process(folder)
            path.unlink(missing_ok=True)


@contextmanager
def lock_file(path: str | os.PathLike) -> Iterator[None]:
    """Keep other processes from a file while it is read, changed and written."""
    path = Path(path)
    with _acquire_lock(path.with_name(f".{path.name}.lock")):
        yield


def _try_lock(path: Path) -> HeldLock | None:
    """Acquire the lock of a file; return None if another process holds it."""
    from filelock import Timeout

    try:
        return _acquire_lock(path, wait=False)
    except Timeout:
        return None


def _acquire_lock(path: Path, wait: bool = True) -> HeldLock:
    """Acquire the lock of a file.

    Parameters
    ----------
    path : Path
        The file, which is created if necessary.
    wait : bool, optional
        Whether to wait while another process holds the lock.

    Returns
    -------
    context manager
        The lock, already acquired. On a file system without locks it does nothing.

    Raises
    ------
    InputError
        If the user may not write there.
    filelock.Timeout
        If another process holds the lock, and the function should not wait.
    """
    # Import this slow library only here: the help of a subcommand does not need it.
    from filelock import FileLock

    # A soft lock is a plain file, which would remain if the process were killed.
    lock = FileLock(path, blocking=wait, fallback_to_soft=False)
    try:
        return lock.acquire()
    except PermissionError as error:
        blocked = path if path.exists() else path.parent
        raise InputError(
            blocked,
            key="access",
            value="for others",
            allowed="write access for you; where a group works in one folder, each of its users "
            f"sets `umask 002`, and its owner calls `chmod -R g+rwX {path.parent}` once",
        ) from error
    except OSError as error:
        if error.errno not in NO_LOCK_ERRORS:
            raise
        _warn_of_missing_locks(path.parent)
        return nullcontext()


@cache
def _warn_of_missing_locks(folder: Path) -> None:
    """Print a warning that a folder cannot be locked; the cache makes it appear once."""
    text = "no locks on this system; one process at a time may write here"
    print(f"repose: {folder}: {text}", file=sys.stderr)
