"""Random pours go through every bench test."""

from pour import SCENES

from repose.apparatus import names


def test_every_bench_test_has_a_random_scene():
    assert sorted(SCENES) == sorted(names())
