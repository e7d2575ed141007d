"""The processor time of jobs, compared with the system's own account of the process."""

import os
import shlex
import subprocess
import sys

import pytest
from shared import written

from repose.common import usage

BUSY = """
import subprocess, sys, time
from repose.common import usage
subprocess.run([sys.executable, "-c", "import time\\nwhile time.process_time() < 0.3: pass"])
while time.process_time() < 0.5: pass
usage.record_process(sys.argv[1])
"""


def job(folder, log):
    """Run a job whose errors go into a log; its processor time by the system [s]."""
    with open(log, "w") as errors:
        process = subprocess.Popen([sys.executable, "-c", BUSY, folder], stderr=errors)
        _, status, used = os.wait4(process.pid, 0)
    assert status == 0, log.read_text()
    return used.ru_utime + used.ru_stime


def test_processes_note_their_time_and_those_outside_jobs_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("logs/heaps", "benchmarks/heaps"):
        (tmp_path / "results" / name).mkdir(parents=True)
    used_s = job("results", tmp_path / "results/logs/heaps/001.log")
    (entry,) = usage.list_processes_since("results", 0)
    assert entry.cpu_s == pytest.approx(used_s, abs=0.1)
    assert 0.8 < entry.cpu_s <= used_s
    assert str(os.getpid()) in entry.ancestors.split()
    assert usage.list_processes_since("results", entry.ended_s + 1) == []
    benchmark = written(
        tmp_path / "results/benchmarks/heaps/001.tsv",
        "s\tmax_rss\tcpu_time\n1.5\t80.0\t0.2\n",
    )
    # the second entry is an earlier attempt
    usage.correct_benchmarks(
        "results", [entry, entry._replace(ended_s=entry.ended_s - 60)]
    )
    expected = f"s\tmax_rss\tcpu_time\n1.5\t80.0\t{entry.cpu_s:.2f}\n"
    assert benchmark.read_text() == expected
    (tmp_path / "benchmarks").mkdir()
    usage.record_process(tmp_path)
    usage.correct_benchmarks(tmp_path, usage.list_processes_since(tmp_path, 0))
    assert [path.name for path in (tmp_path / "benchmarks").iterdir()] == [
        "processes.csv"
    ]


AFTER_OTHERS = """
import time
from repose.common import usage
print(time.process_time())
usage.record_process(".")
"""


def test_a_program_counts_no_command_that_its_shell_ran_before(tmp_path):
    program = f"{shlex.quote(sys.executable)} -c {shlex.quote(AFTER_OTHERS)}"
    for before in ("sleep 2", f"{program} > /dev/null; rm -r benchmarks"):
        (tmp_path / "benchmarks").mkdir(exist_ok=True)
        done = subprocess.run(
            ["bash", "-c", f"({before}; {program})"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        used_s = float(done.stdout)
        assert usage.list_processes_since(tmp_path, 0)[-1].cpu_s == pytest.approx(
            used_s, abs=0.3
        )


def test_a_folder_in_the_place_of_the_table_ends_no_job(tmp_path):
    (tmp_path / usage.TABLE_PATH).mkdir(parents=True)
    usage.record_process(tmp_path)
    assert usage.list_processes_since(tmp_path, 0.0) == []
