"""The table and the verb: results beside references, and an exit status that reports a miss."""

import csv

import numpy as np
import pytest
from refusals import input_error, value_error

from repose import verification
from repose.__main__ import main
from repose.verification.case import KNOWN, MISSED, PASSED, at_most, close, within
from repose.verification.hertz import Hertz
from repose.verification.rotation import euler_solution


def case_of(row):
    return lambda _effort: [row]


@pytest.mark.parametrize(
    ("row", "status"),
    [
        (close("x", "m", 1.0029, 1.0), PASSED),
        (close("x", "m", 1.0031, 1.0), MISSED),
        (close("x", "m", -1.024, -1.0, "digitised, someone"), PASSED),
        (close("x", "m", 1.026, 1.0, "digitised, someone"), MISSED),
        (close("x", "m", 1.1, 1.0, known="a reason"), KNOWN),
        (close("x", "m", float("nan"), 1.0), MISSED),
        (at_most("x", "", 1.0, 1.0, "limit"), PASSED),
        (at_most("x", "", 1.1, 1.0, "limit"), MISSED),
        (at_most("x", "", float("nan"), 1.0, "limit"), MISSED),
        (within("x", "", 0.5, 0.6, 0.7, "range"), MISSED),
    ],
)
def test_a_row_is_judged_by_its_tolerance(row, status):
    assert row.status == status
    assert row.passed is (status != MISSED)


@pytest.mark.parametrize(("value", "status"), [(1.001, 0), (1.2, 1)])
def test_the_verb_writes_a_table_and_reports_a_miss(value, status, monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(verification.CASES, "one", case_of(close("length", "m", value, 1.0)))
    assert main(["verify", "--case", "one", "--out", str(tmp_path)]) == status
    assert ("length is 1.2" in capsys.readouterr().out) is bool(status)
    (row,) = csv.DictReader((tmp_path / "verification.csv").open(encoding="utf-8"))
    assert (row["case"], float(row["result"]), float(row["tolerance"])) == ("one", value, 0.003)
    assert (row["status"] == MISSED) is bool(status)


@pytest.mark.parametrize(
    ("words", "laws"),
    [
        ([], {"tension": "release", "contact_law": "hertz_mindlin_rescaled", "rolling_law": "budget"}),
        (
            ["--config", "config/paper.yaml"],
            {"tension": "keep", "contact_law": "hertz_mindlin", "rolling_law": "budget"},
        ),
    ],
)
def test_the_verb_hands_the_laws_of_a_study_to_every_case(words, laws, monkeypatch, tmp_path):
    efforts = []
    case = case_of(close("length", "m", 1.0, 1.0))
    monkeypatch.setitem(verification.CASES, "one", lambda effort: (efforts.append(effort), case(effort))[1])
    assert main(["verify", "--case", "one", "--out", str(tmp_path), *words]) == 0
    assert efforts[0].laws == laws


def test_an_unknown_case_is_refused():
    input_error("chung1", verification.run, ["chung9"])


def test_the_reference_of_the_damped_law_has_the_restitution_it_is_for():
    hertz = Hertz(mass=0.01, radius=0.005, young=25e9, speed=20.0)
    for e in (0.3, 1.0):
        time, overlap, force = hertz.history(e, 20_000)
        left = np.trapezoid(force, time) / hertz.mass - hertz.speed
        assert left == pytest.approx(e * hertz.speed, rel=1e-4)
    assert overlap.max() == pytest.approx(hertz.overlap_m, rel=1e-6)
    assert force.max() == pytest.approx(hertz.force_n, rel=1e-6)
    assert time[-1] == pytest.approx(hertz.duration_s, rel=1e-6)


def test_eulers_solution_obeys_eulers_equations():
    inertia = np.array([1.0, 2.4, 2.6])
    time = np.linspace(0.0, 3.0, 3001)
    omega, _ = euler_solution(inertia, 0.8, 2.5, time)
    slope = np.gradient(omega, time, axis=1)[:, 1:-1]
    expected = -np.cross(omega.T, inertia * omega.T).T[:, 1:-1] / inertia[:, None]
    assert np.abs(slope - expected).max() < 1e-5
    value_error("first is 2", euler_solution, inertia, 2.0, 0.5, time)
