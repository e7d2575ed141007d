"""A sequential study that is killed within and between its batches ends with the bytes of one that was left alone."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

# What is there when the workflow is killed: part of the start, the proposal after it, part of the first batch.
MOMENTS = ("batch_0/heaps/003.json", "batch_1/samples.csv", "batch_1/heaps/*.json")
SECTION = {"start_samples": 6, "seeds": 2, "batch": 2, "most_pours": 20, "probability": 0.99, "checks": 2}
# Within reach of the made-up pours, which scatter by 1 mm.
TARGET = {"response": "height_mm", "apparatus": "funnel", "value": 38.0, "sd": 2.0, "repetitions": 5}
TARGET |= {"range": [37.0, 39.0], "weight": 1.0}
PATIENCE_S = 600


def test_a_kill_within_or_between_batches_loses_nothing(tmp_path):
    done = subprocess.run([sys.executable, __file__, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["batches"] == 4, "the last holds the answer"
    assert found["same_bytes"]
    assert found["statuses"] == [0, 0], "of the study left alone, and of the killed one in the end"
    assert found["made_again"] == []
    # each kill came where it was meant to: batches that were proposed by then
    assert found["proposed"] == [1, 2, 2]


def killed_at(study, moment):
    """Start the workflow and kill it once a file is there; how many batches had been proposed."""
    main, end = study.start(), time.monotonic() + PATIENCE_S
    folder = study.folder / "results/sequential"
    while not any(folder.glob(moment)):
        assert time.monotonic() < end, moment
        assert not os.waitid(os.P_PID, main, os.WEXITED | os.WNOHANG | os.WNOWAIT), study.last_words()
        time.sleep(0.01)
    os.kill(main, signal.SIGKILL)
    os.waitpid(main, 0)
    proposed = len(list(folder.glob("batch_*/proposal.json")))
    while study.jobs.running():  # the jobs of a killed workflow run to their end
        time.sleep(0.01)
    return proposed


def main(place):
    import campaign
    import forked

    forked.load_all()
    forked.make_up_pours()
    jobs = forked.Jobs(place)
    try:
        whole, killed = (
            campaign.Study(place / name, jobs)
            .prepared()
            .configured(strategy="sequential", sequential=SECTION, targets=[TARGET])
            for name in ("whole", "killed")
        )
        whole.targets = killed.targets = ("results/sequential/summary.json",)
        statuses, proposed, made_again, before = [whole.run()], [], [], {}
        for moment in MOMENTS:
            proposed.append(killed_at(killed, moment))
            now = killed.finished()
            made_again += [str(path) for path, when in before.items() if now.get(path) != when]
            before = now
        statuses.append(killed.run())
        now = killed.finished()
        made_again += [str(path) for path, when in before.items() if now.get(path) != when]
        found = {"statuses": statuses, "proposed": proposed, "made_again": made_again}
        found["batches"] = len(list((killed.folder / "results/sequential").glob("batch_*")))
        found["same_bytes"] = campaign.compared(killed, whole.results())
        print(whole.last_words(), killed.last_words(), json.dumps(found), sep="\n", flush=True)
    finally:
        jobs.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
