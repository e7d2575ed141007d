"""One contract for a run that failed: a table, `tell` and a function say it in the same ways."""

import math
import threading
import time
import warnings
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from refusals import input_error

from repose import Study
from repose.bench.bench_test import bench
from repose.calibrate.record import Record
from repose.calibrate.strategies.runs import (
    checked_runs,
    describe_unread_columns,
    judge_runs,
    make_cells,
)

pytestmark = pytest.mark.usefixtures("short_searches")
# What a run gives for its responses y and z, and the status that it then has.
FAILURES = {
    "NaN": ({"y": math.nan, "z": 1.0}, "failed"),
    "infinite": ({"y": 2.0, "z": math.inf}, "failed"),
    "minus infinite": ({"y": -math.inf, "z": 1.0}, "failed"),
    "beyond 1e100": ({"y": 2.0, "z": -1e101}, "failed"),
    "NaN as C writes it": ({"y": "-nan(ind)", "z": 1.0}, "failed"),
    "infinite as Java writes it": ({"y": 2.0, "z": "-Infinity"}, "failed"),
    "None": ({"y": None, "z": None}, "failed"),
    "a number of numpy": ({"y": np.float32("inf"), "z": np.float64(1)}, "failed"),
    "a status beside numbers": ({"y": 2.0, "z": 1.0, "status": "jammed"}, "jammed"),
    "a status beside NaN": ({"y": math.nan, "z": 1.0, "status": "lost"}, "lost"),
    "ok without a number": ({"y": math.nan, "z": 1.0, "status": "ok"}, "failed"),
}
GOOD = {"y": 2.0, "z": 1.0}


def make_study(file=None):
    return Study(
        {"a": (0.0, 1.0)},
        {"y": (1.0, 0.05), "z": (0.5, 0.05)},
        file=file,
        sequential={"start_samples": 4},
    )


def statuses(runs):
    """The status of each run; one without `ok` has no number at all."""
    is_good = (runs["status"] == "ok").to_numpy()
    assert (runs[["y", "z"]].notna().to_numpy() == is_good[:, None]).all()
    return runs["status"].tolist()


def results(asked):
    """Good results of all runs, which differ."""
    return asked.assign(y=2 + asked["a"], z=1 - asked["a"] ** 2)


@pytest.mark.parametrize("name", FAILURES)
def test_a_failed_run_is_the_same_for_a_table_for_tell_and_for_a_function(
    name, tmp_path
):
    result, status = FAILURES[name]
    asked = make_study().ask()
    table = results(asked).astype({"y": object, "z": object})
    table["status"] = None
    for key, value in result.items():
        table.loc[2, key] = value
    expected = ["ok", "ok", status] + ["ok"] * 5

    study = make_study()
    study.tell(table)
    assert statuses(study.runs) == expected

    table.to_csv(tmp_path / "new.csv", index=False)
    record = Record(make_study(), tmp_path / "record.csv")
    record.add_file(tmp_path / "new.csv")
    assert statuses(record.data) == expected
    # What is written says the same when it is read again.
    assert statuses(Record(make_study(), tmp_path / "record.csv").data) == expected

    rows = iter(results(asked)[["y", "z"]].to_dict("records"))
    results_of_function = [result if k == 2 else next(rows) for k in range(8)]
    assert statuses(campaign(results_of_function)) == expected


def campaign(results_of_function):
    """The runs of the start, with these results of the function that simulates."""
    study = make_study()
    given = iter(results_of_function)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Study, "done", property(lambda self: len(self.runs) >= 8))
        patch.setattr(Study, "answer", lambda self: self.runs)
        return study.calibrate(lambda row: next(given))


def test_a_function_may_leave_out_numbers_and_the_campaign_goes_on():
    """What a table is refused for, as it can be mended, does not end a campaign."""
    rows = results(make_study().ask())[["y", "z"]].to_dict("records")
    rows[1] = None
    rows[2] = {"status": "diverged"}
    rows[3] = {"status": 139}
    rows[4] = pd.Series({"y": 2.5, "z": 0.5})
    assert statuses(campaign(rows)) == [
        "ok",
        "failed",
        "diverged",
        "status 139",
        "ok",
        "ok",
        "ok",
        "ok",
    ]
    for wrong in ({"y": 2.0}, {"y": 2.0, "z": "many"}, {"angle": 3.0, "y": 2.0}):
        rows[1] = wrong
        with pytest.warns(UserWarning, match=r"without a number for z failed; .*'y'"):
            assert statuses(campaign(rows))[1] == "failed"
    for wrong in (3.0, [1.0, 2.0], "good"):
        rows[1] = wrong
        input_error("a function that returns a mapping with y, z", campaign, rows)
    # A function that says that it failed says enough.
    for right in (None, {}, {"status": "lost"}, {"y": math.nan, "z": None}):
        assert make_cells(right or {}, ["y", "z"])[1] == ""


MISTAKES = {
    "text": ({"y": "28 deg", "z": 1.0}, "a number for y, or None for a failed run"),
    "array": ({"y": np.array([1.0, 2.0]), "z": 1.0}, "a number for y, or None"),
    "other name": ({"angle": 2.0, "z": 1.0}, "a number for y, or None"),
    "code": (GOOD | {"status": 0}, "a word such as ok as status, or None"),
    "parameter": (GOOD | {"a": 0.9}, "row 1: a is 0.9; expected .*, as `ask` gave it"),
    "repeated name": (GOOD | {"log": 1, "log ": 2}, "column is 'log'; .* once"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_of_the_function_is_refused_after_its_first_run(name, tmp_path):
    result, message = MISTAKES[name]
    calls = []

    def simulate(row):
        calls.append(row)
        return result

    input_error(message, make_study(tmp_path / "runs.csv").calibrate, simulate)
    assert len(calls) == 1
    assert Study.resume(tmp_path / "runs.csv").runs.empty


def test_names_and_statuses_of_a_function_are_read_as_those_of_a_table():
    rows = results(make_study().ask())[["y", "z"]].to_dict("records")
    rows[0] = {"Y": 2.5, "z ": 1.5, "A": None, "status": math.nan}
    runs = campaign(rows)
    assert statuses(runs) == ["ok"] * 8
    assert runs.loc[0, ["y", "z"]].tolist() == [2.5, 1.5]


def test_a_batch_that_failed_by_an_unknown_status_ends_the_campaign(tmp_path):
    """The record keeps the responses, so the user can correct the statuses."""
    study = make_study(tmp_path / "runs.csv")
    values = iter(results(study.ask())["y"])
    with pytest.warns(UserWarning, match="with the status 'okay' counts as failed"):
        input_error(
            r"status is 'okay'; expected ok .* all 8 runs .*; they are in .*runs\.csv",
            study.calibrate,
            lambda row: {"y": next(values), "z": 1.0, "status": "okay"},
        )
    assert study.runs["y"].isna().all()
    record = pd.read_csv(tmp_path / "runs.csv").assign(status="ok")
    record.to_csv(tmp_path / "runs.csv", index=False)
    assert study.runs["y"].tolist() == results(record)["y"].tolist()


def test_runs_that_had_started_are_kept_where_a_result_is_refused():
    study = make_study()
    both_run = threading.Barrier(2)

    def simulate(row):
        if row["sample"] == 1:
            both_run.wait(10)
            # The second run ends after the result of the first one was refused.
            time.sleep(0.3 * (row["run"] - 1))
        return {"y": 2.0 + row["run"], "z": "many" if row["run"] == 1 else 1.0}

    input_error("a number for z", study.calibrate, simulate, 2)
    assert 3.0 not in study.runs["y"].tolist()
    assert 4.0 in study.runs["y"].tolist()


def test_a_table_of_failed_runs_needs_no_responses(tmp_path):
    asked = make_study().ask()
    study = make_study()
    study.tell(asked[["sample", "run"]].assign(status="diverged"))
    assert statuses(study.runs) == ["diverged"] * 8
    (tmp_path / "new.csv").write_text("a,status\n0.1,lost\n0.2,lost\n")
    record = Record(make_study(), tmp_path / "record.csv")
    record.add_file(tmp_path / "new.csv")
    (tmp_path / "new.csv").write_text("a,y,z\n0.3,2,1\n")
    record.add_file(tmp_path / "new.csv")
    assert statuses(record.data) == ["lost", "lost", "ok"]
    input_error(
        "column z is 'missing'; expected columns y, z; found: sample, run, y",
        make_study().tell,
        asked[["sample", "run"]].assign(y=1.0),
    )


def test_no_failed_run_enters_a_mean():
    table = results(make_study().ask())
    table.loc[0, "status"] = "jammed"
    table.loc[0, ["y", "z"]] = 1e6
    runs = checked_runs(make_study(), table.fillna({"status": "ok"}))
    assert runs["y"].max() < 3.0
    outcomes = judge_runs({"y": ["1", "2"], "status": ["OK ", "No"]}, ["y"])
    assert outcomes.statuses == ["ok", "No"]
    assert outcomes.values["y"] == pytest.approx([1.0, math.nan], nan_ok=True)


UNREAD = {
    "converged": [False, True, True, False, True, True, True, True],
    "exit_code": [1, 0, 0, 1, 0, 0, 0, 0],
    "error": ["segfault", "", "", "segfault", "", "", "", ""],
}


@pytest.mark.parametrize("name", UNREAD)
def test_a_column_that_may_be_an_outcome_is_named_with_its_values(name, tmp_path):
    table = results(make_study().ask()).assign(**{name: UNREAD[name]}, solver="X")
    study = make_study()
    with pytest.warns(UserWarning, match="is not read") as caught:
        study.tell(table)
    (sentence,) = (str(warning.message) for warning in caught)
    often = str(UNREAD[name][1])
    seldom = str(UNREAD[name][0])
    assert sentence.startswith(
        f"column {name} is not read; it has {often!r} 6 times, {seldom!r} 2 times; "
    )
    assert "name it status, with ok for a good run" in sentence
    # Once is enough, and a constant column says nothing.
    assert study._record.new_unread_columns() == []


def test_a_column_that_varies_from_run_to_run_is_named_by_some_values():
    table = results(make_study().ask())
    study = make_study()
    for k, row in enumerate(table.to_dict("records")):
        cells = pd.DataFrame([row]).assign(wall_s=1.5 * k)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            study.tell(cells)
        # One value alone is constant.
        assert len(caught) == (1 if k == 1 else 0)
    many = describe_unread_columns(
        study, table.assign(wall_s=table.index).to_dict("records")
    )
    assert many == {
        "wall_s": "column wall_s is not read; it has '0' once, '1' once, '2' once, "
        "'3' once, '4' once and 3 other values"
    }
    # Only a column of few values, some of them repeated, may say which runs failed.
    for values, may_be_status in (([0, 1] * 4, True), ([*range(7), 0], False)):
        sentence = describe_unread_columns(
            study, table.assign(code=values).to_dict("records")
        )["code"]
        assert ("name it status" in sentence) is may_be_status
    wide = [{f"c{k}": row for k in range(40)} for row in range(3)]
    assert len(describe_unread_columns(study, wide)) == 31
    assert describe_unread_columns(study, wide)[""] == "10 further columns are not read"


def test_the_verbs_name_columns_that_are_not_read(tmp_path, command):
    (tmp_path / "own.yaml").write_text(
        "simulator: X\nlabel: a\nseed: 1\nparameters: {a: [0, 1]}\n"
        "targets: {y: {value: 1, sd: 0.1, repetitions: 2}}\n"
    )
    (tmp_path / "new.csv").write_text("a,y,state\n0.1,1,OK\n0.2,2,FAILED\n0.3,3,OK\n")
    arguments = ["tell", tmp_path / "new.csv", "--config", tmp_path / "own.yaml"]
    message = command(*arguments, "--out", tmp_path / "runs.csv").err
    assert (
        "new.csv: column state is not read; it has 'OK' 2 times, 'FAILED' once"
        in message
    )


@pytest.fixture
def verb(tmp_path, command):
    """Call a verb with a table; the study has two responses and one parameter."""
    (tmp_path / "own.yaml").write_text(
        "simulator: X\nlabel: a\nseed: 1\nparameters: {a: [0, 1]}\n"
        "sequential: {start_samples: 4}\n"
        "targets: {y: {value: 1, sd: 0.1, repetitions: 2}, "
        "z: {value: 1, sd: 0.1, repetitions: 2}}\n"
    )

    def call(name, file, out, *options, status=0):
        config = ("--config", tmp_path / "own.yaml", "--out", tmp_path / out)
        return command(name, *options, tmp_path / file, *config, status=status)

    return call


def test_ask_goes_on_where_all_runs_failed(tmp_path, verb):
    table = results(make_study().ask()).assign(status="okay")
    table.to_csv(tmp_path / "new.csv", index=False)
    told = verb("tell", "new.csv", "runs.csv").out
    assert "8 runs of 4 samples, 8 failed (status okay: 8)" in told
    asked = verb("ask", "runs.csv", "next.csv", "--runs")
    assert "WARNING: all 8 runs so far failed (status okay: 8)" in asked.err
    assert "8 runs to make next" in asked.out


def test_results_of_runs_that_had_none_are_told_later(tmp_path, verb):
    whole = results(make_study().ask())
    whole["y"] += 0.01 * whole["run"]
    part = whole.copy()
    part.loc[5:, ["y", "z"]] = np.nan
    part.to_csv(tmp_path / "part.csv", index=False)
    told = verb("tell", "part.csv", "runs.csv")
    assert "rows without results: 3. These runs count as failed" in told.err
    assert (
        "call `repose tell` with these rows again, before you tell the next runs"
        in told.err
    )
    whole[4:].to_csv(tmp_path / "rest.csv", index=False)
    message = verb("tell", "rest.csv", "runs.csv", status=2).err
    assert (
        "rest.csv, row 1: sample and run is [3, '1']; expected each pair once"
        in message
    )
    assert "row 5 of " in message
    assert "runs.csv has the same: leave out a row that was already added" in message
    assert "row 2" not in message
    whole[5:7].to_csv(tmp_path / "rest.csv", index=False)
    assert "8 runs of 4 samples, 1 failed" in verb("tell", "rest.csv", "runs.csv").out
    verb("ask", "runs.csv", "next.csv", "--runs")
    asked = pd.read_csv(tmp_path / "next.csv")
    results(asked[:1]).to_csv(tmp_path / "next_1.csv", index=False)
    verb("tell", "next_1.csv", "runs.csv")
    # The next batch has begun and depends on the run without results, so that stays.
    whole[7:].to_csv(tmp_path / "rest.csv", index=False)
    message = verb("tell", "rest.csv", "runs.csv", status=2).err
    assert "or give a further run another number" in message
    whole[7:].assign(run=3).to_csv(tmp_path / "rest.csv", index=False)
    assert "10 runs of 5 samples, 1 failed" in verb("tell", "rest.csv", "runs.csv").out
    verb("ask", "runs.csv", "rest_of_next.csv", "--runs")
    left = pd.read_csv(tmp_path / "rest_of_next.csv")
    pd.testing.assert_frame_equal(left, asked[1:].reset_index(drop=True))
    # In Python, the same runs need no sample.
    study = make_study()
    study.tell(part)
    input_error("no columns sample and run", study.tell, whole[5:])
    study.tell(whole[5:].drop(columns=["sample", "run"]))
    assert study.runs.groupby("sample")["y"].count().tolist() == [2, 2, 2, 2]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e9])
def test_a_run_of_our_engine_without_a_finite_response_failed(value, monkeypatch):
    test = bench("funnel")
    measured = {"status": "ok", "seed": 1, "aor_deg": value}
    monkeypatch.setattr(test, "measure", lambda *_: measured)
    monkeypatch.setattr(test, "target_responses", lambda _: ())
    angle = next(response for response in test.responses if response.name == "aor_deg")
    monkeypatch.setattr(test, "responses", (angle,))
    scene = SimpleNamespace(settings=SimpleNamespace(config={}))
    assert test.result({}, {}, scene)["status"] == "out_of_bounds"
