"""Several threads and processes at one study: no run is lost, and the answer is the same."""

import copy
import pickle
import threading
import time
from concurrent.futures import (
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)

import pandas as pd
import pytest
from refusals import input_error

from repose import Study

pytestmark = pytest.mark.usefixtures("short_searches")


def study(file=None, samples=20, seeds=16):
    return Study(
        {"a": (0.0, 1.0), "b": (0.0, 1.0)},
        {"y": (1.0, 0.05), "z": (0.5, 0.05)},
        file=file,
        sequential={"start_samples": samples, "seeds": seeds, "most_runs": 400},
    )


def simulate(row):
    """The responses of a run; the first 16 runs of a sample all differ."""
    scatter = 0.001 * ((7 * row["run"] + 3 * row["sample"]) % 16)
    return {"y": row["a"] + row["b"] + scatter, "z": row["a"] - scatter**2}


def tell(shared, row):
    shared.tell(pd.DataFrame([{**row, **simulate(row)}]))


@pytest.mark.slow
@pytest.mark.parametrize("has_file", [False, True])
def test_sixteen_threads_tell_320_runs_and_keep_all(has_file, tmp_path):
    shared = study(tmp_path / "runs.csv" if has_file else None)
    asked = shared.ask()
    assert len(asked) == 320
    # Begin anew, so that the threads make the record, too.
    shared = study(tmp_path / "runs.csv" if has_file else None)
    with ThreadPoolExecutor(16) as pool:
        list(pool.map(lambda row: tell(shared, row), asked.to_dict("records")))
    assert len(shared.runs) == 320
    assert len(shared.runs.drop_duplicates(["sample", "y"])) == 320
    if has_file:
        assert len(Study.resume(tmp_path / "runs.csv").runs) == 320


@pytest.mark.parametrize("has_file", [False, True])
def test_threads_that_begin_at_once_share_one_record(has_file, tmp_path):
    asked = study(samples=4, seeds=4).ask()
    for k in range(3):
        file = tmp_path / f"{k}.csv" if has_file else None
        shared = study(file, samples=4, seeds=4)
        barrier = threading.Barrier(16)

        def begin(row, shared=shared, barrier=barrier):
            barrier.wait()
            tell(shared, row)

        with ThreadPoolExecutor(16) as pool:
            list(pool.map(begin, asked.to_dict("records")))
        assert len(shared.runs) == 16


@pytest.fixture
def first_batch(monkeypatch):
    """Makes a study end after its first batch, without a fit."""
    monkeypatch.setattr(Study, "done", property(lambda self: len(self.runs) >= 12))
    monkeypatch.setattr(Study, "answer", lambda self: self._record.sorted_data)


@pytest.mark.usefixtures("first_batch")
def test_workers_make_the_runs_at_a_time_and_the_answer_is_the_same(tmp_path):
    alone = study(samples=4, seeds=3).calibrate(simulate)
    together = threading.Barrier(4, timeout=60)

    def meets(row):
        # Four runs go on only where four are made at a time.
        together.wait()
        return simulate(row)

    shared = study(tmp_path / "runs.csv", samples=4, seeds=3)
    pd.testing.assert_frame_equal(shared.calibrate(meets, workers=4), alone)
    with ProcessPoolExecutor(2) as pool:
        of_processes = study(samples=4, seeds=3).calibrate(simulate, workers=pool)
        # An executor of the user stays open.
        assert pool.submit(len, "ab").result() == 2
    pd.testing.assert_frame_equal(of_processes, alone)


class ClusterExecutor(Executor):
    """An executor as those of dask and of clusters: it sends a run away as bytes.

    A future cannot be cancelled, and the executor has no number of workers.
    """

    is_shut_down = False

    def submit(self, function, /, *args):
        future = Future()
        future.set_running_or_notify_cancel()
        job = pickle.dumps((function, args))
        threading.Thread(target=self.run, args=(future, job)).start()
        return future

    def run(self, future, job):
        function, args = pickle.loads(job)
        try:
            future.set_result(function(*args))
        except OSError as error:
            future.set_exception(error)

    def shutdown(self, wait=True, *, cancel_futures=False):
        self.is_shut_down = True


def has_no_licence(row):
    if (row["sample"], row["run"]) == (2, 1):
        raise OSError("no licence")
    return simulate(row)


@pytest.mark.usefixtures("first_batch")
def test_any_executor_makes_the_runs_and_stays_open():
    alone = study(samples=4, seeds=3).calibrate(simulate)
    executor = ClusterExecutor()
    of_cluster = study(samples=4, seeds=3).calibrate(simulate, workers=executor)
    pd.testing.assert_frame_equal(of_cluster, alone)
    assert not executor.is_shut_down

    # Runs that cannot be cancelled are kept when one of them fails.
    one = study(samples=4, seeds=3)
    with pytest.raises(OSError, match="no licence"):
        one.calibrate(has_no_licence, workers=ClusterExecutor())
    assert len(one.runs) == 11


@pytest.mark.usefixtures("first_batch")
def test_the_executor_of_joblib_makes_the_runs():
    # joblib comes with scikit-learn.
    from joblib.externals.loky import get_reusable_executor

    alone = study(samples=4, seeds=3).calibrate(simulate)
    executor = get_reusable_executor(max_workers=1)
    of_joblib = study(samples=4, seeds=3).calibrate(simulate, workers=executor)
    executor.shutdown()
    pd.testing.assert_frame_equal(of_joblib, alone)


@pytest.mark.usefixtures("first_batch")
def test_what_was_made_when_a_run_breaks_off_is_kept(tmp_path):
    def breaks(row):
        if (row["sample"], row["run"]) == (2, 1):
            raise OSError("no licence")
        return simulate(row)

    for workers in (1, 3):
        shared = study(tmp_path / f"{workers}.csv", samples=4, seeds=3)
        with pytest.raises(OSError, match="no licence"):
            shared.calibrate(breaks, workers=workers)
        n_kept = len(shared.runs)
        assert 3 <= n_kept < 12
        resumed = Study.resume(tmp_path / f"{workers}.csv")
        assert len(resumed.ask()) == 12 - n_kept
        assert len(resumed.calibrate(simulate, workers=workers)) == 12


@pytest.mark.usefixtures("first_batch")
def test_runs_that_have_not_begun_are_left_where_a_result_is_refused():
    begun = []

    def gives_no_mapping(row):
        begun.append(row)
        time.sleep(0.1)
        return 3.0

    shared = study(samples=6, seeds=16)
    input_error("returns a mapping", shared.calibrate, gives_no_mapping, workers=2)
    assert len(begun) < 96


def test_the_order_of_the_results_changes_no_proposal():
    asked = study(samples=6, seeds=3).ask()
    results = asked.assign(**pd.DataFrame(map(simulate, asked.to_dict("records"))))
    in_order = study(samples=6, seeds=3)
    shuffled = study(samples=6, seeds=3)
    in_order.tell(results)
    for row in results.sample(frac=1, random_state=1).to_dict("records"):
        shuffled.tell(pd.DataFrame([row]))
    assert shuffled.runs["y"].tolist() != in_order.runs["y"].tolist()
    pd.testing.assert_frame_equal(
        shuffled._record.sorted_data, in_order._record.sorted_data
    )


def test_a_study_with_runs_is_copied_and_sent_to_processes():
    shared = study(samples=4, seeds=3)
    asked = shared.ask()
    shared.tell(asked.assign(**pd.DataFrame(map(simulate, asked.to_dict("records")))))
    for other in (copy.deepcopy(shared), pickle.loads(pickle.dumps(shared))):
        pd.testing.assert_frame_equal(other.runs, shared.runs)
        assert len(other.runs) == 12


@pytest.mark.parametrize("workers", [0, -1, 2.5, True, "4", None])
def test_workers_are_a_number_or_an_executor(workers):
    message = "workers is .*; expected an integer from 1, or an Executor"
    input_error(message, study().calibrate, simulate, workers)
