"""How far a run is: jobs of each rule, pours a minute and time left, from known times."""

import os

import pytest

from repose.cli.run_display import Running, RunProgress, rough_time

BEGAN_S = 1000.0


@pytest.fixture
def planned():
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


def test_nothing_is_reported_before_the_first_pour_is_made(planned, tmp_path):
    planned.start(8, Running("berry", "Sizes", BEGAN_S - 100, "berry.json"))
    planned.finish(8, BEGAN_S)
    planned.start(0, pour(0, tmp_path))
    assert planned.pours_a_minute(BEGAN_S + 50) is None
    assert planned.left_s(BEGAN_S + 50) is None


def test_rate_and_time_left_of_finished_jobs(planned, tmp_path):
    for number in (0, 1):
        planned.start(number, pour(number, tmp_path))
        for seed in (1, 2, 3):
            kept(tmp_path, f"{number}_{seed}.npz", BEGAN_S + 10 * seed)
    for number in (0, 1):
        planned.finish(number, BEGAN_S + 40)
    # six pours in 40 s; two jobs at once, of which two more are left
    assert planned.pours_a_minute(BEGAN_S + 40) == pytest.approx(9.0)
    assert planned.left_s(BEGAN_S + 40) == pytest.approx(40.0)
    assert planned.done["pour"] == 2


def test_a_job_counts_the_runs_that_it_has_kept_since_it_began(planned, tmp_path):
    kept(tmp_path, "001_1.npz", BEGAN_S - 500)
    kept(tmp_path, "001_2.npz", BEGAN_S + 10)
    kept(tmp_path, "0010_3.npz", BEGAN_S + 10)  # of another job
    planned.start(0, pour("001", tmp_path))
    assert planned.pours_done == 1
    assert planned.pours_a_minute(BEGAN_S + 60) == pytest.approx(1.0)
    planned.finish(0, BEGAN_S + 60)
    assert planned.pours_done == 1, "a run that was kept before is not poured again"


def test_a_complete_job_counts_the_runs_that_it_has_timed(planned, tmp_path):
    (tmp_path / "timings").mkdir()
    for number, date_s in (("001", BEGAN_S + 50), ("002", BEGAN_S - 500)):
        path = tmp_path / f"timings/{number}.json"
        path.write_text('{"wall_s": {"7": 3.1, "8": 2.9}}')
        os.utime(path, (date_s, date_s))
        planned.start(int(number), pour(number, tmp_path))
        planned.finish(int(number), BEGAN_S + 60)
    assert planned.pours_done == 2


def test_jobs_of_a_checkpoint_are_planned_and_a_failed_one_known_until_they_begin(planned, tmp_path):
    planned.start(0, pour(0, tmp_path))
    assert planned.fail(0).rule == "pour"
    assert planned.fail(0) is None
    assert list(planned.failed) == [0]
    planned.start(0, pour(0, tmp_path))
    assert not planned.failed
    for number in range(5):
        planned.start(number, pour(number, tmp_path))
        planned.finish(number, BEGAN_S + 10)
    assert planned.planned["pour"] == 5


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(20, "less than a minute"), (60, "about 1 min"), (5300, "about 88 min"), (7300, "about 2 h 2 min")],
)
def test_times_in_words(seconds, words):
    assert rough_time(seconds) == words
