"""Variance between and within samples: variance components with known answers, by hand and by simulation."""

import numpy as np
import pytest
from refusals import value_error
from scipy import stats

from repose.core import variance


def normal_model(random, sizes, tau, sigma, mean=30.0):
    """Values and groups of y_ij = mean + a_i + e_ij."""
    groups = np.repeat(np.arange(len(sizes)), sizes)
    return mean + (tau * random.normal(size=len(sizes)))[groups] + sigma * random.normal(size=len(groups)), groups


def test_components_of_a_table_worked_by_hand():
    """Groups (1, 3), (5, 7), (3, 5, 7): MSW = (2 + 2 + 8) / 4 = 3; means 2, 6, 5 about 31 / 7."""
    values = [1, 3, 5, 7, 3, 5, 7]
    one = variance.variance_components(values, list("aabbccc"))
    between_square = (2 * (2 - 31 / 7) ** 2 + 2 * (6 - 31 / 7) ** 2 + 3 * (5 - 31 / 7) ** 2) / 2
    n0 = (7 - (4 + 4 + 9) / 7) / 2
    assert one.within == pytest.approx(3)
    assert one.between == pytest.approx((between_square - 3) / n0)
    assert one.harmonic_seeds == pytest.approx(3 / (1 / 2 + 1 / 2 + 1 / 3))
    assert (one.groups, one.values) == (3, 7)
    # the means' variance is 13 / 3; F quantiles with 2 and 4 degrees of freedom (TH78)
    h = one.harmonic_seeds
    least, most = ((h * (13 / 3) / (3 * stats.f.ppf(q, 2, 4)) - 1) / h for q in (0.975, 0.025))
    assert least < one.icc_low == 0
    assert one.icc_high == pytest.approx(most / (1 + most))
    assert (one.within_low, one.within_high) == pytest.approx([12 / stats.chi2.ppf(q, 4) for q in (0.975, 0.025)])


def test_components_are_unbiased_and_intervals_cover_with_failed_pours():
    """tau = 2, sigma = 1.5, groups of 8 of which a third has lost pours: icc = 4 / 6.25."""
    random = np.random.default_rng(5)
    sizes = np.where(np.arange(40) % 3 == 0, 3, 8)
    found = [variance.variance_components(*normal_model(random, sizes, 2.0, 1.5)) for _ in range(400)]
    for name, true in (("within", 2.25), ("between", 4.0)):
        values = np.array([getattr(components, name) for components in found])
        assert values.mean() == pytest.approx(true, abs=4 * values.std() / 20)
    for name, true in (("icc", 0.64), ("within", 2.25)):
        inside = [getattr(one, f"{name}_low") <= true <= getattr(one, f"{name}_high") for one in found]
        assert 0.91 < np.mean(inside) < 0.985  # 0.95 +- 3.3 standard errors of 400


def test_no_difference_between_samples_has_no_explainable_variance():
    random = np.random.default_rng(2)
    values, groups = normal_model(random, [6] * 30, 0.0, 1.0)
    one = variance.variance_components(values, groups)
    assert one.icc_low == 0
    assert one.icc < 0.15


def test_reachable_r2_is_what_the_true_means_reach():
    """The true means of 4000 samples as predictions of means of k noisy seeds."""
    random = np.random.default_rng(3)
    true = 2.0 * random.normal(size=4000)
    one = variance.Components(1, 1, 0.0, 2.25, 2.25, 2.25, 4.0, 0.64, 0.6, 0.7, 8.0)
    for seeds in (1, 4, 16):
        seen = true + 1.5 / np.sqrt(seeds) * random.normal(size=4000)
        reached = 1 - np.sum((seen - true) ** 2) / np.sum((seen - seen.mean()) ** 2)
        assert one.reachable_r2(seeds) == pytest.approx(reached, abs=0.02)


def test_seeds_for_a_standard_error():
    one = variance.Components(1, 1, 0.0, 2.25, 2.25, 2.25, 4.0, 0.64, 0.6, 0.7, 8.0)
    assert one.seeds_for(0.5) == 9  # 1.5 / sqrt(9) exactly
    assert one.seeds_for(0.499) == 10
    assert one.seeds_for(5.0) == 1
    value_error("standard_error is 0", one.seeds_for, 0)


def test_residual_correlation_leaves_out_what_lies_between_samples():
    random = np.random.default_rng(4)
    groups = np.repeat(np.arange(200), 6)
    shift = 10 * random.normal(size=200)
    pair = random.multivariate_normal([0, 0], [[1, 0.5], [0.5, 1]], size=1200)
    shifted = pair[:, 0] + shift[groups], pair[:, 1] - shift[groups]
    value, low, high, freedom = variance.residual_correlation(*shifted, groups)
    assert freedom == 1000
    assert low < 0.5 < high
    assert high - low == pytest.approx(2 * 1.96 * (1 - value**2) / np.sqrt(998), rel=0.02)


@pytest.mark.parametrize(
    ("values", "groups", "message"),
    [
        ([1.0, 2.0], ["a", "b"], "2 values in 2 groups"),
        ([1.0, 2.0], ["a", "a"], "2 values in 1 groups"),
        ([1.0, np.nan], ["a", "a"], "finite"),
        ([1.0], ["a", "a"], r"shape \(1,\)"),
    ],
)
def test_bad_values_are_reported(values, groups, message):
    value_error(message, variance.variance_components, values, groups)
