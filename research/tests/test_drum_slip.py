"""The motion of grains in the frame of the drum, with known answers."""

import numpy as np
import pytest

from research.answers.drum_slip import cases, motion_against_drum

BOTTOM = np.array([[0.0, 0.05, -0.1]])  # on the shell of a drum of 0.1 m


def test_a_grain_that_is_carried_does_not_move_in_the_drum():
    side = np.array([[0.1, 0.05, 0.0]])  # the bottom is carried towards +x
    motion = motion_against_drum(BOTTOM, side, 90.0)
    assert motion == pytest.approx(np.zeros((1, 3)), abs=1e-12)


def test_a_grain_that_stays_moves_by_the_chord_of_the_rotation():
    motion = motion_against_drum(BOTTOM, BOTTOM, 27.0)
    chord = 2 * 0.1 * np.sin(np.radians(27.0) / 2)
    assert np.linalg.norm(motion) == pytest.approx(chord)


def test_a_motion_along_the_axis_counts():
    moved = np.array([[0.1, 0.07, 0.0]])
    motion = motion_against_drum(BOTTOM, moved, 90.0)
    assert motion == pytest.approx(np.array([[0.0, 0.02, 0.0]]), abs=1e-12)


def test_only_the_wall_friction_differs_between_the_cases_of_the_article():
    names = ("e_gg", "mus_gg", "mur_gg", "e_gp", "mus_gp", "mur_gp")
    sets = cases(names)
    article = sets["article's answer"]
    smoother = sets["article's answer, mus_gp 0.2"]
    different = {name for name in names if article[name] != smoother[name]}
    assert different == {"mus_gp"}
    assert smoother["mus_gp"] == 0.2
