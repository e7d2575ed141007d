"""The benchmark times what it says; how fast that is, is no test."""

from pathlib import Path

import numpy as np
import pytest

from repose.config.study import Study
from repose.core import published
from repose.verification import speed

CONFIG = Study.load(Path(__file__).parents[2] / "config/quick.yaml").config
REPRESENTATIVE = dict(e_gg=0.203, mus_gg=0.642, mur_gg=0.037, e_gp=0.244, mus_gp=0.483, mur_gp=0.185)


def test_medians_are_set_beside_the_kernel_and_the_first_particle():
    pours = {
        "a": [(80.0, 9.0), (100.0, 12.0), (300.0, 10.0)],
        "b": [(250.0, 30.0), (20.0, 31.0), (251.0, 5.0)],
    }
    found = speed.summary([40.0, 700.0, 50.0], pours)
    assert found["reference_us"] == 50.0
    assert found["particles"] == [
        {"name": "a", "us_per_step": 100.0, "job_s": 10.0, "ratio": 2.0, "to_first": 1.0},
        {"name": "b", "us_per_step": 250.0, "job_s": 30.0, "ratio": 5.0, "to_first": 2.5},
    ]
    table = speed.message(found | {"berries": 500, "time_step_s": 2e-4}).splitlines()
    assert [line.split() for line in table[2:]] == [
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
    assert asked == [("A", 2), ("B", 2)] + 3 * [("A", 500), ("B", 500)]
    assert (found["berries"], found["time_step_s"]) == (500, 2e-4)
    assert [row["to_first"] for row in found["particles"]] == [1.0, 2.5]


def test_the_reference_kernel_does_every_step_of_its_chain():
    x = 1.0
    for k in range(500):
        x = np.sqrt(x * 1.0000001 + 1e-9 * k) / (1.0 + 1e-7 * x)
    assert speed.reference_kernel(500) == pytest.approx(x, rel=1e-12)


def test_the_representative_solution_is_the_published_one():
    assert published.representative("resources/published/table4.csv") == REPRESENTATIVE
