"""Prepare a run of the workflow: make its study, lock its folder, report its time.

Snakemake reads the Snakefile for each of its commands, even for those that run no job.
Reading it makes the study and checks the folder of results, but writes nothing. A run
with jobs begins with `WorkflowRun.start`, and prints its times when it ends.
"""

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from repose.common import attached, usage
from repose.common.errors import InputError, exit_on_fault
from repose.common.ledger import LEDGER
from repose.common.lock import lock_folder
from repose.common.numbers import format_decimals
from repose.config import dependencies, earlier_check, loader, results_folder
from repose.config.pipeline import PipelineConfig
from repose.config.results_folder import RUN_TIMES_FILE

# Beginning of the line that a stage prints when it rejects its input.
ERROR_PREFIX = "repose: error:"


def prepare_run(
    config: Mapping[str, Any],
    configfiles: Sequence[str],
    has_command_line: bool,
    check_inputs: bool,
) -> "WorkflowRun":
    """Check Snakemake's `config`, and prepare a run of the workflow with it.

    If an earlier run has checked the same configuration, the check is skipped
    (`repose.config.earlier_check`). This does not apply to a study with another
    program.

    Parameters
    ----------
    config : mapping
        Snakemake's `config`, in which later files override earlier ones, and --config
        overrides all of them.
    configfiles : sequence of str
        The files of --configfile, in this order. Error messages name them.
    has_command_line : bool
        Whether --config has changed any value.
    check_inputs : bool
        Whether to check the files that the configuration names.

    Returns
    -------
    WorkflowRun
        The run, which has not started.

    Raises
    ------
    InputError
        With all errors of the configuration.
    """
    # Values that are in no file come from the command line or from another workflow.
    files = [_make_relative_path(path) for path in configfiles]
    source = loader.COMMAND_LINE if has_command_line else loader.WORKFLOW_SOURCE
    if loader.is_external(config):
        from repose.config.external import ExternalConfig

        merged = loader.locate_workflow_values(config, files, source)
        external_study = ExternalConfig.from_merged(merged, check_inputs=check_inputs)
        return WorkflowRun(external_study)
    merged = loader.merge_workflow_values(config, files, source)

    # Reuse the result of an earlier check, if there is one of this configuration.
    fingerprint = earlier_check.compute_fingerprint(merged.config)
    resolved = earlier_check.read_checked_config(merged.config, fingerprint)
    if resolved is not None:
        return WorkflowRun(PipelineConfig(resolved, merged.origin))

    # Check the configuration now. With a fingerprint, the run stores the result for
    # later runs. These may reuse only a check that includes all input files.
    study = PipelineConfig.of(merged.config, merged.origin, check_inputs=check_inputs)
    return WorkflowRun(study, new_fingerprint=fingerprint if check_inputs else None)


def _make_relative_path(path: str) -> str:
    """Return a path relative to the working directory if it lies below it."""
    here = os.getcwd()
    absolute = os.path.abspath(path)
    is_below = os.path.commonpath([absolute, here]) == here
    return os.path.relpath(absolute, here) if is_below else absolute


def has_pour_jobs(workflow: Any) -> bool:
    """Return whether Snakemake is going to run a job that simulates a pile.

    The names of the rules of such jobs end with ``pour``.
    """
    return any(job.rule.name.endswith("pour") for job in workflow.dag.needrun_jobs())


def check_kept_results_when_planned(workflow: Any, study: PipelineConfig) -> None:
    """Make Snakemake check the results that a run keeps, as soon as the run is planned.

    Snakemake has its own records of settings. These may be lost, changed by
    ``--touch``, or ignored by ``--rerun-triggers``, so the check uses the records of
    provenance in the results instead. A result that was made with other settings ends
    the program with a message.

    This function replaces a private method of the workflow, which plans the jobs.

    Parameters
    ----------
    workflow : snakemake.workflow.Workflow
        The workflow that reads the Snakefile.
    study : PipelineConfig
        The study whose results the folder should hold.
    """
    # Snakemake calls ``onstart`` only if it has jobs to run. A check there would miss
    # dry runs, and runs that find nothing to do.
    plan_jobs = workflow._build_dag

    def plan_jobs_and_check() -> None:
        plan_jobs()
        with exit_on_fault():
            _require_same_settings(
                study, _find_kept_results(workflow, study.settings.results_dir)
            )

    workflow._build_dag = plan_jobs_and_check


def _find_kept_results(workflow: Any, folder: str) -> Iterator[str]:
    """Yield the existing results in a folder that the planned run does not make again."""
    for job in workflow.dag.jobs:
        if workflow.touch or not workflow.dag.needrun(job):
            for path in job.output:
                if path.startswith(f"{folder}/") and os.path.isfile(path):
                    yield str(path)


def _require_same_settings(study: PipelineConfig, paths: Iterable[str]) -> None:
    """Raise InputError for the first result that was made with other settings."""
    for path in sorted(paths):
        difference = dependencies.find_difference(
            study.config, attached.read_record(path)
        )
        if difference is not None:
            raise InputError(
                path,
                key=difference.key,
                value=difference.recorded,
                allowed=f"{difference.current}, as in this study: this run would keep the result, and mix "
                "results of two studies; add --forceall (pours of equal settings are "
                "kept), take the earlier value, or choose another results_dir",
            )


def handle_sigterm_in_thread() -> None:
    """Call Snakemake's handler of SIGTERM in a thread, so that it cannot deadlock.

    SIGTERM asks the process to stop. Snakemake's handler waits for a lock
    (`JobScheduler.exit_gracefully` in Snakemake 9.27). Python calls handlers in the
    main thread, which itself holds the lock while it selects jobs and records finished
    ones. A signal at such a moment would block the run for ever.

    Call this function after Snakemake has set its handler, for example in ``onstart``.
    The function replaces the handler of this process.
    """
    # Snakemake sets its handler only in the main thread.
    if threading.current_thread() is not threading.main_thread():
        return
    handler = signal.getsignal(signal.SIGTERM)
    if not callable(handler):
        return
    # Signals wait in this queue. A second signal may arrive while the first is being
    # put into it. Of all queues in Python, only this one documents that `put` may be
    # called in the middle of another `put`.
    signal_numbers: SimpleQueue[int] = SimpleQueue()

    def call_handler() -> None:
        """Call the handler for each signal in the queue; never return."""
        while True:
            handler(signal_numbers.get(), None)

    threading.Thread(target=call_handler, daemon=True).start()
    signal.signal(signal.SIGTERM, lambda number, _frame: signal_numbers.put(number))


class WorkflowRun:
    """A run of the workflow in this process.

    Parameters
    ----------
    study : PipelineConfig
        The study that the run works on.
    new_fingerprint : str, optional
        The fingerprint of the configuration, if this run was the first to check it. The
        run then stores the result of the check for later commands. None if the result
        has already been stored.
    """

    def __init__(
        self, study: PipelineConfig, new_fingerprint: str | None = None
    ) -> None:
        self.study = study
        self.new_fingerprint = new_fingerprint
        self.folder = study.settings.results_dir
        self.start_s = _estimate_process_start_s()
        # Holds the lock of the folder of results until the process ends.
        self._locks = ExitStack()

    def start(self, outputs: Iterable[str]) -> None:
        """Start the run: lock the folder of results, and write what the jobs need.

        The function also writes new lists of results (ledgers) where they are missing,
        and stores the result of the check of the configuration. The lock lasts until
        the process ends. The process then prints the times of the run, after everything
        that Snakemake prints.

        Parameters
        ----------
        outputs : iterable of str
            Paths that rules write, with their wildcards in braces.

        Raises
        ------
        InputError
            If another run of the workflow uses the folder.
        """
        # The lock comes first, because the other steps write into the folder.
        self._locks.enter_context(lock_folder(self.folder))
        listed_results = results_folder.restore_ledgers(self.folder, outputs)
        if listed_results:
            print(
                f"repose: note: {self.folder} has lost its lists of written files "
                f"({LEDGER}), perhaps because it was copied without hidden files; "
                f"{len(listed_results)} results were recognised by their records and listed again",
                file=sys.stderr,
            )

        # Write the configuration for the jobs. If this run was the first to check it,
        # also store the result of the check for later commands.
        self.write_configuration()
        if self.new_fingerprint is not None:
            earlier_check.write_checked_config(self.new_fingerprint, self.study.config)
        # A function that is registered with `atexit` is called when the process ends,
        # so after everything that Snakemake prints. The lock is still held then.
        atexit.register(self._record_times)

    def write_configuration(self) -> None:
        """Write the configuration that the jobs read."""
        loader.write_resolved(
            self.study.config, Path(self.folder) / loader.RESOLVED_FILE
        )

    def has_written(self, path: str) -> bool:
        """Tell whether a job of this run wrote a file.

        The answer is False if Snakemake only changed the time of the file.
        """
        has_run_jobs = bool(usage.list_processes_since(self.folder, self.start_s))
        return (
            has_run_jobs
            and os.path.exists(path)
            and os.stat(path).st_mtime >= self.start_s
        )

    def has_bad_input(self) -> bool:
        """Tell whether a job of this run rejected its input.

        A stage that rejects its input writes the error as the last line of its log.
        """
        last_lines = []
        for path in Path(self.folder, "logs").rglob("*.log"):
            if path.stat().st_mtime >= self.start_s:
                text = path.read_text(encoding="utf-8", errors="replace")
                last_lines.append(text.rstrip().rpartition("\n")[2])
        return any(line.startswith(ERROR_PREFIX) for line in last_lines)

    def _record_times(self) -> None:
        """Print the times of this run of the workflow, and add them to a table.

        Snakemake writes a benchmark of each job, a file with its times. The function
        also corrects the processor time in these files, which is too small. If the run
        had no jobs, the function does nothing.
        """
        import pandas as pd

        from repose.common.files import read_table, write_table

        processes = usage.list_processes_since(self.folder, self.start_s)
        if not processes:
            return
        usage.correct_benchmarks(self.folder, processes)

        # Add this run to the table of earlier runs.
        path = f"{self.folder}/{RUN_TIMES_FILE}"
        row = self._measure_times(processes)
        runs = pd.DataFrame([row])
        if os.path.exists(path):
            runs = pd.concat([read_table(path, row), runs])

        # Print the time of this run, and that of all runs.
        this_run = runs[-1:]
        text = f"time: {_format_total_times(this_run)} on {row['processor']}"
        if len(runs) > 1:
            text += f"; all {len(runs)} runs: {_format_total_times(runs)}"
        # Printing fails if the terminal was closed. Write the table nevertheless.
        with suppress(OSError):
            print(f"{text} ({path})", file=sys.stderr)
        write_table(path, runs)

    def _measure_times(self, processes: Iterable[usage.Process]) -> dict[str, Any]:
        """Measure the times of this run, as a row of the table of runs.

        Parameters
        ----------
        processes : iterable of usage.Process
            The jobs of this run.

        Returns
        -------
        dict
            When the run began, its time by the clock and its processor time [s], and
            the name of the processor.
        """
        from repose.common.provenance import describe_machine

        start = time.gmtime(self.start_s)
        return {
            "began": time.strftime("%Y-%m-%dT%H:%M:%SZ", start),
            "wall_s": round(time.time() - self.start_s, 1),
            "cpu_s": round(_sum_processor_time_s(processes), 1),
            "processor": describe_machine()["processor"],
        }


def _sum_processor_time_s(jobs: Iterable[usage.Process]) -> float:
    """Add up the processor time of this process and of all jobs of its run [s].

    A job that is a child of this process is already included in the time of this
    process. Jobs on other machines are not.
    """
    this_process = str(os.getpid())
    this_host = os.uname().nodename
    cpu_s = usage.measure_processor_time_s()
    for job in jobs:
        is_child = job.host == this_host and this_process in job.ancestors.split()
        if not is_child:
            cpu_s += job.cpu_s
    return cpu_s


def _format_total_times(runs: Any) -> str:
    """Write the total times of a table of runs as text."""
    wall_min = runs["wall_s"].sum() / 60
    cpu_min = runs["cpu_s"].sum() / 60
    return (
        f"{format_decimals(wall_min, 1)} min by the clock, "
        f"{format_decimals(cpu_min, 1)} min of processor time"
    )


def _estimate_process_start_s() -> float:
    """Estimate when this process started, in seconds since 1970.

    So far the process has only imported libraries and read the Snakefile, which keeps
    the processor busy. Its processor time is therefore roughly its age.
    """
    return time.time() - time.process_time()


def check_folder(study: PipelineConfig, outputs: Iterable[str]) -> None:
    """Check that no file of the user has the name of a result of the study.

    Parameters
    ----------
    study : PipelineConfig
        The study, whose folder of results is checked.
    outputs : iterable of str
        Paths that rules write, with their wildcards in braces.

    Raises
    ------
    InputError
        For files that this program did not write, or that somebody has changed.
    """
    results_folder.check_no_foreign_files(study.settings.results_dir, outputs)
