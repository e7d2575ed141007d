"""Processor time of the jobs of a study: each of their processes notes its own at its end.

Snakemake's benchmark of a job ends at its last look, a half minute before the end of a long one.
"""

import csv
import os
import time
from collections.abc import Iterable
from contextlib import suppress
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

TABLE = "benchmarks/processes.csv"
LOG, BENCHMARK = (
    ("logs", ".log"),
    ("benchmarks", ".tsv"),
)  # folder and ending of both files of a job
LATE_S = 1.0  # a process may end later than its job began by so much less


class Used(NamedTuple):
    """What a process used; `log` is that of its job, `ancestors` are the processes that started it."""

    ended_s: float
    cpu_s: float
    log: str
    host: str
    ancestors: str


def note(folder: str | os.PathLike) -> None:
    """Add this process to the table of a folder of results, in one write that no other mixes with."""
    try:
        import psutil
    except ImportError:  # no workflow is installed here
        return
    ancestors = " ".join(str(one.pid) for one in psutil.Process().parents())
    row = Used(time.time(), used_here_s(), _log(), os.uname().nodename, ancestors)
    table = Path(folder) / TABLE
    line = ",".join(map(str, row)) + "\n"
    with suppress(OSError):  # the disk is full: the job itself has its files
        table.parent.mkdir(exist_ok=True)
        with table.open("a", encoding="utf-8") as handle:
            handle.write(line if handle.tell() else f"{','.join(Used._fields)}\n{line}")


def _ended_children_s() -> float:
    """Add up the processor time of the children of this process that have ended [s]."""
    with suppress(ImportError):  # Windows, where no workflow runs, has none
        import resource

        return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    return 0.0


# Of the commands that a shell ran before it became this process [s].
EARLIER_S = _ended_children_s()


def used_here_s() -> float:
    """Add up the processor time of this program and of its children that have ended [s]."""
    return time.process_time() + _ended_children_s() - EARLIER_S


def _log() -> str:
    """Find the file that takes this process's errors, where the system names it; empty otherwise."""
    with suppress(OSError, ValueError):
        path = os.path.relpath(os.readlink("/proc/self/fd/2"))
        return path if path.endswith(LOG[1]) and "," not in path else ""
    return ""


def since(folder: str | os.PathLike, began_s: float) -> list[Used]:
    """List the processes that have ended in a folder of results since a time."""
    table = Path(folder) / TABLE
    if not table.is_file():
        return []
    with table.open(encoding="utf-8", newline="") as handle:
        rows = [row for row in csv.reader(handle) if len(row) == len(Used._fields)][1:]
    return [
        Used(float(ended), float(cpu), *others)
        for ended, cpu, *others in rows
        if float(ended) >= began_s
    ]


def correct_benchmarks(folder: str | os.PathLike, used: Iterable[Used]) -> None:
    """Put the processor time of the whole job into snakemake's benchmark of each job."""
    of_log = attrgetter("log")
    for log, processes in groupby(sorted(used, key=of_log), of_log):
        with suppress(
            ValueError, OSError
        ):  # of no job, or it failed and has no benchmark
            path = (
                Path(folder)
                / BENCHMARK[0]
                / Path(log).relative_to(Path(folder) / LOG[0]).with_suffix(BENCHMARK[1])
            )
            *rows, last = path.read_text(encoding="utf-8").splitlines()
            names, values = rows[0].split("\t"), last.split("\t")
            began_s = path.stat().st_mtime - float(values[names.index("s")]) - LATE_S
            values[names.index("cpu_time")] = (
                f"{sum(one.cpu_s for one in processes if one.ended_s >= began_s):.2f}"
            )
            path.write_text(
                "\n".join([*rows, "\t".join(values)]) + "\n", encoding="utf-8"
            )
