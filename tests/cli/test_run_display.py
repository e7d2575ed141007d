"""What `repose run` shows: stages, progress, time left, faults."""

import logging
import os
import pty
import re
import select
import shutil
import signal
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from refusals import raised
from shared import says, written
from snakemake_interface_logger_plugins.common import LogEvent

from repose.cli import run_display
from repose.cli.run_display import Running, RunProgress, rough_time
from repose.common import places

STATS = {"pour": 2, "miga": 1, "all": 1, "total": 4}
SIGNALS = {
    "interrupt": signal.SIGINT,
    "end": signal.SIGTERM,
    "hangup": signal.SIGHUP,
    "kill": signal.SIGKILL,
}
BEGAN_S = 1000.0
WORKFLOW = """
rule all:
    default_target: True
    input: expand("{number}.pours.json", number=range(4))

rule pour:
    output: "{number}.pours.json"
    log: "{number}.log"
    message: "Pouring {wildcards.number}"
    shell:
        "echo emitted > {log}; test ! -e fail_{wildcards.number}; sleep $(cat seconds); mkdir -p runs;"
        " touch runs/{wildcards.number}_1.npz {output}"
"""


def emitted(message=None, level=logging.INFO, **extra):
    record = logging.LogRecord("snakemake", level, __file__, 1, message, (), None)
    record.__dict__.update(extra)
    return record


def job_info(number, rule, output, log=()):
    words = {
        "jobid": number,
        "rule_name": rule,
        "rule_msg": f"Doing {rule} {number}",
        "log": list(log),
    }
    return emitted(event=LogEvent.JOB_INFO, output=output, **words)


def planned():
    return emitted("Job stats", event=LogEvent.RUN_INFO, stats=STATS)


@pytest.fixture
def handler(capsys):
    before = signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # ignored where the tests run in the background
    handler = run_display.LogHandler(SimpleNamespace(), None)
    yield handler
    handler.close()
    signal.signal(signal.SIGINT, before)


def test_without_a_terminal_stages_and_seldom_lines(
    handler, capsys, monkeypatch, tmp_path
):
    now = [1000.0]
    monkeypatch.setattr(time, "time", lambda: now[0])
    handler.emit(planned())
    handler.emit(job_info(7, "all", []))
    for number in (1, 2):
        handler.emit(job_info(number, "pour", [tmp_path / f"{number}.pours.json"]))
        for seed in (1, 2):
            (tmp_path / "runs").mkdir(exist_ok=True)
            (tmp_path / "runs" / f"{number}_{seed}.npz").touch()
        now[0] += 30
        handler.emit(emitted(event=LogEvent.JOB_FINISHED, job_id=number))
    handler.emit(emitted("Select jobs to execute..."))
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "pour: Doing pour 1",
        "pour 1 of 2, all 1 of 3 jobs; 4 pours a minute, less than a minute left",
    ]


def test_a_failure_is_named_with_its_log_and_the_end_of_it(handler, capsys, tmp_path):
    log = str(tmp_path / "001.log")
    Path(log).write_text("".join(f"line {k}\n" for k in range(100)))
    handler.emit(planned())
    handler.emit(job_info(1, "pour", ["heap"], [log]))
    error = emitted(
        "Error in rule pour",
        logging.ERROR,
        event=LogEvent.JOB_ERROR,
        jobid=1,
        rule_name="pour",
        log=[log],
    )
    handler.emit(error)
    handler.emit(error)  # a group tells its jobs once more
    err = capsys.readouterr().err
    assert err.count(f"FAILED: Doing pour 1 (rule pour); its log: {log}") == 1
    assert "    line 99\n" in err
    assert "line 79\n" not in err
    handler.close()
    assert "failed: Doing pour 1" in capsys.readouterr().err


def test_a_job_that_ctrl_c_ends_has_not_failed(handler, capsys, monkeypatch):
    signalled = []
    monkeypatch.setattr(handler, "act_on_ctrl_c", lambda *_: signalled.append("act"))
    handler.emit(planned())
    handler.emit(job_info(1, "pour", ["heap"]))
    signal.raise_signal(signal.SIGINT)
    handler.emit(
        emitted(
            "Error in rule pour",
            logging.ERROR,
            event=LogEvent.JOB_ERROR,
            jobid=1,
            log=[],
        )
    )
    summary = f"WorkflowError:\n{run_display.SUMMED_UP}"
    handler.emit(
        emitted(summary, logging.ERROR, event=LogEvent.ERROR, exception="WorkflowError")
    )
    handler.emit(
        emitted(
            "Exiting because a job execution failed. Look above for error messages",
            logging.ERROR,
        )
    )
    handler.emit(emitted("Elapsed time: 0:00:01"))
    handler.close()
    assert signalled == ["act"]
    assert capsys.readouterr().err.splitlines() == ["pour: Doing pour 1"]


def test_plain_snakemake_says_too_that_the_same_command_goes_on(handler, capsys):
    raised(KeyboardInterrupt, None, signal.raise_signal, signal.SIGINT)
    handler.close()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert (
        capsys.readouterr().err
        == "Stopped. What is finished stays; the same command goes on.\n"
    )


def test_no_time_is_awaited_where_nothing_pours_errors_are_said_and_targets_are_no_stage(
    handler, capsys
):
    handler.emit(
        emitted("Job stats", event=LogEvent.RUN_INFO, stats={"design": 2, "total": 2})
    )
    handler.emit(job_info(1, "design", ["samples.csv"]))
    handler.emit(emitted(event=LogEvent.JOB_FINISHED, job_id=1))
    assert capsys.readouterr().err.splitlines()[-1] == "design 1 of 2, all 1 of 2 jobs"
    handler.emit(
        emitted(
            "no such rule",
            logging.ERROR,
            event=LogEvent.ERROR,
            exception="MissingRuleException",
        )
    )
    assert "no such rule" in capsys.readouterr().err
    handler.emit(planned())
    handler.emit(job_info(7, "all", []))
    assert "Doing all" not in capsys.readouterr().err


def test_an_empty_log_says_so_and_snakemake_finds_the_display_by_its_package(
    tmp_path, monkeypatch
):
    log = tmp_path / "a.log"
    log.touch()
    assert run_display.last_lines(log) == ["(it is empty)"]
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=0))
    assert run_display.last_lines(log) == ["(it is empty: the disk is full)"]
    from snakemake_interface_logger_plugins.registry import LoggerPluginRegistry

    assert (
        LoggerPluginRegistry().get_plugin("repose").log_handler
        is run_display.LogHandler
    )


@pytest.mark.parametrize(
    "option", ["dryrun", "quiet", "verbose", "printshellcmds", "debug_dag"]
)
def test_an_option_for_snakemakes_own_output_shows_that(option, capsys):
    options = (
        "dryrun",
        "verbose",
        "printshellcmds",
        "debug_dag",
        "show_failed_logs",
        "stdout",
        "nocolor",
    )
    settings = SimpleNamespace(**dict.fromkeys(options, False), quiet=None)
    setattr(settings, option, {"progress"} if option == "quiet" else True)
    run_display.LogHandler(settings, None).emit(emitted("Select jobs to execute..."))
    assert capsys.readouterr().err == "Select jobs to execute...\n"


class Terminal:
    """`repose run` of a workflow of naps, in a pseudo terminal."""

    def __init__(self, folder, *words):
        self.shown = ""
        self.process, self.screen = pty.fork()
        if self.process == 0:
            os.chdir(folder)
            signal.signal(
                signal.SIGHUP, signal.SIG_DFL
            )  # the tests may run under nohup
            os.environ.update(TERM="xterm", COLUMNS="100", LINES="30")
            program = [
                sys.executable,
                "-m",
                "repose",
                "run",
                "-s",
                "Snakefile",
                "--cores",
                "2",
                *words,
            ]
            os.execv(sys.executable, program)

    def until(self, pattern, limit_s=120):
        end = time.monotonic() + limit_s
        while not re.search(pattern, self.shown):
            assert time.monotonic() < end, self.shown
            self._read()

    def ended(self, limit_s=120):
        """Exit status, as a shell has it; and the seconds that the end took."""
        began = time.monotonic()
        while time.monotonic() < began + limit_s and self._read():
            pass
        _, status = os.waitpid(self.process, 0)
        return os.waitstatus_to_exitcode(status), time.monotonic() - began

    def _read(self):
        ready, _, _ = select.select([self.screen], [], [], 0.2)
        try:
            new = (
                os.read(self.screen, 65536).decode(errors="replace") if ready else None
            )
        except OSError:  # the other side is closed
            return False
        self.shown += new or ""
        return new != ""


@pytest.fixture
def naps(tmp_path):
    (tmp_path / "Snakefile").write_text(WORKFLOW)
    shutil.copytree(
        places.root() / "profiles" / "default", tmp_path / "profiles" / "default"
    )
    (tmp_path / "seconds").write_text("0.1")
    return tmp_path


@pytest.mark.slow
def test_a_terminal_shows_bars_and_a_failure_with_its_log(naps):
    (naps / "fail_3").touch()
    (naps / "seconds").write_text("1.5")
    terminal = Terminal(naps, "--keep-going")
    assert terminal.ended()[0] == 1
    assert re.search(r"pour .*3 of 4", terminal.shown)
    says(
        terminal.shown,
        "pours a minute",
        "FAILED: Pouring 3 (rule pour); its log: 3.log",
    )
    assert "    emitted\r\n" in terminal.shown  # its log
    assert "the same command goes on" in terminal.shown


@pytest.mark.slow
@pytest.mark.parametrize(
    "end",
    [
        *(pytest.param(end, marks=pytest.mark.essential) for end in ("ctrl-c", "kill")),
        *("interrupt", "end", "hangup"),
    ],
)
def test_an_ended_run_goes_on_with_the_same_command(naps, end):
    # jobs outlive a killed program: the terminal ends with them
    (naps / "seconds").write_text("5" if end == "kill" else "60")
    first = Terminal(naps)
    first.until(r"now: Pouring")
    if end == "ctrl-c":
        os.write(first.screen, b"\x03")
    else:  # without a terminal only the program itself is signalled, not its jobs
        os.kill(first.process, SIGNALS[end])
    status, took_s = first.ended()
    if end == "kill":
        assert status == -signal.SIGKILL
    else:
        assert status == 128 + SIGNALS.get(end, signal.SIGINT)
        assert took_s < 10
        assert not re.search("failed|FAILED|Error", first.shown)
        assert (
            "the same command goes on: repose run -s Snakefile --cores 2" in first.shown
        )
    (naps / "seconds").write_text("0.1")
    again = Terminal(naps)
    assert again.ended()[0] == 0, again.shown
    assert re.search(r"pour .*4 of 4", again.shown)


@pytest.fixture
def plan():
    """A job for the sizes, four that pour, and a search."""
    progress = RunProgress()
    progress.planned.update({"berry": 1, "pour": 4, "miga": 1})
    return progress


def pour(number, folder, began_s=BEGAN_S):
    return Running("pour", "Pouring", began_s, str(folder / f"{number}.pours.json"))


def kept(folder, name, date_s):
    (folder / "runs").mkdir(exist_ok=True)
    path = folder / "runs" / name
    path.touch()
    os.utime(path, (date_s, date_s))


def test_nothing_is_reported_before_the_first_pour_is_made(plan, tmp_path):
    plan.start(8, Running("berry", "Sizes", BEGAN_S - 100, "berry.json"))
    plan.finish(8, BEGAN_S)
    plan.start(0, pour(0, tmp_path))
    assert (plan.pours_a_minute(BEGAN_S + 50), plan.left_s(BEGAN_S + 50)) == (
        None,
        None,
    )


def test_rate_and_time_left_of_finished_jobs(plan, tmp_path):
    for number in (0, 1):
        plan.start(number, pour(number, tmp_path))
        for seed in (1, 2, 3):
            kept(tmp_path, f"{number}_{seed}.npz", BEGAN_S + 10 * seed)
    for number in (0, 1):
        plan.finish(number, BEGAN_S + 40)
    # six pours in 40 s; two jobs at once, of which two more are left
    assert (plan.pours_a_minute(BEGAN_S + 40), plan.left_s(BEGAN_S + 40)) == (
        pytest.approx(9.0),
        pytest.approx(40.0),
    )
    assert plan.done["pour"] == 2


def test_a_job_counts_the_runs_that_it_has_kept_since_it_began(plan, tmp_path):
    kept(tmp_path, "001_1.npz", BEGAN_S - 500)
    kept(tmp_path, "001_2.npz", BEGAN_S + 10)
    kept(tmp_path, "0010_3.npz", BEGAN_S + 10)  # of another job
    plan.start(0, pour("001", tmp_path))
    assert (plan.pours_done, plan.pours_a_minute(BEGAN_S + 60)) == (
        1,
        pytest.approx(1.0),
    )
    plan.finish(0, BEGAN_S + 60)
    assert plan.pours_done == 1, "a run that was kept before is not poured again"


def test_a_complete_job_counts_the_runs_that_it_has_timed(plan, tmp_path):
    (tmp_path / "timings").mkdir()
    for number, date_s in (("001", BEGAN_S + 50), ("002", BEGAN_S - 500)):
        os.utime(
            written(
                tmp_path / f"timings/{number}.json", '{"wall_s": {"7": 3.1, "8": 2.9}}'
            ),
            (date_s, date_s),
        )
        plan.start(int(number), pour(number, tmp_path))
        plan.finish(int(number), BEGAN_S + 60)
    assert plan.pours_done == 2


def test_jobs_of_a_checkpoint_are_planned_and_a_failed_one_known_until_they_begin(
    plan, tmp_path
):
    plan.start(0, pour(0, tmp_path))
    assert plan.fail(0).rule == "pour"
    assert plan.fail(0) is None
    assert list(plan.failed) == [0]
    plan.start(0, pour(0, tmp_path))
    assert not plan.failed
    for number in range(5):
        plan.start(number, pour(number, tmp_path))
        plan.finish(number, BEGAN_S + 10)
    assert plan.planned["pour"] == 5


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (20, "less than a minute"),
        (60, "about 1 min"),
        (5300, "about 88 min"),
        (7300, "about 2 h 2 min"),
    ],
)
def test_times_in_words(seconds, words):
    assert rough_time(seconds) == words
