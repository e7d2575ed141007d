"""How far a run is: jobs by stage, pours a minute and time left, from known times."""

import os

import pytest

from repose.cli.run_display import RunProgress, rough_time

STAGES = {"berry": "berry", "pour": "pour", "measure_runs": "pour", "miga": "miga"}
BEGAN_S = 1000.0


@pytest.fixture
def planned():
    """A berry job of no time, four jobs of three pours, 30 s each, and a search of no time."""
    progress = RunProgress()
    jobs = {"miga": {9: (0, 0.0)}, "pour": dict.fromkeys(range(4), (3, 30.0)), "berry": {8: (0, 0.0)}}
    progress.plan(STAGES, jobs)
    return progress


def test_stages_stand_in_the_order_of_the_workflow(planned):
    assert [(name, stage.total) for name, stage in planned.stages.items()] == [
        ("berry", 1),
        ("pour", 4),
        ("miga", 1),
    ]


def test_nothing_is_reported_before_the_first_pour_is_made(planned):
    planned.start(8, "berry", "Sizes", "berry.json", BEGAN_S - 100)
    planned.finish(8)
    planned.start(0, "pour", "Pouring", "heap", BEGAN_S)
    assert planned.pours_a_minute(BEGAN_S + 50) is None
    assert planned.left_s(BEGAN_S + 50) is None


def test_rate_and_time_left_of_finished_jobs(planned):
    for number in (0, 1):
        planned.start(number, "pour", "Pouring", "heap", BEGAN_S)
        planned.finish(number)
    # six pours in 40 s; half of the work is done
    assert planned.pours_a_minute(BEGAN_S + 40) == pytest.approx(9.0)
    assert planned.left_s(BEGAN_S + 40) == pytest.approx(40.0)
    assert planned.stages["pour"].done == 2


def test_a_job_counts_the_runs_that_it_has_kept_since_it_began(planned, tmp_path):
    (tmp_path / "runs").mkdir()
    for seed, date_s in ((1, BEGAN_S - 500), (2, BEGAN_S + 10)):
        path = tmp_path / "runs" / f"001_{seed}.npz"
        path.touch()
        os.utime(path, (date_s, date_s))
    (tmp_path / "runs" / "0010_3.npz").touch()  # of another job
    planned.start(0, "pour", "Pouring", str(tmp_path / "001.pours.json"), BEGAN_S)
    assert planned.pours_done == 1
    # a twelfth of the work in 20 s
    assert planned.left_s(BEGAN_S + 20) == pytest.approx(220.0)
    planned.finish(0)
    assert planned.pours_done == 1


def test_a_failed_job_that_begins_again_is_no_failed_one(planned):
    planned.start(0, "pour", "Pouring", "heap", BEGAN_S)
    assert planned.fail(0).message == "Pouring"
    assert planned.fail(0) is None
    assert list(planned.failed) == [0]
    planned.start(0, "pour", "Pouring", "heap", BEGAN_S)
    assert not planned.failed


def test_a_job_that_a_checkpoint_adds_is_counted_once(planned):
    planned.start(77, "measure_runs", "Measuring", "heap", BEGAN_S)
    planned.fail(77)
    planned.start(77, "measure_runs", "Measuring", "heap", BEGAN_S)
    planned.finish(77)
    assert (planned.stages["pour"].done, planned.stages["pour"].total) == (1, 5)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (20, "less than a minute"),
        (61, "about 1 min"),
        (5300, "about 88 min"),
        (7300, "about 2 h 2 min"),
    ],
)
def test_rough_times(seconds, text):
    assert rough_time(seconds) == text
