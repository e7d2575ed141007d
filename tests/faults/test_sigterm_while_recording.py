"""SIGTERM ends a workflow also while it records a finished job, and loses nothing."""

import signal
from contextlib import closing

import forked
import pytest
from snakemake.scheduling.job_scheduler import JobScheduler

pytestmark = pytest.mark.slow

# Made one after the other.
MADE = ("results/berry/berry.json", "results/berry/particle.json")


def test_sigterm_while_a_job_is_recorded_ends_the_workflow(tmp_path, monkeypatch):
    forked.load_all()
    record = JobScheduler._finish_jobs
    recorded = []

    def terminate_and_record(scheduler):
        """Snakemake calls this in its main thread, which holds the scheduler's lock."""
        if scheduler._tofinish and not recorded:
            recorded.append(True)
            signal.raise_signal(signal.SIGTERM)
        record(scheduler)

    with closing(forked.Jobs(tmp_path)) as jobs:
        study = forked.Study(tmp_path / "study", jobs, MADE).prepared()
        with monkeypatch.context() as patch:
            patch.setattr(JobScheduler, "_finish_jobs", terminate_and_record)
            assert study.run() == 1
        assert "Will exit after finishing" in study.log.read_text()
        before = study.finished()
        assert study.folder / MADE[0] in before

        # The same command goes on from there.
        assert study.run() == 0, study.last_words()
        assert study.made_again(before) == []
        assert study.folder / MADE[1] in study.finished()
