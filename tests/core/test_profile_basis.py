"""A profile as numbers: what the scores say, and that they keep the distance of two profiles."""

import numpy as np
import pytest

from repose.core.profiles import Profile

X = np.sort(np.random.default_rng(1).uniform(-24.0, 20.0, 23))  # at no regular distance


def of(heights, functions=5):
    return Profile("surface_mm", tuple(X), tuple(heights), functions)


def test_the_distance_of_two_smooth_profiles_is_that_of_their_scores():
    profile, random = of(X), np.random.default_rng(2)
    one, other = random.normal(size=(2, 5))
    off = profile.heights(one) - profile.heights(other)
    assert np.mean(off**2) == pytest.approx(np.sum((one - other) ** 2), rel=1e-12)
    np.testing.assert_allclose(profile.scores(profile.heights(one)), one, atol=1e-12)


def test_what_the_functions_leave_over_stands_apart():
    """Parseval with the residual: mean square of all heights, of the scores, of the rest."""
    heights = 20 * np.cos(X / 8)
    profile = of(heights)
    assert np.mean(heights**2) == pytest.approx(profile.height**2 + profile.residual**2, rel=1e-12)
    assert profile.residual > 0.1
    assert of(3 + X - 0.01 * X**2 + 1e-3 * X**3, functions=4).residual < 1e-12


def test_a_straight_profile_has_a_mean_and_a_slope():
    mean, slope, *others = of(2.0 - 0.8 * X).scores(2.0 - 0.8 * X)
    assert mean == pytest.approx(np.mean(2.0 - 0.8 * X))
    assert slope == pytest.approx(-0.8 * np.std(X))
    np.testing.assert_allclose(others, 0.0, atol=1e-12)


def test_scores_within_a_percent_are_profiles_within_a_percent():
    profile = of(2.0 - 0.8 * X)
    off = profile.heights(0.01 * profile.whole * np.array([1, -1, 1, 1, -1]))
    assert np.sqrt(np.mean(off**2)) == pytest.approx(0.01 * profile.height)


def test_the_scores_have_names_with_the_unit():
    names = ("surface_1_mm", "surface_2_mm", "surface_3_mm")
    assert tuple(of(X, functions=3).columns(X)) == names
