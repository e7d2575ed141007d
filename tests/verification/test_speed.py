"""The benchmark times what it says; how fast that is, is no test."""

import pytest
from test_scenes import BERRY, particle, small

from repose.verification import speed


def test_particles_are_timed_in_turn_and_set_beside_the_first(monkeypatch):
    monkeypatch.setattr(speed, "ROUNDS", 1)
    result = speed.run(small(berries=20, duration_s=2.0), {"a": particle(), "b": particle()}, BERRY)
    first, second = result["particles"]
    assert (first["name"], first["to_first"], second["name"]) == ("a", 1.0, "b")
    assert second["to_first"] == pytest.approx(second["us_per_step"] / first["us_per_step"], rel=0.02)
    assert first["ratio"] == pytest.approx(first["us_per_step"] / result["reference_us"], rel=0.02)
    assert first["job_s"] > 0
    table = speed.message(result).splitlines()
    assert [line.split()[0] for line in table[2:]] == ["a", "b"]
