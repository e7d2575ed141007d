"""The display of `repose run`: bars by stage on a terminal, a line now and then elsewhere, each failure with its log.

Snakemake reports its work as events; this is a handler of them, as its logger plugins are.
"""

import sys
import threading
import time
from collections.abc import Iterator
from logging import INFO, LogRecord
from pathlib import Path

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from repose.cli.run_progress import RunProgress, in_words

# Snakemake finds plugins by the name of a package; this one is registered by hand, under the name that it would have.
PLUGIN = "snakemake_logger_plugin_repose"
NAME = "repose"
# Without a terminal, the shortest time between two lines.
LINE_EVERY_S = 60.0
REFRESH_PER_S = 2
BAR_WIDTH = 30
LOG_LINES = 20
# Messages of snakemake that do not help a user who waits.
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
TOLD_BY_THE_JOB = ("CalledProcessError", "RuleException", "SpawnedJobError")


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
        self.stages_said: set[str] = set()
        self.last_line_s = 0.0
        # Events come in one thread, another draws. No printing under this lock: printing waits for the drawing.
        self.changing = threading.Lock()

    def emit(self, record: LogRecord) -> None:
        """Take an event of snakemake."""
        try:
            with self.changing:
                lines = list(self._told_by(record))
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

    def _told_by(self, record) -> Iterator[Text]:
        """Take an event; yields the lines to print."""
        event, told = getattr(record, "event", None), record.__dict__
        if "plan" in told:
            self.progress.plan(*told["plan"])
        if event == LogEvent.JOB_INFO:
            yield from self._started(told)
        elif event == LogEvent.JOB_FINISHED:
            self.progress.finish(told["job_id"])
            yield from self._line()
        elif event == LogEvent.JOB_ERROR:
            yield from self._failed(told)
        elif event == LogEvent.ERROR:
            if told.get("exception") not in TOLD_BY_THE_JOB:
                yield Text(record.getMessage(), style="red")
        elif event is None and record.msg:
            if record.levelno > INFO:
                yield Text(record.getMessage(), style="yellow")
            elif not str(record.msg).startswith(CHATTER):
                yield Text(record.getMessage())

    def _started(self, told) -> Iterator[Text]:
        """A job begins; without bars the first of a stage is printed."""
        if not told["output"]:  # a target, which makes nothing
            return
        number, rule = told["jobid"], told["rule_name"]
        message = told["rule_msg"] or rule
        self.logs[number] = ", ".join(told["log"])
        job = self.progress.start(number, rule, message, str(told["output"][0]), time.time())
        if self.live is None and job.stage not in self.stages_said:
            yield Text(f"{job.stage}: {message}")
        self.stages_said.add(job.stage)

    def _failed(self, told) -> Iterator[Text]:
        """A job has failed: print it, and the end of its log."""
        number = told["jobid"]
        job = self.progress.fail(number)
        if job is None:
            return
        head = f"FAILED: {job.message} (rule {told['rule_name']}){self._log_of(number)}"
        yield Text(head, style="bold red")
        for log in told["log"]:
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

    def _facts(self, now_s) -> Iterator[str]:
        """Pours a minute, time left and failures, in words."""
        rate, left_s = self.progress.pours_a_minute(now_s), self.progress.left_s(now_s)
        if rate is not None:
            yield f"{rate:.2g} pours a minute"
        yield f"{in_words(left_s)} left" if left_s is not None else "time left: known after the first pours"
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
