"""Sizes of single berries: moments, limits and where their spread comes from."""

import numpy as np
import pytest
from scipy.stats import truncnorm

from repose.core.errors import InputError
from repose.particle import size_distribution

GOJI = (15.40, 10.41, 13.32)  # equivalent diameter of Table 1: maximum, minimum, mean


def test_the_spread_of_a_published_range():
    sd, low, high = size_distribution.of_range(*GOJI)
    assert sd == pytest.approx(4.99 / 4.498 / 13.32)
    assert (low, high) == pytest.approx((10.41 / 13.32, 15.40 / 13.32))
    # What 4.498 stands for: the mean range of 50 normal values.
    ranges = np.ptp(np.random.default_rng(1).normal(size=(20000, 50)), axis=1)
    assert ranges.mean() == pytest.approx(size_distribution.PUBLISHED_RANGE_SD, abs=0.02)


def test_measured_sizes_have_their_own_spread():
    assert size_distribution.of_sizes([9.0, 10.0, 11.0]) == pytest.approx((0.1, 0.9, 1.1))


def test_scales_have_the_moments_asked_for():
    spread = size_distribution.of_range(*GOJI)
    drawn = size_distribution.draw(np.random.default_rng(2), 200_000, *spread)
    assert np.mean(drawn**3) == pytest.approx(1.0, abs=2e-3)
    sd, low, high = spread
    theirs = truncnorm((low - 1) / sd, (high - 1) / sd, 1, sd)
    norm = np.cbrt(theirs.moment(3))
    assert size_distribution.normalisation(*spread) == pytest.approx(norm, rel=1e-9)
    assert drawn.std() == pytest.approx(theirs.std() / norm, rel=0.01)
    assert drawn.min() >= low / norm
    assert drawn.max() <= high / norm


def test_a_pour_draws_from_its_seed():
    berry = dict(zip(size_distribution.KEYS, size_distribution.of_range(*GOJI), strict=True))
    first, largest = size_distribution.of_pour("measured", berry, 7, 500)
    again, _ = size_distribution.of_pour("measured", berry, 7, 500)
    other, _ = size_distribution.of_pour("measured", berry, 8, 500)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.05
    assert first.max() <= largest
    alike, one = size_distribution.of_pour("none", {}, 7, 3)
    assert alike.tolist() == [1, 1, 1]
    assert one == 1
    with pytest.raises(InputError, match="scale_sd"):
        size_distribution.of_pour("measured", {}, 7, 3)


def test_the_largest_scale_is_that_of_the_upper_limit():
    berry = {"scale_sd": 0.4, "scale_low": 0.3, "scale_high": 1.2}
    scales, most = size_distribution.of_pour("measured", berry, 1, 20_000)
    assert most - 1e-3 < scales.max() <= most
