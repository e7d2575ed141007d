"""The search of a fitted surface for its targets."""

import numpy as np
import pytest

from repose.doe.box_behnken import box_behnken
from repose.doe.model import fit
from repose.doe.optimum import desirability, optimum

RUNS, _ = box_behnken(3)


def surface(of):
    """The quadratic model of a function of the coded factors."""
    return fit(RUNS, of(*RUNS.T), "ABC", "quadratic")


def test_one_target_and_a_plane_are_met_at_the_foot_of_the_perpendicular():
    # 10 + 3 A + 4 B = 12: the nearest point to the centre is (3, 4) * 2 / 25
    found = optimum([surface(lambda a, b, c: 10 + 3 * a + 4 * b)], [12], [12], [9], [15])
    assert found.met
    assert found.coded == pytest.approx([6 / 25, 8 / 25, 0], abs=1e-6)
    assert found.desirability == pytest.approx(1, abs=1e-5)


def test_two_curved_responses_are_met_together():
    models = [
        surface(lambda a, b, c: 32 + 2 * a - b + 0.6 * a * b - 0.5 * c**2),
        surface(lambda a, b, c: 65 + a + 3 * c + 0.8 * b**2),
    ]
    found = optimum(models, [33.0, 66.0], [33.0, 66.0], [31, 64], [35, 68])
    assert found.met
    assert found.predicted == pytest.approx([33, 66], abs=1e-4)
    # nothing nearer to the centre meets both: a fine grid of the ball inside
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 81)] * 3), axis=-1).reshape(-1, 3)
    inside = grid[np.linalg.norm(grid, axis=1) < np.linalg.norm(found.coded) - 0.05]
    near = np.abs(models[0].predict(inside) - 33) / 2 + np.abs(models[1].predict(inside) - 66) / 3
    assert near.min() > 0.03


def test_a_target_out_of_reach_ends_at_the_edge():
    found = optimum([surface(lambda a, b, c: 10 + 3 * a + 4 * b)], [30], [30], [20], [40])
    assert not found.met
    assert found.coded[:2] == pytest.approx([1, 1])
    assert found.predicted[0] == pytest.approx(17)
    assert found.desirability == 0


def test_weights_share_a_miss():
    # 10 + 3 A cannot be 11 and 12 at once: with scales 1 and 1 it ends in the middle, with 1 and 2 nearer to the first
    plane = surface(lambda a, b, c: 10 + 3 * a)
    assert optimum([plane, plane], [11, 12], [1, 1], [0, 0], [20, 20]).predicted[0] == pytest.approx(11.5, abs=1e-4)
    assert optimum([plane, plane], [11, 12], [1, 2], [0, 0], [20, 20]).predicted[0] == pytest.approx(11.2, abs=1e-4)


def test_desirability_is_a_tent():
    found = desirability([[10], [11], [12], [13.5], [15], [16]], [12], [10], [15])
    assert found == pytest.approx([0, 0.5, 1, 0.5, 0, 0])
    assert desirability([[11, 5]], [12, 5], [10, 4], [15, 6]) == pytest.approx([0.5**0.5])
