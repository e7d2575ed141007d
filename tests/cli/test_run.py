"""`repose run`: what snakemake is given."""

import contextlib
import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from repose.calibrate import strategies
from repose.cli.interruption import Interruption
from repose.common import places

SNAKEFILE = ["--snakefile", str(places.find_program_folder() / "Snakefile")]
ALL = ["--cores", "all"]
WRONG = "command line: --config is"
QUICK = str(places.find_program_folder() / "config/quick.yaml")
SLURM = str(places.find_program_folder() / "profiles/slurm")


@pytest.fixture
def passed(monkeypatch):
    arguments = []
    monkeypatch.setattr("snakemake.cli.main", arguments.extend)
    return arguments


def test_words_become_those_of_snakemake(tmp_path, monkeypatch, passed, command):
    """All cores where none are given, and files of the program that an empty folder lacks; targets stay in front."""
    monkeypatch.chdir(tmp_path)
    for name in ("mine.yaml", "more.yaml"):
        (tmp_path / name).write_text("label: mine\n")
    cases = {
        "": [*ALL, *SNAKEFILE],
        **{
            arguments: ["--cores", "2", *SNAKEFILE]
            for arguments in ("--cores 2", "--cores=2", "-c2")
        },
        **{
            arguments: ["--cores", "2", *SNAKEFILE, "refined"]
            for arguments in ("refined -c 2", "--cores 2 refined")
        },
        "-j 3": ["--jobs", "3", *SNAKEFILE],
        "--profile mine": ["--profile", "mine", *SNAKEFILE],
        "berry --profile profiles/slurm -n": [
            "--profile",
            SLURM,
            *SNAKEFILE,
            "berry",
            "-n",
        ],
        "-s mine.smk -c1": ["--cores", "1", "--snakefile", "mine.smk"],
        "-c1 --configfile config/quick.yaml": [
            "--configfile",
            QUICK,
            "--cores",
            "1",
            *SNAKEFILE,
        ],
        "-c1 --configfile=config/quick.yaml": [
            "--configfile",
            QUICK,
            "--cores",
            "1",
            *SNAKEFILE,
        ],
    }
    layers = [
        "--configfile",
        "mine.yaml",
        "more.yaml",
        "--cores",
        "2",
        *SNAKEFILE,
        "uncertainty",
        "-np",
    ]
    labelled = [
        "--configfile",
        "mine.yaml",
        "--config",
        "label=mine",
        *ALL,
        *SNAKEFILE,
        "-n",
        "--",
        "berry",
    ]
    cases |= {"uncertainty -c2 --configfile mine.yaml more.yaml -np": layers}
    cases |= {"-n --config label=mine --configfile mine.yaml -- berry": labelled}
    for arguments, expected in cases.items():
        passed.clear()
        command("run", *arguments.split())
        assert passed == expected, arguments


def test_a_target_that_no_rule_makes_is_named_with_the_nearest(tmp_path):
    (tmp_path / "Snakefile").write_text(
        "rule uncertainty:\n    output: 'one.txt'\n    shell: 'touch {output}'\n"
    )
    call = [sys.executable, "-m", "repose", "run", "uncertanty", "-c1", "-sSnakefile"]
    done = subprocess.run(
        [*call, "--workflow-profile", "none"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    message = "repose: error: command line: target is 'uncertanty'; expected a rule"
    assert message in done.stderr
    assert "did you mean uncertainty?" in done.stderr


def test_a_file_that_no_rule_makes_is_named_with_the_nearest(
    tmp_path, monkeypatch, command
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "Snakefile").write_text(
        "rule page:\n    output: 'results/report.html'\n    shell: 'touch {output}'\n"
    )
    # As snakemake ends with any target that it cannot make, in the test above.
    monkeypatch.setattr("snakemake.cli.main", lambda _: sys.exit(1))
    call = ["run", "results/reprot.html", "-c1", "-sSnakefile"]
    message = command(*call, "--workflow-profile", "none", status=2).err
    assert "target is 'results/reprot.html'; expected a file that" in message
    assert "did you mean results/report.html?" in message


def test_a_dotted_key_is_answered_with_the_form_that_snakemake_takes(passed, command):
    for entry, form in {
        "funnel.seeds=2": "'funnel={seeds: 2}'",
        "a.b.c=1": "'a={b: {c: 1}}'",
    }.items():
        message = (
            f"--config is '{entry}'; expected a section with its keys, as in {form}"
        )
        assert message in command("run", "--config", entry, status=2).err
    assert passed == []


def test_what_a_call_of_run_may_hold(passed, command, tmp_path, monkeypatch):
    """A file after --config is pointed to --configfile, and a dry run may read a folder of others."""
    message = command("run", "--config", "mine.yaml", status=2).err
    assert "a file is given by --configfile mine.yaml" in message
    missing = command("run", "--directory", str(tmp_path / "new"), status=2).err
    assert "expected an existing folder" in missing
    assert not (tmp_path / "new").exists()
    command("run", "--cores", "2", "--cores", "3")
    assert passed[passed.index("--cores") + 1] == "3"
    access = os.access
    monkeypatch.setattr(
        os, "access", lambda path, mode: path != "." and access(path, mode)
    )
    assert "you may write" in command("run", status=2).err
    command("run", "-n")


def test_where_home_cannot_be_written_the_caches_lie_in_the_folder_of_the_run(
    tmp_path, monkeypatch, passed, command
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    command("run", "-n")
    assert "XDG_CACHE_HOME" not in os.environ
    access = os.access
    monkeypatch.setattr(
        os, "access", lambda path, mode: path != tmp_path and access(path, mode)
    )
    # monkeypatch restores what the verb sets
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    command("run", "-n")
    assert os.environ["XDG_CACHE_HOME"] == str(tmp_path / ".snakemake/cache")


def test_a_number_of_threads_that_numba_cannot_take_is_named(monkeypatch, command):
    monkeypatch.setenv("NUMBA_NUM_THREADS", "0")
    message = "environment: NUMBA_NUM_THREADS is '0'; expected a whole number from 1"
    assert message in command("docs", status=2).err


def test_without_snakemake_the_message_says_what_to_install(monkeypatch, command):
    monkeypatch.setitem(sys.modules, "snakemake.cli", None)
    assert "repose-dem[workflow]" in command("run", status=2).err


@pytest.mark.parametrize("interrupted", [True, False])
def test_ctrl_c_ends_with_the_sentence_that_says_how_to_go_on_and_another_end_keeps_its_status(
    monkeypatch, command, interrupted, tmp_path
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "Snakefile").write_text(
        "rule uncertainty:\n    output: 'one.txt'\n    shell: 'touch {output}'\n"
    )

    def ended(_words):
        with contextlib.suppress(KeyboardInterrupt):
            if interrupted:
                signal.raise_signal(signal.SIGINT)
        raise SystemExit(1)  # as snakemake ends

    monkeypatch.setattr("snakemake.cli.main", ended)
    before = signal.getsignal(signal.SIGINT)
    call = "uncertainty --cores 2 -s Snakefile"
    message = command("run", *call.split(), status=130 if interrupted else 1).err
    assert (
        (f"the same command continues: repose run {call}" in message)
        is ("Stopped" in message)
        is interrupted
    )
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_ends_a_job_whose_thread_was_just_starting(monkeypatch, command):
    """Snakemake does not know a thread in whose start the exception comes."""
    statuses = []

    def run_job():
        time.sleep(0.2)
        with subprocess.Popen(["sleep", "20"]) as job:
            statuses.append(job.wait())

    def ended(_words):
        with contextlib.suppress(KeyboardInterrupt):
            threading.Thread(target=run_job).start()
            signal.raise_signal(signal.SIGINT)
        raise SystemExit(1)  # as snakemake ends

    monkeypatch.setattr("snakemake.cli.main", ended)
    command("run", status=130)
    assert statuses == [-signal.SIGINT]


def test_the_list_names_targets_with_their_cost_and_strategies_that_cannot_be(
    command, monkeypatch
):
    out = command("run", "--list", "--configfile", "config/quick.yaml").out
    rules = "".join(
        path.read_text()
        for path in (places.find_program_folder() / "workflow").rglob("*.smk")
    )
    named = [
        line.split()[0]
        for line in out.splitlines()
        if line.startswith("  ") and line[2] != " "
    ]
    assert "calibration" in named
    of_strategies = set(strategies.names())  # a rule for each, by its name
    assert all(f"rule {name}:" in rules or name in of_strategies for name in named)
    assert "Studies of quick" in out
    assert {"response_surface", "sequential", "uncertainty"} <= set(named)
    monkeypatch.chdir(places.find_program_folder() / "crops/wheat")
    assert (
        "not with this configuration: response_surface.surface; expected "
        in command("run", "--list").out
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--configfile", "no_such.yaml"],
            "no_such.yaml: file is 'No such file or directory'",
        ),
        (
            ["--configfile=config/quick.yaml", "--configfile=bad.yaml"],
            "bad.yaml: line 1 is",
        ),
        (["--config", "label"], f"{WRONG} 'label'; expected KEY=VALUE"),
        (
            ["--cores", "0"],
            "command line: --cores is '0'; expected a whole number from 1, or all",
        ),
        (
            ["--cores", "two"],
            "command line: --cores is 'two'; expected a whole number from 1, or all",
        ),
        (
            ["--jobs", "-1"],
            "command line: --jobs is '-1'; expected a whole number from 1, or unlimited",
        ),
        (
            ["--config", "label=a", "seed=1", "label=b"],
            "command line: --config is 'label 2 times'; expected each key once",
        ),
        (
            ["--config", "label=a", "uncertainty"],
            f"{WRONG} 'uncertainty'; expected KEY=VALUE; a target goes before",
        ),
    ],
)
def test_words_that_snakemake_would_answer_with_a_traceback_are_refused(
    arguments, message, tmp_path, monkeypatch, command
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text("a: [")
    monkeypatch.setattr(
        "snakemake.cli.main", lambda _words: pytest.fail("snakemake was called")
    )
    assert f"repose: error: {message}" in command("run", *arguments, status=2).err


def test_help_shows_the_options_and_other_verbs_refuse_words_that_they_do_not_know(
    command,
):
    shown = command("run", "--help").out
    assert all(
        option in shown for option in ("--configfile", "--config", "--cores", "--list")
    )
    assert (
        "unrecognized arguments: --speed 3"
        in command("check", "--speed", "3", status=2).err
    )


# --- ended by a signal ----------------------------------------------------------------

SIGNALS = {
    "interrupt": signal.SIGINT,
    "end": signal.SIGTERM,
    "hangup": signal.SIGHUP,
    "kill": signal.SIGKILL,
}
WORKFLOW = """
rule all:
    default_target: True
    input: expand("{number}.pours.json", number=range(4))

rule pour:
    output: "{number}.pours.json"
    log: "{number}.log"
    message: "Pouring {wildcards.number}"
    shell:
        "echo emitted > {log}; test ! -e fail_{wildcards.number}; sleep $(cat seconds);"
        " touch {output}"
"""


class Terminal:
    """`repose run` of a workflow of naps, in a pseudo terminal."""

    def __init__(self, folder, *arguments):
        self.shown = ""
        self.process, self.screen = pty.fork()
        if self.process == 0:
            os.chdir(folder)
            # the tests may run under nohup
            signal.signal(signal.SIGHUP, signal.SIG_DFL)
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
                *arguments,
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
    """A folder with a workflow whose jobs sleep."""
    (tmp_path / "Snakefile").write_text(WORKFLOW)
    profile = Path("profiles") / "default"
    shutil.copytree(places.find_program_folder() / profile, tmp_path / profile)
    (tmp_path / "seconds").write_text("0.1")
    return tmp_path


@pytest.mark.slow
def test_a_terminal_shows_a_failure_with_its_log(naps):
    (naps / "fail_3").touch()
    terminal = Terminal(naps, "--keep-going")
    assert terminal.ended()[0] == 1
    assert "3 of 5 steps" in terminal.shown
    assert "Error in rule pour" in terminal.shown
    assert "emitted\r\n" in terminal.shown  # its log


@pytest.mark.slow
@pytest.mark.parametrize(
    "end",
    [
        *(pytest.param(end, marks=pytest.mark.essential) for end in ("ctrl-c", "kill")),
        "interrupt",
        "end",
        "hangup",
    ],
)
def test_an_ended_run_goes_on_with_the_same_command(naps, end):
    # jobs outlive a killed program: the terminal ends with them
    (naps / "seconds").write_text("5" if end == "kill" else "60")
    first = Terminal(naps)
    first.until(r"Pouring \d")
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
        goes_on = "the same command continues: repose run -s Snakefile --cores 2"
        assert goes_on in first.shown
    (naps / "seconds").write_text("0.1")
    again = Terminal(naps)
    assert again.ended()[0] == 0, again.shown
    assert "5 of 5 steps" in again.shown


def test_a_closed_terminal_is_ignored_where_it_was_ignored_before():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interruption():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            handler = signal.getsignal(signal.SIGTERM)
            assert handler not in (signal.SIG_DFL, signal.SIG_IGN)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)
