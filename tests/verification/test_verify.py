"""The table and the verb of the verification, and its benchmarks."""

import csv
import importlib
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from refusals import input_error, value_error
from shared import ROOT, TARGETS

from repose import verification
from repose.calibrate.runs import mean_and_error
from repose.config.pipeline import PipelineConfig
from repose.stages import published
from repose.verification import speed
from repose.verification.case import KNOWN, MISSED, PASSED, at_most, close, within
from repose.verification.hertz import Hertz
from repose.verification.rotation import euler_solution


def case_of(row):
    return lambda _effort: [row]


@pytest.mark.parametrize(("row", "status"), [
    (close("x", "m", 1.0029, 1.0), PASSED), (close("x", "m", 1.0031, 1.0), MISSED),
    (close("x", "m", -1.024, -1.0, "digitised, someone"), PASSED),
    (close("x", "m", 1.026, 1.0, "digitised, someone"), MISSED), (close("x", "m", 1.1, 1.0, known="a reason"), KNOWN),
    (close("x", "m", float("nan"), 1.0), MISSED), (at_most("x", "", 1.0, 1.0, "limit"), PASSED),
    (at_most("x", "", 1.1, 1.0, "limit"), MISSED), (at_most("x", "", float("nan"), 1.0, "limit"), MISSED),
    (within("x", "", 0.5, 0.6, 0.7, "range"), MISSED),
])  # fmt: skip
def test_a_row_is_judged_by_its_tolerance(row, status):
    assert row.status == status
    assert row.passed is (status != MISSED)


@pytest.mark.parametrize(("value", "status"), [(1.001, 0), (1.2, 1)])
def test_the_verb_writes_a_table_and_reports_a_miss(
    value, status, monkeypatch, tmp_path, command
):
    monkeypatch.setitem(
        verification.CASES, "one", case_of(close("length", "m", value, 1.0))
    )
    printed = command("verify", "--case", "one", "--out", tmp_path, status=status).out
    assert ("length is 1.2" in printed) is bool(status)
    (row,) = csv.DictReader((tmp_path / "verification.csv").open(encoding="utf-8"))
    assert (row["case"], float(row["result"]), float(row["tolerance"])) == (
        "one",
        value,
        0.003,
    )
    assert (row["status"] == MISSED) is bool(status)


@pytest.mark.parametrize(
    ("words", "tension", "law"),
    [
        ([], "release", "hertz_mindlin_rescaled"),
        (["--config", "config/paper.yaml"], "keep", "hertz_mindlin"),
    ],
)
def test_the_verb_hands_the_laws_of_a_study_to_every_case(
    words, tension, law, monkeypatch, tmp_path, command
):
    efforts = []
    case = case_of(close("length", "m", 1.0, 1.0))
    monkeypatch.setitem(
        verification.CASES,
        "one",
        lambda effort: (efforts.append(effort), case(effort))[1],
    )
    command("verify", "--case", "one", "--out", tmp_path, *words)
    assert efforts[0].laws == {
        "tension": tension,
        "contact_law": law,
        "rolling_law": "budget",
    }
    input_error("chung1", verification.run, ["chung9"])


def test_the_reference_of_the_damped_law_has_the_restitution_it_is_for_and_eulers_solution_obeys_eulers_equations():
    hertz = Hertz(mass=0.01, radius=0.005, young=25e9, speed=20.0)
    for e in (0.3, 1.0):
        time, overlap, force = hertz.history(e, 20_000)
        assert np.trapezoid(force, time) / hertz.mass - hertz.speed == pytest.approx(
            e * hertz.speed, rel=1e-4
        )
    assert overlap.max() == pytest.approx(hertz.overlap_m, rel=1e-6)
    assert force.max() == pytest.approx(hertz.force_n, rel=1e-6)
    assert time[-1] == pytest.approx(hertz.duration_s, rel=1e-6)
    inertia = np.array([1.0, 2.4, 2.6])
    time = np.linspace(0.0, 3.0, 3001)
    omega, _ = euler_solution(inertia, 0.8, 2.5, time)
    slope = np.gradient(omega, time, axis=1)[:, 1:-1]
    expected = -np.cross(omega.T, inertia * omega.T).T[:, 1:-1] / inertia[:, None]
    assert np.abs(slope - expected).max() < 1e-5
    value_error("first is 2", euler_solution, inertia, 2.0, 0.5, time)


CONFIG = PipelineConfig.load(ROOT / "config/quick.yaml").config
REPRESENTATIVE = dict(
    e_gg=0.203, mus_gg=0.642, mur_gg=0.037, e_gp=0.244, mus_gp=0.483, mur_gp=0.185
)


@pytest.fixture
def time_steps(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module("time_steps")


def test_medians_are_set_beside_the_kernel_and_particles_are_poured_in_turn(
    monkeypatch,
):
    pours = {
        "a": [(80.0, 9.0), (100.0, 12.0), (300.0, 10.0)],
        "b": [(250.0, 30.0), (20.0, 31.0), (251.0, 5.0)],
    }
    found = speed.summary([40.0, 700.0, 50.0], pours)
    assert found["reference_us"] == 50.0
    names, rows = (
        ("name", "us_per_step", "job_s", "ratio", "to_first"),
        [("a", 100.0, 10.0, 2.0, 1.0)],
    )
    rows.append(("b", 250.0, 30.0, 5.0, 2.5))
    assert found["particles"] == [dict(zip(names, row, strict=True)) for row in rows]
    table = speed.message(
        found | {"berries": 500, "time_step_s": 2e-4} | speed.machine()
    ).splitlines()
    assert f"vectors of {speed.machine()['vector_bits']} bits" in table[0]
    assert [" ".join(line.split()) for line in table[3:]] == [
        "a 100.0 1.00 2.000 10.00",
        "b 250.0 2.50 5.000 30.00",
    ]
    asked = []

    def pour(config, parameters, seed, particle, berry):
        asked.append((particle, config["funnel"]["berries"]))
        assert (parameters, seed, berry) == (REPRESENTATIVE, 1, "berry")
        return {"A": 100.0, "B": 250.0}[particle], 10.0

    monkeypatch.setattr(speed, "timed_pour", pour)
    found = speed.run(CONFIG, {"a": "A", "b": "B"}, "berry", REPRESENTATIVE)
    assert asked == [("A", 2), ("B", 2)] + 3 * [
        ("A", CONFIG["funnel"]["berries"]),
        ("B", CONFIG["funnel"]["berries"]),
    ]
    assert (found["berries"], found["time_step_s"]) == (
        CONFIG["funnel"]["berries"],
        4.9e-4,
    )
    assert [row["to_first"] for row in found["particles"]] == [1.0, 2.5]


def test_the_reference_kernel_does_every_step_and_the_solution_is_the_published_one():
    x = 1.0
    for k in range(500):
        x = np.sqrt(x * 1.0000001 + 1e-9 * k) / (1.0 + 1e-7 * x)
    assert speed.reference_kernel(500) == pytest.approx(x, rel=1e-12)
    path = "resources/published/table4.csv"
    assert published.representative(path) == REPRESENTATIVE
    input_error(
        "column gamma_gg is 'missing'",
        published.representative,
        path,
        (*REPRESENTATIVE, "gamma_gg"),
    )


def test_a_step_beyond_the_limit_is_refused_with_the_limit_named(time_steps):
    rows = list(
        time_steps.rows(PipelineConfig.load(ROOT / "config/quick.yaml"), seeds=0, pairs=0)
    )
    assert [row[0] for row in rows if len(row) == 2] == [1e-3]
    # an eighth of 2.868 (m*^2 / (R* E*^2 v))^0.2 at 2 m/s, for spheres of radius 6.67 mm
    young = 1.1352e5 / (2.0 * (1.0 - 0.32**2))
    mass = 0.5 * 840.47 * 4.0 / 3.0 * math.pi * 0.00667**3
    limit = 2.868 * (mass**2 / (0.003335 * young**2 * 2.0)) ** 0.2 / 8.0
    for row in rows:
        if len(row) == 2:
            named = float(
                re.search(r"expected above 0, at most ([-+.e\d]+)", row[1]).group(1)
            )
            assert named == pytest.approx(limit, rel=2e-3)
    assert next(row for row in rows if row[1] == "restitution")[2] == pytest.approx(
        0.2, rel=0.01
    )


@pytest.mark.parametrize(
    "names", [["aor_deg"], ["aor_deg", "height_mm", "base_radius_mm", "drum_slip_deg"]]
)
def test_piles_are_compared_by_the_targets_of_the_configuration(
    names, time_steps, monkeypatch
):
    record = {
        "status": "ok",
        "aor_deg": 30.0,
        "height_mm": 60.0,
        "base_radius_mm": 110.0,
    }
    pours = [
        record,
        {
            name: value + 2 if name != "status" else value
            for name, value in record.items()
        },
    ]
    monkeypatch.setattr(time_steps, "TIME_STEPS_S", (2e-4,))
    monkeypatch.setattr(
        time_steps, "runs_of", lambda step_s, study, seeds: pours[:seeds]
    )
    monkeypatch.setattr(time_steps, "restitutions", lambda step_s, **laws: [0.2, 0.2])
    monkeypatch.setattr(
        time_steps,
        "oblique_errors",
        lambda step_s, **laws: {"sticks": 0.1, "slides": 0.2},
    )
    config = CONFIG | {"targets": [TARGETS[0] | {"response": name} for name in names]}
    found = {
        row[1]: row[2:]
        for row in time_steps.rows(SimpleNamespace(config=config), seeds=2, pairs=0)
    }
    assert set(found) == {"restitution", "error of hits that stick, slide", *names}
    assert found["aor_deg"] == (31.0, pytest.approx(1.0), 2)
    assert found.get("drum_slip_deg") in (None, (*mean_and_error([]), 0))
