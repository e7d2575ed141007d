"""A sequential study that is killed within and between its batches ends with the bytes of one that was left alone."""

import os
import signal
import time
from contextlib import closing

import forked
import pytest
from shared import target

pytestmark = pytest.mark.slow

# What is there when the workflow is killed: part of the start, the proposal after it, part of the first batch.
MOMENTS = ("batch_0/heaps/003.json", "batch_1/samples.csv", "batch_1/heaps/*.json")
SECTION = {
    "start_samples": 6,
    "seeds": 2,
    "batch": 2,
    "most_pours": 20,
    "probability": 0.99,
    "checks": 2,
}
# Within reach of the made-up pours, which scatter by 1 mm.
TARGET = target("height_mm", 38.0, 2.0, 37.0, 39.0, 5, weight=1.0)
PATIENCE_S = 600


def test_a_kill_within_or_between_batches_loses_nothing(tmp_path, monkeypatch):
    forked.load_all()
    forked.make_up_pours(monkeypatch.setattr)
    with closing(forked.Jobs(tmp_path)) as jobs:
        made = ["results/sequential/summary.json"]
        studies = (
            forked.Study(tmp_path / name, jobs, made).prepared()
            for name in ("whole", "killed")
        )
        settings = {
            "strategy": "sequential",
            "sequential": SECTION,
            "targets": [TARGET],
        }
        whole, killed = (study.configured(**settings) for study in studies)
        assert whole.run() == 0, whole.last_words()
        proposed = []
        before = {}
        for moment in MOMENTS:
            proposed.append(killed_at(killed, moment))
            assert killed.made_again(before) == []
            before = killed.finished()
        # each kill came where it was meant to: batches that were proposed by then
        assert proposed == [
            1,
            2,
            2,
        ]
        assert killed.run() == 0, killed.last_words()
        assert killed.made_again(before) == []
        assert len(list((killed.folder / "results/sequential").glob("batch_*"))) == 4, (
            "the last holds the answer"
        )
        assert forked.compared(killed, whole.results())


def killed_at(study, moment):
    """Start the workflow and kill it once a file is there; how many batches had been proposed."""
    main = study.start()
    end = time.monotonic() + PATIENCE_S
    folder = study.folder / "results/sequential"
    while not any(folder.glob(moment)):
        assert time.monotonic() < end, moment
        assert not os.waitid(os.P_PID, main, os.WEXITED | os.WNOHANG | os.WNOWAIT), (
            study.last_words()
        )
        time.sleep(0.01)
    os.kill(main, signal.SIGKILL)
    os.waitpid(main, 0)
    proposed = len(list(folder.glob("batch_*/proposal.json")))
    while study.jobs.running():  # the jobs of a killed workflow run to their end
        time.sleep(0.01)
    return proposed
