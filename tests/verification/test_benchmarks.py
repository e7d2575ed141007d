"""The benchmarks time and vary what they say; how fast that is, is no test."""

import importlib
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from refusals import input_error
from shared import TARGETS

from repose.config.study import Study
from repose.core import published
from repose.core.runs import mean_and_error
from repose.verification import speed

ROOT = Path(__file__).parents[2]
CONFIG = Study.load(ROOT / "config/quick.yaml").config
REPRESENTATIVE = dict(e_gg=0.203, mus_gg=0.642, mur_gg=0.037, e_gp=0.244, mus_gp=0.483, mur_gp=0.185)


@pytest.fixture
def time_steps(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module("time_steps")


def test_medians_are_set_beside_the_kernel_and_the_first_particle():
    pours = {"a": [(80.0, 9.0), (100.0, 12.0), (300.0, 10.0)], "b": [(250.0, 30.0), (20.0, 31.0), (251.0, 5.0)]}
    found = speed.summary([40.0, 700.0, 50.0], pours)
    assert found["reference_us"] == 50.0
    assert found["particles"] == [
        {"name": "a", "us_per_step": 100.0, "job_s": 10.0, "ratio": 2.0, "to_first": 1.0},
        {"name": "b", "us_per_step": 250.0, "job_s": 30.0, "ratio": 5.0, "to_first": 2.5},
    ]
    table = speed.message(found | {"berries": 500, "time_step_s": 2e-4} | speed.machine()).splitlines()
    assert f"vectors of {speed.machine()['vector_bits']} bits" in table[0]
    assert [line.split() for line in table[3:]] == [
        ["a", "100.0", "1.00", "2.000", "10.00"],
        ["b", "250.0", "2.50", "5.000", "30.00"],
    ]


def test_particles_are_poured_in_turn_after_a_small_pour_of_each(monkeypatch):
    asked = []

    def pour(config, parameters, seed, particle, berry):
        asked.append((particle, config["funnel"]["berries"]))
        assert (parameters, seed, berry) == (REPRESENTATIVE, 1, "berry")
        return {"A": 100.0, "B": 250.0}[particle], 10.0

    monkeypatch.setattr(speed, "timed_pour", pour)
    found = speed.run(CONFIG, {"a": "A", "b": "B"}, "berry", REPRESENTATIVE)
    assert asked == [("A", 2), ("B", 2)] + 3 * [("A", CONFIG["funnel"]["berries"]), ("B", CONFIG["funnel"]["berries"])]
    assert (found["berries"], found["time_step_s"]) == (CONFIG["funnel"]["berries"], 4.9e-4)
    assert [row["to_first"] for row in found["particles"]] == [1.0, 2.5]


def test_the_reference_kernel_does_every_step_of_its_chain():
    x = 1.0
    for k in range(500):
        x = np.sqrt(x * 1.0000001 + 1e-9 * k) / (1.0 + 1e-7 * x)
    assert speed.reference_kernel(500) == pytest.approx(x, rel=1e-12)


def test_the_representative_solution_is_the_published_one():
    path = "resources/published/table4.csv"
    assert published.representative(path) == REPRESENTATIVE
    input_error("column gamma_gg is 'missing'", published.representative, path, (*REPRESENTATIVE, "gamma_gg"))


def test_a_step_beyond_the_limit_is_refused_with_the_limit_named(time_steps):
    study = Study.load(ROOT / "config/quick.yaml")
    rows = list(time_steps.rows(study, seeds=0, pairs=0))
    assert [row[0] for row in rows if len(row) == 2] == [1e-3]
    # an eighth of 2.868 (m*^2 / (R* E*^2 v))^0.2 at 2 m/s, for spheres of radius 6.67 mm
    young = 1.1352e5 / (2.0 * (1.0 - 0.32**2))
    mass = 0.5 * 840.47 * 4.0 / 3.0 * math.pi * 0.00667**3
    limit = 2.868 * (mass**2 / (0.003335 * young**2 * 2.0)) ** 0.2 / 8.0
    for row in rows:
        if len(row) == 2:
            named = float(re.search(r"expected above 0, at most ([-+.e\d]+)", row[1]).group(1))
            assert named == pytest.approx(limit, rel=2e-3)
    finest = next(row for row in rows if row[1] == "restitution")
    assert finest[2] == pytest.approx(0.2, rel=0.01)


@pytest.mark.parametrize("names", [["aor_deg"], ["aor_deg", "height_mm", "base_radius_mm", "drum_slip_deg"]])
def test_piles_are_compared_by_the_targets_of_the_configuration(names, time_steps, monkeypatch):
    record = {"status": "ok", "aor_deg": 30.0, "height_mm": 60.0, "base_radius_mm": 110.0}
    pours = [record, {name: value + 2 if name != "status" else value for name, value in record.items()}]
    monkeypatch.setattr(time_steps, "TIME_STEPS_S", (2e-4,))
    monkeypatch.setattr(time_steps, "runs_of", lambda step_s, study, seeds: pours[:seeds])
    monkeypatch.setattr(time_steps, "restitutions", lambda step_s, **laws: [0.2, 0.2])
    monkeypatch.setattr(time_steps, "oblique_errors", lambda step_s, **laws: {"sticks": 0.1, "slides": 0.2})
    config = CONFIG | {"targets": [TARGETS[0] | {"response": name} for name in names]}
    found = {row[1]: row[2:] for row in time_steps.rows(SimpleNamespace(config=config), seeds=2, pairs=0)}
    assert set(found) == {"restitution", "error of hits that stick, slide", *names}
    assert found["aor_deg"] == (31.0, pytest.approx(1.0), 2)
    assert found.get("drum_slip_deg") in (None, (*mean_and_error([]), 0))
