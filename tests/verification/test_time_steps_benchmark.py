"""benchmarks/time_steps.py, of whose tables docs/verification.md has some."""

import importlib
import math
import re
from types import SimpleNamespace

import pytest
from refusals import input_error
from shared import ROOT, TARGETS

from repose.calibrate.runs import mean_and_error
from repose.config.pipeline import PipelineConfig
from repose.stages import published

QUICK = PipelineConfig.load(ROOT / "config/quick.yaml")


@pytest.fixture
def time_steps(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module("time_steps")


def test_the_representative_solution_is_the_published_one():
    path = "resources/published/table4.csv"
    representative = published.read_representative(path)
    assert representative == {
        "e_gg": 0.203,
        "mus_gg": 0.642,
        "mur_gg": 0.037,
        "e_gp": 0.244,
        "mus_gp": 0.483,
        "mur_gp": 0.185,
    }
    input_error(
        "column gamma_gg is 'missing'",
        published.read_representative,
        path,
        (*representative, "gamma_gg"),
    )


def test_a_step_beyond_the_limit_is_refused_with_the_limit_named(time_steps):
    rows = list(time_steps.rows(QUICK, seeds=0, pairs=0))
    refusals = [row for row in rows if len(row) == 2]
    assert [row[0] for row in refusals] == [1e-3]
    # an eighth of 2.868 (m*^2 / (R* E*^2 v))^0.2 at 2 m/s, for spheres of radius 6.67
    # mm
    young = 1.1352e5 / (2.0 * (1.0 - 0.32**2))
    mass = 0.5 * 840.47 * 4.0 / 3.0 * math.pi * 0.00667**3
    limit = 2.868 * (mass**2 / (0.003335 * young**2 * 2.0)) ** 0.2 / 8.0
    number = re.search(r"expected above 0, at most ([-+.e\d]+)", refusals[0][1]).group(
        1
    )
    assert float(number) == pytest.approx(limit, rel=2e-3)
    restitution = next(row for row in rows if row[1] == "restitution")
    assert restitution[2] == pytest.approx(0.2, rel=0.01)


@pytest.mark.parametrize(
    "names", [["aor_deg"], ["aor_deg", "height_mm", "base_radius_mm", "drum_slip_deg"]]
)
def test_piles_are_compared_by_the_targets_of_the_configuration(
    names, time_steps, monkeypatch
):
    pile = {"aor_deg": 30.0, "height_mm": 60.0, "base_radius_mm": 110.0}
    other = {name: value + 2 for name, value in pile.items()}
    runs = [{"status": "ok", **pile}, {"status": "ok", **other}]
    errors = {"sticks": 0.1, "slides": 0.2}
    monkeypatch.setattr(time_steps, "TIME_STEPS_S", (2e-4,))
    monkeypatch.setattr(
        time_steps, "runs_of", lambda step_s, study, seeds: runs[:seeds]
    )
    monkeypatch.setattr(time_steps, "restitutions", lambda step_s, **laws: [0.2, 0.2])
    monkeypatch.setattr(time_steps, "oblique_errors", lambda step_s, laws: errors)
    targets = [TARGETS[0] | {"response": name} for name in names]
    study = SimpleNamespace(config=QUICK.config | {"targets": targets})
    rows = {row[1]: row[2:] for row in time_steps.rows(study, seeds=2, pairs=0)}
    assert set(rows) == {"restitution", "error of hits that stick, slide", *names}
    assert rows["aor_deg"] == (31.0, pytest.approx(1.0), 2)
    assert rows.get("drum_slip_deg") in (None, (*mean_and_error([]), 0))
