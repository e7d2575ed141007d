"""One run of the workflow: its study, the folder that it holds, and the time it takes.

Snakemake reads the Snakefile for each of its commands, also for those that run no job.
Reading it makes the study and looks at the folder of results; it writes nothing. A run
that has jobs begins with `WorkflowRun.begin`, and prints its times when it ends.
"""

import atexit
import math
import os
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from repose.common import usage
from repose.common.lock import take_folder
from repose.config import dependencies, loader, results_folder
from repose.config.pipeline import PipelineConfig

LOGS = Path(".snakemake/log")  # snakemake writes one for each of its runs
LOG_NAME = "%Y-%m-%dT%H%M%S.%f.snakemake.log"  # by when the run began, in local time
FAULT = "repose: error:"  # begins the line in which a stage refuses its input


def study_of_workflow(
    config: Mapping[str, Any],
    configfiles: Sequence[str],
    has_command_line: bool,
    inputs: bool,
) -> PipelineConfig:
    """Make the study of what Snakemake calls `config`.

    Parameters
    ----------
    config : mapping
        Snakemake's `config`: its files over each other, and --config over them.
    configfiles : sequence of str
        The files of --configfile, in their order. Messages name them.
    has_command_line : bool
        Whether --config gave values.
    inputs : bool
        Whether to check the files that the configuration names.

    Returns
    -------
    PipelineConfig

    Raises
    ------
    InputError
        With all faults of the configuration.
    """
    files = [_as_typed(path) for path in configfiles]
    source = loader.COMMAND_LINE if has_command_line else loader.WORKFLOW
    return PipelineConfig.of(
        *loader.over_defaults(config, files, source), inputs=inputs
    )


def _as_typed(path: str) -> str:
    """Return a path relative to the working directory if it lies below it."""
    here = os.getcwd()
    absolute = os.path.abspath(path)
    is_below = os.path.commonpath([absolute, here]) == here
    return os.path.relpath(absolute, here) if is_below else absolute


def fault_of_lost_records(
    study: PipelineConfig, results: Iterable[str], outputs: Iterable[str]
) -> str:
    """Describe results of other settings, or of another engine, that Snakemake cannot know.

    Snakemake compares the settings of results with its records of them. The oldest of
    its logs tells when these records began; for an older result its own record counts.

    Parameters
    ----------
    study : PipelineConfig
        The study whose results the folder should hold.
    results : iterable of str
        Paths of results; those that do not exist are left out.
    outputs : iterable of str
        Paths that rules write, with their wildcards in braces.

    Returns
    -------
    str
        A sentence; empty if there are no such results.
    """
    folder = Path(study.settings.results_dir)
    # The batches of a strategy are known once they are made.
    is_output = results_folder.pattern_of(outputs).fullmatch
    files = map(str, sorted(folder.glob("*/batch_*/**/*.json")))
    batches = filter(is_output, files)
    records_began_s = _start_of_records_s()
    unknown = []
    for path in (*results, *batches):
        if os.path.exists(path) and os.stat(path).st_mtime < records_began_s:
            unknown.append(path)
    outdated = dependencies.outdated(study.config, unknown)
    if not outdated:
        return ""
    return (
        f"{outdated[0]} and {len(outdated) - 1} more results were made with other "
        "settings or by another engine, and the records of snakemake are lost: add "
        "--forceall"
    )


def _start_of_records_s() -> float:
    """Return when the first run began of which Snakemake has a log; inf without logs."""
    starts_s = []
    for log in LOGS.glob("*.log"):
        # a file of another name is no log of a run
        with suppress(ValueError):
            starts_s.append(datetime.strptime(log.name, LOG_NAME).timestamp())
    return min(starts_s, default=math.inf)


class WorkflowRun:
    """A run of the workflow in this process.

    Parameters
    ----------
    study : PipelineConfig
        The study that it works on.
    """

    def __init__(self, study: PipelineConfig) -> None:
        self.study = study
        self.folder = study.settings.results_dir
        self.began_s = _start_of_process_s()
        self._held = ExitStack()  # the folder of results

    def begin(self) -> None:
        """Hold the folder of results, and write the configuration that its jobs read.

        The folder is held until the process ends. Then the times of the run are
        printed, after all that Snakemake prints.

        Raises
        ------
        InputError
            If another run of the workflow holds the folder.
        """
        self._held.enter_context(take_folder(self.folder))
        self.write_configuration()
        atexit.register(self._report_times)

    def write_configuration(self) -> None:
        """Write the configuration that the jobs read."""
        loader.write_resolved(self.study.config, Path(self.folder) / loader.RESOLVED)

    def made(self, path: str) -> bool:
        """Tell whether a job of this run wrote a file, and did not only touch it."""
        has_run_jobs = bool(usage.since(self.folder, self.began_s))
        return (
            has_run_jobs
            and os.path.exists(path)
            and os.stat(path).st_mtime >= self.began_s
        )

    def has_bad_input(self) -> bool:
        """Tell whether a job of this run refused its input.

        A stage that refuses its input prints the fault as the last line of its log.
        """
        last_lines = []
        for path in Path(self.folder, "logs").rglob("*.log"):
            if path.stat().st_mtime >= self.began_s:
                text = path.read_text(encoding="utf-8", errors="replace")
                last_lines.append(text.rstrip().rpartition("\n")[2])
        return any(line.startswith(FAULT) for line in last_lines)

    def _report_times(self) -> None:
        """Print the times of this run if a job ran, and add them to the table of runs."""
        import pandas as pd

        from repose.common.files import read_table, write_table
        from repose.common.provenance import machine

        processes = usage.since(self.folder, self.began_s)
        if not processes:
            return
        usage.correct_benchmarks(self.folder, processes)

        # Jobs on this machine are children of this process. Their time counts with it.
        this_process = str(os.getpid())
        this_host = os.uname().nodename
        cpu_s = usage.used_here_s()
        for process in processes:
            is_child = this_process in process.ancestors.split()
            if process.host != this_host or not is_child:
                cpu_s += process.cpu_s

        path = f"{self.folder}/benchmarks/calls.csv"
        began = time.gmtime(self.began_s)
        row = {
            "began": time.strftime("%Y-%m-%dT%H:%M:%SZ", began),
            "wall_s": round(time.time() - self.began_s, 1),
            "cpu_s": round(cpu_s, 1),
            "processor": machine()["processor"],
        }
        runs = pd.DataFrame([row])
        if os.path.exists(path):
            runs = pd.concat([read_table(path, row), runs])

        text = f"time: {_times(runs[-1:])} on {row['processor']}"
        if len(runs) > 1:
            text += f"; all {len(runs)} calls: {_times(runs)}"
        with suppress(OSError):  # the terminal is closed
            print(f"{text} ({path})", file=sys.stderr)
        write_table(path, runs)


def _times(runs: Any) -> str:
    """Write the sums of a table of runs as text."""
    wall_min = runs["wall_s"].sum() / 60
    cpu_min = runs["cpu_s"].sum() / 60
    return f"{wall_min:.1f} min by the clock, {cpu_min:.1f} min of processor time"


def _start_of_process_s() -> float:
    """Return when this program began, in seconds of the system's clock.

    It has computed all the time since then: it imported its libraries and read the
    Snakefile.
    """
    return time.time() - time.process_time()


def check_folder(study: PipelineConfig, outputs: Iterable[str]) -> None:
    """Check that the study's folder has no foreign file in the place of a result.

    Parameters
    ----------
    study : PipelineConfig
        The study whose folder it is.
    outputs : iterable of str
        Paths that rules write, with their wildcards in braces.

    Raises
    ------
    InputError
        For files that this program did not write, or that somebody has changed.
    """
    results_folder.check_no_foreign_files(study.settings.results_dir, outputs)
