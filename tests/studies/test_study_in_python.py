"""A study with a simulator of one's own in Python: parts of a turn, runs made before, failures, rounded results."""

import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pandas as pd
import pytest
from refusals import not_refused

from repose import Study
from repose.core.errors import InputError
from repose.strategies.runs import add_runs

QUICK = {"posterior": {"walkers": 32, "steps": 100}, "sequential": {"start_samples": 8, "tolerance_percent": 5.0}}


def study(file=None, **keys):
    return Study({"a": (0.0, 1.0), "b": (0.0, 1.0)}, {"y": (1.0, 0.05), "z": (0.5, 0.05)}, file=file, **QUICK, **keys)


def simulate(row):
    """A simulator without random numbers, whose results are rounded."""
    return {"y": round(row["a"] + row["b"], 2), "z": round(row["a"], 1)}


def results(asked):
    asked = asked.reset_index(drop=True)
    return asked.assign(**pd.DataFrame([simulate(row) for row in asked.to_dict("records")]))


@pytest.fixture(scope="module")
def answer():
    return study().calibrate(simulate)


def test_a_function_is_calibrated(answer, tmp_path):
    assert answer.parameters["a"] == pytest.approx(0.5, abs=0.06)
    assert answer.parameters["a"] + answer.parameters["b"] == pytest.approx(1.0, abs=0.02)
    assert 8 <= len(repr(answer).splitlines()) <= 12
    answer.save(tmp_path)
    assert {"card.json", "summary.json", "samples.csv"} <= {path.name for path in tmp_path.iterdir()}
    assert answer.card["parameters"]["a"]["value"] == answer.parameters["a"]


def test_a_start_that_fails_does_not_end_a_study():
    made = []

    def fails_first(row):
        made.append(row)
        return dict.fromkeys("yz", np.nan) if len(made) <= 16 else simulate(row)

    assert study().calibrate(fails_first).parameters["b"] == pytest.approx(0.5, abs=0.06)
    with pytest.raises(InputError, match="a mapping with y, z"):
        study().calibrate(lambda row: {})


def test_any_part_of_a_turn_is_told_by_any_process_and_none_is_lost(tmp_path):
    whole, parts = study(tmp_path / "whole.csv"), study(tmp_path / "parts.csv")
    asked = whole.ask()
    whole.tell(results(asked))
    files = [tmp_path / "parts.csv"] * 4
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(tell_part, files, np.array_split(np.arange(len(asked)), 4)))
    parts = Study.resume(tmp_path / "parts.csv")
    both = [one.runs.sort_values(["sample", "y"], ignore_index=True) for one in (whole, parts)]
    pd.testing.assert_frame_equal(*both)
    pd.testing.assert_frame_equal(whole.ask(), parts.ask())


def tell_part(file, rows):
    asked = study().ask().iloc[rows]
    Study.resume(file).tell(results(asked))


def test_what_is_left_of_a_turn_is_asked_for_also_after_runs_made_before(tmp_path):
    one = study(tmp_path / "runs.csv")
    asked = one.ask()
    one.tell(results(asked[:5]))
    for again in (one, Study.resume(tmp_path / "runs.csv")):
        pd.testing.assert_frame_equal(again.ask(), asked[5:].reset_index(drop=True))
    one = study()
    asked = one.ask()
    one.tell(results(pd.DataFrame({"a": [0.1, 0.9, 0.9], "b": [0.2, 0.3, 0.3]})))
    assert one.runs["sample"].nunique() == 2
    assert not set(one.runs["sample"]) & set(asked["sample"])
    pd.testing.assert_frame_equal(one.ask(), asked)


def test_the_verb_adds_rows_of_several_processes(tmp_path):
    rows = results(pd.DataFrame(np.random.default_rng(1).random((24, 2)), columns=["a", "b"]))
    parts = []
    for k in range(8):
        parts.append(tmp_path / f"{k}.csv")
        rows[3 * k : 3 * k + 3].to_csv(parts[-1], index=False)
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(add_part, parts, [tmp_path / "record.csv"] * 8))
    found = pd.read_csv(tmp_path / "record.csv").sort_values("a", ignore_index=True)
    np.testing.assert_allclose(found[["a", "b"]], rows.sort_values("a")[["a", "b"]])


def add_part(part, record):
    add_runs(study(), part, record)


def test_what_is_wrong_is_told_by_its_name(tmp_path):
    asked = study().ask()
    good = results(asked)
    cases = [
        (lambda: study().answer(), "runs is 0"),
        (lambda: Study([1], {"y": (1.0, 0.1)}), "parameters is"),
        (lambda: Study({"a": (0, 1)}, None), "targets is None"),
        (lambda: Study({"a\nb": (0, 1)}, {"y": (1.0, 0.1)}), "one line of text"),
        (lambda: Study({"turn": (0, 1)}, {"y": (1.0, 0.1)}), "none of sample, run, status, turn"),
        (lambda: Study.of([1]), "a mapping of sections"),
        (lambda: Study.load(None), "the path of a file"),
        (lambda: Study.resume(None), "the path of a file"),
        (lambda: study(tmp_path / "none/x.csv"), "a folder that is there"),
        (lambda: study().tell(None), "a pandas.DataFrame"),
        (lambda: study().tell(good.assign(a="x")), "row 1: a is 'x'"),
        (lambda: study().tell(pd.concat([good, good[["a"]]], axis=1)), "each column once"),
        (lambda: study().tell(good.assign(sample=good["sample"] + 1000)), "one of the 16 runs"),
        (lambda: study().tell(good[:0]), "a row for each run"),
    ]
    assert not not_refused(lambda case: case(), cases, InputError)


def test_a_study_needs_no_locks_of_the_system(tmp_path):
    code = (
        "import sys; sys.modules |= {'fcntl': None, 'resource': None}\n"
        "from repose import Study\n"
        "one = Study({'a': (0.0, 1.0)}, {'y': (1.0, 0.05)}, file='runs.csv')\n"
        "asked = one.ask(); one.tell(asked.assign(y=2 * asked['a'] + 0.01 * asked['run']))\n"
        "print(len(one.runs))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.strip() == "32"
    assert "no locks on this system" in done.stderr
