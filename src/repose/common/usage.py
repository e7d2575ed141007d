"""Record the processor time of each process of a study's jobs, and add it up.

Snakemake reads the processor time of a job only at intervals, so its benchmark of a
long job may lack the last half minute.
"""

import csv
import os
import platform
import time
from collections import defaultdict
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from repose.common.ledger import open_descriptor, write_atomically

TABLE_PATH = "benchmarks/processes.csv"
# Each job has a log and a benchmark with the same name in these folders.
LOGS = "logs"
BENCHMARKS = "benchmarks"
# Columns of snakemake's benchmarks: the duration of a run, and its processor time [s]
DURATION_COLUMN = "s"
CPU_TIME_COLUMN = "cpu_time"
# File times are coarse, so a process may seem to have ended before its job began. This
# is the largest such difference [s].
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
        Numbers of the process that started it, of the process that started that one,
        and so on, separated by spaces.
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


# Processor time of other commands [s], which a shell may have run before it became this
# process.
EARLIER_CHILDREN_S = _sum_time_of_ended_children_s()


def measure_processor_time_s() -> float:
    """Measure the processor time of this program and of its ended children [s]."""
    return time.process_time() + _sum_time_of_ended_children_s() - EARLIER_CHILDREN_S


def record_process(folder: str | os.PathLike) -> None:
    """Append this process and its processor time to the table of a results folder.

    The columns are the fields of `Process`. Cells are not quoted, and `_find_log` makes
    sure that the only text of the user has no comma. Nothing is written if the library
    psutil is not installed, or if the disk is full.

    Parameters
    ----------
    folder : path
        The folder of results.
    """
    try:
        import psutil
    except ImportError:
        # The workflow requires psutil. Without it, no workflow reads the table.
        return
    ancestors = " ".join(str(parent.pid) for parent in psutil.Process().parents())
    process = Process(
        ended_s=time.time(),
        cpu_s=measure_processor_time_s(),
        log=_find_log(),
        host=platform.node(),
        ancestors=ancestors,
    )
    line = ",".join(map(str, process)) + "\n"

    # Append the line to the table. Ignore a full disk, because the files of the job
    # itself are complete.
    table = Path(folder) / TABLE_PATH
    with suppress(OSError):
        table.parent.mkdir(exist_ok=True)
        with open_descriptor(table, os.O_APPEND) as handle:
            is_new = os.fstat(handle).st_size == 0
            header = ",".join(Process._fields) + "\n" if is_new else ""
            # Use a single write, so that lines of processes that end at the same time
            # do not mix.
            os.write(handle, f"{header}{line}".encode())


def _find_log() -> str:
    """Find the log to which this process writes its errors; empty if it is unknown."""
    try:
        path = os.path.relpath(os.readlink("/proc/self/fd/2"))
    except (OSError, ValueError):
        return ""
    return path if path.endswith(".log") and "," not in path else ""


def list_processes_since(folder: str | os.PathLike, start_s: float) -> list[Process]:
    """List the processes in the table of a results folder that ended after a time.

    Parameters
    ----------
    folder : path
        The folder of results. It may have no table.
    start_s : float
        The time, in seconds since 1970.

    Returns
    -------
    list of Process
        The processes in the order of the table.
    """
    table = Path(folder) / TABLE_PATH
    if not table.is_file():
        return []
    with table.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.reader(handle))[1:]  # without the header

    processes = []
    for row in rows:
        # Skip a line that a full disk has cut off.
        if len(row) != len(Process._fields):
            continue
        # The cells are in the order of the fields of `Process`.
        ended_s, cpu_s, log, host, ancestors = row
        process = Process(float(ended_s), float(cpu_s), log, host, ancestors)
        if process.ended_s >= start_s:
            processes.append(process)
    return processes


def correct_benchmarks(folder: str | os.PathLike, processes: Iterable[Process]) -> None:
    """Correct the processor time in the benchmarks that snakemake has written.

    Snakemake reads the processor time only at intervals, so its number is too small.

    Parameters
    ----------
    folder : path
        The folder of results. The benchmarks in it are changed.
    processes : iterable of Process
        The processes of all jobs.
    """
    # Group the processes by job. All processes of a job write into its log, and the
    # paths of log and benchmark differ only in folder and suffix.
    processes_by_log: dict[str, list[Process]] = defaultdict(list)
    for process in processes:
        processes_by_log[process.log].append(process)

    logs = Path(folder) / LOGS
    for log, job_processes in processes_by_log.items():
        if not Path(log).is_relative_to(logs):
            continue
        name = Path(log).relative_to(logs).with_suffix(".tsv")
        benchmark = Path(folder) / BENCHMARKS / name
        # The benchmark of a failed job is missing or incomplete. A failed correction of
        # these numbers must not stop the workflow either.
        with suppress(OSError, ValueError):
            _correct_benchmark(benchmark, job_processes)


def _correct_benchmark(path: Path, processes: Iterable[Process]) -> None:
    """Replace the processor time in the benchmark of a job.

    The new value is the sum of the processor times of its processes. A benchmark is a
    table, separated by tabs, with a header and a row for each run of the job. Only the
    last row is changed.

    Parameters
    ----------
    path : Path
        The benchmark, which is rewritten.
    processes : iterable of Process
        The processes of all runs of the job.

    Raises
    ------
    OSError, ValueError
        If the benchmark is missing or incomplete.
    """
    # This raises ValueError for a file with fewer than two lines.
    header, *earlier_rows, last_row = path.read_text(encoding="utf-8").splitlines()
    names = header.split("\t")
    values = last_row.split("\t")

    # Snakemake writes the file at the end of a run. Subtract the duration of the last
    # run to find its start, and leave out the processes of earlier runs.
    duration_s = float(values[names.index(DURATION_COLUMN)])
    start_s = path.stat().st_mtime - duration_s - CLOCK_TOLERANCE_S
    cpu_s = sum(process.cpu_s for process in processes if process.ended_s >= start_s)

    values[names.index(CPU_TIME_COLUMN)] = f"{cpu_s:.2f}"
    lines = [header, *earlier_rows, "\t".join(values)]
    content = ("\n".join(lines) + "\n").encode()
    write_atomically(path, lambda handle: handle.write(content))
