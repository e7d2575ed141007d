"""One workflow at a time in a folder of results."""

import errno
import fcntl
import os
import subprocess
import sys

import pytest

from repose.core.errors import InputError
from repose.core.lock import JOBS, joined_folder, take_folder

A_JOB = """
import fcntl, sys, time
file = open(sys.argv[1], "a")
fcntl.flock(file, fcntl.LOCK_SH)
print("holds it", flush=True)
time.sleep(0.5)
"""


def test_a_second_workflow_is_refused_until_the_first_has_ended(tmp_path):
    first = take_folder(tmp_path)
    with pytest.raises(InputError, match=r"workflow is 'process \d+ on .*'; expected one at a time"):
        take_folder(tmp_path)
    first.close()
    take_folder(tmp_path).close()


def test_jobs_of_a_workflow_that_was_killed_are_waited_for(tmp_path, capfd):
    take_folder(tmp_path).close()
    with subprocess.Popen([sys.executable, "-c", A_JOB, tmp_path / JOBS], stdout=subprocess.PIPE) as job:
        job.stdout.readline()
        assert job.poll() is None
        take_folder(tmp_path).close()
        assert job.wait(timeout=5) == 0
    assert "waiting until the jobs of a workflow that was killed have ended" in capfd.readouterr().err


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_holds_and_refuses_nothing(tmp_path, monkeypatch, number):
    def flock(_file, _kind):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", flock)
    first = take_folder(tmp_path)
    take_folder(tmp_path).close()
    with joined_folder(tmp_path):
        first.close()


def test_other_faults_of_a_lock_are_reported(tmp_path, monkeypatch):
    def flock(_file, _kind):
        raise OSError(errno.EIO, "read error")

    monkeypatch.setattr(fcntl, "flock", flock)
    with pytest.raises(OSError, match="read error"):
        take_folder(tmp_path)


def test_jobs_share_the_folder(tmp_path):
    take_folder(tmp_path).close()
    with joined_folder(tmp_path), joined_folder(tmp_path):
        pass
