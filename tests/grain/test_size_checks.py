"""Groups of sizes and the largest volume of three axes, with known answers."""

import math

import numpy as np
import pytest

from repose.grain import size_checks

SAMPLES = 400
# Of so many samples that are split with probability SIGNIFICANCE, more are split once in
# 2,000 times.
MOST_SPLIT = 11


def slow_split(values):
    """Try every split, and compute the variance between and within the groups."""
    ordered = sorted(values)
    mean = sum(ordered) / len(ordered)
    total = sum((value - mean) ** 2 for value in ordered)
    shares = []
    for n_small in range(1, len(ordered)):
        within = 0.0
        for group in (ordered[:n_small], ordered[n_small:]):
            centre = sum(group) / len(group)
            within += sum((value - centre) ** 2 for value in group)
        shares.append((1 - within / total, n_small))
    return max(shares)


def test_the_best_split_is_that_of_all_splits():
    rng = np.random.default_rng(1)
    for n_values in (2, 3, 5, 30):
        values = rng.normal(size=n_values)
        explained, n_small = slow_split(values)
        split = size_checks.find_best_split(values)
        assert split.n_small == n_small
        assert split.explained == pytest.approx(explained)
    assert size_checks.find_best_split(np.ones(5)).explained == 0


def test_many_normal_and_uniform_values_have_known_shares():
    rng = np.random.default_rng(2)
    normal = size_checks.find_best_split(rng.normal(size=100_000)).explained
    assert normal == pytest.approx(2 / math.pi, abs=0.01)
    uniform = size_checks.find_best_split(rng.random(100_000)).explained
    assert uniform == pytest.approx(3 / 4, abs=0.01)


@pytest.mark.parametrize("n_grains", [10, 50])
@pytest.mark.parametrize("kind", ["normal", "wide", "uniform"])
def test_grains_of_one_kind_are_no_groups(kind, n_grains):
    rng = np.random.default_rng(n_grains)
    shape = (SAMPLES, n_grains)
    samples = {
        "normal": rng.normal(10, 2, shape).clip(1),
        "wide": rng.lognormal(1, 0.6, shape),
        # The largest spread of one kind, in the logarithm that is judged
        "uniform": np.exp(rng.random(shape)),
    }[kind]
    found = [size_checks.find_size_groups(sample) is not None for sample in samples]
    assert sum(found) <= MOST_SPLIT


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_two_groups_are_found_with_their_sizes(share):
    rng = np.random.default_rng(3)
    n_large = round(60 * share)
    small = rng.normal(1.2, 0.05, 60 - n_large)
    large = rng.normal(3.0, 0.1, n_large)
    groups = size_checks.find_size_groups(rng.permutation([*small, *large]))
    assert groups.counts == (60 - n_large, n_large)
    assert groups.diameters_mm == pytest.approx((1.2, 3.0), rel=0.02)
    assert groups.ratio == pytest.approx(2.5, rel=0.03)


def test_two_or_three_grains_are_no_groups():
    assert size_checks.find_size_groups(np.array([1.0, 3.0])) is None
    assert size_checks.find_size_groups(np.array([1.0, 3.0, 3.1])) is None


def test_the_largest_volume_is_that_of_ball_and_box():
    assert size_checks.compute_largest_volume([3, 3, 3]) == pytest.approx(
        math.pi / 6 * 27
    )
    # A thin plate: the disc of the long axis, times the thickness
    plate = math.pi / 4 * 4 * 1e-3
    assert size_checks.compute_largest_volume([2, 2, 1e-3]) == pytest.approx(
        plate, rel=1e-6
    )
    # A long needle fills its box
    assert size_checks.compute_largest_volume([50, 1, 1]) == pytest.approx(50, rel=1e-3)
    # Random points of the box that lie in the ball
    axes = np.array([21.14, 11.37, 9.88])
    points = np.random.default_rng(4).uniform(-0.5, 0.5, (400_000, 3)) * axes
    share = np.mean(np.linalg.norm(points, axis=1) < 0.5 * axes[0])
    error = math.sqrt(share * (1 - share) / len(points))
    assert size_checks.compute_largest_volume(axes) / axes.prod() == pytest.approx(
        share, abs=4 * error
    )
