"""The display of a run: stages and their bars on a terminal, a line now and then elsewhere, each failure with its log.

Snakemake reports its work as events; `LogHandler` is a logger plugin of it, which `profiles/default` chooses and
`snakemake_logger_plugin_repose` makes known. All times are seconds of the system's clock, which also dates files.
"""

import logging
import re
import shutil
import signal
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text
from snakemake.logging import ColorizingTextHandler, DefaultFilter, DefaultFormatter
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent
from snakemake_interface_logger_plugins.settings import OutputSettingsLoggerInterface

from repose.common.errors import InputError, did_you_mean
from repose.common.files import read_json
from repose.measure.saved_pours import POURS

# Without a terminal, the shortest time between two lines.
LINE_EVERY_S = 60.0
REFRESH_PER_S = 2
# Rates of a shorter time are too uncertain.
SHORTEST_RATE_S = 1.0
BAR_WIDTH = 30
LOG_LINES = 20
# Messages of snakemake that are of no use to a waiting user.
CHATTER = re.compile(
    "Assuming unrestricted|Building DAG|Complete log|(Conda environments|Singularity containers): ignored|Elapsed time"
    "|Execute |Exiting because a job execution failed|Group jobs:|Provided |Rules claiming|Select jobs|Shutting down"
    "|Terminating processes on user request|Touching output file|Using shell|Will exit after finishing|host:"
)
REFUSED = "repose: error"  # begins the last line of a job whose input was at fault
FAULTS: list[
    str
] = []  # of the input, where they alone ended the run: `repose run` then ends as the verbs do
# A job's failure is reported by the job's own event.
REPORTED_BY_THE_JOB = ("CalledProcessError", "RuleException", "SpawnedJobError")
SUMMED_UP = "At least one job did not complete successfully."
INTERRUPT_S = 0.2  # Ctrl-C may end a job before this program knows of it
FULL_DISK_BYTES = 2**16


@dataclass(frozen=True)
class Running:
    """A job that runs, or has failed."""

    rule: str
    message: str  # on its work, as snakemake prints it
    began_s: float
    output: str = ""  # its first output
    log: str = ""

    def made(self) -> int:
        """Count the runs of a bench test made so far, without the runs of an earlier job."""
        if not self.output.endswith(POURS):
            return 0
        job = Path(self.output.removesuffix(POURS))
        timed = (
            job.parent / "timings" / f"{job.name}.json"
        )  # written when all are made; then none is kept by itself
        if timed.is_file() and timed.stat().st_mtime >= self.began_s:
            return len(read_json(timed, ("wall_s",))["wall_s"])
        return sum(
            path.stat().st_mtime >= self.began_s
            for path in (job.parent / "runs").glob(f"{job.name}_*.npz")
        )

    @property
    def refused(self) -> bool:
        """Whether it ended with a fault of its input."""
        return self.log != "" and last_lines(Path(self.log))[-1].startswith(
            f"{REFUSED}: "
        )

    def __str__(self) -> str:
        return f"{self.message}; its log: {self.log}" if self.log else self.message


def _pours(rule: str) -> bool:
    """Return whether the jobs of a rule simulate, which takes nearly all time of a run, by its name."""
    return rule.endswith("pour")


@dataclass
class RunProgress:
    """The state of a run while it goes on."""

    planned: Counter[str] = field(default_factory=Counter)  # jobs of each rule
    done: Counter[str] = field(default_factory=Counter)  # the same
    running: dict[int, Running] = field(default_factory=dict)  # by the job's number
    failed: dict[int, Running] = field(
        default_factory=dict
    )  # by the job's number, until it begins again
    # wall time of the finished jobs of each rule
    _took_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _made: int = 0  # runs of a bench test by finished jobs
    _began_s: float | None = None
    _first_pour_s: float | None = None

    def start(self, number: int, job: Running) -> None:
        """Note that a job begins; after a checkpoint its rule may have more jobs than were planned."""
        self.failed.pop(number, None)
        self.running[number] = job
        busy = sum(other.rule == job.rule for other in self.running.values())
        self.planned[job.rule] = max(self.planned[job.rule], self.done[job.rule] + busy)
        self._began_s = self._began_s or job.began_s
        if _pours(job.rule):
            self._first_pour_s = self._first_pour_s or job.began_s

    def finish(self, number: int, now_s: float) -> None:
        """Note that a job has ended well."""
        if (job := self.running.pop(number, None)) is not None:
            self._made += job.made()
            self._took_s[job.rule] += now_s - job.began_s
            self.done[job.rule] += 1

    def fail(self, number: int) -> Running | None:
        """Note that a job has failed, and return it; None if that is known already."""
        if (job := self.running.pop(number, None)) is not None:
            self.failed[number] = job
        return job

    @property
    def pours_done(self) -> int:
        """Pours that this run has made, unfinished jobs included."""
        return self._made + sum(job.made() for job in self.running.values())

    def pours_a_minute(self, now_s: float) -> float | None:
        """Compute the rate since the first pour began; None before the first is made."""
        took_s = now_s - (self._first_pour_s or now_s)
        return (
            60 * self.pours_done / took_s
            if self.pours_done and took_s >= SHORTEST_RATE_S
            else None
        )

    def left_s(self, now_s: float) -> float | None:
        """Estimate how long the planned jobs still take, as many at once as so far; None before that is possible."""
        pouring = [rule for rule in self.planned if _pours(rule)]
        took_s = now_s - (self._began_s or now_s)
        if (
            not self.done
            or took_s < SHORTEST_RATE_S
            or (pouring and not any(self.done[rule] for rule in pouring))
        ):
            return None
        elapsed = [(job.rule, now_s - job.began_s) for job in self.running.values()]
        busy_s = sum(self._took_s.values()) + sum(s for _, s in elapsed)
        left_s = sum(
            (self.planned[rule] - self.done[rule]) * self._mean_s(rule)
            for rule in self.planned
        )
        left_s -= sum(min(s, self._mean_s(rule)) for rule, s in elapsed)
        return left_s * took_s / busy_s

    def _mean_s(self, rule: str) -> float:
        """Average the times of a rule's finished jobs, or else of the jobs of its kind, pouring or not."""
        rules = (
            [rule]
            if self.done[rule]
            else [other for other in self.done if _pours(other) == _pours(rule)]
        )
        return sum(self._took_s[one] for one in rules) / max(
            1, sum(self.done[one] for one in rules)
        )


class LogHandler(LogHandlerBase):
    """The display of a run, or snakemake's own output where an option such as --dry-run or --quiet asks for it."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False

    def __post_init__(self) -> None:
        self.plain = _snakemakes_own(self.common_settings)
        self.console = Console(stderr=True, highlight=False, soft_wrap=True)
        self.progress = RunProgress()
        self.live: Live | None = None
        self.stage = ""  # rule of the last job that began
        self.stages_printed: set[str] = set()
        self.last_line_s = 0.0
        # Events come in one thread, another draws. No printing under this lock: printing waits for the drawing.
        self.changing = threading.Lock()
        self.interrupted = threading.Event()
        self.act_on_ctrl_c = signal.getsignal(signal.SIGINT)
        self.raises = logging.raiseExceptions
        if self.plain is None:
            logging.raiseExceptions = (
                False  # no tracebacks of snakemake's log where the disk is full
            )
            if (
                callable(self.act_on_ctrl_c)
                and threading.current_thread() is threading.main_thread()
            ):
                signal.signal(signal.SIGINT, self._interrupt)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        """Note a Ctrl-C before the program acts on it: the jobs that it ends have not failed."""
        self.interrupted.set()
        assert callable(self.act_on_ctrl_c)
        self.act_on_ctrl_c(number, frame)

    def emit(self, record: logging.LogRecord) -> None:
        """Take an event of snakemake."""
        if self.plain is not None:
            self.plain.handle(record)
            return
        try:
            with self.changing:
                lines = list(self._lines_of(record))
            if getattr(record, "event", None) == LogEvent.RUN_INFO:
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
        if (
            self.interrupted.is_set()
            and self.act_on_ctrl_c is signal.default_int_handler
        ):  # not `repose run`
            self.console.print(
                "Stopped. What is finished stays; the same command goes on."
            )
            self.interrupted.clear()  # closed twice
        jobs, self.progress.failed = self.progress.failed.values(), {}
        failed, refused = (
            [job for job in jobs if job.refused is of_input]
            for of_input in (False, True)
        )
        for job in failed:
            self.console.print(Text(f"failed: {job}", style="red"))
        if failed:
            self.console.print("When the cause is mended, the same command goes on.")
        elif refused:
            FAULTS.extend(sorted({last_lines(Path(job.log))[-1] for job in refused}))
            self.console.print(Text("\n".join(FAULTS)))
        logging.raiseExceptions = self.raises
        if signal.getsignal(signal.SIGINT) == self._interrupt:
            signal.signal(signal.SIGINT, self.act_on_ctrl_c)
        super().close()

    def _lines_of(self, record: logging.LogRecord) -> Iterator[Text]:
        """Take an event; yield the lines to print."""
        event, fields = getattr(record, "event", None), record.__dict__
        if event == LogEvent.RUN_INFO:
            self.progress.planned.update(
                {k: n for k, n in fields["stats"].items() if k != "total"}
            )
        elif event == LogEvent.JOB_INFO:
            yield from self._started(fields)
        elif event == LogEvent.JOB_FINISHED:
            self.progress.finish(fields["job_id"], time.time())
            yield from self._line()
        elif event == LogEvent.JOB_ERROR:
            yield from self._failed(fields)
        elif (
            event == LogEvent.ERROR
            and fields.get("exception") == "MissingRuleException"
        ):
            from repose.config.cost import SENTENCES

            missing = (
                record.getMessage()
                .split("No rule to produce ")[-1]
                .split(" (if you")[0]
            )
            allowed = "a target that `repose run --list` names, a rule, or a file of the study"
            allowed += did_you_mean(missing, SENTENCES)
            FAULTS.append(
                f"{REFUSED}: {InputError('command line', 'target', missing, allowed)}"
            )
            yield Text(FAULTS[-1])
        elif event == LogEvent.ERROR:
            if (
                fields.get("exception") not in REPORTED_BY_THE_JOB
                and SUMMED_UP not in record.getMessage()
            ):
                yield Text(record.getMessage(), style="red")
        elif event is None and record.msg and not CHATTER.match(str(record.msg)):
            yield Text(
                record.getMessage(),
                style="yellow" if record.levelno > logging.INFO else "",
            )

    def _started(self, fields: Mapping[str, Any]) -> Iterator[Text]:
        """Note that a job begins; without bars print the first of a stage."""
        rule = fields["rule_name"]
        if not fields["output"]:  # a target, which makes nothing
            del self.progress.planned[rule]
            return
        message, log = fields["rule_msg"] or rule, ", ".join(fields["log"])
        self.progress.start(
            fields["jobid"],
            Running(rule, message, time.time(), str(fields["output"][0]), log),
        )
        self.stage = rule
        if self.live is None and rule not in self.stages_printed:
            yield Text(f"{rule}: {message}")
        self.stages_printed.add(rule)

    def _failed(self, fields: Mapping[str, Any]) -> Iterator[Text]:
        """Note that a job has failed: print it, and the end of its log."""
        if (
            self.interrupted.wait(INTERRUPT_S)
            or (job := self.progress.fail(fields["jobid"])) is None
        ):
            return
        yield Text(
            f"FAILED: {job.message} (rule {job.rule})"
            + str(job).removeprefix(job.message),
            style="bold red",
        )
        for log in fields["log"]:
            yield from (Text(f"    {line}") for line in last_lines(Path(log)))

    def _begin(self) -> None:
        """Show the bars, where there is a terminal."""
        if self.console.is_terminal and self.live is None and self.progress.planned:
            how: dict[str, Any] = {
                "refresh_per_second": REFRESH_PER_S,
                "redirect_stdout": sys.stdout.isatty(),
            }
            self.live = Live(
                get_renderable=self._drawn,
                console=self.console,
                vertical_overflow="crop",
                **how,
            )
            self.live.start()

    def _line(self) -> Iterator[Text]:
        """Report the progress of the run, now and then where there are no bars."""
        now = time.time()
        if (
            self.live is None
            and self.progress.planned
            and now - self.last_line_s >= LINE_EVERY_S
        ):
            self.last_line_s = now
            done, planned = self.progress.done, self.progress.planned
            stages = (job.rule for job in self.progress.running.values())
            stage = next(filter(_pours, stages), self.stage)
            counts = f"{stage} {done[stage]} of {planned[stage]}, all {done.total()} of {planned.total()} jobs"
            yield Text("; ".join(filter(None, (counts, ", ".join(self._facts(now))))))

    def _facts(self, now_s: float) -> Iterator[str]:
        """Say how many pours a minute there are, the time left and the failures."""
        progress = self.progress
        rate, left_s = progress.pours_a_minute(now_s), progress.left_s(now_s)
        if rate is not None:
            yield f"{rate:.2g} pours a minute"
        if left_s is not None and progress.done != progress.planned:
            yield f"{rough_time(left_s)} left"
        elif left_s is None and any(map(_pours, progress.planned)):
            yield "time left: known after the first pours"
        if progress.failed:
            yield f"{len(progress.failed)} failed"

    def _drawn(self) -> RenderableType:
        """Draw the bars of the stages at work and of all, the facts, and the running jobs."""
        with self.changing:
            now = time.time()
            planned, done = self.progress.planned, self.progress.done
            jobs = list(self.progress.running.values())
            stages = dict.fromkeys([self.stage, *(job.rule for job in jobs)])
            rows = [
                (rule.replace("_", " "), done[rule], planned[rule])
                for rule in stages
                if rule
            ]
            table = Table.grid(padding=(0, 2))
            for name, made, total in (*rows, ("all", done.total(), planned.total())):
                table.add_row(
                    name,
                    ProgressBar(total=total, completed=made, width=BAR_WIDTH),
                    f"{made} of {total}",
                )
            running = "; ".join(
                f"{job.message} ({now - job.began_s:.0f} s)" for job in jobs
            )
            return Group(
                table,
                Text(
                    ", ".join(self._facts(now)),
                    style="bold red" if self.progress.failed else "bold",
                ),
                Text(
                    running and f"now: {running}",
                    style="dim",
                    overflow="ellipsis",
                    no_wrap=True,
                ),
            )


def _snakemakes_own(settings: OutputSettingsLoggerInterface) -> logging.Handler | None:
    """Return snakemake's own output if an option asks for it; else None."""
    filtered = ("quiet", "debug_dag", "verbose", "dryrun", "printshellcmds")
    if not any(getattr(settings, name, None) for name in (*filtered, "stdout")):
        return None
    return ColorizingTextHandler(
        nocolor=settings.nocolor,
        stream=sys.stdout if settings.stdout else sys.stderr,
        formatter=DefaultFormatter(settings.quiet, settings.show_failed_logs),
        filter=DefaultFilter(*(getattr(settings, name) for name in filtered)),
    )


def rough_time(seconds: float) -> str:
    """Write a rough time as text."""
    minutes = round(seconds / 60)
    if 1 <= minutes < 90:
        return f"about {minutes} min"
    return (
        f"about {minutes // 60} h {minutes % 60} min"
        if minutes
        else "less than a minute"
    )


def last_lines(path: Path) -> list[str]:
    """Return the last lines of a log, or a line that reports a missing or empty one."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ["(there is no such file)"]
    if not lines and shutil.disk_usage(path.parent).free < FULL_DISK_BYTES:
        return ["(it is empty: the disk is full)"]
    return lines[-LOG_LINES:] or ["(it is empty)"]
