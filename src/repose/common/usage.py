"""Record the processor time of each process of a study's jobs, and add it up.

Snakemake's benchmark of a job ends at its last look, a half minute before the end of a
long one.
"""

import csv
import os
import platform
import time
from collections import defaultdict
from collections.abc import Iterable
from contextlib import suppress
from operator import methodcaller
from pathlib import Path
from typing import NamedTuple

from repose.common.ledger import open_descriptor, write_in_one_move

TABLE = "benchmarks/processes.csv"
# A job has a log and a benchmark of one name in these folders.
LOGS = "logs"
BENCHMARKS = "benchmarks"
# A process may end so much earlier than its job began [s]: clocks of files are coarse.
CLOCK_TOLERANCE_S = 1.0


class Process(NamedTuple):
    """A process of a job that has ended.

    Attributes
    ----------
    ended_s : float
        When it ended, in seconds since 1970.
    cpu_s : float
        Processor time that it and its children used [s].
    log : str
        The log of its job; empty if it is unknown.
    host : str
        Name of its machine.
    ancestors : str
        Numbers of the processes that started it, separated by blanks.
    """

    ended_s: float
    cpu_s: float
    log: str
    host: str
    ancestors: str


def _sum_time_of_ended_children_s() -> float:
    """Add up the processor time of the children of this process that have ended [s]."""
    try:
        import resource
    except ImportError:  # Windows, where no workflow runs
        return 0.0
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


# Of the commands that a shell ran before it became this process [s].
EARLIER_S = _sum_time_of_ended_children_s()


def used_here_s() -> float:
    """Add up the processor time of this program and of its children that have ended [s]."""
    return time.process_time() + _sum_time_of_ended_children_s() - EARLIER_S


def note(folder: str | os.PathLike) -> None:
    """Append this process and its processor time to the table of a results folder.

    Nothing is noted without the library psutil, or on a full disk.
    """
    try:
        import psutil
    except ImportError:
        # An installation without it has no workflow either.
        return
    ancestors = " ".join(str(parent.pid) for parent in psutil.Process().parents())
    process = Process(
        time.time(), used_here_s(), _find_log(), platform.node(), ancestors
    )
    line = ",".join(map(str, process)) + "\n"

    # Append it to the table, which begins with a header.
    table = Path(folder) / TABLE
    # Ignore a full disk, since the files of the job itself are complete.
    with suppress(OSError):
        table.parent.mkdir(exist_ok=True)
        with open_descriptor(table, os.O_APPEND) as handle:
            is_new = os.fstat(handle).st_size == 0
            header = ",".join(Process._fields) + "\n" if is_new else ""
            # One write, so that lines of processes that end together do not mix.
            os.write(handle, f"{header}{line}".encode())


def _find_log() -> str:
    """Find the file that takes this process's errors, if the system names it."""
    try:
        path = os.path.relpath(os.readlink("/proc/self/fd/2"))
    except (OSError, ValueError):
        return ""
    return path if path.endswith(".log") and "," not in path else ""


def since(folder: str | os.PathLike, began_s: float) -> list[Process]:
    """List the processes in the table of a results folder that ended since a given time.

    Parameters
    ----------
    folder : path
        The folder of results. It may have no table.
    began_s : float
        The time, in seconds since 1970.
    """
    table = Path(folder) / TABLE
    if not table.is_file():
        return []
    with table.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.reader(handle))[1:]  # without the header

    processes = []
    for row in rows:
        # A full disk may have cut a line off.
        if len(row) != len(Process._fields):
            continue
        ended_s, cpu_s, *texts = row
        process = Process(float(ended_s), float(cpu_s), *texts)
        if process.ended_s >= began_s:
            processes.append(process)
    return processes


def correct_benchmarks(folder: str | os.PathLike, processes: Iterable[Process]) -> None:
    """Replace the processor time in snakemake's benchmarks by that of whole jobs.

    Parameters
    ----------
    folder : path
        The folder of results. It has a log and a benchmark of one name for each job.
    processes : iterable of Process
        The processes of all jobs.
    """
    # The processes of a job are those that write into its log.
    folder = Path(folder)
    processes_by_log: dict[str, list[Process]] = defaultdict(list)
    for process in processes:
        processes_by_log[process.log].append(process)

    for log, job_processes in processes_by_log.items():
        if not Path(log).is_relative_to(folder / LOGS):
            continue
        name = Path(log).relative_to(folder / LOGS).with_suffix(".tsv")
        benchmark = folder / BENCHMARKS / name
        # The benchmark of a failed job is missing or incomplete.
        with suppress(OSError, ValueError):
            _correct_benchmark(benchmark, job_processes)


def _correct_benchmark(path: Path, processes: Iterable[Process]) -> None:
    """Write the processor time of all processes of a job into its benchmark.

    A benchmark is a table with a header. Its last row belongs to the last run of the
    job.

    Parameters
    ----------
    path : Path
        The benchmark, which is replaced.
    processes : iterable of Process
        The processes of the job. Those of earlier runs of it may be among them.

    Raises
    ------
    OSError, ValueError
        If the benchmark is missing or incomplete.
    """
    *rows, last_row = path.read_text(encoding="utf-8").splitlines()
    names = rows[0].split("\t")
    values = last_row.split("\t")
    # Snakemake has written the file at the end of the last run, so this began earlier by
    # its duration. Count only the processes that ended since then.
    wall_s = float(values[names.index("s")])
    began_s = path.stat().st_mtime - wall_s - CLOCK_TOLERANCE_S
    cpu_s = sum(process.cpu_s for process in processes if process.ended_s >= began_s)
    values[names.index("cpu_time")] = f"{cpu_s:.2f}"
    text = "\n".join([*rows, "\t".join(values)]) + "\n"
    write_in_one_move(path, methodcaller("write", text.encode()))
