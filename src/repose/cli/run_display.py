"""The display of `repose run`: bars by stage on a terminal, a line now and then elsewhere, each failure with its log.

Snakemake reports its work as events; `LogHandler` is a handler of them, as its logger plugins are. `RunProgress` keeps
their content: finished jobs of each stage, pours a minute, time left, and failures. All times are seconds of the
system's clock, which also dates files.
"""

import sys
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from logging import INFO, LogRecord
from pathlib import Path
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from repose.measure.saved_pours import POURS

# Snakemake finds plugins by the name of a package; this one is registered by hand, under the name that it would have.
PLUGIN = "snakemake_logger_plugin_repose"
NAME = "repose"
# Without a terminal, the shortest time between two lines.
LINE_EVERY_S = 60.0
REFRESH_PER_S = 2
# Rates of a shorter time are too uncertain.
SHORTEST_RATE_S = 1.0
BAR_WIDTH = 30
LOG_LINES = 20
# Messages of snakemake that are of no use to a waiting user.
CHATTER = (
    "Assuming unrestricted",
    "Building DAG",
    "Execute ",
    "Group jobs:",
    "Provided ",
    "Rules claiming",
    "Select jobs",
    "Using shell",
    "Will exit after finishing",
    "host:",
)
# A job's failure is reported by the job's own event.
REPORTED_BY_THE_JOB = ("CalledProcessError", "RuleException", "SpawnedJobError")


@dataclass(frozen=True)
class Running:
    """A job that runs, or has failed."""

    stage: str
    message: str  # its work in words
    began_s: float
    pours: int  # planned runs of a bench test
    output: str = ""  # its first output

    def made(self) -> int | None:
        """Runs made so far, without those of an earlier job; None for a job that does not keep each run."""
        if not self.output.endswith(POURS):
            return None
        done = Path(self.output)
        kept = list((done.parent / "runs").glob(f"{done.name.removesuffix(POURS)}_*.npz"))
        fresh = sum(path.stat().st_mtime >= self.began_s for path in kept)
        return min(self.pours, fresh) if kept else None


@dataclass
class Stage:
    """A stage of the workflow."""

    done: int = 0  # jobs
    total: int = 0  # jobs


@dataclass
class RunProgress:
    """The state of a run while it goes on."""

    stages: dict[str, Stage] = field(default_factory=dict)  # those with work, in the order of the workflow
    running: dict[int, Running] = field(default_factory=dict)  # by the job's number
    failed: dict[int, Running] = field(default_factory=dict)  # by the job's number, until it begins again
    _stage_of: Mapping[str, str] = field(default_factory=dict)  # stage of each rule
    _planned: dict[int, tuple[int, float]] = field(default_factory=dict)  # runs, expected time on a core [s]
    _done: dict[int, int] = field(default_factory=dict)  # by the job's number: runs made
    _began_s: float | None = None
    _first_pour_s: float | None = None

    def plan(self, stage_of: Mapping[str, str], jobs: Mapping[str, Mapping[int, tuple[int, float]]]) -> None:
        """Take the stage of each rule, in the order of the workflow, and of each rule its planned jobs by number.

        A job is its runs of a bench test and its expected time on a core [s].
        """
        self._stage_of = stage_of
        for name in dict.fromkeys(stage_of.values()):
            numbers = [number for rule in jobs if stage_of.get(rule) == name for number in jobs[rule]]
            if numbers:
                self.stages[name] = Stage(total=len(numbers))
        self._planned = {number: planned for known in jobs.values() for number, planned in known.items()}

    def start(self, number: int, rule: str, message: str, output: str, now_s: float) -> Running:
        """A job begins, or begins again; `message` is its work in words, `output` its first output."""
        name = self._stage_of.get(rule, rule)
        if number not in self._planned:  # a checkpoint has added it
            self._planned[number] = (0, 0.0)
            self.stages.setdefault(name, Stage()).total += 1
        self.failed.pop(number, None)
        job = Running(name, message, now_s, self._planned[number][0], output)
        self.running[number] = job
        self._began_s = now_s if self._began_s is None else self._began_s
        if job.pours and self._first_pour_s is None:
            self._first_pour_s = now_s
        return job

    def finish(self, number: int) -> None:
        """A job has ended well."""
        job = self.running.pop(number, None)
        if job is not None:
            made = job.made()
            self._done[number] = job.pours if made is None else made
            self.stages[job.stage].done += 1

    def fail(self, number: int) -> Running | None:
        """A job has failed; None if that is known already."""
        job = self.running.pop(number, None)
        if job is not None:
            self.failed[number] = job
        return job

    @property
    def pours_done(self) -> int:
        """Pours that this run has made, those of unfinished jobs included."""
        return sum(self._done.values()) + sum(job.made() or 0 for job in self.running.values())

    def pours_a_minute(self, now_s: float) -> float | None:
        """Rate since the first pour began; None before the first is made."""
        done = self.pours_done
        if not done or self._first_pour_s is None or now_s - self._first_pour_s < SHORTEST_RATE_S:
            return None
        return 60 * done / (now_s - self._first_pour_s)

    def left_s(self, now_s: float) -> float | None:
        """Time that the planned jobs still take, at the rate of the finished ones; None before that is known.

        Where pours are planned, that is before the first of them is made.
        """
        pouring = any(pours for pours, _ in self._planned.values())
        began_s = self._first_pour_s if pouring else self._began_s
        if began_s is None or now_s - began_s < SHORTEST_RATE_S or (pouring and not self.pours_done):
            return None
        whole_s = sum(work_s for _, work_s in self._planned.values())
        done_s = sum(self._share_done(number) * work_s for number, (_, work_s) in self._planned.items())
        return (whole_s - done_s) * (now_s - began_s) / done_s if done_s else None

    def _share_done(self, number: int) -> float:
        """The finished share of a job."""
        if number in self._done:
            return 1.0
        job = self.running.get(number)
        return (job.made() or 0) / job.pours if job and job.pours else 0.0


class LogHandler(LogHandlerBase):
    """The display, as snakemake's registry of logger plugins takes it."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False

    def __post_init__(self) -> None:
        self.console = Console(stderr=True, highlight=False, soft_wrap=True)
        self.progress = RunProgress()
        self.live: Live | None = None
        self.logs: dict[int, str] = {}
        self.stages_printed: set[str] = set()
        self.last_line_s = 0.0
        # Events come in one thread, another draws. No printing under this lock: printing waits for the drawing.
        self.changing = threading.Lock()

    def emit(self, record: LogRecord) -> None:
        """Take an event of snakemake."""
        try:
            with self.changing:
                lines = list(self._lines_of(record))
            if "plan" in record.__dict__:
                self._begin()
            for line in lines:
                self.console.print(line)
        except Exception:  # a display that fails is no reason to stop the work
            self.handleError(record)

    def close(self) -> None:
        """Leave the bars as they are, and print the failures."""
        if self.live is not None:
            self.live.stop()
            self.live = None
        failed, self.progress.failed = self.progress.failed, {}
        for number, job in failed.items():
            self.console.print(Text(f"failed: {job.message}{self._log_of(number)}", style="red"))
        if failed:
            self.console.print("When the cause is mended, the same command goes on.")
        super().close()

    def _lines_of(self, record: LogRecord) -> Iterator[Text]:
        """Take an event; yields the lines to print."""
        event, fields = getattr(record, "event", None), record.__dict__
        if "plan" in fields:
            self.progress.plan(*fields["plan"])
        if event == LogEvent.JOB_INFO:
            yield from self._started(fields)
        elif event == LogEvent.JOB_FINISHED:
            self.progress.finish(fields["job_id"])
            yield from self._line()
        elif event == LogEvent.JOB_ERROR:
            yield from self._failed(fields)
        elif event == LogEvent.ERROR:
            if fields.get("exception") not in REPORTED_BY_THE_JOB:
                yield Text(record.getMessage(), style="red")
        elif event is None and record.msg:
            if record.levelno > INFO:
                yield Text(record.getMessage(), style="yellow")
            elif not str(record.msg).startswith(CHATTER):
                yield Text(record.getMessage())

    def _started(self, fields: Mapping[str, Any]) -> Iterator[Text]:
        """A job begins; without bars the first of a stage is printed."""
        if not fields["output"]:  # a target, which makes nothing
            return
        number, rule = fields["jobid"], fields["rule_name"]
        message = fields["rule_msg"] or rule
        self.logs[number] = ", ".join(fields["log"])
        job = self.progress.start(number, rule, message, str(fields["output"][0]), time.time())
        if self.live is None and job.stage not in self.stages_printed:
            yield Text(f"{job.stage}: {message}")
        self.stages_printed.add(job.stage)

    def _failed(self, fields: Mapping[str, Any]) -> Iterator[Text]:
        """A job has failed: print it, and the end of its log."""
        number = fields["jobid"]
        job = self.progress.fail(number)
        if job is None:
            return
        head = f"FAILED: {job.message} (rule {fields['rule_name']}){self._log_of(number)}"
        yield Text(head, style="bold red")
        for log in fields["log"]:
            yield from (Text(f"    {line}") for line in last_lines(Path(log)))

    def _log_of(self, number):
        log = self.logs.get(number)
        return f"; its log: {log}" if log else ""

    def _begin(self):
        """Show the bars, where there is a terminal."""
        if self.console.is_terminal and self.live is None and self.progress.stages:
            self.live = Live(
                get_renderable=self._drawn,
                console=self.console,
                refresh_per_second=REFRESH_PER_S,
                redirect_stdout=sys.stdout.isatty(),
                vertical_overflow="crop",
            )
            self.live.start()

    def _line(self) -> Iterator[Text]:
        """Progress of the run, now and then where there are no bars."""
        now = time.time()
        if self.live is None and self.progress.stages and now - self.last_line_s >= LINE_EVERY_S:
            self.last_line_s = now
            stages = self.progress.stages.values()
            done, total = sum(stage.done for stage in stages), sum(stage.total for stage in stages)
            yield Text(f"{done} of {total} jobs; {', '.join(self._facts(now))}")

    def _facts(self, now_s: float) -> Iterator[str]:
        """Pours a minute, time left and failures, in words."""
        rate, left_s = self.progress.pours_a_minute(now_s), self.progress.left_s(now_s)
        if rate is not None:
            yield f"{rate:.2g} pours a minute"
        yield f"{rough_time(left_s)} left" if left_s is not None else "time left: known after the first pours"
        if self.progress.failed:
            yield f"{len(self.progress.failed)} failed"

    def _drawn(self) -> RenderableType:
        """The bars, the facts and the running jobs."""
        with self.changing:
            now = time.time()
            rows = max(3, self.console.height - 5)
            stages = list(self.progress.stages.items())
            if len(stages) > rows:  # the finished ones go first
                stages = [item for item in stages if item[1].done < item[1].total][:rows]
            table = Table.grid(padding=(0, 2))
            for name, stage in stages:
                bar = ProgressBar(total=stage.total, completed=stage.done, width=BAR_WIDTH)
                table.add_row(name.replace("_", " "), bar, f"{stage.done} of {stage.total}")
            running = [f"{job.message} ({now - job.began_s:.0f} s)" for job in self.progress.running.values()]
            words = f"now: {'; '.join(running)}" if running else ""
            return Group(
                table,
                Text(", ".join(self._facts(now)), style="bold red" if self.progress.failed else "bold"),
                Text(words, style="dim", overflow="ellipsis", no_wrap=True),
            )


def rough_time(seconds: float) -> str:
    """A rough time in words."""
    minutes = round(seconds / 60)
    if minutes < 1:
        return "less than a minute"
    if minutes < 90:
        return f"about {minutes} min"
    return f"about {minutes // 60} h {minutes % 60} min"


def last_lines(path: Path) -> list[str]:
    """The last lines of a log, or a line that reports a missing or empty one."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ["(there is no such file)"]
    return lines[-LOG_LINES:] or ["(it is empty)"]


def register() -> list[str]:
    """Make the display known to snakemake; returns the options of snakemake that choose it."""
    from snakemake_interface_logger_plugins.registry import LoggerPluginRegistry

    LoggerPluginRegistry().register_plugin(PLUGIN, sys.modules[__name__])
    return [f"--logger={NAME}"]  # as one word: as two it would take the targets behind it, too
